//! Lambert's formula: what share of a point's view a polygon fills.
//!
//! `F = 1/(2 pi) sum_k theta_k (r_k x r_k+1) . n / |r_k x r_k+1|`
//!
//! `r_k` run from the point to the vertices, `n` is the unit normal at the point and `theta_k` the
//! angle between `r_k` and `r_k+1` (Lambert 1760; Baum, Rushmeier and Winget 1989, eq. 6).

use core::f32::consts::PI;

use glam::Vec3;

use crate::geometry::{Clipped, MAX_VERTICES, clip};
use crate::math;

/// Squared tangent below which an angle is summed as a series: the fifth term is 3e-7 of the first.
const SMALL: f32 = 0.04;

/// The form factor from a point with a unit normal to the front of a polygon, unoccluded.
///
/// In [0, 1]; 0 for a point behind the polygon or in its plane.
#[must_use]
pub fn point_to_polygon(point: Vec3, normal: Vec3, outline: &[Vec3]) -> f32 {
    open_factor(point, normal, outline).clamp(0.0, 1.0)
}

/// Lambert's sum for what is above the horizon; above zero for a front, but for rounding.
pub(super) fn open_factor(point: Vec3, normal: Vec3, outline: &[Vec3]) -> f32 {
    // Most outlines are above the horizon as they are.
    let mut relative = [Vec3::ZERO; MAX_VERTICES];
    let mut is_above = outline.len() <= MAX_VERTICES;
    for (relative, vertex) in relative.iter_mut().zip(outline) {
        *relative = *vertex - point;
        is_above &= relative.dot(normal) >= 0.0;
    }
    match relative.get(..outline.len()) {
        Some(outline) if is_above => lambert(normal, outline),
        _ => lambert(normal, &above_horizon(point, normal, outline)),
    }
}

/// The outline relative to `point`, without what lies below the horizon.
pub(super) fn above_horizon(point: Vec3, normal: Vec3, outline: &[Vec3]) -> Clipped {
    let relative: Clipped = outline.iter().map(|v| *v - point).take(7).collect();
    clip(&relative, |v| v.dot(normal))
}

/// Lambert's sum over the edges of an outline seen from the origin; above zero for a front, but
/// for rounding.
pub(super) fn lambert(normal: Vec3, outline: &[Vec3]) -> f32 {
    let next = outline.iter().cycle().skip(1);
    let sum: f32 = outline
        .iter()
        .zip(next)
        .map(|(a, b)| edge(normal, *a, *b))
        .sum();
    // Counter-clockwise from its front is clockwise for who looks along his own normal.
    -sum / (2.0 * PI)
}

/// `theta (a x b) . n / |a x b|`.
fn edge(normal: Vec3, a: Vec3, b: Vec3) -> f32 {
    let cross = a.cross(b);
    let along = a.dot(b);
    let square = cross.length_squared();
    let tangent = square / (along * along);
    if along > 0.0 && tangent < SMALL {
        // atan(x) / x = 1 - x^2/3 + x^4/5 - x^6/7
        let series = 1.0 - tangent * (1.0 / 3.0 - tangent * (0.2 - tangent / 7.0));
        return cross.dot(normal) * series / along;
    }
    let length = math::safe_sqrt(square);
    // On the line through the edge the direction is undefined; its share is finite.
    if length <= f32::MIN_POSITIVE {
        return 0.0;
    }
    math::atan2(length, along) * cross.dot(normal) / length
}
