//! Rays through edges and vertices, along faces, starting on faces: none is lost, none loops, none stops early.

use crate::support::{self, Random};
use glam::{DVec3, DVec4};
use holonomy::{
    geometry::{Geodesic, Geometry, Visitor, visit},
    render::{Backend, Shot, Target, compute::ComputeBackend, plan::Plan, world::World},
    scene::{Scene, Shading, file},
    shader_io::{COUNT_LOST, COUNT_RAYS},
    space::{
        Space, catalogue,
        domain::Domain,
        observer::Frame,
        polyhedron::Polyhedron,
        walk::{Follow, Path, Status, stage_segment, stage_transport},
    },
};
use std::sync::Arc;

/// Rays of each kind and space.
const RAYS: usize = 2000;
const BOUNCES: u32 = 40;

/// Kinds of rays that are hard on the face tests.
#[derive(Clone, Copy, Debug)]
enum Kind {
    ThroughEdge,
    ThroughVertex,
    AlongFace,
    AlongEdge,
    FromFace,
    FromEdge,
    FromVertex,
}

const KINDS: [Kind; 7] = [
    Kind::ThroughEdge,
    Kind::ThroughVertex,
    Kind::AlongFace,
    Kind::AlongEdge,
    Kind::FromFace,
    Kind::FromEdge,
    Kind::FromVertex,
];

struct Shoot<'a>(&'a Space);

impl Visitor for Shoot<'_> {
    type Output = ();

    fn visit<G: Geometry>(self, geometry: G) {
        let space = self.0;
        let domain = Domain::new(space);
        let cell = Polyhedron::new(&space.cells[0]).expect("a catalogue cell is a polyhedron");
        let model = |c: DVec3| geometry.unchart(c).expect("cells lie in the chart");
        let mut random = Random(1904);
        for kind in KINDS {
            for number in 0..RAYS {
                let edge = &cell.edges[number % cell.edges.len()];
                let [a, b] = edge.vertices.map(|v| cell.vertices[v]);
                let on_edge = a.lerp(b, random.next());
                let vertex = cell.vertices[number % cell.vertices.len()];
                let outline = &cell.face_vertices[number % cell.face_vertices.len()];
                let mut on_face = || {
                    let weights: Vec<f64> = outline.iter().map(|_| random.next() + 0.01).collect();
                    let sum: f64 = weights.iter().sum();
                    outline.iter().zip(&weights).map(|(v, w)| cell.vertices[*v] * (w / sum)).sum::<DVec3>()
                };
                let (p, q) = (on_face(), on_face());
                let inside = cell.centroid.lerp(p, 0.7 * random.next());
                let (start, target) = match kind {
                    Kind::ThroughEdge => (inside, on_edge),
                    Kind::ThroughVertex => (inside, vertex),
                    Kind::AlongFace => (p, q),
                    Kind::AlongEdge => (on_edge, b),
                    Kind::FromFace => (p, inside),
                    Kind::FromEdge => (on_edge, inside),
                    Kind::FromVertex => (vertex, inside),
                };
                let (velocity, distance) = geometry.log(model(start), model(target));
                if distance < 1e-6 {
                    continue;
                }
                let state = Geodesic { point: model(start), velocity };
                self.follow(geometry, &domain, state, &format!("{}: {kind:?} {number}", space.name));
            }
        }
    }
}

impl Shoot<'_> {
    /// The ray must use up its bounces, advance, and stay in the domain up to rounding.
    fn follow<G: Geometry>(&self, geometry: G, domain: &Domain, start: Geodesic, what: &str) {
        let mut path = Path::new(start, 0, f64::INFINITY);
        let mut steps = 0;
        let mut worst = 0.0_f64;
        while path.status == Status::Flying {
            // A face may take the state to a part of its partner's plane that is outside; the next segment begins
            // by bringing it in.
            if stage_segment(geometry, domain, &mut path, BOUNCES, Follow::EXACTLY, |_| ()).is_some() {
                for face in domain.cells[path.cell].clone() {
                    worst = worst.max(geometry.side(path.state.point, domain.faces[face].plane));
                }
                stage_transport(geometry, domain, &mut path, BOUNCES, |_| ());
            }
            steps += 1;
            assert!(steps < 1000, "{what}: loops");
        }
        assert_eq!(path.status, Status::Gone, "{what}: lost");
        // A ray that runs inside an edge or a face for ever passes no face: it must at least be as long as others.
        assert!(path.bounces == BOUNCES, "{what}: stopped after {} bounces", path.bounces);
        assert!(worst < 1e-9, "{what}: {worst:.1e} outside of the domain");
        assert!(path.travelled > 1.0, "{what}: {BOUNCES} bounces in length {:.1e}", path.travelled);
        assert!(path.state.point.is_finite() && path.state.velocity.is_finite(), "{what}");
    }
}

