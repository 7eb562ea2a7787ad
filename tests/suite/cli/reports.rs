//! What is reported: spaces, devices, help and version.

use super::program::Place;
use serde_json::{Value, json};

/// What is wrong with a report of `check --json`, if anything is.
fn fault(report: &Value, homology: &Value) -> Result<(), String> {
    let object = report.as_object().ok_or("no object")?;
    for key in ["geometry", "faces", "pairing_residual", "edge_cycles", "volume", "homology", "kind"] {
        if !object.contains_key(key) {
            return Err(format!("no key {key}"));
        }
    }
    let small = |value: &Value| value.as_f64().is_some_and(|x| x.abs() < 1e-12);
    let cycles = report["edge_cycles"].as_array().filter(|list| !list.is_empty()).ok_or("no edge cycles")?;
    for cycle in cycles {
        let keys: Vec<&str> = cycle.as_object().ok_or("no object")?.keys().map(String::as_str).collect();
        let angle = cycle["angle"].as_f64().ok_or("no angle")? - std::f64::consts::TAU;
        if keys != ["angle", "length", "residual"] || !small(&cycle["residual"]) || angle.abs() > 1e-12 {
            return Err(format!("cycle {cycle}"));
        }
    }
    if !small(&report["pairing_residual"]) || report["homology"] != *homology {
        return Err(format!("residual {}, homology {}", report["pairing_residual"], report["homology"]));
    }
    Ok(())
}

#[test]
fn report_of_a_space_has_the_keys_agreed_upon() {
    let place = Place::new();
    for (name, geometry, faces, cycles, homology, expected) in [
        ("torus", "e3", 6, 3, json!([0, 0, 0]), 1.0),
        ("poincare", "s3", 12, 10, json!([]), std::f64::consts::PI.powi(2) / 60.0),
        ("seifert-weber", "h3", 12, 6, json!([5, 5, 5]), 11.199_064_740_8),
    ] {
        let report = place.run(&["check", name, "--json"]).json();
        fault(&report, &homology).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!(report["geometry"], geometry);
        assert_eq!((report["faces"].as_u64(), &report["kind"]), (Some(faces), &json!("manifold")));
        assert_eq!(report["edge_cycles"].as_array().map(Vec::len), Some(cycles));
        let volume = report["volume"].as_f64().expect("a number");
        assert!((volume - expected).abs() < 1e-9, "{name}: {volume}");
        // The sister: the check of the report can fail.
        assert!(fault(&report, &json!([7])).is_err());
        let mut spoilt = report.clone();
        spoilt["edge_cycles"][0]["angle"] = json!(6.2);
        assert!(fault(&spoilt, &homology).is_err());
        spoilt = report;
        spoilt.as_object_mut().map(|object| object.remove("volume"));
        assert!(fault(&spoilt, &homology).is_err());
    }
    let orbifold = place.run(&["check", "mirrored-cube", "--json"]).json();
    assert_eq!(orbifold["kind"], "orbifold");
}

#[test]
fn report_of_a_space_is_readable() {
    let text = Place::new().run(&["check", "seifert-weber"]).done();
    assert!(text.starts_with("seifert-weber: manifold with geometry h3, orientable\n"), "{text}");
    assert!(text.contains("\nfirst homology    Z/5 + Z/5 + Z/5\n"), "{text}");
    assert!(text.contains("\nedge cycle 5   length 5, angle 6.28318530718"), "{text}");
}

#[test]
fn report_of_the_space_of_a_scene_file() {
    let place = Place::new();
    place.write("my.toml", "[space]\nmanifold = \"torus\"\n");
    let report = place.run(&["check", "my.toml", "--json"]).json();
    assert_eq!(report["homology"], json!([0, 0, 0]));
    place.write("my.toml", "[space]\nmanifold = \"torus\"\n[observer]\nfov = 0\n");
    assert_eq!(place.refusal(&["check", "my.toml"]), "my.toml:4:7: fov: 0 is out of range: above 0, below 180");
    assert_eq!(place.refusal(&["check", "my.json"]), "my.json: No such file or directory (os error 2)");
}

#[test]
fn report_of_devices_names_backends() {
    let place = Place::new();
    let report = place.run(&["devices", "--json"]).json();
    assert_eq!(report["cpu"]["backends"]["cpu"], json!({"runs": true, "lacks": []}));
    assert!(report["openxr"].is_object());
    let devices = report["devices"].as_array().expect("a list");
    assert!(!devices.is_empty() || report["vulkan"].is_string(), "no device, and no reason: {report}");
    for device in devices {
        for key in ["index", "name", "kind", "driver", "vulkan", "memory_bytes"] {
            assert!(!device[key].is_null(), "{key}: {device}");
        }
        let compute = &device["backends"]["compute"];
        let lacks = compute["lacks"].as_array().expect("a list");
        assert_eq!(compute["runs"].as_bool(), Some(lacks.is_empty()), "{device}");
    }
    let text = place.run(&["devices"]).done();
    assert!(text.starts_with("cpu: "), "{text}");
    assert_eq!(text.lines().filter(|line| line.starts_with("device ")).count(), devices.len());
}

#[test]
fn help_and_version_are_no_errors() {
    let place = Place::new();
    let version = place.run(&["--version"]);
    assert_eq!(version.done(), concat!("holonomy ", env!("CARGO_PKG_VERSION"), "\n"));
    for args in [&["--help"][..], &["-h"], &["help"], &["render", "--help"], &["help", "transport"]] {
        let run = place.run(args);
        assert_eq!(run.err, "");
        let text = run.done();
        assert!(text.contains("Usage: holonomy"), "{text}");
        // Colours are for terminals.
        assert!(!text.contains('\u{1b}'), "{text:?}");
    }
    let help = place.run(&["--help"]).done();
    for command in ["render", "check", "devices", "geodesic", "transport"] {
        assert!(help.contains(&format!("\n  {command} ")), "{command}");
        assert!(place.run(&[command, "--help"]).done().contains(&format!("Usage: holonomy {command}")));
    }
}
