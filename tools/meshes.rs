//! Makes the meshes of `scenes/meshes/` by procedure: `cargo run --release --example meshes -- DIR`.
//!
//! Organic shapes are signed fields; their zero sets are extracted with surface nets, relaxed,
//! unwrapped, and written as glTF 2.0 binaries whose textures are baked from colour functions of
//! the surface point. No clock, no randomness and no hashing: every run writes the same bytes.

use std::collections::BTreeMap;
use std::error::Error;
use std::f64::consts::{PI, TAU};
use std::ops::{Add, Mul, Sub};
use std::path::Path;

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use serde_json::{Value, json};

type Res<T> = Result<T, Box<dyn Error>>;

/// A point, a direction, or an sRGB colour with components in 0..=1.
#[derive(Clone, Copy, PartialEq)]
struct V(f64, f64, f64);

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
    fn dot(self, o: V) -> f64 {
        self.0 * o.0 + self.1 * o.1 + self.2 * o.2
    }
    fn cross(self, o: V) -> V {
        let (a, b) = (self, o);
        V(a.1 * b.2 - a.2 * b.1, a.2 * b.0 - a.0 * b.2, a.0 * b.1 - a.1 * b.0)
    }
    fn len(self) -> f64 {
        self.dot(self).sqrt()
    }
    fn unit(self) -> V {
        self * (1.0 / self.len().max(1e-30))
    }
    fn mix(self, o: V, t: f64) -> V {
        self + (o - self) * t.clamp(0.0, 1.0)
    }
    fn array(self) -> [f64; 3] {
        [self.0, self.1, self.2]
    }
}

type Field<'a> = &'a dyn Fn(V) -> f64;

// ---- Fields: negative inside, close to the distance near the surface. ----

/// Union of two fields, blended over the width `k`.
fn join(a: f64, b: f64, k: f64) -> f64 {
    let h = (k - (a - b).abs()).max(0.0);
    a.min(b) - h * h / (4.0 * k)
}

/// `a` without `b`, blended over the width `k`.
fn carve(a: f64, b: f64, k: f64) -> f64 {
    -join(-a, b, k)
}

/// Ellipsoid in the orthonormal frame `axes`: its quadric divided by the gradient's length.
fn ellipsoid(p: V, centre: V, axes: [V; 3], radii: V) -> f64 {
    let d = p - centre;
    let d = V(d.dot(axes[0]), d.dot(axes[1]), d.dot(axes[2]));
    let q = V(d.0 / radii.0, d.1 / radii.1, d.2 / radii.2);
    let g = V(q.0 / radii.0, q.1 / radii.1, q.2 / radii.2);
    q.len() * (q.len() - 1.0) / g.len().max(1e-9)
}

const XYZ: [V; 3] = [V(1.0, 0.0, 0.0), V(0.0, 1.0, 0.0), V(0.0, 0.0, 1.0)];

/// Segment from `a` to `b` thickened by a radius that runs from `ra` to `rb`.
fn limb(p: V, a: V, b: V, ra: f64, rb: f64) -> f64 {
    let t = ((p - a).dot(b - a) / (b - a).dot(b - a)).clamp(0.0, 1.0);
    (p - a.mix(b, t)).len() - (ra + (rb - ra) * t)
}

/// Adds limbs to a field, each row its blend, two ends and two radii.
fn limbs(f: f64, p: V, rows: &[[f64; 9]]) -> f64 {
    let add =
        |f, &[k, ax, ay, az, bx, by, bz, ra, rb]: &[f64; 9]| join(f, limb(p, V(ax, ay, az), V(bx, by, bz), ra, rb), k);
    rows.iter().fold(f, add)
}

/// Adds ellipsoids to a field, each row its blend, centre and radii; a negative blend carves.
fn lumps(f: f64, p: V, rows: &[[f64; 7]]) -> f64 {
    let add = |f, &[k, cx, cy, cz, rx, ry, rz]: &[f64; 7]| {
        let lump = ellipsoid(p, V(cx, cy, cz), XYZ, V(rx, ry, rz));
        if k < 0.0 { carve(f, lump, -k) } else { join(f, lump, k) }
    };
    rows.iter().fold(f, add)
}

/// Tints a colour around points, each row the strength, the colour, the point and the radius.
fn tints(c: V, p: V, rows: &[[f64; 8]]) -> V {
    let add = |c: V, &[k, red, green, blue, x, y, z, radius]: &[f64; 8]| {
        c.mix(V(red, green, blue), k * bell((p - V(x, y, z)).len() / radius))
    };
    rows.iter().fold(c, add)
}

