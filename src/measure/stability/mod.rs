//! The named list of stiff and extreme cases, and the runner: `holonomy stability`.
//!
//! A case is a question about the program that has an answer known from elsewhere, put to each backend that it concerns
//! through the code that renders. Its [`Reading`] holds the **error**, the **floor** (what rounding of the inputs and
//! outputs alone costs, zero where the answer is exact) and the **limit**. An error beyond the limit fails, unless the
//! case names an accepted limit of its own with the reason why it is not met: then it is listed as such.
//!
//! Errors are never measured against the program itself. References are the flows of 192 bits of
//! [`reference`](mod@super::reference), laws that the answer must obey (a point lies on its model, a walk there and back ends
//! where it began), closed forms, and, for pictures, the same picture from a hair's breadth beside.
//!
//! Each family of cases is a file. Families walk the registries of geometries and of spaces, so a new geometry or space is
//! covered without a line here; what is hard in a geometry is listed in [`geodesic`], and what its book has wrong in
//! `book`.
//!
//! `f64` cases run on the cpu, `f32` ones on the device: geodesics through the probe, walks through the stages of the
//! shaders (`shaders/entry/walk.comp`), pictures through the backends themselves. Flows run in `f32` on the cpu, too.

mod backward;
pub mod bench;
mod book;
mod corner;
mod edge;
pub mod geodesic;
mod label;
mod light;
mod observer;
mod picture;
mod scale;
mod scene;
mod view;
mod walk;

pub use bench::{Bench, Trouble};
use serde::Serialize;

/// Where a case runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum On {
    /// f64, no Vulkan.
    Cpu,
    /// f32, no Vulkan: flows alone.
    #[serde(rename = "cpu-f32")]
    CpuSingle,
    /// f32 in compute shaders.
    Compute,
    /// f32 in the ray tracing pipeline.
    Rt,
}

impl On {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Cpu, Self::CpuSingle, Self::Compute, Self::Rt];

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Cpu => "cpu",
            Self::CpuSingle => "cpu-f32",
            Self::Compute => "compute",
            Self::Rt => "rt",
        }
    }

    /// Relative rounding of a number.
    pub fn rounding(self) -> f64 {
        if self == Self::Cpu { 2.0_f64.powi(-53) } else { 2.0_f64.powi(-24) }
    }

    /// Smallest number of full precision: rounding of what is smaller.
    pub fn underflow(self) -> f64 {
        if self == Self::Cpu { f64::MIN_POSITIVE } else { f32::MIN_POSITIVE.into() }
    }
}

/// What a case measured.
#[derive(Clone, Debug, Default)]
pub struct Reading {
    /// The error, in the case's own quantity.
    pub error: f64,
    /// What rounding of inputs and outputs alone costs.
    pub floor: f64,
    /// Largest error that passes.
    pub limit: f64,
    /// Where the limit is not met, and cannot be for a reason that is told: the limit that holds.
    pub accepted: Option<(f64, &'static str)>,
    /// The error of the formula printed in the book, which must lie beyond the limit: else the case shows nothing.
    pub printed: Option<f64>,
}

impl Reading {
    /// A reading without a floor.
    pub fn new(error: f64, limit: f64) -> Self {
        Self { error, limit, ..Self::default() }
    }

    /// The same with a limit that is accepted in place of the usual one.
    pub fn accepting(self, limit: f64, reason: &'static str) -> Self {
        Self { accepted: Some((limit, reason)), ..self }
    }

    fn verdict(&self) -> Verdict {
        // What is no number is no success.
        let met = |limit: f64| self.error <= limit;
        match self.accepted {
            _ if self.printed.is_some_and(|printed| printed <= self.limit) => Verdict::Fail,
            _ if met(self.limit) => Verdict::Pass,
            Some((limit, _)) if met(limit) => Verdict::Accepted,
            _ => Verdict::Fail,
        }
    }
}

/// Whether a case holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// The error is within the limit.
    Pass,
    /// It is not, but within the limit that is accepted for this case.
    Accepted,
    /// It is beyond any.
    Fail,
}

impl Verdict {
    /// In words.
    pub fn name(self) -> &'static str {
        match self {
            Self::Pass => "pass",
            Self::Accepted => "accepted limit",
            Self::Fail => "FAIL",
        }
    }
}

type Run = Box<dyn Fn(&mut Bench, On) -> Result<Reading, Trouble> + Send + Sync>;

