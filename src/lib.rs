//! Holonomy: a real-time ray tracer inside Thurston's geometries, and the manifolds and orbifolds made from them.
//!
//! It carries the system of the book *Visualizing Thurston's Geometries* (Novello, da Silva, Velho 2021), Riemannian
//! ray tracing with a miss shader that transports rays through the faces of a fundamental domain, over to Rust and
//! Vulkan. The name is what a frame picks up when it is carried around a closed path.
//!
//! # Words
//! | word | meaning |
//! | --- | --- |
//! | model geometry | a simply connected homogeneous space: a [`geometry`] |
//! | deck group, pairing | the discrete group of a quotient, and its generator attached to a face of the domain |
//! | cell, domain | a convex polyhedron with its faces glued in pairs; a [`space::Space`] has one or more |
//! | chart | affine coordinates of a cell, in which meshes are stored and hierarchies are built |
//! | segment | a piece of the chart that is given to traversal: a whole crossing where geodesics are straight in the chart, elsewhere an arc of a parabola that follows the curve |
//! | bounce | one passage of a ray through a face, mirrors included; not a reflection off an object |
//! | observer | a point and an orthonormal frame; eyes, head and hands hang off it by the exponential map |
//!
//! # How a picture comes about
//! 1. [`scene::file`] reads a scene: a space, objects, lights, an observer.
//! 2. [`render::plan`] decides, without a device, which stages and buffers the scene needs.
//! 3. [`render::world`] places objects by the exponential map and cuts them to the cells they reach into; it builds
//!    hierarchies for the backends that traverse them themselves.
//! 4. A [`render::Backend`] draws it: [`render::cpu`] in f64 (the reference), [`render::compute`] and [`render::rt`] on
//!    Vulkan. The stages have the same names in `shaders/` and in `src/render/cpu/`: raygen, segment, hit (closest-hit),
//!    shade, transport (the miss stage). `shaders/trace/` holds the two ways to trace a segment, `shaders/entry/` what
//!    each pipeline starts.
//!
//! ```
//! use holonomy::{render::{Backend, Shot, Target, cpu::CpuBackend, plan::Plan, world::World}, scene::file};
//! use std::sync::Arc;
//!
//! let scene = file::load("poincare")?;
//! let plan = Plan::new(&scene, false);
//! let world = Arc::new(World::new(&scene, &plan, scene.observer.frame)?);
//! let mut backend = CpuBackend::default();
//! backend.load(&world)?;
//! let shot = Shot::symmetric(scene.observer.frame, scene.observer.fov, [64, 48]);
//! let mut picture = Target::new(shot.size);
//! backend.render(&shot, &mut picture, &|_| ())?;
//! assert!(picture.pixels.iter().any(|p| p[0] > 0.1));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Map of the modules
//! `geometry ← integrate ← space ← scene ← render ← {view, measure} ← cli`, and `vulkan ← render`; a test reads the imports.
//!
//! | you want | look at |
//! | --- | --- |
//! | a formula of a geometry | `src/geometry/<name>.rs` and its twin `shaders/geometry/<name>.glsl` |
//! | how geodesics are integrated | [`integrate`], [`space::stepped`], `shaders/shared/integrate.glsl`, `shaders/stage/stepped.glsl` |
//! | what every geometry must satisfy | [`geometry::laws`] |
//! | a named space | [`space::catalogue`] |
//! | how a ray passes a face | [`space::walk`], `shaders/stage/walk.glsl` |
//! | the proof that a gluing closes | [`space::check`] |
//! | a structure that shaders read | [`shader_io`] |
//! | the reference that errors are measured against | [`mod@measure::reference`] |
//! | a stiff or extreme case | [`measure::stability`] |
//! | what is measured, tables and plots | [`measure`] |
//! | frame time, and what a pixel costs | [`measure::profile`], [`measure::heatmap`] |
//! | what a headset shows, and how a session ends | [`view::xr`] |
//! | where eyes and hands of a player are | [`space::body`] |
//! | an option of the command line | [`cli`] |
//!
//! # Recipes
//! **Add a geometry.** 1. Write `src/geometry/<name>.rs` with a unit type that implements [`geometry::Geometry`].
//! 2. Write `shaders/geometry/<name>.glsl` with the functions in the header of `e3.glsl`. 3. Add a line to
//! `src/geometry/registry.rs`. The tests `laws`, `shaders_geometries_fulfil_the_contract` and `architecture` complain
//! if a step is missing.
//!
//! **Add a space.** Add a builder and a line in [`space::catalogue`], and a scene `scenes/<name>.toml`; the tests
//! `spaces` and `scene` walk both.
//!
//! **Add an option.** Add a field with its help to the command's structure in [`cli`] and use it there; the parser,
//! the checks and `--help` follow.
//!
//! **Add something to a shader structure.** Change it in [`shader_io`] and where it is filled (`render/device/pack.rs`);
//! `shaders_layout_agrees_with_rust` compares the offsets.
#![warn(missing_docs)]

pub mod cli;
pub mod geometry;
pub mod integrate;
pub mod measure;
pub mod render;
pub mod scene;
pub mod shader_io;
pub mod space;
pub mod view;
pub mod vulkan;
