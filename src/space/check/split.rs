//! Splitting of faces that are glued to parts of several others.
//!
//! A face is taken by its pairing onto the plane of its partner, but perhaps only partly onto the partner: what sticks
//! out there lies beyond other faces of that cell, and their pairings take it on, until every part of the face has found
//! the face of a cell that it is glued to. The sides of parts are images of straight pieces of the chart (module
//! `outline`): curves, where isometries bend lines. Corners of one part in the middle of a side of another are added
//! there, and their images under the pairings with them, until all parts of all cells meet in whole edges. A split that
//! misses a part, or counts one twice, does not close to a polyhedron.

use super::outline::{Outline, Side, area, carried, clipped, samples};
use super::{TOLERANCE, deviation, image, largest};
use crate::geometry::{Geometry, Isometry};
use crate::space::polyhedron::Polyhedron;
use crate::space::{Cell, Face, FaceId, Space};
use glam::{DVec3, DVec4, Vec4Swizzles};

/// Products of pairings tried for a face.
const MAX_PRODUCTS: usize = 64;

/// Parts of all faces of a cell.
const MAX_PARTS: usize = 1024;

/// Rounds in which corners are carried from part to part.
const MAX_ROUNDS: usize = 64;

/// A part of a face.
struct Part {
    /// The face.
    of: FaceId,
    /// Where the part goes.
    pairing: Isometry,
    /// The face there.
    onto: FaceId,
    /// Its sides in its own cell, counter-clockwise seen from outside.
    outline: Outline,
}

/// A space whose faces are split until they are glued face to face.
pub(super) struct Split {
    /// The space.
    pub(super) space: Space,
    /// The shapes of its cells, with the parts for faces.
    pub(super) shapes: Vec<Polyhedron>,
    /// For each cell and each of its edges a point in the middle of the edge.
    pub(super) middles: Vec<Vec<DVec3>>,
}

/// Splits the faces of a space. `None` where no splitting makes it face to face.
pub(super) fn face_to_face<G: Geometry>(geometry: G, space: &Space, shapes: &[Polyhedron]) -> Option<Split> {
    let mut parts: Vec<Vec<Part>> = Vec::new();
    for cell in 0..space.cells.len() {
        let faces = 0..space.cells[cell].faces.len();
        let split: Option<Vec<Vec<Part>>> =
            faces.map(|face| parts_of(geometry, space, shapes, FaceId { cell, face })).collect();
        parts.push(split?.into_iter().flatten().collect());
        if parts[cell].len() > MAX_PARTS {
            return None;
        }
    }
    let partners = partners(geometry, &parts)?;
    let (corners, marks) = common_corners(geometry, shapes, &parts, &partners)?;

    let cells = parts.iter().zip(&partners).map(|(parts, partners)| {
        let face = |(part, partner): (&Part, &FaceId)| Face {
            plane: space.face(part.of).plane,
            pairing: part.pairing,
            partner: *partner,
        };
        Cell { faces: parts.iter().zip(partners).map(face).collect() }
    });
    let space = Space { name: space.name.clone(), geometry: space.geometry, cells: cells.collect() };
    let mut split = Split { space, shapes: Vec::new(), middles: Vec::new() };
    for (cell, corners) in corners.into_iter().enumerate() {
        let near = 10.0 * TOLERANCE * shapes[cell].circumradius;
        let faces = marks[cell].iter().map(|sides| sides.iter().flatten().map(|mark| mark.corner).collect());
        let shape = Polyhedron::from_outlines(corners, faces.collect()).ok()?;
        split.middles.push(middles(geometry, &shape, &parts[cell], &marks[cell], near)?);
        split.shapes.push(shape);
    }
    Some(split)
}

