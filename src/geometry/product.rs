//! Products of a surface of constant curvature κ = ±1 with a line: all that S²×R and H²×R share.
//! Twin: `shaders/shared/product.glsl`.
//!
//! A point is `(x, y, z, w)` with `x² + y² + κ w² = κ`; z is the line. The surface is the slice z = 0 of the
//! three-space of the same curvature, which is totally geodesic there, so what that space knows of points and
//! vectors (norm, logarithm, frame, bisector) is used as it is. Chart: `(x/w, y/w, z)`.
//!
//! A geodesic goes along a geodesic of the surface with speed c and along the line with speed b, c² + b² = 1:
//! `p cosκ(ct) + h t sincκ(ct)` with h the part of the velocity in the surface, which needs no division by c.
//! (cosκ is cos or cosh, sincκ(x) = sinκ(x)/x.) The curve parameter is arc length. Both speeds are constant, so the
//! geodesic stays in a flat strip, (geodesic of the surface) × R, in which it is a straight line; in the chart it
//! bends within this strip, because the chart stretches the surface unevenly along it.
//!
//! Face planes are vertical (no z) or horizontal (only z) in every product domain; those have closed forms. Others,
//! which no isometry but a turn about the base point takes to planes, are found by `first_passage`.

use super::curved::{arc_bounds, longest_arc};
use super::passage::{Motion, first_passage};
use super::{ALONG_FACE, Elementary, Geodesic, Geometry, Isometry, ON_FACE, Quadric, Real, Real3, Real4, RealGeodesic};
use glam::{DMat4, DVec3, DVec4};

/// The surface of a product.
pub trait Product: Copy + Send + Sync + 'static {
    /// The three-space of the same curvature, whose slice z = 0 is the surface.
    type Space: Geometry;

    /// That space.
    const SPACE: Self::Space;

    /// κ: 1 or −1.
    const CURVATURE: f64;

    /// (sinκ, cosκ).
    fn sine_cosine<T: Elementary>(x: T) -> (T, T);

    /// [`Geometry::norm`] of that space.
    fn norm_in<T: Elementary>(p: Real4<T>, v: Real4<T>) -> T;

    /// The inverse of tanκ = sinκ/cosκ; infinite beyond its range.
    fn arc_tangent(x: f64) -> f64;
}

/// Speeds in the surface below this move nothing in it: the square, with any length, is far below rounding.
const VERTICAL: f64 = 1e-20;

/// Points of one orbit nearer than this to the base point's slice or line lie in it.
const SAME: f64 = 1e-12;

/// The part of a point or vector in the surface.
fn slice(v: DVec4) -> DVec4 {
    DVec4::new(v.x, v.y, 0.0, v.w)
}

/// The same in any precision.
fn slice_in<T: Real>(v: Real4<T>) -> Real4<T> {
    Real4::new(v.x, v.y, T::from_f64(0.0), v.w)
}

/// The form of the surface.
fn form<P: Product>(u: DVec4, v: DVec4) -> f64 {
    u.x * v.x + u.y * v.y + P::CURVATURE * u.w * v.w
}

/// Gram matrix of the form of the surface and the line.
fn gram<P: Product>() -> DMat4 {
    DMat4::from_diagonal(DVec4::new(1.0, 1.0, 1.0, P::CURVATURE))
}

/// Length of the part of a unit velocity in the surface. Where it is large the other part says it with fewer
/// roundings, which e^ct multiplies.
fn speed<P: Product>(g: Geodesic) -> f64 {
    speed_in::<P, f64>(RealGeodesic::from_f64(g))
}

/// The same in any precision.
fn speed_in<P: Product, T: Elementary>(g: RealGeodesic<T>) -> T {
    let (b, one) = (g.velocity.z, T::from_f64(1.0));
    if b.abs() < T::from_f64(0.7) {
        ((one - b) * (one + b)).sqrt()
    } else {
        P::norm_in(slice_in(g.point), slice_in(g.velocity))
    }
}

/// sinκ(x)/x.
fn sine_ratio<P: Product, T: Elementary>(x: T) -> T {
    let number = T::from_f64;
    if x.abs() < number(1e-3) {
        let y = number(P::CURVATURE) * x * x;
        number(1.0) - y / number(6.0) * (number(1.0) - y / number(20.0))
    } else {
        P::sine_cosine(x).0 / x
    }
}

/// arctanκ(c y)/c.
fn arc_over_speed<P: Product>(y: f64, c: f64) -> f64 {
    let x = c * y;
    if x.abs() < 1e-3 {
        let square = P::CURVATURE * x * x;
        y * (1.0 - square * (1.0 / 3.0 - square * (0.2 - square / 7.0)))
    } else {
        P::arc_tangent(x) / c
    }
}

