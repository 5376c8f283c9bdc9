//! How close the error that a bake estimates by itself comes to its error, light by light.
//!
//! Points on the elements ([`spread`]) get the values of their elements, so that what varies inside an
//! element shows; paths tell the truth ([`Truth::relative_l1`]). A bake looks at other places, and
//! its rays know no more than its own elements.

use glam::DVec3;

use super::truth::{Truth, TruthError, traced};
use crate::chart::{Chart, Series, Style, Vertical};
use crate::mesh::spread;
use crate::reference::path_trace::Receiver;
use crate::scene::OwnedScene;
use crate::solution::Solution;

/// Chooses the points; a bake chooses others.
const SEED: u64 = 7;

/// A light's error.
#[derive(Clone, Debug)]
pub struct Estimated {
    /// Name of the light.
    pub light: String,
    /// Relative L1 error as the bake estimates it.
    pub estimate: f64,
    /// Relative L1 error.
    pub error: f64,
    /// Noise of the truth, relative as well.
    pub noise: f64,
}

impl Estimated {
    /// Estimate over truth; nothing where the error drowns in the noise of the truth.
    #[must_use]
    pub fn ratio(&self) -> Option<f64> {
        (self.error > self.noise).then(|| self.estimate / self.error)
    }
}

/// What is spent on the truth.
#[derive(Clone, Copy, Debug)]
pub struct Effort {
    /// Points in a scene.
    pub points: u32,
    /// Paths from each point.
    pub paths: u32,
}

/// Compares what a solution says of its own errors with paths.
///
/// # Errors
/// A scene that is not fit to be traced.
pub fn compare(
    scene: &OwnedScene,
    solution: &Solution,
    effort: Effort,
) -> Result<Vec<Estimated>, TruthError> {
    let mesh = solution.mesh.view();
    let lights = solution.lights.len();
    let (mut elements, mut receivers) = (Vec::new(), Vec::new());
    let count = effort.points as usize;
    for place in spread(&mesh, &solution.contributions, count, SEED) {
        let receiver = mesh.element_polygon(&place.part).and_then(|part| {
            let normal: DVec3 = part.normal().as_dvec3();
            Receiver::point(part.center().as_dvec3(), normal)
        });
        if let Some(receiver) = receiver {
            elements.push(place.element);
            receivers.push((receiver, place.area));
        }
    }
    let truth: Truth = traced(scene, &receivers, effort.paths, SEED)?;
    let errors = truth.relative_l1(|point, light| {
        solution.contributions[elements[point] * lights + light].to_array()
    });
    let estimated = solution.lights.iter().zip(errors);
    Ok(estimated
        .map(|(light, [error, noise])| Estimated {
            light: light.name.clone(),
            estimate: light.error.into(),
            error,
            noise,
        })
        .collect())
}

/// Smallest, median and largest of the ratios of lights, if there are any.
#[must_use]
pub fn spread_of_ratios(lights: &[Estimated]) -> Option<[f64; 3]> {
    let mut ratios: Vec<f64> = lights.iter().filter_map(Estimated::ratio).collect();
    ratios.sort_by(f64::total_cmp);
    Some([*ratios.first()?, ratios[ratios.len() / 2], *ratios.last()?])
}

/// Estimate over error of every light, scene by scene, from the first at the top.
#[must_use]
pub fn chart(scenes: &[(&str, Vec<Estimated>)]) -> Chart {
    let points = scenes.iter().enumerate().flat_map(|(number, (_, lights))| {
        let ratios = lights.iter().filter_map(Estimated::ratio);
        ratios.map(move |ratio| (ratio, number as f64))
    });
    Chart {
        title: "how true the estimated errors are".to_owned(),
        x: "estimated over true relative L1 error of a light".to_owned(),
        y: Vertical::Names(scenes.iter().map(|(name, _)| (*name).to_owned()).collect()),
        series: vec![Series::new("a light", Style::Dots, points)],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bake::Settings;
    use crate::builtin::white_furnace;
    use crate::study::meshed;
    use std::ops::ControlFlow;

    const FEW: Effort = Effort {
        points: 200,
        paths: 500,
    };

    #[test]
    fn a_bake_without_error_says_so_and_half_the_light_is_half_an_error() {
        let furnace = white_furnace(0.5, 1.0).unwrap();
        let meshed = meshed(&furnace, 1.0, 0.5);
        let mut go_on = |_| ControlFlow::Continue(());
        let (mut solution, _) = meshed.solve(&Settings::default(), &mut go_on).unwrap();
        let exact = compare(&furnace.scene, &solution, FEW).unwrap();
        // 500 paths leave about 2 %, of which a third is taken for an error.
        assert!(
            exact[0].estimate < 1e-3 && exact[0].error < 0.015,
            "{exact:?}"
        );
        assert_eq!(exact[0].ratio(), None);
        for value in &mut solution.contributions {
            *value = *value * 0.5;
        }
        let half = compare(&furnace.scene, &solution, FEW).unwrap();
        assert!((half[0].error - 0.5).abs() < 0.01, "{half:?}");
    }
}
