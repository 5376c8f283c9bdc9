//! What a scene file says, before it is made legal: materials, outlines and light entries by name.

use std::path::Path;
use std::sync::Arc;

use glam::{Vec2, Vec3};
use relume::color::Rgb;
use relume::scene::Source;

use super::error::ImportError;
use crate::texture::Image;

/// Reflectance of faces that no material describes.
pub(super) const DEFAULT_REFLECTANCE: f32 = 0.5;

/// Most polygons of one scene: ten million, a few gigabytes while they are sorted out.
pub(super) const MAX_POLYGONS: usize = 10_000_000;

/// How a surface reflects and emits.
#[derive(Clone, Debug)]
pub(super) struct Material {
    /// Reflectance, or the factor on the texture; legal, but possibly above one.
    pub reflectance: Rgb,
    /// Image of the reflectance.
    pub texture: Option<Arc<Image>>,
    /// True when the back reflects as well.
    pub two_sided: bool,
    /// What the front emits.
    pub glow: Option<Glow>,
}

/// The emission of a material.
#[derive(Clone, Debug)]
pub(super) struct Glow {
    /// Name of the light.
    pub light: String,
    /// Exitance in W/m2.
    pub exitance: Rgb,
}

impl Material {
    /// Stands in where a file names no material.
    pub fn unknown(two_sided: bool) -> Self {
        Self {
            reflectance: Rgb::splat(DEFAULT_REFLECTANCE),
            texture: None,
            two_sided,
            glow: None,
        }
    }
}

/// A polygon as the file has it: any number of finite vertices, in any shape.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Outline {
    /// Number of its material.
    pub material: usize,
    /// The vertices in the file's order.
    pub vertices: Vec<Vec3>,
    /// Texture coordinates of the vertices (`v` from the top); empty without a texture.
    pub uv: Vec<Vec2>,
}

/// Largest coordinate of a vertex: up to here, squares of areas stay finite in `f32`.
const FARTHEST: f32 = 1e8;

/// Refuses vertices so far away that areas would overflow.
pub(super) fn check_reach<'a>(vertices: impl IntoIterator<Item = &'a Vec3>) -> Result<(), String> {
    let far = |vertex: &&Vec3| vertex.abs().max_element() > FARTHEST;
    match vertices.into_iter().find(far) {
        None => Ok(()),
        Some(Vec3 { x, y, z }) => Err(format!(
            "vertex ({x:e}, {y:e}, {z:e}) is too far away; scale the scene down to coordinates of at \
             most {FARTHEST:e}"
        )),
    }
}

/// One luminaire, or all surfaces of one material: what a light group is made of.
#[derive(Clone, Debug)]
pub(super) struct Entry {
    /// Name of the light that it belongs to.
    pub name: String,
    /// What it emits, in the unit of its kind.
    pub emission: Rgb,
    /// Weight in the choice of the next shooter.
    pub importance: f32,
    /// What emits.
    pub emitter: Emitter,
}

/// What emits.
#[derive(Clone, Copy, Debug)]
pub(super) enum Emitter {
    /// The surfaces of a material.
    Material(usize),
    /// A light without a surface.
    Source(Source),
}

/// New settings for a light that the scene has already.
#[derive(Clone, Debug)]
pub(super) struct Replacement {
    /// Name of the light.
    pub name: String,
    /// Its nominal emission from now on.
    pub emission: Option<Rgb>,
    /// Its importance from now on.
    pub importance: Option<f32>,
}

/// Everything that was read.
#[derive(Debug, Default)]
pub(super) struct Draft {
    /// The materials.
    pub materials: Vec<Material>,
    /// The polygons in file order.
    pub outlines: Vec<Outline>,
    /// What emits, in the order in which lights are numbered.
    pub entries: Vec<Entry>,
    /// Changed lights.
    pub replacements: Vec<Replacement>,
}

impl Draft {
    /// Takes a material and returns its number.
    pub fn add_material(&mut self, material: Material) -> usize {
        self.materials.push(material);
        self.materials.len() - 1
    }

    /// Takes a polygon of the file at `path`.
    pub fn add_outline(&mut self, path: &Path, outline: Outline) -> Result<(), ImportError> {
        if self.outlines.len() == MAX_POLYGONS {
            return Err(ImportError::TooManyPolygons {
                path: path.to_owned(),
            });
        }
        self.outlines.push(outline);
        Ok(())
    }

    /// Makes an entry of every emissive material that a polygon uses, before all other entries
    /// and in the order of the polygons.
    pub fn find_area_lights(&mut self) {
        let mut seen = vec![false; self.materials.len()];
        let mut entries = Vec::new();
        for outline in &self.outlines {
            let Some(seen) = seen.get_mut(outline.material) else {
                continue;
            };
            if std::mem::replace(seen, true) {
                continue;
            }
            let material = self.materials.get(outline.material);
            if let Some(glow) = material.and_then(|material| material.glow.as_ref()) {
                entries.push(Entry {
                    name: glow.light.clone(),
                    emission: glow.exitance,
                    importance: 1.0,
                    emitter: Emitter::Material(outline.material),
                });
            }
        }
        entries.append(&mut self.entries);
        self.entries = entries;
    }
}

/// The exitance of a radiance: `M = pi L`. Zero emits nothing.
pub(super) fn exitance(key: &str, radiance: [f32; 3]) -> Result<Option<Rgb>, String> {
    let radiance = legal_rgb(key, radiance)?;
    Ok((radiance.max_channel() > 0.0).then_some(radiance * std::f32::consts::PI))
}

/// A file's numbers, refused when a channel is negative or not finite.
pub(super) fn legal_rgb(key: &str, [r, g, b]: [f32; 3]) -> Result<Rgb, String> {
    let value = Rgb::new(r, g, b);
    if value.is_legal() {
        return Ok(value);
    }
    Err(format!(
        "{key} ({r}, {g}, {b}) is negative or not a number; give three values of zero or more"
    ))
}
