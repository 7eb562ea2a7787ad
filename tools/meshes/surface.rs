//! Surfaces: zero sets of fields, extracted with surface nets, and parametric patches.

use super::field::*;
use std::collections::BTreeMap;

/// An indexed triangle mesh, counter-clockwise from outside.
#[derive(Default)]
pub struct Surface {
    pub pos: Vec<V>,
    pub nor: Vec<V>,
    pub uv: Vec<[f64; 2]>,
    pub tris: Vec<[usize; 3]>,
}

impl Surface {
    pub fn append(&mut self, other: Surface) {
        let base = self.pos.len();
        let moved = other.tris.iter().map(|t| t.map(|i| i + base));
        self.tris.extend(moved);
        self.pos.extend(other.pos);
        self.nor.extend(other.nor);
        self.uv.extend(other.uv);
    }
}

/// Texture coordinates of a point that is a corner of a triangle.
pub type Unwrap<'a> = &'a dyn Fn([V; 3], V) -> [f64; 2];

/// Zero set of `f` by surface nets on `n`^3 cells over [-1.1, 1.1]^3 seen through `warp`, with the
/// vertices evened out and projected, and the corners unwrapped by `uv(triangle, corner)`.
pub fn extract(f: Field, warp: &dyn Fn(V) -> V, n: usize, uv: Unwrap) -> Surface {
    let m = n + 1;
    let point = |c: [f64; 3]| {
        let q = c.map(|c| 2.2 * c / n as f64 - 1.1);
        warp(V(q[0], q[1], q[2]))
    };
    let node = |i: usize| [i % m, i / m % m, i / m / m];
    let sample = |i: usize| f(point(node(i).map(|c| c as f64)));
    let value: Vec<f64> = (0..m * m * m).map(sample).collect();
    let stride = [1, m, m * m];
    let mut cell = vec![usize::MAX; m * m * m];
    let (mut pos, mut quads) = (Vec::new(), Vec::new());
    for (i, slot) in cell.iter_mut().enumerate() {
        if node(i).contains(&n) {
            continue;
        }
        let (mut sum, mut count) = ([0.0; 3], 0.0);
        for edge in 0..12 {
            let (a, b, c) = (edge / 4, (edge / 4 + 1) % 3, (edge / 4 + 2) % 3);
            let (db, dc) = (edge & 1, edge >> 1 & 1);
            let start = i + db * stride[b] + dc * stride[c];
            let (v0, v1) = (value[start], value[start + stride[a]]);
            if (v0 < 0.0) != (v1 < 0.0) {
                sum[a] += v0 / (v0 - v1);
                sum[b] += db as f64;
                sum[c] += dc as f64;
                count += 1.0;
            }
        }
        if count > 0.0 {
            let corner = node(i);
            *slot = pos.len();
            let at: [f64; 3] = std::array::from_fn(|a| corner[a] as f64 + sum[a] / count);
            pos.push(point(at));
        }
    }
    for i in 0..m * m * m {
        for a in 0..3 {
            let (c, b, d) = (node(i), (a + 1) % 3, (a + 2) % 3);
            if c[a] == n || c[b] == 0 || c[d] == 0 || c[b] == n || c[d] == n {
                continue;
            }
            let inside = value[i] < 0.0;
            if inside != (value[i + stride[a]] < 0.0) {
                let (sb, sd) = (stride[b], stride[d]);
                let quad = [i - sb - sd, i - sd, i, i - sb].map(|c| cell[c]);
                let [q0, q1, q2, q3] = quad;
                quads.push(if inside { quad } else { [q3, q2, q1, q0] });
            }
        }
    }
    for _ in 0..4 {
        let mut sum = vec![(V(0.0, 0.0, 0.0), 0.0); pos.len()];
        for q in &quads {
            for k in 0..4 {
                let (here, next) = (q[k], q[(k + 1) % 4]);
                sum[here] = (sum[here].0 + pos[next], sum[here].1 + 1.0);
            }
        }
        for (p, (s, count)) in pos.iter_mut().zip(sum) {
            *p = project(f, p.mix(s * (1.0 / count), 0.5));
        }
    }
    let mut out = Surface::default();
    let mut known = BTreeMap::new();
    for [a, b, c, d] in quads {
        let short = (pos[a] - pos[c]).len() < (pos[b] - pos[d]).len();
        let (k, l) = if short { (c, a) } else { (d, b) };
        for tri in [[a, b, k], [l, c, d]] {
            let corners = tri.map(|i| pos[i]);
            out.tris.push(tri.map(|i| {
                let t = uv(corners, pos[i]);
                *known.entry((i, t.map(f64::to_bits))).or_insert_with(|| {
                    out.pos.push(pos[i]);
                    out.nor.push(gradient(f, pos[i], 0.012).unit());
                    out.uv.push(t);
                    out.pos.len() - 1
                })
            }));
        }
    }
    out
}

/// A surface over the unit square with `nu` x `nv` cells; `at` gives position and normal.
pub fn patch(nu: usize, nv: usize, at: &dyn Fn(f64, f64) -> (V, V)) -> Surface {
    let mut out = Surface::default();
    for (j, i) in (0..=nv).flat_map(|j| (0..=nu).map(move |i| (j, i))) {
        let (u, v, a) = (i as f64 / nu as f64, j as f64 / nv as f64, out.pos.len());
        let (p, n) = at(u, v);
        out.pos.push(p);
        out.nor.push(n);
        out.uv.push([u, 1.0 - v]);
        if i < nu && j < nv {
            let (b, c, d) = (a + 1, a + nu + 1, a + nu + 2);
            out.tris.extend([[a, b, d], [a, d, c]]);
        }
    }
    let pos = &out.pos;
    let area = |[a, b, c]: [usize; 3]| (pos[b] - pos[a]).cross(pos[c] - pos[a]).len();
    out.tris.retain(|t| area(*t) > 1e-12);
    out
}

/// Centres the bounding box of all the surfaces at the origin and scales them into the unit ball.
pub fn fit(surfaces: &mut [&mut Surface]) {
    let all = || surfaces.iter().flat_map(|s| &s.pos);
    let bound = |sign: f64| {
        let most = |axis: V| all().map(|p| sign * p.dot(axis)).fold(f64::MIN, f64::max) * sign;
        V(most(XYZ[0]), most(XYZ[1]), most(XYZ[2]))
    };
    let centre = bound(1.0).mix(bound(-1.0), 0.5);
    let scale = 0.98 / all().map(|p| (*p - centre).len()).fold(0.0, f64::max);
    for s in surfaces {
        s.pos.iter_mut().for_each(|p| *p = (*p - centre) * scale);
    }
}
