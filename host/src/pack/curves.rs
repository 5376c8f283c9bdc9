//! What the codes of every light stand for.
//!
//! `exp8` has one scale, as published; `exp8s` and `lum8` put the largest value of a light at their top.
//! `display8` has 256 levels for every channel of a light. Where its white lies decides what they are spent on: below it steps are
//! uniform on a display that this light alone exposes, above it they are uniform in ratio, which is what counts when
//! the light is one of many, or when it shines in one primary: then the exposure follows
//! the luminance, `0.2126 R + 0.7152 G + 0.0722 B`, and blue is up to 14 times overexposed. Some whites are tried, each with
//! some spacings, and the one is taken whose largest error is least among
//!
//! * the display error of the light alone, in white, of which 2 codes are bearable,
//! * that of the channel alone, of which 3 codes are bearable,
//! * above white, the relative error times 112.09, the display error where this light is dimmed among
//!   others and dominates an element, of which 2 codes are bearable.

use rayon::prelude::*;
use relume::atlas::{LARGEST_TILE_CODE, LightEntry};
use relume::code::{Code, Curve, Scale, display_code};
use relume::color::Rgb;

use super::{PackError, Packing};
use crate::picture::white;
use crate::solution::Solution;

/// Values of a channel on which curves are judged: this many of the largest, and of all by rank.
const SAMPLES: usize = 256;

/// Whites that are tried: own white over powers of the square root of 2.
const WHITES: i32 = 11;

/// Spacings that are tried, in quarters of a level beyond the largest value.
const SPACINGS: u32 = 8;

/// Display codes per relative error at white: `255 * 1.055 / 2.4`.
const CODES_PER_RATIO: f32 = 112.093_75;

/// A light of one channel only.
const PRIMARIES: [Rgb; 3] = [
    Rgb::new(1.0, 0.0, 0.0),
    Rgb::new(0.0, 1.0, 0.0),
    Rgb::new(0.0, 0.0, 1.0),
];

/// Bearable display errors of a light alone in white, and in a primary.
const BEARABLE: [f32; 2] = [2.0, 3.0];

/// The lights with their curves; `values` element by element, a packing per light.
pub(super) fn entries<'a>(
    solution: &'a Solution,
    values: &[Rgb],
    packings: &[Packing],
) -> Result<Vec<LightEntry<'a>>, PackError> {
    let common = common_scales(solution, values);
    let lights = solution.lights.len();
    let entry = |light: usize| {
        let SolutionNames { name, emission } = names(solution, light);
        let own = || values.iter().skip(light).step_by(lights.max(1)).copied();
        let refused = || PackError::Scale(name.to_owned());
        let packing = packings[light];
        let exponential = |scale: Option<Scale>| {
            let scale = scale.ok_or_else(refused)?;
            Ok(LightEntry::exponential(name, emission, packing.code, scale))
        };
        match packing.code {
            Code::Exp8 => exponential(common[light]),
            Code::Exp8s => exponential(Scale::fitting(largest(own().map(Rgb::max_channel)))),
            Code::Lum8 => exponential(Scale::fitting(largest(own().map(Rgb::luminance)))),
            Code::Display8 => {
                let white = white(own());
                let channels = [0, 1, 2].map(|channel| {
                    let values = own().map(|value| value.to_array()[channel]).collect();
                    display_curve(values, white, PRIMARIES[channel].luminance())
                });
                let [Some(r), Some(g), Some(b)] = channels else {
                    return Err(refused());
                };
                Ok(LightEntry {
                    name,
                    emission,
                    code: packing.code,
                    curves: [r, g, b],
                    last: [u8::MAX.into(); 3],
                })
            }
            Code::Tiles | Code::TilesLog => {
                let curve = if packing.code == Code::Tiles {
                    let white = scale_or_one(white(own()) * packing.white);
                    Curve::display(white, packing.step)
                } else {
                    let positive = own().flat_map(Rgb::to_array).filter(|value| *value > 0.0);
                    Curve::logarithmic(positive.min_by(f32::total_cmp).unwrap_or(1.0))
                };
                let curve = curve.ok_or_else(refused)?;
                let last = [0, 1, 2].map(|channel| {
                    let largest = largest(own().map(|value| value.to_array()[channel]));
                    curve.encode(largest, u16::MAX)
                });
                if last.iter().any(|last| *last > LARGEST_TILE_CODE) {
                    return Err(refused());
                }
                Ok(LightEntry {
                    name,
                    emission,
                    code: packing.code,
                    curves: [curve; 3],
                    last,
                })
            }
        }
    };
    (0..lights).into_par_iter().map(entry).collect()
}

