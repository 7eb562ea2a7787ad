//! Gluing files: both forms, round trips, and what is refused with which words.

use crate::spaces::{classical, reference_space};
use glam::{DMat4, DVec3, DVec4};
use holonomy::geometry::{GeometryId, Isometry};
use holonomy::space::check::{Kind, check};
use holonomy::space::gluing::{parse, read, to_json};
use holonomy::space::{Cell, Face, FaceId, Space, catalogue};
use std::f64::consts::PI;

/// A row-major matrix as JSON.
fn json_matrix(m: DMat4) -> String {
    let rows: Vec<String> = (0..4).map(|i| format!("{:?}", m.row(i).to_array())).collect();
    format!("[{}]", rows.join(","))
}

/// The generator form.
fn generators(geometry: &str, matrices: &[DMat4]) -> String {
    let list: Vec<String> = matrices.iter().map(|m| json_matrix(*m)).collect();
    format!("{{\"geometry\":\"{geometry}\",\"generators\":[{}]}}", list.join(","))
}

/// The message with which a text is refused.
fn refusal(text: &str) -> String {
    let message = parse(text, "x.json").expect_err("must be refused").to_string();
    assert!(message.starts_with("x.json:") && !message.contains('\n'), "{message}");
    message
}

fn assert_refused(text: &str, words: &str) {
    let message = refusal(text);
    assert!(message.contains(words), "{message:?} should say {words:?}");
}

#[test]
fn gluing_round_trip_keeps_every_number() {
    for entry in classical() {
        let space = reference_space(&entry);
        let back = parse(&to_json(&space), "copy").unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(back.geometry, space.geometry);
        for (a, b) in space.faces().zip(back.faces()) {
            assert_eq!((a.1.plane, a.1.pairing, a.1.partner), (b.1.plane, b.1.pairing, b.1.partner), "{}", space.name);
        }
    }
    let name = "poincare";
    let space = catalogue::find(name).expect("space");
    let file = tempfile::NamedTempFile::new().expect("file");
    std::fs::write(file.path(), to_json(&space)).expect("written");
    assert_eq!(to_json(&read(file.path()).expect("readable")), to_json(&space));
}

#[test]
fn gluing_pairings_generate_the_space_again() {
    for entry in classical() {
        let space = reference_space(&entry);
        // The torus of the catalogue has its base point in a corner, which a translation does not mind.
        let matrices: Vec<DMat4> = space.faces().map(|(_, f)| f.pairing.linear).collect();
        let again = parse(&generators(space.geometry.name(), &matrices), "again")
            .unwrap_or_else(|e| panic!("{}: {e}", space.name));
        let (one, two) = (check(&space).expect("closes"), check(&again).expect("closes"));
        assert_eq!(one.faces, two.faces, "{}", space.name);
        assert!((one.volume / two.volume - 1.0).abs() < 1e-11, "{}: {} {}", space.name, one.volume, two.volume);
        assert_eq!(one.homology, two.homology, "{}", space.name);
        assert_eq!(one.kind, two.kind, "{}", space.name);
        assert_eq!(one.edge_cycles.len(), two.edge_cycles.len(), "{}", space.name);
    }
}

