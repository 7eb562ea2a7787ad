//! Balls and tubes as triangles, for geometries in whose chart they are no quadrics.
//!
//! A metric ball is the exponential image of a sphere in a frame; a tube around a curve is the exponential image of
//! the circles in the planes normal to it. Both are divided until no triangle is farther than [`DEVIATION`] of the
//! radius from the surface, judged in the metric at the middles of edges and faces (a flat triangle of the chart is
//! farthest from the surface there). Normals come from the differential of the map, so that shading is exact.

use super::embed::{Placed, differential, embed};
use crate::geometry::{Geodesic, Geometry, exponential};
use glam::{DVec3, DVec4};
use rayon::prelude::*;
use std::{collections::HashMap, f64::consts::TAU};

/// Largest distance of a triangle from the surface that it stands for, as a share of the radius: a fifth of a pixel for
/// a ball of 200 pixels across.
pub const DEVIATION: f64 = 2e-3;

/// Sides of a tube: a polygon of so many is [`DEVIATION`] / 2 away from its circle.
const SIDES: usize = 72;

/// Most rings of a tube and most subdivisions of a ball; a surface that needs more is too large for its space.
const MAX_RINGS: usize = 4096;
const MAX_LEVEL: u32 = 7;

/// Triangles of a surface.
#[derive(Debug)]
pub struct Surface {
    /// Vertices.
    pub placed: Vec<Placed>,
    /// Corners, as indices of vertices.
    pub triangles: Vec<[u32; 3]>,
}

/// A metric ball, or `None` where the radius is more than the exponential map can do.
pub fn ball<G: Geometry>(geometry: G, centre: DVec4, radius: f64) -> Option<Surface> {
    let axes = geometry.frame(centre);
    let map = |x: DVec3| exponential(geometry, centre, axes[0] * x.x + axes[1] * x.y + axes[2] * x.z);
    let mut sphere = Sphere::icosahedron();
    for level in 1..=MAX_LEVEL {
        sphere = sphere.divided();
        // Coarser ones are never good enough: the sagitta of the triangles alone is too large.
        if level < 4 {
            continue;
        }
        let placed: Vec<Placed> =
            sphere.points.par_iter().map(|&d| embed(geometry, map, d * radius, d, step(radius))).collect();
        let mut around = sphere.points.iter().map(|d| *d * radius);
        let near = placed.par_iter().all(|p| is_in_reach(geometry, centre, p.point, radius));
        if !near || !is_unfolded(geometry, map, DVec3::ZERO, &mut around, radius) {
            return None;
        }
        let true_point = |d: DVec3| embed(geometry, map, d.normalize() * radius, d.normalize(), step(radius));
        let deviates = |corners: &[u32; 3]| {
            let [a, b, c] = corners.map(|i| sphere.points[i as usize]);
            let [pa, pb, pc] = corners.map(|i| geometry.chart(placed[i as usize].point));
            [((pa + pb + pc) / 3.0, a + b + c), ((pa + pb) / 2.0, a + b)]
                .into_iter()
                .any(|(flat, d)| deviation(geometry, flat, true_point(d)) > DEVIATION * radius)
        };
        if !sphere.triangles.par_iter().any(deviates) {
            return Some(Surface { placed, triangles: sphere.triangles });
        }
    }
    None
}

