//! Walking a geodesic by an integrator instead of the geometry's flow: each step of the integrator is one segment for
//! traversal. Twin: `shaders/stage/stepped.glsl`.
//!
//! Between the faces the path's state stays in the chart, as the integrator leaves it: `state.point` holds the coordinates
//! and, last, the integrator's proposal for the next step; `state.velocity` their derivative and, last, the whole step of
//! which the segment is the first part. Faces are planes of the chart, so a step leaves the cell where one polynomial has
//! a root. There the state goes over to the geometry's own coordinates, through the pairing, and back; nothing is
//! normalised. A hit brings it back for good, with unit velocity, which is what shading wants.
//!
//! The steps of `euler` are straight segments, as in the book. Those of `rk4` and `dopri5` are arcs of parabolas as those of
//! the exact flow are; a step is cut where traversal would not look for its arc, and `dopri5`, which knows no length but its
//! tolerance, makes no step whose arc leaves the tolerance of pictures. Lengths are taken in the chart for that, which a cell
//! distorts by a small factor.

use super::{
    domain::Domain,
    reduce::{Arrival, MAX_FACES},
    walk::{End, Follow, Path, Status, deviation_at},
};
use crate::{
    geometry::{Geodesic, Geometry, ON_FACE, Real3, Segment},
    integrate::{Dense, Dopri5, Euler, Method, Rk4, State, Stepper},
    shader_io::REDUCE_LIMIT,
};
use glam::DVec4;

/// f64 counterpart of `shader_io::OVERLAP`: segments reach this far beyond both ends, in chart units.
const OVERLAP: f64 = 1e-12;

/// Longest step: a face may be passed twice within a longer one, in cells of size 1, which its end would not show.
const LONGEST: f64 = 0.5;

/// The state of a path that is walked by steps.
fn state(path: &Path) -> State<f64> {
    let Geodesic { point, velocity } = path.state;
    State { c: Real3::from_f64(point.truncate()), v: Real3::from_f64(velocity.truncate()) }
}

/// Puts a state into the path; proposal and step stay.
fn put(path: &mut Path, state: State<f64>) {
    path.state.point = state.c.to_f64().extend(path.state.point.w);
    path.state.velocity = state.v.to_f64().extend(path.state.velocity.w);
}

/// One step of any length.
fn step<G: Geometry>(geometry: G, method: Method, start: State<f64>, h: f64) -> Dense<f64> {
    let field = |c, v| geometry.spray::<f64>(c, v);
    match method {
        Method::Exact | Method::Euler { .. } => Euler { step: h }.step(&field, start, h),
        Method::Rk4 { .. } => Rk4 { step: h }.step(&field, start, h),
        Method::Dopri5 { tolerance } => Dopri5 { tolerance }.step(&field, start, h),
    }
}

/// An accepted step and the proposal for the next.
fn advance<G: Geometry>(geometry: G, method: Method, path: &Path, limit: f64) -> Option<(Dense<f64>, f64)> {
    let field = |c, v| geometry.spray::<f64>(c, v);
    let (start, proposal) = (state(path), path.state.point.w);
    match method {
        Method::Exact => None,
        Method::Euler { step } => Euler { step }.advance(&field, start, proposal, limit),
        Method::Rk4 { step } => Rk4 { step }.advance(&field, start, proposal, limit),
        Method::Dopri5 { tolerance } => Dopri5 { tolerance }.advance(&field, start, proposal, limit),
    }
}

/// Takes the path through a face in the given state.
fn cross<G: Geometry>(geometry: G, domain: &Domain, path: &mut Path, at: State<f64>, face: usize) {
    let passed = &domain.faces[face];
    let image = at.geodesic(geometry).map(|g| State::of(geometry, geometry.cross(&passed.folded, passed.plane, g)));
    path.pass(domain, face);
    match image.filter(State::is_finite) {
        Some(image) => put(path, image),
        None => path.status = Status::Gone,
    }
}

