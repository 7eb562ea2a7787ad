//! Geodesics and pixels' rays through the faces, as JSON.

use super::program::Place;
use serde_json::{Value, json};

/// What is wrong with the events of a pixel's ray in a geometry with so many components, if anything is.
fn fault(ray: &Value) -> Result<(), String> {
    let keys: Vec<&str> = ray.as_object().ok_or("no object")?.keys().map(String::as_str).collect();
    if keys != ["direction", "events", "from"] {
        return Err(format!("keys {keys:?}"));
    }
    let hyperbolic = hyperbolic(ray);
    let unit = |v: &Value| (inner(v, v, hyperbolic) - 1.0).abs() < 1e-9;
    if !unit(&ray["direction"]) {
        return Err("the direction is no unit vector".to_owned());
    }
    let events = ray["events"].as_array().ok_or("no list of events")?;
    let (last, faces) = events.split_last().ok_or("no events")?;
    let mut length = 0.0;
    for event in events {
        let next = event["length"].as_f64().ok_or("no length")?;
        if next <= length || event["cell"].as_u64().is_none() || event["point"].as_array().is_none() {
            return Err(format!("event {event} after length {length}"));
        }
        length = next;
    }
    if !faces.iter().all(|event| event["kind"] == "face" && event["face"].is_u64()) {
        return Err("something else than a face before the last event".to_owned());
    }
    match last["kind"].as_str() {
        Some("limit") => Ok(()),
        Some("hit") => {
            let (normal, point) = (&last["normal"], &last["point"]);
            let tangent =
                point.as_array().is_none_or(|p| p.len() == 3 || inner(normal, point, hyperbolic).abs() < 1e-9);
            let whole = last["object"].is_u64() && last["name"].is_string() && unit(normal) && tangent;
            if whole { Ok(()) } else { Err(format!("hit {last}")) }
        }
        _ => Err(format!("last event {last}")),
    }
}

/// Whether the ray's points are on the hyperboloid.
fn hyperbolic(ray: &Value) -> bool {
    (inner(&ray["from"], &ray["from"], true) + 1.0).abs() < 1e-9
}

fn inner(a: &Value, b: &Value, hyperbolic: bool) -> f64 {
    let at = |v: &Value, i: usize| v[i].as_f64().unwrap_or(0.0);
    let sign = if hyperbolic { -1.0 } else { 1.0 };
    (0..3).map(|i| at(a, i) * at(b, i)).sum::<f64>() + sign * at(a, 3) * at(b, 3)
}

#[test]
fn transport_of_pixels_lists_what_rays_meet() {
    let place = Place::new();
    for scene in ["torus", "poincare", "seifert-weber", "mirrored-cube", "knot"] {
        let mut kinds = Vec::new();
        for pixel in ["0,0", "31,23", "16,12", "5,20", "27,3", "10,10", "20,15", "3,11"] {
            let args = ["transport", scene, "--pixel", pixel, "--size", "32x24", "--bounces", "9"];
            let ray = place.run(&args).json();
            fault(&ray).unwrap_or_else(|e| panic!("{scene} {pixel}: {e}"));
            let events = ray["events"].as_array().expect("events");
            let last = events.last().expect("an event");
            if last["kind"] == "limit" {
                assert_eq!(events.len(), 10, "nine faces and the limit: {ray}");
            }
            kinds.extend(last["kind"].as_str().map(str::to_owned));
        }
        assert!(kinds.iter().any(|kind| kind == "hit"), "{scene}: no ray hits anything");
    }
}

#[test]
fn transport_event_check_notices_faults() {
    let place = Place::new();
    let ray = place.run(&["transport", "knot", "--pixel", "16,12", "--size", "32x24"]).json();
    assert_eq!(fault(&ray), Ok(()));
    let events = ray["events"].as_array().expect("events").len();
    assert!(ray["events"][events - 1]["kind"] == "hit", "{ray}");
    let last = format!("/events/{}", events - 1);
    let spoil = |pointer: String, value: Value| {
        let mut spoilt = ray.clone();
        *spoilt.pointer_mut(&pointer).expect("a value") = value;
        spoilt
    };
    for spoilt in [
        spoil("/direction/0".to_owned(), json!(0.99)),
        spoil(format!("{last}/normal/1"), json!(0.99)),
        spoil(format!("{last}/kind"), json!("face")),
        spoil(format!("{last}/length"), json!(-1.0)),
        spoil(format!("{last}/object"), json!("knot")),
        spoil("/events".to_owned(), json!([])),
    ] {
        assert!(fault(&spoilt).is_err(), "{spoilt}");
    }
}

