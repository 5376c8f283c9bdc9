//! Builds the scene from a draft whose polygons are legal: tags, shares, reflectances.
//!
//! Entries of one name share a tag. The nominal emission of the tag is `e = max_i e_i`, channel by
//! channel, and entry `i` emits the share `e_i / e` at mix 1 (0 where `e` is 0), so that relative
//! strengths inside a group stay; a lone entry emits one unit per channel. The importance of a
//! group is the largest of its entries.

use std::collections::HashMap;
use std::path::Path;

use glam::Vec2;
use relume::color::Rgb;
use relume::scene::{Emission, Luminaire, Surface, SurfaceError};

use super::draft::{Draft, Emitter, Entry, Material, Outline, Replacement};
use super::error::ImportError;
use super::repairs::Repairs;
use crate::scene::{Light, OwnedScene};
use crate::texture::{SurfaceTexture, clamp_reflectance};

/// Most lights of a scene: tags are stored in 16 bits.
pub(super) const MAX_LIGHTS: usize = 65_535;

/// Longest name of a light, in bytes: atlases store lengths in 16 bits.
const MAX_NAME: usize = 65_535;

/// The scene of a draft; `path` is the file that errors name.
pub(super) fn assemble(
    path: &Path,
    draft: Draft,
    repairs: &mut Repairs,
) -> Result<OwnedScene, ImportError> {
    let groups = Groups::new(&draft.entries);
    if groups.lights.len() > MAX_LIGHTS {
        return Err(ImportError::TooManyLights {
            path: path.to_owned(),
            lights: groups.lights.len(),
        });
    }

    if let Some(light) = groups.lights.iter().find(|l| l.name.len() > MAX_NAME) {
        let start: String = light.name.chars().take(20).collect();
        let length = light.name.len();
        return Err(ImportError::part(
            path,
            format_args!("light \"{}...\"", start.escape_debug()),
            format_args!("a name of {length} bytes; shorten it to at most {MAX_NAME}"),
        ));
    }

    let mut luminaires = Vec::new();
    let mut emissions: Vec<Option<Emission>> = vec![None; draft.materials.len()];
    for entry in &draft.entries {
        let Some(emission) = groups.emission(entry) else {
            continue;
        };
        match entry.emitter {
            Emitter::Material(material) => {
                if let Some(slot) = emissions.get_mut(material) {
                    *slot = Some(emission);
                }
            }
            Emitter::Source(source) => luminaires.push(
                Luminaire::new(emission.light, emission.share, source).map_err(|fault| {
                    ImportError::part(path, format_args!("light {:?}", entry.name), fault)
                })?,
            ),
        }
    }

    let means = texture_means(&draft.materials);
    let mut surfaces = Vec::with_capacity(draft.outlines.len());
    let mut textures = Vec::with_capacity(draft.outlines.len());
    for (outline, index) in draft.outlines.into_iter().zip(0..) {
        let number = outline.material;
        let Some(material) = draft.materials.get(number) else {
            continue;
        };
        let mean = means.get(number).copied().unwrap_or_default();
        let emission = emissions.get(number).copied().flatten();
        let (surface, texture) = surface(index, outline, material, mean, emission, repairs)
            .map_err(|fault| ImportError::file(path, fault))?;
        surfaces.push(surface);
        textures.push(texture);
    }
    Ok(OwnedScene {
        surfaces,
        textures,
        luminaires,
        lights: groups.into_lights(draft.replacements),
    })
}

/// Mean of each material's whole image, for faces that do not say where they lie in it.
fn texture_means(materials: &[Material]) -> Vec<Rgb> {
    let mean = |material: &Material| material.texture.as_ref().map(|image| image.mean());
    materials
        .iter()
        .map(|material| mean(material).unwrap_or(Rgb::WHITE))
        .collect()
}

