//! The ray tracing backend: what is built for what a scene has, instances, moving objects, the pipeline cache on disk,
//! faults. That it draws the pictures of the other backends is in `agree`.

use crate::{
    support::{Random, gpu_turn, rt_gpu, rt_turn},
    vulkan::{rich_scene, shot},
};
use ash::vk;
use glam::{DMat3, DVec3};
use holonomy::{
    geometry::{Geometry, Visitor, visit},
    render::{
        Backend, RenderError, Shot, Stats, StructureStats, Target, auto,
        compute::ComputeBackend,
        cpu::CpuBackend,
        plan::Plan,
        rt::{RtBackend, guards::Guards},
        world::{Pose, World},
    },
    scene::{Mesh, Motion, Object, Place, Scene, Shading, Shape, Vertex, file},
    shader_io::{Box, KIND_ALL, KIND_MESHES, KIND_MOVING, KIND_QUADRICS, Specialization},
    space::observer::Frame,
    vulkan::{Context, ContextOptions, Tier, cache::Found, fault::FaultInjection},
};
use std::{fs, path::PathBuf, sync::Arc};

fn world(scene: &Scene) -> Arc<World> {
    let plan = Plan::new(scene, false);
    Arc::new(World::new(scene, &plan, scene.observer.frame).expect("a world"))
}

fn picture(scene: &Scene, size: [u32; 2]) -> Shot {
    Shot::symmetric(scene.observer.frame, scene.observer.fov, size)
}

fn draw(backend: &mut dyn Backend, shot: &Shot) -> (Target, Stats) {
    let mut target = Target::new([1, 1]);
    let stats = backend.render(shot, &mut target, &|_| ()).expect("a picture");
    (target, stats)
}

fn structures(stats: &Stats) -> StructureStats {
    stats.structures.expect("rt knows its structures")
}

/// Share of pixels that differ by more than `tolerance` in a linear channel.
fn differing(a: &Target, b: &Target, tolerance: f32) -> f64 {
    assert_eq!(a.pixels.len(), b.pixels.len());
    let differ = |(p, q): &(&[f32; 4], &[f32; 4])| p.iter().zip(*q).any(|(x, y)| (x - y).abs() > tolerance);
    a.pixels.iter().zip(&b.pixels).filter(differ).count() as f64 / a.pixels.len() as f64
}

// --- what is built -------------------------------------------------------------------------------------------

/// No structure without something to hit, none over boxes without quadrics, none over triangles without meshes.
#[test]
fn rt_builds_only_what_the_scene_has() {
    let Some(gpu) = rt_gpu() else { return };
    let mut backend = RtBackend::new(&gpu).expect("a backend");
    let full = rich_scene("torus");
    let is_mesh = |object: &Object| matches!(object.shape, Shape::Mesh(_));
    let mut built = |keep: &dyn Fn(&Object) -> bool| {
        let mut scene = full.clone();
        scene.objects.retain(keep);
        backend.load(&world(&scene)).expect("a load");
        structures(&draw(&mut backend, &picture(&scene, [16, 16])).1)
    };
    let (nothing, meshes, quadrics, all) =
        (built(&|_| false), built(&is_mesh), built(&|o| !is_mesh(o)), built(&|_| true));
    assert_eq!((nothing.bottom, nothing.bytes_built, nothing.bytes_top, nothing.builds), (0, 0, 0, 0));
    assert_eq!((quadrics.bottom, quadrics.instances), (1, 1));
    assert_eq!(all.bottom, meshes.bottom + quadrics.bottom);
    assert_eq!(all.instances, meshes.instances + quadrics.instances);
    assert!(meshes.bytes_built > 0 && meshes.bytes_compacted <= meshes.bytes_built);
    // Records for the hit groups that there are.
    assert!(nothing.bytes_table < quadrics.bytes_table && quadrics.bytes_table < all.bytes_table);
}

/// Boxes of a list's halves, of their halves and so on, that overlap along every axis: those are bad nodes for a driver that
/// halves lists.
fn entangled(places: &[DVec3]) -> usize {
    if places.len() < 3 {
        return 0;
    }
    let (first, second) = places.split_at(places.len().div_ceil(2));
    let lower = |half: &[DVec3]| half.iter().fold(DVec3::INFINITY, |a, b| a.min(*b));
    let upper = |half: &[DVec3]| half.iter().fold(DVec3::NEG_INFINITY, |a, b| a.max(*b));
    // Places are compared in f32.
    let apart = (upper(first) - lower(second)).min_element() < 1e-6;
    usize::from(!apart) + entangled(first) + entangled(second)
}

