//! SL(2, R) with the trace form, the space of the book's Figure 5.3. Twin: `shaders/geometry/sl2_trace.glsl`.
//!
//! This is **not** the Thurston geometry of SL(2, R) (see [`super::sl2`]): `⟨U, V⟩ = tr(UV)` on left-invariant fields
//! is `2dx² + 2dydz` at the identity, a Lorentzian metric, invariant from both sides. Geodesics are time-like,
//! null or space-like, and nothing is normalised: lengths are affine parameters.
//!
//! The book's chart is `(x, y, z)` for the matrix `[[1+x, y], [z, (1+yz)/(1+x)]]`, `x ≠ −1`. Points carry the fourth
//! entry less 1 as well, `(x, y, z, w)`, so that the group acts affinely and nothing is divided by `1 + x`. A tangent
//! vector is `(u, v, w, 0)` for the matrix `A = [[u, v], [w, −u]]` of the left-invariant frame.
//!
//! Flow: `p exp(tA) = p(C + S A)` with `C = cosh √q t`, `S = sinh √q t / √q`, `q = u² + vw`, entire functions of q. A
//! geodesic that reaches `x = −1` ends there, at the chart's edge.
//!
//! Where a positive size is needed (steps, tolerances, separations), [`Geometry::norm`] is the one in which the frame
//! is orthonormal: `√(2u² + v² + w²)`.

use super::{
    Elementary, Geodesic, Geometry, Isometry, Quadric, Real, Real3, Real4, RealGeodesic,
    curved::{
        arc_bounds, artanh_over, cosh_sinhc, first_passage, integrals, longest_arc, nearest_parameter, wave_area,
    },
};
use glam::{DMat2, DMat3, DMat4, DVec2, DVec3, DVec4, Vec4Swizzles};
use std::f64::consts::{FRAC_1_SQRT_2, SQRT_2};

/// SL(2, R) with the Lorentzian metric tr(UV).
#[derive(Clone, Copy, Debug)]
pub struct Sl2Trace;

/// Left multiplication by the matrix of the chart point `by`, where it has one: all numbers of both factors are
/// entries, so it is affine.
pub fn translation(by: DVec3) -> Isometry {
    let m = matrix(point(by));
    let rows = (m.transpose() - DMat2::IDENTITY).to_cols_array();
    let (a, b, c, d) = (m.x_axis.x, m.y_axis.x, m.x_axis.y, m.y_axis.y);
    let linear = DMat4::from_cols(
        DVec4::new(a, 0.0, c, 0.0),
        DVec4::new(0.0, a, 0.0, c),
        DVec4::new(b, 0.0, d, 0.0),
        DVec4::new(0.0, b, 0.0, d),
    );
    Isometry { linear, shift: DVec4::from_array(rows) }
}

/// The point with chart coordinates `c`; not finite where `x = −1`.
fn point(c: DVec3) -> DVec4 {
    c.extend((c.y * c.z - c.x) / (1.0 + c.x))
}

/// The matrix of a point.
fn matrix(p: DVec4) -> DMat2 {
    DMat2::from_cols(DVec2::new(1.0 + p.x, p.z), DVec2::new(p.y, 1.0 + p.w))
}

/// The matrix of a tangent vector.
fn algebra(v: DVec4) -> DMat2 {
    DMat2::from_cols(DVec2::new(v.x, v.z), DVec2::new(v.y, -v.x))
}

/// The traceless part of a matrix as a tangent vector.
fn traceless(m: DMat2) -> DVec4 {
    DVec4::new(0.5 * (m.x_axis.x - m.y_axis.y), m.y_axis.x, m.x_axis.y, 0.0)
}

/// Entries of a small matrix that is added to a point's.
fn entries(m: DMat2) -> DVec4 {
    DVec4::new(m.x_axis.x, m.y_axis.x, m.x_axis.y, m.y_axis.y)
}

/// The inverse of a matrix of determinant 1.
fn adjugate(m: DMat2) -> DMat2 {
    DMat2::from_cols(DVec2::new(m.y_axis.y, -m.x_axis.y), DVec2::new(-m.y_axis.x, m.x_axis.x))
}

/// `q` with `A² = q`.
fn square(v: DVec4) -> f64 {
    v.x * v.x + v.y * v.z
}

