//! `relume study accuracy`: writes `accuracy.csv` and the charts.

use std::path::{Path, PathBuf};

use anyhow::Result;
use indicatif::ProgressBar;
use serde_json::{Value, json};

use crate::cli::{tell, write_file};
use crate::study::accuracy::{Cost, Effort, Judge, measure};

pub fn run(folder: &Path) -> Result<Value> {
    let bar = ProgressBar::new_spinner();
    let accuracy = measure(Effort::default(), &mut |what| {
        bar.set_message(what.to_owned());
        bar.tick();
    })?;
    bar.finish_and_clear();

    let mut files = vec![("accuracy.csv".to_owned(), accuracy.csv()?)];
    let charts = accuracy.charts()?.into_iter();
    files.extend(charts.map(|(name, svg)| (format!("accuracy_{name}"), svg.into_bytes())));
    let mut written: Vec<PathBuf> = Vec::new();
    for (name, bytes) in files {
        let path = folder.join(name);
        write_file(&path, &bytes)?;
        written.push(path);
    }

    tell!(
        "{:12} {:22} {:24} {:>9} {:>8} {:>8} {:>8} {:>8}",
        "scene",
        "method",
        "variant",
        "work",
        "time",
        "dense",
        "paths",
        "points"
    );
    for line in accuracy.lines() {
        let percent =
            |error: Option<f64>| error.map_or(String::new(), |e| format!("{:.2} %", 100.0 * e));
        tell!(
            "{:12} {:22} {:24} {:>9} {:>6.3} s {:>8} {:>8} {:>8}",
            line.scene,
            line.method,
            format!("{}, {} m, {}", line.variant, line.element, line.storage),
            line.work,
            line.seconds,
            percent(line.worst_dense_element),
            percent(line.worst_monte_carlo),
            percent(Some(line.worst_points)),
        );
    }
    for reference in &accuracy.references {
        let dense = reference.dense_element.worst();
        tell!(
            "{}: the dense solution of elements is itself {:.2} +- {:.2} % off the paths",
            reference.scene,
            100.0 * dense.error,
            100.0 * dense.standard_error
        );
    }
    for scene in accuracy.scenes() {
        let better = accuracy.beats_default(scene, Cost::Work, Judge::MonteCarlo);
        let names: Vec<&str> = better.iter().map(|row| row.family.name()).collect();
        if names.is_empty() {
            tell!("{scene}: nothing is as exact as the default for less work (against paths)");
        } else {
            tell!("{scene}: beaten by {} (against paths)", names.join(", "));
        }
    }
    tell!("{} holds {} files", folder.display(), written.len());
    Ok(json!({
        "study": "accuracy",
        "files": written,
        "rows": accuracy.lines(),
        "references": accuracy.references(),
        "verdicts": accuracy.verdicts(),
    }))
}
