//! Integrators: the measured order of each in each geometry and precision, passages through faces, ends of charts,
//! pictures on the device. Single steps against the shaders' are in `twins`.

use crate::support::{self, Random, rt_gpu};
use glam::DVec4;
use holonomy::{
    geometry::{
        Elementary, Entry, GEOMETRIES, Geodesic, Geometry, GeometryId, Real, Real3, RealGeodesic, Visitor, exponential,
        settle_geodesic, visit,
    },
    integrate::{Dense, Dopri5, Euler, Field, Method, Rk4, State, Stepper, Stop, follow},
    render::{
        Backend, Shot, Target, compute::ComputeBackend, compute::probe::Probe, cpu::CpuBackend, plan::Plan,
        rt::RtBackend, world::World,
    },
    scene::file,
    shader_io::{self as io, ProbeIn},
    space::{catalogue, domain::Domain, reduce, stepped},
};
use std::sync::Arc;

/// A state near the base point, whose geodesic of length 1.2 stays far from the edge of the chart.
fn start<G: Geometry>(geometry: G, random: &mut Random) -> Geodesic {
    let unit = |p: DVec4, random: &mut Random| {
        let [x, y, z] = geometry.frame(p);
        let v = x * random.within(-1.0, 1.0) + y * random.within(-1.0, 1.0) + z * random.within(-1.0, 1.0);
        v / geometry.norm(p, v)
    };
    let base = geometry.base();
    let point = exponential(geometry, base, unit(base, random) * random.within(0.0, 0.2));
    Geodesic { point, velocity: unit(point, random) }
}

/// Length of the geodesics whose ends are compared.
const LENGTH: f64 = 0.8;

/// Root mean square of the errors of end states in the chart, after `n` equal steps, over some geodesics.
fn error<T: Real, G: Geometry>(geometry: G, stepper: impl Stepper, n: u32) -> f64 {
    let mut random = Random(1905);
    let field = |c, v| geometry.spray::<T>(c, v);
    let count = 40;
    let sum: f64 = (0..count)
        .map(|_| {
            let g = start(geometry, &mut random);
            let h = T::from_f64(LENGTH / f64::from(n));
            let mut state = State::<T>::of(geometry, g);
            for _ in 0..n {
                state = stepper.step(&field, state, h).end();
            }
            let exact = State::<f64>::of(geometry, geometry.flow(g, LENGTH));
            let (c, v) = (state.c.to_f64() - exact.c.to_f64(), state.v.to_f64() - exact.v.to_f64());
            c.length_squared() + v.length_squared()
        })
        .sum();
    (sum / f64::from(count)).sqrt()
}

/// Errors for three numbers of steps, each twice the one before.
struct Errors<S> {
    stepper: S,
    single: bool,
    first: u32,
}

impl<S: Stepper> Visitor for Errors<S> {
    type Output = [f64; 3];
    fn visit<G: Geometry>(self, geometry: G) -> [f64; 3] {
        [1, 2, 4].map(|k| {
            let n = self.first * k;
            match self.single {
                true => error::<f32, G>(geometry, self.stepper, n),
                false => error::<f64, G>(geometry, self.stepper, n),
            }
        })
    }
}

/// Numbers of steps that are few enough for the errors to be far above rounding, and many enough for the order to show.
fn first_count(order: u32, single: bool) -> u32 {
    match (order, single) {
        (1, true) => 16,
        (1, false) => 256,
        (_, true) => 2,
        (4, false) => 16,
        _ => 8,
    }
}

/// Powers by which the error falls from each number of steps to the next, or none where geodesics are the coordinate
/// lines and every step is exact.
fn orders<S: Stepper>(entry: &Entry, stepper: S, single: bool) -> Option<[f64; 2]> {
    let first = first_count(S::ORDER, single);
    let [a, b, c] = visit(entry.id, Errors { stepper, single, first });
    let rounding = if single { 1e-5 } else { 1e-13 };
    (a > rounding).then(|| [(a / b).log2(), (b / c).log2()])
}

