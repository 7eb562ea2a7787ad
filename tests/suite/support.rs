//! What tests of several modules share: contexts on the device, each taken by one test at a time, and counted skips.

use glam::{DMat4, DVec3, DVec4};
use holonomy::{
    geometry::{Geometry, GeometryId, Isometry, Visitor, matrix_from_rows, sl2, sl2_trace, sol, visit},
    space::{catalogue, domain::Domain},
    vulkan::{self, Context, ContextOptions, DeviceInfo, Tier, Validation, VulkanError},
};
use serde_json::Value;
use std::{
    env,
    io::Write,
    ops::Deref,
    process::{Command, Stdio},
    sync::{
        Arc, Mutex, MutexGuard, OnceLock, PoisonError,
        atomic::{AtomicUsize, Ordering},
    },
};

/// Comma list of what must not be skipped: `compute`, `rt`, `validation`, `xr`.
const REQUIRE: &str = "HOLONOMY_REQUIRE";

/// A context that tests share, and whose turn it is.
struct Shared {
    tier: Tier,
    /// Its name in [`REQUIRE`].
    name: &'static str,
    context: OnceLock<Result<Arc<Context>, VulkanError>>,
    turn: Mutex<()>,
}

// Not one turn for all: a test that compiles, or opens contexts by the hundred, keeps one core busy and the others idle.
static COMPUTE: Shared = Shared::new(Tier::Compute, "compute");
static RT: Shared = Shared::new(Tier::Rt, "rt");
static OWN: Mutex<()> = Mutex::new(());

static SKIPPED: AtomicUsize = AtomicUsize::new(0);

/// A shared context, for as long as this lives. Its end fails the test if the validation layer has complained.
pub struct Gpu {
    context: Arc<Context>,
    /// No other test uses this context meanwhile, so that what the layer says is about this test.
    _turn: MutexGuard<'static, ()>,
}

impl Deref for Gpu {
    type Target = Arc<Context>;

    fn deref(&self) -> &Arc<Context> {
        &self.context
    }
}

impl Drop for Gpu {
    fn drop(&mut self) {
        let messages = self.context.messages().take();
        if !std::thread::panicking() {
            assert!(messages.is_empty(), "validation: {messages:#?}");
        }
    }
}

/// The device for compute with validation, or none where there is no device: then the test is skipped. Among equals the
/// one that cannot trace rays, so that the tests cover the drivers that have nothing but compute.
///
/// # Panics
/// If the device is there and fails.
pub fn gpu() -> Option<Gpu> {
    COMPUTE.take()
}

/// The device for ray tracing, opened for it, in the same way.
///
/// # Panics
/// If the device is there and fails.
pub fn rt_gpu() -> Option<Gpu> {
    RT.take()
}

/// A turn for a test that opens its own context, and the options for it. Such a test reads the messages of the options.
pub fn gpu_turn() -> Option<(MutexGuard<'static, ()>, ContextOptions)> {
    COMPUTE.own()
}

/// The same for ray tracing.
pub fn rt_turn() -> Option<(MutexGuard<'static, ()>, ContextOptions)> {
    RT.own()
}

impl Shared {
    const fn new(tier: Tier, name: &'static str) -> Self {
        Self { tier, name, context: OnceLock::new(), turn: Mutex::new(()) }
    }

    fn take(&'static self) -> Option<Gpu> {
        self.context().map(|context| Gpu { _turn: locked(&self.turn), context })
    }

    fn own(&self) -> Option<(MutexGuard<'static, ()>, ContextOptions)> {
        self.context()?;
        options(self.tier).ok().map(|options| (locked(&OWN), options))
    }

    fn context(&self) -> Option<Arc<Context>> {
        match self.context.get_or_init(|| Context::new(&options(self.tier)?)) {
            Ok(context) => Some(context.clone()),
            Err(
                reason @ (VulkanError::NoLoader(_)
                | VulkanError::OldLoader(_)
                | VulkanError::NoDevice
                | VulkanError::Lacking { .. }),
            ) => {
                skip(self.name, &reason.to_string());
                None
            }
            // A failing driver or a mistyped variable is no reason to skip.
            Err(failure) => panic!("{failure}"),
        }
    }
}

