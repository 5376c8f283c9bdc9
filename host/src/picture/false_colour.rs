//! The difference of two pictures in false colours, with its scale.
//!
//! Per pixel `max over channels |code(a) - code(b)|`, in 8-bit sRGB code values before rounding
//! (`code = 255 srgb(min(exposure * L, 1))`, coverage over black). Colours are matplotlib's
//! `inferno` at eleven places, interpolated linearly: lightness rises evenly, so more is brighter
//! (Nathaniel Smith and Stefan van der Walt 2015, CC0).

use relume::color::Rgb;
use tiny_skia::{ColorU8, Pixmap, Rect, Transform};

use super::label::{Letters, write_label};
use super::sheet::{INK, PAPER, frame, ink};
use super::{LinearImage, PictureError, blank, display_code, filled, lay};

const INFERNO: [[u8; 3]; 11] = [
    [0, 0, 4],
    [22, 11, 57],
    [66, 10, 104],
    [106, 23, 110],
    [147, 38, 103],
    [188, 55, 84],
    [221, 81, 58],
    [243, 120, 25],
    [252, 165, 10],
    [246, 215, 70],
    [252, 255, 164],
];

/// Pixels between the parts.
const GAP: u32 = 12;
/// Width of the colour bar in pixels.
const BAR: u32 = 20;
/// Room for the bar's labels in pixels.
const TICKS: u32 = 56;
/// Parts into which ticks divide the bar.
const DIVISIONS: u32 = 5;

/// Colour of a value between 0 and 1; what lies outside gets the nearest end, NaN the upper one.
#[must_use]
pub fn inferno(value: f32) -> [u8; 3] {
    let inside = if value.is_nan() {
        1.0
    } else {
        value.clamp(0.0, 1.0)
    };
    let place = inside * (INFERNO.len() - 1) as f32;
    let below = (place as usize).min(INFERNO.len() - 2);
    let part = place - below as f32;
    let mix = |channel: usize| {
        let [low, high] = [below, below + 1].map(|i| f32::from(INFERNO[i][channel]));
        (low + (high - low) * part).round() as u8
    };
    [mix(0), mix(1), mix(2)]
}

/// Error of every pixel in display codes, row by row.
///
/// # Errors
/// [`PictureError::Mismatch`] when the sizes differ.
pub fn code_errors(
    a: &LinearImage,
    b: &LinearImage,
    exposure: f32,
) -> Result<Vec<f32>, PictureError> {
    if (a.width, a.height) != (b.width, b.height) {
        let size = |image: &LinearImage| format!("{}x{}", image.width, image.height);
        return Err(PictureError::Mismatch {
            first: size(a),
            second: size(b),
        });
    }
    let codes = |[r, g, b, _]: [f32; 4]| Rgb::new(r, g, b).map(|c| display_code(c, exposure));
    let pairs = a.pixels.iter().zip(&b.pixels);
    Ok(pairs
        .map(|(a, b)| (codes(*a) - codes(*b)).map(f32::abs).max_channel())
        .collect())
}

/// The smallest of 1, 2 or 5 times a power of ten that is not below `largest`; 1 for zero.
fn round_scale(largest: f32) -> f32 {
    if !(largest > 0.0 && largest.is_finite()) {
        return 1.0;
    }
    let power = 10_f32.powf(largest.log10().floor());
    let steps = [1.0, 2.0, 5.0, 10.0].map(|step| step * power);
    steps
        .into_iter()
        .find(|step| *step >= largest)
        .unwrap_or(10.0 * power)
}

