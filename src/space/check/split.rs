//! Splitting of faces that are glued to parts of several others.
//!
//! A face is taken by its pairing onto the plane of its partner, but perhaps only partly onto the partner: what sticks
//! out there lies beyond other faces of that cell, and their pairings take it on, until every part of the face has found
//! the face of a cell that it is glued to. The parts are convex polygons. Corners of one part in the middle of a side
//! of another are added there, and their images under the pairings with them, until all parts of all cells meet in
//! whole edges. A split that misses a part, or counts one twice, does not close to a polyhedron.

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
    /// Its corners in its own cell, counter-clockwise seen from outside.
    outline: Vec<DVec3>,
}

/// The space with its faces split until they are glued face to face, and the shapes of its cells. `None` where no
/// splitting does that.
pub(super) fn face_to_face<G: Geometry>(
    geometry: G,
    space: &Space,
    shapes: &[Polyhedron],
) -> Option<(Space, Vec<Polyhedron>)> {
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
    let (corners, outlines) = common_corners(geometry, shapes, &parts, &partners)?;

    let cells = parts.iter().zip(&partners).map(|(parts, partners)| {
        let face = |(part, partner): (&Part, &FaceId)| Face {
            plane: space.face(part.of).plane,
            pairing: part.pairing,
            partner: *partner,
        };
        Cell { faces: parts.iter().zip(partners).map(face).collect() }
    });
    let cells = cells.collect();
    let shapes = corners.into_iter().zip(outlines).map(|(v, f)| Polyhedron::from_outlines(v, f).ok());
    Some((Space { name: space.name.clone(), geometry: space.geometry, cells }, shapes.collect::<Option<_>>()?))
}

/// The parts of a face; `None` if they do not make up the whole.
fn parts_of<G: Geometry>(geometry: G, space: &Space, shapes: &[Polyhedron], id: FaceId) -> Option<Vec<Part>> {
    let shape = &shapes[id.cell];
    let whole: Vec<DVec3> = shape.face_vertices[id.face].iter().map(|&v| shape.vertices[v]).collect();
    let face = space.face(id);
    let mut products = vec![(face.partner.cell, face.pairing)];
    let mut parts = Vec::new();
    let mut next = 0;
    while let Some(&(cell, pairing)) = products.get(next) {
        next += 1;
        let near = TOLERANCE * shapes[cell].circumradius;
        let moved = carried(geometry, &pairing, &whole)?;
        let centre = carried(geometry, &pairing, &[shape.centroid])?[0];
        let planes: Vec<DVec4> = space.cells[cell].faces.iter().map(|f| f.plane / f.plane.xyz().length()).collect();
        for (there, plane) in planes.iter().enumerate() {
            let side = |c: DVec3| plane.dot(c.extend(1.0));
            if moved.iter().any(|c| side(*c) > near) && products.len() < MAX_PRODUCTS {
                let beyond = &space.cells[cell].faces[there];
                let product = (beyond.partner.cell, geometry.compose(&beyond.pairing, &pairing));
                let limit = TOLERANCE * largest(&product.1).max(1.0).powi(2);
                if !products.iter().any(|p| p.0 == product.0 && deviation(&p.1, &product.1) < limit) {
                    products.push(product);
                }
            }
            // The face lies in this plane, with its own cell on the outer side.
            if side(centre) > 0.0 && moved.iter().all(|c| side(*c).abs() <= near) {
                let others = planes.iter().enumerate().filter(|(f, _)| *f != there).map(|(_, plane)| *plane);
                let inside = others.fold(moved.clone(), |outline, plane| clipped(&outline, plane, near));
                if inside.len() > 2 && area(&inside) > near * shapes[cell].circumradius {
                    let outline = carried(geometry, &geometry.inverse(&pairing), &inside)?;
                    parts.push(Part { of: id, pairing, onto: FaceId { cell, face: there }, outline });
                }
            }
        }
    }
    // The first product tried is the face's own pairing.
    if !parts.first().is_some_and(|part| part.onto == face.partner && products[0].1 == part.pairing) {
        return None;
    }
    let covered: f64 = parts.iter().map(|part| area(&part.outline)).sum();
    ((covered / area(&whole) - 1.0).abs() < TOLERANCE).then_some(parts)
}

