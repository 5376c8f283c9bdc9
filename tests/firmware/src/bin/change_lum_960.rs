//! `change_lum_565` of 960 elements and 8 lights.

#![no_std]
#![no_main]

use cortex_m_rt::entry;
use firmware::Lent;
use firmware::kernels::{Input, run_change};
use relume::relight::{Form, FrameLight, Lum};

include!(concat!(env!("FIRMWARE_DATA"), "/lum_960x8.rs"));

static ROOM: Lent<[FrameLight; 8]> = Lent::new([FrameLight::EMPTY; 8]);
static SUMS: Lent<[u32; 960]> = Lent::new([0; 960]);
static TABLE: Lent<<Lum as Form>::Table> = Lent::new(Lum::EMPTY);
static PIXELS: Lent<[u16; 960]> = Lent::new([0; 960]);

#[entry]
fn main() -> ! {
    // SAFETY: once.
    unsafe {
        run_change::<Lum, 8>(
            &INPUT,
            ROOM.lend(),
            SUMS.lend(),
            TABLE.lend(),
            PIXELS.lend(),
        )
    }
}
