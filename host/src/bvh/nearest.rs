//! The nearest surface along a ray, and whether there is one at all.
//!
//! [`Polygon::crossing`] weighs the roundings of both ends to answer as a device does; here a surface
//! costs a few products, and four are asked at once. Surfaces become *facets*, which have grown by
//! a tolerance, so that edge to edge there is no crack, and four facets make a *block*. A few blocks are all
//! asked; more of them are found through a tree of four children a node.
//!
//! [`Polygon::crossing`]: relume::geometry::Polygon::crossing

use std::time::Duration;

use glam::{Vec3, Vec4};
use obvhs::BvhBuildParams;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;
use relume::scene::Surface;

use super::facet::{Block, Facet, LANES, Met, Ray, Start};
use super::stacks::Stacks;
use super::{Bounded, Hit};

/// Most blocks that are asked one after the other: 32 facets.
const FEW_BLOCKS: usize = 8;

/// The surfaces of a scene as rays meet them.
#[derive(Default)]
pub(super) struct Facets {
    blocks: Vec<Block>,
    /// The root first; none where blocks are few.
    nodes: Vec<Node>,
}

/// Casts rays one after the other.
pub struct Caster<'a> {
    facets: &'a Facets,
    stacks: &'a Stacks,
    /// What is left to look at, and how far away it is.
    waiting: Vec<(f32, Child)>,
    /// The block that last stood between two points: it often stands between the next two as well.
    blocker: u32,
}

impl<'a> Caster<'a> {
    pub(super) const fn new(facets: &'a Facets, stacks: &'a Stacks) -> Self {
        Self {
            facets,
            stacks,
            waiting: Vec::new(),
            blocker: 0,
        }
    }

    /// The surface that a ray meets first; of several in one plane the one on top.
    #[must_use]
    pub fn nearest(&mut self, from: Vec3, direction: Vec3) -> Option<Hit> {
        let hit = self.facets.nearest(from, direction, &mut self.waiting)?;
        Some(self.stacks.top(hit, from, direction))
    }

    /// True when nothing lies between two points that are [`lifted`] off their surfaces. All others have
    /// grown here, so less is seen past an edge than [`Polygon::crossing`] lets through.
    ///
    /// [`lifted`]: super::lifted
    /// [`Polygon::crossing`]: relume::geometry::Polygon::crossing
    #[must_use]
    pub fn sees(&mut self, from: Vec3, to: Vec3) -> bool {
        let ray = Ray::new(from, to - from);
        if self.facets.is_blocked_by(self.blocker, &ray) {
            return false;
        }
        let blocker = self.facets.blocker(&ray, to - from, &mut self.waiting);
        self.blocker = blocker.unwrap_or(self.blocker);
        blocker.is_none()
    }
}

impl std::fmt::Debug for Caster<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Caster").finish_non_exhaustive()
    }
}

/// Casts rays from one point, one after the other: less work for each where surfaces are few.
pub struct PointCaster<'a> {
    caster: Caster<'a>,
    from: Vec3,
    /// One for each block, where all are asked.
    starts: Vec<Start>,
}

impl<'a> PointCaster<'a> {
    pub(super) fn new(facets: &'a Facets, stacks: &'a Stacks, from: Vec3) -> Self {
        let blocks = facets.blocks.iter();
        let starts = if facets.nodes.is_empty() {
            blocks.map(|block| block.start(from)).collect()
        } else {
            Vec::new()
        };
        Self {
            caster: Caster::new(facets, stacks),
            from,
            starts,
        }
    }

    /// Casts rays from elsewhere.
    pub const fn caster(&mut self) -> &mut Caster<'a> {
        &mut self.caster
    }

    /// The surface that a ray meets first; of several in one plane the one on top.
    #[must_use]
    pub fn nearest(&mut self, direction: Vec3) -> Option<Hit> {
        if self.starts.is_empty() {
            return self.caster.nearest(self.from, direction);
        }
        let mut met = Met::nothing(f32::INFINITY);
        let along = direction.to_array().map(Vec4::splat);
        for (block, start) in self.caster.facets.blocks.iter().zip(&self.starts) {
            block.meet_from(start, along, &mut met);
        }
        Some(self.caster.stacks.top(met.hit()?, self.from, direction))
    }
}

impl std::fmt::Debug for PointCaster<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("PointCaster").finish_non_exhaustive()
    }
}

/// Four boxes and what they hold.
struct Node {
    /// Smallest and largest coordinates along every axis.
    bounds: [[Vec4; 2]; 3],
    children: [Child; LANES],
}

#[derive(Clone, Copy)]
enum Child {
    Node(u32),
    Block(u32),
}

