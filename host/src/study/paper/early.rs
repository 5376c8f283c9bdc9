//! Rows until an error is small: plain, kept and closed; and what little storage for rows costs.
//!
//! Errors are those of the worst light against the dense solution of the same patches. Estimated rows are not counted as
//! rows; on the room's mesh one takes about a third of the time of an exact one.

use anyhow::Result;
use relume::color::Rgb;
use relume::refine::Refinement;
use relume::scene::Surface;

use super::cached::reference;
use super::rooms::{Room, SPACING, room};
use crate::bake::Memory;
use crate::rows::{self, Parallel};
use crate::scene::OwnedScene;
use crate::study::stability::with_reflectance;
use crate::study::system::{Field, LANES, Refined, System, Way};

/// Residual that rows end at if their number does not.
const RESIDUAL: f32 = 1e-6;

/// Residual that counts as the end in the table of storage.
const END: f32 = 1e-3;

/// Largest reflectance.
const REFLECTANCE: f32 = 0.8;

/// More shots than any solve here takes.
const MOST_SHOTS: u32 = 2048;

/// Parts of all rows that are kept, in eighths.
const EIGHTHS: [usize; 5] = [0, 1, 2, 4, 8];

/// What an error is measured beside.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Norm {
    /// All irradiance.
    Irradiance,
    /// Irradiance without direct light.
    Reflected,
}

impl Norm {
    /// Its name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Irradiance => "irradiance",
            Self::Reflected => "reflected",
        }
    }
}

/// An error to reach.
#[derive(Clone, Copy, Debug)]
pub struct Goal {
    /// Relative L2 error of the worst light.
    pub error: f64,
    /// What it is measured beside.
    pub norm: Norm,
}

/// What is shown of a refinement.
type Shown = fn(&Refined) -> Field;

fn as_it_is(refined: &Refined) -> Field {
    refined.irradiance.clone()
}

/// The room with eight lights, all its rows, and the solution that they have.
struct Case {
    room: Room,
    system: System,
    truth: Field,
    direct: Field,
}

impl Case {
    fn new(scene: OwnedScene) -> Result<Self> {
        let room = Room::new(scene, SPACING)?;
        let (system, dense) = reference(&room)?;
        Ok(Self {
            room,
            system,
            truth: dense.irradiance,
            direct: dense.direct,
        })
    }

    fn closed(&self, shots: u32) -> Result<Refined> {
        let mesh = self.room.mesh.view();
        let scene = self.room.scene.view()?;
        let filler = Parallel::new(&mesh, &self.room.bvh);
        let close = |refinement: &mut Refinement<LANES>| {
            rows::close(refinement, &mesh, &scene, &filler);
        };
        Ok(self.system.refine_then(Way::kept(shots, RESIDUAL), close)?)
    }

    /// Error of the worst light, beside all of its irradiance or beside what of it was reflected.
    fn error(&self, found: &Field, norm: Norm) -> f64 {
        match norm {
            Norm::Irradiance => self.system.worst_error(found, &self.truth),
            Norm::Reflected => {
                let found = difference(found, &self.direct);
                let truth = difference(&self.truth, &self.direct);
                self.system.worst_error(&found, &truth)
            }
        }
    }

    /// Fewest rows with which a way is exact enough, found by halving: more rows are more exact.
    fn fewest(
        &self,
        goal: Goal,
        way: impl Fn(u32) -> Result<Refined>,
        shown: Shown,
    ) -> Result<u32> {
        let is_enough = |rows: u32| -> Result<bool> {
            Ok(self.error(&shown(&way(rows)?), goal.norm) <= goal.error)
        };
        if is_enough(0)? {
            return Ok(0);
        }
        let (mut low, mut high) = (0, MOST_SHOTS);
        while high - low > 1 {
            let middle = u32::midpoint(low, high);
            if is_enough(middle)? {
                high = middle;
            } else {
                low = middle;
            }
        }
        Ok(high)
    }
}

fn difference(a: &Field, b: &Field) -> Field {
    let channels = |a: &[f64; 3], b: &[f64; 3]| [0, 1, 2].map(|c: usize| a[c] - b[c]);
    let lights = |a: &Vec<[f64; 3]>, b: &Vec<[f64; 3]>| -> Vec<[f64; 3]> {
        a.iter().zip(b).map(|(a, b)| channels(a, b)).collect()
    };
    a.iter().zip(b).map(|(a, b)| lights(a, b)).collect()
}

/// What is scaled so that the largest reflectance is 0.8.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scaled {
    /// The whole room: its ceiling has 0.8 as it is, so nothing changes.
    Together,
    /// Every surface by itself.
    Apart,
}

