//! Frame time per bounce count: what a frame costs in each scene, on each backend, at each number of bounces.
//!
//! **Rounds.** All configurations are drawn by turns, a frame each, round after round, so that a machine that gets slower
//! or busier while it measures does so to all alike. The first round gives the first frames, the next ones warm up, the
//! rest is measured. Warming up takes [`WARM_UP`] at least: devices are idle while scenes load. Pictures stay on the device.
//!
//! **Two clocks.** Frame time is the device's own, by time stamps around each dispatch, and wall time on the cpu. Where
//! the device is software, programs beside it lengthen that; processor time (user and system, all threads of the process,
//! the driver's among them) is what can be compared then.
//!
//! **Counts** are taken from a frame of their own before anything is timed, since counting costs time. They repeat exactly.

use super::{
    MeasureError,
    plot::{Plot, Scale, Series},
    quantile,
    report::{Cell, Table},
};
use crate::{
    integrate::Method,
    render::{Backend, Shot, Stats, clock, plan::Plan, world::World},
    scene::Scene,
    shader_io as io,
    vulkan::VulkanError,
};
use std::{
    sync::Arc,
    time::{Duration, Instant},
};

/// Least time of the rounds that are not measured. A card that was idle reaches its clock rate only after it has worked for a
/// while: an NVIDIA H100 goes from 345 to 1980 MHz in 0.4 s.
pub const WARM_UP: Duration = Duration::from_millis(500);

/// How rays are followed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Following {
    /// The integrator with its parameter.
    pub method: Method,
    /// Tolerance of exact arcs, instead of the scene's.
    pub tolerance: Option<f64>,
}

/// A scene with what is varied of it.
pub struct Subject {
    /// The scene.
    pub scene: Scene,
    /// Sizes of an eye's picture.
    pub sizes: Vec<[u32; 2]>,
    /// Ways to follow its rays.
    pub following: Vec<Following>,
}

/// Makes backends of one kind.
pub struct Contender<'a> {
    /// Name on the command line.
    pub name: &'static str,
    /// Makes one.
    pub make: &'a dyn Fn() -> Result<Box<dyn Backend>, VulkanError>,
}

/// What to measure.
pub struct Request<'a> {
    /// Scenes.
    pub subjects: &'a [Subject],
    /// Backends.
    pub contenders: &'a [Contender<'a>],
    /// Largest numbers of face passages.
    pub bounces: &'a [u32],
    /// Both eyes beside one.
    pub stereo: bool,
    /// Frames that are thrown away, after the first; more where they take less than [`WARM_UP`].
    pub warm_up: usize,
    /// Frames that are measured.
    pub frames: usize,
}

/// Columns that tell configurations apart.
pub const KEY: [&str; 8] = ["scene", "backend", "eyes", "width", "height", "integrator", "parameter", "bounces"];

/// The other columns.
const VALUES: [&str; 27] = [
    "frames",
    "frame_ms_median",
    "frame_ms_p5",
    "frame_ms_p95",
    "first_frame_ms",
    "cpu_ms_median",
    "cpu_ms_p5",
    "cpu_ms_p95",
    "fps",
    "rays_per_pixel",
    "segments_per_pixel",
    "bounces_per_pixel",
    "hits_per_pixel",
    "nodes_per_pixel",
    "tests_per_pixel",
    "triangle_tests_per_pixel",
    "quadric_tests_per_pixel",
    "shadow_rays_per_pixel",
    "shadow_segments_per_pixel",
    "mrays_per_s",
    "ns_per_segment",
    "cpu_ns_per_segment",
    "memory_bytes",
    "load_ms",
    "space",
    "geometry",
    "dispatches",
];

/// The table of all configurations, without rows.
pub fn table() -> Table {
    let about = "a configuration: frame time by device time stamps (wall time on the cpu), processor time of the process, \
                 counts per pixel, million rays per second and time per segment (primary and shadow rays)";
    Table::new("frames", about, &KEY.iter().chain(&VALUES).copied().collect::<Vec<_>>())
}

/// A scene on a backend, at one size.
struct Unit<'a> {
    subject: &'a Subject,
    contender: &'a Contender<'a>,
    following: Following,
    size: [u32; 2],
}

/// A scene loaded by a backend.
struct Loaded {
    backend: Box<dyn Backend>,
    time: Duration,
}

/// One row.
struct Configuration {
    /// Index of the unit.
    unit: usize,
    bounces: u32,
    /// One for each eye.
    shots: Vec<Shot>,
    counts: Stats,
    first: Option<Frame>,
    frames: Vec<Frame>,
}

