//! Riemannian shading. Twins: `shaders/stage/shade.glsl`, `shaders/shared/brdf.glsl`.

use super::{Counts, surface::Surface, traverse::Tracer};
use crate::{
    geometry::{Geodesic, Geometry},
    render::world::lights::WorldLight,
    shader_io::{COUNT_SHADOW_RAYS, COUNT_SHADOW_SEGMENTS, MIN_LIGHT_AREA, SHADOW_BOUNCES, SHADOW_OFFSET},
    space::walk::{Path, Status},
};
use glam::DVec3;

/// Lambert plus the Trowbridge–Reitz lobe of the glTF 2.0 specification, appendix B: reflectance times π times n·l.
/// `nl`, `nv`: normal with light and viewer, `lv`: light with viewer.
fn brdf(surface: &Surface, nl: f64, nv: f64, lv: f64) -> DVec3 {
    // Below this roughness the highlight of a point light is smaller than any pixel.
    let alpha = (surface.roughness * surface.roughness).max(2e-3);
    let a2 = alpha * alpha;
    let nv = nv.max(1e-4);
    let half_length2 = (2.0 + 2.0 * lv).max(1e-8);
    let nh2 = ((nl + nv) * (nl + nv) / half_length2).min(1.0);
    let vh = half_length2.sqrt() * 0.5;
    let d = nh2 * (a2 - 1.0) + 1.0;
    let distribution = a2 / (d * d);
    let visibility = 0.5 / (nl * (nv * nv * (1.0 - a2) + a2).sqrt() + nv * (nl * nl * (1.0 - a2) + a2).sqrt());
    let f0 = DVec3::splat(0.04).lerp(surface.base_color, surface.metallic);
    let m = 1.0 - vh.min(1.0);
    let fresnel = f0 + (DVec3::ONE - f0) * (m * m * m * m * m);
    let diffuse = (DVec3::ONE - fresnel) * (1.0 - surface.metallic) * surface.base_color;
    (diffuse + fresnel * distribution * visibility) * nl
}

impl<G: Geometry> Tracer<'_, G> {
    /// Whether something stands between a surface point and a light at distance `range` in direction of `state`.
    fn shade_occluded(&self, state: Geodesic, range: f64, cell: usize, counts: &mut Counts) -> bool {
        self.count(counts, COUNT_SHADOW_RAYS);
        let mut path = Path::new(state, cell, range);
        while path.status == Status::Flying {
            let Some(segment) = self.segment(&mut path, SHADOW_BOUNCES, |_| ()) else { break };
            self.count(counts, COUNT_SHADOW_SEGMENTS);
            self.trace_shadow_segment(&mut path, segment, counts);
        }
        path.status == Status::Hit
    }

    /// Light of one image of a point light.
    fn shade_light(&self, light: &WorldLight, path: &Path, surface: &Surface, nv: f64, counts: &mut Counts) -> DVec3 {
        let geometry = self.geometry;
        let point = path.state.point;
        // Images of the same box that are out of range are told before anything is computed.
        if geometry.closeness(point, light.point) < light.closest {
            return DVec3::ZERO;
        }
        let (direction, range) = geometry.log(point, light.point);
        let nl = geometry.inner(point, surface.normal, direction);
        if range >= light.range || nl <= 0.0 {
            return DVec3::ZERO;
        }
        if let Some((axis, cosine)) = light.spot {
            let (outward, _) = geometry.log(light.point, point);
            if geometry.inner(light.point, axis, outward) < cosine {
                return DVec3::ZERO;
            }
        }
        if self.uses.shadows && light.shadows {
            // From a point a little above the surface, so that it does not shadow itself.
            let above = geometry.flow(Geodesic { point, velocity: surface.normal }, SHADOW_OFFSET.into());
            let (towards, to_light) = geometry.log(above.point, light.point);
            let state = Geodesic { point: above.point, velocity: towards };
            // And to a point a little before the light: what it is fixed to does not hide it from one side at random.
            let reach = to_light - f64::from(SHADOW_OFFSET);
            if reach > 0.0 && self.shade_occluded(state, reach, path.cell, counts) {
                return DVec3::ZERO;
            }
        }
        let window = 1.0 - (range / light.range).powi(4);
        let area = geometry.area_density(Geodesic { point, velocity: direction }, range).max(MIN_LIGHT_AREA.into());
        let lv = -geometry.inner(point, path.state.velocity, direction);
        DVec3::from(light.color.map(f64::from)) * (window * window / area) * brdf(surface, nl, nv, lv)
    }

    /// Linear colour of the path's hit.
    pub(super) fn stage_shade(&self, path: &Path, surface: &Surface, counts: &mut Counts) -> DVec3 {
        let settings = &self.world.settings;
        let Geodesic { point, velocity } = path.state;
        let nv = -self.geometry.inner(point, velocity, surface.normal);
        let mut color = surface.emission + DVec3::from(settings.ambient.map(f64::from)) * surface.base_color;
        if self.uses.headlight && nv > 0.0 {
            // The ray itself is the geodesic to the viewer's light: nothing can stand in between.
            let back = Geodesic { point, velocity: -velocity };
            let area = self.geometry.area_density(back, path.travelled).max(MIN_LIGHT_AREA.into());
            color += DVec3::from(settings.headlight.map(f64::from)) / area * brdf(surface, nv, nv, 1.0);
        }
        if self.uses.lights {
            for light in self.world.lights.near(path.cell, self.geometry.chart(point)) {
                color += self.shade_light(light, path, surface, nv, counts);
            }
        }
        if self.uses.fog {
            let background = DVec3::from(settings.background.map(f64::from));
            color = background.lerp(color, (-settings.fog * path.travelled).exp());
        }
        color
    }
}
