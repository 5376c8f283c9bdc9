//! Scenes far from the origin, moved to it without changing a bit of their shape.
//!
//! A coordinate rounds to 2^-24 of its distance from the origin, and every tolerance of
//! [`relume::geometry`] follows: 100 m away, walls of a room let rays of light through at their edges
//! that they stop at home. Along every axis on which the scene's middle is farther from the origin
//! than the scene is large, each coordinate is within a factor of two of the middle's, so their
//! difference is exact (Sterbenz 1974): what the bake computes is the same wherever the scene lies.
//! What files lose by writing far coordinates into 24 bits stays lost.

use std::borrow::Cow;

use glam::Vec3;
use relume::mesh::Side;
use relume::scene::{Luminaire, Scene, SceneError, Source, Surface};

use super::OwnedMesh;
use crate::scene::OwnedScene;

/// The surfaces and luminaires of a scene, near the origin.
#[derive(Clone, Debug)]
pub struct Centred<'a> {
    surfaces: Cow<'a, [Surface]>,
    luminaires: Cow<'a, [Luminaire]>,
    lights: usize,
}

impl Centred<'_> {
    /// The solver's view of it.
    ///
    /// # Errors
    /// [`SceneError`] when a tag is out of range.
    pub fn view(&self) -> Result<Scene<'_>, SceneError> {
        let lights = u32::try_from(self.lights).unwrap_or(u32::MAX);
        Scene::new(&self.surfaces, &self.luminaires, lights)
    }
}

/// Moves a scene to the origin, if it is far away from it; else all stays where it is.
#[must_use]
pub fn centred(scene: &OwnedScene) -> Centred<'_> {
    moved(scene, middle(&scene.surfaces)).unwrap_or(Centred {
        surfaces: Cow::Borrowed(&scene.surfaces),
        luminaires: Cow::Borrowed(&scene.luminaires),
        lights: scene.lights.len(),
    })
}

/// A mesh where the surfaces lie that it was made of, or that it was moved from. Areas stay what
/// they were.
#[must_use]
pub fn placed(mesh: &OwnedMesh, surfaces: &[Surface]) -> OwnedMesh {
    let mut mesh = mesh.clone();
    for face in &mut mesh.faces {
        if let Some(surface) = surfaces.get(face.surface as usize) {
            face.polygon = match face.side {
                Side::Front => *surface.polygon(),
                Side::Back => surface.polygon().flipped(),
            };
        }
    }
    mesh
}

/// The middle of the surfaces, along the axes on which it is far from the origin; else 0.
fn middle(surfaces: &[Surface]) -> Vec3 {
    let vertices = || surfaces.iter().flat_map(|s| s.polygon().vertices());
    let low = vertices().copied().reduce(Vec3::min).unwrap_or_default();
    let high = vertices().copied().reduce(Vec3::max).unwrap_or_default();
    let middle = low * 0.5 + high * 0.5;
    let is_far = middle.abs().cmpgt(Vec3::splat((high - low).length()));
    Vec3::select(is_far, middle, Vec3::ZERO)
}

/// `None` when there is nothing to move, or something refuses to be.
fn moved<'a>(scene: &OwnedScene, by: Vec3) -> Option<Centred<'a>> {
    if by == Vec3::ZERO {
        return None;
    }
    let surfaces = scene.surfaces.iter().zip(0..);
    let luminaires = scene.luminaires.iter();
    Some(Centred {
        surfaces: surfaces
            .map(|(surface, index)| moved_surface(surface, index, by))
            .collect::<Option<_>>()?,
        luminaires: luminaires
            .map(|luminaire| moved_luminaire(luminaire, by))
            .collect::<Option<_>>()?,
        lights: scene.lights.len(),
    })
}

fn moved_surface(surface: &Surface, index: u32, by: Vec3) -> Option<Surface> {
    let outline: Vec<Vec3> = surface
        .polygon()
        .vertices()
        .iter()
        .map(|v| *v - by)
        .collect();
    let mut moved = Surface::new(index, &outline, surface.reflectance().get()).ok()?;
    if surface.is_two_sided() {
        moved = moved.two_sided();
    }
    match surface.emission() {
        Some(emission) => moved.emitting(index, emission).ok(),
        None => Some(moved),
    }
}

fn moved_luminaire(luminaire: &Luminaire, by: Vec3) -> Option<Luminaire> {
    let mut source = *luminaire.source();
    if let Source::Point { position } | Source::Spot { position, .. } = &mut source {
        *position -= by;
    }
    Luminaire::new(luminaire.light(), luminaire.share(), source).ok()
}
