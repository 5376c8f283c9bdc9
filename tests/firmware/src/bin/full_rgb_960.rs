//! `full_rgb_565` of 960 elements and 8 lights.

#![no_std]
#![no_main]

use cortex_m_rt::entry;
use firmware::Lent;
use firmware::kernels::{Input, run_full};
use relume::relight::Colour;

include!(concat!(env!("FIRMWARE_DATA"), "/rgb_960x8.rs"));

static TABLE: Lent<[[[u16; 8]; 256]; 3]> = Lent::new([[[0; 8]; 256]; 3]);
static PIXELS: Lent<[u16; 960]> = Lent::new([0; 960]);

#[entry]
fn main() -> ! {
    // SAFETY: once.
    unsafe { run_full::<Colour, 8, 8>(&INPUT, TABLE.lend(), PIXELS.lend()) }
}
