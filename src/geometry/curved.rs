//! What the geometries share whose geodesics are curves in the chart: passages through planes, arcs, the nearest
//! point of a curve, Newton's method for geodesics between two points, and the entire functions of a one-parameter
//! subgroup of 2×2 matrices.

use super::{ALONG_FACE, Elementary, Geodesic, Geometry, ON_FACE};
use glam::{DMat3, DVec3, DVec4};

/// Where a function that is negative before first reaches zero, searched in `[0, end]`. `value_and_rate` gives the
/// function and its derivative, `bend` bounds its second derivative.
///
/// Each step goes to where the parabola with that second derivative would vanish, so no zero is ever stepped over,
/// however close two of them are; near a simple zero the convergence is quadratic, as in Newton's method. A function
/// that stays next to zero all the way (a geodesic almost in its plane) would take ever shorter steps: after
/// [`PATIENCE`] of them none is shorter than [`STRIDE`], and what such a stride may miss is the `bend`'s share of
/// `STRIDE²/8`.
pub(super) fn first_zero(value_and_rate: impl Fn(f64) -> [f64; 2], bend: f64, end: f64) -> Option<f64> {
    let bend = bend.max(f64::MIN_POSITIVE);
    let (mut s, mut before) = (0.0, None);
    for count in 0_u32.. {
        let [value, rate] = value_and_rate(s);
        if value >= 0.0 {
            return Some(before.map_or(s, |low| bisect(&value_and_rate, low, s)));
        }
        let root = (rate * rate - 2.0 * bend * value).sqrt();
        let step = if rate > 0.0 { -2.0 * value / (rate + root) } else { (root - rate) / bend };
        if step <= f64::EPSILON * (1.0 + s) {
            return Some(s);
        }
        let stride = count > PATIENCE && step < STRIDE;
        if s >= end || (s + step > end && !stride) {
            return None;
        }
        before = stride.then_some(s);
        s = if stride { (s + STRIDE).min(end) } else { s + step };
    }
    None
}

