//! From a solution to an atlas and back, and what the packing costs.

use relume::atlas::{
    self, Atlas, AtlasError, Channels, Contents, LightEntry, Quantity, WorstError,
};
use relume::code::{Code, DecodeTable, Scale};
use relume::color::Rgb;
use relume::geometry::Polygon;
use relume::mesh::{Element, Face, Patch, Spacing};
use relume::relight::{RelightError, float_weights, relight};
use thiserror::Error;

use crate::display_error::{max_codes, test_mixes};
use crate::mesh::OwnedMesh;
use crate::picture::white;
use crate::solution::{Method, Solution, SolutionLight};

/// How to pack.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Format {
    /// The code.
    pub code: Code,
    /// One code per contribution or three.
    pub channels: Channels,
    /// Irradiance, or radiosity with the reflectance multiplied in.
    pub quantity: Quantity,
    /// Whether the atlas carries the mesh.
    pub mesh: bool,
}

/// Why a solution was not packed.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum PackError {
    /// The atlas refused.
    #[error(transparent)]
    Atlas(#[from] AtlasError),
    /// A contribution or emission of this light cannot be scaled.
    #[error("light {0:?}: its values leave the range that can be packed; change its emission")]
    Scale(String),
    /// A state of the lights cannot be relit.
    #[error(transparent)]
    Relight(#[from] RelightError),
}

/// Packs a solution; the atlas states what that cost.
///
/// # Errors
/// [`PackError`] when counts or values leave the format's range.
pub fn pack(solution: &Solution, format: Format) -> Result<Vec<u8>, PackError> {
    let (bytes, _) = pack_measured(solution, format)?;
    Ok(bytes)
}

/// The same, with all that was measured.
///
/// # Errors
/// [`PackError`] when counts or values leave the format's range.
pub fn pack_measured(
    solution: &Solution,
    format: Format,
) -> Result<(Vec<u8>, PackingError), PackError> {
    let bare = write(solution, format, None)?;
    let error = packing_error(solution, &Atlas::parse(&bare)?)?;
    let bytes = write(solution, format, Some(&error))?;
    Ok((bytes, error))
}

/// The bytes of an atlas, with its errors once they are known.
fn write(
    solution: &Solution,
    format: Format,
    error: Option<&PackingError>,
) -> Result<Vec<u8>, PackError> {
    let values = packed_values(solution, format.quantity);
    let scales = match format.code {
        Code::Exp8 => common_scales(solution, &values),
        Code::Exp8s => own_scales(solution, &values, format.channels),
    };
    let entries: Vec<LightEntry> = solution
        .lights
        .iter()
        .zip(&scales)
        .map(|(light, scale)| {
            Ok(LightEntry {
                name: &light.name,
                emission: light.emission,
                scale: scale.ok_or_else(|| PackError::Scale(light.name.clone()))?,
            })
        })
        .collect::<Result<_, PackError>>()?;
    let contents = Contents {
        code: format.code,
        channels: format.channels,
        quantity: format.quantity,
        lights: &entries,
        elements: solution.mesh.elements.len() as u32,
        errors: error.map(|error| (error.worst(), &error.per_light[..])),
        mesh: format
            .mesh
            .then(|| (&solution.surfaces[..], solution.mesh.view())),
    };
    let mut bytes = vec![0; atlas::size(&contents)?];
    let lights = solution.lights.len();
    let contribution =
        |element: u32, light: u32| values[element as usize * lights + light as usize];
    atlas::write(&contents, contribution, &mut bytes)?;
    Ok(bytes)
}

/// The contributions, with the reflectance multiplied in for radiosity.
fn packed_values(solution: &Solution, quantity: Quantity) -> Vec<Rgb> {
    let lights = solution.lights.len().max(1);
    let elements = solution.mesh.elements.iter();
    match quantity {
        Quantity::Irradiance => solution.contributions.clone(),
        Quantity::Radiosity => elements
            .zip(solution.contributions.chunks(lights))
            .flat_map(|(element, values)| values.iter().map(|v| *v * element.reflectance))
            .collect(),
    }
}

/// As published: the 98th percentile of the nominal all-on state is 1 for every light, which
/// in units of light `m`, at nominal emission `e_m`, is `p98 / e_m`.
fn common_scales(solution: &Solution, values: &[Rgb]) -> Vec<Option<Scale>> {
    let nominal = solution.nominal_mix();
    let state = values.chunks(nominal.len().max(1)).map(|values| {
        let weighted = values.iter().zip(&nominal);
        weighted.fold(Rgb::BLACK, |sum, (value, weight)| sum + *value * *weight)
    });
    let one = Some(white(state)).filter(|w| *w > 0.0).unwrap_or(1.0);
    nominal
        .iter()
        .map(|emission| {
            let strength = Some(emission.max_channel()).filter(|e| *e > 0.0);
            Scale::at_least(one / strength.unwrap_or(1.0))
        })
        .collect()
}

/// For every light the smallest scale at which none of its values saturates.
fn own_scales(solution: &Solution, values: &[Rgb], channels: Channels) -> Vec<Option<Scale>> {
    let lights = solution.lights.len();
    let mut largest = vec![0.0_f32; lights];
    for element in values.chunks(lights.max(1)) {
        for (largest, value) in largest.iter_mut().zip(element) {
            *largest = largest.max(match channels {
                Channels::Luminance => value.luminance(),
                Channels::Rgb => value.max_channel(),
            });
        }
    }
    largest.into_iter().map(Scale::fitting).collect()
}

/// Irradiance (or radiosity, whichever it holds) of every element of an atlas under a mix.
///
/// # Errors
/// [`RelightError`] for a mix that does not fit the atlas.
pub fn relight_atlas(atlas: &Atlas, mix: &[Rgb]) -> Result<Vec<Rgb>, RelightError> {
    let mut weights = vec![Rgb::BLACK; atlas.light_count() as usize];
    let mut relit = vec![Rgb::BLACK; atlas.element_count() as usize];
    float_weights(atlas, mix, &mut weights)?;
    relight(atlas, &DecodeTable::new(), &weights, &mut relit)?;
    Ok(relit)
}

/// The solution that an atlas still holds: decoded contributions and, if it carries one, the mesh,
/// with one patch per face.
#[must_use]
pub fn unpack(atlas: &Atlas) -> Solution {
    let table = DecodeTable::new();
    let lights: Vec<_> = atlas.lights().collect();
    let per_light = atlas.channels().count();
    let contributions = (0..atlas.element_count())
        .flat_map(|element| {
            let codes = atlas.codes(element).chunks(per_light);
            codes.zip(&lights).map(|(codes, light)| {
                let value = |channel: usize| table.decode(codes[channel.min(per_light - 1)]);
                Rgb::new(value(0), value(1), value(2)) * light.scale.value()
            })
        })
        .collect();
    let (surfaces, mesh) = unpack_mesh(atlas);
    let exposed = vec![1.0; mesh.elements.len()];
    Solution {
        surfaces,
        luminaires: Vec::new(),
        mesh,
        lights: lights
            .iter()
            .map(|light| SolutionLight {
                name: light.name.to_owned(),
                emission: light.emission,
                residual: f32::NAN,
                error: f32::NAN,
            })
            .collect(),
        contributions,
        direct: None,
        exposed,
        method: Method::default(),
        rows: 0,
        spacing: Spacing {
            patch: f32::NAN,
            element: f32::NAN,
        },
    }
}

fn unpack_mesh(atlas: &Atlas) -> (Vec<Polygon>, OwnedMesh) {
    let Some(stored) = atlas.mesh() else {
        return (Vec::new(), OwnedMesh::default());
    };
    let surfaces = (0..stored.surface_count()).filter_map(|s| stored.surface(s));
    let stored_elements: Vec<_> = (0..stored.element_count())
        .filter_map(|element| stored.element(element))
        .collect();
    let mut mesh = OwnedMesh::default();
    let mut first_element = 0;
    for (face, number) in (0..stored.face_count())
        .filter_map(|f| stored.face(f))
        .zip(0..)
    {
        let own = stored_elements[first_element..]
            .iter()
            .take_while(|element| element.face == number);
        let element_count = own.count();
        mesh.faces.push(Face {
            surface: face.surface,
            side: face.side,
            polygon: face.polygon,
            emission: face.emission,
            first_element: first_element as u32,
            element_count: element_count as u32,
        });
        mesh.patches.push(Patch {
            face: number,
            from: glam::Vec2::ZERO,
            to: glam::Vec2::ONE,
            area: face.polygon.area(),
        });
        first_element += element_count;
    }
    for element in &stored_elements {
        let outline = mesh.faces[element.face as usize].polygon;
        mesh.elements.push(Element {
            patch: element.face,
            from: element.from,
            to: element.to,
            area: outline.part(element.from, element.to).area(),
            reflectance: element.reflectance,
        });
    }
    (surfaces.collect(), mesh)
}

/// Errors of an atlas against its solution, in display codes.
#[derive(Clone, Debug, PartialEq)]
pub struct PackingError {
    /// Largest over all states, of what is packed.
    pub codes: f32,
    /// The state in which it occurs.
    pub worst_state: String,
    /// Largest over all states, of what is shown.
    pub codes_shown: f32,
    /// Largest with each light alone, in their order.
    pub per_light: Vec<f32>,
}

impl PackingError {
    /// What the atlas states of it.
    const fn worst(&self) -> WorstError {
        WorstError {
            packed: self.codes,
            shown: self.codes_shown,
        }
    }
}

/// Compares an atlas with the solution that it was packed from, over the mixes of [`test_mixes`].
///
/// # Errors
/// [`RelightError`] when the atlas belongs to another solution.
pub fn packing_error(solution: &Solution, atlas: &Atlas) -> Result<PackingError, RelightError> {
    let names: Vec<&str> = solution.lights.iter().map(|l| l.name.as_str()).collect();
    let values = packed_values(solution, atlas.quantity());
    let lights = solution.lights.len();
    let mut worst = PackingError {
        codes: 0.0,
        worst_state: String::new(),
        codes_shown: 0.0,
        per_light: Vec::new(),
    };
    let decoded = unpack(atlas).contributions;
    let mut all = vec![Rgb::BLACK; lights];
    for (state, number) in test_mixes(&solution.nominal_mix(), &names)
        .into_iter()
        .zip(0..)
    {
        let range = state.first..state.first + state.weights.len();
        let relit = |values: &[Rgb]| -> Vec<Rgb> {
            values
                .chunks(lights.max(1))
                .map(|values| {
                    let weighted = values[range.clone()].iter().zip(&state.weights);
                    weighted.fold(Rgb::BLACK, |sum, (value, weight)| sum + *value * *weight)
                })
                .collect()
        };
        let exact = relit(&values);
        // One light alone needs no kernel, which would read the codes of all the others.
        let found = if state.weights.len() == lights {
            relight_atlas(atlas, &state.weights)?
        } else {
            relit(&decoded)
        };
        let codes = max_codes(&exact, &found);
        all[range.clone()].copy_from_slice(&state.weights);
        let exitance = solution.face_exitance(&all);
        all[range].fill(Rgb::BLACK);
        let shown = |state: &[Rgb]| shown(solution, atlas.quantity(), state, &exitance);
        worst.codes_shown = worst
            .codes_shown
            .max(max_codes(&shown(&exact), &shown(&found)));
        if codes > worst.codes || worst.worst_state.is_empty() {
            worst.codes = codes;
            worst.worst_state = state.name;
        }
        if (1..=lights).contains(&number) {
            worst.per_light.push(codes);
        }
    }
    Ok(worst)
}

/// `M + rho E` of every element.
fn shown(solution: &Solution, quantity: Quantity, state: &[Rgb], exitance: &[Rgb]) -> Vec<Rgb> {
    let mesh = &solution.mesh;
    let elements = mesh.elements.iter().zip(state);
    elements
        .map(|(element, value)| {
            let face = mesh.patches[element.patch as usize].face;
            let reflected = match quantity {
                Quantity::Irradiance => element.reflectance * *value,
                Quantity::Radiosity => *value,
            };
            exitance[face as usize] + reflected
        })
        .collect()
}
