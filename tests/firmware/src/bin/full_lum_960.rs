//! `full_lum_565` of 960 elements and 8 lights.

#![no_std]
#![no_main]

use cortex_m_rt::entry;
use firmware::Lent;
use firmware::kernels::{Input, run_full};
use relume::relight::{Form, FrameLight, Lum};

include!(concat!(env!("FIRMWARE_DATA"), "/lum_960x8.rs"));

static ROOM: Lent<[FrameLight; 8]> = Lent::new([FrameLight::EMPTY; 8]);
static TABLES: Lent<[<Lum as Form>::Table; 8]> = Lent::new([Lum::EMPTY; 8]);
static PIXELS: Lent<[u16; 960]> = Lent::new([0; 960]);

#[entry]
fn main() -> ! {
    // SAFETY: once.
    unsafe { run_full::<Lum, 8>(&INPUT, ROOM.lend(), TABLES.lend(), PIXELS.lend()) }
}
