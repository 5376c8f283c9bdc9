//! Rows as others fill them.

use glam::Vec3;
use relume::form_factor::{Shooter, point_to_polygon};
use relume::geometry::Polygon;
use relume::luminaire;
use relume::mesh::Mesh;
use relume::scene::{Luminaire, Surface};
use relume::visibility::{Obstacle, Occluders, Shaft, Visibility};

use crate::rows::RowFiller;
use crate::study::system::System;

/// The kernel between two centres, `F_ji = cos a cos b A_i / (pi r^2)`, at most one; 0 where `sees` says so.
pub fn point_to_point(receiver: &Polygon, shooter: &Polygon) -> f32 {
    let ray = shooter.center() - receiver.center();
    let square = ray.length_squared();
    let cosines = ray.dot(receiver.normal()).max(0.0) * (-ray.dot(shooter.normal())).max(0.0);
    if cosines <= 0.0 {
        return 0.0;
    }
    (cosines / square / square * shooter.area() / std::f32::consts::PI).min(1.0)
}

/// Lambert's formula from the centre of the receiver.
pub fn point_to_patch(receiver: &Polygon, shooter: &Polygon) -> f32 {
    point_to_polygon(receiver.center(), receiver.normal(), shooter.vertices())
}

/// Rows of a kernel, times one ray between the centres.
pub struct Kernel<'a, V> {
    pub kernel: fn(&Polygon, &Polygon) -> f32,
    pub visibility: &'a V,
}

impl<V: Visibility> RowFiller for Kernel<'_, V> {
    fn visibility(&self) -> &impl Visibility {
        self.visibility
    }

    fn luminaire(&self, mesh: &Mesh, luminaire: &Luminaire, far: f32, row: &mut [f32]) {
        luminaire::fill(mesh, luminaire, far, 0, self.visibility, row);
    }

    fn shooter(&self, mesh: &Mesh, shooter: &Shooter, row: &mut [f32]) {
        let shooter = shooter.polygon();
        row.fill(0.0);
        for (factor, element) in row.iter_mut().zip(mesh.elements) {
            let Some(receiver) = mesh.element_polygon(element) else {
                continue;
            };
            if self.visibility.sees(receiver.center(), shooter.center()) {
                *factor = (self.kernel)(&receiver, shooter);
            }
        }
    }
}

/// Nothing blocks, as before there was a way to tell (Goral et al. 1984).
pub const UNOCCLUDED: Occluders = Occluders(&[]);

/// How far rays start from surfaces, whatever the scene's unit is (`RAY_EPSILON` of pbrt, first edition).
pub const RAY_EPSILON: f32 = 1e-3;

/// Rays that begin and end a fixed length, in the scene's units, from the surfaces that they join.
pub struct EpsilonRays<'a> {
    pub surfaces: &'a [Surface],
    pub epsilon: f32,
}

impl EpsilonRays<'_> {
    /// True where the segment meets the polygon's plane inside its outline, with no regard to rounding.
    fn meets(polygon: &Polygon, from: Vec3, to: Vec3) -> bool {
        let normal = polygon.normal();
        let fraction = normal.dot(polygon.origin() - from) / normal.dot(to - from);
        if !(0.0..=1.0).contains(&fraction) {
            return false;
        }
        let at = from + (to - from) * fraction;
        let mut edges = polygon.edges();
        edges.all(|(a, b)| (b - a).cross(at - a).dot(normal) >= 0.0)
    }
}

impl Visibility for EpsilonRays<'_> {
    fn sees(&self, from: Vec3, to: Vec3) -> bool {
        let step = (to - from).normalize_or_zero() * self.epsilon;
        let (from, to) = (from + step, to - step);
        let mut polygons = self.surfaces.iter().map(Surface::polygon);
        !polygons.any(|polygon| Self::meets(polygon, from, to))
    }

    fn between<'v>(&'v self, _: &Shaft, _: &mut impl FnMut(Obstacle<'v>)) {}
}

/// The same rows, all longer or shorter by a factor.
pub fn scaled(system: &System, factor: f32) -> System {
    let rows = system.rows.iter().map(|f| (f * factor).min(1.0));
    System {
        rows: rows.collect(),
        ..system.clone()
    }
}

/// The same rows, every receiver's divided by their sum (West 2007, "each form-factor is divided by
/// the sum of the form-factors for a given face").
pub fn normalised(system: &System) -> System {
    let sums = system.receiver_sums();
    let n = sums.len();
    let value = |(at, factor): (usize, &f32)| {
        let sum = sums[at % n] as f32;
        if sum > 0.0 { factor / sum } else { 0.0 }
    };
    System {
        rows: system.rows.iter().enumerate().map(value).collect(),
        ..system.clone()
    }
}
