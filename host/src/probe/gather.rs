//! Light at a point, better than its element knows it: direct light exactly, indirect light gathered.
//!
//! `E(x) = sum over lamps F(x, l) + luminaires + sum over far patches F(x, p) B_p
//!        + 1/R sum over rays that end in near patches rho_h(r) E_h(r)`
//!
//! `F` is the form factor of what is visible, cut out exactly; `B_p` the radiosity that the solution
//! gives patch `p`, constant over it, which does no harm from afar. Rays `r` leave the point
//! cosine-weighted; where one ends in an element `h` of a near patch the variation inside it
//! matters (final gather; Reichert 1992). What counts of `h` is the light on the part of it that light
//! can reach. Where a ray ends within a few elements even the edge of a shadow matters: there the
//! direct part of `E_h` is that of the place itself, by one shadow ray to each lamp; and where it ends
//! nearer still, as in corners, the ray goes on for the indirect part, too (Christensen 1999, secondary
//! final gathering). Assumption: lamps radiate evenly from their front.

use std::borrow::Cow;
use std::fmt;

use glam::Vec3;
use relume::color::Rgb;
use relume::form_factor::Shooter;
use relume::luminaire;
use relume::mesh::{Element, Side};
use relume::scene::Surface;

use super::Part;
use super::lamp::{Lamp, STEPS, Spot};
use super::radiant::{RadiantPatch, radiant_patches};
use crate::bvh::{Bvh, Caster, lifted};
use crate::gather::{End, Fan, Rays};
use crate::mesh::Locator;
use crate::noise;
use crate::rows::{self, Parallel};
use crate::solution::Solution;

/// Where rays end that are shorter than so many edges of the element there, direct light is looked at.
const NEAR: f32 = 2.0;

/// Of so many rays those go on that are shorter than one edge; the length grows with the root of their
/// number, as their scatter falls with it.
const RAYS_PER_SQUARE_EDGE: f32 = 1024.0;

/// Parts of a ray at most: many in a narrow gap.
const MOST_STEPS: u64 = 16;

/// Seeds from here on are those of rays that go on, and of places on lamps: far above those of points.
const NEXT_SEEDS: u64 = 1 << 60;
const LAMP_SEEDS: u64 = 1 << 61;

/// Interleaved sets of directions towards sun and sky.
const SETS: u32 = 32;

/// By how much a point is drawn from its polygon's outline towards the middle, away from edges.
const INWARDS: f32 = 1e-5;

/// The same for the end of a ray, whose place matters less than that no light comes around an edge.
const END_INWARDS: f32 = 1e-3;

/// A solution, ready to be gathered from.
pub struct Gatherer<'a> {
    solution: &'a Solution,
    locator: Locator<'a>,
    bvh: Bvh,
    fan: Fan,
    lamps: Vec<Lamp>,
    /// Direct irradiance of the elements, light inside.
    direct: Cow<'a, [Rgb]>,
    grounds: Vec<Ground>,
    /// Rays that are shorter than so many edges go on.
    short: f32,
    /// By number, or none, if rays are to find them from afar, too.
    patches: Vec<RadiantPatch>,
    far: f32,
}

/// What a ray finds at its end: an element.
struct Ground {
    reflectance: Rgb,
    /// Reflectance over the share that light can reach.
    exposed: Rgb,
    /// Edge of a square as large, m.
    size: f32,
    patch: u32,
}

impl<'a> Gatherer<'a> {
    /// Builds the tree of all surfaces, and chooses the directions of so many rays from every point.
    #[must_use]
    pub fn new(solution: &'a Solution, rays: u32) -> Self {
        let outlines = solution.surfaces.iter().zip(0..);
        let surfaces: Vec<Surface> = outlines
            .filter_map(|(outline, index)| Surface::new(index, outline.vertices(), Rgb::BLACK).ok())
            .collect();
        let (low, high) = solution.bounds().unwrap_or_default();
        let far = 2.0 * (high - low).length();
        let farthest = low.abs().max(high.abs()).max_element() + far;
        let faces = solution.mesh.faces.iter();
        let bvh = Bvh::new(&surfaces, farthest);
        let direct = match &solution.direct {
            Some(direct) => Cow::Borrowed(direct.as_slice()),
            None => Cow::Owned(direct_of_elements(solution, &bvh, far)),
        };
        Self {
            solution,
            locator: Locator::new(solution.mesh.view()),
            fan: Fan::new(rays),
            direct,
            grounds: grounds(solution),
            short: (rays as f32 / RAYS_PER_SQUARE_EDGE).sqrt(),
            patches: Vec::new(),
            lamps: faces
                .filter_map(|face| Some(Lamp::new(Shooter::of_face(face, &bvh), face.emission?)))
                .collect(),
            bvh,
            far,
        }
    }

