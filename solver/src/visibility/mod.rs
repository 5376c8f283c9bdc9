//! Who sees whom: a trait, the brute-force answer over all surfaces, and the shaft between two polygons.
//!
//! The shaft is the convex hull of the boxes of a receiver and a shooter, bounded by planes that
//! touch an edge of each (Haines and Wallace 1991, shaft culling). What lies outside it, behind one of the
//! two, or in a plane that has both on one side, hides nothing of one from the other.
//!
//! Assumption: every surface blocks light from both sides; end points lie on surfaces or in free
//! space. A surface that contains an end point (to within rounding) does not hide it.

mod body;
mod cover;

use glam::{Vec2, Vec3};
use heapless::Vec;

use crate::geometry::{Plane, Polygon, as_many};
use crate::scene::Surface;

pub(crate) use body::FACES;
pub use body::{Body, bodies};
pub use cover::covers;

/// A surface that may hide something.
#[derive(Clone, Copy, Debug)]
pub struct Obstacle<'v> {
    /// Its outline.
    pub polygon: &'v Polygon,
    /// The body that it is a face of, which hides what each of its faces hides.
    pub body: Option<&'v Body>,
}

/// Tells who stands between two points or two polygons.
pub trait Visibility {
    /// True when no surface crosses the open segment between the two points.
    fn sees(&self, from: Vec3, to: Vec3) -> bool;

    /// False when nothing is known that could stand between anything.
    fn may_block(&self) -> bool {
        true
    }

    /// Visits every surface that [`Shaft::admits`], in the order of their numbers.
    fn between<'v>(&'v self, shaft: &Shaft, visit: &mut impl FnMut(Obstacle<'v>));

    /// Visits every surface that [`covers`] the surface of this number from the side to which `facing` points.
    fn above(&self, _surface: u32, _facing: Vec3, _visit: &mut impl FnMut(&Polygon)) {}
}

/// Every surface of a scene, asked one after the other: work grows with their number.
#[derive(Clone, Copy, Debug)]
pub struct Occluders<'a>(pub &'a [Surface]);

impl Visibility for Occluders<'_> {
    fn sees(&self, from: Vec3, to: Vec3) -> bool {
        !self
            .0
            .iter()
            .any(|surface| surface.polygon().crossing(from, to).is_some())
    }

    fn between<'v>(&'v self, shaft: &Shaft, visit: &mut impl FnMut(Obstacle<'v>)) {
        let polygons = self.0.iter().map(Surface::polygon);
        for polygon in polygons.filter(|polygon| shaft.admits(polygon)) {
            let body = None;
            visit(Obstacle { polygon, body });
        }
    }

    fn above(&self, surface: u32, facing: Vec3, visit: &mut impl FnMut(&Polygon)) {
        let Some(bottom) = self.0.get(surface as usize) else {
            return;
        };
        for (number, top) in (0..).zip(self.0) {
            if covers((number, top), (surface, bottom), facing) {
                visit(top.polygon());
            }
        }
    }
}

/// The same, where the closed convex [`bodies`] among the surfaces are known: what is hidden is the same but
/// for rounding, and found with less work.
#[derive(Clone, Copy, Debug)]
pub struct OccludersAndBodies<'a> {
    /// The surfaces.
    pub surfaces: &'a [Surface],
    /// The bodies among them.
    pub bodies: &'a [Body],
}

impl Visibility for OccludersAndBodies<'_> {
    fn sees(&self, from: Vec3, to: Vec3) -> bool {
        Occluders(self.surfaces).sees(from, to)
    }

    fn between<'v>(&'v self, shaft: &Shaft, visit: &mut impl FnMut(Obstacle<'v>)) {
        for (surface, number) in self.surfaces.iter().zip(0..) {
            let polygon = surface.polygon();
            if shaft.admits(polygon) {
                let mut bodies = self.bodies.iter();
                let body = bodies.find(|body| body.surfaces().contains(&number));
                visit(Obstacle { polygon, body });
            }
        }
    }

    fn above(&self, surface: u32, facing: Vec3, visit: &mut impl FnMut(&Polygon)) {
        Occluders(self.surfaces).above(surface, facing, visit);
    }
}

/// An axis-parallel box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Smallest coordinates.
    pub low: Vec3,
    /// Largest coordinates.
    pub high: Vec3,
}

impl Bounds {
    /// The box of a polygon.
    #[must_use]
    pub fn of(polygon: &Polygon) -> Self {
        Self::around(polygon.origin(), polygon.vertices())
    }

    fn around(origin: Vec3, points: &[Vec3]) -> Self {
        let nothing = Self {
            low: origin,
            high: origin,
        };
        points.iter().fold(nothing, |bounds, point| Self {
            low: bounds.low.min(*point),
            high: bounds.high.max(*point),
        })
    }

    /// The same box, larger by `margin` on every side.
    #[must_use]
    pub fn widened(self, margin: f32) -> Self {
        Self {
            low: self.low - margin,
            high: self.high + margin,
        }
    }

    /// The smallest box around both.
    fn with(self, other: Self) -> Self {
        Self {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
        }
    }

    fn overlaps(self, other: Self) -> bool {
        self.low.cmple(other.high).all() && other.low.cmple(self.high).all()
    }

    /// The corner that is largest along axis `i` where `high` says so.
    fn corner(self, [i, j]: [usize; 2], [high_i, high_j]: [bool; 2]) -> Vec2 {
        let end = |axis, high| component(if high { self.high } else { self.low }, axis);
        Vec2::new(end(i, high_i), end(j, high_j))
    }
}

