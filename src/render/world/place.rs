//! Which deck transformations bring something of an object into a cell.

use super::WorldError;
use crate::{
    geometry::{Geometry, Isometry},
    space::{deck::Elements, domain::Domain},
};
use glam::DVec4;
use std::collections::VecDeque;

/// Copies of one object, or images of one light, that may be made. A scene that needs more is a mistake in size.
pub const MAX_COPIES: usize = 4096;

/// A way for an object to reach into a cell.
#[derive(Clone, Copy, Debug)]
pub struct Copy {
    /// The cell.
    pub cell: usize,
    /// From the object's coordinates to the cell's.
    pub isometry: Isometry,
}

/// How an object stands to the cell that a copy of it is in.
pub trait Extent<G> {
    /// Whether a part of the copy may lie inside the cell.
    fn reaches_into(&self, geometry: G, domain: &Domain, copy: &Copy) -> bool;
    /// Whether a part of the copy lies beyond this face.
    fn reaches_beyond(&self, geometry: G, domain: &Domain, copy: &Copy, face: usize) -> bool;
}

/// All copies of an object whose coordinates are those of `cell` (where its anchor lies).
///
/// # Errors
/// [`WorldError::TooManyCopies`] above [`MAX_COPIES`].
pub fn copies<G: Geometry>(
    geometry: G,
    domain: &Domain,
    cell: usize,
    extent: &impl Extent<G>,
    name: &str,
) -> Result<Vec<Copy>, WorldError> {
    let mut elements = Elements::new(geometry, cell);
    let mut found = Vec::new();
    let mut queue = VecDeque::from([0]);
    while let Some(index) = queue.pop_front() {
        let element = elements.list[index];
        let copy = Copy { cell: element.cell, isometry: element.isometry };
        if extent.reaches_into(geometry, domain, &copy) {
            found.push(copy);
        } else if index != 0 {
            continue;
        }
        for face in domain.cells[copy.cell].clone() {
            if extent.reaches_beyond(geometry, domain, &copy, face)
                && let (next, true) = elements.cross(domain, index, face)
            {
                queue.push_back(next);
            }
        }
        if found.len() > MAX_COPIES {
            return Err(WorldError::TooManyCopies(name.to_owned(), MAX_COPIES));
        }
    }
    Ok(found)
}

/// Corners of triangles, in the model.
pub struct Corners<'a> {
    /// Points.
    pub points: &'a [DVec4],
    /// Triples of indices.
    pub triangles: &'a [([u32; 3], usize)],
}

/// Whether all three points lie beyond one and the same face. `sides[i][f]`: point i against face f.
pub fn all_beyond_one_face<G: Geometry>(geometry: G, domain: &Domain, cell: usize, points: &[DVec4]) -> bool {
    domain.cells[cell].clone().any(|face| {
        let plane = domain.faces[face].plane;
        points.iter().all(|p| geometry.side(*p, plane) > TOUCHING)
    })
}

/// A copy that only touches the cell counts as reaching into it.
const TOUCHING: f64 = 1e-5;

impl<G: Geometry> Extent<G> for Corners<'_> {
    fn reaches_into(&self, geometry: G, domain: &Domain, copy: &Copy) -> bool {
        self.triangles.iter().any(|(corners, _)| {
            let points = corners.map(|i| geometry.apply(&copy.isometry, at(self.points[i as usize])).point);
            !all_beyond_one_face(geometry, domain, copy.cell, &points)
        })
    }

    fn reaches_beyond(&self, geometry: G, domain: &Domain, copy: &Copy, face: usize) -> bool {
        let plane = domain.faces[face].plane;
        let beyond = |p: &DVec4| geometry.side(geometry.apply(&copy.isometry, at(*p)).point, plane) > -TOUCHING;
        self.points.iter().any(beyond)
    }
}

/// A union of metric balls.
pub struct Balls<'a> {
    /// Centres, in the model.
    pub centres: &'a [DVec4],
    /// The radius of all.
    pub radius: f64,
}

impl Balls<'_> {
    /// For one ball: beyond the plane altogether (1), cut by it (0), or inside altogether (−1).
    fn side<G: Geometry>(&self, geometry: G, centre: DVec4, plane: DVec4) -> i32 {
        // What is not known to be apart may meet.
        let Some(ball) = geometry.ball(centre, self.radius) else { return 0 };
        // A plane touches the quadric exactly if it is on the dual quadric (inverse matrix).
        let dual = plane.dot(ball.matrix().inverse() * plane);
        if !dual.is_finite() || dual >= -1e-9 {
            0
        } else if geometry.side(centre, plane) > 0.0 {
            1
        } else {
            -1
        }
    }
}

impl<G: Geometry> Extent<G> for Balls<'_> {
    fn reaches_into(&self, geometry: G, domain: &Domain, copy: &Copy) -> bool {
        self.centres.iter().any(|centre| {
            let centre = geometry.apply(&copy.isometry, at(*centre)).point;
            domain.cells[copy.cell].clone().all(|f| self.side(geometry, centre, domain.faces[f].plane) <= 0)
        })
    }

    fn reaches_beyond(&self, geometry: G, domain: &Domain, copy: &Copy, face: usize) -> bool {
        let plane = domain.faces[face].plane;
        self.centres.iter().any(|centre| {
            let centre = geometry.apply(&copy.isometry, at(*centre)).point;
            self.side(geometry, centre, plane) >= 0
        })
    }
}

/// A point as a state, for `apply`.
fn at(point: DVec4) -> crate::geometry::Geodesic {
    crate::geometry::Geodesic { point, velocity: DVec4::ZERO }
}
