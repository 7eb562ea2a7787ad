//! The universal cover of SL(2, R) with its left-invariant metric. Twin: `shaders/geometry/sl2.glsl`.
//!
//! It is the universal cover of the unit tangent bundle of the hyperbolic plane with Sasaki's metric. A point is
//! `(x, y, θ, w)` with `x² + y² − w² = −1`, `w > 0`: the group element `P R(θ)`, where `P` is symmetric positive with
//! `P² = [[w+x, y], [y, w−x]]` and `R(θ) = exp(θ X₃)`. The fibre angle θ is any real number: one turn of the fibre is
//! 2π. `X₁ = ½[[1,0],[0,−1]]`, `X₂ = ½[[0,1],[1,0]]`, `X₃ = ½[[0,−1],[1,0]]` are orthonormal at the identity, and a
//! tangent vector is `(a, b, c, 0)` in the frame that left multiplications make of them.
//!
//! Flow from the identity: `g(t) = exp(t(aX₁ + bX₂ − cX₃)) R(2ct)`. With `κ² = a² + b² − c²` the first factor is
//! `C + S·½[[a, b+c], [b−c, −a]]`, where `C` and `S` are the entire functions `cosh(κt/2)` and `sinh(κt/2)/(κ/2)` of
//! κ², so the three regimes are one formula. From another point the fibre angle gains `2ct` and twice the angle of
//! `(T, D)`, `T = (1+w)C + (xa+yb)S/2`, `D = (ya − xb − (1+w)c)S/2`; for κ² < 0 that pair runs round an ellipse, half
//! a turn for each zero of S, which are counted.
//!
//! The chart is `(x/w, y/w, θ)`, Klein's disk and the fibre angle; the curve parameter is arc length.
//!
//! Isometries are left multiplications, and those after the mirror image `(x, y, θ) ↦ (x, −y, −θ)` (conjugation with
//! diag(1, −1)), which takes the frame to `(a, −b, −c)`; the entry of [`Isometry::linear`] for θ is 1 or −1 accordingly.
//! Reflections of the base in vertical planes are among them.

use super::{
    ALONG_FACE, Elementary, Geodesic, Geometry, Isometry, ON_FACE, Quadric, Real, Real2, Real3, Real4, RealGeodesic,
    curved::{
        before_passage, cosh_sinhc, first_passage, first_zero, integrals, longest_arc, nearest_parameter, shoot,
        wave_area,
    },
    spatial,
};
use glam::{DMat3, DMat4, DVec2, DVec3, DVec4, Vec3Swizzles, Vec4Swizzles};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// The universal cover of SL(2, R).
#[derive(Clone, Copy, Debug)]
pub struct Sl2;

/// Longest arc, and how far ahead [`Geometry::exit`] looks for planes that are not vertical: a walk takes at most
/// one arc at a time, so it meets every passage.
const HORIZON: f64 = 16.0;

/// Directions along a wall: [`ALONG_FACE`] times the entries that pairings of the octagon for genus 2 have at its corners.
const ALONG_WALL: f64 = 32.0 * ALONG_FACE;

/// The point with base point `(x, y)` in the hyperboloid and fibre angle `angle`.
pub fn element(x: f64, y: f64, angle: f64) -> DVec4 {
    DVec4::new(x, y, angle, x.hypot(y).hypot(1.0))
}

/// Left multiplication by a group element. The matrix acts on the base point `(x, y, w)`; the shift of the fibre
/// angle stands apart, because the matrix knows it only up to turns.
pub fn translation(by: DVec4) -> Isometry {
    let (turned, x, w) = (turn(by.z), by.xy(), by.w);
    let column = |image: DVec2| {
        let along = x.dot(image);
        let moved = image + x * (along / (1.0 + w));
        DVec4::new(moved.x, moved.y, 0.0, along)
    };
    let linear = DMat4::from_cols(column(turned), column(turned.perp()), DVec4::Z, x.extend(0.0).extend(w));
    Isometry { linear, shift: DVec4::Z * by.z }
}

/// The unit vector at an angle, to rotate by.
fn turn(angle: f64) -> DVec2 {
    DVec2::from_angle(angle)
}

