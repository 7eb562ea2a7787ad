//! Work and precision of integrators in the model geometries: errors of end points against time per unit length.
//!
//! The reference is Dormand and Prince's method in 106 bits ([`Double`]) with a tolerance of [`FINE`], an evaluation that
//! shares nothing with the closed forms but the equation of geodesics, which the laws check. Its own error is what a
//! tolerance ten times as large changes.

use super::{
    MeasureError,
    double::Double,
    quantile,
    report::{Cell, Table},
};
use crate::{
    geometry::{Elementary, Geodesic, Geometry, GeometryId, Visitor, exponential, visit},
    integrate::{Dopri5, Method, follow, march},
    render::{compute::probe::Probe, plan::integrator_number},
    shader_io::{PROBE_FLOW, PROBE_FOLLOW, ProbeIn},
};
use glam::{DVec3, DVec4, Vec4};
use std::time::{Duration, Instant};

/// Geodesics of each geometry.
const COUNT: usize = 12;

/// Their length where the chart holds them, else the shorter one.
const LENGTHS: [f64; 2] = [3.0, 1.0];

/// Tolerance of the reference.
pub const FINE: f64 = 1e-17;

/// Copies of the geodesics that a device follows at once, so that it is busy.
const COPIES: usize = 64;

/// Time for which each row is measured at least.
const PATIENCE: Duration = Duration::from_millis(15);

/// The methods, from quick to exact.
pub fn ladder() -> Vec<Method> {
    let steps = |steps: &'static [f64]| steps.iter().copied();
    let euler = steps(&[0.2, 0.1, 0.05, 0.02, 0.01, 0.005, 0.002, 0.001]).map(|step| Method::Euler { step });
    let rk4 = steps(&[0.5, 0.2, 0.1, 0.05, 0.02, 0.01]).map(|step| Method::Rk4 { step });
    let dopri5 = steps(&[1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13]).map(|tolerance| Method::Dopri5 { tolerance });
    [Method::Exact].into_iter().chain(euler).chain(rk4).chain(dopri5).collect()
}

/// The table of work and precision, without rows.
pub fn work_table() -> Table {
    let about = "errors of end points (length in the metric, against a reference of 106 bits) and time per unit length";
    let columns = [
        "geometry",
        "backend",
        "precision",
        "integrator",
        "parameter",
        "error median",
        "error worst",
        "ns per length",
        "steps per length",
        "refused",
    ];
    Table::new("geodesics", about, &columns)
}

/// The table of the reference's own errors, without rows.
pub fn reference_table() -> Table {
    let about =
        "the reference: what a tolerance ten times as large changes, and what the closed form in f64 differs by";
    Table::new(
        "reference",
        about,
        &["geometry", "length", "geodesics", "own error", "closed form median", "closed form worst"],
    )
}

/// Measures one geometry on the cpu and, where there is a device, by the probe; appends rows to both tables.
///
/// # Errors
/// Failures of the device.
pub fn measure(
    id: GeometryId,
    probe: Option<&mut Probe>,
    work: &mut Table,
    reference: &mut Table,
    progress: &dyn Fn(f64),
) -> Result<(), MeasureError> {
    visit(id, Measure { id, probe, work, reference, progress })
}

struct Measure<'a> {
    id: GeometryId,
    probe: Option<&'a mut Probe>,
    work: &'a mut Table,
    reference: &'a mut Table,
    progress: &'a dyn Fn(f64),
}

/// Geodesics with their exact ends.
struct Cases {
    starts: Vec<Geodesic>,
    ends: Vec<Geodesic>,
    length: f64,
}

impl Visitor for Measure<'_> {
    type Output = Result<(), MeasureError>;

    fn visit<G: Geometry>(self, geometry: G) -> Self::Output {
        let Self { id, probe, work, reference, progress } = self;
        let cases = cases(geometry, reference, id);
        let methods = ladder();
        let mut probe = probe;
        for (index, method) in methods.iter().enumerate() {
            progress(index as f64 / methods.len() as f64);
            let mut row = |backend: &str, precision: &str, run: Run| {
                let errors: Vec<f64> = run
                    .ends
                    .iter()
                    .zip(&cases.ends)
                    .filter_map(|(found, exact)| found.map(|found| miss(geometry, *exact, found)))
                    .collect();
                let parameter = if *method == Method::Exact { Cell::Empty } else { method.parameter().into() };
                work.push(vec![
                    id.name().into(),
                    backend.into(),
                    precision.into(),
                    method.name().into(),
                    parameter,
                    quantile(&errors, 0.5).into(),
                    quantile(&errors, 1.0).into(),
                    run.nanoseconds.into(),
                    run.steps.into(),
                    ((cases.ends.len() - errors.len()) as f64).into(),
                ]);
            };
            row("cpu", "f64", on_cpu::<f64, G>(geometry, *method, &cases));
            // Below this the tolerance is one of f64.
            let single = !matches!(method, Method::Dopri5 { tolerance } if *tolerance < 1e-7);
            if single {
                row("cpu", "f32", on_cpu::<f32, G>(geometry, *method, &cases));
            }
            if let (true, Some(probe)) = (single, probe.as_mut()) {
                row("compute", "f32", on_device(probe, *method, &cases)?);
            }
        }
        Ok(())
    }
}

