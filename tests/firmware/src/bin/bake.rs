//! The bake itself: the paper's room with three lights, packed on the device.

#![no_std]
#![no_main]

use cortex_m_rt::entry;
use firmware::room::{Memory, POLYGONS, Polygon, bake};
use firmware::{Lent, exit, largest_stack, long_count, paint_stack, say};

static ROOM: [Polygon; POLYGONS] = include!(concat!(env!("FIRMWARE_DATA"), "/room.rs"));
static MEMORY: Lent<Memory> = Lent::new(Memory::new());
static FLASH: Lent<[u8; 9_000]> = Lent::new([0; 9_000]);

#[entry]
fn main() -> ! {
    paint_stack();
    // SAFETY: once each.
    let (memory, flash) = unsafe { (MEMORY.lend(), FLASH.lend()) };
    let mut baked = None;
    let thousands = long_count(|| baked = bake(&ROOM, memory, flash));
    let Some(baked) = baked else { exit(1) };
    let atlas = flash.get(..baked.length).unwrap_or_default();
    say(c"rows", baked.rows);
    say(c"contributions", baked.contributions);
    say(c"atlas", firmware::hash_bytes(atlas.iter().copied()));
    say(c"thousands", thousands);
    say(c"stack", largest_stack());
    exit(0)
}
