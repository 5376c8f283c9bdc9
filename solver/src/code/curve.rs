//! The map between the whole numbers that are stored and the values that they stand for.
//!
//! * Exponential: see [`decode`](super::decode), over a scale.
//! * Display: `x = w f(C)`, `C = step c` in units of 2^-12 display codes, with a white `w`,
//!   `f(C)` the linear value of the sRGB code `C` (IEC 61966-2-1) up to 255, and
//!   `f(C) = e^((C - 255) / K)` above, `K = 255 * 1.055 / 2.4 = 112.09`, which continues it with the
//!   same slope. `f` is *defined* by two tables, linear in between, so that a decoder needs no float: it is within
//!   7e-4 of the formula, relative to the value (the largest distance is at `C = 11`).
//! * Parts: the same `f`, but every 8 codes have a step of their own, [`PART_STEPS`]`[n] 2^unit`, `n` in four bits.
//! * Logarithmic: `x = 0` for code 0, else `x = 2^((first + c - 1) / N - 200)`, `N = 42` steps an
//!   octave, so that every positive float has a code.
//!
//! Error: a value gets the code whose value is nearest, so it is off by at most half the gap.
//! Between two neighbours of ratio `r` the relative error is at most `(r - 1) / (r + 1)`, in the middle;
//! for the logarithmic code `r = 2^(1/42)`, which gives **0.8252 %**.
//!
//! *Any mix keeps that.* With weights `w_m >= 0` and decoded `d_m = x_m (1 + e_m)`, `|e_m| <= e`:
//! `|sum w_m d_m - sum w_m x_m| = |sum w_m x_m e_m| <= sum w_m x_m |e_m| <= e sum w_m x_m`, because every
//! term is non-negative. So the relative error of a sum is at most `e` for every number of lights,
//! every mix and every exposure. Rounding of the tables adds less than 4e-6 of a value, that of an `f32` sum of `k`
//! lights less than `(k + 2) 2^-24`, that of integer sums of any range less than `k 2^-30`: together below
//! 0.83 % for 256 lights. (A decoded `f32` below 2^-135 is rounded to the grid of subnormal floats, which is
//! coarser than that; its [`Magnitude`] is not.)

use super::known::exponential;
use super::scale::Scale;
use super::tables::{POWERS, SRGB};
use super::{Known, decode, encode, error_bound};
use crate::math;

/// Steps of the logarithmic code in an octave.
pub const LOG_STEPS: u32 = 42;

/// The octave at which the logarithmic code begins, below all floats.
const LOG_BEGIN: i32 = -200;

/// Units of the display curve in a display code.
const UNITS: u32 = 1 << 12;

/// Parts of a curve of 256 codes.
pub const PARTS: usize = 32;

/// Codes of a part.
pub const PART_CODES: u16 = 8;

/// Steps that a part can have, times `2^unit`, in 2^-12 display codes: `256 * 2^(n / 7)`.
pub const PART_STEPS: [u16; 16] = [
    256, 283, 312, 345, 380, 420, 464, 512, 565, 624, 689, 761, 840, 927, 1024, 1131,
];

/// The largest unit of such steps.
pub const LARGEST_PART_UNIT: u8 = 11;

/// The largest code 0 of a curve of parts, in 1/16 display code.
pub const LARGEST_PART_FIRST: u16 = (1 << 12) - 1;

/// Display codes at white.
const WHITE: u32 = 255;

/// Display codes in a factor of e above white: `255 * 1.055 / 2.4`.
const CODES_PER_E: f32 = 112.093_75;

/// `2^40 / (CODES_PER_E ln 2 UNITS)`: octaves in a unit of the display curve above white, times 2^40.
const OCTAVES_PER_UNIT: u64 = 3_454_881;

/// A value without a float: `mantissa * 2^exponent`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Magnitude {
    /// 0, or what the value is made of.
    pub mantissa: u32,
    /// Power of two.
    pub exponent: i32,
}

