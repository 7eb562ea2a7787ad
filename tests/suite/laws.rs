//! The laws of every registered geometry, and geometries spoilt in one function, which must break a law.

use crate::support;
use glam::{DMat4, DVec3, DVec4};
use holonomy::geometry::laws::{laws, samples};
use holonomy::geometry::{
    Elementary, GEOMETRIES, Geodesic, Geometry, GeometryId, Isometry, Quadric, Real, Real3, RealGeodesic, Visitor,
    visit,
};

/// Seed of all samples; change it to look elsewhere.
const SEED: u64 = 20_210_415;

/// Samples of each law.
const COUNT: usize = 400;

/// Isometries of the geometry.
fn isometries(id: GeometryId) -> Vec<Isometry> {
    support::isometries(id).into_iter().map(|(pairing, ..)| pairing).collect()
}

/// Which of the functions that not every geometry has are missing in this one.
fn missing(id: GeometryId) -> Vec<&'static str> {
    struct Missing;
    impl Visitor for Missing {
        type Output = Vec<&'static str>;
        fn visit<G: Geometry>(self, geometry: G) -> Self::Output {
            let base = geometry.base();
            let axis = Geodesic { point: base, velocity: geometry.frame(base)[0] };
            let there = [
                ("bisector", geometry.bisector(geometry.flow(axis, 1.0).point).is_some()),
                ("ball", geometry.ball(base, 0.5).is_some()),
                ("tube", geometry.tube(axis, 0.5).is_some()),
            ];
            there.iter().filter(|(_, there)| !there).map(|(name, _)| *name).collect()
        }
    }
    visit(id, Missing)
}

/// The laws that are broken, with the worst residual and the sample's number.
pub fn broken<G: Geometry>(geometry: G, isometries: &[Isometry]) -> Vec<String> {
    let samples = samples(geometry, SEED, COUNT, isometries);
    let mut broken = Vec::new();
    for law in laws::<G>() {
        let residuals =
            samples.iter().map(|s| (law.residual)(geometry, s)).map(|r| if r.is_nan() { f64::INFINITY } else { r });
        let (worst, residual) = residuals.enumerate().fold((0, 0.0), |worst, r| if r.1 > worst.1 { r } else { worst });
        if residual > law.tolerance {
            broken.push(format!("{}: {residual:.3e} at sample {worst} of seed {SEED}", law.name));
        }
    }
    broken
}

/// Runs all laws; spoilt copies are run where asked for.
struct Laws {
    id: GeometryId,
    spoilt: Option<&'static str>,
}

impl Visitor for Laws {
    type Output = Vec<String>;
    fn visit<G: Geometry>(self, geometry: G) -> Vec<String> {
        let isometries = isometries(self.id);
        match self.spoilt {
            None => broken(geometry, &isometries),
            Some(function) => broken(Spoilt { geometry, function }, &isometries),
        }
    }
}

macro_rules! laws_hold {
    ($($name:ident),*) => {
        $(#[test]
        fn $name() {
            let name = &stringify!($name).trim_start_matches("laws_of_").replace('_', "-");
            let id = GeometryId::from_name(name).expect("registered");
            assert!(!isometries(id).is_empty(), "no isometries of this geometry");
            let broken = visit(id, Laws { id, spoilt: None });
            assert!(broken.is_empty(), "{name}:\n{}", broken.join("\n"));
        })*

        #[test]
        fn laws_are_run_for_every_geometry() {
            let run = [$(stringify!($name)),*];
            for entry in GEOMETRIES {
                assert!(run.contains(&format!("laws_of_{}", entry.module).as_str()), "no line for {}", entry.name);
            }
        }
    };
}

laws_hold!(
    laws_of_e3,
    laws_of_s3,
    laws_of_h3,
    laws_of_s2xr,
    laws_of_h2xr,
    laws_of_nil,
    laws_of_sol,
    laws_of_sl2,
    laws_of_sl2_trace
);

#[test]
fn laws_catch_every_spoilt_function() {
    for entry in GEOMETRIES {
        let missing = missing(entry.id);
        for function in FUNCTIONS.iter().filter(|f| !missing.contains(f)) {
            let broken = visit(entry.id, Laws { id: entry.id, spoilt: Some(function) });
            assert!(!broken.is_empty(), "{}: nobody noticed a wrong {function}", entry.name);
        }
    }
}

#[test]
fn laws_can_all_be_broken() {
    for entry in GEOMETRIES {
        let broken: Vec<String> =
            FUNCTIONS.iter().flat_map(|f| visit(entry.id, Laws { id: entry.id, spoilt: Some(f) })).collect();
        let missing = missing(entry.id);
        for name in visit(entry.id, Names).into_iter().filter(|law| !missing.iter().any(|f| law.starts_with(f))) {
            assert!(broken.iter().any(|b| b.starts_with(name)), "{}: nothing breaks \"{name}\"", entry.name);
        }
    }
}