/// What one frame took.
#[derive(Clone, Copy)]
struct Frame {
    trace: Duration,
    wall: Duration,
    worked: Option<Duration>,
    memory: u64,
}

fn units<'a>(request: &'a Request<'a>) -> Vec<Unit<'a>> {
    let mut units = Vec::new();
    for subject in request.subjects {
        for &size in &subject.sizes {
            for &following in &subject.following {
                let of = |contender| Unit { subject, contender, following, size };
                units.extend(request.contenders.iter().map(of));
            }
        }
    }
    units
}

fn eyes(stereo: bool) -> &'static [usize] {
    if stereo { &[1, 2] } else { &[1] }
}

/// What [`KEY`] says of the rows that `request` leads to, in their order.
pub fn keys(request: &Request<'_>) -> Vec<Vec<Cell>> {
    let of_unit = |unit: &Unit<'_>| {
        let rows = eyes(request.stereo).iter().flat_map(|eyes| request.bounces.iter().map(move |n| (*eyes, *n)));
        rows.map(|(eyes, bounces)| unit.key(eyes, bounces)).collect::<Vec<_>>()
    };
    units(request).iter().flat_map(of_unit).collect()
}

impl Unit<'_> {
    fn key(&self, eyes: usize, bounces: u32) -> Vec<Cell> {
        let parameter = match self.following.method {
            Method::Exact => self.following.tolerance.unwrap_or(self.subject.scene.settings.tolerance),
            method => method.parameter(),
        };
        vec![
            self.subject.scene.name.as_str().into(),
            self.contender.name.into(),
            if eyes == 2 { "stereo" } else { "mono" }.into(),
            f64::from(self.size[0]).into(),
            f64::from(self.size[1]).into(),
            self.following.method.name().into(),
            parameter.into(),
            f64::from(bounces).into(),
        ]
    }

    /// The scene as it is drawn, with the most bounces that are asked for.
    fn scene(&self, bounces: u32) -> Scene {
        let mut scene = self.subject.scene.clone();
        scene.settings.bounces = bounces;
        scene.settings.method = self.following.method;
        scene.settings.tolerance = self.following.tolerance.unwrap_or(scene.settings.tolerance);
        scene
    }
}

/// Measures. `progress` gets what is at work, and the share of everything that is done.
///
/// # Errors
/// Failures of backends, scenes that do not fit, eyes without a place.
pub fn measure(request: &Request<'_>, progress: &dyn Fn(&str, f64)) -> Result<Table, MeasureError> {
    let units = units(request);
    let most = request.bounces.iter().copied().max().unwrap_or(1);
    let per_unit = request.bounces.len() * eyes(request.stereo).len();
    // One frame of each configuration counts, one is its first.
    let rounds = 1 + request.warm_up + request.frames;
    let total = (units.len() * per_unit * (1 + rounds)) as f64;
    let mut drawn = 0.0;
    let mut step = |what: &str| {
        drawn += 1.0;
        progress(what, drawn / total);
    };
    let (mut loaded, mut configurations) = (Vec::new(), Vec::new());
    for (index, unit) in units.iter().enumerate() {
        let scene = unit.scene(most);
        let mut backend = (unit.contender.make)()?;
        let mut of_unit = shots(&scene, unit.size, request)?
            .map(|(bounces, shots)| Configuration {
                unit: index,
                bounces,
                shots,
                counts: Stats::default(),
                first: None,
                frames: Vec::new(),
            })
            .collect::<Vec<_>>();
        load(backend.as_mut(), &scene, true)?;
        for configuration in &mut of_unit {
            configuration.count(backend.as_mut())?;
            step(&scene.name);
        }
        let started = Instant::now();
        load(backend.as_mut(), &scene, false)?;
        loaded.push(Loaded { backend, time: started.elapsed() });
        configurations.append(&mut of_unit);
    }
    let started = Instant::now();
    for round in 0..rounds {
        while round == 1 + request.warm_up && started.elapsed() < WARM_UP {
            for configuration in &configurations {
                configuration.frame(loaded[configuration.unit].backend.as_mut())?;
            }
        }
        for configuration in &mut configurations {
            let unit = configuration.unit;
            let frame = configuration.frame(loaded[unit].backend.as_mut())?;
            if round == 0 {
                configuration.first = Some(frame);
            } else if round > request.warm_up {
                configuration.frames.push(frame);
            }
            step(&units[unit].subject.scene.name);
        }
    }
    let mut table = table();
    for configuration in &configurations {
        let (unit, loaded) = (&units[configuration.unit], &loaded[configuration.unit]);
        table.push(configuration.row(unit, loaded));
    }
    Ok(table)
}

