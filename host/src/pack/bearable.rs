//! What of a value's neighbourhood a display bears in its place.
//!
//! At a tolerance `t` another value may stand for one that it is off from in
//!
//! * its light alone in its own colour, where `2 t` display codes are bearable,
//! * its channel alone, where `3 t` are: then the exposure follows the luminance, `0.2126 R + 0.7152 G + 0.0722 B`, and blue is
//!   up to 14 times overexposed,
//! * its light among all others at their nominal emission, 16 times overexposed, where `3 t` are,
//! * all three of what is shown, with the reflectance of the element,
//! * above white any state, if the relative error times 112.09 is at most `2.2 t`: that is the display error where this light is
//!   dimmed among others and dominates an element.
//!
//! Mixes of several lights are off by the sum of what their lights are off by; see [`rounding`](super::rounding).

use relume::atlas::Quantity;
use relume::code::srgb_linear;
use relume::color::Rgb;

use super::Source;
use crate::display_error::{Solo, shown_code};
use crate::picture::white;
use crate::solution::Solution;

/// Display codes per relative error at white: `255 * 1.055 / 2.4`.
const CODES_PER_RATIO: f32 = 112.093_75;

/// A light of one channel only.
const PRIMARIES: [Rgb; 3] = [
    Rgb::new(1.0, 0.0, 0.0),
    Rgb::new(0.0, 1.0, 0.0),
    Rgb::new(0.0, 0.0, 1.0),
];

/// Bearable display errors of a light alone, in its colour and in a primary, and among all others when overexposed.
pub(super) const BEARABLE: [f32; STATES] = [2.0, 3.0, 3.0];

/// Exposure in the last of these states, over that which suits it.
const OVEREXPOSED: f32 = 16.0;

/// States in which a value is judged.
pub(super) const STATES: usize = 3;

/// What shows as white in every state, packed and shown.
pub(super) type States = [[f32; 2]; STATES];

/// Bearable relative error above white, times [`CODES_PER_RATIO`].
const BEARABLE_RATIO: f32 = 2.2;

/// The state of all lights at their nominal emission.
pub(super) fn all_on<'a>(
    solution: &Solution,
    values: &'a [Rgb],
) -> impl Iterator<Item = Rgb> + Clone + 'a {
    let nominal = solution.nominal_mix();
    values.chunks(nominal.len().max(1)).map(move |values| {
        let weighted = values.iter().zip(&nominal);
        weighted.fold(Rgb::BLACK, |sum, (value, weight)| sum + *value * *weight)
    })
}

/// What `display8` needs to know of all lights together.
pub(super) struct Stage {
    /// Reflectances of the elements, 1 where they are multiplied in.
    pub(super) reflectances: Vec<Rgb>,
    /// What shows as white with all lights on, 16 times overexposed: packed and shown.
    pub(super) overexposed: [f32; 2],
}

impl Stage {
    pub(super) fn new(source: &Source) -> Self {
        let solution = source.solution;
        let reflectances: Vec<Rgb> = match source.quantity {
            Quantity::Irradiance => {
                let elements = solution.mesh.elements.iter();
                elements.map(|element| element.reflectance).collect()
            }
            Quantity::Radiosity | Quantity::Radiance => {
                vec![Rgb::WHITE; solution.element_count()]
            }
        };
        let all_on: Vec<Rgb> = all_on(solution, &source.values).collect();
        let overexposed = whites(all_on.iter().copied(), &reflectances);
        Self {
            reflectances,
            overexposed: overexposed.map(|white| white / OVEREXPOSED),
        }
    }

    /// White of a light alone: what is packed or, if that is less, what the brightest surface shows as white.
    pub(super) fn white(&self, own: impl Iterator<Item = Rgb> + Clone) -> f32 {
        let reflectances = self.reflectances.iter().map(|rho| rho.max_channel());
        let brightest = reflectances.fold(0.0, f32::max);
        let [packed, shown] = whites(own, &self.reflectances);
        // Where nothing is shown, nothing is off.
        if shown > 0.0 {
            packed.min(shown / brightest)
        } else {
            packed
        }
    }

    /// For every channel of a light what shows as white in each state, in units of the light.
    pub(super) fn states(&self, own: &[Rgb], emission: Rgb) -> [States; 3] {
        let alone =
            |weight: Rgb| whites(own.iter().map(|value| *value * weight), &self.reflectances);
        let nominal = Solo::Nominal.weight(emission);
        let in_nominal = alone(nominal);
        [0, 1, 2].map(|channel| {
            let at = |rgb: Rgb| rgb.to_array()[channel];
            // A light that lacks this channel shows it in its primary only.
            let nominal = in_nominal.map(|white| white / at(nominal));
            let overexposed = self.overexposed.map(|white| white / at(emission));
            [nominal, alone(PRIMARIES[channel]), overexposed]
        })
    }
}

/// What shows as white in a state: packed and shown.
fn whites(lit: impl Iterator<Item = Rgb> + Clone, reflectances: &[Rgb]) -> [f32; 2] {
    let shown = lit.clone().zip(reflectances);
    [white(lit), white(shown.map(|(value, rho)| value * *rho))]
}

/// The display code of a value over white, above it too; within 3e-4.
pub(super) fn continued_code(u: f32) -> f32 {
    if u < 1.0 {
        shown_code(u)
    } else {
        255.0 + CODES_PER_RATIO * u.ln()
    }
}

/// A value for which levels are sought.
#[derive(Clone, Copy)]
pub(super) struct Sample {
    pub(super) value: f32,
    /// What shows it as white in every state, packed and shown.
    whites: [[f32; 2]; STATES],
    /// Its display codes then.
    shown: [[f32; 2]; STATES],
}

impl Sample {
    /// A value on a reflectance, with the whites of its light.
    pub(super) fn new(value: f32, reflectance: f32, whites: [[f32; 2]; STATES]) -> Self {
        let whites = whites.map(|[packed, shown]| [packed, shown / reflectance]);
        Self {
            value,
            whites,
            shown: whites.map(|whites| whites.map(|white| shown_code(value / white))),
        }
    }

    /// From the smallest to the largest value that may take its place.
    pub(super) fn interval(&self, tolerance: f32) -> [f32; 2] {
        let [mut low, mut high] = [0.0_f32, f32::INFINITY];
        if self.value > self.whites[0][0] {
            let ratio = tolerance * BEARABLE_RATIO / CODES_PER_RATIO;
            [low, high] = [self.value * (1.0 - ratio), self.value * (1.0 + ratio)];
        }
        let states = self.whites.iter().zip(&self.shown).zip(BEARABLE);
        let states = states.flat_map(|((whites, shown), bearable)| {
            let both = whites.iter().zip(shown);
            both.map(move |(white, shown)| (*white, *shown, bearable * tolerance))
        });
        // A colour or a place that shows nothing bears everything.
        for (white, shown, bearable) in
            states.filter(|(white, ..)| white.is_finite() && *white > 0.0)
        {
            low = low.max(white * linear(shown - bearable));
            // The nearest level is taken, even where one that is clipped would do better.
            if shown < WHITEST {
                high = high.min(white * linear(shown + bearable));
            }
        }
        [low.min(self.value), high.max(self.value)]
    }
}

/// The display code of white.
const WHITEST: f32 = 255.0;

/// The value over white of a display code, above white too.
fn linear(code: f32) -> f32 {
    if code < WHITEST {
        srgb_linear((code.max(0.0) * 4096.0) as u32) as f32 / 2_147_483_648.0
    } else {
        ((code - WHITEST) / CODES_PER_RATIO).exp()
    }
}
