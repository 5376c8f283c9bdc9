//! Visibility through a bounding volume hierarchy: the same answer as
//! [`relume::visibility::Occluders`], faster where there are many surfaces; and the nearest surface
//! along a ray.
//!
//! Trees come from `obvhs` and are built on one thread, so they are the same every time. For visibility
//! leaves ask [`Polygon::crossing`], so a segment is blocked here exactly when it is blocked on a
//! device; rays have a kernel of their own ([`Caster`]).

mod facet;
mod nearest;
mod stacks;

use std::time::Duration;

use glam::{Vec3, Vec3A};
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;
use obvhs::ray::Ray;
use obvhs::{Boundable, BvhBuildParams};

use relume::geometry::Polygon;
use relume::luminaire;
use relume::mesh::Side;
use relume::scene::{Scene, Source, Surface};
use relume::visibility::{Body, Bounds, Obstacle, Shaft, Visibility, bodies};

use nearest::Facets;
pub use nearest::{Caster, PointCaster};
use stacks::Stacks;

/// Surfaces in a tree of boxes.
pub struct Bvh {
    tree: Bvh2,
    /// Outlines in the order of the tree's leaves.
    polygons: Vec<Polygon>,
    /// Number of the surface of each outline.
    surfaces: Vec<u32>,
    bodies: Vec<Body>,
    /// Number of the body of each outline.
    body_of: Vec<Option<usize>>,
    /// The same surfaces as rays meet them that look for the nearest.
    facets: Facets,
    /// Surfaces on top of others.
    stacks: Stacks,
    margin: f32,
}

impl std::fmt::Debug for Bvh {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Bvh")
            .field("surfaces", &self.surfaces.len())
            .finish_non_exhaustive()
    }
}

/// The nearest surface along a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Number of the surface.
    pub surface: u32,
    /// Where, in lengths of the ray's direction.
    pub distance: f32,
    /// True when the front of the surface was met.
    pub front: bool,
}

impl Hit {
    /// The side of the surface that was met.
    #[must_use]
    pub const fn side(&self) -> Side {
        if self.front { Side::Front } else { Side::Back }
    }
}

/// A polygon's box, widened by the rounding that [`Polygon::crossing`] allows.
struct Bounded(Aabb);

impl Boundable for Bounded {
    fn aabb(&self) -> Aabb {
        self.0
    }
}

impl Bounded {
    /// `farthest` is the largest coordinate of any segment's end.
    fn new(polygon: &Polygon, farthest: f32) -> Self {
        let (_, tolerance) = polygon.height(Vec3::splat(farthest));
        Self::widened(polygon, 2.0 * tolerance)
    }

    fn widened(polygon: &Polygon, margin: f32) -> Self {
        let mut bounds = Aabb::empty();
        for vertex in polygon.vertices() {
            bounds.extend(Vec3A::from(*vertex));
        }
        let margin = Vec3A::splat(margin);
        Self(Aabb::new(bounds.min - margin, bounds.max + margin))
    }
}

/// Largest coordinate of some points.
fn magnitude(points: impl Iterator<Item = Vec3>) -> f32 {
    points.map(|p| p.abs().max_element()).fold(0.0, f32::max)
}

impl Bvh {
    /// Builds the tree for a scene: segments between its surfaces, its luminaires and the sky.
    #[must_use]
    pub fn for_scene(scene: &Scene) -> Self {
        let positions = scene.luminaires().iter().map(|l| match *l.source() {
            Source::Point { position } | Source::Spot { position, .. } => position,
            Source::Sun { .. } | Source::Sky => Vec3::ZERO,
        });
        let surfaces = scene.surfaces();
        let vertices = surfaces.iter().flat_map(|s| s.polygon().vertices());
        let farthest = magnitude(vertices.copied().chain(positions)) + luminaire::far(scene);
        Self::new(surfaces, farthest)
    }

    /// Builds the tree; `farthest` is the largest coordinate of any segment that will be asked for.
    #[must_use]
    pub fn new(surfaces: &[Surface], farthest: f32) -> Self {
        let boxes: Vec<Bounded> = surfaces
            .iter()
            .map(|surface| Bounded::new(surface.polygon(), farthest))
            .collect();
        let mut build_time = Duration::ZERO;
        let tree = build_bvh2(&boxes, BvhBuildParams::very_slow_build(), &mut build_time);
        let order = tree.primitive_indices.clone();
        let bodies: Vec<Body> = bodies(surfaces).collect();
        let body_of = |surface: &u32| {
            let after = bodies.partition_point(|body| body.surfaces().end <= *surface);
            let body = bodies.get(after)?;
            body.surfaces().contains(surface).then_some(after)
        };
        Self {
            stacks: Stacks::new(surfaces, &tree),
            body_of: order.iter().map(body_of).collect(),
            polygons: order
                .iter()
                .filter_map(|index| surfaces.get(*index as usize))
                .map(|surface| *surface.polygon())
                .collect(),
            surfaces: order,
            bodies,
            tree,
            facets: Facets::new(surfaces, farthest),
            margin: surfaces
                .iter()
                .map(|surface| surface.polygon().plane().tolerance(farthest))
                .fold(0.0, f32::max),
        }
    }