/// Triangles and quadrics come in lists whose halves are apart: triangles where the mesh is at home, since objects that show
/// the same mesh share structures.
#[test]
fn rt_lists_fall_into_halves() {
    let mesh = sphere(40, 60);
    let centre = |corners: [DVec3; 3]| corners.iter().sum::<DVec3>();
    let as_made: Vec<_> =
        mesh.triangles.iter().map(|(c, _)| centre(c.map(|i| mesh.vertices[i as usize].position))).collect();
    assert!(entangled(&as_made) > 50, "the test sees nothing: {}", entangled(&as_made));
    let mut scene = crowd("torus", mesh, 1, 0.3);
    scene.objects.extend(rich_scene("torus").objects.into_iter().filter(|o| !matches!(o.shape, Shape::Mesh(_))));
    let Place::World(frame) = scene.objects[0].place else { unreachable!("crowds stand in the world") };
    let home = DMat3::from_cols_array_2d(&frame.axes.map(|axis| axis.truncate().to_array())).transpose();
    let world = world(&scene);
    let mut triangles = 0;
    for part in world.still.copies.iter().flat_map(|copy| &copy.parts) {
        let places: Vec<_> = part.triangles.clone().map(|index| home * centre(world.still.triangles[index])).collect();
        triangles += places.len();
        assert_eq!(entangled(&places), 0, "of {} triangles", places.len());
    }
    assert!(triangles >= 4800 && triangles % 4800 == 0, "{triangles}");
    let quadrics: Vec<_> = world.quadrics.iter().map(|q| q.bounds.centre()).collect();
    assert!(quadrics.len() > 2);
    assert_eq!(entangled(&quadrics), 0, "of {} quadrics", quadrics.len());
}

/// What rests in the torus is inside of guards, which most segments pass by; none are asked on hardware, or where edges are all
/// around; what moves has none.
#[test]
fn rt_guards_hold_what_rests() {
    let guards = |name: &str, software: bool| {
        let world = world(&file::load(name).expect("shipped scenes load"));
        let guards = Guards::new(software, &world);
        (guards.specialize(Specialization::default()), guards.boxes(), world)
    };
    let (constants, boxes, world) = guards("torus", true);
    assert_eq!(constants.guarded, KIND_ALL);
    let (about_meshes, rest) = boxes.split_at(constants.mesh_guards as usize);
    let about_quadrics = &rest[..constants.quadric_guards as usize];
    let holds = |guards: &[Box], lower: DVec3, upper: DVec3| {
        let within = |guard: &Box| {
            DVec3::from(guard.lower.map(f64::from)).cmplt(lower).all()
                && upper.cmplt(DVec3::from(guard.upper.map(f64::from))).all()
        };
        guards.iter().any(within)
    };
    assert!(
        world.quadrics.len() > 3
            && world.quadrics.iter().all(|q| holds(about_quadrics, q.bounds.lower, q.bounds.upper))
    );
    let triangles: Vec<_> =
        world.still.inside(&world.domain, 0).into_iter().map(|index| world.still.triangles[index as usize]).collect();
    assert!(triangles.len() > 100, "{} triangles", triangles.len());
    for [a, b, c] in triangles {
        assert!(holds(about_meshes, a.min(b).min(c), a.max(b).max(c)), "a triangle at {a}");
    }
    assert_eq!(guards("torus", false).0, Specialization::default());
    assert_eq!(guards("seifert-weber", true).0.guarded & KIND_QUADRICS, 0);
    let mut moving = file::load("torus").expect("shipped scenes load");
    moving.objects[0].motion = Some(Motion { velocity: DVec3::X, turn: DVec3::ZERO });
    let plan = Plan::new(&moving, false);
    let pose = Pose::new(moving.observer.frame, 0.0);
    let moving = World::moving(&moving, &plan, pose).expect("a world");
    let guards = Guards::new(true, &moving);
    assert_eq!(guards.specialize(Specialization::default()).guarded & KIND_MOVING, 0);
    assert!(guards.held(&moving).is_empty(), "what moves may be anywhere");
}

