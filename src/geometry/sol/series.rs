//! Taylor series of Sol's geodesics, of their variations and of parallel vectors along them.

use super::{super::Elementary, Real3, product};
use glam::{DMat3, DVec3};
use std::f64::consts::TAU;

/// Order of the series in f64: with a factor 6 each, the rest is below 1e-17.
pub const ORDER: usize = 22;

/// Longest step in f64.
pub(super) const STEP: f64 = 0.25;

/// Order of the series that short steps need, of which each order gains more.
const SHORT_ORDER: usize = 14;

/// 1/(k + 1): multiplying is far faster than dividing by whole numbers, of which a series has three for each order.
const SHARES: [f64; ORDER + 1] = {
    let mut shares = [1.0; ORDER + 1];
    let mut k = 0;
    while k <= ORDER {
        shares[k] = 1.0 / (k + 1) as f64;
        k += 1;
    }
    shares
};

/// From this length on whole periods are counted.
const LONG: f64 = 64.0;

/// What depends on the precision.
struct Limits {
    /// Steps up to this size are exact to rounding with [`SHORT_ORDER`]: they gain a factor π/2 over the step each.
    short: f64,
    /// Longest step.
    step: f64,
    /// A geodesic without period may reach this far: beyond it, e^z leaves the numbers.
    reach: f64,
}

const fn limits<T: Elementary>() -> Limits {
    if T::EPSILON < 1e-10 {
        Limits { short: 0.125, step: STEP, reach: 700.0 }
    } else {
        Limits { short: 0.5, step: 0.5, reach: 85.0 }
    }
}

/// The series from the identity: `e²ᶻ`, `e⁻²ᶻ` and `w = z′`.
pub(super) struct Series<T, const N: usize> {
    velocity: Real3<T>,
    pq: [[T; 2]; N],
    w: [T; N],
}

/// The next coefficients of the products of `e²ᶻ` and of `e⁻²ᶻ` with another series, of which as many are known. Two sums each,
/// so that no addition waits for the one before.
fn products<T: Elementary>(pq: &[[T; 2]], other: &[T]) -> [T; 2] {
    let mut sums = [[T::from_f64(0.0); 2]; 2];
    let mut terms = pq.iter().zip(other.iter().rev());
    let mut add = |i: usize, ([p, q], x): (&[T; 2], &T)| sums[i] = [sums[i][0] + *p * *x, sums[i][1] + *q * *x];
    while let Some(term) = terms.next() {
        add(0, term);
        if let Some(term) = terms.next() {
            add(1, term);
        }
    }
    [sums[0][0] + sums[1][0], sums[0][1] + sums[1][1]]
}

impl<T: Elementary, const N: usize> Series<T, N> {
    fn new(velocity: Real3<T>) -> Self {
        let [zero, one, two] = [0.0, 1.0, 2.0].map(T::from_f64);
        let (mut pq, mut w) = ([[zero; 2]; N], [zero; N]);
        (pq[0], w[0]) = ([one; 2], velocity.z);
        let (uu, vv) = (velocity.x * velocity.x, velocity.y * velocity.y);
        for k in 0..N - 1 {
            let share = T::from_f64(SHARES[k]);
            let [pw, qw] = products(&pq[..=k], &w[..=k]);
            w[k + 1] = (vv * pq[k][1] - uu * pq[k][0]) * share;
            pq[k + 1] = [two * pw * share, -two * qw * share];
        }
        Self { velocity, pq, w }
    }

    /// Point after `s`, in coordinates about the start, and its derivative.
    pub(super) fn chart(&self, s: T) -> (Real3<T>, Real3<T>) {
        let (mut end, mut rate) = (Real3::zero(), Real3::zero());
        for k in (0..N).rev() {
            let [p, q] = self.pq[k];
            let term = Real3::new(self.velocity.x * p, self.velocity.y * q, self.w[k]);
            rate = rate * s + term;
            end = end * s + term * T::from_f64(SHARES[k]);
        }
        (end * s, rate)
    }
}

