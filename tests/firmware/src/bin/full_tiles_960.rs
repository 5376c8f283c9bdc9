//! `full_tiles_565` of 960 elements and 8 lights.

#![no_std]
#![no_main]

use cortex_m_rt::entry;
use firmware::Lent;
use firmware::kernels::{Input, run_any};
use relume::relight::FrameLight;

include!(concat!(env!("FIRMWARE_DATA"), "/tiles_960x8.rs"));

static ROOM: Lent<[FrameLight; 8]> = Lent::new([FrameLight::EMPTY; 8]);
static VALUES: Lent<[u16; LEVELS]> = Lent::new([0; LEVELS]);
static SUMS: Lent<[[u16; 3]; 960]> = Lent::new([[0; 3]; 960]);
static PIXELS: Lent<[u16; 960]> = Lent::new([0; 960]);

#[entry]
fn main() -> ! {
    // SAFETY: once.
    unsafe {
        run_any::<8>(
            &INPUT,
            ROOM.lend(),
            VALUES.lend(),
            SUMS.lend(),
            PIXELS.lend(),
        )
    }
}
