//! The tables of the two papers beside ours, measured in one run on one thread.
//!
//! M. Nielsen and N. J. Christensen, *Fast radiosity relighting*, 2002: Table 1 (sampling), Table 2 (reconstruction),
//! Fig. 5 (two larger scenes). D. West, *Optimization techniques in the implementation of a radiosity solver with
//! dynamic point lighting*, 2007: its one table. Times that are compared are taken in turn and
//! are medians of several repeats; published ones stand beside them as they were printed.

pub mod cached;
pub(super) mod clock;
pub mod early;
pub mod faces;
pub mod job;
pub mod large;
pub mod reconstruction;
mod rooms;
pub mod sampling;

use std::path::Path;

use anyhow::Result;
use rayon::ThreadPoolBuilder;

use crate::chart::Chart;
use cached::{Cached, Rows};
use early::{FirstLook, Stored};
use faces::Faces;
use job::SeedJob;
use large::Large;
use reconstruction::Reconstruction;
use sampling::Sampling;

/// Numbers of lights of both tables.
const LIGHTS: [u32; 5] = [1, 3, 8, 32, 64];

/// Faces along the edge of the cube: 6, 24, 96 and 384 faces.
const SIDES: [u32; 4] = [1, 2, 4, 8];

/// Everything that was measured.
#[derive(Clone, Debug)]
pub struct Report {
    /// Table 1.
    pub sampling: Vec<Sampling>,
    /// Table 1 where rows are kept.
    pub cached: Vec<Cached>,
    /// Rows by reflectance.
    pub rows: Vec<Rows>,
    /// Shots and rows to 5 % and 1 %.
    pub first_looks: Vec<FirstLook>,
    /// Bytes of row storage against rows evaluated.
    pub storage: Vec<Stored>,
    /// Hemicubes against exact rows.
    pub job: SeedJob,
    /// Table 2.
    pub reconstruction: Vec<Reconstruction>,
    /// Fig. 5; empty without the data.
    pub large: Vec<Large>,
    /// The table of the spotlight paper.
    pub faces: Vec<Faces>,
}

impl Report {
    /// Charts of the two papers' tables of times, with the names of their files.
    #[must_use]
    pub fn charts(&self) -> [(&'static str, Chart); 2] {
        [
            ("sampling.svg", sampling::chart(&self.sampling)),
            ("faces.svg", faces::chart(&self.faces)),
        ]
    }
}

/// Runs the study; `data` is the folder with `scenes` and `truth`, `watch` is told what comes next.
///
/// # Errors
/// A scene that cannot be read, or threads that cannot be started.
pub fn run(data: &Path, repeats: usize, watch: impl Fn(&str) + Send) -> Result<Report> {
    let one_thread = ThreadPoolBuilder::new().num_threads(1).build()?;
    one_thread.install(|| measure(data, repeats, watch))
}

fn measure(data: &Path, repeats: usize, watch: impl Fn(&str)) -> Result<Report> {
    let few = repeats.min(3);
    watch("sampling");
    let sampling = LIGHTS.map(|lights| sampling::measure(lights, repeats));
    watch("sampling with kept rows");
    // 64 separate solves are so many that they even out by themselves.
    let cached = [(8, few), (64, 1)].map(|(lights, repeats)| cached::measure(lights, repeats));
    let rows = cached::rows()?;
    watch("rows until an error is small");
    let first_looks = early::first_looks()?;
    let storage = early::storage()?;
    watch("hemicubes against exact rows");
    let job = job::measure(few)?;
    watch("reconstruction");
    let reconstruction = LIGHTS.map(|lights| reconstruction::measure(lights, repeats));
    watch("the spotlight paper");
    let faces = SIDES.map(|side| faces::measure(side, few));
    watch("scenes of the size of Fig. 5");
    let mut large = Vec::new();
    for pair in &large::PAIRS {
        large.extend(large::measure(data, pair)?);
    }
    Ok(Report {
        sampling: sampling.into_iter().collect::<Result<_>>()?,
        cached: cached.into_iter().collect::<Result<_>>()?,
        rows,
        first_looks,
        storage,
        job,
        reconstruction: reconstruction.into_iter().collect::<Result<_>>()?,
        large,
        faces: faces.into_iter().collect::<Result<_>>()?,
    })
}
