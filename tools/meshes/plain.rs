//! The knot, the ring and the leaf.

use super::field::*;
use super::glb::*;
use super::surface::*;
use serde_json::json;
use std::f64::consts::{PI, TAU};
use std::path::Path;

/// A tube around the (2,3) torus knot, with `nu` cells along and `nv` around.
pub fn knot(dir: &Path, name: &str, nu: usize, nv: usize) -> Res<()> {
    let curve = |t: f64| {
        let r = 2.4 + (3.0 * t).cos();
        let (sin, cos) = (2.0 * t).sin_cos();
        V(r * cos, r * sin, 1.1 * (3.0 * t).sin())
    };
    let mut tube = patch(nu, nv, &|u, v| {
        let (t, a) = (TAU * u, -TAU * v);
        let along = (curve(t + 1e-4) - curve(t - 1e-4)).unit();
        let c = curve(t);
        let middle = V(c.0, c.1, 0.0).unit() * 2.4;
        let spoke = c - middle;
        let side = (spoke - along * spoke.dot(along)).unit();
        let n = side * a.cos() + along.cross(side) * a.sin();
        (c + n * 0.45, n)
    });
    fit(&mut [&mut tube]);
    let mut glb = Glb::new(name);
    glb.add(&tube, plain("knot", [0.80, 0.26, 0.07], 0.0, 0.35));
    glb.write(dir, &format!("{name}.glb"))
}

/// A ring with `nu` cells along and `nv` around: 2 nu nv triangles.
pub fn ring(dir: &Path, name: &str, nu: usize, nv: usize) -> Res<()> {
    let mut ring = patch(nu, nv, &|u, v| {
        let (along, around) = (TAU * u, -TAU * v);
        let spoke = V(along.cos(), along.sin(), 0.0);
        let n = spoke * around.cos() + V(0.0, 0.0, around.sin());
        (spoke + n * 0.4, n)
    });
    fit(&mut [&mut ring]);
    let mut glb = Glb::new(name);
    glb.add(&ring, plain("ring", [0.75, 0.55, 0.2], 0.0, 0.4));
    glb.write(dir, &format!("{name}.glb"))
}

/// A curved card whose texture cuts a leaf out of it.
pub fn leaf(dir: &Path) -> Res<()> {
    let height = |u: f64, v: f64| 0.25 * (2.5 * v).sin() - 0.9 * (u - 0.5) * (u - 0.5);
    let mut card = patch(8, 12, &|u, v| {
        let e = 1e-4;
        let slope_u = (height(u + e, v) - height(u - e, v)) / (2.0 * e);
        let slope_v = (height(u, v + e) - height(u, v - e)) / (2.0 * e);
        let n = V(-slope_u / 1.2, -slope_v / 1.8, 1.0).unit();
        (V(1.2 * u, 1.8 * v, height(u, v)), n)
    });
    fit(&mut [&mut card]);
    let mut glb = Glb::new("leaf");
    let map = glb.texture("leaf", 128, &|u, v| {
        let (x, y) = (2.0 * u - 1.0, 1.0 - v);
        let t = ((y - 0.14) / 0.84).clamp(0.0, 1.0);
        let teeth = 0.04 * (t * 60.0 - 3.0 * (1.0 - t)).sin() * (PI * t).sin();
        let half = 0.88 * (PI * t.powf(0.75)).sin().powf(0.8) + teeth;
        let stem = 0.045 - 0.03 * t;
        let inside = (half.max(stem) - x.abs()) * 28.0;
        let inside = inside.min(80.0 * y - 1.2);
        let vein = ((y - 0.35 * x.abs()) * 11.0).fract() - 0.5;
        let vein = bell(vein / 0.10) * smoothstep(0.0, 0.15, half - x.abs());
        let rib = bell(x / (stem + 0.01));
        let c = V(0.16, 0.42, 0.10).mix(V(0.42, 0.62, 0.16), 0.4 * x.abs() + 0.3 * t);
        let c = c.mix(V(0.66, 0.78, 0.36), (0.6 * vein).max(rib));
        // Insect bites: round holes well inside the outline.
        let bites = [(0.38, 0.42, 0.04), (-0.4, 0.55, 0.055), (0.22, 0.72, 0.03)];
        let hole = bites.map(|(a, b, r)| ((x - a) / 3.0).hypot(y - b) - r);
        let hole = hole.into_iter().fold(f64::MAX, f64::min) * 56.0;
        [c.0, c.1, c.2, 0.5 + 0.5 * inside.min(hole).clamp(-1.0, 1.0)]
    })?;
    let mut material = painted("leaf", map, 0.7);
    material["alphaMode"] = json!("MASK");
    material["alphaCutoff"] = json!(0.5);
    material["doubleSided"] = json!(true);
    glb.add(&card, material);
    glb.write(dir, "leaf.glb")
}
