//! Pictures: sizes, raw values against a closed form, both eyes, repetition, statistics, and that files appear whole.

use super::program::{Place, SMALL};
use image::{DynamicImage, GenericImageView};
use serde_json::Value;
use std::{
    fs,
    process::Stdio,
    thread,
    time::{Duration, Instant},
};

/// One ball in the torus, seen from a point of its axis through so many faces that everything near is met.
const BALL: &str = "
[space]
manifold = \"torus\"
[observer]
position = [0.5, 0.5, 0.9]
look = [0, 0, -1]
fov = 60
eye-distance = 0.1
[render]
bounces = 60
shading = \"distance\"
[[material]]
name = \"m\"
[[object]]
kind = \"ball\"
position = [0.5, 0.5, 0.4]
radius = 0.1
material = \"m\"
";

/// Distances beyond this are not compared: the closed form looks at the nearer copies of the ball only.
const FAR: f64 = 2.5;

/// Distance from `eye` to the nearest copy of the ball in the direction of each pixel.
fn distances(eye: [f64; 3], radius: f64, [width, height]: [u32; 2]) -> Vec<f64> {
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let up = 30_f64.to_radians().tan();
    let scale = 2.0 * up / f64::from(height);
    let ray = |i: u32, j: u32| {
        let x = (f64::from(i) + 0.5 - 0.5 * f64::from(width)) * scale;
        let y = (0.5 * f64::from(height) - f64::from(j) - 0.5) * scale;
        [x, y, -1.0].map(|c| c / (1.0 + x * x + y * y).sqrt())
    };
    let copies: Vec<[f64; 3]> = (0..7 * 7 * 7)
        .map(|n| [f64::from(n % 7) - 2.5, f64::from(n / 7 % 7) - 2.5, f64::from(n / 49) - 2.6])
        .map(|centre| [centre[0] - eye[0], centre[1] - eye[1], centre[2] - eye[2]])
        .collect();
    let nearest = |direction| {
        let hit = |centre: &[f64; 3]| {
            let along = dot(*centre, direction);
            let root = along * along - dot(*centre, *centre) + radius * radius;
            Some(along - root.sqrt()).filter(|t| root >= 0.0 && *t > 0.0)
        };
        copies.iter().filter_map(hit).fold(f64::INFINITY, f64::min)
    };
    (0..height).flat_map(|j| (0..width).map(move |i| (i, j))).map(|(i, j)| nearest(ray(i, j))).collect()
}

/// Largest difference of the red channel from the closed form, and how many pixels were compared.
fn deviation(picture: &DynamicImage, left: u32, expected: &[f64], width: u32) -> (f64, usize) {
    let values = picture.to_rgb32f();
    let mut worst = (0.0_f64, 0);
    for (index, expected) in expected.iter().enumerate() {
        let value = f64::from(values.get_pixel(left + index as u32 % width, index as u32 / width)[0]);
        if *expected < FAR {
            worst = (worst.0.max((value - expected).abs()), worst.1 + 1);
        } else if value < FAR - 1e-4 {
            worst.0 = f64::INFINITY;
        }
    }
    worst
}

