//! Polygons that reflect, block and possibly emit.

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
