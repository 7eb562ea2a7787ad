//! Observers: walks through the faces, what closed loops pick up, camera paths.

use crate::support::Random;
use glam::{DMat3, DVec3};
use holonomy::{
    geometry::{Geometry, Visitor, exponential, visit},
    scene::{Scene, file, folder::Folder},
    space::{
        Space, catalogue,
        domain::Domain,
        observer::{Frame, pose_on_path},
        reduce::is_inside,
    },
};
use std::f64::consts::{PI, TAU};

fn space(name: &str) -> Space {
    catalogue::find(name).expect("a catalogue space")
}

/// A frame off the centre and off all symmetries.
fn start<G: Geometry>(geometry: G) -> Frame {
    let base = Frame { cell: 0, point: geometry.base(), axes: geometry.frame(geometry.base()) };
    let turn = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.7);
    base.moved(geometry, DVec3::new(0.05, 0.08, 0.03)).rotated(turn)
}

/// Largest difference of two frames in any number.
fn gap(a: &Frame, b: &Frame) -> f64 {
    assert_eq!(a.cell, b.cell);
    let axes = (0..3).map(|i| (a.axes[i] - b.axes[i]).abs().max_element());
    axes.fold((a.point - b.point).abs().max_element(), f64::max)
}

/// A triangle with these sides at the start, and this angle between them.
struct Triangle<'a> {
    space: &'a Space,
    sides: [f64; 2],
    angle: f64,
    curvature: f64,
}

impl Visitor for Triangle<'_> {
    /// Gap to the frame turned by the area times `curvature`, and the number of corners outside of the cell.
    type Output = (f64, usize);
    fn visit<G: Geometry>(self, geometry: G) -> Self::Output {
        let domain = Domain::new(self.space);
        let home = start(geometry);
        let (sin, cos) = self.angle.sin_cos();
        let (u, v) = (DVec3::new(0.48, 0.6, 0.64), DVec3::new(-0.8, 0.6, 0.0));
        let v = (v - u * u.dot(v)).normalize();
        // The corners and the steps between them, in the model without any faces.
        let there = exponential(geometry, home.point, home.vector(u * cos + v * sin) * self.sides[1]);
        let mut unfolded = home.moved(geometry, u * self.sides[0]);
        let mut steps = vec![u * self.sides[0]];
        let mut outside = usize::from(!is_inside(self.space, home.cell, unfolded.point));
        for corner in [there, home.point] {
            outside += usize::from(!is_inside(self.space, home.cell, corner));
            let (direction, length) = geometry.log(unfolded.point, corner);
            let component = |axis| geometry.inner(unfolded.point, axis, direction);
            let step = DVec3::from_array(unfolded.axes.map(component)) * length;
            unfolded = unfolded.moved(geometry, step);
            steps.push(step);
        }
        let walk = |at: Frame, step: &DVec3| at.walked(geometry, &domain, *step).expect("the space is sound");
        let back = steps.iter().fold(home, walk);
        // Area of a triangle from two sides and their angle, on the sphere of this curvature (for a negative one tan
        // turns to tanh): tan(E/2) = tan(a/2) tan(b/2) sin γ / (1 + tan(a/2) tan(b/2) cos γ).
        let half = |side: f64| match self.curvature {
            k if k > 0.0 => (0.5 * side).tan(),
            k if k < 0.0 => (0.5 * side).tanh(),
            _ => 0.0,
        };
        let product = self.curvature * half(self.sides[0]) * half(self.sides[1]);
        let excess = 2.0 * (product * sin).atan2(1.0 + product * cos);
        let expected = home.rotated(DMat3::from_axis_angle(u.cross(v), excess));
        (gap(&back, &expected), outside)
    }
}

