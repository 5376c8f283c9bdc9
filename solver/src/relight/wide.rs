//! The sum in integers of any range, as a mantissa of 32 bits and a power of two.
//!
//! A contribution is the product of two mantissas, cut to 32 bits; a sum shifts the smaller of its two parts to the
//! exponent of the larger and cuts what leaves 32 bits. Either loses less than 2^-31 of the
//! larger part, and the sum of non-negative parts is no smaller than each, so that `k` lights lose less than
//! `k 2^-30` of their sum: the error of the logarithmic code, relative to the sum, stays
//! what [`Curve`](crate::code::Curve) proves, at every exposure and from the smallest subnormal mix on.

use super::{RelightError, check_elements, check_mix};
use crate::atlas::Atlas;
use crate::code::{Curve, Magnitude};
use crate::color::Rgb;

/// A value that is not negative: 0, or a mantissa in [2^31, 2^32) times a power of two.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Wide(Magnitude);

impl Wide {
    /// Nothing.
    pub const ZERO: Self = Self(Magnitude {
        mantissa: 0,
        exponent: 0,
    });

    /// `mantissa * 2^exponent`, cut to 32 bits.
    pub(super) const fn new(mantissa: u64, exponent: i32) -> Self {
        if mantissa == 0 {
            return Self::ZERO;
        }
        let excess = 32 - mantissa.leading_zeros() as i32;
        let mantissa = if excess > 0 {
            mantissa >> excess
        } else {
            mantissa << -excess
        };
        Self(Magnitude {
            mantissa: mantissa as u32,
            exponent: exponent + excess,
        })
    }

    /// A float that is finite and not negative, from its bits.
    #[must_use]
    pub const fn from_float(value: f32) -> Self {
        let bits = value.to_bits();
        let (exponent, fraction) = (bits >> 23 & 0xff, bits & 0x7f_ffff);
        if exponent == 0 {
            Self::new(fraction as u64, -149)
        } else {
            Self::new((fraction | 1 << 23) as u64, exponent as i32 - 150)
        }
    }

    /// The product of two.
    #[must_use]
    pub const fn times(self, other: Self) -> Self {
        let product = self.0.mantissa as u64 * other.0.mantissa as u64;
        Self::new(product, self.0.exponent + other.0.exponent)
    }

    /// The quotient of two; 0 for a divisor of 0.
    pub(super) const fn over(self, other: Self) -> Self {
        if other.0.mantissa == 0 {
            return Self::ZERO;
        }
        // Digit by digit: a division of 64 bits is more code than all else of a mix on the smallest cores.
        let divisor = other.0.mantissa as u64;
        let (mut quotient, mut rest, mut digit) = (0, self.0.mantissa as u64, 0);
        while digit <= 32 {
            quotient *= 2;
            if rest >= divisor {
                rest -= divisor;
                quotient += 1;
            }
            rest *= 2;
            digit += 1;
        }
        Self::new(quotient, self.0.exponent - other.0.exponent - 32)
    }

    /// The value times a power of two.
    pub(super) const fn scaled(self, exponent: i32) -> Self {
        Self::new(self.0.mantissa as u64, self.0.exponent + exponent)
    }

    /// The sum of two.
    #[must_use]
    pub fn plus(self, other: Self) -> Self {
        if self.0.mantissa == 0 {
            return other;
        }
        if other.0.mantissa == 0 {
            return self;
        }
        let (large, small) = if self.0.exponent >= other.0.exponent {
            (self.0, other.0)
        } else {
            (other.0, self.0)
        };
        let distance = large.exponent.abs_diff(small.exponent);
        let small = small.mantissa.checked_shr(distance).unwrap_or(0);
        Self::new(u64::from(large.mantissa) + u64::from(small), large.exponent)
    }

    /// As mantissa and power of two.
    #[must_use]
    pub const fn magnitude(self) -> Magnitude {
        self.0
    }
}

/// Irradiance (or radiosity, whichever the atlas holds) of every element under a mix, W/m2.
///
/// # Errors
/// Slices that do not fit the atlas; a weight that is negative or not finite.
pub fn relight_wide(
    atlas: &Atlas,
    mix: &[Rgb],
    weights: &mut [WideWeight],
    sums: &mut [[Wide; 3]],
) -> Result<(), RelightError> {
    check_mix(atlas, mix)?;
    super::check_lights(atlas, weights.len())?;
    check_elements(atlas, sums.len())?;
    for ((weight, light), mix) in weights.iter_mut().zip(atlas.lights()).zip(mix) {
        *weight = WideWeight::new(light.curves, *mix);
    }
    sums.fill([Wide::ZERO; 3]);
    atlas.for_each(|element, light, codes| {
        let sum = sums.get_mut(element as usize);
        if let (Some(sum), Some(weight)) = (sum, weights.get(light as usize)) {
            for ((sum, term), code) in sum.iter_mut().zip(&weight.0).zip(codes) {
                let (curve, weight) = term;
                let value = curve.magnitude(code);
                let value = Wide::new(value.mantissa.into(), value.exponent);
                *sum = sum.plus(weight.times(value));
            }
        }
    });
    Ok(())
}

/// What the codes of a light stand for, and what multiplies them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WideWeight([(Curve, Wide); 3]);

impl WideWeight {
    /// Room for [`relight_wide`].
    pub const EMPTY: Self = Self([(Curve::Logarithmic { first: 0 }, Wide::ZERO); 3]);

    fn new(curves: [Curve; 3], mix: Rgb) -> Self {
        let [r, g, b] = curves;
        let of = |curve: Curve, mix: f32| {
            let factor = Wide::from_float(curve.factor());
            (curve, Wide::from_float(mix).times(factor))
        };
        Self([of(r, mix.r), of(g, mix.g), of(b, mix.b)])
    }
}
