//! The named spaces against 30-digit reference data (`tests/data/spaces.json`), and damaged copies of them.

use crate::support::Random;
use glam::{DMat4, DVec2, DVec3, DVec4, Vec4Swizzles};
use holonomy::geometry::{Geometry, GeometryId, Isometry, Visitor, matrix_from_rows, sl2, visit};
use holonomy::space::check::{CheckError, Kind, Report, check};
use holonomy::space::{Cell, Face, FaceId, Space, catalogue, domain::Domain, observer::Frame, reduce::reduce_frame};
use serde_json::Value;
use std::f64::consts::{PI, TAU};

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

/// The catalogue's spaces of one such cell that the reference knows.
pub fn classical_names() -> Vec<&'static str> {
    let known: Vec<String> = classical().iter().map(|m| m["name"].as_str().expect("a name").to_owned()).collect();
    catalogue::NAMES.iter().copied().filter(|name| known.iter().any(|k| k == name)).collect()
}

/// All of the catalogue's spaces that the reference knows.
fn known_names() -> Vec<&'static str> {
    let known: Vec<String> = all_references().iter().map(|m| m["name"].as_str().expect("a name").to_owned()).collect();
    catalogue::NAMES.iter().copied().filter(|name| known.iter().any(|k| k == name)).collect()
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

/// The faces of a reference entry, in whichever of its forms.
pub fn reference_faces(entry: &Value) -> Vec<Face> {
    let listed = |index: &str| entry[index].as_array().expect("a list");
    let partner = |face: usize| FaceId { cell: 0, face };
    if entry.get("domain_planes").is_some() {
        // A cell about which left multiplications by one generator for each pair of faces go.
        let names = generator_names(entry);
        let generators = names.map(|g| DVec3::from_array([0, 1, 2].map(|i| number(&entry["generators"][g][i]))));
        let face = |(f, plane): (usize, &Value)| {
            let by = generators[f / 2] * if f % 2 == 0 { -1.0 } else { 1.0 };
            let mut pairing = DMat4::from_translation(by);
            if entry["geometry"] == "nil" {
                pairing.y_axis.z = by.x;
            } else {
                (pairing.x_axis.x, pairing.y_axis.y) = (by.z.exp(), (-by.z).exp());
            }
            Face { plane: vector(plane), pairing: Isometry::linear(pairing), partner: partner(f ^ 1) }
        };
        return listed("domain_planes").iter().enumerate().map(face).collect();
    }
    let face = |f: &Value| {
        if entry["geometry"] == "sl2" {
            let xyw = |v: &Value, z: f64| DVec4::new(number(&v[0]), number(&v[1]), z, number(&v[2]));
            let (plane, pairing, pair) = match f.get("left_factor") {
                Some(by) => (xyw(&f["plane_xyw"], 0.0), sl2::translation(vector(by)), f["pair"].as_u64()),
                None => {
                    let up = if f["side"] == "theta >= pi" { 1.0 } else { -1.0 };
                    let turn = Isometry { linear: DMat4::IDENTITY, shift: DVec4::Z * (-up * TAU) };
                    (DVec4::new(0.0, 0.0, up, -PI), turn, f["face"].as_u64().map(|face| 17 - face))
                }
            };
            return Face { plane, pairing, partner: partner(pair.expect("partner") as usize) };
        }
        let (plane, pairing) = match (f.get("matrix"), f.get("plane_xyw")) {
            (Some(m), _) => (vector(&f["plane"]), Isometry::linear(matrix(m))),
            (None, plane) => {
                let xyw = |v: &Value, z: f64| DVec4::new(number(&v[0]), number(&v[1]), z, number(&v[2]));
                let side = if f["side"] == "z <= 1/2" { 1.0 } else { -1.0 };
                let m = &f["matrix_xyw"];
                let rows = [xyw(&m[0], 0.0), xyw(&m[1], 0.0), DVec4::Z, xyw(&m[2], 0.0)].map(|r| r.to_array());
                let pairing = Isometry { linear: matrix_from_rows(rows), shift: DVec4::Z * number(&f["z_shift"]) };
                (plane.map_or(DVec4::new(0.0, 0.0, side, -0.5), |p| xyw(p, 0.0)), pairing)
            }
        };
        Face { plane, pairing, partner: partner(f["pair"].as_u64().expect("partner") as usize) }
    };
    listed("faces").iter().map(face).collect()
}