/// Whether measured powers are the order that the stepper promises.
fn holds<S: Stepper>(entry: &Entry, stepper: S, single: bool) -> Result<(), String> {
    let Some(measured) = orders(entry, stepper, single) else {
        return if entry.name == "e3" || single { Ok(()) } else { Err(format!("{}: no errors at all", entry.name)) };
    };
    println!("{} order {}{}: {measured:.2?}", entry.name, S::ORDER, if single { " in f32" } else { "" });
    let order = f64::from(S::ORDER);
    // In f32 the last error is not far enough above rounding, and the first step is long.
    let kept = if single {
        measured[0] > order - 0.8 && measured[0] < order + 2.0
    } else {
        // Terms of higher order still show in the first pair.
        let [slack, above] = if S::ORDER == 1 { [0.1, 0.1] } else { [0.5, 1.0] };
        measured[0] > order - slack && measured[0] < order + above && (measured[1] - order).abs() < slack
    };
    if kept { Ok(()) } else { Err(format!("{}: order {measured:.2?} instead of {order}", entry.name)) }
}

#[test]
fn integrate_orders_are_as_promised() {
    let mut wrong = Vec::new();
    for entry in GEOMETRIES {
        for single in [false, true] {
            wrong.extend(holds(entry, Euler { step: 1.0 }, single).err());
            wrong.extend(holds(entry, Rk4 { step: 1.0 }, single).err());
            wrong.extend(holds(entry, Dopri5 { tolerance: 1.0 }, single).err());
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// A stepper with an error of second order in a step, as a wrong weight makes.
#[derive(Clone, Copy)]
struct Spoilt<S>(S);

impl<S: Stepper> Stepper for Spoilt<S> {
    const ORDER: u32 = S::ORDER;
    const EVALUATIONS: u32 = S::EVALUATIONS;
    fn step<T: Real>(&self, field: &impl Field<T>, start: State<T>, h: T) -> Dense<T> {
        let mut dense = self.0.step(field, start, h);
        // Of order 1 the error is one that does not fall at all.
        let factor = if S::ORDER == 1 { T::from_f64(0.5) * h } else { T::from_f64(0.1) * h * h };
        dense.c[1] = dense.c[1] + start.v * factor;
        dense
    }
    fn advance<T: Real>(&self, field: &impl Field<T>, start: State<T>, proposal: T, limit: T) -> Option<(Dense<T>, T)> {
        self.0.advance(field, start, proposal, limit)
    }
}

#[test]
fn integrate_a_spoilt_order_is_caught() {
    for entry in GEOMETRIES {
        for single in [false, true] {
            assert!(holds(entry, Spoilt(Euler { step: 1.0 }), single).is_err(), "{}: euler", entry.name);
            assert!(holds(entry, Spoilt(Rk4 { step: 1.0 }), single).is_err(), "{}: rk4", entry.name);
            assert!(holds(entry, Spoilt(Dopri5 { tolerance: 1.0 }), single).is_err(), "{}: dopri5", entry.name);
        }
    }
}

/// Error of the polynomial in the middle of a step of length `h`; `spoil` drops its last coefficient.
struct Middle<S> {
    stepper: S,
    h: f64,
    drop: Option<usize>,
}

impl<S: Stepper> Visitor for Middle<S> {
    type Output = f64;
    fn visit<G: Geometry>(self, geometry: G) -> f64 {
        let field = |c, v| geometry.spray::<f64>(c, v);
        let mut random = Random(1911);
        let each = (0..40).map(|_| {
            let g = start(geometry, &mut random);
            let mut dense = self.stepper.step(&field, State::of(geometry, g), self.h);
            if let Some(k) = self.drop {
                dense.c[k..].fill(Real3::zero());
                dense.v[k..].fill(Real3::zero());
            }
            let (found, exact) = (dense.at(0.5), State::<f64>::of(geometry, geometry.flow(g, 0.5 * self.h)));
            (found.c.to_f64() - exact.c.to_f64()).length() + (found.v.to_f64() - exact.v.to_f64()).length()
        });
        each.fold(0.0, f64::max)
    }
}

#[test]
fn integrate_polynomials_have_their_order() {
    fn falls<S: Stepper>(entry: &Entry, stepper: S, drop: Option<usize>) -> f64 {
        let middle = |h| visit(entry.id, Middle { stepper, h, drop });
        (middle(0.2) / middle(0.1)).log2()
    }
    for entry in GEOMETRIES.iter().filter(|entry| entry.name != "e3") {
        let (euler, rk4, dopri5) = (Euler { step: 1.0 }, Rk4 { step: 1.0 }, Dopri5 { tolerance: 1.0 });
        let found = [falls(entry, euler, None), falls(entry, rk4, None), falls(entry, dopri5, None)];
        println!("{}: polynomials gain {found:.2?}", entry.name);
        // One more than the order of the polynomial: 1, 3, 4.
        for (found, order) in found.into_iter().zip([2.0, 4.0, 5.0]) {
            assert!(found > order - 0.5, "{}: order {found} instead of {order}", entry.name);
        }
        assert!(falls(entry, dopri5, Some(4)) < 4.6, "{}: a cubic passes for a quartic", entry.name);
        assert!(falls(entry, rk4, Some(2)) < 2.6, "{}: a chord passes for a cubic", entry.name);
    }
}

/// Worst error of adaptive ends in units of tolerance times length, and the mean number of steps.
struct Adaptive {
    tolerance: f64,
    claimed: f64,
}

impl Visitor for Adaptive {
    type Output = (f64, f64);
    fn visit<G: Geometry>(self, geometry: G) -> Self::Output {
        let mut random = Random(1980);
        let (mut worst, mut steps) = (0.0_f64, 0);
        for number in 0..40 {
            let g = start(geometry, &mut random);
            let length = if number % 2 == 0 { LENGTH } else { -LENGTH };
            let method = Method::Dopri5 { tolerance: self.tolerance };
            let arrival = follow::<f64, G>(geometry, method, g, length).expect("it stays in the chart");
            let exact = geometry.flow(g, length);
            worst = worst.max(geometry.chart(arrival.end.point).distance(geometry.chart(exact.point)));
            steps += arrival.steps;
        }
        (worst / self.claimed, steps as f64 / 40.0)
    }
}

#[test]
fn integrate_adaptive_steps_keep_their_tolerance() {
    for entry in GEOMETRIES {
        let run = |tolerance, claimed| visit(entry.id, Adaptive { tolerance, claimed });
        let ((coarse, few), (fine, many)) = (run(1e-6, 1e-6), run(1e-11, 1e-11));
        println!("{}: {coarse:.2} in {few} steps, {fine:.2} in {many} steps", entry.name);
        // A tolerance is kept by each step; over a length of 1 the errors of a few dozen steps add up and are carried.
        assert!(coarse < 30.0 && fine < 100.0, "{}: {coarse} and {fine}", entry.name);
        assert!(run(1e-6, 1e-11).0 > 100.0 || entry.name == "e3", "{}: a loose tolerance passes", entry.name);
        let ratio = many / few;
        // A hundred thousandth of the tolerance takes a tenth of the step.
        assert!((2.0..20.0).contains(&ratio) || entry.name == "e3", "{}: {ratio} times the steps", entry.name);
    }
}

/// Follows the user's numbers.
struct Follow<'a>(&'static str, [f64; 4], [f64; 4], f64, &'a [Method]);

impl Visitor for Follow<'_> {
    type Output = Vec<Result<Geodesic, Stop>>;
    fn visit<G: Geometry>(self, geometry: G) -> Self::Output {
        let Self(name, point, direction, length, methods) = self;
        let g = settle_geodesic(geometry, name, point.into(), direction.into()).expect("a state");
        let both = methods.iter().flat_map(|method| {
            [follow::<f64, G>(geometry, *method, g, length), follow::<f32, G>(geometry, *method, g, length)]
        });
        both.map(|arrival| arrival.map(|a| a.end)).collect()
    }
}

/// Past the edge of a chart every method says so, in both precisions, or gives numbers; it never gives none.
#[test]
fn integrate_charts_end_cleanly() {
    let methods = [
        Method::Euler { step: 0.01 },
        Method::Rk4 { step: 0.01 },
        Method::Dopri5 { tolerance: 1e-9 },
        Method::Dopri5 { tolerance: 1e-300 },
    ];
    let cases = [
        ("s3", [0.0, 0.0, 0.0, 1.0], [1.0, 0.0, 0.0, 0.0], 5.0),
        ("s3", [0.0, 0.0, 0.0, 1.0], [1.0, 0.0, 0.0, 0.0], std::f64::consts::FRAC_PI_2),
        ("s2xr", [0.0, 0.0, 0.0, 1.0], [1.0, 0.0, 0.0, 0.0], -4.0),
        ("h3", [0.0, 0.0, 0.0, 1.0], [1.0, 0.0, 0.0, 0.0], 60.0),
        ("sol", [0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 0.0], 900.0),
        ("sl2-trace", [0.0, 0.0, 0.0, 0.0], [-1.0, 1.0, 1.0, 0.0], 30.0),
    ];
    for (name, point, direction, length) in cases {
        let id = GeometryId::from_name(name).expect("registered");
        for g in visit(id, Follow(name, point, direction, length, &methods)).into_iter().flatten() {
            assert!(g.point.is_finite() && g.velocity.is_finite(), "{name}: {g:?}");
        }
    }
    // At least the adaptive method sees each of the edges.
    for (name, point, direction, length) in [cases[0], cases[2]] {
        let id = GeometryId::from_name(name).expect("registered");
        let ends = visit(id, Follow(name, point, direction, length, &methods[2..3]));
        assert!(ends.iter().all(|end| matches!(end, Err(Stop::Chart(at)) if at.abs() < 1.6)), "{name}: {ends:?}");
    }
}

/// Next to the edge of a chart, where its rounding is as long as the way itself, an integrated end is refused and not wrong.
#[test]
fn integrate_ends_that_the_chart_does_not_resolve_are_refused() {
    let id = GeometryId::from_name("h3").expect("registered");
    let methods = [Method::Rk4 { step: 0.01 }, Method::Dopri5 { tolerance: 1e-9 }];
    let ends = |length| visit(id, Follow("h3", [0.0, 0.0, 0.0, 1.0], [0.6, 0.0, 0.8, 0.0], length, &methods));
    assert!(ends(5.0).iter().all(Result::is_ok), "{:?}", ends(5.0));
    assert!(ends(25.0).iter().all(|end| matches!(end, Err(Stop::Chart(_)))), "{:?}", ends(25.0));
}

/// Distances between ends through faces and the exact ones, and whether the faces are the same; `spoil` is added to the
/// length of the integrated geodesic.
struct Through<'a> {
    domain: &'a Domain,
    method: Method,
    spoil: f64,
}

impl Visitor for Through<'_> {
    type Output = (f64, usize);
    fn visit<G: Geometry>(self, geometry: G) -> Self::Output {
        let mut random = Random(1991);
        let (mut sum, mut same) = (0.0, 0);
        for _ in 0..30 {
            let mut g = start(geometry, &mut random);
            // The middle of the first cell, whose base point may be a corner.
            g.point = reduce_into(geometry, self.domain, g.point);
            let length = 3.0;
            let exact = reduce::transport(geometry, self.domain, g, 0, length).expect("a way");
            let found = stepped::transport(geometry, self.domain, g, 0, length + self.spoil, self.method);
            let Some(found) = found else { continue };
            if found.faces == exact.faces {
                same += 1;
                sum += geometry.chart(found.state.point).distance_squared(geometry.chart(exact.state.point));
            }
        }
        ((sum / f64::from(same.max(1))).sqrt(), same as usize)
    }
}

