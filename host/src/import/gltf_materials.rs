//! The materials of a glTF file.
//!
//! The reflectance is the base colour, factor times texture; metallic factors are ignored (with a
//! count), and so are alpha, roughness and every other property. `doubleSided` says whether the
//! back reflects. The emitted radiance is emissive factor times strength
//! (KHR_materials_emissive_strength), times the mean of the emissive texture if there is one.
//!
//! KHR_texture_transform: `uv' = offset + R (scale uv)`, where `R` turns by `rotation` from u
//! towards negative v: `u' = u cos + v sin`, `v' = v cos - u sin`.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use ::gltf::json::{self, Index, Root};
use glam::Vec2;
use relume::color::Rgb;

use super::draft::{Draft, Glow, Material, exitance, legal_rgb};
use super::error::ImportError;
use super::gltf_data::Data;
use super::repairs::Repairs;
use crate::texture::Image;

/// The materials that were met, and the images that they share.
#[derive(Debug, Default)]
pub(super) struct Materials {
    described: HashMap<Option<usize>, Described>,
    images: HashMap<usize, Option<Arc<Image>>>,
}

/// A material of the draft.
#[derive(Clone, Copy, Debug)]
pub(super) struct Described {
    /// Its number in the draft.
    pub number: usize,
    /// How its texture is placed.
    pub placement: Option<Placement>,
}

/// Which texture coordinates a texture takes, and how it transforms them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placement {
    /// Number of the `TEXCOORD` attribute.
    pub set: u32,
    offset: Vec2,
    rotation: Vec2,
    scale: Vec2,
}

impl Placement {
    fn new(info: &json::texture::Info) -> Self {
        let extensions = info.extensions.as_ref();
        let transform = extensions
            .and_then(|e| e.texture_transform.clone())
            .unwrap_or_default();
        Self {
            set: transform.tex_coord.unwrap_or(info.tex_coord),
            offset: transform.offset.0.into(),
            rotation: Vec2::from_angle(transform.rotation.0),
            scale: transform.scale.0.into(),
        }
    }

    /// The place in the image; `None` when it is not finite.
    pub fn apply(&self, uv: [f32; 2]) -> Option<Vec2> {
        let scaled = Vec2::from(uv) * self.scale;
        let Vec2 { x: cos, y: sin } = self.rotation;
        let turned = Vec2::new(
            scaled.x * cos + scaled.y * sin,
            scaled.y * cos - scaled.x * sin,
        );
        let place = self.offset + turned;
        place.is_finite().then_some(place)
    }
}

impl Materials {
    /// The material of a primitive, described when it is first met.
    ///
    /// # Errors
    /// A material that does not exist or has negative values.
    pub fn get(
        &mut self,
        path: &Path,
        data: &Data,
        root: &Root,
        index: Option<Index<json::Material>>,
        draft: &mut Draft,
        repairs: &mut Repairs,
    ) -> Result<Described, ImportError> {
        let key = index.map(|index| index.value());
        if let Some(described) = self.described.get(&key) {
            return Ok(*described);
        }
        let (material, placement) = match index {
            None => (Material::unknown(false), None),
            Some(index) => {
                let number = index.value();
                let source = root.get(index);
                let name = source
                    .and_then(|material| material.name.as_deref())
                    .unwrap_or_default();
                let fault = |fault: String| {
                    ImportError::part(path, format_args!("material {number} ({name:?})"), fault)
                };
                let missing = || "does not exist; export the file again".to_owned();
                let source = source.ok_or_else(missing).map_err(fault)?;
                self.describe(data, root, source, number, repairs)
                    .map_err(fault)?
            }
        };
        let described = Described {
            number: draft.add_material(material),
            placement,
        };
        self.described.insert(key, described);
        Ok(described)
    }

    fn describe(
        &mut self,
        data: &Data,
        root: &Root,
        source: &json::Material,
        number: usize,
        repairs: &mut Repairs,
    ) -> Result<(Material, Option<Placement>), String> {
        let pbr = &source.pbr_metallic_roughness;
        if pbr.metallic_factor.0 > 0.0 {
            repairs.ignored_metallic += 1;
        }
        let [r, g, b, _] = pbr.base_color_factor.0;
        let mut material = Material {
            reflectance: legal_rgb("baseColorFactor", [r, g, b])?,
            texture: None,
            two_sided: source.double_sided,
            glow: None,
        };
        let mut placement = None;
        if let Some(info) = &pbr.base_color_texture {
            material.texture = self.image(data, root, info, repairs);
            if material.texture.is_some() {
                repairs.textures_used += 1;
                placement = Some(Placement::new(info));
            }
        }

        let extensions = source.extensions.as_ref();
        let strength = extensions.and_then(|e| e.emissive_strength.as_ref());
        let strength = strength.map_or(1.0, |strength| strength.emissive_strength.0);
        let factor = source.emissive_factor.0.map(|channel| channel * strength);
        if let Some(exitance) = exitance("emissiveFactor times emissiveStrength", factor)? {
            let mean = self.emissive_mean(data, root, source, repairs);
            let exitance = exitance * mean;
            material.glow = (exitance.max_channel() > 0.0).then(|| Glow {
                light: light_name(source, number),
                exitance,
            });
        }
        Ok((material, placement))
    }

    /// Mean of the emissive texture; white without one.
    fn emissive_mean(
        &mut self,
        data: &Data,
        root: &Root,
        source: &json::Material,
        repairs: &mut Repairs,
    ) -> Rgb {
        let info = source.emissive_texture.as_ref();
        let Some(image) = info.and_then(|info| self.image(data, root, info, repairs)) else {
            return Rgb::WHITE;
        };
        repairs.averaged_emissive_textures += 1;
        image.mean()
    }

    /// The image of a texture; `None`, with a count, when it is missing or damaged.
    fn image(
        &mut self,
        data: &Data,
        root: &Root,
        info: &json::texture::Info,
        repairs: &mut Repairs,
    ) -> Option<Arc<Image>> {
        let image = root.get(info.index).and_then(|texture| {
            let decode = || data.image(texture.source).map(Arc::new);
            self.images
                .entry(texture.source.value())
                .or_insert_with(decode)
                .clone()
        });
        repairs.missing_textures += usize::from(image.is_none());
        image
    }
}

/// Name of the light that an emissive material is.
fn light_name(material: &json::Material, number: usize) -> String {
    let name = material.name.clone().filter(|name| !name.is_empty());
    name.unwrap_or_else(|| format!("light_material_{number}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texture_transforms_follow_the_extension_s_example() {
        // "Only the lower left quadrant of the source image, rotated clockwise 90 degrees."
        let text = r#"{"index":0,"texCoord":1,"extensions":{"KHR_texture_transform":
            {"offset":[0,1],"rotation":1.5707963267948966,"scale":[0.5,0.5]}}}"#;
        let info: json::texture::Info = serde_json::from_str(text).unwrap();
        let placement = Placement::new(&info);
        assert_eq!(placement.set, 1);
        for (uv, expected) in [
            ([0.0, 0.0], [0.0, 1.0]),
            ([1.0, 0.0], [0.0, 0.5]),
            ([0.0, 1.0], [0.5, 1.0]),
            ([1.0, 1.0], [0.5, 0.5]),
        ] {
            let place = placement.apply(uv).unwrap();
            assert!(
                place.distance(Vec2::from(expected)) < 1e-6,
                "{uv:?} {place}"
            );
        }
        assert!(placement.apply([f32::NAN, 0.0]).is_none());
    }
}
