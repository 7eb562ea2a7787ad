//! Numbers of 192 bits, and the geodesic flows in them: the reference that errors are measured against.

use astro_float::{BigFloat, Consts, Radix, RoundingMode};
use std::{
    cell::RefCell,
    iter::Sum,
    ops::{Add, Div, Mul, Neg, Sub},
};

const BITS: usize = 192;
const ROUND: RoundingMode = RoundingMode::ToEven;

thread_local! {
    static CONSTANTS: RefCell<Consts> = RefCell::new(Consts::new().expect("constants can be computed"));
}

/// A number of 192 bits.
#[derive(Clone, Debug)]
pub struct Big(BigFloat);

impl Big {
    /// Exactly `x`.
    pub fn new(x: f64) -> Self {
        Self(BigFloat::from_f64(x, BITS))
    }

    /// A decimal number.
    pub fn parse(text: &str) -> Self {
        Self(CONSTANTS.with_borrow_mut(|c| BigFloat::parse(text, Radix::Dec, BITS, ROUND, c)))
    }

    /// The nearest f64.
    pub fn to_f64(&self) -> f64 {
        self.0.to_string().parse().expect("a number prints as a number")
    }

    pub fn sqrt(&self) -> Self {
        Self(self.0.sqrt(BITS, ROUND))
    }

    /// Angle of the vector `(x, self)` in (−π, π].
    pub fn atan2(&self, x: &Self) -> Self {
        let pi = CONSTANTS.with_borrow_mut(|c| Self(c.pi(BITS, ROUND)));
        let ratio = |a: &Self, b: &Self| CONSTANTS.with_borrow_mut(|c| Self((a / b).0.atan(BITS, ROUND, c)));
        let quarter = &pi / &Self::new(2.0);
        match (self.0.abs() > x.0.abs(), self.0.is_negative(), x.0.is_negative()) {
            (true, false, _) => &quarter - &ratio(x, self),
            (true, true, _) => &(-&quarter) - &ratio(x, self),
            (false, _, false) => ratio(self, x),
            (false, false, true) => &ratio(self, x) + &pi,
            (false, true, true) => &ratio(self, x) - &pi,
        }
    }

    pub fn sin_cos(&self) -> (Self, Self) {
        CONSTANTS.with_borrow_mut(|c| (Self(self.0.sin(BITS, ROUND, c)), Self(self.0.cos(BITS, ROUND, c))))
    }

    pub fn sinh_cosh(&self) -> (Self, Self) {
        CONSTANTS.with_borrow_mut(|c| (Self(self.0.sinh(BITS, ROUND, c)), Self(self.0.cosh(BITS, ROUND, c))))
    }
}

macro_rules! operators {
    ($($trait:ident, $method:ident;)*) => {$(
        impl $trait for &Big {
            type Output = Big;
            fn $method(self, other: &Big) -> Big {
                Big(self.0.$method(&other.0, BITS, ROUND))
            }
        }
    )*};
}
operators! { Add, add; Sub, sub; Mul, mul; Div, div; }

impl Neg for &Big {
    type Output = Big;
    fn neg(self) -> Big {
        Big(self.0.clone().neg())
    }
}

impl Sum for Big {
    fn sum<I: Iterator<Item = Big>>(items: I) -> Big {
        items.fold(Big::new(0.0), |a, b| &a + &b)
    }
}

/// Four numbers.
pub type Big4 = [Big; 4];

/// Point and direction of a geodesic.
#[derive(Clone, Debug)]
pub struct BigGeodesic {
    pub point: Big4,
    pub direction: Big4,
}

/// A geometry's definition, for the reference.
pub trait Model: std::fmt::Debug + Sync {
    fn name(&self) -> &'static str;

    /// How many numbers the program takes for a point and for a direction.
    fn components(&self) -> [usize; 2];

    /// The user's numbers put on the model, with a unit tangent vector.
    fn settle(&self, point: [f64; 4], direction: [f64; 4]) -> BigGeodesic;

    /// The flow by length `t`.
    fn flow(&self, g: &BigGeodesic, t: &Big) -> BigGeodesic;
}

/// The classical geometries, by the sign of their curvature: −1 hyperbolic, 0 Euclidean, 1 spherical. Written from
/// the definitions, not from the program.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Classical(pub i32);

impl Classical {
    /// The inner product of R⁴ whose restriction is the metric; the last coordinate does not count in E3.
    pub fn form(self, u: &Big4, v: &Big4) -> Big {
        let spatial: Big = (0..3).map(|i| &u[i] * &v[i]).sum();
        &spatial + &(&Big::new(f64::from(self.0)) * &(&u[3] * &v[3]))
    }
}

impl Model for Classical {
    fn name(&self) -> &'static str {
        ["h3", "e3", "s3"][(self.0 + 1) as usize]
    }

    fn components(&self) -> [usize; 2] {
        if self.0 == 0 { [3, 3] } else { [4, 4] }
    }

    fn settle(&self, point: [f64; 4], direction: [f64; 4]) -> BigGeodesic {
        let mut p = point.map(Big::new);
        let mut v = direction.map(Big::new);
        match self.0 {
            0 => {
                p[3] = Big::new(1.0);
                v[3] = Big::new(0.0);
            }
            1 => {
                let norm = self.form(&p, &p).sqrt();
                p = p.map(|x| &x / &norm);
            }
            _ => p[3] = (&Big::new(1.0) + &(0..3).map(|i| &p[i] * &p[i]).sum()).sqrt(),
        }
        if self.0 != 0 {
            let along = &self.form(&p, &v) * &Big::new(f64::from(self.0));
            v = std::array::from_fn(|i| &v[i] - &(&along * &p[i]));
        }
        let norm = self.form(&v, &v).sqrt();
        BigGeodesic { point: p, direction: v.map(|x| &x / &norm) }
    }

    fn flow(&self, g: &BigGeodesic, t: &Big) -> BigGeodesic {
        let (s, c) = match self.0 {
            0 => (t.clone(), Big::new(1.0)),
            1 => t.sin_cos(),
            _ => t.sinh_cosh(),
        };
        let turn = &s * &Big::new(f64::from(-self.0));
        let combine = |a: &Big, x: &Big, b: &Big, y: &Big| &(a * x) + &(b * y);
        BigGeodesic {
            point: std::array::from_fn(|i| combine(&c, &g.point[i], &s, &g.direction[i])),
            direction: std::array::from_fn(|i| combine(&c, &g.direction[i], &turn, &g.point[i])),
        }
    }
}

/// Euclidean distance of a computed vector from the reference.
pub fn distance(reference: &Big4, computed: &[f64]) -> f64 {
    let squares = computed.iter().zip(reference).map(|(x, r)| {
        let d = &Big::new(*x) - r;
        &d * &d
    });
    squares.sum::<Big>().sqrt().to_f64()
}

#[test]
fn big_numbers_hold_fifty_digits() {
    let x = Big::parse("1.4142135623730950488016887242096980785696718753769480731766797379");
    let defect = &(&x * &x) - &Big::new(2.0);
    assert!(defect.to_f64().abs() < 1e-55, "{defect:?}");
    let (s, c) = Big::new(1000.0).sin_cos();
    assert!((&(&(&s * &s) + &(&c * &c)) - &Big::new(1.0)).to_f64().abs() < 1e-55);
    assert!((s.to_f64() - 0.826_879_540_532_003).abs() < 1e-15);
}
