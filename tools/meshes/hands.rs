//! The hands.

use super::field::*;
use super::glb::*;
use super::surface::*;
use std::path::Path;

/// A digit: its joints from the root to the tip, their radii, and the way the nail faces.
pub struct Digit {
    pub joints: [V; 4],
    pub radii: [f64; 4],
    pub back: V,
}

/// The four fingers, then the thumb, of a left hand with its palm down.
pub fn digits() -> Vec<Digit> {
    // Knuckle, yaw, curl, lengths of the phalanges, radius.
    let fingers: [[f64; 9]; 4] = [
        [0.298, 0.03, -0.05, 0.13, 0.17, 0.36, 0.23, 0.18, 0.086],
        [0.100, 0.05, -0.10, 0.03, 0.14, 0.40, 0.26, 0.19, 0.090],
        [-0.10, 0.04, -0.06, -0.08, 0.18, 0.37, 0.24, 0.18, 0.085],
        [-0.285, 0.0, 0.03, -0.20, 0.24, 0.28, 0.18, 0.16, 0.075],
    ];
    let mut all = Vec::new();
    for [x, y, z, yaw, curl, l0, l1, l2, r] in fingers {
        let flat = V(yaw.sin(), 0.0, -yaw.cos());
        let mut joints = [V(x, y, z); 4];
        let (mut pitch, mut back) = (0.0, XYZ[1]);
        for (k, (length, bend)) in [(l0, 1.0), (l1, 1.7), (l2, 1.2)].into_iter().enumerate() {
            pitch += curl * bend;
            let (sin, cos) = f64::sin_cos(pitch);
            joints[k + 1] = joints[k] + (flat * cos - XYZ[1] * sin) * length;
            back = XYZ[1] * cos + flat * sin;
        }
        let radii = [1.08 * r, r, 0.88 * r, 0.74 * r];
        all.push(Digit { joints, radii, back });
    }
    let (a, b) = (V(0.19, -0.05, 0.60), V(0.43, -0.09, 0.29));
    let joints = [a, b, V(0.57, -0.12, 0.02), V(0.61, -0.15, -0.17)];
    let (radii, back) = ([0.12, 0.105, 0.098, 0.080], V(0.62, 0.78, 0.0).unit());
    all.push(Digit { joints, radii, back });
    all
}

/// Frame of the nail (across, out, along the digit) and its centre.
pub fn nail(d: &Digit) -> ([V; 3], V) {
    let (tip, r) = (d.joints[3], d.radii[3]);
    let along = (tip - d.joints[2]).unit();
    let across = d.back.cross(along).unit();
    let out = along.cross(across);
    ([across, out, along], tip + out * (0.80 * r) - along * (0.1 * r))
}

pub fn nail_field(d: &Digit, p: V) -> f64 {
    let (frame, centre) = nail(d);
    ellipsoid(p, centre, frame, V(0.78, 0.32, 1.0) * d.radii[3])
}

pub fn digit_field(d: &Digit, p: V) -> f64 {
    let mut f = 1e3;
    for k in 0..3 {
        let (a, b, r) = (d.joints[k], d.joints[k + 1], d.radii[k]);
        let end = if k == 2 { 1.0 } else { 0.97 } * d.radii[k + 1];
        let bone = limb(p, a, b, 0.97 * r, end);
        f = join(f, join(bone, (p - a).len() - 1.02 * r, 0.06), 0.03);
    }
    join(f, nail_field(d, p), 0.015)
}

pub fn hand_field(digits: &[Digit], p: V) -> f64 {
    let flat = V(p.0, 1.45 * p.1, p.2);
    let mut f = limb(flat, V(0.0, 0.0, 0.62), V(0.0, 0.0, 1.2), 0.24, 0.235) * 0.8;
    let mut fingers = 1e3;
    for (k, d) in digits.iter().take(4).enumerate() {
        let root = V(0.12 - 0.08 * k as f64, 0.0, 0.68);
        f = join(f, limb(p, root, d.joints[0], 0.12, 1.02 * d.radii[0]), 0.06);
        fingers = join(fingers, digit_field(d, p), 0.03);
    }
    f = lumps(f, p, &[[0.08, 0.0, -0.02, 0.32, 0.33, 0.11, 0.42]]);
    let balls = [
        [0.10, -0.20, -0.06, 0.55, -0.27, -0.05, 0.16, 0.11, 0.09],
        [0.10, 0.20, -0.09, 0.54, 0.36, -0.10, 0.32, 0.13, 0.11],
    ];
    f = limbs(f, p, &balls);
    f = lumps(f, p, &[[-0.14, 0.02, -0.21, 0.28, 0.16, 0.085, 0.20]]);
    f = join(f, fingers, 0.06);
    f = join(f, digit_field(&digits[4], p), 0.07);
    carve(f, 0.92 - p.2, 0.08)
}