impl Facets {
    pub(super) fn new(surfaces: &[Surface], farthest: f32) -> Self {
        let (mut facets, mut boxes) = (Vec::new(), Vec::new());
        for (surface, number) in surfaces.iter().zip(0..) {
            let polygon = surface.polygon();
            let (_, tolerance) = polygon.height(Vec3::splat(farthest));
            facets.extend(Facet::of(polygon, tolerance, number));
            boxes.resize_with(facets.len(), || Bounded::new(polygon, farthest));
        }
        if facets.len() <= FEW_BLOCKS * LANES {
            return Self {
                blocks: facets.chunks(LANES).map(Block::new).collect(),
                nodes: Vec::new(),
            };
        }
        let params = BvhBuildParams {
            max_prims_per_leaf: LANES as u32,
            ..BvhBuildParams::very_slow_build()
        };
        let tree = build_bvh2(&boxes, params, &mut Duration::default());
        let order = tree.primitive_indices.iter();
        let facets: Vec<Facet> = order.map(|index| facets[*index as usize]).collect();
        let mut built = Self::default();
        built.add(&tree, &facets, 0);
        built
    }

    /// Adds a node of the binary tree, with those below it.
    fn add(&mut self, tree: &Bvh2, facets: &[Facet], index: usize) -> Child {
        let node = &tree.nodes[index];
        let first = node.first_index as usize;
        if node.is_leaf() {
            let leaf = &facets[first..first + node.prim_count as usize];
            self.blocks.push(Block::new(leaf));
            return Child::Block(self.blocks.len() as u32 - 1);
        }
        let number = self.nodes.len();
        let below = grandchildren(tree, first);
        self.nodes.push(Node::new(tree, &below));
        for (lane, index) in below.into_iter().enumerate() {
            self.nodes[number].children[lane] = self.add(tree, facets, index);
        }
        Child::Node(number as u32)
    }

    /// What a ray meets first.
    fn nearest(&self, from: Vec3, direction: Vec3, waiting: &mut Vec<(f32, Child)>) -> Option<Hit> {
        let ray = Ray::new(from, direction);
        let mut met = Met::nothing(f32::INFINITY);
        if self.nodes.is_empty() {
            for block in &self.blocks {
                block.meet(&ray, &mut met);
            }
        } else {
            self.descend(&ray, direction, &mut met, waiting);
        }
        met.hit()
    }

    fn descend(&self, ray: &Ray, direction: Vec3, met: &mut Met, waiting: &mut Vec<(f32, Child)>) {
        let slabs = Slabs::new(ray, direction);
        waiting.clear();
        waiting.push((0.0, Child::Node(0)));
        while let Some((distance, child)) = waiting.pop() {
            if distance >= met.distance {
                continue;
            }
            match child {
                Child::Block(block) => self.blocks[block as usize].meet(ray, met),
                Child::Node(node) => {
                    self.nodes[node as usize].open(&slabs, met.distance, waiting);
                }
            }
        }
    }

    /// A block that a ray meets within its length.
    fn blocker(&self, ray: &Ray, direction: Vec3, waiting: &mut Vec<(f32, Child)>) -> Option<u32> {
        if self.nodes.is_empty() {
            return (0..self.blocks.len() as u32).find(|block| self.is_blocked_by(*block, ray));
        }
        let slabs = Slabs::new(ray, direction);
        waiting.clear();
        waiting.push((0.0, Child::Node(0)));
        while let Some((_, child)) = waiting.pop() {
            match child {
                Child::Block(block) if self.is_blocked_by(block, ray) => return Some(block),
                Child::Block(_) => {}
                Child::Node(node) => self.nodes[node as usize].open(&slabs, 1.0, waiting),
            }
        }
        None
    }

    fn is_blocked_by(&self, block: u32, ray: &Ray) -> bool {
        let mut met = Met::nothing(1.0);
        if let Some(block) = self.blocks.get(block as usize) {
            block.meet(ray, &mut met);
        }
        met.is_surface()
    }
}

/// Moves the last one to its place among the others, which are sorted with the nearest at the end.
fn sort_last(waiting: &mut [(f32, Child)]) {
    let mut place = waiting.len() - 1;
    while place > 0 && waiting[place - 1].0 < waiting[place].0 {
        waiting.swap(place - 1, place);
        place -= 1;
    }
}

/// Up to four nodes below one whose first child is `first`: the largest of them are opened.
fn grandchildren(tree: &Bvh2, first: usize) -> Vec<usize> {
    let mut below = vec![first, first + 1];
    while below.len() < LANES {
        let inner = (0..below.len()).filter(|place| !tree.nodes[below[*place]].is_leaf());
        let area = |place: &usize| tree.nodes[below[*place]].aabb.half_area();
        let Some(largest) = inner.max_by(|a, b| area(a).total_cmp(&area(b))) else {
            break;
        };
        let first = tree.nodes[below[largest]].first_index as usize;
        below[largest] = first;
        below.push(first + 1);
    }
    below
}

