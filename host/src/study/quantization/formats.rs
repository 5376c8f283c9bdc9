//! Formats in which others store contributions: one texel of fixed length for every element and light.
//!
//! A value is divided by the scale of its light first; the scale is multiplied into the weight of the light, so that it
//! costs nothing while relighting. In units of the scale, `x` in [0, 1] for the 8-bit formats:
//!
//! * `linear8`: `c = round(255 x)`. Error at most 1/510.
//! * `sqrt8`: `c = round(255 sqrt(x))`. Error at most `sqrt(x) / 255 + 1/510^2`.
//! * `log8`: `x = R^((c - 255) / 254)` for `c` in 1..=255, range `R = 10^6`, and 0. Relative error at most
//!   `R^(1/508) - 1 = 2.76 %`; below `R^-1` at most half of that.
//! * `f16`: IEEE 754 binary16. Relative error at most 2^-11 from 2^-14 on.
//! * `rgb9e5`: three mantissas of 9 bits and one exponent of 5 (`EXT_texture_shared_exponent`, 2004). Error at most
//!   `largest channel / 511`.
//! * `rgbe`: three mantissas of 8 bits, cut off, and one exponent of 8 (G. Ward, *Real pixels*, 1991). Error at
//!   most `largest channel / 256`.
//! * `two-exposure`: two RGB textures of 8 bits, one of them exposed 16 times longer; it counts where it is not saturated.
//!   (J. Cohen et al., *Real-time high dynamic range texture mapping*, 2001, keep two exposures of a stack in
//!   memory; the factor is ours.) Error at most 1/8160 below 1/16 (nearly), 1/510 above.
//!
//! Values are not negative and not above the largest one of their scale.

use std::sync::LazyLock;

use half::f16;
use relume::color::Rgb;

use crate::solution::Solution;

/// A contribution in some format.
pub trait Texel: Copy + Send + Sync {
    /// Bits of an RGB triple.
    const BITS: u32;

    /// The scale of a light, above zero, given its largest value.
    fn scale(largest: f32) -> f32;

    /// The texel of a value over the scale.
    fn encode(value: Rgb) -> Self;

    /// The value over the scale.
    fn decode(self) -> Rgb;
}

/// The largest value, or 1 for a dark light.
fn largest_or_one(largest: f32) -> f32 {
    if largest > 0.0 { largest } else { 1.0 }
}

/// A power of two that brings the largest value into [2^14, 2^15).
fn power_of_two(largest: f32) -> f32 {
    let below = f32::from_bits(largest.to_bits() & 0x7f80_0000);
    largest_or_one(below / 16_384.0)
}

/// `2^exponent`, within the range of normal floats.
fn power(exponent: i32) -> f32 {
    f32::from_bits(((exponent + 127).clamp(1, 254) as u32) << 23)
}

/// The exponent of a float: `floor(log2 x)`.
const fn exponent(x: f32) -> i32 {
    (x.to_bits() >> 23) as i32 - 127
}

/// The nearest of 256 levels of [0, 1].
fn level(x: f32) -> u8 {
    // Casts saturate.
    (255.0 * x).round() as u8
}

/// Uniform.
#[derive(Clone, Copy, Debug)]
pub struct Linear8([u8; 3]);

impl Texel for Linear8 {
    const BITS: u32 = 24;

    fn scale(largest: f32) -> f32 {
        largest_or_one(largest)
    }

    fn encode(value: Rgb) -> Self {
        Self(value.to_array().map(level))
    }

    fn decode(self) -> Rgb {
        Rgb::from_array(self.0.map(|code| f32::from(code) / 255.0))
    }
}

/// Uniform in square roots.
#[derive(Clone, Copy, Debug)]
pub struct Sqrt8([u8; 3]);

impl Texel for Sqrt8 {
    const BITS: u32 = 24;

    fn scale(largest: f32) -> f32 {
        largest_or_one(largest)
    }

    fn encode(value: Rgb) -> Self {
        Self(value.to_array().map(|x| level(x.sqrt())))
    }

