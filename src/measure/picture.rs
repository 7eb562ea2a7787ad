//! Errors of a picture against a reference.

use super::{flip::flip, quantile};
use crate::render::{Target, srgb_byte};

/// How a picture differs from the reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PictureError {
    /// Share of the pixels of which an 8-bit sRGB value is off by more than 2.
    pub off: f64,
    /// Root mean square of the differences of linear values, clamped to [0, 1] as they are shown.
    pub rmse: f64,
    /// Mean of FLIP.
    pub flip: f64,
}

/// Compares two pictures of one size.
pub fn picture_error(reference: &Target, test: &Target) -> PictureError {
    let pairs = || reference.pixels.iter().zip(&test.pixels);
    let count = reference.pixels.len().max(1) as f64;
    let far = |(a, b): &(&[f32; 4], &[f32; 4])| (0..3).any(|i| srgb_byte(a[i]).abs_diff(srgb_byte(b[i])) > 2);
    let square = |(a, b): (&[f32; 4], &[f32; 4])| {
        (0..3).map(|i| f64::from(a[i].clamp(0.0, 1.0) - b[i].clamp(0.0, 1.0)).powi(2)).sum::<f64>() / 3.0
    };
    PictureError {
        off: pairs().filter(far).count() as f64 / count,
        rmse: (pairs().map(square).sum::<f64>() / count).sqrt(),
        flip: flip(reference, test),
    }
}

/// How distances to the first hits differ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DistanceError {
    /// Median difference where both pictures hit something.
    pub median: Option<f64>,
    /// The difference that 99 % of those pixels do not exceed.
    pub most: Option<f64>,
    /// Share of the pixels in which one picture hits something and the other nothing.
    pub missed: f64,
}

/// Compares two pictures of the shading `distance`.
pub fn distance_error(reference: &Target, test: &Target) -> DistanceError {
    let pairs = || reference.pixels.iter().zip(&test.pixels).map(|(a, b)| (f64::from(a[0]), f64::from(b[0])));
    let both: Vec<f64> = pairs().filter(|(a, b)| a.is_finite() && b.is_finite()).map(|(a, b)| (a - b).abs()).collect();
    let missed = pairs().filter(|(a, b)| a.is_finite() != b.is_finite()).count();
    DistanceError {
        median: quantile(&both, 0.5),
        most: quantile(&both, 0.99),
        missed: missed as f64 / reference.pixels.len().max(1) as f64,
    }
}
