//! Values and their 8-bit codes: the exponential code, its tables and its stated error.
//!
//! `c = round(255 (1 - e^-x))`, decoded as `x = -ln(1 - c / 255)` (adjustable global illumination
//! with per-light lightmaps, section 2.3: range 5.541 at code 254 to 0.00393 at code 1, 1:1410).
//! Code 255 is *saturated*: it stands for every `x >= ln 510` and decodes to just that.
//! A *scale* `s` in front of the code, `x = value / s`, shared by the channels of a light, puts
//! the range where the light's values are.
//!
//! Error: a code below 255 stands for `x` between the values that round to its neighbours,
//! `-ln(1 - (c -+ 1/2) / 255)`; [`error_bound`] is the larger distance to either end. In units of
//! the scale it grows from 0.00197 at code 0 to 0.693 at code 254. Everything below 0.00197 of the
//! scale becomes 0 (dead zone).

use core::fmt;

use crate::math;

/// The largest value, in scales, that decodes without saturation: `ln 255`, code 254.
pub const LARGEST: f32 = 5.541_263_5;

/// What the saturated code 255 decodes to, in scales: `ln 510`.
pub const SATURATED: f32 = 6.234_411;

/// Fractional bits of [`DECODED`].
pub const DECODED_BITS: u32 = 13;

/// `round(2^13 x)` for every code: decoding without floats. Largest value 51 072.
#[rustfmt::skip]
pub static DECODED: [u16; 256] = [
    0, 32, 65, 97, 130, 162, 195, 228, 261, 294, 328, 361,
    395, 429, 463, 497, 531, 565, 600, 634, 669, 704, 739, 774,
    810, 845, 881, 917, 953, 989, 1025, 1062, 1098, 1135, 1172, 1209,
    1247, 1284, 1322, 1360, 1398, 1436, 1474, 1513, 1552, 1591, 1630, 1669,
    1708, 1748, 1788, 1828, 1868, 1909, 1949, 1990, 2031, 2073, 2114, 2156,
    2198, 2240, 2282, 2325, 2367, 2410, 2454, 2497, 2541, 2585, 2629, 2673,
    2718, 2763, 2808, 2853, 2899, 2945, 2991, 3037, 3084, 3131, 3178, 3226,
    3274, 3322, 3370, 3419, 3467, 3517, 3566, 3616, 3666, 3716, 3767, 3818,
    3870, 3921, 3973, 4026, 4078, 4131, 4185, 4238, 4292, 4347, 4402, 4457,
    4512, 4568, 4625, 4681, 4738, 4796, 4854, 4912, 4971, 5030, 5090, 5150,
    5210, 5271, 5332, 5394, 5456, 5519, 5582, 5646, 5710, 5775, 5840, 5906,
    5973, 6039, 6107, 6175, 6243, 6313, 6382, 6453, 6524, 6595, 6667, 6740,
    6814, 6888, 6963, 7038, 7114, 7191, 7269, 7347, 7426, 7506, 7587, 7668,
    7751, 7834, 7918, 8003, 8089, 8175, 8263, 8352, 8441, 8532, 8623, 8716,
    8809, 8904, 9000, 9097, 9195, 9294, 9395, 9496, 9600, 9704, 9810, 9917,
    10_025, 10_135, 10_247, 10_360, 10_474, 10_590, 10_708, 10_828, 10_949, 11_072, 11_197, 11_324,
    11_453, 11_585, 11_718, 11_853, 11_991, 12_131, 12_273, 12_418, 12_566, 12_716, 12_869, 13_025,
    13_185, 13_347, 13_512, 13_681, 13_854, 14_030, 14_210, 14_394, 14_582, 14_775, 14_972, 15_175,
    15_382, 15_595, 15_813, 16_038, 16_269, 16_506, 16_751, 17_003, 17_263, 17_531, 17_809, 18_097,
    18_395, 18_704, 19_025, 19_359, 19_708, 20_072, 20_453, 20_853, 21_273, 21_716, 22_184, 22_681,
    23_210, 23_775, 24_382, 25_038, 25_750, 26_531, 27_394, 28_359, 29_453, 30_716, 32_210, 34_038,
    36_394, 39_716, 45_394, 51_072,
];

