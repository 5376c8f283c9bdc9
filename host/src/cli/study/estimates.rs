//! `relume study estimates`: writes `estimates.csv` and `estimates.svg`.

use std::fs;
use std::ops::{ControlFlow, RangeInclusive};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use serde_json::{Value, json};

use super::table::Table;
use crate::bake::{self, Settings};
use crate::cli::{tell, write_file};
use crate::import;
use crate::study::estimates::{self, Effort, Estimated};

/// Points of a scene, which leave about a tenth of an error uncertain; with many lights, which every path asks for,
/// so many that points times lights are no more than that.
const POINTS: usize = 1000;
const POINTS_TIMES_LIGHTS: usize = 1 << 16;

/// Paths from a point, which leave one to two per cent there, which are taken off; times points and lights no
/// more than that.
const PATHS: RangeInclusive<usize> = 2000..=16_000;
const PATHS_TO_LIGHTS: usize = 1 << 26;

pub fn run(folder: &Path) -> Result<Value> {
    let scenes = scenes(&super::data())?;
    let mut found = Vec::new();
    for (name, file, light_file) in &scenes {
        let scene = import::load(file, light_file.as_deref())?.scene;
        let mut go_on = |_| ControlFlow::Continue(());
        let solution = bake::bake(&scene, &Settings::default(), &mut go_on)
            .with_context(|| file.display().to_string())?;
        let lights = solution.lights.len().max(1);
        let points = (POINTS_TIMES_LIGHTS / lights).min(POINTS);
        let paths = (PATHS_TO_LIGHTS / (points * lights)).clamp(*PATHS.start(), *PATHS.end());
        let effort = Effort {
            points: points as u32,
            paths: paths as u32,
        };
        let estimated = estimates::compare(&scene, &solution, effort)?;
        let ratios = estimates::spread_of_ratios(&estimated).map_or_else(
            || "not seen, the error is less than the noise of the truth".to_owned(),
            |[low, middle, high]| format!("{low:.2} to {high:.2}, median {middle:.2}"),
        );
        tell!(
            "{name:20} {:3} lights: estimate over truth {ratios}",
            estimated.len()
        );
        found.push((name.as_str(), estimated));
    }
    table(&found).write(folder)?;
    let chart = estimates::chart(&found).svg()?;
    write_file(&folder.join("estimates.svg"), chart.as_bytes())?;
    let light = |scene: &str, light: &Estimated| {
        json!({
            "scene": scene,
            "light": light.light,
            "estimate": light.estimate,
            "error": light.error,
            "noise": light.noise,
            "ratio": light.ratio(),
        })
    };
    let rows = found
        .iter()
        .flat_map(|(scene, lights)| lights.iter().map(|own| light(scene, own)));
    Ok(json!({"study": "estimates", "rows": rows.collect::<Vec<_>>()}))
}

/// Name, file and lights of every scene there is.
fn scenes(data: &Path) -> Result<Vec<(String, PathBuf, Option<PathBuf>)>> {
    let folder = data.join("scenes");
    let remedy = || {
        format!(
            "{}: cannot be read; set RELUME_DATA to the folder of the data",
            folder.display()
        )
    };
    let mut scenes = Vec::new();
    for entry in fs::read_dir(&folder).with_context(remedy)? {
        let name = entry.with_context(remedy)?.file_name();
        let name = name.to_string_lossy().into_owned();
        let lights = data.join("truth").join(&name).join("lights.toml");
        let file = folder.join(&name).join("scene.obj");
        scenes.push((name, file, lights.is_file().then_some(lights)));
    }
    scenes.sort();
    Ok(scenes)
}

fn table(found: &[(&str, Vec<Estimated>)]) -> Table {
    let row = |scene: &str, light: &Estimated| {
        vec![
            scene.to_owned(),
            light.light.clone(),
            format!("{:.5}", light.estimate),
            format!("{:.5}", light.error),
            format!("{:.5}", light.noise),
            light
                .ratio()
                .map_or_else(String::new, |ratio| format!("{ratio:.3}")),
        ]
    };
    let lights = found
        .iter()
        .flat_map(|(scene, lights)| lights.iter().map(|light| row(scene, light)));
    Table {
        name: "estimates",
        header: &["scene", "light", "estimate", "error", "noise", "ratio"],
        rows: lights.collect(),
    }
}
