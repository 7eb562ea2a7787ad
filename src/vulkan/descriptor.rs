//! Layouts, and descriptor sets of buffers.

use super::{Context, VulkanError, memory::Buffer, memory::check_range};
use crate::shader_io::{BINDINGS, STORAGE_BUFFERS, UNIFORM_BUFFERS};
use ash::vk;
use std::sync::Arc;

/// What pipelines take: the bindings of [`shader_io`](crate::shader_io) in descriptor set 0, and push constants.
pub struct Layout {
    context: Arc<Context>,
    name: String,
    set: vk::DescriptorSetLayout,
    pipeline: vk::PipelineLayout,
    stages: vk::ShaderStageFlags,
    push_bytes: u32,
}

impl std::fmt::Debug for Layout {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Layout({})", self.name)
    }
}

impl Layout {
    /// A layout for pipelines whose `stages` see the bindings and `push_bytes` bytes of push constants. `name` is
    /// for messages.
    ///
    /// # Errors
    /// Driver failures.
    pub fn new(
        context: &Arc<Context>,
        name: &str,
        stages: vk::ShaderStageFlags,
        push_bytes: u32,
    ) -> Result<Self, VulkanError> {
        // Handles that are still null are skipped by `Drop`, which cleans up after each failure below.
        let mut layout = Self {
            context: context.clone(),
            name: name.to_owned(),
            set: vk::DescriptorSetLayout::null(),
            pipeline: vk::PipelineLayout::null(),
            stages,
            push_bytes,
        };
        let bindings: Vec<_> = (0..BINDINGS)
            .map(|binding| {
                vk::DescriptorSetLayoutBinding::default()
                    .binding(binding)
                    .descriptor_type(kind(binding))
                    .descriptor_count(1)
                    .stage_flags(stages)
            })
            .collect();
        let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
        // SAFETY: the context is alive and the structure complete.
        layout.set = context
            .call("vkCreateDescriptorSetLayout", name, |d| unsafe { d.create_descriptor_set_layout(&info, None) })?;
        let sets = [layout.set];
        let push = [vk::PushConstantRange::default().stage_flags(stages).size(push_bytes)];
        let mut info = vk::PipelineLayoutCreateInfo::default().set_layouts(&sets);
        if push_bytes > 0 {
            info = info.push_constant_ranges(&push);
        }
        // SAFETY: as above; the set layout has just been made.
        layout.pipeline =
            context.call("vkCreatePipelineLayout", name, |d| unsafe { d.create_pipeline_layout(&info, None) })?;
        Ok(layout)
    }

    pub(crate) fn context(&self) -> &Arc<Context> {
        &self.context
    }

    pub(crate) fn raw(&self) -> vk::PipelineLayout {
        self.pipeline
    }

    pub(crate) fn stages(&self) -> vk::ShaderStageFlags {
        self.stages
    }

    pub(crate) fn push_bytes(&self) -> u32 {
        self.push_bytes
    }
}

impl Drop for Layout {
    fn drop(&mut self) {
        if self.context.is_hung() {
            return;
        }
        // SAFETY: submissions borrow pipelines, which own their layouts, until they are waited for; null handles
        // are ignored.
        unsafe {
            self.context.raw().destroy_pipeline_layout(self.pipeline, None);
            self.context.raw().destroy_descriptor_set_layout(self.set, None);
        }
    }
}

/// What the buffer of a binding number is for shaders.
fn kind(binding: u32) -> vk::DescriptorType {
    if binding < STORAGE_BUFFERS { vk::DescriptorType::STORAGE_BUFFER } else { vk::DescriptorType::UNIFORM_BUFFER }
}

/// What is bound to one binding number.
#[derive(Clone, Debug)]
pub struct Bound {
    /// The binding number.
    pub binding: u32,
    /// The buffer, which the set keeps alive.
    pub buffer: Arc<Buffer>,
    /// Bytes that the shader sees, from the start of the buffer; `.length()` follows from them.
    pub bytes: u64,
}