/// Components in the frame, in which `norm` is Euclidean.
fn framed(v: DVec4) -> DVec3 {
    DVec3::new(SQRT_2 * v.x, (v.y + v.z) * FRAC_1_SQRT_2, (v.z - v.y) * FRAC_1_SQRT_2)
}

/// The vector with these components in the frame.
fn unframed(c: DVec3) -> DVec4 {
    DVec4::new(c.x, c.y - c.z, c.y + c.z, 0.0) * FRAC_1_SQRT_2
}

/// A velocity with largest component 1, and that component: squares of the velocity itself may leave the numbers.
fn scaled<T: Elementary>(v: Real4<T>) -> (Real4<T>, T) {
    let scale = v.x.abs().max(v.y.abs()).max(v.z.abs()).max(T::SMALLEST);
    (v / scale, scale)
}

/// `exp(tA)` less the identity, by its entries.
fn exponential<T: Elementary>(v: Real4<T>, t: T) -> Real4<T> {
    let [zero, half, one] = [0.0, 0.5, 1.0].map(T::from_f64);
    let q = v.x * v.x + v.y * v.z;
    let (forth, root) = (v * t.signum(), q.max(zero).sqrt());
    let sinh = t.abs() * cosh_sinhc(q * t * t).1;
    let far = root * t.abs();
    if far < one {
        // C − 1 = 2 sinh²(√q t/2).
        let half_sinh = t * cosh_sinhc(T::from_f64(0.25) * q * t * t).1;
        let even = half * q * half_sinh * half_sinh;
        return Real4::new(even, zero, zero, even) + Real4::new(forth.x, forth.y, forth.z, -forth.x) * sinh;
    }
    // Of C ± S u one cancels: C + S A = e^(−√q t) + S(√q + A), where √q − |u| = vw/(√q + |u|).
    let (sum, difference) = (root + v.x.abs(), v.y * v.z / (root + v.x.abs()));
    let [first, last] = if forth.x > zero { [sum, difference] } else { [difference, sum] };
    let shrink = (-far).exp_m1();
    Real4::new(shrink, zero, zero, shrink) + Real4::new(first, forth.y, forth.z, last) * sinh
}

/// Length at which the geodesic reaches x = −1, forwards; infinite if it never does.
fn edge<T: Elementary>(g: RealGeodesic<T>) -> T {
    let first = T::from_f64(1.0) + g.point.x;
    let (v, scale) = scaled(g.velocity);
    let rate = first * v.x + g.point.y * v.z;
    artanh_over(v.x * v.x + v.y * v.z, first.abs(), -rate * first.signum()) / scale
}

/// Whether it reaches it within length `t`, of any sign.
fn meets_edge<T: Elementary>(g: RealGeodesic<T>, t: T) -> bool {
    edge(RealGeodesic { point: g.point, velocity: g.velocity * t.signum() }) <= t.abs()
}

impl Geometry for Sl2Trace {
    fn components(&self) -> usize {
        3
    }

    fn base(&self) -> DVec4 {
        DVec4::ZERO
    }

    fn settle(&self, components: DVec4) -> Option<DVec4> {
        Some(point(components.xyz())).filter(|p| p.is_finite())
    }

    fn settle_tangent(&self, _p: DVec4, components: DVec4) -> DVec4 {
        components.xyz().extend(0.0)
    }

    fn inner(&self, _p: DVec4, u: DVec4, v: DVec4) -> f64 {
        2.0 * u.x * v.x + u.y * v.z + u.z * v.y
    }

    fn norm(&self, _p: DVec4, v: DVec4) -> f64 {
        framed(v).length()
    }

    fn frame(&self, _p: DVec4) -> [DVec4; 3] {
        DVec3::AXES.map(unframed)
    }

    fn signature(&self) -> DVec3 {
        DVec3::new(1.0, 1.0, -1.0)
    }

