//! Irradiance in whole numbers, from an atlas in any codes.

use relume::color::Rgb;
use relume::relight::{FixedMix, FixedWeight, relight_fixed};

use crate::atlas::{RelumeAtlas, RelumeRgb};
use crate::status::{RelumeStatus, exclusive, shared, status, values, values_mut};

/// Words of memory for each light of `relume_irradiance`.
pub const RELUME_LIGHT_WORDS: usize = 24;

const _: () =
    assert!(size_of::<FixedWeight>() <= 4 * RELUME_LIGHT_WORDS && align_of::<FixedWeight>() <= 4);

/// Irradiance of every element (or what else the atlas holds) under a mix: `sums` gets red, green and blue of each of the
/// `elements`, and `unit` what one unit of them is worth, a power of two. The unit fits `brightest`, which no weight of `mix` exceeds;
/// `memory` is scratch of `RELUME_LIGHT_WORDS` for each light. Weights are set in floats, all else is integers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn relume_irradiance(
    atlas: *const RelumeAtlas,
    brightest: *const RelumeRgb,
    mix: *const RelumeRgb,
    lights: usize,
    memory: *mut u32,
    words: usize,
    sums: *mut u32,
    elements: usize,
    unit: *mut f32,
) -> RelumeStatus {
    status((|| {
        // SAFETY: by the rules.
        let atlas = unsafe { shared(atlas)?.get()? };
        // SAFETY: by the rules; a triple is a triple.
        let (brightest, mix) = unsafe {
            let brightest = values(brightest.cast::<Rgb>(), lights)?;
            (brightest, values(mix.cast::<Rgb>(), lights)?)
        };
        // SAFETY: by the rules.
        let (sums, unit) = unsafe { (values_mut(sums.cast(), elements)?, exclusive(unit)?) };
        // SAFETY: by the rules.
        let memory = unsafe { values_mut(memory, words)? };
        if lights != atlas.light_count() as usize || words / RELUME_LIGHT_WORDS < lights {
            return Err(RelumeStatus::Length);
        }
        let own = memory.as_mut_ptr().cast::<FixedWeight>();
        // SAFETY: there is room for so many, as was just checked, and they are written first.
        let own = unsafe {
            for light in 0..lights {
                own.add(light).write(FixedWeight::EMPTY);
            }
            values_mut(own, lights)?
        };
        let mix = FixedMix::new(atlas, brightest, mix, own)?;
        relight_fixed(atlas, &mix, sums)?;
        *unit = mix.unit();
        Ok(())
    })())
}
