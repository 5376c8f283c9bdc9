//! How far two relit states differ on a display, and the states in which they are compared.
//!
//! The exposure puts the exact state's white, the 98th percentile of its luminance over elements,
//! at 1; both states are clipped and sRGB-encoded to `255 srgb(E / white)`, kept as floats, and the
//! largest difference over elements and channels is the error, in *display codes* (DESIGN
//! section 7). Measured on irradiance, which is what is packed, and on what is shown, `M + rho E`.
//!
//! Packing is judged on [`Mixed`] states of all lights and on every light alone, in each [`Solo`]
//! colour; all are the same every time. *Achromatic* are those in which lights only dim, each at its own white.

use std::fmt;
use std::sync::LazyLock;

use relume::color::Rgb;
use relume::tone::{Exposure, srgb_encode};

use crate::noise;
use crate::picture::white;

/// Largest difference between two states, in display codes.
#[must_use]
pub fn max_codes(exact: &[Rgb], found: &[Rgb]) -> f32 {
    let values = || exact.iter().copied();
    max_codes_at(1.0, values(), found.iter().copied())
}

/// The same, with `brightness` times the exposure.
pub fn max_codes_at(
    brightness: f32,
    exact: impl Iterator<Item = Rgb> + Clone,
    found: impl Iterator<Item = Rgb>,
) -> f32 {
    let exposure = Exposure::for_white(white(exact.clone())).factor() * brightness;
    let table = &*DISPLAY;
    let mut worst = 0.0_f32;
    for (exact, found) in exact.zip(found) {
        let channels = exact.to_array().into_iter().zip(found.to_array());
        for (exact, found) in channels.filter(|(exact, found)| exact != found) {
            let codes = table.code(exact * exposure) - table.code(found * exposure);
            worst = worst.max(codes.abs());
        }
    }
    worst
}

/// `255 srgb(u)` of a value over white, clipped to [0, 255]; within 3e-4.
#[must_use]
pub fn shown_code(u: f32) -> f32 {
    DISPLAY.code(u)
}

/// `255 srgb(u)`, linear between 256 places an octave: within 3e-4.
struct DisplayTable(Vec<f32>);

static DISPLAY: LazyLock<DisplayTable> = LazyLock::new(DisplayTable::new);

impl DisplayTable {
    /// Below it sRGB is linear.
    const LOWEST: f32 = 1.0 / 512.0;

    /// Bits of a float below its place in the table.
    const BELOW: u32 = 15;

    fn new() -> Self {
        let (first, last) = (Self::LOWEST.to_bits(), 1.0_f32.to_bits());
        let places = (first..=last).step_by(1 << Self::BELOW);
        Self(
            places
                .map(|bits| 255.0 * srgb_encode(f32::from_bits(bits)))
                .collect(),
        )
    }

    fn code(&self, u: f32) -> f32 {
        if u >= 1.0 {
            return 255.0;
        }
        if u.is_nan() || u < Self::LOWEST {
            return 255.0 * 12.92 * u.max(0.0);
        }
        let bits = u.to_bits() - Self::LOWEST.to_bits();
        let place = (bits >> Self::BELOW) as usize;
        let rest = (bits & ((1 << Self::BELOW) - 1)) as f32 / (1 << Self::BELOW) as f32;
        self.0[place] + rest * (self.0[place + 1] - self.0[place])
    }
}

/// A state of all lights.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mixed {
    /// All at nominal emission.
    AllOn,
    /// The same, 16 times overexposed.
    Overexposed,
    /// All at 5 % of nominal emission, at the exposure of [`Self::AllOn`].
    Dimmed,
    /// Nominal emissions times random factors; by turns uniform in [0, 1], 0 or 1, and log-uniform over
    /// three decades.
    Dimming(u16),
    /// Random colours: every channel uniform in [0, 1] times the nominal strength.
    Coloured(u16),
}

impl Mixed {
    const DIMMINGS: u16 = 1000;
    const COLOURED: u16 = 300;

    /// All states, the three without chance first.
    pub fn all() -> impl Iterator<Item = Self> {
        [Self::AllOn, Self::Overexposed, Self::Dimmed]
            .into_iter()
            .chain((0..Self::DIMMINGS).map(Self::Dimming))
            .chain((0..Self::COLOURED).map(Self::Coloured))
    }

    /// The weight of a light.
    ///
    /// Of [`Self::Dimmed`] it is the nominal one, since [`Self::brightness`] does the same.
    #[must_use]
    pub fn weight(self, light: u32, nominal: Rgb) -> Rgb {
        let chance =
            |state: u16, number: u32| noise::unit(u64::from(state) << 32 | u64::from(number));
        match self {
            Self::AllOn | Self::Overexposed | Self::Dimmed => nominal,
            Self::Dimming(state) => {
                let chance = chance(state, light);
                let factor = match state % 3 {
                    0 => chance,
                    1 => chance.round(),
                    _ => (-3.0 * std::f32::consts::LN_10 * chance).exp(),
                };
                nominal * factor
            }
            Self::Coloured(state) => {
                let [r, g, b] = [0, 1, 2].map(|c| chance(Self::DIMMINGS + state, 3 * light + c));
                Rgb::new(r, g, b) * nominal.max_channel()
            }
        }
    }

