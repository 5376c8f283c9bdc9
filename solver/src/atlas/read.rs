//! Reads an atlas in place: everything is checked once, then access is plain slicing.

use core::iter;
use core::ops::Range;
use core::slice::ChunksExact;

use glam::{Vec2, Vec3};

use super::tiles::Tiles;
use super::{
    AtlasElement, AtlasError, AtlasFace, AtlasLight, CHECKSUM_AT, CODE_AT, CURVE_BYTES, CURVES_AT,
    CountsOf, ELEMENT_BYTES, FACE_BYTES, HEADER_BYTES, LARGEST_TILE_CODE, LIGHT_BYTES,
    LIGHT_STEPS_BYTES, MAGIC, NO_LIGHT, NOT_MEASURED, Quantity, STEPS_BYTES, SURFACE_BYTES,
    VERSION, WorstError, checksum,
};
use crate::code::{
    AllCodes, Code, Curve, ExponentialCodes, Known, LARGEST_PART_FIRST, LARGEST_PART_UNIT, Scale,
};
use crate::color::{Reflectance, Rgb};
use crate::geometry::Polygon;
use crate::mesh::Side;
use crate::scene::Emission;

/// A checked atlas that borrows its bytes.
#[derive(Clone, Copy, Debug)]
pub struct Atlas<'a> {
    checksum: u32,
    quantity: Quantity,
    image_width: u16,
    counts: CountsOf,
    worst_error: Option<WorstError>,
    lights: &'a [u8],
    /// What follows the records of lights if one is in `display8`.
    steps: &'a [u8],
    names: &'a str,
    /// Bytes of codes per element.
    stride: usize,
    codes: &'a [u8],
    tiles: Option<Tiles<'a>>,
    mesh: Option<AtlasMesh<'a>>,
}

impl<'a> Atlas<'a> {
    /// Checks `bytes`, which must hold one atlas and nothing else.
    ///
    /// # Errors
    /// [`AtlasError`]: what is wrong with the bytes.
    pub fn parse(bytes: &'a [u8]) -> Result<Self, AtlasError> {
        let mut atlas = Self::parse_codes(bytes)?;
        atlas.mesh = atlas.mesh_at_end(bytes);
        if let Some(mesh) = &atlas.mesh {
            mesh.check(atlas.counts.lights)?;
        }
        Ok(atlas)
    }

    /// The same without the mesh, which is left unread: this takes no float arithmetic.
    ///
    /// # Errors
    /// [`AtlasError`]: what is wrong with the bytes before the mesh, or with all of them by their checksum.
    pub fn parse_codes(bytes: &'a [u8]) -> Result<Self, AtlasError> {
        Self::parse_as::<AllCodes>(bytes)
    }

    /// The same for an atlas in exponential codes only, by a reader that knows no others
    /// and leaves the names unread: they are empty.
    ///
    /// # Errors
    /// [`AtlasError`], as above, and for lights in other codes.
    #[inline(never)]
    pub fn parse_exponential(bytes: &'a [u8]) -> Result<Self, AtlasError> {
        Self::parse_as::<ExponentialCodes>(bytes)
    }

    /// The same for an atlas that was found legal when it had this checksum: only the checksum is looked at again.
    ///
    /// # Errors
    /// [`AtlasError::Checksum`] for all other bytes.
    #[inline(never)]
    pub fn parse_known(bytes: &'a [u8], known: u32) -> Result<Self, AtlasError> {
        // One error is enough, and less code.
        let header = Header::parse(bytes).map_err(|_| AtlasError::Checksum)?;
        let found = checksum::<ExponentialCodes>(bytes);
        if header.checksum != known || found != Some(known) {
            return Err(AtlasError::Checksum);
        }
        let counts = header.counts;
        let (_, behind) = bytes.split_at_checked(HEADER_BYTES).unwrap_or_default();
        let length = (counts.lights as usize).wrapping_mul(LIGHT_BYTES);
        let (lights, behind) = behind.split_at_checked(length).unwrap_or_default();
        let codes = behind.get(counts.names as usize..).unwrap_or_default();
        let codes_of = |light| code_at(lights, light).map_or(0, Code::bytes);
        let stride = (0..counts.lights).map(codes_of).sum::<usize>();
        let length = (counts.elements as usize).wrapping_mul(stride);
        Ok(Self {
            checksum: known,
            quantity: header.quantity,
            image_width: header.image_width,
            counts,
            worst_error: header.worst_error,
            lights,
            steps: &[],
            names: "",
            stride,
            codes: codes.get(..length).unwrap_or_default(),
            tiles: None,
            mesh: None,
        })
    }

