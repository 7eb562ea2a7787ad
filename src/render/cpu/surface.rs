//! Hits and what is there. Twins: `shaders/stage/{triangle,quadric,mask,hit,surface}.glsl`, `shared/sampling.glsl`.

use super::traverse::Tracer;
use crate::{
    geometry::{Geometry, Quadric, Segment},
    integrate::{Dense, Method},
    render::{
        bvh::Primitive,
        world::{World, WorldQuadric},
    },
    scene::{Shading, Texture, Wrap, coordinate_ramp},
    shader_io::TriangleShading,
    space::{
        stepped,
        walk::{Path, Status},
    },
};
use glam::{DVec2, DVec3, DVec4, Vec2, Vec3};

/// A value of s beyond every segment.
pub(super) const NO_HIT: f64 = 2.0;

/// What shading needs to know of a hit.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// Unit tangent vector on the side of the viewer; zero unless the shading needs it.
    pub normal: DVec4,
    /// Chart conormal on the side of the viewer.
    pub conormal: DVec3,
    /// Linear base colour, texture included.
    pub base_color: DVec3,
    /// Linear light given off.
    pub emission: DVec3,
    /// 0 dielectric, 1 metal.
    pub metallic: f64,
    /// Perceptual roughness.
    pub roughness: f64,
    /// Index of the scene's object.
    pub object: u32,
}

/// s and the weights of the second and third corner, or s = [`NO_HIT`].
pub(super) fn triangle_hit<G: Geometry>(segment: Segment, corners: [DVec3; 3]) -> (f64, DVec2) {
    if G::STRAIGHT { triangle_hit_straight(segment, corners) } else { triangle_hit_arc(segment, corners) }
}

fn triangle_hit_straight(segment: Segment, [a, b, c]: [DVec3; 3]) -> (f64, DVec2) {
    let (a, b, c) = (a - segment.origin, b - segment.origin, c - segment.origin);
    let wa = segment.direction.dot(b.cross(c));
    let wb = segment.direction.dot(c.cross(a));
    let wc = segment.direction.dot(a.cross(b));
    if wa.min(wb).min(wc) < 0.0 && wa.max(wb).max(wc) > 0.0 {
        return (NO_HIT, DVec2::ZERO);
    }
    let sum = wa + wb + wc;
    let normal = (b - a).cross(c - a);
    let rate = normal.dot(segment.direction);
    if sum == 0.0 || rate == 0.0 {
        return (NO_HIT, DVec2::ZERO);
    }
    let s = normal.dot(a) / rate;
    if (0.0..=1.0).contains(&s) { (s, DVec2::new(wb / sum, wc / sum)) } else { (NO_HIT, DVec2::ZERO) }
}

/// A point this far outside of a triangle, in units of the coordinates at hand, still lies in it: so that arcs find no gap
/// between neighbours. The shaders have their own value.
const ON_EDGE: f64 = 2e-14;

/// The arc's height over the triangle's plane is a quadratic of s; its roots in order, the first one inside counts.
fn triangle_hit_arc(segment: Segment, [a, b, c]: [DVec3; 3]) -> (f64, DVec2) {
    let (edge_b, edge_c) = (b - a, c - a);
    let normal = edge_b.cross(edge_c);
    let area = normal.length_squared();
    // height + (rate + bend) s − bend s².
    let (height, bend) = (normal.dot(segment.origin - a), normal.dot(segment.bend));
    let linear = normal.dot(segment.direction) + bend;
    let discriminant = linear * linear + 4.0 * bend * height;
    if discriminant < 0.0 || area == 0.0 {
        return (NO_HIT, DVec2::ZERO);
    }
    let q = 0.5 * (linear + discriminant.sqrt().copysign(linear));
    let [one, other] = [if q == 0.0 { NO_HIT } else { -height / q }, if bend == 0.0 { NO_HIT } else { q / bend }];
    for s in [one.min(other), one.max(other)] {
        if !(0.0..=1.0).contains(&s) {
            continue;
        }
        let at = segment.at(s) - a;
        let [wb, wc] = [normal.dot(at.cross(edge_c)), normal.dot(edge_b.cross(at))];
        // Each weight is a distance from an edge, times the edge's length and the normal's.
        let slack = ON_EDGE * (at.abs() + a.abs() + segment.origin.abs()).max_element();
        let inside =
            |weight: f64, edge: DVec3| weight >= 0.0 || weight >= -slack * (area * edge.length_squared()).sqrt();
        if inside(wb, edge_c) && inside(wc, edge_b) && inside(area - wb - wc, edge_c - edge_b) {
            return (s, DVec2::new(wb, wc) / area);
        }
    }
    (NO_HIT, DVec2::ZERO)
}

