//! The head.

use super::field::*;
use super::glb::*;
use super::surface::*;
use std::f64::consts::{PI, TAU};
use std::path::Path;

pub const EYE: V = V(0.215, 0.04, 0.40);
pub const EYE_RADIUS: f64 = 0.155;

/// The eye's almond opening in the plane of the face; negative inside. `p.0` is non-negative.
pub fn opening(p: V) -> f64 {
    let (x, y) = (p.0 - EYE.0, p.1 - EYE.1);
    let (a, b) = (x + 0.1 * y, y - 0.1 * x);
    (a.hypot(b + 0.112) - 0.187).max(a.hypot(b - 0.125) - 0.183)
}

/// Height above the middle of the smile, and how far the point lies within its width (1..0).
pub fn smile(p: V) -> (f64, f64) {
    let inside = smoothstep(0.25, 0.13, p.0.abs()) * smoothstep(0.1, 0.3, p.2);
    (p.1 + 0.375 - 1.3 * p.0 * p.0, inside)
}

/// Strength of the eyebrow at a point; `p.0` is non-negative.
pub fn eyebrow(p: V) -> f64 {
    let x = p.0 - 0.24;
    let width = 0.034 - 0.03 * x;
    let along = smoothstep(0.07, 0.11, p.0) * smoothstep(0.45, 0.36, p.0);
    bell((p.1 - 0.30 + 1.4 * x * x + 0.08 * x) / width) * along * smoothstep(0.0, 0.2, p.2)
}

pub const EAR: [V; 3] = [V(0.88, 0.2, -0.431), V(-0.18, 0.98, 0.088), V(0.44, 0.0, 0.898)];

pub fn ear(p: V) -> f64 {
    let c = V(0.67, 0.10, -0.10);
    let shell = ellipsoid(p, c, EAR, V(0.26, 0.25, 0.08));
    let tip = limb(p, c, c + EAR[0] * 0.30 + EAR[1] * 0.20, 0.10, 0.03);
    let bowl = c + EAR[2] * 0.075 + EAR[0] * 0.02;
    let bowl = ellipsoid(p, bowl, EAR, V(0.20, 0.19, 0.07));
    carve(join(shell, tip, 0.10), bowl, 0.03)
}

pub fn skin(p: V) -> f64 {
    let p = V(p.0.abs(), p.1, p.2);
    let skull = ellipsoid(p, V(0.0, 0.22, -0.06), XYZ, V(0.60, 0.60, 0.64));
    let masses = [
        [0.25, 0.0, -0.26, 0.10, 0.44, 0.44, 0.45],  // jaw
        [0.14, 0.29, -0.19, 0.36, 0.17, 0.15, 0.15], // cheeks
        [0.14, 0.0, -0.60, 0.40, 0.15, 0.10, 0.11],  // chin
    ];
    let bones = [
        [0.14, 0.0, -0.3, -0.12, 0.0, -1.0, -0.18, 0.27, 0.25], // neck
        [0.14, 0.0, 0.25, 0.50, 0.36, 0.24, 0.37, 0.07, 0.06],  // brow
        [0.10, 0.0, 0.14, 0.55, 0.0, -0.08, 0.66, 0.05, 0.07],  // bridge of the nose
    ];
    let nose = [
        [0.06, 0.0, -0.11, 0.69, 0.11, 0.095, 0.10],
        [0.04, 0.095, -0.135, 0.625, 0.055, 0.05, 0.06],
        [-0.04, 0.05, -0.195, 0.67, 0.03, 0.035, 0.035],
    ];
    let mut f = limbs(lumps(skull, p, &masses), p, &bones);
    f = lumps(f, p, &[[-0.12, 0.22, 0.05, 0.62, 0.17, 0.12, 0.13]]);
    f = join(f, (p - EYE).len() - 0.177, 0.03);
    f = carve(f, opening(p).max(EYE.2 + 0.03 - p.2), 0.03);
    f = lumps(f, p, &nose);
    let (y, lip) = smile(p);
    let lips = 0.017 * bell((y - 0.038) / 0.034) + 0.024 * bell((y + 0.05) / 0.042);
    let dimple = 0.012 * bell((p.0 - 0.25).hypot(p.1 + 0.295) / 0.05);
    f -= lip * (lips - 0.012 * bell(y / 0.028)) + 0.018 * eyebrow(p);
    f += dimple * smoothstep(0.1, 0.3, p.2);
    carve(join(f, ear(p), 0.05), p.1 + 0.86, 0.06)
}

