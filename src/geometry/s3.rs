//! The unit three-sphere in R⁴. Twin: `shaders/geometry/s3.glsl`.
//!
//! Metric: the restriction of the Euclidean inner product. Chart: gnomonic, `xyz/w`, valid for `w > 0`, in which
//! great circles are straight. Flow: `p cos t + v sin t`. Curve parameter: `tan(t/2)`, so that a ray passes the
//! quarter turn, where the gnomonic `tan t` is infinite, without a special case.

use super::{
    ALONG_FACE, Elementary, Geodesic, Geometry, Isometry, ON_FACE, Quadric, Real, Real3, RealGeodesic, across,
    hypotenuse, matrix_of, spatial,
};
use glam::{DMat4, DVec3, DVec4};
use std::f64::consts::PI;

/// The three-sphere of curvature 1.
#[derive(Clone, Copy, Debug)]
pub struct S3;

impl Geometry for S3 {
    const STRAIGHT: bool = true;

    fn components(&self) -> usize {
        4
    }

    fn base(&self) -> DVec4 {
        DVec4::W
    }

    fn settle(&self, components: DVec4) -> Option<DVec4> {
        let scale = components.abs().max_element();
        (scale > 0.0 && scale.is_finite()).then(|| (components / scale).normalize())
    }

    fn settle_tangent(&self, p: DVec4, components: DVec4) -> DVec4 {
        let v = components - p * p.dot(components);
        // A second projection removes what rounding left of the first when the direction was almost normal.
        v - p * p.dot(v)
    }

    fn inner(&self, _p: DVec4, u: DVec4, v: DVec4) -> f64 {
        u.dot(v)
    }

    fn norm(&self, _p: DVec4, v: DVec4) -> f64 {
        v.length()
    }

    fn frame(&self, p: DVec4) -> [DVec4; 3] {
        // The coordinate frame of the base point, parallel along the great circle to p.
        let bridge = (DVec4::W + p) / (1.0 + p.w);
        [DVec4::X - bridge * p.x, DVec4::Y - bridge * p.y, DVec4::Z - bridge * p.z]
    }

    fn flow_in<T: Elementary>(&self, g: RealGeodesic<T>, t: T) -> RealGeodesic<T> {
        let (sin, cos) = t.sin_cos();
        RealGeodesic { point: g.point * cos + g.velocity * sin, velocity: g.velocity * cos - g.point * sin }
    }

    fn log(&self, p: DVec4, q: DVec4) -> (DVec4, f64) {
        let difference = q - p;
        let length = 2.0 * difference.length().atan2((q + p).length());
        let tangent = difference - p * p.dot(difference);
        let norm = tangent.length();
        if norm > 0.0 { (tangent / norm, length) } else { (self.frame(p)[0], length) }
    }

    fn closeness(&self, p: DVec4, q: DVec4) -> f64 {
        p.dot(q)
    }

    fn transport(&self, g: Geodesic, t: f64, w: DVec4) -> DVec4 {
        w + (self.flow(g, t).velocity - g.velocity) * g.velocity.dot(w)
    }

    fn area_density(&self, _g: Geodesic, t: f64) -> f64 {
        t.sin() * t.sin()
    }

    fn length(&self, _g: Geodesic, u: f64) -> f64 {
        2.0 * u.atan()
    }

    fn parameter_at(&self, _g: Geodesic, t: f64) -> f64 {
        if t < PI { (0.5 * t).tan() } else { f64::INFINITY }
    }

    fn advance(&self, g: Geodesic, u: f64) -> Geodesic {
        let scale = 1.0 / (1.0 + u * u);
        let (cos, sin) = ((1.0 - u * u) * scale, 2.0 * u * scale);
        Geodesic { point: g.point * cos + g.velocity * sin, velocity: g.velocity * cos - g.point * sin }
    }

    fn side(&self, p: DVec4, plane: DVec4) -> f64 {
        plane.dot(p)
    }

