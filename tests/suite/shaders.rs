//! Shared structures in the compiled modules, and the contract of the geometry files.

use holonomy::{
    geometry::{GEOMETRIES, Geometry, Visitor, visit},
    shader_io,
    vulkan::shader::{entries, spirv},
};
use naga::front::spv;
use std::{collections::BTreeMap, fs, path::Path};

/// Name, members and their offsets of all structures that a module declares. What is read by address as well as through a
/// binding is declared twice. Read from the decorations themselves (SPIR-V 1.5, sections 3.20 and 3.49), because reflection
/// libraries apply layout rules of their own.
fn declared(words: &[u32]) -> Vec<(String, Vec<(String, u32)>)> {
    const OP_NAME: u32 = 5;
    const OP_MEMBER_NAME: u32 = 6;
    const OP_MEMBER_DECORATE: u32 = 72;
    const OFFSET: u32 = 35;
    let text = |words: &[u32]| -> String {
        let bytes: Vec<u8> = words.iter().flat_map(|w| w.to_le_bytes()).take_while(|b| *b != 0).collect();
        String::from_utf8_lossy(&bytes).into_owned()
    };
    let (mut names, mut members, mut offsets) = (BTreeMap::new(), BTreeMap::new(), BTreeMap::new());
    let mut at = 5;
    while at < words.len() {
        let (length, op) = ((words[at] >> 16) as usize, words[at] & 0xffff);
        let operands = &words[at + 1..at + length];
        match op {
            OP_NAME => {
                names.insert(operands[0], text(&operands[1..]));
            }
            OP_MEMBER_NAME => {
                members.insert((operands[0], operands[1]), text(&operands[2..]));
            }
            OP_MEMBER_DECORATE if operands[2] == OFFSET => {
                offsets.insert((operands[0], operands[1]), operands[3]);
            }
            _ => {}
        }
        at += length;
    }
    let mut found: BTreeMap<u32, Vec<(String, u32)>> = BTreeMap::new();
    for ((id, member), offset) in offsets {
        found.entry(id).or_default().push((members[&(id, member)].clone(), offset));
    }
    found.into_iter().map(|(id, members)| (names.get(&id).cloned().unwrap_or_default(), members)).collect()
}

/// Disagreements of the modules of one geometry with the Rust structures; `shift` is added to each Rust offset.
fn disagreements(shift: usize) -> (usize, Vec<String>) {
    let mut wrong = Vec::new();
    let mut compared = 0;
    for entry in entries(GEOMETRIES[0].id) {
        let modules = declared(&spirv(entry, GEOMETRIES[0].id).expect("the build has it"));
        for (name, _, members) in shader_io::layouts() {
            // A structure that the entry does not use has no offsets.
            for (_, declared) in modules.iter().filter(|(declared, _)| declared == name) {
                compared += 1;
                for (member, offset) in &members {
                    let found = declared.iter().find(|(m, _)| m == member);
                    if found.is_none_or(|(_, o)| *o as usize != offset + shift) {
                        wrong.push(format!("{entry}: {name}.{member}: {found:?}, in Rust {offset}"));
                    }
                }
                if declared.len() != members.len() {
                    wrong.push(format!("{entry}: {name} has {} members, in Rust {}", declared.len(), members.len()));
                }
            }
        }
    }
    (compared, wrong)
}

#[test]
fn shaders_layout_agrees_with_rust() {
    let (compared, wrong) = disagreements(0);
    assert!(compared >= shader_io::layouts().len(), "only {compared} structures are used by the shaders");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn shaders_shifted_layout_is_caught() {
    assert!(!disagreements(4).1.is_empty());
}

/// Every module is valid in the eyes of an independent reader.
#[test]
fn shaders_modules_parse() {
    for geometry in GEOMETRIES {
        for entry in entries(geometry.id) {
            let words = spirv(entry, geometry.id).expect("the build has it");
            assert_eq!(words[0], 0x0723_0203, "{entry} for {} is no SPIR-V", geometry.name);
            let options = spv::Options { adjust_coordinate_space: false, ..Default::default() };
            // The reader knows no scalar block layout and may refuse a module for it; it must not find it malformed.
            if let Err(error) = spv::Frontend::new(words.iter().copied(), &options).parse() {
                let text = format!("{error:?}");
                let known = text.contains("Unsupported") || text.contains("Invalid");
                assert!(known && !text.contains("Incomplete"), "{entry} for {}: {text}", geometry.name);
            }
        }
    }
}

/// The trait's constant.
struct Straight;

impl Visitor for Straight {
    type Output = bool;
    fn visit<G: Geometry>(self, _geometry: G) -> bool {
        G::STRAIGHT
    }
}

/// Each geometry's GLSL file defines each function of the contract in the header of e3.glsl, with its signature.
#[test]
fn shaders_geometries_fulfil_the_contract() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders/geometry");
    // With the files that a geometry includes, which define what several share.
    let read = |module: &str| {
        let text = fs::read_to_string(folder.join(format!("{module}.glsl"))).expect("the file exists");
        let included = text
            .lines()
            .filter_map(|line| line.strip_prefix("#include \"")?.strip_suffix('"'))
            .map(|name| fs::read_to_string(folder.join("..").join(name)).expect("the included file exists"));
        included.collect::<String>() + &text
    };
    let contract: Vec<String> = read("e3")
        .lines()
        .filter_map(|line| line.strip_prefix("//   "))
        .filter(|line| line.contains("geo_") && line.contains('('))
        .map(|line| line[..=line.find(')').expect("a signature")].split_whitespace().collect::<Vec<_>>().join(" "))
        .collect();
    assert!(contract.len() >= 17, "{contract:?}");
    let constant = "const bool GEO_STRAIGHT = ";
    // Type and name with the types of the arguments; the names of arguments are free.
    let shape = |signature: &str| -> String {
        let (head, arguments) = signature.split_once('(').expect("a signature");
        let types: Vec<&str> = arguments
            .trim_end_matches(')')
            .split(',')
            .map(|a| a.trim().rsplit_once(' ').map_or("", |(kind, _)| kind))
            .collect();
        format!("{head}({})", types.join(","))
    };
    for geometry in GEOMETRIES {
        let source = read(geometry.module);
        let defined: Vec<String> = source
            .lines()
            .filter(|line| line.contains("geo_") && line.ends_with(") {") && !line.starts_with([' ', '/']))
            .map(|line| shape(line.trim_end_matches(" {")))
            .collect();
        for signature in &contract {
            assert!(defined.contains(&shape(signature)), "{} lacks {signature}", geometry.module);
        }
        assert_eq!(defined.len(), contract.len(), "{} defines more than the contract", geometry.module);
        let straight = source.lines().find_map(|line| line.strip_prefix(constant)).expect("the contract's constant");
        let wanted = visit(geometry.id, Straight).to_string() + ";";
        assert_eq!(straight, wanted, "{}: the shader's constant is not that of the trait", geometry.module);
    }
}