/// A vector of the frame with its horizontal part turned.
fn turned(by: DVec2, v: DVec3) -> DVec3 {
    by.rotate(v.xy()).extend(v.z)
}

/// The base point `h = (x, y, w)` moved as `P` moves the origin to the base of `p`; `h = (0, 0, 1) + rest`, of which
/// only the rest is given and returned, relative to the image of the origin.
fn boost(p: DVec4, rest: DVec3) -> DVec3 {
    boost_in::<f64>(Real4::from_f64(p), Real3::from_f64(rest)).to_f64()
}

/// The same in any precision.
fn boost_in<T: Real>(p: Real4<T>, rest: Real3<T>) -> Real3<T> {
    let along = p.xy().dot(rest.xy());
    let moved = rest.xy() + p.xy() * (rest.z + along / (T::from_f64(1.0) + p.w));
    moved.extend(along + p.w * rest.z)
}

/// The angle δ in `P₁ P₂ = P₃ R(δ)` for base points `p` and `q`, from `p × (q − p)` for the sake of close points.
fn holonomy(p: DVec4, step: DVec2, q: DVec4) -> f64 {
    2.0 * p.xy().perp_dot(step).atan2((1.0 + p.w) * (1.0 + q.w) - p.xy().dot(q.xy()))
}

/// The group element `p⁻¹q`: base point and fibre angle in `z`.
fn relative(p: DVec4, q: DVec4) -> DVec3 {
    let step = q - p;
    let along = p.xy().dot(step.xy());
    let base = step.xy() - p.xy() * (step.w - along / (1.0 + p.w));
    turn(-p.z).rotate(base).extend(step.z + holonomy(p, step.xy(), q))
}

/// The differential of the exponential map at `t v`, in the frames of both ends: `t⁻¹ ∫ Ad(exp(−sN)) ds` of the
/// first factor's variation, turned by the second factor, with `N = (a, b, −c)`.
fn differential(v: DVec3, t: f64) -> DMat3 {
    let mirror = DVec3::new(1.0, 1.0, -1.0);
    let n = v * mirror;
    let (second, third) = integrals((v.x * v.x + v.y * v.y - v.z * v.z) * t * t);
    let back = turn(-2.0 * v.z * t);
    let column = |axis: DVec3| {
        let variation = axis * mirror;
        // [X₁, X₂] = −X₃, [X₂, X₃] = X₁, [X₃, X₁] = X₂.
        let bracket = |x: DVec3| n.cross(x) * mirror;
        let once = bracket(variation) * t;
        let image = variation - once * second + bracket(once) * (t * third);
        turned(back, image) + DVec3::Z * (2.0 * axis.z)
    };
    DMat3::from_cols(column(DVec3::X), column(DVec3::Y), column(DVec3::Z))
}

/// The fibre angle and its unknowns for `logarithm`: with half of the base distance `h`, and the hyperbolic
/// (`y < 0`) or elliptic (`y > 0`) angle `|y|` that the first factor turns by, the horizontal and vertical
/// components and the half-angle of the first factor's rotation.
fn regime(sinh_half: f64, y: f64) -> [f64; 3] {
    let (cosh, sinhc) = cosh_sinhc(-y * y.abs());
    let sine = y * sinhc;
    let horizontal = 2.0 * sinh_half / sinhc;
    let vertical = 2.0 * (sinh_half * sinh_half + sine * sine.abs()).max(0.0).sqrt() / sinhc;
    [horizontal, vertical, (0.5 * vertical * sinhc).atan2(cosh)]
}

