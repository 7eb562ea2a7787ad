//! Recording of commands.

use super::{
    Context, Tier, VulkanError,
    descriptor::BufferSet,
    memory::{Buffer, HostBuffer, check_range},
    shader::ComputePipeline,
};
use ash::vk;
use bytemuck::Pod;
use std::{marker::PhantomData, sync::Arc};

/// Most bytes that Vulkan carries inside of commands.
pub const INLINE_BYTES: u64 = 65536;

/// Commands between begin and end. What they use is borrowed for `'a`, which outlasts the submission.
pub struct Recorder<'a> {
    context: Arc<Context>,
    commands: vk::CommandBuffer,
    borrowed: PhantomData<&'a Buffer>,
}

impl std::fmt::Debug for Recorder<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Recorder").finish_non_exhaustive()
    }
}

/// Who touches memory before or after a barrier.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Shaders, reading and writing: compute shaders, and where the context is for ray tracing its shaders too.
    Shaders,
    /// Copies and fills.
    Transfer,
    /// Builds of acceleration structures: they read buffers and other structures.
    Build,
    /// The host, after the submission.
    Host,
}

impl Access {
    fn source(self, tier: Tier) -> (vk::PipelineStageFlags, vk::AccessFlags) {
        match self {
            Self::Shaders => (shader_stages(tier), vk::AccessFlags::SHADER_WRITE),
            Self::Build => (
                vk::PipelineStageFlags::ACCELERATION_STRUCTURE_BUILD_KHR,
                vk::AccessFlags::ACCELERATION_STRUCTURE_WRITE_KHR,
            ),
            Self::Transfer => (vk::PipelineStageFlags::TRANSFER, vk::AccessFlags::TRANSFER_WRITE),
            Self::Host => (vk::PipelineStageFlags::HOST, vk::AccessFlags::HOST_WRITE),
        }
    }

    fn destination(self, tier: Tier) -> (vk::PipelineStageFlags, vk::AccessFlags) {
        let (stage, write) = self.source(tier);
        let read = match self {
            Self::Shaders if tier == Tier::Rt => {
                vk::AccessFlags::SHADER_READ | vk::AccessFlags::ACCELERATION_STRUCTURE_READ_KHR
            }
            Self::Shaders => vk::AccessFlags::SHADER_READ,
            Self::Build => vk::AccessFlags::ACCELERATION_STRUCTURE_READ_KHR | vk::AccessFlags::SHADER_READ,
            Self::Transfer => vk::AccessFlags::TRANSFER_READ,
            Self::Host => return (stage, vk::AccessFlags::HOST_READ),
        };
        (stage, read | write)
    }
}

/// Stages in which shaders of a tier run, graphics excepted: there is none.
fn shader_stages(tier: Tier) -> vk::PipelineStageFlags {
    match tier {
        Tier::Compute => vk::PipelineStageFlags::COMPUTE_SHADER,
        Tier::Rt => vk::PipelineStageFlags::COMPUTE_SHADER | vk::PipelineStageFlags::RAY_TRACING_SHADER_KHR,
    }
}

impl<'a> Recorder<'a> {
    /// Records into `commands`, which must be recording.
    pub(super) fn new(context: &Arc<Context>, commands: vk::CommandBuffer) -> Self {
        Self { context: context.clone(), commands, borrowed: PhantomData }
    }

    /// Everything before is finished and visible to everything after, as far as these accesses go.
    pub fn barrier(&mut self, before: &[Access], after: &[Access]) {
        if self.context.faults().omits_barriers() {
            return;
        }
        let tier = self.context.tier();
        let join = |all: &[Access], part: fn(Access, Tier) -> (vk::PipelineStageFlags, vk::AccessFlags)| {
            all.iter()
                .map(|a| part(*a, tier))
                .fold(Default::default(), |(s, m): (vk::PipelineStageFlags, _), (stage, mask)| (s | stage, m | mask))
        };
        let (from_stage, from_access) = join(before, Access::source);
        let (to_stage, to_access) = join(after, Access::destination);
        let memory = [vk::MemoryBarrier::default().src_access_mask(from_access).dst_access_mask(to_access)];
        // SAFETY: here and below the command buffer is recording.
        unsafe {
            self.context.raw().cmd_pipeline_barrier(
                self.commands,
                from_stage,
                to_stage,
                vk::DependencyFlags::empty(),
                &memory,
                &[],
                &[],
            );
        }
    }

    /// Sets all bytes to zero.
    ///
    /// # Errors
    /// A buffer of another context.
    pub fn clear(&mut self, buffer: &'a Buffer) -> Result<(), VulkanError> {
        self.own(buffer.context(), buffer.name())?;
        // SAFETY: the buffer lives for 'a and its size is a multiple of 4.
        unsafe { self.context.raw().cmd_fill_buffer(self.commands, buffer.raw(), 0, vk::WHOLE_SIZE, 0) };
        Ok(())
    }

