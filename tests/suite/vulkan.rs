//! The Vulkan wrappers, the probe and the compute backend: results, limits, faults, and that validation is silent
//! where it should be and only there.

use crate::support::{Random, gpu, gpu_turn, skip};
use ash::vk;
use glam::{DMat4, DVec3, DVec4, Vec4};
use holonomy::{
    geometry::{GEOMETRIES, Geodesic, Geometry, GeometryId, Isometry, Visitor, exponential, visit},
    render::{
        Backend, RenderError, Shot, Target,
        compute::{ComputeBackend, ComputeOptions, probe::Probe, walks_together},
        cpu::CpuBackend,
        device::tiles::{Bands, Pace, Tiles},
        plan::Plan,
        world::World,
    },
    scene::{
        Material, Mesh, Object, Observer, Place, PointLight, Scene, Settings, Shading, Shape, Spot, Texture, Vertex,
        Wrap,
    },
    shader_io::{self as io, ProbeIn, ProbeOut},
    space::observer::Frame,
    vulkan::{
        Context, ContextOptions, DeviceKind, Validation, VulkanError, command::SUBMIT_TIME_OUT, fault::FaultInjection,
    },
};
use std::{
    sync::{Arc, Mutex},
    time::Duration,
};

fn single(v: DVec4) -> [f32; 4] {
    v.as_vec4().to_array()
}

fn double(v: [f32; 4]) -> DVec4 {
    Vec4::from_array(v).as_dvec4()
}

// --- the probe -----------------------------------------------------------------------------------------

/// Random states of a geometry, a random length up to `longest` for each, and the awkward ones.
struct Flows {
    longest: f64,
    awkward: Vec<f64>,
}

impl Visitor for Flows {
    type Output = Vec<ProbeIn>;

    fn visit<G: Geometry>(self, geometry: G) -> Vec<ProbeIn> {
        let mut random = Random(7);
        (0..300)
            .map(|n| {
                let mut vector = || DVec3::from_array([(); 3].map(|()| random.within(-1.0, 1.0)));
                let (place, direction) = (vector(), vector().normalize());
                let base = geometry.base();
                let frame = geometry.frame(base);
                let at = |v: DVec3, f: [DVec4; 3]| f[0] * v.x + f[1] * v.y + f[2] * v.z;
                let point = exponential(geometry, base, at(place, frame));
                let velocity = at(direction, geometry.frame(point));
                let length = self.awkward.get(n).copied().unwrap_or_else(|| random.within(-1.0, 1.0) * self.longest);
                let (a, b) = (single(point), single(velocity));
                ProbeIn { a, b, c: [0.0; 4], t: length as f32, op: io::PROBE_FLOW }
            })
            .collect()
    }
}

/// The same in f64, and how far f32 may be off, in roundings of the largest number on the way. Where the length is
/// shared out between directions it is rounded itself, which counts with what it does to the end.
struct Twin<'a> {
    inputs: &'a [ProbeIn],
    shared_out: bool,
}

impl Visitor for Twin<'_> {
    type Output = Vec<(Geodesic, f64)>;

    fn visit<G: Geometry>(self, geometry: G) -> Self::Output {
        let flow = |q: &ProbeIn| {
            let start = Geodesic { point: double(q.a), velocity: double(q.b) };
            let t = f64::from(q.t);
            let (end, back) = (geometry.flow(start, t), geometry.flow(start, -t));
            const ROUNDING: f64 = 1e-8;
            let longer = geometry.flow(start, t * (1.0 + if self.shared_out { ROUNDING } else { 0.0 }));
            let moved = [longer.point - end.point, longer.velocity - end.velocity].map(|v| v / ROUNDING);
            let numbers = [end.point, end.velocity, back.point, back.velocity, moved[0], moved[1]];
            (end, numbers.into_iter().map(|v| v.abs().max_element()).fold(1.0, f64::max))
        };
        self.inputs.iter().map(flow).collect()
    }
}

/// Largest error of the results in units of f32 roundings of the flow's own size.
fn worst_error(inputs: &[ProbeIn], results: &[ProbeOut], geometry: GeometryId) -> f64 {
    assert_eq!(inputs.len(), results.len());
    let error = |(result, (end, size)): (&ProbeOut, (Geodesic, f64))| {
        let difference = (double(result.a) - end.point).abs().max(double(result.b) - end.velocity).abs();
        assert!(difference.is_finite(), "{result:?} instead of {end:?}");
        difference.max_element() / (size * f64::from(f32::EPSILON))
    };
    let shared_out = !matches!(geometry, GeometryId::E3 | GeometryId::S3 | GeometryId::H3);
    results.iter().zip(visit(geometry, Twin { inputs, shared_out })).map(error).fold(0.0, f64::max)
}

