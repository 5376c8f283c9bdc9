//! Light at a point, better than its element knows it: direct light exactly, indirect light gathered.
//!
//! `E(x) = sum over lamps F(x, l) + luminaires + sum over far patches F(x, p) B_p
//!        + 1/R sum over rays that end in near patches rho_h(r) E_h(r)`
//!
//! `F` is the form factor of what is visible, cut out exactly; `B_p` the radiosity that the solution
//! gives patch `p`, constant over it, which does no harm from afar. Rays `r` leave the point
//! cosine-weighted; where one ends in an element `h` of a near patch the variation inside it
//! matters, and where it ends within a few elements even the edge of a shadow does: there the
//! direct part of `E_h` is that of the place itself, with one shadow ray to each lamp (final gather;
//! Reichert 1992). Assumption: lamps radiate evenly from their front.

use glam::{Vec2, Vec3};
use relume::color::Rgb;
use relume::form_factor::Shooter;
use relume::geometry::{Polygon, from_unit_square};
use relume::luminaire;
use relume::mesh::Side;
use relume::scene::{Emission, Surface};
use relume::visibility::Visibility;

use super::Part;
use crate::bvh::Bvh;
use crate::gather::Rays;
use crate::mesh::Locator;
use crate::noise;
use crate::rows::{Parallel, RowFiller, quarters};
use crate::solution::Solution;

/// Rays from a point.
const RAYS: u32 = 2048;

/// Patches that are farther than so many of their longest edges count as constant.
const FAR: f32 = 6.0;

/// How often a lamp is quartered at most.
const MOST_QUARTERINGS: u32 = 5;

/// Ends of rays that are nearer than so many edges of their element are looked at themselves.
const NEAR: f32 = 8.0;

/// Interleaved sets of directions towards sun and sky.
const SETS: u32 = 32;

/// By how much a point is drawn from its polygon's outline towards the middle, away from edges.
const INWARDS: f32 = 1e-5;

/// The same for the end of a ray, whose place matters less than that no light comes around an edge.
const END_INWARDS: f32 = 1e-3;

/// How often a point of a lamp is looked for above the horizon.
const TRIES: u64 = 8;

/// A point on a side of a surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spot {
    position: Vec3,
    normal: Vec3,
    /// Its polygon, front towards the side.
    outline: Polygon,
}

/// A solution, ready to be gathered from.
pub(super) struct Gatherer<'a> {
    solution: &'a Solution,
    locator: Locator<'a>,
    bvh: Bvh,
    lamps: Vec<(Shooter, Emission)>,
    /// Direct irradiance of the elements, light inside.
    direct: Vec<Rgb>,
    patches: Vec<RadiantPatch>,
    far: f32,
}

impl<'a> Gatherer<'a> {
    /// Builds the tree of all surfaces.
    pub fn new(solution: &'a Solution) -> Self {
        let outlines = solution.surfaces.iter().zip(0..);
        let surfaces: Vec<Surface> = outlines
            .filter_map(|(outline, index)| Surface::new(index, outline.vertices(), Rgb::BLACK).ok())
            .collect();
        let (low, high) = solution.bounds().unwrap_or_default();
        let far = 2.0 * (high - low).length();
        let farthest = low.abs().max(high.abs()).max_element() + far;
        let faces = solution.mesh.faces.iter();
        let bvh = Bvh::new(&surfaces, farthest);
        Self {
            solution,
            locator: Locator::new(solution.mesh.view()),
            direct: direct_of_elements(solution, &bvh, far),
            patches: radiant_patches(solution),
            bvh,
            lamps: faces
                .filter_map(|face| Some((Shooter::new(face.polygon), face.emission?)))
                .collect(),
            far,
        }
    }

