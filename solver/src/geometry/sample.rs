//! Points that stand for a polygon's area.

use glam::{Vec2, Vec3};
use heapless::Vec;

use super::Polygon;
use crate::math;

/// A point on a polygon and the share of the polygon's area that it stands for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SamplePoint {
    /// The place.
    pub position: Vec3,
    /// Share of the area; the weights of one set sum to one.
    pub weight: f32,
}

/// Gauss points of a polygon: 2 x 2 on quads (exact for bicubic functions of a parallelogram),
/// three on triangles (exact for quadratics).
#[must_use]
pub fn gauss_points(polygon: &Polygon) -> Vec<SamplePoint, 4> {
    /// (1 - 1/sqrt 3) / 2
    const LOW: f32 = 0.211_324_87;
    const HIGH: f32 = 1.0 - LOW;
    const QUAD: [Vec2; 4] = [
        Vec2::new(LOW, LOW),
        Vec2::new(HIGH, LOW),
        Vec2::new(LOW, HIGH),
        Vec2::new(HIGH, HIGH),
    ];
    const TRIANGLE: [Vec2; 3] = [
        Vec2::new(1.0 / 6.0, 1.0 / 6.0),
        Vec2::new(2.0 / 3.0, 1.0 / 6.0),
        Vec2::new(1.0 / 6.0, 2.0 / 3.0),
    ];
    let parameters: &[Vec2] = if polygon.is_triangle() {
        &TRIANGLE
    } else {
        &QUAD
    };
    let total: f32 = parameters.iter().map(|at| polygon.density(*at)).sum();
    as_many(parameters.iter().map(|at| SamplePoint {
        position: polygon.point(*at),
        weight: polygon.density(*at) / total,
    }))
}

/// As many items as fit; unlike collecting them, this leaves no panic path in a device.
pub(crate) fn as_many<T, const N: usize>(items: impl Iterator<Item = T>) -> Vec<T, N> {
    let mut kept = Vec::new();
    for item in items {
        if kept.push(item).is_err() {
            break;
        }
    }
    kept
}

/// Maps the unit square to the polygon so that equal areas stay equal on triangles and
/// parallelograms; on other quads [`Polygon::density`] tells by how much they do not.
// Inlined, like what it calls: who drops the density does not pay for it.
#[inline]
#[must_use]
pub fn from_unit_square(polygon: &Polygon, at: Vec2) -> (Vec3, f32) {
    if !polygon.is_triangle() {
        return (polygon.point(at), polygon.density(at));
    }
    let root = math::safe_sqrt(at.x);
    let parameters = Vec2::new(root * (1.0 - at.y), root * at.y);
    (polygon.point(parameters), 2.0 * polygon.area())
}
