//! Euler's method with a fixed step: how the book follows geodesics where it has no closed form (section 3.3.3, equation
//! 3.1). A step is straight in the chart.

use super::{Dense, Field, State, Stepper};
use crate::geometry::Real;

/// Euler's method.
#[derive(Clone, Copy, Debug)]
pub struct Euler {
    /// Length of a step, positive.
    pub step: f64,
}

impl Stepper for Euler {
    const ORDER: u32 = 1;
    const EVALUATIONS: u32 = 1;

    fn step<T: Real>(&self, field: &impl Field<T>, start: State<T>, h: T) -> Dense<T> {
        Dense::straight(start, field(start.c, start.v), h)
    }

    fn advance<T: Real>(&self, field: &impl Field<T>, start: State<T>, _: T, limit: T) -> Option<(Dense<T>, T)> {
        let h = fixed(self.step, limit);
        Some((self.step(field, start, h), h))
    }
}

/// The step of a method with steps of one length: as long, in the direction of `limit`, but not beyond it.
pub(super) fn fixed<T: Real>(step: f64, limit: T) -> T {
    let zero = T::from_f64(0.0);
    let h = T::from_f64(step);
    match limit < zero {
        true if -h > limit => -h,
        false if h < limit => h,
        _ => limit,
    }
}
