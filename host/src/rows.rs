//! Rows of form factors and of direct light, filled serially as a device does or by many threads.
//!
//! Every value depends on its own receiver alone, so how the work is shared does not change the
//! bits. Threads take receiving patches, one after the other: what can stand between it and the
//! shooter is looked up in the tree once, for all of its elements.

use std::ops::Range;

use glam::Vec2;
use rayon::prelude::*;
use relume::form_factor::{self, Receiver, Shooter, View};
use relume::geometry::Polygon;
use relume::luminaire;
use relume::mesh::Mesh;
use relume::scene::Luminaire;
use relume::visibility::{Occluders, Shaft};

use crate::bvh::Bvh;

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
}

/// The solver alone, by brute force: what a device does.
#[derive(Clone, Copy, Debug)]
pub struct Serial<'a>(
    /// The surfaces that block.
    pub Occluders<'a>,
);

impl RowFiller for Serial<'_> {
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
    /// The same elements.
    receivers: Vec<Receiver>,
    /// Patches that have elements, with their ranges of the lists above.
    patches: Vec<(Polygon, Range<usize>)>,
}

impl<'a> Parallel<'a> {
    /// Sorts the elements of a mesh by patch.
    #[must_use]
    pub fn new(mesh: &Mesh, bvh: &'a Bvh) -> Self {
        let patch_of = |element: &u32| mesh.elements[*element as usize].patch;
        let outline = |element: &u32| mesh.element_polygon(&mesh.elements[*element as usize]);
        let mut elements: Vec<u32> = (0..mesh.elements.len() as u32).collect();
        elements.retain(|element| outline(element).is_some());
        elements.sort_by_key(patch_of);
        let receivers = elements.iter().filter_map(outline);
        let receivers = receivers.map(Receiver::new).collect();
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
            receivers,
            patches,
        }
    }
}

impl RowFiller for Parallel<'_> {
    fn luminaire(&self, mesh: &Mesh, luminaire: &Luminaire, far: f32, row: &mut [f32]) {
        row.par_chunks_mut(CHUNK)
            .enumerate()
            .for_each(|(index, part)| {
                let first = (index * CHUNK) as u32;
                luminaire::fill(mesh, luminaire, far, first, self.bvh, part);
            });
    }

    fn shooter(&self, _: &Mesh, polygon: &Polygon, row: &mut [f32]) {
        let shooter = Shooter::new(*polygon);
        self.fill(row, |receiver, range| {
            self.factors(&shooter, receiver, range)
        });
    }

    fn lamp(&self, _: &Mesh, polygon: &Polygon, row: &mut [f32]) {
        self.fill(row, |receiver, range| {
            self.lamp_factors(polygon, receiver, range, 0)
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
    fn factors(&self, shooter: &Shooter, receiver: &Polygon, range: &Range<usize>) -> Vec<f32> {
        let view = shooter.seen_by(receiver, self.bvh);
        self.element_factors(&view, receiver, range)
    }

    /// The same; where much stands between, the lamp is quartered, so that less is in the way of each
    /// part.
    fn lamp_factors(
        &self,
        lamp: &Polygon,
        receiver: &Polygon,
        range: &Range<usize>,
        depth: u32,
    ) -> Vec<f32> {
        let shooter = Shooter::new(*lamp);
        let view = shooter.seen_by(receiver, self.bvh);
        let is_simple = view.blockers().is_some_and(|count| count <= MANY_BLOCKERS);
        if is_simple || depth == MOST_QUARTERINGS {
            return self.element_factors(&view, receiver, range);
        }
        let mut sum = vec![0.0; range.len()];
        for quarter in quarters(lamp) {
            let factors = self.lamp_factors(&quarter, receiver, range, depth + 1);
            for (sum, factor) in sum.iter_mut().zip(factors) {
                *sum += factor;
            }
        }
        sum
    }

    fn element_factors(&self, view: &View, receiver: &Polygon, range: &Range<usize>) -> Vec<f32> {
        if view.is_hidden() {
            return Vec::new();
        }
        let receivers = self.receivers[range.clone()].iter();
        if view.blockers().is_some() {
            return receivers.map(|r| view.form_factor(r, self.bvh)).collect();
        }
        let margin = ROUNDINGS * largest_coordinate(&[*view.shooter().polygon(), *receiver]);
        let shaft = Shaft::with_margin(receiver, view.shooter().polygon(), margin);
        let narrowed = self.bvh.narrowed(&shaft);
        receivers.map(|r| view.form_factor(r, &narrowed)).collect()
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
