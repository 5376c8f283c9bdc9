//! The sum in `f32`.

use super::bytes::{Sum, Values, add_all, of};
use super::{CodeTable, RelightError, check_elements, check_mix};
use crate::atlas::Atlas;
use crate::color::Rgb;

/// The value of every code of every light and channel, W/m2 at unit emission.
#[derive(Debug)]
pub struct DecodeTable<'a>(CodeTable<'a, f32>);

impl<'a> DecodeTable<'a> {
    /// Decodes all codes of an atlas into `values`, which has
    /// [`table_length`](super::table_length) entries or more.
    ///
    /// # Errors
    /// [`RelightError::Table`].
    pub fn new(atlas: &Atlas, values: &'a mut [f32]) -> Result<Self, RelightError> {
        let mut table = CodeTable::new(atlas, values)?;
        for (light, tag) in atlas.lights().zip(0..) {
            table.fill(tag, |channel, code| {
                let curve = light.curves.get(channel).zip(light.last.get(channel));
                curve.map_or(0.0, |(curve, last)| curve.decode(code.min(*last)))
            });
        }
        Ok(Self(table))
    }

    /// The contribution of a light to an element that has these codes of it.
    #[must_use]
    pub fn decode(&self, light: u32, [r, g, b]: [u16; 3]) -> Rgb {
        let value = |channel, code| self.0.get(light, channel, code);
        Rgb::new(value(0, r), value(1, g), value(2, b))
    }
}

/// Irradiance (or radiosity, whichever the atlas holds) of every element under a mix, W/m2.
///
/// # Errors
/// Slices that do not fit the atlas; a weight that is negative or not finite.
pub fn relight(
    atlas: &Atlas,
    table: &DecodeTable,
    mix: &[Rgb],
    irradiance: &mut [Rgb],
) -> Result<(), RelightError> {
    check_mix(atlas, mix)?;
    check_elements(atlas, irradiance.len())?;
    irradiance.fill(Rgb::BLACK);
    let tables = table.0.of_bytes();
    let weights = mix.iter().copied();
    add_all(atlas, tables, weights, irradiance, |sum, light, codes| {
        if let Some(weight) = mix.get(light as usize) {
            *sum += *weight * table.decode(light, codes);
        }
    });
    Ok(())
}

impl Sum for Rgb {
    type Value = f32;
    type Weight = Self;

    fn to_lanes(self) -> [f32; 4] {
        [self.r, self.g, self.b, 0.0]
    }

    fn from_lanes([r, g, b, _]: [f32; 4]) -> Self {
        Self::new(r, g, b)
    }

    #[inline(always)]
    fn of_luminance([values, ..]: &Values<f32>, code: u8) -> [f32; 4] {
        let value = of(values, code);
        [value, value, value, 0.0]
    }

    #[inline(always)]
    fn add(mut sum: [f32; 4], weight: Self, values: [f32; 4]) -> [f32; 4] {
        let weights = weight.to_lanes();
        for ((sum, weight), value) in sum.iter_mut().zip(weights).zip(values) {
            *sum += weight * value;
        }
        sum
    }
}