    /// The atlas without its mesh.
    fn parse_as<K: Known>(bytes: &'a [u8]) -> Result<Self, AtlasError> {
        let header = Header::parse(bytes)?;
        let counts = header.counts;
        // Else any number of elements would fit into a file of no size.
        if counts.lights == 0 {
            return Err(AtlasError::Illegal("number of lights"));
        }
        let lights = u64::from(counts.lights) * LIGHT_BYTES as u64 + HEADER_BYTES as u64;
        if (bytes.len() as u64) < lights {
            return Err(AtlasError::Truncated { needed: lights });
        }
        let lights = bytes.get(HEADER_BYTES..lights as usize).unwrap_or_default();
        let (mut stride, mut is_tiled, mut steps) = (0, false, 0);
        for tag in 0..counts.lights {
            let code = code_at(lights, tag).filter(|code| K::knows(*code));
            let code = code.ok_or(AtlasError::Illegal("code"))?;
            stride += code.bytes();
            is_tiled |= code.is_tiled();
            if !K::ONLY_EXPONENTIAL && code == Code::Display8 {
                steps = LIGHT_STEPS_BYTES;
            }
        }
        let needed = counts
            .layout(stride as u64, steps)
            .ok_or(AtlasError::Illegal("size"))?;
        if needed.end != u64::from(header.length) {
            return Err(AtlasError::Illegal("length"));
        }
        if (bytes.len() as u64) < needed.end {
            return Err(AtlasError::Truncated { needed: needed.end });
        }
        if bytes.len() as u64 > needed.end {
            return Err(AtlasError::Oversized { needed: needed.end });
        }
        if checksum::<K>(bytes) != Some(header.checksum) {
            return Err(AtlasError::Checksum);
        }

        let part = |from: u64, to: u64| bytes.get(from as usize..to as usize).unwrap_or_default();
        let names = part(needed.names, needed.codes);
        let names = if K::ONLY_EXPONENTIAL {
            Ok("")
        } else {
            core::str::from_utf8(names)
        };
        let tiles = part(needed.tiles, needed.surfaces);
        let is_image = header.image_width > 0;
        if is_image
            && (counts.faces > 0 || !counts.elements.is_multiple_of(header.image_width.into()))
        {
            return Err(AtlasError::Illegal("image width"));
        }
        if tiles.is_empty() == is_tiled {
            return Err(AtlasError::Illegal("table of tiles"));
        }
        let tiles = (!K::ONLY_EXPONENTIAL && is_tiled)
            .then(|| Tiles::parse(tiles, counts.elements, counts.lights));
        let atlas = Self {
            checksum: header.checksum,
            quantity: header.quantity,
            image_width: header.image_width,
            counts,
            worst_error: header.worst_error,
            lights,
            steps: part(needed.steps, needed.names),
            names: names.map_err(|_| AtlasError::Illegal("light name"))?,
            stride,
            codes: part(needed.codes, needed.tiles),
            tiles: tiles.transpose()?,
            mesh: None,
        };
        atlas.check_lights::<K>()?;
        Ok(atlas)
    }

