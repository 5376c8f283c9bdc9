//! What a device needs for its frames beside the atlas: full weights, reflectances, an exposure and where white begins.

use std::iter;

use relume::atlas::{Atlas, Quantity};
use relume::color::Rgb;
use relume::relight::{Finish, FrameLight, FrameMix, RelightError, Run, STEPS};
use relume::tone::{Exposure, Rgb565Table, radiance};

use crate::pack::relight_atlas;
use crate::picture::white;

/// Constants of an atlas that firmware links beside it.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameConstants {
    /// The nominal emission of every light: its full weight.
    pub full: Vec<Rgb>,
    /// Reflectances of all elements, in their order.
    pub runs: Vec<Run>,
    /// With all lights on, the 98th percentile of the elements' luminance is white.
    pub exposure: f32,
    /// The step at which white begins in a table that holds the brightest element, too.
    pub white: u16,
}

impl FrameConstants {
    /// Of an atlas; `None` for irradiance without a mesh, which alone has the reflectances, and for more lights than a frame holds.
    ///
    /// # Errors
    /// [`RelightError`] for an atlas that cannot be relit.
    pub fn new(atlas: &Atlas) -> Result<Option<Self>, RelightError> {
        let runs = match (atlas.quantity(), atlas.mesh()) {
            (Quantity::Irradiance, None) => return Ok(None),
            (Quantity::Irradiance, Some(mesh)) => {
                let elements = (0..mesh.element_count()).filter_map(|index| mesh.element(index));
                runs(elements.map(|element| element.reflectance))
            }
            (Quantity::Radiosity | Quantity::Radiance, _) => vec![Run {
                elements: atlas.element_count(),
                reflectance: [u16::MAX; 3],
            }],
        };
        let full: Vec<Rgb> = atlas.lights().map(|light| light.emission).collect();
        let lit = relight_atlas(atlas, &full)?;
        let shown = iter::zip(lit, reflectances(&runs))
            .map(|(lit, reflectance)| radiance(reflectance, lit, Rgb::BLACK));
        let exposure = Exposure::for_white(white(shown)).factor();

        let mut room = vec![FrameLight::EMPTY; full.len()];
        let mix = match FrameMix::new(atlas, &full, &mut room) {
            Err(RelightError::Range) => return Ok(None),
            mix => mix?,
        };
        let fits = |white: &u16| {
            let tone = Rgb565Table::new(*white);
            Finish::new(atlas, &mix, &runs, exposure, &tone).is_ok()
        };
        let white = (1..=STEPS as u16).rev().find(fits);
        Ok(white.map(|white| Self {
            full,
            runs,
            exposure,
            white,
        }))
    }
}

/// Reflectances of elements that follow each other, in 2^-16.
#[must_use]
pub fn runs(reflectances: impl IntoIterator<Item = Rgb>) -> Vec<Run> {
    let mut runs: Vec<Run> = Vec::new();
    for reflectance in reflectances {
        // Casts saturate.
        let reflectance = reflectance
            .to_array()
            .map(|r| (r * 65_536.0).round() as u16);
        match runs.last_mut() {
            Some(run) if run.reflectance == reflectance => run.elements += 1,
            _ => runs.push(Run {
                elements: 1,
                reflectance,
            }),
        }
    }
    runs
}

/// The reflectance of every element.
pub fn reflectances(runs: &[Run]) -> impl Iterator<Item = Rgb> {
    let of = |run: &Run| Rgb::from_array(run.reflectance.map(|r| f32::from(r) / 65_536.0));
    runs.iter()
        .flat_map(move |run| iter::repeat_n(of(run), run.elements as usize))
}