/// Velocity at the identity whose geodesic has passed the element with base point `(x, y)` and fibre angle `z` after
/// unit time.
///
/// By the rotations about the fibre and the mirror images that reverse it one equation is left: the fibre angle
/// grows from 0 to infinity as the angle `y` of the first factor goes from minus half of the base distance to π,
/// where a geodesic meets its first conjugate point. Newton's method on the whole map polishes the result.
fn logarithm(target: DVec3) -> DVec3 {
    let radius = target.xy().length();
    let sinh_half = radius / (2.0 * (1.0 + radius.hypot(1.0))).sqrt();
    let angle = target.z.abs();
    let (mut low, mut high) = (-sinh_half.asinh(), PI);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        let [_, vertical, half] = regime(sinh_half, middle);
        if 2.0 * (vertical - half) < angle {
            low = middle;
        } else {
            high = middle;
        }
    }
    let y = 0.5 * (low + high);
    let [mut horizontal, mut vertical, half] = regime(sinh_half, y);
    if y > FRAC_PI_2 {
        // Next to the conjugate point the fibre angle says more than the base distance.
        vertical = 0.5 * angle + half;
        horizontal = (vertical * vertical - 4.0 * y * y).max(0.0).sqrt();
    }
    let (vertical, half) = if target.z < 0.0 { (-vertical, -half) } else { (vertical, half) };
    let towards = if radius > 0.0 { target.xy() / radius } else { DVec2::X };
    let guess = (turn(half).rotate(towards) * horizontal).extend(vertical);
    shoot(guess, |v| {
        let end = Sl2.flow(Geodesic { point: DVec4::W, velocity: v.extend(0.0) }, 1.0).point;
        let target = element(target.x, target.y, target.z);
        (relative(end, target), differential(v, 1.0))
    })
}

/// The differential of the chart at `p`: columns are the images of the frame.
fn chart_differential(p: DVec4) -> DMat3 {
    let (turn, x, k) = (turn(p.z), p.xy(), p.xy() / p.w);
    let horizontal = |v: DVec2| {
        let along = x.dot(v);
        let moved = v + x * (along / (1.0 + p.w));
        ((moved - k * along) / p.w).extend(v.perp_dot(x) / (1.0 + p.w))
    };
    DMat3::from_cols(horizontal(turn), horizontal(turn.perp()), DVec3::Z)
}

/// The third derivative in the chart of the geodesic from `p` whose horizontal velocity, turned by the fibre angle, is
/// `v` and whose vertical one is `c`.
///
/// The base point h = (X, w) satisfies h‴ = κ² h′ with κ² = |v|² − c², because g gᵀ runs through span{1, cosh κt, sinh κt}.
/// The chart's ξ = X/w and θ, θ′ = c + (X′ × X)/(1 + w), follow by the rules for quotients and products.
fn third_derivative(p: DVec4, v: DVec2, c: f64) -> DVec3 {
    let (x, w) = (p.xy(), p.w);
    let first = boost(p, v.extend(0.0));
    let second = boost(p, (v.perp() * -c).extend(v.length_squared()));
    let third = first * (v.length_squared() - c * c);
    let xi = x / w;
    let xi_1 = (first.xy() - xi * first.z) / w;
    let xi_2 = (second.xy() - xi * second.z - xi_1 * (2.0 * first.z)) / w;
    let xi_3 = (third.xy() - xi * third.z - xi_2 * (3.0 * first.z) - xi_1 * (3.0 * second.z)) / w;
    let area = first.xy().perp_dot(x);
    let area_1 = second.xy().perp_dot(x);
    let area_2 = third.xy().perp_dot(x) + second.xy().perp_dot(first.xy());
    let share = (1.0 + w).recip();
    let share_1 = -first.z * share * share;
    let share_2 = share * share * (2.0 * first.z * first.z * share - second.z);
    xi_3.extend(area_2 * share + 2.0 * area_1 * share_1 + area * share_2)
}

/// Metric length of a vector of the chart at `p`.
fn frame_length(p: DVec4, dc: DVec3) -> f64 {
    let xi = p.xy() / p.w;
    let rise = p.w.powi(3) * xi.dot(dc.xy());
    let step = dc.xy() * p.w + xi * rise;
    let horizontal = step - p.xy() * (rise - p.xy().dot(step) / (1.0 + p.w));
    horizontal.length().hypot(dc.z - horizontal.perp_dot(p.xy()) / (1.0 + p.w))
}

/// A folded pairing that moves the base point no farther than this fixes it: faces of Dirichlet domains have such.
const CENTRED: f64 = 1e-9;

/// Whether a plane contains the fibres over a line of the base.
fn is_wall(plane: DVec4) -> bool {
    plane.z == 0.0 && plane.xy().length_squared() > plane.w * plane.w
}