/// Smallest s in [0, 1] at which the segment meets the surface, or [`NO_HIT`]. An eye inside sees the far wall. For straight
/// segments: where others are needed there are no quadrics.
pub(super) fn quadric_hit(segment: Segment, quadric: &WorldQuadric) -> f64 {
    let Quadric { forms, quadratic: k2, constant: k0 } = quadric.surface;
    let (o, d) = (segment.origin, segment.direction);
    let f = DVec3::from(forms.map(|l| l.dot(o.extend(1.0))));
    let g = DVec3::from(forms.map(|l| l.truncate().dot(d)));
    let (oo, od, dd) = (o.dot(o), o.dot(d), d.dot(d));
    let (fg, gg) = (f.dot(g), g.dot(g));
    let (a, b, c) = (gg - k2 * dd, fg - k2 * od, f.dot(f) - k2 * oo - k0);
    // b² − ac with (f·g)² − f² g² replaced by −|f × g|²: what is left are terms of the size of the result.
    let small = gg * (k2 * oo + k0) + k2 * (dd * f.dot(f) - 2.0 * fg * od) + k2 * (k2 * (od * od - dd * oo) - dd * k0);
    let discriminant = small - f.cross(g).length_squared();
    if discriminant < 0.0 {
        return NO_HIT;
    }
    // The root that does not cancel, and the other from the product of both.
    let q = -(b + if b < 0.0 { -1.0 } else { 1.0 } * discriminant.sqrt());
    let s0 = if q == 0.0 { NO_HIT } else { c / q };
    let s1 = if a == 0.0 { NO_HIT } else { q / a };
    let visible = |s: f64| {
        let at = (o + d * s).extend(1.0);
        (0.0..=1.0).contains(&s) && quadric.clip.iter().all(|clip| clip.dot(at) >= 0.0)
    };
    [s0.min(s1), s0.max(s1)].into_iter().find(|s| visible(*s)).unwrap_or(NO_HIT)
}

/// Weights of the second and third corner of a point of the triangle's plane, clamped to the triangle.
fn triangle_weights([a, b, c]: [DVec3; 3], at: DVec3) -> DVec2 {
    let normal = (b - a).cross(c - a);
    let area = normal.length_squared();
    if area == 0.0 {
        return DVec2::ZERO;
    }
    let wb = (normal.dot((at - a).cross(c - a)) / area).clamp(0.0, 1.0);
    let wc = (normal.dot((b - a).cross(at - a)) / area).clamp(0.0, 1.0 - wb);
    DVec2::new(wb, wc)
}

/// Steps of [`refine`]: the second reaches f32's rounding, the third that of f64.
const REFINE_STEPS: usize = 4;

