//! From a solution to an atlas and back, and what the packing costs.

mod bearable;
mod choose;
mod curves;
mod measure;
mod order;
mod rounding;
mod tiles;
mod unpack;

use std::borrow::Cow;
use std::fmt;

use relume::atlas::{self, Atlas, AtlasError, Contents, LightEntry, Quantity, WorstError};
use relume::code::Code;
use relume::color::Rgb;
use relume::relight::{DecodeTable, RelightError, relight, table_length};
use thiserror::Error;

use crate::solution::Solution;

pub use choose::{Aim, Candidate, Choice, Judged, Request, choose};
pub use measure::PackingError;
pub(crate) use measure::{LANES, Lanes, relit, weights};
pub use unpack::{TooLarge, contributions, unpack};

/// How a light is packed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Packing {
    /// The code.
    pub code: Code,
    /// Display codes of a step, in `tiles`.
    pub step: f32,
    /// From where on steps are logarithmic, in `tiles`: a share of the light's own white.
    pub white: f32,
}

impl From<Code> for Packing {
    fn from(code: Code) -> Self {
        Self {
            code,
            step: 1.85,
            white: 1.0,
        }
    }
}

/// Display codes in an octave above white: `255 * 1.055 / 2.4 ln 2`.
const CODES_PER_OCTAVE: f32 = 77.697_47;

impl fmt::Display for Packing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.code.fmt(f)?;
        if self.code == Code::Tiles {
            let (step, white) = (self.step, self.white);
            write!(
                f,
                " (steps of {step:.3} codes, ratios above {white} of white)"
            )?;
        }
        Ok(())
    }
}

/// How to pack a solution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Format {
    /// How every light is packed.
    pub packing: Packing,
    /// Irradiance, or radiosity with the reflectance multiplied in.
    pub quantity: Quantity,
    /// Whether the atlas carries the mesh.
    pub mesh: bool,
}

/// Why a solution was not packed.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum PackError {
    /// The atlas refused.
    #[error(transparent)]
    Atlas(#[from] AtlasError),
    /// A contribution or emission of this light cannot be scaled.
    #[error(
        "light {0:?}: its values leave the range that can be packed; scale its emission, or the picture"
    )]
    Scale(String),
    /// The sum of the lights is infinite in some state.
    #[error(
        "its lights add up to more than a 32-bit float holds; scale their emission, or the picture"
    )]
    Overflow,
    /// Nothing keeps the error that is wanted.
    #[error(
        "no packing stays within {limit} display codes; the most exact one, {best}, is off by {error:.3}: allow as much"
    )]
    TooExact {
        /// What was wanted.
        limit: f32,
        /// The most exact one.
        best: Packing,
        /// Its error.
        error: f32,
    },
    /// Nothing is as small as is wanted.
    #[error(
        "no packing fits {budget} bytes; the smallest one, {best}, takes {bytes}: give as many, leave out the mesh, or use longer elements"
    )]
    TooSmall {
        /// What was wanted.
        budget: usize,
        /// The smallest one.
        best: Packing,
        /// What it takes.
        bytes: usize,
    },
    /// A state of the lights cannot be relit.
    #[error(transparent)]
    Relight(#[from] RelightError),
    /// What was packed cannot be measured.
    #[error(transparent)]
    TooLarge(#[from] TooLarge),
}

/// Packs a solution; the atlas states what that cost.
///
/// # Errors
/// [`PackError`] when counts or values leave the format's range.
pub fn pack(solution: &Solution, format: Format) -> Result<Vec<u8>, PackError> {
    let (bytes, _) = pack_measured(solution, format)?;
    Ok(bytes)
}

/// The same, with all that was measured.
///
/// # Errors
/// [`PackError`] when counts or values leave the format's range.
pub fn pack_measured(
    solution: &Solution,
    format: Format,
) -> Result<(Vec<u8>, PackingError), PackError> {
    let packings = vec![format.packing; solution.lights.len()];
    pack_lights(solution, &packings, format.quantity, format.mesh)
}

/// The same, with a packing for every light.
///
/// # Errors
/// [`PackError`] when counts or values leave the format's range.
pub fn pack_lights(
    solution: &Solution,
    packings: &[Packing],
    quantity: Quantity,
    mesh: bool,
) -> Result<(Vec<u8>, PackingError), PackError> {
    let source = Source::new(solution, quantity);
    let packed = Packed::new(&source, packings)?;
    let error = measure::measure(&source, &packed.decoded()?, f32::INFINITY);
    Ok((packed.write(mesh, Some(&error))?, error))
}

/// An atlas of irradiance, or of a picture, without a mesh, whose errors nobody measured.
///
/// # Errors
/// [`PackError`] when counts or values leave the format's range.
pub fn pack_unmeasured(solution: &Solution, packing: Packing) -> Result<Vec<u8>, PackError> {
    let source = Source::new(solution, Quantity::Irradiance);
    let packings = vec![packing; solution.lights.len()];
    Ok(Packed::new(&source, &packings)?.write(false, None)?)
}

/// Compares an atlas with the solution that it was packed from.
///
/// # Errors
/// [`PackError::Relight`] when the atlas belongs to another solution, [`PackError::TooLarge`] when memory does not
/// hold it twice.
pub fn packing_error(solution: &Solution, atlas: &Atlas) -> Result<PackingError, PackError> {
    let (elements, lights) = (solution.element_count(), solution.lights.len());
    if atlas.element_count() as usize != elements {
        let expected = elements as u32;
        return Err(RelightError::Elements { expected }.into());
    }
    if atlas.light_count() as usize != lights {
        let expected = lights as u32;
        return Err(RelightError::Lights { expected }.into());
    }
    let source = Source::new(solution, atlas.quantity());
    let decoded = contributions(atlas)?;
    Ok(measure::measure(&source, &decoded, f32::INFINITY))
}

/// What is to be packed.
struct Source<'a> {
    solution: &'a Solution,
    quantity: Quantity,
    /// Element by element, light by light, with the reflectance multiplied in for radiosity.
    values: Cow<'a, [Rgb]>,
}