/// A segment that comes near one guard alone is traced among what this one holds: all that is in it, and everything that
/// segments can meet is in one. Triangles only where they are few.
#[test]
fn rt_guards_hold_what_is_in_them() {
    for (name, few) in [("bench-torus", true), ("knot", false)] {
        let world = world(&file::load(name).expect("shipped scenes load"));
        let guards = Guards::new(true, &world);
        let held = guards.held(&world);
        let boxes = &guards.boxes()[..held.len()];
        let number = |kind| held.iter().filter(|held| held.kind == kind).count() as u32;
        let constants = guards.specialize(Specialization::default());
        assert_eq!([number(KIND_MESHES), number(KIND_QUADRICS)], [constants.mesh_guards, constants.quadric_guards]);
        assert!(constants.mesh_guards > 0 && constants.quadric_guards > 1, "{name}: {constants:?}");
        let around = |points: &[DVec3]| {
            let lower = points.iter().copied().fold(DVec3::INFINITY, DVec3::min);
            (lower, points.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max))
        };
        let triangles: Vec<_> = world.still.triangles.iter().map(|triangle| around(triangle)).collect();
        let quadrics: Vec<_> = world.quadrics.iter().map(|q| (q.bounds.lower, q.bounds.upper)).collect();
        let corner = |corner: [f32; 3]| DVec3::from(corner.map(f64::from));
        for (guard, held) in boxes.iter().zip(&held) {
            let about = if held.kind == KIND_MESHES { &triangles } else { &quadrics };
            let inside = |&(lower, upper): &(DVec3, DVec3)| {
                corner(guard.lower).cmple(lower).all() && upper.cmple(corner(guard.upper)).all()
            };
            let all = about.iter().zip(0_u32..).filter(|(about, _)| inside(about)).map(|(_, index)| index);
            let all: Vec<u32> = if few || held.kind == KIND_QUADRICS { all.collect() } else { Vec::new() };
            assert_eq!(held.indices, all, "{name}");
        }
        let somewhere = |kind: u32, index: u32| held.iter().any(|h| h.kind == kind && h.indices.contains(&index));
        assert!((0..world.quadrics.len() as u32).all(|index| somewhere(KIND_QUADRICS, index)), "{name}");
        let inside = world.still.inside(&world.domain, 0);
        assert!(inside.len() > 1000 && (!few || inside.iter().all(|&index| somewhere(KIND_MESHES, index))), "{name}");
        assert!(Guards::new(false, &world).held(&world).is_empty(), "hardware has no guards");
    }
}

/// A sphere with so many rows and columns of quadrilaterals.
fn sphere(rows: u32, columns: u32) -> Mesh {
    let mut vertices = Vec::new();
    for row in 0..=rows {
        let polar = std::f64::consts::PI * f64::from(row) / f64::from(rows);
        for column in 0..=columns {
            let azimuth = std::f64::consts::TAU * f64::from(column) / f64::from(columns);
            let normal = DVec3::new(polar.sin() * azimuth.cos(), polar.cos(), polar.sin() * azimuth.sin());
            vertices.push(Vertex { position: normal, normal, uv: [0.0; 2] });
        }
    }
    let mut triangles = Vec::new();
    for row in 0..rows {
        for column in 0..columns {
            let corner = |r: u32, c: u32| (row + r) * (columns + 1) + column + c;
            triangles.push(([corner(0, 0), corner(0, 1), corner(1, 1)], 0));
            triangles.push(([corner(0, 0), corner(1, 1), corner(1, 0)], 0));
        }
    }
    Mesh { name: "sphere".to_owned(), vertices, triangles }
}

/// So many copies of a mesh in random places and turns.
fn crowd(space: &str, mesh: Mesh, count: usize, scale: f64) -> Scene {
    struct At(DVec3, DMat3);
    impl Visitor for At {
        type Output = Frame;
        fn visit<G: Geometry>(self, geometry: G) -> Frame {
            let base = geometry.base();
            let frame = Frame { cell: 0, point: base, axes: geometry.frame(base) };
            frame.moved(geometry, self.0).rotated(self.1)
        }
    }
    let mut scene = rich_scene(space);
    let mut random = Random(5);
    scene.meshes = vec![mesh];
    scene.objects = (0..count)
        .map(|index| {
            let mut vector = || DVec3::from_array([(); 3].map(|()| random.within(-1.0, 1.0)));
            let (at, axis) = (0.42 * vector(), vector().normalize());
            let place = Place::World(visit(scene.space.geometry, At(at, DMat3::from_axis_angle(axis, 2.0))));
            Object {
                name: format!("copy {index}"),
                shape: Shape::Mesh(0),
                place,
                scale,
                material: Some(0),
                motion: None,
            }
        })
        .collect();
    scene
}

