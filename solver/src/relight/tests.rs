extern crate std;
use super::*;
use crate::code::Code;
use proptest::prelude::*;
use std::vec;
use std::vec::Vec;

/// No multiple of the elements that are summed together.
const ELEMENTS: u32 = 42;

fn power(light: u32) -> f32 {
    10.0_f32.powi(light as i32 % 4 - 2)
}

fn contribution(element: u32, light: u32) -> Rgb {
    let phase = 0.37 * element as f32 + 1.7 * light as f32;
    Rgb::new(1.0 + phase.sin(), 1.0 + phase.cos(), 0.3) * power(light)
}

/// Lights of all codes that need no tiles, in turn.
fn atlas_bytes(lights: usize) -> Vec<u8> {
    let codes = [Code::Exp8s, Code::Display8, Code::Lum8]
        .into_iter()
        .cycle();
    let codes: Vec<Code> = codes.take(lights).collect();
    test_atlas::atlas_bytes(&codes, ELEMENTS, contribution)
}

fn mix_strategy(lights: usize) -> impl Strategy<Value = Vec<Rgb>> {
    let channel = prop_oneof![Just(0.0_f32), 0.0_f32..1.0, 1e-6_f32..1e-3, 1.0_f32..100.0];
    let colour = [channel.clone(), channel.clone(), channel];
    let colour = colour.prop_map(Rgb::from_array);
    proptest::collection::vec(colour, lights)
}

fn in_floats(atlas: &Atlas, mix: &[Rgb]) -> Vec<Rgb> {
    let mut values = vec![0.0; table_length(atlas)];
    let table = DecodeTable::new(atlas, &mut values).unwrap();
    let mut irradiance = vec![Rgb::BLACK; atlas.element_count() as usize];
    relight(atlas, &table, mix, &mut irradiance).unwrap();
    irradiance
}

/// Sums by multiplication, which those by the table of all products must equal.
fn in_integers(atlas: &Atlas, mix: &FixedMix) -> Vec<[u32; 3]> {
    let mut sums = vec![[0; 3]; atlas.element_count() as usize];
    relight_fixed(atlas, mix, &mut sums).unwrap();
    let mut values = vec![0; table_length(atlas)];
    let table = FixedTable::new(atlas, mix, &mut values).unwrap();
    let mut added = vec![[0; 3]; sums.len()];
    relight_fixed(atlas, &table, &mut added).unwrap();
    assert_eq!(sums, added);
    sums
}