/// Measured on lavapipe: 0.7 (e3), 1.0 (s3), 1.1 (h3), 1.1 (s2xr), 1.5 (h2xr), 2.0 (nil) roundings; the rest is for drivers that order sums otherwise.
const FLOW_ROUNDINGS: f64 = 3.0;

#[test]
fn probe_flow_agrees_with_its_twin() {
    let Some(gpu) = gpu() else { return };
    for entry in GEOMETRIES {
        let (longest, awkward) = match entry.id {
            GeometryId::S3 => (10.0, vec![0.0, -0.0, -1.0, 1e-30, 1e-6, std::f64::consts::PI, 1000.0, -1000.0]),
            GeometryId::H3 | GeometryId::H2xR => (10.0, vec![0.0, -0.0, -1.0, 1e-30, 1e-6, 1.0, 50.0, -50.0]),
            // Here the rounding of the inputs alone grows with the length.
            GeometryId::Sol | GeometryId::Sl2 => (2.0, vec![0.0, -0.0, -1.0, 1e-30, 1e-6, 2.0]),
            // So far the chart goes in all directions.
            GeometryId::Sl2Trace => (0.5, vec![0.0, -0.0, -0.5, 1e-30, 1e-6]),
            _ => (10.0, vec![0.0, -0.0, -1.0, 1e-30, 1e-6, 1e6]),
        };
        let inputs = visit(entry.id, Flows { longest, awkward });
        let results = Probe::new(&gpu, entry.id).expect("a probe").run(&inputs).expect("results");
        let worst = worst_error(&inputs, &results, entry.id);
        println!("{}: {worst:.2} roundings", entry.name);
        assert!(worst < FLOW_ROUNDINGS, "{}: {worst} roundings", entry.name);
        // The comparison notices a result that is off by little.
        let mut spoilt = results;
        spoilt[0].b[1] += 1e-6;
        assert!(worst_error(&inputs, &spoilt, entry.id) > FLOW_ROUNDINGS, "{}", entry.name);
    }
}

#[test]
fn probe_takes_batches_of_any_size() {
    let Some(gpu) = gpu() else { return };
    let mut probe = Probe::new(&gpu, GeometryId::E3).expect("a probe");
    for count in [0, 1, 63, 64, 65, 300, 1, 65_536 + 5] {
        let input = |i: usize| ProbeIn { a: [i as f32, 0.0, 0.0, 1.0], op: io::PROBE_CHART, ..ProbeIn::default() };
        let results = probe.run(&(0..count).map(input).collect::<Vec<_>>()).expect("results");
        assert_eq!(results.len(), count);
        assert!(results.iter().enumerate().all(|(i, r)| r.a == [i as f32, 0.0, 0.0, 0.0]), "{count}");
    }
}

#[test]
fn probe_applies_an_isometry() {
    let Some(gpu) = gpu() else { return };
    let motion = DMat4::from_rotation_z(0.3) * DMat4::from_translation(DVec3::new(1.0, -2.0, 0.5));
    let mut probe = Probe::new(&gpu, GeometryId::E3).expect("a probe");
    let (a, b) = (DVec4::new(0.25, 0.5, -1.0, 1.0), DVec4::X);
    let input = ProbeIn { a: single(a), b: single(b), op: io::PROBE_APPLY, ..ProbeIn::default() };
    let same = probe.run(&[input]).expect("results")[0];
    assert_eq!((same.a, same.b), (input.a, input.b));
    let mut probe = probe.with_isometry(&Isometry::linear(motion)).expect("an upload");
    let moved = probe.run(&[input]).expect("results")[0];
    assert!((double(moved.a) - motion * a).abs().max_element() < 1e-6);
    assert!((double(moved.b) - motion * b).abs().max_element() < 1e-6);
}

// --- the backend -----------------------------------------------------------------------------------------

