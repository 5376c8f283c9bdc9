//! From light to display: exposure, the sRGB transfer function, 8-bit and RGB565 pixels.
//!
//! Shown is radiance `L = (rho E + M) / pi`, multiplied by the exposure, clipped at 1 and encoded
//! with `v = 12.92 l` up to 0.0031308, `v = 1.055 l^(1/2.4) - 0.055` above (IEC 61966-2-1).

use core::f32::consts::FRAC_1_PI;

use crate::color::Rgb;
use crate::math;

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
