//! The `relume` program.

use std::process::ExitCode;

fn main() -> ExitCode {
    relume_host::cli::run()
}
