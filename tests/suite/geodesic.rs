//! Errors of `holonomy geodesic` against a reference of 192 bits, through the real binary.
//!
//! The yardstick of a case is its floor: how far its exact end moves if each input is rounded (every number by half
//! of its last place, worst of several sign patterns), plus the rounding of the outputs. No program that gets and
//! gives such numbers can promise less. Asserted is an error of at most 10 floors, in f64 on the cpu and in f32 on
//! the device.

use crate::{
    big::{Big, BigGeodesic, Classical, Model, distance},
    support::{self, Random},
};
use serde_json::{Value, json};
use std::f64::consts::{PI, TAU};

#[derive(Clone, Debug)]
struct Case {
    geometry: Model,
    from: [f64; 4],
    direction: [f64; 4],
    length: f64,
}

impl Case {
    fn json(&self) -> Value {
        let n = self.geometry.components();
        json!({
            "geometry": self.geometry.name(),
            "from": self.from[..n],
            "direction": self.direction[..n],
            "length": self.length,
        })
    }

    fn end(&self) -> BigGeodesic {
        self.geometry.flow(&self.geometry.settle(self.from, self.direction), &Big::new(self.length))
    }

    /// Floors of point and direction for numbers with relative rounding `u`.
    fn floor(&self, exact: &BigGeodesic, u: f64, random: &mut Random) -> [f64; 2] {
        let mut worst = [0.0_f64; 2];
        for _ in 0..8 {
            let mut nudge = |x: f64| x * (1.0 + if random.next() < 0.5 { u } else { -u });
            let moved = Case {
                geometry: self.geometry,
                from: self.from.map(&mut nudge),
                direction: self.direction.map(&mut nudge),
                length: nudge(self.length),
            };
            let end = moved.end();
            worst[0] = worst[0].max(apart(&exact.point, &end.point));
            worst[1] = worst[1].max(apart(&exact.direction, &end.direction));
        }
        let zero = [0.0; 4];
        [worst[0] + u * distance(&exact.point, &zero), worst[1] + u * distance(&exact.direction, &zero)]
    }
}

fn apart(a: &[Big; 4], b: &[Big; 4]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(x, y)| {
            let d = x - y;
            &d * &d
        })
        .sum::<Big>()
        .sqrt()
        .to_f64()
}

/// Ordinary and extreme cases.
fn cases() -> Vec<Case> {
    let mut random = Random(20_210_729);
    let mut cases = Vec::new();
    let geometries = [Classical(0), Classical(1), Classical(-1)];
    let unit = |random: &mut Random| -> [f64; 3] {
        loop {
            let v: [f64; 3] = std::array::from_fn(|_| random.within(-1.0, 1.0));
            let norm = v.iter().map(|x| x * x).sum::<f64>().sqrt();
            if (0.1..1.0).contains(&norm) {
                return v.map(|x| x / norm);
            }
        }
    };
    for geometry in geometries {
        let lengths: &[f64] = match geometry.0 {
            0 => &[0.0, 1.0, -1.0, 1e-9, 1000.0, -1e6, 1e12],
            1 => &[0.0, 1.0, -1.0, 1e-9, 3.0, PI - 1e-7, PI, -TAU - 1e-3, 100.0, 1000.0, -1000.0, 999.123],
            _ => &[0.0, 1.0, -1.0, 1e-9, 5.0, -20.0, 50.0, 37.7],
        };
        for &length in lengths {
            for scale in [1.0, 1e-30, 1e25] {
                let v = unit(&mut random);
                let from = [0.0, 0.0, 0.0, 1.0];
                let direction = [v[0] * scale, v[1] * scale, v[2] * scale, 0.0];
                let model = Model::Classical(geometry);
                cases.push(Case { geometry: model, from, direction, length });
                // Along an axis, where components vanish.
                let direction = [0.0, -scale, 0.0, 0.0];
                cases.push(Case { geometry: model, from, direction, length });
                // From a point nearby, with a direction that is not tangent before it is projected.
                let p = unit(&mut random);
                let from = match geometry.0 {
                    1 => [p[0], p[1], p[2], random.within(-1.0, 1.0)],
                    _ => [p[0], p[1], p[2], 1.5],
                };
                let direction = [v[1] * scale, v[2] * scale, v[0] * scale, 0.3 * scale];
                cases.push(Case { geometry: model, from, direction, length });
            }
        }
    }
    // From far out in hyperbolic space back over the base point, tangent to the last digit that f64 has.
    for d in [1.0_f64, 3.0, 5.0, 8.0, 12.0] {
        for miss in [0.0, 1e-3] {
            let n = unit(&mut random);
            let from = [d.sinh() * n[0], d.sinh() * n[1], d.sinh() * n[2], d.cosh()];
            let direction =
                [-d.cosh() * n[0] + miss * n[1], -d.cosh() * n[1] - miss * n[0], -d.cosh() * n[2], -d.sinh()];
            for length in [d, 2.0 * d, -1.0] {
                cases.push(Case { geometry: Model::Classical(Classical(-1)), from, direction, length });
            }
        }
    }
    cases.extend(product_cases(&mut random));
    cases.extend(nil_cases(&mut random));
    cases
}

