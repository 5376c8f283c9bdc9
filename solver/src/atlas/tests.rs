extern crate std;

use super::*;
use crate::code::{Code, decode, error_bound};
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
    let entry = |name, largest| LightEntry {
        name,
        emission: Rgb::new(1.0, 2.0, 3.0),
        scale: Scale::fitting(largest).unwrap(),
    };
    let contents = Contents {
        code: Code::Exp8s,
        channels: Channels::Rgb,
        quantity: Quantity::Irradiance,
        lights: &[entry("ceiling", 1.0), entry("Lämpchen", 2.0)],
        elements: 8,
        errors: Some((WORST, &[0.5, 2.5])),
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
fn what_was_written_is_read() {
    let bytes = sample();
    let atlas = Atlas::parse(&bytes).unwrap();
    let names: Vec<&str> = atlas.lights().map(|light| light.name).collect();
    assert_eq!(names, ["ceiling", "Lämpchen"]);
    assert_eq!((atlas.element_count(), atlas.light_count()), (8, 2));
    let errors: Vec<_> = atlas.lights().map(|light| light.error).collect();
    assert_eq!(errors, [Some(0.5), Some(2.5)]);
    assert_eq!(atlas.worst_error(), Some(WORST));

    for element in 0..8 {
        let (triples, rest) = atlas.codes(element).as_chunks::<3>();
        assert!(rest.is_empty());
        for ((codes, light), tag) in triples.iter().zip(atlas.lights()).zip(0..) {
            let scale = light.scale.value();
            for (code, exact) in codes.iter().zip(value(element, tag).to_array()) {
                let found = decode(*code) * scale;
                let bound = error_bound(*code) * scale * 1.0001;
                assert!(
                    (found - exact).abs() <= bound,
                    "{element} {tag}: {found} {exact}"
                );
            }
        }
    }

    let mesh = atlas.mesh().unwrap();
    assert_eq!((mesh.surface_count(), mesh.face_count()), (2, 3));
    assert_eq!(mesh.face(2).unwrap().emission.unwrap().light, 1);
    assert_eq!(mesh.face(1).unwrap().side, Side::Back);
    assert_eq!(mesh.element(7).unwrap().face, 1);
    assert!(mesh.element(8).is_none() && mesh.face(3).is_none());
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
    if let Some(sum) = checksum(bytes) {
        bytes[CHECKSUM_AT..CHECKSUM_AT + 4].copy_from_slice(&sum.to_le_bytes());
    }
}

/// Changes to a legal atlas at the offsets that the format documents, with a right checksum.
#[test]
fn what_the_format_does_not_allow_is_an_error() {
    let sound = sample();
    let names = "ceilingLämpchen".len();
    let surfaces = 52 + 2 * 24 + names + 8 * 2 * 3;
    let faces = surfaces + 2 * 52;
    let elements = faces + 3 * 24;
    assert_eq!(sound.len(), elements + 8 * 32);
    let nan = f32::NAN.to_le_bytes();
    let minus = (-1.0_f32).to_le_bytes();
    for (at, bytes, what) in [
        (10, &[9][..], "code"),
        (11, &[2], "number of channels"),
        (12, &[2], "quantity"),
        (13, &[1], "reserved byte"),
        (15, &[1], "reserved byte"),
        (16, &[0], "length"),
        (44, &nan, "error"),
        (44, &minus, "error"),
        (48, &[0xff; 4], "error"),
        (44, &[0xff; 8], "error of a light"),
        (52, &minus, "light"),
        (52 + 16, &[0], "light name"),
        (52 + 18, &[1], "light"),
        (52 + 19, &[1], "light"),
        (52 + 20, &nan, "light"),
        (52 + 20, &[0xff; 4], "error of a light"),
        (52 + 2 * 24, &[0xff], "light name"),
        (surfaces, &nan, "surface"),
        (surfaces + 48, &[5], "surface"),
        (faces, &[2], "face"),
        (faces + 4, &[2], "face"),
        (faces + 12, &1_f32.to_le_bytes(), "face"),
        (faces + 2 * 24 + 8, &[2], "light of a face"),
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
    fn forged_atlases_never_panic(at in 0_usize..600, value: u8, also in 8_usize..52, byte: u8) {
        let mut bytes = sample();
        let at = at % bytes.len();
        bytes[at] = value;
        bytes[also] = byte;
        resign(&mut bytes);
        if let Ok(atlas) = Atlas::parse(&bytes) {
            prop_assert_eq!(atlas.lights().count(), atlas.light_count() as usize);
            prop_assert!(atlas.element_count() == 0 || !atlas.codes(0).is_empty() || atlas.light_count() == 0);
        }
    }

    #[test]
    fn noise_never_panics(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
        prop_assert!(Atlas::parse(&bytes).is_err());
    }
}

#[test]
fn an_atlas_without_a_mesh_has_none() {
    let contents = Contents {
        code: Code::Exp8,
        channels: Channels::Luminance,
        quantity: Quantity::Radiosity,
        lights: &[LightEntry {
            name: "",
            emission: Rgb::WHITE,
            scale: Scale::ONE,
        }],
        elements: 3,
        errors: None,
        mesh: None,
    };
    let mut bytes = vec![0; size(&contents).unwrap()];
    write(&contents, value, &mut bytes).unwrap();
    let atlas = Atlas::parse(&bytes).unwrap();
    assert!(atlas.mesh().is_none());
    assert_eq!(atlas.all_codes().len(), 3);
    assert_eq!(atlas.quantity(), Quantity::Radiosity);
    assert_eq!(atlas.worst_error(), None);
    assert_eq!(atlas.lights().next().unwrap().error, None);
}
