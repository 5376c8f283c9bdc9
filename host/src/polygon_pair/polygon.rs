//! Convex polygons of any number of vertices, in `f64`: checks, clipping, division into cells.
//!
//! Vector area (Newell): `N = 1/2 sum_i (v_i - v_0) x (v_i+1 - v_0)`, area `|N|`, normal `N / |N|`;
//! the front is where the vertices run counter-clockwise. Lengths are in any one unit. Tolerances are
//! roundings of the coordinates at hand or shares of the longest edge, never a fixed length.

use std::f64::consts::PI;

use glam::DVec3;
use thiserror::Error;

/// Roundings that a coordinate may carry when a side of a plane is decided.
pub(super) const ROUNDINGS: f64 = 16.0 * f64::EPSILON;

/// How far a vertex may lie off its polygon's plane, in longest edges: ten times below the accuracy
/// that is promised.
const PLANARITY: f64 = 1e-6;

/// Why some vertices are no convex polygon.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum PolygonError {
    /// Fewer than three different vertices.
    #[error("it has fewer than three different vertices; give at least three")]
    VertexCount,
    /// A coordinate is NaN, infinite or so large that differences overflow.
    #[error("a coordinate is not a finite number of usable size; give numbers below 1e150")]
    NotFinite,
    /// The area is zero to within rounding.
    #[error("its area is zero; give three vertices that are not on one line, or leave it out")]
    ZeroArea,
    /// A vertex lies off the plane of the others.
    #[error("its vertices do not lie in one plane; divide it into triangles")]
    NonPlanar,
    /// The outline turns the wrong way at a vertex, crosses itself or runs round twice.
    #[error("it is not convex; divide it into convex polygons")]
    Concave,
}

/// A convex planar polygon of three or more vertices.
#[derive(Clone, Debug, PartialEq)]
pub struct ConvexPolygon {
    vertices: Vec<DVec3>,
    normal: DVec3,
}

impl ConvexPolygon {
    /// Checks the vertices; one that repeats its neighbour is dropped.
    ///
    /// # Errors
    /// What makes them unusable: see [`PolygonError`].
    pub fn new(vertices: &[DVec3]) -> Result<Self, PolygonError> {
        const LARGEST: f64 = 1e150;
        if !vertices.iter().all(|v| v.abs().max_element() < LARGEST) {
            return Err(PolygonError::NotFinite);
        }
        let mut vertices = vertices.to_vec();
        vertices.dedup();
        while vertices.len() > 1 && vertices.first() == vertices.last() {
            vertices.pop();
        }
        if vertices.len() < 3 {
            return Err(PolygonError::VertexCount);
        }

        // Everything is judged on a copy of about unit size: areas then neither over- nor underflow.
        let scale = unit_scale(extent(&vertices));
        let grain = ROUNDINGS * scale * magnitude(&vertices);
        let scaled: Vec<DVec3> = vertices
            .iter()
            .map(|v| (*v - vertices[0]) * scale)
            .collect();
        let area = vector_area(&scaled);
        if area.length() <= grain.max(ROUNDINGS * ROUNDINGS) {
            return Err(PolygonError::ZeroArea);
        }
        let normal = area.normalize();
        let flatness = scaled.iter().map(|v| v.dot(normal).abs());
        if flatness.fold(0.0, f64::max) > PLANARITY + grain {
            return Err(PolygonError::NonPlanar);
        }
        if !is_convex(&scaled, normal, PLANARITY + grain) {
            return Err(PolygonError::Concave);
        }
        Ok(Self { vertices, normal })
    }

    /// The vertices, counter-clockwise seen from the front.
    #[must_use]
    pub fn vertices(&self) -> &[DVec3] {
        &self.vertices
    }

    /// Largest difference of a coordinate from that of the first vertex.
    #[must_use]
    pub fn extent(&self) -> f64 {
        extent(&self.vertices)
    }

    /// Unit normal of the front.
    #[must_use]
    pub const fn normal(&self) -> DVec3 {
        self.normal
    }
}

