//! What packing cost, over all states of [`Mixed`] and [`Solo`].
//!
//! A block of eight states is relit at once: for every element, the contributions of its lights times
//! their weights in the eight states, as exact values and as decoded ones.

use rayon::prelude::*;
use relume::atlas::{Quantity, WorstError};
use relume::color::Rgb;

use super::Source;
use crate::display_error::{Mixed, Solo, max_codes_at};

/// States that are relit at once.
pub(crate) const LANES: usize = 8;

/// Blocks of states and lights that are judged before a limit is looked at.
const BATCH: usize = 16;

/// Red, green and blue of one element, or the weights of one light, in every state of a block.
pub(crate) type Lanes = [[f32; LANES]; 3];

/// Errors of an atlas against its solution, in display codes.
#[derive(Clone, Debug, PartialEq)]
pub struct PackingError {
    /// Largest over all states.
    pub all: WorstError,
    /// Largest over the achromatic states: lights that only dim, each state at its own white.
    pub achromatic: WorstError,
    /// The state in which what is packed is worst.
    pub worst_state: String,
    /// Largest with each light alone, of what is packed; in their order.
    pub per_light: Vec<f32>,
}

impl PackingError {
    /// The larger one of what is packed and what is shown.
    #[must_use]
    pub const fn largest(&self) -> f32 {
        self.all.packed.max(self.all.shown)
    }

    const fn none() -> Self {
        const NONE: WorstError = WorstError {
            packed: 0.0,
            shown: 0.0,
        };
        Self {
            all: NONE,
            achromatic: NONE,
            worst_state: String::new(),
            per_light: Vec::new(),
        }
    }

    fn add(&mut self, found: WorstError, is_achromatic: bool, name: impl FnOnce() -> String) {
        if found.packed > self.all.packed || self.worst_state.is_empty() {
            self.worst_state = name();
        }
        raise(&mut self.all, found);
        if is_achromatic {
            raise(&mut self.achromatic, found);
        }
    }
}

const fn raise(worst: &mut WorstError, found: WorstError) {
    worst.packed = worst.packed.max(found.packed);
    worst.shown = worst.shown.max(found.shown);
}

/// How decoded contributions, which stand as those of the source do, differ from it in all states.
///
/// Stops when the error is above `limit`; what is returned then is only the least that it can be.
pub(super) fn measure(source: &Source, decoded: &[Rgb], limit: f32) -> PackingError {
    let mut error = foremost(source, decoded, limit);
    let states: Vec<Mixed> = Mixed::all().skip(LANES).collect();
    for batch in states.chunks(BATCH * LANES) {
        if error.largest() > limit {
            break;
        }
        let found: Vec<WorstError> = batch
            .par_chunks(LANES)
            .flat_map_iter(|states| block(source, decoded, states))
            .collect();
        for (state, found) in batch.iter().zip(found) {
            error.add(found, state.is_achromatic(), || state.to_string());
        }
    }
    error
}

/// The same for the states that usually decide: every light alone, and one block of the mixed ones.
pub(super) fn foremost(source: &Source, decoded: &[Rgb], limit: f32) -> PackingError {
    let mut error = PackingError::none();
    let states: Vec<Mixed> = Mixed::all().take(LANES).collect();
    for (state, found) in states.iter().zip(block(source, decoded, &states)) {
        error.add(found, state.is_achromatic(), || state.to_string());
    }
    let lights = &source.solution.lights;
    let tags: Vec<usize> = (0..lights.len()).collect();
    for batch in tags.chunks(BATCH * LANES) {
        if error.largest() > limit {
            break;
        }
        let found: Vec<[WorstError; 4]> = batch
            .par_iter()
            .map(|light| solos(source, decoded, *light))
            .collect();
        for (light, found) in batch.iter().zip(found) {
            let alone = found.iter().map(|found| found.packed);
            error.per_light.push(alone.fold(0.0, f32::max));
            for (solo, found) in Solo::ALL.into_iter().zip(found) {
                error.add(found, solo.is_achromatic(), || {
                    format!("{} {solo}", lights[*light].name)
                });
            }
        }
    }
    error
}

