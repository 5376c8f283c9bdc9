//! Scenes of the exchanged data folder, for tests only: a small OBJ reader of its own, so that
//! these tests do not lean on the importer.

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};

use glam::Vec3;
use relume::color::Rgb;
use relume::scene::{Emission, Surface};

use crate::scene::{Light, OwnedScene};

/// A file or folder of the data folder; `None`, said loudly, when that is not there.
///
/// # Panics
/// On a build server (environment variable `CI`), where it has to be there.
pub(crate) fn data(path: &str) -> Option<PathBuf> {
    let default = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data");
    let folder = std::env::var("RELUME_DATA").unwrap_or_else(|_| default.to_owned());
    let wanted = Path::new(&folder).join(path);
    if wanted.exists() {
        return Some(wanted);
    }
    assert!(
        std::env::var_os("CI").is_none(),
        "{} is missing",
        wanted.display()
    );
    eprintln!("SKIPPED: {} is missing; set RELUME_DATA", wanted.display());
    None
}

struct Material {
    reflectance: Rgb,
    emits: bool,
}

/// Reads `scenes/NAME/scene.obj`; surfaces reflect on both sides.
pub(crate) fn scene(name: &str) -> Option<OwnedScene> {
    let folder = data(&format!("scenes/{name}"))?;
    let materials = materials(&fs::read_to_string(folder.join("scene.mtl")).unwrap());
    let text = fs::read_to_string(folder.join("scene.obj")).unwrap();

    let mut scene = OwnedScene::default();
    let mut vertices = Vec::new();
    let mut material = "";
    for line in text.lines() {
        let (key, rest) = line.split_once(' ').unwrap_or((line, ""));
        match key {
            "v" => vertices.push(Vec3::from_array(numbers(rest))),
            "usemtl" => material = rest,
            "f" => {
                let corners: Vec<Vec3> = rest
                    .split_whitespace()
                    .map(|c| vertices[c.split('/').next().unwrap().parse::<usize>().unwrap() - 1])
                    .collect();
                add_face(&mut scene, &corners, material, &materials[material]);
            }
            _ => {}
        }
    }
    Some(scene)
}

/// Adds a face whole if it is a legal polygon, else as the triangles around its first vertex.
fn add_face(scene: &mut OwnedScene, corners: &[Vec3], name: &str, material: &Material) {
    let whole = Surface::new(0, corners, material.reflectance).map(|s| vec![s]);
    let parts = whole.unwrap_or_else(|_| {
        let fan = corners[1..].windows(2);
        fan.filter_map(|p| Surface::new(0, &[corners[0], p[0], p[1]], material.reflectance).ok())
            .collect()
    });
    for part in parts {
        let mut surface = part.two_sided();
        if material.emits {
            let light = light(scene, name);
            let share = Rgb::WHITE;
            surface = surface.emitting(0, Emission { light, share }).unwrap();
        }
        scene.surfaces.push(surface);
        scene.textures.push(None);
    }
}

/// Tag of a light, which is added if it is new.
pub(crate) fn light(scene: &mut OwnedScene, name: &str) -> u32 {
    let known = scene.lights.iter().position(|l| l.name == name);
    let number = known.unwrap_or_else(|| {
        scene.lights.push(Light {
            name: name.to_owned(),
            emission: Rgb::WHITE,
            importance: 1.0,
        });
        scene.lights.len() - 1
    });
    number as u32
}

fn materials(text: &str) -> HashMap<String, Material> {
    let mut all = HashMap::new();
    let mut name = String::new();
    for line in text.lines() {
        let (key, rest) = line.split_once(' ').unwrap_or((line, ""));
        match key {
            "newmtl" => rest.clone_into(&mut name),
            "Kd" => {
                let reflectance = Rgb::from_array(numbers(rest));
                let emits = false;
                all.insert(name.clone(), Material { reflectance, emits });
            }
            "Ke" => all.get_mut(&name).unwrap().emits = numbers(rest) != [0.0; 3],
            _ => {}
        }
    }
    all
}

fn numbers(text: &str) -> [f32; 3] {
    let values: Vec<f32> = text
        .split_whitespace()
        .map(|v| v.parse().unwrap())
        .collect();
    values.try_into().unwrap()
}
