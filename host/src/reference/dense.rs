//! The dense solution of given form factors: every patch shoots, all at once, in f64.
//!
//! Per channel and light, with patches `p, q` and elements `e`:
//!
//! ```text
//! E_e = D_e + sum_q F_eq B_q
//! B_p = M_p + (1 / A_p) sum_(e in p) A_e rho_e E_e
//! ```
//!
//! | symbol | meaning | unit |
//! | --- | --- | --- |
//! | `E_e` | irradiance of element e | W/m2 |
//! | `D_e` | irradiance that point, spot, sun and sky lights cause directly | W/m2 |
//! | `F_eq` | form factor from element e to patch q: the share of e's view that q fills | 1 |
//! | `B_p`, `M_p` | radiosity and exitance of patch p | W/m2 |
//! | `A`, `rho` | area, reflectance | m2, 1 |
//!
//! With `E_e` put into the second line it is a square system for the `B_p`, solved by one LU
//! factorisation per channel with all lights as right-hand sides. This is `dense_patch`; with one
//! patch per element it is `dense_element`, which sees the error of substructuring as well.
//!
//! # References
//! * C. M. Goral, K. E. Torrance, D. P. Greenberg, B. Battaile, *Modeling the interaction of light
//!   between diffuse surfaces*, SIGGRAPH 1984, eq. 5: the system.
//! * M. F. Cohen, D. P. Greenberg, D. S. Immel, P. J. Brock, *An efficient radiosity approach for
//!   realistic image synthesis*, IEEE CG&A 6(3), 1986: elements inside patches.

use nalgebra::DMatrix;
use rayon::prelude::*;

/// What one light puts into the scene at unit emission.
#[derive(Clone, Copy, Debug)]
pub struct DenseLight<'a> {
    /// `M_p`, RGB exitance of every patch, W/m2.
    pub exitance: &'a [[f64; 3]],
    /// `D_e`, RGB irradiance of every element by luminaires without a surface, W/m2.
    pub direct: &'a [[f64; 3]],
}

/// A patch system with everything given; `F` is the float type of its form factors.
///
/// A patch without elements reflects nothing: a lamp, or the black patch that stands for the way
/// out of an open scene.
#[derive(Clone, Copy, Debug)]
pub struct DenseSystem<'a, F> {
    /// For every patch the row of form factors from each element to it: `F_ep` stands at
    /// `p * elements + e`.
    pub form_factors: &'a [F],
    /// `A_p`, area of every patch, m2.
    pub patch_areas: &'a [f64],
    /// `A_e`, area of every element, m2.
    pub element_areas: &'a [f64],
    /// `rho_e`, RGB reflectance of every element, in [0, 1).
    pub reflectances: &'a [[f64; 3]],
    /// The patch that each element belongs to.
    pub patch_of: &'a [u32],
    /// The lights.
    pub lights: &'a [DenseLight<'a>],
}

/// The solution of a [`DenseSystem`].
#[derive(Clone, Debug, PartialEq)]
pub struct DenseSolution {
    /// `E_e`, RGB irradiance at unit emission: `irradiance[element][light]`, W/m2.
    pub irradiance: Vec<Vec<[f64; 3]>>,
    /// The part of it that came without a bounce, `D_e + sum_q F_eq M_q`, in the same order.
    pub direct: Vec<Vec<[f64; 3]>>,
    /// `B_p`, RGB radiosity: `radiosity[patch][light]`, W/m2.
    pub radiosity: Vec<Vec<[f64; 3]>>,
    /// What the solve left over: the largest entry of `|b - A x|` beside the largest of `|b|`,
    /// worst channel.
    pub residual: f64,
}

/// Why a system has no solution.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum DenseError {
    /// A slice does not have one entry per patch, per element, or per pair of them.
    #[error("{what}: {found} entries where {expected} belong")]
    Length {
        /// Name of the slice.
        what: &'static str,
        /// How many it should hold.
        expected: usize,
        /// How many it holds.
        found: usize,
    },
    /// An element belongs to a patch that is not there.
    #[error("element {element} belongs to patch {patch}, which does not exist")]
    Patch {
        /// Number of the element.
        element: usize,
        /// Number of its patch.
        patch: u32,
    },
    /// The matrix is singular or not finite: reflectances or form factors are no physical ones.
    #[error("the patch system of channel {channel} is singular")]
    Singular {
        /// 0 red, 1 green, 2 blue.
        channel: usize,
    },
}

/// Patch radiosity and element irradiance of one channel; a column per light.
struct Channel {
    radiosity: DMatrix<f64>,
    irradiance: DMatrix<f64>,
    direct: DMatrix<f64>,
    residual: f64,
}

