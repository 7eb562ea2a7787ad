//! Hits on curved geodesics, and balls and tubes as triangles.
//!
//! Two geometries are made for the purpose. [`Faceted`] is a geometry without its quadrics, so that its balls and tubes
//! are triangles, to be compared with the quadrics. [`Sheared`] is Euclidean space in the chart
//! `(x + s(y) + s(z), y, z)` with a cubic s, in which geodesics are cubic curves and everything else has a closed form.

use crate::{laws::broken, support::Random};
use glam::{DMat4, DVec2, DVec3, DVec4};
use holonomy::{
    geometry::{
        ALONG_FACE, E3, Elementary, Geodesic, Geometry, H3, Isometry, ON_FACE, Quadric, Real, Real3, RealGeodesic, S3,
        Segment, exponential,
    },
    render::{
        Shot,
        cpu::{
            surface::{Surface, refine},
            traverse::Tracer,
        },
        plan::{Feature, Plan},
        world::{
            World, WorldError,
            tessellate::{self, DEVIATION},
        },
    },
    scene::{Scene, Shape, file, folder::Folder},
    space::walk::{Path, Status, deviation_at},
};

macro_rules! as_in {
    ($($name:ident($($arg:ident: $type:ty),*) $(-> $result:ty)?;)*) => {
        $(fn $name(&self, $($arg: $type),*) $(-> $result)? {
            self.0.$name($($arg),*)
        })*
    };
}

/// Everything that has nothing to do with the chart.
macro_rules! as_in_the_model {
    () => {
        as_in! {
            components() -> usize;
            base() -> DVec4;
            settle(components: DVec4) -> Option<DVec4>;
            settle_tangent(p: DVec4, components: DVec4) -> DVec4;
            inner(p: DVec4, u: DVec4, v: DVec4) -> f64;
            norm(p: DVec4, v: DVec4) -> f64;
            frame(p: DVec4) -> [DVec4; 3];
            log(p: DVec4, q: DVec4) -> (DVec4, f64);
            closeness(p: DVec4, q: DVec4) -> f64;
            transport(g: Geodesic, t: f64, w: DVec4) -> DVec4;
            area_density(g: Geodesic, t: f64) -> f64;
            length(g: Geodesic, u: f64) -> f64;
            parameter_at(g: Geodesic, t: f64) -> f64;
            advance(g: Geodesic, u: f64) -> Geodesic;
            restore(g: Geodesic) -> Geodesic;
            apply(m: &Isometry, g: Geodesic) -> Geodesic;
            compose(a: &Isometry, b: &Isometry) -> Isometry;
            inverse(m: &Isometry) -> Isometry;
            isometry_residual(m: &Isometry) -> f64;
        }
        fn flow_in<T: Elementary>(&self, g: RealGeodesic<T>, t: T) -> RealGeodesic<T> {
            self.0.flow_in(g, t)
        }
    };
}

/// A geometry without its quadrics.
#[derive(Clone, Copy)]
struct Faceted<G>(G);

impl<G: Geometry> Geometry for Faceted<G> {
    const STRAIGHT: bool = G::STRAIGHT;
    as_in_the_model!();
    as_in! {
        fold(plane: DVec4, pairing: &Isometry) -> Isometry;
        cross(folded: &Isometry, plane: DVec4, g: Geodesic) -> Geodesic;
        side(p: DVec4, plane: DVec4) -> f64;
        exit(g: Geodesic, plane: DVec4, reach: f64) -> f64;
        arc(g: Geodesic, u_max: f64, tolerance: f64) -> f64;
        parameter(g: Geodesic, c: DVec3) -> f64;
        chart(p: DVec4) -> DVec3;
        unchart(c: DVec3) -> Option<DVec4>;
        chart_vector(p: DVec4, v: DVec4) -> DVec3;
        unchart_vector(p: DVec4, dc: DVec3) -> DVec4;
        raise(p: DVec4, conormal: DVec3) -> DVec4;
        lower(p: DVec4, v: DVec4) -> DVec3;
        volume_density(c: DVec3) -> f64;
        bisector(q: DVec4) -> Option<DVec4>;
    }
    fn spray<T: Real>(&self, c: Real3<T>, v: Real3<T>) -> Real3<T> {
        self.0.spray(c, v)
    }
    fn ball(&self, _centre: DVec4, _radius: f64) -> Option<Quadric> {
        None
    }
    fn tube(&self, _axis: Geodesic, _radius: f64) -> Option<Quadric> {
        None
    }
}

