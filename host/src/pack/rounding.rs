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
use super::bearable::{MORE_SHOWN, Sample, Stage, States};
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
                curves: entry.curves,
                last: entry.last,
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
    curves: [Curve; 3],
    last: [u16; 3],
    states: [States; 3],
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
    level: f32,
}

impl Place {
    /// Puts levels in the place of values until their sum is off by no more than is wanted.
    fn settle(&self, values: &mut [Rgb], lights: &[Light]) {
        let channel = self.channel;
        let terms = lights.iter().map(|light| {
            let (curve, last) = (light.curves[channel], light.last[channel]);
            let value = values[light.tag].to_array()[channel];
            let level = curve.decode(curve.encode(value, last));
            Term {
                light,
                value,
                level,
            }
        });
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
                let level = self.other_level(term)?;
                let moved = found + term.light.weight[channel] * (level - term.level);
                Some((self.off(exact, moved), index, level, moved))
            });
            let best = moves.min_by(|(a, ..), (b, ..)| a.total_cmp(b));
            let Some((_, index, level, moved)) = best.filter(|(left, ..)| *left < off) else {
                return;
            };
            found = moved;
            terms[index].level = level;
            let tag = terms[index].light.tag;
            let mut rgb = values[tag].to_array();
            rgb[channel] = level;
            values[tag] = Rgb::from_array(rgb);
        }
    }

    /// By how many display codes a sum is off when it is overexposed; more is bearable of what is shown.
    fn off(&self, exact: f32, found: f32) -> f32 {
        let [packed, shown] = self.overexposed;
        let codes = |white: f32| (shown_code(exact / white) - shown_code(found / white)).abs();
        codes(packed).max(codes(shown / self.reflectance) / MORE_SHOWN)
    }

    /// The level on the other side of a value, if that bears it.
    fn other_level(&self, term: &Term) -> Option<f32> {
        let Term {
            light,
            value,
            level,
        } = *term;
        let (curve, last) = (light.curves[self.channel], light.last[self.channel]);
        let code = curve.encode(level, last);
        let other = if level < value {
            Some(code + 1).filter(|code| *code <= last)
        } else {
            code.checked_sub(1)
        };
        let other = curve.decode(other?);
        let sample = Sample::new(value, self.reflectance, light.states[self.channel]);
        let [low, high] = sample.interval(TOLERANCE);
        (low..=high).contains(&other).then_some(other)
    }
}
