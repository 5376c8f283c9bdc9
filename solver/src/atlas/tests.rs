extern crate std;

use super::*;
use crate::code::{AllCodes, Code, Curve, Scale};
use crate::mesh::{MeshStorage, Spacing, subdivide};
use crate::scene::{Scene, Surface};
use glam::Vec3;
use proptest::prelude::*;
use std::vec;
use std::vec::Vec;

const SQUARE: [Vec3; 4] = [
    Vec3::ZERO,
    Vec3::new(1.0, 0.0, 0.0),
    Vec3::new(1.0, 1.0, 0.0),
    Vec3::new(0.0, 1.0, 0.0),
];

const WORST: WorstError = WorstError {
    packed: 2.75,
    shown: 1.25,
};

fn value(element: u32, light: u32) -> Rgb {
    let base = 0.01 + 0.1 * element as f32 + light as f32;
    Rgb::new(base, base * 0.5, base * 0.25)
}

fn surfaces() -> [Surface; 2] {
    let wall = Surface::new(0, &SQUARE, Rgb::splat(0.5)).unwrap();
    let lamp = Surface::new(1, &SQUARE[..3], Rgb::BLACK).unwrap();
    let emission = Emission {
        light: 1,
        share: Rgb::splat(0.5),
    };
    [wall.two_sided(), lamp.emitting(1, emission).unwrap()]
}

/// One light of each kind.
fn lights() -> [LightEntry<'static>; 4] {
    let emission = Rgb::new(1.0, 2.0, 3.0);
    let scale = |largest| Scale::fitting(largest).unwrap();
    let white = Scale::ONE;
    let between = Curve::display_between(white, 0.25, 2.0).unwrap();
    let own = |name, code, curves, last| LightEntry {
        name,
        emission,
        code,
        curves,
        last: [last; 3],
    };
    [
        LightEntry::exponential("ceiling", emission, Code::Exp8s, scale(1.0)),
        own("Lämpchen", Code::Display8, [between; 3], 255),
        LightEntry::exponential("grey", emission, Code::Lum8, scale(3.0)),
        own(
            "in tiles",
            Code::Tiles,
            [Curve::display(white, 1.5).unwrap(); 3],
            200,
        ),
    ]
}

/// One row of eight elements, all of code 5: a light that is not dark, and for each of the three coded planes
/// a parameter of 15 and a first value.
const TILES: [u8; 28] = [
    3,
    4,
    0,
    0,
    1,
    0,
    0,
    0,
    1,
    0,
    0,
    0,
    // The lights in another order.
    2,
    0,
    3,
    1,
    8,
    0,
    1,
    0,
    0,
    0,
    0,
    0,
    0b1111_1010,
    0b1111_1000,
    0b0111_1000,
    0,
];

fn sample() -> Vec<u8> {
    let surfaces = surfaces();
    let scene = Scene::new(&surfaces, &[], 2).unwrap();
    let mut storage = MeshStorage::<4, 8, 16>::new();
    let spacing = Spacing {
        patch: 1.0,
        element: 0.5,
    };
    subdivide(&scene, spacing, |_, _| true, &mut storage).unwrap();
    let mesh = storage.mesh();
    let lights = lights();
    let contents = Contents {
        quantity: Quantity::Irradiance,
        lights: &lights,
        elements: 8,
        image_width: 0,
        errors: Some((WORST, &[0.5, 2.5, 1.0, 3.5])),
        tiles: &TILES,
        mesh: Some((&surfaces.map(|s| *s.polygon()), mesh)),
    };
    let mut bytes = vec![0; size(&contents).unwrap()];
    assert_eq!(write(&contents, value, &mut bytes), Ok(bytes.len()));

    let mut short = vec![0; bytes.len() - 1];
    let needed = bytes.len();
    assert_eq!(
        write(&contents, value, &mut short),
        Err(AtlasError::Full { needed })
    );
    bytes
}

