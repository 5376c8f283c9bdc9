//! A solution in each format, the atlas's own and others: what it takes, and what is read back.

use std::hint::black_box;

use anyhow::Result;
use relume::atlas::Atlas;
use relume::code::Code;
use relume::color::Rgb;
use relume::relight::{DecodeTable, relight, table_length};

use super::formats::{Coded, Half, Linear8, Log8, Rgb9e5, Rgbe, Scope, Sqrt8, Texel, TwoExposures};
use crate::pack::{Packing, contributions, pack_unmeasured};
use crate::solution::Solution;
use crate::study::paper::clock::tried;

/// Repeats of a timed relight, of which the fastest counts.
const REPEATS: usize = 15;

/// A format of contributions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Format {
    /// As an atlas holds them.
    Atlas(Packing),
    /// Uniform in 8 bits.
    Linear8(Scope),
    /// Uniform in square roots.
    Sqrt8,
    /// Uniform in logarithms.
    Log8,
    /// Half floats.
    F16,
    /// A shared exponent of 5 bits.
    Rgb9e5,
    /// A shared exponent of 8 bits.
    Rgbe,
    /// Two textures of 8 bits.
    TwoExposures,
}

impl Format {
    /// Every format: the atlas's codes, then those of others.
    #[must_use]
    pub fn all() -> Vec<Self> {
        let ours = Code::ALL.map(|code| Self::Atlas(code.into()));
        let others = [
            Self::Linear8(Scope::Light),
            Self::Linear8(Scope::All),
            Self::Sqrt8,
            Self::Log8,
            Self::F16,
            Self::Rgb9e5,
            Self::Rgbe,
            Self::TwoExposures,
        ];
        ours.into_iter().chain(others).collect()
    }

    /// Its name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Atlas(packing) => packing.code.name(),
            Self::Linear8(Scope::Light) => "linear8",
            Self::Linear8(Scope::All) => "linear8-global",
            Self::Sqrt8 => "sqrt8",
            Self::Log8 => "log8",
            Self::F16 => "f16",
            Self::Rgb9e5 => "rgb9e5",
            Self::Rgbe => "rgbe",
            Self::TwoExposures => "two-exposure",
        }
    }

    /// Puts a solution into the format and reads it back.
    ///
    /// # Errors
    /// A solution that an atlas cannot hold.
    pub fn store(self, solution: &Solution) -> Result<Stored> {
        match self {
            Self::Atlas(packing) => atlas(solution, packing),
            Self::Linear8(scope) => coded::<Linear8>(solution, scope),
            Self::Sqrt8 => coded::<Sqrt8>(solution, Scope::Light),
            Self::Log8 => coded::<Log8>(solution, Scope::Light),
            Self::F16 => coded::<Half>(solution, Scope::Light),
            Self::Rgb9e5 => coded::<Rgb9e5>(solution, Scope::Light),
            Self::Rgbe => coded::<Rgbe>(solution, Scope::Light),
            Self::TwoExposures => coded::<TwoExposures>(solution, Scope::Light),
        }
    }
}

/// A solution in some format.
#[derive(Clone, Debug)]
pub struct Stored {
    /// The contributions as they are read back.
    pub decoded: Vec<Rgb>,
    /// Bits of an element and light, all three channels together.
    pub bits_per_rgb: f64,
    /// Bytes of everything but a mesh: codes, names, scales, tables.
    pub bytes: usize,
    /// Nanoseconds to decode, weight and add a contribution, in `f32` and on one thread.
    pub nanoseconds: f64,
    /// Share of channels that are above zero and read back as zero.
    pub vanished: f64,
    /// Share of channels that have the saturated code of the exponential codes.
    pub saturated: f64,
}

/// The share of channels for which something holds of the value and what is read back.
fn share(solution: &Solution, decoded: &[Rgb], holds: impl Fn(f32, f32) -> bool) -> f64 {
    let values = solution.contributions.iter().zip(decoded);
    let channels =
        values.flat_map(|(value, found)| value.to_array().into_iter().zip(found.to_array()));
    let count = channels
        .filter(|(value, found)| holds(*value, *found))
        .count();
    count as f64 / (3 * decoded.len()).max(1) as f64
}

fn vanished(solution: &Solution, decoded: &[Rgb]) -> f64 {
    share(solution, decoded, |value, found| {
        value > 0.0 && found == 0.0
    })
}