/// A point near the given one that is inside the first cell, away from its faces.
fn reduce_into<G: Geometry>(geometry: G, domain: &Domain, point: DVec4) -> DVec4 {
    let mut c = geometry.chart(point);
    for _ in 0..200 {
        let planes = domain.cells[0].clone().map(|face| domain.faces[face].plane);
        let Some(plane) = planes.into_iter().find(|p| p.truncate().dot(c) + p.w > -0.05) else { break };
        let n = plane.truncate();
        c -= n * ((n.dot(c) + plane.w + 0.06) / n.length_squared());
    }
    geometry.unchart(c).expect("a point of the cell")
}

#[test]
fn integrate_ways_through_faces_converge_to_the_exact_ones() {
    let mut spaces = 0;
    for name in catalogue::NAMES {
        let space = catalogue::find(name).expect("a space");
        let domain = Domain::new(&space);
        if space.cells.iter().any(|cell| cell.faces.is_empty()) {
            continue;
        }
        spaces += 1;
        let run = |method, spoil| visit(space.geometry, Through { domain: &domain, method, spoil });
        let ladder = [
            [Method::Euler { step: 0.01 }, Method::Euler { step: 0.0025 }],
            [Method::Rk4 { step: 0.1 }, Method::Rk4 { step: 0.025 }],
            [Method::Dopri5 { tolerance: 1e-5 }, Method::Dopri5 { tolerance: 1e-10 }],
        ];
        for [coarse, fine] in ladder {
            let ((far, _), (near, same)) = (run(coarse, 0.0), run(fine, 0.0));
            println!("{name} {}: {far:.1e}, then {near:.1e} on {same} of 30 ways", fine.name());
            let (limit, gain) = match fine {
                Method::Euler { .. } => (0.2, 2.5),
                Method::Rk4 { .. } => (2e-3, 40.0),
                _ => (1e-6, 100.0),
            };
            let enough = if matches!(fine, Method::Euler { .. }) { 12 } else { 27 };
            assert!(same >= enough, "{name} {}: only {same} ways through the same faces", fine.name());
            assert!(near < limit, "{name} {}: {near:e}", fine.name());
            assert!(near < 1e-12 || near * gain < far, "{name} {}: from {far:e} to {near:e}", fine.name());
            if limit < 1e-4 {
                let (spoilt, _) = run(fine, 1e-3);
                assert!(spoilt > limit, "{name} {}: a spoilt length passes with {spoilt:e}", fine.name());
            }
        }
    }
    assert!(spaces >= 14, "only {spaces} closed spaces");
}

