//! A scene that owns its parts: what importers make and what the bake takes.
//!
//! Lengths are in the file's own units; conventions are those of [`relume::scene`].

use relume::color::Rgb;
use relume::scene::{Luminaire, Scene, SceneError, Surface};

use crate::texture::SurfaceTexture;

/// One tag: what a user dims, switches and colours.
#[derive(Clone, Debug, PartialEq)]
pub struct Light {
    /// Its name, unique in the scene.
    pub name: String,
    /// Nominal emission, the mix weight that the file asks for: exitance of area lights in W/m2,
    /// intensity of point and spot lights in W/sr, irradiance of sun and sky in W/m2.
    pub emission: Rgb,
    /// Weight in the choice of the next shooter, above zero; 1 unless the user says otherwise.
    pub importance: f32,
}

/// Surfaces, luminaires and lights of one scene.
#[derive(Clone, Debug, Default)]
pub struct OwnedScene {
    /// The surfaces; their emission refers to `lights` by index.
    pub surfaces: Vec<Surface>,
    /// Texture of each surface's reflectance, parallel to `surfaces`; a textured surface's own
    /// reflectance is the texture's mean.
    pub textures: Vec<Option<SurfaceTexture>>,
    /// Point, spot, sun and sky lights.
    pub luminaires: Vec<Luminaire>,
    /// The tags, by index.
    pub lights: Vec<Light>,
}

impl OwnedScene {
    /// The solver's view of it.
    ///
    /// # Errors
    /// [`SceneError`] when a tag is out of range.
    pub fn view(&self) -> Result<Scene<'_>, SceneError> {
        let lights = u32::try_from(self.lights.len()).unwrap_or(u32::MAX);
        Scene::new(&self.surfaces, &self.luminaires, lights)
    }
}
