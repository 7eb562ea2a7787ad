//! Formulas that are printed wrong in *Visualizing Thurston's Geometries*, each beside what the program computes, by the
//! same yardstick. A case fails if the program is beyond the limit, and also if the printed formula is within it: then
//! the case would show nothing. Sections are the book's.

use super::{Bench, Case, Family, HOST, NUMBERS, On, Random, Reading, Trouble, geodesic};
use crate::{
    geometry::{
        Geodesic, Geometry, GeometryId, Isometry, Nil, Sl2, Sl2Trace, Sol, Visitor, sl2::element, sol::translation,
        visit,
    },
    measure::reference::{Big, BigGeodesic, Model, Nil as NilReference, SOL, distance},
    render::{Shot, cpu::traverse::Tracer, plan::Plan, side_by_side, world::World},
    scene::{file, folder::Folder},
    shader_io::{PROBE_EXIT, ProbeIn},
    space::{
        catalogue,
        domain::Domain,
        observer::Frame,
        polyhedron::Polyhedron,
        reduce::{reduce_frame, violated_face},
        walk::Path,
    },
};
use glam::{DMat2, DMat3, DMat4, DVec2, DVec3, DVec4, Vec4Swizzles};
use std::f64::consts::{PI, TAU};

/// A case whose program and printed formula are both evaluated on the host.
fn on_host(
    subject: &str,
    what: &str,
    quantity: &'static str,
    limit: f64,
    measure: impl Fn() -> [f64; 2] + Send + Sync + 'static,
) -> Case {
    Family { name: "book", quantity, on: HOST }.case(subject, what, move |_, _| {
        let [ours, printed] = measure();
        Ok(Reading { printed: Some(printed), ..Reading::new(ours, limit) })
    })
}

pub(super) fn cases() -> Vec<Case> {
    let numbers = |quantity| Family { name: "book", quantity, on: NUMBERS };
    let mut cases = vec![
        on_host("sl2", "1.4.3 Tr(uv) as a metric", "least square of a unit vector, below 0", 0.0, trace_as_metric),
        on_host("sol", "5.2 x+1 and y+1 as lattice", "of a conjugate from the lattice", 1e-12, lattice),
        on_host("sol", "1.4.3 inverse", "of p⁻¹p from the identity", 1e-12, inverse),
        on_host("sol", "1.4.3 metric with that group law", "change under left multiplication", 1e-12, sol_metric),
        on_host("nil", "1.4.3 dφ(e2)", "change of the metric under left multiplication", 1e-12, nil_differential),
        on_host("sol", "5.2 eigenvalues of A", "of the characteristic polynomial from 0", 1e-12, eigenvalues),
        on_host("sl2-trace", "1.4.3 dφ(e3)", "entries of the metric off", 1e-12, trace_differential),
        on_host("sl2-trace", "1.4.3 edge of the chart at x = 1", "matrix entry that vanishes there", 1e-9, edge),
        on_host(
            "sl2",
            "1.4.3 Iwasawa decomposition",
            "cosh of the distance of two points off, relative",
            1e-12,
            iwasawa,
        ),
        on_host("e3", "4.4.1 3024 × 3360 pixels for both eyes", "pixels without a view", 0.0, stereo_size),
        on_host("e3", "3.2.3 until i ≤ maxlevel", "bounces off", 0.0, levels),
        Family { name: "book", quantity: "pixels off", on: HOST }.case("e3", "2.4.1 symmetric rays", |_, _| {
            let [ours, printed] = off_axis()?;
            Ok(Reading { printed: Some(printed), ..Reading::new(ours, 1e-9) })
        }),
        numbers("end point off").case("sol", "3.3.3 Euler at step 0.05, length 3", |bench, on| {
            sol_flow(bench, on, 3.0, 1e-4, |start| euler(start, 3.0, 0.05))
        }),
        numbers("end point off").case("sol", "1.4.3 Γ³₃₁ = e^-2z", |bench, on| {
            sol_flow(bench, on, 2.0, 1e-4, |start| extra_symbol(start, 2.0))
        }),
        numbers("end point off, lengths to 5").case("nil", "1.4.3 closed form as w → 0", nil_closed_form),
    ];
    for axis in [0, 1] {
        let what = ["5.1 first crossing of x = c", "5.1 first crossing of y = c"][axis];
        let family = numbers("share of rays with another first crossing");
        cases.push(family.case("nil", what, move |bench, on| crossings(bench, on, axis)));
    }
    if let Some(space) = catalogue::find("seifert-weber") {
        let measure = move || visit(space.geometry, Corners(&space));
        let quantity = "of a face's corner from one of its partner's";
        cases.push(on_host("seifert-weber", "1.4.1 turn of 3π/10", quantity, 1e-12, measure));
    }
    // Every space whose cells do not meet face to face.
    for name in catalogue::NAMES {
        let Some(space) = catalogue::find(name).filter(|space| visit(space.geometry, Once(space))[1] > 1e-6) else {
            continue;
        };
        let measure = move || visit(space.geometry, Once(&space));
        let quantity = "outside of the domain after a face";
        cases.push(on_host(name, "5 one generator for a face", quantity, 1e-9, measure));
    }
    cases
}

