//! The ways to bake that are compared, and what each of them costs.

use std::cell::{Cell, RefCell};
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use relume::form_factor::Shooter;
use relume::geometry::{Polygon, gauss_points};
use relume::mesh::Mesh;
use relume::scene::{Luminaire, Surface};
use relume::visibility::{Shaft, Visibility};

use super::AccuracyError;
use crate::bake::{Meshed, Missing, Settings};
use crate::bvh::Bvh;
use crate::gather::RAYS_PER_PASS;
use crate::mesh::OwnedMesh;
use crate::rows::{Parallel, RowFiller};
use crate::solution::Solution;
use crate::study::hemicube::Hemicube;
use crate::study::ray_rows::RayRows;

/// A bake that takes longer is not repeated, s.
const LONG: f64 = 1.0;

/// What a bake did, besides bookkeeping.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Rows filled.
    pub rows: u64,
    /// Rays cast.
    pub rays: u64,
    /// Polygons seen from points.
    pub factors: u64,
    /// Hemicube pixels.
    pub pixels: u64,
}

impl Work {
    /// All of it.
    #[must_use]
    pub const fn total(&self) -> u64 {
        self.rays + self.factors + self.pixels
    }
}

/// A kind of method.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Family {
    /// Plain tagged shooting of hemicube rows (Nielsen and Christensen 2002; Cohen and Greenberg 1985).
    Published,
    /// Plain tagged shooting of exact clip rows.
    Plain,
    /// The same with the ambient term (Cohen et al. 1988).
    Ambient,
    /// Rows are kept, and their patches solved for; an ambient term stands for the others.
    Cached,
    /// Patches are divided where direct light varies, too.
    Split,
    /// The same with missing rows estimated: analytic kernel times four segments, receiver sums scaled.
    Closed,
    /// The same with hemicube rows.
    Hemicube,
    /// The same with rows of an analytic kernel times rays (Baum et al. 1989; Wallace et al. 1989).
    Rays,
    /// Elements gather rays (Malley 1988).
    Gather,
}

impl Family {
    /// All of them, the published ones first.
    pub const ALL: [Self; 9] = [
        Self::Published,
        Self::Plain,
        Self::Ambient,
        Self::Cached,
        Self::Split,
        Self::Closed,
        Self::Hemicube,
        Self::Rays,
        Self::Gather,
    ];

    /// Its name for people.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Published => "as published",
            Self::Plain => "plain exact rows",
            Self::Ambient => "plain + ambient",
            Self::Cached => "cached exact rows",
            Self::Split => "split + exact rows",
            Self::Closed => "split + closed rows",
            Self::Hemicube => "split + hemicube rows",
            Self::Rays => "split + analytic x rays",
            Self::Gather => "gather rays",
        }
    }
}

/// How rows are filled; or that elements gather instead.
#[derive(Clone, Copy)]
enum Rows {
    Gather,
    Exact,
    Hemicube { resolution: usize },
    Rays { side: u32 },
}

/// A way to bake.
pub(super) struct Way {
    pub family: Family,
    pub variant: String,
    /// What the program does unless told otherwise.
    pub is_default: bool,
    /// The default, and `--method rows`: what is measured at all mesh sizes.
    pub is_ours: bool,
    rows: Rows,
    settings: Settings,
}

