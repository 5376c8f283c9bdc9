//! `relume pack`.

use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use clap::Args;
use relume::atlas::{Atlas, Quantity};
use relume::code::Code;
use serde_json::json;

use super::load::{Loaded, load};
use super::{Outcome, human_bytes, output_path, spare, tell, write_file};
use crate::pack::{Format, pack_measured};

#[derive(Debug, Args)]
pub struct Arguments {
    /// The solution
    input: PathBuf,
    /// Where the atlas goes; `-` is stdout [default: the input's name .atlas, here]
    #[arg(short, long, value_name = "FILE.atlas")]
    output: Option<PathBuf>,
    /// The code: exp8 (as published, one scale) or exp8s (a scale per light)
    #[arg(long, value_name = "NAME", default_value = "exp8s", value_parser = code)]
    code: Code,
    /// What to pack
    #[arg(long, value_enum, default_value_t = QuantityName::Irradiance)]
    quantity: QuantityName,
    /// Leave out the mesh: smaller, but no drawing and no probing by place
    #[arg(long)]
    no_mesh: bool,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum QuantityName {
    Irradiance,
    Radiosity,
}

fn code(name: &str) -> Result<Code, String> {
    let known = Code::ALL.map(Code::name).join(", ");
    Code::ALL
        .into_iter()
        .find(|code| code.name() == name)
        .ok_or_else(|| format!("the codes are: {known}"))
}

pub fn run(arguments: &Arguments, json: bool) -> Result<Outcome> {
    let path = arguments.input.display().to_string();
    let output = output_path(arguments.output.as_deref(), &arguments.input, "atlas", json);
    spare(&output, &relume::atlas::MAGIC);
    let Loaded::Solution(solution) = load(&arguments.input)? else {
        bail!("{path}: this is an atlas already; give the solution that it was packed from");
    };
    let format = Format {
        packing: arguments.code.into(),
        quantity: match arguments.quantity {
            QuantityName::Irradiance => Quantity::Irradiance,
            QuantityName::Radiosity => Quantity::Radiosity,
        },
        mesh: !arguments.no_mesh,
    };
    let (bytes, error) = pack_measured(&solution, format).context(path)?;
    let atlas = Atlas::parse(&bytes)?;
    write_file(&output, &bytes)?;
    tell!(
        "{}: {}, {} for {} codes, error at most {:.2} display codes ({}), {:.2} as shown",
        output.display(),
        format.packing.code,
        human_bytes(bytes.len()),
        atlas.code_bytes(),
        error.codes,
        error.worst_state,
        error.codes_shown,
    );
    Ok(Outcome::done(json!({
        "file": output.display().to_string(),
        "code": format.packing.code.name(),
        "bytes": bytes.len(),
        "code_bytes": atlas.code_bytes(),
        "elements": atlas.element_count(),
        "lights": atlas.light_count(),
        "max_error_codes": error.codes,
        "codes_shown": error.codes_shown,
        "worst_state": error.worst_state,
    })))
}