#[test]
fn without_its_mesh_all_else_stays() {
    let bytes = sample();
    let atlas = Atlas::parse(&bytes).unwrap();
    let mut short = vec![0; bytes.len()];
    let length = write_without_mesh(&bytes, &mut short).unwrap();
    assert_eq!(length, bytes.len() - atlas.mesh().unwrap().byte_count());
    short.truncate(length);
    let found = Atlas::parse(&short).unwrap();
    assert!(found.mesh().is_none());
    assert!(found.lights().eq(atlas.lights()));
    assert_eq!(found.element_count(), atlas.element_count());
    let all = |atlas: &Atlas| {
        let mut all = Vec::new();
        atlas.for_each(|element, light, codes| all.push((element, light, codes)));
        all
    };
    assert_eq!(all(&found), all(&atlas));
    // Once more changes nothing, and there must be room.
    let mut again = vec![0; length];
    assert_eq!(write_without_mesh(&short, &mut again), Ok(length));
    assert_eq!(again, short);
    let full = Err(AtlasError::Full { needed: length });
    assert_eq!(write_without_mesh(&bytes, &mut again[1..]), full);
}

#[test]
fn what_was_written_is_read() {
    let bytes = sample();
    let atlas = Atlas::parse(&bytes).unwrap();
    let names: Vec<&str> = atlas.lights().map(|light| light.name).collect();
    assert_eq!(names, ["ceiling", "Lämpchen", "grey", "in tiles"]);
    assert_eq!((atlas.element_count(), atlas.light_count()), (8, 4));
    let errors: Vec<_> = atlas.lights().map(|light| light.error).collect();
    assert_eq!(errors, [Some(0.5), Some(2.5), Some(1.0), Some(3.5)]);
    assert_eq!(atlas.worst_error(), Some(WORST));

    let mut seen = Vec::new();
    atlas.for_each(|element, tag, codes| {
        seen.push((element, tag, codes));
        let light = atlas.lights().nth(tag as usize).unwrap();
        if tag == 3 {
            assert_eq!(codes, [5; 3]);
            return;
        }
        let exact = value(element, tag);
        let exact = match light.code {
            Code::Lum8 => [exact.luminance(); 3],
            _ => exact.to_array(),
        };
        for ((code, curve), exact) in codes.into_iter().zip(light.curves).zip(exact) {
            let bound = curve.error_bound(code, 255) * 1.0001;
            let error =
                (curve.decode(code) - exact.clamp(0.25 * f32::from(u8::from(tag == 1)), 2.5)).abs();
            assert!(
                error <= bound,
                "{element} {tag}: {code} {exact} {error} {bound}"
            );
        }
    });
    assert_eq!(seen.len(), 8 * 4);
    for tag in 0..4 {
        let mut own = Vec::new();
        atlas.for_each_of(tag, |element, codes| own.push((element, tag, codes)));
        let expected: Vec<_> = seen.iter().copied().filter(|(_, t, _)| *t == tag).collect();
        assert_eq!(own, expected);
    }
    atlas.for_each_of(4, |_, _| panic!("there is no such light"));

    let mesh = atlas.mesh().unwrap();
    assert_eq!((mesh.surface_count(), mesh.face_count()), (2, 3));
    assert_eq!(mesh.face(2).unwrap().emission.unwrap().light, 1);
    assert_eq!(mesh.face(1).unwrap().side, Side::Back);
    assert_eq!(mesh.element(7).unwrap().face, 1);
    assert!(mesh.element(8).is_none() && mesh.face(3).is_none());
}

