//! Submission and waiting.
//!
//! A [`Submitter`] owns one command buffer and uses it again and again: record, submit, wait. Nothing runs on
//! the device when [`Submitter::submit`] has returned, and everything that a submission uses is borrowed until
//! then, which is what makes the rest of the wrappers safe.

use super::{Context, VulkanError, record::Recorder};
use ash::vk;
use std::{
    sync::Arc,
    time::{Duration, Instant},
};

/// How long a submission may take. Drivers of hardware stop theirs after 2 to 10 seconds and report a lost
/// device, so a longer wait is only ever for a software device that is at work – which on a busy machine can
/// take minutes for the first tile of a deep picture – or for a driver that hangs for good.
pub const SUBMIT_TIME_OUT: Duration = Duration::from_secs(600);

/// What a submission took.
#[derive(Clone, Copy, Debug)]
pub struct Elapsed {
    /// Between the device's own time stamps around all commands, if it has them.
    pub device: Option<Duration>,
    /// From submission to the end of the wait.
    pub wall: Duration,
}

impl Elapsed {
    /// The device's time if it is known, else wall time.
    pub fn best(&self) -> Duration {
        self.device.unwrap_or(self.wall)
    }
}

/// A command buffer with its fence and time stamps.
pub struct Submitter {
    context: Arc<Context>,
    pool: vk::CommandPool,
    commands: vk::CommandBuffer,
    fence: vk::Fence,
    /// Null where the queue has no time stamps.
    queries: vk::QueryPool,
}

impl std::fmt::Debug for Submitter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Submitter").finish_non_exhaustive()
    }
}

impl Submitter {
    /// A submitter for the context's queue. `name` is for messages.
    ///
    /// # Errors
    /// Driver failures.
    pub fn new(context: &Arc<Context>, name: &str) -> Result<Self, VulkanError> {
        let info = vk::CommandPoolCreateInfo::default().queue_family_index(context.queue_family());
        // SAFETY: here and below the context is alive and the structures are complete.
        let pool = context.call("vkCreateCommandPool", name, |d| unsafe { d.create_command_pool(&info, None) })?;
        // From here on `Drop` cleans up; it skips null handles.
        let mut submitter = Self {
            context: context.clone(),
            pool,
            commands: vk::CommandBuffer::null(),
            fence: vk::Fence::null(),
            queries: vk::QueryPool::null(),
        };
        let info = vk::CommandBufferAllocateInfo::default().command_pool(pool).command_buffer_count(1);
        submitter.commands = context.call("vkAllocateCommandBuffers", name, |d| {
            // SAFETY: the pool is new.
            unsafe { d.allocate_command_buffers(&info) }.map(|made| made.first().copied().unwrap_or_default())
        })?;
        // SAFETY: as above.
        submitter.fence = context
            .call("vkCreateFence", name, |d| unsafe { d.create_fence(&vk::FenceCreateInfo::default(), None) })?;
        if context.info().found.timestamp_bits > 0 {
            let info = vk::QueryPoolCreateInfo::default().query_type(vk::QueryType::TIMESTAMP).query_count(2);
            // SAFETY: as above.
            submitter.queries =
                context.call("vkCreateQueryPool", name, |d| unsafe { d.create_query_pool(&info, None) })?;
        }
        Ok(submitter)
    }

