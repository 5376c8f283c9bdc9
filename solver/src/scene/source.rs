//! Lights without a surface: point, spot, sun and sky.

use core::fmt;

use glam::Vec3;

use crate::color::Rgb;

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

/// Roundings by which the squared length of a vector that was scaled to length one is off: at most 12 halves.
const ROUNDINGS: f32 = 8.0 * f32::EPSILON;

/// The direction with length one; one that has it keeps its bits, so that what is written and read again is the same.
fn unit(direction: Vec3) -> Result<Vec3, LuminaireError> {
    let direction = finite(direction)?;
    if (direction.length_squared() - 1.0).abs() <= ROUNDINGS {
        return Ok(direction);
    }
    // The square of a very long or very short vector leaves the range of f32.
    let scaled = || (direction / direction.abs().max_element()).try_normalize();
    direction
        .try_normalize()
        .or_else(scaled)
        .ok_or(LuminaireError::NoDirection)
}
