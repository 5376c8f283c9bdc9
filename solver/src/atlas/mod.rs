//! The atlas: packed contributions of every light to every element, as bytes that live in flash.
//!
//! Version 1, little-endian, no alignment needed. Lengths in bytes, `n` elements, `k` lights:
//!
//! | at | what |
//! | --- | --- |
//! | 0 | `RELUMEAT` |
//! | 8 | `u16` version, 1 |
//! | 10 | `u8` code: 0 `exp8`, 1 `exp8s` |
//! | 11 | `u8` channels of a code: 1 luminance, 3 red, green, blue |
//! | 12 | `u8` quantity: 0 irradiance, 1 radiosity (reflectance multiplied in) |
//! | 13 | three zero bytes |
//! | 16 | `u32` length of the whole atlas |
//! | 20 | `u32` CRC-32 (ISO-HDLC) of all bytes but these four |
//! | 24 | `u32` elements `n` |
//! | 28 | `u32` lights `k` |
//! | 32 | `u32` length of the names |
//! | 36 | `u32` surfaces, 0 without a mesh |
//! | 40 | `u32` faces, 0 without a mesh |
//! | 44 | `f32` largest error of packing, see [`WorstError::packed`]; all ones: not measured |
//! | 48 | `f32` the same of what is shown, see [`WorstError::shown`] |
//! | 52 | `k` lights of 24: nominal emission `3 f32`, scale mantissa `u16`, scale exponent `i16`, length of the name `u16`, two zero bytes, largest error with this light alone `f32` (all ones: not measured) |
//! | | the names one after the other, UTF-8 |
//! | | codes: `n` elements of `k` lights of 1 or 3 bytes |
//! | | with a mesh, surfaces of 52: four vertices `3 f32` (a triangle repeats its third), vertex count `u32` |
//! | | faces of 24: surface `u32`, side `u32` (0 front, 1 back), light `u32` (all ones: none), share `3 f32` (without a light: 0) |
//! | | elements of 32: face `u32`, parameter corners `from`, `to` `4 f32`, reflectance `3 f32` |
//!
//! A code is the exponential code ([`crate::code`]) of the contribution over the light's scale.
//! The reader borrows the bytes and checks everything once, so that later access cannot fail.

mod read;
mod write;

use core::fmt;

use crc::{CRC_32_ISO_HDLC, Crc};
use glam::Vec2;

pub use read::{Atlas, AtlasMesh};
pub use write::{Contents, LightEntry, size, write};

use crate::code::Scale;
use crate::color::Rgb;
use crate::geometry::Polygon;
use crate::mesh::Side;
use crate::scene::Emission;

/// How an atlas starts.
pub const MAGIC: [u8; 8] = *b"RELUMEAT";
const VERSION: u16 = 1;
const HEADER_BYTES: usize = 52;
const CHECKSUM_AT: usize = 20;
const LIGHT_BYTES: usize = 24;
const SURFACE_BYTES: usize = 52;
const FACE_BYTES: usize = 24;
const ELEMENT_BYTES: usize = 32;
/// Light of a face that emits nothing.
const NO_LIGHT: u32 = u32::MAX;
/// Bits of an error that nobody measured; a NaN, so no error has them.
const NOT_MEASURED: u32 = u32::MAX;

/// What one code stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channels {
    /// The luminance of a contribution.
    Luminance,
    /// Red, green and blue, a code each.
    Rgb,
}

impl Channels {
    /// Codes per element and light.
    #[must_use]
    pub const fn count(self) -> usize {
        match self {
            Self::Luminance => 1,
            Self::Rgb => 3,
        }
    }
}

/// What the contributions measure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Irradiance, W/m2: the reflectance is applied after relighting.
    Irradiance,
    /// Radiosity without emission, W/m2: the reflectance is multiplied in.
    Radiosity,
}

/// The largest errors of packing over all states of the lights that were tried.
///
/// In display codes: steps of 8-bit sRGB, at the exposure that puts the 98th percentile of the exact
/// state's luminance at white; finite and not negative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WorstError {
    /// Of what is packed, the atlas's [`Quantity`].
    pub packed: f32,
    /// Of what is shown, emission plus reflectance times irradiance.
    pub shown: f32,
}

