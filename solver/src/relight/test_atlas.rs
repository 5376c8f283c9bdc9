//! Atlases for the tests of all kernels.

extern crate std;
use crate::atlas::{Contents, LightEntry, Quantity, size, write};
use crate::code::{Code, Curve, Scale};
use crate::color::Rgb;
use std::vec;
use std::vec::Vec;

/// An atlas of contributions, a code per light, none in tiles. White is half of the largest value of a light.
pub(super) fn atlas_bytes(
    codes: &[Code],
    elements: u32,
    contribution: impl Fn(u32, u32) -> Rgb,
) -> Vec<u8> {
    let entry = |(light, code): (u32, &Code)| {
        let values = (0..elements).map(|element| contribution(element, light).max_channel());
        let largest = values.fold(0.0, f32::max);
        let scale = Scale::fitting(largest).unwrap();
        let entry = LightEntry::exponential("", Rgb::WHITE, *code, scale);
        match code {
            Code::Display8 => {
                let white = Scale::at_least(largest / 2.0).unwrap();
                LightEntry {
                    curves: [Curve::display_between(white, 0.0, largest).unwrap(); 3],
                    ..entry
                }
            }
            _ => entry,
        }
    };
    let entries: Vec<LightEntry> = (0..).zip(codes).map(entry).collect();
    let contents = Contents {
        quantity: Quantity::Irradiance,
        lights: &entries,
        elements,
        image_width: 0,
        errors: None,
        tiles: &[],
        mesh: None,
    };
    let mut bytes = vec![0; size(&contents).unwrap()];
    write(&contents, contribution, &mut bytes).unwrap();
    bytes
}
