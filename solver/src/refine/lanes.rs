//! Blocks of lights side by side: a light is a lane, the same operation serves all of a block.

use crate::color::Rgb;

/// One value per channel and lane of a block of `K` lights.
pub type Lanes<const K: usize> = [[f32; K]; 3];

/// Block and lane of a light.
pub(super) const fn address<const K: usize>(light: u32) -> (usize, usize) {
    const { assert!(K > 0, "a block holds at least one light") }
    (light as usize / K, light as usize % K)
}

/// The lanes of one block.
pub(super) fn part<const K: usize>(
    lanes: &mut [Lanes<K>],
    block: usize,
    length: usize,
) -> &mut [Lanes<K>] {
    let tail = lanes.get_mut(block * length..).unwrap_or_default();
    let length = length.min(tail.len());
    tail.get_mut(..length).unwrap_or_default()
}

/// `E_j += F_j delta` for every element of a block that sees the shooter.
pub(super) fn distribute<const K: usize>(
    irradiance: &mut [Lanes<K>],
    row: &[f32],
    delta: &Lanes<K>,
) {
    for (lanes, factor) in irradiance.iter_mut().zip(row) {
        // A third of a room faces away: its lanes need not be fetched.
        if *factor == 0.0 {
            continue;
        }
        for (channel, shot) in lanes.iter_mut().zip(delta) {
            for (value, shot) in channel.iter_mut().zip(shot) {
                *value += factor * shot;
            }
        }
    }
}

pub(super) fn lane_of<const K: usize>([r, g, b]: &Lanes<K>, lane: usize) -> Rgb {
    let value = |channel: &[f32; K]| channel.get(lane).copied().unwrap_or(0.0);
    Rgb::new(value(r), value(g), value(b))
}

pub(super) fn add_to_lane<const K: usize>(lanes: &mut Lanes<K>, lane: usize, value: Rgb) {
    for (channel, value) in lanes.iter_mut().zip(value.to_array()) {
        if let Some(slot) = channel.get_mut(lane) {
            *slot += value;
        }
    }
}

/// `lanes += factor * delta`, channel by channel.
pub(super) fn add_scaled<const K: usize>(lanes: &mut Lanes<K>, delta: &Lanes<K>, factor: Rgb) {
    for ((channel, delta), factor) in lanes.iter_mut().zip(delta).zip(factor.to_array()) {
        for (value, delta) in channel.iter_mut().zip(delta) {
            *value += factor * delta;
        }
    }
}

/// `sums_m += weight_m f(P_m)` with the sum `P_m` over the channels.
pub(super) fn add_weighted<const K: usize>(
    sums: &mut [f32; K],
    [r, g, b]: &Lanes<K>,
    weights: &[f32; K],
    function: impl Fn(f32) -> f32,
) {
    let channels = r.iter().zip(g).zip(b);
    for ((sum, ((r, g), b)), weight) in sums.iter_mut().zip(channels).zip(weights) {
        *sum += weight * function(r + g + b);
    }
}

pub(super) fn sum(value: Rgb) -> f32 {
    value.r + value.g + value.b
}