// --- metrics and groups -------------------------------------------------------------------------------

fn trace_as_metric() -> [f64; 2] {
    let mut random = Random(143);
    let directions: Vec<DVec3> = (0..2000).map(|_| random.direction()).collect();
    let least = |square: &dyn Fn(DVec3) -> f64| {
        let least = directions.iter().map(|v| square(*v)).fold(f64::INFINITY, f64::min);
        (-least).max(0.0)
    };
    let ours = least(&|v| Sl2.inner(Sl2.base(), v.extend(0.0), v.extend(0.0)));
    let printed = least(&|v| {
        let m = DMat2::from_cols(DVec2::new(v.x, v.z), DVec2::new(v.y, -v.x));
        let square = m * m;
        square.x_axis.x + square.y_axis.y
    });
    [ours, printed]
}

fn golden() -> f64 {
    0.5 * (1.0 + 5.0_f64.sqrt())
}

/// How far Φ3 b Φ3⁻¹ lies from the lattice that two vectors span, for b one of them.
fn lattice() -> [f64; 2] {
    let climb = translation(DVec3::new(0.0, 0.0, 2.0 * golden().ln()));
    let back = Sol.inverse(&climb);
    let off = |b1: DVec2, b2: DVec2| {
        let basis = DMat2::from_cols(b1, b2);
        [b1, b2].into_iter().fold(0.0, |worst: f64, b| {
            let conjugate = Sol.compose(&Sol.compose(&climb, &translation(b.extend(0.0))), &back);
            let image = conjugate.linear.w_axis.xy();
            let whole = (basis.inverse() * image).round();
            worst.max((basis * whole - image).length())
        })
    };
    let size = (golden() * golden() + 1.0).sqrt();
    let ours = off(DVec2::new(golden(), -1.0) / size, DVec2::new(1.0, golden()) / size);
    [ours, off(DVec2::X, DVec2::Y)]
}

fn off_identity(m: &Isometry) -> f64 {
    let entries = (m.linear - DMat4::IDENTITY).to_cols_array();
    entries.iter().fold(m.shift.length(), |worst: f64, x| worst.max(x.abs()))
}

fn inverse() -> [f64; 2] {
    let mut random = Random(5);
    let mut worst = [0.0_f64; 2];
    for _ in 0..100 {
        let p = random.vector(1.0);
        let m = translation(p);
        let printed = translation(DVec3::new(-p.x * p.z.exp(), -p.y * (-p.z).exp(), -p.z));
        worst[0] = worst[0].max(off_identity(&Sol.compose(&Sol.inverse(&m), &m)));
        worst[1] = worst[1].max(off_identity(&Sol.compose(&printed, &m)));
    }
    worst
}