/// No vertex is right of an edge by more than `slack`, and the outline turns round once.
fn is_convex(outline: &[DVec3], normal: DVec3, slack: f64) -> bool {
    let is_left = edges(outline).all(|(a, b)| {
        let inward = normal.cross((b - a).normalize());
        outline.iter().all(|v| inward.dot(*v - a) >= -slack)
    });
    let following = edges(outline).cycle().skip(1);
    let turns = edges(outline).zip(following).map(|((a, b), (_, c))| {
        let (before, after) = (b - a, c - b);
        normal.dot(before.cross(after)).atan2(before.dot(after))
    });
    is_left && turns.sum::<f64>() < 3.0 * PI
}

/// The edges `(from, to)` of an outline.
pub(super) fn edges(outline: &[DVec3]) -> impl Iterator<Item = (DVec3, DVec3)> + Clone + '_ {
    let next = outline.iter().cycle().skip(1);
    outline.iter().copied().zip(next.copied())
}

/// Half the sum of the cross products: its length is the area, its direction the normal.
pub(super) fn vector_area(outline: &[DVec3]) -> DVec3 {
    let origin = outline.first().copied().unwrap_or_default();
    let sum: DVec3 = edges(outline)
        .map(|(a, b)| (a - origin).cross(b - origin))
        .sum();
    sum / 2.0
}

/// Largest difference of a coordinate from that of the first vertex.
pub(super) fn extent(outline: &[DVec3]) -> f64 {
    let offsets = outline.iter().map(|v| (*v - outline[0]).abs());
    offsets.fold(DVec3::ZERO, DVec3::max).max_element()
}

/// Largest absolute value of a coordinate.
pub(super) fn magnitude(outline: &[DVec3]) -> f64 {
    let coordinates = outline.iter().map(|v| v.abs());
    coordinates.fold(DVec3::ZERO, DVec3::max).max_element()
}

/// The power of two that brings `length` to about 1, so that scaling costs no digit.
pub(super) fn unit_scale(length: f64) -> f64 {
    let exponent = length.max(f64::MIN_POSITIVE).log2().round();
    (-exponent.clamp(-1000.0, 1000.0)).exp2()
}

/// The part of a convex outline where `height` is above `grain`, with its border at height 0.
///
/// Empty when no vertex is that high. The result is written to `part`, whose old content is lost.
pub(super) fn clip_into(
    outline: &[DVec3],
    part: &mut Vec<DVec3>,
    grain: f64,
    height: impl Fn(DVec3) -> f64,
) {
    part.clear();
    let Some(last) = outline.last() else { return };
    let (mut before, mut height_before) = (*last, height(*last));
    let mut is_above = false;
    for v in outline {
        let h = height(*v);
        if (h > grain && height_before < -grain) || (h < -grain && height_before > grain) {
            part.push(before + (*v - before) * (height_before / (height_before - h)));
        }
        if h >= -grain {
            part.push(*v);
        }
        is_above |= h > grain;
        (before, height_before) = (*v, h);
    }
    if !is_above {
        part.clear();
    }
}

/// [`clip_into`] a fresh outline.
pub(super) fn clip(outline: &[DVec3], grain: f64, height: impl Fn(DVec3) -> f64) -> Vec<DVec3> {
    let mut part = Vec::with_capacity(outline.len() + 1);
    clip_into(outline, &mut part, grain, height);
    part
}

/// A quad as a bilinear patch; a triangle repeats its last vertex.
pub(super) type Cell = [DVec3; 4];

/// Divides a convex outline into quads, and a triangle where one is left over.
pub(super) fn cells(outline: &[DVec3]) -> impl Iterator<Item = Cell> + '_ {
    (1..outline.len().saturating_sub(1)).step_by(2).map(|k| {
        let last = outline.get(k + 2).unwrap_or(&outline[k + 1]);
        [outline[0], outline[k], outline[k + 1], *last]
    })
}

