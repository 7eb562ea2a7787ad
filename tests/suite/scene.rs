//! Scene files: what is read, and the exact words with which bad ones are refused.

use glam::{DMat3, DVec3, DVec4};
use holonomy::{
    geometry::GEOMETRIES,
    scene::{MAX_TEXTURE_SIZE, Place, Scene, Shape, Wrap, file, file::SceneError, folder::Folder, shipped},
    space::{catalogue, reduce},
};
use proptest::prelude::*;
use std::{fs, path::Path};

/// A scene in the torus, after which the lines of a test are line 3 and following.
const TORUS: &str = "[space]\nmanifold = \"torus\"\n";

fn read(text: &str) -> Result<Scene, SceneError> {
    file::read("my.toml", text.as_bytes(), &Folder::Embedded)
}

fn accept(lines: &str) -> Scene {
    read(&format!("{TORUS}{lines}")).unwrap_or_else(|e| panic!("{e}"))
}

/// The refusal of a scene in the torus with more lines.
fn refuse(lines: &str) -> String {
    refuse_whole(&format!("{TORUS}{lines}"))
}

fn refuse_whole(text: &str) -> String {
    match read(text) {
        Ok(_) => panic!("accepted:\n{text}"),
        Err(e) => e.to_string(),
    }
}

/// Writes a scene into a folder and loads it; the folder's path is cut from the refusal.
fn refuse_in(folder: &Path, lines: &str) -> String {
    let scene = folder.join("my.toml");
    fs::write(&scene, format!("{TORUS}{lines}")).expect("a scene");
    let message = file::load(scene.to_str().expect("a path")).expect_err("a refusal").to_string();
    message.strip_prefix(folder.to_str().expect("a path")).expect("the scene's path").to_owned()
}

#[test]
fn shipped_scenes_load() {
    let names: Vec<&str> = shipped::names().collect();
    for name in catalogue::NAMES.iter().chain(&["leaves", "knot"]) {
        assert!(names.contains(name), "no scene {name}");
    }
    for name in names {
        let scene = file::load(name).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(scene.name, name);
        // One measures how long rays take through nothing.
        let empty = name == "bench-cell";
        assert_eq!(scene.objects.is_empty(), empty, "{name}");
        assert_eq!(scene.settings.headlight == [0.0; 3], empty, "{name}");
        assert!(reduce::is_inside(&scene.space, 0, scene.observer.frame.point), "{name}");
        for mesh in &scene.meshes {
            let (vertices, materials) = (mesh.vertices.len() as u32, scene.materials.len());
            assert!(mesh.triangles.iter().all(|(t, m)| t.iter().all(|c| *c < vertices) && *m < materials));
        }
    }
}

#[test]
fn shipped_scene_of_a_space_is_in_that_space() {
    for name in catalogue::NAMES {
        assert_eq!(file::load(name).unwrap_or_else(|e| panic!("{e}")).space.name, *name);
    }
}

#[test]
fn missing_scenes_are_refused() {
    let message = |name| file::load(name).expect_err("a refusal").to_string();
    assert_eq!(message("no/such.toml"), "no/such.toml: no such file");
    assert_eq!(message("poincar"), "poincar: no such file, and no scene of this name: did you mean \"poincare\"?");
    assert!(
        message("zzzzzz").starts_with(
            "zzzzzz: no such file, and no scene of this name: scenes: bench-cell, bench-edges, bench-nil, "
        )
    );
}

#[test]
fn syntax_errors_have_a_place() {
    let message = refuse("[observer]\nfov = = 3\n");
    assert!(message.starts_with("my.toml:4:7: TOML: "), "{message}");
    assert!(!message.contains('\n'));
    assert_eq!(refuse_whole("").as_str(), "my.toml: the table [space] is missing");
    let error = file::read("my.toml", b"# \xc3\xa9\n# \xff\n", &Folder::Embedded).expect_err("a refusal");
    assert_eq!(error.to_string(), "my.toml:2:3: the file is not UTF-8 text");
}

#[test]
fn columns_count_characters() {
    assert_eq!(
        refuse_whole("material = [{ name = \"éé\", colr = 1 }]\n"),
        "my.toml: the table [space] is missing",
        "the space goes first"
    );
    assert_eq!(
        refuse_whole(&format!("material = [{{ name = \"éé\", colr = 1 }}]\n{TORUS}")),
        "my.toml:1:28: unknown key \"colr\" in [[material]]: did you mean \"color\"?"
    );
    assert!(refuse("[observer]\n\"é\" = 1\n").starts_with("my.toml:4:1: unknown key \"é\" in [observer]: "));
}

