//! White furnaces: closed rooms of one reflectance in which everything emits the same.
//!
//! Whatever the shape, irradiance is the same everywhere: `E = M / (1 - rho)` with the exitance
//! `M` in W/m2 and the reflectance `rho`, so any deviation is an error of the method.

use glam::Vec3;
use relume::color::Rgb;
use relume::draw::Camera;
use relume::mesh::Spacing;

use super::{Builder, Builtin, BuiltinError, cuboid, reversed};

/// The unit cube; its light `walls` has the nominal emission `exitance`.
///
/// # Errors
/// A reflectance outside [0, 1), or an exitance that is negative or not finite.
pub fn white_furnace(reflectance: f32, exitance: f32) -> Result<Builtin, BuiltinError> {
    let walls = cuboid(Vec3::ZERO, Vec3::ONE).map(reversed);
    furnace(&walls, Vec3::ONE, reflectance, exitance)
}

/// A room of 2 m by 1.5 m by 1 m in which a small box floats off the middle.
///
/// # Errors
/// As [`white_furnace`].
pub fn furnace_with_box(reflectance: f32, exitance: f32) -> Result<Builtin, BuiltinError> {
    let size = Vec3::new(2.0, 1.5, 1.0);
    let room = cuboid(Vec3::ZERO, size).map(reversed);
    let inside = cuboid(Vec3::new(0.5, 0.25, 0.25), Vec3::new(1.25, 1.0, 0.5));
    furnace(&[room, inside].concat(), size, reflectance, exitance)
}

fn furnace(
    faces: &[[Vec3; 4]],
    size: Vec3,
    reflectance: f32,
    exitance: f32,
) -> Result<Builtin, BuiltinError> {
    if !(exitance >= 0.0 && exitance.is_finite()) {
        return Err(BuiltinError::Emission(exitance));
    }
    let mut builder = Builder::default();
    let walls = builder.light("walls", Rgb::splat(exitance));
    for face in faces {
        builder.lamp(face, Rgb::splat(reflectance), walls)?;
    }
    Ok(Builtin {
        scene: builder.scene,
        spacing: Spacing {
            patch: 0.5,
            element: 0.25,
        },
        camera: Camera {
            eye: size * Vec3::new(0.9, 0.9, 0.9),
            target: size * 0.5,
            up: Vec3::Y,
            fov: 1.2,
        },
    })
}
