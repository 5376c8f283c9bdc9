//! A light changes and everything else stays: only its own direct light and bounces are found again.
//!
//! Rays depend on the mesh alone, and every lane of the solve on itself alone, so the changed lights
//! get, bit for bit, what a whole bake on the same mesh and rays would give them, and the others
//! have it already.

use std::ops::ControlFlow;

use relume::color::Rgb;
use relume::mesh::Side;
use relume::scene::{Luminaire, Source, Surface};

use super::estimate::Senders;
use super::{BakeError, Job, Progress, Settings, Solved, bounce, estimate, solution};
use crate::bvh::Bvh;
use crate::gather::Hits;
use crate::mesh::{self, OwnedMesh};
use crate::scene::OwnedScene;
use crate::solution::{Method, Solution};

/// What emits under one tag: luminaires and surfaces with their shares.
#[derive(PartialEq)]
struct Emitters {
    luminaires: Vec<(Source, Rgb)>,
    surfaces: Vec<(u32, Rgb)>,
}

/// Solves again for the lights of `scene` that are not those of `old`, along the rays of its bake.
///
/// Tells how many lights that were, too.
///
/// # Errors
/// [`BakeError::OtherScene`] when the surfaces or what they reflect have changed, and what
/// [`super::bake`] reports.
pub fn update(
    scene: &OwnedScene,
    old: &Solution,
    hits: &Hits,
    settings: &Settings,
    watch: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<(Solution, usize), BakeError> {
    let (patch, element) = (old.spacing.patch, old.spacing.element);
    let scene = &*mesh::cut(scene, Some(patch), Some(element))?;
    let centred = mesh::centred(scene);
    let view = centred.view()?;
    let mut mesh = mesh::placed(&old.mesh, view.surfaces());
    let is_same_scene = old.method == Method::Gather
        && scene.surfaces.len() == old.surfaces.len()
        && scene
            .surfaces
            .iter()
            .zip(&old.surfaces)
            .all(|(new, old)| new.polygon() == old)
        && reflects_alike(scene, &old.mesh)
        && move_emission(&mut mesh, view.surfaces());
    if !is_same_scene {
        return Err(BakeError::OtherScene);
    }
    let kept: Vec<Option<usize>> = scene
        .lights
        .iter()
        .zip(0..)
        .map(|(light, tag)| {
            let old_tag = old.lights.iter().position(|old| old.name == light.name)?;
            let is_same = emitters(&scene.luminaires, &mesh, tag)
                == emitters(&old.luminaires, &old.mesh, old_tag as u32);
            is_same.then_some(old_tag)
        })
        .collect();

    let bvh = Bvh::for_scene(&view);
    let mut job = Job {
        scene: &view,
        importances: Vec::new(),
        settings,
        watch,
    };
    let is_changed = |light: u32| kept[light as usize].is_none();
    let mut solved = bounce::along(&mut job, mesh, &bvh, hits, is_changed)?;
    take_over(&mut solved, old, &kept);
    let (found, residuals) = (&solved.contributions, &solved.residuals);
    solved.errors = bounce::errors(&solved.mesh, hits, found, residuals);
    let seen = estimate::errors(
        &view,
        &solved.mesh,
        &bvh,
        &solved.contributions,
        Senders::Elements,
    );
    let new = solution(scene, Method::Gather, old.spacing, solved, &seen);
    let changed = kept.iter().filter(|kept| kept.is_none()).count();
    Ok((new, changed))
}

/// True when the elements still have the reflectance of their surfaces; textures are not compared.
fn reflects_alike(scene: &OwnedScene, mesh: &OwnedMesh) -> bool {
    mesh.faces.iter().all(|face| {
        let surface = face.surface as usize;
        let is_textured = scene.textures.get(surface).is_some_and(Option::is_some);
        let reflectance = scene.surfaces[surface].reflectance().get();
        let first = mesh.elements.get(face.first_element as usize);
        is_textured
            || face.element_count == 0 && scene.surfaces[surface].reflectance().is_black()
            || face.element_count > 0 && first.is_some_and(|e| e.reflectance == reflectance)
    })
}

/// Gives faces the emission of their surfaces; false when one emits that the mesh has no face for.
fn move_emission(mesh: &mut OwnedMesh, surfaces: &[Surface]) -> bool {
    let mut emitting = surfaces.iter().filter(|s| s.emission().is_some()).count();
    for face in &mut mesh.faces {
        let emission = surfaces[face.surface as usize].emission();
        face.emission = emission.filter(|_| face.side == Side::Front);
        emitting -= usize::from(face.emission.is_some());
    }
    emitting == 0
}

fn emitters(luminaires: &[Luminaire], mesh: &OwnedMesh, tag: u32) -> Emitters {
    let luminaires = luminaires.iter().filter(|l| l.light() == tag);
    let faces = mesh.faces.iter().filter_map(|face| {
        let emission = face.emission.filter(|emission| emission.light == tag)?;
        Some((face.surface, emission.share))
    });
    Emitters {
        luminaires: luminaires.map(|l| (*l.source(), l.share())).collect(),
        surfaces: faces.collect(),
    }
}

/// Takes over what the old solution has of the lights that were kept.
fn take_over(new: &mut Solved, old: &Solution, kept: &[Option<usize>]) {
    let (count, old_count) = (kept.len(), old.lights.len());
    for (tag, old_tag) in kept.iter().enumerate() {
        let Some(old_tag) = old_tag else { continue };
        new.residuals[tag] = old.lights[*old_tag].residual;
        let copy = |to: &mut [Rgb], from: &[Rgb]| {
            let from = from.iter().skip(*old_tag).step_by(old_count);
            for (to, from) in to.iter_mut().skip(tag).step_by(count).zip(from) {
                *to = *from;
            }
        };
        copy(&mut new.contributions, &old.contributions);
        if let (Some(to), Some(from)) = (&mut new.direct, &old.direct) {
            copy(to, from);
        }
    }
    if old.direct.is_none() {
        new.direct = None;
    }
}