/// Which code an atlas is written in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Code {
    /// As published: one scale for all lights.
    Exp8,
    /// One scale per light, which puts its largest value on code 254.
    Exp8s,
}

impl Code {
    /// Every code, in the order of their numbers in files.
    pub const ALL: [Self; 2] = [Self::Exp8, Self::Exp8s];

    /// The name on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Exp8 => "exp8",
            Self::Exp8s => "exp8s",
        }
    }
}

impl fmt::Display for Code {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// The code of `x`, in scales. NaN and negative values give 0.
#[must_use]
pub fn encode(x: f32) -> u8 {
    if x > 0.0 {
        // Casts saturate; the value is in [0, 255].
        math::round(-255.0 * math::exp_m1(-x)) as u8
    } else {
        0
    }
}

/// The value of a code, in scales.
#[must_use]
pub fn decode(code: u8) -> f32 {
    if code == u8::MAX {
        return SATURATED;
    }
    -math::ln_1p(-f32::from(code) / 255.0)
}

/// How far a value that got this code can lie from [`decode`], in scales; infinite for 255.
#[must_use]
pub fn error_bound(code: u8) -> f32 {
    if code == u8::MAX {
        return f32::INFINITY;
    }
    let edge = |half: f32| -math::ln_1p(-(f32::from(code) + half) / 255.0);
    let value = decode(code);
    (edge(0.5) - value).max(value - edge(-0.5).max(0.0))
}

/// All 256 values of [`decode`], for kernels that look codes up.
#[derive(Clone, Debug)]
pub struct DecodeTable([f32; 256]);

impl DecodeTable {
    /// Computes the table.
    #[must_use]
    pub fn new() -> Self {
        let mut table = [0.0; 256];
        for (value, code) in table.iter_mut().zip(0..=u8::MAX) {
            *value = decode(code);
        }
        Self(table)
    }

    /// The value of a code, in scales.
    #[must_use]
    pub fn decode(&self, code: u8) -> f32 {
        lookup(&self.0, code)
    }
}

impl Default for DecodeTable {
    fn default() -> Self {
        Self::new()
    }
}

/// The value of a code, in 2^-13 scales.
#[must_use]
pub fn decode_fixed(code: u8) -> u16 {
    lookup(&DECODED, code)
}

fn lookup<T: Copy>(table: &[T; 256], code: u8) -> T {
    // A byte cannot leave a table of 256.
    #[allow(clippy::indexing_slicing)]
    table[code as usize]
}

/// A positive scale as a 16-bit mantissa and a power of two: `mantissa * 2^exponent`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Scale {
    mantissa: u16,
    exponent: i16,
}

impl Scale {
    /// One.
    pub const ONE: Self = Self {
        mantissa: 1 << 15,
        exponent: -15,
    };

    /// The smallest scale not below `value`; `None` unless both are normal positive floats.
    #[must_use]
    pub fn at_least(value: f32) -> Option<Self> {
        if !(value > 0.0 && value.is_normal()) {
            return None;
        }
        let (fraction, exponent) = math::split_exponent(value);
        let mantissa = math::ceil(math::scale_by_power_of_two(fraction, 16));
        let (mantissa, exponent) = if mantissa > f32::from(u16::MAX) {
            (1 << 15, exponent - 15)
        } else {
            (mantissa as u16, exponent - 16)
        };
        let scale = Self {
            mantissa,
            exponent: exponent as i16,
        };
        scale.value().is_normal().then_some(scale)
    }

    /// The scale that puts `largest` on code 254; [`Self::ONE`] for a light that is
    /// dark, or too dim for the range of floats.
    ///
    /// `None` for a value that is negative or not finite.
    #[must_use]
    pub fn fitting(largest: f32) -> Option<Self> {
        if !(largest >= 0.0 && largest.is_finite()) {
            return None;
        }
        Some(Self::at_least(largest / LARGEST).unwrap_or(Self::ONE))
    }