/// What boxes need to know of a ray.
struct Slabs {
    origin: [Vec4; 3],
    inverse: [Vec4; 3],
    /// Which of the bounds is met first.
    near: [usize; 3],
}

impl Slabs {
    fn new(ray: &Ray, direction: Vec3) -> Self {
        // Finite, so that no bound is infinitely far times zero.
        let inverse = direction
            .recip()
            .clamp(Vec3::splat(f32::MIN), Vec3::splat(f32::MAX));
        Self {
            origin: ray.origin,
            inverse: inverse.to_array().map(Vec4::splat),
            near: inverse.to_array().map(|along| usize::from(along < 0.0)),
        }
    }
}

impl Node {
    fn new(tree: &Bvh2, below: &[usize]) -> Self {
        // What lacks is inside out: its near bounds are infinitely far.
        let mut bounds = [[Vec4::INFINITY, Vec4::NEG_INFINITY]; 3];
        for (lane, index) in below.iter().enumerate() {
            let aabb = tree.nodes[*index].aabb;
            for (axis, [low, high]) in bounds.iter_mut().enumerate() {
                low[lane] = aabb.min[axis];
                high[lane] = aabb.max[axis];
            }
        }
        Self {
            bounds,
            children: [Child::Node(0); LANES],
        }
    }

    /// Adds what is met before `farthest` to what waits, the nearest last.
    #[inline]
    fn open(&self, slabs: &Slabs, farthest: f32, waiting: &mut Vec<(f32, Child)>) {
        let (near, mut hits) = self.meet(slabs, farthest);
        let first = waiting.len();
        while hits != 0 {
            let lane = hits.trailing_zeros() as usize;
            hits &= hits - 1;
            waiting.push((near[lane], self.children[lane]));
            sort_last(&mut waiting[first..]);
        }
    }

    /// Distances of the boxes, and a bit for each that is met before `farthest`.
    fn meet(&self, slabs: &Slabs, farthest: f32) -> (Vec4, u32) {
        let (mut near, mut far) = (Vec4::ZERO, Vec4::splat(farthest));
        for axis in 0..3 {
            let first = slabs.near[axis];
            let distance = |bound: usize| {
                (self.bounds[axis][bound] - slabs.origin[axis]) * slabs.inverse[axis]
            };
            near = near.max(distance(first));
            far = far.min(distance(1 - first));
        }
        (near, near.cmple(far).bitmask())
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Bvh, lifted};
    use super::*;
    use crate::builtin::{PaperLamps, paper_room};
    use crate::noise;
    use glam::{DVec3, Mat3, Vec2};
    use proptest::prelude::*;
    use relume::color::Rgb;
    use relume::geometry::Polygon;
    use std::f32::consts::TAU;

    /// Where a ray crosses the plane of a polygon, the cosine there, and by how much inside the outline;
    /// in f64, edge by edge.
    fn crossing(polygon: &Polygon, from: Vec3, direction: Vec3) -> (f64, f64, f64) {
        let [from, direction] = [from, direction].map(Vec3::as_dvec3);
        let vertices: Vec<DVec3> = polygon.vertices().iter().map(|v| v.as_dvec3()).collect();
        let last = vertices[vertices.len() - 1];
        let normal = (vertices[1] - vertices[0])
            .cross(last - vertices[0])
            .normalize();
        let cosine = direction.dot(normal);
        let distance = (vertices[0] - from).dot(normal) / cosine;
        let place = from + direction * distance;
        let next = vertices.iter().cycle().skip(1);
        let inside = vertices.iter().zip(next).map(|(a, b)| {
            let inwards = normal.cross(*b - *a).normalize();
            inwards.dot(place - *a)
        });
        (distance, cosine.abs(), inside.fold(f64::INFINITY, f64::min))
    }

    fn point() -> impl Strategy<Value = Vec3> {
        [-1.0_f32..1.0, -1.0_f32..1.0, -1.0_f32..1.0].prop_map(Vec3::from_array)
    }

    /// A triangle, a parallelogram, and a quad that is none.
    fn outline() -> impl Strategy<Value = Vec<Vec3>> {
        let corners = (point(), point(), point(), 0.6_f32..2.0, 0.6_f32..2.0);
        (corners, 0..3).prop_map(|((a, b, d, s, t), kind)| match kind {
            0 => vec![a, b, d],
            1 => vec![a, b, b + d - a, d],
            _ => vec![a, b, a + (b - a) * s + (d - a) * t, d],
        })
    }

