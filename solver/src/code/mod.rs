//! Values and their codes: how a contribution becomes a few bits, and how far it may then be off.
//!
//! A [`Code`] is what a light of an atlas is packed in. Its [`Curve`], one per channel, is the map
//! between whole numbers and values; both are stored, so that an atlas says itself what it means.
//! `s` is a light's scale, `w` its white (what shows as white when it shines alone), `C` a
//! display code: a step of 8-bit sRGB after exposure of the white, continued as a logarithm above 255.
//!
//! | code | range of a light, largest to smallest | worst error | below it | cost of decoding |
//! | --- | --- | --- | --- | --- |
//! | `exp8` | 1:1410, one scale for all | 0.002 s to 0.69 s, all of it above 5.54 s | 0.002 s: dark | table of 256 |
//! | `exp8s` | 1:1410, largest value at the top | 0.002 s to 0.69 s | 0.002 s: dark | the same table |
//! | `lum8` | 1:1410 of luminance, largest at the top | as `exp8s`, and all colour | 0.002 s: dark | the same table, once for three channels |
//! | `display8` | smallest to largest value, any ratio | half a step: with equal ones `(C(largest) - C(smallest)) / 510` display codes | nothing, or half a step if a value is 0 | table of 256 per light and channel |
//! | `tiles` | any, steps of as many display codes as one wants | half a step | half a step: dark | bits, prediction, [`curve`](Curve) |
//! | `tiles-log` | all positive floats, 42 steps an octave | 0.826 % of the value | nothing | bits, prediction, [`curve`](Curve) |
//!
//! Exponential code: adjustable global illumination with per-light lightmaps, section 2.3; luminance
//! packing: the same, section 2.2.

mod curve;
mod exponential;
mod known;
mod scale;
mod tables;

use core::fmt;

pub use curve::{
    Curve, LARGEST_PART_FIRST, LARGEST_PART_UNIT, LOG_STEPS, Magnitude, PART_CODES, PART_STEPS,
    PARTS, display_code, srgb_linear,
};
pub use exponential::{
    DECODED, DECODED_BITS, LARGEST, SATURATED, decode, decode_fixed, encode, error_bound,
};
pub use known::{AllCodes, ExponentialCodes, Known};
pub use scale::Scale;

/// What the contributions of a light are written in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Code {
    /// Exponential as published: one scale for all lights.
    Exp8,
    /// Exponential with one scale per light, which puts its largest value on code 254.
    Exp8s,
    /// Display steps up to a white of each light and channel, logarithmic ones above; 32 parts have steps of their own.
    Display8,
    /// One exponential code for the luminance; the colour is that of the light alone.
    Lum8,
    /// Tiles of elements with as many bits as they need, in uniform display steps.
    Tiles,
    /// The same in logarithmic steps, with a proven relative error.
    TilesLog,
}

impl Code {
    /// Every code, in the order of their numbers in files.
    pub const ALL: [Self; 6] = [
        Self::Exp8,
        Self::Exp8s,
        Self::Display8,
        Self::Lum8,
        Self::Tiles,
        Self::TilesLog,
    ];

    /// The name on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Exp8 => "exp8",
            Self::Exp8s => "exp8s",
            Self::Display8 => "display8",
            Self::Lum8 => "lum8",
            Self::Tiles => "tiles",
            Self::TilesLog => "tiles-log",
        }
    }

    /// Whether its bits stand in tiles; else every element has [`Self::bytes`] of its own.
    #[must_use]
    pub const fn is_tiled(self) -> bool {
        matches!(self, Self::Tiles | Self::TilesLog)
    }

    /// Bytes per element and light; 0 for a code in tiles.
    #[must_use]
    pub const fn bytes(self) -> usize {
        match self {
            Self::Exp8 | Self::Exp8s | Self::Display8 => 3,
            Self::Lum8 => 1,
            Self::Tiles | Self::TilesLog => 0,
        }
    }
}

impl fmt::Display for Code {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}
