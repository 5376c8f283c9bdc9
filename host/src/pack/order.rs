//! In which order lights stand in tiles: every light after one that looks like it.
//!
//! Light that reaches an element by the same way, through a door say, has the same shape there whichever lamp it comes from, and so has
//! what the bake left to chance: its rays are the same for all lights. Of what the mean of neighbours does not predict,
//! two lights `i, j` share `r_ij`, the correlation over a tile; of a normal distribution, that saves
//! `-log2(1 - r^2) / 2` bits per element (Shannon 1948, section 24). `s_ij` is the sum of that over some tiles and the three
//! that are coded. The order is a short path through all lights of a [`GROUP`], of length `-s_ij` per step: the best of some that
//! go to the nearest light left, mended by turning parts of it round (Croes 1958, 2-opt).

use rayon::prelude::*;
use relume::atlas::{GROUP, Place, Predictor};

use super::tiles::{coded, differences};

/// Tiles that are looked at.
const SAMPLED: usize = 32;

/// Paths that are begun.
const BEGUN: usize = 16;

/// How often all parts are tried for turning.
const MENDED: usize = 16;

/// What two lights that are the same everywhere share, per tile and plane: no infinity.
const MOST_SHARED: f32 = 0.9999;

/// The places of lights among those of their group, group by group. `planes` holds the codes of the lights in tiles, `tags` theirs in
/// ascending order, `lights` is the number of all.
pub(super) fn order(
    planes: &[Vec<[u16; 3]>],
    tags: &[usize],
    lights: usize,
    places: &[Place],
) -> Vec<u8> {
    let step = places.len().div_ceil(SAMPLED).max(1);
    let sampled: Vec<Place> = places.iter().copied().step_by(step).collect();
    let mut order = Vec::with_capacity(lights);
    for first in (0..lights).step_by(GROUP) {
        let group = first..lights.min(first + GROUP);
        let own = tags.partition_point(|tag| *tag < group.start)
            ..tags.partition_point(|tag| *tag < group.end);
        let saved = saved(&planes[own.clone()], &sampled);
        let path = path(&saved, own.len());
        let tiled = path.iter().map(|place| tags[own.start + place]);
        let others = group.filter(|tag| tags[own.clone()].binary_search(tag).is_err());
        order.extend(tiled.chain(others).map(|tag| (tag - first) as u8));
    }
    order
}

/// Bits that every light of a group saves after every other one.
fn saved(planes: &[Vec<[u16; 3]>], places: &[Place]) -> Vec<f32> {
    let lights = planes.len();
    let rests: Vec<Vec<Vec<f32>>> = places
        .par_iter()
        .flat_map_iter(|place| (0..3).map(|channel| (*place, channel)))
        .map(|(place, channel)| {
            let rest = |plane: &Vec<[u16; 3]>| normalised(&coded(plane, place, channel), place);
            planes.iter().map(rest).collect()
        })
        .collect();
    let pair = |(a, b): (usize, usize)| -> f32 {
        let bits = rests.iter().map(|rests| {
            let shared: f32 = rests[a].iter().zip(&rests[b]).map(|(x, y)| x * y).sum();
            let left = 1.0 - (shared * shared).min(MOST_SHARED);
            -left.log2() / 2.0 * rests[a].len() as f32
        });
        bits.sum()
    };
    let rows = (0..lights).into_par_iter().flat_map_iter(|a| {
        let pair = &pair;
        (0..lights).map(move |b| if b < a { pair((a, b)) } else { 0.0 })
    });
    let mut saved: Vec<f32> = rows.collect();
    for a in 0..lights {
        for b in 0..a {
            saved[b * lights + a] = saved[a * lights + b];
        }
    }
    saved
}

/// What the mean of neighbours does not predict, of length 1; or 0.
fn normalised(coded: &[i32], place: Place) -> Vec<f32> {
    let rest = differences(coded, usize::from(place.columns), Predictor::Mean);
    let length = rest.iter().map(|e| (*e as f32).powi(2)).sum::<f32>().sqrt();
    let rest = rest.iter().map(|e| *e as f32 / length.max(1.0));
    rest.collect()
}

/// A path through so many lights that saves much.
fn path(saved: &[f32], lights: usize) -> Vec<usize> {
    let between = |a: usize, b: usize| saved[a * lights + b];
    let length = |path: &[usize]| path.windows(2).map(|w| between(w[0], w[1])).sum::<f32>();
    let begins = (0..lights).step_by(lights.div_ceil(BEGUN).max(1));
    let paths = begins.map(|begin| {
        let mut path = vec![begin];
        let mut left: Vec<usize> = (0..lights).filter(|light| *light != begin).collect();
        while let Some(end) = path.last().copied() {
            let nearest = (0..left.len())
                .max_by(|a, b| between(end, left[*a]).total_cmp(&between(end, left[*b])));
            let Some(nearest) = nearest else { break };
            path.push(left.remove(nearest));
        }
        path
    });
    let best = paths.max_by(|a, b| length(a).total_cmp(&length(b)));
    let mut path = best.unwrap_or_default();
    for _ in 0..MENDED {
        let mut is_mended = false;
        for from in 1..lights {
            for to in from + 1..lights {
                let (before, a, b) = (path[from - 1], path[from], path[to]);
                let after = path.get(to + 1).copied();
                let end = |light: usize| after.map_or(0.0, |after| between(light, after));
                // Rounding must not turn a part back and forth.
                if between(before, b) + end(a) > (between(before, a) + end(b)) * (1.0 + 1e-5) {
                    path[from..=to].reverse();
                    is_mended = true;
                }
            }
        }
        if !is_mended {
            break;
        }
    }
    path
}
