//! Surfaces, luminaires and the scene: checked once, then only legal values travel.
//!
//! A *light* is a tag, a number below [`Scene::lights`]; what emits under that tag is the emission
//! of area lights and the [`Luminaire`]s. Unit emission of a tag: area light, exitance 1 W/m2; point
//! and spot, intensity 1 W/sr; sun, irradiance 1 W/m2 on a surface that faces it; sky, radiance
//! 1/pi from every direction that escapes. Colour and strength live outside, in the mix; inside a
//! group of several luminaires each emits its *share*, per channel in [0, 1].

use core::fmt;

use glam::Vec3;

use crate::color::{Reflectance, Rgb};
use crate::geometry::{Polygon, PolygonError};

/// What a surface emits from its front.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Emission {
    /// The tag.
    pub light: u32,
    /// Exitance at unit emission of the tag, W/m2: 1 for a light of one luminaire.
    pub share: Rgb,
}

/// A polygon that reflects, blocks and possibly emits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    polygon: Polygon,
    reflectance: Reflectance,
    two_sided: bool,
    emission: Option<Emission>,
}

/// What is wrong with a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum SurfaceFault {
    /// The outline is no convex planar polygon.
    Polygon(PolygonError),
    /// A channel of the reflectance is outside [0, 1).
    Reflectance(Rgb),
    /// A channel of the emission's share is negative or not finite.
    Share(Rgb),
}

/// A surface that was refused, and why.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceError {
    /// The number of the surface, from 0.
    pub surface: u32,
    /// What is wrong with it.
    pub fault: SurfaceFault,
}

impl fmt::Display for SurfaceError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "surface {}: ", self.surface)?;
        match self.fault {
            SurfaceFault::Polygon(error) => error.fmt(f),
            SurfaceFault::Reflectance(Rgb { r, g, b }) => {
                write!(f, "reflectance ({r}, {g}, {b}) is outside [0, 1)")
            }
            SurfaceFault::Share(Rgb { r, g, b }) => {
                write!(f, "emission ({r}, {g}, {b}) is negative or not finite")
            }
        }
    }
}

impl core::error::Error for SurfaceError {}

impl Surface {
    /// A surface that reflects from its front only; `index` is its number, for the error.
    ///
    /// # Errors
    /// [`SurfaceError`] with the fault that was found first.
    pub fn new(index: u32, vertices: &[Vec3], reflectance: Rgb) -> Result<Self, SurfaceError> {
        let refuse = |fault| SurfaceError {
            surface: index,
            fault,
        };
        Ok(Self {
            polygon: Polygon::new(vertices).map_err(|e| refuse(SurfaceFault::Polygon(e)))?,
            reflectance: Reflectance::new(reflectance)
                .ok_or_else(|| refuse(SurfaceFault::Reflectance(reflectance)))?,
            two_sided: false,
            emission: None,
        })
    }

    /// The same, reflecting from both sides.
    #[must_use]
    pub const fn two_sided(mut self) -> Self {
        self.two_sided = true;
        self
    }

    /// The same, emitting from its front; `index` is its number, for the error.
    ///
    /// # Errors
    /// [`SurfaceFault::Share`] when a channel is negative or not finite.
    pub fn emitting(mut self, index: u32, emission: Emission) -> Result<Self, SurfaceError> {
        if !emission.share.is_legal() {
            return Err(SurfaceError {
                surface: index,
                fault: SurfaceFault::Share(emission.share),
            });
        }
        self.emission = Some(emission);
        Ok(self)
    }

    /// The outline.
    #[must_use]
    pub const fn polygon(&self) -> &Polygon {
        &self.polygon
    }

    /// What it reflects, on each side that reflects.
    #[must_use]
    pub const fn reflectance(&self) -> Reflectance {
        self.reflectance
    }

    /// True when the back reflects as well.
    #[must_use]
    pub const fn is_two_sided(&self) -> bool {
        self.two_sided
    }

    /// What the front emits.
    #[must_use]
    pub const fn emission(&self) -> Option<Emission> {
        self.emission
    }
}