#[test]
fn deep_nesting_is_refused() {
    for text in [
        format!("a = {}", "[".repeat(100_000)),
        format!("a = {}", "{a=".repeat(100_000)),
        format!("{}a = 1", "a.".repeat(100_000)),
        format!("[{}a]", "a.".repeat(100_000)),
        format!("[[{}a]]", "a.".repeat(100_000)),
        format!("[observer]\n{}a = 1", "a.".repeat(100_000)),
    ] {
        let message = refuse(&text);
        assert!(message.starts_with("my.toml:") && message.lines().count() == 1 && message.len() < 500, "{message}");
    }
}

#[test]
fn unknown_keys_name_the_nearest() {
    assert_eq!(
        refuse("\n[[material]]\nname = \"a\"\n  colour = [1, 1, 1]\n"),
        "my.toml:6:3: unknown key \"colour\" in [[material]]: did you mean \"color\"?"
    );
    assert_eq!(refuse("[rendr]\n"), "my.toml:3:2: unknown key \"rendr\" in the scene: did you mean \"render\"?");
    assert_eq!(
        refuse("[render]\nmax_distance = 3\n"),
        "my.toml:4:1: unknown key \"max_distance\" in [render]: did you mean \"max-distance\"?"
    );
    assert_eq!(
        refuse("[observer]\nwhatever = 3\n"),
        "my.toml:4:1: unknown key \"whatever\" in [observer]: \
         known keys: position, cell, look, up, fov, eye-distance, path"
    );
    assert_eq!(
        refuse("[[light]]\nkind = \"viewer\"\nposition = [0, 0, 0]\n"),
        "my.toml:5:1: \"position\" has no meaning for a light of kind \"viewer\""
    );
    assert_eq!(
        refuse("[[object]]\nkind = \"mesh\"\nfile = \"meshes/leaf.glb\"\nradius = 1\n"),
        "my.toml:6:1: \"radius\" has no meaning for an object of kind \"mesh\" with attach = \"world\""
    );
}

#[test]
fn wrong_types_say_what_was_found() {
    assert_eq!(
        refuse("[observer]\nfov = \"wide\"\n"),
        "my.toml:4:7: fov: expected a number, found the string \"wide\""
    );
    assert_eq!(refuse("[observer]\nlook = 3\n"), "my.toml:4:8: look: expected an array of 3 numbers, found 3");
    assert_eq!(
        refuse("[observer]\nlook = [1, 2]\n"),
        "my.toml:4:8: look: expected an array of 3 numbers, found an array of 2"
    );
    assert_eq!(
        refuse("[observer]\nposition = [0.5, true, 0]\n"),
        "my.toml:4:18: position[1]: expected a number, found true"
    );
    assert_eq!(refuse("[render]\nbounces = 2.5\n"), "my.toml:4:11: bounces: expected an integer, found 2.5");
    assert_eq!(
        refuse("[[light]]\nposition = [0, 0, 0]\nshadows = 1\n"),
        "my.toml:5:11: shadows: expected true or false, found 1"
    );
    assert_eq!(refuse_whole("space = 3\n"), "my.toml:1:9: space: expected a table [space], found 3");
    assert_eq!(refuse("[light]\n"), "my.toml:3:1: light: expected tables [[light]], found a table");
    assert_eq!(
        refuse("[[material]]\nname = \"a\"\ncolor = \"#12345g\"\n"),
        "my.toml:5:9: color: expected a colour \"#rrggbb\" or \"#rrggbbaa\", found the string \"#12345g\""
    );
    assert_eq!(refuse("[[material]]\n"), "my.toml:3:1: [[material]] needs \"name\"");
}

