//! FLIP, the difference of two pictures as a viewer sees it who flips between them: 0 for none, 1 for the greatest.
//!
//! Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström and Fairchild, FLIP: A Difference Evaluator for Alternating
//! Images, Proc. ACM Comput. Graph. Interact. Tech. 3(2), 2020, written from the paper: both pictures are filtered by the
//! eye's contrast sensitivity in an opponent colour space, compared in Hunt-adjusted L*a*b* by the HyAB distance
//! (section 4.1), and differences of edges and points of the lightness raise the exponent of that (section 4.2).

use crate::render::Target;
use glam::{DMat3, DVec3};
use std::f64::consts::{PI, SQRT_2};

/// Pixels in a degree of the field of view: the paper's, a 4K display of 0.7 m width seen from 0.7 m.
pub const PIXELS_PER_DEGREE: f64 = 67.0;

/// Linear RGB of Rec. 709 to XYZ with D65 (IEC 61966-2-1).
const XYZ_FROM_RGB: DMat3 = DMat3::from_cols(
    DVec3::new(0.412_456_4, 0.212_672_9, 0.019_333_9),
    DVec3::new(0.357_576_1, 0.715_152_2, 0.119_192_0),
    DVec3::new(0.180_437_5, 0.072_175_0, 0.950_304_1),
);

/// A picture of vectors.
struct Image {
    width: usize,
    pixels: Vec<DVec3>,
}

impl Image {
    fn height(&self) -> usize {
        self.pixels.len() / self.width.max(1)
    }

    fn map(&self, f: impl Fn(DVec3) -> DVec3) -> Self {
        Self { width: self.width, pixels: self.pixels.iter().map(|p| f(*p)).collect() }
    }

    /// Filtered along one axis by weights around a middle, per channel; the border's pixels go on outside.
    fn filtered(&self, weights: &[DVec3], down: bool) -> Self {
        let (w, h, radius) = (self.width as isize, self.height() as isize, (weights.len() / 2) as isize);
        let at = |x: isize, y: isize| self.pixels[(y.clamp(0, h - 1) * w + x.clamp(0, w - 1)) as usize];
        let pixel = |index: usize| {
            let (x, y) = (index as isize % w, index as isize / w);
            let taps = weights.iter().zip(-radius..);
            taps.map(|(weight, k)| *weight * if down { at(x, y + k) } else { at(x + k, y) }).sum()
        };
        Self { width: self.width, pixels: (0..self.pixels.len()).map(pixel).collect() }
    }
}

/// The opponent space YCxCz, linear in XYZ relative to white.
fn opponent(linear: DVec3) -> DVec3 {
    let r = XYZ_FROM_RGB * linear / (XYZ_FROM_RGB * DVec3::ONE);
    DVec3::new(116.0 * r.y - 16.0, 500.0 * (r.x - r.y), 200.0 * (r.y - r.z))
}

fn linear_from_opponent(c: DVec3) -> DVec3 {
    let y = (c.x + 16.0) / 116.0;
    let relative = DVec3::new(y + c.y / 500.0, y, y - c.z / 200.0);
    XYZ_FROM_RGB.inverse() * (relative * (XYZ_FROM_RGB * DVec3::ONE))
}

/// L*a*b* with the chroma that Hunt's effect leaves at that lightness.
fn hunt_lab(linear: DVec3) -> DVec3 {
    let r = XYZ_FROM_RGB * linear / (XYZ_FROM_RGB * DVec3::ONE);
    const EDGE: f64 = 6.0 / 29.0;
    let f = |t: f64| if t > EDGE.powi(3) { t.cbrt() } else { t / (3.0 * EDGE * EDGE) + 4.0 / 29.0 };
    let (x, y, z) = (f(r.x), f(r.y), f(r.z));
    let lightness = 116.0 * y - 16.0;
    DVec3::new(lightness, 5.0 * lightness * (x - y), 2.0 * lightness * (y - z))
}

/// The HyAB distance.
fn hyab(a: DVec3, b: DVec3) -> f64 {
    (a.x - b.x).abs() + (a.y - b.y).hypot(a.z - b.z)
}

