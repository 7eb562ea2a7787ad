//! Meshes far from ordinary size: an octahedron whose distance every ray knows in closed form.
//!
//! A mesh that is stored a million times larger or smaller, and scaled back, is the same object. One that is a millionth of
//! the space's own unit looks like one in flat space, whatever the geometry.

use super::{Bench, Case, Family, On, PICTURES, Reading, Trouble, geodesic::is_indefinite, picture, walk};
use crate::{
    geometry::{GEOMETRIES, Geometry, GeometryId, Visitor, visit},
    measure::stability::picture::SIZE,
    render::{Shot, Target, plan::Plan, world::World},
    scene::{Mesh, Object, Place, Scene, Shading, Shape, Vertex},
    space::{Space, catalogue, observer::Frame},
};
use glam::DVec3;

/// From the eye to the middle of the octahedron, in units of its size.
const AWAY: f64 = 4.0;

/// Half of what is seen of it, in degrees.
const FOV: f64 = 24.0;

pub(super) fn cases() -> Vec<Case> {
    let family = Family { name: "mesh-scale", quantity: "distance off, relative, worst pixel", on: PICTURES };
    let mut cases = Vec::new();
    for entry in GEOMETRIES.iter().filter(|entry| !is_indefinite(entry.id)) {
        let space = catalogue::whole(entry.id);
        for (what, stored, scale, size) in [
            ("stored at 1e6, scaled by 1e-9", 1e6, 1e-9, 1e-3),
            ("stored at 1e-9, scaled by 1e6", 1e-9, 1e6, 1e-3),
            ("size 1e-6", 1.0, 1e-6, 1e-6),
        ] {
            let space = space.clone();
            cases.push(family.case(entry.name, what, move |bench, on| {
                let middle = base(&space);
                octahedron(bench, on, &space, middle, Octahedron { stored, scale, size })
            }));
        }
    }
    if let Some(space) = GeometryId::from_name("e3").map(catalogue::whole) {
        let place = space.clone();
        cases.push(family.case("e3", "size 1000, from 4000", move |bench, on| {
            octahedron(bench, on, &place, base(&place), Octahedron { stored: 1e-3, scale: 1e6, size: 1e3 })
        }));
        cases.push(family.case("e3", "size 1e6, from 4e6", move |bench, on| {
            octahedron(bench, on, &space, base(&space), Octahedron { stored: 1.0, scale: 1e6, size: 1e6 })
        }));
    }
    // Away from the origin coordinates have fewer digits than a small object needs.
    for space in walk::closed_spaces() {
        let place = space.clone();
        cases.push(family.case(&space.name.clone(), "size 1e-3 in the middle of a cell", move |bench, on| {
            let middle = visit(place.geometry, picture::Middle(&place)).map(|ball| ball.frame);
            let middle = middle.ok_or_else(|| Trouble(String::from("no middle")))?;
            octahedron(bench, on, &place, middle, Octahedron { stored: 1.0, scale: 1e-3, size: 1e-3 })
        }));
        let refused = Family { name: "too-large", quantity: "objects drawn that fill the space", on: super::HOST };
        cases.push(refused.case(&space.name.clone(), "a ball of radius 900 is refused", move |_, _| {
            let mut scene = picture::scene(&space, None)?;
            scene.objects.iter_mut().for_each(|object| object.shape = Shape::Ball { radius: 900.0 });
            let world = World::new(&scene, &Plan::new(&scene, false), scene.observer.frame);
            Ok(Reading::new(f64::from(u8::from(world.is_ok())), 0.0))
        }));
    }
    cases
}

fn base(space: &Space) -> Frame {
    struct Base;
    impl Visitor for Base {
        type Output = Frame;
        fn visit<G: Geometry>(self, geometry: G) -> Frame {
            Frame { cell: 0, point: geometry.base(), axes: geometry.frame(geometry.base()) }
        }
    }
    visit(space.geometry, Base)
}

/// The points |x| + |y| + |z| = size, stored in other units.
#[derive(Clone, Copy)]
struct Octahedron {
    stored: f64,
    scale: f64,
    size: f64,
}

