//! What a point sees of a polygon behind blockers: exact clipping, then Lambert's formula.
//!
//! `F_xP = 1/(2 pi) sum_k theta_k n . (r_k+1 x r_k) / |r_k x r_k+1|` for a convex polygon `P` in front of the
//! point; `r_k` run from `x` to its vertices and `theta_k` is the angle between `r_k` and `r_k+1`. The
//! shadow of a convex blocker is the cone of the half spaces through `x` and its edges, beyond its own plane;
//! target and shadow meet in a convex polygon. Where shadows overlap, the later one loses, piece
//! by piece, what the earlier ones hide already.
//!
//! Assumption: target and blockers are clipped to the front of the point's plane.
//!
//! # References
//! * J. H. Lambert, *Photometria*, 1760, section 4.
//! * T. Nishita, E. Nakamae, *Continuous tone representation of three-dimensional objects taking account of
//!   shadows and interreflection*, SIGGRAPH 1985: shadows of convex polygons by clipping.

use std::f64::consts::TAU;

use glam::DVec3;

use super::Face;
use super::polygon::{Bounds, bounds, clip, clip_into, edges};

/// A half space `n . v >= offset`, seen from the point.
type HalfSpace = (DVec3, f64);

/// A convex obstacle between a domain of points and a target.
#[derive(Clone, Debug)]
pub(super) struct Blocker {
    /// Its outline, clipped to the fronts of both polygons.
    pub(super) face: Face,
    /// The box around it.
    pub(super) bounds: Bounds,
    /// The box around the part of the domain whose points it can hide something from.
    pub(super) footprint_bounds: Bounds,
    /// Side of the plane that the target is on: 1 front, -1 back, 0 where the plane cuts it.
    target_side: f64,
}

impl Blocker {
    /// `None` where no line from the domain to the target meets the face; heights up to `grain` are none.
    pub(super) fn new(face: Face, domain: &Face, target: &Face, grain: f64) -> Option<Self> {
        let mut footprint = domain.outline.clone();
        for (point, normal) in penumbra(&face, target, grain) {
            footprint = clip(&footprint, grain, |v| normal.dot(v - point));
        }
        if footprint.is_empty() {
            return None;
        }
        let heights = target.outline.iter().map(|v| face.height(*v));
        let (low, high) = heights.fold((0.0, 0.0), |(low, high), h| (h.min(low), h.max(high)));
        let target_side = match (low < -grain, high > grain) {
            (false, true) => 1.0,
            (true, false) => -1.0,
            (true, true) => 0.0,
            (false, false) => return None,
        };
        Some(Self {
            bounds: bounds(&face.outline),
            footprint_bounds: bounds(&footprint),
            face,
            target_side,
        })
    }
}

/// Planes through an edge of one and a vertex of the other that part blocker and target, as a point and
/// the unit normal on the blocker's side. Only points on that side can have the blocker before the target.
fn penumbra(blocker: &Face, target: &Face, grain: f64) -> Vec<(DVec3, DVec3)> {
    let mut planes = Vec::new();
    let (blocker, target) = (&blocker.outline[..], &target.outline[..]);
    for (with_edge, with_vertex) in [(blocker, target), (target, blocker)] {
        for (a, b) in edges(with_edge) {
            for v in with_vertex {
                let normal = (b - a).cross(*v - a);
                if normal.length() <= grain * a.distance(b) {
                    continue;
                }
                let normal = normal.normalize();
                for normal in [normal, -normal] {
                    let parts = blocker.iter().all(|w| normal.dot(*w - a) >= -grain)
                        && target.iter().all(|w| normal.dot(*w - a) <= grain);
                    if parts {
                        planes.push((a, normal));
                    }
                }
            }
        }
    }
    planes
}

