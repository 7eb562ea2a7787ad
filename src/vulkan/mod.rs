//! Safe wrappers around Vulkan: whatever the rest of the program does with a device goes through here.
//!
//! | module | holds | lives |
//! | --- | --- | --- |
//! | [`instance`] | loader, instance, messenger of the validation layer | as long as its context |
//! | [`tier`] | what a device is and which tier of the renderer it can run | – |
//! | [`context`] | logical device, queue, allocator, pipeline cache | until the last buffer, pipeline or submitter that holds its `Arc` is gone |
//! | [`cache`] | compiled pipelines on disk | – |
//! | [`image`] | images of a swapchain, which somebody else owns | as long as their owner keeps them |
//! | [`memory`] | buffers | as long as their owner likes |
//! | [`tracing`] | acceleration structures, ray tracing pipelines, shader binding tables | the same |
//! | [`shader`] | embedded SPIR-V, layouts, compute pipelines | the same |
//! | [`descriptor`] | sets of storage buffers; they keep their buffers alive | the same |
//! | [`command`], [`record`] | submission, waiting, time stamps; what is submitted | a submission is over when [`command::Submitter::submit`] returns |
//!
//! **Two rules make the wrappers safe.** Nothing runs on the device outside of `submit`, which waits for its end
//! and borrows all it uses for that long; so nothing is destroyed or read by the host while the device works on
//! it. And after a wait that ran into its time-out, when the first rule cannot be kept any more, the context
//! counts as hung: later submissions are refused and nothing of it is ever destroyed.
//!
//! Every call that can fail goes through `call` of [`fault::FaultInjection`], which names it in the error and lets
//! tests make it fail.

pub mod cache;
pub mod command;
pub mod context;
pub mod descriptor;
pub mod error;
pub mod fault;
pub mod image;
pub mod instance;
pub mod memory;
pub mod options;
pub mod record;
pub mod shader;
pub mod tier;
pub mod tracing;

pub use context::Context;
pub use error::VulkanError;
pub use options::{ContextOptions, Validation};
pub use tier::{DeviceInfo, DeviceKind, Tier};

/// Vulkan devices of this machine, in the loader's order: an index into the list, as text, is a value of
/// [`ContextOptions::device`].
///
/// # Errors
/// No Vulkan loader, no usable instance, or the validation layer is asked for and absent.
pub fn devices(options: &ContextOptions) -> Result<Vec<DeviceInfo>, VulkanError> {
    instance::Instance::new(options, &mut instance::Loader)?.devices()
}
