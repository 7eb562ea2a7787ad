//! `holonomy render`: a picture of a scene, or a sequence along its camera path.

use super::{
    BackendChoice, Failure, Outcome, RenderArgs,
    backends::{Opened, render_failure},
    eye::EyeFile,
    output::{PendingFile, PictureFormat, encode, picture_format},
    print_line,
    progress::Progress,
    sequence::{Pattern, check_range, pose},
};
use crate::{
    integrate::Method,
    measure::heatmap::{self, Scale},
    render::{
        Backend, Shot, Stats, Target, auto,
        cpu::CpuBackend,
        plan::{Feature, Heat, Plan},
        rt::RtOptions,
        side_by_side,
        world::{Pose, World},
    },
    scene::{Object, Scene, file},
    shader_io as io,
};
use anyhow::anyhow;
use serde_json::{Value, json};
use std::{
    io::{Write, stdout},
    ops::Range,
    sync::Arc,
    time::{Duration, Instant},
};

pub(super) fn run(args: &RenderArgs) -> Outcome {
    let method = args.integrator.method(args.step, args.tolerance)?;
    let format = picture_format(&args.output)?;
    let mut scene = file::load(&args.scene).map_err(Failure::refused)?;
    let seen = args.eye.as_deref().map(|path| EyeFile::read(path, &mut scene)).transpose()?;
    scene.settings.bounces = args.bounces.unwrap_or(scene.settings.bounces);
    scene.settings.method = method;
    if let (Method::Exact, Some(tolerance)) = (method, args.tolerance) {
        scene.settings.tolerance = tolerance;
    }
    scene.settings.shading = args.shading.unwrap_or(scene.settings.shading);
    let raw = scene.settings.shading.is_raw();
    if raw && args.samples > 1 {
        return Err(Failure::refused(anyhow!("--samples {}: raw values have no meaningful mean, use 1", args.samples)));
    }
    if let Some(range) = &args.frames {
        return sequence(args, scene, range.clone(), format);
    }
    // Nothing is computed whose result could not be written.
    let picture = PendingFile::create(&args.output)?;
    let stats_file = args.stats.as_deref().map(PendingFile::create).transpose()?;

    let counted = args.heatmap.is_some_and(|heat| heat.counter().is_some());
    let mut session = Session::new(args, &scene, stats_file.is_some() || counted, false)?;
    if let Some((file, pose)) = &seen {
        session.see(args, &scene, file, *pose)?;
    }
    let progress = Progress::new();
    let mut target = session.draw(args, &scene, &|share| progress.set(share))?;
    progress.finish();
    if let Some(heat) = args.heatmap {
        let beyond = if heat.counter().is_some() { heatmap::COUNTED } else { heatmap::TIMED };
        let scale = Scale::of(&target, beyond);
        target = if format == PictureFormat::Png { scale.paint(&target) } else { heatmap::grey(&target) };
        session.scale = Some(scale);
    }
    session.end(args, &scene, stats_file)?;
    picture.finish(&encode(&target, format, raw && args.heatmap.is_none() && format == PictureFormat::Png)?)?;
    match (args.heatmap, session.scale) {
        (Some(heat), Some(scale)) => print_line(&mut stdout().lock(), &scale_text(&session, heat, &scale)).map(|_| ()),
        _ => Ok(()),
    }
}

/// What colours stand for, for the terminal.
fn scale_text(session: &Session, heat: Heat, scale: &Scale) -> String {
    format!(
        "heatmap of {}: darkest {}, brightest {}, mean {:.1}, most {} {}",
        heat.name(),
        scale.darkest,
        scale.brightest,
        scale.mean,
        scale.most,
        unit(session, heat),
    )
}

/// What the values of a heatmap are.
fn unit(session: &Session, heat: Heat) -> String {
    match heat.counter() {
        Some(_) => format!("{} per pixel and sample", heat.name()),
        None if session.backend.name() == CpuBackend::NAME => String::from("ns of work per pixel and sample"),
        None => String::from("ticks of the device's clock per pixel and sample"),
    }
}