impl Bound {
    /// The whole buffer.
    pub fn whole(binding: u32, buffer: &Arc<Buffer>) -> Self {
        Self { binding, buffer: buffer.clone(), bytes: buffer.size() }
    }
}

/// The descriptor set 0 of a layout, filled. Keeps its buffers alive.
pub struct BufferSet {
    context: Arc<Context>,
    pool: vk::DescriptorPool,
    handle: vk::DescriptorSet,
    _buffers: Vec<Arc<Buffer>>,
}

impl std::fmt::Debug for BufferSet {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("BufferSet").finish_non_exhaustive()
    }
}

impl BufferSet {
    /// A set for pipelines of this layout. Bindings that their shaders use must all be named.
    ///
    /// # Errors
    /// Driver failures; [`VulkanError::TooLarge`] beyond the device's largest range.
    pub fn new(layout: &Layout, bound: &[Bound]) -> Result<Self, VulkanError> {
        let (context, name) = (&layout.context, layout.name.as_str());
        let limit = context.info().max_storage_range;
        for b in bound {
            check_range(b.buffer.name(), 0, b.bytes, b.buffer.size())?;
            if b.bytes > limit {
                let device = context.info().name.clone();
                return Err(VulkanError::TooLarge {
                    what: format!("buffer {}", b.buffer.name()),
                    size: b.bytes,
                    limit,
                    device,
                });
            }
        }
        let (storage, uniform) = (vk::DescriptorType::STORAGE_BUFFER, vk::DescriptorType::UNIFORM_BUFFER);
        let sizes = [(storage, STORAGE_BUFFERS), (uniform, UNIFORM_BUFFERS)]
            .map(|(ty, descriptor_count)| vk::DescriptorPoolSize { ty, descriptor_count });
        let info = vk::DescriptorPoolCreateInfo::default().max_sets(1).pool_sizes(&sizes);
        // SAFETY: the context is alive and the structure complete.
        let pool =
            context.call("vkCreateDescriptorPool", name, |d| unsafe { d.create_descriptor_pool(&info, None) })?;
        // From here on `Drop` cleans up.
        let mut set = Self {
            context: context.clone(),
            pool,
            handle: vk::DescriptorSet::null(),
            _buffers: bound.iter().map(|b| b.buffer.clone()).collect(),
        };
        let layouts = [layout.set];
        let info = vk::DescriptorSetAllocateInfo::default().descriptor_pool(pool).set_layouts(&layouts);
        set.handle = context.call("vkAllocateDescriptorSets", name, |d| {
            // SAFETY: pool and layout are alive, and the pool is made for one set of this layout.
            unsafe { d.allocate_descriptor_sets(&info) }.map(|sets| sets.first().copied().unwrap_or_default())
        })?;
        let ranges: Vec<_> = bound
            .iter()
            .map(|b| [vk::DescriptorBufferInfo::default().buffer(b.buffer.raw()).range(b.bytes.max(4))])
            .collect();
        let writes: Vec<_> = bound
            .iter()
            .zip(&ranges)
            .map(|(b, range)| {
                vk::WriteDescriptorSet::default()
                    .dst_set(set.handle)
                    .dst_binding(b.binding)
                    .descriptor_type(kind(b.binding))
                    .buffer_info(range)
            })
            .collect();
        // SAFETY: the set is new, so no submission uses it; ranges lie in their buffers, which the set keeps.
        unsafe { context.raw().update_descriptor_sets(&writes, &[]) };
        Ok(set)
    }

    pub(super) fn context(&self) -> &Arc<Context> {
        &self.context
    }

    pub(super) fn handle(&self) -> vk::DescriptorSet {
        self.handle
    }
}

impl Drop for BufferSet {
    fn drop(&mut self) {
        if !self.context.is_hung() {
            // SAFETY: submissions borrow their sets until they are waited for. The pool takes its set along.
            unsafe { self.context.raw().destroy_descriptor_pool(self.pool, None) };
        }
    }
}
