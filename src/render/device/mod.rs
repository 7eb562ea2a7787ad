//! What the backends on Vulkan devices have in common: buffers of the world, and pictures in tiles. What differs is the
//! pipeline, a [`Tracer`]: [`super::compute`] and [`super::rt`].
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

pub mod eyes;
pub mod pack;
pub mod rays;
pub mod tiles;

use super::{
    Backend, Missing, RenderError, Shot, Stats, StructureStats, Target,
    plan::{Feature, Heat, Plan},
    world::World,
};
use crate::{
    shader_io::{self, BINDINGS, Dispatch, View, binding, types::uvec4},
    vulkan::{
        Context, DeviceInfo, Tier, VulkanError,
        command::Submitter,
        descriptor::{Bound, BufferSet, Layout},
        memory::{Buffer, Direction, HostBuffer},
        record::{Access, Recorder},
    },
};
use bytemuck::Pod;
use pack::{Array, Common};
use std::{
    fmt::Debug,
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

/// A device while a world is brought to it.
#[derive(Debug)]
pub struct Device {
    /// The device.
    pub context: Arc<Context>,
    /// Its commands.
    pub submitter: Submitter,
}

impl Device {
    /// Uploads arrays; empty ones are left out.
    ///
    /// # Errors
    /// Arrays that the device cannot bind; driver failures.
    pub fn upload(&mut self, arrays: &[Array<'_>]) -> Result<Vec<Bound>, RenderError> {
        self.fits(arrays)?;
        let mut bound = Vec::with_capacity(arrays.len());
        for (binding, name, bytes) in arrays.iter().filter(|(_, _, bytes)| !bytes.is_empty()) {
            let buffer = Arc::new(Buffer::from_slice(&self.context, &mut self.submitter, name, bytes)?);
            bound.push(Bound { binding: *binding, bytes: bytes.len() as u64, buffer });
        }
        Ok(bound)
    }

    /// Uploads an array that shaders read by address as well as through its binding. The address, in two words, and the index of
    /// the last element: there is one at least, so that every index can be kept inside.
    ///
    /// # Errors
    /// As [`Self::upload`].
    pub fn upload_addressed<T: Pod + Default>(
        &mut self,
        bound: &mut Vec<Bound>,
        (binding, name): (u32, &'static str),
        mut elements: Vec<T>,
    ) -> Result<uvec4, RenderError> {
        if elements.is_empty() {
            elements.push(T::default());
        }
        bound.extend(self.upload(&[(binding, name, bytemuck::cast_slice(&elements))])?);
        let address = bound.last().map_or(0, |last| last.buffer.address());
        Ok([address as u32, (address >> 32) as u32, elements.len() as u32 - 1, 0])
    }

    /// Whether the device can bind these arrays.
    ///
    /// # Errors
    /// [`RenderError::TooLarge`].
    pub fn fits(&self, arrays: &[Array<'_>]) -> Result<(), RenderError> {
        match arrays.iter().find(|(_, _, bytes)| bytes.len() as u64 > self.limit()) {
            Some((_, name, bytes)) => Err(self.too_large(name, bytes.len() as u64)),
            None => Ok(()),
        }
    }

    /// Largest number of bytes that the device binds.
    pub fn limit(&self) -> u64 {
        self.context.info().max_storage_range
    }

    /// The error for an array beyond the limit.
    pub fn too_large(&self, what: &'static str, bytes: u64) -> RenderError {
        RenderError::TooLarge { what, bytes, limit: self.limit(), device: self.context.info().name.clone() }
    }
}

/// A kind of pipeline, with a world on the device.
pub trait Tracer: Debug + Sized {
    /// Name of the backend on the command line.
    const NAME: &'static str;
    /// What devices must be able to do.
    const TIER: Tier;
    /// Work counters that it cannot know.
    const UNCOUNTED: &'static [u32];
    /// Choices of the user.
    type Options: Copy + Default + Debug + Send + Sync;

    /// Brings a world to the device, with the pipeline for its plan. Returns what the pipeline reads besides the
    /// [`Common`] arrays.
    ///
    /// # Errors
    /// Driver failures; worlds beyond the device's limits.
    fn load(
        device: &mut Device,
        world: &World,
        options: Self::Options,
        last: Option<Self>,
    ) -> Result<(Self, Vec<Bound>), RenderError>;

    /// Moves what moves to its place in the next pose of the same world. `false`: the world must be loaded again.
    ///
    /// # Errors
    /// Driver failures.
    fn pose(&mut self, _device: &mut Device, _world: &World) -> Result<bool, RenderError> {
        Ok(false)
    }

    /// What the pipeline takes.
    fn layout(&self) -> &Layout;

    /// Traces the pixels of a tile, of one eye or of two at once.
    ///
    /// # Errors
    /// Objects of another device.
    fn trace<'a>(
        &'a self,
        recorder: &mut Recorder<'a>,
        set: &'a BufferSet,
        tile: &Dispatch,
        eyes: u32,
    ) -> Result<(), VulkanError>;

    /// What a launch needs for itself, at most so many pixels across and down for so many eyes.
    fn scratch(&self, _device: &DeviceInfo, _launch: [u32; 3]) -> Option<Scratch> {
        None
    }

    /// Bytes of what it holds besides the bound buffers.
    fn memory(&self) -> u64 {
        0
    }

    /// What it knows of its acceleration structures, if it has some.
    fn structures(&self) -> Option<StructureStats> {
        None
    }
}

/// An array that only shaders read and write.
#[derive(Clone, Copy, Debug)]
pub struct Scratch {
    /// Where it is bound.
    pub binding: u32,
    /// Its name in errors.
    pub name: &'static str,
    /// Its size.
    pub bytes: u64,
}

/// Draws on a Vulkan device.
#[derive(Debug)]
pub struct DeviceBackend<T: Tracer> {
    device: Device,
    options: T::Options,
    null: Arc<Buffer>,
    loaded: Option<Loaded<T>>,
    /// Only where a headset is drawn for.
    eyes: Option<eyes::Canvas>,
}

/// A world on the device.
#[derive(Debug)]
struct Loaded<T> {
    world: Arc<World>,
    tracer: T,
    /// Buffers of the world, by binding.
    scene: Vec<Bound>,
    view: Arc<Buffer>,
    /// Work counters and their way back, if the plan counts.
    counters: Option<(Arc<Buffer>, HostBuffer)>,
    /// Learnt from the pictures so far.
    pace: Pace,
    canvas: Option<Canvas>,
    /// Buffers of the world and of the headset's eyes together.
    eyes: Option<BufferSet>,
}

/// What depends on the picture's size; kept from one picture to the next of the same size.
#[derive(Debug)]
struct Canvas {
    /// Pixels across and down.
    size: [u32; 2],
    pixels: Arc<Buffer>,
    readback: HostBuffer,
    set: BufferSet,
    /// Bytes of what launches need for themselves.
    scratch: u64,
}

impl<T: Tracer> DeviceBackend<T> {
    /// A backend on the context's device.
    ///
    /// # Errors
    /// Driver failures.
    pub fn new(context: &Arc<Context>) -> Result<Self, VulkanError> {
        Self::with_options(context, T::Options::default())
    }

    /// The same with choices.
    ///
    /// # Errors
    /// Driver failures.
    pub fn with_options(context: &Arc<Context>, options: T::Options) -> Result<Self, VulkanError> {
        let mut submitter = Submitter::new(context, &format!("the {} backend", T::NAME))?;
        let null = Buffer::new(context, "nothing", NULL_BYTES)?;
        submitter.submit("clear the null buffer", |r| r.clear(&null))?;
        let device = Device { context: context.clone(), submitter };
        Ok(Self { device, options, null: Arc::new(null), loaded: None, eyes: None })
    }

    /// The device's context.
    pub fn context(&self) -> &Arc<Context> {
        &self.device.context
    }
}

impl<T: Tracer> Backend for DeviceBackend<T> {
    fn name(&self) -> &'static str {
        T::NAME
    }

    fn device(&self) -> String {
        self.context().info().to_string()
    }

    fn check(&self, plan: &Plan) -> Result<(), Missing> {
        let info = self.context().info();
        let mut lacking = info.lacks(T::TIER);
        if plan.heat == Some(Heat::Time) && !info.has_clock() {
            lacking.push(String::from("VK_KHR_shader_clock, by which pixels are timed"));
        }
        if let Some(heat) = plan.heat.filter(|h| h.counter().is_some_and(|what| T::UNCOUNTED.contains(&what))) {
            lacking.push(format!("a count of {} in its own traversal", heat.name()));
        }
        if lacking.is_empty() { Ok(()) } else { Err(Missing(lacking.join(", "))) }
    }

    fn load(&mut self, world: &Arc<World>) -> Result<(), RenderError> {
        // The old world goes first: two may not fit.
        let last = self.loaded.take().map(|loaded| loaded.tracer);
        let device = &mut self.device;
        let common = Common::new(world);
        device.fits(&common.arrays())?;
        let (tracer, mut scene) = T::load(device, world, self.options, last)?;
        scene.extend(device.upload(&common.arrays())?);
        let counters = if world.plan.uses(Feature::Counters) {
            let counts = Buffer::new(&device.context, "work counters", COUNT_BYTES)?;
            let readback = HostBuffer::new(&device.context, "work counters", COUNT_BYTES, Direction::Readback)?;
            Some((Arc::new(counts), readback))
        } else {
            None
        };
        let view = Arc::new(Buffer::new(&device.context, "view", size_of::<[View; 2]>() as u64)?);
        let pace = Pace::new(device.context.info().max_workgroups);
        let world = world.clone();
        self.loaded = Some(Loaded { world, tracer, scene, view, counters, pace, canvas: None, eyes: None });
        Ok(())
    }

    fn pose(&mut self, world: &Arc<World>) -> Result<(), RenderError> {
        if let Some(loaded) = &mut self.loaded
            && Arc::ptr_eq(&loaded.world.still, &world.still)
            && loaded.tracer.pose(&mut self.device, world)?
        {
            loaded.world = world.clone();
            return Ok(());
        }
        self.load(world)
    }

    fn keep(&self) -> Option<String> {
        self.context().save_pipelines().err().map(|error| error.to_string())
    }

    fn render(
        &mut self,
        shot: &Shot,
        target: &mut Target,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<Stats, RenderError> {
        self.draw(shot, Some(target), progress)
    }

    fn trace(&mut self, shot: &Shot) -> Result<Stats, RenderError> {
        self.draw(shot, None, &|_| ())
    }
}

impl<T: Tracer> DeviceBackend<T> {
    /// Draws a picture, and brings it to the target if there is one.
    fn draw(
        &mut self,
        shot: &Shot,
        target: Option<&mut Target>,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<Stats, RenderError> {
        let start = Instant::now();
        let Some(mut loaded) = self.loaded.take() else { return Err(RenderError::NothingLoaded) };
        let Some(bands) = loaded.bands(&self.device, shot.size) else {
            self.loaded = Some(loaded);
            return Err(self.device.too_large("a row of pixels", u64::from(shot.size[0]) * PIXEL_BYTES));
        };
        let mut picture =
            Picture { backend: self, loaded: &mut loaded, shot, progress, done: 0, stats: Stats::default() };
        let drawn = picture.draw(&bands, target);
        let mut stats = picture.stats;
        stats.memory = loaded.memory(&self.null);
        stats.structures = loaded.tracer.structures();
        stats.uncounted = T::UNCOUNTED;
        stats.pipeline_cache = Some(self.context().cache_found().to_string());
        // After an error the world is still there: a lost device says so again, and memory may come back.
        self.loaded = Some(loaded);
        drawn?;
        stats.wall_time = start.elapsed();
        Ok(stats)
    }
}

/// Binds what is not there, for the bindings that a shader's text names and its constants leave unused.
fn fill_up(bound: &mut Vec<Bound>, null: &Arc<Buffer>) {
    for unused in 0..BINDINGS {
        if bound.iter().all(|b| b.binding != unused) {
            // `.length()` of what is not there is at most 1.
            bound.push(Bound { binding: unused, buffer: null.clone(), bytes: 4 });
        }
    }
}

impl<T: Tracer> Loaded<T> {
    /// The bands of a picture, whose pixels can be bound, and so can what launches need for themselves; none if a row is
    /// too much.
    fn bands(&self, device: &Device, size: [u32; 2]) -> Option<Bands> {
        let mut pixels = device.limit() / PIXEL_BYTES;
        loop {
            let bands = Bands::new(size, pixels)?;
            let [width, height] = bands.largest();
            let scratch = self.tracer.scratch(device.context.info(), [width, height, 1]);
            if scratch.is_none_or(|scratch| scratch.bytes <= device.limit()) {
                return Some(bands);
            }
            pixels /= 2;
        }
    }

    /// What the tracer's shaders read and write: the world, and the buffers of a picture with launches of at most so many
    /// pixels across and down, for so many eyes. With it the bytes of what launches need for themselves.
    fn set(
        &self,
        device: &Device,
        null: &Arc<Buffer>,
        picture: &[Bound],
        launch: [u32; 3],
    ) -> Result<(BufferSet, u64), VulkanError> {
        let mut bound = self.scene.clone();
        let scratch = self.tracer.scratch(device.context.info(), launch);
        if let Some(Scratch { binding, name, bytes }) = scratch {
            bound.push(Bound::whole(binding, &Arc::new(Buffer::new(&device.context, name, bytes)?)));
        }
        bound.push(Bound::whole(binding::view, &self.view));
        bound.extend_from_slice(picture);
        if let Some((counts, _)) = &self.counters {
            bound.push(Bound::whole(binding::counts, counts));
        }
        fill_up(&mut bound, null);
        Ok((BufferSet::new(self.tracer.layout(), &bound)?, scratch.map_or(0, |scratch| scratch.bytes)))
    }

    /// Bytes of all buffers of the world and the picture.
    fn memory(&self, null: &Arc<Buffer>) -> u64 {
        let scene = self.scene.iter().map(|b| b.buffer.size());
        let counters = self.counters.as_ref().map_or(0, |(counts, readback)| counts.size() + readback.size());
        let canvas = self.canvas.as_ref().map_or(0, |c| c.pixels.size() + c.readback.size() + c.scratch);
        scene.sum::<u64>() + self.tracer.memory() + null.size() + self.view.size() + counters + canvas
    }
}

/// A picture in the making.
struct Picture<'a, T: Tracer> {
    backend: &'a mut DeviceBackend<T>,
    loaded: &'a mut Loaded<T>,
    shot: &'a Shot,
    progress: &'a (dyn Fn(f64) + Sync),
    /// Pixels × samples that are finished.
    done: u64,
    stats: Stats,
}

impl<T: Tracer> Picture<'_, T> {
    /// Draws all bands, and brings them to the target if there is one, whose memory is used again.
    fn draw(&mut self, bands: &Bands, mut target: Option<&mut Target>) -> Result<(), VulkanError> {
        let [width, height] = self.shot.size;
        let mut canvas = self.canvas(bands.largest())?;
        if let Some(target) = &mut target {
            target.pixels.clear();
            target.pixels.reserve_exact(width as usize * height as usize);
        }
        for rows in bands.iter() {
            let drawn = self.draw_band(&mut canvas, rows.clone()).and_then(|()| match &mut target {
                Some(target) => self.read_back(&mut canvas, rows.len(), &mut target.pixels),
                None => Ok(()),
            });
            if let Err(error) = drawn {
                self.loaded.canvas = Some(canvas);
                return Err(error);
            }
        }
        self.loaded.canvas = Some(canvas);
        if let Some(target) = target {
            (target.width, target.height) = (width, height);
        }
        Ok(())
    }

    /// Appends so many rows of the canvas, as means of their samples.
    fn read_back(&mut self, canvas: &mut Canvas, rows: usize, into: &mut Vec<[f32; 4]>) -> Result<(), VulkanError> {
        let pixels = self.shot.size[0] as usize * rows;
        let submitter = &mut self.backend.device.submitter;
        submitter.submit("read pixels back", |r| {
            r.readback(&canvas.pixels, &mut canvas.readback, pixels as u64 * PIXEL_BYTES)
        })?;
        let samples = self.shot.samples.max(1) as f32;
        let sums: Vec<[f32; 4]> = canvas.readback.read(pixels)?;
        into.extend(sums.iter().map(|sum| sum.map(|x| x / samples)));
        Ok(())
    }

    /// Buffers for so many pixels across and down, the last picture's if they fit exactly.
    fn canvas(&mut self, size: [u32; 2]) -> Result<Canvas, VulkanError> {
        match self.loaded.canvas.take() {
            Some(canvas) if canvas.size == size => return Ok(canvas),
            // The old one goes before the new one comes.
            old => drop(old),
        }
        let device = &self.backend.device;
        let bytes = u64::from(size[0]) * u64::from(size[1]) * PIXEL_BYTES;
        let pixels = Arc::new(Buffer::new(&device.context, "pixels", bytes)?);
        let readback = HostBuffer::new(&device.context, "pixels", bytes, Direction::Readback)?;
        let bound = [Bound::whole(binding::pixels, &pixels)];
        let (set, scratch) = self.loaded.set(device, &self.backend.null, &bound, [size[0], size[1], 1])?;
        let tracer = &self.loaded.tracer;
        // Drivers that compile at a pipeline's first dispatch do it for this empty one, so that the time of tracing
        // is that of tracing.
        let nothing = Dispatch { origin: [0, 0], extent: [0, 0], offset: [0.5, 0.5], eye: 0 };
        self.backend.device.submitter.submit("compile", |r| tracer.trace(r, &set, &nothing, 1))?;
        Ok(Canvas { size, pixels, readback, set, scratch })
    }

    /// Draws all samples of some rows as a picture of their own.
    fn draw_band(&mut self, canvas: &mut Canvas, rows: std::ops::Range<u32>) -> Result<(), VulkanError> {
        let submitter = &mut self.backend.device.submitter;
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
                self.draw_tile(canvas, &Dispatch { origin, extent, offset, eye: 0 })?;
            }
        }
        Ok(())
    }

    fn draw_tile(&mut self, canvas: &Canvas, tile: &Dispatch) -> Result<(), VulkanError> {
        let Loaded { tracer, counters, pace, .. } = &mut *self.loaded;
        let counting = counters.as_mut().map(|(counts, readback)| (&**counts, readback));
        let elapsed = self.backend.device.submitter.submit("draw a tile", |r| {
            if let Some((counts, _)) = &counting {
                r.barrier(&[Access::Shaders, Access::Transfer], &[Access::Transfer]);
                r.clear(counts)?;
            }
            // Earlier samples of the same pixels, and the fills.
            r.barrier(&[Access::Shaders, Access::Transfer], &[Access::Shaders]);
            tracer.trace(r, &canvas.set, tile, 1)?;
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