    proptest! {
        #[test]
        fn nothing_is_nearer_than_the_nearest(
            outlines in proptest::collection::vec(outline(), 1..60),
            rays in proptest::collection::vec((point(), point()), 50),
            size in prop_oneof![Just(1.0_f32), Just(1e-9), Just(1e-3), Just(1e3), Just(1e8)],
            away in prop_oneof![Just(0.0_f32), Just(100.0)],
        ) {
            let place = |point: Vec3| (point + away) * size;
            let surface = |outline: &Vec<Vec3>| {
                let outline: Vec<Vec3> = outline.iter().map(|v| place(*v)).collect();
                Surface::new(0, &outline, Rgb::BLACK).ok()
            };
            let surfaces: Vec<Surface> = outlines.iter().filter_map(surface).collect();
            let farthest = (1.0 + away) * size;
            let bvh = Bvh::new(&surfaces, farthest);
            let mut caster = bvh.caster();
            for (from, direction) in rays {
                let (from, direction) = (place(from), direction.normalize());
                let hit = caster.nearest(from, direction);
                // To as far as the scene is wide: what is nearest stands between, or nothing does.
                let is_free = hit.is_none_or(|hit| hit.distance >= size);
                prop_assert_eq!(caster.sees(from, from + direction * size), is_free, "{:?}", hit);
                for hit in [hit, bvh.caster_from(from).nearest(direction)] {
                    for (surface, number) in surfaces.iter().zip(0..) {
                        let polygon = surface.polygon();
                        let tolerance = 4.0 * f64::from(polygon.height(Vec3::splat(farthest)).1);
                        let (distance, cosine, inside) = crossing(polygon, from, direction);
                        if cosine < 1e-3 {
                            continue;
                        }
                        let slack = tolerance / cosine;
                        let found = hit.filter(|hit| hit.surface == number);
                        if let Some(found) = found {
                            prop_assert!((f64::from(found.distance) - distance).abs() <= slack);
                            prop_assert!(inside >= -slack, "{inside} {slack}");
                            prop_assert_eq!(found.front, direction.dot(polygon.normal()) < 0.0);
                        } else if distance > slack && inside > slack {
                            let nearer = hit.is_some_and(|hit| f64::from(hit.distance) <= distance + slack);
                            prop_assert!(nearer, "{number} at {distance}: {hit:?}");
                        }
                    }
                }
            }
        }
    }

    /// The paper's closed room, turned so that nothing is parallel to an axis, every wall in `parts`
    /// times `parts` pieces.
    fn turned_room(size: f32, parts: u16) -> Vec<Surface> {
        let turn = Mat3::from_rotation_x(0.3) * Mat3::from_rotation_y(0.7) * size;
        let walls = paper_room(PaperLamps::One).unwrap().scene.surfaces;
        let step = f32::from(parts).recip();
        let corner = |x: u16, y: u16| Vec2::new(f32::from(x), f32::from(y)) * step;
        let pieces = walls[..12].iter().flat_map(|wall| {
            (0..parts * parts).map(move |piece| {
                let (x, y) = (piece % parts, piece / parts);
                wall.polygon().part(corner(x, y), corner(x + 1, y + 1))
            })
        });
        let surface = |piece: Polygon| {
            let outline: Vec<Vec3> = piece.vertices().iter().map(|v| turn * *v).collect();
            Surface::new(0, &outline, Rgb::BLACK).unwrap()
        };
        pieces.map(surface).collect()
    }

    #[test]
    fn no_ray_leaves_a_closed_room() {
        const RAYS: u64 = 1_000_000;
        for (size, parts) in [(1.0, 1), (1e-3, 1), (1e3, 1), (1.0, 8), (1e-3, 8), (1e3, 8)] {
            let surfaces = turned_room(size, parts);
            let bvh = Bvh::new(&surfaces, 5.0 * size);
            let mut caster = bvh.caster();
            let escapes = |ray: &u64| {
                let [s, t, u, v] = [0, 1, 2, 3].map(|axis| noise::unit(ray * 4 + axis));
                let polygon = surfaces[*ray as usize % surfaces.len()].polygon();
                let from = lifted(polygon, polygon.point(Vec2::new(s, t)));
                let (x, y) = polygon.normal().any_orthonormal_pair();
                let (sine, cosine) = (TAU * v).sin_cos();
                let across = (x * cosine + y * sine) * u.sqrt();
                let direction = across + polygon.normal() * (1.0 - u).sqrt();
                caster.nearest(from, direction).is_none()
                    || bvh.caster_from(from).nearest(direction).is_none()
            };
            let escaped = (0..RAYS).filter(escapes).count();
            assert_eq!(escaped, 0, "of {RAYS}, {size} {parts}");
        }
    }
}
