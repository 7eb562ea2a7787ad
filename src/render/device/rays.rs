//! Which pixels of the eyes of a headset get a ray: all, or those that are seen, at a rate that falls off from the middle.

use crate::shader_io::{LIST_BITS, RATE_TILE};

/// Which pixels get a ray.
#[derive(Clone, Debug, PartialEq)]
pub enum Rays {
    /// All pixels of both eyes.
    All,
    /// The pixels of a list; those between are filled in.
    Listed(RayList),
}

/// A list of rays of two eyes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RayList {
    /// Column, row and eye, packed; the first eye's come first.
    pub rays: Vec<u32>,
    /// How many belong to the first eye.
    pub of_first: usize,
    /// For each eye and each square of [`RATE_TILE`] pixels, in rows: 1 ray in each pixel, or in a square of 2, 4 or 8
    /// pixels; 0 where nothing is seen.
    pub rates: Vec<u32>,
}

/// What decides about the rays of an eye.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sight {
    /// Tangents of the angles from the view axis to the left, right, lower and upper border.
    pub tangents: [f64; 4],
    /// Triangles that are hidden from the eye by the headset: corners as tangents to the right and up.
    pub hidden: Vec<[[f64; 2]; 3]>,
    /// Angle from the view axis, in radians, within which each pixel has a ray. Up to twice as far four pixels share one,
    /// beyond that sixteen. None: each pixel has one.
    pub full_rate_within: Option<f64>,
}

impl Sight {
    /// Tangents of a point of the picture, in pixels from its upper left corner.
    fn slope(&self, at: [f64; 2], size: [u32; 2]) -> [f64; 2] {
        let [left, right, down, up] = self.tangents;
        [left + (right - left) * at[0] / f64::from(size[0]), up + (down - up) * at[1] / f64::from(size[1])]
    }

    fn hides(&self, at: [f64; 2]) -> bool {
        self.hidden.iter().any(|triangle| {
            let side = |i: usize| {
                let ([ax, ay], [bx, by]) = (triangle[i], triangle[(i + 1) % 3]);
                (bx - ax) * (at[1] - ay) - (by - ay) * (at[0] - ax)
            };
            let sides = [side(0), side(1), side(2)];
            // Both orientations; a triangle without area hides nothing.
            sides.iter().all(|s| *s > 0.0) || sides.iter().all(|s| *s < 0.0)
        })
    }

    /// Whether a ray of this pixel is for something that is seen: the pixel, or those around that are filled in from it.
    fn sees(&self, at: [u32; 2], rate: u32, size: [u32; 2]) -> bool {
        let [x, y] = at.map(|c| f64::from(c) + 0.5);
        let r = if rate > 1 { f64::from(rate) } else { 0.0 };
        let around = [[0.0, 0.0], [-r, -r], [r, -r], [-r, r], [r, r]];
        self.hidden.is_empty() || around.iter().any(|[dx, dy]| !self.hides(self.slope([x + dx, y + dy], size)))
    }

    /// Rays across and down that a square of pixels shares: the best rate that any corner of it asks for.
    fn rate(&self, tile: [u32; 2], size: [u32; 2]) -> u32 {
        let Some(within) = self.full_rate_within else { return 1 };
        let nearest = |t: u32, side: u32, axis: f64| {
            let low = f64::from(t * RATE_TILE);
            let high = f64::from(((t + 1) * RATE_TILE).min(side));
            axis.clamp(low, high)
        };
        // The pixel of the view axis, which may lie outside of the picture.
        let [left, right, down, up] = self.tangents;
        let axis = [-left / (right - left) * f64::from(size[0]), up / (up - down) * f64::from(size[1])];
        let [x, y] = self.slope([nearest(tile[0], size[0], axis[0]), nearest(tile[1], size[1], axis[1])], size);
        let angle = x.hypot(y).atan();
        if angle <= within {
            1
        } else if angle <= 2.0 * within {
            2
        } else {
            4
        }
    }
}

impl Rays {
    /// The rays of two eyes of `size` pixels; sides are below 2 to the power of [`LIST_BITS`].
    pub fn new(eyes: &[Sight; 2], size: [u32; 2]) -> Self {
        if eyes.iter().all(|eye| eye.hidden.is_empty() && eye.full_rate_within.is_none()) {
            return Self::All;
        }
        let mut list = RayList::default();
        let tiles = size.map(|side| side.div_ceil(RATE_TILE));
        for (index, eye) in eyes.iter().enumerate() {
            if index == 1 {
                list.of_first = list.rays.len();
            }
            for tile in (0..tiles[1]).flat_map(|y| (0..tiles[0]).map(move |x| [x, y])) {
                let rate = eye.rate(tile, size);
                let before = list.rays.len();
                // Pixels of a square one after the other, so that neighbours run together.
                for (y, x) in (0..RATE_TILE).flat_map(|y| (0..RATE_TILE).map(move |x| (y, x))) {
                    let at = [tile[0] * RATE_TILE + x, tile[1] * RATE_TILE + y];
                    let traced = at[0] < size[0] && at[1] < size[1] && at.iter().all(|c| c.is_multiple_of(rate));
                    if traced && eye.sees(at, rate, size) {
                        list.rays.push(at[0] | at[1] << LIST_BITS | (index as u32) << (2 * LIST_BITS));
                    }
                }
                list.rates.push(if list.rays.len() == before { 0 } else { rate });
            }
        }
        Self::Listed(list)
    }

    /// Number of rays, of `size` pixels for each eye.
    pub fn count(&self, size: [u32; 2]) -> u64 {
        match self {
            Self::All => 2 * u64::from(size[0]) * u64::from(size[1]),
            Self::Listed(list) => list.rays.len() as u64,
        }
    }
}
