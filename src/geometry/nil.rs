//! Nil, the Heisenberg group with a left-invariant metric. Twin: `shaders/geometry/nil.glsl`.
//!
//! Points are `(x, y, z, 1)` with the product (x,y,z)(x',y',z') = (x+x', y+y', z+z'+xy'); the metric is
//! dx² + dy² + (dz − x dy)². Tangent vectors are components `(u, v, w, 0)` in the left-invariant orthonormal frame
//! ∂x, ∂y + x∂z, ∂z, which left multiplications leave as they are. Chart: `(x, y, z)`.
//!
//! The symmetric coordinate z_sym = z − xy/2 makes the turns about the fibre (the z axis) linear. A geodesic from
//! the origin with frame velocity (u, v, w), c² = u² + v², turns its horizontal part at the rate w. With h = wt/2 and
//! S = sin h/h it reaches, in the plane, the point at distance ctS in the direction that (u, v) has turned to by h,
//! and z_sym = 2h (1 + c²t² g(2h)/2), g(θ) = (θ − sin θ)/θ³. Nothing is divided by w; g has a series below θ = 1.
//! Other starts follow by left multiplication. The curve parameter is arc length.
//!
//! Isometries are left multiplications after elements of O(2), which turn or mirror the plane and carry the
//! determinant to the fibre. They are affine in (x, y, z) but for the terms that turn z_sym back to z; those follow
//! from the plane's part of the matrix, so that [`Isometry::linear`] holds every isometry.

use super::curved::longest_arc;
use super::passage::{Motion, first_passage};
use super::{ALONG_FACE, Elementary, Geodesic, Geometry, Isometry, ON_FACE, Quadric, Real, Real2, Real3, RealGeodesic};
use glam::{DMat2, DMat4, DVec2, DVec3, DVec4, Vec4Swizzles};
use std::f64::consts::{FRAC_PI_2, PI};

/// Nil with dx² + dy² + (dz − x dy)².
#[derive(Clone, Copy, Debug)]
pub struct Nil;

/// Iterations after which the root of a monotone function, bracketed, is found to the last digit.
const MAX_ITERATIONS: usize = 100;

impl Geometry for Nil {
    fn components(&self) -> usize {
        3
    }

    fn base(&self) -> DVec4 {
        DVec4::W
    }

    fn settle(&self, components: DVec4) -> Option<DVec4> {
        Some(components.xyz().extend(1.0))
    }

    fn settle_tangent(&self, _p: DVec4, components: DVec4) -> DVec4 {
        components.xyz().extend(0.0)
    }

    fn inner(&self, _p: DVec4, u: DVec4, v: DVec4) -> f64 {
        u.xyz().dot(v.xyz())
    }

    fn norm(&self, _p: DVec4, v: DVec4) -> f64 {
        v.xyz().length()
    }

    fn frame(&self, _p: DVec4) -> [DVec4; 3] {
        [DVec4::X, DVec4::Y, DVec4::Z]
    }

    fn flow_in<T: Elementary>(&self, g: RealGeodesic<T>, t: T) -> RealGeodesic<T> {
        let [zero, half, one] = [0.0, 0.5, 1.0].map(T::from_f64);
        let (horizontal, w) = (g.velocity.xy(), g.velocity.z);
        let theta = w * t;
        let way = Real2::from_angle(half * theta).rotate(horizontal) * (t * sine_ratio(half * theta));
        let symmetric = theta * (one + half * horizontal.dot(horizontal) * t * t * fall(theta));
        let step = way.extend(symmetric + half * way.x * way.y);
        let velocity = Real2::from_angle(theta).rotate(horizontal).extend(w);
        RealGeodesic { point: product(g.point.xyz(), step).extend(one), velocity: velocity.extend(zero) }
    }

