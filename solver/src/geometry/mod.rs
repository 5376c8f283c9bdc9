//! Convex planar polygons of three or four vertices: area, normal, parts, clipping, crossing.
//!
//! The front of a polygon is where its vertices run counter-clockwise; lengths are in metres.
//! Vector area (Newell): `N = 1/2 sum_i (v_i - v_0) x (v_i+1 - v_0)`, area `|N|`, normal `N / |N|`.
//! Parameters: a quad is the bilinear patch `P(s, t)` with `s` along `v0 -> v1` and `t` along
//! `v0 -> v3`; a triangle is `P(s, t) = v0 + s (v1 - v0) + t (v2 - v0)` with `s + t <= 1`.
//! Tolerances are a few roundings of the coordinates at hand, never a fixed length: a scene in
//! micrometres and one in kilometres behave alike.

mod error;
mod sample;

use glam::{Vec2, Vec3};
use heapless::Vec;

pub use error::PolygonError;
pub(crate) use sample::as_many;
pub use sample::{SamplePoint, from_unit_square, gauss_points};

/// Most vertices that a polygon may have.
pub const MAX_VERTICES: usize = 4;

/// A polygon that was clipped by a few planes.
pub type Clipped = Vec<Vec3, 10>;

/// Roundings that a point's coordinates may carry when its side of a plane is decided.
const ROUNDINGS: f32 = 8.0 * f32::EPSILON;

/// How far a vertex may lie off its polygon's plane, in longest edges: what files written with
/// six digits need, and small beside every other error of a bake.
const PLANARITY: f32 = 1e-4;

/// A plane, and how exactly it is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// A point in it.
    pub origin: Vec3,
    /// Unit normal.
    pub normal: Vec3,
    /// How far the points that it stands for lie off it, in m.
    pub flatness: f32,
}

impl Plane {
    /// Signed distance of `p`, and the distance within which it counts as zero.
    #[must_use]
    pub fn height(&self, p: Vec3) -> (f32, f32) {
        let height = (p - self.origin).dot(self.normal);
        (height, self.tolerance(p.abs().max_element()))
    }

    /// The distance within which the height of a point counts as zero, by its largest coordinate.
    #[must_use]
    pub fn tolerance(&self, coordinate: f32) -> f32 {
        self.flatness + ROUNDINGS * (coordinate + self.origin.abs().max_element())
    }
}

/// A convex planar polygon of three or four vertices.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Polygon {
    vertices: [Vec3; MAX_VERTICES],
    count: u8,
    normal: Vec3,
    area: f32,
    flatness: f32,
}

impl Polygon {
    /// Checks the vertices and measures them.
    ///
    /// # Errors
    /// What makes them unusable: see [`PolygonError`].
    pub fn new(vertices: &[Vec3]) -> Result<Self, PolygonError> {
        let corners = match *vertices {
            [a, b, c] => [a, b, c, c],
            [a, b, c, d] => [a, b, c, d],
            _ => return Err(PolygonError::VertexCount),
        };
        let vector_area = vector_area(vertices);
        let longest = longest_edge(vertices);
        let square = longest * longest;
        if !vertices.iter().all(|v| v.is_finite()) || !square.is_finite() {
            return Err(PolygonError::NotFinite);
        }

        // The area must stand out of the rounding of the cross products.
        let area = vector_area.length();
        if area <= square * ROUNDINGS || area < f32::MIN_POSITIVE {
            return Err(PolygonError::ZeroArea);
        }
        let normal = vector_area / area;

        let [origin, ..] = corners;
        let flatness = vertices
            .iter()
            .map(|v| (*v - origin).dot(normal).abs())
            .fold(0.0, f32::max);
        if flatness > PLANARITY * longest {
            return Err(PolygonError::NonPlanar);
        }
        let polygon = Self {
            vertices: corners,
            count: if vertices.len() == 3 { 3 } else { 4 },
            normal,
            area,
            flatness,
        };
        if !polygon.is_convex() {
            return Err(PolygonError::Concave);
        }
        Ok(polygon)
    }

    /// Every corner turns left, and no corner sees another one on its right.
    fn is_convex(&self) -> bool {
        self.edges().all(|(a, b)| {
            let edge = b - a;
            let tolerance = ROUNDINGS * edge.length_squared();
            self.vertices().iter().all(|v| {
                let side = edge.cross(*v - a).dot(self.normal);
                side >= -tolerance - edge.length() * self.flatness
            })
        })
    }