fn surface(
    index: u32,
    outline: Outline,
    material: &Material,
    image_mean: Rgb,
    emission: Option<Emission>,
    repairs: &mut Repairs,
) -> Result<(Surface, Option<SurfaceTexture>), SurfaceError> {
    let has_places = outline.uv.len() == outline.vertices.len();
    let texture = material
        .texture
        .as_ref()
        .filter(|_| has_places)
        .map(|image| SurfaceTexture {
            image: image.clone(),
            factor: material.reflectance.to_array(),
            corners: outline.uv,
        });
    if material.texture.is_some() && !has_places {
        repairs.missing_texture_coordinates += 1;
    }
    let whole = |texture: &SurfaceTexture| texture.unclamped_mean_over(Vec2::ZERO, Vec2::ONE);
    let reflectance = texture
        .as_ref()
        .map_or_else(|| material.reflectance * image_mean, whole);
    let clamped = clamp_reflectance(reflectance);
    if clamped != reflectance {
        repairs.clamped_reflectances += 1;
    }

    let mut surface = Surface::new(index, &outline.vertices, clamped)?;
    if material.two_sided {
        surface = surface.two_sided();
    }
    if let Some(emission) = emission {
        surface = surface.emitting(index, emission)?;
    }
    Ok((surface, texture))
}

/// Light entries by name.
struct Groups {
    lights: Vec<Light>,
    entries: Vec<usize>,
    tags: HashMap<String, usize>,
}

impl Groups {
    /// Tags in the order in which names first appear.
    fn new(entries: &[Entry]) -> Self {
        let mut groups = Self {
            lights: Vec::new(),
            entries: Vec::new(),
            tags: HashMap::new(),
        };
        for entry in entries {
            let tag = *groups
                .tags
                .entry(entry.name.clone())
                .or_insert(groups.lights.len());
            if let (Some(light), Some(count)) =
                (groups.lights.get_mut(tag), groups.entries.get_mut(tag))
            {
                light.emission = light.emission.max(entry.emission);
                light.importance = light.importance.max(entry.importance);
                *count += 1;
            } else {
                groups.lights.push(Light {
                    name: entry.name.clone(),
                    emission: entry.emission,
                    importance: entry.importance,
                });
                groups.entries.push(1);
            }
        }
        groups
    }

    /// The tag of an entry and what it emits at unit emission of the tag.
    fn emission(&self, entry: &Entry) -> Option<Emission> {
        let tag = *self.tags.get(&entry.name)?;
        let nominal = self.lights.get(tag)?.emission;
        let is_alone = self.entries.get(tag) == Some(&1);
        let ratio = |part: f32, whole: f32| if whole > 0.0 { part / whole } else { 0.0 };
        let [r, g, b] = entry.emission.to_array();
        let share = if is_alone {
            Rgb::WHITE
        } else {
            Rgb::new(
                ratio(r, nominal.r),
                ratio(g, nominal.g),
                ratio(b, nominal.b),
            )
        };
        Some(Emission {
            light: u32::try_from(tag).ok()?,
            share,
        })
    }