    /// The same with exact form factors of far patches instead of rays: slower by far, and better where
    /// most of the light comes through small openings.
    #[must_use]
    pub fn with_exact_far_patches(mut self) -> Self {
        self.patches = radiant_patches(self.solution, &self.bvh);
        self
    }

    /// The point of a side nearest to a position; `None` for a surface that there is not.
    #[must_use]
    pub fn spot(&self, surface: u32, side: Side, position: Vec3) -> Option<Spot> {
        let outline = self.solution.surfaces.get(surface as usize)?;
        let outline = match side {
            Side::Front => *outline,
            Side::Back => outline.flipped(),
        };
        let (height, _) = outline.height(position);
        let foot = position - outline.normal() * height;
        Some(Spot {
            position: foot + (outline.center() - foot) * INWARDS,
            normal: outline.normal(),
            outline,
        })
    }

    /// Irradiance by every light at unit emission, W/m2; `seed` turns the rays.
    #[must_use]
    pub fn irradiance(&self, spot: Spot, part: Part, seed: u64) -> Vec<Rgb> {
        let mut values = self.direct(spot);
        if part == Part::Total {
            self.add_far(spot, &mut values);
            self.add_near(spot, seed, &mut values);
        }
        values
    }

    fn direct(&self, spot: Spot) -> Vec<Rgb> {
        let Spot {
            position, normal, ..
        } = spot;
        let mut values = vec![Rgb::BLACK; self.solution.lights.len()];
        for lamp in &self.lamps {
            let factor = lamp.factor(spot, &self.bvh);
            values[lamp.emission.light as usize] += lamp.emission.share * factor;
        }
        for luminaire in &self.solution.luminaires {
            let source = luminaire.source();
            let value = luminaire::at_point(source, position, normal, self.far, SETS, &self.bvh);
            values[luminaire.light() as usize] += luminaire.share() * value;
        }
        values
    }

    fn add_far(&self, spot: Spot, values: &mut [Rgb]) {
        let Spot {
            position, normal, ..
        } = spot;
        for patch in &self.patches {
            if patch.is_far(position) {
                let factor = patch.shooter.at_point(position, normal, &self.bvh);
                if factor > 0.0 {
                    for (value, radiosity) in values.iter_mut().zip(&patch.radiosity) {
                        *value += *radiosity * factor;
                    }
                }
            }
        }
    }

    fn add_near(&self, spot: Spot, seed: u64, values: &mut [Rgb]) {
        let rays = Rays::new(self.solution.mesh.view(), &self.locator, &self.bvh);
        let ends = rays.from_point(&spot.outline, spot.position, seed, &self.fan);
        let count = self.fan.count();
        let share = Rgb::splat(1.0 / count as f32);
        let shift = [0, 1].map(|axis| noise::bits(LAMP_SEEDS + seed * 2 + axis));
        let mut caster = self.bvh.caster();
        for ((end, place), number) in ends.zip(self.fan.places()).zip(seed * u64::from(count)..) {
            let Some(end) = end.filter(|end| !self.is_in_far_patch(end, spot.position)) else {
                continue;
            };
            let at = [0, 1].map(|axis: usize| place[axis].wrapping_add(shift[axis]));
            let path = Path { share, at, number };
            self.add_end(&rays, &mut caster, end, path, values);
        }
    }

    fn is_in_far_patch(&self, end: &End, from: Vec3) -> bool {
        let ground = self.grounds.get(end.element as usize);
        let patch = ground.and_then(|ground| self.patches.get(ground.patch as usize));
        patch.is_some_and(|patch| patch.is_far(from))
    }