fn locked(turn: &'static Mutex<()>) -> MutexGuard<'static, ()> {
    turn.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The device of the environment, else the best for the tier, with as much validation as there is.
fn options(tier: Tier) -> Result<ContextOptions, VulkanError> {
    let mut options = ContextOptions { tier, cache_folder: None, ..ContextOptions::from_env()? };
    if options.validation == Validation::Off {
        options.validation = Validation::Sync;
    }
    if let Err(error @ VulkanError::NoValidation(_)) = holonomy::vulkan::devices(&options) {
        skip("validation", &error.to_string());
        options.validation = Validation::Off;
    }
    if options.device.is_none() {
        let place = |device: &DeviceInfo| (device.rank(tier), tier == Tier::Compute && device.can(Tier::Rt));
        let best = vulkan::devices(&options)?.into_iter().min_by_key(place);
        options.device = best.map(|device| device.index.to_string());
    }
    Ok(options)
}

/// Says that a test, or a part of one, is skipped, past the harness that hides the output of tests that pass.
///
/// # Panics
/// If the environment requires `what`.
pub fn skip(what: &str, reason: &str) {
    let required = env::var(REQUIRE).unwrap_or_default();
    assert!(!required.split(',').any(|r| r.trim() == what), "{what} is required, but: {reason}");
    let count = SKIPPED.fetch_add(1, Ordering::Relaxed) + 1;
    let _ = writeln!(std::io::stderr(), "skipped: {what}: {reason} (skip {count} of this run)");
}

/// Random numbers in [0, 1), the same in every run: splitmix64.
pub struct Random(pub u64);

impl Random {
    /// The next number.
    pub fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// A number in the range.
    pub fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next()
    }
}

/// Runs the real binary with `--batch -` on lines of JSON and returns its lines.
pub fn run_batch(args: &[&str], lines: &[Value]) -> Vec<Value> {
    let mut child = Command::new(env!("CARGO_BIN_EXE_holonomy"))
        .args(args)
        .args(["--batch", "-"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("the binary starts");
    let input: String = lines.iter().map(|line| format!("{line}\n")).collect();
    let mut stdin = child.stdin.take().expect("stdin is piped");
    let writer = std::thread::spawn(move || stdin.write_all(input.as_bytes()));
    let output = child.wait_with_output().expect("the binary ends");
    writer.join().expect("the writer ends").expect("the binary reads its input");
    assert!(output.status.success());
    let text = String::from_utf8(output.stdout).expect("output is text");
    text.lines().map(|line| serde_json::from_str(line).expect("output is JSON")).collect()
}

/// Isometries of a geometry, each with the same folded as `cross` wants it, and its plane: the pairings of the
/// catalogue's spaces and their faces, and isometries of kinds that no space of the catalogue has.
pub fn isometries(id: GeometryId) -> Vec<(Isometry, Isometry, DVec4)> {
    struct Fold(DVec4, Isometry);
    impl Visitor for Fold {
        type Output = Isometry;
        fn visit<G: Geometry>(self, geometry: G) -> Isometry {
            geometry.fold(self.0, &self.1)
        }
    }
    let spaces = catalogue::NAMES.iter().filter_map(|name| catalogue::find(name)).filter(|s| s.geometry == id);
    let faces = spaces.flat_map(|space| Domain::new(&space).faces);
    let pairings = faces.map(|face| (face.pairing, face.folded, face.plane));
    let plane = DVec4::new(0.6, 0.8, 0.0, -0.4);
    pairings.chain(rare_isometries(id.name()).into_iter().map(|m| (m, visit(id, Fold(plane, m)), plane))).collect()
}

fn rare_isometries(geometry: &str) -> Vec<Isometry> {
    let rows = |r: [[f64; 4]; 4], z: f64| Isometry { linear: matrix_from_rows(r), shift: DVec4::Z * z };
    let (s, c) = 0.7_f64.sin_cos();
    let (sh, ch) = (0.7_f64.sinh(), 0.7_f64.cosh());
    let turn = [[c, -s, 0.0, 0.0], [s, c, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];
    let upside_down = DMat4::from_diagonal(DVec4::new(-1.0, 1.0, -1.0, 1.0));
    let product = |along: [[f64; 4]; 4]| {
        vec![
            rows(along, 0.3),
            Isometry { linear: matrix_from_rows(along) * matrix_from_rows(turn), shift: DVec4::Z },
            Isometry { linear: upside_down * matrix_from_rows(along), shift: DVec4::Z * -1.2 },
        ]
    };
    let by = [DVec3::new(0.7, -0.4, 0.9), DVec3::new(-0.3, 0.5, -0.6), DVec3::new(0.0, 1.1, 0.0)];
    match geometry {
        "s2xr" => product([[c, 0.0, 0.0, s], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [-s, 0.0, 0.0, c]]),
        "h2xr" => product([[ch, 0.0, 0.0, sh], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [sh, 0.0, 0.0, ch]]),
        // A turn about the fibre, and a mirror of the plane with the fibre turned over, each before a left
        // multiplication by (a, 0.2, 0.4).
        "nil" => [0.0, -0.8]
            .into_iter()
            .flat_map(|a| {
                let turned = [[c, -s, 0.0, a], [s, c, 0.0, 0.2], [a * s, a * c, 1.0, 0.4], [0.0, 0.0, 0.0, 1.0]];
                let mirrored = [[c, s, 0.0, a], [s, -c, 0.0, 0.2], [a * s, -a * c, -1.0, 0.4], [0.0, 0.0, 0.0, 1.0]];
                [rows(turned, 0.0), rows(mirrored, 0.0)]
            })
            .collect(),
        "sol" => by.map(sol::translation).to_vec(),
        // More than a turn of the fibre.
        "sl2" => by.map(|by| sl2::translation(sl2::element(by.x, by.y, 9.0 * by.z))).to_vec(),
        // Lower triangular matrices move no point over the edge of the chart.
        "sl2-trace" => by.map(|by| sl2_trace::translation(DVec3::new(0.5 * by.x, 0.0, by.z))).to_vec(),
        _ => Vec::new(),
    }
}
