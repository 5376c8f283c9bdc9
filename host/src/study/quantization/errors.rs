//! How far relit irradiance is off in many states, for several packings of one solution at once.
//!
//! The states are those of [`crate::display_error`]. Maxima are over elements, channels and states, in display codes;
//! the mean is that of all differences in the achromatic mixed states, but for those in which all is dark. The relative error is
//! `sqrt(mean over those states of sum (found - exact)^2 / sum exact^2)`, sums over elements and channels.

use rayon::prelude::*;
use relume::color::Rgb;
use relume::tone::Exposure;

use crate::display_error::{Mixed, Solo, shown_code};
use crate::pack::{LANES, Lanes, relit, weights};
use crate::picture::white;
use crate::solution::Solution;

/// Errors of one packing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Errors {
    /// Largest where lights dim: all on, and all random dimmings.
    pub max_random: f32,
    /// Largest with a light alone in its own colour.
    pub max_solo: f32,
    /// Largest in all states: pure and random colours, overexposed and dimmed ones, too.
    pub max_all: f32,
    /// Mean where lights dim.
    pub mean: f64,
    /// Relative error where lights dim.
    pub relative_rms: f64,
}

/// Errors of one state.
#[derive(Clone, Copy, Debug, Default)]
struct Tally {
    max: f32,
    /// Of all elements and channels.
    mean: f64,
    /// Squared relative error; `None` where all is dark.
    relative: Option<f64>,
}

impl Tally {
    /// Compares a state with the exact one.
    fn new(exposure: f32, exact: &[Rgb], found: impl Iterator<Item = Rgb>) -> Self {
        let mut tally = Self::default();
        let (mut off, mut power) = (0.0, 0.0);
        for (exact, found) in exact.iter().zip(found) {
            for (exact, found) in exact.to_array().into_iter().zip(found.to_array()) {
                let codes = shown_code(found * exposure) - shown_code(exact * exposure);
                tally.max = tally.max.max(codes.abs());
                tally.mean += f64::from(codes.abs());
                off += f64::from(found - exact).powi(2);
                power += f64::from(exact).powi(2);
            }
        }
        tally.mean /= (3 * exact.len()).max(1) as f64;
        tally.relative = (power > 0.0).then(|| off / power);
        tally
    }
}

/// Compares what was read back of several packings, which stand as the contributions do, with the solution.
#[must_use]
pub fn compare(solution: &Solution, decoded: &[&[Rgb]]) -> Vec<Errors> {
    let states: Vec<Mixed> = Mixed::all().collect();
    let mixed: Vec<Vec<Tally>> = states
        .par_chunks(LANES)
        .flat_map_iter(|states| block(solution, decoded, states))
        .collect();
    let lights: Vec<usize> = (0..solution.lights.len()).collect();
    let alone: Vec<[Vec<Tally>; 4]> = lights
        .par_iter()
        .map(|light| solos(solution, decoded, *light))
        .collect();
    let of = |packing: usize| {
        let mut errors = Errors::default();
        let mut count = 0_u32;
        for (state, tallies) in states.iter().zip(&mixed) {
            let tally = tallies[packing];
            errors.max_all = errors.max_all.max(tally.max);
            if let Some(relative) = tally.relative.filter(|_| state.is_achromatic()) {
                errors.max_random = errors.max_random.max(tally.max);
                errors.mean += tally.mean;
                errors.relative_rms += relative;
                count += 1;
            }
        }
        for (solo, tallies) in alone.iter().flat_map(|alone| Solo::ALL.iter().zip(alone)) {
            let max = tallies[packing].max;
            errors.max_all = errors.max_all.max(max);
            if solo.is_achromatic() {
                errors.max_solo = errors.max_solo.max(max);
            }
        }
        errors.mean /= f64::from(count.max(1));
        errors.relative_rms = (errors.relative_rms / f64::from(count.max(1))).sqrt();
        errors
    };
    (0..decoded.len()).map(of).collect()
}

/// Every packing in each of some states, at most [`LANES`].
fn block(solution: &Solution, decoded: &[&[Rgb]], states: &[Mixed]) -> Vec<Vec<Tally>> {
    let weights = weights(&solution.nominal_mix(), states);
    let relit = |values: &[Rgb]| -> Vec<Lanes> {
        let elements = values.chunks(weights.len().max(1));
        elements.map(|values| relit(values, &weights)).collect()
    };
    let exact = relit(&solution.contributions);
    let found: Vec<Vec<Lanes>> = decoded.iter().map(|values| relit(values)).collect();
    let judged = states.iter().enumerate().map(|(lane, state)| {
        let of = |lanes: &Lanes| Rgb::from_array(lanes.map(|channel| channel[lane]));
        let exact: Vec<Rgb> = exact.iter().map(of).collect();
        let exposure = exposure(&exact) * state.brightness();
        let tallies = found.iter().map(|found| {
            let found = found.iter().map(of);
            Tally::new(exposure, &exact, found)
        });
        tallies.collect()
    });
    judged.collect()
}

/// Every packing with one light alone, in every colour.
fn solos(solution: &Solution, decoded: &[&[Rgb]], light: usize) -> [Vec<Tally>; 4] {
    let column = |values: &[Rgb]| -> Vec<Rgb> {
        let own = values.iter().skip(light).step_by(solution.lights.len());
        own.copied().collect()
    };
    let exact = column(&solution.contributions);
    let found: Vec<Vec<Rgb>> = decoded.iter().map(|values| column(values)).collect();
    Solo::ALL.map(|solo| {
        let weight = solo.weight(solution.lights[light].emission);
        let exact: Vec<Rgb> = exact.iter().map(|value| *value * weight).collect();
        let exposure = exposure(&exact);
        let tallies = found.iter().map(|found| {
            let found = found.iter().map(|value| *value * weight);
            Tally::new(exposure, &exact, found)
        });
        tallies.collect()
    })
}

/// What puts the white of a state at 1.
pub fn exposure(exact: &[Rgb]) -> f32 {
    Exposure::for_white(white(exact.iter().copied())).factor()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pack::{Format, contributions, pack_measured};
    use crate::study::quantization::scenes::tests::small;
    use relume::atlas::{Atlas, Quantity};
    use relume::code::Code;

    #[test]
    fn errors_are_those_that_packing_states() {
        let solution = small();
        for code in Code::ALL {
            let format = Format {
                packing: code.into(),
                quantity: Quantity::Irradiance,
                mesh: false,
            };
            let (bytes, stated) = pack_measured(&solution, format).unwrap();
            let decoded = contributions(&Atlas::parse(&bytes).unwrap()).unwrap();
            let [errors] = compare(&solution, &[&decoded])[..] else {
                panic!("one packing");
            };
            assert_eq!(errors.max_all, stated.all.packed, "{code}");
            let achromatic = errors.max_random.max(errors.max_solo);
            assert_eq!(achromatic, stated.achromatic.packed, "{code}");
        }
    }

    #[test]
    fn relative_errors_and_means_are_those_of_a_known_difference() {
        let solution = small();
        let brighter: Vec<Rgb> = solution.contributions.iter().map(|v| *v * 1.01).collect();
        let same = &solution.contributions[..];
        let [off, none] = compare(&solution, &[&brighter, same])[..] else {
            panic!("two packings");
        };
        assert_eq!(none, Errors::default());
        assert!((off.relative_rms - 0.01).abs() < 1e-5, "{off:?}");
        // One per cent is 112.09 * 0.01 codes at white, less below it.
        assert!((1.0..=1.125).contains(&off.max_random), "{off:?}");
        assert!(off.mean > 0.1 && off.mean < 1.12, "{off:?}");
    }
}
