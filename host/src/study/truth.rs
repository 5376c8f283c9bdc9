//! What a divided scene's irradiance really is: dense solutions of exact rows, and traced paths.
//!
//! `dense_patch` solves the patches of the mesh directly; in `dense_element` every element shoots, so
//! that it has no substructuring error. Both take their form factors from exact clip rows, which paths
//! check: they know nothing of rows and carry standard errors.
//!
//! Error of light `m`, with elements (or places) of areas `A_j`, summed over the channels:
//!
//! `e_m^2 = sum_j A_j ((E_jm - T_jm)^2 - s_jm^2) / sum_j A_j (T_jm^2 - s_jm^2)`
//!
//! `T` is the truth and `s` its standard error, 0 for dense solutions, so that the noise of the paths is no
//! error of the method. What it leaves uncertain, with `d = E - T` and `N` the denominator above:
//!
//! `se(e_m^2) = sqrt(4 sum_j A_j^2 d_jm^2 s_jm^2 + 2 sum_j A_j^2 s_jm^4) / N`, `se(e_m) = se(e_m^2) / (2 e_m)`

use glam::DVec3;
use relume::luminaire;
use relume::mesh::{Mesh, Patch};
use relume::scene::SceneError;

use crate::bake::Meshed;
use crate::mesh::OwnedMesh;
use crate::reference::dense::{DenseError, DenseLight, DenseSystem};
use crate::reference::path_trace::{PathTracer, Receiver};
use crate::rows::{Parallel, RowFiller};
use crate::scene::OwnedScene;

/// A true value with its standard error, RGB.
#[derive(Clone, Copy, Debug)]
pub struct Value {
    /// Irradiance at unit emission, W/m2.
    pub irradiance: [f64; 3],
    /// Its standard error; 0 for a dense solution.
    pub error: [f64; 3],
}

/// The irradiance of places by every light.
#[derive(Clone, Debug)]
pub struct Truth {
    /// Area that each place stands for, m2.
    pub areas: Vec<f64>,
    /// `[place][light]`.
    pub values: Vec<Vec<Value>>,
}

/// Relative L2 error of a light beyond the truth's own noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightError {
    /// The error.
    pub error: f64,
    /// Its standard error, by the noise of the truth.
    pub standard_error: f64,
}

/// Errors of all lights.
#[derive(Clone, Debug, PartialEq)]
pub struct Errors(Vec<LightError>);

impl Errors {
    /// That of the worst light; without lights there is none.
    #[must_use]
    pub fn worst(&self) -> LightError {
        let nothing = LightError {
            error: 0.0,
            standard_error: 0.0,
        };
        let worst = self.0.iter().max_by(|a, b| a.error.total_cmp(&b.error));
        worst.copied().unwrap_or(nothing)
    }

    /// The median over the lights; the mean of the two in the middle of an even number.
    #[must_use]
    pub fn median(&self) -> f64 {
        let mut errors: Vec<f64> = self.0.iter().map(|light| light.error).collect();
        errors.sort_by(f64::total_cmp);
        let middle = |index: usize| errors.get(index).copied().unwrap_or(0.0);
        let count = errors.len();
        (middle(count.saturating_sub(1) / 2) + middle(count / 2)) / 2.0
    }
}

impl Truth {
    /// The errors of what was `found`, place and light, W/m2.
    #[must_use]
    pub fn errors(&self, found: impl Fn(usize, usize) -> [f32; 3]) -> Errors {
        let lights = self.values.first().map_or(0, Vec::len);
        let error_of = |light: usize| {
            let (mut square, mut norm, mut scatter) = (0.0, 0.0, 0.0);
            for (place, (area, truth)) in self.areas.iter().zip(&self.values).enumerate() {
                let (found, truth) = (found(place, light), truth[light]);
                // The channels of a place are noisy together.
                let (mut product, mut noise) = (0.0, 0.0);
                for (channel, found) in found.into_iter().enumerate() {
                    let exact = truth.irradiance[channel];
                    let variance = truth.error[channel].powi(2);
                    let difference = f64::from(found) - exact;
                    square += area * (difference.powi(2) - variance);
                    norm += area * (exact * exact - variance);
                    product += area * difference.abs() * truth.error[channel];
                    noise += area * variance;
                }
                scatter += 4.0 * product * product + 2.0 * noise * noise;
            }
            let norm = norm.max(f64::MIN_POSITIVE);
            let error = (square.max(0.0) / norm).sqrt();
            let of_square = scatter.sqrt() / norm;
            // Where the error drowns in the noise it is at most about the root of that.
            let standard_error = if of_square > 0.0 {
                of_square / (2.0 * error.max(of_square.sqrt() / 2.0))
            } else {
                0.0
            };
            LightError {
                error,
                standard_error,
            }
        };
        Errors((0..lights).map(error_of).collect())
    }

