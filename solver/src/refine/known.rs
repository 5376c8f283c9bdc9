//! The patches whose rows are known: what they send is solved for, then reaches the elements at once.
//!
//! With `S` the known patches, `s_p` the radiosity that patch `p` must send for reasons outside `S`
//! (emission, luminaires, shots of patches whose rows were not kept) and
//! `G_pi = sum_{j in p} A_j rho_j F_ji / A_p`, what they send is the solution of
//!
//! `X_p = s_p + sum_{i in S} G_pi X_i` for `p` in `S`; then `dB_p = s_p + sum_{i in S} G_pi X_i` is
//! left unshot elsewhere, and `E_j += sum_{i in S} F_ji X_i`.
//!
//! It is the limit of shooting known rows again and again, and independent of the order in which
//! they came: sums run over patches by number, and every lane is solved by itself.

use super::krylov::{self, Work};
use super::lanes::{add_scaled, part};
use super::{Lanes, PatchState, Refinement};
use crate::color::Rgb;

/// By how much the unshot radiosity of known patches shrinks when it gets in the way of a choice.
const SETTLED: f32 = 0.05;

/// By how much it shrinks at the end, twice: the second time starts from what rounding left.
const FINISHED: f32 = 3e-4;

/// Rows that reach the elements in one pass over them.
const BATCH: usize = 4;

impl<const K: usize> Refinement<'_, K> {
    /// Lets everything that known patches hold reach the elements.
    ///
    /// This gives the best state that the rows seen so far allow; the refinement can go on from it.
    pub fn finish(&mut self) {
        if self.rows_kept == 0 {
            return;
        }
        let lanes = self.storage.blocks.len() * self.mesh.patches.len();
        let rows = &mut self.storage.rows;
        rows.sent.fill([[0.0; K]; 3]);
        for (unshot, source) in self
            .storage
            .unshot
            .iter_mut()
            .zip(&*rows.sources)
            .take(lanes)
        {
            *unshot = *source;
        }
        self.solve(FINISHED);
        self.solve(FINISHED);
        self.push();
        self.start_sources();
    }

    /// Solves for the known patches well enough to choose among the others.
    pub(super) fn settle(&mut self) {
        if self.rows_kept > 0 {
            self.solve(SETTLED);
        }
    }

    /// What is unshot becomes the sources of a new system in which nothing has been sent.
    pub(super) fn start_sources(&mut self) {
        let rows = &mut self.storage.rows;
        rows.sent.fill([[0.0; K]; 3]);
        for (source, unshot) in rows.sources.iter_mut().zip(&*self.storage.unshot) {
            *source = *unshot;
        }
    }

    /// Keeps a row with its reflected shares; false when there is no room.
    pub(super) fn keep(&mut self, patch: u32, row: &[f32]) -> bool {
        let n = self.mesh.elements.len();
        let slot = self.rows_kept as usize;
        // What receives nothing never shoots again: where room is scarce, it is for others.
        let is_waste = self.capacity < self.mesh.patches.len() && !self.mesh.receives(patch);
        let (Some(factors), Some(state)) = (
            self.storage.rows.factors.get_mut(slot * n..(slot + 1) * n),
            self.storage.patches.get_mut(patch as usize),
        ) else {
            return false;
        };
        if slot >= self.capacity || state.row != 0 || is_waste {
            return false;
        }
        for (kept, factor) in factors.iter_mut().zip(row) {
            *kept = *factor;
        }
        self.rows_kept += 1;
        state.row = self.rows_kept;
        self.keep_shares(slot);
        true
    }

    /// Keeps the reflected shares of the row at hand.
    pub(super) fn keep_shares(&mut self, slot: usize) {
        let p = self.mesh.patches.len();
        let shares = self.storage.rows.shares.get_mut(slot * p..(slot + 1) * p);
        let shares = shares.unwrap_or_default().iter_mut();
        for (share, state) in shares.zip(self.storage.patches.iter()) {
            *share = state.gathered;
        }
    }

    /// Shrinks the unshot radiosity of the known patches to `tolerance` of itself.
    fn solve(&mut self, tolerance: f32) {
        let p = self.mesh.patches.len();
        for block in 0..self.storage.blocks.len() {
            let patches = &*self.storage.patches;
            let unshot = part(self.storage.unshot, block, p);
            let rows = &mut self.storage.rows;
            let (sent, shares) = (part(rows.sent, block, p), &*rows.shares);
            let Some([more, left, shadow, direction, along, across]) = sixths(rows.work, p) else {
                return;
            };

            more.fill([[0.0; K]; 3]);
            for ((left, unshot), state) in left.iter_mut().zip(&*unshot).zip(patches) {
                *left = if state.row == 0 {
                    [[0.0; K]; 3]
                } else {
                    *unshot
                };
            }
            let apply = |v: &[Lanes<K>], y: &mut [Lanes<K>]| {
                reflect_all(patches, shares, v, y);
                for ((y, v), state) in y.iter_mut().zip(v).zip(patches) {
                    let reflected = core::mem::replace(y, [[0.0; K]; 3]);
                    if state.row != 0 {
                        *y = *v;
                        add_scaled(y, &reflected, Rgb::splat(-1.0));
                    }
                }
            };
            let work = Work {
                shadow,
                direction,
                along: &mut *along,
                across,
            };
            krylov::solve(apply, more, left, work, tolerance);

            reflect_all(patches, shares, more, along);
            for (((unshot, sent), more), reflected) in
                unshot.iter_mut().zip(sent).zip(&*more).zip(&*along)
            {
                add_scaled(unshot, reflected, Rgb::WHITE);
                add_scaled(unshot, more, Rgb::splat(-1.0));
                add_scaled(sent, more, Rgb::WHITE);
            }
        }
    }

    /// `E_j += sum_i F_ji X_i`, a few rows at a time.
    fn push(&mut self) {
        let (n, p) = (self.mesh.elements.len(), self.mesh.patches.len());
        let rows = &self.storage.rows;
        for block in 0..self.storage.blocks.len() {
            let irradiance = part(self.storage.irradiance, block, n);
            let sent = rows.sent.get(block * p..).unwrap_or_default();
            let mut known = self
                .storage
                .patches
                .iter()
                .zip(sent)
                .filter_map(|(state, sent)| Some((slot(state)?, sent)))
                .filter_map(|(slot, sent)| Some((rows.factors.get(slot * n..)?, sent)));
            loop {
                let mut batch: [(&[f32], Lanes<K>); BATCH] = [(&[], [[0.0; K]; 3]); BATCH];
                let mut count = 0;
                for (place, (row, sent)) in batch.iter_mut().zip(known.by_ref()) {
                    *place = (row, *sent);
                    count += 1;
                }
                if count == 0 {
                    break;
                }
                push_batch(irradiance, &batch);
            }
        }
    }
}

