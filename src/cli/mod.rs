//! The command line: one registry of options (the structures below, from which parser, checks and help follow), a
//! module per command.
//!
//! Exit codes: 0 done, 1 refused input, 2 failed. Errors are one line on stderr; `--json` alone goes to stdout.

mod accuracy;
mod backends;
mod batch;
mod check;
mod devices;
mod eye;
mod geodesic;
pub mod output;
mod profile;
mod progress;
mod render;
mod sequence;
mod stability;
mod transport;
mod vr;

use crate::{
    geometry::GEOMETRIES,
    integrate::Method,
    render::plan::{Feature, Heat},
    scene::{MAX_BOUNCES, Shading},
    space::body::Tracking,
    vulkan::VulkanError,
};
use clap::{
    Args, CommandFactory, Parser, Subcommand, ValueEnum,
    builder::{PossibleValuesParser, TypedValueParser},
    error::ErrorKind,
};
use std::{
    ffi::OsString,
    fmt,
    io::{self, IsTerminal},
    ops::Range,
    path::PathBuf,
    process::ExitCode,
};

/// Why a command ended without doing its work.
#[derive(Debug)]
pub enum Failure {
    /// The input was refused: exit code 1.
    Refused(anyhow::Error),
    /// The machine failed: exit code 2.
    Failed(anyhow::Error),
}

impl Failure {
    fn refused(error: impl Into<anyhow::Error>) -> Self {
        Self::Refused(error.into())
    }

    fn failed(error: impl Into<anyhow::Error>) -> Self {
        Self::Failed(error.into())
    }

    /// A device that failed; what the user's variables say of it is input.
    fn vulkan(error: VulkanError) -> Self {
        match error {
            VulkanError::Variable { .. } | VulkanError::UnknownDevice { .. } => Self::refused(error),
            _ => Self::failed(error),
        }
    }

    /// 1 for refused input, 2 for a failure.
    pub fn exit_code(&self) -> ExitCode {
        match self {
            Self::Refused(_) => ExitCode::from(1),
            Self::Failed(_) => ExitCode::from(2),
        }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (Self::Refused(error) | Self::Failed(error)) = self;
        // The chain of causes on one line, whatever they contain.
        let text = format!("{error:#}");
        let line = text.lines().map(str::trim).collect::<Vec<_>>().join(" ");
        // Names from outside may hold control sequences.
        f.write_str(&line.trim().replace(char::is_control, " "))
    }
}

type Outcome = Result<(), Failure>;

/// Inside views of Thurston's geometries and their quotients, by ray tracing.
#[derive(Parser)]
#[command(name = "holonomy", version, about, max_term_width = 110)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Render a picture of a scene, or a sequence along its camera path.
    Render(RenderArgs),
    /// Stand inside a space with a headset (OpenXR).
    Vr(VrArgs),
    /// Prove that a space's gluing is a manifold or an orbifold.
    Check(CheckArgs),
    /// List Vulkan devices, what each can run and what it lacks.
    Devices(DevicesArgs),
    /// Compute the end of a geodesic in a model geometry.
    Geodesic(GeodesicArgs),
    /// Run every stiff and extreme case on every backend, and fail if one fails.
    Stability(StabilityArgs),
    /// Measure error against run time of integrators, tolerances and backends.
    Accuracy(AccuracyArgs),
    /// Measure frame time over the number of bounces, on every backend.
    Profile(ProfileArgs),
    /// Follow a geodesic, or a pixel's ray, through the faces of a space.
    Transport(TransportArgs),
}

/// Which backend draws.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum BackendChoice {
    /// The fastest that this machine has; says which and why.
    Auto,
    /// The Vulkan ray tracing pipeline.
    Rt,
    /// Vulkan compute.
    Compute,
    /// The CPU in f64.
    Cpu,
}

/// How geodesics are integrated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Integrator {
    /// The geometry's own flow.
    Exact,
    /// Runge and Kutta's method of order 4, steps of one length.
    Rk4,
    /// Dormand and Prince's method of order 5, steps by a tolerance.
    Dopri5,
    /// The book's: Euler's method, steps of one length.
    Euler,
}

