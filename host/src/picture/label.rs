//! Text on a picture, in the fixed-width fonts of embedded-graphics (Latin-1; others become `?`).

use std::convert::Infallible;

use embedded_graphics::Pixel;
use embedded_graphics::draw_target::DrawTarget;
use embedded_graphics::geometry::{OriginDimensions, Point, Size};
use embedded_graphics::mono_font::iso_8859_1::{FONT_7X13, FONT_10X20};
use embedded_graphics::mono_font::{MonoFont, MonoTextStyle};
use embedded_graphics::pixelcolor::{Rgb888, RgbColor};
use embedded_graphics::text::{Baseline, Text};
use tiny_skia::{ColorU8, Pixmap};

/// How large the letters are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Letters {
    /// 7 x 13 pixels: captions and ticks.
    Small,
    /// 10 x 20 pixels: titles.
    Large,
}

impl Letters {
    fn font(self) -> &'static MonoFont<'static> {
        match self {
            Self::Small => &FONT_7X13,
            Self::Large => &FONT_10X20,
        }
    }

    /// Height of a line in pixels.
    #[must_use]
    pub fn height(self) -> u32 {
        self.font().character_size.height
    }

    /// Width of `text` (one line) in pixels.
    #[must_use]
    pub fn width(self, text: &str) -> u32 {
        let letters = u32::try_from(text.chars().count()).unwrap_or(u32::MAX);
        letters.saturating_mul(self.font().character_size.width + self.font().character_spacing)
    }
}

/// Writes one line with its top left corner at `(x, y)`; what falls outside is cut off.
pub fn write_label(
    picture: &mut Pixmap,
    (x, y): (i32, i32),
    text: &str,
    letters: Letters,
    colour: [u8; 3],
) {
    let [r, g, b] = colour;
    let style = MonoTextStyle::new(letters.font(), Rgb888::new(r, g, b));
    let line = Text::with_baseline(text, Point::new(x, y), style, Baseline::Top);
    let Ok(_) = embedded_graphics::Drawable::draw(&line, &mut Canvas(picture));
}

/// Lets embedded-graphics draw on a pixmap.
struct Canvas<'a>(&'a mut Pixmap);

impl OriginDimensions for Canvas<'_> {
    fn size(&self) -> Size {
        Size::new(self.0.width(), self.0.height())
    }
}

impl DrawTarget for Canvas<'_> {
    type Color = Rgb888;
    type Error = Infallible;

    fn draw_iter<I>(&mut self, pixels: I) -> Result<(), Infallible>
    where
        I: IntoIterator<Item = Pixel<Rgb888>>,
    {
        let (width, height) = (self.0.width(), self.0.height());
        for Pixel(Point { x, y }, colour) in pixels {
            let (Ok(x), Ok(y)) = (u32::try_from(x), u32::try_from(y)) else {
                continue;
            };
            if x < width && y < height {
                let opaque = ColorU8::from_rgba(colour.r(), colour.g(), colour.b(), 255);
                let place = y as usize * width as usize + x as usize;
                self.0.pixels_mut()[place] = opaque.premultiply();
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_cover_their_box_and_nothing_else() {
        let mut picture = Pixmap::new(60, 30).unwrap();
        write_label(&mut picture, (10, 5), "ab", Letters::Small, [255, 0, 0]);
        let inked = |x: u32, y: u32| picture.pixel(x, y).unwrap().red() > 0;
        let mut count = 0;
        for y in 0..30 {
            for x in 0..60 {
                let inside = (10..10 + Letters::Small.width("ab")).contains(&x)
                    && (5..5 + Letters::Small.height()).contains(&y);
                assert!(inside || !inked(x, y), "ink at {x}, {y}");
                count += u32::from(inked(x, y));
            }
        }
        assert!(count > 20, "{count}");
    }

    #[test]
    fn text_that_leaves_the_picture_is_cut_off() {
        let mut picture = Pixmap::new(8, 8).unwrap();
        for place in [(-20, -20), (-5, 3), (6, 6), (100, 0)] {
            write_label(
                &mut picture,
                place,
                "W\u{e4}\u{416}",
                Letters::Large,
                [1, 2, 3],
            );
        }
    }
}