#[test]
fn gluing_few_generators_suffice() {
    // A few pairings generate the group, or a subgroup of finite index whose domain is a whole number of cells.
    for (name, faces) in [("poincare", vec![0, 1]), ("seifert-weber", vec![0, 1, 2, 5])] {
        let space = catalogue::find(name).expect("space");
        let matrices: Vec<DMat4> = faces.iter().map(|&f: &usize| space.cells[0].faces[f].pairing.linear).collect();
        match parse(&generators(space.geometry.name(), &matrices), name) {
            Ok(again) => {
                let ratio = check(&again).expect("closes").volume / check(&space).expect("closes").volume;
                assert!((ratio - ratio.round()).abs() < 1e-9 && ratio > 0.5, "{name}: index {ratio}");
            }
            Err(e) => panic!("{name}: {e}"),
        }
    }
    let translate = |x, y, z| DMat4::from_translation(DVec3::new(x, y, z));
    // A skew basis of the cubic lattice, and a body-centred one with the truncated octahedron.
    let skew = [translate(1.0, 0.0, 0.0), translate(7.0, 1.0, 0.0), translate(-3.0, 5.0, 1.0)];
    let cube = parse(&generators("e3", &skew), "skew").unwrap_or_else(|e| panic!("{e}"));
    let report = check(&cube).expect("closes");
    assert!((report.volume - 1.0).abs() < 1e-12);
    assert_eq!((report.faces, report.homology), (6, vec![0, 0, 0]));
    let centred = [translate(1.0, 1.0, -1.0), translate(1.0, -1.0, 1.0), translate(-1.0, 1.0, 1.0)];
    let octahedron = parse(&generators("e3", &centred), "bcc").unwrap_or_else(|e| panic!("{e}"));
    let report = check(&octahedron).expect("closes");
    assert!((report.volume - 4.0).abs() < 1e-12);
    assert_eq!((report.faces, report.edges, report.vertices), (14, 36, 24));
    // A long thin torus.
    let long = [translate(1.0, 0.0, 0.0), translate(0.0, 1.0, 0.0), translate(0.3, 0.4, 40.0)];
    let report = check(&parse(&generators("e3", &long), "long").unwrap_or_else(|e| panic!("{e}"))).expect("closes");
    assert!((report.volume - 40.0).abs() < 1e-10);
    // Tiny and huge ones.
    for size in [1e-7, 1e7] {
        let lattice = skew.map(|m| DMat4::from_translation(m.w_axis.truncate() * size));
        let torus = parse(&generators("e3", &lattice), "scaled").unwrap_or_else(|e| panic!("{size}: {e}"));
        assert!((check(&torus).expect("closes").volume / size.powi(3) - 1.0).abs() < 1e-12);
    }
    // A screw motion and a translation across it: the others are products.
    let screw = translate(0.0, 0.0, 1.0) * DMat4::from_rotation_z(PI / 3.0);
    let sixth =
        check(&parse(&generators("e3", &[screw, translate(1.0, 0.0, 0.0)]), "sixth").unwrap_or_else(|e| panic!("{e}")));
    let report = sixth.expect("closes");
    assert_eq!(report.homology, vec![0]);
    assert!((report.volume - 0.75_f64.sqrt()).abs() < 1e-12);
}

#[test]
fn gluing_lens_space_with_a_polyhedral_domain() {
    // Left multiplication by the quaternions ±1, ±i, ±j, ±k: a cube with opposite faces glued by a quarter turn.
    let i = DMat4::from_cols(-DVec4::W, DVec4::Z, -DVec4::Y, DVec4::X);
    let j = DMat4::from_cols(-DVec4::Z, -DVec4::W, DVec4::X, DVec4::Y);
    let space = parse(&generators("s3", &[i, j]), "quaternions").unwrap_or_else(|e| panic!("{e}"));
    let report = check(&space).expect("closes");
    assert_eq!((report.faces, report.kind), (6, Kind::Manifold));
    assert_eq!(report.homology, vec![2, 2]);
    assert!((report.volume - 0.25 * PI * PI).abs() < 1e-12);
}

/// The three-sphere as the boundary of a four-cube: eight cells, each with the partner's chart at its own centre.
fn sphere_of_eight_cubes() -> Space {
    // Cell 2a + s is centred at ±eₐ. A chart turns the centre to the base point, by a quarter turn in the plane of
    // eₐ and e₃, or a half turn for −e₃.
    let axes = [DVec4::X, DVec4::Y, DVec4::Z, DVec4::W];
    let centre = |cell: usize| axes[cell / 2] * if cell.is_multiple_of(2) { 1.0 } else { -1.0 };
    let chart_from_sphere = |cell: usize| {
        let c = centre(cell);
        if cell == 6 {
            return DMat4::IDENTITY;
        }
        if cell == 7 {
            return DMat4::from_diagonal(DVec4::new(-1.0, 1.0, 1.0, -1.0));
        }
        let turn = |v: DVec4| v - c * c.dot(v) - DVec4::W * v.w + DVec4::W * c.dot(v) - c * v.w;
        DMat4::from_cols(turn(axes[0]), turn(axes[1]), turn(axes[2]), turn(axes[3]))
    };
    let neighbours = |cell: usize| (0..8).filter(move |other| other / 2 != cell / 2);
    let cells = (0..8).map(|cell| {
        let faces = neighbours(cell).map(|other| {
            // The points as far from the one centre as from the other.
            let towards = chart_from_sphere(cell) * (centre(other) - centre(cell));
            let face = neighbours(other).position(|back| back == cell).expect("neighbours are mutual");
            Face {
                plane: towards / 2.0_f64.sqrt(),
                pairing: Isometry::linear(chart_from_sphere(other) * chart_from_sphere(cell).transpose()),
                partner: FaceId { cell: other, face },
            }
        });
        Cell { faces: faces.collect() }
    });
    Space { name: "eight cubes".to_owned(), geometry: GeometryId::S3, cells: cells.collect() }
}