/// A flat torus with nothing in it, and its background as the picture.
fn empty_world(count: bool) -> Arc<World> {
    let mut scene = rich_scene("torus");
    (scene.objects, scene.lights) = (Vec::new(), Vec::new());
    let plan = Plan::new(&scene, count);
    Arc::new(World::new(&scene, &plan, scene.observer.frame).expect("an empty world"))
}

const BACKGROUND: [f32; 3] = [0.25, 0.5, 0.75];

pub fn shot(size: [u32; 2], samples: u32) -> Shot {
    let eye = Frame { cell: 0, point: DVec4::W, axes: [DVec4::X, DVec4::Y, DVec4::Z] };
    Shot { samples, ..Shot::symmetric(eye, 60.0, size) }
}

fn all_background(target: &Target, size: [u32; 2]) -> bool {
    let expected = [BACKGROUND[0], BACKGROUND[1], BACKGROUND[2], 1.0];
    [target.width, target.height] == size
        && target.pixels.len() == size[0] as usize * size[1] as usize
        && target.pixels.iter().all(|p| *p == expected)
}

#[test]
fn compute_draws_and_counts_each_pixel_once() {
    let Some(gpu) = gpu() else { return };
    let before = gpu.memory_in_use();
    let mut backend = ComputeBackend::new(&gpu).expect("a backend");
    let mut target = Target::new([1, 1]);
    let nothing = backend.render(&shot([8, 8], 1), &mut target, &|_| ());
    assert!(matches!(nothing, Err(RenderError::NothingLoaded)));
    backend.load(&empty_world(true)).expect("a load");
    for (size, samples) in [([1, 1], 1), ([37, 91], 1), ([37, 91], 3), ([640, 500], 2), ([37, 91], 1)] {
        let shares = Mutex::new(Vec::new());
        let progress = |share| shares.lock().expect("no panic").push(share);
        let stats = backend.render(&shot(size, samples), &mut target, &progress).expect("a picture");
        assert!(all_background(&target, size), "{size:?}");
        let rays = u64::from(size[0]) * u64::from(size[1]) * u64::from(samples);
        assert_eq!(stats.counts[io::COUNT_RAYS as usize], rays);
        assert_eq!(stats.counts[io::COUNT_HITS as usize], 0);
        let shares = shares.into_inner().expect("no panic");
        assert_eq!(shares.len() as u64, stats.dispatches);
        assert!(shares.is_sorted() && shares.last() == Some(&1.0), "{shares:?}");
        assert!(stats.trace_time <= stats.wall_time);
        assert_eq!(stats.memory, gpu.memory_in_use() - before);
        assert!(stats.memory >= rays / u64::from(samples) * 16);
        // The same work for a picture that nobody sees.
        let unseen = backend.trace(&shot(size, samples)).expect("a picture's work");
        assert_eq!(unseen.counts, stats.counts);
        assert!(unseen.dispatches > 0 && unseen.trace_time <= unseen.wall_time);
    }
    drop(backend);
    assert_eq!(gpu.memory_in_use(), before);
}

#[test]
fn compute_counts_nothing_if_nobody_asks() {
    let Some(gpu) = gpu() else { return };
    let mut backend = ComputeBackend::new(&gpu).expect("a backend");
    backend.load(&empty_world(false)).expect("a load");
    let mut target = Target::new([1, 1]);
    let stats = backend.render(&shot([64, 64], 1), &mut target, &|_| ()).expect("a picture");
    assert!(all_background(&target, [64, 64]));
    assert_eq!(stats.counts, [0; io::COUNT_END as usize]);
}

#[test]
fn compute_draws_pictures_beyond_the_largest_range() {
    let Some(gpu) = gpu() else { return };
    let mut backend = ComputeBackend::new(&gpu).expect("a backend");
    backend.load(&empty_world(true)).expect("a load");
    let mut target = Target::new([1, 1]);
    let size = [4096, 4100];
    let stats = backend.render(&shot(size, 1), &mut target, &|_| ()).expect("a picture");
    assert!(all_background(&target, size));
    assert_eq!(stats.counts[io::COUNT_RAYS as usize], 4096 * 4100);
    assert!(stats.memory < 4096 * 4100 * 32);
    // A row that does not fit is refused before anything is done.
    if gpu.info().max_storage_range < 16 << 30 {
        let refused = backend.render(&shot([1 << 30, 1], 1), &mut target, &|_| ());
        assert!(matches!(refused, Err(RenderError::TooLarge { what: "a row of pixels", .. })), "{refused:?}");
    }
}