    /// What the exposure is multiplied by.
    #[must_use]
    pub const fn brightness(self) -> f32 {
        match self {
            Self::AllOn | Self::Dimming(_) | Self::Coloured(_) => 1.0,
            Self::Overexposed => 16.0,
            Self::Dimmed => 0.05,
        }
    }

    /// Whether lights only dim, and the state is exposed for its own white.
    #[must_use]
    pub const fn is_achromatic(self) -> bool {
        matches!(self, Self::AllOn | Self::Dimming(_))
    }
}

impl fmt::Display for Mixed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::AllOn => f.write_str("all on"),
            Self::Overexposed => f.write_str("all on, 16 times overexposed"),
            Self::Dimmed => f.write_str("all on, dimmed to 5 %"),
            Self::Dimming(number) => write!(f, "dimming {number}"),
            Self::Coloured(number) => write!(f, "colours {number}"),
        }
    }
}

/// The colour of a light that is on alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Solo {
    /// Its nominal emission.
    Nominal,
    /// Red of its nominal strength, which is its largest channel.
    Red,
    /// Green of that strength.
    Green,
    /// Blue of that strength.
    Blue,
}

impl Solo {
    /// Every colour.
    pub const ALL: [Self; 4] = [Self::Nominal, Self::Red, Self::Green, Self::Blue];

    /// The weight of the light; one that is nominally dark shines white at strength 1.
    #[must_use]
    pub fn weight(self, nominal: Rgb) -> Rgb {
        let nominal = if nominal == Rgb::BLACK {
            Rgb::WHITE
        } else {
            nominal
        };
        let strength = nominal.max_channel();
        match self {
            Self::Nominal => nominal,
            Self::Red => Rgb::new(strength, 0.0, 0.0),
            Self::Green => Rgb::new(0.0, strength, 0.0),
            Self::Blue => Rgb::new(0.0, 0.0, strength),
        }
    }

    /// Whether the light is in its own colour.
    #[must_use]
    pub const fn is_achromatic(self) -> bool {
        matches!(self, Self::Nominal)
    }
}

impl fmt::Display for Solo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Nominal => "alone",
            Self::Red => "alone in red",
            Self::Green => "alone in green",
            Self::Blue => "alone in blue",
        })
    }
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
    fn the_table_is_the_transfer_function() {
        for step in 0..2_000_000 {
            let u = step as f32 * 0.7e-6;
            let (found, exact) = (DISPLAY.code(u), 255.0 * srgb_encode(u));
            assert!((found - exact).abs() < 3e-4, "{u}: {found} {exact}");
        }
        assert_eq!(DISPLAY.code(f32::NAN), 0.0);
        assert_eq!(DISPLAY.code(f32::INFINITY), 255.0);
    }

    #[test]
    fn states_are_those_that_the_issue_names() {
        let states: Vec<Mixed> = Mixed::all().collect();
        assert_eq!(states.len(), 3 + 1000 + 300);
        let nominal = Rgb::new(4.0, 2.0, 1.0);
        let mut factors = [const { Vec::new() }; 3];
        for state in states {
            let weight = state.weight(7, nominal);
            assert!(weight.is_legal() && weight.max_channel() <= 4.0);
            if let Mixed::Dimming(number) = state {
                assert!((weight.g * 2.0 - weight.r).abs() < 1e-6, "{state}");
                factors[usize::from(number % 3)].push(weight.b);
            }
        }
        let [uniform, switched, decades] = factors;
        let share = |values: &[f32], test: fn(f32) -> bool| {
            values.iter().filter(|v| test(**v)).count() as f32 / values.len() as f32
        };
        // Four standard errors of 333 draws of one half: 0.11.
        assert!((share(&uniform, |f| f < 0.5) - 0.5).abs() < 0.11);
        assert!(switched.iter().all(|f| *f == 0.0 || *f == 1.0));
        assert!((share(&switched, |f| f == 0.0) - 0.5).abs() < 0.11);
        assert!(decades.iter().all(|f| (0.999e-3..=1.0).contains(f)));
        assert!((share(&decades, |f| f < 0.031_6) - 0.5).abs() < 0.11);
    }

    #[test]
    fn a_light_that_is_nominally_dark_is_tried_all_the_same() {
        assert_eq!(Solo::Nominal.weight(Rgb::BLACK), Rgb::WHITE);
        assert_eq!(
            Solo::Blue.weight(Rgb::new(3.0, 1.0, 0.0)),
            Rgb::new(0.0, 0.0, 3.0)
        );
    }
}
