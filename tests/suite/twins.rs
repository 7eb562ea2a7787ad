//! Each function of the shaders' geometry files against its Rust twin, on the device.
//!
//! Inputs are rounded to f32 first, so that both sides compute the same thing; allowed is an error of some roundings
//! relative to the size of the result. The awkward inputs are tiny and large lengths, the base point, directions
//! along a plane, coinciding points.

use crate::support::{self, Random};
use glam::{DVec3, DVec4, Vec4};
use holonomy::{
    geometry::{GEOMETRIES, Geodesic, Geometry, Isometry, Real3, Visitor, exponential, visit},
    integrate::{Dopri5, Euler, Rk4, State, Stepper},
    render::compute::probe::Probe,
    shader_io::{self as io, ProbeIn},
};

/// One evaluation and what Rust says of it.
struct Case {
    name: &'static str,
    input: ProbeIn,
    expected: Vec<f64>,
    /// Error allowed, in units of (1 + size of the result).
    tolerance: f64,
    /// Whether the function returns states (two vectors) or something in the first vector.
    state: bool,
}

fn single(v: DVec4) -> [f32; 4] {
    v.as_vec4().to_array()
}

/// The nearest point or vector that f32 holds.
fn rounded(v: DVec4) -> DVec4 {
    v.as_vec4().as_dvec4()
}

fn numbers(g: Geodesic) -> Vec<f64> {
    g.point.to_array().into_iter().chain(g.velocity.to_array()).collect()
}

/// Roundings of f32 that a function of some ten operations may cost.
const ROUNDINGS: f64 = 40.0 * 6e-8;

struct Cases<'a> {
    pairing: &'a Isometry,
    folded: &'a Isometry,
    plane: DVec4,
}

