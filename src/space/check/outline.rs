//! Outlines of parts of faces: polygons whose sides are images of straight pieces of the chart under isometries.

use super::image;
use crate::geometry::{Geometry, Isometry};
use glam::{DVec3, DVec4};

/// Pieces of a side between which it is taken to pass a plane, or to come near a point, at most once.
const PIECES: usize = 32;

/// Halvings of an interval until rounding is all that is left.
const HALVINGS: usize = 60;

/// Pieces of a side for the coarsest of the sums that [`area`] extrapolates from, and the number of such sums.
const FIRST_SUM: usize = 16;
const SUMS: usize = 5;

/// Sides, each beginning where the one before ends.
pub(super) type Outline = Vec<Side>;

/// The image of a straight piece of a chart.
#[derive(Clone, Copy)]
pub(super) struct Side {
    from: DVec3,
    to: DVec3,
    carried: Isometry,
}

impl Side {
    /// A straight piece.
    pub(super) fn straight(from: DVec3, to: DVec3) -> Self {
        Self { from, to, carried: Isometry::IDENTITY }
    }

    /// The point for a parameter from 0 to 1, in the chart; `None` where it is not in the chart.
    pub(super) fn at<G: Geometry>(&self, geometry: G, t: f64) -> Option<DVec3> {
        let point = geometry.unchart(self.from.lerp(self.to, t))?;
        Some(geometry.chart(image(geometry, &self.carried, point))).filter(|c| c.is_finite())
    }

    /// The piece between two parameters.
    fn piece(&self, from: f64, to: f64) -> Self {
        let at = |t: f64| if t == 1.0 { self.to } else { self.from.lerp(self.to, t) };
        Self { from: at(from), to: at(to), ..*self }
    }

    /// The parameter at which the side passes within `near` of a point, other than at its ends.
    pub(super) fn parameter<G: Geometry>(&self, geometry: G, c: DVec3, near: f64) -> Option<f64> {
        let distance = |t: f64| self.at(geometry, t).map_or(f64::INFINITY, |p| p.distance(c));
        let step = 1.0 / PIECES as f64;
        let nearest = (0..=PIECES).map(|i| step * i as f64).min_by(|a, b| distance(*a).total_cmp(&distance(*b)))?;
        let (mut low, mut high) = ((nearest - step).max(0.0), (nearest + step).min(1.0));
        // Golden sections; the distance has one minimum there.
        let share = 0.5 * (5.0_f64.sqrt() - 1.0);
        for _ in 0..2 * HALVINGS {
            let (a, b) = (high - share * (high - low), low + share * (high - low));
            if distance(a) < distance(b) {
                high = b;
            } else {
                low = a;
            }
        }
        let t = 0.5 * (low + high);
        let inside = [0.0, 1.0].iter().all(|end| self.at(geometry, *end).is_some_and(|p| p.distance(c) > near));
        (distance(t) <= near && inside).then_some(t)
    }
}

/// The image of an outline.
pub(super) fn carried<G: Geometry>(geometry: G, m: &Isometry, outline: &[Side]) -> Outline {
    let move_on = |side: &Side| Side { carried: geometry.compose(m, &side.carried), ..*side };
    outline.iter().map(move_on).collect()
}

/// Points all along an outline.
pub(super) fn samples<G: Geometry>(geometry: G, outline: &[Side]) -> Option<Vec<DVec3>> {
    let all = |side: &Side| (0..PIECES).map(|i| side.at(geometry, i as f64 / PIECES as f64)).collect::<Vec<_>>();
    outline.iter().flat_map(all).collect()
}

/// The part of an outline inside a plane; what is within `near` of the plane counts as inside. `None` where the outline
/// leaves the chart. A part that falls into several comes out with sides along the plane between them, and is found to be
/// wrong when areas or edges are compared.
pub(super) fn clipped<G: Geometry>(geometry: G, outline: &[Side], plane: DVec4, near: f64) -> Option<Outline> {
    let mut inside: Outline = Vec::with_capacity(outline.len() + 1);
    for side in outline {
        let form = |t: f64| side.at(geometry, t).map(|c| plane.dot(c.extend(1.0)));
        let parameters: Vec<f64> = (0..=PIECES).map(|i| i as f64 / PIECES as f64).collect();
        let forms = parameters.iter().map(|&t| form(t)).collect::<Option<Vec<f64>>>()?;
        // Where the side enters and leaves, in turns.
        let mut ends = Vec::new();
        if forms[0] <= near {
            ends.push(0.0);
        }
        for i in 0..PIECES {
            if (forms[i] <= near) == (forms[i + 1] <= near) {
                continue;
            }
            let (mut within, mut beyond) = (parameters[i], parameters[i + 1]);
            let mut last = forms[i];
            if forms[i] > near {
                (within, beyond, last) = (beyond, within, forms[i + 1]);
            }
            // A start on the plane, within what counts as on it, is the passage itself.
            if last < -near {
                for _ in 0..HALVINGS {
                    let middle = 0.5 * (within + beyond);
                    if form(middle)? <= 0.0 {
                        within = middle;
                    } else {
                        beyond = middle;
                    }
                }
            }
            ends.push(within);
        }
        if forms[PIECES] <= near {
            ends.push(1.0);
        }
        for pair in ends.chunks_exact(2) {
            let piece = side.piece(pair[0], pair[1]);
            if piece.at(geometry, 0.0)?.distance(piece.at(geometry, 1.0)?) > near {
                inside.push(piece);
            }
        }
    }
    // What was cut off is replaced by a straight line in the plane.
    let mut closed = Vec::with_capacity(inside.len() + 2);
    for (i, side) in inside.iter().enumerate() {
        closed.push(*side);
        let (end, start) = (side.at(geometry, 1.0)?, inside[(i + 1) % inside.len()].at(geometry, 0.0)?);
        if end.distance(start) > near {
            closed.push(Side::straight(end, start));
        }
    }
    Some(closed)
}

/// Area in the chart: sums over ever finer polygons, extrapolated (Romberg's method).
pub(super) fn area<G: Geometry>(geometry: G, outline: &[Side]) -> Option<f64> {
    let Some(origin) = outline.first() else { return Some(0.0) };
    let origin = origin.at(geometry, 0.0)?;
    let sum = |pieces: usize| {
        let mut sum = DVec3::ZERO;
        for side in outline {
            let mut last = side.at(geometry, 0.0)?;
            for i in 1..=pieces {
                let next = side.at(geometry, i as f64 / pieces as f64)?;
                sum += 0.5 * (last - origin).cross(next - origin);
                last = next;
            }
        }
        Some(sum)
    };
    let mut row = (0..SUMS).map(|k| sum(FIRST_SUM << k)).collect::<Option<Vec<DVec3>>>()?;
    for order in 1..SUMS {
        let weight = 4.0_f64.powi(order as i32);
        row = row.windows(2).map(|pair| (pair[1] * weight - pair[0]) / (weight - 1.0)).collect();
    }
    Some(row[0].length())
}
