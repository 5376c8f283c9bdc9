//! `relume relight`.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::Args;
use glam::Vec3;
use relume::color::Rgb;
use relume::geometry::Polygon;
use serde_json::{Value, json};

use super::load::{Loaded, load};
use super::{Outcome, keep, output_path, tell, write_file};
use crate::export::exr;
use crate::mesh::OwnedMesh;
use crate::mix::{Setting, mix};
use crate::picture::{self, Exposure, LinearImage, to_pixmap};
use crate::preview::{Camera, CameraError, Gathered, Relit, Viewpoint, render, show};
use crate::probe::{Gatherer, MOST_RAYS};
use crate::solution::SolutionLight;

/// Rays that gather at a pixel by default.
const RAYS: u32 = 256;

/// Behind everything.
pub const BACKGROUND: [u8; 3] = [0, 0, 0];

#[derive(Debug, Args)]
pub struct Arguments {
    /// A solution or an atlas
    input: PathBuf,
    /// Set a light: 0.5 (of nominal), #ffcc88, 2x#ffcc88, or r,g,b; unset ones stay nominal
    #[arg(long, value_name = "LIGHT=VALUE", allow_hyphen_values = true)]
    set: Vec<Setting>,
    /// The same, but all other lights are off
    #[arg(long, value_name = "LIGHT=VALUE", allow_hyphen_values = true)]
    only: Vec<Setting>,
    /// Where the picture goes: .png, or .exr (linear, unexposed); `-` is stdout, as PNG
    /// [default: the input's name .png, here]
    #[arg(short, long, value_name = "OUT.png|OUT.exr")]
    output: Option<PathBuf>,
    #[command(flatten)]
    camera: CameraArguments,
    /// Width and height in pixels
    #[arg(long, value_name = "WxH", default_value = "640x480", value_parser = size)]
    size: (u32, u32),
    /// Factor on radiance, or `auto`: the 98th percentile of luminance becomes white
    #[arg(long, default_value = "auto", value_name = "auto|VALUE")]
    exposure: Exposure,
    /// Evaluate direct light exactly at every pixel and gather the indirect there, by rays alone: better
    /// than the mesh (of a solution only)
    #[arg(long)]
    gather: bool,
    /// Rays that gather at each pixel: more for less grain
    #[arg(long, value_name = "N", requires = "gather", default_value_t = RAYS, value_parser = clap::value_parser!(u32).range(1..=MOST_RAYS))]
    rays: u32,
}

/// Where the picture is taken from; without any of it, the program chooses.
#[derive(Debug, Args)]
struct CameraArguments {
    /// Camera file (TOML: eye, target, up, fov)
    #[arg(long, value_name = "FILE.toml", conflicts_with_all = ["eye", "target", "up", "fov"])]
    camera: Option<PathBuf>,
    /// Where the camera stands
    #[arg(long, value_name = "X,Y,Z", value_parser = vector, allow_hyphen_values = true)]
    eye: Option<Vec3>,
    /// What it looks at
    #[arg(long, value_name = "X,Y,Z", value_parser = vector, allow_hyphen_values = true)]
    target: Option<Vec3>,
    /// What is up, also for what the program chooses [default: 0,1,0]
    #[arg(long, value_name = "X,Y,Z", value_parser = vector, allow_hyphen_values = true)]
    up: Option<Vec3>,
    /// Vertical field of view in radians
    #[arg(long, value_name = "RADIANS", allow_hyphen_values = true)]
    fov: Option<f32>,
}

fn vector(text: &str) -> Result<Vec3, String> {
    let numbers: Result<Vec<f32>, _> = text.split(',').map(|n| n.trim().parse()).collect();
    match numbers.as_deref() {
        Ok(&[x, y, z]) => Ok(Vec3::new(x, y, z)),
        _ => Err("three numbers, as 1,2.5,-3".to_owned()),
    }
}

fn size(text: &str) -> Result<(u32, u32), String> {
    let sides = text.split_once('x');
    let parsed = sides.and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
    parsed.ok_or_else(|| "width and height, as 640x480".to_owned())
}

impl CameraArguments {
    const fn is_given(&self) -> bool {
        self.camera.is_some()
            || self.eye.is_some()
            || self.target.is_some()
            || self.up.is_some()
            || self.fov.is_some()
    }

    fn viewpoint(&self, loaded: &Loaded, aspect: f32) -> Result<Viewpoint> {
        if let Some(file) = &self.camera {
            return Ok(Viewpoint::from_toml_file(file)?);
        }
        let solution = loaded.solution();
        let faces = solution.mesh.faces.iter();
        let lit = faces.filter(|face| face.element_count > 0);
        let lit: Vec<Polygon> = lit.map(|face| face.polygon).collect();
        let surfaces = &solution.surfaces;
        let shown = if lit.is_empty() { surfaces } else { &lit };
        let up = self.up.unwrap_or(Vec3::Y);
        let chosen = Viewpoint::fit(shown, surfaces, up, aspect);
        let chosen = chosen.context("the scene has no surfaces to look at")?;
        Ok(Viewpoint {
            eye: self.eye.unwrap_or(chosen.eye),
            target: self.target.unwrap_or(chosen.target),
            up: self.up.unwrap_or(chosen.up),
            fov: self.fov.unwrap_or(chosen.fov),
        })
    }

    /// The error with what it is about.
    fn named(&self, error: CameraError) -> anyhow::Error {
        let origin = match (&error, &self.camera) {
            (CameraError::Size(..), _) => "--size".to_owned(),
            (_, Some(file)) => file.display().to_string(),
            (_, None) => "camera".to_owned(),
        };
        anyhow::Error::new(error).context(origin)
    }
}

