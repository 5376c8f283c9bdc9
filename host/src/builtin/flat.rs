//! A flat of three rooms in a row, as a smart-home panel shows it: six lamps and the dusk outside.
//!
//! The project's own. `x` runs along the flat, `z` from the windows towards the viewer. Walls, ceilings and floors
//! reflect inwards only, so that one looks through the front and the ceiling from outside; furniture reflects
//! outwards. A doorway joins the living room and the kitchen, so light of either spills into the other.

use glam::Vec3;
use relume::color::Rgb;
use relume::draw::Camera;
use relume::mesh::Spacing;

use super::{Builder, Builtin, BuiltinError, cuboid, reversed};

/// Depth and height of all rooms in m.
const DEPTH: f32 = 3.8;
const HEIGHT: f32 = 2.5;

/// Where each room begins and ends along `x`: living room, kitchen, bedroom.
const LIVING: (f32, f32) = (0.0, 4.3);
const KITCHEN: (f32, f32) = (4.45, 7.35);
const BEDROOM: (f32, f32) = (7.5, 10.7);

/// The doorway between living room and kitchen, along `z`, and its height.
const DOOR: (f32, f32) = (2.2, 3.2);
const DOOR_HEIGHT: f32 = 2.05;

const WALL: Rgb = Rgb::new(0.72, 0.70, 0.66);
const WARM_WALL: Rgb = Rgb::new(0.70, 0.60, 0.48);
const BLUE_WALL: Rgb = Rgb::new(0.36, 0.46, 0.55);
const CEILING: Rgb = Rgb::splat(0.82);
const OAK: Rgb = Rgb::new(0.46, 0.30, 0.17);
const TILES: Rgb = Rgb::new(0.50, 0.50, 0.47);
const CARPET: Rgb = Rgb::new(0.42, 0.38, 0.36);
const WALNUT: Rgb = Rgb::new(0.24, 0.13, 0.07);
const BIRCH: Rgb = Rgb::new(0.62, 0.50, 0.35);
const WHITE: Rgb = Rgb::splat(0.78);
const TEAL: Rgb = Rgb::new(0.07, 0.26, 0.27);
const RUG: Rgb = Rgb::new(0.55, 0.22, 0.14);
const LINEN: Rgb = Rgb::new(0.74, 0.71, 0.66);
const BLANKET: Rgb = Rgb::new(0.16, 0.22, 0.42);
const LEAF: Rgb = Rgb::new(0.08, 0.25, 0.07);
const CLAY: Rgb = Rgb::new(0.50, 0.22, 0.12);
const STONE: Rgb = Rgb::new(0.16, 0.16, 0.17);
const METAL: Rgb = Rgb::splat(0.30);
const SCREEN: Rgb = Rgb::splat(0.03);

/// Names of the lights and their nominal exitance in W/m2: warm white, neutral white, a violet strip, dusk.
const LIGHTS: [(&str, Rgb); 7] = [
    ("living ceiling", Rgb::new(17.0, 12.6, 7.6)),
    ("floor lamp", Rgb::new(22.0, 13.2, 5.4)),
    ("pendant", Rgb::new(26.0, 17.6, 9.2)),
    ("worktop", Rgb::new(60.0, 60.0, 56.0)),
    ("bedside", Rgb::new(34.0, 18.6, 6.6)),
    ("headboard", Rgb::new(15.0, 4.2, 30.0)),
    ("dusk", Rgb::new(0.62, 0.84, 1.5)),
];

/// Sides of a box, in the order of [`cuboid`].
const BOTTOM: usize = 0;
const TOP: usize = 1;

/// The flat, its lights in the order in which the panel lists them, and the dusk last.
///
/// # Errors
/// None in fact; the type is that of all built-in scenes.
pub fn flat() -> Result<Builtin, BuiltinError> {
    let mut flat = Flat(Builder::default());
    let [
        ceiling,
        floor_lamp,
        pendant,
        worktop,
        bedside,
        headboard,
        dusk,
    ] = LIGHTS.map(|(name, emission)| flat.0.light(name, emission));

    flat.rooms()?;
    for (left, right, low) in [(1.0, 3.3, 0.95), (5.5, 6.7, 1.5), (8.5, 9.7, 1.0)] {
        flat.window(left, right, low, dusk)?;
    }
    flat.living_room(ceiling, floor_lamp)?;
    flat.kitchen(pendant, worktop)?;
    flat.bedroom(bedside, headboard)?;

    Ok(Builtin {
        scene: flat.0.scene,
        spacing: Spacing {
            patch: 0.6,
            element: 0.15,
        },
        camera: Camera {
            eye: Vec3::new(5.35, 10.6, 15.0),
            target: Vec3::new(5.35, 1.1, 1.9),
            up: Vec3::Y,
            fov: 0.281,
        },
    })
}

