//! `relume study paper`: writes a table for each of the papers' tables, and two charts.

use std::path::Path;

use anyhow::Result;
use serde_json::{Map, Value, json};

use super::table::Table;
use crate::cli::{tell, write_file};
use crate::study::paper::early::{FirstLook, Stored};
use crate::study::paper::job::Errors;
use crate::study::paper::{self, Report, large};

/// Repeats of what is timed.
const REPEATS: usize = 9;

pub fn run(folder: &Path) -> Result<Value> {
    let data = super::data();
    let report = paper::run(&data, REPEATS, |what| tell!("measuring: {what}"))?;
    if report.large.len() < large::PAIRS.len() {
        tell!(
            "SKIPPED: the scenes of Fig. 5 are not in {}; set RELUME_DATA",
            data.display()
        );
    }
    for (title, table) in tables(&report) {
        tell!("\n{title}\n{}", table.aligned());
        table.write(folder)?;
    }
    for (name, chart) in report.charts() {
        write_file(&folder.join(name), chart.svg()?.as_bytes())?;
    }
    Ok(json(&report))
}

fn tables(report: &Report) -> [(&'static str, Table); 9] {
    [
        (
            "Table 1, sampling: 100 shots, analytic kernel x 4 rays, no row kept; one thread",
            sampling(report),
        ),
        ("Rows kept, to 1 % of the worst light", cached(report)),
        ("Distinct rows of a bake by rows", rows(report)),
        (
            "Exact rows until the worst light's error is small, eight lights",
            first_looks(report),
        ),
        (
            "Bytes of row storage against rows evaluated, eight lights, 960 elements, f32",
            storage(report),
        ),
        (
            "Eight lights: exact rows once, hemicubes for every light",
            job(report),
        ),
        (
            "Table 2, reconstruction of 960 elements",
            reconstruction(report),
        ),
        ("Fig. 5: scenes of about 6000 elements", scenes(report)),
        (
            "Spotlight paper: a cube's form factors and sweeps",
            faces(report),
        ),
    ]
}

fn number(value: f64) -> String {
    match value.abs() {
        0.0 => "0".to_owned(),
        size if size < 1e-3 => format!("{value:.2e}"),
        size if size < 10.0 => format!("{value:.4}"),
        _ => format!("{value:.1}"),
    }
}

/// A published figure, or nothing.
fn printed(value: Option<f64>) -> String {
    value.map_or_else(String::new, number)
}

fn sampling(report: &Report) -> Table {
    let row = |s: &paper::sampling::Sampling| {
        let was = |index: usize| s.published.map(|published| published[index]);
        vec![
            s.lights.to_string(),
            number(s.combined),
            number(s.separate),
            number(s.tagged),
            number(s.overhead()),
            number(s.speedup()),
            number(s.row),
            number(s.lane),
            number(s.alike),
            printed(was(0)),
            printed(was(1)),
            printed(was(2)),
        ]
    };
    Table {
        name: "sampling",
        header: &[
            "lights",
            "combined_s",
            "separate_s",
            "tagged_s",
            "overhead",
            "speedup",
            "us_per_row",
            "ns_per_element_light",
            "same_choice",
            "published_combined_s",
            "published_separate_s",
            "published_tagged_s",
        ],
        rows: report.sampling.iter().map(row).collect(),
    }
}

fn cached(report: &Report) -> Table {
    let row = |c: &paper::cached::Cached| {
        vec![
            c.lights.to_string(),
            c.tagged_rows.to_string(),
            c.separate_rows.to_string(),
            number(c.tagged),
            number(c.separate),
            number(c.speedup()),
        ]
    };
    Table {
        name: "cached",
        header: &[
            "lights",
            "tagged_rows",
            "separate_rows",
            "tagged_s",
            "separate_s",
            "speedup",
        ],
        rows: report.cached.iter().map(row).collect(),
    }
}

fn rows(report: &Report) -> Table {
    let row = |r: &paper::cached::Rows| {
        let counts = [r.rows as usize, r.shooters, r.patches].map(|count| count.to_string());
        std::iter::once(number(r.reflectance.into()))
            .chain(counts)
            .collect()
    };
    Table {
        name: "rows",
        header: &["reflectance", "rows", "shooters", "patches"],
        rows: report.rows.iter().map(row).collect(),
    }
}

fn first_looks(report: &Report) -> Table {
    let row = |look: &FirstLook| {
        let [none, lamps] = look.closed_errors.map(number);
        let counts = [look.plain, look.kept, look.closed].map(|count| count.to_string());
        let case = [look.scaled.name(), look.goal.norm.name()].map(str::to_owned);
        let case = case.into_iter().chain([number(look.goal.error)]);
        case.chain(counts).chain([none, lamps]).collect()
    };
    Table {
        name: "first_looks",
        header: &[
            "scaled_to_0.8",
            "norm",
            "error",
            "plain_shots",
            "kept_rows",
            "closed_rows",
            "closed_error_no_rows",
            "closed_error_lamps",
        ],
        rows: report.first_looks.iter().map(row).collect(),
    }
}

fn storage(report: &Report) -> Table {
    let row = |stored: &Stored| {
        let [five, one] = stored.to_errors.map(|rows| rows.to_string());
        let to_residual = stored
            .to_residual
            .map_or_else(String::new, |n| n.to_string());
        let end = if stored.is_closed {
            "closed"
        } else {
            "ambient"
        };
        let kib = number(stored.bytes as f64 / 1024.0);
        vec![
            stored.rows.to_string(),
            end.to_owned(),
            kib,
            to_residual,
            five,
            one,
        ]
    };
    Table {
        name: "storage",
        header: &[
            "rows_kept",
            "missing_rows",
            "kib",
            "rows_to_residual_1e-3",
            "rows_to_5_percent",
            "rows_to_1_percent",
        ],
        rows: report.storage.iter().map(row).collect(),
    }
}

fn job(report: &Report) -> Table {
    let job = &report.job;
    let row = |name: &str, seconds: Option<f64>, row: f64, errors: Errors| {
        let errors = [errors.dense_patch, errors.fine].map(number);
        let times = [printed(seconds), number(row)];
        std::iter::once(name.to_owned())
            .chain(times)
            .chain(errors)
            .collect()
    };
    let [ours, hemicube] = job.row;
    Table {
        name: "job",
        header: &[
            "method",
            "seconds",
            "us_per_row",
            "error_dense_patch",
            "error_fine_rows",
        ],
        rows: vec![
            row("exact rows, tagged", Some(job.ours), ours, job.error),
            row(
                "hemicubes, separate",
                Some(job.hemicubes),
                hemicube,
                job.hemicube_error,
            ),
            row(
                "hemicubes, kept",
                Some(job.converged[0]),
                hemicube,
                job.converged_error,
            ),
            row(
                &format!("hemicubes, {} plain shots", job.shots),
                Some(job.converged[1]),
                hemicube,
                job.converged_error,
            ),
        ],
    }
}

fn reconstruction(report: &Report) -> Table {
    let row = |r: &paper::reconstruction::Reconstruction| {
        let was = |index: usize| printed(r.published.map(|published| published[index]));
        vec![
            r.lights.to_string(),
            number(r.float),
            number(r.integer),
            number(r.change),
            number(r.codes as f64 / 1024.0),
            number(r.atlas as f64 / 1024.0),
            was(0),
            was(1),
        ]
    };
    Table {
        name: "reconstruction",
        header: &[
            "lights",
            "f32_ms",
            "integer_ms",
            "one_light_ms",
            "codes_kib",
            "atlas_kib",
            "published_ms",
            "published_kb",
        ],
        rows: report.reconstruction.iter().map(row).collect(),
    }
}

fn scenes(report: &Report) -> Table {
    let row = |l: &paper::large::Large| {
        let counts = [l.polygons, l.patches, l.elements].map(|count| count.to_string());
        let times = [l.plain, l.exact, l.shipped].map(number);
        let names = [l.scene.to_owned(), l.lights.to_string()].into_iter();
        let was = [l.published.to_owned(), number(l.published_seconds)];
        names.chain(counts).chain(times).chain(was).collect()
    };
    Table {
        name: "scenes",
        header: &[
            "scene",
            "lights",
            "polygons",
            "patches",
            "elements",
            "rays_100_shots_s",
            "exact_100_shots_s",
            "shipped_bake_s",
            "published_scene",
            "published_100_shots_s",
        ],
        rows: report.large.iter().map(row).collect(),
    }
}

fn faces(report: &Report) -> Table {
    let row = |f: &paper::faces::Faces| {
        let times = f.published.map(number).into_iter();
        let rest = [f.exact, f.sums, f.exact_sums].map(number);
        let sweeps = [f.sweeps.to_string(), number(f.sweeping)];
        let faces = std::iter::once(f.faces.to_string());
        faces.chain(times).chain(rest).chain(sweeps).collect()
    };
    Table {
        name: "faces",
        header: &[
            "faces",
            "basic_ms",
            "stored_geometry_ms",
            "half_matrix_ms",
            "our_exact_rows_ms",
            "receiver_sum_error",
            "our_receiver_sum_error",
            "gauss_seidel_sweeps",
            "sweeps_ms",
        ],
        rows: report.faces.iter().map(row).collect(),
    }
}

fn json(report: &Report) -> Value {
    let by_lights = |values: Vec<(u32, f64)>| -> Map<String, Value> {
        values
            .into_iter()
            .map(|(lights, value)| (lights.to_string(), json!(value)))
            .collect()
    };
    let sampling = report.sampling.iter();
    let job = &report.job;
    let rows = report
        .rows
        .iter()
        .map(|r| (r.reflectance.to_string(), json!(r.rows)));
    json!({
        "tagging_overhead": by_lights(sampling.clone().map(|s| (s.lights, s.overhead())).collect()),
        "speedup_vs_separate": by_lights(sampling.clone().map(|s| (s.lights, s.speedup())).collect()),
        "microseconds_per_row": by_lights(sampling.clone().map(|s| (s.lights, s.row)).collect()),
        "ns_per_element_light": by_lights(sampling.map(|s| (s.lights, s.lane)).collect()),
        "speedup_cached": by_lights(report.cached.iter().map(|c| (c.lights, c.speedup())).collect()),
        "seed_job": {
            "time_ratio_vs_separate_hemicube": job.ours / job.hemicubes,
            "time_ratio_vs_converged_hemicube": job.ours / job.converged[1],
            "time_ratio_vs_kept_hemicube": job.ours / job.converged[0],
            "row_time_ratio": job.row[0] / job.row[1],
            "error": job.error.dense_patch,
            "error_fine_rows": job.error.fine,
            "error_ratio": job.hemicube_error.dense_patch / job.error.dense_patch,
            "error_ratio_fine_rows": job.hemicube_error.fine / job.error.fine,
            "error_ratio_converged_hemicube": job.converged_error.fine / job.error.fine,
            "receiver_sum_error": job.sums,
        },
        "rows": rows.collect::<Map<_, _>>(),
        "shooters": report.rows.iter().map(|r| r.shooters).max(),
        "patches": report.rows.iter().map(|r| r.patches).max(),
        "shots_to_5_percent": report.first_looks.first().map(|look| {
            json!({"plain": look.plain, "kept": look.kept, "closed": look.closed})
        }),
        "row_storage": report.storage.iter().map(|stored| {
            let [five, one] = stored.to_errors;
            json!({
                "rows": stored.rows,
                "bytes": stored.bytes,
                "closed": stored.is_closed,
                "rows_to_residual": stored.to_residual,
                "rows_to_5_percent": five,
                "rows_to_1_percent": one,
            })
        }).collect::<Vec<_>>(),
        "scenes": report.large.len(),
    })
}
