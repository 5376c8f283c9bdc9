//! Relighting by passes over an 8-bit framebuffer, as graphics hardware once did it.
//!
//! One pass a light: texels of 8 bits times the light's dimming are brought to the framebuffer's codes and added,
//! `F <- min(F + round(255 d_m s_m t_m), 255)`, or cut off instead of rounded, with `t_m` the texture in [0, 1],
//! `s_m` its scale in units of white, `d_m` in [0, 1]. White is that of all lights on, and exposure does not change:
//! textures are made once. A texture clips at white, where its light saturates the framebuffer anyway; what that loses when
//! the light dims is no error of the sum and is not counted.
//! (J. Dorsey, J. Arvo and D. Greenberg 1995; M. Nielsen and N. J. Christensen 2002, section 5, saw "visible quantization
//! artifacts when using many lights, e.g. more than 10", on 24-bit texels.)
//!
//! What to expect of `k` passes: rounding adds an error of rms `sqrt(k / 12)` codes, cutting off a bias of `-k / 2`, as
//! long as contributions are larger than a code; smaller ones than a code (or half, if rounded) vanish altogether.

use rayon::prelude::*;
use relume::color::Rgb;
use serde::Serialize;

use super::errors::exposure;
use crate::display_error::{Mixed, shown_code};
use crate::solution::Solution;

/// Numbers of lights that are tried: all where artefacts begin to show.
const LIGHTS: [usize; 25] = [
    1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 20, 24, 32, 48, 64, 96, 128, 192, 256,
];

/// Dimmings that are tried, beside all on.
const DIMMINGS: u16 = 32;

/// Codes that anybody sees.
pub const VISIBLE: f64 = 2.0;

/// What happens to a contribution on its way into the framebuffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Pass {
    /// Rounded to a whole code.
    Round,
    /// Cut off to a whole code.
    Truncate,
    /// Added in full: wide accumulation of the same textures.
    Wide,
}

impl Pass {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Round, Self::Truncate, Self::Wide];

    /// The framebuffer after a contribution, in codes.
    fn add(self, framebuffer: f32, contribution: f32) -> f32 {
        let added = match self {
            Self::Round => contribution.round(),
            Self::Truncate => contribution.floor(),
            Self::Wide => contribution,
        };
        (framebuffer + added).min(255.0)
    }
}

/// Errors of so many passes.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Accumulation {
    /// Name of the scene.
    pub scene: &'static str,
    /// Number of lights.
    pub k: usize,
    /// How they are added.
    pub pass: Pass,
    /// Largest error, in codes of the linear framebuffer.
    pub max: f64,
    /// Root of the mean square.
    pub rms: f64,
    /// Mean.
    pub bias: f64,
    /// Largest error, in display codes.
    pub max_display: f64,
    /// Root of the mean square of those.
    pub rms_display: f64,
    /// Mean of those.
    pub bias_display: f64,
}

/// Sums over states, elements and channels.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    count: f64,
    max: f64,
    sum: f64,
    squares: f64,
}

impl Sums {
    fn add(&mut self, error: f64) {
        self.merge(Self {
            count: 1.0,
            max: error.abs(),
            sum: error,
            squares: error * error,
        });
    }

    fn merge(&mut self, other: Self) {
        self.count += other.count;
        self.max = self.max.max(other.max);
        self.sum += other.sum;
        self.squares += other.squares;
    }

    fn rms(&self) -> f64 {
        (self.squares / self.count).sqrt()
    }

    fn bias(&self) -> f64 {
        self.sum / self.count
    }
}

/// The first lights of a solution in textures of 8 bits.
struct Textures {
    /// Nominal contributions in units of white, at most 1, element by element, light by light.
    exact: Vec<Rgb>,
    /// The same as textures hold them.
    texels: Vec<Rgb>,
    lights: usize,
}

impl Textures {
    fn new(solution: &Solution, lights: usize) -> Self {
        let nominal = solution.nominal_mix();
        let elements = || solution.contributions.chunks(nominal.len().max(1));
        let own = |values: &[Rgb]| -> Vec<Rgb> {
            let values = values.iter().zip(&nominal).take(lights);
            values.map(|(value, emission)| *value * *emission).collect()
        };
        let on: Vec<Rgb> = elements()
            .map(|values| own(values).into_iter().fold(Rgb::BLACK, |a, b| a + b))
            .collect();
        let exposure = exposure(&on);
        let exact = elements().flat_map(own);
        let exact: Vec<Rgb> = exact
            .map(|value| value.map(|x| (x * exposure).min(1.0)))
            .collect();
        let mut scales = vec![0.0_f32; lights];
        for values in exact.chunks(lights.max(1)) {
            for (scale, value) in scales.iter_mut().zip(values) {
                *scale = scale.max(value.max_channel());
            }
        }
        let texels = exact.chunks(lights.max(1)).flat_map(|values| {
            let values = values.iter().zip(&scales);
            values.map(|(value, scale)| {
                let scale = scale.max(f32::MIN_POSITIVE);
                value.map(|x| (255.0 * x / scale).round() / 255.0 * scale)
            })
        });
        Self {
            texels: texels.collect(),
            exact,
            lights,
        }
    }