fn scene(space: &Space, middle: Frame, solid: Octahedron) -> Result<Scene, Trouble> {
    let mut scene = picture::bare(space)?;
    let corners = [DVec3::X, DVec3::Y, DVec3::Z].into_iter().flat_map(|axis| [axis, -axis]);
    let vertices = corners.map(|axis| Vertex { position: axis * solid.stored, normal: axis, uv: [0.0; 2] }).collect();
    let triangles = (0..8_u32).map(|i| ([i & 1, 2 + (i >> 1 & 1), 4 + (i >> 2 & 1)], 0)).collect();
    scene.meshes.push(Mesh { name: String::from("octahedron"), vertices, triangles });
    scene.objects = vec![Object {
        name: String::from("octahedron"),
        shape: Shape::Mesh(0),
        place: Place::World(middle),
        scale: solid.scale,
        material: Some(0),
        motion: None,
    }];
    scene.settings.shading = Shading::Distance;
    if scene.settings.max_distance.is_some() {
        scene.settings.max_distance = Some((10.0 * solid.size).max(1.0));
    }
    Ok(scene)
}

fn octahedron(bench: &mut Bench, on: On, space: &Space, middle: Frame, solid: Octahedron) -> Result<Reading, Trouble> {
    struct Eye(Frame, f64);
    impl Visitor for Eye {
        type Output = Frame;
        fn visit<G: Geometry>(self, geometry: G) -> Frame {
            // Along the third axis, which points back.
            self.0.moved(geometry, DVec3::Z * self.1)
        }
    }
    let scene = scene(space, middle, solid)?;
    let eye = visit(space.geometry, Eye(middle, AWAY * solid.size));
    let shot = Shot::symmetric(eye, FOV, SIZE);
    let key = format!("{} octahedron {:e} {:e} {:e}", space.name, solid.stored, solid.scale, middle.point.x);
    let (target, _) = bench.draw(on, &key, || Ok(scene.clone()), |_| shot)?;
    let error = off(&shot, &target, solid.size);
    // A rounding of the coordinates around, seen from so near.
    struct Chart(Frame);
    impl Visitor for Chart {
        type Output = f64;
        fn visit<G: Geometry>(self, geometry: G) -> f64 {
            geometry.chart(self.0.point).abs().max_element()
        }
    }
    // Raw values are f32 on every backend.
    let far = visit(space.geometry, Chart(middle)) / solid.size + AWAY;
    let floor = On::Rt.rounding() + on.rounding() * far;
    // Flat space is a fiction: a triangle is flat in the chart, and bends by its size away from there.
    let curved = if solid.size < 1.0 { 0.5 * solid.size } else { 0.0 };
    let reading = Reading { floor, ..Reading::new(error, 20.0 * floor + curved) };
    // `walk_along` in stage/walk.glsl.
    let far_end = on != On::Cpu && !space.geometry.has_quadrics() && solid.size < 1e-5;
    Ok(if far_end { reading.accepting(0.03, FROM_THE_END) } else { reading })
}

/// Why a mesh of a millionth, seen from as near, is not met where it is in curved geometries.
const FROM_THE_END: &str = "in single precision the state of a ray is kept at the end of its arc, from where a hit is reached by \
                            going back: that rounds by 6e-8 of the arc, which is ten thousand times as long as the way to the hit";

/// Largest relative error of the distance, over the pixels whose ray goes through the octahedron and not just along it.
fn off(shot: &Shot, target: &Target, size: f64) -> f64 {
    let [left, right, down, up] = shot.tangents;
    let eye = DVec3::Z * (AWAY * size);
    let (mut worst, mut hits) = (0.0_f64, 0);
    for (index, pixel) in target.pixels.iter().enumerate() {
        let (column, row) = (index % SIZE[0] as usize, index / SIZE[0] as usize);
        let x = left + (right - left) * (column as f64 + 0.5) / f64::from(SIZE[0]);
        let y = up + (down - up) * (row as f64 + 0.5) / f64::from(SIZE[1]);
        let ray = DVec3::new(x, y, -1.0).normalize();
        let (mut enter, mut leave) = (0.0_f64, f64::INFINITY);
        for face in 0..8 {
            let sign = |bit: i32| if face >> bit & 1 == 0 { 1.0 } else { -1.0 };
            let normal = DVec3::new(sign(0), sign(1), sign(2));
            let (inside, rate) = (size - normal.dot(eye), normal.dot(ray));
            if rate < 0.0 { enter = enter.max(inside / rate) } else { leave = leave.min(inside / rate) }
        }
        if leave - enter > 0.05 * size {
            hits += 1;
            let off = (f64::from(pixel[0]) / enter - 1.0).abs();
            worst = if off.is_nan() { f64::NAN } else { worst.max(off) };
        }
    }
    // A picture of nothing shows nothing.
    if hits > 100 { worst } else { f64::NAN }
}