/// The torus, whose faces are named by how a geodesic along an axis passes them.
#[test]
fn transport_passes_faces_in_order() {
    let place = Place::new();
    let follow = |direction: &str, length: &str| {
        let (direction, length) = (format!("--direction={direction}"), format!("--length={length}"));
        place.run(&["transport", "torus", "--from", "0.5,0.5,0.5", &direction, &length]).json()
    };
    let end = follow("1,0,0", "2.2");
    let keys: Vec<&str> = end.as_object().expect("an object").keys().map(String::as_str).collect();
    assert_eq!(keys, ["cell", "direction", "faces", "point"]);
    assert_eq!((&end["cell"], &end["faces"]), (&json!(0), &json!([0, 0])));
    assert!((end["point"][0].as_f64().expect("a number") - 0.7).abs() < 1e-14);
    assert_eq!(follow("-1,0,0", "1.2")["faces"], json!([1]));
    assert_eq!(follow("1,0,0", "-1.2")["faces"], json!([1]));
    assert_eq!(follow("0,1,0", "1.2")["faces"], json!([2]));
    assert_eq!(follow("0,0,-1", "0.2")["faces"], json!([]));
    // First x, then z: 0.5 is reached after 0.5·√1.25 and after √1.25.
    assert_eq!(follow("2,0,1", "1.3")["faces"], json!([0, 4]));
    assert_eq!(follow("1,0,2", "1.3")["faces"], json!([4, 0]));
}

#[test]
fn transport_batch_refuses_line_by_line() {
    let good = r#"{"from":[0.5,0.5,0.5],"direction":[1,0,0],"length":2.2}"#;
    let lines = [
        (good, None),
        (
            r#"{"from":[0.5,0.5,0.5],"direction":[0,0,0],"length":0}"#,
            Some("direction (0, 0, 0) has no tangent part at the point: it must be finite and not zero"),
        ),
        (r#"{"from":[0.5,0.5],"direction":[1,0,0],"length":1}"#, Some("from needs 3 numbers in e3, found 2")),
        (
            r#"{"geometry":"e3","from":[0.5,0.5,0.5],"direction":[1,0,0],"length":1}"#,
            Some(r#"unknown key "geometry"; known are from, direction, length"#),
        ),
        (
            r#"{"from":[0.5,0.5,0.5],"direction":[1,0,0],"length":1e9}"#,
            Some("length 1000000000 is out of range: at most 10000000"),
        ),
        ("nothing", Some("line 6, column 2: no JSON object: expected ident")),
        (good, None),
    ];
    let input: String = lines.iter().map(|(line, _)| format!("{line}\n")).collect();
    let place = Place::new();
    let answers = place.feed(&["transport", "torus", "--batch", "-"], input.as_bytes()).json_lines();
    assert_eq!(answers.len(), lines.len());
    for (answer, (line, refusal)) in answers.iter().zip(lines) {
        match refusal {
            Some(error) => assert_eq!(answer, &json!({ "error": error }), "{line}"),
            None => assert_eq!(answer["faces"], json!([0, 0]), "{line}"),
        }
    }
    // Scales of directions do not matter.
    for scale in ["1e-30", "1e25"] {
        let line = good.replace("[1,", &format!("[{scale},"));
        assert_eq!(place.feed(&["transport", "torus", "--batch", "-"], line.as_bytes()).json_lines()[0], answers[0]);
    }
}

#[test]
fn transport_arguments_are_refused_on_one_line() {
    let place = Place::new();
    let refusal = |args: &str| place.refusal(&args.split(' ').collect::<Vec<_>>());
    assert_eq!(refusal("transport torus"), "--from is missing (or use --batch or --pixel)");
    assert_eq!(refusal("transport torus --pixel 32,2 --size 32x32"), "--pixel 32,2: outside of the picture of 32x32");
    assert_eq!(
        refusal("transport torus --pixel 3"),
        "invalid value '3' for '--pixel <X,Y>': expected COLUMN,ROW, such as 320,200"
    );
    let start = "--from 0,0,0 --direction 1,0,0 --length 1";
    assert_eq!(refusal(&format!("transport torus --cell 1 {start}")), "--cell 1: the last cell of torus is 0");
    let line = refusal(&format!("transport no {start}"));
    assert!(line.starts_with("no: no such file, and no scene of this name: "), "{line}");
    assert_eq!(refusal(&format!("transport no.json {start}")), "no.json: No such file or directory (os error 2)");
    let line = refusal(&format!("transport torus --pixel 1,1 {start}"));
    assert!(line.contains("'--pixel <X,Y>' cannot be used with"), "{line}");
}
