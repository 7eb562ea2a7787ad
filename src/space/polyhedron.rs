//! Vertices, edges and face outlines of a cell, from its face planes.
//!
//! Vertices are the intersections of plane triples that no other plane cuts off (the cells have tens of faces, so
//! trying all triples is quick), merged where more than three faces meet. Everything happens in the chart, where
//! cells are convex whatever the geometry. Lengths are judged in units of the largest distance of a face plane
//! from the chart's origin.

use super::Cell;
use glam::{DVec3, DVec4, Vec4Swizzles};

/// A vertex this far from a plane lies on it. The rounding of an intersection is smaller by five digits, and the
/// faces of a gluing that is wrong by less than this meet as if it were right.
const ON_PLANE: f64 = 1e-9;

/// Three unit normals with a smaller determinant do not make a vertex.
const FLAT_CORNER: f64 = 1e-6;

/// More faces than this are refused: the time grows with the cube of the number of faces.
pub const MAX_FACES: usize = 256;

/// The shape of a cell in the chart.
#[derive(Clone, Debug)]
pub struct Polyhedron {
    /// The corners.
    pub vertices: Vec<DVec3>,
    /// The edges, in the order of their faces.
    pub edges: Vec<Edge>,
    /// For each face its corners (indices into `vertices`), counter-clockwise seen from outside.
    pub face_vertices: Vec<Vec<usize>>,
    /// Centre of gravity with respect to the volume of the chart.
    pub centroid: DVec3,
    /// Largest distance of a vertex from `centroid`, in the chart.
    pub circumradius: f64,
}

/// An edge of a polyhedron.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Edge {
    /// The faces that meet in it, the smaller index first.
    pub faces: [usize; 2],
    /// Its ends, in the order in which the outline of `faces[0]` passes them.
    pub vertices: [usize; 2],
}

/// Why planes do not bound a polyhedron.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum PolyhedronError {
    /// A plane has numbers that are not finite, or no normal.
    #[error("the plane of face {face} needs finite numbers and a normal that is not zero")]
    NoPlane {
        /// The face.
        face: usize,
    },
    /// Too many faces to look at.
    #[error("{count} faces are more than the {MAX_FACES} that a cell may have")]
    TooManyFaces {
        /// How many there are.
        count: usize,
    },
    /// The planes leave a way to infinity.
    #[error("the cell is not bounded: it runs off to infinity along face {face}")]
    Unbounded {
        /// A face that is not bounded.
        face: usize,
    },
    /// No point, or no volume, is inside all planes.
    #[error("the cell is empty: face {face} cuts off what the other faces leave")]
    Empty {
        /// A face that leaves nothing inside.
        face: usize,
    },
    /// A face has no area.
    #[error("face {face} is redundant: the other faces already bound the cell without it")]
    Redundant {
        /// The face.
        face: usize,
    },
    /// The outlines do not fit together, which needs planes that almost coincide.
    #[error("face {face} does not meet its neighbours in whole edges: some of its corners almost coincide")]
    Ragged {
        /// The face.
        face: usize,
    },
}

impl PolyhedronError {
    /// The face that the message names, if it names one.
    pub fn face(&self) -> Option<usize> {
        match *self {
            Self::NoPlane { face }
            | Self::Unbounded { face }
            | Self::Empty { face }
            | Self::Redundant { face }
            | Self::Ragged { face } => Some(face),
            Self::TooManyFaces { .. } => None,
        }
    }
}

impl Polyhedron {
    /// The polyhedron bounded by the planes of the cell's faces.
    ///
    /// # Errors
    /// A face without a plane, a cell that is unbounded or empty, a redundant face.
    pub fn new(cell: &Cell) -> Result<Self, PolyhedronError> {
        let planes: Vec<DVec4> = cell.faces.iter().map(|face| face.plane).collect();
        Self::from_planes(&planes)
    }

    /// The same, or `None` for a cell without end.
    ///
    /// # Errors
    /// As for [`Polyhedron::new`].
    pub fn bounded(cell: &Cell) -> Result<Option<Self>, PolyhedronError> {
        match Self::new(cell) {
            Err(PolyhedronError::Unbounded { .. }) => Ok(None),
            shape => shape.map(Some),
        }
    }

