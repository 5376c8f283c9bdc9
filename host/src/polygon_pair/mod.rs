//! Exact form factors between two polygons, with or without blockers, each with a bound of its error.
//!
//! `F_12 = 1/A_1 int_A1 int_A2 V cos a_1 cos a_2 / (pi r^2) dA_2 dA_1`
//!
//! is the fraction of the power leaving polygon 1 that arrives at polygon 2, front to front; `V` is 1
//! where nothing is in between and 0 elsewhere, `A_1` in m2 is the whole area of 1, `r` in m is the distance of
//! the two points and `a_1`, `a_2` are the angles with the normals there. Each polygon is clipped to the front of the
//! other one first. Then
//!
//! * far pairs take product Gauss rules over both areas (`area_rule`),
//! * near ones the double contour integral (`contour`),
//! * blocked ones an adaptive integral over one polygon of what its points see of the other one
//!   (`occluded`, `shadow`, `events`, `division`).
//!
//! Assumptions: convex planar polygons of any number of vertices; blockers have two sides and no thickness,
//! may overlap, touch and lie in the planes of the two. Lengths are in any one unit: everything is moved to
//! the first vertex and scaled by a power of two, which costs no digit. A height within 16 roundings of the
//! coordinates is none, so that coplanar neighbours see nothing of each other, exactly.
//!
//! The error is the difference of two rules, summed over all parts without regard to signs, a doubt where
//! rules may agree by chance, and a rounding term; the better of the two rules is returned, so it usually errs a
//! hundred times less. It is an estimate, no proof: behind blockers three times as much is stated.

mod polygon;

mod rules;

mod area_rule;

mod contour;

mod shadow;

mod events;

mod division;

mod occluded;

use glam::DVec3;

pub use polygon::{ConvexPolygon, PolygonError};
use polygon::{ROUNDINGS, clip, extent, magnitude, unit_scale, vector_area};
use shadow::Blocker;

/// Relative error that is aimed at without blockers.
const OPEN_TOLERANCE: f64 = 1e-6;

/// Relative error that is stated behind blockers, at most.
const OCCLUDED_TOLERANCE: f64 = 9e-5;

/// Times by which two rules that differ may both be off behind blockers: among a thousand hostile cases (slivers, wedges,
/// blockers that pierce or touch) beside evaluations a hundred times finer the worst was 2.3 times the difference.
const SAFETY: f64 = 3.0;

/// A number that is known within a bound.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimate {
    /// The number.
    pub value: f64,
    /// Bound of the absolute error, at least 0.
    pub error: f64,
}

/// The form factor from the front of `from` to the front of `to`, in [0, 1].
///
/// Relative errors are about 1e-6 or less without blockers and 1e-4 or less behind them; where the bound on the work
/// ends a search before that, the error says so. Exactly 0 where the two face away from each other.
#[must_use]
pub fn form_factor(
    from: &ConvexPolygon,
    to: &ConvexPolygon,
    blockers: &[ConvexPolygon],
) -> Estimate {
    let frame = Frame::new(from, to);
    let whole = frame.local(from);
    let area = vector_area(&whole).length();
    let Some((from, to)) = frame.facing(from, to) else {
        return Estimate::default();
    };

    let open = open(&from, &to);
    let power = if blockers.is_empty() {
        open
    } else {
        behind(&frame, &from, &to, blockers, open)
    };
    Estimate {
        value: (power.value / area).clamp(0.0, 1.0),
        error: power.error / area,
    }
}

/// `A_1 F_12` without blockers.
fn open(from: &Face, to: &Face) -> Estimate {
    if let Some(far) = area_rule::integrate(from, to, OPEN_TOLERANCE) {
        return far;
    }
    let near = contour::integrate(&from.outline, &to.outline, OPEN_TOLERANCE);
    if near.error <= OPEN_TOLERANCE * near.value {
        return near;
    }
    // The contour's terms cancel where both are slender or low beside their distance; areas do not.
    let divided = area_rule::divided(from, to, OPEN_TOLERANCE);
    divided
        .filter(|divided| divided.error < near.error)
        .unwrap_or(near)
}

