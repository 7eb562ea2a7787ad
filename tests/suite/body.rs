//! Bodies in curved spaces: rigid bodies, what closed walks of the head pick up, and what two eyes see.

use crate::support::Random;
use glam::{DMat3, DQuat, DVec3};
use holonomy::{
    geometry::{Entry, GEOMETRIES, Geometry, GeometryId, Visitor, exponential, visit},
    render::{Backend, Shot, Target, cpu::CpuBackend, plan::Plan, world::World},
    scene::{Material, Object, Place, Scene, Shading, Shape, file, folder::Folder},
    space::{
        Cell, Space,
        body::{Body, RoomPose, Tracking},
        domain::Domain,
        observer::Frame,
    },
};
use std::sync::Arc;

/// The geometries with a distance: all but the book's own.
fn riemannian() -> impl Iterator<Item = &'static Entry> {
    GEOMETRIES.iter().filter(|entry| visit(entry.id, Riemannian))
}

struct Riemannian;

impl Visitor for Riemannian {
    type Output = bool;
    fn visit<G: Geometry>(self, geometry: G) -> bool {
        geometry.signature() == DVec3::ONE
    }
}

/// A geometry in one chart, without faces.
fn unglued(id: GeometryId) -> Space {
    Space { name: String::from("unglued"), geometry: id, cells: vec![Cell { faces: Vec::new() }] }
}

/// A frame off the base point and off all axes, reduced to its cell.
fn start(id: GeometryId) -> (Domain, Frame) {
    struct Start;
    impl Visitor for Start {
        type Output = Frame;
        fn visit<G: Geometry>(self, geometry: G) -> Frame {
            let base = Frame { cell: 0, point: geometry.base(), axes: geometry.frame(geometry.base()) };
            let turn = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.7);
            base.moved(geometry, DVec3::new(0.05, 0.08, 0.03)).rotated(turn)
        }
    }
    (Domain::new(&unglued(id)), visit(id, Start))
}

fn turn(random: &mut Random) -> DQuat {
    let axis = DVec3::new(random.within(-1.0, 1.0), random.within(-1.0, 1.0), random.within(-1.0, 1.0));
    DQuat::from_axis_angle(axis.normalize(), random.within(0.0, 3.0))
}

/// How far a frame is from where an observer sees something at `offset` with axes `turn` (both in his frame): in the
/// geodesic to it, and in its axes carried back along it.
struct Off {
    from: Frame,
    to: Frame,
    offset: DVec3,
    turn: DMat3,
}

impl Visitor for Off {
    type Output = f64;
    fn visit<G: Geometry>(self, geometry: G) -> f64 {
        let (direction, length) = geometry.log(self.from.point, self.to.point);
        let component = |axis| geometry.inner(self.from.point, axis, direction);
        let seen = DVec3::from_array(self.from.axes.map(component)) * length;
        let carried = self.from.moved(geometry, seen);
        let mut off = (seen - self.offset).length();
        for (i, axis) in self.to.axes.iter().enumerate() {
            let component = |base| geometry.inner(carried.point, base, *axis);
            off = off.max((DVec3::from_array(carried.axes.map(component)) - self.turn.col(i)).length());
        }
        off
    }
}

