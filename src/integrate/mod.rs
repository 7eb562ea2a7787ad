//! Integrators of the equation of geodesics, behind one interface, in any precision. Twin of the steps:
//! `shaders/shared/integrate.glsl`.
//!
//! The equation is the same for all geometries: in the chart, with state `(c, c′)` in R³ × R³ and arc length for time,
//! `c″ = spray(c, c′)` ([`Geometry::spray`]). An integrator turns a state into the next and into a polynomial between
//! the two ([`Dense`]), from which passages through faces and hits are read.
//!
//! | method | parameter | order | evaluations a step |
//! | --- | --- | --- | --- |
//! | [`Exact`], the geometry's own flow | none | exact | none |
//! | [`Euler`], the book's (equation 3.1) | step | 1 | 1 |
//! | [`Rk4`] | step | 4 | 5, the last one for the polynomial |
//! | [`Dopri5`] | tolerance of a step | 5, polynomial 4 | 7, of which one is the next step's first |
//!
//! Where the chart ends, an integrator has nothing to go by: the states leave the numbers or the step shrinks for ever.
//! Either ends the way ([`Stop`]); nothing loops and nothing that is not a number is returned.

mod dopri5;
mod euler;
mod exact;
mod rk4;

pub use dopri5::Dopri5;
pub use euler::Euler;
pub use exact::Exact;
pub use rk4::Rk4;

use crate::geometry::{Elementary, Geodesic, Geometry, Real, Real3};
use glam::{DVec3, DVec4};

/// A point of a geodesic in the chart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct State<T> {
    /// Chart coordinates.
    pub c: Real3<T>,
    /// Their derivative by arc length.
    pub v: Real3<T>,
}

impl<T: Real> State<T> {
    /// Whether all numbers are finite.
    pub fn is_finite(&self) -> bool {
        self.c.to_f64().is_finite() && self.v.to_f64().is_finite()
    }

    /// The state of a geodesic of the geometry.
    pub fn of<G: Geometry>(geometry: G, g: Geodesic) -> Self {
        Self {
            c: Real3::from_f64(geometry.chart(g.point)),
            v: Real3::from_f64(geometry.chart_vector(g.point, g.velocity)),
        }
    }

    /// Point and velocity in the geometry's own coordinates, as long as the chart reaches. The velocity is as long as
    /// integration has left it.
    pub fn geodesic<G: Geometry>(&self, geometry: G) -> Option<Geodesic> {
        let point = geometry.unchart(self.c.to_f64()).filter(|p| p.is_finite())?;
        let velocity = geometry.unchart_vector(point, self.v.to_f64());
        velocity.is_finite().then_some(Geodesic { point, velocity })
    }
}

/// One step, from share 0 to share 1, as polynomials `r₀ + θ(r₁ + (1−θ)(r₂ + θ(r₃ + (1−θ) r₄)))` for the coordinates and
/// for the velocities: the nested form of Hairer, Nørsett and Wanner (Solving Ordinary Differential Equations I, II.6).
/// Its first four coefficients alone are Hermite's cubic, its first two a chord.
#[derive(Clone, Copy, Debug)]
pub struct Dense<T> {
    /// Length of the step, of either sign.
    pub h: T,
    /// Coefficients of the coordinates.
    pub c: [Real3<T>; 5],
    /// Coefficients of the velocities.
    pub v: [Real3<T>; 5],
}

impl<T: Real> Dense<T> {
    /// Straight from `start` with the derivatives `(v, a)`.
    pub fn straight(start: State<T>, a: Real3<T>, h: T) -> Self {
        let zero = Real3::zero();
        Self { h, c: [start.c, start.v * h, zero, zero, zero], v: [start.v, a * h, zero, zero, zero] }
    }

    /// Hermite's cubics between two states with accelerations `a0`, `a1`.
    pub fn hermite(start: State<T>, a0: Real3<T>, end: State<T>, a1: Real3<T>, h: T) -> Self {
        let cubic = |from: Real3<T>, rate0: Real3<T>, to: Real3<T>, rate1: Real3<T>| {
            let way = to - from;
            let second = rate0 * h - way;
            [from, way, second, way - rate1 * h - second, Real3::zero()]
        };
        Self { h, c: cubic(start.c, start.v, end.c, end.v), v: cubic(start.v, a0, end.v, a1) }
    }

    /// The coordinates at share `theta` of the step.
    pub fn point(&self, theta: T) -> Real3<T> {
        nested(&self.c, theta)
    }

    /// The state at share `theta` of the step.
    pub fn at(&self, theta: T) -> State<T> {
        State { c: self.point(theta), v: nested(&self.v, theta) }
    }

    /// The state at the step's end.
    pub fn end(&self) -> State<T> {
        State { c: self.c[0] + self.c[1], v: self.v[0] + self.v[1] }
    }
}

fn nested<T: Real>(r: &[Real3<T>; 5], theta: T) -> Real3<T> {
    let rest = T::from_f64(1.0) - theta;
    r[0] + (r[1] + (r[2] + (r[3] + r[4] * rest) * theta) * rest) * theta
}

/// The right-hand side: accelerations of the chart.
pub trait Field<T>: Fn(Real3<T>, Real3<T>) -> Real3<T> {}

impl<T, F: Fn(Real3<T>, Real3<T>) -> Real3<T>> Field<T> for F {}

/// How steps are chosen and made.
pub trait Stepper: Copy {
    /// Power of the step by which the error at a given length falls.
    const ORDER: u32;