/// `A_1 F_12` behind blockers, `open` being the same without.
fn behind(
    frame: &Frame,
    from: &Face,
    to: &Face,
    blockers: &[ConvexPolygon],
    open: Estimate,
) -> Estimate {
    let clipped = blockers.iter().filter_map(|polygon| {
        let outline = clip(&frame.local(polygon), frame.grain, |v| from.height(v));
        let outline = clip(&outline, frame.grain, |v| to.height(v));
        (!outline.is_empty()).then_some(Face {
            outline,
            normal: polygon.normal(),
        })
    });
    let clipped: Vec<Face> = clipped.collect();

    // Openings cast the wider patches the farther they are, so the farther side is sampled.
    let clearance = |face: &Face| {
        let heights = clipped.iter().map(|b| face.height(b.middle()));
        heights.fold(f64::INFINITY, f64::min) / vector_area(&face.outline).length().sqrt()
    };
    let (domain, target) = if clearance(to) > clearance(from) {
        (to, from)
    } else {
        (from, to)
    };
    let blockers = clipped.into_iter();
    let blockers = blockers.filter_map(|face| Blocker::new(face, domain, target, frame.grain));
    let blockers: Vec<Blocker> = blockers.collect();
    if blockers.is_empty() {
        return open;
    }
    let tolerance = OCCLUDED_TOLERANCE / SAFETY;
    let found = occluded::integrate(domain, target, &blockers, open, tolerance);
    Estimate {
        value: found.value,
        error: SAFETY * found.error,
    }
}

/// A convex outline in the local frame.
#[derive(Clone, Debug)]
struct Face {
    outline: Vec<DVec3>,
    /// Unit normal of its front.
    normal: DVec3,
}

impl Face {
    /// Height above the plane.
    fn height(&self, v: DVec3) -> f64 {
        (v - self.outline[0]).dot(self.normal)
    }

    /// Mean of the vertices.
    fn middle(&self) -> DVec3 {
        self.outline.iter().sum::<DVec3>() / self.outline.len() as f64
    }

    /// Distance of the farthest vertex from the middle.
    fn radius(&self) -> f64 {
        let middle = self.middle();
        let squares = self.outline.iter().map(|v| v.distance_squared(middle));
        squares.fold(0.0, f64::max).sqrt()
    }

    /// The parts on both sides of the middle, across the direction of the farthest vertex.
    fn halves(&self) -> [Self; 2] {
        let middle = self.middle();
        let reach = |v: &DVec3| v.distance_squared(middle);
        let vertices = self.outline.iter().copied();
        let farthest = vertices.max_by(|a, b| reach(a).total_cmp(&reach(b)));
        let across = farthest.unwrap_or(middle) - middle;
        [across, -across].map(|across| Self {
            outline: clip(&self.outline, 0.0, |v| across.dot(v - middle)),
            normal: self.normal,
        })
    }
}

/// Where lengths are about 1 and coordinates start at a vertex.
struct Frame {
    origin: DVec3,
    scale: f64,
    /// Heights that are roundings, in scaled units.
    grain: f64,
}

impl Frame {
    fn new(from: &ConvexPolygon, to: &ConvexPolygon) -> Self {
        let both = [from.vertices(), to.vertices()].concat();
        let scale = unit_scale(extent(&both));
        Self {
            origin: both[0],
            scale,
            grain: ROUNDINGS * scale * magnitude(&both),
        }
    }

    fn local(&self, polygon: &ConvexPolygon) -> Vec<DVec3> {
        let vertices = polygon.vertices().iter();
        vertices.map(|v| (*v - self.origin) * self.scale).collect()
    }

    /// The parts of two polygons that lie in front of each other.
    fn facing(&self, from: &ConvexPolygon, to: &ConvexPolygon) -> Option<(Face, Face)> {
        let [from, to] = [from, to].map(|polygon| Face {
            outline: self.local(polygon),
            normal: polygon.normal(),
        });
        let part = |of: &Face, other: &Face| {
            let outline = clip(&of.outline, self.grain, |v| other.height(v));
            (!outline.is_empty()).then_some(Face {
                outline,
                normal: of.normal,
            })
        };
        Some((part(&from, &to)?, part(&to, &from)?))
    }
}