/// The error in each of some states, at most [`LANES`].
fn block(source: &Source, decoded: &[Rgb], states: &[Mixed]) -> Vec<WorstError> {
    let weights = weights(&source.solution.nominal_mix(), states);
    let relit = |values: &[Rgb]| -> Vec<Lanes> {
        let elements = values.chunks(weights.len().max(1));
        elements.map(|values| relit(values, &weights)).collect()
    };
    let (exact, found) = (relit(&source.values), relit(decoded));
    let judged = states.iter().enumerate().map(|(lane, state)| {
        let of = |lanes: &Lanes| Rgb::from_array(lanes.map(|channel| channel[lane]));
        judge(
            source,
            state.brightness(),
            |light| weights.get(light as usize).map_or(Rgb::BLACK, of),
            exact.iter().map(of),
            found.iter().map(of),
        )
    });
    judged.collect()
}

/// The weights of all lights in each of some states, at most [`LANES`].
pub(crate) fn weights(nominal: &[Rgb], states: &[Mixed]) -> Vec<Lanes> {
    let mut weights = vec![[[0.0; LANES]; 3]; nominal.len()];
    for ((weights, nominal), light) in weights.iter_mut().zip(nominal).zip(0..) {
        for (lane, state) in states.iter().enumerate() {
            let weight = state.weight(light, *nominal).to_array();
            (0..3).for_each(|channel| weights[channel][lane] = weight[channel]);
        }
    }
    weights
}

/// One element: the sum over its lights in every state.
pub(crate) fn relit(values: &[Rgb], weights: &[Lanes]) -> Lanes {
    let mut sums = [[0.0; LANES]; 3];
    for (value, weights) in values.iter().zip(weights) {
        let channels = sums.iter_mut().zip(weights).zip(value.to_array());
        for ((sums, weights), value) in channels {
            for (sum, weight) in sums.iter_mut().zip(weights) {
                *sum += value * weight;
            }
        }
    }
    sums
}

/// The error with one light alone, in every colour.
fn solos(source: &Source, decoded: &[Rgb], light: usize) -> [WorstError; 4] {
    let lights = &source.solution.lights;
    let column = |values: &[Rgb]| -> Vec<Rgb> {
        let own = values.iter().skip(light).step_by(lights.len());
        own.copied().collect()
    };
    let (exact, found) = (column(&source.values), column(decoded));
    Solo::ALL.map(|solo| {
        let weight = solo.weight(lights[light].emission);
        judge(
            source,
            1.0,
            |other| {
                if other as usize == light {
                    weight
                } else {
                    Rgb::BLACK
                }
            },
            exact.iter().map(|value| *value * weight),
            found.iter().map(|value| *value * weight),
        )
    })
}

/// The error of one state, as it is packed and as it is shown: `M + rho E`.
fn judge(
    source: &Source,
    brightness: f32,
    weight: impl Fn(u32) -> Rgb,
    exact: impl Iterator<Item = Rgb> + Clone,
    found: impl Iterator<Item = Rgb> + Clone,
) -> WorstError {
    if source.quantity == Quantity::Radiance {
        let codes = max_codes_at(brightness, exact, found);
        return WorstError {
            packed: codes,
            shown: codes,
        };
    }
    let mesh = &source.solution.mesh;
    let exitances: Vec<Rgb> = mesh
        .faces
        .iter()
        .map(|face| {
            face.emission.map_or(Rgb::BLACK, |emission| {
                emission.share * weight(emission.light)
            })
        })
        .collect();
    let shown = |value: Rgb, element: &relume::mesh::Element| {
        let reflected = match source.quantity {
            Quantity::Irradiance => element.reflectance * value,
            Quantity::Radiosity | Quantity::Radiance => value,
        };
        exitances[mesh.patches[element.patch as usize].face as usize] + reflected
    };
    WorstError {
        packed: max_codes_at(brightness, exact.clone(), found.clone()),
        shown: max_codes_at(
            brightness,
            exact.zip(&mesh.elements).map(|(v, e)| shown(v, e)),
            found.zip(&mesh.elements).map(|(v, e)| shown(v, e)),
        ),
    }
}
