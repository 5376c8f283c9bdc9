//! Tagged progressive refinement: pick a patch, shoot what it holds, keep every light apart.
//!
//! State: irradiance `E_jm` per element and light, unshot radiosity `dB_pm` per patch and light.
//! A shot of patch `i` (Nielsen and Christensen 2002, Fig. 2, with the area ratio put right):
//!
//! `E_jm += F_ji dB_im` for every element `j` and light `m`,
//! `dB_pm += sum_{j in p} A_j rho_j F_ji dB_im / A_p` for every patch `p`, `dB_im = 0`.
//!
//! A row that the storage keeps is never asked for again: what its patch has to send later is found by solving the
//! system of all known patches, and reaches the elements in one pass ([`Refinement::finish`]).
//! Rows for which there is no room are shot at once and asked for again. Who ends before all rows are known can have the
//! missing ones estimated ([`Refinement::close`]).
//!
//! Next is the patch with the largest `sum_m w_m (dB_im A_i / P_m)^2` (summed over the channels), so that a dim light
//! converges as well as a bright one, or, as published, the largest `sum_m w_m dB_im A_i`; `w_m`
//! is the importance of the light and `P_m` the power that it emitted (area lights) or brought into the scene
//! (luminaires). Residual of a light: `sum_i dB_im A_i / P_m`; of the solution: the largest.
//! Ambient term (Cohen et al. 1988, eq. 12), per light, as an irradiance:
//! `a = g U / (1 - g rho)`, with the unshot power `U` over the whole area, the mean reflectance
//! `rho`, and `g`, the share of what the rows so far sent out that landed on elements (1 if all did, or none was sent).
//!
//! Lights come in blocks of `K` lanes; all blocks share one row.

mod close;
mod error;
mod known;
pub mod krylov;
mod lanes;
mod measure;
mod storage;

use crate::color::Rgb;
use crate::mesh::Mesh;

pub use error::RefineError;
pub use lanes::Lanes;
pub use storage::{Block, FixedStorage, PatchState, RowStorage, Storage};

use lanes::{add_scaled, add_to_lane, add_weighted, address, distribute, part, sum};

/// Which patch is next.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Choice {
    /// The largest sum over lights of the squared share of a light's power that is unshot.
    #[default]
    Relative,
    /// The largest sum over lights of unshot power, as published.
    Power,
}

/// A refinement under way. Its state is usable after every shot, by [`Self::finish`].
#[derive(Debug)]
pub struct Refinement<'a, const K: usize> {
    mesh: Mesh<'a>,
    lights: u32,
    residual: f32,
    choice: Choice,
    storage: Storage<'a, K>,
    /// Rows that fit into the storage.
    capacity: usize,
    rows_kept: u32,
    rows_evaluated: u32,
    /// Area shot so far, once per row, and how much of it landed on elements.
    area_shot: f64,
    area_landed: f64,
}

impl<'a, const K: usize> Refinement<'a, K> {
    /// Starts with every emitting patch full and everything else dark.
    ///
    /// `residual` is the goal: [`Self::next_shooter`] ends below it. Luminaires follow by
    /// [`Self::illuminate`], importances by [`Self::set_importance`].
    ///
    /// # Errors
    /// Storage that is too small, by the name of its limit; a residual that is not positive; a face
    /// that emits under a tag that does not exist.
    pub fn new(
        mesh: Mesh<'a>,
        lights: u32,
        residual: f32,
        mut storage: Storage<'a, K>,
    ) -> Result<Self, RefineError> {
        const { assert!(K > 0, "a block holds at least one light") }
        if residual.is_nan() || residual <= 0.0 {
            return Err(RefineError::Residual);
        }
        let capacity = storage.fit(&mesh, lights)?;
        let mut emissions = mesh.faces.iter().filter_map(|face| face.emission);
        if emissions.any(|emission| emission.light >= lights) {
            return Err(RefineError::Unknown);
        }
        storage.irradiance.fill([[0.0; K]; 3]);
        storage.direct.fill([[0.0; K]; 3]);
        storage.unshot.fill([[0.0; K]; 3]);
        storage.patches.fill(PatchState::EMPTY);
        storage.blocks.fill(Block::EMPTY);

        let mut refinement = Self {
            mesh,
            lights,
            residual,
            choice: Choice::Relative,
            storage,
            capacity,
            rows_kept: 0,
            rows_evaluated: 0,
            area_shot: 0.0,
            area_landed: 0.0,
        };
        refinement.emit();
        refinement.start_sources();
        Ok(refinement)
    }

    /// Sets how the next shooter is chosen.
    pub const fn set_choice(&mut self, choice: Choice) {
        self.choice = choice;
    }

    /// Fills emitting patches with the exitance of their light.
    fn emit(&mut self) {
        for (patch, id) in self.mesh.patches.iter().zip(0..) {
            let Some(emission) = self.mesh.patch_emission(id) else {
                continue;
            };
            let (block, lane) = address::<K>(emission.light);
            let count = self.mesh.patches.len();
            if let Some(lanes) = self.storage.unshot.get_mut(block * count + id as usize) {
                add_to_lane(lanes, lane, emission.share);
            }
            let power = sum(emission.share) * patch.area;
            self.add_emitted(emission.light, power);
        }
    }

