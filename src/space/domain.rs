//! The faces of all cells in one list, for walking.

use super::{FaceId, Space, deck::integers::Lattice};
use crate::geometry::{Geometry, GeometryId, Isometry, Visitor, visit};
use glam::DVec4;
use std::ops::Range;

/// Faces with their pairings, and where each cell's faces are in the list.
#[derive(Clone, Debug)]
pub struct Domain {
    /// All faces of all cells.
    pub faces: Vec<DomainFace>,
    /// Faces of each cell.
    pub cells: Vec<Range<usize>>,
    /// Deck element behind each face, `elements × faces` ([`super::deck`]); empty if nobody asks for labels.
    pub labels: Vec<u32>,
    /// The pairings in whole numbers, where they have them.
    pub lattice: Option<Lattice>,
}

/// A face in the list.
#[derive(Clone, Copy, Debug)]
pub struct DomainFace {
    /// `(n, d)`, inside `n·c + d ≤ 0`.
    pub plane: DVec4,
    /// The pairing.
    pub pairing: Isometry,
    /// The pairing as [`Geometry::cross`] wants it.
    pub folded: Isometry,
    /// Cell behind the face.
    pub cell: usize,
    /// Index of the partner in the list.
    pub partner: usize,
    /// Its name in the space.
    pub id: FaceId,
}

impl Domain {
    /// The faces of `space`, without labels.
    pub fn new(space: &Space) -> Self {
        let mut cells = Vec::with_capacity(space.cells.len());
        let mut next = 0;
        for cell in &space.cells {
            cells.push(next..next + cell.faces.len());
            next += cell.faces.len();
        }
        let faces: Vec<DomainFace> = space
            .faces()
            .map(|(id, face)| DomainFace {
                plane: face.plane,
                pairing: face.pairing,
                folded: fold(space.geometry, face.plane, &face.pairing),
                cell: face.partner.cell,
                partner: cells[face.partner.cell].start + face.partner.face,
                id,
            })
            .collect();
        let lattice = visit(space.geometry, FindLattice(&faces));
        Self { faces, cells, labels: Vec::new(), lattice }
    }
}

struct FindLattice<'a>(&'a [DomainFace]);

impl Visitor for FindLattice<'_> {
    type Output = Option<Lattice>;
    fn visit<G: Geometry>(self, geometry: G) -> Self::Output {
        Lattice::new(geometry, self.0)
    }
}

fn fold(id: GeometryId, plane: DVec4, pairing: &Isometry) -> Isometry {
    struct Fold<'a>(DVec4, &'a Isometry);
    impl Visitor for Fold<'_> {
        type Output = Isometry;
        fn visit<G: Geometry>(self, geometry: G) -> Isometry {
            geometry.fold(self.0, self.1)
        }
    }
    visit(id, Fold(plane, pairing))
}
