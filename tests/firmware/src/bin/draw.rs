//! Relight and draw: the paper's room on a display in memory.

#![no_std]
#![no_main]

use cortex_m_rt::entry;
use firmware::drawn::{Memory, Screen, draw};
use firmware::{Lent, count, exit, hash_bytes, largest_stack, paint_stack, say};

static ATLAS: &[u8] = include_bytes!(concat!(env!("FIRMWARE_DATA"), "/drawn.atlas"));
static MEMORY: Lent<Memory> = Lent::new(Memory::new());
static SCREEN: Lent<Screen> = Lent::new(Screen::new());

#[entry]
fn main() -> ! {
    paint_stack();
    // SAFETY: once each.
    let (memory, screen) = unsafe { (MEMORY.lend(), SCREEN.lend()) };
    let frame = count(|| {
        if draw(ATLAS, memory, screen).is_none() {
            exit(1);
        }
    });
    say(c"per_frame", frame);
    say(c"hash", hash_bytes(screen.data().iter().copied()));
    say(c"stack", largest_stack());
    exit(0)
}
