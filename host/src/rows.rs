//! Rows of form factors and of direct light, filled serially as a device does or by many threads.
//!
//! Every value depends on its own receiver alone, so how the work is shared does not change the
//! bits. Threads take receiving patches, one after the other: what can stand between it and the
//! shooter is looked up in the tree once, for all of its elements.

use std::ops::Range;

use rayon::prelude::*;
use relume::form_factor::{self, Shooter};
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

/// Fills rows.
pub trait RowFiller {
    /// Direct irradiance of every element by a luminaire at unit emission, W/m2.
    fn luminaire(&self, mesh: &Mesh, luminaire: &Luminaire, far: f32, row: &mut [f32]);

    /// Form factors from every element to a polygon: a patch, or a whole lamp.
    fn shooter(&self, mesh: &Mesh, polygon: &Polygon, row: &mut [f32]);
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
    fn luminaire(&self, mesh: &Mesh, luminaire: &Luminaire, far: f32, row: &mut [f32]) {
        row.par_chunks_mut(CHUNK)
            .enumerate()
            .for_each(|(index, part)| {
                let first = (index * CHUNK) as u32;
                luminaire::fill(mesh, luminaire, far, first, self.bvh, part);
            });
    }

    fn shooter(&self, mesh: &Mesh, polygon: &Polygon, row: &mut [f32]) {
        row.fill(0.0);
        let shooter = Shooter::new(*polygon);
        let factors: Vec<Vec<f32>> = self
            .patches
            .par_iter()
            .map(|(receiver, range)| {
                if shooter.is_out_of_sight(receiver) {
                    return Vec::new();
                }
                let margin = ROUNDINGS * largest_coordinate(&[*polygon, *receiver]);
                let shaft = Shaft::with_margin(receiver, polygon, margin);
                let narrowed = self.bvh.narrowed(&shaft);
                let receivers = self.elements[range.clone()].iter();
                let receivers = receivers.filter_map(|e| mesh.elements.get(*e as usize));
                receivers
                    .filter_map(|element| mesh.element_polygon(element))
                    .map(|receiver| shooter.form_factor(&receiver, &narrowed))
                    .collect()
            })
            .collect();
        for ((_, range), factors) in self.patches.iter().zip(factors) {
            for (element, factor) in self.elements[range.clone()].iter().zip(factors) {
                row[*element as usize] = factor;
            }
        }
    }
}

fn largest_coordinate(polygons: &[Polygon]) -> f32 {
    let vertices = polygons.iter().flat_map(Polygon::vertices);
    vertices.map(|v| v.abs().max_element()).fold(0.0, f32::max)
}