#[test]
fn numbers_that_are_not_finite_are_refused_everywhere() {
    let places = [
        ("[observer]\nposition = [0, X, 0]\n", "4:16: position[1]"),
        ("[observer]\nlook = [X, 0, 0]\n", "4:9: look[0]"),
        ("[observer]\nfov = X\n", "4:7: fov"),
        ("[render]\nfog = X\n", "4:7: fog"),
        ("[render]\nmax-distance = X\n", "4:16: max-distance"),
        ("[render]\nambient = [X, 0, 0]\n", "4:12: ambient[0]"),
        ("[[light]]\nposition = [0, 0, X]\n", "4:19: position[2]"),
        ("[[light]]\nintensity = X\n", "4:13: intensity"),
        ("[[material]]\nname = \"a\"\nroughness = X\n", "5:13: roughness"),
    ];
    for (lines, place) in places {
        for (number, found) in [("nan", "NaN"), ("inf", "inf"), ("-inf", "-inf")] {
            let message = refuse(&lines.replace('X', number));
            assert_eq!(message, format!("my.toml:{place}: expected a finite number, found {found}"));
        }
        let message = refuse(&lines.replace('X', "1e999"));
        assert_eq!(message.split(": ").nth(1), Some("TOML"), "{message}");
        // The sister: the same place takes a number.
        if let Err(e) = read(&format!("{TORUS}{}", lines.replace('X', "0.5"))) {
            assert!(e.to_string().contains("[[light]] needs"), "{e}");
        }
    }
}

#[test]
fn ranges_are_checked() {
    let render = |line: &str| refuse(&format!("[render]\n{line}\n"));
    assert_eq!(render("bounces = 0"), "my.toml:4:11: bounces: 0 is out of range: 1 to 100000");
    assert_eq!(render("bounces = -4"), "my.toml:4:11: bounces: -4 is out of range: 1 to 100000");
    assert_eq!(render("bounces = 100001"), "my.toml:4:11: bounces: 100001 is out of range: 1 to 100000");
    assert_eq!(
        render("bounces = 9000000000000000000"),
        "my.toml:4:11: bounces: 9000000000000000000 is out of range: 1 to 100000"
    );
    assert_eq!(accept("[render]\nbounces = 100000\n").settings.bounces, 100_000);
    assert_eq!(render("fog = -1"), "my.toml:4:7: fog: -1 is out of range: 0 to 1000");
    assert_eq!(render("tolerance = 0"), "my.toml:4:13: tolerance: 0 is out of range: above 0, at most 100");
    assert_eq!(
        render("shading = \"shiny\""),
        "my.toml:4:11: shading: unknown value \"shiny\" \
         (known: riemannian, normals, distance, bounces, segments, cell, object)"
    );
    assert_eq!(refuse("[observer]\nfov = 180\n"), "my.toml:4:7: fov: 180 is out of range: above 0, below 180");
    assert_eq!(refuse("[observer]\ncell = 1\n"), "my.toml:4:8: cell: 1 is out of range: 0 to 0");
}

#[test]
fn unknown_spaces_list_the_catalogue() {
    let known = catalogue::NAMES.join(", ");
    let geometries = GEOMETRIES.iter().map(|entry| entry.name).collect::<Vec<_>>().join(", ");
    assert_eq!(
        refuse_whole("[space]\nmanifold = \"poincaré\"\n"),
        format!("my.toml:2:12: manifold: unknown space \"poincaré\": did you mean \"poincare\"? (known: {known})")
    );
    assert_eq!(
        refuse_whole("[space]\nmanifold = \"x\"\n"),
        format!("my.toml:2:12: manifold: unknown space \"x\" (known: {known})")
    );
    assert_eq!(
        refuse_whole("[space]\ngeometry = \"e4\"\n"),
        format!("my.toml:2:12: geometry: unknown value \"e4\" (known: {geometries})")
    );
    assert_eq!(refuse_whole("[space]\n"), "my.toml:1:1: [space] needs \"manifold\", \"gluing\" or \"geometry\"");
}

#[test]
fn points_must_lie_in_their_cell() {
    assert_eq!(
        refuse("[observer]\nposition = [0.5, 0.5, 3]\n"),
        "my.toml:4:12: position: the point [0.5, 0.5, 3.0] is outside of cell 0 of torus"
    );
    let poincare = "[space]\nmanifold = \"poincare\"\n[observer]\nposition = ";
    assert_eq!(
        refuse_whole(&format!("{poincare}[0, 0, 0, 0]\n")),
        "my.toml:4:12: position: [0.0, 0.0, 0.0, 0.0] is not a point of s3"
    );
    assert_eq!(
        refuse_whole(&format!("{poincare}[0, 0, 0]\n")),
        "my.toml:4:12: position: expected an array of 4 numbers, found an array of 3"
    );
    // Points are put on the model.
    let scene = read(&format!("{poincare}[0, 0, 0.25, 2]\n")).expect("a scene");
    assert!((scene.observer.frame.point - DVec4::new(0.0, 0.0, 0.25, 2.0).normalize()).length() < 1e-15);
}

