//! Buffers. [`Buffer`] lives in the device's memory and is filled and read through [`HostBuffer`], which the host
//! can see; the types keep apart what the host may touch while the device is at work.

use super::{Context, VulkanError, command::Submitter};
use ash::vk;
use bytemuck::Pod;
use gpu_allocator::{
    AllocationError, MemoryLocation,
    vulkan::{Allocation, AllocationCreateDesc, AllocationScheme},
};
use std::sync::Arc;

/// Uploads go through staging buffers of at most this size, so that a large scene does not need its memory twice.
const STAGING_BYTES: u64 = 64 << 20;

/// What buffers of scenes are used for.
const STORAGE: vk::BufferUsageFlags = vk::BufferUsageFlags::from_raw(
    vk::BufferUsageFlags::STORAGE_BUFFER.as_raw()
        | vk::BufferUsageFlags::UNIFORM_BUFFER.as_raw()
        | vk::BufferUsageFlags::TRANSFER_SRC.as_raw()
        | vk::BufferUsageFlags::TRANSFER_DST.as_raw()
        | vk::BufferUsageFlags::SHADER_DEVICE_ADDRESS.as_raw(),
);

/// A buffer with memory of its own, and its name.
struct Block {
    context: Arc<Context>,
    handle: vk::Buffer,
    allocation: Option<Allocation>,
    size: u64,
    name: String,
}

impl Block {
    fn new(
        context: &Arc<Context>,
        name: &str,
        size: u64,
        usage: vk::BufferUsageFlags,
        location: MemoryLocation,
        alignment: u64,
    ) -> Result<Self, VulkanError> {
        let info = vk::BufferCreateInfo::default().size(size).usage(usage).sharing_mode(vk::SharingMode::EXCLUSIVE);
        let what = format!("buffer {name} ({size} bytes)");
        // SAFETY: the context is alive; a size of 0 is excluded by the callers.
        let handle = context.call("vkCreateBuffer", &what, |d| unsafe { d.create_buffer(&info, None) })?;
        // From here on `Drop` cleans up.
        let mut block = Self { context: context.clone(), handle, allocation: None, size: 0, name: name.to_owned() };
        // SAFETY: the buffer has just been created from this device.
        let mut requirements = unsafe { context.raw().get_buffer_memory_requirements(handle) };
        requirements.alignment = requirements.alignment.max(alignment);
        let memory_error = |cause: String| VulkanError::Memory {
            what: format!("buffer {name}"),
            size: requirements.size,
            in_use: context.memory_in_use(),
            cause,
        };
        if let Some(fault) = context.faults().next("vkAllocateMemory") {
            return Err(memory_error(format!("{fault:?}")));
        }
        let description = AllocationCreateDesc {
            name,
            requirements,
            location,
            linear: true,
            allocation_scheme: AllocationScheme::GpuAllocatorManaged,
        };
        let allocation = context.allocator().allocate(&description).map_err(|e| {
            memory_error(match e {
                AllocationError::OutOfMemory => "out of device memory".to_owned(),
                other => other.to_string(),
            })
        })?;
        // SAFETY: memory and offset come from the allocator and stay valid until the allocation is freed.
        let bound = context.call("vkBindBufferMemory", &what, |d| unsafe {
            d.bind_buffer_memory(handle, allocation.memory(), allocation.offset())
        });
        block.allocation = Some(allocation);
        bound?;
        block.size = size;
        context.account(size);
        context.name_object(handle, name);
        Ok(block)
    }
}

impl Drop for Block {
    fn drop(&mut self) {
        self.context.release(self.size);
        if self.context.is_hung() {
            return;
        }
        // SAFETY: submissions borrow the buffers they use until they are waited for, so the device is done.
        unsafe { self.context.raw().destroy_buffer(self.handle, None) };
        if let Some(allocation) = self.allocation.take() {
            // Fails only for an allocation of another allocator; and a destructor has nobody to tell.
            let _ = self.context.allocator().free(allocation);
        }
    }
}