    fn decode(self) -> Rgb {
        Rgb::from_array(self.0.map(|code| (f32::from(code) / 255.0).powi(2)))
    }
}

/// Uniform in logarithms.
#[derive(Clone, Copy, Debug)]
pub struct Log8([u8; 3]);

/// Largest over smallest value of [`Log8`].
const LOG_RANGE: f32 = 1e6;

/// What the codes of [`Log8`] stand for.
static LOG_VALUES: LazyLock<[f32; 256]> = LazyLock::new(|| {
    std::array::from_fn(|code| match code {
        0 => 0.0,
        code => LOG_RANGE.powf((code as f32 - 255.0) / 254.0),
    })
});

impl Texel for Log8 {
    const BITS: u32 = 24;

    fn scale(largest: f32) -> f32 {
        largest_or_one(largest)
    }

    fn encode(value: Rgb) -> Self {
        Self(value.to_array().map(|x| {
            if x < 0.5 / LOG_RANGE {
                return 0;
            }
            let code = 255.0 + 254.0 * x.ln() / LOG_RANGE.ln();
            code.round().max(1.0) as u8
        }))
    }

    fn decode(self) -> Rgb {
        let values = &*LOG_VALUES;
        Rgb::from_array(self.0.map(|code| values[usize::from(code)]))
    }
}

/// Half floats.
#[derive(Clone, Copy, Debug)]
pub struct Half([f16; 3]);

impl Texel for Half {
    const BITS: u32 = 48;

    fn scale(largest: f32) -> f32 {
        power_of_two(largest)
    }

    fn encode(value: Rgb) -> Self {
        Self(value.to_array().map(f16::from_f32))
    }

    fn decode(self) -> Rgb {
        Rgb::from_array(self.0.map(f16::to_f32))
    }
}

/// 9 bits for each mantissa from the lowest bit on, and 5 for the exponent.
#[derive(Clone, Copy, Debug)]
pub struct Rgb9e5(u32);

impl Rgb9e5 {
    const MANTISSA: u32 = 9;
    const BIAS: i32 = 15;

    /// What a step of a mantissa is worth.
    fn step(biased: i32) -> f32 {
        power(biased - Self::BIAS - Self::MANTISSA as i32)
    }
}

impl Texel for Rgb9e5 {
    const BITS: u32 = 32;

    fn scale(largest: f32) -> f32 {
        power_of_two(largest)
    }

    fn encode(value: Rgb) -> Self {
        let largest = value.max_channel();
        let mut biased = exponent(largest).max(-Self::BIAS - 1) + 1 + Self::BIAS;
        if (largest / Self::step(biased)).round() >= f32::from(1_u16 << Self::MANTISSA) {
            biased += 1;
        }
        let mantissa = |x: f32| (x / Self::step(biased)).round() as u32;
        let [r, g, b] = value.to_array().map(mantissa);
        Self(
            r | g << Self::MANTISSA
                | b << (2 * Self::MANTISSA)
                | (biased as u32) << (3 * Self::MANTISSA),
        )
    }

    fn decode(self) -> Rgb {
        let step = Self::step((self.0 >> (3 * Self::MANTISSA)) as i32);
        let mantissa = |place: u32| {
            let bits = self.0 >> (place * Self::MANTISSA) & ((1 << Self::MANTISSA) - 1);
            bits as f32 * step
        };
        Rgb::new(mantissa(0), mantissa(1), mantissa(2))
    }
}

/// Three mantissas and the exponent, 0 for black.
#[derive(Clone, Copy, Debug)]
pub struct Rgbe([u8; 4]);

impl Rgbe {
    /// What a step of a mantissa is worth: values are below `2^(exponent - 128)`.
    fn step(biased: u8) -> f32 {
        power(i32::from(biased) - 128 - 8)
    }
}

impl Texel for Rgbe {
    const BITS: u32 = 32;

    fn scale(largest: f32) -> f32 {
        power_of_two(largest)
    }