impl Magnitude {
    /// The value as a float; rounded, and 0 or infinite where it leaves the range of floats.
    #[must_use]
    pub fn value(self) -> f32 {
        math::scale_by_power_of_two(self.mantissa as f32, self.exponent)
    }
}

/// What the codes of one channel of a light stand for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Curve {
    /// The exponential code of `x / scale`.
    Exponential {
        /// What one unit of the code is worth.
        scale: Scale,
    },
    /// Uniform in display codes.
    Display {
        /// The value at 255 display codes.
        white: Scale,
        /// From a code to the next, in 2^-12 display codes; at least 1.
        step: u32,
    },
    /// Uniform in display codes within each of 32 parts.
    Parts {
        /// The value at 255 display codes.
        white: Scale,
        /// Code 0, in 1/16 display code; at most [`LARGEST_PART_FIRST`].
        first: u16,
        /// The power of two on the steps; at most [`LARGEST_PART_UNIT`].
        unit: u8,
        /// Steps of the parts, as places in [`PART_STEPS`], two in a byte: the lower four bits come first.
        steps: [u8; PARTS / 2],
    },
    /// Uniform in logarithms, and zero.
    Logarithmic {
        /// Code 1, in steps above 2^-200.
        first: u32,
    },
}

impl Curve {
    /// Display steps of `step` codes from 0 on; `None` unless it is between 2^-12 and 2^16.
    #[must_use]
    pub fn display(white: Scale, step: f32) -> Option<Self> {
        let units = math::round(step * UNITS as f32);
        (1.0..=268_435_456.0)
            .contains(&units)
            .then_some(Self::Display {
                white,
                step: units as u32,
            })
    }

    /// Units of a display curve in display codes.
    #[must_use]
    pub fn display_codes(units: u32) -> f32 {
        units as f32 / UNITS as f32
    }

    /// Parts of the same step, with code 0 at `smallest`, or below by rounding, and code 255 at `largest` or above;
    /// `None` unless `0 <= smallest <= largest` and the curve reaches that far.
    #[must_use]
    pub fn display_between(white: Scale, smallest: f32, largest: f32) -> Option<Self> {
        let code = |value: f32| display_code(value / white.value());
        let first = math::floor(code(smallest) * 16.0);
        // A unit more outweighs the rounding of the code, which has 24 bits.
        let end = code(largest) * UNITS as f32 * (1.0 + f32::EPSILON) + 1.0;
        let is_legal = smallest >= 0.0 && smallest <= largest;
        if !(is_legal && first <= f32::from(LARGEST_PART_FIRST)) {
            return None;
        }
        let steps = (0..=LARGEST_PART_UNIT).flat_map(|unit| (0_u8..16).map(move |n| (unit, n)));
        let mut curves = steps.map(|(unit, n)| Self::Parts {
            white,
            first: first as u16,
            unit,
            steps: [n << 4 | n; PARTS / 2],
        });
        curves.find(|curve| curve.units(u8::MAX.into()) as f32 >= end)
    }

    /// Where a code lies on a display curve, in 2^-12 display codes; 0 on others.
    // Firmware has no room for a copy at every place that asks.
    #[inline(never)]
    fn units(&self, code: u16) -> u32 {
        match *self {
            Self::Display { step, .. } => step.saturating_mul(code.into()),
            Self::Parts {
                first,
                unit,
                ref steps,
                ..
            } => {
                let code = u16::from(byte(code));
                let (part, within) = (code / PART_CODES, code % PART_CODES);
                let pairs = usize::from(part / 2);
                let both = |pair: &u8| part_step(pair & 15) + part_step(pair >> 4);
                let mut before: u32 = steps.iter().take(pairs).map(both).sum();
                let pair = steps.get(pairs).copied().unwrap_or(0);
                let mut own = part_step(pair & 15);
                if part % 2 == 1 {
                    before += own;
                    own = part_step(pair >> 4);
                }
                let steps = before * u32::from(PART_CODES) + own * u32::from(within);
                u32::from(first) * (UNITS / 16) + (steps << unit.min(LARGEST_PART_UNIT))
            }
            Self::Exponential { .. } | Self::Logarithmic { .. } => 0,
        }
    }

