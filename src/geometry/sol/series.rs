//! Taylor series of Sol's geodesics, of their variations and of parallel vectors along them.

use super::product;
use glam::{DMat3, DVec3};
use std::f64::consts::TAU;

/// Order of the series in f64: with a factor 6 each, the rest is below 1e-17.
pub const ORDER: usize = 22;

/// Longest step.
pub(super) const STEP: f64 = 0.25;

/// Steps of this size gain a factor 12 with each order, so that fewer make the rest as small.
const SHORT: f64 = 0.125;

/// Their order.
const SHORT_ORDER: usize = 14;

/// From this length on whole periods are counted.
const LONG: f64 = 64.0;

/// A geodesic without period may reach this far: beyond it, e^z leaves f64.
const REACH: f64 = 700.0;

/// The series from the identity: `e²ᶻ`, `e⁻²ᶻ` and `w = z′`.
pub(super) struct Series<const N: usize> {
    velocity: DVec3,
    p: [f64; N],
    q: [f64; N],
    w: [f64; N],
}

impl<const N: usize> Series<N> {
    fn new(velocity: DVec3) -> Self {
        let (mut p, mut q, mut w) = ([0.0; N], [0.0; N], [0.0; N]);
        (p[0], q[0], w[0]) = (1.0, 1.0, velocity.z);
        let (uu, vv) = (velocity.x * velocity.x, velocity.y * velocity.y);
        for k in 0..N - 1 {
            let next = (k + 1) as f64;
            let (mut pw, mut qw) = (0.0, 0.0);
            for j in 0..=k {
                pw += p[j] * w[k - j];
                qw += q[j] * w[k - j];
            }
            w[k + 1] = (vv * q[k] - uu * p[k]) / next;
            p[k + 1] = 2.0 * pw / next;
            q[k + 1] = -2.0 * qw / next;
        }
        Self { velocity, p, q, w }
    }

    /// Point after `s`, in coordinates about the start, and its derivative.
    pub(super) fn chart(&self, s: f64) -> (DVec3, DVec3) {
        let (mut end, mut rate) = (DVec3::ZERO, DVec3::ZERO);
        for k in (0..N).rev() {
            let term = DVec3::new(self.velocity.x * self.p[k], self.velocity.y * self.q[k], self.w[k]);
            rate = rate * s + term;
            end = end * s + term / (k + 1) as f64;
        }
        (end * s, rate)
    }

    /// What the variation `[e^z δA, e^−z δB, δz, δw]` of the start makes of z and w, and of x and y about the start.
    fn vary(&self, [a, b, z, w]: [f64; 4], s: f64) -> [f64; 4] {
        let DVec3 { x: u, y: v, .. } = self.velocity;
        let (mut dz, mut dw) = ([0.0; N], [0.0; N]);
        (dz[0], dw[0]) = (z, w);
        let mut out = [0.0; 4];
        let mut power = s;
        for k in 0..N {
            let (mut pz, mut qz) = (0.0, 0.0);
            for j in 0..=k {
                pz += self.p[j] * dz[k - j];
                qz += self.q[j] * dz[k - j];
            }
            let next = (k + 1) as f64;
            let bend = 2.0 * (v * (b * self.q[k] - v * qz) - u * (a * self.p[k] + u * pz));
            let terms = [a * self.p[k] + 2.0 * u * pz, b * self.q[k] - 2.0 * v * qz, dw[k], bend];
            for (sum, term) in out.iter_mut().zip(terms) {
                *sum += term * power / next;
            }
            if k + 1 < N {
                dz[k + 1] = dw[k] / next;
                dw[k + 1] = bend / next;
            }
            power *= s;
        }
        [out[0], out[1], z + out[2], w + out[3]]
    }
}

/// A sum with what rounding has cut off from it (Knuth's two-sum).
#[derive(Clone, Copy, Default)]
struct Sum {
    value: f64,
    rest: f64,
}

impl Sum {
    fn add(&mut self, x: f64) {
        let sum = self.value + x;
        let part = sum - self.value;
        self.rest += (self.value - (sum - part)) + (x - part);
        self.value = sum;
    }

    fn total(self) -> f64 {
        self.value + self.rest
    }
}

/// A geodesic from the identity, walked in steps.
pub(super) struct Track {
    start: DVec3,
    x: Sum,
    y: Sum,
    z: Sum,
    w: Sum,
}

impl Track {
    pub(super) fn new(velocity: DVec3) -> Self {
        let mut w = Sum::default();
        w.add(velocity.z);
        Self { start: velocity, x: Sum::default(), y: Sum::default(), z: Sum::default(), w }
    }

    pub(super) fn point(&self) -> DVec3 {
        DVec3::new(self.x.total(), self.y.total(), self.z.total())
    }

    /// e^z, with the digits of z that its rounding has cut off.
    fn rise(&self) -> f64 {
        self.z.value.exp() * (1.0 + self.z.rest)
    }

    pub(super) fn velocity(&self) -> DVec3 {
        let rise = self.rise();
        DVec3::new(if self.start.x == 0.0 { 0.0 } else { self.start.x * rise }, self.start.y / rise, self.w.total())
    }

    pub(super) fn series(&self) -> Series<{ ORDER + 1 }> {
        Series::new(self.velocity())
    }

    /// One step of at most [`STEP`], by a series of the order that it needs: arcs are short.
    fn advance(&mut self, h: f64) {
        if h.abs() <= SHORT {
            self.step(&Series::<{ SHORT_ORDER + 1 }>::new(self.velocity()), h);
        } else {
            self.step(&self.series(), h);
        }
    }

