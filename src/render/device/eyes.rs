//! The two eyes of a headset: one dispatch traces both, one more makes images of the pixels, which are copied to where the
//! runtime wants them.
//!
//! Unlike pictures, eyes have one sample in a pixel, keep their distances (runtimes reproject by depth), and may leave out
//! pixels ([`Rays`]). Images are filled by a copy from a buffer and not written by shaders: runtimes prefer sRGB formats, and
//! those take no stores.
//!
//! A frame that takes long is cut into slices, one submission each, for the sake of drivers' watchdogs; both eyes are in every
//! slice.

use super::{
    super::{Backend, RenderError, Shot, plan::Purpose},
    DeviceBackend, Loaded, PIXEL_BYTES, Scratch, Tracer, fill_up,
    rays::{RayList, Rays},
};
use crate::{
    geometry::GeometryId,
    shader_io::{self as io, Dispatch, GROUP_HEIGHT, GROUP_WIDTH, LIST_BITS, Resolve, View, binding},
    vulkan::{
        Context,
        descriptor::{Bound, BufferSet},
        image::ForeignImage,
        memory::{Buffer, Direction, HostBuffer},
        record::Access,
        shader::{ComputePipeline, ComputeShader},
    },
};
use std::{sync::Arc, time::Duration};

/// Largest side of an eye: what a listed ray can name.
pub const LARGEST_SIDE: u32 = (1 << LIST_BITS) - 1;

/// How colours are stored in an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    /// 8 bits with the sRGB transfer function, red first.
    Rgba8Srgb,
    /// The same with blue first.
    Bgra8Srgb,
    /// 8 bits, linear, red first.
    Rgba8,
    /// The same with blue first.
    Bgra8,
    /// Half floats, linear.
    Rgba16F,
    /// 16 bits, linear.
    Rgba16,
}

impl Encoding {
    /// Bytes of a pixel.
    pub fn bytes(self) -> u64 {
        match self {
            Self::Rgba16F | Self::Rgba16 => 8,
            _ => 4,
        }
    }

    fn number(self) -> u32 {
        match self {
            Self::Rgba8Srgb => io::ENCODING_RGBA8_SRGB,
            Self::Bgra8Srgb => io::ENCODING_BGRA8_SRGB,
            Self::Rgba8 => io::ENCODING_RGBA8,
            Self::Bgra8 => io::ENCODING_BGRA8,
            Self::Rgba16F => io::ENCODING_RGBA16F,
            Self::Rgba16 => io::ENCODING_RGBA16,
        }
    }
}

/// Depths for the runtime.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthScale {
    /// Metres in a unit of length of the space.
    pub unit_in_metres: f64,
    /// Distance of the near plane in metres; the far plane is at infinity.
    pub near: f64,
}

/// What is drawn, until it changes.
#[derive(Clone, Debug, PartialEq)]
pub struct EyeLayout {
    /// Width and height of an eye in pixels.
    pub size: [u32; 2],
    /// Width and height that there will be at most.
    pub largest: [u32; 2],
    /// How colours are stored.
    pub encoding: Encoding,
    /// Whether depths are wanted.
    pub depth: Option<DepthScale>,
    /// Which pixels have rays. The world's plan must say [`Purpose::Eyes`] and whether they are listed.
    pub rays: Rays,
}

/// Where the pixels of an eye go: an image and a layer of it.
pub type Surface<'a> = (&'a ForeignImage, u32);

/// Where the pixels go.
#[derive(Clone, Copy, Debug)]
pub struct Surfaces<'a> {
    /// Colours of the left and the right eye.
    pub color: [Surface<'a>; 2],
    /// Depths, if the layout has them.
    pub depth: Option<[Surface<'a>; 2]>,
}

/// How a frame is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EyeOptions {
    /// Face passages, if not the scene's; at most those.
    pub bounces: Option<u32>,
    /// One dispatch for both eyes, or, to measure what that brings, one for each.
    pub together: bool,
    /// Brings the images back, as they are handed to the runtime.
    pub read_back: bool,
}

/// What a frame cost, and brought back.
#[derive(Clone, Debug, Default)]
pub struct EyeFrame {
    /// Time of tracing, by the device's stamps where it has them.
    pub trace: Duration,
    /// Time of making images of the pixels and copying them.
    pub finish: Duration,
    /// Dispatches that traced.
    pub dispatches: u32,
    /// Bytes of the images, row by row from the top, if they were asked for.
    pub images: Option<[Vec<u8>; 2]>,
}

/// A backend that can draw for a headset.
pub trait EyeBackend: Backend {
    /// The device's context.
    fn device_context(&self) -> &Arc<Context>;

