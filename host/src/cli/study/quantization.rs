//! `relume study quantization`: writes tables, charts, and a wall under every format.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use serde::Serialize;
use serde_json::{Value, json};

use crate::cli::{tell, write_file};
use crate::picture::encode_png;
use crate::study::quantization::accumulate::{Pass, visible_from};
use crate::study::quantization::{self, Report, Row};

pub fn run(folder: &Path) -> Result<Value> {
    let data =
        std::env::var_os("RELUME_DATA").map_or_else(|| "../shared/data".into(), PathBuf::from);
    let report = quantization::run(&data, |what| tell!("measuring: {what}"))?;

    let mut files = vec![
        ("quantization.csv".to_owned(), csv(&report.rows)?),
        ("accumulation.csv".to_owned(), csv(&report.accumulation)?),
        ("rates.csv".to_owned(), csv(&report.rates)?),
        ("framework.csv".to_owned(), csv(&report.cases)?),
        ("wall.png".to_owned(), encode_png(&report.wall)?),
    ];
    let charts = report.charts()?.into_iter();
    files.extend(charts.map(|(name, svg)| (name, svg.into_bytes())));
    let mut written: Vec<PathBuf> = Vec::new();
    for (name, bytes) in files {
        let path = folder.join(name);
        write_file(&path, &bytes)?;
        written.push(path);
    }

    print(&report);
    tell!("{} holds {} files", folder.display(), written.len());
    let front: Vec<_> = report.front();
    Ok(json!({
        "study": "quantization",
        "files": written,
        "rows": report.rows,
        "rates": report.rates,
        "front": front,
        "accumulation": report.accumulation,
        "visible_from": {
            "truncated_bias": visible_from(&report.accumulation, Pass::Truncate, |row| row.bias),
            "truncated_rms": visible_from(&report.accumulation, Pass::Truncate, |row| row.rms),
            "rounded_rms": visible_from(&report.accumulation, Pass::Round, |row| row.rms),
            "wide_rms": visible_from(&report.accumulation, Pass::Wide, |row| row.rms),
            "published": "more than 10",
        },
        "range": report.range,
        "framework": report.cases,
    }))
}

fn csv(lines: &[impl Serialize]) -> Result<Vec<u8>> {
    let mut table = csv::Writer::from_writer(Vec::new());
    for line in lines {
        table.serialize(line).context("a table")?;
    }
    Ok(table.into_inner()?)
}

fn print(report: &Report) {
    tell!(
        "\n{:14} {:>5} {:>4} {:15} {:>6} {:>8} {:>8} {:>8} {:>8} {:>9} {:>6}",
        "scene",
        "elem.",
        "k",
        "format",
        "bits",
        "random",
        "solo",
        "all",
        "mean",
        "relative",
        "ns"
    );
    for row in &report.rows {
        let Row {
            scene,
            elements,
            k,
            format,
            bits_per_rgb,
            max_codes_random,
            max_codes_solo,
            max_codes,
            mean_codes,
            nanoseconds,
            ..
        } = row;
        let percent = 100.0 * row.relative_rms;
        tell!(
            "{scene:14} {elements:>5} {k:>4} {format:15} {bits_per_rgb:6.2} {max_codes_random:8.2} \
             {max_codes_solo:8.2} {max_codes:8.2} {mean_codes:8.3} {percent:7.3} % {nanoseconds:6.2}"
        );
    }
    tell!(
        "\n8-bit accumulation, codes of the linear framebuffer: lights, pass, largest, rms, bias"
    );
    for row in &report.accumulation {
        let pass = format!("{:?}", row.pass);
        tell!(
            "{:>4} {pass:9} {:8.2} {:8.2} {:8.2}   as displayed {:8.2} {:8.2} {:8.2}",
            row.k,
            row.max,
            row.rms,
            row.bias,
            row.max_display,
            row.rms_display,
            row.bias_display
        );
    }
    let range = &report.range;
    tell!(
        "\nexponential code: vanishes below {:.6}, smallest {:.6}, largest {:.4}, saturates above {:.4}: \
         1:{:.0} (published 1:{:.0})",
        range.vanishes_below,
        range.smallest,
        range.largest,
        range.saturates_above,
        range.ratio,
        range.published
    );
    tell!(
        "\nfour lights: memory, cost (published), largest error of dimmings, mean, ns an element"
    );
    for case in &report.cases {
        let published = case.published_memory.zip(case.published_cost);
        let published = published.map_or_else(String::new, |(memory, cost)| {
            format!("({memory:.1}, {cost:.2})")
        });
        tell!(
            "{:40} {:5.3} {:6.2} {published:12} {:8.2} {:8.3} {:7.2}",
            case.name,
            case.memory,
            case.cost,
            case.max_codes_random,
            case.mean_codes,
            case.nanoseconds
        );
    }
    tell!("\nbits against error: what nothing beats in both");
    for rate in report.front() {
        let step = rate
            .step
            .map_or_else(String::new, |step| format!("step {step}"));
        tell!(
            "{:15} {step:10} {:6.2} bits {:8.2} codes",
            rate.format,
            rate.bits_per_rgb,
            rate.max_codes_dimming
        );
    }
}
