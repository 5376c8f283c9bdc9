//! The solution: mesh and contributions in `f32`, as baked, and its file.

mod file;

use glam::Vec3;
use relume::color::Rgb;
use relume::geometry::Polygon;
use relume::mesh::Spacing;
use relume::scene::Luminaire;

pub use file::{FileError, MAGIC, mesh_checksum, read, write};

use crate::mesh::OwnedMesh;

/// How light got from element to element.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// Elements gather what rays bring them, by all threads; lamps shoot rows.
    #[default]
    Gather,
    /// Patches shoot rows of exact form factors, filled by all threads.
    Rows,
    /// The solver alone, serially, by brute force: what a device does. Same bits as [`Self::Rows`],
    /// and the same name in a file.
    Device,
}

impl Method {
    /// The name on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Gather => "gather",
            Self::Rows => "rows",
            Self::Device => "device",
        }
    }

    /// How visibility was found, and why so.
    #[must_use]
    pub const fn rule(self) -> &'static str {
        match self {
            Self::Gather => {
                "lamps by exact form factors, by quarters of them where more than 32 polygons stand between; bounces by \
                 cosine rays of every element: their work grows with the elements alone, and at equal error among a thousand elements they \
                 took less time than rows (`relume study accuracy`)"
            }
            Self::Rows | Self::Device => {
                "lamps and patches by exact form factors, by 16 rays where more than 32 polygons stand between"
            }
        }
    }
}

/// A light of a solution.
#[derive(Clone, Debug, PartialEq)]
pub struct SolutionLight {
    /// Its name.
    pub name: String,
    /// Nominal mix weight.
    pub emission: Rgb,
    /// Unshot over emitted power when the bake ended.
    pub residual: f32,
    /// Estimated relative L1 error of its irradiance at points of the elements: what rays or missing
    /// rows leave, and the size of the elements.
    pub error: f32,
}

/// Contributions of every light to every element, with the mesh that they belong to.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    /// Outlines of all surfaces, lit or not: they hide what is behind them.
    pub surfaces: Vec<Polygon>,
    /// Lights without a surface.
    pub luminaires: Vec<Luminaire>,
    /// Faces, patches and elements; empty for a picture.
    pub mesh: OwnedMesh,
    /// Width and height of the picture whose pixels, row by row from the top, are the elements; what lights contribute is
    /// then radiance. No file of a solution holds one.
    pub image: Option<[u32; 2]>,
    /// The lights, in the order of their tags.
    pub lights: Vec<SolutionLight>,
    /// Irradiance by a light at unit emission, W/m2; element by element, light inside.
    pub contributions: Vec<Rgb>,
    /// The direct part of it, where it was kept apart.
    pub direct: Option<Vec<Rgb>>,
    /// Share of each element that light can reach: what is seen of it is lit by so much more. Empty
    /// where that was not looked for: all can be reached then.
    pub exposed: Vec<f32>,
    /// How the bounces were found.
    pub method: Method,
    /// Rows that the bake evaluated, and passes of rays.
    pub rows: u32,
    /// Longest edges that the mesh was made for, in the scene's units.
    pub spacing: Spacing,
}

impl Solution {
    /// Contributions of lights with these names and nominal emissions, which were not baked here: of elements without a mesh.
    #[must_use]
    pub fn from_contributions(
        lights: impl Iterator<Item = (String, Rgb)>,
        contributions: Vec<Rgb>,
    ) -> Self {
        Self {
            surfaces: Vec::new(),
            luminaires: Vec::new(),
            mesh: OwnedMesh::default(),
            image: None,
            lights: lights
                .map(|(name, emission)| SolutionLight {
                    name,
                    emission,
                    residual: f32::NAN,
                    error: f32::NAN,
                })
                .collect(),
            contributions,
            direct: None,
            exposed: Vec::new(),
            method: Method::default(),
            rows: 0,
            spacing: Spacing {
                patch: f32::NAN,
                element: f32::NAN,
            },
        }
    }

    /// Share of an element that light can reach.
    #[must_use]
    pub fn exposed(&self, element: usize) -> f32 {
        self.exposed.get(element).copied().unwrap_or(1.0)
    }

    /// How many elements there are: those of the mesh, or pixels.
    #[must_use]
    pub fn element_count(&self) -> usize {
        self.image
            .map_or(self.mesh.elements.len(), |[width, height]| {
                width as usize * height as usize
            })
    }

    /// Contributions of all lights to one element; empty for a number out of range.
    #[must_use]
    pub fn element(&self, element: usize) -> &[Rgb] {
        slice_of(&self.contributions, element, self.lights.len())
    }

    /// The direct part of them; `None` when it was not kept apart.
    #[must_use]
    pub fn element_direct(&self, element: usize) -> Option<&[Rgb]> {
        let direct = self.direct.as_ref()?;
        Some(slice_of(direct, element, self.lights.len()))
    }

    /// The mix in which every light has its nominal emission.
    #[must_use]
    pub fn nominal_mix(&self) -> Vec<Rgb> {
        self.lights.iter().map(|light| light.emission).collect()
    }

    /// Irradiance of every element under a mix, W/m2.
    #[must_use]
    pub fn relight(&self, mix: &[Rgb]) -> Vec<Rgb> {
        (0..self.mesh.elements.len())
            .map(|element| {
                let contributions = self.element(element).iter().zip(mix);
                contributions.fold(Rgb::BLACK, |sum, (value, weight)| sum + *value * *weight)
            })
            .collect()
    }

    /// Exitance of every face under a mix, W/m2; black for faces that do not emit.
    #[must_use]
    pub fn face_exitance(&self, mix: &[Rgb]) -> Vec<Rgb> {
        let exitance = |face: &relume::mesh::Face| {
            let emission = face.emission?;
            Some(emission.share * *mix.get(emission.light as usize)?)
        };
        let faces = self.mesh.faces.iter();
        faces.map(|f| exitance(f).unwrap_or_default()).collect()
    }

    /// Two opposite corners of the box around all surfaces; `None` without surfaces.
    #[must_use]
    pub fn bounds(&self) -> Option<(Vec3, Vec3)> {
        let vertices = || self.surfaces.iter().flat_map(|polygon| polygon.vertices());
        let low = vertices().copied().reduce(Vec3::min)?;
        let high = vertices().copied().reduce(Vec3::max)?;
        Some((low, high))
    }
}

fn slice_of(values: &[Rgb], element: usize, lights: usize) -> &[Rgb] {
    let start = element.saturating_mul(lights);
    values
        .get(start..start.saturating_add(lights))
        .unwrap_or_default()
}