/// The zero between a negative value and one that is not.
fn bisect(value_and_rate: impl Fn(f64) -> [f64; 2], mut low: f64, mut high: f64) -> f64 {
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        let [value, _] = value_and_rate(middle);
        if value < 0.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

/// Steps that [`first_zero`] takes with full care; ordinary passages take about six.
const PATIENCE: u32 = 60;

/// Its shortest step from then on.
const STRIDE: f64 = 1e-3;

/// How a passage begins: where the state is on its plane and moves outwards it leaves at once. Otherwise the value
/// whose zero is the passage; a start on the plane must first get clear of it.
pub(super) fn before_passage(value: f64, rate: f64) -> Option<f64> {
    match value >= -ON_FACE {
        true if rate > ALONG_FACE => None,
        true => Some(ON_FACE + value.max(0.0)),
        false => Some(0.0),
    }
}

/// Bounds of the largest `h ≤ limit` with `third(h) h³/96 ≤ tolerance`, from above and from below, where `third(h)`, growing
/// with `h`, bounds the metric length of the chart's third derivative over a step `h`, measured at any point of the step: how
/// far an [`Segment`](super::Segment) may reach. What an h `within` that reach allows, such as 0, is too long, and what that
/// allows too short.
pub(super) fn arc_bounds(within: f64, limit: f64, tolerance: f64, third: impl Fn(f64) -> f64) -> [f64; 2] {
    // A root in f32 is good enough, and many times cheaper: this is done for every segment.
    let root = |cube: f64| f64::from((cube as f32).cbrt()) * (1.0 - 1e-6);
    let allowed = |h: f64| root(96.0 * tolerance / third(h).max(1e-30)).min(limit);
    let most = allowed(within);
    [most, allowed(most)]
}

/// Bounds whose ratio is less than this are looked for again, so often at most: there are few, where a curve that begins as a
/// straight line in the chart does not go on so.
const ARC_APART: f64 = 1.0 / 3.0;
const ARC_ROUNDS: u32 = 4;

/// The largest such `h` for a convex `third`, on the safe side. A convex function lies below its chord from 0 to the upper bound
/// `most`, and the chord allows `x most` with `(r⁻³ − 1) x⁴ + x³ = 1`, where `r` is the ratio of the bounds. No more than that `x`,
/// and less by 1 % at most if `r ≥ 1/3`, is `r (1 + 0.65 (1 − r)²)`.
pub(super) fn longest_arc(limit: f64, tolerance: f64, third: impl Fn(f64) -> f64) -> f64 {
    let mut arc = 0.0;
    for _ in 0..ARC_ROUNDS {
        let [most, least] = arc_bounds(arc, limit, tolerance, &third);
        // Both may be the limit: 0, or less by a rounding, or infinite.
        let apart = if least < most { 1.0 - least / most } else { 0.0 };
        arc = least * (1.0 + 0.65 * apart * apart);
        if least >= ARC_APART * most {
            break;
        }
    }
    arc
}

/// Curve parameter of the curve's point nearest to a chart point: Gauss–Newton, quadratic where the point is on the
/// curve and contracting by curvature times distance elsewhere. `product` is the positive product of the frame.
pub(super) fn nearest_parameter<G: Geometry>(
    geometry: G,
    g: Geodesic,
    c: DVec3,
    product: impl Fn(DVec4, DVec4) -> f64,
) -> f64 {
    let mut s = 0.0;
    for _ in 0..24 {
        let at = geometry.advance(g, s);
        let off = geometry.unchart_vector(at.point, c - geometry.chart(at.point));
        let step = product(off, at.velocity) / product(at.velocity, at.velocity).max(f64::MIN_POSITIVE);
        if !step.is_finite() {
            break;
        }
        s += step;
        if step.abs() <= f64::EPSILON * (0.1 + s.abs()) {
            break;
        }
    }
    s
}

/// Solves `end(v) = target` for the velocity `v` (its length is the geodesic's) from a guess. `off_and_differential`
/// gives the displacement from `end(v)` to the target in the frame at `end(v)`, and the differential of `end`.
/// Steps are limited to length 1, and the best velocity met is returned, so the answer is finite whenever the guess
/// is.
pub(super) fn shoot(guess: DVec3, off_and_differential: impl Fn(DVec3) -> (DVec3, DMat3)) -> DVec3 {
    let (mut v, mut best, mut least) = (guess, guess, f64::INFINITY);
    for _ in 0..30 {
        let (off, differential) = off_and_differential(v);
        let residual = off.length();
        if residual < least {
            (best, least) = (v, residual);
        } else if least < 1e-6 {
            // So near, each step gains until rounding is reached.
            break;
        }
        let step = differential.inverse() * off;
        let length = step.length();
        if !length.is_finite() || length <= 0.25 * f64::EPSILON * v.length() || residual == 0.0 {
            break;
        }
        v += step / length.max(1.0);
    }
    best
}

/// Area of a small wavefront after length `t` per solid angle, from the differential of the exponential map at `t v`
/// for unit `v`. Vectors `a`, `b` across `v` have `Ma × Mb = cof(M) (a × b)`.
pub(super) fn wave_area(differential: DMat3, v: DVec3, t: f64) -> f64 {
    let [a, b, c] = [differential.x_axis, differential.y_axis, differential.z_axis];
    (b.cross(c) * v.x + c.cross(a) * v.y + a.cross(b) * v.z).length() * t * t
}

/// `cosh √z` and `sinh √z / √z`, entire functions of `z`: `cos` and `sin` for negative `z`.
pub(super) fn cosh_sinhc<T: Elementary>(z: T) -> (T, T) {
    let number = T::from_f64;
    let root = z.abs().sqrt();
    if root < number(0.5) {
        let series = |first: i32| {
            let factors = (0..9).rev().map(|k| f64::from((2 * k + first) * (2 * k + first + 1)));
            factors.fold(number(1.0), |sum, factor| number(1.0) + sum * z / number(factor))
        };
        (series(1), series(2))
    } else if z > number(0.0) {
        (root.cosh(), root.sinh() / root)
    } else {
        (root.cos(), root.sin() / root)
    }
}

/// `(cosh √z − 1)/z` and `(sinh √z − √z)/√z³`.
pub(super) fn integrals(z: f64) -> (f64, f64) {
    let root = z.abs().sqrt();
    let (half, sinhc) = (cosh_sinhc(0.25 * z).1, cosh_sinhc(z).1);
    let second = 0.5 * half * half;
    if root < 1.0 {
        let third =
            (1..11).rev().fold(1.0, |sum, k| 1.0 + sum * z / ((2.0 * f64::from(k) + 2.0) * (2.0 * f64::from(k) + 3.0)));
        (second, third / 6.0)
    } else {
        (second, (sinhc - 1.0) / z)
    }
}

/// `t ≥ 0` with `tanh(√q t)/√q = numerator/denominator` (`tan` for negative `q`), for `numerator ≥ 0`; infinite where
/// there is none. A negative ratio is met behind the quarter turn of the tangent.
pub(super) fn artanh_over<T: Elementary>(q: T, numerator: T, denominator: T) -> T {
    let number = T::from_f64;
    let zero = number(0.0);
    let root = q.abs().sqrt();
    if q < zero && root * numerator >= number(0.1) * denominator {
        return (root * numerator).atan2(denominator) / root;
    }
    if !(denominator > zero && (q <= zero || root * numerator < denominator)) {
        return number(f64::INFINITY);
    }
    let ratio = numerator / denominator;
    let z = q * ratio * ratio;
    if z.abs() < number(0.01) {
        // Σ zᵏ/(2k+1).
        return ratio * (0..9).rev().fold(zero, |sum, k| sum * z + number(1.0 / (2.0 * f64::from(k) + 1.0)));
    }
    (root * ratio).atanh() / root
}

/// First `t ≥ 0` at which `f(t) = (start + 2 rate τ + bend τ²)/(1 − q τ²)`, `τ = tanh(√q t/2)/√q`, passes from
/// negative to positive; infinite if it never does. All functions in the span of `1, cosh √q t, sinh √q t` (`cos`
/// and `sin` for negative `q`, `t` and `t²` for 0) have this form, and `rate` is the derivative at the start.
pub(super) fn first_passage(q: f64, start: f64, rate: f64, bend: f64) -> f64 {
    let start = start.min(0.0);
    let discriminant = rate * rate - bend * start;
    if discriminant < 0.0 {
        return f64::INFINITY;
    }
    // Of the two roots the one where the numerator grows, in the form that does not cancel.
    let root = discriminant.sqrt();
    let (numerator, denominator) = if rate > ALONG_FACE { (-start, rate + root) } else { (root - rate, bend) };
    2.0 * artanh_over(q, numerator, denominator)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Arcs are no longer than a convex bound allows, whatever the limit, and hardly shorter where the bound is its chord.
    #[test]
    fn curved_arcs_are_as_long_as_allowed() {
        let mut nearly = 0;
        for growth in [0.0, 0.01, 0.3, 1.0, 3.0, 10.0, 1e3, 1e6] {
            let bounds: [&dyn Fn(f64) -> f64; 3] =
                [&|h| 1.0 + growth * h, &|h| (growth.min(2.0) * h).exp(), &|h| (1.0 + growth * growth * h * h).sqrt()];
            for (which, third) in bounds.iter().enumerate() {
                for (limit, tolerance) in [(f64::INFINITY, 1e-3), (f64::INFINITY, 1e-2), (0.3, 1e-3), (0.01, 1e-2)] {
                    let reaches = |h: f64| third(h) * h.powi(3) / 96.0;
                    let [most, least] = arc_bounds(0.0, limit, tolerance, third);
                    let arc = longest_arc(limit, tolerance, third);
                    let case = format!("bound {which}, growth {growth}, limit {limit}: {least} {arc} {most}");
                    assert!(0.0 < least && least <= arc && arc <= most && most <= limit, "{case}");
                    assert!(reaches(arc) <= tolerance, "{case}: {:e}", reaches(arc));
                    assert!(arc == limit || reaches(1.3 * arc) > tolerance, "{case} is far too short");
                    if which == 0 && limit.is_infinite() && 3.0 * least >= most {
                        assert!(reaches(1.01 * arc) > tolerance, "{case} is short");
                        nearly += 1;
                    }
                }
            }
        }
        assert!(nearly > 8);
        for limit in [0.0, -1e-9] {
            assert_eq!(longest_arc(limit, 1e-3, |h| 1.0 + h), limit);
        }
        assert_eq!(longest_arc(f64::INFINITY, f64::INFINITY, |h| 1.0 + h), f64::INFINITY);
    }
}