proptest! {
    #[test]
    fn fixed_and_float_agree_within_the_bound(mix in mix_strategy(9)) {
        let bytes = atlas_bytes(9);
        let atlas = Atlas::parse(&bytes).unwrap();
        let float = in_floats(&atlas, &mix);
        let mut room = [FixedWeight::EMPTY; 9];
        let fixed = FixedMix::new(&atlas, &mix, &mix, &mut room).unwrap();
        for (sum, exact) in in_integers(&atlas, &fixed).iter().zip(float) {
            for (sum, exact) in sum.iter().zip(exact.to_array()) {
                let found = f64::from(*sum) * f64::from(fixed.unit());
                let error = (found - f64::from(exact)).abs();
                prop_assert!(error <= f64::from(fixed.error_bound()), "{} {} {}", found, exact, fixed.error_bound());
            }
        }
    }

    #[test]
    fn float_sums_have_the_bits_of_one_light_after_the_other(mix in mix_strategy(9)) {
        let alike = |code| test_atlas::atlas_bytes(&[code; 9], ELEMENTS, contribution);
        for bytes in [atlas_bytes(9), alike(Code::Display8), alike(Code::Lum8)] {
            let atlas = Atlas::parse(&bytes).unwrap();
            let mut values = vec![0.0; table_length(&atlas)];
            let table = DecodeTable::new(&atlas, &mut values).unwrap();
            let mut one_by_one = vec![Rgb::BLACK; ELEMENTS as usize];
            atlas.for_each(|element, light, codes| {
                one_by_one[element as usize] += mix[light as usize] * table.decode(light, codes);
            });
            prop_assert_eq!(in_floats(&atlas, &mix), one_by_one);
        }
    }

    #[test]
    fn wide_sums_are_the_float_ones(mix in mix_strategy(9)) {
        let bytes = atlas_bytes(9);
        let atlas = Atlas::parse(&bytes).unwrap();
        let float = in_floats(&atlas, &mix);
        let mut sums = vec![[Wide::ZERO; 3]; ELEMENTS as usize];
        relight_wide(&atlas, &mix, &mut [WideWeight::EMPTY; 9], &mut sums).unwrap();
        let total: f32 = mix.iter().zip(0..).map(|(m, l)| m.max_channel() * power(l)).sum();
        for (sum, exact) in sums.iter().zip(float) {
            for (sum, exact) in sum.iter().zip(exact.to_array()) {
                let magnitude = sum.magnitude();
                let found = f64::from(magnitude.mantissa) * 2.0_f64.powi(magnitude.exponent);
                // Codes of the exponential table are within 0.502 of 2^-13 scales, floats within 12 roundings.
                let bound = f64::from(total) * (2.0 / 5.5 * 0.502 / 8192.0 + 12.0 * 6e-8);
                prop_assert!((found - f64::from(exact)).abs() <= bound, "{} {} {}", found, exact, bound);
            }
        }
    }

    #[test]
    fn a_change_gives_the_bits_of_a_full_relight(
        mix in mix_strategy(6), light in 0_u32..6, value in mix_strategy(1),
    ) {
        let bytes = atlas_bytes(6);
        let atlas = Atlas::parse(&bytes).unwrap();
        let brightest: Vec<Rgb> = mix.iter().map(|m| *m + Rgb::splat(100.0)).collect();
        let (mut room, mut other_room) = ([FixedWeight::EMPTY; 6], [FixedWeight::EMPTY; 6]);
        let mut fixed = FixedMix::new(&atlas, &brightest, &mix, &mut room).unwrap();
        let mut sums = in_integers(&atlas, &fixed);
        let before = sums.clone();
        change_fixed(&atlas, &mut fixed, light, value[0], &mut sums).unwrap();

        let mut changed = mix.clone();
        changed[light as usize] = value[0];
        let full = FixedMix::new(&atlas, &brightest, &changed, &mut other_room).unwrap();
        prop_assert_eq!(&sums, &in_integers(&atlas, &full));

        change_fixed(&atlas, &mut fixed, light, mix[light as usize], &mut sums).unwrap();
        prop_assert_eq!(sums, before);
    }

    #[test]
    fn wide_products_and_sums_are_those_of_rationals(a: u32, b: u32) {
        let [x, y] = [a, b].map(|bits| f32::from_bits(bits & 0x7f7f_ffff));
        let exact = |w: Wide| f64::from(w.magnitude().mantissa) * 2.0_f64.powi(w.magnitude().exponent);
        let (wide_x, wide_y) = (Wide::from_float(x), Wide::from_float(y));
        prop_assert_eq!(exact(wide_x), f64::from(x));
        let (sum, product) = (exact(wide_x.plus(wide_y)), exact(wide_x.times(wide_y)));
        let (true_sum, true_product) = (f64::from(x) + f64::from(y), f64::from(x) * f64::from(y));
        prop_assert!((sum - true_sum).abs() <= true_sum * 2.0_f64.powi(-30), "{} {}", sum, true_sum);
        prop_assert!((product - true_product).abs() <= true_product * 2.0_f64.powi(-31), "{} {}", product, true_product);
    }
}

#[test]
fn slices_and_weights_that_do_not_fit_are_refused() {
    let bytes = atlas_bytes(2);
    let atlas = Atlas::parse(&bytes).unwrap();
    let mix = [Rgb::WHITE; 2];
    let mut values = vec![0.0; table_length(&atlas)];
    let needed = values.len();
    let short = DecodeTable::new(&atlas, &mut values[1..]).err();
    assert_eq!(short, Some(RelightError::Table { needed }));
    let table = DecodeTable::new(&atlas, &mut values).unwrap();
    let mut irradiance = vec![Rgb::BLACK; ELEMENTS as usize];
    let lights = Err(RelightError::Lights { expected: 2 });
    assert_eq!(relight(&atlas, &table, &mix[..1], &mut irradiance), lights);
    let bad = [Rgb::WHITE, Rgb::splat(f32::NAN)];
    let refused = Err(RelightError::Mix { light: 1 });
    assert_eq!(relight(&atlas, &table, &bad, &mut irradiance), refused);
    let elements = Err(RelightError::Elements { expected: ELEMENTS });
    assert_eq!(
        relight(&atlas, &table, &mix, &mut irradiance[..3]),
        elements
    );

    let mut room = [FixedWeight::EMPTY; 2];
    let mut fixed = FixedMix::new(&atlas, &mix, &mix, &mut room).unwrap();
    let too_bright = fixed.set(0, Rgb::splat(1e6));
    assert_eq!(too_bright, Err(RelightError::Range));
    let together = fixed.set(0, Rgb::splat(1e3));
    assert_eq!(together, Err(RelightError::Range));
    assert!(fixed.set(2, Rgb::WHITE).is_err());
}
