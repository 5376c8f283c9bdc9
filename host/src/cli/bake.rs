//! `relume bake`.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use relume::color::Rgb;
use serde_json::json;

use super::{Outcome, human_bytes, keep, output_path, spare, tell, write_file, wrong_usage};
use crate::bake::{
    BakeError, MOST_BAKES, MOST_ELEMENTS, Method, Progress, Settings, bake_keeping, update,
};
use crate::gather::{self, Hits};
use crate::import;
use crate::scene::OwnedScene;
use crate::solution::{self, Solution};

/// Most names in a line for people; `--json` has them all.
const MOST_NAMES: usize = 8;

/// Display codes in a relative error of one: `255 * 1.055 / 2.4` in the bright, less in the dark (the slope of sRGB's curve).
const CODES_PER_ERROR: f32 = 112.0;

/// Rounding of coordinates, in diagonals of the scene, that is told: details of a hundredth are a
/// hundredth off.
const COARSE_STEP: f32 = 1e-4;

#[derive(Debug, Args)]
pub struct Arguments {
    /// The scene: .obj, .gltf or .glb
    scene: PathBuf,
    /// Lights to add or to change (TOML)
    #[arg(long, value_name = "FILE.toml")]
    lights: Option<PathBuf>,
    /// Where the solution goes; `-` is stdout [default: the scene's name .solution, here]
    #[arg(short, long, value_name = "FILE.solution")]
    output: Option<PathBuf>,
    /// Longest edge of a patch, in the file's units [default: four elements]
    #[arg(long, value_name = "LENGTH", value_parser = positive)]
    patch: Option<f32>,
    /// Longest edge of an element [default: sqrt(reflecting area / 8000), longer where polygons are many]
    #[arg(long, value_name = "LENGTH", value_parser = positive)]
    element: Option<f32>,
    /// Stop when every light has at most this share of its power left to distribute
    #[arg(long, value_name = "R", default_value_t = Settings::default().residual, value_parser = share)]
    residual: f32,
    /// Meet this estimated relative error for every light, with elements and rays that are just enough
    #[arg(long, value_name = "E", value_parser = share, conflicts_with_all = ["shots", "plain"])]
    error: Option<f32>,
    /// Stop after so many distinct rows, the others being estimated, and passes of 16 rays (plain shots with --plain)
    #[arg(long, value_name = "N")]
    shots: Option<u32>,
    /// As published: rows are not kept, and nothing stands for what is left
    #[arg(long)]
    plain: bool,
    /// Keep direct and indirect light apart
    #[arg(long)]
    split_direct: bool,
    /// How bounces are found: elements gather rays, patches shoot rows of exact form factors, or the
    /// solver does that alone, as on a device
    #[arg(long, value_enum, default_value_t = MethodName::Gather)]
    method: MethodName,
    /// Keep where the rays ended, for --update
    #[arg(long, value_name = "FILE.rows", conflicts_with = "update")]
    keep_rows: Option<PathBuf>,
    /// Solve again only for the lights that are not as in this solution
    #[arg(long, value_name = "OLD.solution", requires = "rows", conflicts_with_all = ["patch", "element", "shots", "plain", "error", "split_direct"])]
    update: Option<PathBuf>,
    /// What --keep-rows kept when that solution was baked
    #[arg(long, value_name = "FILE.rows", requires = "update")]
    rows: Option<PathBuf>,
    /// Threads [default: one per core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum MethodName {
    Gather,
    Rows,
    Device,
}

/// A share of a whole.
fn share(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(value) if value > 0.0 && value < 1.0 => Ok(value),
        _ => Err("it must be a number between 0 and 1".to_owned()),
    }
}

fn positive(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(value) if value > 0.0 && value.is_finite() => Ok(value),
        _ => Err("it must be a positive number".to_owned()),
    }
}

impl Arguments {
    fn settings(&self) -> Settings {
        Settings {
            patch: self.patch,
            element: self.element,
            residual: self.residual,
            shots: self.shots,
            plain: self.plain,
            error: self.error,
            split_direct: self.split_direct,
            method: match self.method {
                MethodName::Gather => Method::Gather,
                MethodName::Rows => Method::Rows,
                MethodName::Device => Method::Device,
            },
            ..Settings::default()
        }
    }
}