/// Euclidean space in a chart in which geodesics are cubic curves; with `true` it denies that.
#[derive(Clone, Copy)]
struct Sheared<const STRAIGHT: bool>(E3);

/// The honest one.
const SHEARED: Sheared<false> = Sheared(E3);

/// Second and third derivative of [`shear`] at 0.
const SHEAR: [f64; 2] = [0.5, 0.7];

/// What the chart adds to x for each other coordinate, and its derivative.
fn shear(y: f64) -> [f64; 2] {
    [y * y * (SHEAR[0] / 2.0 + SHEAR[1] / 6.0 * y), y * (SHEAR[0] + SHEAR[1] / 2.0 * y)]
}

impl<const STRAIGHT: bool> Geometry for Sheared<STRAIGHT> {
    const STRAIGHT: bool = STRAIGHT;
    as_in_the_model!();

    fn side(&self, p: DVec4, plane: DVec4) -> f64 {
        plane.dot(self.chart(p).extend(1.0))
    }

    fn exit(&self, g: Geodesic, plane: DVec4, reach: f64) -> f64 {
        // A cubic: between the zeros of its derivative it is monotone.
        let (p, v) = (g.point.truncate(), g.velocity.truncate());
        let side = |t: f64| self.side((p + v * t).extend(1.0), plane);
        let rate = |t: f64| {
            let q = p + v * t;
            plane.truncate().dot(v) + plane.x * (shear(q.y)[1] * v.y + shear(q.z)[1] * v.z)
        };
        if side(0.0) >= -ON_FACE && rate(0.0) > ALONG_FACE {
            return 0.0;
        }
        let cubes = plane.x * SHEAR[1] * (v.y.powi(3) + v.z.powi(3)) / 2.0;
        let squares = plane.x * (SHEAR[0] * (v.y * v.y + v.z * v.z) + SHEAR[1] * (p.y * v.y * v.y + p.z * v.z * v.z));
        let root = (squares * squares - 4.0 * cubes * rate(0.0)).sqrt();
        let turns = [(-squares - root) / (2.0 * cubes), (-squares + root) / (2.0 * cubes), -rate(0.0) / squares];
        let far = reach.min(100.0);
        let mut ends: Vec<f64> = turns.into_iter().filter(|t| *t > 0.0 && *t < far).chain([0.0, far]).collect();
        ends.sort_by(f64::total_cmp);
        for span in ends.windows(2) {
            let (mut low, mut high) = (span[0], span[1]);
            if side(low) < 0.0 && side(high) >= 0.0 {
                for _ in 0..100 {
                    let middle = 0.5 * (low + high);
                    if side(middle) < 0.0 { low = middle } else { high = middle }
                }
                return high;
            }
        }
        f64::INFINITY
    }

    fn arc(&self, g: Geodesic, u_max: f64, tolerance: f64) -> f64 {
        let third = SHEAR[1] * (g.velocity.y.powi(3) + g.velocity.z.powi(3)).abs();
        (96.0 * tolerance / third).cbrt().min(u_max)
    }

    fn parameter(&self, g: Geodesic, c: DVec3) -> f64 {
        self.unchart(c).map_or(0.0, |p| (p - g.point).dot(g.velocity))
    }

    fn chart(&self, p: DVec4) -> DVec3 {
        DVec3::new(p.x + shear(p.y)[0] + shear(p.z)[0], p.y, p.z)
    }

    fn unchart(&self, c: DVec3) -> Option<DVec4> {
        Some(DVec4::new(c.x - shear(c.y)[0] - shear(c.z)[0], c.y, c.z, 1.0))
    }

    fn chart_vector(&self, p: DVec4, v: DVec4) -> DVec3 {
        DVec3::new(v.x + shear(p.y)[1] * v.y + shear(p.z)[1] * v.z, v.y, v.z)
    }

    fn unchart_vector(&self, p: DVec4, dc: DVec3) -> DVec4 {
        DVec4::new(dc.x - shear(p.y)[1] * dc.y - shear(p.z)[1] * dc.z, dc.y, dc.z, 0.0)
    }

