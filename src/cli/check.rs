//! `holonomy check`: is a gluing a manifold or an orbifold?

use super::{CheckArgs, Failure, Outcome, print_line};
use crate::{scene::file, space::check::check};
use std::io::stdout;

pub(super) fn run(args: &CheckArgs) -> Outcome {
    let space = file::load_space(&args.scene).map_err(Failure::refused)?;
    let report =
        check(&space).map_err(|error| Failure::refused(anyhow::Error::new(error).context(space.name.clone())))?;
    let text = if args.json { serde_json::to_string(&report).map_err(Failure::failed)? } else { report.to_string() };
    print_line(&mut stdout().lock(), &text).map(|_| ())
}