pub fn run(arguments: &Arguments, json: bool) -> Result<Outcome> {
    let path = arguments.scene.display().to_string();
    let output = output_path(
        arguments.output.as_deref(),
        &arguments.scene,
        "solution",
        json,
    );
    let inputs = [&arguments.lights, &arguments.update, &arguments.rows];
    for input in inputs.into_iter().flatten() {
        keep(input, &output);
    }
    spare(&output, &solution::MAGIC);
    if let Some(rows) = &arguments.keep_rows {
        keep(&arguments.scene, rows);
        spare(rows, &gather::MAGIC);
        if *rows == output {
            wrong_usage("--keep-rows and -o name the same file: give them two");
        }
    }
    let imported = import::load(&arguments.scene, arguments.lights.as_deref())?;
    for line in imported.repairs.lines() {
        tell!("{path}: {line}");
    }

    if let Some(step) = coordinate_step(&imported.scene).filter(|step| *step > COARSE_STEP) {
        tell!(
            "{path}: it lies so far from the origin that coordinates round to {:.1e} of its size; move it \
             there in the program that made it",
            step
        );
    }
    let mut pool = rayon::ThreadPoolBuilder::new();
    if let Some(threads) = arguments.threads {
        pool = pool.num_threads(threads.into());
    }
    let pool = pool.build().context("starting threads")?;
    let scene = &imported.scene;
    let settings = arguments.settings();
    let baked = match (&arguments.update, &arguments.rows) {
        (Some(old), Some(rows)) => {
            let (old, hits) = read_old(old, rows)?;
            let settings = Settings {
                split_direct: old.direct.is_some(),
                ..settings
            };
            pool.install(|| {
                watched(|watch| {
                    let (solution, changed) = update(scene, &old, &hits, &settings, watch)?;
                    tell!("{path}: lights solved again: {changed}");
                    Ok((solution, hits.clone()))
                })
            })
        }
        _ => pool.install(|| watched(|watch| bake_keeping(scene, &settings, watch))),
    };
    let baked = baked.with_context(|| path.clone())?;
    let Some(baked) = baked else {
        return Ok(Outcome {
            interrupted: true,
            report: json!({"interrupted": true}),
        });
    };
    let unlit = baked.unlit(arguments.residual);
    if !unlit.is_empty() {
        let more = if unlit.len() > MOST_NAMES {
            ", ..."
        } else {
            ""
        };
        let names = unlit[..unlit.len().min(MOST_NAMES)].join(", ");
        tell!("{path}: lights that reach no surface: {names}{more}");
    }
    if let Some(file) = &arguments.keep_rows {
        if baked.solution.method != Method::Gather {
            bail!("{}: only --method gather has rays to keep", file.display());
        }
        let mesh = solution::mesh_checksum(&baked.solution);
        let elements = baked.solution.mesh.elements.len();
        write_file(file, &gather::write(&baked.hits, mesh, elements))?;
    }
    let bytes = solution::write(&baked.solution);
    write_file(&output, &bytes)?;
    report(&baked, &output.display().to_string(), bytes.len());
    if let Some(goal) = arguments.error {
        report_choice(&baked, goal);
    }

    let solution = &baked.solution;
    let lights = solution.lights.iter().map(|light| {
        json!({"name": light.name, "emission": light.emission.to_array(), "residual": light.residual, "error": light.error})
    });
    Ok(Outcome {
        interrupted: baked.interrupted,
        report: json!({
            "file": output.display().to_string(),
            "bytes": bytes.len(),
            "surfaces": solution.surfaces.len(),
            "faces": solution.mesh.faces.len(),
            "patches": solution.mesh.patches.len(),
            "elements": solution.mesh.elements.len(),
            "lights": solution.lights.len(),
            "per_light": lights.collect::<Vec<_>>(),
            "patch": solution.spacing.patch,
            "element": solution.spacing.element,
            "shots": solution.rows,
            "residual": baked.residual(),
            "error": baked.error(),
            "wanted_error": arguments.error,
            "met": arguments.error.map(|goal| baked.error() <= goal),
            "method": arguments.settings().method.name(),
            "seconds": baked.time.as_secs_f64(),
            "interrupted": baked.interrupted,
            "unlit": unlit,
            "repairs": imported.repairs.lines(),
        }),
    })
}

/// By how much the farthest coordinate rounds, in diagonals of the scene; `None` for an empty one.
fn coordinate_step(scene: &OwnedScene) -> Option<f32> {
    let vertices = scene.surfaces.iter().flat_map(|s| s.polygon().vertices());
    let farthest = vertices.map(|v| v.abs().max_element()).fold(0.0, f32::max);
    Some(farthest * f32::EPSILON / scene.view().ok()?.diagonal())
}

/// The solution to be updated, and the rows that belong to it.
fn read_old(old: &Path, rows: &Path) -> Result<(Solution, Hits)> {
    let bytes = super::load::read(old)?;
    let solution = solution::read(&bytes).with_context(|| old.display().to_string())?;
    let mesh = solution::mesh_checksum(&solution);
    let bytes = super::load::read(rows)?;
    let hits = gather::read(&bytes, mesh, solution.mesh.elements.len())
        .with_context(|| rows.display().to_string())?;
    Ok((solution, hits))
}

