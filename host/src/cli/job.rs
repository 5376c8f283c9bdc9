//! The main job, `relume` without a command: the built-in Cornell box, baked, packed, relit under
//! several mixes and compared, with pictures and a report in `out/`.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use relume::atlas::{Atlas, Quantity};
use relume::color::Rgb;
use serde_json::json;
use thiserror::Error;
use tiny_skia::Pixmap;

use super::bake::{Baked, is_interrupted, watched};
use super::pack::{MAX_ERROR, bits_per_rgb};
use super::relight::BACKGROUND;
use super::{Outcome, human_bytes, tell, write_file};
use crate::bake::{Settings, bake_keeping};
use crate::builtin::{Builtin, cornell_box};
use crate::display_error::{Mixed, Solo, max_codes};
use crate::export::exr;
use crate::mix::{Setting, mix};
use crate::pack::{Aim, Choice, Packing, PackingError, Request, choose, relight_atlas};
use crate::picture::{self, Exposure, LinearImage, Tile, error_map, sheet};
use crate::preview::{Camera, Relit, Viewpoint, light_layers, render, show};
use crate::solution::{self, Solution};

/// Where everything goes.
const FOLDER: &str = "out";

/// Size of the pictures in pixels.
const SIDE: u32 = 400;

/// Mixes that show what relighting can do: name and settings.
const MIXES: [(&str, &[&str]); 5] = [
    ("all on", &[]),
    ("evening", &["ceiling=0.05", "lamp=2"]),
    ("stage", &["ceiling=0", "lamp=0.3", "spot=1.5x#ff5040"]),
    ("cold", &["ceiling=#9fc4ff", "spot=0", "lamp=0"]),
    (
        "coloured",
        &["ceiling=0.1", "spot=#40ff80", "lamp=2x#4060ff"],
    ),
];

/// Files that were written, in order.
struct Folder(Vec<PathBuf>);

/// Ctrl-C came; what was written stays.
#[derive(Debug, Error)]
#[error("interrupted")]
struct Interrupted;

impl Folder {
    /// # Errors
    /// [`Interrupted`] after Ctrl-C, so that nothing follows the file that it found half-written.
    fn write(&mut self, name: &str, bytes: &[u8]) -> Result<()> {
        if is_interrupted() {
            return Err(Interrupted.into());
        }
        let path = Path::new(FOLDER).join(name);
        write_file(&path, bytes)?;
        self.0.push(path);
        Ok(())
    }

    fn png(&mut self, name: &str, picture: &Pixmap) -> Result<()> {
        self.write(name, &picture::encode_png(picture)?)
    }
}

/// One mix, relit from the atlas and from the solution.
struct Relighting {
    name: String,
    picture: Pixmap,
    error_map: Pixmap,
    exposure: f32,
    max_codes: f32,
}

/// The baked scene with its packed form and its camera.
struct Stage<'a> {
    solution: &'a Solution,
    atlas: Atlas<'a>,
    camera: Camera,
}

impl Stage<'_> {
    fn image(&self, irradiance: &[Rgb], mix: &[Rgb]) -> Result<LinearImage> {
        let exitance = self.solution.face_exitance(mix);
        Ok(render(
            &self.relit(irradiance, &exitance),
            &self.camera,
            f32::INFINITY,
        )?)
    }

    fn relit<'b>(&'b self, irradiance: &'b [Rgb], exitance: &'b [Rgb]) -> Relit<'b> {
        Relit {
            mesh: self.solution.mesh.view(),
            surfaces: &self.solution.surfaces,
            irradiance,
            exitance,
            gathered: None,
        }
    }

    /// Relights by the atlas, as a device would, and compares with the solution.
    fn relight(&self, name: &str, mix: &[Rgb]) -> Result<Relighting> {
        let exact = self.solution.relight(mix);
        let found = relight_atlas(&self.atlas, mix)?;
        let exitance = self.solution.face_exitance(mix);
        let relit = self.relit(&found, &exitance);
        let (picture, exposure) = show(&relit, &self.camera, Exposure::Auto, BACKGROUND)?;
        let title = format!("{name}: atlas against f32, display codes");
        let error_map = error_map(
            &self.image(&found, mix)?,
            &self.image(&exact, mix)?,
            exposure,
            &title,
            None,
        )?;
        Ok(Relighting {
            name: name.to_owned(),
            picture,
            error_map,
            exposure,
            max_codes: max_codes(&exact, &found),
        })
    }
}

