//! Embedded SPIR-V and compute pipelines.

use super::{Context, VulkanError, descriptor::Layout};
use crate::geometry::GeometryId;
use ash::vk;
use std::sync::Arc;

/// SPIR-V of every entry with every geometry, made by the build: entry file, geometry's file stem, words in
/// little-endian bytes.
const SHADERS: &[(&str, &str, &[u8])] = include!(concat!(env!("OUT_DIR"), "/shaders.rs"));

/// Entries of `shaders/entry` that the build compiled, for one geometry as for all.
pub fn entries(geometry: GeometryId) -> impl Iterator<Item = &'static str> {
    SHADERS.iter().filter(move |(_, module, _)| *module == geometry.entry().module).map(|(entry, _, _)| *entry)
}

/// The words of an entry of `shaders/entry` for a geometry.
///
/// # Errors
/// [`VulkanError::NoShader`].
pub fn spirv(entry: &str, geometry: GeometryId) -> Result<Vec<u32>, VulkanError> {
    let module = geometry.entry().module;
    let found = SHADERS.iter().find(|(e, m, _)| *e == entry && *m == module);
    let (_, _, bytes) =
        found.ok_or_else(|| VulkanError::NoShader { entry: entry.to_owned(), module: module.to_owned() })?;
    Ok(bytes.as_chunks::<4>().0.iter().map(|word| u32::from_le_bytes(*word)).collect())
}

/// A shader module; it may go as soon as its pipelines are made.
pub(super) struct Module {
    context: Arc<Context>,
    handle: vk::ShaderModule,
}

impl Module {
    /// The module of an entry for a geometry.
    pub fn new(context: &Arc<Context>, entry: &str, geometry: GeometryId) -> Result<Self, VulkanError> {
        let code = spirv(entry, geometry)?;
        let name = format!("{entry} for {}", geometry.name());
        let info = vk::ShaderModuleCreateInfo::default().code(&code);
        // SAFETY: the build's compiler made the code.
        let handle = context.call("vkCreateShaderModule", &name, |d| unsafe { d.create_shader_module(&info, None) })?;
        Ok(Self { context: context.clone(), handle })
    }

    /// The module as a stage of a pipeline.
    pub fn stage<'a>(
        &self,
        stage: vk::ShaderStageFlags,
        specialization: &'a vk::SpecializationInfo<'a>,
    ) -> vk::PipelineShaderStageCreateInfo<'a> {
        vk::PipelineShaderStageCreateInfo::default()
            .stage(stage)
            .module(self.handle)
            .name(c"main")
            .specialization_info(specialization)
    }
}

impl Drop for Module {
    fn drop(&mut self) {
        // SAFETY: nothing on the device uses modules, only the making of pipelines does.
        unsafe { self.context.raw().destroy_shader_module(self.handle, None) };
    }
}

/// Values of the specialization constants 0, 1, 2, …
pub(super) struct Specialized<'a> {
    entries: Vec<vk::SpecializationMapEntry>,
    constants: &'a [u32],
}

impl<'a> Specialized<'a> {
    pub fn new(constants: &'a [u32]) -> Self {
        let entries = (0..constants.len() as u32)
            .map(|id| vk::SpecializationMapEntry { constant_id: id, offset: 4 * id, size: 4 })
            .collect();
        Self { entries, constants }
    }

    pub fn info(&self) -> vk::SpecializationInfo<'_> {
        vk::SpecializationInfo::default().map_entries(&self.entries).data(bytemuck::cast_slice(self.constants))
    }
}

/// For pipelines, where the device takes it: accesses to buffers lie inside of them. Some drivers check each one otherwise,
/// though nothing asks them to (6 % of a frame on an NVIDIA H100, driver 580).
pub(super) fn unchecked<'a>(context: &Context) -> Option<vk::PipelineRobustnessCreateInfoEXT<'a>> {
    let off = vk::PipelineRobustnessBufferBehaviorEXT::DISABLED;
    context.info().can_leave_unchecked().then(|| {
        vk::PipelineRobustnessCreateInfoEXT::default()
            .storage_buffers(off)
            .uniform_buffers(off)
            .vertex_inputs(off)
            .images(vk::PipelineRobustnessImageBehaviorEXT::DISABLED)
    })
}

/// What a compute pipeline is made of.
#[derive(Clone, Copy, Debug)]
pub struct ComputeShader<'a> {
    /// Entry file in `shaders/entry`.
    pub entry: &'a str,
    /// Geometry compiled in.
    pub geometry: GeometryId,
    /// Values of the specialization constants 0, 1, 2, …; those beyond the end keep their defaults.
    pub constants: &'a [u32],
    /// Bytes of push constants.
    pub push_bytes: u32,
}

/// A compute pipeline.
pub struct ComputePipeline {
    name: String,
    layout: Layout,
    handle: vk::Pipeline,
}

impl std::fmt::Debug for ComputePipeline {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "ComputePipeline({})", self.name)
    }
}

impl ComputePipeline {
    /// Compiles a pipeline.
    ///
    /// # Errors
    /// Driver failures, and an entry that the build does not have.
    pub fn new(context: &Arc<Context>, shader: &ComputeShader<'_>) -> Result<Self, VulkanError> {
        let name = format!("{} for {}", shader.entry, shader.geometry.name());
        let layout = Layout::new(context, &name, vk::ShaderStageFlags::COMPUTE, shader.push_bytes)?;
        let module = Module::new(context, shader.entry, shader.geometry)?;
        let specialized = Specialized::new(shader.constants);
        let specialization = specialized.info();
        let stage = module.stage(vk::ShaderStageFlags::COMPUTE, &specialization);
        let mut unchecked = unchecked(context);
        let mut info = vk::ComputePipelineCreateInfo::default().stage(stage).layout(layout.raw());
        if let Some(unchecked) = &mut unchecked {
            info = info.push_next(unchecked);
        }
        let info = [info];
        let made = context.call("vkCreateComputePipelines", &name, |d| {
            // SAFETY: module and layout are alive; on failure no pipeline has been made, as there is only one.
            unsafe { d.create_compute_pipelines(context.pipeline_cache(), &info, None) }
                .map_err(|(_, result)| result)
                .map(|made| made.first().copied().unwrap_or_default())
        });
        let handle = made?;
        context.name_object(handle, &name);
        Ok(Self { name, layout, handle })
    }

    /// Its name for messages.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What it takes.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    pub(crate) fn raw(&self) -> vk::Pipeline {
        self.handle
    }
}

impl Drop for ComputePipeline {
    fn drop(&mut self) {
        if !self.layout.context().is_hung() {
            // SAFETY: submissions borrow their pipeline until they are waited for.
            unsafe { self.layout.context().raw().destroy_pipeline(self.handle, None) };
        }
    }
}
