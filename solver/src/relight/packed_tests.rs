extern crate std;
use super::*;
use crate::atlas::AtlasError;
use crate::code::Code;
use crate::tone::{Exposure, Rgb565Table, Rgb888Table, radiance};
use proptest::prelude::*;
use std::format;
use std::vec;
use std::vec::Vec;

/// No multiple of the elements that are summed together.
const ELEMENTS: u32 = 203;
const LIGHTS: usize = 6;

/// A light falls off around its own place; far away a hundredth of it is left.
fn contribution(element: u32, light: u32) -> Rgb {
    let distance = (element as f32 - 33.0 * light as f32 - 15.0) / 40.0;
    let strength = 1.0 / (1.0 + distance * distance * 8.0) + 0.01;
    Rgb::new(1.0, 0.7 + 0.05 * light as f32, 0.5) * (strength * (1.0 + light as f32))
}

fn atlas_bytes(code: Code) -> Vec<u8> {
    test_atlas::atlas_bytes(&[code; LIGHTS], ELEMENTS, contribution)
}

const RUNS: [Run; 4] = [
    Run {
        elements: 50,
        reflectance: [52_000, 50_000, 48_000],
    },
    Run {
        elements: 101,
        reflectance: [40_000, 4_000, 3_000],
    },
    Run {
        elements: 2,
        reflectance: [0, 52_000, 100],
    },
    Run {
        elements: 50,
        reflectance: [20_000, 30_000, 45_000],
    },
];

fn reflectances() -> impl Iterator<Item = Rgb> {
    let of = |run: Run| Rgb::from_array(run.reflectance.map(|r| f32::from(r) / 65_536.0));
    RUNS.into_iter()
        .flat_map(move |run| std::iter::repeat_n(of(run), run.elements as usize))
}

/// Irradiance by the `f32` kernel.
fn in_floats(atlas: &Atlas, levels: &[[u16; 3]]) -> Vec<Rgb> {
    let mix: Vec<Rgb> = levels
        .iter()
        .map(|l| Rgb::from_array(l.map(|l| f32::from(l) / 65_536.0)))
        .collect();
    let mut values = vec![0.0; table_length(atlas)];
    let table = DecodeTable::new(atlas, &mut values).unwrap();
    let mut irradiance = vec![Rgb::BLACK; ELEMENTS as usize];
    relight(atlas, &table, &mix, &mut irradiance).unwrap();
    irradiance
}

/// White is what the brightest element of all would show two thirds of, were it as bright as the lightest.
fn exposure(atlas: &Atlas) -> Exposure {
    let bright = in_floats(atlas, &[[u16::MAX; 3]; LIGHTS]);
    let lightest = Rgb::splat(52_000.0 / 65_536.0);
    let shown = bright
        .iter()
        .map(|e| radiance(lightest, *e, Rgb::BLACK).max_channel());
    Exposure::for_white(shown.fold(0.0, f32::max) / 1.5)
}

static TONE: Rgb565Table = Rgb565Table::new(1300);
static BYTES: Rgb888Table = Rgb888Table::new(1300);

/// The largest difference of two pixels in a channel, in its own steps.
fn steps_apart(a: u16, b: u16) -> u16 {
    let channels = |p: u16| [p >> 11, p >> 5 & 63, p & 31];
    let pairs = channels(a).into_iter().zip(channels(b));
    pairs.map(|(a, b)| a.abs_diff(b)).max().unwrap()
}

fn assert_close(found: &[u16], irradiance: &[Rgb], exposure: Exposure) {
    for ((pixel, e), (r, number)) in found.iter().zip(irradiance).zip(reflectances().zip(0..)) {
        let expected = exposure.rgb565(radiance(r, *e, Rgb::BLACK));
        assert!(
            steps_apart(*pixel, expected) <= 1,
            "element {number}: {pixel:04x} {expected:04x}"
        );
    }
}

fn levels_strategy() -> impl Strategy<Value = Vec<[u16; 3]>> {
    let level = prop_oneof![Just(0_u16), Just(u16::MAX), any::<u16>(), 0_u16..2000];
    let levels = prop_oneof![
        any::<u16>().prop_map(|l| [l; 3]),
        [level.clone(), level.clone(), level]
    ];
    proptest::collection::vec(levels, LIGHTS)
}

