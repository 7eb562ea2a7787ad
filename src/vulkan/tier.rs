//! What a device is, and which tier of the renderer it can run. Nobody else reads feature bits.

use super::{VulkanError, fault::FaultInjection};
use crate::shader_io;
use ash::vk;
use std::{ffi::CStr, fmt};

/// What a device must be able to do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Tier {
    /// Compute shaders of Vulkan 1.2 with scalar block layout and arithmetic of subgroups.
    #[default]
    Compute,
    /// `Compute` and the ray tracing pipeline.
    Rt,
}

/// What kind of hardware a device is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeviceKind {
    /// A graphics card.
    Discrete,
    /// Graphics in the processor's package.
    Integrated,
    /// A share of a card in a virtual machine.
    Virtual,
    /// Software.
    Cpu,
    /// Anything else.
    Other,
}

impl DeviceKind {
    /// Name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Discrete => "discrete",
            Self::Integrated => "integrated",
            Self::Virtual => "virtual",
            Self::Cpu => "cpu",
            Self::Other => "other",
        }
    }
}

/// A Vulkan device.
#[derive(Clone, Debug)]
pub struct DeviceInfo {
    /// Position in the loader's list.
    pub index: usize,
    /// Its name.
    pub name: String,
    /// What kind of hardware it is.
    pub kind: DeviceKind,
    /// The driver.
    pub driver_name: String,
    /// The driver's version in its own words.
    pub driver_info: String,
    /// Vulkan version: major, minor, patch.
    pub api_version: (u32, u32, u32),
    /// Bytes of the largest memory heap that is local to the device.
    pub memory: u64,
    /// Largest range of a storage buffer in bytes.
    pub max_storage_range: u64,
    /// Largest number of workgroups of a dispatch, across and down.
    pub max_workgroups: [u32; 2],
    /// What the device lacks for [`Tier::Compute`], in words.
    pub lacks_compute: Vec<String>,
    /// What the device lacks for [`Tier::Rt`] besides.
    pub lacks_rt: Vec<String>,
    pub(super) found: Found,
}

/// What only the wrappers need to know of a device.
#[derive(Clone, Debug, Default)]
pub(super) struct Found {
    /// Family of the queue to use.
    pub queue_family: Option<u32>,
    /// Bits of a time stamp that count; 0 if there are no time stamps.
    pub timestamp_bits: u32,
    /// Nanoseconds per tick.
    pub timestamp_period: f32,
    /// `VK_KHR_portability_subset`, which must be enabled where it exists.
    pub portability: bool,
    /// Shaders can read a clock (`VK_KHR_shader_clock`).
    pub clock: bool,
    /// Pipelines can say that their accesses need no check (`VK_EXT_pipeline_robustness`).
    pub unchecked: bool,
    /// Invocations of a subgroup.
    pub subgroup_size: u32,
    /// Limits of ray tracing, where the device has it.
    pub rt: RtLimits,
    /// The driver's own mark of its build, for pipeline caches.
    pub cache_uuid: [u8; vk::UUID_SIZE],
    /// PCI vendor.
    pub vendor_id: u32,
    /// PCI device.
    pub device_id: u32,
    /// Version in the driver's own encoding.
    pub driver_version: u32,
}

/// Limits of ray tracing pipelines and acceleration structures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RtLimits {
    /// Levels of tracing from inside of shaders, raygen's own trace included; 1 at least.
    pub recursion_depth: u32,
    /// Bytes of a shader group's handle.
    pub handle_size: u32,
    /// Alignment of handles in a shader binding table.
    pub handle_alignment: u32,
    /// Alignment of the parts of a shader binding table.
    pub base_alignment: u32,
    /// Largest distance of two records of a shader binding table.
    pub max_stride: u32,
    /// Alignment of scratch memory for acceleration structures.
    pub scratch_alignment: u32,
    /// Most primitives in a bottom-level structure.
    pub max_primitives: u64,
    /// Most instances in a top-level structure.
    pub max_instances: u64,
    /// Whether invocations can be reordered between traversal and shading
    /// (`VK_NV_ray_tracing_invocation_reorder`).
    pub reorder: bool,
    /// Whether all shaders can trace (`VK_KHR_ray_query`): what hardware for tracing brings along, and drivers that trace
    /// by shaders of their own leave out.
    pub queries: bool,
}