/// In Euclidean space two hundred objects with a mesh of 5,000 triangles share one structure.
#[test]
fn rt_a_million_triangles_in_two_hundred_instances() {
    let Some(gpu) = rt_gpu() else { return };
    let mesh = sphere(50, 50);
    assert_eq!(mesh.triangles.len(), 5000);
    let one = crowd("torus", mesh.clone(), 1, 0.01);
    let scene = crowd("torus", mesh, 200, 0.02);
    let world = world(&scene);
    assert!(world.still.triangles.len() >= 1_000_000);
    let mut backend = RtBackend::new(&gpu).expect("a backend");
    backend.load(&world).expect("a load");
    let shot = picture(&scene, [128, 96]);
    let (target, stats) = draw(&mut backend, &shot);
    let all = structures(&stats);
    assert!(all.instances >= 200 && all.bottom == 1, "{all:?}");
    println!(
        "{} triangles, {} instances: {} bytes before compaction, {} after; top level {}",
        world.still.triangles.len(),
        all.instances,
        all.bytes_built,
        all.bytes_compacted,
        all.bytes_top
    );
    backend.load(&self::world(&one)).expect("a load");
    let single = structures(&draw(&mut backend, &shot).1);
    assert_eq!((single.bytes_built, single.bottom), (all.bytes_built, 1));
    // The same picture as of the compute backend on the same device, whose hierarchy knows no instances.
    let mut compute = ComputeBackend::new(&gpu).expect("a backend");
    compute.load(&world).expect("a load");
    let share = differing(&target, &draw(&mut compute, &shot).0, 2e-3);
    assert!(share < 2e-3, "{share}");
    assert!(target.pixels.iter().any(|p| p[..3] != target.pixels[0][..3]));
}

/// A crowd of several sizes in a space whose faces turn what passes them: some alike, some so much smaller that f32 would not
/// have the same places about as exactly.
fn crowd_of_sizes() -> Scene {
    let mut scene = crowd("half-turn", sphere(20, 20), 18, 0.05);
    for (object, size) in scene.objects.iter_mut().zip([1.0, 1.7, 0.15].into_iter().cycle()) {
        object.scale *= size;
    }
    scene
}

/// The map of an image takes each triangle of the copy that it is of to its own.
#[test]
fn rt_images_have_the_triangles_of_their_copies() {
    let world = world(&crowd_of_sizes());
    let copies = &world.still.copies;
    let triangles = |index: usize| {
        let parts = copies[index].parts.iter().flat_map(|part| &world.still.triangles[part.triangles.clone()]);
        parts.flatten().copied().collect::<Vec<DVec3>>()
    };
    let mut images = 0;
    for (index, copy) in copies.iter().enumerate() {
        let Some((first, map)) = copy.image_of else { continue };
        images += 1;
        let (from, to) = (triangles(first), triangles(index));
        assert_eq!(from.len(), to.len());
        let off = from.iter().zip(&to).map(|(from, to)| map.transform_point3(*from).distance(*to));
        let off = off.fold(0.0_f64, f64::max);
        assert!(off < 1e-13, "copy {index}: {off}");
    }
    assert_eq!(images, copies.len() - 2, "all but the first of each size are images");
}

/// In Euclidean space objects of other sizes are images of the same structure.
#[test]
fn rt_copies_of_several_sizes_share_a_structure() {
    let Some(gpu) = rt_gpu() else { return };
    let mut scene = crowd_of_sizes();
    for shading in [Shading::Riemannian, Shading::Object, Shading::Normals] {
        scene.settings.shading = shading;
        let (world, shot) = (world(&scene), picture(&scene, [128, 96]));
        let (mut rt, mut cpu) = (RtBackend::new(&gpu).expect("a backend"), CpuBackend::default());
        rt.load(&world).expect("a load");
        cpu.load(&world).expect("a load");
        let (target, stats) = draw(&mut rt, &shot);
        let all = structures(&stats);
        assert!(all.bottom == 2 && all.instances >= 18, "{all:?}");
        let share = differing(&target, &draw(&mut cpu, &shot).0, 2e-3);
        assert!(share < 2e-3, "{shading:?}: {share}");
    }
}

/// Software traverses few triangles faster if they are one structure, whatever they are images of; and the picture is right.
#[test]
fn rt_few_triangles_are_one_structure_on_software() {
    let Some(gpu) = rt_gpu() else { return };
    let scene = crowd("half-turn", sphere(10, 10), 9, 0.05);
    let (world, shot) = (world(&scene), picture(&scene, [128, 96]));
    let images = world.still.copies.iter().filter(|copy| copy.image_of.is_some()).count();
    assert!(images >= 8, "{images}");
    let (mut rt, mut cpu) = (RtBackend::new(&gpu).expect("a backend"), CpuBackend::default());
    rt.load(&world).expect("a load");
    cpu.load(&world).expect("a load");
    let (target, stats) = draw(&mut rt, &shot);
    let all = structures(&stats);
    let instances = if gpu.info().is_software() { 1 } else { images as u64 + 1 };
    assert_eq!((all.bottom, all.instances), (1, instances));
    let share = differing(&target, &draw(&mut cpu, &shot).0, 2e-3);
    assert!(share < 2e-3, "{share}");
}