    /// Records commands, submits them, and waits for their end.
    ///
    /// # Errors
    /// The first error of recording, a driver failure, or [`VulkanError::TimeOut`], after which the context is
    /// hung.
    pub fn submit<'a>(
        &mut self,
        what: &str,
        record: impl FnOnce(&mut Recorder<'a>) -> Result<(), VulkanError>,
    ) -> Result<Elapsed, VulkanError> {
        let context = self.context.clone();
        if context.is_hung() {
            return Err(VulkanError::Hung { what: what.to_owned(), device: context.info().name.clone() });
        }
        // SAFETY: earlier commands of the pool have been waited for.
        context.call("vkResetCommandPool", what, |d| unsafe {
            d.reset_command_pool(self.pool, vk::CommandPoolResetFlags::empty())
        })?;
        let info = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the command buffer has just been reset.
        context.call("vkBeginCommandBuffer", what, |d| unsafe { d.begin_command_buffer(self.commands, &info) })?;
        let device = context.raw();
        let timed = self.queries != vk::QueryPool::null();
        if timed {
            // SAFETY: the command buffer is recording, and the pool has two queries.
            unsafe {
                device.cmd_reset_query_pool(self.commands, self.queries, 0, 2);
                device.cmd_write_timestamp(self.commands, vk::PipelineStageFlags::TOP_OF_PIPE, self.queries, 0);
            }
        }
        record(&mut Recorder::new(&context, self.commands))?;
        if timed {
            // SAFETY: as above.
            unsafe {
                device.cmd_write_timestamp(self.commands, vk::PipelineStageFlags::BOTTOM_OF_PIPE, self.queries, 1);
            }
        }
        // SAFETY: the command buffer is recording.
        context.call("vkEndCommandBuffer", what, |d| unsafe { d.end_command_buffer(self.commands) })?;
        // SAFETY: no submission is pending on the fence.
        context.call("vkResetFences", what, |d| unsafe { d.reset_fences(&[self.fence]) })?;
        let start = Instant::now();
        let commands = [self.commands];
        let info = [vk::SubmitInfo::default().command_buffers(&commands)];
        {
            let queue = context.queue();
            // SAFETY: the guard makes us the only user of the queue; all that the commands use is borrowed for
            // 'a, which does not end before this function does.
            context.call("vkQueueSubmit", what, |d| unsafe { d.queue_submit(*queue, &info, self.fence) })?;
        }
        self.wait(what)?;
        let wall = start.elapsed();
        Ok(Elapsed { device: if timed { self.stamps(what)? } else { None }, wall })
    }

    fn wait(&self, what: &str) -> Result<(), VulkanError> {
        let limit = self.context.submit_time_out();
        // SAFETY: the fence has been submitted.
        let waited = unsafe { self.context.raw().wait_for_fences(&[self.fence], true, limit.as_nanos() as u64) };
        // A fault comes after the wait and instead of its result: the device must not be left at work.
        let waited = self.context.faults().next("vkWaitForFences").map_or(waited, Err);
        match waited {
            Ok(()) => Ok(()),
            Err(vk::Result::TIMEOUT) => {
                self.context.set_hung();
                Err(VulkanError::TimeOut { what: what.to_owned(), limit })
            }
            Err(result) => {
                if result != vk::Result::ERROR_DEVICE_LOST {
                    // Out of memory while waiting: whether the device is still at work is unknown.
                    self.context.set_hung();
                }
                Err(VulkanError::Call { call: "vkWaitForFences", what: what.to_owned(), result })
            }
        }
    }

    /// Time between the two stamps; none if the device's counter has no stamp for them.
    fn stamps(&self, what: &str) -> Result<Option<Duration>, VulkanError> {
        let mut stamps = [0_u64; 2];
        let got = self.context.call("vkGetQueryPoolResults", what, |d| {
            // SAFETY: both queries have been written by a finished submission, as 64-bit numbers.
            unsafe { d.get_query_pool_results(self.queries, 0, &mut stamps, vk::QueryResultFlags::TYPE_64) }
        });
        match got {
            Ok(()) => {}
            Err(VulkanError::Call { result: vk::Result::NOT_READY, .. }) => return Ok(None),
            Err(error) => return Err(error),
        }
        let found = &self.context.info().found;
        let mask = u64::MAX >> (64 - found.timestamp_bits.clamp(1, 64));
        // The counter may have wrapped around in between.
        let ticks = stamps[1].wrapping_sub(stamps[0]) & mask;
        Ok(Some(Duration::from_nanos((ticks as f64 * f64::from(found.timestamp_period)) as u64)))
    }
}

impl Drop for Submitter {
    fn drop(&mut self) {
        if self.context.is_hung() {
            return;
        }
        let device = self.context.raw();
        // SAFETY: every submission has been waited for; null handles are ignored.
        unsafe {
            device.destroy_query_pool(self.queries, None);
            device.destroy_fence(self.fence, None);
            device.destroy_command_pool(self.pool, None);
        }
    }
}
