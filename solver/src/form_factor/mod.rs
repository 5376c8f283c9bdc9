//! One row of form factors: from every receiving element to one shooting patch.
//!
//! `F_ji`, the fraction of element `j`'s view that patch `i` fills (the average over `j`), is
//! Lambert's formula ([`point_to_polygon`]) for what the points of the element see of the patch:
//! the patch above the point's horizon minus the shadow pyramids of all that stands between, cut exactly.
//! Shooting `dB_i` raises the irradiance of `j` by `dB_i F_ji`: by reciprocity
//! `F_ji = F_ij A_i / A_j`, so the receiver's own factor is all that a row has to hold.
//!
//! Assumptions: planar convex patches that radiate evenly from their front. Receiver points are
//! the Gauss points of the element (2 x 2 on quads, 3 on triangles), the same for every patch, so that what an
//! element receives from a closed scene sums to one. Where so many blockers overlap that the
//! scratch memory is full, the open factor is multiplied by the visible share of the kernel
//! `cos a cos b / r^2` at 4 of 16 stratified points of the patch. Factors are finite and in [0, 1];
//! a coplanar or back-facing pair gives 0.

mod estimate;
mod lambert;
mod visible;

use glam::{Vec2, Vec3};
use heapless::Vec;

use crate::geometry::{Clipped, Polygon, SamplePoint, from_unit_square, gauss_points};
use crate::mesh::Mesh;
use crate::visibility::{Shaft, Visibility};

pub use estimate::estimate;
pub use lambert::point_to_polygon;

use lambert::{above_horizon, lambert, open_factor};
use visible::visible_factor;

/// Most surfaces that may stand between one receiver and one shooter to be cut out exactly.
const BLOCKERS: usize = 32;

/// A patch that shoots, with the points at which its visibility is sampled.
#[derive(Clone, Debug)]
pub struct Shooter {
    polygon: Polygon,
    /// Four interleaved sets of four points, each with its share of the area.
    samples: [Vec<SamplePoint, 4>; 4],
}

impl Shooter {
    /// Places 16 stratified points on the patch, four for each receiver point.
    #[must_use]
    pub fn new(polygon: Polygon) -> Self {
        let set = |offset: Vec2| {
            [(0.0, 0.0), (2.0, 0.0), (0.0, 2.0), (2.0, 2.0)]
                .into_iter()
                .map(|(s, t)| {
                    let at = (Vec2::new(s, t) + offset + 0.5) / 4.0;
                    let (position, density) = from_unit_square(&polygon, at);
                    SamplePoint {
                        position,
                        weight: density / 16.0,
                    }
                })
                .collect()
        };
        Self {
            polygon,
            samples: [set(Vec2::ZERO), set(Vec2::ONE), set(Vec2::X), set(Vec2::Y)],
        }
    }

    /// The polygon that shoots.
    #[must_use]
    pub const fn polygon(&self) -> &Polygon {
        &self.polygon
    }

    /// True when the receiver or the shooter lies wholly behind the other, or in its plane.
    #[must_use]
    pub fn is_out_of_sight(&self, receiver: &Polygon) -> bool {
        faces_away(&self.polygon, receiver) || faces_away(receiver, &self.polygon)
    }

    /// `F_ji` of one receiver: what its points see of the patch, averaged over its area.
    #[must_use]
    pub fn form_factor(&self, receiver: &Polygon, visibility: &impl Visibility) -> f32 {
        if self.is_out_of_sight(receiver) {
            return 0.0;
        }
        let blockers = blockers(|| Shaft::new(receiver, &self.polygon), visibility);
        let blockers = blockers.as_deref();
        let points = gauss_points(receiver);
        let factors = points.iter().zip(&self.samples).map(|(point, samples)| {
            point.weight
                * self.seen_from(
                    point.position,
                    receiver.normal(),
                    samples,
                    blockers,
                    visibility,
                )
        });
        factors.sum::<f32>().min(1.0)
    }

    /// The form factor from a point with a unit normal to what it sees of the patch, in [0, 1].
    #[must_use]
    pub fn at_point(&self, point: Vec3, normal: Vec3, visibility: &impl Visibility) -> f32 {
        self.exact_at_point(point, normal, visibility)
            .unwrap_or_else(|| {
                let samples = self.samples.iter().flatten().copied();
                let samples: Vec<SamplePoint, 16> = samples.collect();
                let factor = self.seen_from(point, normal, &samples, None, visibility);
                factor.min(1.0)
            })
    }

    /// The same; `None` where blockers are too many to be cut out.
    #[must_use]
    pub fn exact_at_point(
        &self,
        point: Vec3,
        normal: Vec3,
        visibility: &impl Visibility,
    ) -> Option<f32> {
        let (height, tolerance) = self.polygon.height(point);
        if height <= tolerance {
            return Some(0.0);
        }
        let shaft = || Shaft::from_point(point, normal, &self.polygon);
        let blockers = blockers(shaft, visibility)?;
        let factor = self.exact(point, normal, &blockers)?;
        Some(factor.clamp(0.0, 1.0))
    }

    /// The form factor from a point with a unit normal to the patch, unoccluded, in [0, 1].
    #[must_use]
    pub fn open_at_point(&self, point: Vec3, normal: Vec3) -> f32 {
        let (height, tolerance) = self.polygon.height(point);
        if height <= tolerance {
            return 0.0;
        }
        point_to_polygon(point, normal, self.polygon.vertices())
    }

