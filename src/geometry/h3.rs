//! Hyperbolic space, the upper sheet of the hyperboloid in R^{3,1}. Twin: `shaders/geometry/h3.glsl`.
//!
//! Metric: the restriction of ⟨u, v⟩ = u·v − 2 u_w v_w (signature +++−). Chart: Klein, `xyz/w`, in which
//! geodesics are straight. Flow: `p cosh t + v sinh t`. Curve parameter: `tanh t`, so that walking through a
//! cell needs one square root and no exponential. It reaches 1 at arc length 19 in f64 (9 in f32), beyond the
//! diameter of any cell that a chart in these numbers can hold.
//!
//! Far from the base point ambient components grow like eᵈ. Lengths are therefore taken from the radial and the
//! transverse part of a vector, which do not cancel; see [`Geometry::norm`].

use super::{
    ALONG_FACE, Elementary, Geodesic, Geometry, Isometry, Quadric, Real, Real3, Real4, RealGeodesic, across,
    hypotenuse, matrix_of, spatial,
};
use glam::{DMat4, DVec3, DVec4, Vec4Swizzles};

/// Hyperbolic three-space of curvature −1.
#[derive(Clone, Copy, Debug)]
pub struct H3;

impl Geometry for H3 {
    const STRAIGHT: bool = true;

    fn components(&self) -> usize {
        4
    }

    fn base(&self) -> DVec4 {
        DVec4::W
    }

    fn settle(&self, components: DVec4) -> Option<DVec4> {
        let x = components.xyz();
        Some(x.extend(x.length().hypot(1.0)))
    }

    fn settle_tangent(&self, p: DVec4, components: DVec4) -> DVec4 {
        // v + ⟨v, p⟩ p. The product cancels by a factor e²ᵈ, so it is summed in twice the working precision,
        // with the digits of w that its rounding cut off.
        let x = spatial(p);
        let w_tail = tail_of_w(x, p.w);
        let mut product = CompensatedSum::default();
        product.add_product(components.x, p.x);
        product.add_product(components.y, p.y);
        product.add_product(components.z, p.z);
        product.add_product(-components.w, p.w);
        product.add_product(-components.w, w_tail);
        let v = spatial(components) + x * product.value();
        v.extend(v.dot(x) / p.w)
    }

    fn inner(&self, _p: DVec4, u: DVec4, v: DVec4) -> f64 {
        minkowski(u, v)
    }

    fn norm(&self, p: DVec4, v: DVec4) -> f64 {
        norm(Real4::from_f64(p), Real4::from_f64(v))
    }

    fn frame(&self, p: DVec4) -> [DVec4; 3] {
        // The coordinate frame of the base point, parallel along the geodesic to p.
        let bridge = (DVec4::W + p) / (1.0 + p.w);
        [DVec4::X + bridge * p.x, DVec4::Y + bridge * p.y, DVec4::Z + bridge * p.z]
    }

    fn flow_in<T: Elementary>(&self, g: RealGeodesic<T>, t: T) -> RealGeodesic<T> {
        let (sinh, cosh) = (t.sinh(), t.cosh());
        RealGeodesic { point: g.point * cosh + g.velocity * sinh, velocity: g.velocity * cosh + g.point * sinh }
    }

    fn log(&self, p: DVec4, q: DVec4) -> (DVec4, f64) {
        let difference = q - p;
        let tangent = difference + p * minkowski(p, difference);
        // sinh d. The chord is exact for near points, and far away a small difference of large squares.
        let norm = self.norm(p, tangent);
        let length = if norm > 1.0 {
            norm.asinh()
        } else {
            2.0 * (0.5 * minkowski(difference, difference).max(0.0).sqrt()).asinh()
        };
        if norm > 0.0 { (tangent / norm, length) } else { (self.frame(p)[0], length) }
    }

    fn closeness(&self, p: DVec4, q: DVec4) -> f64 {
        minkowski(p, q)
    }

    fn transport(&self, g: Geodesic, t: f64, w: DVec4) -> DVec4 {
        w + (self.flow(g, t).velocity - g.velocity) * minkowski(g.velocity, w)
    }

    fn area_density(&self, _g: Geodesic, t: f64) -> f64 {
        t.sinh() * t.sinh()
    }

    fn length(&self, _g: Geodesic, u: f64) -> f64 {
        u.atanh()
    }

    fn parameter_at(&self, _g: Geodesic, t: f64) -> f64 {
        // From here on tanh t rounds to 1, where the geodesic's end lies.
        if t < 18.0 { t.tanh() } else { f64::INFINITY }
    }

    fn advance(&self, g: Geodesic, u: f64) -> Geodesic {
        let scale = ((1.0 - u) * (1.0 + u)).sqrt().recip();
        Geodesic { point: (g.point + g.velocity * u) * scale, velocity: (g.velocity + g.point * u) * scale }
    }

    fn side(&self, p: DVec4, plane: DVec4) -> f64 {
        plane.dot(p)
    }

    fn exit(&self, g: Geodesic, plane: DVec4, _reach: f64) -> f64 {
        let rate = plane.dot(g.velocity);
        // Divided in any case: a branch that nobody can foresee costs more.
        let u = (-plane.dot(g.point) / rate).max(0.0);
        if (rate > ALONG_FACE) & (u < 1.0) { u } else { f64::INFINITY }
    }

    fn arc(&self, _g: Geodesic, u_max: f64, _tolerance: f64) -> f64 {
        u_max
    }

