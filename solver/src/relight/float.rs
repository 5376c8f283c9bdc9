//! The sum in `f32`.

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
    let tables = table.0.of_bytes();
    if let Some(rows) = atlas.triples().filter(|_| tables.len() == mix.len()) {
        for (sum, row) in irradiance.iter_mut().zip(rows) {
            *sum = mixed(row, tables, mix);
        }
        return Ok(());
    }
    irradiance.fill(Rgb::BLACK);
    atlas.for_each(|element, light, codes| {
        let sum = irradiance.get_mut(element as usize);
        if let (Some(sum), Some(weight)) = (sum, mix.get(light as usize)) {
            *sum += *weight * table.decode(light, codes);
        }
    });
    Ok(())
}

/// An element under a mix, all of whose lights have codes of three bytes: no look-up can fail, which is four times as fast.
fn mixed(row: &[[u8; 3]], tables: &[[[f32; 256]; 3]], mix: &[Rgb]) -> Rgb {
    let mut sum = Rgb::BLACK;
    for (([r, g, b], tables), weight) in row.iter().zip(tables).zip(mix) {
        let [reds, greens, blues] = tables;
        let value = |table: &[f32; 256], code: u8| {
            // A byte is below 256.
            #[allow(clippy::indexing_slicing)]
            table[usize::from(code)]
        };
        sum += *weight * Rgb::new(value(reds, *r), value(greens, *g), value(blues, *b));
    }
    sum
}
