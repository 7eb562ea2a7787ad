//! Euclidean space. Twin: `shaders/geometry/e3.glsl`.
//!
//! Points are `(x, y, z, 1)` and vectors `(u, v, w, 0)`, so that isometries are 4×4 matrices; the last
//! coordinate is not shown to users. The chart is `(x, y, z)`, the curve parameter is arc length, geodesics are
//! straight in the chart, and every formula is exact.

use super::{
    ALONG_FACE, Elementary, Geodesic, Geometry, Isometry, Quadric, Real, Real3, RealGeodesic, across, matrix_of,
    spatial,
};
use glam::{DAffine3, DMat3, DMat4, DVec3, DVec4, Vec4Swizzles};

/// Euclidean three-space.
#[derive(Clone, Copy, Debug)]
pub struct E3;

impl Geometry for E3 {
    const STRAIGHT: bool = true;

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
        RealGeodesic { point: g.point + g.velocity * t, velocity: g.velocity }
    }

    fn log(&self, p: DVec4, q: DVec4) -> (DVec4, f64) {
        let difference = q - p;
        let length = difference.length();
        if length > 0.0 { (difference / length, length) } else { (DVec4::X, 0.0) }
    }

    fn closeness(&self, p: DVec4, q: DVec4) -> f64 {
        -(p - q).length_squared()
    }

    fn transport(&self, _g: Geodesic, _t: f64, w: DVec4) -> DVec4 {
        w
    }

    fn area_density(&self, _g: Geodesic, t: f64) -> f64 {
        t * t
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
        plane.dot(p)
    }

    fn exit(&self, g: Geodesic, plane: DVec4, _reach: f64) -> f64 {
        let rate = plane.dot(g.velocity);
        if rate > ALONG_FACE { (-plane.dot(g.point) / rate).max(0.0) } else { f64::INFINITY }
    }

    fn arc(&self, _g: Geodesic, u_max: f64, _tolerance: f64) -> f64 {
        u_max
    }

    fn parameter(&self, g: Geodesic, c: DVec3) -> f64 {
        (c - spatial(g.point)).dot(spatial(g.velocity))
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

    fn chart_vector(&self, _p: DVec4, v: DVec4) -> DVec3 {
        spatial(v)
    }

    fn unchart_vector(&self, _p: DVec4, dc: DVec3) -> DVec4 {
        dc.extend(0.0)
    }

    fn spray<T: Real>(&self, _c: Real3<T>, _v: Real3<T>) -> Real3<T> {
        Real3::zero()
    }

    fn raise(&self, _p: DVec4, conormal: DVec3) -> DVec4 {
        conormal.normalize().extend(0.0)
    }

    fn lower(&self, _p: DVec4, v: DVec4) -> DVec3 {
        spatial(v)
    }

    fn volume_density(&self, _c: DVec3) -> f64 {
        1.0
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
        let rotation = DMat3::from_mat4(m.linear).transpose();
        let shift = -(rotation * spatial(m.linear.w_axis));
        Isometry::linear(DMat4::from_cols(
            rotation.x_axis.extend(0.0),
            rotation.y_axis.extend(0.0),
            rotation.z_axis.extend(0.0),
            shift.extend(1.0),
        ))
    }

    fn chart_action(&self, m: &Isometry) -> Option<DAffine3> {
        Some(DAffine3::from_mat4(m.linear))
    }

    fn chart_dilation(&self, point: DVec4, factor: f64) -> Option<DAffine3> {
        let centre = spatial(point);
        Some(DAffine3 { matrix3: DMat3::from_diagonal(DVec3::splat(factor)), translation: centre * (1.0 - factor) })
    }

    fn isometry_residual(&self, m: &Isometry) -> f64 {
        let rotation = DMat3::from_mat4(m.linear);
        let gram = rotation.transpose() * rotation - DMat3::IDENTITY;
        let orthogonality = gram.to_cols_array().iter().fold(0.0_f64, |worst, x| worst.max(x.abs()));
        let last_row = (m.linear.row(3) - DVec4::W).abs().max_element();
        orthogonality.max(last_row)
    }

    fn bisector(&self, q: DVec4) -> Option<DVec4> {
        let q = spatial(q);
        let length = q.length();
        (length > 0.0).then(|| (q / length).extend(-0.5 * length))
    }

    fn ball(&self, centre: DVec4, radius: f64) -> Option<Quadric> {
        let c = spatial(centre);
        let forms = DVec3::AXES.map(|axis| axis.extend(-axis.dot(c)));
        Some(Quadric { forms, quadratic: 0.0, constant: radius * radius })
    }

    fn tube(&self, axis: Geodesic, radius: f64) -> Option<Quadric> {
        let [a, b] = across(*self, axis).map(|n| spatial(n).extend(-spatial(n).dot(spatial(axis.point))));
        Some(Quadric { forms: [a, b, DVec4::ZERO], quadratic: 0.0, constant: radius * radius })
    }
}

/// Reflection of a point or a vector in a plane with unit normal.
fn reflect(plane: DVec4, x: DVec4) -> DVec4 {
    x - spatial(plane).extend(0.0) * (2.0 * plane.dot(x))
}
