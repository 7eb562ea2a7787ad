//! Rendering: one trait, its backends, and what they share.
//!
//! [`plan`] decides without any device which stages a scene needs, [`world`] prepares the scene in the charts of
//! its cells, [`bvh`] builds hierarchies, and each backend has a folder: [`cpu`] in f64, [`compute`] and [`rt`] on
//! Vulkan devices, with what both have in common in [`device`].
//! All draw the same picture from the same [`world::World`].

pub mod auto;
pub mod bvh;
pub mod clock;
pub mod compute;
pub mod cpu;
pub mod device;
pub mod plan;
pub mod rt;
pub mod world;

use crate::{shader_io, space::observer::Frame};
use plan::Plan;
use std::{sync::Arc, time::Duration};
use world::World;

/// Draws pictures of a world.
pub trait Backend {
    /// Name on the command line.
    fn name(&self) -> &'static str;

    /// The device, with driver and version, for statistics.
    fn device(&self) -> String;

    /// Whether this backend can carry out the plan, or what it lacks.
    ///
    /// # Errors
    /// What is missing, in words for the user.
    fn check(&self, plan: &Plan) -> Result<(), Missing>;

    /// Takes a world in: compiles pipelines, uploads buffers. Replaces the previous one.
    ///
    /// # Errors
    /// Device faults, and worlds that do not fit into the device's limits.
    fn load(&mut self, world: &Arc<World>) -> Result<(), RenderError>;

    /// Takes in another pose of the loaded world, one made from it by [`World::posed`].
    ///
    /// # Errors
    /// As [`Backend::load`].
    fn pose(&mut self, world: &Arc<World>) -> Result<(), RenderError> {
        self.load(world)
    }

    /// Keeps what helps the next run. Returns what could not be kept, for a warning: nothing depends on it.
    fn keep(&self) -> Option<String> {
        None
    }

    /// Draws one picture of the loaded world. `progress` is called with the share that is done, from 0 to 1.
    ///
    /// # Errors
    /// Device faults, and [`RenderError::NothingLoaded`].
    fn render(
        &mut self,
        shot: &Shot,
        target: &mut Target,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<Stats, RenderError>;

    /// Does the work of a picture that nobody sees, to measure it: where there is a device, it stays there.
    ///
    /// # Errors
    /// As [`Backend::render`].
    fn trace(&mut self, shot: &Shot) -> Result<Stats, RenderError> {
        self.render(shot, &mut Target::new(shot.size), &|_| ())
    }
}

/// What a backend lacks for a plan.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct Missing(pub String);

/// Why a picture could not be drawn.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// `render` before `load`.
    #[error("no scene is loaded")]
    NothingLoaded,
    /// The device or its driver failed.
    #[error(transparent)]
    Vulkan(#[from] crate::vulkan::VulkanError),
    /// A buffer of the scene is larger than the device can bind.
    #[error("{what} takes {bytes} bytes, but {device} binds at most {limit}")]
    TooLarge {
        /// The buffer.
        what: &'static str,
        /// Its size.
        bytes: u64,
        /// The limit.
        limit: u64,
        /// The device.
        device: String,
    },
}

/// One picture to take.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shot {
    /// The eye, with axes right, up, back.
    pub eye: Frame,
    /// Tangents of the angles from the view direction to the picture's left, right, lower and upper border.
    pub tangents: [f64; 4],
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Samples per pixel; with one, the pixel's centre.
    pub samples: u32,
    /// Turns the pattern of several samples.
    pub seed: u64,
    /// Fewer face passages than the world's settings permit.
    pub bounces: Option<u32>,
}

impl Shot {
    /// A symmetric frustum with vertical field of view `fov` in degrees.
    pub fn symmetric(eye: Frame, fov: f64, size: [u32; 2]) -> Self {
        let up = (0.5 * fov.to_radians()).tan();
        let right = up * f64::from(size[0]) / f64::from(size[1]);
        Self { eye, tangents: [-right, right, -up, up], size, samples: 1, seed: 0, bounces: None }
    }

    /// Position of sample `index` in its pixel: the centre, or a point of a rank-1 lattice (the golden-ratio
    /// generalisation for two dimensions: Roberts, The unreasonable effectiveness of quasirandom sequences, 2018).
    pub fn sample_offset(&self, index: u32) -> [f64; 2] {
        if self.samples == 1 {
            return [0.5, 0.5];
        }
        const PLASTIC: f64 = 1.324_717_957_244_746;
        // The seed shifts the lattice (splitmix64, two draws).
        let mut state = self.seed;
        let mut draw = || {
            state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut z = state;
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
        };
        let n = f64::from(index) + 1.0;
        [(draw() + n / PLASTIC).fract(), (draw() + n / (PLASTIC * PLASTIC)).fract()]
    }

