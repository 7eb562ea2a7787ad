//! The compute backend: any Vulkan 1.2 device, with the hierarchy of [`super::bvh`].
//!
//! **A picture is a sum of small submissions.** The pixel buffer starts at zero and every sample of every tile
//! adds to it, one dispatch and one submission each, so that no driver's watchdog fires however deep a scene is:
//! tiles start small and grow or shrink towards [`tiles::TARGET_TIME`]. Counts and pixels do not depend on the
//! tiles.
//!
//! **Bands.** A picture whose pixels exceed the largest range that the device binds (64 million pixels take 1 GiB;
//! lavapipe binds 128 MiB) is drawn in horizontal bands, each as a picture of its own with a narrower frustum.
//!
//! **What the plan leaves out does not exist.** Its buffers are not created. Vulkan wants something bound to
//! every binding that the shader text names, even where a specialization constant has removed all uses; that is
//! one shared buffer of [`NULL_BYTES`] bytes.

mod pack;
pub mod probe;
pub mod tiles;

use super::{
    Backend, Missing, RenderError, Shot, Stats, Target,
    plan::{Feature, Plan},
    world::World,
};
use crate::{
    shader_io::{self, Dispatch, View, binding},
    vulkan::{
        Context, Tier, VulkanError,
        command::Submitter,
        descriptor::{Bound, BufferSet},
        memory::{Buffer, Direction, HostBuffer},
        record::Access,
        shader::{ComputePipeline, ComputeShader},
    },
};
use pack::Packed;
use std::{
    sync::Arc,
    time::{Duration, Instant},
};
use tiles::{Bands, Pace, Tiles};

/// Size of the buffer that stands for all that a scene does not need.
pub const NULL_BYTES: u64 = 256;

/// Bytes of a pixel in the pixel buffer.
const PIXEL_BYTES: u64 = size_of::<shader_io::types::vec4>() as u64;

/// Bytes of the work counters.
const COUNT_BYTES: u64 = 4 * shader_io::COUNT_END as u64;

/// Draws on a Vulkan device with compute shaders.
#[derive(Debug)]
pub struct ComputeBackend {
    context: Arc<Context>,
    submitter: Submitter,
    null: Arc<Buffer>,
    loaded: Option<Loaded>,
}

/// A world on the device.
#[derive(Debug)]
struct Loaded {
    world: Arc<World>,
    pipeline: ComputePipeline,
    /// Buffers of the world, by binding.
    scene: Vec<Bound>,
    view: Arc<Buffer>,
    /// Work counters and their way back, if the plan counts.
    counters: Option<(Arc<Buffer>, HostBuffer)>,
    /// Learnt from the pictures so far.
    pace: Pace,
    canvas: Option<Canvas>,
}

/// What depends on the picture's size; kept from one picture to the next of the same size.
#[derive(Debug)]
struct Canvas {
    pixels: Arc<Buffer>,
    readback: HostBuffer,
    set: BufferSet,
}

impl ComputeBackend {
    /// A backend on the context's device.
    ///
    /// # Errors
    /// Driver failures.
    pub fn new(context: &Arc<Context>) -> Result<Self, VulkanError> {
        let mut submitter = Submitter::new(context, "the compute backend")?;
        let null = Buffer::new(context, "nothing", NULL_BYTES)?;
        submitter.submit("clear the null buffer", |r| r.clear(&null))?;
        Ok(Self { context: context.clone(), submitter, null: Arc::new(null), loaded: None })
    }

    /// The device's context.
    pub fn context(&self) -> &Arc<Context> {
        &self.context
    }

    /// Largest number of bytes that the device binds.
    fn limit(&self) -> u64 {
        self.context.info().max_storage_range
    }

    fn too_large(&self, what: &'static str, bytes: u64) -> RenderError {
        RenderError::TooLarge { what, bytes, limit: self.limit(), device: self.context.info().name.clone() }
    }
}

