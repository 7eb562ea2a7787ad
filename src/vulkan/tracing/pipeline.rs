//! Ray tracing pipelines.

use super::table::ShaderTable;
use crate::{
    geometry::GeometryId,
    vulkan::{
        Context, VulkanError,
        descriptor::{BufferSet, Layout},
        memory::check_range,
        record::Recorder,
        shader::{Module, Specialized, unchecked},
    },
};
use ash::vk;
use bytemuck::Pod;
use std::sync::Arc;

/// Shaders that are called for hits on one kind of primitive.
#[derive(Clone, Copy, Debug)]
pub struct HitGroup<'a> {
    /// Closest-hit entry.
    pub closest: &'a str,
    /// Any-hit entry, where a hit may be a hole.
    pub any: Option<&'a str>,
    /// Intersection entry; none for triangles.
    pub intersection: Option<&'a str>,
}

/// What a ray tracing pipeline is made of. Entries are files in `shaders/entry`.
#[derive(Clone, Copy, Debug)]
pub struct TraceShaders<'a> {
    /// Geometry compiled in.
    pub geometry: GeometryId,
    /// Ray generation entry.
    pub raygen: &'a str,
    /// Miss entries, in the order of their indices.
    pub misses: &'a [&'a str],
    /// Hit groups, by which the records of the table name them.
    pub groups: &'a [HitGroup<'a>],
    /// Values of the specialization constants 0, 1, 2, …
    pub constants: &'a [u32],
    /// Bytes of push constants, for raygen.
    pub push_bytes: u32,
    /// Levels of tracing, raygen's own included.
    pub recursion_depth: u32,
}

/// A ray tracing pipeline.
pub struct TracePipeline {
    name: String,
    layout: Layout,
    handle: vk::Pipeline,
    /// Handles of the groups: raygen, misses, hits.
    handles: Vec<u8>,
    misses: usize,
    hits: usize,
}

impl std::fmt::Debug for TracePipeline {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "TracePipeline({})", self.name)
    }
}

/// Stages of the pipeline that see the bindings.
const STAGES: vk::ShaderStageFlags = vk::ShaderStageFlags::from_raw(
    vk::ShaderStageFlags::RAYGEN_KHR.as_raw()
        | vk::ShaderStageFlags::MISS_KHR.as_raw()
        | vk::ShaderStageFlags::CLOSEST_HIT_KHR.as_raw()
        | vk::ShaderStageFlags::ANY_HIT_KHR.as_raw()
        | vk::ShaderStageFlags::INTERSECTION_KHR.as_raw(),
);

/// Stages with their modules while groups are put together.
#[derive(Default)]
struct Stages<'a> {
    list: Vec<(vk::ShaderStageFlags, &'a str)>,
}

impl<'a> Stages<'a> {
    fn add(&mut self, stage: vk::ShaderStageFlags, entry: &'a str) -> u32 {
        let known = self.list.iter().position(|known| *known == (stage, entry));
        known.unwrap_or_else(|| {
            self.list.push((stage, entry));
            self.list.len() - 1
        }) as u32
    }
}

fn general(stage: u32) -> vk::RayTracingShaderGroupCreateInfoKHR<'static> {
    vk::RayTracingShaderGroupCreateInfoKHR::default()
        .ty(vk::RayTracingShaderGroupTypeKHR::GENERAL)
        .general_shader(stage)
        .closest_hit_shader(vk::SHADER_UNUSED_KHR)
        .any_hit_shader(vk::SHADER_UNUSED_KHR)
        .intersection_shader(vk::SHADER_UNUSED_KHR)
}

