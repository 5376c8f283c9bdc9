//! From light to display: exposure, the sRGB transfer function, 8-bit and RGB565 pixels.
//!
//! Shown is radiance `L = (rho E + M) / pi`, multiplied by the exposure, clipped at 1 and encoded
//! with `v = 12.92 l` up to 0.0031308, `v = 1.055 l^(1/2.4) - 0.055` above (IEC 61966-2-1).

use core::f32::consts::FRAC_1_PI;

use crate::code::srgb_linear;
use crate::color::Rgb;
use crate::math;
use crate::relight::{Encode, STEPS};

/// Radiance of a diffuse surface, W/m2/sr, from its reflectance, its irradiance and its exitance
/// in W/m2.
#[must_use]
pub fn radiance(reflectance: Rgb, irradiance: Rgb, exitance: Rgb) -> Rgb {
    (reflectance * irradiance + exitance) * FRAC_1_PI
}

/// sRGB value in [0, 1] of a linear one; clips, and maps NaN to 0.
#[must_use]
pub fn srgb_encode(linear: f32) -> f32 {
    if linear >= 1.0 {
        1.0
    } else if linear > 0.003_130_8 {
        1.055 * math::pow(linear, 1.0 / 2.4) - 0.055
    } else {
        12.92 * linear.max(0.0)
    }
}

/// Linear value of an sRGB one in [0, 1].
#[must_use]
pub fn srgb_decode(encoded: f32) -> f32 {
    if encoded > 0.040_45 {
        math::pow((encoded + 0.055) / 1.055, 2.4)
    } else {
        encoded / 12.92
    }
}

/// A factor that turns radiance into display light, 1 being the brightest; above zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exposure(f32);

impl Exposure {
    /// Leaves values as they are.
    pub const ONE: Self = Self(1.0);

    /// A factor; `None` unless it is positive and finite.
    #[must_use]
    pub fn new(factor: f32) -> Option<Self> {
        (factor > 0.0 && factor.is_finite()).then_some(Self(factor))
    }

    /// The exposure that shows `white` as the brightest value; [`Self::ONE`] when it is dark.
    #[must_use]
    pub fn for_white(white: f32) -> Self {
        Self::new(white.recip()).unwrap_or(Self::ONE)
    }

    /// The factor.
    #[must_use]
    pub const fn factor(self) -> f32 {
        self.0
    }

    /// 8-bit sRGB pixel of a radiance.
    #[must_use]
    pub fn rgb888(self, radiance: Rgb) -> [u8; 3] {
        self.encoded(radiance, [255.0, 255.0, 255.0])
    }

    /// RGB565 pixel of a radiance: five, six and five bits of the sRGB value.
    #[must_use]
    pub fn rgb565(self, radiance: Rgb) -> u16 {
        let [r, g, b] = self.encoded(radiance, [31.0, 63.0, 31.0]).map(u16::from);
        r << 11 | g << 5 | b
    }

    fn encoded(self, radiance: Rgb, [r, g, b]: [f32; 3]) -> [u8; 3] {
        let steps = Rgb::new(r, g, b);
        let encoded = (radiance * self.0).map(srgb_encode);
        // Casts saturate; the values lie in [0, 255].
        (encoded * steps).to_array().map(|v| math::round(v) as u8)
    }
}

/// Linear steps to RGB565 by look-up, without floats: every step as its middle is encoded.
#[derive(Clone, Debug)]
#[repr(C)]
pub struct Rgb565Table {
    /// Of two steps each: a level of five bits is as wide as two of six.
    five: [u8; STEPS as usize / 2],
    six: [u8; STEPS as usize],
    white: u16,
}

impl Rgb565Table {
    /// The table in which white begins at a step, at least 1: what lies above it is white, too.
    #[must_use]
    pub const fn new(white: u16) -> Self {
        Self {
            five: encoded_steps(2, white, 31),
            six: encoded_steps(1, white, 63),
            white,
        }
    }
}