    /// The vertices, counter-clockwise seen from the front.
    #[must_use]
    pub fn vertices(&self) -> &[Vec3] {
        let [head @ .., _] = &self.vertices;
        if self.count == 3 {
            head
        } else {
            &self.vertices
        }
    }

    /// The edges `(from, to)` in order.
    pub fn edges(&self) -> impl Iterator<Item = (Vec3, Vec3)> + '_ {
        let vertices = self.vertices();
        let next = vertices.iter().cycle().skip(1);
        vertices.iter().copied().zip(next.copied())
    }

    /// True for three vertices.
    #[must_use]
    pub const fn is_triangle(&self) -> bool {
        self.count == 3
    }

    /// Unit normal of the front.
    #[must_use]
    pub const fn normal(&self) -> Vec3 {
        self.normal
    }

    /// Area in m2, above zero.
    #[must_use]
    pub const fn area(&self) -> f32 {
        self.area
    }

    /// The first vertex.
    #[must_use]
    pub const fn origin(&self) -> Vec3 {
        let [origin, ..] = self.vertices;
        origin
    }

    /// Mean of the vertices: the centroid of triangles and parallelograms, inside in any case.
    #[must_use]
    pub fn center(&self) -> Vec3 {
        let vertices = self.vertices();
        let offset: Vec3 = vertices.iter().map(|v| *v - self.origin()).sum();
        self.origin() + offset / vertices.len() as f32
    }

    /// Length of the longest edge.
    #[must_use]
    pub fn longest_edge(&self) -> f32 {
        longest_edge(self.vertices())
    }

    /// The same polygon seen from behind: same first vertex, other winding.
    #[must_use]
    pub fn flipped(&self) -> Self {
        let [a, b, c, d] = self.vertices;
        let vertices = if self.count == 3 {
            [a, c, b, b]
        } else {
            [a, d, c, b]
        };
        Self {
            vertices,
            normal: -self.normal,
            ..*self
        }
    }

    /// The point with the parameters `at = (s, t)`.
    #[inline]
    #[must_use]
    pub fn point(&self, at: Vec2) -> Vec3 {
        let [a, b, c, d] = self.vertices;
        let along_s = (b - a) * at.x;
        if self.count == 3 {
            return a + along_s + (c - a) * at.y;
        }
        a + along_s + (d - a) * at.y + ((c - d) - (b - a)) * (at.x * at.y)
    }

    /// Area per unit of parameter area at `at`, in m2 (constant on triangles and parallelograms).
    #[inline]
    #[must_use]
    pub fn density(&self, at: Vec2) -> f32 {
        let [a, b, c, d] = self.vertices;
        let (along_s, along_t) = if self.count == 3 {
            (b - a, c - a)
        } else {
            let twist = (c - d) - (b - a);
            ((b - a) + twist * at.y, (d - a) + twist * at.x)
        };
        along_s.cross(along_t).dot(self.normal).abs()
    }

    /// The parameters of the point of the polygon's plane nearest to `p`.
    ///
    /// Exact on triangles and parallelograms; on other quads Newton's method on the bilinear map,
    /// which converges from the middle for convex quads.
    #[must_use]
    pub fn parameters(&self, p: Vec3) -> Vec2 {
        let [a, b, c, d] = self.vertices;
        let mut at = Vec2::splat(1.0 / 3.0);
        let far = if self.count == 3 { c } else { d };
        let steps = if self.count == 3 { 1 } else { 8 };
        for _ in 0..steps {
            let twist = if self.count == 3 {
                Vec3::ZERO
            } else {
                (c - d) - (b - a)
            };
            let along_s = (b - a) + twist * at.y;
            let along_t = (far - a) + twist * at.x;
            let miss = p - self.point(at);
            let jacobian = along_s.cross(along_t).dot(self.normal);
            if jacobian <= 0.0 {
                break;
            }
            at += Vec2::new(
                miss.cross(along_t).dot(self.normal),
                along_s.cross(miss).dot(self.normal),
            ) / jacobian;
        }
        at
    }

    /// The part between two corners of the parameter domain.
    ///
    /// On a quad it is the quad over the rectangle from `from` to `to`. On a triangle it is the
    /// triangle with the right angle of its parameters at `from`, similar to the whole; `to`
    /// below `from` gives the one that points the other way. Winding and plane are the whole's.
    #[must_use]
    pub fn part(&self, from: Vec2, to: Vec2) -> Self {
        let [a, b, d] = [
            self.point(from),
            self.point(Vec2::new(to.x, from.y)),
            self.point(Vec2::new(from.x, to.y)),
        ];
        let vertices = if self.count == 3 {
            [a, b, d, d]
        } else {
            [a, b, self.point(to), d]
        };
        let mut part = Self { vertices, ..*self };
        part.area = vector_area(part.vertices()).dot(self.normal).abs();
        part
    }

    /// The plane that it lies in.
    #[must_use]
    pub const fn plane(&self) -> Plane {
        Plane {
            origin: self.origin(),
            normal: self.normal,
            flatness: self.flatness,
        }
    }

    /// Signed distance of `p` to the plane, and the distance within which it counts as zero.
    #[must_use]
    pub fn height(&self, p: Vec3) -> (f32, f32) {
        self.plane().height(p)
    }

    /// True when a point of the polygon's plane is not outside its outline.
    #[must_use]
    pub fn holds(&self, p: Vec3) -> bool {
        self.edges()
            .all(|(a, b)| (b - a).cross(p - a).dot(self.normal) >= 0.0)
    }

    /// Where the open segment from `from` to `to` crosses the polygon, as a fraction of its
    /// length; `None` when it does not.
    ///
    /// An end that lies in the plane (to within rounding) does not cross it, so a surface never
    /// hides its own points. The outline belongs to the polygon, so edge to edge there is no crack.
    #[must_use]
    pub fn crossing(&self, from: Vec3, to: Vec3) -> Option<f32> {
        let (from_height, from_tolerance) = self.height(from);
        let (to_height, to_tolerance) = self.height(to);
        let starts_in_front = from_height > from_tolerance && to_height < -to_tolerance;
        let starts_behind = from_height < -from_tolerance && to_height > to_tolerance;
        if !starts_in_front && !starts_behind {
            return None;
        }

        let fraction = from_height / (from_height - to_height);
        let crossing = from + (to - from) * fraction;
        let tolerance = from_tolerance.max(to_tolerance);
        self.edges()
            .all(|(a, b)| {
                let edge = b - a;
                edge.cross(crossing - a).dot(self.normal) >= -tolerance * edge.length()
            })
            .then_some(fraction)
    }
}

