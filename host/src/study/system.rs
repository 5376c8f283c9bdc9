//! A mesh with all of its rows, so that published methods and ours start from the same numbers.
//!
//! Errors are those of the worst light: area-weighted relative L2 of irradiance at unit emission,
//! `sqrt(sum_jc A_j (E_jc - T_jc)^2 / sum_jc A_j T_jc^2)` over elements and channels.

use relume::color::Rgb;
use relume::mesh::Mesh;
use relume::refine::{Choice, RefineError, Refinement};

use crate::bake::Memory;
use crate::mesh::OwnedMesh;
use crate::reference::dense::{DenseError, DenseLight, DenseSolution, DenseSystem};
use crate::rows::RowFiller;

/// Irradiance in RGB, `[element][light]`, W/m2.
pub type Field = Vec<Vec<[f64; 3]>>;

/// Lanes of a block, as the bake has them.
pub const LANES: usize = 8;

/// A mesh and all form factors of it.
#[derive(Clone, Debug)]
pub struct System {
    /// The mesh.
    pub mesh: OwnedMesh,
    /// Number of tags.
    pub lights: u32,
    /// `F_ji` of patch `i` and element `j`, at `i * elements + j`.
    pub rows: Vec<f32>,
}

/// How a refinement is run.
#[derive(Clone, Copy, Debug)]
pub struct Way {
    /// Most rows that are kept, whose patches are solved for in the end; every other shot counts by itself.
    pub kept: usize,
    /// Which patch is next.
    pub choice: Choice,
    /// Residual to reach.
    pub residual: f32,
    /// Most rows to hand in.
    pub shots: u32,
}

impl Way {
    /// As published: the largest unshot power is next, no row is kept.
    #[must_use]
    pub const fn published(shots: u32, residual: f32) -> Self {
        Self {
            kept: 0,
            choice: Choice::Power,
            residual,
            shots,
        }
    }

    /// As shipped: rows are kept, the largest relative unshot power is next.
    #[must_use]
    pub const fn kept(shots: u32, residual: f32) -> Self {
        Self {
            kept: usize::MAX,
            choice: Choice::Relative,
            residual,
            shots,
        }
    }
}

/// What a refinement found.
#[derive(Clone, Debug)]
pub struct Refined {
    /// Irradiance of every element and light.
    pub irradiance: Field,
    /// What is still unshot, as ambient irradiance of every light.
    pub ambient: Vec<[f64; 3]>,
    /// Rows that were handed in, in order.
    pub shooters: Vec<u32>,
}

impl Refined {
    /// Irradiance with the ambient term, as the bake gives it.
    #[must_use]
    pub fn with_ambient(&self) -> Field {
        let sum = |(value, ambient): (&[f64; 3], &[f64; 3])| {
            [0, 1, 2].map(|channel: usize| value[channel] + ambient[channel])
        };
        let of_element =
            |values: &Vec<[f64; 3]>| values.iter().zip(&self.ambient).map(sum).collect();
        self.irradiance.iter().map(of_element).collect()
    }
}

impl System {
    /// Fills the rows of all patches.
    #[must_use]
    pub fn new(mesh: OwnedMesh, lights: u32, filler: &impl RowFiller) -> Self {
        let view = mesh.view();
        let n = view.elements.len();
        let mut rows = vec![0.0; n * view.patches.len()];
        for (row, patch) in rows.chunks_mut(n.max(1)).zip(0..) {
            filler.patch(&view, patch, row);
        }
        Self { mesh, lights, rows }
    }

    /// The row of a patch.
    #[must_use]
    pub fn row(&self, patch: u32) -> &[f32] {
        let n = self.mesh.elements.len();
        &self.rows[patch as usize * n..][..n]
    }

    /// `sum_i F_ji` of every element: one in closed scenes, less in open ones.
    #[must_use]
    pub fn receiver_sums(&self) -> Vec<f64> {
        let n = self.mesh.elements.len();
        let mut sums = vec![0.0; n];
        for row in self.rows.chunks(n.max(1)) {
            for (sum, factor) in sums.iter_mut().zip(row) {
                *sum += f64::from(*factor);
            }
        }
        sums
    }

