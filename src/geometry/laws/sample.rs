//! Inputs of the laws, reproducible from a seed.

use crate::geometry::{Geodesic, Geometry, Isometry, exponential};
use glam::{DVec3, DVec4};

/// Inputs of the laws.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// A unit geodesic near the base point.
    pub start: Geodesic,
    /// Tangent vectors at its start, of lengths up to 2.
    pub vectors: [DVec4; 2],
    /// A length in (0, 0.6]: short enough that the chart shows the geodesic so far.
    pub length: f64,
    /// Lengths in [−2, 2].
    pub any_lengths: [f64; 2],
    /// A unit vector of the chart's space; along its axes or across the third in some samples.
    pub conormal: DVec3,
    /// Isometries.
    pub isometries: [Isometry; 2],
}

/// Reproducible samples. Some are awkward on purpose: starts at the base point, tiny lengths, axis directions.
pub fn samples<G: Geometry>(geometry: G, seed: u64, count: usize, isometries: &[Isometry]) -> Vec<Sample> {
    let mut random = Random(seed);
    let vector = |p: DVec4, c: DVec3| {
        let frame = geometry.frame(p);
        frame[0] * c.x + frame[1] * c.y + frame[2] * c.z
    };
    let mut sample = |i: usize| {
        let base = geometry.base();
        let radius = if i.is_multiple_of(8) { 0.0 } else { 0.5 * random.unit() };
        let p = exponential(geometry, base, vector(base, random.direction()) * radius);
        let direction = if i.is_multiple_of(4) { DVec3::AXES[(i / 4) % 3] } else { random.direction() };
        let start = Geodesic { point: p, velocity: vector(p, direction) };
        Sample {
            start,
            vectors: [0, 1].map(|_| vector(p, random.direction() * (2.0 * random.unit()))),
            length: if i % 8 == 3 { 1e-6 } else { 0.6 * random.unit().max(1e-3) },
            any_lengths: within_chart(geometry, start, [0, 1].map(|_| 4.0 * random.unit() - 2.0)),
            conormal: match i % 16 {
                5 => DVec3::AXES[(i / 16) % 3],
                13 => random.direction().with_z(0.0).normalize_or(DVec3::X),
                _ => random.direction(),
            },
            isometries: [0, 1].map(|_| {
                let index = random.below(isometries.len() + 1);
                isometries.get(index).copied().unwrap_or(Isometry::IDENTITY)
            }),
        }
    };
    (0..count).map(&mut sample).collect()
}

/// Lengths halved until the geodesic stays in the chart for their sum, both ways.
fn within_chart<G: Geometry>(geometry: G, start: Geodesic, lengths: [f64; 2]) -> [f64; 2] {
    let most = lengths[0].abs() + lengths[1].abs();
    let edge = [most, -most].iter().any(|t| geometry.edge(start, *t).is_some());
    if edge { within_chart(geometry, start, lengths.map(|t| 0.5 * t)) } else { lengths }
}

/// Numbers that only depend on the seed (Steele, Lea, Flood: splitmix64, 2014).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// In [0, 1).
    fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn below(&mut self, count: usize) -> usize {
        ((self.unit() * count as f64) as usize).min(count.saturating_sub(1))
    }

    fn direction(&mut self) -> DVec3 {
        loop {
            let v = DVec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0;
            if (0.01..1.0).contains(&v.length_squared()) {
                return v.normalize();
            }
        }
    }
}