    /// The logarithmic curve whose code 1 is at or below `smallest`, a positive float.
    #[must_use]
    pub fn logarithmic(smallest: f32) -> Option<Self> {
        if !(smallest > 0.0 && smallest.is_finite()) {
            return None;
        }
        let (_, exponent) = math::split_exponent(smallest);
        // `smallest` lies in [2^(exponent - 1), 2^exponent).
        let octave = (exponent - 1 - LOG_BEGIN).max(0) as u32;
        Some(Self::Logarithmic {
            first: octave * LOG_STEPS,
        })
    }

    /// What multiplies [`Self::magnitude`]: the scale, the white, or 1.
    #[must_use]
    pub fn factor(&self) -> f32 {
        self.scale().value()
    }

    /// [`Self::factor`], without floats.
    #[must_use]
    pub const fn scale(&self) -> Scale {
        match *self {
            Self::Exponential { scale }
            | Self::Display { white: scale, .. }
            | Self::Parts { white: scale, .. } => scale,
            Self::Logarithmic { .. } => Scale::ONE,
        }
    }

    /// The value of a code over [`Self::factor`], without floats.
    #[must_use]
    pub fn magnitude(&self, code: u16) -> Magnitude {
        match *self {
            Self::Exponential { .. } => exponential(code),
            Self::Display { .. } | Self::Parts { .. } => display_magnitude(self.units(code)),
            Self::Logarithmic { first } => {
                let Some(steps) = code.checked_sub(1) else {
                    return Magnitude {
                        mantissa: 0,
                        exponent: 0,
                    };
                };
                let level = first.saturating_add(steps.into());
                let fraction = ((level % LOG_STEPS) << 23) / LOG_STEPS;
                power(level / LOG_STEPS, fraction, LOG_BEGIN)
            }
        }
    }

    /// [`Self::magnitude`] of the codes of a byte, from 0 on. Display curves are walked along, which takes less than to begin anew with each code.
    pub fn magnitudes(&self) -> impl Iterator<Item = Magnitude> {
        let mut units = self.units(0);
        (0..=u8::MAX).map(move |code| {
            let step = match self {
                Self::Display { step, .. } => *step,
                Self::Parts { unit, steps, .. } => {
                    let part = u16::from(code) / PART_CODES;
                    let pair = steps.get(usize::from(part / 2)).copied().unwrap_or(0);
                    part_step(pair >> (part % 2 * 4) & 15) << (*unit).min(LARGEST_PART_UNIT)
                }
                Self::Exponential { .. } | Self::Logarithmic { .. } => {
                    return self.magnitude(code.into());
                }
            };
            let magnitude = display_magnitude(units);
            units = units.saturating_add(step);
            magnitude
        })
    }

    /// Whether a code has a value below 2^127, and so has its [`Self::magnitude`]; without floats.
    #[must_use]
    pub fn reaches<K: Known>(&self, code: u16) -> bool {
        let (value, scale) = (K::magnitude(self, code), self.scale());
        let octave = |mantissa: u64, exponent: i32| 64 - mantissa.leading_zeros() as i32 + exponent;
        let product = u64::from(value.mantissa) * u64::from(scale.mantissa());
        octave(value.mantissa.into(), value.exponent) <= 127
            && octave(product, value.exponent + i32::from(scale.exponent())) <= 127
    }

    /// The value of a code, at unit emission.
    #[must_use]
    pub fn decode(&self, code: u16) -> f32 {
        match self {
            Self::Exponential { scale } => decode(byte(code)) * scale.value(),
            Self::Display { .. } | Self::Parts { .. } | Self::Logarithmic { .. } => {
                self.magnitude(code).value() * self.factor()
            }
        }
    }

