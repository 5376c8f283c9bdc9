//! Rows of form factors and of direct light, filled serially as a device does or by many threads.
//!
//! Every value depends on its own receiver alone, so how the work is shared does not change the
//! bits. Threads take receiving patches, one after the other: what can stand between it and the
//! shooter is looked up in the tree once, for all of its elements.

use std::ops::Range;

use glam::Vec2;
use rayon::prelude::*;
use relume::color::Rgb;
use relume::form_factor::{self, Receiver, Shooter, View};
use relume::geometry::{Polygon, from_unit_square};
use relume::luminaire;
use relume::mesh::{Face, Mesh};
use relume::refine::Refinement;
use relume::scene::{Luminaire, Scene};
use relume::visibility::{OccludersAndBodies, Shaft, Visibility};

use crate::bvh::{Bvh, Narrowed, lifted};
use crate::noise;

/// Receivers of direct light that one task fills.
const CHUNK: usize = 64;

/// Roundings by which the outline of an element may stick out of its patch.
const ROUNDINGS: f32 = 16.0 * f32::EPSILON;

/// Surfaces between a lamp and a patch that are so many that the lamp is quartered.
const MANY_BLOCKERS: usize = 12;

/// How often a lamp is quartered at most.
const MOST_QUARTERINGS: u32 = 3;

/// Rays that look for a way from a patch to a lamp behind so many, and for each element at least; a quarter of
/// them to a part of the lamp. A share `v` that is seen is missed with a chance of `(1 - v)^256`.
const RAYS_TO_LAMP: u32 = 256;
const RAYS_PER_ELEMENT: u32 = 64;

/// Fills rows.
pub trait RowFiller {
    /// Who sees whom.
    fn visibility(&self) -> &impl Visibility;

    /// Direct irradiance of every element by a luminaire at unit emission, W/m2.
    fn luminaire(&self, mesh: &Mesh, luminaire: &Luminaire, far: f32, row: &mut [f32]);

    /// Form factors from every element to a patch, or a whole lamp.
    fn shooter(&self, mesh: &Mesh, shooter: &Shooter, row: &mut [f32]);

    /// Form factors from every element to a patch; zeros for one that the mesh does not have.
    fn patch(&self, mesh: &Mesh, patch: u32, row: &mut [f32]) {
        match Shooter::of_patch(mesh, patch, self.visibility()) {
            Some(shooter) => self.shooter(mesh, &shooter, row),
            None => row.fill(0.0),
        }
    }

    /// The same for a whole lamp, which may be large and seen through much.
    fn lamp(&self, mesh: &Mesh, lamp: &Face, row: &mut [f32]) {
        self.shooter(mesh, &Shooter::of_face(lamp, self.visibility()), row);
    }

    /// Estimates of the form factors from every element to a polygon.
    fn estimate(&self, mesh: &Mesh, polygon: &Polygon, row: &mut [f32]) {
        let shooter = Shooter::new(*polygon);
        form_factor::estimate(mesh, &shooter, 0, self.visibility(), row);
    }
}

/// Estimates the rows that a refinement misses ([`Refinement::close`]) and solves with them.
///
/// Where there is no room for all rows nothing changes.
pub fn close<const K: usize>(
    refinement: &mut Refinement<K>,
    mesh: &Mesh,
    scene: &Scene,
    filler: &impl RowFiller,
) {
    let is_closed = luminaire::is_closed(mesh, luminaire::far(scene), filler.visibility());
    let dark = is_closed.then(|| dark_shares(mesh, scene, filler));
    refinement.close(dark.as_deref(), |patch, row| {
        if let Some(polygon) = mesh.patch_polygon(patch) {
            filler.estimate(mesh, &polygon, row);
        }
    });
    refinement.finish();
}

