//! From a solution to an atlas and back, and what the packing costs.

mod curves;
mod measure;
mod tiles;
mod unpack;

use relume::atlas::{self, Atlas, AtlasError, Contents, LightEntry, Quantity};
use relume::code::Code;
use relume::color::Rgb;
use relume::relight::{DecodeTable, RelightError, relight, table_length};
use thiserror::Error;

use crate::solution::Solution;

pub use measure::{PackingError, packing_error};
pub use unpack::{contributions, unpack};

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
    #[error("light {0:?}: its values leave the range that can be packed; change its emission")]
    Scale(String),
    /// A state of the lights cannot be relit.
    #[error(transparent)]
    Relight(#[from] RelightError),
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
    let bare = Packed::new(solution, &packings, format.quantity)?;
    let mesh = format.mesh;
    let error = packing_error(
        solution,
        &Atlas::parse(&bare.write(solution, false, None)?)?,
    )?;
    Ok((bare.write(solution, mesh, Some(&error))?, error))
}

/// Everything that is encoded once, whatever stands around it in an atlas.
struct Packed<'a> {
    quantity: Quantity,
    values: Vec<Rgb>,
    entries: Vec<LightEntry<'a>>,
    tiles: Vec<u8>,
}

impl<'a> Packed<'a> {
    /// Encodes a solution, each light in a packing of its own.
    fn new(
        solution: &'a Solution,
        packings: &[Packing],
        quantity: Quantity,
    ) -> Result<Self, PackError> {
        let values = packed_values(solution, quantity);
        let entries = curves::entries(solution, &values, packings)?;
        let tiles = tiles::encode(&solution.mesh, &entries, &values);
        Ok(Self {
            quantity,
            values,
            entries,
            tiles,
        })
    }

    /// The bytes of an atlas, with its errors once they are known.
    fn write(
        &self,
        solution: &Solution,
        with_mesh: bool,
        error: Option<&PackingError>,
    ) -> Result<Vec<u8>, AtlasError> {
        let contents = Contents {
            quantity: self.quantity,
            lights: &self.entries,
            elements: solution.mesh.elements.len() as u32,
            image_width: 0,
            errors: error.map(|error| (error.worst(), &error.per_light[..])),
            tiles: &self.tiles,
            mesh: with_mesh.then(|| (&solution.surfaces[..], solution.mesh.view())),
        };
        let mut bytes = vec![0; atlas::size(&contents)?];
        let lights = self.entries.len();
        let contribution =
            |element: u32, light: u32| self.values[element as usize * lights + light as usize];
        atlas::write(&contents, contribution, &mut bytes)?;
        Ok(bytes)
    }
}

/// The contributions, with the reflectance multiplied in for radiosity.
fn packed_values(solution: &Solution, quantity: Quantity) -> Vec<Rgb> {
    let lights = solution.lights.len().max(1);
    let elements = solution.mesh.elements.iter();
    match quantity {
        Quantity::Irradiance => solution.contributions.clone(),
        Quantity::Radiosity => elements
            .zip(solution.contributions.chunks(lights))
            .flat_map(|(element, values)| values.iter().map(|v| *v * element.reflectance))
            .collect(),
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