pub fn hair(p: V) -> f64 {
    let around = p.0.atan2(p.2 + 0.1);
    let strands = 0.010 * (16.0 * around + 5.0 * p.1).sin() * smoothstep(1.0, 0.5, p.1);
    let cap = ellipsoid(p, V(0.0, 0.25, -0.06), XYZ, V(0.635, 0.635, 0.68)) - strands;
    let line = 0.22 + 0.70 * p.2 + 0.03 * (9.0 * p.0 + 0.5).sin();
    let locks = [
        [0.04, -0.18, 0.74, 0.28, 0.12, 0.76, 0.44, 0.14, 0.11],
        [0.04, 0.12, 0.76, 0.44, 0.42, 0.56, 0.40, 0.11, 0.035],
        [0.04, -0.15, 0.78, 0.12, 0.22, 0.79, 0.28, 0.15, 0.12],
        [0.04, 0.22, 0.79, 0.28, 0.52, 0.52, 0.26, 0.12, 0.04],
        [0.04, -0.20, 0.70, 0.32, -0.34, 0.62, 0.38, 0.11, 0.09],
        [0.04, -0.34, 0.62, 0.38, -0.48, 0.44, 0.32, 0.09, 0.03],
    ];
    limbs(carve(cap, (p.1 - line) / 1.22, 0.06), p, &locks)
}

pub fn head_field(p: V) -> f64 {
    join(skin(p), hair(p), 0.03)
}

pub fn head_colour(p: V) -> V {
    let s = V(p.0.abs(), p.1, p.2);
    let front = smoothstep(0.1, 0.3, p.2);
    let c = V(0.90, 0.68, 0.53).mix(V(0.82, 0.56, 0.43), 0.3 + 0.3 * mottle(p, 6.0));
    let warmth = [
        [0.60, 0.96, 0.78, 0.64, 0.0, 0.42, 0.5, 0.28],      // forehead
        [0.65, 0.90, 0.42, 0.36, 0.31, -0.17, 0.47, 0.15],   // cheeks
        [0.55, 0.90, 0.45, 0.38, 0.0, -0.12, 0.78, 0.11],    // nose
        [1.00, 0.35, 0.14, 0.11, 0.05, -0.195, 0.68, 0.035], // nostrils
    ];
    let mut c = tints(c, s, &warmth);
    let bowl = ellipsoid(s, V(0.72, 0.10, -0.05), EAR, V(0.2, 0.2, 0.10));
    c = c.mix(V(0.86, 0.46, 0.40), 0.5 * smoothstep(0.04, -0.04, bowl));
    let freckles = mottle(s, 75.0) * bell((s - V(0.20, -0.11, 0.52)).len() / 0.2);
    let freckles = front * smoothstep(0.35, 0.5, freckles);
    c = c.mix(V(0.62, 0.36, 0.24), 0.6 * freckles);
    let (y, lip) = smile(s);
    let lips = bell((y - 0.030) / 0.030).max(bell((y + 0.045) / 0.038));
    let lips = lip * smoothstep(0.35, 0.75, lips);
    c = c.mix(V(0.78, 0.36, 0.34), 0.85 * lips);
    c = c.mix(V(0.30, 0.08, 0.09), lip * bell(y / 0.014));
    let lid = opening(s);
    let shade = front * smoothstep(0.09, 0.03, lid);
    c = c.mix(V(0.72, 0.44, 0.38), 0.5 * shade);
    let above = s.1 > EYE.1 + 0.1 * (s.0 - EYE.0);
    let lash = if above { 0.035 } else { 0.012 };
    let lash = smoothstep(lash, 0.3 * lash, lid) * smoothstep(0.215, 0.19, (s - EYE).len());
    c = c.mix(V(0.17, 0.09, 0.07), front * lash);
    let dark = V(0.22, 0.11, 0.06);
    c = c.mix(dark, 0.95 * smoothstep(0.25, 0.6, eyebrow(s)));
    let strand = 0.5 + 0.5 * (40.0 * p.0.atan2(p.2 + 0.1) + 9.0 * mottle(p, 5.0)).sin();
    let tone = 0.25 + 0.4 * strand + 0.2 * mottle(p, 9.0);
    let tone = dark.mix(V(0.55, 0.27, 0.11), tone);
    c.mix(tone, smoothstep(-0.012, 0.012, skin(p) - hair(p)))
}

