//! Forward and backward error of the rays of a picture.
//!
//! A ray of an integrator that leaves the eye through a point of the picture hits something at a chart point `q` of a cell
//! after the length `t`, having passed some faces. Its **forward error** is the distance, in the metric at `q`, from there
//! to where the exact geodesic of the same direction, length and faces comes to. Its **backward error** is how far its
//! point of the picture must move, in pixels, so that an exact geodesic through the same faces meets `q` itself. Where
//! geodesics part exponentially the first says little, because the footprint of a pixel grows as fast; the second is the
//! honest figure.
//!
//! The exact way is that of the closed flow in the model, carried through the faces by their pairings at its end alone; the
//! movement is found by Newton's method on the point of the picture and the length.

use super::quantile;
use crate::{
    geometry::Geometry,
    render::cpu::{Counts, traverse::Tracer},
    space::walk::Status,
};
use glam::{DMat3, DVec3};

/// Errors of some rays.
#[derive(Clone, Debug, Default)]
pub struct RayErrors {
    /// Distances from the exact end.
    pub forward: Vec<f64>,
    /// Movements in pixels; infinite where none was found.
    pub backward: Vec<f64>,
}

impl RayErrors {
    /// Median and the value that 99 % of the rays do not exceed, forward and backward.
    pub fn summary(&self) -> [Option<f64>; 4] {
        let both = |errors: &[f64]| [quantile(errors, 0.5), quantile(errors, 0.99)];
        let ([a, b], [c, d]) = (both(&self.forward), both(&self.backward));
        [a, b, c, d]
    }

    /// Share of the rays for which no movement was found.
    pub fn unresolved(&self) -> f64 {
        self.backward.iter().filter(|x| x.is_infinite()).count() as f64 / self.backward.len().max(1) as f64
    }
}

/// Steps of Newton's method. The start is off by the error that is sought, so few are needed.
const STEPS: usize = 12;

/// Pixels and lengths by which derivatives are taken.
const NUDGE: f64 = 1e-5;

/// Movements below this, in pixels, are what differences leave.
const CONVERGED: f64 = 1e-9;

/// Errors of the rays through every `stride`-th pixel in both directions that hit something.
pub fn ray_errors<G: Geometry>(geometry: G, tracer: &Tracer<'_, G>, size: [u32; 2], stride: u32) -> RayErrors {
    let mut errors = RayErrors::default();
    let first = stride / 2;
    for y in (first..size[1]).step_by(stride as usize) {
        for x in (first..size[0]).step_by(stride as usize) {
            let at = [f64::from(x) + 0.5, f64::from(y) + 0.5];
            if let Some([forward, backward]) = ray_error(geometry, tracer, at) {
                errors.forward.push(forward);
                errors.backward.push(backward);
            }
        }
    }
    errors
}

/// Forward and backward error of the ray through a point of the picture, if it hits something.
fn ray_error<G: Geometry>(geometry: G, tracer: &Tracer<'_, G>, at: [f64; 2]) -> Option<[f64; 2]> {
    let mut faces = Vec::new();
    let (path, _) = tracer.path(tracer.geodesic(at), &mut Counts::default(), |face, _| faces.push(face));
    if path.status != Status::Hit {
        return None;
    }
    let hit = path.state.point;
    // Way from the hit to the exact end, in the frame at the hit.
    let frame = geometry.frame(hit);
    let off = |unknown: DVec3| -> DVec3 {
        let start = tracer.geodesic([unknown.x, unknown.y]);
        let mut end = geometry.flow(start, unknown.z);
        for &face in &faces {
            end = geometry.apply(tracer.pairing(face), end);
        }
        let way = geometry.unchart_vector(hit, geometry.chart(end.point) - geometry.chart(hit));
        DVec3::from_array(frame.map(|axis| geometry.inner(hit, axis, way))) * geometry.signature()
    };
    let start = DVec3::new(at[0], at[1], path.travelled);
    let mut unknown = start;
    let mut residual = off(unknown);
    let forward = residual.length();
    for _ in 0..STEPS {
        let column = |axis: DVec3| (off(unknown + axis * NUDGE) - off(unknown - axis * NUDGE)) / (2.0 * NUDGE);
        let step = DMat3::from_cols(column(DVec3::X), column(DVec3::Y), column(DVec3::Z)).inverse() * residual;
        if !step.is_finite() {
            break;
        }
        unknown -= step;
        residual = off(unknown);
        if step.truncate().length() <= CONVERGED.max(1e-4 * (unknown - start).truncate().length()) {
            return Some([forward, (unknown - start).truncate().length()]);
        }
    }
    Some([forward, f64::INFINITY])
}