    /// What a point with a unit normal sees of the patch, not below zero.
    ///
    /// `blockers` are all that can stand between, or `None` for too many to cut out.
    fn seen_from(
        &self,
        point: Vec3,
        normal: Vec3,
        samples: &[SamplePoint],
        blockers: Option<&[&Polygon]>,
        visibility: &impl Visibility,
    ) -> f32 {
        let (height, tolerance) = self.polygon.height(point);
        if height <= tolerance {
            return 0.0;
        }
        let exact = blockers.and_then(|blockers| self.exact(point, normal, blockers));
        exact
            .unwrap_or_else(|| self.sampled(point, normal, samples, visibility))
            .max(0.0)
    }

    /// The factor of what is visible; `None` when the blockers are too many to be cut out.
    fn exact(&self, point: Vec3, normal: Vec3, blockers: &[&Polygon]) -> Option<f32> {
        if blockers.is_empty() {
            return Some(open_factor(point, normal, self.polygon.vertices()));
        }
        let outline = above_horizon(point, normal, self.polygon.vertices());
        visible_factor(point, normal, &self.polygon, outline, blockers)
    }

    /// Lambert's factor times the visible share of the kernel at some points of the patch.
    fn sampled(
        &self,
        point: Vec3,
        normal: Vec3,
        samples: &[SamplePoint],
        visibility: &impl Visibility,
    ) -> f32 {
        let above = above_horizon(point, normal, self.polygon.vertices());
        let open = lambert(normal, &above);
        if open <= 0.0 {
            return 0.0;
        }
        let visible = self.visible_share(point, normal, samples, visibility);
        open * visible.unwrap_or_else(|| sees_middle(point, &above, visibility))
    }

    /// Share of the kernel that is not hidden; `None` when every sample is below the horizon.
    fn visible_share(
        &self,
        point: Vec3,
        normal: Vec3,
        samples: &[SamplePoint],
        visibility: &impl Visibility,
    ) -> Option<f32> {
        let (mut seen, mut total) = (0.0, 0.0);
        for sample in samples {
            let ray = sample.position - point;
            let square = ray.length_squared();
            let cosines = ray.dot(normal) * -ray.dot(self.polygon.normal());
            if cosines <= 0.0 || square <= f32::MIN_POSITIVE {
                continue;
            }
            let kernel = sample.weight * cosines / (square * square);
            total += kernel;
            if visibility.sees(point, sample.position) {
                seen += kernel;
            }
        }
        (total > 0.0 && total.is_finite()).then(|| (seen / total).min(1.0))
    }
}

/// 1 when the middle of what is above the horizon is visible, else 0.
fn sees_middle(point: Vec3, above: &Clipped, visibility: &impl Visibility) -> f32 {
    let middle = above.iter().copied().sum::<Vec3>() / above.len().max(1) as f32;
    f32::from(u8::from(visibility.sees(point, point + middle)))
}

/// All that a shaft admits; `None` when it is too much to be cut out.
fn blockers(
    shaft: impl FnOnce() -> Shaft,
    visibility: &impl Visibility,
) -> Option<Vec<&Polygon, BLOCKERS>> {
    let mut blockers = Vec::new();
    let mut fits = true;
    if visibility.may_block() {
        visibility.between(&shaft(), &mut |blocker| {
            fits &= blockers.push(blocker).is_ok();
        });
    }
    fits.then_some(blockers)
}

/// True when all of `other` lies behind the plane of `polygon`, or in it.
fn faces_away(polygon: &Polygon, other: &Polygon) -> bool {
    other.vertices().iter().all(|v| {
        let (height, tolerance) = polygon.height(*v);
        height <= tolerance
    })
}

/// Fills `row[j]` with the form factor of element `first + j` to the shooter.
///
/// Slices of one row may be filled in any order, by several threads.
/// Elements beyond the mesh get 0.
pub fn fill(
    mesh: &Mesh,
    shooter: &Shooter,
    first: u32,
    visibility: &impl Visibility,
    row: &mut [f32],
) {
    fill_with(mesh, first, row, |receiver| {
        shooter.form_factor(receiver, visibility)
    });
}

/// Fills `row[j]` with what `factor` says of element `first + j`; 0 beyond the mesh.
fn fill_with(mesh: &Mesh, first: u32, row: &mut [f32], factor: impl Fn(&Polygon) -> f32) {
    let elements = mesh.elements.get(first as usize..).unwrap_or_default();
    row.fill(0.0);
    for (value, element) in row.iter_mut().zip(elements) {
        if let Some(receiver) = mesh.element_polygon(element) {
            *value = factor(&receiver);
        }
    }
}

/// The whole row of a patch, serially.
///
/// A patch that the mesh does not have gives a row of zeros.
pub fn row(mesh: &Mesh, patch: u32, visibility: &impl Visibility, row: &mut [f32]) {
    let Some(polygon) = mesh.patch_polygon(patch) else {
        row.fill(0.0);
        return;
    };
    fill(mesh, &Shooter::new(polygon), 0, visibility, row);
}

#[cfg(test)]
mod tests;
