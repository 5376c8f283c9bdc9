//! The four cases of the framework paper, and the same scene in every format.
//!
//! *A framework for real-time application of view-independent precalculated global-illumination solutions*, 2006, section
//! 3 and Table 2: a scene with four lights as one group, as four groups in half floats, as four luminances in one texel, and
//! combined by the processor into 8 bits. Memory is that of textures over that of one RGBA texture of half floats; cost is time
//! over that of the first case. The paper's is that of a whole frame on a GeForce FX 5950, tone mapping included (but
//! in the last case, where it is done before); ours is that of decoding and combining an element in `f32` on one thread.
//!
//! The luminance is that of ITU-R BT.601, `0.299 R + 0.587 G + 0.114 B`. It takes on the colour of its light, so that no surface
//! colours the light that it sends on.

use std::hint::black_box;

use anyhow::Result;
use half::f16;
use relume::color::Rgb;
use relume::tone::srgb_encode;
use serde::Serialize;

use super::errors::{Errors, compare, exposure};
use super::formats::{Coded, Half, Scope};
use super::scenes::first_lights;
use super::stored::{Format, per_contribution};
use crate::solution::Solution;

/// Lights of the paper's scene.
const LIGHTS: usize = 4;

/// Bits of an RGBA texel of half floats.
const TEXEL_BITS: f64 = 64.0;

/// Weights of luminance, ITU-R BT.601.
const BT601: Rgb = Rgb::new(0.299, 0.587, 0.114);

/// Weights of luminance, ITU-R BT.709.
const BT709: Rgb = Rgb::new(0.2126, 0.7152, 0.0722);

/// One way to keep four lights.
#[derive(Clone, Debug, Serialize)]
pub struct Case {
    /// What it is.
    pub name: String,
    /// Lights that can be set by themselves.
    pub groups: usize,
    /// Memory over that of the first case.
    pub memory: f64,
    /// Time of a frame over that of the first case.
    pub cost: f64,
    /// Nanoseconds of an element and frame.
    pub nanoseconds: f64,
    /// Nanoseconds of an element when a light changes, where that is not done in every frame.
    pub recombination: Option<f64>,
    /// The paper's relative memory.
    pub published_memory: Option<f64>,
    /// The paper's frames a second.
    pub published_fps: Option<f64>,
    /// Its time of a frame over that of the first case.
    pub published_cost: Option<f64>,
    /// Largest error where lights dim, in display codes.
    pub max_codes_random: f32,
    /// Largest with a light alone; nothing where no light can be set.
    pub max_codes_solo: Option<f32>,
    /// Mean error where lights dim.
    pub mean_codes: f64,
}

/// Relative memory and frames a second of the paper's Table 2.
const PUBLISHED: [[f64; 2]; 4] = [[1.0, 28.0], [4.0, 25.0], [1.0, 22.0], [0.5, 36.0]];

impl Case {
    fn new(name: &str, bits: f64, nanoseconds: f64, errors: Errors) -> Self {
        Self {
            name: name.to_owned(),
            groups: LIGHTS,
            memory: bits / TEXEL_BITS,
            cost: f64::NAN,
            nanoseconds,
            recombination: None,
            published_memory: None,
            published_fps: None,
            published_cost: None,
            max_codes_random: errors.max_random,
            max_codes_solo: Some(errors.max_solo),
            mean_codes: errors.mean,
        }
    }

    fn published(self, case: usize) -> Self {
        let [memory, fps] = PUBLISHED[case];
        Self {
            published_memory: Some(memory),
            published_fps: Some(fps),
            published_cost: Some(PUBLISHED[0][1] / fps),
            ..self
        }
    }
}

/// Measures the four cases and every format with the first four lights of a solution.
///
/// # Errors
/// A solution that an atlas cannot hold.
pub fn measure(solution: &Solution) -> Result<Vec<Case>> {
    let four = first_lights(solution, LIGHTS);
    let mut cases = vec![one_group(&four)?, four_groups(&four)?];
    cases.extend(packed(&four)?);
    cases.push(recombined(&four)?);
    for format in Format::all() {
        let stored = format.store(&four)?;
        let [errors] = compare(&four, &[&stored.decoded])[..] else {
            continue;
        };
        let (bits, time) = (
            LIGHTS as f64 * stored.bits_per_rgb,
            LIGHTS as f64 * stored.nanoseconds,
        );
        cases.push(Case::new(format.name(), bits, time, errors));
    }
    let first = cases[0].nanoseconds;
    for case in &mut cases {
        case.cost = case.nanoseconds / first;
    }
    Ok(cases)
}

/// All lights as one.
fn one_group(four: &Solution) -> Result<Case> {
    let mut one = first_lights(four, 1);
    one.lights[0].emission = Rgb::WHITE;
    one.contributions = four.relight(&four.nominal_mix());
    let coded = Coded::<Half>::new(&one, Scope::Light);
    let [errors] = compare(&one, &[&coded.decoded()])[..] else {
        anyhow::bail!("one packing has one error");
    };
    let case = Case::new(
        "one group in half floats",
        TEXEL_BITS,
        frame(&one, &coded)?,
        errors,
    );
    Ok(Case {
        groups: 1,
        max_codes_solo: None,
        ..case.published(0)
    })
}

/// Every light in a texture of its own.
fn four_groups(four: &Solution) -> Result<Case> {
    let coded = Coded::<Half>::new(four, Scope::Light);
    let [errors] = compare(four, &[&coded.decoded()])[..] else {
        anyhow::bail!("one packing has one error");
    };
    let bits = LIGHTS as f64 * TEXEL_BITS;
    let case = Case::new(
        "four groups in half floats",
        bits,
        frame(four, &coded)?,
        errors,
    );
    Ok(case.published(1))
}