/// A named case.
pub struct Case {
    /// `family/subject/what`, unique.
    pub name: String,
    /// First part of the name.
    pub family: &'static str,
    /// Geometry, space or scene.
    pub subject: String,
    /// What the error is.
    pub quantity: &'static str,
    /// Where it runs.
    pub on: &'static [On],
    run: Run,
}

impl std::fmt::Debug for Case {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Case({})", self.name)
    }
}

/// Cases of one family while they are listed.
struct Family {
    name: &'static str,
    quantity: &'static str,
    on: &'static [On],
}

impl Family {
    fn case(
        &self,
        subject: &str,
        what: impl std::fmt::Display,
        run: impl Fn(&mut Bench, On) -> Result<Reading, Trouble> + Send + Sync + 'static,
    ) -> Case {
        Case {
            name: format!("{}/{subject}/{what}", self.name),
            family: self.name,
            subject: subject.to_owned(),
            quantity: self.quantity,
            on: self.on,
            run: Box::new(run),
        }
    }
}

/// Cases of flows alone.
const FLOWS: &[On] = &[On::Cpu, On::CpuSingle, On::Compute];
/// Cases that need no pictures: wherever there is a cpu or a compute shader.
const NUMBERS: &[On] = &[On::Cpu, On::Compute];
/// Cases of functions that only the host has.
const HOST: &[On] = &[On::Cpu];
/// Cases of pictures.
const PICTURES: &[On] = &[On::Cpu, On::Compute, On::Rt];

/// All cases, by family.
pub fn cases() -> Vec<Case> {
    [
        geodesic::cases(),
        edge::cases(),
        book::cases(),
        walk::cases(),
        label::cases(),
        backward::cases(),
        corner::cases(),
        observer::cases(),
        view::cases(),
        scale::cases(),
        scene::cases(),
    ]
    .into_iter()
    .flatten()
    .collect()
}

/// A case on a backend, judged.
#[derive(Clone, Debug, Serialize)]
pub struct Line {
    /// Name of the case.
    pub name: String,
    /// Its family.
    pub family: &'static str,
    /// Geometry, space or scene.
    pub subject: String,
    /// The backend.
    pub backend: On,
    /// What the error is.
    pub quantity: &'static str,
    /// The error; null where it is no number.
    pub error: f64,
    /// What rounding alone costs.
    pub floor: f64,
    /// Largest error that passes.
    pub limit: f64,
    /// Pass, accepted or fail.
    pub verdict: Verdict,
    /// The limit that is accepted instead.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub accepted_limit: Option<f64>,
    /// Why.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// The error of the formula printed in the book.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub printed_error: Option<f64>,
}

/// Runs cases one after the other on the backends of the bench and judges them. `spoil` changes what was measured before
/// it is judged (tests only); `progress` is called with the share that is done.
pub fn run(
    cases: &[Case],
    bench: &mut Bench,
    spoil: impl Fn(&Case, On, &mut Reading),
    progress: impl Fn(f64),
) -> Vec<Line> {
    let mut lines = Vec::new();
    for (number, case) in cases.iter().enumerate() {
        for &on in case.on {
            if !bench.has(on) {
                continue;
            }
            let outcome = (case.run)(bench, on);
            let (mut reading, trouble) = match outcome {
                Ok(reading) => (reading, None),
                Err(Trouble(what)) => (Reading::new(f64::NAN, 0.0), Some(what)),
            };
            spoil(case, on, &mut reading);
            let verdict = reading.verdict();
            let accepted = reading.accepted.filter(|_| verdict != Verdict::Pass);
            lines.push(Line {
                name: case.name.clone(),
                family: case.family,
                subject: case.subject.clone(),
                backend: on,
                quantity: case.quantity,
                error: reading.error,
                floor: reading.floor,
                limit: reading.limit,
                verdict,
                accepted_limit: accepted.map(|(limit, _)| limit),
                reason: trouble.or_else(|| accepted.map(|(_, reason)| reason.to_owned())),
                printed_error: reading.printed,
            });
        }
        progress((number + 1) as f64 / cases.len() as f64);
    }
    lines
}

/// Random numbers in [0, 1), the same in every run: splitmix64.
#[derive(Clone, Debug)]
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next()
    }

    fn vector(&mut self, size: f64) -> glam::DVec3 {
        glam::DVec3::from_array(std::array::from_fn(|_| self.within(-size, size)))
    }

    /// A direction, uniform enough.
    fn direction(&mut self) -> glam::DVec3 {
        loop {
            let v = self.vector(1.0);
            if (0.01..1.0).contains(&v.length_squared()) {
                return v.normalize();
            }
        }
    }
}
