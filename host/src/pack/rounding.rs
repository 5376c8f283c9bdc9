//! Levels of `display8` are chosen together where they add up.
//!
//! The sum of all lights at their nominal emissions `w_m` is off by `sum_m w_m (y_m - x_m)`, with the level `y_m` for
//! the value `x_m`. By itself every light takes the nearest level. Where the sum, 16 times overexposed, is then off by
//! more than [`MOST`] display codes, that light takes the level on the other side of its value which leaves the sum off
//! the least, among those whose value [bears](super::bearable) it; and so on until none makes it better.

use std::borrow::Cow;

use rayon::prelude::*;
use relume::atlas::LightEntry;
use relume::code::{Code, Curve};
use relume::color::Rgb;

use super::Source;
use super::bearable::{Sample, Stage, States};
use crate::display_error::shown_code;

/// Display codes that a sum may be off by when every light takes its nearest level.
const MOST: f32 = 1.5;

/// The tolerance at which a level is borne.
const TOLERANCE: f32 = 1.0;

/// The values to encode in place of the source's: where another level than the nearest is taken, that level itself.
pub(super) fn rounded<'a>(source: &'a Source, entries: &[LightEntry]) -> Cow<'a, [Rgb]> {
    let count = entries.len();
    if !entries.iter().any(|entry| entry.code == Code::Display8) {
        return Cow::Borrowed(&source.values);
    }
    let stage = Stage::new(source);
    let nominal = source.solution.nominal_mix();
    let lights = entries.par_iter().zip(nominal).enumerate();
    let lights: Vec<Light> = lights
        .filter(|(_, (entry, _))| entry.code == Code::Display8)
        .map(|(tag, (entry, nominal))| {
            let own = source.values.iter().skip(tag).step_by(count);
            let own: Vec<Rgb> = own.copied().collect();
            Light {
                tag,
                weight: nominal.to_array(),
                levels: entry.curves.map(levels),
                states: stage.states(&own, entry.emission),
            }
        })
        .collect();
    let mut values = source.values.to_vec();
    let elements = values.par_chunks_mut(count).zip(&stage.reflectances);
    elements.for_each(|(values, reflectance)| {
        for channel in 0..3 {
            let place = Place {
                channel,
                reflectance: reflectance.to_array()[channel],
                overexposed: stage.overexposed,
            };
            place.settle(values, &lights);
        }
    });
    Cow::Owned(values)
}

/// A light in `display8`.
struct Light {
    tag: usize,
    weight: [f32; 3],
    /// In ascending order.
    levels: [Vec<f32>; 3],
    states: [States; 3],
}

/// The values of all codes.
fn levels(curve: Curve) -> Vec<f32> {
    (0..=u8::MAX)
        .map(|code| curve.decode(code.into()))
        .collect()
}

/// A channel of an element.
struct Place {
    channel: usize,
    reflectance: f32,
    /// What shows as white, packed and shown.
    overexposed: [f32; 2],
}

/// What a light has there: its value, and the level in its place.
#[derive(Clone, Copy)]
struct Term<'a> {
    light: &'a Light,
    value: f32,
    code: usize,
    level: f32,
}

impl<'a> Term<'a> {
    /// With the nearest level.
    fn new(light: &'a Light, channel: usize, value: f32) -> Self {
        let levels = &light.levels[channel];
        let above = levels.partition_point(|level| *level < value);
        let near = [above.saturating_sub(1), above.min(levels.len() - 1)];
        let [low, high] = near.map(|code| (value - levels[code]).abs());
        let code = near[usize::from(high < low)];
        Self {
            light,
            value,
            code,
            level: levels[code],
        }
    }
}

impl Place {
    /// Puts levels in the place of values until their sum is off by no more than is wanted.
    fn settle(&self, values: &mut [Rgb], lights: &[Light]) {
        let channel = self.channel;
        let terms = lights
            .iter()
            .map(|light| Term::new(light, channel, values[light.tag].to_array()[channel]));
        let mut terms: Vec<Term> = terms.collect();
        let weighted = |of: fn(&Term) -> f32| -> f32 {
            let terms = terms.iter();
            terms
                .map(|term| term.light.weight[channel] * of(term))
                .sum()
        };
        let exact = weighted(|term| term.value);
        let mut found = weighted(|term| term.level);
        loop {
            let off = self.off(exact, found);
            if off <= MOST {
                return;
            }
            let moves = terms.iter().enumerate().filter_map(|(index, term)| {
                let other = self.other_side(term)?;
                let moved = found + term.light.weight[channel] * (other.level - term.level);
                Some((self.off(exact, moved), index, other, moved))
            });
            let best = moves.min_by(|(a, ..), (b, ..)| a.total_cmp(b));
            let Some((_, index, other, moved)) = best.filter(|(left, ..)| *left < off) else {
                return;
            };
            found = moved;
            terms[index] = other;
            let mut rgb = values[other.light.tag].to_array();
            rgb[channel] = other.level;
            values[other.light.tag] = Rgb::from_array(rgb);
        }
    }

    /// By how many display codes a sum is off when it is overexposed.
    fn off(&self, exact: f32, found: f32) -> f32 {
        let [packed, shown] = self.overexposed;
        let codes = |white: f32| (shown_code(exact / white) - shown_code(found / white)).abs();
        codes(packed).max(codes(shown / self.reflectance))
    }

    /// With the level on the other side of the value, if that bears it.
    fn other_side<'a>(&self, term: &Term<'a>) -> Option<Term<'a>> {
        let code = if term.level < term.value {
            term.code + 1
        } else {
            term.code.checked_sub(1)?
        };
        let level = *term.light.levels[self.channel].get(code)?;
        let states = term.light.states[self.channel];
        let sample = Sample::new(term.value, self.reflectance, states);
        let [low, high] = sample.interval(TOLERANCE);
        let other = Term {
            code,
            level,
            ..*term
        };
        (low..=high).contains(&level).then_some(other)
    }
}