impl Backend for ComputeBackend {
    fn name(&self) -> &'static str {
        "compute"
    }

    fn device(&self) -> String {
        self.context.info().to_string()
    }

    fn check(&self, _plan: &Plan) -> Result<(), Missing> {
        let lacking = self.context.info().lacks(Tier::Compute);
        if lacking.is_empty() { Ok(()) } else { Err(Missing(lacking.join(", "))) }
    }

    fn load(&mut self, world: &Arc<World>) -> Result<(), RenderError> {
        // The old world goes first: two may not fit.
        self.loaded = None;
        let packed = Packed::new(world);
        let parts = packed.parts();
        for (_, name, bytes) in &parts {
            if bytes.len() as u64 > self.limit() {
                return Err(self.too_large(name, bytes.len() as u64));
            }
        }
        let mut scene = Vec::with_capacity(parts.len());
        for (binding, name, bytes) in &parts {
            let buffer = if bytes.is_empty() {
                self.null.clone()
            } else {
                Arc::new(Buffer::from_slice(&self.context, &mut self.submitter, name, bytes)?)
            };
            scene.push(Bound { binding: *binding, bytes: (bytes.len() as u64).max(4), buffer });
        }
        let pipeline = ComputePipeline::new(
            &self.context,
            &ComputeShader {
                entry: "path.comp",
                geometry: world.geometry,
                constants: &world.plan.specialization().words(),
                push_bytes: size_of::<Dispatch>() as u32,
            },
        )?;
        let counters = if world.plan.uses(Feature::Counters) {
            let counts = Buffer::new(&self.context, "work counters", COUNT_BYTES)?;
            let readback = HostBuffer::new(&self.context, "work counters", COUNT_BYTES, Direction::Readback)?;
            Some((Arc::new(counts), readback))
        } else {
            None
        };
        let view = Arc::new(Buffer::new(&self.context, "view", size_of::<View>() as u64)?);
        let pace = Pace::new(self.context.info().max_workgroups);
        let world = world.clone();
        self.loaded = Some(Loaded { world, pipeline, scene, view, counters, pace, canvas: None });
        Ok(())
    }

    fn render(
        &mut self,
        shot: &Shot,
        target: &mut Target,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<Stats, RenderError> {
        let start = Instant::now();
        let [width, height] = shot.size;
        let Some(bands) = Bands::new(shot.size, self.limit() / PIXEL_BYTES) else {
            return Err(self.too_large("a row of pixels", u64::from(width) * PIXEL_BYTES));
        };
        let Some(mut loaded) = self.loaded.take() else { return Err(RenderError::NothingLoaded) };
        let mut picture =
            Picture { backend: self, loaded: &mut loaded, shot, progress, done: 0, stats: Stats::default() };
        let drawn = picture.draw(&bands, target);
        let mut stats = picture.stats;
        stats.memory = loaded.memory(&self.null);
        // After an error the world is still there: a lost device says so again, and memory may come back.
        self.loaded = Some(loaded);
        drawn?;
        (target.width, target.height) = (width, height);
        stats.wall_time = start.elapsed();
        Ok(stats)
    }
}

impl Loaded {
    /// Bytes of all buffers of the world and the picture.
    fn memory(&self, null: &Arc<Buffer>) -> u64 {
        let scene = self.scene.iter().filter(|b| !Arc::ptr_eq(&b.buffer, null)).map(|b| b.buffer.size());
        let counters = self.counters.as_ref().map_or(0, |(counts, readback)| counts.size() + readback.size());
        let canvas = self.canvas.as_ref().map_or(0, |c| c.pixels.size() + c.readback.size());
        scene.sum::<u64>() + null.size() + self.view.size() + counters + canvas
    }
}

/// A picture in the making.
struct Picture<'a> {
    backend: &'a mut ComputeBackend,
    loaded: &'a mut Loaded,
    shot: &'a Shot,
    progress: &'a (dyn Fn(f64) + Sync),
    /// Pixels × samples that are finished.
    done: u64,
    stats: Stats,
}

