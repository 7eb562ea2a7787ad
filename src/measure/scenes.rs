//! Error against run time of pictures, what leaving out saves, and step size against bounces.
//!
//! The reference of a picture is the cpu's with exact flows and a tolerance of [`REFERENCE`]; its own error is what twice
//! that tolerance changes.

use super::{
    MeasureError,
    backward::{RayErrors, ray_errors},
    picture::{distance_error, picture_error},
    report::{Cell, Table},
};
use crate::{
    geometry::{Geometry, Visitor, visit},
    integrate::Method,
    render::{
        Backend, Shot, Target,
        cpu::{CpuBackend, traverse::Tracer},
        plan::{Feature, Plan},
        world::World,
    },
    scene::{Scene, Shading},
    shader_io::{COUNT_RAYS, COUNT_SEGMENTS},
};
use std::{sync::Arc, time::Duration};

/// Tolerance of the reference, as a share of a pixel.
pub const REFERENCE: f64 = 1e-4;

/// Rays of which errors are measured: those through every so many pixels in both directions.
const STRIDE: u32 = 4;

/// Euler's longest step; each further one is half as long.
pub(super) const LONGEST: f64 = 0.1;

/// How a picture is drawn: a method and, for the exact flow, the tolerance of its segments.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setting {
    /// How rays are followed.
    pub method: Method,
    /// Largest deviation of a segment, as a share of a pixel.
    pub tolerance: f64,
}

impl Setting {
    /// The parameter of the method, or the tolerance.
    pub fn parameter(&self) -> f64 {
        if self.method == Method::Exact { self.tolerance } else { self.method.parameter() }
    }
}

/// The table of pictures, without rows.
pub fn picture_table() -> Table {
    let about = "pictures against a converged reference: share of pixels off by more than 2/255, RMSE (linear), FLIP, \
                 distance to the first hit, forward error (length) and backward error (pixels) of rays";
    let columns = [
        "scene",
        "backend",
        "integrator",
        "parameter",
        "ms",
        "segments per pixel",
        "off",
        "rmse",
        "flip",
        "distance median",
        "distance 99 %",
        "missed",
        "forward median",
        "forward 99 %",
        "backward median",
        "backward 99 %",
        "unresolved",
    ];
    Table::new("pictures", about, &columns)
}

/// What one setting gave.
#[derive(Clone, Debug)]
pub struct Sample {
    /// How it was drawn.
    pub setting: Setting,
    /// Milliseconds of a frame.
    pub milliseconds: f64,
    /// Segments of a primary ray.
    pub segments: f64,
    /// Share of the pixels that are off.
    pub off: f64,
}

/// A scene at a size, with what pictures of it are compared with.
pub struct Study<'a> {
    scene: &'a Scene,
    size: [u32; 2],
    color: Target,
    distance: Target,
    /// Share of the pixels that twice the reference's tolerance changes by more than 2/255.
    pub own_error: f64,
}

/// A picture, the milliseconds of a frame and the segments of a primary ray.
pub(super) struct Drawn {
    pub(super) target: Target,
    pub(super) milliseconds: f64,
    pub(super) segments: f64,
}

impl<'a> Study<'a> {
    /// Draws the references.
    ///
    /// # Errors
    /// The scene does not fit.
    pub fn new(scene: &'a Scene, size: [u32; 2]) -> Result<Self, MeasureError> {
        let mut cpu = CpuBackend::default();
        let exact = |tolerance| Setting { method: Method::Exact, tolerance };
        let mut draw = |tolerance, shading| draw(&mut cpu, scene, size, exact(tolerance), shading, false, 1);
        let color = draw(REFERENCE, Shading::Riemannian)?.target;
        let own_error = picture_error(&color, &draw(2.0 * REFERENCE, Shading::Riemannian)?.target).off;
        let distance = draw(REFERENCE, Shading::Distance)?.target;
        Ok(Self { scene, size, color, distance, own_error })
    }

    /// Measures one setting on one backend and appends a row.
    ///
    /// # Errors
    /// Failures of the backend.
    pub fn measure(
        &self,
        backend: &mut dyn Backend,
        setting: Setting,
        table: &mut Table,
    ) -> Result<Sample, MeasureError> {
        let color = draw(backend, self.scene, self.size, setting, Shading::Riemannian, false, 3)?;
        let distance = draw(backend, self.scene, self.size, setting, Shading::Distance, true, 1)?;
        let error = picture_error(&self.color, &color.target);
        let hits = distance_error(&self.distance, &distance.target);
        let on_cpu = backend.name() == CpuBackend::default().name();
        let rays = if on_cpu { Some(self.rays(setting)?) } else { None };
        let [forward, forward_most, backward, backward_most] = rays.as_ref().map_or([None; 4], RayErrors::summary);
        table.push(vec![
            self.scene.name.as_str().into(),
            backend.name().into(),
            setting.method.name().into(),
            setting.parameter().into(),
            color.milliseconds.into(),
            distance.segments.into(),
            error.off.into(),
            error.rmse.into(),
            error.flip.into(),
            hits.median.into(),
            hits.most.into(),
            hits.missed.into(),
            forward.into(),
            forward_most.into(),
            backward.into(),
            backward_most.into(),
            rays.map(|rays| rays.unresolved()).into(),
        ]);
        Ok(Sample { setting, milliseconds: color.milliseconds, segments: distance.segments, off: error.off })
    }