struct SolutionNames<'a> {
    name: &'a str,
    emission: Rgb,
}

fn names(solution: &Solution, light: usize) -> SolutionNames<'_> {
    let light = &solution.lights[light];
    SolutionNames {
        name: &light.name,
        emission: light.emission,
    }
}

fn largest(values: impl Iterator<Item = f32>) -> f32 {
    values.fold(0.0, f32::max)
}

/// The scale of a white, or 1 for one that is dark or too dim for the range of floats.
fn scale_or_one(white: f32) -> Scale {
    Scale::at_least(white).unwrap_or(Scale::ONE)
}

/// As published: the 98th percentile of the nominal all-on state is 1 for every light, which
/// in units of light `m`, at nominal emission `e_m`, is `p98 / e_m`.
fn common_scales(solution: &Solution, values: &[Rgb]) -> Vec<Option<Scale>> {
    let nominal = solution.nominal_mix();
    let state = values.chunks(nominal.len().max(1)).map(|values| {
        let weighted = values.iter().zip(&nominal);
        weighted.fold(Rgb::BLACK, |sum, (value, weight)| sum + *value * *weight)
    });
    let one = Some(white(state)).filter(|w| *w > 0.0).unwrap_or(1.0);
    nominal
        .iter()
        .map(|emission| {
            let strength = Some(emission.max_channel()).filter(|e| *e > 0.0);
            Scale::at_least(one / strength.unwrap_or(1.0))
        })
        .collect()
}

/// The best of the display curves of one channel, whose light has this white and whose primary has
/// this luminance.
fn display_curve(mut values: Vec<f32>, own_white: f32, luminance: f32) -> Option<Curve> {
    const LAST: u16 = u8::MAX as u16;
    values.sort_unstable_by(f32::total_cmp);
    let (Some(smallest), Some(largest)) = (values.first().copied(), values.last().copied()) else {
        return Curve::display_between(Scale::ONE, 0.0, 1.0, LAST);
    };
    let channel_white = luminance * white(values.iter().map(|value| Rgb::splat(*value)));
    if own_white <= 0.0 || Scale::at_least(own_white).is_none() {
        return Curve::display_between(Scale::ONE, smallest, largest, LAST);
    }
    let step = (values.len() / SAMPLES).max(1);
    let by_rank = values.iter().step_by(step);
    let top = values.iter().rev().take(SAMPLES);
    let samples: Vec<f32> = by_rank.chain(top).copied().collect();

    let cost = |curve: &Curve| {
        let worst = |value: f32| {
            let found = curve.decode(curve.encode(value, LAST));
            let shown = |value: f32, white: f32| display_code(value / white).min(255.0);
            let alone = |white: f32| (shown(found, white) - shown(value, white)).abs();
            let above = if value > own_white {
                CODES_PER_RATIO * (found / value - 1.0).abs()
            } else {
                0.0
            };
            let [in_white, in_primary] = BEARABLE;
            (alone(own_white).max(above) / in_white).max(alone(channel_white) / in_primary)
        };
        samples.iter().copied().map(worst).fold(0.0, f32::max)
    };
    let candidates = (0..WHITES).flat_map(|halvings| {
        let white = scale_or_one(own_white * 0.5_f32.powf(0.5 * halvings as f32));
        let code = |value: f32| display_code(value / white.value());
        let level = (code(largest) - code(smallest)) / f32::from(LAST);
        (0..SPACINGS).filter_map(move |quarters| {
            let beyond = (level * quarters as f32 / 4.0 / CODES_PER_RATIO).exp();
            Curve::display_between(white, smallest, largest * beyond, LAST)
        })
    });
    candidates
        .map(|curve| (cost(&curve), curve))
        .min_by(|(a, _), (b, _)| a.total_cmp(b))
        .map(|(_, curve)| curve)
}
