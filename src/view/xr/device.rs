//! Vulkan handles made by an OpenXR runtime (`XR_KHR_vulkan_enable2`), which adds extensions and features of its own.

use crate::vulkan::{VulkanError, fault::FaultInjection, instance::Creator};
use ash::vk::{self, Handle};
use openxr::sys::platform::VkGetInstanceProcAddr;
use std::ffi::c_void;

/// Makes instance and device by way of a runtime.
pub struct RuntimeCreator<'a> {
    /// The runtime.
    pub instance: &'a openxr::Instance,
    /// Its headset.
    pub system: openxr::SystemId,
    loader: Option<VkGetInstanceProcAddr>,
}

impl<'a> RuntimeCreator<'a> {
    /// For a headset of a runtime with `XR_KHR_vulkan_enable2`.
    pub fn new(instance: &'a openxr::Instance, system: openxr::SystemId) -> Self {
        Self { instance, system, loader: None }
    }
}

/// The runtime itself failed, and not Vulkan below it.
fn refused(call: &'static str, result: openxr::sys::Result) -> VulkanError {
    VulkanError::Call {
        call,
        what: format!("the headset ({result:?})"),
        result: vk::Result::ERROR_INITIALIZATION_FAILED,
    }
}

fn checked<T>(call: &'static str, result: openxr::Result<Result<T, i32>>) -> Result<T, VulkanError> {
    match result {
        Ok(Ok(handle)) => Ok(handle),
        Ok(Err(raw)) => {
            Err(VulkanError::Call { call, what: String::from("the headset"), result: vk::Result::from_raw(raw) })
        }
        Err(result) => Err(refused(call, result)),
    }
}

// SAFETY: the runtime makes the handles by vkCreateInstance and vkCreateDevice with what is given and what it adds
// (XR_KHR_vulkan_enable2), and leaves them to us.
unsafe impl Creator for RuntimeCreator<'_> {
    fn instance(
        &mut self,
        entry: &ash::Entry,
        info: &vk::InstanceCreateInfo<'_>,
        _faults: &FaultInjection,
    ) -> Result<vk::Instance, VulkanError> {
        // SAFETY: both types are Vulkan's PFN_vkGetInstanceProcAddr, declared by two crates.
        let loader = unsafe {
            std::mem::transmute::<vk::PFN_vkGetInstanceProcAddr, VkGetInstanceProcAddr>(
                entry.static_fn().get_instance_proc_addr,
            )
        };
        self.loader = Some(loader);
        let info: *const vk::InstanceCreateInfo<'_> = info;
        // SAFETY: `info` is a complete structure that lives as long as the call.
        let made = unsafe { self.instance.create_vulkan_instance(self.system, loader, info.cast::<c_void>()) };
        checked("xrCreateVulkanInstanceKHR", made).map(|raw| vk::Instance::from_raw(raw as u64))
    }

    fn physical_device(&mut self, instance: vk::Instance) -> Result<Option<vk::PhysicalDevice>, VulkanError> {
        // SAFETY: the instance was made by this runtime.
        let found = unsafe { self.instance.vulkan_graphics_device(self.system, instance.as_raw() as *const c_void) };
        let raw = found.map_err(|result| refused("xrGetVulkanGraphicsDevice2KHR", result))?;
        Ok(Some(vk::PhysicalDevice::from_raw(raw as u64)))
    }

    fn device(
        &mut self,
        _instance: &ash::Instance,
        physical: vk::PhysicalDevice,
        info: &vk::DeviceCreateInfo<'_>,
        _faults: &FaultInjection,
    ) -> Result<vk::Device, VulkanError> {
        let Some(loader) = self.loader else {
            return Err(refused("xrCreateVulkanDeviceKHR", openxr::sys::Result::ERROR_CALL_ORDER_INVALID));
        };
        let info: *const vk::DeviceCreateInfo<'_> = info;
        let physical = physical.as_raw() as *const c_void;
        // SAFETY: as above; the physical device is the one that the runtime has named.
        let made = unsafe { self.instance.create_vulkan_device(self.system, loader, physical, info.cast::<c_void>()) };
        checked("xrCreateVulkanDeviceKHR", made).map(|raw| vk::Device::from_raw(raw as u64))
    }
}