/// The generators of an entry with one for each pair of faces, in their order.
fn generator_names(entry: &Value) -> [&'static str; 3] {
    if entry["generators"].get("b1").is_some() { ["b1", "b2", "Phi3"] } else { ["Phi1", "Phi2", "Phi3"] }
}

#[test]
fn spaces_have_the_reference_planes_and_pairings() {
    assert_eq!(known_names().len(), all_references().len() - 1, "the reference has one mirrored cube more");
    for name in known_names() {
        let space = catalogue::find(name).expect("named space");
        let reference = reference(name);
        assert_eq!(space.geometry.name(), reference["geometry"], "{name}");
        let wanted = reference_faces(&reference);
        for cell in &space.cells {
            // Cells that are cut out of one of the reference have more faces, in front of those that both have.
            let own = cell.faces.len() - wanted.len();
            assert!(own == 0 || space.cells.len() > 1, "{name}");
            for (f, (face, wanted)) in cell.faces[own..].iter().zip(&wanted).enumerate() {
                let plane = (face.plane - wanted.plane).abs().max_element();
                let pairing = largest(face.pairing.linear - wanted.pairing.linear);
                let scale = largest(face.pairing.linear);
                assert!(plane <= 5e-16 * scale.max(1.0), "{name}: plane of face {f} is off by {plane:e}");
                assert!(pairing <= 1e-15 * scale, "{name}: pairing of face {f} is off by {pairing:e}");
                assert_eq!(face.pairing.shift, wanted.pairing.shift, "{name}: shift of face {f}");
                assert_eq!(face.partner.face, own + wanted.partner.face, "{name}: partner of face {f}");
            }
        }
    }
}

#[test]
fn spaces_sphere_of_eight_cubes_closes() {
    let mut space = catalogue::find("s3").expect("the sphere");
    let report = check(&space).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!([report.cells, report.faces, report.edges, report.vertices], [8, 48, 96, 64]);
    // The four-dimensional cube has 32 edges, round each of which three of its cells meet, and 16 corners.
    assert_eq!(report.edge_cycles.len(), 32);
    assert!(report.edge_cycles.iter().all(|cycle| cycle.length == 3 && cycle.residual < 1e-14));
    assert_eq!((report.vertex_classes, report.euler_characteristic), (16, 0));
    assert_eq!((report.kind, report.orientable), (Kind::Manifold, true));
    assert!(report.homology.is_empty(), "{:?}", report.homology);
    assert!((report.volume / (2.0 * PI * PI) - 1.0).abs() < 1e-13, "{}", report.volume);
    assert_eq!(report.pairing_residual, 0.0);
    // A turn by a right angle about one face more.
    let turn = DMat4::from_rotation_x(0.5 * PI);
    let (face, back) = (0, space.cells[3].faces[0].partner);
    space.cells[3].faces[face].pairing.linear *= turn;
    let inverse = space.cells[3].faces[face].pairing.linear.transpose();
    space.cells[back.cell].faces[back.face].pairing.linear = inverse;
    assert_names(&check(&space).expect_err("damaged"), "edge between");
}

#[test]
fn spaces_whole_geometry_has_nothing_to_check() {
    for name in ["e3", "h3"] {
        let space = catalogue::whole(GeometryId::from_name(name).expect("a geometry"));
        let error = check(&space).expect_err("nothing is glued");
        assert_names(&error, "cell 0 has no faces: it is the whole geometry");
    }
    let sphere = catalogue::whole(GeometryId::from_name("s2xr").expect("a geometry"));
    assert_eq!(sphere.cells.len(), 6, "a chart shows a hemisphere");
    assert_names(&check(&sphere).expect_err("it has no end"), "cell 0: the cell is not bounded");
}