/// A solution, how long it took, and whether the user ended it.
pub struct Baked {
    pub solution: Solution,
    hits: Hits,
    pub time: Duration,
    pub interrupted: bool,
}

impl Baked {
    /// The largest residual of all lights.
    pub fn residual(&self) -> f32 {
        let residuals = self.solution.lights.iter().map(|light| light.residual);
        residuals.fold(0.0, f32::max)
    }

    /// The largest estimated error of all lights.
    pub fn error(&self) -> f32 {
        let errors = self.solution.lights.iter().map(|light| light.error);
        errors.fold(0.0, f32::max)
    }

    /// Names of the lights that have shot their share and reached nothing.
    fn unlit(&self, goal: f32) -> Vec<&str> {
        let lights = self.solution.lights.iter().enumerate();
        let values = &self.solution.contributions;
        let mut lit = vec![false; lights.len()];
        for element in values.chunks(lit.len()) {
            for (lit, value) in lit.iter_mut().zip(element) {
                *lit |= *value != Rgb::BLACK;
            }
        }
        lights
            .filter(|(tag, light)| !lit[*tag] && light.residual <= goal)
            .map(|(_, light)| light.name.as_str())
            .collect()
    }
}

/// Set by the first Ctrl-C; the second one ends the program at once.
static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// True when the user has asked to end, at any time since the first bake began.
pub fn is_interrupted() -> bool {
    INTERRUPTED.load(Ordering::Relaxed)
}

/// Bakes with a progress bar (on a terminal) and an ear for Ctrl-C; `None` when that came before
/// there was a solution.
pub fn watched(
    bake: impl FnOnce(
        &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<(Solution, Hits), BakeError>,
) -> Result<Option<Baked>> {
    // A handler that is already there does the same.
    let _ = ctrlc::set_handler(|| {
        if INTERRUPTED.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
    });
    let bar = ProgressBar::new(0).with_style(
        ProgressStyle::with_template("{bar:30} {pos}/{len} {msg}  {elapsed}")
            .context("progress bar")?,
    );
    let start = Instant::now();
    let mut interrupted = false;
    let mut watch = |progress: Progress| {
        let (done, all, what) = match progress {
            Progress::Meshing { done, parts } => (done, parts, "before the first row".to_owned()),
            Progress::Shooting {
                rows,
                most,
                residual,
            } => (
                rows as usize,
                most as usize,
                format!("rows  residual {residual:.5}"),
            ),
        };
        bar.set_length(all as u64);
        bar.set_position(done as u64);
        bar.set_message(what);
        interrupted = is_interrupted();
        if interrupted {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    };
    let baked = bake(&mut watch);
    bar.finish_and_clear();
    if matches!(baked, Err(BakeError::Interrupted)) {
        tell!("interrupted before the first row: there is nothing to write");
        return Ok(None);
    }
    let (solution, hits) = baked?;
    Ok(Some(Baked {
        solution,
        hits,
        time: start.elapsed(),
        interrupted,
    }))
}

fn report(baked: &Baked, file: &str, bytes: usize) {
    let solution = &baked.solution;
    if baked.interrupted {
        tell!("interrupted: this is what --shots {} gives", solution.rows);
    }
    tell!(
        "{file}: {} elements, {} patches, {} lights, {} rows, residual {:.1e}, estimated error {:.1} %, \
         {:.2} s, {}",
        solution.mesh.elements.len(),
        solution.mesh.patches.len(),
        solution.lights.len(),
        solution.rows,
        baked.residual(),
        100.0 * baked.error(),
        baked.time.as_secs_f64(),
        human_bytes(bytes),
    );
}

/// What `--error` chose, and why.
fn report_choice(baked: &Baked, goal: f32) {
    let solution = &baked.solution;
    let worst = solution
        .lights
        .iter()
        .max_by(|a, b| a.error.total_cmp(&b.error));
    let name = worst.map_or("", |light| &light.name);
    let verdict = if baked.error() <= goal {
        "met".to_owned()
    } else {
        let scatter = match solution.method {
            Method::Gather => ", whose rays scatter; --method rows has none",
            Method::Rows | Method::Device => "",
        };
        format!(
            "NOT met by {MOST_BAKES} bakes, or {MOST_ELEMENTS} elements, or the most rays of each{scatter}"
        )
    };
    let work = match solution.method {
        Method::Gather => "rows and passes of 16 rays for the scatter",
        Method::Rows | Method::Device => "rows, of patches divided where direct light varies",
    };
    tell!(
        "error {:.2} % wanted, {:.2} % estimated for the worst light ({name}): {verdict}; elements of {:.3} for the \
         variation inside them, {} {work}; `relume pack --max-error {:.1}` adds at most half as much",
        100.0 * goal,
        100.0 * baked.error(),
        solution.spacing.element,
        solution.rows,
        goal / 2.0 * CODES_PER_ERROR,
    );
}
