//! A thousand to a hundred thousand faces in one ray, in every closed space: what is left of its point and direction.
//!
//! A point drifts off its model and a direction off its length by the rounding of each face. How far is told by the
//! reference: the nearest point of the model and unit tangent vector there, in 192 bits, after every 250th face.

use super::{Bench, Case, Family, NUMBERS, On, Random, Reading, Trouble};
use crate::{
    geometry::{Geodesic, Geometry, Visitor, visit},
    measure::reference::{Big4, distance, model},
    shader_io::Walk,
    space::{
        Space, catalogue,
        domain::Domain,
        polyhedron::Polyhedron,
        walk::{Follow, Path, Status, stage_segment, stage_transport},
    },
};
use glam::{DVec3, DVec4, Vec4};
use rayon::prelude::*;

/// Tolerance of arcs: half of a pixel's angle in a picture of 1000 lines.
pub(super) const TOLERANCE: f64 = 5e-4;

/// Nothing is met on the way, so only the tolerance ends segments.
const FOLLOW: Follow = Follow { tolerance: TOLERANCE };

/// Rays of a walk.
const RAYS: usize = 16;

/// Faces between two looks at the drift. From each look on lengths are counted anew: with the length the tolerance of arcs
/// grows, and pictures do not reach so far.
const LOOK: u32 = 250;

pub(super) fn cases() -> Vec<Case> {
    let family =
        Family { name: "walk", quantity: "off the model, or direction off unit tangent, relative", on: NUMBERS };
    let mut cases = Vec::new();
    for space in closed_spaces() {
        for (what, bounces) in [("1,000 faces", 1_000), ("10,000 faces", 10_000), ("100,000 faces", 100_000)] {
            let space = space.clone();
            cases.push(family.case(&space.name.clone(), what, move |bench, on| {
                let limit = if on == On::Cpu { 1e-13 } else { 1e-5 };
                Ok(Reading { floor: on.rounding(), ..Reading::new(drift(bench, on, &space, bounces)?, limit) })
            }));
        }
    }
    cases
}

/// The spaces of the catalogue whose cells are bounded.
pub(super) fn closed_spaces() -> impl Iterator<Item = Space> {
    let spaces = catalogue::NAMES.iter().filter_map(|name| catalogue::find(name));
    spaces.filter(|space| space.cells.iter().all(|cell| Polyhedron::new(cell).is_ok()))
}

/// Rays from around the centres of the cells, in all directions.
pub(super) fn rays<G: Geometry>(geometry: G, space: &Space, count: usize, seed: u64) -> Vec<(usize, Geodesic)> {
    let mut random = Random(seed);
    let centres: Vec<DVec3> =
        space.cells.iter().map(|cell| Polyhedron::new(cell).map_or(DVec3::ZERO, |p| p.centroid)).collect();
    (0..count)
        .filter_map(|number| {
            let cell = number % centres.len();
            let point = geometry.unchart(centres[cell] + random.vector(0.1))?;
            let [x, y, z] = geometry.frame(point);
            let v = random.direction();
            Some((cell, Geodesic { point, velocity: x * v.x + y * v.y + z * v.z }))
        })
        .collect()
}

/// Walks until so many faces are passed and the next is reached, or the path ends otherwise.
pub(super) fn to_the_end<G: Geometry>(geometry: G, domain: &Domain, path: &mut Path, bounces: u32) {
    while path.status == Status::Flying {
        if stage_segment(geometry, domain, path, bounces, FOLLOW, |_| ()).is_some() {
            stage_transport(geometry, domain, path, bounces, |_| ());
        }
    }
}

/// Walks until so many faces are passed, and no further; `false` if the path ends before.
pub(super) fn until<G: Geometry>(
    geometry: G,
    domain: &Domain,
    path: &mut Path,
    bounces: u32,
    mut crossed: impl FnMut(usize),
) -> bool {
    let most = path.segments.saturating_add(crate::shader_io::SEGMENTS_PER_BOUNCE.saturating_mul(bounces));
    while path.status == Status::Flying && path.bounces < bounces && path.segments < most {
        if stage_segment(geometry, domain, path, u32::MAX, FOLLOW, &mut crossed).is_some() {
            stage_transport(geometry, domain, path, u32::MAX, &mut crossed);
        }
    }
    path.status == Status::Flying && path.bounces >= bounces
}

