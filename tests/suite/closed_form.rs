//! Pictures and paths whose answer is known.

use crate::support;
use holonomy::{
    render::{Backend, Shot, Target, compute::ComputeBackend, cpu::CpuBackend, plan::Plan, world::World},
    scene::{Scene, file, folder::Folder},
};
use std::sync::Arc;

const SIZE: [u32; 2] = [65, 65];

fn scene(text: &str) -> Scene {
    file::read("test.toml", text.as_bytes(), &Folder::Embedded).expect("the scene is right")
}

fn draw(backend: &mut dyn Backend, scene: &Scene) -> Target {
    let plan = Plan::new(scene, false);
    let world = Arc::new(World::new(scene, &plan, scene.observer.frame).expect("the world fits"));
    backend.load(&world).expect("it loads");
    let shot = Shot::symmetric(scene.observer.frame, scene.observer.fov, SIZE);
    let mut target = Target::new(SIZE);
    backend.render(&shot, &mut target, &|_| ()).expect("it draws");
    target
}

/// Runs a check on the pictures of all backends; the tolerance is the backend's number format.
fn on_all_backends(scene: &Scene, check: impl Fn(&str, &Target, f64)) {
    check("cpu", &draw(&mut CpuBackend::default(), scene), 1e-6);
    if let Some(gpu) = support::gpu() {
        check("compute", &draw(&mut ComputeBackend::new(&gpu).expect("the backend can be made"), scene), 2e-5);
    }
}

/// Inside of a ball around the eye: the same distance in all directions, in every geometry.
#[test]
fn closed_form_inside_of_a_ball() {
    for (space, position, radius) in
        [("torus", "[0.5, 0.5, 0.5]", 0.4), ("poincare", "[0, 0, 0, 1]", 0.25), ("seifert-weber", "[0, 0, 0, 1]", 0.9)]
    {
        let scene = scene(&format!(
            "[space]\nmanifold = \"{space}\"\n[observer]\nposition = {position}\nfov = 100\n\
             [[material]]\nname = \"m\"\n[[object]]\nkind = \"ball\"\nposition = {position}\nradius = {radius}\nmaterial = \"m\"\n\
             [render]\nshading = \"distance\"\n"
        ));
        on_all_backends(&scene, |backend, target, tolerance| {
            for pixel in &target.pixels {
                let error = (f64::from(pixel[0]) - radius).abs();
                assert!(error < tolerance, "{space} on {backend}: distance {} instead of {radius}", pixel[0]);
            }
        });
    }
}

/// A ball that is larger than its cell is cut by no face: the copies complete it.
#[test]
fn closed_form_ball_across_a_face() {
    // The ball's centre lies on the face x = 1; the eye looks at it along x from x = 0.5 and sees it at 0.3.
    let scene = scene(
        "[space]\nmanifold = \"torus\"\n[observer]\nposition = [0.5, 0.5, 0.5]\nlook = [1, 0, 0]\nup = [0, 0, 1]\nfov = 30\n\
         [[material]]\nname = \"m\"\n[[object]]\nkind = \"ball\"\nposition = [1, 0.5, 0.5]\nradius = 0.2\nmaterial = \"m\"\n\
         [render]\nshading = \"distance\"\n",
    );
    let tan = 15.0_f64.to_radians().tan();
    on_all_backends(&scene, |backend, target, tolerance| {
        for (index, pixel) in target.pixels.iter().enumerate() {
            let (x, y) = (index as u32 % SIZE[0], index as u32 / SIZE[0]);
            let at = |i: u32, n: u32| tan * (2.0 * (f64::from(i) + 0.5) / f64::from(n) - 1.0);
            // Ray (1, a, b)/|..| against the sphere of radius 0.2 around (0.5, 0, 0) from the eye.
            let (a, b) = (at(x, SIZE[0]), at(y, SIZE[1]));
            let along = 0.5 / (1.0 + a * a + b * b).sqrt();
            let rest = 0.04 - (0.25 - along * along);
            if rest > 1e-6 {
                let expected = along - rest.sqrt();
                let error = (f64::from(pixel[0]) - expected).abs();
                assert!(error < 20.0 * tolerance, "{backend}: pixel {x} {y}: {} instead of {expected}", pixel[0]);
            }
        }
    });
}

/// One's own ball seen around the space: lengths of the shortest closed geodesics.
#[test]
fn closed_form_round_the_space() {
    use std::f64::consts::PI;
    // Through the centre of a face and back to the centre: twice the inradius (of the torus, its side).
    let seifert_weber = 2.0 * 0.996_384_497_847_146_8;
    for (space, position, look, round) in [
        ("torus", "[0.5, 0.5, 0.5]", "[0, 0, 1]", 1.0),
        ("mirrored-cube", "[0, 0, 0]", "[0, 0, 1]", 1.0),
        ("poincare", "[0, 0, 0, 1]", "[0, 1, 1.618033988749895]", PI / 5.0),
        ("seifert-weber", "[0, 0, 0, 1]", "[0, 1, 1.618033988749895]", seifert_weber),
    ] {
        let radius = 0.05;
        let scene = scene(&format!(
            "[space]\nmanifold = \"{space}\"\n[observer]\nposition = {position}\nlook = {look}\nup = [1, 0, 0]\nfov = 2\n\
             [[material]]\nname = \"m\"\n[[object]]\nkind = \"ball\"\nposition = {position}\nradius = {radius}\nmaterial = \"m\"\n\
             [render]\nshading = \"distance\"\nbounces = 1\n"
        ));
        // The eye is inside the ball: take the ball away from the start by looking from behind it.
        let mut outside = scene.clone();
        let holonomy::scene::Place::World(frame) = outside.objects[0].place else { panic!("a world object") };
        outside.observer.frame.point = frame.point;
        outside.objects[0].shape = holonomy::scene::Shape::Ball { radius };
        on_all_backends(&outside, |backend, target, tolerance| {
            // From the centre of the ball one sees its inside first, at its radius.
            let centre = f64::from(target.pixels[(32 * 65 + 32) as usize][0]);
            assert!((centre - radius).abs() < tolerance, "{space} on {backend}: {centre}");
        });
        // Without the first wall: an eye just outside of the ball, moved by 0.1 along the view.
        struct Move(holonomy::space::observer::Frame);
        impl holonomy::geometry::Visitor for Move {
            type Output = holonomy::space::observer::Frame;
            fn visit<G: holonomy::geometry::Geometry>(self, geometry: G) -> Self::Output {
                self.0.moved(geometry, glam::DVec3::new(0.0, 0.0, -0.1))
            }
        }
        let mut moved = scene;
        moved.observer.frame = holonomy::geometry::visit(moved.space.geometry, Move(moved.observer.frame));
        on_all_backends(&moved, |backend, target, tolerance| {
            let seen = f64::from(target.pixels[(32 * 65 + 32) as usize][0]);
            let expected = round - 0.1 - radius;
            assert!((seen - expected).abs() < tolerance, "{space} on {backend}: {seen} instead of {expected}");
        });
    }
}