    /// By how much surfaces have grown at most for [`Caster`]s, which closes cracks between them, in m.
    #[must_use]
    pub const fn margin(&self) -> f32 {
        self.margin
    }

    /// Casts rays for their nearest surfaces. A surface on which a ray starts is met or not as
    /// rounding has it, so rays should start at [`lifted`] points.
    #[must_use]
    pub const fn caster(&self) -> Caster<'_> {
        Caster::new(&self.facets, &self.stacks)
    }

    /// The same from one [`lifted`] point.
    #[must_use]
    pub fn caster_from(&self, point: Vec3) -> PointCaster<'_> {
        PointCaster::new(&self.facets, &self.stacks, point)
    }

    fn crossing(&self, index: usize, from: Vec3, to: Vec3) -> Option<f32> {
        self.polygons.get(index)?.crossing(from, to)
    }
}

/// A point of a polygon, above it by as much as counts as none: clear of the polygon itself and of
/// all in its plane, on the side of its front.
#[must_use]
pub fn lifted(polygon: &Polygon, point: Vec3) -> Vec3 {
    let (_, least) = polygon.height(point);
    point + polygon.normal() * least
}

impl Bvh {
    /// The closed convex bodies among the surfaces.
    #[must_use]
    pub fn bodies(&self) -> &[Body] {
        &self.bodies
    }

    /// The surfaces that a shaft admits, with their numbers and in the order of these.
    fn admitted(&self, shaft: &Shaft) -> Vec<(u32, Obstacle<'_>)> {
        let mut found = Vec::new();
        let misses = |bounds: &Aabb| {
            shaft.misses(Bounds {
                low: bounds.min.into(),
                high: bounds.max.into(),
            })
        };
        visit_leaves(&self.tree, misses, |leaf| {
            let admitted = leaf.filter(|index| shaft.admits(&self.polygons[*index]));
            found.extend(admitted.map(|index| {
                let body = self.body_of[index].map(|body| &self.bodies[body]);
                let polygon = &self.polygons[index];
                (self.surfaces[index], Obstacle { polygon, body })
            }));
        });
        found.sort_unstable_by_key(|(surface, _)| *surface);
        found
    }

    /// Numbers of the surfaces whose boxes come within a distance of a polygon's, in order.
    pub(crate) fn near(&self, polygon: &Polygon, distance: f32) -> Vec<u32> {
        met_by(&self.tree, &Bounded::widened(polygon, distance))
    }

    /// What stands between two regions, looked up once for many pairs of points in them.
    #[must_use]
    pub fn narrowed(&self, shaft: &Shaft) -> Narrowed<'_> {
        let found = self.admitted(shaft);
        Narrowed {
            bvh: self,
            blockers: found.into_iter().map(|(_, obstacle)| obstacle).collect(),
        }
    }
}

/// The few surfaces of a tree that can stand between two regions.
#[derive(Debug)]
pub struct Narrowed<'a> {
    bvh: &'a Bvh,
    blockers: Vec<Obstacle<'a>>,
}

impl<'a> Narrowed<'a> {
    /// How many there are.
    #[must_use]
    pub const fn blockers(&self) -> usize {
        self.blockers.len()
    }

    /// Those of them that can stand between parts of the two regions.
    #[must_use]
    pub fn narrowed(&self, shaft: &Shaft) -> Self {
        let blockers = self.blockers.iter().copied();
        Self {
            bvh: self.bvh,
            blockers: blockers
                .filter(|obstacle| shaft.admits(obstacle.polygon))
                .collect(),
        }
    }
}

/// Numbers of the surfaces whose leaves meet a box, in order.
fn met_by(tree: &Bvh2, bounds: &Bounded) -> Vec<u32> {
    let mut met = Vec::new();
    visit_leaves(
        tree,
        |node| !node.intersect_aabb(&bounds.0),
        |leaf| met.extend_from_slice(&tree.primitive_indices[leaf]),
    );
    met.sort_unstable();
    met
}

/// Visits what lies in the leaves that no box around them keeps off.
fn visit_leaves(
    tree: &Bvh2,
    misses: impl Fn(&Aabb) -> bool,
    mut visit: impl FnMut(std::ops::Range<usize>),
) {
    let mut waiting: Vec<usize> = Vec::with_capacity(64);
    waiting.extend((!tree.nodes.is_empty()).then_some(0));
    while let Some(node) = waiting.pop() {
        let node = &tree.nodes[node];
        if misses(&node.aabb) {
            continue;
        }
        let first = node.first_index as usize;
        if node.is_leaf() {
            visit(first..first + node.prim_count as usize);
        } else {
            waiting.extend([first, first + 1]);
        }
    }
}

