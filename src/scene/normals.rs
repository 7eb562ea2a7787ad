//! Normals of triangles: transformed, mended, or made flat.

use super::Vertex;
use glam::{DMat3, DVec3};

/// The inverse transpose up to a positive factor, which exists for singular matrices too: it takes normals along.
pub(super) fn cofactors(m: DMat3) -> DMat3 {
    let cofactors = DMat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis));
    if m.determinant() < 0.0 { cofactors * -1.0 } else { cofactors }
}

/// Twice the area of a triangle times its normal.
fn area_normal(vertices: &[Vertex], triangle: &[u32; 3]) -> DVec3 {
    let [a, b, c] = triangle.map(|corner| vertices[corner as usize].position);
    (b - a).cross(c - a)
}

/// Gives vertices whose normal is zero the mean of their triangles' normals, by area.
pub(super) fn mend(vertices: &mut [Vertex], triangles: &[[u32; 3]]) {
    let broken: Vec<bool> = vertices.iter().map(|vertex| vertex.normal == DVec3::ZERO).collect();
    if !broken.contains(&true) {
        return;
    }
    for triangle in triangles {
        let normal = area_normal(vertices, triangle);
        for corner in triangle.map(|corner| corner as usize).into_iter().filter(|corner| broken[*corner]) {
            vertices[corner].normal += normal;
        }
    }
    for (vertex, _) in vertices.iter_mut().zip(broken).filter(|(_, broken)| *broken) {
        vertex.normal = vertex.normal.try_normalize().unwrap_or(DVec3::Z);
    }
}

/// Triangles with corners of their own and flat normals; those without an area are left out.
pub(super) fn flat(vertices: &[Vertex], triangles: &[[u32; 3]]) -> (Vec<Vertex>, Vec<[u32; 3]>) {
    let mut own = Vec::new();
    for triangle in triangles {
        if let Some(normal) = area_normal(vertices, triangle).try_normalize() {
            own.extend(triangle.map(|corner| Vertex { normal, ..vertices[corner as usize] }));
        }
    }
    let triangles = (0..own.len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    (own, triangles)
}