    /// Errors of rays, which only the cpu lets one look at.
    fn rays(&self, setting: Setting) -> Result<RayErrors, MeasureError> {
        let scene = with(self.scene, setting, Shading::Distance);
        let plan = Plan::new(&scene, false);
        let world = World::new(&scene, &plan, scene.observer.frame)?;
        let shot = Shot::symmetric(scene.observer.frame, scene.observer.fov, self.size);
        Ok(visit(scene.space.geometry, Rays { world: &world, shot: &shot }))
    }

    /// The settings of a backend: all on the cpu, where Euler's step is halved until fewer than a thousandth of the pixels
    /// are off or a frame takes longer than `limit`; a few elsewhere.
    ///
    /// # Errors
    /// Failures of the backend.
    pub fn sweep(
        &self,
        backend: &mut dyn Backend,
        limit: Duration,
        table: &mut Table,
        progress: &dyn Fn(f64),
    ) -> Result<Vec<Sample>, MeasureError> {
        let tolerance = self.scene.settings.tolerance;
        let exact = |tolerance| Setting { method: Method::Exact, tolerance };
        let other = |method| Setting { method, tolerance };
        let all = backend.name() == CpuBackend::default().name();
        let mut settings = vec![exact(tolerance)];
        if all {
            settings.extend([2.0, 0.5, 0.1, 0.03, 3e-3, 1e-3].map(exact));
            settings.extend([0.2, 0.1, 0.05, 0.02, 0.01].map(|step| other(Method::Rk4 { step })));
            settings.extend([1e-3, 1e-4, 1e-5, 1e-6, 1e-7].map(|tolerance| other(Method::Dopri5 { tolerance })));
        } else {
            settings.extend([
                other(Method::Rk4 { step: 0.05 }),
                other(Method::Dopri5 { tolerance: 1e-5 }),
                other(Method::Euler { step: LONGEST }),
                other(Method::Euler { step: LONGEST / 8.0 }),
            ]);
        }
        let mut samples = Vec::new();
        for (index, setting) in settings.iter().enumerate() {
            progress(index as f64 / (2 * settings.len()) as f64);
            samples.push(self.measure(backend, *setting, table)?);
        }
        let mut step = LONGEST;
        for halvings in 0..12 {
            if !all {
                break;
            }
            progress(0.5 + 0.5 * f64::from(halvings) / 12.0);
            let sample = self.measure(backend, other(Method::Euler { step }), table)?;
            let done = sample.off < 1e-3 || sample.milliseconds > limit.as_secs_f64() * 1e3;
            samples.push(sample);
            if done {
                break;
            }
            step *= 0.5;
        }
        Ok(samples)
    }
}

struct Rays<'a> {
    world: &'a World,
    shot: &'a Shot,
}

impl Visitor for Rays<'_> {
    type Output = RayErrors;
    fn visit<G: Geometry>(self, geometry: G) -> RayErrors {
        let tracer = Tracer::new(geometry, self.world, self.shot);
        ray_errors(geometry, &tracer, self.shot.size, STRIDE)
    }
}

/// The scene with another setting and shading.
fn with(scene: &Scene, setting: Setting, shading: Shading) -> Scene {
    let mut scene = scene.clone();
    scene.settings.method = setting.method;
    scene.settings.tolerance = setting.tolerance;
    scene.settings.shading = shading;
    scene
}

/// Draws a picture once to fill caches where several are asked for, and then `times` times: the fastest counts.
pub(super) fn draw(
    backend: &mut dyn Backend,
    scene: &Scene,
    size: [u32; 2],
    setting: Setting,
    shading: Shading,
    count: bool,
    times: u32,
) -> Result<Drawn, MeasureError> {
    let scene = with(scene, setting, shading);
    draw_planned(backend, &scene, &Plan::new(&scene, count), size, times)
}

