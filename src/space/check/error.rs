//! What can be wrong with a gluing.

use crate::space::FaceId;
use crate::space::polyhedron::PolyhedronError;
use glam::DVec3;

/// Why a gluing does not close.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CheckError {
    /// The planes of a cell bound no polyhedron.
    #[error("cell {cell}: {reason}")]
    Cell {
        /// The cell.
        cell: usize,
        /// Why, with the face.
        reason: PolyhedronError,
    },
    /// No cell, or one that the others do not reach.
    #[error("{0}")]
    Disconnected(String),
    /// A cell without faces.
    #[error("cell {0} has no faces: it is the whole geometry, in which nothing is glued")]
    Whole(usize),
    /// A corner of a cell is not a point of the geometry.
    #[error("{}: its corner at {corner} in the chart is at infinity or beyond", face_name(*face))]
    AtInfinity {
        /// A face with that corner.
        face: FaceId,
        /// Chart coordinates.
        corner: DVec3,
    },
    /// The partner does not exist or has another partner.
    #[error("{}: its partner, {}, {problem}", face_name(*face), face_name(*partner))]
    Partner {
        /// The face.
        face: FaceId,
        /// Its partner.
        partner: FaceId,
        /// What is wrong with it.
        problem: &'static str,
    },
    /// A pairing that does not preserve the metric.
    #[error("{}: its pairing is not an isometry (residual {residual:.3e})", face_name(*face))]
    NotAnIsometry {
        /// The face.
        face: FaceId,
        /// Deviation from the defining relation.
        residual: f64,
    },
    /// Two partners whose pairings do not undo each other.
    #[error(
        "{}: its pairing is not the inverse of that of its partner, {} (residual {residual:.3e})",
        face_name(*face),
        face_name(*partner)
    )]
    NotInverse {
        /// The face.
        face: FaceId,
        /// Its partner.
        partner: FaceId,
        /// Largest entry of the product minus the identity.
        residual: f64,
    },
    /// A pairing that takes the face somewhere else.
    #[error(
        "{}: its pairing does not take it onto its partner, {} (a corner lands {distance:.3e} away in the chart)",
        face_name(*face),
        face_name(*partner)
    )]
    NotOnto {
        /// The face.
        face: FaceId,
        /// Its partner.
        partner: FaceId,
        /// Distance of the worst corner from the partner's nearest.
        distance: f64,
    },
    /// A pairing that takes the cell itself, not what lies beyond the face, into the partner's cell.
    #[error("{}: its pairing lays the cell over that of its partner, {}", face_name(*face), face_name(*partner))]
    WrongSide {
        /// The face.
        face: FaceId,
        /// Its partner.
        partner: FaceId,
    },
    /// The cells round an edge leave a gap or overlap.
    #[error(
        "edge between faces {} and {} of cell {}: the {length} dihedral angles round it add up to {angle:.9} rad, \
         which is not 2π/n",
        faces[0], faces[1], cell
    )]
    Angle {
        /// Cell of the edge.
        cell: usize,
        /// Faces that meet in the edge.
        faces: [usize; 2],
        /// Number of wedges until the first comes again.
        length: usize,
        /// Their sum in radians.
        angle: f64,
    },
    /// The pairings round an edge do not return to the identity.
    #[error(
        "edge between faces {} and {} of cell {}: the product of the {length} pairings round it is not the identity \
         (residual {residual:.3e})",
        faces[0], faces[1], cell
    )]
    Product {
        /// Cell of the edge.
        cell: usize,
        /// Faces that meet in the edge.
        faces: [usize; 2],
        /// Number of pairings in the full turn.
        length: usize,
        /// Largest entry of the product minus the identity.
        residual: f64,
    },
    /// The corners that meet in a vertex do not make a sphere, nor one of its quotients.
    #[error("corner at {corner} of cell {cell}: its link has Euler characteristic {characteristic}, a sphere has 2")]
    Link {
        /// Cell of a corner of the class.
        cell: usize,
        /// Chart coordinates of the corner.
        corner: DVec3,
        /// Of the surface glued from corner polygons.
        characteristic: i64,
    },
    /// The integers of the homology computation outgrow their type.
    #[error("the first homology group has numbers beyond 64 bits")]
    Homology,
}

/// How a face is called in messages.
fn face_name(id: FaceId) -> String {
    format!("face {} of cell {}", id.face, id.cell)
}
