//! Errors of `holonomy geodesic` against a reference of 192 bits, through the real binary.
//!
//! The yardstick of a case is its floor: how far its exact end moves if each input is rounded (every number by half
//! of its last place, worst of several sign patterns), plus the rounding of the outputs. No program that gets and
//! gives such numbers can promise less. Asserted is an error of at most 10 floors, in f64 and in f32 on the cpu and in
//! f32 on the device.

use crate::support::{self, Random};
use holonomy::measure::reference::{
    Big, BigGeodesic, Classical, Model, Nil, Product, SL2, SOL, TRACE, apart, distance,
};
use serde_json::{Value, json};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

#[derive(Clone, Debug)]
struct Case {
    geometry: &'static dyn Model,
    from: [f64; 4],
    direction: [f64; 4],
    length: f64,
}

impl Case {
    fn json(&self) -> Value {
        let [point, direction] = self.geometry.components();
        json!({
            "geometry": self.geometry.name(),
            "from": self.from[..point],
            "direction": self.direction[..direction],
            "length": self.length,
        })
    }

    fn end(&self) -> BigGeodesic {
        self.geometry.flow(&self.geometry.settle(self.from, self.direction), &Big::new(self.length))
    }

    /// Floors of point and direction for numbers with relative rounding `u`.
    fn floor(&self, exact: &BigGeodesic, u: f64, random: &mut Random) -> [f64; 2] {
        let mut worst = [0.0_f64; 2];
        for number in 0..8 {
            let mut nudge = |x: f64| x * (1.0 + if random.next() < 0.5 { u } else { -u });
            let moved = Case {
                geometry: self.geometry,
                from: self.from.map(&mut nudge),
                direction: self.direction.map(&mut nudge),
                // Both ways in turn: in f64, where 1 + u is 1, chance would leave a long way as it is now and then.
                length: self.length * (1.0 + if number % 2 == 0 { u } else { -u }),
            };
            let end = moved.end();
            worst[0] = worst[0].max(apart(&exact.point, &end.point));
            worst[1] = worst[1].max(apart(&exact.direction, &end.direction));
        }
        let zero = [0.0; 4];
        [worst[0] + u * distance(&exact.point, &zero), worst[1] + u * distance(&exact.direction, &zero)]
    }
}

/// Ordinary and extreme cases of the geometries with curvature of one sign.
fn classical_cases() -> Vec<Case> {
    let mut random = Random(20_210_729);
    let mut cases = Vec::new();
    let geometries = [&Classical(0), &Classical(1), &Classical(-1)];
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
                cases.push(Case { geometry, from, direction, length });
                // Along an axis, where components vanish.
                let direction = [0.0, -scale, 0.0, 0.0];
                cases.push(Case { geometry, from, direction, length });
                // From a point nearby, with a direction that is not tangent before it is projected.
                let p = unit(&mut random);
                let from = match geometry.0 {
                    1 => [p[0], p[1], p[2], random.within(-1.0, 1.0)],
                    _ => [p[0], p[1], p[2], 1.5],
                };
                let direction = [v[1] * scale, v[2] * scale, v[0] * scale, 0.3 * scale];
                cases.push(Case { geometry, from, direction, length });
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
                cases.push(Case { geometry: &Classical(-1), from, direction, length });
            }
        }
    }
    cases
}

/// Scales of directions, by which nothing may change.
const SCALES: [f64; 3] = [1.0, 1e-30, 1e25];