/// Hands hang off the head as they do in the room, wherever the player has walked, in each mode; if they hung off the
/// room's origin they would not.
#[test]
fn body_is_rigid_in_all_modes() {
    for entry in riemannian() {
        for (_, tracking) in Tracking::NAMES {
            let (domain, home) = start(entry.id);
            // Half a metre is a third of a unit: no antipode is near, and each point has one shortest geodesic.
            let mut body = Body::new(entry.id, home, *tracking, 1.5);
            let mut random = Random(7);
            let (offset, held) = (DVec3::new(0.21, -0.32, -0.27), turn(&mut random));
            let (mut worst, mut loose) = (0.0_f64, 0.0_f64);
            for step in 0..25 {
                let place = DVec3::new(random.within(-0.5, 0.5), random.within(-0.3, 0.3), random.within(-0.5, 0.5));
                let head = RoomPose { position: place, rotation: turn(&mut random) };
                body.track(&domain, head).expect("the head moves");
                if step % 5 == 4 {
                    body.walk(&domain, DVec3::new(0.1, 0.02, -0.2)).expect("the body walks");
                    body.turn_left(&domain, 0.3).expect("the body turns");
                }
                let hand = RoomPose { position: place + head.rotation * offset, rotation: head.rotation * held };
                let grip = body.place(&domain, hand).expect("the hand is placed");
                let head_frame = body.head(&domain).expect("the head is placed");
                let off = |to| {
                    let (offset, turn) = (offset / 1.5, DMat3::from_quat(held));
                    visit(entry.id, Off { from: head_frame, to, offset, turn })
                };
                worst = worst.max(off(grip));
                // The spoiled sister: a hand that is reached from the frame of the room's origin.
                let mut origin = Body::new(entry.id, home, Tracking::Reference, 1.5);
                origin.track(&domain, RoomPose::ORIGIN).expect("at the origin");
                if *tracking == Tracking::Reference && step < 4 {
                    loose = loose.max(off(origin.place(&domain, hand).expect("the hand is placed")));
                }
            }
            eprintln!("body {} {tracking:?}: rigid to {worst:.1e}, from the origin {loose:.1e}", entry.name);
            assert!(worst < 1e-6, "{} {tracking:?}: {worst}", entry.name);
            let flat = entry.name == "e3";
            assert!(*tracking != Tracking::Reference || flat || loose > 1e-3, "{}: {loose}", entry.name);
        }
    }
}

/// In the mode `reference` closed walks close, in `rotation-only` nothing moves; walks of the body lead along geodesics in
/// all modes.
#[test]
fn body_modes_do_what_they_say() {
    for entry in riemannian() {
        let (domain, home) = start(entry.id);
        let at = |x: f64, y: f64, z: f64| RoomPose { position: DVec3::new(x, y, z), rotation: DQuat::IDENTITY };
        let walk = |tracking| {
            let mut body = Body::new(entry.id, home, tracking, 1.0);
            for pose in [at(0.4, 0.0, 0.0), at(0.4, 0.1, -0.5), at(0.0, 0.0, -0.5), at(0.0, 0.0, 0.0)] {
                body.track(&domain, pose).expect("the head moves");
            }
            body.frame(&domain).expect("a frame")
        };
        let gap = |a: &Frame, b: &Frame| {
            let axes = (0..3).map(|i| (a.axes[i] - b.axes[i]).length());
            axes.fold((a.point - b.point).length(), f64::max)
        };
        assert!(gap(&walk(Tracking::Reference), &home) < 1e-12, "{}", entry.name);
        assert!(gap(&walk(Tracking::RotationOnly), &home) == 0.0, "{}", entry.name);
        let picked_up = gap(&walk(Tracking::Holonomy), &home);
        assert!((picked_up > 1e-3) != (entry.name == "e3"), "{}: {picked_up}", entry.name);
        // Walking 0.3 to where one looks comes to the end of the geodesic there, from wherever the head is.
        for (_, tracking) in Tracking::NAMES {
            let mut body = Body::new(entry.id, home, *tracking, 2.0);
            body.track(&domain, at(0.3, 0.1, 0.2)).expect("the head moves");
            let before = body.frame(&domain).expect("a frame");
            body.walk(&domain, DVec3::new(0.0, 0.0, -0.6)).expect("the body walks");
            let after = body.frame(&domain).expect("a frame");
            let (offset, turn) = (DVec3::new(0.0, 0.0, -0.3), DMat3::IDENTITY);
            let off = visit(entry.id, Off { from: before, to: after, offset, turn });
            assert!(off < 1e-9, "{} {tracking:?}: {off}", entry.name);
            // Recentred, the head is where the observer was, level, and looks along his view.
            let head = RoomPose { position: DVec3::new(0.3, 0.1, 0.2), rotation: DQuat::from_rotation_y(0.8) };
            body.recentre(head, home);
            body.track(&domain, head).expect("the head moves");
            assert!(gap(&body.head(&domain).expect("a frame"), &home) < 1e-12, "{} {tracking:?}", entry.name);
        }
    }
}

