//! Light gathered by rays: what a receiver sees of the other elements, with receiver sums of one.
//!
//! A receiver casts `R` cosine-weighted rays; each ends in an element, in something that reflects
//! nothing, or escapes, and stands for a form factor of `1 / R` (Malley's method):
//!
//! `E_j = D_j + 1/R sum_r rho_h(r) E_h(r)`
//!
//! with `E` the irradiance, `D` its direct part, which lamps and luminaires give exactly, and `h(r)`
//! the element in which ray `r` ends. Every element shoots, so there is no substructuring error, and
//! work grows with the elements alone. The places on the receiver and the directions are a rank-one
//! sequence in four dimensions ([`noise::STEPS`]), shifted for every receiver by its number.

mod file;

use std::f32::consts::TAU;

use glam::{Vec2, Vec3};
use rayon::prelude::*;
use relume::geometry::{Polygon, from_unit_square};
use relume::mesh::{Mesh, Side};
use relume::refine::Lanes;
use relume::refine::krylov::{self, Work};

use crate::bvh::{Bvh, Caster, lifted};
use crate::mesh::Locator;
use crate::noise;

pub use file::{MAGIC, RowsError, read, write};

/// A ray that ends in no element.
const NOTHING: u32 = u32::MAX;

/// Rays of every element that are cast together.
pub const RAYS_PER_PASS: u32 = 16;

/// Where a ray ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct End {
    /// Number of the element.
    pub element: u32,
    /// The place, in m.
    pub position: Vec3,
    /// How far it is, in m.
    pub distance: f32,
}

/// Rays through a scene that end in elements of its mesh.
#[derive(Debug)]
pub struct Rays<'a> {
    mesh: Mesh<'a>,
    bvh: &'a Bvh,
    locator: &'a Locator<'a>,
}

/// A point of the sequence without its shift: the same for every element.
#[derive(Clone, Copy, Default)]
struct Step {
    place: [u32; 2],
    share: u32,
    /// Cosine and sine of the angle about the normal.
    turn: Vec2,
}

impl Step {
    fn new(index: u32) -> Self {
        let [s, t, share, turn] = noise::STEPS.map(|step| index.wrapping_mul(step));
        Self {
            place: [s, t],
            share,
            turn: Vec2::from_angle(TAU * noise::fraction(turn)),
        }
    }

    /// The part of a direction that is across the normal, with a density of the cosine over pi, for
    /// a receiver whose sequence is shifted by `share` and turned by `first`.
    fn across(&self, share: u32, first: Vec2) -> Vec2 {
        let share = noise::fraction(share.wrapping_add(self.share));
        first.rotate(self.turn) * share.sqrt()
    }
}

impl<'a> Rays<'a> {
    /// Rays through a mesh, its elements by place, and the surfaces that it was made of.
    #[must_use]
    pub const fn new(mesh: Mesh<'a>, locator: &'a Locator<'a>, bvh: &'a Bvh) -> Self {
        Self { mesh, bvh, locator }
    }

    /// Where `count` cosine-weighted rays from a point of a polygon end, on the side of its front; the
    /// `seed` turns them. `None` for a ray that escapes or is absorbed.
    pub fn from_point(
        &self,
        polygon: &Polygon,
        point: Vec3,
        seed: u64,
        count: u32,
    ) -> impl Iterator<Item = Option<End>> + '_ {
        let [share, turn] = [0, 1].map(|axis| noise::bits(seed * 2 + axis));
        let first = Vec2::from_angle(TAU * noise::fraction(turn));
        let normal = polygon.normal();
        let (x, y) = normal.any_orthonormal_pair();
        let from = lifted(polygon, point);
        let mut caster = self.bvh.caster();
        (0..count).map(move |index| {
            let step = Step::new(index);
            let across = step.across(share, first);
            let up = (1.0 - across.length_squared()).max(0.0).sqrt();
            let direction = x * across.x + y * across.y + normal * up;
            self.end(&mut caster, from, direction)
        })
    }

    /// Casts a ray for every step from an element, and notes where each ends.
    fn cast(&self, polygon: &Polygon, id: u32, steps: &[Step], hits: &mut [u32]) {
        let [s, t, share, turn] = [0, 1, 2, 3].map(|axis| noise::bits(u64::from(id) * 4 + axis));
        let normal = polygon.normal();
        let (x, y) = normal.any_orthonormal_pair();
        let first = Vec2::from_angle(TAU * noise::fraction(turn));
        let mut caster = self.bvh.caster();
        for (hit, step) in hits.iter_mut().zip(steps) {
            let place = [s.wrapping_add(step.place[0]), t.wrapping_add(step.place[1])];
            let (point, _) = from_unit_square(polygon, Vec2::from(place.map(noise::fraction)));
            let from = lifted(polygon, point);
            let across = step.across(share, first);
            let up = (1.0 - across.length_squared()).max(0.0).sqrt();
            let direction = x * across.x + y * across.y + normal * up;
            let end = self.end(&mut caster, from, direction);
            *hit = end.map_or(NOTHING, |end| end.element);
        }
    }

    /// Where a ray meets an element; `None` when it escapes or is absorbed.
    fn end(&self, caster: &mut Caster, from: Vec3, direction: Vec3) -> Option<End> {
        let met = caster.nearest(from, direction)?;
        let side = if met.front { Side::Front } else { Side::Back };
        let position = from + direction * met.distance;
        let element = self.locator.element(met.surface, side, position)?;
        Some(End {
            element,
            position,
            distance: met.distance,
        })
    }
}

/// Where the rays of every element end.
#[derive(Clone, Debug, Default)]
pub struct Hits {
    /// One list for each pass, element by element.
    passes: Vec<Vec<u32>>,
}