    /// The same from planes `(n, d)` with `n·c + d ≤ 0` inside, of any scale.
    ///
    /// # Errors
    /// As for [`Polyhedron::new`].
    pub fn from_planes(planes: &[DVec4]) -> Result<Self, PolyhedronError> {
        if planes.len() > MAX_FACES {
            return Err(PolyhedronError::TooManyFaces { count: planes.len() });
        }
        let planes = normalised(planes)?;
        let scale = planes.iter().fold(0.0_f64, |worst, p| worst.max(p.w.abs()));
        if let Some(face) = unbounded_face(&planes) {
            return Err(PolyhedronError::Unbounded { face });
        }
        let vertices = corners(&planes, ON_PLANE * scale);
        if vertices.len() < 4 {
            return Err(PolyhedronError::Empty { face: cutting_face(&planes) });
        }
        let face_vertices = outlines(&planes, &vertices, ON_PLANE * scale)?;
        Self::from_outlines(vertices, face_vertices)
    }

    /// The polyhedron with these corners and face outlines, counter-clockwise seen from outside. Neighbouring faces
    /// may lie in one plane, edges may go straight on in a corner, but every edge belongs to exactly two faces.
    ///
    /// # Errors
    /// Outlines that do not fit together.
    pub fn from_outlines(vertices: Vec<DVec3>, face_vertices: Vec<Vec<usize>>) -> Result<Self, PolyhedronError> {
        let edges = edges(&face_vertices)?;
        // Euler's formula holds unless corners almost coincide.
        if vertices.len() + face_vertices.len() != edges.len() + 2 {
            return Err(PolyhedronError::Ragged { face: 0 });
        }
        let centroid = centroid(&vertices, &face_vertices);
        let circumradius = vertices.iter().fold(0.0_f64, |worst, v| worst.max(v.distance(centroid)));
        Ok(Self { vertices, edges, face_vertices, centroid, circumradius })
    }

    /// Index of the edge between two faces.
    pub fn edge_between(&self, face: usize, other: usize) -> Option<usize> {
        let faces = [face.min(other), face.max(other)];
        self.edges.iter().position(|edge| edge.faces == faces)
    }
}

/// The planes with unit normals.
fn normalised(planes: &[DVec4]) -> Result<Vec<DVec4>, PolyhedronError> {
    let unit = |(face, plane): (usize, &DVec4)| {
        let scaled = *plane / plane.xyz().abs().max_element();
        let unit = scaled / scaled.xyz().length();
        if plane.is_finite() && unit.is_finite() { Ok(unit) } else { Err(PolyhedronError::NoPlane { face }) }
    };
    planes.iter().enumerate().map(unit).collect()
}

/// A face along which a direction stays inside all planes, if there is one. The extreme directions of that cone
/// run along two of its planes; without any two independent planes it contains a line.
fn unbounded_face(planes: &[DVec4]) -> Option<usize> {
    let mut spanned = false;
    for (i, p) in planes.iter().enumerate() {
        for q in &planes[..i] {
            let along = p.xyz().cross(q.xyz());
            let length = along.length();
            if length < FLAT_CORNER {
                continue;
            }
            for direction in [along / length, -along / length] {
                let outwards = planes.iter().fold(f64::NEG_INFINITY, |most, r| most.max(r.xyz().dot(direction)));
                if outwards < ON_PLANE {
                    return Some(i);
                }
            }
            spanned = true;
        }
    }
    if spanned { None } else { Some(0) }
}

/// The point in which three planes meet, and the determinant of their normals.
fn meeting_point(p: DVec4, q: DVec4, r: DVec4) -> Option<(DVec3, f64)> {
    let (a, b, c) = (q.xyz().cross(r.xyz()), r.xyz().cross(p.xyz()), p.xyz().cross(q.xyz()));
    let determinant = p.xyz().dot(a);
    let point = -(a * p.w + b * q.w + c * r.w) / determinant;
    (determinant.abs() > FLAT_CORNER).then_some((point, determinant.abs()))
}

/// All points in which three planes meet, with the determinant and the planes.
fn meeting_points(planes: &[DVec4]) -> impl Iterator<Item = (DVec3, f64, [usize; 3])> {
    let n = planes.len();
    (0..n).flat_map(move |i| (0..i).flat_map(move |j| (0..j).map(move |k| [i, j, k]))).filter_map(move |triple| {
        let [i, j, k] = triple;
        meeting_point(planes[i], planes[j], planes[k]).map(|(point, determinant)| (point, determinant, triple))
    })
}

