//! What four points see of a polygon, exactly: the outline minus the shadow pyramid of every blocker.
//!
//! A blocker hides from a point what lies in the cone through its outline, behind it. The cone of
//! a convex polygon is where every `m_k . v >= 0`, with `m_k` the plane through the point and edge
//! `k`, so what a piece `Q` of the polygon and a cone share is `Q` clipped by a few planes and convex again. What
//! is visible of `Q` past the cones `C_i, C_i+1, ..` is
//!
//! `V(Q, i) = F(Q) - sum_k>=i V(Q and C_k, k + 1)`
//!
//! with Lambert's formula `F` (inclusion and exclusion; Nishita and Nakamae 1985 for the cones). A piece that
//! lies wholly in one of its cones shows nothing, and one that lies outside of all of them needs no more than `F`.
//!
//! Everything is relative to the points. No length decides what is visible: the part of a
//! blocker in front of the seen polygon's plane hides, however thin or close; what lies in that plane, or
//! in one plane with the point, to within the rounding of the coordinates, does not.

use core::mem::swap;

use glam::Vec3;
use heapless::Vec;

use super::lambert::{CORNERS, Outline, lambert};
use super::lanes::{ALL, Mask, Numbers, Vectors};
use crate::geometry::{Plane, Polygon};
use crate::visibility::{Body, FACES};

/// Most cones that may overlap at a place.
const DEPTH: usize = 8;

/// Share of a polygon below which what is left of it is rounding: blockers that share an edge leave
/// slivers between their pyramids.
const SLIVER: f32 = 2e-6;

/// Most blockers that really hide something from one receiver.
const CONES: usize = 16;

/// Most planes that bound their shadows together.
const PLANES: usize = 64;

/// What hides, in front of the seen polygon's plane.
#[derive(Clone, Debug)]
pub(super) enum Blocker<'v> {
    /// A surface.
    Face {
        plane: Plane,
        /// Its part before the seen polygon, relative to the same place as the points. A quad that is a little bent
        /// may be cut into six corners.
        outline: Vec<Vec3, 6>,
    },
    /// A body that all points are outside of.
    Body(&'v Body),
}

impl<'v> Blocker<'v> {
    /// A surface; `None` for what does not stand out of the plane of `seen`.
    pub(super) fn face(seen: &Polygon, surface: &Polygon, origin: Vec3) -> Option<Self> {
        let before = |v: &Vec3| {
            let (height, tolerance) = seen.height(*v);
            if height.abs() <= tolerance {
                0.0
            } else {
                height
            }
        };
        if !surface.vertices().iter().any(|v| before(v) > 0.0) {
            return None;
        }
        let mut outline = Vec::new();
        for (a, b) in surface.edges().filter(|(a, b)| a != b) {
            let (height_a, height_b) = (before(&a), before(&b));
            let (a, b) = (a - origin, b - origin);
            if height_a >= 0.0 {
                outline.push(a).ok()?;
            }
            if height_a * height_b < 0.0 {
                let at = height_a / (height_a - height_b);
                outline.push(a + (b - a) * at).ok()?;
            }
        }
        let plane = surface.plane();
        Some(Self::Face { plane, outline })
    }

    /// A body; `None` where a point with these corners around it may be inside, or the plane of `seen` cuts it.
    pub(super) fn body(seen: &Polygon, body: &'v Body, corners: &[Vec3]) -> Option<Self> {
        (body.is_before(&seen.plane()) && body.is_outside(corners)).then_some(Self::Body(body))
    }
}

/// Four points of a receiver.
#[derive(Clone, Copy, Debug)]
pub(super) struct Points {
    /// Where they are.
    pub world: Vectors,
    /// Relative to the place that outlines are relative to.
    pub relative: Vectors,
    /// Their largest coordinates.
    pub magnitude: Numbers,
}

impl Points {
    /// [`Plane::height`] of each.
    pub(super) fn height(&self, plane: &Plane) -> (Numbers, Numbers) {
        let height = (self.world - Vectors::all(plane.origin)).dot(Vectors::all(plane.normal));
        (height, self.magnitude.map(|size| plane.tolerance(size)))
    }
}

/// The shadow pyramids of the blockers, inside where every `plane . v >= 0`.
struct Cones {
    /// Planes with the lanes in which they bound a pyramid, cone by cone.
    planes: Vec<(Vectors, Mask), PLANES>,
    /// Where the planes of each cone end.
    ends: Vec<usize, CONES>,
}

/// In which lanes a piece is partly inside of a cone, and in which wholly.
struct Shade {
    some: Mask,
    all: Mask,
}

