//! The report of error against run time: tables and plots of [`geodesics`] and [`scenes`].

use super::{
    MeasureError, convergence, geodesics,
    plot::{Plot, Series},
    report::{Cell, Table},
    scenes::{self, Study},
};
use crate::{
    geometry::GeometryId,
    render::{Backend, Target, compute::probe::Probe},
    scene::Scene,
    vulkan::Context,
};
use std::{sync::Arc, time::Duration};

/// What to measure.
pub struct Request<'a> {
    /// Model geometries.
    pub geometries: &'a [GeometryId],
    /// Scenes.
    pub scenes: &'a [Scene],
    /// A scene to vary the bounces of.
    pub figure: Option<&'a Scene>,
    /// Scenes whose default is checked for convergence.
    pub converged: &'a [Scene],
    /// Whether to measure what scenes leave out.
    pub leave_out: bool,
    /// Size of the pictures.
    pub size: [u32; 2],
    /// Frames of Euler's method that take longer end its series.
    pub limit: Duration,
    /// The device for geodesics, if there is one.
    pub device: Option<&'a Arc<Context>>,
}

/// What was measured.
#[derive(Default)]
pub struct Findings {
    /// The tables that have rows.
    pub tables: Vec<Table>,
    /// Plots with the stems of their files' names.
    pub plots: Vec<(String, Plot)>,
    /// The pictures of step size against bounces.
    pub sheet: Option<Target>,
}

/// Measures. `progress` gets what is being measured and the share of everything that is done.
///
/// # Errors
/// Failures of backends, and scenes that do not fit.
pub fn measure(
    request: &Request<'_>,
    backends: &mut [Box<dyn Backend>],
    progress: &dyn Fn(&str, f64),
) -> Result<Findings, MeasureError> {
    let mut findings = Findings::default();
    let (mut work, mut reference) = (geodesics::work_table(), geodesics::reference_table());
    let (mut pictures, mut factor, mut bounces) =
        (scenes::picture_table(), scenes::factor_table(), scenes::bounce_table());
    let (mut left_out, mut own) = (scenes::leave_out_table(), own_table());
    // Scenes take some ten times as long as geometries.
    let total = request.geometries.len() as f64
        + 10.0 * (request.scenes.len() + request.converged.len() + usize::from(request.figure.is_some())) as f64;
    let mut done = 0.0;
    for &id in request.geometries {
        let share = |s: f64| progress(id.name(), (done + s) / total);
        let mut probe = request.device.map(|context| Probe::new(context, id)).transpose()?;
        geodesics::measure(id, probe.as_mut(), &mut work, &mut reference, &share)?;
        findings.plots.push((format!("geodesics-{}", id.name()), geodesic_plot(&work, id.name())));
        done += 1.0;
    }
    for scene in request.scenes {
        let study = Study::new(scene, request.size)?;
        own.push(vec![scene.name.as_str().into(), scenes::REFERENCE.into(), study.own_error.into()]);
        let count = backends.len() as f64;
        for (index, backend) in backends.iter_mut().enumerate() {
            let share = |s: f64| progress(&scene.name, (done + 8.0 * (index as f64 + s) / count) / total);
            let samples = study.sweep(backend.as_mut(), request.limit, &mut pictures, &share)?;
            scenes::factors(scene, backend.name(), &samples, &mut factor);
        }
        if request.leave_out {
            for (index, backend) in backends.iter_mut().enumerate() {
                let share = |s: f64| progress(&scene.name, (done + 8.0 + 2.0 * (index as f64 + s) / count) / total);
                scenes::leave_out(scene, request.size, backend.as_mut(), &mut left_out, &share)?;
            }
        }
        findings.plots.push((format!("pictures-{}", scene.name), picture_plot(&pictures, &scene.name)));
        done += 10.0;
    }
    if let Some(scene) = request.figure {
        let share = |s: f64| progress(&scene.name, (done + 10.0 * s) / total);
        findings.sheet = Some(scenes::step_against_bounces(scene, request.size, &mut bounces, &share)?);
        done += 10.0;
    }
    let mut converged = convergence::table();
    for scene in request.converged {
        done += 10.0;
        let share = |s: f64| progress(&scene.name, (done - 10.0 + 10.0 * s) / total);
        convergence::measure(scene, request.size, request.limit, &mut converged, &share)?;
    }
    let tables = [work, reference, pictures, own, factor, converged, bounces, left_out];
    findings.tables = tables.into_iter().filter(|table| !table.rows.is_empty()).collect();
    Ok(findings)
}

fn own_table() -> Table {
    let about = "the references of the pictures: exact flows in f64 on the cpu with this tolerance (share of a pixel), and the \
                 share of the pixels that twice the tolerance changes by more than 2/255";
    Table::new("picture-reference", about, &["scene", "tolerance", "own error"])
}

/// A name with points and the parameters that they belong to.
type Ladder = (String, Vec<(f64, [f64; 2])>);

/// The numbers of two columns in the rows whose words are the given ones, a series for each combination of the words in
/// `by`.
fn series(table: &Table, fixed: (&str, &str), by: &[&str], axes: [&str; 2]) -> Vec<Series> {
    let column = |name: &str| table.columns.iter().position(|c| c == name);
    let word = |row: &Vec<Cell>, name: &str| match column(name).and_then(|i| row.get(i)) {
        Some(Cell::Text(text)) => text.clone(),
        _ => String::new(),
    };
    let number = |row: &Vec<Cell>, name: &str| match column(name).and_then(|i| row.get(i)) {
        Some(Cell::Number(x)) => *x,
        _ => f64::NAN,
    };
    let mut found: Vec<Ladder> = Vec::new();
    for row in table.rows.iter().filter(|row| word(row, fixed.0) == fixed.1) {
        let name = by.iter().map(|name| word(row, name)).collect::<Vec<_>>().join(" ");
        let place = (number(row, "parameter"), axes.map(|axis| number(row, axis)));
        match found.iter_mut().find(|(known, _)| *known == name) {
            Some((_, points)) => points.push(place),
            None => found.push((name, vec![place])),
        }
    }
    // From coarse to fine.
    let ordered = |(name, mut points): Ladder| {
        points.sort_by(|a, b| b.0.total_cmp(&a.0));
        Series { name, points: points.into_iter().map(|(_, point)| point).collect() }
    };
    found.into_iter().map(ordered).collect()
}

/// Size of plots in pixels.
const SIZE: [u32; 2] = [760, 420];

fn geodesic_plot(table: &Table, geometry: &str) -> Plot {
    let by = ["integrator", "backend", "precision"];
    let mut series = series(table, ("geometry", geometry), &by, ["ns per length", "error worst"]);
    // What has no error at all is drawn at the rounding of f64.
    series.iter_mut().flat_map(|s| &mut s.points).filter(|p| p[1] < 1e-17).for_each(|p| p[1] = 1e-17);
    Plot {
        title: format!("Geodesics of {geometry}: error of the end against time"),
        axes: [String::from("ns per unit length"), String::from("largest error of end points")],
        series,
        size: SIZE,
    }
}

fn picture_plot(table: &Table, scene: &str) -> Plot {
    let mut series = series(table, ("scene", scene), &["integrator", "backend"], ["ms", "off"]);
    // No pixel off is drawn below one in a hundred thousand.
    series.iter_mut().flat_map(|s| &mut s.points).filter(|p| p[1] < 1e-5).for_each(|p| p[1] = 1e-5);
    Plot {
        title: format!("{scene}: error of the picture against time"),
        axes: [String::from("ms per frame"), String::from("share of pixels off by more than 2/255")],
        series,
        size: SIZE,
    }
}
