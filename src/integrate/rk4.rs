//! Runge and Kutta's method of order 4 with a fixed step, and Hermite's cubic over it.

use super::{Dense, Field, State, Stepper, euler::fixed};
use crate::geometry::Real;

/// The classical method of order 4.
#[derive(Clone, Copy, Debug)]
pub struct Rk4 {
    /// Length of a step, positive.
    pub step: f64,
}

impl Stepper for Rk4 {
    const ORDER: u32 = 4;
    const EVALUATIONS: u32 = 5;

    fn step<T: Real>(&self, field: &impl Field<T>, start: State<T>, h: T) -> Dense<T> {
        let State { c, v } = start;
        let (half, sixth, two) = (h * T::from_f64(0.5), h / T::from_f64(6.0), T::from_f64(2.0));
        let a1 = field(c, v);
        let v2 = v + a1 * half;
        let a2 = field(c + v * half, v2);
        let v3 = v + a2 * half;
        let a3 = field(c + v2 * half, v3);
        let v4 = v + a3 * h;
        let a4 = field(c + v3 * h, v4);
        let end = State { c: c + (v + (v2 + v3) * two + v4) * sixth, v: v + (a1 + (a2 + a3) * two + a4) * sixth };
        Dense::hermite(start, a1, end, field(end.c, end.v), h)
    }

    fn advance<T: Real>(&self, field: &impl Field<T>, start: State<T>, _: T, limit: T) -> Option<(Dense<T>, T)> {
        let h = fixed(self.step, limit);
        Some((self.step(field, start, h), h))
    }
}
