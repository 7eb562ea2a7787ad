//! Machines without Vulkan, with another device than the one asked for, and with the validation layer.

use super::program::Place;
use crate::support::{gpu_turn, skip};
use holonomy::vulkan::Validation;

/// A loader that is shown no driver finds no device. The second name is the older one.
const NO_DRIVERS: &[(&str, &str)] =
    &[("VK_DRIVER_FILES", "/no/such/driver.json"), ("VK_ICD_FILENAMES", "/no/such/driver.json")];

const PICTURE: &[&str] = &["render", "torus", "-o", "out.png", "--size", "16x12"];

#[test]
fn without_vulkan_pictures_are_made_on_the_cpu() {
    let place = Place::new();
    let run = place.run_with(NO_DRIVERS, PICTURE);
    assert_eq!((run.code, run.out.as_str()), (Some(0), ""), "{run:?}");
    assert!(run.err.starts_with("backend cpu: no Vulkan device can be used ("), "{run:?}");
    assert_eq!(run.err.lines().count(), 1, "{run:?}");
    let automatic = place.read("out.png");
    place.run(&[PICTURE, &["--backend", "cpu"]].concat()).done();
    assert!(automatic == place.read("out.png"), "not the picture of the cpu");
}

#[test]
fn without_vulkan_compute_fails_on_one_line() {
    let place = Place::new();
    let run = place.run_with(NO_DRIVERS, &[PICTURE, &["--backend", "compute"]].concat());
    let line = run.error(2).expect("one line");
    assert!(line.contains("no Vulkan"), "{line}");
    let start = ["--geometry=e3", "--from=0,0,0", "--direction=0,0,1", "--length=1"];
    let run = place.run_with(NO_DRIVERS, &[&["geodesic", "--backend", "compute"], &start[..]].concat());
    assert_eq!(run.error(2).expect("one line"), line);
    assert!(place.files().is_empty(), "{:?}", place.files());
}

#[test]
fn without_vulkan_devices_are_the_cpu() {
    let place = Place::new();
    let report = place.run_with(NO_DRIVERS, &["devices", "--json"]).json();
    assert_eq!(report["devices"], serde_json::json!([]));
    assert!(report["vulkan"].as_str().is_some_and(|why| why.contains("no Vulkan")), "{report}");
    assert_eq!(report["cpu"]["backends"]["cpu"]["runs"], true);
    assert!(place.run_with(NO_DRIVERS, &["devices"]).done().contains("\nVulkan: no Vulkan"));
}

#[test]
fn device_that_is_not_there_is_refused_by_name() {
    let place = Place::new();
    let Some((_turn, _)) = gpu_turn() else { return };
    let devices = place.run(&["devices", "--json"]).json();
    let names: Vec<String> = devices["devices"]
        .as_array()
        .expect("a list")
        .iter()
        .map(|d| format!("{}: {}", d["index"], d["name"].as_str().expect("a name")))
        .collect();
    // What is asked for by name is not replaced in silence, so `auto` refuses as well.
    for backend in ["compute", "auto"] {
        let run = place.run_with(&[("HOLONOMY_DEVICE", "nonsense")], &[PICTURE, &["--backend", backend]].concat());
        let expected = format!("no Vulkan device is called \"nonsense\"; there are {}", names.join(", "));
        assert_eq!(run.error(1), Ok(expected.as_str()));
    }
    assert!(place.files().is_empty(), "{:?}", place.files());
    // The sister: the first device by its index.
    let args = [PICTURE, &["--backend", "compute"]].concat();
    let run = place.run_with(&[("HOLONOMY_DEVICE", "0")], &args);
    if devices["devices"][0]["backends"]["compute"]["runs"] == true {
        run.done();
    }
}

#[test]
fn validation_variable_with_another_value_is_refused() {
    let place = Place::new();
    for args in [&[PICTURE, &["--backend", "compute"]].concat()[..], PICTURE, &["devices"]] {
        let run = place.run_with(&[("HOLONOMY_VALIDATION", "yes")], args);
        assert_eq!(run.error(1), Ok("HOLONOMY_VALIDATION=\"yes\" is not one of 0, 1, sync"));
    }
}

#[test]
fn validation_is_silent_while_pictures_are_made() {
    let Some((_turn, options)) = gpu_turn() else { return };
    if options.validation == Validation::Off {
        return skip("validation", "the layer is not installed");
    }
    let place = Place::new();
    for level in ["1", "sync"] {
        for scene in ["torus", "poincare", "leaves"] {
            let args = ["render", scene, "-o", "out.png", "--size", "16x12", "--backend", "compute", "--stereo"];
            let run = place.run_with(&[("HOLONOMY_VALIDATION", level)], &args);
            assert_eq!((run.code, run.out.as_str()), (Some(0), ""), "{run:?}");
            assert!(run.err.starts_with("backend compute: ") && run.err.lines().count() == 1, "{run:?}");
        }
    }
}

#[test]
fn automatic_choice_says_which_and_why() {
    let Some((_turn, _)) = gpu_turn() else { return };
    let place = Place::new();
    let run = place.run(PICTURE);
    assert_eq!(run.code, Some(0), "{run:?}");
    assert!(run.err.starts_with("backend ") && run.err.lines().count() == 1, "{run:?}");
    assert!(run.err.trim_end().ends_with(')'), "no reason: {run:?}");
    // Repeated on the device, a picture is the same.
    let first = place.read("out.png");
    place.run(PICTURE).done();
    assert!(first == place.read("out.png"), "the same arguments gave another picture");
}

