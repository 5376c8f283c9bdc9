//! The sum in whole numbers: `S_j = sum_m round(W_m X_m(c_jm) 2^-s)` in units of `2^u` W/m2.
//!
//! `X = mantissa 2^exponent` is the value of a code without its factor
//! ([`Curve::magnitude`](crate::code::Curve::magnitude)), `W` the mix times that factor with a mantissa of
//! 16 bits, and `s` brings the product to the common unit; halves round up. A contribution is a function of
//! its code and its light's weight only, and sums of `u32` wrap, so it does not matter
//! in which order they are formed, nor how often a light is taken out and put back.
//!
//! Error: half a unit for every contribution, 2^-16 of it from `W`, and for the exponential code half of 2^-13 scales
//! from its table; [`FixedMix::error_bound`] sums them up.

use core::iter;

use super::bytes::{Sum, Values, add_all, of_colour};
use super::{CodeTable, RelightError, check_elements, check_lights};
use crate::atlas::Atlas;
use crate::code::{Curve, DECODED_BITS, Scale};
use crate::color::Rgb;
use crate::math;

/// How far a weight can be off, relative: half a unit of 16 bits.
const WEIGHT_ERROR: f32 = 1.0 / 65_536.0;

/// The weight of a light in fixed point, and what its codes stand for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FixedWeight {
    curves: [Curve; 3],
    last: [u16; 3],
    /// Mix times the factor of the curve; `None` for 0.
    weights: [Option<Scale>; 3],
}

impl FixedWeight {
    /// A light that is off and has no codes: room for [`FixedMix::new`].
    pub const EMPTY: Self = Self {
        curves: [Curve::Exponential { scale: Scale::ONE }; 3],
        last: [0; 3],
        weights: [None; 3],
    };

    /// The contribution of a code in units of `2^unit`, or its largest; `None` beyond 32 bits.
    fn term(&self, channel: usize, code: u16, unit: i32) -> Option<u32> {
        let weight = *self.weights.get(channel)?;
        let Some(weight) = weight else {
            return Some(0);
        };
        let value = self.curves.get(channel)?.magnitude(code);
        let product = u64::from(weight.mantissa()) * u64::from(value.mantissa);
        let shift = unit - i32::from(weight.exponent()) - value.exponent;
        match u32::try_from(shift) {
            // The product has 48 bits.
            Ok(0) => u32::try_from(product).ok(),
            Ok(shift @ 1..=48) => u32::try_from((product + (1 << (shift - 1))) >> shift).ok(),
            Ok(_) => Some(0),
            Err(_) if product == 0 => Some(0),
            Err(_) => product
                .checked_shl(shift.unsigned_abs())
                .filter(|term| term >> shift.unsigned_abs() == product)
                .and_then(|term| u32::try_from(term).ok()),
        }
    }

    /// The largest contribution of a channel.
    fn largest(&self, channel: usize, unit: i32) -> Option<u32> {
        self.term(channel, *self.last.get(channel)?, unit)
    }
}

/// Contributions in units of a mix.
pub trait Terms {
    /// What a light contributes to an element that has these codes of it.
    fn terms(&self, light: u32, codes: [u16; 3]) -> [u32; 3];

    /// What every light contributes by each of 256 codes, if it is multiplied out already; else nothing.
    fn of_bytes(&self) -> &[[[u32; 256]; 3]] {
        &[]
    }
}

/// A mix in fixed point: a weight per light, and the unit of all sums.
#[derive(Debug)]
pub struct FixedMix<'a> {
    weights: &'a mut [FixedWeight],
    unit: i32,
}

impl Terms for FixedMix<'_> {
    fn terms(&self, light: u32, [r, g, b]: [u16; 3]) -> [u32; 3] {
        let Some(weight) = self.weights.get(light as usize) else {
            return [0; 3];
        };
        let term = |channel, code| weight.term(channel, code, self.unit).unwrap_or(0);
        [term(0, r), term(1, g), term(2, b)]
    }
}

