//! An unbiased path tracer: irradiance at points or over polygons, by every light by itself.
//!
//! Along a path of points `x_0, x_1, ...`, from the receiver on, with `E_m` the irradiance that
//! light `m` causes directly:
//!
//! ```text
//! E(x_0) = E_m(x_0) + mean over cosine-distributed rays x_0 -> x_1 of rho(x_1) E(x_1)
//! ```
//!
//! which is `B = M + rho E` gathered by rays; paths end by Russian roulette, never by a depth. One
//! path carries an RGB throughput and serves all lights at unit emission, so the estimates of a
//! receiver are correlated between lights and channels but each one is unbiased with its own
//! standard error. Receivers have random streams of their own: the result depends on the
//! seed and on a receiver's number, not on the threads.
//!
//! Assumptions: textured surfaces reflect their mean; the back of a one-sided surface blocks and
//! reflects nothing; emission is from fronts only.
//!
//! # References
//! * J. T. Kajiya, *The rendering equation*, SIGGRAPH 1986: path tracing.
//! * J. Arvo, D. Kirk, *Particle transport and image synthesis*, SIGGRAPH 1990: Russian roulette.

mod lights;
mod random;
mod surfaces;

use glam::DVec3;
use rayon::prelude::*;
use relume::scene::SceneError;

use crate::scene::OwnedScene;
use lights::{Lights, Place, around, triple};
use random::{Random, Weights};
use surfaces::{Surfaces, Triangle, fan};

/// Where irradiance is asked for.
#[derive(Clone, Debug)]
pub struct Receiver(Extent);

#[derive(Clone, Debug)]
enum Extent {
    Point(Place),
    Polygon {
        triangles: Vec<Triangle>,
        weights: Weights,
    },
}

impl Receiver {
    /// A point, lit from the side of `normal`; `None` when that has no length.
    #[must_use]
    pub fn point(position: DVec3, normal: DVec3) -> Option<Self> {
        let normal = normal.try_normalize()?;
        Some(Self(Extent::Point(Place { position, normal })))
    }

    /// The mean over a convex polygon, lit from its front; `None` when it has no area.
    #[must_use]
    pub fn polygon(vertices: &[DVec3]) -> Option<Self> {
        let triangles = fan(vertices, 0);
        let weights = Weights::new(triangles.iter().map(|t| t.area));
        (weights.total() > 0.0).then_some(Self(Extent::Polygon { triangles, weights }))
    }

    fn place(&self, random: &mut Random) -> Place {
        match &self.0 {
            Extent::Point(place) => *place,
            Extent::Polygon { triangles, weights } => {
                let triangle = &triangles[weights.choose(random)];
                Place {
                    position: triangle.point(random.uniform(), random.uniform()),
                    normal: triangle.normal,
                }
            }
        }
    }
}

/// RGB irradiance of one receiver by one light at unit emission, in W/m2, with standard errors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// All of it.
    pub irradiance: [f64; 3],
    /// Standard error of `irradiance`; NaN for fewer than two samples.
    pub error: [f64; 3],
    /// The part that came without a bounce.
    pub direct: [f64; 3],
    /// Standard error of `direct`.
    pub direct_error: [f64; 3],
}

/// A scene, ready to be sampled.
#[derive(Debug)]
pub struct PathTracer {
    surfaces: Surfaces,
    lights: Lights,
    /// By surface: RGB reflectance of the front and of the back.
    reflectances: Vec<[DVec3; 2]>,
}

impl PathTracer {
    /// Copies what it needs of a scene.
    ///
    /// # Errors
    /// [`SceneError`] when a tag is out of range.
    pub fn new(scene: &OwnedScene) -> Result<Self, SceneError> {
        let scene = scene.view()?;
        let surfaces = Surfaces::new(scene.surfaces());
        let sides = scene.surfaces().iter().map(|surface| {
            let front = triple(surface.reflectance().get());
            let back = if surface.is_two_sided() {
                front
            } else {
                DVec3::ZERO
            };
            [front, back]
        });
        Ok(Self {
            reflectances: sides.collect(),
            lights: Lights::new(&scene, &surfaces),
            surfaces,
        })
    }

