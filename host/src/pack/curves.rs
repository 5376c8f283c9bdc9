//! What the codes of every light stand for.
//!
//! `exp8` has one scale, as published; `exp8s` and `lum8` put the largest value of a light at their top.
//! `display8` has 256 levels for every channel of a light, in 16 parts of equal steps (see [`Curve::Knots`]). A level may
//! stand for a value where it bears that, at a tolerance `t` and in
//!
//! * the light alone in its own colour, where `2 t` display codes are bearable,
//! * the channel alone, where `3 t` are: then the exposure follows the luminance, `0.2126 R + 0.7152 G + 0.0722 B`, and blue is
//!   up to 14 times overexposed,
//! * the light among all others at their nominal emission, 16 times overexposed, where `3 t` are,
//! * all three of what is shown, with the reflectance of the element, where a fifth more is bearable,
//! * above white any state, if the relative error times 112.09 is at most `2 t`: that is the display error where this light is
//!   dimmed among others and dominates an element.
//!
//! So every value has an interval, and each part in turn takes the longest steps with which a level falls into all intervals
//! that begin before its end: where values are rare, above all in hot spots, levels are too. The least `t` with
//! which the levels suffice is searched. All mixes of several lights are left out of this: what they are off by
//! is a mean of what their lights are off by, each of which rounds for itself.

use rayon::prelude::*;
use relume::atlas::{LARGEST_TILE_CODE, LightEntry, Quantity};
use relume::code::{Code, Curve, KNOT_CODES, KNOT_UNITS, KNOTS, Scale, srgb_linear};
use relume::color::Rgb;

use super::{PackError, Packing, Source};
use crate::display_error::{Solo, shown_code};
use crate::picture::white;
use crate::solution::Solution;

/// What the light's own white is over that of its curves: below the latter, steps of a part are uniform on a display, above
/// it in ratio.
const WHITES: [f32; 6] = [4.0, 1.0, 2.0, 8.0, 16.0, 32.0];

/// Tolerances that are tried lie between these.
const LEAST_TOLERANCE: f32 = 1e-3;
const MOST_TOLERANCE: f32 = 64.0;

/// Ratio of two tolerances that are not told apart.
const TOLERANCE: f32 = 1.01;

/// Ratio of the steps of a part that are tried one after the other.
const STEPS: f32 = 0.98;

/// Display codes per relative error at white: `255 * 1.055 / 2.4`.
const CODES_PER_RATIO: f32 = 112.093_75;

/// A light of one channel only.
const PRIMARIES: [Rgb; 3] = [
    Rgb::new(1.0, 0.0, 0.0),
    Rgb::new(0.0, 1.0, 0.0),
    Rgb::new(0.0, 0.0, 1.0),
];

/// Bearable display errors of a light alone, in its colour and in a primary, and among all others when overexposed.
const BEARABLE: [f32; STATES] = [2.0, 3.0, 3.0];

/// Exposure in the last of these states, over that which suits it.
const OVEREXPOSED: f32 = 16.0;

/// States in which a value is judged.
const STATES: usize = 3;

/// How much more is bearable of what is shown.
const MORE_SHOWN: f32 = 1.2;

/// Bearable relative error above white, times [`CODES_PER_RATIO`].
const BEARABLE_RATIO: f32 = 2.0;

/// The lights with their curves; a packing per light.
pub(super) fn entries<'a>(
    source: &Source<'a>,
    packings: &[Packing],
) -> Result<Vec<LightEntry<'a>>, PackError> {
    let (solution, values) = (source.solution, &*source.values);
    let common = common_scales(solution, values);
    let stage = Stage::new(source);
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
                let [Some(r), Some(g), Some(b)] = display_curves(&stage, &own, emission) else {
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
    let one = Some(white(all_on(solution, values)))
        .filter(|w| *w > 0.0)
        .unwrap_or(1.0);
    nominal
        .iter()
        .map(|emission| {
            let strength = Some(emission.max_channel()).filter(|e| *e > 0.0);
            Scale::at_least(one / strength.unwrap_or(1.0))
        })
        .collect()
}

