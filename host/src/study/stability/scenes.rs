//! The scenes of the cases, and what is measured on them.

use std::ops::ControlFlow;

use anyhow::Result;
use glam::Vec3;
use relume::color::Rgb;
use relume::mesh::{Mesh, Spacing};
use relume::scene::Surface;

use crate::builtin::{Builder, cuboid, reversed};
use crate::bvh::Bvh;
use crate::mesh;
use crate::reference::closed_form::furnace;
use crate::rows::{Parallel, RowFiller};
use crate::scene::OwnedScene;
use crate::study::system::{Field, System};

/// A scene and how to divide it.
pub struct Stage {
    pub scene: OwnedScene,
    pub spacing: Spacing,
}

impl Stage {
    pub fn new(scene: OwnedScene, patch: f32, element: f32) -> Self {
        let spacing = Spacing { patch, element };
        Self { scene, spacing }
    }

    pub fn bvh(&self) -> Result<Bvh> {
        Ok(Bvh::for_scene(&self.scene.view()?))
    }

    /// The bake's own mesh, divided near the origin, with rows by some method where the scene is.
    pub fn system<F: RowFiller>(&self, filler: impl FnOnce(&Mesh) -> F) -> Result<System> {
        let mut go_on = |_, _| ControlFlow::Continue(());
        let centred = mesh::centred(&self.scene);
        let view = centred.view()?;
        let bvh = Bvh::for_scene(&view);
        let mesh = mesh::build(&self.scene, &view, self.spacing, &bvh, &mut go_on)?;
        let mesh = mesh::placed(&mesh, &self.scene.surfaces);
        let filler = filler(&mesh.view());
        Ok(System::new(mesh, view.lights(), &filler))
    }

    /// The mesh with our rows.
    pub fn exact(&self) -> Result<System> {
        let bvh = self.bvh()?;
        self.system(|mesh| Parallel::new(mesh, &bvh))
    }
}

/// A closed cuboid that emits 1 W/m2 everywhere.
pub fn furnace_box(size: Vec3, reflectance: f32) -> Result<OwnedScene> {
    let mut builder = Builder::default();
    let light = builder.light("walls", Rgb::WHITE);
    for wall in cuboid(Vec3::ZERO, size) {
        builder.lamp(&reversed(wall), Rgb::splat(reflectance), light)?;
    }
    Ok(builder.scene)
}

/// A closed grey cuboid, without a light.
pub fn grey_room(size: Vec3, reflectance: f32) -> Result<Builder> {
    let mut builder = Builder::default();
    for wall in cuboid(Vec3::ZERO, size) {
        builder.surface(&reversed(wall), Rgb::splat(reflectance))?;
    }
    Ok(builder)
}

/// A square that faces down.
pub fn ceiling_square(middle: Vec3, edge: f32) -> [Vec3; 4] {
    let h = edge / 2.0;
    [(-h, -h), (h, -h), (h, h), (-h, h)].map(|(x, z)| middle + Vec3::new(x, 0.0, z))
}

/// The scene with every reflectance scaled so that the largest channel of all is `largest`.
pub fn with_reflectance(scene: &OwnedScene, largest: f32) -> Result<OwnedScene> {
    let brightest = |surface: &Surface| surface.reflectance().get().max_channel();
    let now = scene.surfaces.iter().map(brightest).fold(0.0, f32::max);
    let mut scaled = scene.clone();
    for (surface, number) in scaled.surfaces.iter_mut().zip(0..) {
        let reflectance = surface.reflectance().get() * (largest / now);
        let mut changed = Surface::new(number, surface.polygon().vertices(), reflectance)?;
        if surface.is_two_sided() {
            changed = changed.two_sided();
        }
        *surface = match surface.emission() {
            Some(emission) => changed.emitting(number, emission)?,
            None => changed,
        };
    }
    Ok(scaled)
}

/// Largest relative difference of any element's irradiance from that of the furnace.
pub fn furnace_error(irradiance: &Field, reflectance: f64) -> f64 {
    let truth = furnace(1.0, reflectance);
    let values = irradiance.iter().flatten().flatten();
    values
        .map(|value| (value / truth - 1.0).abs())
        .fold(0.0, f64::max)
}

/// Largest difference of a receiver sum from one.
pub fn sum_error(system: &System) -> f64 {
    let sums = system.receiver_sums().into_iter();
    sums.map(|sum| (sum - 1.0).abs()).fold(0.0, f64::max)
}
