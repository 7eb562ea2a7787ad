//! Images that somebody else owns: those of a swapchain. They are only copied to and from; pictures are made in buffers.

use super::{
    Context, VulkanError,
    memory::{Buffer, HostBuffer, check_range},
    record::Recorder,
};
use ash::vk;
use std::sync::Arc;

/// What an image holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Aspect {
    /// Colours.
    Color,
    /// Depths, 32-bit floats.
    Depth,
}

impl Aspect {
    fn flags(self) -> vk::ImageAspectFlags {
        match self {
            Self::Color => vk::ImageAspectFlags::COLOR,
            Self::Depth => vk::ImageAspectFlags::DEPTH,
        }
    }

    /// The layout in which OpenXR runtimes want an image back.
    fn final_layout(self) -> vk::ImageLayout {
        match self {
            Self::Color => vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL,
            Self::Depth => vk::ImageLayout::DEPTH_STENCIL_ATTACHMENT_OPTIMAL,
        }
    }
}

/// An image that somebody else owns.
#[derive(Debug)]
pub struct ForeignImage {
    context: Arc<Context>,
    handle: vk::Image,
    name: String,
    size: [u32; 2],
    layers: u32,
    pixel_bytes: u64,
    aspect: Aspect,
}

impl ForeignImage {
    /// A two-dimensional image with one mip level, for transfers both ways. `size` in pixels, `pixel_bytes` of its format.
    ///
    /// # Safety
    /// The image must belong to the context's device, be as described, and live at least as long as this value.
    pub unsafe fn new(
        context: &Arc<Context>,
        name: &str,
        handle: vk::Image,
        size: [u32; 2],
        layers: u32,
        pixel_bytes: u64,
        aspect: Aspect,
    ) -> Self {
        Self { context: context.clone(), handle, name: name.to_owned(), size, layers, pixel_bytes, aspect }
    }

    /// Bytes of a pixel.
    pub fn pixel_bytes(&self) -> u64 {
        self.pixel_bytes
    }

    fn region(&self, layer: u32, size: [u32; 2], offset: u64, bytes: u64) -> Result<vk::BufferImageCopy, VulkanError> {
        let inside = layer < self.layers && size[0] <= self.size[0] && size[1] <= self.size[1];
        if !inside {
            return Err(VulkanError::OutOfBounds {
                what: format!("image {} (layer {layer})", self.name),
                start: 0,
                end: u64::from(size[0].max(size[1])),
                size: u64::from(self.size[0].min(self.size[1])),
            });
        }
        let needed = u64::from(size[0]) * u64::from(size[1]) * self.pixel_bytes;
        check_range(&self.name, offset, needed, bytes)?;
        Ok(vk::BufferImageCopy {
            buffer_offset: offset,
            buffer_row_length: 0,
            buffer_image_height: 0,
            image_subresource: vk::ImageSubresourceLayers {
                aspect_mask: self.aspect.flags(),
                mip_level: 0,
                base_array_layer: layer,
                layer_count: 1,
            },
            image_offset: vk::Offset3D::default(),
            image_extent: vk::Extent3D { width: size[0], height: size[1], depth: 1 },
        })
    }
}

impl<'a> Recorder<'a> {
    /// Copies pixels, from byte `offset` (a multiple of a pixel's bytes) of a buffer that shaders or copies have written,
    /// to the upper left corner of a layer. What was in the layer is lost; it ends in the layout of an attachment.
    ///
    /// # Errors
    /// [`VulkanError::OutOfBounds`]; objects of another context.
    pub fn fill_image(
        &mut self,
        from: &'a Buffer,
        offset: u64,
        to: &'a ForeignImage,
        layer: u32,
        size: [u32; 2],
    ) -> Result<(), VulkanError> {
        self.own(from.context(), from.name())?;
        self.own(&to.context, &to.name)?;
        let region = [to.region(layer, size, offset, from.size())?];
        let wanted = vk::ImageLayout::TRANSFER_DST_OPTIMAL;
        self.change_layout(to, layer, vk::ImageLayout::UNDEFINED, wanted);
        let (device, commands) = (self.context().raw(), self.raw());
        // SAFETY: the command buffer is recording; buffer and image live for 'a and the region lies in both.
        unsafe { device.cmd_copy_buffer_to_image(commands, from.raw(), to.handle, wanted, &region) };
        self.change_layout(to, layer, wanted, to.aspect.final_layout());
        Ok(())
    }

    /// Copies pixels of a layer that [`Recorder::fill_image`] has filled to a buffer, ready for the host after the submission.
    ///
    /// # Errors
    /// As [`Recorder::fill_image`].
    pub fn read_image(
        &mut self,
        from: &'a ForeignImage,
        layer: u32,
        size: [u32; 2],
        to: &'a mut HostBuffer,
    ) -> Result<(), VulkanError> {
        self.own(to.context(), to.name())?;
        self.own(&from.context, &from.name)?;
        let region = [from.region(layer, size, 0, to.size())?];
        let (rest, wanted) = (from.aspect.final_layout(), vk::ImageLayout::TRANSFER_SRC_OPTIMAL);
        self.change_layout(from, layer, rest, wanted);
        let (device, commands) = (self.context().raw(), self.raw());
        // SAFETY: as above.
        unsafe { device.cmd_copy_image_to_buffer(commands, from.handle, wanted, to.raw(), &region) };
        self.change_layout(from, layer, wanted, rest);
        self.barrier(&[super::record::Access::Transfer], &[super::record::Access::Host]);
        Ok(())
    }

    /// Everything before is finished; the layer has another layout for everything after.
    fn change_layout(&mut self, image: &ForeignImage, layer: u32, from: vk::ImageLayout, to: vk::ImageLayout) {
        let memory = vk::AccessFlags::MEMORY_READ | vk::AccessFlags::MEMORY_WRITE;
        let barrier = [vk::ImageMemoryBarrier::default()
            .src_access_mask(memory)
            .dst_access_mask(memory)
            .old_layout(from)
            .new_layout(to)
            .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
            .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
            .image(image.handle)
            .subresource_range(vk::ImageSubresourceRange {
                aspect_mask: image.aspect.flags(),
                base_mip_level: 0,
                level_count: 1,
                base_array_layer: layer,
                layer_count: 1,
            })];
        let (all, none) = (vk::PipelineStageFlags::ALL_COMMANDS, vk::DependencyFlags::empty());
        // SAFETY: the command buffer is recording and the image has the layer.
        unsafe { self.context().raw().cmd_pipeline_barrier(self.raw(), all, all, none, &[], &[], &barrier) };
    }
}