    fn add_emitted(&mut self, light: u32, power: f32) {
        let (block, lane) = address::<K>(light);
        let block = self.storage.blocks.get_mut(block);
        if let Some(emitted) = block.and_then(|b| b.emitted.get_mut(lane)) {
            *emitted += power;
        }
    }

    /// Sets the weight of a light in the choice of the next shooter; 1 by default.
    ///
    /// # Errors
    /// A weight that is not positive and finite, or a light that does not exist.
    pub fn set_importance(&mut self, light: u32, importance: f32) -> Result<(), RefineError> {
        if !(importance > 0.0 && importance.is_finite()) {
            return Err(RefineError::Importance { light });
        }
        if light >= self.lights {
            return Err(RefineError::Unknown);
        }
        let (block, lane) = address::<K>(light);
        let block = self.storage.blocks.get_mut(block);
        let weight = block.and_then(|b| b.importance.get_mut(lane));
        *weight.ok_or(RefineError::Unknown)? = importance;
        Ok(())
    }

    /// Adds the direct light of a luminaire: `row[j]` is its irradiance at unit emission.
    ///
    /// # Errors
    /// [`RefineError::Unknown`] for a light that does not exist, [`RefineError::Row`] for a row
    /// that is too short or not finite.
    pub fn illuminate(&mut self, light: u32, share: Rgb, row: &[f32]) -> Result<(), RefineError> {
        if light >= self.lights {
            return Err(RefineError::Unknown);
        }
        self.check(row, f32::MAX)?;
        reflected_shares(&self.mesh, self.storage.patches, row);

        let mut delta = [[0.0; K]; 3];
        let (block, lane) = address::<K>(light);
        add_to_lane(&mut delta, lane, share);
        let n = self.mesh.elements.len();
        distribute(part(self.storage.irradiance, block, n), row, &delta);
        distribute(part(self.storage.direct, block, n), row, &delta);
        self.reflect(block, &delta, Source::Outside);

        let arrived: f32 = row
            .iter()
            .zip(self.mesh.elements)
            .map(|(value, element)| value * element.area)
            .sum();
        self.add_emitted(light, arrived * sum(share));
        Ok(())
    }

    /// The patch to shoot next whose row is not known; `None` once the residual is reached.
    pub fn next_shooter(&mut self) -> Option<u32> {
        let is_known = |state: &PatchState| state.row != 0;
        let is_unknown = |state: &PatchState| state.row == 0;
        if self.rows_kept > 0
            && (self.is_done(is_unknown) || self.merit(is_known) > self.merit(is_unknown))
        {
            self.settle();
        }
        // What known patches hold is solved for in the end.
        if self.is_done(is_unknown) {
            return None;
        }
        self.best(is_unknown)
    }

    /// Shoots all unshot radiosity of a patch along `row`, or keeps the row if there is room.
    ///
    /// What goes along kept rows reaches the elements by [`Self::finish`].
    ///
    /// # Errors
    /// [`RefineError::Unknown`] for a patch that does not exist, [`RefineError::Row`] for a row
    /// that is too short or has a factor outside [0, 1].
    pub fn shoot(&mut self, patch: u32, row: &[f32]) -> Result<(), RefineError> {
        if patch as usize >= self.mesh.patches.len() {
            return Err(RefineError::Unknown);
        }
        self.check(row, 1.0)?;
        self.rows_evaluated += 1;
        self.note_landing(patch, row);
        reflected_shares(&self.mesh, self.storage.patches, row);
        if let Some((block, delta)) = self.take_first_shot(patch) {
            let n = self.mesh.elements.len();
            distribute(part(self.storage.direct, block, n), row, &delta);
        }
        let is_kept = self.keep(patch, row);
        for block in 0..self.storage.blocks.len() {
            let delta = self.take_unshot(patch, block, is_kept);
            if delta.as_flattened().iter().all(|value| *value == 0.0) {
                continue;
            }
            if is_kept {
                self.reflect(block, &delta, Source::Known);
            } else {
                let n = self.mesh.elements.len();
                distribute(part(self.storage.irradiance, block, n), row, &delta);
                self.reflect(block, &delta, Source::Outside);
            }
        }
        Ok(())
    }

    /// What a patch has to shoot; it is noted as sent for a known patch, else as taken from its source.
    fn take_unshot(&mut self, patch: u32, block: usize, is_kept: bool) -> Lanes<K> {
        let index = block * self.mesh.patches.len() + patch as usize;
        let unshot = self.storage.unshot.get_mut(index);
        let delta = unshot.map_or([[0.0; K]; 3], |lanes| {
            core::mem::replace(lanes, [[0.0; K]; 3])
        });
        let rows = &mut self.storage.rows;
        let (books, sign) = if is_kept {
            (rows.sent.get_mut(index), 1.0)
        } else {
            (rows.sources.get_mut(index), -1.0)
        };
        if let Some(lanes) = books {
            add_scaled(lanes, &delta, Rgb::splat(sign));
        }
        delta
    }

