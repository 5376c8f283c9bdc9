//! From sums to pixels: a table of greys over linear steps, whose fields are the colours of a pixel.

use embedded_graphics::pixelcolor::Rgb565;
use embedded_graphics::pixelcolor::raw::RawU16;
use relume::color::Rgb;
use relume::tone::Exposure;

/// Factor on radiance with which the evening looks as it should.
pub const EXPOSURE: f32 = 1.3;

/// Steps of the table; the smallest is a fifth of the first step of the display.
pub(crate) const STEPS: usize = 4096;

/// Greys of sums.
#[derive(Debug)]
pub(crate) struct Tone<'a> {
    greys: &'a [u16; STEPS],
    /// What brings a sum to the steps of the table.
    shift: u32,
}

impl<'a> Tone<'a> {
    /// For sums whose unit is worth so much radiance; fills the table.
    pub(crate) fn new(unit: f32, greys: &'a mut [u16; STEPS]) -> Self {
        let exposure = Exposure::new(EXPOSURE).unwrap_or(Exposure::ONE);
        // The table reaches white, and less than twice as far.
        let (mut shift, mut step) = (0, unit);
        while shift < 31 && step * EXPOSURE * (STEPS as f32) < 1.0 {
            (shift, step) = (shift + 1, step * 2.0);
        }
        for (grey, place) in greys.iter_mut().zip(0_u16..) {
            *grey = exposure.rgb565(Rgb::splat((f32::from(place) + 0.5) * step));
        }
        Self { greys, shift }
    }

    pub(crate) fn pixel(&self, [r, g, b]: [u32; 3]) -> Rgb565 {
        let grey = |sum: u32| {
            let found = self.greys.get((sum >> self.shift) as usize);
            found.copied().unwrap_or(u16::MAX)
        };
        RawU16::new(grey(r) & 0xf800 | grey(g) & 0x07e0 | grey(b) & 0x001f).into()
    }
}
