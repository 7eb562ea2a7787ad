//! What scenes leave out, decided without a device.

use crate::support::Random;
use glam::{DVec3, DVec4};
use holonomy::{
    geometry::{Geodesic, Geometry, Visitor, visit},
    render::{
        plan::{Feature, Plan, Purpose},
        world::{World, WorldQuadric},
    },
    scene::{Place, Scene, Shading, Shape, file},
    shader_io,
    space::polyhedron::Polyhedron,
};

fn scene(name: &str) -> Scene {
    file::load(name).expect("shipped scenes load")
}

fn uses(scene: &Scene, feature: Feature) -> bool {
    Plan::new(scene, false).uses(feature)
}

#[test]
fn plan_every_feature_has_a_name_and_a_decision() {
    let plan = Plan::new(&scene("poincare"), false);
    assert_eq!(plan.decisions.len(), Feature::NAMES.len());
    for (decision, (name, feature)) in plan.decisions.iter().zip(Feature::NAMES) {
        assert_eq!((decision.feature, decision.feature.name()), (*feature, *name));
        assert!(!name.is_empty() && !decision.reason.is_empty());
    }
}

#[test]
fn plan_no_shadow_rays_without_a_shadowing_light() {
    let mut scene = scene("poincare");
    assert!(uses(&scene, Feature::Shadows) && uses(&scene, Feature::Lights));
    scene.lights.iter_mut().for_each(|light| light.shadows = false);
    assert!(!uses(&scene, Feature::Shadows) && uses(&scene, Feature::Lights));
    scene.lights.clear();
    assert!(!uses(&scene, Feature::Shadows) && !uses(&scene, Feature::Lights));
}

#[test]
fn plan_no_triangles_without_meshes_and_no_quadrics_without_tubes() {
    let full = scene("poincare");
    assert!(uses(&full, Feature::Meshes) && uses(&full, Feature::Quadrics) && uses(&full, Feature::Textures));
    let mut bare = full.clone();
    bare.objects.retain(|o| !matches!(o.shape, Shape::Mesh(_)));
    assert!(!uses(&bare, Feature::Meshes) && !uses(&bare, Feature::Textures) && uses(&bare, Feature::Quadrics));
    let mut meshes = full;
    meshes.objects.retain(|o| matches!(o.shape, Shape::Mesh(_)));
    assert!(uses(&meshes, Feature::Meshes) && !uses(&meshes, Feature::Quadrics));
}

#[test]
fn plan_masks_only_with_a_masked_material_in_use() {
    let mut leaves = scene("leaves");
    assert!(uses(&leaves, Feature::AlphaMask) && uses(&leaves, Feature::Textures));
    assert!(!uses(&scene("poincare"), Feature::AlphaMask));
    // A masked material that no object shows does not count.
    leaves.objects.retain(|o| o.material.is_some());
    assert!(!uses(&leaves, Feature::AlphaMask));
}

#[test]
fn plan_raw_pictures_need_no_light() {
    let mut scene = scene("poincare");
    for shading in [Shading::Distance, Shading::Bounces, Shading::Object, Shading::Normals] {
        scene.settings.shading = shading;
        for feature in [Feature::Lights, Feature::Shadows, Feature::Headlight, Feature::Fog, Feature::Textures] {
            assert!(!uses(&scene, feature), "{shading:?} needs no {}", feature.name());
        }
        assert_eq!(uses(&scene, Feature::Lengths), shading == Shading::Distance, "lengths for {shading:?}");
    }
    scene.settings.shading = Shading::Cell;
    assert!(uses(&scene, Feature::Labels));
}

#[test]
fn plan_limits_and_fog_follow_the_settings() {
    let mut scene = scene("torus");
    scene.settings.fog = 0.0;
    scene.settings.max_distance = None;
    scene.settings.headlight = [0.0; 3];
    assert!(!uses(&scene, Feature::Fog) && !uses(&scene, Feature::MaxDistance) && !uses(&scene, Feature::Lengths));
    scene.settings.fog = 0.1;
    scene.settings.max_distance = Some(3.0);
    assert!(uses(&scene, Feature::Fog) && uses(&scene, Feature::MaxDistance) && uses(&scene, Feature::Lengths));
    scene.settings.fog = 0.0;
    let eyes = Plan::new(&scene, false).serving(Purpose::Eyes { listed: false });
    assert!(eyes.uses(Feature::Lengths) && eyes.specialization().lengths == 1, "eyes have depths");
}

/// What is kept in on purpose is compiled in but still reported as not needed.
#[test]
fn plan_keeps_what_it_is_told_to() {
    let mut scene = scene("torus");
    scene.lights.clear();
    let plan = Plan::new(&scene, false).keep(&[Feature::Shadows, Feature::Lights]);
    let shadows = plan.decisions.iter().find(|d| d.feature == Feature::Shadows).expect("decided");
    assert!(!shadows.needed && shadows.kept && plan.uses(Feature::Shadows));
    assert_eq!(plan.specialization().shadows, 1);
    assert_eq!(Plan::new(&scene, false).specialization().shadows, 0);
}

