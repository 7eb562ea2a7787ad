//! `holonomy accuracy`: error against run time.

use super::{
    AccuracyArgs, BackendChoice, Failure, Outcome,
    backends::{Opened, measure_failure},
    output::{PendingFile, PictureFormat, encode},
    print_line,
    progress::Progress,
};
use crate::{
    geometry::{GEOMETRIES, GeometryId},
    measure::{
        accuracy::{Findings, Request, measure},
        report::Report,
    },
    scene::{Scene, file},
};
use anyhow::{Context as _, anyhow};
use serde_json::{Value, json};
use std::{
    fs,
    io::{Write, stderr, stdout},
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

    let opened = open(&args.backend)?;
    let device = opened.iter().find_map(|o| if let Opened::Compute(context) = o { Some(context) } else { None });
    let mut backends = opened.iter().map(Opened::backend).collect::<Result<Vec<_>, _>>()?;
    let devices: Vec<String> = backends.iter().map(|b| format!("{}: {}", b.name(), b.device())).collect();
    let progress = Progress::new();
    let request = Request {
        geometries: &geometries,
        scenes: &scenes,
        figure: figure.as_ref(),
        converged: &converged,
        leave_out: args.leave_out,
        size: args.size,
        limit: Duration::from_secs_f64(args.limit),
        device,
    };
    let findings =
        measure(&request, &mut backends, &|what, share| progress.say(what, share)).map_err(measure_failure)?;
    progress.finish();
    let settings = json!({ "backends": devices, "size": args.size, "threads": rayon::current_num_threads() });
    write(args, settings, findings)
}

/// The backends asked for. Without a wish: the cpu, and compute where a device has it.
fn open(wish: &[BackendChoice]) -> Result<Vec<Opened>, Failure> {
    if wish.is_empty() {
        let (there, missing) = Opened::available(&[BackendChoice::Cpu, BackendChoice::Compute]);
        for (_, reason) in missing {
            let _ = writeln!(stderr(), "the cpu alone is measured: {reason}");
        }
        return Ok(there);
    }
    let named = || Failure::refused(anyhow!("--backend: name cpu, compute or rt"));
    wish.iter().map(|choice| Opened::new(*choice)?.ok_or_else(named)).collect()
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
