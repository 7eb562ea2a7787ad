//! Geodesics through the faces against the unfolded geodesic, reduced into the domain in 192 bits.
//!
//! How far the two may be apart is the space's own error growth: a rounding of the start moves the end of a geodesic
//! of length T by as much times T in E3 (directions diverge linearly), by no more in S3 (they come together again),
//! and times e^T in H3. Rounding happens at every face, so the linear spaces get a factor for the number of faces;
//! in H3 the first faces dominate, because later errors have less length to grow. Products with a line behave like
//! their surface and the line together, where a hyperbolic cell with large pairings repeats the rounding of their
//! entries at every face; in Nil an error in the plane is multiplied by the plane's extent in the fibre. Sol and the
//! universal cover of SL(2, R) part geodesics like hyperbolic planes do.

use crate::support::{self, Random};
use holonomy::{
    geometry::{Geodesic, Geometry, Visitor, visit},
    measure::reference::{Big, Big4, BigGeodesic, Classical, Model, Nil, Product, SL2, SOL, distance, sl2_product},
    space::{
        Space, catalogue,
        domain::Domain,
        walk::{Follow, Path, Status, stage_segment, stage_transport},
    },
};
use serde_json::{Value, json};

/// Roundings by which an end may differ beyond the growth.
const ROUNDINGS: f64 = 100.0;

#[derive(Clone, Debug)]
struct Case {
    cell: usize,
    from: [f64; 4],
    direction: [f64; 4],
    length: f64,
    faces: usize,
}

/// The reference of a space's geometry.
fn model(space: &Space) -> &'static dyn Model {
    match space.geometry.name() {
        "e3" => &Classical(0),
        "s3" => &Classical(1),
        "h3" => &Classical(-1),
        "s2xr" => &Product(1),
        "h2xr" => &Product(-1),
        "nil" => &Nil,
        "sol" => SOL,
        "sl2" => SL2,
        other => panic!("{other} has no reference here"),
    }
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
                    // Lengths at the ends of segments, and the faces passed before each.
                    let mut ends = Vec::new();
                    let none = |_| ();
                    while path.status == Status::Flying {
                        if stage_segment(geometry, &domain, &mut path, faces, Follow::EXACTLY, none).is_some() {
                            let passed = path.bounces;
                            stage_transport(geometry, &domain, &mut path, faces, none);
                            ends.push((path.travelled, passed as usize));
                        }
                    }
                    let [.., (before, _), (after, faces)] = ends[..] else { continue };
                    cases.push(Case {
                        cell: 0,
                        from: point.to_array(),
                        direction: velocity.to_array(),
                        length: 0.5 * (before + after),
                        faces,
                    });
                }
            }
            cases
        }
    }
    visit(space.geometry, Cases(space))
}

/// Runs the cases, batch by batch of equal cells.
fn run_batch(name: &str, [n, m]: [usize; 2], cases: &[Case]) -> Vec<Value> {
    let line = |c: &Case| json!({ "from": c.from[..n], "direction": c.direction[..m], "length": c.length });
    let mut results = vec![Value::Null; cases.len()];
    let cells: std::collections::BTreeSet<usize> = cases.iter().map(|c| c.cell).collect();
    for cell in cells {
        let indices: Vec<usize> = (0..cases.len()).filter(|&i| cases[i].cell == cell).collect();
        let lines: Vec<Value> = indices.iter().map(|&i| line(&cases[i])).collect();
        let found = support::run_batch(&["transport", name, "--cell", &cell.to_string()], &lines);
        assert_eq!(found.len(), lines.len());
        indices.into_iter().zip(found).for_each(|(i, result)| results[i] = result);
    }
    results
}

/// A pairing.
enum BigIsometry {
    /// Rows of the linear part, and the shift.
    Matrix { rows: Box<[Big4; 4]>, shift: Big4 },
    /// Left multiplication in the universal cover of SL(2, R).
    Left(Big4),
}

impl BigIsometry {
    fn matrix(rows: [Big4; 4], shift: Big4) -> Self {
        Self::Matrix { rows: Box::new(rows), shift }
    }

