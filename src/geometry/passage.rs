//! The first passage of a curve through a plane, where no closed form says it.
//!
//! Let f be the size of the plane's form along the curve and |f''| ≤ M ahead. From a parameter where f < 0 the curve
//! needs at least the positive root s of f + f' s + M s²/2 to get through, so a walk by such steps never passes a
//! root, nor two at once; at a simple root it converges quadratically, like Newton's method from one side. Where f
//! recedes the steps grow with the root of the distance.

use super::{ALONG_FACE, ON_FACE};

/// A plane's form along a curve, at one parameter.
#[derive(Clone, Copy, Debug)]
pub(super) struct Motion {
    /// Its size: negative inside.
    pub(super) value: f64,
    /// Its first derivative.
    pub(super) rate: f64,
    /// A bound of its second derivative for the next `reach`.
    pub(super) bend: f64,
    /// How far the bound holds.
    pub(super) reach: f64,
}

/// More steps than this are not made. A geodesic in a cell of diameter D takes some 2√D steps to each face that it
/// nears, and five more to converge.
const MAX_STEPS: usize = 200;

/// A smaller bound of the second derivative would overflow the step.
const LEAST_BEND: f64 = 1e-30;

/// The first parameter at which the form passes from negative to positive, by the rules of
/// [`Geometry::exit`](super::Geometry::exit). `motion` is `None` where the curve will never pass any more.
pub(super) fn first_passage(motion: impl Fn(f64) -> Option<Motion>) -> f64 {
    let mut t = 0.0;
    for _ in 0..MAX_STEPS {
        let Some(Motion { value, rate, bend, reach }) = motion(t) else { break };
        if value > -ON_FACE && rate > ALONG_FACE {
            return (t - value / rate).max(0.0);
        }
        let (distance, bend) = (value.abs().max(ON_FACE), bend.max(LEAST_BEND));
        let root = (rate * rate + 2.0 * bend * distance).sqrt();
        let step = if rate > 0.0 { 2.0 * distance / (rate + root) } else { (root - rate) / bend };
        t += step.min(reach);
    }
    f64::INFINITY
}