    /// From the displacement p⁻¹q, (ρ, z_sym) in cylinder coordinates, z_sym ≥ 0: the shortest geodesic has
    /// 0 ≤ h ≤ π, and there z_sym = F(h) = 2h + ρ² (2h − sin 2h)/(8 sin² h) grows from 0 to infinity. F is convex,
    /// with a double pole at π where ρ > 0; F^(−1/2) is almost straight there, so Newton's method runs on it, inside
    /// a bracket. At ρ = 0 the fibre itself is shortest up to 2π, then h = π: geodesics in all directions.
    fn log(&self, p: DVec4, q: DVec4) -> (DVec4, f64) {
        let step = displacement(p, q);
        let (plane, symmetric) = (step.truncate(), step.z - 0.5 * step.x * step.y);
        let (h, horizontal) = shortest(plane.length(), symmetric.abs());
        let length = (2.0 * h).hypot(horizontal);
        if length == 0.0 {
            return (DVec4::X, 0.0);
        }
        let sign = 1.0_f64.copysign(symmetric);
        let away = plane.try_normalize().unwrap_or(DVec2::X);
        let start = DVec2::from_angle(-sign * h).rotate(away) * horizontal;
        (start.extend(sign * 2.0 * h).extend(0.0) / length, length)
    }

    fn closeness(&self, _p: DVec4, _q: DVec4) -> f64 {
        // Distances are roots of a transcendental equation.
        f64::INFINITY
    }

    /// The connection of the left-invariant frame turns a parallel vector W with the angular velocity
    /// (−u, −v, w)/2. Seen from the frame that turns with the velocity, at the rate w about the fibre, this is the
    /// constant −V/2: a turn about the start's velocity by −t/2, then one about the fibre by wt.
    fn transport(&self, g: Geodesic, t: f64, w: DVec4) -> DVec4 {
        let (axis, vector) = (g.velocity.xyz(), w.xyz());
        let (sin, cos) = (0.5 * t).sin_cos();
        let along = axis * axis.dot(vector);
        let turned = along + (vector - along) * cos - axis.cross(vector) * sin;
        let plane = DVec2::from_angle(g.velocity.z * t).rotate(turned.truncate());
        plane.extend(turned.z).extend(0.0)
    }

    /// The exponential map in cylinder coordinates is (t, φ) ↦ (ρ, z_sym), with c = sin φ, w = cos φ, and the angle
    /// in the plane follows that of the start. The volume is ρ dρ dβ dz_sym, so that the ratio is
    /// ρ |∂(ρ, z_sym)/∂(t, φ)|/c, which comes to t² S (S (1 + c²t²S²/4) − c²t² g(2h) cos h).
    fn area_density(&self, g: Geodesic, t: f64) -> f64 {
        let h = 0.5 * g.velocity.z * t;
        let (s, way) = (sine_ratio(h), g.velocity.xy().length_squared() * t * t);
        (t * t * s * (s * (1.0 + 0.25 * way * s * s) - way * fall(2.0 * h) * h.cos())).abs()
    }

    fn length(&self, _g: Geodesic, u: f64) -> f64 {
        u
    }

    fn parameter_at(&self, _g: Geodesic, t: f64) -> f64 {
        t
    }

    fn advance(&self, g: Geodesic, u: f64) -> Geodesic {
        self.flow(g, u)
    }

    fn side(&self, p: DVec4, plane: DVec4) -> f64 {
        plane.dot(p)
    }

    fn exit(&self, g: Geodesic, plane: DVec4, reach: f64) -> f64 {
        if plane.z == 0.0 { exit_upright(g, plane) } else { exit_slanted(*self, g, plane, reach) }
    }

