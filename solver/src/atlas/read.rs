//! Reads an atlas in place: everything is checked once, then access is plain slicing.

use glam::{Vec2, Vec3};

use super::{
    AtlasElement, AtlasError, AtlasFace, AtlasLight, CHECKSUM_AT, Channels, CountsOf,
    ELEMENT_BYTES, FACE_BYTES, HEADER_BYTES, LIGHT_BYTES, MAGIC, NO_LIGHT, NOT_MEASURED, Quantity,
    SURFACE_BYTES, VERSION, WorstError, checksum,
};
use crate::code::{Code, Scale};
use crate::color::{Reflectance, Rgb};
use crate::geometry::Polygon;
use crate::mesh::Side;
use crate::scene::Emission;

/// A checked atlas that borrows its bytes.
#[derive(Clone, Copy, Debug)]
pub struct Atlas<'a> {
    code: Code,
    quantity: Quantity,
    counts: CountsOf,
    worst_error: Option<WorstError>,
    lights: &'a [u8],
    names: &'a str,
    codes: &'a [u8],
    mesh: Option<AtlasMesh<'a>>,
}

impl<'a> Atlas<'a> {
    /// Checks `bytes`, which must hold one atlas and nothing else.
    ///
    /// # Errors
    /// [`AtlasError`]: what is wrong with the bytes.
    pub fn parse(bytes: &'a [u8]) -> Result<Self, AtlasError> {
        let header = Header::parse(bytes)?;
        let counts = header.counts;
        let needed = counts.layout().ok_or(AtlasError::Illegal("size"))?;
        if needed.end != u64::from(header.length) {
            return Err(AtlasError::Illegal("length"));
        }
        if (bytes.len() as u64) < needed.end {
            return Err(AtlasError::Truncated { needed: needed.end });
        }
        if bytes.len() as u64 > needed.end {
            return Err(AtlasError::Oversized { needed: needed.end });
        }
        if checksum(bytes) != Some(header.checksum) {
            return Err(AtlasError::Checksum);
        }

        let part = |from: u64, to: u64| bytes.get(from as usize..to as usize).unwrap_or_default();
        let names = core::str::from_utf8(part(needed.names, needed.codes));
        let atlas = Self {
            code: header.code,
            quantity: header.quantity,
            counts,
            worst_error: header.worst_error,
            lights: part(HEADER_BYTES as u64, needed.names),
            names: names.map_err(|_| AtlasError::Illegal("light name"))?,
            codes: part(needed.codes, needed.surfaces),
            mesh: (counts.faces > 0).then(|| AtlasMesh {
                surfaces: part(needed.surfaces, needed.faces),
                faces: part(needed.faces, needed.elements),
                elements: part(needed.elements, needed.end),
            }),
        };
        atlas.check_lights()?;
        if let Some(mesh) = atlas.mesh {
            mesh.check(counts.lights)?;
        }
        Ok(atlas)
    }

    fn check_lights(&self) -> Result<(), AtlasError> {
        let mut named = 0_usize;
        for tag in 0..self.counts.lights {
            let record = LightRecord::parse(record(self.lights, tag, LIGHT_BYTES));
            let record = record.ok_or(AtlasError::Illegal("light"))?;
            if record.error.is_some() != self.worst_error.is_some() {
                return Err(AtlasError::Illegal("error of a light"));
            }
            let end = named + usize::from(record.name_length);
            if self.names.get(named..end).is_none() {
                return Err(AtlasError::Illegal("light name"));
            }
            named = end;
        }
        if named == self.names.len() {
            Ok(())
        } else {
            Err(AtlasError::Illegal("light name"))
        }
    }

    /// The code.
    #[must_use]
    pub const fn code(&self) -> Code {
        self.code
    }

    /// One code per contribution or three.
    #[must_use]
    pub const fn channels(&self) -> Channels {
        self.counts.channels
    }

    /// What the contributions measure.
    #[must_use]
    pub const fn quantity(&self) -> Quantity {
        self.quantity
    }

    /// What packing cost, over all states that were tried; `None` when nobody measured it.
    #[must_use]
    pub const fn worst_error(&self) -> Option<WorstError> {
        self.worst_error
    }

    /// How many elements there are.
    #[must_use]
    pub const fn element_count(&self) -> u32 {
        self.counts.elements
    }

    /// How many lights there are.
    #[must_use]
    pub const fn light_count(&self) -> u32 {
        self.counts.lights
    }