impl Visitor for Cases<'_> {
    type Output = Vec<Case>;

    fn visit<G: Geometry>(self, geometry: G) -> Vec<Case> {
        let mut random = Random(1872);
        let mut cases = Vec::new();
        let base = geometry.base();
        let direction = |p: DVec4, random: &mut Random| {
            let [x, y, z] = geometry.frame(p);
            let v = x * random.within(-1.0, 1.0) + y * random.within(-1.0, 1.0) + z * random.within(-1.0, 1.0);
            v / geometry.norm(p, v)
        };
        for number in 0..200 {
            let radius = if number % 10 == 0 { 0.0 } else { random.within(0.0, 1.2) };
            let point = rounded(exponential(geometry, base, direction(base, &mut random) * radius));
            // Along the axes of the frame too, and all but along them.
            let axes = geometry.frame(point);
            let aside = axes[(number / 7 + 1) % 3] * 1e-6 + axes[(number / 7 + 2) % 3] * 1e-12;
            let velocity = match number % 7 {
                3 => axes[(number / 7) % 3],
                5 => axes[(number / 7) % 3] + aside,
                _ => direction(point, &mut random),
            };
            let velocity = rounded(velocity);
            let g = Geodesic { point, velocity };
            let t = [0.0, 1e-6, 0.3, 0.7, 1.0, 2.5][number % 6] * random.within(0.9, 1.1);
            // As far as the chart goes, both ways.
            let mut t = f64::from(t as f32);
            while geometry.edge(g, t).is_some() || geometry.edge(g, -t).is_some() {
                t *= 0.5;
            }
            let far = rounded(geometry.flow(g, t).point);
            let w = rounded(direction(point, &mut random));
            let n = DVec3::new(random.within(-1.0, 1.0), random.within(-1.0, 1.0), random.within(-1.0, 1.0));
            // Planes across an axis, and along one, as faces often are.
            let n = n * [DVec3::ONE, DVec3::Z, DVec3::new(1.0, 1.0, 0.0)][number % 3];
            let plane = rounded(
                geometry
                    .bisector(exponential(geometry, base, direction(base, &mut random) * 1.5))
                    .unwrap_or(n.extend(-0.5)),
            );
            // How steeply a curve meets the plane is the condition of its exit.
            let exit = geometry.exit(g, plane, f64::INFINITY);
            let mut steepness = 1.0;
            if exit < 0.9 {
                let at = geometry.advance(g, exit);
                steepness = geometry.inner(at.point, at.velocity, geometry.raise(at.point, plane.truncate())).abs();
            }
            let u = f64::from(geometry.parameter_at(g, t.min(1.0)) as f32);
            let c = geometry.chart(geometry.advance(g, u).point);
            let c = rounded(c.extend(0.0)).truncate();
            let mut add = |name, op, [a, b, c]: [DVec4; 3], t: f64, expected: Vec<f64>, state| {
                let input = ProbeIn { a: single(a), b: single(b), c: single(c), t: t as f32, op };
                let tolerance = if name == "exit" { ROUNDINGS / steepness } else { ROUNDINGS };
                cases.push(Case { name, input, expected, tolerance, state });
            };
            let zero = DVec4::ZERO;
            let state = |c: DVec4| [point, velocity, c];
            add("flow", io::PROBE_FLOW, state(zero), t, numbers(geometry.flow(g, t)), true);
            add("flow backwards", io::PROBE_FLOW, state(zero), -t, numbers(geometry.flow(g, -t)), true);
            add("inner", io::PROBE_INNER, [point, velocity, w], 0.0, vec![geometry.inner(point, velocity, w)], false);
            add("closeness", io::PROBE_CLOSENESS, [point, far, zero], 0.0, vec![geometry.closeness(point, far)], false);
            if t > 0.1 {
                let (v, length) = geometry.log(point, far);
                let expected = vec![length, 0.0, 0.0, 0.0, v.x, v.y, v.z, v.w];
                add("log", io::PROBE_LOG, [point, far, zero], 0.0, expected, true);
            }
            add("area_density", io::PROBE_AREA_DENSITY, state(zero), t, vec![geometry.area_density(g, t)], false);
            add("length", io::PROBE_LENGTH, state(zero), u, vec![geometry.length(g, u)], false);
            add(
                "parameter_at",
                io::PROBE_PARAMETER_AT,
                state(zero),
                t.min(1.0),
                vec![geometry.parameter_at(g, t.min(1.0))],
                false,
            );
            add("advance", io::PROBE_ADVANCE, state(zero), u, numbers(geometry.advance(g, u)), true);
            add("side", io::PROBE_SIDE, state(plane), 0.0, vec![geometry.side(point, plane)], false);
            // Near-parallel planes are left out: there the exit is as ill conditioned as the directions are close.
            let settled = [-1e-4, 1e-4].iter().all(|shift| {
                let moved = geometry.exit(g, plane + DVec4::W * *shift, f64::INFINITY);
                moved == exit || (moved - exit).abs() < 1e-3
            });
            if settled && (exit.is_infinite() || exit < 0.9) {
                add("exit", io::PROBE_EXIT, state(plane), f64::MAX, vec![exit], false);
            }
            let arc = geometry.arc(g, u, 1e-5);
            add("arc", io::PROBE_ARC, state(DVec4::new(u, 0.0, 0.0, 0.0)), 1e-5, vec![arc], false);
            add("parameter", io::PROBE_PARAMETER, state(c.extend(0.0)), 0.0, vec![geometry.parameter(g, c)], false);
            add("restore", io::PROBE_RESTORE, state(zero), 0.0, numbers(geometry.restore(g)), true);
            add("chart", io::PROBE_CHART, state(zero), 0.0, geometry.chart(point).to_array().into(), false);
            let unchart = geometry.unchart(c).expect("a point of the chart");
            add("unchart", io::PROBE_UNCHART, [c.extend(0.0), zero, zero], 0.0, unchart.to_array().into(), false);
            let image = geometry.chart_vector(point, velocity);
            add("chart_vector", io::PROBE_CHART_VECTOR, state(zero), 0.0, image.to_array().into(), false);
            let n = rounded(n.extend(0.0));
            let raised = geometry.raise(point, n.truncate());
            add("raise", io::PROBE_RAISE, [point, n, zero], 0.0, raised.to_array().into(), false);
            let lowered = geometry.lower(point, velocity);
            add("lower", io::PROBE_LOWER, state(zero), 0.0, lowered.to_array().into(), false);
            let image = geometry.chart_vector(point, velocity);
            let vector = geometry.unchart_vector(point, n.truncate()).to_array();
            add("unchart_vector", io::PROBE_UNCHART_VECTOR, [point, n, zero], 0.0, vector.into(), false);
            // The chart state that f32 holds.
            let c = rounded(geometry.chart(point).extend(0.0));
            let image = rounded(image.extend(0.0));
            let start = State { c: Real3::from_f64(c.truncate()), v: Real3::from_f64(image.truncate()) };
            let spray = geometry.spray::<f64>(start.c, start.v).to_f64();
            add("spray", io::PROBE_SPRAY, [c, image, zero], 0.0, spray.to_array().into(), false);
            let field = |c, v| geometry.spray::<f64>(c, v);
            let (h, share) = ([0.02, 0.2][number % 2], [0.3, 0.5, 1.0][number % 3]);
            let (h, share) = (f64::from(h as f32), f64::from(share as f32));
            let euler = Euler { step: h }.step(&field, start, h);
            let rk4 = Rk4 { step: h }.step(&field, start, h);
            let dopri5 = Dopri5 { tolerance: 1.0 }.step(&field, start, h);
            for (name, method, dense) in [
                ("euler", io::INTEGRATOR_EULER, euler),
                ("rk4", io::INTEGRATOR_RK4, rk4),
                ("dopri5", io::INTEGRATOR_DOPRI5, dopri5),
            ] {
                let end = dense.at(share);
                let expected = [end.c.to_f64().extend(0.0), end.v.to_f64().extend(0.0)].map(|v| v.to_array()).concat();
                let how = DVec4::new(f64::from(method), share, 0.0, 0.0);
                add(name, io::PROBE_STEP, [c, image, how], h, expected, true);
            }
            add("apply", io::PROBE_APPLY, state(zero), 0.0, numbers(geometry.apply(self.pairing, g)), true);
            // On the face itself, where passages happen.
            let on_face = geometry.exit(Geodesic { point: base, velocity }, self.plane, f64::INFINITY);
            if on_face.is_finite() {
                let g =
                    geometry.advance(Geodesic { point: base, velocity: rounded(direction(base, &mut random)) }, 0.2);
                let g = Geodesic { point: rounded(g.point), velocity: rounded(g.velocity) };
                let expected = numbers(geometry.cross(self.folded, self.plane, g));
                add("cross", io::PROBE_CROSS, [g.point, g.velocity, self.plane], 0.0, expected, true);
            }
            add("base", io::PROBE_BASE, [zero; 3], 0.0, base.to_array().into(), false);
        }
        cases
    }
}

