//! The closed form of Sol's geodesics in elliptic functions: the reference that the series is tested against. It is
//! not what the program computes with: it divides by the momenta, and its modulus degenerates next to `u = v`.
//!
//! With `k = |u v|`, `a² = 1 − 2k`, `b² = 1 + 2k`: `w = a sn(b(t + τ) | m)`, `m = a²/b²`, and
//! `∫w² = b(bt − [E(am)])`. From `(x u₀)′ = u²`, `(y v₀)′ = v²`, `u² + v² = 1 − w²` and `w′ = v² − u²`:
//! `x = (t − ∫w² − Δw)/(2u₀)`, `y = (t − ∫w² + Δw)/(2v₀)`, `z = ln(u/u₀)`.

use glam::DVec3;
use std::f64::consts::{FRAC_PI_2, PI};

/// End point after length `t ≥ 0` from the identity for a unit velocity with `u v ≠ 0` and `|u| ≠ |v|` or `w ≠ 0`.
pub fn endpoint(velocity: DVec3, t: f64) -> DVec3 {
    let DVec3 { x: u, y: v, z: w } = velocity;
    let k = (u * v).abs();
    // 1 − 2k without cancellation: w² + (|u| − |v|)².
    let a = w.hypot(u.abs() - v.abs());
    let b = (1.0 + 2.0 * k).sqrt();
    let m = (a / b).powi(2);
    // The phase: sin φ₀ = w/a, and w′ = v² − u² = a b cn dn.
    let half = (w / a).clamp(-1.0, 1.0).asin();
    let phase = if v * v >= u * u { half } else { PI - half };
    let start = first_kind(phase, m);
    let end_phase = amplitude(start + b * t, m);
    let squares = b * (b * t - (second_kind(end_phase, m) - second_kind(phase, m)));
    let rise = a * end_phase.sin() - w;
    // u² = (1 − w² − w′)/2.
    let end_w = a * end_phase.sin();
    let slope = a * b * end_phase.cos() * (1.0 - m * end_phase.sin().powi(2)).sqrt();
    let (uu, vv) = (0.5 * (1.0 - end_w * end_w - slope), 0.5 * (1.0 - end_w * end_w + slope));
    // ln(u/u₀) from the larger of u and v: the other cancels.
    let z = if uu > vv { 0.5 * (uu / (u * u)).ln() } else { -0.5 * (vv / (v * v)).ln() };
    DVec3::new((t - squares - rise) / (2.0 * u), (t - squares + rise) / (2.0 * v), z)
}

/// `F(φ | m)` by Landen's descending transformation (Abramowitz, Stegun 17.6).
fn first_kind(phase: f64, m: f64) -> f64 {
    incomplete(phase, m).0
}

/// `E(φ | m)`.
fn second_kind(phase: f64, m: f64) -> f64 {
    incomplete(phase, m).1
}

/// `F` and `E` by the arithmetic-geometric mean: `tan(φ_{n+1} − φ_n) = (b_n/a_n) tan φ_n`.
fn incomplete(phase: f64, m: f64) -> (f64, f64) {
    let (mut a, mut b, mut c) = (1.0_f64, (1.0 - m).sqrt(), m.sqrt());
    let (mut angle, mut power) = (phase, 1.0);
    let (mut complete, mut rest) = (1.0 - 0.5 * c * c, 0.0);
    while c.abs() > 1e-17 * a && power < 1e6 {
        // The branch of the arc tangent that is continuous in φ.
        let turns = (angle / PI).round();
        let within = angle - turns * PI;
        angle += turns * PI + (b * within.sin()).atan2(a * within.cos());
        (a, b, c) = (0.5 * (a + b), (a * b).sqrt(), 0.5 * (a - b));
        power *= 2.0;
        complete -= 0.5 * power * c * c;
        rest += c * angle.sin();
    }
    let first = angle / (power * a);
    (first, complete * first + rest)
}

/// `am(u | m)`, the inverse of `F`, by descending the same means.
fn amplitude(argument: f64, m: f64) -> f64 {
    let mut means = vec![(1.0_f64, (1.0 - m).sqrt(), m.sqrt())];
    while let Some(&(a, b, c)) = means.last().filter(|(a, _, c)| c.abs() > 1e-17 * a && means.len() < 20) {
        let _ = c;
        means.push((0.5 * (a + b), (a * b).sqrt(), 0.5 * (a - b)));
    }
    let (last, ..) = means[means.len() - 1];
    let mut angle = argument * last * f64::from(1_u32 << (means.len() - 1));
    for (a, _, c) in means.iter().skip(1).rev() {
        angle = 0.5 * (angle + (c / a * angle.sin()).clamp(-1.0, 1.0).asin());
    }
    angle
}

/// Length of the period of z: `4K/b`.
pub fn period(velocity: DVec3) -> f64 {
    let k = (velocity.x * velocity.y).abs();
    let a = velocity.z.hypot(velocity.x.abs() - velocity.y.abs());
    let b = (1.0 + 2.0 * k).sqrt();
    4.0 * first_kind(FRAC_PI_2, (a / b).powi(2)) / b
}
