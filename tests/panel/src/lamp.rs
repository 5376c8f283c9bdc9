//! Lamps: what they are called, where they hang, and how bright they are.

use embedded_graphics::geometry::Point;
use embedded_graphics::pixelcolor::Rgb565;

/// Number of lamps.
pub const LAMPS: usize = 6;

/// What the panel knows of a lamp from the start.
#[derive(Clone, Copy, Debug)]
pub struct Fixture {
    /// Its name.
    pub name: &'static str,
    /// Where it is seen on the screen.
    pub at: Point,
    /// Its colour on the screen.
    pub tint: Rgb565,
}

/// A room and its lamps, in the order of the lights of the atlas.
#[derive(Clone, Copy, Debug)]
pub struct Room {
    /// Its name.
    pub name: &'static str,
    /// Its lamps.
    pub lamps: [Fixture; 2],
}

const fn fixture(name: &'static str, at: Point, [r, g, b]: [u8; 3]) -> Fixture {
    Fixture {
        name,
        at,
        tint: Rgb565::new(r >> 3, g >> 2, b >> 3),
    }
}

/// The rooms, from left to right.
pub const ROOMS: [Room; 3] = [
    Room {
        name: "Living room",
        lamps: [
            fixture("Ceiling", Point::new(67, 58), [255, 206, 128]),
            fixture("Floor lamp", Point::new(32, 53), [255, 178, 84]),
        ],
    },
    Room {
        name: "Kitchen",
        lamps: [
            fixture("Pendant", Point::new(175, 77), [255, 194, 110]),
            fixture("Worktop", Point::new(148, 53), [214, 226, 255]),
        ],
    },
    Room {
        name: "Bedroom",
        lamps: [
            fixture("Bedside", Point::new(290, 68), [255, 166, 72]),
            fixture("Headboard", Point::new(256, 60), [172, 110, 255]),
        ],
    },
];

/// The state of a lamp.
#[derive(Clone, Copy, Debug)]
pub struct Lamp {
    is_on: bool,
    /// What it is dimmed to, in per cent, also while it is off.
    level: u8,
    /// What it shines at: on its way to the level, or to 0.
    shown: u8,
}

/// Per cent of a step of a fade.
const FADE: u8 = 34;

impl Lamp {
    pub(crate) const OFF: Self = Self {
        is_on: false,
        level: 100,
        shown: 0,
    };

    /// Whether it is on.
    #[must_use]
    pub const fn is_on(&self) -> bool {
        self.is_on
    }

    /// What it shines at now, in per cent.
    #[must_use]
    pub const fn shown(&self) -> u8 {
        self.shown
    }

    pub(crate) const fn toggle(&mut self) {
        self.is_on = !self.is_on;
    }

    /// Dims it to a level in per cent; 0 turns it off.
    pub(crate) fn set(&mut self, level: u8) {
        self.is_on = level > 0;
        self.level = level.clamp(1, 100);
    }

    /// Goes a step towards where it has to be; true when it has moved.
    pub(crate) fn fade(&mut self) -> bool {
        let goal = if self.is_on { self.level } else { 0 };
        let before = self.shown;
        let (least, most) = (before.saturating_sub(FADE), before.saturating_add(FADE));
        self.shown = goal.max(least).min(most);
        self.shown != before
    }

    /// Weight of its light, in 2^-16. The eye is closer to a root than to the light itself: half the level is a
    /// quarter of it.
    pub(crate) fn weight(&self) -> u16 {
        let shown = u32::from(self.shown);
        (shown * shown * u32::from(u16::MAX) / 10_000) as u16
    }
}
