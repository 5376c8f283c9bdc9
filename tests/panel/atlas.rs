//! The atlas of the panel: the flat baked, its lights pictured one by one, and the pictures packed.

use std::ops::ControlFlow;

use anyhow::Result;
use relume::atlas::Quantity;
use relume_host::bake::{Settings, bake};
use relume_host::builtin::{Builtin, flat};
use relume_host::export::light_layers::{contributions, layers};
use relume_host::pack::{Aim, Request, choose};
use relume_host::preview::{Camera, Viewpoint};
use relume_panel::PICTURE;

/// Display codes that packing may cost: a step of the display is four to eight.
const MAX_ERROR: f32 = 2.0;

/// Bakes the flat and packs its picture.
pub fn atlas() -> Result<Vec<u8>> {
    let Builtin {
        scene,
        spacing,
        camera,
    } = flat()?;
    let settings = Settings {
        patch: Some(spacing.patch),
        element: Some(spacing.element),
        ..Settings::default()
    };
    let solution = bake(&scene, &settings, &mut |_| ControlFlow::Continue(()))?;
    let viewpoint = Viewpoint {
        eye: camera.eye,
        target: camera.target,
        up: camera.up,
        fov: camera.fov,
    };
    let camera = Camera::new(viewpoint, PICTURE.size.width, PICTURE.size.height)?;
    let (picture, _) = contributions(&layers(&solution, &camera, f32::INFINITY)?);
    let request = Request {
        aim: Aim::Error(MAX_ERROR),
        given: &vec![None; picture.lights.len()],
        quantity: Quantity::Radiance,
        mesh: false,
    };
    Ok(choose(&picture, request)?.bytes)
}