    /// The backend as it draws pictures.
    fn as_backend(&mut self) -> &mut dyn Backend;

    /// Says what will be drawn from now on; makes buffers where those that are there do not do.
    ///
    /// # Errors
    /// Driver failures; eyes beyond the device's limits.
    fn set_eyes(&mut self, layout: EyeLayout) -> Result<(), RenderError>;

    /// Draws both eyes of the loaded world, or only makes the images if there are no surfaces.
    ///
    /// # Errors
    /// Driver failures; [`RenderError::NothingLoaded`] without a world or a layout.
    fn draw_eyes(
        &mut self,
        shots: &[Shot; 2],
        surfaces: Option<Surfaces<'_>>,
        options: EyeOptions,
    ) -> Result<EyeFrame, RenderError>;
}

/// What a submission of a slice should take: well below the watchdogs of drivers.
const SLICE_TIME: Duration = Duration::from_millis(250);

/// Slices of the first frame, whose cost is not known.
const FIRST_SLICES: u32 = 8;

/// Most slices; at 64 a frame takes seconds anyway.
const MOST_SLICES: u32 = 64;

/// Buffers of the eyes. They stay when the world changes.
#[derive(Debug)]
pub struct Canvas {
    layout: EyeLayout,
    geometry: GeometryId,
    pixels: Arc<Buffer>,
    packed: Arc<Buffer>,
    depths: Option<Arc<Buffer>>,
    rays: Arc<Buffer>,
    rates: Arc<Buffer>,
    resolve: ComputePipeline,
    /// Learnt from the frame before.
    slices: u32,
    /// So many there must be, so that what a launch needs for itself can be bound.
    least_slices: u32,
    readback: [HostBuffer; 2],
}

impl<T: Tracer> DeviceBackend<T> {
    fn eye_canvas(&self, layout: EyeLayout, geometry: GeometryId) -> Result<Canvas, RenderError> {
        let context = &self.device.context;
        let pixels = 2 * layout.largest.map(u64::from).iter().product::<u64>();
        if pixels * PIXEL_BYTES > self.device.limit() {
            return Err(self.device.too_large("the pixels of two eyes", pixels * PIXEL_BYTES));
        }
        let tiles = layout.largest.map(|side| u64::from(side.div_ceil(io::RATE_TILE)));
        let buffer = |name, bytes| Buffer::new(context, name, bytes).map(Arc::new);
        let sparse = layout.rays != Rays::All;
        let image_bytes = layout.encoding.bytes() * pixels / 2;
        let readback = || HostBuffer::new(context, "eye image", image_bytes, Direction::Readback);
        let shader =
            ComputeShader { entry: "resolve.comp", geometry, constants: &[], push_bytes: size_of::<Resolve>() as u32 };
        Ok(Canvas {
            geometry,
            pixels: buffer("pixels of the eyes", pixels * PIXEL_BYTES)?,
            packed: buffer("images of the eyes", pixels * layout.encoding.bytes())?,
            depths: layout.depth.map(|_| buffer("depths of the eyes", pixels * 4)).transpose()?,
            rays: buffer("rays", if sparse { pixels * 4 } else { 4 })?,
            rates: buffer("ray rates", if sparse { 2 * tiles[0] * tiles[1] * 4 } else { 4 })?,
            resolve: ComputePipeline::new(context, &shader)?,
            slices: FIRST_SLICES,
            least_slices: 1,
            readback: [readback()?, readback()?],
            layout,
        })
    }

    /// How few slices eyes of at most this size can be drawn in, and the largest launch then.
    fn largest_launch(&self, tracer: &T, [width, height]: [u32; 2]) -> Result<(u32, [u32; 3]), RenderError> {
        let mut slices = 1;
        loop {
            let launch = [width, height.div_ceil(slices).next_multiple_of(GROUP_HEIGHT), 2];
            match tracer.scratch(self.device.context.info(), launch) {
                Some(Scratch { name, bytes, .. }) if bytes > self.device.limit() => {
                    if slices == MOST_SLICES {
                        return Err(self.device.too_large(name, bytes));
                    }
                    slices *= 2;
                }
                _ => return Ok((slices, launch)),
            }
        }
    }