    fn edge(&self, g: Geodesic, t: f64) -> Option<&'static str> {
        meets_edge(RealGeodesic::from_f64(g), t).then_some("x = -1, the edge of the chart")
    }

    fn flow_in<T: Elementary>(&self, g: RealGeodesic<T>, t: T) -> RealGeodesic<T> {
        if meets_edge(g, t) {
            return RealGeodesic { point: Real4::splat(T::from_f64(f64::INFINITY)), velocity: g.velocity };
        }
        let (v, scale) = scaled(g.velocity);
        let (p, one, e) = (g.point, T::from_f64(1.0), exponential(v, t * scale));
        let (first, last) = (one + p.x, one + p.w);
        let moved = Real4::new(
            first * e.x + p.y * e.z,
            first * e.y + p.y * e.w,
            p.z * e.x + last * e.z,
            p.z * e.y + last * e.w,
        );
        RealGeodesic { point: p + moved, velocity: g.velocity }
    }

    /// The one-parameter group through `p⁻¹q`, with a velocity of norm 1. Matrices of trace −2 or less are on none:
    /// then the length is infinite.
    fn log(&self, p: DVec4, q: DVec4) -> (DVec4, f64) {
        let difference = q - p;
        let step = adjugate(matrix(p)) * DMat2::from_cols(difference.xz(), difference.yw());
        let (sine, cosine) = (traceless(step), 1.0 + 0.5 * (step.x_axis.x + step.y_axis.y));
        let norm = framed(sine).length();
        if norm > 0.0 { (sine / norm, artanh_over(square(sine), 1.0, cosine) * norm) } else { (self.frame(p)[0], 0.0) }
    }

    fn closeness(&self, _p: DVec4, _q: DVec4) -> f64 {
        f64::INFINITY
    }

    /// Both factors of `exp(tA) = exp(tA/2) exp(tA/2)` share the turn: `w ↦ exp(−tA/2) w exp(tA/2)`.
    fn transport(&self, g: Geodesic, t: f64, w: DVec4) -> DVec4 {
        let (cosh, sinhc) = cosh_sinhc(0.25 * square(g.velocity) * t * t);
        let half = DMat2::from_diagonal(DVec2::splat(cosh)) + algebra(g.velocity) * (0.5 * t * sinhc);
        traceless(adjugate(half) * algebra(w) * half)
    }

    /// The area, in the frame's positive product, that the differential of the exponential map gives to the image of
    /// the frame's unit sphere.
    fn area_density(&self, g: Geodesic, t: f64) -> f64 {
        let v = framed(g.velocity);
        let (second, third) = integrals(4.0 * square(g.velocity) * t * t);
        // [E₁, E₂] = √2 E₃·(−1), [E₂, E₃] = √2 E₁, [E₃, E₁] = √2 E₂ for the frame Eᵢ.
        let bracket = |x: DVec3| v.cross(x) * DVec3::new(SQRT_2, SQRT_2, -SQRT_2);
        let column = |axis: DVec3| {
            let once = bracket(axis) * t;
            axis - once * second + bracket(once) * (t * third)
        };
        wave_area(DMat3::from_cols(column(DVec3::X), column(DVec3::Y), column(DVec3::Z)), v, t)
    }

    fn length(&self, _g: Geodesic, u: f64) -> f64 {
        u
    }

    fn parameter_at(&self, g: Geodesic, t: f64) -> f64 {
        let t = t.min(f64::MAX);
        if t < edge(RealGeodesic::from_f64(g)) { t } else { f64::INFINITY }
    }

    fn advance(&self, g: Geodesic, u: f64) -> Geodesic {
        self.flow(g, u)
    }

    fn side(&self, p: DVec4, plane: DVec4) -> f64 {
        plane.xyz().dot(p.xyz()) + plane.w
    }

    fn exit(&self, g: Geodesic, plane: DVec4, _reach: f64) -> f64 {
        // Entries are α + β C + γ S; with τ = tanh(√q t/2)/√q that is (α+β + 2γτ + q(β−α)τ²)/(1 − qτ²).
        let (n, q) = (plane.xyz(), square(g.velocity));
        let even = n.dot(g.point.xyz()) + n.x;
        let rate = n.dot(entries(matrix(g.point) * algebra(g.velocity)).xyz());
        let start = self.side(g.point, plane);
        let start = if start.abs() <= super::ON_FACE { 0.0 } else { start };
        let exit = first_passage(q, start, rate, q * (even - plane.w + n.x));
        if exit < edge(RealGeodesic::from_f64(g)) { exit } else { f64::INFINITY }
    }

    /// Measured by [`Geometry::norm`]. The chart's third derivative is `q` times its velocity, of norm |q| n. Along a
    /// geodesic of norm n arctan β, `β = y/(1+x)`, grows at a rate of at most n, and the norm of a chart vector by at most a
    /// factor `exp(n(1 + √(1+β²)))` for each unit of length, so over a step h it is bounded by its value at
    /// `tan(arctan |β| + n h)`. Steps end halfway to that bound's pole.
    fn arc(&self, g: Geodesic, u_max: f64, tolerance: f64) -> f64 {
        let (norm, q) = (framed(g.velocity).length(), square(g.velocity).abs());
        let slope = (g.point.y / (1.0 + g.point.x)).abs().atan();
        let limit = u_max.min(0.5 * (std::f64::consts::FRAC_PI_2 - slope) / norm);
        let third = |h: f64| {
            let beta = (slope + norm * h).tan();
            q * norm * (norm * h * (1.0 + beta.hypot(1.0))).exp()
        };
        // The bound counts what lies along the curve as well, so arcs are short: the most is made of it.
        arc_bounds(longest_arc(limit, tolerance, third), limit, tolerance, third)[1]
    }

    fn parameter(&self, g: Geodesic, c: DVec3) -> f64 {
        nearest_parameter(*self, g, c, |a, b| framed(a).dot(framed(b)))
    }

    /// The fourth entry follows from the others; velocities of any length stay as they are.
    fn restore(&self, g: Geodesic) -> Geodesic {
        Geodesic { point: point(g.point.xyz()), velocity: g.velocity.xyz().extend(0.0) }
    }

    fn chart(&self, p: DVec4) -> DVec3 {
        p.xyz()
    }

    fn unchart(&self, c: DVec3) -> Option<DVec4> {
        Some(point(c)).filter(|p| p.is_finite())
    }

    fn chart_vector(&self, p: DVec4, v: DVec4) -> DVec3 {
        entries(matrix(p) * algebra(v)).xyz()
    }

    fn unchart_vector(&self, p: DVec4, dc: DVec3) -> DVec4 {
        // The fourth entry moves so that the determinant stays 1.
        let m = matrix(p);
        let fourth = (dc.y * p.z + p.y * dc.z - m.y_axis.y * dc.x) / m.x_axis.x;
        traceless(adjugate(m) * DMat2::from_cols(DVec2::new(dc.x, dc.z), DVec2::new(dc.y, fourth)))
    }

    /// `p″ = q p` for the matrix, with `−q` the determinant of its velocity.
    fn spray<T: Real>(&self, c: Real3<T>, v: Real3<T>) -> Real3<T> {
        let one = T::from_f64(1.0);
        let first = one + c.x;
        let fourth = (v.y * c.z + c.y * v.z - v.x * (one + c.y * c.z) / first) / first;
        let q = v.y * v.z - v.x * fourth;
        Real3::new(first * q, c.y * q, c.z * q)
    }

    fn raise(&self, p: DVec4, conormal: DVec3) -> DVec4 {
        let along = |e: DVec4| conormal.dot(entries(matrix(p) * algebra(e)).xyz());
        unframed((DVec3::from_array(self.frame(p).map(along)) * self.signature()).normalize())
    }

    fn lower(&self, p: DVec4, v: DVec4) -> DVec3 {
        DVec3::from_array(DVec3::AXES.map(|axis| self.inner(p, v, self.unchart_vector(p, axis))))
    }

    fn volume_density(&self, c: DVec3) -> f64 {
        SQRT_2 / (1.0 + c.x).abs()
    }

    #[inline]
    fn apply(&self, m: &Isometry, g: Geodesic) -> Geodesic {
        Geodesic { point: m.linear * g.point + m.shift, velocity: g.velocity }
    }

    fn compose(&self, a: &Isometry, b: &Isometry) -> Isometry {
        Isometry { linear: a.linear * b.linear, shift: a.linear * b.shift + a.shift }
    }

    fn inverse(&self, m: &Isometry) -> Isometry {
        let linear = m.linear.inverse();
        Isometry { linear, shift: -(linear * m.shift) }
    }

    fn isometry_residual(&self, m: &Isometry) -> f64 {
        let rebuilt = translation(m.shift.xyz());
        let difference = (m.linear - rebuilt.linear).to_cols_array();
        difference.iter().fold((m.shift - rebuilt.shift).abs().max_element(), |worst, x| worst.max(x.abs()))
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