#[test]
fn spaces_unknown_name_is_none() {
    assert!(catalogue::find("klein-bottle-flask").is_none());
}

/// The gluing of a reference entry.
pub fn reference_space(entry: &Value) -> Space {
    let geometry = GeometryId::from_name(entry["geometry"].as_str().expect("geometry")).expect("known geometry");
    Space { name: entry["name"].to_string(), geometry, cells: vec![Cell { faces: reference_faces(entry) }] }
}

/// Invariant factors from a sum such as `Z + Z/2 + Z/2`.
fn invariant_factors(group: &str) -> Vec<u64> {
    let mut factors: Vec<u64> = group
        .split(" + ")
        .filter(|summand| *summand != "0")
        .map(|summand| summand.strip_prefix("Z/").map_or(0, |order| order.parse().expect("order")))
        .collect();
    factors.sort_by_key(|&d| (d == 0, d));
    factors
}

/// What the reference says of a space against what the check says.
fn compare(entry: &Value, space: &Space) {
    let name = &entry["name"];
    let report = check(space).unwrap_or_else(|e| panic!("{name}: {e}"));
    // Rounding of pairings whose entries are large.
    let scale = space.faces().map(|(_, face)| largest(face.pairing.linear)).fold(1.0, f64::max).powi(2);
    for cycle in &report.edge_cycles {
        assert!(cycle.residual < 1e-12 * scale && (cycle.angle - TAU).abs() < 1e-13 * scale, "{name}: {cycle:?}");
    }
    assert!(report.pairing_residual < 1e-13 * scale, "{name}: {}", report.pairing_residual);
    let volume = number(&entry["volume"]);
    assert!((report.volume / volume - 1.0).abs() < 1e-13, "{name}: volume {} for {volume}", report.volume);
    assert_eq!(report.kind == Kind::Manifold, entry["kind"] == "manifold", "{name}");
    if entry.get("counts").is_none() {
        return compare_fibred(entry, &report);
    }
    assert_eq!(entry["counts"]["faces"], report.faces, "{name}");
    assert_eq!(entry["counts"]["edges"], report.edges, "{name}");
    assert_eq!(entry["counts"]["vertices"], report.vertices, "{name}");
    let cycles = entry["edge_cycles"].as_array().expect("cycles");
    let mut wanted: Vec<u64> = cycles.iter().map(|c| c["length"].as_u64().expect("length")).collect();
    let mut lengths: Vec<u64> = report.edge_cycles.iter().map(|c| c.length as u64).collect();
    wanted.sort_unstable();
    lengths.sort_unstable();
    assert_eq!(lengths, wanted, "{name}: lengths of the edge cycles");
    let checks = &entry["checks"];
    assert_eq!(checks["orientable"], report.orientable, "{name}");
    if report.kind == Kind::Manifold {
        assert_eq!(report.homology, invariant_factors(checks["H1"].as_str().expect("H1")), "{name}");
        assert_eq!(checks["vertex_classes"], report.vertex_classes, "{name}");
        assert_eq!(checks["euler_characteristic"], report.euler_characteristic, "{name}");
    } else {
        // Each mirror is a generator of order two, and right angles make them commute anyway.
        assert_eq!(report.homology, vec![2; report.faces], "{name}");
    }
}