/// Contrast sensitivity of the three channels (table 1 of the paper): sums of two Gaussians, which are not separable
/// together but each is. Returns the filtered picture.
fn seen(image: &Image, pixels_per_degree: f64) -> Image {
    // (a, b) of a √(π/b) e^(−π²x²/b) for the channels Y, Cx, Cz.
    const GAUSSIANS: [[(f64, f64); 3]; 2] =
        [[(1.0, 0.0047), (1.0, 0.0053), (34.1, 0.04)], [(0.0, 1e-5), (0.0, 1e-5), (13.5, 0.025)]];
    let radius = (3.0 * (0.04 / (2.0 * PI * PI)).sqrt() * pixels_per_degree).ceil() as i32;
    let weights = |(_, b): (f64, f64)| -> Vec<f64> {
        (-radius..=radius).map(|k| (-(PI * f64::from(k) / pixels_per_degree).powi(2) / b).exp()).collect()
    };
    // Weight of a channel's Gaussian in two dimensions.
    let mass = |(a, b): (f64, f64)| a * PI / b * weights((a, b)).iter().sum::<f64>().powi(2);
    let total: [f64; 3] = std::array::from_fn(|c| GAUSSIANS.iter().map(|g| mass(g[c])).sum());
    let parts = GAUSSIANS.map(|g| {
        let columns = g.map(weights);
        let rows: Vec<DVec3> =
            (0..columns[0].len()).map(|k| DVec3::new(columns[0][k], columns[1][k], columns[2][k])).collect();
        let factor = DVec3::from_array(std::array::from_fn(|c| g[c].0 * PI / g[c].1 / total[c]));
        image.filtered(&rows, false).filtered(&rows, true).map(|p| p * factor)
    });
    let [first, second] = parts;
    let pixels = first.pixels.iter().zip(&second.pixels).map(|(a, b)| *a + *b).collect();
    Image { width: image.width, pixels }
}

/// Strength of edges and of points in the lightness at each pixel.
fn features(lightness: &Image, pixels_per_degree: f64) -> Vec<[f64; 2]> {
    let deviation = 0.5 * 0.082 * pixels_per_degree;
    let radius = (3.0 * deviation).ceil() as i32;
    let offsets = || (-radius..=radius).map(f64::from);
    let gauss = |x: f64| (-x * x / (2.0 * deviation * deviation)).exp();
    let across: f64 = offsets().map(gauss).sum();
    let smooth: Vec<DVec3> = offsets().map(|x| DVec3::splat(gauss(x) / across)).collect();
    // Positive and negative weights sum to 1 and −1.
    let balanced = |raw: Vec<f64>| -> Vec<DVec3> {
        let positive: f64 = raw.iter().filter(|x| **x > 0.0).sum();
        let negative: f64 = -raw.iter().filter(|x| **x < 0.0).sum::<f64>();
        raw.iter().map(|x| DVec3::splat(if *x > 0.0 { x / positive } else { x / negative })).collect()
    };
    let edge = balanced(offsets().map(|x| -x * gauss(x)).collect());
    let point = balanced(offsets().map(|x| (x * x / (deviation * deviation) - 1.0) * gauss(x)).collect());
    let strength = |detector: &[DVec3]| -> Vec<f64> {
        let x = lightness.filtered(detector, false).filtered(&smooth, true);
        let y = lightness.filtered(&smooth, false).filtered(detector, true);
        x.pixels.iter().zip(&y.pixels).map(|(x, y)| x.x.hypot(y.x)).collect()
    };
    strength(&edge).into_iter().zip(strength(&point)).map(|(e, p)| [e, p]).collect()
}

/// The map of differences of two pictures of one size, in rows from the top; pixels are linear, clamped to [0, 1].
pub fn flip_map(reference: &Target, test: &Target, pixels_per_degree: f64) -> Vec<f64> {
    let opponents = [reference, test].map(|target| {
        let channel = |x: f32| if x.is_nan() { 0.0 } else { f64::from(x.clamp(0.0, 1.0)) };
        let pixels = target.pixels.iter().map(|p| opponent(DVec3::new(channel(p[0]), channel(p[1]), channel(p[2]))));
        Image { width: target.width as usize, pixels: pixels.collect() }
    });
    let colors = opponents.each_ref().map(|image| {
        let back = |c| hunt_lab(linear_from_opponent(c).clamp(DVec3::ZERO, DVec3::ONE));
        seen(image, pixels_per_degree).map(back)
    });
    let lightness = opponents.map(|image| image.map(|c| DVec3::splat((c.x + 16.0) / 116.0)));
    let [edges_a, edges_b] = lightness.map(|image| features(&image, pixels_per_degree));
    // Differences up to a share of the greatest, that of green and blue, take most of the range.
    const EXPONENT: f64 = 0.7;
    let most = hyab(hunt_lab(DVec3::Y), hunt_lab(DVec3::Z)).powf(EXPONENT);
    let (knee, height) = (0.4 * most, 0.95);
    let color = |i: usize| {
        let e = hyab(colors[0].pixels[i], colors[1].pixels[i]).powf(EXPONENT);
        if e < knee { height / knee * e } else { height + (e - knee) / (most - knee) * (1.0 - height) }
    };
    let feature = |i: usize| {
        let difference = |k: usize| (edges_a[i][k] - edges_b[i][k]).abs();
        (difference(0).max(difference(1)) / SQRT_2).sqrt().min(1.0)
    };
    (0..reference.pixels.len().min(test.pixels.len())).map(|i| color(i).min(1.0).powf(1.0 - feature(i))).collect()
}

/// The mean of [`flip_map`] at [`PIXELS_PER_DEGREE`].
pub fn flip(reference: &Target, test: &Target) -> f64 {
    let map = flip_map(reference, test, PIXELS_PER_DEGREE);
    map.iter().sum::<f64>() / map.len().max(1) as f64
}
