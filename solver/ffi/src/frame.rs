//! Frames in integers: levels of lights in, pixels out.

use core::mem::MaybeUninit;

use relume::atlas::Atlas;
use relume::code::Code;
use relume::color::Rgb;
use relume::relight::{
    AnyTable, Colour, Encode, Finish, Form, FrameLight, FrameMix, Lum, Run, add_any, add_lights,
    change_light, show_sums, table_length,
};
use relume::tone::{Rgb565Table, Rgb888Table};

use crate::atlas::{RelumeAtlas, RelumeRgb};
use crate::status::{
    RelumeStatus, check_made, exclusive, holds, shared, status, values, values_mut,
};

/// An atlas under a mix: its sums, kept from frame to frame. What is in it is the library's.
#[derive(Debug)]
#[repr(C)]
pub struct RelumeFrame {
    made: u32,
    words: MaybeUninit<[u64; 48]>,
}

impl RelumeFrame {
    /// The frame inside.
    ///
    /// # Safety
    /// The rules of the crate.
    unsafe fn get_mut(&mut self) -> Result<&mut Frame, RelumeStatus> {
        check_made(self.made)?;
        // SAFETY: as of `get`.
        Ok(unsafe { &mut *self.words.as_mut_ptr().cast::<Frame>() })
    }
}

holds!(RelumeFrame, Frame, 48);

/// A light's share of its full weight, in 2^-16, channel by channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C)]
pub struct RelumeLevels {
    /// Red.
    pub r: u16,
    /// Green.
    pub g: u16,
    /// Blue.
    pub b: u16,
}

impl From<RelumeLevels> for [u16; 3] {
    fn from(RelumeLevels { r, g, b }: RelumeLevels) -> Self {
        [r, g, b]
    }
}

/// Elements that follow each other and reflect alike.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C)]
pub struct RelumeRun {
    /// How many.
    pub elements: u32,
    /// Their reflectance in red, green and blue, in 2^-16; 65535 for an atlas of radiosity or radiance.
    pub reflectance: [u16; 3],
}

// One is read as the other.
const _: () = assert!(
    size_of::<RelumeRun>() == size_of::<Run>()
        && align_of::<RelumeRun>() == align_of::<Run>()
        && core::mem::offset_of!(RelumeRun, elements) == core::mem::offset_of!(Run, elements)
        && core::mem::offset_of!(RelumeRun, reflectance) == core::mem::offset_of!(Run, reflectance)
);

/// How sums become pixels.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct RelumeFinish {
    /// Reflectances of all elements, in their order.
    pub runs: *const RelumeRun,
    /// How many runs there are.
    pub run_count: usize,
    /// Factor on radiance, 1 being white.
    pub exposure: f32,
}

/// Linear steps to RGB565.
#[derive(Debug)]
pub struct RelumeRgb565Table(Rgb565Table);

/// Linear steps to three bytes of sRGB.
#[derive(Debug)]
pub struct RelumeRgb888Table(Rgb888Table);

/// The table for frames in which nothing is brighter than white.
#[unsafe(no_mangle)]
pub static relume_rgb565: RelumeRgb565Table = RelumeRgb565Table(Rgb565Table::new(2048));

/// The table for frames in which elements may be twice as bright as white, with half as many steps below it.
#[unsafe(no_mangle)]
pub static relume_rgb565_bright: RelumeRgb565Table = RelumeRgb565Table(Rgb565Table::new(1024));

/// As [`relume_rgb565`].
#[unsafe(no_mangle)]
pub static relume_rgb888: RelumeRgb888Table = RelumeRgb888Table(Rgb888Table::new(2048));

/// As [`relume_rgb565_bright`].
#[unsafe(no_mangle)]
pub static relume_rgb888_bright: RelumeRgb888Table = RelumeRgb888Table(Rgb888Table::new(1024));

/// What a [`RelumeFrame`] holds.
#[derive(Debug)]
pub(crate) struct Frame {
    atlas: Atlas<'static>,
    mix: FrameMix<'static>,
    sums: Kept,
}

/// Sums and the table of one light, in the form of the atlas; where no form fits it, the table of all lights.
#[derive(Debug)]
enum Kept {
    Lum(&'static mut <Lum as Form>::Table, &'static mut [u32]),
    Colour(
        &'static mut <Colour as Form>::Table,
        &'static mut [[u16; 3]],
    ),
    Any(AnyTable<'static>, &'static mut [[u16; 3]]),
}

