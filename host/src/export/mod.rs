//! Files for other programs.

pub mod exr;
pub mod firmware;