/// The curve parameter in `[0, u_end]` at which `value` (of a primitive's form along the curve) vanishes, near that of
/// the arc's hit.
///
/// Secant steps, the first one with the slope along the arc, `rate`. For arcs of length h the start is off by
/// O(h³), the first step by O(h⁵), the second by O(h⁸), each further one by the product of the two before it. Steps stay
/// in the segment's range. What comes out is the best of all steps, so a curve that passes by a surface that its arc
/// just touches ends no farther from it than the arc's tolerance.
pub fn refine(value: impl Fn(f64) -> f64, start: f64, rate: f64, u_end: f64, steps: usize) -> f64 {
    let mut u = start.clamp(0.0, u_end);
    let (mut off, mut slope) = (value(u), rate);
    let mut best = (u, off.abs());
    for _ in 0..steps {
        if off == 0.0 || slope == 0.0 {
            break;
        }
        let next = (u - off / slope).clamp(0.0, u_end);
        let off_next = value(next);
        if next == u || off_next.is_nan() {
            break;
        }
        slope = (off_next - off) / (next - u);
        (u, off) = (next, off_next);
        if off.abs() < best.1 {
            best = (u, off.abs());
        }
    }
    best.0
}

/// Whether a triangle has a hole where the segment meets it.
pub(super) fn is_hole(world: &World, shading: &TriangleShading, weights: DVec2) -> bool {
    let material = &world.materials[shading.material as usize];
    let Some(cutoff) = material.alpha_cutoff else { return false };
    let texel = material.base_texture.map_or(1.0, |t| bilinear(&world.textures[t], uv_at(shading, weights)).w);
    f64::from(material.base_color[3]) * texel < f64::from(cutoff)
}

fn uv_at(shading: &TriangleShading, weights: DVec2) -> DVec2 {
    let [a, b, c] = [shading.uv_a, shading.uv_b, shading.uv_c].map(|uv| Vec2::from(uv).as_dvec2());
    a + (b - a) * weights.x + (c - a) * weights.y
}

/// Bilinear lookup. Coordinates are taken modulo 64 repeats first, as the shader does.
fn bilinear(texture: &Texture, uv: DVec2) -> DVec4 {
    let uv = uv - (uv / 64.0).floor() * 64.0;
    let at = uv * DVec2::new(f64::from(texture.width), f64::from(texture.height)) - 0.5;
    let corner = at.floor();
    let part = at - corner;
    let (x, y) = (corner.x as i64, corner.y as i64);
    let texel = |x: i64, y: i64| {
        let x = wrap(x, i64::from(texture.width), texture.wrap[0]);
        let y = wrap(y, i64::from(texture.height), texture.wrap[1]);
        DVec4::from_array(texture.texels[y * texture.width as usize + x].map(f64::from))
    };
    let above = texel(x, y).lerp(texel(x + 1, y), part.x);
    let below = texel(x, y + 1).lerp(texel(x + 1, y + 1), part.x);
    above.lerp(below, part.y)
}

fn wrap(i: i64, n: i64, mode: Wrap) -> usize {
    let wrapped = match mode {
        Wrap::Clamp => i.clamp(0, n - 1),
        Wrap::Repeat => i.rem_euclid(n),
        Wrap::Mirror => {
            let j = i.rem_euclid(2 * n);
            if j < n { j } else { 2 * n - 1 - j }
        }
    };
    wrapped as usize
}