/// Draws pictures of the scene's camera path. Those that are there already are complete, since files get their names
/// last, and are left.
fn sequence(args: &RenderArgs, scene: Scene, range: Range<u32>, format: PictureFormat) -> Outcome {
    let pattern = Pattern::new(&args.output)?;
    check_range(&scene, &range)?;
    let missing: Vec<u32> = range.clone().filter(|number| !pattern.path(*number).is_file()).collect();
    let raw = scene.settings.shading.is_raw() && format == PictureFormat::Png;
    let stats_file = args.stats.as_deref().map(PendingFile::create).transpose()?;
    let progress = Progress::new();
    if !missing.is_empty() {
        // All pictures are made from the start of the path, so that each is the same whichever others are drawn.
        let mut session = Session::new(args, &scene, stats_file.is_some(), true)?;
        for (index, &number) in missing.iter().enumerate() {
            let file = PendingFile::create(&pattern.path(number))?;
            let mut seen = scene.clone();
            seen.observer.frame = pose(&scene, number)?;
            session.follow(&seen, f64::from(number) / PICTURES_PER_UNIT_OF_TIME)?;
            let share = |done: f64| progress.set((index as f64 + done) / missing.len() as f64);
            let target = session.draw(args, &seen, &share)?;
            file.finish(&encode(&target, format, raw)?)?;
        }
        progress.finish();
        session.end(args, &scene, stats_file)?;
    }
    let left = range.len() - missing.len();
    if left > 0 {
        let _ = writeln!(std::io::stderr(), "{left} of {} pictures were there already", range.len());
    }
    Ok(())
}

/// A backend with what it draws, and what that has cost so far.
struct Session {
    backend: Box<dyn Backend>,
    plan: Plan,
    world: Arc<World>,
    eyes: usize,
    pictures: u32,
    sum: Stats,
    times: Times,
    /// What an eye of a headset saw, if that is to be drawn.
    eye: Option<Shot>,
    /// Of a heatmap, when it is drawn.
    scale: Option<Scale>,
}

/// Pictures of a sequence in a unit of time, by which velocities of objects in motion are given.
const PICTURES_PER_UNIT_OF_TIME: f64 = 30.0;

impl Session {
    /// Prepares the scene, for a sequence or for one picture, and loads it.
    fn new(args: &RenderArgs, scene: &Scene, count: bool, sequence: bool) -> Result<Self, Failure> {
        let started = Instant::now();
        let plan = Plan::new(scene, count).keep(&args.keep).showing(args.heatmap);
        let (mut backend, reason) = backend_for(args, &plan)?;
        let start = Pose::new(scene.observer.frame, 0.0);
        let world =
            if sequence { World::moving(scene, &plan, start) } else { World::new(scene, &plan, scene.observer.frame) };
        let world = Arc::new(world.map_err(Failure::refused)?);
        let loading = Instant::now();
        backend.load(&world).map_err(render_failure)?;
        let times = Times { prepare: loading - started, load: loading.elapsed(), pose: Duration::ZERO };
        // Only now that nothing can be refused any more, so that a refusal is the only line. A closed stderr is no reason
        // to stop.
        let _ = writeln!(std::io::stderr(), "{reason}");
        let eyes = if args.stereo { 2 } else { 1 };
        Ok(Self { backend, plan, world, eyes, pictures: 0, sum: Stats::default(), times, eye: None, scale: None })
    }

    /// Takes the scene in at another time and with its observer elsewhere. The world stays unless it depends on them.
    fn follow(&mut self, scene: &Scene, time: f64) -> Outcome {
        let started = Instant::now();
        let pose = Pose::new(scene.observer.frame, time);
        let labels = self.plan.uses(Feature::Labels);
        if labels || scene.objects.iter().any(Object::moves) {
            // Labels are counted from the observer's own cell.
            let world = if labels { World::moving(scene, &self.plan, pose) } else { self.world.posed(scene, pose) };
            self.world = Arc::new(world.map_err(Failure::refused)?);
            self.backend.pose(&self.world).map_err(render_failure)?;
        }
        self.times.pose += started.elapsed();
        Ok(())
    }

    /// Takes the scene in as it was when an eye of a headset saw it.
    fn see(&mut self, args: &RenderArgs, scene: &Scene, file: &EyeFile, pose: Pose) -> Outcome {
        self.world = Arc::new(World::moving(scene, &self.plan, pose).map_err(Failure::refused)?);
        self.backend.load(&self.world).map_err(render_failure)?;
        self.eye = Some(Shot { samples: args.samples, seed: args.seed, ..file.shot() });
        Ok(())
    }

