//! The flat under the lamps as they are: the atlas relit to a pixel for every element.

use core::f32::consts::PI;

use relume::atlas::Atlas;
use relume::color::Rgb;
use relume::relight::{
    Colour, Finish, Form, FrameLight, FrameMix, RelightError, Run, fill_table, full,
};
use relume::tone::Rgb565Table;

use crate::LIGHTS;
use crate::layout::PICTURE;

/// Factor on radiance with which the evening looks as it should.
pub const EXPOSURE: f32 = 1.3;

/// How many times white a lamp by itself can be in the atlas: one that is dimmed a little is still white.
pub const BRIGHTEST: f32 = 2.0;

/// White in so few steps that all lamps together fit, and so many that the first is black.
static TONE: Rgb565Table = Rgb565Table::new(850);

pub(crate) const PIXELS: usize = (PICTURE.size.width * PICTURE.size.height) as usize;

/// The pixels reflect nothing more: they are radiance already.
static RUNS: [Run; 1] = [Run {
    elements: PIXELS as u32,
    reflectance: [u16::MAX; 3],
}];

/// What the codes of every light contribute.
pub(crate) type Tables = [<Colour as Form>::Table; LIGHTS];

/// Nothing.
pub(crate) const DARK: Tables = [Colour::EMPTY; LIGHTS];

/// A mix, its tables, and the pixels that it gave.
#[derive(Debug)]
pub(crate) struct Picture<'a> {
    atlas: Atlas<'a>,
    mix: FrameMix<'a>,
    tables: &'a mut Tables,
    pixels: &'a mut [u16; PIXELS],
}

impl<'a> Picture<'a> {
    /// All lights off.
    pub(crate) fn new(
        atlas: Atlas<'a>,
        lights: &'a mut [FrameLight; LIGHTS],
        tables: &'a mut Tables,
        pixels: &'a mut [u16; PIXELS],
    ) -> Result<Self, RelightError> {
        let mut full = [Rgb::BLACK; LIGHTS];
        for (full, light) in full.iter_mut().zip(atlas.lights()) {
            *full = light.emission;
        }
        Ok(Self {
            mix: FrameMix::new(&atlas, &full, lights)?,
            atlas,
            tables,
            pixels,
        })
    }

    /// Sets a light to a share of its nominal emission, in 2^-16.
    pub(crate) fn set(&mut self, light: u32, level: u16) -> Result<(), RelightError> {
        self.mix.set(light, [level; 3]);
        let table = self.tables.get_mut(light as usize);
        let expected = LIGHTS as u32;
        let table = table.ok_or(RelightError::Lights { expected })?;
        fill_table::<Colour>(&self.atlas, &self.mix, light, table)
    }

    /// Makes the pixels.
    pub(crate) fn relight(&mut self) -> Result<(), RelightError> {
        // The kernel shows `E / pi`.
        let finish = Finish::new(&self.atlas, &self.mix, &RUNS, EXPOSURE * PI, &TONE)?;
        full::<Colour, LIGHTS, _>(&self.atlas, self.tables, &finish, self.pixels)
    }

    /// The pixels as they were made last, row by row.
    pub(crate) const fn pixels(&self) -> &[u16; PIXELS] {
        self.pixels
    }
}
