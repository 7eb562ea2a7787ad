//! A logical device with its queue, its memory and its pipeline cache.

use super::{
    ContextOptions, DeviceInfo, Tier, VulkanError,
    cache::{self, CacheFile},
    command::SUBMIT_TIME_OUT,
    fault::FaultInjection,
    instance::{Creator, Instance, Loader, Messages},
    tier::{CLOCK_EXTENSION, Features, REORDER_EXTENSION, ROBUSTNESS_EXTENSION, RT_EXTENSIONS},
    tracing::Functions,
};
use ash::{prelude::VkResult, vk};
use gpu_allocator::{
    AllocationSizes, AllocatorDebugSettings,
    vulkan::{Allocator, AllocatorCreateDesc},
};
use std::{
    ffi::{CStr, CString},
    mem::ManuallyDrop,
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    time::Duration,
};

/// Memory is taken from the driver in blocks that grow from the first to the second size. A small scene fits
/// into the first; drivers allow a few thousand allocations, which the second cannot reach.
const MEMORY_BLOCKS: (u64, u64) = (8 << 20, 256 << 20);

/// A device ready for use. Shared by `Arc`: everything made from it holds one, so it goes last.
pub struct Context {
    info: DeviceInfo,
    tier: Tier,
    queue: Mutex<vk::Queue>,
    queue_family: u32,
    pipeline_cache: vk::PipelineCache,
    cache_file: CacheFile,
    debug_names: Option<ash::ext::debug_utils::Device>,
    /// Present in contexts of [`Tier::Rt`].
    tracing: Option<Functions>,
    memory_in_use: AtomicU64,
    hung: AtomicBool,
    submit_time_out: Duration,
    faults: FaultInjection,
    // Dropped in this order, by `Drop` of this structure.
    allocator: ManuallyDrop<Mutex<Allocator>>,
    device: ManuallyDrop<Device>,
    physical: vk::PhysicalDevice,
    instance: Instance,
}

/// A logical device that is destroyed at its end.
struct Device(ash::Device);

impl Drop for Device {
    fn drop(&mut self) {
        // SAFETY: nothing is at work and nothing made from the device is left: see `Context::drop`.
        unsafe { self.0.destroy_device(None) };
    }
}

impl std::fmt::Debug for Context {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Context({})", self.info)
    }
}

impl Context {
    /// Opens the device that the options name, or the best one.
    ///
    /// # Errors
    /// No Vulkan, no such device, or a device that lacks what the tier needs.
    pub fn new(options: &ContextOptions) -> Result<Arc<Self>, VulkanError> {
        Self::with_creator(options, &mut Loader)
    }

    /// The same with handles made by someone else, such as an OpenXR runtime.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn with_creator(options: &ContextOptions, creator: &mut dyn Creator) -> Result<Arc<Self>, VulkanError> {
        let faults = options.faults.clone();
        let instance = Instance::new(options, creator)?;
        let required = creator.physical_device(instance.raw().handle())?;
        let (physical, mut info) = choose(instance.physical_devices()?, required, options)?;
        info.max_storage_range = info.max_storage_range.min(options.max_storage_range.unwrap_or(u64::MAX));
        let lacking = info.lacks(options.tier);
        let Some(queue_family) = info.found.queue_family.filter(|_| lacking.is_empty()) else {
            return Err(VulkanError::Lacking { device: info.name, lacking });
        };