impl TracePipeline {
    /// Compiles a pipeline.
    ///
    /// # Errors
    /// Driver failures; an entry that the build does not have; [`VulkanError::Recursion`] beyond what the device
    /// grants.
    pub fn new(context: &Arc<Context>, shaders: &TraceShaders<'_>) -> Result<Self, VulkanError> {
        let limit = context.info().rt().recursion_depth;
        if shaders.recursion_depth > limit {
            let device = context.info().name.clone();
            return Err(VulkanError::Recursion { depth: shaders.recursion_depth, limit, device });
        }
        let name = format!("{} for {}", shaders.raygen, shaders.geometry.name());
        let mut stages = Stages::default();
        let mut groups = vec![general(stages.add(vk::ShaderStageFlags::RAYGEN_KHR, shaders.raygen))];
        for miss in shaders.misses {
            groups.push(general(stages.add(vk::ShaderStageFlags::MISS_KHR, miss)));
        }
        for group in shaders.groups {
            let mut info = general(vk::SHADER_UNUSED_KHR)
                .ty(vk::RayTracingShaderGroupTypeKHR::TRIANGLES_HIT_GROUP)
                .closest_hit_shader(stages.add(vk::ShaderStageFlags::CLOSEST_HIT_KHR, group.closest));
            if let Some(any) = group.any {
                info = info.any_hit_shader(stages.add(vk::ShaderStageFlags::ANY_HIT_KHR, any));
            }
            if let Some(intersection) = group.intersection {
                info = info
                    .ty(vk::RayTracingShaderGroupTypeKHR::PROCEDURAL_HIT_GROUP)
                    .intersection_shader(stages.add(vk::ShaderStageFlags::INTERSECTION_KHR, intersection));
            }
            groups.push(info);
        }
        let layout = Layout::new(context, &name, STAGES, shaders.push_bytes)?;
        let modules = stages
            .list
            .iter()
            .map(|(_, entry)| Module::new(context, entry, shaders.geometry))
            .collect::<Result<Vec<_>, _>>()?;
        let specialized = Specialized::new(shaders.constants);
        let specialization = specialized.info();
        let infos: Vec<_> = stages
            .list
            .iter()
            .zip(&modules)
            .map(|((stage, _), module)| module.stage(*stage, &specialization))
            .collect();
        let mut unchecked = unchecked(context);
        let mut info = vk::RayTracingPipelineCreateInfoKHR::default()
            .stages(&infos)
            .groups(&groups)
            .max_pipeline_ray_recursion_depth(shaders.recursion_depth)
            .layout(layout.raw());
        if let Some(unchecked) = &mut unchecked {
            info = info.push_next(unchecked);
        }
        let info = [info];
        let functions = &context.tracing()?.pipeline;
        let made = context.call("vkCreateRayTracingPipelinesKHR", &name, |_| {
            let none = vk::DeferredOperationKHR::null();
            // SAFETY: modules and layout are alive; on failure no pipeline has been made, as there is only one.
            unsafe { functions.create_ray_tracing_pipelines(none, context.pipeline_cache(), &info, None) }
                .map_err(|(_, result)| result)
                .map(|made| made.first().copied().unwrap_or_default())
        });
        let mut pipeline = Self {
            name,
            layout,
            handle: made?,
            handles: Vec::new(),
            misses: shaders.misses.len(),
            hits: shaders.groups.len(),
        };
        context.name_object(pipeline.handle, &pipeline.name);
        let size = groups.len() * context.info().rt().handle_size as usize;
        pipeline.handles = context.call("vkGetRayTracingShaderGroupHandlesKHR", &pipeline.name, |_| {
            // SAFETY: the pipeline has so many groups.
            unsafe { functions.get_ray_tracing_shader_group_handles(pipeline.handle, 0, groups.len() as u32, size) }
        })?;
        Ok(pipeline)
    }

    /// Its name for messages.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What it takes.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Handle of a group: raygen is 0, then come the misses and the hit groups.
    fn group_handle(&self, group: usize) -> &[u8] {
        let size = self.layout.context().info().rt().handle_size as usize;
        &self.handles[group * size..(group + 1) * size]
    }

    pub(super) fn raw(&self) -> vk::Pipeline {
        self.handle
    }

    pub(super) fn raygen_handle(&self) -> &[u8] {
        self.group_handle(0)
    }

    pub(super) fn miss_handles(&self) -> impl Iterator<Item = &[u8]> {
        (0..self.misses).map(|miss| self.group_handle(1 + miss))
    }

    /// Handle of a hit group, if there is one of this number.
    pub(super) fn hit_handle(&self, group: usize) -> Option<&[u8]> {
        (group < self.hits).then(|| self.group_handle(1 + self.misses + group))
    }
}

impl Drop for TracePipeline {
    fn drop(&mut self) {
        if !self.layout.context().is_hung() {
            // SAFETY: submissions borrow their pipeline until they are waited for.
            unsafe { self.layout.context().raw().destroy_pipeline(self.handle, None) };
        }
    }
}

impl<'a> Recorder<'a> {
    /// Runs raygen for `extent` invocations (at least one each way), with push constants.
    ///
    /// # Errors
    /// Objects of another context; a table of another pipeline; push constants of the wrong size.
    pub fn trace<P: Pod>(
        &mut self,
        pipeline: &'a TracePipeline,
        table: &'a ShaderTable,
        set: &'a BufferSet,
        push: &P,
        extent: [u32; 3],
    ) -> Result<(), VulkanError> {
        let layout = pipeline.layout();
        self.own(layout.context(), pipeline.name())?;
        self.own(set.context(), pipeline.name())?;
        self.own(table.context(), pipeline.name())?;
        if !table.is_of(pipeline) {
            let what = String::from("the shader binding table of another pipeline");
            return Err(VulkanError::OtherDevice { what, device: pipeline.name().to_owned() });
        }
        let push = bytemuck::bytes_of(push);
        check_range("push constants", 0, push.len() as u64, u64::from(layout.push_bytes()))?;
        let context = self.context().clone();
        let (device, commands) = (context.raw(), self.raw());
        let point = vk::PipelineBindPoint::RAY_TRACING_KHR;
        let [raygen, miss, hit] = table.regions();
        // SAFETY: pipeline, table and set live for 'a, the set's buffers as long as the set; all layouts have the same
        // bindings; the push constants fit; the table was made for this pipeline, with handles of existing groups only.
        unsafe {
            device.cmd_bind_pipeline(commands, point, pipeline.handle);
            device.cmd_bind_descriptor_sets(commands, point, layout.raw(), 0, &[set.handle()], &[]);
            device.cmd_push_constants(commands, layout.raw(), layout.stages(), 0, push);
            context.tracing()?.pipeline.cmd_trace_rays(
                commands,
                raygen,
                miss,
                hit,
                &vk::StridedDeviceAddressRegionKHR::default(),
                extent[0].max(1),
                extent[1].max(1),
                extent[2].max(1),
            );
        }
        Ok(())
    }
}