/// Scales of directions, by which nothing may change.
const SCALES: [f64; 3] = [1.0, 1e-30, 1e25];

/// Surfaces times a line: general directions, and some that are vertical or horizontal or nearly so.
fn product_cases(random: &mut Random) -> Vec<Case> {
    let mut cases = Vec::new();
    for curvature in [1, -1] {
        let lengths: &[f64] = match curvature {
            1 => &[0.0, 1.0, -1.0, 1e-9, 3.0, PI, -TAU - 1e-3, 100.0, 1000.0, -999.123],
            _ => &[0.0, 1.0, -1.0, 1e-9, 5.0, -20.0, 37.7, 50.0],
        };
        for &length in lengths {
            for steep in [0.0, 1e-12, 1e-6, 0.3, 1.0, 3.0, 1e6, 1e12, f64::INFINITY] {
                let scale = SCALES[cases.len() % 3];
                let (across, along) = if steep.is_finite() { (scale, scale * steep) } else { (0.0, -scale) };
                let (sin, cos) = random.within(-PI, PI).sin_cos();
                let geometry = Model::Product(curvature);
                let (from, direction) = ([0.0, 0.0, 0.0, 1.0], [across * cos, across * sin, along, 0.0]);
                cases.push(Case { geometry, from, direction, length });
                // From elsewhere; in the surface the direction is not tangent before it is projected.
                let from = [random.within(-0.7, 0.7), random.within(-0.7, 0.7), random.within(-9.0, 9.0), 1.2];
                let direction = [across * cos, across * sin, along, across * 0.3];
                cases.push(Case { geometry, from, direction, length });
            }
        }
    }
    cases
}

/// Nil, with the fibre's component of the direction from all of it to nothing.
fn nil_cases(random: &mut Random) -> Vec<Case> {
    let mut cases = Vec::new();
    for length in [0.0, 1e-9, 1.0, -1.0, 5.0, -20.0, TAU, 100.0, 1000.0, -1000.0] {
        for w in [1.0, 0.9, 0.3, 0.1, 1e-2, 1e-3, 1e-5, 1e-7, 1e-9, 1e-12, 0.0] {
            let scale = SCALES[cases.len() % 3];
            let (sin, cos) = random.within(-PI, PI).sin_cos();
            let c = (1.0_f64 - w * w).sqrt();
            let direction = [c * cos * scale, c * sin * scale, if cos > 0.0 { w } else { -w } * scale, 0.0];
            let mut case = Case { geometry: Model::Nil, from: [0.0; 4], direction, length };
            cases.push(case.clone());
            case.from = [random.within(-3.0, 3.0), random.within(-3.0, 3.0), random.within(-3.0, 3.0), 0.0];
            cases.push(case.clone());
            // Along an axis of the plane.
            case.direction[..2].copy_from_slice(&[0.0, c * scale]);
            cases.push(case);
        }
    }
    cases
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().expect("a list").iter().map(|x| x.as_f64().expect("a number")).collect()
}