/// Walks the head along geodesics from corner to corner of a triangle of the space, and says by which rotation vector, in
/// the start's frame, its frame has come back turned.
struct Loop {
    id: GeometryId,
    /// The second and third corner, as ends of geodesics that leave the first: components in the start's frame.
    corners: [DVec3; 2],
    /// The frame to start from.
    home: Frame,
}

impl Visitor for Loop {
    type Output = DVec3;
    fn visit<G: Geometry>(self, geometry: G) -> DVec3 {
        let domain = Domain::new(&unglued(self.id));
        let mut body = Body::new(self.id, self.home, Tracking::Holonomy, 1.0);
        let [a, b] = self.corners.map(|c| exponential(geometry, self.home.point, self.home.vector(c)));
        let mut position = DVec3::ZERO;
        for corner in [a, b, self.home.point] {
            let frame = body.frame(&domain).expect("a frame");
            let (direction, length) = geometry.log(frame.point, corner);
            let component = |axis| geometry.inner(frame.point, axis, direction);
            let step = DVec3::from_array(frame.axes.map(component)) * length;
            // As a head moves: in small steps.
            for _ in 0..20 {
                position += step / 20.0;
                body.track(&domain, RoomPose { position, rotation: DQuat::IDENTITY }).expect("the head moves");
            }
        }
        let end = body.frame(&domain).expect("a frame");
        assert!((end.point - self.home.point).length() < 1e-6, "the walk is closed");
        let column = |axis| DVec3::from_array(self.home.axes.map(|base| geometry.inner(end.point, base, axis)));
        let turned = DMat3::from_cols(column(end.axes[0]), column(end.axes[1]), column(end.axes[2]));
        DQuat::from_mat3(&turned).to_scaled_axis()
    }
}

/// Area of a triangle with sides `a` and `b` and a right angle between them, on a surface of curvature 1, 0 or −1.
fn right_triangle(curvature: f64, a: f64, b: f64) -> f64 {
    // tan(area / 2) = tan(a / 2) tan(b / 2), and with hyperbolic tangents below 0.
    if curvature > 0.0 {
        2.0 * ((0.5 * a).tan() * (0.5 * b).tan()).atan()
    } else if curvature < 0.0 {
        2.0 * ((0.5 * a).tanh() * (0.5 * b).tanh()).atan()
    } else {
        0.5 * a * b
    }
}

