//! Top-level structures: instances of bottom-level ones, built anew or refitted.

use super::{
    bottom::BottomLevel,
    structure::{Structure, build_sizes, scratch},
};
use crate::vulkan::{
    Context, VulkanError,
    memory::{Buffer, Direction, HostBuffer},
    record::{Access, Recorder},
};
use ash::vk;
use std::sync::Arc;

/// `VkAccelerationStructureInstanceKHR`: twelve floats of the transform and four words.
type Words = [u32; 16];

/// One instance of a bottom-level structure.
#[derive(Clone, Copy, Debug)]
pub struct Instance<'a> {
    /// What stands there.
    pub structure: &'a BottomLevel,
    /// Rows of the affine map from the structure's coordinates to those of rays.
    pub transform: [[f32; 4]; 3],
    /// First of its hit records; its geometries take the records from there on.
    pub record: u32,
    /// Its mask: rays whose mask has no bit of it pass by. 8 bits.
    pub kind: u32,
}

/// The map that changes nothing.
pub const IDENTITY: [[f32; 4]; 3] = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

impl Instance<'_> {
    fn words(&self) -> Words {
        let flags = vk::GeometryInstanceFlagsKHR::TRIANGLE_FACING_CULL_DISABLE.as_raw() << 24;
        let address = self.structure.address();
        let mut words = [0; 16];
        for (word, x) in words.iter_mut().zip(self.transform.as_flattened()) {
            *word = x.to_bits();
        }
        words[12] = self.kind << 24;
        words[13] = (self.record & 0x00ff_ffff) | flags;
        words[14] = address as u32;
        words[15] = (address >> 32) as u32;
        words
    }
}

/// A top-level structure for a largest number of instances.
pub struct TopLevel {
    structure: Structure,
    scratch: Buffer,
    staging: HostBuffer,
    instances: Buffer,
    capacity: u32,
    /// Instances of the last build; none before the first.
    built: Option<u32>,
}

impl std::fmt::Debug for TopLevel {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "TopLevel({}, {:?} of {} instances)", self.structure.name(), self.built, self.capacity)
    }
}

const FLAGS: vk::BuildAccelerationStructureFlagsKHR = vk::BuildAccelerationStructureFlagsKHR::from_raw(
    vk::BuildAccelerationStructureFlagsKHR::PREFER_FAST_TRACE.as_raw()
        | vk::BuildAccelerationStructureFlagsKHR::ALLOW_UPDATE.as_raw(),
);

impl TopLevel {
    /// Room for `capacity` instances; nothing is built yet.
    ///
    /// # Errors
    /// Driver failures; [`VulkanError::TooMany`] instances.
    pub fn new(context: &Arc<Context>, name: &str, capacity: usize) -> Result<Self, VulkanError> {
        let limit = context.info().rt().max_instances.min(1 << 24);
        if capacity as u64 > limit {
            let (what, device) = (format!("instances in {name}"), context.info().name.clone());
            return Err(VulkanError::TooMany { what, count: capacity as u64, limit, device });
        }
        let capacity = (capacity as u32).max(1);
        let bytes = u64::from(capacity) * size_of::<Words>() as u64;
        let usage = super::bottom::INPUT_USAGE;
        let instances = Buffer::with_usage(context, &format!("instances of {name}"), bytes, usage, 16)?;
        let geometries = geometries(&instances);
        let sizes = build_sizes(context, &build_info(&geometries), &[capacity])?;
        let level = vk::AccelerationStructureTypeKHR::TOP_LEVEL;
        Ok(Self {
            structure: Structure::new(context, name, level, sizes.acceleration_structure_size)?,
            scratch: scratch(context, sizes.build_scratch_size.max(sizes.update_scratch_size))?,
            staging: HostBuffer::new(context, &format!("staging for {name}"), bytes, Direction::Upload)?,
            instances,
            capacity,
            built: None,
        })
    }

