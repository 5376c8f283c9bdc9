//! The command line: grammar, dispatch, exit codes.
//!
//! Data go to stdout, people's text and progress to stderr. Exit 0 done, 1 the input is wrong or a
//! limit is hit (one line), 2 wrong usage, 130 interrupted with a valid result.

mod bake;
mod export;
mod form_factor;
mod info;
mod job;
mod load;
mod pack;
mod probe;
mod relight;
mod study;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result};
use clap::{Parser, Subcommand};
use serde_json::Value;

pub use form_factor::{Case, read_cases};

use crate::file::write_whole;

/// Radiosity relighting: bake a scene once with every light kept apart, then dim, switch and
/// colour its lights with all their bounces.
///
/// Without a command: bakes, packs and relights the built-in Cornell box into `out/`.
#[derive(Debug, Parser)]
#[command(name = "relume", version)]
struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
    /// Print one machine-readable object on stdout, and nothing else there
    #[arg(long, global = true)]
    json: bool,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Import a scene (OBJ, glTF), mesh it and solve its light
    Bake(bake::Arguments),
    /// Pack a solution into codes of few bits
    Pack(pack::Arguments),
    /// Make the picture of one mix of the lights
    Relight(relight::Arguments),
    /// Irradiance at points or elements, for every light by itself
    Probe(probe::Arguments),
    /// Form factors between pairs of polygons, with or without blockers
    FormFactor(form_factor::Arguments),
    /// What a solution or atlas holds, and what it costs on a device
    Info(info::Arguments),
    /// What firmware links: an atlas as Rust or C source, or as bytes
    Export(export::Arguments),
    /// Published methods beside ours, measured
    Study(study::Arguments),
}

/// How a command ended, with what `--json` prints.
struct Outcome {
    report: Value,
    interrupted: bool,
}

impl Outcome {
    const fn done(report: Value) -> Self {
        Self {
            report,
            interrupted: false,
        }
    }
}

/// Runs the program on its arguments.
#[must_use]
pub fn run() -> ExitCode {
    let cli = Cli::parse();
    let outcome = match cli.command {
        None => job::run(),
        Some(Command::Bake(arguments)) => bake::run(&arguments, cli.json),
        Some(Command::Pack(arguments)) => pack::run(&arguments, cli.json),
        Some(Command::Relight(arguments)) => relight::run(&arguments, cli.json),
        Some(Command::Probe(arguments)) => probe::run(&arguments, cli.json),
        Some(Command::FormFactor(arguments)) => form_factor::run(&arguments, cli.json),
        Some(Command::Info(arguments)) => info::run(&arguments),
        Some(Command::Export(arguments)) => export::run(&arguments),
        Some(Command::Study(arguments)) => study::run(&arguments),
    };
    let written = outcome.and_then(|outcome| {
        if cli.json {
            write_file(Path::new("-"), format!("{}\n", outcome.report).as_bytes())?;
        }
        Ok(outcome.interrupted)
    });
    match written {
        Ok(interrupted) => ExitCode::from(if interrupted { 130 } else { 0 }),
        Err(error) => {
            tell!("relume: {}", one_line(&error));
            ExitCode::FAILURE
        }
    }
}

/// The error and its causes on one line; a cause that is told already is not told again.
fn one_line(error: &anyhow::Error) -> String {
    let mut line = String::new();
    for cause in error.chain().map(ToString::to_string) {
        if !line.contains(&cause) {
            let separator = if line.is_empty() { "" } else { ": " };
            line = line + separator + &cause;
        }
    }
    // Names of files and lights may hold anything; none of it moves the cursor.
    let visible = |sign: char| match sign {
        '\n' => " ".to_owned(),
        sign if sign.is_control() => sign.escape_default().to_string(),
        sign => sign.to_string(),
    };
    line.chars().map(visible).collect()
}

/// A line for people, on stderr. That nobody can read it (a closed pipe) does not end the work.
macro_rules! tell {
    ($($text:tt)*) => {{
        use std::io::Write as _;
        let _ = writeln!(std::io::stderr(), $($text)*);
    }};
}
use tell;

/// The output path: as given, or the input's name with another extension, in this folder.
///
/// With `--json`, stdout is taken; a result that should go there as well is wrong usage. An output
/// that is the input ends the program, see [`keep`].
fn output_path(given: Option<&Path>, input: &Path, extension: &str, json: bool) -> PathBuf {
    let path = given.map_or_else(
        || {
            let stem = input.file_stem().unwrap_or(input.as_os_str());
            Path::new(stem).with_extension(extension)
        },
        Path::to_path_buf,
    );
    if json && path == Path::new("-") {
        wrong_usage("with --json, stdout holds the report: give -o a file name");
    }
    keep(input, &path);
    path
}

/// Ends the program with exit 1 when `output` is the file `input`, which nobody wants to lose.
fn keep(input: &Path, output: &Path) {
    let [input_file, output_file] = [input, output].map(|path| path.canonicalize().ok());
    if input_file.is_some_and(|file| file.is_file() && output_file == Some(file)) {
        tell!(
            "relume: {}: this is an input, which -o would overwrite; give -o another name",
            output.display()
        );
        std::process::exit(1);
    }
}

/// Ends the program with exit 1 when there is a file at `output` that does not start with `magic`: a
/// material library or a buffer beside the scene, or anything else that nobody wants to lose.
fn spare(output: &Path, magic: &[u8]) {
    use std::io::Read as _;
    let mut start = Vec::new();
    let file = std::fs::File::open(output).and_then(|file| {
        let is_file = file.metadata()?.is_file();
        file.take(magic.len() as u64).read_to_end(&mut start)?;
        Ok(is_file)
    });
    if file.is_ok_and(|is_file| is_file) && !start.is_empty() && start != magic {
        tell!(
            "relume: {}: this file holds something else, which would be overwritten; give another name",
            output.display()
        );
        std::process::exit(1);
    }
}

fn wrong_usage(message: &str) -> ! {
    clap::Error::raw(
        clap::error::ErrorKind::ArgumentConflict,
        format!("{message}\n"),
    )
    .exit()
}

fn write_file(path: &Path, bytes: &[u8]) -> Result<()> {
    write_whole(path, bytes).with_context(|| format!("{}: cannot be written", path.display()))
}

/// A size for people.
fn human_bytes(bytes: usize) -> String {
    const KIB: f64 = 1024.0;
    let bytes = bytes as f64;
    if bytes < KIB {
        format!("{bytes} B")
    } else if bytes < KIB * KIB {
        format!("{:.1} KiB", bytes / KIB)
    } else {
        format!("{:.1} MiB", bytes / KIB / KIB)
    }
}