/// The reflection in such a plane: of the base in the line. It turns the fibre round.
fn mirror(plane: DVec4) -> Isometry {
    let normal = DVec4::new(plane.x, plane.y, 0.0, -plane.w);
    let size = plane.xy().length_squared() - plane.w * plane.w;
    let reflect = |v: DVec4| v - normal * (2.0 / size * (plane.xy().dot(v.xy()) + plane.w * v.w));
    let linear = DMat4::from_cols(reflect(DVec4::X), reflect(DVec4::Y), -DVec4::Z, reflect(DVec4::W));
    // At the origin the line across n: a turn by this angle after the mirror image.
    Isometry { linear, shift: DVec4::Z * (2.0 * plane.y.atan2(plane.x) + PI) }
}

/// The image of a state on such a plane under its reflection: the base is hardly moved.
fn reflected(plane: DVec4, g: Geodesic) -> Geodesic {
    let (p, n) = (g.point, plane.xy());
    let size = n.length_squared() - plane.w * plane.w;
    let step = 2.0 / size * (n.dot(p.xy()) + plane.w * p.w);
    // Where the origin goes, and the base reflected at the origin.
    let (left, left_w) = (n * (-2.0 / size * plane.w), 1.0 + 2.0 / size * plane.w * plane.w);
    let right = p.xy() - n * (2.0 * n.dot(p.xy()) / n.length_squared());
    let angle = 2.0 * right.perp_dot(left).atan2((1.0 + left_w) * (1.0 + p.w) + left.dot(right));
    let fibre = 2.0 * plane.y.atan2(plane.x) + PI - p.z + angle;
    let base = p.xy() - n * step;
    let v = g.velocity;
    Geodesic {
        point: DVec4::new(base.x, base.y, fibre, p.w + plane.w * step),
        velocity: DVec4::new(v.x, -v.y, -v.z, 0.0),
    }
}

impl Geometry for Sl2 {
    fn components(&self) -> usize {
        4
    }

    fn direction_components(&self) -> usize {
        3
    }

    fn base(&self) -> DVec4 {
        DVec4::W
    }

    fn settle(&self, components: DVec4) -> Option<DVec4> {
        Some(element(components.x, components.y, components.z))
    }

    fn settle_tangent(&self, _p: DVec4, components: DVec4) -> DVec4 {
        components.xyz().extend(0.0)
    }

    fn inner(&self, _p: DVec4, u: DVec4, v: DVec4) -> f64 {
        spatial(u).dot(spatial(v))
    }

    fn norm(&self, _p: DVec4, v: DVec4) -> f64 {
        spatial(v).length()
    }

    fn frame(&self, _p: DVec4) -> [DVec4; 3] {
        [DVec4::X, DVec4::Y, DVec4::Z]
    }

    fn flow_in<T: Elementary>(&self, g: RealGeodesic<T>, t: T) -> RealGeodesic<T> {
        let number = T::from_f64;
        let [zero, half, two, pi] = [0.0, 0.5, 2.0, PI].map(number);
        let (p, c) = (g.point, g.velocity.z);
        let v = Real2::from_angle(p.z).rotate(g.velocity.xy());
        let radius = v.length();
        let square = (radius - c.abs()) * (radius + c.abs());
        // Half-turns of the first factor are taken out, so that the rest has C ≥ 0.
        let angle = half * t * square.min(zero).abs().sqrt();
        let turns = (angle / pi).round();
        let (cosh, sinh) = if turns == zero {
            let (cosh, sinhc) = cosh_sinhc(number(0.25) * square * t * t);
            (cosh, t * sinhc)
        } else {
            let within = angle - turns * pi;
            (within.cos(), t * within.sin() / angle)
        };
        let horizontal = (v * cosh - v.perp() * (half * c * sinh)) * sinh;
        let far = sinh * radius;
        let base = p.xy().extend(p.w) + boost_in(p, horizontal.extend(half * far * far));
        let (x, one) = (p.xy(), number(1.0) + p.w);
        let (real, imaginary) = (one * cosh + half * x.dot(v) * sinh, half * sinh * (v.perp_dot(x) - one * c));
        let wound = two * c * t - turns * pi * two * c.signum();
        let fibre = p.z + (wound + two * imaginary.atan2(real));
        let turned = Real2::from_angle(-two * c * t).rotate(g.velocity.xy());
        RealGeodesic { point: Real4::new(base.x, base.y, fibre, base.z), velocity: turned.extend(c).extend(zero) }
    }

