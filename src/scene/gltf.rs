//! Meshes from glTF 2.0: `.glb`, and `.gltf` with embedded or external buffers and images.
//!
//! Read are the default scene's nodes with their transforms, triangles (lists, strips and fans, with or without
//! indices), positions, normals, the texture coordinates that the base colour texture names, and materials of the
//! metallic-roughness model. Where normals are missing they are flat, as the specification asks. `alphaMode`
//! `BLEND` is treated as `OPAQUE`: there is no order in which a ray could blend. Points and lines, skins, morph
//! targets, animations, cameras, lights, vertex colours, normal, occlusion and emission textures are passed over;
//! sparse accessors and required extensions are refused.
//!
//! Files are untrusted: nothing is read or allocated before its declared size has been compared with the size of
//! what is there, and the work is bounded by [`MAX_VERTICES`] and [`MAX_TRIANGLES`]. The crate `gltf` gives the
//! JSON's structure; its iterators are not used because they trust what it says.

use super::{
    Material, Mesh, Texture, Vertex, Wrap,
    accessor::{self, Elements, Use},
    folder::Folder,
    glb, normals,
    reader::one_line,
    texture::{Encoding, decode, texels},
};
use glam::{DMat3, DMat4, DQuat, DVec3};
use gltf::json::{
    self,
    accessor::{ComponentType, Type},
    material::AlphaMode,
    mesh::{Mode, Primitive, Semantic},
    texture::WrappingMode,
    validation::{Checked, Validate},
};
use std::{borrow::Cow, collections::HashMap};

/// Largest number of vertices of a mesh.
pub const MAX_VERTICES: usize = 1 << 23;

/// Largest number of triangles of a mesh.
pub const MAX_TRIANGLES: usize = 1 << 24;

/// Why a glTF file was refused, with its JSON path.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{file}: {place}{}{message}", if place.is_empty() { "" } else { ": " })]
pub struct GltfError {
    /// The file, as the scene names it.
    pub file: String,
    /// JSON path, empty for the file as a whole.
    pub place: String,
    /// What is wrong.
    pub message: String,
}

/// A mesh that was read, with what it shows.
#[derive(Clone, Debug, PartialEq)]
pub struct Loaded {
    /// The mesh; its materials are indices into [`Loaded::materials`] plus the number of those that were there.
    pub mesh: Mesh,
    /// Materials to be appended to the scene's.
    pub materials: Vec<Material>,
    /// Textures to be appended to the scene's.
    pub textures: Vec<Texture>,
}

/// Reads a file of the scene's folder. `materials` is the number of materials that the scene has already, and
/// `textures` are its textures: indices in the result count on from them.
///
/// # Errors
/// [`GltfError`] with file and JSON path, for anything from a missing file to a number that is not finite.
pub fn read(folder: &Folder, file: &str, materials: usize, textures: &[Texture]) -> Result<Loaded, GltfError> {
    let bytes = folder.read(file).map_err(|e| {
        let message = e.to_string();
        error(file, "", message.strip_prefix(&format!("{file}: ")).unwrap_or(&message))
    })?;
    parse(folder, file, &bytes, materials, textures)
}

/// Reads a file from its bytes; see [`read`].
///
/// # Errors
/// As [`read`].
pub fn parse(
    folder: &Folder,
    file: &str,
    bytes: &[u8],
    materials: usize,
    textures: &[Texture],
) -> Result<Loaded, GltfError> {
    let (root, blob) = open(file, bytes)?;
    let opened = Opened { file, root };
    let buffers = accessor::load_buffers(&opened, blob, folder)?;
    let mesh = Mesh { name: file.to_owned(), vertices: Vec::new(), triangles: Vec::new() };
    let loaded = Loaded { mesh, materials: Vec::new(), textures: Vec::new() };
    let mut reader = Reader {
        opened,
        folder,
        buffers,
        first_material: materials,
        present: textures,
        loaded,
        material_of: HashMap::new(),
        texture_of: HashMap::new(),
    };
    reader.scene()?;
    if reader.loaded.mesh.triangles.is_empty() {
        return Err(reader.opened.error("", "no triangles in the scene"));
    }
    Ok(reader.loaded)
}