#[test]
fn compute_bands_make_the_same_picture() {
    let Some((_turn, options)) = gpu_turn() else { return };
    let scene = rich_scene("torus");
    let world = World::new(&scene, &Plan::new(&scene, true), scene.observer.frame).expect("a world");
    // The last band has fewer rows.
    let shot = Shot { samples: 2, ..Shot::symmetric(scene.observer.frame, scene.observer.fov, [96, 64]) };
    let draw = |max_storage_range| {
        let options = ContextOptions { max_storage_range, ..options.clone() };
        let context = Context::new(&options).expect("a context");
        let mut backend = ComputeBackend::new(&context).expect("a backend");
        backend.load(&Arc::new(world.clone())).expect("a load");
        let mut target = Target::new([1, 1]);
        let stats = backend.render(&shot, &mut target, &|_| ()).expect("a picture");
        assert_eq!(stats.counts[io::COUNT_RAYS as usize], 2 * 96 * 64);
        (target, stats)
    };
    let ((whole, one), (bands, some)) = (draw(None), draw(Some(96 * 16 * 23)));
    assert!(some.dispatches >= 3 * 2 && some.memory < one.memory);
    let (far, near) = differences(&whole, &bands);
    assert!(far < 0.001 && near < 1e-5, "{far} {near}");
    assert_eq!(options.messages.take(), [""; 0]);
}

#[test]
fn compute_refuses_what_the_device_cannot_bind() {
    let Some((_turn, options)) = gpu_turn() else { return };
    let context = Context::new(&ContextOptions { max_storage_range: Some(4000), ..options }).expect("a context");
    let mut scene = rich_scene("torus");
    scene.textures[0].texels.resize(32 * 32, [half::f16::ONE; 4]);
    (scene.textures[0].width, scene.textures[0].height) = (32, 32);
    let world = World::new(&scene, &Plan::new(&scene, false), scene.observer.frame).expect("a world");
    let mut backend = ComputeBackend::new(&context).expect("a backend");
    let before = context.memory_in_use();
    let error = backend.load(&Arc::new(world)).expect_err("too large").to_string();
    let device = &context.info().name;
    assert_eq!(error, format!("texels takes 8192 bytes, but {device} binds at most 4000"));
    assert_eq!(context.memory_in_use(), before);
}

#[test]
fn tiles_cover_each_pixel_once() {
    for (size, areas) in [([37, 21], [64.0, 4096.0]), ([130, 67], [4096.0, 100.0]), ([1, 1], [1e12, 1.0])] {
        let mut seen = vec![0; (size[0] * size[1]) as usize];
        let mut tiles = Tiles::new(size);
        let mut turn = areas.iter().cycle();
        while let Some(([x, y], [w, h])) = tiles.next((turn.next().copied().unwrap_or(64.0), [64, 1 << 20])) {
            assert!(w > 0 && h > 0 && w <= 64);
            for pixel in (y..y + h).flat_map(|j| (x..x + w).map(move |i| j * size[0] + i)) {
                seen[pixel as usize] += 1;
            }
        }
        assert!(seen.iter().all(|n| *n == 1), "{size:?}");
    }
}

#[test]
fn tiles_bands_cover_each_row_once() {
    let bands = Bands::new([8192, 8192], (128 << 20) / 16).expect("a row fits");
    assert_eq!(bands.largest(), [8192, 1024]);
    assert!(bands.iter().flatten().eq(0..8192));
    assert_eq!(Bands::new([8192, 2], 8191), None);
    let one = Bands::new([640, 480], 1 << 23).expect("a row fits");
    assert_eq!((one.iter().count(), one.iter().next()), (1, Some(0..480)));
}

#[test]
fn tiles_pace_finds_its_area_and_keeps_it() {
    let mut pace = Pace::new([65535, 65535]);
    for _ in 0..20 {
        let pixels = pace.tile().0 as u64;
        pace.learn(pixels, Duration::from_nanos(pixels * 100));
    }
    assert!((pace.tile().0 - 500_000.0).abs() < 1.0);
    // The rest of a picture's last row, with its share of the cost of a submission.
    pace.learn(1000, Duration::from_micros(110));
    assert!((pace.tile().0 - 500_000.0).abs() < 1.0);
}

// --- devices ---------------------------------------------------------------------------------------------

