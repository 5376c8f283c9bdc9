//! Division of patches inside which direct light varies.
//!
//! A patch shoots its average, so a light near a wall is shot again from all of the patch that it hits a corner of:
//! the largest error of the published scheme. What it costs is measured by the variation of the
//! direct light inside a patch `p` (light `m`, element `j`, `D` irradiance, `<D>` its mean over `p`),
//!
//! `v_pm = sum_{j in p} A_j (rho_j (D_jm - <D_m>))^2 / sum_j A_j (rho_j D_jm)^2`
//!
//! Again and again the light with the largest `v_m = sum_p v_pm` has its largest patch halved, between
//! elements, until `v_m <= tolerance^2` for all of them or the budget of patches is used up. Symmetric rooms have lights,
//! patches and halves that are equal but for rounding: these go together, and a patch of equal halves both ways is
//! quartered, so that where a polygon begins changes nothing.
//! Patches that emit stay whole; those of triangles are divided into their elements at once.

use std::ops::Range;
use std::slice;

use relume::mesh::{Element, Patch};

use super::OwnedMesh;

/// Variations that differ by no more are equal.
const EQUAL: f64 = 1e-3;

/// Direct irradiance of every element by every light, element by element, W/m2 at unit emission.
#[derive(Clone, Copy, Debug)]
pub struct Direct<'a> {
    /// `elements * lights` values.
    pub irradiance: &'a [f32],
    /// Lights.
    pub lights: usize,
}

impl Direct<'_> {
    fn of(&self, element: u32, light: usize) -> f64 {
        self.irradiance[element as usize * self.lights + light].into()
    }
}

/// A mesh with more patches.
#[derive(Clone, Debug)]
pub struct Split {
    /// The same faces and elements, other patches.
    pub mesh: OwnedMesh,
    /// Where each of the former patches begins among the new ones.
    pub first: Vec<u32>,
    /// The largest `sqrt(v_m)` over the lights that is left.
    pub variation: f64,
}

/// Divides patches until the variation of every light is at most `tolerance`, into at most `budget`.
#[must_use]
pub fn split(mesh: &OwnedMesh, direct: Direct, tolerance: f64, budget: usize) -> Split {
    let mut division = Division::new(mesh, direct);
    while division.parts.len() < budget {
        let worst = division.worst();
        let largest = division.largest(worst);
        if worst <= tolerance * tolerance || largest.is_empty() {
            break;
        }
        // From the last on, so that the numbers of the others stay.
        for (part, light) in largest.into_iter().rev() {
            if division.parts.len() < budget {
                division.halve(part, light);
            }
        }
    }
    division.finish()
}

/// A part of a patch: a block of its elements.
struct Part {
    patch: u32,
    /// Columns and rows of the patch's grid of elements.
    columns: Range<usize>,
    rows: Range<usize>,
    /// `v_pm` for each light.
    variation: Vec<f64>,
}

/// The elements of a patch, row by row; triangles have one row of all their elements.
struct Grid {
    elements: Vec<u32>,
    columns: usize,
    is_triangle: bool,
    emits: bool,
}

impl Grid {
    fn block<'a>(
        &'a self,
        columns: Range<usize>,
        rows: Range<usize>,
    ) -> impl Iterator<Item = u32> + Clone + 'a {
        rows.flat_map(move |row| columns.clone().map(move |c| row * self.columns + c))
            .map(|index| self.elements[index])
    }
}

struct Division<'a> {
    mesh: &'a OwnedMesh,
    direct: Direct<'a>,
    grids: Vec<Grid>,
    parts: Vec<Part>,
    /// `1 / sum_j A_j (rho_j D_jm)^2`.
    scales: Vec<f64>,
    /// `v_m`.
    totals: Vec<f64>,
}