/// A tube around the curve `axis` (point and unit tangent for a parameter in [0, 1]), or `None` where the radius is
/// more than the exponential map can do.
pub fn tube<G: Geometry>(geometry: G, axis: impl Fn(f64) -> Geodesic + Sync, radius: f64) -> Option<Surface> {
    // Long thin triangles have boxes that every ray meets: rings are at most so many radii apart.
    const SPACING: f64 = 8.0;
    let mut rings = ((axis_length(geometry, &axis) / (SPACING * radius)) as usize).clamp(1, 256).next_power_of_two();
    while rings <= MAX_RINGS {
        let stations = stations(geometry, &axis, 2 * rings);
        let ring = |i: usize, sides: usize| -> Vec<Placed> {
            let (t, normal) = stations[i];
            let map = |x: DVec3| normal_point(geometry, &axis, normal, x);
            let place = |k: usize| {
                let (sin, cos) = (TAU * k as f64 / sides as f64).sin_cos();
                let position = DVec3::new(radius * cos, radius * sin, t);
                embed(geometry, map, position, DVec3::new(cos, sin, 0.0), step(radius))
            };
            (0..sides).map(place).collect()
        };
        // Every second station is a ring, those between are where the wall is farthest from the tube. The chords along
        // the wall have half of the tolerance, those across the other half.
        const PROBES: usize = 8;
        let deviates = |i: usize| {
            let [before, between, after] = [2 * i, 2 * i + 1, 2 * i + 2].map(|i| ring(i, PROBES));
            (0..PROBES).any(|k| {
                let flat = (geometry.chart(before[k].point) + geometry.chart(after[k].point)) / 2.0;
                deviation(geometry, flat, between[k]) > 0.5 * DEVIATION * radius
            })
        };
        if (0..rings).into_par_iter().any(deviates) {
            rings *= 2;
            continue;
        }
        let placed: Vec<Placed> = (0..=rings).into_par_iter().flat_map_iter(|i| ring(2 * i, SIDES)).collect();
        let sound = (0..=rings).into_par_iter().all(|i| {
            let (t, normal) = stations[2 * i];
            let centre = axis(t).point;
            let map = |x: DVec3| normal_point(geometry, &axis, normal, x);
            let circle = (0..SIDES).map(|k| {
                let (sin, cos) = (TAU * k as f64 / SIDES as f64).sin_cos();
                DVec3::new(radius * cos, radius * sin, t)
            });
            let near = |k: usize| is_in_reach(geometry, centre, placed[i * SIDES + k].point, radius);
            is_unfolded(geometry, map, DVec3::Z * t, circle, radius) && (0..SIDES).all(near)
        });
        if !sound {
            return None;
        }
        let quad = |n: usize| {
            let (i, k) = (n / SIDES, n % SIDES);
            let corner = |i: usize, k: usize| (i * SIDES + k % SIDES) as u32;
            let [a, b, c, d] = [corner(i, k), corner(i, k + 1), corner(i + 1, k + 1), corner(i + 1, k)];
            [[a, b, c], [a, c, d]]
        };
        return Some(Surface { placed, triangles: (0..rings * SIDES).flat_map(quad).collect() });
    }
    None
}

/// A map has folded over where its volume is less than this share of that at the centre.
const FOLDED: f64 = 1e-3;

/// Step of differences for surfaces of this radius.
fn step(radius: f64) -> f64 {
    1e-5 * radius.max(1e-3)
}

/// Whether a map keeps its orientation, and some of its volume, from a centre out to points around it.
fn is_unfolded<G: Geometry>(
    geometry: G,
    map: impl Fn(DVec3) -> DVec4,
    centre: DVec3,
    mut around: impl Iterator<Item = DVec3>,
    radius: f64,
) -> bool {
    let volume = |x: DVec3| {
        differential(geometry, &map, x, step(radius)).determinant() * geometry.volume_density(geometry.chart(map(x)))
    };
    let at_centre = volume(centre);
    around.all(|x| volume(x) / at_centre > FOLDED)
}

/// Whether a point at the end of a geodesic of this length is in the chart, and not nearer by another way. A geometry
/// without distances says nothing about the latter.
fn is_in_reach<G: Geometry>(geometry: G, centre: DVec4, point: DVec4, radius: f64) -> bool {
    let shown = geometry.unchart(geometry.chart(point));
    let in_chart = shown.is_some_and(|p| (p - point).abs().max_element() < 1e-6 * (1.0 + point.abs().max_element()));
    // A distance that is not a number is not nearer.
    let is_nearer = geometry.distance(centre, point) < radius * (1.0 - 1e-4);
    in_chart && !is_nearer
}

/// Distance in the metric, along the normal, of a chart point from the surface at a point nearby.
fn deviation<G: Geometry>(geometry: G, flat: DVec3, on_surface: Placed) -> f64 {
    let offset = geometry.unchart_vector(on_surface.point, flat - geometry.chart(on_surface.point));
    geometry.inner(on_surface.point, offset, on_surface.normal).abs()
}

