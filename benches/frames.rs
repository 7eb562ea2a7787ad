//! Whole frames on every backend of this machine. Criterion's throughput is segments per second, counted by the backend
//! itself. How frames grow with bounces, sizes and eyes is measured by `holonomy profile`, with processor times.

mod common;

use common::backends;
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use holonomy::{
    render::{Backend, Shot, Target, plan::Plan, world::World},
    scene::{Scene, file, folder::Folder, shipped},
    shader_io::{COUNT_SEGMENTS, COUNT_SHADOW_SEGMENTS},
};
use std::{sync::Arc, time::Duration};

const SIZE: [u32; 2] = [192, 192];

/// Draws the scene once with counters for its number of segments, then measures it without.
fn measure(criterion: &mut Criterion, group: &str, name: &str, scene: &Scene) {
    let mut group = criterion.benchmark_group(group);
    group.sample_size(10).warm_up_time(Duration::from_millis(500)).measurement_time(Duration::from_secs(3));
    let shot = Shot::symmetric(scene.observer.frame, scene.observer.fov, SIZE);
    let mut target = Target::new(SIZE);
    for mut backend in backends() {
        let mut load = |backend: &mut Box<dyn Backend>, count| {
            let plan = Plan::new(scene, count);
            let world = Arc::new(World::new(scene, &plan, scene.observer.frame).expect("it fits"));
            backend.load(&world).expect("it loads");
            backend.render(&shot, &mut target, &|_| ()).expect("it draws")
        };
        let counts = load(&mut backend, true).counts;
        let segments = counts[COUNT_SEGMENTS as usize] + counts[COUNT_SHADOW_SEGMENTS as usize];
        load(&mut backend, false);
        group.throughput(Throughput::Elements(segments));
        group.bench_function(BenchmarkId::new(backend.name(), name), |b| {
            b.iter(|| backend.render(&shot, &mut target, &|_| ()).expect("it draws"));
        });
    }
    group.finish();
}

/// A frame at 8 bounces in a flat, a spherical, a hyperbolic and a curved space: what a change of the renderer costs or
/// brings as a whole.
fn frames(criterion: &mut Criterion) {
    for name in ["torus", "poincare", "seifert-weber", "nil-heisenberg"] {
        let mut scene = file::load(name).expect("a shipped scene");
        scene.settings.bounces = 8;
        measure(criterion, "frames", name, &scene);
    }
}

/// The flat torus with the knot at about 1,000 and at about 100,000 triangles: how cost grows with triangles.
fn triangles(criterion: &mut Criterion) {
    let text = String::from_utf8_lossy(shipped::find("knot").expect("a shipped scene")).into_owned();
    for (name, mesh) in [("1008", "knot-small.glb"), ("100352", "knot.glb")] {
        let scene = file::read(name, text.replace("knot.glb", mesh).as_bytes(), &Folder::Embedded);
        measure(criterion, "triangles", name, &scene.expect("the scene is right"));
    }
}

criterion_group!(benches, frames, triangles);
criterion_main!(benches);
