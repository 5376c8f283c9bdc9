//! The bytes of a `.solution` file.
//!
//! Version 1, little-endian: `RELUMESO`, `u16` version, `u16` flags (1: direct light is kept
//! apart, 2: bounces were found by rows, 4: light cannot reach all of some elements; the others are 0), five `u32` counts (surfaces, faces, patches, elements, lights), `u32` rows evaluated,
//! `2 f32` spacing (patch, element); then
//!
//! | part | each |
//! | --- | --- |
//! | surfaces | `u32` vertex count, that many `3 f32` |
//! | faces | `u32` surface, `u32` side (0 front, 1 back), `u32` light (all ones: none), `3 f32` share, `u32` first element, `u32` element count |
//! | patches | `u32` face, `4 f32` parameter corners |
//! | elements | `u32` patch, `4 f32` parameter corners, `3 f32` reflectance |
//! | lights | `u32` length of the name, the name in UTF-8, `3 f32` nominal emission, `f32` residual, `f32` estimated error |
//! | luminaires | `u32` light, `3 f32` share, `u32` kind (0 point, 1 smooth spot, 2 linear spot, 3 sun, 4 sky), `3 f32` position, `3 f32` direction, `2 f32` angles (inner and outer, or diameter); 0 where the kind has none |
//! | contributions | `3 f32` per element and light, light inside |
//! | direct part | likewise, with flag 1 |
//! | exposed shares | `f32` per element, with flag 4; 1 without |
//!
//! Faces stand in the order of their surfaces, front before back, and without a light their share is
//! 0; patches and elements stand face by face, each face's elements where it says.
//!
//! At the end stands a CRC-32 (ISO-HDLC) of everything before it, `u32`. Areas are computed again when read.

use crc::{CRC_32_ISO_HDLC, Crc};
use glam::{Vec2, Vec3};
use relume::color::{Reflectance, Rgb};
use relume::geometry::Polygon;
use relume::mesh::{Element, Face, Patch, Side, Spacing};
use relume::scene::{Emission, Falloff, Luminaire, Source};
use thiserror::Error;

use super::{Method, Solution, SolutionLight};
use crate::mesh::OwnedMesh;

/// How a solution file starts.
pub const MAGIC: [u8; 8] = *b"RELUMESO";
const VERSION: u16 = 1;
const HAS_DIRECT: u16 = 1;
const HAS_ROWS: u16 = 2;
const HAS_EXPOSED: u16 = 4;
const POINT: u32 = 0;
const SMOOTH_SPOT: u32 = 1;
const LINEAR_SPOT: u32 = 2;
const SUN: u32 = 3;
const SKY: u32 = 4;
const NO_LIGHT: u32 = u32::MAX;
const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// Why bytes are no solution.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum FileError {
    /// The bytes do not start like a solution.
    #[error("this is not a solution; make one with `relume bake`")]
    NotASolution,
    /// Written in another version of the format than this one knows.
    #[error("solution version {0} is not the {VERSION} known here; update relume or bake again")]
    Version(u16),
    /// The file ends too early.
    #[error("the file is cut off in its {0}; bake or copy it again")]
    Truncated(&'static str),
    /// The file goes on after its end.
    #[error("{0} bytes follow after the end; bake or copy it again")]
    Oversized(usize),
    /// The checksum does not match.
    #[error("the checksum does not match: the file was damaged; bake or copy it again")]
    Checksum,
    /// A value makes no sense.
    #[error("illegal {what} {index}; bake it again")]
    Illegal {
        /// Kind of record.
        what: &'static str,
        /// Its number.
        index: usize,
    },
}

/// A solution as bytes.
#[must_use]
pub fn write(solution: &Solution) -> Vec<u8> {
    let mut output = Output(MAGIC.to_vec());
    let mesh = &solution.mesh;
    let mut flags = 0;
    if solution.direct.is_some() {
        flags |= HAS_DIRECT;
    }
    if solution.method != Method::Gather {
        flags |= HAS_ROWS;
    }
    if !solution.exposed.is_empty() {
        flags |= HAS_EXPOSED;
    }
    output.0.extend(VERSION.to_le_bytes());
    output.0.extend(flags.to_le_bytes());
    for count in [
        solution.surfaces.len(),
        mesh.faces.len(),
        mesh.patches.len(),
        mesh.elements.len(),
        solution.lights.len(),
        solution.luminaires.len(),
    ] {
        output.u32(count as u32);
    }
    output.u32(solution.rows);
    output.f32s(&[solution.spacing.patch, solution.spacing.element]);
    write_surfaces(&solution.surfaces, &mut output);
    write_mesh(mesh, &mut output);
    for light in &solution.lights {
        output.u32(light.name.len() as u32);
        output.0.extend(light.name.as_bytes());
        output.rgb(light.emission);
        output.f32s(&[light.residual, light.error]);
    }
    for luminaire in &solution.luminaires {
        write_luminaire(luminaire, &mut output);
    }
    for value in solution
        .contributions
        .iter()
        .chain(solution.direct.iter().flatten())
    {
        output.rgb(*value);
    }
    if !solution.exposed.is_empty() {
        output.f32s(&solution.exposed);
    }
    output.u32(CRC.checksum(&output.0));
    output.0
}

