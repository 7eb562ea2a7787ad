//! The grids that list the images of lights which may shine on a place.

use crate::support::Random;
use glam::{DVec3, DVec4};
use holonomy::{
    geometry::{Geodesic, Geometry, Visitor, exponential, visit},
    render::{
        plan::Plan,
        world::{World, lights::WorldLight},
    },
    scene::{PointLight, Scene, file},
    space::{catalogue, polyhedron::Polyhedron},
};
use std::collections::BTreeSet;

/// Places of a cell's chart: its corners, points between them, or for a cell without end points about the observer.
fn places<G: Geometry>(geometry: G, scene: &Scene, cell: usize, random: &mut Random) -> Vec<DVec3> {
    const COUNT: usize = 400;
    let observer = scene.observer.frame.point;
    match Polyhedron::bounded(&scene.space.cells[cell]).expect("a polyhedron") {
        Some(polyhedron) => {
            let mut places = polyhedron.vertices.clone();
            for _ in 0..COUNT {
                let weights: Vec<f64> = polyhedron.vertices.iter().map(|_| -random.next().max(1e-9).ln()).collect();
                let sum: DVec3 = polyhedron.vertices.iter().zip(&weights).map(|(v, w)| *v * *w).sum();
                places.push(sum / weights.iter().sum::<f64>());
            }
            places
        }
        None => (0..COUNT)
            .map(|_| {
                let axes = geometry.frame(observer);
                let along = axes.map(|axis| axis * (4.0 * random.next() - 2.0)).into_iter().sum::<DVec4>();
                geometry.chart(exponential(geometry, observer, along))
            })
            .collect(),
    }
}

/// Lengths of the lists at some places, after a look whether each holds all images that shine there.
struct Check<'a>(&'a Scene, &'a World);

impl Visitor for Check<'_> {
    type Output = Vec<usize>;

    fn visit<G: Geometry>(self, geometry: G) -> Vec<usize> {
        let Self(scene, world) = self;
        let mut random = Random(5);
        let mut lengths = Vec::new();
        let mut seen = 0;
        for cell in 0..scene.space.cells.len() {
            let images = images_of(world, cell, &mut seen);
            for place in places(geometry, scene, cell, &mut random) {
                let Some(point) = geometry.unchart(place) else { continue };
                let listed: Vec<*const _> = world.lights.near(cell, place).map(std::ptr::from_ref).collect();
                let own = &world.lights.grids[cell];
                let mut reaching = 0;
                for image in images {
                    if geometry.distance(point, image.point) < image.range {
                        reaching += 1;
                        assert!(
                            listed.contains(&std::ptr::from_ref(image)),
                            "{}: cell {cell}, place {place}: a light at {} is not in its list ({own:?})",
                            scene.space.geometry.name(),
                            image.point
                        );
                    }
                }
                assert!(reaching <= listed.len());
                assert!(listed.is_sorted(), "lights are added up in another order than without lists");
                lengths.push(listed.len());
            }
        }
        assert_eq!(seen, world.lights.images.len(), "an image that no cell lists");
        lengths
    }
}

/// The images in a cell: those that any of its boxes lists, which are the next ones of all.
fn images_of<'a>(world: &'a World, cell: usize, seen: &mut usize) -> &'a [WorldLight] {
    let grid = world.lights.grids[cell];
    let boxes = (grid.boxes * grid.boxes * grid.boxes) as usize;
    let first = grid.first as usize;
    let [start, end] = [first, first + boxes].map(|at| world.lights.lists[at] as usize);
    let listed: BTreeSet<u32> = world.lights.lists[start..end].iter().copied().collect();
    let own = *seen..*seen + listed.len();
    assert!(listed.into_iter().map(|image| image as usize).eq(own.clone()), "cell {cell} misses an image");
    *seen = own.end;
    &world.lights.images[own]
}

fn world_of(scene: &Scene) -> World {
    World::new(scene, &Plan::new(scene, false), scene.observer.frame)
        .unwrap_or_else(|error| panic!("{}: {error}", scene.space.geometry.name()))
}

fn lit(name: &str, range: f64) -> Scene {
    let mut scene = file::load(name).expect("shipped scenes load");
    let frame = scene.observer.frame;
    scene.objects.clear();
    scene.lights =
        vec![PointLight { cell: frame.cell, point: frame.point, color: [1.0; 3], range, shadows: false, spot: None }];
    scene
}

#[test]
fn lights_each_place_has_those_that_shine_there() {
    let unbounded = ["e3", "h3", "s3", "nil", "sol", "sl2", "h2xr", "s2xr"];
    for name in catalogue::NAMES.iter().copied().chain(unbounded) {
        for range in [0.3, 0.7] {
            let scene = lit(name, range);
            let world = world_of(&scene);
            assert!(!world.lights.images.is_empty(), "{name}");
            visit(scene.space.geometry, Check(&scene, &world));
        }
    }
}

#[test]
fn lights_few_are_listed_of_many() {
    let scene = file::load("seifert-weber").expect("shipped scenes load");
    let world = world_of(&scene);
    let lengths = visit(scene.space.geometry, Check(&scene, &world));
    let mean = lengths.iter().sum::<usize>() as f64 / lengths.len() as f64;
    assert!(world.lights.images.len() > 80, "{}", world.lights.images.len());
    assert!(mean < 10.0, "{mean} of {}", world.lights.images.len());
}

#[test]
fn lights_without_any_have_empty_lists() {
    let mut scene = lit("torus", 1.0);
    scene.lights.clear();
    let world = world_of(&scene);
    assert_eq!(world.lights.near(0, DVec3::ZERO).count(), 0);
}

/// Without copies of the light the tests above would have nothing to find.
#[test]
fn lights_images_are_copies() {
    let scene = lit("torus", 1.1);
    let world = world_of(&scene);
    let state = Geodesic { point: scene.lights[0].point, velocity: DVec4::ZERO };
    assert!(world.lights.images.iter().any(|image| image.point.distance(state.point) < 1e-12), "not the light itself");
    assert!(world.lights.images.len() > 1, "none of its neighbours");
}
