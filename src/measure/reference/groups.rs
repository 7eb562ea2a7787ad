//! The geodesic flows of the matrix groups and of Sol in 192 bits, from their definitions: power series of the
//! equation of motion, and of the matrix exponential. Nothing here is a formula of the program.

use super::{Big, Big4, BigGeodesic, Model};

/// Sol.
pub const SOL: &dyn Model = &Sol;
/// The universal cover of SL(2, R).
pub const SL2: &dyn Model = &Sl2;
/// SL(2, R) with the trace form.
pub const TRACE: &dyn Model = &Trace;

fn zero() -> Big {
    Big::new(0.0)
}

fn unit(direction: [f64; 4]) -> Big4 {
    let v = direction.map(Big::new);
    let norm = v.iter().map(|x| x * x).sum::<Big>().sqrt();
    v.map(|x| &x / &norm)
}

#[derive(Debug)]
struct Sol;

/// Terms of the series: with steps of 1/4, six times smaller than the distance of the nearest singularity, 1e-26.
const TERMS: usize = 34;

/// One coefficient of the product of two series.
fn product(a: &[Big], b: &[Big], k: usize) -> Big {
    (0..=k).map(|j| &a[j] * &b[k - j]).sum()
}

impl Model for Sol {
    fn name(&self) -> &'static str {
        "sol"
    }

    fn components(&self) -> [usize; 2] {
        [3, 3]
    }

    fn settle(&self, point: [f64; 4], direction: [f64; 4]) -> BigGeodesic {
        BigGeodesic { point: point.map(Big::new), direction: unit(direction) }
    }

    /// From the identity: `P = e²ᶻ`, `Q = e⁻²ᶻ`, `P′ = 2Pw`, `Q′ = −2Qw`, `w′ = v₀²Q − u₀²P`, `x′ = u₀P`, `y′ = v₀Q`.
    fn flow(&self, g: &BigGeodesic, t: &Big) -> BigGeodesic {
        let [u, v, w, _] = &g.direction;
        let count = (t.to_f64().abs() * 4.0).ceil().max(1.0);
        let h = t / &Big::new(count);
        let two = Big::new(2.0);
        // x, y, z, P, Q, w.
        let mut now = [zero(), zero(), zero(), Big::new(1.0), Big::new(1.0), w.clone()];
        for _ in 0..count as usize {
            let mut series: [Vec<Big>; 6] = now.map(|x| vec![x]);
            for k in 0..TERMS {
                let [_, _, _, p, q, w] = &series;
                let rates = [
                    u * &p[k],
                    v * &q[k],
                    w[k].clone(),
                    &two * &product(p, w, k),
                    -&(&two * &product(q, w, k)),
                    &(&(v * v) * &q[k]) - &(&(u * u) * &p[k]),
                ];
                let next = Big::new((k + 1) as f64);
                for (terms, rate) in series.iter_mut().zip(rates) {
                    terms.push(&rate / &next);
                }
            }
            now = series.map(|terms| terms.iter().rev().fold(zero(), |sum, term| &(&sum * &h) + term));
        }
        let [x, y, z, p, q, w] = now;
        let (sinh, cosh) = g.point[2].sinh_cosh();
        let (rise, fall) = (&cosh + &sinh, &cosh - &sinh);
        BigGeodesic {
            point: [&g.point[0] + &(&rise * &x), &g.point[1] + &(&fall * &y), &g.point[2] + &z, zero()],
            direction: [u * &p.sqrt(), v * &q.sqrt(), w, zero()],
        }
    }
}

/// A 2×2 matrix, row by row.
type Matrix = [Big; 4];

fn times(a: &Matrix, b: &Matrix) -> Matrix {
    let entry = |i: usize, j: usize| &(&a[2 * i] * &b[j]) + &(&a[2 * i + 1] * &b[2 + j]);
    [entry(0, 0), entry(0, 1), entry(1, 0), entry(1, 1)]
}

/// The exponential by its series, after halving.
fn exp(m: &Matrix) -> Matrix {
    let size = m.iter().map(|x| x.to_f64().abs()).fold(0.0, f64::max);
    let halvings = size.max(1.0).log2().ceil() as i32 + 2;
    let small = m.clone().map(|x| &x * &Big::new(2.0_f64.powi(-halvings)));
    let one = [Big::new(1.0), zero(), zero(), Big::new(1.0)];
    let (mut sum, mut term) = (one.clone(), one);
    for k in 1..40 {
        term = times(&term, &small).map(|x| &x / &Big::new(f64::from(k)));
        sum = std::array::from_fn(|i| &sum[i] + &term[i]);
    }
    (0..halvings).fold(sum, |m, _| times(&m, &m))
}

#[derive(Debug)]
struct Sl2;

/// The symmetric positive factor of an element `(x, y, θ, w)`.
fn symmetric([x, y, _, w]: &Big4) -> Matrix {
    let one = Big::new(1.0);
    let norm = (&Big::new(2.0) * &(&one + w)).sqrt();
    [&(&one + w) + x, y.clone(), y.clone(), &(&one + w) - x].map(|e| &e / &norm)
}