    /// Left multiplications are affine, so the start may be the origin. The third derivative of the curve is −w² (u, v) in
    /// the plane, of length w²c. Along the fibre, where the metric measures dz − x dy, it is
    /// w(2u² − v²) − w²(x(τ) − x) v, measured at x: over a step of length T its first term changes at a rate of at most
    /// 3w²c², and |x(τ) − x| ≤ cT. A straight way across a deviation D is longer than D by D²/4 at most, for which the
    /// tolerance is lowered.
    fn arc(&self, g: Geodesic, u_max: f64, tolerance: f64) -> f64 {
        let (u, v, w) = (g.velocity.x, g.velocity.y, g.velocity.z.abs());
        let square = u * u + v * v;
        let (turn, lean, growth) = (w * w * square.sqrt(), w * (2.0 * u * u - v * v).abs(), 4.0 * w * w * square);
        longest_arc(u_max, tolerance / (1.0 + 0.25 * tolerance), |t| {
            let along = lean + growth * t;
            (turn * turn + along * along).sqrt()
        })
    }

    fn parameter(&self, g: Geodesic, c: DVec3) -> f64 {
        // The logarithm's part along the velocity, to third order: a correction leaves the cube of the rest.
        let mut t = 0.0;
        for _ in 0..MAX_ITERATIONS {
            let here = self.flow(g, t);
            let step = displacement(here.point, c.extend(1.0));
            let symmetric = step.with_z(step.z - 0.5 * step.x * step.y);
            let correction = symmetric.dot(here.velocity.xyz());
            t += correction;
            if correction.abs() <= 1e-15 * (1.0 + t.abs()) {
                break;
            }
        }
        t
    }

    fn restore(&self, g: Geodesic) -> Geodesic {
        Geodesic { point: g.point.xyz().extend(1.0), velocity: g.velocity.xyz().normalize().extend(0.0) }
    }

    fn chart(&self, p: DVec4) -> DVec3 {
        p.xyz()
    }

    fn unchart(&self, c: DVec3) -> Option<DVec4> {
        Some(c.extend(1.0))
    }

    fn chart_vector(&self, p: DVec4, v: DVec4) -> DVec3 {
        DVec3::new(v.x, v.y, v.z + p.x * v.y)
    }

    fn unchart_vector(&self, p: DVec4, dc: DVec3) -> DVec4 {
        DVec4::new(dc.x, dc.y, dc.z - p.x * dc.y, 0.0)
    }

    /// `w = z′ − xy′` is constant and turns `(x′, y′)`.
    fn spray<T: Real>(&self, c: Real3<T>, v: Real3<T>) -> Real3<T> {
        let w = v.z - c.x * v.y;
        Real3::new(-(w * v.y), w * v.x, v.x * v.y + c.x * w * v.x)
    }

    fn raise(&self, p: DVec4, conormal: DVec3) -> DVec4 {
        let on_frame = DVec3::new(conormal.x, conormal.y + p.x * conormal.z, conormal.z);
        on_frame.normalize().extend(0.0)
    }

    fn lower(&self, p: DVec4, v: DVec4) -> DVec3 {
        DVec3::new(v.x, v.y - p.x * v.z, v.z)
    }

    fn volume_density(&self, _c: DVec3) -> f64 {
        1.0
    }

    #[inline]
    fn apply(&self, m: &Isometry, g: Geodesic) -> Geodesic {
        let (turn, p) = (turn(m), g.point.xy());
        let mut point = m.linear * g.point;
        let (a, b) = (turn.x_axis, turn.y_axis);
        point.z += 0.5 * (a.x * a.y * p.x * p.x + b.x * b.y * p.y * p.y) + a.y * b.x * p.x * p.y;
        Geodesic { point, velocity: (turn * g.velocity.xy()).extend(m.linear.z_axis.z * g.velocity.z).extend(0.0) }
    }

    fn compose(&self, a: &Isometry, b: &Isometry) -> Isometry {
        let centre = Geodesic { point: b.linear.w_axis, velocity: DVec4::ZERO };
        isometry(turn(a) * turn(b), self.apply(a, centre).point.xyz())
    }