impl<const N: usize> Series<f64, N> {
    /// What the variation `[e^z δA, e^−z δB, δz, δw]` of the start makes of z and w, and of x and y about the start.
    fn vary(&self, [a, b, z, w]: [f64; 4], s: f64) -> [f64; 4] {
        let Real3 { x: u, y: v, .. } = self.velocity;
        let (mut dz, mut dw) = ([0.0; N], [0.0; N]);
        (dz[0], dw[0]) = (z, w);
        let mut out = [0.0; 4];
        let mut power = s;
        for k in 0..N {
            let ([p, q], [pz, qz]) = (self.pq[k], products(&self.pq[..=k], &dz[..=k]));
            let share = SHARES[k];
            let bend = 2.0 * (v * (b * q - v * qz) - u * (a * p + u * pz));
            let terms = [a * p + 2.0 * u * pz, b * q - 2.0 * v * qz, dw[k], bend];
            for (sum, term) in out.iter_mut().zip(terms) {
                *sum += term * (power * share);
            }
            if k + 1 < N {
                dz[k + 1] = dw[k] * share;
                dw[k + 1] = bend * share;
            }
            power *= s;
        }
        [out[0], out[1], z + out[2], w + out[3]]
    }
}

/// A sum with what rounding has cut off from it (Knuth's two-sum).
#[derive(Clone, Copy)]
struct Sum<T> {
    value: T,
    rest: T,
}

impl<T: Elementary> Sum<T> {
    fn new(value: T) -> Self {
        Self { value, rest: T::from_f64(0.0) }
    }

    fn add(&mut self, x: T) {
        let sum = self.value + x;
        let part = sum - self.value;
        self.rest = self.rest + ((self.value - (sum - part)) + (x - part));
        self.value = sum;
    }

    fn total(self) -> T {
        self.value + self.rest
    }
}

/// A geodesic from the identity, walked in steps.
pub(super) struct Track<T> {
    start: Real3<T>,
    x: Sum<T>,
    y: Sum<T>,
    z: Sum<T>,
    w: Sum<T>,
}

impl<T: Elementary> Track<T> {
    pub(super) fn new(velocity: Real3<T>) -> Self {
        let zero = Sum::new(T::from_f64(0.0));
        Self { start: velocity, x: zero, y: zero, z: zero, w: Sum::new(velocity.z) }
    }

    pub(super) fn point(&self) -> Real3<T> {
        Real3::new(self.x.total(), self.y.total(), self.z.total())
    }

    /// e^z, with the digits of z that its rounding has cut off.
    fn rise(&self) -> T {
        self.z.value.exp() * (T::from_f64(1.0) + self.z.rest)
    }

    pub(super) fn velocity(&self) -> Real3<T> {
        let (rise, zero) = (self.rise(), T::from_f64(0.0));
        let u = if self.start.x == zero { zero } else { self.start.x * rise };
        Real3::new(u, self.start.y / rise, self.w.total())
    }

    pub(super) fn series(&self) -> Series<T, { ORDER + 1 }> {
        Series::new(self.velocity())
    }

    /// One step of at most the longest, by a series of the order that it needs: arcs are short.
    fn advance(&mut self, h: T) {
        if h.abs() <= T::from_f64(const { limits::<T>().short }) {
            self.step(&Series::<T, { SHORT_ORDER + 1 }>::new(self.velocity()), h);
        } else {
            self.step(&self.series(), h);
        }
    }

    pub(super) fn step<const N: usize>(&mut self, series: &Series<T, N>, h: T) {
        let (zero, one) = (T::from_f64(0.0), T::from_f64(1.0));
        let (end, _) = series.chart(h);
        let moved = product(Real3::new(zero, zero, self.z.value), end);
        self.x.add(moved.x * (one + self.z.rest));
        self.y.add(moved.y * (one - self.z.rest));
        self.z.add(end.z);
        let bend = (0..N - 1).rev().fold(zero, |sum, k| sum * h + series.w[k + 1]);
        self.w.add(bend * h);
    }
}

/// Number of equal steps of at most the longest, and their size.
fn steps<T: Elementary>(t: T) -> (usize, T) {
    let count = (t.abs() / T::from_f64(const { limits::<T>().step })).ceil().max(T::from_f64(1.0));
    (count.to_f64() as usize, t / count)
}

fn walk<T: Elementary>(velocity: Real3<T>, t: T) -> Track<T> {
    let mut track = Track::new(velocity);
    let (count, h) = steps(t);
    for _ in 0..count {
        track.advance(h);
    }
    track
}

/// Length after which z and the velocity return.
fn period<T: Elementary>(velocity: Real3<T>) -> T {
    let [half, two, full_turn] = [0.5, 2.0, TAU].map(T::from_f64);
    let k = (velocity.x * velocity.y).abs();
    let (mut a, mut b) = ((velocity.dot(velocity) + two * k).sqrt(), two * k.sqrt());
    for _ in 0..20 {
        (a, b) = (half * (a + b), (a * b).sqrt());
    }
    if b > T::from_f64(0.0) { full_turn / b } else { T::from_f64(f64::INFINITY) }
}

