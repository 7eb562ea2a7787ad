//! What leaving out saves: frame times of a scene with and without a feature that it does not need.
//!
//! For each feature a scene that does not need it is drawn as planned (`left-out`) and with the feature kept in
//! (`kept-in`, as `render --keep` does): compiled into the shader, with its branches taken per pixel, on the device
//! that `HOLONOMY_DEVICE` names, and on the cpu. The camera is that of the picture in the README.

mod common;

use common::backends;
use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use holonomy::{
    render::{
        Shot, Target,
        plan::{Feature, Plan},
        world::World,
    },
    scene::{Scene, Shape, file},
};
use std::{sync::Arc, time::Duration};

const SIZE: [u32; 2] = [128, 128];

/// The README's scene without what needs the feature.
fn scene_without(feature: Feature) -> Scene {
    let mut scene = file::load("poincare").expect("a shipped scene");
    match feature {
        Feature::Shadows => scene.lights.iter_mut().for_each(|light| light.shadows = false),
        Feature::Textures => scene.materials.iter_mut().for_each(|m| {
            m.base_texture = None;
            m.surface_texture = None;
        }),
        Feature::Meshes => scene.objects.retain(|o| !matches!(o.shape, Shape::Mesh(_))),
        Feature::Quadrics => scene.objects.retain(|o| matches!(o.shape, Shape::Mesh(_))),
        _ => {}
    }
    scene
}

fn leave_out(criterion: &mut Criterion) {
    for feature in [Feature::Shadows, Feature::Textures, Feature::Meshes, Feature::Quadrics, Feature::AlphaMask] {
        let mut group = criterion.benchmark_group(feature.name());
        group.sample_size(10).warm_up_time(Duration::from_secs(1)).measurement_time(Duration::from_secs(4));
        let scene = scene_without(feature);
        for mut backend in backends() {
            for (name, keep) in [("left-out", &[][..]), ("kept-in", &[feature][..])] {
                let plan = Plan::new(&scene, false).keep(keep);
                assert_eq!(plan.uses(feature), !keep.is_empty(), "the scene does not need {}", feature.name());
                let world = Arc::new(World::new(&scene, &plan, scene.observer.frame).expect("it fits"));
                backend.load(&world).expect("it loads");
                let shot = Shot::symmetric(scene.observer.frame, scene.observer.fov, SIZE);
                let mut target = Target::new(SIZE);
                let id = BenchmarkId::new(backend.name(), name);
                group.bench_function(id, |b| {
                    b.iter(|| backend.render(&shot, &mut target, &|_| ()).expect("it draws"));
                });
            }
        }
        group.finish();
    }
}

criterion_group!(benches, leave_out);
criterion_main!(benches);
