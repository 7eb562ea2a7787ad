//! `holonomy transport`: geodesics and pixels' rays followed through the faces of a space.

use super::{
    Failure, Outcome, TransportArgs,
    batch::{self, Case},
    geodesic::{direction_numbers, point_numbers, start_from_numbers},
    print_line,
};
use crate::{
    geometry::{Geodesic, Geometry, Visitor, visit},
    render::{Shot, cpu::traverse::Tracer, plan::Plan, world::World},
    scene::{Scene, Shading, file},
    space::{
        Space,
        domain::Domain,
        observer::Frame,
        reduce::{MAX_FACES, reduce_frame, transport},
        walk::Status,
    },
};
use anyhow::anyhow;
use serde_json::{Value, json};
use std::io::stdout;

pub(super) fn run(args: &TransportArgs) -> Outcome {
    if let Some(pixel) = args.pixel {
        let scene = file::load(&args.scene).map_err(Failure::refused)?;
        let value = follow_pixel(scene, args, pixel)?;
        return print_line(&mut stdout().lock(), &value.to_string()).map(|_| ());
    }
    let space = file::load_space(&args.scene).map_err(Failure::refused)?;
    if args.cell >= space.cells.len() {
        let most = space.cells.len() - 1;
        return Err(Failure::refused(anyhow!("--cell {}: the last cell of {} is {most}", args.cell, space.name)));
    }
    let domain = Domain::new(&space);
    if let Some(path) = &args.start.batch {
        return batch::run(path, |lines| {
            let follow = |value: Value| {
                let case = Case::new(&value, &["from", "direction", "length"])?;
                let (from, direction) = (case.vector("from")?, case.vector("direction")?);
                follow(&space, &domain, args.cell, &from, &direction, case.number("length")?)
            };
            Ok(lines.into_iter().map(|line| line.and_then(follow)).collect())
        });
    }
    let missing = |what: &str| Failure::refused(anyhow!("{what} is missing (or use --batch or --pixel)"));
    let from = args.start.from.as_ref().ok_or_else(|| missing("--from"))?;
    let direction = args.start.direction.as_ref().ok_or_else(|| missing("--direction"))?;
    let length = args.start.length.ok_or_else(|| missing("--length"))?;
    let value = follow(&space, &domain, args.cell, from, direction, length);
    let value = value.map_err(|error| Failure::refused(anyhow!(error)))?;
    print_line(&mut stdout().lock(), &value.to_string()).map(|_| ())
}

/// Follows one geodesic of the quotient.
fn follow(
    space: &Space,
    domain: &Domain,
    cell: usize,
    from: &[f64],
    direction: &[f64],
    length: f64,
) -> Result<Value, String> {
    struct Follow<'a>(&'a Domain, usize, Geodesic, f64);
    impl Visitor for Follow<'_> {
        type Output = Result<crate::space::reduce::Arrival, String>;
        fn visit<G: Geometry>(self, geometry: G) -> Self::Output {
            let Self(domain, cell, start, length) = self;
            // A start outside of the cell is moved into it; the pairings on the way are no passages of the geodesic.
            let axes = [start.velocity; 3];
            let frame = reduce_frame(geometry, domain, Frame { cell, point: start.point, axes })
                .ok_or_else(|| String::from("the start point cannot be brought into the domain"))?;
            let start = Geodesic { point: frame.point, velocity: frame.axes[0] };
            transport(geometry, domain, start, frame.cell, length).map_err(|error| error.to_string())
        }
    }
    // Every face takes some length: a bound against absurd lengths before any work.
    if length.abs() > f64::from(MAX_FACES) {
        return Err(format!("length {length} is out of range: at most {MAX_FACES}"));
    }
    let id = space.geometry;
    let start = start_from_numbers(id, from, direction)?;
    let arrival = visit(id, Follow(domain, cell, start, length))?;
    let faces: Vec<usize> = arrival.faces.iter().map(|face| domain.faces[*face].id.face).collect();
    Ok(json!({
        "point": point_numbers(id, arrival.state.point),
        "direction": direction_numbers(id, arrival.state.velocity),
        "faces": faces,
        "cell": arrival.cell,
    }))
}

/// Follows the ray of one pixel and lists what it meets.
fn follow_pixel(mut scene: Scene, args: &TransportArgs, pixel: [u32; 2]) -> Result<Value, Failure> {
    if pixel[0] >= args.size[0] || pixel[1] >= args.size[1] {
        let [w, h] = args.size;
        return Err(Failure::refused(anyhow!("--pixel {},{}: outside of the picture of {w}x{h}", pixel[0], pixel[1])));
    }
    scene.settings.bounces = args.bounces.unwrap_or(scene.settings.bounces);
    // Normals at hits are computed for light only.
    scene.settings.shading = Shading::Riemannian;
    let plan = Plan::new(&scene, false);
    let world = World::new(&scene, &plan, scene.observer.frame).map_err(Failure::refused)?;
    let shot = Shot::symmetric(scene.observer.frame, scene.observer.fov, args.size);

    struct Follow<'a>(&'a World, &'a Shot, &'a Scene, [u32; 2]);
    impl Visitor for Follow<'_> {
        type Output = Value;
        fn visit<G: Geometry>(self, geometry: G) -> Value {
            let Self(world, shot, scene, [x, y]) = self;
            let id = world.geometry;
            let tracer = Tracer::new(geometry, world, shot);
            let start = tracer.geodesic([f64::from(x) + 0.5, f64::from(y) + 0.5]);
            let mut events = Vec::new();
            let (path, surface) = tracer.path(start, &mut Default::default(), |index, path| {
                let face = &world.domain.faces[index];
                // The point is given on the face that the ray leaves through, before the pairing is applied.
                let before = geometry.apply(&geometry.inverse(&face.pairing), path.state);
                events.push(json!({
                    "kind": "face",
                    "length": path.travelled,
                    "point": point_numbers(id, before.point),
                    "cell": face.id.cell,
                    "face": face.id.face,
                }));
            });
            let point = point_numbers(id, path.state.point);
            events.push(match surface.filter(|_| path.status == Status::Hit) {
                Some(surface) => json!({
                    "kind": "hit",
                    "length": path.travelled,
                    "point": point,
                    "cell": path.cell,
                    "object": surface.object,
                    "name": scene.objects[surface.object as usize].name,
                    "normal": direction_numbers(id, surface.normal),
                }),
                None => json!({ "kind": "limit", "length": path.travelled, "point": point, "cell": path.cell }),
            });
            json!({
                "from": point_numbers(id, start.point),
                "direction": direction_numbers(id, start.velocity),
                "events": events,
            })
        }
    }
    Ok(visit(world.geometry, Follow(&world, &shot, &scene, pixel)))
}
