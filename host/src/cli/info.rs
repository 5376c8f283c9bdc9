//! `relume info`.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use relume::atlas::{Atlas, Quantity};
use serde_json::{Value, json};

use super::load::{Loaded, load};
use super::{Outcome, human_bytes, tell};
use crate::solution::{self, Solution};

#[derive(Debug, Args)]
pub struct Arguments {
    /// A solution or an atlas
    input: PathBuf,
}

pub fn run(arguments: &Arguments) -> Result<Outcome> {
    let report = match load(&arguments.input)? {
        Loaded::Solution(solution) => of_solution(&solution),
        Loaded::Atlas { bytes, .. } => of_atlas(&Atlas::parse(&bytes)?, bytes.len()),
    };
    tell!("{}:", arguments.input.display());
    print_lines(&report);
    Ok(Outcome::done(report))
}

fn of_solution(solution: &Solution) -> Value {
    let lights = solution.lights.iter().map(|light| {
        json!({
            "name": light.name,
            "emission": light.emission.to_array(),
            "residual": light.residual,
            "error": light.error,
        })
    });
    json!({
        "kind": "solution",
        "bytes": solution::write(solution).len(),
        "surfaces": solution.surfaces.len(),
        "faces": solution.mesh.faces.len(),
        "patches": solution.mesh.patches.len(),
        "elements": solution.mesh.elements.len(),
        "patch": solution.spacing.patch,
        "element": solution.spacing.element,
        "shots": solution.rows,
        "method": solution.method.name(),
        "rule": solution.method.rule(),
        "split_direct": solution.direct.is_some(),
        "lights": solution.lights.len(),
        "per_light": lights.collect::<Vec<_>>(),
    })
}

/// Errors are those that were measured when it was packed, null if they were not, in display codes.
/// Flash is the atlas itself; RAM and work are those of the integer kernel: three `u32` sums per
/// element, three `u16` weights per light, one multiply-add per code and channel.
fn of_atlas(atlas: &Atlas, bytes: usize) -> Value {
    let lights = atlas.lights().map(|light| {
        json!({
            "name": light.name,
            "emission": light.emission.to_array(),
            "scale": light.scale.value(),
            "max_error_codes": light.error,
        })
    });
    let worst = atlas.worst_error();
    let (n, k) = (
        u64::from(atlas.element_count()),
        u64::from(atlas.light_count()),
    );
    json!({
        "kind": "atlas",
        "bytes": bytes,
        "code": atlas.code().name(),
        "channels": atlas.channels().count(),
        "quantity": match atlas.quantity() {
            Quantity::Irradiance => "irradiance",
            Quantity::Radiosity => "radiosity",
        },
        "elements": n,
        "faces": atlas.mesh().map_or(0, |mesh| mesh.face_count()),
        "max_error_codes": worst.map(|worst| worst.packed),
        "codes_shown": worst.map(|worst| worst.shown),
        "code_bytes": atlas.all_codes().len(),
        "flash": bytes,
        "ram": n * 12 + k * 6,
        "multiply_adds_per_frame": n * k * 3,
        "multiply_adds_per_changed_light": n * 3,
        "lights": k,
        "per_light": lights.collect::<Vec<_>>(),
    })
}

/// The report as lines for people; lists as one line per entry.
fn print_lines(report: &Value) {
    for (key, value) in report.as_object().into_iter().flatten() {
        match value {
            Value::Array(entries) => {
                tell!("  {key}:");
                entries.iter().for_each(|entry| tell!("    {entry}"));
            }
            Value::Number(number) if key == "flash" || key == "ram" || key.ends_with("bytes") => {
                let bytes = number.as_u64().unwrap_or(0) as usize;
                tell!("  {key}: {}", human_bytes(bytes));
            }
            other => tell!("  {key}: {other}"),
        }
    }
}
