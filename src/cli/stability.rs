//! `holonomy stability`: every stiff and extreme case, with error, floor and verdict.

use super::{BackendChoice, Failure, Outcome, StabilityArgs, output::PendingFile, print_line, progress::Progress};
use crate::measure::stability::{self, Bench, Case, Line, On, Reading, Verdict};
use anyhow::anyhow;
use serde_json::{Value, json};
use std::{fmt::Write as _, io::stdout};

pub(super) fn run(args: &StabilityArgs) -> Outcome {
    let mut cases = stability::cases();
    if let Some(text) = &args.filter {
        cases.retain(|case| case.name.contains(text.as_str()));
        if cases.is_empty() {
            return Err(Failure::refused(anyhow!("--filter {text}: no case has this in its name")));
        }
    }
    let file = args.output.as_deref().map(PendingFile::create).transpose()?;
    let wanted: &[On] = match args.backend {
        BackendChoice::Auto => &On::ALL,
        BackendChoice::Cpu => &[On::Cpu, On::CpuSingle],
        BackendChoice::Compute => &[On::Compute],
        BackendChoice::Rt => &[On::Rt],
    };
    let mut bench = Bench::new(wanted).map_err(Failure::vulkan)?;
    if let (Some((on, reason)), true) = (bench.missing.first(), args.backend != BackendChoice::Auto) {
        return Err(Failure::failed(anyhow!("{}: {reason}", on.name())));
    }
    let progress = Progress::new();
    let spoil = |_: &Case, _: On, reading: &mut Reading| reading.error += args.spoil;
    let lines = stability::run(&cases, &mut bench, spoil, |share| progress.set(share));
    progress.finish();
    let report = report(&cases, &bench, &lines);
    if let Some(file) = file {
        file.finish(serde_json::to_string_pretty(&report).map_err(Failure::failed)?.as_bytes())?;
    }
    let text = if args.json { report.to_string() } else { as_text(&bench, &lines) };
    print_line(&mut stdout().lock(), &text)?;
    verdict(&lines)
}

/// A failure if a case failed, or if none ran.
fn verdict(lines: &[Line]) -> Outcome {
    let failed: Vec<String> = lines
        .iter()
        .filter(|line| line.verdict == Verdict::Fail)
        .map(|line| format!("{} on {}", line.name, line.backend.name()))
        .collect();
    match failed.as_slice() {
        [] if lines.is_empty() => Err(Failure::failed(anyhow!("no case concerns the backends that are there"))),
        [] => Ok(()),
        [first, ..] => {
            Err(Failure::failed(anyhow!("{} of {} readings fail, the first: {first}", failed.len(), lines.len())))
        }
    }
}

fn count(lines: &[Line], verdict: Verdict) -> usize {
    lines.iter().filter(|line| line.verdict == verdict).count()
}

fn report(cases: &[Case], bench: &Bench, lines: &[Line]) -> Value {
    json!({
        "schema": 1,
        "backends": bench.devices().iter().map(|(on, device)| json!({ "backend": on.name(), "device": device })).collect::<Vec<_>>(),
        "skipped": bench.missing.iter().map(|(on, why)| json!({ "backend": on.name(), "reason": why })).collect::<Vec<_>>(),
        "cases": cases.len(),
        "passed": count(lines, Verdict::Pass),
        "accepted": count(lines, Verdict::Accepted),
        "failed": count(lines, Verdict::Fail),
        "readings": lines,
    })
}

/// A line for each reading, then a table of the families, then what is not met.
fn as_text(bench: &Bench, lines: &[Line]) -> String {
    let mut text = String::new();
    let width = lines.iter().map(|line| line.name.chars().count()).max().unwrap_or(0);
    for line in lines {
        let _ = writeln!(
            text,
            "{:<width$}  {:<7}  error {:>8.1e}  floor {:>8.1e}  limit {:>8.1e}  {}{}",
            line.name,
            line.backend.name(),
            line.error,
            line.floor,
            line.limit,
            line.verdict.name(),
            line.printed_error.map_or(String::new(), |error| format!(", the book's {error:.1e}")),
        );
    }
    let mut families: Vec<&str> = Vec::new();
    for line in lines {
        if !families.contains(&line.family) {
            families.push(line.family);
        }
    }
    let _ = writeln!(text, "\n{:<16} {:>8} {:>8}   worst error/limit", "family", "cases", "readings");
    for family in families {
        let of: Vec<&Line> = lines.iter().filter(|line| line.family == family).collect();
        let mut names: Vec<&str> = of.iter().map(|line| line.name.as_str()).collect();
        names.dedup();
        let share = |line: &&&Line| if line.error == 0.0 { 0.0 } else { line.error / line.limit };
        let worst = of.iter().max_by(|a, b| share(a).total_cmp(&share(b)));
        let worst = worst
            .map_or(String::new(), |line| format!("{:>8.2}  {} on {}", share(&line), line.name, line.backend.name()));
        let _ = writeln!(text, "{family:<16} {:>8} {:>8}   {worst}", names.len(), of.len());
    }
    for (on, why) in &bench.missing {
        let _ = writeln!(text, "skipped: {}: {why}", on.name());
    }
    for line in lines.iter().filter(|line| line.verdict != Verdict::Pass) {
        let _ = writeln!(
            text,
            "{}: {} on {}: {:.2e} ({}), limit {:.2e}{}",
            line.verdict.name(),
            line.name,
            line.backend.name(),
            line.error,
            line.quantity,
            line.accepted_limit.unwrap_or(line.limit),
            line.reason.as_ref().map_or(String::new(), |reason| format!(": {reason}")),
        );
    }
    let counts = [Verdict::Pass, Verdict::Accepted, Verdict::Fail].map(|verdict| count(lines, verdict));
    let _ = write!(text, "{} pass, {} accepted limits, {} fail", counts[0], counts[1], counts[2]);
    text
}
