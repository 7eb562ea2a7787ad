//! Embedded SPIR-V and compute pipelines.

use super::{Context, VulkanError};
use crate::{geometry::GeometryId, shader_io};
use ash::vk;
use std::sync::Arc;

/// SPIR-V of every entry with every geometry, made by the build: entry file, geometry's file stem, words in
/// little-endian bytes.
const SHADERS: &[(&str, &str, &[u8])] = include!(concat!(env!("OUT_DIR"), "/shaders.rs"));

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

/// A compute pipeline with the bindings of [`shader_io`] in descriptor set 0.
pub struct ComputePipeline {
    context: Arc<Context>,
    name: String,
    set_layout: vk::DescriptorSetLayout,
    layout: vk::PipelineLayout,
    handle: vk::Pipeline,
    push_bytes: u32,
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
        let code = spirv(shader.entry, shader.geometry)?;
        // Handles that are still null are skipped by `Drop`, which cleans up after each failure below.
        let mut pipeline = Self {
            context: context.clone(),
            name,
            set_layout: vk::DescriptorSetLayout::null(),
            layout: vk::PipelineLayout::null(),
            handle: vk::Pipeline::null(),
            push_bytes: shader.push_bytes,
        };
        let name = &pipeline.name;

        let bindings: Vec<_> = (0..shader_io::BINDINGS as u32)
            .map(|binding| {
                vk::DescriptorSetLayoutBinding::default()
                    .binding(binding)
                    .descriptor_type(vk::DescriptorType::STORAGE_BUFFER)
                    .descriptor_count(1)
                    .stage_flags(vk::ShaderStageFlags::COMPUTE)
            })
            .collect();
        let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
        // SAFETY: here and below the context is alive and the structures are complete.
        pipeline.set_layout = context
            .call("vkCreateDescriptorSetLayout", name, |d| unsafe { d.create_descriptor_set_layout(&info, None) })?;

        let set_layouts = [pipeline.set_layout];
        let push =
            [vk::PushConstantRange::default().stage_flags(vk::ShaderStageFlags::COMPUTE).size(shader.push_bytes)];
        let mut info = vk::PipelineLayoutCreateInfo::default().set_layouts(&set_layouts);
        if shader.push_bytes > 0 {
            info = info.push_constant_ranges(&push);
        }
        // SAFETY: the set layout has just been made.
        pipeline.layout =
            context.call("vkCreatePipelineLayout", name, |d| unsafe { d.create_pipeline_layout(&info, None) })?;

        let info = vk::ShaderModuleCreateInfo::default().code(&code);
        // SAFETY: the build's compiler made the code.
        let module = context.call("vkCreateShaderModule", name, |d| unsafe { d.create_shader_module(&info, None) })?;
        let entries: Vec<_> = (0..shader.constants.len() as u32)
            .map(|id| vk::SpecializationMapEntry { constant_id: id, offset: 4 * id, size: 4 })
            .collect();
        let specialization =
            vk::SpecializationInfo::default().map_entries(&entries).data(bytemuck::cast_slice(shader.constants));
        let stage = vk::PipelineShaderStageCreateInfo::default()
            .stage(vk::ShaderStageFlags::COMPUTE)
            .module(module)
            .name(c"main")
            .specialization_info(&specialization);
        let info = [vk::ComputePipelineCreateInfo::default().stage(stage).layout(pipeline.layout)];
        let made = context.call("vkCreateComputePipelines", name, |d| {
            // SAFETY: module and layout are alive; on failure no pipeline has been made, as there is only one.
            unsafe { d.create_compute_pipelines(context.pipeline_cache(), &info, None) }
                .map_err(|(_, result)| result)
                .map(|made| made.first().copied().unwrap_or_default())
        });
        // SAFETY: a module may go as soon as its pipelines are made.
        unsafe { context.raw().destroy_shader_module(module, None) };
        pipeline.handle = made?;
        context.name_object(pipeline.handle, name);
        Ok(pipeline)
    }

    /// Its name for messages.
    pub fn name(&self) -> &str {
        &self.name
    }

    pub(super) fn context(&self) -> &Arc<Context> {
        &self.context
    }

    pub(super) fn set_layout(&self) -> vk::DescriptorSetLayout {
        self.set_layout
    }

    pub(super) fn layout(&self) -> vk::PipelineLayout {
        self.layout
    }

    pub(super) fn handle(&self) -> vk::Pipeline {
        self.handle
    }

    pub(super) fn push_bytes(&self) -> u32 {
        self.push_bytes
    }
}

impl Drop for ComputePipeline {
    fn drop(&mut self) {
        if self.context.is_hung() {
            return;
        }
        let device = self.context.raw();
        // SAFETY: submissions borrow their pipeline until they are waited for; null handles are ignored.
        unsafe {
            device.destroy_pipeline(self.handle, None);
            device.destroy_pipeline_layout(self.layout, None);
            device.destroy_descriptor_set_layout(self.set_layout, None);
        }
    }
}
