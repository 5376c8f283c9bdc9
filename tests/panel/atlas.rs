//! The atlas of the panel: the flat baked, its lights pictured one by one, and the pictures packed.

use std::ops::ControlFlow;

use anyhow::Result;
use relume::atlas::Quantity;
use relume::code::Code;
use relume_host::bake::{Settings, bake};
use relume_host::builtin::{Builtin, flat};
use relume_host::export::light_layers::contributions;
use relume_host::pack::{Format, pack};
use relume_host::preview::{Camera, Viewpoint, light_layers};
use relume_panel::{BRIGHTEST, EXPOSURE, PICTURE};

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
    let mut layers = light_layers(&solution, &camera)?;
    for (_, layer) in &mut layers {
        layer
            .pixels
            .iter_mut()
            .for_each(|pixel| limit(pixel, BRIGHTEST / EXPOSURE));
    }
    let (picture, _) = contributions(&layers);
    let format = Format {
        packing: Code::Display8.into(),
        quantity: Quantity::Radiance,
        mesh: false,
    };
    Ok(pack(&picture, format)?)
}

/// Darkens a pixel that is too bright, and keeps its hue.
fn limit([r, g, b, _]: &mut [f32; 4], brightest: f32) {
    let excess = r.max(*g).max(*b) / brightest;
    if excess > 1.0 {
        [r, g, b].into_iter().for_each(|value| *value /= excess);
    }
}
