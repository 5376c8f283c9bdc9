//! Rays against the surfaces of a scene: triangles in a tree of boxes, all in f64.
//!
//! A quad is two triangles over its own vertices, so surfaces that share an edge leave no crack,
//! also where a quad is flat only to within the rounding of its vertices.
//!
//! Vertices are `f32`: a coordinate is off by up to `2^-24 m`, with `m` the largest coordinate of
//! the scene, a point of a plane through such vertices by `sqrt(3)` times that, and a point that
//! was itself rounded by as much again. Within their sum, rounded up to `2^-22 m`, nobody can say
//! on which side of a surface a point lies. Rays therefore start that *margin* in front of their
//! surface and end that margin before their target: a surface never hides its own points or those
//! of one that coincides with it. What gets lost is the light of gaps thinner than the margin. Of surfaces that
//! a ray meets within the margin of each other it sees the one that emits towards it, else the last one that has a side there.
//!
//! # References
//! * J. Amanatides, K. Choi, *Ray tracing triangular meshes*, 1997 (Western Computer Graphics
//!   Symposium): a ray against the edges as signed volumes.
//! * B. Smits, *Efficiency issues for ray tracing*, Journal of Graphics Tools 3(2), 1998: the tree
//!   as a list with skips.

use glam::DVec3;
use relume::scene::Surface;

/// Share of the largest coordinate that is the margin: four roundings of an `f32`.
const MARGIN: f64 = 1.0 / (1u64 << 22) as f64;

/// Most triangles in a leaf of the tree.
const LEAF: usize = 4;

/// A triangle of a surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Triangle {
    pub(super) corners: [DVec3; 3],
    /// Unit normal of the front.
    pub(super) normal: DVec3,
    pub(super) area: f64,
    /// Number of the surface.
    pub(super) surface: usize,
}

impl Triangle {
    /// `None` without an area.
    pub(super) fn new(corners: [DVec3; 3], surface: usize) -> Option<Self> {
        let [a, b, c] = corners;
        let cross = (b - a).cross(c - a);
        let normal = cross.try_normalize()?;
        Some(Self {
            corners,
            normal,
            area: cross.length() / 2.0,
            surface,
        })
    }

    /// The point that two uniform numbers choose with equal density everywhere
    /// (Turk 1990, *Graphics Gems*, p. 24).
    pub(super) fn point(&self, u: f64, v: f64) -> DVec3 {
        let [a, b, c] = self.corners;
        let root = u.sqrt();
        a * (1.0 - root) + b * (root * (1.0 - v)) + c * (root * v)
    }

    /// Distance along the ray, in lengths of its direction; `None` when it misses.
    ///
    /// The ray passes the edge `a -> b` on the side that the sign of `d . (a x b)` tells. Swapping
    /// `a` and `b` flips exactly that sign, rounding included, and zero counts as inside: a ray
    /// through a shared edge hits at least one of its triangles. (Only one that meets a vertex to
    /// within 16 digits may miss them all.)
    fn hit(&self, origin: DVec3, direction: DVec3) -> Option<f64> {
        let [a, b, c] = self.corners.map(|v| v - origin);
        let sides = [a.cross(b), b.cross(c), c.cross(a)].map(|n| direction.dot(n));
        let inside = sides.iter().all(|s| *s >= 0.0) || sides.iter().all(|s| *s <= 0.0);
        let distance = self.normal.dot(a) / self.normal.dot(direction);
        (inside && distance > 0.0 && distance.is_finite()).then_some(distance)
    }
}

/// Where a ray met a surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hit {
    /// Number of the triangle.
    pub(super) triangle: usize,
    /// How far away, in lengths of the ray's direction.
    pub(super) distance: f64,
}

/// All surfaces, ready for rays.
#[derive(Debug)]
pub(super) struct Surfaces {
    pub(super) triangles: Vec<Triangle>,
    nodes: Vec<Node>,
    margin: f64,
    /// By surface: which of several in one place is seen from the front, and from the back.
    ranks: Vec<[usize; 2]>,
}