    /// Adds what comes from the end of a ray.
    fn add_end(
        &self,
        rays: &Rays,
        caster: &mut Caster,
        mut end: End,
        mut path: Path,
        values: &mut [Rgb],
    ) {
        for step in 0..MOST_STEPS {
            let index = end.element as usize;
            let Some(ground) = self.grounds.get(index) else {
                return;
            };
            let exposed = path.share * ground.exposed;
            let all = values.iter_mut().zip(self.solution.element(index));
            if end.distance >= NEAR.max(self.short) * ground.size {
                all.for_each(|(value, all)| *value += exposed * *all);
                return;
            }

            path.share = path.share * ground.reflectance;
            let Some(place) = self.place(&end) else {
                return;
            };
            self.add_direct_at(caster, place, path, values);
            let is_last = step + 1 == MOST_STEPS;
            if is_last || end.distance >= self.short * ground.size {
                let parts = values.iter_mut().zip(self.solution.element(index));
                for ((value, all), own) in parts.zip(self.element_direct(index)) {
                    *value += exposed * (*all - *own).max(Rgb::BLACK);
                }
                return;
            }
            let seed = NEXT_SEEDS + path.number * MOST_STEPS + step;
            let Some(next) = rays.one(&place.outline, place.position, seed) else {
                return;
            };
            end = next;
            path.at = [0, 1].map(|axis: usize| path.at[axis].wrapping_add(STEPS[axis]));
        }
    }

    /// The place where a ray ends, a little away from the edges of its polygon.
    fn place(&self, end: &End) -> Option<Spot> {
        let mesh = self.solution.mesh.view();
        let element = mesh.elements.get(end.element as usize)?;
        let outline = mesh.element_face(element)?.polygon;
        Some(Spot {
            position: end.position + (outline.center() - end.position) * END_INWARDS,
            normal: outline.normal(),
            outline,
        })
    }

    fn element_direct(&self, element: usize) -> &[Rgb] {
        let lights = self.solution.lights.len();
        let first = element * lights;
        self.direct.get(first..first + lights).unwrap_or_default()
    }

    /// Adds direct irradiance by one shadow ray to each lamp, and by one set of directions to the sky.
    fn add_direct_at(&self, caster: &mut Caster, spot: Spot, path: Path, values: &mut [Rgb]) {
        let from = lifted(&spot.outline, spot.position);
        for lamp in &self.lamps {
            if let Some((factor, point)) = lamp.at(spot, path.at)
                && caster.sees(from, point)
            {
                values[lamp.emission.light as usize] += path.share * (lamp.emission.share * factor);
            }
        }
        for luminaire in &self.solution.luminaires {
            let (source, share) = (luminaire.source(), luminaire.share());
            let Spot {
                position, normal, ..
            } = spot;
            let value = luminaire::at_point(source, position, normal, self.far, 1, &self.bvh);
            values[luminaire.light() as usize] += path.share * (share * value);
        }
    }
}

impl fmt::Debug for Gatherer<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Gatherer").finish_non_exhaustive()
    }
}

/// A ray from a point, as far as it has come.
#[derive(Clone, Copy)]
struct Path {
    /// How much of the light at its end reaches the point.
    share: Rgb,
    /// Where on each lamp its shadow rays end, in parts of 2^32.
    at: [u32; 2],
    number: u64,
}

/// The elements as rays find them.
fn grounds(solution: &Solution) -> Vec<Ground> {
    let elements = solution.mesh.elements.iter().enumerate();
    let ground = |(id, element): (usize, &Element)| Ground {
        reflectance: element.reflectance,
        exposed: element.reflectance * solution.exposed(id).recip(),
        size: element.area.sqrt(),
        patch: element.patch,
    };
    elements.map(ground).collect()
}

/// Direct irradiance of every element at unit emission, light inside.
fn direct_of_elements(solution: &Solution, bvh: &Bvh, far: f32) -> Vec<Rgb> {
    let mesh = solution.mesh.view();
    let filler = Parallel::new(&mesh, bvh);
    rows::direct(
        &filler,
        &mesh,
        &solution.luminaires,
        far,
        solution.lights.len(),
    )
}