    /// Relative L1 error of every light, with most of the truth's noise left out:
    /// `sum_j A_j sqrt(max((E_jm - T_jm)^2 - s_jm^2, 0)) / sum_j A_j T_jm`, summed over the channels.
    /// Beside it the noise, `sum_j A_j s_jm / sum_j A_j T_jm`: an error that is no larger is not seen.
    #[must_use]
    pub fn relative_l1(&self, found: impl Fn(usize, usize) -> [f32; 3]) -> Vec<[f64; 2]> {
        let lights = self.values.first().map_or(0, Vec::len);
        let error_of = |light: usize| {
            let (mut sum, mut noises, mut norm) = (0.0, 0.0, 0.0);
            for (place, (area, truth)) in self.areas.iter().zip(&self.values).enumerate() {
                for (channel, found) in found(place, light).into_iter().enumerate() {
                    let exact = truth[light].irradiance[channel];
                    let noise = truth[light].error[channel];
                    let square = (f64::from(found) - exact).powi(2) - noise.powi(2);
                    sum += area * square.max(0.0).sqrt();
                    noises += area * noise;
                    norm += area * exact;
                }
            }
            [sum, noises].map(|sum| sum / norm.max(f64::MIN_POSITIVE))
        };
        (0..lights).map(error_of).collect()
    }
}

/// The dense solution in which the patches of the mesh shoot.
///
/// # Errors
/// A scene or a system that is not fit to be solved.
pub fn dense_patch(meshed: &Meshed) -> Result<Truth, TruthError> {
    dense(meshed, meshed.mesh())
}

/// The dense solution in which every element shoots.
///
/// # Errors
/// A scene or a system that is not fit to be solved.
pub fn dense_element(meshed: &Meshed) -> Result<Truth, TruthError> {
    dense(meshed, &with_element_patches(meshed.mesh()))
}

/// Why there is no dense solution.
#[derive(Clone, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TruthError {
    /// A tag is out of range.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The system has no solution.
    #[error(transparent)]
    Dense(#[from] DenseError),
}

/// The same mesh with one patch for every element, after those that have no elements.
fn with_element_patches(mesh: &OwnedMesh) -> OwnedMesh {
    let mut fine = mesh.clone();
    let is_bare = |patch: &Patch| mesh.faces[patch.face as usize].element_count == 0;
    fine.patches.retain(is_bare);
    for (element, old) in fine.elements.iter_mut().zip(&mesh.elements) {
        element.patch = fine.patches.len() as u32;
        fine.patches.push(Patch {
            face: mesh.patches[old.patch as usize].face,
            from: old.from,
            to: old.to,
            area: old.area,
        });
    }
    fine
}

fn dense(meshed: &Meshed, mesh: &OwnedMesh) -> Result<Truth, TruthError> {
    let scene = meshed.view()?;
    let view = mesh.view();
    let filler = Parallel::new(&view, meshed.bvh());
    let (n, p) = (mesh.elements.len(), mesh.patches.len());
    let mut form_factors = vec![0.0_f32; n * p];
    for (row, patch) in form_factors.chunks_mut(n).zip(0..) {
        filler.patch(&view, patch, row);
    }

    let lights = scene.lights() as usize;
    let mut direct = vec![vec![[0.0; 3]; n]; lights];
    let mut row = vec![0.0; n];
    for luminaire in scene.luminaires() {
        filler.luminaire(&view, luminaire, luminaire::far(&scene), &mut row);
        let share = luminaire.share().to_array().map(f64::from);
        let light = &mut direct[luminaire.light() as usize];
        for (sum, value) in light.iter_mut().zip(&row) {
            for (sum, share) in sum.iter_mut().zip(share) {
                *sum += share * f64::from(*value);
            }
        }
    }
    let exitance = |light: usize| -> Vec<[f64; 3]> {
        let of_patch = |patch: u32| {
            let emission = view.patch_emission(patch);
            let emission = emission.filter(|e| e.light as usize == light);
            emission.map_or([0.0; 3], |e| e.share.to_array().map(f64::from))
        };
        (0..p as u32).map(of_patch).collect()
    };
    let exitance: Vec<Vec<[f64; 3]>> = (0..lights).map(exitance).collect();
    let sources = exitance.iter().zip(&direct);
    let sources: Vec<DenseLight> = sources
        .map(|(exitance, direct)| DenseLight { exitance, direct })
        .collect();

    let areas: Vec<f64> = mesh.elements.iter().map(|e| e.area.into()).collect();
    let patch_areas: Vec<f64> = mesh.patches.iter().map(|p| p.area.into()).collect();
    let reflectance = |e: &relume::mesh::Element| e.reflectance.to_array().map(f64::from);
    let reflectances: Vec<[f64; 3]> = mesh.elements.iter().map(reflectance).collect();
    let patch_of: Vec<u32> = mesh.elements.iter().map(|e| e.patch).collect();
    let system = DenseSystem {
        form_factors: &form_factors,
        patch_areas: &patch_areas,
        element_areas: &areas,
        reflectances: &reflectances,
        patch_of: &patch_of,
        lights: &sources,
    };
    let exact = |irradiance: &[f64; 3]| Value {
        irradiance: *irradiance,
        error: [0.0; 3],
    };
    let irradiance = system.solve()?.irradiance;
    let values = irradiance.iter().map(|e| e.iter().map(exact).collect());
    Ok(Truth {
        values: values.collect(),
        areas,
    })
}