/// Checksum of the surfaces and the mesh, whatever emits, to tell what belongs to them.
#[must_use]
pub fn mesh_checksum(solution: &Solution) -> u32 {
    let mut mesh = solution.mesh.clone();
    mesh.faces.iter_mut().for_each(|face| face.emission = None);
    let mut output = Output(Vec::new());
    write_surfaces(&solution.surfaces, &mut output);
    write_mesh(&mesh, &mut output);
    CRC.checksum(&output.0)
}

fn write_surfaces(surfaces: &[Polygon], output: &mut Output) {
    for polygon in surfaces {
        output.u32(polygon.vertices().len() as u32);
        for vertex in polygon.vertices() {
            output.f32s(&vertex.to_array());
        }
    }
}

fn write_mesh(mesh: &OwnedMesh, output: &mut Output) {
    for face in &mesh.faces {
        output.u32(face.surface);
        output.u32(match face.side {
            Side::Front => 0,
            Side::Back => 1,
        });
        output.u32(face.emission.map_or(NO_LIGHT, |emission| emission.light));
        output.rgb(face.emission.map_or(Rgb::BLACK, |emission| emission.share));
        output.u32(face.first_element);
        output.u32(face.element_count);
    }
    for patch in &mesh.patches {
        output.u32(patch.face);
        output.f32s(&patch.from.to_array());
        output.f32s(&patch.to.to_array());
    }
    for element in &mesh.elements {
        output.u32(element.patch);
        output.f32s(&element.from.to_array());
        output.f32s(&element.to.to_array());
        output.rgb(element.reflectance);
    }
}

fn write_luminaire(luminaire: &Luminaire, output: &mut Output) {
    output.u32(luminaire.light());
    output.rgb(luminaire.share());
    let zero = Vec3::ZERO;
    let (kind, position, direction, angles) = match *luminaire.source() {
        Source::Point { position } => (POINT, position, zero, [0.0; 2]),
        Source::Spot {
            position,
            direction,
            inner,
            outer,
            falloff,
        } => {
            let kind = match falloff {
                Falloff::Smooth => SMOOTH_SPOT,
                Falloff::Linear => LINEAR_SPOT,
            };
            (kind, position, direction, [inner, outer])
        }
        Source::Sun { direction, angle } => (SUN, zero, direction, [angle, 0.0]),
        Source::Sky => (SKY, zero, zero, [0.0; 2]),
    };
    output.u32(kind);
    output.f32s(&position.to_array());
    output.f32s(&direction.to_array());
    output.f32s(&angles);
}

struct Output(Vec<u8>);

impl Output {
    fn u32(&mut self, value: u32) {
        self.0.extend(value.to_le_bytes());
    }

    fn f32s(&mut self, values: &[f32]) {
        values
            .iter()
            .for_each(|value| self.0.extend(value.to_le_bytes()));
    }

    fn rgb(&mut self, value: Rgb) {
        self.f32s(&value.to_array());
    }
}

