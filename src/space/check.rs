//! Proof that a gluing closes up to a manifold or an orbifold.
//!
//! This is Poincaré's polyhedron theorem, checked in numbers: pairings are isometries that take faces onto faces,
//! cells lie on opposite sides of them, and round every edge the cells fill an angle of 2π/n, with pairings whose
//! product over n rounds is the identity. (Ratcliffe, *Foundations of Hyperbolic Manifolds*, chapters 10 and 13.)
//! The cells are compact, so the quotient is complete. From the same incidences come the vertex links, the Euler
//! characteristic and the first homology; the volume is a quadrature of the metric's density.
//!
//! All this is about gluings that are face to face. Where a face is glued to parts of several others, as in the usual
//! domains of the geometries with sheared lattices, faces are split along the images of edges first (`split`), each
//! part with the product of pairings that takes it to where it belongs; the parts are then face to face.

mod cycles;
mod error;
mod faces;
mod homology;
mod links;
mod outline;
mod split;
mod volume;

use super::polyhedron::Polyhedron;
use super::{FaceId, Space};
use crate::geometry::{Geodesic, Geometry, Isometry, Visitor, visit};
use glam::{DMat3, DVec3, DVec4};
use serde::Serialize;

pub use error::CheckError;

/// Deviations above this are errors: in chart units for corners, in radians for angles, in units of the squared
/// largest entry for matrices. Reference data with 17 digits leave about 1e-14.
pub const TOLERANCE: f64 = 1e-8;

/// What is known of a gluing that closes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// Name of the model geometry.
    pub geometry: &'static str,
    /// Number of faces of all cells.
    pub faces: usize,
    /// Worst deviation of a pairing from an isometry, from the inverse of its partner, and from taking the
    /// corners of its face to those of the partner (chart distance).
    pub pairing_residual: f64,
    /// The ways round the edges.
    pub edge_cycles: Vec<EdgeCycle>,
    /// Volume of all cells in the metric.
    pub volume: f64,
    /// Invariant factors of the first homology group (of the orbifold fundamental group, for orbifolds): finite
    /// ones in the order in which they divide each other, then a 0 for each free factor.
    pub homology: Vec<u64>,
    /// Manifold or orbifold.
    pub kind: Kind,
    /// Name of the space.
    pub name: String,
    /// Number of cells.
    pub cells: usize,
    /// Number of edges of all cells, before gluing; where faces had to be split, with the edges between the parts.
    pub edges: usize,
    /// Number of corners of all cells, before gluing and after splitting.
    pub vertices: usize,
    /// Whether the cells can be oriented so that all pairings keep the orientation.
    pub orientable: bool,
    /// Number of corners after gluing.
    pub vertex_classes: usize,
    /// Of the underlying space: 0 for a closed manifold.
    pub euler_characteristic: i64,
    /// Estimated error of `volume`.
    pub volume_error: f64,
}

/// A full turn round an edge.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EdgeCycle {
    /// Cells met in a full turn. Round a mirror or a cone edge cells are met again until the turn is full.
    pub length: usize,
    /// Sum of their dihedral angles in radians: 2π up to rounding.
    pub angle: f64,
    /// Larger of the deviation of `angle` from 2π (at the ends and in the middle of the edge) and that of the
    /// product of pairings from the identity.
    pub residual: f64,
    /// The faces crossed.
    #[serde(skip)]
    pub crossed: Vec<FaceId>,
    /// How often the cycle passes its first wedge: more than once round the singular edges of an orbifold.
    #[serde(skip)]
    pub rounds: usize,
}

/// What a gluing is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// Every point has a neighbourhood like a ball.
    Manifold,
    /// Some points have the quotient of a ball by a finite group: mirrors, cone edges, isolated points.
    Orbifold,
}

/// Proves that the gluing of a space closes, and reports what it closes to.
///
/// # Errors
/// The first thing found wrong, named by face, edge or corner.
pub fn check(space: &Space) -> Result<Report, CheckError> {
    struct Check<'a>(&'a Space);
    impl Visitor for Check<'_> {
        type Output = Result<Report, CheckError>;
        fn visit<G: Geometry>(self, geometry: G) -> Self::Output {
            check_in(geometry, self.0)
        }
    }
    visit(space.geometry, Check(space))
}

/// A space with the shapes of its cells and what the pairings do to corners.
struct Glued<'a, G> {
    geometry: G,
    space: &'a Space,
    shapes: Vec<Polyhedron>,
    /// For each cell and each of its edges a point in the middle of the edge.
    middles: Vec<Vec<DVec3>>,
    /// `images[cell][face][i]` is the corner of the partner's cell to which the pairing takes corner
    /// `shapes[cell].face_vertices[face][i]`.
    images: Vec<Vec<Vec<usize>>>,
}

