//! Ends of geodesics against the reference of 192 bits.
//!
//! The yardstick is the floor of a geodesic: how far its exact end moves if each input is rounded (every number by half of
//! its last place, worst of eight patterns of signs), plus the rounding of the outputs. No program that gets and gives
//! such numbers can promise less; the limit is ten floors. A case is a sweep over lengths, from the base point and from
//! elsewhere, and reports its worst.

use super::{Bench, Case, FLOWS, Family, On, Random, Reading, Trouble};
use crate::{
    geometry::{Geodesic, Geometry, GeometryError, GeometryId, Visitor, settle_geodesic, visit},
    integrate::Exact,
    measure::reference::{Big, BigGeodesic, Model, apart, distance, model},
    shader_io::{PROBE_FLOW, ProbeIn},
};
use glam::{DVec4, Vec4};
use rayon::prelude::*;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Rounding of the reference itself, of numbers of order 1: 192 bits.
const OWN_ROUNDING: f64 = 1e-56;

/// Floors that an end point may be off.
const FLOORS: f64 = 10.0;

/// What is hard in a geometry: directions with a name and the longest length of their sweep.
struct Hard {
    geometry: &'static str,
    /// Lengths of all sweeps.
    lengths: &'static [f64],
    /// Where sweeps start besides the base point.
    elsewhere: [f64; 4],
    directions: &'static [(&'static str, [f64; 4], f64)],
}

/// 1/√2.
const HALF: f64 = std::f64::consts::FRAC_1_SQRT_2;
const E: f64 = 0.0;

