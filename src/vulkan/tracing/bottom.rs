//! Bottom-level structures: what is in one buffer of triangles or boxes.
//!
//! Structures that never change are compacted: drivers reserve for the worst case and know the true size only after
//! the build. Structures that move are built to be refitted, which keeps their topology and costs a fraction of a
//! build.

use super::structure::{Structure, build_sizes, scratch};
use crate::{
    shader_io::Triangle,
    vulkan::{
        Context, VulkanError,
        command::Submitter,
        memory::Buffer,
        record::{Access, Recorder},
    },
};
use ash::vk;
use std::sync::Arc;

/// Scratch memory of builds that run side by side. A build that needs more runs alone.
const SCRATCH_BYTES: u64 = 32 << 20;

/// Bytes of three corners, each on a third of them.
const TRIANGLE_BYTES: u64 = size_of::<Triangle>() as u64;

/// Bytes of the lower and the upper corner of a box.
const BOX_BYTES: u64 = size_of::<vk::AabbPositionsKHR>() as u64;

/// What a structure is built over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shapes {
    /// Corners of triangles: nine floats each.
    Triangles,
    /// Boxes: six floats each, aligned to 8 bytes in their buffer.
    Boxes,
}

/// Primitives that share a hit record: one geometry of a structure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    /// First primitive in the buffer.
    pub first: u32,
    /// Number of primitives.
    pub count: u32,
    /// Whether every hit counts; else any-hit shaders decide.
    pub opaque: bool,
}

/// What to build.
#[derive(Clone, Debug)]
pub struct Blueprint {
    /// For messages.
    pub name: String,
    /// What is in the buffer.
    pub shapes: Shapes,
    /// The primitives; made with [`INPUT_USAGE`].
    pub buffer: Arc<Buffer>,
    /// The geometries, in the order of their hit records.
    pub parts: Vec<Part>,
    /// Whether the primitives will move: then the structure can be refitted, else it is compacted.
    pub moves: bool,
}

/// Uses of buffers that structures are built from.
pub const INPUT_USAGE: vk::BufferUsageFlags = vk::BufferUsageFlags::ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_KHR;

/// A bottom-level structure. It needs its primitives' buffer only to be refitted.
pub struct BottomLevel {
    structure: Structure,
    /// For structures that move.
    refit: Option<Refit>,
}

struct Refit {
    blueprint: Blueprint,
    scratch: Buffer,
}

impl std::fmt::Debug for BottomLevel {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "BottomLevel({}, {} bytes)", self.structure.name(), self.structure.bytes())
    }
}

/// Bytes of structures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Bytes {
    /// As the driver reserved them.
    pub built: u64,
    /// As they are kept.
    pub kept: u64,
}

impl BottomLevel {
    /// Builds structures, side by side as far as scratch memory allows.
    ///
    /// # Errors
    /// Driver failures; [`VulkanError::TooMany`] primitives.
    pub fn build(
        context: &Arc<Context>,
        submitter: &mut Submitter,
        blueprints: Vec<Blueprint>,
    ) -> Result<(Vec<Self>, Bytes), VulkanError> {
        let mut made = Vec::with_capacity(blueprints.len());
        let mut bytes = Bytes::default();
        let mut batch = Vec::new();
        let mut reserved = 0;
        for blueprint in blueprints {
            let job = Job::new(context, blueprint)?;
            if !batch.is_empty() && reserved + job.scratch_bytes > SCRATCH_BYTES {
                build_batch(context, submitter, std::mem::take(&mut batch), &mut made, &mut bytes)?;
                reserved = 0;
            }
            reserved += job.scratch_bytes;
            batch.push(job);
        }
        build_batch(context, submitter, batch, &mut made, &mut bytes)?;
        Ok((made, bytes))
    }

    /// Where the device finds it.
    pub(super) fn address(&self) -> vk::DeviceAddress {
        self.structure.address()
    }

    /// Bytes that it keeps.
    pub fn bytes(&self) -> u64 {
        self.structure.bytes() + self.refit.as_ref().map_or(0, |refit| refit.scratch.size())
    }

    /// Whether it can be refitted.
    pub fn moves(&self) -> bool {
        self.refit.is_some()
    }
}