impl Encode for Rgb565Table {
    type Pixel = u16;

    const BITS: [u32; 3] = [10, 11, 10];

    fn white(&self) -> u16 {
        self.white
    }

    #[inline(always)]
    fn encode(&self, [r, g, b]: [u32; 3]) -> u16 {
        let g = step_of(&self.six, g) << 5;
        let r = step_of(&self.five, r) << 11;
        (g + r) + step_of(&self.five, b)
    }
}

/// Linear steps to three bytes of sRGB by look-up.
#[derive(Clone, Debug)]
pub struct Rgb888Table {
    white: u16,
    eight: [u8; STEPS as usize],
}

impl Rgb888Table {
    /// The table in which white begins at a step, at least 1.
    #[must_use]
    pub const fn new(white: u16) -> Self {
        Self {
            white,
            eight: encoded_steps(1, white, 255),
        }
    }
}

impl Encode for Rgb888Table {
    type Pixel = [u8; 3];

    const BITS: [u32; 3] = [11; 3];

    fn white(&self) -> u16 {
        self.white
    }

    #[inline(always)]
    fn encode(&self, steps: [u32; 3]) -> [u8; 3] {
        steps.map(|step| step_of(&self.eight, step) as u8)
    }
}

#[inline(always)]
fn step_of<const N: usize>(table: &[u8; N], step: u32) -> u16 {
    // Not reached by the kernels, whose steps have no more bits than they should.
    u16::from(table.get(step as usize).copied().unwrap_or(u8::MAX))
}

/// The sRGB value, in `[0, levels]`, of the middle of every so many steps.
const fn encoded_steps<const N: usize>(width: u64, white: u16, levels: u32) -> [u8; N] {
    let mut table = [0; N];
    let (mut rest, mut step, mut level) = (table.as_mut_slice(), width, 0);
    while let Some((entry, after)) = rest.split_first_mut() {
        // A level begins in the middle between it and the one below, in 2^-12 of 255 codes.
        while level < levels {
            let begin = srgb_linear((2 * level + 1) * (255 << 11) / levels) as u64;
            // `(step / 2) / white < begin / 2^31`
            if step << 31 < 2 * begin * white as u64 {
                break;
            }
            level += 1;
        }
        *entry = level as u8;
        (rest, step) = (after, step + 2 * width);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_has_its_known_values_and_inverts() {
        assert!((srgb_encode(0.214_041_14) - 0.5).abs() < 1e-6);
        assert_eq!((srgb_encode(0.0), srgb_encode(1.0)), (0.0, 1.0));
        assert_eq!((srgb_encode(-1.0), srgb_encode(f32::NAN)), (0.0, 0.0));
        for step in 0..=255 {
            let value = step as f32 / 255.0;
            let back = srgb_encode(srgb_decode(value));
            assert!((back - value).abs() < 1e-5, "{value} {back}");
        }
    }

    #[test]
    fn pixels_reach_both_ends() {
        let exposure = Exposure::for_white(2.0);
        assert_eq!(exposure.rgb888(Rgb::splat(2.0)), [255; 3]);
        assert_eq!(exposure.rgb888(Rgb::splat(1e9)), [255; 3]);
        assert_eq!(exposure.rgb565(Rgb::splat(2.0)), 0xffff);
        assert_eq!(exposure.rgb565(Rgb::BLACK), 0);
        assert_eq!(exposure.rgb565(Rgb::new(2.0, 0.0, 0.0)), 0xf800);
        assert_eq!(exposure.rgb565(Rgb::new(0.0, 0.0, 2.0)), 0x001f);
    }

    #[test]
    fn dark_scenes_keep_exposure_one() {
        assert_eq!(Exposure::for_white(0.0), Exposure::ONE);
        assert_eq!(Exposure::for_white(f32::NAN), Exposure::ONE);
        assert_eq!(Exposure::new(-1.0), None);
    }
}