/// Which of [`Kept`] an atlas takes.
enum Kind {
    Lum,
    Colour,
    Any,
}

/// How the memory of a frame is laid out, in bytes: a table, sums of all elements, and its lights.
struct Layout {
    kind: Kind,
    sums: usize,
    lights: usize,
    end: usize,
}

impl Layout {
    fn new(atlas: &Atlas) -> Option<Self> {
        let (kind, table, sum) = if atlas.lights().all(|light| light.code == Code::Lum8) {
            let table = size_of::<<Lum as Form>::Table>();
            (Kind::Lum, table, size_of::<u32>())
        } else if atlas.lights().all(|light| light.code.bytes() == 3) {
            let table = size_of::<<Colour as Form>::Table>();
            (Kind::Colour, table, size_of::<[u16; 3]>())
        } else {
            let table = table_length(atlas).checked_mul(size_of::<u16>())?;
            (Kind::Any, table, size_of::<[u16; 3]>())
        };
        let bytes = |count: u32, size: usize| usize::try_from(count).ok()?.checked_mul(size);
        let sums = bytes(atlas.element_count(), sum)?.checked_add(table)?;
        let lights = bytes(atlas.light_count(), size_of::<FrameLight>())?;
        Some(Self {
            kind,
            sums: table,
            lights: sums,
            end: sums.checked_add(lights)?.checked_next_multiple_of(4)?,
        })
    }
}

/// Bytes of memory of a frame; `None` where they cannot be counted.
pub(crate) fn memory(atlas: &Atlas) -> Option<usize> {
    Some(Layout::new(atlas)?.end)
}

/// Makes a frame, all lights off. `full` has the largest weight that each light will have, and `memory` as many bytes
/// as `RelumeInfo::frame_memory` says; the frame keeps it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn relume_frame_make(
    atlas: *const RelumeAtlas,
    full: *const RelumeRgb,
    lights: usize,
    memory: *mut u32,
    bytes: usize,
    frame: *mut RelumeFrame,
) -> RelumeStatus {
    status((|| {
        // SAFETY: by the rules.
        let (atlas, full) =
            unsafe { (*shared(atlas)?.get()?, values(full.cast::<Rgb>(), lights)?) };
        // SAFETY: by the rules.
        let (memory, frame) = unsafe { (values_mut(memory, bytes / 4)?, exclusive(frame)?) };
        let layout = Layout::new(&atlas).ok_or(RelumeStatus::Length)?;
        if bytes < layout.end || lights != atlas.light_count() as usize {
            return Err(RelumeStatus::Length);
        }
        memory.fill(0);
        let start = memory.as_mut_ptr().cast::<u8>();
        let elements = atlas.element_count() as usize;
        // SAFETY: the parts of the layout do not overlap, end inside the memory, and are aligned: the memory to 4 bytes
        // and a table and sums to 4 or, with all behind them, to 2. Zeros are integers, and lights are written first.
        let (own, table, sums) = unsafe {
            let own = start.add(layout.lights).cast::<FrameLight>();
            for light in 0..lights {
                own.add(light).write(FrameLight::EMPTY);
            }
            (values_mut(own, lights)?, start, start.add(layout.sums))
        };
        let mix = FrameMix::new(&atlas, full, own)?;
        // SAFETY: as above.
        let sums = unsafe {
            match layout.kind {
                Kind::Lum => Kept::Lum(&mut *table.cast(), values_mut(sums.cast(), elements)?),
                Kind::Colour => {
                    Kept::Colour(&mut *table.cast(), values_mut(sums.cast(), elements)?)
                }
                Kind::Any => {
                    let table = values_mut(table.cast(), table_length(&atlas))?;
                    let table = AnyTable::new(&atlas, &mix, table)?;
                    Kept::Any(table, values_mut(sums.cast(), elements)?)
                }
            }
        };
        *frame = RelumeFrame::new(Frame { atlas, mix, sums });
        Ok(())
    })())
}