/// The state of all lights at their nominal emission.
fn all_on<'a>(solution: &Solution, values: &'a [Rgb]) -> impl Iterator<Item = Rgb> + Clone + 'a {
    let nominal = solution.nominal_mix();
    values.chunks(nominal.len().max(1)).map(move |values| {
        let weighted = values.iter().zip(&nominal);
        weighted.fold(Rgb::BLACK, |sum, (value, weight)| sum + *value * *weight)
    })
}

/// What `display8` needs to know of all lights together.
struct Stage {
    /// Reflectances of the elements, 1 where they are multiplied in.
    reflectances: Vec<Rgb>,
    /// What shows as white with all lights on, 16 times overexposed: packed and shown.
    overexposed: [f32; 2],
}

impl Stage {
    fn new(source: &Source) -> Self {
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
}

/// What shows as white in a state: packed and shown.
fn whites(lit: impl Iterator<Item = Rgb> + Clone, reflectances: &[Rgb]) -> [f32; 2] {
    let shown = lit.clone().zip(reflectances);
    [white(lit), white(shown.map(|(value, rho)| value * *rho))]
}

/// The best display curve of each channel of a light.
fn display_curves(stage: &Stage, own: &[Rgb], emission: Rgb) -> [Option<Curve>; 3] {
    let alone = |weight: Rgb| whites(own.iter().map(|value| *value * weight), &stage.reflectances);
    let nominal = Solo::Nominal.weight(emission);
    let in_nominal = alone(nominal);
    [0, 1, 2].map(|channel| {
        let at = |rgb: Rgb| rgb.to_array()[channel];
        // A light that lacks this channel shows it in its primary only.
        let nominal = in_nominal.map(|white| white / at(nominal));
        let overexposed = stage.overexposed.map(|white| white / at(emission));
        let states = [nominal, alone(PRIMARIES[channel]), overexposed];
        let places = own.iter().zip(&stage.reflectances);
        let samples = places
            .map(|(value, rho)| Sample::new(at(*value), at(*rho), states))
            .collect();
        display_curve(samples, nominal[0].min(white(own.iter().copied())))
    })
}

/// The best of the display curves of one channel, whose light has this white.
fn display_curve(samples: Vec<Sample>, own_white: f32) -> Option<Curve> {
    let values = samples.iter().map(|sample| sample.value);
    let smallest = values.clone().min_by(f32::total_cmp).unwrap_or(0.0);
    let even = |white: Scale| Curve::display_between(white, smallest, largest(values.clone()));
    let own = Scale::at_least(own_white).filter(|_| own_white > 0.0);
    if own.is_none() {
        return even(Scale::ONE);
    }
    let (mut best, mut least) = (even(scale_or_one(own_white)), MOST_TOLERANCE);
    for part in WHITES {
        let white = scale_or_one(own_white / part);
        // Most whites are no better than the one before them.
        if let Some((tolerance, knots)) = tightest(&samples, white.value(), least / TOLERANCE) {
            (best, least) = (Some(Curve::Knots { white, knots }), tolerance);
        }
    }
    best
}

/// Knots of the least tolerance, and that; `None` when it is above `most`.
fn tightest(samples: &[Sample], white: f32, most: f32) -> Option<(f32, [u16; KNOTS])> {
    let at = |tolerance: f32| Some((tolerance, knots(samples, white, tolerance)?));
    let mut best = at(most)?;
    let mut low = 0.0;
    while best.0 > LEAST_TOLERANCE && best.0 > TOLERANCE * low {
        let middle = if low > 0.0 {
            (low * best.0).sqrt()
        } else {
            best.0 / 2.0
        };
        match at(middle) {
            Some(found) => best = found,
            None => low = middle,
        }
    }
    Some(best)
}

/// Knots of a curve that has a level in the interval of every sample; `None` when so many parts do not suffice.
fn knots(samples: &[Sample], white: f32, tolerance: f32) -> Option<[u16; KNOTS]> {
    let unit = |value: f32| f32::from(KNOT_UNITS) * continued_code(value / white);
    let intervals = samples.iter().map(|s| s.interval(tolerance).map(unit));
    let mut intervals: Vec<[f32; 2]> = intervals.collect();
    intervals.sort_unstable_by(|[a, _], [b, _]| a.total_cmp(b));
    let start = intervals.iter().map(|[_, to]| *to);
    let mut knots = [start.fold(f32::INFINITY, f32::min).max(0.0) as u16; KNOTS];
    let mut open = &intervals[..];
    for part in 1..KNOTS {
        let from = knots[part - 1];
        let begin = f32::from(from);
        open = &open[open.partition_point(|[low, _]| *low <= begin)..];
        // Past the last code there is no level.
        let codes = KNOT_CODES - u16::from(part == KNOTS - 1);
        let holds = |length: u16| {
            let step = f32::from(length) / f32::from(KNOT_CODES);
            let level = |code: f32| begin + code * step;
            let end = level(codes.into());
            let mut begun = open.iter().take_while(|[low, _]| *low <= end);
            begun.all(|[low, high]| level(((low - begin) / step).ceil()) <= *high)
        };
        let left = u16::MAX - from;
        let lengths = std::iter::successors(Some(LONGEST_PART.min(left)), |length| {
            Some((f32::from(*length) * STEPS) as u16)
        });
        let length = if open.is_empty() {
            left.min(1)
        } else {
            lengths
                .take_while(|length| *length > 0)
                .find(|l| holds(*l))?
        };
        knots[part] = from + length;
    }
    let [.., from, to] = knots;
    let last = f32::from(to) - f32::from(to - from) / f32::from(KNOT_CODES);
    let is_reached = intervals.last().is_none_or(|[low, _]| *low <= last);
    (is_reached && knots.is_sorted_by(|a, b| a < b)).then_some(knots)
}

/// The longest part, in units of knots: 1024 display codes.
const LONGEST_PART: u16 = 1 << 14;

/// The display code of a value over white, above it too; within 3e-4.
fn continued_code(u: f32) -> f32 {
    if u < 1.0 {
        shown_code(u)
    } else {
        255.0 + CODES_PER_RATIO * u.ln()
    }
}

/// A value for which levels are sought.
#[derive(Clone, Copy)]
struct Sample {
    value: f32,
    /// What shows it as white in every state, packed and shown.
    whites: [[f32; 2]; STATES],
    /// Its display codes then.
    shown: [[f32; 2]; STATES],
}

impl Sample {
    /// A value on a reflectance, with the whites of its light.
    fn new(value: f32, reflectance: f32, whites: [[f32; 2]; STATES]) -> Self {
        let whites = whites.map(|[packed, shown]| [packed, shown / reflectance]);
        Self {
            value,
            whites,
            shown: whites.map(|whites| whites.map(|white| shown_code(value / white))),
        }
    }

    /// From the smallest to the largest value that may take its place.
    fn interval(&self, tolerance: f32) -> [f32; 2] {
        let [mut low, mut high] = [0.0_f32, f32::INFINITY];
        if self.value > self.whites[0][0] {
            let ratio = tolerance * BEARABLE_RATIO / CODES_PER_RATIO;
            [low, high] = [self.value * (1.0 - ratio), self.value * (1.0 + ratio)];
        }
        let bearable = BEARABLE.map(|codes| [codes * tolerance, codes * tolerance * MORE_SHOWN]);
        let states = self.whites.iter().zip(&self.shown).zip(&bearable);
        let states = states.flat_map(|((whites, shown), bearable)| {
            whites
                .iter()
                .zip(shown)
                .zip(bearable)
                .map(|((w, s), b)| (*w, *s, *b))
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
