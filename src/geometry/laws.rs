//! The laws that every geometry satisfies, as functions that measure how badly one is broken.
//!
//! [`laws`] lists them; each takes a geometry and a [`Sample`] and returns a residual that is zero in exact
//! arithmetic. Nothing here knows a formula of any geometry: what a function of the trait promises is compared with
//! what the others promise, so that a geometry can only pass as a whole. Derivatives are compared with central
//! differences, which is why some laws have a tolerance of 1e-6 where the others have 1e-12.

mod sample;

use super::{Geodesic, Geometry, Isometry, Quadric, Real3, Segment, across, exponential};
use glam::{DMat3, DVec3, DVec4, Vec4Swizzles};

pub use sample::{Sample, samples};

/// A law for geometry `G`.
#[derive(Clone, Copy, Debug)]
pub struct Law<G> {
    /// What it says.
    pub name: &'static str,
    /// Residuals up to this are rounding (or the error of a difference quotient).
    pub tolerance: f64,
    /// The residual for a sample: 0 in exact arithmetic, not a number where the geometry has no answer.
    pub residual: fn(G, &Sample) -> f64,
}

/// Rounding of a few operations on numbers of size up to ten.
const EXACT: f64 = 1e-12;

/// Error of central differences with [`STEP`].
const DIFFERENCE: f64 = 1e-6;

/// Step of difference quotients: its square and the rounding of 1e-16/STEP are both well below [`DIFFERENCE`].
const STEP: f64 = 1e-4;

/// All laws.
pub fn laws<G: Geometry>() -> Vec<Law<G>> {
    let law = |name, tolerance, residual| Law { name, tolerance, residual };
    vec![
        law("points and tangent vectors settle where they are", EXACT, settles::<G>),
        law("norm agrees with inner", EXACT, norm_agrees),
        law("frame is orthonormal and positive in the chart", EXACT, frame_is_orthonormal),
        law("isometry keeps inner", EXACT, isometry_keeps_inner),
        law("isometry takes geodesics to geodesics", EXACT, isometry_keeps_flow),
        law("isometries compose and invert", EXACT, isometries_are_a_group),
        law("cross is the pairing that was folded", EXACT, cross_is_the_pairing),
        law("flow is a one-parameter family", EXACT, flow_adds),
        law("flow reverses", EXACT, flow_reverses),
        law("flow has unit speed", EXACT, flow_has_unit_speed),
        law("transport keeps inner and carries the velocity", EXACT, transport_keeps_inner),
        law("transport is that of the connection", 1e-5, transport_is_parallel),
        law("log inverts flow", 1e-11, log_inverts_flow),
        law("closeness decreases with the distance", EXACT, closeness_decreases),
        law("area density is that of the flow", DIFFERENCE, area_density_is_of_the_flow),
        law("chart and unchart invert each other", EXACT, chart_round_trip),
        law("unchart_vector inverts the differential of chart", DIFFERENCE, unchart_vector_inverts),
        law("spray is the chart acceleration of the flow", DIFFERENCE, spray_is_of_the_flow),
        law("raise is the unit normal", EXACT, raise_is_normal),
        law("lower inverts raise up to length", EXACT, lower_inverts_raise),
        law("volume density is the determinant of the metric", EXACT, volume_density_is_determinant),
        law("advance agrees with flow", EXACT, advance_agrees),
        law("parameter finds the point of advance", EXACT, parameter_inverts_advance),
        law("exit is the first point on the plane", EXACT, exit_is_first),
        law("segment stays near the curve", EXACT, arc_stays_near),
        law("chart_vector is undone by unchart_vector", EXACT, chart_vector_is_undone),
        law("restore repairs and repeats", EXACT, restore_repairs),
        law("bisector is equidistant", 1e-11, bisector_is_equidistant),
        law("ball vanishes at its radius", EXACT, ball_vanishes),
        law("tube vanishes at its radius", EXACT, tube_vanishes),
    ]
}

// --- measures -------------------------------------------------------------------------------------

/// The larger residual; not a number if either is none.
fn worse(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() { f64::NAN } else { a.max(b) }
}

fn worst(residuals: impl IntoIterator<Item = f64>) -> f64 {
    residuals.into_iter().fold(0.0, worse)
}

/// 0 for a promise kept.
fn promise(kept: bool) -> f64 {
    if kept { 0.0 } else { f64::INFINITY }
}

