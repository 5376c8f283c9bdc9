//! The room panel: an evening's touches on a screen in memory, and the hash of what it shows after each.

#![no_std]
#![no_main]

use cortex_m_rt::entry;
use embedded_graphics::framebuffer::{Framebuffer, buffer_size};
use embedded_graphics::pixelcolor::Rgb565;
use embedded_graphics::pixelcolor::raw::{LittleEndian, RawU16};
use firmware::{Lent, count, exit, largest_stack, paint_stack, say};
use relume::atlas::Atlas;
use relume_panel::{EVENING, Memory, Panel};

type Screen =
    Framebuffer<Rgb565, RawU16, LittleEndian, 320, 240, { buffer_size::<Rgb565>(320, 240) }>;

static ATLAS: &[u8] = include_bytes!(concat!(env!("FIRMWARE_DATA"), "/panel.atlas"));
static MEMORY: Lent<Memory> = Lent::new(Memory::new());
static SCREEN: Lent<Screen> = Lent::new(Screen::new());

/// FNV-1a, 32 bits.
fn hash(bytes: &[u8]) -> u32 {
    let step = |hash: u32, byte: &u8| (hash ^ u32::from(*byte)).wrapping_mul(0x0100_0193);
    bytes.iter().fold(0x811c_9dc5, step)
}

#[entry]
fn main() -> ! {
    // SAFETY: once each.
    let (memory, screen) = unsafe { (MEMORY.lend(), SCREEN.lend()) };
    paint_stack();
    let atlas = Atlas::parse(ATLAS).ok();
    let Some(Ok(mut panel)) = atlas.map(|atlas| Panel::new(atlas, memory)) else {
        exit(1)
    };
    let Ok(()) = panel.draw(screen);
    say(c"hash", hash(screen.data()));
    for touch in EVENING {
        panel.touch(touch);
        while panel.tick() == Ok(true) {}
        let Ok(()) = panel.draw(screen);
        say(c"hash", hash(screen.data()));
    }
    let [first, ..] = EVENING;
    panel.touch(first);
    let relit = count(|| {
        if panel.tick() != Ok(true) {
            exit(1);
        }
    });
    let drawn = count(|| {
        let Ok(()) = panel.draw(screen);
    });
    say(c"relit", relit);
    say(c"drawn", drawn);
    say(c"stack", largest_stack());
    exit(0)
}