/// Whether a plane is vertical, and whether it is horizontal.
fn kind(plane: DVec4) -> (bool, bool) {
    (plane.z == 0.0, plane.x == 0.0 && plane.y == 0.0)
}

/// Reflection in a vertical or horizontal plane; other planes have none and leave the state alone.
fn reflect<P: Product>(plane: DVec4, g: Geodesic) -> Geodesic {
    match kind(plane) {
        (true, _) => {
            let normal = DVec4::new(plane.x, plane.y, 0.0, P::CURVATURE * plane.w);
            let mirror = |x: DVec4| x - normal * (2.0 * plane.dot(x));
            Geodesic { point: mirror(g.point), velocity: mirror(g.velocity) }
        }
        (_, true) => {
            let up = DVec4::Z * (2.0 * plane.z);
            let point = g.point - up * (plane.z * g.point.z + plane.w);
            Geodesic { point, velocity: g.velocity - up * (plane.z * g.velocity.z) }
        }
        _ => g,
    }
}

/// Image of the origin and of the coordinate vectors: the reflection as an isometry.
fn mirror<P: Product>(plane: DVec4) -> Isometry {
    let column = |axis| reflect::<P>(plane, Geodesic { point: DVec4::ZERO, velocity: axis }).velocity;
    let shift = reflect::<P>(plane, Geodesic { point: DVec4::ZERO, velocity: DVec4::ZERO }).point;
    Isometry { linear: super::matrix_of(column), shift }
}

/// Size of the plane's form and its rate, in the chart.
fn chart_motion<P: Product>(g: Geodesic, plane: DVec4) -> Motion {
    let (p, v) = (g.point, g.velocity);
    let (x, y) = (p.x / p.w, p.y / p.w);
    let rate = (plane.x * (v.x - x * v.w) + plane.y * (v.y - y * v.w)) / p.w;
    let c = speed::<P>(g);
    // The chart's speed along the surface is proportional to 1/w². On the sphere w stays above a half of its value
    // for the next w/2, and its rate is at most c; in the hyperbolic plane the rate of ln w is at most c.
    let room = if P::CURVATURE > 0.0 { p.w } else { 1.0 };
    Motion {
        value: plane.x * x + plane.y * y + plane.z * p.z + plane.w,
        rate: rate + plane.z * v.z,
        bend: 16.0 * c * rate.abs() / room,
        reach: 0.5 * room / c.max(VERTICAL),
    }
}

impl<P: Product> Geometry for P {
    fn components(&self) -> usize {
        4
    }

    fn base(&self) -> DVec4 {
        DVec4::W
    }

    fn settle(&self, components: DVec4) -> Option<DVec4> {
        P::SPACE.settle(slice(components)).map(|p| p + DVec4::Z * components.z)
    }

    fn settle_tangent(&self, p: DVec4, components: DVec4) -> DVec4 {
        P::SPACE.settle_tangent(slice(p), slice(components)) + DVec4::Z * components.z
    }

    fn inner(&self, _p: DVec4, u: DVec4, v: DVec4) -> f64 {
        form::<P>(u, v) + u.z * v.z
    }

    fn norm(&self, p: DVec4, v: DVec4) -> f64 {
        P::SPACE.norm(slice(p), slice(v)).hypot(v.z)
    }

    fn frame(&self, p: DVec4) -> [DVec4; 3] {
        P::SPACE.frame(slice(p))
    }

    fn flow_in<T: Elementary>(&self, g: RealGeodesic<T>, t: T) -> RealGeodesic<T> {
        let c = speed_in::<P, T>(g);
        let ((sine, cosine), ratio) = (P::sine_cosine(c * t), t * sine_ratio::<P, T>(c * t));
        let (p, h) = (slice_in(g.point), slice_in(g.velocity));
        let bend = T::from_f64(P::CURVATURE) * c * sine;
        let mut end = RealGeodesic { point: p * cosine + h * ratio, velocity: h * cosine - p * bend };
        end.point.z = g.point.z + g.velocity.z * t;
        end.velocity.z = g.velocity.z;
        end
    }

    fn log(&self, p: DVec4, q: DVec4) -> (DVec4, f64) {
        let (direction, along) = P::SPACE.log(slice(p), slice(q));
        let way = direction * along + DVec4::Z * (q.z - p.z);
        let length = along.hypot(q.z - p.z);
        if length > 0.0 { (way / length, length) } else { (DVec4::Z, 0.0) }
    }

    fn closeness(&self, _p: DVec4, _q: DVec4) -> f64 {
        // A distance in the surface cannot be combined with one along the line without an inverse cosine.
        f64::INFINITY
    }