/// Difference of two numbers, relative where they are large.
fn gap(a: f64, b: f64) -> f64 {
    if a == b { 0.0 } else { (a - b).abs() / (1.0 + a.abs()) }
}

fn gap4(a: DVec4, b: DVec4) -> f64 {
    let scale = 1.0 + a.abs().max_element();
    worst((a - b).to_array().map(|x| x.abs() / scale))
}

fn gap_geodesic(a: Geodesic, b: Geodesic) -> f64 {
    worse(gap4(a.point, b.point), gap4(a.velocity, b.velocity))
}

fn gap_isometry(a: &Isometry, b: &Isometry) -> f64 {
    let (a, b) = ([a.linear, diagonal(a)], [b.linear, diagonal(b)]);
    worst((0..2).flat_map(|k| (0..4).map(move |i| gap4(a[k].col(i), b[k].col(i)))))
}

/// The shift as a matrix, to compare isometries as two matrices.
fn diagonal(m: &Isometry) -> glam::DMat4 {
    glam::DMat4::from_diagonal(m.shift)
}

/// The images of the chart's coordinate vectors at a point.
fn chart_frame<G: Geometry>(geometry: G, p: DVec4) -> [DVec4; 3] {
    DVec3::AXES.map(|axis| geometry.unchart_vector(p, axis))
}

/// Gram matrix of two triples of tangent vectors.
fn gram<G: Geometry>(geometry: G, p: DVec4, a: [DVec4; 3], b: [DVec4; 3]) -> DMat3 {
    DMat3::from_cols_array_2d(&b.map(|y| a.map(|x| geometry.inner(p, x, y))))
}

/// Components in the frame. Their Euclidean product is the metric, or, where that is indefinite, the positive product
/// whose length is the norm.
fn framed<G: Geometry>(geometry: G, p: DVec4, v: DVec4) -> DVec3 {
    DVec3::from_array(geometry.frame(p).map(|axis| geometry.inner(p, axis, v))) * geometry.signature()
}

/// Two vectors that complete the velocity to an orthonormal frame in that product.
fn beside<G: Geometry>(geometry: G, g: Geodesic) -> [DVec4; 2] {
    if geometry.signature() == DVec3::ONE {
        return across(geometry, g);
    }
    let axes = geometry.frame(g.point);
    let (a, b) = framed(geometry, g.point, g.velocity).normalize().any_orthonormal_pair();
    [a, b].map(|c| axes[0] * c.x + axes[1] * c.y + axes[2] * c.z)
}

fn reversed(g: Geodesic) -> Geodesic {
    Geodesic { point: g.point, velocity: -g.velocity }
}

// --- the laws -------------------------------------------------------------------------------------

fn settles<G: Geometry>(geometry: G, s: &Sample) -> f64 {
    let p = s.start.point;
    let point = geometry.settle(p).map_or(f64::NAN, |q| gap4(p, q));
    let tangent = s.vectors.map(|v| gap4(v, geometry.settle_tangent(p, v)));
    let base = geometry.settle(geometry.base()).map_or(f64::NAN, |q| gap4(geometry.base(), q));
    let origin = geometry.chart(geometry.base()).length();
    worst([point, tangent[0], tangent[1], base, origin])
}

fn norm_agrees<G: Geometry>(geometry: G, s: &Sample) -> f64 {
    let p = s.start.point;
    let [u, v] = s.vectors;
    let symmetric = gap(geometry.inner(p, u, v), geometry.inner(p, v, u));
    // Both are sums of squares of the components in the frame, the metric with its signs.
    let components = framed(geometry, p, u);
    let metric = gap((components * components).dot(geometry.signature()), geometry.inner(p, u, u));
    worst([gap(geometry.norm(p, u).powi(2), components.length_squared()), metric, symmetric])
}

fn frame_is_orthonormal<G: Geometry>(geometry: G, s: &Sample) -> f64 {
    let p = s.start.point;
    let frame = geometry.frame(p);
    let signs = geometry.signature();
    let difference = gram(geometry, p, frame, frame) - DMat3::from_diagonal(signs);
    let orthonormal = worst(difference.to_cols_array().map(f64::abs));
    let positive = gram(geometry, p, frame, chart_frame(geometry, p)).determinant() * signs.element_product() > 0.0;
    worse(orthonormal, promise(positive))
}

