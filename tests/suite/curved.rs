//! Arcs, exits, nearest points and logarithms where geodesics are curves in the chart, against brute force; and the
//! series of Sol against its closed form and its order.

use crate::support::Random;
use glam::{DVec3, DVec4};
use holonomy::{
    geometry::{
        GEOMETRIES, Geodesic, Geometry, GeometryId, Segment, Visitor, exponential, sl2,
        sol::{self, elliptic},
        visit,
    },
    space::{
        catalogue,
        domain::Domain,
        reduce::{transport, violated_face},
    },
};

/// A random unit vector of R³.
fn unit(random: &mut Random) -> DVec3 {
    loop {
        let v = DVec3::from_array(std::array::from_fn(|_| random.within(-1.0, 1.0)));
        if (0.01..1.0).contains(&v.length_squared()) {
            return v.normalize();
        }
    }
}

/// A state at most `far` from the base point. Every fourth direction is along a frame's axis.
fn state<G: Geometry>(geometry: G, far: f64, random: &mut Random) -> Geodesic {
    let vector = |p: DVec4, c: DVec3| {
        let [x, y, z] = geometry.frame(p);
        x * c.x + y * c.y + z * c.z
    };
    let base = geometry.base();
    loop {
        let point = exponential(geometry, base, vector(base, unit(random)) * random.within(0.0, far));
        if point.is_finite() {
            let axis = random.next() < 0.25;
            let c = if axis { DVec3::AXES[(3.0 * random.next()) as usize] } else { unit(random) };
            return Geodesic { point, velocity: vector(point, c) };
        }
    }
}

/// Deviations of arcs in units of the tolerance, where the arc is shorter than asked for; `longer` stretches
/// the arcs to spoil them.
struct Arcs {
    longer: f64,
}

impl Visitor for Arcs {
    type Output = Vec<f64>;
    fn visit<G: Geometry>(self, geometry: G) -> Vec<f64> {
        let mut random = Random(8);
        let mut ratios = Vec::new();
        for number in 0..3000 {
            let g = state(geometry, 1.5, &mut random);
            let tolerance = [1e-3, 1e-4, 1e-5, 1e-6][number % 4];
            let whole = geometry.parameter_at(g, 0.8);
            if whole.is_infinite() {
                continue;
            }
            let arc = geometry.arc(g, whole, tolerance);
            assert!(arc > 0.0 && arc <= whole);
            // Only arcs that end because of the tolerance.
            if arc == whole || geometry.arc(g, whole, 0.5 * tolerance) == arc {
                continue;
            }
            let (segment, _) = Segment::along(geometry, g, (arc * self.longer).min(whole));
            let deviation = (1..32).map(|k| {
                let c = segment.at(f64::from(k) / 32.0);
                let nearest = geometry.advance(g, geometry.parameter(g, c)).point;
                geometry.distance(geometry.unchart(c).expect("in the chart"), nearest)
            });
            ratios.push(deviation.fold(0.0, f64::max) / tolerance);
        }
        ratios.sort_by(f64::total_cmp);
        ratios
    }
}

#[test]
fn curved_arcs_stay_within_the_tolerance_and_use_it() {
    for entry in GEOMETRIES {
        let ratios = visit(entry.id, Arcs { longer: 1.0 });
        let Some(most) = ratios.last() else { continue };
        let median = ratios[ratios.len() / 2];
        println!("{}: {} arcs, median {median:.3} and worst {most:.3} of the tolerance", entry.name, ratios.len());
        assert!(*most <= 1.0 + 1e-6, "{}: an arc is off by {most} tolerances", entry.name);
        // The deviation grows with the cube of the length: most arcs are more than half of the longest that would do.
        // (Where the third derivative is along the curve it does no harm, but the bound counts it.)
        let harmless = entry.name == "sl2-trace";
        assert!(median > 0.125 || harmless, "{}: arcs waste their tolerance: median {median}", entry.name);
        let spoiled = visit(entry.id, Arcs { longer: 2.0 });
        assert!(spoiled.last().is_some_and(|most| *most > 1.0), "{}: longer arcs pass", entry.name);
    }
}

/// Exits that differ from a search in small steps, worst difference; planes that the curve only just passes through
/// and comes back from are among them.
struct Exits {
    /// Added to every exit, to spoil it.
    late: f64,
}