    fn spray<T: Real>(&self, c: Real3<T>, v: Real3<T>) -> Real3<T> {
        let number = T::from_f64;
        let part = |y: T, v: T| (number(SHEAR[0]) + number(SHEAR[1]) * y) * v * v;
        Real3::new(part(c.y, v.y) + part(c.z, v.z), number(0.0), number(0.0))
    }

    fn raise(&self, p: DVec4, n: DVec3) -> DVec4 {
        DVec3::new(n.x, n.y + shear(p.y)[1] * n.x, n.z + shear(p.z)[1] * n.x).normalize().extend(0.0)
    }

    fn lower(&self, p: DVec4, v: DVec4) -> DVec3 {
        DVec3::new(v.x, v.y - shear(p.y)[1] * v.x, v.z - shear(p.z)[1] * v.x)
    }

    fn volume_density(&self, _c: DVec3) -> f64 {
        1.0
    }

    fn bisector(&self, _q: DVec4) -> Option<DVec4> {
        None
    }

    fn ball(&self, _centre: DVec4, _radius: f64) -> Option<Quadric> {
        None
    }

    fn tube(&self, _axis: Geodesic, _radius: f64) -> Option<Quadric> {
        None
    }
}

#[test]
fn hits_test_geometries_obey_the_laws() {
    let wrong = broken(SHEARED, &[]);
    assert!(wrong.is_empty(), "sheared:\n{}", wrong.join("\n"));
    let turn = Isometry::linear(DMat4::from_rotation_z(0.3));
    let wrong = broken(Faceted(E3), &[turn]);
    assert!(wrong.is_empty(), "faceted:\n{}", wrong.join("\n"));
}

// --- refinement -----------------------------------------------------------------------------------

/// A geodesic of the sheared space with a plane of the chart that its arc of length `h` passes, and their values.
struct Crossing {
    start: Geodesic,
    plane: DVec4,
    h: f64,
}

impl Crossing {
    /// The plane passes through a point of the curve and is not nearly parallel to it.
    fn new(random: &mut Random, h: f64) -> Self {
        loop {
            let mut vector = || DVec3::from_array(std::array::from_fn(|_| random.within(-1.0, 1.0)));
            let (p, v, n) = (vector(), vector().normalize(), vector().normalize());
            let start = Geodesic { point: p.extend(1.0), velocity: v.extend(0.0) };
            let through = SHEARED.chart(E3.flow(start, random.within(0.3, 0.7) * h).point);
            let crossing = Self { start, plane: n.extend(-n.dot(through)), h };
            if (crossing.value(h) - crossing.value(0.0)).abs() > 0.3 * h && v.x.abs() < 0.6 {
                return crossing;
            }
        }
    }

    fn value(&self, u: f64) -> f64 {
        SHEARED.side(E3.flow(self.start, u).point, self.plane)
    }

    /// The arc's own hit, and the rate of the plane's form along it.
    fn arc_hit(&self) -> (f64, f64) {
        let (arc, _) = Segment::along(SHEARED, self.start, self.h);
        let s = self.root(|s| self.plane.dot(arc.at(s).extend(1.0)));
        (s * self.h, self.plane.truncate().dot(arc.tangent(s)) / self.h)
    }

    /// The true parameter.
    fn truth(&self) -> f64 {
        self.root(|s| self.value(s * self.h)) * self.h
    }

    /// Where a function changes its sign between 0 and 1.
    fn root(&self, value: impl Fn(f64) -> f64) -> f64 {
        let (mut low, mut high) = (0.0, 1.0);
        let sign = value(0.0).signum();
        for _ in 0..200 {
            let middle = 0.5 * (low + high);
            if value(middle).signum() == sign { low = middle } else { high = middle }
        }
        0.5 * (low + high)
    }

    fn error(&self, steps: usize) -> f64 {
        let (start, rate) = self.arc_hit();
        (refine(|u| self.value(u), start, rate, self.h, steps) - self.truth()).abs()
    }
}

