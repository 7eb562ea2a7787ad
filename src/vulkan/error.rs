//! What can go wrong with a device, each with the call, the thing and the limits by name.

use ash::vk;
use std::{path::PathBuf, time::Duration};

/// Vulkan failed.
#[derive(Debug, thiserror::Error)]
pub enum VulkanError {
    /// There is no Vulkan on this machine.
    #[error("no Vulkan loader: {0}")]
    NoLoader(String),
    /// The loader is older than Vulkan 1.2.
    #[error("the Vulkan loader offers version {}.{}, but 1.2 is needed", .0.0, .0.1)]
    OldLoader((u32, u32)),
    /// The loader knows no driver, or its drivers no device.
    #[error("no Vulkan device")]
    NoDevice,
    /// No device has the index or name asked for.
    #[error("no Vulkan device is called {wanted:?}; there {}", list(devices))]
    UnknownDevice {
        /// What was asked for.
        wanted: String,
        /// Index and name of each device.
        devices: Vec<String>,
    },
    /// The device cannot run what it shall run.
    #[error("{device} lacks {}", lacking.join(", "))]
    Lacking {
        /// The device.
        device: String,
        /// What it lacks, in words.
        lacking: Vec<String>,
    },
    /// Validation was asked for where the layer, or its extension for the checks wanted, is not installed.
    #[error("validation is asked for, but {0} is not installed")]
    NoValidation(&'static str),
    /// An environment variable has a value that means nothing.
    #[error("{variable}={value:?} is not one of {known}")]
    Variable {
        /// The variable's name.
        variable: &'static str,
        /// Its value.
        value: String,
        /// The values that it may have.
        known: &'static str,
    },
    /// A Vulkan call failed.
    #[error("{call} for {what}: {result:?}")]
    Call {
        /// The call.
        call: &'static str,
        /// What it was called for.
        what: String,
        /// Its result.
        result: vk::Result,
    },
    /// Memory could not be allocated.
    #[error("vkAllocateMemory for {what} ({size} bytes, {in_use} bytes in use): {cause}")]
    Memory {
        /// What the memory is for.
        what: String,
        /// Bytes asked for.
        size: u64,
        /// Bytes that the program holds already.
        in_use: u64,
        /// The allocator's or the driver's reason.
        cause: String,
    },
    /// A buffer is larger than the device can bind.
    #[error("{what} takes {size} bytes, but {device} binds at most {limit}")]
    TooLarge {
        /// The buffer.
        what: String,
        /// Its size in bytes.
        size: u64,
        /// The device's limit in bytes.
        limit: u64,
        /// The device.
        device: String,
    },
    /// More of something than the device takes.
    #[error("{what}: {count}, but {device} takes at most {limit}")]
    TooMany {
        /// What there is too much of.
        what: String,
        /// How many.
        count: u64,
        /// The device's limit.
        limit: u64,
        /// The device.
        device: String,
    },
    /// Shaders would have to trace inside of one another more deeply than the device grants.
    #[error("recursion to depth {depth} is needed, but {device} traces to depth {limit} at most")]
    Recursion {
        /// Depth needed.
        depth: u32,
        /// The device's limit.
        limit: u32,
        /// The device.
        device: String,
    },
    /// Compiled pipelines could not be kept.
    #[error("pipeline cache {}: {cause}", path.display())]
    Cache {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        cause: String,
    },
    /// The device did not come to an end.
    #[error("vkWaitForFences for {what}: the device did not finish within {limit:?}")]
    TimeOut {
        /// The submission.
        what: String,
        /// How long it was waited for.
        limit: Duration,
    },
    /// An earlier submission never came to an end.
    #[error("{what}: {device} hangs in an earlier submission")]
    Hung {
        /// The submission that is refused.
        what: String,
        /// The device.
        device: String,
    },
    /// Something made from one device is used on another.
    #[error("{what} does not belong to {device}")]
    OtherDevice {
        /// The thing.
        what: String,
        /// The device that shall use it.
        device: String,
    },
    /// A host access outside of a buffer.
    #[error("bytes {start}..{end} of {what} do not exist: it has {size}")]
    OutOfBounds {
        /// The buffer.
        what: String,
        /// First byte.
        start: u64,
        /// End of the bytes.
        end: u64,
        /// Size of the buffer in bytes.
        size: u64,
    },
    /// The build embedded no such shader.
    #[error("shader {entry} is not built for geometry {module}")]
    NoShader {
        /// Entry file.
        entry: String,
        /// Stem of the geometry's files.
        module: String,
    },
}

fn list(devices: &[String]) -> String {
    if devices.is_empty() { "is none".to_owned() } else { format!("are {}", devices.join(", ")) }
}