/// Directions are given in the components of the command line. What is said of each is why it is hard.
const HARD: &[Hard] = &[
    Hard {
        geometry: "e3",
        lengths: &[0.0, 1.0, -1.0, 1e-9, 1000.0],
        elsewhere: [0.3, -2.0, 7.0, E],
        directions: &[
            ("along an axis, to 1e12", [0.0, -1.0, 0.0, E], 1e12),
            ("all but along an axis", [1e-12, 1.0, -1e-12, E], -1e6),
            ("general", [0.3, -0.5, 0.8, E], 1e9),
        ],
    },
    Hard {
        geometry: "s3",
        lengths: &[0.0, 1.0, -1.0, 1e-9, 3.0, 100.0],
        elsewhere: [0.5, -0.1, 0.3, 0.7],
        directions: &[
            ("to the antipode", [0.0, -1.0, 0.0, 0.0], PI),
            ("all but to the antipode", [0.6, 0.0, 0.8, 0.0], PI - 1e-7),
            ("round and a bit more, backwards", [0.3, -0.5, 0.8, 0.0], -TAU - 1e-3),
            ("1000, many rounds", [1e-12, 1.0, 0.5, 0.0], 1000.0),
            ("-1000, many rounds", [0.2, -0.9, 0.1, 0.0], -999.123),
        ],
    },
    Hard {
        geometry: "h3",
        lengths: &[0.0, 1.0, -1.0, 1e-9, 5.0, -20.0],
        elsewhere: [0.5, -0.1, 0.3, 1.5],
        directions: &[
            ("along an axis, to 50", [0.0, -1.0, 0.0, 0.0], 50.0),
            ("all but along an axis", [1e-12, 1.0, -1e-12, 0.0], 30.0),
            ("general, to 37.7", [0.3, -0.5, 0.8, 0.0], 37.7),
            ("not tangent before it is projected", [0.3, 0.5, -0.8, 0.4], -37.7),
        ],
    },
    Hard {
        geometry: "s2xr",
        lengths: &[0.0, 1.0, -1.0, 1e-9, 3.0, PI, 100.0],
        elsewhere: [0.4, -0.5, 7.3, 0.9],
        directions: &[
            ("horizontal, to 1000", [0.6, 0.8, 0.0, 0.0], 1000.0),
            ("all but horizontal", [0.6, -0.8, 1e-12, 0.0], -TAU - 1e-3),
            ("flat", [0.6, 0.8, 1e-6, 0.0], 1000.0),
            ("general", [0.6, 0.8, 0.9, 0.0], -999.123),
            ("steep", [0.6, 0.8, 1e6, 0.0], 1000.0),
            ("all but vertical", [0.6, 0.8, 1e12, 0.0], 1000.0),
            ("vertical", [0.0, 0.0, -1.0, 0.0], 1000.0),
        ],
    },
    Hard {
        geometry: "h2xr",
        lengths: &[0.0, 1.0, -1.0, 1e-9, 5.0, -20.0],
        elsewhere: [0.4, -0.5, 7.3, 1.2],
        directions: &[
            ("horizontal, to 50", [0.6, 0.8, 0.0, 0.0], 50.0),
            ("all but horizontal, to 50", [0.6, -0.8, 1e-12, 0.0], 50.0),
            ("flat, to 50", [0.6, 0.8, 1e-6, 0.0], 50.0),
            ("general, to 50", [0.6, 0.8, 0.9, 0.0], 50.0),
            ("steep", [0.6, 0.8, 1e6, 0.0], 1000.0),
            ("all but vertical", [0.6, 0.8, 1e12, 0.0], 1000.0),
            ("vertical", [0.0, 0.0, -1.0, 0.0], 1000.0),
        ],
    },
    Hard {
        geometry: "nil",
        lengths: &[0.0, 1e-9, 1.0, -1.0, 5.0, -20.0, TAU, 100.0],
        elsewhere: [1.3, -2.1, 0.7, E],
        directions: &[
            ("fibre 1, to 1000", [0.0, 0.0, 1.0, E], 1000.0),
            ("fibre 0.9, to 1000", [0.3, -0.3, 0.9, E], 1000.0),
            ("fibre 0.3, to 1000", [0.5, -0.8, -0.3, E], 1000.0),
            ("fibre 0.1, to -1000", [0.6, 0.8, 0.1, E], -1000.0),
            ("fibre 1e-2, to 1000", [0.0, 1.0, -1e-2, E], 1000.0),
            ("fibre 1e-3, to 1000", [-0.6, 0.8, 1e-3, E], 1000.0),
            ("fibre 1e-5, to 1000", [0.6, 0.8, -1e-5, E], 1000.0),
            ("fibre 1e-7, to -1000", [0.8, 0.6, 1e-7, E], -1000.0),
            ("fibre 1e-9, to 1000", [0.6, -0.8, 1e-9, E], 1000.0),
            ("fibre 1e-12, to 1000", [0.6, 0.8, -1e-12, E], 1000.0),
            ("fibre 0, to 1000", [0.6, 0.8, 0.0, E], 1000.0),
            ("fibre 0 along x, to 1000", [1.0, 0.0, 0.0, E], 1000.0),
            // g(θ) and its neighbours change from series to closed form at θ = wt = 1 and 1e-3.
            ("the series switch, from below", [0.6, 0.0, 0.8, E], 1.249_999),
            ("the series switch, from above", [0.6, 0.0, 0.8, E], 1.250_001),
            ("the series switch, negative", [0.6, 0.0, -0.8, E], -1.250_001),
            ("the switch at 1e-3, from below", [0.6, 0.0, 0.8, E], 1.249_999e-3),
            ("the switch at 1e-3, negative", [0.6, 0.0, 0.8, E], -1.250_001e-3),
        ],
    },
    Hard {
        geometry: "sol",
        lengths: &[0.0, 1e-9, 1.0, -4.0],
        elsewhere: [0.3, -0.8, 0.5, E],
        directions: &[
            ("x alone, e^2z turns at once", [1.0, 0.0, 0.0, E], 8.0),
            ("y alone", [0.0, 1.0, 0.0, E], 8.0),
            ("vertical, e^z to the end of f32", [0.0, 0.0, -1.0, E], 60.0),
            ("momentum 1e-12 in x", [1e-12, 0.6, 0.8, E], 8.0),
            ("momentum 1e-12 in y", [0.6, 1e-12, -0.8, E], 8.0),
            ("momentum 0 in x", [0.0, 0.6, 0.8, E], 8.0),
            ("momentum 0 in y", [0.6, 0.0, -0.8, E], 8.0),
            ("both momenta 1e-12", [1e-12, 1e-12, 1.0, E], 8.0),
            ("in the separating plane u = v", [HALF, HALF, 0.0, E], 8.0),
            ("1e-12 beside the separating plane", [HALF, HALF * (1.0 + 1e-12), 0.0, E], 8.0),
            ("1e-12 off the plane u = -v", [HALF, -HALF, 1e-12, E], 8.0),
            ("1e-7 beside it, and 1e-9 up", [HALF + 1e-7, HALF - 1e-7, 1e-9, E], 8.0),
            ("1e-4 in x", [1e-4, 0.5, -0.8, E], 8.0),
            ("several periods", [0.3, 0.5, 0.2, E], 20.0),
            ("several periods backwards", [HALF, 0.6, 0.1, E], -30.0),
            ("so long that periods are counted", [0.3, -0.5, 0.2, E], 70.0),
            // Steps end at multiples of 1/4 and 1/2, periods are counted from 64 on.
            ("next to the end of a step", [0.3, 0.4, 0.8, E], 0.500_000_1),
            ("just before periods are counted", [0.5, 0.4, 0.3, E], 63.999_999),
            ("just after", [0.5, 0.4, 0.3, E], 64.000_001),
        ],
    },
    Hard {
        geometry: "sl2",
        lengths: &[0.0, 1e-9, 1.0, -1.0, 5.0, -20.0],
        elsewhere: [0.8, -1.3, 13.0, 1.0],
        directions: &[
            ("horizontal, to 80", [1.0, 0.0, 0.0, E], 80.0),
            ("along the fibre, 159 turns", [0.0, 0.0, 1.0, E], 1000.0),
            ("along the fibre, backwards", [0.0, 0.0, -1.0, E], -1000.0),
            ("parabolic", [0.6, 0.8, 1.0, E], 30.0),
            ("parabolic + 1e-12", [0.6, 0.8, 1.0 + 1e-12, E], 30.0),
            ("parabolic - 1e-12", [0.6, 0.8, 1.0 - 1e-12, E], -30.0),
            ("parabolic, the other sign", [0.6, 0.8, -1.0, E], 30.0),
            ("parabolic, the other sign + 1e-12", [0.6, 0.8, -1.0 + 1e-12, E], -30.0),
            ("all but along the fibre", [1e-12, 0.0, 1.0, E], 60.0),
            ("all but horizontal", [1.0, 0.0, 1e-12, E], 20.0),
            ("elliptic, many turns", [0.3, -0.2, 0.9, E], 300.0),
            ("elliptic, backwards", [-0.5, 0.6, -0.8, E], -50.0),
            ("hyperbolic", [0.1, 0.7, 0.6, E], 40.0),
            // κ²t²/4 passes ±1/4, where the series of cosh √z ends.
            ("the series switch, hyperbolic", [0.8, 0.0, 0.6, E], 1.889_822),
            ("the series switch, beyond", [0.8, 0.0, 0.6, E], 1.889_823),
            ("the series switch, elliptic", [0.6, 0.0, 0.8, E], -1.889_822),
            ("the series switch, elliptic, beyond", [0.6, 0.0, 0.8, E], 1.889_823),
        ],
    },
    Hard {
        geometry: "sl2-trace",
        lengths: &[0.0, 1e-9, 0.4, -0.3],
        elsewhere: [0.2, -0.1, 0.25, E],
        directions: &[
            ("space-like, outwards", [1.0, 0.0, 0.0, E], 30.0),
            ("space-like, inwards", [-1.0, 0.0, 0.0, E], 20.0),
            ("null, along y", [0.0, 1.0, 0.0, E], 1000.0),
            ("null, along -z", [0.0, 0.0, -1.0, E], 1e6),
            ("null, slanted", [1.0, 1.0, -1.0, E], 500.0),
            ("1e-12 time-like of null", [1.0, 1.0 + 1e-12, -1.0, E], 3.0),
            ("1e-12 space-like of null", [1.0, 1.0 - 1e-12, -1.0, E], 30.0),
            ("time-like, to next to the edge", [0.0, 1.0, -1.0, E], 1.57),
            ("time-like backwards, 1e-5 from the edge", [0.0, -1.0, 1.0, E], 1e-5 - FRAC_PI_2),
            ("time-like, slow", [1e-12, 0.5, -0.5, E], 3.1),
            ("general", [0.3, 0.2, 0.9, E], 15.0),
        ],
    },
];

