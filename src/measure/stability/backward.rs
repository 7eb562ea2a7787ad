//! How far off a ray is after k faces: forward, and backward in pixels.
//!
//! Forward: the ray's point, unfolded into the coordinates of its start by the pairings that it passed, against the end of
//! the geodesic in 192 bits. In hyperbolic spaces this grows like eᵗ and says nothing about a picture: a pixel's footprint
//! grows as fast. Backward: the angle by which the ray's direction would have to move for the geodesic to reach exactly the
//! computed point, in pixels of a picture of 60° and 1000 lines.

use super::{Bench, Case, Family, NUMBERS, On, Reading, Trouble, geodesic::Start, walk};
use crate::{
    geometry::{Geodesic, Geometry, GeometryId, Visitor, across, visit},
    measure::reference::{Big, Big4, Model, distance, model},
    space::{Space, domain::Domain, walk::Path},
};
use glam::{DMat3, DVec3, DVec4};
use rayon::prelude::*;

/// Angle of a pixel.
const PIXEL: f64 = std::f64::consts::FRAC_PI_3 / 1000.0;

/// Rays of a case.
const RAYS: usize = 16;

/// Pixels that a ray may be off backwards, in single and double precision.
const BACKWARD: [f64; 2] = [0.1, 1e-8];

/// Floors that it may be off forwards, for each face.
const FORWARD: f64 = 20.0;

pub(super) fn cases() -> Vec<Case> {
    let backward = Family { name: "backward", quantity: "pixels that the direction must move, worst ray", on: NUMBERS };
    let forward = Family { name: "forward", quantity: "unfolded point off, worst ray in floors", on: NUMBERS };
    let mut cases = Vec::new();
    for space in walk::closed_spaces() {
        for faces in [1, 4, 8, 14, 20] {
            let space = space.clone();
            let what = format!("after {faces} faces");
            cases.push(backward.case(&space.name.clone(), what, move |bench, on| in_pixels(bench, on, &space, faces)));
        }
        for faces in [1, 8, 20] {
            let space = space.clone();
            let what = format!("after {faces} faces");
            cases.push(forward.case(&space.name.clone(), what, move |bench, on| in_floors(bench, on, &space, faces)));
        }
    }
    cases
}

/// A ray, how long it is, and its point in the coordinates of the start.
#[derive(Clone, Copy)]
struct Unfolded {
    start: Geodesic,
    length: f64,
    end: Geodesic,
}

/// Rays walked through so many faces.
fn unfolded(bench: &mut Bench, on: On, space: &Space, faces: u32) -> Result<Vec<Unfolded>, Trouble> {
    struct Rays<'a>(&'a Space);
    impl Visitor for Rays<'_> {
        type Output = Vec<(usize, Geodesic)>;
        fn visit<G: Geometry>(self, geometry: G) -> Self::Output {
            walk::rays(geometry, self.0, RAYS, 2022)
        }
    }
    struct Walked<'a>(&'a Domain, usize, Geodesic, u32);
    impl Visitor for Walked<'_> {
        type Output = Option<(Vec<usize>, f64, Geodesic)>;
        fn visit<G: Geometry>(self, geometry: G) -> Self::Output {
            let Self(domain, cell, ray, faces) = self;
            let mut path = Path::new(ray, cell, f64::INFINITY);
            let mut passed = Vec::new();
            let whole = walk::until(geometry, domain, &mut path, faces, |face| passed.push(face));
            whole.then_some((passed, path.travelled, path.state))
        }
    }
    struct Unfold<'a>(&'a Domain, &'a [usize], Geodesic);
    impl Visitor for Unfold<'_> {
        type Output = Geodesic;
        fn visit<G: Geometry>(self, geometry: G) -> Geodesic {
            // One after the other, backwards: of a product of all little would be left where it cancels.
            self.1
                .iter()
                .rev()
                .fold(self.2, |state, face| geometry.apply(&geometry.inverse(&self.0.faces[*face].pairing), state))
        }
    }
    let lost = || Trouble(String::from("a ray is lost"));
    let domain = Domain::new(space);
    let rays = visit(space.geometry, Rays(space));
    let ends: Vec<(Vec<usize>, f64, Geodesic)> = match on {
        On::Cpu => {
            let walked = rays.iter().map(|(cell, ray)| visit(space.geometry, Walked(&domain, *cell, *ray, faces)));
            walked.collect::<Option<_>>().ok_or_else(lost)?
        }
        _ => {
            let mut walks: Vec<_> = rays.iter().map(|(cell, ray)| walk::walk(*cell, *ray, faces)).collect();
            let passed = bench.walk(&space.name, space.geometry, &domain, &mut walks, 128)?;
            if walks.iter().any(|walk| walk.lost > 0) {
                return Err(lost());
            }
            let list = |faces: Vec<u32>| faces.into_iter().map(|face| face as usize).collect();
            let ends = walks.iter().zip(passed);
            ends.map(|(walk, faces)| (list(faces), f64::from(walk.travelled), walk::state(walk))).collect()
        }
    };
    Ok(rays
        .iter()
        .zip(ends)
        .map(|((_, start), (faces, length, end))| {
            let end = visit(space.geometry, Unfold(&domain, &faces, end));
            Unfolded { start: *start, length, end }
        })
        .collect())
}

