//! Arcs, exits, logarithms and area densities, each against walks along the flow.
//!
//! The samples of the laws are short and near the base point; here geodesics are as long and as far away as paths
//! through a cell make them. Where no exit or logarithm is promised that far, `curved` has tests within what is.

use crate::support::Random;
use glam::{DVec3, DVec4};
use holonomy::geometry::{Entry, GEOMETRIES, Geodesic, Geometry, Segment, Visitor, across, exponential, visit};

/// The geometries whose exits and logarithms hold for ways of any length.
fn far_reaching() -> impl Iterator<Item = &'static Entry> {
    GEOMETRIES.iter().filter(|entry| !["sol", "sl2", "sl2-trace"].contains(&entry.name))
}

/// A state within the distance of the base point, sometimes along an axis of the frame or nearly so.
fn state<G: Geometry>(geometry: G, random: &mut Random, distance: f64) -> Geodesic {
    let mut unit = |p: DVec4| {
        let [x, y, z] = geometry.frame(p);
        let kind = random.next();
        let mut axis = [0; 3].map(|_| random.within(-1.0, 1.0));
        if kind < 0.4 {
            let along = (kind * 7.5) as usize;
            let rest = if kind < 0.2 { 1e-3 } else { 0.0 };
            axis = std::array::from_fn(|i| if i == along { axis[i].signum() } else { axis[i] * rest });
        }
        let v = x * axis[0] + y * axis[1] + z * axis[2];
        v / geometry.norm(p, v)
    };
    let base = geometry.base();
    let out = unit(base);
    let point = exponential(geometry, base, out * distance);
    Geodesic { point, velocity: unit(point) }
}

/// Whether the chart shows the point.
fn is_shown<G: Geometry>(geometry: G, p: DVec4) -> bool {
    let back = geometry.unchart(geometry.chart(p));
    back.is_some_and(|q| (q - p).abs().max_element() < 1e-6 * (1.0 + p.abs().max_element()))
}

/// Largest distance of a segment's points from the curve.
fn deviation<G: Geometry>(geometry: G, g: Geodesic, u: f64) -> f64 {
    let (segment, _) = Segment::along(geometry, g, u);
    let off = |k: u32| {
        let c = segment.at(f64::from(k) / 32.0);
        let p = geometry.unchart(c).expect("a segment lies in the chart");
        geometry.distance(p, geometry.advance(g, geometry.parameter(g, c)).point)
    };
    (1..32).map(off).fold(0.0, f64::max)
}

/// For a geometry the worst ratio of deviation to tolerance, and the median over the arcs that end early.
struct Ratios {
    stretch: f64,
}

impl Visitor for Ratios {
    type Output = (f64, Option<f64>);
    fn visit<G: Geometry>(self, geometry: G) -> Self::Output {
        let mut random = Random(1954);
        let (mut worst, mut early) = (0.0_f64, Vec::new());
        for number in 0..4000 {
            let distance = random.within(0.0, 1.0);
            let g = state(geometry, &mut random, distance);
            let u_max = geometry.parameter_at(g, 0.5);
            let tolerance = [1e-3, 1e-4, 1e-5, 1e-6][number % 4];
            let arc = geometry.arc(g, u_max, tolerance);
            assert!(arc > 0.0 && arc <= u_max);
            let ratio = deviation(geometry, g, (self.stretch * arc).min(u_max)) / tolerance;
            worst = worst.max(ratio);
            // Only arcs that end because of the tolerance.
            if arc < u_max && geometry.arc(g, u_max, 0.5 * tolerance) < arc {
                early.push(ratio);
            }
        }
        early.sort_by(f64::total_cmp);
        (worst, early.get(early.len() / 2).copied())
    }
}

