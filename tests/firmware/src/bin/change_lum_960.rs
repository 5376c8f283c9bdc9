//! `change_lum_565` of 960 elements and 8 lights, fitted by the host; the display is sent strips.

#![no_std]
#![no_main]

use cortex_m_rt::entry;
use firmware::Lent;
use firmware::kernels::run_change_fitted;
use relume::relight::{Form, FrameLight, Lum};

include!(concat!(env!("FIRMWARE_DATA"), "/lum_960x8_fitted.rs"));

static ROOM: Lent<[FrameLight; 8]> = Lent::new([FrameLight::EMPTY; 8]);
static SUMS: Lent<[u32; 960]> = Lent::new([0; 960]);
static TABLE: Lent<<Lum as Form>::Table> = Lent::new(Lum::EMPTY);
static STRIP: Lent<[u16; 288]> = Lent::new([0; 288]);

#[entry]
fn main() -> ! {
    // SAFETY: once.
    unsafe { run_change_fitted::<8>(&INPUT, ROOM.lend(), SUMS.lend(), TABLE.lend(), STRIP.lend()) }
}
