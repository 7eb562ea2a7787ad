//! Sol. Twin: `shaders/geometry/sol.glsl`.
//!
//! Points are `(x, y, z, 1)` with the product `(x,y,z)(x',y',z') = (x + eᶻx', y + e⁻ᶻy', z + z')` and the metric
//! `e⁻²ᶻdx² + e²ᶻdy² + dz²`. Tangent vectors are `(u, v, w, 0)` in the left-invariant orthonormal frame
//! `eᶻ∂x, e⁻ᶻ∂y, ∂z`, which left multiplications leave as they are. The chart is `(x, y, z)`, the curve parameter
//! arc length.
//!
//! Flow. The momenta `A = u e⁻ᶻ`, `B = v eᶻ` are constant, which leaves one equation `z″ = B²e⁻²ᶻ − A²e²ᶻ` and two
//! integrals `x′ = A e²ᶻ`, `y′ = B e⁻²ᶻ`. With `P = e²ᶻ`, `Q = e⁻²ᶻ` it is quadratic, and the Taylor series of its
//! solution follows from two products of series for each order. Speed 1 keeps the nearest complex singularity π/2
//! away (`w = −tanh t` in the plane y = 0 has it there), so steps of 1/4 gain a factor 6 with each order and order
//! [`ORDER`] is exact to rounding; in f32, as in the twin, steps of 1/2 and order 14 are. Each step starts from the
//! identity of the group, so numbers stay of order 1, and no direction is special: neither vanishing momenta nor
//! `u = v`, where the closed form in elliptic functions ([`elliptic`]) loses its digits.
//!
//! Long geodesics. z is periodic with the period `2π / agm(√(1+2k), 2√k)`, `k = |uv|`, and x, y advance by the same
//! amounts in each; beyond length 64 whole periods are counted, not walked.

pub mod elliptic;
mod series;

use super::{
    Elementary, Geodesic, Geometry, Isometry, Quadric, Real, Real3, RealGeodesic,
    curved::{before_passage, first_zero, longest_arc, nearest_parameter, shoot, wave_area},
    spatial,
};
use glam::{DMat3, DMat4, DVec3, DVec4, Vec4Swizzles};
use series::{Track, differential, spreading};

pub use series::{ORDER, endpoint_with};

/// The solvable group Sol with its left-invariant metric.
#[derive(Clone, Copy, Debug)]
pub struct Sol;

/// Longest arc, and how far ahead [`Geometry::exit`] looks: a walk takes at most one arc at a time, so it meets every
/// passage.
const HORIZON: f64 = 1.0;

/// Left multiplication by the group element `by`.
pub fn translation(by: DVec3) -> Isometry {
    let scale = DVec3::new(by.z.exp(), (-by.z).exp(), 1.0);
    Isometry::linear(DMat4::from_cols(DVec4::X * scale.x, DVec4::Y * scale.y, DVec4::Z, by.extend(1.0)))
}

/// `(e^z x, e^{−z} y)` for a possibly infinite exponential: nothing stays nothing.
fn stretch<T: Elementary>(z: T, x: T, y: T) -> [T; 2] {
    let zero = T::from_f64(0.0);
    let by = |factor: T, length: T| if length == zero { zero } else { factor * length };
    [by(z.exp(), x), by((-z).exp(), y)]
}

/// The product of group elements.
fn product<T: Elementary>(a: Real3<T>, b: Real3<T>) -> Real3<T> {
    let [x, y] = stretch(a.z, b.x, b.y);
    Real3::new(a.x + x, a.y + y, a.z + b.z)
}

/// Displacement from `p` to `q` in coordinates about `p`: the group element `p⁻¹q`.
fn relative(p: DVec3, q: DVec3) -> DVec3 {
    let [x, y] = stretch(-p.z, q.x - p.x, q.y - p.y);
    DVec3::new(x, y, q.z - p.z)
}