/// The start is off by h³; the slope there is off by h², so the first step by h⁵ (in f64 no further).
#[test]
fn hits_refinement_has_its_order() {
    let median = |h: f64, steps: usize| -> f64 {
        let mut random = Random(1902);
        let mut errors: Vec<f64> = (0..2001).map(|_| Crossing::new(&mut random, h).error(steps)).collect();
        errors.sort_by(f64::total_cmp);
        errors[1000].ln()
    };
    for (steps, order) in [(0, 3.0), (1, 5.0)] {
        // Large arcs, for errors that soon drown in rounding.
        let (coarse, fine) = (0.4, 0.2);
        let measured = (median(coarse, steps) - median(fine, steps)) / 2.0_f64.ln();
        println!("{steps} steps: order {measured:.2}, median error at h = {fine}: {:.1e}", median(fine, steps).exp());
        assert!((measured - order).abs() < 0.35, "{steps} steps: order {measured} instead of {order}");
    }
}

#[test]
fn hits_refined_hits_lie_on_surface_and_curve() {
    let mut random = Random(7);
    let worst = |steps: usize, random: &mut Random| -> f64 {
        (0..2000).map(|_| Crossing::new(random, 0.1).error(steps)).fold(0.0, f64::max)
    };
    let after_four = worst(4, &mut random);
    assert!(after_four < 1e-14, "{after_four:e}");
    // The arc's own hit could be seen.
    assert!(worst(0, &mut random) > 1e-6);
}

/// Curves that miss a surface which their arc touches, forms without slope, ranges without length: an answer in the
/// range, never farther from the surface than the start.
#[test]
fn hits_refinement_never_leaves_its_range() {
    let mut random = Random(11);
    for _ in 0..20_000 {
        let [a, b, c] =
            std::array::from_fn(|_| random.within(-1.0, 1.0) * 10.0_f64.powi((random.next() * 8.0) as i32 - 6));
        let value = |u: f64| (a * u + b) * u + c;
        let end = if random.next() < 0.1 { 0.0 } else { random.within(1e-9, 1.0) };
        let start = random.within(-0.1, 1.1);
        let rate = if random.next() < 0.1 { 0.0 } else { random.within(-1.0, 1.0) };
        let u = refine(value, start, rate, end, 4);
        assert!((0.0..=end).contains(&u), "{u} of {end}");
        assert!(value(u).abs() <= value(start.clamp(0.0, end)).abs());
    }
    for form in [0.0, 1.0, f64::NAN, f64::INFINITY] {
        assert!((0.0..=1.0).contains(&refine(|_| form, 0.5, 1.0, 1.0, 4)), "{form}");
    }
}

// --- pictures of triangles against quadrics -------------------------------------------------------

const SIZE: [u32; 2] = [96, 72];

fn scene(text: &str) -> Scene {
    let common = "[[material]]\nname = \"m\"\n";
    file::read("test.toml", format!("{text}{common}").as_bytes(), &Folder::Embedded).unwrap_or_else(|e| panic!("{e}"))
}

/// What each pixel shows: the path's end and the surface there.
fn trace<G: Geometry>(geometry: G, scene: &Scene) -> Vec<(Path, Option<Surface>)> {
    let plan = Plan::new(scene, false).keep(&[Feature::Meshes, Feature::Quadrics]);
    let world = World::in_geometry(geometry, scene, &plan, scene.observer.frame).expect("the world fits");
    let shot = Shot::symmetric(scene.observer.frame, scene.observer.fov, SIZE);
    let tracer = Tracer::new(geometry, &world, &shot);
    let pixel = |i: u32| [f64::from(i % SIZE[0]) + 0.5, f64::from(i / SIZE[0]) + 0.5];
    (0..SIZE[0] * SIZE[1]).map(|i| tracer.path(tracer.geodesic(pixel(i)), &mut Default::default(), |_, _| ())).collect()
}