#[test]
fn observer_axes_are_right_up_back() {
    let scene = accept("[observer]\nposition = [0.5, 0.5, 0.5]\nlook = [0, 0, -2]\nup = [0.3, 5, 1]\n");
    let axes = scene.observer.frame.axes;
    let up = DVec3::new(0.3, 5.0, 0.0).normalize();
    assert!((axes[2] - DVec4::Z).length() < 1e-15);
    assert!((axes[1] - up.extend(0.0)).length() < 1e-15);
    assert!((axes[0] - (DVec3::NEG_Z.cross(up)).extend(0.0)).length() < 1e-15);
    assert_eq!(accept("").observer.frame.axes, [DVec4::X, DVec4::Y, DVec4::Z]);
}

#[test]
fn observer_directions_must_span_a_plane() {
    assert_eq!(
        refuse("[observer]\nlook = [1, 2, 3]\nup = [-2, -4, -6]\n"),
        "my.toml:5:6: up: look and up are parallel"
    );
    assert_eq!(
        refuse("[observer]\nlook = [0, 0, 0]\n"),
        "my.toml:4:8: look: the direction is zero: its tangent part at the position must not vanish"
    );
    let h3 = "[space]\nmanifold = \"seifert-weber\"\n[observer]\nlook = ";
    assert_eq!(
        refuse_whole(&format!("{h3}[0, 0, 0, 1]\n")),
        "my.toml:4:8: look: the direction is zero: its tangent part at the position must not vanish"
    );
    // Ambient numbers and components agree at the base point; the scale does not matter.
    let ambient = read(&format!("{h3}[1e-200, 2e-200, -3e-200, 0]\n")).expect("a scene");
    let components = read(&format!("{h3}[1, 2, -3]\n")).expect("a scene");
    for (a, b) in ambient.observer.frame.axes.iter().zip(components.observer.frame.axes) {
        assert!((a - b).length() < 1e-14);
    }
}

#[test]
fn frames_must_be_orthonormal() {
    let object = |frame: &str| {
        format!(
            "[[material]]\nname = \"m\"\n[[object]]\nkind = \"ball\"\nradius = 0.1\nmaterial = \"m\"\nframe = {frame}\n"
        )
    };
    assert_eq!(
        refuse(&object("[[1, 0, 0], [0, 1, 0], [0, 0.001, 1]]")),
        "my.toml:9:9: frame: the frame is not orthonormal: residual 1.000e-3, at most 1e-6 is accepted"
    );
    assert_eq!(
        refuse(&object("[[1, 0, 0], [0, 1, 0], [0, 0, -1]]")),
        "my.toml:9:9: frame: the frame is left-handed: swap two vectors or turn one round"
    );
    assert_eq!(
        refuse(&object("[[1, 0, 0], [0, 1, 0]]")),
        "my.toml:9:9: frame: expected an array of 3 vectors, found an array of 2"
    );
    let scene = accept(&object("[[0, 1, 0], [0, 0, 1], [1.0000001, 0, 0]]"));
    let Place::World(frame) = scene.objects[0].place else { panic!("not in the world") };
    assert_eq!(frame.axes, [DVec4::Y, DVec4::Z, DVec4::X]);
    // An ambient vector with a part that is not tangent is not part of a frame, though its tangent part would do.
    let h3 =
        format!("[space]\nmanifold = \"seifert-weber\"\n{}", object("[[1, 0, 0, 0.5], [0, 1, 0, 0], [0, 0, 1, 0]]"));
    assert_eq!(
        refuse_whole(&h3),
        "my.toml:9:9: frame: the frame is not orthonormal: residual 5.000e-1, at most 1e-6 is accepted"
    );
}

