//! Numbers of 192 bits, and the geodesic flows in them: the reference that errors are measured against.
//!
//! The flows are written from the definitions of the geometries and share no formula with [`crate::geometry`]: a program
//! that is compared with itself is always right. 192 bits leave 40 digits beyond f64, so the reference's own error is out
//! of sight even where a geodesic multiplies roundings by e¹⁰⁰.

mod groups;

use crate::geometry::GeometryId;
pub use groups::{SL2, SOL, TRACE, sl2_product};

use astro_float::{BigFloat, Consts, Radix, RoundingMode};
use std::{
    cell::RefCell,
    iter::Sum,
    ops::{Add, Div, Mul, Neg, Sub},
};

const BITS: usize = 192;
const ROUND: RoundingMode = RoundingMode::ToEven;

thread_local! {
    static CONSTANTS: RefCell<Option<Consts>> = RefCell::new(Consts::new().ok());
}

/// Runs a function that needs constants. Where there is no memory for them the result is no number, and no comparison
/// with it succeeds.
fn with_constants(f: impl FnOnce(&mut Consts) -> BigFloat) -> Big {
    Big(CONSTANTS.with_borrow_mut(|constants| constants.as_mut().map_or_else(|| BigFloat::nan(None), f)))
}

/// A number of 192 bits.
#[derive(Clone, Debug)]
pub struct Big(BigFloat);

impl Big {
    /// Exactly `x`. Subnormal numbers are scaled before they are read: astro-float takes their leading zeros for digits.
    pub fn new(x: f64) -> Self {
        const UP: f64 = 1.329_227_995_784_916e36; // 2^120
        if x != 0.0 && x.is_finite() && x.abs() < f64::MIN_POSITIVE {
            return &Self::new(x * UP) / &Self::new(UP);
        }
        Self(BigFloat::from_f64(x, BITS))
    }

    /// A decimal number.
    pub fn parse(text: &str) -> Self {
        with_constants(|c| BigFloat::parse(text, Radix::Dec, BITS, ROUND, c))
    }

    /// The nearest f64.
    pub fn to_f64(&self) -> f64 {
        self.0.to_string().parse().unwrap_or(f64::NAN)
    }

    /// The square root.
    pub fn sqrt(&self) -> Self {
        Self(self.0.sqrt(BITS, ROUND))
    }

    /// Angle of the vector `(x, self)` in (−π, π].
    pub fn atan2(&self, x: &Self) -> Self {
        let pi = with_constants(|c| c.pi(BITS, ROUND));
        let ratio = |a: &Self, b: &Self| with_constants(|c| (a / b).0.atan(BITS, ROUND, c));
        let quarter = &pi / &Self::new(2.0);
        match (self.0.abs() > x.0.abs(), self.0.is_negative(), x.0.is_negative()) {
            (true, false, _) => &quarter - &ratio(x, self),
            (true, true, _) => &(-&quarter) - &ratio(x, self),
            (false, _, false) => ratio(self, x),
            (false, false, true) => &ratio(self, x) + &pi,
            (false, true, true) => &ratio(self, x) - &pi,
        }
    }

    /// Sine and cosine.
    pub fn sin_cos(&self) -> (Self, Self) {
        (with_constants(|c| self.0.sin(BITS, ROUND, c)), with_constants(|c| self.0.cos(BITS, ROUND, c)))
    }

    /// Hyperbolic sine and cosine.
    pub fn sinh_cosh(&self) -> (Self, Self) {
        (with_constants(|c| self.0.sinh(BITS, ROUND, c)), with_constants(|c| self.0.cosh(BITS, ROUND, c)))
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
    /// The point, in the program's coordinates.
    pub point: Big4,
    /// The velocity there, in the program's components.
    pub direction: Big4,
}

/// A geometry's definition, for the reference.
pub trait Model: std::fmt::Debug + Sync {
    /// The geometry's name.
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

    /// The user's numbers put on the model, with the tangent part of the direction as it is.
    fn project(self, point: [f64; 4], direction: [f64; 4]) -> BigGeodesic {
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
        BigGeodesic { point: p, direction: v }
    }
}

/// The same with a direction of unit length.
fn normalised(form: Classical, g: BigGeodesic) -> BigGeodesic {
    let norm = form.form(&g.direction, &g.direction).sqrt();
    BigGeodesic { direction: g.direction.map(|x| &x / &norm), ..g }
}

impl Model for Classical {
    fn name(&self) -> &'static str {
        ["h3", "e3", "s3"][(self.0 + 1) as usize]
    }

    fn components(&self) -> [usize; 2] {
        if self.0 == 0 { [3, 3] } else { [4, 4] }
    }

