//! Everything around the picture: the status bar, names of rooms, and a slider for every lamp.

use embedded_graphics::draw_target::DrawTarget;
use embedded_graphics::geometry::{Point, Size};
use embedded_graphics::mono_font::ascii::{FONT_6X12, FONT_7X13_BOLD};
use embedded_graphics::mono_font::{MonoFont, MonoTextStyle};
use embedded_graphics::pixelcolor::Rgb565;
use embedded_graphics::prelude::*;
use embedded_graphics::primitives::{Circle, PrimitiveStyle, Rectangle, RoundedRectangle};
use embedded_graphics::text::{Alignment, Text};

use crate::lamp::{Fixture, LAMPS, Lamp, ROOMS};
use crate::layout::{COLUMN, NAMES_BASELINE, PICTURE, SCREEN, slider};

const BACKGROUND: Rgb565 = Rgb565::BLACK;
const TRACK: Rgb565 = Rgb565::new(4, 9, 5);
const BRIGHT: Rgb565 = Rgb565::new(30, 60, 30);
const FAINT: Rgb565 = Rgb565::new(18, 37, 19);

/// Radius of the corners of a slider.
const ROUND: Size = Size::new(8, 8);

pub(crate) fn draw<D: DrawTarget<Color = Rgb565>>(
    display: &mut D,
    lamps: &[Lamp; LAMPS],
) -> Result<(), D::Error> {
    let below = PICTURE.top_left.y + PICTURE.size.height as i32;
    for (top, bottom) in [(0, PICTURE.top_left.y), (below, SCREEN.size.height as i32)] {
        let height = (bottom - top) as u32;
        let bar = Rectangle::new(Point::new(0, top), Size::new(SCREEN.size.width, height));
        display.fill_solid(&bar, BACKGROUND)?;
    }
    status(display, lamps)?;
    for (room, left) in ROOMS.iter().zip((COLUMN.0..).step_by(COLUMN.1 as usize)) {
        let at = Point::new(left + 2, NAMES_BASELINE);
        write(
            display,
            room.name,
            at,
            Alignment::Left,
            &FONT_7X13_BOLD,
            BRIGHT,
        )?;
    }
    let fixtures = ROOMS.iter().flat_map(|room| &room.lamps);
    for ((fixture, lamp), number) in fixtures.zip(lamps).zip(0..) {
        draw_slider(display, fixture, lamp, slider(number))?;
    }
    Ok(())
}

/// What is on, in words.
fn status<D: DrawTarget<Color = Rgb565>>(
    display: &mut D,
    lamps: &[Lamp; LAMPS],
) -> Result<(), D::Error> {
    const ON: [&str; LAMPS + 1] = [
        "all off",
        "1 lamp on",
        "2 lamps on",
        "3 lamps on",
        "4 lamps on",
        "5 lamps on",
        "all on",
    ];
    let count = lamps.iter().filter(|lamp| lamp.is_on()).count();
    let on = ON.get(count).copied().unwrap_or_default();
    write(
        display,
        "Home",
        Point::new(6, 14),
        Alignment::Left,
        &FONT_7X13_BOLD,
        BRIGHT,
    )?;
    write(
        display,
        on,
        Point::new(314, 14),
        Alignment::Right,
        &FONT_6X12,
        FAINT,
    )
}

/// A track that is filled up to the level, with the lamp's sign, name and level on it.
fn draw_slider<D: DrawTarget<Color = Rgb565>>(
    display: &mut D,
    fixture: &Fixture,
    lamp: &Lamp,
    place: Rectangle,
) -> Result<(), D::Error> {
    let track = RoundedRectangle::with_equal_corners(place, ROUND);
    track
        .into_styled(PrimitiveStyle::with_fill(TRACK))
        .draw(display)?;
    let length = place.size.width * u32::from(lamp.shown()) / 100;
    let filled = Rectangle::new(place.top_left, Size::new(length, place.size.height));
    let fill = PrimitiveStyle::with_fill(dimmed(fixture.tint));
    track
        .into_styled(fill)
        .draw(&mut display.clipped(&filled))?;

    let middle = place.top_left + Point::new(14, place.size.height as i32 / 2);
    let sign = if lamp.is_on() {
        PrimitiveStyle::with_fill(fixture.tint)
    } else {
        PrimitiveStyle::with_stroke(FAINT, 1)
    };
    Circle::with_center(middle, 11)
        .into_styled(sign)
        .draw(display)?;

    let color = if lamp.is_on() { BRIGHT } else { FAINT };
    let name = place.top_left + Point::new(25, 18);
    write(
        display,
        fixture.name,
        name,
        Alignment::Left,
        &FONT_6X12,
        color,
    )
}

/// The tint as the ground of bright letters.
fn dimmed(tint: Rgb565) -> Rgb565 {
    let dim = |part: u8| (u16::from(part) * 3 / 8) as u8;
    Rgb565::new(dim(tint.r()), dim(tint.g()), dim(tint.b()))
}

fn write<D: DrawTarget<Color = Rgb565>>(
    display: &mut D,
    text: &str,
    at: Point,
    alignment: Alignment,
    font: &MonoFont,
    color: Rgb565,
) -> Result<(), D::Error> {
    let style = MonoTextStyle::new(font, color);
    Text::with_alignment(text, at, style, alignment).draw(display)?;
    Ok(())
}