/// Surfaces times a line: general directions, and some that are vertical or horizontal or nearly so.
fn product_cases() -> Vec<Case> {
    let mut random = Random(1_883);
    let spherical: (&'static dyn Model, &[f64]) =
        (&Product(1), &[0.0, 1.0, -1.0, 1e-9, 3.0, PI, -TAU - 1e-3, 100.0, 1000.0, -999.123]);
    let hyperbolic: (&'static dyn Model, &[f64]) = (&Product(-1), &[0.0, 1.0, -1.0, 1e-9, 5.0, -20.0, 37.7, 50.0]);
    let mut cases = Vec::new();
    for (geometry, lengths) in [spherical, hyperbolic] {
        for &length in lengths {
            for steep in [0.0, 1e-12, 1e-6, 0.3, 1.0, 3.0, 1e6, 1e12, f64::INFINITY] {
                let scale = SCALES[cases.len() % 3];
                let (across, along) = if steep.is_finite() { (scale, scale * steep) } else { (0.0, -scale) };
                let (sin, cos) = random.within(-PI, PI).sin_cos();
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
fn nil_cases() -> Vec<Case> {
    let mut random = Random(1_984);
    let mut cases = Vec::new();
    for length in [0.0, 1e-9, 1.0, -1.0, 5.0, -20.0, TAU, 100.0, 1000.0, -1000.0] {
        for w in [1.0, 0.9, 0.3, 0.1, 1e-2, 1e-3, 1e-5, 1e-7, 1e-9, 1e-12, 0.0] {
            let scale = SCALES[cases.len() % 3];
            let (sin, cos) = random.within(-PI, PI).sin_cos();
            let c = (1.0_f64 - w * w).sqrt();
            let direction = [c * cos * scale, c * sin * scale, if cos > 0.0 { w } else { -w } * scale, 0.0];
            let mut case = Case { geometry: &Nil, from: [0.0; 4], direction, length };
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

/// Ordinary and extreme cases of Sol: small and vanishing momenta, next to the separating planes u = ±v.
fn sol_cases() -> Vec<Case> {
    let mut random = Random(20_180_112);
    let half = 0.5_f64.sqrt();
    let mut directions = vec![
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, -1.0],
        [1e-12, 0.6, 0.8],
        [0.6, 1e-12, -0.8],
        [0.0, 0.6, 0.8],
        [1e-12, 1e-12, 1.0],
        [half, half, 0.0],
        [half, half * (1.0 + 1e-12), 0.0],
        [half, -half, 1e-12],
        [half + 1e-7, half - 1e-7, 1e-9],
        [1e-4, 0.5, -0.8],
    ];
    directions.extend((0..8).map(|_| std::array::from_fn(|_| random.within(-1.0, 1.0))));
    let mut cases = Vec::new();
    for (index, v) in directions.iter().enumerate() {
        let scale = [1.0, 1e-30, 1e25][index % 3];
        let direction = [v[0] * scale, v[1] * scale, v[2] * scale, 0.0];
        let from = if index % 2 == 0 { [0.0; 4] } else { [0.3, -0.8, random.within(-1.0, 1.0), 0.0] };
        for length in [0.0, 1e-9, 1.0, -4.0, 8.0] {
            cases.push(Case { geometry: SOL, from, direction, length });
        }
    }
    // Several periods, and so far that they are counted.
    for (v, length) in [([0.3, 0.5, 0.2], 20.0), ([half, 0.6, 0.1], -30.0), ([0.3, -0.5, 0.2], 70.0)] {
        cases.push(Case { geometry: SOL, from: [0.0; 4], direction: [v[0], v[1], v[2], 0.0], length });
    }
    cases
}

/// Ordinary and extreme cases of SL2~: the three regimes, next to the parabolic one, several turns of the fibre.
fn sl2_cases() -> Vec<Case> {
    let mut random = Random(18_920);
    let mut directions = vec![
        ([1.0, 0.0, 0.0], 100.0),
        ([0.0, 0.0, 1.0], 1000.0),
        ([0.0, 0.0, -1.0], 40.0),
        ([0.6, 0.8, 1.0], 30.0),
        ([0.6, 0.8, 1.0 + 1e-12], 30.0),
        ([0.6, 0.8, -1.0 + 1e-12], 30.0),
        ([1e-12, 0.0, 1.0], 60.0),
        ([1.0, 0.0, 1e-12], 20.0),
        ([0.3, -0.2, 0.9], 300.0),
        ([-0.5, 0.6, -0.8], 50.0),
        ([0.1, 0.7, 0.6], 40.0),
    ];
    directions.extend((0..9).map(|_| (std::array::from_fn(|_| random.within(-1.0, 1.0)), 10.0)));
    let mut cases = Vec::new();
    for (index, (v, long)) in directions.iter().enumerate() {
        let scale = [1.0, 1e-30, 1e25][index % 3];
        let direction = [v[0] * scale, v[1] * scale, v[2] * scale, 0.0];
        let angle = random.within(-20.0, 20.0);
        let from = if index % 2 == 0 { [0.0, 0.0, 0.0, 1.0] } else { [0.8, -1.3, angle, 1.0] };
        for length in [0.0, 1e-9, 1.0, -1.0, 5.0, -20.0, *long] {
            cases.push(Case { geometry: SL2, from, direction, length });
        }
    }
    cases
}

/// Ordinary and extreme cases of the trace form: space-like, null and time-like, up to the chart's edge. The length
/// is an affine parameter, so it shrinks as the direction grows.
fn trace_cases() -> Vec<Case> {
    let mut random = Random(1_927);
    let mut directions = vec![
        ([1.0, 0.0, 0.0], 30.0),
        ([-1.0, 0.0, 0.0], 20.0),
        ([0.0, 1.0, 0.0], 1000.0),
        ([0.0, 0.0, -1.0], 1e6),
        ([1.0, 1.0, -1.0], 500.0),
        ([1.0, 1.0 + 1e-12, -1.0], 3.0),
        ([1.0, 1.0 - 1e-12, -1.0], 30.0),
        ([0.0, 1.0, -1.0], 1.57),
        ([0.0, -1.0, 1.0], 1e-5 - FRAC_PI_2),
        ([1e-12, 0.5, -0.5], 3.1),
        ([0.3, 0.2, 0.9], 15.0),
    ];
    directions.extend((0..6).map(|_| (std::array::from_fn(|_| random.within(-1.0, 1.0)), 0.9)));
    let mut cases = Vec::new();
    for (index, (v, long)) in directions.iter().enumerate() {
        let scale = [1.0, 1e-30, 1e25][index % 3];
        let direction = [v[0] * scale, v[1] * scale, v[2] * scale, 0.0];
        for length in [0.0, 1e-9, 0.7, -0.5, *long] {
            cases.push(Case { geometry: TRACE, from: [0.0; 4], direction, length: length / scale });
        }
        let from = [random.within(-0.3, 0.5), random.within(-0.3, 0.3), random.within(-0.3, 0.3), 0.0];
        cases.push(Case { geometry: TRACE, from, direction, length: 0.4 / scale });
    }
    cases
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().expect("a list").iter().map(|x| x.as_f64().expect("a number")).collect()
}

/// Worst ratio of error to floor, with the case; `spoil` changes results before they are judged.
fn worst_ratio(cases: Vec<Case>, args: &[&str], u: f64, spoil: impl Fn(usize, &mut Vec<f64>)) -> (f64, String) {
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

/// How geodesics are computed.
#[derive(Clone, Copy)]
struct Way {
    name: &'static str,
    args: &'static [&'static str],
    /// Relative rounding of its numbers.
    rounding: f64,
    /// A little too much for a result of order 1.
    error: f64,
}

const DOUBLE: Way = Way { name: "f64", args: &[], rounding: f64::EPSILON / 2.0, error: 1e-13 };
const SINGLE: Way =
    Way { name: "f32 on the cpu", args: &["--precision", "f32"], rounding: f32::EPSILON as f64 / 2.0, error: 1e-5 };
const DEVICE: Way = Way { name: "f32 on the device", args: &["--backend", "compute"], ..SINGLE };

/// Asserts an error of at most ten floors.
fn check(way: Way, cases: Vec<Case>) {
    let (ratio, case) = worst_ratio(cases, way.args, way.rounding, |_, _| ());
    println!("{}: worst error is {ratio:.2} floors: {case}", way.name);
    assert!(ratio < 10.0, "{ratio:.1} floors: {case}");
}

/// The same on the device, if there is one.
fn check_device(cases: Vec<Case>) {
    let Some(_gpu) = support::gpu() else { return };
    check(DEVICE, cases);
}

/// Asserts that one result that is off by a little is caught.
fn check_spoiled(way: Way, cases: Vec<Case>, spoiled: usize) {
    let (ratio, _) = worst_ratio(cases, way.args, way.rounding, |index, v| {
        if index == spoiled {
            v[0] += way.error;
        }
    });
    assert!(ratio > 10.0, "a result that is off by {:.0e} passed with {ratio:.1} floors", way.error);
}

/// From e^88 on numbers leave f32: those lengths are an error there, which the command line's tests look at.
fn sl2_cases_in_f32() -> Vec<Case> {
    sl2_cases().into_iter().filter(|case| case.length < 90.0 || case.direction[2] != 0.0).collect()
}

#[test]
fn geodesic_f64_is_within_ten_floors() {
    check(DOUBLE, classical_cases());
}

#[test]
fn geodesic_f64_is_within_ten_floors_in_products() {
    check(DOUBLE, product_cases());
}

#[test]
fn geodesic_f64_is_within_ten_floors_in_nil() {
    check(DOUBLE, nil_cases());
}

#[test]
fn geodesic_f64_is_within_ten_floors_in_sol() {
    check(DOUBLE, sol_cases());
}

#[test]
fn geodesic_f64_is_within_ten_floors_in_sl2() {
    check(DOUBLE, sl2_cases());
}

#[test]
fn geodesic_f64_is_within_ten_floors_in_the_trace_form() {
    check(DOUBLE, trace_cases());
}

#[test]
fn geodesic_f32_is_within_ten_floors() {
    check(SINGLE, classical_cases());
}

#[test]
fn geodesic_f32_is_within_ten_floors_in_products() {
    check(SINGLE, product_cases());
}

#[test]
fn geodesic_f32_is_within_ten_floors_in_nil() {
    check(SINGLE, nil_cases());
}

#[test]
fn geodesic_f32_is_within_ten_floors_in_sol() {
    check(SINGLE, sol_cases());
}

#[test]
fn geodesic_f32_is_within_ten_floors_in_sl2() {
    check(SINGLE, sl2_cases_in_f32());
}

#[test]
fn geodesic_f32_is_within_ten_floors_in_the_trace_form() {
    check(SINGLE, trace_cases());
}

#[test]
fn geodesic_f32_on_the_device_is_within_ten_floors() {
    check_device(classical_cases());
}

#[test]
fn geodesic_f32_on_the_device_is_within_ten_floors_in_products() {
    check_device(product_cases());
}

#[test]
fn geodesic_f32_on_the_device_is_within_ten_floors_in_nil() {
    check_device(nil_cases());
}

#[test]
fn geodesic_f32_on_the_device_is_within_ten_floors_in_sol() {
    check_device(sol_cases());
}

#[test]
fn geodesic_f32_on_the_device_is_within_ten_floors_in_sl2() {
    check_device(sl2_cases_in_f32());
}

#[test]
fn geodesic_f32_on_the_device_is_within_ten_floors_in_the_trace_form() {
    check_device(trace_cases());
}

#[test]
fn geodesic_spoiled_result_is_caught() {
    for way in [DOUBLE, SINGLE] {
        check_spoiled(way, classical_cases(), 11);
        // The first of length 1, from the base point, of each curvature.
        check_spoiled(way, product_cases(), 18);
        check_spoiled(way, product_cases(), 198);
        check_spoiled(way, nil_cases(), 66);
        check_spoiled(way, sol_cases(), 2);
        check_spoiled(way, sl2_cases_in_f32(), 2);
        check_spoiled(way, trace_cases(), 2);
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

/// What the program says to one case.
fn answer(args: &[&str], case: &Value) -> Value {
    support::run_batch(&[&["geodesic"], args].concat(), std::slice::from_ref(case)).remove(0)
}

#[test]
fn geodesic_over_the_edge_of_the_chart_is_an_error_that_says_so() {
    let case =
        |length: f64| json!({ "geometry": "sl2-trace", "from": [0, 0, 0], "direction": [0, 1, -1], "length": length });
    // x = cos t − 1 comes to −1 after a quarter turn.
    for way in [DOUBLE, SINGLE] {
        for length in [FRAC_PI_2 + 1e-9, -FRAC_PI_2 - 1e-9, 2.0, 6.3] {
            let error = answer(way.args, &case(length))["error"].to_string();
            assert!(error.contains("x = -1, the edge of the chart"), "{error}");
        }
    }
    assert!(answer(&[], &case(FRAC_PI_2 - 1e-9)).get("error").is_none());
    assert!(answer(&[], &case(1e-9 - FRAC_PI_2)).get("error").is_none());
    let zero = json!({ "geometry": "sl2-trace", "from": [0, 0, 0], "direction": [0, 0, 0], "length": 0 });
    assert!(answer(&[], &zero)["error"].to_string().contains("direction"));
    let edge = json!({ "geometry": "sl2-trace", "from": [-1, 0, 0], "direction": [1, 0, 0], "length": 0 });
    assert!(answer(&[], &edge)["error"].to_string().contains("not a point"));
}

/// Numbers out of range are an error on both sides, never a silent wrong one; what f32 can hold is given.
fn check_range(way: Way) {
    let mut random = Random(88);
    let small = [0.0, 1e-30, 1e-12, 1e-6, 1e-3, 1.0];
    let mut lines = Vec::new();
    for geometry in ["sol", "sl2"] {
        for _ in 0..400 {
            let mut pick = || small[(6.0 * random.next()) as usize] * if random.next() < 0.5 { 1.0 } else { -1.0 };
            let direction = [pick(), pick(), pick()];
            if direction == [0.0; 3] {
                continue;
            }
            let from: &[f64] = if geometry == "sol" { &[0.1, -0.2, 0.3] } else { &[0.1, -0.2, 7.0, 1.0] };
            let length = 10.0_f64.powf(random.within(-8.0, 5.0));
            lines.push(json!({ "geometry": geometry, "from": from, "direction": direction, "length": length }));
        }
    }
    let double = support::run_batch(&["geodesic"], &lines);
    let single = support::run_batch(&[&["geodesic"], way.args].concat(), &lines);
    let mut refused = 0;
    for ((case, double), single) in lines.iter().zip(&double).zip(&single) {
        let Some(point) = double.get("point") else {
            assert!(double["error"].to_string().contains("range of f64"), "{case}: {double}");
            continue;
        };
        // Where f64 stays well within f32 all along the way (e^z and the distance from the base), f32 must answer.
        let length = case["length"].as_f64().expect("a number");
        let largest = numbers(point).iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        match single.get("point") {
            Some(found) => {
                let found = numbers(found);
                assert!(found.iter().all(|x| x.is_finite()), "{case}: {single}");
                // A short geodesic is right as well: the rest is sensitive to rounding.
                let off = numbers(point).iter().zip(&found).fold(0.0_f64, |most, (a, b)| most.max((a - b).abs()));
                assert!(length > 5.0 || off < 1e-5 * (1.0 + largest), "{case}: {found:?} instead of {point}");
            }
            None => {
                refused += 1;
                assert!(single["error"].to_string().contains("range of f32"), "{case}: {single}");
                assert!(largest > 1e30 || length > 60.0, "{case} is refused: {single}");
            }
        }
    }
    assert!(refused > 0, "no case leaves f32");
}

#[test]
fn geodesic_that_leaves_f32_is_an_error_and_all_else_is_finite() {
    check_range(SINGLE);
}

#[test]
fn geodesic_that_leaves_f32_on_the_device_is_an_error_and_all_else_is_finite() {
    let Some(_gpu) = support::gpu() else { return };
    check_range(DEVICE);
}