#[test]
fn lights_point_somewhere() {
    let light = "[[light]]\nposition = [0.1, 0.2, 0.3]\n";
    assert_eq!(
        refuse(&format!("{light}direction = [0, 0, 0]\n")),
        "my.toml:5:13: direction: the direction is zero: its tangent part at the position must not vanish"
    );
    assert_eq!(
        refuse(&format!("{light}angle = 20\n")),
        "my.toml:5:1: \"angle\" has no meaning for a light without \"direction\""
    );
    assert_eq!(refuse("[[light]]\n"), "my.toml:3:1: [[light]] needs \"position\"");
    let scene = accept(&format!("{light}direction = [0, 0, -3]\nangle = 60\ncolor = [1, 2, 4]\nintensity = 0.5\n"));
    let spot = scene.lights[0].spot.expect("a cone");
    assert_eq!(spot.direction, DVec4::NEG_Z);
    assert!((spot.cos_angle - 0.5).abs() < 1e-15);
    assert_eq!(scene.lights[0].color, [0.5, 1.0, 2.0]);
}

#[test]
fn viewer_lights_become_the_headlight() {
    let scene =
        accept("[[light]]\nkind = \"viewer\"\ncolor = [1, 0.5, 0]\nintensity = 2\n[[light]]\nkind = \"viewer\"\n");
    assert_eq!(scene.settings.headlight, [3.0, 2.0, 1.0]);
    assert!(scene.lights.is_empty());
}

#[test]
fn materials_are_found_by_name() {
    let lines =
        "[[material]]\nname = \"red\"\ncolor = \"#ff8000\"\n[[object]]\nkind = \"ball\"\nradius = 0.1\nmaterial = ";
    assert_eq!(
        refuse(&format!("{lines}\"rd\"\n")),
        "my.toml:9:12: material: unknown material \"rd\": did you mean \"red\"?"
    );
    assert_eq!(
        refuse(&format!("{lines}\"emerald\"\n")),
        "my.toml:9:12: material: unknown material \"emerald\": materials of the scene: red"
    );
    assert_eq!(
        refuse("[[object]]\nkind = \"ball\"\nradius = 0.1\n"),
        "my.toml:3:1: [[object]] of kind \"ball\" needs \"material\""
    );
    assert_eq!(
        refuse("[[material]]\nname = \"a\"\n[[material]]\nname = \"a\"\n"),
        "my.toml:6:8: name: there is a material \"a\" already"
    );
    let scene = accept(&format!("{lines}\"red\"\n"));
    let [r, g, b, a] = scene.materials[0].base_color;
    assert!(r == 1.0 && (g - 0.215_861).abs() < 1e-5 && b == 0.0 && a == 1.0, "{g}");
}

#[test]
fn objects_attach_to_what_there_is() {
    let mesh = "[[object]]\nkind = \"mesh\"\nfile = \"meshes/leaf.glb\"\nattach = ";
    assert_eq!(
        refuse(&format!("{mesh}\"floor\"\n")),
        "my.toml:6:10: attach: unknown value \"floor\" (known: world, viewer, left-hand, right-hand)"
    );
    assert_eq!(
        refuse(&format!("{mesh}\"left-hand\"\nposition = [0, 0, 0]\n")),
        "my.toml:7:1: \"position\" has no meaning for an object of kind \"mesh\" with attach = \"left-hand\""
    );
    assert_eq!(
        refuse(&format!("{mesh}\"viewer\"\nposition = [0, 0, 0]\n")),
        "my.toml:7:1: \"position\" has no meaning for an object of kind \"mesh\" with attach = \"viewer\""
    );
    assert_eq!(
        refuse(&format!("{mesh}\"world\"\nrotate = [[0, 0, 0, 30]]\n")),
        "my.toml:7:11: rotate[0]: the axis is zero"
    );
    assert_eq!(
        refuse(&format!("{mesh}\"world\"\nscale = 0\n")),
        "my.toml:7:9: scale: 0 is out of range: above 0, at most 1000000"
    );
    let scene = accept(&format!("{mesh}\"viewer\"\noffset = [1, 2, 3]\nrotate = [[0, 0, 1, 90], [1, 0, 0, 90]]\n"));
    let Place::Viewer { offset, rotation } = scene.objects[0].place else { panic!("not at the viewer") };
    assert_eq!(offset, DVec3::new(1.0, 2.0, 3.0));
    // First x to y about z, then y to z about x.
    let expected = DMat3::from_cols(DVec3::Z, DVec3::NEG_X, DVec3::NEG_Y);
    assert!((rotation - expected).to_cols_array().iter().all(|x| x.abs() < 1e-15), "{rotation}");
}