/// Length of a curve, from the tangents at some of its points.
fn axis_length<G: Geometry>(geometry: G, axis: impl Fn(f64) -> Geodesic) -> f64 {
    const PIECES: usize = 8;
    let piece = |i: usize| {
        let [from, to] = [i, i + 1].map(|i| axis(i as f64 / PIECES as f64).point);
        geometry.norm(from, geometry.unchart_vector(from, geometry.chart(to) - geometry.chart(from)))
    };
    (0..PIECES).map(piece).sum()
}

/// Parameters along the curve, `count + 1` of them, with a normal that turns as little as possible from one to the next:
/// its components in the geometry's frame.
fn stations<G: Geometry>(geometry: G, axis: impl Fn(f64) -> Geodesic, count: usize) -> Vec<(f64, DVec3)> {
    let (mut normal, _) = tangent(geometry, axis(0.0)).any_orthonormal_pair();
    let mut station = |i: usize| {
        let t = i as f64 / count as f64;
        normal = normals(tangent(geometry, axis(t)), normal)[0];
        (t, normal)
    };
    (0..=count).map(&mut station).collect()
}

/// Direction of the curve: components in the geometry's frame, also where that is orthonormal in an indefinite metric.
fn tangent<G: Geometry>(geometry: G, g: Geodesic) -> DVec3 {
    let component = |axis| geometry.inner(g.point, axis, g.velocity) / geometry.inner(g.point, axis, axis);
    DVec3::from_array(geometry.frame(g.point).map(component)).normalize()
}

/// Two unit vectors normal to a tangent and to each other, the first near to a given one.
fn normals(tangent: DVec3, near: DVec3) -> [DVec3; 2] {
    let u = (near - tangent * tangent.dot(near)).normalize();
    [u, tangent.cross(u)]
}

/// The end of the geodesic that leaves the curve at parameter `x.z` with normal velocity `(x.x, x.y)`.
fn normal_point<G: Geometry>(geometry: G, axis: impl Fn(f64) -> Geodesic, normal: DVec3, x: DVec3) -> DVec4 {
    let g = axis(x.z);
    let frame = geometry.frame(g.point);
    let [u, v] = normals(tangent(geometry, g), normal);
    let w = u * x.x + v * x.y;
    exponential(geometry, g.point, frame[0] * w.x + frame[1] * w.y + frame[2] * w.z)
}

/// A triangulated unit sphere.
struct Sphere {
    points: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
}

impl Sphere {
    fn icosahedron() -> Self {
        let golden = 0.5 * (1.0 + 5.0_f64.sqrt());
        // The even permutations of (0, ±1, ±φ).
        let points: Vec<DVec3> = (0..12)
            .map(|i| {
                let (a, b) = ([1.0, -1.0][i & 1], [golden, -golden][i >> 1 & 1]);
                [DVec3::new(0.0, a, b), DVec3::new(b, 0.0, a), DVec3::new(a, b, 0.0)][i >> 2].normalize()
            })
            .collect();
        // Its faces are the triples of neighbours, whose products are 1/√5.
        let near = |i: usize, j: usize| points[i].dot(points[j]) > 0.4;
        let mut triangles = Vec::new();
        for i in 0..12 {
            for j in 0..i {
                for k in (0..j).filter(|&k| near(i, j) && near(j, k) && near(i, k)) {
                    let outwards = points[i].dot(points[j].cross(points[k])) > 0.0;
                    let [b, c] = if outwards { [j, k] } else { [k, j] };
                    triangles.push([i as u32, b as u32, c as u32]);
                }
            }
        }
        Self { points, triangles }
    }

    /// Each triangle in four.
    fn divided(&self) -> Self {
        let mut points = self.points.clone();
        let mut middles = HashMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                points.push((points[a as usize] + points[b as usize]).normalize());
                points.len() as u32 - 1
            })
        };
        let mut triangles = Vec::with_capacity(4 * self.triangles.len());
        for &[a, b, c] in &self.triangles {
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            triangles.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
        }
        Self { points, triangles }
    }
}