    /// The mesh that ends the bytes of this atlas, not checked yet.
    fn mesh_at_end(&self, bytes: &'a [u8]) -> Option<AtlasMesh<'a>> {
        let CountsOf {
            elements,
            surfaces,
            faces,
            ..
        } = self.counts;
        let mut rest = bytes;
        let mut last = |count: u32, bytes: usize| {
            let begin = rest
                .len()
                .checked_sub((count as usize).checked_mul(bytes)?)?;
            let (before, table) = rest.split_at_checked(begin)?;
            rest = before;
            Some(table)
        };
        (faces > 0).then_some(())?;
        let elements = last(elements, ELEMENT_BYTES)?;
        let faces = last(faces, FACE_BYTES)?;
        let surfaces = last(surfaces, SURFACE_BYTES)?;
        Some(AtlasMesh {
            surfaces,
            faces,
            elements,
        })
    }

    fn check_lights<K: Known>(&self) -> Result<(), AtlasError> {
        let mut named = 0_usize;
        for tag in 0..self.counts.lights {
            let reaches = |channel| {
                let curve = self.curve(tag, channel);
                curve.is_some_and(|(curve, last)| curve.reaches::<K>(last))
            };
            let Some(record) = self.light(tag).filter(|_| (0..3).all(reaches)) else {
                return Err(AtlasError::Illegal("light"));
            };
            if record.error.is_some() != self.worst_error.is_some() {
                return Err(AtlasError::Illegal("error of a light"));
            }
            let end = named + usize::from(record.name_length);
            if !K::ONLY_EXPONENTIAL && self.names.get(named..end).is_none() {
                return Err(AtlasError::Illegal("light name"));
            }
            named = end;
        }
        if named == self.counts.names as usize {
            Ok(())
        } else {
            Err(AtlasError::Illegal("light name"))
        }
    }

    /// The CRC-32 of its bytes.
    #[must_use]
    pub const fn checksum(&self) -> u32 {
        self.checksum
    }

    /// What the contributions measure.
    #[must_use]
    pub const fn quantity(&self) -> Quantity {
        self.quantity
    }

    /// Width and height of the image whose pixels, row by row from the top, are the elements.
    #[must_use]
    pub fn image_size(&self) -> Option<[u32; 2]> {
        let width = u32::from(self.image_width);
        Some([width, self.counts.elements.checked_div(width)?])
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
        let (atlas, mut names) = (*self, self.names);
        (0..self.counts.lights).filter_map(move |tag| {
            let record = atlas.light(tag)?;
            let curve = |channel| atlas.curve(tag, channel);
            let ((r, last_r), (g, last_g), (b, last_b)) = (curve(0)?, curve(1)?, curve(2)?);
            let named = names.split_at_checked(usize::from(record.name_length));
            let (name, rest) = named.unwrap_or_default();
            names = rest;
            Some(AtlasLight {
                name,
                emission: record.emission,
                code: record.code,
                curves: [r, g, b],
                last: [last_r, last_g, last_b],
                error: record.error,
            })
        })
    }

    /// What a light is packed in; `None` without such a light.
    #[must_use]
    pub fn code(&self, light: u32) -> Option<Code> {
        code_at(self.lights, light)
    }

    /// What the codes of a channel of a light stand for, and the largest of them; `None` without such a light or channel.
    #[must_use]
    pub fn curve(&self, light: u32, channel: usize) -> Option<(Curve, u16)> {
        let curves = record(self.lights, light, LIGHT_BYTES).get(CURVES_AT..)?;
        let steps = record(self.steps, light, LIGHT_STEPS_BYTES);
        let more = steps.as_chunks::<STEPS_BYTES>().0.get(channel);
        let own = curves.as_chunks::<CURVE_BYTES>().0.get(channel)?;
        parse_curve(self.code(light)?, own, more.copied().unwrap_or_default())
    }

    /// One more than the largest code of any light.
    #[must_use]
    pub fn levels(&self) -> usize {
        let last = self.lights().flat_map(|light| light.last);
        usize::from(last.max().unwrap_or(0)) + 1
    }

    /// The codes of all elements for the lights that are not in tiles, element by element.
    #[must_use]
    pub const fn codes(&self) -> &'a [u8] {
        self.codes
    }

    /// All lights in the order of their tags, in groups of equally many bytes of code.
    pub(crate) fn groups(&self) -> impl Iterator<Item = Group<'a>> + use<'a> {
        let atlas = *self;
        let (mut light, mut start) = (0, 0);
        iter::from_fn(move || {
            let bytes_of = |light| code_at(atlas.lights, light).map(Code::bytes);
            let (first, code_bytes) = (light, bytes_of(light)?);
            while bytes_of(light) == Some(code_bytes) {
                light += 1;
            }
            let (from, lights) = (start, (light - first) as usize);
            start += code_bytes * lights;
            Some(Group {
                code_bytes,
                lights,
                codes: atlas.codes.chunks_exact(atlas.stride.max(1)),
                place: from..start,
            })
        })
    }

    /// Bytes of all codes, those in tiles included.
    #[must_use]
    pub const fn code_bytes(&self) -> usize {
        self.codes.len() + self.counts.tiles as usize
    }