    fn log(&self, p: DVec4, q: DVec4) -> (DVec4, f64) {
        let v = logarithm(relative(p, q));
        let length = v.length();
        (if length > 0.0 { (v / length).extend(0.0) } else { DVec4::X }, length)
    }

    fn closeness(&self, _p: DVec4, _q: DVec4) -> f64 {
        f64::INFINITY
    }

    /// In the frame turned back by `2ct` a parallel vector turns about the constant vector `(a, b, c)/2` (Koszul's
    /// formula).
    fn transport(&self, g: Geodesic, t: f64, w: DVec4) -> DVec4 {
        let (v, w) = (spatial(g.velocity), spatial(w));
        let (sin, cos) = (0.5 * t).sin_cos();
        let spun = w * cos + v.cross(w) * sin + v * (v.dot(w) * (1.0 - cos));
        turned(turn(-2.0 * v.z * t), spun).extend(0.0)
    }

    fn area_density(&self, g: Geodesic, t: f64) -> f64 {
        let v = spatial(g.velocity);
        wave_area(differential(v, t), v, t)
    }

    fn length(&self, _g: Geodesic, u: f64) -> f64 {
        u
    }

    fn parameter_at(&self, _g: Geodesic, t: f64) -> f64 {
        // Finite, so that a walk without end goes on by arcs.
        t.min(f64::MAX)
    }

    fn advance(&self, g: Geodesic, u: f64) -> Geodesic {
        self.flow(g, u)
    }

    fn side(&self, p: DVec4, plane: DVec4) -> f64 {
        plane.x * p.x + plane.y * p.y + (plane.z * p.z + plane.w) * p.w
    }

    /// In closed form for vertical planes; for the others `HORIZON` is looked ahead at most, as far as an arc can
    /// reach.
    fn exit(&self, g: Geodesic, plane: DVec4, reach: f64) -> f64 {
        let (p, c) = (g.point, g.velocity.z);
        let v = turn(p.z).rotate(g.velocity.xy());
        if plane.z == 0.0 {
            // The form in coordinates about the base of p, times 1 − κ²τ² with τ = tanh(κt/2)/κ.
            let along = plane.xy().dot(p.xy());
            let n = plane.xy() + p.xy() * (plane.w + along / (1.0 + p.w));
            let start = along + plane.w * p.w;
            let bend = 2.0 * c * n.perp_dot(v) + start * (v.length_squared() + c * c);
            let square = (v.length() - c.abs()) * (v.length() + c.abs());
            // Rates below the rounding of n, which is long far out, are those of directions along the wall. A state that keeps to
            // its wall, as along an upright edge, does not leave through it.
            let (on_wall, rate) = (start.abs() <= ON_FACE, n.dot(v));
            let along_wall = rate.abs() <= ALONG_WALL;
            if on_wall && along_wall && bend <= ALONG_WALL {
                return f64::INFINITY;
            }
            let (start, rate) = (if on_wall { 0.0 } else { start }, if along_wall { 0.0 } else { rate });
            return first_passage(square, start, rate, bend);
        }
        let form = |g: Geodesic| {
            let rate = self.chart_vector(g.point, g.velocity);
            [plane.xyz().dot(self.chart(g.point)) + plane.w, plane.xyz().dot(rate)]
        };
        // Whether the state is on its plane is judged as the walk judges whether it is outside.
        let [_, rate] = form(g);
        let Some(threshold) = before_passage(self.side(p, plane), rate) else { return 0.0 };
        // The chart's acceleration is at most 2 in the disk (its part along the disk is r√(c² + 4r²) at most) and 1/√2 along the fibre.
        let bend = 2.0 * plane.xy().length() + 0.75 * plane.z.abs();
        let ahead = |s: f64| {
            let [value, rate] = form(self.flow(g, s));
            [value - threshold, rate]
        };
        first_zero(ahead, bend, reach.min(HORIZON)).unwrap_or(f64::INFINITY)
    }