/// Where space has the same curvature in each plane, and in the surfaces of products, a closed walk turns the frame by the
/// curvature times the area; elsewhere by the sectional curvature times the area of a small loop, and by what is computed for
/// a large one.
#[test]
fn body_picks_up_the_holonomy_of_closed_walks() {
    struct Base;
    impl Visitor for Base {
        type Output = Frame;
        fn visit<G: Geometry>(self, geometry: G) -> Frame {
            Frame { cell: 0, point: geometry.base(), axes: geometry.frame(geometry.base()) }
        }
    }
    // Planes spanned by two axes of the standard frame, with the axis across.
    let planes = [(DVec3::X, DVec3::Y, DVec3::Z), (DVec3::Y, DVec3::Z, DVec3::X), (DVec3::Z, DVec3::X, DVec3::Y)];
    // Sectional curvatures of these planes. Left-invariant metrics: Milnor, Curvatures of left invariant metrics on Lie
    // groups, 1976, theorem 4.3.
    let curvatures: &[(&str, bool, [f64; 3])] = &[
        ("e3", true, [0.0, 0.0, 0.0]),
        ("s3", true, [1.0, 1.0, 1.0]),
        ("h3", true, [-1.0, -1.0, -1.0]),
        ("s2xr", true, [f64::NAN, f64::NAN, f64::NAN]),
        ("h2xr", true, [f64::NAN, f64::NAN, f64::NAN]),
        ("nil", false, [-0.75, 0.25, 0.25]),
        ("sol", false, [1.0, -1.0, -1.0]),
        ("sl2", false, [-1.75, 0.25, 0.25]),
    ];
    assert_eq!(curvatures.len(), riemannian().count());
    for (name, exact, known) in curvatures {
        let id = GeometryId::from_name(name).expect("a geometry");
        let home = visit(id, Base);
        for (plane, (u, v, w)) in planes.into_iter().enumerate() {
            // In a product two axes span the surface, and the third is flat with either.
            let curvature = match *name {
                "s2xr" | "h2xr" => {
                    let flat = [u, v].into_iter().any(|axis| visit(id, AlongFibre { home, axis }));
                    if flat { 0.0 } else { if *name == "s2xr" { 1.0 } else { -1.0 } }
                }
                _ => known[plane],
            };
            let (a, b) = if *exact { (0.7, 0.5) } else { (0.02, 0.02) };
            let turned = visit(id, Loop { id, corners: [u * a, v * b], home });
            let expected = curvature * right_triangle(if *exact { curvature } else { 0.0 }, a, b).abs();
            let back = visit(id, Loop { id, corners: [v * b, u * a], home });
            let large = visit(id, Loop { id, corners: [u * 0.7, v * 0.5], home });
            eprintln!(
                "holonomy {name} plane {plane}: {:.9} of {expected:.9} expected; sides 0.7 and 0.5: {:.6}",
                turned.dot(w),
                large
            );
            let slack = if *exact { 1e-7 } else { 0.05 * 0.5 * a * b };
            assert!((turned - w * expected).length() < slack, "{name} plane {plane}: {turned} against {expected}");
            // The way back undoes it, which also tells that the sign counts.
            assert!((back + turned).length() < 1e-9, "{name} plane {plane}");
            assert!(expected == 0.0 || (turned + w * expected).length() > slack, "{name} plane {plane}: no sign");
        }
    }
}

/// Whether a product's factor R runs along an axis of a frame.
struct AlongFibre {
    home: Frame,
    axis: DVec3,
}

impl Visitor for AlongFibre {
    type Output = bool;
    fn visit<G: Geometry>(self, _geometry: G) -> bool {
        // The third coordinate is the factor R, and the second number of points is not.
        self.home.vector(self.axis).z.abs() > 0.5
    }
}

/// A space with nothing but a small ball in it.
fn ball_scene(id: GeometryId, ball: Frame, radius: f64) -> Scene {
    let text = format!("[space]\ngeometry = \"{}\"\n", id.name());
    let mut scene = file::read("ball.toml", text.as_bytes(), &Folder::Embedded).expect("a scene");
    scene.materials.push(Material::plain("white", [1.0; 3]));
    scene.settings.shading = Shading::Object;
    scene.settings.tolerance = 0.05;
    scene.objects.push(Object {
        name: String::from("ball"),
        shape: Shape::Ball { radius },
        place: Place::World(ball),
        scale: 1.0,
        material: Some(scene.materials.len() - 1),
        motion: None,
    });
    scene
}

/// Side of the pictures, in pixels.
const SIDE: u32 = 48;