#[test]
fn observer_closed_loops_pick_up_the_area() {
    for (name, sides, curvature) in [
        ("torus", [1.7, 2.3], 0.0),
        ("mirrored-cube", [1.7, 2.3], 0.0),
        ("half-turn", [3.3, 2.3], 0.0),
        ("hantzsche-wendt", [2.9, 2.3], 0.0),
        ("poincare", [0.8, 1.1], 1.0),
        ("s3", [1.5, 1.3], 1.0),
        ("seifert-weber", [2.2, 1.9], -1.0),
        ("mirrored-dodecahedron", [2.2, 1.9], -1.0),
    ] {
        let space = space(name);
        let run = |curvature| visit(space.geometry, Triangle { space: &space, sides, angle: 1.2, curvature });
        let (error, outside) = run(curvature);
        println!("{name}: off by {error:.1e}, {outside} corners in other cells");
        assert!(outside >= 2, "{name}: the loop stays in its cell");
        assert!(error < 1e-12, "{name}: {error:e}");
        // The other sign, or a loop around nothing, is not what comes out.
        assert!(run(if curvature == 0.0 { 1.0 } else { -curvature }).0 > 0.1, "{name}");
        assert!(curvature == 0.0 || run(0.0).0 > 0.1, "{name}");
    }
}

/// Ten thousand steps: out and back by the same steps, in legs of so many.
struct Walk<'a>(&'a Space, usize);

impl Visitor for Walk<'_> {
    type Output = f64;
    fn visit<G: Geometry>(self, geometry: G) -> f64 {
        let Self(space, leg) = self;
        let domain = Domain::new(space);
        let home = start(geometry);
        let mut random = Random(10_000);
        let mut at = home;
        for _ in 0..5000 / leg {
            let steps: Vec<(DVec3, DMat3)> = (0..leg)
                .map(|_| {
                    let step = DVec3::from_array(std::array::from_fn(|_| random.within(-0.3, 0.3)));
                    let axis = DVec3::new(random.within(-1.0, 1.0), random.within(-1.0, 1.0), 0.5).normalize();
                    (step, DMat3::from_axis_angle(axis, random.within(-1.0, 1.0)))
                })
                .collect();
            let walk = |at: Frame, step: DVec3| {
                let next = at.walked(geometry, &domain, step).expect("the space is sound");
                assert!(is_inside(space, next.cell, next.point));
                next
            };
            at = steps.iter().fold(at, |at, (step, turn)| walk(at, *step).rotated(*turn));
            at = steps.iter().rev().fold(at, |at, (step, turn)| walk(at.rotated(turn.transpose()), -*step));
        }
        for (i, a) in at.axes.iter().enumerate() {
            for (j, b) in at.axes.iter().enumerate() {
                let product = geometry.inner(at.point, *a, *b);
                assert!((product - f64::from(u8::from(i == j))).abs() < 1e-13, "axes {i} and {j}: {product}");
            }
        }
        gap(&at, &home)
    }
}

/// A rounding at distance d from home moves the way back by d times as much in flat space, e^d in hyperbolic space: there
/// the walk comes home every ten steps.
#[test]
fn observer_walks_ten_thousand_steps_and_returns() {
    for (name, leg, allowed) in [
        ("torus", 5000, 1e-10),
        ("sixth-turn", 5000, 1e-10),
        ("poincare", 5000, 1e-11),
        ("s3", 5000, 1e-11),
        ("seifert-weber", 5, 1e-11),
        ("mirrored-dodecahedron", 5, 1e-11),
        ("s2xs1", 5000, 1e-10),
        ("genus2xs1", 5, 1e-10),
        ("nil-heisenberg", 5, 1e-11),
        ("sol-golden", 5, 1e-10),
        ("sl2-genus2-tangent", 5, 1e-10),
    ] {
        let space = space(name);
        let error = visit(space.geometry, Walk(&space, leg));
        println!("{name}: {error:.1e} from home");
        assert!(error < allowed, "{name}: {error:e}");
    }
}

/// A closed geodesic: where it starts, its direction in the frame there, its length.
struct Loop<'a> {
    space: &'a Space,
    start: DVec3,
    direction: DVec3,
    length: f64,
    /// What the frame turns by, right-handed about the direction.
    turn: f64,
}

impl Visitor for Loop<'_> {
    type Output = f64;
    fn visit<G: Geometry>(self, geometry: G) -> f64 {
        let point = geometry.unchart(self.start).expect("in the chart");
        let home = Frame { cell: 0, point, axes: geometry.frame(point) };
        let back = home.walked(geometry, &Domain::new(self.space), self.direction * self.length).expect("sound");
        gap(&back, &home.rotated(DMat3::from_axis_angle(self.direction, self.turn)))
    }
}

