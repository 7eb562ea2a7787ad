//! Meshes in the charts of the cells: at rest in the space, and as triangles of each copy that reaches into a cell.

pub use super::embed::Placed;
use super::{
    embed::embed,
    place::{Copy, TOUCHING, all_beyond_one_face, beyond_one_face},
};
use crate::{
    geometry::{Geodesic, Geometry, exponential},
    render::bvh::halve,
    scene::{Mesh, Vertex},
    shader_io::TriangleShading,
    space::{domain::Domain, observer::Frame},
};
use glam::{DAffine3, DVec3};
use rayon::prelude::*;
use std::ops::Range;

/// A triangle of a mesh at rest.
#[derive(Clone, Copy, Debug)]
pub struct RestTriangle {
    /// Indices of the corners.
    pub corners: [u32; 3],
    /// Texture coordinates at the corners.
    pub uv: [[f32; 2]; 3],
    /// Index of the material.
    pub material: u32,
}

/// Triangles in a row that show the same material.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Part {
    /// Index of the material.
    pub material: u32,
    /// The triangles.
    pub triangles: Range<usize>,
}

/// A mesh put into the space by the exponential map at a frame, or a surface divided into triangles there. Isometries
/// carry it from there.
#[derive(Clone, Debug)]
pub struct RestMesh {
    /// Index of the scene's object.
    pub object: u32,
    /// The frame.
    pub frame: Frame,
    /// Vertices.
    pub vertices: Vec<Placed>,
    /// Triangles, those of one material in a row.
    pub triangles: Vec<RestTriangle>,
}

impl RestMesh {
    /// Places a mesh, with its lengths multiplied by `scale`. `material` replaces the mesh's own.
    pub fn new<G: Geometry>(
        geometry: G,
        mesh: &Mesh,
        object: u32,
        frame: Frame,
        scale: f64,
        material: Option<usize>,
    ) -> Self {
        let map = |x: DVec3| exponential(geometry, frame.point, frame.vector(x));
        let place = |vertex: &Vertex| {
            let position = vertex.position * scale;
            embed(geometry, map, position, vertex.normal, 1e-5 * position.length().max(1e-3))
        };
        let vertices = mesh.vertices.par_iter().map(place).collect();
        let triangles = mesh
            .triangles
            .iter()
            .map(|(corners, own)| RestTriangle {
                corners: *corners,
                uv: corners.map(|i| mesh.vertices[i as usize].uv),
                material: material.unwrap_or(*own) as u32,
            })
            .collect();
        // Where the mesh has its vertices itself: objects with the same mesh share structures, triangle by triangle.
        Self::assembled(object, frame, vertices, triangles, |vertex| mesh.vertices[vertex].position)
    }

    /// A mesh of vertices and triangles that are in the chart.
    pub fn in_chart<G: Geometry>(
        geometry: G,
        object: u32,
        frame: Frame,
        vertices: Vec<Placed>,
        triangles: Vec<RestTriangle>,
    ) -> Self {
        let chart: Vec<DVec3> = vertices.iter().map(|vertex| geometry.chart(vertex.point)).collect();
        Self::assembled(object, frame, vertices, triangles, |vertex| chart[vertex])
    }

    /// A mesh of these vertices and triangles, which are put in order: those of one material in a row, and each row
    /// [halved](halve) by where the vertices are.
    fn assembled(
        object: u32,
        frame: Frame,
        vertices: Vec<Placed>,
        mut triangles: Vec<RestTriangle>,
        position: impl Fn(usize) -> DVec3,
    ) -> Self {
        let centre = |t: &RestTriangle| t.corners.iter().map(|&vertex| position(vertex as usize)).sum();
        halve(&mut triangles, |t| t.material, centre);
        Self { object, frame, vertices, triangles }
    }

    /// Runs of one material.
    pub fn parts(&self) -> Vec<Part> {
        parts(self.triangles.iter().map(|t| t.material), 0)
    }
}

