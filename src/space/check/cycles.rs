//! The ways round edges.

use super::{CheckError, EdgeCycle, Glued, TOLERANCE, deviation, image, largest, within};
use crate::geometry::{Geometry, Isometry};
use crate::space::FaceId;
use glam::{DVec4, Vec4Swizzles};
use std::collections::HashSet;
use std::f64::consts::TAU;

/// Cone edges of a higher order are refused.
const MAX_ROUNDS: f64 = 1000.0;

/// A wedge of a cell at an edge, about to be left through one of its two faces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Wedge {
    cell: usize,
    /// The ends of the edge, in an order that the way round the edge carries along.
    ends: [usize; 2],
    /// The face to leave through.
    face: usize,
}

impl<G: Geometry> Glued<'_, G> {
    /// The wedge on the other side of the face. `None` if the edge lands on no edge of the partner.
    fn beyond(&self, wedge: Wedge) -> Option<Wedge> {
        let outline = &self.shapes[wedge.cell].face_vertices[wedge.face];
        let images = &self.images[wedge.cell][wedge.face];
        let land = |v: usize| outline.iter().position(|&w| w == v).map(|i| images[i]);
        let ends = [land(wedge.ends[0])?, land(wedge.ends[1])?];
        let partner = self.space.cells[wedge.cell].faces[wedge.face].partner;
        let shape = &self.shapes[partner.cell];
        let edge = shape.edges.iter().find(|e| e.vertices == ends || e.vertices == [ends[1], ends[0]])?;
        let face = match edge.faces {
            [a, b] if a == partner.face => b,
            [a, b] if b == partner.face => a,
            _ => return None,
        };
        Some(Wedge { cell: partner.cell, ends, face })
    }

    /// Dihedral angle of two faces of a cell at a point of their edge, from the metric's normals there.
    fn dihedral(&self, cell: usize, faces: [usize; 2], p: DVec4) -> f64 {
        let [u, v] = faces.map(|face| self.geometry.raise(p, self.space.cells[cell].faces[face].plane.xyz()));
        // π minus the angle of the unit normals, without loss at small and straight angles.
        2.0 * self.geometry.norm(p, u + v).atan2(self.geometry.norm(p, u - v))
    }
}

/// The cycles of all edges, each once, with their angles and products proved.
pub(super) fn edge_cycles<G: Geometry>(glued: &Glued<'_, G>) -> Result<Vec<EdgeCycle>, CheckError> {
    let mut seen: HashSet<(usize, usize)> = HashSet::new();
    let mut cycles = Vec::new();
    for (cell, shape) in glued.shapes.iter().enumerate() {
        for (index, edge) in shape.edges.iter().enumerate() {
            if seen.contains(&(cell, index)) {
                continue;
            }
            let round = one_round(glued, Wedge { cell, ends: edge.vertices, face: edge.faces[0] })?;
            for wedge in &round {
                seen.extend(edge_index(glued, *wedge).map(|e| (wedge.cell, e)));
            }
            cycles.push(full_turn(glued, cell, index, &round)?);
        }
    }
    Ok(cycles)
}

fn edge_index<G: Geometry>(glued: &Glued<'_, G>, wedge: Wedge) -> Option<usize> {
    let [a, b] = wedge.ends;
    glued.shapes[wedge.cell].edges.iter().position(|e| e.vertices == [a, b] || e.vertices == [b, a])
}

/// The wedges met from `start` until it comes again.
fn one_round<G: Geometry>(glued: &Glued<'_, G>, start: Wedge) -> Result<Vec<Wedge>, CheckError> {
    let mut round = vec![start];
    // Crossing a face can be undone, so the way comes back to its start before it meets any other wedge twice.
    loop {
        let here = round[round.len() - 1];
        let face = FaceId { cell: here.cell, face: here.face };
        let partner = glued.space.face(face).partner;
        match glued.beyond(here) {
            Some(next) if next == start => return Ok(round),
            Some(next) if !round.contains(&next) => round.push(next),
            _ => return Err(CheckError::NotOnto { face, partner, distance: 0.0 }),
        }
    }
}

/// Walks the round as often as a full turn needs, adding up angles at both ends and in the middle of the edge.
fn full_turn<G: Geometry>(
    glued: &Glued<'_, G>,
    cell: usize,
    index: usize,
    round: &[Wedge],
) -> Result<EdgeCycle, CheckError> {
    let geometry = glued.geometry;
    let faces = glued.shapes[cell].edges[index].faces;
    let [from, to] = round[0].ends.map(|v| glued.shapes[cell].vertices[v]);
    let corners = [from, glued.middles[cell][index], to];
    // Corners are points of the geometry, and so is what lies between them.
    let mut points = corners.map(|c| geometry.unchart(c).unwrap_or(DVec4::NAN));
    let mut angles = [0.0; 3];
    let mut product = Isometry::IDENTITY;
    let mut scale = 1.0_f64;
    let mut crossed = Vec::new();
    let (mut rounds, mut wanted_rounds) = (0, 1);
    while rounds < wanted_rounds {
        for wedge in round {
            let edge = edge_index(glued, *wedge).map(|e| glued.shapes[wedge.cell].edges[e].faces).unwrap_or(faces);
            let pairing = &glued.space.cells[wedge.cell].faces[wedge.face].pairing;
            for (angle, point) in angles.iter_mut().zip(&mut points) {
                *angle += glued.dihedral(wedge.cell, edge, *point);
                *point = image(geometry, pairing, *point);
            }
            product = geometry.compose(pairing, &product);
            scale = scale.max(largest(&product));
            crossed.push(FaceId { cell: wedge.cell, face: wedge.face });
        }
        rounds += 1;
        if rounds == 1 {
            let turns = (TAU / angles[1]).round();
            let off = angles.iter().fold(0.0, |worst: f64, a| worst.max((a * turns - TAU).abs()));
            if !((1.0..=MAX_ROUNDS).contains(&turns) && within(off, TOLERANCE * turns)) {
                return Err(CheckError::Angle { cell, faces, length: round.len(), angle: angles[1] });
            }
            wanted_rounds = turns as usize;
        }
    }
    let residual = deviation(&product, &Isometry::IDENTITY);
    if !within(residual, TOLERANCE * scale * scale) {
        return Err(CheckError::Product { cell, faces, length: crossed.len(), residual });
    }
    let off = angles.iter().fold(0.0, |worst: f64, a| worst.max((a - TAU).abs()));
    Ok(EdgeCycle {
        length: crossed.len(),
        angle: angles[1],
        residual: residual.max(off),
        rounds: rounds * visits_of_first_wedge(round),
        crossed,
    })
}

/// How often a round passes the edge of its first wedge: through the other face after a mirror, or the other way
/// along the edge.
fn visits_of_first_wedge(round: &[Wedge]) -> usize {
    let key = |w: &Wedge| (w.cell, w.ends[0].min(w.ends[1]), w.ends[0].max(w.ends[1]));
    round.iter().filter(|w| key(w) == key(&round[0])).count()
}
