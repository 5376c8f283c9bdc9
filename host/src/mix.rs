//! Mixes as users write them: `LIGHT=VALUE`.
//!
//! `0.5` is the nominal emission times 0.5; `#ffcc88` the nominal strength (its largest channel)
//! in that sRGB colour; `2x#ffcc88` twice that; `r,g,b` an absolute linear weight.

use std::str::FromStr;

use relume::color::Rgb;
use relume::tone::srgb_decode;
use thiserror::Error;

use crate::solution::SolutionLight;

/// One setting: a light's name and its value.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    /// Name of the light.
    pub light: String,
    /// What to set it to.
    pub value: Value,
}

/// The value of a setting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    /// Factor on the nominal emission.
    Factor(f32),
    /// Linear colour, times the nominal strength.
    Color(Rgb),
    /// Absolute weight.
    Absolute(Rgb),
}

impl FromStr for Setting {
    type Err = String;

    /// Reads `LIGHT=VALUE`; a name may contain `=`, a value does not.
    fn from_str(text: &str) -> Result<Self, String> {
        let (light, value) = text
            .rsplit_once('=')
            .ok_or_else(|| format!("`{text}` is not LIGHT=VALUE"))?;
        Ok(Self {
            light: light.to_owned(),
            value: value.parse()?,
        })
    }
}

impl FromStr for Value {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let illegal =
            || format!("`{text}` is none of: a factor (0.5), a colour (#ffcc88, 2x#ffcc88), r,g,b");
        let legal = |number: f32| number.is_finite() && number >= 0.0;
        let number = |text: &str| {
            text.trim()
                .parse()
                .ok()
                .filter(|n| legal(*n))
                .ok_or_else(illegal)
        };
        if let Some((factor, hex)) = text.split_once('#') {
            let factor = match factor.strip_suffix('x') {
                Some(factor) => number(factor)?,
                None if factor.is_empty() => 1.0,
                None => return Err(illegal()),
            };
            return Ok(Self::Color(color(hex).ok_or_else(illegal)? * factor));
        }
        let numbers = text
            .split(',')
            .map(number)
            .collect::<Result<Vec<f32>, _>>()?;
        match numbers[..] {
            [factor] => Ok(Self::Factor(factor)),
            [r, g, b] => Ok(Self::Absolute(Rgb::new(r, g, b))),
            _ => Err(illegal()),
        }
    }
}

/// Linear colour of six hexadecimal digits.
fn color(hex: &str) -> Option<Rgb> {
    if hex.len() != 6 || !hex.bytes().all(|byte| byte.is_ascii_hexdigit()) {
        return None;
    }
    let code = u32::from_str_radix(hex, 16).ok()?;
    let channel = |shift: u32| srgb_decode((code >> shift & 0xff) as f32 / 255.0);
    Some(Rgb::new(channel(16), channel(8), channel(0)))
}

impl Value {
    /// The weight that it means for a light.
    #[must_use]
    pub fn weight(self, emission: Rgb) -> Rgb {
        match self {
            Self::Factor(factor) => emission * factor,
            Self::Color(color) => color * emission.max_channel(),
            Self::Absolute(weight) => weight,
        }
    }
}

/// Largest weight of a light: far beyond any lamp, and its sums over lights stay finite.
const LARGEST_WEIGHT: f32 = 1e20;

/// Why settings make no mix.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum MixError {
    /// A setting names a light that is not there.
    #[error("there is no light `{}`; the lights are: {known}", .name.escape_debug())]
    UnknownLight {
        /// The name that was given.
        name: String,
        /// Some names that are there.
        known: String,
    },
    /// A light would be brighter than numbers can tell.
    #[error("light `{}`: a weight above 1e20 is more than can be shown; set it lower", .0.escape_debug())]
    TooBright(String),
}