    fn inverse(&self, m: &Isometry) -> Isometry {
        let back = turn(m).transpose();
        let undone = displacement(m.linear.w_axis, DVec4::W).extend(1.0);
        let centre = self.apply(&isometry(back, DVec3::ZERO), Geodesic { point: undone, velocity: DVec4::ZERO });
        isometry(back, centre.point.xyz())
    }

    fn isometry_residual(&self, m: &Isometry) -> f64 {
        let turn = turn(m);
        let square = turn.transpose() * turn - DMat2::IDENTITY;
        let rest = m.linear - isometry(turn, m.linear.w_axis.xyz()).linear;
        let numbers = [rest.to_cols_array().as_slice(), &square.to_cols_array(), &m.shift.to_array()].concat();
        numbers.iter().fold(0.0, |worst: f64, x| worst.max(x.abs()))
    }

    fn bisector(&self, _q: DVec4) -> Option<DVec4> {
        None
    }

    fn ball(&self, _centre: DVec4, _radius: f64) -> Option<Quadric> {
        None
    }

    fn tube(&self, _axis: Geodesic, _radius: f64) -> Option<Quadric> {
        None
    }
}

/// Product of the group.
fn product<T: Real>(a: Real3<T>, b: Real3<T>) -> Real3<T> {
    (a + b).xy().extend(a.z + b.z + a.x * b.y)
}

/// p⁻¹q.
fn displacement(p: DVec4, q: DVec4) -> DVec3 {
    let d = (q - p).xyz();
    d.with_z(d.z - p.x * d.y)
}

/// sin(x)/x.
fn sine_ratio<T: Elementary>(x: T) -> T {
    let number = T::from_f64;
    if x.abs() < number(1e-3) {
        number(1.0) - x * x / number(6.0) * (number(1.0) - x * x / number(20.0))
    } else {
        x.sin() / x
    }
}

/// arctan(w y)/w.
fn arc_over_rate(y: f64, w: f64) -> f64 {
    let x = w * y;
    if x.abs() < 1e-3 { y * (1.0 - x * x * (1.0 / 3.0 - x * x * (0.2 - x * x / 7.0))) } else { x.atan() / w }
}

/// g(θ) = (θ − sin θ)/θ³, from 1/6 at 0.
fn fall<T: Elementary>(theta: T) -> T {
    let number = T::from_f64;
    let square = theta * theta;
    if square > number(1.0) {
        return (theta - theta.sin()) / (theta * square);
    }
    // The ninth term is below the rounding of the first.
    let (mut term, mut sum) = (number(1.0 / 6.0), number(0.0));
    for k in 0..9 {
        sum = sum + term;
        let n = f64::from(2 * k + 4);
        term = term * (-square / number(n * (n + 1.0)));
    }
    sum
}

/// The part of an isometry in the plane: an orthogonal matrix.
fn turn(m: &Isometry) -> DMat2 {
    DMat2::from_cols(m.linear.x_axis.xy(), m.linear.y_axis.xy())
}

/// The isometry that turns by `turn` about the fibre of the origin and then takes the origin to `centre`.
fn isometry(turn: DMat2, centre: DVec3) -> Isometry {
    let column = |v: DVec2| DVec4::new(v.x, v.y, centre.x * v.y, 0.0);
    let fibre = DVec4::Z * turn.determinant();
    Isometry::linear(DMat4::from_cols(column(turn.x_axis), column(turn.y_axis), fibre, centre.extend(1.0)))
}