impl Cones {
    const EMPTY: Self = Self {
        planes: Vec::new(),
        ends: Vec::new(),
    };

    /// Adds the cones of a blocker; tells in which lanes it is seen as more than a line.
    fn add(&mut self, blocker: &Blocker, points: &Points) -> Option<Mask> {
        match blocker {
            Blocker::Face { plane, outline } => self.add_face(points, plane, outline),
            Blocker::Body(body) => self.add_body(points, body),
        }
    }

    fn add_face(&mut self, points: &Points, plane: &Plane, outline: &[Vec3]) -> Option<Mask> {
        let (height, tolerance) = points.height(plane);
        // Seen from its front a polygon runs counter-clockwise, and its cone is to the left of its edges.
        let side = height.map(|height| if height > 0.0 { -1.0 } else { 1.0 });
        let mut from = Vectors::all(*outline.last()?) - points.relative;
        for to in outline {
            let to = Vectors::all(*to) - points.relative;
            self.planes.push((from.cross(to) * side, ALL)).ok()?;
            from = to;
        }
        Some(height.above(tolerance) | (-height).above(tolerance))
    }

    /// The planes through the edges between a face that is seen and one that is not.
    fn add_body(&mut self, points: &Points, body: &Body) -> Option<Mask> {
        let mut seen = [0; FACES];
        for (seen, plane) in seen.iter_mut().zip(&body.planes) {
            let (height, tolerance) = points.height(plane);
            *seen = height.above(tolerance);
        }
        for edge in &body.edges {
            let [left, right] = edge.faces.map(|face| seen.get(face).copied().unwrap_or(0));
            if left != right {
                let from = Vectors::all(edge.from) - points.world;
                let to = Vectors::all(edge.to) - points.world;
                let one = Numbers::all(1.0);
                let side = one.within(right & !left) - one.within(left & !right);
                self.planes.push((from.cross(to) * side, left ^ right)).ok()?;
            }
        }
        Some(ALL)
    }

    fn planes(&self, cone: usize) -> &[(Vectors, Mask)] {
        let before = cone.checked_sub(1).and_then(|last| self.ends.get(last));
        let first = before.copied().unwrap_or(0);
        let last = self.ends.get(cone).copied().unwrap_or(self.planes.len());
        self.planes.get(first..last).unwrap_or_default()
    }
}

fn shade(planes: &[(Vectors, Mask)], piece: &Outline, lanes: Mask) -> Shade {
    let (mut touches, mut crosses) = (lanes, 0);
    for (plane, bounds) in planes {
        let (mut highest, mut lowest) = (Numbers::all(f32::MIN), Numbers::all(f32::MAX));
        for v in piece {
            let height = plane.dot(*v);
            highest = highest.max(height);
            lowest = lowest.min(height);
        }
        touches &= highest.above(Numbers::ZERO) | !bounds;
        crosses |= Numbers::ZERO.above(lowest);
        if touches == 0 {
            break;
        }
    }
    Shade {
        some: touches & crosses,
        all: touches & !crosses,
    }
}

/// What a piece shares with a cone in those of some lanes in which every cut meets the same edges
/// as in the first of them; in which it does.
fn share<'b>(
    planes: &[(Vectors, Mask)],
    piece: &Outline,
    lanes: Mask,
    [mut part, mut spare]: [&'b mut Outline; 2],
) -> Option<(&'b Outline, Mask)> {
    let first = lanes.trailing_zeros();
    let mut alike = lanes;
    part.clear();
    part.extend_from_slice(piece).ok()?;
    for (plane, _) in planes {
        let mut heights = Vec::<Numbers, CORNERS>::new();
        let (mut insides, mut corner) = (0_u32, 1);
        for v in part.iter() {
            let height = plane.dot(*v);
            let inside = height.at_least(Numbers::ZERO);
            let is_inside = inside >> first & 1 == 1;
            alike &= if is_inside { inside } else { !inside };
            insides |= if is_inside { corner } else { 0 };
            corner <<= 1;
            heights.push(height).ok()?;
        }
        if insides + 1 == corner {
            continue;
        }
        spare.clear();
        let (Some(mut a), Some(mut height_a)) = (part.last(), heights.last()) else {
            break;
        };
        let mut a_inside = insides & corner >> 1 != 0;
        for (b, height_b) in part.iter().zip(&heights) {
            let b_inside = insides & 1 == 1;
            insides >>= 1;
            if a_inside != b_inside {
                let at = *height_a / (*height_a - *height_b);
                spare.push(*a + (*b - *a) * at).ok()?;
            }
            if b_inside {
                spare.push(*b).ok()?;
            }
            (a, height_a, a_inside) = (b, height_b, b_inside);
        }
        swap(&mut part, &mut spare);
        if part.len() < 3 {
            part.clear();
            break;
        }
    }
    Some((part, alike))
}

