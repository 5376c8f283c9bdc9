//! The exponential code as published, its table and its stated error.
//!
//! `c = round(255 (1 - e^-x))`, decoded as `x = -ln(1 - c / 255)` (adjustable global illumination
//! with per-light lightmaps, section 2.3: range 5.541 at code 254 to 0.00393 at code 1, 1:1410).
//! Code 255 is *saturated*: it stands for every `x >= ln 510` and decodes to just that.
//! A *scale* `s` in front of the code, `x = value / s`, puts the range where the values are.
//!
//! Error: a code below 255 stands for `x` between the values that round to its neighbours,
//! `-ln(1 - (c -+ 1/2) / 255)`; [`error_bound`] is the larger distance to either end. In units of
//! the scale it grows from 0.00197 at code 0 to 0.693 at code 254. Everything below 0.00197 of the
//! scale becomes 0 (dead zone).

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

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
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
}
