//! Scenes that are refused, each with its place in the file; nothing is written.

use super::program::Place;
use crate::scene::png_header;
use holonomy::{
    scene::shipped,
    space::{catalogue, gluing},
};
use serde_json::json;

const TORUS: &str = "[space]\nmanifold = \"torus\"\n";

/// Lines after which the object of the torus begins with line 6.
const MATERIAL: &str = "[[material]]\nname = \"m\"\n";

fn refused(lines: &str) -> String {
    Place::new().refused_scene(&format!("{TORUS}{lines}"))
}

#[test]
fn scene_that_is_missing_is_refused() {
    let place = Place::new();
    let refusal = |scene| place.refusal(&["render", scene, "-o", "out.png"]);
    assert_eq!(refusal("scene.toml"), "scene.toml: no such file");
    assert_eq!(refusal("no/scene.toml"), "no/scene.toml: no such file");
    assert_eq!(refusal("toru"), "toru: no such file, and no scene of this name: did you mean \"torus\"?");
    assert_eq!(refusal("."), ".: Is a directory (os error 21)");
}

#[test]
fn scene_refusals_have_line_and_column() {
    let table = [
        ("[observer]\nfov = = 3\n", "scene.toml:4:7: TOML: "),
        ("[observer\n", "scene.toml:3:10: TOML: "),
        (
            "[[material]]\nname = \"a\"\ncolour = [1, 1, 1]\n",
            "scene.toml:5:1: unknown key \"colour\" in [[material]]: did you mean \"color\"?",
        ),
        ("[rendr]\n", "scene.toml:3:2: unknown key \"rendr\" in the scene: did you mean \"render\"?"),
        ("[observer]\nfov = \"wide\"\n", "scene.toml:4:7: fov: expected a number, found the string \"wide\""),
        ("[render]\nbounces = 2.5\n", "scene.toml:4:11: bounces: expected an integer, found 2.5"),
        ("[observer]\nposition = [nan, 0, 0]\n", "scene.toml:4:13: position[0]: expected a finite number, found NaN"),
        ("[observer]\nlook = [0, -inf, 0]\n", "scene.toml:4:12: look[1]: expected a finite number, found -inf"),
        ("[render]\nfog = inf\n", "scene.toml:4:7: fog: expected a finite number, found inf"),
        (
            "[[light]]\nposition = [0, 0, 0]\ndirection = [0, 0, 0]\n",
            "scene.toml:5:13: direction: the direction is zero: its tangent part at the position must not vanish",
        ),
        ("[render]\nbounces = 0\n", "scene.toml:4:11: bounces: 0 is out of range: 1 to 100000"),
    ];
    for (lines, expected) in table {
        let line = refused(lines);
        // What follows the colon of a syntax error is the parser's.
        assert!(if expected.ends_with(": ") { line.starts_with(expected) } else { line == expected }, "{line}");
    }
}

#[test]
fn scene_with_a_skew_frame_is_refused() {
    let object = "[[object]]\nkind = \"ball\"\nradius = 0.1\nmaterial = \"m\"\nposition = [0.5, 0.5, 0.5]\n";
    let line = refused(&format!("{MATERIAL}{object}frame = [[1, 0, 0], [0, 1, 0], [0, 0.01, 1]]\n"));
    assert_eq!(
        line,
        "scene.toml:10:9: frame: the frame is not orthonormal: residual 1.000e-2, at most 1e-6 is accepted"
    );
    let place = Place::new();
    place.write("scene.toml", format!("{TORUS}{MATERIAL}{object}frame = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\n"));
    place.run(&["render", "scene.toml", "-o", "out.png", "--size", "2x2", "--backend", "cpu"]).done();
    assert!(place.has("out.png"));
}

#[test]
fn scene_in_an_unknown_space_is_refused() {
    let known = catalogue::NAMES.join(", ");
    assert_eq!(
        Place::new().refused_scene("[space]\nmanifold = \"toros\"\n"),
        format!("scene.toml:2:12: manifold: unknown space \"toros\": did you mean \"torus\"? (known: {known})")
    );
}

/// The Poincaré space as a gluing file, with a turn more in the pairing of each face.
fn poincare_gluing(turns: f64) -> String {
    let mut space = catalogue::find("poincare").expect("a space");
    for face in &mut space.cells[0].faces {
        let axis = face.plane.truncate().normalize();
        let angle = -turns * std::f64::consts::TAU / 5.0;
        face.pairing.linear *= glam::DMat4::from_axis_angle(axis, angle);
    }
    gluing::to_json(&space)
}

#[test]
fn gluing_that_does_not_close_is_refused_everywhere() {
    let place = Place::new();
    place.write("bad.json", poincare_gluing(1.0));
    let words = "edge between faces 0 and 1 of cell 0";
    let line = place.refusal(&["check", "bad.json", "--json"]);
    assert!(line.starts_with(&format!("bad.json: {words}")), "{line}");
    let start = ["--from", "0,0,0,1", "--direction", "1,0,0,0", "--length", "1"];
    let line = place.refusal(&[&["transport", "bad.json"], &start[..]].concat());
    assert!(line.starts_with(&format!("bad.json: {words}")), "{line}");
    let line = place.refused_scene("[space]\ngluing = \"bad.json\"\n");
    assert!(line.starts_with("scene.toml:2:10: gluing: ") && line.contains(words), "{line}");
    // The sister: the same file without the turn.
    place.write("good.json", poincare_gluing(0.0));
    let report = place.run(&["check", "good.json", "--json"]).json();
    assert_eq!((&report["kind"], &report["homology"]), (&json!("manifold"), &json!([])));
    place.write("good.toml", "[space]\ngluing = \"good.json\"\n");
    place.run(&["render", "good.toml", "-o", "out.png", "--size", "2x2", "--backend", "cpu"]).done();
}

