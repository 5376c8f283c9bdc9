//! Direct light with shadows in the room of the moving light.

#![no_std]
#![no_main]

use cortex_m_rt::entry;
use firmware::room::{DirectMemory, MOVING_POLYGONS, Polygon, direct};
use firmware::{Lent, exit, largest_stack, long_count, paint_stack, say};

static ROOM: [Polygon; MOVING_POLYGONS] = include!(concat!(env!("FIRMWARE_DATA"), "/moving.rs"));
static MEMORY: Lent<DirectMemory> = Lent::new(DirectMemory::new());

#[entry]
fn main() -> ! {
    paint_stack();
    // SAFETY: once.
    let memory = unsafe { MEMORY.lend() };
    let Some(found) = direct(&ROOM, memory, |row| long_count(row)) else {
        exit(1)
    };
    say(c"hash", found.hash);
    say(c"lit", found.lit);
    say(c"thousands", found.count);
    say(c"stack", largest_stack());
    exit(0)
}
