//! What the codes of every light stand for.
//!
//! `exp8` has one scale, as published; `exp8s` and `lum8` put the largest value of a light at their top.
//! `display8` has 256 levels for every channel of a light, in 32 parts of equal steps (see [`Curve::Parts`]). A level may
//! stand for a value where it [bears](super::bearable) that at a tolerance `t`. So every value has an interval, and a part
//! has steps with which a level falls into all intervals that begin before its end, as long as possible: where values are rare, above all in
//! hot spots, levels are too. The least `t` with which the levels suffice is searched.
//!
//! Steps of `tiles` are uniform on a display up to the white of a light alone, be it what is packed or, on the
//! brightest surface, what is shown.

use rayon::prelude::*;
use relume::atlas::{LARGEST_TILE_CODE, LightEntry};
use relume::code::{
    AllCodes, Code, Curve, LARGEST_PART_FIRST, LARGEST_PART_UNIT, PART_CODES, PART_STEPS, PARTS,
    Scale,
};
use relume::color::Rgb;

use super::bearable::{Sample, Stage, all_on, continued_code};
use super::{PackError, Packing, Source};
use crate::picture::white;
use crate::solution::Solution;

/// Whites that are tried: own white over powers of the cube root of 2. Below its white, steps of a part are uniform on a
/// display, above it in ratio.
const WHITES: u8 = 18;

/// Tolerances that are tried lie between these.
const LEAST_TOLERANCE: f32 = 1e-3;
const MOST_TOLERANCE: f32 = 64.0;

/// The part of a tolerance that the first level takes.
const DARKEST: f32 = 0.25;

/// Beginnings of a curve that are followed up.
const KEPT: usize = 4;

/// Ratio of two tolerances that are not told apart.
const TOLERANCE: f32 = 1.01;

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
                    let white = scale_or_one(stage.white(own()) * packing.white);
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
    let held = |light: usize| {
        let entry: LightEntry = entry(light)?;
        let mut curves = entry.curves.iter().zip(entry.last);
        if curves.all(|(curve, last)| curve.reaches::<AllCodes>(last)) {
            Ok(entry)
        } else {
            Err(PackError::Scale(entry.name.to_owned()))
        }
    };
    (0..lights).into_par_iter().map(held).collect()
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

/// The best display curve of each channel of a light.
fn display_curves(stage: &Stage, own: &[Rgb], emission: Rgb) -> [Option<Curve>; 3] {
    let states = stage.states(own, emission);
    [0, 1, 2].map(|channel| {
        let at = |rgb: Rgb| rgb.to_array()[channel];
        let states = states[channel];
        let places = own.iter().zip(&stage.reflectances);
        let samples = places
            .map(|(value, rho)| Sample::new(at(*value), at(*rho), states))
            .collect();
        display_curve(samples, states[0][0].min(white(own.iter().copied())))
    })
}

/// The best of the display curves of one channel, whose light has this white.
fn display_curve(samples: Vec<Sample>, own_white: f32) -> Option<Curve> {
    let values = samples.iter().map(|sample| sample.value);
    let smallest = values.clone().min_by(f32::total_cmp).unwrap_or(0.0);
    let even = |white: Scale| Curve::display_between(white, smallest, largest(values.clone()));
    let top = scale_or_one(largest(values.clone()));
    if own_white <= 0.0 || Scale::at_least(own_white).is_none() {
        return even(top);
    }
    let (mut best, mut least) = (even(top), MOST_TOLERANCE);
    for part in 0..WHITES {
        let white = scale_or_one(own_white * 2.0_f32.powf(f32::from(part) / -3.0));
        // Most whites are no better than the one before them.
        if let Some((tolerance, curve)) = tightest(&samples, white, least / TOLERANCE) {
            (best, least) = (Some(curve), tolerance);
        }
    }
    best
}