/// Closed geodesics of the spaces with curved charts, and what a frame picks up on them.
#[test]
fn observer_closed_geodesics_turn_frames_as_they_should() {
    let golden = 0.5 * (1.0 + 5.0_f64.sqrt());
    // 0.8 b₁ + 0.6 b₂ comes back after two passages of the stretch.
    let fixed = DVec3::new(0.8 * golden + 0.6, 0.6 * golden - 0.8, 0.0) / golden.hypot(1.0) + DVec3::Z * 0.3;
    for (name, start, direction, length, turn) in [
        ("s2xs1", DVec3::new(0.2, 0.1, 0.3), DVec3::Z, 1.0, 0.0),
        ("s2xs1", DVec3::new(0.2, 0.1, 0.3), DVec3::new(0.6, 0.8, 0.0), TAU, 0.0),
        ("genus2xs1", DVec3::new(0.2, 0.1, 0.3), DVec3::Z, 1.0, 0.0),
        // From side to opposite side.
        ("genus2xs1", DVec3::ZERO, DVec3::X, 2.0 * (1.0 + 2.0_f64.sqrt()).acosh(), 0.0),
        // ∇ of the frame along the fibre is half of the bracket.
        ("nil-heisenberg", DVec3::new(0.3, 0.4, 0.6), DVec3::Z, 1.0, 0.5),
        ("sol-golden", fixed, DVec3::Z, 4.0 * golden.ln(), 0.0),
        // In a frame that turns back by twice the way along the fibre, a parallel vector turns by half of the way.
        ("sl2-genus2-tangent", DVec3::new(0.2, 0.1, 0.3), DVec3::Z, TAU, PI),
        (
            "sl2-genus2-tangent",
            DVec3::ZERO,
            DVec3::X,
            2.0 * (1.0 + 2.0_f64.sqrt()).acosh(),
            (1.0 + 2.0_f64.sqrt()).acosh(),
        ),
    ] {
        let space = space(name);
        let run = |turn| visit(space.geometry, Loop { space: &space, start, direction, length, turn });
        println!("{name}: along {direction} off by {:.1e}", run(turn));
        assert!(run(turn) < 1e-12, "{name}: {}", run(turn));
        assert!(run(turn + 0.1) > 0.05 && run(-turn - 0.2) > 0.05, "{name}");
    }
}

#[test]
fn observer_walk_is_the_unfolded_one_where_no_face_is_near() {
    struct Near;
    impl Visitor for Near {
        type Output = f64;
        fn visit<G: Geometry>(self, geometry: G) -> f64 {
            let domain = Domain::new(&space("seifert-weber"));
            let step = DVec3::new(0.1, -0.2, 0.15);
            gap(
                &start(geometry).walked(geometry, &domain, step).expect("sound"),
                &start(geometry).moved(geometry, step),
            )
        }
    }
    assert!(visit(space("seifert-weber").geometry, Near) < 1e-14);
}

// --- camera paths ---------------------------------------------------------------------------------

fn scene(text: &str) -> Result<Scene, String> {
    file::read("path.toml", text.as_bytes(), &Folder::Embedded).map_err(|e| e.to_string())
}

const TORUS: &str = "[space]\nmanifold = \"torus\"\n[observer]\nposition = [0.5, 0.5, 0.5]\n";

fn pose(scene: &Scene, number: u32) -> Frame {
    struct Pose<'a>(&'a Scene, u32);
    impl Visitor for Pose<'_> {
        type Output = Frame;
        fn visit<G: Geometry>(self, geometry: G) -> Frame {
            let Self(scene, number) = self;
            let domain = Domain::new(&scene.space);
            pose_on_path(geometry, &domain, scene.observer.frame, &scene.path, number).expect("the space is sound")
        }
    }
    visit(scene.space.geometry, Pose(scene, number))
}