/// Direct irradiance of every element at unit emission by whole lamps and by luminaires, W/m2; element by element,
/// light inside.
#[must_use]
pub fn direct(
    filler: &impl RowFiller,
    mesh: &Mesh,
    luminaires: &[Luminaire],
    far: f32,
    lights: usize,
) -> Vec<Rgb> {
    let mut direct = vec![Rgb::BLACK; mesh.elements.len() * lights];
    let mut row = vec![0.0; mesh.elements.len()];
    let mut add = |light: u32, share: Rgb, row: &[f32]| {
        let values = direct.iter_mut().skip(light as usize);
        for (value, factor) in values.step_by(lights.max(1)).zip(row) {
            *value += share * *factor;
        }
    };
    for face in mesh.faces {
        if let Some(emission) = face.emission {
            filler.lamp(mesh, face, &mut row);
            add(emission.light, emission.share, &row);
        }
    }
    for luminaire in luminaires {
        filler.luminaire(mesh, luminaire, far, &mut row);
        add(luminaire.light(), luminaire.share(), &row);
    }
    direct
}

/// What share of every element's view has no patches.
fn dark_shares(mesh: &Mesh, scene: &Scene, filler: &impl RowFiller) -> Vec<f32> {
    let mut dark = vec![0.0; mesh.elements.len()];
    let mut row = dark.clone();
    for side in mesh.dark_sides(scene.surfaces()) {
        filler.estimate(mesh, &side, &mut row);
        for (sum, factor) in dark.iter_mut().zip(&row) {
            *sum += factor;
        }
    }
    dark
}

/// The solver alone, by brute force: what a device does.
#[derive(Clone, Copy, Debug)]
pub struct Serial<'a>(
    /// The surfaces that block.
    pub OccludersAndBodies<'a>,
);

impl RowFiller for Serial<'_> {
    fn visibility(&self) -> &impl Visibility {
        &self.0
    }

    fn luminaire(&self, mesh: &Mesh, luminaire: &Luminaire, far: f32, row: &mut [f32]) {
        luminaire::fill(mesh, luminaire, far, 0, &self.0, row);
    }

    fn shooter(&self, mesh: &Mesh, shooter: &Shooter, row: &mut [f32]) {
        form_factor::fill(mesh, shooter, 0, &self.0, row);
    }
}

/// All threads, with a tree of boxes, for one mesh.
#[derive(Debug)]
pub struct Parallel<'a> {
    bvh: &'a Bvh,
    /// Element numbers, patch by patch.
    elements: Vec<u32>,
    /// The same elements.
    receivers: Vec<Receiver>,
    /// Patches that have elements, with their ranges of the lists above.
    patches: Vec<(Polygon, Range<usize>)>,
}

impl<'a> Parallel<'a> {
    /// Sorts the elements of a mesh by patch.
    #[must_use]
    pub fn new(mesh: &Mesh, bvh: &'a Bvh) -> Self {
        let patch_of = |element: &u32| mesh.elements[*element as usize].patch;
        let outline = |element: &u32| mesh.element_polygon(&mesh.elements[*element as usize]);
        let mut elements: Vec<u32> = (0..mesh.elements.len() as u32).collect();
        elements.retain(|element| outline(element).is_some());
        elements.sort_by_key(patch_of);
        let receivers = elements.iter().filter_map(outline);
        let receivers = receivers.map(Receiver::new).collect();
        let mut start = 0;
        let patches = elements
            .chunk_by(|a, b| patch_of(a) == patch_of(b))
            .filter_map(|chunk| {
                let range = start..start + chunk.len();
                start = range.end;
                Some((mesh.patch_polygon(patch_of(&chunk[0]))?, range))
            })
            .collect();
        Self {
            bvh,
            elements,
            receivers,
            patches,
        }
    }
}

