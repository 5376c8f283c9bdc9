//! Scenes that need no file: the Cornell box, the paper's room, a flat, white furnaces.
//!
//! Each comes with the spacing and the view that suit it. Lengths are in metres, `y` is up, and
//! fronts (counter-clockwise) face the lit side.

mod cornell;
mod flat;
mod furnace;
mod paper;
#[cfg(test)]
pub(crate) mod published;

use glam::Vec3;
use relume::color::Rgb;
use relume::draw::Camera;
use relume::mesh::Spacing;
use relume::scene::{Emission, Luminaire, LuminaireError, Source, Surface, SurfaceError};

use crate::scene::{Light, OwnedScene};

pub use cornell::cornell_box;
pub use flat::flat;
pub use furnace::{furnace_with_box, white_furnace};
pub use paper::{PaperLamps, paper_room};

/// A scene with what is needed to bake it and to look at it.
#[derive(Clone, Debug)]
pub struct Builtin {
    /// The scene.
    pub scene: OwnedScene,
    /// How to divide it.
    pub spacing: Spacing,
    /// From where to look at it.
    pub camera: Camera,
}

/// Why a built-in scene could not be made: a parameter is out of its range.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BuiltinError {
    /// A surface was refused.
    #[error(transparent)]
    Surface(#[from] SurfaceError),
    /// A luminaire was refused.
    #[error(transparent)]
    Luminaire(#[from] LuminaireError),
    /// A nominal emission is negative or not finite.
    #[error("an emission of {0} W/m2 is negative or not finite")]
    Emission(f32),
}

/// A scene that is being put together.
#[derive(Default)]
pub(crate) struct Builder {
    pub(crate) scene: OwnedScene,
}

impl Builder {
    /// Adds a light of its own name and nominal emission; returns its tag.
    pub(crate) fn light(&mut self, name: impl Into<String>, emission: Rgb) -> u32 {
        self.scene.lights.push(Light {
            name: name.into(),
            emission,
            importance: 1.0,
        });
        self.scene.lights.len() as u32 - 1
    }

    fn add(
        &mut self,
        vertices: &[Vec3],
        reflectance: Rgb,
        change: impl FnOnce(u32, Surface) -> Result<Surface, SurfaceError>,
    ) -> Result<(), BuiltinError> {
        let number = self.scene.surfaces.len() as u32;
        let surface = Surface::new(number, vertices, reflectance)?;
        self.scene.surfaces.push(change(number, surface)?);
        self.scene.textures.push(None);
        Ok(())
    }

    /// Adds a surface that reflects from its front.
    pub(crate) fn surface(
        &mut self,
        vertices: &[Vec3],
        reflectance: Rgb,
    ) -> Result<(), BuiltinError> {
        self.add(vertices, reflectance, |_, surface| Ok(surface))
    }

    /// Adds a surface that reflects from both sides.
    pub(crate) fn two_sided(
        &mut self,
        vertices: &[Vec3],
        reflectance: Rgb,
    ) -> Result<(), BuiltinError> {
        self.add(vertices, reflectance, |_, surface| Ok(surface.two_sided()))
    }

    /// Adds a surface that emits all of a light and reflects from its front.
    pub(crate) fn lamp(
        &mut self,
        vertices: &[Vec3],
        reflectance: Rgb,
        light: u32,
    ) -> Result<(), BuiltinError> {
        let share = Rgb::WHITE;
        self.add(vertices, reflectance, |number, surface| {
            surface.emitting(number, Emission { light, share })
        })
    }

    fn luminaire(&mut self, light: u32, source: Source) -> Result<(), BuiltinError> {
        let luminaire = Luminaire::new(light, Rgb::WHITE, source)?;
        self.scene.luminaires.push(luminaire);
        Ok(())
    }
}

/// The faces of the cuboid between two corners, fronts outwards: floor, ceiling, then the sides of
/// low x, high x, low z, high z.
pub(crate) fn cuboid(low: Vec3, high: Vec3) -> [[Vec3; 4]; 6] {
    let corner = |x: u8, y: u8, z: u8| {
        let pick = |bit, low, high| if bit == 0 { low } else { high };
        Vec3::new(
            pick(x, low.x, high.x),
            pick(y, low.y, high.y),
            pick(z, low.z, high.z),
        )
    };
    [
        [
            corner(0, 0, 0),
            corner(1, 0, 0),
            corner(1, 0, 1),
            corner(0, 0, 1),
        ],
        [
            corner(0, 1, 0),
            corner(0, 1, 1),
            corner(1, 1, 1),
            corner(1, 1, 0),
        ],
        [
            corner(0, 0, 0),
            corner(0, 0, 1),
            corner(0, 1, 1),
            corner(0, 1, 0),
        ],
        [
            corner(1, 0, 0),
            corner(1, 1, 0),
            corner(1, 1, 1),
            corner(1, 0, 1),
        ],
        [
            corner(0, 0, 0),
            corner(0, 1, 0),
            corner(1, 1, 0),
            corner(1, 0, 0),
        ],
        [
            corner(0, 0, 1),
            corner(1, 0, 1),
            corner(1, 1, 1),
            corner(0, 1, 1),
        ],
    ]
}

/// The same outline seen from behind.
pub(crate) fn reversed([a, b, c, d]: [Vec3; 4]) -> [Vec3; 4] {
    [a, d, c, b]
}

#[cfg(test)]
mod tests;