/// The pictures of a scene: bounces with a shot for each eye, in the order of [`keys`].
fn shots<'a>(
    scene: &Scene,
    size: [u32; 2],
    request: &'a Request<'_>,
) -> Result<impl Iterator<Item = (u32, Vec<Shot>)> + 'a, MeasureError> {
    let both = if request.stereo { Some(scene.eyes()?) } else { None };
    let (middle, fov) = (scene.observer.frame, scene.observer.fov);
    let views = [vec![middle]].into_iter().chain(both.map(|eyes| eyes.to_vec()));
    Ok(views.flat_map(move |frames| {
        request.bounces.iter().map(move |&bounces| {
            let shot = |frame: &_| Shot { bounces: Some(bounces), ..Shot::symmetric(*frame, fov, size) };
            (bounces, frames.iter().map(shot).collect())
        })
    }))
}

fn load(backend: &mut dyn Backend, scene: &Scene, count: bool) -> Result<(), MeasureError> {
    let plan = Plan::new(scene, count);
    let world = Arc::new(World::new(scene, &plan, scene.observer.frame)?);
    Ok(backend.load(&world)?)
}

impl Configuration {
    fn count(&mut self, backend: &mut dyn Backend) -> Result<(), MeasureError> {
        for shot in &self.shots {
            let stats = backend.trace(shot)?;
            self.counts.counts.iter_mut().zip(stats.counts).for_each(|(sum, n)| *sum += n);
            self.counts.uncounted = stats.uncounted;
            self.counts.dispatches += stats.dispatches;
        }
        Ok(())
    }

    fn frame(&self, backend: &mut dyn Backend) -> Result<Frame, MeasureError> {
        let (started, before) = (Instant::now(), clock::of_process());
        let (mut trace, mut memory) = (Duration::ZERO, 0);
        for shot in &self.shots {
            let stats = backend.trace(shot)?;
            trace += stats.trace_time;
            memory = stats.memory;
        }
        let worked = clock::of_process().zip(before).map(|(after, before)| after.saturating_sub(before));
        Ok(Frame { trace, wall: started.elapsed(), worked, memory })
    }

    fn row(&self, unit: &Unit<'_>, loaded: &Loaded) -> Vec<Cell> {
        let milliseconds = |time: Duration| time.as_secs_f64() * 1e3;
        let trace: Vec<f64> = self.frames.iter().map(|frame| milliseconds(frame.trace)).collect();
        let worked: Vec<f64> = self.frames.iter().filter_map(|frame| frame.worked.map(milliseconds)).collect();
        let pixels = f64::from(unit.size[0]) * f64::from(unit.size[1]) * self.shots.len() as f64;
        // What a device's own traversal does is not known, which is not the same as nothing.
        let count = |what: u32| {
            let known = !self.counts.uncounted.contains(&what);
            known.then(|| self.counts.counts[what as usize] as f64)
        };
        let sum = |a: u32, b: u32| count(a).zip(count(b)).map(|(a, b)| a + b);
        let per_pixel = |n: Option<f64>| Cell::from(n.map(|n| n / pixels));
        let rays = sum(io::COUNT_RAYS, io::COUNT_SHADOW_RAYS);
        let segments = sum(io::COUNT_SEGMENTS, io::COUNT_SHADOW_SEGMENTS).filter(|n| *n > 0.0);
        let (median, worked_median) = (quantile(&trace, 0.5), quantile(&worked, 0.5));
        let per_segment = |ms: Option<f64>| Cell::from(ms.zip(segments).map(|(ms, segments)| ms * 1e6 / segments));
        let space = &unit.subject.scene.space;
        let mut row = unit.key(self.shots.len(), self.bounces);
        row.extend([
            (self.frames.len() as f64).into(),
            median.into(),
            quantile(&trace, 0.05).into(),
            quantile(&trace, 0.95).into(),
            self.first.map(|frame| milliseconds(frame.wall)).into(),
            worked_median.into(),
            quantile(&worked, 0.05).into(),
            quantile(&worked, 0.95).into(),
            median.filter(|ms| *ms > 0.0).map(|ms| 1e3 / ms).into(),
            per_pixel(count(io::COUNT_RAYS)),
            per_pixel(count(io::COUNT_SEGMENTS)),
            per_pixel(count(io::COUNT_BOUNCES)),
            per_pixel(count(io::COUNT_HITS)),
            per_pixel(count(io::COUNT_NODES)),
            per_pixel(sum(io::COUNT_TRIANGLES, io::COUNT_QUADRICS)),
            per_pixel(count(io::COUNT_TRIANGLES)),
            per_pixel(count(io::COUNT_QUADRICS)),
            per_pixel(count(io::COUNT_SHADOW_RAYS)),
            per_pixel(count(io::COUNT_SHADOW_SEGMENTS)),
            median.zip(rays).filter(|(ms, _)| *ms > 0.0).map(|(ms, rays)| rays / ms * 1e-3).into(),
            per_segment(median),
            per_segment(worked_median),
            self.frames.last().map(|frame| frame.memory as f64).into(),
            milliseconds(loaded.time).into(),
            space.name.as_str().into(),
            space.geometry.name().into(),
            (self.counts.dispatches as f64).into(),
        ]);
        row
    }
}