    pub(super) fn step<const N: usize>(&mut self, series: &Series<N>, h: f64) {
        let (end, _) = series.chart(h);
        let moved = product(DVec3::new(0.0, 0.0, self.z.value), end);
        self.x.add(moved.x * (1.0 + self.z.rest));
        self.y.add(moved.y * (1.0 - self.z.rest));
        self.z.add(end.z);
        let bend = (0..N - 1).rev().fold(0.0, |sum, k| sum * h + series.w[k + 1]);
        self.w.add(bend * h);
    }
}

/// Number of equal steps of at most [`STEP`], and their size.
fn steps(t: f64) -> (usize, f64) {
    let count = (t.abs() / STEP).ceil().max(1.0);
    (count as usize, t / count)
}

fn walk(velocity: DVec3, t: f64) -> Track {
    let mut track = Track::new(velocity);
    let (count, h) = steps(t);
    for _ in 0..count {
        track.advance(h);
    }
    track
}

/// Length after which z and the velocity return.
fn period(velocity: DVec3) -> f64 {
    let k = (velocity.x * velocity.y).abs();
    let (mut a, mut b) = ((velocity.length_squared() + 2.0 * k).sqrt(), 2.0 * k.sqrt());
    for _ in 0..20 {
        (a, b) = (0.5 * (a + b), (a * b).sqrt());
    }
    if b > 0.0 { TAU / b } else { f64::INFINITY }
}

/// End point and frame velocity after length `t`, from the identity.
pub(super) fn flow(velocity: DVec3, t: f64) -> (DVec3, DVec3) {
    let mut whole = DVec3::ZERO;
    let mut rest = t;
    if t.abs() > LONG {
        let period = period(velocity);
        let turns = (t / period).trunc();
        if turns != 0.0 {
            whole = (walk(velocity, period).point() * turns).with_z(0.0);
            rest = t - turns * period;
        }
    }
    if rest.is_nan() || rest.abs() > REACH {
        return (DVec3::INFINITY, DVec3::INFINITY);
    }
    let track = walk(velocity, rest);
    (whole + track.point(), track.velocity())
}

/// End point after length `t` by `count` equal steps of a series of order `N − 1`, for measuring the order.
pub fn endpoint_with<const N: usize>(velocity: DVec3, t: f64, count: usize) -> DVec3 {
    let mut track = Track::new(velocity);
    for _ in 0..count {
        let series = Series::<N>::new(track.velocity());
        track.step(&series, t / count as f64);
    }
    track.point()
}

/// End point after length `t` for unit `velocity`, and the differential of the exponential map at `t velocity` in
/// the frames of both ends; infinite beyond [`REACH`].
pub(super) fn differential(velocity: DVec3, t: f64) -> (DVec3, DMat3) {
    if t == 0.0 {
        return (DVec3::ZERO, DMat3::IDENTITY);
    }
    if t.is_nan() || t.abs() > REACH {
        return (DVec3::INFINITY, DMat3::from_diagonal(DVec3::INFINITY));
    }
    let mut track = Track::new(velocity);
    let (count, h) = steps(t);
    // Of each axis of the velocity's space: variation of x, y (in coordinates about the start), z and w.
    let mut varied = DVec3::AXES.map(|axis| [0.0, 0.0, 0.0, axis.z]);
    for _ in 0..count {
        let (rise, series) = (track.rise(), track.series());
        for (axis, [x, y, z, w]) in DVec3::AXES.iter().zip(&mut varied) {
            let [dx, dy, dz, dw] = series.vary([axis.x * rise, axis.y / rise, *z, *w], h);
            *x += rise * dx;
            *y += dy / rise;
            (*z, *w) = (dz, dw);
        }
        track.step(&series, h);
    }
    let rise = track.rise();
    let [a, b, c] = varied.map(|[x, y, z, _]| DVec3::new(x / rise, y * rise, z) / t);
    (track.point(), DMat3::from_cols(a, b, c))
}

/// Parallel transport of `vector` by length `t`. In the left-invariant frame `p′ = u r`, `q′ = −v r`,
/// `r′ = v q − u p` for the vector `(p, q, r)` (Koszul's formula), and `u′ = u w`, `v′ = −v w`.
pub(super) fn transport(velocity: DVec3, t: f64, vector: DVec3) -> DVec3 {
    const N: usize = ORDER + 1;
    let mut track = Track::new(velocity);
    let (count, h) = steps(t);
    let norm = vector.length();
    let mut vector = vector;
    for _ in 0..count {
        let series = track.series();
        let (mut frame, mut parallel) = ([[0.0; 2]; N], [DVec3::ZERO; N]);
        (frame[0], parallel[0]) = ([series.velocity.x, series.velocity.y], vector);
        for k in 0..N - 1 {
            let (mut turned, mut bent) = (DVec3::ZERO, [0.0; 2]);
            for j in 0..=k {
                let ([u, v], other) = (frame[j], parallel[k - j]);
                turned += DVec3::new(u * other.z, -v * other.z, v * other.y - u * other.x);
                bent = [bent[0] + u * series.w[k - j], bent[1] - v * series.w[k - j]];
            }
            let next = (k + 1) as f64;
            frame[k + 1] = bent.map(|x| x / next);
            parallel[k + 1] = turned / next;
        }
        vector = parallel.iter().rev().fold(DVec3::ZERO, |sum, term| sum * h + *term);
        track.step(&series, h);
    }
    vector.normalize_or_zero() * norm
}
