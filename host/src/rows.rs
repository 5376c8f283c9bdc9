//! Rows of form factors and of direct light, filled serially as a device does or by many threads.
//!
//! Every value depends on its own receiver alone, so how the work is shared does not change the
//! bits. Threads take receiving patches, one after the other: what can stand between it and the
//! shooter is looked up in the tree once, for all of its elements.

use std::ops::Range;

use glam::Vec2;
use rayon::prelude::*;
use relume::form_factor::{self, Shooter};
use relume::geometry::Polygon;
use relume::luminaire;
use relume::mesh::Mesh;
use relume::refine::Refinement;
use relume::scene::{Luminaire, Scene};
use relume::visibility::{Occluders, Shaft, Visibility};

use crate::bvh::{Bvh, Narrowed};

/// Receivers of direct light that one task fills.
const CHUNK: usize = 64;

/// Roundings by which the outline of an element may stick out of its patch.
const ROUNDINGS: f32 = 16.0 * f32::EPSILON;

/// Surfaces between a lamp and a patch that are so many that the lamp is quartered.
const MANY_BLOCKERS: usize = 12;

/// How often a lamp is quartered at most.
const MOST_QUARTERINGS: u32 = 3;

/// Fills rows.
pub trait RowFiller {
    /// Who sees whom.
    fn visibility(&self) -> &impl Visibility;

    /// Direct irradiance of every element by a luminaire at unit emission, W/m2.
    fn luminaire(&self, mesh: &Mesh, luminaire: &Luminaire, far: f32, row: &mut [f32]);

    /// Form factors from every element to a polygon: a patch, or a whole lamp.
    fn shooter(&self, mesh: &Mesh, polygon: &Polygon, row: &mut [f32]);

    /// Form factors from every element to a patch; zeros for one that the mesh does not have.
    fn patch(&self, mesh: &Mesh, patch: u32, row: &mut [f32]) {
        match mesh.patch_polygon(patch) {
            Some(polygon) => self.shooter(mesh, &polygon, row),
            None => row.fill(0.0),
        }
    }

    /// The same for a whole lamp, which may be large and seen through much.
    fn lamp(&self, mesh: &Mesh, polygon: &Polygon, row: &mut [f32]) {
        self.shooter(mesh, polygon, row);
    }

    /// Estimates of the form factors from every element to a polygon.
    fn estimate(&self, mesh: &Mesh, polygon: &Polygon, row: &mut [f32]) {
        let shooter = Shooter::new(*polygon);
        form_factor::estimate(mesh, &shooter, 0, self.visibility(), row);
    }
}

/// Estimates the rows that a refinement misses ([`Refinement::close`]) and solves with them.
///
/// Where there is no room for all rows nothing changes.
pub fn close<const K: usize>(
    refinement: &mut Refinement<K>,
    mesh: &Mesh,
    scene: &Scene,
    filler: &impl RowFiller,
) {
    let is_closed = luminaire::is_closed(mesh, luminaire::far(scene), filler.visibility());
    let dark = is_closed.then(|| dark_shares(mesh, scene, filler));
    refinement.close(dark.as_deref(), |patch, row| {
        if let Some(polygon) = mesh.patch_polygon(patch) {
            filler.estimate(mesh, &polygon, row);
        }
    });
    refinement.finish();
}

/// What share of every element's view has no patches.
fn dark_shares(mesh: &Mesh, scene: &Scene, filler: &impl RowFiller) -> Vec<f32> {
    let mut dark = vec![0.0; mesh.elements.len()];
    let mut row = dark.clone();
    for side in mesh.dark_sides(scene.surfaces()) {
        filler.estimate(mesh, &side, &mut row);
        for (sum, factor) in dark.iter_mut().zip(&row) {
            *sum += factor;
        }
    }
    dark
}

/// The solver alone, by brute force: what a device does.
#[derive(Clone, Copy, Debug)]
pub struct Serial<'a>(
    /// The surfaces that block.
    pub Occluders<'a>,
);

impl RowFiller for Serial<'_> {
    fn visibility(&self) -> &impl Visibility {
        &self.0
    }

    fn luminaire(&self, mesh: &Mesh, luminaire: &Luminaire, far: f32, row: &mut [f32]) {
        luminaire::fill(mesh, luminaire, far, 0, &self.0, row);
    }

    fn shooter(&self, mesh: &Mesh, polygon: &Polygon, row: &mut [f32]) {
        form_factor::fill(mesh, &Shooter::new(*polygon), 0, &self.0, row);
    }
}

/// All threads, with a tree of boxes, for one mesh.
#[derive(Debug)]
pub struct Parallel<'a> {
    bvh: &'a Bvh,
    /// Element numbers, patch by patch.
    elements: Vec<u32>,
    /// Patches that have elements, with their ranges of the list above.
    patches: Vec<(Polygon, Range<usize>)>,
}

impl<'a> Parallel<'a> {
    /// Sorts the elements of a mesh by patch.
    #[must_use]
    pub fn new(mesh: &Mesh, bvh: &'a Bvh) -> Self {
        let patch_of = |element: &u32| mesh.elements[*element as usize].patch;
        let mut elements: Vec<u32> = (0..mesh.elements.len() as u32).collect();
        elements.sort_by_key(patch_of);
        let mut start = 0;
        let patches = elements
            .chunk_by(|a, b| patch_of(a) == patch_of(b))
            .filter_map(|chunk| {
                let range = start..start + chunk.len();
                start = range.end;
                Some((mesh.patch_polygon(patch_of(&chunk[0]))?, range))
            })
            .collect();
        Self {
            bvh,
            elements,
            patches,
        }
    }
}

