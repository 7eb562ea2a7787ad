//! Vectors and fields: negative inside, close to the distance near the surface.

use std::error::Error;
use std::ops::{Add, Mul, Sub};

pub type Res<T> = Result<T, Box<dyn Error>>;

/// A point, a direction, or an sRGB colour with components in 0..=1.
#[derive(Clone, Copy, PartialEq)]
pub struct V(pub f64, pub f64, pub f64);

impl Add for V {
    type Output = V;
    fn add(self, o: V) -> V {
        V(self.0 + o.0, self.1 + o.1, self.2 + o.2)
    }
}
impl Sub for V {
    type Output = V;
    fn sub(self, o: V) -> V {
        self + o * -1.0
    }
}
impl Mul<f64> for V {
    type Output = V;
    fn mul(self, s: f64) -> V {
        V(self.0 * s, self.1 * s, self.2 * s)
    }
}
impl V {
    pub fn dot(self, o: V) -> f64 {
        self.0 * o.0 + self.1 * o.1 + self.2 * o.2
    }
    pub fn cross(self, o: V) -> V {
        let (a, b) = (self, o);
        V(a.1 * b.2 - a.2 * b.1, a.2 * b.0 - a.0 * b.2, a.0 * b.1 - a.1 * b.0)
    }
    pub fn len(self) -> f64 {
        self.dot(self).sqrt()
    }
    pub fn unit(self) -> V {
        self * (1.0 / self.len().max(1e-30))
    }
    pub fn mix(self, o: V, t: f64) -> V {
        self + (o - self) * t.clamp(0.0, 1.0)
    }
    pub fn array(self) -> [f64; 3] {
        [self.0, self.1, self.2]
    }
}

pub type Field<'a> = &'a dyn Fn(V) -> f64;

/// Union of two fields, blended over the width `k`.
pub fn join(a: f64, b: f64, k: f64) -> f64 {
    let h = (k - (a - b).abs()).max(0.0);
    a.min(b) - h * h / (4.0 * k)
}

/// `a` without `b`, blended over the width `k`.
pub fn carve(a: f64, b: f64, k: f64) -> f64 {
    -join(-a, b, k)
}

/// Ellipsoid in the orthonormal frame `axes`: its quadric divided by the gradient's length.
pub fn ellipsoid(p: V, centre: V, axes: [V; 3], radii: V) -> f64 {
    let d = p - centre;
    let d = V(d.dot(axes[0]), d.dot(axes[1]), d.dot(axes[2]));
    let q = V(d.0 / radii.0, d.1 / radii.1, d.2 / radii.2);
    let g = V(q.0 / radii.0, q.1 / radii.1, q.2 / radii.2);
    q.len() * (q.len() - 1.0) / g.len().max(1e-9)
}

pub const XYZ: [V; 3] = [V(1.0, 0.0, 0.0), V(0.0, 1.0, 0.0), V(0.0, 0.0, 1.0)];

/// Segment from `a` to `b` thickened by a radius that runs from `ra` to `rb`.
pub fn limb(p: V, a: V, b: V, ra: f64, rb: f64) -> f64 {
    let t = ((p - a).dot(b - a) / (b - a).dot(b - a)).clamp(0.0, 1.0);
    (p - a.mix(b, t)).len() - (ra + (rb - ra) * t)
}

/// Adds limbs to a field, each row its blend, two ends and two radii.
pub fn limbs(f: f64, p: V, rows: &[[f64; 9]]) -> f64 {
    let add =
        |f, &[k, ax, ay, az, bx, by, bz, ra, rb]: &[f64; 9]| join(f, limb(p, V(ax, ay, az), V(bx, by, bz), ra, rb), k);
    rows.iter().fold(f, add)
}

/// Adds ellipsoids to a field, each row its blend, centre and radii; a negative blend carves.
pub fn lumps(f: f64, p: V, rows: &[[f64; 7]]) -> f64 {
    let add = |f, &[k, cx, cy, cz, rx, ry, rz]: &[f64; 7]| {
        let lump = ellipsoid(p, V(cx, cy, cz), XYZ, V(rx, ry, rz));
        if k < 0.0 { carve(f, lump, -k) } else { join(f, lump, k) }
    };
    rows.iter().fold(f, add)
}

/// Tints a colour around points, each row the strength, the colour, the point and the radius.
pub fn tints(c: V, p: V, rows: &[[f64; 8]]) -> V {
    let add = |c: V, &[k, red, green, blue, x, y, z, radius]: &[f64; 8]| {
        c.mix(V(red, green, blue), k * bell((p - V(x, y, z)).len() / radius))
    };
    rows.iter().fold(c, add)
}

pub fn smoothstep(a: f64, b: f64, x: f64) -> f64 {
    let t = ((x - a) / (b - a)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

pub fn bell(x: f64) -> f64 {
    (-x * x).exp()
}

/// A smooth pattern between -1 and 1 with features of about `1 / f`.
pub fn mottle(p: V, f: f64) -> f64 {
    let a = (f * (p.0 + 0.7 * p.1)).sin() + (f * (1.3 * p.1 - 0.8 * p.2) + 1.0).sin();
    let b = (f * (1.1 * p.2 + 0.6 * p.0) + 2.0 + a).sin();
    (a + b) / 3.0
}

pub fn gradient(f: Field, p: V, e: f64) -> V {
    let [x, y, z] = XYZ.map(|a| (f(p + a * e) - f(p - a * e)) / (2.0 * e));
    V(x, y, z)
}

/// Moves `p` onto the zero set of `f` by Newton steps of bounded length.
pub fn project(f: Field, mut p: V) -> V {
    for _ in 0..5 {
        let g = gradient(f, p, 1e-3);
        let step = f(p) / g.dot(g).max(0.05);
        p = p - g * (step * (0.02 / (step.abs() * g.len()).max(0.02)));
    }
    p
}

/// First point of the zero set along a ray of length `reach`, or the point that comes nearest.
pub fn probe(f: Field, from: V, along: V, reach: f64) -> V {
    let (mut t, mut best, mut near) = (0.0, f64::MAX, from);
    while t < reach && best > 1e-3 {
        let d = f(from + along * t);
        if d < best {
            (best, near) = (d, from + along * t);
        }
        t += (0.4 * d).max(2e-3);
    }
    near
}