/// `E_j += sum_i F_ji X_i` over the rows of a batch; an empty row adds nothing.
fn push_batch<const K: usize>(irradiance: &mut [Lanes<K>], batch: &[(&[f32], Lanes<K>); BATCH]) {
    for (j, lanes) in irradiance.iter_mut().enumerate() {
        let mut sum = *lanes;
        for (row, sent) in batch {
            let factor = row.get(j).copied().unwrap_or(0.0);
            for (channel, sent) in sum.iter_mut().zip(sent) {
                for (value, sent) in channel.iter_mut().zip(sent) {
                    *value += factor * sent;
                }
            }
        }
        *lanes = sum;
    }
}

/// `y_p = sum_{i in S} G_pi v_i` for every patch.
fn reflect_all<const K: usize>(
    patches: &[PatchState],
    shares: &[Rgb],
    v: &[Lanes<K>],
    y: &mut [Lanes<K>],
) {
    y.fill([[0.0; K]; 3]);
    for (state, v) in patches.iter().zip(v) {
        let row = slot(state).and_then(|slot| shares.get(slot * patches.len()..));
        for (y, share) in y.iter_mut().zip(row.unwrap_or_default()) {
            add_scaled(y, v, *share);
        }
    }
}

/// Number of a patch's row in the storage; `None` when it is not known.
pub(super) fn slot(state: &PatchState) -> Option<usize> {
    (state.row as usize).checked_sub(1)
}

/// Six pieces of `length` each.
fn sixths<T>(slice: &mut [T], length: usize) -> Option<[&mut [T]; 6]> {
    let mut pieces = slice.chunks_exact_mut(length.max(1));
    Some([
        pieces.next()?,
        pieces.next()?,
        pieces.next()?,
        pieces.next()?,
        pieces.next()?,
        pieces.next()?,
    ])
}