/// Largest change of the square of a chart vector under left multiplications, given with their differential.
fn invariance(
    square: impl Fn(DVec3, DVec3) -> f64,
    multiply: impl Fn(DVec3, DVec3) -> DVec3,
    differential: impl Fn(DVec3, DVec3) -> DVec3,
) -> f64 {
    let mut random = Random(11);
    (0..200).fold(0.0, |worst: f64, _| {
        let (q, p, v) = (random.vector(1.0), random.vector(1.0), random.direction());
        let before = square(p, v);
        worst.max((square(multiply(q, p), differential(q, v)) - before).abs())
    })
}

/// The square of a chart vector in the program's metric.
fn square_of<G: Geometry>(geometry: G, c: DVec3, v: DVec3) -> f64 {
    geometry.unchart(c).map_or(f64::NAN, |p| {
        let v = geometry.unchart_vector(p, v);
        geometry.inner(p, v, v)
    })
}

fn sol_metric() -> [f64; 2] {
    let multiply = |q: DVec3, p: DVec3| DVec3::new(q.x + q.z.exp() * p.x, q.y + (-q.z).exp() * p.y, q.z + p.z);
    let differential = |q: DVec3, v: DVec3| DVec3::new(q.z.exp() * v.x, (-q.z).exp() * v.y, v.z);
    let printed = |p: DVec3, v: DVec3| {
        let (x, y) = (p.z.exp() * v.x, (-p.z).exp() * v.y);
        x * x + y * y + v.z * v.z
    };
    let ours = invariance(|p, v| square_of(Sol, p, v), multiply, differential);
    [ours, invariance(printed, multiply, differential)]
}

fn nil_differential() -> [f64; 2] {
    let multiply = |q: DVec3, p: DVec3| DVec3::new(q.x + p.x, q.y + p.y, q.z + p.z + q.x * p.y);
    let differential = |q: DVec3, v: DVec3| DVec3::new(v.x, v.y, v.z + q.x * v.y);
    let printed = |p: DVec3, v: DVec3| DVec3::new(v.x, v.y, v.z + p.x * v.y).length_squared();
    let ours = invariance(|p, v| square_of(Nil, p, v), multiply, differential);
    [ours, invariance(printed, multiply, differential)]
}

/// Of A = [[2, 1], [1, 1]], by which Φ3 acts on the lattice.
fn eigenvalues() -> [f64; 2] {
    let polynomial = |x: f64| (x * x - 3.0 * x + 1.0).abs();
    let log = 2.0 * golden().ln();
    let climb = translation(DVec3::new(0.0, 0.0, log)).linear;
    let ours = polynomial(climb.x_axis.x).max(polynomial(climb.y_axis.y));
    [ours, polynomial(log).min(polynomial(-log))]
}

/// The matrix of a chart point.
fn chart_matrix(p: DVec3) -> DMat2 {
    let first = 1.0 + p.x;
    DMat2::from_cols(DVec2::new(first, p.z), DVec2::new(p.y, (1.0 + p.y * p.z) / first))
}

fn trace_differential() -> [f64; 2] {
    let trace = |a: DMat2, b: DMat2| {
        let product = a * b;
        product.x_axis.x + product.y_axis.y
    };
    let mut random = Random(13);
    let mut worst = [0.0_f64; 2];
    for _ in 0..100 {
        let p = random.vector(0.5);
        let first = 1.0 + p.x;
        // p⁻¹ times the partial derivatives of the chart's matrix.
        let back = chart_matrix(p).inverse();
        let last = (1.0 + p.y * p.z) / first;
        let exact = [
            back * DMat2::from_cols(DVec2::X, DVec2::new(0.0, -last / first)),
            back * DMat2::from_cols(DVec2::ZERO, DVec2::new(1.0, p.z / first)),
            back * DMat2::from_cols(DVec2::Y, DVec2::new(0.0, p.y / first)),
        ];
        let printed =
            [exact[0], exact[1], DMat2::from_cols(DVec2::new(-p.y, -1.0 + p.x), DVec2::new(-p.y * p.y / first, p.y))];
        let Some(point) = Sl2Trace.unchart(p) else { return [f64::NAN; 2] };
        let vectors = DVec3::AXES.map(|axis| Sl2Trace.unchart_vector(point, axis));
        for i in 0..3 {
            for j in 0..3 {
                let truth = trace(exact[i], exact[j]);
                worst[0] = worst[0].max((Sl2Trace.inner(point, vectors[i], vectors[j]) - truth).abs());
                worst[1] = worst[1].max((trace(printed[i], printed[j]) - truth).abs());
            }
        }
    }
    worst
}

