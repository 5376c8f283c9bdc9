//! Writes an atlas into the caller's slice.

use super::{
    Atlas, AtlasError, AtlasMesh, CHECKSUM_AT, CountsOf, FACES_AT, HEADER_BYTES, LARGEST_TILE_CODE,
    LENGTH_AT, LIGHT_STEPS_BYTES, MAGIC, NO_LIGHT, NOT_MEASURED, Quantity, STEPS_BYTES,
    SURFACES_AT, VERSION, WorstError, checksum,
};
use crate::code::{AllCodes, Code, Curve, LARGEST_PART_FIRST, LARGEST_PART_UNIT, PARTS, Scale};
use crate::color::Rgb;
use crate::geometry::Polygon;
use crate::mesh::{Mesh, Side};

/// Name, nominal emission and code of a light, to be written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightEntry<'a> {
    /// Its name, at most 65 535 bytes.
    pub name: &'a str,
    /// Nominal mix weight, finite and not negative.
    pub emission: Rgb,
    /// What its contributions are written in.
    pub code: Code,
    /// What the codes of red, green and blue stand for; luminance takes the first.
    pub curves: [Curve; 3],
    /// The largest code of each channel: 255, or at most [`LARGEST_TILE_CODE`](super::LARGEST_TILE_CODE) in tiles.
    pub last: [u16; 3],
}

impl<'a> LightEntry<'a> {
    /// A light in one of the exponential codes, with one scale for its channels.
    #[must_use]
    pub const fn exponential(name: &'a str, emission: Rgb, code: Code, scale: Scale) -> Self {
        Self {
            name,
            emission,
            code,
            curves: [Curve::Exponential { scale }; 3],
            last: [u8::MAX as u16; 3],
        }
    }
}

/// What an atlas is made of, besides the contributions.
#[derive(Clone, Copy, Debug)]
pub struct Contents<'a> {
    /// What the contributions measure.
    pub quantity: Quantity,
    /// The lights, in the order of their tags.
    pub lights: &'a [LightEntry<'a>],
    /// How many elements there are.
    pub elements: u32,
    /// Width of the image whose pixels, row by row from the top, are the elements; 0 without one.
    pub image_width: u16,
    /// What packing cost: the worst, and that of every light alone (see
    /// [`AtlasLight::error`](super::AtlasLight::error)); `None` when nobody measured it.
    pub errors: Option<(WorstError, &'a [f32])>,
    /// The table of tiles with the codes of all lights in tiles ([`Tiles`](super::Tiles)); empty without such a light.
    pub tiles: &'a [u8],
    /// Outlines of all surfaces and the mesh, for drawing and probing by place; `None` saves their bytes.
    pub mesh: Option<(&'a [Polygon], Mesh<'a>)>,
}

impl Contents<'_> {
    /// Bytes of steps per light, behind the records of all.
    fn steps(&self) -> usize {
        if self.lights.iter().any(|l| l.code == Code::Display8) {
            LIGHT_STEPS_BYTES
        } else {
            0
        }
    }

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
        if self.lights.is_empty() {
            return Err(AtlasError::Unfit("elements without a light"));
        }
        let width = u32::from(self.image_width);
        if width > 0 && (self.mesh.is_some() || !self.elements.is_multiple_of(width)) {
            return Err(AtlasError::Unfit(
                "an image with a mesh, or of rows that are not full",
            ));
        }
        if self
            .errors
            .is_some_and(|(_, e)| e.len() != self.lights.len())
        {
            return Err(AtlasError::Unfit("errors of other lights than its own"));
        }
        Ok(CountsOf {
            elements: self.elements,
            lights: count(self.lights.len(), "2^32 lights; use fewer")?,
            names: count(names, "names of 4 GiB; shorten them")?,
            tiles: count(self.tiles.len(), "4 GiB of tiles; use longer elements")?,
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
    let stride = contents.lights.iter().map(|l| l.code.bytes() as u64);
    let layout = contents.counts()?.layout(stride.sum(), contents.steps());
    layout
        .filter(|layout| layout.end <= u64::from(u32::MAX))
        .and_then(|layout| usize::try_from(layout.end).ok())
        .ok_or(AtlasError::Unfit(
            "more than 4 GiB; use longer elements or fewer lights",
        ))
}

/// Writes an atlas to the start of `out`; `contribution(element, light)` is in W/m2 at unit
/// emission, and is asked for the lights that are not in tiles. Returns its length.
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
    // There may be millions of lights in tiles, which have nothing here.
    let is_fixed = |light: &LightEntry| !light.code.is_tiled();
    if contents.lights.iter().any(is_fixed) {
        for element in 0..contents.elements {
            for (light, tag) in contents.lights.iter().zip(0..) {
                if is_fixed(light) {
                    codes(light, contribution(element, tag), &mut output)?;
                }
            }
        }
    }
    output.put(contents.tiles)?;
    if let Some((surfaces, mesh)) = contents.mesh {
        mesh_parts(surfaces, mesh, &mut output)?;
    }

    put_checksum(bytes)?;
    Ok(needed)
}

