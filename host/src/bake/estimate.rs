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
//! What varies inside an element evens out over it, but not where it goes: next to a dark thing, say in the gap behind a
//! lamp, less of it comes back. With `s(x) = rho_j E(x) - B` the radiosity that a place has more than the `B` that its element or
//! patch sends, and `w(x) = 1/R sum_r rho_h(r)` the share that comes back of it (its mean is `w`, and `v` that of what all places
//! send), every light is too dark or too bright by about
//!
//! `G = sum a s(x) (w(x) - w) / sum a / (1 - v)`,
//!
//! as the ambient term of Cohen et al. (1988, eq. 12) sums all further bounces; `w` is taken off as `s` should add up to nothing, and the
//! square of the standard error of the sum off its square. `G` and the differences add as squares.
//!
//! Assumption: the places see elements whose own errors even out but for that.

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
    senders: Senders,
) -> Vec<f32> {
    let lights = scene.lights() as usize;
    let count = (mesh.elements.len() / ELEMENTS_PER_PLACE).clamp(FEWEST_PLACES, MOST_PLACES);
    let places = spread(&mesh.view(), contributions, count, SEED);
    let direct = direct_light(scene, mesh, bvh, &places);
    let (gathered, returned) = gathered_light(mesh, bvh, contributions, lights, &places);
    let of_patches = match senders {
        Senders::Elements => None,
        Senders::Patches => Some(patch_radiosities(mesh, contributions, lights)),
    };
    let seen = |light: usize, number: usize| {
        let Place {
            element,
            part,
            area,
        } = places[number];
        let [even, odd] = gathered[number * lights + light];
        let known = contributions[element * lights + light];
        let of_element = part.reflectance * known;
        Seen {
            area,
            better: direct[number * lights + light] + even + odd,
            noise: even - odd,
            known,
            reflectance: part.reflectance,
            sent: of_patches.as_ref().map_or(of_element, |sent| {
                sent[part.patch as usize * lights + light]
            }),
            returned: returned[number],
        }
    };
    (0..lights)
        .map(|light| {
            let seen = (0..places.len()).map(|number| seen(light, number));
            relative_error(&seen.collect::<Vec<_>>())
        })
        .collect()
}

/// Who sends light on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Senders {
    /// Every element what it gets itself.
    Elements,
    /// Every patch evenly what its elements get.
    Patches,
}

/// A place and one light.
struct Seen {
    area: f64,
    /// Light found there, and half the difference of two halves of it.
    better: Rgb,
    noise: Rgb,
    /// What its element has of it.
    known: Rgb,
    reflectance: Rgb,
    /// Radiosity that stands for that of the place.
    sent: Rgb,
    /// What share of the light that the place sends is sent on.
    returned: Rgb,
}

/// Over all places and channels.
fn relative_error(places: &[Seen]) -> f32 {
    let (mut error, mut total) = (0.0, 0.0);
    for channel in 0..3 {
        let of = |value: Rgb| f64::from(value.to_array()[channel]);
        let level = level_error(places.iter().map(|place| {
            let more = of(place.reflectance) * of(place.better) - of(place.sent);
            [place.area, more, of(place.sent), of(place.returned)]
        }));
        for place in places {
            let square = (of(place.better) - of(place.known)).powi(2) - of(place.noise).powi(2);
            error += place.area * level.hypot(square.max(0.0).sqrt());
            total += place.area * of(place.better);
        }
    }
    if total > 0.0 {
        (error / total) as f32
    } else {
        0.0
    }
}

/// `G`, W/m2, from `a`, `s`, `B` and `w` of all places.
fn level_error(places: impl Iterator<Item = [f64; 4]> + Clone) -> f64 {
    let sum = |value: fn([f64; 4]) -> f64| places.clone().map(value).sum::<f64>();
    let area = sum(|[a, ..]| a);
    let sent = sum(|[a, _, b, _]| a * b);
    if area <= 0.0 || sent <= 0.0 {
        return 0.0;
    }
    let mean = sum(|[a, _, _, w]| a * w) / area;
    let kept = sum(|[a, _, b, w]| a * b * w) / sent;
    let (mut total, mut squares) = (0.0, 0.0);
    for [a, s, _, w] in places {
        let term = a * s * (w - mean);
        total += term;
        squares += term * term;
    }
    let certain = (total * total - squares).max(0.0).sqrt();
    certain / area / (1.0 - kept).max(f64::EPSILON)
}

/// What patches reflect, `[patch][light]`, W/m2.
fn patch_radiosities(mesh: &OwnedMesh, contributions: &[Rgb], lights: usize) -> Vec<Rgb> {
    let mut sent = vec![Rgb::BLACK; mesh.patches.len() * lights];
    for (element, values) in mesh.elements.iter().zip(contributions.chunks(lights)) {
        let patch = element.patch as usize;
        let share = element.reflectance * (element.area / mesh.patches[patch].area);
        for (sent, value) in sent[patch * lights..].iter_mut().zip(values) {
            *sent += share * *value;
        }
    }
    sent
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

/// What the even and the odd rays of places add to their light, `[place][light]`, and the mean reflectance of what the rays of
/// each place meet.
fn gathered_light(
    mesh: &OwnedMesh,
    bvh: &Bvh,
    contributions: &[Rgb],
    lights: usize,
    places: &[Place],
) -> (Vec<[Rgb; 2]>, Vec<Rgb>) {
    let view = mesh.view();
    let locator = Locator::new(view);
    let rays = Rays::new(view, &locator, bvh);
    let fan = Fan::new(RAYS);
    let mut light = vec![[Rgb::BLACK; 2]; places.len() * lights];
    let mut returned = vec![Rgb::BLACK; places.len()];
    let of_places = light.par_chunks_mut(lights).zip(&mut returned).zip(places);
    of_places
        .enumerate()
        .for_each(|(seed, ((light, returned), place))| {
            let Some(polygon) = view.element_polygon(&place.part) else {
                return;
            };
            let ends = rays.from_point(&polygon, polygon.center(), seed as u64, &fan);
            for (half, end) in [0, 1].into_iter().cycle().zip(ends) {
                let Some(element) = end.map(|end| end.element as usize) else {
                    continue;
                };
                let share = mesh.elements[element].reflectance * (RAYS as f32).recip();
                *returned += share;
                let sent = &contributions[element * lights..][..lights];
                for (halves, sent) in light.iter_mut().zip(sent) {
                    halves[half] += share * *sent;
                }
            }
        });
    (light, returned)
}