/// The entry 1 + x = cos t of the time-like geodesic from the identity where the chart is said to end.
fn edge() -> [f64; 2] {
    let start = Geodesic { point: Sl2Trace.base(), velocity: DVec4::new(0.0, 1.0, -1.0, 0.0) };
    let (mut low, mut high) = (0.0, 3.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if Sl2Trace.edge(start, middle).is_some() { high = middle } else { low = middle }
    }
    [f64::cos(high).abs(), 1.0 + 1.0]
}

/// cosh of the distance of gi and hi is half of the square of the norm of g⁻¹h, and ⟨g, h⟩ on the program's hyperboloid.
fn iwasawa() -> [f64; 2] {
    // g = P R(θ) from its point of the program: P is the root of [[w + x, y], [y, w − x]].
    let matrix = |at: DVec4| {
        let symmetric = DMat2::from_cols(DVec2::new(at.w + at.x + 1.0, at.y), DVec2::new(at.y, at.w - at.x + 1.0));
        let (sin, cos) = (0.5 * at.z).sin_cos();
        symmetric * DMat2::from_cols(DVec2::new(cos, sin), DVec2::new(-sin, cos)) * (1.0 / (2.0 + 2.0 * at.w).sqrt())
    };
    let printed = |g: DMat2| {
        let [a, c, b, d] = g.to_cols_array();
        DVec2::new(a * c + b * d, c * c + d * d)
    };
    let mut random = Random(17);
    let mut worst = [0.0_f64; 2];
    for _ in 0..100 {
        let mut at = || element(random.within(-2.0, 2.0), random.within(-2.0, 2.0), random.within(-6.0, 6.0));
        let (p, q) = (at(), at());
        let (g, h) = (matrix(p), matrix(q));
        let truth = 0.5 * (g.inverse() * h).to_cols_array().iter().map(|x| x * x).sum::<f64>();
        let ours = p.w * q.w - p.x * q.x - p.y * q.y;
        let [a, b] = [printed(g), printed(h)];
        let book = 1.0 + (a - b).length_squared() / (2.0 * a.y * b.y);
        worst = [worst[0].max((ours / truth - 1.0).abs()), worst[1].max((book / truth - 1.0).abs())];
    }
    worst
}

// --- pictures -----------------------------------------------------------------------------------------

/// Two views of 1512 × 1680.
fn stereo_size() -> [f64; 2] {
    let views = 2.0 * 1512.0 * 1680.0;
    let [width, height] = side_by_side([1512, 1680], 2).map(f64::from);
    [(width * height - views).abs(), (3024.0 * 3360.0 - views).abs()]
}

/// A ray with a maximum of eight levels that meets nothing.
fn levels() -> [f64; 2] {
    const MOST: u32 = 8;
    let Some(space) = catalogue::find("torus") else { return [f64::NAN; 2] };
    struct Walk(Domain);
    impl Visitor for Walk {
        type Output = u32;
        fn visit<G: Geometry>(self, geometry: G) -> u32 {
            let point = geometry.flow(first_ray(geometry), 0.3).point;
            let mut path = Path::new(Geodesic { point, ..first_ray(geometry) }, 0, f64::INFINITY);
            super::walk::to_the_end(geometry, &self.0, &mut path, MOST);
            path.bounces
        }
    }
    let ours = visit(space.geometry, Walk(Domain::new(&space)));
    let mut printed = 0;
    loop {
        printed += 1;
        if printed <= MOST {
            break;
        }
    }
    [ours, printed].map(|bounces| (f64::from(bounces) - f64::from(MOST)).abs())
}