/// The checked JSON of a file.
pub(super) struct Opened<'a> {
    pub file: &'a str,
    pub root: json::Root,
}

impl Opened<'_> {
    /// An error at a JSON path.
    pub fn error(&self, place: impl Into<String>, message: impl Into<String>) -> GltfError {
        error(self.file, place, message)
    }
}

pub(super) fn error(file: &str, place: impl Into<String>, message: impl Into<String>) -> GltfError {
    GltfError { file: one_line(file), place: one_line(&place.into()), message: one_line(&message.into()) }
}

/// Splits a GLB, parses the JSON and checks all references in it.
fn open<'a>(file: &str, bytes: &'a [u8]) -> Result<(json::Root, Option<&'a [u8]>), GltfError> {
    let (text, blob) = if bytes.starts_with(b"glTF") { glb::split(file, bytes)? } else { (bytes, None) };
    let root = json::Root::from_slice(text).map_err(|e| error(file, "", format!("JSON: {e}")))?;
    // The validation below follows these without a look.
    for (m, mesh) in root.meshes.iter().enumerate() {
        for (p, primitive) in mesh.primitives.iter().enumerate() {
            let count = root.accessors.len();
            if let Some(index) = primitive.attributes.values().find(|index| index.value() >= count) {
                let message = format!("no accessor {} (there are {count})", index.value());
                return Err(error(file, format!("meshes[{m}].primitives[{p}].attributes"), message));
            }
        }
    }
    let mut first = None;
    root.validate(&root, json::Path::new, &mut |path, problem| {
        first.get_or_insert_with(|| error(file, path().to_string(), problem.to_string().to_lowercase()));
    });
    match first {
        Some(problem) => Err(problem),
        None => Ok((root, blob)),
    }
}

const FLOATS: &[ComponentType] = &[ComponentType::F32];
const VECTOR: Use = Use { kind: Type::Vec3, components: FLOATS };
const COORDINATES: Use =
    Use { kind: Type::Vec2, components: &[ComponentType::F32, ComponentType::U8, ComponentType::U16] };
const INDEX: Use = Use { kind: Type::Scalar, components: &[ComponentType::U8, ComponentType::U16, ComponentType::U32] };

struct Reader<'a> {
    opened: Opened<'a>,
    folder: &'a Folder,
    buffers: Vec<Cow<'a, [u8]>>,
    first_material: usize,
    present: &'a [Texture],
    loaded: Loaded,
    /// glTF material (none: the default one) to scene material.
    material_of: HashMap<Option<usize>, usize>,
    /// glTF image with its use to scene texture.
    texture_of: HashMap<(usize, Encoding, [Wrap; 2]), usize>,
}