fn isometry_keeps_inner<G: Geometry>(geometry: G, s: &Sample) -> f64 {
    let p = s.start.point;
    let [u, v] = s.vectors;
    let apply = |m: &Isometry, velocity| geometry.apply(m, Geodesic { point: p, velocity });
    worst(s.isometries.map(|m| {
        let (mu, mv) = (apply(&m, u), apply(&m, v));
        let kept = gap(geometry.inner(mu.point, mu.velocity, mv.velocity), geometry.inner(p, u, v));
        worse(kept, geometry.isometry_residual(&m))
    }))
}

fn isometry_keeps_flow<G: Geometry>(geometry: G, s: &Sample) -> f64 {
    let t = s.any_lengths[0];
    worst(s.isometries.map(|m| {
        let flow_first = geometry.apply(&m, geometry.flow(s.start, t));
        gap_geodesic(flow_first, geometry.flow(geometry.apply(&m, s.start), t))
    }))
}

fn isometries_are_a_group<G: Geometry>(geometry: G, s: &Sample) -> f64 {
    let [a, b] = s.isometries;
    let product = geometry.compose(&a, &b);
    let applied = gap_geodesic(geometry.apply(&product, s.start), geometry.apply(&a, geometry.apply(&b, s.start)));
    let inverse = geometry.inverse(&product);
    let left = gap_isometry(&geometry.compose(&inverse, &product), &Isometry::IDENTITY);
    let right = gap_isometry(&geometry.compose(&product, &inverse), &Isometry::IDENTITY);
    // Entries of both factors grow, those of the product are 0 and 1.
    let size = worst(product.linear.to_cols_array().map(f64::abs)).max(1.0);
    worse(applied, worse(left, right) / (size * size))
}

fn flow_adds<G: Geometry>(geometry: G, s: &Sample) -> f64 {
    let [a, b] = s.any_lengths;
    let twice = geometry.flow(geometry.flow(s.start, a), b);
    worse(gap_geodesic(geometry.flow(s.start, a + b), twice), gap_geodesic(s.start, geometry.flow(s.start, 0.0)))
}

fn flow_reverses<G: Geometry>(geometry: G, s: &Sample) -> f64 {
    let t = s.any_lengths[0];
    let there = geometry.flow(s.start, t);
    let back = reversed(geometry.flow(reversed(there), t));
    // And the mirror image of the start runs the same way with the opposite sign.
    let mirrored = reversed(geometry.flow(reversed(s.start), -t));
    worse(gap_geodesic(s.start, back), gap_geodesic(there, mirrored))
}

fn flow_has_unit_speed<G: Geometry>(geometry: G, s: &Sample) -> f64 {
    worst(s.any_lengths.map(|t| {
        let end = geometry.flow(s.start, t);
        let step = geometry.distance(end.point, geometry.flow(s.start, t + 1e-3).point);
        worse(gap(1.0, geometry.norm(end.point, end.velocity)), gap(1e-3, step))
    }))
}

fn transport_keeps_inner<G: Geometry>(geometry: G, s: &Sample) -> f64 {
    let t = s.any_lengths[0];
    let end = geometry.flow(s.start, t);
    let [u, v] = s.vectors;
    let [tu, tv] = s.vectors.map(|w| geometry.transport(s.start, t, w));
    let inner = gap(geometry.inner(s.start.point, u, v), geometry.inner(end.point, tu, tv));
    let velocity = gap4(end.velocity, geometry.transport(s.start, t, s.start.velocity));
    let tangent = gap4(tu, geometry.settle_tangent(end.point, tu));
    worst([inner, velocity, tangent])
}

/// The pole ladder (Lorenzi, Pennec: Efficient parallel transport of deformations in time series of images, 2014): the
/// tip of a short vector, mirrored in the middle of each rung, is the tip of the opposite of the parallel vector. The
/// errors of a vector and of its opposite cancel to first order.
fn transport_is_parallel<G: Geometry>(geometry: G, s: &Sample) -> f64 {
    const RUNGS: u32 = 3;
    const SHORT: f64 = 0.005;
    let length = 0.1 * s.length;
    let rung = length / f64::from(RUNGS);
    let (mut at, mut vector) = (s.start, s.vectors[0]);
    for _ in 0..RUNGS {
        let middle = geometry.flow(at, 0.5 * rung).point;
        let next = geometry.flow(at, rung);
        let [back, forth] = [SHORT, -SHORT].map(|scale| {
            let (velocity, length) = geometry.log(middle, exponential(geometry, at.point, vector * scale));
            let mirrored = geometry.flow(Geodesic { point: middle, velocity: -velocity }, length).point;
            let (velocity, length) = geometry.log(next.point, mirrored);
            velocity * length
        });
        (at, vector) = (next, (forth - back) / (2.0 * SHORT));
    }
    gap4(geometry.transport(s.start, length, s.vectors[0]), vector)
}

