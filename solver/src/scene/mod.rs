//! Surfaces, luminaires and the scene: checked once, then only legal values travel.
//!
//! A *light* is a tag, a number below [`Scene::lights`]; what emits under that tag is the emission
//! of area lights and the [`Luminaire`]s. Unit emission of a tag: area light, exitance 1 W/m2; point
//! and spot, intensity 1 W/sr; sun, irradiance 1 W/m2 on a surface that faces it; sky, radiance
//! 1/pi from every direction that escapes. Colour and strength live outside, in the mix; inside a
//! group of several luminaires each emits its *share*, per channel, not above 1 by convention.

mod source;
mod surface;

use core::fmt;

use glam::Vec3;

pub use source::{Falloff, Luminaire, LuminaireError, Source};
pub use surface::{Emission, Surface, SurfaceError, SurfaceFault};

/// Surfaces and luminaires whose tags are known to be in range.
#[derive(Clone, Copy, Debug)]
pub struct Scene<'a> {
    surfaces: &'a [Surface],
    luminaires: &'a [Luminaire],
    lights: u32,
}

/// Why surfaces and luminaires make no scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SceneError {
    /// A surface emits under a tag that is not below the number of lights.
    SurfaceLight {
        /// Number of the surface.
        surface: u32,
        /// Its tag.
        light: u32,
    },
    /// A luminaire has a tag that is not below the number of lights.
    LuminaireLight {
        /// Number of the luminaire.
        luminaire: u32,
        /// Its tag.
        light: u32,
    },
    /// There are more surfaces than 32-bit ids.
    TooManySurfaces,
}

impl fmt::Display for SceneError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::SurfaceLight { surface, light } => {
                write!(f, "surface {surface}: there is no light {light}")
            }
            Self::LuminaireLight { luminaire, light } => {
                write!(f, "luminaire {luminaire}: there is no light {light}")
            }
            Self::TooManySurfaces => f.write_str("more surfaces than 32-bit ids can name"),
        }
    }
}

impl core::error::Error for SceneError {}

impl<'a> Scene<'a> {
    /// Ties surfaces and luminaires together; `lights` is the number of tags.
    ///
    /// # Errors
    /// A tag out of range, named with the surface or luminaire that has it.
    pub fn new(
        surfaces: &'a [Surface],
        luminaires: &'a [Luminaire],
        lights: u32,
    ) -> Result<Self, SceneError> {
        if u32::try_from(surfaces.len()).is_err() {
            return Err(SceneError::TooManySurfaces);
        }
        for (surface, index) in surfaces.iter().zip(0..) {
            if let Some(Emission { light, .. }) = surface.emission()
                && light >= lights
            {
                return Err(SceneError::SurfaceLight {
                    surface: index,
                    light,
                });
            }
        }
        for (source, luminaire) in luminaires.iter().zip(0..) {
            let light = source.light();
            if light >= lights {
                return Err(SceneError::LuminaireLight { luminaire, light });
            }
        }
        Ok(Self {
            surfaces,
            luminaires,
            lights,
        })
    }