/// A solution from bytes.
///
/// # Errors
/// [`FileError`] for anything that [`write()`] does not write.
pub fn read(bytes: &[u8]) -> Result<Solution, FileError> {
    if !bytes.starts_with(&MAGIC) {
        return Err(FileError::NotASolution);
    }
    let mut input = Input::new(&bytes[MAGIC.len()..]);
    let version = u16::from_le_bytes(input.take()?);
    if version != VERSION {
        return Err(FileError::Version(version));
    }
    let flags = u16::from_le_bytes(input.take()?);
    if flags & !(HAS_DIRECT | HAS_ROWS | HAS_EXPOSED) != 0 {
        let index = usize::from(flags);
        return Err(FileError::Illegal {
            what: "flags",
            index,
        });
    }
    let counts = Counts {
        surfaces: input.u32()? as usize,
        faces: input.u32()? as usize,
        patches: input.u32()? as usize,
        elements: input.u32()? as usize,
        lights: input.u32()? as usize,
        luminaires: input.u32()? as usize,
    };
    let rows = input.u32()?;
    let spacing = Spacing {
        patch: input.f32()?,
        element: input.f32()?,
    };
    let surfaces = input.table("surfaces", counts.surfaces, 40, Input::surface)?;
    let mesh = read_mesh(&mut input, &counts, &surfaces)?;
    let lights = input.table("lights", counts.lights, 24, Input::light)?;
    let luminaires = input.table("luminaires", counts.luminaires, 52, |input| {
        input.luminaire(counts.lights)
    })?;
    let values = counts.elements.saturating_mul(counts.lights);
    let contributions = input.table("contributions", values, 12, Input::legal_rgb)?;
    let direct = if flags & HAS_DIRECT == 0 {
        None
    } else {
        Some(input.table("direct light", values, 12, Input::legal_rgb)?)
    };
    let exposed = if flags & HAS_EXPOSED == 0 {
        Vec::new()
    } else {
        input.table("exposed shares", counts.elements, 4, |input| {
            let share = input.f32()?;
            Ok(Some(share).filter(|share| *share > 0.0 && *share <= 1.0))
        })?
    };

    input.part = "checksum";
    let covered = bytes.len() - input.rest.len();
    let checksum = input.u32()?;
    if !input.rest.is_empty() {
        return Err(FileError::Oversized(input.rest.len()));
    }
    if CRC.checksum(&bytes[..covered]) != checksum {
        return Err(FileError::Checksum);
    }
    Ok(Solution {
        surfaces,
        luminaires,
        mesh,
        image: None,
        lights,
        contributions,
        direct,
        exposed,
        method: if flags & HAS_ROWS == 0 {
            Method::Gather
        } else {
            Method::Rows
        },
        rows,
        spacing,
    })
}

struct Counts {
    surfaces: usize,
    faces: usize,
    patches: usize,
    elements: usize,
    lights: usize,
    luminaires: usize,
}

fn read_mesh(
    input: &mut Input,
    counts: &Counts,
    surfaces: &[Polygon],
) -> Result<OwnedMesh, FileError> {
    let mut first_element = 0_u32;
    let mut last = None;
    let faces = input.table("faces", counts.faces, 32, |input| {
        let face = input.face(surfaces, counts.lights)?;
        let in_order = |face: &Face| {
            let place = Some((face.surface, face.side == Side::Back));
            face.first_element == first_element && std::mem::replace(&mut last, place) < place
        };
        let Some(face) = face.filter(in_order) else {
            return Ok(None);
        };
        first_element = first_element.saturating_add(face.element_count);
        Ok(Some(face))
    })?;
    let mut least = 0;
    let patches = input.table("patches", counts.patches, 20, |input| {
        let face = input.u32()?;
        let corners = input.corners()?;
        let in_order = face >= least;
        least = face;
        let outline = faces.get(face as usize).filter(|_| in_order);
        let outline = outline.map(|face| &face.polygon);
        Ok(corners.zip(outline).map(|((from, to), outline)| Patch {
            face,
            from,
            to,
            area: outline.part(from, to).area(),
        }))
    })?;
    let mut number = 0..;
    let elements = input.table("elements", counts.elements, 32, |input| {
        let patch = input.u32()?;
        let corners = input.corners()?;
        let reflectance = Reflectance::new(input.rgb()?);
        let face = patches.get(patch as usize).map(|patch| patch.face);
        let face = face.and_then(|face| faces.get(face as usize));
        let number = number.next();
        let owns = |face: &&Face| number.is_some_and(|n| face.element_range().contains(&n));
        let outline = face.filter(owns).map(|face| &face.polygon);
        let parts = corners.zip(outline).zip(reflectance);
        Ok(parts.map(|(((from, to), outline), reflectance)| Element {
            patch,
            from,
            to,
            area: outline.part(from, to).area(),
            reflectance: reflectance.get(),
        }))
    })?;
    if first_element as usize != elements.len() {
        return Err(FileError::Illegal {
            what: "element count of face",
            index: faces.len().saturating_sub(1),
        });
    }
    Ok(OwnedMesh {
        faces,
        patches,
        elements,
    })
}

