//! Walking a geodesic through the cells, in f64. Twin: `shaders/stage/walk.glsl`.
//!
//! A path alternates between two steps. [`stage_segment`] finds how far the geodesic goes before it leaves the
//! cell (or the arc's tolerance, or its largest length) and gives the segment of the chart to traversal;
//! if that meets nothing, [`stage_transport`] moves the state to the segment's end and, at a face, applies the
//! pairing to point and velocity.

use super::domain::Domain;
use crate::{
    geometry::{Geodesic, Geometry, ON_FACE, Segment},
    shader_io::{FACE_MARGIN, NONE, REDUCE_LIMIT, STRIDE},
};

/// Where a segment ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// At the face with this index in the domain's list.
    Face(usize),
    /// Inside the cell, where the next arc begins.
    Arc,
    /// Where the path ends.
    Limit,
}

/// Whether a path goes on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// It goes on.
    Flying,
    /// It hit something.
    Hit,
    /// It reached its largest length or its last bounce.
    Gone,
    /// No pairing brings it back into the domain. Does not happen in a sound space.
    Lost,
}

/// State of a ray between two segments.
#[derive(Clone, Copy, Debug)]
pub struct Path {
    /// Where the current segment starts, in the cell's coordinates.
    pub state: Geodesic,
    /// Geodesic length from the source to the state.
    pub travelled: f64,
    /// Geodesic length at which the path ends; may be infinite.
    pub limit: f64,
    /// Curve parameter of the segment's end.
    pub u_end: f64,
    /// The state there.
    pub ahead: Geodesic,
    /// What is there.
    pub end: End,
    /// Index of the cell.
    pub cell: usize,
    /// Faces passed.
    pub bounces: u32,
    /// Segments begun.
    pub segments: u32,
    /// Deck element of the cell; [`NONE`] beyond the table.
    pub label: u32,
    /// Whether it goes on.
    pub status: Status,
}

/// f64 counterpart of `shader_io::OVERLAP`: segments reach this far beyond both ends, in chart units.
const OVERLAP: f64 = 1e-12;

impl Path {
    /// A path that starts with `state` in `cell` and ends after length `limit`.
    pub fn new(state: Geodesic, cell: usize, limit: f64) -> Self {
        Self {
            state,
            travelled: 0.0,
            limit,
            u_end: 0.0,
            ahead: state,
            end: End::Limit,
            cell,
            bounces: 0,
            segments: 0,
            label: 0,
            status: Status::Flying,
        }
    }

    fn cross<G: Geometry>(&mut self, geometry: G, domain: &Domain, from: Geodesic, face: usize) {
        let passed = &domain.faces[face];
        self.state = geometry.restore(geometry.cross(&passed.folded, passed.plane, from));
        self.pass(domain, face);
    }

    /// Notes that the path has passed a face.
    pub(super) fn pass(&mut self, domain: &Domain, face: usize) {
        self.bounces += 1;
        self.cell = domain.faces[face].cell;
        if self.label != NONE && !domain.labels.is_empty() {
            self.label = domain.labels[self.label as usize * domain.faces.len() + face];
        }
    }
}

/// How segments follow curves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Follow {
    /// Largest deviation, as an angle seen from the source of the ray ([`deviation_at`]).
    pub tolerance: f64,
}

impl Follow {
    /// Exactly, in segments that only the geometry limits: for walks that meet nothing.
    pub const EXACTLY: Self = Self { tolerance: f64::INFINITY };

    /// Largest deviation of the path's next segment, a length.
    fn deviation(self, path: &Path) -> f64 {
        deviation_at(path.travelled, self.tolerance)
    }
}

/// Largest deviation of an arc from its curve, a length, for an arc that begins at distance `travelled` from the source and
/// a tolerance that is an angle ε seen from there.
///
/// The angle allows ε·travelled far from the source. At the source an arc of length h with third derivative K has the
/// wrong direction by K h²/12, which is ε for h = √(12 ε/K), and there its deviation of K h³/125 is ε^(3/2)/(3 √K). The
/// model geometries have third derivatives of order 1, and so the sum of both serves at any distance. It depends on nothing
/// but the way from the source: faces that cut the path do not change it. Shadow rays have their source on the surface that
/// they leave, where a looser arc would meet that surface again.
pub fn deviation_at(travelled: f64, tolerance: f64) -> f64 {
    tolerance * (travelled + tolerance.sqrt() / 3.0)
}

/// The faces of a cell are asked in lots of so many: first all of them, then which comes first, because of tests one by one
/// the processor guesses half of the outcomes wrong.
const FACES_AT_ONCE: usize = 16;