#[test]
fn gluing_several_cells_make_the_sphere() {
    let space = sphere_of_eight_cubes();
    let back = parse(&to_json(&space), "eight cubes").unwrap_or_else(|e| panic!("{e}"));
    for space in [&space, &back] {
        let report = check(space).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!((report.cells, report.faces, report.vertex_classes), (8, 48, 16));
        assert_eq!((report.homology.as_slice(), report.kind, report.orientable), ([].as_slice(), Kind::Manifold, true));
        assert_eq!(report.euler_characteristic, 0);
        assert!(report.edge_cycles.len() == 32 && report.edge_cycles.iter().all(|c| c.length == 3));
        assert!((report.volume - 2.0 * PI * PI).abs() < 1e-11, "{}", report.volume);
    }
    let mut spoilt = space;
    let wrong = spoilt.cells[3].faces[2].pairing.linear * DMat4::from_rotation_x(0.5 * PI);
    spoilt.cells[3].faces[2].pairing = Isometry::linear(wrong);
    let message = check(&spoilt).expect_err("spoilt").to_string();
    assert!(message.contains("of cell 3"), "{message}");
}

#[test]
fn gluing_scale_of_planes_does_not_matter() {
    for name in catalogue::NAMES {
        let space = catalogue::find(name).expect("space");
        let mut scaled = space.clone();
        scaled.cells[0].faces.iter_mut().for_each(|f| f.plane *= 37.5);
        let back = parse(&to_json(&scaled), name).unwrap_or_else(|e| panic!("{e}"));
        for (a, b) in space.faces().zip(back.faces()) {
            let size = a.1.plane.abs().max_element();
            assert!((a.1.plane - b.1.plane).abs().max_element() < 1e-13 * size, "{name}: {} {}", a.1.plane, b.1.plane);
        }
    }
}

#[test]
fn gluing_syntax_errors_have_line_and_column() {
    assert!(refusal("{\n \"geometry\": \"e3\",\n oops\n}").starts_with("x.json:3:2: "));
    assert!(refusal("{\"geometry\": \"e3\", \"cells\": [1e999]}").starts_with("x.json:1:"));
    assert_refused("{\"geometry\": \"e3\", \"cells\": [1e999]}", "number out of range");
    assert_refused("{\"geometry\": \"e3\", \"cells\": [NaN]}", "x.json:1:");
    assert_refused("", "x.json:1:0: EOF");
    assert_refused(&"[".repeat(100_000), "recursion limit");
    let file = tempfile::NamedTempFile::new().expect("file");
    std::fs::write(file.path(), b"{\n\"\xff\"}").expect("written");
    let message = read(file.path()).expect_err("no text").to_string();
    assert!(message.ends_with(":2:2: not UTF-8"), "{message}");
    let message = read("no/such/file.json".as_ref()).expect_err("no file").to_string();
    assert!(message.starts_with("no/such/file.json: "), "{message}");
}