/// Writes the atlas of some bytes without its mesh to the start of `out`. Returns its length.
///
/// # Errors
/// What [`Atlas::parse`] says of the bytes; [`AtlasError::Full`] when `out` is too short, and then holds nothing of use.
pub fn write_without_mesh(bytes: &[u8], out: &mut [u8]) -> Result<usize, AtlasError> {
    let atlas = Atlas::parse(bytes)?;
    let mesh = atlas.mesh();
    let needed = bytes.len() - mesh.as_ref().map_or(0, AtlasMesh::byte_count);
    let out = out.get_mut(..needed).ok_or(AtlasError::Full { needed })?;
    put_at(out, 0, bytes.get(..needed).unwrap_or_default())?;
    if mesh.is_some() {
        for (at, value) in [(LENGTH_AT, needed as u32), (SURFACES_AT, 0), (FACES_AT, 0)] {
            put_at(out, at, &value.to_le_bytes())?;
        }
        put_checksum(out)?;
    }
    Ok(needed)
}

fn put_checksum(bytes: &mut [u8]) -> Result<(), AtlasError> {
    let needed = HEADER_BYTES;
    let sum = checksum::<AllCodes>(bytes).ok_or(AtlasError::Full { needed })?;
    put_at(bytes, CHECKSUM_AT, &sum.to_le_bytes())
}

fn put_at(bytes: &mut [u8], at: usize, value: &[u8]) -> Result<(), AtlasError> {
    let rest = bytes.get_mut(at..).unwrap_or_default();
    Output { rest }.put(value)
}

/// The codes of one contribution.
fn codes(light: &LightEntry, value: Rgb, output: &mut Output) -> Result<(), AtlasError> {
    let encode = |channel: usize, value: f32| {
        let curve = light.curves.get(channel).zip(light.last.get(channel));
        // Only tiles have codes beyond a byte, see `put_curve`.
        curve.map_or(0, |(curve, last)| curve.encode(value, *last) as u8)
    };
    if light.code == Code::Lum8 {
        return output.put(&[encode(0, value.luminance())]);
    }
    let [r, g, b] = value.to_array();
    output.put(&[encode(0, r), encode(1, g), encode(2, b)])
}

fn header(contents: &Contents, length: usize, output: &mut Output) -> Result<(), AtlasError> {
    let counts = contents.counts()?;
    output.put(&MAGIC)?;
    output.put(&VERSION.to_le_bytes())?;
    output.put(&[
        match contents.quantity {
            Quantity::Irradiance => 0,
            Quantity::Radiosity => 1,
            Quantity::Radiance => 2,
        },
        0,
        0,
        0,
    ])?;
    output.put(&contents.image_width.to_le_bytes())?;
    let worst = contents.errors.map(|(worst, _)| worst);
    // `size` has checked that the length fits; the checksum is filled in at the end.
    let rest = [
        length as u32,
        0,
        counts.elements,
        counts.lights,
        counts.names,
        counts.tiles,
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
        let number = Code::ALL.iter().position(|code| *code == light.code);
        output.put(&[number.unwrap_or_default() as u8, 0])?;
        output.put(&length.to_le_bytes())?;
        output.u32(error_bits(error.copied())?)?;
        output.put(&[0, 0])?;
        for (curve, last) in light.curves.iter().zip(light.last) {
            put_curve(light.code, *curve, last, output)?;
        }
    }
    if contents.steps() > 0 {
        let curves = lights.iter().flat_map(|light| &light.curves);
        curves
            .map(|curve| halves(curve).1)
            .try_for_each(|steps| output.put(&steps))?;
    }
    lights
        .iter()
        .try_for_each(|light| output.put(light.name.as_bytes()))
}

fn put_curve(code: Code, curve: Curve, last: u16, output: &mut Output) -> Result<(), AtlasError> {
    let (scale, first, step) = match (code, curve) {
        (Code::Exp8 | Code::Exp8s | Code::Lum8, Curve::Exponential { scale }) => (scale, 0, 0),
        (Code::Display8, Curve::Parts { white, .. }) => (white, 0, 0),
        (Code::Tiles, Curve::Display { white, step }) => (white, 0, step),
        (Code::TilesLog, Curve::Logarithmic { first }) => (Scale::ONE, first, 0),
        _ => return Err(AtlasError::Unfit("a code with the curve of another one")),
    };
    let is_legal = if code.is_tiled() {
        last <= LARGEST_TILE_CODE
    } else {
        last == u16::from(u8::MAX)
    };
    if !is_legal || !curve.reaches::<AllCodes>(last) {
        return Err(AtlasError::Unfit(
            "a contribution beyond its code; change the emission",
        ));
    }
    output.put(&scale.mantissa().to_le_bytes())?;
    output.put(&scale.exponent().to_le_bytes())?;
    if let Curve::Parts { first, unit, .. } = curve {
        let head = first.min(LARGEST_PART_FIRST) | u16::from(unit.min(LARGEST_PART_UNIT)) << 12;
        output.put(&head.to_le_bytes())?;
        return output.put(&halves(&curve).0);
    }
    output.u32(first)?;
    output.u32(step)?;
    output.put(&last.to_le_bytes())
}

/// Both halves of the steps of a curve, which are 0 if it has none.
fn halves(curve: &Curve) -> ([u8; STEPS_BYTES], [u8; STEPS_BYTES]) {
    let steps = match curve {
        Curve::Parts { steps, .. } => *steps,
        _ => [0; PARTS / 2],
    };
    let (first, second) = steps.split_at(STEPS_BYTES);
    let half = |steps: &[u8]| steps.first_chunk().copied().unwrap_or_default();
    (half(first), half(second))
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
