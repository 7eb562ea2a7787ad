//! Pictures of where the cost of a frame lies: values per pixel as colours.

use super::quantile;
use crate::render::Target;

/// Share of the pixels that may be beyond the scale where work is counted.
pub const COUNTED: f64 = 0.001;

/// The same for times, since threads that were held up in a pixel are no cost of it.
pub const TIMED: f64 = 0.02;

/// What colours stand for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// The least value: the darkest colour.
    pub darkest: f64,
    /// The brightest colour; a few pixels may have higher values, so that they do not darken the rest.
    pub brightest: f64,
    /// The largest value.
    pub most: f64,
    /// Of all values.
    pub sum: f64,
    /// Of all values.
    pub mean: f64,
}

impl Scale {
    /// The scale of a picture whose first channel holds values, of which the share `beyond` may be above the brightest.
    pub fn of(values: &Target, beyond: f64) -> Self {
        let values: Vec<f64> = values.pixels.iter().map(|p| f64::from(p[0])).collect();
        let at = |share| quantile(&values, share).unwrap_or(0.0);
        let sum = values.iter().sum::<f64>();
        let mean = sum / values.len().max(1) as f64;
        Self { darkest: at(0.0), brightest: at(1.0 - beyond), most: at(1.0), sum, mean }
    }

    /// The picture in colours.
    pub fn paint(&self, values: &Target) -> Target {
        let range = self.brightest - self.darkest;
        let share = |value: f64| if range > 0.0 { (value - self.darkest) / range } else { 0.0 };
        let painted = values.pixels.iter().map(|p| {
            let [r, g, b] = color(share(f64::from(p[0])));
            [r, g, b, 1.0]
        });
        Target { width: values.width, height: values.height, pixels: painted.collect() }
    }
}

/// Values in all channels, for files that hold values.
pub fn grey(values: &Target) -> Target {
    let pixels = values.pixels.iter().map(|p| [p[0], p[0], p[0], 1.0]).collect();
    Target { width: values.width, height: values.height, pixels }
}

/// Lightness of the darkest and the brightest colour.
const LIGHTNESS: [f64; 2] = [0.22, 0.93];

/// Chroma of all colours, as large as the gamut of sRGB permits all the way.
const CHROMA: f64 = 0.12;

/// Hue of the darkest colour (violet) and of the brightest (yellow, half a circle on over red), in degrees.
const HUE: [f64; 2] = [285.0, 465.0];

/// The colour of a share from 0 to 1, linear sRGB. In the perceptual space Oklab (Ottosson, A perceptual color space for
/// image processing, 2020) the colours lie on a helix of one slope, so that equal steps look equally large, and lighter is
/// always more.
pub fn color(share: f64) -> [f32; 3] {
    let between = |[from, to]: [f64; 2]| from + (to - from) * share.clamp(0.0, 1.0);
    let (sin, cos) = between(HUE).to_radians().sin_cos();
    let (lightness, a, b) = (between(LIGHTNESS), CHROMA * cos, CHROMA * sin);
    let l = (lightness + 0.396_337_777_4 * a + 0.215_803_757_3 * b).powi(3);
    let m = (lightness - 0.105_561_345_8 * a - 0.063_854_172_8 * b).powi(3);
    let s = (lightness - 0.089_484_177_5 * a - 1.291_485_548 * b).powi(3);
    [
        4.076_741_662_1 * l - 3.307_711_591_3 * m + 0.230_969_929_2 * s,
        -1.268_438_004_6 * l + 2.609_757_401_1 * m - 0.341_319_396_5 * s,
        -0.004_196_086_3 * l - 0.703_418_614_7 * m + 1.707_614_701 * s,
    ]
    .map(|channel| channel as f32)
}