fn open(place: &Place, name: &str) -> DynamicImage {
    image::open(place.path().join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
}

#[test]
fn picture_raw_distances_are_those_of_the_closed_form() {
    let place = Place::new();
    place.write("ball.toml", BALL);
    let size = [33, 21];
    place.run(&["render", "ball.toml", "-o", "out.exr", "--size", "33x21", "--backend", "cpu"]).done();
    let picture = open(&place, "out.exr");
    assert_eq!(picture.dimensions(), (33, 21));
    let centre = picture.to_rgb32f().get_pixel(16, 10)[0];
    assert!((centre - 0.4).abs() < 1e-7, "{centre}");
    // Rays that graze a ball magnify roundings.
    let tolerance = 1e-6;
    let eye = [0.5, 0.5, 0.9];
    let (worst, compared) = deviation(&picture, 0, &distances(eye, 0.1, size), 33);
    assert!(worst < tolerance && compared > 50, "{worst} of {compared}");
    // The sister: a ball of another size.
    assert!(deviation(&picture, 0, &distances(eye, 0.100_01, size), 33).0 > tolerance);

    // The left half is what the left eye sees.
    let args = ["render", "ball.toml", "-o", "both.exr", "--size", "33x21", "--stereo", "--backend", "cpu"];
    place.run(&args).done();
    let picture = open(&place, "both.exr");
    assert_eq!(picture.dimensions(), (66, 21));
    let eyes = [-0.05, 0.05].map(|side| distances([0.5 + side, 0.5, 0.9], 0.1, size));
    for (index, expected) in eyes.iter().enumerate() {
        let (worst, compared) = deviation(&picture, 33 * index as u32, expected, 33);
        assert!(worst < tolerance && compared > 50, "{worst} of {compared}");
        // Mirror symmetry alone would make the eyes alike: the halves are told apart.
        assert!(deviation(&picture, 33 - 33 * index as u32, expected, 33).0 > tolerance);
    }
}

#[test]
fn picture_raw_values_hold_infinity_where_nothing_is_hit() {
    let place = Place::new();
    place.write("ball.toml", BALL);
    // Past one face there are few balls.
    let args = ["render", "ball.toml", "-o", "out.exr", "--size", "33x21", "--backend", "cpu", "--bounces", "1"];
    place.run(&args).done();
    let picture = open(&place, "out.exr").to_rgb32f();
    assert_eq!(picture.get_pixel(0, 0)[0], f32::INFINITY);
    assert!((picture.get_pixel(16, 10)[0] - 0.4).abs() < 1e-7);
}

#[test]
fn picture_has_the_size_asked_for() {
    let place = Place::new();
    for (size, dimensions) in [("1x1", (1, 1)), ("7x3", (7, 3)), ("3X7", (3, 7)), ("64x1", (64, 1))] {
        place.run(&["render", "torus", "-o", "out.png", "--size", size, "--backend", "cpu"]).done();
        assert_eq!(open(&place, "out.png").dimensions(), dimensions);
    }
    let mut args = SMALL.to_vec();
    args.push("--stereo");
    place.run(&args).done();
    assert_eq!(open(&place, "out.png").dimensions(), (8, 4));
}

#[test]
fn picture_is_the_same_when_repeated() {
    let place = Place::new();
    let take = |name: &str, options: &[&str]| {
        let args = ["render", "torus", "-o", name, "--size", "48x36", "--backend", "cpu", "--samples", "4"];
        place.run(&[&args, options].concat()).done();
        place.read(name)
    };
    let first = take("a.png", &["--seed", "1"]);
    assert!(first == take("b.png", &["--seed", "1"]), "the same arguments gave another picture");
    // Counting does not change what is drawn, nor does the number of threads.
    assert!(first == take("c.png", &["--seed", "1", "--stats", "c.json"]), "counting changed the picture");
    let args =
        ["render", "torus", "-o", "e.png", "--size", "48x36", "--backend", "cpu", "--samples", "4", "--seed", "1"];
    place.run_with(&[("RAYON_NUM_THREADS", "1")], &args).done();
    assert!(first == place.read("e.png"), "one thread drew another picture");
    assert!(first != take("d.png", &["--seed", "2"]), "the seed changed nothing");
    let [a, d] = ["a.png", "d.png"].map(|name| open(&place, name).to_rgb8().into_raw());
    let difference = |a: &[u8], b: &[u8]| {
        let sum: u32 = a.iter().zip(b).map(|(a, b)| u32::from(a.abs_diff(*b))).sum();
        f64::from(sum) / a.len() as f64
    };
    let seeds = difference(&a, &d);
    assert!(seeds > 0.0 && seeds < 8.0, "{seeds}");
    // The sister: another view differs by more.
    let mut turned = d;
    turned.reverse();
    assert!(difference(&a, &turned) > 8.0);
}

#[test]
fn picture_is_found_from_any_folder() {
    let place = Place::new();
    // The name of a shipped scene, where there are no scenes.
    place.run(SMALL).done();
    // Files of a scene are beside the scene, outputs where the program runs.
    let mesh = holonomy::scene::shipped::asset("meshes/leaf.glb").expect("a mesh");
    place.write("deep/down/meshes/leaf.glb", mesh);
    let object = "[[object]]\nkind = \"mesh\"\nfile = \"meshes/leaf.glb\"\nposition = [0.5, 0.5, 0.5]\nscale = 0.2\n";
    place.write("deep/down/my.toml", format!("[space]\nmanifold = \"torus\"\n{object}"));
    place.write("work/here.txt", "");
    let size = ["--size", "4x4", "--backend", "cpu"];
    let mut command = place.command(&[&["render", "../deep/down/my.toml", "-o", "out.png"], &size[..]].concat());
    assert!(command.current_dir(place.path().join("work")).output().expect("a run").status.success());
    assert!(place.has("work/out.png") && !place.has("deep/down/out.png"));
    let path = place.path().join("deep/down/my.toml");
    place.run(&[&["render", path.to_str().expect("a path"), "-o", "out.exr"], &size[..]].concat()).done();
    assert!(place.has("out.exr"));
}

#[test]
fn picture_statistics_add_up() {
    let place = Place::new();
    let take = |scene: &str, options: &[&str]| -> Value {
        let args = ["render", scene, "-o", "out.png", "--stats", "out.json", "--size", "16x12", "--backend", "cpu"];
        place.run(&[&args, options].concat()).done();
        serde_json::from_slice(&place.read("out.json")).expect("JSON")
    };
    let plain = take("torus", &["--samples", "2", "--bounces", "5"]);
    for key in ["schema", "used", "left_out", "counts", "per_pixel", "time_ms", "backend", "device", "geometry"] {
        assert!(!plain[key].is_null(), "{key} is missing: {plain}");
    }
    assert_eq!((&plain["schema"], &plain["backend"], &plain["geometry"]), (&1.into(), &"cpu".into(), &"e3".into()));
    assert_eq!((plain["bounces"].as_u64(), plain["samples"].as_u64()), (Some(5), Some(2)));
    assert_eq!(plain["counts"]["rays"].as_u64(), Some(16 * 12 * 2));
    for (name, count) in plain["counts"].as_object().expect("counts") {
        let per_pixel = plain["per_pixel"][name].as_f64().expect("a number");
        assert_eq!(per_pixel * 192.0, count.as_f64().expect("a number"), "{name}");
    }
    let bounces = plain["per_pixel"]["bounces"].as_f64().expect("a number");
    assert!(bounces > 0.0 && bounces <= 10.0, "{bounces}");
    assert!(plain["time_ms"]["trace"].as_f64().is_some_and(|time| time > 0.0));
    let names = |value: &Value, list: &str| -> Vec<String> {
        let features = value[list].as_array().expect("a list").iter();
        features.map(|f| f["feature"].as_str().expect("a name").to_owned()).collect()
    };
    let (used, left_out) = (names(&plain, "used"), names(&plain, "left_out"));
    assert!(!used.is_empty() && !left_out.is_empty() && used.iter().all(|name| !left_out.contains(name)));
    // Both eyes trace twice the rays, and another scene uses other features.
    assert_eq!(take("torus", &["--stereo"])["counts"]["rays"].as_u64(), Some(16 * 12 * 2));
    assert_ne!(names(&take("leaves", &[]), "used"), used);
}

#[test]
fn picture_appears_only_when_it_is_whole() {
    let place = Place::new();
    place.write("old.png", "old");
    for name in ["new.png", "old.png"] {
        let large = ["--size", "6000x6000", "--samples", "64", "--backend", "cpu", "--stats", "stats.json"];
        let mut command = place.command(&[&["render", "knot", "-o", name], &large[..]].concat());
        let mut child = command.stderr(Stdio::null()).spawn().expect("a start");
        // Wait until the work has begun: then there is a file under another name.
        let begun = || place.files().iter().any(|(path, _)| path.extension().is_some_and(|e| e == "tmp"));
        let limit = Instant::now() + Duration::from_secs(60);
        while !begun() {
            assert!(child.try_wait().expect("a state").is_none() && Instant::now() < limit, "nothing was begun");
            thread::sleep(Duration::from_millis(5));
        }
        thread::sleep(Duration::from_millis(50));
        assert!(child.try_wait().expect("a state").is_none(), "the picture is too small for this test");
        child.kill().expect("an end");
        child.wait().expect("an end");
        assert!(!place.has("new.png") && !place.has("stats.json"));
        assert_eq!(place.read("old.png"), b"old");
        for (path, _) in place.files() {
            if path.extension().is_some_and(|e| e == "tmp") {
                fs::remove_file(path).expect("a file");
            }
        }
    }
    // The sister: a run that ends replaces the old picture and leaves nothing else.
    place.run(&["render", "knot", "-o", "old.png", "--size", "4x4", "--backend", "cpu"]).done();
    assert!(place.read("old.png").starts_with(b"\x89PNG"));
    assert_eq!(place.files().len(), 1);
}