/// By these nothing may change; the last is a subnormal number in f64.
const SCALES: [(&str, f64); 5] =
    [("1e-30", 1e-30), ("1e25", 1e25), ("1e-150", 1e-150), ("1e150", 1e150), ("1e-310, subnormal", 1e-310)];

/// One geodesic.
#[derive(Clone, Copy, Debug)]
pub struct Start {
    /// Point, in the components of the command line.
    pub from: [f64; 4],
    /// Direction, the same.
    pub direction: [f64; 4],
    /// Length.
    pub length: f64,
}

impl Start {
    fn end(&self, model: &dyn Model) -> BigGeodesic {
        model.flow(&model.settle(self.from, self.direction), &Big::new(self.length))
    }

    /// Whether numbers of this precision hold the direction and the length, where they are taken as they are.
    fn is_held(&self, on: On, id: GeometryId) -> bool {
        let held = |x: f64| x == 0.0 || (x as f32).is_normal();
        on == On::Cpu || !is_indefinite(id) || (held(self.length) && self.direction.iter().all(|x| held(*x)))
    }

    /// What rounding of the inputs and outputs costs, in point and direction.
    pub(super) fn floor(&self, model: &dyn Model, exact: &BigGeodesic, on: On) -> [f64; 2] {
        let u = on.rounding();
        let mut random = Random(7);
        let mut worst = [0.0_f64; 2];
        for number in 0..8 {
            let mut nudge = |x: f64| x * (1.0 + if random.next() < 0.5 { u } else { -u });
            // Lengths both ways in turn: in f64, where 1 + u is 1, chance would leave a long way as it is now and then.
            let moved = Self {
                from: self.from.map(&mut nudge),
                direction: self.direction.map(&mut nudge),
                length: self.length * (1.0 + if number % 2 == 0 { u } else { -u }),
            };
            let end = moved.end(model);
            worst[0] = worst[0].max(apart(&exact.point, &end.point));
            worst[1] = worst[1].max(apart(&exact.direction, &end.direction));
        }
        let size = |v| u * distance(v, &[0.0; 4]) + on.underflow() + OWN_ROUNDING;
        [worst[0] + size(&exact.point), worst[1] + size(&exact.direction)]
    }
}