    /// The exact solution for these rows.
    ///
    /// # Errors
    /// [`DenseError::Singular`] when the rows are not physical.
    pub fn dense(&self) -> Result<DenseSolution, DenseError> {
        let mesh = self.mesh.view();
        let (n, p) = (mesh.elements.len(), mesh.patches.len() as u32);
        let exitance: Vec<Vec<[f64; 3]>> = (0..self.lights)
            .map(|light| (0..p).map(|patch| exitance(&mesh, patch, light)).collect())
            .collect();
        let nothing = vec![[0.0; 3]; n];
        let lights: Vec<DenseLight> = exitance
            .iter()
            .map(|exitance| DenseLight {
                exitance,
                direct: &nothing,
            })
            .collect();
        let patch_areas: Vec<f64> = mesh.patches.iter().map(|p| p.area.into()).collect();
        let element_areas: Vec<f64> = mesh.elements.iter().map(|e| e.area.into()).collect();
        let reflectances: Vec<[f64; 3]> =
            mesh.elements.iter().map(|e| rgb(e.reflectance)).collect();
        let patch_of: Vec<u32> = mesh.elements.iter().map(|e| e.patch).collect();
        DenseSystem {
            form_factors: &self.rows,
            patch_areas: &patch_areas,
            element_areas: &element_areas,
            reflectances: &reflectances,
            patch_of: &patch_of,
            lights: &lights,
        }
        .solve()
    }

    /// Runs the solver's refinement on these rows.
    ///
    /// # Errors
    /// [`RefineError`] when a row is illegal.
    pub fn refine(&self, way: Way) -> Result<Refined, RefineError> {
        self.refine_then(way, |_| ())
    }

    /// The same, with something to be done when shooting has ended.
    ///
    /// # Errors
    /// [`RefineError`] when a row is illegal.
    pub fn refine_then(
        &self,
        way: Way,
        end: impl FnOnce(&mut Refinement<LANES>),
    ) -> Result<Refined, RefineError> {
        let mesh = self.mesh.view();
        let rows = way.kept.min(mesh.patches.len());
        let mut memory = Memory::<LANES>::new(&mesh, self.lights as usize, rows, false);
        let mut refinement = Refinement::new(mesh, self.lights, way.residual, memory.storage())?;
        refinement.set_choice(way.choice);
        let mut shooters = Vec::new();
        while shooters.len() < way.shots as usize {
            let Some(patch) = refinement.next_shooter() else {
                break;
            };
            refinement.shoot(patch, self.row(patch))?;
            shooters.push(patch);
        }
        refinement.finish();
        end(&mut refinement);
        Ok(Refined {
            irradiance: field(&refinement, &mesh, self.lights),
            ambient: (0..self.lights)
                .map(|light| rgb(refinement.ambient(light)))
                .collect(),
            shooters,
        })
    }

    /// Error of every light.
    #[must_use]
    pub fn errors(&self, found: &Field, truth: &Field) -> Vec<f64> {
        (0..self.lights as usize)
            .map(|light| {
                let (mut difference, mut norm) = (0.0, 0.0);
                for ((found, truth), element) in found.iter().zip(truth).zip(&self.mesh.elements) {
                    let area = f64::from(element.area);
                    for (found, truth) in found[light].iter().zip(truth[light]) {
                        difference += area * (found - truth).powi(2);
                        norm += area * truth * truth;
                    }
                }
                (difference / norm).sqrt()
            })
            .collect()
    }

    /// Error of the worst light.
    #[must_use]
    pub fn worst_error(&self, found: &Field, truth: &Field) -> f64 {
        self.errors(found, truth).into_iter().fold(0.0, f64::max)
    }
}

/// Irradiance that a refinement has found so far.
#[must_use]
pub fn field<const K: usize>(refinement: &Refinement<K>, mesh: &Mesh, lights: u32) -> Field {
    let of_element = |element| {
        let by_light = (0..lights).map(|light| rgb(refinement.irradiance(element, light)));
        by_light.collect()
    };
    (0..mesh.elements.len() as u32).map(of_element).collect()
}

/// What a patch emits for a light, W/m2.
#[must_use]
pub fn exitance(mesh: &Mesh, patch: u32, light: u32) -> [f64; 3] {
    let emission = mesh.patch_emission(patch).filter(|e| e.light == light);
    emission.map_or([0.0; 3], |emission| rgb(emission.share))
}

fn rgb(value: Rgb) -> [f64; 3] {
    value.to_array().map(f64::from)
}
