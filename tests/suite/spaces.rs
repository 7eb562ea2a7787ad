//! The named spaces against 30-digit reference data (`tests/data/spaces.json`), and damaged copies of them.

use glam::{DMat4, DVec3, DVec4};
use holonomy::geometry::matrix_from_rows;
use holonomy::space::catalogue;
use serde_json::Value;

/// All reference entries.
fn all_references() -> Vec<Value> {
    let data: Value = serde_json::from_str(include_str!("../data/spaces.json")).expect("reference data");
    data["manifolds"].as_array().expect("list").clone()
}

/// The reference entry of a space.
fn reference(name: &str) -> Value {
    all_references().into_iter().find(|m| m["name"] == name).expect("reference of the space")
}

/// The entries whose cells are polyhedra in a chart with straight geodesics.
pub fn classical() -> Vec<Value> {
    let straight = ["e3", "s3", "h3"];
    all_references().into_iter().filter(|m| straight.iter().any(|g| m["geometry"] == *g)).collect()
}

/// Face planes of a reference entry.
pub fn planes(entry: &Value) -> Vec<DVec4> {
    entry["faces"].as_array().expect("faces").iter().map(|f| vector(&f["plane"])).collect()
}

/// Corners of a reference entry in the chart.
pub fn reference_vertices(entry: &Value) -> Vec<DVec3> {
    let corner = |v: &Value| {
        let w = if v.as_array().is_some_and(|v| v.len() == 4) { number(&v[3]) } else { 1.0 };
        DVec3::from_array(std::array::from_fn(|i| number(&v[i]) / w))
    };
    entry["vertices"].as_array().expect("vertices").iter().map(corner).collect()
}

/// A number of the reference data, which is a string with 40 digits.
fn number(value: &Value) -> f64 {
    value.as_str().expect("number in quotes").parse().expect("number")
}

fn vector(value: &Value) -> DVec4 {
    DVec4::from_array(std::array::from_fn(|i| number(&value[i])))
}

fn matrix(value: &Value) -> DMat4 {
    matrix_from_rows(std::array::from_fn(|i| vector(&value[i]).to_array()))
}

fn largest(m: DMat4) -> f64 {
    m.to_cols_array().iter().fold(0.0, |worst, x| x.abs().max(worst))
}

#[test]
fn spaces_have_the_reference_planes_and_pairings() {
    for name in catalogue::NAMES {
        let space = catalogue::find(name).expect("named space");
        let reference = reference(name);
        assert_eq!(space.geometry.name(), reference["geometry"], "{name}");
        let faces = reference["faces"].as_array().expect("faces");
        assert_eq!(space.cells[0].faces.len(), faces.len(), "{name}");
        for (f, (face, wanted)) in space.cells[0].faces.iter().zip(faces).enumerate() {
            let plane = (face.plane - vector(&wanted["plane"])).abs().max_element();
            let pairing = largest(face.pairing.linear - matrix(&wanted["matrix"]));
            let scale = largest(face.pairing.linear);
            assert!(plane <= 5e-16, "{name}: plane of face {f} is off by {plane:e}");
            assert!(pairing <= 1e-15 * scale, "{name}: pairing of face {f} is off by {pairing:e}");
            assert_eq!(Some(face.partner.face as u64), wanted["pair"].as_u64(), "{name}: partner of face {f}");
        }
    }
}

#[test]
fn spaces_unknown_name_is_none() {
    assert!(catalogue::find("klein-bottle-flask").is_none());
}