/// The device for ray tracing, as an index.
fn rt_device(place: &Place) -> Option<String> {
    let devices = place.run(&["devices", "--json"]).json();
    let can = |d: &&serde_json::Value| d["backends"]["rt"]["runs"] == true;
    let found = devices["devices"].as_array().expect("a list").iter().find(can);
    if found.is_none() {
        skip("rt", "no device with ray tracing");
    }
    found.map(|d| d["index"].to_string())
}

#[test]
fn devices_say_what_each_lacks_for_each_backend() {
    let place = Place::new();
    let report = place.run(&["devices", "--json"]).json();
    for device in report["devices"].as_array().expect("a list") {
        for backend in ["rt", "compute"] {
            let verdict = &device["backends"][backend];
            let lacks = verdict["lacks"].as_array().expect("a list");
            assert_eq!(verdict["runs"], lacks.is_empty(), "{device}");
        }
    }
}

#[test]
fn rt_draws_with_silent_validation_and_says_what_it_built() {
    let place = Place::new();
    let Some(device) = rt_device(&place) else { return };
    let Some((_turn, options)) = gpu_turn() else { return };
    let level = if options.validation == Validation::Off { "0" } else { "sync" };
    let run = |args: &[&str]| {
        let variables = [("HOLONOMY_VALIDATION", level), ("HOLONOMY_DEVICE", device.as_str())];
        place.run_with(&variables, &[&["render", "poincare", "-o", "out.png", "--size", "16x12"], args].concat())
    };
    let drawn = run(&["--backend", "rt", "--stats", "stats.json"]);
    assert_eq!((drawn.code, drawn.err.lines().count()), (Some(0), 1), "{drawn:?}");
    assert!(drawn.err.starts_with("backend rt: "), "{drawn:?}");
    let stats: serde_json::Value = serde_json::from_slice(&place.read("stats.json")).expect("JSON");
    let built = &stats["acceleration"];
    assert!(built["bottom_structures"].as_u64() > Some(1) && built["instances"].as_u64() > Some(1), "{built}");
    let bytes = |key: &str| built[key].as_u64().expect("a number");
    assert!(bytes("bottom_bytes") > 0 && bytes("bottom_bytes") <= bytes("bottom_bytes_before_compaction"), "{built}");
    assert!(stats["counts"]["nodes"].is_null() && stats["counts"]["segments"].as_u64() > Some(100), "{stats}");
    // Its sister, the recursive variant, draws the same; deeper than the device permits it is refused.
    let looped = place.read("out.png");
    assert_eq!(run(&["--backend", "rt", "--recursive", "--bounces", "10"]).code, Some(0));
    assert!(looped == place.read("out.png"), "the recursive variant drew another picture");
    let refused = run(&["--backend", "rt", "--recursive", "--bounces", "100000"]);
    let line = refused.error(1).expect("one line");
    assert!(line.starts_with("recursion to depth 100001 is needed, but "), "{line}");
    let refused = run(&["--backend", "cpu", "--recursive"]);
    assert_eq!(refused.error(1), Ok("--recursive is an experiment of the backend rt: add --backend rt"));
}

#[test]
fn rt_on_a_device_without_it_fails_on_one_line() {
    let place = Place::new();
    let report = place.run(&["devices", "--json"]).json();
    let without = report["devices"].as_array().expect("a list").iter().find(|d| d["backends"]["rt"]["runs"] == false);
    let Some(device) = without else { return };
    let index = device["index"].to_string();
    let run = place.run_with(&[("HOLONOMY_DEVICE", &index)], &[PICTURE, &["--backend", "rt"]].concat());
    let line = run.error(2).expect("one line");
    assert!(line.contains(" lacks ") && line.contains("VK_KHR_ray_tracing_pipeline"), "{line}");
    assert!(place.files().is_empty(), "{:?}", place.files());
}

#[test]
fn pipelines_are_kept_and_a_full_disk_is_a_warning() {
    let place = Place::new();
    let Some((_turn, _)) = gpu_turn() else { return };
    let args = [PICTURE, &["--backend", "compute", "--stats", "stats.json"]].concat();
    let found = |place: &Place| {
        let stats: serde_json::Value = serde_json::from_slice(&place.read("stats.json")).expect("JSON");
        stats["pipeline_cache"].as_str().expect("text").to_owned()
    };
    let folder = place.path().join("cache").display().to_string();
    for expected in ["absent", "used"] {
        assert_eq!(place.run_with(&[("HOLONOMY_CACHE", &folder)], &args).code, Some(0));
        assert_eq!(found(&place), expected);
    }
    place.write("blocked", "in the way");
    let blocked = place.path().join("blocked").display().to_string();
    let run = place.run_with(&[("HOLONOMY_CACHE", &blocked)], &args);
    assert_eq!(run.code, Some(0), "{run:?}");
    assert!(run.err.contains("\nwarning: pipeline cache "), "{run:?}");
    assert!(place.has("out.png"));
}