/// The mix of some lights: nominal where nothing is said; with any `only`, dark where nothing is.
///
/// # Errors
/// [`MixError`].
pub fn mix(
    lights: &[SolutionLight],
    only: &[Setting],
    set: &[Setting],
) -> Result<Vec<Rgb>, MixError> {
    let mut mix: Vec<Rgb> = lights
        .iter()
        .map(|light| {
            if only.is_empty() {
                light.emission
            } else {
                Rgb::BLACK
            }
        })
        .collect();
    for setting in only.iter().chain(set) {
        let tag = find(lights, &setting.light)?;
        mix[tag] = setting.value.weight(lights[tag].emission);
        if mix[tag].max_channel() > LARGEST_WEIGHT {
            return Err(MixError::TooBright(setting.light.clone()));
        }
    }
    Ok(mix)
}

/// The tag of a light, by its name.
///
/// # Errors
/// [`MixError::UnknownLight`].
pub fn find(lights: &[SolutionLight], name: &str) -> Result<usize, MixError> {
    let tag = lights.iter().position(|light| light.name == name);
    tag.ok_or_else(|| MixError::UnknownLight {
        name: name.to_owned(),
        known: listed(lights),
    })
}

/// The first names, and how many more there are.
fn listed(lights: &[SolutionLight]) -> String {
    const SHOWN: usize = 12;
    let names = lights.iter().take(SHOWN);
    let names: Vec<String> = names.map(|l| l.name.escape_debug().to_string()).collect();
    let names = names.join(", ");
    match lights.len().checked_sub(SHOWN) {
        None | Some(0) => names,
        Some(more) => format!("{names} and {more} more"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lights() -> Vec<SolutionLight> {
        ["a", "b=c"]
            .into_iter()
            .map(|name| SolutionLight {
                name: name.to_owned(),
                emission: Rgb::new(2.0, 4.0, 1.0),
                residual: 0.0,
                error: 0.0,
            })
            .collect()
    }

    fn setting(text: &str) -> Setting {
        text.parse().unwrap()
    }

    #[test]
    fn every_form_of_a_value_means_what_the_design_says() {
        let emission = Rgb::new(2.0, 4.0, 1.0);
        let weight = |text: &str| text.parse::<Value>().unwrap().weight(emission);
        assert_eq!(weight("0.5"), Rgb::new(1.0, 2.0, 0.5));
        assert_eq!(weight("#ffffff"), Rgb::splat(4.0));
        assert_eq!(weight("2x#ff0000"), Rgb::new(8.0, 0.0, 0.0));
        assert_eq!(weight("1,0,3.5"), Rgb::new(1.0, 0.0, 3.5));
        for bad in [
            "", "x", "-1", "nan", "inf", "#fff", "#gggggg", "2#ffffff", "1,2", "1,2,3,4", "#+12345",
        ] {
            assert!(bad.parse::<Value>().is_err(), "{bad}");
        }
    }

    #[test]
    fn only_darkens_the_others_and_set_comes_after() {
        let mixed = mix(&lights(), &[setting("a=1")], &[]).unwrap();
        assert_eq!(mixed, [Rgb::new(2.0, 4.0, 1.0), Rgb::BLACK]);
        let mixed = mix(&lights(), &[setting("a=1")], &[setting("b=c=1,1,1")]).unwrap();
        assert_eq!(mixed[1], Rgb::WHITE);
        let unset = mix(&lights(), &[], &[setting("a=0")]).unwrap();
        assert_eq!(unset, [Rgb::BLACK, Rgb::new(2.0, 4.0, 1.0)]);
        let error = mix(&lights(), &[], &[setting("d=1")]).unwrap_err();
        assert_eq!(
            error.to_string(),
            "there is no light `d`; the lights are: a, b=c"
        );
        let error = mix(&lights(), &[], &[setting("\n\u{1b}[31m=1")]).unwrap_err();
        assert!(
            error
                .to_string()
                .starts_with("there is no light `\\n\\u{1b}[31m`;")
        );
    }
}