/// The parts of a face; `None` if they do not make up the whole.
fn parts_of<G: Geometry>(geometry: G, space: &Space, shapes: &[Polyhedron], id: FaceId) -> Option<Vec<Part>> {
    let shape = &shapes[id.cell];
    let corners: Vec<DVec3> = shape.face_vertices[id.face].iter().map(|&v| shape.vertices[v]).collect();
    let side = |i: usize| Side::straight(corners[i], corners[(i + 1) % corners.len()]);
    let whole: Outline = (0..corners.len()).map(side).collect();
    let face = space.face(id);
    let mut products = vec![(face.partner.cell, face.pairing)];
    let mut parts = Vec::new();
    let mut next = 0;
    while let Some(&(cell, pairing)) = products.get(next) {
        next += 1;
        let near = TOLERANCE * shapes[cell].circumradius;
        let moved = carried(geometry, &pairing, &whole);
        let points = samples(geometry, &moved)?;
        let centre = geometry.chart(image(geometry, &pairing, geometry.unchart(shape.centroid)?));
        let planes: Vec<DVec4> = space.cells[cell].faces.iter().map(|f| f.plane / f.plane.xyz().length()).collect();
        for (there, plane) in planes.iter().enumerate() {
            let side = |c: DVec3| plane.dot(c.extend(1.0));
            if points.iter().any(|c| side(*c) > near) && products.len() < MAX_PRODUCTS {
                let beyond = &space.cells[cell].faces[there];
                let product = (beyond.partner.cell, geometry.compose(&beyond.pairing, &pairing));
                let limit = TOLERANCE * largest(&product.1).max(1.0).powi(2);
                if !products.iter().any(|p| p.0 == product.0 && deviation(&p.1, &product.1) < limit) {
                    products.push(product);
                }
            }
            // The face lies in this plane, with its own cell on the outer side.
            if side(centre) > 0.0 && points.iter().all(|c| side(*c).abs() <= near) {
                let mut inside = moved.clone();
                for (_, plane) in planes.iter().enumerate().filter(|(f, _)| *f != there) {
                    inside = clipped(geometry, &inside, *plane, near)?;
                }
                if inside.len() > 2 && area(geometry, &inside)? > near * shapes[cell].circumradius {
                    let outline = carried(geometry, &geometry.inverse(&pairing), &inside);
                    parts.push(Part { of: id, pairing, onto: FaceId { cell, face: there }, outline });
                }
            }
        }
        // The first product tried is the face's own pairing.
        if next == 1 && parts.first().is_none_or(|part| part.onto != face.partner) {
            return None;
        }
    }
    let covered: f64 = parts.iter().map(|part| area(geometry, &part.outline)).sum::<Option<f64>>()?;
    ((covered / area(geometry, &whole)? - 1.0).abs() < TOLERANCE).then_some(parts)
}

/// For each part the one whose pairing is the inverse of its own.
fn partners<G: Geometry>(geometry: G, parts: &[Vec<Part>]) -> Option<Vec<Vec<FaceId>>> {
    let partner = |part: &Part| {
        let limit = TOLERANCE * largest(&part.pairing).max(1.0).powi(2);
        let undoes = |other: &Part| {
            let round_trip = geometry.compose(&other.pairing, &part.pairing);
            other.of == part.onto && other.onto == part.of && deviation(&round_trip, &Isometry::IDENTITY) < limit
        };
        let face = parts[part.onto.cell].iter().position(undoes)?;
        Some(FaceId { cell: part.onto.cell, face })
    };
    parts.iter().map(|parts| parts.iter().map(partner).collect()).collect()
}

/// A corner on a side of a part.
#[derive(Clone, Copy)]
struct Mark {
    /// Where on the side, from 0 to less than 1.
    at: f64,
    /// Index of the corner in the cell.
    corner: usize,
}

/// For each cell, part and side the corners on it, in their order; the side's own start is the first.
type Marks = Vec<Vec<Vec<Vec<Mark>>>>;