fn parts(materials: impl Iterator<Item = u32>, first: usize) -> Vec<Part> {
    let mut parts: Vec<Part> = Vec::new();
    for (index, material) in materials.enumerate() {
        let at = first + index;
        match parts.last_mut() {
            Some(part) if part.material == material => part.triangles.end = at + 1,
            _ => parts.push(Part { material, triangles: at..at + 1 }),
        }
    }
    parts
}

/// A copy of a mesh in a cell.
#[derive(Clone, Debug)]
pub struct MeshCopy {
    /// The cell.
    pub cell: usize,
    /// Its triangles among [`Meshes::triangles`], by material.
    pub parts: Vec<Part>,
    /// The copy of which this one is an affine image, triangle by triangle, and the map of the chart. Such copies can
    /// share an acceleration structure. Only where isometries act on the chart by affine maps.
    pub image_of: Option<(usize, DAffine3)>,
}

impl MeshCopy {
    /// Number of its triangles.
    pub fn len(&self) -> usize {
        self.parts.iter().map(|part| part.triangles.len()).sum()
    }

    /// Whether it has no triangle.
    pub fn is_empty(&self) -> bool {
        self.parts.is_empty()
    }
}

/// Triangles of all cells.
#[derive(Clone, Debug, Default)]
pub struct Meshes {
    /// The copies.
    pub copies: Vec<MeshCopy>,
    /// Corners in the chart.
    pub triangles: Vec<[DVec3; 3]>,
    /// Shading data of the triangles.
    pub shading: Vec<TriangleShading>,
}

impl Meshes {
    /// Adds a copy. Where isometries act on the chart by affine maps it keeps all triangles, so that copies can be
    /// images of one another; elsewhere those outside of the cell are dropped, so copies cost no more than the mesh.
    pub fn add<G: Geometry>(
        &mut self,
        geometry: G,
        domain: &Domain,
        rest: &RestMesh,
        copy: &Copy,
        image_of: Option<(usize, DAffine3)>,
    ) {
        let affine = geometry.chart_action(&copy.isometry).is_some();
        let moved: Vec<Placed> = rest
            .vertices
            .par_iter()
            .map(|p| {
                let g = geometry.apply(&copy.isometry, Geodesic { point: p.point, velocity: p.normal });
                Placed { point: g.point, normal: g.velocity }
            })
            .collect();
        let first = self.triangles.len();
        for triangle in &rest.triangles {
            let corners = triangle.corners.map(|i| moved[i as usize]);
            if !affine && all_beyond_one_face(geometry, domain, copy.cell, &corners.map(|c| c.point)) {
                continue;
            }
            let [conormal_a, conormal_b, conormal_c] =
                corners.map(|c| geometry.lower(c.point, c.normal).as_vec3().to_array());
            let [uv_a, uv_b, uv_c] = triangle.uv;
            self.triangles.push(corners.map(|c| geometry.chart(c.point)));
            self.shading.push(TriangleShading {
                conormal_a,
                conormal_b,
                conormal_c,
                uv_a,
                uv_b,
                uv_c,
                material: triangle.material,
                object: rest.object,
            });
        }
        let parts = parts(self.shading[first..].iter().map(|s| s.material), first);
        self.copies.push(MeshCopy { cell: copy.cell, parts, image_of });
    }

    /// Triangles of a cell that are not altogether outside of it.
    pub fn inside(&self, domain: &Domain, cell: usize) -> Vec<u32> {
        let copies = self.copies.iter().filter(|copy| copy.cell == cell);
        let triangles = copies.flat_map(|copy| copy.parts.iter().flat_map(|part| part.triangles.clone()));
        let outside = |index: usize| {
            let corners = self.triangles[index];
            beyond_one_face(domain, cell, |plane| corners.iter().all(|c| plane.dot(c.extend(1.0)) > TOUCHING))
        };
        triangles.filter(|index| !outside(*index)).map(|index| index as u32).collect()
    }
}
