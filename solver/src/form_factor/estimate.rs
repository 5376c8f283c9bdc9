//! A cheaper row: the unoccluded factor times a few segments of visibility.
//!
//! Where nothing stands between, `F_ji` is Lambert's formula `L` from the middle of element `j` to patch `i`, or its
//! average over the receiver points where the patch is near. Where something does,
//!
//! `F_ji = sum_g w_g L(x_g, P_i) V(x_g, y_g)`
//!
//! with a weight `w_g` for each receiver point `x_g`, and `V` 1 where nothing crosses the segment from there to its
//! own point `y_g` of the patch, or lies on top of it, else 0. The analytic factor: Baum, Rushmeier and Winget 1989; segments to a
//! stratified shooter: Wallace, Elmquist and Haines 1989.
//!
//! Assumption: whoever asks knows better what such factors add up to, and scales them
//! ([`crate::refine::Refinement::close`]).

use glam::Vec3;

use super::lanes::Numbers;
use super::{Receiver, Shooter, View, fill_with};
use crate::geometry::Polygon;
use crate::mesh::Mesh;
use crate::visibility::Visibility;

/// Longest edges of a receiver within which a patch is near: beyond, the factor of the middle is within 1 % of the
/// average, since an inverse square changes by `(1/3)^2 / 12` over three edges.
const NEAR: f32 = 3.0;

impl View<'_> {
    /// An estimate of [`Self::form_factor`], in [0, 1].
    #[must_use]
    pub fn estimate(&self, receiver: &Receiver, visibility: &impl Visibility) -> f32 {
        if self.is_hidden() {
            return 0.0;
        }
        let shooter = self.shooter();
        if self.is_open() && !shooter.is_near(receiver.polygon()) {
            return shooter.open_at_point(receiver.polygon().center(), self.normal());
        }
        let Numbers(mut factors) = self.open_factors(receiver);
        if !self.is_open() {
            let segments = receiver.positions().into_iter().zip(shooter.own_points());
            for (factor, (from, to)) in factors.iter_mut().zip(segments) {
                let is_seen = || !shooter.is_covered(to) && visibility.sees(from, to);
                if *factor > 0.0 && !is_seen() {
                    *factor = 0.0;
                }
            }
        }
        receiver.average(Numbers(factors))
    }
}

impl Shooter {
    /// True when the middle of the receiver does not stand for all of it.
    #[must_use]
    pub fn is_near(&self, receiver: &Polygon) -> bool {
        let reach = (NEAR * receiver.longest_edge()).max(self.polygon.longest_edge());
        (receiver.center() - self.polygon.center()).length_squared() < reach * reach
    }

    /// A point of the patch for each receiver point, no two of them in one quarter, row or column of the sixteen.
    fn own_points(&self) -> impl Iterator<Item = Vec3> + '_ {
        let sets = self.samples.iter().enumerate();
        sets.filter_map(|(number, set)| Some(set.get(number)?.position))
    }
}

/// Fills `row[j]` with an estimate of the form factor of element `first + j` to the shooter, as
/// [`fill`](super::fill) does with the factor itself.
pub fn estimate(
    mesh: &Mesh,
    shooter: &Shooter,
    first: u32,
    visibility: &impl Visibility,
    row: &mut [f32],
) {
    fill_with(mesh, shooter, first, visibility, row, View::estimate);
}
