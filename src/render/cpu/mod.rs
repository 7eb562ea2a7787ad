//! The reference: f64 on all cores, without any Vulkan.
//!
//! The files are the shader stages under the same names: [`traverse`] is `trace/compute.glsl`, [`surface`]
//! `stage/{hit,surface}.glsl` with the triangle, quadric and mask stages, [`shade`] `stage/shade.glsl`, [`raygen`]
//! `stage/raygen.glsl`; walking is [`crate::space::walk`].

pub mod raygen;
pub mod shade;
pub mod surface;
pub mod traverse;

use super::{
    Backend, Missing, RenderError, Shot, Stats, Target, clock,
    plan::{Heat, Plan},
    world::World,
};
use crate::{
    geometry::{Geometry, Visitor, visit},
    shader_io::COUNT_END,
};
use rayon::prelude::*;
use std::{
    mem::size_of_val,
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    },
    time::Instant,
};
use traverse::Tracer;

/// Work counters, indexed by the `COUNT_` numbers of [`crate::shader_io`].
pub type Counts = [u64; COUNT_END as usize];

/// The f64 backend.
#[derive(Default)]
pub struct CpuBackend {
    world: Option<Arc<World>>,
}

impl CpuBackend {
    /// Name on the command line.
    pub const NAME: &'static str = "cpu";
}

/// Side of the square tiles that tasks work on.
const TILE: u32 = 16;

impl Backend for CpuBackend {
    fn name(&self) -> &'static str {
        Self::NAME
    }

    fn device(&self) -> String {
        format!("{} threads, f64", rayon::current_num_threads())
    }

    fn check(&self, plan: &Plan) -> Result<(), Missing> {
        if plan.heat == Some(Heat::Time) && clock::of_thread().is_none() {
            return Err(Missing(String::from("a clock of threads, by which pixels are timed")));
        }
        Ok(())
    }

    fn load(&mut self, world: &Arc<World>) -> Result<(), RenderError> {
        // Built here, so that no frame is measured with it.
        world.hierarchy();
        self.world = Some(Arc::clone(world));
        Ok(())
    }

    fn render(
        &mut self,
        shot: &Shot,
        target: &mut Target,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<Stats, RenderError> {
        let world = self.world.as_ref().ok_or(RenderError::NothingLoaded)?;
        Ok(visit(world.geometry, Render { world, shot, target, progress }))
    }
}

struct Render<'a> {
    world: &'a World,
    shot: &'a Shot,
    target: &'a mut Target,
    progress: &'a (dyn Fn(f64) + Sync),
}

impl Visitor for Render<'_> {
    type Output = Stats;

    fn visit<G: Geometry>(self, geometry: G) -> Stats {
        let Self { world, shot, target, progress } = self;
        let start = Instant::now();
        let tracer = Tracer::new(geometry, world, shot);
        let [width, height] = shot.size;
        if [target.width, target.height] != shot.size {
            *target = Target::new(shot.size);
        }
        let offsets: Vec<[f64; 2]> = (0..shot.samples).map(|sample| shot.sample_offset(sample)).collect();
        let tiles: Vec<[u32; 2]> = (0..height.div_ceil(TILE))
            .flat_map(|y| (0..width.div_ceil(TILE)).map(move |x| [x * TILE, y * TILE]))
            .collect();
        let done = AtomicUsize::new(0);
        let results: Vec<(Vec<[f32; 4]>, Counts)> = tiles
            .par_iter()
            .map(|&[x0, y0]| {
                let mut counts = Counts::default();
                let (x1, y1) = ((x0 + TILE).min(width), (y0 + TILE).min(height));
                let mut pixels = Vec::with_capacity((TILE * TILE) as usize);
                for y in y0..y1 {
                    for x in x0..x1 {
                        pixels.push(tracer.pixel([x, y], &offsets, &mut counts));
                    }
                }
                let finished = done.fetch_add(1, Ordering::Relaxed) + 1;
                progress(finished as f64 / tiles.len() as f64);
                (pixels, counts)
            })
            .collect();
        let mut counts = Counts::default();
        for (&[x0, y0], (pixels, tile_counts)) in tiles.iter().zip(&results) {
            let across = (width - x0).min(TILE) as usize;
            for (row, line) in pixels.chunks(across).enumerate() {
                let start = (y0 as usize + row) * width as usize + x0 as usize;
                target.pixels[start..start + across].copy_from_slice(line);
            }
            counts.iter_mut().zip(tile_counts).for_each(|(sum, n)| *sum += n);
        }
        let elapsed = start.elapsed();
        Stats {
            counts,
            trace_time: elapsed,
            wall_time: elapsed,
            memory: memory_of(world) + (target.pixels.len() * size_of::<[f32; 4]>()) as u64,
            dispatches: tiles.len() as u64,
            pipeline_cache: None,
            uncounted: &[],
            structures: None,
        }
    }
}

fn memory_of(world: &World) -> u64 {
    let texels: usize = world.textures.iter().map(|t| size_of_val(t.texels.as_slice())).sum();
    let (meshes, hierarchy) = (world.meshes(), world.hierarchy());
    let bytes = size_of_val(hierarchy.nodes.as_slice())
        + size_of_val(hierarchy.pairs.as_slice())
        + size_of_val(meshes.triangles.as_slice())
        + size_of_val(meshes.shading.as_slice())
        + size_of_val(world.quadrics.as_slice())
        + size_of_val(world.domain.faces.as_slice())
        + size_of_val(world.domain.labels.as_slice())
        + size_of_val(world.lights.images.as_slice())
        + size_of_val(world.lights.lists.as_slice())
        + texels;
    bytes as u64
}
