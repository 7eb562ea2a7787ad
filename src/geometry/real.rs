//! Numbers and chart vectors of any precision, for what is computed in more than one: the equation of geodesics in the
//! chart ([`Geometry::spray`](super::Geometry::spray)) and its integrators.

use glam::DVec3;
use std::{
    fmt::Debug,
    ops::{Add, Div, Mul, Neg, Sub},
};

/// A real number of some precision.
pub trait Real:
    Copy
    + Debug
    + PartialOrd
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + Send
    + Sync
    + 'static
{
    /// Distance of 1 to the next number.
    const EPSILON: f64;

    /// The nearest number to `x`.
    fn from_f64(x: f64) -> Self;

    /// The nearest f64.
    fn to_f64(self) -> f64;

    /// Square root; not a number for negative ones.
    fn sqrt(self) -> Self;

    /// eˣ.
    fn exp(self) -> Self;
}

impl Real for f64 {
    const EPSILON: f64 = f64::EPSILON;

    fn from_f64(x: f64) -> Self {
        x
    }

    fn to_f64(self) -> f64 {
        self
    }

    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }

    fn exp(self) -> Self {
        f64::exp(self)
    }
}

impl Real for f32 {
    const EPSILON: f64 = f32::EPSILON as f64;

    fn from_f64(x: f64) -> Self {
        x as f32
    }

    fn to_f64(self) -> f64 {
        f64::from(self)
    }

    fn sqrt(self) -> Self {
        f32::sqrt(self)
    }

    fn exp(self) -> Self {
        f32::exp(self)
    }
}

/// A point or a vector of the chart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Real3<T> {
    /// First coordinate.
    pub x: T,
    /// Second coordinate.
    pub y: T,
    /// Third coordinate.
    pub z: T,
}

impl<T: Real> Real3<T> {
    /// From its coordinates.
    pub fn new(x: T, y: T, z: T) -> Self {
        Self { x, y, z }
    }

    /// The zero vector.
    pub fn zero() -> Self {
        let zero = T::from_f64(0.0);
        Self::new(zero, zero, zero)
    }

    /// Rounded from f64.
    pub fn from_f64(v: DVec3) -> Self {
        Self::new(T::from_f64(v.x), T::from_f64(v.y), T::from_f64(v.z))
    }

    /// Rounded to f64.
    pub fn to_f64(self) -> DVec3 {
        DVec3::new(self.x.to_f64(), self.y.to_f64(), self.z.to_f64())
    }

    /// Euclidean product.
    pub fn dot(self, other: Self) -> T {
        self.x * other.x + self.y * other.y + self.z * other.z
    }
}

impl<T: Real> Add for Real3<T> {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self::new(self.x + other.x, self.y + other.y, self.z + other.z)
    }
}

impl<T: Real> Sub for Real3<T> {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self::new(self.x - other.x, self.y - other.y, self.z - other.z)
    }
}

impl<T: Real> Mul<T> for Real3<T> {
    type Output = Self;
    fn mul(self, factor: T) -> Self {
        Self::new(self.x * factor, self.y * factor, self.z * factor)
    }
}
