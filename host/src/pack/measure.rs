//! What packing cost.

use relume::atlas::{Atlas, Quantity, WorstError};
use relume::color::Rgb;

use super::unpack::contributions;
use super::{PackError, packed_values, relight_atlas};
use crate::display_error::{max_codes, test_mixes};
use crate::solution::Solution;

/// Errors of an atlas against its solution, in display codes.
#[derive(Clone, Debug, PartialEq)]
pub struct PackingError {
    /// Largest over all states, of what is packed.
    pub codes: f32,
    /// The state in which it occurs.
    pub worst_state: String,
    /// Largest over all states, of what is shown.
    pub codes_shown: f32,
    /// Largest with each light alone, in their order.
    pub per_light: Vec<f32>,
}

impl PackingError {
    /// What the atlas states of it.
    pub(super) const fn worst(&self) -> WorstError {
        WorstError {
            packed: self.codes,
            shown: self.codes_shown,
        }
    }
}

/// Compares an atlas with the solution that it was packed from, over the mixes of [`test_mixes`].
///
/// # Errors
/// [`PackError::Relight`] when the atlas belongs to another solution, [`PackError::TooLarge`] when memory does not
/// hold it twice.
pub fn packing_error(solution: &Solution, atlas: &Atlas) -> Result<PackingError, PackError> {
    let names: Vec<&str> = solution.lights.iter().map(|l| l.name.as_str()).collect();
    let values = packed_values(solution, atlas.quantity());
    let lights = solution.lights.len();
    let mut worst = PackingError {
        codes: 0.0,
        worst_state: String::new(),
        codes_shown: 0.0,
        per_light: Vec::new(),
    };
    let decoded = contributions(atlas)?;
    let mut all = vec![Rgb::BLACK; lights];
    for (state, number) in test_mixes(&solution.nominal_mix(), &names)
        .into_iter()
        .zip(0..)
    {
        let range = state.first..state.first + state.weights.len();
        let relit = |values: &[Rgb]| -> Vec<Rgb> {
            values
                .chunks(lights.max(1))
                .map(|values| {
                    let weighted = values[range.clone()].iter().zip(&state.weights);
                    weighted.fold(Rgb::BLACK, |sum, (value, weight)| sum + *value * *weight)
                })
                .collect()
        };
        let exact = relit(&values);
        // One light alone needs no kernel, which would read the codes of all the others.
        let found = if state.weights.len() == lights {
            relight_atlas(atlas, &state.weights)?
        } else {
            relit(&decoded)
        };
        let codes = max_codes(&exact, &found);
        all[range.clone()].copy_from_slice(&state.weights);
        let exitance = solution.face_exitance(&all);
        all[range].fill(Rgb::BLACK);
        let shown = |state: &[Rgb]| shown(solution, atlas.quantity(), state, &exitance);
        worst.codes_shown = worst
            .codes_shown
            .max(max_codes(&shown(&exact), &shown(&found)));
        if codes > worst.codes || worst.worst_state.is_empty() {
            worst.codes = codes;
            worst.worst_state = state.name;
        }
        if (1..=lights).contains(&number) {
            worst.per_light.push(codes);
        }
    }
    Ok(worst)
}

/// `M + rho E` of every element.
fn shown(solution: &Solution, quantity: Quantity, state: &[Rgb], exitance: &[Rgb]) -> Vec<Rgb> {
    let mesh = &solution.mesh;
    let elements = mesh.elements.iter().zip(state);
    elements
        .map(|(element, value)| {
            let face = mesh.patches[element.patch as usize].face;
            let reflected = match quantity {
                Quantity::Irradiance => element.reflectance * *value,
                Quantity::Radiosity => *value,
            };
            exitance[face as usize] + reflected
        })
        .collect()
}
