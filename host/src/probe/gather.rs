//! Light at a point, better than its element knows it: direct light exactly, indirect light gathered.
//!
//! `E(x) = sum over lamps F(x, visible part of the lamp) + luminaires + 1/R sum_r rho_h(r) E_h(r)`
//!
//! Rays `r` leave the point cosine-weighted and end in elements `h(r)`, whose irradiance the solution
//! holds (final gather; Reichert 1992). Assumption: lamps radiate evenly from their front.

use glam::Vec3;
use relume::color::Rgb;
use relume::form_factor::Shooter;
use relume::luminaire;
use relume::mesh::{Element, Side};
use relume::scene::{Emission, Surface};

use super::Part;
use crate::bvh::Bvh;
use crate::gather::Rays;
use crate::solution::Solution;

/// Rays from a point.
const RAYS: u32 = 2048;

/// Interleaved sets of directions towards sun and sky.
const SETS: u32 = 32;

/// By how much a point is drawn from its polygon's outline towards the middle, away from edges.
const INWARDS: f32 = 1e-5;

/// A point on a side of a surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spot {
    position: Vec3,
    normal: Vec3,
}

/// A solution, ready to be gathered from.
pub(super) struct Gatherer<'a> {
    solution: &'a Solution,
    bvh: Bvh,
    lamps: Vec<(Shooter, Emission)>,
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
        Self {
            solution,
            bvh: Bvh::new(&surfaces, farthest),
            lamps: faces
                .filter_map(|face| Some((Shooter::new(face.polygon), face.emission?)))
                .collect(),
            far,
        }
    }

    /// The point of a side nearest to a position.
    pub fn spot(&self, surface: u32, side: Side, position: Vec3) -> Option<Spot> {
        let outline = self.solution.surfaces.get(surface as usize)?;
        let (height, _) = outline.height(position);
        let foot = position - outline.normal() * height;
        Some(Spot {
            position: foot + (outline.center() - foot) * INWARDS,
            normal: match side {
                Side::Front => outline.normal(),
                Side::Back => -outline.normal(),
            },
        })
    }

    /// Irradiance by every light at unit emission, W/m2; `seed` turns the rays.
    pub fn irradiance(&self, spot: Spot, part: Part, seed: u64) -> Vec<Rgb> {
        let mut values = self.direct(spot);
        if part == Part::Total {
            self.add_indirect(spot, seed, &mut values);
        }
        values
    }

    fn direct(&self, Spot { position, normal }: Spot) -> Vec<Rgb> {
        let mut values = vec![Rgb::BLACK; self.solution.lights.len()];
        for (lamp, emission) in &self.lamps {
            let factor = lamp.at_point(position, normal, &self.bvh);
            values[emission.light as usize] += emission.share * factor;
        }
        for luminaire in &self.solution.luminaires {
            let source = luminaire.source();
            let value = luminaire::at_point(source, position, normal, self.far, SETS, &self.bvh);
            values[luminaire.light() as usize] += luminaire.share() * value;
        }
        values
    }

    fn add_indirect(&self, Spot { position, normal }: Spot, seed: u64, values: &mut [Rgb]) {
        let mesh = self.solution.mesh.view();
        let rays = Rays::new(mesh, &self.bvh, self.far);
        for hit in rays.from_point(position, normal, seed, RAYS).flatten() {
            let Some(Element { reflectance, .. }) = mesh.elements.get(hit as usize) else {
                continue;
            };
            let share = *reflectance * (1.0 / RAYS as f32);
            let contributions = self.solution.element(hit as usize);
            for (value, contribution) in values.iter_mut().zip(contributions) {
                *value += share * *contribution;
            }
        }
    }
}