#[test]
fn device_is_picked_by_index_or_part_of_its_name() {
    let Some((_turn, options)) = gpu_turn() else { return };
    let devices = holonomy::vulkan::devices(&options).expect("devices");
    let first = &devices[0];
    for wanted in ["0".to_owned(), first.name.to_uppercase(), first.name[..4].to_owned()] {
        let options = ContextOptions { device: Some(wanted), ..options.clone() };
        assert_eq!(Context::new(&options).expect("a context").info().name, first.name);
    }
    for wanted in ["99", "no such device"] {
        let options = ContextOptions { device: Some(wanted.to_owned()), ..options.clone() };
        let error = Context::new(&options).expect_err("no device").to_string();
        assert!(error.contains(&format!("{wanted:?}")) && error.contains(&format!("0: {}", first.name)), "{error}");
    }
}

// --- faults ----------------------------------------------------------------------------------------------

/// Everything that a program does with a device: open it, probe, load, draw twice, close it.
fn life(options: &ContextOptions) -> Result<(), RenderError> {
    let result = Context::new(options).map_err(RenderError::from).and_then(|context| {
        let result = use_of(&context);
        // Whatever has happened, nothing is left.
        assert!(context.is_hung() || context.memory_in_use() == 0, "{} bytes left", context.memory_in_use());
        assert_eq!(Arc::strong_count(&context), 1);
        result
    });
    // The layer reports objects that are left when their device or instance goes, and objects that go too early.
    assert_eq!(options.messages.take(), [""; 0], "{result:?}");
    result
}

fn use_of(context: &Arc<Context>) -> Result<(), RenderError> {
    let input = ProbeIn { op: io::PROBE_BASE, ..ProbeIn::default() };
    Probe::new(context, GeometryId::E3)?.run(&[input; 3])?;
    let mut backend = ComputeBackend::new(context)?;
    backend.load(&empty_world(true))?;
    let mut target = Target::new([1, 1]);
    backend.render(&shot([16, 16], 2), &mut target, &|_| ())?;
    backend.render(&shot([24, 16], 1), &mut target, &|_| ())?;
    Ok(())
}

/// Makes each call of a life fail, one after the other.
#[test]
fn faults_end_in_errors_that_name_the_call() {
    let Some((_turn, options)) = gpu_turn() else { return };
    let faults = FaultInjection::default();
    let options = ContextOptions { faults: faults.clone(), ..options };
    faults.record();
    life(&options).expect("a life without faults");
    let calls = faults.calls();
    assert!(calls.len() > 60, "{calls:?}");
    for wanted in ["vkAllocateMemory", "vkQueueSubmit", "vkWaitForFences", "vkCreateComputePipelines", "vkCreateDevice"]
    {
        assert!(calls.contains(&wanted), "{wanted}");
    }
    for (index, call) in calls.iter().enumerate() {
        let result = match *call {
            "vkQueueSubmit" | "vkWaitForFences" => vk::Result::ERROR_DEVICE_LOST,
            _ if index % 2 == 0 => vk::Result::ERROR_OUT_OF_DEVICE_MEMORY,
            _ => vk::Result::ERROR_OUT_OF_HOST_MEMORY,
        };
        faults.fail("", index, result);
        let error = life(&options).expect_err(call).to_string();
        assert!(error.starts_with(call) && error.contains(&format!("{result:?}")), "{call}: {error}");
    }
}

#[test]
fn faults_out_of_memory_names_buffer_and_size() {
    let Some((_turn, options)) = gpu_turn() else { return };
    let faults = FaultInjection::default();
    let context = Context::new(&ContextOptions { faults: faults.clone(), ..options }).expect("a context");
    let mut backend = ComputeBackend::new(&context).expect("a backend");
    backend.load(&empty_world(false)).expect("a load");
    let mut target = Target::new([1, 1]);
    faults.fail("vkAllocateMemory", 0, vk::Result::ERROR_OUT_OF_DEVICE_MEMORY);
    let error = backend.render(&shot([100, 10], 1), &mut target, &|_| ()).expect_err("a fault").to_string();
    assert!(error.starts_with("vkAllocateMemory for buffer pixels (16000 bytes, "), "{error}");
    // Memory came back: the same backend goes on.
    backend.render(&shot([100, 10], 1), &mut target, &|_| ()).expect("a picture");
    assert!(all_background(&target, [100, 10]));
    drop(backend);
    let messages = context.messages();
    drop(context);
    assert_eq!(messages.take(), [""; 0]);
}