pub fn hand_colour(digits: &[Digit], p: V) -> V {
    let back = V(0.87, 0.64, 0.50).mix(V(0.80, 0.54, 0.42), 0.5 + 0.4 * mottle(p, 9.0));
    let palm = V(0.93, 0.72, 0.62).mix(V(0.90, 0.58, 0.52), 0.5 + 0.4 * mottle(p, 9.0));
    let mut c = back.mix(palm, smoothstep(0.03, -0.10, p.1));
    let lines = [
        (V(0.36, 0.0, 0.10), V(-0.22, 0.0, 0.22), 0.06),
        (V(0.10, 0.0, 0.00), V(-0.34, 0.0, 0.10), -0.04),
        (V(0.34, 0.0, 0.08), V(0.08, 0.0, 0.60), -0.12),
    ];
    for (a, b, bend) in lines {
        let q = V(p.0, 0.0, p.2) - a;
        let t = q.dot(b - a) / (b - a).dot(b - a);
        let off = q.cross(b - a).1 / (b - a).len() - 4.0 * bend * t * (1.0 - t);
        let on = bell(off / 0.012) * smoothstep(-0.05, 0.1, t) * smoothstep(1.05, 0.9, t);
        let on = on * smoothstep(-0.03, -0.08, p.1);
        c = c.mix(V(0.62, 0.32, 0.28), 0.65 * on);
    }
    for d in digits {
        let pad = bell((p - d.joints[3]).len() / 0.09);
        c = c.mix(V(0.88, 0.45, 0.40), 0.5 * pad);
        for k in 0..3 {
            let (q, r) = (p - d.joints[k], d.radii[k]);
            let up = q.dot(V(0.0, 0.6, 0.0).mix(d.back, 0.5).unit()) / r;
            let knuckle = bell(q.len() / (1.5 * r)) * smoothstep(0.0, 1.0, up);
            c = c.mix(V(0.80, 0.42, 0.36), 0.5 * knuckle);
            // Creases below the joints of the fingers and the last of the thumb.
            if k > 0 && r < 0.1 {
                let along = (d.joints[k + 1] - d.joints[k - 1]).unit();
                let near = smoothstep(1.7, 1.3, q.len() / r) * smoothstep(0.3, -0.5, up);
                let crease = near * bell((q.dot(along) + 0.1 * r) / 0.014);
                c = c.mix(V(0.58, 0.30, 0.25), 0.45 * crease);
            }
        }
        let (edge, (frame, centre)) = (nail_field(d, p), nail(d));
        c = c.mix(V(0.70, 0.38, 0.34), 0.8 * smoothstep(0.016, 0.006, edge));
        let tip = smoothstep(0.5, 0.7, (p - centre).dot(frame[2]) / d.radii[3]);
        let nail = V(0.97, 0.75, 0.70).mix(V(0.98, 0.93, 0.88), tip);
        c = c.mix(nail, smoothstep(0.006, 0.0, edge));
    }
    c
}

/// Both hands: the left is extracted, the right is its mirror image.
pub fn hands(dir: &Path) -> Res<()> {
    let digits = digits();
    let field = |p: V| hand_field(&digits, p);
    // The back fills the left half of the picture, the palm the right half.
    let uv = |tri: [V; 3], p: V| {
        let down = (tri[1] - tri[0]).cross(tri[2] - tri[0]).1 < 0.0;
        let u = if down { 0.75 } else { 0.25 };
        [u + (p.0 - 0.13) * 0.33, 0.5 + p.2 * 0.48]
    };
    let mut hand = extract(&field, &|q| q, 68, &uv);
    fit(&mut [&mut hand]);
    for name in ["left-hand", "right-hand"] {
        let mut glb = Glb::new(name);
        let map = glb.texture(&format!("{name}-skin"), 256, &|u, v| {
            let (centre, y) = if u < 0.5 { (0.25, 1.0) } else { (0.75, -1.0) };
            let from = V((u - centre) / 0.33 + 0.13, y, (v - 0.5) / 0.48);
            hand_colour(&digits, probe(&field, from, V(0.0, -y, 0.0), 2.0)).array()
        })?;
        glb.add(&hand, painted(&format!("{name}-skin"), map, 0.6));
        glb.write(dir, &format!("{name}.glb"))?;
        let flip = |v: &mut V| v.0 = -v.0;
        hand.pos.iter_mut().for_each(flip);
        hand.nor.iter_mut().for_each(flip);
        hand.tris.iter_mut().for_each(|t| t.swap(1, 2));
    }
    Ok(())
}