    fn encode(value: Rgb) -> Self {
        let largest = value.max_channel();
        if largest < 1e-32 {
            return Self([0; 4]);
        }
        let biased = (exponent(largest) + 1 + 128) as u8;
        let [r, g, b] = value.to_array().map(|x| (x / Self::step(biased)) as u8);
        Self([r, g, b, biased])
    }

    fn decode(self) -> Rgb {
        let [r, g, b, biased] = self.0;
        if biased == 0 {
            return Rgb::BLACK;
        }
        // The middle of what was cut off.
        let step = Self::step(biased);
        Rgb::from_array([r, g, b].map(|mantissa| (f32::from(mantissa) + 0.5) * step))
    }
}

/// A long exposure and a short one.
#[derive(Clone, Copy, Debug)]
pub struct TwoExposures([[u8; 3]; 2]);

/// The ratio of their times.
const EXPOSURES: f32 = 16.0;

impl Texel for TwoExposures {
    const BITS: u32 = 48;

    fn scale(largest: f32) -> f32 {
        largest_or_one(largest)
    }

    fn encode(value: Rgb) -> Self {
        let value = value.to_array();
        Self([value.map(|x| level(EXPOSURES * x)), value.map(level)])
    }

    fn decode(self) -> Rgb {
        let [long, short] = self.0;
        let value = |channel: usize| match long[channel] {
            u8::MAX => f32::from(short[channel]) / 255.0,
            code => f32::from(code) / (255.0 * EXPOSURES),
        };
        Rgb::new(value(0), value(1), value(2))
    }
}

/// What a scale is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scope {
    /// Every light has its own.
    Light,
    /// All lights at nominal emission have one.
    All,
}

/// All contributions of a solution in a format.
#[derive(Clone, Debug)]
pub struct Coded<T> {
    /// Element by element, light by light.
    texels: Vec<T>,
    /// Of every light.
    scales: Vec<f32>,
}

impl<T: Texel> Coded<T> {
    /// Encodes a solution.
    #[must_use]
    pub fn new(solution: &Solution, scope: Scope) -> Self {
        let nominal = solution.nominal_mix();
        let mut largest = vec![0.0_f32; nominal.len()];
        for values in solution.contributions.chunks(nominal.len().max(1)) {
            for (largest, value) in largest.iter_mut().zip(values) {
                *largest = largest.max(value.max_channel());
            }
        }
        if scope == Scope::All {
            let strength = |emission: &Rgb| largest_or_one(emission.max_channel());
            let strongest = largest.iter().zip(&nominal);
            let strongest = strongest.map(|(largest, emission)| largest * strength(emission));
            let strongest = strongest.fold(0.0, f32::max);
            let own = nominal
                .iter()
                .map(|emission| strongest / strength(emission));
            largest = own.collect();
        }
        let scales: Vec<f32> = largest.into_iter().map(T::scale).collect();
        let elements = solution.contributions.chunks(scales.len().max(1));
        let texels = elements.flat_map(|values| {
            let values = values.iter().zip(&scales);
            values.map(|(value, scale)| T::encode(value.map(|x| x / scale)))
        });
        Self {
            texels: texels.collect(),
            scales,
        }
    }

    /// The contributions as they are read back.
    #[must_use]
    pub fn decoded(&self) -> Vec<Rgb> {
        let elements = self.texels.chunks(self.scales.len().max(1));
        let values = elements.flat_map(|texels| {
            let texels = texels.iter().zip(&self.scales);
            texels.map(|(texel, scale)| texel.decode() * *scale)
        });
        values.collect()
    }