#[test]
fn all_steps_are_read_where_they_were_written() {
    let lights = [0, 1].map(|tag| {
        let entry = lights()[1];
        let curves = [0, 1, 2].map(|channel| Curve::Parts {
            white: Scale::ONE,
            first: 7,
            unit: 5,
            steps: core::array::from_fn(|place| (100 * tag + 30 * channel + place) as u8),
        });
        LightEntry { curves, ..entry }
    });
    let contents = Contents {
        quantity: Quantity::Irradiance,
        lights: &lights,
        elements: 8,
        image_width: 0,
        errors: None,
        tiles: &[],
        mesh: None,
    };
    let mut bytes = vec![0; size(&contents).unwrap()];
    write(&contents, value, &mut bytes).unwrap();
    let atlas = Atlas::parse(&bytes).unwrap();
    let read: Vec<_> = atlas.lights().map(|light| light.curves).collect();
    assert_eq!(read, lights.map(|light| light.curves));
}

#[test]
fn every_truncation_is_an_error() {
    let bytes = sample();
    for length in 0..bytes.len() {
        assert!(Atlas::parse(&bytes[..length]).is_err(), "{length} bytes");
    }
    let mut longer = bytes.clone();
    longer.push(0);
    let needed = bytes.len() as u64;
    assert_eq!(
        Atlas::parse(&longer).err(),
        Some(AtlasError::Oversized { needed })
    );
}

#[test]
fn every_flipped_bit_is_an_error() {
    let bytes = sample();
    for at in 0..bytes.len() {
        for bit in 0..8 {
            let mut damaged = bytes.clone();
            damaged[at] ^= 1 << bit;
            assert!(Atlas::parse(&damaged).is_err(), "byte {at} bit {bit}");
        }
    }
}

#[test]
fn a_newer_version_says_so() {
    let mut bytes = sample();
    bytes[8] = 9;
    assert_eq!(Atlas::parse(&bytes).err(), Some(AtlasError::Version(9)));
}

/// Puts the right checksum on bytes that were changed on purpose.
fn resign(bytes: &mut [u8]) {
    if let Some(sum) = checksum::<AllCodes>(bytes) {
        bytes[CHECKSUM_AT..CHECKSUM_AT + 4].copy_from_slice(&sum.to_le_bytes());
    }
}

/// Changes to a legal atlas at the offsets that the format documents, with a right checksum.
#[test]
fn what_the_format_does_not_allow_is_an_error() {
    let sound = sample();
    let lights = |tag: usize| 56 + tag * 64;
    let steps = |tag: usize| lights(4) + tag * 24;
    let names = steps(4);
    let codes = names + "ceilingLämpchengreyin tiles".len();
    let tiles = codes + 8 * (3 + 3 + 1);
    let surfaces = tiles + TILES.len();
    let faces = surfaces + 2 * 52;
    let elements = faces + 3 * 24;
    assert_eq!(sound.len(), elements + 8 * 32);
    let nan = f32::NAN.to_le_bytes();
    let minus = (-1.0_f32).to_le_bytes();
    for (at, bytes, what) in [
        (10, &[3][..], "quantity"),
        (11, &[1], "reserved byte"),
        (13, &[1], "reserved byte"),
        (14, &[4], "image width"),
        (16, &[0], "length"),
        (28, &[0; 4], "number of lights"),
        (48, &nan, "error"),
        (48, &minus, "error"),
        (52, &[0xff; 4], "error"),
        (48, &[0xff; 8], "error of a light"),
        (lights(0), &minus, "light"),
        (lights(0) + 12, &[9], "code"),
        (lights(1) + 12, &[1], "length"),
        (lights(0) + 13, &[1], "light"),
        (lights(0) + 14, &[0], "light name"),
        (lights(0) + 16, &nan, "light"),
        (lights(0) + 16, &[0xff; 4], "error of a light"),
        (lights(0) + 20, &[1], "light"),
        (lights(0) + 22, &[0, 1], "light"),
        (lights(0) + 26, &[1], "light"),
        (lights(0) + 34, &[254], "light"),
        (lights(1) + 27, &[0xc0], "light"),
        (lights(3) + 26, &[1], "light"),
        (lights(3) + 30, &[0; 4], "light"),
        (lights(3) + 35, &[0x80], "light"),
        (lights(3) + 30, &[0xff; 4], "light"),
        (steps(0), &[1], "light"),
        (steps(3) + 23, &[1], "light"),
        (names, &[0xff], "light name"),
        (tiles, &[0], "table of tiles"),
        (tiles, &[17], "table of tiles"),
        (tiles + 1, &[0], "table of tiles"),
        (tiles + 1, &[17], "table of tiles"),
        (tiles + 2, &[1], "table of tiles"),
        (tiles + 4, &[2], "table of tiles"),
        (tiles + 7, &[0xff], "table of tiles"),
        (tiles + 8, &[2], "table of tiles"),
        (tiles + 12, &[0], "order of lights"),
        (tiles + 15, &[4], "order of lights"),
        (tiles + 16, &[7], "table of tiles"),
        (tiles + 18, &[0], "table of tiles"),
        (tiles + 20, &[5], "table of tiles"),
        (surfaces, &nan, "surface"),
        (surfaces + 48, &[5], "surface"),
        (faces, &[2], "face"),
        (faces + 4, &[2], "face"),
        (faces + 12, &1_f32.to_le_bytes(), "face"),
        (faces + 2 * 24 + 8, &[4], "light of a face"),
        (elements, &[1], "face of an element"),
        (elements + 7 * 32, &[3], "face of an element"),
        (elements + 4, &minus, "element"),
        (elements + 20, &1_f32.to_le_bytes(), "element"),
    ] {
        let mut forged = sound.clone();
        forged[at..at + bytes.len()].copy_from_slice(bytes);
        resign(&mut forged);
        let found = Atlas::parse(&forged).err();
        assert_eq!(
            found,
            Some(AtlasError::Illegal(what)),
            "byte {at}: {bytes:?}"
        );
    }
}

