//! A smart-home room panel of 320 x 240 pixels: the rooms as their lamps really light them, and a slider for each lamp.
//!
//! What a product does with Relume. The picture of the flat is an atlas of an image: its elements are the pixels, and
//! a frame is relit in integers, straight to RGB565. A tap on a lamp, in the picture or on its slider, toggles it; a drag along the slider dims it; [`Panel::tick`] fades.
//!
//! No std, no allocation, no unsafe code, no panic: the host's example and the microcontroller's image run the same
//! code. The caller lends all memory ([`Memory`]).

#![no_std]
#![forbid(unsafe_code)]
#![deny(
    clippy::indexing_slicing,
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic
)]

mod lamp;

mod layout;

mod picture;

mod controls;

mod evening;

use embedded_graphics::draw_target::DrawTarget;
use embedded_graphics::geometry::{Point, Size};
use embedded_graphics::pixelcolor::Rgb565;
use embedded_graphics::pixelcolor::raw::RawU16;
use relume::atlas::Atlas;
use relume::relight::{FrameLight, RelightError};

pub use evening::EVENING;
pub use lamp::{LAMPS, Lamp, ROOMS};
pub use layout::{PICTURE, SCREEN, slider};
pub use picture::{BRIGHTEST, EXPOSURE};

use picture::{DARK, PIXELS, Picture, Tables};

/// Lights of the atlas: the lamps, and the dusk outside, which nobody can switch.
pub const LIGHTS: usize = LAMPS + 1;

/// What the panel works in; 92 KiB of zeros. A `static` of a device, a box of a host.
#[derive(Debug)]
pub struct Memory {
    lights: [FrameLight; LIGHTS],
    tables: Tables,
    pixels: [u16; PIXELS],
}

impl Memory {
    /// Memory for one panel.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            lights: [FrameLight::EMPTY; LIGHTS],
            tables: DARK,
            pixels: [0; PIXELS],
        }
    }
}

impl Default for Memory {
    fn default() -> Self {
        Self::new()
    }
}

/// What a finger does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Touch {
    /// A tap: toggles the lamp that it hits, in the picture or on its slider.
    Tap(Point),
    /// A finger that moves along a slider: dims its lamp to the level under it.
    Drag(Point),
}

/// The panel: lamps, their state, and the picture of the flat.
#[derive(Debug)]
pub struct Panel<'a> {
    lamps: [Lamp; LAMPS],
    picture: Picture<'a>,
}

impl<'a> Panel<'a> {
    /// All lamps off.
    ///
    /// # Errors
    /// An atlas that is not a picture of the flat.
    pub fn new(atlas: Atlas<'a>, memory: &'a mut Memory) -> Result<Self, RelightError> {
        let Memory {
            lights,
            tables,
            pixels,
        } = memory;
        let mut picture = Picture::new(atlas, lights, tables, pixels)?;
        for lamp in 0..LAMPS {
            picture.set(lamp as u32, 0)?;
        }
        picture.set(LAMPS as u32, u16::MAX)?;
        picture.relight()?;
        let lamps = [Lamp::OFF; LAMPS];
        Ok(Self { lamps, picture })
    }

    /// The lamps, room by room.
    #[must_use]
    pub const fn lamps(&self) -> &[Lamp; LAMPS] {
        &self.lamps
    }

    /// Does what a finger asks for; lamps fade there by [`Panel::tick`].
    pub fn touch(&mut self, touch: Touch) {
        match touch {
            Touch::Tap(at) => {
                if let Some(lamp) = layout::lamp_at(at).and_then(|lamp| self.lamps.get_mut(lamp)) {
                    lamp.toggle();
                }
            }
            Touch::Drag(at) => {
                if let Some((lamp, level)) = layout::level_at(at)
                    && let Some(lamp) = self.lamps.get_mut(lamp)
                {
                    lamp.set(level);
                }
            }
        }
    }

    /// One step of every fade; true when the picture has changed.
    ///
    /// # Errors
    /// None in fact: the atlas was fit when the panel was made.
    pub fn tick(&mut self) -> Result<bool, RelightError> {
        let mut has_changed = false;
        for (lamp, light) in self.lamps.iter_mut().zip(0..) {
            if lamp.fade() {
                self.picture.set(light, lamp.weight())?;
                has_changed = true;
            }
        }
        if has_changed {
            self.picture.relight()?;
        }
        Ok(has_changed)
    }

    /// Paints the whole screen.
    ///
    /// # Errors
    /// Those of the display.
    pub fn draw<D: DrawTarget<Color = Rgb565>>(&self, display: &mut D) -> Result<(), D::Error> {
        controls::draw(display, &self.lamps)?;
        let pixels = self.picture.pixels().iter();
        let colors = pixels.map(|pixel| RawU16::new(*pixel).into());
        display.fill_contiguous(&PICTURE, colors)
    }
}

/// Size of the screen.
const SIZE: Size = Size::new(320, 240);