/// `1/2 sum_i (v_i - v_0) x (v_i+1 - v_0)`: the normal, as long as the area.
pub(crate) fn vector_area(vertices: &[Vec3]) -> Vec3 {
    let Some((origin, rest)) = vertices.split_first() else {
        return Vec3::ZERO;
    };
    let fan = rest.iter().zip(rest.iter().skip(1));
    fan.map(|(b, c)| (*b - *origin).cross(*c - *origin) * 0.5)
        .sum()
}

fn longest_edge(vertices: &[Vec3]) -> f32 {
    let next = vertices.iter().cycle().skip(1);
    vertices
        .iter()
        .zip(next)
        .map(|(a, b)| (*b - *a).length())
        .fold(0.0, f32::max)
}

/// The part of a convex outline where `height` is not negative; empty when nothing is left.
///
/// `height` must be linear (a signed distance to a plane). Outlines of more than nine vertices
/// lose what does not fit into [`Clipped`].
#[must_use]
pub fn clip(outline: &[Vec3], height: impl Fn(Vec3) -> f32) -> Clipped {
    let mut clipped = Clipped::new();
    let next = outline.iter().cycle().skip(1);
    for (&a, &b) in outline.iter().zip(next) {
        let (height_a, height_b) = (height(a), height(b));
        if height_a >= 0.0 {
            let _ = clipped.push(a);
        }
        if (height_a > 0.0 && height_b < 0.0) || (height_a < 0.0 && height_b > 0.0) {
            let _ = clipped.push(a + (b - a) * (height_a / (height_a - height_b)));
        }
    }
    if clipped.len() < 3 {
        clipped.clear();
    }
    clipped
}

#[cfg(test)]
mod tests;