/// A structure before its build.
struct Job {
    blueprint: Blueprint,
    sizes: vk::AccelerationStructureBuildSizesInfoKHR<'static>,
    scratch_bytes: u64,
}

impl Job {
    fn new(context: &Arc<Context>, blueprint: Blueprint) -> Result<Self, VulkanError> {
        let counts: Vec<u32> = blueprint.parts.iter().map(|part| part.count).collect();
        let all: u64 = counts.iter().map(|n| u64::from(*n)).sum();
        let limit = context.info().rt().max_primitives;
        if all > limit {
            let device = context.info().name.clone();
            return Err(VulkanError::TooMany { what: blueprint.name, count: all, limit, device });
        }
        let geometries = geometries(&blueprint);
        let sizes = build_sizes(context, &build_info(&blueprint, &geometries), &counts)?;
        let alignment = u64::from(context.info().rt().scratch_alignment.max(1));
        Ok(Self { scratch_bytes: sizes.build_scratch_size.max(1).next_multiple_of(alignment), blueprint, sizes })
    }
}

fn geometries(blueprint: &Blueprint) -> Vec<vk::AccelerationStructureGeometryKHR<'static>> {
    let start = blueprint.buffer.address();
    let geometry = |part: &Part| {
        // Masked triangles are looked at once each, so that any-hit counts are the same everywhere.
        let flags = if part.opaque {
            vk::GeometryFlagsKHR::OPAQUE
        } else {
            vk::GeometryFlagsKHR::NO_DUPLICATE_ANY_HIT_INVOCATION
        };
        let base = vk::AccelerationStructureGeometryKHR::default().flags(flags);
        match blueprint.shapes {
            Shapes::Triangles => {
                let at = start + u64::from(part.first) * TRIANGLE_BYTES;
                let triangles = vk::AccelerationStructureGeometryTrianglesDataKHR::default()
                    .vertex_format(vk::Format::R32G32B32_SFLOAT)
                    .vertex_data(vk::DeviceOrHostAddressConstKHR { device_address: at })
                    .vertex_stride(TRIANGLE_BYTES / 3)
                    .max_vertex((3 * part.count).saturating_sub(1))
                    .index_type(vk::IndexType::NONE_KHR);
                base.geometry_type(vk::GeometryTypeKHR::TRIANGLES)
                    .geometry(vk::AccelerationStructureGeometryDataKHR { triangles })
            }
            Shapes::Boxes => {
                let at = start + u64::from(part.first) * BOX_BYTES;
                let aabbs = vk::AccelerationStructureGeometryAabbsDataKHR::default()
                    .data(vk::DeviceOrHostAddressConstKHR { device_address: at })
                    .stride(BOX_BYTES);
                base.geometry_type(vk::GeometryTypeKHR::AABBS)
                    .geometry(vk::AccelerationStructureGeometryDataKHR { aabbs })
            }
        }
    };
    blueprint.parts.iter().map(geometry).collect()
}

fn build_info<'a>(
    blueprint: &Blueprint,
    geometries: &'a [vk::AccelerationStructureGeometryKHR<'static>],
) -> vk::AccelerationStructureBuildGeometryInfoKHR<'a> {
    let flags = if blueprint.moves {
        vk::BuildAccelerationStructureFlagsKHR::ALLOW_UPDATE | vk::BuildAccelerationStructureFlagsKHR::PREFER_FAST_TRACE
    } else {
        vk::BuildAccelerationStructureFlagsKHR::ALLOW_COMPACTION
            | vk::BuildAccelerationStructureFlagsKHR::PREFER_FAST_TRACE
    };
    vk::AccelerationStructureBuildGeometryInfoKHR::default()
        .ty(vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL)
        .flags(flags)
        .mode(vk::BuildAccelerationStructureModeKHR::BUILD)
        .geometries(geometries)
}

fn ranges(blueprint: &Blueprint) -> Vec<vk::AccelerationStructureBuildRangeInfoKHR> {
    let range = |part: &Part| vk::AccelerationStructureBuildRangeInfoKHR::default().primitive_count(part.count);
    blueprint.parts.iter().map(range).collect()
}

