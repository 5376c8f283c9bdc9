//! Pictures: linear radiance, its exposure, and the 8-bit picture that a screen shows.
//!
//! A shown code is `round(255 srgb(min(exposure * L, 1)))` per channel, `L` the radiance in
//! W/m2/sr and `srgb` the transfer function of IEC 61966-2-1. Automatic exposure is `1 / white`,
//! where `white` is the 98th percentile of luminance (unweighted, linear interpolation between the
//! two nearest values). Where a pixel is covered in part, its colour is laid over the background in
//! display codes, as any compositor does.

mod false_colour;
mod label;
mod sheet;

use std::fmt;
use std::str::FromStr;

use relume::color::Rgb;
use relume::tone::{self, srgb_encode};
use tiny_skia::{Color, ColorU8, Pixmap, PixmapPaint, PremultipliedColorU8, Transform};

pub use false_colour::{code_errors, error_map, inferno};
pub use label::{Letters, write_label};
pub use sheet::{Tile, sheet};

/// The share of values that is not brighter than white.
const WHITE_PERCENTILE: f64 = 0.98;

/// A linear picture.
#[derive(Clone, Debug, PartialEq)]
pub struct LinearImage {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Row by row from the top left: red, green and blue (linear, unexposed, multiplied by the
    /// coverage), and the coverage from 0 (background) to 1.
    pub pixels: Vec<[f32; 4]>,
}

impl LinearImage {
    /// A picture of background only.
    #[must_use]
    pub fn empty(width: u32, height: u32) -> Self {
        Self {
            width,
            height,
            pixels: vec![[0.0; 4]; width as usize * height as usize],
        }
    }

    /// Radiance of the pixels that are at least half covered, free of their coverage.
    pub fn visible(&self) -> impl Iterator<Item = Rgb> + '_ {
        let covered = self.pixels.iter().filter(|[.., coverage]| *coverage >= 0.5);
        covered.map(|pixel| uncovered(*pixel))
    }
}

/// Colour of a pixel without its coverage; black where nothing is.
fn uncovered([r, g, b, coverage]: [f32; 4]) -> Rgb {
    if coverage > 0.0 {
        Rgb::new(r, g, b) * coverage.recip()
    } else {
        Rgb::BLACK
    }
}

/// Why a picture was not made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PictureError {
    /// A side is zero, or the picture does not fit into memory.
    #[error("a picture of {width} x {height} pixels is impossible")]
    Size {
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
    },
    /// Two pictures that belong together differ in size.
    #[error("the pictures differ in size: {first} and {second} pixels")]
    Mismatch {
        /// Size of the first, as `WIDTHxHEIGHT`.
        first: String,
        /// Size of the second.
        second: String,
    },
    /// The PNG encoder refused.
    #[error("encoding the PNG failed: {0}")]
    Png(String),
}

/// What maps radiance to white: a factor that the user gives, or one from the picture itself.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Exposure {
    /// From the 98th percentile of the visible pixels' luminance.
    #[default]
    Auto,
    /// This factor on radiance, in (W/m2/sr)^-1; positive and finite.
    Factor(f32),
}

impl Exposure {
    /// The factor for this picture; 1 for a picture in which nothing shines.
    #[must_use]
    pub fn factor(self, image: &LinearImage) -> f32 {
        match self {
            Self::Auto => tone::Exposure::for_white(white(image.visible())).factor(),
            Self::Factor(factor) => factor,
        }
    }
}

impl fmt::Display for Exposure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Factor(factor) => factor.fmt(f),
        }
    }
}

impl FromStr for Exposure {
    type Err = String;

    /// Reads `auto` or a positive finite number.
    fn from_str(text: &str) -> Result<Self, String> {
        if text == "auto" {
            return Ok(Self::Auto);
        }
        match text.parse() {
            Ok(factor) if factor > 0.0 && f32::is_finite(factor) => Ok(Self::Factor(factor)),
            _ => Err(format!("`{text}` is neither `auto` nor a positive number")),
        }
    }
}