    /// The code, at most `last`, whose value is nearest; NaN and negative values are taken as 0, and
    /// a positive value gets a positive code on the logarithmic curve.
    #[must_use]
    pub fn encode(&self, value: f32, last: u16) -> u16 {
        let value = value.max(0.0);
        let guess = match *self {
            Self::Exponential { scale } => {
                return u16::from(encode(value / scale.value())).min(last);
            }
            Self::Display { white, step } => {
                display_code(value / white.value()) * UNITS as f32 / step as f32
            }
            Self::Parts {
                white,
                first,
                unit,
                steps,
            } => {
                let mut units = display_code(value / white.value()) * UNITS as f32;
                units -= f32::from(first) * (UNITS / 16) as f32;
                let places = steps.iter().flat_map(|pair| [pair & 15, pair >> 4]);
                let mut guess = 0.0;
                for (place, begin) in places.zip((0_u16..).step_by(PART_CODES.into())) {
                    let step = (part_step(place) << unit.min(LARGEST_PART_UNIT)) as f32;
                    guess = f32::from(begin) + units / step;
                    units -= f32::from(PART_CODES) * step;
                    if units < 0.0 {
                        break;
                    }
                }
                guess
            }
            Self::Logarithmic { .. } if value == 0.0 => return 0,
            Self::Logarithmic { first } => {
                let (fraction, exponent) = math::split_exponent(value);
                let octaves = math::ln(fraction) / core::f32::consts::LN_2;
                let begin = LOG_BEGIN as f32 + first as f32 / LOG_STEPS as f32;
                (exponent as f32 - begin + octaves) * LOG_STEPS as f32 + 1.0
            }
        };
        let lowest = u16::from(matches!(self, Self::Logarithmic { .. })).min(last);
        // Casts saturate.
        let guess = (math::round(guess) as u16).clamp(lowest, last);
        let candidates = [
            guess,
            guess.saturating_sub(1).max(lowest),
            guess.saturating_add(1).min(last),
        ];
        let distances = candidates.map(|code| ((self.decode(code) - value).abs(), code));
        let nearest = distances
            .into_iter()
            .min_by(|(a, _), (b, _)| a.total_cmp(b));
        nearest.map_or(guess, |(_, code)| code)
    }

    /// How far a value between those of code 0 and `last` can lie from that of its code.
    #[must_use]
    pub fn error_bound(&self, code: u16, last: u16) -> f32 {
        if let Self::Exponential { scale } = self {
            return error_bound(byte(code)) * scale.value();
        }
        let gap = |a: u16, b: u16| 0.5 * (self.decode(b) - self.decode(a));
        let below = gap(code.saturating_sub(1), code);
        let above = gap(code, code.saturating_add(1).min(last));
        // Nothing positive gets the logarithmic code 0.
        match (self, code) {
            (Self::Logarithmic { .. }, 0) => 0.0,
            (Self::Logarithmic { .. }, 1) => above,
            _ => below.max(above),
        }
    }
}

/// Codes of a curve of 256 levels.
fn byte(code: u16) -> u8 {
    u8::try_from(code).unwrap_or(u8::MAX)
}

/// The display code of a value over white: sRGB times 255, and the logarithm above it.
#[must_use]
pub fn display_code(u: f32) -> f32 {
    if u <= 0.003_130_8 {
        255.0 * 12.92 * u.max(0.0)
    } else if u <= 1.0 {
        255.0 * (1.055 * math::pow(u, 1.0 / 2.4) - 0.055)
    } else {
        255.0 + CODES_PER_E * math::ln(u)
    }
}

/// A step of a part by its place, in units.
fn part_step(place: u8) -> u32 {
    PART_STEPS
        .get(usize::from(place))
        .copied()
        .unwrap_or(0)
        .into()
}

/// `f(C)` for `C` in 2^-12 display codes.
fn display_magnitude(units: u32) -> Magnitude {
    if let Some(above) = units.checked_sub(WHITE * UNITS) {
        let octaves = u64::from(above) * OCTAVES_PER_UNIT;
        let fraction = (octaves >> 17) as u32 & ((1 << 23) - 1);
        return power((octaves >> 40) as u32, fraction, 0);
    }
    Magnitude {
        mantissa: srgb_linear(units),
        exponent: -31,
    }
}