/// On the sphere all geodesics from a point meet again at its antipode. −1 lies in the binary icosahedral group, so in
/// the Poincaré space the antipode of a point is the point itself: every ray comes home after length π.
#[test]
fn closed_form_antipodal_focus() {
    use holonomy::{
        geometry::{Geodesic, Geometry, Visitor, visit},
        space::{catalogue, domain::Domain, reduce::transport},
    };
    struct Home(Domain);
    impl Visitor for Home {
        type Output = f64;
        fn visit<G: Geometry>(self, geometry: G) -> f64 {
            let mut random = support::Random(120);
            let mut worst = 0.0_f64;
            for _ in 0..500 {
                let c = glam::DVec3::from_array(std::array::from_fn(|_| random.within(-0.1, 0.1)));
                let point = geometry.unchart(c).expect("in the chart");
                let [x, y, z] = geometry.frame(point);
                let v = x * random.within(-1.0, 1.0) + y * random.within(-1.0, 1.0) + z * random.within(-1.0, 1.0);
                let start = Geodesic { point, velocity: v / geometry.norm(point, v) };
                let end = transport(geometry, &self.0, start, 0, std::f64::consts::PI).expect("the space is sound");
                assert!(end.faces.len() >= 4, "a ray of length pi crosses several of the 120 cells");
                worst = worst.max((end.state.point - point).length());
            }
            worst
        }
    }
    let space = catalogue::find("poincare").expect("a catalogue space");
    let worst = visit(space.geometry, Home(Domain::new(&space)));
    assert!(worst < 1e-13, "a ray misses its start by {worst:.1e}");
}

/// The headlight's falloff is the area density: 1/d² in E3.
#[test]
fn closed_form_light_falls_off_by_area() {
    let scene = |distance: f64| {
        scene(&format!(
            "[space]\nmanifold = \"torus\"\n[observer]\nposition = [0.5, 0.5, 0.1]\nlook = [0, 0, 1]\nup = [0, 1, 0]\nfov = 1\n\
             [[light]]\nkind = \"viewer\"\nintensity = 0.01\n[[material]]\nname = \"m\"\ncolor = [1, 1, 1]\nroughness = 1\n\
             [[object]]\nkind = \"ball\"\nposition = [0.5, 0.5, {}]\nradius = 0.1\nmaterial = \"m\"\n\
             [render]\nambient = [0, 0, 0]\n",
            0.2 + distance
        ))
    };
    let light = |distance: f64| f64::from(draw(&mut CpuBackend::default(), &scene(distance)).pixels[32 * 65 + 32][0]);
    let ratio = light(0.1) / light(0.3);
    assert!((ratio - 9.0).abs() < 1e-3, "{ratio} instead of 9");
}

/// A ray that has hit costs nothing further: inside of a ball every ray is one segment, whatever the bounces allowed,
/// and none passes a face.
#[test]
fn closed_form_rays_that_hit_cost_nothing_further() {
    use holonomy::shader_io as io;
    let gpu = support::gpu();
    for bounces in [1, 16] {
        let scene = scene(&format!(
            "[space]\nmanifold = \"poincare\"\n[[material]]\nname = \"m\"\n[[object]]\nkind = \"ball\"\nradius = 0.2\n\
             material = \"m\"\n[render]\nshading = \"distance\"\nbounces = {bounces}\n"
        ));
        let mut backends: Vec<Box<dyn Backend>> = vec![Box::new(CpuBackend::default())];
        if let Some(gpu) = &gpu {
            backends.push(Box::new(ComputeBackend::new(gpu).expect("the backend can be made")));
        }
        for mut backend in backends {
            let plan = Plan::new(&scene, true);
            let world = Arc::new(World::new(&scene, &plan, scene.observer.frame).expect("the world fits"));
            backend.load(&world).expect("it loads");
            let shot = Shot::symmetric(scene.observer.frame, scene.observer.fov, SIZE);
            let stats = backend.render(&shot, &mut Target::new(SIZE), &|_| ()).expect("it draws");
            let count = |what: u32| stats.counts[what as usize];
            let rays = u64::from(SIZE[0] * SIZE[1]);
            assert_eq!([count(io::COUNT_RAYS), count(io::COUNT_SEGMENTS), count(io::COUNT_HITS)], [rays; 3]);
            assert_eq!([count(io::COUNT_BOUNCES), count(io::COUNT_LOST), count(io::COUNT_SHADOW_RAYS)], [0; 3]);
        }
    }
}
