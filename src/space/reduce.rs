//! Points and frames brought into their cell, and geodesics followed through the faces.

use super::{
    Space,
    domain::Domain,
    observer::Frame,
    walk::{Follow, Path, Status, stage_segment, stage_transport},
};
use crate::{
    geometry::{Geodesic, Geometry, ON_FACE, Visitor, visit},
    shader_io::REDUCE_LIMIT,
};
use glam::DVec4;

/// Slack for points that users give: six digits are enough to name a point on a face.
const GIVEN_ON_FACE: f64 = 1e-6;

/// Whether a point given by a user lies in a cell.
pub fn is_inside(space: &Space, cell: usize, point: DVec4) -> bool {
    struct Inside<'a>(&'a Space, usize, DVec4);
    impl Visitor for Inside<'_> {
        type Output = bool;
        fn visit<G: Geometry>(self, geometry: G) -> bool {
            let Self(space, cell, point) = self;
            space.cells[cell].faces.iter().all(|face| geometry.side(point, face.plane) <= GIVEN_ON_FACE)
        }
    }
    visit(space.geometry, Inside(space, cell, point))
}

/// The face that a point violates most, if it is outside of the cell.
pub fn violated_face<G: Geometry>(geometry: G, domain: &Domain, cell: usize, point: DVec4) -> Option<usize> {
    let sides = domain.cells[cell].clone().map(|face| (geometry.side(point, domain.faces[face].plane), face));
    sides.filter(|(side, _)| *side > ON_FACE).max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, face)| face)
}

/// The frame carried by pairings until its point lies in its cell, or `None` if [`REDUCE_LIMIT`] pairings do not
/// suffice.
pub fn reduce_frame<G: Geometry>(geometry: G, domain: &Domain, frame: Frame) -> Option<Frame> {
    let mut frame = frame;
    for _ in 0..=REDUCE_LIMIT {
        let Some(face) = violated_face(geometry, domain, frame.cell, frame.point) else { return Some(frame) };
        let passed = &domain.faces[face];
        let carry = |velocity| geometry.apply(&passed.pairing, Geodesic { point: frame.point, velocity });
        let axes = frame.axes.map(|axis| carry(axis).velocity);
        let point = carry(frame.axes[0]).point;
        frame = Frame { cell: passed.cell, point, axes };
    }
    None
}

/// Where a geodesic of the quotient has come to.
#[derive(Clone, Debug)]
pub struct Arrival {
    /// State in the coordinates of `cell`.
    pub state: Geodesic,
    /// Index of the cell.
    pub cell: usize,
    /// Faces crossed, as indices into the domain's list.
    pub faces: Vec<usize>,
}

/// Why a geodesic of the quotient could not be followed.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum TransportError {
    /// More faces than anybody wants to have listed.
    #[error("the geodesic crosses more than {0} faces")]
    TooManyFaces(u32),
    /// The gluing is not sound.
    #[error("the geodesic left the domain after length {0} and no pairing brings it back")]
    Lost(f64),
}

/// Most faces that [`transport`] crosses.
pub const MAX_FACES: u32 = 10_000_000;

/// Follows the geodesic from `start` in `cell` by arc length `length` (any sign) through the faces.
///
/// # Errors
/// [`TransportError`].
pub fn transport<G: Geometry>(
    geometry: G,
    domain: &Domain,
    start: Geodesic,
    cell: usize,
    length: f64,
) -> Result<Arrival, TransportError> {
    carry(geometry, domain, start, cell, length, &mut [])
}

/// The same, with tangent vectors at the start carried along by parallel transport.
///
/// # Errors
/// [`TransportError`]; the vectors are then of no use.
pub fn carry<G: Geometry>(
    geometry: G,
    domain: &Domain,
    start: Geodesic,
    cell: usize,
    length: f64,
    vectors: &mut [DVec4],
) -> Result<Arrival, TransportError> {
    // A negative length is a walk against the direction.
    let sign = if length < 0.0 { -1.0 } else { 1.0 };
    let start = Geodesic { point: start.point, velocity: start.velocity * sign };
    let mut path = Path::new(start, cell, length.abs());
    let mut faces = Vec::new();
    while path.status == Status::Flying {
        let (before, known) = (path.state.point, faces.len());
        let segment = stage_segment(geometry, domain, &mut path, MAX_FACES, Follow::EXACTLY, |face| faces.push(face));
        pass(geometry, domain, &faces[known..], before, vectors);
        if segment.is_none() {
            break;
        }
        let (from, passed) = (path.state, geometry.length(path.state, path.u_end));
        vectors.iter_mut().for_each(|v| *v = geometry.transport(from, passed, *v));
        let (end, known) = (path.ahead.point, faces.len());
        stage_transport(geometry, domain, &mut path, MAX_FACES, |face| faces.push(face));
        pass(geometry, domain, &faces[known..], end, vectors);
    }
    match path.status {
        Status::Lost => Err(TransportError::Lost(path.travelled)),
        _ if path.bounces >= MAX_FACES => Err(TransportError::TooManyFaces(MAX_FACES)),
        _ => {
            let state = Geodesic { point: path.state.point, velocity: path.state.velocity * sign };
            Ok(Arrival { state, cell: path.cell, faces })
        }
    }
}

/// Takes tangent vectors at a point through faces, one after the other.
fn pass<G: Geometry>(geometry: G, domain: &Domain, faces: &[usize], mut point: DVec4, vectors: &mut [DVec4]) {
    for &face in faces {
        let passed = &domain.faces[face];
        let image = |velocity| geometry.cross(&passed.folded, passed.plane, Geodesic { point, velocity });
        vectors.iter_mut().for_each(|v| *v = image(*v).velocity);
        point = image(DVec4::ZERO).point;
    }
}
