//! `relume form-factor`.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, anyhow, bail};
use clap::{Args, ValueEnum};
use glam::DVec3;
use relume::color::Rgb;
use relume::form_factor::Shooter;
use relume::geometry::Polygon;
use relume::scene::Surface;
use relume::visibility::Occluders;
use serde_json::{Value, json};

use super::load::read;
use super::{Outcome, tell, write_file};
use crate::polygon_pair::{ConvexPolygon, Estimate, form_factor};

/// Polygons of one pair may differ in size by this; far beyond it products of their coordinates vanish.
const LARGEST_RATIO: f64 = 1e30;

#[derive(Debug, Args)]
pub struct Arguments {
    /// Pairs of polygons with their blockers, as JSON (see the README)
    input: PathBuf,
    /// Whose code answers
    #[arg(long, value_enum, default_value_t = Method::Exact)]
    method: Method,
    /// Where the answer goes; `-` is stdout
    #[arg(short, long, value_name = "OUT.json", default_value = "-")]
    output: PathBuf,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Method {
    /// The exact one of the host, in f64, with a bound of its error
    Exact,
    /// The solver's, in f32; its error is the difference from the exact one
    Solver,
}

/// One pair.
#[derive(Clone, Debug)]
pub struct Case {
    /// What it is called.
    pub name: String,
    /// Whose light is followed.
    pub from: ConvexPolygon,
    /// Where it may arrive.
    pub to: ConvexPolygon,
    /// What may be in between.
    pub blockers: Vec<ConvexPolygon>,
}

/// A case's answer and the time that it took.
struct Answer {
    factor: Estimate,
    time: Duration,
}

pub fn run(arguments: &Arguments, json: bool) -> Result<Outcome> {
    let file = arguments.input.display();
    let cases = read_cases(&read(&arguments.input)?).with_context(|| file.to_string())?;
    let answers: Vec<Answer> = cases
        .iter()
        .map(|case| {
            answer(case, arguments.method).with_context(|| format!("{file}: case `{}`", case.name))
        })
        .collect::<Result<_>>()?;
    print_table(&cases, &answers);

    let listed = cases.iter().zip(&answers).map(|(case, answer)| {
        json!({"name": case.name, "f": answer.factor.value, "error": answer.factor.error})
    });
    let answered = json!({ "cases": listed.collect::<Vec<_>>() });
    let is_stdout = arguments.output == Path::new("-");
    if !(json && is_stdout) {
        write_file(&arguments.output, format!("{answered:#}\n").as_bytes())?;
    }
    Ok(Outcome::done(if is_stdout {
        answered
    } else {
        json!({"file": arguments.output.display().to_string(), "cases": cases.len()})
    }))
}

/// The cases of a JSON file for `relume form-factor`.
///
/// # Errors
/// One line that names the case, and says what to do.
pub fn read_cases(bytes: &[u8]) -> Result<Vec<Case>> {
    let value: Value = serde_json::from_slice(bytes)
        .map_err(|error| anyhow!("not JSON ({error}); write {{\"cases\": [...]}}"))?;
    let Some(cases) = value.get("cases").and_then(Value::as_array) else {
        bail!("it has no list `cases`; write {{\"cases\": [...]}}");
    };
    let numbered = cases.iter().enumerate();
    numbered
        .map(|(number, case)| parse_case(number, case))
        .collect()
}

fn parse_case(number: usize, case: &Value) -> Result<Case> {
    let Some(name) = case.get("name").and_then(Value::as_str) else {
        bail!("case {number} (counted from 0) has no text `name`; give it one");
    };
    let place = |what: &str| format!("case {number} `{name}`, {what}");
    let outline = |field: &str| match case.get(field) {
        Some(value) => polygon(value).with_context(|| place(field)),
        None => bail!(
            "{} is missing; give a list of points [x, y, z]",
            place(field)
        ),
    };
    let blockers = match case.get("blockers") {
        None => &[],
        Some(Value::Array(blockers)) => blockers.as_slice(),
        Some(_) => bail!(
            "{} is no list; give a list of polygons, or leave it out",
            place("blockers")
        ),
    };
    let blockers = blockers.iter().enumerate();
    let blockers =
        blockers.map(|(k, value)| polygon(value).with_context(|| place(&format!("blocker {k}"))));
    let (from, to) = (outline("from")?, outline("to")?);
    let sizes = [from.extent(), to.extent()];
    if sizes[0].min(sizes[1]) < sizes[0].max(sizes[1]) / LARGEST_RATIO {
        bail!(
            "case {number} `{name}`: one polygon is {LARGEST_RATIO:e} times as large as the other one; divide it"
        );
    }
    Ok(Case {
        name: name.to_owned(),
        from,
        to,
        blockers: blockers.collect::<Result<_>>()?,
    })
}

fn polygon(value: &Value) -> Result<ConvexPolygon> {
    let points = value.as_array().map_or(&[][..], Vec::as_slice);
    let vertices = points.iter().map(|point| {
        let numbers = point.as_array()?.iter().map(Value::as_f64);
        let numbers: [f64; 3] = numbers.collect::<Option<Vec<_>>>()?.try_into().ok()?;
        Some(DVec3::from_array(numbers))
    });
    let Some(vertices) = vertices
        .collect::<Option<Vec<_>>>()
        .filter(|_| value.is_array())
    else {
        bail!("it is no list of points; give every point as three numbers [x, y, z]");
    };
    Ok(ConvexPolygon::new(&vertices)?)
}

/// The fastest of three evaluations.
fn answer(case: &Case, method: Method) -> Result<Answer> {
    let mut fastest = Duration::MAX;
    let mut timed = |work: &dyn Fn() -> Result<Estimate>| {
        let start = Instant::now();
        let factor = work();
        fastest = fastest.min(start.elapsed());
        factor
    };
    let work = || match method {
        Method::Exact => Ok(form_factor(&case.from, &case.to, &case.blockers)),
        Method::Solver => solver_factor(&case.from, &case.to, &case.blockers),
    };
    let mut factor = timed(&work)?;
    for _ in 0..2 {
        factor = timed(&work)?;
    }
    if method == Method::Solver {
        let exact = form_factor(&case.from, &case.to, &case.blockers);
        factor.error = (factor.value - exact.value).abs() + exact.error;
    }
    Ok(Answer {
        factor,
        time: fastest,
    })
}

/// The solver's factor, in `f32` about the first vertex; its error is not known here.
fn solver_factor(
    from: &ConvexPolygon,
    to: &ConvexPolygon,
    blockers: &[ConvexPolygon],
) -> Result<Estimate> {
    let origin = from.vertices()[0];
    let local = |polygon: &ConvexPolygon| -> Vec<glam::Vec3> {
        let vertices = polygon.vertices().iter();
        vertices.map(|v| (*v - origin).as_vec3()).collect()
    };
    let refused = |error: &dyn std::fmt::Display| anyhow!("{error} (in f32); use --method exact");
    let polygon = |p| Polygon::new(&local(p)).map_err(|error| refused(&error));
    let (receiver, shooter) = (polygon(from)?, Shooter::new(polygon(to)?));
    let surfaces = blockers.iter().zip(0..);
    let surfaces = surfaces.map(|(b, index)| Surface::new(index, &local(b), Rgb::BLACK));
    let surfaces: Vec<Surface> = surfaces
        .collect::<Result<_, _>>()
        .map_err(|error| refused(&error))?;
    Ok(Estimate {
        value: f64::from(shooter.form_factor(&receiver, &Occluders(&surfaces))),
        error: f64::NAN,
    })
}

fn print_table(cases: &[Case], answers: &[Answer]) {
    let width = cases.iter().map(|case| case.name.chars().count()).max();
    let width = width.unwrap_or(0).max(4);
    tell!(
        "{:width$}  {:>18}  {:>8}  {:>9}",
        "case",
        "form factor",
        "error",
        "us"
    );
    for (case, answer) in cases.iter().zip(answers) {
        let Estimate { value, error } = answer.factor;
        let time = microseconds(answer.time);
        tell!(
            "{:width$}  {value:18.12e}  {error:8.1e}  {time:9.1}",
            case.name
        );
    }
    for (kind, is_occluded) in [("open", false), ("occluded", true)] {
        let of_kind = cases.iter().zip(answers);
        let of_kind = of_kind.filter(|(case, _)| case.blockers.is_empty() != is_occluded);
        let mut times: Vec<f64> = of_kind
            .map(|(_, answer)| microseconds(answer.time))
            .collect();
        times.sort_by(f64::total_cmp);
        if let (Some(median), Some(longest)) = (times.get(times.len() / 2), times.last()) {
            let count = times.len();
            tell!(
                "{count} {kind}: median {median:.1} us, longest {longest:.1} us (fastest of 3, one thread)"
            );
        }
    }
}

fn microseconds(time: Duration) -> f64 {
    time.as_secs_f64() * 1e6
}