#[test]
fn curves_arcs_keep_the_tolerance_and_use_it() {
    for entry in GEOMETRIES {
        let (worst, median) = visit(entry.id, Ratios { stretch: 1.0 });
        println!("{}: worst {worst:.3}, median {median:?} of the tolerance", entry.name);
        // Rounding of coordinates, 1e-14, is small against the smallest tolerance.
        assert!(worst <= 1.0 + 1e-6, "{}: an arc deviates by {worst} of the tolerance", entry.name);
        // (Where the third derivative is along the curve it does no harm, but the bound counts it.)
        let harmless = entry.name == "sl2-trace";
        assert!(median.is_none_or(|m| m > 0.125 || harmless), "{}: arcs use {median:?} of the tolerance", entry.name);
    }
}

/// Arcs twice as long break the tolerance, where arcs end early at all.
#[test]
fn curves_stretched_arcs_are_caught() {
    for entry in GEOMETRIES {
        let (worst, median) = visit(entry.id, Ratios { stretch: 2.0 });
        assert!(median.is_none() || worst > 1.0, "{}: stretched arcs pass with {worst}", entry.name);
    }
}

/// Number of exits compared, and the faults; `spoil` changes what the geometry says.
struct Exits {
    spoil: fn(f64) -> f64,
}

impl Visitor for Exits {
    type Output = (usize, Vec<String>);
    fn visit<G: Geometry>(self, geometry: G) -> Self::Output {
        const STEPS: u32 = 3000;
        let length = 6.0;
        let mut random = Random(2003);
        let (mut compared, mut faults) = (0, Vec::new());
        for number in 0..600 {
            let distance = random.within(0.0, 1.0);
            let g = state(geometry, &mut random, distance);
            let n = DVec3::from_array([0; 3].map(|_| random.within(-1.0, 1.0))).normalize();
            // Upright, level and tilted about either axis: what faces are.
            let masks = [DVec3::ONE, DVec3::Z, DVec3::new(1.0, 1.0, 0.0), DVec3::new(0.0, 1.0, 1.0)];
            let n = (n * masks[number % 4]).normalize();
            let plane = n.extend(-n.dot(geometry.chart(g.point)) - random.within(0.01, 0.5));
            let u = |k: u32| geometry.parameter_at(g, length * f64::from(k) / f64::from(STEPS));
            let mut first = None;
            let mut graze = f64::INFINITY;
            let mut shown = 0;
            for k in 1..=STEPS {
                let p = geometry.advance(g, u(k)).point;
                if !u(k).is_finite() || !is_shown(geometry, p) {
                    break;
                }
                shown = k;
                let side = geometry.side(p, plane);
                if side > 0.0 {
                    first = Some(k);
                    break;
                }
                graze = graze.min(-side);
            }
            let exit = (self.spoil)(geometry.exit(g, plane, f64::INFINITY));
            // A passage out and back between two steps is not seen here, but comes near.
            let unseen = |end: f64| graze < 1e-5 && exit < end;
            let fault = match first {
                Some(k) => !((u(k - 1) - 1e-9..=u(k) + 1e-9).contains(&exit) || unseen(u(k))),
                None => exit < u(shown) - 1e-9 && !unseen(u(shown)),
            };
            compared += usize::from(first.is_some());
            if fault {
                let expected = first.map(u);
                faults.push(format!("plane {plane} from {g:?}: exit {exit}, walked {expected:?}, grazing {graze:.1e}"));
            }
        }
        (compared, faults)
    }
}

#[test]
fn curves_exits_are_the_first_passages() {
    for entry in far_reaching() {
        let (compared, faults) = visit(entry.id, Exits { spoil: |exit| exit });
        assert!(compared > 200, "{}: only {compared} passages", entry.name);
        assert!(faults.is_empty(), "{}: {} faults, such as\n{}", entry.name, faults.len(), faults[0]);
    }
}

#[test]
fn curves_spoiled_exits_are_caught() {
    for entry in far_reaching() {
        let (_, faults) = visit(entry.id, Exits { spoil: |exit| exit * 1.01 });
        assert!(!faults.is_empty(), "{}: late exits pass", entry.name);
    }
}

/// Worst distance from the end by which logarithms miss, in units of what rounding does, and worst excess over the
/// length of a known way; `spoil` changes the lengths.
struct Logarithms {
    spoil: f64,
}

