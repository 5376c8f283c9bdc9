//! Surfaces that lie on top of others, in their planes ([`covers`]): few, and found once.

use glam::Vec3;
use obvhs::bvh2::Bvh2;
use relume::geometry::Polygon;
use relume::scene::Surface;
use relume::visibility::covers;

use super::{Bounded, Hit, met_by};

/// One surface on top of another one.
struct Stack {
    bottom: u32,
    /// The side from which it is.
    facing: Vec3,
    top: u32,
    outline: Polygon,
}

/// All of them, by the number of the one below.
pub(super) struct Stacks(Vec<Stack>);

impl Stacks {
    /// Finds them, in the order of the surfaces; `tree` holds these.
    pub(super) fn new(surfaces: &[Surface], tree: &Bvh2) -> Self {
        let mut stacks = Vec::new();
        for (bottom, number) in surfaces.iter().zip(0..) {
            let near = met_by(tree, &Bounded::new(bottom.polygon(), 0.0));
            let normal = bottom.polygon().normal();
            for facing in [normal, -normal] {
                let tops = near.iter().map(|top| (*top, &surfaces[*top as usize]));
                let tops = tops.filter(|top| covers(*top, (number, bottom), facing));
                stacks.extend(tops.map(|(top, surface)| Stack {
                    bottom: number,
                    facing,
                    top,
                    outline: *surface.polygon(),
                }));
            }
        }
        Self(stacks)
    }

    /// What lies on a surface, seen from a side.
    pub(super) fn above(&self, surface: u32, facing: Vec3) -> impl Iterator<Item = &Polygon> {
        self.on(surface, facing).map(|stack| &stack.outline)
    }

    /// What a ray sees where it met a surface: the one on top there.
    pub(super) fn top(&self, mut hit: Hit, from: Vec3, direction: Vec3) -> Hit {
        if self.0.is_empty() {
            return hit;
        }
        let place = from + direction * hit.distance;
        while let Some(stack) = self
            .on(hit.surface, -direction)
            .find(|stack| stack.outline.holds(place))
        {
            hit.surface = stack.top;
            hit.front = stack.outline.normal().dot(direction) < 0.0;
        }
        hit
    }

    fn on(&self, surface: u32, facing: Vec3) -> impl Iterator<Item = &Stack> {
        let first = self.0.partition_point(|stack| stack.bottom < surface);
        let own = self.0[first..].iter();
        own.take_while(move |stack| stack.bottom == surface)
            .filter(move |stack| stack.facing.dot(facing) > 0.0)
    }
}