/// What compute shaders do with the invocations of a subgroup.
const SUBGROUP_OPERATIONS: vk::SubgroupFeatureFlags = vk::SubgroupFeatureFlags::from_raw(
    vk::SubgroupFeatureFlags::BASIC.as_raw()
        | vk::SubgroupFeatureFlags::ARITHMETIC.as_raw()
        | vk::SubgroupFeatureFlags::BALLOT.as_raw()
        | vk::SubgroupFeatureFlags::SHUFFLE.as_raw(),
);

impl fmt::Display for DeviceInfo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (major, minor, patch) = self.api_version;
        write!(f, "{}, {} {}, Vulkan {major}.{minor}.{patch}", self.name, self.driver_name, self.driver_info)
    }
}

impl DeviceInfo {
    /// Limits of ray tracing; zeros where the device has none.
    pub fn rt(&self) -> RtLimits {
        self.found.rt
    }

    /// Invocations of a subgroup.
    pub fn subgroup_size(&self) -> u32 {
        self.found.subgroup_size
    }

    /// Whether pipelines can say that their accesses to buffers need no check (`VK_EXT_pipeline_robustness`).
    pub(super) fn can_leave_unchecked(&self) -> bool {
        self.found.unchecked
    }

    /// Whether shaders can tell how long they take (`VK_KHR_shader_clock`).
    pub fn has_clock(&self) -> bool {
        self.found.clock
    }

    /// What the device lacks for a tier, in words; empty if it can run it.
    pub fn lacks(&self, tier: Tier) -> Vec<String> {
        match tier {
            Tier::Compute => self.lacks_compute.clone(),
            Tier::Rt => self.lacks_compute.iter().chain(&self.lacks_rt).cloned().collect(),
        }
    }

    /// Whether the device can run a tier.
    pub fn can(&self, tier: Tier) -> bool {
        self.lacks(tier).is_empty()
    }

    /// Whether the device is a program on the CPU.
    pub fn is_software(&self) -> bool {
        self.kind == DeviceKind::Cpu
    }

    /// Place in the order of preference: less is better. Hardware comes before software whatever its features,
    /// because since Mesa 24.1 the software device advertises ray tracing too.
    pub fn rank(&self, tier: Tier) -> (bool, u32) {
        let kind = match self.kind {
            DeviceKind::Discrete => 0,
            DeviceKind::Integrated => 1,
            DeviceKind::Virtual => 2,
            DeviceKind::Other => 3,
            DeviceKind::Cpu => 4,
        };
        (!self.can(tier), kind)
    }
}

/// Device extensions of the ray tracing tier.
pub(super) const RT_EXTENSIONS: &[&CStr] = &[
    ash::khr::acceleration_structure::NAME,
    ash::khr::ray_tracing_pipeline::NAME,
    ash::khr::deferred_host_operations::NAME,
];

/// Device extension of [`RtLimits::reorder`], enabled where it exists.
pub(super) const REORDER_EXTENSION: &CStr = ash::nv::ray_tracing_invocation_reorder::NAME;

/// Device extension of [`DeviceInfo::can_leave_unchecked`], enabled where it exists.
pub(super) const ROBUSTNESS_EXTENSION: &CStr = ash::ext::pipeline_robustness::NAME;

/// Device extension of [`DeviceInfo::has_clock`], enabled where it exists.
pub(super) const CLOCK_EXTENSION: &CStr = ash::khr::shader_clock::NAME;

/// The feature structures of the tiers, one by one: an OpenXR runtime may chain its own structures for features
/// of the same Vulkan version into device creation, which the collective `VkPhysicalDeviceVulkan12Features`
/// forbids.
#[derive(Default)]
pub(super) struct Features {
    pub scalar: vk::PhysicalDeviceScalarBlockLayoutFeatures<'static>,
    pub address: vk::PhysicalDeviceBufferDeviceAddressFeatures<'static>,
    pub acceleration: vk::PhysicalDeviceAccelerationStructureFeaturesKHR<'static>,
    pub pipeline: vk::PhysicalDeviceRayTracingPipelineFeaturesKHR<'static>,
    pub reorder: vk::PhysicalDeviceRayTracingInvocationReorderFeaturesNV<'static>,
    pub clock: vk::PhysicalDeviceShaderClockFeaturesKHR<'static>,
    pub robustness: vk::PhysicalDevicePipelineRobustnessFeaturesEXT<'static>,
}

