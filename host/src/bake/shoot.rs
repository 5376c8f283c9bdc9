//! Bounces that patches shoot along rows of form factors, through the solver's refinement; rows that are missing when
//! it ends, at the residual or early, are estimated.

use relume::color::Rgb;
use relume::mesh::Mesh;
use relume::refine::{Choice, Refinement};

use super::direct::{self, DirectSource, Lamps};
use super::{BakeError, Job, LANES, Memory, Missing, Settings, Solved};
use crate::mesh::{Direct, OwnedMesh, Split, split};
use crate::rows::{self, RowFiller};

/// Most bytes of kept rows.
const ROW_BYTES: usize = 4 << 30;

/// Most bytes of lamps' rows that are held until the patches are divided.
const LAMP_BYTES: usize = 1 << 30;

/// Most shooters that patches are divided into, for each of them.
const SHOOTERS_PER_PATCH: usize = 3;

/// Relative L1 error of what light brings that travels along estimated rows: 0.4 to 2 % for nearly all lights of
/// eight scenes, whatever number of rows is known.
const ESTIMATE_ERROR: f32 = 0.02;

/// A row of direct light that waits to be shot.
struct Held {
    light: u32,
    share: Rgb,
    source: DirectSource,
    row: Vec<f32>,
}

/// Direct light, shooters where it varies, then rows until the residual is reached or the job ends.
pub(super) fn refine<F: RowFiller>(
    job: &mut Job,
    mut mesh: OwnedMesh,
    filler: impl Fn(&Mesh) -> F,
) -> Result<Solved, BakeError> {
    let settings = job.settings;
    let lights = job.lights();
    // As published, and where the rows of the lamps are too many to be held, lamps are shot like
    // any other patch.
    let bytes = direct::shooters(&mesh, Lamps::Patches).len() * mesh.elements.len() * 4;
    let lamps = if !settings.plain && bytes <= LAMP_BYTES {
        Lamps::Patches
    } else {
        Lamps::Waiting
    };
    let mut held = Vec::new();
    let mut irradiance = vec![0.0; mesh.elements.len() * lights];
    let most = (mesh.patches.len() * SHOOTERS_PER_PATCH) as u32;
    let direct_filler = filler(&mesh.view());
    let visited = direct::visit(
        job,
        &mesh,
        &direct_filler,
        lamps,
        most,
        |_| true,
        |direct| {
            add_direct(&mut irradiance, lights, &direct);
            held.push(Held {
                light: direct.light,
                share: direct.share,
                source: direct.source,
                row: direct.row.to_vec(),
            });
            Ok(())
        },
    )?;
    let mut first: Vec<u32> = (0..mesh.patches.len() as u32).collect();
    if visited.is_complete {
        let irradiance = irradiance.as_slice();
        let direct = Direct { irradiance, lights };
        let budget = SHOOTERS_PER_PATCH * mesh.patches.len();
        Split { mesh, first, .. } = split(&mesh, direct, settings.variation, budget);
    }

    let (n, p) = (mesh.elements.len(), mesh.patches.len());
    let rows = if settings.plain {
        0
    } else {
        p.min(ROW_BYTES / (4 * n + 12 * p).max(1))
    };
    let mut memory = Memory::new(&mesh.view(), lights, rows, settings.split_direct);
    let storage = memory.storage();
    let goal = settings.residual;
    let tags = job.scene.lights();
    let mut refinement = Refinement::<LANES>::new(mesh.view(), tags, goal, storage)?;
    if settings.plain {
        refinement.set_choice(Choice::Power);
    }
    for (importance, tag) in job.importances.iter().zip(0..) {
        refinement.set_importance(tag, *importance)?;
    }
    for Held {
        light,
        share,
        source,
        row,
    } in held
    {
        if let DirectSource::Patch(patch) = source {
            refinement.shoot(first[patch as usize], &row)?;
        } else {
            refinement.illuminate(light, share, &row)?;
        }
    }
    let filler = filler(&mesh.view());
    let mut row = vec![0.0; mesh.elements.len()];
    let most = mesh.patches.len() as u32;
    while let Some(patch) = refinement.next_shooter() {
        if job.ends(refinement.rows_evaluated(), most, refinement.residual()) {
            break;
        }
        filler.patch(&mesh.view(), patch, &mut row);
        refinement.shoot(patch, &row)?;
    }
    refinement.finish();
    let mut left = Left::of(&refinement, &mesh, lights as u32, settings);
    let misses_rows = rows == p && refinement.rows_evaluated() < most;
    if misses_rows && settings.missing == Missing::Closed {
        rows::close(&mut refinement, &mesh.view(), job.scene, &filler);
        left.close();
    }
    Ok(read_out(&mesh, lights as u32, settings, left, &refinement))
}

/// What is left of every light when shooting ends.
struct Left {
    residuals: Vec<f32>,
    errors: Vec<f32>,
    ambient: Vec<Rgb>,
}

impl Left {
    fn of(
        refinement: &Refinement<LANES>,
        mesh: &OwnedMesh,
        lights: u32,
        settings: &Settings,
    ) -> Self {
        // What is left of a light that has shot its share and met nothing will meet nothing either.
        let is_lost = |light: u32| {
            let meets = |element| refinement.irradiance(element, light) != Rgb::BLACK;
            refinement.light_residual(light) <= settings.residual
                && !(0..mesh.elements.len() as u32).any(meets)
        };
        let is_ignored = match settings.missing {
            Missing::Nothing => true,
            Missing::Ambient => false,
            Missing::Closed => settings.plain,
        };
        let ambient = |light| {
            if is_ignored || is_lost(light) {
                Rgb::BLACK
            } else {
                refinement.ambient(light)
            }
        };
        Self {
            residuals: (0..lights).map(|l| refinement.light_residual(l)).collect(),
            errors: (0..lights).map(|l| refinement.light_error(l)).collect(),
            ambient: (0..lights).map(ambient).collect(),
        }
    }

    /// Estimated rows take the place of the ambient term.
    fn close(&mut self) {
        for error in &mut self.errors {
            *error *= ESTIMATE_ERROR;
        }
        self.ambient.fill(Rgb::BLACK);
    }
}

/// Adds the sum over the channels of a row of direct light.
fn add_direct(irradiance: &mut [f32], lights: usize, direct: &direct::DirectRow) {
    let share: f32 = direct.share.to_array().iter().sum();
    let values = irradiance.iter_mut().skip(direct.light as usize);
    for (value, factor) in values.step_by(lights).zip(direct.row) {
        *value += share * factor;
    }
}

/// Reads the contributions out of the refinement.
fn read_out(
    mesh: &OwnedMesh,
    lights: u32,
    settings: &Settings,
    left: Left,
    refinement: &Refinement<LANES>,
) -> Solved {
    let elements = mesh.elements.len() as u32;
    let collect = |value: &dyn Fn(u32, u32) -> Rgb| -> Vec<Rgb> {
        (0..elements)
            .flat_map(|element| (0..lights).map(move |light| (element, light)))
            .map(|(element, light)| value(element, light))
            .collect()
    };
    Solved {
        contributions: collect(&|element, light| {
            refinement.irradiance(element, light) + left.ambient[light as usize]
        }),
        direct: settings
            .split_direct
            .then(|| collect(&|element, light| refinement.direct(element, light))),
        exposed: Vec::new(),
        residuals: left.residuals,
        errors: left.errors,
        rows: refinement.rows_evaluated(),
        mesh: mesh.clone(),
    }
}
