//! What a point sees of a polygon, exactly: the outline minus the shadow pyramid of every blocker.
//!
//! A blocker hides from the origin what lies in the cone through its outline, behind it. The cone of
//! a convex polygon is where every `m_k . v >= 0`, with `m_k` the plane through the origin and edge
//! `k`; a convex piece of the polygon minus a cone is the piece cut by one plane after the other, so
//! everything stays convex and Lambert's formula sums the pieces (Nishita and Nakamae 1985).
//!
//! Everything is relative to the point. No length decides what is visible: the part of a
//! blocker in front of the seen polygon's plane hides, however thin or close; what lies in that plane, or
//! in one plane with the point, to within the rounding of the coordinates, does not.

use glam::Vec3;
use heapless::Vec;

use super::lambert::lambert;
use crate::geometry::{Clipped, Polygon, clip};

/// Most pieces that wait to be cut.
const PIECES: usize = 24;

/// Share of a polygon below which what is left of it is rounding: blockers that share an edge leave
/// slivers between their pyramids.
const SLIVER: f32 = 2e-6;

/// Most blockers that really hide something from one point.
const CONES: usize = 16;

/// The planes of a shadow pyramid, inside where `plane . v >= 0`.
type Cone = Vec<Vec3, 5>;

/// The form factor from a point to what it sees of `polygon`; `outline` is the polygon relative to
/// the point and above its horizon.
///
/// `None` when more blockers overlap than the scratch memory holds.
pub(super) fn visible_factor(
    point: Vec3,
    normal: Vec3,
    polygon: &Polygon,
    outline: Clipped,
    blockers: &[&Polygon],
) -> Option<f32> {
    let mut cones = Vec::<Cone, CONES>::new();
    for blocker in blockers {
        let Some(cone) = cone(point, polygon, blocker) else {
            continue;
        };
        match shade(&cone, &outline) {
            Shade::Nothing => {}
            Shade::All => return Some(0.0),
            Shade::Some => cones.push(cone).ok()?,
        }
    }

    let least = SLIVER * lambert(normal, &outline);
    let mut sum = 0.0;
    let mut waiting = Vec::<(Clipped, usize), PIECES>::new();
    waiting.push((outline, 0)).ok()?;
    while let Some((piece, next)) = waiting.pop() {
        let Some(cone) = cones.get(next) else {
            sum += lambert(normal, &piece);
            continue;
        };
        match shade(cone, &piece) {
            Shade::Nothing => waiting.push((piece, next + 1)).ok()?,
            Shade::All => {}
            Shade::Some => {
                let mut inside = piece;
                for plane in cone {
                    let outside = cut(&inside, |v| -plane.dot(v))?;
                    if !outside.is_empty() {
                        waiting.push((outside, next + 1)).ok()?;
                    }
                    inside = cut(&inside, |v| plane.dot(v))?;
                }
            }
        }
    }
    Some(if sum > least { sum } else { 0.0 })
}

/// [`clip`], unless the outline has too many corners for it.
fn cut(outline: &Clipped, height: impl Fn(Vec3) -> f32) -> Option<Clipped> {
    (outline.len() < outline.capacity()).then(|| clip(outline, height))
}

/// How much of a piece a cone covers.
enum Shade {
    Nothing,
    Some,
    All,
}

fn shade(cone: &Cone, piece: &Clipped) -> Shade {
    let mut all = true;
    for plane in cone {
        let (mut inside, mut outside) = (false, false);
        for v in piece {
            let height = plane.dot(*v);
            inside |= height > 0.0;
            outside |= height < 0.0;
        }
        if !inside {
            return Shade::Nothing;
        }
        all &= !outside;
    }
    if all { Shade::All } else { Shade::Some }
}

/// The shadow pyramid of the part of a blocker that is in front of the seen polygon's plane.
fn cone(point: Vec3, polygon: &Polygon, blocker: &Polygon) -> Option<Cone> {
    let (height, tolerance) = blocker.height(point);
    if height.abs() <= tolerance {
        return None;
    }
    let before = |v: &Vec3| {
        let (height, tolerance) = polygon.height(*v);
        if height.abs() <= tolerance {
            0.0
        } else {
            height
        }
    };
    let mut outline = Clipped::new();
    let vertices = blocker.vertices();
    let next = vertices.iter().cycle().skip(1);
    for (a, b) in vertices.iter().zip(next) {
        let (height_a, height_b) = (before(a), before(b));
        if height_a >= 0.0 {
            outline.push(*a - point).ok()?;
        }
        if height_a * height_b < 0.0 {
            let crossing = *a + (*b - *a) * (height_a / (height_a - height_b));
            outline.push(crossing - point).ok()?;
        }
    }
    let stands_out = vertices.iter().any(|v| before(v) > 0.0);
    if outline.len() < 3 || !stands_out {
        return None;
    }
    // Seen from its front a polygon runs counter-clockwise, and its cone is to the left of its edges.
    let side = if height > 0.0 { -1.0 } else { 1.0 };
    let next = outline.iter().cycle().skip(1);
    let planes = outline.iter().zip(next).map(|(a, b)| a.cross(*b) * side);
    Some(
        planes
            .filter(|plane| *plane != Vec3::ZERO)
            .take(5)
            .collect(),
    )
}
