//! Direct light: one row for every luminaire, and for every lamp or every patch of one.

use relume::color::Rgb;
use relume::geometry::Polygon;
use relume::luminaire;
use relume::scene::Emission;

use super::{BakeError, Job, Progress};
use crate::mesh::OwnedMesh;
use crate::rows::RowFiller;

/// What emits along a row.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum DirectSource {
    /// A point, spot, sun or sky.
    Luminaire,
    /// A whole face by number.
    Face(u32),
    /// A patch by number.
    Patch(u32),
}

/// Into what lamps are cut to shoot their emission.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Lamps {
    /// Not shot here.
    Waiting,
    /// A row for each face: it emits evenly, and form factors are exact.
    Whole,
    /// A row for each patch, as the refinement wants it.
    Patches,
}

/// A row of direct light.
pub(super) struct DirectRow<'a> {
    /// The light that it belongs to.
    pub light: u32,
    /// What share of the light it is, per channel.
    pub share: Rgb,
    /// What emits.
    pub source: DirectSource,
    /// Power that leaves the lamp, or arrives from the luminaire, at a share of one, W.
    pub power: f32,
    /// Irradiance of every element at a share of one, W/m2.
    pub row: &'a [f32],
}

/// Rows that have been evaluated, and whether they are all.
pub(super) struct Visited {
    /// Rows of lamps; those of luminaires are not counted.
    pub rows: u32,
    /// True when every lamp has been shot.
    pub is_complete: bool,
}

/// Visits the direct light of every luminaire, then of every lamp, that is wanted by its light, until
/// the job ends. `most` is
/// how many rows there may be in all.
pub(super) fn visit(
    job: &mut Job,
    mesh: &OwnedMesh,
    filler: &impl RowFiller,
    lamps: Lamps,
    most: u32,
    is_wanted: impl Fn(u32) -> bool,
    mut visit: impl FnMut(DirectRow) -> Result<(), BakeError>,
) -> Result<Visited, BakeError> {
    let view = mesh.view();
    let scene = job.scene;
    let mut row = vec![0.0; mesh.elements.len()];
    let far = luminaire::far(scene);
    for (luminaire, done) in scene.luminaires().iter().zip(0..) {
        let parts = scene.luminaires().len();
        if (job.watch)(Progress::Meshing { done, parts }).is_break() {
            return Err(BakeError::Interrupted);
        }
        if !is_wanted(luminaire.light()) {
            continue;
        }
        filler.luminaire(&view, luminaire, far, &mut row);
        let arrived = row.iter().zip(&mesh.elements);
        visit(DirectRow {
            light: luminaire.light(),
            share: luminaire.share(),
            source: DirectSource::Luminaire,
            power: arrived.map(|(value, element)| value * element.area).sum(),
            row: &row,
        })?;
    }
    let mut shooters = shooters(mesh, lamps);
    shooters.retain(|(_, _, emission)| is_wanted(emission.light));
    let mut rows = 0;
    for (source, polygon, emission) in &shooters {
        if job.ends(rows, most, 1.0) {
            break;
        }
        match source {
            DirectSource::Patch(patch) => filler.patch(&view, *patch, &mut row),
            DirectSource::Face(face) => filler.lamp(&view, &view.faces[*face as usize], &mut row),
            DirectSource::Luminaire => continue,
        }
        rows += 1;
        visit(DirectRow {
            light: emission.light,
            share: emission.share,
            source: *source,
            power: polygon.area(),
            row: &row,
        })?;
    }
    Ok(Visited {
        rows,
        is_complete: lamps != Lamps::Waiting && rows as usize == shooters.len(),
    })
}

/// All that emits, cut as asked for.
pub(super) fn shooters(mesh: &OwnedMesh, lamps: Lamps) -> Vec<(DirectSource, Polygon, Emission)> {
    let view = mesh.view();
    match lamps {
        Lamps::Waiting => Vec::new(),
        Lamps::Whole => {
            let faces = mesh.faces.iter().zip(0..);
            faces
                .filter_map(|(face, number)| {
                    Some((DirectSource::Face(number), face.polygon, face.emission?))
                })
                .collect()
        }
        Lamps::Patches => (0..mesh.patches.len() as u32)
            .filter_map(|patch| {
                let emission = view.patch_emission(patch)?;
                Some((
                    DirectSource::Patch(patch),
                    view.patch_polygon(patch)?,
                    emission,
                ))
            })
            .collect(),
    }
}