    /// Directions of groups are left alone by left multiplications; all others are moved by the linear part.
    fn apply(&self, model: &dyn Model, g: &BigGeodesic) -> BigGeodesic {
        let (rows, shift) = match self {
            Self::Matrix { rows, shift } => (rows, shift),
            Self::Left(by) => {
                return BigGeodesic { point: sl2_product(by, &g.point), direction: g.direction.clone() };
            }
        };
        let moved = |v: &Big4| -> Big4 { std::array::from_fn(|i| (0..4).map(|j| &rows[i][j] * &v[j]).sum()) };
        // Where three numbers are a point the fourth is 1.
        let mut start = g.point.clone();
        if model.components()[0] == 3 {
            start[3] = Big::new(1.0);
        }
        let point = moved(&start);
        let stays = ["nil", "sol"].contains(&model.name());
        let direction = if stays { g.direction.clone() } else { moved(&g.direction) };
        BigGeodesic { point: std::array::from_fn(|i| &point[i] + &shift[i]), direction }
    }
}

/// The pairings to 40 digits from the reference data; those of the space itself where all entries are integers.
fn pairings(space: &Space) -> Vec<BigIsometry> {
    let exact = |m: &holonomy::geometry::Isometry| {
        let rows = std::array::from_fn(|i| m.linear.row(i).to_array().map(Big::new));
        BigIsometry::matrix(rows, m.shift.to_array().map(Big::new))
    };
    let whole = space.faces().all(|(_, f)| f.pairing.linear.to_cols_array().iter().all(|x| x.fract() == 0.0));
    if whole {
        return space.faces().map(|(_, face)| exact(&face.pairing)).collect();
    }
    let data: Value = serde_json::from_str(include_str!("../data/spaces.json")).expect("reference data");
    let spaces = data["manifolds"].as_array().expect("a list");
    let entry = spaces.iter().find(|s| s["name"] == *space.name).expect("the space is in the reference data");
    let number = |x: &Value| Big::parse(x.as_str().expect("a decimal number"));
    let zero = || Big::new(0.0);
    if space.geometry.name() == "sol" {
        // Left multiplications by one generator for each pair of faces, and their inverses.
        let translation = |[x, y, z]: [Big; 3]| {
            let (sinh, cosh) = z.sinh_cosh();
            let one = || Big::new(1.0);
            let rows = [
                [&cosh + &sinh, zero(), zero(), x],
                [zero(), &cosh - &sinh, zero(), y],
                [zero(), zero(), one(), z],
                [zero(), zero(), zero(), one()],
            ];
            BigIsometry::matrix(rows, [0; 4].map(|_| zero()))
        };
        let step = |name: &str| -> [Big; 3] { std::array::from_fn(|i| number(&entry["generators"][name][i])) };
        let both = |name| [step(name).map(|x| -&x), step(name)].map(translation);
        return ["b1", "b2", "Phi3"].into_iter().flat_map(both).collect();
    }
    let isometry = |face: &Value| match (face.get("matrix"), face.get("left_factor")) {
        (Some(m), _) => BigIsometry::matrix(
            std::array::from_fn(|i| std::array::from_fn(|j| number(&m[i][j]))),
            [0; 4].map(|_| zero()),
        ),
        (None, Some(by)) => BigIsometry::Left(std::array::from_fn(|i| number(&by[i]))),
        (None, None) if face.get("map").is_some() => {
            // A turn of the fibre, back for the first of the two faces.
            let turn = &Big::new(if face["face"] == 8 { -2.0 } else { 2.0 }) * &zero().atan2(&Big::new(-1.0));
            BigIsometry::Left([zero(), zero(), turn, Big::new(1.0)])
        }
        (None, None) => {
            let m = &face["matrix_xyw"];
            let row = |i: usize| [number(&m[i][0]), number(&m[i][1]), zero(), number(&m[i][2])];
            let line = [zero(), zero(), Big::new(1.0), zero()];
            let shift = [zero(), zero(), number(&face["z_shift"]), zero()];
            BigIsometry::matrix([row(0), row(1), line, row(2)], shift)
        }
    };
    entry["faces"].as_array().expect("faces").iter().map(isometry).collect()
}

/// How far outside of its cell a point lies.
struct Outside<'a> {
    space: &'a Space,
    cell: usize,
    point: glam::DVec4,
}

impl Visitor for Outside<'_> {
    type Output = f64;
    fn visit<G: Geometry>(self, geometry: G) -> f64 {
        let faces = &self.space.cells[self.cell].faces;
        faces.iter().map(|face| geometry.side(self.point, face.plane)).fold(f64::NEG_INFINITY, f64::max)
    }
}