/// Direction, in the eye's axes, of the middle of the ball in a picture that shows it: the mean over its pixels, weighted by
/// their solid angles.
fn middle(scene: &Scene, shot: &Shot) -> DVec3 {
    let plan = Plan::new(scene, false);
    let world = Arc::new(World::new(scene, &plan, shot.eye).expect("a world"));
    let mut backend = CpuBackend::default();
    backend.load(&world).expect("loaded");
    let mut picture = Target::new(shot.size);
    backend.render(shot, &mut picture, &|_| ()).expect("drawn");
    let [left, right, down, up] = shot.tangents;
    let mut sum = DVec3::ZERO;
    let mut edge = false;
    for (index, pixel) in picture.pixels.iter().enumerate() {
        let (column, row) = (index as u32 % SIDE, index as u32 / SIDE);
        if pixel[0] < 0.0 {
            continue;
        }
        edge |= column == 0 || row == 0 || column == SIDE - 1 || row == SIDE - 1;
        let x = left + (right - left) * (f64::from(column) + 0.5) / f64::from(SIDE);
        let y = up + (down - up) * (f64::from(row) + 0.5) / f64::from(SIDE);
        let slope = DVec3::new(x, y, -1.0);
        sum += slope / slope.length().powi(4);
    }
    assert!(sum != DVec3::ZERO && !edge, "the ball is in the picture, all of it");
    sum.normalize()
}

/// Unit vector from one point to another, in a frame at the first.
struct Towards {
    from: Frame,
    to: Frame,
}

impl Visitor for Towards {
    type Output = DVec3;
    fn visit<G: Geometry>(self, geometry: G) -> DVec3 {
        let (direction, _) = geometry.log(self.from.point, self.to.point);
        DVec3::from_array(self.from.axes.map(|axis| geometry.inner(self.from.point, axis, direction)))
    }
}

/// The angle between two unit vectors.
fn angle(a: DVec3, b: DVec3) -> f64 {
    a.cross(b).length().atan2(a.dot(b))
}

/// Distance of the eyes in metres, and in units of length.
const EYES: f64 = 0.07;

/// The angle by which two eyes see a ball in different directions, taken from pictures through their frusta, is the one
/// between the geodesics that lead from the eyes to it: with a level and with a rolled head, with parallel and with canted
/// eyes, with frusta that are not symmetric. Where the geometry has a formula for it, it is that too.
#[test]
fn body_sees_balls_with_two_eyes_as_the_geometry_says() {
    let degrees = |angle: f64| angle.to_degrees();
    let mut worst = 0.0_f64;
    for entry in riemannian() {
        let (domain, home) = start(entry.id);
        for (distance, roll, cant, ahead) in [
            (0.5, 0.0, 0.0, DVec3::NEG_Z),
            (0.9, 0.6, 0.0, DVec3::NEG_Z),
            (0.4, 0.0, 0.09, DVec3::new(0.25, -0.15, -1.0).normalize()),
            (0.7, -0.9, 0.09, DVec3::new(-0.2, 0.3, -1.0).normalize()),
        ] {
            let mut body = Body::new(entry.id, home, Tracking::Reference, 1.0);
            let head = RoomPose {
                position: DVec3::new(0.1, -0.05, 0.07),
                rotation: DQuat::from_rotation_y(0.3) * DQuat::from_rotation_z(roll),
            };
            body.track(&domain, head).expect("the head moves");
            let there = RoomPose { position: head.position + head.rotation * ahead * distance, ..head };
            let ball = body.place(&domain, there).expect("the ball is placed");
            let radius = 0.01 * distance;
            let scene = ball_scene(entry.id, ball, radius);
            let see = |side: f64, roll_of_eyes: f64| {
                let canted = DQuat::from_rotation_y(-side * cant);
                let rolled = head.rotation * DQuat::from_rotation_z(roll_of_eyes);
                let pose = RoomPose {
                    position: head.position + rolled * DVec3::X * (0.5 * side * EYES),
                    rotation: rolled * canted,
                };
                let eye = body.place(&domain, pose).expect("the eye is placed");
                let theory = visit(entry.id, Towards { from: eye, to: ball });
                // A window that holds the ball, off its middle and off the view axis.
                let (x, y) = (-theory.x / theory.z, -theory.y / theory.z);
                let tangents = [x - 0.017, x + 0.020, y - 0.019, y + 0.018];
                let shot = Shot { eye, tangents, size: [SIDE; 2], samples: 1, seed: 0 };
                (pose.rotation * middle(&scene, &shot), pose.rotation * theory)
            };
            let ((left, left_theory), (right, right_theory)) = (see(-1.0, 0.0), see(1.0, 0.0));
            let (measured, theory) = (angle(left, right), angle(left_theory, right_theory));
            worst = worst.max(degrees((measured - theory).abs()));
            assert!(
                degrees((measured - theory).abs()) < 0.01,
                "{} at {distance}: {} against {} degrees",
                entry.name,
                degrees(measured),
                degrees(theory)
            );
            // Straight ahead the eyes and the ball make two right triangles.
            let half = match entry.name {
                "e3" => Some(distance / (0.5 * EYES)),
                "s3" => Some(distance.tan() / (0.5 * EYES).sin()),
                "h3" => Some(distance.tanh() / (0.5 * EYES).sinh()),
                _ => None,
            };
            if let (Some(tangent), true) = (half, ahead == DVec3::NEG_Z) {
                let formula = std::f64::consts::PI - 2.0 * tangent.atan();
                assert!(degrees((theory - formula).abs()) < 1e-9, "{}: {theory} against {formula}", entry.name);
            }
            // The spoiled sister: eyes of a head that is not rolled as it says.
            if roll != 0.0 && cant != 0.0 {
                let off = [0.5, 1.2].map(|roll_of_eyes| {
                    let ((left, _), (right, _)) = (see(-1.0, roll_of_eyes), see(1.0, roll_of_eyes));
                    degrees((angle(left, right) - theory).abs())
                });
                assert!(off[0].max(off[1]) > 0.01, "{}: roll is not felt", entry.name);
            }
        }
    }
    eprintln!("stereo: worst deviation {worst:.5} degrees");
}