    /// Errors of a state with these dimmings: in codes of the framebuffer, and in display codes.
    fn errors(&self, dimmings: &[f32], pass: Pass) -> [Sums; 2] {
        let mut sums = [Sums::default(); 2];
        let elements = self
            .exact
            .chunks(self.lights)
            .zip(self.texels.chunks(self.lights));
        for (exact, texels) in elements {
            let exact = exact.iter().zip(dimmings);
            let exact = exact.fold(Rgb::BLACK, |sum, (value, dimming)| sum + *value * *dimming);
            let mut framebuffer = [0.0; 3];
            for (texel, dimming) in texels.iter().zip(dimmings) {
                let contribution = *texel * (255.0 * dimming);
                let channels = framebuffer.iter_mut().zip(contribution.to_array());
                channels.for_each(|(code, added)| *code = pass.add(*code, added));
            }
            for (exact, code) in exact.to_array().into_iter().zip(framebuffer) {
                sums[0].add(f64::from(code - 255.0 * exact.min(1.0)));
                sums[1].add(f64::from(shown_code(code / 255.0) - shown_code(exact)));
            }
        }
        sums
    }
}

/// Measures the first lights of a scene.
#[must_use]
pub fn measure(scene: &'static str, solution: &Solution) -> Vec<Accumulation> {
    let counts = LIGHTS.into_iter().filter(|k| *k <= solution.lights.len());
    let measured = counts.flat_map(|k| {
        let textures = Textures::new(solution, k);
        Pass::ALL.map(|pass| {
            let states: Vec<[Sums; 2]> = (0..=DIMMINGS)
                .into_par_iter()
                .map(|state| {
                    let dimmings: Vec<f32> =
                        (0..k as u32).map(|light| dimming(state, light)).collect();
                    textures.errors(&dimmings, pass)
                })
                .collect();
            let mut all = [Sums::default(); 2];
            for state in states {
                all.iter_mut()
                    .zip(state)
                    .for_each(|(all, own)| all.merge(own));
            }
            let [linear, display] = all;
            Accumulation {
                scene,
                k,
                pass,
                max: linear.max,
                rms: linear.rms(),
                bias: linear.bias(),
                max_display: display.max,
                rms_display: display.rms(),
                bias_display: display.bias(),
            }
        })
    });
    measured.collect()
}

/// All on, then dimmings that are uniform in [0, 1].
fn dimming(state: u16, light: u32) -> f32 {
    match state.checked_sub(1) {
        None => 1.0,
        Some(number) => Mixed::Dimming(3 * number).weight(light, Rgb::WHITE).g,
    }
}

/// The least number of lights from which on an error is above [`VISIBLE`] codes; `None` if it never is.
pub fn visible_from(
    measured: &[Accumulation],
    pass: Pass,
    error: fn(&Accumulation) -> f64,
) -> Option<usize> {
    let own: Vec<&Accumulation> = measured.iter().filter(|row| row.pass == pass).collect();
    let below = own.iter().rposition(|row| error(row).abs() <= VISIBLE);
    let first = own.get(below.map_or(0, |place| place + 1))?;
    Some(first.k)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An element on which every light leaves the same share of white.
    fn textures(share: f32, lights: usize) -> Textures {
        let values = vec![Rgb::splat(share); lights];
        Textures {
            exact: values.clone(),
            texels: values,
            lights,
        }
    }

    #[test]
    fn cutting_off_loses_half_a_code_a_pass_and_rounding_nothing_on_average() {
        // Ten lights that dim through all fractions of a code.
        let textures = textures(1.0 / 16.0, 10);
        let mut all = [Sums::default(); 2];
        for step in 0..1000 {
            let dimming = 0.5 + 0.5 * step as f32 / 1000.0;
            let dimmings: Vec<f32> = (0..10)
                .map(|m| (dimming + 0.037 * m as f32).fract())
                .collect();
            for (sum, pass) in all.iter_mut().zip([Pass::Truncate, Pass::Round]) {
                sum.merge(textures.errors(&dimmings, pass)[0]);
            }
        }
        let [truncated, rounded] = all;
        assert!((truncated.bias() + 5.0).abs() < 0.2, "{truncated:?}");
        assert!(rounded.bias().abs() < 0.2, "{rounded:?}");
    }

    #[test]
    fn what_is_less_than_half_a_code_vanishes() {
        let dim = textures(0.4 / 255.0, 100);
        let on = vec![1.0; 100];
        assert!((dim.errors(&on, Pass::Round)[0].bias() + 40.0).abs() < 1e-3);
        assert!(dim.errors(&on, Pass::Wide)[0].bias().abs() < 1e-3);
        // And what is more counts as a whole one.
        let bright = textures(0.6 / 255.0, 100);
        assert!((bright.errors(&on, Pass::Round)[0].bias() - 40.0).abs() < 1e-3);
        assert!((bright.errors(&on, Pass::Truncate)[0].bias() + 60.0).abs() < 1e-3);
    }

    #[test]
    fn the_framebuffer_saturates_where_the_display_does() {
        let bright = textures(0.5, 10);
        for pass in Pass::ALL {
            let [linear, display] = bright.errors(&[1.0; 10], pass);
            assert_eq!((linear.max, display.max), (0.0, 0.0), "{pass:?}");
        }
    }
}
