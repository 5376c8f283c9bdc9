//! `relume info`.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use relume::atlas::{Atlas, Quantity, Tiles};
use relume::code::{Curve, LOG_STEPS};
use relume::relight::FixedWeight;
use serde_json::{Value, json};

use super::load::{Loaded, load};
use super::pack::bits_per_rgb;
use super::{Outcome, human_bytes, tell};
use crate::device_cost::{Core, DeviceCost};
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
    if let Some([width, height]) = solution.image {
        let names = solution.lights.iter().map(|light| &light.name);
        return json!({
            "kind": "picture",
            "width": width,
            "height": height,
            "lights": solution.lights.len(),
            "names": names.collect::<Vec<_>>(),
        });
    }
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
/// Flash is the atlas itself; RAM and work are those of the integer kernel that multiplies: three `u32` sums per
/// element, a [`FixedWeight`] per light, one multiply-add per code and channel. A light in tiles costs that only where its
/// codes are not all 0.
fn of_atlas(atlas: &Atlas, bytes: usize) -> Value {
    let tiled = bits_in_tiles(atlas);
    let elements = atlas.element_count() as usize;
    let lights = atlas.lights().zip(tiled).map(|(light, tiled)| {
        let bits = if light.code.is_tiled() {
            tiled as f64 / elements.max(1) as f64
        } else {
            8.0 * light.code.bytes() as f64
        };
        json!({
            "name": light.name,
            "emission": light.emission.to_array(),
            "code": light.code.name(),
            "curves": light.curves.map(curve),
            "bits_per_rgb": bits,
            "max_error_codes": light.error,
        })
    });
    let mut products = 0_u64;
    atlas.for_each(|_, _, _| products += 3);
    let worst = atlas.worst_error();
    let (n, k) = (
        u64::from(atlas.element_count()),
        u64::from(atlas.light_count()),
    );
    json!({
        "kind": "atlas",
        "bytes": bytes,
        "quantity": match atlas.quantity() {
            Quantity::Irradiance => "irradiance",
            Quantity::Radiosity => "radiosity",
            Quantity::Radiance => "radiance",
        },
        "elements": n,
        "faces": atlas.mesh().map_or(0, |mesh| mesh.face_count()),
        "max_error_codes": worst.map(|worst| worst.packed),
        "codes_shown": worst.map(|worst| worst.shown),
        "code_bytes": atlas.code_bytes(),
        "flash": bytes,
        "bits_per_rgb": bits_per_rgb(atlas, bytes),
        "ram": n * 12 + k * size_of::<FixedWeight>() as u64,
        "multiply_adds_per_frame": products,
        "multiply_adds_per_changed_light": n * 3,
        "devices": Core::ALL.map(|core| device(atlas, bytes, core)),
        "lights": k,
        "per_light": lights.collect::<Vec<_>>(),
    })
}

/// Predicted by a model that is fitted to counts, see [`DeviceCost`].
fn device(atlas: &Atlas, bytes: usize, core: Core) -> Value {
    let cost = DeviceCost::new(atlas, bytes, core);
    json!({
        "core": core.name(),
        "flash": cost.flash,
        "ram": cost.ram,
        "fits": cost.ram <= core.ram(),
        "instructions_per_frame": cost.frame,
        "instructions_per_frame_warm": cost.warm,
        "instructions_per_changed_light": cost.change,
    })
}

/// What the codes of a channel stand for, in display codes and W/m2.
fn curve(curve: Curve) -> Value {
    match curve {
        Curve::Exponential { scale } => json!({"scale": scale.value()}),
        Curve::Display { white, step } => json!({
            "white": white.value(),
            "step": Curve::display_codes(step),
        }),
        Curve::Parts { white, .. } => {
            let values: Vec<f32> = (0..256)
                .step_by(16)
                .map(|code| curve.decode(code))
                .collect();
            json!({"white": white.value(), "values_of_parts": values})
        }
        Curve::Logarithmic { .. } => json!({"steps_per_octave": LOG_STEPS}),
    }
}

/// Bits of every light in all tiles, without their offsets.
fn bits_in_tiles(atlas: &Atlas) -> Vec<usize> {
    let mut bits = vec![0; atlas.light_count() as usize];
    for (place, mut tile) in atlas.tiles().iter().flat_map(Tiles::iter) {
        for light in atlas.lights_in_tiles() {
            let before = tile.remaining();
            tile.next_light(place);
            bits[light as usize] += before.saturating_sub(tile.remaining());
        }
    }
    bits
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