impl Integrator {
    /// Step of the methods with steps of one length where none is given.
    const STEP: f64 = 0.05;

    /// Tolerance of the adaptive method where none is given.
    const TOLERANCE: f64 = 1e-6;

    /// The method with its parameter; `tolerance` is left alone where the method has none.
    fn method(self, step: Option<f64>, tolerance: Option<f64>) -> Result<Method, Failure> {
        let refuse = |what: &str| Err(Failure::refused(anyhow::anyhow!("{what}")));
        match (self, step, tolerance) {
            (Self::Exact, Some(_), _) => refuse("--step needs --integrator euler or rk4"),
            (Self::Dopri5, Some(_), _) => refuse("--step: dopri5 chooses its steps by --tolerance"),
            (Self::Euler | Self::Rk4, _, Some(_)) => {
                refuse("--tolerance: this integrator has a --step and no tolerance")
            }
            (Self::Exact, None, _) => Ok(Method::Exact),
            (Self::Euler, step, None) => Ok(Method::Euler { step: step.unwrap_or(Self::STEP) }),
            (Self::Rk4, step, None) => Ok(Method::Rk4 { step: step.unwrap_or(Self::STEP) }),
            (Self::Dopri5, None, tolerance) => Ok(Method::Dopri5 { tolerance: tolerance.unwrap_or(Self::TOLERANCE) }),
        }
    }
}

/// Number format of a computation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Precision {
    /// Single: what the device computes in.
    F32,
    /// Double: what the cpu computes in.
    F64,
}

const SCENE_HELP: &str = "A TOML scene file, or the name of a shipped scene or catalogue space";

#[derive(Args)]
struct RenderArgs {
    #[arg(help = SCENE_HELP)]
    scene: String,
    /// Picture to write: .png (sRGB) or .exr (linear, or the raw values of --shading).
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Pictures FIRST to END - 1 of the scene's camera path, or of its objects in motion (30 pictures in a unit of time),
    /// to files whose name has {frame} or {frame:04} in it. Files that are there are left as they are.
    #[arg(long, value_name = "FIRST..END", value_parser = sequence::parse_range)]
    frames: Option<Range<u32>>,
    /// Which backend draws.
    #[arg(long, value_enum, default_value = "auto")]
    backend: BackendChoice,
    /// Size of the picture (of each eye's with --stereo) in pixels.
    #[arg(long, value_name = "WxH", default_value = "1024x768", value_parser = parse_size)]
    size: [u32; 2],
    /// Largest number of face passages of a ray, instead of the scene's.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=MAX_BOUNCES as i64))]
    bounces: Option<u32>,
    /// How geodesics are integrated.
    #[arg(long, value_enum, default_value = "exact")]
    integrator: Integrator,
    /// Length of the steps of euler and rk4, 0.05 if not given; each is a segment.
    #[arg(long, value_name = "H", value_parser = parse_positive)]
    step: Option<f64>,
    /// With exact: largest deviation of an arc from its geodesic, as a share of a pixel, instead of the scene's. With
    /// dopri5: largest error of a step, 1e-6 if not given.
    #[arg(long, value_name = "E", value_parser = parse_positive)]
    tolerance: Option<f64>,
    /// Both eyes side by side, left eye left.
    #[arg(long)]
    stereo: bool,
    /// Samples per pixel; with 1 the pixel's centre.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=65_536))]
    samples: u32,
    /// Draw again what an eye of a headset saw, from a file of `vr --save-eyes`: its place, frustum and size.
    #[arg(long, value_name = "FILE.json", conflicts_with_all = ["stereo", "frames", "size"])]
    eye: Option<PathBuf>,
    /// What the picture shows, instead of the scene's.
    #[arg(long, value_name = "NAME", value_parser = shading_parser())]
    shading: Option<Shading>,
    /// Show what each pixel costs instead of what is seen, in colours from dark (least) to bright; .exr holds the values.
    #[arg(long, value_name = "WHAT", value_parser = named_parser(Heat::NAMES), conflicts_with_all = ["frames", "recursive"])]
    heatmap: Option<Heat>,
    /// Count work and write what was used, what was left out and what it cost.
    #[arg(long, value_name = "FILE.json")]
    stats: Option<PathBuf>,
    /// Turns the pattern of several samples.
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// With the backend rt: miss shaders trace on by themselves instead of returning to raygen. An experiment; the
    /// device must grant a recursion depth of one more than bounces.
    #[arg(long)]
    recursive: bool,
    /// Keep a feature in that the scene does not need, to measure what leaving it out saves. Repeatable.
    #[arg(long, value_name = "FEATURE", value_parser = feature_parser())]
    keep: Vec<Feature>,
}