/// A box of the tree. Nodes stand in depth-first order.
#[derive(Debug)]
struct Node {
    low: DVec3,
    high: DVec3,
    /// Its triangles; none in a branch, whose first child is the next node.
    triangles: std::ops::Range<usize>,
    /// The node to go on with when the ray misses this one.
    skip: usize,
}

impl Surfaces {
    pub(super) fn new(surfaces: &[Surface]) -> Self {
        let mut triangles = Vec::new();
        for (number, surface) in surfaces.iter().enumerate() {
            let vertices = surface.polygon().vertices();
            let corners: Vec<DVec3> = vertices.iter().map(|v| v.as_dvec3()).collect();
            triangles.extend(fan(&corners, number));
        }
        let corners = triangles.iter().flat_map(|t| t.corners);
        let largest = corners.map(|v| v.abs().max_element()).fold(0.0, f64::max);

        let mut all = Self {
            triangles,
            nodes: Vec::new(),
            margin: largest * MARGIN,
            ranks: (1..)
                .zip(surfaces)
                .map(|(number, surface)| {
                    let emitting = usize::from(surface.emission().is_some()) * surfaces.len();
                    [
                        number + emitting,
                        usize::from(surface.is_two_sided()) * number,
                    ]
                })
                .collect(),
        };
        all.divide(0..all.triangles.len());
        all
    }

    /// Appends the tree over a range of triangles: halves along the longest side of their box.
    fn divide(&mut self, range: std::ops::Range<usize>) {
        let part = &mut self.triangles[range.clone()];
        let corners = || part.iter().flat_map(|t| t.corners);
        let (Some(low), Some(high)) = (corners().reduce(DVec3::min), corners().reduce(DVec3::max))
        else {
            return;
        };
        let is_leaf = range.len() <= LEAF;
        let axis = (high - low).max_position();
        if !is_leaf {
            let middle = |t: &Triangle| t.corners.iter().map(|v| v[axis]).sum::<f64>();
            part.sort_by(|a, b| middle(a).total_cmp(&middle(b)));
        }

        // A margin around the box is far more than its own rounding.
        let number = self.nodes.len();
        self.nodes.push(Node {
            low: low - self.margin,
            high: high + self.margin,
            triangles: if is_leaf { range.clone() } else { 0..0 },
            skip: 0,
        });
        if !is_leaf {
            let middle = range.start + range.len() / 2;
            self.divide(range.start..middle);
            self.divide(middle..range.end);
        }
        self.nodes[number].skip = self.nodes.len();
    }

    /// Visits the hits nearer than `limit`; `seen` returns the new limit.
    fn visit(
        &self,
        origin: DVec3,
        direction: DVec3,
        mut limit: f64,
        mut seen: impl FnMut(Hit) -> f64,
    ) {
        let inverse = direction.recip();
        let mut next = 0;
        while let Some(node) = self.nodes.get(next) {
            let (to_low, to_high) = (
                (node.low - origin) * inverse,
                (node.high - origin) * inverse,
            );
            let enter = to_low.min(to_high).max_element().max(0.0);
            let leave = to_low.max(to_high).min_element().min(limit);
            if enter > leave {
                next = node.skip;
                continue;
            }
            for triangle in node.triangles.clone() {
                if let Some(distance) = self.triangles[triangle].hit(origin, direction)
                    && distance < limit
                {
                    limit = seen(Hit { triangle, distance });
                }
            }
            next += 1;
        }
    }

    /// Where a ray may start that leaves a surface at `point` towards `normal`.
    pub(super) fn in_front(&self, point: DVec3, normal: DVec3) -> DVec3 {
        point + normal * self.margin
    }