/// A target behind blockers, with the storage that a point's view of it needs.
#[derive(Debug)]
pub(super) struct View<'a> {
    /// Unit normal of the plane that the points lie in.
    pub(super) normal: DVec3,
    pub(super) target: &'a [DVec3],
    pub(super) blockers: &'a [Blocker],
    /// Half spaces of the shadows that were cast so far, one after the other.
    half_spaces: Vec<HalfSpace>,
    /// Where each shadow's half spaces start.
    starts: Vec<usize>,
    seen: Vec<DVec3>,
    part: Vec<DVec3>,
    spare: Vec<DVec3>,
}

impl<'a> View<'a> {
    pub(super) fn new(normal: DVec3, target: &'a [DVec3], blockers: &'a [Blocker]) -> Self {
        Self {
            normal,
            target,
            blockers,
            half_spaces: Vec::new(),
            starts: Vec::new(),
            seen: Vec::new(),
            part: Vec::new(),
            spare: Vec::new(),
        }
    }

    /// Form factors from `x` to the whole target and to the part of it that is hidden.
    pub(super) fn whole_and_hidden(&mut self, x: DVec3) -> (f64, f64) {
        self.seen.clear();
        self.seen.extend(self.target.iter().map(|v| *v - x));
        self.half_spaces.clear();
        self.starts.clear();
        let blockers = self.blockers;
        let hidden = blockers
            .iter()
            .map(|blocker| self.newly_hidden(x, blocker))
            .sum();
        (lambert(self.normal, &self.seen), hidden)
    }

    /// Form factor to what a blocker hides and those before it do not.
    fn newly_hidden(&mut self, x: DVec3, blocker: &Blocker) -> f64 {
        let start = self.half_spaces.len();
        if !cast(x, blocker, &mut self.half_spaces) {
            return 0.0;
        }
        let seen = &self.seen;
        let misses = |(n, offset): &HalfSpace| seen.iter().all(|v| n.dot(*v) <= *offset);
        if self.half_spaces[start..].iter().any(misses) {
            self.half_spaces.truncate(start);
            return 0.0;
        }
        self.part.clone_from(seen);
        for (n, offset) in &self.half_spaces[start..] {
            clip_into(&self.part, &mut self.spare, 0.0, |v| n.dot(v) - offset);
            std::mem::swap(&mut self.part, &mut self.spare);
            if self.part.is_empty() {
                self.half_spaces.truncate(start);
                return 0.0;
            }
        }

        if self.starts.is_empty() {
            self.starts.push(start);
            return lambert(self.normal, &self.part);
        }
        let mut pieces = vec![self.part.clone()];
        for (k, first) in self.starts.iter().enumerate() {
            let end = self.starts.get(k + 1).copied().unwrap_or(start);
            let shadow = &self.half_spaces[*first..end];
            pieces = pieces
                .into_iter()
                .flat_map(|piece| outside(piece, shadow))
                .collect();
        }
        self.starts.push(start);
        pieces.iter().map(|piece| lambert(self.normal, piece)).sum()
    }
}

/// Appends the half spaces of a blocker's shadow; false when it casts none on the target.
fn cast(x: DVec3, blocker: &Blocker, half_spaces: &mut Vec<HalfSpace>) -> bool {
    let height = blocker.face.height(x);
    if height == 0.0 || height * blocker.target_side > 0.0 {
        return false;
    }
    let side = -height.signum();
    if blocker.target_side == 0.0 {
        half_spaces.push((blocker.face.normal * side, height.abs()));
    }
    let planes = edges(&blocker.face.outline).map(|(a, b)| ((a - x).cross(b - x) * side, 0.0));
    half_spaces.extend(planes);
    true
}