/// The curve of the least tolerance, and that; `None` when it is above `most`.
fn tightest(samples: &[Sample], white: Scale, most: f32) -> Option<(f32, Curve)> {
    let at = |tolerance: f32| Some((tolerance, parts(samples, white, tolerance)?));
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

/// A curve that has a level in the interval of every sample; `None` when so many parts do not suffice.
fn parts(samples: &[Sample], white: Scale, tolerance: f32) -> Option<Curve> {
    let unit = |value: f32| 4096.0 * continued_code(value / white.value());
    let intervals = samples.iter().map(|s| s.interval(tolerance).map(unit));
    let mut intervals: Vec<[f32; 2]> = intervals.collect();
    // Where all lights are dark they are all off the same way: the first level takes a part of what is bearable.
    let ends = samples.iter().zip(&intervals).map(|(s, [_, end])| (s, end));
    let (darkest, _) = ends.min_by(|(_, a), (_, b)| a.total_cmp(b))?;
    let first = (unit(darkest.interval(DARKEST * tolerance)[1]) / 256.0).floor();
    keep_innermost(&mut intervals);
    if first > f32::from(LARGEST_PART_FIRST) {
        return None;
    }
    // Steps are about twice what is bearable, of which most is 3 codes; the largest are 4.4 times the smallest.
    let largest = (6.0 * tolerance * 16.0).log2().ceil().max(0.0) as u8;
    let mut units = (largest.saturating_sub(4)..=largest).filter(|unit| *unit <= LARGEST_PART_UNIT);
    units.find_map(|unit| {
        let steps = steps(&intervals, 256.0 * first, unit)?;
        Some(Curve::Parts {
            white,
            first: first as u16,
            unit,
            steps,
        })
    })
}

/// Leaves only intervals that contain no other: a level in one of these is in all around it. They are sorted then.
fn keep_innermost(intervals: &mut Vec<[f32; 2]>) {
    intervals.sort_unstable_by(|[a, _], [b, _]| b.total_cmp(a));
    let mut least = f32::INFINITY;
    intervals.retain(|[_, high]| {
        let is_innermost = *high < least;
        least = least.min(*high);
        is_innermost
    });
    intervals.reverse();
}

/// The first parts of a curve.
#[derive(Clone, Copy)]
struct Begun {
    steps: [u8; PARTS / 2],
    /// The last level, and where the next part begins.
    last: f32,
    end: f32,
}

/// Steps of all parts with which a level falls into every interval. The longest steps of a part come furthest, but others may
/// suit better what follows: the [`KEPT`] that come furthest are followed up.
fn steps(intervals: &[[f32; 2]], first: f32, unit: u8) -> Option<[u8; PARTS / 2]> {
    let mut kept = vec![Begun {
        steps: [0; PARTS / 2],
        last: first,
        end: first,
    }];
    for part in 0..PARTS {
        let mut next = Vec::new();
        for begun in kept {
            let begin = begun.end;
            let open = &intervals[intervals.partition_point(|[low, _]| *low <= begin)..];
            if open.is_empty() {
                return Some(begun.steps);
            }
            for (place, step) in (0..).zip(PART_STEPS) {
                let step = f32::from(step) * f32::from(1_u16 << unit);
                // Past the last code there is no level.
                let codes = f32::from(PART_CODES - u16::from(part == PARTS - 1));
                let last = begin + codes * step;
                let mut within = open.iter().take_while(|[low, _]| *low <= last);
                if within.all(|[low, high]| begin + ((low - begin) / step).ceil() * step <= *high) {
                    let mut steps = begun.steps;
                    steps[part / 2] |= place << (4 * (part % 2));
                    let end = begin + f32::from(PART_CODES) * step;
                    next.push(Begun { steps, last, end });
                }
            }
        }
        next.sort_by(|a, b| b.end.total_cmp(&a.end));
        next.truncate(KEPT);
        kept = next;
    }
    let furthest = kept.first()?;
    let is_reached = intervals
        .last()
        .is_none_or(|[low, _]| *low <= furthest.last);
    is_reached.then_some(furthest.steps)
}