/// The flat that is being furnished.
struct Flat(Builder);

impl Flat {
    fn rooms(&mut self) -> Result<(), BuiltinError> {
        let rooms = [
            (LIVING, OAK, WARM_WALL, [true, false]),
            (KITCHEN, TILES, WALL, [false, true]),
            (BEDROOM, CARPET, BLUE_WALL, [true, true]),
        ];
        for ((left, right), floor_color, back_color, is_closed) in rooms {
            let corners = (Vec3::new(left, 0.0, 0.0), Vec3::new(right, HEIGHT, DEPTH));
            let [floor, ceiling, low_x, high_x, back, front] =
                cuboid(corners.0, corners.1).map(reversed);
            self.0.surface(&floor, floor_color)?;
            self.0.surface(&ceiling, CEILING)?;
            self.0.surface(&back, back_color)?;
            self.0.surface(&front, WALL)?;
            for (side, is_closed) in [low_x, high_x].into_iter().zip(is_closed) {
                if is_closed {
                    self.0.surface(&side, WALL)?;
                }
            }
        }
        self.doorway()
    }

    /// The wall with the doorway, seen from both rooms, and the way through it.
    fn doorway(&mut self) -> Result<(), BuiltinError> {
        let parts = [
            (0.0, DOOR.0, 0.0, HEIGHT),
            (DOOR.1, DEPTH, 0.0, HEIGHT),
            (DOOR.0, DOOR.1, DOOR_HEIGHT, HEIGHT),
        ];
        for (from, to, low, high) in parts {
            let part = |x| {
                [(from, low), (from, high), (to, high), (to, low)].map(|(z, y)| Vec3::new(x, y, z))
            };
            self.0.surface(&reversed(part(LIVING.1)), WALL)?;
            self.0.surface(&part(KITCHEN.0), WALL)?;
        }
        let low = Vec3::new(LIVING.1, 0.0, DOOR.0);
        let high = Vec3::new(KITCHEN.0, DOOR_HEIGHT, DOOR.1);
        let [sill, lintel, _, _, far, near] = cuboid(low, high).map(reversed);
        self.0.surface(&sill, WALNUT)?;
        [lintel, far, near]
            .iter()
            .try_for_each(|side| self.0.surface(side, WHITE))
    }

    /// Panes that the dusk shines through, and their frame.
    fn window(&mut self, left: f32, right: f32, low: f32, dusk: u32) -> Result<(), BuiltinError> {
        let (high, middle, half) = (2.15, f32::midpoint(left, right), 0.03);
        let pane = upright(left, right, low, high, 0.01);
        self.0.lamp(&pane, Rgb::BLACK, dusk)?;
        let (front, back) = (0.06, 0.02);
        for x in [left, middle, right] {
            self.furniture([x - half, low, back], [x + half, high, front], WHITE)?;
        }
        for y in [low - half, high - half] {
            self.furniture([left, y, back], [right, y + 2.0 * half, front], WHITE)?;
        }
        Ok(())
    }

    fn living_room(&mut self, ceiling: u32, floor_lamp: u32) -> Result<(), BuiltinError> {
        self.lantern([1.85, 2.25, 1.75], [2.55, 2.37, 2.45], ceiling)?;
        self.furniture([0.75, 0.0, 0.9], [3.1, 0.012, 3.2], RUG)?;
        // A sofa along the left wall, its back to it.
        self.furniture([0.08, 0.0, 0.95], [0.95, 0.40, 3.05], TEAL)?;
        self.furniture([0.08, 0.40, 0.95], [0.32, 0.82, 3.05], TEAL)?;
        self.furniture([0.08, 0.40, 0.95], [0.95, 0.60, 1.15], TEAL)?;
        self.furniture([0.08, 0.40, 2.85], [0.95, 0.60, 3.05], TEAL)?;
        // A low table.
        self.furniture([1.45, 0.26, 1.45], [2.15, 0.34, 2.55], WALNUT)?;
        self.furniture([1.60, 0.012, 1.65], [2.0, 0.26, 2.35], WALNUT)?;
        // A sideboard under the window, with a screen, and a plant.
        self.furniture([1.2, 0.0, 0.06], [3.1, 0.48, 0.46], BIRCH)?;
        self.furniture([1.65, 0.52, 0.2], [2.65, 1.1, 0.25], SCREEN)?;
        self.furniture([3.62, 0.0, 0.32], [3.98, 0.38, 0.68], CLAY)?;
        self.furniture([3.5, 0.38, 0.2], [4.1, 0.75, 0.8], LEAF)?;
        self.furniture([3.6, 0.75, 0.3], [4.0, 1.15, 0.7], LEAF)?;
        // The floor lamp between sofa and window.
        self.furniture([0.35, 0.0, 0.35], [0.65, 0.03, 0.65], METAL)?;
        self.furniture([0.48, 0.03, 0.48], [0.52, 1.3, 0.52], METAL)?;
        self.lantern([0.32, 1.3, 0.32], [0.68, 1.68, 0.68], floor_lamp)
    }