/// The 98th percentile of luminance, in the unit of `values`; 0 for none.
///
/// Every value counts once; between the two nearest values it is interpolated linearly.
#[must_use]
pub fn white(values: impl IntoIterator<Item = Rgb>) -> f32 {
    let mut luminances: Vec<f32> = values.into_iter().map(Rgb::luminance).collect();
    if luminances.is_empty() {
        return 0.0;
    }
    let place = WHITE_PERCENTILE * (luminances.len() - 1) as f64;
    let (_, below, above) = luminances.select_nth_unstable_by(place as usize, f32::total_cmp);
    let next = above.iter().copied().min_by(f32::total_cmp);
    let step = next.map_or(0.0, |next| f64::from(next) - f64::from(*below));
    (f64::from(*below) + place.fract() * step) as f32
}

/// Display code of one channel before rounding, in [0, 255].
fn display_code(radiance: f32, exposure: f32) -> f32 {
    255.0 * srgb_encode(radiance * exposure)
}

/// The picture as a screen shows it, over a background in sRGB codes.
///
/// # Errors
/// [`PictureError::Size`].
pub fn to_pixmap(
    image: &LinearImage,
    exposure: f32,
    background: [u8; 3],
) -> Result<Pixmap, PictureError> {
    let mut source = blank(image.width, image.height)?;
    for (shown, pixel) in source.pixels_mut().iter_mut().zip(&image.pixels) {
        *shown = display_pixel(*pixel, exposure);
    }
    let mut picture = filled(image.width, image.height, background)?;
    lay(&mut picture, &source, 0, 0);
    Ok(picture)
}

fn display_pixel(pixel: [f32; 4], exposure: f32) -> PremultipliedColorU8 {
    let code = |radiance| display_code(radiance, exposure).round() as u8;
    let Rgb { r, g, b } = uncovered(pixel);
    let alpha = (255.0 * pixel[3]).round() as u8;
    ColorU8::from_rgba(code(r), code(g), code(b), alpha).premultiply()
}

/// A transparent pixmap.
fn blank(width: u32, height: u32) -> Result<Pixmap, PictureError> {
    Pixmap::new(width, height).ok_or(PictureError::Size { width, height })
}

/// A pixmap of one colour.
fn filled(width: u32, height: u32, [r, g, b]: [u8; 3]) -> Result<Pixmap, PictureError> {
    let mut pixmap = blank(width, height)?;
    pixmap.fill(Color::from_rgba8(r, g, b, 255));
    Ok(pixmap)
}

/// Lays one picture over another, its top left corner at `(x, y)`.
fn lay(under: &mut Pixmap, over: &Pixmap, x: i32, y: i32) {
    let paint = PixmapPaint::default();
    under.draw_pixmap(x, y, over.as_ref(), &paint, Transform::identity(), None);
}