pub fn run() -> Result<Outcome> {
    let mut folder = Folder(Vec::new());
    match make(&mut folder) {
        Ok(report) => Ok(Outcome::done(report)),
        Err(error) if error.is::<Interrupted>() => {
            tell!("interrupted: {FOLDER}/ got {} files", folder.0.len());
            Ok(Outcome {
                interrupted: true,
                report: json!({"interrupted": true, "files": folder.0}),
            })
        }
        Err(error) => Err(error),
    }
}

/// Bakes, packs, draws and compares; returns what `--json` prints.
fn make(folder: &mut Folder) -> Result<serde_json::Value> {
    let Builtin {
        scene,
        spacing,
        camera,
    } = cornell_box()?;
    let settings = Settings {
        patch: Some(spacing.patch),
        element: Some(spacing.element),
        ..Settings::default()
    };
    let baked = watched(|watch| bake_keeping(&scene, &settings, watch))?.ok_or(Interrupted)?;
    let solution = &baked.solution;
    let request = Request {
        aim: Aim::Error(MAX_ERROR),
        given: &vec![None; solution.lights.len()],
        quantity: Quantity::Irradiance,
        mesh: true,
    };
    let Choice {
        bytes: atlas_bytes,
        mut error,
        packing,
        ..
    } = choose(solution, request)?;
    let solution_bytes = solution::write(solution);
    let atlas = Atlas::parse(&atlas_bytes)?;

    fs::create_dir_all(FOLDER).with_context(|| format!("{FOLDER}: cannot be made"))?;
    folder.write("cornell.solution", &solution_bytes)?;
    folder.write("cornell.atlas", &atlas_bytes)?;
    let viewpoint = Viewpoint {
        eye: camera.eye,
        target: camera.target,
        up: camera.up,
        fov: camera.fov,
    };
    let stage = Stage {
        solution,
        atlas,
        camera: Camera::new(viewpoint, SIDE, SIDE)?,
    };
    let relightings = pictures(&stage, folder)?;
    for relit in &relightings {
        if relit.max_codes > error.all.packed {
            error.all.packed = relit.max_codes;
            error.worst_state.clone_from(&relit.name);
        }
    }
    write_layers(&stage, folder)?;
    let report = report(
        &baked,
        &error,
        &relightings,
        (packing, &atlas),
        atlas_bytes.len(),
        solution_bytes.len(),
    );
    folder.write("report.txt", report.as_bytes())?;
    tell!("{}", report.trim_end());
    tell!(
        "{FOLDER}/ holds {} files; see {FOLDER}/overview.png",
        folder.0.len()
    );

    Ok(json!({
            "lights": solution.lights.len(),
            "elements": solution.mesh.elements.len(),
            "patches": solution.mesh.patches.len(),
            "shots": solution.rows,
            "residual": baked.residual(),
            "bake_seconds": baked.time.as_secs_f64(),
            "atlas_bytes": atlas_bytes.len(),
            "code_bytes": atlas.code_bytes(),
            "solution_bytes": solution_bytes.len(),
            "code": packing.code.name(),
            "max_error_codes": error.all.packed,
            "codes_shown": error.all.shown,
            "achromatic_codes": error.achromatic.packed,
            "achromatic_shown": error.achromatic.shown,
            "worst_state": error.worst_state,
            "per_light": per_light(solution, &error),
            "mixes": relightings.iter().map(|r| json!({
                "name": r.name, "exposure": r.exposure, "max_error_codes": r.max_codes,
            })).collect::<Vec<_>>(),
            "files": folder.0,
    }))
}