        let mut features = Features::enabled(options.tier);
        let mut extensions: Vec<&CStr> = options.device_extensions.iter().map(CString::as_c_str).collect();
        if info.found.portability {
            extensions.push(ash::khr::portability_subset::NAME);
        }
        let rt = options.tier == Tier::Rt;
        let reorder = rt && info.rt().reorder;
        if rt {
            extensions.extend(RT_EXTENSIONS);
        }
        if reorder {
            extensions.push(REORDER_EXTENSION);
        }
        if info.has_clock() {
            extensions.push(CLOCK_EXTENSION);
        }
        if info.can_leave_unchecked() {
            extensions.push(ROBUSTNESS_EXTENSION);
        }
        let names: Vec<_> = extensions.iter().map(|e| e.as_ptr()).collect();
        let priorities = [1.0];
        let queues =
            [vk::DeviceQueueCreateInfo::default().queue_family_index(queue_family).queue_priorities(&priorities)];
        let mut create = vk::DeviceCreateInfo::default()
            .queue_create_infos(&queues)
            .enabled_extension_names(&names)
            .push_next(&mut features.scalar)
            .push_next(&mut features.address);
        if rt {
            create = create.push_next(&mut features.acceleration).push_next(&mut features.pipeline);
        }
        if reorder {
            create = create.push_next(&mut features.reorder);
        }
        if info.has_clock() {
            create = create.push_next(&mut features.clock);
        }
        if info.can_leave_unchecked() {
            create = create.push_next(&mut features.robustness);
        }
        let raw = creator.device(instance.raw(), physical, &create, &faults)?;
        // SAFETY: `raw` is a live device of this instance that belongs to us (contract of `Creator`).
        let device = Device(unsafe { ash::Device::load(instance.raw().fp_v1_0(), raw) });
        // SAFETY: the device was created with one queue of this family.
        let queue = unsafe { device.0.get_device_queue(queue_family, 0) };
        let (first, largest) = MEMORY_BLOCKS;
        let allocator = Allocator::new(&AllocatorCreateDesc {
            instance: instance.raw().clone(),
            device: device.0.clone(),
            physical_device: physical,
            debug_settings: AllocatorDebugSettings::default(),
            buffer_device_address: true,
            allocation_sizes: AllocationSizes::new(first, first)
                .with_max_device_memblock_size(largest)
                .with_max_host_memblock_size(largest),
        })
        .map_err(|e| VulkanError::Memory {
            what: "the allocator".to_owned(),
            size: 0,
            in_use: 0,
            cause: e.to_string(),
        })?;
        let mut cache_file = CacheFile::open(options.cache_folder.as_deref(), &info);
        let create_cache = |data: &[u8]| {
            faults.call("vkCreatePipelineCache", "the program", || {
                let info = vk::PipelineCacheCreateInfo::default().initial_data(data);
                // SAFETY: the device is alive, and the data is what its driver gave (`CacheFile`) or nothing.
                unsafe { device.0.create_pipeline_cache(&info, None) }
            })
        };
        let pipeline_cache = match create_cache(cache_file.data()) {
            Err(error) if !cache_file.data().is_empty() => {
                cache_file.reject(error.to_string());
                create_cache(&[])?
            }
            made => made?,
        };
        let debug_names =
            instance.has_debug_names().then(|| ash::ext::debug_utils::Device::new(instance.raw(), &device.0));
        let tracing = rt.then(|| Functions::new(instance.raw(), &device.0));
        // Software on a busy machine is slow and does not hang.
        let wanted = options.submit_time_out.filter(|_| !info.is_software());
        let submit_time_out = wanted.unwrap_or(SUBMIT_TIME_OUT);
        Ok(Arc::new(Self {
            info,
            tier: options.tier,
            tracing,
            queue: Mutex::new(queue),
            queue_family,
            pipeline_cache,
            cache_file,
            debug_names,
            memory_in_use: AtomicU64::new(0),
            hung: AtomicBool::new(false),
            submit_time_out,
            faults,
            allocator: ManuallyDrop::new(Mutex::new(allocator)),
            device: ManuallyDrop::new(device),
            physical,
            instance,
        }))
    }

    /// What the device is.
    pub fn info(&self) -> &DeviceInfo {
        &self.info
    }

    /// What the device was opened for.
    pub fn tier(&self) -> Tier {
        self.tier
    }

    /// How long a submission may take.
    pub(super) fn submit_time_out(&self) -> Duration {
        self.submit_time_out
    }

    /// Bytes of all buffers that exist.
    pub fn memory_in_use(&self) -> u64 {
        self.memory_in_use.load(Ordering::Relaxed)
    }

    /// Warnings and errors of the validation layer so far.
    pub fn validation_messages(&self) -> Vec<String> {
        self.instance.messages().all()
    }

    /// The same as a handle that outlives the context.
    pub fn messages(&self) -> Messages {
        self.instance.messages().clone()
    }

    /// The instance.
    pub fn instance(&self) -> &Instance {
        &self.instance
    }

    /// The device's functions.
    pub fn raw(&self) -> &ash::Device {
        &self.device.0
    }

    /// The physical device.
    pub fn physical_device(&self) -> vk::PhysicalDevice {
        self.physical
    }

    /// The queue, for the one who holds the guard.
    pub fn queue(&self) -> MutexGuard<'_, vk::Queue> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Family of the queue; its index in the family is 0.
    pub fn queue_family(&self) -> u32 {
        self.queue_family
    }

    /// The functions of ray tracing.
    ///
    /// # Errors
    /// [`VulkanError::Lacking`] if the device was not opened for it.
    pub(super) fn tracing(&self) -> Result<&Functions, VulkanError> {
        self.tracing.as_ref().ok_or_else(|| VulkanError::Lacking {
            device: self.info.name.clone(),
            lacking: vec![String::from("ray tracing: it was opened without")],
        })
    }

    /// What was found on disk of pipelines compiled earlier.
    pub fn cache_found(&self) -> &cache::Found {
        self.cache_file.found()
    }

    /// Keeps the pipelines compiled so far for the next run.
    ///
    /// # Errors
    /// [`VulkanError::Cache`], and the driver's. Neither is a reason to stop.
    pub fn save_pipelines(&self) -> Result<(), VulkanError> {
        if !self.cache_file.wants_data() || self.is_hung() {
            return Ok(());
        }
        let data = self.call("vkGetPipelineCacheData", "the program", |d| {
            // SAFETY: the device and its cache are alive.
            unsafe { d.get_pipeline_cache_data(self.pipeline_cache) }
        })?;
        self.cache_file.write(&data)
    }

    pub(super) fn pipeline_cache(&self) -> vk::PipelineCache {
        self.pipeline_cache
    }

    pub(super) fn allocator(&self) -> MutexGuard<'_, Allocator> {
        self.allocator.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn faults(&self) -> &FaultInjection {
        &self.faults
    }

    pub(super) fn account(&self, bytes: u64) {
        self.memory_in_use.fetch_add(bytes, Ordering::Relaxed);
    }

    pub(super) fn release(&self, bytes: u64) {
        self.memory_in_use.fetch_sub(bytes, Ordering::Relaxed);
    }

    /// A call of the device's functions, with its name for errors and faults.
    pub(crate) fn call<T>(
        &self,
        call: &'static str,
        what: &str,
        make: impl FnOnce(&ash::Device) -> VkResult<T>,
    ) -> Result<T, VulkanError> {
        self.faults.call(call, what, || make(self.raw()))
    }

    /// Whether a submission never came to an end. Then nothing may be destroyed any more.
    pub fn is_hung(&self) -> bool {
        self.hung.load(Ordering::Relaxed)
    }

    pub(super) fn set_hung(&self) {
        self.hung.store(true, Ordering::Relaxed);
        self.instance.abandon();
    }

    /// Gives an object a name for debuggers and validation messages.
    pub(crate) fn name_object<H: vk::Handle>(&self, handle: H, name: &str) {
        let (Some(functions), Ok(name)) = (&self.debug_names, CString::new(name)) else { return };
        let info = vk::DebugUtilsObjectNameInfoEXT::default().object_handle(handle).object_name(&name);
        // SAFETY: the extension is enabled and the handle belongs to this device. A name that cannot be set is
        // no reason to fail.
        let _ = unsafe { functions.set_debug_utils_object_name(&info) };
    }
}