/// Exact flows in f32 are near those of f64, and are not those, rounded: of 40 ends some differ in every geometry.
#[test]
fn integrate_exact_f32_is_computed_in_f32() {
    /// How many ends in `T` are others than those of f64 from the same numbers, and by how much, all rounded to f32.
    fn others<T: Elementary, G: Geometry>(geometry: G) -> (usize, f64) {
        let mut random = Random(1895);
        let ends = |_| {
            let g = RealGeodesic::<f32>::from_f64(start(geometry, &mut random)).to_f64();
            let length = f64::from(LENGTH as f32);
            let single = |end: Geodesic| RealGeodesic::<f32>::from_f64(end).to_f64();
            let found = single(follow::<T, G>(geometry, Method::Exact, g, length).expect("a flow").end);
            let exact = single(follow::<f64, G>(geometry, Method::Exact, g, length).expect("a flow").end);
            (found.point - exact.point).abs().max((found.velocity - exact.velocity).abs()).max_element()
        };
        let off: Vec<f64> = (0..40).map(ends).collect();
        (off.iter().filter(|x| **x > 0.0).count(), off.iter().fold(0.0, |worst, x| x.max(worst)))
    }
    struct Others;
    impl Visitor for Others {
        type Output = [(usize, f64); 2];
        fn visit<G: Geometry>(self, geometry: G) -> Self::Output {
            [others::<f32, G>(geometry), others::<f64, G>(geometry)]
        }
    }
    for entry in GEOMETRIES {
        let [(differ, off), (same, _)] = visit(entry.id, Others);
        println!("{}: {differ} of 40 ends differ, by {off:.1e} at most", entry.name);
        assert!(differ > 5 && off < 2e-6, "{}: {differ} of 40 ends differ, by {off:e} at most", entry.name);
        assert_eq!(same, 0, "{}: f64 passes for f32", entry.name);
    }
}