    /// The chart's third derivative at the start has a closed form (`third_derivative`). Along the geodesic its metric
    /// length changes at a rate of at most `6.12 r²`, r the speed of the base point, and the logarithm of the metric's length
    /// of a chart vector at a rate of at most `r (0.31 + 2 tanh d)` and of `2r`, d the base point's distance from the
    /// origin (maxima over all directions and distances, found numerically); tanh d grows by at most x while the base point
    /// goes a way x. So over a step h it is at most `(j + 6.12 r² h) exp E`, wherever it is measured, E the integral of
    /// `min(0.31 + 2 (tanh d + x), 2)` from x = 0 to rh.
    fn arc(&self, g: Geodesic, u_max: f64, tolerance: f64) -> f64 {
        let (p, v) = (g.point, turn(g.point.z).rotate(g.velocity.xy()));
        let (speed, far) = (v.length(), p.xy().length() / p.w);
        // The rate of the metric's length at the start, and the way on which it rises, by 2 for each unit, to 2.
        let rate = (0.31 + 2.0 * far).min(2.0);
        let rising = 1.0 - 0.5 * rate;
        let third = frame_length(p, third_derivative(p, v, g.velocity.z));
        longest_arc(u_max.min(HORIZON), tolerance, |h| {
            let way = speed * h;
            let risen = way.min(rising);
            (third + 6.12 * speed * way) * (rate * way + risen * (2.0 * way - risen)).exp()
        })
    }

    fn parameter(&self, g: Geodesic, c: DVec3) -> f64 {
        nearest_parameter(*self, g, c, |a, b| a.dot(b))
    }

    fn restore(&self, g: Geodesic) -> Geodesic {
        Geodesic { point: element(g.point.x, g.point.y, g.point.z), velocity: g.velocity.normalize() }
    }

    fn chart(&self, p: DVec4) -> DVec3 {
        (p.xy() / p.w).extend(p.z)
    }

    fn unchart(&self, c: DVec3) -> Option<DVec4> {
        let r = c.xy().length();
        let w = ((1.0 - r) * (1.0 + r)).sqrt().recip();
        (r < 1.0).then(|| DVec4::new(c.x * w, c.y * w, c.z, w))
    }

    fn chart_vector(&self, p: DVec4, v: DVec4) -> DVec3 {
        chart_differential(p) * spatial(v)
    }

    fn unchart_vector(&self, p: DVec4, dc: DVec3) -> DVec4 {
        (chart_differential(p).inverse() * dc).extend(0.0)
    }

    /// The base point, with coordinates `x = kw` in the hyperboloid and velocity `v` in the frame that the boost to it
    /// makes of the origin's, has the acceleration `−cJv`, J a right angle; that is Klein's straight motion
    /// `−2w²(k·k′)k′` and the chart's image of `−cJv`. The fibre angle has `θ′ = c + v×x/(1+w)`, whose derivative is
    /// `(2c − θ′)(x·v)/(1+w)` because `v` turns at the rate `θ′ − 2c`.
    fn spray<T: Real>(&self, c: Real3<T>, v: Real3<T>) -> Real3<T> {
        let (one, two) = (T::from_f64(1.0), T::from_f64(2.0));
        let square = one / (one - c.x * c.x - c.y * c.y);
        let w = square.sqrt();
        let (x, y) = (c.x * w, c.y * w);
        // The velocity in the boosted frame.
        let along = (x * v.x + y * v.y) / (one + w);
        let (a, b) = (w * (v.x + x * along), w * (v.y + y * along));
        let fibre = v.z - (a * y - b * x) / (one + w);
        // The image of −c J(a, b) = c (b, −a).
        let across = (x * b - y * a) / (w * (one + w));
        let (turn_x, turn_y) = (fibre * (b - x * across) / w, fibre * (-a - y * across) / w);
        let straight = -(two * square * (c.x * v.x + c.y * v.y));
        Real3::new(straight * v.x + turn_x, straight * v.y + turn_y, (two * fibre - v.z) * (x * a + y * b) / (one + w))
    }