impl Visitor for Exits {
    type Output = Vec<String>;
    fn visit<G: Geometry>(self, geometry: G) -> Vec<String> {
        let mut random = Random(9);
        let mut wrong = Vec::new();
        for number in 0..800 {
            // The gnomonic chart of the sphere ends at a quarter turn.
            let g = state(geometry, 0.6, &mut random);
            let far = 0.95;
            if geometry.edge(g, far).is_some() {
                continue;
            }
            let chart = |s: f64| geometry.chart(geometry.flow(g, s).point);
            let rate = |s: f64| (chart(s + 1e-5) - chart(s - 1e-5)) / 2e-5;
            let mut n = match number % 8 {
                0 => DVec3::X,
                1 => -DVec3::Y,
                2 => DVec3::Z,
                3 => unit(&mut random).with_z(0.0).normalize(),
                _ => unit(&mut random),
            };
            let touch = random.within(0.1, 0.8);
            let mut offset = random.within(0.0, 0.3);
            let grazing = number % 2 == 1;
            if grazing {
                // Tangent to the curve, which passes it by a millionth or less and returns.
                n = (n - rate(touch) * (n.dot(rate(touch)) / rate(touch).length_squared())).normalize();
                let bend = n.dot(chart(touch + 1e-3) + chart(touch - 1e-3) - 2.0 * chart(touch));
                if bend.abs() < 1e-7 {
                    continue;
                }
                n *= -bend.signum();
                offset = n.dot(chart(touch) - chart(0.0)) - 10.0_f64.powf(-random.within(6.0, 9.0));
            }
            let plane = n.extend(-n.dot(chart(0.0)) - offset);
            let form = |s: f64| n.dot(chart(s)) + plane.w;
            if form(0.0) > -1e-9 || n.length() < 0.5 {
                continue;
            }
            // The first change of sign, seen in small steps: finer still about the touching point.
            let coarse = (0..=2000).map(|k| far * f64::from(k) / 2000.0);
            let fine = (-2000..=2000).map(|k| touch + 2e-6 * f64::from(k));
            let mut steps: Vec<f64> = coarse.chain(fine.filter(|_| grazing)).collect();
            steps.sort_by(f64::total_cmp);
            let first = steps.windows(2).find(|s| form(s[0]) < 0.0 && form(s[1]) >= 0.0).map(|s| [s[0], s[1]]);
            let exit = geometry.exit(g, plane, f64::INFINITY);
            let exit = if exit.is_finite() { geometry.length(g, exit) + self.late } else { exit };
            let right = match first {
                Some([low, high]) => exit >= low - 1e-9 && exit <= high + 1e-9 && form(exit).abs() < 1e-12,
                None => exit > far,
            };
            if !right {
                wrong.push(format!("{g:?} {plane:?}: {exit} instead of {first:?}"));
            }
        }
        wrong
    }
}

#[test]
fn curved_exits_are_the_first_passages() {
    for entry in GEOMETRIES {
        let wrong = visit(entry.id, Exits { late: 0.0 });
        assert!(wrong.is_empty(), "{}: {} wrong exits, such as {}", entry.name, wrong.len(), wrong[0]);
        assert!(visit(entry.id, Exits { late: 1e-10 }).len() > 40, "{}: late exits pass", entry.name);
    }
}

/// How far `exp(log)` misses, and how much longer than a known geodesic the logarithm is; for distances up to `far`.
struct Logarithms {
    far: f64,
}

impl Visitor for Logarithms {
    type Output = [f64; 2];
    fn visit<G: Geometry>(self, geometry: G) -> [f64; 2] {
        let mut random = Random(10);
        let mut worst = [0.0_f64; 2];
        for _ in 0..2000 {
            let g = state(geometry, 1.5, &mut random);
            let t = random.within(0.0, self.far);
            if geometry.edge(g, t).is_some() {
                continue;
            }
            let q = geometry.flow(g, t).point;
            let (velocity, length) = geometry.log(g.point, q);
            let end = geometry.flow(Geodesic { point: g.point, velocity }, length).point;
            worst[0] = worst[0].max((end - q).abs().max_element() / (1.0 + q.abs().max_element()));
            worst[1] = worst[1].max(length - t);
        }
        worst
    }
}

#[test]
fn curved_logarithms_reach_their_points() {
    for (name, far) in [("sol", 4.0), ("sl2", 8.0), ("sl2-trace", 3.0)] {
        let id = GeometryId::from_name(name).expect("registered");
        let [miss, longer] = visit(id, Logarithms { far });
        println!("{name}: up to {far} log misses by {miss:.1e} and is longer by {longer:.1e}");
        assert!(miss < 1e-9, "{name}: log misses by {miss}");
        assert!(longer < 1e-9, "{name}: log is longer by {longer}");
    }
    // Beyond its cut locus Sol has other geodesics to a point, but the one that is found gets there.
    let [miss, longer] = visit(GeometryId::from_name("sol").expect("registered"), Logarithms { far: 7.0 });
    println!("sol: up to 7 log misses by {miss:.1e} and is longer by {longer:.1e}");
    assert!(longer < 1.0, "log is longer by {longer}");
}

#[test]
fn curved_logarithms_are_numbers_everywhere() {
    struct Far;
    impl Visitor for Far {
        type Output = ();
        fn visit<G: Geometry>(self, geometry: G) {
            let mut random = Random(11);
            for number in 0..2000 {
                let size = [1.0, 10.0, 1e3, 1e6][number % 4];
                let mut point = || {
                    let c = unit(&mut random) * size;
                    geometry.settle(c.with_z(c.z.clamp(-30.0, 30.0)).extend(1.0))
                };
                let (Some(p), Some(q)) = (point(), point()) else { continue };
                let (velocity, length) = geometry.log(p, q);
                assert!(velocity.is_finite() && !length.is_nan(), "{p} {q}: {velocity} {length}");
                let same = geometry.log(p, p);
                assert!(same.0.is_finite() && same.1 < 1e-6 * size, "{p}: {same:?}");
            }
        }
    }
    for name in ["sol", "sl2", "sl2-trace"] {
        visit(GeometryId::from_name(name).expect("registered"), Far);
    }
}