impl<G: Geometry> Tracer<'_, G> {
    /// The step of the integrator that the path is on; none where rays follow the geometry's own flow.
    fn step_of(&self, path: &Path) -> Option<Dense<f64>> {
        let method = self.uses.method;
        (method != Method::Exact).then(|| stepped::current(self.geometry, method, path))
    }

    /// Curve parameter at which the path meets a plane of the chart, given by a normal and a point, that its segment meets
    /// at `s`.
    fn refined(&self, path: &Path, segment: Segment, (normal, corner): (DVec3, DVec3), s: f64) -> f64 {
        let dense = self.step_of(path);
        let value = |u: f64| {
            let at = match &dense {
                Some(dense) => dense.point(u / dense.h).to_f64(),
                None => self.geometry.chart(self.geometry.advance(path.state, u).point),
            };
            normal.dot(at - corner)
        };
        let rate = normal.dot(segment.tangent(s));
        refine(value, s * path.u_end, rate / path.u_end, path.u_end, REFINE_STEPS)
    }

    /// Moves the path's state to the hit and reads the surface there.
    pub(super) fn stage_closest_hit(&self, path: &mut Path, segment: Segment, primitive: Primitive) -> Surface {
        let quadric = |index: u32| &self.world.quadrics[index as usize];
        let corners = |name: u32| self.meshes.triangles[self.triangle(name)];
        let (s, mut weights) = match primitive {
            Primitive::Quadric(index) => (quadric_hit(segment, quadric(index)), DVec2::ZERO),
            Primitive::Triangle(name) => triangle_hit::<G>(segment, corners(name)),
        };

        // The state at the hit, on the geodesic itself.
        let (mut at, tangent) = (segment.at(s), segment.tangent(s));
        let u = if G::STRAIGHT && self.uses.method == Method::Exact {
            self.geometry.parameter(path.state, at)
        } else {
            let plane = match primitive {
                // The point that the segment meets is where the curve passes the plane through it, across.
                Primitive::Quadric(_) => (segment.direction, at),
                Primitive::Triangle(name) => {
                    let [a, b, c] = corners(name);
                    ((b - a).cross(c - a), a)
                }
            };
            self.refined(path, segment, plane, s)
        };
        path.status = Status::Hit;
        match self.step_of(path) {
            Some(dense) => stepped::arrive(self.geometry, &dense, path, u),
            None => {
                path.travelled += self.geometry.length(path.state, u);
                path.state = self.geometry.advance(path.state, u);
            }
        }
        if !G::STRAIGHT {
            at = self.geometry.chart(path.state.point);
        }

        let (conormal, away, material, object, uv) = match primitive {
            Primitive::Quadric(index) => {
                let quadric = quadric(index);
                let conormal = quadric.surface.gradient(at);
                (conormal, conormal.dot(tangent) > 0.0, quadric.material, quadric.object, DVec2::ZERO)
            }
            Primitive::Triangle(name) => {
                let (corners, shading) = (corners(name), &self.meshes.shading[self.triangle(name)]);
                if !G::STRAIGHT {
                    weights = triangle_weights(corners, at);
                }
                let [a, b, c] =
                    [shading.conormal_a, shading.conormal_b, shading.conormal_c].map(|n| Vec3::from(n).as_dvec3());
                let conormal = a + (b - a) * weights.x + (c - a) * weights.y;
                // Which side is seen follows from the plane of the triangle, not from the interpolated normal.
                let plane = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
                let away = (plane.dot(tangent) > 0.0) == (plane.dot(conormal) > 0.0);
                (conormal, away, shading.material, shading.object, uv_at(shading, weights))
            }
        };

        let conormal = if away { -conormal } else { conormal };
        let mut surface = Surface {
            normal: DVec4::ZERO,
            conormal,
            base_color: DVec3::ZERO,
            emission: DVec3::ZERO,
            metallic: 0.0,
            roughness: 0.0,
            object,
        };
        if self.uses.shading != Shading::Riemannian {
            return surface;
        }
        let material = &self.world.materials[material as usize];
        surface.normal = self.geometry.raise(path.state.point, conormal);
        surface.base_color = DVec4::from_array(material.base_color.map(f64::from)).truncate();
        surface.emission = material.emission.map(f64::from).into();
        surface.metallic = material.metallic.into();
        surface.roughness = material.roughness.into();
        if self.uses.coordinates {
            let (scale, shift) = coordinate_ramp(material);
            let place = self.geometry.chart(path.state.point) * scale + shift;
            surface.base_color *= place.clamp(DVec3::ZERO, DVec3::ONE);
        }
        if self.uses.textures {
            if let Some(texture) = material.base_texture {
                surface.base_color *= bilinear(&self.world.textures[texture], uv).truncate();
            }
            if let Some(texture) = material.surface_texture {
                let texel = bilinear(&self.world.textures[texture], uv);
                surface.roughness *= texel.y;
                surface.metallic *= texel.z;
            }
        }
        surface
    }
}
