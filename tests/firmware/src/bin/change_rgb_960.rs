//! `change_rgb_565` of 960 elements and 8 lights.

#![no_std]
#![no_main]

use cortex_m_rt::entry;
use firmware::Lent;
use firmware::kernels::{Input, run_change};
use relume::relight::Colour;

include!(concat!(env!("FIRMWARE_DATA"), "/rgb_960x8.rs"));

static SUMS: Lent<[[u16; 3]; 960]> = Lent::new([[0; 3]; 960]);
static TABLE: Lent<[[[u16; 1]; 256]; 3]> = Lent::new([[[0; 1]; 256]; 3]);
static PIXELS: Lent<[u16; 960]> = Lent::new([0; 960]);

#[entry]
fn main() -> ! {
    // SAFETY: once.
    unsafe { run_change::<Colour, 8>(&INPUT, SUMS.lend(), TABLE.lend(), PIXELS.lend()) }
}
