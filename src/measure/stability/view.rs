//! Cameras where faces meet, and fields of view of 1 and 179 degrees.
//!
//! A camera exactly at a face, an edge or a corner of the first cell looks along it, so that half of its rays leave at once.
//! Its picture must be that from a hair's breadth beside, in the middle of the side of the cell. For the fields of view the
//! eye is in the middle of a ball: the distance of what it sees is the radius, in every pixel.

use super::{Bench, Case, Family, On, PICTURES, Reading, Trouble, light, picture, walk};
use crate::{
    geometry::{Geometry, Visitor, visit},
    measure::stability::picture::{Middle, SIZE},
    render::{Shot, world::tessellate::DEVIATION},
    scene::{Scene, Shading, Shape},
    shader_io::COUNT_LOST,
    space::{Space, observer::Frame, polyhedron::Polyhedron, walk::deviation_at},
};
use glam::DVec3;

/// How far beside, as a share of the way to the middle of the cell.
const HAIR: f64 = 1e-5;

/// Tolerance of arcs inside of the ball, as a share of a pixel.
const TOLERANCE: f64 = 0.02;

#[derive(Clone, Copy)]
enum Spot {
    Face,
    Edge,
    Corner,
}

pub(super) fn cases() -> Vec<Case> {
    let camera =
        Family { name: "camera", quantity: "share of pixels lost, black, or not in the picture beside", on: PICTURES };
    let lens = Family { name: "field-of-view", quantity: "distance off, relative, worst pixel", on: PICTURES };
    let mut cases = Vec::new();
    for space in walk::closed_spaces() {
        for (spot, what) in [(Spot::Face, "at a face"), (Spot::Edge, "at an edge"), (Spot::Corner, "at a corner")] {
            let space = space.clone();
            cases.push(camera.case(&space.name.clone(), what, move |bench, on| at_spot(bench, on, &space, spot)));
        }
        cases.extend(light::cases(&space));
    }
    // One space of each geometry.
    let mut seen = Vec::new();
    for space in walk::closed_spaces() {
        if seen.contains(&space.geometry) {
            continue;
        }
        seen.push(space.geometry);
        for fov in [1.0, 90.0, 179.0, 179.9] {
            let space = space.clone();
            let what = format!("{fov} degrees");
            cases.push(lens.case(&space.name.clone(), what, move |bench, on| inside_ball(bench, on, &space, fov)));
        }
    }
    cases
}

fn at_spot(bench: &mut Bench, on: On, space: &Space, spot: Spot) -> Result<Reading, Trouble> {
    struct Eyes<'a>(&'a Space, Spot);
    impl Visitor for Eyes<'_> {
        type Output = Option<[Frame; 3]>;
        fn visit<G: Geometry>(self, geometry: G) -> Self::Output {
            let cell = Polyhedron::new(&self.0.cells[0]).ok()?;
            let edge = cell.edges[0].vertices.map(|v| cell.vertices[v]);
            let at: DVec3 = match self.1 {
                Spot::Face => picture::centre(&cell, 0),
                Spot::Edge => edge[0].midpoint(edge[1]),
                Spot::Corner => edge[0],
            };
            let middle = geometry.unchart(cell.centroid)?;
            let eye = |share: f64| {
                let point = geometry.unchart(at.lerp(cell.centroid, share))?;
                Some(picture::looking_past(geometry, point, middle))
            };
            Some([eye(0.0)?, eye(HAIR)?, eye(2.0 * HAIR)?])
        }
    }
    let eyes = visit(space.geometry, Eyes(space, spot)).ok_or_else(|| Trouble(String::from("no such place")))?;
    let scene = picture::scene(space, None)?;
    let key = format!("{} as it is", space.name);
    let mut draw = |eye: Frame| picture::draw(bench, on, &key, &scene, eye, 100.0);
    let pictures = [draw(eyes[0])?, draw(eyes[1])?, draw(eyes[2])?];
    Ok(picture::compare(pictures.each_ref()))
}

fn inside_ball(bench: &mut Bench, on: On, space: &Space, fov: f64) -> Result<Reading, Trouble> {
    let mut scene = picture::scene(space, None)?;
    scene.settings.shading = Shading::Distance;
    scene.settings.tolerance = TOLERANCE;
    let middle = visit(space.geometry, Middle(space)).ok_or_else(|| Trouble(String::from("no middle")))?;
    let radius = 0.4 * middle.inradius;
    scene.objects.iter_mut().for_each(|object| object.shape = Shape::Ball { radius });
    let key = format!("{} distances", space.name);
    let shot = |_: &Scene| Shot::symmetric(middle.frame, fov, SIZE);
    let (target, stats) = bench.draw(on, &key, || Ok(scene.clone()), shot)?;
    if stats.counts[COUNT_LOST as usize] > 0 {
        return Err(Trouble(String::from("rays are lost")));
    }
    let off = target.pixels.iter().map(|pixel| (f64::from(pixel[0]) / radius - 1.0).abs());
    let error = off.fold(0.0, |worst: f64, off| if off.is_nan() || off > worst { off } else { worst });
    // Raw values are f32 on every backend. A ball of triangles is as round as they are small, and seen along arcs.
    let (floor, limit) = if space.geometry.has_quadrics() {
        (On::Rt.rounding(), 1e-4)
    } else {
        let arc = deviation_at(radius, Shot::symmetric(middle.frame, fov, SIZE).tolerance(TOLERANCE)) / radius;
        (On::Rt.rounding() + DEVIATION, 2.0 * (DEVIATION + arc))
    };
    Ok(Reading { floor, ..Reading::new(error, limit) })
}