fn first_ray<G: Geometry>(geometry: G) -> Geodesic {
    let [x, y, z] = geometry.frame(geometry.base());
    Geodesic { point: geometry.base(), velocity: x * 0.48 + y * 0.6 + z * 0.64 }
}

/// A headset's frustum, 4° off its axis: rays of pixels, projected back by the projection of the frustum's tangents.
fn off_axis() -> Result<[f64; 2], Trouble> {
    const SIZE: [u32; 2] = [1512, 1680];
    let text = "[space]\nmanifold = \"torus\"\n[observer]\nposition = [0.5, 0.5, 0.5]\n";
    let scene = file::read("frustum.toml", text.as_bytes(), &Folder::Embedded)?;
    let plan = Plan::new(&scene, false);
    let world = World::new(&scene, &plan, scene.observer.frame)?;
    let angles = [-54.0_f64, 46.0, -53.0, 55.0].map(f64::to_radians);
    let tangents = angles.map(f64::tan);
    let shot = Shot { tangents, ..Shot::symmetric(scene.observer.frame, 90.0, SIZE) };
    let [left, right, down, up] = tangents;
    let [width, height] = SIZE.map(f64::from);
    // The projection matrix of OpenXR's fov, near plane 1: columns are x, y, z, w.
    let projection = DMat4::from_cols(
        DVec4::new(2.0 / (right - left), 0.0, 0.0, 0.0),
        DVec4::new(0.0, 2.0 / (up - down), 0.0, 0.0),
        DVec4::new((right + left) / (right - left), (up + down) / (up - down), -1.0, -1.0),
        DVec4::new(0.0, 0.0, -1.0, 0.0),
    );
    let off = |at: [f64; 2], direction: DVec3| {
        let clip = projection * direction.extend(1.0);
        let pixel = DVec2::new(0.5 * (clip.x / clip.w + 1.0) * width, 0.5 * (1.0 - clip.y / clip.w) * height);
        (pixel - DVec2::from_array(at)).length()
    };
    struct Rays<'a, F>(&'a World, &'a Shot, F);
    impl<F: Fn([f64; 2], DVec3) -> f64> Visitor for Rays<'_, F> {
        type Output = f64;
        fn visit<G: Geometry>(self, geometry: G) -> f64 {
            let Self(world, shot, off) = self;
            let tracer = Tracer::new(geometry, world, shot);
            let axes = DMat3::from_cols_array_2d(&shot.eye.axes.map(|axis| axis.xyz().to_array()));
            pixels().fold(0.0, |worst: f64, at| worst.max(off(at, axes.inverse() * tracer.geodesic(at).velocity.xyz())))
        }
    }
    let ours = visit(world.geometry, Rays(&world, &shot, off));
    let tan = (0.5 * (angles[3] - angles[2])).tan();
    let symmetric = |at: [f64; 2]| {
        let (x, y) = (2.0 * at[0] / width - 1.0, 1.0 - 2.0 * at[1] / height);
        DVec3::new(x * tan * width / height, y * tan, -1.0)
    };
    let printed = pixels().fold(0.0, |worst: f64, at| worst.max(off(at, symmetric(at))));
    Ok([ours, printed])
}

fn pixels() -> impl Iterator<Item = [f64; 2]> {
    (0..40).map(|i| [0.5 + 38.0 * f64::from(i), 0.5 + 41.0 * f64::from((i * 7) % 40)])
}

// --- flows --------------------------------------------------------------------------------------------

type State = [DVec3; 2];

/// Starts from the identity in all kinds of directions.
fn sol_starts() -> impl Iterator<Item = DVec3> {
    let mut random = Random(333);
    (0..50).map(move |_| random.direction())
}