impl Features {
    /// What a device of this tier is created with.
    pub fn enabled(tier: Tier) -> Self {
        let rt = tier == Tier::Rt;
        Self {
            scalar: vk::PhysicalDeviceScalarBlockLayoutFeatures::default().scalar_block_layout(true),
            address: vk::PhysicalDeviceBufferDeviceAddressFeatures::default().buffer_device_address(true),
            acceleration: vk::PhysicalDeviceAccelerationStructureFeaturesKHR::default().acceleration_structure(rt),
            pipeline: vk::PhysicalDeviceRayTracingPipelineFeaturesKHR::default().ray_tracing_pipeline(rt),
            reorder: vk::PhysicalDeviceRayTracingInvocationReorderFeaturesNV::default()
                .ray_tracing_invocation_reorder(rt),
            clock: vk::PhysicalDeviceShaderClockFeaturesKHR::default().shader_subgroup_clock(true),
            robustness: vk::PhysicalDevicePipelineRobustnessFeaturesEXT::default().pipeline_robustness(true),
        }
    }
}

/// Describes the device at `index` of the loader's list.
pub(super) fn describe(
    instance: &ash::Instance,
    physical: vk::PhysicalDevice,
    index: usize,
    faults: &FaultInjection,
) -> Result<DeviceInfo, VulkanError> {
    // SAFETY: `physical` comes from `instance`, which the caller keeps alive.
    let basic = unsafe { instance.get_physical_device_properties(physical) };
    let api_version = (
        vk::api_version_major(basic.api_version),
        vk::api_version_minor(basic.api_version),
        vk::api_version_patch(basic.api_version),
    );
    let name = text(basic.device_name_as_c_str());
    let extensions = faults.call("vkEnumerateDeviceExtensionProperties", &name, || {
        // SAFETY: as above.
        unsafe { instance.enumerate_device_extension_properties(physical) }
    })?;
    let has = |wanted: &CStr| extensions.iter().any(|e| e.extension_name_as_c_str() == Ok(wanted));
    let rt_extensions = RT_EXTENSIONS.iter().all(|e| has(e));
    let clock_extension = has(CLOCK_EXTENSION);
    let robustness_extension = has(ROBUSTNESS_EXTENSION);
    let reorder_extension = rt_extensions && has(REORDER_EXTENSION);

    let mut driver = vk::PhysicalDeviceDriverProperties::default();
    let mut subgroup = vk::PhysicalDeviceSubgroupProperties::default();
    let mut features = Features::default();
    let mut rt_pipeline = vk::PhysicalDeviceRayTracingPipelinePropertiesKHR::default();
    let mut rt_structure = vk::PhysicalDeviceAccelerationStructurePropertiesKHR::default();
    // Structures of Vulkan 1.2 and of extensions may only be chained where the device knows them.
    let modern = api_version >= (1, 2, 0);
    if modern {
        let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut driver).push_next(&mut subgroup);
        if rt_extensions {
            properties = properties.push_next(&mut rt_pipeline).push_next(&mut rt_structure);
        }
        // SAFETY: as above; the chain holds structures of the device's own Vulkan version.
        unsafe { instance.get_physical_device_properties2(physical, &mut properties) };
        let mut chain =
            vk::PhysicalDeviceFeatures2::default().push_next(&mut features.scalar).push_next(&mut features.address);
        if rt_extensions {
            chain = chain.push_next(&mut features.acceleration).push_next(&mut features.pipeline);
        }
        if reorder_extension {
            chain = chain.push_next(&mut features.reorder);
        }
        if clock_extension {
            chain = chain.push_next(&mut features.clock);
        }
        if robustness_extension {
            chain = chain.push_next(&mut features.robustness);
        }
        // SAFETY: as above.
        unsafe { instance.get_physical_device_features2(physical, &mut chain) };
    }
    // SAFETY: as above.
    let memory = unsafe { instance.get_physical_device_memory_properties(physical) };
    // SAFETY: as above.
    let families = unsafe { instance.get_physical_device_queue_family_properties(physical) };
    // A queue that can draw as well, if there is one: windows and OpenXR sessions copy pictures on it.
    let both = vk::QueueFlags::COMPUTE | vk::QueueFlags::GRAPHICS;
    let family = [both, vk::QueueFlags::COMPUTE]
        .iter()
        .find_map(|flags| families.iter().position(|f| f.queue_flags.contains(*flags) && f.queue_count > 0));

    let limits = &basic.limits;
    let mut lacks_compute = Vec::new();
    let mut require = |present: bool, what: &str| {
        if !present {
            lacks_compute.push(what.to_owned());
        }
    };
    let buffers = shader_io::STORAGE_BUFFERS;
    let group = shader_io::GROUP_WIDTH * shader_io::GROUP_HEIGHT;
    require(modern, "Vulkan 1.2");
    require(!modern || features.scalar.scalar_block_layout == vk::TRUE, "scalarBlockLayout");
    require(!modern || features.address.buffer_device_address == vk::TRUE, "bufferDeviceAddress");
    require(family.is_some(), "a compute queue");
    require(
        !modern
            || subgroup.supported_operations.contains(SUBGROUP_OPERATIONS)
                && subgroup.supported_stages.contains(vk::ShaderStageFlags::COMPUTE),
        "ballots, arithmetic and shuffles of subgroups in compute shaders",
    );
    require(
        limits.max_per_stage_descriptor_storage_buffers.min(limits.max_descriptor_set_storage_buffers) >= buffers,
        &format!("{buffers} storage buffers per stage"),
    );
    require(
        limits.max_compute_work_group_invocations >= group.max(shader_io::PROBE_GROUP),
        &format!("workgroups of {group} invocations"),
    );
    let mut lacks_rt = Vec::new();
    for extension in RT_EXTENSIONS {
        if !has(extension) {
            lacks_rt.push(extension.to_string_lossy().into_owned());
        }
    }
    for (present, feature) in [
        (!rt_extensions || features.acceleration.acceleration_structure == vk::TRUE, "accelerationStructure"),
        (!rt_extensions || features.pipeline.ray_tracing_pipeline == vk::TRUE, "rayTracingPipeline"),
    ] {
        if !present {
            lacks_rt.push(feature.to_owned());
        }
    }

    let local = memory.memory_heaps_as_slice().iter().filter(|h| h.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL));
    Ok(DeviceInfo {
        index,
        name,
        kind: match basic.device_type {
            vk::PhysicalDeviceType::DISCRETE_GPU => DeviceKind::Discrete,
            vk::PhysicalDeviceType::INTEGRATED_GPU => DeviceKind::Integrated,
            vk::PhysicalDeviceType::VIRTUAL_GPU => DeviceKind::Virtual,
            vk::PhysicalDeviceType::CPU => DeviceKind::Cpu,
            _ => DeviceKind::Other,
        },
        driver_name: text(driver.driver_name_as_c_str()),
        driver_info: text(driver.driver_info_as_c_str()),
        api_version,
        memory: local.map(|h| h.size).max().unwrap_or(0),
        max_storage_range: u64::from(limits.max_storage_buffer_range),
        max_workgroups: [limits.max_compute_work_group_count[0], limits.max_compute_work_group_count[1]],
        lacks_compute,
        lacks_rt,
        found: Found {
            queue_family: family.map(|f| f as u32),
            timestamp_bits: family.map_or(0, |f| families[f].timestamp_valid_bits),
            timestamp_period: limits.timestamp_period,
            clock: clock_extension && features.clock.shader_subgroup_clock == vk::TRUE,
            unchecked: robustness_extension && features.robustness.pipeline_robustness == vk::TRUE,
            subgroup_size: subgroup.subgroup_size,
            portability: has(ash::khr::portability_subset::NAME),
            rt: RtLimits {
                recursion_depth: rt_pipeline.max_ray_recursion_depth,
                handle_size: rt_pipeline.shader_group_handle_size,
                handle_alignment: rt_pipeline.shader_group_handle_alignment,
                base_alignment: rt_pipeline.shader_group_base_alignment,
                max_stride: rt_pipeline.max_shader_group_stride,
                scratch_alignment: rt_structure.min_acceleration_structure_scratch_offset_alignment,
                max_primitives: rt_structure.max_primitive_count,
                max_instances: rt_structure.max_instance_count,
                reorder: reorder_extension && features.reorder.ray_tracing_invocation_reorder == vk::TRUE,
                queries: has(ash::khr::ray_query::NAME),
            },
            cache_uuid: basic.pipeline_cache_uuid,
            vendor_id: basic.vendor_id,
            device_id: basic.device_id,
            driver_version: basic.driver_version,
        },
    })
}

fn text(name: Result<&CStr, std::ffi::FromBytesUntilNulError>) -> String {
    name.map_or_else(|_| "unnamed".to_owned(), |name| name.to_string_lossy().into_owned())
}