/// The element with this matrix, whose fibre angle is within 2π of a rough one.
fn element(m: &Matrix, rough: f64) -> Big4 {
    let two = Big::new(2.0);
    let square = times(m, &[m[0].clone(), m[2].clone(), m[1].clone(), m[3].clone()]);
    // θ/2 is known up to turns from the matrix.
    let within = &two * &(&m[2] - &m[1]).atan2(&(&m[0] + &m[3]));
    let turns = ((rough - within.to_f64()) / (4.0 * std::f64::consts::PI)).round();
    let full = &Big::new(4.0 * turns) * &zero().atan2(&Big::new(-1.0));
    [&(&square[0] - &square[3]) / &two, square[1].clone(), &within + &full, &(&square[0] + &square[3]) / &two]
}

/// The product of two elements of the universal cover of SL(2, R). Fibre angles add up to less than half a turn.
pub fn sl2_product(left: &Big4, right: &Big4) -> Big4 {
    let matrix = |p: &Big4| times(&symmetric(p), &rotation(&p[2]));
    element(&times(&matrix(left), &matrix(right)), (&left[2] + &right[2]).to_f64())
}

/// `exp(θ X₃)`.
fn rotation(angle: &Big) -> Matrix {
    let (sin, cos) = (angle / &Big::new(2.0)).sin_cos();
    [cos.clone(), -&sin, sin, cos]
}

impl Sl2 {
    /// The fibre angle at the end, good to a tenth: the connection's equation by RK4 in f64.
    fn rough_angle(g: &BigGeodesic, t: f64) -> f64 {
        let [x, y, angle, w] = g.point.each_ref().map(Big::to_f64);
        let [a, b, c, _] = g.direction.each_ref().map(Big::to_f64);
        let rate = |s: f64, [x, y, angle, w]: [f64; 4]| {
            let (sin, cos) = (angle - 2.0 * c * s).sin_cos();
            let (p, q) = (a * cos - b * sin, a * sin + b * cos);
            let along = x * p + y * q;
            [p + x * along / (1.0 + w), q + y * along / (1.0 + w), c + (y * p - x * q) / (1.0 + w), along]
        };
        let count = (t.abs() * 100.0).ceil().max(1.0);
        let h = t / count;
        let mut now = [x, y, angle, w];
        for k in 0..count as usize {
            let s = h * k as f64;
            let shifted = |rates: [f64; 4], h: f64| std::array::from_fn(|i| now[i] + h * rates[i]);
            let k1 = rate(s, now);
            let k2 = rate(s + 0.5 * h, shifted(k1, 0.5 * h));
            let k3 = rate(s + 0.5 * h, shifted(k2, 0.5 * h));
            let k4 = rate(s + h, shifted(k3, h));
            now = std::array::from_fn(|i| now[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]));
            // Farther out than this the angle has come to rest.
            if now[3] > 1e30 {
                break;
            }
        }
        now[2]
    }
}

impl Model for Sl2 {
    fn name(&self) -> &'static str {
        "sl2"
    }

    fn components(&self) -> [usize; 2] {
        [4, 3]
    }

    fn settle(&self, point: [f64; 4], direction: [f64; 4]) -> BigGeodesic {
        let mut p = point.map(Big::new);
        p[3] = (&(&Big::new(1.0) + &(&p[0] * &p[0])) + &(&p[1] * &p[1])).sqrt();
        BigGeodesic { point: p, direction: unit(direction) }
    }

    /// `g exp(t(aX₁ + bX₂ − cX₃)) exp(2ct X₃)`.
    fn flow(&self, g: &BigGeodesic, t: &Big) -> BigGeodesic {
        let [a, b, c, _] = &g.direction;
        let two = Big::new(2.0);
        let start = times(&symmetric(&g.point), &rotation(&g.point[2]));
        let half = t / &two;
        let first = exp(&[&half * a, &half * &(b + c), &half * &(b - c), -&(&half * a)]);
        let turn = &(&two * c) * t;
        let end = times(&times(&start, &first), &rotation(&turn));
        let (sin, cos) = turn.sin_cos();
        BigGeodesic {
            point: element(&end, Self::rough_angle(g, t.to_f64())),
            direction: [&(a * &cos) + &(b * &sin), &(b * &cos) - &(a * &sin), c.clone(), zero()],
        }
    }
}

#[derive(Debug)]
struct Trace;

impl Model for Trace {
    fn name(&self) -> &'static str {
        "sl2-trace"
    }

    fn components(&self) -> [usize; 2] {
        [3, 3]
    }

    fn settle(&self, point: [f64; 4], direction: [f64; 4]) -> BigGeodesic {
        BigGeodesic { point: point.map(Big::new), direction: direction.map(Big::new) }
    }

    fn flow(&self, g: &BigGeodesic, t: &Big) -> BigGeodesic {
        let [x, y, z, _] = &g.point;
        let [u, v, w, _] = &g.direction;
        let first = &Big::new(1.0) + x;
        let last = &(&Big::new(1.0) + &(y * z)) / &first;
        let start = [first, y.clone(), z.clone(), last];
        let end = times(&start, &exp(&[t * u, t * v, t * w, -&(t * u)]));
        let [first, y, z, _] = end;
        BigGeodesic { point: [&first - &Big::new(1.0), y, z, zero()], direction: g.direction.clone() }
    }
}
