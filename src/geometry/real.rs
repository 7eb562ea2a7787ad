//! Numbers, vectors and states of any precision, for what is computed in more than one: the flows of the geometries
//! ([`Geometry::flow_in`](super::Geometry::flow_in)), the equation of geodesics in the chart
//! ([`Geometry::spray`](super::Geometry::spray)) and its integrators.

use super::Geodesic;
use glam::{DVec2, DVec3, DVec4};
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

/// A number of the machine, f32 or f64, with the elementary functions that flows are made of, each in its own precision.
pub trait Elementary: Real {
    /// Smallest positive number of full precision.
    const SMALLEST: Self;

    /// Sine and cosine.
    fn sin_cos(self) -> (Self, Self);

    /// Sine.
    fn sin(self) -> Self;

    /// Cosine.
    fn cos(self) -> Self;

    /// Hyperbolic sine.
    fn sinh(self) -> Self;

    /// Hyperbolic cosine.
    fn cosh(self) -> Self;

    /// Arc tangent.
    fn atan(self) -> Self;

    /// Angle of `(other, self)`, in [−π, π].
    fn atan2(self, other: Self) -> Self;

    /// Inverse hyperbolic tangent.
    fn atanh(self) -> Self;

    /// eˣ − 1.
    fn exp_m1(self) -> Self;

    /// √(x² + y²) whatever their size.
    fn hypot(self, other: Self) -> Self;

    /// Size.
    fn abs(self) -> Self;

    /// 1 or −1, by the sign, zero's too.
    fn signum(self) -> Self;

    /// The larger of two numbers, and the one that is a number.
    fn max(self, other: Self) -> Self;

    /// The smaller, likewise.
    fn min(self, other: Self) -> Self;

    /// The nearest whole number.
    fn round(self) -> Self;

    /// The whole number towards zero.
    fn trunc(self) -> Self;

    /// The whole number above.
    fn ceil(self) -> Self;
}

macro_rules! machine_number {
    ($number:ident: $($function:ident($($argument:ident)?) -> $result:ty;)*) => {
        impl Real for $number {
            const EPSILON: f64 = $number::EPSILON as f64;

            #[inline]
            fn from_f64(x: f64) -> Self {
                x as $number
            }

            #[inline]
            fn to_f64(self) -> f64 {
                self.into()
            }

            #[inline]
            fn sqrt(self) -> Self {
                $number::sqrt(self)
            }

            #[inline]
            fn exp(self) -> Self {
                $number::exp(self)
            }
        }

        impl Elementary for $number {
            const SMALLEST: Self = $number::MIN_POSITIVE;

            $(#[inline]
            fn $function(self $(, $argument: Self)?) -> $result {
                $number::$function(self $(, $argument)?)
            })*
        }
    };
    ($($number:ident),*) => {$(machine_number! {
        $number:
        sin_cos() -> (Self, Self);
        sin() -> Self;
        cos() -> Self;
        sinh() -> Self;
        cosh() -> Self;
        atan() -> Self;
        atan2(other) -> Self;
        atanh() -> Self;
        exp_m1() -> Self;
        hypot(other) -> Self;
        abs() -> Self;
        signum() -> Self;
        max(other) -> Self;
        min(other) -> Self;
        round() -> Self;
        trunc() -> Self;
        ceil() -> Self;
    })*};
}
machine_number!(f32, f64);