/// Velocity at the identity whose geodesic has passed `q` after unit time. In the planes x = 0 and y = 0, which are
/// hyperbolic, the two closed forms are exact, and their sum is the guess elsewhere.
fn logarithm(q: DVec3) -> DVec3 {
    let plane = |x: f64, z: f64| {
        // Upper half plane with height e^z: from the height 1 to (x, e^z).
        let [_, scaled] = stretch(z, 0.0, x);
        let half = 0.5 * (x * scaled + 4.0 * (0.5 * z).sinh().powi(2)).sqrt();
        let length = 2.0 * half.asinh();
        let share = if length > 1e-8 { length / length.sinh() } else { 1.0 };
        [share * scaled, share * (0.5 * x * scaled + z.sinh())]
    };
    let ([u, w], [v, fall]) = (plane(q.x, q.z), plane(q.y, -q.z));
    shoot(DVec3::new(u, v, w - fall - q.z), |v| {
        let length = v.length();
        let unit = if length > 0.0 { v / length } else { DVec3::Z };
        let (end, differential) = differential(unit, length);
        (relative(end, q), differential)
    })
}

impl Geometry for Sol {
    fn components(&self) -> usize {
        3
    }

    fn base(&self) -> DVec4 {
        DVec4::W
    }

    fn settle(&self, components: DVec4) -> Option<DVec4> {
        Some(components.xyz().extend(1.0))
    }

    fn settle_tangent(&self, _p: DVec4, components: DVec4) -> DVec4 {
        components.xyz().extend(0.0)
    }

    fn inner(&self, _p: DVec4, u: DVec4, v: DVec4) -> f64 {
        spatial(u).dot(spatial(v))
    }

    fn norm(&self, _p: DVec4, v: DVec4) -> f64 {
        spatial(v).length()
    }

    fn frame(&self, _p: DVec4) -> [DVec4; 3] {
        [DVec4::X, DVec4::Y, DVec4::Z]
    }

    fn flow_in<T: Elementary>(&self, g: RealGeodesic<T>, t: T) -> RealGeodesic<T> {
        let (end, velocity) = series::flow(g.velocity.xyz(), t);
        let point = product(g.point.xyz(), end);
        RealGeodesic { point: point.extend(T::from_f64(1.0)), velocity: velocity.extend(T::from_f64(0.0)) }
    }

    /// Newton's method on the end point. Up to a distance of 4 it finds the shortest geodesic (the first conjugate
    /// points are √2 π away); farther away there may be several, of which it finds one near the shortest, or, where it
    /// does not converge, the best approximation met. The result is finite.
    fn log(&self, p: DVec4, q: DVec4) -> (DVec4, f64) {
        let v = logarithm(relative(spatial(p), spatial(q)));
        let length = v.length();
        (if length > 0.0 { (v / length).extend(0.0) } else { DVec4::X }, length)
    }

    fn closeness(&self, _p: DVec4, _q: DVec4) -> f64 {
        f64::INFINITY
    }

    fn transport(&self, g: Geodesic, t: f64, w: DVec4) -> DVec4 {
        series::transport(spatial(g.velocity), t, spatial(w)).extend(0.0)
    }

    fn area_density(&self, g: Geodesic, t: f64) -> f64 {
        let v = spatial(g.velocity);
        wave_area(spreading(v, t), v, t)
    }

    fn length(&self, _g: Geodesic, u: f64) -> f64 {
        u
    }

    fn parameter_at(&self, _g: Geodesic, t: f64) -> f64 {
        // Finite, so that a walk without end goes on by arcs.
        t.min(f64::MAX)
    }

    fn advance(&self, g: Geodesic, u: f64) -> Geodesic {
        self.flow(g, u)
    }

    fn side(&self, p: DVec4, plane: DVec4) -> f64 {
        plane.dot(p)
    }

    /// Looks `HORIZON` ahead at most, as far as an arc can reach.
    fn exit(&self, g: Geodesic, plane: DVec4, reach: f64) -> f64 {
        let [a, b] = stretch(g.point.z, plane.x, plane.y);
        let rate = DVec3::new(a, b, plane.z).dot(spatial(g.velocity));
        let Some(threshold) = before_passage(self.side(g.point, plane), rate) else { return 0.0 };
        let mut track = Track::new(Real3::from_f64(spatial(g.velocity)));
        let mut travelled = 0.0;
        let limit = reach.min(HORIZON);
        while travelled < limit {
            let here = product(Real3::from_f64(spatial(g.point)), track.point()).to_f64();
            let [a, b] = stretch(here.z, plane.x, plane.y);
            let start = plane.dot(here.extend(1.0)) - threshold;
            let series = track.series();
            // |x″| = 2|u w| e^z in the coordinates of the step, with |u w| ≤ 1/2; |z″| ≤ 1.
            let bend = (a.abs() + b.abs()) * series::STEP.exp() + plane.z.abs();
            let conormal = DVec3::new(a, b, plane.z);
            let value = |s: f64| {
                let (end, rate) = series.chart(s);
                [start + conormal.dot(end.to_f64()), conormal.dot(rate.to_f64())]
            };
            if let Some(s) = first_zero(value, bend, series::STEP.min(limit - travelled)) {
                return travelled + s;
            }
            track.step(&series, series::STEP);
            travelled += series::STEP;
        }
        f64::INFINITY
    }