    /// The first surface that a ray of this direction, a unit vector, meets.
    pub(super) fn first_hit(&self, origin: DVec3, direction: DVec3) -> Option<Hit> {
        let rank = |hit: &Hit| {
            let triangle = &self.triangles[hit.triangle];
            let is_back = triangle.normal.dot(direction) > 0.0;
            self.ranks[triangle.surface][usize::from(is_back)]
        };
        let mut first: Option<Hit> = None;
        let mut nearest = f64::INFINITY;
        self.visit(origin, direction, f64::INFINITY, |hit| {
            let is_nearer = hit.distance < nearest - self.margin;
            if is_nearer || first.is_none_or(|other| rank(&hit) > rank(&other)) {
                first = Some(hit);
            }
            nearest = nearest.min(hit.distance);
            nearest + self.margin
        });
        first
    }

    /// True when nothing stands on the way from `from` to a margin before `to`.
    pub(super) fn is_open(&self, from: DVec3, to: DVec3) -> bool {
        let way = to - from;
        let length = way.length();
        self.is_free(from, way / length, length - self.margin)
    }

    /// True when a ray of this direction, a unit vector, meets nothing nearer than `limit`.
    pub(super) fn is_free(&self, from: DVec3, direction: DVec3, limit: f64) -> bool {
        let mut is_free = true;
        self.visit(from, direction, limit, |_| {
            is_free = false;
            f64::NEG_INFINITY
        });
        is_free
    }
}

/// The triangles of a convex outline, around its first vertex.
pub(super) fn fan(outline: &[DVec3], surface: usize) -> Vec<Triangle> {
    let Some((first, rest)) = outline.split_first() else {
        return Vec::new();
    };
    rest.windows(2)
        .filter_map(|pair| Triangle::new([*first, pair[0], pair[1]], surface))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builtin::{furnace_with_box, published};
    use crate::reference::path_trace::random::Random;

    #[test]
    fn the_tree_finds_what_a_loop_over_all_triangles_finds() {
        let Some(scene) = published::scene("gazebo") else {
            return;
        };
        let surfaces = Surfaces::new(&scene.surfaces);
        let flat = Surfaces::new(&scene.surfaces[..0]);
        let mut random = Random::new(1, 0);
        let (mut hits, mut differing) = (0, 0);
        for _ in 0..4000 {
            let mut vector = || DVec3::from_array([(); 3].map(|()| 2.0 * random.uniform() - 1.0));
            let (origin, direction) = (vector() * 2.0, vector().normalize());
            let found = surfaces.first_hit(origin, direction).map(|h| h.distance);
            let all = surfaces.triangles.iter();
            let expected = all
                .filter_map(|t| t.hit(origin, direction))
                .min_by(f64::total_cmp);
            hits += usize::from(expected.is_some());
            differing += usize::from(found != expected);
            assert_eq!(
                surfaces.is_free(origin, direction, f64::INFINITY),
                found.is_none()
            );
            assert!(flat.first_hit(origin, direction).is_none());
        }
        assert_eq!(differing, 0);
        assert!(hits > 1000, "{hits}");
    }

    #[test]
    fn no_ray_slips_through_a_shared_edge() {
        let room = furnace_with_box(0.5, 1.0).unwrap().scene;
        let surfaces = Surfaces::new(&room.surfaces[..6]);
        let edges = surfaces.triangles.iter().flat_map(|t| {
            let [a, b, c] = t.corners;
            [(a, b), (b, c), (c, a)]
        });
        let edges: Vec<(DVec3, DVec3)> = edges.collect();
        let mut random = Random::new(2, 0);
        for _ in 0..200 {
            let origin = DVec3::new(0.1, 0.1, 0.1) + random.uniform() * DVec3::new(1.7, 0.1, 0.8);
            for (from, to) in &edges {
                let target = from.lerp(*to, random.uniform());
                let hit = surfaces.first_hit(origin, target - origin);
                assert!(
                    hit.is_some_and(|h| h.distance <= 1.0 + 1e-12),
                    "{origin} {target} {hit:?}"
                );
            }
        }
    }
}
