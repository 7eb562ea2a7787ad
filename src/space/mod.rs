//! Spaces: cells with their faces glued in pairs.
//!
//! [`catalogue`] computes the named spaces from formulas, [`gluing`] reads them from files, [`polyhedron`] finds
//! vertices and edges of a cell in the chart, [`domain`] lists faces for walking, [`walk`] takes geodesics through
//! them by their own flow, [`stepped`] by an integrator, [`reduce`] brings points back into their cell, [`deck`]
//! enumerates deck transformations, [`check`] proves that a gluing closes up, [`observer`] moves frames, [`body`] places
//! eyes and hands of somebody with a headset.

pub mod body;
pub mod catalogue;
pub mod check;
pub mod deck;
pub mod domain;
pub mod gluing;
pub mod observer;
pub mod polyhedron;
pub mod reduce;
pub mod stepped;
pub mod walk;

use crate::geometry::{GeometryId, Isometry};
use glam::DVec4;

/// A quotient of a model geometry: one or more convex cells with face pairings.
#[derive(Clone, Debug)]
pub struct Space {
    /// Catalogue name, or the gluing file's path.
    pub name: String,
    /// The model geometry.
    pub geometry: GeometryId,
    /// The cells, each in coordinates of its own.
    pub cells: Vec<Cell>,
}

/// A convex polyhedron in the chart.
#[derive(Clone, Debug)]
pub struct Cell {
    /// Its faces.
    pub faces: Vec<Face>,
}

/// A face with its pairing.
#[derive(Clone, Debug)]
pub struct Face {
    /// `(n, d)` with `n·c + d ≤ 0` inside, `c` in the chart.
    pub plane: DVec4,
    /// Takes the face onto its partner, and what lies beyond it into the partner's cell.
    pub pairing: Isometry,
    /// Cell and face on the other side.
    pub partner: FaceId,
}

/// A face of a space.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct FaceId {
    /// Index of the cell.
    pub cell: usize,
    /// Index of the face in that cell.
    pub face: usize,
}

impl Space {
    /// The face with this id.
    pub fn face(&self, id: FaceId) -> &Face {
        &self.cells[id.cell].faces[id.face]
    }

    /// All faces.
    pub fn faces(&self) -> impl Iterator<Item = (FaceId, &Face)> {
        self.cells
            .iter()
            .enumerate()
            .flat_map(|(cell, c)| c.faces.iter().enumerate().map(move |(face, f)| (FaceId { cell, face }, f)))
    }
}
