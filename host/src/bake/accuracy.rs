//! Elements as long as a wanted accuracy allows, and no more rays than it needs.
//!
//! The error of the mesh falls with the length of the elements, that of the rays with the root of
//! their number; the two add as squares. Half of the goal is left to the rays; a bake tells how large the error
//! of its mesh is, and the next one takes the length that brings it to 0.8 of the goal. Patches that shoot are divided
//! where direct light varies by more than three goals.

use std::cell::Cell;
use std::ops::ControlFlow;

use super::{BakeError, Baked, Meshed, Progress, Settings};
use crate::gather::Hits;
use crate::mesh;
use crate::scene::OwnedScene;
use crate::solution::Solution;

/// Most bakes for one goal.
pub const MOST_BAKES: u32 = 5;

/// Share of the goal that the mesh may use.
const MESH_SHARE: f32 = 0.8;

/// Share of the goal that the rays may use.
const RAY_SHARE: f32 = 0.5;

/// Variation of direct light inside a shooter, in goals: it sends the mean, and receivers blur what they get of that.
const VARIATION: f32 = 3.0;

/// Elements may be so much shorter than needed.
const SLACK: f32 = 1.3;

/// Elements above which a bake does not refine its mesh for an error.
pub const MOST_ELEMENTS: usize = 400_000;

/// Bakes until the estimated error of every light is at most `goal`, with elements not much
/// shorter than that needs; with the last of them where it cannot be reached.
pub(super) fn bake_to(
    scene: &OwnedScene,
    settings: &Settings,
    goal: f32,
    watch: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<(Solution, Hits), BakeError> {
    let centred = mesh::centred(scene);
    let start = mesh::spacing(&centred.view()?, settings.patch, settings.element);
    let mut settings = Settings {
        noise: goal * RAY_SHARE,
        variation: settings.variation.min((VARIATION * goal).into()),
        error: None,
        element: Some(start.element),
        ..settings.clone()
    };
    let is_over = Cell::new(false);
    let mut watch = |progress| {
        let flow = watch(progress);
        is_over.set(is_over.get() || flow.is_break());
        flow
    };
    let mut element = start.element;
    let mut bakes = 0;
    loop {
        settings.element = Some(element);
        let scene = mesh::cut(scene, settings.patch, settings.element)?;
        let Baked {
            solution,
            hits,
            of_mesh,
        } = Meshed::new(&scene, settings.patch, settings.element, &mut watch)?
            .bake(&settings, &mut watch)?;
        bakes += 1;
        let worst = solution.lights.iter().map(|light| light.error);
        let is_met = worst.fold(0.0, f32::max) <= goal;
        // A mesh without any error would let elements grow without end.
        let wanted = element * (MESH_SHARE * goal / of_mesh.max(f32::MIN_POSITIVE)).clamp(0.3, 3.0);
        let is_as_coarse_as_can_be = wanted <= element * SLACK || element >= start.element * 8.0;
        let is_too_fine = solution.mesh.elements.len() > MOST_ELEMENTS;
        if is_over.get()
            || bakes == MOST_BAKES
            || is_met && is_as_coarse_as_can_be
            || !is_met && (is_too_fine || wanted >= element)
        {
            return Ok((solution, hits));
        }
        element = wanted;
    }
}
