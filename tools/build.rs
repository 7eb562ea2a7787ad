//! Build script: compiles every entry point with every geometry to SPIR-V and embeds scenes and meshes.

use std::{env, fmt::Write as _, fs, path::Path};

// Shared by path, so that the list of geometries and the structures exist once.
#[path = "../src/geometry/registry.rs"]
#[allow(unused_macros, unused_imports)]
mod registry;
#[path = "shader_compiler.rs"]
mod shader_compiler;
#[path = "../src/shader_io.rs"]
#[allow(dead_code)]
mod shader_io;

macro_rules! modules {
    ($(($type:ident, $module:ident, $name:literal, [$($alias:literal),*], $title:literal),)*) => {
        const GEOMETRY_MODULES: &[&str] = &[$(stringify!($module)),*];
    };
}
registry::geometries!(modules);

/// Entry points of `shaders/entry`.
const ENTRIES: &[&str] = &[
    "path.comp",
    "probe.comp",
    "place.comp",
    "walk.comp",
    "resolve.comp",
    "raygen.rgen",
    "raygen_reorder.rgen",
    "raygen_clock.rgen",
    "path_clock.comp",
    "transport.rmiss",
    "piece.rmiss",
    "recursive.rmiss",
    "shadow.rmiss",
    "triangle.rchit",
    "triangle.rint",
    "quadric.rchit",
    "quadric.rint",
    "mask.rahit",
];

fn main() {
    if let Err(message) = build() {
        eprintln!("{message}");
        std::process::exit(1);
    }
}

fn build() -> Result<(), String> {
    let out = env::var("OUT_DIR").map_err(|e| e.to_string())?;
    let out = Path::new(&out);
    for watched in [
        "shaders",
        "scenes",
        "src/shader_io.rs",
        "src/shader_io",
        "src/geometry/registry.rs",
        "tools/build.rs",
        "tools/shader_compiler.rs",
    ] {
        println!("cargo::rerun-if-changed={watched}");
    }
    let io = shader_io::glsl();
    write(&out.join("io.glsl"), io.as_bytes())?;

    let mut table = String::from("&[\n");
    for entry in ENTRIES {
        for module in GEOMETRY_MODULES {
            let compiler =
                shader_compiler::Compiler { root: Path::new("shaders"), generated: &[("shared/io.glsl", &io)] };
            let spirv = compiler.compile(entry, module)?;
            let file = out.join(format!("{entry}.{module}.spv"));
            let bytes: Vec<u8> = spirv.iter().flat_map(|word| word.to_le_bytes()).collect();
            write(&file, &bytes)?;
            writeln!(table, "    ({entry:?}, {module:?}, include_bytes!({:?})),", file).map_err(|e| e.to_string())?;
        }
    }
    write(&out.join("shaders.rs"), (table + "]").as_bytes())?;

    // Shipped scenes and meshes, by their path under scenes/.
    let mut assets = Vec::new();
    list_files(Path::new("scenes"), &mut assets)?;
    assets.sort();
    let mut table = String::from("&[\n");
    let here = env::var("CARGO_MANIFEST_DIR").map_err(|e| e.to_string())?;
    for asset in &assets {
        let name = asset.strip_prefix("scenes/").unwrap_or(asset);
        writeln!(table, "    ({name:?}, include_bytes!({:?})),", format!("{here}/{asset}"))
            .map_err(|e| e.to_string())?;
    }
    write(&out.join("assets.rs"), (table + "]").as_bytes())
}

fn write(path: &Path, bytes: &[u8]) -> Result<(), String> {
    fs::write(path, bytes).map_err(|e| format!("{}: {e}", path.display()))
}

fn list_files(folder: &Path, found: &mut Vec<String>) -> Result<(), String> {
    let entries = fs::read_dir(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    for entry in entries {
        let path = entry.map_err(|e| e.to_string())?.path();
        if path.ends_with("gallery") {
            // Pictures for readers of the repository; the program does not need them.
        } else if path.is_dir() {
            list_files(&path, found)?;
        } else if let Some(path) = path.to_str() {
            found.push(path.to_owned());
        }
    }
    Ok(())
}
