//! A pixel's geodesic, its loop of segments, and what the picture shows. Twin: `shaders/stage/raygen.glsl`.

use super::{Counts, surface::Surface, traverse::Tracer};
use crate::{
    geometry::{Geodesic, Geometry},
    render::{clock, plan::Heat},
    scene::Shading,
    shader_io::{
        COUNT_BOUNCES, COUNT_HITS, COUNT_LOST, COUNT_RAYS, COUNT_SEGMENTS, FOG_HIDES, NONE, SEGMENTS_PER_BOUNCE,
    },
    space::walk::{Path, Status},
};
use glam::DVec3;
use std::time::Duration;

impl<G: Geometry> Tracer<'_, G> {
    /// The geodesic through a point of the picture, in pixels from its upper left corner.
    pub fn geodesic(&self, at: [f64; 2]) -> Geodesic {
        let [left, right, down, up] = self.shot.tangents;
        let x = left + (right - left) * at[0] / f64::from(self.shot.size[0]);
        let y = up + (down - up) * at[1] / f64::from(self.shot.size[1]);
        let direction = self.shot.eye.vector(DVec3::new(x, y, -1.0)) / (1.0 + x * x + y * y).sqrt();
        Geodesic { point: self.shot.eye.point, velocity: direction }
    }

    /// Follows a ray from the eye to its end. Faces that it crosses are reported with the length at which.
    pub fn path(
        &self,
        start: Geodesic,
        counts: &mut Counts,
        mut crossed: impl FnMut(usize, &Path),
    ) -> (Path, Option<Surface>) {
        let settings = &self.world.settings;
        let limit = if self.uses.max_distance { settings.max_distance.unwrap_or(f64::INFINITY) } else { f64::INFINITY };
        let mut path = Path::new(start, self.shot.eye.cell, limit);
        let limit_of_segments = (self.bounces + 1).saturating_mul(SEGMENTS_PER_BOUNCE);
        let mut surface = None;
        let mut faces = Vec::new();
        self.count(counts, COUNT_RAYS);
        let hidden = |path: &Path| self.uses.fog && settings.fog * path.travelled > f64::from(FOG_HIDES);
        while path.status == Status::Flying && path.segments < limit_of_segments && !hidden(&path) {
            let segment = self.segment(&mut path, self.bounces, |face| faces.push(face));
            if let Some(segment) = segment {
                self.count(counts, COUNT_SEGMENTS);
                surface = self.trace_segment(&mut path, segment, counts, |face| faces.push(face));
            }
            faces.drain(..).for_each(|face| crossed(face, &path));
        }
        match path.status {
            Status::Hit => self.count(counts, COUNT_HITS),
            Status::Lost => self.count(counts, COUNT_LOST),
            Status::Flying | Status::Gone => {}
        }
        if self.uses.counters {
            counts[COUNT_BOUNCES as usize] += u64::from(path.bounces);
        }
        (path, surface)
    }

    /// The mean of a pixel's samples.
    pub(super) fn pixel(&self, [x, y]: [u32; 2], offsets: &[[f64; 2]], counts: &mut Counts) -> [f32; 4] {
        let before = self.uses.heat.map(|heat| Cost::so_far(heat, counts));
        let mut sum = DVec3::ZERO;
        for offset in offsets {
            let start = self.geodesic([f64::from(x) + offset[0], f64::from(y) + offset[1]]);
            let (path, surface) = self.path(start, counts, |_, _| ());
            sum += self.result(&path, surface.as_ref(), counts);
        }
        if let (Some(heat), Some(before)) = (self.uses.heat, before) {
            sum = DVec3::splat(Cost::so_far(heat, counts).since(before));
        }
        let mean = (sum / offsets.len() as f64).as_vec3();
        [mean.x, mean.y, mean.z, 1.0]
    }

    /// What the picture shows: a colour, or a raw value in all three channels.
    fn result(&self, path: &Path, surface: Option<&Surface>, counts: &mut Counts) -> DVec3 {
        let raw = match (self.uses.shading, surface) {
            (Shading::Riemannian, Some(surface)) => return self.stage_shade(path, surface, counts),
            (Shading::Riemannian, None) => return self.world.settings.background.map(f64::from).into(),
            (Shading::Normals, Some(surface)) => return surface.conormal.normalize() * 0.5 + 0.5,
            (Shading::Normals, None) => 0.0,
            (Shading::Distance, Some(_)) => path.travelled,
            (Shading::Distance, None) => f64::INFINITY,
            (Shading::Bounces, _) => path.bounces.into(),
            (Shading::Segments, _) => path.segments.into(),
            (Shading::Cell, _) if path.label == NONE => -1.0,
            (Shading::Cell, _) => path.label.into(),
            (Shading::Object, surface) => surface.map_or(-1.0, |s| s.object.into()),
        };
        DVec3::splat(raw)
    }
}

/// What pixels have cost so far.
#[derive(Clone, Copy)]
enum Cost {
    Count(u64),
    Time(Duration),
}

impl Cost {
    fn so_far(heat: Heat, counts: &Counts) -> Self {
        match heat.counter() {
            Some(counter) => Self::Count(counts[counter as usize]),
            // Backend::check has made sure of the clock.
            None => Self::Time(clock::of_thread().unwrap_or_default()),
        }
    }

    /// In units of the counter, or nanoseconds.
    fn since(self, before: Self) -> f64 {
        match (self, before) {
            (Self::Count(now), Self::Count(before)) => (now - before) as f64,
            (Self::Time(now), Self::Time(before)) => now.saturating_sub(before).as_nanos() as f64,
            _ => 0.0,
        }
    }
}