/// The corners of each cell, and all that lie on the sides of its parts.
fn common_corners<G: Geometry>(
    geometry: G,
    shapes: &[Polyhedron],
    parts: &[Vec<Part>],
    partners: &[Vec<FaceId>],
) -> Option<(Vec<Vec<DVec3>>, Marks)> {
    let near: Vec<f64> = shapes.iter().map(|shape| 10.0 * TOLERANCE * shape.circumradius).collect();
    let find = |corners: &mut Vec<DVec3>, near: f64, c: DVec3| {
        corners.iter().position(|v| v.distance(c) <= near).unwrap_or_else(|| {
            corners.push(c);
            corners.len() - 1
        })
    };
    let mut corners: Vec<Vec<DVec3>> = shapes.iter().map(|shape| shape.vertices.clone()).collect();
    let mut marks: Marks = Vec::new();
    for (cell, parts) in parts.iter().enumerate() {
        let mut start = |side: &Side| {
            let c = side.at(geometry, 0.0)?;
            Some(vec![Mark { at: 0.0, corner: find(&mut corners[cell], near[cell], c) }])
        };
        let mut of_part = |part: &Part| part.outline.iter().map(&mut start).collect::<Option<Vec<_>>>();
        marks.push(parts.iter().map(&mut of_part).collect::<Option<_>>()?);
    }
    let mut seen = vec![0; corners.len()];
    for _ in 0..MAX_ROUNDS {
        // Corners that are new since the last round are looked for on all sides.
        for (cell, parts) in parts.iter().enumerate() {
            for (part, sides) in parts.iter().zip(&mut marks[cell]) {
                let starts: Vec<usize> = sides.iter().map(|marks| marks[0].corner).collect();
                for (number, (side, marks)) in part.outline.iter().zip(sides.iter_mut()).enumerate() {
                    let ends = [starts[number], starts[(number + 1) % starts.len()]];
                    for corner in (seen[cell]..corners[cell].len()).filter(|corner| !ends.contains(corner)) {
                        if let Some(at) = side.parameter(geometry, corners[cell][corner], near[cell]) {
                            marks.push(Mark { at, corner });
                        }
                    }
                    marks[1..].sort_by(|a, b| a.at.total_cmp(&b.at));
                }
            }
            seen[cell] = corners[cell].len();
        }
        for (cell, parts) in parts.iter().enumerate() {
            for ((part, partner), sides) in parts.iter().zip(&partners[cell]).zip(&marks[cell]) {
                for mark in sides.iter().flatten() {
                    let point = geometry.unchart(corners[cell][mark.corner])?;
                    let there = geometry.chart(image(geometry, &part.pairing, point));
                    find(&mut corners[partner.cell], near[partner.cell], there);
                }
            }
        }
        if seen.iter().zip(&corners).all(|(seen, corners)| *seen == corners.len()) {
            return Some((corners, marks));
        }
    }
    None
}

/// A point in the middle of each edge of a cell, if the two parts that meet in the edge see the same curve there.
fn middles<G: Geometry>(
    geometry: G,
    shape: &Polyhedron,
    parts: &[Part],
    marks: &[Vec<Vec<Mark>>],
    near: f64,
) -> Option<Vec<DVec3>> {
    // The side of a part on which an edge lies, and a parameter in the middle of the edge.
    let side_of = |face: usize, [from, to]: [usize; 2]| {
        let flat: Vec<(usize, Mark)> = marks[face]
            .iter()
            .enumerate()
            .flat_map(|(side, marks)| marks.iter().map(move |mark| (side, *mark)))
            .collect();
        let start = (0..flat.len()).find(|&i| flat[i].1.corner == from && flat[(i + 1) % flat.len()].1.corner == to)?;
        let ((side, mark), (next_side, next)) = (flat[start], flat[(start + 1) % flat.len()]);
        let end = if next_side == side && next.at > mark.at { next.at } else { 1.0 };
        Some((&parts[face].outline[side], 0.5 * (mark.at + end)))
    };
    let middle = |edge: &crate::space::polyhedron::Edge| {
        let [from, to] = edge.vertices;
        let (side, at) = side_of(edge.faces[0], [from, to])?;
        let middle = side.at(geometry, at)?;
        let (other, _) = side_of(edge.faces[1], [to, from])?;
        other.parameter(geometry, middle, near).map(|_| middle)
    };
    shape.edges.iter().map(middle).collect()
}