    /// Largest number of face passages of a ray. Labels of cells are tabled for no more than the world's.
    pub fn bounces(&self, world: &World) -> u32 {
        self.bounces.unwrap_or(u32::MAX).min(world.settings.bounces)
    }

    /// The shader's view of the shot.
    pub fn view(&self, world: &World) -> shader_io::View {
        let settings = &world.settings;
        let vec4 = |v: glam::DVec4| v.as_vec4().to_array();
        shader_io::View {
            eye: vec4(self.eye.point),
            right: vec4(self.eye.axes[0]),
            up: vec4(self.eye.axes[1]),
            forward: vec4(-self.eye.axes[2]),
            tangents: self.tangents.map(|t| t as f32),
            background: settings.background,
            fog: settings.fog as f32,
            ambient: settings.ambient,
            max_distance: settings.max_distance.unwrap_or(f64::INFINITY) as f32,
            headlight: settings.headlight,
            tolerance: self.tolerance(settings.tolerance) as f32,
            sagitta: world.sagitta as f32,
            size: self.size,
            bounces: self.bounces(world),
            cell: self.eye.cell as u32,
            integration: settings.method.parameter() as f32,
        }
    }

    /// The tolerance of arcs as an angle seen from the eye: a share of a pixel, of which the picture has so many in its
    /// field of view. (In a picture of 179° the pixel in the middle is 80° high, but those at the border are tiny.)
    pub fn tolerance(&self, share_of_pixel: f64) -> f64 {
        share_of_pixel * (self.tangents[3].atan() - self.tangents[2].atan()) / f64::from(self.size[1])
    }
}

/// Size of a picture of so many views of this size, one beside the other.
pub fn side_by_side(view: [u32; 2], views: u32) -> [u32; 2] {
    [view[0] * views, view[1]]
}

/// A picture: linear RGBA, or a raw value in all of RGB; rows from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Target {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// `width * height` pixels.
    pub pixels: Vec<[f32; 4]>,
}

impl Target {
    /// A black picture.
    pub fn new(size: [u32; 2]) -> Self {
        let pixels = vec![[0.0; 4]; size[0] as usize * size[1] as usize];
        Self { width: size[0], height: size[1], pixels }
    }

    /// Copies a picture in, its upper left corner to column x and row y; all of it must fit.
    ///
    /// # Panics
    /// Where it does not.
    pub fn paste(&mut self, picture: &Target, [x, y]: [u32; 2]) {
        let width = picture.width as usize;
        for (row, line) in picture.pixels.chunks(width.max(1)).enumerate() {
            let start = (y as usize + row) * self.width as usize + x as usize;
            self.pixels[start..start + width].copy_from_slice(line);
        }
    }
}

/// The sRGB transfer function (IEC 61966-2-1), rounded to 8 bits.
pub fn srgb_byte(linear: f32) -> u8 {
    let x = linear.clamp(0.0, 1.0);
    let encoded = if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 };
    (encoded * 255.0 + 0.5) as u8
}

/// What a picture cost.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Stats {
    /// Work counters, indexed by the `COUNT_` numbers of [`shader_io`]; zeros if the plan counts nothing.
    pub counts: [u64; shader_io::COUNT_END as usize],
    /// Time of tracing: device timestamps where there is a device, else wall time.
    pub trace_time: Duration,
    /// Wall time of the whole call.
    pub wall_time: Duration,
    /// Bytes of buffers held for the world and the picture.
    pub memory: u64,
    /// Dispatches submitted (tiles × samples), or tasks run.
    pub dispatches: u64,
    /// What was found of pipelines compiled in earlier runs, of the backends that have some.
    pub pipeline_cache: Option<String>,
    /// Counters that the backend cannot know.
    pub uncounted: &'static [u32],
    /// Acceleration structures, of the backend that has them.
    pub structures: Option<StructureStats>,
}

/// Acceleration structures of a world on a device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StructureStats {
    /// Bottom-level structures of what is in the cells. What single guards hold (software only) is not counted, but its bytes and
    /// builds are.
    pub bottom: u64,
    /// Bytes that the driver reserved for those that never change.
    pub bytes_built: u64,
    /// Bytes that are left of them after compaction.
    pub bytes_compacted: u64,
    /// Bytes of those that can be refitted, with their scratch memory.
    pub bytes_moving: u64,
    /// Instances in top-level structures.
    pub instances: u64,
    /// Bytes of top-level structures with their instances and scratch memory.
    pub bytes_top: u64,
    /// Bytes of the shader binding table.
    pub bytes_table: u64,
    /// Builds from nothing so far, of both levels.
    pub builds: u64,
    /// Refits so far, of both levels.
    pub refits: u64,
}