#[test]
fn faults_time_out_hangs_the_context_and_nothing_else() {
    let Some((_turn, options)) = gpu_turn() else { return };
    let faults = FaultInjection::default();
    let context = Context::new(&ContextOptions { faults: faults.clone(), ..options.clone() }).expect("a context");
    let mut backend = ComputeBackend::new(&context).expect("a backend");
    backend.load(&empty_world(false)).expect("a load");
    let mut target = Target::new([1, 1]);
    faults.fail("vkWaitForFences", 2, vk::Result::TIMEOUT);
    let mut draw = |backend: &mut ComputeBackend| backend.render(&shot([64, 64], 1), &mut target, &|_| ());
    let error = draw(&mut backend).expect_err("a fault").to_string();
    assert!(error.contains(&format!("did not finish within {SUBMIT_TIME_OUT:?}")), "{error}");
    let error = draw(&mut backend).expect_err("hung").to_string();
    assert!(error.contains("hangs in an earlier submission"), "{error}");
    drop(backend);
    let messages = context.messages();
    drop(context);
    assert_eq!(messages.take(), [""; 0]);
    // Another context of the same device works.
    life(&options).expect("a life");
}

// --- validation of the validation --------------------------------------------------------------------------

#[test]
fn validation_sees_a_missing_barrier() {
    let Some((_turn, options)) = gpu_turn() else { return };
    if options.validation != Validation::Sync {
        return skip("validation", "synchronization validation is off");
    }
    let faults = FaultInjection::default();
    let context = Context::new(&ContextOptions { faults: faults.clone(), ..options }).expect("a context");
    let mut backend = ComputeBackend::new(&context).expect("a backend");
    backend.load(&empty_world(true)).expect("a load");
    let mut target = Target::new([1, 1]);
    backend.render(&shot([64, 64], 1), &mut target, &|_| ()).expect("a picture");
    assert_eq!(context.validation_messages(), [""; 0]);
    faults.omit_barriers(true);
    backend.render(&shot([64, 64], 1), &mut target, &|_| ()).expect("a picture");
    let messages = context.validation_messages();
    assert!(messages.iter().any(|m| m.contains("SYNC-HAZARD")), "{messages:?}");
}

#[test]
fn errors_name_the_thing_and_the_limits() {
    let error = VulkanError::Memory { what: "buffer pixels".to_owned(), size: 5, in_use: 7, cause: "none".to_owned() };
    assert_eq!(error.to_string(), "vkAllocateMemory for buffer pixels (5 bytes, 7 bytes in use): none");
    let error = VulkanError::UnknownDevice { wanted: "x".to_owned(), devices: Vec::new() };
    assert_eq!(error.to_string(), "no Vulkan device is called \"x\"; there is none");
}

// --- against the CPU -----------------------------------------------------------------------------------------