#[test]
fn corners_no_ray_is_lost_or_loops() {
    for name in catalogue::NAMES {
        let space = catalogue::find(name).expect("catalogue names resolve");
        visit(space.geometry, Shoot(&space));
    }
}

/// An empty copy of a shipped scene whose pictures show bounces: a ray that leaks, loops or stops shows as a pixel
/// with another number.
fn empty(name: &str) -> Scene {
    let mut scene = file::load(name).expect("shipped scenes load");
    scene.objects.clear();
    scene.lights.clear();
    scene.settings.shading = Shading::Bounces;
    scene.settings.bounces = 16;
    scene.settings.max_distance = None;
    scene
}

/// Eyes that look exactly at a vertex, an edge, along a face, and stand on a face.
fn eyes(scene: &Scene) -> Vec<Frame> {
    struct Eyes<'a>(&'a Scene);
    impl Visitor for Eyes<'_> {
        type Output = Vec<Frame>;
        fn visit<G: Geometry>(self, geometry: G) -> Vec<Frame> {
            let cell = Polyhedron::new(&self.0.space.cells[0]).expect("a polyhedron");
            let model = |c: DVec3| geometry.unchart(c).expect("in the chart");
            let look = |from: DVec3, to: DVec3| {
                let (point, target) = (model(from), model(to));
                let (ahead, _) = geometry.log(point, target);
                let [x, y, _] = geometry.frame(point);
                let aside = if geometry.inner(point, ahead, y).abs() < 0.9 { y } else { x };
                let axes = holonomy::geometry::orthonormalise(geometry, point, [-ahead, aside, DVec4::ZERO]);
                // The third axis of a right-handed frame with the first two given, by the chart's orientation.
                let third = geometry
                    .frame(point)
                    .into_iter()
                    .map(|e| {
                        e - axes[0] * geometry.inner(point, e, axes[0]) - axes[1] * geometry.inner(point, e, axes[1])
                    })
                    .max_by(|a, b| geometry.norm(point, *a).total_cmp(&geometry.norm(point, *b)))
                    .expect("three candidates");
                let right = third / geometry.norm(point, third);
                Frame { cell: 0, point, axes: [right, axes[1], axes[0]] }
            };
            let centre = cell.centroid;
            let [a, b] = cell.edges[0].vertices.map(|v| cell.vertices[v]);
            let outline = &cell.face_vertices[0];
            let middle = outline.iter().map(|v| cell.vertices[*v]).sum::<DVec3>() / outline.len() as f64;
            vec![
                look(centre, cell.vertices[0]),
                look(centre, a.midpoint(b)),
                look(middle, cell.vertices[outline[0]]),
                look(a.midpoint(b), centre),
            ]
        }
    }
    visit(scene.space.geometry, Eyes(scene))
}

#[test]
fn corners_pictures_have_no_seams() {
    let Some(gpu) = support::gpu() else { return };
    // An odd size puts a pixel's centre exactly on the corner that the eye looks at.
    let size = [129, 129];
    for name in catalogue::NAMES {
        let scene = empty(name);
        for (number, eye) in eyes(&scene).into_iter().enumerate() {
            let plan = Plan::new(&scene, true);
            let world = Arc::new(World::new(&scene, &plan, eye).expect("an empty world"));
            let mut backend = ComputeBackend::new(&gpu).expect("the backend can be made");
            backend.load(&world).expect("it loads");
            let mut target = Target::new(size);
            let shot = Shot::symmetric(eye, 90.0, size);
            let stats = backend.render(&shot, &mut target, &|_| ()).expect("it draws");
            assert_eq!(stats.counts[COUNT_LOST as usize], 0, "{name}, eye {number}");
            assert_eq!(stats.counts[COUNT_RAYS as usize], u64::from(size[0] * size[1]));
            for (index, pixel) in target.pixels.iter().enumerate() {
                assert_eq!(pixel[0], 16.0, "{name}, eye {number}: pixel {} {}", index % 129, index / 129);
            }
        }
    }
}