/// Names of the functions whose results differ by more than they may; `spoil` changes what the device gave.
fn disagreements(spoil: impl Fn(&str, &mut [f64])) -> Option<Vec<String>> {
    let gpu = support::gpu()?;
    let mut wrong = Vec::new();
    for entry in GEOMETRIES {
        let (pairing, folded, plane) = support::isometries(entry.id)[0];
        let plane = rounded(plane);
        let round = |m: Isometry| Isometry { linear: m.linear.as_mat4().as_dmat4(), shift: rounded(m.shift) };
        let (pairing, folded) = (round(pairing), round(folded));
        let cases = visit(entry.id, Cases { pairing: &pairing, folded: &folded, plane });
        let run = |isometry: &Isometry| {
            let probe = Probe::new(&gpu, entry.id).expect("a probe");
            let inputs: Vec<ProbeIn> = cases.iter().map(|c| c.input).collect();
            probe.with_isometry(isometry).expect("an isometry").run(&inputs).expect("it runs")
        };
        let (applied, crossed) = (run(&pairing), run(&folded));
        for (index, case) in cases.iter().enumerate() {
            let out = if case.name == "cross" { crossed[index] } else { applied[index] };
            let double = |v: [f32; 4]| Vec4::from(v).as_dvec4().to_array();
            let mut found: Vec<f64> = double(out.a).into_iter().chain(double(out.b)).collect();
            found.truncate(if case.state { 8 } else { case.expected.len() });
            spoil(case.name, &mut found);
            let size = case.expected.iter().filter(|x| x.is_finite()).fold(1.0_f64, |a, x| a.max(x.abs()));
            let differs = case.expected.iter().zip(&found).any(|(e, f)| {
                let same = e == f || (e - f).abs() <= case.tolerance * (1.0 + size) * size;
                !same
            });
            if differs {
                wrong.push(format!(
                    "{} {}: {found:?} instead of {:?} for {:?}",
                    entry.name, case.name, case.expected, case.input
                ));
            }
        }
    }
    Some(wrong)
}

#[test]
fn twins_agree() {
    let Some(wrong) = disagreements(|_, _| ()) else { return };
    assert!(wrong.is_empty(), "{} disagreements, such as\n{}", wrong.len(), wrong[..wrong.len().min(8)].join("\n"));
}

/// Every function's comparison can fail.
#[test]
fn twins_spoiled_results_are_caught() {
    let functions = [
        "flow",
        "inner",
        "closeness",
        "log",
        "area_density",
        "length",
        "parameter_at",
        "advance",
        "side",
        "exit",
        "arc",
        "parameter",
        "restore",
        "chart",
        "unchart",
        "chart_vector",
        "raise",
        "lower",
        "apply",
        "cross",
        "base",
        "unchart_vector",
        "spray",
        "euler",
        "rk4",
        "dopri5",
    ];
    let spoil = |_: &str, found: &mut [f64]| {
        found.iter_mut().for_each(|x| if x.is_infinite() { *x = 0.0 } else { *x += 1e-3 * (1.0 + x.abs()).powi(2) })
    };
    let Some(wrong) = disagreements(spoil) else { return };
    for function in functions {
        for entry in GEOMETRIES {
            let start = format!("{} {function}:", entry.name);
            assert!(wrong.iter().any(|w| w.starts_with(&start)), "a spoiled {start} passes");
        }
    }
}