#[derive(Args)]
struct VrArgs {
    #[arg(help = SCENE_HELP)]
    scene: String,
    /// Which backend draws; auto takes rt on a GPU that has it, else compute.
    #[arg(long, value_enum, default_value = "auto")]
    backend: BackendChoice,
    /// End after this many frames.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    frames: Option<u32>,
    /// Write what frames cost: times, missed frames, sizes and bounces.
    #[arg(long, value_name = "FILE.json")]
    stats: Option<PathBuf>,
    /// Width and height of an eye, as a share of what the headset recommends.
    #[arg(long, value_name = "SHARE", default_value_t = 1.0, value_parser = parse_share)]
    resolution_scale: f64,
    /// Largest number of face passages of a ray, instead of the scene's.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=MAX_BOUNCES as i64))]
    bounces: Option<u32>,
    /// Hold this many frames per second by giving up bounces and resolution.
    #[arg(long, value_name = "FPS", value_parser = parse_positive)]
    hold_fps: Option<f64>,
    /// Rays for every pixel only within this many degrees of the middle; up to twice as far four pixels share a ray, beyond
    /// that sixteen.
    #[arg(long, value_name = "DEGREES", value_parser = parse_positive)]
    foveation: Option<f64>,
    /// What the head's motion in the room does in the space: it walks there (a closed walk turns what is up by the space's
    /// holonomy), it is where the room's place is (closed walks close, but steps are not true to length), or nothing.
    #[arg(long, value_name = "MODE", value_parser = tracking_parser(), default_value = "holonomy")]
    tracking: Tracking,
    /// Metres in a unit of length of the space; by default such that the scene's eye-distance is that of a human being.
    #[arg(long, value_name = "METRES", value_parser = parse_unit)]
    unit_in_metres: Option<f64>,
    /// Trace the eyes in one dispatch each, to measure what one for both brings.
    #[arg(long)]
    apart: bool,
    /// Do not give the player hands and a head.
    #[arg(long)]
    bare: bool,
    /// End when the headset has been asleep for so long.
    #[arg(long, value_name = "SECONDS", default_value_t = 5.0, value_parser = parse_positive)]
    wait: f64,
    /// Write the last frame to left.png and right.png in this folder, as the headset got it, and left.json and right.json
    /// for `render --eye`.
    #[arg(long, value_name = "FOLDER")]
    save_eyes: Option<PathBuf>,
}

#[derive(Args)]
struct CheckArgs {
    /// A catalogue space, a TOML scene file, or a gluing file (.json).
    scene: String,
    /// Print the report as JSON.
    #[arg(long)]
    json: bool,
}

#[derive(Args)]
struct DevicesArgs {
    /// Print the list as JSON.
    #[arg(long)]
    json: bool,
}

#[derive(Args)]
struct StabilityArgs {
    /// Run only the cases that have this text in their names.
    #[arg(long, value_name = "TEXT")]
    filter: Option<String>,
    /// Run only on this backend; auto is all that are there.
    #[arg(long, value_enum, default_value = "auto")]
    backend: BackendChoice,
    /// Write the report as JSON to a file.
    #[arg(short, long, value_name = "FILE.json")]
    output: Option<PathBuf>,
    /// Print the report as JSON.
    #[arg(long)]
    json: bool,
    /// Add this to every error, to see that it is caught.
    #[arg(long, value_name = "E", default_value_t = 0.0, value_parser = parse_finite)]
    spoil: f64,
}