/// Geodesics of moderate directions near the base point, and their ends by the reference.
fn cases<G: Geometry>(geometry: G, reference: &mut Table, id: GeometryId) -> Cases {
    let base = geometry.base();
    // A lattice of directions: the same in every run, none special.
    let direction = |p: DVec4, k: usize| {
        let share = |step: f64| 2.0 * ((k as f64 + 0.5) * step).fract() - 1.0;
        let [x, y, z] = geometry.frame(p);
        let v = x * share(0.819_172_513_396_164_4)
            + y * share(0.671_043_606_703_789_3)
            + z * share(0.549_700_477_901_970_2);
        v / geometry.norm(p, v)
    };
    let start = |k: usize| {
        let point = exponential(geometry, base, direction(base, k + COUNT) * (0.2 * k as f64 / COUNT as f64));
        Geodesic { point, velocity: direction(point, k) }
    };
    let starts: Vec<Geodesic> = (0..COUNT).map(start).collect();
    // The chart shows a way whose points come back from it.
    let shown = |length: f64| {
        starts.iter().all(|g| {
            (1..=16).all(|k| {
                let t = length * 1.1 * f64::from(k) / 16.0;
                let p = geometry.flow(*g, t).point;
                let back = geometry.unchart(geometry.chart(p));
                geometry.edge(*g, t).is_none()
                    && back.is_some_and(|q| (q - p).abs().max_element() < 1e-6 * (1.0 + p.abs().max_element()))
            })
        })
    };
    let length = LENGTHS.into_iter().find(|length| shown(*length)).unwrap_or(0.5);
    let by = |tolerance: f64, g: &Geodesic| {
        let arrival = march::<Double, _, _>(geometry, Dopri5 { tolerance }, *g, length);
        // It stays in the chart, as was just seen.
        arrival.map_or_else(|_| geometry.flow(*g, length), |arrival| arrival.end)
    };
    let ends: Vec<Geodesic> = starts.iter().map(|g| by(FINE, g)).collect();
    let own = starts.iter().zip(&ends).map(|(g, end)| miss(geometry, *end, by(10.0 * FINE, g))).fold(0.0, f64::max);
    let closed: Vec<f64> =
        starts.iter().zip(&ends).map(|(g, end)| miss(geometry, *end, geometry.flow(*g, length))).collect();
    reference.push(vec![
        id.name().into(),
        length.into(),
        (COUNT as f64).into(),
        own.into(),
        quantile(&closed, 0.5).into(),
        quantile(&closed, 1.0).into(),
    ]);
    Cases { starts, ends, length }
}

/// Distance of two ends, to first order, in the metric at the first.
fn miss<G: Geometry>(geometry: G, exact: Geodesic, found: Geodesic) -> f64 {
    let way: DVec3 = geometry.chart(found.point) - geometry.chart(exact.point);
    geometry.norm(exact.point, geometry.unchart_vector(exact.point, way))
}

/// Ends and cost of one method.
struct Run {
    ends: Vec<Option<Geodesic>>,
    nanoseconds: f64,
    steps: Option<f64>,
}

fn on_cpu<T: Elementary, G: Geometry>(geometry: G, method: Method, cases: &Cases) -> Run {
    let run =
        || cases.starts.iter().map(|g| follow::<T, G>(geometry, method, *g, cases.length).ok()).collect::<Vec<_>>();
    let began = Instant::now();
    let arrivals = run();
    let mut passes = 1.0;
    while began.elapsed() < PATIENCE {
        std::hint::black_box(run());
        passes += 1.0;
    }
    let units = passes * cases.length * cases.starts.len() as f64;
    let steps: u64 = arrivals.iter().flatten().map(|a| a.steps).sum();
    Run {
        nanoseconds: began.elapsed().as_secs_f64() * 1e9 / units,
        steps: (method != Method::Exact).then(|| steps as f64 / (cases.length * cases.starts.len() as f64)),
        ends: arrivals.into_iter().map(|a| a.map(|a| a.end).filter(|end| end.point.is_finite())).collect(),
    }
}

fn on_device(probe: &mut Probe, method: Method, cases: &Cases) -> Result<Run, MeasureError> {
    let single = |v: DVec4| v.as_vec4().to_array();
    let input = |g: &Geodesic| ProbeIn {
        a: single(g.point),
        b: single(g.velocity),
        c: [integrator_number(method) as f32, method.parameter() as f32, 0.0, 0.0],
        t: cases.length as f32,
        op: if method == Method::Exact { PROBE_FLOW } else { PROBE_FOLLOW },
    };
    let inputs: Vec<ProbeIn> = (0..COPIES).flat_map(|_| cases.starts.iter().map(input)).collect();
    // The first run compiles and fills caches.
    let found = probe.run(&inputs)?;
    let began = Instant::now();
    probe.run(&inputs)?;
    let nanoseconds = began.elapsed().as_secs_f64() * 1e9 / (inputs.len() as f64 * cases.length);
    let ends = found[..cases.starts.len()].iter().map(|out| {
        let double = |v: [f32; 4]| Vec4::from(v).as_dvec4();
        let end = Geodesic { point: double(out.a), velocity: double(out.b) };
        end.point.is_finite().then_some(end)
    });
    Ok(Run { ends: ends.collect(), nanoseconds, steps: None })
}