fn log_inverts_flow<G: Geometry>(geometry: G, s: &Sample) -> f64 {
    let end = geometry.flow(s.start, s.length);
    let (direction, length) = geometry.log(s.start.point, end.point);
    let (_, back) = geometry.log(end.point, s.start.point);
    let (_, none) = geometry.log(end.point, end.point);
    // The direction is as uncertain as the end point, divided by its distance.
    let direction = gap4(s.start.velocity, direction) * s.length;
    worst([direction, gap(s.length, length), gap(length, back), none])
}

fn area_density_is_of_the_flow<G: Geometry>(geometry: G, s: &Sample) -> f64 {
    let t = s.length.max(0.05);
    let end = geometry.flow(s.start, t);
    let field = beside(geometry, s.start).map(|e| {
        let near = |angle: f64| {
            let velocity = s.start.velocity * angle.cos() + e * angle.sin();
            let (direction, length) =
                geometry.log(end.point, geometry.flow(Geodesic { point: s.start.point, velocity }, t).point);
            direction * length
        };
        (near(STEP) - near(-STEP)) / (2.0 * STEP)
    });
    let [a, b] = field.map(|v| framed(geometry, end.point, v));
    let area = a.cross(b).length();
    gap(geometry.area_density(s.start, t), area)
}

fn chart_round_trip<G: Geometry>(geometry: G, s: &Sample) -> f64 {
    let p = geometry.flow(s.start, s.length).point;
    let c = geometry.chart(p);
    geometry.unchart(c).map_or(f64::NAN, |q| worse(gap4(p, q), (geometry.chart(q) - c).abs().max_element()))
}

fn unchart_vector_inverts<G: Geometry>(geometry: G, s: &Sample) -> f64 {
    let at = |t| geometry.chart(geometry.flow(s.start, t).point);
    let slope = (at(STEP) - at(-STEP)) / (2.0 * STEP);
    let vector = geometry.unchart_vector(s.start.point, slope);
    let tangent = gap4(vector, geometry.settle_tangent(s.start.point, vector));
    worse(gap4(s.start.velocity, vector), tangent)
}

fn spray_is_of_the_flow<G: Geometry>(geometry: G, s: &Sample) -> f64 {
    let rate = |t: f64| {
        let at = geometry.flow(s.start, t);
        geometry.chart_vector(at.point, at.velocity)
    };
    let c = Real3::from_f64(geometry.chart(s.start.point));
    let spray = geometry.spray::<f64>(c, Real3::from_f64(rate(0.0))).to_f64();
    let difference = (rate(STEP) - rate(-STEP)) / (2.0 * STEP);
    gap4(difference.extend(0.0), spray.extend(0.0))
}

fn raise_is_normal<G: Geometry>(geometry: G, s: &Sample) -> f64 {
    let p = s.start.point;
    let normal = geometry.raise(p, s.conormal);
    let (a, b) = s.conormal.any_orthonormal_pair();
    let inner = |dc| geometry.inner(p, normal, geometry.unchart_vector(p, dc));
    let scaled = gap4(normal, geometry.raise(p, s.conormal * 7.0));
    worst([
        inner(a).abs(),
        inner(b).abs(),
        gap(1.0, geometry.norm(p, normal)),
        promise(inner(s.conormal) > 0.0),
        scaled,
    ])
}

fn lower_inverts_raise<G: Geometry>(geometry: G, s: &Sample) -> f64 {
    let lowered = geometry.lower(s.start.point, geometry.raise(s.start.point, s.conormal));
    (lowered.normalize() - s.conormal).abs().max_element()
}

fn volume_density_is_determinant<G: Geometry>(geometry: G, s: &Sample) -> f64 {
    let p = s.start.point;
    let axes = chart_frame(geometry, p);
    let determinant = gram(geometry, p, axes, axes).determinant();
    gap(determinant.abs().sqrt(), geometry.volume_density(geometry.chart(p)))
}

