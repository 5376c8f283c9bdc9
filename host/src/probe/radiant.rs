//! Patches as they look from afar.

use glam::Vec3;
use relume::color::Rgb;
use relume::form_factor::Shooter;

use crate::bvh::Bvh;
use crate::solution::Solution;

/// Patches that are farther than so many of their longest edges count as constant.
const FAR: f32 = 6.0;

/// A patch as it looks from afar.
pub(super) struct RadiantPatch {
    pub shooter: Shooter,
    center: Vec3,
    /// Square of the distance from the middle beyond which it is far.
    far: f32,
    /// Reflected radiosity by every light at unit emission, W/m2.
    pub radiosity: Vec<Rgb>,
}

impl RadiantPatch {
    pub fn is_far(&self, point: Vec3) -> bool {
        point.distance_squared(self.center) > self.far
    }
}

/// All patches by number.
pub(super) fn radiant_patches(solution: &Solution, bvh: &Bvh) -> Vec<RadiantPatch> {
    let mesh = solution.mesh.view();
    let mut radiosities = vec![vec![Rgb::BLACK; solution.lights.len()]; mesh.patches.len()];
    let mut areas = vec![0.0; mesh.patches.len()];
    for (id, element) in mesh.elements.iter().enumerate() {
        areas[element.patch as usize] += element.area * solution.exposed(id);
    }
    for (element, id) in mesh.elements.iter().zip(0..) {
        let patch = element.patch as usize;
        let share = element.reflectance * (element.area / areas[patch]);
        for (sum, value) in radiosities[patch].iter_mut().zip(solution.element(id)) {
            *sum += share * *value;
        }
    }
    let patches = (0..).zip(radiosities).filter_map(|(patch, radiosity)| {
        let shooter = Shooter::of_patch(&mesh, patch, bvh)?;
        let polygon = *shooter.polygon();
        Some(RadiantPatch {
            shooter,
            center: polygon.center(),
            far: (FAR * polygon.longest_edge()).powi(2),
            radiosity,
        })
    });
    patches.collect()
}