fn build_batch(
    context: &Arc<Context>,
    submitter: &mut Submitter,
    jobs: Vec<Job>,
    made: &mut Vec<BottomLevel>,
    bytes: &mut Bytes,
) -> Result<(), VulkanError> {
    if jobs.is_empty() {
        return Ok(());
    }
    let functions = &context.tracing()?.acceleration;
    let level = vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL;
    let memory = scratch(context, jobs.iter().map(|job| job.scratch_bytes).sum())?;
    let structures = jobs
        .iter()
        .map(|job| Structure::new(context, &job.blueprint.name, level, job.sizes.acceleration_structure_size))
        .collect::<Result<Vec<_>, _>>()?;
    let all_geometries: Vec<_> = jobs.iter().map(|job| geometries(&job.blueprint)).collect();
    let all_ranges: Vec<_> = jobs.iter().map(|job| ranges(&job.blueprint)).collect();
    let mut next = memory.address();
    let mut infos = Vec::with_capacity(jobs.len());
    for ((job, structure), geometries) in jobs.iter().zip(&structures).zip(&all_geometries) {
        infos.push(
            build_info(&job.blueprint, geometries)
                .dst_acceleration_structure(structure.handle())
                .scratch_data(vk::DeviceOrHostAddressKHR { device_address: next }),
        );
        next += job.scratch_bytes;
    }
    let range_slices: Vec<&[_]> = all_ranges.iter().map(Vec::as_slice).collect();
    let fixed: Vec<vk::AccelerationStructureKHR> =
        jobs.iter().zip(&structures).filter(|(job, _)| !job.blueprint.moves).map(|(_, s)| s.handle()).collect();
    let sizes = SizeQueries::new(context, fixed.len() as u32)?;
    submitter.submit("build acceleration structures", |r| {
        r.barrier(&[Access::Shaders, Access::Transfer], &[Access::Build]);
        // SAFETY: inputs, scratch and results are alive until the submission has ended, each build has scratch memory
        // and a result of its own, and the ranges lie in the buffers (the callers' parts).
        unsafe { functions.cmd_build_acceleration_structures(r.raw(), &infos, &range_slices) };
        r.barrier(&[Access::Build], &[Access::Build, Access::Shaders]);
        sizes.ask(r, &fixed);
        Ok(())
    })?;
    let compact = sizes.read()?;
    let mut compact = compact.into_iter();
    let mut originals = Vec::new();
    let mut kept = Vec::with_capacity(jobs.len());
    for (job, structure) in jobs.into_iter().zip(structures) {
        bytes.built += structure.bytes();
        let name = job.blueprint.name.clone();
        if job.blueprint.moves {
            let scratch = scratch(context, job.sizes.update_scratch_size)?;
            kept.push(BottomLevel { structure, refit: Some(Refit { blueprint: job.blueprint, scratch }) });
        } else if let Some(size) = compact.next().filter(|size| *size < structure.bytes()) {
            let small = Structure::new(context, &name, level, size)?;
            originals.push((structure, small.handle()));
            kept.push(BottomLevel { structure: small, refit: None });
        } else {
            kept.push(BottomLevel { structure, refit: None });
        }
    }
    if !originals.is_empty() {
        submitter.submit("compact acceleration structures", |r| {
            r.barrier(&[Access::Build], &[Access::Build]);
            for (original, small) in &originals {
                let info = vk::CopyAccelerationStructureInfoKHR::default()
                    .src(original.handle())
                    .dst(*small)
                    .mode(vk::CopyAccelerationStructureModeKHR::COMPACT);
                // SAFETY: both are alive until the submission has ended; the target has the size that was asked for.
                unsafe { functions.cmd_copy_acceleration_structure(r.raw(), &info) };
            }
            r.barrier(&[Access::Build], &[Access::Build, Access::Shaders]);
            Ok(())
        })?;
    }
    bytes.kept += kept.iter().map(|level| level.structure.bytes()).sum::<u64>();
    made.append(&mut kept);
    Ok(())
}

/// Compacted sizes of structures.
struct SizeQueries<'a> {
    context: &'a Arc<Context>,
    pool: vk::QueryPool,
    count: u32,
}