/// Nanoseconds of the fastest repeat for each contribution.
pub fn per_contribution(contributions: usize, mut work: impl FnMut() -> Result<()>) -> Result<f64> {
    let mut fastest = f64::INFINITY;
    for _ in 0..REPEATS {
        fastest = fastest.min(tried(&mut work)?);
    }
    Ok(fastest * 1e9 / contributions.max(1) as f64)
}

fn atlas(solution: &Solution, packing: Packing) -> Result<Stored> {
    let bytes = pack_unmeasured(solution, packing)?;
    let atlas = Atlas::parse(&bytes)?;
    let decoded = contributions(&atlas)?;
    let mix = solution.nominal_mix();
    let mut values = vec![0.0; table_length(&atlas)];
    let table = DecodeTable::new(&atlas, &mut values)?;
    let mut irradiance = vec![Rgb::BLACK; solution.mesh.elements.len()];
    let nanoseconds = per_contribution(decoded.len(), || {
        relight(&atlas, &table, black_box(&mix), &mut irradiance)?;
        black_box(&irradiance);
        Ok(())
    })?;
    let mut saturated = 0_usize;
    if matches!(packing.code, Code::Exp8 | Code::Exp8s | Code::Lum8) {
        atlas.for_each(|_, _, codes| {
            saturated += codes
                .iter()
                .filter(|code| **code == u16::from(u8::MAX))
                .count();
        });
    }
    Ok(Stored {
        bits_per_rgb: 8.0 * atlas.code_bytes() as f64 / decoded.len().max(1) as f64,
        bytes: bytes.len(),
        nanoseconds,
        vanished: vanished(solution, &decoded),
        saturated: saturated as f64 / (3 * decoded.len()).max(1) as f64,
        decoded,
    })
}

fn coded<T: Texel>(solution: &Solution, scope: Scope) -> Result<Stored> {
    let coded = Coded::<T>::new(solution, scope);
    let decoded = coded.decoded();
    let mix = solution.nominal_mix();
    let mut irradiance = vec![Rgb::BLACK; solution.mesh.elements.len()];
    let nanoseconds = per_contribution(decoded.len(), || {
        coded.relight(black_box(&mix), &mut irradiance);
        black_box(&irradiance);
        Ok(())
    })?;
    let scales = size_of::<f32>() * mix.len();
    Ok(Stored {
        bits_per_rgb: T::BITS.into(),
        bytes: decoded.len() * T::BITS as usize / 8 + scales,
        nanoseconds,
        vanished: vanished(solution, &decoded),
        saturated: 0.0,
        decoded,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::quantization::scenes::tests::small;

    #[test]
    fn every_format_gives_back_what_was_stored_and_has_a_name_of_its_own() {
        let solution = small();
        let mut names = Vec::new();
        for format in Format::all() {
            let stored = format.store(&solution).unwrap();
            assert_eq!(stored.decoded.len(), solution.contributions.len());
            assert!(
                stored.nanoseconds > 0.0 && stored.bits_per_rgb > 0.0,
                "{format:?}"
            );
            assert!(stored.bytes as f64 >= stored.bits_per_rgb / 8.0 * stored.decoded.len() as f64);
            // Irradiance of a lit room: nowhere may a bright value be lost. Luminance alone loses colours.
            let largest = solution
                .contributions
                .iter()
                .map(|v| v.g)
                .fold(0.0, f32::max);
            let values = solution.contributions.iter().zip(&stored.decoded);
            let off = values
                .map(|(value, found)| (value.g - found.g).abs())
                .fold(0.0, f32::max);
            assert!(off < 0.2 * largest, "{format:?}: {off} of {largest}");
            names.push(format.name());
        }
        let count = names.len();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), count);
    }

    #[test]
    fn a_common_scale_loses_a_dim_light_and_own_scales_do_not() {
        let mut solution = small();
        let lights = solution.lights.len();
        for value in solution.contributions.iter_mut().step_by(lights) {
            *value = *value * 1e-4;
        }
        let lost = |format: Format| format.store(&solution).unwrap().vanished;
        assert!(lost(Format::Linear8(Scope::All)) > 0.9 / lights as f64);
        assert!(lost(Format::Atlas(Code::Exp8.into())) > 0.9 / lights as f64);
        assert!(lost(Format::Linear8(Scope::Light)) < 0.5 / lights as f64);
    }
}
