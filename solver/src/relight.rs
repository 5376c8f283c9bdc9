//! Atlas times mix: the irradiance of every element under any setting of the lights.
//!
//! `E_j = sum_m w_m x(c_jm)`, with the decoded code `x` and the weight `w_m = mix_m s_m` (mix of
//! the light times its scale), channel by channel. A luminance atlas has one `x` for the three
//! channels. Twice, over the same codes:
//!
//! * in `f32`: [`float_weights`], then [`relight`];
//! * in integers: [`FixedMix`], then [`relight_fixed`], or [`change_fixed`] for one light. Weights
//!   are `u16`, `w = W 2^e` with one `e` for all; `x = X 2^-13` ([`crate::code::DECODED`]), so the
//!   sum is in units of `2^(e - 13)`. Sums are exact and wrapping: a change and its undoing
//!   restore the same bits, and a change gives the bits of a full relight.
//!
//! The two differ by the rounding of `W` (half a unit) and of `X` (half a unit and 2^-9 of one
//! from its table), which [`FixedMix::error_bound`] sums up.

use core::fmt;
use core::num::NonZeroUsize;

use crate::atlas::{Atlas, Channels};
use crate::code::{DECODED_BITS, DecodeTable, SATURATED, decode_fixed};
use crate::color::Rgb;
use crate::math;

/// Why a relight cannot be done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum RelightError {
    /// A slice does not have one entry per light.
    Lights {
        /// How many lights the atlas has.
        expected: u32,
    },
    /// A slice does not have one entry per element.
    Elements {
        /// How many elements the atlas has.
        expected: u32,
    },
    /// A mix weight is negative or not finite.
    Mix {
        /// Tag of the light.
        light: u32,
    },
    /// The mix is too bright for the fixed-point range; start again with [`FixedMix::new`].
    Range,
}

impl fmt::Display for RelightError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Lights { expected } => write!(f, "one entry per light is needed: {expected}"),
            Self::Elements { expected } => {
                write!(f, "one entry per element is needed: {expected}")
            }
            Self::Mix { light } => {
                write!(f, "light {light}: the weight is negative or not finite")
            }
            Self::Range => f.write_str("the mix is too bright for the fixed-point range"),
        }
    }
}

impl core::error::Error for RelightError {}

/// Puts `mix_m s_m` into `weights`, which [`relight`] takes.
///
/// # Errors
/// Slices that do not fit the atlas; a weight that is negative or not finite.
pub fn float_weights(atlas: &Atlas, mix: &[Rgb], weights: &mut [Rgb]) -> Result<(), RelightError> {
    check_lights(atlas, mix.len())?;
    check_lights(atlas, weights.len())?;
    for (((weight, mix), light), tag) in weights.iter_mut().zip(mix).zip(atlas.lights()).zip(0..) {
        if !mix.is_legal() {
            return Err(RelightError::Mix { light: tag });
        }
        *weight = *mix * light.scale.value();
    }
    Ok(())
}

/// Irradiance of every element, W/m2, from the weights of [`float_weights`].
///
/// # Errors
/// Slices that do not fit the atlas.
pub fn relight(
    atlas: &Atlas,
    table: &DecodeTable,
    weights: &[Rgb],
    irradiance: &mut [Rgb],
) -> Result<(), RelightError> {
    check_lights(atlas, weights.len())?;
    check_elements(atlas, irradiance.len())?;
    irradiance.fill(Rgb::BLACK);
    match atlas.channels() {
        Channels::Rgb => for_each_element(atlas, irradiance, |sum, codes| {
            for (weight, codes) in weights.iter().zip(triples(codes)) {
                *sum += *weight * Rgb::from_array(codes.map(|code| table.decode(code)));
            }
        }),
        Channels::Luminance => for_each_element(atlas, irradiance, |sum, codes| {
            for (weight, code) in weights.iter().zip(codes) {
                *sum += *weight * table.decode(*code);
            }
        }),
    }
    Ok(())
}

/// Calls `f` with the output and the codes of every element; nothing happens without lights.
fn for_each_element<T>(atlas: &Atlas, output: &mut [T], mut f: impl FnMut(&mut T, &[u8])) {
    let length = atlas.light_count() as usize * atlas.channels().count();
    let Some(length) = NonZeroUsize::new(length) else {
        return;
    };
    let rows = atlas.all_codes().chunks_exact(length.get());
    for (output, codes) in output.iter_mut().zip(rows) {
        f(output, codes);
    }
}

