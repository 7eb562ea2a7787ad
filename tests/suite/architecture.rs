//! What keeps the program in shape: the registry as data, who may import whom, where unsafe code may be.

use holonomy::geometry::{GEOMETRIES, GeometryId};
use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
};

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// All files below a folder with one of the endings, as path from the root and content.
fn files(folder: &str, endings: &[&str]) -> Vec<(String, String)> {
    fn walk(folder: &Path, endings: &[&str], found: &mut Vec<(String, String)>) {
        let mut entries: Vec<PathBuf> =
            fs::read_dir(folder).expect("a folder").map(|e| e.expect("an entry").path()).collect();
        entries.sort();
        for path in entries {
            if path.is_dir() {
                walk(&path, endings, found);
            } else if endings.iter().any(|e| path.extension().is_some_and(|x| x == *e)) {
                let name = path.strip_prefix(root()).expect("below the root").to_string_lossy().into_owned();
                found.push((name, fs::read_to_string(&path).expect("text")));
            }
        }
    }
    let mut found = Vec::new();
    walk(&root().join(folder), endings, &mut found);
    found
}

#[test]
fn registry_has_no_double_names_and_all_files() {
    let mut names = BTreeSet::new();
    for entry in GEOMETRIES {
        for name in std::iter::once(&entry.name).chain(entry.aliases) {
            assert!(names.insert(*name), "{name} is taken twice");
            assert_eq!(GeometryId::from_name(name), Some(entry.id));
        }
        assert_eq!(entry.id.entry().name, entry.name);
        assert!(root().join(format!("src/geometry/{}.rs", entry.module)).is_file());
        assert!(root().join(format!("shaders/geometry/{}.glsl", entry.module)).is_file());
    }
    for (file, _) in files("shaders/geometry", &["glsl"]) {
        let stem = Path::new(&file).file_stem().expect("a name").to_string_lossy().into_owned();
        assert!(GEOMETRIES.iter().any(|e| e.module == stem), "{file} is not registered");
    }
}

/// Words of a line of code: identifiers, without comments.
fn words(line: &str) -> impl Iterator<Item = &str> {
    let code = line.split("//").next().unwrap_or("");
    code.split(|c: char| !(c.is_alphanumeric() || c == '_')).filter(|w| !w.is_empty())
}

/// No file but a geometry's own two, the registry and the catalogue of spaces knows a geometry by name. Measurements do:
/// what judges a geometry must have formulas of its own for it, and nothing that draws reads them.
#[test]
fn geometry_names_stay_in_their_files() {
    let free = [
        "src/geometry/",
        "shaders/geometry/",
        "src/space/catalogue",
        "src/measure/reference/",
        "src/measure/stability/",
    ];
    let mut strays = Vec::new();
    for (file, text) in files("src", &["rs"]).into_iter().chain(files("shaders", &["glsl", "comp"])) {
        if free.iter().any(|f| file.starts_with(f)) {
            continue;
        }
        for (number, line) in text.lines().enumerate() {
            let named = words(line).any(|w| GEOMETRIES.iter().any(|e| w.eq_ignore_ascii_case(e.module)));
            if named {
                strays.push(format!("{file}:{}: {}", number + 1, line.trim()));
            }
        }
    }
    assert!(strays.is_empty(), "{}", strays.join("\n"));
}

/// Lower layers do not import higher ones.
#[test]
fn layers_import_downwards_only() {
    let layers: [(&str, &[&str]); 8] = [
        ("geometry", &["shader_io"]),
        ("integrate", &["geometry"]),
        ("space", &["geometry", "integrate", "shader_io"]),
        ("scene", &["geometry", "integrate", "space", "shader_io"]),
        ("vulkan", &["geometry", "shader_io"]),
        ("render", &["geometry", "integrate", "space", "scene", "vulkan", "shader_io"]),
        ("view", &["geometry", "space", "scene", "render", "vulkan", "shader_io"]),
        ("measure", &["geometry", "integrate", "space", "scene", "render", "vulkan", "shader_io"]),
    ];
    let all = ["geometry", "integrate", "space", "scene", "vulkan", "render", "view", "cli", "measure"];
    let mut strays = Vec::new();
    for (layer, below) in layers {
        for (file, text) in files(&format!("src/{layer}"), &["rs"]) {
            // Paths after `crate::`, also inside the braces of `use crate::{...}`.
            let flat: String = text.lines().map(|l| l.split("//").next().unwrap_or("")).collect::<Vec<_>>().join(" ");
            for module in all.iter().filter(|m| **m != layer && !below.contains(m)) {
                let direct = flat.contains(&format!("crate::{module}"));
                let grouped = flat.split("use crate::{").skip(1).any(|rest| {
                    let group = rest.split(';').next().unwrap_or("");
                    let mut depth = 0;
                    group.split_inclusive(['{', '}', ',']).any(|piece| {
                        let at_top = depth == 0;
                        depth += piece.matches('{').count() as i32 - piece.matches('}').count() as i32;
                        at_top && piece.trim().starts_with(module)
                    })
                });
                if direct || grouped {
                    strays.push(format!("{file} imports {module}"));
                }
            }
        }
    }
    assert!(strays.is_empty(), "{}", strays.join("\n"));
}

/// Unsafe code only where Vulkan and OpenXR are called, each block with its reason.
#[test]
fn unsafe_code_stays_at_the_drivers() {
    let allowed = ["src/vulkan/", "src/render/compute/", "src/view/xr/"];
    let mut strays = Vec::new();
    for (file, text) in files("src", &["rs"]) {
        let lines: Vec<&str> = text.lines().collect();
        for (number, line) in lines.iter().enumerate() {
            if !words(line).any(|w| w == "unsafe") {
                continue;
            }
            if !allowed.iter().any(|a| file.starts_with(a)) {
                strays.push(format!("{file}:{}: unsafe code", number + 1));
            }
            // A declaration (unsafe fn, unsafe trait) states its conditions in its documentation.
            let is_block = line.contains("unsafe {") || line.contains("unsafe impl");
            let start = number.saturating_sub(8);
            if is_block && !lines[start..=number].iter().any(|l| l.contains("SAFETY:")) {
                strays.push(format!("{file}:{}: no SAFETY line", number + 1));
            }
        }
    }
    assert!(strays.is_empty(), "{}", strays.join("\n"));
}

/// User data must not panic: no unwrap, expect or panic in the program outside of its unit tests.
#[test]
fn program_does_not_unwrap() {
    let mut strays = Vec::new();
    for (file, text) in files("src", &["rs"]) {
        let code = text.split("#[cfg(test)]").next().unwrap_or("");
        for (number, line) in code.lines().enumerate() {
            let line = line.split("//").next().unwrap_or("");
            if [".unwrap()", ".expect(", "panic!(", "todo!(", "unimplemented!("].iter().any(|w| line.contains(w)) {
                strays.push(format!("{file}:{}: {}", number + 1, line.trim()));
            }
        }
    }
    assert!(strays.is_empty(), "{}", strays.join("\n"));
}