/// Largest error of the space's cases in units of what its growth allows.
fn worst(name: &str, spoil: f64) -> f64 {
    let space = catalogue::find(name).expect("a catalogue space");
    let model = model(&space);
    let (pairings, domain) = (pairings(&space), Domain::new(&space));
    let largest =
        space.faces().flat_map(|(_, f)| f.pairing.linear.to_cols_array()).fold(1.0, |a: f64, x| a.max(x.abs()));
    let cases = cases(&space);
    // Where the last passage is one of two at once there is no case.
    let sheared = ["nil", "sol", "sl2"].contains(&model.name());
    assert!(cases.len() >= if sheared { 100 } else { 140 }, "{name}: {} cases", cases.len());
    let results = run_batch(name, model.components(), &cases);
    assert_eq!(results.len(), cases.len());
    let mut worst = 0.0_f64;
    for (case, result) in cases.iter().zip(&results) {
        let faces: Vec<usize> =
            result["faces"].as_array().expect("faces").iter().map(|f| f.as_u64().expect("an index") as usize).collect();
        assert_eq!(faces.len(), case.faces, "{name}: {result}");
        let mut end = model.flow(&model.settle(case.from, case.direction), &Big::new(case.length));
        let mut cell = 0;
        for face in &faces {
            let passed = domain.cells[cell].start + face;
            end = pairings[passed].apply(model, &end);
            cell = domain.faces[passed].cell;
        }
        assert_eq!(result["cell"], cell);
        let linear = (1.0 + case.length) * (1 + faces.len()) as f64;
        let growth = match model.name() {
            "h3" => case.length.exp(),
            "h2xr" | "sol" | "sl2" => largest * case.length.exp(),
            "s3" => (1 + faces.len()) as f64,
            "nil" => (1.0 + case.length) * linear,
            _ => linear,
        };
        let allowed = ROUNDINGS * f64::EPSILON * growth;
        let numbers = |key: &str| -> Vec<f64> {
            let mut v: Vec<f64> = result[key].as_array().expect(key).iter().filter_map(Value::as_f64).collect();
            v[0] += spoil;
            // Where three numbers are shown the fourth says point or vector.
            if v.len() == 3 {
                v.push(end.point[3].to_f64() * f64::from(u8::from(key == "point")));
            }
            v
        };
        worst = worst.max(distance(&end.point, &numbers("point")) / allowed);
        worst = worst.max(distance(&end.direction, &numbers("direction")) / allowed);
        // The reference itself must have come out inside the domain: the faces are the right ones.
        let point = glam::DVec4::from_array(std::array::from_fn(|i| end.point[i].to_f64()));
        let outside = visit(space.geometry, Outside { space: &space, cell, point });
        assert!(outside < 1e-9 + allowed, "{name}: the unfolded geodesic ends outside");
    }
    worst
}

#[test]
fn transport_agrees_with_the_unfolded_geodesic() {
    for name in catalogue::NAMES {
        let worst = worst(name, 0.0);
        println!("{name}: worst error is {worst:.3} of what the growth allows");
        assert!(worst < 1.0, "{name}: {worst}");
    }
}

#[test]
fn transport_spoiled_results_are_caught() {
    for name in catalogue::NAMES {
        assert!(worst(name, 1e-9) > 1.0, "{name}: an error of 1e-9 after one face passed");
    }
}

/// A geodesic and its reverse.
#[test]
fn transport_comes_back() {
    for name in catalogue::NAMES {
        let space = catalogue::find(name).expect("a catalogue space");
        let n = model(&space).components();
        let there: Vec<Case> = cases(&space).into_iter().filter(|c| (5..10).contains(&c.faces)).collect();
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
                let cell = end["cell"].as_u64().expect("an index") as usize;
                Case {
                    cell,
                    from: vector("point"),
                    direction: vector("direction"),
                    length: -case.length,
                    faces: case.faces,
                }
            })
            .collect();
        for (case, home) in there.iter().zip(run_batch(name, n, &back)) {
            let point: Vec<f64> = home["point"].as_array().expect("numbers").iter().filter_map(Value::as_f64).collect();
            let gap = point.iter().zip(case.from).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            // Hyperbolic in a factor at least.
            let hyperbolic = ["h3", "h2xr", "sol", "sl2"].contains(&space.geometry.name());
            let growth = if hyperbolic { case.length.exp() } else { 10.0 };
            assert!(gap < 1e-13 * growth, "{name}: came back {gap:.1e} from the start");
        }
    }
}