impl RowFiller for Parallel<'_> {
    fn visibility(&self) -> &impl Visibility {
        self.bvh
    }

    fn luminaire(&self, mesh: &Mesh, luminaire: &Luminaire, far: f32, row: &mut [f32]) {
        row.par_chunks_mut(CHUNK)
            .enumerate()
            .for_each(|(index, part)| {
                let first = (index * CHUNK) as u32;
                luminaire::fill(mesh, luminaire, far, first, self.bvh, part);
            });
    }

    fn shooter(&self, _: &Mesh, shooter: &Shooter, row: &mut [f32]) {
        self.fill(row, |receiver, range| {
            let view = shooter.seen_by(receiver, self.bvh);
            if view.is_exact() {
                return self.seen(&view, range, self.bvh);
            }
            let narrowed = self.bvh.narrowed(&shaft(shooter.polygon(), receiver));
            self.seen(&view, range, &narrowed)
        });
    }

    fn estimate(&self, _: &Mesh, polygon: &Polygon, row: &mut [f32]) {
        let shooter = Shooter::new(*polygon);
        self.fill(row, |receiver, range| {
            let view = shooter.seen_by(receiver, self.bvh);
            if view.is_hidden() {
                return Vec::new();
            }
            let receivers = self.receivers[range.clone()].iter();
            receivers
                .map(|receiver| view.estimate(receiver, self.bvh))
                .collect()
        });
    }

    fn lamp(&self, _: &Mesh, lamp: &Face, row: &mut [f32]) {
        let lamp = Shooter::of_face(lamp, self.bvh);
        self.fill(row, |receiver, range| {
            self.lamp_factors(&lamp, receiver, range, None)
        });
    }
}

impl Parallel<'_> {
    /// Fills a row from the factors of the elements of every patch.
    fn fill(&self, row: &mut [f32], factors: impl Fn(&Polygon, &Range<usize>) -> Vec<f32> + Sync) {
        row.fill(0.0);
        let patches = self.patches.par_iter();
        let factors: Vec<Vec<f32>> = patches
            .map(|(receiver, range)| factors(receiver, range))
            .collect();
        for ((_, range), factors) in self.patches.iter().zip(factors) {
            for (element, factor) in self.elements[range.clone()].iter().zip(factors) {
                row[*element as usize] = factor;
            }
        }
    }

    /// Form factors of the elements of one patch; none where the shooter is hidden from all of it.
    fn seen(&self, view: &View, range: &Range<usize>, visibility: &impl Visibility) -> Vec<f32> {
        if view.is_hidden() {
            return Vec::new();
        }
        let receivers = self.receivers[range.clone()].iter();
        receivers
            .map(|receiver| view.form_factor(receiver, visibility))
            .collect()
    }

    /// The same. Where much stands between, rays look for a way to the lamp; if one gets through, the lamp is
    /// quartered, so that less is in the way of each part. `whole` is what stands before the lamp that this
    /// one is a quarter of, and how often that has been quartered.
    fn lamp_factors(
        &self,
        lamp: &Shooter,
        receiver: &Polygon,
        range: &Range<usize>,
        whole: Option<(&Narrowed, u32)>,
    ) -> Vec<f32> {
        if lamp.is_out_of_sight(receiver) {
            return Vec::new();
        }
        let shaft = shaft(lamp.polygon(), receiver);
        let (narrowed, depth) = match whole {
            None => (self.bvh.narrowed(&shaft), 0),
            Some((whole, depth)) => (whole.narrowed(&shaft), depth + 1),
        };
        let is_many = narrowed.blockers() > MANY_BLOCKERS;
        if is_many && !self.finds_a_way(receiver, lamp.polygon(), range, depth) {
            return Vec::new();
        }
        if !is_many || depth == MOST_QUARTERINGS {
            let view = lamp.seen_by(receiver, &narrowed);
            return self.seen(&view, range, &narrowed);
        }
        let mut sum = vec![0.0; range.len()];
        for quarter in quarters(lamp.polygon()) {
            let whole = Some((&narrowed, depth));
            let factors = self.lamp_factors(&lamp.part(quarter), receiver, range, whole);
            for (sum, factor) in sum.iter_mut().zip(factors) {
                *sum += factor;
            }
        }
        sum
    }

    /// True when a ray from the front of a receiver gets to the front of a lamp, or of a part of it.
    fn finds_a_way(
        &self,
        receiver: &Polygon,
        lamp: &Polygon,
        range: &Range<usize>,
        depth: u32,
    ) -> bool {
        let rays = RAYS_TO_LAMP.max(RAYS_PER_ELEMENT * range.len() as u32);
        let rays = if depth == 0 { rays } else { rays / 4 };
        let shifts = [0, 1, 2, 3].map(|axis| noise::bits(range.start as u64 * 4 + axis));
        let mut caster = self.bvh.caster();
        (0..rays).any(|ray| {
            let at = |axis: usize| {
                noise::fraction(shifts[axis].wrapping_add(noise::STEPS[axis].wrapping_mul(ray)))
            };
            let (from, _) = from_unit_square(receiver, Vec2::new(at(0), at(1)));
            let (to, _) = from_unit_square(lamp, Vec2::new(at(2), at(3)));
            let is_in_front = |polygon: &Polygon, point| polygon.height(point).0 > 0.0;
            is_in_front(receiver, to)
                && is_in_front(lamp, from)
                && caster.sees(lifted(receiver, from), lifted(lamp, to))
        })
    }
}

