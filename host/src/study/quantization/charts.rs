//! The study as charts.

use super::accumulate::{Accumulation, Pass, VISIBLE, visible_from};
use super::range::{Range, Sweep};
use super::{Rate, Row};
use crate::chart::{Chart, ChartError, Series, Style, Vertical};

/// What is read off a row.
type Quantity = fn(&Row) -> f64;

/// The name and the text of an SVG.
type Drawn = Result<(String, String), ChartError>;

/// The line that nobody sees.
const CODE: f64 = 1.0;

/// What is drawn as zero on a logarithmic axis.
const LEAST: f64 = 1e-3;

fn curve(name: impl Into<String>, points: Vec<(f64, f64)>) -> Series {
    Series {
        name: name.into(),
        style: Style::Curve,
        points,
        notes: Vec::new(),
    }
}

/// A broad grey line at one height.
fn level(name: &str, height: f64, ends: [f64; 2]) -> Series {
    Series {
        name: name.to_owned(),
        style: Style::Front,
        points: ends.map(|x| (x, height)).to_vec(),
        notes: Vec::new(),
    }
}

fn ring(name: String, at: Option<(f64, f64)>) -> Series {
    Series {
        name,
        style: Style::Ring,
        points: at.into_iter().collect(),
        notes: Vec::new(),
    }
}

/// Error against number of lights, for the mesh of a scene: largest of random dimmings, of lights alone, and mean.
pub fn against_lights(rows: &[Row], scene: &str) -> Result<Vec<(String, String)>, ChartError> {
    let kinds: [(&str, &str, Quantity); 3] = [
        (
            "random",
            "largest error, random dimmings (display codes)",
            |row| row.max_codes_random.into(),
        ),
        (
            "solo",
            "largest error, a light alone (display codes)",
            |row| row.max_codes_solo.into(),
        ),
        (
            "mean",
            "mean error, random dimmings (display codes)",
            |row| row.mean_codes,
        ),
    ];
    let least = rows
        .iter()
        .filter(|row| row.scene == scene)
        .map(|row| row.elements)
        .min();
    let own = || {
        let rows = rows.iter().filter(|row| row.scene == scene);
        rows.filter(move |row| Some(row.elements) == least)
    };
    let mut names: Vec<&str> = own().map(|row| row.format).collect();
    let mut seen = std::collections::HashSet::new();
    names.retain(|name| seen.insert(*name));
    let largest = own().map(|row| row.k).max().unwrap_or(1) as f64;
    let charts = kinds.map(|(kind, y, error)| -> Drawn {
        let curves = names.iter().map(|name| {
            let rows = own().filter(|row| row.format == *name);
            let points = rows.map(|row| (row.k as f64, error(row).max(LEAST)));
            curve(*name, points.collect())
        });
        let chart = Chart {
            title: format!("{scene}: error against the number of lights"),
            x: "lights".to_owned(),
            y: Vertical::Values(y.to_owned()),
            series: curves
                .chain([level("one code", CODE, [1.0, largest])])
                .collect(),
        };
        Ok((format!("lights_{kind}.svg"), chart.svg()?))
    });
    charts.into_iter().collect()
}