/// What so many paths find at each receiver, which stands for an area, m2.
///
/// # Errors
/// A scene that is not fit to be traced.
pub fn traced(
    scene: &OwnedScene,
    receivers: &[(Receiver, f64)],
    paths: u32,
    seed: u64,
) -> Result<Truth, TruthError> {
    let (receivers, areas): (Vec<Receiver>, Vec<f64>) = receivers.iter().cloned().unzip();
    let estimates = PathTracer::new(scene)?.estimate(&receivers, paths, seed);
    let values = estimates.iter().map(|by_light| {
        let values = by_light.iter().map(|estimate| Value {
            irradiance: estimate.irradiance,
            error: estimate.error,
        });
        values.collect()
    });
    Ok(Truth {
        values: values.collect(),
        areas,
    })
}

/// The elements of a mesh as receivers: the mean over each.
#[must_use]
pub fn element_receivers(mesh: &Mesh) -> Vec<(Receiver, f64)> {
    let receivers = mesh.elements.iter().filter_map(|element| {
        let outline = mesh.element_polygon(element)?;
        let corners: Vec<DVec3> = outline.vertices().iter().map(|v| v.as_dvec3()).collect();
        Some((Receiver::polygon(&corners)?, element.area.into()))
    });
    receivers.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builtin::{PaperLamps, paper_room, white_furnace};
    use crate::study::meshed;

    #[test]
    fn in_a_furnace_all_truths_are_one() {
        // M / (1 - rho) with M = 1.
        let furnace = white_furnace(0.5, 1.0).unwrap();
        let meshed = meshed(&furnace, 1.0, 0.5);
        let receivers = element_receivers(&meshed.mesh().view());
        let truths = [
            dense_patch(&meshed).unwrap(),
            dense_element(&meshed).unwrap(),
            traced(&furnace.scene, &receivers, 4000, 5).unwrap(),
        ];
        for truth in truths {
            let errors = truth.errors(|_, _| [2.0; 3]);
            assert_eq!(errors.worst().error, errors.median());
            let LightError {
                error,
                standard_error,
            } = errors.worst();
            assert!(error < 2e-3 + 2.0 * standard_error, "{errors:?}");
        }
    }

    /// Paths that are few judge as many do, within what they say they leave uncertain.
    #[test]
    fn the_noise_of_the_truth_is_no_error() {
        let room = paper_room(PaperLamps::One).unwrap();
        let meshed = meshed(&room, 1.0, 0.5);
        let receivers = element_receivers(&meshed.mesh().view());
        let dense = dense_element(&meshed).unwrap();
        // Everything a tenth too bright.
        let found = |place: usize, light: usize| {
            let value: Value = dense.values[place][light];
            value.irradiance.map(|v| 1.1 * v as f32)
        };
        let judge = |paths, seed| {
            let truth = traced(&room.scene, &receivers, paths, seed).unwrap();
            truth.errors(found).worst()
        };
        let many = judge(8000, 1);
        for seed in 2..6 {
            let few = judge(200, seed);
            let apart = (few.error - many.error).abs();
            let sure = few.standard_error.hypot(many.standard_error);
            assert!(apart < 3.0 * sure, "{few:?} {many:?}");
            assert!(sure < 0.03, "{few:?}");
        }
    }

    #[test]
    fn undivided_patches_shoot_an_average() {
        let room = paper_room(PaperLamps::One).unwrap();
        let meshed = meshed(&room, 1.0, 0.5);
        let patch = dense_patch(&meshed).unwrap();
        let element = dense_element(&meshed).unwrap();
        let found = |place: usize, light: usize| {
            let value: Value = patch.values[place][light];
            value.irradiance.map(|v| v as f32)
        };
        let off = element.errors(found).worst().error;
        assert!(off > 0.003 && off < 0.1, "{off}");
        assert_eq!(element.errors(found).worst().standard_error, 0.0);
    }
}