impl Visibility for Narrowed<'_> {
    fn sees(&self, from: Vec3, to: Vec3) -> bool {
        self.bvh.sees(from, to)
    }

    fn may_block(&self) -> bool {
        !self.blockers.is_empty()
    }

    fn between<'v>(&'v self, shaft: &Shaft, visit: &mut impl FnMut(Obstacle<'v>)) {
        let blockers = self.blockers.iter().copied();
        blockers
            .filter(|obstacle| shaft.admits(obstacle.polygon))
            .for_each(visit);
    }
}

impl Visibility for Bvh {
    fn sees(&self, from: Vec3, to: Vec3) -> bool {
        self.tree.ray_traverse_miss(segment(from, to), |_, index| {
            match self.crossing(index, from, to) {
                Some(_) => 0.0,
                None => f32::INFINITY,
            }
        })
    }

    fn between<'v>(&'v self, shaft: &Shaft, visit: &mut impl FnMut(Obstacle<'v>)) {
        for (_, obstacle) in self.admitted(shaft) {
            visit(obstacle);
        }
    }

    fn above(&self, surface: u32, facing: Vec3, visit: &mut impl FnMut(&Polygon)) {
        self.stacks.above(surface, facing).for_each(visit);
    }
}

/// The segment as a ray of parameter range [0, 1]; its end is left a little room for rounding.
fn segment(from: Vec3, to: Vec3) -> Ray {
    let direction = Vec3A::from(to - from);
    let ray = Ray::new(Vec3A::from(from), direction, 0.0, 1.0 + 1e-4);
    Ray {
        // `Ray::new` takes steps below 1e-7 for none, and so misses boxes of that size.
        inv_direction: direction
            .recip()
            .clamp(Vec3A::splat(f32::MIN), Vec3A::splat(f32::MAX)),
        ..ray
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use relume::color::Rgb;
    use relume::visibility::Occluders;

    fn point() -> impl Strategy<Value = Vec3> {
        [-1.0_f32..1.0, -1.0_f32..1.0, -1.0_f32..1.0].prop_map(Vec3::from_array)
    }

    fn surfaces(triangles: &[[Vec3; 3]]) -> Vec<Surface> {
        triangles
            .iter()
            .filter_map(|vertices| Surface::new(0, vertices, Rgb::BLACK).ok())
            .collect()
    }

    proptest! {
        #[test]
        fn the_tree_sees_what_brute_force_sees(
            triangles in proptest::collection::vec([point(), point(), point()], 0..60),
            ends in proptest::collection::vec((point(), point()), 50),
            size in prop_oneof![Just(1.0_f32), Just(1e-9), Just(1e-5), Just(1e8)],
        ) {
            let triangles: Vec<_> = triangles.iter().map(|t| t.map(|v| v * size)).collect();
            let surfaces = surfaces(&triangles);
            let bvh = Bvh::new(&surfaces, 2.0 * size);
            let brute = Occluders(&surfaces);
            for (from, to) in ends {
                let (from, to) = (from * size, to * size);
                prop_assert_eq!(bvh.sees(from, to), brute.sees(from, to), "{} {}", from, to);
            }
        }

        #[test]
        fn axis_parallel_segments_and_walls_agree_as_well(
            steps in proptest::collection::vec((0_u8..4, 0_u8..4, 0_u8..4, 0_u8..4, 0_u8..3), 30),
        ) {
            let at = |i: u8| f32::from(i) - 1.5;
            let surfaces: Vec<Surface> = steps.iter().map(|&(x, y, z, _, axis)| {
                let (u, v) = [(Vec3::X, Vec3::Y), (Vec3::Y, Vec3::Z), (Vec3::Z, Vec3::X)][axis as usize];
                let o = Vec3::new(at(x), at(y), at(z));
                Surface::new(0, &[o, o + u, o + u + v, o + v], Rgb::BLACK).unwrap()
            }).collect();
            let bvh = Bvh::new(&surfaces, 2.0);
            let brute = Occluders(&surfaces);
            for &(x, y, z, w, axis) in &steps {
                let from = Vec3::new(at(x), at(y), at(z)) * 0.75;
                let mut to = from;
                to[axis as usize] += f32::from(w) - 1.7;
                prop_assert_eq!(bvh.sees(from, to), brute.sees(from, to), "{} {}", from, to);
            }
        }

        #[test]
        fn small_surfaces_and_far_ends_agree_as_well(
            triangles in proptest::collection::vec([point(), point(), point()], 1..20),
            ends in proptest::collection::vec((0_usize..60, point()), 50),
            far in prop_oneof![Just(30.0_f32), Just(1e3), Just(1e5)],
        ) {
            let surfaces = surfaces(&triangles);
            let bvh = Bvh::new(&surfaces, 2.0 * far);
            let brute = Occluders(&surfaces);
            for (corner, direction) in ends {
                // Just past an outline, where the tolerance of a far end decides.
                let corner = triangles[corner / 3 % triangles.len()][corner % 3];
                let from = corner + direction * 1e-5 - Vec3::Z;
                let to = from + (corner - from) * far;
                prop_assert_eq!(bvh.sees(from, to), brute.sees(from, to), "{} {}", from, to);
            }
        }
    }
}