/// How a spot's intensity falls between its inner and its outer angle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Falloff {
    /// `((cos a - cos outer) / (cos inner - cos outer))^2`, as KHR_lights_punctual suggests.
    #[default]
    Smooth,
    /// `(outer - a) / (outer - inner)`, linear in the angle.
    Linear,
}

/// A light without a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Source {
    /// The same intensity in every direction.
    Point {
        /// Where it is, in m.
        position: Vec3,
    },
    /// Full intensity inside a cone, none outside a wider one.
    Spot {
        /// Where it is, in m.
        position: Vec3,
        /// The way the light travels, a unit vector.
        direction: Vec3,
        /// Half angle of the full cone, radians.
        inner: f32,
        /// Half angle beyond which it is dark, radians.
        outer: f32,
        /// The course between the two.
        falloff: Falloff,
    },
    /// Light from one direction, or from a small disc of directions.
    Sun {
        /// The way the light travels, a unit vector.
        direction: Vec3,
        /// Angular diameter in radians; 0 gives hard shadows.
        angle: f32,
    },
    /// Uniform radiance from all around.
    Sky,
}

/// A source, its tag and its share of the tag's emission.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Luminaire {
    light: u32,
    share: Rgb,
    source: Source,
}

/// Why a luminaire was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum LuminaireError {
    /// A coordinate, an angle or the share is not finite, or the share is negative.
    NotFinite,
    /// The direction has no length.
    NoDirection,
    /// Not `0 <= inner <= outer <= pi`, with `outer` above zero.
    Cone,
    /// A sun's diameter is outside [0, pi).
    Angle,
}

impl fmt::Display for LuminaireError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NotFinite => "a value is not finite, or an emission is negative",
            Self::NoDirection => "the direction is the zero vector",
            Self::Cone => "a cone needs 0 <= inner <= outer <= pi and outer > 0",
            Self::Angle => "the angular diameter must lie in [0, pi)",
        })
    }
}

impl core::error::Error for LuminaireError {}

impl Luminaire {
    /// Checks a source; its direction is scaled to length one.
    ///
    /// # Errors
    /// [`LuminaireError`] with the fault that was found first.
    pub fn new(light: u32, share: Rgb, source: Source) -> Result<Self, LuminaireError> {
        if !share.is_legal() {
            return Err(LuminaireError::NotFinite);
        }
        let source = match source {
            Source::Point { position } => Source::Point {
                position: finite(position)?,
            },
            Source::Spot {
                position,
                direction,
                inner,
                outer,
                falloff,
            } => {
                if !(0.0 <= inner && inner <= outer && outer <= core::f32::consts::PI)
                    || outer <= 0.0
                {
                    return Err(LuminaireError::Cone);
                }
                Source::Spot {
                    position: finite(position)?,
                    direction: unit(direction)?,
                    inner,
                    outer,
                    falloff,
                }
            }
            Source::Sun { direction, angle } => {
                if !(0.0..core::f32::consts::PI).contains(&angle) {
                    return Err(LuminaireError::Angle);
                }
                Source::Sun {
                    direction: unit(direction)?,
                    angle,
                }
            }
            Source::Sky => Source::Sky,
        };
        Ok(Self {
            light,
            share,
            source,
        })
    }

    /// The tag.
    #[must_use]
    pub const fn light(&self) -> u32 {
        self.light
    }

    /// Share of the tag's unit emission.
    #[must_use]
    pub const fn share(&self) -> Rgb {
        self.share
    }

    /// The checked source.
    #[must_use]
    pub const fn source(&self) -> &Source {
        &self.source
    }
}

fn finite(v: Vec3) -> Result<Vec3, LuminaireError> {
    if v.is_finite() {
        Ok(v)
    } else {
        Err(LuminaireError::NotFinite)
    }
}

fn unit(direction: Vec3) -> Result<Vec3, LuminaireError> {
    finite(direction)?
        .try_normalize()
        .ok_or(LuminaireError::NoDirection)
}

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
            if let Some(Emission { light, .. }) = surface.emission
                && light >= lights
            {
                return Err(SceneError::SurfaceLight {
                    surface: index,
                    light,
                });
            }
        }
        for (&Luminaire { light, .. }, luminaire) in luminaires.iter().zip(0..) {
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
        let vertices = || self.surfaces.iter().flat_map(|s| s.polygon.vertices());
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