#[test]
fn observer_path_goes_from_key_to_key() {
    let scene = scene(&format!(
        "{TORUS}[[observer.path]]\nstep = [0, 0, -1]\nframes = 10\n\
         [[observer.path]]\nposition = [0.2, 0.5, 0.5]\nlook = [1, 0, 0]\nframes = 20\n\
         [[observer.path]]\nrotate = [[0, 1, 0, 90]]\n"
    ))
    .expect("a scene");
    assert_eq!(scene.path.iter().map(|leg| leg.frames).collect::<Vec<_>>(), [10, 20, 48]);
    assert_eq!(pose(&scene, 0), scene.observer.frame);
    // Once round the torus.
    assert!(gap(&pose(&scene, 10), &scene.observer.frame) < 1e-14);
    assert!((pose(&scene, 5).point.z - 0.0).abs() < 1e-14 || (pose(&scene, 5).point.z - 1.0).abs() < 1e-14);
    let key = pose(&scene, 30);
    assert!((key.point.truncate() - DVec3::new(0.2, 0.5, 0.5)).length() < 1e-14);
    assert!((key.axes[2].truncate() - DVec3::NEG_X).length() < 1e-14, "he looks along x");
    let turned = pose(&scene, 78);
    assert!(
        (turned.axes[2].truncate() - DVec3::NEG_Z).length() < 1e-14
            || (turned.axes[2].truncate() - DVec3::Z).length() < 1e-14
    );
    assert_eq!(pose(&scene, 1000), turned, "past the end he stays");
    // Steps between pictures change by little from one to the next: no jump in the speed, at keys neither.
    let points: Vec<DVec3> = (10..=30).map(|n| pose(&scene, n).point.truncate()).collect();
    let speeds: Vec<f64> = points.windows(2).map(|p| p[0].distance(p[1])).collect();
    assert!(speeds[0] < 0.2 * speeds[9] && speeds[19] < 0.2 * speeds[9]);
    assert!(speeds.windows(2).all(|s| (s[1] - s[0]).abs() < 0.25 * speeds[9]), "{speeds:?}");
}

#[test]
fn observer_path_in_a_curved_space_takes_the_geodesic() {
    let scene = scene(
        "[space]\nmanifold = \"seifert-weber\"\n[observer]\nposition = [0, 0, 0.3, 1]\n\
         [[observer.path]]\nposition = [0.4, 0.1, -0.2, 1]\nlook = [1, 0, 0]\nup = [0, 0, 1]\nframes = 8\n\
         [[observer.path]]\nstep = [0, 0, -3]\nframes = 8\n",
    )
    .expect("a scene");
    struct Lengths<'a>(&'a Scene);
    impl Visitor for Lengths<'_> {
        type Output = (f64, f64);
        fn visit<G: Geometry>(self, geometry: G) -> Self::Output {
            let at = |n| pose(self.0, n).point;
            let whole = geometry.distance(at(0), at(8));
            ((1..=8).map(|n| geometry.distance(at(n - 1), at(n))).sum(), whole)
        }
    }
    let (sum, whole) = visit(scene.space.geometry, Lengths(&scene));
    assert!((sum - whole).abs() < 1e-13, "{sum} and {whole}");
    assert!(is_inside(&scene.space, 0, pose(&scene, 16).point));
}

#[test]
fn observer_bad_keys_are_refused() {
    let refuse = |lines: &str| scene(&format!("{TORUS}[[observer.path]]\n{lines}")).expect_err("a refusal");
    assert_eq!(refuse("frames = 0\n"), "path.toml:6:10: frames: 0 is out of range: 1 to 1000000");
    assert_eq!(refuse("step = [1, 2]\n"), "path.toml:6:8: step: expected an array of 3 numbers, found an array of 2");
    assert_eq!(
        refuse("look = [1, 0, 0]\n"),
        "path.toml:6:1: \"look\" has no meaning in a key pose without \"position\""
    );
    assert_eq!(
        refuse("position = [0.1, 0.1, 0.1]\nstep = [1, 0, 0]\n"),
        "path.toml:7:1: \"step\" has no meaning in a key pose with \"position\""
    );
    assert!(refuse("position = [3, 0, 0]\n").contains("is outside of cell 0 of torus"));
    assert!(refuse("turn = 3\n").starts_with("path.toml:6:1: unknown key \"turn\" in [[observer.path]]: "));
    let other = "[space]\nmanifold = \"s3\"\n[[observer.path]]\ncell = 2\nposition = [0, 0, 0, 1]\n";
    let message = scene(&other.replace("[[observer.path]]", "[observer]\n[[observer.path]]")).expect_err("a refusal");
    assert!(
        message.ends_with(
            "the key pose is in cell 2, the one before it in cell 0: use \"step\" to walk from cell to cell"
        )
    );
}
