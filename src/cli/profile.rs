//! `holonomy profile`: frame time over bounces.

use super::{
    BackendChoice, Failure, Integrator, Outcome, ProfileArgs,
    backends::{Opened, measure_failure},
    output::PendingFile,
    print_line,
    progress::Progress,
};
use crate::{
    integrate::Method,
    measure::{
        compare::Earlier,
        machine::machine,
        profile::{Contender, Following, KEY, Request, Subject, keys, measure, over_bounces, plot},
        report::{Report, Table},
    },
    render::{plan::Plan, rt::RtOptions},
    scene::{file, shipped},
    space::catalogue,
};
use anyhow::{Context as _, anyhow};
use serde_json::{Value, json};
use std::{
    fs,
    io::{Write, stderr, stdout},
    path::Path,
};

/// Size of an eye in the book's Figure 4.6.
const STRAIGHT_SIZE: [u32; 2] = [1512, 1680];

/// Size of an eye in the book's Figure 5.4.
const CURVED_SIZE: [u32; 2] = [1360, 1512];

/// What is shown on the terminal over bounces: name, what it is, column of the table of frames.
const SHOWN: [(&str, &str, &str); 7] = [
    ("frame-ms", "median frame time in ms, by device time stamps (wall time on the cpu)", "frame_ms_median"),
    ("cpu-ms", "median processor time of a frame in ms, user and system, all threads", "cpu_ms_median"),
    ("ns-per-segment", "frame time per segment of primary and shadow rays", "ns_per_segment"),
    ("cpu-ns-per-segment", "processor time per segment of primary and shadow rays", "cpu_ns_per_segment"),
    ("segments", "segments of primary rays per pixel", "segments_per_pixel"),
    ("nodes", "hierarchy nodes per pixel, shadow rays included", "nodes_per_pixel"),
    ("tests", "tests of triangles and quadrics per pixel, shadow rays included", "tests_per_pixel"),
];

pub(super) fn run(args: &ProfileArgs) -> Outcome {
    let subjects = subjects(args)?;
    let earlier = args.compare.as_deref().map(read_earlier).transpose()?;
    let opened = open(&args.backend)?;
    let makers: Vec<_> = opened.iter().map(|o| (o.name(), || o.make(RtOptions::default()))).collect();
    let contenders: Vec<Contender<'_>> = makers.iter().map(|(name, make)| Contender { name, make }).collect();
    let mut bounces = args.bounces.clone();
    bounces.sort_unstable();
    bounces.dedup();
    let request = Request {
        subjects: &subjects,
        contenders: &contenders,
        bounces: &bounces,
        stereo: args.stereo || args.book,
        warm_up: args.warm_up as usize,
        frames: args.frames as usize,
    };
    let devices = check(&request)?;
    if let (Some(earlier), Some(path)) = (&earlier, &args.compare) {
        let keys = keys(&request);
        let known = keys.iter().filter(|key| earlier.has(key)).count();
        if known == 0 {
            return Err(Failure::refused(anyhow!("{}: has none of these configurations", path.display())));
        }
        if known < keys.len() {
            let _ = writeln!(
                stderr(),
                "{} of {} configurations are not in {}",
                keys.len() - known,
                keys.len(),
                path.display()
            );
        }
    }
    // Nothing is measured whose result could not be written.
    let folder = Folder::new(&args.output)?;
    let scenes: Vec<&str> = subjects.iter().map(|subject| subject.scene.name.as_str()).collect();
    let single: Vec<&str> = scenes.iter().copied().filter(|_| scenes.len() > 1).collect();
    let mut names: Vec<String> = ["profile.json", "profile.csv", "profile.svg"].map(String::from).to_vec();
    names.extend(single.iter().map(|name| format!("profile-{}.svg", stem(name))));
    names.extend(earlier.iter().map(|_| String::from("profile-comparison.csv")));
    // They are opened again only when all is measured, so that an interrupted run leaves no temporary file.
    let create = |name: &String| PendingFile::create(&args.output.join(name));
    for name in &names {
        create(name)?;
    }

    let before = machine();
    let progress = Progress::new();
    let table = measure(&request, &|what, share| progress.say(what, share)).map_err(measure_failure)?;
    progress.finish();
    let settings = json!({
        "version": env!("CARGO_PKG_VERSION"),
        "machine": before,
        "machine_after": machine(),
        "backends": devices,
        "bounces": bounces,
        "frames": args.frames,
        "warm_up": args.warm_up,
        "book": args.book,
    });
    let comparison = earlier.as_ref().map(|earlier| earlier.compare(&table));
    let tables = std::iter::once(table.clone()).chain(comparison.clone()).collect();
    let report = Report { command: String::from("profile"), settings, tables };

    let mut contents = vec![
        serde_json::to_string_pretty(&report.json()).map_err(Failure::failed)?,
        table.csv(),
        plot(&table, None).svg().map_err(Failure::failed)?,
    ];
    for name in &single {
        contents.push(plot(&table, Some(name)).svg().map_err(Failure::failed)?);
    }
    contents.extend(comparison.iter().map(Table::csv));
    let files = names.iter().map(create).collect::<Result<Vec<_>, _>>()?;
    for (file, content) in files.into_iter().zip(&contents) {
        file.finish(content.as_bytes())?;
    }
    folder.keep();
    if let Some(earlier) = &earlier {
        warn_of_another_machine(&earlier.settings, &report.settings);
    }
    if args.json {
        return print_line(&mut stdout().lock(), &report.json().to_string()).map(|_| ());
    }
    let shown = SHOWN.iter().map(|(name, about, value)| over_bounces(&table, name, about, value));
    for table in shown.filter(|table| !table.rows.is_empty()).chain(comparison.as_ref().map(readable)) {
        if !print_line(&mut stdout().lock(), &table.text())? {
            break;
        }
    }
    Ok(())
}

