//! Files for other programs, and pictures from them.

pub mod exr;
pub mod firmware;
pub mod frame;
pub mod light_layers;