pub(super) fn cases() -> Vec<Case> {
    let family = Family { name: "geodesic", quantity: "end point or direction off, worst of the sweep", on: FLOWS };
    let scales = Family { name: "direction-scale", ..family };
    let tiny = Family { name: "denormal", ..family };
    let mut cases = Vec::new();
    for hard in HARD {
        let Some(id) = GeometryId::from_name(hard.geometry) else { continue };
        for (what, direction, long) in hard.directions {
            let starts = sweep(hard, *direction, *long, 1.0);
            cases.push(family.case(hard.geometry, what, move |bench, on| judge(bench, on, id, &starts)));
        }
        for (what, scale) in SCALES {
            let general = hard.directions.last().map_or([1.0, 0.5, 0.2, 0.0], |(_, direction, _)| *direction);
            let starts: Vec<Start> =
                sweep(hard, general, 1.0, scale).into_iter().filter(|start| start.length.is_finite()).collect();
            cases.push(scales.case(hard.geometry, what, move |bench, on| judge(bench, on, id, &starts)));
        }
        // Subnormal numbers beside ordinary ones, in points, directions and lengths.
        let small = [f64::from_bits(1), -1e-310, 1e-40, -1e-45];
        let [_, direction, _] = [0, 1, 2].map(|i| hard.directions[i % hard.directions.len()].1);
        let starts: Vec<Start> = small
            .into_iter()
            .flat_map(|tiny| {
                let added = |v: [f64; 4], scale: f64| v.map(|x| if x == 0.0 { tiny * scale } else { x });
                let base = if components(id) == 4 { [0.0, 0.0, 0.0, 1.0] } else { [0.0; 4] };
                [
                    Start { from: added(base, 1.0), direction, length: 1.0 },
                    Start { from: base, direction: added(direction, 1.0), length: 1.0 },
                    Start { from: base, direction, length: tiny },
                ]
            })
            .collect();
        cases.push(tiny.case(hard.geometry, "subnormal numbers", move |bench, on| judge(bench, on, id, &starts)));
    }
    cases
}

/// The lengths of a sweep, all from the base point and the short ones from elsewhere too.
fn sweep(hard: &Hard, direction: [f64; 4], long: f64, scale: f64) -> Vec<Start> {
    let base = if hard.elsewhere[3] == E { [0.0; 4] } else { [0.0, 0.0, 0.0, 1.0] };
    // Where nothing is normalised, a longer direction goes as far in a shorter length.
    let affine = GeometryId::from_name(hard.geometry).is_some_and(is_indefinite);
    let length = |t: f64| if affine { t / scale } else { t };
    let direction = direction.map(|x| x * scale);
    let from_base = |t: f64| Start { from: base, direction, length: length(t) };
    let mut starts: Vec<Start> = hard.lengths.iter().map(|t| from_base(*t)).collect();
    starts.push(from_base(long));
    let near = hard.lengths.iter().filter(|t| t.abs() <= 5.0);
    starts.extend(near.map(|t| Start { from: hard.elsewhere, direction, length: length(*t) }));
    starts
}

fn components(id: GeometryId) -> usize {
    id.components()
}

/// Whether the metric is indefinite, so that directions keep their length.
pub(super) fn is_indefinite(id: GeometryId) -> bool {
    struct Indefinite;
    impl Visitor for Indefinite {
        type Output = bool;
        fn visit<G: Geometry>(self, geometry: G) -> bool {
            geometry.signature() != glam::DVec3::ONE
        }
    }
    visit(id, Indefinite)
}