    /// Where shaders find it, as low and high word.
    pub fn address(&self) -> [u32; 2] {
        let address = self.structure.address();
        [address as u32, (address >> 32) as u32]
    }

    /// Instances that there is room for.
    pub fn capacity(&self) -> usize {
        self.capacity as usize
    }

    /// Bytes of all that belongs to it.
    pub fn bytes(&self) -> u64 {
        self.structure.bytes() + self.scratch.size() + self.staging.size() + self.instances.size()
    }

    /// Takes the instances of the next [`Recorder::build`]. Whether it can refit what is there: same number as before.
    ///
    /// # Errors
    /// [`VulkanError::OutOfBounds`] beyond the capacity.
    pub fn place(&mut self, instances: &[Instance<'_>]) -> Result<Placed, VulkanError> {
        let words: Vec<Words> = instances.iter().map(Instance::words).collect();
        self.staging.write(0, bytemuck::cast_slice(&words))?;
        let count = instances.len() as u32;
        Ok(Placed { count, refit: self.built.replace(count) == Some(count) && count > 0 })
    }
}

/// What [`TopLevel::place`] found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Placed {
    count: u32,
    /// Whether the structure is refitted rather than built anew.
    pub refit: bool,
}

fn geometries(instances: &Buffer) -> [vk::AccelerationStructureGeometryKHR<'static>; 1] {
    let data = vk::AccelerationStructureGeometryInstancesDataKHR::default()
        .data(vk::DeviceOrHostAddressConstKHR { device_address: instances.address() });
    [vk::AccelerationStructureGeometryKHR::default()
        .geometry_type(vk::GeometryTypeKHR::INSTANCES)
        .geometry(vk::AccelerationStructureGeometryDataKHR { instances: data })]
}

fn build_info<'a>(
    geometries: &'a [vk::AccelerationStructureGeometryKHR<'static>],
) -> vk::AccelerationStructureBuildGeometryInfoKHR<'a> {
    vk::AccelerationStructureBuildGeometryInfoKHR::default()
        .ty(vk::AccelerationStructureTypeKHR::TOP_LEVEL)
        .flags(FLAGS)
        .mode(vk::BuildAccelerationStructureModeKHR::BUILD)
        .geometries(geometries)
}

impl<'a> Recorder<'a> {
    /// Builds or refits a top-level structure over the instances that it was given. Later traces see the result.
    ///
    /// # Errors
    /// A structure of another context.
    pub fn build(&mut self, top: &'a TopLevel, placed: Placed) -> Result<(), VulkanError> {
        self.own(top.instances.context(), top.structure.name())?;
        let bytes = u64::from(placed.count) * size_of::<Words>() as u64;
        // Earlier builds may still read the instances.
        self.barrier(&[Access::Build], &[Access::Transfer]);
        self.upload(&top.staging, &top.instances, 0, bytes)?;
        self.barrier(&[Access::Shaders, Access::Transfer, Access::Build], &[Access::Build]);
        let geometries = geometries(&top.instances);
        let mut info = build_info(&geometries)
            .dst_acceleration_structure(top.structure.handle())
            .scratch_data(vk::DeviceOrHostAddressKHR { device_address: top.scratch.address() });
        if placed.refit {
            info = info
                .mode(vk::BuildAccelerationStructureModeKHR::UPDATE)
                .src_acceleration_structure(top.structure.handle());
        }
        let range = [vk::AccelerationStructureBuildRangeInfoKHR::default().primitive_count(placed.count)];
        let context = self.context().clone();
        // SAFETY: structure, scratch and instances live for 'a; there are at most as many instances as there is room
        // for, and a refit has as many as the build before.
        unsafe {
            context.tracing()?.acceleration.cmd_build_acceleration_structures(self.raw(), &[info], &[&range[..]]);
        }
        self.barrier(&[Access::Build], &[Access::Build, Access::Shaders]);
        Ok(())
    }
}