/// Pictures of every light alone and of every mix, their errors, and one sheet of them all.
fn pictures(stage: &Stage, folder: &mut Folder) -> Result<Vec<Relighting>> {
    let lights = &stage.solution.lights;
    let mut relightings = Vec::new();
    for light in lights {
        let only: Setting = format!("{}=1", light.name)
            .parse()
            .map_err(anyhow::Error::msg)?;
        let mix = mix(lights, &[only], &[])?;
        let relit = stage.relight(&format!("{} alone", light.name), &mix)?;
        folder.png(&format!("light-{}.png", light.name), &relit.picture)?;
        relightings.push(relit);
    }
    for (name, settings) in MIXES {
        let set: Result<Vec<Setting>, String> = settings.iter().map(|s| s.parse()).collect();
        let mix = mix(lights, &[], &set.map_err(anyhow::Error::msg)?)?;
        let relit = stage.relight(name, &mix)?;
        folder.png(
            &format!("mix-{}.png", name.replace(' ', "-")),
            &relit.picture,
        )?;
        relightings.push(relit);
    }
    for relit in &relightings {
        let name = relit.name.replace(' ', "-");
        folder.png(&format!("error-{name}.png"), &relit.error_map)?;
    }
    let tiles: Vec<Tile> = relightings
        .iter()
        .map(|relit| Tile {
            picture: relit.picture.clone(),
            caption: format!("{} (error {:.1} codes)", relit.name, relit.max_codes),
        })
        .collect();
    let title = "One bake, three lights, any mix: relit from the atlas";
    folder.png("overview.png", &sheet(&tiles, 4, title)?)?;
    Ok(relightings)
}

/// One linear layer per light at nominal emission, and the picture of all together.
fn write_layers(stage: &Stage, folder: &mut Folder) -> Result<()> {
    let layers = light_layers(stage.solution, &stage.camera)?;
    folder.write("lights.exr", &exr::encode_light_layers(&layers)?)?;
    let nominal = stage.solution.nominal_mix();
    let all_on = stage.image(&stage.solution.relight(&nominal), &nominal)?;
    folder.write("all-on.exr", &exr::encode_rgb(&all_on)?)
}

fn per_light(solution: &Solution, error: &PackingError) -> Vec<serde_json::Value> {
    let lights = solution.lights.iter().zip(&error.per_light);
    lights
        .map(|(light, codes)| {
            json!({
                "name": light.name,
                "residual": light.residual,
                "max_error_codes": codes,
            })
        })
        .collect()
}

fn report(
    baked: &Baked,
    error: &PackingError,
    relightings: &[Relighting],
    (packing, atlas): (Packing, &Atlas),
    atlas_bytes: usize,
    solution_bytes: usize,
) -> String {
    let solution = &baked.solution;
    let elements = solution.mesh.elements.len();
    let mut text = String::new();
    let mut line = |line: String| {
        let _ = writeln!(text, "{line}");
    };
    line(format!(
        "Cornell box: {elements} elements, {} patches, {} lights, baked once in {:.2} s ({} rows)",
        solution.mesh.patches.len(),
        solution.lights.len(),
        baked.time.as_secs_f64(),
        solution.rows,
    ));
    line(format!(
        "solution {}, atlas {} (codes {}, the rest is mesh)",
        human_bytes(solution_bytes),
        human_bytes(atlas_bytes),
        human_bytes(atlas.code_bytes()),
    ));
    line(format!(
        "codes: {packing}, {:.2} bits per element and light",
        bits_per_rgb(atlas, atlas_bytes),
    ));
    line(String::new());
    line(format!(
        "{:<12} {:>9} {:>14}",
        "light", "residual", "error (codes)"
    ));
    for (light, codes) in solution.lights.iter().zip(&error.per_light) {
        line(format!(
            "{:<12} {:>9.1e} {:>14.2}",
            light.name, light.residual, codes,
        ));
    }
    line(String::new());
    line(format!(
        "{:<20} {:>9} {:>14}",
        "mix", "exposure", "error (codes)"
    ));
    for relit in relightings {
        line(format!(
            "{:<20} {:>9.3} {:>14.2}",
            relit.name, relit.exposure, relit.max_codes
        ));
    }
    line(String::new());
    line(format!(
        "worst of these and of {} test states against f32: {:.2} display codes ({}), {:.2} as shown",
        Mixed::all().count() + Solo::ALL.len() * solution.lights.len(),
        error.all.packed,
        error.worst_state,
        error.all.shown,
    ));
    text
}