/// Error of `count` steps against steps that are exact to rounding.
fn sol_error<const N: usize>(velocity: DVec3, t: f64, count: usize) -> f64 {
    let exact = sol::endpoint_with::<{ sol::ORDER + 1 }>(velocity, t, 64);
    (sol::endpoint_with::<N>(velocity, t, count) - exact).length()
}

/// The measured order of the series with `N` terms, `N − 1`: w has an error of order `N` in each step.
fn sol_order<const N: usize>() -> f64 {
    let v = DVec3::new(0.5, 0.3, 0.8).normalize();
    let [coarse, fine] = [32, 64].map(|count| sol_error::<N>(v, 4.0, count));
    (coarse / fine).log2()
}

#[test]
fn curved_sol_series_has_its_order() {
    for (expected, measured) in [(3.0, sol_order::<4>()), (5.0, sol_order::<6>()), (7.0, sol_order::<8>())] {
        println!("series of order {expected}: measured {measured:.2}");
        assert!((measured - expected).abs() < 0.5, "order {measured} instead of {expected}");
    }
    // The step of the flow, and half of it: nothing is left to gain.
    let v = DVec3::new(0.5, 0.3, 0.8).normalize();
    let rest = sol_error::<{ sol::ORDER + 1 }>(v, 8.0, 32);
    assert!(rest < 1e-13, "the flow's own steps leave {rest}");
}

#[test]
fn curved_sol_agrees_with_the_elliptic_form() {
    let mut random = Random(12);
    let mut worst = 0.0_f64;
    for _ in 0..500 {
        let v = unit(&mut random);
        // Away from where the closed form divides by little or its modulus degenerates.
        if v.x.abs() < 0.1 || v.y.abs() < 0.1 || v.z.abs() + (v.x.abs() - v.y.abs()).abs() < 0.1 {
            continue;
        }
        let t = random.within(0.0, 12.0);
        let flow = sol::Sol.flow(Geodesic { point: DVec4::W, velocity: v.extend(0.0) }, t).point.truncate();
        let closed = elliptic::endpoint(v, t);
        worst = worst.max((flow - closed).abs().max_element() / (1.0 + flow.abs().max_element()));
        // And z comes back after the period of the closed form.
        let round = sol::Sol.flow(Geodesic { point: DVec4::W, velocity: v.extend(0.0) }, elliptic::period(v)).point;
        worst = worst.max(round.z.abs());
    }
    println!("series against elliptic functions: {worst:.1e}");
    assert!(worst < 1e-12, "{worst}");
}

/// Geodesics walked through the faces, and unfolded and brought back by any faces that are violated: both end in the
/// same place, up to the growth of rounding. `spoil` changes an end.
fn worst_walk<G: Geometry>(geometry: G, domain: &Domain, length: f64, spoil: f64) -> [f64; 2] {
    let mut random = Random(13);
    let mut worst = 0.0_f64;
    let mut passed = 0;
    for _ in 0..300 {
        let velocity = unit(&mut random).extend(0.0);
        let inside = DVec3::new(random.within(0.05, 0.3), random.within(0.2, 0.4), random.within(0.1, 0.8));
        let start = Geodesic { point: geometry.unchart(inside).expect("in the chart"), velocity };
        let arrival = transport(geometry, domain, start, 0, length).expect("it is not lost");
        passed += arrival.faces.len();
        let mut unfolded = geometry.flow(start, length);
        for _ in 0..100_000 {
            let Some(face) = violated_face(geometry, domain, 0, unfolded.point) else { break };
            unfolded = geometry.restore(geometry.apply(&domain.faces[face].pairing, unfolded));
        }
        // Ends on a face are in two places.
        let near_face = domain.faces.iter().any(|face| geometry.side(unfolded.point, face.plane).abs() < 1e-6);
        if !near_face {
            let off = (arrival.state.point - unfolded.point).length() + spoil;
            worst = worst.max(off).max((arrival.state.velocity - unfolded.velocity).length());
        }
    }
    [worst, passed as f64 / 300.0]
}

#[test]
fn curved_walks_agree_with_the_unfolded_geodesics() {
    let domain = |name| Domain::new(&catalogue::find(name).expect("a named space"));
    for spoil in [0.0, 1e-7] {
        let [walked, faces] = worst_walk(sol::Sol, &domain("sol-golden"), 6.0, spoil);
        println!("golden torus bundle: {faces:.1} faces, ends differ by {walked:.1e}");
        assert!(faces > 5.0 && (walked < 1e-8) == (spoil == 0.0), "{walked}");
        let [walked, faces] = worst_walk(sl2::Sl2, &domain("sl2-genus2-tangent"), 8.0, spoil);
        println!("unit tangents of genus 2: {faces:.1} faces, ends differ by {walked:.1e}");
        assert!(faces > 3.0 && (walked < 1e-8) == (spoil == 0.0), "{walked}");
    }
}