/// All ways to bake a mesh; `ours` are the settings of the default.
pub(super) fn ways(ours: &Settings, mesh: &OwnedMesh) -> Vec<Way> {
    let lamps = emitting(&mesh.view()).len() as u32;
    let others = mesh.patches.len() as u32 - lamps;
    let whole = Settings {
        variation: f64::INFINITY,
        ..ours.clone()
    };
    let plain = |shots| Settings {
        plain: true,
        shots: Some(shots),
        ..whole.clone()
    };
    let hemicube = |resolution| Rows::Hemicube { resolution };

    let mut ways = vec![way(
        Family::Published,
        "hemicube 128; 100 shots".to_owned(),
        hemicube(128),
        plain(100),
    )];
    for shots in [25, 50, 100, 200, 400] {
        let variant = format!("{shots} shots");
        ways.push(way(
            Family::Plain,
            variant.clone(),
            Rows::Exact,
            plain(shots),
        ));
        let settings = Settings {
            missing: Missing::Ambient,
            ..plain(shots)
        };
        ways.push(way(Family::Ambient, variant, Rows::Exact, settings));
    }
    for quarters in 1..=4 {
        let shots = lamps + others * quarters / 4;
        let settings = Settings {
            shots: Some(shots),
            missing: Missing::Ambient,
            ..whole.clone()
        };
        ways.push(way(
            Family::Cached,
            format!("{shots} rows"),
            Rows::Exact,
            settings,
        ));
    }
    for variation in [0.6, 0.3, 0.15, 0.08] {
        let settings = Settings {
            variation,
            ..ours.clone()
        };
        let variant = format!("variation {variation}");
        let is_ours = variation == ours.variation;
        ways.push(Way {
            is_ours,
            ..way(Family::Split, variant, Rows::Exact, settings)
        });
    }
    let more = [0, 1, 2, 4].map(|quarters| lamps + others * quarters / 4);
    for shots in [0].into_iter().chain(more) {
        let settings = Settings {
            shots: Some(shots),
            ..ours.clone()
        };
        let variant = format!("{shots} rows");
        ways.push(way(Family::Closed, variant, Rows::Exact, settings));
    }
    for resolution in [64, 128, 256] {
        let variant = format!("{resolution} pixels");
        ways.push(way(
            Family::Hemicube,
            variant,
            hemicube(resolution),
            ours.clone(),
        ));
    }
    for side in [1, 2, 4] {
        let variant = format!("{} rays", side * side);
        ways.push(way(
            Family::Rays,
            variant,
            Rows::Rays { side },
            ours.clone(),
        ));
    }
    for passes in [1, 2, 4, 8, 16, 32] {
        let settings = Settings {
            shots: Some(lamps + passes),
            noise: 0.0,
            ..ours.clone()
        };
        let variant = format!("{} rays", passes * RAYS_PER_PASS);
        ways.push(way(Family::Gather, variant, Rows::Gather, settings));
    }
    ways.push(Way {
        is_default: true,
        is_ours: true,
        ..way(
            Family::Gather,
            "default".to_owned(),
            Rows::Gather,
            ours.clone(),
        )
    });
    ways
}

const fn way(family: Family, variant: String, rows: Rows, settings: Settings) -> Way {
    Way {
        family,
        variant,
        is_default: false,
        is_ours: false,
        rows,
        settings,
    }
}

/// What is noted of rows while they are filled.
#[derive(Default)]
struct Log {
    shooters: RefCell<Vec<Polygon>>,
    estimated: RefCell<Vec<Polygon>>,
    time: Cell<Duration>,
}

/// Fills rows and notes it.
struct Logged<'a, F> {
    filler: F,
    log: &'a Log,
}

impl<F: RowFiller> RowFiller for Logged<'_, F> {
    fn visibility(&self) -> &impl Visibility {
        self.filler.visibility()
    }

    fn luminaire(&self, mesh: &Mesh, luminaire: &Luminaire, far: f32, row: &mut [f32]) {
        self.filler.luminaire(mesh, luminaire, far, row);
    }

    fn shooter(&self, mesh: &Mesh, shooter: &Shooter, row: &mut [f32]) {
        let start = Instant::now();
        self.filler.shooter(mesh, shooter, row);
        self.log.time.set(self.log.time.get() + start.elapsed());
        self.log.shooters.borrow_mut().push(*shooter.polygon());
    }

    fn estimate(&self, mesh: &Mesh, shooter: &Polygon, row: &mut [f32]) {
        self.filler.estimate(mesh, shooter, row);
        self.log.estimated.borrow_mut().push(*shooter);
    }
}

/// A bake with what it cost.
pub(super) struct Run {
    pub solution: Solution,
    pub work: Work,
    pub seconds: f64,
    pub row_seconds: Option<f64>,
}

fn run(meshed: &Meshed, way: &Way) -> Result<Run, AccuracyError> {
    let (rows, settings) = (way.rows, &way.settings);
    let view = meshed.view()?;
    let (surfaces, bvh): (&[Surface], _) = (view.surfaces(), meshed.bvh());
    let log = &Log::default();
    let watch = &mut |_| ControlFlow::Continue(());
    let start = Instant::now();
    let solution = match rows {
        Rows::Gather => meshed.solve(settings, watch).map(|(solution, _)| solution),
        Rows::Exact => {
            let filler = |mesh: &Mesh| Parallel::new(mesh, bvh);
            meshed.solve_with(settings, |mesh| logged(filler(mesh), log), watch)
        }
        Rows::Hemicube { resolution } => {
            let filler = Hemicube {
                surfaces,
                bvh,
                resolution,
            };
            meshed.solve_with(settings, |_| logged(filler, log), watch)
        }
        Rows::Rays { side } => {
            let filler = RayRows { bvh, side };
            meshed.solve_with(settings, |_| logged(filler, log), watch)
        }
    }?;
    let seconds = start.elapsed().as_secs_f64();
    let is_gathered = matches!(rows, Rows::Gather);
    Ok(Run {
        work: work(meshed, rows, &solution, log),
        row_seconds: (!is_gathered).then(|| log.time.get().as_secs_f64()),
        solution,
        seconds,
    })
}