/// Where a geodesic starts and how long it is.
#[derive(Args)]
struct GeodesicStart {
    /// Start point in the geometry's coordinates.
    #[arg(long, value_name = "X,Y,..", allow_hyphen_values = true, value_parser = parse_vector)]
    from: Option<Vector>,
    /// Direction in the geometry's components; any scale.
    #[arg(long, value_name = "U,V,..", allow_hyphen_values = true, value_parser = parse_vector)]
    direction: Option<Vector>,
    /// Arc length, may be negative.
    #[arg(long, value_name = "T", allow_hyphen_values = true, value_parser = parse_finite)]
    length: Option<f64>,
    /// Read one JSON object per line from FILE (- is stdin) and write one line each.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["from", "direction", "length"])]
    batch: Option<PathBuf>,
}

#[derive(Args)]
struct GeodesicArgs {
    /// Model geometry.
    #[arg(long, value_name = "G", value_parser = PossibleValuesParser::new(GEOMETRIES.iter().map(|e| e.name)))]
    geometry: Option<String>,
    #[command(flatten)]
    start: GeodesicStart,
    /// Number format of all that is computed along the way; f64 on the cpu and f32 on the device if not given.
    #[arg(long, value_enum)]
    precision: Option<Precision>,
    /// How geodesics are integrated.
    #[arg(long, value_enum, default_value = "exact")]
    integrator: Integrator,
    /// Length of the steps of euler and rk4, 0.05 if not given.
    #[arg(long, value_name = "H", value_parser = parse_positive)]
    step: Option<f64>,
    /// Largest error of a step of dopri5, 1e-6 if not given.
    #[arg(long, value_name = "E", value_parser = parse_positive)]
    tolerance: Option<f64>,
    /// cpu computes in f64 or f32, compute in f32 with the shader's own function on the device; auto is compute for f32,
    /// else cpu.
    #[arg(long, value_enum, default_value = "cpu")]
    backend: BackendChoice,
    /// Print the result as JSON.
    #[arg(long)]
    json: bool,
}

#[derive(Args)]
struct AccuracyArgs {
    /// TOML scene files or names of shipped scenes, whose pictures are compared with a converged reference; without any
    /// scene or geometry, all geometries.
    scenes: Vec<String>,
    /// Model geometry whose geodesics are measured. Repeatable.
    #[arg(long, value_name = "G", value_parser = PossibleValuesParser::new(GEOMETRIES.iter().map(|e| e.name)))]
    geometry: Vec<String>,
    /// All geometries beside the scenes.
    #[arg(long, conflicts_with = "geometry")]
    all: bool,
    /// A scene to draw with Euler's steps against numbers of bounces, as the book's Figure 5.5 does.
    #[arg(long, value_name = "SCENE")]
    figure: Option<String>,
    /// A scene whose default tolerance is checked for convergence, and compared with fixed steps. Repeatable.
    #[arg(long, value_name = "SCENE")]
    converged: Vec<String>,
    /// Measure what the scenes leave out, by keeping each part in.
    #[arg(long)]
    leave_out: bool,
    /// Folder for accuracy.json, .csv, .svg and the files of further tables and plots; made if it is not there.
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Size of the pictures.
    #[arg(long, value_name = "WxH", default_value = "96x72", value_parser = parse_size)]
    size: [u32; 2],
    /// Backends to measure. Repeatable; cpu, and compute where there is a device, if not given.
    #[arg(long, value_enum)]
    backend: Vec<BackendChoice>,
    /// Seconds of a frame after which Euler's step is halved no more.
    #[arg(long, value_name = "S", default_value_t = 4.0, value_parser = parse_positive)]
    limit: f64,
    /// Print the report as JSON instead of tables.
    #[arg(long)]
    json: bool,
}