#[test]
fn gluing_that_is_no_json_has_a_place() {
    let place = Place::new();
    place.write("bad.json", "{\"geometry\": \"e3\",\n  oops\n}");
    let line = place.refusal(&["check", "bad.json"]);
    assert!(line.starts_with("bad.json:2:3: "), "{line}");
    place.write("bad.json", "{\"geometry\": \"e3\", \"cels\": []}");
    assert_eq!(place.refusal(&["check", "bad.json"]), "bad.json: unknown key \"cels\", did you mean \"cells\"?");
}

/// One triangle as GLB, with these indices of its corners.
fn triangle(indices: [u32; 3]) -> Vec<u8> {
    let corners = [[0.0_f32, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0]];
    let mut bytes: Vec<u8> = corners.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
    bytes.extend(indices.iter().flat_map(|i| i.to_le_bytes()));
    let document = json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 1]},
            {"bufferView": 1, "componentType": 5125, "count": 3, "type": "SCALAR"},
        ],
        "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 12}],
        "buffers": [{"byteLength": 48}],
    });
    let mut text = document.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut glb = b"glTF\x02\0\0\0".to_vec();
    glb.extend((28 + text.len() as u32 + bytes.len() as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", text), (b"BIN\0", bytes)] {
        glb.extend((chunk.len() as u32).to_le_bytes());
        glb.extend(kind);
        glb.extend(chunk);
    }
    glb
}

#[test]
fn mesh_that_is_missing_or_spoilt_is_refused() {
    let place = Place::new();
    let scene = format!("{TORUS}[[object]]\nkind = \"mesh\"\nfile = \"my.glb\"\nposition = [0.5, 0.5, 0.5]\n");
    assert_eq!(place.refused_scene(&scene), "scene.toml:5:8: file: my.glb: no such file");
    let whole = shipped::asset("meshes/leaf.glb").expect("a mesh");
    place.write("my.glb", &whole[..1000]);
    assert_eq!(
        place.refused_scene(&scene),
        format!("scene.toml:5:8: file: my.glb: truncated GLB: {} bytes are declared, 1000 are there", whole.len())
    );
    place.write("my.glb", triangle([0, 1, 3]));
    assert_eq!(
        place.refused_scene(&scene),
        "scene.toml:5:8: file: my.glb: meshes[0].primitives[0].indices: index 3 is out of range (vertices: 3)"
    );
    place.write("my.glb", triangle([0, 1, 2]));
    place.run(&["render", "scene.toml", "-o", "out.png", "--size", "2x2", "--backend", "cpu"]).done();
}

#[test]
fn image_of_an_impossible_size_is_refused() {
    let place = Place::new();
    for (width, height) in [(0, 0), (100_000, 100_000)] {
        place.write("a.png", png_header(width, height));
        assert_eq!(
            place.refused_scene(&format!("{TORUS}{MATERIAL}texture = \"a.png\"\n")),
            format!("scene.toml:5:11: texture: a.png: image of {width}x{height}: sides must be 1 to 16384")
        );
    }
}

#[test]
fn path_out_of_the_folder_is_refused() {
    let place = Place::new();
    place.write("outside.glb", triangle([0, 1, 2]));
    let object = "[[object]]\nkind = \"mesh\"\nposition = [0.5, 0.5, 0.5]\nfile = ";
    let scene = |path: &str| {
        place.write("scenes/my.toml", format!("{TORUS}{object}{path:?}\n"));
        place.refusal(&["render", "scenes/my.toml", "-o", "out.png", "--size", "8x8"])
    };
    let at = "scenes/my.toml:6:8: file:";
    assert_eq!(scene("../outside.glb"), format!("{at} ../outside.glb: the path leaves the scene's folder"));
    let absolute = "/etc/hostname: the path is absolute: paths are relative to the scene's folder";
    assert_eq!(scene("/etc/hostname"), format!("{at} {absolute}"));
    place.write("inside.toml", format!("{TORUS}{object}\"outside.glb\"\n"));
    place.run(&["render", "inside.toml", "-o", "out.png", "--size", "2x2", "--backend", "cpu"]).done();
}

#[test]
fn names_with_control_characters_stay_on_one_line() {
    let place = Place::new();
    let line = place.refusal(&["render", "a\nb\u{1b}[2J\r.toml", "-o", "out.png"]);
    assert!(!line.contains(char::is_control), "{line:?}");
    let line = place.refusal(&["render", "torus", "-o", "no\nfolder\u{7}/out.png"]);
    assert!(!line.contains(char::is_control), "{line:?}");
}
