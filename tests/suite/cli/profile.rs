//! Frame time over bounces: what `profile` writes, what it compares and what it refuses.

use super::program::Place;
use serde_json::{Value, json};

const SCENES: [&str; 2] = ["mirrored-cube", "s2xs1"];

const SMALL: &[&str] = &[
    "profile",
    "mirrored-cube",
    "s2xs1",
    "--size",
    "16x12",
    "--bounces",
    "3,1",
    "--frames",
    "3",
    "--warm-up",
    "0",
    "--backend",
    "cpu",
    "--stereo",
    "-o",
];

fn profile(place: &Place, folder: &str, more: &[&str]) -> String {
    place.run(&[SMALL, &[folder], more].concat()).done()
}

fn report(place: &Place, folder: &str) -> Value {
    serde_json::from_slice(&place.read(&format!("{folder}/profile.json"))).expect("JSON")
}

fn rows<'a>(report: &'a Value, table: &str) -> &'a [Value] {
    report[table]["rows"].as_array().map_or(&[], Vec::as_slice)
}

/// What is wrong with a report of [`SMALL`], if anything is.
fn fault(report: &Value) -> Result<(), String> {
    if (&report["schema"], &report["command"]) != (&json!(1), &json!("profile")) {
        return Err(format!("schema {}, command {}", report["schema"], report["command"]));
    }
    for key in ["machine", "machine_after", "backends", "version", "bounces", "frames", "warm_up"] {
        if report["settings"].get(key).is_none() {
            return Err(format!("no setting {key}"));
        }
    }
    let of = |key: &str| rows(report, "frames").iter().map(|row| row[key].clone()).collect::<Vec<_>>();
    let expected: Vec<Value> = SCENES.iter().flat_map(|scene| vec![json!(scene); 4]).collect();
    if of("scene") != expected || of("bounces") != [1, 3, 1, 3, 1, 3, 1, 3].map(|n| json!(n)) {
        return Err(format!("rows {:?} {:?}", of("scene"), of("bounces")));
    }
    if of("eyes") != ["mono", "mono", "stereo", "stereo"].repeat(2).iter().map(|e| json!(e)).collect::<Vec<_>>() {
        return Err(format!("eyes {:?}", of("eyes")));
    }
    for row in rows(report, "frames") {
        let number = |key: &str| row[key].as_f64().filter(|x| *x >= 0.0).ok_or_else(|| format!("no {key} in {row}"));
        let ordered = |stem: &str| -> Result<bool, String> {
            let [low, middle, high] = ["p5", "median", "p95"].map(|end| number(&format!("{stem}_{end}")));
            let (low, middle, high) = (low?, middle?, high?);
            Ok(0.0 < low && low <= middle && middle <= high)
        };
        if !ordered("frame_ms")? || (cfg!(unix) && !ordered("cpu_ms")?) {
            return Err(format!("percentiles of {row}"));
        }
        for key in ["first_frame_ms", "fps", "nodes_per_pixel", "tests_per_pixel", "mrays_per_s", "ns_per_segment"] {
            number(key)?;
        }
        for key in ["memory_bytes", "load_ms", "shadow_segments_per_pixel", "parameter", "rays_per_pixel"] {
            number(key)?;
        }
        // Each pixel has one ray; a ray that passes n faces has n segments at least, in curved spaces more.
        let (segments, bounces) = (number("segments_per_pixel")?, number("bounces_per_pixel")?);
        if number("rays_per_pixel")? != 1.0 || segments < bounces.max(1.0) || bounces > number("bounces")? {
            return Err(format!("counts of {row}"));
        }
    }
    Ok(())
}

