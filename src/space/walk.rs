//! Walking a geodesic through the cells, in f64. Twin: `shaders/stage/walk.glsl`.
//!
//! A path alternates between two steps. [`stage_segment`] finds how far the geodesic goes before it leaves the
//! cell (or the chord's tolerance, or its largest length) and gives the straight piece of the chart to traversal;
//! if that meets nothing, [`stage_transport`] moves the state to the segment's end and, at a face, applies the
//! pairing to point and velocity.

use super::domain::Domain;
use crate::{
    geometry::{Geodesic, Geometry, ON_FACE},
    shader_io::{NONE, REDUCE_LIMIT, STRIDE},
};
use glam::DVec3;

/// Where a segment ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// At the face with this index in the domain's list.
    Face(usize),
    /// Inside the cell, where the next chord begins.
    Chord,
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

/// A straight piece of the chart, s in [0, 1].
#[derive(Clone, Copy, Debug)]
pub struct Segment {
    /// s = 0.
    pub origin: DVec3,
    /// From s = 0 to s = 1.
    pub direction: DVec3,
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

/// Largest deviation of a chord from its curve, a length, for a chord that begins at distance `travelled` from the
/// source and a tolerance that is an angle ε seen from there.
///
/// The angle allows ε (travelled + s) at s along the chord, and a curve of curvature κ leaves a chord of length h by
/// κ s (h − s) / 2 there. That stays within the angle up to the h with √(travelled + h) = √travelled + √(2ε/κ), whose
/// greatest deviation κh²/8 is ε·travelled far from the source and ε²/2κ at the source. The model geometries have
/// curvatures of order 1, and so the sum of both serves at any distance. It depends on nothing but the way from the
/// source: faces that cut the path do not change it. Shadow rays have their source on the surface that they leave, where
/// a looser chord would meet that surface again.
pub fn deviation_at(travelled: f64, tolerance: f64) -> f64 {
    tolerance * (travelled + 0.5 * tolerance)
}

/// Finds the end of the segment that starts at the path's state, and brings a state that rounding has left outside
/// of its cell (at an edge or a corner) back first. At most `bounces` faces are passed; each is reported to
/// `crossed`. `None`: the path has ended.
pub fn stage_segment<G: Geometry>(
    geometry: G,
    domain: &Domain,
    path: &mut Path,
    bounces: u32,
    chord_tolerance: f64,
    mut crossed: impl FnMut(usize),
) -> Option<Segment> {
    let first = path.segments == 0;
    let mut attempt = 0;
    let mut u = loop {
        let mut worst = ON_FACE;
        let mut violated = None;
        let mut u = f64::INFINITY;
        path.end = End::Limit;
        for face in domain.cells[path.cell].clone() {
            let plane = domain.faces[face].plane;
            let side = geometry.side(path.state.point, plane);
            if side > worst {
                worst = side;
                violated = Some(face);
            }
            let exit = geometry.exit(path.state, plane);
            if exit < u {
                u = exit;
                path.end = End::Face(face);
            }
        }
        let Some(face) = violated else { break u };
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
    let rest = geometry.parameter_at(path.state, path.limit - path.travelled);
    if rest < u {
        u = rest;
        path.end = End::Limit;
    }
    // A geodesic that meets no face and has no limit ends here: only an unbounded cell lets it. One with a limit that
    // the curve parameter does not reach goes there in strides.
    if u.is_infinite() {
        if path.limit.is_infinite() {
            path.status = Status::Gone;
            return None;
        }
        u = geometry.parameter_at(path.state, STRIDE.into());
        path.end = End::Chord;
    }
    let chord = geometry.chord(path.state, u, deviation_at(path.travelled, chord_tolerance));
    if chord < u {
        u = chord;
        path.end = End::Chord;
    }
    path.u_end = u;
    path.segments += 1;
    let origin = geometry.chart(path.state.point);
    let direction = geometry.chart(geometry.advance(path.state, u).point) - origin;
    let slack = OVERLAP / direction.length().max(1e-9);
    Some(if first {
        Segment { origin, direction: direction * (1.0 + slack) }
    } else {
        Segment { origin: origin - direction * slack, direction: direction * (1.0 + 2.0 * slack) }
    })
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
    let state = geometry.advance(path.state, path.u_end);
    match path.end {
        End::Chord => path.state = geometry.restore(state),
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