/// One value over the bounces: a row for each curve, a column for each number of bounces, and what the last is of the
/// first. What tells curves apart is shown where it does.
pub fn over_bounces(table: &Table, name: &str, about: &str, value: &str) -> Table {
    let curves = curves(table, value);
    let mut bounces: Vec<f64> = curves.iter().flat_map(|c| c.points.iter().map(|p| p.0)).collect();
    bounces.sort_by(f64::total_cmp);
    bounces.dedup();
    let (first, last) = (bounces.first().copied(), bounces.last().copied());
    let shown = telling(&curves);
    let mut columns: Vec<String> = shown.iter().map(|i| KEY[*i].to_owned()).collect();
    columns.extend(bounces.iter().map(f64::to_string));
    if let (Some(first), Some(last), true) = (first, last, bounces.len() > 1) {
        columns.push(format!("{last}/{first}"));
    }
    let mut pivot = Table { name: name.to_owned(), about: about.to_owned(), columns, rows: Vec::new() };
    for curve in &curves {
        let at = |bounces: f64| curve.points.iter().find(|p| p.0 == bounces).and_then(|p| p.1);
        let mut row: Vec<Cell> = shown.iter().map(|i| curve.key[*i].clone()).collect();
        row.extend(bounces.iter().map(|n| Cell::from(at(*n))));
        let ends = first.and_then(at).zip(last.and_then(at));
        row.push(ends.filter(|(first, _)| *first > 0.0).map(|(first, last)| last / first).into());
        row.truncate(pivot.columns.len());
        if row.iter().skip(shown.len()).any(|cell| *cell != Cell::Empty) {
            pivot.push(row);
        }
    }
    pivot
}

/// The plot of frame time over bounces, a curve for each scene, backend and way to draw, in the shape of the book's
/// Figures 4.6 and 5.4; of one scene if it is named.
pub fn plot(table: &Table, scene: Option<&str>) -> Plot {
    let mut curves = curves(table, "frame_ms_median");
    curves.retain(|curve| scene.is_none_or(|name| curve.key[0] == Cell::from(name)));
    let shown = telling(&curves);
    let series = curves.iter().map(|curve| {
        let words = shown.iter().filter(|i| **i > 0 || scene.is_none()).map(|i| match &curve.key[*i] {
            Cell::Text(text) => text.clone(),
            Cell::Number(x) => x.to_string(),
            Cell::Empty => String::new(),
        });
        let points = curve.points.iter().filter_map(|(x, y)| y.map(|y| [*x, y])).collect();
        Series { name: words.collect::<Vec<_>>().join(" "), points }
    });
    let series: Vec<Series> = series.collect();
    let height = 420.max(70 + 20 * series.len() as u32);
    Plot {
        title: format!("Frame time over bounces{}", scene.map_or(String::new(), |name| format!(": {name}"))),
        axes: [String::from("bounces"), String::from("ms per frame")],
        scale: Scale::Linear,
        series,
        size: [900, height],
    }
}

/// Values of rows that differ in bounces alone.
struct Curve {
    /// All of [`KEY`] but the bounces.
    key: Vec<Cell>,
    /// Bounces and values.
    points: Vec<(f64, Option<f64>)>,
}

fn curves(table: &Table, value: &str) -> Vec<Curve> {
    let mut curves: Vec<Curve> = Vec::new();
    for row in &table.rows {
        let (Some(Cell::Number(bounces)), Some(key)) = (row.get(KEY.len() - 1), row.get(..KEY.len() - 1)) else {
            continue;
        };
        let point = (*bounces, table.number(row, value));
        match curves.iter_mut().find(|curve| curve.key == key) {
            Some(curve) => curve.points.push(point),
            None => curves.push(Curve { key: key.to_vec(), points: vec![point] }),
        }
    }
    curves
}

/// Indices into [`KEY`] of scene and backend, and of what is not the same in all curves.
fn telling(curves: &[Curve]) -> Vec<usize> {
    let differs = |i: &usize| *i < 2 || curves.windows(2).any(|pair| pair[0].key[*i] != pair[1].key[*i]);
    (0..KEY.len() - 1).filter(differs).collect()
}