/// Where isometries are no affine maps of the chart, copies are no instances: all of a cell are one structure, and the picture
/// is right.
#[test]
fn rt_copies_in_curved_space_are_one_structure() {
    let Some(gpu) = rt_gpu() else { return };
    for space in ["poincare", "seifert-weber"] {
        let scene = crowd(space, sphere(10, 10), 6, 0.06);
        let world = world(&scene);
        let shot = picture(&scene, [96, 64]);
        let (mut rt, mut cpu) = (RtBackend::new(&gpu).expect("a backend"), CpuBackend::default());
        rt.load(&world).expect("a load");
        cpu.load(&world).expect("a load");
        let (target, stats) = draw(&mut rt, &shot);
        assert!(world.still.copies.len() >= 6);
        assert_eq!((structures(&stats).bottom, structures(&stats).instances), (1, 1));
        let share = differing(&target, &draw(&mut cpu, &shot).0, 2e-3);
        assert!(share < 0.01, "{space}: {share}");
    }
}

// --- moving --------------------------------------------------------------------------------------------------

/// A scene in which a mesh and a ball move through the faces, and another mesh stays.
fn moving_scene(space: &str) -> Scene {
    let mut scene = crowd(space, sphere(12, 12), 2, 0.08);
    let motion = Motion { velocity: DVec3::new(0.31, 0.17, -0.23), turn: DVec3::new(0.9, 0.4, -0.2) };
    scene.objects[0].motion = Some(motion);
    scene.objects[0].name = "walker".to_owned();
    let ball = Object { shape: Shape::Ball { radius: 0.05 }, name: "ball".to_owned(), ..scene.objects[1].clone() };
    scene.objects.push(Object { motion: Some(Motion { velocity: -motion.velocity, ..motion }), ..ball });
    scene.settings.bounces = 3;
    scene
}

fn pose(scene: &Scene, frame: u32) -> Pose {
    Pose::new(scene.observer.frame, f64::from(frame) / 30.0)
}

/// Three hundred frames: refits, no builds of meshes but for copies that appear for the first time, no growth of memory
/// and the same pictures as from worlds that are made from nothing, on all backends.
#[test]
fn rt_moving_objects_are_refitted() {
    let Some(gpu) = rt_gpu() else { return };
    for (space, frames) in [("torus", 300), ("poincare", 60), ("seifert-weber", 60)] {
        let scene = moving_scene(space);
        let plan = Plan::new(&scene, false);
        let shot = picture(&scene, [48, 32]);
        let mut backend = RtBackend::new(&gpu).expect("a backend");
        let mut world = Arc::new(World::moving(&scene, &plan, pose(&scene, 0)).expect("a world"));
        backend.load(&world).expect("a load");
        let mut compute = ComputeBackend::new(&gpu).expect("a backend");
        let mut after_round = None;
        let mut pictures = Vec::new();
        for frame in 1..=frames {
            let next = Arc::new(world.posed(&scene, pose(&scene, frame)).expect("a pose"));
            // Nothing is placed anew by the host: neither what rests nor the mesh that moves.
            assert!(Arc::ptr_eq(&next.still, &world.still));
            assert!(Arc::ptr_eq(&next.movers[0].rest, &world.movers[0].rest));
            world = next;
            backend.pose(&world).expect("a pose");
            let (target, stats) = draw(&mut backend, &shot);
            let now = (structures(&stats), stats.memory);
            if frame == frames / 3 {
                after_round = Some(now);
            }
            if frame % 20 == 0 {
                let fresh = World::moving(&scene, &plan, pose(&scene, frame)).expect("a world");
                let mut cpu = CpuBackend::default();
                cpu.load(&Arc::new(fresh)).expect("a load");
                let share = differing(&target, &draw(&mut cpu, &shot).0, 4e-3);
                assert!(share < 0.02, "{space}, frame {frame}: {share}");
                compute.pose(&world).expect("a pose");
                let share = differing(&target, &draw(&mut compute, &shot).0, 4e-3);
                assert!(share < 0.02, "{space}, frame {frame}: compute {share}");
                pictures.push(target);
            }
        }
        assert!(pictures.windows(2).all(|pair| differing(&pair[0], &pair[1], 0.02) > 0.001), "{space}: nothing moves");
        let (_, stats) = draw(&mut backend, &shot);
        let (last, memory) = (structures(&stats), stats.memory);
        let (third, memory_then) = after_round.expect("a third");
        println!("{space}: {frames} frames, {} refits, {} builds", last.refits, last.builds);
        assert!(last.refits >= u64::from(frames), "{last:?}");
        // The ball's few boxes are built anew with each frame; of meshes, only slots that are used for the first time.
        let builds = last.builds - third.builds;
        assert!(builds <= u64::from(frames) * 2, "{builds} builds in {frames} frames");
        // Memory grows by the structures of such slots and by nothing else; once around the torus all have been used.
        let (rest, rest_then) = (memory - last.bytes_moving, memory_then - third.bytes_moving);
        assert!(rest <= rest_then + 8192, "{space}: {rest_then} bytes, then {rest}");
        assert!(frames < 300 || last.bytes_moving <= third.bytes_moving + 8192, "{third:?}, then {last:?}");
    }
}