    fn parameter(&self, g: Geodesic, c: DVec3) -> f64 {
        let x = c.extend(1.0);
        minkowski(x, g.velocity) / -minkowski(x, g.point)
    }

    fn restore(&self, g: Geodesic) -> Geodesic {
        let x = spatial(g.point);
        let point = x.extend((1.0 + x.length_squared()).sqrt());
        let tangent = spatial(g.velocity) + x * minkowski(point, g.velocity);
        // ⟨v, v⟩ = v² − (p·v)²/w² by Lagrange's identity, without what cancels far from the base point: cheaper than
        // `norm`, and a rounding worse.
        let norm_w = (tangent.length_squared() + x.cross(tangent).length_squared()).sqrt();
        Geodesic { point, velocity: (tangent * point.w).extend(tangent.dot(x)) / norm_w }
    }

    fn chart(&self, p: DVec4) -> DVec3 {
        spatial(p) / p.w
    }

    fn unchart(&self, c: DVec3) -> Option<DVec4> {
        let r = c.length();
        (r < 1.0).then(|| c.extend(1.0) / ((1.0 - r) * (1.0 + r)).sqrt())
    }

    fn chart_vector(&self, p: DVec4, v: DVec4) -> DVec3 {
        (spatial(v) - self.chart(p) * v.w) / p.w
    }

    fn unchart_vector(&self, p: DVec4, dc: DVec3) -> DVec4 {
        let lifted = dc.extend(0.0);
        (lifted + p * minkowski(p, lifted)) * p.w
    }

    /// `w² c'` is constant along a geodesic, w⁻² = 1 − |c|².
    fn spray<T: Real>(&self, c: Real3<T>, v: Real3<T>) -> Real3<T> {
        v * (T::from_f64(-2.0) * c.dot(v) / (T::from_f64(1.0) - c.dot(c)))
    }

    fn raise(&self, p: DVec4, conormal: DVec3) -> DVec4 {
        let n = conormal.extend(conormal.dot(self.chart(p)));
        n / self.norm(p, n)
    }

    fn lower(&self, p: DVec4, v: DVec4) -> DVec3 {
        spatial(v) * p.w
    }

    fn volume_density(&self, c: DVec3) -> f64 {
        (1.0 - c.length_squared()).powi(-2)
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
        Isometry::linear(FORM * m.linear.transpose() * FORM)
    }

    fn isometry_residual(&self, m: &Isometry) -> f64 {
        let gram = m.linear.transpose() * FORM * m.linear - FORM;
        gram.to_cols_array().iter().fold(0.0_f64, |worst, x| worst.max(x.abs()))
    }

    fn bisector(&self, q: DVec4) -> Option<DVec4> {
        let difference = q - self.base();
        let norm = minkowski(difference, difference);
        (norm > 0.0).then(|| FORM * difference / norm.sqrt())
    }

    fn ball(&self, centre: DVec4, radius: f64) -> Option<Quadric> {
        // The squared sinh of the distance from c is the part of −⟨x, x⟩ normal to c.
        let share = radius.sinh().powi(2);
        Some(Quadric { forms: self.frame(centre).map(|e| FORM * e), quadratic: -share, constant: share })
    }

    fn tube(&self, axis: Geodesic, radius: f64) -> Option<Quadric> {
        let [a, b] = across(*self, axis).map(|n| FORM * n);
        let share = radius.sinh().powi(2);
        Some(Quadric { forms: [a, b, DVec4::ZERO], quadratic: -share, constant: share })
    }
}

/// See [`Geometry::norm`].
pub(super) fn norm<T: Elementary>(p: Real4<T>, v: Real4<T>) -> T {
    let (x, v) = (p.xyz(), v.xyz());
    let r = x.length();
    if r == T::from_f64(0.0) {
        return v.length();
    }
    let n = x / r;
    let radial = v.dot(n);
    hypotenuse(radial / p.w, (v - n * radial).length())
}

/// Gram matrix of the Minkowski form.
const FORM: DMat4 = DMat4::from_diagonal(DVec4::new(1.0, 1.0, 1.0, -1.0));

fn minkowski(u: DVec4, v: DVec4) -> f64 {
    spatial(u).dot(spatial(v)) - u.w * v.w
}

/// What rounding cut off from w = √(1 + |x|²).
fn tail_of_w(x: DVec3, w: f64) -> f64 {
    let mut defect = CompensatedSum::default();
    defect.add_product(1.0, 1.0);
    defect.add_product(x.x, x.x);
    defect.add_product(x.y, x.y);
    defect.add_product(x.z, x.z);
    defect.add_product(-w, w);
    let tail = defect.value() / (2.0 * w);
    if tail.is_finite() { tail } else { 0.0 }
}

/// A dot product as if computed in twice the precision (Ogita, Rump, Oishi: Accurate sum and dot product, 2005,
/// algorithm 5.3).
#[derive(Default)]
struct CompensatedSum {
    sum: f64,
    error: f64,
}

impl CompensatedSum {
    fn add_product(&mut self, a: f64, b: f64) {
        let product = a * b;
        let product_error = a.mul_add(b, -product);
        let sum = self.sum + product;
        let virtual_part = sum - self.sum;
        let sum_error = (self.sum - (sum - virtual_part)) + (product - virtual_part);
        self.sum = sum;
        self.error += sum_error + product_error;
    }

    fn value(&self) -> f64 {
        self.sum + self.error
    }
}

/// Reflection of a point or a vector in a plane with unit (space-like) conormal.
fn reflect(plane: DVec4, x: DVec4) -> DVec4 {
    x - (FORM * plane) * (2.0 * plane.dot(x))
}