/// End point and frame velocity after length `t`, from the identity.
pub(super) fn flow<T: Elementary>(velocity: Real3<T>, t: T) -> (Real3<T>, Real3<T>) {
    let mut whole = Real3::zero();
    let mut rest = t;
    if t.abs() > T::from_f64(LONG) {
        let period = period(velocity);
        let turns = (t / period).trunc();
        if turns != T::from_f64(0.0) {
            whole = (walk(velocity, period).point() * turns).xy().extend(T::from_f64(0.0));
            rest = t - turns * period;
        }
    }
    // What is no number is within nothing.
    let within = rest.abs() <= T::from_f64(const { limits::<T>().reach });
    if !within {
        let infinite = Real3::splat(T::from_f64(f64::INFINITY));
        return (infinite, infinite);
    }
    let track = walk(velocity, rest);
    (whole + track.point(), track.velocity())
}

/// End point after length `t` by `count` equal steps of a series of order `N − 1`, for measuring the order.
pub fn endpoint_with<const N: usize>(velocity: DVec3, t: f64, count: usize) -> DVec3 {
    let mut track = Track::new(Real3::from_f64(velocity));
    for _ in 0..count {
        let series = Series::<f64, N>::new(track.velocity());
        track.step(&series, t / count as f64);
    }
    track.point().to_f64()
}

/// End point after length `t` for unit `velocity`, and the differential of the exponential map at `t velocity` in
/// the frames of both ends, by series of order `N − 1`; infinite beyond the reach.
fn differential_with<const N: usize>(velocity: DVec3, t: f64) -> (DVec3, DMat3) {
    if t == 0.0 {
        return (DVec3::ZERO, DMat3::IDENTITY);
    }
    if t.is_nan() || t.abs() > limits::<f64>().reach {
        return (DVec3::INFINITY, DMat3::from_diagonal(DVec3::INFINITY));
    }
    let mut track = Track::new(Real3::from_f64(velocity));
    let (count, h) = steps(t);
    // It takes the velocity to that at the end, so two more of its images say all: those of the axes that lie farthest from it.
    let along = velocity.abs().max_position();
    let across = [(along + 1) % 3, (along + 2) % 3];
    // Of each of these axes: variation of x, y (in coordinates about the start), z and w.
    let mut varied = across.map(|axis| [0.0, 0.0, 0.0, DVec3::AXES[axis].z]);
    for _ in 0..count {
        let (rise, series) = (track.rise(), Series::<f64, N>::new(track.velocity()));
        for (axis, [x, y, z, w]) in across.map(|axis| DVec3::AXES[axis]).iter().zip(&mut varied) {
            let [dx, dy, dz, dw] = series.vary([axis.x * rise, axis.y / rise, *z, *w], h);
            *x += rise * dx;
            *y += dy / rise;
            (*z, *w) = (dz, dw);
        }
        track.step(&series, h);
    }
    let rise = track.rise();
    let mut images = [DVec3::ZERO; 3];
    let mut rest = track.velocity().to_f64();
    for (axis, [x, y, z, _]) in across.into_iter().zip(varied) {
        images[axis] = DVec3::new(x / rise, y * rise, z) / t;
        rest -= velocity[axis] * images[axis];
    }
    images[along] = rest / velocity[along];
    (track.point().to_f64(), DMat3::from_cols_array_2d(&images.map(|image| image.to_array())))
}

/// End point and differential, exact to rounding.
pub(super) fn differential(velocity: DVec3, t: f64) -> (DVec3, DMat3) {
    differential_with::<{ ORDER + 1 }>(velocity, t)
}

/// The differential for how much light there is, to 10⁻¹¹ of it in each step.
pub(super) fn spreading(velocity: DVec3, t: f64) -> DMat3 {
    differential_with::<{ SHORT_ORDER + 1 }>(velocity, t).1
}

/// Parallel transport of `vector` by length `t`. In the left-invariant frame `p′ = u r`, `q′ = −v r`,
/// `r′ = v q − u p` for the vector `(p, q, r)` (Koszul's formula), and `u′ = u w`, `v′ = −v w`.
pub(super) fn transport(velocity: DVec3, t: f64, vector: DVec3) -> DVec3 {
    const N: usize = ORDER + 1;
    let mut track = Track::new(Real3::from_f64(velocity));
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