/// The codes of an element as red, green and blue of every light.
const fn triples(codes: &[u8]) -> &[[u8; 3]] {
    codes.as_chunks().0
}

/// A mix in fixed point: a `u16` weight per light and channel, and the power of two of them all.
#[derive(Debug)]
pub struct FixedMix<'a> {
    weights: &'a mut [[u16; 3]],
    exponent: i32,
}

impl<'a> FixedMix<'a> {
    /// Largest sum of the weights of one channel: their products with codes then fit 32 bits.
    pub const LARGEST_SUM: u32 = 65_535;

    /// Fits the exponent to `brightest`, a mix that no later one exceeds in sum, and sets `mix`.
    ///
    /// `weights` is room for one entry per light.
    ///
    /// # Errors
    /// Slices that do not fit the atlas; weights that are negative or not finite;
    /// [`RelightError::Range`] when `mix` exceeds `brightest`.
    pub fn new(
        atlas: &Atlas,
        brightest: &[Rgb],
        mix: &[Rgb],
        weights: &'a mut [[u16; 3]],
    ) -> Result<Self, RelightError> {
        check_lights(atlas, brightest.len())?;
        check_lights(atlas, mix.len())?;
        check_lights(atlas, weights.len())?;
        let total = atlas
            .lights()
            .zip(brightest)
            .fold(Rgb::BLACK, |sum, (light, mix)| {
                sum + *mix * light.scale.value()
            });
        if !total.is_legal() {
            return Err(RelightError::Range);
        }

        // Rounding may add half a unit per light; it must not lead out of the range.
        let room = Self::LARGEST_SUM.saturating_sub(atlas.light_count()).max(1);
        let (_, exponent) = math::split_exponent(total.max_channel() / room as f32);
        weights.fill([0; 3]);
        let mut fixed = Self { weights, exponent };
        for (mix, light) in mix.iter().zip(0..) {
            fixed.set(atlas, light, *mix)?;
        }
        Ok(fixed)
    }

    /// The weights `W`, one entry per light.
    #[must_use]
    pub fn weights(&self) -> &[[u16; 3]] {
        self.weights
    }

    /// Irradiance of one unit of a sum: `2^(e - 13)` W/m2.
    #[must_use]
    pub fn unit(&self) -> f32 {
        math::scale_by_power_of_two(1.0, self.exponent - DECODED_BITS as i32)
    }

    /// Sets one light; the state before is returned. Sums are not touched: see [`change_fixed`].
    ///
    /// # Errors
    /// A light that does not exist, a weight that is not legal, or [`RelightError::Range`].
    pub fn set(&mut self, atlas: &Atlas, light: u32, mix: Rgb) -> Result<[u16; 3], RelightError> {
        if !mix.is_legal() {
            return Err(RelightError::Mix { light });
        }
        let scale = atlas.lights().nth(light as usize).map(|l| l.scale.value());
        let expected = atlas.light_count();
        let scale = scale.ok_or(RelightError::Lights { expected })?;
        let weight =
            (mix * scale).map(|w| math::round(math::scale_by_power_of_two(w, -self.exponent)));
        if weight.max_channel() > Self::LARGEST_SUM as f32 {
            return Err(RelightError::Range);
        }
        let weight = weight.to_array().map(|w| w as u16);

        let slot = self.weights.get_mut(light as usize);
        let slot = slot.ok_or(RelightError::Lights { expected })?;
        let before = core::mem::replace(slot, weight);
        if self.largest_sum() > Self::LARGEST_SUM {
            if let Some(slot) = self.weights.get_mut(light as usize) {
                *slot = before;
            }
            return Err(RelightError::Range);
        }
        Ok(before)
    }

    fn largest_sum(&self) -> u32 {
        let totals = self.weights.iter().fold([0_u32; 3], |[r, g, b], weight| {
            let [wr, wg, wb] = weight.map(u32::from);
            [
                r.saturating_add(wr),
                g.saturating_add(wg),
                b.saturating_add(wb),
            ]
        });
        totals.into_iter().max().unwrap_or(0)
    }

    /// How far a sum times [`Self::unit`] can lie from the `f32` relight of the same mix, W/m2.
    #[must_use]
    pub fn error_bound(&self) -> f32 {
        let one = math::scale_by_power_of_two(1.0, self.exponent);
        let lights = self.weights.len() as f32;
        let weights = 0.5 * lights * SATURATED;
        let total = self.largest_sum() as f32 + 0.5 * lights;
        let codes = total * 0.502 / f32::from(1_u16 << DECODED_BITS);
        let floats = total * SATURATED * (lights + 4.0) * f32::EPSILON;
        one * (weights + codes + floats)
    }
}

