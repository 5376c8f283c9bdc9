//! The atlas: packed contributions of every light to every element, as bytes that live in flash.
//!
//! Version 5, little-endian, no alignment needed. Lengths in bytes, `n` elements, `k` lights:
//!
//! | at | what |
//! | --- | --- |
//! | 0 | `RELUMEAT` |
//! | 8 | `u16` version, 5 |
//! | 10 | `u8` quantity: 0 irradiance, 1 radiosity (reflectance multiplied in), 2 radiance |
//! | 11 | three zero bytes |
//! | 14 | `u16` width of the image whose pixels, row by row, are the elements; 0 for an atlas of no image |
//! | 16 | `u32` length of the whole atlas |
//! | 20 | `u32` CRC-32 (ISO-HDLC) of all bytes but these four |
//! | 24 | `u32` elements `n` |
//! | 28 | `u32` lights `k` |
//! | 32 | `u32` length of the names |
//! | 36 | `u32` length of the tiles, 0 without a light in tiles |
//! | 40 | `u32` surfaces, 0 without a mesh |
//! | 44 | `u32` faces, 0 without a mesh |
//! | 48 | `f32` largest error of packing, see [`WorstError::packed`]; all ones: not measured |
//! | 52 | `f32` the same of what is shown, see [`WorstError::shown`] |
//! | 56 | `k` lights of 64: nominal emission `3 f32`, code `u8` (its place in [`Code::ALL`]), a zero byte, length of the name `u16`, largest error with this light alone `f32` (all ones: not measured), two zero bytes, for red, green and blue a [`Curve`] of 14: mantissa `u16` and exponent `i16` of its scale or white, first `u32`, step `u32`, last code `u16` (what a curve does not have is 0; the scale of a logarithmic one is 1; one of parts has after its white, as `u16`, first and, times 2^12, unit, then the first 8 of the 16 bytes of steps) |
//! | | with a light in `display8`, `k` times, for red, green and blue, the other 8 bytes of steps; of other lights they are 0 |
//! | | the names one after the other, UTF-8 |
//! | | codes: for every element, for every light that is not in tiles, 3 bytes of red, green and blue, or 1 of luminance |
//! | | the tiles, see [`Tiles`] |
//! | | with a mesh, surfaces of 52: four vertices `3 f32` (a triangle repeats its third), vertex count `u32` |
//! | | faces of 24: surface `u32`, side `u32` (0 front, 1 back), light `u32` (all ones: none), share `3 f32` (without a light: 0) |
//! | | elements of 32: face `u32`, parameter corners `from`, `to` `4 f32`, reflectance `3 f32` |
//!
//! The reader borrows the bytes and checks everything once, so that later access cannot fail. The bits inside
//! tiles are the exception: whatever they are, they decode to codes that the curves have.

mod read;
mod tiles;
mod write;

use core::fmt;

use crate::code::Known;
use crc::{CRC_32_ISO_HDLC, Crc, NoTable};
use glam::Vec2;

pub(crate) use read::Group;
pub use read::{Atlas, AtlasMesh};
pub use tiles::{
    ESCAPE, FIRST_BITS, FULL_BITS, GROUP, LARGEST_SIDE, PREDICTED, Place, Predictor, Share,
    TileBits, Tiles, places, tags,
};
pub use write::{Contents, LightEntry, size, write, write_without_mesh};

use crate::code::{Code, Curve, PARTS};
use crate::color::Rgb;
use crate::geometry::Polygon;
use crate::mesh::Side;
use crate::scene::Emission;

