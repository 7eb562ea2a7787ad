//! The ray tracing backend: `VK_KHR_ray_tracing_pipeline` with raygen, miss, intersection and hit stages, after the
//! RTX stages of the book (its sections 3.3.4 and 3.3.5).
//!
//! **Recursion.** Miss shaders transport the geodesic and return; raygen traces again. So the declared depth is 1
//! whatever the number of bounces. The variant of the book's text, in which the miss shader traces on itself, is kept
//! as an experiment ([`RtOptions::recursive`]); a device must grant one level for each bounce.
//!
//! **Acceleration structures** ([`scene`]) exist for what the scene has: bottom-level structures over meshes and over
//! boxes of quadrics, a top-level structure for each cell. In Euclidean space all copies of a mesh are instances of one
//! structure; where isometries move the chart projectively each copy has its own vertices, and copies share one structure
//! per cell; curved geometries, where structures are of boxes, have one for each copy.
//!
//! **Curved geodesics.** The device traces straight rays beside arcs, in pieces where an arc bulges much, among boxes about the
//! triangles that are larger by as much as a piece may be away from its ray ([`World::margin`]); an intersection shader meets
//! the triangles with the arc.
//!
//! **Guards** ([`guards`]): where traversal is software, raygen masks out what a segment does not come near, and traces none that
//! comes near nothing. What one guard alone holds has a structure of its own (`alone`), and few triangles have no images.
//!
//! **Moving objects** ([`moving`]) are placed on the device and their structures refitted.
//!
//! **The same picture.** Traversal only selects a primitive; the hit itself is computed again from the primitive by the
//! stage bodies that the compute backend runs, so both backends agree to the last bit but for rays within a rounding
//! of an outline.

mod alone;
pub mod guards;
pub mod moving;
pub mod scene;

use super::{
    RenderError, StructureStats,
    device::{Device, DeviceBackend, Scratch, Tracer},
    plan::{Feature, Heat},
    world::World,
};
use crate::{
    geometry::GeometryId,
    shader_io::{
        self as io, COUNT_NODES, COUNT_QUADRICS, COUNT_TRIANGLES, Dispatch, LIST_WIDTH, Specialization, binding,
    },
    vulkan::{
        Context, DeviceInfo, Tier, VulkanError,
        descriptor::{Bound, BufferSet, Layout},
        record::Recorder,
        tracing::{
            pipeline::{HitGroup, TracePipeline, TraceShaders},
            table::ShaderTable,
        },
    },
};
use guards::Guards;
use scene::{Built, RtScene};
use std::sync::Arc;

/// Draws on a Vulkan device with ray tracing pipelines.
pub type RtBackend = DeviceBackend<Rt>;

/// Choices of the user.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RtOptions {
    /// Miss shaders trace on by themselves instead of returning to raygen. Needs a recursion depth of one more than
    /// bounces.
    pub recursive: bool,
}

/// The launch for so many pixels across and down: whole blocks, see `launch_pixel` in `shaders/entry/raygen.rgen`.
fn whole_blocks([across, down]: [u32; 2]) -> [u32; 2] {
    [across.next_multiple_of(8), down.next_multiple_of(2)]
}

/// The ray tracing pipeline of a world.
#[derive(Debug)]
pub struct Rt {
    pipeline: TracePipeline,
    /// What it was compiled for.
    variant: Variant,
    table: ShaderTable,
    /// None if the plan has neither meshes nor quadrics.
    scene: Option<RtScene>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Variant {
    geometry: GeometryId,
    constants: Specialization,
    recursion_depth: u32,
    raygen: &'static str,
}

/// Hit groups of a plan, in the order of their indices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Group {
    /// Triangles without holes.
    Opaque,
    /// Triangles whose material has an alpha mask.
    Masked,
    /// Quadrics.
    Quadric,
}

/// The groups that a plan needs.
pub(super) fn groups(world: &World) -> Vec<Group> {
    let plan = &world.plan;
    let all = [
        (Group::Opaque, plan.uses(Feature::Meshes)),
        (Group::Masked, plan.uses(Feature::Meshes) && plan.uses(Feature::AlphaMask)),
        (Group::Quadric, plan.uses(Feature::Quadrics)),
    ];
    all.into_iter().filter(|(_, needed)| *needed).map(|(group, _)| group).collect()
}

