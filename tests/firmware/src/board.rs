//! The emulated boards: mps2-an385 and mps2-an386, and the micro:bit where `small`.

use core::panic::PanicInfo;

use cortex_m_rt::{ExceptionFrame, exception};
use cortex_m_semihosting::syscall;

/// Semihosting operations.
const WRITE0: usize = 0x04;
const EXIT_EXTENDED: usize = 0x20;
const APPLICATION_EXIT: u32 = 0x20026;

/// Ends the emulator with a status: 0 is well, 1 a wrong result, 102 a fault.
pub fn exit(status: u32) -> ! {
    let block = [APPLICATION_EXIT, status];
    // SAFETY: the operation reads two words.
    unsafe { syscall(EXIT_EXTENDED, &block) };
    loop {}
}

/// Prints `name value`.
#[inline(never)]
pub fn say(name: &core::ffi::CStr, value: u32) {
    let mut digits = *b" 0x00000000\n\0";
    let places = digits.iter_mut().skip(3).take(8);
    for (place, shift) in places.zip((0..8).rev()) {
        let nibble = (value >> (4 * shift)) as u8 & 15;
        *place = nibble + if nibble < 10 { b'0' } else { b'a' - 10 };
    }
    for text in [name.as_ptr().cast::<u8>(), digits.as_ptr()] {
        // SAFETY: both texts end with a zero.
        unsafe { cortex_m_semihosting::syscall1(WRITE0, text as usize) };
    }
}

unsafe extern "C" {
    /// Exists nowhere: what can panic does not link.
    safe fn a_panic_path_is_left() -> !;
}

#[panic_handler]
fn panic(_: &PanicInfo) -> ! {
    a_panic_path_is_left()
}

#[exception]
unsafe fn HardFault(_: &ExceptionFrame) -> ! {
    exit(102)
}

#[exception]
unsafe fn DefaultHandler(_: i16) {
    exit(103)
}

/// Starts the timer.
#[cfg(not(small))]
pub fn start_timer() {
    // CMSDK timer 0: off, reload and value at their largest, on.
    write(0x4000_0000, 0);
    write(0x4000_0008, u32::MAX);
    write(0x4000_0004, u32::MAX);
    write(0x4000_0000, 1);
}

/// Ticks since the start.
#[cfg(not(small))]
pub fn ticks() -> u32 {
    u32::MAX - read(0x4000_0004)
}

/// Instructions of 1.024 us in a tick of 25 MHz.
#[cfg(not(small))]
const PER_TICK: (u32, u32) = (5, 7);

/// Starts the slow timer.
#[cfg(not(small))]
pub fn start_slow_timer() {
    // CMSDK dual timer: off, load; then on, free-running, a 256th of the clock, 32 bits.
    write(0x4000_2008, 0);
    write(0x4000_2000, u32::MAX);
    write(0x4000_2008, 0x8a);
}

/// Slow ticks since the start.
#[cfg(not(small))]
pub fn slow_ticks() -> u32 {
    u32::MAX - read(0x4000_2004)
}

/// Slow ticks in a thousand instructions of 1.024 us: 25 MHz / 256.
#[cfg(not(small))]
pub const SLOW_TICKS: u32 = 100;

/// Starts the timer.
#[cfg(small)]
pub fn start_timer() {
    // nRF51 timer 0: no prescaler, 32 bits, timer mode, cleared, on.
    write(0x4000_8510, 0);
    write(0x4000_8508, 3);
    write(0x4000_8504, 0);
    write(0x4000_800c, 1);
    write(0x4000_8000, 1);
}

/// Ticks since the start.
#[cfg(small)]
pub fn ticks() -> u32 {
    write(0x4000_8040, 1);
    read(0x4000_8540)
}

/// Instructions of 1.024 us in a tick of 16 MHz.
#[cfg(small)]
const PER_TICK: (u32, u32) = (125, 11);

/// Instructions in so many ticks.
#[inline(never)]
pub fn instructions(ticks: u32) -> u32 {
    // A factor over a power of two.
    let (factor, shift) = PER_TICK;
    let below = (1 << shift) - 1;
    (ticks >> shift) * factor + ((ticks & below) * factor >> shift)
}

fn write(register: usize, value: u32) {
    // SAFETY: a register of the board.
    unsafe { (register as *mut u32).write_volatile(value) };
}

fn read(register: usize) -> u32 {
    // SAFETY: a register of the board.
    unsafe { (register as *const u32).read_volatile() }
}
