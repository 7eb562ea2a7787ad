//! Whether the default setting of a scene is converged, and what fixed steps need instead.
//!
//! A setting is converged where halving its tolerance or step changes next to nothing of the picture. Beside the default
//! stand the fixed steps: of Euler's method, the book's, at the finest step whose frame takes no longer than a limit, and of
//! `rk4` at the longest step whose picture is as good as the default's.

use super::{
    MeasureError,
    picture::picture_error,
    report::{Cell, Table},
    scenes::{LONGEST, REFERENCE, Setting, draw},
};
use crate::{
    integrate::Method,
    render::{Target, cpu::CpuBackend},
    scene::{Scene, Shading},
};
use std::time::Duration;

/// The table, without rows.
pub fn table() -> Table {
    let about = "convergence on the cpu: share of the pixels that halving the parameter changes by more than 2/255, share off \
                 by as much from the reference, segments against those of the default";
    let columns = [
        "scene",
        "geometry",
        "integrator",
        "parameter",
        "ms",
        "segments per pixel",
        "halved ms",
        "halved segments per pixel",
        "changed by halving",
        "off",
        "segments against default",
    ];
    Table::new("convergence", about, &columns)
}

/// A picture by one setting.
struct Picture {
    setting: Setting,
    target: Target,
    milliseconds: f64,
    segments: f64,
    off: f64,
}

/// Pictures of a scene on the cpu.
struct Painter<'a> {
    scene: &'a Scene,
    size: [u32; 2],
    cpu: CpuBackend,
    reference: Target,
}

impl<'a> Painter<'a> {
    fn new(scene: &'a Scene, size: [u32; 2]) -> Result<Self, MeasureError> {
        let mut cpu = CpuBackend::default();
        let finest = Setting { method: Method::Exact, tolerance: REFERENCE };
        let reference = draw(&mut cpu, scene, size, finest, Shading::Riemannian, true, 1)?.target;
        Ok(Self { scene, size, cpu, reference })
    }

    fn paint(&mut self, method: Method, tolerance: f64) -> Result<Picture, MeasureError> {
        let setting = Setting { method, tolerance };
        let drawn = draw(&mut self.cpu, self.scene, self.size, setting, Shading::Riemannian, true, 2)?;
        let off = picture_error(&self.reference, &drawn.target).off;
        let (milliseconds, segments) = (drawn.milliseconds, drawn.segments);
        Ok(Picture { setting, target: drawn.target, milliseconds, segments, off })
    }

    fn row(&self, picture: &Picture, halved: Option<&Picture>, default: f64) -> Vec<Cell> {
        let changed = halved.map(|halved| picture_error(&halved.target, &picture.target).off);
        vec![
            self.scene.name.as_str().into(),
            self.scene.space.geometry.name().into(),
            picture.setting.method.name().into(),
            picture.setting.parameter().into(),
            picture.milliseconds.into(),
            picture.segments.into(),
            halved.map(|halved| halved.milliseconds).into(),
            halved.map(|halved| halved.segments).into(),
            changed.into(),
            picture.off.into(),
            (picture.segments / default).into(),
        ]
    }
}

/// Measures a scene and appends its rows.
///
/// # Errors
/// The scene does not fit.
pub fn measure(
    scene: &Scene,
    size: [u32; 2],
    limit: Duration,
    table: &mut Table,
    progress: &dyn Fn(f64),
) -> Result<(), MeasureError> {
    let mut painter = Painter::new(scene, size)?;
    let tolerance = scene.settings.tolerance;
    progress(0.2);
    let default = painter.paint(Method::Exact, tolerance)?;
    let halved = painter.paint(Method::Exact, 0.5 * tolerance)?;
    table.push(painter.row(&default, Some(&halved), default.segments));
    progress(0.4);
    // The finest of Euler's steps that has the time, with its half.
    let mut step = LONGEST;
    let mut coarse = painter.paint(Method::Euler { step }, tolerance)?;
    loop {
        step *= 0.5;
        let fine = painter.paint(Method::Euler { step }, tolerance)?;
        if fine.milliseconds > limit.as_secs_f64() * 1e3 {
            table.push(painter.row(&coarse, Some(&fine), default.segments));
            break;
        }
        coarse = fine;
    }
    progress(0.8);
    for step in [0.4, 0.2, 0.1, 0.05, 0.025] {
        let picture = painter.paint(Method::Rk4 { step }, tolerance)?;
        if picture.off <= default.off || step == 0.025 {
            let halved = painter.paint(Method::Rk4 { step: 0.5 * step }, tolerance)?;
            table.push(painter.row(&picture, Some(&halved), default.segments));
            break;
        }
    }
    Ok(())
}
