//! Sequences of pictures: any part of a sequence gives the same files, and what is there is left.

use super::program::Place;
use std::fs;

const SCENE: &str = "
[space]
manifold = \"poincare\"
[observer]
[[observer.path]]
step = [0, 0, -0.8]
rotate = [[0, 1, 0, 40]]
frames = 4
[[observer.path]]
step = [0.3, 0, 0]
frames = 2
[[material]]
name = \"m\"
[[light]]
kind = \"viewer\"
[[object]]
kind = \"domain-edges\"
radius = 0.03
material = \"m\"
[[object]]
kind = \"ball\"
radius = 0.02
attach = \"viewer\"
offset = [0.05, 0, -0.2]
material = \"m\"
";

fn args<'a>(range: &'a str, pattern: &'a str) -> Vec<&'a str> {
    vec!["render", "s.toml", "--backend", "cpu", "--size", "24x16", "--frames", range, "-o", pattern]
}

#[test]
fn sequence_parts_are_the_whole() {
    let (whole, parts) = (Place::new(), Place::new());
    for place in [&whole, &parts] {
        place.write("s.toml", SCENE);
    }
    whole.run(&args("0..7", "f-{frame:04}.png")).done();
    parts.run(&args("5..7", "f-{frame:04}.png")).done();
    parts.run(&args("2..3", "f-{frame:04}.png")).done();
    // A picture that is there is left, whatever it is.
    parts.write("f-0003.png", "mine");
    let said = parts.run(&args("0..6", "f-{frame:04}.png")).done();
    let _ = said;
    let read = |place: &Place, n: u32| fs::read(place.path().join(format!("f-{n:04}.png"))).expect("a picture");
    for n in [0, 1, 2, 4, 5, 6] {
        assert_eq!(read(&whole, n), read(&parts, n), "picture {n}");
    }
    assert_eq!(read(&parts, 3), b"mine");
    // They do differ from one another, and nothing else is left behind.
    assert!((1..7).all(|n| read(&whole, n) != read(&whole, n - 1)));
    assert_eq!(fs::read_dir(whole.path()).expect("a folder").count(), 8);
    whole.run(&args("0..1", "{frame}.exr")).done();
    assert!(whole.has("0.exr"));
}

#[test]
fn sequence_refusals_are_one_line() {
    let place = Place::new();
    place.write("s.toml", SCENE);
    place.write("still.toml", SCENE.split("[[observer.path]]").next().expect("text"));
    for pattern in [
        "f.png",
        "f-{fram}.png",
        "f-{frame:4}.png",
        "f-{frame:0x}.png",
        "{frame}-{frame}.png",
        "{frame.png",
        "a{frame}b/{frame}.png",
    ] {
        let line = place.refusal(&args("0..2", pattern));
        assert_eq!(
            line,
            format!(
                "{pattern}: with --frames the file name needs {{frame}} or {{frame:04}} once, for the number of the picture"
            )
        );
    }
    for (range, words) in [
        ("3..3", "there is no picture in 3..3: END is not included"),
        ("4", "expected FIRST..END, such as 0..48 for the pictures 0 to 47"),
        ("-1..4", "expected FIRST..END"),
        ("0..x", "expected FIRST..END"),
    ] {
        let range = format!("--frames={range}");
        let line = place.refusal(&["render", "s.toml", "-o", "{frame}.png", "--backend", "cpu", &range]);
        assert!(line.contains(words), "{line}");
    }
    assert_eq!(place.refusal(&args("5..8", "{frame}.png")), "--frames: the path of s.toml ends with picture 6, not 7");
    let line = place.refusal(&["render", "still.toml", "--frames", "0..1", "-o", "{frame}.png", "--backend", "cpu"]);
    assert_eq!(line, "still.toml: --frames needs a camera path ([[observer.path]]) or an object with motion");
    assert_eq!(fs::read_dir(place.path()).expect("a folder").count(), 2, "nothing was written");
}

/// A ball and a mesh in motion: pictures change, an object in motion needs no camera path, and each picture is that of
/// any other range.
#[test]
fn sequence_of_objects_in_motion() {
    let place = Place::new();
    place.write("meshes/knot.glb", include_bytes!("../../../scenes/meshes/knot-small.glb"));
    let scene = |velocity: &str| {
        format!(
            "[space]\nmanifold = \"poincare\"\n[observer]\n[[material]]\nname = \"m\"\n[[light]]\nkind = \"viewer\"\n\
             [[object]]\nkind = \"mesh\"\nfile = \"meshes/knot.glb\"\nscale = 0.03\nposition = [0, 0, -0.15, 1]\n\
             motion = {{ velocity = {velocity}, spin = [0, 1, 0, 90] }}\n\
             [[object]]\nkind = \"ball\"\nradius = 0.03\nmaterial = \"m\"\nmotion = {{ velocity = [0, 0.3, -1] }}\n"
        )
    };
    place.write("s.toml", scene("[0.4, 0, 0]"));
    place.run(&args("0..4", "a-{frame}.png")).done();
    let pictures: Vec<Vec<u8>> = (0..4).map(|n| place.read(&format!("a-{n}.png"))).collect();
    assert!(pictures.windows(2).all(|pair| pair[0] != pair[1]), "nothing moves");
    place.run(&[&args("3..4", "b-{frame}.png")[..], &["--stats", "stats.json"]].concat()).done();
    assert!(place.read("b-3.png") == pictures[3], "another picture alone than in the sequence");
    let stats: serde_json::Value = serde_json::from_slice(&place.read("stats.json")).expect("JSON");
    assert_eq!(stats["pictures"], 1);
    for (motion, why) in [
        ("velocity = [1, 2]", "s.toml:1:24: velocity: expected an array of 3 numbers"),
        ("spin = [0, 0, 0, 3]", "the axis is zero"),
        ("speed = 3", "unknown key \"speed\" in motion"),
    ] {
        let text = scene("[0, 0, 0]").replace("velocity = [0, 0, 0], spin = [0, 1, 0, 90]", motion);
        place.write("s.toml", text);
        let run = place.run(&args("0..1", "c-{frame}.png"));
        let line = run.error(1).expect("one line");
        assert!(line.contains(why.rsplit(": ").next().unwrap_or(why)), "{line}");
    }
}
