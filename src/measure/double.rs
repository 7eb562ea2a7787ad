//! Sums of two f64 that count as one number of 106 bits: the arithmetic of the reference that errors of f64 are measured
//! against. After Dekker (A floating-point technique for extending the available precision, Numer. Math. 18, 1971), with
//! products by fused multiplication.

use crate::geometry::Real;
use std::{
    cmp::Ordering,
    ops::{Add, Div, Mul, Neg, Sub},
};

/// `high + low`, |low| at most half of a rounding of `high`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Double {
    /// The nearest f64.
    pub high: f64,
    /// The rest.
    pub low: f64,
}

/// The sum of two numbers of which the first is the larger.
fn ordered(a: f64, b: f64) -> Double {
    let high = a + b;
    Double { high, low: b - (high - a) }
}

/// The sum of any two numbers (Knuth).
fn sum(a: f64, b: f64) -> Double {
    let high = a + b;
    let back = high - a;
    Double { high, low: (a - (high - back)) + (b - back) }
}

impl Add for Double {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        let (high, low) = (sum(self.high, other.high), sum(self.low, other.low));
        let first = ordered(high.high, high.low + low.high);
        ordered(first.high, first.low + low.low)
    }
}

impl Neg for Double {
    type Output = Self;
    fn neg(self) -> Self {
        Self { high: -self.high, low: -self.low }
    }
}

impl Sub for Double {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for Double {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let high = self.high * other.high;
        let rest = self.high.mul_add(other.high, -high);
        ordered(high, rest + (self.high * other.low + self.low * other.high))
    }
}

impl Div for Double {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        // Three digits of a long division.
        let first = self.high / other.high;
        let rest = self - other * Self::from_f64(first);
        let second = rest.high / other.high;
        let rest = rest - other * Self::from_f64(second);
        ordered(first, second) + Self::from_f64(rest.high / other.high)
    }
}

impl PartialOrd for Double {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        self.high.partial_cmp(&other.high).map(|order| order.then(self.low.total_cmp(&other.low)))
    }
}

/// ln 2.
const LN_2: Double = Double { high: std::f64::consts::LN_2, low: 2.319_046_813_846_299_6e-17 };

/// Halvings of the argument of the exponential series.
const HALVINGS: i32 = 8;

impl Real for Double {
    const EPSILON: f64 = f64::EPSILON * f64::EPSILON;

    fn from_f64(x: f64) -> Self {
        Self { high: x, low: 0.0 }
    }

    fn to_f64(self) -> f64 {
        self.high
    }

    fn sqrt(self) -> Self {
        let root = self.high.sqrt();
        if root == 0.0 || !root.is_finite() {
            return Self::from_f64(root);
        }
        // One step of Newton's method.
        let root = Self::from_f64(root);
        root + (self - root * root) / (root + root)
    }

    fn exp(self) -> Self {
        if self.high.is_nan() || self.high.abs() > 700.0 {
            return Self::from_f64(self.high.exp());
        }
        let turns = (self.high / std::f64::consts::LN_2).round();
        let scale = Self::from_f64(0.5_f64.powi(HALVINGS));
        let x = (self - LN_2 * Self::from_f64(turns)) * scale;
        // e^x − 1 for |x| ≤ 0.0014: the twelfth term is below the rounding of the first.
        let mut series = Self::from_f64(0.0);
        for k in (1..12).rev() {
            series = (series + Self::from_f64(1.0)) * x / Self::from_f64(f64::from(k));
        }
        for _ in 0..HALVINGS {
            series = series + series + series * series;
        }
        (series + Self::from_f64(1.0)) * Self::from_f64(2_f64.powf(turns))
    }
}