/// The start as the program takes it.
pub(super) fn settle(id: GeometryId, from: [f64; 4], direction: [f64; 4]) -> Result<Geodesic, GeometryError> {
    struct Settle(&'static str, [f64; 4], [f64; 4]);
    impl Visitor for Settle {
        type Output = Result<Geodesic, GeometryError>;
        fn visit<G: Geometry>(self, geometry: G) -> Self::Output {
            settle_geodesic(geometry, self.0, DVec4::from_array(self.1), DVec4::from_array(self.2))
        }
    }
    visit(id, Settle(id.name(), from, direction))
}

/// Ends of geodesics as the program computes them: what it refuses is an error.
pub(super) fn ends(
    bench: &mut Bench,
    on: On,
    id: GeometryId,
    starts: &[Start],
) -> Result<Vec<Result<Geodesic, GeometryError>>, Trouble> {
    struct Flow(Geodesic, f64, On);
    impl Visitor for Flow {
        type Output = (Geodesic, Option<&'static str>);
        fn visit<G: Geometry>(self, geometry: G) -> Self::Output {
            let Self(state, length, on) = self;
            let follow = if on == On::Cpu { Exact::follow::<f64, G> } else { Exact::follow::<f32, G> };
            (follow(&Exact, geometry, state, length).end, geometry.edge(state, length))
        }
    }
    let settled: Vec<_> = starts.iter().map(|start| settle(id, start.from, start.direction)).collect();
    let computed: Vec<Geodesic> = match on {
        On::Cpu | On::CpuSingle => Vec::new(),
        _ => {
            let single = |v: DVec4| v.as_vec4().to_array();
            let input = |(state, start): (&Result<Geodesic, _>, &Start)| {
                let state = state.clone().unwrap_or(Geodesic { point: DVec4::ZERO, velocity: DVec4::ZERO });
                let t = start.length as f32;
                ProbeIn { a: single(state.point), b: single(state.velocity), t, op: PROBE_FLOW, ..Default::default() }
            };
            let inputs: Vec<ProbeIn> = settled.iter().zip(starts).map(input).collect();
            let double = |v: [f32; 4]| Vec4::from(v).as_dvec4();
            let outputs = bench.probe(id, &inputs)?;
            outputs.into_iter().map(|out| Geodesic { point: double(out.a), velocity: double(out.b) }).collect()
        }
    };
    Ok(settled
        .into_iter()
        .zip(starts)
        .enumerate()
        .map(|(index, (state, start))| {
            let (length, geometry) = (start.length, id.name());
            let state = state?;
            let (flown, edge) = visit(id, Flow(state, length, on));
            if let Some(edge) = edge {
                return Err(GeometryError::Edge { length, edge, geometry });
            }
            let end = computed.get(index).copied().unwrap_or(flown);
            if end.point.is_finite() && end.velocity.is_finite() {
                return Ok(end);
            }
            let precision = if on == On::Cpu { "f64" } else { "f32" };
            Err(GeometryError::OutOfRange { length, precision, geometry })
        })
        .collect())
}

/// The worst of the starts in floors; what is refused is infinitely off.
fn judge(bench: &mut Bench, on: On, id: GeometryId, starts: &[Start]) -> Result<Reading, Trouble> {
    let model = model(id).ok_or_else(|| Trouble(format!("{} has no reference", id.name())))?;
    let ends = ends(bench, on, id, starts)?;
    let readings: Vec<(f64, f64)> = starts
        .par_iter()
        .zip(&ends)
        .flat_map_iter(|(start, end)| {
            let exact = start.end(model);
            let floor = start.floor(model, &exact, on);
            match end {
                Ok(end) => [
                    (distance(&exact.point, &end.point.to_array()[..reach(model, 0)]), floor[0]),
                    (distance(&exact.direction, &end.velocity.to_array()[..reach(model, 1)]), floor[1]),
                ],
                // Where nothing is normalised a direction may leave the range of single precision by itself.
                Err(GeometryError::OutOfRange { .. }) if !start.is_held(on, id) => [(0.0, floor[0]); 2],
                Err(_) => [(f64::INFINITY, floor[0]); 2],
            }
        })
        .collect();
    let ratio = |r: &(f64, f64)| if r.0.is_nan() { f64::INFINITY } else { r.0 / r.1 };
    let worst = readings.iter().max_by(|a, b| ratio(a).total_cmp(&ratio(b))).copied();
    let (error, floor) = worst.unwrap_or((f64::NAN, 0.0));
    Ok(Reading { error, floor, limit: FLOORS * floor, ..Reading::default() })
}

/// How many numbers of a point (0) or a direction (1) count: the rest has no meaning for the user.
fn reach(model: &dyn Model, what: usize) -> usize {
    model.components()[what]
}