proptest! {
    #[test]
    fn forged_atlases_never_panic(at in 0_usize..600, value: u8, also in 8_usize..360, byte: u8) {
        let mut bytes = sample();
        let at = at % bytes.len();
        bytes[at] = value;
        bytes[also] = byte;
        resign(&mut bytes);
        if let Ok(atlas) = Atlas::parse(&bytes) {
            prop_assert_eq!(atlas.lights().count(), atlas.light_count() as usize);
            let last: Vec<[u16; 3]> = atlas.lights().map(|light| light.last).collect();
            let mut is_legal = true;
            atlas.for_each(|element, light, codes| {
                let within = codes.iter().zip(last[light as usize]).all(|(c, last)| *c <= last);
                is_legal &= within && element < atlas.element_count();
            });
            prop_assert!(is_legal);
        }
    }

    #[test]
    fn noise_never_panics(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
        prop_assert!(Atlas::parse(&bytes).is_err());
    }
}

#[test]
fn elements_without_a_light_are_no_atlas() {
    let contents = Contents {
        quantity: Quantity::Irradiance,
        lights: &[],
        elements: u32::MAX,
        image_width: 0,
        errors: None,
        tiles: &[],
        mesh: None,
    };
    let refused = Err(AtlasError::Unfit("elements without a light"));
    assert_eq!(size(&contents), refused);
}

#[test]
fn an_atlas_without_a_mesh_has_none() {
    let contents = Contents {
        quantity: Quantity::Radiosity,
        lights: &[LightEntry::exponential(
            "",
            Rgb::WHITE,
            Code::Lum8,
            Scale::ONE,
        )],
        elements: 3,
        image_width: 0,
        errors: None,
        tiles: &[],
        mesh: None,
    };
    let mut bytes = vec![0; size(&contents).unwrap()];
    write(&contents, value, &mut bytes).unwrap();
    let atlas = Atlas::parse(&bytes).unwrap();
    assert!(atlas.mesh().is_none());
    assert_eq!(atlas.code_bytes(), 3);
    assert_eq!(atlas.quantity(), Quantity::Radiosity);
    assert_eq!(atlas.worst_error(), None);
    assert_eq!(atlas.lights().next().unwrap().error, None);
}