impl<'a> Source<'a> {
    /// A picture is radiance, whatever is asked for.
    fn new(solution: &'a Solution, quantity: Quantity) -> Self {
        let quantity = solution.image.map_or(quantity, |_| Quantity::Radiance);
        let lights = solution.lights.len().max(1);
        let elements = solution.mesh.elements.iter();
        let values = match quantity {
            Quantity::Irradiance | Quantity::Radiance => Cow::Borrowed(&solution.contributions[..]),
            Quantity::Radiosity => elements
                .zip(solution.contributions.chunks(lights))
                .flat_map(|(element, values)| values.iter().map(|v| *v * element.reflectance))
                .collect(),
        };
        Self {
            solution,
            quantity,
            values,
        }
    }
}

/// Everything that is encoded once, whatever stands around it in an atlas.
struct Packed<'a> {
    source: &'a Source<'a>,
    entries: Vec<LightEntry<'a>>,
    /// What is encoded in the place of the source's values.
    values: Cow<'a, [Rgb]>,
    tiles: Vec<u8>,
}

impl<'a> Packed<'a> {
    /// Encodes a source, each light in a packing of its own.
    fn new(source: &'a Source<'a>, packings: &[Packing]) -> Result<Self, PackError> {
        let entries = curves::entries(source, packings)?;
        let values = rounding::rounded(source, &entries);
        let tiles = tiles::encode(source.solution, &entries, &values);
        Ok(Self {
            source,
            entries,
            values,
            tiles,
        })
    }

    fn contents<'b>(
        &'b self,
        with_mesh: bool,
        errors: Option<(WorstError, &'b [f32])>,
    ) -> Contents<'b> {
        let solution = self.source.solution;
        Contents {
            quantity: self.source.quantity,
            lights: &self.entries,
            elements: solution.element_count() as u32,
            // A picture that is read has no side above 16384.
            image_width: solution.image.map_or(0, |[width, _]| width as u16),
            errors,
            tiles: &self.tiles,
            // A picture has none.
            mesh: (with_mesh && solution.image.is_none())
                .then(|| (&solution.surfaces[..], solution.mesh.view())),
        }
    }

    /// Bytes of the whole atlas.
    fn size(&self, with_mesh: bool) -> Result<usize, AtlasError> {
        atlas::size(&self.contents(with_mesh, None))
    }

    /// The bytes of an atlas, with its errors once they are known.
    fn write(&self, with_mesh: bool, error: Option<&PackingError>) -> Result<Vec<u8>, AtlasError> {
        let errors = error.map(|error| (error.all, &error.per_light[..]));
        let contents = self.contents(with_mesh, errors);
        let mut bytes = vec![0; atlas::size(&contents)?];
        let (lights, values) = (self.entries.len(), &self.values);
        let contribution =
            |element: u32, light: u32| values[element as usize * lights + light as usize];
        atlas::write(&contents, contribution, &mut bytes)?;
        Ok(bytes)
    }

    /// What a reader makes of it.
    fn decoded(&self) -> Result<Vec<Rgb>, PackError> {
        Ok(contributions(&Atlas::parse(&self.write(false, None)?)?)?)
    }
}

/// Irradiance (or radiosity, whichever it holds) of every element of an atlas under a mix.
///
/// # Errors
/// [`RelightError`] for a mix that does not fit the atlas.
pub fn relight_atlas(atlas: &Atlas, mix: &[Rgb]) -> Result<Vec<Rgb>, RelightError> {
    let mut values = vec![0.0; table_length(atlas)];
    let mut relit = vec![Rgb::BLACK; atlas.element_count() as usize];
    let table = DecodeTable::new(atlas, &mut values)?;
    relight(atlas, &table, mix, &mut relit)?;
    Ok(relit)
}
