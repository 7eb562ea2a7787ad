//! The runtime's images, and the choice of their format.

use super::{error::XrError, system::failed};
use crate::{
    render::device::eyes::{Encoding, Surface},
    vulkan::{
        Context,
        image::{Aspect, ForeignImage},
    },
};
use ash::vk::{self, Handle};
use openxr::{Session, SwapchainCreateFlags, SwapchainCreateInfo, SwapchainUsageFlags, Vulkan, sys};
use std::{sync::Arc, time::Duration};

/// How long an image may stay with the runtime.
const IMAGE_PATIENCE: Duration = Duration::from_secs(2);

/// Colour formats that can be filled.
const FORMATS: &[(vk::Format, Encoding)] = &[
    (vk::Format::R8G8B8A8_SRGB, Encoding::Rgba8Srgb),
    (vk::Format::B8G8R8A8_SRGB, Encoding::Bgra8Srgb),
    (vk::Format::R8G8B8A8_UNORM, Encoding::Rgba8),
    (vk::Format::B8G8R8A8_UNORM, Encoding::Bgra8),
    (vk::Format::R16G16B16A16_SFLOAT, Encoding::Rgba16F),
    (vk::Format::R16G16B16A16_UNORM, Encoding::Rgba16),
];

/// The first of the runtime's colour formats, which it lists from the best to the worst, that can be filled.
pub fn color_format(offered: &[u32]) -> Option<(u32, Encoding)> {
    offered.iter().find_map(|format| {
        let known = FORMATS.iter().find(|(known, _)| known.as_raw() as u32 == *format)?;
        Some((*format, known.1))
    })
}

/// The only depth format that is filled: floats.
pub fn depth_format(offered: &[u32]) -> Option<u32> {
    let wanted = vk::Format::D32_SFLOAT.as_raw() as u32;
    offered.contains(&wanted).then_some(wanted)
}

/// Images for both eyes: layers of the same image, or an image for each where the runtime has no layers.
pub struct EyeImages {
    chains: Vec<Chain>,
    layers: u32,
}

/// A swapchain of the runtime with its images.
struct Chain {
    images: Vec<ForeignImage>,
    handle: openxr::Swapchain<Vulkan>,
    /// The image that has been taken.
    taken: Option<usize>,
}

/// What images shall be like.
#[derive(Clone, Copy, Debug)]
pub struct ImageOptions {
    /// Vulkan's number of the format.
    pub format: u32,
    /// Bytes of a pixel.
    pub pixel_bytes: u64,
    /// Colours or depths.
    pub aspect: Aspect,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Whether their content will be read as well.
    pub read: bool,
}

impl EyeImages {
    /// Makes swapchains.
    ///
    /// # Errors
    /// The runtime's.
    pub fn new(session: &Session<Vulkan>, context: &Arc<Context>, options: ImageOptions) -> Result<Self, XrError> {
        if let Ok(chain) = Chain::new(session, context, options, 2) {
            return Ok(Self { chains: vec![chain], layers: 2 });
        }
        let chains = [(); 2].map(|()| Chain::new(session, context, options, 1));
        Ok(Self { chains: chains.into_iter().collect::<Result<_, _>>()?, layers: 1 })
    }

    /// Takes the next images and waits until they may be written.
    ///
    /// # Errors
    /// The runtime's; [`XrError::TimeOut`].
    pub fn acquire(&mut self) -> Result<(), XrError> {
        self.chains.iter_mut().try_for_each(Chain::acquire)
    }

    /// Gives the images back.
    ///
    /// # Errors
    /// The runtime's.
    pub fn release(&mut self) -> Result<(), XrError> {
        self.chains.iter_mut().try_for_each(Chain::release)
    }

    /// The images that have been taken, of the left and the right eye.
    pub fn surfaces(&self) -> Option<[Surface<'_>; 2]> {
        let surface = |eye: usize| {
            let (chain, layer) = self.place(eye);
            let chain = &self.chains[chain];
            Some((chain.images.get(chain.taken?)?, layer))
        };
        Some([surface(0)?, surface(1)?])
    }

