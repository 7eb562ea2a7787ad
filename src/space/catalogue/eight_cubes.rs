//! The whole three-sphere: the boundary of the four-dimensional cube, blown up to the sphere.
//!
//! Its eight cells are the points nearest to ±x, ±y, ±z, ±w. In coordinates in which its centre is (0, 0, 0, 1) each is
//! the cube [−1, 1]³ of the gnomonic chart, three of them fill 360° round each edge, and all pairings are turns by right
//! angles: matrices of zeros and ones.

use super::{outer, signed_axis};
use crate::{
    geometry::Isometry,
    space::{Face, FaceId},
};
use glam::{DMat4, DVec4};

/// The faces of the cells: that of (0, 0, 0, 1) first, then those of x, −x, y, −y, z, −z, and its antipode last. Faces of each:
/// x, −x, y, −y, z, −z in its own coordinates.
pub(super) fn cells() -> Vec<Vec<Face>> {
    (0..8).map(|cell| (0..6).map(|face| face_of(cell, face)).collect()).collect()
}

fn face_of(cell: usize, face: usize) -> Face {
    let normal = signed_axis(face).extend(0.0);
    let own = own_from_sphere(cell);
    // The neighbour's centre is a quarter of a great circle away, in the direction of the normal.
    let behind = index_of(own.transpose() * normal);
    let other = own_from_sphere(behind);
    let back = other * centre(cell);
    let partner = (0..6).find(|&f| signed_axis(f).extend(0.0) == back).unwrap_or(face);
    Face {
        // As far from the own centre as from the neighbour's.
        plane: (normal - DVec4::W) * std::f64::consts::FRAC_1_SQRT_2,
        pairing: Isometry::linear(other * own.transpose()),
        partner: FaceId { cell: behind, face: partner },
    }
}

fn centre(cell: usize) -> DVec4 {
    match cell {
        0 => DVec4::W,
        7 => DVec4::NEG_W,
        _ => signed_axis(cell - 1).extend(0.0),
    }
}

/// The cell with this centre.
fn index_of(point: DVec4) -> usize {
    (0..8).find(|&cell| centre(cell) == point).unwrap_or(0)
}

/// The turn that takes the centre of a cell to (0, 0, 0, 1): in their common plane, or with z for the antipode.
fn own_from_sphere(cell: usize) -> DMat4 {
    let from = centre(cell);
    if cell == 0 || cell == 7 {
        return DMat4::from_diagonal(DVec4::new(1.0, 1.0, from.w, from.w));
    }
    let still = DMat4::IDENTITY - outer(from, from) - outer(DVec4::W, DVec4::W);
    still + outer(DVec4::W, from) - outer(from, DVec4::W)
}