    /// Estimates `[receiver][light]`, each from `samples` paths.
    #[must_use]
    pub fn estimate(&self, receivers: &[Receiver], samples: u32, seed: u64) -> Vec<Vec<Estimate>> {
        let numbered = receivers.par_iter().enumerate();
        numbered
            .map(|(number, receiver)| {
                let mut random = Random::new(seed, number as u64);
                self.estimate_one(receiver, samples, &mut random)
            })
            .collect()
    }

    fn estimate_one(
        &self,
        receiver: &Receiver,
        samples: u32,
        random: &mut Random,
    ) -> Vec<Estimate> {
        let lights = self.lights.count();
        let mut sums = vec![Sums::default(); lights];
        let mut path = vec![Worth::default(); lights];
        for _ in 0..samples {
            path.fill(Worth::default());
            self.follow_path(receiver.place(random), random, &mut path);
            for (sums, worth) in sums.iter_mut().zip(&path) {
                sums.add(worth);
            }
        }
        sums.iter().map(|s| s.estimate(samples)).collect()
    }

    /// Adds up what one path from `at` finds, by light.
    fn follow_path(&self, mut at: Place, random: &mut Random, found: &mut [Worth]) {
        let mut throughput = DVec3::ONE;
        for bounce in 0u64.. {
            let mut add = |light: usize, irradiance: DVec3| {
                let worth = &mut found[light];
                worth.total += throughput * irradiance;
                if bounce == 0 {
                    worth.direct += irradiance;
                }
            };
            self.lights.gather(&self.surfaces, at, random, &mut add);

            // Go on in a cosine-distributed direction (Malley's method).
            let towards = around(at.normal, (1.0 - random.uniform()).sqrt(), random.uniform());
            let start = self.surfaces.in_front(at.position, at.normal);
            let Some(hit) = self.surfaces.first_hit(start, towards) else {
                self.lights.escaped(add);
                return;
            };
            let triangle = &self.surfaces.triangles[hit.triangle];
            let way = towards * hit.distance;
            if let Some((light, irradiance)) =
                self.lights
                    .arriving(triangle.surface, triangle.normal, at, way)
            {
                add(light, irradiance);
            }

            // The brightest channel of the throughput is the chance to survive.
            let shows_front = triangle.normal.dot(towards) < 0.0;
            throughput *= self.reflectances[triangle.surface][usize::from(!shows_front)];
            let survival = throughput.max_element();
            if random.uniform() >= survival {
                return;
            }
            throughput /= survival;
            at = Place {
                position: start + way,
                normal: if shows_front {
                    triangle.normal
                } else {
                    -triangle.normal
                },
            };
        }
    }
}

/// What one path found of one light.
#[derive(Clone, Copy, Debug, Default)]
struct Worth {
    total: DVec3,
    direct: DVec3,
}

/// Sums over the paths of one light.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    total: DVec3,
    total_squared: DVec3,
    direct: DVec3,
    direct_squared: DVec3,
}

impl Sums {
    fn add(&mut self, worth: &Worth) {
        self.total += worth.total;
        self.total_squared += worth.total * worth.total;
        self.direct += worth.direct;
        self.direct_squared += worth.direct * worth.direct;
    }

    /// Means, and their standard errors `sqrt((sum x^2 - n mean^2) / (n (n - 1)))`.
    fn estimate(&self, samples: u32) -> Estimate {
        let n = f64::from(samples);
        let mean = |sum: DVec3| sum / n;
        let error = |sum: DVec3, squared: DVec3| {
            let spread = (squared - sum * sum / n).max(DVec3::ZERO);
            (spread / (n * (n - 1.0))).to_array().map(f64::sqrt)
        };
        Estimate {
            irradiance: mean(self.total).to_array(),
            error: error(self.total, self.total_squared),
            direct: mean(self.direct).to_array(),
            direct_error: error(self.direct, self.direct_squared),
        }
    }
}

#[cfg(test)]
mod tests;
