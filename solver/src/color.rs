//! Linear RGB, the quantity that light is computed in.
//!
//! Rec. 709 primaries, linear, no unit of its own: the name of a variable says whether it holds an
//! irradiance (W/m2), a radiosity (W/m2), a radiance (W/m2/sr), a reflectance or a weight.
//! Luminance: `Y = 0.2126 R + 0.7152 G + 0.0722 B` (ITU-R BT.709-6, item 3.2).

use core::ops::{Add, AddAssign, Mul, Sub};

/// A linear RGB triple.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rgb {
    /// Red.
    pub r: f32,
    /// Green.
    pub g: f32,
    /// Blue.
    pub b: f32,
}

impl Rgb {
    /// Zero in every channel.
    pub const BLACK: Self = Self::new(0.0, 0.0, 0.0);
    /// One in every channel.
    pub const WHITE: Self = Self::new(1.0, 1.0, 1.0);

    /// The triple `(r, g, b)`.
    #[must_use]
    pub const fn new(r: f32, g: f32, b: f32) -> Self {
        Self { r, g, b }
    }

    /// The same value in every channel.
    #[must_use]
    pub const fn splat(value: f32) -> Self {
        Self::new(value, value, value)
    }

    /// From `[r, g, b]`.
    #[must_use]
    pub const fn from_array([r, g, b]: [f32; 3]) -> Self {
        Self::new(r, g, b)
    }

    /// As `[r, g, b]`.
    #[must_use]
    pub const fn to_array(self) -> [f32; 3] {
        [self.r, self.g, self.b]
    }

    /// Relative luminance, weights of ITU-R BT.709-6.
    #[must_use]
    pub fn luminance(self) -> f32 {
        0.2126 * self.r + 0.7152 * self.g + 0.0722 * self.b
    }

    /// The largest channel.
    #[must_use]
    pub fn max_channel(self) -> f32 {
        self.r.max(self.g).max(self.b)
    }

    /// The mean of the three channels.
    #[must_use]
    pub fn mean_channel(self) -> f32 {
        (self.r + self.g + self.b) / 3.0
    }

    /// True when every channel is finite and not negative.
    #[must_use]
    pub fn is_legal(self) -> bool {
        // By their bits, so that a reader needs no float arithmetic: up to the largest float, or -0.
        let is_legal = |bits| bits < 0x7f80_0000 || bits == 0x8000_0000;
        self.to_array().iter().all(|c| is_legal(c.to_bits()))
    }

    /// Applies `f` to each channel.
    #[must_use]
    pub fn map(self, f: impl Fn(f32) -> f32) -> Self {
        Self::new(f(self.r), f(self.g), f(self.b))
    }

    /// Channel by channel, the larger of two.
    #[must_use]
    pub fn max(self, other: Self) -> Self {
        Self::new(
            self.r.max(other.r),
            self.g.max(other.g),
            self.b.max(other.b),
        )
    }
}

impl Add for Rgb {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self::new(self.r + other.r, self.g + other.g, self.b + other.b)
    }
}

impl AddAssign for Rgb {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Sub for Rgb {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self::new(self.r - other.r, self.g - other.g, self.b - other.b)
    }
}

impl Mul for Rgb {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        Self::new(self.r * other.r, self.g * other.g, self.b * other.b)
    }
}

impl Mul<f32> for Rgb {
    type Output = Self;
    fn mul(self, factor: f32) -> Self {
        self.map(|c| c * factor)
    }
}

/// The fraction of the arriving light that a diffuse surface sends back, in [0, 1) per channel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reflectance(Rgb);

impl Reflectance {
    /// Absorbs everything.
    pub const BLACK: Self = Self(Rgb::BLACK);

    /// Checks that every channel lies in [0, 1); `None` otherwise (NaN included).
    #[must_use]
    pub fn new(value: Rgb) -> Option<Self> {
        let legal = value.to_array().iter().all(|c| (0.0..1.0).contains(c));
        legal.then_some(Self(value))
    }

    /// The triple itself.
    #[must_use]
    pub const fn get(self) -> Rgb {
        self.0
    }

    /// True when nothing is reflected: such a face stores no elements.
    #[must_use]
    pub fn is_black(self) -> bool {
        self.0 == Rgb::BLACK
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reflectance_refuses_one_negative_and_nan() {
        assert!(Reflectance::new(Rgb::splat(0.999)).is_some());
        for bad in [1.0, -0.001, f32::NAN, f32::INFINITY] {
            assert!(
                Reflectance::new(Rgb::new(0.5, bad, 0.5)).is_none(),
                "{bad} was accepted"
            );
        }
    }

    #[test]
    fn luminance_of_white_is_one() {
        assert!((Rgb::WHITE.luminance() - 1.0).abs() < 1e-6);
    }
}