    fn settle(&self, point: [f64; 4], direction: [f64; 4]) -> BigGeodesic {
        normalised(*self, self.project(point, direction))
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

/// The surface of this curvature, 1 or −1, times a line, the third coordinate.
#[derive(Clone, Copy, Debug)]
pub struct Product(pub i32);

impl Model for Product {
    fn name(&self) -> &'static str {
        if self.0 > 0 { "s2xr" } else { "h2xr" }
    }

    fn components(&self) -> [usize; 2] {
        [4, 4]
    }

    fn settle(&self, point: [f64; 4], direction: [f64; 4]) -> BigGeodesic {
        // The slice z = 0 of the classical geometry, tangent but not yet unit.
        let flat = |v: [f64; 4]| [v[0], v[1], 0.0, v[3]];
        let surface = Classical(self.0);
        let mut g = surface.project(flat(point), flat(direction));
        g.point[2] = Big::new(point[2]);
        g.direction[2] = Big::new(direction[2]);
        // The form counts the third coordinate as a line already.
        normalised(surface, g)
    }

    fn flow(&self, g: &BigGeodesic, t: &Big) -> BigGeodesic {
        let surface = Classical(self.0);
        let zero = Big::new(0.0);
        let mut h = g.direction.clone();
        h[2] = zero.clone();
        let speed = surface.form(&h, &h).sqrt();
        let mut p = g.point.clone();
        p[2] = zero;
        let mut end = BigGeodesic { point: p.clone(), direction: h.clone() };
        if speed.to_f64() > 0.0 {
            let unit = BigGeodesic { point: p, direction: h.map(|x| &x / &speed) };
            end = surface.flow(&unit, &(&speed * t));
            end.direction = end.direction.map(|x| &x * &speed);
        }
        end.point[2] = &g.point[2] + &(&g.direction[2] * t);
        end.direction[2] = g.direction[2].clone();
        end
    }
}

/// Nil, by integration of the turning frame velocity, as it stands in the books: with divisions by w.
#[derive(Clone, Copy, Debug)]
pub struct Nil;

impl Model for Nil {
    fn name(&self) -> &'static str {
        "nil"
    }

    fn components(&self) -> [usize; 2] {
        [3, 3]
    }

    fn settle(&self, point: [f64; 4], direction: [f64; 4]) -> BigGeodesic {
        Classical(0).settle(point, direction)
    }

    fn flow(&self, g: &BigGeodesic, t: &Big) -> BigGeodesic {
        let [u, v, w, _] = &g.direction;
        let two = Big::new(2.0);
        let product = |x: &Big, y: &Big, z: &Big| {
            let [px, py, pz, one] = &g.point;
            [px + x, py + y, &(pz + z) + &(px * y), one.clone()]
        };
        if w.to_f64() == 0.0 {
            let (x, y) = (u * t, v * t);
            let z = &(&x * &y) / &two;
            return BigGeodesic { point: product(&x, &y, &z), direction: g.direction.clone() };
        }
        let angle = w * t;
        let (sin, cos) = angle.sin_cos();
        let turned = [&(u * &cos) - &(v * &sin), &(u * &sin) + &(v * &cos)];
        // x' = u, y' = v; z = ∫ w + x v, where x = (v(s) − v)/w.
        let (x, y) = (&(&turned[1] - v) / w, &(u - &turned[0]) / w);
        let square = &(u * u) + &(v * v);
        // ∫ v² = c² t/2 − (sin 2θ − sin 2α) c²/(4w) = c² t/2 − (u v at the end − u v)/(2w).
        let products = &(&turned[0] * &turned[1]) - &(u * v);
        let squares = &(&(&square * t) / &two) - &(&products / &(&two * w));
        let z = &(&angle + &(&squares / w)) - &(&(v * &y) / w);
        let [u, v] = turned;
        BigGeodesic { point: product(&x, &y, &z), direction: [u, v, w.clone(), Big::new(0.0)] }
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

/// Euclidean distance of two vectors of the reference.
pub fn apart(a: &Big4, b: &Big4) -> f64 {
    let squares = a.iter().zip(b).map(|(x, y)| {
        let d = x - y;
        &d * &d
    });
    squares.sum::<Big>().sqrt().to_f64()
}

/// The reference of a geometry; none for one that has no reference yet.
pub fn model(geometry: GeometryId) -> Option<&'static dyn Model> {
    const MODELS: [&dyn Model; 9] =
        [&Classical(0), &Classical(1), &Classical(-1), &Product(1), &Product(-1), &Nil, SOL, SL2, TRACE];
    MODELS.into_iter().find(|model| model.name() == geometry.name())
}