    /// Evaluations of the field in one step.
    const EVALUATIONS: u32;

    /// One step of length `h`, whatever it costs in accuracy.
    fn step<T: Real>(&self, field: &impl Field<T>, start: State<T>, h: T) -> Dense<T>;

    /// A step of at most `limit` (either sign) that the method accepts, where `proposal` is what the last one proposed (0
    /// at the start), and the proposal for the next. `None`: there is no such step.
    fn advance<T: Real>(&self, field: &impl Field<T>, start: State<T>, proposal: T, limit: T) -> Option<(Dense<T>, T)>;
}

/// A way to follow geodesics, with its parameter.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Method {
    /// The geometry's own flow.
    #[default]
    Exact,
    /// The book's: straight steps of one length.
    Euler {
        /// Length of a step.
        step: f64,
    },
    /// Runge and Kutta's method of order 4 with steps of one length.
    Rk4 {
        /// Length of a step.
        step: f64,
    },
    /// Dormand and Prince's method of order 5 with steps as long as a tolerance allows.
    Dopri5 {
        /// Largest error of a step, in units of 1 plus the size of what is in error.
        tolerance: f64,
    },
}

impl Method {
    /// Name on the command line.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Exact => "exact",
            Self::Euler { .. } => "euler",
            Self::Rk4 { .. } => "rk4",
            Self::Dopri5 { .. } => "dopri5",
        }
    }

    /// Step or tolerance; 0 for the exact flow.
    pub fn parameter(&self) -> f64 {
        match *self {
            Self::Exact => 0.0,
            Self::Euler { step } | Self::Rk4 { step } => step,
            Self::Dopri5 { tolerance } => tolerance,
        }
    }
}

/// Where a geodesic came to, and what that took.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arrival {
    /// Point, and a velocity that is as long as integration has left it.
    pub end: Geodesic,
    /// Steps made.
    pub steps: u64,
}

/// Why a geodesic cannot be followed to its end.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Stop {
    /// The states left the numbers or the chart, or steps no longer move them.
    #[error("integration ends after length {0}, where the chart ends or a step is lost in rounding")]
    Chart(f64),
    /// The length takes more steps than [`MAX_STEPS`].
    #[error("the length takes more than {MAX_STEPS} steps")]
    Steps,
}

/// Most steps of one geodesic.
pub const MAX_STEPS: u64 = 10_000_000;

/// Follows a geodesic for length `t`, of either sign, by a method, in the precision `T`.
///
/// # Errors
/// [`Stop`]. An exact geodesic that leaves the chart or the numbers is not finite instead.
pub fn follow<T: Elementary, G: Geometry>(geometry: G, method: Method, g: Geodesic, t: f64) -> Result<Arrival, Stop> {
    let arrival = match method {
        Method::Exact => return Ok(Exact.follow::<T, _>(geometry, g, t)),
        Method::Euler { step } => march::<T, _, _>(geometry, Euler { step }, g, t),
        Method::Rk4 { step } => march::<T, _, _>(geometry, Rk4 { step }, g, t),
        Method::Dopri5 { tolerance } => march::<T, _, _>(geometry, Dopri5 { tolerance }, g, t),
    }?;
    if resolves(geometry, arrival.end.point, T::EPSILON, method) { Ok(arrival) } else { Err(Stop::Chart(t)) }
}

/// Follows a geodesic for length `t`, of either sign, by steps, in numbers that need no elementary functions.
///
/// # Errors
/// [`Stop`].
pub fn march<T: Real, G: Geometry, S: Stepper>(geometry: G, stepper: S, g: Geodesic, t: f64) -> Result<Arrival, Stop> {
    let field = |c, v| geometry.spray::<T>(c, v);
    let zero = T::from_f64(0.0);
    let (mut state, mut rest, mut proposal, mut steps) = (State::<T>::of(geometry, g), T::from_f64(t), zero, 0);
    while rest != zero {
        let stopped = Stop::Chart(t - rest.to_f64());
        if steps == MAX_STEPS {
            return Err(Stop::Steps);
        }
        let (dense, next) = stepper.advance(&field, state, proposal, rest).ok_or(stopped)?;
        // A step that is lost in rounding would be made for ever.
        let (left, before) = (rest - dense.h, state);
        state = dense.end();
        if left == rest
            || (state == before && left != zero)
            || !state.is_finite()
            || geometry.unchart(state.c.to_f64()).is_none()
        {
            return Err(stopped);
        }
        (rest, proposal, steps) = (left, next, steps + 1);
    }
    let end = state.geodesic(geometry).ok_or(Stop::Chart(t))?;
    Ok(Arrival { end, steps })
}

/// As many roundings are never a whole unit of length where an integrated geodesic ends.
const ROUNDINGS: f64 = 100.0;

/// Whether the chart tells points apart at `point`, in a precision with the relative rounding `epsilon` and to the method's
/// own tolerance: next to the edge of a bounded chart its last digits are whole lengths, and steps there lead nowhere.
pub fn resolves<G: Geometry>(geometry: G, point: DVec4, epsilon: f64, method: Method) -> bool {
    let tolerance = if let Method::Dopri5 { tolerance } = method { tolerance } else { 0.0 };
    let grain = geometry.chart(point).abs() * (ROUNDINGS * epsilon) + tolerance;
    DVec3::AXES.iter().all(|axis| geometry.norm(point, geometry.unchart_vector(point, *axis * grain)) <= 1.0)
}