/// What is left of a convex piece outside a shadow, in convex pieces.
fn outside(piece: Vec<DVec3>, shadow: &[HalfSpace]) -> Vec<Vec<DVec3>> {
    let misses = |(n, offset): &HalfSpace| piece.iter().all(|v| n.dot(*v) <= *offset);
    if shadow.iter().any(misses) {
        return vec![piece];
    }
    let (mut rest, mut left) = (piece, Vec::new());
    let mut part = Vec::new();
    for (n, offset) in shadow {
        clip_into(&rest, &mut part, 0.0, |v| offset - n.dot(v));
        if !part.is_empty() {
            left.push(part.clone());
        }
        clip_into(&rest, &mut part, 0.0, |v| n.dot(v) - offset);
        std::mem::swap(&mut rest, &mut part);
    }
    left
}

/// Lambert's sum for an outline seen from the origin, from its front; at least 0.
fn lambert(normal: DVec3, outline: &[DVec3]) -> f64 {
    let sum: f64 = edges(outline)
        .map(|(a, b)| {
            let cross = b.cross(a);
            let sine = cross.length();
            if sine > 0.0 {
                sine.atan2(a.dot(b)) * normal.dot(cross) / sine
            } else {
                0.0
            }
        })
        .sum();
    (sum / TAU).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of half width `half` about the axis, `z` above the origin and facing it.
    fn plate(x: f64, z: f64, half: f64) -> Face {
        let corners = [(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)];
        Face {
            outline: corners
                .map(|(u, v)| DVec3::new(x + u * half, v * half, z))
                .to_vec(),
            normal: -DVec3::Z,
        }
    }

    /// Form factor of a point to a square straight above it: four times Howell B-3.
    fn above(half: f64, z: f64) -> f64 {
        let x = half / z;
        4.0 * 2.0 * x / x.hypot(1.0) * (x / x.hypot(1.0)).atan() / TAU
    }

    fn seen(blockers: Vec<Face>) -> (f64, f64) {
        let domain = Face {
            outline: plate(0.0, 0.0, 1.0).outline.into_iter().rev().collect(),
            normal: DVec3::Z,
        };
        let target = plate(0.0, 1.0, 1.0);
        let blockers = blockers.into_iter();
        let blockers: Vec<Blocker> = blockers
            .filter_map(|face| Blocker::new(face, &domain, &target, 1e-14))
            .collect();
        View::new(DVec3::Z, &target.outline, &blockers).whole_and_hidden(DVec3::ZERO)
    }

    #[test]
    fn a_plate_hides_what_its_shadow_covers_and_overlaps_count_once() {
        let (whole, hidden) = seen(vec![plate(0.0, 0.5, 0.25)]);
        assert!((whole - above(1.0, 1.0)).abs() < 1e-15, "{whole}");
        assert!((hidden - above(0.25, 0.5)).abs() < 1e-15, "{hidden}");
        // A second plate at another height with the same shadow, and a third inside that.
        let shadows = vec![
            plate(0.0, 0.5, 0.25),
            plate(0.0, 0.25, 0.125),
            plate(0.0, 0.75, 0.3),
        ];
        let (_, hidden) = seen(shadows);
        assert!((hidden - above(0.25, 0.5)).abs() < 1e-15, "{hidden}");
    }

    #[test]
    fn overlapping_shadows_do_not_depend_on_their_order() {
        let plates = [
            plate(0.1, 0.5, 0.25),
            plate(-0.1, 0.3, 0.2),
            plate(0.3, 0.7, 0.3),
        ];
        let (_, there) = seen(plates.to_vec());
        let (_, back) = seen(plates.into_iter().rev().collect());
        assert!((there - back).abs() < 1e-15, "{there} {back}");
    }

    #[test]
    fn blockers_beside_the_lines_of_sight_are_left_out() {
        let (domain, target) = (plate(0.0, 0.0, 1.0), plate(0.0, 1.0, 1.0));
        for beside in [plate(3.0, 0.5, 0.5), plate(2.0, 0.5, 1.0)] {
            assert!(Blocker::new(beside, &domain, &target, 1e-14).is_none());
        }
        assert!(Blocker::new(plate(1.0, 0.5, 0.5), &domain, &target, 1e-14).is_some());
    }
}