impl<'a> FixedMix<'a> {
    /// Fits the unit to `brightest`, a mix that no later one exceeds in sum, and sets `mix`.
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
        weights: &'a mut [FixedWeight],
    ) -> Result<Self, RelightError> {
        check_lights(atlas, brightest.len())?;
        check_lights(atlas, mix.len())?;
        check_lights(atlas, weights.len())?;
        let mut total = Rgb::BLACK;
        for ((weight, light), bright) in weights.iter_mut().zip(atlas.lights()).zip(brightest) {
            *weight = FixedWeight {
                curves: light.curves,
                last: light.last,
                weights: [None; 3],
            };
            let [r, g, b] = light.curves;
            let [last_r, last_g, last_b] = light.last;
            let largest = Rgb::new(r.decode(last_r), g.decode(last_g), b.decode(last_b));
            total += *bright * largest;
        }
        if !total.is_legal() {
            return Err(RelightError::Range);
        }
        // Rounding may add a unit per light; it must not lead out of 32 bits.
        let room = (u32::MAX - 4 * atlas.light_count().min(1 << 28)) as f32;
        let (_, unit) = math::split_exponent(total.max_channel() / room * (1.0 + 1e-4));
        let mut fixed = Self { weights, unit };
        for (mix, light) in mix.iter().zip(0..) {
            fixed.assign(light, *mix)?;
        }
        fixed.check_range()?;
        Ok(fixed)
    }

    /// Irradiance of one unit of a sum, W/m2: a power of two.
    #[must_use]
    pub fn unit(&self) -> f32 {
        math::scale_by_power_of_two(1.0, self.unit)
    }

    /// Sets one light; its weight before is returned. Sums are not touched: see [`change_fixed`].
    ///
    /// # Errors
    /// A light that does not exist, a weight that is not legal, or [`RelightError::Range`]. Nothing has
    /// changed then.
    pub fn set(&mut self, light: u32, mix: Rgb) -> Result<FixedWeight, RelightError> {
        let before = self.assign(light, mix)?;
        if let Err(error) = self.check_range() {
            if let Some(weight) = self.weights.get_mut(light as usize) {
                *weight = before;
            }
            return Err(error);
        }
        Ok(before)
    }

    fn assign(&mut self, light: u32, mix: Rgb) -> Result<FixedWeight, RelightError> {
        if !mix.is_legal() {
            return Err(RelightError::Mix { light });
        }
        let expected = self.weights.len() as u32;
        let weight = self.weights.get_mut(light as usize);
        let weight = weight.ok_or(RelightError::Lights { expected })?;
        let before = *weight;
        let channels = weight.weights.iter_mut().zip(&weight.curves);
        for ((weight, curve), mix) in channels.zip(mix.to_array()) {
            *weight = Scale::nearest(mix * curve.factor());
        }
        Ok(before)
    }

    /// Whether the brightest sum that these weights allow fits.
    fn check_range(&self) -> Result<(), RelightError> {
        for channel in 0..3 {
            let mut terms = self.weights.iter().map(|w| w.largest(channel, self.unit));
            let total = terms.try_fold(0_u32, |total, term| total.checked_add(term?));
            total.ok_or(RelightError::Range)?;
        }
        Ok(())
    }

    /// How far a sum times [`Self::unit`] can lie from the `f32` relight of the same mix, W/m2.
    #[must_use]
    pub fn error_bound(&self) -> f32 {
        let lights = self.weights.len() as f32;
        let mut worst = 0.0_f32;
        for channel in 0..3 {
            let mut bound = 0.0;
            for weight in self.weights.iter() {
                let largest = weight.largest(channel, self.unit).unwrap_or(u32::MAX) as f32;
                let is_table =
                    matches!(weight.curves.get(channel), Some(Curve::Exponential { .. }));
                let scale = weight.weights.get(channel).copied().flatten();
                let table = scale.filter(|_| is_table).map_or(0.0, Scale::value) / self.unit();
                let rounding = WEIGHT_ERROR + (lights + 4.0) * f32::EPSILON;
                bound +=
                    0.5 + largest * rounding + table * 0.502 / f32::from(1_u16 << DECODED_BITS);
            }
            worst = worst.max(bound);
        }
        worst * self.unit()
    }
}

