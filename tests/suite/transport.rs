//! Geodesics through the faces against the unfolded geodesic, reduced into the domain in 192 bits.
//!
//! How far the two may be apart is the space's own error growth: a rounding of the start moves the end of a geodesic
//! of length T by as much times T in E3 (directions diverge linearly), by no more in S3 (they come together again),
//! and times e^T in H3. Rounding happens at every face, so the linear spaces get a factor for the number of faces;
//! in H3 the first faces dominate, because later errors have less length to grow.

use crate::{
    big::{Big, Big4, Classical, Model, distance},
    spaces::classical_names,
    support::{self, Random},
};
use holonomy::{
    geometry::{Geodesic, Geometry, Visitor, visit},
    space::{
        Space, catalogue,
        domain::Domain,
        walk::{Path, Status, stage_segment, stage_transport},
    },
};
use serde_json::{Value, json};

/// Roundings by which an end may differ beyond the growth.
const ROUNDINGS: f64 = 100.0;

/// The spaces whose unfolded geodesics have a closed form.
fn names() -> Vec<&'static str> {
    [classical_names(), vec!["s3"]].concat()
}

#[derive(Clone, Debug)]
struct Case {
    from: [f64; 4],
    direction: [f64; 4],
    length: f64,
    faces: usize,
}

fn curvature(space: &Space) -> Classical {
    let sign = match space.geometry.name() {
        "e3" => 0,
        "s3" => 1,
        "h3" => -1,
        other => panic!("{other} has no closed reference here"),
    };
    Classical(sign)
}

/// Starts near the centre of the domain, with lengths that end half a crossing behind 1, 5 and 20 faces.
fn cases(space: &Space) -> Vec<Case> {
    struct Cases<'a>(&'a Space);
    impl Visitor for Cases<'_> {
        type Output = Vec<Case>;
        fn visit<G: Geometry>(self, geometry: G) -> Vec<Case> {
            let domain = Domain::new(self.0);
            let centre = holonomy::space::polyhedron::Polyhedron::new(&self.0.cells[0]).expect("a polyhedron").centroid;
            let mut random = Random(1893);
            let mut cases = Vec::new();
            for faces in [1_u32, 5, 20] {
                for _ in 0..50 {
                    let offset = glam::DVec3::from_array(std::array::from_fn(|_| random.within(-0.1, 0.1)));
                    let point = geometry.unchart(centre + offset).expect("in the chart");
                    let [x, y, z] = geometry.frame(point);
                    let v = x * random.within(-1.0, 1.0) + y * random.within(-1.0, 1.0) + z * random.within(-1.0, 1.0);
                    let velocity = v / geometry.norm(point, v);
                    let mut path = Path::new(Geodesic { point, velocity }, 0, f64::INFINITY);
                    let mut lengths = Vec::new();
                    while path.status == Status::Flying {
                        let mut crossed = |_| ();
                        if stage_segment(geometry, &domain, &mut path, faces, 1.0, &mut crossed).is_some() {
                            stage_transport(geometry, &domain, &mut path, faces, &mut crossed);
                            lengths.push(path.travelled);
                        }
                    }
                    let [.., before, after] = lengths[..] else { continue };
                    cases.push(Case {
                        from: point.to_array(),
                        direction: velocity.to_array(),
                        length: 0.5 * (before + after),
                        faces: faces as usize,
                    });
                }
            }
            cases
        }
    }
    visit(space.geometry, Cases(space))
}

fn run_batch(name: &str, n: usize, cases: &[Case]) -> Vec<Value> {
    let line = |c: &Case| json!({ "from": c.from[..n], "direction": c.direction[..n], "length": c.length });
    support::run_batch(&["transport", name], &cases.iter().map(line).collect::<Vec<_>>())
}

/// The pairing matrices of each cell: of the reference data, to 40 digits, or of a space whose own are exact.
fn pairings(space: &Space) -> Vec<Vec<Vec<Big4>>> {
    let data: Value = serde_json::from_str(include_str!("../data/spaces.json")).expect("reference data");
    let spaces = data["manifolds"].as_array().expect("a list");
    let Some(space) = spaces.iter().find(|s| s["name"] == space.name) else {
        let exact = |face: &holonomy::space::Face| -> Vec<Big4> {
            let rows = (0..4).map(|i| face.pairing.linear.row(i).to_array());
            rows.map(|row| row.map(|x| if x == x.trunc() { Big::new(x) } else { panic!("{x} is not exact") })).collect()
        };
        return space.cells.iter().map(|cell| cell.faces.iter().map(exact).collect()).collect();
    };
    let number = |x: &Value| Big::parse(x.as_str().expect("a decimal number"));
    let row = |row: &Value| -> Big4 {
        let row = row.as_array().expect("a row");
        std::array::from_fn(|i| number(&row[i]))
    };
    let matrix = |face: &Value| face["matrix"].as_array().expect("rows").iter().map(row).collect();
    vec![space["faces"].as_array().expect("faces").iter().map(matrix).collect()]
}

