//! Pictures of the lights one by one, whose weighted sum is the picture under any mix.

use relume::color::Rgb;

use super::{Camera, PreviewError, Relit, render};
use crate::export::exr::LightLayer;
use crate::solution::{Solution, SolutionLight};

/// For every light the picture that it makes alone, at its nominal emission, as [`render`] makes it.
///
/// # Errors
/// None in fact: a solution relights all of its elements.
pub fn light_layers(solution: &Solution, camera: &Camera) -> Result<Vec<LightLayer>, PreviewError> {
    let nominal = solution.nominal_mix();
    let layer = |(light, tag): (&SolutionLight, usize)| {
        let mut only = vec![Rgb::BLACK; nominal.len()];
        only[tag] = nominal[tag];
        let relit = Relit {
            mesh: solution.mesh.view(),
            surfaces: &solution.surfaces,
            irradiance: &solution.relight(&only),
            exitance: &solution.face_exitance(&only),
            gathered: None,
        };
        Ok((light.name.clone(), render(&relit, camera, f32::INFINITY)?))
    };
    solution.lights.iter().zip(0..).map(layer).collect()
}