fn advance_agrees<G: Geometry>(geometry: G, s: &Sample) -> f64 {
    let u = geometry.parameter_at(s.start, s.length);
    let there = gap_geodesic(geometry.flow(s.start, s.length), geometry.advance(s.start, u));
    let length = gap(s.length, geometry.length(s.start, u));
    let zero = worse(geometry.parameter_at(s.start, 0.0).abs(), geometry.length(s.start, 0.0).abs());
    worst([there, length, zero])
}

fn parameter_inverts_advance<G: Geometry>(geometry: G, s: &Sample) -> f64 {
    let u = geometry.parameter_at(s.start, s.length);
    gap(u, geometry.parameter(s.start, geometry.chart(geometry.advance(s.start, u).point)))
}

fn closeness_decreases<G: Geometry>(geometry: G, s: &Sample) -> f64 {
    // The same at the same distance, from any point in any direction.
    let from = |g: Geodesic, t: f64| geometry.closeness(g.point, geometry.flow(g, t).point);
    let base = geometry.base();
    let standard = Geodesic { point: base, velocity: geometry.frame(base)[0] };
    let same = gap(from(standard, s.length), from(s.start, s.length));
    let near = from(s.start, 0.9 * s.length);
    worse(same, promise(near > from(s.start, s.length) || near.is_infinite() || s.length < 1e-3))
}

/// A state on a plane, taken through it by the folded pairing and by the pairing itself.
fn cross_is_the_pairing<G: Geometry>(geometry: G, s: &Sample) -> f64 {
    // The bisector of the base point and a point farther than the state: planes of domains are such. Any plane is one
    // where bisectors are no planes.
    let base = geometry.base();
    let frame = geometry.frame(base);
    let away = frame[0] * s.conormal.x + frame[1] * s.conormal.y + frame[2] * s.conormal.z;
    let bisector = geometry.bisector(exponential(geometry, base, away * (s.length + 0.1)));
    let plane = bisector.unwrap_or(s.conormal.extend(-s.length));
    let pairing = &s.isometries[0];
    let crossed = geometry.cross(&geometry.fold(plane, pairing), plane, s.start);
    gap_geodesic(geometry.apply(pairing, s.start), crossed)
}

fn exit_is_first<G: Geometry>(geometry: G, s: &Sample) -> f64 {
    // A plane on whose inner side the geodesic starts.
    let plane = s.conormal.extend(-s.conormal.dot(geometry.chart(s.start.point)) - 0.4 * s.length);
    let exit = geometry.exit(s.start, plane, f64::INFINITY);
    let far = geometry.parameter_at(s.start, 0.6);
    let side = |u: f64| geometry.side(geometry.advance(s.start, u).point, plane);
    let inside_until = |end: f64| worst((0..32).map(|k| side(end * f64::from(k) / 32.0).max(0.0)));
    if exit > far {
        return inside_until(far);
    }
    let lands = side(exit).abs();
    let outwards = geometry.inner(
        geometry.advance(s.start, exit).point,
        geometry.advance(s.start, exit).velocity,
        geometry.raise(geometry.advance(s.start, exit).point, s.conormal),
    );
    worst([lands, inside_until(exit), promise(outwards > 0.0 && exit >= 0.0)])
}

fn chart_vector_is_undone<G: Geometry>(geometry: G, s: &Sample) -> f64 {
    let back = geometry.unchart_vector(s.start.point, geometry.chart_vector(s.start.point, s.start.velocity));
    gap4(back, s.start.velocity)
}

fn arc_stays_near<G: Geometry>(geometry: G, s: &Sample) -> f64 {
    let (tolerance, far) = (1e-3, geometry.parameter_at(s.start, s.length));
    let end = geometry.arc(s.start, far, tolerance);
    let (arc, _) = Segment::along(geometry, s.start, end);
    let off = |k: i32| {
        let c = arc.at(f64::from(k) / 16.0);
        let nearest = geometry.advance(s.start, geometry.parameter(s.start, c)).point;
        geometry.unchart(c).map_or(f64::NAN, |p| (geometry.distance(p, nearest) - tolerance).max(0.0))
    };
    worse(worst((0..=16).map(off)), promise(end > 0.0 && end <= far))
}