/// A buffer in the device's memory.
pub struct Buffer(Block);

impl std::fmt::Debug for Buffer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Buffer({}, {} bytes)", self.name(), self.size())
    }
}

impl Buffer {
    /// A storage buffer of `size` bytes (at least 4 are taken) with undefined content.
    ///
    /// # Errors
    /// Driver failures; out of memory.
    pub fn new(context: &Arc<Context>, name: &str, size: u64) -> Result<Self, VulkanError> {
        Self::with_usage(context, name, size, vk::BufferUsageFlags::empty(), 1)
    }

    /// The same for further uses, at a multiple of `alignment` bytes (a power of two) in its memory.
    ///
    /// # Errors
    /// Driver failures; out of memory.
    pub fn with_usage(
        context: &Arc<Context>,
        name: &str,
        size: u64,
        usage: vk::BufferUsageFlags,
        alignment: u64,
    ) -> Result<Self, VulkanError> {
        // Filling works in words, and an empty buffer is not allowed.
        let size = size.max(4).next_multiple_of(4);
        Block::new(context, name, size, STORAGE | usage, MemoryLocation::GpuOnly, alignment).map(Self)
    }

    /// A storage buffer with content.
    ///
    /// # Errors
    /// Driver failures; out of memory.
    pub fn from_slice<T: Pod>(
        context: &Arc<Context>,
        submitter: &mut Submitter,
        name: &str,
        data: &[T],
    ) -> Result<Self, VulkanError> {
        Self::from_slice_for(context, submitter, name, data, vk::BufferUsageFlags::empty(), 1)
    }

    /// The same for further uses, as [`Self::with_usage`].
    ///
    /// # Errors
    /// Driver failures; out of memory.
    pub fn from_slice_for<T: Pod>(
        context: &Arc<Context>,
        submitter: &mut Submitter,
        name: &str,
        data: &[T],
        usage: vk::BufferUsageFlags,
        alignment: u64,
    ) -> Result<Self, VulkanError> {
        let bytes: &[u8] = bytemuck::cast_slice(data);
        let buffer = Self::with_usage(context, name, bytes.len() as u64, usage, alignment)?;
        buffer.upload(submitter, bytes)?;
        Ok(buffer)
    }

    /// Replaces the start of the content; waits until it is there.
    ///
    /// # Errors
    /// Driver failures; more bytes than the buffer has.
    pub fn upload(&self, submitter: &mut Submitter, bytes: &[u8]) -> Result<(), VulkanError> {
        self.upload_at(submitter, 0, bytes)
    }

    /// Replaces the content from byte `start` on, a multiple of 4.
    ///
    /// # Errors
    /// As [`Self::upload`].
    pub fn upload_at(&self, submitter: &mut Submitter, start: u64, bytes: &[u8]) -> Result<(), VulkanError> {
        check_range(self.name(), start, bytes.len() as u64, self.size())?;
        if bytes.is_empty() {
            return Ok(());
        }
        let name = format!("staging for {}", self.name());
        let size = (bytes.len() as u64).min(STAGING_BYTES);
        let mut staging = HostBuffer::new(&self.0.context, &name, size, Direction::Upload)?;
        for (index, chunk) in bytes.chunks(STAGING_BYTES as usize).enumerate() {
            staging.write(0, chunk)?;
            let offset = start + index as u64 * STAGING_BYTES;
            submitter.submit(&name, |r| r.upload(&staging, self, offset, chunk.len() as u64))?;
        }
        Ok(())
    }

    /// Its name.
    pub fn name(&self) -> &str {
        &self.0.name
    }

    /// Its size in bytes.
    pub fn size(&self) -> u64 {
        self.0.size
    }

    pub(crate) fn raw(&self) -> vk::Buffer {
        self.0.handle
    }