/// Sets the levels of all lights, and adds them up. For an atlas that is neither all in `lum8` nor all in codes of three bytes,
/// the table of a light is kept as long as its levels stay.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn relume_frame_full(
    frame: *mut RelumeFrame,
    levels: *const RelumeLevels,
    lights: usize,
) -> RelumeStatus {
    status((|| {
        // SAFETY: by the rules.
        let (frame, levels) = unsafe { (exclusive(frame)?.get_mut()?, values(levels, lights)?) };
        let Frame { atlas, mix, sums } = frame;
        if lights != atlas.light_count() as usize {
            return Err(RelumeStatus::Length);
        }
        for (light, levels) in (0..).zip(levels) {
            let levels = (*levels).into();
            let is_new = mix.levels(light) != Some(levels);
            mix.set(light, levels);
            if let (true, Kept::Any(table, _)) = (is_new, &mut *sums) {
                table.update(atlas, mix, light)?;
            }
        }
        match sums {
            Kept::Lum(table, sums) => add_lights::<Lum>(atlas, mix, table, sums)?,
            Kept::Colour(table, sums) => add_lights::<Colour>(atlas, mix, table, sums)?,
            Kept::Any(table, sums) => add_any(atlas, table, sums)?,
        }
        Ok(())
    })())
}

/// Sets the levels of one light; the bits are those of `relume_frame_full`. An atlas whose tables are kept is added up anew.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn relume_frame_change(
    frame: *mut RelumeFrame,
    light: u32,
    levels: *const RelumeLevels,
) -> RelumeStatus {
    status((|| {
        // SAFETY: by the rules.
        let (frame, levels) = unsafe { (exclusive(frame)?.get_mut()?, *shared(levels)?) };
        let Frame { atlas, mix, sums } = frame;
        let change = (light, levels.into());
        match sums {
            Kept::Lum(table, sums) => change_light::<Lum>(atlas, mix, change, table, sums)?,
            Kept::Colour(table, sums) => change_light::<Colour>(atlas, mix, change, table, sums)?,
            Kept::Any(table, sums) => {
                mix.set(light, change.1);
                table.update(atlas, mix, light)?;
                add_any(atlas, table, sums)?;
            }
        }
        Ok(())
    })())
}

/// Shows a frame in RGB565, a pixel for every element; `table` is one of the library's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn relume_frame_rgb565(
    frame: *const RelumeFrame,
    finish: *const RelumeFinish,
    table: *const RelumeRgb565Table,
    pixels: *mut u16,
    count: usize,
) -> RelumeStatus {
    // SAFETY: by the rules.
    status(unsafe { shared(table).and_then(|table| show(frame, finish, &table.0, pixels, count)) })
}

/// Shows a frame in sRGB, three bytes for every element; `table` is one of the library's, `count` the number of elements.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn relume_frame_rgb888(
    frame: *const RelumeFrame,
    finish: *const RelumeFinish,
    table: *const RelumeRgb888Table,
    pixels: *mut u8,
    count: usize,
) -> RelumeStatus {
    // SAFETY: by the rules.
    let table = unsafe { shared(table) };
    // SAFETY: by the rules.
    status(table.and_then(|table| unsafe { show(frame, finish, &table.0, pixels.cast(), count) }))
}

/// Pixels by a table.
///
/// # Safety
/// The rules of the crate.
unsafe fn show<T: Encode>(
    frame: *const RelumeFrame,
    finish: *const RelumeFinish,
    table: &T,
    pixels: *mut T::Pixel,
    count: usize,
) -> Result<(), RelumeStatus> {
    // SAFETY: by the rules.
    let (frame, finish) = unsafe { (shared(frame)?.get()?, shared(finish)?) };
    // SAFETY: by the rules; a run is a run.
    let runs = unsafe { values(finish.runs.cast::<Run>(), finish.run_count)? };
    // SAFETY: by the rules.
    let pixels = unsafe { values_mut(pixels, count)? };
    let Frame { atlas, mix, sums } = frame;
    let finish = Finish::new(atlas, mix, runs, finish.exposure, table)?;
    match sums {
        Kept::Lum(_, sums) => show_sums::<Lum, T>(atlas, sums, &finish, pixels)?,
        Kept::Colour(_, sums) | Kept::Any(_, sums) => {
            show_sums::<Colour, T>(atlas, sums, &finish, pixels)?;
        }
    }
    Ok(())
}
