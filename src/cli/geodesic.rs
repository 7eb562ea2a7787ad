//! `holonomy geodesic`: the end of a geodesic in a model geometry.

use super::{
    BackendChoice, Failure, GeodesicArgs, Integrator, Outcome, Precision,
    batch::{self, Case},
    print_line,
};
use crate::{
    geometry::{Geodesic, Geometry, GeometryError, GeometryId, Visitor, settle_geodesic, visit},
    integrate::{Method, Stop, follow, resolves},
    render::{compute::probe::Probe, plan::integrator_number},
    shader_io::{PROBE_FLOW, PROBE_FOLLOW, ProbeIn},
    vulkan::{Context, ContextOptions},
};
use anyhow::anyhow;
use glam::{DVec4, Vec4};
use serde_json::{Value, json};
use std::{collections::HashMap, io::stdout, sync::Arc};

/// A case that has been checked.
#[derive(Clone, Copy)]
struct Job {
    geometry: GeometryId,
    start: Geodesic,
    length: f64,
}

pub(super) fn run(args: &GeodesicArgs) -> Outcome {
    if let (Integrator::Exact, Some(_)) = (args.integrator, args.tolerance) {
        return Err(Failure::refused(anyhow!("--tolerance needs --integrator dopri5")));
    }
    let mut engine = Engine::new(args)?;
    if let Some(path) = &args.start.batch {
        return batch::run(path, |lines| {
            let jobs = lines.into_iter().map(|line| line.and_then(|value| job_from_json(&value))).collect();
            let ends = engine.flow(jobs)?;
            Ok(ends.into_iter().map(|end| end.map(|(id, g)| end_json(id, g))).collect())
        });
    }
    let missing = |what: &str| Failure::refused(anyhow!("{what} is missing (or use --batch)"));
    let geometry = args.geometry.as_deref().ok_or_else(|| missing("--geometry"))?;
    let from = args.start.from.as_ref().ok_or_else(|| missing("--from"))?;
    let direction = args.start.direction.as_ref().ok_or_else(|| missing("--direction"))?;
    let length = args.start.length.ok_or_else(|| missing("--length"))?;
    let job = make_job(geometry, from, direction, length);
    let job = job.map_err(|error| Failure::refused(anyhow!(error)))?;
    let end = engine.flow(vec![Ok(job)])?.pop().unwrap_or_else(|| Err(String::from("no result")));
    let (id, end) = end.map_err(|error| Failure::refused(anyhow!(error)))?;
    let text = if args.json {
        end_json(id, end).to_string()
    } else {
        let (point, direction) = (point_numbers(id, end.point), direction_numbers(id, end.velocity));
        format!("point     {}\ndirection {}", shown(&point), shown(&direction))
    };
    print_line(&mut stdout().lock(), &text).map(|_| ())
}

fn job_from_json(value: &Value) -> Result<Job, String> {
    let case = Case::new(value, &["geometry", "from", "direction", "length"])?;
    make_job(case.text("geometry")?, &case.vector("from")?, &case.vector("direction")?, case.number("length")?)
}

fn make_job(geometry: &str, from: &[f64], direction: &[f64], length: f64) -> Result<Job, String> {
    let names = || crate::geometry::GEOMETRIES.iter().map(|e| e.name).collect::<Vec<_>>().join(", ");
    let id = GeometryId::from_name(geometry)
        .ok_or_else(|| format!("unknown geometry {geometry:?}; known are {}", names()))?;
    let start = start_from_numbers(id, from, direction)?;
    Ok(Job { geometry: id, start, length })
}