    fn kitchen(&mut self, pendant: u32, worktop: u32) -> Result<(), BuiltinError> {
        let (left, right) = KITCHEN;
        self.furniture([left + 0.02, 0.0, 0.02], [right - 0.02, 0.86, 0.6], WHITE)?;
        self.furniture([left + 0.02, 0.86, 0.02], [right - 0.02, 0.9, 0.64], STONE)?;
        self.furniture([right - 0.66, 0.0, 0.64], [right - 0.02, 2.0, 1.28], METAL)?;
        // Wall cupboards, and the strip under them that lights the worktop.
        self.furniture([left + 0.02, 1.45, 0.02], [5.35, 2.1, 0.36], BIRCH)?;
        self.furniture([6.75, 1.45, 0.02], [right - 0.02, 2.1, 0.36], BIRCH)?;
        for (from, to) in [(left + 0.12, 5.25), (6.85, right - 0.12)] {
            let strip = cuboid(Vec3::new(from, 1.41, 0.22), Vec3::new(to, 1.45, 0.34));
            self.0.lamp(&strip[BOTTOM], Rgb::BLACK, worktop)?;
            self.0.lamp(&strip[5], Rgb::BLACK, worktop)?;
        }
        // A table with two benches.
        self.furniture([5.2, 0.68, 1.9], [6.5, 0.74, 2.8], BIRCH)?;
        self.furniture([5.75, 0.0, 2.2], [5.95, 0.68, 2.5], WALNUT)?;
        self.furniture([5.25, 0.0, 1.5], [6.45, 0.42, 1.8], WALNUT)?;
        self.furniture([5.25, 0.0, 2.95], [6.45, 0.42, 3.25], WALNUT)?;
        self.lantern([5.6, 1.62, 2.1], [6.1, 1.82, 2.6], pendant)
    }

    fn bedroom(&mut self, bedside: u32, headboard: u32) -> Result<(), BuiltinError> {
        // The bed, its head against the back wall.
        self.furniture([8.25, 0.0, 0.1], [10.0, 0.28, 2.3], WALNUT)?;
        self.furniture([8.3, 0.28, 0.14], [9.95, 0.5, 2.26], LINEN)?;
        self.furniture([8.28, 0.5, 0.95], [9.97, 0.54, 2.28], BLANKET)?;
        self.furniture([8.4, 0.5, 0.22], [9.05, 0.64, 0.66], WHITE)?;
        self.furniture([9.2, 0.5, 0.22], [9.85, 0.64, 0.66], WHITE)?;
        // The headboard, with a strip behind it that shines up the wall.
        self.furniture([8.1, 0.0, 0.06], [10.15, 0.9, 0.1], WALNUT)?;
        let strip = cuboid(Vec3::new(8.12, 0.9, 0.02), Vec3::new(10.13, 0.93, 0.1));
        for side in [TOP, 5] {
            self.0.lamp(&strip[side], Rgb::BLACK, headboard)?;
        }
        // A wardrobe, a bedside table and its lamp.
        self.furniture([10.1, 0.0, 2.2], [10.68, 2.1, 3.7], BIRCH)?;
        self.furniture([10.2, 0.0, 0.12], [10.64, 0.45, 0.6], BIRCH)?;
        self.furniture([10.39, 0.45, 0.33], [10.45, 0.6, 0.39], METAL)?;
        self.lantern([10.28, 0.6, 0.22], [10.56, 0.84, 0.50], bedside)
    }

    /// A box without a bottom.
    fn furniture(&mut self, low: [f32; 3], high: [f32; 3], color: Rgb) -> Result<(), BuiltinError> {
        let sides = cuboid(Vec3::from(low), Vec3::from(high));
        let mut seen = sides.iter().skip(TOP);
        seen.try_for_each(|side| self.0.surface(side, color))
    }

    /// A box that shines on all sides.
    fn lantern(&mut self, low: [f32; 3], high: [f32; 3], light: u32) -> Result<(), BuiltinError> {
        let sides = cuboid(Vec3::from(low), Vec3::from(high));
        sides
            .iter()
            .try_for_each(|side| self.0.lamp(side, Rgb::BLACK, light))
    }
}

/// A rectangle upright at `z`, its front towards the viewer.
fn upright(left: f32, right: f32, low: f32, high: f32, z: f32) -> [Vec3; 4] {
    [(left, low), (right, low), (right, high), (left, high)].map(|(x, y)| Vec3::new(x, y, z))
}
