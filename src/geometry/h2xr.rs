//! The product of the hyperbolic plane with a line. Twin: `shaders/geometry/h2xr.glsl`.
//!
//! Points are `(x, y, z, w)` with `x² + y² − w² = −1`, `w > 0`; z is the line. Metric: the restriction of
//! `u·v − 2 u_w v_w`. Chart: Klein times z, `(x/w, y/w, z)`. Everything else is in [`super::product`].

use super::{
    Elementary, Real4,
    h3::{self, H3},
    product::Product,
};

/// The hyperbolic plane of curvature −1 times the real line.
#[derive(Clone, Copy, Debug)]
pub struct H2xR;

impl Product for H2xR {
    type Space = H3;
    const SPACE: H3 = H3;
    const CURVATURE: f64 = -1.0;

    fn sine_cosine<T: Elementary>(x: T) -> (T, T) {
        (x.sinh(), x.cosh())
    }

    fn norm_in<T: Elementary>(p: Real4<T>, v: Real4<T>) -> T {
        h3::norm(p, v)
    }

    fn arc_tangent(x: f64) -> f64 {
        if x.abs() < 1.0 { x.atanh() } else { f64::INFINITY.copysign(x) }
    }
}