impl Reader<'_> {
    /// Walks the nodes of the default scene.
    fn scene(&mut self) -> Result<(), GltfError> {
        let root = &self.opened.root;
        let scene = root.scene.map_or(0, |scene| scene.value());
        let nodes = root.scenes.get(scene).ok_or_else(|| self.opened.error("scenes", "the file has no scene"))?;
        let mut seen = vec![false; root.nodes.len()];
        let mut open: Vec<(usize, DMat4)> = nodes.nodes.iter().rev().map(|n| (n.value(), DMat4::IDENTITY)).collect();
        while let Some((index, parent)) = open.pop() {
            let place = format!("nodes[{index}]");
            match seen.get_mut(index) {
                None => return Err(self.opened.error(place, "no such node")),
                Some(seen) if *seen => {
                    return Err(self.opened.error(place, "the node is reached twice: nodes must form a tree"));
                }
                Some(seen) => *seen = true,
            }
            let node = &self.opened.root.nodes[index];
            let world_from_node = parent * self.local_transform(&place, node)?;
            if !world_from_node.is_finite() {
                return Err(self.opened.error(place, "the transform is not finite"));
            }
            open.extend(node.children.iter().flatten().rev().map(|child| (child.value(), world_from_node)));
            if let Some(mesh) = node.mesh {
                let mesh = mesh.value();
                let count = self.opened.root.meshes.get(mesh).map_or(0, |mesh| mesh.primitives.len());
                for primitive in 0..count {
                    self.primitive(mesh, primitive, world_from_node)?;
                }
            }
        }
        Ok(())
    }

    fn local_transform(&self, place: &str, node: &json::Node) -> Result<DMat4, GltfError> {
        if let Some(matrix) = node.matrix {
            return Ok(DMat4::from_cols_array(&matrix.map(f64::from)));
        }
        let scale = node.scale.map_or(DVec3::ONE, |s| DVec3::from(s.map(f64::from)));
        let translation = node.translation.map_or(DVec3::ZERO, |t| DVec3::from(t.map(f64::from)));
        let rotation = node.rotation.map_or(DQuat::IDENTITY, |q| DQuat::from_array(q.0.map(f64::from)));
        let length = rotation.length();
        if length.is_nan() || (length - 1.0).abs() > 1e-3 {
            let message = format!("a quaternion of length {length}, expected 1");
            return Err(self.opened.error(format!("{place}.rotation"), message));
        }
        Ok(DMat4::from_scale_rotation_translation(scale, rotation.normalize(), translation))
    }

    fn primitive(&mut self, mesh: usize, index: usize, world_from_node: DMat4) -> Result<(), GltfError> {
        let opened = &self.opened;
        let place = format!("meshes[{mesh}].primitives[{index}]");
        let primitive = &opened.root.meshes[mesh].primitives[index];
        let Checked::Valid(mode) = primitive.mode else {
            return Err(opened.error(format!("{place}.mode"), "unknown mode"));
        };
        if !matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
            return Ok(());
        }
        let corners = self.corners(&place, primitive, mode)?;
        let mut triangles = self.triangles(&place, primitive, mode)?;
        let count = corners.vertices.len();
        self.check_room(&place, count, triangles.len())?;
        if world_from_node.determinant() < 0.0 {
            triangles.iter_mut().for_each(|corners| corners.swap(1, 2));
        }

        let mut vertices = corners.vertices;
        let cofactors = normals::cofactors(DMat3::from_mat4(world_from_node));
        for (i, vertex) in vertices.iter_mut().enumerate() {
            vertex.position = world_from_node.transform_point3(vertex.position);
            vertex.normal = (cofactors * vertex.normal).normalize_or_zero();
            if !vertex.position.is_finite() {
                return Err(self.opened.error(&place, format!("vertex {i} is not finite after the node's transform")));
            }
        }
        if corners.has_normals {
            normals::mend(&mut vertices, &triangles);
        } else {
            self.check_room(&place, 3 * triangles.len(), triangles.len())?;
            (vertices, triangles) = normals::flat(&vertices, &triangles);
        }

        let material = self.material(self.opened.root.meshes[mesh].primitives[index].material.map(|m| m.value()))?;
        let mesh = &mut self.loaded.mesh;
        // `check_room` keeps all indices below MAX_VERTICES.
        let first = mesh.vertices.len() as u32;
        mesh.triangles.extend(triangles.iter().map(|t| (t.map(|corner| corner + first), material)));
        mesh.vertices.append(&mut vertices);
        Ok(())
    }

    /// Vertices of a primitive in its own space.
    fn corners(&self, place: &str, primitive: &Primitive, mode: Mode) -> Result<Corners, GltfError> {
        let opened = &self.opened;
        let attribute = |semantic: Semantic, usage| -> Result<Option<(Elements<'_>, String)>, GltfError> {
            let place = format!("{place}.attributes.{}", semantic.to_string());
            let Some(index) = primitive.attributes.get(&Checked::Valid(semantic)) else { return Ok(None) };
            Ok(Some((accessor::elements(opened, &self.buffers, index.value(), &place, usage)?, place)))
        };
        let vector = |(elements, place): &(Elements<'_>, String), i: usize| {
            let v = DVec3::new(elements.number(i, 0), elements.number(i, 1), elements.number(i, 2));
            if v.is_finite() { Ok(v) } else { Err(opened.error(place, format!("element {i} is not finite"))) }
        };
        let missing = || opened.error(place, "no attribute POSITION");
        let positions = attribute(Semantic::Positions, VECTOR)?.ok_or_else(missing)?;
        let normals = attribute(Semantic::Normals, VECTOR)?;
        let uvs = attribute(Semantic::TexCoords(self.texture_set(primitive)), COORDINATES)?;
        let count = positions.0.count;
        for (elements, place) in normals.iter().chain(&uvs) {
            if elements.count != count {
                let message = format!("{} elements for {count} vertices", elements.count);
                return Err(opened.error(place, message));
            }
        }
        // Before the vertices are allocated; `mode` matters for the triangles only.
        let triangles = if mode == Mode::Triangles { count / 3 } else { count };
        self.check_room(place, count, if primitive.indices.is_some() { 0 } else { triangles })?;

        let mut vertices = Vec::with_capacity(count);
        for i in 0..count {
            let normal = normals.as_ref().map_or(Ok(DVec3::ZERO), |n| vector(n, i))?;
            let uv = uvs.as_ref().map_or([0.0; 2], |(elements, _)| [0, 1].map(|c| elements.number(i, c) as f32));
            if !uv.iter().all(|x| x.is_finite()) {
                let place = uvs.as_ref().map_or("", |(_, place)| place);
                return Err(opened.error(place, format!("element {i} is not finite")));
            }
            vertices.push(Vertex { position: vector(&positions, i)?, normal, uv });
        }
        Ok(Corners { vertices, has_normals: normals.is_some() })
    }

    /// Triangles of a primitive as indices into its own vertices. Those with a corner twice are left out.
    fn triangles(&self, place: &str, primitive: &Primitive, mode: Mode) -> Result<Vec<[u32; 3]>, GltfError> {
        let opened = &self.opened;
        let positions = primitive.attributes.get(&Checked::Valid(Semantic::Positions));
        let vertices = positions.and_then(|p| opened.root.accessors.get(p.value())).map_or(0, |a| a.count.0);
        let place = format!("{place}.indices");
        let indices = match primitive.indices {
            Some(index) => Some(accessor::elements(opened, &self.buffers, index.value(), &place, INDEX)?),
            None => None,
        };
        let count = indices.map_or(vertices as usize, |indices| indices.count);
        let triangles = if mode == Mode::Triangles { count / 3 } else { count.saturating_sub(2) };
        self.check_room(&place, 0, triangles)?;
        if mode == Mode::Triangles && count % 3 != 0 {
            return Err(opened.error(&place, format!("{count} corners are no whole number of triangles")));
        }
        if let Some(indices) = indices {
            for i in 0..count {
                let index = indices.number(i, 0) as u64;
                if index >= vertices {
                    let message = format!("index {index} is out of range (vertices: {vertices})");
                    return Err(opened.error(place, message));
                }
            }
        }
        let corner = |i: usize| indices.map_or(i as u32, |indices| indices.number(i, 0) as u32);
        let triangle = |t: usize| match mode {
            // Every second triangle of a strip has its corners the other way round.
            Mode::TriangleStrip => [t, t + 1 + t % 2, t + 2 - t % 2],
            Mode::TriangleFan => [t + 1, t + 2, 0],
            _ => [3 * t, 3 * t + 1, 3 * t + 2],
        };
        let distinct = |t: &[u32; 3]| t[0] != t[1] && t[1] != t[2] && t[2] != t[0];
        Ok((0..triangles).map(|t| triangle(t).map(corner)).filter(distinct).collect())
    }

    /// The set of texture coordinates that the material's textures use; the base colour's goes first.
    fn texture_set(&self, primitive: &Primitive) -> u32 {
        let material = primitive.material.and_then(|m| self.opened.root.materials.get(m.value()));
        material.map_or(0, |material| {
            let pbr = &material.pbr_metallic_roughness;
            pbr.base_color_texture.as_ref().or(pbr.metallic_roughness_texture.as_ref()).map_or(0, |info| info.tex_coord)
        })
    }

    fn check_room(&self, place: &str, vertices: usize, triangles: usize) -> Result<(), GltfError> {
        let mesh = &self.loaded.mesh;
        let total = mesh.vertices.len().saturating_add(vertices);
        if total > MAX_VERTICES {
            return Err(self.opened.error(place, format!("{total} vertices, at most {MAX_VERTICES} are allowed")));
        }
        let total = mesh.triangles.len().saturating_add(triangles);
        if total > MAX_TRIANGLES {
            return Err(self.opened.error(place, format!("{total} triangles, at most {MAX_TRIANGLES} are allowed")));
        }
        Ok(())
    }

    /// The scene's material for a glTF material. Factors outside [0, 1] are clamped.
    fn material(&mut self, index: Option<usize>) -> Result<usize, GltfError> {
        if let Some(known) = self.material_of.get(&index) {
            return Ok(*known);
        }
        let default = json::Material::default();
        let place = index.map_or("materials".to_owned(), |i| format!("materials[{i}]"));
        let source = index.and_then(|i| self.opened.root.materials.get(i)).unwrap_or(&default).clone();
        let pbr = &source.pbr_metallic_roughness;
        let strength = source.extensions.as_ref().and_then(|e| e.emissive_strength.as_ref());
        let strength = strength.map_or(1.0, |s| s.emissive_strength.0);
        let emission = source.emissive_factor.0.map(|x| (x * strength).max(0.0));
        let cutoff = source.alpha_cutoff.map_or(0.5, |cutoff| cutoff.0);
        let numbers = [pbr.metallic_factor.0, pbr.roughness_factor.0, cutoff];
        if !pbr.base_color_factor.0.iter().chain(&emission).chain(&numbers).all(|x| x.is_finite()) {
            return Err(self.opened.error(place, "a factor is not finite"));
        }
        let mut texture = |info: &Option<json::texture::Info>, encoding| {
            info.as_ref().map(|info| self.texture(info.index.value(), encoding)).transpose()
        };
        let material = Material {
            name: source.name.clone().unwrap_or(place),
            base_color: pbr.base_color_factor.0.map(|x| x.clamp(0.0, 1.0)),
            emission,
            metallic: pbr.metallic_factor.0.clamp(0.0, 1.0),
            roughness: pbr.roughness_factor.0.clamp(0.0, 1.0),
            alpha_cutoff: (source.alpha_mode == Checked::Valid(AlphaMode::Mask)).then_some(cutoff),
            base_texture: texture(&pbr.base_color_texture, Encoding::Srgb)?,
            surface_texture: texture(&pbr.metallic_roughness_texture, Encoding::Linear)?,
            coordinates: None,
        };
        let known = self.first_material + self.loaded.materials.len();
        self.loaded.materials.push(material);
        self.material_of.insert(index, known);
        Ok(known)
    }

    /// The scene's texture for a glTF texture.
    fn texture(&mut self, index: usize, encoding: Encoding) -> Result<usize, GltfError> {
        let (opened, root) = (&self.opened, &self.opened.root);
        let missing = || opened.error(format!("textures[{index}]"), "no such texture or image");
        let texture = root.textures.get(index).ok_or_else(missing)?;
        let sampler = texture.sampler.and_then(|sampler| root.samplers.get(sampler.value()));
        let wrap = sampler.map_or([Wrap::Repeat; 2], |s| [wrap(&s.wrap_s), wrap(&s.wrap_t)]);
        let key = (texture.source.value(), encoding, wrap);
        if let Some(known) = self.texture_of.get(&key) {
            return Ok(*known);
        }
        let place = format!("images[{}]", key.0);
        let image = root.images.get(key.0).ok_or_else(missing)?;
        let bytes = match (&image.uri, image.buffer_view) {
            (Some(uri), _) => accessor::load_uri(opened, &place, uri, self.folder)?,
            (None, Some(view)) => Cow::Borrowed(accessor::view(opened, &self.buffers, view.value())?),
            (None, None) => return Err(opened.error(place, "neither uri nor bufferView")),
        };
        let used = texels(self.present) + texels(&self.loaded.textures);
        let texture = decode(&bytes, encoding, wrap, used).map_err(|e| opened.error(place, e))?;
        let known = self.present.len() + self.loaded.textures.len();
        self.loaded.textures.push(texture);
        self.texture_of.insert(key, known);
        Ok(known)
    }
}

struct Corners {
    vertices: Vec<Vertex>,
    has_normals: bool,
}

fn wrap(mode: &Checked<WrappingMode>) -> Wrap {
    match mode {
        Checked::Valid(WrappingMode::ClampToEdge) => Wrap::Clamp,
        Checked::Valid(WrappingMode::MirroredRepeat) => Wrap::Mirror,
        _ => Wrap::Repeat,
    }
}