#[derive(Args)]
struct ProfileArgs {
    /// TOML scene files or names of shipped scenes; without any, the scenes of all named spaces.
    scenes: Vec<String>,
    /// Largest numbers of face passages of a ray.
    #[arg(long, value_name = "N,N,..", value_delimiter = ',', default_value = "1,2,3,4,6,8,12,16",
        value_parser = clap::value_parser!(u32).range(1..=MAX_BOUNCES as i64))]
    bounces: Vec<u32>,
    /// Backends to measure; auto is all that are there.
    #[arg(long, value_enum, value_name = "B,B,..", value_delimiter = ',', default_value = "auto")]
    backend: Vec<BackendChoice>,
    /// Sizes of the picture (of each eye's with --stereo) in pixels.
    #[arg(long, value_name = "WxH,..", value_delimiter = ',', default_value = "256x256", value_parser = parse_size)]
    size: Vec<[u32; 2]>,
    /// Both eyes, beside one eye for control.
    #[arg(long)]
    stereo: bool,
    /// Frames of each configuration that are measured.
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    frames: u32,
    /// Frames of each configuration that are thrown away before, besides the first; more where they take less than half a
    /// second.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(0..=100_000))]
    warm_up: u32,
    /// How geodesics that are curved in the chart are integrated.
    #[arg(long, value_enum, default_value = "exact")]
    integrator: Integrator,
    /// Lengths of the steps of euler and rk4, for curved geodesics.
    #[arg(long, value_name = "H,H,..", value_delimiter = ',', value_parser = parse_positive)]
    steps: Vec<f64>,
    /// Tolerances of exact and dopri5, for curved geodesics; as `render --tolerance`.
    #[arg(long, value_name = "E,E,..", value_delimiter = ',', value_parser = parse_positive)]
    tolerances: Vec<f64>,
    /// The book's settings: both eyes beside one, 1512x1680 for an eye in its spaces with straight geodesics and 1360x1512
    /// in those with curved ones.
    #[arg(long, conflicts_with = "size")]
    book: bool,
    /// Print the ratios to an earlier run's profile.json, and write them to profile-comparison.csv.
    #[arg(long, value_name = "FILE.json")]
    compare: Option<PathBuf>,
    /// Folder for profile.json, .csv, .svg and a plot for each scene; made if it is not there.
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Print the report as JSON instead of tables.
    #[arg(long)]
    json: bool,
}

#[derive(Args)]
struct TransportArgs {
    #[arg(help = SCENE_HELP)]
    scene: String,
    #[command(flatten)]
    start: GeodesicStart,
    /// Cell of the start point.
    #[arg(long, value_name = "N", default_value_t = 0)]
    cell: usize,
    /// Follow this pixel's ray instead, and list what it meets.
    #[arg(long, value_name = "X,Y", value_parser = parse_pixel, conflicts_with_all = ["from", "direction", "length", "batch"])]
    pixel: Option<[u32; 2]>,
    /// Size of the picture that --pixel belongs to.
    #[arg(long, value_name = "WxH", default_value = "1024x768", value_parser = parse_size)]
    size: [u32; 2],
    /// Largest number of face passages of the pixel's ray, instead of the scene's.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=MAX_BOUNCES as i64))]
    bounces: Option<u32>,
    /// Results are always JSON; accepted for symmetry with the other commands.
    #[arg(long)]
    json: bool,
}

/// Numbers given on the command line: 3 or 4 of them.
type Vector = Vec<f64>;

/// Parses and runs one command.
///
/// # Errors
/// [`Failure`], whose text is one line.
pub fn run(args: impl IntoIterator<Item = OsString>) -> Outcome {
    let cli = match Cli::try_parse_from(args) {
        Ok(cli) => cli,
        Err(error) if matches!(error.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion) => {
            let text = error.render();
            let colored = io::stdout().is_terminal();
            print_ignoring_closed_pipe(&if colored { text.ansi().to_string() } else { text.to_string() });
            return Ok(());
        }
        Err(error) => return Err(Failure::Refused(anyhow::Error::msg(usage_error(&error)))),
    };
    match cli.command {
        Command::Render(args) => render::run(&args),
        Command::Vr(args) => vr::run(&args),
        Command::Check(args) => check::run(&args),
        Command::Devices(args) => devices::run(&args),
        Command::Geodesic(args) => geodesic::run(&args),
        Command::Stability(args) => stability::run(&args),
        Command::Accuracy(args) => accuracy::run(&args),
        Command::Profile(args) => profile::run(&args),
        Command::Transport(args) => transport::run(&args),
    }
}