/// Sums of every element, in units of [`FixedMix::unit`].
///
/// # Errors
/// Slices that do not fit the atlas.
pub fn relight_fixed(
    atlas: &Atlas,
    mix: &FixedMix,
    sums: &mut [[u32; 3]],
) -> Result<(), RelightError> {
    check_lights(atlas, mix.weights.len())?;
    check_elements(atlas, sums.len())?;
    sums.fill([0; 3]);
    match atlas.channels() {
        Channels::Rgb => for_each_element(atlas, sums, |sum, codes| {
            for (weight, codes) in mix.weights.iter().zip(triples(codes)) {
                accumulate(sum, *codes, weight.map(u32::from));
            }
        }),
        Channels::Luminance => for_each_element(atlas, sums, |sum, codes| {
            for (weight, code) in mix.weights.iter().zip(codes) {
                accumulate(sum, [*code; 3], weight.map(u32::from));
            }
        }),
    }
    Ok(())
}

/// Sets one light and corrects the sums for it; the other lights are not touched.
///
/// The sums are then bit for bit those of [`relight_fixed`] with the new mix.
///
/// # Errors
/// Slices that do not fit the atlas; what [`FixedMix::set`] refuses. Nothing has changed then.
pub fn change_fixed(
    atlas: &Atlas,
    mix: &mut FixedMix,
    light: u32,
    value: Rgb,
    sums: &mut [[u32; 3]],
) -> Result<(), RelightError> {
    check_lights(atlas, mix.weights.len())?;
    check_elements(atlas, sums.len())?;
    let before = mix.set(atlas, light, value)?;
    let after = mix.weights.get(light as usize).copied().unwrap_or(before);
    let [r, g, b] = before;
    let [ar, ag, ab] = after;
    let difference =
        [(ar, r), (ag, g), (ab, b)].map(|(a, b)| u32::from(a).wrapping_sub(u32::from(b)));
    let light = light as usize;
    for_each_element(atlas, sums, |sum, codes| {
        let codes = match atlas.channels() {
            Channels::Rgb => triples(codes).get(light).copied(),
            Channels::Luminance => codes.get(light).map(|code| [*code; 3]),
        };
        if let Some(codes) = codes {
            accumulate(sum, codes, difference);
        }
    });
    Ok(())
}

fn accumulate(sum: &mut [u32; 3], codes: [u8; 3], weights: [u32; 3]) {
    for ((sum, code), weight) in sum.iter_mut().zip(codes).zip(weights) {
        let product = weight.wrapping_mul(u32::from(decode_fixed(code)));
        *sum = sum.wrapping_add(product);
    }
}

fn check_lights(atlas: &Atlas, found: usize) -> Result<(), RelightError> {
    let expected = atlas.light_count();
    if found == expected as usize {
        Ok(())
    } else {
        Err(RelightError::Lights { expected })
    }
}