    /// The emission of a patch that has not been shot yet, with its block.
    fn take_first_shot(&mut self, patch: u32) -> Option<(usize, Lanes<K>)> {
        let emission = self.mesh.patch_emission(patch)?;
        let state = self.storage.patches.get_mut(patch as usize)?;
        if core::mem::replace(&mut state.has_emitted, true) {
            return None;
        }
        let (block, lane) = address::<K>(emission.light);
        let mut delta = [[0.0; K]; 3];
        add_to_lane(&mut delta, lane, emission.share);
        Some((block, delta))
    }

    /// Adds what the gathered shares of `delta` reflect to the unshot radiosity of a block, and to
    /// the sources of the known patches if it comes from outside their system.
    fn reflect(&mut self, block: usize, delta: &Lanes<K>, source: Source) {
        let count = self.mesh.patches.len();
        let unshot = part(self.storage.unshot, block, count);
        for (lanes, state) in unshot.iter_mut().zip(self.storage.patches.iter()) {
            // Lamps and what the row does not reach reflect nothing.
            if state.gathered != Rgb::BLACK {
                add_scaled(lanes, delta, state.gathered);
            }
        }
        if source == Source::Outside {
            let sources = part(self.storage.rows.sources, block, count);
            for (lanes, state) in sources.iter_mut().zip(self.storage.patches.iter()) {
                add_scaled(lanes, delta, state.gathered);
            }
        }
    }

    fn note_landing(&mut self, patch: u32, row: &[f32]) {
        let Some(patch) = self.mesh.patches.get(patch as usize) else {
            return;
        };
        self.area_shot += f64::from(patch.area);
        self.area_landed += row
            .iter()
            .zip(self.mesh.elements)
            .map(|(factor, element)| f64::from(factor * element.area))
            .sum::<f64>();
    }

    fn check(&self, row: &[f32], largest: f32) -> Result<(), RefineError> {
        let n = self.mesh.elements.len();
        let illegal = row.iter().position(|f| !(0.0..=largest).contains(f));
        match illegal {
            Some(element) => Err(RefineError::Row { element }),
            None if row.len() != n => Err(RefineError::Row {
                element: row.len().min(n),
            }),
            None => Ok(()),
        }
    }

    /// How much a patch has to shoot, by the rule of the choice.
    fn patch_merit(&self, patch: u32, area: f32) -> f32 {
        let count = self.mesh.patches.len();
        // Lane by lane over all blocks, so that no addition waits for the one before it.
        let mut merits = [0.0; K];
        for (block, index) in self.storage.blocks.iter().zip(0..) {
            let Some(lanes) = self.storage.unshot.get(index * count + patch as usize) else {
                continue;
            };
            match self.choice {
                Choice::Power => {
                    add_weighted(&mut merits, lanes, &block.importance, |power| power * area);
                }
                Choice::Relative => {
                    let shares = block.importance_by_power();
                    let square = |power: f32| power * area * power * area;
                    add_weighted(&mut merits, lanes, &shares, square);
                }
            }
        }
        merits.iter().sum()
    }

    /// The sum of merits of all patches that `admit` lets pass.
    fn merit(&self, admit: impl Fn(&PatchState) -> bool) -> f32 {
        let patches = self.mesh.patches.iter().zip(self.storage.patches.iter());
        patches
            .zip(0..)
            .filter(|((_, state), _)| admit(state))
            .map(|((patch, _), id)| self.patch_merit(id, patch.area))
            .sum()
    }

    /// The patch with the largest merit among those that `admit` lets pass; `None` when none has any.
    fn best(&self, admit: impl Fn(&PatchState) -> bool) -> Option<u32> {
        let mut best = (0.0, None);
        let patches = self.mesh.patches.iter().zip(self.storage.patches.iter());
        for ((patch, state), id) in patches.zip(0..) {
            if admit(state) {
                let merit = self.patch_merit(id, patch.area);
                if merit > best.0 {
                    best = (merit, Some(id));
                }
            }
        }
        best.1
    }
}

/// What share of a row each patch reflects, into the patch states.
fn reflected_shares(mesh: &Mesh, patches: &mut [PatchState], row: &[f32]) {
    for state in &mut *patches {
        state.gathered = Rgb::BLACK;
    }
    for (factor, element) in row.iter().zip(mesh.elements) {
        if let Some(state) = patches.get_mut(element.patch as usize) {
            state.gathered += element.reflectance * (factor * element.area);
        }
    }
    for (state, patch) in patches.iter_mut().zip(mesh.patches) {
        state.gathered = state.gathered * patch.area.recip();
    }
}

/// Where reflected light comes from.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Source {
    /// A patch whose row is kept.
    Known,
    /// A luminaire, or a patch whose row is not kept.
    Outside,
}

#[cfg(test)]
mod tests;