    /// Keeps compiled pipelines, and writes what all pictures have cost if that is asked for.
    fn end(&self, args: &RenderArgs, scene: &Scene, stats_file: Option<PendingFile>) -> Outcome {
        if let Some(lost) = self.backend.keep() {
            let _ = writeln!(std::io::stderr(), "warning: {lost}");
        }
        if let Some(file) = stats_file {
            let text = serde_json::to_string_pretty(&stats_json(args, scene, self)).map_err(Failure::failed)?;
            file.finish(text.as_bytes())?;
        }
        Ok(())
    }

    /// The picture, both eyes side by side if there are two.
    fn draw(&mut self, args: &RenderArgs, scene: &Scene, progress: &(dyn Fn(f64) + Sync)) -> Result<Target, Failure> {
        if let Some(shot) = self.eye {
            let mut target = Target::new(shot.size);
            let stats = self.backend.render(&shot, &mut target, progress).map_err(render_failure)?;
            add(&mut self.sum, &stats);
            self.pictures += 1;
            return Ok(target);
        }
        let eyes =
            if args.stereo { scene.eyes().map_err(Failure::refused)?.to_vec() } else { vec![scene.observer.frame] };
        let mut target = Target::new(side_by_side(args.size, eyes.len() as u32));
        for (index, eye) in eyes.iter().enumerate() {
            let shot =
                Shot { samples: args.samples, seed: args.seed, ..Shot::symmetric(*eye, scene.observer.fov, args.size) };
            let mut view = Target::new(args.size);
            let share = |done: f64| progress((index as f64 + done) / eyes.len() as f64);
            let stats = self.backend.render(&shot, &mut view, &share).map_err(render_failure)?;
            add(&mut self.sum, &stats);
            target.paste(&view, [args.size[0] * index as u32, 0]);
        }
        self.pictures += 1;
        Ok(target)
    }
}

/// The backend that the user chose, ready for the plan.
fn backend_for(args: &RenderArgs, plan: &Plan) -> Result<(Box<dyn Backend>, String), Failure> {
    if args.recursive && args.backend != BackendChoice::Rt {
        return Err(Failure::refused(anyhow!("--recursive is an experiment of the backend rt: add --backend rt")));
    }
    let (backend, reason) = match Opened::new(args.backend)? {
        None => {
            let chosen = auto::choose(plan).map_err(Failure::vulkan)?;
            (chosen.backend, chosen.reason)
        }
        Some(Opened::Cpu) => (Opened::Cpu.backend()?, String::from("backend cpu: asked for")),
        Some(opened) => {
            let backend = opened.with_options(RtOptions { recursive: args.recursive })?;
            let reason = format!("backend {}: {} (asked for)", backend.name(), backend.device());
            (backend, reason)
        }
    };
    backend.check(plan).map_err(|missing| Failure::failed(anyhow!("{} lacks {missing}", backend.device())))?;
    Ok((backend, reason))
}

fn add(sum: &mut Stats, stats: &Stats) {
    sum.counts.iter_mut().zip(stats.counts).for_each(|(s, n)| *s += n);
    sum.trace_time += stats.trace_time;
    sum.wall_time += stats.wall_time;
    sum.memory = sum.memory.max(stats.memory);
    sum.dispatches += stats.dispatches;
    sum.structures = stats.structures;
    sum.pipeline_cache.clone_from(&stats.pipeline_cache);
    sum.uncounted = stats.uncounted;
}

struct Times {
    prepare: Duration,
    load: Duration,
    /// Of all poses of a sequence together.
    pose: Duration,
}

/// How rays were followed, and by which parameter.
fn integrator_json(scene: &Scene) -> Value {
    let method = scene.settings.method;
    let (key, value) = match method {
        Method::Exact => ("tolerance", scene.settings.tolerance),
        Method::Euler { step } | Method::Rk4 { step } => ("step", step),
        Method::Dopri5 { tolerance } => ("tolerance", tolerance),
    };
    json!({ "name": method.name(), key: value })
}