impl RowFiller for Parallel<'_> {
    fn visibility(&self) -> &impl Visibility {
        self.bvh
    }

    fn luminaire(&self, mesh: &Mesh, luminaire: &Luminaire, far: f32, row: &mut [f32]) {
        row.par_chunks_mut(CHUNK)
            .enumerate()
            .for_each(|(index, part)| {
                let first = (index * CHUNK) as u32;
                luminaire::fill(mesh, luminaire, far, first, self.bvh, part);
            });
    }

    fn shooter(&self, mesh: &Mesh, polygon: &Polygon, row: &mut [f32]) {
        let shooter = Shooter::new(*polygon);
        self.fill(row, |receiver, range| {
            self.factors(mesh, &shooter, receiver, range, |element, seen| {
                shooter.form_factor(element, seen)
            })
        });
    }

    fn estimate(&self, mesh: &Mesh, polygon: &Polygon, row: &mut [f32]) {
        let shooter = Shooter::new(*polygon);
        self.fill(row, |receiver, range| {
            self.factors(mesh, &shooter, receiver, range, |element, seen| {
                shooter.estimate(element, seen)
            })
        });
    }

    fn lamp(&self, mesh: &Mesh, polygon: &Polygon, row: &mut [f32]) {
        self.fill(row, |receiver, range| {
            self.lamp_factors(mesh, polygon, receiver, range, 0)
        });
    }
}

impl Parallel<'_> {
    /// Fills a row from the factors of the elements of every patch.
    fn fill(&self, row: &mut [f32], factors: impl Fn(&Polygon, &Range<usize>) -> Vec<f32> + Sync) {
        row.fill(0.0);
        let patches = self.patches.par_iter();
        let factors: Vec<Vec<f32>> = patches
            .map(|(receiver, range)| factors(receiver, range))
            .collect();
        for ((_, range), factors) in self.patches.iter().zip(factors) {
            for (element, factor) in self.elements[range.clone()].iter().zip(factors) {
                row[*element as usize] = factor;
            }
        }
    }

    /// Form factors of the elements of one patch; none where the shooter is out of sight.
    fn factors(
        &self,
        mesh: &Mesh,
        shooter: &Shooter,
        receiver: &Polygon,
        range: &Range<usize>,
        factor: impl Fn(&Polygon, &Narrowed) -> f32,
    ) -> Vec<f32> {
        if shooter.is_out_of_sight(receiver) {
            return Vec::new();
        }
        let narrowed = self.narrowed(shooter.polygon(), receiver);
        let receivers = self.receivers(mesh, range);
        receivers
            .map(|receiver| factor(&receiver, &narrowed))
            .collect()
    }

    /// The same; where much stands between, the lamp is quartered, so that less is in the way of each
    /// part.
    fn lamp_factors(
        &self,
        mesh: &Mesh,
        lamp: &Polygon,
        receiver: &Polygon,
        range: &Range<usize>,
        depth: u32,
    ) -> Vec<f32> {
        let shooter = Shooter::new(*lamp);
        if shooter.is_out_of_sight(receiver) {
            return Vec::new();
        }
        let narrowed = self.narrowed(lamp, receiver);
        if narrowed.blockers() <= MANY_BLOCKERS || depth == MOST_QUARTERINGS {
            let receivers = self.receivers(mesh, range);
            return receivers
                .map(|receiver| shooter.form_factor(&receiver, &narrowed))
                .collect();
        }
        let mut sum = vec![0.0; range.len()];
        for quarter in quarters(lamp) {
            let factors = self.lamp_factors(mesh, &quarter, receiver, range, depth + 1);
            for (sum, factor) in sum.iter_mut().zip(factors) {
                *sum += factor;
            }
        }
        sum
    }

    fn narrowed(&self, shooter: &Polygon, receiver: &Polygon) -> Narrowed<'_> {
        let margin = ROUNDINGS * largest_coordinate(&[*shooter, *receiver]);
        let shaft = Shaft::with_margin(receiver, shooter, margin);
        self.bvh.narrowed(&shaft)
    }

    /// Outlines of the elements of one patch.
    fn receivers(&self, mesh: &Mesh, range: &Range<usize>) -> impl Iterator<Item = Polygon> {
        let elements = self.elements[range.clone()].iter();
        elements
            .filter_map(|element| mesh.elements.get(*element as usize))
            .filter_map(|element| mesh.element_polygon(element))
    }
}

/// Four parts of a polygon.
#[must_use]
pub fn quarters(polygon: &Polygon) -> [Polygon; 4] {
    let half = Vec2::splat(0.5);
    let corners = if polygon.is_triangle() {
        [
            (Vec2::ZERO, half),
            (Vec2::new(0.5, 0.0), Vec2::new(1.0, 0.5)),
            (Vec2::new(0.0, 0.5), Vec2::new(0.5, 1.0)),
            (half, Vec2::ZERO),
        ]
    } else {
        [
            (Vec2::ZERO, half),
            (Vec2::new(0.5, 0.0), Vec2::new(1.0, 0.5)),
            (Vec2::new(0.0, 0.5), Vec2::new(0.5, 1.0)),
            (half, Vec2::ONE),
        ]
    };
    corners.map(|(from, to)| polygon.part(from, to))
}

fn largest_coordinate(polygons: &[Polygon]) -> f32 {
    let vertices = polygons.iter().flat_map(Polygon::vertices);
    vertices.map(|v| v.abs().max_element()).fold(0.0, f32::max)
}
