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
mod lanes;
mod view;
mod visible;

use glam::{Vec2, Vec3};
use heapless::Vec;

use crate::geometry::{Polygon, SamplePoint, as_many, from_unit_square};
use crate::mesh::{Face, Mesh};
use crate::visibility::Visibility;

pub use estimate::estimate;
pub use lambert::point_to_polygon;
pub use view::{Receiver, View};

/// Most surfaces that may stand between one receiver and one shooter to be met one by one.
const BLOCKERS: usize = 48;

/// Most surfaces on top of a shooter that are told apart; those beyond hide nothing.
const COVERS: usize = 4;

/// A patch that shoots, with the points at which its visibility is sampled.
#[derive(Clone, Debug)]
pub struct Shooter {
    polygon: Polygon,
    /// What lies on top of it, in its plane.
    covers: Vec<Polygon, COVERS>,
    /// Four interleaved sets of four points, each with its share of the area.
    samples: [Vec<SamplePoint, 4>; 4],
}

impl Shooter {
    /// Places 16 stratified points on the patch, four for each receiver point.
    #[must_use]
    pub fn new(polygon: Polygon) -> Self {
        let set = |offset: Vec2| {
            let places = [(0.0, 0.0), (2.0, 0.0), (0.0, 2.0), (2.0, 2.0)];
            as_many(places.into_iter().map(|(s, t)| {
                let at = (Vec2::new(s, t) + offset + 0.5) / 4.0;
                let (position, density) = from_unit_square(&polygon, at);
                SamplePoint {
                    position,
                    weight: density / 16.0,
                }
            }))
        };
        Self {
            polygon,
            covers: Vec::new(),
            samples: [set(Vec2::ZERO), set(Vec2::ONE), set(Vec2::X), set(Vec2::Y)],
        }
    }

    /// A patch of a mesh, without what lies on top of it; `None` for one that the mesh does not have.
    #[must_use]
    pub fn of_patch(mesh: &Mesh, patch: u32, visibility: &impl Visibility) -> Option<Self> {
        let face = mesh.patches.get(patch as usize)?.face;
        let face = mesh.faces.get(face as usize)?;
        Some(Self::new(mesh.patch_polygon(patch)?).without_covers(face, visibility))
    }

    /// A whole face, without what lies on top of it.
    #[must_use]
    pub fn of_face(face: &Face, visibility: &impl Visibility) -> Self {
        Self::new(face.polygon).without_covers(face, visibility)
    }

    fn without_covers(mut self, face: &Face, visibility: &impl Visibility) -> Self {
        visibility.above(face.surface, face.polygon.normal(), &mut |cover| {
            let _ = self.covers.push(*cover);
        });
        self
    }

    /// A part of it.
    #[must_use]
    pub fn part(&self, polygon: Polygon) -> Self {
        Self {
            covers: self.covers.clone(),
            ..Self::new(polygon)
        }
    }

    /// True for a point of it on which something lies.
    #[must_use]
    pub fn is_covered(&self, point: Vec3) -> bool {
        self.covers.iter().any(|cover| cover.holds(point))
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

    /// What stands between the shooter and a receiver, once for all parts of the receiver.
    #[must_use]
    pub fn seen_by<'s>(&'s self, receiver: &Polygon, visibility: &'s impl Visibility) -> View<'s> {
        View::new(self, receiver, visibility)
    }

    /// `F_ji` of one receiver: what its points see of the patch, averaged over its area.
    #[must_use]
    pub fn form_factor(&self, receiver: &Polygon, visibility: &impl Visibility) -> f32 {
        let view = self.seen_by(receiver, visibility);
        view.form_factor(&Receiver::new(*receiver), visibility)
    }

    /// The form factor from a point with a unit normal to what it sees of the patch, in [0, 1].
    #[must_use]
    pub fn at_point(&self, point: Vec3, normal: Vec3, visibility: &impl Visibility) -> f32 {
        View::of_point(self, point, normal, visibility).at_point(point, visibility)
    }

    /// The same; `None` where blockers are too many to be cut out.
    #[must_use]
    pub fn exact_at_point(
        &self,
        point: Vec3,
        normal: Vec3,
        visibility: &impl Visibility,
    ) -> Option<f32> {
        View::of_point(self, point, normal, visibility).exact_at_point(point)
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
    fill_with(mesh, shooter, first, visibility, row, View::form_factor);
}

/// Fills `row[j]` with what `factor` says of element `first + j`; 0 beyond the mesh.
fn fill_with<'s, V: Visibility>(
    mesh: &Mesh,
    shooter: &'s Shooter,
    first: u32,
    visibility: &'s V,
    row: &mut [f32],
    factor: impl Fn(&View<'s>, &Receiver, &V) -> f32,
) {
    let elements = mesh.elements.get(first as usize..).unwrap_or_default();
    row.fill(0.0);
    let mut near: Option<(u32, View)> = None;
    for (value, element) in row.iter_mut().zip(elements) {
        // Neighbours are of the same patch, for which what stands between is looked up once, and stays where it is: it is large.
        let is_known = |(patch, _): &(u32, View)| *patch == element.patch;
        if !near.as_ref().is_some_and(is_known) {
            let patch = mesh.patch_polygon(element.patch);
            near = patch.map(|patch| (element.patch, shooter.seen_by(&patch, visibility)));
        }
        let receiver = mesh.element_polygon(element).map(Receiver::new);
        if let (Some((_, view)), Some(receiver)) = (&near, receiver) {
            *value = factor(view, &receiver, visibility);
        }
    }
}

/// The whole row of a patch, serially.
///
/// A patch that the mesh does not have gives a row of zeros.
pub fn row(mesh: &Mesh, patch: u32, visibility: &impl Visibility, row: &mut [f32]) {
    match Shooter::of_patch(mesh, patch, visibility) {
        Some(shooter) => fill(mesh, &shooter, 0, visibility, row),
        None => row.fill(0.0),
    }
}

#[cfg(test)]
mod tests;