    fn draw_two(
        &mut self,
        loaded: &mut Loaded<T>,
        canvas: &mut Canvas,
        shots: &[Shot; 2],
        surfaces: Option<Surfaces<'_>>,
        options: EyeOptions,
    ) -> Result<EyeFrame, RenderError> {
        let mut frame = EyeFrame::default();
        let views = views(loaded, shots, canvas.layout.size, options);
        let set = match &loaded.eyes {
            Some(set) => set,
            None => {
                let bound = canvas.bound();
                let (slices, launch) = self.largest_launch(&loaded.tracer, canvas.layout.largest)?;
                canvas.least_slices = slices;
                let (set, _) = loaded.set(&self.device, &self.null, &bound, launch)?;
                loaded.eyes.insert(set)
            }
        };
        let tracer = &loaded.tracer;
        let mut first = true;
        for (dispatch, eyes) in canvas.dispatches(options.together) {
            let (view, last) = (&loaded.view, std::mem::take(&mut first));
            let elapsed = self.device.submitter.submit("draw two eyes", |r| {
                if last {
                    r.barrier(&[Access::Shaders, Access::Transfer], &[Access::Transfer]);
                    r.write(view, &views)?;
                }
                r.barrier(&[Access::Shaders, Access::Transfer], &[Access::Shaders]);
                tracer.trace(r, set, &dispatch, eyes)
            })?;
            frame.trace += elapsed.best();
            frame.dispatches += 1;
        }
        let slices = frame.trace.div_duration_f64(SLICE_TIME).ceil();
        canvas.slices = (slices as u32).clamp(1, MOST_SLICES);
        self.finish(loaded, canvas, surfaces, options, &mut frame)?;
        Ok(frame)
    }

    /// Makes images of the pixels and hands them over.
    fn finish(
        &mut self,
        loaded: &Loaded<T>,
        canvas: &mut Canvas,
        surfaces: Option<Surfaces<'_>>,
        options: EyeOptions,
        frame: &mut EyeFrame,
    ) -> Result<(), RenderError> {
        let layout = &canvas.layout;
        let [width, height] = layout.size;
        let push = Resolve {
            size: layout.size,
            encoding: layout.encoding.number(),
            sparse: (layout.rays != Rays::All).into(),
            unit: layout.depth.map_or(0.0, |depth| depth.unit_in_metres as f32),
            near: layout.depth.map_or(0.0, |depth| depth.near as f32),
        };
        let mut bound = canvas.bound();
        bound.push(Bound::whole(binding::view, &loaded.view));
        fill_up(&mut bound, &self.null);
        let set = BufferSet::new(canvas.resolve.layout(), &bound)?;
        let groups = [width.div_ceil(GROUP_WIDTH), height.div_ceil(GROUP_HEIGHT), 2];
        let eye_pixels = u64::from(width) * u64::from(height);
        let Canvas { packed, depths, resolve, readback, .. } = canvas;
        let [left, right] = readback;
        let mut readback = [Some(left), Some(right)];
        let size = [width, height];
        let elapsed = self.device.submitter.submit("hand eyes over", |r| {
            r.barrier(&[Access::Shaders, Access::Transfer], &[Access::Shaders]);
            r.dispatch(resolve, &set, Some(&push), groups)?;
            r.barrier(&[Access::Shaders], &[Access::Transfer]);
            let Some(surfaces) = &surfaces else { return Ok(()) };
            for (eye, (image, layer)) in surfaces.color.iter().enumerate() {
                r.fill_image(packed, eye as u64 * eye_pixels * image.pixel_bytes(), image, *layer, size)?;
                if let Some(to) = readback[eye].take().filter(|_| options.read_back) {
                    r.read_image(image, *layer, size, to)?;
                }
            }
            if let (Some(depths), Some(surfaces)) = (depths, &surfaces.depth) {
                for (eye, (image, layer)) in surfaces.iter().enumerate() {
                    r.fill_image(depths, eye as u64 * eye_pixels * 4, image, *layer, size)?;
                }
            }
            Ok(())
        })?;
        frame.finish = elapsed.best();
        if options.read_back && surfaces.is_some() {
            let bytes = (eye_pixels * canvas.layout.encoding.bytes()) as usize;
            frame.images = Some([canvas.readback[0].read(bytes)?, canvas.readback[1].read(bytes)?]);
        }
        Ok(())
    }
}

impl Canvas {
    fn bound(&self) -> Vec<Bound> {
        let mut bound = vec![
            Bound::whole(binding::pixels, &self.pixels),
            Bound::whole(binding::packed, &self.packed),
            Bound::whole(binding::rays, &self.rays),
            Bound::whole(binding::rates, &self.rates),
        ];
        bound.extend(self.depths.iter().map(|depths| Bound::whole(binding::depths, depths)));
        bound
    }

