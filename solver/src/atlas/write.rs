//! Writes an atlas into the caller's slice.

use super::{
    AtlasError, CHECKSUM_AT, Channels, CountsOf, HEADER_BYTES, MAGIC, NO_LIGHT, NOT_MEASURED,
    Quantity, VERSION, WorstError, checksum,
};
use crate::code::{Code, Scale, encode};
use crate::color::Rgb;
use crate::geometry::Polygon;
use crate::mesh::{Mesh, Side};

/// Name, nominal emission and scale of a light, to be written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightEntry<'a> {
    /// Its name, at most 65 535 bytes.
    pub name: &'a str,
    /// Nominal mix weight, finite and not negative.
    pub emission: Rgb,
    /// What one unit of the code is worth, at unit emission.
    pub scale: Scale,
}

/// What an atlas is made of, besides the contributions.
#[derive(Clone, Copy, Debug)]
pub struct Contents<'a> {
    /// The code.
    pub code: Code,
    /// One code per contribution or three.
    pub channels: Channels,
    /// What the contributions measure.
    pub quantity: Quantity,
    /// The lights, in the order of their tags.
    pub lights: &'a [LightEntry<'a>],
    /// How many elements there are.
    pub elements: u32,
    /// What packing cost: the worst, and that of every light alone (see
    /// [`AtlasLight::error`](super::AtlasLight::error)); `None` when nobody measured it.
    pub errors: Option<(WorstError, &'a [f32])>,
    /// Outlines of all surfaces and the mesh, for drawing and probing by place; `None` saves their bytes.
    pub mesh: Option<(&'a [Polygon], Mesh<'a>)>,
}

impl Contents<'_> {
    fn counts(&self) -> Result<CountsOf, AtlasError> {
        let count = |n: usize, what| u32::try_from(n).map_err(|_| AtlasError::Unfit(what));
        let names = self.lights.iter().map(|light| light.name.len()).sum();
        let (surfaces, faces) = self
            .mesh
            .map_or((0, 0), |(s, mesh)| (s.len(), mesh.faces.len()));
        if let Some((_, mesh)) = self.mesh
            && mesh.elements.len() != self.elements as usize
        {
            return Err(AtlasError::Unfit("another mesh than that of its elements"));
        }
        if self
            .errors
            .is_some_and(|(_, e)| e.len() != self.lights.len())
        {
            return Err(AtlasError::Unfit("errors of other lights than its own"));
        }
        Ok(CountsOf {
            channels: self.channels,
            elements: self.elements,
            lights: count(self.lights.len(), "2^32 lights; use fewer")?,
            names: count(names, "names of 4 GiB; shorten them")?,
            surfaces: count(surfaces, "2^32 surfaces; use fewer")?,
            faces: count(faces, "2^32 faces; use fewer")?,
        })
    }
}

/// Bytes that [`write()`] needs.
///
/// # Errors
/// [`AtlasError::Unfit`] for counts that the format cannot hold.
pub fn size(contents: &Contents) -> Result<usize, AtlasError> {
    let layout = contents.counts()?.layout();
    layout
        .filter(|layout| layout.end <= u64::from(u32::MAX))
        .and_then(|layout| usize::try_from(layout.end).ok())
        .ok_or(AtlasError::Unfit(
            "more than 4 GiB; use longer elements or fewer lights",
        ))
}

/// Writes an atlas to the start of `out`; `contribution(element, light)` is in W/m2 at unit
/// emission. Returns its length.
///
/// # Errors
/// [`AtlasError::Full`] when `out` is too short, [`AtlasError::Unfit`] for counts, names, emissions
/// or errors that the format cannot hold; `out` then holds nothing of use.
pub fn write(
    contents: &Contents,
    contribution: impl Fn(u32, u32) -> Rgb,
    out: &mut [u8],
) -> Result<usize, AtlasError> {
    let needed = size(contents)?;
    let bytes = out.get_mut(..needed).ok_or(AtlasError::Full { needed })?;
    let mut output = Output { rest: bytes };
    header(contents, needed, &mut output)?;
    lights(contents, &mut output)?;
    for element in 0..contents.elements {
        for (light, tag) in contents.lights.iter().zip(0..) {
            let value = contribution(element, tag) * light.scale.value().recip();
            match contents.channels {
                Channels::Luminance => output.put(&[encode(value.luminance())])?,
                Channels::Rgb => output.put(&value.to_array().map(encode))?,
            }
        }
    }
    if let Some((surfaces, mesh)) = contents.mesh {
        mesh_parts(surfaces, mesh, &mut output)?;
    }

    let sum = checksum(bytes).ok_or(AtlasError::Full { needed })?;
    let mut place = Output {
        rest: bytes.get_mut(CHECKSUM_AT..).unwrap_or_default(),
    };
    place.u32(sum)?;
    Ok(needed)
}

