//! Rows that are missing in the end are estimated: their light is sent where it may go, not left out.
//!
//! An estimated row `K_i` ([`crate::form_factor::estimate`]) is cheaper than an exact one. What the factors of a
//! receiver `j` add up to is known better than any of them. With `S` the known patches and `M` the others,
//!
//! `F_ji = K_ji r_j / (d_j + sum_{i in M} K_ji)`, `r_j = 1 - sum_{i in S} F_ji`,
//!
//! where `d_j` estimates the share of the view of `j` that no patch fills ([`crate::mesh::Mesh::dark_sides`]). So every
//! receiver sum is one where the scene is closed. Where it is not, `r_j` is too much by what escapes: then
//! `d_j = 0` and factors are scaled down only, so that no sum exceeds one and nothing fills a gap that is really open.
//!
//! Closure of receiver sums: R. P. Taylor and R. Luck, *Comparison of reciprocity and closure enforcement methods for
//! radiation view factors*, J. Thermophysics 9(4), 1995. Scaling the columns by reciprocity as well, in turn
//! with the receivers (Sinkhorn), was measured and left out: the worst light was a tenth more exact at best.

use super::known::slot;
use super::lanes::{distribute, part};
use super::{Refinement, reflected_shares};

/// Receivers that are scaled in one pass over the rows.
const CHUNK: usize = 64;

impl<const K: usize> Refinement<'_, K> {
    /// Estimates the rows of all patches that are not known, for [`Self::finish`] to solve with.
    ///
    /// `estimate(patch, row)` fills a row of zeros. `dark` is the share of every element's view that no patch
    /// fills, if the scene is closed (zeros where all that is seen reflects or shines), and `None` if light can
    /// escape. From then on estimated rows count as known: [`Self::next_shooter`] has nothing to ask for, and residuals
    /// and errors are those of the closed system, near zero; what was missing is told by [`Self::light_error`] before.
    ///
    /// False, and no change, when the storage has no room for the rows of all patches.
    ///
    /// ```
    /// # use glam::Vec3;
    /// # use relume::color::Rgb;
    /// # use relume::form_factor::{self, Shooter};
    /// # use relume::mesh::{MeshStorage, Spacing, subdivide};
    /// # use relume::refine::{FixedStorage, Refinement};
    /// # use relume::scene::{Emission, Scene, Surface};
    /// # use relume::visibility::Occluders;
    /// # let corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];
    /// # let floor = corners.map(|(x, y)| Vec3::new(x, y, 0.0));
    /// # let lamp = corners.map(|(x, y)| Vec3::new(y, x, 1.0));
    /// # let emission = Emission { light: 0, share: Rgb::WHITE };
    /// # let surfaces = [
    /// #     Surface::new(0, &floor, Rgb::splat(0.5))?,
    /// #     Surface::new(1, &lamp, Rgb::BLACK)?.emitting(1, emission)?,
    /// # ];
    /// # let scene = Scene::new(&surfaces, &[], 1)?;
    /// # let mut meshed = MeshStorage::<2, 2, 16>::new();
    /// # subdivide(&scene, Spacing { patch: 1.0, element: 0.25 }, |_, _| true, &mut meshed)?;
    /// # let mesh = meshed.mesh();
    /// // The scene of the crate's example, without a single exact row.
    /// let mut memory = FixedStorage::<1, 2, 16, 2>::new();
    /// let mut refinement = Refinement::new(mesh, 1, 1e-3, memory.storage())?;
    /// refinement.close(None, |patch, row| {
    ///     if let Some(polygon) = mesh.patch_polygon(patch) {
    ///         form_factor::estimate(&mesh, &Shooter::new(polygon), 0, &Occluders(&surfaces), row);
    ///     }
    /// });
    /// refinement.finish();
    /// assert!((0.2..0.25).contains(&refinement.irradiance(5, 0).g));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn close(
        &mut self,
        dark: Option<&[f32]>,
        mut estimate: impl FnMut(u32, &mut [f32]),
    ) -> bool {
        let (n, p) = (self.mesh.elements.len(), self.mesh.patches.len());
        if self.capacity < p {
            return false;
        }
        for (state, patch) in self.storage.patches.iter_mut().zip(0..) {
            let start = self.rows_kept as usize * n;
            let row = self.storage.rows.factors.get_mut(start..start + n);
            if let (0, Some(row)) = (state.row, row) {
                row.fill(0.0);
                estimate(patch, row);
                // What is no form factor is no estimate of one.
                for factor in row.iter_mut().filter(|f| !(0.0..=1.0).contains(*f)) {
                    *factor = 0.0;
                }
                self.rows_kept += 1;
                state.row = self.rows_kept;
                state.is_estimated = true;
            }
        }
        self.scale(dark);
        for patch in 0..p as u32 {
            self.share_out(patch);
        }
        true
    }

    /// Scales estimated rows to what known ones leave.
    fn scale(&mut self, dark: Option<&[f32]>) {
        let n = self.mesh.elements.len();
        let (patches, factors) = (&*self.storage.patches, &mut *self.storage.rows.factors);
        for (start, elements) in (0..).step_by(CHUNK).zip(self.mesh.elements.chunks(CHUNK)) {
            let mut left = [1.0_f32; CHUNK];
            let mut estimated = [0.0_f32; CHUNK];
            let dark_here = dark.and_then(|dark| dark.get(start..)).unwrap_or_default();
            for (sum, dark) in estimated.iter_mut().zip(dark_here) {
                *sum += dark.max(0.0);
            }
            let end = |row: usize| row * n + start + elements.len();
            for state in patches {
                let row = slot(state).and_then(|row| factors.get(row * n + start..end(row)));
                let row = row.unwrap_or_default().iter();
                if state.is_estimated {
                    estimated
                        .iter_mut()
                        .zip(row)
                        .for_each(|(sum, factor)| *sum += factor);
                } else {
                    left.iter_mut()
                        .zip(row)
                        .for_each(|(left, factor)| *left -= factor);
                }
            }

            for (left, estimated) in left.iter_mut().zip(&mut estimated) {
                *left = left.max(0.0);
                let fits = dark.is_none() && *estimated <= *left;
                if fits || *estimated <= 0.0 {
                    (*left, *estimated) = (1.0, 1.0);
                }
            }
            for state in patches.iter().filter(|state| state.is_estimated) {
                let row = slot(state).and_then(|row| factors.get_mut(row * n + start..end(row)));
                let row = row.unwrap_or_default().iter_mut();
                for ((factor, left), estimated) in row.zip(left).zip(estimated) {
                    // In this order no step can overflow.
                    *factor = *factor / estimated * left;
                }
            }
        }
    }

    /// Notes what of an estimated row each patch reflects, and the direct light of a lamp that has not been shot.
    fn share_out(&mut self, patch: u32) {
        let n = self.mesh.elements.len();
        let state = self.storage.patches.get(patch as usize);
        let Some(slot) = state.filter(|state| state.is_estimated).and_then(slot) else {
            return;
        };
        let first_shot = self.take_first_shot(patch);
        let row = self.storage.rows.factors.get(slot * n..(slot + 1) * n);
        let row = row.unwrap_or_default();
        reflected_shares(&self.mesh, self.storage.patches, row);
        if let Some((block, delta)) = first_shot {
            distribute(part(self.storage.direct, block, n), row, &delta);
        }
        self.keep_shares(slot);
    }
}