/// The corners of the polyhedron. Of several triples that meet in one corner the best conditioned one counts.
fn corners(planes: &[DVec4], tolerance: f64) -> Vec<DVec3> {
    let mut corners: Vec<(DVec3, f64)> = Vec::new();
    for (point, determinant, _) in meeting_points(planes) {
        if planes.iter().any(|p| p.dot(point.extend(1.0)) > tolerance) {
            continue;
        }
        // Two triples that pass the test above see one corner up to the same tolerance, stretched by their angles.
        match corners.iter_mut().find(|(known, _)| known.distance(point) < 10.0 * tolerance) {
            Some(known) if known.1 < determinant => *known = (point, determinant),
            Some(_) => {}
            None => corners.push((point, determinant)),
        }
    }
    corners.into_iter().map(|(point, _)| point).collect()
}

/// The face to blame for an empty cell: the one that is violated at the corner that comes closest to being one.
fn cutting_face(planes: &[DVec4]) -> usize {
    let mut best = (f64::INFINITY, planes.len().saturating_sub(1));
    for (point, _, triple) in meeting_points(planes) {
        let sides = planes.iter().enumerate().map(|(face, p)| (p.dot(point.extend(1.0)), face));
        let worst = sides
            .filter(|(_, face)| !triple.contains(face))
            .fold((0.0, triple[0]), |a, b| if b.0 > a.0 { b } else { a });
        if worst.0 < best.0 {
            best = worst;
        }
    }
    best.1
}

/// Corners of each face, counter-clockwise seen from outside.
fn outlines(planes: &[DVec4], vertices: &[DVec3], tolerance: f64) -> Result<Vec<Vec<usize>>, PolyhedronError> {
    // Merged corners may be off the planes that did not define them by a little more than the tolerance.
    let on_plane = |plane: &DVec4, v: DVec3| plane.dot(v.extend(1.0)).abs() < 10.0 * tolerance;
    let mut all: Vec<Vec<usize>> = Vec::with_capacity(planes.len());
    for (face, plane) in planes.iter().enumerate() {
        let mut outline: Vec<usize> = (0..vertices.len()).filter(|&v| on_plane(plane, vertices[v])).collect();
        if outline.len() == vertices.len() {
            return Err(PolyhedronError::Empty { face });
        }
        let duplicate = all.iter().any(|other| other.iter().filter(|v| outline.contains(v)).count() > 2);
        if outline.len() < 3 || duplicate {
            return Err(PolyhedronError::Redundant { face });
        }
        let centre = outline.iter().map(|&v| vertices[v]).sum::<DVec3>() / outline.len() as f64;
        let (across, up) = plane.xyz().any_orthonormal_pair();
        // glam's pair is right-handed with the normal: across × up = n.
        let angle = |v: usize| (vertices[v] - centre).dot(up).atan2((vertices[v] - centre).dot(across));
        outline.sort_by(|&a, &b| angle(a).total_cmp(&angle(b)));
        all.push(outline);
    }
    Ok(all)
}

/// The edges: consecutive corners of an outline, which another outline passes the other way round.
fn edges(outlines: &[Vec<usize>]) -> Result<Vec<Edge>, PolyhedronError> {
    let sides = |face: usize| {
        let outline: &[usize] = &outlines[face];
        (0..outline.len()).map(move |i| [outline[i], outline[(i + 1) % outline.len()]])
    };
    let mut edges = Vec::new();
    for face in 0..outlines.len() {
        for [from, to] in sides(face) {
            let mut others = (0..outlines.len()).filter(|&other| sides(other).any(|side| side == [to, from]));
            match (others.next(), others.next()) {
                (Some(other), None) if other > face => edges.push(Edge { faces: [face, other], vertices: [from, to] }),
                (Some(other), None) if other < face => {}
                _ => return Err(PolyhedronError::Ragged { face }),
            }
        }
    }
    edges.sort_by_key(|edge| edge.faces);
    Ok(edges)
}

/// Centre of gravity, from the tetrahedra over a fan of each face.
fn centroid(vertices: &[DVec3], outlines: &[Vec<usize>]) -> DVec3 {
    let apex = vertices.iter().sum::<DVec3>() / vertices.len() as f64;
    let (mut volume, mut moment) = (0.0, DVec3::ZERO);
    for outline in outlines {
        for pair in outline[1..].windows(2) {
            let [a, b, c] = [outline[0], pair[0], pair[1]].map(|v| vertices[v] - apex);
            let six = a.dot(b.cross(c));
            volume += six;
            moment += (a + b + c) * (0.25 * six);
        }
    }
    apex + moment / volume
}
