//! Polyhedra from planes: the catalogue's cells against the reference corners, and planes that bound nothing.

use crate::spaces::{classical, planes, reference_vertices};
use glam::{DVec3, DVec4, Vec4Swizzles};
use holonomy::space::polyhedron::{Polyhedron, PolyhedronError};

/// The planes ±1/2 of a cube.
fn cube() -> Vec<DVec4> {
    [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z].map(|n| n.extend(-0.5)).to_vec()
}

fn error(planes: &[DVec4]) -> PolyhedronError {
    Polyhedron::from_planes(planes).expect_err("must be refused")
}

#[test]
fn polyhedra_have_the_reference_corners() {
    for entry in classical() {
        let name = &entry["name"];
        let planes = planes(&entry);
        let shape = Polyhedron::from_planes(&planes).unwrap_or_else(|e| panic!("{name}: {e}"));
        let wanted = reference_vertices(&entry);
        for (field, count) in
            [("vertices", shape.vertices.len()), ("edges", shape.edges.len()), ("faces", shape.face_vertices.len())]
        {
            assert_eq!(entry["counts"][field], count, "{name}: {field}");
        }
        for vertex in wanted {
            let nearest = shape.vertices.iter().map(|v| v.distance(vertex)).fold(f64::INFINITY, f64::min);
            assert!(nearest < 1e-14, "{name}: the corner {vertex} is off by {nearest:e}");
        }
    }
}

#[test]
fn polyhedra_outlines_turn_left_seen_from_outside() {
    for entry in classical() {
        let planes = planes(&entry);
        let shape = Polyhedron::from_planes(&planes).expect("cell");
        for (plane, outline) in planes.iter().zip(&shape.face_vertices) {
            for i in 0..outline.len() {
                let [a, b, c] = [0, 1, 2].map(|k| shape.vertices[outline[(i + k) % outline.len()]]);
                assert!((b - a).cross(c - b).dot(plane.xyz()) > 0.0, "{}", entry["name"]);
            }
        }
        for edge in &shape.edges {
            assert!(edge.faces[0] < edge.faces[1]);
            assert_eq!(shape.edge_between(edge.faces[1], edge.faces[0]).map(|e| shape.edges[e]), Some(*edge));
        }
    }
}

#[test]
fn polyhedra_of_any_size_and_place() {
    for (size, place) in [(1e-9, 0.0), (1.0, 1e3), (1e9, -3e8)] {
        let centre = DVec3::new(0.3, -1.1, 0.7) * place;
        let moved = cube().iter().map(|p| p.xyz().extend(p.w * size - p.xyz().dot(centre)) * 7.0).collect::<Vec<_>>();
        let shape = Polyhedron::from_planes(&moved).expect("cube");
        assert_eq!((shape.vertices.len(), shape.edges.len()), (8, 12));
        assert!(shape.centroid.distance(centre) <= 1e-12 * (size + centre.length()));
        assert!((shape.circumradius / size - 0.75_f64.sqrt()).abs() < 1e-9);
    }
}

#[test]
fn polyhedra_that_are_not_bounded_name_a_face() {
    assert!(matches!(error(&cube()[..5]), PolyhedronError::Unbounded { .. }));
    assert!(matches!(error(&cube()[..4]), PolyhedronError::Unbounded { .. }));
    assert!(matches!(error(&cube()[..2]), PolyhedronError::Unbounded { .. }));
    assert!(matches!(error(&[]), PolyhedronError::Unbounded { .. }));
}

#[test]
fn polyhedra_name_the_redundant_face() {
    let mut planes = cube();
    planes.insert(2, DVec3::ONE.extend(-2.0));
    assert_eq!(error(&planes), PolyhedronError::Redundant { face: 2 });
    // Touching a corner only.
    planes[2] = DVec3::ONE.extend(-1.5);
    assert_eq!(error(&planes), PolyhedronError::Redundant { face: 2 });
    // The same plane twice.
    planes[2] = DVec4::new(2.0, 0.0, 0.0, -1.0);
    assert_eq!(error(&planes), PolyhedronError::Redundant { face: 2 });
}

#[test]
fn polyhedra_that_are_empty_or_flat_name_the_face() {
    let mut planes = cube();
    planes.push(DVec3::ONE.extend(2.0));
    assert_eq!(error(&planes), PolyhedronError::Empty { face: 6 });
    let mut flat = cube();
    flat[1] = DVec4::new(-1.0, 0.0, 0.0, 0.5);
    assert!(matches!(error(&flat), PolyhedronError::Empty { .. }));
}

#[test]
fn polyhedra_refuse_planes_that_are_none() {
    for bad in [DVec4::ZERO, DVec4::W, DVec4::splat(f64::NAN), DVec4::new(f64::INFINITY, 0.0, 0.0, 1.0)] {
        let mut planes = cube();
        planes[3] = bad;
        assert_eq!(error(&planes), PolyhedronError::NoPlane { face: 3 });
    }
    assert_eq!(error(&vec![DVec4::X; 1000]), PolyhedronError::TooManyFaces { count: 1000 });
}
