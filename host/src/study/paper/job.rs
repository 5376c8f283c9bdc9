//! The paper's whole job: eight lights, separate solves by hemicubes against one solve on exact rows.
//!
//! Errors are those of the worst light, against two references. `dense_patch` is the dense solution of
//! the exact rows that we use ourselves, so that for us it is the error of the solve alone. The stricter one, `fine`, is
//! the dense solution of rows whose receivers are cut into 4 x 4 parts with 2 x 2 Gauss points each, so
//! that it sees the error of our rows as well.

use anyhow::Result;
use glam::Vec2;
use relume::form_factor::Shooter;
use relume::mesh::{Element, Mesh};
use relume::scene::Luminaire;
use relume::visibility::Visibility;

use super::cached::solve;
use super::clock::{median, published, seconds, tried};
use super::rooms::{Room, SPACING, only, room};
use super::sampling::SHOTS;
use crate::bvh::Bvh;
use crate::rows::{Parallel, RowFiller};
use crate::study::hemicube::Hemicube;
use crate::study::system::{Field, LANES, System, Way};

/// Parts of an element along each direction.
const PARTS: u32 = 4;

/// Pixels of a hemicube, as published.
const RESOLUTION: usize = 128;

/// Error of the worst light at which hemicubes count as converged, beside their own solution.
const CONVERGED: f64 = 0.01;

/// Shots are counted by so many.
const STEP: u32 = 50;

/// Times and errors of both.
#[derive(Clone, Debug)]
pub struct SeedJob {
    /// Largest difference of our receiver sums from one, the lamps' black backs counted in.
    pub sums: f64,
    /// Seconds of all exact rows and their solve.
    pub ours: f64,
    /// Seconds of eight times 100 shots by hemicube.
    pub hemicubes: f64,
    /// Seconds of one solve by hemicubes that are kept, and of one by plain shots.
    pub converged: [f64; 2],
    /// Plain shots by hemicube until every light is within 1 % of hemicubes without end.
    pub shots: u32,
    /// Microseconds of a row of ours, and of a hemicube: means over the patches.
    pub row: [f64; 2],
    /// Errors of ours.
    pub error: Errors,
    /// Errors of the separate 100-shot solves by hemicube.
    pub hemicube_error: Errors,
    /// Errors of hemicubes without end.
    pub converged_error: Errors,
}

/// Errors of the worst light.
#[derive(Clone, Copy, Debug)]
pub struct Errors {
    /// Against `dense_patch`.
    pub dense_patch: f64,
    /// Against fine rows.
    pub fine: f64,
}

/// Measures all of it.
pub fn measure(repeats: usize) -> Result<SeedJob> {
    let room = Room::new(room(8)?, SPACING)?;
    let fine = System::new(room.mesh.clone(), 8, &Fine(&room.bvh))
        .dense()?
        .irradiance;
    let mesh = room.mesh.view();
    let exact = System::new(room.mesh.clone(), 8, &Parallel::new(&mesh, &room.bvh));
    let converged = System::new(room.mesh.clone(), 8, &hemicube(&room));

    let alone = (0..8).map(|light| Room::new(only(&room.scene, light)?, SPACING));
    let alone: Vec<Room> = alone.collect::<Result<_>>()?;
    let without_end = converged.dense()?.irradiance;
    let shots = plain_shots(&converged, &without_end)?;

    let (ours, theirs) = (Parallel::new(&mesh, &room.bvh), hemicube(&room));
    let (mut of_ours, mut of_separate) = (Vec::new(), Vec::new());
    let (mut of_kept, mut of_plain) = (Vec::new(), Vec::new());
    let mut of_rows = Vec::new();
    for _ in 0..repeats {
        of_ours.push(tried(|| {
            let filler = Parallel::new(&mesh, &room.bvh);
            solve::<LANES>(&room, &filler, u32::MAX)
        })?);
        of_separate.push(tried(|| {
            let mut solves = alone.iter();
            solves.try_for_each(|room| published::<1>(room, &hemicube(room), SHOTS).map(drop))
        })?);
        of_kept.push(tried(|| solve::<LANES>(&room, &theirs, u32::MAX))?);
        of_plain.push(tried(|| published::<LANES>(&room, &theirs, shots))?);
        of_rows.push([row_times(&mesh, &ours), row_times(&mesh, &theirs)]);
    }
    let row = [0, 1].map(|which| {
        let of_patch = |patch: usize| median(of_rows.iter().map(|r| r[which][patch]).collect());
        let patches = 0..mesh.patches.len();
        patches.map(of_patch).sum::<f64>() / mesh.patches.len() as f64 * 1e6
    });

    let solved = exact.refine(Way::kept(u32::MAX, 1e-6))?;
    let mut hundred: Field = vec![Vec::new(); mesh.elements.len()];
    for room in &alone {
        let system = System::new(room.mesh.clone(), 1, &hemicube(room));
        let of_light = system.refine(Way::published(SHOTS, 1e-9))?.irradiance;
        for (all, own) in hundred.iter_mut().zip(of_light) {
            all.extend(own);
        }
    }
    let dense_patch = exact.dense()?.irradiance;
    let errors = |found: &Field| Errors {
        dense_patch: exact.worst_error(found, &dense_patch),
        fine: exact.worst_error(found, &fine),
    };
    Ok(SeedJob {
        sums: sum_error(&room, &exact),
        ours: median(of_ours),
        hemicubes: median(of_separate),
        converged: [median(of_kept), median(of_plain)],
        shots,
        row,
        error: errors(&solved.irradiance),
        hemicube_error: errors(&hundred),
        converged_error: errors(&without_end),
    })
}

