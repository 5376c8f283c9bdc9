//! How far two relit states differ on a display.
//!
//! The exposure puts the exact state's white, the 98th percentile of its luminance over elements,
//! at 1; both states are clipped and sRGB-encoded to `255 srgb(E / white)`, kept as floats, and the
//! largest difference over elements and channels is the error, in *display codes* (DESIGN
//! section 7). Measured on irradiance, which is what is packed, and on what is shown, `M + rho E`.

use relume::color::Rgb;
use relume::tone::{Exposure, srgb_encode};

use crate::noise;
use crate::picture::white;

/// Largest difference between two states, in display codes.
#[must_use]
pub fn max_codes(exact: &[Rgb], found: &[Rgb]) -> f32 {
    let exposure = Exposure::for_white(white(exact.iter().copied())).factor();
    let code = |value: Rgb| (value * exposure).map(|linear| 255.0 * srgb_encode(linear));
    exact
        .iter()
        .zip(found)
        .map(|(exact, found)| (code(*exact) - code(*found)).map(f32::abs).max_channel())
        .fold(0.0, f32::max)
}

/// A mix to be tried, with its name.
#[derive(Clone, Debug, PartialEq)]
pub struct TestMix {
    /// What it is, for people.
    pub name: String,
    /// The first light that may be on; those before it are off.
    pub first: usize,
    /// Weights of the lights from there on; those after them are off.
    pub weights: Vec<Rgb>,
}

/// Mixes on which packing is judged: all lights on, each alone, and 64 dimmings.
///
/// A third of the dimmings is uniform in [0, 1], a third on or off, a third log-uniform over three
/// decades; they are the same every time.
#[must_use]
pub fn test_mixes(nominal: &[Rgb], names: &[&str]) -> Vec<TestMix> {
    let all_on = TestMix {
        name: "all on".to_owned(),
        first: 0,
        weights: nominal.to_vec(),
    };
    let solos = names.iter().zip(nominal).enumerate();
    let solos = solos.map(|(light, (name, emission))| TestMix {
        name: format!("{name} alone"),
        first: light,
        weights: vec![*emission],
    });
    let dimmings = (0..64_u64).map(|state| {
        let weights = nominal.iter().zip(0_u64..).map(|(emission, light)| {
            let noise = noise::unit(state << 32 | light);
            *emission
                * match state % 3 {
                    0 => noise,
                    1 => noise.round(),
                    _ => 10.0_f32.powf(-3.0 * noise),
                }
        });
        TestMix {
            name: format!("dimming {state}"),
            first: 0,
            weights: weights.collect(),
        }
    });
    std::iter::once(all_on)
        .chain(solos)
        .chain(dimmings)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_display_code_at_white_is_one() {
        let exact = vec![Rgb::WHITE; 100];
        let mut found = exact.clone();
        found[3].g = relume::tone::srgb_decode(254.0 / 255.0);
        assert!((max_codes(&exact, &found) - 1.0).abs() < 1e-3);
        assert_eq!(max_codes(&exact, &exact), 0.0);
    }

    #[test]
    fn mixes_cover_all_solos_and_dimmings() {
        let mixes = test_mixes(&[Rgb::WHITE, Rgb::splat(2.0)], &["a", "b"]);
        assert_eq!(mixes.len(), 1 + 2 + 64);
        assert_eq!(
            (mixes[2].first, &*mixes[2].weights),
            (1, &[Rgb::splat(2.0)][..])
        );
        assert!(
            mixes
                .iter()
                .all(|mix| mix.weights.iter().all(|w| w.is_legal()))
        );
        assert_eq!(
            mixes,
            test_mixes(&[Rgb::WHITE, Rgb::splat(2.0)], &["a", "b"])
        );
    }
}