    /// The tiles, when a light is in tiles.
    #[must_use]
    pub const fn tiles(&self) -> Option<Tiles<'a>> {
        self.tiles
    }

    /// Tags of the lights in tiles, in the order of a tile's bits.
    pub fn lights_in_tiles(&self) -> impl Iterator<Item = u32> + use<'a> {
        let lights = self.lights;
        let is_tiled = move |tag: &u32| code_at(lights, *tag).is_some_and(Code::is_tiled);
        let order = self.tiles.into_iter().flat_map(|tiles| tiles.order());
        order.filter(is_tiled)
    }

    /// Calls `f(element, light, codes)` for every contribution, except that a light in tiles is left out where all its codes
    /// are 0. Codes stand for red, green and blue, and are at most the light's last ones.
    ///
    /// Every element meets its lights in the order of their tags; those in tiles come last, in an order of their own.
    pub fn for_each(&self, mut f: impl FnMut(u32, u32, [u16; 3])) {
        if self.stride > 0 {
            let rows = self.codes.chunks_exact(self.stride).zip(0..);
            rows.for_each(|(row, element)| {
                self.for_each_in_row(row, |l, codes| f(element, l, codes))
            });
        }
        self.for_each_in_tiles(None, f);
    }

    /// The same for one light, `f(element, codes)`.
    ///
    /// In tiles, the bits of those before it are read, too.
    pub fn for_each_of(&self, light: u32, mut f: impl FnMut(u32, [u16; 3])) {
        let Some(code) = code_at(self.lights, light) else {
            return;
        };
        if code.is_tiled() {
            return self.for_each_in_tiles(Some(light), |element, _, codes| f(element, codes));
        }
        let before = (0..light).filter_map(|tag| code_at(self.lights, tag));
        let start = before.map(Code::bytes).sum();
        let rows = self.codes.chunks_exact(self.stride.max(1)).zip(0..);
        for (row, element) in rows {
            let own = row.get(start..).unwrap_or_default();
            if let Some((codes, _)) = split_codes(code, own) {
                f(element, codes);
            }
        }
    }

    /// The lights of an element that are not in tiles.
    fn for_each_in_row(&self, row: &[u8], mut f: impl FnMut(u32, [u16; 3])) {
        if self.stride == 3 * self.counts.lights as usize {
            let triples = row.as_chunks::<3>().0.iter().zip(0..);
            return triples.for_each(|(rgb, light)| f(light, rgb.map(u16::from)));
        }
        let mut row = row;
        for (record, light) in self.records().zip(0..) {
            let code = code_of(record).filter(|code| !code.is_tiled());
            if let Some((codes, rest)) = code.and_then(|code| split_codes(code, row)) {
                f(light, codes);
                row = rest;
            }
        }
    }

    /// The lights in tiles; with `only`, that one by itself.
    pub(crate) fn for_each_in_tiles(
        &self,
        only: Option<u32>,
        mut f: impl FnMut(u32, u32, [u16; 3]),
    ) {
        let Some(tiles) = self.tiles else {
            return;
        };
        for (place, mut bits) in tiles.iter() {
            for light in self.lights_in_tiles() {
                let is_lit = bits.next_light(place);
                if is_lit && only.is_none_or(|only| only == light) {
                    let last = last_codes(record(self.lights, light, LIGHT_BYTES));
                    let elements = place.elements().zip(bits.codes(last));
                    elements.for_each(|(element, codes)| f(element, light, codes));
                }
                if only == Some(light) {
                    break;
                }
            }
        }
    }

    /// Whether all lights are in codes for which `f` holds; looks at nothing else of them.
    pub fn is_all_in(&self, f: impl Fn(Code) -> bool) -> bool {
        self.records().all(|record| code_of(record).is_some_and(&f))
    }

    fn light(&self, tag: u32) -> Option<LightRecord> {
        LightRecord::parse(record(self.lights, tag, LIGHT_BYTES))
    }

    fn records(&self) -> impl Iterator<Item = &'a [u8; LIGHT_BYTES]> + use<'a> {
        self.lights.as_chunks::<LIGHT_BYTES>().0.iter()
    }

    /// The mesh, when the atlas carries one.
    #[must_use]
    pub const fn mesh(&self) -> Option<AtlasMesh<'a>> {
        self.mesh
    }
}

/// Lights one after the other whose codes have equally many bytes: none if they are in tiles.
#[derive(Debug)]
pub(crate) struct Group<'a> {
    /// Bytes per element and light.
    pub code_bytes: usize,
    /// How many lights.
    pub lights: usize,
    /// The codes of every element for all lights.
    codes: ChunksExact<'a, u8>,
    /// Where those of these lights stand.
    place: Range<usize>,
}

