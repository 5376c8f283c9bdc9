//! How wrong a bake is by its own lights, without a reference.
//!
//! At places `x` on the elements ([`spread`]) light is found better than the element `j` around them knows it,
//!
//! `E(x) = D(x) + 1/R sum_r rho_h(r) E_h(r)`
//!
//! with `D` the direct light of the place, and `h(r)` the element in which ray `r` of `R` cosine-weighted ones
//! ends. Summed over the channels, and over the places with the areas `a(x)` that they stand for,
//! `sum a |E(x) - E_j| / sum a E(x)` is the relative L1 error: what varies inside elements, what the rays of the elements left to chance, and what patches blur that shoot.
//! The scatter of the rays of the places themselves is none of it; half the difference `n(x)` between its even and
//! odd rays is as large, so `sqrt(max((E(x) - E_j)^2 - n(x)^2, 0))` takes the place of the difference.
//!
//! Assumption: the places see elements whose own errors even out.

use rayon::prelude::*;
use relume::color::Rgb;
use relume::luminaire;
use relume::mesh::{Element, Patch};
use relume::scene::Scene;

use crate::bvh::Bvh;
use crate::gather::{Fan, Rays};
use crate::mesh::{Locator, OwnedMesh, Place, spread};
use crate::rows::{self, Parallel};

/// One place for so many elements, but not too few to be sure and not more than that takes.
const ELEMENTS_PER_PLACE: usize = 8;
const FEWEST_PLACES: usize = 256;
const MOST_PLACES: usize = 1024;

/// Rays of a place.
const RAYS: u32 = 512;

/// Chooses the places.
const SEED: u64 = 1;

/// Relative L1 error of every light in the contributions of a mesh.
pub(super) fn errors(
    scene: &Scene,
    mesh: &OwnedMesh,
    bvh: &Bvh,
    contributions: &[Rgb],
) -> Vec<f32> {
    let lights = scene.lights() as usize;
    let count = (mesh.elements.len() / ELEMENTS_PER_PLACE).clamp(FEWEST_PLACES, MOST_PLACES);
    let places = spread(&mesh.view(), contributions, count, SEED);
    let direct = direct_light(scene, mesh, bvh, &places);
    let gathered = gathered_light(mesh, bvh, contributions, lights, &places);

    let (mut errors, mut totals) = (vec![0.0_f64; lights], vec![0.0_f64; lights]);
    for ((place, direct), gathered) in places
        .iter()
        .zip(direct.chunks(lights))
        .zip(gathered.chunks(lights))
    {
        let known = &contributions[place.element * lights..][..lights];
        for (light, ((direct, gathered), known)) in
            direct.iter().zip(gathered).zip(known).enumerate()
        {
            let [even, odd] = gathered;
            let better = (*direct + *even + *odd).to_array();
            let noise = (*even - *odd).to_array();
            for ((better, noise), known) in better.into_iter().zip(noise).zip(known.to_array()) {
                let square = (better - known).powi(2) - noise.powi(2);
                errors[light] += place.area * f64::from(square.max(0.0).sqrt());
                totals[light] += place.area * f64::from(better);
            }
        }
    }
    let shares = errors.into_iter().zip(totals);
    shares
        .map(|(error, total)| {
            if total > 0.0 {
                (error / total) as f32
            } else {
                0.0
            }
        })
        .collect()
}

/// Direct light of places, `[place][light]`.
fn direct_light(scene: &Scene, mesh: &OwnedMesh, bvh: &Bvh, places: &[Place]) -> Vec<Rgb> {
    let lights = scene.lights() as usize;
    let receivers = with_patches_of_their_own(mesh, places);
    let view = receivers.view();
    let filler = Parallel::new(&view, bvh);
    rows::direct(
        &filler,
        &view,
        scene.luminaires(),
        luminaire::far(scene),
        lights,
    )
}

/// A mesh whose elements are the places, each in a patch that is no larger.
fn with_patches_of_their_own(mesh: &OwnedMesh, places: &[Place]) -> OwnedMesh {
    let mut own = OwnedMesh {
        faces: mesh.faces.clone(),
        ..OwnedMesh::default()
    };
    for Place { part, .. } in places {
        own.elements.push(Element {
            patch: own.patches.len() as u32,
            ..*part
        });
        own.patches.push(Patch {
            face: mesh.patches[part.patch as usize].face,
            from: part.from,
            to: part.to,
            area: part.area,
        });
    }
    own
}

/// What the even and the odd rays of places add to their light, `[place][light]`.
fn gathered_light(
    mesh: &OwnedMesh,
    bvh: &Bvh,
    contributions: &[Rgb],
    lights: usize,
    places: &[Place],
) -> Vec<[Rgb; 2]> {
    let view = mesh.view();
    let locator = Locator::new(view);
    let rays = Rays::new(view, &locator, bvh);
    let fan = Fan::new(RAYS);
    let mut light = vec![[Rgb::BLACK; 2]; places.len() * lights];
    let of_places = light.par_chunks_mut(lights).zip(places);
    of_places.enumerate().for_each(|(seed, (light, place))| {
        let Some(polygon) = view.element_polygon(&place.part) else {
            return;
        };
        let ends = rays.from_point(&polygon, polygon.center(), seed as u64, &fan);
        for (half, end) in [0, 1].into_iter().cycle().zip(ends) {
            let Some(element) = end.map(|end| end.element as usize) else {
                continue;
            };
            let share = mesh.elements[element].reflectance * (RAYS as f32).recip();
            let sent = &contributions[element * lights..][..lights];
            for (halves, sent) in light.iter_mut().zip(sent) {
                halves[half] += share * *sent;
            }
        }
    });
    light
}
