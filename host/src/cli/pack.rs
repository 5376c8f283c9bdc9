//! `relume pack`.

use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use clap::Args;
use relume::atlas::{Atlas, Quantity};
use relume::code::Code;
use serde_json::{Value, json};

use super::load::{Loaded, load};
use super::{Outcome, human_bytes, output_path, spare, tell, write_file, wrong_usage};
use crate::mix::find;
use crate::pack::{Aim, Candidate, Choice, Judged, Packing, Request, choose, pack_lights};
use crate::solution::Solution;

/// Display codes that packing may cost where nothing else is asked for: what nobody can see.
pub const MAX_ERROR: f32 = 1.0;

#[derive(Debug, Args)]
pub struct Arguments {
    /// The solution, or an OpenEXR picture with a layer per light (*.Combined_NAME)
    input: PathBuf,
    /// Where the atlas goes; `-` is stdout [default: the input's name .atlas, here]
    #[arg(short, long, value_name = "FILE.atlas")]
    output: Option<PathBuf>,
    /// Code of all lights, or of one: exp8, exp8s, display8, lum8, tiles or tiles-log; can be repeated
    #[arg(long, value_name = "NAME|LIGHT=NAME", value_parser = coded)]
    code: Vec<Coded>,
    /// Choose the smallest packing whose largest display error is at most this [default: 1]
    #[arg(long, value_name = "CODES", value_parser = positive, conflicts_with = "budget")]
    max_error: Option<f32>,
    /// Choose the most exact packing whose atlas has at most so many bytes
    #[arg(long, value_name = "BYTES")]
    budget: Option<usize>,
    /// What to pack of a solution [default: irradiance]
    #[arg(long, value_enum)]
    quantity: Option<QuantityName>,
    /// Leave out the mesh: smaller, but no drawing and no probing by place
    #[arg(long)]
    no_mesh: bool,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum QuantityName {
    Irradiance,
    Radiosity,
}

/// A code, and the light that it is for: all without one.
#[derive(Clone, Debug)]
struct Coded {
    light: Option<String>,
    code: Code,
}

fn coded(text: &str) -> Result<Coded, String> {
    let (light, name) = match text.rsplit_once('=') {
        Some((light, name)) => (Some(light.to_owned()), name),
        None => (None, text),
    };
    let known = Code::ALL.map(Code::name).join(", ");
    let code = Code::ALL.into_iter().find(|code| code.name() == name);
    let code = code.ok_or_else(|| format!("the codes are: {known}"))?;
    Ok(Coded { light, code })
}

fn positive(text: &str) -> Result<f32, String> {
    let number = text.parse().ok();
    let legal = number.filter(|n: &f32| *n > 0.0 && n.is_finite());
    legal.ok_or_else(|| "a positive number".to_owned())
}

impl Arguments {
    /// The code of all lights that have none of their own.
    fn common(&self) -> Option<Code> {
        let mut common = self.code.iter().filter(|coded| coded.light.is_none());
        let first = common.next()?.code;
        if common.next().is_some() {
            wrong_usage("--code is given twice for all lights: say LIGHT=NAME for one of them");
        }
        if self.max_error.is_some() || self.budget.is_some() {
            wrong_usage(
                "--code for all lights leaves nothing to choose: leave it out, or the limit",
            );
        }
        Some(first)
    }