    /// The lights, with replaced settings.
    fn into_lights(mut self, replacements: Vec<Replacement>) -> Vec<Light> {
        for replacement in replacements {
            let tag = self.tags.get(&replacement.name).copied();
            if let Some(light) = tag.and_then(|tag| self.lights.get_mut(tag)) {
                light.emission = replacement.emission.unwrap_or(light.emission);
                light.importance = replacement.importance.unwrap_or(light.importance);
            }
        }
        self.lights
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::draft::Glow;
    use crate::texture::Image;
    use glam::Vec3;
    use relume::scene::Source;
    use std::sync::Arc;

    fn lamp(name: &str, emission: [f32; 3]) -> Entry {
        Entry {
            name: name.to_owned(),
            emission: Rgb::from_array(emission),
            importance: 1.0,
            emitter: Emitter::Source(Source::Sky),
        }
    }

    fn triangle(material: usize) -> Outline {
        Outline {
            material,
            vertices: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            uv: Vec::new(),
        }
    }

    #[test]
    fn groups_keep_relative_strengths_and_a_lone_light_is_white() {
        let mut bank = lamp("bank", [1.0, 4.0, 0.0]);
        bank.importance = 0.5;
        let draft = Draft {
            entries: vec![
                lamp("bank", [2.0, 1.0, 0.0]),
                lamp("red", [3.0, 0.0, 0.0]),
                bank,
            ],
            replacements: vec![Replacement {
                name: "red".to_owned(),
                emission: Some(Rgb::BLACK),
                importance: Some(0.25),
            }],
            ..Draft::default()
        };
        let scene = assemble(Path::new("x"), draft, &mut Repairs::default()).unwrap();
        let shares: Vec<_> = scene
            .luminaires
            .iter()
            .map(|l| (l.light(), l.share().to_array()))
            .collect();
        let expected = [(0, [1.0, 0.25, 0.0]), (1, [1.0; 3]), (0, [0.5, 1.0, 0.0])];
        assert_eq!(shares, expected);
        let lights: Vec<_> = scene
            .lights
            .iter()
            .map(|l| (l.name.as_str(), l.emission.to_array(), l.importance))
            .collect();
        assert_eq!(
            lights,
            [("bank", [2.0, 4.0, 0.0], 1.0), ("red", [0.0; 3], 0.25)]
        );
    }

    #[test]
    fn surfaces_of_one_material_are_one_light() {
        let glow = Glow {
            light: "tube".to_owned(),
            exitance: Rgb::new(5.0, 0.0, 1.0),
        };
        let mut draft = Draft::default();
        draft.add_material(Material::unknown(true));
        draft.add_material(Material {
            glow: Some(glow),
            ..Material::unknown(false)
        });
        draft.outlines = vec![triangle(0), triangle(1), triangle(1)];
        draft.find_area_lights();
        let scene = assemble(Path::new("x"), draft, &mut Repairs::default()).unwrap();
        assert_eq!(scene.lights.len(), 1);
        let emitting = scene.surfaces[1].emission().unwrap();
        assert_eq!((emitting.light, emitting.share), (0, Rgb::WHITE));
        assert_eq!(scene.surfaces[2].emission(), Some(emitting));
        assert_eq!(scene.surfaces[0].emission(), None);
        assert!(scene.surfaces[0].is_two_sided() && !scene.surfaces[1].is_two_sided());
        assert!(scene.view().is_ok());
    }

    #[test]
    fn textures_give_the_mean_and_bright_surfaces_are_clamped() {
        let image = Image {
            width: 2,
            height: 1,
            texels: vec![[0.2; 3], [0.6; 3]],
        };
        let textured = Material {
            reflectance: Rgb::new(1.0, 0.5, 3.0),
            texture: Some(Arc::new(image)),
            ..Material::unknown(true)
        };
        let mut draft = Draft::default();
        draft.add_material(textured);
        let mut placed = triangle(0);
        placed.uv = vec![Vec2::ZERO, Vec2::new(0.5, 0.0), Vec2::new(0.0, 1.0)];
        draft.outlines = vec![placed, triangle(0)];
        let mut repairs = Repairs::default();
        let scene = assemble(Path::new("x"), draft, &mut repairs).unwrap();
        let reflectance = |i: usize| scene.surfaces[i].reflectance().get().to_array();
        let close = |a: [f32; 3], b: [f32; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6);
        assert!(
            close(reflectance(0), [0.2, 0.1, 0.6]),
            "{:?}",
            reflectance(0)
        );
        assert!(
            close(reflectance(1), [0.4, 0.2, 0.98]),
            "{:?}",
            reflectance(1)
        );
        assert!(scene.textures[0].is_some() && scene.textures[1].is_none());
        assert_eq!(
            (
                repairs.clamped_reflectances,
                repairs.missing_texture_coordinates
            ),
            (1, 1)
        );
    }

    #[test]
    fn too_many_lights_are_refused() {
        let draft = Draft {
            entries: (0..=MAX_LIGHTS)
                .map(|i| lamp(&i.to_string(), [1.0; 3]))
                .collect(),
            ..Draft::default()
        };
        let error = assemble(Path::new("many"), draft, &mut Repairs::default()).unwrap_err();
        assert!(
            error
                .to_string()
                .starts_with("many: 65536 lights, but at most 65535 fit")
        );
    }

    #[test]
    fn a_name_that_no_atlas_can_hold_is_refused() {
        let named = |length| Draft {
            entries: vec![lamp(&"n".repeat(length), [1.0; 3])],
            ..Draft::default()
        };
        let import = |length| assemble(Path::new("x"), named(length), &mut Repairs::default());
        assert!(import(MAX_NAME).is_ok());
        assert_eq!(
            import(MAX_NAME + 1).unwrap_err().to_string(),
            "x, light \"nnnnnnnnnnnnnnnnnnnn...\": a name of 65536 bytes; shorten it to at most 65535"
        );
    }
}
