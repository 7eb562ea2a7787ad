//! Meshes from glTF: numbers that are read, and the words with which malformed files are refused.

use crate::scene::png_header;
use base64::{Engine as _, engine::general_purpose::STANDARD};
use glam::{DQuat, DVec3};
use holonomy::scene::{
    Wrap,
    folder::Folder,
    gltf::{self, Loaded, MAX_VERTICES},
    shipped,
};
use proptest::prelude::*;
use serde_json::{Value, json};
use std::fs;

/// A document under construction: JSON, and the bytes of its only buffer.
struct Document {
    json: Value,
    bytes: Vec<u8>,
}

const U8: u32 = 5121;
const U16: u32 = 5123;
const U32: u32 = 5125;
const F32: u32 = 5126;

impl Document {
    /// One node with one primitive of these positions.
    fn new(positions: &[[f32; 3]]) -> Self {
        let json = json!({
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}], "meshes": [{"primitives": [{"attributes": {}}]}],
            "accessors": [], "bufferViews": [], "buffers": [{"byteLength": 0}],
        });
        let mut document = Self { json, bytes: Vec::new() };
        let accessor = document.floats("VEC3", &positions.concat(), positions.len());
        document.json["accessors"][accessor]["min"] = json!([-9, -9, -9]);
        document.json["accessors"][accessor]["max"] = json!([9, 9, 9]);
        document.primitive()["attributes"]["POSITION"] = json!(accessor);
        document
    }

    /// A right triangle in the plane z = 0, seen from +z.
    fn triangle() -> Self {
        Self::new(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    }

    fn primitive(&mut self) -> &mut Value {
        &mut self.json["meshes"][0]["primitives"][0]
    }

    /// Appends a view, and returns its index.
    fn view(&mut self, bytes: &[u8]) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let view = json!({"buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len()});
        self.bytes.extend(bytes);
        self.json["buffers"][0]["byteLength"] = json!(self.bytes.len());
        push(&mut self.json["bufferViews"], view)
    }

    fn accessor(&mut self, kind: &str, component: u32, count: usize, bytes: &[u8]) -> usize {
        let view = self.view(bytes);
        let accessor = json!({"bufferView": view, "componentType": component, "count": count, "type": kind});
        push(&mut self.json["accessors"], accessor)
    }

    fn floats(&mut self, kind: &str, numbers: &[f32], count: usize) -> usize {
        let bytes: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
        self.accessor(kind, F32, count, &bytes)
    }

    fn indices(mut self, component: u32, count: usize, bytes: &[u8]) -> Self {
        let accessor = self.accessor("SCALAR", component, count, bytes);
        self.primitive()["indices"] = json!(accessor);
        self
    }

    fn attribute(mut self, name: &str, kind: &str, numbers: &[f32], count: usize) -> Self {
        let accessor = self.floats(kind, numbers, count);
        self.primitive()["attributes"][name] = json!(accessor);
        self
    }

    /// The same with a member of the JSON replaced.
    fn with(mut self, pointer: &str, value: Value) -> Self {
        let (parent, key) = pointer.rsplit_once('/').expect("a pointer");
        let parent = self.json.pointer_mut(parent).expect("a parent");
        match key.parse::<usize>() {
            Ok(index) if parent.is_array() => parent[index] = value,
            _ => parent[key] = value,
        }
        self
    }

    fn glb(&self) -> Vec<u8> {
        let mut json = self.json.to_string().into_bytes();
        json.resize(json.len().next_multiple_of(4), b' ');
        let mut bin = self.bytes.clone();
        bin.resize(bin.len().next_multiple_of(4), 0);
        let mut glb = b"glTF\x02\0\0\0".to_vec();
        glb.extend((28 + json.len() as u32 + bin.len() as u32).to_le_bytes());
        for (kind, chunk) in [(b"JSON", json), (b"BIN\0", bin)] {
            glb.extend((chunk.len() as u32).to_le_bytes());
            glb.extend(kind);
            glb.extend(chunk);
        }
        glb
    }

    fn load(&self) -> Loaded {
        load(&self.glb()).unwrap_or_else(|e| panic!("{e}"))
    }

    fn refuse(&self) -> String {
        refuse(&self.glb())
    }
}

fn push(array: &mut Value, value: Value) -> usize {
    let array = array.as_array_mut().expect("an array");
    array.push(value);
    array.len() - 1
}

fn load(bytes: &[u8]) -> Result<Loaded, gltf::GltfError> {
    gltf::parse(&Folder::Embedded, "my.glb", bytes, 0, &[])
}

fn refuse(bytes: &[u8]) -> String {
    load(bytes).expect_err("a refusal").to_string()
}

fn corners(loaded: &Loaded) -> Vec<[u32; 3]> {
    loaded.mesh.triangles.iter().map(|(corners, _)| *corners).collect()
}

fn le16(indices: &[u16]) -> Vec<u8> {
    indices.iter().flat_map(|i| i.to_le_bytes()).collect()
}

const SQUARE: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]];
const UP: [f32; 12] = [0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0];

