//! Surfaces carried into a space by a smooth map of R³: the exponential map at a frame, or along a curve.

use crate::geometry::Geometry;
use glam::{DMat3, DVec3, DVec4};

/// A point of a surface in the space: position and unit normal, in the model.
#[derive(Clone, Copy, Debug)]
pub struct Placed {
    /// Position.
    pub point: DVec4,
    /// Unit normal.
    pub normal: DVec4,
}

/// The image of a point of R³ and of a covector there: the normal follows by the inverse transpose of the map's
/// differential, taken by central differences of `step`: accurate to 1e-9 and valid in every geometry.
pub fn embed<G: Geometry>(
    geometry: G,
    map: impl Fn(DVec3) -> DVec4,
    position: DVec3,
    normal: DVec3,
    step: f64,
) -> Placed {
    let point = map(position);
    let conormal = differential(geometry, map, position, step).inverse().transpose() * normal;
    let usable = conormal.is_finite() && conormal.length_squared() > 0.0;
    Placed { point, normal: geometry.raise(point, if usable { conormal } else { DVec3::Z }) }
}

/// The differential of the map in the chart, by central differences.
pub fn differential<G: Geometry>(geometry: G, map: impl Fn(DVec3) -> DVec4, position: DVec3, step: f64) -> DMat3 {
    let at = |x: DVec3| geometry.chart(map(x));
    let column = |e: DVec3| (at(position + e * step) - at(position - e * step)) / (2.0 * step);
    DMat3::from_cols(column(DVec3::X), column(DVec3::Y), column(DVec3::Z))
}