fn smoothstep(a: f64, b: f64, x: f64) -> f64 {
    let t = ((x - a) / (b - a)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

fn bell(x: f64) -> f64 {
    (-x * x).exp()
}

/// A smooth pattern between -1 and 1 with features of about `1 / f`.
fn mottle(p: V, f: f64) -> f64 {
    let a = (f * (p.0 + 0.7 * p.1)).sin() + (f * (1.3 * p.1 - 0.8 * p.2) + 1.0).sin();
    let b = (f * (1.1 * p.2 + 0.6 * p.0) + 2.0 + a).sin();
    (a + b) / 3.0
}

fn gradient(f: Field, p: V, e: f64) -> V {
    let [x, y, z] = XYZ.map(|a| (f(p + a * e) - f(p - a * e)) / (2.0 * e));
    V(x, y, z)
}

/// Moves `p` onto the zero set of `f` by Newton steps of bounded length.
fn project(f: Field, mut p: V) -> V {
    for _ in 0..5 {
        let g = gradient(f, p, 1e-3);
        let step = f(p) / g.dot(g).max(0.05);
        p = p - g * (step * (0.02 / (step.abs() * g.len()).max(0.02)));
    }
    p
}

/// First point of the zero set along a ray of length `reach`, or the point that comes nearest.
fn probe(f: Field, from: V, along: V, reach: f64) -> V {
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

// ---- Surfaces ----

/// An indexed triangle mesh, counter-clockwise from outside.
#[derive(Default)]
struct Surface {
    pos: Vec<V>,
    nor: Vec<V>,
    uv: Vec<[f64; 2]>,
    tris: Vec<[usize; 3]>,
}

impl Surface {
    fn append(&mut self, other: Surface) {
        let base = self.pos.len();
        let moved = other.tris.iter().map(|t| t.map(|i| i + base));
        self.tris.extend(moved);
        self.pos.extend(other.pos);
        self.nor.extend(other.nor);
        self.uv.extend(other.uv);
    }
}

/// Texture coordinates of a point that is a corner of a triangle.
type Unwrap<'a> = &'a dyn Fn([V; 3], V) -> [f64; 2];

/// Zero set of `f` by surface nets on `n`^3 cells over [-1.1, 1.1]^3 seen through `warp`, with the
/// vertices evened out and projected, and the corners unwrapped by `uv(triangle, corner)`.
fn extract(f: Field, warp: &dyn Fn(V) -> V, n: usize, uv: Unwrap) -> Surface {
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
fn patch(nu: usize, nv: usize, at: &dyn Fn(f64, f64) -> (V, V)) -> Surface {
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
fn fit(surfaces: &mut [&mut Surface]) {
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

// ---- glTF binary ----

/// The colour of a picture at a place in 0..1, counted from the upper left.
type Texel<'a, const N: usize> = &'a dyn Fn(f64, f64) -> [f64; N];

/// A glTF file under construction: one node, one mesh, one primitive per surface.
struct Glb {
    bin: Vec<u8>,
    root: Value,
}

impl Glb {
    fn new(name: &str) -> Glb {
        let sampler = json!({"magFilter": 9729, "minFilter": 9987, "wrapS": 10497, "wrapT": 33071});
        let root = json!({
            "asset": {"version": "2.0", "generator": "Holonomy tools/meshes.rs"},
            "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0, "name": name}],
            "meshes": [{"name": name, "primitives": []}],
            "accessors": [], "bufferViews": [], "materials": [],
            "samplers": [sampler], "images": [], "textures": [],
        });
        Glb { bin: vec![], root }
    }

    /// Appends to one of the root's arrays and gives the index.
    fn push(&mut self, list: &str, item: Value) -> usize {
        let items = self.root[list].as_array_mut().expect("an array of the root");
        items.push(item);
        items.len() - 1
    }

    fn view(&mut self, bytes: &[u8], target: Option<u32>) -> usize {
        let (start, length) = (self.bin.len(), bytes.len());
        let mut view = json!({"buffer": 0, "byteOffset": start, "byteLength": length});
        if let Some(target) = target {
            view["target"] = json!(target);
        }
        self.bin.extend(bytes);
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        self.push("bufferViews", view)
    }

    fn floats<const N: usize>(&mut self, rows: &[[f64; N]], bounds: bool) -> usize {
        let rows: Vec<[f32; N]> = rows.iter().map(|r| r.map(|x| x as f32)).collect();
        let bytes: Vec<u8> = rows.as_flattened().iter().flat_map(|x| x.to_le_bytes()).collect();
        let kind = format!("VEC{N}");
        let mut accessor = json!({"bufferView": self.view(&bytes, Some(34962)),
            "componentType": 5126, "count": rows.len(), "type": kind});
        if bounds {
            let range = |pick: fn(f32, f32) -> f32| {
                let fold = |a: [f32; N], b: &[f32; N]| std::array::from_fn(|k| pick(a[k], b[k]));
                rows.iter().fold(rows[0], fold).to_vec()
            };
            accessor["min"] = json!(range(f32::min));
            accessor["max"] = json!(range(f32::max));
        }
        self.push("accessors", accessor)
    }

    /// Adds a primitive; indices are 16-bit where the vertices allow.
    fn add(&mut self, s: &Surface, material: Value) {
        let short = s.pos.len() < 0xffff;
        let indices = s.tris.iter().flatten();
        let bytes: Vec<u8> = if short {
            indices.flat_map(|&i| (i as u16).to_le_bytes()).collect()
        } else {
            indices.flat_map(|&i| (i as u32).to_le_bytes()).collect()
        };
        let view = self.view(&bytes, Some(34963));
        let kind = if short { 5123 } else { 5125 };
        let accessor = json!({"bufferView": view, "componentType": kind, "type": "SCALAR",
            "count": s.tris.len() * 3});
        let indices = self.push("accessors", accessor);
        let rows = |list: &[V]| list.iter().map(|p| p.array()).collect::<Vec<_>>();
        let position = self.floats(&rows(&s.pos), true);
        let normal = self.floats(&rows(&s.nor), false);
        let uv = self.floats(&s.uv, false);
        let material = self.push("materials", material);
        let attributes = json!({"POSITION": position, "NORMAL": normal, "TEXCOORD_0": uv});
        let primitive = json!({"attributes": attributes, "indices": indices, "material": material});
        if let Some(list) = self.root["meshes"][0]["primitives"].as_array_mut() {
            list.push(primitive);
        }
    }

    /// Bakes an sRGB picture of `size` squared with `N` channels from `texel(u, v)`.
    fn texture<const N: usize>(&mut self, name: &str, size: usize, texel: Texel<N>) -> Res<Value> {
        let at = |i: usize| (i as f64 + 0.5) / size as f64;
        let pixels: Vec<u8> = (0..size * size)
            .flat_map(|i| texel(at(i % size), at(i / size)))
            .map(|c| (c.clamp(0.0, 1.0) * 255.0).round() as u8)
            .collect();
        let mut png = Vec::new();
        let kinds = [ExtendedColorType::Rgb8, ExtendedColorType::Rgba8];
        PngEncoder::new_with_quality(&mut png, CompressionType::Best, FilterType::Adaptive).write_image(
            &pixels,
            size as u32,
            size as u32,
            kinds[usize::from(N == 4)],
        )?;
        let view = self.view(&png, None);
        let image = json!({"name": name, "bufferView": view, "mimeType": "image/png"});
        let image = self.push("images", image);
        let texture = json!({"name": name, "sampler": 0, "source": image});
        let texture = self.push("textures", texture);
        Ok(json!({"index": texture}))
    }

    /// Writes the file under a temporary name, then renames it.
    fn write(mut self, dir: &Path, name: &str) -> Res<()> {
        if let Some(root) = self.root.as_object_mut() {
            let textured = root["images"] != json!([]);
            root.retain(|k, _| textured || !matches!(k.as_str(), "images" | "textures" | "samplers"));
            root.insert("buffers".into(), json!([{"byteLength": self.bin.len()}]));
        }
        let mut text = serde_json::to_vec(&self.root)?;
        text.resize(text.len().next_multiple_of(4), b' ');
        let mut out = Vec::new();
        let total = 28 + text.len() + self.bin.len();
        for word in [0x4654_6c67, 2, total as u32, text.len() as u32, 0x4e4f_534a] {
            out.extend(u32::to_le_bytes(word));
        }
        out.extend(&text);
        for word in [self.bin.len() as u32, 0x004e_4942] {
            out.extend(u32::to_le_bytes(word));
        }
        out.extend(&self.bin);
        let temporary = dir.join(format!("{name}.tmp"));
        std::fs::write(&temporary, out)?;
        std::fs::rename(&temporary, dir.join(name))?;
        Ok(())
    }
}

/// An opaque material without a texture.
fn plain(name: &str, colour: [f64; 3], metallic: f64, roughness: f64) -> Value {
    let [r, g, b] = colour;
    json!({"name": name, "pbrMetallicRoughness": {"baseColorFactor": [r, g, b, 1.0],
        "metallicFactor": metallic, "roughnessFactor": roughness}})
}

/// A material without metal whose base colour is a texture.
fn painted(name: &str, texture: Value, roughness: f64) -> Value {
    json!({"name": name, "pbrMetallicRoughness": {"baseColorTexture": texture,
        "metallicFactor": 0.0, "roughnessFactor": roughness}})
}

// ---- The head ----

const EYE: V = V(0.215, 0.04, 0.40);
const EYE_RADIUS: f64 = 0.155;

/// The eye's almond opening in the plane of the face; negative inside. `p.0` is non-negative.
fn opening(p: V) -> f64 {
    let (x, y) = (p.0 - EYE.0, p.1 - EYE.1);
    let (a, b) = (x + 0.1 * y, y - 0.1 * x);
    (a.hypot(b + 0.112) - 0.187).max(a.hypot(b - 0.125) - 0.183)
}

/// Height above the middle of the smile, and how far the point lies within its width (1..0).
fn smile(p: V) -> (f64, f64) {
    let inside = smoothstep(0.25, 0.13, p.0.abs()) * smoothstep(0.1, 0.3, p.2);
    (p.1 + 0.375 - 1.3 * p.0 * p.0, inside)
}

/// Strength of the eyebrow at a point; `p.0` is non-negative.
fn eyebrow(p: V) -> f64 {
    let x = p.0 - 0.24;
    let width = 0.034 - 0.03 * x;
    let along = smoothstep(0.07, 0.11, p.0) * smoothstep(0.45, 0.36, p.0);
    bell((p.1 - 0.30 + 1.4 * x * x + 0.08 * x) / width) * along * smoothstep(0.0, 0.2, p.2)
}

const EAR: [V; 3] = [V(0.88, 0.2, -0.431), V(-0.18, 0.98, 0.088), V(0.44, 0.0, 0.898)];

fn ear(p: V) -> f64 {
    let c = V(0.67, 0.10, -0.10);
    let shell = ellipsoid(p, c, EAR, V(0.26, 0.25, 0.08));
    let tip = limb(p, c, c + EAR[0] * 0.30 + EAR[1] * 0.20, 0.10, 0.03);
    let bowl = c + EAR[2] * 0.075 + EAR[0] * 0.02;
    let bowl = ellipsoid(p, bowl, EAR, V(0.20, 0.19, 0.07));
    carve(join(shell, tip, 0.10), bowl, 0.03)
}

fn skin(p: V) -> f64 {
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

fn hair(p: V) -> f64 {
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

fn head_field(p: V) -> f64 {
    join(skin(p), hair(p), 0.03)
}

fn head_colour(p: V) -> V {
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
const HUB: V = V(0.0, 0.0, -0.25);
const ZOOM: f64 = 2.2;

fn head(dir: &Path) -> Res<()> {
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

// ---- The hands ----

/// A digit: its joints from the root to the tip, their radii, and the way the nail faces.
struct Digit {
    joints: [V; 4],
    radii: [f64; 4],
    back: V,
}

/// The four fingers, then the thumb, of a left hand with its palm down.
fn digits() -> Vec<Digit> {
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
fn nail(d: &Digit) -> ([V; 3], V) {
    let (tip, r) = (d.joints[3], d.radii[3]);
    let along = (tip - d.joints[2]).unit();
    let across = d.back.cross(along).unit();
    let out = along.cross(across);
    ([across, out, along], tip + out * (0.80 * r) - along * (0.1 * r))
}

fn nail_field(d: &Digit, p: V) -> f64 {
    let (frame, centre) = nail(d);
    ellipsoid(p, centre, frame, V(0.78, 0.32, 1.0) * d.radii[3])
}

fn digit_field(d: &Digit, p: V) -> f64 {
    let mut f = 1e3;
    for k in 0..3 {
        let (a, b, r) = (d.joints[k], d.joints[k + 1], d.radii[k]);
        let end = if k == 2 { 1.0 } else { 0.97 } * d.radii[k + 1];
        let bone = limb(p, a, b, 0.97 * r, end);
        f = join(f, join(bone, (p - a).len() - 1.02 * r, 0.06), 0.03);
    }
    join(f, nail_field(d, p), 0.015)
}

fn hand_field(digits: &[Digit], p: V) -> f64 {
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

fn hand_colour(digits: &[Digit], p: V) -> V {
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
fn hands(dir: &Path) -> Res<()> {
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

// ---- The knot and the leaf ----

/// A tube around the (2,3) torus knot, with `nu` cells along and `nv` around.
fn knot(dir: &Path, name: &str, nu: usize, nv: usize) -> Res<()> {
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

/// A curved card whose texture cuts a leaf out of it.
fn leaf(dir: &Path) -> Res<()> {
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

fn main() -> Res<()> {
    let dir = std::env::args_os().nth(1).ok_or("usage: meshes DIR")?;
    let dir = Path::new(&dir);
    std::fs::create_dir_all(dir)?;
    head(dir)?;
    hands(dir)?;
    knot(dir, "knot", 784, 64)?;
    knot(dir, "knot-small", 63, 8)?;
    leaf(dir)
}