#[test]
fn positions_normals_and_coordinates_are_read() {
    let document = Document::triangle()
        .attribute("NORMAL", "VEC3", &[0.0, 0.6, 0.8, 0.0, 0.0, 2.0, 1.0, 0.0, 0.0], 3)
        .attribute("TEXCOORD_0", "VEC2", &[0.0, 0.25, 0.5, 0.75, -1.0, 2.0], 3);
    let loaded = document.load();
    assert_eq!(corners(&loaded), [[0, 1, 2]]);
    let vertices = &loaded.mesh.vertices;
    assert_eq!(vertices[1].position, DVec3::X);
    assert!((vertices[0].normal - DVec3::new(0.0, 0.6, 0.8)).length() < 1e-7);
    assert_eq!(vertices[1].normal, DVec3::Z, "normals are made unit");
    assert_eq!(vertices[2].uv, [-1.0, 2.0]);
}

#[test]
fn missing_normals_are_flat_and_missing_coordinates_zero() {
    // Two triangles that share an edge get six vertices.
    let loaded = Document::new(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
        .indices(U8, 6, &[0, 1, 2, 0, 2, 3])
        .load();
    assert_eq!(corners(&loaded), [[0, 1, 2], [3, 4, 5]]);
    assert!(loaded.mesh.vertices[..3].iter().all(|v| v.normal == DVec3::Z && v.uv == [0.0; 2]));
    assert!(loaded.mesh.vertices[3..].iter().all(|v| v.normal == DVec3::X));
}

#[test]
fn zero_normals_are_mended() {
    let loaded = Document::triangle().attribute("NORMAL", "VEC3", &[0.0; 9], 3).load();
    assert!(loaded.mesh.vertices.iter().all(|v| v.normal == DVec3::Z));
}

#[test]
fn indices_of_all_widths_agree() {
    let document = || Document::new(&SQUARE).attribute("NORMAL", "VEC3", &UP, 4);
    let wide: Vec<u8> = [3_u32, 0, 1].iter().flat_map(|i| i.to_le_bytes()).collect();
    for loaded in [
        document().indices(U8, 3, &[3, 0, 1]),
        document().indices(U16, 3, &le16(&[3, 0, 1])),
        document().indices(U32, 3, &wide),
    ] {
        assert_eq!(corners(&loaded.load()), [[3, 0, 1]]);
    }
}

#[test]
fn strips_and_fans_keep_their_orientation() {
    let strip =
        Document::new(&SQUARE).attribute("NORMAL", "VEC3", &UP, 4).with("/meshes/0/primitives/0/mode", json!(5));
    assert_eq!(corners(&strip.load()), [[0, 1, 2], [1, 3, 2]]);
    let fan = Document::new(&SQUARE)
        .attribute("NORMAL", "VEC3", &UP, 4)
        .indices(U8, 4, &[0, 1, 3, 2])
        .with("/meshes/0/primitives/0/mode", json!(6));
    assert_eq!(corners(&fan.load()), [[1, 3, 0], [3, 2, 0]]);
    for mode in [5, 6] {
        let square =
            [SQUARE[0], SQUARE[1], SQUARE[if mode == 5 { 2 } else { 3 }], SQUARE[if mode == 5 { 3 } else { 2 }]];
        let flat = Document::new(&square).with("/meshes/0/primitives/0/mode", json!(mode)).load();
        assert!(flat.mesh.vertices.iter().all(|v| v.normal == DVec3::Z), "mode {mode}");
    }
    // Repeated indices stitch strips together; the triangles between them have no area.
    let stitched = Document::new(&SQUARE)
        .attribute("NORMAL", "VEC3", &UP, 4)
        .indices(U8, 5, &[0, 1, 2, 2, 3])
        .with("/meshes/0/primitives/0/mode", json!(5));
    assert_eq!(corners(&stitched.load()), [[0, 1, 2]]);
}

#[test]
fn strides_and_offsets_are_followed() {
    // Positions and normals interleaved, with four bytes in front.
    let mut document = Document::triangle();
    let mut bytes = vec![0xff; 4];
    for (x, y) in [(0.0_f32, 0.0_f32), (2.0, 0.0), (0.0, 2.0)] {
        bytes.extend([x, y, 5.0, 0.0, 0.0, -1.0].iter().flat_map(|n| n.to_le_bytes()));
    }
    let view = document.view(&bytes);
    document.json["bufferViews"][view]["byteStride"] = json!(24);
    for (name, offset) in [("POSITION", 4), ("NORMAL", 16)] {
        let accessor = json!({"bufferView": view, "byteOffset": offset, "componentType": F32, "count": 3, "type": "VEC3",
            "min": [0, 0, 5], "max": [2, 2, 5]});
        let index = push(&mut document.json["accessors"], accessor);
        document.primitive()["attributes"][name] = json!(index);
    }
    let loaded = document.load();
    assert_eq!(loaded.mesh.vertices[2].position, DVec3::new(0.0, 2.0, 5.0));
    assert!(loaded.mesh.vertices.iter().all(|v| v.normal == DVec3::NEG_Z));
}

#[test]
fn normalised_coordinates_are_scaled() {
    let mut document = Document::triangle();
    let accessor = document.accessor("VEC2", U16, 3, &le16(&[0, 65535, 13107, 0, 0, 0]));
    document.json["accessors"][accessor]["normalized"] = json!(true);
    document.primitive()["attributes"]["TEXCOORD_0"] = json!(accessor);
    let loaded = document.load();
    assert_eq!(loaded.mesh.vertices[0].uv, [0.0, 1.0]);
    assert!((loaded.mesh.vertices[1].uv[0] - 0.2).abs() < 1e-6);
}

#[test]
fn node_transforms_are_applied() {
    // Translation after rotation after scale, below a parent that moves by (10, 0, 0).
    let half = 0.5_f64.sqrt();
    let document = Document::triangle().with(
        "/nodes",
        json!([
            {"children": [1], "translation": [10, 0, 0]},
            {"mesh": 0, "translation": [0, 0, 3], "rotation": [0, 0, half, half], "scale": [2, 1, 1]},
        ]),
    );
    let loaded = document.load();
    let expected = [DVec3::new(10.0, 0.0, 3.0), DVec3::new(10.0, 2.0, 3.0), DVec3::new(9.0, 0.0, 3.0)];
    for (vertex, expected) in loaded.mesh.vertices.iter().zip(expected) {
        assert!((vertex.position - expected).length() < 1e-6, "{} is not {expected}", vertex.position);
    }
}

#[test]
fn node_matrices_agree_with_their_factors() {
    let rotation = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 0.7).as_quat();
    let (scale, translation) = (glam::Vec3::new(0.5, -2.0, 3.0), glam::Vec3::new(4.0, 5.0, -6.0));
    let matrix = glam::Mat4::from_scale_rotation_translation(scale, rotation, translation);
    let factors = Document::triangle().with(
        "/nodes/0",
        json!({"mesh": 0, "scale": scale.to_array(), "rotation": rotation.to_array(), "translation": translation.to_array()}),
    );
    let whole = Document::triangle().with("/nodes/0", json!({"mesh": 0, "matrix": matrix.to_cols_array()}));
    let (factors, whole) = (factors.load(), whole.load());
    assert_eq!(corners(&factors), corners(&whole));
    for (a, b) in factors.mesh.vertices.iter().zip(&whole.mesh.vertices) {
        assert!((a.position - b.position).length() < 1e-5 && (a.normal - b.normal).length() < 1e-5);
    }
}

