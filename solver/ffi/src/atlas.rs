//! An atlas in flash: parsed once, then looked into.

use core::mem::MaybeUninit;

use relume::atlas::{Atlas, Quantity};
use relume::code::Code;
use relume::color::Rgb;

use crate::status::{RelumeStatus, exclusive, holds, shared, status, values};

/// A parsed atlas, which borrows its bytes. What is in it is the library's.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct RelumeAtlas {
    made: u32,
    words: MaybeUninit<[u64; 30]>,
}

holds!(RelumeAtlas, Atlas<'static>, 30);

/// A linear RGB triple.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct RelumeRgb {
    /// Red.
    pub r: f32,
    /// Green.
    pub g: f32,
    /// Blue.
    pub b: f32,
}

// One is read as the other.
const _: () = assert!(
    size_of::<RelumeRgb>() == size_of::<Rgb>()
        && core::mem::offset_of!(RelumeRgb, r) == core::mem::offset_of!(Rgb, r)
        && core::mem::offset_of!(RelumeRgb, g) == core::mem::offset_of!(Rgb, g)
        && core::mem::offset_of!(RelumeRgb, b) == core::mem::offset_of!(Rgb, b)
);

impl From<Rgb> for RelumeRgb {
    fn from(Rgb { r, g, b }: Rgb) -> Self {
        Self { r, g, b }
    }
}

/// What the contributions of an atlas measure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C)]
pub enum RelumeQuantity {
    /// Irradiance in W/m2: reflectances are applied after relighting.
    Irradiance = 0,
    /// Radiosity in W/m2: reflectances are multiplied in.
    Radiosity = 1,
    /// Radiance of a picture: the elements are its pixels.
    Radiance = 2,
}

/// What an atlas holds.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct RelumeInfo {
    /// Elements.
    pub elements: u32,
    /// Lights.
    pub lights: u32,
    /// What the contributions measure.
    pub quantity: RelumeQuantity,
    /// Width and height of the picture whose pixels, row by row, are the elements; 0 for an atlas of no picture.
    pub width: u32,
    /// See `width`.
    pub height: u32,
    /// Bytes of memory of a frame, a multiple of 4; 0 where they cannot be counted.
    pub frame_memory: usize,
}

/// A light of an atlas.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct RelumeLight {
    /// Its name in UTF-8, borrowed from the atlas, without a zero at its end.
    pub name: *const u8,
    /// Bytes of the name.
    pub name_length: usize,
    /// Nominal weight.
    pub emission: RelumeRgb,
    /// Name of the code that its contributions are written in, as `lum8`, in UTF-8, without a zero at its end.
    pub code: *const u8,
    /// Bytes of the code's name.
    pub code_length: usize,
}

/// Parses the bytes of an atlas, checksum included, without copying them; a mesh in it is left unread.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn relume_atlas_parse(
    bytes: *const u8,
    length: usize,
    atlas: *mut RelumeAtlas,
) -> RelumeStatus {
    status((|| {
        // SAFETY: by the rules.
        let (bytes, atlas) = unsafe { (values(bytes, length)?, exclusive(atlas)?) };
        *atlas = RelumeAtlas::new(Atlas::parse_codes(bytes)?);
        Ok(())
    })())
}

/// Tells what an atlas holds.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn relume_atlas_info(
    atlas: *const RelumeAtlas,
    info: *mut RelumeInfo,
) -> RelumeStatus {
    status((|| {
        // SAFETY: by the rules.
        let (atlas, info) = unsafe { (shared(atlas)?.get()?, exclusive(info)?) };
        let [width, height] = atlas.image_size().unwrap_or_default();
        *info = RelumeInfo {
            elements: atlas.element_count(),
            lights: atlas.light_count(),
            quantity: match atlas.quantity() {
                Quantity::Irradiance => RelumeQuantity::Irradiance,
                Quantity::Radiosity => RelumeQuantity::Radiosity,
                Quantity::Radiance => RelumeQuantity::Radiance,
            },
            width,
            height,
            frame_memory: crate::frame::memory(atlas).unwrap_or(0),
        };
        Ok(())
    })())
}

/// Tells what a light is.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn relume_atlas_light(
    atlas: *const RelumeAtlas,
    light: u32,
    found: *mut RelumeLight,
) -> RelumeStatus {
    status((|| {
        // SAFETY: by the rules.
        let (atlas, found) = unsafe { (shared(atlas)?.get()?, exclusive(found)?) };
        let light = atlas.lights().nth(light as usize);
        let light = light.ok_or(RelumeStatus::Light)?;
        let code = Code::name(light.code);
        *found = RelumeLight {
            name: light.name.as_ptr(),
            name_length: light.name.len(),
            emission: light.emission.into(),
            code: code.as_ptr(),
            code_length: code.len(),
        };
        Ok(())
    })())
}