/// How two pictures of the same surfaces of this radius differ: share of pixels that show something else, and over the
/// others the largest distance along the normal in units of the radius, and the largest angle of normals.
fn compare<G: Geometry>(
    geometry: G,
    radius: f64,
    a: &[(Path, Option<Surface>)],
    b: &[(Path, Option<Surface>)],
) -> (f64, f64, f64) {
    let (mut other, mut off, mut angle) = (0, 0.0_f64, 0.0_f64);
    for ((path, surface), (path2, surface2)) in a.iter().zip(b) {
        let (Some(s), Some(t)) = (surface, surface2) else {
            other += usize::from(surface.is_some() != surface2.is_some());
            continue;
        };
        let cosine = geometry.inner(path.state.point, path.state.velocity, s.normal).abs();
        let along = (path.travelled - path2.travelled).abs();
        // Past an outline the other surface is behind the first one; next to it the wall is seen too steeply.
        if s.object != t.object || path.bounces != path2.bounces || along > radius || cosine < 0.15 {
            other += usize::from(cosine >= 0.15);
            continue;
        }
        off = off.max(along * cosine / radius);
        angle = angle.max(geometry.inner(path.state.point, s.normal, t.normal).clamp(-1.0, 1.0).acos());
    }
    (other as f64 / a.len() as f64, off, angle)
}

const ROUND: [(&str, f64); 5] = [
    (
        "[space]\nmanifold = \"torus\"\n[observer]\nposition = [0.5, 0.5, 0.9]\n[[object]]\nkind = \"ball\"\nposition = [1, 0.6, 0.4]\nradius = 0.2\nmaterial = \"m\"\n",
        0.2,
    ),
    (
        "[space]\nmanifold = \"torus\"\n[observer]\nposition = [0.5, 0.4, 0.6]\n[[object]]\nkind = \"domain-edges\"\nradius = 0.05\nmaterial = \"m\"\n",
        0.05,
    ),
    (
        "[space]\nmanifold = \"poincare\"\n[observer]\nposition = [0, 0, 0.1, 1]\n[[object]]\nkind = \"domain-edges\"\nradius = 0.02\nmaterial = \"m\"\n",
        0.02,
    ),
    (
        "[space]\nmanifold = \"seifert-weber\"\n[observer]\nposition = [0, 0, 0.1, 1]\n[[object]]\nkind = \"domain-edges\"\nradius = 0.06\nmaterial = \"m\"\n",
        0.06,
    ),
    (
        "[space]\nmanifold = \"seifert-weber\"\n[observer]\nposition = [0, 0, 0.5, 1]\n[[object]]\nkind = \"tube\"\nposition = [0.1, 0, 0, 1]\nlook = [0.4, 1, -0.3]\nradius = 0.2\nlength = 1.5\nmaterial = \"m\"\n",
        0.2,
    ),
];

#[test]
fn hits_triangles_show_the_quadrics() {
    for (text, radius) in ROUND {
        let mut scene = scene(text);
        scene.settings.bounces = 2;
        let (other, off, angle) = match scene.space.geometry.name() {
            "e3" => compare(E3, radius, &trace(E3, &scene), &trace(Faceted(E3), &scene)),
            "s3" => compare(S3, radius, &trace(S3, &scene), &trace(Faceted(S3), &scene)),
            _ => compare(H3, radius, &trace(H3, &scene), &trace(Faceted(H3), &scene)),
        };
        println!(
            "{}, radius {radius}: {other:.4} of the pixels, {off:.1e} of the radius, {angle:.1e} rad",
            scene.space.name
        );
        assert!(other < 0.004, "{other} of the pixels show something else");
        assert!(off < 1.2 * DEVIATION, "{off} of the radius");
        assert!(angle < 0.05, "normals differ by {angle}");
    }
}

#[test]
fn hits_wrong_triangles_are_caught() {
    let good = scene(ROUND[0].0);
    let mut bad = good.clone();
    let Shape::Ball { radius } = &mut bad.objects[0].shape else { panic!("a ball") };
    *radius *= 1.0 + 3.0 * DEVIATION;
    let (_, off, _) = compare(E3, 0.2, &trace(E3, &good), &trace(Faceted(E3), &bad));
    assert!(off > 1.2 * DEVIATION, "{off}");
}