    fn transport(&self, g: Geodesic, t: f64, w: DVec4) -> DVec4 {
        // In the surface w + ⟨h, w⟩ (h' − h)/c², with h' − h = −κ c² (p t sincκ(ct) + h t²/2 sincκ²(ct/2)).
        let (c, p, h) = (speed::<P>(g), slice(g.point), slice(g.velocity));
        let half = t * sine_ratio::<P, f64>(0.5 * c * t);
        let turned = p * (t * sine_ratio::<P, f64>(c * t)) + h * (0.5 * half * half);
        w - turned * (P::CURVATURE * form::<P>(h, w))
    }

    fn area_density(&self, g: Geodesic, t: f64) -> f64 {
        (t * t * sine_ratio::<P, f64>(speed::<P>(g) * t)).abs()
    }

    fn length(&self, _g: Geodesic, u: f64) -> f64 {
        u
    }

    fn parameter_at(&self, _g: Geodesic, t: f64) -> f64 {
        t
    }

    fn advance(&self, g: Geodesic, u: f64) -> Geodesic {
        self.flow(g, u)
    }

    fn side(&self, p: DVec4, plane: DVec4) -> f64 {
        let vertical = plane.x * p.x + plane.y * p.y;
        match kind(plane) {
            (true, _) => vertical + plane.w * p.w,
            _ => vertical / p.w + plane.z * p.z + plane.w,
        }
    }

    fn exit(&self, g: Geodesic, plane: DVec4, reach: f64) -> f64 {
        match kind(plane) {
            (true, _) => {
                // a cosκ(ct) + b t sincκ(ct) = 0 from below.
                let (a, b) = (plane.dot(g.point), plane.dot(g.velocity));
                let c = speed::<P>(g);
                if P::CURVATURE > 0.0 {
                    // tan(ct/2) = −ac / (√(a²c² + b²) + b).
                    let radius = (a * c).hypot(b);
                    if b > ALONG_FACE {
                        (2.0 * arc_over_speed::<P>(-a / (radius + b), c)).max(0.0)
                    } else if a < -ON_FACE && c > VERTICAL {
                        2.0 * (radius - b).atan2(-a * c) / c
                    } else {
                        f64::INFINITY
                    }
                } else if b > ALONG_FACE {
                    arc_over_speed::<P>(-a / b, c).max(0.0)
                } else {
                    f64::INFINITY
                }
            }
            (_, true) => {
                let rate = plane.z * g.velocity.z;
                if rate > ALONG_FACE { (-self.side(g.point, plane) / rate).max(0.0) } else { f64::INFINITY }
            }
            _ => first_passage(|t| {
                let ahead = self.flow(g, t);
                (t <= reach && ahead.point.w > ON_FACE && ahead.point.w.is_finite())
                    .then(|| chart_motion::<P>(ahead, plane))
            }),
        }
    }

    /// In the chart the geodesic goes along a straight line of the surface's part, so that the arc stays above it: in the
    /// flat strip with coordinates (s, z), s the length along the surface, the curve is the straight line with direction
    /// (c, b), and an arc that errs by δ along the surface is off by |b| δ. With the length σ from the line's nearest
    /// point to the base, and m = |d ln w/dσ| = |tanκ σ|, the chart's coordinate along the line is proportional to tanκ σ,
    /// whose third derivative is as long as c³ |6m² + 2κ| in the metric there. From its value m₀ at the start m grows to
    /// (m₀ + τ)/(1 − κ m₀ τ) at most, τ = tanκ S ≤ 1.1 S over a step of length S of the surface (and to 1 in the
    /// hyperbolic plane); lengths of chart vectors change by a factor of e^(2mS) at most.
    fn arc(&self, g: Geodesic, u_max: f64, tolerance: f64) -> f64 {
        let c = speed::<P>(g);
        let (lean, start) = (c * g.velocity.z.abs(), (g.velocity.w / g.point.w).abs());
        let limit = (0.45 / (c + 1.1 * start)).min(u_max);
        let third = |t: f64| {
            // m c at most.
            let growth = (start + 1.1 * c * c * t) / (1.0 - P::CURVATURE.max(0.0) * 1.1 * start * t);
            let growth = if P::CURVATURE < 0.0 { growth.min(c) } else { growth };
            let third = (6.0 * growth * growth + 2.0 * P::CURVATURE * c * c).max(2.0 * c * c);
            lean * third * (2.0 * growth * t).exp()
        };
        // Convex, but where m reaches 1.
        if P::CURVATURE < 0.0 {
            arc_bounds(0.0, limit, tolerance, third)[1]
        } else {
            longest_arc(limit, tolerance, third)
        }
    }

    fn parameter(&self, g: Geodesic, c: DVec3) -> f64 {
        // Foot of the perpendicular in the flat strip.
        let x = DVec4::new(c.x, c.y, 0.0, 1.0);
        let rise = g.velocity.z * (c.z - g.point.z);
        let speed = speed::<P>(g);
        if speed < 1e-9 {
            return rise;
        }
        let tangent = P::CURVATURE * form::<P>(x, g.velocity) / form::<P>(x, g.point);
        speed * P::arc_tangent(tangent / speed) + rise
    }

