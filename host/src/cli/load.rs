//! Solutions and atlases from files, told apart by their first bytes.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result, anyhow, bail};
use relume::atlas::{Atlas, Quantity};
use relume::color::Rgb;

use super::tell;
use crate::export::exr::read_light_layers;
use crate::export::light_layers::contributions;
use crate::pack::{relight_atlas, unpack};
use crate::solution::{self, Solution};

/// How an OpenEXR file starts.
const EXR: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];

/// What a file holds.
pub enum Loaded {
    /// Contributions in `f32`; those of a picture with a layer per light are radiances.
    Solution(Solution),
    /// Packed contributions, decoded, and the bytes that they came from.
    Atlas {
        /// The bytes, known to be a valid atlas.
        bytes: Vec<u8>,
        /// Their contents.
        solution: Solution,
        /// What the contributions measure.
        quantity: Quantity,
    },
}

/// Reads a solution or an atlas.
pub fn load(path: &Path) -> Result<Loaded> {
    let bytes = read(path)?;
    if bytes.starts_with(&solution::MAGIC) {
        let solution = solution::read(&bytes).with_context(|| path.display().to_string())?;
        return Ok(Loaded::Solution(solution));
    }
    if bytes.starts_with(&EXR) {
        let (solution, repaired) = contributions(&read_light_layers(path)?);
        if repaired > 0 {
            tell!(
                "{}: {repaired} values were negative or not finite; they are dark now",
                path.display()
            );
        }
        return Ok(Loaded::Solution(solution));
    }
    if !bytes.starts_with(&relume::atlas::MAGIC) {
        bail!(
            "{}: neither a solution nor an atlas, nor an OpenEXR picture; make one with `relume bake` or `relume pack`",
            path.display()
        );
    }
    let atlas = Atlas::parse(&bytes).with_context(|| path.display().to_string())?;
    Ok(Loaded::Atlas {
        solution: unpack(&atlas).with_context(|| path.display().to_string())?,
        quantity: atlas.quantity(),
        bytes,
    })
}

pub fn read(path: &Path) -> Result<Vec<u8>> {
    fs::read(path).map_err(|error| anyhow!("{}: cannot be read: {error}", path.display()))
}

impl Loaded {
    /// The contributions and the mesh.
    pub const fn solution(&self) -> &Solution {
        match self {
            Self::Solution(solution) | Self::Atlas { solution, .. } => solution,
        }
    }

    /// What light can be gathered from: the solution that `path` holds.
    pub fn to_gather(&self, path: &Path) -> Result<&Solution> {
        match self {
            Self::Solution(solution) => Ok(solution),
            Self::Atlas { .. } => bail!(
                "{}: an atlas does not keep what --gather needs; take the solution that it was packed \
                 from",
                path.display()
            ),
        }
    }

    /// The quantity of every element under a mix, by the kernel that belongs to the file.
    pub fn relight(&self, mix: &[Rgb]) -> Result<Vec<Rgb>> {
        match self {
            Self::Solution(solution) => Ok(solution.relight(mix)),
            Self::Atlas { bytes, .. } => Ok(relight_atlas(&Atlas::parse(bytes)?, mix)?),
        }
    }

    /// True when the reflectance is multiplied in already.
    pub const fn is_radiosity(&self) -> bool {
        matches!(
            self,
            Self::Atlas {
                quantity: Quantity::Radiosity,
                ..
            }
        )
    }
}
