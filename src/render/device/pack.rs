//! A [`World`] as the shaders want it: f32, one array per binding.

use crate::{
    geometry::Isometry,
    render::{
        bvh::{Primitive, Reference, pairs::Pair},
        plan::Feature,
        world::{World, WorldQuadric, hierarchy::Hierarchy, meshes::Meshes},
    },
    scene::{Material, Wrap, coordinate_ramp},
    shader_io::{self as io, NONE, binding},
    space::domain::DomainFace,
};
use bytemuck::cast_slice;
use glam::{DVec3, DVec4};
use std::ops::Range;

/// Cosine that no angle has, for lights that are not spots.
const SHINES_EVERYWHERE: f32 = -2.0;

/// Arrays that all pipelines read. What the plan leaves out is empty.
#[derive(Debug, Default)]
pub struct Common {
    faces: Vec<io::Face>,
    planes: [io::types::vec4; io::UNROLLED_FACES as usize],
    materials: Vec<io::Material>,
    textures: Vec<io::Texture>,
    texels: Vec<[u32; 2]>,
    lights: Vec<io::Light>,
    light_lists: Vec<u32>,
    labels: Vec<u32>,
}

/// Binding, name and bytes of an array.
pub type Array<'a> = (u32, &'static str, &'a [u8]);

impl Common {
    /// Rounds what every pipeline needs of a world to f32.
    ///
    /// Indices are cut to 32 bits: arrays with more elements exceed every device's largest range, which the
    /// caller checks before it uploads.
    pub fn new(world: &World) -> Self {
        let uses = |feature| world.plan.uses(feature);
        let mut common = Self {
            faces: world.domain.faces.iter().map(face).collect(),
            planes: planes(&world.domain.faces),
            materials: world.materials.iter().map(material).collect(),
            ..Self::default()
        };
        if uses(Feature::Textures) {
            for texture in &*world.textures {
                let [wrap_u, wrap_v] = texture.wrap.map(wrap);
                let first = common.texels.len() as u32;
                common.textures.push(io::Texture {
                    first,
                    width: texture.width,
                    height: texture.height,
                    wrap_u,
                    wrap_v,
                });
                // The first half lies in the low bits, as unpackHalf2x16 wants it.
                common.texels.extend(texture.texels.iter().map(|[r, g, b, a]| {
                    [[r, g], [b, a]].map(|[low, high]| u32::from(low.to_bits()) | u32::from(high.to_bits()) << 16)
                }));
            }
        }
        if uses(Feature::Lights) {
            common.lights.extend(world.lights.images.iter().map(|light| io::Light {
                point: vec4(light.point),
                color: light.color,
                range: light.range as f32,
                closest: light.closest as f32,
                axis: light.spot.map_or([0.0; 4], |(axis, _)| vec4(axis)),
                spot_cosine: light.spot.map_or(SHINES_EVERYWHERE, |(_, cosine)| cosine as f32),
                shadows: u32::from(light.shadows),
                ..io::Light::default()
            }));
            common.light_lists.clone_from(&world.lights.lists);
        }
        if uses(Feature::Labels) {
            common.labels.clone_from(&world.domain.labels);
        }
        common
    }

    /// The arrays.
    pub fn arrays(&self) -> [Array<'_>; 8] {
        [
            (binding::faces, "faces", cast_slice(&self.faces)),
            (binding::planes, "planes", cast_slice(&self.planes)),
            (binding::materials, "materials", cast_slice(&self.materials)),
            (binding::texture_table, "textures", cast_slice(&self.textures)),
            (binding::texels, "texels", cast_slice(&self.texels)),
            (binding::light_images, "light images", cast_slice(&self.lights)),
            (binding::light_lists, "light lists", cast_slice(&self.light_lists)),
            (binding::label_table, "labels", cast_slice(&self.labels)),
        ]
    }
}

/// The cells, with their hierarchies and the addresses of their acceleration structures: either is empty for pipelines that
/// traverse otherwise.
pub fn cells(world: &World, hierarchy: &Hierarchy, scenes: &[io::types::uvec2]) -> Vec<io::Cell> {
    let cell = |(index, faces): (usize, &Range<usize>)| {
        let lights = world.lights.grids[index];
        let tree = hierarchy.trees.get(index).copied().flatten();
        let voxels = hierarchy.voxels.grids.get(index).copied().flatten();
        io::Cell {
            first_face: faces.start as u32,
            face_count: faces.len() as u32,
            root: tree.map_or(NONE, |tree| tree.root),
            grid_lower: tree.map_or([0.0; 3], |tree| vec3(tree.grid.lower)),
            grid_scale: tree.map_or([1.0; 3], |tree| vec3(tree.grid.scale)),
            light_lower: vec3(lights.lower),
            light_scale: vec3(lights.scale),
            light_boxes: lights.boxes,
            light_lists: lights.first,
            scene: scenes.get(index).copied().unwrap_or_default(),
            voxels: voxels.map_or(NONE, |voxels| voxels.first),
        }
    };
    world.domain.cells.iter().enumerate().map(cell).collect()
}

