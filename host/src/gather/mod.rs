//! Light gathered by rays: what a receiver sees of the other elements, with receiver sums of one.
//!
//! A receiver casts `R` cosine-weighted rays; each ends in an element, in something that reflects
//! nothing, or escapes, and stands for a form factor of `1 / R` (Malley's method):
//!
//! `E_j = D_j + 1/R sum_r rho_h(r) E_h(r) / s_h(r)`
//!
//! with `E` the irradiance, `D` its direct part, which lamps and luminaires give exactly, `h(r)`
//! the element in which ray `r` ends, and `s` the share of an element that light can reach: where a box
//! stands on a floor, the elements under its edges are partly dark, and rays only meet the other
//! part. Every element shoots, so there is no substructuring error, and
//! work grows with the elements alone. The places on the receiver and the directions are a rank-one
//! sequence in four dimensions ([`noise::STEPS`]), shifted for every receiver by its number. From a point
//! a known number of rays leaves along a Fibonacci lattice, which is more even.

mod file;

use std::f32::consts::TAU;

use glam::{Vec2, Vec3};
use rayon::prelude::*;
use relume::color::Rgb;
use relume::geometry::{Polygon, from_unit_square};
use relume::mesh::{Mesh, Side, is_face};
use relume::refine::Lanes;
use relume::refine::krylov::{self, Work};
use relume::scene::{Scene, Surface};

use crate::bvh::{Bvh, Caster, Hit, lifted};
use crate::mesh::Locator;
use crate::noise;

pub use file::{MAGIC, RowsError, read, write};

/// A ray that ends in no element.
const NOTHING: u32 = u32::MAX;

/// A ray that ends on a side that no light reaches, so that it started in the dark itself.
const DARK: u32 = u32::MAX - 1;

/// Least share of an element that counts as reached by light: direct light is sampled at four points.
const LEAST_EXPOSED: f32 = 0.25;

/// How far before its end a ray is asked whether it can have come there, in widths of the margin
/// that closes cracks between facets.
const BEFORE: f32 = 4.0;

/// By how much what a ray met is drawn towards its middle then.
const INWARDS: f32 = 1e-3;

/// `1/g` with `g^2 = g + 1`, in parts of 2^32.
const GOLDEN_STEP: u32 = 2_654_435_769;

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
#[derive(Clone, Copy, Debug, Default)]
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

/// Directions of rays from one point, to be shifted and turned for each: a Fibonacci lattice.
#[derive(Debug)]
pub struct Fan(Vec<Step>);

impl Fan {
    /// Directions of `count` rays.
    #[must_use]
    pub fn new(count: u32) -> Self {
        let step = |index: u32| Step {
            share: ((u64::from(2 * index + 1) << 31) / u64::from(count)) as u32,
            turn: Vec2::from_angle(TAU * noise::fraction(index.wrapping_mul(GOLDEN_STEP))),
            ..Step::new(index)
        };
        Self((0..count).map(step).collect())
    }

    /// How many there are.
    #[must_use]
    pub const fn count(&self) -> u32 {
        self.0.len() as u32
    }

    /// A place in the unit square for each ray, in parts of 2^32, to be shifted for each point.
    pub fn places(&self) -> impl Iterator<Item = [u32; 2]> + '_ {
        self.0.iter().map(|step| step.place)
    }
}

/// Sides of surfaces that reflect, but that no light reaches: what sees one of them is dark, too.
#[derive(Debug)]
pub struct DarkSides(Vec<[bool; 2]>);

impl DarkSides {
    /// The sides that a mesh of the scene has left out.
    #[must_use]
    pub fn new(scene: &Scene, locator: &Locator) -> Self {
        let surfaces = scene.surfaces().iter().zip(0..);
        let is_dark = |surface: &Surface, number, side| {
            let reflects = is_face(surface, side) && !surface.reflectance().is_black();
            reflects && locator.face(number, side).is_none()
        };
        let sides = surfaces.map(|(surface, number)| {
            [Side::Front, Side::Back].map(|side| is_dark(surface, number, side))
        });
        Self(sides.collect())
    }

    fn contains(&self, surface: u32, side: Side) -> bool {
        let sides = self.0.get(surface as usize);
        sides.is_some_and(|[front, back]| match side {
            Side::Front => *front,
            Side::Back => *back,
        })
    }
}

impl<'a> Rays<'a> {
    /// Rays through a mesh, its elements by place, and the surfaces that it was made of.
    #[must_use]
    pub const fn new(mesh: Mesh<'a>, locator: &'a Locator<'a>, bvh: &'a Bvh) -> Self {
        Self { mesh, bvh, locator }
    }