/// What is known of the spaces whose reference counts no cells: products and bundles.
fn compare_fibred(entry: &Value, report: &Report) {
    let name = entry["name"].as_str().expect("name");
    // Z^2g from the surface and Z from the circle; in the Heisenberg group the third generator is a commutator.
    let (homology, lengths): (&[u64], &[(usize, usize)]) = match name {
        // Three faces of a cube meet in a corner, and two slabs; so 8 edges upright and 12 level.
        "s2xs1" => (&[0], &[(3, 8), (4, 12)]),
        "genus2xs1" => (&[0; 5], &[(4, 4), (8, 1)]),
        // The diagonals of the sheared faces and the edges that they are shifted to, and those of a cube.
        "nil-heisenberg" => (&[0; 2], &[(3, 2), (4, 2)]),
        // A − 1 is invertible over the integers, so the torus has no homology left; the sides and the lattice's lines
        // that they are taken to.
        "sol-golden" => (&[0], &[(3, 6), (4, 1)]),
        // Two generators for each handle, and the fibre, of which the relation makes two turns: the Euler number.
        "sl2-genus2-tangent" => (&[2, 0, 0, 0, 0], &[(3, 16), (8, 4)]),
        _ => panic!("nothing is known of {name}"),
    };
    assert_eq!(report.homology, homology, "{name}");
    assert!(report.orientable && report.euler_characteristic == 0, "{name}");
    let lengths: Vec<usize> = lengths.iter().flat_map(|&(length, count)| vec![length; count]).collect();
    let mut found: Vec<usize> = report.edge_cycles.iter().map(|c| c.length).collect();
    found.sort_unstable();
    assert_eq!(found, lengths, "{name}: lengths of the edge cycles");
}

#[test]
fn spaces_check_agrees_with_the_reference() {
    for name in known_names() {
        compare(&reference(name), &catalogue::find(name).expect("named space"));
    }
}

/// Evaluates words, gives deviations of one from another and images of points, in the geometry of a space.
struct Words<'a> {
    space: &'a Space,
    /// Words as faces crossed from the last letter to the first, two by two.
    equal: Vec<[Vec<usize>; 2]>,
    /// Points, and what the reference's rule of reduction makes of them.
    reduced: Vec<[DVec4; 2]>,
}

impl Visitor for Words<'_> {
    type Output = f64;
    fn visit<G: Geometry>(self, geometry: G) -> f64 {
        let faces = &self.space.cells[0].faces;
        let word = |letters: &[usize]| {
            letters.iter().fold(Isometry::IDENTITY, |m, &face| geometry.compose(&m, &faces[face].pairing))
        };
        let equal = self.equal.iter().map(|[a, b]| {
            let (a, b) = (word(a), word(b));
            largest(a.linear - b.linear).max((a.shift - b.shift).abs().max_element()) / largest(a.linear).powi(2)
        });
        let domain = Domain::new(self.space);
        let reduced = self.reduced.iter().map(|[point, wanted]| {
            let axes = geometry.frame(*point);
            let frame = reduce_frame(geometry, &domain, Frame { cell: 0, point: *point, axes }).expect("it is reduced");
            (frame.point - *wanted).abs().max_element()
        });
        equal.chain(reduced).fold(0.0, f64::max)
    }
}

/// The letters of a word such as `b1^2 Phi3^-1` as faces; a face's pairing is the inverse of its generator for even
/// faces.
fn letters(entry: &Value, word: &str) -> Vec<usize> {
    let names = generator_names(entry);
    let letter = |token: &str| {
        let (name, power) = token.split_once('^').unwrap_or((token, "1"));
        let power: i32 = power.parse().expect("a power");
        let pair = names.iter().position(|n| *n == name).expect("a generator");
        vec![2 * pair + usize::from(power > 0); power.unsigned_abs() as usize]
    };
    word.split(' ').flat_map(letter).collect()
}

