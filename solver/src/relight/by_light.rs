//! Frames of any number of lights: one light after the other over all elements, with one table.
//!
//! For callers that do not know the number of lights when they compile, the C library above all. Sums and pixels have
//! the bits of [`full`](super::full), which takes half the instructions where there are many lights.

use core::num::NonZeroUsize;

use super::frame::{Encode, Finish, FrameMix};
use super::packed::{Factors, Form, HAS_WIDE, check_pixels, fill_change, fill_table};
use super::{RelightError, check_elements};
use crate::atlas::Atlas;

/// Adds up a mix in `sums` of one entry per element; `table` is scratch.
///
/// # Errors
/// A slice that does not fit the atlas; [`RelightError::Code`] for another form.
pub fn add_lights<F: Form>(
    atlas: &Atlas,
    mix: &FrameMix,
    table: &mut F::Table,
    sums: &mut [F::Sum],
) -> Result<(), RelightError> {
    check_elements(atlas, sums.len())?;
    sums.fill(F::Sum::default());
    for light in 0..atlas.light_count() {
        fill_table::<F>(atlas, mix, light, table)?;
        add::<F>(atlas, light, table, sums)?;
    }
    Ok(())
}

/// Sets the levels of one light, and corrects the sums for it; `table` is scratch.
///
/// # Errors
/// As [`add_lights`], or no such light. Nothing has changed then.
pub fn change_light<F: Form>(
    atlas: &Atlas,
    mix: &mut FrameMix,
    (light, levels): (u32, [u16; 3]),
    table: &mut F::Table,
    sums: &mut [F::Sum],
) -> Result<(), RelightError> {
    check_elements(atlas, sums.len())?;
    F::codes(atlas).ok_or(RelightError::Code)?;
    fill_change::<F>(atlas, mix, (light, levels), table)?;
    add::<F>(atlas, light, table, sums)
}

/// Adds what a table says of a light's codes.
fn add<F: Form>(
    atlas: &Atlas,
    light: u32,
    table: &F::Table,
    sums: &mut [F::Sum],
) -> Result<(), RelightError> {
    let codes = F::codes(atlas).ok_or(RelightError::Code)?;
    let lights = NonZeroUsize::new(atlas.light_count() as usize);
    let lights = lights.ok_or(RelightError::Lights { expected: 1 })?;
    let rows = codes.chunks_exact(lights.get());
    for (sum, row) in sums.iter_mut().zip(rows) {
        if let Some(codes) = row.get(light as usize) {
            *sum = F::add(*sum, table, codes);
        }
    }
    Ok(())
}

/// The pixels of sums.
///
/// # Errors
/// Slices and runs of different lengths.
pub fn show_sums<F: Form, T: Encode>(
    atlas: &Atlas,
    sums: &[F::Sum],
    finish: &Finish<T>,
    pixels: &mut [T::Pixel],
) -> Result<(), RelightError> {
    check_elements(atlas, sums.len())?;
    check_pixels(sums.len(), pixels.len())?;
    let mut pixels = pixels;
    finish.by_run(sums, |sums, factors| {
        let factors = Factors::new::<F>(factors);
        let own = pixels.split_off_mut(..sums.len()).unwrap_or_default();
        for (sum, pixel) in sums.iter().zip(own) {
            *pixel = finish.tone.encode(factors.steps::<F, T, HAS_WIDE>(*sum));
        }
    })
}