/// Bytes that are still to be read, and the part that they belong to.
struct Input<'a> {
    rest: &'a [u8],
    part: &'static str,
}

impl<'a> Input<'a> {
    const fn new(rest: &'a [u8]) -> Self {
        Self {
            rest,
            part: "header",
        }
    }

    /// Reads `count` records of at least `bytes` each; `None` from `read` is an illegal record.
    fn table<T>(
        &mut self,
        part: &'static str,
        count: usize,
        bytes: usize,
        mut read: impl FnMut(&mut Self) -> Result<Option<T>, FileError>,
    ) -> Result<Vec<T>, FileError> {
        self.part = part;
        // A damaged count must not reserve memory that the file cannot fill.
        if count.saturating_mul(bytes) > self.rest.len() {
            return Err(FileError::Truncated(part));
        }
        let mut table = Vec::with_capacity(count);
        for index in 0..count {
            let illegal = FileError::Illegal { what: part, index };
            table.push(read(self)?.ok_or(illegal)?);
        }
        Ok(table)
    }

    fn bytes(&mut self, count: usize) -> Result<&'a [u8], FileError> {
        let split = self.rest.split_at_checked(count);
        let (head, tail) = split.ok_or(FileError::Truncated(self.part))?;
        self.rest = tail;
        Ok(head)
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N], FileError> {
        let (head, tail) = self
            .rest
            .split_first_chunk::<N>()
            .ok_or(FileError::Truncated(self.part))?;
        self.rest = tail;
        Ok(*head)
    }

    fn u32(&mut self) -> Result<u32, FileError> {
        self.take().map(u32::from_le_bytes)
    }

    fn f32(&mut self) -> Result<f32, FileError> {
        self.take().map(f32::from_le_bytes)
    }

    fn rgb(&mut self) -> Result<Rgb, FileError> {
        Ok(Rgb::new(self.f32()?, self.f32()?, self.f32()?))
    }

    fn legal_rgb(&mut self) -> Result<Option<Rgb>, FileError> {
        Ok(Some(self.rgb()?).filter(|value| value.is_legal()))
    }

    fn corners(&mut self) -> Result<Option<(Vec2, Vec2)>, FileError> {
        let corners = [self.f32()?, self.f32()?, self.f32()?, self.f32()?];
        let [from_s, from_t, to_s, to_t] = corners;
        let is_legal = corners.iter().all(|c| (0.0..=1.0).contains(c));
        Ok(is_legal.then(|| (Vec2::new(from_s, from_t), Vec2::new(to_s, to_t))))
    }

    fn surface(&mut self) -> Result<Option<Polygon>, FileError> {
        let mut vertices = Vec::with_capacity(4);
        for _ in 0..self.u32()?.min(5) {
            vertices.push(Vec3::new(self.f32()?, self.f32()?, self.f32()?));
        }
        Ok(Polygon::new(&vertices).ok())
    }

    fn face(&mut self, surfaces: &[Polygon], lights: usize) -> Result<Option<Face>, FileError> {
        let surface = self.u32()?;
        let side = match self.u32()? {
            0 => Some(Side::Front),
            1 => Some(Side::Back),
            _ => None,
        };
        let light = self.u32()?;
        let share = self.rgb()?;
        let (first_element, element_count) = (self.u32()?, self.u32()?);
        let is_legal = match light {
            NO_LIGHT => share == Rgb::BLACK,
            _ => share.is_legal() && (light as usize) < lights,
        };
        let outline = surfaces.get(surface as usize).filter(|_| is_legal);
        Ok(outline.zip(side).map(|(outline, side)| Face {
            surface,
            side,
            polygon: match side {
                Side::Front => *outline,
                Side::Back => outline.flipped(),
            },
            emission: (light != NO_LIGHT).then_some(Emission { light, share }),
            first_element,
            element_count,
        }))
    }

    fn light(&mut self) -> Result<Option<SolutionLight>, FileError> {
        let length = self.u32()? as usize;
        let name = std::str::from_utf8(self.bytes(length)?).ok();
        let emission = self.rgb()?;
        let (residual, error) = (self.f32()?, self.f32()?);
        let name = name.filter(|_| emission.is_legal());
        Ok(name.map(|name| SolutionLight {
            name: name.to_owned(),
            emission,
            residual,
            error,
        }))
    }

    fn luminaire(&mut self, lights: usize) -> Result<Option<Luminaire>, FileError> {
        let light = self.u32()?;
        let (share, kind) = (self.rgb()?, self.u32()?);
        let mut vector = || Ok(Vec3::new(self.f32()?, self.f32()?, self.f32()?));
        let (position, direction) = (vector()?, vector()?);
        let angles = [self.f32()?, self.f32()?];
        let [inner, outer] = angles;
        let source = match kind {
            POINT => Source::Point { position },
            SMOOTH_SPOT | LINEAR_SPOT => Source::Spot {
                position,
                direction,
                inner,
                outer,
                falloff: if kind == LINEAR_SPOT {
                    Falloff::Linear
                } else {
                    Falloff::Smooth
                },
            },
            SUN => Source::Sun {
                direction,
                angle: inner,
            },
            SKY => Source::Sky,
            _ => return Ok(None),
        };
        let luminaire = Luminaire::new(light, share, source).ok();
        Ok(luminaire.filter(|_| (light as usize) < lights))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bake::{Settings, bake};
    use crate::builtin;
    use std::ops::ControlFlow;

    fn sample(split_direct: bool) -> Solution {
        let settings = Settings {
            split_direct,
            patch: Some(1.0),
            element: Some(1.0),
            residual: 0.1,
            ..Settings::default()
        };
        let scene = builtin::paper_room(builtin::PaperLamps::Three)
            .unwrap()
            .scene;
        bake(&scene, &settings, &mut |_| ControlFlow::Continue(())).unwrap()
    }

    #[test]
    fn what_was_written_is_read() {
        for split_direct in [false, true] {
            let mut solution = sample(split_direct);
            assert_eq!(read(&write(&solution)).as_ref(), Ok(&solution));
            solution.exposed[3] = 0.25;
            assert_eq!(read(&write(&solution)), Ok(solution));
        }
    }

    #[test]
    fn every_truncation_and_every_damaged_byte_is_an_error() {
        let bytes = write(&sample(true));
        for length in 0..bytes.len() {
            assert!(read(&bytes[..length]).is_err(), "{length} bytes");
        }
        let mut longer = bytes.clone();
        longer.push(0);
        assert_eq!(read(&longer), Err(FileError::Oversized(1)));
        for at in 0..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[at] ^= 0x55;
            assert!(read(&damaged).is_err(), "byte {at}");
        }
    }

    /// Changes at the offsets that the format documents, with a right checksum.
    #[test]
    fn what_the_format_does_not_allow_is_an_error() {
        let solution = sample(false);
        let sound = write(&solution);
        let surfaces = solution.surfaces.iter();
        let faces = 48 + surfaces.map(|s| 4 + 12 * s.vertices().len()).sum::<usize>();
        let patches = faces + 32 * solution.mesh.faces.len();
        let elements = patches + 20 * solution.mesh.patches.len();
        let lights = elements + 32 * solution.mesh.elements.len();
        let first = solution.mesh.faces[0];
        let last_element = first.element_count as usize - 1;
        let last_patch = solution.mesh.patches.len() as u32 - 1;
        let black = solution
            .mesh
            .faces
            .iter()
            .position(|f| f.emission.is_none());
        let unlit = faces + 32 * black.unwrap();
        for (at, value, what, index) in [
            (10, [8, 0, 0, 0], "flags", 8),
            (faces, [200, 0, 0, 0], "faces", 0),
            (faces + 4, [2, 0, 0, 0], "faces", 0),
            (faces + 24, [1, 0, 0, 0], "faces", 0),
            (faces + 32, first.surface.to_le_bytes(), "faces", 1),
            (unlit + 12, 1_f32.to_le_bytes(), "faces", black.unwrap()),
            (patches, [1, 0, 0, 0], "patches", 1),
            (patches + 4, 2_f32.to_le_bytes(), "patches", 0),
            (
                elements + 32 * last_element,
                last_patch.to_le_bytes(),
                "elements",
                last_element,
            ),
            (elements + 20, 1_f32.to_le_bytes(), "elements", 0),
            (lights + 4, [0xff; 4], "lights", 0),
        ] {
            let mut forged = sound.clone();
            let width = if at == 10 { 2 } else { 4 };
            forged[at..at + width].copy_from_slice(&value[..width]);
            let end = forged.len() - 4;
            let sum = CRC.checksum(&forged[..end]);
            forged[end..].copy_from_slice(&sum.to_le_bytes());
            assert_eq!(
                read(&forged),
                Err(FileError::Illegal { what, index }),
                "byte {at}: {value:?}"
            );
        }
    }
}
