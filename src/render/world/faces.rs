//! Faces of cells, and frames along their edges. They are planes of the chart, so triangles are exact; pairings take them
//! to planes again, but may bend lines in these, and so sides are divided where geodesics are not straight.

use super::{
    WorldError,
    build::Builder,
    embed::Placed,
    meshes::{RestMesh, RestTriangle},
};
use crate::{geometry::Geometry, scene::Object, space::observer::Frame};
use glam::{DVec3, DVec4, Vec4Swizzles};

/// Pieces of each side.
const PIECES: usize = 24;

impl<G: Geometry> Builder<'_, G> {
    /// Frames along the edges of a cell's faces, `width` of the way to the centre wide; of two faces that are glued to
    /// each other the first, or `only` one face.
    pub(super) fn add_faces(
        &mut self,
        index: usize,
        object: &Object,
        cell: usize,
        width: f64,
        only: Option<usize>,
    ) -> Result<(), WorldError> {
        let Some(polyhedron) = self.polyhedra[cell].clone() else {
            return Err(WorldError::NoEdges(object.name.clone()));
        };
        let faces = polyhedron.face_vertices.len();
        if let Some(face) = only.filter(|face| *face >= faces) {
            return Err(WorldError::NoFace(object.name.clone(), face, faces.saturating_sub(1)));
        }
        let first = self.domain.cells[cell].start;
        for (face, outline) in polyhedron.face_vertices.iter().enumerate() {
            let wanted = only.map_or(first + face <= self.domain.faces[first + face].partner, |only| only == face);
            if !wanted {
                continue;
            }
            let corners: Vec<DVec3> = outline.iter().map(|&v| polyhedron.vertices[v]).collect();
            let rest = self.frame_mesh(index, object, cell, self.domain.faces[first + face].plane, &corners, width);
            let rest = rest.ok_or_else(|| WorldError::OutsideChart(object.name.clone()))?;
            self.add_divided(object, rest)?;
        }
        Ok(())
    }

    /// The triangles of a frame; `None` if a corner is not in the chart. Texture coordinates are those of a square around
    /// the face.
    fn frame_mesh(
        &self,
        index: usize,
        object: &Object,
        cell: usize,
        plane: DVec4,
        corners: &[DVec3],
        width: f64,
    ) -> Option<RestMesh> {
        let geometry = self.geometry;
        let centre = corners.iter().sum::<DVec3>() / corners.len() as f64;
        let (across, up) = plane.xyz().normalize().any_orthonormal_pair();
        let half = corners.iter().map(|c| (*c - centre).abs().max_element()).fold(0.0, f64::max) * 2.0_f64.sqrt();
        let pieces = if G::STRAIGHT { 1 } else { PIECES };
        // Rings of points, the outer one and the inner one, as many as all sides have pieces.
        let count = corners.len() * pieces;
        let outer = |i: usize| {
            let (side, step) = (i / pieces % corners.len(), i % pieces);
            corners[side].lerp(corners[(side + 1) % corners.len()], step as f64 / pieces as f64)
        };
        let (mut vertices, mut uv) = (Vec::with_capacity(2 * count), Vec::with_capacity(2 * count));
        for i in 0..count {
            for c in [outer(i), outer(i).lerp(centre, width)] {
                let point = geometry.unchart(c).filter(|p| p.is_finite())?;
                vertices.push(Placed { point, normal: geometry.raise(point, plane.xyz()) });
                let flat = [(c - centre).dot(across), (c - centre).dot(up)];
                uv.push(flat.map(|x| (0.5 + 0.5 * x / half) as f32));
            }
        }
        let material = object.material.unwrap_or(0) as u32;
        let quad = |i: usize| {
            let [a, b] = [2 * i, 2 * ((i + 1) % count)].map(|v| v as u32);
            [[a, b, b + 1], [a, b + 1, a + 1]]
        };
        // Whole faces have all inner points in the centre, and so no second triangle.
        let triangles = (0..count).flat_map(|i| quad(i).into_iter().take(if width < 1.0 { 2 } else { 1 }));
        let triangle = |corners: [u32; 3]| RestTriangle { corners, uv: corners.map(|v| uv[v as usize]), material };
        let triangles = triangles.map(triangle).collect();
        let frame = Frame { cell, point: geometry.base(), axes: geometry.frame(geometry.base()) };
        Some(RestMesh::in_chart(geometry, index as u32, frame, vertices, triangles))
    }
}
