//! Preview: a perspective picture of a relit scene.
//!
//! What is shown is radiance, `L = (rho E + M) / pi` in W/m2/sr: `rho` the reflectance of the
//! element, `E` its irradiance (smoothed over the element, see `shading`, or [`Gathered`] at every
//! pixel) and `M` the exitance of its face. The picture is linear and unexposed, multiplied by its coverage (see `raster`).
//!
//! Sides without a face (unlit ones, which meshes leave out, and the backs of one-sided surfaces)
//! are drawn black, so that they hide what is behind them. From outside the scene's bounding
//! box they are not drawn: so a closed room can be looked into.
//!
//! Assumes that a face's polygon has its front where the face is, as [`relume::mesh`] makes it.

mod camera;
mod fit;
mod layers;
mod raster;
mod shading;
#[cfg(test)]
mod tests;

use std::collections::HashSet;

use glam::Vec3;
use relume::color::Rgb;
use relume::geometry::Polygon;
use relume::mesh::{Mesh, Side};
use tiny_skia::Pixmap;

pub use camera::{Camera, CameraError, MAX_SIDE, Viewpoint};
pub use layers::light_layers;

use crate::picture::{Exposure, LinearImage, PictureError, to_pixmap};
use crate::probe::{Gatherer, Part};
use fit::Bounds;
use raster::View;
use shading::Facet;

/// A scene under one mix.
#[derive(Clone, Copy, Debug)]
pub struct Relit<'a> {
    /// Faces, patches and elements.
    pub mesh: Mesh<'a>,
    /// Outlines of all surfaces, for the sides that are no faces; without them only the backs of
    /// faces are known to hide.
    pub surfaces: &'a [Polygon],
    /// Irradiance of every element, W/m2.
    pub irradiance: &'a [Rgb],
    /// Emitted exitance of every face, W/m2; 0 for ordinary ones.
    pub exitance: &'a [Rgb],
    /// Irradiance better than that of the elements, at every pixel of what stores any.
    pub gathered: Option<Gathered<'a>>,
}

/// Light at points of a solution under one mix.
#[derive(Clone, Copy, Debug)]
pub struct Gathered<'a> {
    /// What finds it.
    pub gatherer: &'a Gatherer<'a>,
    /// One weight for each light.
    pub mix: &'a [Rgb],
}

impl Gathered<'_> {
    /// Irradiance, W/m2, at the point of a side nearest to a position; `seed` turns the rays.
    fn irradiance(&self, (surface, side): (u32, Side), position: Vec3, seed: u64) -> Option<Rgb> {
        let spot = self.gatherer.spot(surface, side, position)?;
        let values = self.gatherer.irradiance(spot, Part::Total, seed);
        let lights = self.mix.iter().zip(values);
        Some(lights.fold(Rgb::BLACK, |sum, (weight, value)| sum + *weight * value))
    }
}

/// Why no picture was made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PreviewError {
    /// Not one irradiance per element, or not one exitance per face.
    #[error("{values} values of {quantity} for {places} {place}")]
    Length {
        /// "irradiance" or "exitance".
        quantity: &'static str,
        /// How many there are.
        values: usize,
        /// "elements" or "faces".
        place: &'static str,
        /// How many there should be.
        places: usize,
    },
    /// The picture itself.
    #[error(transparent)]
    Picture(#[from] PictureError),
}

impl Relit<'_> {
    fn check(&self) -> Result<(), PreviewError> {
        let compare = |quantity, values, place, places| {
            let error = PreviewError::Length {
                quantity,
                values,
                place,
                places,
            };
            if values == places { Ok(()) } else { Err(error) }
        };
        let (elements, faces) = (self.mesh.elements.len(), self.mesh.faces.len());
        compare("irradiance", self.irradiance.len(), "elements", elements)?;
        compare("exitance", self.exitance.len(), "faces", faces)
    }

    /// What the camera may see: elements, faces without elements, and sides without a face.
    fn facets(&self, camera: &Camera) -> Vec<Facet> {
        let faces_eye = |polygon: &Polygon| {
            let (height, tolerance) = polygon.height(camera.eye());
            height > tolerance
        };
        let mut elements = shading::facets(&self.mesh, self.irradiance, self.exitance);
        let mut facets = Vec::new();
        for (face, exitance) in self.mesh.faces.iter().zip(self.exitance) {
            if !faces_eye(&face.polygon) {
                continue;
            }
            if face.element_count == 0 {
                facets.push(match face.emission {
                    Some(_) => Facet::lamp(face.polygon, *exitance),
                    None => Facet::dark(face.polygon),
                });
            }
            for element in face.element_range() {
                let own = elements.get_mut(element as usize);
                facets.extend(own.and_then(Option::take));
            }
        }

        let is_inside = self.bounds().is_some_and(|b| b.contains(camera.eye()));
        if is_inside {
            let dark = self.dark_sides().into_iter().filter(faces_eye);
            facets.extend(dark.map(Facet::dark));
        }
        facets
    }

    /// Polygons of the sides that are no faces, their fronts where they can be seen.
    fn dark_sides(&self) -> Vec<Polygon> {
        let faces = self.mesh.faces.iter();
        let mut known: HashSet<(u32, Side)> = faces.clone().map(|f| (f.surface, f.side)).collect();
        let backs = faces.map(|f| {
            let side = match f.side {
                Side::Front => Side::Back,
                Side::Back => Side::Front,
            };
            ((f.surface, side), f.polygon.flipped())
        });
        let surfaces = self.surfaces.iter().zip(0..).flat_map(|(surface, number)| {
            [
                ((number, Side::Front), *surface),
                ((number, Side::Back), surface.flipped()),
            ]
        });
        surfaces
            .chain(backs)
            .filter_map(|(side, polygon)| known.insert(side).then_some(polygon))
            .collect()
    }

    fn bounds(&self) -> Option<Bounds> {
        let faces = self.mesh.faces.iter().map(|face| &face.polygon);
        Bounds::new(faces.chain(self.surfaces))
    }
}

/// The linear picture, unexposed, in W/m2/sr.
///
/// What is brighter than `brightest` (W/m2/sr, per channel; infinite for a picture to compute
/// with) is cut to it in every sample, before pixels are averaged: with `1 / exposure`, the edges of
/// lamps far beyond white are as smooth as all others.
///
/// # Errors
/// [`PreviewError::Length`].
pub fn render(relit: &Relit, camera: &Camera, brightest: f32) -> Result<LinearImage, PreviewError> {
    relit.check()?;
    let view = View {
        camera,
        facets: &relit.facets(camera),
        gathered: relit.gathered,
    };
    Ok(raster::paint(view, brightest))
}

/// The picture as a screen shows it, over a background in sRGB codes, and the exposure it got, which
/// [`Exposure::Auto`] takes from the irradiance of the elements.
///
/// # Errors
/// [`PreviewError`].
pub fn show(
    relit: &Relit,
    camera: &Camera,
    exposure: Exposure,
    background: [u8; 3],
) -> Result<(Pixmap, f32), PreviewError> {
    relit.check()?;
    let view = View {
        camera,
        facets: &relit.facets(camera),
        gathered: relit.gathered,
    };
    let factor = match exposure {
        Exposure::Auto => {
            let smoothed = View {
                gathered: None,
                ..view
            };
            exposure.factor(&raster::paint(smoothed, f32::INFINITY))
        }
        Exposure::Factor(factor) => factor,
    };
    let image = raster::paint(view, factor.recip());
    Ok((to_pixmap(&image, factor, background)?, factor))
}