/// The scenes, each with its sizes and the ways to follow its rays.
fn subjects(args: &ProfileArgs) -> Result<Vec<Subject>, Failure> {
    let curved = curved(args)?;
    let varied = args.integrator != Integrator::Exact || !args.tolerances.is_empty();
    let names: Vec<String> = match (args.scenes.is_empty(), args.book) {
        (false, _) => args.scenes.clone(),
        (true, true) => shipped::of_the_book().map(str::to_owned).collect(),
        (true, false) => catalogue::NAMES.iter().map(|name| (*name).to_owned()).collect(),
    };
    let names = distinct(&names);
    let mut sizes = args.size.clone();
    sizes.sort_unstable();
    sizes.dedup();
    let subject = |name: &String| {
        let scene = file::load(name).map_err(Failure::refused)?;
        let straight = scene.space.geometry.is_straight();
        let following =
            if straight { vec![Following { method: Method::Exact, tolerance: None }] } else { curved.clone() };
        let sizes = match (args.book, straight) {
            (true, true) => vec![STRAIGHT_SIZE],
            (true, false) => vec![CURVED_SIZE],
            (false, _) => sizes.clone(),
        };
        Ok(Subject { scene, sizes, following })
    };
    let subjects = names.iter().map(subject).collect::<Result<Vec<_>, Failure>>()?;
    if varied && subjects.iter().all(|subject| subject.scene.space.geometry.is_straight()) {
        return Err(Failure::refused(anyhow!(
            "--integrator, --steps, --tolerances: geodesics are straight in the charts of these scenes"
        )));
    }
    Ok(subjects)
}

/// Ways to follow curved geodesics.
fn curved(args: &ProfileArgs) -> Result<Vec<Following>, Failure> {
    let following = |step: Option<f64>, tolerance: Option<f64>| -> Result<Following, Failure> {
        let method = args.integrator.method(step, tolerance)?;
        Ok(Following { method, tolerance: tolerance.filter(|_| method == Method::Exact) })
    };
    match (&args.steps[..], &args.tolerances[..]) {
        ([], []) => Ok(vec![following(None, None)?]),
        (steps, []) => steps.iter().map(|step| following(Some(*step), None)).collect(),
        ([], tolerances) => tolerances.iter().map(|tolerance| following(None, Some(*tolerance))).collect(),
        _ => Err(Failure::refused(anyhow!("--steps and --tolerances belong to different integrators"))),
    }
}