fn header(contents: &Contents, length: usize, output: &mut Output) -> Result<(), AtlasError> {
    let counts = contents.counts()?;
    output.put(&MAGIC)?;
    output.put(&VERSION.to_le_bytes())?;
    output.put(&[
        match contents.code {
            Code::Exp8 => 0,
            Code::Exp8s => 1,
        },
        match contents.channels {
            Channels::Luminance => 1,
            Channels::Rgb => 3,
        },
        match contents.quantity {
            Quantity::Irradiance => 0,
            Quantity::Radiosity => 1,
        },
        0,
        0,
        0,
    ])?;
    let worst = contents.errors.map(|(worst, _)| worst);
    // `size` has checked that the length fits; the checksum is filled in at the end.
    let rest = [
        length as u32,
        0,
        counts.elements,
        counts.lights,
        counts.names,
        counts.surfaces,
        counts.faces,
        error_bits(worst.map(|worst| worst.packed))?,
        error_bits(worst.map(|worst| worst.shown))?,
    ];
    debug_assert_eq!(HEADER_BYTES, 16 + 4 * rest.len());
    rest.iter().try_for_each(|value| output.u32(*value))
}

fn error_bits(error: Option<f32>) -> Result<u32, AtlasError> {
    match error {
        None => Ok(NOT_MEASURED),
        Some(error) if error.is_finite() && error >= 0.0 => Ok(error.to_bits()),
        Some(_) => Err(AtlasError::Unfit(
            "an error that is negative or not finite; measure it again",
        )),
    }
}

fn lights(contents: &Contents, output: &mut Output) -> Result<(), AtlasError> {
    let lights = contents.lights;
    for (light, tag) in lights.iter().zip(0..) {
        if !light.emission.is_legal() {
            return Err(AtlasError::Unfit(
                "an emission that is negative or not finite; correct it",
            ));
        }
        let length = u16::try_from(light.name.len()).map_err(|_| {
            AtlasError::Unfit("the name of a light of more than 65535 bytes; shorten it")
        })?;
        let error = contents.errors.and_then(|(_, errors)| errors.get(tag));
        output.rgb(light.emission)?;
        output.put(&light.scale.mantissa().to_le_bytes())?;
        output.put(&light.scale.exponent().to_le_bytes())?;
        output.put(&length.to_le_bytes())?;
        output.put(&[0, 0])?;
        output.u32(error_bits(error.copied())?)?;
    }
    lights
        .iter()
        .try_for_each(|light| output.put(light.name.as_bytes()))
}

fn mesh_parts(surfaces: &[Polygon], mesh: Mesh, output: &mut Output) -> Result<(), AtlasError> {
    for surface in surfaces {
        let vertices = surface.vertices();
        let padded = vertices.iter().chain(vertices.last()).take(4);
        for vertex in padded {
            output.f32s(&vertex.to_array())?;
        }
        output.u32(vertices.len() as u32)?;
    }
    for face in mesh.faces {
        output.u32(face.surface)?;
        output.u32(match face.side {
            Side::Front => 0,
            Side::Back => 1,
        })?;
        output.u32(face.emission.map_or(NO_LIGHT, |emission| emission.light))?;
        output.rgb(face.emission.map_or(Rgb::BLACK, |emission| emission.share))?;
    }
    for element in mesh.elements {
        let patch = mesh.patches.get(element.patch as usize);
        output.u32(
            patch
                .ok_or(AtlasError::Unfit(
                    "an element without a patch; mesh it again",
                ))?
                .face,
        )?;
        output.f32s(&element.from.to_array())?;
        output.f32s(&element.to.to_array())?;
        output.rgb(element.reflectance)?;
    }
    Ok(())
}

/// Bytes that are still to be written.
struct Output<'a> {
    rest: &'a mut [u8],
}

impl Output<'_> {
    fn put(&mut self, bytes: &[u8]) -> Result<(), AtlasError> {
        let rest = core::mem::take(&mut self.rest);
        let full = AtlasError::Full {
            needed: bytes.len(),
        };
        let (head, tail) = rest.split_at_mut_checked(bytes.len()).ok_or(full)?;
        for (to, from) in head.iter_mut().zip(bytes) {
            *to = *from;
        }
        self.rest = tail;
        Ok(())
    }

    fn u32(&mut self, value: u32) -> Result<(), AtlasError> {
        self.put(&value.to_le_bytes())
    }

    fn f32s(&mut self, values: &[f32]) -> Result<(), AtlasError> {
        values
            .iter()
            .try_for_each(|value| self.put(&value.to_le_bytes()))
    }

    fn rgb(&mut self, value: Rgb) -> Result<(), AtlasError> {
        self.f32s(&value.to_array())
    }
}
