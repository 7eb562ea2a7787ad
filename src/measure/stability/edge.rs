//! What has no answer is refused, in words, and never answered with numbers that are wrong or none.

use super::{
    Bench, Case, Family, NUMBERS, On, Reading, Trouble,
    geodesic::{Start, ends, is_indefinite},
};
use crate::geometry::{GEOMETRIES, GeometryError, GeometryId};
use std::f64::consts::FRAC_PI_2;

/// What is expected of a start.
#[derive(Clone, Copy, PartialEq)]
enum Expected {
    Answer,
    Edge,
    Range,
    Direction,
    Point,
}

fn is_as_expected(result: &Result<crate::geometry::Geodesic, GeometryError>, expected: Expected) -> bool {
    match result {
        Ok(end) => expected == Expected::Answer && end.point.is_finite() && end.velocity.is_finite(),
        Err(GeometryError::Edge { .. }) => expected == Expected::Edge,
        Err(GeometryError::OutOfRange { .. }) => expected == Expected::Range,
        Err(GeometryError::NoDirection(_)) => expected == Expected::Direction,
        Err(GeometryError::NotAPoint(..)) => expected == Expected::Point,
    }
}

pub(super) fn cases() -> Vec<Case> {
    let family = Family { name: "edge", quantity: "answers that should be refusals, or refusals answers", on: NUMBERS };
    let mut cases = Vec::new();
    for entry in GEOMETRIES {
        let id = entry.id;
        let base = if id.components() == 4 { [0.0, 0.0, 0.0, 1.0] } else { [0.0; 4] };
        let start = move |direction: [f64; 4], length: f64| Start { from: base, direction, length };
        let mut list = |what: &str, starts: Vec<(Start, Expected)>| {
            cases.push(family.case(entry.name, what, move |bench, on| judge(bench, on, id, &starts)));
        };
        let zero = [0.0; 4];
        list("no direction", [0.0, 1.0, -1e9].into_iter().map(|t| (start(zero, t), Expected::Direction)).collect());
        let nan = [f64::NAN, 1.0, 0.0, 0.0];
        let infinite = [f64::INFINITY, 1.0, 0.0, 0.0];
        list(
            "numbers that are none",
            vec![
                (start(nan, 1.0), Expected::Direction),
                (start(infinite, 1.0), Expected::Direction),
                (Start { from: nan, direction: [1.0, 0.0, 0.0, 0.0], length: 1.0 }, Expected::Point),
                (Start { from: infinite, direction: [1.0, 0.0, 0.0, 0.0], length: 1.0 }, Expected::Point),
            ],
        );
        if is_indefinite(id) {
            // x = cos t − 1 comes to −1 after a quarter turn.
            let turn = [0.0, 1.0, -1.0, 0.0];
            let over = [FRAC_PI_2 + 1e-9, -FRAC_PI_2 - 1e-9, 2.0, 6.3, -1e9];
            let before = [FRAC_PI_2 - 1e-5, 1e-5 - FRAC_PI_2, 1.0, -1.0];
            list("over the chart's edge", over.into_iter().map(|t| (start(turn, t), Expected::Edge)).collect());
            list("up to the chart's edge", before.into_iter().map(|t| (start(turn, t), Expected::Answer)).collect());
            let on_edge = Start { from: [-1.0, 0.0, 0.0, 0.0], direction: [1.0, 0.0, 0.0, 0.0], length: 0.0 };
            list("a start on the edge", vec![(on_edge, Expected::Point)]);
        }
        // A length that no number reaches the end of, where lengths are exponents.
        if grows(id) {
            let v = [1.0, 0.0, 0.0, 0.0];
            list("beyond all numbers", [1e4, -1e4, 1e9].into_iter().map(|t| (start(v, t), Expected::Range)).collect());
        }
    }
    cases
}

/// Whether coordinates grow like e^t along the first axis.
fn grows(id: GeometryId) -> bool {
    let start = Start { from: [0.0, 0.0, 0.0, 1.0], direction: [1.0, 0.0, 0.0, 0.0], length: 20.0 };
    let Some(model) = crate::measure::reference::model(id) else { return false };
    let from = if id.components() == 4 { start.from } else { [0.0; 4] };
    let end = model.flow(&model.settle(from, start.direction), &crate::measure::reference::Big::new(start.length));
    end.point[0].to_f64().abs() > 1e3
}

fn judge(bench: &mut Bench, on: On, id: GeometryId, starts: &[(Start, Expected)]) -> Result<Reading, Trouble> {
    let given: Vec<Start> = starts.iter().map(|(start, _)| *start).collect();
    let ends = ends(bench, on, id, &given)?;
    let wrong = ends.iter().zip(starts).filter(|(end, (_, expected))| !is_as_expected(end, *expected)).count();
    Ok(Reading::new(wrong as f64, 0.0))
}