    /// Writes a few bytes, which travel with the commands, to the start of a buffer.
    ///
    /// # Errors
    /// [`VulkanError::OutOfBounds`] for more bytes than the buffer has or than [`INLINE_BYTES`]; a buffer of
    /// another context.
    pub fn write<T: Pod>(&mut self, buffer: &'a Buffer, value: &T) -> Result<(), VulkanError> {
        const { assert!(size_of::<T>().is_multiple_of(4) && size_of::<T>() > 0, "written in words") };
        self.own(buffer.context(), buffer.name())?;
        let bytes = bytemuck::bytes_of(value);
        check_range(buffer.name(), 0, bytes.len() as u64, buffer.size().min(INLINE_BYTES))?;
        // SAFETY: the buffer lives for 'a, and size and range are as the call wants them.
        unsafe { self.context.raw().cmd_update_buffer(self.commands, buffer.raw(), 0, bytes) };
        Ok(())
    }

    /// Copies the first `bytes` of `from` to `to` at `offset`.
    ///
    /// # Errors
    /// [`VulkanError::OutOfBounds`]; a buffer of another context.
    pub fn upload(&mut self, from: &'a HostBuffer, to: &'a Buffer, offset: u64, bytes: u64) -> Result<(), VulkanError> {
        self.own(from.context(), from.name())?;
        self.own(to.context(), to.name())?;
        check_range(from.name(), 0, bytes, from.size())?;
        check_range(to.name(), offset, bytes, to.size())?;
        // Earlier submissions may have used the destination.
        self.barrier(&[Access::Shaders, Access::Transfer], &[Access::Transfer]);
        self.copy(from.raw(), to.raw(), offset, bytes);
        self.barrier(&[Access::Transfer], &[Access::Shaders, Access::Transfer]);
        Ok(())
    }

    /// Copies the first `bytes` of `from` to the start of `to`, ready for the host after the submission.
    ///
    /// # Errors
    /// [`VulkanError::OutOfBounds`]; a buffer of another context.
    pub fn readback(&mut self, from: &'a Buffer, to: &'a mut HostBuffer, bytes: u64) -> Result<(), VulkanError> {
        self.own(from.context(), from.name())?;
        self.own(to.context(), to.name())?;
        check_range(from.name(), 0, bytes, from.size())?;
        check_range(to.name(), 0, bytes, to.size())?;
        self.barrier(&[Access::Shaders, Access::Transfer], &[Access::Transfer]);
        self.copy(from.raw(), to.raw(), 0, bytes);
        self.barrier(&[Access::Transfer], &[Access::Host]);
        Ok(())
    }

    fn copy(&mut self, from: vk::Buffer, to: vk::Buffer, offset: u64, bytes: u64) {
        if bytes > 0 {
            let region = [vk::BufferCopy { src_offset: 0, dst_offset: offset, size: bytes }];
            // SAFETY: the callers have checked the ranges, and both buffers live for 'a.
            unsafe { self.context.raw().cmd_copy_buffer(self.commands, from, to, &region) };
        }
    }

    /// Runs `groups` workgroups (at least one each way) of a pipeline on a set, with push constants. Every device takes
    /// 65535 of them in the third direction.
    ///
    /// # Errors
    /// Objects of another context; push constants of the wrong size.
    pub fn dispatch<P: Pod>(
        &mut self,
        pipeline: &'a ComputePipeline,
        set: &'a BufferSet,
        push: Option<&P>,
        groups: [u32; 3],
    ) -> Result<(), VulkanError> {
        let layout = pipeline.layout();
        self.own(layout.context(), pipeline.name())?;
        self.own(set.context(), pipeline.name())?;
        let push = push.map_or(&[][..], bytemuck::bytes_of);
        check_range("push constants", 0, push.len() as u64, u64::from(layout.push_bytes()))?;
        let [across, down] = self.context.info().max_workgroups;
        for (groups, limit) in groups.iter().zip([across, down, 65_535]) {
            check_range("workgroups", 0, u64::from(*groups), u64::from(limit))?;
        }
        let device = self.context.raw();
        // SAFETY: pipeline and set live for 'a, the set's buffers as long as the set; all layouts of a stage have
        // the same bindings; the push constants fit.
        unsafe {
            device.cmd_bind_pipeline(self.commands, vk::PipelineBindPoint::COMPUTE, pipeline.raw());
            let sets = [set.handle()];
            device.cmd_bind_descriptor_sets(self.commands, vk::PipelineBindPoint::COMPUTE, layout.raw(), 0, &sets, &[]);
            if !push.is_empty() {
                device.cmd_push_constants(self.commands, layout.raw(), layout.stages(), 0, push);
            }
            device.cmd_dispatch(self.commands, groups[0].max(1), groups[1].max(1), groups[2].max(1));
        }
        Ok(())
    }

    /// The command buffer, for commands that are recorded elsewhere.
    pub fn raw(&self) -> vk::CommandBuffer {
        self.commands
    }

    pub(super) fn context(&self) -> &Arc<Context> {
        &self.context
    }

    /// Handles of one device mean nothing to another.
    pub(super) fn own(&self, other: &Arc<Context>, what: &str) -> Result<(), VulkanError> {
        if Arc::ptr_eq(&self.context, other) {
            Ok(())
        } else {
            Err(VulkanError::OtherDevice { what: what.to_owned(), device: self.context.info().name.clone() })
        }
    }
}