#[test]
fn normals_go_by_the_inverse_transpose() {
    // Shrinking x by 4 turns the normal of the plane x + y = const towards x.
    let document = Document::triangle()
        .attribute("NORMAL", "VEC3", &[1.0, 1.0, 0.0, 1.0, 1.0, 0.0, 1.0, 1.0, 0.0], 3)
        .with("/nodes/0", json!({"mesh": 0, "scale": [0.25, 1, 1]}));
    let normal = document.load().mesh.vertices[0].normal;
    assert!((normal - DVec3::new(4.0, 1.0, 0.0).normalize()).length() < 1e-12, "{normal}");
}

#[test]
fn mirrors_flip_the_winding() {
    let mirrored = Document::triangle().with("/nodes/0", json!({"mesh": 0, "scale": [-1, 1, 1]})).load();
    let [a, b, c] = corners(&mirrored)[0].map(|i| mirrored.mesh.vertices[i as usize].position);
    let normal = (b - a).cross(c - a);
    assert_eq!(normal, DVec3::Z, "the front stays in front");
    assert!(mirrored.mesh.vertices.iter().all(|v| v.normal == DVec3::Z));
}

#[test]
fn several_primitives_have_materials_of_their_own() {
    let mut document = Document::triangle().with("/materials", json!([
        {"name": "glow", "emissiveFactor": [1, 0.5, 0],
         "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 4}}},
        {"alphaMode": "MASK", "pbrMetallicRoughness": {"baseColorFactor": [0.1, 0.2, 0.3, 0.4], "roughnessFactor": 0.5}},
        {"alphaMode": "BLEND"},
    ]));
    let primitive = document.primitive().clone();
    let primitives: Vec<Value> = [Some(1), None, Some(0), Some(1), Some(2)]
        .into_iter()
        .map(|material| {
            let mut primitive = primitive.clone();
            if let Some(material) = material {
                primitive["material"] = json!(material);
            }
            primitive
        })
        .collect();
    document.json["meshes"][0]["primitives"] = json!(primitives);
    let loaded = gltf::parse(&Folder::Embedded, "my.glb", &document.glb(), 7, &[]).unwrap_or_else(|e| panic!("{e}"));
    let used: Vec<usize> = loaded.mesh.triangles.iter().map(|(_, material)| *material).collect();
    assert_eq!(used, [7, 8, 9, 7, 10]);
    let [mask, default, glow, blend] = &loaded.materials[..] else { panic!("{:?}", loaded.materials) };
    assert_eq!((mask.base_color, mask.alpha_cutoff, mask.roughness), ([0.1, 0.2, 0.3, 0.4], Some(0.5), 0.5));
    assert_eq!((default.base_color, default.metallic, default.roughness), ([1.0; 4], 1.0, 1.0));
    assert_eq!((glow.name.as_str(), glow.emission), ("glow", [4.0, 2.0, 0.0]));
    assert_eq!(blend.alpha_cutoff, None);
}

/// A PNG of one texel.
fn png(pixel: [u8; 4]) -> Vec<u8> {
    let mut png = std::io::Cursor::new(Vec::new());
    image::RgbaImage::from_pixel(1, 1, image::Rgba(pixel)).write_to(&mut png, image::ImageFormat::Png).expect("a PNG");
    png.into_inner()
}

/// A triangle whose material has the image as base colour, twice, and as surface texture.
fn textured(image: &[u8]) -> Document {
    let mut document = Document::triangle();
    let view = document.view(image);
    document.json["images"] = json!([{"bufferView": view, "mimeType": "image/png"}]);
    document.json["samplers"] = json!([{"wrapS": 33071, "wrapT": 33648}]);
    document.json["textures"] = json!([{"source": 0, "sampler": 0}, {"source": 0, "sampler": 0}, {"source": 0}]);
    let material = |base: usize| {
        json!({"pbrMetallicRoughness": {
            "baseColorTexture": {"index": base}, "metallicRoughnessTexture": {"index": 2}}})
    };
    document.json["materials"] = json!([material(0), material(1)]);
    let mut second = document.primitive().clone();
    document.primitive()["material"] = json!(0);
    second["material"] = json!(1);
    push(&mut document.json["meshes"][0]["primitives"], second);
    document
}

#[test]
fn textures_are_shared_and_decoded_by_use() {
    let loaded = textured(&png([188, 0, 255, 128])).load();
    assert_eq!(loaded.textures.len(), 2, "one image, two uses");
    for material in &loaded.materials {
        assert_eq!((material.base_texture, material.surface_texture), (Some(0), Some(1)));
    }
    let [srgb, linear] = [0, 1].map(|i| loaded.textures[i].texels[0].map(f32::from));
    assert!((srgb[0] - 0.502_886).abs() < 5e-4 && (srgb[3] - 128.0 / 255.0).abs() < 5e-4, "{srgb:?}");
    assert!((linear[0] - 188.0 / 255.0).abs() < 5e-4, "{linear:?}");
    assert_eq!(loaded.textures[0].wrap, [Wrap::Clamp, Wrap::Mirror]);
    assert_eq!(loaded.textures[1].wrap, [Wrap::Repeat; 2]);
}

#[test]
fn images_of_impossible_sizes_are_refused() {
    for (width, height) in [(0, 0), (100_000, 100_000)] {
        assert_eq!(
            textured(&png_header(width, height)).refuse(),
            format!("my.glb: images[0]: image of {width}x{height}: sides must be 1 to 16384")
        );
    }
    let whole = png([1, 2, 3, 4]);
    assert!(textured(&whole[..whole.len() - 20]).refuse().starts_with("my.glb: images[0]: image: "));
}

#[test]
fn data_and_files_beside_the_scene_are_read() {
    let mut document = textured(&png([255; 4]));
    let data = format!("data:application/octet-stream;base64,{}", STANDARD.encode(&document.bytes));
    document.json["buffers"][0]["uri"] = json!(data);
    let embedded = load(document.json.to_string().as_bytes()).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(embedded.mesh.vertices.len(), 6);

    let folder = tempfile::tempdir().expect("a folder");
    fs::create_dir(folder.path().join("sub")).expect("a folder");
    fs::write(folder.path().join("sub/a buffer.bin"), &document.bytes).expect("a buffer");
    fs::write(folder.path().join("image.png"), png([255; 4])).expect("an image");
    document.json["buffers"][0]["uri"] = json!("a%20buffer.bin");
    document.json["images"][0] = json!({"uri": "../image.png"});
    fs::write(folder.path().join("sub/my.gltf"), document.json.to_string()).expect("a file");
    let disk = Folder::of(&folder.path().join("scene.toml")).expect("a folder");
    let external = gltf::read(&disk, "sub/my.gltf", 0, &[]).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(external.mesh.vertices, embedded.mesh.vertices);
    assert_eq!(external.textures, embedded.textures);

    for (uri, message) in [
        ("../../image.png", "sub/../../image.png: the path leaves the scene's folder"),
        ("/image.png", "/image.png: the path is absolute: paths are relative to the scene's folder"),
        ("%2e%2e/%2e%2e/image.png", "sub/../../image.png: the path leaves the scene's folder"),
        ("none.png", "sub/none.png: no such file"),
        ("data:image/png,xyz", "a data URI must be base64"),
    ] {
        document.json["images"][0]["uri"] = json!(uri);
        let refusal = gltf::parse(&disk, "sub/my.gltf", document.json.to_string().as_bytes(), 0, &[]);
        assert_eq!(refusal.expect_err("a refusal").to_string(), format!("sub/my.gltf: images[0].uri: {message}"));
    }
}

#[test]
fn truncated_files_are_refused_at_every_length() {
    let whole = textured(&png([255; 4])).glb();
    load(&whole).unwrap_or_else(|e| panic!("{e}"));
    for length in 0..whole.len() {
        let message = refuse(&whole[..length]);
        assert!(message.starts_with("my.glb: ") && message.lines().count() == 1, "{length}: {message}");
    }
    assert_eq!(
        refuse(&whole[..100]),
        format!("my.glb: truncated GLB: {} bytes are declared, 100 are there", whole.len())
    );
    assert_eq!(refuse(&whole[..10]), "my.glb: truncated GLB: the file ends after 10 bytes, inside a header");
    // A chunk that is longer than the file.
    let mut long = whole.clone();
    long[12..16].copy_from_slice(&u32::MAX.to_le_bytes());
    assert_eq!(
        refuse(&long),
        format!("my.glb: truncated GLB: chunk \"JSON\" has 4294967295 bytes, {} are there", whole.len() - 20)
    );
}

#[test]
fn indices_out_of_range_are_refused() {
    assert_eq!(
        Document::triangle().indices(U16, 3, &le16(&[0, 1, 7000])).refuse(),
        "my.glb: meshes[0].primitives[0].indices: index 7000 is out of range (vertices: 3)"
    );
    assert_eq!(
        Document::triangle().with("/meshes/0/primitives/0/attributes/POSITION", json!(5)).refuse(),
        "my.glb: meshes[0].primitives[0].attributes: no accessor 5 (there are 1)"
    );
    assert_eq!(
        Document::triangle().with("/nodes/0/mesh", json!(9)).refuse(),
        "my.glb: nodes[0].mesh: index out of bounds"
    );
}

#[test]
fn accessors_out_of_bounds_are_refused() {
    assert_eq!(
        Document::triangle().with("/accessors/0/count", json!(4)).refuse(),
        "my.glb: accessors[0]: 4 elements from byte 0 do not fit into bufferViews[0] (36 bytes)"
    );
    for count in [u64::MAX, u64::MAX / 12, 1 << 40] {
        assert_eq!(
            Document::triangle().with("/accessors/0/count", json!(count)).refuse(),
            format!("my.glb: accessors[0]: {count} elements from byte 0 do not fit into bufferViews[0] (36 bytes)")
        );
    }
    assert_eq!(
        Document::triangle().with("/accessors/0/byteOffset", json!(u64::MAX)).refuse(),
        format!("my.glb: accessors[0]: 3 elements from byte {} do not fit into bufferViews[0] (36 bytes)", u64::MAX)
    );
    assert_eq!(
        Document::triangle().with("/bufferViews/0/byteLength", json!(1000)).refuse(),
        "my.glb: bufferViews[0]: 1000 bytes from 0 do not fit into the buffer (36 bytes)"
    );
    assert_eq!(
        Document::triangle().with("/buffers/0/byteLength", json!(1000)).refuse(),
        "my.glb: buffers[0].byteLength: 1000 bytes are declared, 36 are there"
    );
    assert_eq!(
        Document::triangle().with("/accessors/0/count", json!(0)).refuse(),
        "my.glb: accessors[0]: count: 0 elements"
    );
    assert_eq!(
        Document::triangle().with("/accessors/0/componentType", json!(U16)).refuse(),
        "my.glb: meshes[0].primitives[0].attributes.POSITION: \
         an accessor of type Vec3 and componentType U16 has no meaning here"
    );
}

#[test]
fn absurd_counts_are_refused_before_they_cost_anything() {
    // Thousands of nodes that show the same mesh.
    let positions = vec![[0.0, 1.0, 2.0]; 3 * 4096];
    let nodes: Vec<Value> = (0..2000).map(|_| json!({"mesh": 0})).collect();
    let indices: Vec<usize> = (0..2000).collect();
    let message = Document::new(&positions)
        .attribute("NORMAL", "VEC3", &vec![1.0; 9 * 4096], 3 * 4096)
        .with("/nodes", json!(nodes))
        .with("/scenes/0/nodes", json!(indices))
        .refuse();
    assert!(message.ends_with(&format!("vertices, at most {MAX_VERTICES} are allowed")), "{message}");
}

#[test]
fn numbers_that_are_not_finite_are_refused() {
    for bad in [f32::NAN, f32::INFINITY] {
        assert_eq!(
            Document::new(&[[0.0; 3], [0.0, bad, 0.0], [1.0; 3]]).refuse(),
            "my.glb: meshes[0].primitives[0].attributes.POSITION: element 1 is not finite"
        );
        assert_eq!(
            Document::triangle()
                .attribute("NORMAL", "VEC3", &[0.0, 0.0, 1.0, bad, 0.0, 0.0, 0.0, 0.0, 1.0], 3)
                .refuse(),
            "my.glb: meshes[0].primitives[0].attributes.NORMAL: element 1 is not finite"
        );
        assert_eq!(
            Document::triangle().attribute("TEXCOORD_0", "VEC2", &[0.0, 0.0, 0.0, 0.0, 0.0, bad], 3).refuse(),
            "my.glb: meshes[0].primitives[0].attributes.TEXCOORD_0: element 2 is not finite"
        );
    }
    assert_eq!(
        Document::triangle().with("/nodes/0/rotation", json!([0, 0, 0, 0])).refuse(),
        "my.glb: nodes[0].rotation: a quaternion of length 0, expected 1"
    );
}

#[test]
fn nodes_that_form_a_cycle_are_refused() {
    let document = Document::triangle().with("/nodes", json!([{"mesh": 0, "children": [1]}, {"children": [0]}]));
    assert_eq!(document.refuse(), "my.glb: nodes[0]: the node is reached twice: nodes must form a tree");
}

#[test]
fn attributes_of_unequal_length_are_refused() {
    assert_eq!(
        Document::triangle().attribute("NORMAL", "VEC3", &[0.0, 0.0, 1.0], 1).refuse(),
        "my.glb: meshes[0].primitives[0].attributes.NORMAL: 1 elements for 3 vertices"
    );
}

#[test]
fn required_extensions_are_refused() {
    let message = Document::triangle().with("/extensionsRequired", json!(["KHR_draco_mesh_compression"])).refuse();
    assert_eq!(message, "my.glb: extensionsRequired[0] = \"KHR_draco_mesh_compression\": unsupported extension");
}

#[test]
fn files_without_triangles_are_refused() {
    assert_eq!(refuse(b"hello"), "my.glb: JSON: expected value at line 1 column 1");
    assert_eq!(
        Document::triangle().with("/meshes/0/primitives/0/mode", json!(1)).refuse(),
        "my.glb: no triangles in the scene"
    );
    assert_eq!(
        Document::triangle().with("/scenes", json!([])).with("/scene", Value::Null).refuse(),
        "my.glb: scenes: the file has no scene"
    );
}

#[test]
fn custom_attributes_are_passed_over() {
    Document::triangle().attribute("_TEMPERATURE", "SCALAR", &[1.0, 2.0, 3.0], 3).load();
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn spoiled_bytes_never_panic(changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6)) {
        let mut glb = textured(&png([10, 20, 30, 40])).indices(U16, 3, &le16(&[2, 1, 0])).glb();
        for (at, byte) in changes {
            let at = at.index(glb.len());
            glb[at] = byte;
        }
        if let Err(e) = load(&glb) {
            prop_assert!(e.to_string().starts_with("my.glb: "));
        }
    }

    /// Any number in the JSON replaced by another: bytes alone seldom keep it well formed.
    #[test]
    fn spoiled_numbers_never_panic(
        which in any::<prop::sample::Index>(),
        number in prop_oneof![
            Just(json!(0)), Just(json!(1)), Just(json!(-1)), Just(json!(3)), Just(json!(65536)), Just(json!(u32::MAX)),
            Just(json!(u64::MAX)), Just(json!(1e39)), Just(json!(0.5)), Just(Value::Null), Just(json!([])), Just(json!("x")),
        ],
    ) {
        let mut document = textured(&png([10, 20, 30, 40])).indices(U16, 3, &le16(&[2, 1, 0]));
        let count = numbers(&mut document.json).len();
        **numbers(&mut document.json).get_mut(which.index(count)).expect("a number") = number;
        let _ = load(&document.glb());
    }

    #[test]
    fn arbitrary_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..100)) {
        prop_assert!(load(&bytes).is_err());
        let glb: Vec<u8> = b"glTF\x02\0\0\0".iter().copied().chain(bytes).collect();
        prop_assert!(load(&glb).is_err());
    }

    /// Images, which a decoder reads that is not ours.
    #[test]
    fn spoiled_images_never_panic(
        jpeg in any::<bool>(),
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
    ) {
        let format = if jpeg { image::ImageFormat::Jpeg } else { image::ImageFormat::Png };
        let mut bytes = std::io::Cursor::new(Vec::new());
        let picture = image::RgbImage::from_fn(9, 7, |x, y| image::Rgb([x as u8 * 20, y as u8 * 30, 99]));
        picture.write_to(&mut bytes, format).expect("an image");
        let mut bytes = bytes.into_inner();
        for (at, byte) in changes {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        let _ = textured(&bytes).glb();
        let _ = load(&textured(&bytes).glb());
    }
}

fn numbers(value: &mut Value) -> Vec<&mut Value> {
    match value {
        Value::Number(_) => vec![value],
        Value::Array(array) => array.iter_mut().flat_map(numbers).collect(),
        Value::Object(object) => object.values_mut().flat_map(numbers).collect(),
        _ => Vec::new(),
    }
}

#[test]
fn shipped_meshes_are_what_they_say() {
    let leaf = load(shipped::asset("meshes/leaf.glb").expect("a mesh")).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(leaf.materials[0].alpha_cutoff, Some(0.5));
    assert_eq!(leaf.textures[0].wrap, [Wrap::Repeat, Wrap::Clamp]);
    let knot = load(shipped::asset("meshes/knot.glb").expect("a mesh")).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(knot.mesh.triangles.len(), 301_056 / 3);
    for name in ["head", "left-hand", "right-hand", "knot-small"] {
        let bytes = shipped::asset(&format!("meshes/{name}.glb")).expect("a mesh");
        let mesh = load(bytes).unwrap_or_else(|e| panic!("{e}")).mesh;
        assert!(mesh.vertices.iter().all(|v| v.position.length() < 1.01 && (v.normal.length() - 1.0).abs() < 1e-9));
    }
}