/// clap's message without its usage block, on one line.
fn usage_error(error: &clap::Error) -> String {
    if error.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand {
        let names: Vec<String> = Cli::command().get_subcommands().map(|c| c.get_name().to_owned()).collect();
        return format!("a command is missing: {} (--help explains them)", names.join(", "));
    }
    let text = error.render().to_string();
    let lines = text.lines().map(str::trim).take_while(|line| !line.starts_with("Usage:"));
    let mut message = String::new();
    for line in lines.filter(|line| !line.is_empty() && !line.starts_with("For more information")) {
        // Lists of values and of arguments belong to the line before them, tips do not.
        message += match message.chars().last() {
            None => "",
            Some(':') => " ",
            Some(_) if line.starts_with('[') => " ",
            Some(_) => "; ",
        };
        message += line;
    }
    message.strip_prefix("error: ").unwrap_or(&message).to_owned()
}

/// Prints to stdout. A reader that has gone away (a pager that was quit) is no error.
fn print_ignoring_closed_pipe(text: &str) {
    use io::Write;
    let _ = io::stdout().lock().write_all(text.as_bytes());
}

/// Writes one line to stdout; a closed pipe ends the program's work in peace.
fn print_line(out: &mut impl io::Write, line: &str) -> Result<bool, Failure> {
    match writeln!(out, "{line}") {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(false),
        Err(error) => Err(Failure::failed(anyhow::Error::new(error).context("standard output"))),
    }
}

/// Largest side of a picture.
const MAX_SIDE: u32 = 16_384;

fn parse_size(text: &str) -> Result<[u32; 2], String> {
    let form = || format!("expected WIDTHxHEIGHT with sides from 1 to {MAX_SIDE}, such as 1024x768");
    let (width, height) = text.split_once(['x', 'X']).ok_or_else(form)?;
    let side = |text: &str| text.parse().ok().filter(|side| (1..=MAX_SIDE).contains(side)).ok_or_else(form);
    Ok([side(width)?, side(height)?])
}

fn parse_pixel(text: &str) -> Result<[u32; 2], String> {
    let form = || String::from("expected COLUMN,ROW, such as 320,200");
    let (x, y) = text.split_once(',').ok_or_else(form)?;
    let number = |text: &str| text.trim().parse::<u32>().map_err(|_| form());
    Ok([number(x)?, number(y)?])
}

fn parse_finite(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(number),
        Ok(_) => Err(String::from("the number must be finite")),
        Err(_) => Err(String::from("expected a number")),
    }
}

fn parse_positive(text: &str) -> Result<f64, String> {
    parse_finite(text).and_then(|x| if x > 0.0 { Ok(x) } else { Err(String::from("the number must be positive")) })
}

fn parse_vector(text: &str) -> Result<Vector, String> {
    let numbers = text.split(',').map(parse_finite).collect::<Result<Vec<_>, _>>()?;
    if (3..=4).contains(&numbers.len()) {
        Ok(numbers)
    } else {
        Err(format!("expected 3 or 4 numbers separated by commas, found {}", numbers.len()))
    }
}

/// Resolutions beyond twice the recommended one exceed what headsets take.
fn parse_share(text: &str) -> Result<f64, String> {
    let share = parse_finite(text)?;
    if (0.05..=2.0).contains(&share) { Ok(share) } else { Err(String::from("expected a number from 0.05 to 2")) }
}

/// A room of 100 metres is at most 10,000 units large.
fn parse_unit(text: &str) -> Result<f64, String> {
    let unit = parse_finite(text)?;
    if (0.01..=1e6).contains(&unit) { Ok(unit) } else { Err(String::from("expected a number from 0.01 to 1000000")) }
}

fn tracking_parser() -> impl TypedValueParser<Value = Tracking> {
    named_parser(Tracking::NAMES)
}

fn shading_parser() -> impl TypedValueParser<Value = Shading> {
    named_parser(Shading::NAMES)
}

fn feature_parser() -> impl TypedValueParser<Value = Feature> {
    named_parser(Feature::NAMES)
}

/// A parser for one of a list of names.
fn named_parser<T: Copy + Send + Sync + 'static>(
    names: &'static [(&'static str, T)],
) -> impl TypedValueParser<Value = T> {
    PossibleValuesParser::new(names.iter().map(|(name, _)| *name)).try_map(move |given| {
        names.iter().find(|(name, _)| *name == given).map(|(_, value)| *value).ok_or("unknown name")
    })
}