/// The sheared space shows what Euclidean space shows: a ball and a tube, with many arcs to each.
#[test]
fn hits_chart_shows_the_same_picture() {
    let mut scene = scene(
        "[space]\ngeometry = \"e3\"\n[observer]\nposition = [0.1, 0.2, 1.5]\nlook = [0, 0, -1]\nfov = 60\n\
         [[object]]\nkind = \"ball\"\nposition = [0.4, 0.1, -0.5]\nradius = 0.5\nmaterial = \"m\"\n\
         [[object]]\nkind = \"tube\"\nposition = [-1, -1, -0.5]\nlook = [0.3, 1, 0.2]\nradius = 0.2\nlength = 2\nmaterial = \"m\"\n",
    );
    let straight = trace(E3, &scene);
    // Of pixels of 0.014 rad a share small enough for the comparison.
    scene.settings.tolerance = 0.02;
    let sheared = trace(SHEARED, &scene);
    let (other, off, angle) = compare(E3, 0.2, &straight, &sheared);
    let arcs: u32 = sheared.iter().map(|(path, _)| path.segments).sum();
    let arcs = f64::from(arcs) / sheared.len() as f64;
    println!("{other:.4} of the pixels, {off:.1e} of the radius, {angle:.1e} rad, {arcs:.1} arcs");
    // The ball is 2.5 times as large.
    assert!(other < 0.01 && off < 1.2 * 2.5 * DEVIATION && angle < 0.05);
    assert!(arcs > 5.0, "arcs are walked");

    // Hits are on the curve, whatever the arc: at the distance along the pixel's ray that its own point has.
    let off_ray = |pixels: &[(Path, Option<Surface>)]| {
        let eye = scene.observer.frame.point;
        let hits = pixels.iter().filter(|(path, _)| path.status == Status::Hit);
        hits.map(|(path, _)| (E3.distance(eye, path.state.point) - path.travelled).abs()).fold(0.0, f64::max)
    };
    // And on the surface: all but those at outlines, where an arc half a pixel away meets another triangle.
    let off_surface = |pixels: &[(Path, Option<Surface>)]| {
        let near = straight.iter().zip(pixels).filter(|((a, _), (b, _))| {
            a.status == Status::Hit && b.status == Status::Hit && (a.travelled - b.travelled).abs() > 1.5 * DEVIATION
        });
        near.count() as f64 / pixels.len() as f64
    };
    scene.settings.tolerance = 0.5;
    let (refined, unrefined) = (trace(SHEARED, &scene), trace(Sheared::<true>(E3), &scene));
    let (good, bad) = (off_surface(&refined), off_surface(&unrefined));
    println!("off the surface: {good:.4} of the hits, {bad:.4} without refinement");
    assert!(off_ray(&refined) < 1e-12);
    assert!(good < 0.02 && bad > 3.0 * good, "{good} and {bad}");
}

// --- triangles of balls and tubes -----------------------------------------------------------------

/// Largest deviation of points of the triangles from the radius, in units of it.
fn deviation<G: Geometry>(
    geometry: G,
    surface: &tessellate::Surface,
    radius: f64,
    distance: impl Fn(DVec4) -> f64,
) -> f64 {
    let mut random = Random(5);
    let mut worst = 0.0_f64;
    for corners in &surface.triangles {
        let [a, b, c] = corners.map(|i| geometry.chart(surface.placed[i as usize].point));
        let weights = DVec2::new(random.next(), random.next());
        let weights = if weights.x + weights.y > 1.0 { DVec2::ONE - weights } else { weights };
        let point = geometry.unchart(a + (b - a) * weights.x + (c - a) * weights.y).expect("in the chart");
        worst = worst.max((distance(point) / radius - 1.0).abs());
    }
    worst
}

fn deviations<G: Geometry>(geometry: G) -> Vec<(String, usize, f64)> {
    let base = geometry.base();
    let [x, y, z] = geometry.frame(base);
    let mut found = Vec::new();
    for radius in [0.02, 0.3, 0.7] {
        let centre = exponential(geometry, base, x * 0.2 + y * 0.1);
        let ball = tessellate::ball(geometry, centre, radius).expect("in reach");
        let worst = deviation(geometry, &ball, radius, |p| geometry.distance(centre, p));
        found.push((format!("ball of {radius}"), ball.triangles.len(), worst));
    }
    for radius in [0.02, 0.2] {
        let start = Geodesic { point: base, velocity: z * 0.6 + y * 0.8 };
        let length = 0.9;
        let tube = tessellate::tube(geometry, |t| geometry.flow(start, t * length), radius).expect("in reach");
        // Distance from the axis, by golden section along it.
        let to_axis = |p: DVec4| {
            let at = |t: f64| geometry.distance(p, geometry.flow(start, t).point);
            let (mut low, mut high) = (-0.2, length + 0.2);
            let golden = 0.618_033_988_749_894_9;
            for _ in 0..60 {
                let (a, b) = (high - golden * (high - low), low + golden * (high - low));
                if at(a) < at(b) { high = b } else { low = a }
            }
            at(0.5 * (low + high))
        };
        found.push((format!("tube of {radius}"), tube.triangles.len(), deviation(geometry, &tube, radius, to_axis)));
    }
    found
}