/// First share of a step at which it passes out through a plane; infinite if it ends inside.
pub fn exit(dense: &Dense<f64>, plane: DVec4) -> f64 {
    let n = Real3::from_f64(plane.truncate());
    let mut r = dense.c.map(|r| n.dot(r));
    r[0] += plane.w;
    if r[0] + r[1] <= 0.0 || r.iter().any(|x| x.is_nan()) {
        return f64::INFINITY;
    }
    let value = |x: f64| r[0] + x * (r[1] + (1.0 - x) * (r[2] + x * (r[3] + (1.0 - x) * r[4])));
    if r[2..] == [0.0; 3] {
        return if r[0] < 0.0 {
            -r[0] / r[1]
        } else if r[1] > 0.0 {
            0.0
        } else {
            f64::INFINITY
        };
    }
    let (mut low, mut f_low) = (0.0, r[0]);
    if f_low >= -ON_FACE {
        if r[1] + r[2] > 0.0 {
            return 0.0;
        }
        // From the plane inwards and back out again: its passage is not the start.
        let inside = (1..8).map(|i| f64::from(i) / 8.0).find(|x| value(*x) < -ON_FACE);
        let Some(x) = inside else { return f64::INFINITY };
        (low, f_low) = (x, value(x));
    }
    // Regula falsi, an end that stays twice counting half (the Illinois method). Among values that are rounding alone it would
    // walk away again: the best is kept.
    let (mut high, mut f_high) = (1.0, r[0] + r[1]);
    let (mut best, mut least) = (high, f_high);
    let mut last = 0;
    let rounding = f64::EPSILON * (r[0].abs() + r[1].abs() + plane.w.abs());
    for _ in 0..40 {
        let share = (high - f_high * (high - low) / (f_high - f_low)).clamp(low, high);
        let f = value(share);
        if f.abs() < least {
            (best, least) = (share, f.abs());
        }
        if least <= rounding || high - low < 1e-15 {
            break;
        }
        if f > 0.0 {
            (high, f_high) = (share, f);
            f_low *= if last > 0 { 0.5 } else { 1.0 };
            last = 1;
        } else {
            (low, f_low) = (share, f);
            f_high *= if last < 0 { 0.5 } else { 1.0 };
            last = -1;
        }
    }
    best
}

/// Largest share of a step up to which its arc stays within the tolerance of its polynomial. The third derivative is
/// taken for constant, as the change of the acceleration over the step.
fn arc_share<G: Geometry>(dense: &Dense<f64>, tolerance: f64) -> f64 {
    if G::STRAIGHT {
        return 1.0;
    }
    let change = dense.h * (dense.v[2] * 2.0 + dense.v[3]).to_f64().length();
    (96.0 * tolerance / change.max(f64::MIN_POSITIVE)).cbrt()
}

/// The segment of the first part of a step: straight for Euler's method, else the arc with the same ends and change of
/// velocity.
fn segment<G: Geometry>(dense: &Dense<f64>, share: f64, method: Method) -> Segment {
    let (origin, end) = (dense.c[0].to_f64(), dense.at(share));
    let straight = G::STRAIGHT || matches!(method, Method::Euler { .. });
    let bend = (dense.v[0] - end.v).to_f64() * if straight { 0.0 } else { 0.5 * share * dense.h };
    Segment { origin, direction: end.c.to_f64() - origin, bend }
}

