//! Axes: where values stand, and what is written beside them.
//!
//! Ticks of a logarithmic axis are at 1, 2 and 5 times the powers of ten, at the powers alone where it is
//! long, or at some of them where it is longer still.

use std::ops::Range;

use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};

/// Decades from which on only powers of ten have ticks.
const LONG: f64 = 4.0;

/// Most ticks of an axis that has them at powers of ten alone.
const MOST_POWERS: i32 = 8;

/// Free space at either end, as a factor and as a share of the decades.
const ROOM: f64 = 1.25;
const SHARE_OF_ROOM: f64 = 0.02;

/// An axis.
#[derive(Clone)]
pub(super) enum Axis {
    /// From the smallest to the largest value, with some room.
    Logarithmic(Range<f64>),
    /// Names; a value is the number of its name, and the first name is farthest along the axis.
    Named(Vec<String>),
}

impl Axis {
    /// The axis on which all values have room; `None` where none is above zero.
    pub fn around(values: impl Iterator<Item = f64> + Clone) -> Option<Self> {
        let values = values.filter(|value| *value > 0.0 && value.is_finite());
        let low = values.clone().reduce(f64::min)?;
        let high = values.reduce(f64::max)?;
        let room = ROOM * (high / low).powf(SHARE_OF_ROOM);
        Some(Self::Logarithmic(low / room..high * room))
    }

    /// False for what has no place.
    pub fn holds(&self, value: f64) -> bool {
        match self {
            Self::Logarithmic(_) => value > 0.0 && value.is_finite(),
            Self::Named(names) => value >= 0.0 && value < names.len() as f64,
        }
    }

    /// Where a value is, from 0 at the start to 1 at the end.
    fn part(&self, value: f64) -> f64 {
        match self {
            Self::Logarithmic(range) => (value / range.start).ln() / (range.end / range.start).ln(),
            Self::Named(names) => 1.0 - (value + 0.5) / names.len() as f64,
        }
    }

    fn ticks(&self) -> Vec<f64> {
        match self {
            Self::Logarithmic(range) => ticks(range),
            Self::Named(names) => (0..names.len()).map(|number| number as f64).collect(),
        }
    }

    fn label(&self, value: f64) -> String {
        match self {
            Self::Logarithmic(_) => label(value),
            Self::Named(names) => names.get(value as usize).cloned().unwrap_or_default(),
        }
    }
}

impl Ranged for Axis {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        let length = f64::from(limit.1 - limit.0);
        limit.0 + (self.part(*value) * length).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        let wanted = hint.weight().allow_light_points();
        if wanted { Vec::new() } else { self.ticks() }
    }

    fn range(&self) -> Range<f64> {
        match self {
            Self::Logarithmic(range) => range.clone(),
            Self::Named(names) => names.len() as f64 - 0.5..-0.5,
        }
    }
}

impl ValueFormatter<f64> for Axis {
    fn format_ext(&self, value: &f64) -> String {
        self.label(*value)
    }
}

fn ticks(range: &Range<f64>) -> Vec<f64> {
    let (low, high) = (range.start.log10(), range.end.log10());
    let steps: &[f64] = if high - low > LONG {
        &[1.0]
    } else {
        &[1.0, 2.0, 5.0]
    };
    let decades = low.floor() as i32..=high.ceil() as i32;
    let every = ((high - low) as i32).div_euclid(MOST_POWERS) + 1;
    decades
        .filter(|decade| decade % every == 0)
        .flat_map(|decade| steps.iter().map(move |step| step * 10_f64.powi(decade)))
        .filter(|value| range.contains(value))
        .collect()
}

fn label(value: f64) -> String {
    let decimals = (-value.log10().floor()).max(0.0) as usize;
    match value {
        _ if !(1e-3..1e12).contains(&value) => format!("{value:.0e}"),
        _ if value >= 1e9 => format!("{:.0}G", value / 1e9),
        _ if value >= 1e6 => format!("{:.0}M", value / 1e6),
        _ if value >= 1e4 => format!("{:.0}k", value / 1e3),
        _ => format!("{value:.decimals$}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(range: Range<f64>) -> Vec<String> {
        let axis = Axis::Logarithmic(range);
        let ticks = axis.ticks().into_iter();
        ticks.map(|tick| axis.label(tick)).collect()
    }

    #[test]
    fn ticks_are_round_and_say_so() {
        assert_eq!(labels(0.009..0.3), ["0.01", "0.02", "0.05", "0.1", "0.2"]);
        let powers = ["1", "10", "100", "1000", "10k", "100k"];
        assert_eq!(labels(0.5..2e5), powers);
        assert_eq!(labels(6e5..3e6), ["1M", "2M"]);
        let few = ["1e-9", "1e-6", "0.001", "1", "1000", "1M", "1G"];
        assert_eq!(labels(9e-10..1e11), few);
    }

    #[test]
    fn values_have_room_and_names_stand_below_each_other() {
        let axis = Axis::around([0.0, 8.0, f64::NAN, 80.0].into_iter()).unwrap();
        let range = axis.range();
        assert!((5.0..6.4).contains(&range.start) && (100.0..125.0).contains(&range.end));
        assert_eq!(
            [0.0, f64::INFINITY, 7.0].map(|v| axis.holds(v)),
            [false, false, true]
        );
        // The geometric mean is in the middle.
        assert_eq!(axis.map(&640_f64.sqrt(), (100, 300)), 200);
        assert!(Axis::around([0.0].into_iter()).is_none());

        let names = Axis::Named(["first", "second"].map(str::to_owned).to_vec());
        // Pixels of a vertical axis are counted from the top.
        let places = [0.0, 1.0].map(|number| names.map(&number, (100, 0)));
        assert_eq!(places, [25, 75]);
        assert_eq!(
            [0.0, 1.0].map(|number| names.label(number)),
            ["first", "second"]
        );
    }
}
