//! Shapes of the cells, and what pairings do to faces and corners.

use super::{CheckError, TOLERANCE, deviation, image, keeps_orientation, largest, within};
use crate::geometry::{Geometry, Isometry};
use crate::space::polyhedron::Polyhedron;
use crate::space::{Cell, FaceId, Space};

/// Images of corners, by cell, face and place in the face's outline.
pub(super) type CornerImages = Vec<Vec<Vec<usize>>>;

/// The polyhedra of all cells; their corners are points of the geometry.
pub(super) fn shapes<G: Geometry>(geometry: G, space: &Space) -> Result<Vec<Polyhedron>, CheckError> {
    if space.cells.is_empty() {
        return Err(CheckError::Disconnected("the space has no cells".to_owned()));
    }
    let shape = |(cell, c): (usize, &Cell)| {
        if c.faces.is_empty() {
            return Err(CheckError::Whole(cell));
        }
        let shape = Polyhedron::new(c).map_err(|reason| CheckError::Cell { cell, reason })?;
        for (face, outline) in shape.face_vertices.iter().enumerate() {
            for &v in outline {
                let corner = shape.vertices[v];
                if !geometry.unchart(corner).is_some_and(|p| p.is_finite()) {
                    return Err(CheckError::AtInfinity { face: FaceId { cell, face }, corner });
                }
            }
        }
        Ok(shape)
    };
    space.cells.iter().enumerate().map(shape).collect()
}

/// That partners exist and agree, and that pairings are isometries and inverse to each other. Returns the worst
/// residual.
pub(super) fn pairings<G: Geometry>(geometry: G, space: &Space) -> Result<f64, CheckError> {
    let partner_of = |id: FaceId| space.cells.get(id.cell).and_then(|c| c.faces.get(id.face)).map(|f| f.partner);
    let fault = |id, partner, problem| Err(CheckError::Partner { face: id, partner, problem });
    if let Some((id, face)) = space.faces().find(|(_, face)| partner_of(face.partner).is_none()) {
        return fault(id, face.partner, "does not exist");
    }
    if let Some((id, face)) = space.faces().find(|(id, face)| partner_of(face.partner) != Some(*id)) {
        return fault(id, face.partner, "is paired with another face");
    }
    let mut worst = 0.0_f64;
    for (id, face) in space.faces() {
        let scale = largest(&face.pairing).max(1.0).powi(2);
        let residual = geometry.isometry_residual(&face.pairing);
        if !within(residual, TOLERANCE * scale) {
            return Err(CheckError::NotAnIsometry { face: id, residual });
        }
        let round_trip = geometry.compose(&space.face(face.partner).pairing, &face.pairing);
        let inverse = deviation(&round_trip, &Isometry::IDENTITY);
        if !within(inverse, TOLERANCE * scale) {
            return Err(CheckError::NotInverse { face: id, partner: face.partner, residual: inverse });
        }
        worst = worst.max(residual).max(inverse);
    }
    Ok(worst)
}

/// To which corner each pairing takes each corner of its face, and the worst distance in the chart. Also that the
/// cell comes to lie on the other side of the partner.
pub(super) fn corner_images<G: Geometry>(
    geometry: G,
    space: &Space,
    shapes: &[Polyhedron],
) -> Result<(CornerImages, f64), CheckError> {
    let mut worst = 0.0_f64;
    let mut images: CornerImages = shapes.iter().map(|shape| vec![Vec::new(); shape.face_vertices.len()]).collect();
    for (id, face) in space.faces() {
        let (own, other) = (&shapes[id.cell], &shapes[face.partner.cell]);
        let candidates = &other.face_vertices[face.partner.face];
        let not_onto = |distance| CheckError::NotOnto { face: id, partner: face.partner, distance };
        let mut found = Vec::with_capacity(candidates.len());
        for &v in &own.face_vertices[id.face] {
            // A point outside of the part of the model that the chart shows has the chart coordinates of another.
            let moved = geometry.unchart(own.vertices[v]).map(|p| image(geometry, &face.pairing, p));
            let seen = moved.map(|p| geometry.chart(p)).filter(|c| {
                let back = geometry.unchart(*c).zip(moved).map(|(back, p)| (back - p).abs().max_element());
                back.is_some_and(|gap| gap < 0.5)
            });
            let Some(seen) = seen else { return Err(not_onto(f64::INFINITY)) };
            let distance = |&c: &usize| other.vertices[c].distance(seen);
            let nearest = candidates.iter().copied().min_by(|a, b| distance(a).total_cmp(&distance(b)));
            let Some(nearest) = nearest else { return Err(not_onto(f64::INFINITY)) };
            worst = worst.max(distance(&nearest));
            if !within(distance(&nearest), TOLERANCE * other.circumradius) || found.contains(&nearest) {
                return Err(not_onto(distance(&nearest)));
            }
            found.push(nearest);
        }
        if found.len() != candidates.len() {
            return Err(not_onto(f64::INFINITY));
        }
        let centre = geometry.unchart(own.centroid).map(|p| image(geometry, &face.pairing, p));
        if !centre.is_some_and(|c| geometry.side(c, space.face(face.partner).plane) > 0.0) {
            return Err(CheckError::WrongSide { face: id, partner: face.partner });
        }
        images[id.cell][id.face] = found;
    }
    Ok((images, worst))
}

/// Whether all cells can be oriented so that all pairings keep the orientation. Fails if the cells hang together
/// in several pieces.
pub(super) fn orientable<G: Geometry>(geometry: G, space: &Space) -> Result<bool, CheckError> {
    let mut orientation: Vec<Option<bool>> = vec![None; space.cells.len()];
    orientation[0] = Some(true);
    let mut queue = vec![0];
    let mut consistent = true;
    while let Some(cell) = queue.pop() {
        for face in &space.cells[cell].faces {
            let wanted = orientation[cell].map(|o| o == keeps_orientation(geometry, &face.pairing));
            let there = &mut orientation[face.partner.cell];
            match there {
                Some(_) => consistent &= *there == wanted,
                None => {
                    *there = wanted;
                    queue.push(face.partner.cell);
                }
            }
        }
    }
    match orientation.iter().position(Option::is_none) {
        Some(cell) => Err(CheckError::Disconnected(format!("cell {cell} is not connected with cell 0 by any faces"))),
        None => Ok(consistent),
    }
}
