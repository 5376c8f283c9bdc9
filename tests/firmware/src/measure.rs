//! Counts instructions and the stack, and hashes what came out.

use core::cell::UnsafeCell;
use core::hint::black_box;

#[cfg(not(small))]
use crate::board::{SLOW_TICKS, slow_ticks, start_slow_timer};
use crate::board::{instructions, start_timer, ticks};

/// Instructions that `f` takes, without those of reading the timer.
pub fn count(f: impl FnOnce()) -> u32 {
    count_with_pauses(|_| f())
}

/// The same without what `f` does in pauses.
pub fn count_with_pauses(f: impl FnOnce(&mut Pauses)) -> u32 {
    start_timer();
    let before = ticks();
    black_box(());
    let empty = ticks();
    black_box(());
    let mut pauses = Pauses {
        ticks: 0,
        read: empty - before,
    };
    f(&mut pauses);
    black_box(());
    let after = ticks();
    instructions(after - empty - pauses.ticks) - instructions(pauses.read)
}

/// What is not counted.
pub struct Pauses {
    ticks: u32,
    /// Ticks of reading the timer.
    read: u32,
}

impl Pauses {
    /// Does something that is not counted.
    pub fn during(&mut self, f: impl FnOnce()) {
        let begin = ticks();
        f();
        self.ticks += ticks() - begin + self.read;
    }
}

/// Thousands of instructions that `f` takes, however many.
#[cfg(not(small))]
pub fn long_count(f: impl FnOnce()) -> u32 {
    start_slow_timer();
    let before = slow_ticks();
    f();
    (slow_ticks() - before) / SLOW_TICKS
}

/// FNV-1a, 32 bits, of the bytes of pixels, low byte first.
pub struct Hash(u32);

impl Hash {
    /// Of no pixels.
    pub const fn new() -> Self {
        Self(0x811c_9dc5)
    }

    /// Adds pixels.
    #[inline(never)]
    pub fn add(&mut self, pixels: &[u16]) {
        for pixel in pixels {
            for byte in [pixel & 0xff, pixel >> 8] {
                self.0 = (self.0 ^ u32::from(byte)).wrapping_mul(0x0100_0193);
            }
        }
    }

    /// Of all that were added.
    pub const fn sum(&self) -> u32 {
        self.0
    }
}

/// The hash of pixels.
#[inline(never)]
pub fn hash(pixels: &[u16]) -> u32 {
    let mut hash = Hash::new();
    hash.add(pixels);
    hash.sum()
}

/// FNV-1a, 32 bits.
pub fn hash_bytes(bytes: impl Iterator<Item = u8>) -> u32 {
    bytes.fold(0x811c_9dc5, |hash, byte| {
        (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193)
    })
}

/// Memory that is lent once.
#[repr(transparent)]
pub struct Lent<T>(UnsafeCell<T>);

// SAFETY: there is one thread, and `lend` is for one call each.
unsafe impl<T> Sync for Lent<T> {}

impl<T> Lent<T> {
    /// Memory with something in it.
    pub const fn new(value: T) -> Self {
        Self(UnsafeCell::new(value))
    }

    /// Lends it.
    ///
    /// # Safety
    /// Once.
    #[expect(clippy::mut_from_ref, reason = "that is what it is for")]
    pub unsafe fn lend(&'static self) -> &'static mut T {
        // SAFETY: the caller does so once.
        unsafe { &mut *self.0.get() }
    }
}

/// What an unused word of the stack holds.
const PAINT: u32 = 0x5ac3_96e1;

/// No further below the top than this is painted.
const PAINTED: usize = 64 << 10;

unsafe extern "C" {
    static mut __sheap: u32;
    static _stack_start: u32;
}

/// The bottom and the top of the part of the stack that is painted.
fn stack() -> (*mut u32, *const u32) {
    let (bottom, top) = (&raw mut __sheap, &raw const _stack_start);
    let lowest = (top as usize - PAINTED) as *mut u32;
    (
        if (bottom as usize) < lowest as usize {
            lowest
        } else {
            bottom
        },
        top,
    )
}

/// Paints what of the stack is free.
#[inline(never)]
pub fn paint_stack() {
    let (mut word, _) = stack();
    let mark = 0_u32;
    let end = (&raw const mark as usize - 64) as *mut u32;
    while word < end {
        // SAFETY: above all statics and below this function's frame.
        unsafe {
            word.write_volatile(PAINT);
            word = word.add(1);
        }
    }
}

/// Bytes of the stack that were in use at some time since it was painted.
pub fn largest_stack() -> u32 {
    let (mut word, top) = stack();
    // SAFETY: inside the stack.
    while word.cast_const() < top && unsafe { word.read_volatile() } == PAINT {
        word = unsafe { word.add(1) };
    }
    top as u32 - word as u32
}