impl<'a> Division<'a> {
    fn new(mesh: &'a OwnedMesh, direct: Direct<'a>) -> Self {
        let scales = (0..direct.lights).map(|light| {
            let reflected = mesh.elements.iter().zip(0..).map(|(element, id)| {
                f64::from(element.area) * (reflectance(element) * direct.of(id, light)).powi(2)
            });
            let sum: f64 = reflected.sum();
            if sum > 0.0 { sum.recip() } else { 0.0 }
        });
        let mut division = Self {
            mesh,
            direct,
            grids: grids(mesh),
            parts: Vec::new(),
            scales: scales.collect(),
            totals: vec![0.0; direct.lights],
        };
        for patch in 0..mesh.patches.len() as u32 {
            let grid = &division.grids[patch as usize];
            let rows = grid.elements.len().checked_div(grid.columns).unwrap_or(0);
            let part = division.part(patch, 0..grid.columns, 0..rows);
            division.add(part);
        }
        division
    }

    fn part(&self, patch: u32, columns: Range<usize>, rows: Range<usize>) -> Part {
        let grid = &self.grids[patch as usize];
        let elements = grid.block(columns.clone(), rows.clone());
        let elements = elements.map(|id| (id, &self.mesh.elements[id as usize]));
        let area: f64 = elements.clone().map(|(_, e)| f64::from(e.area)).sum();
        let variation = (0..self.direct.lights).map(|light| {
            if grid.emits {
                return 0.0;
            }
            let value = |id| self.direct.of(id, light);
            let sum: f64 = elements
                .clone()
                .map(|(id, e)| f64::from(e.area) * value(id))
                .sum();
            let mean = sum / area;
            let squares = elements
                .clone()
                .map(|(id, e)| f64::from(e.area) * (reflectance(e) * (value(id) - mean)).powi(2));
            squares.sum::<f64>() * self.scales[light]
        });
        let variation = variation.collect();
        Part {
            variation,
            patch,
            columns,
            rows,
        }
    }

    fn add(&mut self, part: Part) {
        for (total, variation) in self.totals.iter_mut().zip(&part.variation) {
            *total += variation;
        }
        self.parts.push(part);
    }

    /// The largest `v_m`.
    fn worst(&self) -> f64 {
        self.totals.iter().copied().fold(0.0, f64::max)
    }

    /// The parts with the largest variation of the lights that vary like the worst, each with such a light.
    fn largest(&self, worst: f64) -> Vec<(usize, usize)> {
        let varies = |value: f64, largest: f64| value > 0.0 && value >= largest * (1.0 - EQUAL);
        let lights = (0..self.direct.lights).filter(|light| varies(self.totals[*light], worst));
        let mut found = Vec::new();
        for light in lights {
            let variations = self.parts.iter().map(|part| part.variation[light]);
            let largest = variations.clone().fold(0.0, f64::max);
            let parts = variations.enumerate().filter(|(_, v)| varies(*v, largest));
            found.extend(parts.map(|(part, _)| (part, light)));
        }
        found.sort_unstable();
        found.dedup_by_key(|(part, _)| *part);
        found
    }

    fn halve(&mut self, index: usize, light: usize) {
        let part = &self.parts[index];
        if part.columns.len() * part.rows.len() < 2 {
            // Rounding left something in a single element.
            self.totals[light] -= part.variation[light];
            self.parts[index].variation[light] = 0.0;
            return;
        }
        let halves = self.halves(part, light);
        let part = self.parts.remove(index);
        for (total, variation) in self.totals.iter_mut().zip(&part.variation) {
            *total -= variation;
        }
        for half in halves {
            self.add(half);
        }
    }

