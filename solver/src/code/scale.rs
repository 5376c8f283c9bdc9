//! A positive factor that relighting can apply without floats: `mantissa * 2^exponent`.

use super::exponential::LARGEST;
use crate::math;

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

    /// The scale nearest to `value`, within 2^-16 of it; `None` unless both are normal positive floats.
    #[must_use]
    pub fn nearest(value: f32) -> Option<Self> {
        if !(value > 0.0 && value.is_normal()) {
            return None;
        }
        // Of the 24 bits of a mantissa, half a unit of the 16th is added; what is below is cut off.
        let bits = value.to_bits() + (1 << 7);
        let scale = Self {
            mantissa: ((bits >> 8 & 0x7fff) | 0x8000) as u16,
            exponent: (bits >> 23) as i16 - 142,
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
        // From 2^15 2^-141, the smallest normal float, to below 2^16 2^112.
        let is_normal = mantissa >= 1 << 15 && (-141..=112).contains(&exponent);
        is_normal.then_some(Self { mantissa, exponent })
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
    use super::super::exponential::encode;
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn scales_are_close_from_above(value in 1e-30_f32..1e30) {
            let scale = Scale::at_least(value).unwrap();
            prop_assert!(scale.value() >= value, "{scale:?}");
            prop_assert!(scale.value() <= value * (1.0 + 1.0 / 32768.0), "{scale:?}");
            prop_assert_eq!(Scale::from_parts(scale.mantissa(), scale.exponent()), Some(scale));
        }

        #[test]
        fn nearest_scales_are_near(value in 1e-37_f32..1e38) {
            let scale = Scale::nearest(value).unwrap();
            let error = (f64::from(scale.value()) / f64::from(value) - 1.0).abs();
            prop_assert!(error <= 2.0_f64.powi(-16) * 1.0001 + 2.0_f64.powi(-24), "{value} {scale:?}");
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
            assert_eq!(Scale::nearest(value), None, "{value}");
            assert_eq!(Scale::at_least(value), None, "{value}");
        }
        assert_eq!(Scale::fitting(0.0), Some(Scale::ONE));
        assert_eq!(Scale::from_parts(1, 0), None);
        assert_eq!(Scale::from_parts(40_000, 300), None);
    }
}