    fn raise(&self, p: DVec4, conormal: DVec3) -> DVec4 {
        (chart_differential(p).transpose() * conormal).normalize().extend(0.0)
    }

    fn lower(&self, p: DVec4, v: DVec4) -> DVec3 {
        chart_differential(p).inverse().transpose() * spatial(v)
    }

    fn volume_density(&self, c: DVec3) -> f64 {
        (1.0 - c.xy().length_squared()).powf(-1.5)
    }

    #[inline]
    fn apply(&self, m: &Isometry, g: Geodesic) -> Geodesic {
        let p = g.point;
        let base = m.linear * DVec4::new(p.x, p.y, 0.0, p.w);
        // The left factor's base point is where the origin goes; its fibre turns the right factor's base.
        let (left, round) = (m.linear.w_axis, m.linear.z_axis.z);
        let right = turn(m.shift.z).rotate(DVec2::new(p.x, round * p.y));
        let angle = 2.0 * right.perp_dot(left.xy()).atan2((1.0 + left.w) * (1.0 + p.w) + left.xy().dot(right));
        let v = g.velocity;
        Geodesic {
            point: DVec4::new(base.x, base.y, m.shift.z + round * p.z + angle, base.w),
            velocity: DVec4::new(v.x, round * v.y, round * v.z, 0.0),
        }
    }

    /// Through walls by the reflection in the face, as the geometries with reflections do.
    fn fold(&self, plane: DVec4, pairing: &Isometry) -> Isometry {
        if !is_wall(plane) {
            return *pairing;
        }
        let folded = self.compose(pairing, &mirror(plane));
        if folded.linear.w_axis.xy().length() > CENTRED {
            return folded;
        }
        // It fixes the base point's fibre. Its turn as a product of large matrices would be 1e-13 off; the image of the face's
        // nearest point says it ten times better.
        let normal = plane.xy() / plane.xy().length();
        let tanh = -plane.w / plane.xy().length();
        let foot = normal * (tanh / ((1.0 - tanh) * (1.0 + tanh)).sqrt());
        let image = self.apply(pairing, Geodesic { point: element(foot.x, foot.y, 0.0), velocity: DVec4::ZERO }).point;
        let turned = image.y.atan2(image.x) + normal.y.atan2(normal.x);
        let turned = turned + ((folded.shift.z - turned) / TAU).round() * TAU;
        let (sin, cos) = turned.sin_cos();
        let linear =
            DMat4::from_cols(DVec4::new(cos, sin, 0.0, 0.0), DVec4::new(sin, -cos, 0.0, 0.0), -DVec4::Z, DVec4::W);
        Isometry { linear, shift: DVec4::Z * turned }
    }

    fn cross(&self, folded: &Isometry, plane: DVec4, g: Geodesic) -> Geodesic {
        self.apply(folded, if is_wall(plane) { reflected(plane, g) } else { g })
    }

    fn compose(&self, a: &Isometry, b: &Isometry) -> Isometry {
        let origin = b.linear.w_axis.truncate().with_z(b.shift.z).extend(b.linear.w_axis.w);
        let image = self.apply(a, Geodesic { point: origin, velocity: DVec4::ZERO });
        Isometry { linear: a.linear * b.linear, shift: DVec4::Z * image.point.z }
    }

    fn inverse(&self, m: &Isometry) -> Isometry {
        Isometry { linear: FORM * m.linear.transpose() * FORM, shift: m.shift * -m.linear.z_axis.z }
    }

    fn isometry_residual(&self, m: &Isometry) -> f64 {
        let (origin, round) = (m.linear.w_axis, 1.0_f64.copysign(m.linear.z_axis.z));
        let rebuilt = translation(element(origin.x, origin.y, m.shift.z));
        let image = DMat4::from_diagonal(DVec4::new(1.0, round, round, 1.0));
        let difference = (m.linear - rebuilt.linear * image).to_cols_array();
        difference.iter().fold((m.shift - rebuilt.shift).abs().max_element(), |worst, x| worst.max(x.abs()))
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

/// Gram matrix of the form that left multiplications keep in the base; 1 for the fibre.
const FORM: DMat4 = DMat4::from_diagonal(DVec4::new(1.0, 1.0, 1.0, -1.0));
