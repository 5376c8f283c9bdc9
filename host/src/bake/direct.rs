//! Direct light: one row for every luminaire and every patch of a lamp.

use relume::color::Rgb;
use relume::luminaire;

use super::{BakeError, Job, Progress};
use crate::mesh::OwnedMesh;
use crate::rows::RowFiller;

/// A row of direct light.
pub(super) struct DirectRow<'a> {
    /// The light that it belongs to.
    pub light: u32,
    /// What share of the light it is, per channel.
    pub share: Rgb,
    /// The patch that emits; `None` for a luminaire.
    pub patch: Option<u32>,
    /// Power that leaves the patch, or arrives from the luminaire, at a share of one, W.
    pub power: f32,
    /// Irradiance of every element at a share of one, W/m2.
    pub row: &'a [f32],
}

/// Rows that have been evaluated, and whether they are all.
pub(super) struct Lamps {
    /// Rows of lamps; those of luminaires are not counted.
    pub rows: u32,
    /// True when every lamp has been shot.
    pub are_complete: bool,
}

/// Visits the direct light of every luminaire, then, if asked for, of every patch that emits, until
/// the job ends. `most` is how many rows there may be in all.
pub(super) fn visit(
    job: &mut Job,
    mesh: &OwnedMesh,
    filler: &impl RowFiller,
    most: u32,
    with_lamps: bool,
    mut visit: impl FnMut(DirectRow) -> Result<(), BakeError>,
) -> Result<Lamps, BakeError> {
    let view = mesh.view();
    let scene = job.scene;
    let mut row = vec![0.0; mesh.elements.len()];
    let far = luminaire::far(scene);
    for (luminaire, done) in scene.luminaires().iter().zip(0..) {
        let parts = scene.luminaires().len();
        if (job.watch)(Progress::Meshing { done, parts }).is_break() {
            return Err(BakeError::Interrupted);
        }
        filler.luminaire(&view, luminaire, far, &mut row);
        let arrived = row.iter().zip(&mesh.elements);
        visit(DirectRow {
            light: luminaire.light(),
            share: luminaire.share(),
            patch: None,
            power: arrived.map(|(value, element)| value * element.area).sum(),
            row: &row,
        })?;
    }
    let mut rows = 0;
    if !with_lamps {
        return Ok(Lamps {
            rows,
            are_complete: false,
        });
    }
    for (patch, id) in mesh.patches.iter().zip(0..) {
        let Some(emission) = view.patch_emission(id) else {
            continue;
        };
        if job.ends(rows, most, 1.0) {
            return Ok(Lamps {
                rows,
                are_complete: false,
            });
        }
        filler.patch(&view, id, &mut row);
        rows += 1;
        visit(DirectRow {
            light: emission.light,
            share: emission.share,
            patch: Some(id),
            power: patch.area,
            row: &row,
        })?;
    }
    Ok(Lamps {
        rows,
        are_complete: true,
    })
}

/// How many patches emit.
pub(super) fn lamp_count(mesh: &OwnedMesh) -> u32 {
    let view = mesh.view();
    let patches = 0..mesh.patches.len() as u32;
    patches
        .filter(|p| view.patch_emission(*p).is_some())
        .count() as u32
}