    /// The surfaces, in the caller's order.
    #[must_use]
    pub const fn surfaces(&self) -> &'a [Surface] {
        self.surfaces
    }

    /// The luminaires, in the caller's order.
    #[must_use]
    pub const fn luminaires(&self) -> &'a [Luminaire] {
        self.luminaires
    }

    /// The number of tags.
    #[must_use]
    pub const fn lights(&self) -> u32 {
        self.lights
    }

    /// Diagonal of the bounding box of all surfaces, in m; 0 without surfaces.
    #[must_use]
    pub fn diagonal(&self) -> f32 {
        let vertices = || self.surfaces.iter().flat_map(|s| s.polygon().vertices());
        let low = vertices().copied().reduce(Vec3::min);
        let high = vertices().copied().reduce(Vec3::max);
        low.zip(high)
            .map_or(0.0, |(low, high)| (high - low).length())
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use crate::color::Rgb;
    use std::string::ToString;

    const TRIANGLE: [Vec3; 3] = [Vec3::ZERO, Vec3::X, Vec3::Y];

    #[test]
    fn errors_name_the_surface() {
        let error = Surface::new(7, &TRIANGLE, Rgb::splat(1.0)).unwrap_err();
        assert_eq!(
            error.to_string(),
            "surface 7: reflectance (1, 1, 1) is outside [0, 1)"
        );
        let error = Surface::new(3, &[Vec3::ZERO; 3], Rgb::BLACK).unwrap_err();
        assert_eq!(error.to_string(), "surface 3: the area is zero");
    }

    #[test]
    fn a_unit_vector_keeps_its_bits() {
        let unit = |direction| {
            let sun = Source::Sun {
                direction,
                angle: 0.0,
            };
            let sun = Luminaire::new(0, Rgb::WHITE, sun).unwrap();
            match *sun.source() {
                Source::Sun { direction, .. } => direction,
                _ => Vec3::ZERO,
            }
        };
        for i in 1..10_000 {
            let turn = Vec3::new(0.618, 0.755, 0.57) * i as f32;
            let once = unit(turn.fract() - 0.5);
            assert_eq!(unit(once), once, "{i}");
        }
    }

    #[test]
    fn directions_of_any_length_become_unit_vectors() {
        let sun = |direction| {
            Luminaire::new(
                0,
                Rgb::WHITE,
                Source::Sun {
                    direction,
                    angle: 0.0,
                },
            )
        };
        for length in [1e-44, 1e-25, 1.0, 1e25, 1e38_f32] {
            let along = Vec3::new(0.0, 0.0, -length);
            assert_eq!(
                *sun(along).unwrap().source(),
                Source::Sun {
                    direction: -Vec3::Z,
                    angle: 0.0
                },
                "{length}"
            );
        }
        assert_eq!(sun(Vec3::ZERO), Err(LuminaireError::NoDirection));
        assert_eq!(sun(Vec3::INFINITY), Err(LuminaireError::NotFinite));
    }

    #[test]
    fn a_tag_out_of_range_is_named() {
        let lamp = Surface::new(0, &TRIANGLE, Rgb::BLACK)
            .and_then(|s| {
                s.emitting(
                    0,
                    Emission {
                        light: 2,
                        share: Rgb::WHITE,
                    },
                )
            })
            .unwrap();
        assert_eq!(
            Scene::new(&[lamp], &[], 2).unwrap_err(),
            SceneError::SurfaceLight {
                surface: 0,
                light: 2
            }
        );
        let sky = Luminaire::new(5, Rgb::WHITE, Source::Sky).unwrap();
        assert!(Scene::new(&[lamp], &[sky], 3).is_err());
        assert!(Scene::new(&[lamp], &[sky], 6).is_ok());
    }

    #[test]
    fn illegal_luminaires_are_refused() {
        let spot = |direction, inner, outer| Source::Spot {
            position: Vec3::ZERO,
            direction,
            inner,
            outer,
            falloff: Falloff::Smooth,
        };
        let sun = |angle| Source::Sun {
            direction: Vec3::X,
            angle,
        };
        let cases = [
            (spot(Vec3::ZERO, 0.1, 0.2), LuminaireError::NoDirection),
            (spot(Vec3::X, 0.3, 0.2), LuminaireError::Cone),
            (spot(Vec3::X, f32::NAN, 0.2), LuminaireError::Cone),
            (sun(-1.0), LuminaireError::Angle),
            (
                Source::Point {
                    position: Vec3::splat(f32::INFINITY),
                },
                LuminaireError::NotFinite,
            ),
        ];
        for (source, error) in cases {
            assert_eq!(
                Luminaire::new(0, Rgb::WHITE, source),
                Err(error),
                "{source:?}"
            );
        }
    }
}