/// How an atlas starts.
pub const MAGIC: [u8; 8] = *b"RELUMEAT";
const VERSION: u16 = 5;
const HEADER_BYTES: usize = 56;
/// Where counts stand that leave with the mesh, and what follows from them.
const LENGTH_AT: usize = 16;
const CHECKSUM_AT: usize = 20;
const SURFACES_AT: usize = 40;
const FACES_AT: usize = 44;
const LIGHT_BYTES: usize = 64;
/// Where the code of a light stands in its record.
const CODE_AT: usize = 12;
/// Where the curves of a light stand in its record, and how long one is.
const CURVES_AT: usize = 22;
const CURVE_BYTES: usize = 14;
/// The second half of the steps of parts: of a channel, and of a light.
const STEPS_BYTES: usize = PARTS / 4;
const LIGHT_STEPS_BYTES: usize = 3 * STEPS_BYTES;
/// The largest code in tiles: differences of two fit 16 bits.
pub const LARGEST_TILE_CODE: u16 = i16::MAX as u16;
const SURFACE_BYTES: usize = 52;
const FACE_BYTES: usize = 24;
const ELEMENT_BYTES: usize = 32;
/// Light of a face that emits nothing.
const NO_LIGHT: u32 = u32::MAX;
/// Bits of an error that nobody measured; a NaN, so no error has them.
const NOT_MEASURED: u32 = u32::MAX;

/// What the contributions measure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Irradiance, W/m2: the reflectance is applied after relighting.
    Irradiance,
    /// Radiosity without emission, W/m2: the reflectance is multiplied in.
    Radiosity,
    /// Radiance towards a camera, in the unit of the picture that it came from: the elements are pixels.
    Radiance,
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

/// Name, nominal emission, code and error of a light, as read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AtlasLight<'a> {
    /// Its name.
    pub name: &'a str,
    /// Nominal mix weight.
    pub emission: Rgb,
    /// What its contributions are written in.
    pub code: Code,
    /// What the codes of red, green and blue stand for, at unit emission; three times the same for luminance.
    pub curves: [Curve; 3],
    /// The largest code of each channel.
    pub last: [u16; 3],
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
fn checksum<K: Known>(bytes: &[u8]) -> Option<u32> {
    const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);
    const SMALL: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC);
    let (before, after) = (bytes.get(..CHECKSUM_AT)?, bytes.get(CHECKSUM_AT + 4..)?);
    // A device that knows few codes has no room for the table of 1 KB.
    if K::ONLY_EXPONENTIAL {
        let mut digest = SMALL.digest();
        digest.update(before);
        digest.update(after);
        Some(digest.finalize())
    } else {
        let mut digest = CRC.digest();
        digest.update(before);
        digest.update(after);
        Some(digest.finalize())
    }
}

/// Where the parts lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Layout {
    steps: u64,
    names: u64,
    codes: u64,
    tiles: u64,
    surfaces: u64,
    faces: u64,
    elements: u64,
    end: u64,
}

/// The counts of a header.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct CountsOf {
    elements: u32,
    lights: u32,
    names: u32,
    tiles: u32,
    surfaces: u32,
    faces: u32,
}

impl CountsOf {
    /// Offsets in `u64`, with so many bytes of codes per element, and of steps per light; `None` when even those overflow.
    fn layout(&self, stride: u64, steps: usize) -> Option<Layout> {
        let [n, k] = [u64::from(self.elements), u64::from(self.lights)];
        let begin = HEADER_BYTES as u64 + k * LIGHT_BYTES as u64;
        let names = begin + k * steps as u64;
        let codes = names + u64::from(self.names);
        let tiles = codes.checked_add(n.checked_mul(stride)?)?;
        let surfaces = tiles.checked_add(self.tiles.into())?;
        let faces = surfaces.checked_add(u64::from(self.surfaces) * SURFACE_BYTES as u64)?;
        let elements = faces.checked_add(u64::from(self.faces) * FACE_BYTES as u64)?;
        let stored = if self.faces > 0 { n } else { 0 };
        Some(Layout {
            steps: begin,
            names,
            codes,
            tiles,
            surfaces,
            faces,
            elements,
            end: elements.checked_add(stored * ELEMENT_BYTES as u64)?,
        })
    }
}

#[cfg(test)]
mod tests;
