//! The `holonomy` program: parses, runs, and turns the outcome into an exit code.

use std::{io::Write, process::ExitCode};

fn main() -> ExitCode {
    match holonomy::cli::run(std::env::args_os()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            // A closed stderr changes nothing about the outcome.
            let _ = writeln!(std::io::stderr(), "holonomy: {failure}");
            failure.exit_code()
        }
    }
}