/// The program's ends against the reference, and the printed method's.
fn sol_flow(
    bench: &mut Bench,
    on: On,
    length: f64,
    limit: f64,
    printed: impl Fn(DVec3) -> DVec3,
) -> Result<Reading, Trouble> {
    let Some(id) = GeometryId::from_name(SOL.name()) else { return Err(Trouble(String::from("no such geometry"))) };
    let starts: Vec<geodesic::Start> =
        sol_starts().map(|v| geodesic::Start { from: [0.0; 4], direction: v.extend(0.0).to_array(), length }).collect();
    let ends = geodesic::ends(bench, on, id, &starts)?;
    let mut worst = [0.0_f64; 2];
    for (start, end) in starts.iter().zip(ends) {
        let exact = SOL.flow(&SOL.settle(start.from, start.direction), &Big::new(length));
        let ours = end.map_or(f64::INFINITY, |end| distance(&exact.point, &end.point.to_array()[..3]));
        let v = DVec4::from_array(start.direction).xyz();
        worst = [worst[0].max(ours), worst[1].max(distance(&exact.point, &printed(v).to_array()))];
    }
    Ok(Reading { printed: Some(worst[1]), ..Reading::new(worst[0], limit) })
}

/// The book's flow, in its coordinates: its metric is the program's with the other sign of z. `symbol` is Γ³₃₁.
fn book_flow([p, v]: State, symbol: impl Fn(DVec3) -> f64) -> State {
    let (rise, fall) = ((2.0 * p.z).exp(), (-2.0 * p.z).exp());
    let bend = rise * v.x * v.x - fall * v.y * v.y - 2.0 * symbol(p) * v.x * v.z;
    [v, DVec3::new(-2.0 * v.x * v.z, 2.0 * v.y * v.z, bend)]
}

fn mirrored(v: DVec3) -> DVec3 {
    DVec3::new(v.x, v.y, -v.z)
}

fn euler(direction: DVec3, length: f64, step: f64) -> DVec3 {
    let mut now = [DVec3::ZERO, mirrored(direction)];
    for _ in 0..(length / step).round() as usize {
        let rate = book_flow(now, |_| 0.0);
        now = [now[0] + rate[0] * step, now[1] + rate[1] * step];
    }
    mirrored(now[0])
}

/// RK4 with steps so short that what is off is the symbol's.
fn extra_symbol(direction: DVec3, length: f64) -> DVec3 {
    const STEPS: usize = 2000;
    let h = length / STEPS as f64;
    let rate = |state: State| book_flow(state, |p| (-2.0 * p.z).exp());
    let along = |[p, v]: State, [dp, dv]: State, h: f64| [p + dp * h, v + dv * h];
    let mut now = [DVec3::ZERO, mirrored(direction)];
    for _ in 0..STEPS {
        let k1 = rate(now);
        let k2 = rate(along(now, k1, 0.5 * h));
        let k3 = rate(along(now, k2, 0.5 * h));
        let k4 = rate(along(now, k3, h));
        let sum = |i: usize| (k1[i] + k2[i] * 2.0 + k3[i] * 2.0 + k4[i]) * (h / 6.0);
        now = [now[0] + sum(0), now[1] + sum(1)];
    }
    mirrored(now[0])
}

