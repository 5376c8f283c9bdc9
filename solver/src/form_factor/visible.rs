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
use crate::geometry::{Plane, Polygon, as_many};
use crate::visibility::{Body, FACES};

/// Most cones that may overlap at a place.
const DEPTH: usize = 6;

/// Share of a polygon below which what is left of it is rounding: blockers that share an edge leave
/// slivers between their pyramids.
const SLIVER: f32 = 2e-6;

/// Most blockers that really hide something from one receiver.
const CONES: usize = 32;

/// Most planes that bound their shadows together.
const PLANES: usize = 128;

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

    /// A surface in the plane of the seen one, on top of it.
    pub(super) fn cover(surface: &Polygon, origin: Vec3) -> Self {
        let vertices = surface.vertices().iter();
        Self::Face {
            plane: surface.plane(),
            outline: vertices.map(|v| *v - origin).collect(),
        }
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

/// How a piece lies to a cone.
#[derive(Clone, Copy, Default)]
struct Shade {
    /// Lanes in which it is partly inside.
    some: Mask,
    /// Lanes in which it is wholly inside.
    all: Mask,
    /// The planes of the cone that cut it: one bit for each.
    cut_by: u32,
}

impl Cones {
    fn new() -> Self {
        Self {
            planes: Vec::new(),
            ends: Vec::new(),
        }
    }

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
                self.planes
                    .push((from.cross(to) * side, left ^ right))
                    .ok()?;
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

fn shade(planes: &[(Vectors, Mask)], piece: &[Vectors], lanes: Mask) -> Shade {
    let mut shade = Shade::default();
    let (mut touches, mut crosses) = (lanes, 0);
    if lanes == 0 {
        return shade;
    }
    for ((plane, bounds), number) in planes.iter().zip(0..) {
        let (mut highest, mut lowest) = (Numbers::all(f32::MIN), Numbers::all(f32::MAX));
        for v in piece {
            let height = plane.dot(*v);
            highest = highest.max(height);
            lowest = lowest.min(height);
        }
        touches &= highest.above(Numbers::ZERO) | !bounds;
        if touches == 0 {
            return shade;
        }
        let cut = Numbers::ZERO.above(lowest);
        crosses |= cut;
        shade.cut_by |= u32::from(cut != 0) << number;
    }
    shade.some = touches & crosses;
    shade.all = touches & !crosses;
    shade
}

/// What a piece shares with a cone in those of some lanes in which every cut meets the same edges
/// as in the first of them; in which it does.
fn share<'b>(
    planes: &[(Vectors, Mask)],
    cut_by: u32,
    piece: &[Vectors],
    lanes: Mask,
    [mut part, mut spare]: [&'b mut Outline; 2],
) -> Option<(&'b Outline, Mask)> {
    let (mut alike, mut is_whole) = (lanes, true);
    let cutting = planes.iter().zip(0..);
    for ((plane, _), _) in cutting.filter(|(_, number)| cut_by >> number & 1 == 1) {
        let from = if is_whole { piece } else { &*part };
        alike = cut(from, plane, alike, spare)?;
        swap(&mut part, &mut spare);
        is_whole = false;
    }
    Some((part, alike))
}

/// The part of a piece on the inner side of a plane, for those of some lanes in which the same corners
/// are inside as in the first of them: these lanes.
fn cut(piece: &[Vectors], plane: &Vectors, lanes: Mask, part: &mut Outline) -> Option<Mask> {
    let first = lanes.trailing_zeros();
    let mut alike = lanes;
    let mut heights = Vec::<(Numbers, bool), CORNERS>::new();
    for v in piece {
        let height = plane.dot(*v);
        let inside = height.at_least(Numbers::ZERO);
        let is_inside = inside >> first & 1 == 1;
        alike &= if is_inside { inside } else { !inside };
        heights.push((height, is_inside)).ok()?;
    }
    part.clear();
    let corners = piece.iter().zip(&heights);
    let Some((mut a, mut at_a)) = corners.clone().next_back() else {
        return Some(alike);
    };
    for (b, at_b) in corners {
        if at_a.1 != at_b.1 {
            part.push(*a + (*b - *a) * (at_a.0 / (at_a.0 - at_b.0)))
                .ok()?;
        }
        if at_b.1 {
            part.push(*b).ok()?;
        }
        (a, at_a) = (b, at_b);
    }
    if part.len() < 3 {
        part.clear();
    }
    Some(alike)
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
    let piece: Outline = as_many(seen);
    let mut cones = Cones::new();
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
    let piece: Outline = as_many(seen);
    let mut cones = Cones::new();
    let (mut lit, mut cuts) = (ALL, Vec::new());
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
            cuts.push(shade).ok()?;
            cones.ends.push(cones.planes.len()).ok()?;
        }
    }
    let open = lambert(normal, &piece);
    let hidden = hidden(&cones, normal, &piece, lit, &cuts, DEPTH)?;
    let seen = (open - hidden).zip(
        open,
        |sum, open| if sum > SLIVER * open { sum } else { 0.0 },
    );
    Some(seen.within(lit))
}

/// `sum_k V(Q and C_k, k + 1)` of the lit lanes of a piece `Q`, `cuts` telling how it lies to
/// the cones `C_k`.
fn hidden(
    cones: &Cones,
    normal: Vec3,
    piece: &[Vectors],
    lit: Mask,
    cuts: &Vec<Shade, CONES>,
    depth: usize,
) -> Option<Numbers> {
    let mut sum = Numbers::ZERO;
    let (mut one, mut other) = (Outline::new(), Outline::new());
    for (cone, cut) in cuts.iter().enumerate() {
        let mut waiting = cut.some & lit;
        while waiting != 0 {
            let buffers = [&mut one, &mut other];
            let (part, alike) = share(cones.planes(cone), cut.cut_by, piece, waiting, buffers)?;
            waiting &= !alike;
            if part.is_empty() {
                continue;
            }
            let (mut lit, mut later, mut is_cut) = (alike, Vec::new(), false);
            for (other, cut) in cuts.iter().enumerate() {
                let lanes = if other > cone { cut.some & lit } else { 0 };
                let shade = shade(cones.planes(other), part, lanes);
                lit &= !shade.all;
                is_cut |= shade.some != 0;
                later.push(shade).ok()?;
            }
            if lit != 0 {
                let open = lambert(normal, part);
                let hidden = if is_cut {
                    hidden(cones, normal, part, lit, &later, depth.checked_sub(1)?)?
                } else {
                    Numbers::ZERO
                };
                sum = sum + (open - hidden).within(lit);
            }
        }
    }
    Some(sum)
}