/// Worst ratio of error to floor, with the case; `spoil` changes results before they are judged.
fn worst_ratio(args: &[&str], u: f64, spoil: impl Fn(usize, &mut Vec<f64>)) -> (f64, String) {
    let cases = cases();
    let lines: Vec<Value> = cases.iter().map(Case::json).collect();
    let results = support::run_batch(&[&["geodesic"], args].concat(), &lines);
    assert_eq!(cases.len(), results.len());
    let mut random = Random(7);
    let mut worst = (0.0, String::new());
    for (index, (case, result)) in cases.iter().zip(&results).enumerate() {
        assert!(result.get("error").is_none(), "{} is refused: {result}", case.json());
        let exact = case.end();
        let floor = case.floor(&exact, u, &mut random);
        for (what, key, reference, floor) in
            [("point", "point", &exact.point, floor[0]), ("direction", "direction", &exact.direction, floor[1])]
        {
            let mut computed = numbers(&result[key]);
            spoil(index, &mut computed);
            assert!(computed.iter().all(|x| x.is_finite()));
            let error = distance(reference, &computed);
            let ratio = error / floor;
            if ratio > worst.0 {
                worst = (ratio, format!("{what} of {}: error {error:.2e}, floor {floor:.2e}", case.json()));
            }
        }
    }
    worst
}

#[test]
fn geodesic_f64_is_within_ten_floors() {
    let (ratio, case) = worst_ratio(&[], 2.0_f64.powi(-53), |_, _| ());
    println!("f64: worst error is {ratio:.2} floors: {case}");
    assert!(ratio < 10.0, "{ratio:.1} floors: {case}");
}

#[test]
fn geodesic_f32_is_within_ten_floors() {
    let Some(_gpu) = support::gpu() else { return };
    let (ratio, case) = worst_ratio(&["--backend", "compute"], 2.0_f64.powi(-24), |_, _| ());
    println!("f32: worst error is {ratio:.2} floors: {case}");
    assert!(ratio < 10.0, "{ratio:.1} floors: {case}");
}

#[test]
fn geodesic_spoiled_result_is_caught() {
    // The first case of unit length from the base point of each geometry.
    let cases = cases();
    for name in ["e3", "s3", "h3", "s2xr", "h2xr", "nil"] {
        let ordinary = |c: &Case| c.geometry.name() == name && c.length == 1.0 && c.from[..3] == [0.0; 3];
        let spoiled = cases.iter().position(ordinary).expect("a case");
        let (ratio, _) = worst_ratio(&[], 2.0_f64.powi(-53), |index, v| {
            if index == spoiled {
                v[0] += 1e-13;
            }
        });
        assert!(ratio > 10.0, "{name}: a result that is off by 1e-13 passed with {ratio:.1} floors");
    }
}

#[test]
fn geodesic_out_of_range_is_an_error() {
    let case = |geometry: &str, n: usize, direction: [f64; 4], length: f64| {
        let from = [0.0, 0.0, 0.0, 1.0];
        json!({ "geometry": geometry, "from": from[..n], "direction": direction[..n], "length": length })
    };
    let lines = [
        case("h2xr", 4, [1.0, 0.0, 0.5, 0.0], 1000.0),
        case("h2xr", 4, [0.0, 0.0, 0.0, 0.0], 1.0),
        case("s2xr", 4, [0.0, 0.0, 0.0, 1.0], 1.0),
        case("nil", 3, [1.0, 1.0, 0.0, 0.0], 1e200),
        case("nil", 3, [0.0, 0.0, 0.0, 0.0], 0.0),
    ];
    for (line, result) in lines.iter().zip(support::run_batch(&["geodesic"], &lines)) {
        assert!(result["error"].is_string(), "{line}: {result}");
    }
    // Vertical geodesics go as far as numbers do.
    let far = support::run_batch(&["geodesic"], &[case("h2xr", 4, [0.0, 0.0, 2.0, 0.0], 1e9)]);
    assert_eq!(far[0]["point"], json!([0.0, 0.0, 1e9, 1.0]));
}