    /// The two halves that vary least, or four quarters; all elements of a triangle.
    fn halves(&self, part: &Part, light: usize) -> Vec<Part> {
        let (patch, columns, rows) = (part.patch, &part.columns, &part.rows);
        let blocks = |columns: &[Range<usize>], rows: &[Range<usize>]| -> Vec<Part> {
            let block = |c: &Range<usize>, r: &Range<usize>| self.part(patch, c.clone(), r.clone());
            rows.iter()
                .flat_map(|row| columns.iter().map(move |column| block(column, row)))
                .collect()
        };
        let halved = |range: &Range<usize>| {
            let middle = range.start + range.len().div_ceil(2);
            [range.start..middle, middle..range.end]
        };
        if self.grids[patch as usize].is_triangle {
            let each: Vec<_> = columns.clone().map(|column| column..column + 1).collect();
            return blocks(&each, slice::from_ref(rows));
        }
        if rows.len() < 2 {
            return blocks(&halved(columns), slice::from_ref(rows));
        }
        if columns.len() < 2 {
            return blocks(slice::from_ref(columns), &halved(rows));
        }
        let across = blocks(&halved(columns), slice::from_ref(rows));
        let along = blocks(slice::from_ref(columns), &halved(rows));
        let left = |halves: &[Part]| halves.iter().map(|h| h.variation[light]).sum::<f64>();
        let [left_across, left_along] = [left(&across), left(&along)];
        if (left_across - left_along).abs() <= EQUAL * left_across.max(left_along) {
            blocks(&halved(columns), &halved(rows))
        } else if left_across < left_along {
            across
        } else {
            along
        }
    }

    /// The patch that a block of elements makes, the first at its one corner, the last at the other.
    fn patch_of(&self, face: u32, elements: &[u32]) -> Patch {
        let element = |id: &u32| &self.mesh.elements[*id as usize];
        let (first, last) = (
            element(&elements[0]),
            element(&elements[elements.len() - 1]),
        );
        Patch {
            face,
            from: first.from,
            to: last.to,
            area: elements.iter().map(|id| element(id).area).sum(),
        }
    }

    fn finish(mut self) -> Split {
        self.parts
            .sort_by_key(|part| (part.patch, part.rows.start, part.columns.start));
        let mut mesh = self.mesh.clone();
        let mut first = Vec::with_capacity(mesh.patches.len());
        mesh.patches.clear();
        for part in &self.parts {
            let id = mesh.patches.len() as u32;
            if first.len() <= part.patch as usize {
                first.push(id);
            }
            let grid = &self.grids[part.patch as usize];
            let whole = self.mesh.patches[part.patch as usize];
            let is_whole = part.columns.len() * part.rows.len() == grid.elements.len();
            let elements: Vec<u32> = grid
                .block(part.columns.clone(), part.rows.clone())
                .collect();
            mesh.patches.push(if is_whole {
                whole
            } else {
                self.patch_of(whole.face, &elements)
            });
            for element in elements {
                mesh.elements[element as usize].patch = id;
            }
        }
        Split {
            mesh,
            first,
            variation: self.worst().sqrt(),
        }
    }
}

fn reflectance(element: &Element) -> f64 {
    let [r, g, b] = element.reflectance.to_array();
    f64::from(r + g + b) / 3.0
}

/// The elements of every patch in rows and columns.
fn grids(mesh: &OwnedMesh) -> Vec<Grid> {
    let mut grids: Vec<Grid> = mesh
        .patches
        .iter()
        .map(|patch| {
            let face = &mesh.faces[patch.face as usize];
            Grid {
                elements: Vec::new(),
                columns: 0,
                is_triangle: face.polygon.is_triangle(),
                emits: face.emission.is_some(),
            }
        })
        .collect();
    for (element, id) in mesh.elements.iter().zip(0..) {
        grids[element.patch as usize].elements.push(id);
    }
    for grid in &mut grids {
        let row = |id: &u32| mesh.elements[*id as usize].from.y;
        let first_row = grid.elements.first().map(row);
        let in_first_row = |id: &&u32| grid.is_triangle || Some(row(id)) == first_row;
        grid.columns = grid.elements.iter().take_while(in_first_row).count();
    }
    grids
}