    fn exit(&self, g: Geodesic, plane: DVec4, _reach: f64) -> f64 {
        // a cos t + b sin t = 0 from below: tan(t/2) = -a / (√(a²+b²) + b).
        let (a, b) = (plane.dot(g.point), plane.dot(g.velocity));
        let radius = hypotenuse(a, b);
        if b > ALONG_FACE {
            (-a / (radius + b)).max(0.0)
        } else if a < -ON_FACE {
            (radius - b) / -a
        } else {
            f64::INFINITY
        }
    }

    fn arc(&self, _g: Geodesic, u_max: f64, _tolerance: f64) -> f64 {
        u_max
    }

    fn parameter(&self, g: Geodesic, c: DVec3) -> f64 {
        let x = c.extend(1.0);
        let (cos, sin) = (x.dot(g.point), x.dot(g.velocity));
        sin / (cos + cos.hypot(sin))
    }

    fn restore(&self, g: Geodesic) -> Geodesic {
        let point = g.point.normalize();
        let velocity = (g.velocity - point * point.dot(g.velocity)).normalize();
        Geodesic { point, velocity }
    }

    fn chart(&self, p: DVec4) -> DVec3 {
        spatial(p) / p.w
    }

    fn unchart(&self, c: DVec3) -> Option<DVec4> {
        Some(c.extend(1.0).normalize())
    }

    fn chart_vector(&self, p: DVec4, v: DVec4) -> DVec3 {
        (spatial(v) - self.chart(p) * v.w) / p.w
    }

    fn unchart_vector(&self, p: DVec4, dc: DVec3) -> DVec4 {
        let lifted = dc.extend(0.0);
        (lifted - p * p.dot(lifted)) * p.w
    }

    /// `w² c'` is constant along a geodesic, w⁻² = 1 + |c|².
    fn spray<T: Real>(&self, c: Real3<T>, v: Real3<T>) -> Real3<T> {
        v * (T::from_f64(2.0) * c.dot(v) / (T::from_f64(1.0) + c.dot(c)))
    }

    fn raise(&self, p: DVec4, conormal: DVec3) -> DVec4 {
        conormal.extend(-conormal.dot(self.chart(p))).normalize()
    }

    fn lower(&self, p: DVec4, v: DVec4) -> DVec3 {
        spatial(v) * p.w
    }

    fn volume_density(&self, c: DVec3) -> f64 {
        (1.0 + c.length_squared()).powi(-2)
    }

    #[inline]
    fn apply(&self, m: &Isometry, g: Geodesic) -> Geodesic {
        Geodesic { point: m.linear * g.point, velocity: m.linear * g.velocity }
    }

    fn fold(&self, plane: DVec4, pairing: &Isometry) -> Isometry {
        Isometry::linear(pairing.linear * matrix_of(|x| reflect(plane, x)))
    }

    fn cross(&self, folded: &Isometry, plane: DVec4, g: Geodesic) -> Geodesic {
        self.apply(folded, Geodesic { point: reflect(plane, g.point), velocity: reflect(plane, g.velocity) })
    }

    fn inverse(&self, m: &Isometry) -> Isometry {
        Isometry::linear(m.linear.transpose())
    }

    fn isometry_residual(&self, m: &Isometry) -> f64 {
        let gram = m.linear.transpose() * m.linear - DMat4::IDENTITY;
        gram.to_cols_array().iter().fold(0.0_f64, |worst, x| worst.max(x.abs()))
    }

    fn bisector(&self, q: DVec4) -> Option<DVec4> {
        let difference = q - self.base();
        let norm = difference.length();
        (norm > 0.0).then(|| difference / norm)
    }

    fn ball(&self, centre: DVec4, radius: f64) -> Option<Quadric> {
        // The squared sine of the distance from c is the part of |x|² normal to c.
        let share = radius.sin().powi(2);
        Some(Quadric { forms: self.frame(centre), quadratic: share, constant: share })
    }

    fn tube(&self, axis: Geodesic, radius: f64) -> Option<Quadric> {
        let [a, b] = across(*self, axis);
        let share = radius.sin().powi(2);
        Some(Quadric { forms: [a, b, DVec4::ZERO], quadratic: share, constant: share })
    }
}

/// Reflection of a point or a vector in the great sphere with unit normal `plane`.
fn reflect(plane: DVec4, x: DVec4) -> DVec4 {
    x - plane * (2.0 * plane.dot(x))
}
