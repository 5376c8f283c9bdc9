//! The measured Cornell box under its lamp.

#![no_std]
#![no_main]

use cortex_m_rt::entry;
use firmware::Lent;
use firmware::kernels::{Input, run_full};
use relume::relight::{Colour, Form, FrameLight};

include!(concat!(env!("FIRMWARE_DATA"), "/cornell.rs"));

static ROOM: Lent<[FrameLight; 1]> = Lent::new([FrameLight::EMPTY; 1]);
static TABLES: Lent<[<Colour as Form>::Table; 1]> = Lent::new([Colour::EMPTY; 1]);
static PIXELS: Lent<[u16; ELEMENTS]> = Lent::new([0; ELEMENTS]);

#[entry]
fn main() -> ! {
    // SAFETY: once.
    unsafe { run_full::<Colour, 1>(&INPUT, ROOM.lend(), TABLES.lend(), PIXELS.lend()) }
}