    fn restore(&self, g: Geodesic) -> Geodesic {
        let point = self.settle(g.point).unwrap_or(g.point);
        let velocity = self.settle_tangent(point, g.velocity);
        Geodesic { point, velocity: velocity / self.norm(point, velocity) }
    }

    fn chart(&self, p: DVec4) -> DVec3 {
        DVec3::new(p.x / p.w, p.y / p.w, p.z)
    }

    fn unchart(&self, c: DVec3) -> Option<DVec4> {
        P::SPACE.unchart(c.with_z(0.0)).map(|p| p + DVec4::Z * c.z)
    }

    fn chart_vector(&self, p: DVec4, v: DVec4) -> DVec3 {
        DVec3::new((v.x - p.x / p.w * v.w) / p.w, (v.y - p.y / p.w * v.w) / p.w, v.z)
    }

    fn unchart_vector(&self, p: DVec4, dc: DVec3) -> DVec4 {
        P::SPACE.unchart_vector(slice(p), dc.with_z(0.0)) + DVec4::Z * dc.z
    }

    /// `w²` times the chart's velocity along the surface is constant, `w⁻² = 1 + κ(x² + y²)`, and so is that along the
    /// line.
    fn spray<T: Real>(&self, c: Real3<T>, v: Real3<T>) -> Real3<T> {
        let number = T::from_f64;
        let curvature = number(P::CURVATURE);
        let rate =
            number(2.0) * curvature * (c.x * v.x + c.y * v.y) / (number(1.0) + curvature * (c.x * c.x + c.y * c.y));
        Real3::new(v.x * rate, v.y * rate, number(0.0))
    }

    fn raise(&self, p: DVec4, conormal: DVec3) -> DVec4 {
        let (x, y) = (conormal.x / p.w, conormal.y / p.w);
        let n = DVec4::new(x, y, conormal.z, -P::CURVATURE * (x * p.x + y * p.y) / p.w);
        n / self.norm(p, n)
    }

    fn lower(&self, p: DVec4, v: DVec4) -> DVec3 {
        DVec3::new(v.x * p.w, v.y * p.w, v.z)
    }

    fn volume_density(&self, c: DVec3) -> f64 {
        (1.0 + P::CURVATURE * c.truncate().length_squared()).powf(-1.5)
    }

    #[inline]
    fn apply(&self, m: &Isometry, g: Geodesic) -> Geodesic {
        Geodesic { point: m.linear * g.point + m.shift, velocity: m.linear * g.velocity }
    }

    fn fold(&self, plane: DVec4, pairing: &Isometry) -> Isometry {
        self.compose(pairing, &mirror::<P>(plane))
    }

    fn cross(&self, folded: &Isometry, plane: DVec4, g: Geodesic) -> Geodesic {
        self.apply(folded, reflect::<P>(plane, g))
    }

    fn compose(&self, a: &Isometry, b: &Isometry) -> Isometry {
        Isometry { linear: a.linear * b.linear, shift: a.linear * b.shift + a.shift }
    }

    fn inverse(&self, m: &Isometry) -> Isometry {
        let linear = gram::<P>() * m.linear.transpose() * gram::<P>();
        Isometry { linear, shift: -(linear * m.shift) }
    }

    fn isometry_residual(&self, m: &Isometry) -> f64 {
        let defect = m.linear.transpose() * gram::<P>() * m.linear - gram::<P>();
        // The line stays a line: nothing of it turns into the surface, and only it is shifted.
        let mixed = (slice(m.linear.z_axis), slice(m.linear.row(2)), slice(m.shift));
        let rest = [mixed.0, mixed.1, mixed.2].map(|v| v.abs().max_element());
        defect.to_cols_array().iter().chain(&rest).fold(0.0_f64, |worst, x| worst.max(x.abs()))
    }

    /// A plane only for points of the base point's slice or line; in between it is curved.
    fn bisector(&self, q: DVec4) -> Option<DVec4> {
        let in_line = q.x.abs().max(q.y.abs()) < SAME && q.w > 0.0;
        match (q.z.abs() < SAME, in_line) {
            (true, false) => P::SPACE.bisector(slice(q)),
            (false, true) => Some(DVec4::new(0.0, 0.0, q.z.signum(), -0.5 * q.z.abs())),
            _ => None,
        }
    }

    fn ball(&self, _centre: DVec4, _radius: f64) -> Option<Quadric> {
        None
    }

    fn tube(&self, _axis: Geodesic, _radius: f64) -> Option<Quadric> {
        None
    }
}