/// Ends on the device and on the cpu in f32 agree within the roundings that integration carries.
#[test]
fn integrate_device_follows_as_the_cpu() {
    struct Ends(Vec<Geodesic>, Method);
    impl Visitor for Ends {
        type Output = Vec<Geodesic>;
        fn visit<G: Geometry>(self, geometry: G) -> Self::Output {
            let follow = |g| follow::<f32, G>(geometry, self.1, g, LENGTH).expect("inside the chart").end;
            self.0.into_iter().map(follow).collect()
        }
    }
    struct Starts;
    impl Visitor for Starts {
        type Output = Vec<Geodesic>;
        fn visit<G: Geometry>(self, geometry: G) -> Self::Output {
            let mut random = Random(1895);
            (0..40).map(|_| start(geometry, &mut random)).collect()
        }
    }
    let Some(gpu) = support::gpu() else { return };
    for entry in GEOMETRIES {
        let mut probe = Probe::new(&gpu, entry.id).expect("a probe");
        let starts = visit(entry.id, Starts);
        for method in [Method::Euler { step: 0.02 }, Method::Rk4 { step: 0.1 }, Method::Dopri5 { tolerance: 1e-5 }] {
            let number = holonomy::render::plan::integrator_number(method);
            let single = |v: DVec4| v.as_vec4().to_array();
            let inputs: Vec<ProbeIn> = starts
                .iter()
                .map(|g| ProbeIn {
                    a: single(g.point),
                    b: single(g.velocity),
                    c: [number as f32, method.parameter() as f32, 0.0, 0.0],
                    t: LENGTH as f32,
                    op: io::PROBE_FOLLOW,
                })
                .collect();
            let found = probe.run(&inputs).expect("it runs");
            let expected = visit(entry.id, Ends(starts.clone(), method));
            let off = |spoil: f32| {
                let each = found.iter().zip(&expected).map(|(found, expected)| {
                    let a = glam::Vec4::from(found.a) + spoil;
                    let b = glam::Vec4::from(found.b) + spoil;
                    let (a, b) = (a.as_dvec4() - expected.point, b.as_dvec4() - expected.velocity);
                    a.abs().max_element().max(b.abs().max_element())
                });
                each.fold(0.0, f64::max)
            };
            // Forty steps of some ten roundings each.
            assert!(off(0.0) < 4e-5, "{} {}: {:e}", entry.name, method.name(), off(0.0));
            assert!(off(1e-3) > 4e-5, "{} {}: a spoilt end passes", entry.name, method.name());
        }
    }
}