/// A scene without motion keeps everything from pose to pose.
#[test]
fn rt_pose_of_a_still_scene_builds_nothing() {
    let Some(gpu) = rt_gpu() else { return };
    let scene = rich_scene("torus");
    let plan = Plan::new(&scene, false);
    let mut backend = RtBackend::new(&gpu).expect("a backend");
    let mut world = Arc::new(World::moving(&scene, &plan, pose(&scene, 0)).expect("a world"));
    backend.load(&world).expect("a load");
    let before = structures(&draw(&mut backend, &picture(&scene, [16, 16])).1);
    for frame in 1..5 {
        world = Arc::new(world.posed(&scene, pose(&scene, frame)).expect("a pose"));
        backend.pose(&world).expect("a pose");
    }
    let after = structures(&draw(&mut backend, &picture(&scene, [16, 16])).1);
    assert_eq!((after.builds, after.bytes_top), (before.builds, before.bytes_top));
}

// --- the pipeline cache --------------------------------------------------------------------------------------

/// The only file in a folder.
fn only_file(folder: &std::path::Path) -> PathBuf {
    let files: Vec<PathBuf> = fs::read_dir(folder).expect("a folder").map(|e| e.expect("an entry").path()).collect();
    assert_eq!(files.len(), 1, "{files:?}");
    files[0].clone()
}

#[test]
fn cache_is_used_and_damaged_files_are_not() {
    let Some((_turn, options)) = gpu_turn() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let options = ContextOptions { cache_folder: Some(folder.path().join("a/b")), ..options };
    let open = || Context::new(&options).expect("a context");
    let use_it = |context: &Arc<Context>| {
        let mut backend = ComputeBackend::new(context).expect("a backend");
        backend.load(&world(&rich_scene("torus"))).expect("a load");
        draw(&mut backend, &shot([8, 8], 1));
        assert_eq!(backend.keep(), None);
    };
    let context = open();
    assert_eq!(*context.cache_found(), Found::Absent);
    use_it(&context);
    drop(context);
    let file = only_file(&folder.path().join("a/b"));
    let good = fs::read(&file).expect("a file");
    let context = open();
    assert_eq!(*context.cache_found(), Found::Used);
    use_it(&context);
    drop(context);
    let flipped = |at: usize| {
        let mut bytes = good.clone();
        bytes[at] ^= 0x10;
        bytes
    };
    let cases: [(&str, Vec<u8>); 8] = [
        ("the file is cut off", Vec::new()),
        ("the file is cut off", good[..20].to_vec()),
        ("the file is cut off", good[..good.len() - 1].to_vec()),
        ("the file is no pipeline cache of this version", flipped(7)),
        ("the file belongs to another driver", flipped(12)),
        ("the file belongs to another driver", flipped(30)),
        ("the file is damaged", flipped(good.len() - 1)),
        ("the file is no pipeline cache of this version", vec![0xff; 4096]),
    ];
    for (why, bytes) in cases {
        fs::write(&file, bytes).expect("a file");
        let context = open();
        assert_eq!(*context.cache_found(), Found::Ignored(why.to_owned()));
        use_it(&context);
        drop(context);
        assert_eq!(fs::read(&file).expect("a file").len(), good.len(), "{why}: the file was not replaced");
        assert_eq!(*open().cache_found(), Found::Used);
    }
    // A driver that refuses its own data.
    let faults = FaultInjection::default();
    let refused = ContextOptions { faults: faults.clone(), ..options.clone() };
    faults.fail("vkCreatePipelineCache", 0, vk::Result::ERROR_UNKNOWN);
    let context = Context::new(&refused).expect("a context");
    assert!(matches!(context.cache_found(), Found::Ignored(why) if why.contains("vkCreatePipelineCache")));
    drop(context);
    assert_eq!(options.messages.take(), [""; 0]);
}

