//! A board without an operating system: its clock of instructions, its way out, its stack.
//!
//! Under `-icount shift=10` the emulator's virtual time is 1.024 us per instruction, so a hardware timer counts
//! instructions. What is said goes out by semihosting, character by character and without formatting, because no panic
//! may be left in an image: [`panic`] calls a function that does not exist, and only an image that
//! cannot panic links.

#![no_std]

#[cfg(target_os = "none")]
mod board;
#[cfg(target_os = "none")]
pub mod kernels;
#[cfg(target_os = "none")]
mod measure;

#[cfg(feature = "draw")]
pub mod drawn;
pub mod room;

#[cfg(target_os = "none")]
pub use board::{exit, instructions, say};
#[cfg(target_os = "none")]
#[cfg(all(target_os = "none", not(small)))]
pub use measure::long_count;
#[cfg(target_os = "none")]
pub use measure::{
    Hash, Lent, count, count_with_pauses, hash, hash_bytes, largest_stack, paint_stack,
};
