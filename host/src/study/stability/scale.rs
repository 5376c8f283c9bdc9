//! Cases about size and place: the same scene, larger, smaller, and far away.

use std::ops::ControlFlow;

use anyhow::Result;
use glam::Vec3;
use relume::mesh::Spacing;
use relume::scene::Surface;

use super::Case;
use super::naive::{EpsilonRays, Kernel, RAY_EPSILON, point_to_patch};
use super::scenes::Stage;
use crate::bake::{Settings, bake};
use crate::builtin::{Builtin, PaperLamps, paper_room};
use crate::scene::OwnedScene;
use crate::study::system::{Field, System, Way};

pub fn cases() -> Result<Vec<Case>> {
    let room = paper_room(PaperLamps::Eight)?;
    let rounding = "unit emission does not depend on the unit of length; vertices round to 6e-8";
    Ok(vec![
        case(&room, "scaled by 1e-3", 1e-3, 0.0, 1e-4, rounding)?,
        case(&room, "scaled by 1e3", 1e3, 0.0, 1e-4, rounding)?,
        case(
            &room,
            "moved by 1e4",
            1.0,
            1e4,
            0.02,
            "lamps of 0.2 m have edges rounded to 1e-3 m: 0.5 % each, twice for the area, in each direction",
        )?,
    ])
}

/// What a scene's irradiance differs from that of the same scene at home.
fn case(
    room: &Builtin,
    what: &str,
    scale: f32,
    offset: f32,
    bound: f64,
    why: &'static str,
) -> Result<Case> {
    let changed = placed(&room.scene, scale, offset)?;
    // A hundredth to spare, so that rounded edges are not cut once more.
    let spacing = |scale| Spacing {
        patch: 1.01 * room.spacing.patch * scale,
        element: 1.01 * room.spacing.element * scale,
    };
    let home = with_epsilon(&room.scene, spacing(1.0))?;
    let system = &home.0;
    let naive = with_epsilon(&changed, spacing(scale))?;
    let (at_home, away) = (
        baked(&room.scene, spacing(1.0))?,
        baked(&changed, spacing(scale))?,
    );
    Ok(Case {
        name: format!("scene {what}"),
        quantity: "worst-light difference from the scene as it is, paper's room with 8 lights",
        method: "rays that start 1e-3 off every surface (pbrt's RAY_EPSILON, Pharr and Humphreys 2004)",
        naive: system.worst_error(&naive.1, &home.1),
        ours: system.worst_error(&away, &at_home),
        bound,
        why,
    })
}

fn placed(scene: &OwnedScene, scale: f32, offset: f32) -> Result<OwnedScene> {
    let mut placed = scene.clone();
    for (surface, number) in placed.surfaces.iter_mut().zip(0..) {
        let vertices = surface.polygon().vertices().iter();
        let vertices: Vec<Vec3> = vertices.map(|v| *v * scale + Vec3::splat(offset)).collect();
        let mut moved = Surface::new(number, &vertices, surface.reflectance().get())?;
        if surface.is_two_sided() {
            moved = moved.two_sided();
        }
        *surface = match surface.emission() {
            Some(emission) => moved.emitting(number, emission)?,
            None => moved,
        };
    }
    Ok(placed)
}

fn with_epsilon(scene: &OwnedScene, spacing: Spacing) -> Result<(System, Field)> {
    let rays = EpsilonRays {
        surfaces: &scene.surfaces,
        epsilon: RAY_EPSILON,
    };
    let stage = Stage::new(scene.clone(), spacing.patch, spacing.element);
    let system = stage.system(|_| Kernel {
        kernel: point_to_patch,
        visibility: &rays,
    })?;
    let field = system.refine(Way::kept(u32::MAX, 1e-6))?.irradiance;
    Ok((system, field))
}

fn baked(scene: &OwnedScene, spacing: Spacing) -> Result<Field> {
    let settings = Settings {
        patch: Some(spacing.patch),
        element: Some(spacing.element),
        ..Settings::default()
    };
    let solution = bake(scene, &settings, &mut |_| ControlFlow::Continue(()))?;
    let lights = solution.lights.len();
    let values = solution.contributions.chunks(lights);
    let rgb = |value: &relume::color::Rgb| value.to_array().map(f64::from);
    Ok(values
        .map(|values| values.iter().map(rgb).collect())
        .collect())
}