/// The backends asked for; `auto` stands for all that are there.
fn open(wish: &[BackendChoice]) -> Result<Vec<Opened>, Failure> {
    if wish.contains(&BackendChoice::Auto) {
        let (there, missing) = Opened::available(&[BackendChoice::Cpu, BackendChoice::Compute, BackendChoice::Rt]);
        for (choice, reason) in missing {
            if let (Failure::Refused(_), _) | (_, true) = (&reason, wish.contains(&choice)) {
                return Err(reason);
            }
            let _ = writeln!(stderr(), "{} is not measured: {reason}", format!("{choice:?}").to_lowercase());
        }
        return Ok(there);
    }
    Ok(distinct(wish).into_iter().map(Opened::new).collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect())
}

/// Each of the values once, where it comes first.
fn distinct<T: Clone + PartialEq>(values: &[T]) -> Vec<T> {
    let first = |(index, value): (usize, &T)| (!values[..index].contains(value)).then(|| value.clone());
    values.iter().enumerate().filter_map(first).collect()
}

/// Whether all backends can draw all scenes; their devices.
fn check(request: &Request<'_>) -> Result<Vec<Value>, Failure> {
    let mut devices = Vec::new();
    for contender in request.contenders {
        let backend = (contender.make)().map_err(Failure::failed)?;
        for subject in request.subjects {
            backend.check(&Plan::new(&subject.scene, true)).map_err(|missing| {
                Failure::failed(anyhow!("{}: {} lacks {missing}", subject.scene.name, backend.device()))
            })?;
        }
        devices.push(json!({ "backend": contender.name, "device": backend.device() }));
    }
    Ok(devices)
}

fn read_earlier(path: &Path) -> Result<Earlier, Failure> {
    let shown = path.display().to_string();
    let text = fs::read_to_string(path).with_context(|| shown.clone()).map_err(Failure::Refused)?;
    Earlier::read(&text).map_err(|why| Failure::refused(anyhow!("{shown}: {why}")))
}

/// Times of different machines tell nothing of the program.
fn warn_of_another_machine(before: &Value, now: &Value) {
    let same = |key: &str| before["machine"][key] == now["machine"][key];
    if !same("processor") || !same("threads") || before["backends"] != now["backends"] {
        let _ =
            writeln!(stderr(), "warning: the earlier profile is of another machine, other backends or another driver");
    }
}

/// A comparison without what is the same in all rows of its key.
fn readable(table: &Table) -> Table {
    let differs = |i: usize| table.rows.windows(2).any(|pair| pair[0][i] != pair[1][i]);
    table.only(|i| i < 2 || i >= KEY.len() || differs(i))
}

/// A scene's name as a part of a file's name.
fn stem(scene: &str) -> String {
    let stem = Path::new(scene).file_stem().map_or(scene.into(), |stem| stem.to_string_lossy());
    stem.replace(|c: char| !c.is_alphanumeric() && c != '-' && c != '_', "-")
}

/// The folder of the results. One that was made goes again if there are none.
struct Folder<'a>(Option<&'a Path>);

impl<'a> Folder<'a> {
    fn new(path: &'a Path) -> Result<Self, Failure> {
        let made = !path.exists();
        fs::create_dir_all(path).with_context(|| path.display().to_string()).map_err(Failure::Refused)?;
        Ok(Self(made.then_some(path)))
    }

    fn keep(mut self) {
        self.0 = None;
    }
}

impl Drop for Folder<'_> {
    fn drop(&mut self) {
        if let Some(path) = self.0 {
            // Only if it is empty.
            let _ = fs::remove_dir(path);
        }
    }
}
