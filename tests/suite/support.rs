//! What tests of several modules share: the device, taken by one test at a time, and counted skips.

use holonomy::vulkan::{self, Context, ContextOptions, DeviceInfo, Tier, Validation, VulkanError};
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

/// Comma list of what must not be skipped: `compute`, `rt`, `validation`.
const REQUIRE: &str = "HOLONOMY_REQUIRE";

static TURN: Mutex<()> = Mutex::new(());
static SKIPPED: AtomicUsize = AtomicUsize::new(0);

/// The device, for as long as this lives. Its end fails the test if the validation layer has complained.
pub struct Gpu {
    context: Arc<Context>,
    /// No other test uses a device meanwhile: software devices take all cores each.
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
    static CONTEXT: OnceLock<Result<Arc<Context>, VulkanError>> = OnceLock::new();
    take("compute", turn(), CONTEXT.get_or_init(|| Context::new(&options(Tier::Compute)?)))
}

/// The device for ray tracing, opened for it, in the same way.
///
/// # Panics
/// If the device is there and fails.
pub fn rt_gpu() -> Option<Gpu> {
    static CONTEXT: OnceLock<Result<Arc<Context>, VulkanError>> = OnceLock::new();
    take("rt", turn(), CONTEXT.get_or_init(|| Context::new(&options(Tier::Rt)?)))
}

fn take(what: &str, turn: MutexGuard<'static, ()>, context: &Result<Arc<Context>, VulkanError>) -> Option<Gpu> {
    match context {
        Ok(context) => Some(Gpu { context: context.clone(), _turn: turn }),
        Err(
            reason @ (VulkanError::NoLoader(_)
            | VulkanError::OldLoader(_)
            | VulkanError::NoDevice
            | VulkanError::Lacking { .. }),
        ) => {
            skip(what, &reason.to_string());
            None
        }
        // A failing driver or a mistyped variable is no reason to skip.
        Err(failure) => panic!("{failure}"),
    }
}

/// A turn at the device for a test that opens its own context, and the options for it. Such a test reads the
/// messages of the options.
pub fn gpu_turn() -> Option<(MutexGuard<'static, ()>, ContextOptions)> {
    gpu()?;
    options(Tier::Compute).ok().map(|options| (turn(), options))
}

/// The same for ray tracing.
pub fn rt_turn() -> Option<(MutexGuard<'static, ()>, ContextOptions)> {
    rt_gpu()?;
    options(Tier::Rt).ok().map(|options| (turn(), options))
}

fn turn() -> MutexGuard<'static, ()> {
    TURN.lock().unwrap_or_else(PoisonError::into_inner)
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
