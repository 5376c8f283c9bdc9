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
use crate::display_error::shown_code;
use crate::picture::white;
use crate::solution::Solution;

/// Values of a channel on which curves are judged: this many of the largest, and of all by rank.
const SAMPLES: usize = 1024;

/// Whites that are tried: own white over powers of the fourth root of 2.
const WHITES: u8 = 25;

/// Spacings that are tried, in quarters of a level beyond the largest value.
const SPACINGS: u8 = 12;

/// Display codes per relative error at white: `255 * 1.055 / 2.4`.
const CODES_PER_RATIO: f32 = 112.093_75;

/// A light of one channel only.
const PRIMARIES: [Rgb; 3] = [
    Rgb::new(1.0, 0.0, 0.0),
    Rgb::new(0.0, 1.0, 0.0),
    Rgb::new(0.0, 0.0, 1.0),
];

/// Values that were bad on a curve before, and are looked at first.
const KNOWN: usize = 4;

/// Bearable display errors of a light alone in white, in a primary, and above white.
const BEARABLE: [f32; 3] = [2.0, 3.0, 2.5];

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
    let mut samples: Vec<Sample> = by_rank
        .chain(top)
        .map(|value| Sample::new(*value, own_white, channel_white))
        .collect();

    let mut best = (f32::INFINITY, None);
    for part in 0..WHITES {
        let white = scale_or_one(own_white * 2.0_f32.powf(-0.25 * part as f32));
        let code = |value: f32| display_code(value / white.value());
        let level = (code(largest) - code(smallest)) / f32::from(LAST);
        for parts in 0..SPACINGS {
            let beyond = (level * parts as f32 / 4.0 / CODES_PER_RATIO).exp();
            let Some(curve) = Curve::display_between(white, smallest, largest * beyond, LAST)
            else {
                continue;
            };
            // What was bad on one curve is looked at first on the next, mostly in vain for the curve.
            let nearest = |value: f32| curve.decode(curve.encode(value, LAST));
            let known = samples.iter().take(KNOWN);
            if known.clone().any(|s| s.cost(nearest(s.value)) >= best.0) {
                continue;
            }
            let levels: Vec<f32> = (0..=LAST).map(|code| curve.decode(code)).collect();
            let mut cost = 0.0_f32;
            let bad = samples.iter().position(|sample| {
                cost = cost.max(sample.cost(sample.nearest(&levels)));
                cost >= best.0
            });
            match bad {
                Some(bad) => samples[..=bad].rotate_right(1),
                None => best = (cost, Some(curve)),
            }
        }
    }
    best.1
}

/// A value on which curves are judged.
struct Sample {
    value: f32,
    own_white: f32,
    channel_white: f32,
    /// Its display codes with the light alone, and with its channel alone.
    shown: [f32; 2],
    /// Whether it is above white.
    is_above: bool,
}

impl Sample {
    fn new(value: f32, own_white: f32, channel_white: f32) -> Self {
        Self {
            value,
            own_white,
            channel_white,
            shown: [own_white, channel_white].map(|white| shown_code(value / white)),
            is_above: value > own_white,
        }
    }

    /// The nearest of some levels, which rise.
    fn nearest(&self, levels: &[f32]) -> f32 {
        let above = levels.partition_point(|level| *level < self.value);
        let near = &levels[above.saturating_sub(1)..levels.len().min(above + 1)];
        let distance = |level: &f32| (level - self.value).abs();
        let nearest = near.iter().copied();
        let nearest = nearest.min_by(|a, b| distance(a).total_cmp(&distance(b)));
        nearest.unwrap_or(0.0)
    }

    /// The largest of its errors over what is bearable, where `found` takes its place.
    fn cost(&self, found: f32) -> f32 {
        let [in_white, in_primary, ratio] = BEARABLE;
        let above = if self.is_above {
            CODES_PER_RATIO * (found / self.value - 1.0).abs()
        } else {
            0.0
        };
        let alone = (shown_code(found / self.own_white) - self.shown[0]).abs();
        let primary = (shown_code(found / self.channel_white) - self.shown[1]).abs();
        (alone / in_white).max(primary / in_primary).max(above / ratio)
    }
}
