//! The `holonomy` program: parses, runs, and turns the outcome into an exit code.

use std::process::ExitCode;

fn main() -> ExitCode {
    match holonomy::cli::run(std::env::args_os()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("holonomy: {failure}");
            failure.exit_code()
        }
    }
}