    /// Where cosine-weighted rays from a point of a polygon end, on the side of its front; the
    /// `seed` shifts and turns them. `None` for a ray that escapes or is absorbed.
    pub fn from_point<'r>(
        &'r self,
        polygon: &Polygon,
        point: Vec3,
        seed: u64,
        fan: &'r Fan,
    ) -> impl Iterator<Item = Option<End>> + 'r {
        let first = Vec2::from_angle(TAU * noise::unit(seed));
        let frame = Frame::new(polygon);
        let from = lifted(polygon, point);
        let mut caster = self.bvh.caster_from(from);
        fan.0.iter().map(move |step| {
            let direction = frame.direction(step.across(0, first));
            let hit = caster.nearest(direction)?;
            self.end(caster.caster(), hit, from, direction)
        })
    }

    /// Where one such ray ends; `None` when it escapes or is absorbed.
    #[must_use]
    pub fn one(&self, polygon: &Polygon, point: Vec3, seed: u64) -> Option<End> {
        let [share, turn] = [0, 1].map(|axis| noise::unit(seed * 2 + axis));
        let across = Vec2::from_angle(TAU * turn) * share.sqrt();
        let direction = Frame::new(polygon).direction(across);
        let from = lifted(polygon, point);
        let mut caster = self.bvh.caster();
        let hit = caster.nearest(from, direction)?;
        self.end(&mut caster, hit, from, direction)
    }

    /// Casts a ray for every step from an element, and notes where each ends.
    fn cast(&self, polygon: &Polygon, id: u32, steps: &[Step], dark: &DarkSides, hits: &mut [u32]) {
        let [s, t, share, turn] = [0, 1, 2, 3].map(|axis| noise::bits(u64::from(id) * 4 + axis));
        let frame = Frame::new(polygon);
        let first = Vec2::from_angle(TAU * noise::fraction(turn));
        let mut caster = self.bvh.caster();
        for (hit, step) in hits.iter_mut().zip(steps) {
            let place = [s.wrapping_add(step.place[0]), t.wrapping_add(step.place[1])];
            let (point, _) = from_unit_square(polygon, Vec2::from(place.map(noise::fraction)));
            let from = lifted(polygon, point);
            let direction = frame.direction(step.across(share, first));
            *hit = match caster.nearest(from, direction) {
                None => NOTHING,
                Some(met) if dark.contains(met.surface, met.side()) => DARK,
                Some(met) => {
                    let end = self.end(&mut caster, met, from, direction);
                    end.map_or(NOTHING, |end| end.element)
                }
            };
        }
    }

    /// The element that a ray met; `None` where it is absorbed.
    fn end(&self, caster: &mut Caster, hit: Hit, from: Vec3, direction: Vec3) -> Option<End> {
        let position = from + direction * hit.distance;
        let outline = &self.locator.face(hit.surface, hit.side())?.polygon;
        if !outline.holds(position) {
            // Facets have grown, so over an edge one of them shows its other side to rays outside.
            let before = (hit.distance - BEFORE * self.bvh.margin()).max(0.0);
            let inside = position + (outline.center() - position) * INWARDS;
            if !caster.sees(from + direction * before, lifted(outline, inside)) {
                return None;
            }
        }
        let element = self.locator.element(hit.surface, hit.side(), position)?;
        Some(End {
            element,
            position,
            distance: hit.distance,
        })
    }
}

/// Directions about the normal of a polygon.
struct Frame {
    x: Vec3,
    y: Vec3,
    normal: Vec3,
}

impl Frame {
    fn new(polygon: &Polygon) -> Self {
        let normal = polygon.normal();
        let (x, y) = normal.any_orthonormal_pair();
        Self { x, y, normal }
    }

    /// The unit vector with these components across the normal, on its side.
    fn direction(&self, across: Vec2) -> Vec3 {
        let up = (1.0 - across.length_squared()).max(0.0).sqrt();
        self.x * across.x + self.y * across.y + self.normal * up
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
    pub fn cast(&mut self, rays: &Rays, dark: &DarkSides) {
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
                    rays.cast(&polygon, id as u32, &steps, dark, hits);
                }
            });
        self.passes.push(hits);
    }

    /// The share of every element that light can reach, from a quarter to 1.
    #[must_use]
    pub fn exposed(&self, elements: usize) -> Vec<f32> {
        let per_pass = RAYS_PER_PASS as usize;
        let share = 1.0 / (self.passes.len() * per_pass).max(1) as f32;
        let exposed = |id: usize| {
            let hits = self.passes.iter();
            let hits = hits.flat_map(|pass| &pass[id * per_pass..(id + 1) * per_pass]);
            let dark = hits.filter(|hit| **hit == DARK).count();
            (1.0 - dark as f32 * share).max(LEAST_EXPOSED)
        };
        (0..elements).map(exposed).collect()
    }

    /// `rho / s` of every element.
    fn reflected_shares(&self, mesh: &Mesh) -> Vec<Rgb> {
        let exposed = self.exposed(mesh.elements.len());
        let elements = mesh.elements.iter().zip(exposed);
        let shares = elements.map(|(element, exposed)| element.reflectance * exposed.recip());
        shares.collect()
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
        let shares = self.reflected_shares(mesh);
        let mut reflected = zero.clone();
        let mut transport = |v: &[Lanes<K>], y: &mut [Lanes<K>]| {
            reflect(&shares, v, &mut reflected);
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
        reflect(&self.reflected_shares(mesh), irradiance, &mut reflected);
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

/// `y_j = share_j v_j`.
fn reflect<const K: usize>(shares: &[Rgb], v: &[Lanes<K>], y: &mut [Lanes<K>]) {
    let values = y.par_iter_mut().zip(v).zip(shares);
    values.for_each(|((y, v), share)| {
        for ((y, v), share) in y.iter_mut().zip(v).zip(share.to_array()) {
            for (y, v) in y.iter_mut().zip(v) {
                *y = share * v;
            }
        }
    });
}
