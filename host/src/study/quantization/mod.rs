//! Formats of contributions: how exact they are for any number of lights, what they take, and where they end.
//!
//! Every format of an atlas, and those that others use, on the same solutions, in the states of
//! [`crate::display_error`]; relighting by passes over an 8-bit framebuffer; the published range of 1:1413 and the four cases of
//! the framework paper. Errors are those of irradiance, which is what is packed.

pub mod accumulate;
mod charts;
mod errors;
mod formats;
pub mod framework;
pub mod range;
mod scenes;
mod stored;
mod wall;

use std::path::Path;

use anyhow::{Context, Result};
use relume::code::Code;
use relume::color::Rgb;
use serde::Serialize;
use tiny_skia::Pixmap;

pub use errors::{Errors, compare};
pub use scenes::{Scene, first_lights};
pub use stored::{Format, Stored};

use crate::chart::ChartError;
use crate::pack::Packing;
use crate::solution::Solution;
use accumulate::Accumulation;
use framework::Case;
use range::Range;
use wall::Wall;

/// Numbers of lights of the table.
const LIGHTS: [usize; 9] = [1, 3, 8, 10, 16, 32, 64, 128, 256];

/// Steps of `tiles` in display codes, for the rate.
const STEPS: [f32; 7] = [14.8, 7.4, 3.7, 2.6, 1.85, 0.925, 0.462_5];

/// A format with so many lights of a scene.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// Name of the scene.
    pub scene: &'static str,
    /// Number of its elements.
    pub elements: usize,
    /// Number of lights: the first ones of the scene.
    pub k: usize,
    /// Name of the format.
    pub format: &'static str,
    /// Bits of an element and light.
    pub bits_per_rgb: f64,
    /// Bytes of everything but a mesh.
    pub bytes: usize,
    /// Largest error where lights dim: all on, and 1000 random dimmings, in display codes.
    pub max_codes_random: f32,
    /// Largest error with a light alone, in its own colour.
    pub max_codes_solo: f32,
    /// Largest error in all states.
    pub max_codes: f32,
    /// Mean error where lights dim.
    pub mean_codes: f64,
    /// Relative error where lights dim.
    pub relative_rms: f64,
    /// Nanoseconds to decode, weight and add a contribution, in `f32` and on one thread.
    pub nanoseconds: f64,
    /// Share of channels that are above zero and read back as zero.
    pub vanished: f64,
    /// Share of channels that have the saturated code of the exponential codes.
    pub saturated: f64,
}

/// What a format takes and how exact it is, on one mesh with all lights.
#[derive(Clone, Debug, Serialize)]
pub struct Rate {
    /// Name of the scene.
    pub scene: &'static str,
    /// Number of its elements.
    pub elements: usize,
    /// Number of lights.
    pub k: usize,
    /// Name of the format.
    pub format: &'static str,
    /// Display codes of a step, in `tiles`.
    pub step: Option<f32>,
    /// Bits of an element and light.
    pub bits_per_rgb: f64,
    /// Largest error where lights dim or shine alone, in display codes.
    pub max_codes_dimming: f32,
    /// Largest error in all states.
    pub max_codes: f32,
    /// Mean error where lights dim.
    pub mean_codes: f64,
}

/// Everything that was measured.
#[derive(Clone, Debug)]
pub struct Report {
    /// Error against number of lights.
    pub rows: Vec<Row>,
    /// Bits against error.
    pub rates: Vec<Rate>,
    /// Passes over an 8-bit framebuffer.
    pub accumulation: Vec<Accumulation>,
    /// The range of the published code.
    pub range: Range,
    /// The cases of the framework paper, and every format.
    pub cases: Vec<Case>,
    /// A wall under every format.
    pub wall: Pixmap,
}

impl Report {
    /// The charts, by their names.
    ///
    /// # Errors
    /// A chart without points.
    pub fn charts(&self) -> Result<Vec<(String, String)>, ChartError> {
        let mut charts = charts::against_lights(&self.rows, Scene::ROOM_256.name)?;
        charts.push(charts::accumulation(&self.accumulation)?);
        charts.push(charts::rates(&self.rates)?);
        charts.push(charts::range(&self.range, &range::sweeps())?);
        Ok(charts)
    }

    /// The formats that no other one beats in bits and error.
    #[must_use]
    pub fn front(&self) -> Vec<&Rate> {
        charts::front(&self.rates)
    }
}