/// What can be between a shooter and the elements of a receiving patch.
fn shaft(shooter: &Polygon, receiver: &Polygon) -> Shaft {
    let margin = ROUNDINGS * largest_coordinate(&[*shooter, *receiver]);
    Shaft::with_margin(receiver, shooter, margin)
}

/// Four parts of a polygon.
#[must_use]
pub fn quarters(polygon: &Polygon) -> [Polygon; 4] {
    let half = Vec2::splat(0.5);
    let corners = if polygon.is_triangle() {
        [
            (Vec2::ZERO, half),
            (Vec2::new(0.5, 0.0), Vec2::new(1.0, 0.5)),
            (Vec2::new(0.0, 0.5), Vec2::new(0.5, 1.0)),
            (half, Vec2::ZERO),
        ]
    } else {
        [
            (Vec2::ZERO, half),
            (Vec2::new(0.5, 0.0), Vec2::new(1.0, 0.5)),
            (Vec2::new(0.0, 0.5), Vec2::new(0.5, 1.0)),
            (half, Vec2::ONE),
        ]
    };
    corners.map(|(from, to)| polygon.part(from, to))
}

fn largest_coordinate(polygons: &[Polygon]) -> f32 {
    let vertices = polygons.iter().flat_map(Polygon::vertices);
    vertices.map(|v| v.abs().max_element()).fold(0.0, f32::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bake::Meshed;
    use crate::builtin::{PaperLamps, paper_room};
    use crate::reference::path_trace::PathTracer;
    use crate::scene::{Light, OwnedScene};
    use crate::study::truth::element_receivers;
    use glam::Vec3;
    use relume::color::Rgb;
    use relume::scene::{Emission, Surface};
    use std::ops::ControlFlow;

    /// A floor under a lamp, with a blind of 60 slats between; the slats leave `gap` of every tenth open.
    fn blind(gap: f32) -> OwnedScene {
        let level = |x: [f32; 2], y: [f32; 2], z: f32| {
            let corners = [(x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1])];
            corners.map(|(x, y)| Vec3::new(x, y, z))
        };
        let mut lamp = level([-1.0, 1.0], [-1.0, 1.0], 2.0);
        lamp.reverse();
        let emission = Emission {
            light: 0,
            share: Rgb::WHITE,
        };
        let lamp = Surface::new(0, &lamp, Rgb::BLACK).unwrap();
        let floor = Surface::new(1, &level([-1.0, 1.0], [-1.0, 1.0], 0.0), Rgb::splat(0.5));
        let slats = (-30_i16..30).map(|slat| {
            let x = f32::from(slat) / 10.0;
            let outline = level([x, x + 0.1 * (1.0 - gap)], [-3.0, 3.0], 1.0);
            Surface::new(2, &outline, Rgb::BLACK).unwrap()
        });
        let surfaces = [lamp.emitting(0, emission).unwrap(), floor.unwrap()];
        let surfaces: Vec<Surface> = surfaces.into_iter().chain(slats).collect();
        OwnedScene {
            textures: vec![None; surfaces.len()],
            surfaces,
            luminaires: Vec::new(),
            lights: vec![Light {
                name: "lamp".to_owned(),
                emission: Rgb::WHITE,
                importance: 1.0,
            }],
        }
    }

    #[test]
    fn exact_rows_do_not_depend_on_the_scale() {
        let rows = |scale: f32| -> Vec<f32> {
            let mut scene = paper_room(PaperLamps::Eight).unwrap().scene;
            for surface in &mut scene.surfaces {
                let vertices = surface.polygon().vertices().iter();
                let vertices: Vec<Vec3> = vertices.map(|v| *v * scale).collect();
                let of = |reflectance| Surface::new(0, &vertices, reflectance).unwrap();
                *surface = match surface.emission() {
                    Some(emission) => of(Rgb::BLACK).emitting(0, emission).unwrap(),
                    None => of(Rgb::splat(0.5)).two_sided(),
                };
            }
            let mut go_on = |_| ControlFlow::Continue(());
            let meshed = Meshed::new(&scene, Some(scale), Some(scale / 4.0), &mut go_on).unwrap();
            let mesh = meshed.mesh().view();
            let filler = Parallel::new(&mesh, meshed.bvh());
            let mut row = vec![0.0; mesh.elements.len()];
            let patches = 0..mesh.patches.len() as u32;
            patches
                .flat_map(|patch| {
                    filler.patch(&mesh, patch, &mut row);
                    row.clone()
                })
                .collect()
        };
        let metres = rows(1.0);
        for scale in [1e-3, 1e3] {
            let scaled = rows(scale);
            assert_eq!(scaled.len(), metres.len());
            for (scaled, factor) in scaled.iter().zip(&metres) {
                assert!(
                    (scaled - factor).abs() <= 1e-5,
                    "{scale}: {scaled} {factor}"
                );
            }
        }
    }

    /// What a floor of elements of half a metre gets of that lamp, and what paths say, with standard errors.
    fn through(gap: f32) -> Vec<(f64, f64, f64)> {
        let scene = blind(gap);
        let mut go_on = |_| ControlFlow::Continue(());
        let meshed = Meshed::new(&scene, Some(1.0), Some(0.5), &mut go_on).unwrap();
        let mesh = meshed.mesh().view();
        let mut row = vec![0.0; mesh.elements.len()];
        let mut faces = mesh.faces.iter();
        let lamp = faces.find(|face| face.emission.is_some()).unwrap();
        Parallel::new(&mesh, meshed.bvh()).lamp(&mesh, lamp, &mut row);
        let receivers: Vec<_> = element_receivers(&mesh)
            .into_iter()
            .map(|(receiver, _)| receiver)
            .collect();
        let traced = PathTracer::new(&scene)
            .unwrap()
            .estimate(&receivers, 4000, 1);
        let values = row.iter().zip(&traced);
        values
            .map(|(factor, traced)| {
                let traced = traced[0];
                (f64::from(*factor), traced.direct[1], traced.direct_error[1])
            })
            .collect()
    }

    #[test]
    fn a_lamp_behind_many_slats_gives_what_paths_find() {
        for gap in [0.5, 0.02] {
            for (found, truth, error) in through(gap) {
                assert!(truth > 3.0 * error, "{gap}: {truth} {error}");
                // The four points of an element see slats that are half as wide as they are apart: 2 %.
                let off = (found - truth).abs();
                assert!(
                    off < 0.02 * truth + 4.0 * error,
                    "{gap}: {found} {truth} {error}"
                );
            }
        }
    }
}
