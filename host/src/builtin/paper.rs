//! The room of the paper's tests: 12 polygons, 60 patches of 1 m, 960 elements of 0.25 m.
//!
//! The counts are the paper's ("the test scenes consist of 12 polygons, meshed into 60 patches and
//! 960 elements"); it gives no more, so sizes, colours and lamp places are the project's choice:
//! a cube of 3 m with a unit cube that hovers in it, turned by 17 degrees, and black lamps of
//! 0.2 m by 0.2 m under the ceiling. Vertices and their order are those of the exchanged files
//! `seed_room_1`, `seed_room_3` and `seed_room_8`; as in every OBJ, surfaces reflect on both sides.

use glam::Vec3;
use relume::color::Rgb;
use relume::draw::Camera;
use relume::mesh::Spacing;

use super::{Builder, Builtin, BuiltinError};

/// How many lamps the room has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PaperLamps {
    /// One in the middle.
    One,
    /// Three, spread unevenly.
    Three,
    /// Eight in a ring.
    Eight,
}

/// Corners of the room, then of the box.
const VERTICES: [Vec3; 16] = [
    Vec3::new(0.0, 0.0, 0.0),
    Vec3::new(0.0, 0.0, 3.0),
    Vec3::new(3.0, 0.0, 3.0),
    Vec3::new(3.0, 0.0, 0.0),
    Vec3::new(0.0, 3.0, 0.0),
    Vec3::new(3.0, 3.0, 0.0),
    Vec3::new(3.0, 3.0, 3.0),
    Vec3::new(0.0, 3.0, 3.0),
    Vec3::new(0.475_661_77, 0.5, 1.368_033_5),
    Vec3::new(1.431_966_5, 0.5, 1.075_661_8),
    Vec3::new(1.724_338_2, 0.5, 2.031_966_5),
    Vec3::new(0.768_033_47, 0.5, 2.324_338_2),
    Vec3::new(0.475_661_77, 1.5, 1.368_033_5),
    Vec3::new(0.768_033_47, 1.5, 2.324_338_2),
    Vec3::new(1.724_338_2, 1.5, 2.031_966_5),
    Vec3::new(1.431_966_5, 1.5, 1.075_661_8),
];

const FLOOR: Rgb = Rgb::splat(0.5);
const CEILING: Rgb = Rgb::splat(0.8);
const LEFT: Rgb = Rgb::new(0.63, 0.06, 0.05);
const RIGHT: Rgb = Rgb::new(0.14, 0.45, 0.09);
const BACK_AND_FRONT: Rgb = Rgb::splat(0.73);
const BOX: Rgb = Rgb::new(0.3, 0.38, 0.7);

/// Corners of each polygon, and its reflectance.
const POLYGONS: [([usize; 4], Rgb); 12] = [
    ([0, 1, 2, 3], FLOOR),
    ([4, 5, 6, 7], CEILING),
    ([0, 4, 7, 1], LEFT),
    ([3, 2, 6, 5], RIGHT),
    ([0, 3, 5, 4], BACK_AND_FRONT),
    ([1, 7, 6, 2], BACK_AND_FRONT),
    ([8, 9, 10, 11], BOX),
    ([12, 13, 14, 15], BOX),
    ([8, 11, 13, 12], BOX),
    ([9, 15, 14, 10], BOX),
    ([8, 12, 15, 9], BOX),
    ([11, 10, 14, 13], BOX),
];

/// `(low, high)` of a lamp along `x` or `z`, by its place in the room.
const NEAR: (f32, f32) = (0.4, 0.6);
const MIDDLE: (f32, f32) = (1.4, 1.6);
const FAR: (f32, f32) = (2.4, 2.6);
const THIRD: (f32, f32) = (0.9, 1.1);

/// Height of the lamps.
const LAMP_HEIGHT: f32 = 2.98;

/// Where a lamp is along `x` and along `z`.
type LampPlace = ((f32, f32), (f32, f32));

const ONE: [LampPlace; 1] = [(MIDDLE, MIDDLE)];
const THREE: [LampPlace; 3] = [(NEAR, NEAR), (FAR, THIRD), (MIDDLE, FAR)];
const EIGHT: [LampPlace; 8] = [
    (NEAR, NEAR),
    (MIDDLE, NEAR),
    (FAR, NEAR),
    (NEAR, MIDDLE),
    (FAR, MIDDLE),
    (NEAR, FAR),
    (MIDDLE, FAR),
    (FAR, FAR),
];

/// The room with lights `light_0`, `light_1`, ... of exitance 1.
///
/// # Errors
/// None in fact; the type is that of all built-in scenes.
pub fn paper_room(lamps: PaperLamps) -> Result<Builtin, BuiltinError> {
    let mut builder = Builder::default();
    for (corners, reflectance) in POLYGONS {
        builder.two_sided(&corners.map(|c| VERTICES[c]), reflectance)?;
    }

    let places: &[LampPlace] = match lamps {
        PaperLamps::One => &ONE,
        PaperLamps::Three => &THREE,
        PaperLamps::Eight => &EIGHT,
    };
    for (number, (x, z)) in places.iter().enumerate() {
        let light = builder.light(format!("light_{number}"), Rgb::WHITE);
        let outline = [(x.0, z.0), (x.1, z.0), (x.1, z.1), (x.0, z.1)];
        let vertices = outline.map(|(x, z)| Vec3::new(x, LAMP_HEIGHT, z));
        builder.lamp(&vertices, Rgb::BLACK, light)?;
    }
    Ok(Builtin {
        scene: builder.scene,
        spacing: Spacing {
            patch: 1.0,
            element: 0.25,
        },
        camera: Camera {
            eye: Vec3::new(2.8, 2.2, 0.2),
            target: Vec3::new(1.1, 1.0, 1.8),
            up: Vec3::Y,
            fov: 1.2,
        },
    })
}
