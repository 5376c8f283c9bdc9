//! `relume export`.

use std::fs;
use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use clap::Args;
use relume::atlas::{Atlas, AtlasError, write_without_mesh};
use serde_json::json;

use super::load::read;
use super::{Outcome, tell, write_file};
use crate::export::firmware::{Cost, Language, files};
use crate::export::frame::FrameConstants;

#[derive(Debug, Args)]
pub struct Arguments {
    /// The atlas
    input: PathBuf,
    #[command(flatten)]
    language: LanguageArguments,
    /// Leave the mesh out: what frames need of it becomes constants of Rust and C
    #[arg(long)]
    no_mesh: bool,
    /// Folder that the files go to, made if it is not there
    #[arg(short, long, value_name = "DIR", default_value = ".")]
    output: PathBuf,
}

#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
struct LanguageArguments {
    /// A Rust module with a `static` array
    #[arg(long)]
    rust: bool,
    /// A C header and a source with a `const` array
    #[arg(long)]
    c: bool,
    /// The bytes themselves, and a text about them
    #[arg(long)]
    bin: bool,
}

pub fn run(arguments: &Arguments) -> Result<Outcome> {
    let path = arguments.input.display().to_string();
    let bytes = read(&arguments.input)?;
    if !bytes.starts_with(&relume::atlas::MAGIC) {
        bail!("{path}: not an atlas; make one with `relume pack`");
    }
    let frame =
        FrameConstants::new(&Atlas::parse(&bytes).context(path.clone())?).context(path.clone())?;
    let bytes = if arguments.no_mesh {
        without_mesh(&bytes)?
    } else {
        bytes
    };
    let atlas = Atlas::parse(&bytes).context(path)?;
    let language = match arguments.language {
        LanguageArguments { rust: true, .. } => Language::Rust,
        LanguageArguments { c: true, .. } => Language::C,
        LanguageArguments { .. } => Language::Binary,
    };
    let stem = arguments.input.file_stem().unwrap_or_default();
    let files = files(
        &atlas,
        &bytes,
        frame.as_ref(),
        &stem.to_string_lossy(),
        language,
    );
    let folder = &arguments.output;
    fs::create_dir_all(folder).with_context(|| format!("{}: cannot be made", folder.display()))?;
    let mut written = Vec::new();
    for (name, contents) in files {
        let file = folder.join(name);
        write_file(&file, &contents)?;
        tell!("{}", file.display());
        written.push(file.display().to_string());
    }
    let cost = Cost::new(&atlas, bytes.len());
    Ok(Outcome::done(json!({
        "files": written,
        "flash": cost.flash,
        "ram": cost.ram,
        "table": cost.table,
        "multiply_adds_per_frame": cost.frame,
        "multiply_adds_per_changed_light": cost.change,
    })))
}

fn without_mesh(bytes: &[u8]) -> Result<Vec<u8>, AtlasError> {
    let mut shorter = vec![0; bytes.len()];
    let length = write_without_mesh(bytes, &mut shorter)?;
    shorter.truncate(length);
    Ok(shorter)
}
