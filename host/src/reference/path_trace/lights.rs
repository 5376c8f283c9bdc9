//! What arrives straight from the lights, sampled so that area lights stay bounded everywhere.
//!
//! An area light is sampled in two ways, by a point chosen on it and by the cosine-distributed ray
//! that continues the path anyway; the balance heuristic weighs each by its share of the summed
//! densities. With the solid-angle densities `p_area` of the first and `p_cos = cos / pi` of the
//! second, a sample of exitance `M` found either way is worth
//! `(M / pi) cos / (p_area + p_cos) <= M`. Points and spots have no size to be hit: close to one
//! the irradiance is unbounded, and estimates that depend on such places carry large errors.
//!
//! # References
//! * E. Veach, L. J. Guibas, *Optimally combining sampling techniques for Monte Carlo rendering*,
//!   SIGGRAPH 1995, section 3.2: the balance heuristic.

use std::f64::consts::{PI, TAU};

use glam::DVec3;
use relume::color::Rgb;
use relume::scene::{Luminaire, Scene, Source, Surface};

use super::random::{Random, Weights};
use super::surfaces::Surfaces;
use crate::reference::closed_form;

/// A place that receives light, and the side from which.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub(super) position: DVec3,
    /// Unit normal of the side.
    pub(super) normal: DVec3,
}

/// What the front of a surface emits.
#[derive(Clone, Copy, Debug)]
struct Emitter {
    light: usize,
    /// Exitance at unit emission, RGB, W/m2.
    share: DVec3,
    /// How likely a point of it is chosen among all of its light's, per m2.
    density: f64,
}

/// The triangles that emit under one light, weighted by power.
#[derive(Debug)]
struct AreaLight {
    triangles: Vec<usize>,
    weights: Weights,
}

/// All lights of a scene.
#[derive(Debug)]
pub(super) struct Lights {
    area_lights: Vec<AreaLight>,
    /// By surface.
    emitters: Vec<Option<Emitter>>,
    luminaires: Vec<Luminaire>,
}

impl Lights {
    pub(super) fn new(scene: &Scene, surfaces: &Surfaces) -> Self {
        let emission_of = |surface: &Surface| {
            let emission = surface.emission()?;
            let share = triple(emission.share);
            let power = share.max_element();
            (power > 0.0).then_some((emission.light as usize, share, power))
        };
        let emissions: Vec<_> = scene.surfaces().iter().map(emission_of).collect();

        // By power, so that each light gets its samples where it emits most.
        let area_light = |light: usize| {
            let triangles = surfaces.triangles.iter().enumerate();
            let own = triangles.filter_map(|(number, triangle)| {
                let (_, _, power) = emissions[triangle.surface].filter(|e| e.0 == light)?;
                Some((number, triangle.area * power))
            });
            let (triangles, powers): (Vec<usize>, Vec<f64>) = own.unzip();
            let weights = Weights::new(powers);
            AreaLight { triangles, weights }
        };
        let area_lights: Vec<_> = (0..scene.lights() as usize).map(area_light).collect();

        let emitter = |(light, share, power): (usize, DVec3, f64)| Emitter {
            light,
            share,
            density: power / area_lights[light].weights.total(),
        };
        Self {
            emitters: emissions.into_iter().map(|e| e.map(emitter)).collect(),
            area_lights,
            luminaires: scene.luminaires().to_vec(),
        }
    }

    pub(super) fn count(&self) -> usize {
        self.area_lights.len()
    }

