//! `change_rgb_565` of 960 elements and 8 lights.

#![no_std]
#![no_main]

use cortex_m_rt::entry;
use firmware::Lent;
use firmware::kernels::{Input, run_change};
use relume::relight::{Colour, Form, FrameLight};

include!(concat!(env!("FIRMWARE_DATA"), "/rgb_960x8.rs"));

static ROOM: Lent<[FrameLight; 8]> = Lent::new([FrameLight::EMPTY; 8]);
static SUMS: Lent<[[u16; 3]; 960]> = Lent::new([[0; 3]; 960]);
static TABLE: Lent<<Colour as Form>::Table> = Lent::new(Colour::EMPTY);
static PIXELS: Lent<[u16; 960]> = Lent::new([0; 960]);

#[entry]
fn main() -> ! {
    // SAFETY: once.
    unsafe {
        run_change::<Colour, 8>(
            &INPUT,
            ROOM.lend(),
            SUMS.lend(),
            TABLE.lend(),
            PIXELS.lend(),
        )
    }
}