/// The bytes of a picture's PNG file.
///
/// # Errors
/// [`PictureError::Png`].
pub fn encode_png(picture: &Pixmap) -> Result<Vec<u8>, PictureError> {
    picture
        .encode_png()
        .map_err(|error| PictureError::Png(error.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grey(value: f32) -> Rgb {
        Rgb::splat(value)
    }

    #[test]
    fn white_interpolates_between_the_two_nearest_values() {
        let ramp = |n: u32| (0..n).rev().map(|i| grey(i as f32));
        assert_eq!(white(ramp(0)), 0.0);
        assert_eq!(white(ramp(1)), 0.0);
        assert!((white(ramp(101)) - 98.0).abs() < 1e-4);
        assert!((white(ramp(11)) - 9.8).abs() < 1e-5);
        assert!((white([grey(1.0), grey(2.0)]) - 1.98).abs() < 1e-6);
    }

    #[test]
    fn exposure_ignores_the_background_and_black_pictures() {
        let mut image = LinearImage::empty(10, 10);
        assert_eq!(Exposure::Auto.factor(&image), 1.0);
        image.pixels[3] = [1.0, 1.0, 1.0, 0.5]; // half covered: its own radiance is 2
        image.pixels[4] = [0.2, 0.2, 0.2, 0.1]; // hardly covered: does not count
        assert!((Exposure::Auto.factor(&image) - 0.5).abs() < 1e-6);
        assert_eq!(Exposure::Factor(3.0).factor(&image), 3.0);
    }

    #[test]
    fn exposure_is_read_and_refused() {
        assert_eq!("auto".parse(), Ok(Exposure::Auto));
        assert_eq!("2.5".parse(), Ok(Exposure::Factor(2.5)));
        for bad in ["", "0", "-1", "nan", "inf", "Auto", "1,5"] {
            assert!(bad.parse::<Exposure>().is_err(), "{bad}");
        }
    }

    #[test]
    fn codes_are_srgb_and_clip_at_white() {
        let shown = |value: f32| {
            let image = LinearImage {
                width: 1,
                height: 1,
                pixels: vec![[value, value, value, 1.0]],
            };
            to_pixmap(&image, 1.0, [9, 9, 9]).unwrap().data()[0]
        };
        assert_eq!(shown(0.0), 0);
        assert_eq!(shown(0.214_041_14), 128); // IEC 61966-2-1: 128 / 255 decodes to this
        assert_eq!(shown(1.0), 255);
        assert_eq!(shown(1e9), 255);
        assert_eq!(shown(f32::INFINITY), 255);
        assert_eq!(shown(f32::NAN), 0);
    }

    #[test]
    fn every_opaque_code_survives_the_compositor() {
        let pixels: Vec<_> = (0..256)
            .map(|code: u32| {
                let linear = tone::srgb_decode(code as f32 / 255.0);
                [linear, linear, linear, 1.0]
            })
            .collect();
        let image = LinearImage {
            width: 256,
            height: 1,
            pixels,
        };
        let picture = to_pixmap(&image, 1.0, [255, 0, 255]).unwrap();
        for (code, pixel) in (0..=255).zip(picture.pixels()) {
            assert_eq!([pixel.red(), pixel.green(), pixel.blue()], [code; 3]);
        }
    }

    #[test]
    fn coverage_mixes_with_the_background() {
        let image = LinearImage {
            width: 3,
            height: 1,
            pixels: vec![[0.0; 4], [0.5, 0.5, 0.5, 0.5], [1.0, 1.0, 1.0, 1.0]],
        };
        let picture = to_pixmap(&image, 1.0, [100, 0, 200]).unwrap();
        let [a, b, c] = [0, 1, 2].map(|x| picture.pixel(x, 0).unwrap());
        assert_eq!([a.red(), a.green(), a.blue()], [100, 0, 200]);
        assert_eq!([c.red(), c.green(), c.blue()], [255, 255, 255]);
        for (got, want) in [(b.red(), 177.5), (b.green(), 127.5), (b.blue(), 227.5)] {
            assert!((f32::from(got) - want).abs() <= 1.0, "{got} {want}");
        }
    }

    #[test]
    fn impossible_sizes_are_errors() {
        for (width, height) in [(0, 5), (5, 0)] {
            let image = LinearImage::empty(width, height);
            assert!(to_pixmap(&image, 1.0, [0; 3]).is_err());
        }
    }

    #[test]
    fn a_png_reads_back() {
        let image = LinearImage {
            width: 2,
            height: 1,
            pixels: vec![[1.0, 0.0, 0.0, 1.0], [0.0; 4]],
        };
        let picture = to_pixmap(&image, 1.0, [1, 2, 3]).unwrap();
        let bytes = encode_png(&picture).unwrap();
        assert_eq!(bytes, encode_png(&picture).unwrap());
        assert_eq!(Pixmap::decode_png(&bytes).unwrap(), picture);
    }
}
