//! The ray tracing pipeline: acceleration structures, pipelines with their shader binding tables, and the commands
//! that build and trace.
//!
//! | module | holds |
//! | --- | --- |
//! | [`bottom`] | bottom-level structures over triangles and boxes: built in batches, compacted, or refitted |
//! | [`top`] | top-level structures over instances of them |
//! | [`pipeline`] | pipelines of raygen, miss and hit shaders |
//! | [`table`] | shader binding tables |

pub mod bottom;
pub mod pipeline;
mod structure;
pub mod table;
pub mod top;

use ash::khr;

/// Functions of the extensions.
pub(super) struct Functions {
    pub acceleration: khr::acceleration_structure::Device,
    pub pipeline: khr::ray_tracing_pipeline::Device,
}

impl Functions {
    pub fn new(instance: &ash::Instance, device: &ash::Device) -> Self {
        Self {
            acceleration: khr::acceleration_structure::Device::new(instance, device),
            pipeline: khr::ray_tracing_pipeline::Device::new(instance, device),
        }
    }
}