fn worst(numbers: impl Iterator<Item = f64>) -> f64 {
    numbers.fold(0.0, |worst: f64, x| if x.is_nan() || x > worst { x } else { worst })
}

fn in_pixels(bench: &mut Bench, on: On, space: &Space, faces: u32) -> Result<Reading, Trouble> {
    let model = model(space.geometry).ok_or_else(|| Trouble(String::from("no reference")))?;
    let rays = unfolded(bench, on, space, faces)?;
    let turns: Vec<f64> = rays.par_iter().map(|ray| turn(model, space.geometry, ray)).collect();
    let limit = BACKWARD[usize::from(on == On::Cpu)];
    Ok(Reading { floor: on.rounding() / PIXEL, ..Reading::new(worst(turns.into_iter()) / PIXEL, limit) })
}

/// Angle between the ray's direction and that of the geodesic to its computed point: how the exact end moves with the
/// direction and the length, from differences of the reference, solved for the way from the exact end to the computed one.
/// Coordinates that grow like e^t are taken relative to their size.
fn turn(model: &dyn Model, id: GeometryId, ray: &Unfolded) -> f64 {
    /// Two directions across the ray.
    struct Across(Geodesic);
    impl Visitor for Across {
        type Output = [DVec4; 2];
        fn visit<G: Geometry>(self, geometry: G) -> [DVec4; 2] {
            across(geometry, self.0)
        }
    }
    const STEP: f64 = 1e-6;
    let count = model.components()[0];
    let end = |velocity: DVec4, length: f64| {
        let start = model.settle(ray.start.point.to_array(), velocity.to_array());
        model.flow(&start, &Big::new(length)).point
    };
    let exact = end(ray.start.velocity, ray.length);
    let scale = |i: usize| exact[i].to_f64().abs().max(1.0);
    let relative = |p: &Big4| -> DVec4 {
        let number = |i: usize| if i < count { (&p[i] - &exact[i]).to_f64() / scale(i) } else { 0.0 };
        DVec4::from_array(std::array::from_fn(number))
    };
    let off = relative(&ray.end.point.to_array().map(Big::new));
    let [u, v] = visit(id, Across(ray.start)).map(|w| relative(&end(ray.start.velocity + w * STEP, ray.length)) / STEP);
    let along = relative(&end(ray.start.velocity, ray.length + STEP)) / STEP;
    let columns = [u, v, along];
    let product = |a: DVec4| DVec3::from_array(columns.map(|column| column.dot(a)));
    let solved = DMat3::from_cols(product(u), product(v), product(along)).inverse() * product(off);
    solved.truncate().length()
}

fn in_floors(bench: &mut Bench, on: On, space: &Space, faces: u32) -> Result<Reading, Trouble> {
    let model = model(space.geometry).ok_or_else(|| Trouble(String::from("no reference")))?;
    let rays = unfolded(bench, on, space, faces)?;
    let readings: Vec<(f64, f64)> = rays
        .par_iter()
        .map(|ray| {
            let start = Start {
                from: ray.start.point.to_array(),
                direction: ray.start.velocity.to_array(),
                length: ray.length,
            };
            let exact = model.flow(&model.settle(start.from, start.direction), &Big::new(start.length));
            let error = distance(&exact.point, &ray.end.point.to_array()[..model.components()[0]]);
            (error, start.floor(model, &exact, on)[0])
        })
        .collect();
    let error = worst(readings.iter().map(|(error, floor)| error / floor));
    // Pairings are inputs too, rounded in their largest entries.
    let entries = space.faces().flat_map(|(_, face)| face.pairing.linear.to_cols_array());
    let floor = entries.fold(1.0, |most: f64, entry| most.max(entry.abs()));
    Ok(Reading { floor, ..Reading::new(error, FORWARD * floor * f64::from(faces + 1)) })
}