    /// What every light has to be packed in, if anything.
    fn given(&self, solution: &Solution) -> Result<Vec<Option<Packing>>> {
        let mut given = vec![self.common().map(Packing::from); solution.lights.len()];
        for Coded { light, code } in &self.code {
            if let Some(name) = light {
                given[find(&solution.lights, name)?] = Some((*code).into());
            }
        }
        Ok(given)
    }
}

pub fn run(arguments: &Arguments, json: bool) -> Result<Outcome> {
    arguments.common();
    let path = arguments.input.display().to_string();
    let output = output_path(arguments.output.as_deref(), &arguments.input, "atlas", json);
    spare(&output, &relume::atlas::MAGIC);
    let Loaded::Solution(solution) = load(&arguments.input)? else {
        bail!("{path}: this is an atlas already; give the solution that it was packed from");
    };
    let quantity = match (arguments.quantity, solution.image) {
        (None, Some(_)) => Quantity::Radiance,
        (Some(_), Some(_)) => bail!("{path}: a picture holds radiance only; leave out --quantity"),
        (None | Some(QuantityName::Irradiance), None) => Quantity::Irradiance,
        (Some(QuantityName::Radiosity), None) => Quantity::Radiosity,
    };
    let mesh = !arguments.no_mesh;
    let given = arguments.given(&solution).context(path.clone())?;
    let packings: Option<Vec<Packing>> = given.iter().copied().collect();
    let (bytes, error, candidates) = match packings {
        Some(packings) if !packings.is_empty() || arguments.common().is_some() => {
            let (bytes, error) = pack_lights(&solution, &packings, quantity, mesh).context(path)?;
            (bytes, error, Vec::new())
        }
        _ => {
            let aim = match arguments.budget {
                Some(bytes) => Aim::Bytes(bytes),
                None => Aim::Error(arguments.max_error.unwrap_or(MAX_ERROR)),
            };
            let request = Request {
                aim,
                given: &given,
                quantity,
                mesh,
            };
            let Choice {
                bytes,
                error,
                candidates,
                ..
            } = choose(&solution, request).context(path)?;
            (bytes, error, candidates)
        }
    };
    let atlas = Atlas::parse(&bytes)?;
    write_file(&output, &bytes)?;
    print_table(&candidates, &atlas);
    let code = code_name(&atlas);
    tell!(
        "{}: {code}, {}, {} for codes, {:.2} bits per element and light, \
         error at most {:.2} display codes ({}), {:.2} as shown",
        output.display(),
        human_bytes(bytes.len()),
        human_bytes(atlas.code_bytes()),
        bits_per_rgb(&atlas, bytes.len()),
        error.all.packed,
        error.worst_state,
        error.all.shown,
    );
    Ok(Outcome::done(json!({
        "file": output.display().to_string(),
        "code": code,
        "bytes": bytes.len(),
        "code_bytes": atlas.code_bytes(),
        "elements": atlas.element_count(),
        "lights": atlas.light_count(),
        "bits_per_rgb": bits_per_rgb(&atlas, bytes.len()),
        "max_error_codes": error.all.packed,
        "codes_shown": error.all.shown,
        "achromatic_codes": error.achromatic.packed,
        "achromatic_shown": error.achromatic.shown,
        "worst_state": error.worst_state,
        "candidates": candidates.iter().map(report).collect::<Vec<_>>(),
    })))
}

/// The code of all lights, or that they differ.
fn code_name(atlas: &Atlas) -> &'static str {
    let mut codes = atlas.lights().map(|light| light.code);
    let first = codes.next().unwrap_or(Code::Tiles);
    if codes.all(|code| code == first) {
        first.name()
    } else {
        "mixed"
    }
}

/// Bits per element and light, of all three channels together, in so many bytes of an atlas without those of its mesh.
pub fn bits_per_rgb(atlas: &Atlas, bytes: usize) -> f64 {
    let mesh = atlas.mesh().map_or(0, |mesh| mesh.byte_count());
    let values = u64::from(atlas.element_count()) * u64::from(atlas.light_count());
    8.0 * bytes.saturating_sub(mesh) as f64 / values.max(1) as f64
}

/// What was considered, the smallest first.
fn print_table(candidates: &[Candidate], atlas: &Atlas) {
    if candidates.is_empty() {
        return;
    }
    tell!("  code        step  white       bytes  bits/RGB  error");
    for candidate in candidates {
        let Packing { code, step, white } = candidate.packing;
        let (step, white) = if code == Code::Tiles {
            (format!("{step:.3}"), format!("1/{:.0}", white.recip()))
        } else {
            (String::new(), String::new())
        };
        let error = match candidate.judged {
            Judged::Fully(packed, shown) => format!("{packed:.2}, {shown:.2} as shown"),
            Judged::AtLeast(error) => format!("{error:.2} at least: too much"),
            Judged::Not => "not measured".to_owned(),
        };
        tell!(
            "{} {:<9} {step:>6} {white:>6} {:>11}  {:>8.2}  {error}",
            if candidate.is_chosen { "*" } else { " " },
            code.name(),
            candidate.bytes,
            bits_per_rgb(atlas, candidate.bytes),
        );
    }
}

fn report(candidate: &Candidate) -> Value {
    let Packing { code, step, white } = candidate.packing;
    let tiles = |value: f32| (code == Code::Tiles).then_some(value);
    let (packed, shown, least) = match candidate.judged {
        Judged::Fully(packed, shown) => (Some(packed), Some(shown), None),
        Judged::AtLeast(error) => (None, None, Some(error)),
        Judged::Not => (None, None, None),
    };
    json!({
        "code": code.name(),
        "step": tiles(step),
        "white": tiles(white),
        "bytes": candidate.bytes,
        "max_error_codes": packed,
        "codes_shown": shown,
        "error_at_least": least,
        "chosen": candidate.is_chosen,
    })
}
