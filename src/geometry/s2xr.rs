//! The product of the unit sphere with a line. Twin: `shaders/geometry/s2xr.glsl`.
//!
//! Points are `(x, y, z, w)` with `x² + y² + w² = 1`; z is the line. Metric: the restriction of the Euclidean inner
//! product. Chart: gnomonic times z, `(x/w, y/w, z)`, valid for `w > 0`. Everything else is in [`super::product`].

use super::{Elementary, Real4, product::Product, s3::S3};

/// The sphere of curvature 1 times the real line.
#[derive(Clone, Copy, Debug)]
pub struct S2xR;

impl Product for S2xR {
    type Space = S3;
    const SPACE: S3 = S3;
    const CURVATURE: f64 = 1.0;

    fn sine_cosine<T: Elementary>(x: T) -> (T, T) {
        x.sin_cos()
    }

    fn norm_in<T: Elementary>(_p: Real4<T>, v: Real4<T>) -> T {
        v.length()
    }

    fn arc_tangent(x: f64) -> f64 {
        x.atan()
    }
}
