//! The Cornell box with three lights that can be switched.
//!
//! Measurements: Cornell University Program of Computer Graphics, *Cornell Box Data* (1998,
//! graphics.cornell.edu/online/box/data.html), in millimetres; one unit here is a metre, so the
//! room is about 0.55 m wide. Departures from the data:
//!
//! * the measured room is out of square by up to 6.4 mm and its left wall is warped, which no
//!   planar quad can be: here it is the cuboid 552.8 x 548.8 x 559.2;
//! * the lamp hangs 1 mm under the ceiling, where the original shines through a hole in it;
//! * the spot and the blue lamp are added.
//!
//! Reflectances: the published spectra in linear RGB, as in M. McGuire, *Computer Graphics
//! Archive* (2017), CornellBox-Original. The front is open to the viewer; walls reflect inwards
//! and blocks outwards, for nothing lit has another side. The blocks have no bottoms.

use glam::Vec3;
use relume::color::Rgb;
use relume::draw::Camera;
use relume::mesh::Spacing;
use relume::scene::{Falloff, Source};

use super::{Builder, Builtin, BuiltinError, cuboid, reversed};

const WHITE: Rgb = Rgb::new(0.725, 0.71, 0.68);
const RED: Rgb = Rgb::new(0.63, 0.065, 0.05);
const GREEN: Rgb = Rgb::new(0.14, 0.45, 0.091);

/// Size of the room in mm.
const ROOM: Vec3 = Vec3::new(552.8, 548.8, 559.2);

/// A block: height, and the corners of its top as `(x, z)`, counter-clockwise from above; mm.
struct Block {
    height: f32,
    outline: [(f32, f32); 4],
}

const SHORT_BLOCK: Block = Block {
    height: 165.0,
    outline: [(130.0, 65.0), (82.0, 225.0), (240.0, 272.0), (290.0, 114.0)],
};

const TALL_BLOCK: Block = Block {
    height: 330.0,
    outline: [
        (423.0, 247.0),
        (265.0, 296.0),
        (314.0, 456.0),
        (472.0, 406.0),
    ],
};

/// The published lamp, 1 mm lower; mm, front down.
const CEILING_LAMP: [Vec3; 4] = [
    Vec3::new(343.0, 547.8, 227.0),
    Vec3::new(343.0, 547.8, 332.0),
    Vec3::new(213.0, 547.8, 332.0),
    Vec3::new(213.0, 547.8, 227.0),
];

/// A panel 5 mm in front of the green wall, behind the short block; mm, front towards the room.
const WALL_LAMP: [Vec3; 4] = [
    Vec3::new(5.0, 40.0, 340.0),
    Vec3::new(5.0, 120.0, 340.0),
    Vec3::new(5.0, 120.0, 460.0),
    Vec3::new(5.0, 40.0, 460.0),
];

/// The spot, up beside the viewer, and what it points at: the front of the tall block; mm.
const SPOT: Vec3 = Vec3::new(90.0, 500.0, 60.0);
const SPOT_TARGET: Vec3 = Vec3::new(344.0, 220.0, 271.5);

/// Nominal exitance of the ceiling lamp, W/m2: pi times the radiance (17, 12, 4) that renderers
/// use for the published lamp.
const CEILING_EMISSION: Rgb = Rgb::new(53.4, 37.7, 12.6);

/// Nominal intensity of the spot, W/sr.
const SPOT_EMISSION: Rgb = Rgb::new(0.25, 0.24, 0.22);

/// Nominal exitance of the wall lamp, W/m2.
const WALL_EMISSION: Rgb = Rgb::new(6.0, 18.0, 60.0);

/// The box with the lights `ceiling`, `spot` and `lamp`.
///
/// # Errors
/// None in fact; the type is that of all built-in scenes.
pub fn cornell_box() -> Result<Builtin, BuiltinError> {
    let mut builder = Builder::default();
    let [floor, ceiling, right, left, _front, back] = cuboid(Vec3::ZERO, ROOM).map(reversed);
    for (wall, reflectance) in [
        (floor, WHITE),
        (ceiling, WHITE),
        (back, WHITE),
        (right, GREEN),
        (left, RED),
    ] {
        builder.surface(&wall.map(metres), reflectance)?;
    }
    for block in [SHORT_BLOCK, TALL_BLOCK] {
        for face in block.faces() {
            builder.surface(&face.map(metres), WHITE)?;
        }
    }

    let ceiling = builder.light("ceiling", CEILING_EMISSION);
    builder.lamp(&CEILING_LAMP.map(metres), Rgb::BLACK, ceiling)?;
    let spot = builder.light("spot", SPOT_EMISSION);
    builder.luminaire(
        spot,
        Source::Spot {
            position: metres(SPOT),
            direction: SPOT_TARGET - SPOT,
            inner: 0.15,
            outer: 0.4,
            falloff: Falloff::Smooth,
        },
    )?;
    let lamp = builder.light("lamp", WALL_EMISSION);
    builder.lamp(&WALL_LAMP.map(metres), Rgb::BLACK, lamp)?;

    Ok(Builtin {
        scene: builder.scene,
        spacing: Spacing {
            patch: 0.1,
            element: 0.025,
        },
        // Published: position (278, 273, -800), focal length 35 mm, film 25 mm.
        camera: Camera {
            eye: metres(Vec3::new(278.0, 273.0, -800.0)),
            target: metres(Vec3::new(278.0, 273.0, 0.0)),
            up: Vec3::Y,
            fov: 0.686,
        },
    })
}

fn metres(millimetres: Vec3) -> Vec3 {
    millimetres / 1000.0
}

impl Block {
    /// Top and sides, fronts outwards; mm.
    fn faces(&self) -> [[Vec3; 4]; 5] {
        let at = |(x, z): (f32, f32), y: f32| Vec3::new(x, y, z);
        let side = |from, to| {
            [
                at(from, 0.0),
                at(to, 0.0),
                at(to, self.height),
                at(from, self.height),
            ]
        };
        let [a, b, c, d] = self.outline;
        let top = self.outline.map(|corner| at(corner, self.height));
        [top, side(a, b), side(b, c), side(c, d), side(d, a)]
    }
}