#[test]
fn profile_writes_what_it_promises() {
    let place = Place::new();
    let text = profile(&place, "p", &[]);
    let report = report(&place, "p");
    fault(&report).unwrap_or_else(|why| panic!("{why}"));
    for name in ["frame-ms", "ns-per-segment", "segments", "nodes", "tests"] {
        assert!(text.contains(&format!("{name}: ")), "{name} is not shown: {text}");
    }
    let csv = String::from_utf8(place.read("p/profile.csv")).expect("text");
    assert_eq!(csv.lines().count(), 1 + 8, "a line for each configuration under the names: {csv}");
    assert!(csv.starts_with("scene,backend,eyes,width,height,integrator,parameter,bounces,frames,frame_ms_median,"));
    let svg = |name: &str| String::from_utf8(place.read(name)).expect("text");
    let all = svg("p/profile.svg");
    assert!(all.starts_with("<svg") && all.contains("mirrored-cube cpu mono") && all.contains("s2xs1 cpu stereo"));
    assert_eq!(all.matches("<circle").count(), 8, "a point for each configuration");
    assert_eq!(svg("p/profile-s2xs1.svg").matches("<circle").count(), 4);
    // Both eyes are two pictures, so the counts per pixel are nearly those of one.
    let frames = rows(&report, "frames");
    let segments = |index: usize| frames[index]["segments_per_pixel"].as_f64().expect("a number");
    assert!((segments(3) / segments(1) - 1.0).abs() < 0.1 && segments(1) > segments(0), "{frames:#?}");
    // The sister: the check can fail.
    for (pointer, value) in [
        ("/schema", json!(2)),
        ("/frames/rows/1/bounces", json!(4)),
        ("/frames/rows/0/frame_ms_p5", json!(1e9)),
        ("/frames/rows/5/memory_bytes", Value::Null),
        ("/frames/rows/7/segments_per_pixel", json!(0.5)),
        ("/settings", json!({})),
    ] {
        let mut spoilt = report.clone();
        *spoilt.pointer_mut(pointer).expect(pointer) = value;
        assert!(fault(&spoilt).is_err(), "{pointer} is not looked at");
    }
}

/// Counts repeat from run to run, are those of `render --stats`, and `--compare` says so; a spoilt count is seen.
#[test]
fn profile_counts_repeat_and_compare() {
    let place = Place::new();
    profile(&place, "old", &[]);
    let text = profile(&place, "new", &["--compare", "old/profile.json"]);
    assert!(text.contains("comparison: "), "{text}");
    let (old, new) = (report(&place, "old"), report(&place, "new"));
    fault(&new).unwrap_or_else(|why| panic!("{why}"));
    let counts = ["segments_per_pixel", "bounces_per_pixel", "nodes_per_pixel", "tests_per_pixel"];
    let differ = |a: &Value, b: &Value| {
        let pairs = rows(a, "frames").iter().zip(rows(b, "frames"));
        pairs.filter(|(a, b)| counts.iter().any(|key| a[*key] != b[*key])).count()
    };
    assert_eq!(differ(&old, &new), 0, "counts do not repeat");
    let ratios = |report: &Value| -> Vec<f64> {
        let of = |row: &Value| counts.map(|key| row[format!("{key}_ratio")].as_f64().unwrap_or(f64::NAN));
        rows(report, "comparison").iter().flat_map(of).collect()
    };
    assert_eq!(ratios(&new), [1.0; 32], "{new:#}");
    for row in rows(&new, "comparison") {
        let [before, now, ratio] = ["before", "now", "ratio"].map(|end| row[format!("frame_ms_{end}")].as_f64());
        let expected = now.expect("a time") / before.expect("a time");
        assert!((ratio.expect("a ratio") / expected - 1.0).abs() < 1e-12, "{row}");
    }
    let csv = String::from_utf8(place.read("new/profile-comparison.csv")).expect("text");
    assert_eq!(csv.lines().count(), 1 + 8);

    place
        .run(&[
            "render",
            SCENES[0],
            "-o",
            "x.png",
            "--size",
            "16x12",
            "--bounces",
            "3",
            "--backend",
            "cpu",
            "--stats",
            "x.json",
        ])
        .done();
    let stats: Value = serde_json::from_slice(&place.read("x.json")).expect("JSON");
    let of_row = |key: &str| rows(&new, "frames")[1][key].as_f64();
    for (key, counter) in
        [("segments_per_pixel", "segments"), ("bounces_per_pixel", "bounces"), ("nodes_per_pixel", "nodes")]
    {
        assert_eq!(of_row(key), stats["per_pixel"][counter].as_f64(), "{counter}");
    }

    let mut spoilt = old.clone();
    let count = spoilt.pointer_mut("/frames/rows/2/nodes_per_pixel").expect("a row");
    *count = json!(count.as_f64().expect("a number") + 1.0 / 192.0);
    assert_eq!(differ(&spoilt, &new), 1, "a spoilt count is not seen");
    place.write("spoilt.json", spoilt.to_string());
    profile(&place, "third", &["--compare", "spoilt.json"]);
    let found = ratios(&report(&place, "third"));
    assert_eq!(found.iter().filter(|ratio| **ratio != 1.0).count(), 1, "{found:?}");
}