    /// The lights, in the order of their tags.
    pub fn lights(&self) -> impl Iterator<Item = AtlasLight<'a>> + use<'a> {
        let (lights, mut names) = (self.lights, self.names);
        (0..self.counts.lights).filter_map(move |tag| {
            let record = LightRecord::parse(record(lights, tag, LIGHT_BYTES))?;
            let (name, rest) = names.split_at_checked(usize::from(record.name_length))?;
            names = rest;
            Some(AtlasLight {
                name,
                emission: record.emission,
                scale: record.scale,
                error: record.error,
            })
        })
    }

    /// The codes of one element, light by light; empty for a number out of range.
    #[must_use]
    pub fn codes(&self, element: u32) -> &'a [u8] {
        let length = self.counts.lights as usize * self.counts.channels.count();
        record(self.codes, element, length)
    }

    /// The codes of all elements, one after the other.
    #[must_use]
    pub const fn all_codes(&self) -> &'a [u8] {
        self.codes
    }

    /// The mesh, when the atlas carries one.
    #[must_use]
    pub const fn mesh(&self) -> Option<AtlasMesh<'a>> {
        self.mesh
    }
}

/// Surfaces, faces and elements of a checked atlas.
#[derive(Clone, Copy, Debug)]
pub struct AtlasMesh<'a> {
    surfaces: &'a [u8],
    faces: &'a [u8],
    elements: &'a [u8],
}

impl AtlasMesh<'_> {
    fn check(&self, lights: u32) -> Result<(), AtlasError> {
        for index in 0..self.surface_count() {
            self.surface(index).ok_or(AtlasError::Illegal("surface"))?;
        }
        for index in 0..self.face_count() {
            let face = self.face(index).ok_or(AtlasError::Illegal("face"))?;
            if face
                .emission
                .is_some_and(|emission| emission.light >= lights)
            {
                return Err(AtlasError::Illegal("light of a face"));
            }
        }
        let mut face = 0;
        for index in 0..self.element_count() {
            let element = self.element(index);
            let element = element.ok_or(AtlasError::Illegal("element"))?;
            // Elements stand face by face.
            if element.face >= self.face_count() || element.face < face {
                return Err(AtlasError::Illegal("face of an element"));
            }
            face = element.face;
        }
        Ok(())
    }

    /// How many surfaces there are.
    #[must_use]
    pub const fn surface_count(&self) -> u32 {
        (self.surfaces.len() / SURFACE_BYTES) as u32
    }

    /// How many faces there are.
    #[must_use]
    pub const fn face_count(&self) -> u32 {
        (self.faces.len() / FACE_BYTES) as u32
    }

    /// How many elements there are.
    #[must_use]
    pub const fn element_count(&self) -> u32 {
        (self.elements.len() / ELEMENT_BYTES) as u32
    }

    /// Outline of a surface; `None` for a number out of range.
    #[must_use]
    pub fn surface(&self, index: u32) -> Option<Polygon> {
        let mut input = Input(record(self.surfaces, index, SURFACE_BYTES));
        let mut vertices = [Vec3::ZERO; 4];
        for vertex in &mut vertices {
            *vertex = Vec3::new(input.f32()?, input.f32()?, input.f32()?);
        }
        Polygon::new(vertices.get(..input.u32()? as usize)?).ok()
    }

    /// A face; `None` for a number out of range.
    #[must_use]
    pub fn face(&self, index: u32) -> Option<AtlasFace> {
        let mut input = Input(record(self.faces, index, FACE_BYTES));
        let surface = input.u32()?;
        let front = self.surface(surface)?;
        let (side, polygon) = match input.u32()? {
            0 => (Side::Front, front),
            1 => (Side::Back, front.flipped()),
            _ => return None,
        };
        let light = input.u32()?;
        let share = input.rgb().filter(|share| share.is_legal())?;
        if light == NO_LIGHT && share != Rgb::BLACK {
            return None;
        }
        Some(AtlasFace {
            surface,
            side,
            polygon,
            emission: (light != NO_LIGHT).then_some(Emission { light, share }),
        })
    }

    /// An element; `None` for a number out of range.
    #[must_use]
    pub fn element(&self, index: u32) -> Option<AtlasElement> {
        let mut input = Input(record(self.elements, index, ELEMENT_BYTES));
        let face = input.u32()?;
        let corners = [input.f32()?, input.f32()?, input.f32()?, input.f32()?];
        if !corners.iter().all(|c| (0.0..=1.0).contains(c)) {
            return None;
        }
        let [from_s, from_t, to_s, to_t] = corners;
        Some(AtlasElement {
            face,
            from: Vec2::new(from_s, from_t),
            to: Vec2::new(to_s, to_t),
            reflectance: Reflectance::new(input.rgb()?)?.get(),
        })
    }
}