fn check_in<G: Geometry>(geometry: G, space: &Space) -> Result<Report, CheckError> {
    let shapes = faces::shapes(geometry, space)?;
    let cells = shapes.clone();
    let faces = space.faces().count();
    let residual = faces::pairings(geometry, space)?;
    let whole = faces::corner_images(geometry, space, &shapes);
    let parts;
    let (space, shapes, middles, (images, corner_residual)) = match whole {
        // Perhaps faces land on parts of others; if they do not either, the first complaint is the clearer one.
        Err(complaint @ CheckError::NotOnto { .. }) => {
            let split = split::face_to_face(geometry, space, &shapes).ok_or(complaint)?;
            parts = split.space;
            let images = faces::corner_images(geometry, &parts, &split.shapes)?;
            (&parts, split.shapes, split.middles, images)
        }
        images => {
            let middles = shapes.iter().map(straight_middles).collect();
            (space, shapes, middles, images?)
        }
    };
    let glued = Glued { geometry, space, shapes, middles, images };
    let orientable = faces::orientable(geometry, space)?;

    let edge_cycles = cycles::edge_cycles(&glued)?;
    let homology = homology::first_homology(space, &edge_cycles)?;
    let mirrors = space.faces().any(|(id, face)| face.partner == id);
    let regular = !mirrors && edge_cycles.iter().all(|cycle| cycle.rounds == 1);
    let links = links::vertex_links(&glued);
    let spheres = links.iter().all(|link| link.characteristic == 2);
    if regular {
        // Mirrors and cone edges make links with boundary or corners, which the angles already account for; the
        // free quotients of the sphere are the sphere and the projective plane.
        if let Some(bad) = links.iter().find(|link| !(1..=2).contains(&link.characteristic)) {
            let corner = glued.shapes[bad.cell].vertices[bad.vertex];
            return Err(CheckError::Link { cell: bad.cell, corner, characteristic: bad.characteristic });
        }
    }

    let (volume, volume_error) = volume::volume(geometry, &cells);
    let face_classes = space.faces().filter(|(id, face)| *id <= face.partner).count();
    Ok(Report {
        geometry: space.geometry.name(),
        faces,
        pairing_residual: residual.max(corner_residual),
        euler_characteristic: links.len() as i64 - edge_cycles.len() as i64 + face_classes as i64
            - space.cells.len() as i64,
        edge_cycles,
        volume,
        homology,
        kind: if regular && spheres { Kind::Manifold } else { Kind::Orbifold },
        name: space.name.clone(),
        cells: space.cells.len(),
        edges: glued.shapes.iter().map(|shape| shape.edges.len()).sum(),
        vertices: glued.shapes.iter().map(|shape| shape.vertices.len()).sum(),
        orientable,
        vertex_classes: links.len(),
        volume_error,
    })
}

/// The middles of straight edges.
fn straight_middles(shape: &Polyhedron) -> Vec<DVec3> {
    shape.edges.iter().map(|edge| 0.5 * (shape.vertices[edge.vertices[0]] + shape.vertices[edge.vertices[1]])).collect()
}

/// Image of a point.
pub(super) fn image<G: Geometry>(geometry: G, m: &Isometry, p: DVec4) -> DVec4 {
    geometry.apply(m, Geodesic { point: p, velocity: geometry.frame(p)[0] }).point
}

/// Largest difference of two isometries in any number.
pub(super) fn deviation(a: &Isometry, b: &Isometry) -> f64 {
    largest(&Isometry { linear: a.linear - b.linear, shift: a.shift - b.shift })
}

/// Largest number of an isometry.
pub(super) fn largest(m: &Isometry) -> f64 {
    let linear = m.linear.to_cols_array();
    linear
        .iter()
        .chain(&m.shift.to_array())
        .fold(0.0, |worst, x| if x.abs() > worst || x.is_nan() { x.abs() } else { worst })
}

/// Whether an isometry keeps the orientation: sign of the determinant of its differential in positive frames.
fn keeps_orientation<G: Geometry>(geometry: G, m: &Isometry) -> bool {
    let p = geometry.base();
    let q = image(geometry, m, p);
    let frame = geometry.frame(q);
    let columns = geometry.frame(p).map(|axis| {
        let moved = geometry.apply(m, Geodesic { point: p, velocity: axis }).velocity;
        DVec3::from_array(frame.map(|f| geometry.inner(q, f, moved)))
    });
    DMat3::from_cols(columns[0], columns[1], columns[2]).determinant() > 0.0
}

/// Whether a residual is small enough; one that is not a number never is.
pub(super) fn within(residual: f64, limit: f64) -> bool {
    residual <= limit
}