    /// Irradiance at a place by one sample of every light; `add(light, irradiance)` takes it.
    pub(super) fn gather(
        &self,
        surfaces: &Surfaces,
        at: Place,
        random: &mut Random,
        mut add: impl FnMut(usize, DVec3),
    ) {
        let start = surfaces.in_front(at.position, at.normal);
        for (light, area_light) in self.area_lights.iter().enumerate() {
            if area_light.triangles.is_empty() {
                continue;
            }
            let number = area_light.triangles[area_light.weights.choose(random)];
            let triangle = &surfaces.triangles[number];
            let point = triangle.point(random.uniform(), random.uniform());
            let worth = self.arriving(triangle.surface, triangle.normal, at, point - at.position);
            if let Some((_, irradiance)) = worth
                && surfaces.is_open(start, surfaces.in_front(point, triangle.normal))
            {
                add(light, irradiance);
            }
        }
        for luminaire in &self.luminaires {
            let irradiance = from_luminaire(luminaire.source(), surfaces, at, start, random);
            if irradiance > 0.0 {
                add(
                    luminaire.light() as usize,
                    triple(luminaire.share()) * irradiance,
                );
            }
        }
    }

    /// Light and worth of a sample of a surface that was found in the direction `towards`, by
    /// either way of sampling; `None` when it shows a dark side.
    pub(super) fn arriving(
        &self,
        surface: usize,
        surface_normal: DVec3,
        at: Place,
        towards: DVec3,
    ) -> Option<(usize, DVec3)> {
        let emitter = self.emitters[surface].as_ref()?;
        let distance = towards.length();
        let cosine = at.normal.dot(towards) / distance;
        let cosine_there = -surface_normal.dot(towards) / distance;
        if !(cosine > 0.0 && cosine_there > 0.0) {
            return None;
        }
        let by_area = emitter.density * distance * distance / cosine_there;
        let by_cosine = cosine / PI;
        Some((
            emitter.light,
            emitter.share * (by_cosine / (by_area + by_cosine)),
        ))
    }

    /// Irradiance of the skies that a cosine-distributed ray finds when it escapes: `pi L = 1`.
    pub(super) fn escaped(&self, mut add: impl FnMut(usize, DVec3)) {
        let is_sky = |l: &&Luminaire| matches!(l.source(), Source::Sky);
        for sky in self.luminaires.iter().filter(is_sky) {
            add(sky.light() as usize, triple(sky.share()));
        }
    }
}

/// Irradiance of one sample of a luminaire at unit emission; a sky is found by rays instead.
fn from_luminaire(
    source: &Source,
    surfaces: &Surfaces,
    at: Place,
    start: DVec3,
    random: &mut Random,
) -> f64 {
    match *source {
        Source::Point { position } | Source::Spot { position, .. } => {
            let irradiance = closed_form::source_irradiance(source, at.position, at.normal);
            if irradiance > 0.0 && surfaces.is_open(start, position.as_dvec3()) {
                irradiance
            } else {
                0.0
            }
        }
        Source::Sun { direction, angle } => {
            // Uniform over the disc: density 1 / (2 pi (1 - cos a)), radiance 1 / (pi sin^2 a).
            let least = (f64::from(angle) / 2.0).cos();
            let cosine_to_axis = 1.0 - random.uniform() * (1.0 - least);
            let towards = around(
                -direction.as_dvec3().normalize(),
                cosine_to_axis,
                random.uniform(),
            );
            let cosine = at.normal.dot(towards);
            if cosine > 0.0 && surfaces.is_free(start, towards, f64::INFINITY) {
                cosine * 2.0 / (1.0 + least)
            } else {
                0.0
            }
        }
        Source::Sky => 0.0,
    }
}

/// The unit vector with this cosine to a unit axis, turned around it by `turn` of a full turn.
pub(super) fn around(axis: DVec3, cosine: f64, turn: f64) -> DVec3 {
    let (x, y) = axis.any_orthonormal_pair();
    let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
    let (sine_turn, cosine_turn) = (turn * TAU).sin_cos();
    (x * cosine_turn + y * sine_turn) * sine + axis * cosine
}

/// RGB as a vector, `x` red.
pub(super) fn triple(rgb: Rgb) -> DVec3 {
    DVec3::from_array(rgb.to_array().map(f64::from))
}