    /// In coordinates about any of its points the curve's third derivative is
    /// `(2u(2w² + v² − u²), 2v(2w² + u² − v²), −2w(u² + v²))`, and its length `j` changes at a rate of at most 2.93 (maximum
    /// over unit velocities, found numerically). The metric's length of a chart vector changes by at most a factor eʰ
    /// along a step h. So over a step the third derivative is at most `(j + 2.93 h) eʰ`, wherever in the step it is measured.
    fn arc(&self, g: Geodesic, u_max: f64, tolerance: f64) -> f64 {
        let DVec3 { x: u, y: v, z: w } = spatial(g.velocity);
        let (uu, vv, ww) = (u * u, v * v, w * w);
        let third = 2.0 * DVec3::new(u * (2.0 * ww + vv - uu), v * (2.0 * ww + uu - vv), w * (uu + vv)).length();
        longest_arc(u_max.min(HORIZON), tolerance, |h| (third + 2.93 * h) * h.exp())
    }

    fn parameter(&self, g: Geodesic, c: DVec3) -> f64 {
        nearest_parameter(*self, g, c, |a, b| a.dot(b))
    }

    fn restore(&self, g: Geodesic) -> Geodesic {
        Geodesic { point: g.point, velocity: g.velocity.normalize() }
    }

    fn chart(&self, p: DVec4) -> DVec3 {
        spatial(p)
    }

    fn unchart(&self, c: DVec3) -> Option<DVec4> {
        Some(c.extend(1.0))
    }

    fn chart_vector(&self, p: DVec4, v: DVec4) -> DVec3 {
        let [x, y] = stretch(p.z, v.x, v.y);
        DVec3::new(x, y, v.z)
    }

    fn unchart_vector(&self, p: DVec4, dc: DVec3) -> DVec4 {
        let [x, y] = stretch(-p.z, dc.x, dc.y);
        DVec4::new(x, y, dc.z, 0.0)
    }

    fn spray<T: Real>(&self, c: Real3<T>, v: Real3<T>) -> Real3<T> {
        let rate = T::from_f64(2.0) * v.z;
        let (wide, narrow) = (c.z.exp(), (-c.z).exp());
        let (u, w) = (v.x * narrow, v.y * wide);
        Real3::new(rate * v.x, -(rate * v.y), w * w - u * u)
    }

    fn raise(&self, p: DVec4, conormal: DVec3) -> DVec4 {
        let [x, y] = stretch(p.z, conormal.x, conormal.y);
        DVec4::new(x, y, conormal.z, 0.0).normalize()
    }

    fn lower(&self, p: DVec4, v: DVec4) -> DVec3 {
        let [x, y] = stretch(-p.z, v.x, v.y);
        DVec3::new(x, y, v.z)
    }

    fn volume_density(&self, _c: DVec3) -> f64 {
        1.0
    }

    #[inline]
    fn apply(&self, m: &Isometry, g: Geodesic) -> Geodesic {
        Geodesic { point: m.linear * g.point, velocity: g.velocity }
    }

    fn inverse(&self, m: &Isometry) -> Isometry {
        let scale = DMat3::from_mat4(m.linear).inverse();
        let shift = -(scale * spatial(m.linear.w_axis));
        Isometry::linear(DMat4::from_cols(
            scale.x_axis.extend(0.0),
            scale.y_axis.extend(0.0),
            scale.z_axis.extend(0.0),
            shift.extend(1.0),
        ))
    }

    fn isometry_residual(&self, m: &Isometry) -> f64 {
        let difference = (m.linear - translation(spatial(m.linear.w_axis)).linear).to_cols_array();
        difference.iter().fold(0.0_f64, |worst, x| worst.max(x.abs()))
    }

    fn bisector(&self, _q: DVec4) -> Option<DVec4> {
        None
    }

    fn ball(&self, _centre: DVec4, _radius: f64) -> Option<Quadric> {
        None
    }

    fn tube(&self, _axis: Geodesic, _radius: f64) -> Option<Quadric> {
        None
    }
}