/// The content of the `--stats` file.
fn stats_json(args: &RenderArgs, scene: &Scene, session: &Session) -> Value {
    let Session { backend, plan, world, eyes, pictures, sum: stats, times, .. } = session;
    let milliseconds = |time: Duration| time.as_secs_f64() * 1e3;
    let count = |index: u32| stats.counts[index as usize];
    // What the device's own traversal does is not known, which is not the same as nothing.
    let shown = |index: u32, value: Value| if stats.uncounted.contains(&index) { Value::Null } else { value };
    let named = [
        ("rays", io::COUNT_RAYS),
        ("segments", io::COUNT_SEGMENTS),
        ("bounces", io::COUNT_BOUNCES),
        ("hits", io::COUNT_HITS),
        ("nodes", io::COUNT_NODES),
        ("triangle_tests", io::COUNT_TRIANGLES),
        ("quadric_tests", io::COUNT_QUADRICS),
        ("shadow_rays", io::COUNT_SHADOW_RAYS),
        ("shadow_segments", io::COUNT_SHADOW_SEGMENTS),
        ("lost", io::COUNT_LOST),
    ];
    let size = session.eye.map_or(args.size, |shot| shot.size);
    let pixels = f64::from(size[0]) * f64::from(size[1]) * *eyes as f64 * f64::from(*pictures);
    let counts: serde_json::Map<_, _> =
        named.iter().map(|(name, i)| ((*name).to_owned(), shown(*i, json!(count(*i))))).collect();
    let per_pixel: serde_json::Map<_, _> =
        named.iter().map(|(name, i)| ((*name).to_owned(), shown(*i, json!(count(*i) as f64 / pixels)))).collect();
    let features = |wanted: fn(&crate::render::plan::Decision) -> bool| -> Vec<Value> {
        let chosen = plan.decisions.iter().filter(|d| wanted(d));
        chosen.map(|d| json!({ "feature": d.feature.name(), "because": d.reason })).collect()
    };
    let segments = count(io::COUNT_SEGMENTS) + count(io::COUNT_SHADOW_SEGMENTS);
    json!({
        "schema": 1,
        "scene": scene.name,
        "space": scene.space.name,
        "geometry": scene.space.geometry.name(),
        "backend": backend.name(),
        "device": backend.device(),
        "size": size,
        "eyes": eyes,
        "pictures": pictures,
        "samples": args.samples,
        "bounces": scene.settings.bounces,
        "integrator": integrator_json(scene),
        "used": features(|d| d.needed),
        "left_out": features(|d| !d.needed && !d.kept),
        "kept_in": features(|d| d.kept),
        "content": {
            "triangles": world.meshes().triangles.len(),
            "quadrics": world.quadrics.len(),
            "light_images": world.lights.images.len(),
            "texels": world.textures.iter().map(|t| t.texels.len()).sum::<usize>(),
            "faces": world.domain.faces.len(),
        },
        "counts": counts,
        "per_pixel": per_pixel,
        "heatmap": args.heatmap.zip(session.scale).map(|(heat, scale)| json!({
            "of": heat.name(),
            "unit": unit(session, heat),
            "darkest": scale.darkest,
            "brightest": scale.brightest,
            "most": scale.most,
            "mean": scale.mean,
            "sum": scale.sum * f64::from(args.samples),
        })),
        "memory_bytes": stats.memory,
        "acceleration": stats.structures.map(|s| json!({
            "bottom_structures": s.bottom,
            "bottom_bytes_before_compaction": s.bytes_built,
            "bottom_bytes": s.bytes_compacted,
            "moving_bytes": s.bytes_moving,
            "instances": s.instances,
            "top_bytes": s.bytes_top,
            "table_bytes": s.bytes_table,
            "builds": s.builds,
            "refits": s.refits,
        })),
        "pipeline_cache": stats.pipeline_cache,
        "dispatches": stats.dispatches,
        "time_ms": {
            "prepare": milliseconds(times.prepare),
            "load": milliseconds(times.load),
            "pose": milliseconds(times.pose),
            "trace": milliseconds(stats.trace_time),
            "wall": milliseconds(stats.wall_time),
        },
        "ns_per_segment": if plan.uses(Feature::Counters) && segments > 0 {
            json!(stats.trace_time.as_secs_f64() * 1e9 / segments as f64)
        } else {
            Value::Null
        },
    })
}