    /// Irradiance of every element under a mix.
    pub fn relight(&self, mix: &[Rgb], irradiance: &mut [Rgb]) {
        let weights = mix.iter().zip(&self.scales);
        let weights: Vec<Rgb> = weights.map(|(weight, scale)| *weight * *scale).collect();
        let elements = self.texels.chunks(weights.len().max(1));
        for (sum, texels) in irradiance.iter_mut().zip(elements) {
            let texels = texels.iter().zip(&weights);
            *sum = texels.fold(Rgb::BLACK, |sum, (texel, weight)| {
                sum + texel.decode() * *weight
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The largest difference of a channel after a round trip.
    fn off<T: Texel>(value: Rgb) -> [f32; 3] {
        let found = T::encode(value).decode();
        (found - value).map(f32::abs).to_array()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4000))]

        #[test]
        fn values_stay_within_the_stated_errors(logs in [-8.0_f32..0.0, -8.0_f32..0.0, -8.0_f32..0.0]) {
            let value = Rgb::from_array(logs.map(|log| 10.0_f32.powf(log)));
            let bright = value * 32_767.0;
            let rounding = 1.0 + 1e-4;
            for (channel, x) in value.to_array().into_iter().enumerate() {
                let within = |off: [f32; 3], bound: f32| off[channel] <= bound * rounding;
                prop_assert!(within(off::<Linear8>(value), 1.0 / 510.0));
                prop_assert!(within(off::<Sqrt8>(value), x.sqrt() / 255.0 + 1.0 / (510.0 * 510.0)));
                let ratio = LOG_RANGE.powf(1.0 / 508.0) - 1.0;
                prop_assert!(within(off::<Log8>(value), (ratio * x).max(0.5 / LOG_RANGE)), "{x}");
                let exposures = if 16.0 * x < 254.5 / 255.0 { EXPOSURES } else { 1.0 };
                prop_assert!(within(off::<TwoExposures>(value), 1.0 / (510.0 * exposures)), "{x}");

                let (x, largest) = (x * 32_767.0, bright.max_channel());
                prop_assert!(within(off::<Half>(bright), (x / 2048.0).max(power(-25))), "{x}");
                prop_assert!(within(off::<Rgb9e5>(bright), (largest / 511.0).max(power(-25))), "{x}");
                prop_assert!(within(off::<Rgbe>(bright), largest / 256.0), "{x}");
            }
        }

        #[test]
        fn scales_bring_the_largest_value_where_the_format_has_it(largest in 1e-30_f32..1e30) {
            prop_assert_eq!(largest / Linear8::scale(largest), 1.0);
            let top = largest / Half::scale(largest);
            prop_assert!((16_384.0..32_768.0).contains(&top));
            prop_assert_eq!(Half::scale(largest).to_bits() & 0x007f_ffff, 0, "no power of two");
        }
    }

    /// What black and a largest value of 3 are read back as.
    fn ends<T: Texel>() -> [Rgb; 2] {
        let scale = T::scale(3.0);
        let top = T::encode(Rgb::splat(3.0 / scale)).decode() * scale;
        [T::encode(Rgb::BLACK).decode(), top]
    }

    #[test]
    fn black_is_black_and_the_largest_value_is_there() {
        let exact = [
            ends::<Linear8>(),
            ends::<Sqrt8>(),
            ends::<Log8>(),
            ends::<Half>(),
            ends::<Rgb9e5>(),
            ends::<TwoExposures>(),
        ];
        for [black, top] in exact {
            assert_eq!(black, Rgb::BLACK);
            assert!((top.g - 3.0).abs() < 1e-5, "{top:?}");
        }
        let [black, top] = ends::<Rgbe>();
        assert_eq!(black, Rgb::BLACK);
        // What is read is the middle of a step of 2 / 128.
        assert!((top.g - 3.0).abs() <= 1.0 / 128.0, "{top:?}");
    }

    #[test]
    fn shared_exponents_are_those_of_the_extension() {
        // The specification's own: the largest value is 65408, a mantissa of 511 with exponent 31.
        assert_eq!(Rgb9e5::encode(Rgb::splat(65_408.0)).0, u32::MAX);
        // One is 256 * 2^-8, exponent 16.
        assert_eq!(Rgb9e5::encode(Rgb::new(1.0, 0.0, 0.0)).0, 16 << 27 | 256);
        // Radiance writes (1, 0.5, 0.25) as 128 64 32 and 2^1.
        assert_eq!(Rgbe::encode(Rgb::new(1.0, 0.5, 0.25)).0, [128, 64, 32, 129]);
    }
}