macro_rules! vector {
    ($(#[$doc:meta])* $name:ident, $double:ident, $first:ident $($rest:ident)*) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct $name<T> {
            #[doc = concat!("Component ", stringify!($first), ".")]
            pub $first: T,
            $(#[doc = concat!("Component ", stringify!($rest), ".")] pub $rest: T,)*
        }

        impl<T: Real> $name<T> {
            /// From its components.
            #[inline]
            pub fn new($first: T, $($rest: T),*) -> Self {
                Self { $first, $($rest),* }
            }

            /// All components the same.
            #[inline]
            pub fn splat(x: T) -> Self {
                Self { $first: x, $($rest: x),* }
            }

            /// The zero vector.
            #[inline]
            pub fn zero() -> Self {
                Self::splat(T::from_f64(0.0))
            }

            /// Rounded from f64.
            #[inline]
            pub fn from_f64(v: $double) -> Self {
                Self { $first: T::from_f64(v.$first), $($rest: T::from_f64(v.$rest)),* }
            }

            /// Rounded to f64.
            #[inline]
            pub fn to_f64(self) -> $double {
                $double { $first: self.$first.to_f64(), $($rest: self.$rest.to_f64()),* }
            }

            /// Euclidean product.
            #[inline]
            pub fn dot(self, other: Self) -> T {
                self.$first * other.$first $(+ self.$rest * other.$rest)*
            }

            /// Euclidean length.
            #[inline]
            pub fn length(self) -> T {
                self.dot(self).sqrt()
            }
        }

        impl<T: Real> Add for $name<T> {
            type Output = Self;
            #[inline]
            fn add(self, other: Self) -> Self {
                Self { $first: self.$first + other.$first, $($rest: self.$rest + other.$rest),* }
            }
        }

        impl<T: Real> Sub for $name<T> {
            type Output = Self;
            #[inline]
            fn sub(self, other: Self) -> Self {
                Self { $first: self.$first - other.$first, $($rest: self.$rest - other.$rest),* }
            }
        }

        impl<T: Real> Mul<T> for $name<T> {
            type Output = Self;
            #[inline]
            fn mul(self, factor: T) -> Self {
                Self { $first: self.$first * factor, $($rest: self.$rest * factor),* }
            }
        }

        impl<T: Real> Div<T> for $name<T> {
            type Output = Self;
            #[inline]
            fn div(self, divisor: T) -> Self {
                Self { $first: self.$first / divisor, $($rest: self.$rest / divisor),* }
            }
        }
    };
}
vector!(
    /// A vector of a plane.
    Real2, DVec2, x y
);
vector!(
    /// A point or a vector of the chart.
    Real3, DVec3, x y z
);
vector!(
    /// A point or a tangent vector of a geometry, in its own coordinates.
    Real4, DVec4, x y z w
);

impl<T: Real> Real2<T> {
    /// The vector, turned by a right angle.
    #[inline]
    pub fn perp(self) -> Self {
        Self::new(-self.y, self.x)
    }

    /// Product with the other's, turned by a right angle: the area between the two.
    #[inline]
    pub fn perp_dot(self, other: Self) -> T {
        self.x * other.y - self.y * other.x
    }

    /// The other, turned as this unit vector is from the first axis.
    #[inline]
    pub fn rotate(self, other: Self) -> Self {
        Self::new(self.x * other.x - self.y * other.y, self.y * other.x + self.x * other.y)
    }

    /// With a third component.
    #[inline]
    pub fn extend(self, z: T) -> Real3<T> {
        Real3::new(self.x, self.y, z)
    }
}

impl<T: Elementary> Real2<T> {
    /// The unit vector at an angle, to rotate by.
    #[inline]
    pub fn from_angle(angle: T) -> Self {
        let (sin, cos) = angle.sin_cos();
        Self::new(cos, sin)
    }
}

impl<T: Real> Real3<T> {
    /// The first two components.
    #[inline]
    pub fn xy(self) -> Real2<T> {
        Real2::new(self.x, self.y)
    }

    /// With a fourth component.
    #[inline]
    pub fn extend(self, w: T) -> Real4<T> {
        Real4::new(self.x, self.y, self.z, w)
    }
}

impl<T: Real> Real4<T> {
    /// The first two components.
    #[inline]
    pub fn xy(self) -> Real2<T> {
        Real2::new(self.x, self.y)
    }

    /// The first three components.
    #[inline]
    pub fn xyz(self) -> Real3<T> {
        Real3::new(self.x, self.y, self.z)
    }
}

/// A [`Geodesic`] in numbers of any precision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RealGeodesic<T> {
    /// The point, in the geometry's own coordinates.
    pub point: Real4<T>,
    /// The velocity at the point, in the geometry's own components.
    pub velocity: Real4<T>,
}

impl<T: Real> RealGeodesic<T> {
    /// Rounded from f64.
    #[inline]
    pub fn from_f64(g: Geodesic) -> Self {
        Self { point: Real4::from_f64(g.point), velocity: Real4::from_f64(g.velocity) }
    }

    /// Rounded to f64.
    #[inline]
    pub fn to_f64(self) -> Geodesic {
        Geodesic { point: self.point.to_f64(), velocity: self.velocity.to_f64() }
    }
}
