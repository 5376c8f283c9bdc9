//! `full_lum_565` of 1920 elements and 30 lights.

#![no_std]
#![no_main]

use cortex_m_rt::entry;
use firmware::Lent;
use firmware::kernels::{Input, run_full};
use relume::relight::{Form, FrameLight, Lum};

include!(concat!(env!("FIRMWARE_DATA"), "/lum_1920x30.rs"));

static ROOM: Lent<[FrameLight; 30]> = Lent::new([FrameLight::EMPTY; 30]);
static TABLES: Lent<[<Lum as Form>::Table; 30]> = Lent::new([Lum::EMPTY; 30]);
static PIXELS: Lent<[u16; 1920]> = Lent::new([0; 1920]);

#[entry]
fn main() -> ! {
    // SAFETY: once.
    unsafe { run_full::<Lum, 30>(&INPUT, ROOM.lend(), TABLES.lend(), PIXELS.lend()) }
}