/// The constants that reach the shader are those of the plan, one for one.
#[test]
fn plan_specialization_follows_every_decision() {
    let scene = scene("poincare");
    for (name, feature) in Feature::NAMES {
        let word = |plan: &Plan| {
            let s = plan.specialization();
            match feature {
                Feature::Meshes => s.meshes,
                Feature::Quadrics => s.quadrics,
                Feature::AlphaMask => s.alpha_mask,
                Feature::Textures => s.textures,
                Feature::Coordinates => s.coordinates,
                Feature::Lights => s.lights,
                Feature::Shadows => s.shadows,
                Feature::Headlight => s.headlight,
                Feature::Fog => s.fog,
                Feature::MaxDistance => s.max_distance,
                Feature::Lengths => s.lengths,
                Feature::Labels => s.labels,
                Feature::Counters => s.counters,
            }
        };
        let plan = Plan::new(&scene, false);
        assert_eq!(word(&plan) == 1, plan.uses(*feature), "{name}");
        assert_eq!(word(&plan.keep(&[*feature])), 1, "{name}");
    }
    assert_eq!(Plan::new(&scene, false).specialization().shading, shader_io::SHADING_RIEMANNIAN);
}

/// Attached objects follow the observer; the rest of the scene does not need him.
#[test]
fn plan_scenes_say_what_is_attached() {
    assert!(scene("torus").objects.iter().any(|o| matches!(o.place, Place::Viewer { .. })));
    assert!(!scene("poincare").objects.iter().any(|o| matches!(o.place, Place::Viewer { .. })));
}

/// Balls at vertices are no part of a world where tubes run along all edges there, and what the cell has of such a ball is in
/// these tubes indeed; if a tube is missing or thinner, they are.
#[test]
fn plan_leaves_out_balls_inside_of_tubes() {
    struct Outside<'a>(&'a Scene, &'a World);
    impl Visitor for Outside<'_> {
        /// Points of the cell that are in a ball at a vertex, and how many of them are in no tube.
        type Output = (usize, usize);
        fn visit<G: Geometry>(self, geometry: G) -> (usize, usize) {
            let Self(scene, world) = self;
            let radius = scene.objects.iter().find_map(|object| match object.shape {
                Shape::DomainEdges { radius } | Shape::Tube { radius, .. } => Some(radius),
                _ => None,
            });
            let radius = radius.expect("tubes");
            let cell = &scene.space.cells[0];
            let polyhedron = Polyhedron::bounded(cell).expect("a cell").expect("with an end");
            let in_tube = |quadric: &WorldQuadric, c: DVec3| {
                let x = c.extend(1.0);
                x.dot(quadric.surface.matrix() * x) <= 0.0 && quadric.clip.iter().all(|plane| plane.dot(x) >= 0.0)
            };
            let mut random = Random(11);
            let (mut inside, mut outside) = (0, 0);
            for vertex in &polyhedron.vertices {
                let point = geometry.unchart(*vertex).expect("a point");
                let axes = geometry.frame(point);
                for _ in 0..500 {
                    let towards = [0; 3].map(|_| random.within(-1.0, 1.0));
                    let velocity = (0..3).map(|i| axes[i] * towards[i]).sum::<DVec4>();
                    let length = geometry.norm(point, velocity);
                    let start = Geodesic { point, velocity: velocity / length };
                    let c = geometry.chart(geometry.flow(start, random.within(0.0, radius)).point);
                    if world.domain.faces.iter().all(|face| face.plane.dot(c.extend(1.0)) <= 0.0) {
                        inside += 1;
                        outside += usize::from(!world.quadrics.iter().any(|quadric| in_tube(quadric, c)));
                    }
                }
            }
            (inside, outside)
        }
    }
    let world = |scene: &Scene| {
        let plan = Plan::new(scene, false);
        World::new(scene, &plan, scene.observer.frame).expect("a world")
    };
    // The third form of a tube is zero.
    let balls = |world: &World| world.quadrics.iter().filter(|q| q.surface.forms[2].length() > 0.0).count();
    for (name, others) in
        [("bench-torus", 2), ("torus", 0), ("poincare", 0), ("seifert-weber", 0), ("mirrored-cube", 0)]
    {
        let scene = scene(name);
        let world = world(&scene);
        assert_eq!(balls(&world), others, "{name}");
        let (inside, outside) = visit(scene.space.geometry, Outside(&scene, &world));
        assert!(inside > 100 && outside == 0, "{name}: {outside} of {inside} points");
    }
    let full = scene("bench-torus");
    let tube = full.objects.iter().position(|object| matches!(object.shape, Shape::Tube { .. })).expect("a tube");
    let mut missing = full.clone();
    missing.objects.remove(tube);
    assert_eq!(balls(&world(&missing)), 8 + 2);
    let mut thinner = full;
    if let Shape::Tube { radius, .. } = &mut thinner.objects[tube].shape {
        *radius *= 0.5;
    }
    // Its own balls are hidden by the other tubes only where the three meet, which they do at all vertices.
    assert_eq!(balls(&world(&thinner)), 8 + 2);
}