fn apply(matrix: &[Big4], v: &Big4) -> Big4 {
    std::array::from_fn(|i| (0..4).map(|j| &matrix[i][j] * &v[j]).sum())
}

/// Largest error of the space's cases in units of what its growth allows.
fn worst(name: &str, spoil: f64) -> f64 {
    let space = catalogue::find(name).expect("a catalogue space");
    let geometry = curvature(&space);
    let matrices = pairings(&space);
    let cases = cases(&space);
    assert!(cases.len() >= 140);
    let n = space.geometry.components();
    let results = run_batch(name, n, &cases);
    assert_eq!(results.len(), cases.len());
    let mut worst = 0.0_f64;
    for (case, result) in cases.iter().zip(&results) {
        let faces: Vec<usize> =
            result["faces"].as_array().expect("faces").iter().map(|f| f.as_u64().expect("an index") as usize).collect();
        assert_eq!(faces.len(), case.faces, "{name}: {result}");
        let start = geometry.settle(case.from, case.direction);
        let mut end = geometry.flow(&start, &Big::new(case.length));
        let mut cell = 0;
        for face in &faces {
            end.point = apply(&matrices[cell][*face], &end.point);
            end.direction = apply(&matrices[cell][*face], &end.direction);
            cell = space.cells[cell].faces[*face].partner.cell;
        }
        assert_eq!(result["cell"], cell, "{name}: {result}");
        let growth = match geometry.0 {
            -1 => case.length.exp(),
            0 => (1.0 + case.length) * (1 + faces.len()) as f64,
            _ => (1 + faces.len()) as f64,
        };
        let allowed = ROUNDINGS * f64::EPSILON * growth;
        let numbers = |key: &str| -> Vec<f64> {
            let mut v: Vec<f64> = result[key].as_array().expect(key).iter().filter_map(Value::as_f64).collect();
            v[0] += spoil;
            // E3 does not print the last coordinate.
            if n == 3 {
                v.push(end.point[3].to_f64() * f64::from(u8::from(key == "point")));
            }
            v
        };
        worst = worst.max(distance(&end.point, &numbers("point")) / allowed);
        worst = worst.max(distance(&end.direction, &numbers("direction")) / allowed);
        // The reference itself must have come out inside the domain: the faces are the right ones.
        for face in &space.cells[cell].faces {
            let p = glam::DVec4::from_array(std::array::from_fn(|i| end.point[i].to_f64()));
            assert!(face.plane.dot(p) < 1e-9 + allowed, "{name}: the unfolded geodesic ends outside");
        }
    }
    worst
}

#[test]
fn transport_agrees_with_the_unfolded_geodesic() {
    for name in names() {
        let worst = worst(name, 0.0);
        println!("{name}: worst error is {worst:.3} of what the growth allows");
        assert!(worst < 1.0, "{name}: {worst}");
    }
}

#[test]
fn transport_spoiled_results_are_caught() {
    for name in names() {
        assert!(worst(name, 1e-9) > 1.0, "{name}: an error of 1e-9 after one face passed");
    }
}

/// A geodesic and its reverse.
#[test]
fn transport_comes_back() {
    // Starts are in one cell: this is for the spaces that have no other.
    for name in classical_names() {
        let space = catalogue::find(name).expect("a catalogue space");
        let n = space.geometry.components();
        let there: Vec<Case> = cases(&space).into_iter().filter(|c| c.faces == 5).collect();
        let ends = run_batch(name, n, &there);
        let back: Vec<Case> = ends
            .iter()
            .zip(&there)
            .map(|(end, case)| {
                let vector = |key: &str| {
                    let list = end[key].as_array().expect("numbers");
                    std::array::from_fn(|i| list.get(i).and_then(Value::as_f64).unwrap_or(0.0))
                };
                // A negative length walks against the direction, through the same faces.
                Case { from: vector("point"), direction: vector("direction"), length: -case.length, faces: 5 }
            })
            .collect();
        for (case, home) in there.iter().zip(run_batch(name, n, &back)) {
            let point: Vec<f64> = home["point"].as_array().expect("numbers").iter().filter_map(Value::as_f64).collect();
            let gap = point.iter().zip(case.from).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            let growth = if space.geometry.name() == "h3" { case.length.exp() } else { 10.0 };
            assert!(gap < 1e-13 * growth, "{name}: came back {gap:.1e} from the start");
        }
    }
}
