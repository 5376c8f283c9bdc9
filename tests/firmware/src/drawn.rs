//! The paper's room with three lights, relit in integers and painted on a display, the same on a device and here.

use core::f32::consts::PI;

use embedded_graphics::framebuffer::{Framebuffer, buffer_size};
use embedded_graphics::pixelcolor::Rgb565;
use embedded_graphics::pixelcolor::raw::{LittleEndian, RawU16};
use embedded_graphics::prelude::RgbColor;
use glam::Vec3;
use relume::atlas::Atlas;
use relume::color::Rgb;
use relume::draw::{Camera, Sample, Shown, paint};
use relume::relight::{Colour, Finish, Form, FrameLight, FrameMix, Run, fill_table, full};
use relume::tone::Rgb565Table;

const LIGHTS: usize = 3;
const ELEMENTS: usize = 960;
const SIDE: usize = 120;
/// Rows that are painted at once.
const ROWS: usize = 16;

/// Radiosity over pi times this is 1 at white.
const EXPOSURE: f32 = 150.0;

static TONE: Rgb565Table = Rgb565Table::new(512);

/// Radiosity has its reflectance in it.
static RUNS: [Run; 1] = [Run {
    elements: ELEMENTS as u32,
    reflectance: [u16::MAX; 3],
}];

/// A display in memory.
pub type Screen =
    Framebuffer<Rgb565, RawU16, LittleEndian, SIDE, SIDE, { buffer_size::<Rgb565>(SIDE, SIDE) }>;

/// What relighting and painting need.
pub struct Memory {
    lights: [FrameLight; LIGHTS],
    tables: [<Colour as Form>::Table; LIGHTS],
    pixels: [u16; ELEMENTS],
    band: [Sample<Rgb565>; SIDE * ROWS],
}

impl Memory {
    /// Empty memory.
    #[allow(clippy::new_without_default, reason = "it is for statics")]
    pub const fn new() -> Self {
        Self {
            lights: [FrameLight::EMPTY; LIGHTS],
            tables: [Colour::EMPTY; LIGHTS],
            pixels: [0; ELEMENTS],
            band: [Sample::new(Rgb565::BLACK); SIDE * ROWS],
        }
    }
}

/// Relights an atlas and paints it; `None` when it is another room.
pub fn draw(atlas: &[u8], memory: &mut Memory, screen: &mut Screen) -> Option<()> {
    let atlas = Atlas::parse(atlas).ok()?;
    let mesh = atlas.mesh()?;
    let mut mix = FrameMix::new(&atlas, &[Rgb::WHITE; LIGHTS], &mut memory.lights).ok()?;
    for (light, level) in [20_000, 65_535, 40_000].into_iter().enumerate() {
        mix.set(light as u32, [level, level / 2, level / 3]);
    }
    for (light, table) in (0..).zip(&mut memory.tables) {
        fill_table::<Colour>(&atlas, &mix, light, table).ok()?;
    }
    let finish = Finish::new(&atlas, &mix, &RUNS, EXPOSURE * PI, &TONE).ok()?;
    full::<Colour, LIGHTS, _>(&atlas, &memory.tables, &finish, &mut memory.pixels).ok()?;
    let camera = Camera {
        eye: Vec3::new(2.8, 2.2, 0.2),
        target: Vec3::new(1.1, 1.0, 1.8),
        up: Vec3::Y,
        fov: 1.2,
    };
    let pixels = &memory.pixels;
    let color = |shown| match shown {
        Shown::Element(number) => {
            let pixel = pixels.get(number as usize).copied();
            Rgb565::from(RawU16::from(pixel.unwrap_or_default()))
        }
        Shown::Lamp(_) => Rgb565::WHITE,
        Shown::Unlit => Rgb565::BLACK,
    };
    paint(
        screen,
        &mesh,
        &camera,
        Rgb565::MAGENTA,
        &mut memory.band,
        color,
    )
    .ok()
}