impl Scaled {
    /// Its name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Together => "together",
            Self::Apart => "every surface",
        }
    }

    fn scene(self) -> Result<OwnedScene> {
        let mut scene = with_reflectance(&room(8)?, REFLECTANCE)?;
        if self == Self::Apart {
            for (surface, number) in scene.surfaces.iter_mut().zip(0..) {
                let reflectance = surface.reflectance().get();
                if reflectance == Rgb::BLACK {
                    continue;
                }
                let scaled = reflectance * (REFLECTANCE / reflectance.max_channel());
                let changed = Surface::new(number, surface.polygon().vertices(), scaled)?;
                *surface = changed.two_sided();
            }
        }
        Ok(scene)
    }
}

/// Shots, and exact rows, until an error is reached in the room with eight lights.
#[derive(Clone, Debug)]
pub struct FirstLook {
    /// How its reflectances are scaled to 0.8.
    pub scaled: Scaled,
    /// What is reached.
    pub goal: Goal,
    /// Plain shots, as published.
    pub plain: u32,
    /// Kept rows, with the ambient term.
    pub kept: u32,
    /// Kept rows, the others estimated.
    pub closed: u32,
    /// Error with no exact row at all, and with those of the lamps.
    pub closed_errors: [f64; 2],
}

/// All of them.
pub fn first_looks() -> Result<Vec<FirstLook>> {
    let mut looks = Vec::new();
    for scaled in [Scaled::Together, Scaled::Apart] {
        let case = Case::new(scaled.scene()?)?;
        let closed = [case.closed(0)?, case.closed(case.system.lights)?];
        for norm in [Norm::Irradiance, Norm::Reflected] {
            for error in [0.05, 0.01] {
                let goal = Goal { error, norm };
                let refine = |way| Ok(case.system.refine(way)?);
                let plain = |shots| refine(Way::published(shots, RESIDUAL));
                let kept = |shots| refine(Way::kept(shots, RESIDUAL));
                looks.push(FirstLook {
                    scaled,
                    goal,
                    plain: case.fewest(goal, plain, as_it_is)?,
                    kept: case.fewest(goal, kept, Refined::with_ambient)?,
                    closed: case.fewest(goal, |shots| case.closed(shots), as_it_is)?,
                    closed_errors: closed.each_ref().map(|r| case.error(&r.irradiance, norm)),
                });
            }
        }
    }
    Ok(looks)
}

/// What so many kept rows cost, and what they save.
#[derive(Clone, Debug)]
pub struct Stored {
    /// Rows that are kept.
    pub rows: usize,
    /// Missing rows are estimated in the end.
    pub is_closed: bool,
    /// Bytes of the rows, and of the solve for their patches, for eight lights.
    pub bytes: usize,
    /// Rows evaluated until the residual is 1e-3; `None` where closing makes an end before it.
    pub to_residual: Option<u32>,
    /// Rows evaluated until the error is 5 % and 1 %, with the ambient term where nothing is estimated.
    pub to_errors: [u32; 2],
}

/// The room with eight lights, with storage for nothing to everything.
pub fn storage() -> Result<Vec<Stored>> {
    let case = Case::new(room(8)?)?;
    let mesh = case.room.mesh.view();
    let lights = case.system.lights as usize;
    let bytes = |rows| Memory::<LANES>::new(&mesh, lights, rows, false).row_bytes();
    let goals = [0.05, 0.01].map(|error| Goal {
        error,
        norm: Norm::Irradiance,
    });
    let mut table = Vec::new();
    for eighths in EIGHTHS {
        let rows = mesh.patches.len() * eighths / 8;
        let way = |shots, residual| Way {
            kept: rows,
            ..Way::kept(shots, residual)
        };
        let refine = |shots| Ok(case.system.refine(way(shots, RESIDUAL))?);
        let [five, one] = goals.map(|goal| case.fewest(goal, refine, Refined::with_ambient));
        table.push(Stored {
            rows,
            is_closed: false,
            bytes: bytes(rows),
            to_residual: Some(case.system.refine(way(u32::MAX, END))?.shooters.len() as u32),
            to_errors: [five?, one?],
        });
    }
    let [five, one] = goals.map(|goal| case.fewest(goal, |shots| case.closed(shots), as_it_is));
    table.push(Stored {
        rows: mesh.patches.len(),
        is_closed: true,
        bytes: bytes(mesh.patches.len()),
        to_residual: None,
        to_errors: [five?, one?],
    });
    Ok(table)
}