/// How much a blocker hides of an outline from all points between some corners.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Hides {
    Nothing,
    Something,
    Everything,
}

/// The side of a plane through an edge and a point on which a corner of the outline lies is linear in the
/// point: where it is the same at four corners, it is so between them.
pub(super) fn hides(blocker: &Blocker, corners: &Points, outline: &[Vec3]) -> Hides {
    let seen = outline.iter().map(|v| Vectors::all(*v) - corners.relative);
    let piece: Outline = seen.collect();
    let mut cones = Cones::EMPTY;
    let is_seen_alike = |plane: &Plane| {
        let (height, tolerance) = corners.height(plane);
        [0, ALL].contains(&height.above(tolerance))
    };
    // A face seen from both sides is two; a body may be seen from several and shows each an outline of its own.
    let (is_one, mut is_everything) = match blocker {
        Blocker::Face { plane, .. } => (is_seen_alike(plane), true),
        Blocker::Body(body) => (true, body.planes.iter().all(is_seen_alike)),
    };
    if !is_one || cones.add(blocker, corners) != Some(ALL) {
        return Hides::Something;
    }
    for (plane, _) in cones.planes(0) {
        let (mut inside, mut outside) = (ALL, ALL);
        for v in &piece {
            let height = plane.dot(*v);
            inside &= height.above(Numbers::ZERO);
            outside &= Numbers::ZERO.above(height);
        }
        if outside == ALL {
            return Hides::Nothing;
        }
        is_everything &= inside == ALL;
    }
    if is_everything {
        Hides::Everything
    } else {
        Hides::Something
    }
}

/// The form factors from four points with a normal to what they see of an outline, which is above their
/// horizon.
///
/// `None` when more blockers overlap than the scratch memory holds.
pub(super) fn visible_factors(
    points: &Points,
    normal: Vec3,
    outline: &[Vec3],
    blockers: &[Blocker],
) -> Option<Numbers> {
    let seen = outline.iter().map(|v| Vectors::all(*v) - points.relative);
    let piece: Outline = seen.collect();
    let mut cones = Cones::EMPTY;
    let (mut lit, mut cuts) = (ALL, [0; CONES]);
    for blocker in blockers {
        let first = cones.planes.len();
        let lanes = cones.add(blocker, points)?;
        let shade = shade(cones.planes(cones.ends.len()), &piece, lanes);
        lit &= !shade.all;
        if lit == 0 {
            return Some(Numbers::ZERO);
        }
        if shade.some == 0 {
            cones.planes.truncate(first);
        } else {
            *cuts.get_mut(cones.ends.len())? = shade.some;
            cones.ends.push(cones.planes.len()).ok()?;
        }
    }
    let open = lambert(normal, &piece);
    let hidden = hidden(&cones, normal, &piece, lit, &cuts, DEPTH)?;
    let seen = (open - hidden).zip(open, |sum, open| if sum > SLIVER * open { sum } else { 0.0 });
    Some(seen.within(lit))
}

/// `sum_k V(Q and C_k, k + 1)` of the lit lanes of a piece `Q`, `cuts` being the lanes in which cone
/// `C_k` cuts it.
fn hidden(
    cones: &Cones,
    normal: Vec3,
    piece: &Outline,
    lit: Mask,
    cuts: &[Mask; CONES],
    depth: usize,
) -> Option<Numbers> {
    let mut sum = Numbers::ZERO;
    let (mut one, mut other) = (Outline::new(), Outline::new());
    for (cone, cut) in cuts.iter().enumerate() {
        let mut waiting = cut & lit;
        while waiting != 0 {
            let (part, alike) = share(cones.planes(cone), piece, waiting, [&mut one, &mut other])?;
            waiting &= !alike;
            if part.is_empty() {
                continue;
            }
            let (mut lit, mut later) = (alike, [0; CONES]);
            let cuts = cuts.iter().zip(&mut later).enumerate().skip(cone + 1);
            for (cone, (cut, later)) in cuts {
                if cut & lit != 0 {
                    let shade = shade(cones.planes(cone), part, cut & lit);
                    lit &= !shade.all;
                    *later = shade.some;
                }
            }
            if lit != 0 {
                let open = lambert(normal, part);
                let hidden = if later == [0; CONES] {
                    Numbers::ZERO
                } else {
                    hidden(cones, normal, part, lit, &later, depth.checked_sub(1)?)?
                };
                sum = sum + (open - hidden).within(lit);
            }
        }
    }
    Some(sum)
}