/// Nanoseconds of an element of half floats.
fn frame(solution: &Solution, coded: &Coded<Half>) -> Result<f64> {
    let mix = solution.nominal_mix();
    let mut irradiance = vec![Rgb::BLACK; solution.mesh.elements.len()];
    per_contribution(irradiance.len(), || {
        coded.relight(black_box(&mix), &mut irradiance);
        black_box(&irradiance);
        Ok(())
    })
}

/// Four luminances in a texel, by both definitions.
fn packed(four: &Solution) -> Result<[Case; 2]> {
    let texels = [BT601, BT709].map(|weights| luminances(four, weights));
    let decoded = texels.each_ref().map(|texels| {
        let grey = texels.iter().flatten().map(|l| Rgb::splat(l.to_f32()));
        grey.collect::<Vec<Rgb>>()
    });
    let [paper, modern] = compare(four, &[&decoded[0], &decoded[1]])[..] else {
        anyhow::bail!("two packings have two errors");
    };
    let mix = four.nominal_mix();
    let mut irradiance = vec![Rgb::BLACK; four.mesh.elements.len()];
    let time = per_contribution(irradiance.len(), || {
        let mix = black_box(&mix);
        for (sum, texel) in irradiance.iter_mut().zip(&texels[0]) {
            let lights = texel.iter().zip(mix);
            *sum = lights.fold(Rgb::BLACK, |sum, (l, weight)| sum + *weight * l.to_f32());
        }
        black_box(&irradiance);
        Ok(())
    })?;
    Ok([
        Case::new(
            "four luminances (BT.601) in half floats",
            TEXEL_BITS,
            time,
            paper,
        )
        .published(2),
        Case::new(
            "four luminances (BT.709) in half floats",
            TEXEL_BITS,
            time,
            modern,
        ),
    ])
}

/// The luminances of four lights, a texel for every element.
fn luminances(four: &Solution, weights: Rgb) -> Vec<[f16; LIGHTS]> {
    let elements = four.contributions.as_chunks::<LIGHTS>().0.iter();
    let luminance = |value: Rgb| {
        let weighted = value * weights;
        f16::from_f32(weighted.r + weighted.g + weighted.b)
    };
    elements.map(|values| values.map(luminance)).collect()
}

/// All lights combined, exposed and encoded for the display whenever one changes; a frame only reads the texels.
fn recombined(four: &Solution) -> Result<Case> {
    let coded = Coded::<Half>::new(four, Scope::Light);
    let [errors] = compare(four, &[&coded.decoded()])[..] else {
        anyhow::bail!("one packing has one error");
    };
    let mix = four.nominal_mix();
    let mut irradiance = vec![Rgb::BLACK; four.mesh.elements.len()];
    let exposure = exposure(&four.relight(&mix));
    let mut texels = vec![[0_u8; 4]; irradiance.len()];
    let recombination = per_contribution(irradiance.len(), || {
        coded.relight(black_box(&mix), &mut irradiance);
        for (texel, value) in texels.iter_mut().zip(&irradiance) {
            let [r, g, b] = value
                .to_array()
                .map(|x| (255.0 * srgb_encode(x * exposure)).round() as u8);
            *texel = [r, g, b, u8::MAX];
        }
        black_box(&texels);
        Ok(())
    })?;
    let mut shown = irradiance;
    let time = per_contribution(shown.len(), || {
        for (shown, [r, g, b, _]) in shown.iter_mut().zip(black_box(&texels)) {
            *shown = Rgb::new(f32::from(*r), f32::from(*g), f32::from(*b));
        }
        black_box(&shown);
        Ok(())
    })?;
    // Texels of 8 bits round what is shown, once.
    let rounded = Errors {
        max_random: errors.max_random + 0.5,
        max_solo: errors.max_solo + 0.5,
        mean: errors.mean + 0.25,
        ..errors
    };
    let case = Case::new(
        "four groups, combined into 8 bits",
        TEXEL_BITS / 2.0,
        time,
        rounded,
    );
    Ok(Case {
        recombination: Some(recombination),
        ..case.published(3)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::quantization::scenes::tests::small;

    #[test]
    fn the_cases_take_the_published_memory_and_luminance_loses_colours() {
        let cases = measure(&small()).unwrap();
        let published: Vec<&Case> = cases.iter().filter(|c| c.published_fps.is_some()).collect();
        assert_eq!(published.len(), PUBLISHED.len());
        for case in &published {
            assert_eq!(Some(case.memory), case.published_memory, "{}", case.name);
            assert!(case.nanoseconds > 0.0 && case.cost.is_finite(), "{case:?}");
        }
        assert_eq!(published[0].groups, 1);
        assert!(published[1].max_codes_random < 0.1, "{:?}", published[1]);
        // The room has a red and a green wall.
        assert!(published[2].max_codes_random > 10.0, "{:?}", published[2]);
        assert_eq!(cases.len(), 5 + Format::all().len());
    }

    #[test]
    fn weights_of_luminance_sum_to_one() {
        for weights in [BT601, BT709] {
            assert!((weights.r + weights.g + weights.b - 1.0).abs() < 1e-6);
        }
        assert_eq!(
            (Rgb::new(0.2, 0.5, 0.7) * BT709)
                .to_array()
                .iter()
                .sum::<f32>(),
            Rgb::new(0.2, 0.5, 0.7).luminance()
        );
    }
}
