//! What has no answer is refused, in words, and never answered with numbers that are wrong or none.

use super::{
    Bench, Case, FLOWS, Family, On, Reading, Trouble,
    geodesic::{Start, ends, is_indefinite},
};
use crate::{
    geometry::{GEOMETRIES, GeometryError, GeometryId},
    measure::reference::{Big, model},
};
use std::f64::consts::FRAC_PI_2;

/// What is expected of a start.
#[derive(Clone, Copy, PartialEq)]
enum Expected {
    Answer,
    Edge,
    Direction,
    Point,
}

fn is_as_expected(result: &Result<crate::geometry::Geodesic, GeometryError>, expected: Expected) -> bool {
    match result {
        Ok(end) => expected == Expected::Answer && end.point.is_finite() && end.velocity.is_finite(),
        Err(GeometryError::Edge { .. }) => expected == Expected::Edge,
        Err(GeometryError::OutOfRange { .. }) => false,
        Err(GeometryError::NoDirection(_)) => expected == Expected::Direction,
        Err(GeometryError::NotAPoint(..)) => expected == Expected::Point,
    }
}

pub(super) fn cases() -> Vec<Case> {
    let family = Family { name: "edge", quantity: "answers that should be refusals, or refusals answers", on: FLOWS };
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
        let range = Family { quantity: "refusals of what numbers hold, or answers of what they do not", ..family };
        for (what, direction) in [("along an axis", [1.0, 0.0, 0.0, 0.0]), ("slanted", [1e-3, 0.2, 1.0, 0.0])] {
            let mut lengths = vec![20.0, 50.0, -59.0, 95.0, -150.0];
            if grows(id) {
                lengths.extend([300.0, 700.0, -720.0, 1e4]);
            }
            let starts: Vec<Start> = lengths.into_iter().map(|t| start(direction, t)).collect();
            let what = format!("to the end of the numbers {what}");
            cases.push(range.case(entry.name, what, move |bench, on| in_range(bench, on, id, &starts)));
        }
    }
    cases
}

/// Whether coordinates grow like e^t along the first axis.
fn grows(id: GeometryId) -> bool {
    let from = if id.components() == 4 { [0.0, 0.0, 0.0, 1.0] } else { [0.0; 4] };
    model(id).is_some_and(|model| {
        let end = model.flow(&model.settle(from, [1.0, 0.0, 0.0, 0.0]), &Big::new(20.0));
        end.point[0].to_f64().abs() > 1e3
    })
}

/// Where the reference says that coordinates are well within the numbers used they must be given, and where it says that
/// they are not they must be refused.
fn in_range(bench: &mut Bench, on: On, id: GeometryId, starts: &[Start]) -> Result<Reading, Trouble> {
    let model = model(id).ok_or_else(|| Trouble(String::from("no reference")))?;
    let ends = ends(bench, on, id, starts)?;
    let (held, most) = if on == On::Cpu { (1e300, f64::MAX) } else { (1e30, f64::from(f32::MAX)) };
    let mut wrong = 0;
    for (start, end) in starts.iter().zip(ends) {
        let exact = model.flow(&model.settle(start.from, start.direction), &Big::new(start.length));
        let size = exact.point[..model.components()[0]].iter().map(|x| x.to_f64().abs()).fold(0.0, f64::max);
        let right = match end {
            Ok(end) => size <= most && end.point.is_finite() && end.velocity.is_finite(),
            // On the way there exponentials of twice the length may stand in between.
            Err(GeometryError::OutOfRange { .. }) => size >= held || start.length.abs() > 60.0,
            Err(_) => false,
        };
        wrong += u8::from(!right);
    }
    Ok(Reading::new(wrong.into(), 0.0))
}

fn judge(bench: &mut Bench, on: On, id: GeometryId, starts: &[(Start, Expected)]) -> Result<Reading, Trouble> {
    let given: Vec<Start> = starts.iter().map(|(start, _)| *start).collect();
    let ends = ends(bench, on, id, &given)?;
    let wrong = ends.iter().zip(starts).filter(|(end, (_, expected))| !is_as_expected(end, *expected)).count();
    Ok(Reading::new(wrong as f64, 0.0))
}