/// As [`walk::stage_segment`](super::walk::stage_segment), by the steps of `method`.
pub fn stage_segment<G: Geometry>(
    geometry: G,
    domain: &Domain,
    path: &mut Path,
    bounces: u32,
    follow: Follow,
    method: Method,
    mut crossed: impl FnMut(usize),
) -> Option<Segment> {
    let first = path.segments == 0;
    if first {
        let start = State::of(geometry, path.state);
        path.state = Geodesic { point: DVec4::ZERO, velocity: DVec4::ZERO };
        put(path, start);
    }
    let faces = |cell: usize| domain.cells[cell].clone();
    // A state that rounding has left outside of its cell, at an edge or a corner, comes back first.
    for attempt in 0.. {
        let at = path.state.point.truncate().extend(1.0);
        let sides = faces(path.cell).map(|face| (domain.faces[face].plane.dot(at), face));
        let worst = sides.filter(|(side, _)| *side > ON_FACE).max_by(|a, b| a.0.total_cmp(&b.0));
        let Some((_, face)) = worst else { break };
        if attempt == REDUCE_LIMIT {
            path.status = Status::Lost;
        } else if path.bounces == bounces {
            path.status = Status::Gone;
        } else {
            let at = state(path);
            cross(geometry, domain, path, at, face);
            crossed(face);
        }
        if path.status != Status::Flying {
            return None;
        }
    }
    let rest = path.limit - path.travelled;
    let endless = rest.is_infinite() && faces(path.cell).is_empty();
    let accepted = if endless { None } else { advance(geometry, method, path, rest.min(LONGEST)) };
    let Some((mut dense, mut proposal)) = accepted else {
        path.status = Status::Gone;
        return None;
    };
    // Where the method leaves the step to a tolerance, a segment must be within the tolerance of pictures as well.
    if let Method::Dopri5 { .. } = method {
        let share = arc_share::<G>(&dense, deviation_at(path.travelled, follow.tolerance));
        if share < 1.0 {
            dense = step(geometry, method, state(path), share * dense.h);
            proposal = dense.h;
        }
    }
    path.end = if dense.h < rest { End::Arc } else { End::Limit };
    let mut share = 1.0;
    for face in faces(path.cell) {
        let exit = exit(&dense, domain.faces[face].plane);
        if exit <= share {
            share = exit;
            path.end = End::Face(face);
        }
    }
    if !dense.at(share).is_finite() {
        path.status = Status::Gone;
        return None;
    }
    path.state.point.w = proposal;
    path.state.velocity.w = dense.h;
    path.u_end = share * dense.h;
    path.segments += 1;
    let segment = segment::<G>(&dense, share, method);
    let slack = OVERLAP / segment.direction.length().max(1e-9);
    Some(segment.extended(if first { 0.0 } else { slack }, slack))
}

/// As [`walk::stage_transport`](super::walk::stage_transport), by the steps of `method`.
pub fn stage_transport<G: Geometry>(
    geometry: G,
    domain: &Domain,
    path: &mut Path,
    bounces: u32,
    method: Method,
    mut crossed: impl FnMut(usize),
) {
    path.travelled += path.u_end;
    let dense = current(geometry, method, path);
    let end = dense.at(path.u_end / dense.h);
    match path.end {
        End::Face(face) if path.bounces < bounces => {
            cross(geometry, domain, path, end, face);
            crossed(face);
        }
        End::Arc => put(path, end),
        End::Face(_) | End::Limit => {
            put(path, end);
            path.status = Status::Gone;
        }
    }
}

/// As [`reduce::transport`](super::reduce::transport) for length ≥ 0, by the steps of `method`. `None`: the integrator has
/// left the chart on the way.
pub fn transport<G: Geometry>(
    geometry: G,
    domain: &Domain,
    start: Geodesic,
    cell: usize,
    length: f64,
    method: Method,
) -> Option<Arrival> {
    let mut path = Path::new(start, cell, length);
    let mut faces = Vec::new();
    while path.status == Status::Flying {
        // Segments as long as the steps are.
        let pass = |face: usize| faces.push(face);
        stage_segment(geometry, domain, &mut path, MAX_FACES, Follow::EXACTLY, method, pass)?;
        stage_transport(geometry, domain, &mut path, MAX_FACES, method, |face| faces.push(face));
    }
    let state = geometry.restore(state(&path).geodesic(geometry)?);
    Some(Arrival { state, cell: path.cell, faces })
}

/// The step that the path is on.
pub fn current<G: Geometry>(geometry: G, method: Method, path: &Path) -> Dense<f64> {
    step(geometry, method, state(path), path.state.velocity.w)
}

/// Moves the path to length `u` of the step `dense` that it is on, and out of the chart into the geometry's own
/// coordinates.
pub fn arrive<G: Geometry>(geometry: G, dense: &Dense<f64>, path: &mut Path, u: f64) {
    path.travelled += u;
    match dense.at(u / dense.h).geodesic(geometry) {
        Some(g) => path.state = geometry.restore(g),
        None => path.status = Status::Gone,
    }
}
