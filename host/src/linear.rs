//! Functions that are linear in a place: heights above planes, parameters of polygons.

use glam::{DVec3, Vec3};
use relume::geometry::Polygon;

/// `gradient . p + offset`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Linear {
    /// Change per length, along the axes.
    pub gradient: Vec3,
    /// Value at the origin.
    pub offset: f32,
}

impl Linear {
    /// The function of a gradient that has a value at a place.
    #[must_use]
    pub fn new(gradient: DVec3, place: DVec3, value: f64) -> Self {
        Self {
            gradient: gradient.as_vec3(),
            offset: (value - gradient.dot(place)) as f32,
        }
    }

    /// The value at a place.
    #[must_use]
    pub fn at(&self, place: Vec3) -> f32 {
        self.gradient.dot(place) + self.offset
    }
}

/// The first corner and its two neighbours, if they make the whole polygon: that of a triangle or,
/// to within rounding, of a parallelogram.
#[must_use]
pub fn span(polygon: &Polygon) -> Option<[Vec3; 3]> {
    match *polygon.vertices() {
        [a, b, c] => Some([a, b, c]),
        [a, b, c, d] => {
            let (_, tolerance) = polygon.height(c);
            let twist = (c - d) - (b - a);
            (twist.length() <= tolerance).then_some([a, b, d])
        }
        _ => None,
    }
}

/// Gradients of the parameters of the span `a, b, d`: of `s` along `a -> b`, of `t` along `a -> d`.
/// Zero where the corners are on one line.
#[must_use]
pub fn parameter_gradients([a, b, d]: [DVec3; 3]) -> [DVec3; 2] {
    let (along_s, along_t) = (b - a, d - a);
    let area = along_s.cross(along_t);
    let per_square = area.length_squared().recip();
    if !per_square.is_finite() {
        return [DVec3::ZERO; 2];
    }
    [along_t.cross(area), area.cross(along_s)].map(|gradient| gradient * per_square)
}