struct Header {
    code: Code,
    quantity: Quantity,
    length: u32,
    checksum: u32,
    counts: CountsOf,
    worst_error: Option<WorstError>,
}

impl Header {
    fn parse(bytes: &[u8]) -> Result<Self, AtlasError> {
        if !bytes.starts_with(&MAGIC) {
            return Err(AtlasError::NotAnAtlas);
        }
        let mut input = Input(bytes.get(MAGIC.len()..).unwrap_or_default());
        let short = AtlasError::Truncated {
            needed: HEADER_BYTES as u64,
        };
        let version = input.u16().ok_or(short)?;
        if version != VERSION {
            return Err(AtlasError::Version(version));
        }
        let [code, channels, quantity, reserved @ ..] = input.take::<6>().ok_or(short)?;
        if reserved != [0; 3] {
            return Err(AtlasError::Illegal("reserved byte"));
        }
        let code = Code::ALL.get(usize::from(code));
        debug_assert_eq!(CHECKSUM_AT, 20);
        let words = input.take::<{ HEADER_BYTES - 16 }>().ok_or(short)?;
        let (words, _) = words.as_chunks::<4>();
        let mut words = words.iter().map(|word| u32::from_le_bytes(*word));
        let mut next = || words.next().ok_or(short);
        Ok(Self {
            code: *code.ok_or(AtlasError::Illegal("code"))?,
            quantity: match quantity {
                0 => Quantity::Irradiance,
                1 => Quantity::Radiosity,
                _ => return Err(AtlasError::Illegal("quantity")),
            },
            length: next()?,
            checksum: next()?,
            counts: CountsOf {
                channels: match channels {
                    1 => Channels::Luminance,
                    3 => Channels::Rgb,
                    _ => return Err(AtlasError::Illegal("number of channels")),
                },
                elements: next()?,
                lights: next()?,
                names: next()?,
                surfaces: next()?,
                faces: next()?,
            },
            worst_error: match (error(next()?), error(next()?)) {
                (Some(Some(packed)), Some(Some(shown))) => Some(WorstError { packed, shown }),
                (Some(None), Some(None)) => None,
                _ => return Err(AtlasError::Illegal("error")),
            },
        })
    }
}

/// An error from its bits, `None` inside when nobody measured it; `None` outside when it is illegal.
fn error(bits: u32) -> Option<Option<f32>> {
    let error = f32::from_bits(bits);
    match bits {
        NOT_MEASURED => Some(None),
        _ if error.is_finite() && error >= 0.0 => Some(Some(error)),
        _ => None,
    }
}

struct LightRecord {
    emission: Rgb,
    scale: Scale,
    name_length: u16,
    error: Option<f32>,
}

impl LightRecord {
    fn parse(bytes: &[u8]) -> Option<Self> {
        let mut input = Input(bytes);
        let emission = input.rgb().filter(|emission| emission.is_legal())?;
        let scale = Scale::from_parts(input.u16()?, i16::from_le_bytes(input.take()?))?;
        let name_length = input.u16()?;
        input.u16().filter(|reserved| *reserved == 0)?;
        Some(Self {
            emission,
            scale,
            name_length,
            error: error(input.u32()?)?,
        })
    }
}

/// Record `index` of a table of records of `length` bytes; empty when out of range.
fn record(table: &[u8], index: u32, length: usize) -> &[u8] {
    let start = (index as usize).saturating_mul(length);
    let end = start.saturating_add(length);
    table.get(start..end).unwrap_or_default()
}

/// Bytes that are still to be read.
struct Input<'a>(&'a [u8]);

impl Input<'_> {
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (head, tail) = self.0.split_first_chunk::<N>()?;
        self.0 = tail;
        Some(*head)
    }

    fn u16(&mut self) -> Option<u16> {
        self.take().map(u16::from_le_bytes)
    }

    fn u32(&mut self) -> Option<u32> {
        self.take().map(u32::from_le_bytes)
    }

    fn f32(&mut self) -> Option<f32> {
        self.take().map(f32::from_le_bytes)
    }

    fn rgb(&mut self) -> Option<Rgb> {
        Some(Rgb::new(self.f32()?, self.f32()?, self.f32()?))
    }
}