/// Runs the study; `data` is the folder with `scenes` and `truth`, `watch` is told what comes next.
///
/// # Errors
/// A scene that is not there, or that cannot be packed.
pub fn run(data: &Path, watch: impl Fn(&str)) -> Result<Report> {
    let formats = Format::all();
    let mut rows = Vec::new();
    let mut few = None;
    let mut accumulation = Vec::new();
    for scene in [Scene::ROOM_64, Scene::ROOM_256, Scene::REAL] {
        watch(&format!("{}: baking", scene.name));
        let solution = scene.bake(data)?;
        for k in light_counts(&solution) {
            watch(&format!("{}: {k} lights", scene.name));
            rows.extend(measure(scene.name, &first_lights(&solution, k), &formats)?);
        }
        if scene.name == Scene::ROOM_256.name {
            watch("8-bit accumulation");
            accumulation = accumulate::measure(scene.name, &solution);
        }
        few.get_or_insert(solution);
    }
    watch("the framework paper");
    let cases = framework::measure(&few.context("a scene")?)?;

    watch(&format!("{}: baking a fine mesh", Scene::FINE_256.name));
    let fine = Scene::FINE_256.bake(data)?;
    let shown =
        [Code::Display8, Code::Tiles, Code::TilesLog].map(|code| Format::Atlas(code.into()));
    for k in [64, 256] {
        watch(&format!(
            "{}: {k} lights on a fine mesh",
            Scene::FINE_256.name
        ));
        rows.extend(measure(
            Scene::FINE_256.name,
            &first_lights(&fine, k),
            &shown,
        )?);
    }
    drop(fine);

    watch(&format!("{}: baking a fine mesh", Scene::FINE_64.name));
    let fine = Scene::FINE_64.bake(data)?;
    watch("bits against error");
    let (rates, wall) = rates_and_wall(Scene::FINE_64.name, &fine)?;
    Ok(Report {
        rows,
        rates,
        accumulation,
        range: Range::new(),
        cases,
        wall,
    })
}

/// Numbers of lights to try: those of the table, and all.
fn light_counts(solution: &Solution) -> Vec<usize> {
    let all = solution.lights.len();
    let mut counts: Vec<usize> = LIGHTS.into_iter().filter(|k| *k < all).collect();
    counts.push(all);
    counts
}

/// Measures formats on a solution.
///
/// # Errors
/// A solution that an atlas cannot hold.
pub fn measure(scene: &'static str, solution: &Solution, formats: &[Format]) -> Result<Vec<Row>> {
    let stored = store(solution, formats)?;
    let errors = compare(solution, &decoded(&stored));
    let rows = formats.iter().zip(stored).zip(errors);
    let rows = rows.map(|((format, stored), errors)| Row {
        scene,
        elements: solution.mesh.elements.len(),
        k: solution.lights.len(),
        format: format.name(),
        bits_per_rgb: stored.bits_per_rgb,
        bytes: stored.bytes,
        max_codes_random: errors.max_random,
        max_codes_solo: errors.max_solo,
        max_codes: errors.max_all,
        mean_codes: errors.mean,
        relative_rms: errors.relative_rms,
        nanoseconds: stored.nanoseconds,
        vanished: stored.vanished,
        saturated: stored.saturated,
    });
    Ok(rows.collect())
}

fn store(solution: &Solution, formats: &[Format]) -> Result<Vec<Stored>> {
    formats
        .iter()
        .map(|format| format.store(solution))
        .collect()
}

fn decoded(stored: &[Stored]) -> Vec<&[Rgb]> {
    stored.iter().map(|stored| &stored.decoded[..]).collect()
}

/// Every format, tiles with several steps, and a wall under those that have no such choice.
fn rates_and_wall(scene: &'static str, solution: &Solution) -> Result<(Vec<Rate>, Pixmap)> {
    let formats = Format::all();
    let stored = store(solution, &formats)?;
    let named = formats.iter().map(|format| format.name());
    let named: Vec<(&str, &[Rgb])> = named.zip(decoded(&stored)).collect();
    let published = named.iter().find(|(name, _)| *name == Code::Exp8s.name());
    let wall = published.and_then(|(_, decoded)| Wall::find(solution, decoded));
    let wall = wall.context("a wall of many elements")?.sheet(&named)?;

    let tiles = STEPS.map(|step| Packing {
        step,
        ..Code::Tiles.into()
    });
    let tiles = tiles.map(Format::Atlas);
    let is_tiles = |format: &Format| matches!(format, Format::Atlas(p) if p.code == Code::Tiles);
    let fixed = formats
        .into_iter()
        .zip(stored)
        .filter(|(format, _)| !is_tiles(format));
    let (formats, stored): (Vec<Format>, Vec<Stored>) = fixed
        .chain(tiles.into_iter().zip(store(solution, &tiles)?))
        .unzip();
    let errors = compare(solution, &decoded(&stored));
    let rates = formats.iter().zip(stored).zip(errors);
    let rates = rates.map(|((format, stored), errors)| Rate {
        scene,
        elements: solution.mesh.elements.len(),
        k: solution.lights.len(),
        format: format.name(),
        step: match format {
            Format::Atlas(packing) if is_tiles(format) => Some(packing.step),
            _ => None,
        },
        bits_per_rgb: stored.bits_per_rgb,
        max_codes_dimming: errors.max_random.max(errors.max_solo),
        max_codes: errors.max_all,
        mean_codes: errors.mean,
    });
    Ok((rates.collect(), wall))
}