impl Picture<'_> {
    fn draw(&mut self, bands: &Bands, target: &mut Target) -> Result<(), VulkanError> {
        let [width, height] = self.shot.size;
        let mut canvas = self.canvas(bands.pixels())?;
        target.pixels.clear();
        target.pixels.reserve_exact(width as usize * height as usize);
        for rows in bands.iter() {
            let drawn = self.draw_band(&mut canvas, rows.clone());
            if let Err(error) = drawn {
                self.loaded.canvas = Some(canvas);
                return Err(error);
            }
            let samples = self.shot.samples.max(1) as f32;
            let sums: Vec<[f32; 4]> = canvas.readback.read(width as usize * rows.len())?;
            target.pixels.extend(sums.iter().map(|sum| sum.map(|x| x / samples)));
        }
        self.loaded.canvas = Some(canvas);
        Ok(())
    }

    /// Buffers for so many pixels, the last picture's if they fit exactly.
    fn canvas(&mut self, pixels: u64) -> Result<Canvas, VulkanError> {
        let bytes = pixels * PIXEL_BYTES;
        match self.loaded.canvas.take() {
            Some(canvas) if canvas.pixels.size() == bytes => return Ok(canvas),
            // The old one goes before the new one comes.
            old => drop(old),
        }
        let context = &self.backend.context;
        let pixels = Arc::new(Buffer::new(context, "pixels", bytes)?);
        let readback = HostBuffer::new(context, "pixels", bytes, Direction::Readback)?;
        let mut bound = self.loaded.scene.clone();
        bound.push(Bound::whole(binding::view, &self.loaded.view));
        bound.push(Bound::whole(binding::pixels, &pixels));
        let counts = self.loaded.counters.as_ref().map_or(&self.backend.null, |(counts, _)| counts);
        bound.push(Bound::whole(binding::counts, counts));
        for unused in [binding::probe_in, binding::probe_out, binding::scenes] {
            bound.push(Bound::whole(unused, &self.backend.null));
        }
        let set = BufferSet::new(self.loaded.pipeline.layout(), &bound)?;
        // Drivers that compile at a pipeline's first dispatch do it for this empty one, so that the time of tracing
        // is that of tracing.
        let nothing = Dispatch { origin: [0, 0], extent: [0, 0], offset: [0.5, 0.5] };
        let pipeline = &self.loaded.pipeline;
        self.backend.submitter.submit("compile", |r| r.dispatch(pipeline, &set, Some(&nothing), [1, 1]))?;
        Ok(Canvas { pixels, readback, set })
    }

    /// Draws all samples of some rows as a picture of their own, and brings the sums to the readback buffer.
    fn draw_band(&mut self, canvas: &mut Canvas, rows: std::ops::Range<u32>) -> Result<(), VulkanError> {
        let submitter = &mut self.backend.submitter;
        let [width, height] = self.shot.size;
        let mut view = self.shot.view(&self.loaded.world);
        if rows.len() < height as usize {
            let [_, _, down, up] = self.shot.tangents;
            let at = |row: u32| (up + (down - up) * f64::from(row) / f64::from(height)) as f32;
            view.size[1] = rows.end - rows.start;
            view.tangents[2] = at(rows.end);
            view.tangents[3] = at(rows.start);
        }
        let buffer = &self.loaded.view;
        submitter.submit("begin a picture", |r| {
            r.barrier(&[Access::Shaders, Access::Transfer], &[Access::Transfer]);
            r.write(buffer, &view)?;
            r.clear(&canvas.pixels)?;
            r.barrier(&[Access::Transfer], &[Access::Shaders]);
            Ok(())
        })?;
        let size = [width, rows.end - rows.start];
        for sample in 0..self.shot.samples.max(1) {
            let offset = self.shot.sample_offset(sample).map(|x| x as f32);
            let mut tiles = Tiles::new(size);
            while let Some((origin, extent)) = tiles.next(self.loaded.pace.tile()) {
                self.draw_tile(canvas, &Dispatch { origin, extent, offset })?;
            }
        }
        let bytes = u64::from(size[0]) * u64::from(size[1]) * PIXEL_BYTES;
        let elapsed = self
            .backend
            .submitter
            .submit("read pixels back", |r| r.readback(&canvas.pixels, &mut canvas.readback, bytes));
        elapsed.map(|_| ())
    }

    fn draw_tile(&mut self, canvas: &Canvas, tile: &Dispatch) -> Result<(), VulkanError> {
        let Loaded { pipeline, counters, pace, .. } = &mut *self.loaded;
        let groups =
            [tile.extent[0].div_ceil(shader_io::GROUP_WIDTH), tile.extent[1].div_ceil(shader_io::GROUP_HEIGHT)];
        let counting = counters.as_mut().map(|(counts, readback)| (&**counts, readback));
        let elapsed = self.backend.submitter.submit("draw a tile", |r| {
            if let Some((counts, _)) = &counting {
                r.barrier(&[Access::Shaders, Access::Transfer], &[Access::Transfer]);
                r.clear(counts)?;
            }
            // Earlier samples of the same pixels, and the fills.
            r.barrier(&[Access::Shaders, Access::Transfer], &[Access::Shaders]);
            r.dispatch(pipeline, &canvas.set, Some(tile), groups)?;
            if let Some((counts, readback)) = counting {
                r.readback(counts, readback, COUNT_BYTES)?;
            }
            Ok(())
        })?;
        if let Some((_, readback)) = counters {
            let counts: Vec<u32> = readback.read(shader_io::COUNT_END as usize)?;
            for (sum, count) in self.stats.counts.iter_mut().zip(counts) {
                *sum += u64::from(count);
            }
        }
        let time: Duration = elapsed.best();
        let pixels = u64::from(tile.extent[0]) * u64::from(tile.extent[1]);
        pace.learn(pixels, time);
        self.stats.trace_time += time;
        self.stats.dispatches += 1;
        self.done += pixels;
        let [width, height] = self.shot.size.map(u64::from);
        let all = (width * height).saturating_mul(u64::from(self.shot.samples.max(1)));
        (self.progress)(self.done as f64 / all as f64);
        Ok(())
    }
}