/// No place for the file is a warning that names it, and the picture is drawn.
#[test]
fn cache_that_cannot_be_written_is_a_warning() {
    let Some((_turn, options)) = gpu_turn() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let blocked = folder.path().join("file");
    fs::write(&blocked, "in the way").expect("a file");
    let mut places = vec![blocked.join("cache")];
    if cfg!(target_os = "linux") {
        // A file system without room for a single byte.
        places.push(PathBuf::from("/proc/cache"));
    }
    for place in places {
        let options = ContextOptions { cache_folder: Some(place.clone()), ..options.clone() };
        let context = Context::new(&options).expect("a context");
        let mut backend = ComputeBackend::new(&context).expect("a backend");
        backend.load(&world(&rich_scene("torus"))).expect("a load");
        draw(&mut backend, &shot([8, 8], 1));
        let warning = backend.keep().expect("a warning");
        assert!(warning.starts_with(&format!("pipeline cache {}", place.display())), "{warning}");
    }
    assert_eq!(options.messages.take(), [""; 0]);
}

// --- faults --------------------------------------------------------------------------------------------------

/// Everything that a program does with the backend: open the device, load, draw, move, draw, close.
fn life(options: &ContextOptions, scene: &Scene) -> Result<(), RenderError> {
    let result = Context::new(options).map_err(RenderError::from).and_then(|context| {
        let result = (|| {
            let plan = Plan::new(scene, false);
            let mut backend = RtBackend::new(&context)?;
            let world = Arc::new(World::moving(scene, &plan, pose(scene, 0)).expect("a world"));
            backend.load(&world)?;
            let mut target = Target::new([1, 1]);
            backend.render(&picture(scene, [16, 8]), &mut target, &|_| ())?;
            let world = Arc::new(world.posed(scene, pose(scene, 9)).expect("a pose"));
            backend.pose(&world)?;
            backend.render(&picture(scene, [16, 8]), &mut target, &|_| ())?;
            Ok(())
        })();
        // Whatever has happened, nothing is left.
        assert!(context.is_hung() || context.memory_in_use() == 0, "{} bytes left", context.memory_in_use());
        assert_eq!(Arc::strong_count(&context), 1);
        result
    });
    // The layer reports objects that are left when their device or instance goes, and objects that go too early.
    assert_eq!(options.messages.take(), [""; 0], "{result:?}");
    result
}

/// Makes each call of a life fail, one after the other: every allocation among them, every submission, and the device
/// lost in each wait.
#[test]
fn rt_faults_end_in_errors_that_name_the_call() {
    let Some((_turn, options)) = rt_turn() else { return };
    let scene = moving_scene("torus");
    let faults = FaultInjection::default();
    let options = ContextOptions { faults: faults.clone(), ..options };
    faults.record();
    life(&options, &scene).expect("a life without faults");
    let calls = faults.calls();
    for wanted in [
        "vkAllocateMemory",
        "vkQueueSubmit",
        "vkWaitForFences",
        "vkCreateAccelerationStructureKHR",
        "vkCreateRayTracingPipelinesKHR",
        "vkGetRayTracingShaderGroupHandlesKHR",
        "vkCreateDevice",
    ] {
        assert!(calls.contains(&wanted), "{wanted}");
    }
    for (index, call) in calls.iter().enumerate() {
        let result = match *call {
            "vkQueueSubmit" | "vkWaitForFences" => vk::Result::ERROR_DEVICE_LOST,
            _ if index % 2 == 0 => vk::Result::ERROR_OUT_OF_DEVICE_MEMORY,
            _ => vk::Result::ERROR_OUT_OF_HOST_MEMORY,
        };
        faults.fail("", index, result);
        let error = life(&options, &scene).expect_err(call).to_string();
        assert!(error.starts_with(call) && error.contains(&format!("{result:?}")), "{call}: {error}");
    }
    println!("{} calls failed, one after the other", calls.len());
}

