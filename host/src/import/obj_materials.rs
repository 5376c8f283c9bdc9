//! The materials of MTL files: `Kd` is the reflectance, `Ke` the emitted radiance, both linear.
//!
//! OBJ knows no sides, so every surface reflects on both. A texture (`map_Kd`, sRGB, found beside
//! the MTL file) multiplies `Kd`, which is then white unless given; its options are ignored, and
//! so are, with a count, all other images (`map_Ke`, `bump`). A material without `Kd` and texture has the default reflectance. Where a name is defined twice,
//! the later definition holds.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use relume::color::Rgb;

use super::draft::{DEFAULT_REFLECTANCE, Glow, Material, exitance, legal_rgb};
use super::error::{ImportError, read_named, read_text};
use super::obj_text::plain_mtl;
use super::repairs::Repairs;
use crate::texture::Image;

/// The materials of a scene, by name.
#[derive(Debug, Default)]
pub(super) struct Library {
    materials: HashMap<String, Material>,
    /// What the OBJ parser wants to see, by the name of the material file.
    parsed: HashMap<PathBuf, Vec<tobj::Material>>,
    images: HashMap<PathBuf, Option<Arc<Image>>>,
}

impl Library {
    /// Reads the files that `mtllib` statements of the OBJ file at `scene` name.
    ///
    /// A statement names one file, whose name may hold spaces, or several.
    ///
    /// # Errors
    /// A file that exists but is wrong.
    pub fn load(
        scene: &Path,
        names: &[String],
        repairs: &mut Repairs,
    ) -> Result<Self, ImportError> {
        let mut library = Self::default();
        let folder = scene.parent().unwrap_or(Path::new(""));
        for name in names {
            let whole = folder.join(portable(name));
            let paths = if whole.is_file() {
                vec![whole]
            } else {
                name.split_whitespace()
                    .map(|name| folder.join(portable(name)))
                    .collect()
            };
            let mut parsed = Vec::new();
            for path in paths {
                if path.is_file() {
                    parsed.append(&mut library.add_file(&path, repairs)?);
                } else {
                    repairs.missing_material_files += 1;
                }
            }
            library.parsed.insert(PathBuf::from(name), parsed);
        }
        Ok(library)
    }

    /// What the OBJ parser's loader returns for a name.
    pub fn parsed(&self, name: &Path) -> tobj::MTLLoadResult {
        let materials = self
            .parsed
            .get(name)
            .cloned()
            .ok_or(tobj::LoadError::OpenFileFailed)?;
        let numbers = materials
            .iter()
            .map(|material| material.name.clone())
            .zip(0..)
            .collect();
        Ok((materials, numbers))
    }

    /// A material by name.
    pub fn get(&self, name: &str) -> Option<&Material> {
        self.materials.get(name)
    }

    fn add_file(
        &mut self,
        path: &Path,
        repairs: &mut Repairs,
    ) -> Result<Vec<tobj::Material>, ImportError> {
        let (plain, ignored) = plain_mtl(&read_text(path)?)
            .map_err(|(line, fault)| ImportError::line(path, line, fault))?;
        repairs.ignored_textures += ignored;
        let (parsed, _) = tobj::load_mtl_buf(&mut plain.as_bytes())
            .map_err(|error| ImportError::file(path, error))?;
        for material in &parsed {
            let described = self.describe(path, material, repairs).map_err(|fault| {
                ImportError::part(path, format_args!("material {:?}", material.name), fault)
            })?;
            self.materials.insert(material.name.clone(), described);
        }
        Ok(parsed)
    }

    fn describe(
        &mut self,
        path: &Path,
        material: &tobj::Material,
        repairs: &mut Repairs,
    ) -> Result<Material, String> {
        let reflectance = material
            .diffuse
            .map(|diffuse| legal_rgb("Kd", diffuse))
            .transpose()?;
        let texture = material.diffuse_texture.as_deref();
        let texture = texture.and_then(|statement| self.image(path, statement, repairs));
        let plain = if texture.is_some() {
            1.0
        } else {
            DEFAULT_REFLECTANCE
        };
        let radiance = material.emissive.unwrap_or_default();
        Ok(Material {
            reflectance: reflectance.unwrap_or(Rgb::splat(plain)),
            texture,
            two_sided: true,
            glow: exitance("Ke", radiance)?.map(|exitance| Glow {
                light: material.name.clone(),
                exitance,
            }),
        })
    }

    /// The image of a `map_Kd` statement; `None` when it cannot be had.
    fn image(
        &mut self,
        library: &Path,
        statement: &str,
        repairs: &mut Repairs,
    ) -> Option<Arc<Image>> {
        let name = file_name(statement);
        if name != statement {
            repairs.ignored_texture_options += 1;
        }
        let path = library
            .parent()
            .unwrap_or(Path::new(""))
            .join(portable(name));
        let image = self.images.entry(path).or_insert_with_key(|path| {
            let bytes = read_named(path).ok()?;
            Image::decode(&bytes).ok().map(Arc::new)
        });
        match image {
            Some(_) => repairs.textures_used += 1,
            None => repairs.missing_textures += 1,
        }
        image.clone()
    }
}

/// A file name with the separators of this system; files from Windows have backslashes.
fn portable(name: &str) -> String {
    name.replace('\\', "/")
}

/// The file name of a texture statement: what follows options (`-s 1 1 1`, `-clamp on`).
fn file_name(statement: &str) -> &str {
    let mut rest = statement;
    loop {
        let end = rest.find(char::is_whitespace).unwrap_or(rest.len());
        let (word, after) = rest.split_at(end);
        let is_option = word.starts_with('-')
            || (rest.len() < statement.len()
                && (word.parse::<f32>().is_ok() || matches!(word, "on" | "off")));
        if !is_option || after.is_empty() {
            return rest;
        }
        rest = after.trim_start();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texture_options_are_stripped() {
        let cases = [
            ("wall.png", "wall.png"),
            ("my wall.png", "my wall.png"),
            ("-s 1 1 1 -o 0 0.5 wall.png", "wall.png"),
            ("-clamp on my wall.png", "my wall.png"),
            ("-bm -0.5 1.png", "1.png"),
            ("4k wall.png", "4k wall.png"),
        ];
        for (statement, name) in cases {
            assert_eq!(file_name(statement), name);
        }
    }

    #[test]
    fn values_are_checked_and_emission_is_pi_times_radiance() {
        let describe = |diffuse, emissive| {
            let material = tobj::Material {
                name: "m".to_owned(),
                diffuse,
                emissive,
                ..tobj::Material::default()
            };
            Library::default().describe(Path::new("x.mtl"), &material, &mut Repairs::default())
        };
        let plain = describe(None, None).unwrap();
        assert_eq!(plain.reflectance, Rgb::splat(DEFAULT_REFLECTANCE));
        assert!(plain.two_sided && plain.glow.is_none());
        let lamp = describe(Some([0.0; 3]), Some([1.0, 0.0, 2.0])).unwrap();
        let exitance = lamp.glow.unwrap().exitance;
        assert_eq!(exitance, Rgb::new(1.0, 0.0, 2.0) * std::f32::consts::PI);
        for bad in [-0.1, f32::NAN, f32::INFINITY] {
            let fault = describe(Some([0.5, bad, 0.5]), None).unwrap_err();
            assert!(fault.starts_with("Kd (0.5, "), "{fault}");
            assert!(
                describe(None, Some([bad; 3]))
                    .unwrap_err()
                    .starts_with("Ke")
            );
        }
    }
}