impl Drop for Context {
    fn drop(&mut self) {
        if self.is_hung() {
            return;
        }
        // SAFETY: buffers, pipelines and submitters hold an `Arc` of the context, so none is left; a submission
        // is waited for before its submitter returns, so nothing is at work. Neither field is used again.
        unsafe {
            self.raw().destroy_pipeline_cache(self.pipeline_cache, None);
            ManuallyDrop::drop(&mut self.allocator);
            ManuallyDrop::drop(&mut self.device);
        }
    }
}

/// The device that is required, or the one asked for by index or name, or the best.
fn choose(
    devices: Vec<(vk::PhysicalDevice, DeviceInfo)>,
    required: Option<vk::PhysicalDevice>,
    options: &ContextOptions,
) -> Result<(vk::PhysicalDevice, DeviceInfo), VulkanError> {
    let wanted = options.device.as_deref();
    let index = wanted.and_then(|w| w.trim().parse::<usize>().ok());
    let part = wanted.map(|w| w.trim().to_lowercase());
    let names: Vec<String> = devices.iter().map(|(_, info)| format!("{}: {}", info.index, info.name)).collect();
    let fits = |(physical, info): &(vk::PhysicalDevice, DeviceInfo)| match (required, index, &part) {
        (Some(required), _, _) => *physical == required,
        (None, Some(index), _) => info.index == index,
        (None, None, Some(part)) => info.name.to_lowercase().contains(part),
        (None, None, None) => true,
    };
    match devices.into_iter().filter(fits).min_by_key(|(_, info)| info.rank(options.tier)) {
        Some(device) => Ok(device),
        None if names.is_empty() => Err(VulkanError::NoDevice),
        None => Err(VulkanError::UnknownDevice { wanted: wanted.unwrap_or_default().to_owned(), devices: names }),
    }
}
