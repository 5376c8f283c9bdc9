//! A result as it is stored: floats, half floats, 8-bit codes.

use half::f16;
use relume::atlas::{Atlas, Quantity};
use relume::code::Code;
use relume::color::Rgb;

use super::AccuracyError;
use super::ways::Way;
use crate::pack::{Format, PackError, contributions, pack};
use crate::solution::Solution;

/// How a result is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Storage {
    /// As it is baked.
    F32,
    /// As half floats, with a power of two for each light.
    F16,
    /// In the default code of an atlas.
    Exp8s,
}

impl Storage {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::F32, Self::F16, Self::Exp8s];

    /// The ways to store what a way bakes: all for the default, else floats.
    pub(super) const fn of(way: &Way) -> &'static [Self] {
        if way.is_default {
            &Self::ALL
        } else {
            &[Self::F32]
        }
    }

    /// Its name in files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::F32 => "f32",
            Self::F16 => "f16",
            Self::Exp8s => "exp8s",
        }
    }

    /// Bytes of a contribution.
    #[must_use]
    pub const fn bytes(self) -> usize {
        match self {
            Self::F32 => 12,
            Self::F16 => 6,
            Self::Exp8s => 3,
        }
    }

    /// The contributions as they are read again.
    pub(super) fn stored(self, solution: &Solution) -> Result<Vec<Rgb>, AccuracyError> {
        Ok(match self {
            Self::F32 => solution.contributions.clone(),
            Self::F16 => as_f16(&solution.contributions, solution.lights.len()),
            Self::Exp8s => {
                let format = Format {
                    packing: Code::Exp8s.into(),
                    quantity: Quantity::Irradiance,
                    mesh: false,
                };
                contributions(&Atlas::parse(&pack(solution, format)?)?).map_err(PackError::from)?
            }
        })
    }
}

/// Half floats, with a power of two for every light that brings its largest value below 2^15.
fn as_f16(contributions: &[Rgb], lights: usize) -> Vec<Rgb> {
    let mut largest = vec![f32::MIN_POSITIVE; lights];
    for values in contributions.chunks(lights.max(1)) {
        for (largest, value) in largest.iter_mut().zip(values) {
            *largest = largest.max(value.max_channel());
        }
    }
    let scales: Vec<f32> = largest
        .iter()
        .map(|v| (15.0 - v.log2().ceil()).exp2())
        .collect();
    let values = contributions.iter().zip(scales.iter().cycle());
    values
        .map(|(value, scale)| value.map(|v| f16::from_f32(v * scale).to_f32() / scale))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_floats_keep_eleven_bits_of_bright_and_of_dim_lights() {
        let values = [1.0, 3e-4, 0.7, 5e-9, 0.123, 2e-9];
        let values = values.map(|v| Rgb::new(v, v / 3.0, v / 50.0));
        let stored = as_f16(&values, 2);
        for (exact, found) in values.iter().zip(&stored) {
            for (exact, found) in exact.to_array().into_iter().zip(found.to_array()) {
                assert!(
                    (found / exact - 1.0).abs() <= 1.0 / 2048.0,
                    "{exact} {found}"
                );
            }
        }
    }
}