/// Name, nominal emission, scale and error of a light, as read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AtlasLight<'a> {
    /// Its name.
    pub name: &'a str,
    /// Nominal mix weight.
    pub emission: Rgb,
    /// What one unit of the code is worth, at unit emission.
    pub scale: Scale,
    /// Largest error with this light alone, in display codes as in [`WorstError::packed`]; `None`
    /// when nobody measured it.
    pub error: Option<f32>,
}

/// One side of a surface, as read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AtlasFace {
    /// Number of its surface.
    pub surface: u32,
    /// Which side.
    pub side: Side,
    /// Outline, its front towards this side.
    pub polygon: Polygon,
    /// What it emits.
    pub emission: Option<Emission>,
}

/// An element, as read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AtlasElement {
    /// Number of its face.
    pub face: u32,
    /// First parameter corner in its face, see [`Polygon::part`].
    pub from: Vec2,
    /// Opposite parameter corner.
    pub to: Vec2,
    /// Reflectance, in [0, 1) per channel.
    pub reflectance: Rgb,
}

/// Why bytes are no atlas, or contents do not become one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum AtlasError {
    /// The bytes do not start like an atlas.
    NotAnAtlas,
    /// Written in another version of the format than this one knows.
    Version(u16),
    /// Fewer bytes than the header promises.
    Truncated {
        /// Bytes that are needed.
        needed: u64,
    },
    /// More bytes than the header promises.
    Oversized {
        /// Bytes that belong to the atlas.
        needed: u64,
    },
    /// The checksum does not match: the bytes were damaged.
    Checksum,
    /// This part of the atlas holds an illegal value.
    Illegal(&'static str),
    /// This is more than the format holds; what it is, and what to do.
    Unfit(&'static str),
    /// The slice to write into is too short.
    Full {
        /// Bytes that are needed.
        needed: usize,
    },
}

impl fmt::Display for AtlasError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotAnAtlas => {
                f.write_str("these bytes are not an atlas; make one with `relume pack`")
            }
            Self::Version(version) => write!(
                f,
                "atlas version {version} is not the {VERSION} known here; update relume or pack again"
            ),
            Self::Truncated { needed } => {
                write!(
                    f,
                    "the atlas is cut off, {needed} bytes are needed; copy or pack it again"
                )
            }
            Self::Oversized { needed } => {
                write!(
                    f,
                    "the atlas ends after {needed} bytes, but more follow; copy or pack it again"
                )
            }
            Self::Checksum => f.write_str(
                "the checksum does not match: the atlas was damaged; copy or pack it again",
            ),
            Self::Illegal(what) => write!(f, "the atlas holds an illegal {what}; pack it again"),
            Self::Unfit(what) => write!(f, "an atlas cannot hold {what}"),
            Self::Full { needed } => write!(f, "the atlas needs {needed} bytes of room"),
        }
    }
}

impl core::error::Error for AtlasError {}

/// CRC-32 of everything but the checksum itself.
fn checksum(bytes: &[u8]) -> Option<u32> {
    const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);
    let mut digest = CRC.digest();
    digest.update(bytes.get(..CHECKSUM_AT)?);
    digest.update(bytes.get(CHECKSUM_AT + 4..)?);
    Some(digest.finalize())
}

/// Where the parts lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Layout {
    names: u64,
    codes: u64,
    surfaces: u64,
    faces: u64,
    elements: u64,
    end: u64,
}

/// The counts of a header, from which every length follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct CountsOf {
    channels: Channels,
    elements: u32,
    lights: u32,
    names: u32,
    surfaces: u32,
    faces: u32,
}

impl CountsOf {
    /// Offsets in `u64`; `None` when even those overflow.
    fn layout(&self) -> Option<Layout> {
        let [n, k] = [u64::from(self.elements), u64::from(self.lights)];
        let names = HEADER_BYTES as u64 + k * LIGHT_BYTES as u64;
        let codes = names + u64::from(self.names);
        let per_element = k * self.channels.count() as u64;
        let surfaces = codes.checked_add(n.checked_mul(per_element)?)?;
        let faces = surfaces.checked_add(u64::from(self.surfaces) * SURFACE_BYTES as u64)?;
        let elements = faces.checked_add(u64::from(self.faces) * FACE_BYTES as u64)?;
        let stored = if self.faces > 0 { n } else { 0 };
        Some(Layout {
            names,
            codes,
            surfaces,
            faces,
            elements,
            end: elements.checked_add(stored * ELEMENT_BYTES as u64)?,
        })
    }
}

#[cfg(test)]
mod tests;