    /// The point of a side nearest to a position.
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
        for (lamp, emission) in &self.lamps {
            let factor = self.lamp_factor(lamp, spot, 0);
            values[emission.light as usize] += emission.share * factor;
        }
        for luminaire in &self.solution.luminaires {
            let source = luminaire.source();
            let value = luminaire::at_point(source, position, normal, self.far, SETS, &self.bvh);
            values[luminaire.light() as usize] += luminaire.share() * value;
        }
        values
    }

    /// What the place sees of a lamp; where much stands between, of its quarters.
    fn lamp_factor(&self, lamp: &Shooter, spot: Spot, depth: u32) -> f32 {
        let Spot {
            position, normal, ..
        } = spot;
        match lamp.exact_at_point(position, normal, &self.bvh) {
            Some(factor) => factor,
            None if depth == MOST_QUARTERINGS => lamp.at_point(position, normal, &self.bvh),
            None => quarters(lamp.polygon())
                .into_iter()
                .map(|quarter| self.lamp_factor(&Shooter::new(quarter), spot, depth + 1))
                .sum(),
        }
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
        let mesh = self.solution.mesh.view();
        let rays = Rays::new(mesh, &self.locator, &self.bvh);
        let ends = rays.from_point(&spot.outline, spot.position, seed, RAYS);
        for (end, number) in ends.zip(seed * u64::from(RAYS)..) {
            let Some((end, element)) = end.and_then(|end| {
                let element = mesh.elements.get(end.element as usize)?;
                let patch = self.patches.get(element.patch as usize)?;
                (!patch.is_far(spot.position)).then_some((end, element))
            }) else {
                continue;
            };
            let share = element.reflectance * (1.0 / RAYS as f32);
            let contributions = self.solution.element(end.element as usize);
            let is_near = end.distance < NEAR * element.area.sqrt();
            match mesh.element_face(element).filter(|_| is_near) {
                None => {
                    for (value, contribution) in values.iter_mut().zip(contributions) {
                        *value += share * *contribution;
                    }
                }
                Some(face) => {
                    let place = self.place(&face.polygon, end.position);
                    let direct = self.direct_at(place, number);
                    let own = self.element_direct(end.element);
                    let parts = contributions.iter().zip(own).zip(direct);
                    for (value, ((all, own), direct)) in values.iter_mut().zip(parts) {
                        let indirect = (*all - *own).map(|v| v.max(0.0));
                        *value += share * (indirect + direct);
                    }
                }
            }
        }
    }

    fn place(&self, outline: &Polygon, position: Vec3) -> Spot {
        Spot {
            position: position + (outline.center() - position) * END_INWARDS,
            normal: outline.normal(),
            outline: *outline,
        }
    }

    fn element_direct(&self, element: u32) -> &[Rgb] {
        let lights = self.solution.lights.len();
        let first = element as usize * lights;
        self.direct.get(first..first + lights).unwrap_or_default()
    }

    /// Direct irradiance by one shadow ray to each lamp and luminaire; the sky's as the element has it.
    fn direct_at(&self, spot: Spot, seed: u64) -> Vec<Rgb> {
        let Spot {
            position, normal, ..
        } = spot;
        let mut values = vec![Rgb::BLACK; self.solution.lights.len()];
        for (lamp, emission) in &self.lamps {
            let factor = lamp.open_at_point(position, normal);
            let is_above = |point: &Vec3| (*point - position).dot(normal) > 0.0;
            let points = (0..TRIES).map(|index| {
                let seed = 2 * (seed * TRIES + index);
                let at = Vec2::new(noise::unit(seed), noise::unit(seed + 1));
                from_unit_square(lamp.polygon(), at).0
            });
            let is_seen = |point| self.bvh.sees(position, point);
            if factor > 0.0 && points.into_iter().find(is_above).is_some_and(is_seen) {
                values[emission.light as usize] += emission.share * factor;
            }
        }
        for luminaire in &self.solution.luminaires {
            let source = luminaire.source();
            let value = luminaire::at_point(source, position, normal, self.far, 1, &self.bvh);
            values[luminaire.light() as usize] += luminaire.share() * value;
        }
        values
    }
}

/// A patch as it looks from afar.
struct RadiantPatch {
    shooter: Shooter,
    /// Longest edge, m.
    size: f32,
    /// Reflected radiosity by every light at unit emission, W/m2.
    radiosity: Vec<Rgb>,
}

impl RadiantPatch {
    fn is_far(&self, point: Vec3) -> bool {
        let center = self.shooter.polygon().center();
        point.distance_squared(center) > (FAR * self.size).powi(2)
    }
}

/// All patches by number.
fn radiant_patches(solution: &Solution) -> Vec<RadiantPatch> {
    let mesh = solution.mesh.view();
    let mut radiosities = vec![vec![Rgb::BLACK; solution.lights.len()]; mesh.patches.len()];
    for (element, id) in mesh.elements.iter().zip(0..) {
        let patch = element.patch as usize;
        let share = element.reflectance * (element.area / mesh.patches[patch].area);
        for (sum, value) in radiosities[patch].iter_mut().zip(solution.element(id)) {
            *sum += share * *value;
        }
    }
    let patches = (0..).zip(radiosities).filter_map(|(patch, radiosity)| {
        let polygon = mesh.patch_polygon(patch)?;
        Some(RadiantPatch {
            shooter: Shooter::new(polygon),
            size: polygon.longest_edge(),
            radiosity,
        })
    });
    patches.collect()
}

/// Direct irradiance of every element at unit emission, light inside.
fn direct_of_elements(solution: &Solution, bvh: &Bvh, far: f32) -> Vec<Rgb> {
    let mesh = solution.mesh.view();
    let lights = solution.lights.len();
    let mut direct = vec![Rgb::BLACK; mesh.elements.len() * lights];
    let mut row = vec![0.0; mesh.elements.len()];
    let filler = Parallel::new(&mesh, bvh);
    let mut add = |light: u32, share: Rgb, row: &[f32]| {
        let values = direct
            .iter_mut()
            .skip(light as usize)
            .step_by(lights.max(1));
        for (value, factor) in values.zip(row) {
            *value += share * *factor;
        }
    };
    for face in mesh.faces {
        if let Some(emission) = face.emission {
            filler.lamp(&mesh, &face.polygon, &mut row);
            add(emission.light, emission.share, &row);
        }
    }
    for luminaire in &solution.luminaires {
        filler.luminaire(&mesh, luminaire, far, &mut row);
        add(luminaire.light(), luminaire.share(), &row);
    }
    direct
}
