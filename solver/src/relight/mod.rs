//! Atlas times mix: the irradiance of every element under any setting of the lights.
//!
//! `E_j = sum_m w_m x_m(c_jm)`, channel by channel, with the decoded value `x_m` of a code
//! ([`Curve`](crate::code::Curve)) and the weight `w_m`, the mix. Three kernels over the same codes:
//!
//! * [`relight`] in `f32`, for a host, in vectors where codes are bytes;
//! * [`relight_fixed`] in integers, for any device: every contribution is rounded to a whole number of a common unit
//!   and `u32` sums are exact, so that a change ([`change_fixed`]) gives the bits of a full
//!   relight, and a change and its undoing restore the same bits. Terms come from a table of all products
//!   ([`FixedTable`]: the loop only adds) or are multiplied on the way ([`FixedMix`]), with the same bits;
//! * [`relight_wide`] in integers of any range, which keeps the relative error that
//!   [`Curve`](crate::code::Curve) proves for the logarithmic code.
//!
//! Frames of a display go further, from levels of 16 bits to pixels in integers: whole ones from kept tables ([`full`]), or sums that
//! single lights change ([`Sums`]). What a device does with two lights and three elements:
//!
//! ```
//! use relume::atlas::{Contents, LightEntry, Quantity, size, write};
//! use relume::code::{Code, Curve, Scale};
//! use relume::color::Rgb;
//! use relume::relight::{Finish, Form, FrameLight, Lum, Run, Sums};
//! use relume::tone::Rgb565Table;
//!
//! // The bytes that `relume pack --code lum8` writes and `relume export` makes source of.
//! let light = |name| LightEntry {
//!     name,
//!     emission: Rgb::WHITE,
//!     code: Code::Lum8,
//!     curves: [Curve::Exponential { scale: Scale::ONE }; 3],
//!     last: [255; 3],
//! };
//! let contents = Contents {
//!     quantity: Quantity::Irradiance,
//!     lights: &[light("ceiling"), light("desk")],
//!     elements: 3,
//!     image_width: 0,
//!     errors: None,
//!     tiles: &[],
//!     mesh: None,
//! };
//! let mut bytes = vec![0; size(&contents)?];
//! let contribution = |element, light| Rgb::splat(0.1 + 0.2 * (element + light) as f32);
//! write(&contents, contribution, &mut bytes)?;
//!
//! // On the device: all memory is the caller's.
//! static TONE: Rgb565Table = Rgb565Table::new(512);
//! let atlas = Lum::parse(&bytes)?;
//! let mut room = [FrameLight::EMPTY; 2];
//! let mut mix = Lum::mix(&atlas, &[Rgb::WHITE; 2], &mut room)?; // W/m2 of the lights at level u16::MAX
//! let runs = [Run { elements: 3, reflectance: [u16::MAX / 2; 3] }];
//! let finish = Finish::new(&atlas, &mix, &runs, 1.0, &TONE)?;
//!
//! mix.set(0, [u16::MAX; 3]);
//! mix.set(1, [20_000; 3]);
//! let (mut sums, mut table, mut pixels) = ([0; 3], [0; 256], [0; 3]);
//! let mut frame = Sums::<Lum, 2>::new(&atlas, &mix, &mut sums, &mut table)?;
//! frame.show(&finish, &mut pixels)?;
//! let both = pixels;
//!
//! frame.change(&atlas, &mut mix, (1, [0; 3]))?; // one light off
//! frame.show(&finish, &mut pixels)?;
//! assert!(pixels < both);
//! frame.change(&atlas, &mut mix, (1, [20_000; 3]))?; // and on again: the same bits
//! frame.show(&finish, &mut pixels)?;
//! assert_eq!(pixels, both);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod by_light;
mod bytes;
mod fitted;
mod fixed;
mod float;
mod frame;
mod packed;
mod wide;

use core::fmt;

use self::bytes::Values;
use crate::atlas::Atlas;
use crate::color::Rgb;

pub use by_light::{add_lights, change_light, show_sums};
pub use fitted::Fitted;
pub use fixed::{FixedMix, FixedTable, FixedWeight, Terms, change_fixed, relight_fixed};
pub use float::{DecodeTable, relight};
pub use frame::{Encode, Finish, FrameLight, FrameMix, Run, STEPS};
pub use packed::{AnyTable, Colour, Form, Lum, Sums, add_any, fill_table, full, full_any};
pub use wide::{Wide, WideWeight, relight_wide};

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
    /// A table is too short.
    Table {
        /// Entries that are needed.
        needed: usize,
    },
    /// The mix is too bright for the fixed-point range; start again with [`FixedMix::new`] or [`FrameMix::new`], or with a
    /// dimmer exposure.
    Range,
    /// The codes of the atlas are not those that a kernel reads.
    Code,
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
            Self::Table { needed } => write!(f, "the table needs {needed} entries"),
            Self::Range => f.write_str("the mix is too bright for the fixed-point range"),
            Self::Code => f.write_str("the atlas is in other codes than this kernel reads"),
        }
    }
}

impl core::error::Error for RelightError {}

/// One value for every code of every light and channel, in memory of the caller.
#[derive(Debug)]
struct CodeTable<'a, T> {
    values: &'a mut [T],
    /// Codes of a light and channel.
    levels: usize,
}

/// Entries of a table of all codes of an atlas: lights x 3 channels x [`Atlas::levels`].
#[must_use]
pub fn table_length(atlas: &Atlas) -> usize {
    atlas.light_count() as usize * 3 * atlas.levels()
}

impl<'a, T: Copy + Default> CodeTable<'a, T> {
    fn new(atlas: &Atlas, values: &'a mut [T]) -> Result<Self, RelightError> {
        let needed = table_length(atlas);
        let values = values.get_mut(..needed);
        Ok(Self {
            values: values.ok_or(RelightError::Table { needed })?,
            levels: atlas.levels(),
        })
    }

    /// Fills the entries of one light with `f(channel, code)`.
    fn fill(&mut self, light: u32, f: impl Fn(usize, u16) -> T) {
        let length = 3 * self.levels;
        let own = self.values.get_mut(light as usize * length..);
        let channels = own.unwrap_or_default().chunks_mut(self.levels.max(1));
        for (channel, values) in channels.take(3).enumerate() {
            for (value, code) in values.iter_mut().zip(0..) {
                *value = f(channel, code);
            }
        }
    }

    /// The same values where every code is a byte: `[light][channel][code]`; nothing where not.
    fn of_bytes(&self) -> &[Values<T>] {
        if self.levels == 256 {
            self.values.as_chunks().0.as_chunks().0
        } else {
            &[]
        }
    }

    fn get(&self, light: u32, channel: usize, code: u16) -> T {
        let at = (light as usize * 3 + channel) * self.levels + usize::from(code);
        self.values.get(at).copied().unwrap_or_default()
    }
}

fn check_mix(atlas: &Atlas, mix: &[Rgb]) -> Result<(), RelightError> {
    check_lights(atlas, mix.len())?;
    match mix.iter().position(|weight| !weight.is_legal()) {
        Some(light) => Err(RelightError::Mix {
            light: light as u32,
        }),
        None => Ok(()),
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
mod test_atlas;

#[cfg(test)]
mod tests;

#[cfg(test)]
mod packed_tests;
