//! glTF 2.0 binaries with baked textures.

use super::field::*;
use super::surface::Surface;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use serde_json::{Value, json};
use std::path::Path;

/// The colour of a picture at a place in 0..1, counted from the upper left.
pub type Texel<'a, const N: usize> = &'a dyn Fn(f64, f64) -> [f64; N];

/// A glTF file under construction: one node, one mesh, one primitive per surface.
pub struct Glb {
    pub bin: Vec<u8>,
    pub root: Value,
}

impl Glb {
    pub fn new(name: &str) -> Glb {
        let sampler = json!({"magFilter": 9729, "minFilter": 9987, "wrapS": 10497, "wrapT": 33071});
        let root = json!({
            "asset": {"version": "2.0", "generator": "Holonomy tools/meshes.rs"},
            "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0, "name": name}],
            "meshes": [{"name": name, "primitives": []}],
            "accessors": [], "bufferViews": [], "materials": [],
            "samplers": [sampler], "images": [], "textures": [],
        });
        Glb { bin: vec![], root }
    }

    /// Appends to one of the root's arrays and gives the index.
    pub fn push(&mut self, list: &str, item: Value) -> usize {
        let items = self.root[list].as_array_mut().expect("an array of the root");
        items.push(item);
        items.len() - 1
    }

    pub fn view(&mut self, bytes: &[u8], target: Option<u32>) -> usize {
        let (start, length) = (self.bin.len(), bytes.len());
        let mut view = json!({"buffer": 0, "byteOffset": start, "byteLength": length});
        if let Some(target) = target {
            view["target"] = json!(target);
        }
        self.bin.extend(bytes);
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        self.push("bufferViews", view)
    }

    pub fn floats<const N: usize>(&mut self, rows: &[[f64; N]], bounds: bool) -> usize {
        let rows: Vec<[f32; N]> = rows.iter().map(|r| r.map(|x| x as f32)).collect();
        let bytes: Vec<u8> = rows.as_flattened().iter().flat_map(|x| x.to_le_bytes()).collect();
        let kind = format!("VEC{N}");
        let mut accessor = json!({"bufferView": self.view(&bytes, Some(34962)),
            "componentType": 5126, "count": rows.len(), "type": kind});
        if bounds {
            let range = |pick: fn(f32, f32) -> f32| {
                let fold = |a: [f32; N], b: &[f32; N]| std::array::from_fn(|k| pick(a[k], b[k]));
                rows.iter().fold(rows[0], fold).to_vec()
            };
            accessor["min"] = json!(range(f32::min));
            accessor["max"] = json!(range(f32::max));
        }
        self.push("accessors", accessor)
    }

    /// Adds a primitive; indices are 16-bit where the vertices allow.
    pub fn add(&mut self, s: &Surface, material: Value) {
        let short = s.pos.len() < 0xffff;
        let indices = s.tris.iter().flatten();
        let bytes: Vec<u8> = if short {
            indices.flat_map(|&i| (i as u16).to_le_bytes()).collect()
        } else {
            indices.flat_map(|&i| (i as u32).to_le_bytes()).collect()
        };
        let view = self.view(&bytes, Some(34963));
        let kind = if short { 5123 } else { 5125 };
        let accessor = json!({"bufferView": view, "componentType": kind, "type": "SCALAR",
            "count": s.tris.len() * 3});
        let indices = self.push("accessors", accessor);
        let rows = |list: &[V]| list.iter().map(|p| p.array()).collect::<Vec<_>>();
        let position = self.floats(&rows(&s.pos), true);
        let normal = self.floats(&rows(&s.nor), false);
        let uv = self.floats(&s.uv, false);
        let material = self.push("materials", material);
        let attributes = json!({"POSITION": position, "NORMAL": normal, "TEXCOORD_0": uv});
        let primitive = json!({"attributes": attributes, "indices": indices, "material": material});
        if let Some(list) = self.root["meshes"][0]["primitives"].as_array_mut() {
            list.push(primitive);
        }
    }

    /// Bakes an sRGB picture of `size` squared with `N` channels from `texel(u, v)`.
    pub fn texture<const N: usize>(&mut self, name: &str, size: usize, texel: Texel<N>) -> Res<Value> {
        let at = |i: usize| (i as f64 + 0.5) / size as f64;
        let pixels: Vec<u8> = (0..size * size)
            .flat_map(|i| texel(at(i % size), at(i / size)))
            .map(|c| (c.clamp(0.0, 1.0) * 255.0).round() as u8)
            .collect();
        let mut png = Vec::new();
        let kinds = [ExtendedColorType::Rgb8, ExtendedColorType::Rgba8];
        PngEncoder::new_with_quality(&mut png, CompressionType::Best, FilterType::Adaptive).write_image(
            &pixels,
            size as u32,
            size as u32,
            kinds[usize::from(N == 4)],
        )?;
        let view = self.view(&png, None);
        let image = json!({"name": name, "bufferView": view, "mimeType": "image/png"});
        let image = self.push("images", image);
        let texture = json!({"name": name, "sampler": 0, "source": image});
        let texture = self.push("textures", texture);
        Ok(json!({"index": texture}))
    }

    /// Writes the file under a temporary name, then renames it.
    pub fn write(mut self, dir: &Path, name: &str) -> Res<()> {
        if let Some(root) = self.root.as_object_mut() {
            let textured = root["images"] != json!([]);
            root.retain(|k, _| textured || !matches!(k.as_str(), "images" | "textures" | "samplers"));
            root.insert("buffers".into(), json!([{"byteLength": self.bin.len()}]));
        }
        let mut text = serde_json::to_vec(&self.root)?;
        text.resize(text.len().next_multiple_of(4), b' ');
        let mut out = Vec::new();
        let total = 28 + text.len() + self.bin.len();
        for word in [0x4654_6c67, 2, total as u32, text.len() as u32, 0x4e4f_534a] {
            out.extend(u32::to_le_bytes(word));
        }
        out.extend(&text);
        for word in [self.bin.len() as u32, 0x004e_4942] {
            out.extend(u32::to_le_bytes(word));
        }
        out.extend(&self.bin);
        let temporary = dir.join(format!("{name}.tmp"));
        std::fs::write(&temporary, out)?;
        std::fs::rename(&temporary, dir.join(name))?;
        Ok(())
    }
}

/// An opaque material without a texture.
pub fn plain(name: &str, colour: [f64; 3], metallic: f64, roughness: f64) -> Value {
    let [r, g, b] = colour;
    json!({"name": name, "pbrMetallicRoughness": {"baseColorFactor": [r, g, b, 1.0],
        "metallicFactor": metallic, "roughnessFactor": roughness}})
}

/// A material without metal whose base colour is a texture.
pub fn painted(name: &str, texture: Value, roughness: f64) -> Value {
    json!({"name": name, "pbrMetallicRoughness": {"baseColorTexture": texture,
        "metallicFactor": 0.0, "roughnessFactor": roughness}})
}