/// The names of all laws.
struct Names;

impl Visitor for Names {
    type Output = Vec<&'static str>;
    fn visit<G: Geometry>(self, _geometry: G) -> Self::Output {
        laws::<G>().iter().map(|law| law.name).collect()
    }
}

#[test]
fn laws_do_not_depend_on_the_wrapper() {
    for entry in GEOMETRIES {
        let broken = visit(entry.id, Laws { id: entry.id, spoilt: Some("nothing") });
        assert!(broken.is_empty(), "{}:\n{}", entry.name, broken.join("\n"));
    }
}

/// The functions of the contract, but for the number of components, which is nobody's result.
const FUNCTIONS: &[&str] = &[
    "base",
    "settle",
    "settle_tangent",
    "inner",
    "norm",
    "frame",
    "flow",
    "log",
    "transport",
    "closeness",
    "area_density",
    "length",
    "parameter_at",
    "advance",
    "side",
    "exit",
    "arc",
    "parameter",
    "restore",
    "chart",
    "unchart",
    "unchart_vector",
    "chart_vector",
    "spray",
    "raise",
    "lower",
    "volume_density",
    "apply",
    "fold",
    "cross",
    "compose",
    "inverse",
    "isometry_residual",
    "bisector",
    "ball",
    "tube",
];

/// A geometry with an error of 1e-5 in one function.
#[derive(Clone, Copy)]
struct Spoilt<G> {
    geometry: G,
    function: &'static str,
}

const ERROR: f64 = 1e-5;

impl<G> Spoilt<G> {
    fn scalar(&self, function: &str, x: f64) -> f64 {
        if self.function == function { x + ERROR * (1.0 + x.abs()) } else { x }
    }

    fn vector(&self, function: &str, v: DVec4) -> DVec4 {
        if self.function == function { v + DVec4::new(ERROR, -ERROR, 2.0 * ERROR, 0.0) } else { v }
    }

    fn spatial(&self, function: &str, v: DVec3) -> DVec3 {
        if self.function == function { v + DVec3::new(ERROR, -ERROR, 2.0 * ERROR) } else { v }
    }

    fn geodesic(&self, function: &str, g: Geodesic) -> Geodesic {
        Geodesic { point: g.point, velocity: self.vector(function, g.velocity) }
    }

    fn matrix(&self, function: &str, m: DMat4) -> DMat4 {
        let error = DMat4::from_cols(DVec4::X, DVec4::ZERO, DVec4::ZERO, DVec4::ZERO) * ERROR;
        if self.function == function { m + error } else { m }
    }

    fn quadric(&self, function: &str, mut quadric: Quadric) -> Quadric {
        quadric.forms[0] = self.vector(function, quadric.forms[0]);
        quadric
    }
}

