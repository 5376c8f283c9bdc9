//! Tagged progressive refinement: pick a patch, shoot what it holds, keep every light apart.
//!
//! State: irradiance `E_jm` per element and light, unshot radiosity `dB_pm` per patch and light.
//! A shot of patch `i` (Nielsen and Christensen 2002, Fig. 2, with the area ratio put right):
//!
//! `E_jm += F_ji dB_im` for every element `j` and light `m`,
//! `dB_pm += sum_{j in p} A_j rho_j F_ji dB_im / A_p` for every patch `p`, `dB_im = 0`.
//!
//! The patch with the largest `sum_m w_m dB_im A_i` (summed over the channels) is next; `w_m` is
//! the importance of the light. Residual of a light: `sum_i dB_im A_i` over the power that it
//! emitted (area lights) or brought into the scene (luminaires); of the solution: the largest.
//! Ambient term (Cohen et al. 1988, eq. 12), per light, as an irradiance:
//! `a = g U / (1 - g rho)`, with the unshot power `U` over the whole area, the mean reflectance
//! `rho`, and `g`, the share of what the rows so far sent out that landed on elements (1 if all did).
//!
//! Lights come in blocks of `K` lanes; all blocks share one row. Rows that the caller hands in are
//! kept as long as the row storage has room and are shot again without being evaluated again.

mod error;
mod lanes;
mod measure;
mod storage;

use crate::color::Rgb;
use crate::mesh::Mesh;

pub use error::RefineError;
pub use lanes::Lanes;
pub use storage::{Block, FixedStorage, PatchState, Storage};

use lanes::{add_to_lane, address, distribute, part, sum, weighted};

