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
