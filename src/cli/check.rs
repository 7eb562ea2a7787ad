//! `holonomy check`: is a gluing a manifold or an orbifold?

use super::{CheckArgs, Failure, Outcome, print_line};
use crate::{
    scene::file,
    space::check::{Report, check},
};
use std::io::stdout;

pub(super) fn run(args: &CheckArgs) -> Outcome {
    let space = file::load_space(&args.scene).map_err(Failure::refused)?;
    let report =
        check(&space).map_err(|error| Failure::refused(anyhow::Error::new(error).context(space.name.clone())))?;
    let text = if args.json { serde_json::to_string(&report).map_err(Failure::failed)? } else { as_text(&report) };
    print_line(&mut stdout().lock(), &text).map(|_| ())
}

/// The report for people: counts first, then each edge cycle.
fn as_text(report: &Report) -> String {
    let homology: Vec<String> = report
        .homology
        .iter()
        .map(|factor| if *factor == 0 { String::from("Z") } else { format!("Z/{factor}") })
        .collect();
    let homology = if homology.is_empty() { String::from("0") } else { homology.join(" + ") };
    let kind = serde_json::to_value(report.kind).ok().and_then(|k| k.as_str().map(str::to_owned)).unwrap_or_default();
    let mut text = format!(
        "{}: {kind} with geometry {}, {}orientable\n\
         cells {}, faces {}, edges {}, corners {}; after gluing {} edges, {} corners\n\
         pairing residual  {:.1e}\n\
         volume            {:.15} (error {:.0e})\n\
         first homology    {homology}\n",
        report.name,
        report.geometry,
        if report.orientable { "" } else { "not " },
        report.cells,
        report.faces,
        report.edges,
        report.vertices,
        report.edge_cycles.len(),
        report.vertex_classes,
        report.pairing_residual,
        report.volume,
        report.volume_error,
    );
    for (index, cycle) in report.edge_cycles.iter().enumerate() {
        text += &format!(
            "edge cycle {index:<3} length {}, angle {:.12}, residual {:.1e}\n",
            cycle.length, cycle.angle, cycle.residual
        );
    }
    text.trim_end().to_owned()
}