/// A scene with something of everything that is packed for the device: mesh with texture and mask, ball, tube,
/// point light and spot, in a space that is glued to itself.
pub fn rich_scene(space: &str) -> Scene {
    let space = holonomy::space::catalogue::find(space).expect("a space of the catalogue");
    let geometry = space.geometry;
    struct At(DVec3);
    impl Visitor for At {
        type Output = Frame;
        fn visit<G: Geometry>(self, geometry: G) -> Frame {
            let base = geometry.base();
            Frame { cell: 0, point: base, axes: geometry.frame(base) }.moved(geometry, self.0)
        }
    }
    let at = |x, y, z| visit(geometry, At(DVec3::new(x, y, z)));
    let world = |x, y, z| Place::World(at(x, y, z));
    let vertex = |x, y, u, v| Vertex { position: DVec3::new(x, y, 0.0), normal: DVec3::Z, uv: [u, v] };
    let mesh = Mesh {
        name: "quad".to_owned(),
        vertices: vec![
            vertex(-0.15, -0.15, 0.0, 2.5),
            vertex(0.15, -0.15, 2.5, 2.5),
            vertex(0.15, 0.15, 2.5, 0.0),
            vertex(-0.15, 0.15, 0.0, 0.0),
        ],
        triangles: vec![([0, 1, 2], 1), ([0, 2, 3], 1)],
    };
    let texel = |r: f32, a: f32| [r, 0.25, 0.75, a].map(half::f16::from_f32);
    let texture = Texture {
        width: 2,
        height: 2,
        texels: vec![texel(1.0, 1.0), texel(0.5, 1.0), texel(0.1, 0.0), texel(0.9, 1.0)],
        wrap: [Wrap::Mirror, Wrap::Repeat],
    };
    let masked = Material { base_texture: Some(0), alpha_cutoff: Some(0.5), ..Material::plain("masked", [1.0; 3]) };
    let object = |name: &str, shape, place, material| Object {
        name: name.to_owned(),
        shape,
        place,
        scale: 1.0,
        material,
        motion: None,
    };
    let light = |place: Frame, spot: Option<Spot>| PointLight {
        cell: 0,
        point: place.point,
        color: [1.0, 0.9, 0.8],
        range: 1.0,
        spot,
        shadows: spot.is_some(),
    };
    let lamp = at(0.0, 0.2, 0.1);
    Scene {
        name: "rich".to_owned(),
        observer: Observer { frame: at(0.05, 0.02, 0.3), fov: 80.0, eye_distance: 0.06 },
        path: Vec::new(),
        lights: vec![
            light(at(0.1, -0.2, 0.2), None),
            light(lamp, Some(Spot { direction: -lamp.axes[1], cos_angle: 0.5 })),
        ],
        materials: vec![Material::plain("red", [0.8, 0.1, 0.1]), masked],
        textures: vec![texture],
        meshes: vec![mesh],
        objects: vec![
            object("ball", Shape::Ball { radius: 0.1 }, world(0.15, 0.0, -0.1), Some(0)),
            object("tube", Shape::Tube { radius: 0.03, length: 0.3 }, world(-0.1, -0.15, -0.2), Some(0)),
            object("quad", Shape::Mesh(0), world(-0.1, 0.05, 0.0), None),
        ],
        settings: Settings {
            bounces: 4,
            fog: 0.2,
            headlight: [0.1; 3],
            background: BACKGROUND,
            max_distance: Some(4.0),
            ..Settings::default()
        },
        space,
    }
}

/// Share of pixels that differ by more than rounding, and mean difference of the rest.
fn differences(a: &Target, b: &Target) -> (f64, f64) {
    let each = a.pixels.iter().zip(&b.pixels).map(|(a, b)| {
        a.iter().zip(b).map(|(a, b)| if a == b { 0.0 } else { f64::from((a - b).abs()) }).fold(0.0, f64::max)
    });
    let (mut far, mut sum) = (0.0, 0.0);
    for difference in each {
        if difference <= 2e-3 { sum += difference } else { far += 1.0 }
    }
    let count = a.pixels.len() as f64;
    (far / count, sum / count)
}

/// As on hardware, where each invocation has a stack of its own: the same pixels and counts as together.
#[test]
fn compute_invocations_may_walk_alone() {
    let Some(gpu) = gpu() else { return };
    let mut device = gpu.info().clone();
    device.kind = DeviceKind::Cpu;
    for (driver, together) in
        [("Mesa 22.3.6 (LLVM 15.0.6)", false), ("Mesa 26.1.6-1 (LLVM 19.1.7)", true), ("1.2", true)]
    {
        device.driver_info = driver.to_owned();
        assert_eq!(walks_together(&device), together, "{driver}");
    }
    device.kind = DeviceKind::Discrete;
    assert!(!walks_together(&device), "hardware");
    let walking = |together| ComputeBackend::with_options(&gpu, ComputeOptions { together: Some(together) });
    let (mut together, mut alone) = (walking(true).expect("a backend"), walking(false).expect("a backend"));
    for space in ["torus", "seifert-weber"] {
        let scene = rich_scene(space);
        let plan = Plan::new(&scene, true);
        let world = Arc::new(World::new(&scene, &plan, scene.observer.frame).expect("a world"));
        let shot = Shot::symmetric(scene.observer.frame, scene.observer.fov, [64, 48]);
        let draw = |backend: &mut ComputeBackend| {
            let mut target = Target::new(shot.size);
            backend.load(&world).expect("a load");
            let stats = backend.render(&shot, &mut target, &|_| ()).expect("a picture");
            (target, stats.counts)
        };
        let ((expected, counts), (mut drawn, counts_alone)) = (draw(&mut together), draw(&mut alone));
        let (far, near) = differences(&expected, &drawn);
        println!("{space}: {far} of the pixels differ, counts {counts:?} and {counts_alone:?}");
        assert!(far < 1e-3 && near < 1e-6, "{space}: {far} {near:e}");
        for (a, b) in counts.iter().zip(counts_alone) {
            assert!(a.abs_diff(b) as f64 <= 0.005 * *a as f64, "{counts:?} {counts_alone:?}");
        }
        drawn.pixels.iter_mut().for_each(|p| p[1] *= 0.99);
        let (far, near) = differences(&expected, &drawn);
        assert!(far >= 1e-3 || near >= 1e-6, "{space}: a darker picture is not noticed");
    }
}