/// In a product's surface eyes and ball make the triangles of a sphere and of a hyperbolic plane.
#[test]
fn body_sees_balls_in_products_by_the_surfaces_trigonometry() {
    struct Level;
    impl Visitor for Level {
        type Output = Frame;
        fn visit<G: Geometry>(self, geometry: G) -> Frame {
            let base = Frame { cell: 0, point: geometry.base(), axes: geometry.frame(geometry.base()) };
            // The first two axes span the surface: right along the first, back along the second.
            let [e1, e2, e3] = base.axes;
            Frame { axes: [e1, -e3, e2], ..base }
        }
    }
    for (name, tangent) in
        [("s2xr", (0.6_f64.tan()) / (0.5 * EYES).sin()), ("h2xr", (0.6_f64.tanh()) / (0.5 * EYES).sinh())]
    {
        let id = GeometryId::from_name(name).expect("a geometry");
        let domain = Domain::new(&unglued(id));
        let home = visit(id, Level);
        let body = Body::new(id, home, Tracking::Holonomy, 1.0);
        let place = |x: f64, z: f64| {
            let pose = RoomPose { position: DVec3::new(x, 0.0, z), rotation: DQuat::IDENTITY };
            body.place(&domain, pose).expect("it is placed")
        };
        let ball = place(0.0, -0.6);
        let see = |side: f64| visit(id, Towards { from: place(0.5 * side * EYES, 0.0), to: ball });
        let theory = std::f64::consts::PI - 2.0 * tangent.atan();
        let flat = 2.0 * (0.5 * EYES / 0.6).atan();
        let seen = angle(see(-1.0), see(1.0));
        assert!((seen - theory).abs().to_degrees() < 1e-9, "{name}: {seen} against {theory}");
        assert!((seen - flat).abs().to_degrees() > 0.01, "{name} is not flat");
    }
}
