//! Direct light of a lamp at a place: exactly, or by one shadow ray.
//!
//! The shadow ray ends at a point `y` of the lamp, evenly chosen; from afar the lamp counts as
//! `cos a cos b A / (pi r^2)` if it sees `y`, and from nearby, where that varies much with `y`, as the
//! form factor of the whole lamp if it sees `y`.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};
use relume::form_factor::Shooter;
use relume::geometry::{Polygon, from_unit_square};
use relume::scene::Emission;

use crate::bvh::{Bvh, lifted};
use crate::noise;
use crate::rows::quarters;

/// How often a lamp is quartered at most.
const MOST_QUARTERINGS: u32 = 5;

/// A lamp that is nearer than so many of its longest edges is close.
const CLOSE: f32 = 2.0;

/// How often a point of a close lamp is looked for above the horizon.
const TRIES: u32 = 8;

/// Steps from one point of a lamp to the next, along its sides, in parts of 2^32: `1/g` and `1/g^2`
/// with `g^3 = g + 1`.
pub(super) const STEPS: [u32; 2] = [3_242_174_889, 2_447_445_414];

/// A point on a side of a surface.
#[derive(Clone, Copy, Debug)]
pub struct Spot {
    pub(super) position: Vec3,
    pub(super) normal: Vec3,
    /// Its polygon, front towards the side.
    pub(super) outline: Polygon,
}

/// A face that emits.
pub(super) struct Lamp {
    shooter: Shooter,
    pub emission: Emission,
    /// What lifts its points off it.
    lift: Vec3,
    center: Vec3,
    /// Square of the distance from the middle within which it is close.
    close: f32,
}

impl Lamp {
    pub fn new(shooter: Shooter, emission: Emission) -> Self {
        let polygon = *shooter.polygon();
        Self {
            shooter,
            emission,
            lift: lift(&polygon),
            center: polygon.center(),
            close: (CLOSE * polygon.longest_edge()).powi(2),
        }
    }

    /// What a place sees of it, exactly; where much stands between, of its quarters.
    pub fn factor(&self, spot: Spot, bvh: &Bvh) -> f32 {
        visible_factor(&self.shooter, spot, bvh, 0)
    }

    /// The form factor of the lamp from a place, open, as it looks at one point of the lamp, and that
    /// point, lifted; `None` where nothing of it faces the place.
    pub fn at(&self, spot: Spot, at: [u32; 2]) -> Option<(f32, Vec3)> {
        let Spot {
            position, normal, ..
        } = spot;
        let polygon = self.shooter.polygon();
        let point = |at: [u32; 2]| from_unit_square(polygon, Vec2::from(at.map(noise::fraction)));
        if position.distance_squared(self.center) > self.close {
            // cos cos / (pi r^2) per area of the lamp.
            let (point, density) = point(at);
            let ray = point - position;
            let square = ray.length_squared();
            let (here, there) = (ray.dot(normal), -ray.dot(polygon.normal()));
            let factor = here * there * density / (PI * square * square);
            let is_seen = here > 0.0 && there > 0.0 && !self.shooter.is_covered(point);
            return is_seen.then_some((factor, point + self.lift));
        }
        let factor = self.shooter.open_at_point(position, normal);
        if factor <= 0.0 {
            return None;
        }
        let points = (0..TRIES).map(|try_| {
            let shift = STEPS.map(|step| step.wrapping_mul(try_));
            point([at[0].wrapping_add(shift[0]), at[1].wrapping_add(shift[1])]).0
        });
        let is_above = |point: &Vec3| (*point - position).dot(normal) > 0.0;
        let point = points.into_iter().find(is_above)?;
        (!self.shooter.is_covered(point)).then_some((factor, point + self.lift))
    }
}

/// What lifts any point of a polygon.
fn lift(polygon: &Polygon) -> Vec3 {
    let vertices = polygon.vertices().iter();
    let lifts = vertices.map(|vertex| lifted(polygon, *vertex) - *vertex);
    let longest = lifts.max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
    longest.unwrap_or_default()
}

fn visible_factor(lamp: &Shooter, spot: Spot, bvh: &Bvh, depth: u32) -> f32 {
    let Spot {
        position, normal, ..
    } = spot;
    match lamp.exact_at_point(position, normal, bvh) {
        Some(factor) => factor,
        None if depth == MOST_QUARTERINGS => lamp.at_point(position, normal, bvh),
        None => quarters(lamp.polygon())
            .into_iter()
            .map(|quarter| visible_factor(&lamp.part(quarter), spot, bvh, depth + 1))
            .sum(),
    }
}
