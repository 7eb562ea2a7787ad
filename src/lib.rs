//! Holonomy: a real-time ray tracer inside Thurston's geometries.
#![warn(missing_docs)]

pub mod cli;
pub mod geometry;
pub mod render;
pub mod scene;
pub mod shader_io;
pub mod space;
pub mod view;
pub mod vulkan;
