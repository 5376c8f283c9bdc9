//! What the codes of every light stand for.
//!
//! `exp8` has one scale, as published; `exp8s` and `lum8` put the largest value of a light at their top.
//! `display8` has 256 levels for every channel of a light. Where its white lies decides what they are spent on: below it steps are
//! uniform on a display that this light alone exposes, above it they are uniform in ratio, which is what counts when
//! the light is one of many, or when it shines in one primary: then the exposure follows
//! the luminance, `0.2126 R + 0.7152 G + 0.0722 B`, and blue is up to 14 times overexposed. Some whites are tried, each with
//! some spacings, and the one is taken whose largest error is least among
//!
//! * the display error of the light alone in its own colour, of which 2 codes are bearable,
//! * that of the channel alone, of which 3.2 codes are bearable,
//! * both of what is shown, with the reflectance of the element, of which a fifth more is bearable,
//! * above white, the relative error times 112.09, the display error where this light is dimmed among
//!   others and dominates an element, of which 2.3 codes are bearable.
//!
//! These bounds were found by trying, in rooms of 64 and 256 lights: with them, no state of one light and no mix is
//! much worse than the others.

use rayon::prelude::*;
use relume::atlas::{LARGEST_TILE_CODE, LightEntry, Quantity};
use relume::code::{Code, Curve, Scale, display_code};
use relume::color::Rgb;

use super::{PackError, Packing, Source};
use crate::display_error::{Solo, shown_code};
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

/// Bearable display errors of a light alone, in its colour and in a primary.
const BEARABLE: [f32; 2] = [2.0, 3.2];

/// How much more is bearable of what is shown.
const MORE_SHOWN: f32 = 1.2;

/// Bearable relative error above white, times [`CODES_PER_RATIO`].
const BEARABLE_RATIO: f32 = 2.3;

/// The lights with their curves; a packing per light.
pub(super) fn entries<'a>(
    source: &Source<'a>,
    packings: &[Packing],
) -> Result<Vec<LightEntry<'a>>, PackError> {
    let (solution, values) = (source.solution, &*source.values);
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
                let own: Vec<Rgb> = own().collect();
                let [Some(r), Some(g), Some(b)] = display_curves(source, &own, emission) else {
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

/// The best display curve of each channel of a light.
fn display_curves(source: &Source, own: &[Rgb], emission: Rgb) -> [Option<Curve>; 3] {
    let reflectances: Vec<Rgb> = match source.quantity {
        Quantity::Irradiance => source
            .solution
            .mesh
            .elements
            .iter()
            .map(|e| e.reflectance)
            .collect(),
        Quantity::Radiosity | Quantity::Radiance => vec![Rgb::WHITE; own.len()],
    };
    let whites = |weight: Rgb| {
        let lit = own.iter().map(|value| *value * weight);
        let shown = lit
            .clone()
            .zip(&reflectances)
            .map(|(value, rho)| value * *rho);
        [white(lit), white(shown)]
    };
    let nominal = Solo::Nominal.weight(emission);
    let in_nominal = whites(nominal);
    [0, 1, 2].map(|channel| {
        let at = |rgb: Rgb| rgb.to_array()[channel];
        // A light that lacks this channel shows it in its primary only.
        let nominal = in_nominal.map(|white| white / at(nominal));
        let primary = whites(PRIMARIES[channel]);
        let places = own.iter().zip(&reflectances);
        let samples = places
            .map(|(value, rho)| Sample::new(at(*value), at(*rho), nominal, primary))
            .collect();
        display_curve(samples, nominal[0].min(white(own.iter().copied())))
    })
}

/// The best of the display curves of one channel, whose light has this white.
fn display_curve(mut all: Vec<Sample>, own_white: f32) -> Option<Curve> {
    const LAST: u16 = u8::MAX as u16;
    all.sort_unstable_by(|a, b| a.value.total_cmp(&b.value));
    let (Some(smallest), Some(largest)) = (all.first(), all.last()) else {
        return Curve::display_between(Scale::ONE, 0.0, 1.0, LAST);
    };
    let (smallest, largest) = (smallest.value, largest.value);
    if own_white <= 0.0 || Scale::at_least(own_white).is_none() {
        return Curve::display_between(Scale::ONE, smallest, largest, LAST);
    }
    let step = (all.len() / SAMPLES).max(1);
    let top = all.len().saturating_sub(SAMPLES);
    let judging = all.iter().enumerate();
    let judging = judging.filter(|(rank, _)| rank % step == 0 || *rank >= top);
    let mut samples: Vec<Sample> = judging.map(|(_, sample)| *sample).collect();

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
#[derive(Clone, Copy)]
struct Sample {
    value: f32,
    /// What shows it as white: with the light alone, packed and shown, and with its channel alone.
    whites: [f32; 4],
    /// Its display codes then.
    shown: [f32; 4],
}

impl Sample {
    /// A value on a reflectance, with the whites of its light, packed and shown, in nominal colour and in the primary.
    fn new(value: f32, reflectance: f32, nominal: [f32; 2], primary: [f32; 2]) -> Self {
        let whites = [
            nominal[0],
            nominal[1] / reflectance,
            primary[0],
            primary[1] / reflectance,
        ];
        Self {
            value,
            whites,
            shown: whites.map(|white| shown_code(value / white)),
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
        let [in_colour, in_primary] = BEARABLE;
        let above = if self.value > self.whites[0] {
            CODES_PER_RATIO * (found / self.value - 1.0).abs() / BEARABLE_RATIO
        } else {
            0.0
        };
        let states = self.whites.iter().zip(self.shown);
        let states = states.zip([
            in_colour,
            in_colour * MORE_SHOWN,
            in_primary,
            in_primary * MORE_SHOWN,
        ]);
        states
            .map(|((white, shown), bearable)| (shown_code(found / white) - shown).abs() / bearable)
            .fold(above, f32::max)
    }
}
