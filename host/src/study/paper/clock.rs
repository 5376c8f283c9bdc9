//! Times of solves, shot by shot, so that a disturbance of one repeat does not count.

use std::hint::black_box;
use std::time::Instant;

use anyhow::Result;
use relume::refine::{Choice, Refinement};

use super::rooms::Room;
use crate::bake::Memory;
use crate::rows::RowFiller;

/// One repeat of a solve.
#[derive(Clone, Debug, Default)]
pub struct Shots {
    /// Seconds to fill each row.
    pub rows: Vec<f64>,
    /// Seconds to choose each patch and to distribute its light.
    pub rest: Vec<f64>,
    /// The patches.
    pub shooters: Vec<u32>,
}

/// The published loop: choose by power, fill a row, distribute; nothing is kept.
pub fn published<const K: usize>(
    room: &Room,
    filler: &impl RowFiller,
    shots: u32,
) -> Result<Shots> {
    let mesh = room.mesh.view();
    let mut memory = Memory::<K>::new(&mesh, room.lights() as usize, 0, false);
    let mut refinement = Refinement::new(mesh, room.lights(), 1e-9, memory.storage())?;
    refinement.set_choice(Choice::Power);
    let mut row = vec![0.0; mesh.elements.len()];
    let mut times = Shots::default();
    for _ in 0..shots {
        let start = Instant::now();
        let Some(patch) = refinement.next_shooter() else {
            break;
        };
        let chosen = Instant::now();
        filler.patch(&mesh, patch, &mut row);
        let filled = Instant::now();
        refinement.shoot(patch, &row)?;
        let rest = chosen - start + filled.elapsed();
        times.rows.push((filled - chosen).as_secs_f64());
        times.rest.push(rest.as_secs_f64());
        times.shooters.push(patch);
    }
    Ok(times)
}

/// Seconds of all rows and of all the rest: medians of each shot over repeats, added up.
pub fn typical(repeats: &[Shots]) -> (f64, f64) {
    (
        sum_of_medians(repeats, |shots| &shots.rows),
        sum_of_medians(repeats, |shots| &shots.rest),
    )
}

fn sum_of_medians(repeats: &[Shots], times: fn(&Shots) -> &Vec<f64>) -> f64 {
    let count = repeats.first().map_or(0, |shots| times(shots).len());
    let of_shot = |shot: usize| median(repeats.iter().map(|r| times(r)[shot]).collect());
    (0..count).map(of_shot).sum()
}

/// The middle one; 0 of nothing.
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// Seconds that the work takes.
pub fn seconds<T>(work: impl FnOnce() -> T) -> f64 {
    let start = Instant::now();
    drop(black_box(work()));
    start.elapsed().as_secs_f64()
}

/// The same for work that may fail.
pub fn tried<T>(work: impl FnOnce() -> Result<T>) -> Result<f64> {
    let start = Instant::now();
    drop(black_box(work()?));
    Ok(start.elapsed().as_secs_f64())
}