impl<G: Geometry> Geometry for Spoilt<G> {
    const STRAIGHT: bool = G::STRAIGHT;
    fn components(&self) -> usize {
        self.geometry.components()
    }
    fn signature(&self) -> DVec3 {
        self.geometry.signature()
    }
    fn edge(&self, g: Geodesic, t: f64) -> Option<&'static str> {
        self.geometry.edge(g, t)
    }
    fn base(&self) -> DVec4 {
        self.vector("base", self.geometry.base())
    }
    fn settle(&self, components: DVec4) -> Option<DVec4> {
        self.geometry.settle(components).map(|p| self.vector("settle", p))
    }
    fn settle_tangent(&self, p: DVec4, components: DVec4) -> DVec4 {
        self.vector("settle_tangent", self.geometry.settle_tangent(p, components))
    }
    fn inner(&self, p: DVec4, u: DVec4, v: DVec4) -> f64 {
        self.scalar("inner", self.geometry.inner(p, u, v))
    }
    fn norm(&self, p: DVec4, v: DVec4) -> f64 {
        self.scalar("norm", self.geometry.norm(p, v))
    }
    fn frame(&self, p: DVec4) -> [DVec4; 3] {
        let [a, b, c] = self.geometry.frame(p);
        [a, self.vector("frame", b), c]
    }
    fn flow_in<T: Elementary>(&self, g: RealGeodesic<T>, t: T) -> RealGeodesic<T> {
        RealGeodesic::from_f64(self.geodesic("flow", self.geometry.flow_in(g, t).to_f64()))
    }
    fn log(&self, p: DVec4, q: DVec4) -> (DVec4, f64) {
        let (direction, length) = self.geometry.log(p, q);
        (direction, self.scalar("log", length))
    }
    fn closeness(&self, p: DVec4, q: DVec4) -> f64 {
        // An error that is the same everywhere, or an infinity with an error, would break no law.
        let closeness = self.geometry.closeness(p, q);
        match self.function == "closeness" {
            true if closeness.is_infinite() => p.x,
            true => self.scalar("closeness", closeness) + ERROR * p.x,
            false => closeness,
        }
    }
    fn transport(&self, g: Geodesic, t: f64, w: DVec4) -> DVec4 {
        self.vector("transport", self.geometry.transport(g, t, w))
    }
    fn area_density(&self, g: Geodesic, t: f64) -> f64 {
        self.scalar("area_density", self.geometry.area_density(g, t))
    }
    fn length(&self, g: Geodesic, u: f64) -> f64 {
        self.scalar("length", self.geometry.length(g, u))
    }
    fn parameter_at(&self, g: Geodesic, t: f64) -> f64 {
        self.scalar("parameter_at", self.geometry.parameter_at(g, t))
    }
    fn advance(&self, g: Geodesic, u: f64) -> Geodesic {
        self.geodesic("advance", self.geometry.advance(g, u))
    }
    fn side(&self, p: DVec4, plane: DVec4) -> f64 {
        self.scalar("side", self.geometry.side(p, plane))
    }
    fn exit(&self, g: Geodesic, plane: DVec4, reach: f64) -> f64 {
        self.scalar("exit", self.geometry.exit(g, plane, reach))
    }
    fn arc(&self, g: Geodesic, u_max: f64, tolerance: f64) -> f64 {
        self.scalar("arc", self.geometry.arc(g, u_max, tolerance))
    }
    fn parameter(&self, g: Geodesic, c: DVec3) -> f64 {
        self.scalar("parameter", self.geometry.parameter(g, c))
    }
    fn restore(&self, g: Geodesic) -> Geodesic {
        self.geodesic("restore", self.geometry.restore(g))
    }
    fn chart(&self, p: DVec4) -> DVec3 {
        self.spatial("chart", self.geometry.chart(p))
    }
    fn unchart(&self, c: DVec3) -> Option<DVec4> {
        self.geometry.unchart(c).map(|p| self.vector("unchart", p))
    }
    fn chart_vector(&self, p: DVec4, v: DVec4) -> DVec3 {
        self.spatial("chart_vector", self.geometry.chart_vector(p, v))
    }
    fn unchart_vector(&self, p: DVec4, dc: DVec3) -> DVec4 {
        self.vector("unchart_vector", self.geometry.unchart_vector(p, dc))
    }
    fn spray<T: Real>(&self, c: Real3<T>, v: Real3<T>) -> Real3<T> {
        let spray = self.geometry.spray(c, v);
        // Larger than what difference quotients leave.
        if self.function == "spray" { spray + Real3::from_f64(DVec3::splat(10.0 * ERROR)) } else { spray }
    }
    fn raise(&self, p: DVec4, conormal: DVec3) -> DVec4 {
        self.vector("raise", self.geometry.raise(p, conormal))
    }
    fn lower(&self, p: DVec4, v: DVec4) -> DVec3 {
        self.spatial("lower", self.geometry.lower(p, v))
    }
    fn volume_density(&self, c: DVec3) -> f64 {
        self.scalar("volume_density", self.geometry.volume_density(c))
    }
    fn apply(&self, m: &Isometry, g: Geodesic) -> Geodesic {
        self.geodesic("apply", self.geometry.apply(m, g))
    }
    fn fold(&self, plane: DVec4, pairing: &Isometry) -> Isometry {
        let m = self.geometry.fold(plane, pairing);
        Isometry { linear: self.matrix("fold", m.linear), shift: m.shift }
    }
    fn cross(&self, folded: &Isometry, plane: DVec4, g: Geodesic) -> Geodesic {
        self.geodesic("cross", self.geometry.cross(folded, plane, g))
    }
    fn compose(&self, a: &Isometry, b: &Isometry) -> Isometry {
        let m = self.geometry.compose(a, b);
        Isometry { linear: self.matrix("compose", m.linear), ..m }
    }
    fn inverse(&self, m: &Isometry) -> Isometry {
        let m = self.geometry.inverse(m);
        Isometry { linear: self.matrix("inverse", m.linear), ..m }
    }
    fn isometry_residual(&self, m: &Isometry) -> f64 {
        self.scalar("isometry_residual", self.geometry.isometry_residual(m))
    }
    fn bisector(&self, q: DVec4) -> Option<DVec4> {
        self.geometry.bisector(q).map(|p| self.vector("bisector", p))
    }
    fn ball(&self, centre: DVec4, radius: f64) -> Option<Quadric> {
        self.geometry.ball(centre, radius).map(|ball| self.quadric("ball", ball))
    }
    fn tube(&self, axis: Geodesic, radius: f64) -> Option<Quadric> {
        self.geometry.tube(axis, radius).map(|tube| self.quadric("tube", tube))
    }
}
