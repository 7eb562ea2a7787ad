//! Ends of geodesics on the command line and in batches.

use super::program::Place;
use crate::support::gpu_turn;
use serde_json::{Value, json};

/// Largest difference of point and direction from the expected ones; infinite if they have other numbers of
/// components.
fn difference(found: &Value, point: &[f64], direction: &[f64]) -> f64 {
    let differ = |found: &Value, expected: &[f64]| match found.as_array() {
        Some(list) if list.len() == expected.len() => {
            let numbers = list.iter().map(|x| x.as_f64().unwrap_or(f64::NAN));
            numbers.zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, |m, d| if d <= m { m } else { d })
        }
        _ => f64::INFINITY,
    };
    differ(&found["point"], point).max(differ(&found["direction"], direction))
}

/// Geometry, start, direction, length, end, direction there.
type Known = (&'static str, &'static str, &'static str, f64, Vec<f64>, Vec<f64>);

fn known() -> Vec<Known> {
    let (ch, sh) = (2_f64.cosh(), 2_f64.sinh());
    let (c, s) = (1_f64.cos(), 1_f64.sin());
    vec![
        ("e3", "1,2,3", "3,4,0", 5.0, vec![4.0, 6.0, 3.0], vec![0.6, 0.8, 0.0]),
        ("e3", "1,2,3", "-3,-4,0", -5.0, vec![4.0, 6.0, 3.0], vec![-0.6, -0.8, 0.0]),
        ("s3", "0,0,0,1", "0,7,0,0", 1.0, vec![0.0, s, 0.0, c], vec![0.0, c, 0.0, -s]),
        // The point is put on the sphere, and the direction made tangent.
        ("s3", "0,0,0,5", "0,7,0,9", 1.0, vec![0.0, s, 0.0, c], vec![0.0, c, 0.0, -s]),
        ("h3", "0,0,0,1", "0,0,1,0", 2.0, vec![0.0, 0.0, sh, ch], vec![0.0, 0.0, ch, sh]),
        ("h3", "0,0,0,77", "0,0,1e-30,0", -2.0, vec![0.0, 0.0, -sh, ch], vec![0.0, 0.0, ch, -sh]),
        ("h3", "0,0,0,1", "0,0,1e25,0", 0.0, vec![0.0, 0.0, 0.0, 1.0], vec![0.0, 0.0, 1.0, 0.0]),
    ]
}

#[test]
fn geodesic_ends_are_those_of_the_closed_form() {
    let place = Place::new();
    for (geometry, from, direction, length, end, there) in known() {
        let args = [
            "geodesic".to_owned(),
            format!("--geometry={geometry}"),
            format!("--from={from}"),
            format!("--direction={direction}"),
            format!("--length={length}"),
        ];
        let mut args: Vec<&str> = args.iter().map(String::as_str).collect();
        let text = place.run(&args).done();
        assert!(text.starts_with("point     ") && text.lines().count() == 2, "{text}");
        args.push("--json");
        let found = place.run(&args).json();
        assert_eq!(found.as_object().map(serde_json::Map::len), Some(2));
        assert!(difference(&found, &end, &there) < 1e-14, "{found}");
        // The comparison notices a direction that is off by little.
        let spoilt: Vec<f64> = there.iter().map(|x| x + 1e-12).collect();
        assert!(difference(&found, &end, &spoilt) > 1e-14);
    }
}

/// Lines with the refusal that each must get; the lines between are answered.
const MIXED: &[(&str, Option<&str>)] = &[
    (r#"{"geometry":"e3","from":[1,2,3],"direction":[3,4,0],"length":5}"#, None),
    ("no json", Some("line 2, column 2: no JSON object: expected ident")),
    (
        r#"{"geometry":"e3","from":[0,0,0],"direction":[0,0,0],"length":0}"#,
        Some("direction (0, 0, 0) has no tangent part at the point: it must be finite and not zero"),
    ),
    (
        r#"{"geometry":"s3","from":[0,0,0,1],"direction":[0,0,0,3],"length":1}"#,
        Some("direction (0, 0, 0, 3) has no tangent part at the point: it must be finite and not zero"),
    ),
    ("[1, 2]", Some("expected an object with geometry, from, direction, length")),
    (r#"{"geometry":"e3","from":[0,0],"direction":[3,4,0],"length":5}"#, Some("from needs 3 numbers in e3, found 2")),
    (
        r#"{"geometry":"s3","from":[0,0,0,1],"direction":[3,4,0],"length":5}"#,
        Some("direction needs 4 numbers in s3, found 3"),
    ),
    (
        r#"{"geometry":"e3","from":[0,0,0],"direction":[3,4,0],"length":5,"lenght":3}"#,
        Some(r#"unknown key "lenght"; known are geometry, from, direction, length"#),
    ),
    (r#"{"geometry":"e3","from":[0,0,0],"direction":[3,4,0]}"#, Some("length is missing")),
    (r#"{"geometry":"e3","direction":[3,4,0],"length":1}"#, Some("from is missing")),
    (r#"{"geometry":"e3","from":[0,0,"a"],"direction":[3,4,0],"length":5}"#, Some("from must hold finite numbers")),
    (r#"{"geometry":"e3","from":7,"direction":[3,4,0],"length":5}"#, Some("from must be a list of numbers")),
    (r#"{"geometry":"e3","from":[0,0,0],"direction":[3,4,0],"length":null}"#, Some("length must be a number")),
    (r#"{"geometry":3,"from":[0,0,0],"direction":[3,4,0],"length":1}"#, Some("geometry must be a string")),
    (
        r#"{"geometry":"e3","from":[0,0,0],"direction":[3,4,0],"length":1e999}"#,
        Some("line 15, column 66: no JSON object: number out of range"),
    ),
    (
        r#"{"geometry":"s3","from":[0,0,0,0],"direction":[3,4,0,0],"length":1}"#,
        Some("point (0, 0, 0, 0) is not a point of s3"),
    ),
    (r#"{"geometry":"h3","from":[0,0,0,1],"direction":[1e-30,0,0,0],"length":1}"#, None),
    (r#"{"geometry":"h3","from":[0,0,0,1],"direction":[1e25,0,0,0],"length":1}"#, None),
];

fn mixed() -> Vec<u8> {
    MIXED.iter().flat_map(|(line, _)| [line.as_bytes(), b"\n"].concat()).collect()
}

/// The answers to [`MIXED`], of which the last two are compared with closed forms.
fn check_mixed(answers: &[Value], tolerance: f64) {
    assert_eq!(answers.len(), MIXED.len());
    for (answer, (line, refusal)) in answers.iter().zip(MIXED) {
        match refusal {
            Some(error) => assert_eq!(answer, &json!({ "error": error }), "{line}"),
            None => assert!(answer["error"].is_null() && answer["point"].is_array(), "{line}: {answer}"),
        }
    }
    assert!(difference(&answers[0], &[4.0, 6.0, 3.0], &[0.6, 0.8, 0.0]) < tolerance);
    let (ch, sh) = (1_f64.cosh(), 1_f64.sinh());
    for answer in &answers[MIXED.len() - 2..] {
        assert!(difference(answer, &[sh, 0.0, 0.0, ch], &[ch, 0.0, 0.0, sh]) < tolerance, "{answer}");
    }
}

#[test]
fn geodesic_batch_refuses_line_by_line() {
    let place = Place::new();
    let answers = place.feed(&["geodesic", "--batch", "-"], &mixed()).json_lines();
    check_mixed(&answers, 1e-14);
    place.write("cases.jsonl", mixed());
    assert_eq!(place.run(&["geodesic", "--batch", "cases.jsonl"]).json_lines(), answers);
    let names = place.feed(&["geodesic", "--batch", "-"], br#"{"geometry":"x","from":[],"direction":[],"length":0}"#);
    let error = names.json_lines()[0]["error"].as_str().map(str::to_owned).expect("a refusal");
    assert!(error.starts_with("unknown geometry \"x\"; known are e3, s3, h3"), "{error}");
}

#[test]
fn geodesic_batch_refuses_the_same_in_f32() {
    check_mixed(&Place::new().feed(&["geodesic", "--batch", "-", "--precision", "f32"], &mixed()).json_lines(), 1e-6);
}

#[test]
fn geodesic_batch_refuses_the_same_on_the_device() {
    let Some((_turn, _)) = gpu_turn() else { return };
    check_mixed(&Place::new().feed(&["geodesic", "--batch", "-", "--backend", "compute"], &mixed()).json_lines(), 1e-6);
}

/// Lengths that leave the range of the numbers, and the largest power of ten that does not.
fn far(backend: &[&str], precision: &str, [inside, outside]: [f64; 2]) {
    let line =
        |length| format!("{{\"geometry\":\"h3\",\"from\":[0,0,0,1],\"direction\":[1,0,0,0],\"length\":{length}}}\n");
    let input = line(outside) + &line(inside) + &line(-outside);
    let answers = Place::new().feed(&[&["geodesic", "--batch", "-"], backend].concat(), input.as_bytes()).json_lines();
    let refusal =
        |length| json!({"error": format!("the end point after length {length} leaves the range of {precision} in h3")});
    assert_eq!((&answers[0], &answers[2]), (&refusal(outside), &refusal(-outside)));
    let reached = answers[1]["point"][3].as_f64().expect("a point");
    assert!((reached / inside.cosh() - 1.0).abs() < 1e-4, "{reached}");
}

#[test]
fn geodesic_that_leaves_the_range_is_refused() {
    far(&[], "f64", [700.0, 800.0]);
    far(&["--precision", "f32"], "f32", [80.0, 100.0]);
    far(&["--precision", "f32", "--backend", "cpu"], "f32", [80.0, 800.0]);
    let place = Place::new();
    let args = ["geodesic", "--geometry=h3", "--from=0,0,0,1", "--direction=1,0,0,0", "--length=800"];
    assert_eq!(place.refusal(&args), "the end point after length 800 leaves the range of f64 in h3");
}

#[test]
fn geodesic_that_leaves_the_range_is_refused_on_the_device() {
    let Some((_turn, _)) = gpu_turn() else { return };
    far(&["--backend", "compute"], "f32", [80.0, 100.0]);
    far(&["--precision", "f32", "--backend", "auto"], "f32", [80.0, 800.0]);
}

#[test]
fn geodesic_batch_refuses_bytes_that_are_no_text_alone() {
    let good = r#"{"geometry":"e3","from":[0,0,0],"direction":[0,0,1],"length":1}"#;
    let input = [good.as_bytes(), b"\n\n{\"geometry\":\"e3\xff\"}\r\n  \n", good.as_bytes()].concat();
    let answers = Place::new().feed(&["geodesic", "--batch", "-"], &input).json_lines();
    assert_eq!(answers.len(), 3, "empty lines are passed over");
    assert_eq!(answers[0], answers[2]);
    let error = answers[1]["error"].as_str().expect("a refusal");
    assert!(error.starts_with("line 3, column "), "{error}");
}

#[test]
fn geodesic_arguments_are_refused_on_one_line() {
    let place = Place::new();
    let refusal = |args: &str| place.refusal(&args.split(' ').collect::<Vec<_>>());
    assert_eq!(refusal("geodesic"), "--geometry is missing (or use --batch)");
    assert_eq!(refusal("geodesic --geometry e3"), "--from is missing (or use --batch)");
    let start = "geodesic --geometry e3 --from 0,0,0";
    assert_eq!(
        refusal(&format!("{start} --direction 0,0,0 --length 0")),
        "direction (0, 0, 0) has no tangent part at the point: it must be finite and not zero"
    );
    assert_eq!(
        refusal(&format!("{start} --direction 0,nan,1 --length 0")),
        "invalid value '0,nan,1' for '--direction <U,V,..>': the number must be finite"
    );
    assert_eq!(
        refusal(&format!("{start} --direction 0,1 --length 0")),
        "invalid value '0,1' for '--direction <U,V,..>': expected 3 or 4 numbers separated by commas, found 2"
    );
    assert_eq!(refusal(&format!("{start} --direction 0,0,0,1 --length 0")), "direction needs 3 numbers in e3, found 4");
    assert_eq!(
        refusal(&format!("{start} --direction 0,0,1 --length inf")),
        "invalid value 'inf' for '--length <T>': the number must be finite"
    );
    assert_eq!(
        refusal(&format!("{start} --direction 0,0,1 --length 1 --precision f64 --backend compute")),
        "the device computes in f32: for f64 use --backend cpu"
    );
    let line = refusal("geodesic --geometry e4");
    assert!(line.starts_with("invalid value 'e4' for '--geometry <G>' [possible values: e3, s3, h3"), "{line}");
    let line = refusal("geodesic --batch no.jsonl");
    assert_eq!(line, "no.jsonl: No such file or directory (os error 2)");
    let line = refusal("geodesic --batch - --length 1");
    assert!(line.contains("'--batch <FILE>' cannot be used with"), "{line}");
}
