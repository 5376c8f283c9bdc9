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
//! sequence in four dimensions (Roberts 2018, R4), shifted for every receiver by its number.

use std::f32::consts::TAU;

use glam::{Vec2, Vec3};
use rayon::prelude::*;
use relume::geometry::{Polygon, from_unit_square};
use relume::mesh::{Mesh, Side};
use relume::refine::Lanes;
use relume::refine::krylov::{self, Work};

use crate::bvh::Bvh;
use crate::mesh::Locator;
use crate::noise;

/// A ray that ends in no element.
const NOTHING: u32 = u32::MAX;

/// `1/g, 1/g^2, 1/g^3, 1/g^4` with `g^5 = g + 1`.
const STEPS: [f64; 4] = [
    0.856_674_883_854_502_9,
    0.733_891_856_627_126,
    0.628_706_721_037_808_6,
    0.538_597_257_223_61,
];

/// By how much the light between elements has to be settled, relative.
const TOLERANCE: f32 = 1e-5;

/// Rays through a scene that end in elements of its mesh.
#[derive(Debug)]
pub struct Rays<'a> {
    bvh: &'a Bvh,
    locator: Locator<'a>,
    /// A length that passes everything.
    far: f32,
}

impl<'a> Rays<'a> {
    /// Rays through a mesh; `far` is a distance at which every surface has been passed, in m.
    #[must_use]
    pub fn new(mesh: Mesh<'a>, bvh: &'a Bvh, far: f32) -> Self {
        Self {
            bvh,
            locator: Locator::new(mesh),
            far,
        }
    }

    /// The element in which a ray ends; `None` when it escapes or is absorbed.
    fn element(&self, from: Vec3, direction: Vec3) -> Option<u32> {
        let hit = self.bvh.nearest(from, from + direction * self.far)?;
        let side = if hit.front { Side::Front } else { Side::Back };
        let position = from + direction * (self.far * hit.fraction);
        self.locator.element(hit.surface, side, position)
    }

    /// The elements that `count` rays from a point see, the `first` of a sequence left out.
    pub fn from_point(
        &self,
        point: Vec3,
        normal: Vec3,
        seed: u64,
        count: u32,
    ) -> impl Iterator<Item = Option<u32>> + '_ {
        let shift = shift(seed);
        (0..count).map(move |index| {
            let [_, _, u, v] = sequence(index, shift);
            self.element(point, cosine_direction(normal, u, v))
        })
    }

    fn from_polygon(&self, polygon: &Polygon, seed: u64, index: u32) -> u32 {
        let [s, t, u, v] = sequence(index, shift(seed));
        let (point, _) = from_unit_square(polygon, Vec2::new(s, t));
        let element = self.element(point, cosine_direction(polygon.normal(), u, v));
        element.unwrap_or(NOTHING)
    }
}

/// Point `index` of the sequence.
fn sequence(index: u32, shift: [f32; 4]) -> [f32; 4] {
    let mut point = shift;
    for (value, step) in point.iter_mut().zip(STEPS) {
        *value = (f64::from(*value) + f64::from(index) * step).fract() as f32;
    }
    point
}

fn shift(seed: u64) -> [f32; 4] {
    [0, 1, 2, 3].map(|axis| noise::unit(seed.wrapping_mul(4).wrapping_add(axis)))
}

/// A direction about a unit normal whose density is the cosine over pi.
fn cosine_direction(normal: Vec3, u: f32, v: f32) -> Vec3 {
    let (x, y) = normal.any_orthonormal_pair();
    let (sine, cosine) = (TAU * v).sin_cos();
    (x * cosine + y * sine) * u.sqrt() + normal * (1.0 - u).sqrt()
}

/// Where the rays of every element end.
#[derive(Debug, Default)]
pub struct Hits {
    /// One list for each pass: element by element, `per_pass` rays each.
    passes: Vec<Vec<u32>>,
    per_pass: u32,
}

impl Hits {
    /// No rays yet; every pass adds `per_pass` to each element.
    #[must_use]
    pub const fn new(per_pass: u32) -> Self {
        Self {
            passes: Vec::new(),
            per_pass,
        }
    }

    /// Passes so far.
    #[must_use]
    pub const fn passes(&self) -> usize {
        self.passes.len()
    }

    /// Casts one more pass.
    pub fn cast(&mut self, mesh: &Mesh, rays: &Rays) {
        let first = self.passes.len() as u32 * self.per_pass;
        let mut hits = vec![NOTHING; mesh.elements.len() * self.per_pass as usize];
        hits.par_chunks_mut(self.per_pass as usize)
            .zip(mesh.elements)
            .enumerate()
            .for_each(|(id, (hits, element))| {
                let Some(polygon) = mesh.element_polygon(element) else {
                    return;
                };
                for (hit, index) in hits.iter_mut().zip(first..) {
                    *hit = rays.from_polygon(&polygon, id as u64, index);
                }
            });
        self.passes.push(hits);
    }

    /// `y_j = 1/R sum_r v_h(r)` for every element.
    fn average<const K: usize>(&self, v: &[Lanes<K>], y: &mut [Lanes<K>]) {
        let per_pass = self.per_pass as usize;
        let share = 1.0 / (self.passes.len() * per_pass).max(1) as f32;
        y.par_iter_mut().enumerate().for_each(|(id, y)| {
            let mut sum = [[0.0; K]; 3];
            for pass in &self.passes {
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

    /// Indirect irradiance of every element: all bounces of the direct one, lane by lane.
    #[must_use]
    pub fn indirect<const K: usize>(&self, mesh: &Mesh, direct: &[Lanes<K>]) -> Vec<Lanes<K>> {
        let n = direct.len();
        let zero = vec![[[0.0; K]; 3]; n];
        let mut reflected = zero.clone();
        let mut transport = |v: &[Lanes<K>], y: &mut [Lanes<K>]| {
            reflect(mesh, v, &mut reflected);
            self.average(&reflected, y);
        };
        // x = T (D + x), so x - T x = T D.
        let mut residual = zero.clone();
        transport(direct, &mut residual);
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
                for (y, v) in y.iter_mut().zip(v) {
                    for (y, v) in y.iter_mut().zip(v) {
                        *y = v - *y;
                    }
                }
            });
        };
        krylov::solve(apply, &mut indirect, &mut residual, work, TOLERANCE);
        indirect
    }
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
