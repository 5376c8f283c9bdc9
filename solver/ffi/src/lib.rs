//! The C interface of Relume's relighting.
//!
//! Nothing is allocated: atlases are borrowed, and all memory is the caller's. Every function returns a
//! [`RelumeStatus`]; on any but `RELUME_STATUS_OK` nothing was written, unless its description says so.
//!
//! Rules for the caller, on whom all unsafe code here relies:
//!
//! * a pointer is null, which is refused, or valid for as many values as its length says, and aligned for
//!   its type; what is written to overlaps nothing else;
//! * the bytes of an atlas stay where they are, unchanged, as long as a [`RelumeAtlas`] or [`RelumeFrame`] made from
//!   them is used; the same holds for the memory of a frame, which nobody else touches;
//! * a [`RelumeAtlas`] or [`RelumeFrame`] is all zeros or was filled by this library; zeros are refused. Atlases may be
//!   copied; a frame is used in one place and by one thread at a time.

#![cfg_attr(any(target_os = "none", target_family = "wasm"), no_std)]
#![deny(
    clippy::indexing_slicing,
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic
)]
#![allow(
    clippy::missing_safety_doc,
    reason = "the rules above are those of every function"
)]

mod status;

mod atlas;

mod frame;

mod irradiance;

pub use atlas::{
    RelumeAtlas, RelumeInfo, RelumeLight, RelumeQuantity, RelumeRgb, relume_atlas_info,
    relume_atlas_light, relume_atlas_parse,
};
pub use frame::{
    RelumeFinish, RelumeFrame, RelumeLevels, RelumeRgb565Table, RelumeRgb888Table, RelumeRun,
    relume_frame_change, relume_frame_full, relume_frame_make, relume_frame_rgb565,
    relume_frame_rgb888, relume_rgb565, relume_rgb565_bright, relume_rgb888, relume_rgb888_bright,
};
pub use irradiance::{RELUME_LIGHT_WORDS, relume_irradiance};
pub use status::RelumeStatus;

#[cfg(any(target_os = "none", target_family = "wasm"))]
mod panic {
    use core::panic::PanicInfo;

    unsafe extern "C" {
        /// Called where the library could not go on. Nothing in an optimised library does, so whoever links
        /// one need not have it.
        safe fn relume_panic() -> !;
    }

    #[panic_handler]
    fn panic(_: &PanicInfo) -> ! {
        relume_panic()
    }
}