/// Point and unit direction from the user's numbers.
pub(super) fn start_from_numbers(id: GeometryId, from: &[f64], direction: &[f64]) -> Result<Geodesic, String> {
    struct Settle(&'static str, DVec4, DVec4);
    impl Visitor for Settle {
        type Output = Result<Geodesic, GeometryError>;
        fn visit<G: Geometry>(self, geometry: G) -> Self::Output {
            settle_geodesic(geometry, self.0, self.1, self.2)
        }
    }
    let vector = |what: &str, count: usize, given: &[f64]| {
        if given.len() == count {
            Ok(DVec4::from_array(std::array::from_fn(|i| given.get(i).copied().unwrap_or(0.0))))
        } else {
            Err(format!("{what} needs {count} numbers in {}, found {}", id.name(), given.len()))
        }
    };
    let from = vector("from", id.components(), from)?;
    let direction = vector("direction", id.direction_components(), direction)?;
    let settle = Settle(id.name(), from, direction);
    visit(id, settle).map_err(|error| error.to_string())
}

/// The user's components of a point.
pub(super) fn point_numbers(id: GeometryId, point: DVec4) -> Vec<f64> {
    numbers(point, id.components())
}

/// The user's components of a tangent vector.
pub(super) fn direction_numbers(id: GeometryId, vector: DVec4) -> Vec<f64> {
    numbers(vector, id.direction_components())
}

fn numbers(v: DVec4, count: usize) -> Vec<f64> {
    // Adding zero turns -0 into 0.
    v.to_array()[..count].iter().map(|x| x + 0.0).collect()
}

fn shown(numbers: &[f64]) -> String {
    numbers.iter().map(|x| x.to_string()).collect::<Vec<_>>().join(" ")
}

fn end_json(id: GeometryId, end: Geodesic) -> Value {
    json!({ "point": point_numbers(id, end.point), "direction": direction_numbers(id, end.velocity) })
}

/// Computes ends of geodesics on the cpu or the device.
enum Engine {
    Cpu { method: Method, single: bool },
    Device { method: Method, context: Arc<Context>, probes: HashMap<GeometryId, Probe> },
}

type Ends = Vec<Result<(GeometryId, Geodesic), String>>;

impl Engine {
    fn new(args: &GeodesicArgs) -> Result<Self, Failure> {
        let method = args.integrator.method(args.step, args.tolerance)?;
        let single = args.precision == Some(Precision::F32);
        let device = match (args.backend, args.precision) {
            (BackendChoice::Cpu, _) | (BackendChoice::Auto, Some(Precision::F64) | None) => false,
            (BackendChoice::Auto, Some(Precision::F32)) | (BackendChoice::Compute, Some(Precision::F32) | None) => true,
            (BackendChoice::Rt, _) => {
                return Err(Failure::refused(anyhow!("rt traces pictures: for single geodesics use compute or cpu")));
            }
            (BackendChoice::Compute, Some(Precision::F64)) => {
                return Err(Failure::refused(anyhow!("the device computes in f32: for f64 use --backend cpu")));
            }
        };
        if !device {
            return Ok(Self::Cpu { method, single });
        }
        let context = Context::new(&ContextOptions::from_env().map_err(Failure::vulkan)?).map_err(Failure::vulkan)?;
        Ok(Self::Device { method, context, probes: HashMap::new() })
    }

    /// Ends of all jobs; lines that were refused before stay refused.
    fn flow(&mut self, jobs: Vec<Result<Job, String>>) -> Result<Ends, Failure> {
        match self {
            Self::Cpu { method, single } => {
                let flow = |job| flow_on_cpu(job, *method, *single);
                Ok(jobs.into_iter().map(|job| job.and_then(flow)).collect())
            }
            Self::Device { method, context, probes } => flow_on_device(context, probes, *method, jobs),
        }
    }
}

fn flow_on_cpu(job: Job, method: Method, single: bool) -> Result<(GeometryId, Geodesic), String> {
    struct Flow(Job, Method, bool);
    impl Visitor for Flow {
        type Output = Result<Geodesic, Stop>;
        fn visit<G: Geometry>(self, geometry: G) -> Self::Output {
            let Self(Job { start, length, .. }, method, single) = self;
            let follow = if single { follow::<f32, G> } else { follow::<f64, G> };
            let end = follow(geometry, method, start, length)?.end;
            Ok(if method == Method::Exact { end } else { Unit(end).visit(geometry) })
        }
    }
    if let Some(edge) = edge(job) {
        return Err(edge);
    }
    let end = visit(job.geometry, Flow(job, method, single)).map_err(|stop| stop.to_string())?;
    in_range(job, end, if single { "f32" } else { "f64" })
}

/// A state with unit velocity, which integration keeps only up to its error; where velocities are not normalised, as it
/// is.
struct Unit(Geodesic);

impl Visitor for Unit {
    type Output = Geodesic;
    fn visit<G: Geometry>(self, geometry: G) -> Geodesic {
        geometry.restore(self.0)
    }
}

/// Whether the device's chart tells points apart there.
struct Resolved(DVec4, Method);

impl Visitor for Resolved {
    type Output = bool;
    fn visit<G: Geometry>(self, geometry: G) -> bool {
        resolves(geometry, self.0, f64::from(f32::EPSILON), self.1)
    }
}

/// What a geodesic runs into that leaves the chart, as a refusal.
fn edge(job: Job) -> Option<String> {
    struct Edge(Job);
    impl Visitor for Edge {
        type Output = Option<&'static str>;
        fn visit<G: Geometry>(self, geometry: G) -> Self::Output {
            geometry.edge(self.0.start, self.0.length)
        }
    }
    let (length, geometry) = (job.length, job.geometry.name());
    visit(job.geometry, Edge(job)).map(|edge| GeometryError::Edge { length, edge, geometry }.to_string())
}

fn in_range(job: Job, end: Geodesic, precision: &'static str) -> Result<(GeometryId, Geodesic), String> {
    let (length, geometry) = (job.length, job.geometry.name());
    match edge(job) {
        Some(edge) => Err(edge),
        None if end.point.is_finite() && end.velocity.is_finite() => Ok((job.geometry, end)),
        None => Err(GeometryError::OutOfRange { length, precision, geometry }.to_string()),
    }
}

fn flow_on_device(
    context: &Arc<Context>,
    probes: &mut HashMap<GeometryId, Probe>,
    method: Method,
    jobs: Vec<Result<Job, String>>,
) -> Result<Ends, Failure> {
    let mut ends: Ends =
        jobs.iter().map(|job| job.as_ref().map(|j| (j.geometry, j.start)).map_err(Clone::clone)).collect();
    let mut by_geometry: HashMap<GeometryId, Vec<(usize, Job)>> = HashMap::new();
    for (index, job) in jobs.into_iter().enumerate() {
        if let Ok(job) = job {
            by_geometry.entry(job.geometry).or_default().push((index, job));
        }
    }
    for (id, jobs) in by_geometry {
        let probe = match probes.entry(id) {
            std::collections::hash_map::Entry::Occupied(entry) => entry.into_mut(),
            std::collections::hash_map::Entry::Vacant(entry) => {
                entry.insert(Probe::new(context, id).map_err(Failure::failed)?)
            }
        };
        let single = |v: DVec4| v.as_vec4().to_array();
        let inputs: Vec<ProbeIn> = jobs
            .iter()
            .map(|(_, job)| ProbeIn {
                a: single(job.start.point),
                b: single(job.start.velocity),
                t: job.length as f32,
                c: [integrator_number(method) as f32, method.parameter() as f32, 0.0, 0.0],
                op: if method == Method::Exact { PROBE_FLOW } else { PROBE_FOLLOW },
            })
            .collect();
        let outputs = probe.run(&inputs).map_err(Failure::failed)?;
        for (((index, job), input), output) in jobs.into_iter().zip(&inputs).zip(outputs) {
            let double = |v: [f32; 4]| Vec4::from(v).as_dvec4();
            let mut end = Geodesic { point: double(output.a), velocity: double(output.b) };
            if method != Method::Exact && end.point.is_finite() {
                end = visit(job.geometry, Unit(end));
                if !visit(job.geometry, Resolved(end.point, method)) {
                    ends[index] = Err(Stop::Chart(job.length).to_string());
                    continue;
                }
            }
            let representable = input.t.is_finite() && input.a.iter().chain(&input.b).all(|x| x.is_finite());
            let end = if representable { end } else { Geodesic { point: DVec4::INFINITY, ..end } };
            ends[index] = in_range(job, end, "f32");
        }
    }
    Ok(ends)
}