/// Seconds of the row of every patch.
fn row_times(mesh: &Mesh, filler: &impl RowFiller) -> Vec<f64> {
    let mut row = vec![0.0; mesh.elements.len()];
    let patches = 0..mesh.patches.len() as u32;
    patches
        .map(|patch| seconds(|| filler.patch(mesh, patch, &mut row)))
        .collect()
}

/// Plain shots until the worst light is within [`CONVERGED`], to [`STEP`].
fn plain_shots(system: &System, without_end: &Field) -> Result<u32> {
    let mut shots = STEP;
    loop {
        let found = system.refine(Way::published(shots, 1e-9))?;
        let is_close = system.worst_error(&found.irradiance, without_end) <= CONVERGED;
        if is_close || (found.shooters.len() as u32) < shots {
            return Ok(shots);
        }
        shots += STEP;
    }
}

/// Largest difference from one of what an element sees: all patches, and the backs of the lamps, which
/// are black and shoot nothing.
fn sum_error(room: &Room, system: &System) -> f64 {
    let mesh = room.mesh.view();
    let lamps = room
        .scene
        .surfaces
        .iter()
        .filter(|s| s.emission().is_some());
    let backs: Vec<Shooter> = lamps.map(|s| Shooter::new(s.polygon().flipped())).collect();
    let sums = system.receiver_sums().into_iter().zip(mesh.elements);
    let off = sums.map(|(sum, element)| {
        let receiver = mesh.element_polygon(element);
        let behind = receiver.iter().flat_map(|receiver| {
            let factors = backs
                .iter()
                .map(|back| back.form_factor(receiver, &room.bvh));
            factors.map(f64::from)
        });
        (sum + behind.sum::<f64>() - 1.0).abs()
    });
    off.fold(0.0, f64::max)
}

fn hemicube(room: &Room) -> Hemicube<'_> {
    Hemicube {
        surfaces: &room.scene.surfaces,
        bvh: &room.bvh,
        resolution: RESOLUTION,
    }
}

/// Exact factors, averaged over parts of the elements.
struct Fine<'a>(&'a Bvh);

impl RowFiller for Fine<'_> {
    fn visibility(&self) -> &impl Visibility {
        self.0
    }

    fn luminaire(&self, mesh: &Mesh, luminaire: &Luminaire, far: f32, row: &mut [f32]) {
        Parallel::new(mesh, self.0).luminaire(mesh, luminaire, far, row);
    }

    fn shooter(&self, mesh: &Mesh, shooter: &Shooter, row: &mut [f32]) {
        for (factor, element) in row.iter_mut().zip(mesh.elements) {
            let parts = parts(element);
            let factors = parts.filter_map(|part| {
                let receiver = mesh.element_polygon(&part)?;
                Some(shooter.form_factor(&receiver, self.0))
            });
            *factor = factors.sum::<f32>() / (PARTS * PARTS) as f32;
        }
    }
}

/// A grid of equal parts of an element, which is a rectangle here.
fn parts(element: &Element) -> impl Iterator<Item = Element> {
    let whole = *element;
    let size = (whole.to - whole.from) / PARTS as f32;
    (0..PARTS * PARTS).map(move |part| {
        let at = Vec2::new((part % PARTS) as f32, (part / PARTS) as f32);
        let from = whole.from + size * at;
        Element {
            from,
            to: from + size,
            ..whole
        }
    })
}
