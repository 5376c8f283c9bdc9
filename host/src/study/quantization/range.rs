//! How large and how small a value a code can tell apart: the published 1:1413, found again.
//!
//! The framework paper (section 2.3) divides the largest unpacked value but one, `-ln(1 - 254/255) = 5.541`, by the
//! smallest *packed* step, 1/255. The smallest unpacked step is `-ln(1 - 1/255) = 0.00393`, so that the range is 1:1410.
//! Below 1/510 everything vanishes; above `ln 510 = 6.23` everything is the same, and between 5.541 and there a value
//! is off by up to 12 %.

use relume::code::{Code, Curve, Scale, decode, encode};
use relume::color::Rgb;
use serde::Serialize;

use super::formats::{Half, Linear8, Log8, Rgb9e5, Rgbe, Sqrt8, Texel, TwoExposures};

/// Smallest and largest value that are tried, in units of the largest of a light.
const DECADES: [i32; 2] = [-7, 1];

/// Steps of a decade, and values that are tried in each.
const STEPS: i32 = 12;
const VALUES: i32 = 50;

/// The range of the exponential code, in units of its scale.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Range {
    /// Every value up to it is read back as 0.
    pub vanishes_below: f32,
    /// The smallest value above zero that is read back.
    pub smallest: f32,
    /// The largest that is read back without saturation.
    pub largest: f32,
    /// Every value from there on gets the saturated code.
    pub saturates_above: f32,
    /// Largest over smallest.
    pub ratio: f32,
    /// What the paper says.
    pub published: f64,
}

impl Range {
    /// Tries all codes, and searches the two ends.
    #[must_use]
    pub fn new() -> Self {
        let (smallest, largest) = (decode(1), decode(254));
        Self {
            vanishes_below: last(|x| encode(x) == 0),
            smallest,
            largest,
            saturates_above: last(|x| encode(x) < u8::MAX),
            ratio: largest / smallest,
            published: 5.541 * 255.0,
        }
    }
}

impl Default for Range {
    fn default() -> Self {
        Self::new()
    }
}

/// The largest value up to which something holds.
fn last(holds: impl Fn(f32) -> bool) -> f32 {
    let (mut low, mut high) = (0.0_f32.to_bits(), 16.0_f32.to_bits());
    while high - low > 1 {
        let middle = u32::midpoint(low, high);
        if holds(f32::from_bits(middle)) {
            low = middle;
        } else {
            high = middle;
        }
    }
    f32::from_bits(low)
}

/// The largest relative error around each value: `(value over the top of the light, error)`.
pub type Sweep = Vec<(f64, f64)>;

/// The errors of every format whose codes do not depend on the scene.
#[must_use]
pub fn sweeps() -> Vec<(&'static str, Sweep)> {
    let top = decode(254);
    let log = Curve::logarithmic(1e-12).unwrap_or(Curve::Exponential { scale: Scale::ONE });
    vec![
        ("exp8, exp8s", sweep(|x| decode(encode(x * top)) / top)),
        (
            Code::TilesLog.name(),
            sweep(|x| log.decode(log.encode(x, u16::MAX))),
        ),
        ("linear8", sweep(texel::<Linear8>)),
        ("sqrt8", sweep(texel::<Sqrt8>)),
        ("log8", sweep(texel::<Log8>)),
        ("f16", sweep(texel::<Half>)),
        ("rgb9e5", sweep(texel::<Rgb9e5>)),
        ("rgbe", sweep(texel::<Rgbe>)),
        ("two-exposure", sweep(texel::<TwoExposures>)),
    ]
}

/// A grey value there and back.
fn texel<T: Texel>(x: f32) -> f32 {
    let scale = T::scale(1.0);
    T::encode(Rgb::splat(x / scale)).decode().g * scale
}

fn sweep(there_and_back: impl Fn(f32) -> f32) -> Sweep {
    let [low, high] = DECADES.map(|decade| decade * STEPS);
    let steps = (low..high).map(|step| {
        let values = (0..VALUES).map(|part| {
            let decades = f64::from(step * VALUES + part) / f64::from(STEPS * VALUES);
            10.0_f64.powf(decades) as f32
        });
        let off = values.map(|x| f64::from((there_and_back(x) / x - 1.0).abs()));
        let middle = (f64::from(step) + 0.5) / f64::from(STEPS);
        (10.0_f64.powf(middle), off.fold(0.0, f64::max))
    });
    steps.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_range_is_the_published_one_but_for_its_smallest_step() {
        let range = Range::new();
        assert!((range.largest - 255.0_f32.ln()).abs() < 1e-4, "{range:?}");
        assert!((range.ratio - 1410.0).abs() < 1.0, "{range:?}");
        // 0.5 / 255 in packed units: 1/510 but for the curve of the logarithm.
        assert!(
            (range.vanishes_below * 510.0 - 1.0).abs() < 2e-3,
            "{range:?}"
        );
        assert!(
            (range.saturates_above - 510.0_f32.ln()).abs() < 1e-3,
            "{range:?}"
        );
        // The paper's own division.
        assert!((range.published - 1413.0).abs() < 1.0);
        assert!((f64::from(range.largest) * 255.0 - range.published).abs() < 0.1);
    }

    #[test]
    fn sweeps_show_where_a_code_ends() {
        let sweeps = sweeps();
        let at = |name: &str, x: f64| {
            let (_, sweep) = sweeps.iter().find(|(n, _)| *n == name).unwrap();
            let near = sweep.iter().min_by(|a, b| {
                let distance = |p: &(f64, f64)| (p.0 / x).ln().abs();
                distance(a).total_cmp(&distance(b))
            });
            near.unwrap().1
        };
        // Vanished: all of it is off. Clipped: what is above the top.
        assert_eq!(at("exp8, exp8s", 1e-5), 1.0);
        assert!(at("exp8, exp8s", 5.0) > 0.7);
        assert_eq!(at("linear8", 1e-4), 1.0);
        assert!(at("tiles-log", 1e-6) < 0.0083 && at("tiles-log", 5.0) < 0.0083);
        assert!(at("log8", 1e-5) < 0.028 && at("f16", 1e-5) < 0.0006);
    }
}