impl<'a> Group<'a> {
    /// The codes of every element for these lights.
    pub(crate) fn rows<const N: usize>(&self) -> impl Iterator<Item = &'a [[u8; N]]> + use<'a, N> {
        let place = self.place.clone();
        let own = move |row: &'a [u8]| row.get(place.clone()).unwrap_or_default();
        self.codes.clone().map(move |row| own(row).as_chunks().0)
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

    /// Bytes of an atlas that it takes.
    #[must_use]
    pub const fn byte_count(&self) -> usize {
        self.surfaces.len() + self.faces.len() + self.elements.len()
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
    quantity: Quantity,
    image_width: u16,
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
        let [quantity, reserved @ ..] = input.take::<4>().ok_or(short)?;
        if reserved != [0; 3] {
            return Err(AtlasError::Illegal("reserved byte"));
        }
        let image_width = input.u16().ok_or(short)?;
        debug_assert_eq!(CHECKSUM_AT, 20);
        let words = input.0.get(..HEADER_BYTES - 16).ok_or(short)?;
        let (words, _) = words.as_chunks::<4>();
        let mut words = words.iter().map(|word| u32::from_le_bytes(*word));
        let mut next = || words.next().ok_or(short);
        Ok(Self {
            quantity: match quantity {
                0 => Quantity::Irradiance,
                1 => Quantity::Radiosity,
                2 => Quantity::Radiance,
                _ => return Err(AtlasError::Illegal("quantity")),
            },
            image_width,
            length: next()?,
            checksum: next()?,
            counts: CountsOf {
                elements: next()?,
                lights: next()?,
                names: next()?,
                tiles: next()?,
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
    match bits {
        NOT_MEASURED => Some(None),
        _ if bits < f32::INFINITY.to_bits() => Some(Some(f32::from_bits(bits))),
        _ => None,
    }
}

struct LightRecord {
    emission: Rgb,
    code: Code,
    name_length: u16,
    error: Option<f32>,
}

impl LightRecord {
    fn parse(bytes: &[u8]) -> Option<Self> {
        let mut input = Input(bytes);
        let emission = input.rgb().filter(|emission| emission.is_legal())?;
        let [code, 0] = input.take()? else {
            return None;
        };
        let code = *Code::ALL.get(usize::from(code))?;
        let name_length = input.u16()?;
        let error = error(input.u32()?)?;
        input.u16().filter(|reserved| *reserved == 0)?;
        Some(Self {
            emission,
            code,
            name_length,
            error,
        })
    }
}

/// A curve and its last code; `more` is the second half of its steps, if it has any.
#[inline(never)]
fn parse_curve(
    code: Code,
    bytes: &[u8; CURVE_BYTES],
    more: [u8; STEPS_BYTES],
) -> Option<(Curve, u16)> {
    let mut input = Input(bytes);
    let scale = Scale::from_parts(input.u16()?, i16::from_le_bytes(input.take()?))?;
    if code == Code::Display8 {
        let head = input.u16()?;
        let (first, unit) = (head & LARGEST_PART_FIRST, (head >> 12) as u8);
        let curve = Curve::Parts {
            white: scale,
            first,
            unit,
            steps: *[input.take()?, more].as_flattened().first_chunk()?,
        };
        return (unit <= LARGEST_PART_UNIT).then_some((curve, u8::MAX.into()));
    }
    if more != [0; STEPS_BYTES] {
        return None;
    }
    let (first, step, last) = (input.u32()?, input.u32()?, input.u16()?);
    let curve = match code {
        Code::Exp8 | Code::Exp8s | Code::Lum8 if first == 0 && step == 0 => {
            Curve::Exponential { scale }
        }
        Code::Tiles if first == 0 && step > 0 => Curve::Display { white: scale, step },
        Code::TilesLog if scale == Scale::ONE && step == 0 => Curve::Logarithmic { first },
        _ => return None,
    };
    let is_legal = if code.is_tiled() {
        last <= LARGEST_TILE_CODE
    } else {
        last == u16::from(u8::MAX)
    };
    is_legal.then_some((curve, last))
}

/// The code of light `tag` of a table of lights; `None` when there is no such code.
fn code_at(lights: &[u8], tag: u32) -> Option<Code> {
    code_of(record(lights, tag, LIGHT_BYTES).first_chunk()?)
}

/// The codes of a contribution at the beginning of some bytes, and the bytes after it.
fn split_codes(code: Code, bytes: &[u8]) -> Option<([u16; 3], &[u8])> {
    let (own, rest) = bytes.split_at_checked(code.bytes())?;
    match *own {
        [r, g, b] => Some(([r, g, b].map(u16::from), rest)),
        [luminance] => Some(([luminance.into(); 3], rest)),
        _ => None,
    }
}

fn code_of(record: &[u8; LIGHT_BYTES]) -> Option<Code> {
    Code::ALL.get(usize::from(*record.get(CODE_AT)?)).copied()
}

/// The last codes of a light, without looking at the rest.
fn last_codes(record: &[u8]) -> [u16; 3] {
    let curves = record.get(CURVES_AT..).unwrap_or_default();
    let mut last = [0; 3];
    for (last, curve) in last.iter_mut().zip(curves.as_chunks::<CURVE_BYTES>().0) {
        let [.., low, high] = *curve;
        *last = u16::from_le_bytes([low, high]);
    }
    last
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