/// h and ct of the shortest geodesic from the origin to (ρ, z_sym), z_sym ≥ 0; see [`Nil::log`](Geometry::log).
fn shortest(rho: f64, symmetric: f64) -> (f64, f64) {
    let square = rho * rho;
    // F and F' without their factor 1/S²: μ(h) = (2h − sin 2h)/(8 sin² h) = h g(2h)/S².
    let fibre = |h: f64| {
        let s = sine_ratio(h);
        let share = fall(2.0 * h) / (s * s);
        (2.0 * h + square * h * share, 2.0 + square * (0.5 - 2.0 * share * h.cos() / s))
    };
    // Convexity: F(h) ≥ h F'(0).
    let (mut low, mut high) = (0.0, (symmetric / (2.0 + square / 6.0)).min(PI));
    let mut h = high;
    for _ in 0..MAX_ITERATIONS {
        let (value, slope) = fibre(h);
        if value > symmetric {
            high = h
        } else {
            low = h
        }
        // Newton's method on F^(−1/2).
        let newton = h + 2.0 * value * (1.0 - (value / symmetric).sqrt()) / slope;
        let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
        if value == symmetric || (next - h).abs() <= 1e-16 * h || next == low || next == high {
            break;
        }
        h = next;
    }
    // ct from ρ where it is well conditioned, from z_sym near h = π.
    let horizontal =
        if h < FRAC_PI_2 { rho / sine_ratio(h) } else { ((symmetric - 2.0 * h).max(0.0) / fall(2.0 * h) / h).sqrt() };
    (h, horizontal)
}

/// Exit through a plane that contains the fibres. With u = tan(wt/2)/w, the plane's form f(t) times 1 + w²u² is
/// f(0) + 2 f'(0) u + w (w f(0) + 2 r) u², r the rate if the velocity were turned by a right angle; as t grows over
/// a turn, u goes from 0 to infinity and from minus infinity to 0.
fn exit_upright(g: Geodesic, plane: DVec4) -> f64 {
    let (u, v, w) = (g.velocity.x, g.velocity.y, g.velocity.z);
    let size = plane.dot(g.point);
    let (rate, turned) = (plane.x * u + plane.y * v, plane.y * u - plane.x * v);
    let bend = w * size + 2.0 * turned;
    let discriminant = rate * rate - w * bend * size;
    if discriminant < 0.0 || (rate <= ALONG_FACE && (size > ON_FACE || (size > -ON_FACE && rate > -ALONG_FACE))) {
        return f64::INFINITY;
    }
    let root = discriminant.sqrt();
    if rate > ALONG_FACE {
        return (2.0 * arc_over_rate(-size / (rate + root), w)).max(0.0);
    }
    // u = (root − rate)/(w bend) by its angle, which needs neither quotient nor cases.
    let rise = root - rate;
    if rise > 0.0 { 2.0 * rise.atan2(bend * w.signum()) / w.abs() } else { f64::INFINITY }
}

/// Exit through a plane that cuts the fibres. Its form along the curve is a constant, plus a drift
/// C (w + c²/(2w)) t, plus terms in the sines of θ and 2θ (θ the direction of the velocity) with amplitudes
/// (c/w) |(A, B + C x₀)| and C c²/(4w²), x₀ the centre of the circle that the plane shows.
fn exit_slanted(geometry: Nil, g: Geodesic, plane: DVec4, reach: f64) -> f64 {
    let w = g.velocity.z;
    let square = g.velocity.xy().length_squared();
    let c = square.sqrt();
    let centre = g.point.x - g.velocity.y / w;
    let amplitude = c / w.abs() * plane.x.hypot(plane.y + plane.z * centre) + 0.25 * plane.z.abs() * square / (w * w);
    let recedes = plane.z * w <= 0.0;
    first_passage(|t| {
        let Geodesic { point, velocity } = geometry.advance(g, t);
        let value = plane.dot(point);
        if t > reach || (recedes && value < -2.0 * amplitude) {
            return None;
        }
        let slope = plane.y + plane.z * point.x;
        let rate = plane.x * velocity.x + slope * velocity.y + plane.z * velocity.z;
        // f'' = w (slope u − A v) + C u v + C (change of x) w u, and x changes by 2c/|w| at most.
        let bend = w.abs() * c * plane.x.hypot(slope) + 2.5 * plane.z.abs() * square;
        Some(Motion { value, rate, bend, reach: f64::INFINITY })
    })
}