impl<F: Copy + Into<f64> + Sync> DenseSystem<'_, F> {
    /// Solves for all lights.
    ///
    /// # Errors
    /// [`DenseError`]: slices that do not fit together, or a singular system.
    pub fn solve(&self) -> Result<DenseSolution, DenseError> {
        self.check()?;
        let (patches, elements) = (self.patch_areas.len(), self.element_areas.len());
        let view = DMatrix::from_fn(elements, patches, |e, q| {
            self.form_factors[q * elements + e].into()
        });
        let channels: Vec<Channel> = (0..3)
            .into_par_iter()
            .map(|channel| self.solve_channel(&view, channel))
            .collect::<Result<_, _>>()?;

        let lights = self.lights.len();
        let triples = |rows: usize, matrix: fn(&Channel) -> &DMatrix<f64>| {
            let rgb = |row, light| [0, 1, 2].map(|c: usize| matrix(&channels[c])[(row, light)]);
            (0..rows)
                .map(|row| (0..lights).map(|light| rgb(row, light)).collect())
                .collect()
        };
        Ok(DenseSolution {
            irradiance: triples(elements, |c| &c.irradiance),
            direct: triples(elements, |c| &c.direct),
            radiosity: triples(patches, |c| &c.radiosity),
            residual: channels.iter().map(|c| c.residual).fold(0.0, f64::max),
        })
    }

    /// One LU factorisation; `view` holds `F_eq` at `(e, q)`.
    fn solve_channel(&self, view: &DMatrix<f64>, channel: usize) -> Result<Channel, DenseError> {
        let (elements, patches) = view.shape();
        let lights = self.lights.len();
        let exitance =
            DMatrix::from_fn(patches, lights, |p, m| self.lights[m].exitance[p][channel]);
        let luminaires =
            DMatrix::from_fn(elements, lights, |e, m| self.lights[m].direct[e][channel]);

        // What patch p reflects of a field on the elements, as radiosity: (1/A_p) sum A_e rho_e x_e.
        let reflected = |field: &DMatrix<f64>| {
            let mut radiosity = DMatrix::zeros(patches, field.ncols());
            for e in 0..elements {
                let p = self.patch_of[e] as usize;
                let weight =
                    self.element_areas[e] * self.reflectances[e][channel] / self.patch_areas[p];
                for column in 0..field.ncols() {
                    radiosity[(p, column)] += weight * field[(e, column)];
                }
            }
            radiosity
        };
        let system = DMatrix::identity(patches, patches) - reflected(view);
        let emitted = &exitance + reflected(&luminaires);

        let singular = DenseError::Singular { channel };
        let radiosity = system.clone().lu().solve(&emitted).ok_or(singular)?;
        if !radiosity.iter().all(|b| b.is_finite()) {
            return Err(singular);
        }
        let left_over = (&emitted - system * &radiosity).amax();
        Ok(Channel {
            irradiance: &luminaires + view * &radiosity,
            direct: luminaires + view * exitance,
            radiosity,
            residual: left_over / emitted.amax().max(f64::MIN_POSITIVE),
        })
    }

    fn check(&self) -> Result<(), DenseError> {
        let (patches, elements) = (self.patch_areas.len(), self.element_areas.len());
        let same = |what, expected, found| {
            if expected == found {
                Ok(())
            } else {
                Err(DenseError::Length {
                    what,
                    expected,
                    found,
                })
            }
        };
        same("form factors", patches * elements, self.form_factors.len())?;
        same("reflectances", elements, self.reflectances.len())?;
        same("patches of elements", elements, self.patch_of.len())?;
        for light in self.lights {
            same("exitances of a light", patches, light.exitance.len())?;
            same(
                "direct irradiances of a light",
                elements,
                light.direct.len(),
            )?;
        }
        let stray = |(_, patch): &(usize, u32)| *patch as usize >= patches;
        match self.patch_of.iter().copied().enumerate().find(stray) {
            Some((element, patch)) => Err(DenseError::Patch { element, patch }),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::closed_form::{furnace, parallel_rectangles, perpendicular_rectangles};

    const GREY: [f64; 3] = [0.2, 0.5, 0.98];

    /// Form factors between the walls of a unit cube; walls 2k and 2k + 1 are opposite.
    fn cube() -> Vec<f64> {
        let opposite = parallel_rectangles(1.0, 1.0, 1.0);
        let adjacent = perpendicular_rectangles(1.0, 1.0, 1.0);
        let factor = |p: u32, e: u32| match (p == e, p / 2 == e / 2) {
            (true, _) => 0.0,
            (false, true) => opposite,
            (false, false) => adjacent,
        };
        (0..6)
            .flat_map(|p| (0..6).map(move |e| factor(p, e)))
            .collect()
    }

    #[test]
    fn a_cube_of_lamps_is_a_furnace() {
        let lights = [DenseLight {
            exitance: &[[1.0; 3]; 6],
            direct: &[[0.0; 3]; 6],
        }];
        let solution = DenseSystem {
            form_factors: &cube(),
            patch_areas: &[1.0; 6],
            element_areas: &[1.0; 6],
            reflectances: &[GREY; 6],
            patch_of: &[0, 1, 2, 3, 4, 5],
            lights: &lights,
        }
        .solve()
        .unwrap();
        assert!(solution.residual < 1e-13, "{}", solution.residual);
        for (e, by_light) in solution.irradiance.iter().enumerate() {
            for (c, rho) in GREY.into_iter().enumerate() {
                let (found, expected) = (by_light[0][c], furnace(1.0, rho));
                assert!(
                    (found / expected - 1.0).abs() < 1e-12,
                    "{e} {c}: {found} {expected}"
                );
                assert!((solution.direct[e][0][c] - 1.0).abs() < 1e-14);
            }
        }
    }

    /// Two facing plates; the second one has two unequal elements, and a black lamp without
    /// elements lights the first. The form factors are simple numbers, not a real geometry.
    #[test]
    fn two_plates_follow_the_solution_by_hand() {
        let (rho, rhos) = (0.5, [0.8, 0.2]);
        let mean = (1.0 * rhos[0] + 3.0 * rhos[1]) / 4.0;
        #[rustfmt::skip]
        let form_factors = [
            0.0f32, 1.0, 1.0,
            0.75, 0.0, 0.0,
            0.25, 0.0, 0.0,
        ];
        let lights = [
            DenseLight {
                exitance: &[[0.0; 3], [0.0; 3], [4.0; 3]],
                direct: &[[0.0; 3]; 3],
            },
            DenseLight {
                exitance: &[[0.0; 3]; 3],
                direct: &[[0.0; 3], [0.0; 3], [1.0; 3]],
            },
        ];
        let solution = DenseSystem {
            form_factors: &form_factors,
            patch_areas: &[3.0, 4.0, 1.0],
            element_areas: &[3.0, 1.0, 3.0],
            reflectances: &[[rho; 3], [rhos[0]; 3], [rhos[1]; 3]],
            patch_of: &[0, 1, 1],
            lights: &lights,
        }
        .solve()
        .unwrap();

        // Lamp: E_0 = 1 + 3/4 mean rho E_0. Spot on element 2: B_1 = 3/4 rhos[1] + mean rho 3/4 B_1.
        let gain = 1.0 / (1.0 - 0.75 * mean * rho);
        let spot = 0.75 * (0.75 * rhos[1]) * gain;
        let expected = [
            [gain, spot],
            [rho * gain, rho * spot],
            [rho * gain, rho * spot + 1.0],
        ];
        for (found, expected) in solution.irradiance.iter().zip(expected) {
            for (found, expected) in found.iter().zip(expected) {
                assert!((found[1] - expected).abs() < 1e-14, "{found:?} {expected}");
            }
        }
        assert_eq!(solution.direct[0][0], [1.0; 3]);
        assert_eq!(solution.direct[2], [[0.0; 3], [1.0; 3]]);
        assert_eq!(solution.radiosity[2], [[4.0; 3], [0.0; 3]]);
    }

    #[test]
    fn slices_that_do_not_fit_are_named() {
        let lights = [DenseLight {
            exitance: &[[1.0; 3]; 6],
            direct: &[[0.0; 3]; 6],
        }];
        let form_factors = cube();
        let good = DenseSystem {
            form_factors: &form_factors,
            patch_areas: &[1.0; 6],
            element_areas: &[1.0; 6],
            reflectances: &[GREY; 6],
            patch_of: &[0, 1, 2, 3, 4, 5],
            lights: &lights,
        };
        let short = DenseSystem {
            reflectances: &[GREY; 5],
            ..good
        };
        assert_eq!(
            short.solve().unwrap_err().to_string(),
            "reflectances: 5 entries where 6 belong"
        );
        let stray = DenseSystem {
            patch_of: &[0, 1, 2, 3, 4, 6],
            ..good
        };
        let error = DenseError::Patch {
            element: 5,
            patch: 6,
        };
        assert_eq!(stray.solve(), Err(error));
        let nan = DenseSystem {
            form_factors: &[f64::NAN; 36],
            ..good
        };
        assert_eq!(nan.solve(), Err(DenseError::Singular { channel: 0 }));
    }
    #[test]
    fn plates_that_lose_nothing_have_no_solution() {
        let lights = [DenseLight {
            exitance: &[[1.0; 3]; 2],
            direct: &[[0.0; 3]; 2],
        }];
        let endless = DenseSystem {
            form_factors: &[0.0, 1.0, 1.0, 0.0],
            patch_areas: &[1.0; 2],
            element_areas: &[1.0; 2],
            reflectances: &[[0.5, 1.0, 0.5]; 2],
            patch_of: &[0, 1],
            lights: &lights,
        };
        assert_eq!(endless.solve(), Err(DenseError::Singular { channel: 1 }));
    }
}