/// What bounces add to direct light.
#[derive(Clone, Debug)]
pub struct Bounced<const K: usize> {
    /// Indirect irradiance of every element, W/m2.
    pub indirect: Vec<Lanes<K>>,
    /// Irradiance that the solution still lacks.
    pub left: Vec<Lanes<K>>,
}

impl Hits {
    /// Passes so far.
    #[must_use]
    pub const fn passes(&self) -> usize {
        self.passes.len()
    }

    /// Casts [`RAYS_PER_PASS`] more rays from every element.
    pub fn cast(&mut self, rays: &Rays) {
        let first = self.passes.len() as u32 * RAYS_PER_PASS;
        let steps: Vec<Step> = (first..)
            .take(RAYS_PER_PASS as usize)
            .map(Step::new)
            .collect();
        let mesh = rays.mesh;
        let mut hits = vec![NOTHING; mesh.elements.len() * RAYS_PER_PASS as usize];
        hits.par_chunks_mut(RAYS_PER_PASS as usize)
            .zip(mesh.elements)
            .enumerate()
            .for_each(|(id, (hits, element))| {
                if let Some(polygon) = mesh.element_polygon(element) {
                    rays.cast(&polygon, id as u32, &steps, hits);
                }
            });
        self.passes.push(hits);
    }

    /// All bounces of direct light, until the residual of every lane is `tolerance` of its first bounce.
    #[must_use]
    pub fn bounce<const K: usize>(
        &self,
        mesh: &Mesh,
        direct: &[Lanes<K>],
        tolerance: f32,
    ) -> Bounced<K> {
        let zero = vec![[[0.0; K]; 3]; direct.len()];
        let passes: Vec<&[u32]> = self.passes.iter().map(Vec::as_slice).collect();
        let mut reflected = zero.clone();
        let mut transport = |v: &[Lanes<K>], y: &mut [Lanes<K>]| {
            reflect(mesh, v, &mut reflected);
            average(&passes, &reflected, y);
        };
        // x = T (D + x), so x - T x = T D.
        let mut left = zero.clone();
        transport(direct, &mut left);
        let mut indirect = zero.clone();
        let mut work = [zero.clone(), zero.clone(), zero.clone(), zero];
        let [shadow, direction, along, across] = &mut work;
        let work = Work {
            shadow,
            direction,
            along,
            across,
        };
        let apply = |v: &[Lanes<K>], y: &mut [Lanes<K>]| {
            transport(v, y);
            y.par_iter_mut().zip(v).for_each(|(y, v)| {
                for (y, v) in y.as_flattened_mut().iter_mut().zip(v.as_flattened()) {
                    *y = v - *y;
                }
            });
        };
        krylov::solve(apply, &mut indirect, &mut left, work, tolerance);
        Bounced { indirect, left }
    }

    /// Relative L1 error of every lane that the scatter of the rays leaves in `irradiance`, estimated
    /// from the difference between even and odd passes: half of it is as large as the error of all.
    #[must_use]
    pub fn noise<const K: usize>(&self, mesh: &Mesh, irradiance: &[Lanes<K>]) -> [f32; K] {
        let zero = vec![[[0.0; K]; 3]; irradiance.len()];
        let mut reflected = zero.clone();
        reflect(mesh, irradiance, &mut reflected);
        let [even, odd] = [0, 1].map(|parity| {
            let passes = self.passes.iter().skip(parity).step_by(2);
            let passes: Vec<&[u32]> = passes.map(Vec::as_slice).collect();
            let mut mean = zero.clone();
            average(&passes, &reflected, &mut mean);
            mean
        });
        let (mut error, mut all) = ([0.0_f64; K], [0.0_f64; K]);
        let means = even.iter().zip(&odd).zip(irradiance).zip(mesh.elements);
        for (((even, odd), irradiance), element) in means {
            for ((even, odd), irradiance) in even.iter().zip(odd).zip(irradiance) {
                for lane in 0..K {
                    let area = f64::from(element.area);
                    error[lane] += area * f64::from((even[lane] - odd[lane]).abs()) / 2.0;
                    all[lane] += area * f64::from(irradiance[lane]);
                }
            }
        }
        let mut noise = [0.0; K];
        for ((noise, error), all) in noise.iter_mut().zip(error).zip(all) {
            *noise = if all > 0.0 { (error / all) as f32 } else { 0.0 };
        }
        noise
    }
}

/// `y_j = 1/R sum_r v_h(r)` for every element, over some passes.
fn average<const K: usize>(passes: &[&[u32]], v: &[Lanes<K>], y: &mut [Lanes<K>]) {
    let per_pass = RAYS_PER_PASS as usize;
    let share = 1.0 / (passes.len() * per_pass).max(1) as f32;
    y.par_iter_mut().enumerate().for_each(|(id, y)| {
        let mut sum = [[0.0; K]; 3];
        for pass in passes {
            for hit in &pass[id * per_pass..(id + 1) * per_pass] {
                if let Some(value) = v.get(*hit as usize) {
                    for (sum, value) in sum.iter_mut().zip(value) {
                        for (sum, value) in sum.iter_mut().zip(value) {
                            *sum += value;
                        }
                    }
                }
            }
        }
        *y = sum.map(|channel| channel.map(|value| value * share));
    });
}

/// `y_j = rho_j v_j`.
fn reflect<const K: usize>(mesh: &Mesh, v: &[Lanes<K>], y: &mut [Lanes<K>]) {
    let values = y.par_iter_mut().zip(v).zip(mesh.elements);
    values.for_each(|((y, v), element)| {
        let reflectance = element.reflectance.to_array();
        for ((y, v), rho) in y.iter_mut().zip(v).zip(reflectance) {
            for (y, v) in y.iter_mut().zip(v) {
                *y = rho * v;
            }
        }
    });
}