#[test]
fn hits_triangles_deviate_as_stated() {
    let all =
        [("e3", deviations(E3)), ("s3", deviations(S3)), ("h3", deviations(H3)), ("sheared", deviations(SHEARED))];
    for (name, found) in all {
        for (what, triangles, worst) in found {
            println!("{name}: {what}: {triangles} triangles, off by {worst:.1e} of the radius");
            assert!(worst < 1.2 * DEVIATION, "{name}, {what}: {worst}");
            // Not finer than it has to be either.
            assert!(worst > 0.1 * DEVIATION, "{name}, {what}: {worst}");
        }
    }
}

#[test]
fn hits_radius_beyond_the_exponential_map_is_refused() {
    let scene = |manifold: &str, kind: &str, radius: f64| {
        scene(&format!(
            "[space]\nmanifold = \"{manifold}\"\n[[object]]\nname = \"big one\"\nkind = \"{kind}\"\nradius = {radius}\nmaterial = \"m\"\n{}",
            if kind == "tube" { "length = 0.2\n" } else { "" }
        ))
    };
    // Geodesics of the sphere meet again after π, those normal to a geodesic after π/2; the chart ends there, too.
    for (kind, radius) in [("ball", 3.2), ("ball", 1.6), ("tube", 1.6)] {
        let scene = scene("poincare", kind, radius);
        let plan = Plan::new(&scene, false).keep(&[Feature::Meshes]);
        let error = World::in_geometry(Faceted(S3), &scene, &plan, scene.observer.frame).expect_err("too wide");
        assert!(matches!(error, WorldError::TooWide(..)), "{error}");
        assert!(error.to_string().starts_with(&format!("big one: the radius {radius} is too large here")), "{error}");
    }
    let fits = scene("poincare", "ball", 0.2);
    let plan = Plan::new(&fits, false).keep(&[Feature::Meshes]);
    assert!(World::in_geometry(Faceted(S3), &fits, &plan, fits.observer.frame).is_ok());
}

// --- the tolerance of arcs ------------------------------------------------------------------------

/// Seen from the source no point of an arc is farther from the curve than the tolerance, however near it is, and arcs are
/// not shorter than that needs: their number is compared with that of arcs that use the angle up, found by halving.
#[test]
fn hits_arcs_keep_the_angle_from_the_first_on() {
    let angle = 1e-4;
    // A curve with third derivative 1, and what the longest arc by the bound and the best arc make of it.
    let worst_angle = |travelled: f64, h: f64| -> f64 {
        let off = |s: f64| s * (h - s) * (h - 2.0 * s).abs() / 12.0;
        (1..200).map(|k| h * f64::from(k) / 200.0).map(|s| off(s) / (travelled + s)).fold(0.0, f64::max) / angle
    };
    let walk = |length: &dyn Fn(f64) -> f64| {
        let (mut travelled, mut count, mut worst) = (0.0, 0, 0.0_f64);
        while travelled < 2.0 {
            let h = length(travelled);
            worst = worst.max(worst_angle(travelled, h));
            travelled += h;
            count += 1;
        }
        (count, worst)
    };
    let (count, worst) = walk(&|travelled| (96.0 * deviation_at(travelled, angle)).cbrt());
    let (least, most) = walk(&|travelled| {
        let (mut low, mut high) = (0.0, 10.0);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if worst_angle(travelled, middle) <= 1.0 { low = middle } else { high = middle }
        }
        low
    });
    println!("{count} arcs, worst angle {worst:.3} of the tolerance; {least} arcs use {most:.3} of it");
    assert!(worst <= 1.0 + 1e-9, "{worst}");
    assert!(f64::from(count) < 1.5 * f64::from(least), "{count} arcs instead of {least}");
}
