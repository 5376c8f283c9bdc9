//! Reads a scene file: glTF 2.0 or OBJ with MTL, and light files in TOML.
//!
//! A reader ([`load`] picks it by the extension) makes a draft of what the file says; the polygons
//! of the draft are made legal; a light file, if there is one, adds and replaces lights; then the
//! scene is assembled. Dirty files are repaired and every repair is counted ([`Repairs`]); what
//! cannot be repaired is one line that names the file, the place and what to do ([`ImportError`]).
//!
//! Conventions: lengths stay in the file's own units; emissive values are radiances, so the nominal
//! exitance is pi times them; punctual lights count 1 cd as 1 W/sr and 1 lx as 1 W/m2. Emission is
//! from the front of a surface only. Surfaces keep the order of the file.

mod assemble;
mod draft;
mod error;
mod gltf;
mod gltf_data;
mod gltf_file;
mod gltf_lights;
mod gltf_materials;
mod lights;
mod obj;
mod obj_materials;
mod obj_text;
mod pairs;
mod polygons;
mod repairs;

use std::path::Path;

pub use error::ImportError;
pub use repairs::Repairs;

use crate::scene::OwnedScene;
use draft::Draft;

/// A scene and what was done to get it.
#[derive(Clone, Debug)]
pub struct Imported {
    /// The scene, ready for [`OwnedScene::view`].
    pub scene: OwnedScene,
    /// Number of polygons that the scene file has, before any repair.
    pub polygons: usize,
    /// What was repaired or left out.
    pub repairs: Repairs,
}

/// Imports a `.gltf`, `.glb` or `.obj` file, and the lights of a TOML file on top of it.
///
/// # Errors
/// [`ImportError`]: one line about the first thing that cannot be repaired.
pub fn load(scene: &Path, lights: Option<&Path>) -> Result<Imported, ImportError> {
    let mut repairs = Repairs::default();
    let mut draft = read(scene, &mut repairs)?;
    let polygons = draft.outlines.len();
    draft::check_reach(draft.outlines.iter().flat_map(|outline| &outline.vertices))
        .map_err(|fault| ImportError::file(scene, fault))?;
    draft.outlines = polygons::legalize(draft.outlines, &draft.materials, &mut repairs)
        .map_err(|fault| ImportError::file(scene, fault))?;
    if draft.outlines.is_empty() {
        return Err(ImportError::Empty {
            path: scene.to_owned(),
        });
    }
    draft.find_area_lights();

    if let Some(lights) = lights {
        lights::apply(lights, &mut draft, &mut repairs)?;
    }
    let scene = assemble::assemble(lights.unwrap_or(scene), draft, &mut repairs)?;
    Ok(Imported {
        scene,
        polygons,
        repairs,
    })
}

/// What the scene file says.
fn read(path: &Path, repairs: &mut Repairs) -> Result<Draft, ImportError> {
    let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
    match extension.to_str() {
        Some("obj") => obj::read(path, repairs),
        Some("gltf" | "glb") => gltf::read(path, repairs),
        _ => Err(ImportError::Kind {
            path: path.to_owned(),
        }),
    }
}
