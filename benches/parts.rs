//! The parts that a frame's time goes into, one by one, on one core in f64: they tell which part a slower frame comes from.

use criterion::{BatchSize, BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use glam::{DVec3, DVec4};
use holonomy::{
    geometry::{GEOMETRIES, Geodesic, Geometry, Segment, Visitor, visit},
    render::{
        Shot,
        cpu::{Counts, traverse::Tracer},
        plan::Plan,
        world::World,
    },
    scene::{Scene, file},
    space::{
        catalogue,
        domain::Domain,
        walk::{Follow, Path, Status, stage_segment, stage_transport},
    },
};
use std::{hint::black_box, time::Duration};

/// Rays in all directions, the same in every run.
const RAYS: usize = 64;

fn group<'a>(
    criterion: &'a mut Criterion,
    name: &str,
) -> criterion::BenchmarkGroup<'a, criterion::measurement::WallTime> {
    let mut group = criterion.benchmark_group(name);
    group.sample_size(20).warm_up_time(Duration::from_millis(200)).measurement_time(Duration::from_millis(600));
    group
}

/// Unit tangent vectors on a spiral over the sphere.
fn directions<G: Geometry>(geometry: G, at: DVec4) -> Vec<Geodesic> {
    let [x, y, z] = geometry.frame(at);
    let one = |i: usize| {
        let height = 1.0 - 2.0 * (i as f64 + 0.5) / RAYS as f64;
        let (sin, cos) = (2.399_963 * i as f64).sin_cos();
        let round = (1.0 - height * height).sqrt();
        let v = DVec3::new(round * cos, round * sin, height);
        Geodesic { point: at, velocity: x * v.x + y * v.y + z * v.z }
    };
    (0..RAYS).map(one).collect()
}

/// Geodesic flow by half a unit of length, per geodesic: the heart of every segment of a curved geodesic, and of every
/// step of an observer. The geometries differ by two orders of magnitude.
fn flows(criterion: &mut Criterion) {
    struct Flow<'a>(&'a mut Criterion, &'static str);
    impl Visitor for Flow<'_> {
        type Output = ();
        fn visit<G: Geometry>(self, geometry: G) {
            let rays = directions(geometry, geometry.base());
            let mut group = group(self.0, "flow");
            group.throughput(Throughput::Elements(RAYS as u64));
            group.bench_function(self.1, |b| {
                b.iter(|| rays.iter().map(|ray| geometry.flow(black_box(*ray), 0.5).point.x).sum::<f64>());
            });
        }
    }
    for entry in GEOMETRIES {
        visit(entry.id, Flow(criterion, entry.name));
    }
}

/// Walks through 16 faces of an empty cell, per face: the tests of all planes of a cell against a geodesic, and the
/// passage with its pairing. This is what is left of a frame without objects.
fn exits(criterion: &mut Criterion) {
    const FACES: u32 = 16;
    struct Walk<'a>(&'a mut Criterion, &'a str, Scene);
    impl Visitor for Walk<'_> {
        type Output = ();
        fn visit<G: Geometry>(self, geometry: G) {
            let domain = Domain::new(&self.2.space);
            let eye = self.2.observer.frame;
            let rays = directions(geometry, eye.point);
            let walk = |ray: Geodesic| {
                let mut path = Path::new(ray, eye.cell, f64::INFINITY);
                while path.status == Status::Flying
                    && stage_segment(geometry, &domain, &mut path, FACES, Follow::EXACTLY, |_| ()).is_some()
                {
                    stage_transport(geometry, &domain, &mut path, FACES, |_| ());
                }
                path.bounces
            };
            let faces: u32 = rays.iter().map(|ray| walk(*ray)).sum();
            let mut group = group(self.0, "exit");
            group.throughput(Throughput::Elements(faces.into()));
            group.bench_function(self.1, |b| b.iter(|| rays.iter().map(|ray| walk(black_box(*ray))).sum::<u32>()));
        }
    }
    for name in catalogue::NAMES {
        let scene = file::load(name).expect("a shipped scene");
        visit(scene.space.geometry, Walk(criterion, name, scene));
    }
}

/// Scenes whose hierarchies are measured: 100,352 triangles, a hall of small meshes, and triangles that arcs meet.
const HIERARCHIES: [&str; 3] = ["knot", "poincare", "nil-heisenberg"];

fn world(scene: &Scene) -> World {
    World::new(scene, &Plan::new(scene, false), scene.observer.frame).expect("it fits")
}

/// Building the hierarchies of all cells of a scene, which the first frame waits for, and each frame in which something
/// moves.
fn builds(criterion: &mut Criterion) {
    let mut group = group(criterion, "bvh-build");
    group.sample_size(10);
    for name in HIERARCHIES {
        let world = world(&file::load(name).expect("a shipped scene"));
        let build = |world: World| {
            world.hierarchy();
            world
        };
        // A copy shares its meshes and has no hierarchy yet.
        group.bench_function(name, |b| b.iter_batched(|| world.clone(), build, BatchSize::PerIteration));
    }
}

/// Traversal with the first segments of a picture's rays, per segment: nodes, boxes and primitive tests, with the surface
/// of a hit and the passage of a miss.
fn traversal(criterion: &mut Criterion) {
    struct Traverse<'a>(&'a mut Criterion, &'a str, Scene);
    impl Visitor for Traverse<'_> {
        type Output = ();
        fn visit<G: Geometry>(self, geometry: G) {
            const SIDE: u32 = 32;
            let world = world(&self.2);
            let shot = Shot::symmetric(self.2.observer.frame, self.2.observer.fov, [SIDE, SIDE]);
            let tracer = Tracer::new(geometry, &world, &shot);
            let follow = Follow { tolerance: shot.tolerance(world.settings.tolerance) };
            let first = |pixel: u32| -> Option<(Path, Segment)> {
                let at = [f64::from(pixel % SIDE) + 0.5, f64::from(pixel / SIDE) + 0.5];
                let mut path = Path::new(tracer.geodesic(at), shot.eye.cell, f64::INFINITY);
                let segment = stage_segment(geometry, &world.domain, &mut path, 8, follow, |_| ())?;
                Some((path, segment))
            };
            let segments: Vec<_> = (0..SIDE * SIDE).filter_map(first).collect();
            let mut counts = Counts::default();
            let mut group = group(self.0, "traversal");
            group.throughput(Throughput::Elements(segments.len() as u64));
            group.bench_function(BenchmarkId::from_parameter(self.1), |b| {
                b.iter(|| {
                    let mut hit = |(path, segment): &(Path, Segment)| {
                        tracer.trace_segment(&mut { *path }, black_box(*segment), &mut counts, |_| ()).is_some()
                    };
                    segments.iter().filter(|segment| hit(segment)).count()
                });
            });
        }
    }
    for name in HIERARCHIES {
        let scene = file::load(name).expect("a shipped scene");
        visit(scene.space.geometry, Traverse(criterion, name, scene));
    }
}

criterion_group!(benches, flows, exits, builds, traversal);
criterion_main!(benches);