impl Visitor for Logarithms {
    type Output = (f64, f64);
    fn visit<G: Geometry>(self, geometry: G) -> Self::Output {
        let mut random = Random(1990);
        let (mut miss, mut excess) = (0.0_f64, 0.0_f64);
        for number in 0..3000 {
            let distance = random.within(0.0, 1.0);
            let g = state(geometry, &mut random, distance);
            let t = [1e-6, 1.0, 4.0, 9.0][number % 4] * random.within(0.1, 1.0);
            let q = geometry.flow(g, t).point;
            let (velocity, length) = geometry.log(g.point, q);
            let reached = geometry.flow(Geodesic { point: g.point, velocity }, length + self.spoil).point;
            // Rounding of the end, carried along.
            let size = 1.0 + q.abs().max_element().powi(2);
            miss = miss.max((reached - q).abs().max_element() / size);
            excess = excess.max(length - t);
        }
        (miss, excess)
    }
}

#[test]
fn curves_logarithms_reach_and_are_not_longer() {
    for entry in far_reaching() {
        let (miss, excess) = visit(entry.id, Logarithms { spoil: 0.0 });
        println!("{}: misses by {miss:.1e}, longer by {excess:.1e}", entry.name);
        assert!(miss < 1e-11, "{}: misses by {miss:e}", entry.name);
        assert!(excess < 1e-9, "{}: a way is shorter by {excess:e}", entry.name);
        let (spoiled, _) = visit(entry.id, Logarithms { spoil: 1e-6 });
        assert!(spoiled > 1e-9, "{}: a spoiled length passes", entry.name);
    }
}

/// Worst error of the area density, relative to its size, over lengths that pass conjugate points; `spoil` is added.
struct AreaDensity {
    spoil: f64,
}

impl Visitor for AreaDensity {
    type Output = f64;
    fn visit<G: Geometry>(self, geometry: G) -> f64 {
        let mut random = Random(1845);
        let mut worst = 0.0_f64;
        for _ in 0..2000 {
            let distance = random.within(0.0, 1.0);
            let g = state(geometry, &mut random, distance);
            let t = random.within(0.1, 9.0);
            let density = geometry.area_density(g, t) + self.spoil;
            assert!(density >= 0.0);
            // Small enough that what the flow makes of it is small.
            let step = 1e-4 / (1.0 + density);
            let end = geometry.flow(g, t).point;
            // Far out in hyperbolic space ambient coordinates leave few digits to differences.
            if end.abs().max_element() > 50.0 {
                continue;
            }
            let field = across(geometry, g).map(|e| {
                let near = |angle: f64| {
                    let velocity = g.velocity * angle.cos() + e * angle.sin();
                    let (direction, length) =
                        geometry.log(end, geometry.flow(Geodesic { point: g.point, velocity }, t).point);
                    direction * length
                };
                (near(step) - near(-step)) / (2.0 * step)
            });
            let inner = |i: usize, j: usize| geometry.inner(end, field[i], field[j]);
            // The Gram determinant of two vectors cancels where they are nearly parallel.
            let size = inner(0, 0) * inner(1, 1);
            let area = (size - inner(0, 1).powi(2)).max(0.0).sqrt();
            worst = worst.max((density * density - area * area).abs() / (1.0 + size));
        }
        worst
    }
}

#[test]
fn curves_area_density_is_that_of_the_flow() {
    // Areas of the trace form are those of its frame, which `across` is not orthonormal in; the laws look at them.
    for entry in GEOMETRIES.iter().filter(|entry| entry.name != "sl2-trace") {
        let worst = visit(entry.id, AreaDensity { spoil: 0.0 });
        println!("{}: area density off by {worst:.1e}", entry.name);
        assert!(worst < 1e-4, "{}: {worst:e}", entry.name);
        assert!(visit(entry.id, AreaDensity { spoil: 0.1 }) > 1e-3, "{}: a spoiled density passes", entry.name);
    }
}
