//! Of surfaces that lie in one plane on top of each other, only one can be seen from a side.
//!
//! On top is the one that emits to that side, or else the later one. A surface of one side is below all others
//! from behind. Surfaces cover each other where they share more than a hundred thousandth of the smaller one: what
//! touches in an edge does not.

use glam::Vec3;

use crate::geometry::{Polygon, clip, vector_area};
use crate::scene::Surface;

/// Share of the smaller of two surfaces below which they only touch.
const TOUCHING: f32 = 1e-5;

/// True when the first of two surfaces, with their numbers, hides a part of the second one from the side to which
/// `facing` points.
#[must_use]
pub fn covers(top: (u32, &Surface), bottom: (u32, &Surface), facing: Vec3) -> bool {
    let fronts = |surface: &Surface| surface.polygon().normal().dot(facing) > 0.0;
    let rank = |(number, surface): (u32, &Surface)| {
        (surface.emission().is_some() && fronts(surface), number)
    };
    let has_side = |surface: &Surface| fronts(surface) || surface.is_two_sided();
    has_side(top.1)
        && (rank(top) > rank(bottom) || !has_side(bottom.1))
        && overlap(top.1.polygon(), bottom.1.polygon())
}

/// True for two polygons of one plane that share more than an edge.
fn overlap(a: &Polygon, b: &Polygon) -> bool {
    let is_in_plane = |of: &Polygon, polygon: &Polygon| {
        polygon.vertices().iter().all(|v| {
            let (height, tolerance) = of.height(*v);
            height.abs() <= tolerance
        })
    };
    if !is_in_plane(a, b) || !is_in_plane(b, a) {
        return false;
    }
    let normal = a.normal();
    // A quad inside a quad has at most eight corners.
    let mut shared = clip(b.vertices(), |_| 1.0);
    for (from, to) in a.edges() {
        let inwards = normal.cross(to - from);
        shared = clip(&shared, |v| inwards.dot(v - from));
    }
    vector_area(&shared).length() > TOUCHING * a.area().min(b.area())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::color::Rgb;
    use crate::scene::Emission;

    fn square(low: f32, high: f32, height: f32) -> Surface {
        let corner = |x, y| Vec3::new(x, y, height);
        let outline = [
            corner(low, low),
            corner(high, low),
            corner(high, high),
            corner(low, high),
        ];
        Surface::new(0, &outline, Rgb::splat(0.5)).unwrap()
    }

    #[test]
    fn the_later_or_the_emitting_surface_is_on_top() {
        let (floor, rug) = (square(0.0, 4.0, 0.0), square(1.0, 2.0, 0.0));
        let hides = |top, bottom| covers(top, bottom, Vec3::Z);
        assert!(hides((1, &rug), (0, &floor)));
        assert!(!hides((0, &floor), (1, &rug)));
        assert!(
            !covers((1, &rug), (0, &floor), -Vec3::Z),
            "a rug from below"
        );
        assert!(covers((1, &rug.two_sided()), (0, &floor), -Vec3::Z));
        assert!(covers((0, &floor.two_sided()), (1, &rug), -Vec3::Z));
        let emission = Emission {
            light: 0,
            share: Rgb::WHITE,
        };
        let glowing = floor.emitting(0, emission).unwrap();
        assert!(hides((0, &glowing), (1, &rug)));
        assert!(!hides((1, &rug), (0, &glowing)));
    }

    #[test]
    fn neighbours_and_other_planes_cover_nothing() {
        let floor = square(0.0, 4.0, 0.0);
        let others = [
            square(4.0, 5.0, 0.0),
            square(5.0, 6.0, 0.0),
            square(1.0, 2.0, 1e-3),
        ];
        for other in others {
            assert!(!covers((1, &other), (0, &floor), Vec3::Z), "{other:?}");
        }
    }
}