fn restore_repairs<G: Geometry>(geometry: G, s: &Sample) -> f64 {
    let noise = DVec4::new(s.conormal.x, s.conormal.y, s.conormal.z, s.any_lengths[0]);
    // Noise along the model is not for repair, so it is the constraint that must come back, not the state.
    let point = s.start.point + noise * 1e-9 * tangible(geometry, s);
    let velocity = s.start.velocity + noise.wzyx() * 1e-9 * tangible(geometry, s);
    let repaired = geometry.restore(Geodesic { point, velocity });
    let on_model = geometry.settle(repaired.point).map_or(f64::NAN, |q| gap4(repaired.point, q));
    let tangent = gap4(repaired.velocity, geometry.settle_tangent(repaired.point, repaired.velocity));
    // Where the metric is indefinite, velocities keep their length.
    let definite = geometry.signature() == DVec3::ONE;
    let unit = if definite { gap(1.0, geometry.norm(repaired.point, repaired.velocity)) } else { 0.0 };
    let near = (gap_geodesic(repaired, s.start) - 1e-7).max(0.0);
    let again = gap_geodesic(repaired, geometry.restore(repaired));
    worst([on_model, tangent, unit, near, again, gap_geodesic(s.start, geometry.restore(s.start))])
}

/// 1 for the coordinates that rounding can disturb, 0 for a last coordinate that no tangent vector changes.
fn tangible<G: Geometry>(geometry: G, s: &Sample) -> DVec4 {
    let constant = geometry.frame(geometry.flow(s.start, 0.3).point).iter().all(|axis| axis.w == 0.0);
    DVec4::new(1.0, 1.0, 1.0, if constant { 0.0 } else { 1.0 })
}

fn bisector_is_equidistant<G: Geometry>(geometry: G, s: &Sample) -> f64 {
    let base = geometry.base();
    let frame = geometry.frame(base);
    let away = frame[0] * s.conormal.x + frame[1] * s.conormal.y + frame[2] * s.conormal.z;
    let image = exponential(geometry, base, away * (s.length + 0.1));
    let Some(plane) = geometry.bisector(image) else { return 0.0 };
    let inside = promise(geometry.side(base, plane) < 0.0 && geometry.side(image, plane) > 0.0);
    // The geodesic between them crosses in the middle; other points of the plane are found around that.
    let normal = plane.xyz() / plane.xyz().length_squared();
    let foot = normal * -plane.w;
    let (a, b) = normal.normalize().any_orthonormal_pair();
    let [x, y] = s.any_lengths.map(|x| 0.2 * x);
    let equidistant = |c: DVec3| {
        geometry.unchart(c).map_or(f64::NAN, |p| gap(geometry.distance(p, base), geometry.distance(p, image)))
    };
    worst([inside, equidistant(foot), equidistant(foot + a * x + b * y)])
}

/// Value of a quadric at a point, in units of its largest entry.
fn quadric_value<G: Geometry>(geometry: G, quadric: Quadric, p: DVec4) -> f64 {
    let q = quadric.matrix();
    let x = geometry.chart(p).extend(1.0);
    let size = worst(q.to_cols_array().map(f64::abs)) * x.length_squared();
    x.dot(q * x) / size
}

fn ball_vanishes<G: Geometry>(geometry: G, s: &Sample) -> f64 {
    let radius = s.length.clamp(0.05, 0.5);
    let Some(ball) = geometry.ball(s.start.point, radius) else { return 0.0 };
    let value = |r: f64| quadric_value(geometry, ball, geometry.flow(s.start, r).point);
    let signs = promise(value(0.9 * radius) < 0.0 && value(1.1 * radius) > 0.0 && value(0.0) < 0.0);
    worse(value(radius).abs(), signs)
}

fn tube_vanishes<G: Geometry>(geometry: G, s: &Sample) -> f64 {
    let radius = s.length.clamp(0.05, 0.5);
    let Some(tube) = geometry.tube(s.start, radius) else { return 0.0 };
    let along = geometry.flow(s.start, 0.2 * s.any_lengths[1]);
    let [a, b] = across(geometry, along);
    let (sin, cos) = s.any_lengths[0].sin_cos();
    let out = Geodesic { point: along.point, velocity: a * cos + b * sin };
    let value = |r: f64| quadric_value(geometry, tube, geometry.flow(out, r).point);
    let signs = promise(value(0.9 * radius) < 0.0 && value(1.1 * radius) > 0.0 && value(0.0) < 0.0);
    worse(value(radius).abs(), signs)
}