const fn logged<F>(filler: F, log: &Log) -> Logged<'_, F> {
    Logged { filler, log }
}

/// Counts what the rows of these shooters took, and the rays that were gathered.
fn work(meshed: &Meshed, rows: Rows, solution: &Solution, log: &Log) -> Work {
    let shooters = &log.shooters.borrow();
    let mesh = meshed.mesh().view();
    let elements = mesh.elements.iter();
    let receivers: Vec<Polygon> = elements.filter_map(|e| mesh.element_polygon(e)).collect();
    // Elements that do not turn their backs, and their receiver points.
    let faced = |shooters: &[Polygon]| {
        let pairs = shooters.iter().flat_map(|polygon| {
            let shooter = Shooter::new(*polygon);
            let faced = receivers
                .iter()
                .filter(move |r| !shooter.is_out_of_sight(r));
            faced.map(|receiver| gauss_points(receiver).len() as u64)
        });
        pairs.fold((0, 0), |(count, sum), points| (count + 1, sum + points))
    };
    let rows_filled = shooters.len() as u64;
    match rows {
        Rows::Gather => {
            let lamps = emitting(&mesh);
            let passes = u64::from(solution.rows).saturating_sub(lamps.len() as u64);
            Work {
                rows: lamps.len() as u64,
                rays: passes * u64::from(RAYS_PER_PASS) * receivers.len() as u64,
                factors: faced(&lamps).1,
                pixels: 0,
            }
        }
        Rows::Exact => {
            let (factors, rays) = estimates(meshed.bvh(), &receivers, &log.estimated.borrow());
            Work {
                rows: rows_filled,
                factors: faced(shooters).1 + factors,
                rays,
                pixels: 0,
            }
        }
        Rows::Rays { side } => {
            let (pairs, _) = faced(shooters);
            Work {
                rows: rows_filled,
                rays: pairs * u64::from(side * side),
                factors: pairs,
                pixels: 0,
            }
        }
        Rows::Hemicube { resolution } => Work {
            rows: rows_filled,
            pixels: rows_filled * 3 * (resolution * resolution) as u64,
            ..Work::default()
        },
    }
}

/// Factors and segments that estimates took: one factor where the middle of a receiver is enough, else one for each
/// receiver point, with a segment each where something may stand between.
fn estimates(bvh: &Bvh, receivers: &[Polygon], shooters: &[Polygon]) -> (u64, u64) {
    let (mut factors, mut rays) = (0, 0);
    for polygon in shooters {
        let shooter = Shooter::new(*polygon);
        for receiver in receivers.iter().filter(|r| !shooter.is_out_of_sight(r)) {
            let points = gauss_points(receiver).len() as u64;
            let mut is_open = true;
            bvh.between(&Shaft::new(receiver, polygon), &mut |_| is_open = false);
            let is_middle = is_open && !shooter.is_near(receiver);
            factors += if is_middle { 1 } else { points };
            rays += if is_open { 0 } else { points };
        }
    }
    (factors, rays)
}

fn emitting(mesh: &Mesh) -> Vec<Polygon> {
    (0..mesh.patches.len() as u32)
        .filter(|patch| mesh.patch_emission(*patch).is_some())
        .filter_map(|patch| mesh.patch_polygon(patch))
        .collect()
}

/// The fastest of some turns, which all find the same; the first is enough where it takes long.
pub(super) fn fastest(meshed: &Meshed, way: &Way, turns: u32) -> Result<Run, AccuracyError> {
    let mut best = run(meshed, way)?;
    for _ in 1..turns {
        if best.seconds > LONG {
            break;
        }
        let turn = run(meshed, way)?;
        if turn.seconds < best.seconds {
            best = turn;
        }
    }
    Ok(best)
}