/// Finds the end of the segment that starts at the path's state, and brings a state that rounding has left outside
/// of its cell (at an edge or a corner) back first. At most `bounces` faces are passed; each is reported to
/// `crossed`. `None`: the path has ended.
pub fn stage_segment<G: Geometry>(
    geometry: G,
    domain: &Domain,
    path: &mut Path,
    bounces: u32,
    follow: Follow,
    mut crossed: impl FnMut(usize),
) -> Option<Segment> {
    let first = path.segments == 0;
    let mut attempt = 0;
    let (mut u, mut ahead) = loop {
        let (mut u, ahead) = reach(geometry, path, follow);
        let cell = domain.cells[path.cell].clone();
        let margin = f64::from(FACE_MARGIN) * follow.deviation(path);
        let mut worst = ON_FACE;
        for (chunk, first) in domain.faces[cell.clone()].chunks(FACES_AT_ONCE).zip(cell.clone().step_by(FACES_AT_ONCE))
        {
            let mut exits = [f64::INFINITY; FACES_AT_ONCE];
            let exits = &mut exits[..chunk.len()];
            for (exit, face) in exits.iter_mut().zip(chunk) {
                let side = geometry.side(path.state.point, face.plane);
                worst = if side > worst { side } else { worst };
                // Most faces are far from the segment.
                if !ahead.is_some_and(|(segment, _)| segment.highest(face.plane) < -margin) {
                    *exit = geometry.exit(path.state, face.plane, u);
                }
            }
            let least = exits.iter().fold(u, |least, exit| if *exit < least { *exit } else { least });
            if let Some(face) = exits.iter().position(|exit| *exit == least && *exit < u) {
                path.end = End::Face(first + face);
            }
            u = least;
        }
        if worst <= ON_FACE {
            break (u, ahead);
        }
        let side = |face: &usize| geometry.side(path.state.point, domain.faces[*face].plane);
        let Some(face) = cell.rev().max_by(|a, b| side(a).total_cmp(&side(b))) else { break (u, ahead) };
        if attempt == REDUCE_LIMIT {
            path.status = Status::Lost;
            return None;
        }
        if path.bounces == bounces {
            path.status = Status::Gone;
            return None;
        }
        path.cross(geometry, domain, path.state, face);
        crossed(face);
        attempt += 1;
    };
    // A geodesic that meets no face and has no limit ends here: only an unbounded cell lets it. One with a limit that
    // the curve parameter does not reach goes there in strides.
    if u.is_infinite() {
        if path.limit.is_infinite() {
            path.status = Status::Gone;
            return None;
        }
        u = geometry.parameter_at(path.state, STRIDE.into());
        path.end = End::Arc;
    }
    if matches!(path.end, End::Face(_)) {
        ahead = None;
    }
    let (segment, end) = ahead.unwrap_or_else(|| Segment::along(geometry, path.state, u));
    path.ahead = end;
    path.u_end = u;
    path.segments += 1;
    let slack = OVERLAP / segment.direction.length().max(1e-9);
    Some(segment.extended(if first { 0.0 } else { slack }, slack))
}

/// How far the next segment reaches if no face ends it, with that segment where it is an arc.
fn reach<G: Geometry>(geometry: G, path: &mut Path, follow: Follow) -> (f64, Option<(Segment, Geodesic)>) {
    let rest = geometry.parameter_at(path.state, path.limit - path.travelled);
    let mut u = geometry.arc(path.state, rest, follow.deviation(path));
    path.end = if u < rest { End::Arc } else { End::Limit };
    if G::STRAIGHT || follow.tolerance.is_infinite() {
        return (u, None);
    }
    let stride = geometry.parameter_at(path.state, STRIDE.into());
    if stride < u {
        (u, path.end) = (stride, End::Arc);
    }
    (u, Some(Segment::along(geometry, path.state, u)))
}

/// The miss stage: the segment met nothing, so the geodesic moves on to its end and through the face there, which
/// is reported to `crossed`.
pub fn stage_transport<G: Geometry>(
    geometry: G,
    domain: &Domain,
    path: &mut Path,
    bounces: u32,
    mut crossed: impl FnMut(usize),
) {
    path.travelled += geometry.length(path.state, path.u_end);
    let state = path.ahead;
    match path.end {
        End::Arc => path.state = geometry.restore(state),
        End::Face(face) if path.bounces < bounces => {
            path.cross(geometry, domain, state, face);
            crossed(face);
        }
        End::Face(_) | End::Limit => {
            path.state = state;
            path.status = Status::Gone;
        }
    }
}