#[test]
fn gluing_content_errors_have_a_path_and_a_suggestion() {
    let good = to_json(&catalogue::find("torus").expect("torus"));
    assert_refused("[]", "x.json: needs an object");
    assert_refused("{}", "x.json: the key \"geometry\" is missing");
    assert_refused("{\"geometry\": \"e3\"}", "x.json: needs either \"cells\" or \"generators\"");
    assert_refused("{\"geometry\": 3}", "x.json: geometry: needs the name");
    assert_refused("{\"geometry\": \"hyperbollic\"}", "did you mean \"hyperbolic\"?");
    assert_refused("{\"geometri\": \"e3\"}", "unknown key \"geometri\", did you mean \"geometry\"?");
    assert_refused(
        &good.replacen("pair", "pairs", 1),
        "cells[0].faces[0]: unknown key \"pairs\", did you mean \"pair\"?",
    );
    assert_refused(&good.replacen("\"matrix\"", "\"m\"", 1), "cells[0].faces[0]: unknown key \"m\"");
    assert_refused(&good.replacen("[1.0, 0.0, 0.0, -1.0]", "[1.0, 0.0, 0.0]", 1), "faces[0].plane: needs 4 numbers");
    assert_refused(
        &good.replacen("[1.0, 0.0, 0.0, -1.0]", "[1.0, 0.0, \"a\", 1]", 1),
        "plane[2]: needs a number, not a text",
    );
    assert_refused(&good.replacen("\"face\": 1", "\"face\": -1", 1), "pair.face: needs an index from 0, not -1");
    assert_refused(&good.replacen("\"face\": 1", "\"face\": 1.5", 1), "pair.face: needs an index from 0, not 1.5");
    assert_refused(&good.replacen("\"face\": 1", "\"face\": 99", 1), "face 0 of cell 0: its partner");
    assert_refused(&good.replacen("1.0]]", "1e200]]", 1), "faces[0].matrix[3][3]: 1e200 is beyond");
    assert_refused("{\"geometry\": \"e3\", \"cells\": []}", "cells: has 0 entries, allowed are 1 to");
    assert_refused(
        "{\"geometry\": \"e3\", \"cells\": [{\"faces\": []}]}",
        "cells[0].faces: has 0 entries, allowed are 4 to 256",
    );
    let many = format!("{{\"geometry\": \"e3\", \"cells\": [{}0]}}", "0,".repeat(5000));
    assert_refused(&many, "cells: has 5001 entries");
    let many = format!("{{\"geometry\": \"e3\", \"generators\": [{}0]}}", "0,".repeat(5000));
    assert_refused(&many, "generators: has 5001 entries");
    assert_refused(
        "{\"geometry\": \"e3\", \"generators\": [[[1,2],[3,4]]]}",
        "generators[0]: needs 4 rows of 4 numbers",
    );
}

#[test]
fn gluing_that_does_not_close_names_the_place() {
    let good = to_json(&catalogue::find("torus").expect("torus"));
    assert_refused(
        &good.replacen("[1.0, 0.0, 0.0, -1.0]", "[1.0, 0.0, 0.0, -1.000001]", 1),
        "face 0 of cell 0: its pairing",
    );
    let mut turned = catalogue::find("poincare").expect("space");
    for face in &mut turned.cells[0].faces {
        let axis = DVec3::new(face.plane.x, face.plane.y, face.plane.z).normalize();
        face.pairing.linear *= DMat4::from_axis_angle(-axis, 0.4 * PI);
    }
    assert_refused(&to_json(&turned), "edge between faces 0 and 1 of cell 0");
}

#[test]
fn gluing_groups_without_a_compact_domain_are_refused() {
    let translate = |x: f64, y: f64, z: f64| DMat4::from_translation(DVec3::new(x, y, z));
    let (x, y, z) = (translate(1.0, 0.0, 0.0), translate(0.0, 1.0, 0.0), translate(0.0, 0.0, 1.0));
    assert_refused(&generators("e3", &[x, y]), "not bounded in the chart");
    assert_refused(&generators("e3", &[x]), "not compact");
    assert_refused(&generators("e3", &[DMat4::IDENTITY]), "not bounded");
    assert_refused(
        &generators("h3", &[catalogue::find("seifert-weber").expect("space").cells[0].faces[0].pairing.linear]),
        "not bounded",
    );
    assert_refused(&generators("e3", &[x, y, z, translate(2.0_f64.sqrt(), 0.0, 0.0)]), "not discrete");
    assert_refused(&generators("e3", &[x, y, z, DMat4::from_rotation_x(0.5 * PI)]), "fixed by an element");
    let screw = z * DMat4::from_rotation_z(1.0);
    let message = refusal(&generators("e3", &[screw, x]));
    assert!(message.contains("not discrete") || message.contains("no Dirichlet domain"), "{message}");
    assert_refused(&generators("e3", &[x, y, z * 1.01]), "generators[2]: not an isometry (residual ");
    assert_refused(
        &generators("h3", &[DMat4::from_diagonal(DVec4::splat(-1.0))]),
        "generators[0]: takes the base point off",
    );
    assert_refused(&generators("s3", &[DMat4::from_diagonal(DVec4::splat(-1.0))]), "not bounded in the chart");
    let huge = DMat4::from_diagonal(DVec4::splat(1e99));
    assert_refused(&generators("h3", &[huge]), "generators[0]: not an isometry");
}