fn check<F: Form>(code: Code, levels: &[[u16; 3]])
where
    F::Sum: PartialEq + std::fmt::Debug,
{
    let bytes = atlas_bytes(code);
    let atlas = Atlas::parse(&bytes).unwrap();
    let exposure = exposure(&atlas);
    let mut room = [FrameLight::EMPTY; LIGHTS];
    let mut mix = FrameMix::new(&atlas, &[Rgb::WHITE; LIGHTS], &mut room).unwrap();
    let finish = Finish::new(&atlas, &mix, &RUNS, exposure.factor(), &TONE).unwrap();
    let fill = |mix: &FrameMix| {
        let mut tables = [F::EMPTY; LIGHTS];
        for (light, table) in (0..).zip(&mut tables) {
            fill_table::<F>(&atlas, mix, light, table).unwrap();
        }
        tables
    };
    let mut black = vec![7; ELEMENTS as usize];
    full::<F, LIGHTS, _>(&atlas, &fill(&mix), &finish, &mut black).unwrap();
    assert!(black.iter().all(|pixel| *pixel == 0), "all lights are off");

    for (light, levels) in (0..).zip(levels) {
        mix.set(light, *levels);
    }
    let irradiance = in_floats(&atlas, levels);
    let mut pixels = vec![0; ELEMENTS as usize];
    full::<F, LIGHTS, _>(&atlas, &fill(&mix), &finish, &mut pixels).unwrap();
    assert_close(&pixels, &irradiance, exposure);

    // The sums of a change are those of a full frame, and undoing it restores them.
    let (mut sums, mut own) = (vec![F::Sum::default(); ELEMENTS as usize], F::EMPTY);
    let mut kept = Sums::<F, LIGHTS>::new(&atlas, &mix, &mut sums, &mut own).unwrap();
    let mut changed = vec![0; ELEMENTS as usize];
    kept.show(&finish, &mut changed).unwrap();
    assert_eq!(changed, pixels);
    let to = [40_000, 0, 65_535];
    kept.change(&atlas, &mut mix, (2, to)).unwrap();
    kept.show(&finish, &mut changed).unwrap();
    let mut full_again = vec![0; ELEMENTS as usize];
    full::<F, LIGHTS, _>(&atlas, &fill(&mix), &finish, &mut full_again).unwrap();
    assert_eq!(changed, full_again);
    kept.change(&atlas, &mut mix, (2, levels[2])).unwrap();
    kept.show(&finish, &mut changed).unwrap();
    assert_eq!(changed, pixels);
    for length in [1, 7, 60, 500] {
        let (mut strip, mut sent) = (vec![0; length], Vec::new());
        kept.show_strips(&finish, &mut strip, |strip| sent.extend_from_slice(strip))
            .unwrap();
        assert_eq!(sent, pixels, "strips of {length}");
    }
    let refused = kept.show_strips(&finish, &mut [], |_| {});
    assert_eq!(refused, Err(RelightError::Elements { expected: 1 }));

    let finish = Finish::new(&atlas, &mix, &RUNS, exposure.factor(), &BYTES).unwrap();
    let mut triples = vec![[0; 3]; ELEMENTS as usize];
    full::<F, LIGHTS, _>(&atlas, &fill(&mix), &finish, &mut triples).unwrap();
    for (triple, pixel) in triples.iter().zip(&pixels) {
        let [r, g, b] = triple.map(u16::from);
        let step = |value: u16, steps: u16| (value * steps + 127) / 255;
        let coarse = step(r, 31) << 11 | step(g, 63) << 5 | step(b, 31);
        assert!(steps_apart(coarse, *pixel) <= 1, "{triple:?} {pixel:04x}");
    }

    let mut values = vec![0; table_length(&atlas)];
    let any = AnyTable::new(&atlas, &mix, &mut values).unwrap();
    let finish = Finish::new(&atlas, &mix, &RUNS, exposure.factor(), &TONE).unwrap();
    full_any(
        &atlas,
        &any,
        &finish,
        &mut vec![[0; 3]; ELEMENTS as usize],
        &mut pixels,
    )
    .unwrap();
    assert_close(&pixels, &irradiance, exposure);
}

proptest! {
    #[test]
    fn luminance_frames_are_within_a_step_of_the_float_ones(levels in levels_strategy()) {
        check::<Lum>(Code::Lum8, &levels);
    }

    #[test]
    fn colour_frames_are_within_a_step_of_the_float_ones(levels in levels_strategy()) {
        check::<Colour>(Code::Display8, &levels);
        check::<Colour>(Code::Exp8s, &levels);
    }
}

#[test]
fn what_does_not_fit_is_refused() {
    let bytes = atlas_bytes(Code::Lum8);
    let atlas = Atlas::parse(&bytes).unwrap();
    let mut room = [FrameLight::EMPTY; LIGHTS];
    let mix = FrameMix::new(&atlas, &[Rgb::WHITE; LIGHTS], &mut room).unwrap();
    let finish = |runs, exposure| Finish::new(&atlas, &mix, runs, exposure, &TONE).err();
    let elements = RelightError::Elements { expected: ELEMENTS };
    assert_eq!(finish(&RUNS[1..], 0.1), Some(elements));
    for exposure in [0.0, -1.0, f32::NAN, f32::INFINITY, 1e9] {
        assert_eq!(
            finish(&RUNS, exposure),
            Some(RelightError::Range),
            "{exposure}"
        );
    }
    let finish = Finish::new(&atlas, &mix, &RUNS, 0.1, &TONE).unwrap();
    let mut pixels = [0; ELEMENTS as usize];
    let tables = [Colour::EMPTY; LIGHTS];
    let refused = full::<Colour, LIGHTS, _>(&atlas, &tables, &finish, &mut pixels);
    assert_eq!(refused, Err(RelightError::Code));
    let tables = [Lum::EMPTY; LIGHTS];
    let [few @ .., _] = &tables;
    let refused = full::<Lum, { LIGHTS - 1 }, _>(&atlas, few, &finish, &mut pixels);
    assert_eq!(refused, Err(RelightError::Lights { expected: 6 }));
    let refused = full::<Lum, LIGHTS, _>(&atlas, &tables, &finish, &mut pixels[1..]);
    assert_eq!(refused, Err(elements));
    assert_eq!(mix.levels(5), Some([0; 3]));
    assert_eq!(mix.levels(6), None);
}

