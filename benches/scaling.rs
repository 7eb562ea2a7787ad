//! How cost grows: with bounces (time per traced segment) and with triangles (time per frame).
//!
//! `bounces` draws the flat torus of the README's gallery with 1 to 16 bounces, `triangles` the same space with the
//! knot at about 1,000 and at about 100,000 triangles. Criterion's throughput is segments per second, counted by
//! the backend itself, so its reciprocal is time per segment.

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
    group.sample_size(10).warm_up_time(Duration::from_secs(1)).measurement_time(Duration::from_secs(4));
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

fn bounces(criterion: &mut Criterion) {
    let mut scene = file::load("torus").expect("a shipped scene");
    for bounces in [1, 2, 4, 8, 16] {
        scene.settings.bounces = bounces;
        measure(criterion, "bounces", &bounces.to_string(), &scene);
    }
}

fn triangles(criterion: &mut Criterion) {
    let text = String::from_utf8_lossy(shipped::find("knot").expect("a shipped scene")).into_owned();
    for (name, mesh) in [("1008", "knot-small.glb"), ("100352", "knot.glb")] {
        let scene = file::read(name, text.replace("knot.glb", mesh).as_bytes(), &Folder::Embedded);
        measure(criterion, "triangles", name, &scene.expect("the scene is right"));
    }
}

criterion_group!(benches, bounces, triangles);
criterion_main!(benches);