/// The middle of the head's texture projection, and how much the picture favours the front.
pub const HUB: V = V(0.0, 0.0, -0.25);
pub const ZOOM: f64 = 2.2;

pub fn head(dir: &Path) -> Res<()> {
    // Finer cells towards the middle of the face.
    let warp = |q: V| {
        let centre = (1.0 - q.0 * q.0 - q.1 * q.1) * smoothstep(-0.1, 0.5, q.2);
        let s = (1.05 - 0.25 * q.2) * (1.0 - 0.35 * centre);
        V(q.0 * s, q.1 * s, q.2 * 0.8)
    };
    let angle = |p: V| p.0.atan2(p.2) / PI;
    let widen = |t: f64| (ZOOM * t).tanh() / ZOOM.tanh();
    let narrow = |t: f64| (ZOOM.tanh() * t).atanh() / ZOOM;
    let uv = |tri: [V; 3], p: V| {
        let p = p - HUB;
        let middle = angle((tri[0] + tri[1] + tri[2]) * (1.0 / 3.0) - HUB);
        let turn = ((middle - angle(p)) / 2.0).round();
        let u = 0.5 + 0.5 * widen(angle(p)) + turn;
        [u, 0.5 - 0.5 * widen((p.1 / p.len()).asin() / (0.5 * PI))]
    };
    let mut face = extract(&head_field, &warp, 56, &uv);
    // The eyes are balls around the line of sight, in rings from one polar angle to another.
    let ring = |from: f64, to: f64, rows: usize| {
        let mut both = Surface::default();
        for side in [-1.0, 1.0] {
            both.append(patch(28, rows, &|u, v| {
                let (a, b) = (-TAU * u, from + (to - from) * v);
                let n = V(b.sin() * a.cos(), b.sin() * a.sin(), b.cos());
                (V(side * EYE.0, EYE.1, EYE.2) + n * EYE_RADIUS, n)
            }));
        }
        both
    };
    let (mut pupil, mut iris) = (ring(0.0, 0.26, 3), ring(0.26, 0.54, 3));
    let mut white = ring(0.54, 1.75, 10);
    // Painted as if the ears were thicker, so that nothing behind them bleeds over their rims.
    let bake = |p: V| head_field(p).min(ear(V(p.0.abs(), p.1, p.2)) - 0.035);
    let mut glb = Glb::new("head");
    let map = glb.texture("head-skin", 512, &|u, v| {
        let (a, b) = (PI * narrow(2.0 * u - 1.0), 0.5 * PI * narrow(1.0 - 2.0 * v));
        let d = V(b.cos() * a.sin(), b.sin(), b.cos() * a.cos());
        head_colour(probe(&bake, HUB + d * 1.5, d * -1.0, 1.5)).array()
    })?;
    fit(&mut [&mut face, &mut white, &mut iris, &mut pupil]);
    glb.add(&face, painted("skin", map, 0.55));
    glb.add(&white, plain("eye-white", [0.86, 0.85, 0.82], 0.0, 0.12));
    glb.add(&iris, plain("eye-iris", [0.04, 0.20, 0.17], 0.3, 0.12));
    glb.add(&pupil, plain("eye-pupil", [0.01, 0.01, 0.012], 0.0, 0.05));
    glb.write(dir, "head.glb")
}
