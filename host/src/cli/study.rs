//! `relume study`.

mod accuracy;
mod estimates;
mod paper;
mod quantization;
mod scale;
mod stability;
mod table;

use std::fs;
use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::{Args, ValueEnum};

use super::Outcome;

#[derive(Debug, Args)]
pub struct Arguments {
    /// Which study
    #[arg(value_enum)]
    name: Name,
    /// Folder for tables and charts; made if it is not there
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Name {
    /// Error against time and work of published methods and ours, as charts
    Accuracy,
    /// Known failures: a published method beside ours, and the bound we keep
    Stability,
    /// The tables of the papers beside ours
    Paper,
    /// The error that a bake estimates over the true one, for every scene of the data (reads RELUME_DATA)
    Estimates,
    /// Time and memory over the number of elements, in a scene of 14 000 polygons (reads RELUME_DATA)
    Scale,
    /// Formats of contributions: error against number of lights and against bits
    Quantization,
}

pub fn run(arguments: &Arguments) -> Result<Outcome> {
    let folder = &arguments.output;
    fs::create_dir_all(folder).with_context(|| format!("{}: cannot be made", folder.display()))?;
    let report = match arguments.name {
        Name::Accuracy => accuracy::run(folder)?,
        Name::Stability => stability::run(folder)?,
        Name::Paper => paper::run(folder)?,
        Name::Estimates => estimates::run(folder)?,
        Name::Scale => scale::run(folder)?,
        Name::Quantization => quantization::run(folder)?,
    };
    Ok(Outcome::done(report))
}

/// The folder with the scenes that are not part of the program.
fn data() -> PathBuf {
    std::env::var_os("RELUME_DATA").map_or_else(|| "../shared/data".into(), PathBuf::from)
}