/// A ray for the device.
pub(super) fn walk(cell: usize, g: Geodesic, until: u32) -> Walk {
    Walk {
        point: g.point.as_vec4().to_array(),
        velocity: g.velocity.as_vec4().to_array(),
        cell: cell as u32,
        until,
        ..Walk::default()
    }
}

/// Where it is.
pub(super) fn state(walk: &Walk) -> Geodesic {
    let double = |v: [f32; 4]| Vec4::from(v).as_dvec4();
    Geodesic { point: double(walk.point), velocity: double(walk.velocity) }
}

/// Largest distance of the rays from the model.
fn drift(bench: &mut Bench, on: On, space: &Space, bounces: u32) -> Result<f64, Trouble> {
    struct Looks<'a>(&'a Space, u32);
    impl Visitor for Looks<'_> {
        /// States at the looks, or nothing where a ray is lost.
        type Output = Option<Vec<Geodesic>>;
        fn visit<G: Geometry>(self, geometry: G) -> Self::Output {
            let Self(space, bounces) = self;
            let domain = Domain::new(space);
            let seen: Option<Vec<Vec<Geodesic>>> = rays(geometry, space, RAYS, 31)
                .into_par_iter()
                .map(|(cell, start)| {
                    let mut path = Path::new(start, cell, f64::INFINITY);
                    let mut looks = Vec::new();
                    for look in (LOOK..=bounces).step_by(LOOK as usize) {
                        until(geometry, &domain, &mut path, look, |_| ()).then_some(())?;
                        looks.push(path.state);
                        path.travelled = 0.0;
                    }
                    Some(looks)
                })
                .collect();
            seen.map(|rays| rays.concat())
        }
    }
    let lost = || Trouble(String::from("a ray is lost"));
    let states = match on {
        On::Cpu => visit(space.geometry, Looks(space, bounces)).ok_or_else(lost)?,
        _ => {
            let domain = Domain::new(space);
            let mut walks = visit(space.geometry, Walks { space, rays: RAYS, seed: 31 });
            let mut states = Vec::new();
            for look in (LOOK..=bounces).step_by(LOOK as usize) {
                walks.iter_mut().for_each(|walk| walk.until = look);
                bench.walk(&space.name, space.geometry, &domain, &mut walks, 0)?;
                if walks.iter().any(|walk| walk.lost > 0 || walk.bounces < look) {
                    return Err(lost());
                }
                states.extend(walks.iter().map(state));
                walks.iter_mut().for_each(|walk| walk.travelled = 0.0);
            }
            states
        }
    };
    let model = model(space.geometry).ok_or_else(|| Trouble(String::from("no reference")))?;
    let off = states.par_iter().map(|state| {
        let [point, direction] = [state.point, state.velocity].map(|v: DVec4| v.to_array());
        let exact = model.settle(point, direction);
        let [points, directions] = model.components();
        // Relative to the coordinates: rounding of a vector whose entries are e^d moves it off the model by e^d as much.
        let off = |exact: &Big4, found: &[f64]| distance(exact, found) / distance(exact, &[0.0; 4]).max(1.0);
        off(&exact.point, &point[..points]).max(off(&exact.direction, &direction[..directions]))
    });
    // The largest, and no number if one is none.
    Ok(off.reduce(|| 0.0, |a, b| if a.is_nan() || a > b { a } else { b }))
}

/// Rays for the device.
pub(super) struct Walks<'a> {
    pub space: &'a Space,
    pub rays: usize,
    pub seed: u64,
}

impl Visitor for Walks<'_> {
    type Output = Vec<Walk>;
    fn visit<G: Geometry>(self, geometry: G) -> Vec<Walk> {
        let Self { space, rays: count, seed } = self;
        rays(geometry, space, count, seed).into_iter().map(|(cell, g)| walk(cell, g, 0)).collect()
    }
}
