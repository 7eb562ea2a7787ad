//! What both levels of acceleration structures have in common: a handle in a buffer of its own.

use crate::vulkan::{Context, VulkanError, memory::Buffer};
use ash::vk;
use std::sync::Arc;

/// Structures lie at multiples of this in their buffers (`VkAccelerationStructureCreateInfoKHR`).
const ALIGNMENT: u64 = 256;

/// An acceleration structure with its memory.
pub(super) struct Structure {
    storage: Buffer,
    handle: vk::AccelerationStructureKHR,
    address: vk::DeviceAddress,
}

impl Structure {
    /// An empty structure of `bytes` bytes.
    pub fn new(
        context: &Arc<Context>,
        name: &str,
        level: vk::AccelerationStructureTypeKHR,
        bytes: u64,
    ) -> Result<Self, VulkanError> {
        let usage = vk::BufferUsageFlags::ACCELERATION_STRUCTURE_STORAGE_KHR;
        let storage = Buffer::with_usage(context, name, bytes, usage, ALIGNMENT)?;
        let functions = &context.tracing()?.acceleration;
        let info = vk::AccelerationStructureCreateInfoKHR::default().buffer(storage.raw()).size(bytes).ty(level);
        let handle = context.call("vkCreateAccelerationStructureKHR", name, |_| {
            // SAFETY: the buffer is alive, has the usage and the size.
            unsafe { functions.create_acceleration_structure(&info, None) }
        })?;
        context.name_object(handle, name);
        let info = vk::AccelerationStructureDeviceAddressInfoKHR::default().acceleration_structure(handle);
        // SAFETY: the handle has just been made.
        let address = unsafe { functions.get_acceleration_structure_device_address(&info) };
        Ok(Self { storage, handle, address })
    }

    pub fn handle(&self) -> vk::AccelerationStructureKHR {
        self.handle
    }

    /// Where the device finds it.
    pub fn address(&self) -> vk::DeviceAddress {
        self.address
    }

    pub fn bytes(&self) -> u64 {
        self.storage.size()
    }

    pub fn name(&self) -> &str {
        self.storage.name()
    }
}

impl Drop for Structure {
    fn drop(&mut self) {
        let context = self.storage.context();
        if context.is_hung() {
            return;
        }
        if let Ok(functions) = context.tracing() {
            // SAFETY: submissions borrow what they trace until they are waited for. The buffer goes after this.
            unsafe { functions.acceleration.destroy_acceleration_structure(self.handle, None) };
        }
    }
}

/// Bytes that a build needs.
pub(super) fn build_sizes(
    context: &Arc<Context>,
    info: &vk::AccelerationStructureBuildGeometryInfoKHR<'_>,
    most: &[u32],
) -> Result<vk::AccelerationStructureBuildSizesInfoKHR<'static>, VulkanError> {
    let mut sizes = vk::AccelerationStructureBuildSizesInfoKHR::default();
    let kind = vk::AccelerationStructureBuildTypeKHR::DEVICE;
    let functions = &context.tracing()?.acceleration;
    // SAFETY: the structure is complete, with one number of primitives per geometry.
    unsafe { functions.get_acceleration_structure_build_sizes(kind, info, most, &mut sizes) };
    Ok(sizes)
}

/// Memory for builds, at the device's alignment.
pub(super) fn scratch(context: &Arc<Context>, bytes: u64) -> Result<Buffer, VulkanError> {
    let alignment = u64::from(context.info().rt().scratch_alignment.max(1));
    Buffer::with_usage(context, "scratch", bytes, vk::BufferUsageFlags::empty(), alignment)
}
