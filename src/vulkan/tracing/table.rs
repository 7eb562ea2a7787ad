//! Shader binding tables: which shaders a trace calls, with the numbers that they are told.

use super::pipeline::TracePipeline;
use crate::vulkan::{Context, VulkanError, command::Submitter, memory::Buffer};
use ash::vk;
use bytemuck::Pod;
use std::sync::Arc;

/// A hit record: a group and what its shaders read as `shaderRecordEXT`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Record<T> {
    /// Index of the hit group.
    pub group: usize,
    /// The shaders' data.
    pub data: T,
}

/// The table of a pipeline.
pub struct ShaderTable {
    buffer: Buffer,
    /// The pipeline whose handles it holds.
    pipeline: vk::Pipeline,
    raygen: vk::StridedDeviceAddressRegionKHR,
    miss: vk::StridedDeviceAddressRegionKHR,
    hit: vk::StridedDeviceAddressRegionKHR,
}

impl std::fmt::Debug for ShaderTable {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "ShaderTable({} bytes)", self.buffer.size())
    }
}

/// Records of one kind while the table is laid out.
struct Section {
    offset: u64,
    stride: u64,
    count: u64,
}

impl Section {
    fn end(&self) -> u64 {
        self.offset + self.stride * self.count
    }

    fn region(&self, base: vk::DeviceAddress) -> vk::StridedDeviceAddressRegionKHR {
        if self.count == 0 {
            return vk::StridedDeviceAddressRegionKHR::default();
        }
        vk::StridedDeviceAddressRegionKHR {
            device_address: base + self.offset,
            stride: self.stride,
            size: self.stride * self.count,
        }
    }
}

impl ShaderTable {
    /// The table for `pipeline`, with its raygen and miss shaders and these hit records.
    ///
    /// # Errors
    /// Driver failures; records larger than the device's stride, or of groups that do not exist.
    pub fn new<T: Pod>(
        context: &Arc<Context>,
        submitter: &mut Submitter,
        pipeline: &TracePipeline,
        records: &[Record<T>],
    ) -> Result<Self, VulkanError> {
        let limits = context.info().rt();
        let [handle, align, base] =
            [limits.handle_size, limits.handle_alignment, limits.base_alignment].map(|x| u64::from(x.max(1)));
        let stride = |data: usize| (handle + data as u64).next_multiple_of(align);
        // A raygen record is a part of its own, so it also keeps the distance of parts.
        let raygen = Section { offset: 0, stride: stride(0).next_multiple_of(base), count: 1 };
        let misses: Vec<&[u8]> = pipeline.miss_handles().collect();
        let miss =
            Section { offset: raygen.end().next_multiple_of(base), stride: stride(0), count: misses.len() as u64 };
        let hit = Section {
            offset: miss.end().next_multiple_of(base),
            stride: stride(size_of::<T>()),
            count: records.len() as u64,
        };
        if hit.stride > u64::from(limits.max_stride) {
            let (what, device) = (String::from("a hit record"), context.info().name.clone());
            return Err(VulkanError::TooLarge { what, size: hit.stride, limit: limits.max_stride.into(), device });
        }
        let mut bytes = vec![0_u8; hit.end() as usize];
        let mut put = |section: &Section, index: usize, handle: &[u8], data: &[u8]| {
            let at = (section.offset + section.stride * index as u64) as usize;
            bytes[at..at + handle.len()].copy_from_slice(handle);
            bytes[at + handle.len()..][..data.len()].copy_from_slice(data);
        };
        put(&raygen, 0, pipeline.raygen_handle(), &[]);
        for (index, handle) in misses.into_iter().enumerate() {
            put(&miss, index, handle, &[]);
        }
        for (index, record) in records.iter().enumerate() {
            let group = record.group as u64;
            let missing = || VulkanError::OutOfBounds {
                what: format!("hit groups of {}", pipeline.name()),
                start: group,
                end: group + 1,
                size: 0,
            };
            let handle = pipeline.hit_handle(record.group).ok_or_else(missing)?;
            put(&hit, index, handle, bytemuck::bytes_of(&record.data));
        }
        let usage = vk::BufferUsageFlags::SHADER_BINDING_TABLE_KHR;
        let buffer = Buffer::from_slice_for(context, submitter, "shader binding table", &bytes, usage, base)?;
        let address = buffer.address();
        Ok(Self {
            pipeline: pipeline.raw(),
            raygen: raygen.region(address),
            miss: miss.region(address),
            hit: hit.region(address),
            buffer,
        })
    }

    /// Its size in bytes.
    pub fn bytes(&self) -> u64 {
        self.buffer.size()
    }

    pub(super) fn context(&self) -> &Arc<Context> {
        self.buffer.context()
    }

    /// Whether it was made for this pipeline.
    pub(super) fn is_of(&self, pipeline: &TracePipeline) -> bool {
        self.pipeline == pipeline.raw()
    }

    /// Raygen, miss and hit records.
    pub(super) fn regions(&self) -> [&vk::StridedDeviceAddressRegionKHR; 3] {
        [&self.raygen, &self.miss, &self.hit]
    }
}