fn check_elements(atlas: &Atlas, found: usize) -> Result<(), RelightError> {
    let expected = atlas.element_count();
    if found == expected as usize {
        Ok(())
    } else {
        Err(RelightError::Elements { expected })
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use crate::atlas::{Contents, LightEntry, Quantity, size, write};
    use crate::code::{Code, Scale};
    use proptest::prelude::*;
    use std::vec;
    use std::vec::Vec;

    const ELEMENTS: u32 = 40;

    fn contribution(element: u32, light: u32) -> Rgb {
        let phase = 0.37 * element as f32 + 1.7 * light as f32;
        let power = 10.0_f32.powi(light as i32 % 4 - 2);
        Rgb::new(1.0 + phase.sin(), 1.0 + phase.cos(), 0.3) * power
    }

    fn atlas_bytes(lights: u32, channels: Channels) -> Vec<u8> {
        let entries: Vec<LightEntry> = (0..lights)
            .map(|light| LightEntry {
                name: "",
                emission: Rgb::WHITE,
                scale: Scale::fitting(2.0 * 10.0_f32.powi(light as i32 % 4 - 2)).unwrap(),
            })
            .collect();
        let contents = Contents {
            code: Code::Exp8s,
            channels,
            quantity: Quantity::Irradiance,
            lights: &entries,
            elements: ELEMENTS,
            errors: None,
            mesh: None,
        };
        let mut bytes = vec![0; size(&contents).unwrap()];
        write(&contents, contribution, &mut bytes).unwrap();
        bytes
    }

    fn mix_strategy(lights: usize) -> impl Strategy<Value = Vec<Rgb>> {
        let channel = prop_oneof![Just(0.0_f32), 0.0_f32..1.0, 1e-6_f32..1e-3, 1.0_f32..100.0];
        let colour = [channel.clone(), channel.clone(), channel];
        let colour = colour.prop_map(Rgb::from_array);
        proptest::collection::vec(colour, lights)
    }

    fn channels() -> impl Strategy<Value = Channels> {
        prop_oneof![Just(Channels::Rgb), Just(Channels::Luminance)]
    }

    proptest! {
        #[test]
        fn fixed_and_float_agree_within_the_bound(mix in mix_strategy(9), channels in channels()) {
            let bytes = atlas_bytes(9, channels);
            let atlas = Atlas::parse(&bytes).unwrap();
            let mut weights = [Rgb::BLACK; 9];
            let mut float = [Rgb::BLACK; ELEMENTS as usize];
            float_weights(&atlas, &mix, &mut weights).unwrap();
            relight(&atlas, &DecodeTable::new(), &weights, &mut float).unwrap();

            let mut room = [[0; 3]; 9];
            let fixed = FixedMix::new(&atlas, &mix, &mix, &mut room).unwrap();
            let mut sums = [[0; 3]; ELEMENTS as usize];
            relight_fixed(&atlas, &fixed, &mut sums).unwrap();
            for (sum, exact) in sums.iter().zip(float) {
                for (sum, exact) in sum.iter().zip(exact.to_array()) {
                    let found = *sum as f64 * f64::from(fixed.unit());
                    let error = (found - f64::from(exact)).abs();
                    prop_assert!(error <= f64::from(fixed.error_bound()), "{} {} {}", found, exact, fixed.error_bound());
                }
            }
        }

        #[test]
        fn a_change_gives_the_bits_of_a_full_relight(
            mix in mix_strategy(5), light in 0_u32..5, value in mix_strategy(1), channels in channels(),
        ) {
            let bytes = atlas_bytes(5, channels);
            let atlas = Atlas::parse(&bytes).unwrap();
            let brightest: Vec<Rgb> = mix.iter().map(|m| *m + Rgb::splat(100.0)).collect();
            let (mut room, mut other_room) = ([[0; 3]; 5], [[0; 3]; 5]);
            let mut fixed = FixedMix::new(&atlas, &brightest, &mix, &mut room).unwrap();
            let mut sums = [[0; 3]; ELEMENTS as usize];
            relight_fixed(&atlas, &fixed, &mut sums).unwrap();
            let before = sums;
            change_fixed(&atlas, &mut fixed, light, value[0], &mut sums).unwrap();

            let mut changed = mix.clone();
            changed[light as usize] = value[0];
            let full = FixedMix::new(&atlas, &brightest, &changed, &mut other_room).unwrap();
            let mut expected = [[0; 3]; ELEMENTS as usize];
            relight_fixed(&atlas, &full, &mut expected).unwrap();
            prop_assert_eq!(sums, expected);

            change_fixed(&atlas, &mut fixed, light, mix[light as usize], &mut sums).unwrap();
            prop_assert_eq!(sums, before);
        }
    }

    #[test]
    fn slices_and_weights_that_do_not_fit_are_refused() {
        let bytes = atlas_bytes(2, Channels::Rgb);
        let atlas = Atlas::parse(&bytes).unwrap();
        let mix = [Rgb::WHITE; 2];
        let mut weights = [Rgb::BLACK; 2];
        let lights = Err(RelightError::Lights { expected: 2 });
        assert_eq!(float_weights(&atlas, &mix[..1], &mut weights), lights);
        let bad = [Rgb::WHITE, Rgb::splat(f32::NAN)];
        let refused = Err(RelightError::Mix { light: 1 });
        assert_eq!(float_weights(&atlas, &bad, &mut weights), refused);
        let elements = Err(RelightError::Elements { expected: 40 });
        let mut few = [Rgb::BLACK; 3];
        assert_eq!(
            relight(&atlas, &DecodeTable::new(), &weights, &mut few),
            elements
        );

        let mut room = [[0; 3]; 2];
        let mut fixed = FixedMix::new(&atlas, &mix, &mix, &mut room).unwrap();
        let too_bright = fixed.set(&atlas, 0, Rgb::splat(1e6));
        assert_eq!(too_bright, Err(RelightError::Range));
        let together = fixed.set(&atlas, 0, Rgb::splat(1e4));
        assert_eq!(together, Err(RelightError::Range));
        assert!(fixed.set(&atlas, 2, Rgb::WHITE).is_err());
    }
}