#[test]
fn profile_varies_tolerances_of_curved_scenes_alone() {
    let place = Place::new();
    let args =
        ["profile", "mirrored-cube", "s2xs1", "--size", "12x8", "--bounces", "2", "--frames", "1", "--backend", "cpu"];
    place.run(&[&args[..], &["--tolerances", "0.1,0.001", "-o", "t"]].concat()).done();
    let tolerances = report(&place, "t");
    let parameters: Vec<&Value> = rows(&tolerances, "frames").iter().map(|row| &row["parameter"]).collect();
    assert_eq!(parameters, [&json!(0.005), &json!(0.1), &json!(0.001)]);
    let segments = |row: usize| rows(&tolerances, "frames")[row]["segments_per_pixel"].as_f64().expect("a number");
    assert!(segments(2) > segments(1), "a finer tolerance has more arcs");
    place.run(&[&args[..], &["--integrator", "euler", "--steps", "0.5,0.1", "-o", "s"]].concat()).done();
    let steps = report(&place, "s");
    let names: Vec<&Value> = rows(&steps, "frames").iter().map(|row| &row["integrator"]).collect();
    assert_eq!(names, [&json!("exact"), &json!("euler"), &json!("euler")]);
}

#[test]
fn profile_refuses_on_one_line_and_leaves_nothing() {
    let place = Place::new();
    place.write("other.json", json!({ "schema": 77, "command": "profile" }).to_string());
    place.write("accuracy.json", json!({ "schema": 1, "command": "accuracy" }).to_string());
    place.write("none.json", json!({ "schema": 1, "command": "profile", "frames": { "rows": [] } }).to_string());
    place.write("text.json", "no");
    place.write("file", "");
    let refusal =
        |args: &[&str]| place.refusal(&[&["profile", "torus", "--size", "4x4", "--warm-up", "0"], args].concat());
    for (file, part) in [
        ("other.json", "other.json: schema 77 cannot be compared with schema 1"),
        ("accuracy.json", "accuracy.json: a report of the command \"accuracy\", not of profile"),
        ("none.json", "none.json: has none of these configurations"),
        ("text.json", "text.json: expected ident"),
        ("missing.json", "missing.json: No such file"),
    ] {
        let line = refusal(&["--backend", "cpu", "--compare", file, "-o", "out"]);
        assert!(line.starts_with(part), "{line}");
    }
    for (args, part) in [
        (&["--bounces", "0", "-o", "out"][..], "invalid value '0' for '--bounces"),
        (&["--bounces", "1,x", "-o", "out"], "invalid value 'x' for '--bounces"),
        (&["--backend", "cpu,gpu", "-o", "out"], "invalid value 'gpu' for '--backend"),
        (&["--frames", "0", "-o", "out"], "invalid value '0' for '--frames"),
        (&["--steps", "0.1", "-o", "out"], "--step needs --integrator euler or rk4"),
        (
            &["--tolerances", "0.1", "--backend", "cpu", "-o", "out"],
            "--integrator, --steps, --tolerances: geodesics are straight",
        ),
        (&["--book", "-o", "out"], "the argument '--size <WxH,..>' cannot be used with '--book'"),
        (&["--backend", "cpu", "-o", "file"], "file: "),
        (&[], "the following required arguments were not provided"),
        (&["nowhere", "-o", "out"], "nowhere"),
    ] {
        let line = refusal(args);
        assert!(line.contains(part), "{args:?}: {line}");
    }
}