/// Linear value of an sRGB code, white = 2^31; the code in units of 2^-12, at most 255.
#[must_use]
pub const fn srgb_linear(units: u32) -> u32 {
    let (index, rest) = (units / UNITS, units % UNITS);
    if index >= WHITE {
        return 1 << 31;
    }
    // The index is below the last of 256 entries.
    #[allow(clippy::indexing_slicing)]
    let (low, high) = (SRGB[index as usize], SRGB[index as usize + 1]);
    low + (((high - low) as u64 * rest as u64) >> 12) as u32
}

/// `2^(octave + fraction 2^-23 + begin)`.
fn power(octave: u32, fraction: u32, begin: i32) -> Magnitude {
    let (index, rest) = (fraction >> 16, fraction & 0xffff);
    let entry = |index: u32| u64::from(POWERS.get(index as usize).copied().unwrap_or(u32::MAX));
    let (low, high) = (entry(index), entry(index + 1));
    let mantissa = low + (((high - low) * u64::from(rest)) >> 16);
    Magnitude {
        mantissa: mantissa as u32,
        exponent: i32::try_from(octave).unwrap_or(i32::MAX / 2) + begin - 31,
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use proptest::prelude::*;

    /// The formula of the display curve, in `f64`.
    fn display_exact(code: f64) -> f64 {
        let c = code / 255.0;
        if c <= 0.040_45 {
            c / 12.92
        } else if c <= 1.0 {
            ((c + 0.055) / 1.055).powf(2.4)
        } else {
            ((code - 255.0) / (255.0 * 1.055 / 2.4)).exp()
        }
    }

    #[test]
    fn the_display_table_is_the_formula() {
        for units in (0..5_000_000_u32).step_by(97) {
            let code = f64::from(units) / f64::from(UNITS);
            let found = display_magnitude(units);
            let found = f64::from(found.mantissa) * 2.0_f64.powi(found.exponent);
            let exact = display_exact(code);
            // The chord from 10 to 11 over the kink at 10.31: 9e-4; beyond, the second derivative,
            // 2.4 * 1.4 / (C + 14)^2 over 8: at most 7e-4; 2^-31 absolute from the table.
            let bound = 9e-4 * exact + 1e-9;
            assert!(
                (found - exact).abs() <= bound,
                "C = {code}: {found} {exact}"
            );
        }
    }

    #[test]
    fn curves_never_fall() {
        let white = Scale::at_least(0.3).unwrap();
        let curves = [
            Curve::Exponential { scale: white },
            Curve::display(white, 1.85).unwrap(),
            Curve::display_between(white, 0.01, 99.0).unwrap(),
            Curve::logarithmic(1e-6).unwrap(),
        ];
        for curve in curves {
            for code in 0..255 {
                let (a, b) = (curve.decode(code), curve.decode(code + 1));
                assert!(a < b, "{curve:?} {code}: {a} {b}");
                let (a, b) = (
                    curve.magnitude(code).value(),
                    curve.magnitude(code + 1).value(),
                );
                assert!(a < b, "{curve:?} {code}: {a} {b}");
            }
        }
    }

    #[test]
    fn logarithmic_steps_are_a_42nd_of_an_octave() {
        let curve = Curve::logarithmic(1.0).unwrap();
        assert_eq!(curve.decode(0), 0.0);
        for code in 1..2000_u16 {
            let exact = 2.0_f64.powf(f64::from(code - 1) / 42.0);
            let found = curve.magnitude(code);
            let found = f64::from(found.mantissa) * 2.0_f64.powi(found.exponent);
            // Interpolation in 128 parts of an octave: (ln 2 / 128)^2 / 8.
            assert!(
                (found / exact - 1.0).abs() < 3.8e-6,
                "{code}: {found} {exact}"
            );
        }
    }

    #[test]
    fn a_walk_along_a_curve_meets_what_each_code_has() {
        let white = Scale::ONE;
        let parts = |unit, steps| Curve::Parts {
            white,
            first: 77,
            unit,
            steps,
        };
        let curves = [
            Curve::Exponential { scale: white },
            Curve::display(white, 1.7).unwrap(),
            // Its units do not fit 32 bits.
            Curve::display(white, 60_000.0).unwrap(),
            Curve::logarithmic(1e-5).unwrap(),
            parts(0, [0x10; PARTS / 2]),
            parts(
                LARGEST_PART_UNIT,
                core::array::from_fn(|pair| (pair * 83 % 256) as u8),
            ),
        ];
        for curve in curves {
            assert_eq!(curve.magnitudes().count(), 256);
            for (code, magnitude) in (0..).zip(curve.magnitudes()) {
                assert_eq!(magnitude, curve.magnitude(code), "{curve:?} {code}");
            }
        }
    }

    fn positive() -> impl Strategy<Value = f32> {
        // Subnormal ones too.
        (1_u32..0x7f80_0000).prop_map(f32::from_bits)
    }

    proptest! {
        #[test]
        fn the_logarithmic_error_is_proven(smallest in positive(), ratio in 0.0_f32..1.0) {
            let curve = Curve::logarithmic(smallest).unwrap();
            let span = 65_000.0 / LOG_STEPS as f32;
            let octaves = (ratio * (127.9 - smallest.log2())).min(span);
            let value = (smallest.log2() + octaves).exp2().clamp(smallest, f32::MAX);
            let code = curve.encode(value, u16::MAX);
            let magnitude = curve.magnitude(code);
            let found = f64::from(magnitude.mantissa) * 2.0_f64.powi(magnitude.exponent);
            let error = (found / f64::from(value) - 1.0).abs();
            // A subnormal value is compared with decoded floats that are rounded to its own grid.
            let grid = 2.0_f64.powi(-149) / f64::from(value);
            prop_assert!(code > 0 && error <= 0.008_257 + grid, "{value:e} {code} {error}");
            let shown = f64::from(curve.decode(code));
            let bound = (0.008_257 * f64::from(value)).max(2.0_f64.powi(-149));
            prop_assert!((shown - f64::from(value)).abs() <= bound, "{value:e} {code} {shown:e}");
        }

        #[test]
        fn nearest_codes_are_within_their_bound(
            white in 1e-6_f32..1e6, smallest in 0.0_f32..1.0, headroom in 1.0_f32..1e4, at in 0.0_f32..1.0,
        ) {
            let scale = Scale::at_least(white).unwrap();
            let (smallest, largest) = (smallest * white, headroom * white);
            let curve = Curve::display_between(scale, smallest, largest).unwrap();
            prop_assert!(curve.decode(0) <= smallest * 1.001 && curve.decode(255) >= largest * 0.9999, "{curve:?}");
            let value = smallest + at * at * at * (largest - smallest);
            let code = curve.encode(value, 255);
            let (error, bound) = ((curve.decode(code) - value).abs(), curve.error_bound(code, 255));
            prop_assert!(error <= bound * 1.001 + value * 1e-4, "{value} {code} {error} {bound} {curve:?}");
        }
    }

    #[test]
    fn what_no_curve_reaches_is_refused() {
        let white = Scale::ONE;
        assert_eq!(Curve::logarithmic(0.0), None);
        assert_eq!(Curve::logarithmic(f32::NAN), None);
        assert_eq!(Curve::display(white, 0.0), None);
        assert_eq!(Curve::display(white, f32::INFINITY), None);
        assert_eq!(Curve::display_between(white, -1.0, 1.0), None);
        assert_eq!(Curve::display_between(white, 2.0, 1.0), None);
        assert_eq!(Curve::display_between(white, 0.0, f32::NAN), None);
        assert_eq!(Curve::display_between(white, 0.0, f32::INFINITY), None);
    }
}
