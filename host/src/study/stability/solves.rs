//! Cases about the solve: rows that are too long, overshooting, 16-bit state, bright walls, unequal lights.

use anyhow::Result;
use glam::Vec3;
use relume::color::Rgb;

use super::Case;
use super::naive::scaled;
use super::scenes::{
    Stage, ceiling_square, furnace_box, furnace_error, grey_room, with_reflectance,
};
use crate::builtin::{PaperLamps, paper_room};
use crate::study::shooting::{Variant, shoot};
use crate::study::system::{System, Way};

/// Shots after which a loop that has not converged is looked at.
const MANY: u32 = 4000;

/// What receiver sums are off by at most, see `touching elements`.
const SUMS: f64 = 1e-5;

pub fn cases() -> Result<Vec<Case>> {
    Ok(vec![
        long_rows(1.02, 0.95)?,
        long_rows(1.1, 0.95)?,
        long_rows(1.02, 0.99)?,
        long_rows(1.1, 0.99)?,
        bright_walls()?,
        overshooting()?,
        half_floats()?,
        unequal_lights()?,
    ])
}

/// A furnace with rows that are all too long by a factor, and with ours.
fn long_rows(factor: f32, reflectance: f32) -> Result<Case> {
    let ours = Stage::new(furnace_box(Vec3::ONE, reflectance)?, 0.5, 0.25).exact()?;
    let long = scaled(&ours, factor);
    let rho = f64::from(reflectance);
    let naive = long.refine(Way::published(MANY, 1e-4))?.irradiance;
    let solved = ours.refine(Way::kept(u32::MAX, 1e-6))?.irradiance;
    Ok(Case {
        name: format!("row sums of {factor} at reflectance {reflectance}"),
        quantity: "largest relative error of irradiance, furnace",
        method: "plain shooting takes row sums as they come (Cohen et al. 1988)",
        naive: furnace_error(&naive, rho),
        ours: furnace_error(&solved, rho),
        bound: SUMS / (1.0 - rho),
        why: "our receiver sums are one to 1e-5, and 1 / (1 - rho) bounces repeat the error",
    })
}

fn bright_walls() -> Result<Case> {
    let rho = 0.999;
    let system = Stage::new(furnace_box(Vec3::ONE, rho as f32)?, 0.5, 0.25).exact()?;
    let naive = system.refine(Way::published(100, 1e-6))?.irradiance;
    let ours = system.refine(Way::kept(u32::MAX, 1e-6))?.irradiance;
    Ok(Case {
        name: "reflectance 0.999".into(),
        quantity: "largest relative error of irradiance, furnace",
        method: "100 plain shots (Nielsen and Christensen 2002)",
        naive: furnace_error(&naive, rho),
        ours: furnace_error(&ours, rho),
        bound: SUMS / (1.0 - rho),
        why: "our receiver sums are one to 1e-5, and 1 / (1 - rho) bounces repeat the error",
    })
}

/// The paper's room with eight lights, its reflectances scaled, and its exact rows.
fn bright_room(reflectance: f32) -> Result<System> {
    let room = paper_room(PaperLamps::Eight)?;
    let scene = with_reflectance(&room.scene, reflectance)?;
    Stage::new(scene, room.spacing.patch, room.spacing.element).exact()
}

fn overshooting() -> Result<Case> {
    let system = bright_room(0.95)?;
    let truth = system.dense()?.irradiance;
    let ours = system.refine(Way::kept(u32::MAX, 1e-6))?;
    let naive = shoot(&system, Variant::Overshooting, ours.shooters.len() as u32);
    Ok(Case {
        name: "overshooting at reflectance 0.95".into(),
        quantity: "worst-light error, paper's room with 8 lights, after as many rows",
        method: "positive overshooting by the ambient term (Feda and Purgathofer 1992)",
        naive: system.worst_error(&naive, &truth),
        ours: system.worst_error(&ours.irradiance, &truth),
        bound: 1e-4,
        why: "the known rows are solved to 1e-7 of the light, less what f32 rounds",
    })
}

fn half_floats() -> Result<Case> {
    let system = bright_room(0.99)?;
    let truth = system.dense()?.irradiance;
    let naive = shoot(&system, Variant::Half, MANY);
    let ours = system.refine(Way::kept(u32::MAX, 1e-6))?.irradiance;
    Ok(Case {
        name: "state in 16-bit floats".into(),
        quantity: "worst-light error after convergence, paper's room with 8 lights, reflectance 0.99",
        method: "plain shooting on half floats, 4000 shots",
        naive: system.worst_error(&naive, &truth),
        ours: system.worst_error(&ours, &truth),
        bound: 1e-4,
        why: "f32 state, known rows solved to 1e-7 of the light",
    })
}

/// A lamp of 1 m2 beside one of 1 mm2.
fn unequal_lights() -> Result<Case> {
    let mut room = grey_room(Vec3::splat(3.0), 0.8)?;
    for (name, x, edge) in [("large", 0.75, 1.0), ("small", 2.25, 1e-3)] {
        let light = room.light(name, Rgb::WHITE);
        let lamp = ceiling_square(Vec3::new(x, 2.75, 1.5), edge);
        room.lamp(&lamp, Rgb::BLACK, light)?;
    }
    let system = Stage::new(room.scene, 1.0, 0.25).exact()?;
    let truth = system.dense()?.irradiance;
    let shots = 100;
    let naive = system.refine(Way::published(shots, 1e-6))?;
    let ours = system.refine(Way::kept(shots, 1e-6))?;
    Ok(Case {
        name: "lights of power ratio 10^6".into(),
        quantity: "worst-light error after 100 shots, room of 3 m with reflectance 0.8",
        method: "the largest sum of unshot power is next (Nielsen and Christensen 2002, Fig. 2)",
        naive: system.worst_error(&naive.irradiance, &truth),
        ours: system.worst_error(&ours.irradiance, &truth),
        bound: 1e-4,
        why: "every light converges relative to its own power; known rows are solved to 1e-7",
    })
}