/// Relations, and the rules that bring points back into the cell, of the spaces that are not glued face to face.
#[test]
fn spaces_relations_and_reductions_are_those_of_the_reference() {
    let mut random = Random(77);
    for name in ["nil-heisenberg", "sol-golden", "sl2-genus2-tangent"] {
        let (entry, space) = (reference(name), catalogue::find(name).expect("named space"));
        let mut equal = Vec::new();
        for relation in entry.get("edge_relations").and_then(Value::as_array).into_iter().flatten() {
            let (left, right) = relation.as_str().expect("a relation").split_once(" = ").expect("two sides");
            equal.push([letters(&entry, left), letters(&entry, right)]);
        }
        if let Some(word) = entry["checks"].get("relation_word") {
            let word: Vec<usize> =
                word.as_array().expect("faces").iter().map(|f| f.as_u64().expect("a face") as usize).collect();
            let turns = number(&entry["checks"]["relation_is_fibre_turns"]) as usize;
            let one_way = vec![8; turns];
            // The reference leaves the sign to conventions.
            let deviation = |turns: Vec<usize>| {
                let words = Words { space: &space, equal: vec![[word.clone(), turns]], reduced: Vec::new() };
                visit(space.geometry, words)
            };
            let off = deviation(one_way).min(deviation(vec![9; turns]));
            assert!(off < 1e-10, "{name}: the relation is off by {off}");
            assert!(deviation(vec![]) > 1e-6, "{name}: the relation lifts to no turn at all");
        }
        let reduced = (0..200).map(|_| {
            let [x, y, z] = [0; 3].map(|_| random.within(-4.0, 4.0));
            let wanted = match name {
                "nil-heisenberg" => {
                    let (a, rest) = (x.floor(), z - x.floor() * y);
                    DVec3::new(x - a, y - y.floor(), rest - rest.floor())
                }
                "sol-golden" => {
                    let sigma = number(&entry["sigma"]);
                    let [b1, b2] = ["b1", "b2"].map(|b| DVec2::new(number(&entry[b][0]), number(&entry[b][1])));
                    let n = (z / sigma).floor();
                    let flat = DVec2::new(x * (-n * sigma).exp(), y * (n * sigma).exp());
                    let flat = flat - b1 * b1.dot(flat).floor() - b2 * b2.dot(flat).floor();
                    flat.extend(z - n * sigma)
                }
                // Along the fibre of the base point.
                _ => {
                    return [
                        DVec4::new(0.0, 0.0, 9.0 * z, 1.0),
                        DVec4::new(0.0, 0.0, 9.0 * z - TAU * (9.0 * z / TAU).round(), 1.0),
                    ];
                }
            };
            [DVec4::new(x, y, z, 1.0), wanted.extend(1.0)]
        });
        let reduced: Vec<[DVec4; 2]> = reduced.collect();
        let spoiled = reduced.iter().map(|[p, q]| [*p, *q + DVec4::Y * 1e-9]).collect();
        let off = visit(space.geometry, Words { space: &space, equal: equal.clone(), reduced });
        assert!(off < 1e-11, "{name}: off by {off}");
        assert!(visit(space.geometry, Words { space: &space, equal, reduced: spoiled }) > 5e-10, "{name}");
    }
}

/// Gluings that are not face to face are refused where their parts do not fit.
#[test]
fn spaces_damaged_bundles_are_caught() {
    for name in ["nil-heisenberg", "sol-golden", "sl2-genus2-tangent"] {
        let faces = catalogue::find(name).expect("space").cells[0].faces.len();
        for face in 0..faces {
            let moved = damaged(name, |f| f[face].plane.w += 1e-5);
            assert_names(&moved, "face ");
            let shifted = damaged(name, |f| match name {
                "sl2-genus2-tangent" => f[face].pairing.shift.z += 1e-5,
                _ => f[face].pairing.linear.w_axis.z += 1e-5,
            });
            assert_names(&shifted, "face ");
        }
    }
    // With two turns of the fibre in a cell the relation makes one round of it, and with three none that closes.
    let several = |turns: f64| {
        let mut space = catalogue::find("sl2-genus2-tangent").expect("space");
        for (face, sign) in [(8, 1.0), (9, -1.0)] {
            space.cells[0].faces[face].plane.w = -turns * PI;
            space.cells[0].faces[face].pairing.shift.z = -sign * turns * TAU;
        }
        check(&space)
    };
    let two = several(2.0).expect("it closes");
    assert_eq!(two.homology, [0; 4]);
    assert!((two.volume / (16.0 * PI * PI) - 1.0).abs() < 1e-12);
    assert_names(&several(3.0).expect_err("the relation does not close"), "face");
}

#[test]
fn spaces_check_agrees_on_every_reference_gluing() {
    for entry in classical() {
        compare(&entry, &reference_space(&entry));
    }
}

