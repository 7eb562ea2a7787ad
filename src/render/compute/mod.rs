//! The compute backend: any Vulkan 1.2 device, with the hierarchy of [`super::bvh`].

pub mod probe;
pub mod walker;

use super::{
    RenderError,
    device::{Device, DeviceBackend, Scratch, Tracer, pack},
    plan::{Feature, Heat},
    world::World,
};
use crate::{
    geometry::GeometryId,
    shader_io::{
        ARRAY_NODES, ARRAY_QUADRIC_SHADING, ARRAY_QUADRICS, ARRAY_TRIANGLES, ARRAYS, Dispatch, GROUP_HEIGHT,
        GROUP_WIDTH, LIST_WIDTH, Specialization, binding, types::uvec4,
    },
    vulkan::{
        DeviceInfo, Tier, VulkanError,
        descriptor::{Bound, BufferSet, Layout},
        record::Recorder,
        shader::{ComputePipeline, ComputeShader},
    },
};
use bytemuck::cast_slice;

/// Draws on a Vulkan device with compute shaders.
pub type ComputeBackend = DeviceBackend<Compute>;

/// Choices of the user.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ComputeOptions {
    /// Whether the invocations of a subgroup walk the hierarchies together or each alone; not said, as the device is
    /// faster.
    pub together: Option<bool>,
}

/// Whether a device is faster with invocations that walk together: software that runs a subgroup in lockstep, as the lanes
/// of a vector, and reads once what all of them read. Mesa's does so in version 25 and later; 22.3.6 reads lane by lane.
pub fn walks_together(device: &DeviceInfo) -> bool {
    let mesa = device.driver_info.split_once("Mesa ").and_then(|(_, version)| version.split('.').next()?.parse().ok());
    device.is_software() && mesa.is_none_or(|version: u32| version >= 25)
}

/// The compute pipeline of a world.
#[derive(Debug)]
pub struct Compute {
    pipeline: ComputePipeline,
    /// What it was compiled for.
    variant: (GeometryId, Specialization, &'static str),
}

impl Tracer for Compute {
    const NAME: &'static str = "compute";
    const TIER: Tier = Tier::Compute;
    const UNCOUNTED: &'static [u32] = &[];
    type Options = ComputeOptions;

    fn load(
        device: &mut Device,
        world: &World,
        options: ComputeOptions,
        last: Option<Self>,
    ) -> Result<(Self, Vec<Bound>), RenderError> {
        let hierarchy = world.hierarchy();
        let mut cells = pack::cells(world, hierarchy, &[]);
        let mut nodes = hierarchy.nodes.clone();
        let (mut quadrics, mut quadric_shading) = Default::default();
        let (triangles, shading) = if world.plan.uses(Feature::Meshes) {
            pack::pairs_in_order(world.meshes(), &hierarchy.pairs, &mut nodes)
        } else {
            Default::default()
        };
        if world.plan.uses(Feature::Quadrics) {
            quadrics = world.quadrics.iter().map(pack::quadric).collect::<Vec<_>>();
            quadric_shading = world.quadrics.iter().map(pack::quadric_shading).collect::<Vec<_>>();
        }
        let info = device.context.info();
        let together = options.together.unwrap_or_else(|| walks_together(info)) && info.subgroup_size() <= 8;
        if together {
            pack::put_nodes_above_roots(&mut cells, &mut nodes);
        }
        let mut bound = device.upload(&[
            (binding::cells, "cells", cast_slice(&cells)),
            (binding::voxels, "voxels", cast_slice(&hierarchy.voxels.words)),
            (binding::triangle_shading, "triangle shading", cast_slice(&shading)),
        ])?;
        let mut arrays = [uvec4::default(); ARRAYS as usize];
        arrays[ARRAY_NODES as usize] = device.upload_addressed(&mut bound, (binding::nodes, "nodes"), nodes)?;
        arrays[ARRAY_TRIANGLES as usize] =
            device.upload_addressed(&mut bound, (binding::triangles, "triangles"), triangles)?;
        arrays[ARRAY_QUADRICS as usize] =
            device.upload_addressed(&mut bound, (binding::quadric_surfaces, "quadrics"), quadrics)?;
        arrays[ARRAY_QUADRIC_SHADING as usize] =
            device.upload_addressed(&mut bound, (binding::quadric_shading, "quadric shading"), quadric_shading)?;
        bound.extend(device.upload(&[(binding::arrays, "addresses of arrays", cast_slice(&arrays))])?);
        let entry = if world.plan.heat == Some(Heat::Time) { "path_clock.comp" } else { "path.comp" };
        // A level has an entry of two words, where `stack` counts three, and one word says how many are in use. Few sizes of stacks,
        // so that pipelines fit one world after the other.
        let together = if together { (hierarchy.stack + 1).next_power_of_two().max(16) } else { 0 };
        let variant = (world.geometry, Specialization { together, ..world.plan.specialization() }, entry);
        let tracer = match last.filter(|last| last.variant == variant) {
            Some(last) => last,
            None => Self {
                pipeline: ComputePipeline::new(
                    &device.context,
                    &ComputeShader {
                        entry,
                        geometry: world.geometry,
                        constants: &variant.1.words(),
                        push_bytes: size_of::<Dispatch>() as u32,
                    },
                )?,
                variant,
            },
        };
        Ok((tracer, bound))
    }

    fn scratch(&self, device: &DeviceInfo, [width, height, eyes]: [u32; 3]) -> Option<Scratch> {
        let groups = [width.div_ceil(GROUP_WIDTH), height.div_ceil(GROUP_HEIGHT), eyes].map(u64::from);
        let subgroups = u64::from((GROUP_WIDTH * GROUP_HEIGHT).div_ceil(device.subgroup_size().max(1)));
        let bytes = groups.iter().product::<u64>() * subgroups * u64::from(self.variant.1.together) * 4;
        (bytes > 0).then_some(Scratch { binding: binding::stacks, name: "stacks", bytes })
    }

    fn layout(&self) -> &Layout {
        self.pipeline.layout()
    }

    fn trace<'a>(
        &'a self,
        recorder: &mut Recorder<'a>,
        set: &'a BufferSet,
        tile: &Dispatch,
        eyes: u32,
    ) -> Result<(), VulkanError> {
        let groups = if self.variant.1.listed != 0 {
            let groups = tile.extent[0].div_ceil(GROUP_WIDTH * GROUP_HEIGHT);
            let across = groups.min(LIST_WIDTH);
            [across, groups.div_ceil(across.max(1)), 1]
        } else {
            [tile.extent[0].div_ceil(GROUP_WIDTH), tile.extent[1].div_ceil(GROUP_HEIGHT), eyes]
        };
        recorder.dispatch(&self.pipeline, set, Some(tile), groups)
    }
}