fn draw(backend: &mut dyn Backend, name: &str, method: Method) -> Target {
    let mut scene = file::load(name).expect("a shipped scene");
    scene.settings.method = method;
    scene.settings.bounces = 4;
    // The default is not converged in such small pictures.
    scene.settings.tolerance = 0.02;
    let plan = Plan::new(&scene, true);
    let world = Arc::new(World::new(&scene, &plan, scene.observer.frame).expect("it fits"));
    backend.load(&world).expect("it loads");
    let shot = Shot::symmetric(scene.observer.frame, scene.observer.fov, [96, 72]);
    let mut target = Target::new(shot.size);
    let stats = backend.render(&shot, &mut target, &|_| ()).expect("it draws");
    assert_eq!(stats.counts[io::COUNT_LOST as usize], 0, "no ray is lost");
    assert!(target.pixels.iter().flatten().all(|x| x.is_finite()), "{name}: a pixel is no number");
    target
}

/// Share of the pixels that differ by more than 2/255 of white, linear.
fn different(a: &Target, b: &Target) -> f64 {
    let far = |(a, b): (&[f32; 4], &[f32; 4])| (0..3).any(|i| (a[i] - b[i]).abs() > 2.0 / 255.0);
    a.pixels.iter().zip(&b.pixels).filter(|pair| far(*pair)).count() as f64 / a.pixels.len() as f64
}

/// Methods, and the share of the pixels that may differ from exact flows.
const PICTURES: [(Method, f64); 3] = [
    (Method::Euler { step: 0.02 }, 0.3),
    (Method::Rk4 { step: 0.02 }, 0.03),
    (Method::Dopri5 { tolerance: 1e-6 }, 0.02),
];

/// A device's picture is the cpu's.
fn assert_agrees(device: &mut dyn Backend, name: &str, method: Method, cpu: &Target) {
    let drawn = draw(device, name, method);
    let (off, on) = (different(cpu, &drawn), device.name());
    println!("{name} {}: {:.2} % differ between cpu and {on}", method.name(), 100.0 * off);
    assert!(off <= 0.01, "{name} {}: cpu and {on} differ in {off}", method.name());
    let mut spoilt = drawn.clone();
    spoilt.pixels.iter_mut().step_by(50).for_each(|p| p[1] += 0.1);
    assert!(different(cpu, &spoilt) > 0.01, "a spoilt picture passes");
}

#[test]
fn integrate_pictures_converge_and_agree_on_compute() {
    let gpu = support::gpu();
    for name in ["nil-heisenberg", "s2xs1", "seifert-weber", "poincare"] {
        let mut cpu = CpuBackend::default();
        let exact = draw(&mut cpu, name, Method::Exact);
        for (method, limit) in PICTURES {
            let drawn = draw(&mut cpu, name, method);
            let off = different(&exact, &drawn);
            println!("{name} {}: {:.2} % of the pixels differ from exact", method.name(), 100.0 * off);
            assert!(off <= limit, "{name} {}: {off}", method.name());
            if let Some(gpu) = &gpu {
                let mut compute = ComputeBackend::new(gpu).expect("a backend");
                assert_agrees(&mut compute, name, method, &drawn);
            }
        }
    }
}

#[test]
fn integrate_pictures_agree_on_rt() {
    let Some(gpu) = rt_gpu() else { return };
    for name in ["nil-heisenberg", "poincare"] {
        for (method, _) in PICTURES {
            let drawn = draw(&mut CpuBackend::default(), name, method);
            assert_agrees(&mut RtBackend::new(&gpu).expect("a backend"), name, method, &drawn);
        }
    }
}