/// A picture of where, and by how many display codes, `a` and `b` differ.
///
/// `full_scale` is the error in codes at the end of the colour bar, where larger ones stay; by
/// default the bar ends at a round number above the largest error.
///
/// # Errors
/// [`PictureError::Mismatch`] and [`PictureError::Size`].
pub fn error_map(
    a: &LinearImage,
    b: &LinearImage,
    exposure: f32,
    title: &str,
    full_scale: Option<f32>,
) -> Result<Pixmap, PictureError> {
    let errors = code_errors(a, b, exposure)?;
    let largest = errors.iter().copied().fold(0.0, f32::max);
    let scale = full_scale.unwrap_or_else(|| round_scale(largest));
    let mut map = blank(a.width, a.height)?;
    for (pixel, error) in map.pixels_mut().iter_mut().zip(&errors) {
        let [r, g, b] = inferno(error / scale);
        *pixel = ColorU8::from_rgba(r, g, b, 255).premultiply();
    }

    let top = 2 * GAP + Letters::Large.height();
    let wide = (a.width + BAR + TICKS + 3 * GAP).max(Letters::Large.width(title) + 2 * GAP);
    let mut paper = filled(wide, top + a.height + GAP, PAPER)?;
    write_label(
        &mut paper,
        (GAP as i32, GAP as i32),
        title,
        Letters::Large,
        INK,
    );
    lay(&mut paper, &map, GAP as i32, top as i32);
    frame(&mut paper, [GAP, top, a.width, a.height]);
    colour_bar(&mut paper, [2 * GAP + a.width, top, BAR, a.height], scale);
    Ok(paper)
}

/// Draws the scale from 0 (below) to `scale` (above), with its ticks on the right.
fn colour_bar(paper: &mut Pixmap, [x, y, width, height]: [u32; 4], scale: f32) {
    for row in 0..height {
        let value = 1.0 - (row as f32 + 0.5) / height as f32;
        let line = Rect::from_xywh(x as f32, (y + row) as f32, width as f32, 1.0);
        if let Some(line) = line {
            paper.fill_rect(line, &ink(inferno(value)), Transform::identity(), None);
        }
    }
    frame(paper, [x, y, width, height]);

    for tick in 0..=DIVISIONS {
        let part = tick as f32 / DIVISIONS as f32;
        let level = y as f32 + ((1.0 - part) * (height as f32 - 1.0)).round();
        if let Some(mark) = Rect::from_xywh((x + width) as f32, level, 4.0, 1.0) {
            paper.fill_rect(mark, &ink(INK), Transform::identity(), None);
        }
        let half = Letters::Small.height() as i32 / 2;
        let place = ((x + width + 7) as i32, level as i32 - half);
        write_label(paper, place, &number(part * scale), Letters::Small, INK);
    }
}

/// A number with at most three digits after the point and none too many.
fn number(value: f32) -> String {
    let text = format!("{value:.3}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(values: &[f32]) -> LinearImage {
        LinearImage {
            width: values.len() as u32,
            height: 1,
            pixels: values.iter().map(|v| [*v, 0.0, 0.0, 1.0]).collect(),
        }
    }

    #[test]
    fn the_map_grows_lighter_with_the_error() {
        let luma = |value| {
            let [r, g, b] = inferno(value).map(f32::from);
            Rgb::new(r, g, b).luminance()
        };
        for step in 0..100 {
            let value = step as f32 / 100.0;
            assert!(luma(value) < luma(value + 0.01), "{value}");
        }
        assert_eq!(inferno(-1.0), INFERNO[0]);
        assert_eq!(inferno(2.0), INFERNO[10]);
        assert_eq!(inferno(f32::NAN), INFERNO[10]);
    }

    #[test]
    fn errors_are_counted_in_display_codes() {
        let codes = code_errors(&image(&[0.0, 0.5, 1.0]), &image(&[1.0, 0.5, 9.0]), 1.0).unwrap();
        assert!((codes[0] - 255.0).abs() < 1e-3, "{codes:?}");
        assert_eq!(codes[1..], [0.0, 0.0]);
        assert!(code_errors(&image(&[0.0]), &image(&[0.0, 0.0]), 1.0).is_err());
    }

    #[test]
    fn the_scale_ends_at_a_round_number() {
        for (largest, scale) in [
            (0.0, 1.0),
            (0.3, 0.5),
            (1.0, 1.0),
            (1.1, 2.0),
            (37.0, 50.0),
            (255.0, 500.0),
        ] {
            let got = round_scale(largest);
            assert!((got / scale - 1.0).abs() < 1e-5, "{largest}: {got}");
        }
        assert_eq!(number(0.2), "0.2");
        assert_eq!(number(50.0), "50");
        assert_eq!(number(0.0), "0");
    }

    #[test]
    fn a_map_has_room_for_its_title() {
        let map = error_map(
            &image(&[0.0; 4]),
            &image(&[0.1; 4]),
            1.0,
            "a title of some length",
            None,
        );
        let map = map.unwrap();
        assert!(map.width() > Letters::Large.width("a title of some length"));
    }
}