    /// From its parts as stored; `None` unless the mantissa has its top bit set and the value is a
    /// finite, normal `f32`.
    #[must_use]
    pub fn from_parts(mantissa: u16, exponent: i16) -> Option<Self> {
        let scale = Self { mantissa, exponent };
        (mantissa >= 1 << 15 && scale.value().is_normal()).then_some(scale)
    }

    /// Mantissa, in [32 768, 65 535].
    #[must_use]
    pub const fn mantissa(self) -> u16 {
        self.mantissa
    }

    /// Power of two.
    #[must_use]
    pub const fn exponent(self) -> i16 {
        self.exponent
    }

    /// The value.
    #[must_use]
    pub fn value(self) -> f32 {
        math::scale_by_power_of_two(f32::from(self.mantissa), i32::from(self.exponent))
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    #[test]
    fn every_code_decodes_and_encodes_to_itself() {
        for code in 0..=u8::MAX {
            assert_eq!(encode(decode(code)), code, "decoded {}", decode(code));
        }
    }

    #[test]
    fn published_figures() {
        assert!((decode(254) - 255.0_f32.ln()).abs() < 1e-4);
        assert!((decode(254) / decode(1) - 1410.0).abs() < 1.0);
        assert_eq!(encode(1.0), 161);
        assert_eq!(encode(f32::INFINITY), 255);
        assert_eq!(encode(f32::NAN), 0);
        assert_eq!(encode(-1.0), 0);
    }

    #[test]
    fn every_value_lies_within_the_bound_of_its_code() {
        let steps: Vec<f32> = (0..400_000).map(|i| i as f32 * 1.6e-5).collect();
        let mut worst = [0.0_f32; 256];
        for x in steps {
            let code = encode(x);
            worst[code as usize] = worst[code as usize].max((decode(code) - x).abs());
        }
        for code in 0..u8::MAX {
            let (found, bound) = (worst[code as usize], error_bound(code));
            assert!(
                found <= bound * (1.0 + 1e-4),
                "code {code}: {found} > {bound}"
            );
            assert!(
                found >= bound * 0.95,
                "code {code}: the bound {bound} is loose ({found})"
            );
        }
        assert_eq!(error_bound(255), f32::INFINITY);
    }

    #[test]
    fn the_fixed_table_rounds_the_float_one() {
        let one = f32::from(1_u16 << DECODED_BITS);
        for code in 0..=u8::MAX {
            let exact = decode(code) * one;
            let fixed = f32::from(decode_fixed(code));
            assert!(
                (exact - fixed).abs() <= 0.502,
                "code {code}: {exact} {fixed}"
            );
        }
    }

    proptest! {
        #[test]
        fn scales_are_close_from_above(value in 1e-30_f32..1e30) {
            let scale = Scale::at_least(value).unwrap();
            prop_assert!(scale.value() >= value, "{scale:?}");
            prop_assert!(scale.value() <= value * (1.0 + 1.0 / 32768.0), "{scale:?}");
            prop_assert_eq!(Scale::from_parts(scale.mantissa(), scale.exponent()), Some(scale));
        }

        #[test]
        fn nothing_saturates_at_its_own_scale(largest in 1e-30_f32..1e30) {
            let scale = Scale::fitting(largest).unwrap();
            prop_assert!(encode(largest / scale.value()) <= 254, "{largest} {scale:?}");
        }
    }

    #[test]
    fn illegal_scales_are_refused() {
        for value in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            assert_eq!(Scale::at_least(value), None, "{value}");
        }
        assert_eq!(Scale::fitting(0.0), Some(Scale::ONE));
        assert_eq!(Scale::from_parts(1, 0), None);
        assert_eq!(Scale::from_parts(40_000, 300), None);
    }
}