pub fn run(arguments: &Arguments, json: bool) -> Result<Outcome> {
    let path = arguments.input.display().to_string();
    let output = output_path(arguments.output.as_deref(), &arguments.input, "png", json);
    if let Some(file) = &arguments.camera.camera {
        keep(file, &output);
    }
    let is_exr = has_extension(&output, "exr");
    if !is_exr && !has_extension(&output, "png") && output != Path::new("-") {
        bail!(
            "{}: a picture ends in .png or .exr; name it so",
            output.display()
        );
    }
    let loaded = load(&arguments.input)?;
    let solution = loaded.solution();
    if let Some(size) = solution.image {
        return relight_picture(arguments, &loaded, size, &output, is_exr);
    }
    if solution.mesh.faces.is_empty() {
        bail!("{path}: it carries no mesh to draw; pack it without --no-mesh");
    }
    let mix = mix(&solution.lights, &arguments.only, &arguments.set).context(path)?;
    let values = loaded.relight(&mix)?;
    let exitance = solution.face_exitance(&mix);
    let mesh = shown_mesh(&loaded);
    let gatherer = if arguments.gather {
        Some(Gatherer::new(
            loaded.to_gather(&arguments.input)?,
            arguments.rays,
        ))
    } else {
        None
    };
    let relit = Relit {
        mesh: mesh.view(),
        surfaces: &solution.surfaces,
        irradiance: &values,
        exitance: &exitance,
        gathered: gatherer.as_ref().map(|gatherer| Gathered {
            gatherer,
            mix: &mix,
        }),
    };
    let (width, height) = arguments.size;
    let aspect = width as f32 / height as f32;
    let viewpoint = arguments.camera.viewpoint(&loaded, aspect)?;
    let camera = Camera::new(viewpoint, width, height);
    let camera = camera.map_err(|error| arguments.camera.named(error))?;

    let (bytes, exposure) = if is_exr {
        (
            exr::encode_rgb(&render(&relit, &camera, f32::INFINITY)?)?,
            None,
        )
    } else {
        let (pixmap, factor) = show(&relit, &camera, arguments.exposure, BACKGROUND)?;
        (picture::encode_png(&pixmap)?, Some(factor))
    };
    let picture = Picture {
        size: [width, height],
        exposure,
        bytes,
    };
    let mut report = picture.write(&output, &solution.lights, &mix)?;
    report["camera"] = json!({
        "eye": viewpoint.eye.to_array(),
        "target": viewpoint.target.to_array(),
        "up": viewpoint.up.to_array(),
        "fov": viewpoint.fov,
    });
    Ok(Outcome::done(report))
}

/// A picture as it is written.
struct Picture {
    size: [u32; 2],
    /// `None` for linear light.
    exposure: Option<f32>,
    bytes: Vec<u8>,
}

impl Picture {
    /// Writes it, and reports what it shows.
    fn write(&self, output: &Path, lights: &[SolutionLight], mix: &[Rgb]) -> Result<Value> {
        write_file(output, &self.bytes)?;
        let [width, height] = self.size;
        let exposed = self.exposure;
        let exposed = exposed.map_or("linear, unexposed".to_owned(), |e| format!("exposure {e}"));
        tell!("{}: {width}x{height}, {exposed}", output.display());
        Ok(json!({
            "file": output.display().to_string(),
            "width": width,
            "height": height,
            "exposure": self.exposure,
            "mix": lights.iter().zip(mix).map(|(light, weight)| {
                json!({"name": light.name, "weight": weight.to_array()})
            }).collect::<Vec<_>>(),
        }))
    }
}

/// A picture whose pixels are the elements: there is nothing to look for with a camera.
fn relight_picture(
    arguments: &Arguments,
    loaded: &Loaded,
    [width, height]: [u32; 2],
    output: &Path,
    is_exr: bool,
) -> Result<Outcome> {
    let path = arguments.input.display().to_string();
    if arguments.camera.is_given() {
        bail!("{path}: it is a picture, seen from where it was taken; leave out the camera");
    }
    let lights = &loaded.solution().lights;
    let mix = mix(lights, &arguments.only, &arguments.set).context(path)?;
    let pixels = loaded.relight(&mix)?;
    let image = LinearImage {
        width,
        height,
        pixels: pixels.iter().map(|v| [v.r, v.g, v.b, 1.0]).collect(),
    };
    let (bytes, exposure) = if is_exr {
        (exr::encode_rgb(&image)?, None)
    } else {
        let factor = arguments.exposure.factor(&image);
        let pixmap = to_pixmap(&image, factor, BACKGROUND)?;
        (picture::encode_png(&pixmap)?, Some(factor))
    };
    let picture = Picture {
        size: [width, height],
        exposure,
        bytes,
    };
    Ok(Outcome::done(picture.write(output, lights, &mix)?))
}

fn has_extension(path: &Path, extension: &str) -> bool {
    path.extension()
        .is_some_and(|found| found.eq_ignore_ascii_case(extension))
}

/// The mesh as it is drawn: where the values are radiosity, nothing is left to reflect.
fn shown_mesh(loaded: &Loaded) -> OwnedMesh {
    let mut mesh = loaded.solution().mesh.clone();
    if loaded.is_radiosity() {
        for element in &mut mesh.elements {
            element.reflectance = Rgb::WHITE;
        }
    }
    mesh
}