    /// The dispatches of a frame with the number of eyes in each: slices of both eyes, or of one after the other.
    fn dispatches(&self, together: bool) -> Vec<(Dispatch, u32)> {
        let offset = [0.5, 0.5];
        let slices = |range: std::ops::Range<u32>, unit: u32| {
            let length = range.len() as u32;
            let step = length.div_ceil(self.slices.max(self.least_slices)).next_multiple_of(unit).max(unit);
            range.step_by(step as usize).map(move |start| (start, step)).collect::<Vec<_>>()
        };
        let [width, height] = self.layout.size;
        match &self.layout.rays {
            Rays::All => {
                let eyes = if together { vec![(0, 2)] } else { vec![(0, 1), (1, 1)] };
                let of = |(eye, number): (u32, u32)| {
                    slices(0..height, GROUP_HEIGHT).into_iter().map(move |(start, step)| {
                        let extent = [width, step.min(height - start)];
                        (Dispatch { origin: [0, start], extent, offset, eye }, number)
                    })
                };
                eyes.into_iter().flat_map(of).collect()
            }
            Rays::Listed(list) => {
                let (first, all) = (list.of_first as u32, list.rays.len() as u32);
                let ends = if together { vec![(0, all)] } else { vec![(0, first), (first, all)] };
                let of = |(start, end): (u32, u32)| {
                    slices(start..end, GROUP_WIDTH * GROUP_HEIGHT).into_iter().map(move |(start, step)| {
                        (Dispatch { origin: [start, 0], extent: [step.min(end - start), 1], offset, eye: 0 }, 1)
                    })
                };
                ends.into_iter().flat_map(of).collect()
            }
        }
    }
}

/// The views of both eyes. Arcs follow the finer of the two, since paths do not know their eye.
fn views<T>(loaded: &Loaded<T>, shots: &[Shot; 2], size: [u32; 2], options: EyeOptions) -> [View; 2] {
    let mut views = shots.map(|shot| Shot { size, samples: 1, ..shot }.view(&loaded.world));
    let tolerance = views[0].tolerance.min(views[1].tolerance);
    for view in &mut views {
        view.tolerance = tolerance;
        view.bounces = options.bounces.unwrap_or(view.bounces).min(view.bounces);
    }
    views
}

impl<T: Tracer> EyeBackend for DeviceBackend<T> {
    fn device_context(&self) -> &Arc<Context> {
        self.context()
    }

    fn as_backend(&mut self) -> &mut dyn Backend {
        self
    }

    fn set_eyes(&mut self, layout: EyeLayout) -> Result<(), RenderError> {
        let Some(loaded) = &mut self.loaded else { return Err(RenderError::NothingLoaded) };
        let geometry = loaded.world.geometry;
        let listed = loaded.world.plan.purpose == Purpose::Eyes { listed: true };
        debug_assert_eq!(listed, layout.rays != Rays::All);
        debug_assert!(layout.largest.iter().all(|side| *side < 1 << LIST_BITS));
        let same = |canvas: &Canvas| {
            let old = &canvas.layout;
            canvas.geometry == geometry
                && (old.largest, old.encoding, old.depth.is_some())
                    == (layout.largest, layout.encoding, layout.depth.is_some())
                && (old.rays == Rays::All) == (layout.rays == Rays::All)
        };
        let mut canvas = match self.eyes.take() {
            Some(canvas) if same(&canvas) => Canvas { layout, ..canvas },
            old => {
                loaded.eyes = None;
                drop(old);
                self.eye_canvas(layout, geometry)?
            }
        };
        if let Rays::Listed(RayList { rays, rates, .. }) = &canvas.layout.rays {
            canvas.rays.upload(&mut self.device.submitter, bytemuck::cast_slice(rays))?;
            canvas.rates.upload(&mut self.device.submitter, bytemuck::cast_slice(rates))?;
        }
        // Pixels without a ray stay as they are from here on.
        let pixels = &canvas.pixels;
        self.device.submitter.submit("clear the eyes", |r| {
            r.barrier(&[Access::Shaders, Access::Transfer], &[Access::Transfer]);
            r.clear(pixels)?;
            r.barrier(&[Access::Transfer], &[Access::Shaders]);
            Ok(())
        })?;
        canvas.slices = canvas.slices.max(1);
        self.eyes = Some(canvas);
        Ok(())
    }

    fn draw_eyes(
        &mut self,
        shots: &[Shot; 2],
        surfaces: Option<Surfaces<'_>>,
        options: EyeOptions,
    ) -> Result<EyeFrame, RenderError> {
        match (self.loaded.take(), self.eyes.take()) {
            (Some(mut loaded), Some(mut canvas)) => {
                let drawn = self.draw_two(&mut loaded, &mut canvas, shots, surfaces, options);
                (self.loaded, self.eyes) = (Some(loaded), Some(canvas));
                drawn
            }
            (loaded, canvas) => {
                (self.loaded, self.eyes) = (loaded, canvas);
                Err(RenderError::NothingLoaded)
            }
        }
    }
}