    fn place(&self, eye: usize) -> (usize, u32) {
        if self.layers == 2 { (0, eye as u32) } else { (eye, 0) }
    }

    /// How the runtime finds the pixels of an eye.
    pub fn sub_image(&self, eye: usize, size: [u32; 2]) -> sys::SwapchainSubImage {
        let (chain, layer) = self.place(eye);
        sys::SwapchainSubImage {
            swapchain: self.chains[chain].handle.as_raw(),
            image_rect: sys::Rect2Di {
                offset: sys::Offset2Di { x: 0, y: 0 },
                extent: sys::Extent2Di { width: size[0] as i32, height: size[1] as i32 },
            },
            image_array_index: layer,
        }
    }
}

impl Chain {
    fn new(
        session: &Session<Vulkan>,
        context: &Arc<Context>,
        options: ImageOptions,
        layers: u32,
    ) -> Result<Self, XrError> {
        let ImageOptions { format, pixel_bytes, aspect, size, read } = options;
        let attachment = match aspect {
            Aspect::Color => SwapchainUsageFlags::COLOR_ATTACHMENT,
            Aspect::Depth => SwapchainUsageFlags::DEPTH_STENCIL_ATTACHMENT,
        };
        let source = if read { SwapchainUsageFlags::TRANSFER_SRC } else { SwapchainUsageFlags::EMPTY };
        let info = SwapchainCreateInfo {
            create_flags: SwapchainCreateFlags::EMPTY,
            usage_flags: attachment | SwapchainUsageFlags::TRANSFER_DST | source,
            format,
            sample_count: 1,
            width: size[0],
            height: size[1],
            face_count: 1,
            array_size: layers,
            mip_count: 1,
        };
        let handle = session.create_swapchain(&info).map_err(|r| failed("xrCreateSwapchain", r))?;
        let images = handle.enumerate_images().map_err(|r| failed("xrEnumerateSwapchainImages", r))?;
        let image = |(index, raw): (usize, u64)| {
            let name = format!("{aspect:?} image {index}");
            let raw = vk::Image::from_raw(raw);
            // SAFETY: the runtime made the image from the context's device as it was asked to, and keeps it as long as
            // the swapchain, which goes after its images.
            unsafe { ForeignImage::new(context, &name, raw, size, layers, pixel_bytes, aspect) }
        };
        let images = images.into_iter().enumerate().map(image).collect();
        Ok(Self { images, handle, taken: None })
    }

    fn acquire(&mut self) -> Result<(), XrError> {
        let index = self.handle.acquire_image().map_err(|r| failed("xrAcquireSwapchainImage", r))?;
        let info = sys::SwapchainImageWaitInfo {
            ty: sys::SwapchainImageWaitInfo::TYPE,
            next: std::ptr::null(),
            timeout: openxr::Duration::from_nanos(IMAGE_PATIENCE.as_nanos() as i64),
        };
        // The crate's own function takes a wait that has run out for a success.
        // SAFETY: the swapchain is alive and the structure complete.
        let waited = unsafe { (self.handle.instance().fp().wait_swapchain_image)(self.handle.as_raw(), &info) };
        match waited {
            sys::Result::TIMEOUT_EXPIRED => Err(XrError::TimeOut("xrWaitSwapchainImage")),
            result if result.into_raw() < 0 => Err(failed("xrWaitSwapchainImage", result)),
            _ => {
                self.taken = Some(index as usize);
                Ok(())
            }
        }
    }

    fn release(&mut self) -> Result<(), XrError> {
        if self.taken.take().is_none() {
            return Ok(());
        }
        let info = std::ptr::null();
        // SAFETY: the swapchain is alive, and its image has been waited for.
        let result = unsafe { (self.handle.instance().fp().release_swapchain_image)(self.handle.as_raw(), info) };
        if result.into_raw() < 0 { Err(failed("xrReleaseSwapchainImage", result)) } else { Ok(()) }
    }
}