#[test]
fn spaces_report_has_the_documented_keys() {
    let report = check(&catalogue::find("torus").expect("torus")).expect("closes");
    let text = serde_json::to_string(&report).expect("JSON");
    let wanted = r#"{"geometry":"e3","faces":6,"pairing_residual":0.0,"edge_cycles":[{"length":4,"angle":6.283185307179586,"residual":0.0},"#;
    assert!(text.starts_with(wanted), "{text}");
    assert!(text.contains(r#""volume":1.0"#) || text.contains(r#""volume":0.99999"#), "{text}");
    assert!(text.contains(r#""homology":[0,0,0],"kind":"manifold""#), "{text}");
}

/// A copy of a named space with something changed.
fn damaged(name: &str, damage: impl FnOnce(&mut Vec<Face>)) -> CheckError {
    let mut space = catalogue::find(name).expect("named space");
    damage(&mut space.cells[0].faces);
    check(&space).expect_err("the damage must be seen")
}

fn assert_names(error: &CheckError, words: &str) {
    let text = error.to_string();
    assert!(text.contains(words) && !text.contains('\n'), "{text:?} should name {words:?}");
}

/// Opposite faces paired with another turn about the direction of travel.
fn turned(faces: &mut [Face], extra: f64) {
    let normals: Vec<DVec3> = faces.iter().map(|f| f.plane.xyz().normalize()).collect();
    for (face, normal) in faces.iter_mut().zip(normals) {
        let turn = DMat4::from_axis_angle(-normal, extra);
        face.pairing = Isometry::linear(face.pairing.linear * turn);
    }
}

#[test]
fn spaces_damaged_entry_is_caught() {
    for name in classical_names() {
        let faces = catalogue::find(name).expect("space").cells[0].faces.len();
        for face in 0..faces {
            for entry in 0..16 {
                let error = damaged(name, |f| f[face].pairing.linear.col_mut(entry / 4)[entry % 4] += 1e-6);
                assert_names(&error, &format!("face {face} of cell 0"));
            }
            let plane = catalogue::find(name).expect("space").cells[0].faces[face].plane;
            // Another scale of the same plane is no damage.
            for entry in (0..4).filter(|&entry| DVec4::AXES[entry] * plane[entry] != plane) {
                let error = damaged(name, |f| f[face].plane[entry] += 1e-6);
                assert_names(&error, "face ");
            }
        }
    }
}

#[test]
fn spaces_wrong_turn_is_caught() {
    // The book prints 3π/10 for 3π/5: no pentagon lands on a pentagon.
    let printed = damaged("seifert-weber", |f| turned(f, -0.3 * PI));
    assert!(matches!(printed, CheckError::NotOnto { .. }), "{printed}");
    assert_names(&printed, "face 0 of cell 0");
    // Turns that take pentagons to pentagons, and leave the wrong angle round the edges.
    for extra in [-0.4 * PI, 0.4 * PI] {
        let error = damaged("seifert-weber", |f| turned(f, extra));
        assert!(matches!(error, CheckError::Angle { .. }), "{error}");
        assert_names(&error, "edge between faces 0 and 1 of cell 0");
    }
    let error = damaged("poincare", |f| turned(f, 0.4 * PI));
    assert!(matches!(error, CheckError::Angle { .. }), "{error}");
    let error = damaged("poincare", |f| turned(f, 0.2 * PI));
    assert!(matches!(error, CheckError::NotOnto { .. }), "{error}");
    // A turn of one pair only.
    let error = damaged("torus", |f| turned(&mut f[..2], 0.3));
    assert!(matches!(error, CheckError::NotOnto { .. }), "{error}");
}

#[test]
fn spaces_wrong_partner_is_caught() {
    for name in classical_names() {
        let faces = catalogue::find(name).expect("space").cells[0].faces.len();
        let wrong = damaged(name, |f| f[0].partner.face = (f[0].partner.face + 2) % faces);
        assert_names(&wrong, "face 0 of cell 0");
        let nowhere = damaged(name, |f| f[1].partner.face = faces);
        assert_names(&nowhere, "does not exist");
        let cells = catalogue::find(name).expect("space").cells.len();
        let no_cell = damaged(name, |f| f[1].partner.cell = cells);
        assert_names(&no_cell, "does not exist");
        let swapped = damaged(name, |f| f.swap(0, 2));
        assert_names(&swapped, "of cell 0");
        let pairings_swapped = damaged(name, |f| (f[0].pairing, f[2].pairing) = (f[2].pairing, f[0].pairing));
        assert_names(&pairings_swapped, "face 0 of cell 0");
        let planes_swapped = damaged(name, |f| (f[0].plane, f[2].plane) = (f[2].plane, f[0].plane));
        assert_names(&planes_swapped, "face 0 of cell 0");
    }
}

#[test]
fn spaces_cell_on_the_wrong_side_is_caught() {
    // The identity takes a face onto itself, and the cell onto itself.
    let error = damaged("mirrored-cube", |f| f[3].pairing = Isometry::IDENTITY);
    assert!(matches!(error, CheckError::WrongSide { .. }), "{error}");
    assert_names(&error, "face 3 of cell 0");
}

#[test]
fn spaces_missing_and_doubled_faces_are_caught() {
    for name in classical_names() {
        let missing = damaged(name, |f| f.truncate(f.len() - 1));
        assert_names(&missing, "face ");
        let doubled = damaged(name, |f| f.push(f[0].clone()));
        assert_names(&doubled, "face ");
    }
    let mut space = catalogue::find("torus").expect("torus");
    space.cells.push(space.cells[0].clone());
    for face in &mut space.cells[1].faces {
        face.partner.cell = 1;
    }
    assert_names(&check(&space).expect_err("two tori"), "cell 1 is not connected");
    space.cells.clear();
    assert_names(&check(&space).expect_err("nothing"), "no cells");
}

#[test]
fn spaces_corners_at_infinity_are_caught() {
    let error = damaged("seifert-weber", |f| f.iter_mut().for_each(|f| f.plane.w *= 1.05));
    assert!(matches!(error, CheckError::AtInfinity { .. }), "{error}");
    assert_names(&error, "of cell 0");
}

/// A copy of a named space whose pairings through two opposite faces shift by more than the faces' distance.
fn sheared(name: &str, shifts: &[(usize, DVec3)]) -> Result<Report, CheckError> {
    let mut space = catalogue::find(name).expect("named space");
    for &(face, shift) in shifts {
        let faces = &mut space.cells[0].faces;
        let moved = DMat4::from_translation(shift) * faces[face].pairing.linear;
        faces[face].pairing = Isometry::linear(moved);
        faces[face ^ 1].pairing = Isometry::linear(moved.inverse());
    }
    check(&space)
}

/// Faces that land on parts of several others are split, with corners of parts in the middle of edges.
#[test]
fn spaces_sheared_gluings_are_split() {
    let bricks = sheared("torus", &[(0, DVec3::new(0.0, 0.3, 0.0))]).expect("a wall of bricks");
    assert_eq!((bricks.homology.as_slice(), bricks.kind), (&[0, 0, 0][..], Kind::Manifold));
    let slanted = sheared("torus", &[(0, DVec3::new(0.0, 0.3, 0.7)), (2, DVec3::new(0.0, 0.0, 0.25))]);
    assert_eq!(slanted.expect("a slanted lattice").homology, [0, 0, 0]);
    // The commutator of the first two generators is still the third.
    let nil = sheared("nil-heisenberg", &[(2, DVec3::new(0.0, 0.0, 0.5))]).expect("another lattice of Nil");
    assert_eq!((nil.homology.as_slice(), nil.kind, nil.faces), (&[0, 0][..], Kind::Manifold, 6));
    for report in [&bricks, &nil] {
        assert!(report.edge_cycles.iter().all(|c| c.residual < 1e-12), "{report:?}");
        assert!(report.euler_characteristic == 0 && (report.volume - 1.0).abs() < 1e-13);
    }
}

/// Shears in two directions, whose cells overlap.
#[test]
fn spaces_shears_that_overlap_are_caught() {
    let shears = [(0, DVec3::new(0.0, 0.3, 0.0)), (2, DVec3::new(0.3, 0.0, 0.0))];
    assert!(sheared("torus", &shears).is_err(), "a lattice of volume 0.91 has no cell of volume 1");
}