    /// Where the device finds it.
    pub fn address(&self) -> vk::DeviceAddress {
        let info = vk::BufferDeviceAddressInfo::default().buffer(self.raw());
        // SAFETY: the buffer is alive, was made with `SHADER_DEVICE_ADDRESS`, and every tier enables the feature.
        unsafe { self.0.context.raw().get_buffer_device_address(&info) }
    }

    pub(super) fn context(&self) -> &Arc<Context> {
        &self.0.context
    }
}

/// Which way data go through a [`HostBuffer`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// Written by the host, read by the device.
    Upload,
    /// Written by the device, read by the host.
    Readback,
}

/// A buffer that the host can see, always coherent.
pub struct HostBuffer(Block);

impl std::fmt::Debug for HostBuffer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "HostBuffer({}, {} bytes)", self.0.name, self.0.size)
    }
}

impl HostBuffer {
    /// A buffer of `size` bytes (at least 4 are taken) with undefined content.
    ///
    /// # Errors
    /// Driver failures; out of memory.
    pub fn new(context: &Arc<Context>, name: &str, size: u64, direction: Direction) -> Result<Self, VulkanError> {
        let (usage, location) = match direction {
            Direction::Upload => (vk::BufferUsageFlags::TRANSFER_SRC, MemoryLocation::CpuToGpu),
            Direction::Readback => (vk::BufferUsageFlags::TRANSFER_DST, MemoryLocation::GpuToCpu),
        };
        Block::new(context, name, size.max(4).next_multiple_of(4), usage, location, 1).map(Self)
    }

    /// Copies bytes into the buffer.
    ///
    /// # Errors
    /// [`VulkanError::OutOfBounds`].
    pub fn write(&mut self, offset: u64, bytes: &[u8]) -> Result<(), VulkanError> {
        let range = check_range(&self.0.name, offset, bytes.len() as u64, self.0.size)?;
        let name = &self.0.name;
        let mapped = self.0.allocation.as_mut().and_then(Allocation::mapped_slice_mut);
        mapped.ok_or_else(|| not_mapped(name))?[range].copy_from_slice(bytes);
        Ok(())
    }

    /// The first `count` elements.
    ///
    /// # Errors
    /// [`VulkanError::OutOfBounds`].
    pub fn read<T: Pod>(&self, count: usize) -> Result<Vec<T>, VulkanError> {
        let bytes = (count as u64).saturating_mul(size_of::<T>() as u64);
        let range = check_range(&self.0.name, 0, bytes, self.0.size)?;
        let mapped = self.0.allocation.as_ref().and_then(Allocation::mapped_slice);
        Ok(bytemuck::pod_collect_to_vec(&mapped.ok_or_else(|| not_mapped(&self.0.name))?[range]))
    }

    /// Its size in bytes.
    pub fn size(&self) -> u64 {
        self.0.size
    }

    pub(super) fn name(&self) -> &str {
        &self.0.name
    }

    pub(crate) fn raw(&self) -> vk::Buffer {
        self.0.handle
    }

    pub(super) fn context(&self) -> &Arc<Context> {
        &self.0.context
    }
}

fn not_mapped(name: &str) -> VulkanError {
    VulkanError::Call {
        call: "vkMapMemory",
        what: format!("buffer {name}"),
        result: vk::Result::ERROR_MEMORY_MAP_FAILED,
    }
}

/// The range as indices, if it lies in a buffer of `size` bytes.
pub(super) fn check_range(
    name: &str,
    start: u64,
    length: u64,
    size: u64,
) -> Result<std::ops::Range<usize>, VulkanError> {
    let end = start.saturating_add(length);
    let error = || VulkanError::OutOfBounds { what: format!("buffer {name}"), start, end, size };
    if end > size {
        return Err(error());
    }
    match (usize::try_from(start), usize::try_from(end)) {
        (Ok(start), Ok(end)) => Ok(start..end),
        _ => Err(error()),
    }
}
