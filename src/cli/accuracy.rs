//! `holonomy accuracy`: error against run time.

use super::{
    AccuracyArgs, BackendChoice, Failure, Outcome,
    output::{PendingFile, PictureFormat, encode},
    print_line,
};
use crate::{
    geometry::{GEOMETRIES, GeometryId},
    measure::{
        MeasureError,
        accuracy::{Findings, Request, measure},
        report::Report,
    },
    render::{Backend, compute::ComputeBackend, cpu::CpuBackend, rt::RtBackend},
    scene::{Scene, file},
    vulkan::{Context, ContextOptions, Tier},
};
use anyhow::{Context as _, anyhow};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde_json::{Value, json};
use std::{
    fs,
    io::{Write, stderr, stdout},
    sync::Arc,
    time::Duration,
};

pub(super) fn run(args: &AccuracyArgs) -> Outcome {
    let load = |name: &String| file::load(name).map_err(Failure::refused);
    let scenes = args.scenes.iter().map(load).collect::<Result<Vec<Scene>, _>>()?;
    let figure = args.figure.as_ref().map(load).transpose()?;
    let converged = args.converged.iter().map(load).collect::<Result<Vec<Scene>, _>>()?;
    let named = args.geometry.iter().filter_map(|name| GeometryId::from_name(name)).collect::<Vec<_>>();
    let nothing_named = named.is_empty() && scenes.is_empty() && figure.is_none() && converged.is_empty();
    let geometries = if nothing_named || args.all { GEOMETRIES.iter().map(|e| e.id).collect() } else { named };
    fs::create_dir_all(&args.output).with_context(|| args.output.display().to_string()).map_err(Failure::Refused)?;

    let (mut backends, device) = open(&args.backend)?;
    let devices: Vec<String> = backends.iter().map(|b| format!("{}: {}", b.name(), b.device())).collect();
    let bar = ProgressBar::with_draw_target(Some(1000), ProgressDrawTarget::stderr());
    if let Ok(style) = ProgressStyle::with_template("{wide_bar} {percent:>3} %, {eta} left, {msg}") {
        bar.set_style(style);
    }
    let progress = |what: &str, share: f64| {
        bar.set_message(what.to_owned());
        bar.set_position((share * 1000.0) as u64);
    };
    let request = Request {
        geometries: &geometries,
        scenes: &scenes,
        figure: figure.as_ref(),
        converged: &converged,
        leave_out: args.leave_out,
        size: args.size,
        limit: Duration::from_secs_f64(args.limit),
        device: device.as_ref(),
    };
    let findings = measure(&request, &mut backends, &progress).map_err(|error| match error {
        MeasureError::World(error) => Failure::refused(error),
        error => Failure::failed(error),
    })?;
    bar.finish_and_clear();
    let settings = json!({ "backends": devices, "size": args.size, "threads": rayon::current_num_threads() });
    write(args, settings, findings)
}

/// Backends, and the device of `compute`.
type Opened = (Vec<Box<dyn Backend>>, Option<Arc<Context>>);

/// The backends asked for, and the device of `compute`. Without a wish: the cpu, and compute where a device has it.
fn open(wish: &[BackendChoice]) -> Result<Opened, Failure> {
    let context = |tier| {
        let options = ContextOptions { tier, ..ContextOptions::from_env().map_err(Failure::vulkan)? };
        Context::new(&options).map_err(Failure::vulkan)
    };
    let (mut backends, mut device): (Vec<Box<dyn Backend>>, _) = (Vec::new(), None);
    let mut compute = |context: Arc<Context>| -> Result<Box<dyn Backend>, Failure> {
        let backend = ComputeBackend::new(&context).map_err(Failure::failed)?;
        device = Some(context);
        Ok(Box::new(backend))
    };
    for choice in wish {
        match choice {
            BackendChoice::Cpu => backends.push(Box::new(CpuBackend::default())),
            BackendChoice::Compute => backends.push(compute(context(Tier::Compute)?)?),
            BackendChoice::Rt => {
                backends.push(Box::new(RtBackend::new(&context(Tier::Rt)?).map_err(Failure::failed)?));
            }
            BackendChoice::Auto => return Err(Failure::refused(anyhow!("--backend: name cpu, compute or rt"))),
        }
    }
    if wish.is_empty() {
        backends.push(Box::new(CpuBackend::default()));
        match context(Tier::Compute) {
            Ok(context) => backends.push(compute(context)?),
            Err(reason) => {
                let _ = writeln!(stderr(), "the cpu alone is measured: {reason}");
            }
        }
    }
    Ok((backends, device))
}

/// Writes the files and prints the tables.
fn write(args: &AccuracyArgs, settings: Value, findings: Findings) -> Outcome {
    let report = Report { command: String::from("accuracy"), settings, tables: findings.tables };
    let put = |name: String, content: &[u8]| PendingFile::create(&args.output.join(name))?.finish(content);
    let text = serde_json::to_string_pretty(&report.json()).map_err(Failure::failed)?;
    put(String::from("accuracy.json"), text.as_bytes())?;
    for (index, table) in report.tables.iter().enumerate() {
        // The first table is the one that the command is about.
        let name = if index == 0 { String::from("accuracy.csv") } else { format!("accuracy-{}.csv", table.name) };
        put(name, table.csv().as_bytes())?;
    }
    for (index, (name, plot)) in findings.plots.iter().enumerate() {
        let svg = plot.svg().map_err(Failure::failed)?;
        if index == 0 {
            put(String::from("accuracy.svg"), svg.as_bytes())?;
        }
        put(format!("accuracy-{name}.svg"), svg.as_bytes())?;
    }
    if let Some(sheet) = &findings.sheet {
        put(String::from("accuracy-bounces.png"), &encode(sheet, PictureFormat::Png, false)?)?;
    }
    if args.json {
        return print_line(&mut stdout().lock(), &report.json().to_string()).map(|_| ());
    }
    for table in &report.tables {
        if !print_line(&mut stdout().lock(), &table.text())? {
            break;
        }
    }
    Ok(())
}