/// A device that disappears between two frames: the next frame says so, and so do later ones; a new device works.
#[test]
fn rt_device_lost_between_two_frames() {
    let Some((_turn, options)) = rt_turn() else { return };
    let scene = moving_scene("torus");
    let faults = FaultInjection::default();
    let options = ContextOptions { faults: faults.clone(), ..options };
    let context = Context::new(&options).expect("a context");
    let mut backend = RtBackend::new(&context).expect("a backend");
    backend.load(&world(&scene)).expect("a load");
    let shot = picture(&scene, [16, 8]);
    let (first, _) = draw(&mut backend, &shot);
    for _ in 0..2 {
        faults.fail("vkQueueSubmit", 0, vk::Result::ERROR_DEVICE_LOST);
        let mut target = Target::new([1, 1]);
        let error = backend.render(&shot, &mut target, &|_| ()).expect_err("a lost device").to_string();
        assert!(error.contains("DEVICE_LOST"), "{error}");
    }
    drop(backend);
    drop(context);
    let context = Context::new(&options).expect("a context");
    let mut backend = RtBackend::new(&context).expect("a backend");
    backend.load(&world(&scene)).expect("a load");
    assert_eq!(draw(&mut backend, &shot).0, first);
    drop(backend);
    drop(context);
    assert_eq!(options.messages.take(), [""; 0]);
}

/// A device without ray tracing says what it lacks, and one that was opened without it is refused.
#[test]
fn rt_devices_without_it_are_refused() {
    let Some((_turn, options)) = gpu_turn() else { return };
    let context = Context::new(&options).expect("a context");
    let mut backend = RtBackend::new(&context).expect("a backend");
    let error = backend.load(&world(&rich_scene("torus"))).expect_err("no ray tracing").to_string();
    assert!(error.contains(" lacks ") || error.contains("recursion"), "{error}");
    if !context.info().can(Tier::Rt) {
        let plan = Plan::new(&rich_scene("torus"), false);
        let missing = backend.check(&plan).expect_err("something is missing").to_string();
        assert!(missing.contains("VK_KHR_ray_tracing_pipeline"), "{missing}");
        let error = Context::new(&ContextOptions { tier: Tier::Rt, ..options }).expect_err("lacking").to_string();
        assert!(error.contains(" lacks ") && error.contains("VK_KHR_acceleration_structure"), "{error}");
    }
}

/// The automatic choice goes on to the next backend where the device cannot be opened for the best one.
#[test]
fn rt_automatic_choice_falls_back() {
    let Some((_turn, options)) = rt_turn() else { return };
    let plan = Plan::new(&rich_scene("torus"), false);
    let faults = FaultInjection::default();
    let options = ContextOptions { faults: faults.clone(), tier: Tier::Compute, ..options };
    let chosen = auto::choose_with(&options, &plan).expect("a choice");
    assert_eq!(chosen.backend.name(), "rt", "{}", chosen.reason);
    drop(chosen);
    faults.fail("vkCreateDevice", 0, vk::Result::ERROR_FEATURE_NOT_PRESENT);
    let chosen = auto::choose_with(&options, &plan).expect("a choice");
    assert_eq!(chosen.backend.name(), "compute", "{}", chosen.reason);
    assert!(chosen.reason.contains("vkCreateDevice for the device: ERROR_FEATURE_NOT_PRESENT"), "{}", chosen.reason);
    drop(chosen);
    faults.fail("vkCreateDevice", 0, vk::Result::ERROR_OUT_OF_DEVICE_MEMORY);
    faults.fail("vkCreateDevice", 1, vk::Result::ERROR_OUT_OF_DEVICE_MEMORY);
    let chosen = auto::choose_with(&options, &plan).expect("a choice");
    assert_eq!(chosen.backend.name(), "cpu", "{}", chosen.reason);
    assert_eq!(options.messages.take(), [""; 0]);
}

/// Shipped scenes load on the backend with every feature kept in that they do not need.
#[test]
fn rt_takes_features_that_a_scene_does_not_need() {
    let Some(gpu) = rt_gpu() else { return };
    let scene = file::load("torus").expect("a shipped scene");
    let shot = picture(&scene, [32, 24]);
    let mut backend = RtBackend::new(&gpu).expect("a backend");
    backend.load(&world(&scene)).expect("a load");
    let plain = draw(&mut backend, &shot).0;
    let all: Vec<_> = holonomy::render::plan::Feature::NAMES.iter().map(|(_, feature)| *feature).collect();
    let plan = Plan::new(&scene, false).keep(&all);
    let kept = World::new(&scene, &plan, scene.observer.frame).expect("a world");
    backend.load(&Arc::new(kept)).expect("a load");
    assert!(differing(&plain, &draw(&mut backend, &shot).0, 1e-4) < 2e-3);
}