#[test]
fn tubes_start_along_their_look() {
    let scene = accept(
        "[[material]]\nname = \"m\"\n[[object]]\nkind = \"tube\"\nlook = [0, 2, 0]\nradius = 0.1\nlength = 1\nmaterial = \"m\"\n",
    );
    let Place::World(frame) = scene.objects[0].place else { panic!("not in the world") };
    assert_eq!(frame.axes[2], DVec4::Y);
    assert_eq!(scene.objects[0].shape, Shape::Tube { radius: 0.1, length: 1.0 });
}

#[test]
fn a_file_named_twice_is_read_once() {
    let mesh = "[[object]]\nkind = \"mesh\"\nfile = \"meshes/leaf.glb\"\n";
    let scene = accept(&format!("{mesh}{mesh}"));
    assert_eq!((scene.objects.len(), scene.meshes.len(), scene.textures.len()), (2, 1, 1));
}

#[test]
fn meshes_must_be_there_and_whole() {
    let mesh = "[[object]]\nkind = \"mesh\"\nfile = ";
    assert_eq!(refuse(&format!("{mesh}\"no.glb\"\n")), "my.toml:5:8: file: no.glb: no such file");
    let folder = tempfile::tempdir().expect("a folder");
    assert_eq!(refuse_in(folder.path(), &format!("{mesh}\"no.glb\"\n")), "/my.toml:5:8: file: no.glb: no such file");
    let whole = shipped::asset("meshes/leaf.glb").expect("a mesh");
    fs::write(folder.path().join("cut.glb"), &whole[..5000]).expect("a file");
    assert_eq!(
        refuse_in(folder.path(), &format!("{mesh}\"cut.glb\"\n")),
        format!("/my.toml:5:8: file: cut.glb: truncated GLB: {} bytes are declared, 5000 are there", whole.len())
    );
}

#[test]
fn paths_stay_in_the_folder() {
    let outside = tempfile::tempdir().expect("a folder");
    let mesh = shipped::asset("meshes/leaf.glb").expect("a mesh");
    fs::write(outside.path().join("leaf.glb"), mesh).expect("a mesh");
    let inside = outside.path().join("scenes");
    fs::create_dir_all(inside.join("sub")).expect("a folder");
    fs::write(inside.join("own.glb"), mesh).expect("a mesh");
    let refusal = |path: &str| refuse_in(&inside, &format!("[[object]]\nkind = \"mesh\"\nfile = {path:?}\n"));

    assert_eq!(refusal("../leaf.glb"), "/my.toml:5:8: file: ../leaf.glb: the path leaves the scene's folder");
    assert_eq!(
        refusal("sub/../../leaf.glb"),
        "/my.toml:5:8: file: sub/../../leaf.glb: the path leaves the scene's folder"
    );
    assert_eq!(
        refusal("/etc/passwd"),
        "/my.toml:5:8: file: /etc/passwd: the path is absolute: paths are relative to the scene's folder"
    );
    assert_eq!(refusal("sub"), "/my.toml:5:8: file: sub: not a plain file");
    assert_eq!(refusal("own.glb/x"), "/my.toml:5:8: file: own.glb/x: no such file");
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("../leaf.glb", inside.join("link.glb")).expect("a link");
        assert_eq!(refusal("link.glb"), "/my.toml:5:8: file: link.glb: the path leaves the scene's folder");
        // A link that stays inside is followed.
        std::os::unix::fs::symlink("own.glb", inside.join("alias.glb")).expect("a link");
        let scene = inside.join("good.toml");
        let text = format!("{TORUS}[[object]]\nkind = \"mesh\"\nfile = \"sub/../alias.glb\"\n");
        fs::write(&scene, text).expect("a scene");
        file::load(scene.to_str().expect("a path")).unwrap_or_else(|e| panic!("{e}"));
    }
}

#[test]
fn gluing_files_stay_in_the_folder() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = folder.path().join("my.toml");
    fs::write(&scene, "[space]\ngluing = \"../x.json\"\n").expect("a scene");
    let message = file::load(scene.to_str().expect("a path")).expect_err("a refusal").to_string();
    assert!(message.ends_with("my.toml:2:10: gluing: ../x.json: the path leaves the scene's folder"), "{message}");
}