/// Gives the root of each cell a node above it, of which it is the first and only child: where invocations that walk
/// together begin, which name a node by its parent and its place there. Nobody looks at its box.
pub fn put_nodes_above_roots(cells: &mut [io::Cell], nodes: &mut Vec<io::Node>) {
    for cell in cells.iter_mut().filter(|cell| cell.root != NONE) {
        let nothing = Reference::Nothing.word();
        let above = Reference::Node(nodes.len() as u32, 0).word();
        nodes.push(io::Node { children: [cell.root, nothing, nothing, nothing], ..io::Node::default() });
        cell.root = above;
    }
}

/// Corners of triangles.
pub fn triangles(meshes: &Meshes) -> Vec<io::Triangle> {
    meshes.triangles.iter().map(triangle).collect()
}

fn triangle([a, b, c]: &[DVec3; 3]) -> io::Triangle {
    io::Triangle { a: vec3(*a), b: vec3(*b), c: vec3(*c), ..io::Triangle::default() }
}

/// Corners of pairs of triangles and shading data of their triangles, in the order in which nodes name them, so that those of one
/// node lie side by side; the nodes name them by their places then.
pub fn pairs_in_order(
    meshes: &Meshes,
    pairs: &[Pair],
    nodes: &mut [io::Node],
) -> (Vec<io::Triangle>, Vec<io::TriangleShading>) {
    let (mut corners, mut shading) = (Vec::new(), Vec::new());
    for child in nodes.iter_mut().flat_map(|node| &mut node.children) {
        if let Reference::Primitive(Primitive::Triangle(name)) = Reference::read(*child) {
            *child = Reference::Primitive(Primitive::Triangle(2 * corners.len() as u32)).word();
            let Pair { triangles, turns } = pairs[name as usize / 2];
            let turns = turns.map(usize::from);
            let [mut first, mut second] = triangles.map(|index| meshes.triangles[index as usize]);
            first.rotate_left(turns[0]);
            second.rotate_left(turns[1]);
            let [after_a, after_b, after_c] = vec3(second[2]);
            corners.push(io::Triangle { after_a, after_b, after_c, ..triangle(&first) });
            shading.extend([0, 1].map(|i| turned(&meshes.shading[triangles[i] as usize], turns[i])));
        }
    }
    (corners, shading)
}

/// Shading data of a triangle that begins by another corner.
fn turned(shading: &io::TriangleShading, turn: usize) -> io::TriangleShading {
    let mut conormals = [shading.conormal_a, shading.conormal_b, shading.conormal_c];
    let mut uvs = [shading.uv_a, shading.uv_b, shading.uv_c];
    conormals.rotate_left(turn);
    uvs.rotate_left(turn);
    let ([conormal_a, conormal_b, conormal_c], [uv_a, uv_b, uv_c]) = (conormals, uvs);
    io::TriangleShading { conormal_a, conormal_b, conormal_c, uv_a, uv_b, uv_c, ..*shading }
}

/// The surface of a quadric.
pub fn quadric(quadric: &WorldQuadric) -> io::Quadric {
    io::Quadric {
        form0: vec4(quadric.surface.forms[0]),
        form1: vec4(quadric.surface.forms[1]),
        form2: vec4(quadric.surface.forms[2]),
        quadratic: quadric.surface.quadratic as f32,
        constant: quadric.surface.constant as f32,
        ..io::Quadric::default()
    }
}

/// What is needed of a quadric where it is hit.
pub fn quadric_shading(quadric: &WorldQuadric) -> io::QuadricShading {
    io::QuadricShading {
        clip0: vec4(quadric.clip[0]),
        clip1: vec4(quadric.clip[1]),
        material: quadric.material,
        object: quadric.object,
        ..io::QuadricShading::default()
    }
}

/// A face with its pairing.
pub fn face(face: &DomainFace) -> io::Face {
    io::Face { plane: vec4(face.plane), cell: face.cell as u32, ..pairing(&face.folded) }
}

/// Planes of the faces of an only cell; zeros and some of the planes where there are more faces.
pub fn planes(faces: &[DomainFace]) -> [io::types::vec4; io::UNROLLED_FACES as usize] {
    std::array::from_fn(|i| faces.get(i).map_or([0.0; 4], |face| vec4(face.plane)))
}

/// A face that is nothing but a pairing.
pub fn pairing(isometry: &Isometry) -> io::Face {
    io::Face {
        linear: isometry.linear.as_mat4().to_cols_array_2d(),
        shift: vec4(isometry.shift),
        ..io::Face::default()
    }
}

fn material(material: &Material) -> io::Material {
    let texture = |index: Option<usize>| index.map_or(NONE, |i| i as u32);
    let (scale, shift) = coordinate_ramp(material);
    io::Material {
        base_color: material.base_color,
        emission: material.emission,
        metallic: material.metallic,
        roughness: material.roughness,
        alpha_cutoff: material.alpha_cutoff.unwrap_or(-1.0),
        base_texture: texture(material.base_texture),
        surface_texture: texture(material.surface_texture),
        coordinate_scale: vec3(scale),
        coordinate_shift: vec3(shift),
    }
}

fn wrap(wrap: Wrap) -> u32 {
    match wrap {
        Wrap::Repeat => io::WRAP_REPEAT,
        Wrap::Clamp => io::WRAP_CLAMP,
        Wrap::Mirror => io::WRAP_MIRROR,
    }
}

/// Three floats.
pub fn vec3(v: DVec3) -> [f32; 3] {
    v.as_vec3().to_array()
}

/// Four floats.
pub fn vec4(v: DVec4) -> [f32; 4] {
    v.as_vec4().to_array()
}
