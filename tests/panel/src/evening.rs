//! An evening's touches, for pictures and tests.

use embedded_graphics::geometry::Point;

use crate::Touch;
use crate::layout::{level_place, slider};

/// Lamps are turned on and dimmed, room by room; at last the bedside lamp goes off.
pub const EVENING: [Touch; 8] = [
    Touch::Tap(Point::new(31, 51)),
    Touch::Tap(slider(2).top_left),
    Touch::Drag(level_place(3, 70)),
    Touch::Tap(slider(4).top_left),
    Touch::Drag(level_place(0, 65)),
    Touch::Tap(slider(5).top_left),
    Touch::Drag(level_place(2, 35)),
    Touch::Tap(Point::new(291, 67)),
];