/// Right as printed, and without digits where w is small: it divides by w².
fn nil_closed_form(bench: &mut Bench, on: On) -> Result<Reading, Trouble> {
    macro_rules! printed {
        ($float:ty, $direction:expr, $length:expr) => {{
            let [u, v, w, t] = [$direction.x, $direction.y, $direction.z, $length].map(|x| x as $float);
            let (c, alpha) = (u.hypot(v), v.atan2(u));
            let (x, y) =
                (c / w * ((w * t + alpha).sin() - alpha.sin()), -c / w * ((w * t + alpha).cos() - alpha.cos()));
            let z = t * (w + c * c / (2.0 * w))
                - c * c / (4.0 * w * w) * ((2.0 * w * t + 2.0 * alpha).sin() - (2.0 * alpha).sin())
                + c * c / (2.0 * w * w) * ((w * t + 2.0 * alpha).sin() - (2.0 * alpha).sin() - (t * w).sin());
            [x, y, z].map(|x| x as f64)
        }};
    }
    let model: &dyn Model = &NilReference;
    let Some(id) = GeometryId::from_name(model.name()) else { return Err(Trouble(String::from("no such geometry"))) };
    let starts: Vec<geodesic::Start> = [1e-1_f64, 1e-2, 1e-3, 1e-5, 1e-7, 1e-9]
        .into_iter()
        .flat_map(|w| [1.0, -1.0, 5.0].map(|length| (w, length)))
        .map(|(w, length)| {
            let c = (1.0 - w * w).sqrt();
            geodesic::Start { from: [0.0; 4], direction: [0.6 * c, 0.8 * c, w, 0.0], length }
        })
        .collect();
    let mut worst = [0.0_f64; 2];
    for (start, end) in starts.iter().zip(geodesic::ends(bench, on, id, &starts)?) {
        let exact: BigGeodesic = model.flow(&model.settle(start.from, start.direction), &Big::new(start.length));
        let v = DVec4::from_array(start.direction);
        let book = if on == On::Cpu { printed!(f64, v, start.length) } else { printed!(f32, v, start.length) };
        let ours = end.map_or(f64::INFINITY, |end| distance(&exact.point, &end.point.to_array()[..3]));
        worst = [worst[0].max(ours), worst[1].max(distance(&exact.point, &book))];
    }
    // A rounding of a length of 5, ten times.
    let limit = 100.0 * on.rounding();
    Ok(Reading { printed: Some(worst[1]), ..Reading::new(worst[0], limit) })
}

// --- faces --------------------------------------------------------------------------------------------

/// Rays from inside of the cube through x = 1 or y = 1, by the book's single branch of the inverse function.
fn crossings(bench: &mut Bench, on: On, axis: usize) -> Result<Reading, Trouble> {
    let Some(id) = GeometryId::from_name(NilReference.name()) else {
        return Err(Trouble(String::from("no such geometry")));
    };
    let plane = [DVec4::new(1.0, 0.0, 0.0, -1.0), DVec4::new(0.0, 1.0, 0.0, -1.0)][axis];
    let mut random = Random(51);
    let (mut rays, mut truths, mut printed) = (Vec::new(), Vec::new(), 0);
    while rays.len() < 2000 {
        let (p, v) = (random.vector(0.5) + 0.5, random.direction());
        let (c, alpha, w) = (v.x.hypot(v.y), v.y.atan2(v.x), v.z);
        let to_go = 1.0 - p[axis];
        // sin(wt + α) for x, cos(wt + α) for y.
        let level = if axis == 0 { to_go * w / c + alpha.sin() } else { alpha.cos() - to_go * w / c };
        let angle = if axis == 0 { level.asin() } else { level.acos() };
        // Left out: rays that graze the plane, for which single precision cannot tell.
        let slope = if axis == 0 { angle.cos() } else { angle.sin() };
        if level.abs() < 1.0 && (slope.abs() < 0.1 || w.abs() < 1e-3) || (level.abs() - 1.0).abs() < 0.05 {
            continue;
        }
        let truth = if level.abs() >= 1.0 {
            f64::INFINITY
        } else {
            let branches = if axis == 0 { [angle, PI - angle] } else { [angle, -angle] };
            let turns = (-4..=4).map(|turn| TAU * f64::from(turn));
            let times = turns.flat_map(|turn| branches.map(|branch| (branch + turn - alpha) / w));
            times.filter(|t| *t > 0.0).fold(f64::INFINITY, f64::min)
        };
        let book = (angle - alpha) / w;
        printed += usize::from(truth.is_finite() && ((book - truth).abs() > 1e-6 || book.is_nan()));
        rays.push(Geodesic { point: p.extend(1.0), velocity: v.extend(0.0) });
        truths.push(truth);
    }
    let found: Vec<f64> = match on {
        On::Cpu => rays.iter().map(|ray| Nil.length(*ray, Nil.exit(*ray, plane, f64::INFINITY))).collect(),
        _ => {
            let single = |v: DVec4| v.as_vec4().to_array();
            let input = |g: &Geodesic| ProbeIn {
                a: single(g.point),
                b: single(g.velocity),
                c: single(plane),
                t: f32::INFINITY,
                op: PROBE_EXIT,
            };
            let inputs: Vec<ProbeIn> = rays.iter().map(input).collect();
            let outputs = bench.probe(id, &inputs)?;
            outputs.iter().zip(&rays).map(|(out, ray)| Nil.length(*ray, f64::from(out.a[0]))).collect()
        }
    };
    let tolerance = if on == On::Cpu { 1e-9 } else { 1e-3 };
    let same = |a: f64, b: f64| a == b || (a - b).abs() < tolerance * (1.0 + b);
    let wrong = found.iter().zip(&truths).filter(|(found, truth)| !same(**found, **truth)).count();
    let share = |count: usize| count as f64 / rays.len() as f64;
    Ok(Reading { printed: Some(share(printed)), ..Reading::new(share(wrong), 0.0) })
}