#[test]
fn what_a_host_fitted_gives_the_same_frames() {
    let bytes = atlas_bytes(Code::Lum8);
    let atlas = Atlas::parse(&bytes).unwrap();
    let (full_weights, exposure) = ([Rgb::WHITE; LIGHTS], exposure(&atlas).factor());
    let fitted = Fitted::new(&atlas, &full_weights, &RUNS, exposure, &TONE).unwrap();
    let frame = |atlas: &Atlas, mix: &mut FrameMix, finish: &Finish<Rgb565Table>| {
        let mut tables = [Lum::EMPTY; LIGHTS];
        for (light, table) in (0..).zip(&mut tables) {
            mix.set(light, [30_000, 50_000, 9000 * light as u16]);
            fill_table::<Lum>(atlas, mix, light, table).unwrap();
        }
        let mut pixels = vec![0; ELEMENTS as usize];
        full::<Lum, LIGHTS, _>(atlas, &tables, finish, &mut pixels).unwrap();
        pixels
    };
    let mut rooms = [[FrameLight::EMPTY; LIGHTS]; 2];
    let [here, there] = &mut rooms;
    let mut mix = FrameMix::new(&atlas, &full_weights, here).unwrap();
    let finish = Finish::new(&atlas, &mix, &RUNS, exposure, &TONE).unwrap();
    let expected = frame(&atlas, &mut mix, &finish);

    let known = fitted.atlas(&bytes).unwrap();
    let mut mix = fitted.mix(there);
    let finish = fitted.finish(&known, &RUNS, &TONE).unwrap();
    assert_eq!(frame(&known, &mut mix, &finish), expected);
    assert!(fitted.finish(&known, &RUNS[1..], &TONE).is_err());

    for at in 0..bytes.len() {
        let mut damaged = bytes.clone();
        damaged[at] ^= 0x10;
        assert_eq!(
            fitted.atlas(&damaged).err(),
            Some(AtlasError::Checksum),
            "byte {at}"
        );
    }
    assert_eq!(fitted.atlas(&bytes[1..]).err(), Some(AtlasError::Checksum));
    // Numbers that make no sense make no panic.
    let wild = Fitted {
        gains: [[(u16::MAX, i16::MAX), (1, i16::MIN), (7, -31)]; LIGHTS],
        shown: [(u16::MAX, 1), (u16::MAX, -31), (u16::MAX, i16::MIN)],
        ..fitted
    };
    let finish = wild.finish(&known, &RUNS, &TONE).unwrap();
    frame(&known, &mut wild.mix(there), &finish);
}

#[test]
fn who_knows_only_exponential_codes_gets_the_same_from_them() {
    for code in [Code::Exp8, Code::Exp8s, Code::Lum8] {
        let bytes = atlas_bytes(code);
        let (all, few) = (Atlas::parse(&bytes), Atlas::parse_exponential(&bytes));
        let (all, few) = (all.unwrap(), few.unwrap());
        assert_eq!(all.codes(), few.codes());
        let full: Vec<Rgb> = (0..LIGHTS).map(|l| Rgb::splat(0.3 + l as f32)).collect();
        let mut rooms = [[FrameLight::EMPTY; LIGHTS]; 2];
        let [of_all, of_few] = &mut rooms;
        let of_all = FrameMix::new(&all, &full, of_all).unwrap();
        let of_few = FrameMix::exponential(&few, &full, of_few).unwrap();
        assert_eq!(format!("{of_all:?}"), format!("{of_few:?}"), "{code:?}");

        for at in 0..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[at] ^= 0x10;
            assert!(Atlas::parse_exponential(&damaged).is_err(), "byte {at}");
        }
    }
    let bytes = atlas_bytes(Code::Display8);
    let refused = Atlas::parse_exponential(&bytes).err();
    assert_eq!(refused, Some(AtlasError::Illegal("code")));
    let atlas = Atlas::parse(&bytes).unwrap();
    let mut room = [FrameLight::EMPTY; LIGHTS];
    let refused = FrameMix::exponential(&atlas, &[Rgb::WHITE; LIGHTS], &mut room).err();
    assert_eq!(refused, Some(RelightError::Code));
}