/// Signature and header of a PNG of this size, and nothing more.
pub fn png_header(width: u32, height: u32) -> Vec<u8> {
    let mut chunk = b"IHDR".to_vec();
    chunk.extend(width.to_be_bytes());
    chunk.extend(height.to_be_bytes());
    chunk.extend([8, 6, 0, 0, 0]);
    let mut png = b"\x89PNG\r\n\x1a\n".to_vec();
    png.extend(13_u32.to_be_bytes());
    png.extend(&chunk);
    png.extend(crc32(&chunk).to_be_bytes());
    png
}

fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| if crc & 1 == 1 { crc >> 1 ^ 0xedb8_8320 } else { crc >> 1 })
    })
}

#[test]
fn textures_are_decoded_once_and_linear() {
    let folder = tempfile::tempdir().expect("a folder");
    let png = image::RgbaImage::from_pixel(2, 1, image::Rgba([188, 0, 255, 128]));
    png.save(folder.path().join("a.png")).expect("an image");
    let scene = folder.path().join("my.toml");
    let lines = "[[material]]\nname = \"a\"\ntexture = \"a.png\"\n[[material]]\nname = \"b\"\ntexture = \"a.png\"\nsurface-texture = \"a.png\"\n";
    fs::write(&scene, format!("{TORUS}{lines}")).expect("a scene");
    let scene = file::load(scene.to_str().expect("a path")).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(scene.textures.len(), 2);
    assert_eq!((scene.materials[1].base_texture, scene.materials[1].surface_texture), (Some(0), Some(1)));
    let [srgb, linear] = [0, 1].map(|i| scene.textures[i].texels[1].map(f32::from));
    // 188 in sRGB is one half of the light, nearly.
    assert!((srgb[0] - 0.502_886).abs() < 5e-4 && srgb[1] == 0.0 && srgb[2] == 1.0, "{srgb:?}");
    assert!((linear[0] - 188.0 / 255.0).abs() < 5e-4 && (linear[3] - srgb[3]).abs() == 0.0, "{linear:?}");
    assert!((srgb[3] - 128.0 / 255.0).abs() < 5e-4);
    assert_eq!((scene.textures[0].width, scene.textures[0].height, scene.textures[0].wrap), (2, 1, [Wrap::Repeat; 2]));
}

#[test]
fn images_of_impossible_sizes_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let material = "[[material]]\nname = \"a\"\ntexture = \"a.png\"\n";
    let refusal = |bytes: &[u8]| {
        fs::write(folder.path().join("a.png"), bytes).expect("an image");
        refuse_in(folder.path(), material)
    };
    for (width, height) in [(0, 0), (0, 5), (100_000, 100_000), (MAX_TEXTURE_SIZE + 1, 1)] {
        assert_eq!(
            refusal(&png_header(width, height)),
            format!("/my.toml:5:11: texture: a.png: image of {width}x{height}: sides must be 1 to 16384")
        );
    }
    assert_eq!(
        refusal(&png_header(16384, 16384)),
        "/my.toml:5:11: texture: a.png: image of 16384x16384: \
         268435456 texels in the scene, at most 134217728 are allowed"
    );
    // A header of a size that is allowed gets past the check and fails for the missing rest.
    let message = refusal(&png_header(8192, 8192));
    assert!(message.starts_with("/my.toml:5:11: texture: a.png: image: "), "{message}");
    assert!(refusal(b"nothing").starts_with("/my.toml:5:11: texture: a.png: image: "));
}

#[test]
fn messages_are_one_line() {
    for lines in ["\"a\\nb\" = 1\n", "[observer]\nfov = \"a\\nb\"\n", "[[object]]\nkind = \"mesh\"\nfile = \"a\\nb\"\n"]
    {
        assert_eq!(refuse(lines).lines().count(), 1);
    }
}

proptest! {
    #[test]
    fn arbitrary_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        let _ = file::read("my.toml", &bytes, &Folder::Embedded);
    }

    /// Scenes with a few characters changed.
    #[test]
    fn spoiled_scenes_never_panic(
        name in prop::sample::select(vec!["torus.toml", "poincare.toml", "mirrored-cube.toml"]),
        changes in prop::collection::vec((any::<prop::sample::Index>(), "[-0-9a-z\\[\\]=\".# ]"), 1..4),
    ) {
        // Without the meshes, which take their time.
        let text = String::from_utf8_lossy(shipped::asset(name).unwrap_or_default()).replace("meshes/", "none/");
        let mut text: Vec<char> = text.chars().collect();
        for (at, with) in changes {
            let at = at.index(text.len());
            text.splice(at..at + 1, with.chars());
        }
        let text: String = text.into_iter().collect();
        if let Err(e) = file::read("my.toml", text.as_bytes(), &Folder::Embedded) {
            prop_assert_eq!(e.to_string().lines().count(), 1);
        }
    }
}