impl<'a> SizeQueries<'a> {
    fn new(context: &'a Arc<Context>, count: u32) -> Result<Self, VulkanError> {
        let mut queries = Self { context, pool: vk::QueryPool::null(), count };
        if count > 0 {
            let info = vk::QueryPoolCreateInfo::default()
                .query_type(vk::QueryType::ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR)
                .query_count(count);
            queries.pool = context.call("vkCreateQueryPool", "sizes of acceleration structures", |d| {
                // SAFETY: the context is alive and the structure complete.
                unsafe { d.create_query_pool(&info, None) }
            })?;
        }
        Ok(queries)
    }

    fn ask(&self, recorder: &Recorder<'_>, structures: &[vk::AccelerationStructureKHR]) {
        let Ok(functions) = self.context.tracing() else { return };
        if self.count > 0 {
            let kind = vk::QueryType::ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR;
            // SAFETY: the command buffer is recording, the structures are built before, and the pool has a query each.
            unsafe {
                self.context.raw().cmd_reset_query_pool(recorder.raw(), self.pool, 0, self.count);
                functions.acceleration.cmd_write_acceleration_structures_properties(
                    recorder.raw(),
                    structures,
                    kind,
                    self.pool,
                    0,
                );
            }
        }
    }

    fn read(&self) -> Result<Vec<u64>, VulkanError> {
        let mut sizes = vec![0_u64; self.count as usize];
        if self.count > 0 {
            self.context.call("vkGetQueryPoolResults", "sizes of acceleration structures", |d| {
                let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
                // SAFETY: the queries have been written by a finished submission, as 64-bit numbers.
                unsafe { d.get_query_pool_results(self.pool, 0, &mut sizes, flags) }
            })?;
        }
        Ok(sizes)
    }
}

impl Drop for SizeQueries<'_> {
    fn drop(&mut self) {
        if !self.context.is_hung() {
            // SAFETY: the submission that used it has been waited for; a null handle is ignored.
            unsafe { self.context.raw().destroy_query_pool(self.pool, None) };
        }
    }
}

impl<'a> Recorder<'a> {
    /// Refits structures to the new places of their primitives: same primitives, same order. Structures that do not
    /// move are left alone. Later traces and builds see the result.
    ///
    /// # Errors
    /// Structures of another context.
    pub fn refit(&mut self, structures: impl IntoIterator<Item = &'a BottomLevel>) -> Result<(), VulkanError> {
        let moving: Vec<(&Structure, &Refit)> =
            structures.into_iter().filter_map(|s| Some((&s.structure, s.refit.as_ref()?))).collect();
        if moving.is_empty() {
            return Ok(());
        }
        let all_geometries: Vec<_> = moving.iter().map(|(_, refit)| geometries(&refit.blueprint)).collect();
        let all_ranges: Vec<_> = moving.iter().map(|(_, refit)| ranges(&refit.blueprint)).collect();
        let mut infos = Vec::with_capacity(moving.len());
        for ((structure, refit), geometries) in moving.iter().zip(&all_geometries) {
            self.own(refit.scratch.context(), structure.name())?;
            infos.push(
                build_info(&refit.blueprint, geometries)
                    .mode(vk::BuildAccelerationStructureModeKHR::UPDATE)
                    .src_acceleration_structure(structure.handle())
                    .dst_acceleration_structure(structure.handle())
                    .scratch_data(vk::DeviceOrHostAddressKHR { device_address: refit.scratch.address() }),
            );
        }
        let range_slices: Vec<&[_]> = all_ranges.iter().map(Vec::as_slice).collect();
        self.barrier(&[Access::Shaders, Access::Transfer, Access::Build], &[Access::Build]);
        let context = self.context().clone();
        // SAFETY: inputs, scratch and structures live for 'a; the blueprints are those that the structures were built
        // from.
        unsafe {
            context.tracing()?.acceleration.cmd_build_acceleration_structures(self.raw(), &infos, &range_slices);
        }
        self.barrier(&[Access::Build], &[Access::Build, Access::Shaders]);
        Ok(())
    }
}
