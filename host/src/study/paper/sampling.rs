//! Table 1: one combined solve, a solve for each light, and the tagged solve, 100 shots each.
//!
//! The published loop, with rows of the analytic kernel times 4 rays. The combined and the tagged
//! solve fill the same rows, so that the time of those is measured on both and enters once: what is
//! left between them is what tagging costs. State of the combined and the separate solves has one lane.

use anyhow::Result;

use super::clock::{Shots, published, typical};
use super::rooms::{Room, SPACING, combined, only, room};
use crate::chart::{Chart, Series, Style, Vertical};
use crate::study::ray_rows::RayRows;
use crate::study::system::LANES;

/// Shots of every solve, as published.
pub const SHOTS: u32 = 100;

/// Rays along each side of a patch: 4 for each element.
const SIDE: u32 = 2;

/// What the paper measured, s: combined, separate, tagged.
const PUBLISHED: [(u32, [f64; 3]); 3] = [
    (1, [3.20, 3.20, 3.29]),
    (3, [3.20, 9.62, 3.54]),
    (8, [3.20, 25.65, 4.07]),
];

/// A column of the table.
#[derive(Clone, Debug)]
pub struct Sampling {
    /// Number of lights.
    pub lights: u32,
    /// The paper's seconds: combined, separate, tagged.
    pub published: Option<[f64; 3]>,
    /// Seconds of the combined solve.
    pub combined: f64,
    /// Seconds of as many separate solves as lights.
    pub separate: f64,
    /// Seconds of the tagged solve.
    pub tagged: f64,
    /// Microseconds to fill a row.
    pub row: f64,
    /// Nanoseconds of the tagged solve, besides its rows, per shot, element and light.
    pub lane: f64,
    /// Share of the shots for which both chose the same patch.
    pub alike: f64,
}

impl Sampling {
    /// What tagging adds to the combined solve, as a share of it.
    #[must_use]
    pub fn overhead(&self) -> f64 {
        self.tagged / self.combined - 1.0
    }

    /// How many times faster than separate solves.
    #[must_use]
    pub fn speedup(&self) -> f64 {
        self.separate / self.tagged
    }
}

/// Measures one number of lights.
pub fn measure(lights: u32, repeats: usize) -> Result<Sampling> {
    let tagged = Room::new(room(lights)?, SPACING)?;
    let together = Room::new(combined(&tagged.scene)?, SPACING)?;
    let alone = (0..lights).map(|light| Room::new(only(&tagged.scene, light)?, SPACING));
    let alone: Vec<Room> = alone.collect::<Result<_>>()?;

    let (mut of_tagged, mut of_combined) = (Vec::new(), Vec::new());
    let mut of_alone = vec![Vec::new(); alone.len()];
    for _ in 0..repeats {
        of_combined.push(shots::<1>(&together)?);
        of_tagged.push(shots::<LANES>(&tagged)?);
        for (room, times) in alone.iter().zip(&mut of_alone) {
            times.push(shots::<1>(room)?);
        }
    }

    let (tagged_rows, tagged_rest) = typical(&of_tagged);
    let (combined_rows, combined_rest) = typical(&of_combined);
    let rows = (tagged_rows + combined_rows) / 2.0;
    let separate = of_alone.iter().map(|times| typical(times));
    let pairs = of_tagged[0].shooters.iter().zip(&of_combined[0].shooters);
    let count = tagged.mesh.elements.len() as f64 * f64::from(lights * SHOTS);
    Ok(Sampling {
        lights,
        published: PUBLISHED.iter().find(|p| p.0 == lights).map(|p| p.1),
        combined: rows + combined_rest,
        separate: separate.map(|(rows, rest)| rows + rest).sum(),
        tagged: rows + tagged_rest,
        row: rows / f64::from(SHOTS) * 1e6,
        lane: tagged_rest / count * 1e9,
        alike: pairs.filter(|(a, b)| a == b).count() as f64 / f64::from(SHOTS),
    })
}

/// Time over the number of lights; the tagged solve says how many times faster it is than separate ones.
pub fn chart(columns: &[Sampling]) -> Chart {
    let series = |name: &str, seconds: fn(&Sampling) -> Option<f64>| {
        let points = columns.iter().filter_map(|column| {
            let seconds = seconds(column)?;
            Some((f64::from(column.lights), seconds))
        });
        Series::new(name, Style::Curve, points)
    };
    let speedups = columns
        .iter()
        .map(|column| format!("{:.1} x", column.speedup()));
    Chart {
        title: format!("{SHOTS} shots: combined, separate and tagged solves"),
        x: "number of lights".to_owned(),
        y: Vertical::Values("time on one thread (s)".to_owned()),
        series: vec![
            series("separate", |column| Some(column.separate)),
            series("combined", |column| Some(column.combined)),
            series("tagged, so many times faster", |column| Some(column.tagged))
                .with_notes(speedups),
            series("published: separate", |column| Some(column.published?[1])),
            series("published: tagged", |column| Some(column.published?[2])),
        ],
    }
}

fn shots<const K: usize>(room: &Room) -> Result<Shots> {
    let filler = RayRows {
        bvh: &room.bvh,
        side: SIDE,
    };
    published::<K>(room, &filler, SHOTS)
}