/// A refinement under way. Its state is usable after every shot.
#[derive(Debug)]
pub struct Refinement<'a, const K: usize> {
    mesh: Mesh<'a>,
    lights: u32,
    residual: f32,
    storage: Storage<'a, K>,
    rows_kept: u32,
    rows_evaluated: u32,
    shots: u64,
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
        storage.fit(&mesh, lights)?;
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
            storage,
            rows_kept: 0,
            rows_evaluated: 0,
            shots: 0,
            area_shot: 0.0,
            area_landed: 0.0,
        };
        refinement.emit();
        Ok(refinement)
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
        self.gather(row);

        let mut delta = [[0.0; K]; 3];
        let (block, lane) = address::<K>(light);
        add_to_lane(&mut delta, lane, share);
        let n = self.mesh.elements.len();
        distribute(part(self.storage.irradiance, block, n), row, &delta);
        distribute(part(self.storage.direct, block, n), row, &delta);
        self.reflect(block, &delta);

        let arrived: f32 = row
            .iter()
            .zip(self.mesh.elements)
            .map(|(value, element)| value * element.area)
            .sum();
        self.add_emitted(light, arrived * sum(share));
        Ok(())
    }

    /// The patch to shoot next whose row is not known; `None` once the residual is reached.
    ///
    /// Patches whose row is known are shot on the way.
    pub fn next_shooter(&mut self) -> Option<u32> {
        loop {
            let patch = self.brightest(|_| true)?;
            if self.residual() <= self.residual {
                return None;
            }
            if !self.shoot_known(patch) {
                return Some(patch);
            }
        }
    }

    /// Shoots known rows until what they still hold is below the residual, or nothing is left.
    ///
    /// After an early stop this gives the best state that the rows seen so far allow.
    pub fn finish(&mut self) {
        let known = |state: &PatchState| state.row != 0;
        while self.residual_of(known) > self.residual {
            match self.brightest(known) {
                Some(patch) if self.shoot_known(patch) => {}
                _ => return,
            }
        }
    }

    /// Shoots all unshot radiosity of a patch along `row`, and keeps the row if there is room.
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
        self.keep(patch, row);
        self.distribute_all(patch, row);
        Ok(())
    }

    /// Shoots a patch from the storage; false when its row is not there.
    fn shoot_known(&mut self, patch: u32) -> bool {
        let n = self.mesh.elements.len();
        let state = self.storage.patches.get(patch as usize);
        let Some(slot) = state.and_then(|s| (s.row as usize).checked_sub(1)) else {
            return false;
        };
        // The row is borrowed apart from the rest of the state and put back afterwards.
        let rows = core::mem::take(&mut self.storage.rows);
        let row = rows.get(slot * n..).and_then(|tail| tail.get(..n));
        let is_known = row.is_some();
        if let Some(row) = row {
            self.distribute_all(patch, row);
        }
        self.storage.rows = rows;
        is_known
    }

    fn distribute_all(&mut self, patch: u32, row: &[f32]) {
        self.gather(row);
        self.shots += 1;
        let (n, count) = (self.mesh.elements.len(), self.mesh.patches.len());
        let first_shot = self.take_first_shot(patch);
        for block in 0..self.storage.blocks.len() {
            let unshot = self.storage.unshot.get_mut(block * count + patch as usize);
            let Some(delta) = unshot.map(|lanes| core::mem::replace(lanes, [[0.0; K]; 3])) else {
                continue;
            };
            if delta.as_flattened().iter().all(|value| *value == 0.0) {
                continue;
            }
            distribute(part(self.storage.irradiance, block, n), row, &delta);
            self.reflect(block, &delta);
        }
        if let Some((block, delta)) = first_shot {
            distribute(part(self.storage.direct, block, n), row, &delta);
        }
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

    /// What share of a row each patch reflects, into the patch states.
    fn gather(&mut self, row: &[f32]) {
        let patches = &mut *self.storage.patches;
        patches
            .iter_mut()
            .for_each(|state| state.gathered = Rgb::BLACK);
        for (factor, element) in row.iter().zip(self.mesh.elements) {
            if let Some(state) = patches.get_mut(element.patch as usize) {
                state.gathered += element.reflectance * (factor * element.area);
            }
        }
        for (state, patch) in patches.iter_mut().zip(self.mesh.patches) {
            state.gathered = state.gathered * patch.area.recip();
        }
    }

    /// Adds what the gathered shares of `delta` reflect to the unshot radiosity of a block.
    fn reflect(&mut self, block: usize, delta: &Lanes<K>) {
        let unshot = part(self.storage.unshot, block, self.mesh.patches.len());
        for (lanes, state) in unshot.iter_mut().zip(self.storage.patches.iter()) {
            let shares = state.gathered.to_array();
            for ((channel, share), shot) in lanes.iter_mut().zip(shares).zip(delta) {
                for (value, shot) in channel.iter_mut().zip(shot) {
                    *value += share * shot;
                }
            }
        }
    }

    fn keep(&mut self, patch: u32, row: &[f32]) {
        let n = self.mesh.elements.len();
        let start = self.rows_kept as usize * n;
        let room = self.storage.rows.get_mut(start..);
        let (Some(room), Some(row)) = (room.and_then(|r| r.get_mut(..n)), row.get(..n)) else {
            return;
        };
        let Some(state) = self.storage.patches.get_mut(patch as usize) else {
            return;
        };
        if state.row == 0 && n > 0 {
            for (kept, factor) in room.iter_mut().zip(row) {
                *kept = *factor;
            }
            self.rows_kept += 1;
            state.row = self.rows_kept;
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

    /// The patch with the largest weighted unshot power among those that `admit` lets pass;
    /// `None` when none has any.
    fn brightest(&self, admit: impl Fn(&PatchState) -> bool) -> Option<u32> {
        let count = self.mesh.patches.len();
        let mut best = (0.0, None);
        let patches = self.mesh.patches.iter().zip(self.storage.patches.iter());
        for ((patch, state), id) in patches.zip(0..) {
            if !admit(state) {
                continue;
            }
            let mut power = 0.0;
            for (block, index) in self.storage.blocks.iter().zip(0..) {
                if let Some(lanes) = self.storage.unshot.get(index * count + id as usize) {
                    power += weighted(lanes, &block.importance);
                }
            }
            if power * patch.area > best.0 {
                best = (power * patch.area, Some(id));
            }
        }
        best.1
    }
}

#[cfg(test)]
mod tests;