/// The point of a cell at `(s, t)` in the unit square, and the area per unit of `s t` there.
pub(super) fn bilinear(cell: &Cell, normal: DVec3, s: f64, t: f64) -> (DVec3, f64) {
    let [a, b, c, d] = *cell;
    let twist = (c - d) - (b - a);
    let (along_s, along_t) = ((b - a) + twist * t, (d - a) + twist * s);
    let point = a + (b - a) * s + (d - a) * t + twist * (s * t);
    (point, along_s.cross(along_t).dot(normal))
}

/// Lowest and highest coordinates.
pub(super) type Bounds = [DVec3; 2];

/// The box around an outline of at least one vertex.
pub(super) fn bounds(outline: &[DVec3]) -> Bounds {
    let first = outline[0];
    let extend = |[low, high]: Bounds, v: &DVec3| [low.min(*v), high.max(*v)];
    outline.iter().fold([first, first], extend)
}

/// True when two boxes have a point in common.
pub(super) fn meet([a_low, a_high]: Bounds, [b_low, b_high]: Bounds) -> bool {
    a_low.cmple(b_high).all() && b_low.cmple(a_high).all()
}

/// Distance of two boxes; 0 where they meet.
pub(super) fn gap([a_low, a_high]: Bounds, [b_low, b_high]: Bounds) -> f64 {
    (a_low - b_high)
        .max(b_low - a_high)
        .max(DVec3::ZERO)
        .length()
}

/// Length of a box's diagonal.
pub(super) fn diagonal([low, high]: Bounds) -> f64 {
    low.distance(high)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(scale: f64, shift: f64) -> Vec<DVec3> {
        let corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];
        corners
            .map(|(x, y)| DVec3::new(x, y, 0.0) * scale + shift)
            .to_vec()
    }

    #[test]
    fn polygons_of_any_size_and_place_are_legal() {
        for (scale, shift) in [(1.0, 0.0), (1e-100, 0.0), (1e100, 0.0), (1e-3, 1e6)] {
            let polygon = ConvexPolygon::new(&square(scale, shift)).unwrap();
            assert!(
                polygon.normal().dot(DVec3::Z) > 0.999_999,
                "{scale} {shift}"
            );
        }
    }

    #[test]
    fn repeated_vertices_are_dropped_and_winding_twice_is_refused() {
        let corners = square(1.0, 0.0);
        let doubled: Vec<DVec3> = corners.iter().flat_map(|v| [*v, *v]).collect();
        assert_eq!(ConvexPolygon::new(&doubled).unwrap().vertices(), corners);
        let twice = [corners.clone(), corners].concat();
        assert_eq!(ConvexPolygon::new(&twice), Err(PolygonError::Concave));
        let nan = [DVec3::ZERO, DVec3::X, DVec3::NAN];
        assert_eq!(ConvexPolygon::new(&nan), Err(PolygonError::NotFinite));
    }

    #[test]
    fn clipping_and_cells_keep_the_area() {
        let angles = (0..7).map(|k| f64::from(k) * std::f64::consts::TAU / 7.0);
        let outline: Vec<DVec3> = angles.map(|a| DVec3::new(a.cos(), a.sin(), 0.0)).collect();
        let whole = vector_area(&outline).z;
        let halves =
            [1.0, -1.0].map(|side| clip(&outline, 0.0, |v| side * (v.x - 0.3 * v.y - 0.1)));
        let sum: f64 = halves.iter().map(|half| vector_area(half).z).sum();
        assert!((sum - whole).abs() < 1e-14, "{sum} {whole}");
        let sum: f64 = cells(&outline).map(|cell| vector_area(&cell).z).sum();
        assert!((sum - whole).abs() < 1e-14, "{sum} {whole}");
        assert!(clip(&outline, 0.0, |v| v.x - 2.0).is_empty());
        assert!(clip(&outline, 1e-9, |v| v.z).is_empty(), "all on the plane");
    }
}
