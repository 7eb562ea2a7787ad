//! Dormand and Prince's pair of orders 5 and 4 (A family of embedded Runge–Kutta formulae, J. Comp. Appl. Math. 6, 1980)
//! with the continuous extension of order 4 and the control of the step of Hairer, Nørsett and Wanner (Solving Ordinary
//! Differential Equations I, II.4 to II.6).

use super::{Dense, Field, State, Stepper};
use crate::geometry::{Real, Real3};

/// The method of order 5.
#[derive(Clone, Copy, Debug)]
pub struct Dopri5 {
    /// Largest error of a step, in units of 1 plus the size of what is in error; positive.
    pub tolerance: f64,
}

/// Stages in the order of evaluation: weights of the earlier ones.
const STAGES: [&[f64]; 6] = [
    &[1.0 / 5.0],
    &[3.0 / 40.0, 9.0 / 40.0],
    &[44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0],
    &[19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0],
    &[9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0],
    &[35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0],
];

/// Difference of the results of orders 5 and 4.
const ERROR: [f64; 7] =
    [71.0 / 57600.0, 0.0, -71.0 / 16695.0, 71.0 / 1920.0, -17253.0 / 339200.0, 22.0 / 525.0, -1.0 / 40.0];

/// Last coefficient of the continuous extension.
const DENSE: [f64; 7] = [
    -12715105075.0 / 11282082432.0,
    0.0,
    87487479700.0 / 32700410799.0,
    -10690763975.0 / 1880347072.0,
    701980252875.0 / 199316789632.0,
    -1453857185.0 / 822651844.0,
    69997945.0 / 29380423.0,
];

/// Refused steps in a row after which there is no step: each is at most half as long as the one before.
const REFUSALS: u32 = 60;

/// Longest first step.
const FIRST: f64 = 0.1;

fn combine<T: Real>(weights: &[f64], k: &[Real3<T>]) -> Real3<T> {
    let terms = weights.iter().zip(k).filter(|(w, _)| **w != 0.0);
    terms.fold(Real3::zero(), |sum, (w, k)| sum + *k * T::from_f64(*w))
}

impl Dopri5 {
    /// The step and its error in units of the tolerance.
    fn attempt<T: Real>(&self, field: &impl Field<T>, start: State<T>, h: T) -> (Dense<T>, f64) {
        let zero = Real3::zero();
        // Derivatives of coordinates and of velocities at the stages.
        let (mut k, mut a) = ([zero; 7], [zero; 7]);
        (k[0], a[0]) = (start.v, field(start.c, start.v));
        let mut stage = start;
        for (i, weights) in STAGES.iter().enumerate() {
            stage = State { c: start.c + combine(weights, &k) * h, v: start.v + combine(weights, &a) * h };
            (k[i + 1], a[i + 1]) = (stage.v, field(stage.c, stage.v));
        }
        let mut dense = Dense::hermite(start, a[0], stage, a[6], h);
        (dense.c[4], dense.v[4]) = (combine(&DENSE, &k) * h, combine(&DENSE, &a) * h);
        let share = |error: Real3<T>, from: Real3<T>, to: Real3<T>| {
            let size = from.to_f64().abs().max(to.to_f64().abs()) + 1.0;
            (error.to_f64() * h.to_f64() / size).abs().max_element()
        };
        let worst = [share(combine(&ERROR, &k), start.c, stage.c), share(combine(&ERROR, &a), start.v, stage.v)];
        // What is not a number is no error to accept.
        let sum = worst[0] + worst[1];
        let error = if sum.is_finite() { worst[0].max(worst[1]) } else { f64::INFINITY };
        // Below some roundings of T no step is short enough.
        (dense, error / self.tolerance.max(4.0 * T::EPSILON))
    }
}

impl Stepper for Dopri5 {
    const ORDER: u32 = 5;
    const EVALUATIONS: u32 = 7;

    fn step<T: Real>(&self, field: &impl Field<T>, start: State<T>, h: T) -> Dense<T> {
        self.attempt(field, start, h).0
    }

    fn advance<T: Real>(&self, field: &impl Field<T>, start: State<T>, proposal: T, limit: T) -> Option<(Dense<T>, T)> {
        let (proposed, longest) = (proposal.to_f64().abs(), limit.to_f64().abs());
        let mut h = if proposed > 0.0 { proposed } else { FIRST };
        for _ in 0..REFUSALS {
            // The last step lands on the limit itself.
            let step = match (h < longest, limit.to_f64() < 0.0) {
                (false, _) => limit,
                (true, true) => T::from_f64(-h),
                (true, false) => T::from_f64(h),
            };
            let (dense, error) = self.attempt(field, start, step);
            let taken = h.min(longest);
            let factor = if error > 0.0 { (0.9 * error.powf(-0.2)).clamp(0.2, 5.0) } else { 5.0 };
            if error <= 1.0 {
                // A step that the limit has cut says nothing against the longer one.
                return Some((dense, T::from_f64((taken * factor).max(if h > longest { h } else { 0.0 }))));
            }
            h = taken * factor.min(0.9);
        }
        None
    }
}
