//! The ray tracing pipeline, its recursive variant and the compute pipeline on one device: frame times at 1 to 16
//! bounces, back to back; and frames of a moving object, refitted against loaded from nothing.
//!
//! The device is the best with ray tracing, or the one that `HOLONOMY_DEVICE` names.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use glam::DVec3;
use holonomy::{
    render::{
        Backend, Shot, Target,
        compute::ComputeBackend,
        plan::Plan,
        rt::{RtBackend, RtOptions},
        world::{Pose, World},
    },
    scene::{Motion, file},
    vulkan::{Context, ContextOptions, Tier, VulkanError},
};
use std::{sync::Arc, time::Duration};

const SIZE: [u32; 2] = [256, 256];

type Pipelines = Vec<(&'static str, Box<dyn Backend>)>;

/// Compute, rt, and the recursive variant of rt, on one device.
fn open() -> Result<Pipelines, VulkanError> {
    let context = Context::new(&ContextOptions { tier: Tier::Rt, ..ContextOptions::from_env()? })?;
    println!("{}", context.info());
    Ok(vec![
        ("compute", Box::new(ComputeBackend::new(&context)?)),
        ("rt", Box::new(RtBackend::new(&context)?)),
        ("rt-recursive", Box::new(RtBackend::with_options(&context, RtOptions { recursive: true })?)),
    ])
}

/// None where there is no such device.
fn pipelines() -> Pipelines {
    open().unwrap_or_else(|error| {
        eprintln!("skipped: {error}");
        Vec::new()
    })
}

fn bounces(criterion: &mut Criterion) {
    let mut backends = pipelines();
    for name in ["torus", "seifert-weber"] {
        let mut scene = file::load(name).expect("a shipped scene");
        for bounces in [1, 2, 4, 8, 16] {
            scene.settings.bounces = bounces;
            let mut group = criterion.benchmark_group(format!("{name}/{bounces}"));
            group.sample_size(10).warm_up_time(Duration::from_millis(500)).measurement_time(Duration::from_secs(2));
            let plan = Plan::new(&scene, false);
            let world = Arc::new(World::new(&scene, &plan, scene.observer.frame).expect("it fits"));
            let shot = Shot::symmetric(scene.observer.frame, scene.observer.fov, SIZE);
            let mut target = Target::new(SIZE);
            for (pipeline, backend) in &mut backends {
                if let Err(error) = backend.load(&world) {
                    eprintln!("skipped: {pipeline}: {error}");
                    continue;
                }
                group.bench_function(BenchmarkId::from_parameter(pipeline), |b| {
                    b.iter(|| backend.render(&shot, &mut target, &|_| ()).expect("it draws"));
                });
            }
            group.finish();
        }
    }
}

/// One step of a knot of 100,352 triangles that turns and drifts: refitted, and loaded from nothing.
fn moving(criterion: &mut Criterion) {
    let mut scene = file::load("knot").expect("a shipped scene");
    scene.objects[0].motion = Some(Motion { velocity: DVec3::new(0.1, 0.0, 0.05), turn: DVec3::Y });
    let plan = Plan::new(&scene, false);
    let pose = |frame: u32| Pose::new(scene.observer.frame, f64::from(frame) / 60.0);
    let mut group = criterion.benchmark_group("moving");
    group.sample_size(10).warm_up_time(Duration::from_secs(1)).measurement_time(Duration::from_secs(5));
    for (name, backend) in pipelines().iter_mut().filter(|(name, _)| *name == "rt") {
        let mut world = Arc::new(World::moving(&scene, &plan, pose(0)).expect("it fits"));
        backend.load(&world).expect("it loads");
        let mut frame = 0;
        group.bench_function(BenchmarkId::new(*name, "refitted"), |b| {
            b.iter(|| {
                frame += 1;
                world = Arc::new(world.posed(&scene, pose(frame)).expect("it fits"));
                backend.pose(&world).expect("it moves");
            });
        });
        group.bench_function(BenchmarkId::new(*name, "from-nothing"), |b| {
            b.iter(|| {
                frame += 1;
                let world = Arc::new(World::moving(&scene, &plan, pose(frame)).expect("it fits"));
                backend.load(&world).expect("it loads");
            });
        });
    }
    group.finish();
}

criterion_group!(benches, bounces, moving);
criterion_main!(benches);
