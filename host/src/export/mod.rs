//! Files for other programs.

pub mod exr;