const fn component(v: Vec3, axis: usize) -> f32 {
    match axis {
        0 => v.x,
        1 => v.y,
        _ => v.z,
    }
}

/// A wall of a shaft, parallel to the third axis: outside is where `normal . (p - at) > 0`.
#[derive(Clone, Copy, Debug)]
struct Wall {
    axes: [usize; 2],
    normal: Vec2,
    at: Vec2,
}

impl Wall {
    /// True when the whole box is outside.
    fn excludes(&self, bounds: Bounds) -> bool {
        let nearest = bounds.corner(self.axes, [self.normal.x < 0.0, self.normal.y < 0.0]);
        self.normal.dot(nearest - self.at) > 0.0
    }
}

/// The space in which a surface can stand between a receiver and a shooter.
#[derive(Clone, Debug)]
pub struct Shaft {
    planes: [Plane; 2],
    /// Vertices of both ends.
    ends: Vec<Vec3, 8>,
    around: Bounds,
    walls: Vec<Wall, 12>,
}

impl Shaft {
    /// The shaft between two polygons.
    #[must_use]
    pub fn new(receiver: &Polygon, shooter: &Polygon) -> Self {
        Self::with_margin(receiver, shooter, 0.0)
    }

    /// A shaft that holds all the shafts between points within `margin` of the two polygons, m.
    #[must_use]
    pub fn with_margin(receiver: &Polygon, shooter: &Polygon, margin: f32) -> Self {
        Self::between(receiver.plane(), receiver.vertices(), shooter, margin)
    }

    /// The shaft between a point that faces along a unit normal and a polygon.
    #[must_use]
    pub fn from_point(point: Vec3, normal: Vec3, shooter: &Polygon) -> Self {
        let plane = Plane {
            origin: point,
            normal,
            flatness: 0.0,
        };
        Self::between(plane, &[point], shooter, 0.0)
    }

    fn between(plane: Plane, receiver: &[Vec3], shooter: &Polygon, margin: f32) -> Self {
        let (a, b) = (
            Bounds::around(plane.origin, receiver).widened(margin),
            Bounds::of(shooter).widened(margin),
        );
        let walls = [[0, 1], [1, 2], [2, 0]].into_iter().flat_map(|axes| {
            let ends = [[false, false], [false, true], [true, false], [true, true]];
            ends.into_iter()
                .filter_map(move |end| wall(a, b, axes, end))
        });
        let ends = receiver.iter().chain(shooter.vertices());
        Self {
            planes: [plane, shooter.plane()],
            ends: as_many(ends.copied()),
            around: a.with(b),
            walls: as_many(walls),
        }
    }

    /// True when nothing inside the box can be in the shaft.
    #[must_use]
    pub fn misses(&self, bounds: Bounds) -> bool {
        !self.around.overlaps(bounds) || self.walls.iter().any(|wall| wall.excludes(bounds))
    }

    /// True when the surface may hide a part of one end from a part of the other.
    #[must_use]
    pub fn admits(&self, surface: &Polygon) -> bool {
        let is_in_front = |plane: &Plane| {
            surface.vertices().iter().any(|v| {
                let (height, tolerance) = plane.height(*v);
                height > tolerance
            })
        };
        self.is_cut_by(&surface.plane())
            && self.planes.iter().all(is_in_front)
            && !self.misses(Bounds::of(surface))
    }

    /// True when the ends lie on both sides of a plane.
    fn is_cut_by(&self, plane: &Plane) -> bool {
        let (mut above, mut below) = (false, false);
        for end in &self.ends {
            let (height, tolerance) = plane.height(*end);
            above |= height > tolerance;
            below |= height < -tolerance;
        }
        above && below
    }
}

/// The wall between the corners of two boxes, seen along the third axis, when all of both is on one
/// side of it: one box must reach further along the first axis and the other along the second.
fn wall(a: Bounds, b: Bounds, axes: [usize; 2], end: [bool; 2]) -> Option<Wall> {
    let (from, to) = (a.corner(axes, end), b.corner(axes, end));
    let outwards = Vec2::from(end.map(|high| if high { 1.0 } else { -1.0 }));
    let lead = (to - from) * outwards;
    if lead.x * lead.y >= 0.0 {
        return None;
    }
    // At right angles to the line through both corners, towards the outside.
    let normal = (to - from).perp();
    let normal = if normal.dot(outwards) < 0.0 {
        -normal
    } else {
        normal
    };
    Some(Wall {
        axes,
        normal,
        at: from,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::color::Rgb;

    #[test]
    fn a_plate_hides_what_is_behind_it_from_both_sides() {
        let plate = [
            Vec3::new(-1.0, -1.0, 0.0),
            Vec3::new(1.0, -1.0, 0.0),
            Vec3::new(1.0, 1.0, 0.0),
            Vec3::new(-1.0, 1.0, 0.0),
        ];
        let surfaces = [Surface::new(0, &plate, Rgb::BLACK).unwrap()];
        let occluders = Occluders(&surfaces);
        let (above, below) = (Vec3::Z, -Vec3::Z);
        assert!(!occluders.sees(above, below));
        assert!(!occluders.sees(below, above));
        assert!(
            occluders.sees(above, Vec3::ZERO),
            "a surface hides its own points"
        );
        assert!(occluders.sees(above + Vec3::X * 3.0, below + Vec3::X * 3.0));
    }
}
