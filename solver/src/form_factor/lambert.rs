//! Lambert's formula: what share of a point's view a polygon fills.
//!
//! `F = 1/(2 pi) sum_k theta_k (r_k x r_k+1) . n / |r_k x r_k+1|`
//!
//! `r_k` run from the point to the vertices, `n` is the unit normal at the point and `theta_k` the
//! angle between `r_k` and `r_k+1` (Lambert 1760; Baum, Rushmeier and Winget 1989, eq. 6). With `r_k` scaled
//! to length one, what stands before `n` is `r_k x r_k+1` times the angle over its sine, which is smooth where
//! the angle is small: a function of the cosine alone up to a right angle, and from there pi over the
//! sine less that of the angle's supplement.

use core::f32::consts::PI;

use glam::Vec3;
use heapless::Vec;

use super::lanes::{Numbers, Vectors};
use crate::geometry::{Clipped, as_many, clip};
use crate::math;

/// Most corners that pieces of a polygon may have.
pub(super) const CORNERS: usize = 12;

/// A convex outline as four points see it, relative to each.
pub(super) type Outline = Vec<Vectors, CORNERS>;

/// The form factor from a point with a unit normal to the front of a polygon, unoccluded.
///
/// In [0, 1]; 0 for a point behind the polygon or in its plane.
#[must_use]
pub fn point_to_polygon(point: Vec3, normal: Vec3, outline: &[Vec3]) -> f32 {
    let relative: Clipped = as_many(outline.iter().map(|v| *v - point).take(7));
    let above = clip(&relative, |v| v.dot(normal));
    let seen: Outline = as_many(above.iter().map(|v| Vectors::all(*v)));
    let Numbers([factor, ..]) = lambert(normal, &seen);
    factor.clamp(0.0, 1.0)
}

/// Lambert's sum over the edges of an outline above the horizon; above zero for a front, but
/// for rounding.
pub(super) fn lambert(normal: Vec3, outline: &[Vectors]) -> Numbers {
    let Some(last) = outline.last() else {
        return Numbers::ZERO;
    };
    let normal = Vectors::all(normal);
    let shrink = |v: &Vectors| v.dot(*v).map(math::reciprocal_sqrt);
    let mut sum = Numbers::ZERO;
    let (mut a, mut shrink_a) = (*last, shrink(last));
    for b in outline {
        let shrink_b = shrink(b);
        let scale = shrink_a * shrink_b;
        // The edge itself is known better than the difference of two long products.
        let sine = a.cross(*b - a) * scale;
        let cosine = a.dot(*b) * scale;
        let mut ratio = cosine.map(|x| math::angle_over_sine(x.abs()));
        if Numbers::ZERO.above(cosine) != 0 {
            let straight = sine
                .dot(sine)
                .map(|square| PI * math::reciprocal_sqrt(square));
            ratio = ratio.if_negative(cosine, straight - ratio);
        }
        sum = sum + sine.dot(normal) * ratio;
        (a, shrink_a) = (*b, shrink_b);
    }
    // Counter-clockwise from its front is clockwise for who looks along his own normal.
    sum * Numbers::all(-0.5 / PI)
}
