//! Where everything is on the screen, and what a finger hits.

use embedded_graphics::geometry::{Point, Size};
use embedded_graphics::primitives::Rectangle;

use crate::SIZE;
use crate::lamp::{LAMPS, ROOMS};

/// The whole screen.
pub const SCREEN: Rectangle = Rectangle::new(Point::zero(), SIZE);

/// The picture of the flat.
pub const PICTURE: Rectangle = Rectangle::new(Point::new(0, 20), Size::new(320, 128));

/// Columns of rooms: the first one's left edge, and from one to the next.
pub(crate) const COLUMN: (i32, i32) = (4, 106);

/// Where names of rooms stand.
pub(crate) const NAMES_BASELINE: i32 = 165;

const SLIDER: Size = Size::new(100, 30);
const FIRST_SLIDER: i32 = 172;
const NEXT_SLIDER: i32 = 34;

/// How far from a lamp in the picture a tap still hits it, in pixels.
const REACH: i32 = 14;

/// The slider of a lamp.
#[must_use]
pub const fn slider(lamp: usize) -> Rectangle {
    let (room, row) = ((lamp / 2) as i32, (lamp % 2) as i32);
    let corner = Point::new(COLUMN.0 + COLUMN.1 * room, FIRST_SLIDER + NEXT_SLIDER * row);
    Rectangle::new(corner, SLIDER)
}

/// The lamp that a tap hits: by its slider, or nearest to it in the picture.
pub(crate) fn lamp_at(at: Point) -> Option<usize> {
    let by_slider = (0..LAMPS).find(|lamp| slider(*lamp).contains(at));
    let distance = |place: Point| (place - at).x.pow(2) + (place - at).y.pow(2);
    let in_picture = || {
        let fixtures = ROOMS.iter().flat_map(|room| &room.lamps);
        let reached = fixtures.enumerate().map(|(lamp, f)| (distance(f.at), lamp));
        let nearest = reached
            .filter(|(distance, _)| *distance <= REACH * REACH)
            .min();
        nearest.map(|(_, lamp)| lamp)
    };
    by_slider.or_else(in_picture)
}

/// The lamp whose slider is under a finger, and the level in per cent there.
pub(crate) fn level_at(at: Point) -> Option<(usize, u8)> {
    let lamp = (0..LAMPS).find(|lamp| slider(*lamp).contains(at))?;
    let along = at.x - slider(lamp).top_left.x;
    Some((lamp, (along * 100 / (SLIDER.width as i32 - 1)) as u8))
}

/// The place of a level in per cent on a slider.
pub(crate) const fn level_place(lamp: usize, level: i32) -> Point {
    let Rectangle { top_left, size } = slider(lamp);
    // Rounded up: whatever is cut off there, the level is found again.
    let along = (level * (size.width as i32 - 1) + 99) / 100;
    Point::new(top_left.x + along, top_left.y + size.height as i32 / 2)
}