fn draw_planned(
    backend: &mut dyn Backend,
    scene: &Scene,
    plan: &Plan,
    size: [u32; 2],
    times: u32,
) -> Result<Drawn, MeasureError> {
    let world = Arc::new(World::new(scene, plan, scene.observer.frame)?);
    backend.load(&world)?;
    let shot = Shot::symmetric(scene.observer.frame, scene.observer.fov, size);
    let mut target = Target::new(size);
    let mut best: Option<Duration> = None;
    let mut segments = 0.0;
    for turn in 0..times {
        let stats = backend.render(&shot, &mut target, &|_| ())?;
        let rays = stats.counts[COUNT_RAYS as usize].max(1) as f64;
        segments = stats.counts[COUNT_SEGMENTS as usize] as f64 / rays;
        best = Some(best.map_or(stats.trace_time, |best| best.min(stats.trace_time)));
        // Long frames are timed well enough by one.
        if turn == 0 && stats.trace_time > Duration::from_secs(1) {
            break;
        }
    }
    Ok(Drawn { target, milliseconds: best.unwrap_or_default().as_secs_f64() * 1e3, segments })
}

/// The table of factors, without rows.
pub fn factor_table() -> Table {
    let about = "the default against Euler's method, the book's, at equal error of the picture (share of pixels off by \
                 more than 2/255), in this run: time of Euler at the step that reaches the error (between measured steps in \
                 proportion of logarithms), of exact flows at the tolerance that does, and of the default setting; segments of a \
                 primary ray likewise";
    let columns = [
        "scene",
        "backend",
        "error",
        "euler step",
        "euler ms",
        "exact tolerance",
        "exact ms",
        "factor",
        "euler segments per pixel",
        "exact segments per pixel",
        "segments factor",
        "default ms",
        "default error",
        "default factor",
        "note",
    ];
    Table::new("factor", about, &columns)
}

/// Where a ladder of settings reaches an error.
struct Reached {
    /// Whether it does; if not, the rest is that of its finest setting.
    yes: bool,
    parameter: f64,
    milliseconds: f64,
    segments: f64,
}

/// Where a ladder of settings of one method reaches an error: where the error, made to fall with the parameter, crosses it.
fn reach(samples: &[&Sample], error: f64) -> Option<Reached> {
    let mut sorted = samples.to_vec();
    sorted.sort_by(|a, b| b.setting.parameter().total_cmp(&a.setting.parameter()));
    // The first setting from which on all finer ones keep the error, and the last that does not.
    let first = sorted.iter().rposition(|s| s.off > error).map_or(0, |last| last + 1);
    let yes = first < sorted.len();
    let fine = sorted.get(first).or(sorted.last())?;
    let coarse = first.checked_sub(1).and_then(|i| sorted.get(i)).unwrap_or(fine);
    let [low, high] = [fine.off.max(1e-6), coarse.off.max(1e-6)].map(f64::ln);
    let share = if high > low { ((error.ln() - low) / (high - low)).clamp(0.0, 1.0) } else { 0.0 };
    let between = |of: fn(&Sample) -> f64| (of(fine).ln() + share * (of(coarse).ln() - of(fine).ln())).exp();
    Some(Reached {
        yes,
        parameter: between(|s| s.setting.parameter()),
        milliseconds: between(|s| s.milliseconds),
        segments: between(|s| s.segments),
    })
}

/// Appends the factors of a scene: exact flows, and the default setting, against Euler at errors of 1 % and 0.1 %.
pub fn factors(scene: &Scene, backend: &str, samples: &[Sample], table: &mut Table) {
    let of = |name: &str| samples.iter().filter(|s| s.setting.method.name() == name).collect::<Vec<_>>();
    let (euler, exact) = (of("euler"), of(Method::Exact.name()));
    let default = exact.iter().find(|s| s.setting.tolerance == scene.settings.tolerance);
    for error in [1e-2, 1e-3] {
        let (Some(slow), Some(quick)) = (reach(&euler, error), reach(&exact, error)) else { continue };
        let note = match (slow.yes, quick.yes) {
            (true, true) => "",
            (false, true) => "Euler's finest step does not reach the error: at least",
            _ => "exact flows do not reach the error at the tolerances tried",
        };
        let own = default.filter(|d| d.off <= error).map(|d| slow.milliseconds / d.milliseconds);
        table.push(vec![
            scene.name.as_str().into(),
            backend.into(),
            error.into(),
            slow.parameter.into(),
            slow.milliseconds.into(),
            quick.parameter.into(),
            quick.milliseconds.into(),
            (slow.milliseconds / quick.milliseconds).into(),
            slow.segments.into(),
            quick.segments.into(),
            (slow.segments / quick.segments).into(),
            default.map(|d| d.milliseconds).into(),
            default.map(|d| d.off).into(),
            own.into(),
            note.into(),
        ]);
    }
}

/// The table of step size against bounces, without rows.
pub fn bounce_table() -> Table {
    let about = "step size against bounces, as in the book's Figure 5.5, each against the reference of as many bounces";
    Table::new("bounces", about, &["scene", "bounces", "integrator", "parameter", "ms", "off", "rmse", "flip"])
}

