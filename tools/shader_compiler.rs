//! GLSL to SPIR-V, for the build script.
//!
//! Includes are expanded here and not by the compiler, for two reasons: the choice of the geometry is a generated
//! include, and every message then carries the file and line of the source it comes from.

use glslang::{
    Compiler as Glslang, CompilerOptions, ShaderInput, ShaderSource, ShaderStage, SourceLanguage, SpirvVersion, Target,
    VulkanVersion,
};
use std::{collections::BTreeSet, fs, path::Path};

/// Where includes are looked up.
pub struct Compiler<'a> {
    /// The `shaders` folder.
    pub root: &'a Path,
    /// Files that exist only as text: path under the root and content.
    pub generated: &'a [(&'a str, &'a str)],
}

impl Compiler<'_> {
    /// Compiles `entry/<entry>` for the geometry in `geometry/<module>.glsl`.
    ///
    /// # Errors
    /// The compiler's own message, which starts with file and line, and the variant.
    pub fn compile(&self, entry: &str, module: &str) -> Result<Vec<u32>, String> {
        let variant = format!("{entry} with geometry {module}");
        let mut text = String::from(concat!(
            "#version 460\n",
            "#extension GL_GOOGLE_cpp_style_line_directive : require\n",
            "#extension GL_EXT_scalar_block_layout : require\n",
            "#extension GL_EXT_control_flow_attributes : require\n",
        ));
        let stage = match entry.rsplit('.').next() {
            Some("comp") => ShaderStage::Compute,
            Some("rgen") => ShaderStage::RayGeneration,
            Some("rint") => ShaderStage::Intersect,
            Some("rahit") => ShaderStage::AnyHit,
            Some("rchit") => ShaderStage::ClosestHit,
            Some("rmiss") => ShaderStage::Miss,
            _ => return Err(format!("{entry}: the file ending names no shader stage")),
        };
        if stage != ShaderStage::Compute {
            text.push_str("#extension GL_EXT_ray_tracing : require\n");
        }
        let mut seen = BTreeSet::new();
        self.expand(&format!("entry/{entry}"), module, &mut seen, &mut text)?;
        let compiler = Glslang::acquire().ok_or("glslang could not be initialised")?;
        let options = CompilerOptions {
            source_language: SourceLanguage::GLSL,
            target: Target::Vulkan { version: VulkanVersion::Vulkan1_2, spirv_version: SpirvVersion::SPIRV1_5 },
            version_profile: None,
            messages: glslang::ShaderMessage::DEFAULT,
        };
        let source = ShaderSource::from(text);
        let input = ShaderInput::new(&source, stage, &options, None, None).map_err(|e| format!("{variant}: {e:?}"))?;
        let shader = compiler.create_shader(input).map_err(|e| format!("{variant}: {e}"))?;
        let mut program = compiler.create_program();
        program.add_shader(&shader);
        program.compile(stage).map_err(|e| format!("{variant}: {e}"))
    }

    /// Appends the file with its includes, each file once. `#include "GEOMETRY"` is the variant's geometry.
    fn expand(&self, name: &str, module: &str, seen: &mut BTreeSet<String>, text: &mut String) -> Result<(), String> {
        if !seen.insert(name.to_owned()) {
            return Ok(());
        }
        let source = match self.generated.iter().find(|(path, _)| *path == name) {
            Some((_, source)) => (*source).to_owned(),
            None => fs::read_to_string(self.root.join(name)).map_err(|e| format!("shaders/{name}: {e}"))?,
        };
        text.push_str(&format!("#line 1 \"shaders/{name}\"\n"));
        for (number, line) in source.lines().enumerate() {
            if let Some(rest) = line.strip_prefix("#include \"") {
                let included = rest.trim_end().trim_end_matches('"');
                let included =
                    if included == "GEOMETRY" { format!("geometry/{module}.glsl") } else { included.to_owned() };
                self.expand(&included, module, seen, text)?;
                text.push_str(&format!("#line {} \"shaders/{name}\"\n", number + 2));
            } else {
                text.push_str(line);
                text.push('\n');
            }
        }
        Ok(())
    }
}