#[test]
fn compute_draws_what_the_cpu_draws() {
    let Some(gpu) = gpu() else { return };
    let mut compute = ComputeBackend::new(&gpu).expect("a backend");
    let mut cpu = CpuBackend::default();
    for space in ["torus", "poincare", "seifert-weber"] {
        for shading in [Shading::Riemannian, Shading::Distance, Shading::Cell, Shading::Object] {
            let mut scene = rich_scene(space);
            scene.settings.shading = shading;
            let plan = Plan::new(&scene, true);
            let world = Arc::new(World::new(&scene, &plan, scene.observer.frame).expect("a world"));
            let shot = Shot { samples: 2, ..Shot::symmetric(scene.observer.frame, scene.observer.fov, [96, 64]) };
            let (mut expected, mut drawn) = (Target::new(shot.size), Target::new(shot.size));
            cpu.load(&world).expect("a load");
            let reference = cpu.render(&shot, &mut expected, &|_| ()).expect("a picture");
            compute.load(&world).expect("a load");
            let stats = compute.render(&shot, &mut drawn, &|_| ()).expect("a picture");
            let (far, near) = differences(&expected, &drawn);
            assert!(far < 0.01 && near < 1e-4, "{space} {shading:?}: {far} {near:e}");
            assert!(reference.counts[io::COUNT_HITS as usize] > 3000);
            for (a, b) in reference.counts.iter().zip(stats.counts) {
                assert!(a.abs_diff(b) as f64 <= 0.01 * *a as f64 + 10.0, "{:?} {:?}", reference.counts, stats.counts);
            }
            // The comparison notices a darker picture.
            drawn.pixels.iter_mut().for_each(|p| p[1] *= 0.99);
            let (far, near) = differences(&expected, &drawn);
            assert!(far >= 0.01 || near >= 1e-4, "{space} {shading:?}");
        }
    }
}

/// Rays end where fog hides what they may still meet: what is nearer is seen, what is farther is background, and less is
/// looked for than by a picture that fog does not cover.
#[test]
fn rays_end_in_the_fog() {
    let mut scene = holonomy::scene::file::load("seifert-weber").expect("a scene");
    scene.settings.bounces = 40;
    let fog = scene.settings.fog;
    let shot = Shot::symmetric(scene.observer.frame, scene.observer.fov, [96, 72]);
    let draw = |backend: &mut dyn Backend, shading| {
        let mut scene = scene.clone();
        scene.settings.shading = shading;
        let world = World::new(&scene, &Plan::new(&scene, true), scene.observer.frame).expect("a world");
        backend.load(&Arc::new(world)).expect("a load");
        let mut target = Target::new([1, 1]);
        let stats = backend.render(&shot, &mut target, &|_| ()).expect("a picture");
        (target.pixels, stats.counts[io::COUNT_SEGMENTS as usize])
    };
    let check = |backend: &mut dyn Backend| {
        let (colors, seen) = draw(backend, Shading::Riemannian);
        let (distances, all) = draw(backend, Shading::Distance);
        assert!(10 * seen < 9 * all, "{seen} of {all} segments");
        let background = scene.settings.background;
        let (mut near, mut far) = (0, 0);
        for (color, [distance, ..]) in colors.iter().zip(distances) {
            let hidden = color[..3] == background;
            // A cell is 3 wide at most.
            match fog * f64::from(distance) {
                depth if depth < 8.0 => near += u32::from(!hidden),
                depth if depth > 9.0 + 3.0 * fog && depth.is_finite() => {
                    assert!(hidden, "{color:?} at {distance}");
                    far += 1;
                }
                _ => {}
            }
        }
        assert!(near > 1000 && far > 100, "{near} near, {far} far");
    };
    check(&mut CpuBackend::default());
    if let Some(gpu) = gpu() {
        check(&mut ComputeBackend::new(&gpu).expect("a backend"));
    }
}