/// Images of points of the chart.
fn carried<G: Geometry>(geometry: G, m: &Isometry, points: &[DVec3]) -> Option<Vec<DVec3>> {
    points.iter().map(|c| geometry.unchart(*c).map(|p| geometry.chart(image(geometry, m, p)))).collect()
}

/// The part of a convex polygon inside a plane; what is within `near` of the plane counts as on it.
fn clipped(outline: &[DVec3], plane: DVec4, near: f64) -> Vec<DVec3> {
    let side = |c: DVec3| plane.dot(c.extend(1.0));
    let mut inside = Vec::with_capacity(outline.len() + 1);
    for (i, &a) in outline.iter().enumerate() {
        let b = outline[(i + 1) % outline.len()];
        let (from, to) = (side(a), side(b));
        if from <= near {
            inside.push(a);
        }
        if (from > near && to < -near) || (from < -near && to > near) {
            inside.push(a.lerp(b, from / (from - to)));
        }
    }
    inside
}

fn area(outline: &[DVec3]) -> f64 {
    let fan = outline[1..].windows(2);
    0.5 * fan.map(|pair| (pair[0] - outline[0]).cross(pair[1] - outline[0])).sum::<DVec3>().length()
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

type Outlines = Vec<Vec<Vec<usize>>>;

/// The corners of each cell, and the outlines of its parts through all corners that lie on them.
fn common_corners<G: Geometry>(
    geometry: G,
    shapes: &[Polyhedron],
    parts: &[Vec<Part>],
    partners: &[Vec<FaceId>],
) -> Option<(Vec<Vec<DVec3>>, Outlines)> {
    let near: Vec<f64> = shapes.iter().map(|shape| TOLERANCE * shape.circumradius).collect();
    let find = |corners: &mut Vec<DVec3>, near: f64, c: DVec3| {
        corners.iter().position(|v| v.distance(c) <= 10.0 * near).unwrap_or_else(|| {
            corners.push(c);
            corners.len() - 1
        })
    };
    let mut corners: Vec<Vec<DVec3>> = shapes.iter().map(|shape| shape.vertices.clone()).collect();
    let mut outlines: Outlines = Vec::new();
    for (cell, parts) in parts.iter().enumerate() {
        let outline = |part: &Part| part.outline.iter().map(|c| find(&mut corners[cell], near[cell], *c)).collect();
        outlines.push(parts.iter().map(outline).collect());
    }
    for _ in 0..MAX_ROUNDS {
        let known = corners.iter().map(Vec::len).sum::<usize>();
        for (cell, outlines) in outlines.iter_mut().enumerate() {
            for outline in outlines.iter_mut() {
                *outline = through_all(outline, &corners[cell], 10.0 * near[cell]);
            }
        }
        for (cell, parts) in parts.iter().enumerate() {
            for ((part, partner), outline) in parts.iter().zip(&partners[cell]).zip(&outlines[cell]) {
                let own: Vec<DVec3> = outline.iter().map(|&v| corners[cell][v]).collect();
                for c in carried(geometry, &part.pairing, &own)? {
                    find(&mut corners[partner.cell], near[partner.cell], c);
                }
            }
        }
        if known == corners.iter().map(Vec::len).sum::<usize>() {
            return Some((corners, outlines));
        }
    }
    None
}

/// An outline with the corners that lie on its sides.
fn through_all(outline: &[usize], corners: &[DVec3], near: f64) -> Vec<usize> {
    let mut all = Vec::with_capacity(outline.len());
    for (i, &from) in outline.iter().enumerate() {
        let to = outline[(i + 1) % outline.len()];
        let (a, way) = (corners[from], corners[to] - corners[from]);
        let length = way.length();
        let mut between: Vec<(f64, usize)> = corners
            .iter()
            .enumerate()
            .filter(|(v, _)| *v != from && *v != to)
            .filter_map(|(v, c)| {
                let along = (*c - a).dot(way) / length;
                let off = (*c - a - way * (along / length)).length();
                (off <= near && along > near && along < length - near).then_some((along, v))
            })
            .collect();
        between.sort_by(|x, y| x.0.total_cmp(&y.0));
        all.push(from);
        all.extend(between.into_iter().map(|(_, v)| v));
    }
    all
}
