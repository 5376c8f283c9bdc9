//! `relume probe`.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::Args;
use serde_json::json;

use super::load::{Loaded, load, read};
use super::{Outcome, keep, output_path, tell, write_file};
use crate::probe::{
    MOST_RAYS, Part, ProbeError, Probed, RAYS, probe_elements, probe_gathered, probe_points,
    read_points,
};

#[derive(Debug, Args)]
pub struct Arguments {
    /// A solution or an atlas
    input: PathBuf,
    #[command(flatten)]
    places: Places,
    /// Direct light only
    #[arg(long)]
    direct: bool,
    /// Evaluate direct light exactly at the points and gather the indirect there: better than the mesh
    #[arg(long, requires = "points", conflicts_with = "elements")]
    gather: bool,
    /// Rays that gather at each point: 64 for errors of some 2 %, 2048 for some tenths of a per cent
    #[arg(long, value_name = "N", requires = "gather", default_value_t = RAYS, value_parser = clap::value_parser!(u32).range(1..=MOST_RAYS))]
    rays: u32,
    /// Where the CSV goes; `-` is stdout
    #[arg(short, long, value_name = "OUT.csv", default_value = "-")]
    output: PathBuf,
}

#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
struct Places {
    /// Surface points: CSV with the header x,y,z,nx,ny,nz
    #[arg(long, value_name = "POINTS.csv")]
    points: Option<PathBuf>,
    /// Every element
    #[arg(long)]
    elements: bool,
}

pub fn run(arguments: &Arguments, json: bool) -> Result<Outcome> {
    let output = output_path(Some(&arguments.output), &arguments.input, "csv", json);
    if let Some(file) = &arguments.places.points {
        keep(file, &output);
    }
    let loaded = load(&arguments.input)?;
    if loaded.is_radiosity() {
        bail!(
            "{}: it holds radiosity, and a probe gives irradiance; probe the solution that it was \
             packed from, or pack without --quantity radiosity",
            arguments.input.display()
        );
    }
    let solution = loaded.solution();
    let part = if arguments.direct {
        Part::Direct
    } else {
        Part::Total
    };
    let named = |error: ProbeError| named(error, &arguments.input, &loaded);
    let probed = match &arguments.places.points {
        None => Probed {
            csv: probe_elements(solution, part).map_err(named)?,
            missing: 0,
        },
        Some(file) => {
            let points = read_points(&read(file)?).with_context(|| file.display().to_string())?;
            if arguments.gather {
                let solution = loaded.to_gather(&arguments.input)?;
                probe_gathered(solution, &points, part, arguments.rays).map_err(named)?
            } else {
                probe_points(solution, &points, part).map_err(named)?
            }
        }
    };
    if probed.missing > 0 {
        tell!(
            "{} points lie on no surface that stores light; their rows are nan",
            probed.missing
        );
    }
    write_file(&output, &probed.csv)?;
    Ok(Outcome::done(json!({
        "file": output.display().to_string(),
        "lights": solution.lights.len(),
        "missing": probed.missing,
    })))
}

/// The file that an error is about, and why an atlas never has direct light.
fn named(error: ProbeError, input: &Path, loaded: &Loaded) -> anyhow::Error {
    let error = match (&error, loaded) {
        (ProbeError::NoDirect, Loaded::Atlas { .. }) => anyhow::anyhow!(
            "an atlas does not keep direct light apart; probe the solution that it was packed from"
        ),
        _ => error.into(),
    };
    error.context(input.display().to_string())
}
