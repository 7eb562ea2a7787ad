//! Rays that are hard on the tests of faces: through edges and corners exactly, along faces and edges, and from them.
//! None is lost, none loops, none stops early.

use super::{Bench, Case, Family, NUMBERS, On, Random, Reading, Trouble, walk};
use crate::{
    geometry::{Geodesic, Geometry, Visitor, visit},
    space::{Space, domain::Domain, polyhedron::Polyhedron, reduce::violated_face, walk::Path},
};
use glam::DVec3;
use rayon::prelude::*;

/// Rays of each kind and space.
const RAYS: usize = 256;
/// Faces that each must pass.
const BOUNCES: u32 = 40;

#[derive(Clone, Copy, Debug)]
enum Kind {
    ThroughEdge,
    ThroughCorner,
    AlongFace,
    AlongEdge,
    FromFace,
    FromEdge,
    FromCorner,
}

const KINDS: [(Kind, &str); 7] = [
    (Kind::ThroughEdge, "through edges"),
    (Kind::ThroughCorner, "through corners"),
    (Kind::AlongFace, "along faces"),
    (Kind::AlongEdge, "along edges"),
    (Kind::FromFace, "from faces"),
    (Kind::FromEdge, "from edges"),
    (Kind::FromCorner, "from corners"),
];

pub(super) fn cases() -> Vec<Case> {
    let family = Family { name: "corner", quantity: "rays lost, stopped or left outside", on: NUMBERS };
    let mut cases = Vec::new();
    for space in walk::closed_spaces() {
        for (kind, what) in KINDS {
            let space = space.clone();
            cases.push(family.case(&space.name.clone(), what, move |bench, on| judge(bench, on, &space, kind)));
        }
    }
    cases
}

fn judge(bench: &mut Bench, on: On, space: &Space, kind: Kind) -> Result<Reading, Trouble> {
    let domain = Domain::new(space);
    let starts = visit(space.geometry, Starts(space, kind));
    if starts.len() < RAYS / 2 {
        return Err(Trouble(format!("only {} rays", starts.len())));
    }
    let bad = match on {
        On::Cpu => visit(space.geometry, Follow(&domain, &starts)),
        _ => {
            let mut walks: Vec<_> = starts.iter().map(|ray| walk::walk(0, *ray, BOUNCES)).collect();
            bench.walk(&space.name, space.geometry, &domain, &mut walks, 0)?;
            let ended: Vec<_> = walks
                .iter()
                .map(|walk| (walk::state(walk), walk.cell as usize, walk.lost == 0 && walk.bounces >= BOUNCES))
                .collect();
            visit(space.geometry, Inside(&domain, &ended))
        }
    };
    Ok(Reading::new(bad as f64, 0.0))
}

struct Starts<'a>(&'a Space, Kind);

impl Visitor for Starts<'_> {
    type Output = Vec<Geodesic>;
    fn visit<G: Geometry>(self, geometry: G) -> Vec<Geodesic> {
        let Self(space, kind) = self;
        let Ok(cell) = Polyhedron::new(&space.cells[0]) else { return Vec::new() };
        let mut random = Random(1904);
        (0..RAYS)
            .filter_map(|number| {
                let edge = &cell.edges[number % cell.edges.len()];
                let [a, b] = edge.vertices.map(|v| cell.vertices[v]);
                let on_edge = a.lerp(b, random.next());
                let corner = cell.vertices[number % cell.vertices.len()];
                let outline = &cell.face_vertices[number % cell.face_vertices.len()];
                let mut on_face = || {
                    let weights: Vec<f64> = outline.iter().map(|_| random.next() + 0.01).collect();
                    let sum: f64 = weights.iter().sum();
                    outline.iter().zip(&weights).map(|(v, w)| cell.vertices[*v] * (w / sum)).sum::<DVec3>()
                };
                let (p, q) = (on_face(), on_face());
                let inside = cell.centroid.lerp(p, 0.7 * random.next());
                let (start, target) = match kind {
                    Kind::ThroughEdge => (inside, on_edge),
                    Kind::ThroughCorner => (inside, corner),
                    Kind::AlongFace => (p, q),
                    Kind::AlongEdge => (on_edge, b),
                    Kind::FromFace => (p, inside),
                    Kind::FromEdge => (on_edge, inside),
                    Kind::FromCorner => (corner, inside),
                };
                let point = geometry.unchart(start)?;
                let (velocity, distance) = geometry.log(point, geometry.unchart(target)?);
                (distance > 1e-6).then_some(Geodesic { point, velocity })
            })
            .collect()
    }
}

/// Follows rays on the host and counts the bad ones.
struct Follow<'a>(&'a Domain, &'a [Geodesic]);

impl Visitor for Follow<'_> {
    type Output = usize;
    fn visit<G: Geometry>(self, geometry: G) -> usize {
        let Self(domain, starts) = self;
        let ended: Vec<_> = starts
            .par_iter()
            .map(|start| {
                let mut path = Path::new(*start, 0, f64::INFINITY);
                let whole = walk::until(geometry, domain, &mut path, BOUNCES, |_| ());
                (path.state, path.cell, whole)
            })
            .collect();
        Inside(domain, &ended).visit(geometry)
    }
}

/// Counts the states that are not finite, did not get so far, or that the pairings do not bring into their cell at once: a
/// face may take a state to a part of its partner's plane that is outside, and the next segment begins by bringing it in.
struct Inside<'a>(&'a Domain, &'a [(Geodesic, usize, bool)]);

impl Visitor for Inside<'_> {
    type Output = usize;
    fn visit<G: Geometry>(self, geometry: G) -> usize {
        let Self(domain, ended) = self;
        let bad = |(state, cell, whole): &&(Geodesic, usize, bool)| {
            let (mut state, mut cell) = (*state, *cell);
            for _ in 0..8 {
                let Some(face) = violated_face(geometry, domain, cell, state.point) else { break };
                let passed = &domain.faces[face];
                (state, cell) = (geometry.apply(&passed.pairing, state), passed.cell);
            }
            let sides = domain.cells[cell].clone().map(|face| geometry.side(state.point, domain.faces[face].plane));
            let outside = sides.fold(0.0, f64::max);
            !(*whole && state.point.is_finite() && state.velocity.is_finite() && outside < 1e-5)
        };
        ended.iter().filter(bad).count()
    }
}