#[test]
fn whole_geometries_are_one_cell_or_a_gluing() {
    let scene = |text: &str| read(&format!("[space]\n{text}")).unwrap_or_else(|e| panic!("{e}"));
    for name in ["e3", "h3"] {
        let whole = scene(&format!("geometry = \"{name}\"\n"));
        assert_eq!((whole.space.name.as_str(), whole.space.geometry.name()), (name, name));
        assert_eq!(whole.space.faces().count(), 0);
        assert_eq!(whole.settings.max_distance, Some(8.0), "rays without end are given one");
        let far = scene(&format!("geometry = \"{name}\"\n[render]\nmax-distance = 20\n"));
        assert_eq!(far.settings.max_distance, Some(20.0));
    }
    // One chart does not show the sphere.
    let sphere = scene("geometry = \"s3\"\n");
    assert_eq!((sphere.space.cells.len(), sphere.settings.max_distance), (8, None));
    assert_eq!(file::load_space("h3").expect("a space").cells.len(), 1);
}

/// Frames, grids and colours by place.
#[test]
fn faces_grids_and_coordinates_are_read() {
    let material = "[[material]]\nname = \"m\"\ncoordinates = [[0, 1], [1, 0], [-2, 2]]\n";
    let scene = accept(&format!(
        "{material}[[object]]\nkind = \"domain-faces\"\nface = 2\nwidth = 0.25\nmaterial = \"m\"\n\
         [[object]]\nkind = \"grid\"\nlower = [0, 0, 0]\nupper = [1, 1, 0]\nlines = [2, 3, 1]\nradius = 0.1\nmaterial = \"m\"\n"
    ));
    assert_eq!(scene.materials[0].coordinates, Some([[0.0, 1.0], [1.0, 0.0], [-2.0, 2.0]]));
    assert_eq!(scene.objects[0].shape, Shape::DomainFaces { width: 0.25, face: Some(2) });
    let (lower, upper) = (DVec3::ZERO, DVec3::new(1.0, 1.0, 0.0));
    assert_eq!(scene.objects[1].shape, Shape::Grid { lower, upper, lines: [2, 3, 1], radius: 0.1 });

    let coordinates = |value: &str| refuse(&format!("[[material]]\nname = \"m\"\ncoordinates = {value}\n"));
    assert_eq!(
        coordinates("[[0, 1]]"),
        "my.toml:5:15: coordinates: expected an array of 3 ranges [from, to], found an array of 1"
    );
    assert_eq!(coordinates("[[0, 1], [2, 2], [0, 1]]"), "my.toml:5:24: coordinates[1]: the range is empty");
    let object = |lines: &str| refuse(&format!("[[material]]\nname = \"m\"\n[[object]]\nmaterial = \"m\"\n{lines}"));
    assert_eq!(
        object("kind = \"grid\"\nlower = [0, 2, 0]\nupper = [1, 1, 1]\nlines = [1, 1, 1]\nradius = 0.1\n"),
        "my.toml:9:9: upper: the corner [1, 1, 1] is not beyond the corner \"lower\", [0, 2, 0]"
    );
    assert!(
        object("kind = \"grid\"\nlower = [0, 0, 0]\nupper = [1, 1, 1]\nlines = [1, 99, 1]\nradius = 0.1\n")
            .starts_with("my.toml:10:13: lines[1]: 99 is out of range")
    );
    assert_eq!(
        object("kind = \"domain-faces\"\nmotion = { velocity = [1, 0, 0] }\n"),
        "my.toml:8:10: motion: the faces of a cell stay where they are: they cannot move"
    );
    assert_eq!(
        object(
            "kind = \"grid\"\nlower = [0, 0, 0]\nupper = [1, 1, 1]\nlines = [1, 1, 1]\nradius = 0.1\nattach = \"viewer\"\n"
        ),
        "my.toml:12:10: attach: the lines of a grid stay where they are: they cannot be attached to the viewer"
    );
    assert!(object("kind = \"domain-faces\"\nwidth = 1.5\n").starts_with("my.toml:8:9: width: 1.5 is out of range"));
}