/// Error of 8-bit accumulation against the number of lights.
pub fn accumulation(measured: &[Accumulation]) -> Drawn {
    let scene = measured.first().map_or("", |row| row.scene);
    let of = |pass: Pass, error: fn(&Accumulation) -> f64| -> Vec<(f64, f64)> {
        let own = measured.iter().filter(|row| row.pass == pass);
        own.map(|row| (row.k as f64, error(row).abs().max(LEAST)))
            .collect()
    };
    let largest = measured.iter().map(|row| row.k).max().unwrap_or(1) as f64;
    let bias = |row: &Accumulation| row.bias;
    let rms = |row: &Accumulation| row.rms;
    let at = |pass, error: fn(&Accumulation) -> f64| {
        let k = visible_from(measured, pass, error)?;
        let row = measured.iter().find(|row| row.pass == pass && row.k == k)?;
        Some((k as f64, error(row).abs()))
    };
    let mark = |name: &str, at: Option<(f64, f64)>| {
        let from = at.map_or_else(|| "never".to_owned(), |(k, _)| format!("{k} lights"));
        ring(format!("{name}: {from}"), at)
    };
    let ten = measured
        .iter()
        .find(|row| row.pass == Pass::Truncate && row.k == 10);
    let chart = Chart {
        title: format!("{scene}: a pass per light into an 8-bit framebuffer"),
        x: "lights".to_owned(),
        y: Vertical::Values("error (codes of the linear framebuffer)".to_owned()),
        series: vec![
            curve("cut off: largest", of(Pass::Truncate, |row| row.max)),
            curve("cut off: rms", of(Pass::Truncate, rms)),
            curve("cut off: bias, negative", of(Pass::Truncate, bias)),
            curve("k / 2", vec![(1.0, 0.5), (largest, largest / 2.0)]),
            curve("rounded: largest", of(Pass::Round, |row| row.max)),
            curve("rounded: rms", of(Pass::Round, rms)),
            curve("wide: largest", of(Pass::Wide, |row| row.max)),
            curve("wide: rms", of(Pass::Wide, rms)),
            level("two codes, visible", VISIBLE, [1.0, largest]),
            mark("bias visible from", at(Pass::Truncate, bias)),
            mark("rounding visible from", at(Pass::Round, rms)),
            ring(
                "published: 'more than 10'".to_owned(),
                ten.map(|row| (10.0, row.rms)),
            ),
        ],
    };
    Ok(("accumulation.svg".to_owned(), chart.svg()?))
}

/// Bits against error, and what nothing else beats in both.
pub fn rates(rates: &[Rate]) -> Drawn {
    let point = |rate: &Rate| {
        (
            rate.bits_per_rgb,
            f64::from(rate.max_codes_dimming).max(LEAST),
        )
    };
    let mut series: Vec<Series> = Vec::new();
    for rate in rates {
        match series.iter_mut().find(|series| series.name == rate.format) {
            Some(series) => series.points.push(point(rate)),
            None => series.push(curve(rate.format, vec![point(rate)])),
        }
    }
    series.push(Series {
        name: "Pareto front".to_owned(),
        style: Style::Front,
        points: front(rates).into_iter().map(point).collect(),
        notes: Vec::new(),
    });
    let chart = Chart {
        title: rates.first().map_or_else(String::new, |first| {
            let Rate {
                scene, k, elements, ..
            } = first;
            format!("{scene}, {k} lights, {elements} elements: bits against error")
        }),
        x: "bits per RGB element and light".to_owned(),
        y: Vertical::Values("largest error, lights dimming (display codes)".to_owned()),
        series,
    };
    Ok(("rate.svg".to_owned(), chart.svg()?))
}

/// Those that no other one beats in bits and error, by their bits.
pub fn front(rates: &[Rate]) -> Vec<&Rate> {
    let mut sorted: Vec<&Rate> = rates.iter().collect();
    sorted.sort_by(|a, b| {
        let bits = a.bits_per_rgb.total_cmp(&b.bits_per_rgb);
        bits.then(a.max_codes_dimming.total_cmp(&b.max_codes_dimming))
    });
    let mut least = f32::INFINITY;
    sorted.retain(|rate| {
        let is_better = rate.max_codes_dimming < least;
        least = least.min(rate.max_codes_dimming);
        is_better
    });
    sorted
}

/// The relative error of every code over its range, and the ends of the published one.
pub fn range(range: &Range, sweeps: &[(&'static str, Sweep)]) -> Drawn {
    let top = f64::from(range.largest);
    let percent = |sweep: &Sweep| -> Vec<(f64, f64)> {
        sweep
            .iter()
            .map(|(x, off)| (*x, 100.0 * off.max(1e-5)))
            .collect()
    };
    let curves = sweeps
        .iter()
        .map(|(name, sweep)| curve(*name, percent(sweep)));
    let ratio = range.ratio;
    let chart = Chart {
        title: "what a code can tell apart".to_owned(),
        x: "value over the largest one of its light".to_owned(),
        y: Vertical::Values("largest relative error (%)".to_owned()),
        series: curves
            .chain([
                ring(
                    format!("exp8: 1:{ratio:.0}, vanishes below"),
                    Some((f64::from(range.vanishes_below) / top, 100.0)),
                ),
                ring("exp8: saturates above 5.541".to_owned(), Some((1.0, 6.0))),
            ])
            .collect(),
    };
    Ok(("range.svg".to_owned(), chart.svg()?))
}
