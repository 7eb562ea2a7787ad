//! A [`World`] as the shaders want it: f32, one array per binding.

use crate::{
    geometry::Isometry,
    render::{plan::Feature, world::World},
    scene::{Material, Wrap},
    shader_io::{self as io, NONE, binding},
    space::domain::DomainFace,
};
use glam::{DVec3, DVec4};

/// Cosine that no angle has, for lights that are not spots.
const SHINES_EVERYWHERE: f32 = -2.0;

/// The arrays of a world. What its plan leaves out is empty.
#[derive(Debug, Default)]
pub struct Packed {
    faces: Vec<io::Face>,
    cells: Vec<io::Cell>,
    nodes: Vec<io::Node>,
    primitives: Vec<u32>,
    triangles: Vec<io::Triangle>,
    triangle_shading: Vec<io::TriangleShading>,
    quadrics: Vec<io::Quadric>,
    quadric_shading: Vec<io::QuadricShading>,
    materials: Vec<io::Material>,
    textures: Vec<io::Texture>,
    texels: Vec<[u32; 2]>,
    lights: Vec<io::Light>,
    labels: Vec<u32>,
}

impl Packed {
    /// Rounds a world to f32 and leaves out what its plan does not need.
    ///
    /// Indices are cut to 32 bits: arrays with more elements exceed every device's largest range, which the
    /// caller checks before it uploads.
    pub fn new(world: &World) -> Self {
        let uses = |feature| world.plan.uses(feature);
        let lights = uses(Feature::Lights);
        let mut packed = Self {
            faces: world.domain.faces.iter().map(face).collect(),
            nodes: world.nodes.clone(),
            primitives: world.primitives.clone(),
            materials: world.materials.iter().map(material).collect(),
            ..Self::default()
        };
        packed.cells.extend(world.cells.iter().zip(&world.domain.cells).map(|(cell, faces)| io::Cell {
            first_face: faces.start as u32,
            face_count: faces.len() as u32,
            root: cell.tree.map_or(NONE, |tree| tree.root),
            first_light: if lights { cell.lights.start as u32 } else { 0 },
            light_count: if lights { cell.lights.len() as u32 } else { 0 },
            grid_lower: cell.tree.map_or([0.0; 3], |tree| vec3(tree.grid.lower)),
            grid_scale: cell.tree.map_or([1.0; 3], |tree| vec3(tree.grid.scale)),
        }));
        if uses(Feature::Meshes) {
            packed.triangles.extend(world.triangles.iter().map(|[a, b, c]| io::Triangle {
                a: vec3(*a),
                b: vec3(*b),
                c: vec3(*c),
            }));
            packed.triangle_shading.clone_from(&world.triangle_shading);
        }
        if uses(Feature::Quadrics) {
            packed.quadrics.extend(world.quadrics.iter().map(|q| io::Quadric {
                form0: vec4(q.surface.forms[0]),
                form1: vec4(q.surface.forms[1]),
                form2: vec4(q.surface.forms[2]),
                quadratic: q.surface.quadratic as f32,
                constant: q.surface.constant as f32,
            }));
            packed.quadric_shading.extend(world.quadrics.iter().map(|q| io::QuadricShading {
                clip0: vec4(q.clip[0]),
                clip1: vec4(q.clip[1]),
                material: q.material,
                object: q.object,
            }));
        }
        if uses(Feature::Textures) {
            for texture in &world.textures {
                let [wrap_u, wrap_v] = texture.wrap.map(wrap);
                let first = packed.texels.len() as u32;
                packed.textures.push(io::Texture {
                    first,
                    width: texture.width,
                    height: texture.height,
                    wrap_u,
                    wrap_v,
                });
                // The first half lies in the low bits, as unpackHalf2x16 wants it.
                packed.texels.extend(texture.texels.iter().map(|[r, g, b, a]| {
                    [[r, g], [b, a]].map(|[low, high]| u32::from(low.to_bits()) | u32::from(high.to_bits()) << 16)
                }));
            }
        }
        if lights {
            packed.lights.extend(world.lights.iter().map(|light| io::Light {
                point: vec4(light.point),
                color: light.color,
                range: light.range as f32,
                closest: light.closest as f32,
                axis: light.spot.map_or([0.0; 4], |(axis, _)| vec4(axis)),
                spot_cosine: light.spot.map_or(SHINES_EVERYWHERE, |(_, cosine)| cosine as f32),
                shadows: u32::from(light.shadows),
            }));
        }
        if uses(Feature::Labels) {
            packed.labels.clone_from(&world.domain.labels);
        }
        packed
    }

    /// Binding, name and bytes of each array.
    pub fn parts(&self) -> [(u32, &'static str, &[u8]); 13] {
        use bytemuck::cast_slice;
        [
            (binding::faces, "faces", cast_slice(&self.faces)),
            (binding::cells, "cells", cast_slice(&self.cells)),
            (binding::nodes, "nodes", cast_slice(&self.nodes)),
            (binding::primitives, "primitives", cast_slice(&self.primitives)),
            (binding::triangles, "triangles", cast_slice(&self.triangles)),
            (binding::triangle_shading, "triangle shading", cast_slice(&self.triangle_shading)),
            (binding::quadric_surfaces, "quadrics", cast_slice(&self.quadrics)),
            (binding::quadric_shading, "quadric shading", cast_slice(&self.quadric_shading)),
            (binding::materials, "materials", cast_slice(&self.materials)),
            (binding::texture_table, "textures", cast_slice(&self.textures)),
            (binding::texels, "texels", cast_slice(&self.texels)),
            (binding::light_images, "light images", cast_slice(&self.lights)),
            (binding::label_table, "labels", cast_slice(&self.labels)),
        ]
    }
}

fn face(face: &DomainFace) -> io::Face {
    io::Face { plane: vec4(face.plane), cell: face.cell as u32, ..pairing(&face.folded) }
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
    io::Material {
        base_color: material.base_color,
        emission: material.emission,
        metallic: material.metallic,
        roughness: material.roughness,
        alpha_cutoff: material.alpha_cutoff.unwrap_or(-1.0),
        base_texture: texture(material.base_texture),
        surface_texture: texture(material.surface_texture),
    }
}

fn wrap(wrap: Wrap) -> u32 {
    match wrap {
        Wrap::Repeat => io::WRAP_REPEAT,
        Wrap::Clamp => io::WRAP_CLAMP,
        Wrap::Mirror => io::WRAP_MIRROR,
    }
}

fn vec3(v: DVec3) -> [f32; 3] {
    v.as_vec3().to_array()
}

fn vec4(v: DVec4) -> [f32; 4] {
    v.as_vec4().to_array()
}
