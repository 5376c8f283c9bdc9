//! A smart-home room panel of 320 x 240 pixels: the rooms as their lamps really light them, and a slider for each lamp.
//!
//! What a product does with Relume. The picture of the flat is an atlas of an image: its elements are the pixels, so a
//! frame is relit tile by tile, toned, and sent to the display; the device has no memory for a picture. A tap on a
//! lamp, in the picture or on its slider, toggles it; a drag along the slider dims it; [`Panel::tick`] fades.
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

mod tone;

mod lamp;

mod layout;

mod picture;

mod controls;

mod evening;

use embedded_graphics::draw_target::DrawTarget;
use embedded_graphics::geometry::{Point, Size};
use embedded_graphics::pixelcolor::Rgb565;
use relume::atlas::Atlas;
use relume::color::Rgb;
use relume::relight::{FixedMix, FixedTable, FixedWeight, RelightError, table_length};

pub use evening::EVENING;
pub use lamp::{LAMPS, Lamp, ROOMS};
pub use layout::{PICTURE, SCREEN, slider};
pub use tone::EXPOSURE;

use tone::{STEPS, Tone};

/// Lights of the atlas: the lamps, and the dusk outside, which nobody can switch.
pub const LIGHTS: usize = LAMPS + 1;

/// Codes of a light and channel that [`Memory`] has room for.
pub const LEVELS: usize = 512;

/// What the panel works in; 51 KiB. A `static` of a device, a box of a host.
#[derive(Debug)]
pub struct Memory {
    weights: [FixedWeight; LIGHTS],
    table: [u32; LIGHTS * 3 * LEVELS],
    greys: [u16; STEPS],
}

impl Memory {
    /// Zeros.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            weights: [FixedWeight::EMPTY; LIGHTS],
            table: [0; LIGHTS * 3 * LEVELS],
            greys: [0; STEPS],
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
    atlas: Atlas<'a>,
    lamps: [Lamp; LAMPS],
    mix: FixedMix<'a>,
    table: FixedTable<'a>,
    tone: Tone<'a>,
}

impl<'a> Panel<'a> {
    /// All lamps off; `None` for an atlas that is not a picture of the flat.
    #[must_use]
    pub fn new(atlas: Atlas<'a>, memory: &'a mut Memory) -> Option<Self> {
        let is_picture = atlas.image_size() == Some([PICTURE.size.width, PICTURE.size.height]);
        if !is_picture || table_length(&atlas) > memory.table.len() {
            return None;
        }
        let mut nominal = [Rgb::BLACK; LIGHTS];
        for (nominal, light) in nominal.iter_mut().zip(atlas.lights()) {
            *nominal = light.emission;
        }
        let mut dark = [Rgb::BLACK; LIGHTS];
        if let (Some(dark), Some(nominal)) = (dark.last_mut(), nominal.last()) {
            *dark = *nominal;
        }
        let mix = FixedMix::new(&atlas, &nominal, &dark, &mut memory.weights).ok()?;
        let table = FixedTable::new(&atlas, &mix, &mut memory.table).ok()?;
        let mut lamps = [Lamp::OFF; LAMPS];
        for (lamp, nominal) in lamps.iter_mut().zip(nominal) {
            lamp.nominal = nominal;
        }
        Some(Self {
            atlas,
            lamps,
            tone: Tone::new(mix.unit(), &mut memory.greys),
            mix,
            table,
        })
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
    /// None in fact: no lamp exceeds its nominal emission.
    pub fn tick(&mut self) -> Result<bool, RelightError> {
        let mut has_changed = false;
        for (lamp, light) in self.lamps.iter_mut().zip(0..) {
            if lamp.fade() {
                self.mix.set(light, lamp.weight())?;
                self.table.update(&self.mix, light);
                has_changed = true;
            }
        }
        Ok(has_changed)
    }

    /// Paints the whole screen.
    ///
    /// # Errors
    /// Those of the display.
    pub fn draw<D: DrawTarget<Color = Rgb565>>(&self, display: &mut D) -> Result<(), D::Error> {
        controls::draw(display, &self.lamps)?;
        picture::draw(display, &self.atlas, &self.table, &self.tone)
    }
}

/// Size of the screen.
const SIZE: Size = Size::new(320, 240);