/// Draws a scene with 3, 6 and 10 bounces by Euler's method with steps from coarse to fine and by the rest, and returns
/// the pictures: a column for each number of bounces, a row for each setting, the reference last.
///
/// # Errors
/// The scene does not fit.
pub fn step_against_bounces(
    scene: &Scene,
    size: [u32; 2],
    table: &mut Table,
    progress: &dyn Fn(f64),
) -> Result<Target, MeasureError> {
    let other = |method| Setting { method, tolerance: scene.settings.tolerance };
    let mut settings: Vec<Setting> = [0.2, 0.1, 0.05, 0.01].map(|step| other(Method::Euler { step })).into();
    settings.push(other(Method::Rk4 { step: 0.1 }));
    settings.push(other(Method::Dopri5 { tolerance: 1e-5 }));
    settings.push(other(Method::Exact));
    let columns = [3, 6, 10];
    let mut sheet = Target::new([size[0] * columns.len() as u32, size[1] * (settings.len() as u32 + 1)]);
    let mut cpu = CpuBackend::default();
    for (column, bounces) in (0..).zip(columns) {
        let mut seen = scene.clone();
        seen.settings.bounces = bounces;
        let finest = Setting { method: Method::Exact, tolerance: 10.0 * REFERENCE };
        let reference = draw(&mut cpu, &seen, size, finest, Shading::Riemannian, false, 1)?.target;
        for (row, setting) in (0..).zip(&settings) {
            progress((column as f64 + row as f64 / settings.len() as f64) / columns.len() as f64);
            let drawn = draw(&mut cpu, &seen, size, *setting, Shading::Riemannian, false, 1)?;
            let error = picture_error(&reference, &drawn.target);
            table.push(vec![
                scene.name.as_str().into(),
                f64::from(bounces).into(),
                setting.method.name().into(),
                setting.parameter().into(),
                drawn.milliseconds.into(),
                error.off.into(),
                error.rmse.into(),
                error.flip.into(),
            ]);
            sheet.paste(&drawn.target, [column * size[0], row * size[1]]);
        }
        sheet.paste(&reference, [column * size[0], settings.len() as u32 * size[1]]);
    }
    Ok(sheet)
}

/// The table of what is left out, without rows.
pub fn leave_out_table() -> Table {
    let about = "what scenes leave out because they do not need it, and the time of a frame with it kept in";
    let columns = ["scene", "backend", "part", "because", "what goes with it", "left out ms", "kept in ms", "ratio"];
    Table::new("leave-out", about, &columns)
}

/// Stages, constants, buffers and structures that exist for a feature alone.
fn belongings(feature: Feature) -> &'static str {
    match feature {
        Feature::Meshes => "triangle tests and hit group, constant meshes, triangle buffers, triangle structures",
        Feature::Quadrics => "intersection stage and hit group, constant quadrics, quadric buffers, box structures",
        Feature::AlphaMask => "any-hit stage, constant alpha_mask",
        Feature::Textures => "texture lookups, constant textures, texel and texture buffers",
        Feature::Lights => "loop over lights, constant lights, buffer of light images",
        Feature::Shadows => "shadow rays with their miss stage, constant shadows",
        Feature::Headlight => "light at the viewer, constant headlight",
        Feature::Fog => "fog, constant fog",
        Feature::MaxDistance => "test against the largest length, constant max_distance",
        Feature::Lengths => "length of rays, constant lengths",
        Feature::Labels => "automaton of deck elements, constant labels, its table",
        Feature::Coordinates => "colours by place, constant coordinates",
        Feature::Counters => "counting of work, constant counters, its buffer",
    }
}

/// Measures a scene with each of the parts that it leaves out kept in.
///
/// # Errors
/// Failures of the backend.
pub fn leave_out(
    scene: &Scene,
    size: [u32; 2],
    backend: &mut dyn Backend,
    table: &mut Table,
    progress: &dyn Fn(f64),
) -> Result<(), MeasureError> {
    let plan = Plan::new(scene, false);
    let unneeded: Vec<_> = plan.decisions.iter().filter(|d| !d.needed).copied().collect();
    for (index, decision) in unneeded.iter().enumerate() {
        progress(index as f64 / unneeded.len() as f64);
        let feature = decision.feature;
        let mut time = |plan: &Plan| draw_planned(backend, scene, plan, size, 3).map(|drawn| drawn.milliseconds);
        // One after the other, so that what else the machine does falls on both.
        let (out, kept) = (time(&plan)?, time(&plan.clone().keep(&[feature]))?);
        table.push(vec![
            scene.name.as_str().into(),
            backend.name().into(),
            feature.name().into(),
            decision.reason.into(),
            belongings(feature).into(),
            out.into(),
            kept.into(),
            Cell::Number(kept / out),
        ]);
    }
    Ok(())
}
