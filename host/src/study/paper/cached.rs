//! The shipped scheme: rows are kept, by the tagged solve and by each of the separate ones.
//!
//! Both stop as soon as the worst light's error against the dense solution of the same rows is at most
//! 1 %. How many rows that takes is found out first; then both are timed with exactly those.

use std::ops::ControlFlow;

use anyhow::Result;
use relume::refine::Refinement;

use super::clock::{median, tried};
use super::rooms::{Room, SPACING, only, room};
use crate::bake::Memory;
use crate::bake::{Method, Settings, bake};
use crate::reference::dense::DenseSolution;
use crate::rows::{Parallel, RowFiller};
use crate::study::stability::with_reflectance;
use crate::study::system::{LANES, System, Way};

/// Residual that rows end at if their number does not.
const RESIDUAL: f32 = 1e-6;

/// Error of the worst light to reach.
const ERROR: f64 = 0.01;

/// Tagged against separate solves at equal error.
#[derive(Clone, Debug)]
pub struct Cached {
    /// Number of lights.
    pub lights: u32,
    /// Rows of the tagged solve.
    pub tagged_rows: u32,
    /// Rows of all separate solves.
    pub separate_rows: u32,
    /// Seconds.
    pub tagged: f64,
    /// Seconds.
    pub separate: f64,
}

impl Cached {
    /// How many times faster than separate solves.
    #[must_use]
    pub fn speedup(&self) -> f64 {
        self.separate / self.tagged
    }
}

/// Measures one number of lights.
pub fn measure(lights: u32, repeats: usize) -> Result<Cached> {
    let tagged = Room::new(room(lights)?, SPACING)?;
    let tagged_rows = rows_needed(&tagged)?;
    let mut alone = Vec::new();
    for light in 0..lights {
        let room = Room::new(only(&tagged.scene, light)?, SPACING)?;
        let rows = rows_needed(&room)?;
        alone.push((room, rows));
    }
    let (mut of_tagged, mut of_separate) = (Vec::new(), Vec::new());
    for _ in 0..repeats {
        of_tagged.push(tried(|| exact::<LANES>(&tagged, tagged_rows))?);
        of_separate.push(tried(|| {
            alone
                .iter()
                .try_for_each(|(room, rows)| exact::<1>(room, *rows))
        })?);
    }
    Ok(Cached {
        lights,
        tagged_rows,
        separate_rows: alone.iter().map(|(_, rows)| rows).sum(),
        tagged: median(of_tagged),
        separate: median(of_separate),
    })
}

/// The rows of a room, exact, and the solution for them.
pub(super) fn reference(room: &Room) -> Result<(System, DenseSolution)> {
    let filler = Parallel::new(&room.mesh.view(), &room.bvh);
    let system = System::new(room.mesh.clone(), room.lights(), &filler);
    let dense = system.dense()?;
    Ok((system, dense))
}

/// Fewest rows with which the error is small enough, all larger numbers being so as well.
fn rows_needed(room: &Room) -> Result<u32> {
    let (system, dense) = reference(room)?;
    let is_enough = |rows: u32| -> Result<bool> {
        let refined = system.refine(Way::kept(rows, RESIDUAL))?;
        Ok(system.worst_error(&refined.with_ambient(), &dense.irradiance) <= ERROR)
    };
    let mut rows = system.refine(Way::kept(u32::MAX, RESIDUAL))?.shooters.len() as u32;
    while rows > 1 && is_enough(rows - 1)? {
        rows -= 1;
    }
    Ok(rows)
}

fn exact<const K: usize>(room: &Room, rows: u32) -> Result<()> {
    let filler = Parallel::new(&room.mesh.view(), &room.bvh);
    solve::<K>(room, &filler, rows)
}

/// The bake's loop on undivided patches, of whose rows so many are filled at most.
pub(super) fn solve<const K: usize>(room: &Room, filler: &impl RowFiller, rows: u32) -> Result<()> {
    let mesh = room.mesh.view();
    let mut memory = Memory::<K>::new(&mesh, room.lights() as usize, mesh.patches.len(), false);
    let mut refinement = Refinement::new(mesh, room.lights(), RESIDUAL, memory.storage())?;
    let mut row = vec![0.0; mesh.elements.len()];
    for _ in 0..rows {
        let Some(patch) = refinement.next_shooter() else {
            break;
        };
        filler.patch(&mesh, patch, &mut row);
        refinement.shoot(patch, &row)?;
    }
    refinement.finish();
    Ok(())
}

/// Distinct rows that a bake by rows evaluates, and the shooters that it divides patches into.
#[derive(Clone, Debug)]
pub struct Rows {
    /// Largest reflectance of the room.
    pub reflectance: f32,
    /// Rows.
    pub rows: u32,
    /// Patches after splitting, lamps included.
    pub shooters: usize,
    /// Patches before it.
    pub patches: usize,
}

/// The room with eight lights at two reflectances.
pub fn rows() -> Result<Vec<Rows>> {
    let of = |reflectance| -> Result<Rows> {
        let scene = with_reflectance(&room(8)?, reflectance)?;
        let patches = Room::new(scene.clone(), SPACING)?.mesh.patches.len();
        let settings = Settings {
            patch: Some(SPACING.patch),
            element: Some(SPACING.element),
            method: Method::Rows,
            ..Settings::default()
        };
        let solution = bake(&scene, &settings, &mut |_| ControlFlow::Continue(()))?;
        Ok(Rows {
            reflectance,
            rows: solution.rows,
            shooters: solution.mesh.patches.len(),
            patches,
        })
    };
    [0.5, 0.99].map(of).into_iter().collect()
}