/// Where the corners of faces go, with the pairings of the space and with a turn that is half as wide.
struct Corners<'a>(&'a crate::space::Space);

impl Visitor for Corners<'_> {
    type Output = [f64; 2];
    fn visit<G: Geometry>(self, geometry: G) -> [f64; 2] {
        let Ok(cell) = Polyhedron::new(&self.0.cells[0]) else { return [f64::NAN; 2] };
        let mut worst = [0.0_f64; 2];
        for (id, face) in self.0.faces() {
            let axis = face.plane.truncate().normalize();
            let turned = DMat4::from_axis_angle(-axis, -0.3 * PI);
            for (which, pairing) in [face.pairing.linear, face.pairing.linear * turned].into_iter().enumerate() {
                for &corner in &cell.face_vertices[id.face] {
                    let Some(point) = geometry.unchart(cell.vertices[corner]) else { return [f64::NAN; 2] };
                    let state = Geodesic { point, velocity: DVec4::ZERO };
                    let image = geometry.chart(geometry.apply(&Isometry::linear(pairing), state).point);
                    let corners = cell.face_vertices[face.partner.face].iter().map(|c| cell.vertices[*c]);
                    let nearest = corners.map(|corner| corner.distance(image)).fold(f64::INFINITY, f64::min);
                    worst[which] = worst[which].max(nearest);
                }
            }
        }
        worst
    }
}

/// How far rays are outside of the domain after the pairings that bring them in, and after the first of them alone.
struct Once<'a>(&'a crate::space::Space);

impl Visitor for Once<'_> {
    type Output = [f64; 2];
    fn visit<G: Geometry>(self, geometry: G) -> [f64; 2] {
        let domain = Domain::new(self.0);
        let outside = |cell: usize, point: DVec4| {
            let sides = domain.cells[cell].clone().map(|face| geometry.side(point, domain.faces[face].plane));
            sides.fold(0.0, f64::max)
        };
        let mut worst = [0.0_f64; 2];
        for ray in super::walk::rays(geometry, self.0, 200, 52) {
            // The point where the ray leaves, moved out by a hair.
            let mut path = Path::new(ray.1, ray.0, f64::INFINITY);
            super::walk::to_the_end(geometry, &domain, &mut path, 0);
            let beyond = geometry.flow(path.state, 1e-9);
            let Some(face) = violated_face(geometry, &domain, path.cell, beyond.point) else { continue };
            let once = geometry.apply(&domain.faces[face].pairing, beyond);
            worst[1] = worst[1].max(outside(domain.faces[face].cell, once.point));
            let frame = Frame { cell: path.cell, point: beyond.point, axes: [beyond.velocity; 3] };
            let reduced = reduce_frame(geometry, &domain, frame);
            worst[0] = worst[0].max(reduced.map_or(f64::INFINITY, |frame| outside(frame.cell, frame.point)));
        }
        worst
    }
}