fn shaders_of(group: Group, straight: bool) -> HitGroup<'static> {
    let triangle = HitGroup { closest: "triangle.rchit", any: None, intersection: None };
    match group {
        // Arcs meet triangles in the intersection shader, which knows of holes as well.
        Group::Opaque | Group::Masked if !straight => HitGroup { intersection: Some("triangle.rint"), ..triangle },
        Group::Opaque => triangle,
        Group::Masked => HitGroup { any: Some("mask.rahit"), ..triangle },
        Group::Quadric => HitGroup { closest: "quadric.rchit", any: None, intersection: Some("quadric.rint") },
    }
}

impl Rt {
    fn pipeline(context: &Arc<Context>, world: &World, variant: &Variant) -> Result<TracePipeline, VulkanError> {
        let recursive = variant.recursion_depth > 1;
        let transport = if recursive { "recursive.rmiss" } else { "transport.rmiss" };
        let mut misses = vec![transport];
        misses.extend((!world.geometry.is_straight()).then_some("piece.rmiss"));
        misses.extend(world.plan.uses(Feature::Shadows).then_some("shadow.rmiss"));
        let groups: Vec<HitGroup<'_>> =
            groups(world).into_iter().map(|group| shaders_of(group, world.geometry.is_straight())).collect();
        TracePipeline::new(
            context,
            &TraceShaders {
                geometry: variant.geometry,
                raygen: variant.raygen,
                misses: &misses,
                groups: &groups,
                constants: &variant.constants.words(),
                push_bytes: size_of::<Dispatch>() as u32,
                recursion_depth: variant.recursion_depth,
            },
        )
    }
}

impl Tracer for Rt {
    const NAME: &'static str = "rt";
    const TIER: Tier = Tier::Rt;
    // The device's own traversal does not say what it looked at, and intersection shaders that count would be measured
    // for their counting.
    const UNCOUNTED: &'static [u32] = &[COUNT_NODES, COUNT_TRIANGLES, COUNT_QUADRICS];
    type Options = RtOptions;

    fn load(
        device: &mut Device,
        world: &World,
        options: RtOptions,
        last: Option<Self>,
    ) -> Result<(Self, Vec<Bound>), RenderError> {
        let guards = Guards::new(device.context.info().is_software(), world);
        let variant = Variant {
            geometry: world.geometry,
            constants: guards.specialize(world.plan.specialization()),
            recursion_depth: if options.recursive { world.settings.bounces.saturating_add(1).max(2) } else { 1 },
            raygen: match world.plan.heat {
                Some(Heat::Time) => "raygen_clock.rgen",
                _ if device.context.info().rt().reorder => "raygen_reorder.rgen",
                _ => "raygen.rgen",
            },
        };
        // The pipeline first: it may be refused, and its cost does not depend on the scene.
        let pipeline = match last.filter(|last| last.variant == variant) {
            Some(last) => last.pipeline,
            None => Self::pipeline(&device.context, world, &variant)?,
        };
        let Built { scene, bound, records } = RtScene::build(device, world, &guards)?;
        let table = ShaderTable::new(&device.context, &mut device.submitter, &pipeline, &records)?;
        Ok((Self { pipeline, variant, table, scene }, bound))
    }

    fn pose(&mut self, device: &mut Device, world: &World) -> Result<bool, RenderError> {
        match &mut self.scene {
            Some(scene) => scene.pose(device, world),
            None => Ok(true),
        }
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
        // Rows of a list are whole but for the last.
        let extent = if self.variant.constants.listed != 0 {
            [LIST_WIDTH, tile.extent[0].div_ceil(LIST_WIDTH), 1]
        } else {
            let [across, down] = whole_blocks(tile.extent);
            [across, down, eyes]
        };
        recorder.trace(&self.pipeline, &self.table, set, tile, extent)
    }

    fn scratch(&self, _: &DeviceInfo, [across, down, eyes]: [u32; 3]) -> Option<Scratch> {
        let [across, down] = whole_blocks([across, down]);
        let pixels: u64 = [across, down, eyes].map(u64::from).iter().product();
        let bytes = pixels * size_of::<io::Arc>() as u64;
        (!self.variant.geometry.is_straight()).then_some(Scratch { binding: binding::arcs, name: "arcs", bytes })
    }

    fn memory(&self) -> u64 {
        self.table.bytes() + self.scene.as_ref().map_or(0, RtScene::memory)
    }

    fn structures(&self) -> Option<StructureStats> {
        let scene = self.scene.as_ref().map_or_else(StructureStats::default, RtScene::stats);
        Some(StructureStats { bytes_table: self.table.bytes(), ..scene })
    }
}