/// All contributions of a mix, so that relighting only adds.
#[derive(Debug)]
pub struct FixedTable<'a>(CodeTable<'a, u32>);

impl<'a> FixedTable<'a> {
    /// Multiplies out a mix into `values`, which has [`table_length`](super::table_length) entries or more.
    ///
    /// # Errors
    /// [`RelightError::Table`]; a mix of another atlas.
    pub fn new(atlas: &Atlas, mix: &FixedMix, values: &'a mut [u32]) -> Result<Self, RelightError> {
        check_lights(atlas, mix.weights.len())?;
        let mut table = Self(CodeTable::new(atlas, values)?);
        for light in 0..atlas.light_count() {
            table.update(mix, light);
        }
        Ok(table)
    }

    /// Follows a change of one light of the mix.
    pub fn update(&mut self, mix: &FixedMix, light: u32) {
        if let Some(weight) = mix.weights.get(light as usize) {
            self.0.fill(light, |channel, code| {
                let last = weight.last.get(channel).copied().unwrap_or(0);
                weight.term(channel, code.min(last), mix.unit).unwrap_or(0)
            });
        }
    }
}

impl Terms for FixedTable<'_> {
    fn terms(&self, light: u32, [r, g, b]: [u16; 3]) -> [u32; 3] {
        let term = |channel, code| self.0.get(light, channel, code);
        [term(0, r), term(1, g), term(2, b)]
    }

    fn of_bytes(&self) -> &[Values<u32>] {
        self.0.of_bytes()
    }
}

impl Sum for [u32; 3] {
    type Value = u32;
    type Weight = ();

    fn to_lanes(self) -> [u32; 4] {
        let [r, g, b] = self;
        [r, g, b, 0]
    }

    fn from_lanes([r, g, b, _]: [u32; 4]) -> Self {
        [r, g, b]
    }

    /// Each channel has its own weight multiplied in.
    #[inline(always)]
    fn of_luminance(terms: &Values<u32>, code: u8) -> [u32; 4] {
        of_colour(terms, [code; 3])
    }

    #[inline(always)]
    fn add(mut sum: [u32; 4], (): (), terms: [u32; 4]) -> [u32; 4] {
        add(&mut sum, terms);
        sum
    }
}

/// Sums of every element, in units of [`FixedMix::unit`].
///
/// # Errors
/// A slice that does not fit the atlas.
pub fn relight_fixed(
    atlas: &Atlas,
    terms: &impl Terms,
    sums: &mut [[u32; 3]],
) -> Result<(), RelightError> {
    check_elements(atlas, sums.len())?;
    sums.fill([0; 3]);
    let weights = iter::repeat(());
    add_all(
        atlas,
        terms.of_bytes(),
        weights,
        sums,
        |sum, light, codes| {
            add(sum, terms.terms(light, codes));
        },
    );
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
    let unit = mix.unit;
    let before = mix.set(light, value)?;
    let after = mix.weights.get(light as usize).copied().unwrap_or(before);
    let change = |channel: usize, code: u16| {
        let term = |weight: &FixedWeight| weight.term(channel, code, unit).unwrap_or(0);
        term(&after).wrapping_sub(term(&before))
    };
    atlas.for_each_of(light, |element, [r, g, b]| {
        if let Some(sum) = sums.get_mut(element as usize) {
            add(sum, [change(0, r), change(1, g), change(2, b)]);
        }
    });
    Ok(())
}

#[inline(always)]
fn add<const N: usize>(sum: &mut [u32; N], terms: [u32; N]) {
    for (sum, term) in sum.iter_mut().zip(terms) {
        *sum = sum.wrapping_add(term);
    }
}
