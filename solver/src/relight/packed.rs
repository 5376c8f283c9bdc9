//! Frames: from an atlas and a mix straight to the pixels of a display, one per element, in few instructions.
//!
//! Two [`Form`]s of codes, one for all lights of an atlas:
//!
//! * [`Lum`]: a luminance code stands for a colour once its light has one, so a light has a table of 256 words that hold red,
//!   green and blue side by side in 10, 12 and 10 bits, and one addition adds all three. The full scale of a
//!   [`FrameMix`] keeps them from running into each other;
//! * [`Colour`]: a table of 256 for each channel, in 16 bits.
//!
//! [`full`] adds up `K` tables; [`Sums`] keeps what was added, for lights that change one at a time or
//! whose tables do not fit into memory together, and sends a display whole frames or strips of them. Sums wrap, so undoing a change restores the same bits.
//! `K` is a constant because it halves the instructions. Any mixture of codes, tiles above all, goes through [`full_any`],
//! which decodes first.

use core::array;
use core::cell::Cell;
use core::fmt;
use core::hint::black_box;
use core::mem;

use super::frame::{Encode, Finish, FrameLight, FrameMix, Values, Weight};
use super::{CodeTable, RelightError, check_elements};
use crate::atlas::{Atlas, AtlasError};
use crate::code::{AllCodes, Code, DECODED, ExponentialCodes, Known};
use crate::color::Rgb;

/// Bits of red, green and blue in a packed word, red at the top.
const PACKED: [u32; 3] = [10, 12, 10];

/// Bits of a sum by itself.
const SINGLE: u32 = 16;

/// Whether this is a core of eight registers, ARMv6-M: of the ones that are supported, it alone has no compare-and-swap. Its
/// loops are cut in another way; what they compute is the same.
const IS_SMALL: bool = !cfg!(target_has_atomic = "32");

/// Whether a core multiplies two words into two in one instruction.
pub(super) const HAS_WIDE: bool = !IS_SMALL;

/// Elements that look for a table together.
const GROUP: usize = if IS_SMALL { 1 } else { 2 };

/// How the codes of an element are stored, and their contributions summed.
pub trait Form {
    /// The codes that an atlas in this form may be in.
    type Known: Known;
    /// What all lights of the atlas are written in has so many bytes.
    type Codes: Copy + fmt::Debug;
    /// The contribution of a light, or a sum of them.
    type Sum: Copy + Default + fmt::Debug;
    /// What every code contributes of a light.
    type Table: fmt::Debug;

    /// Bits of a sum.
    const BITS: [u32; 3];
    /// Contributes nothing.
    const EMPTY: Self::Table;

    /// Reads an atlas, without its mesh, for the kernels of this form.
    ///
    /// # Errors
    /// [`AtlasError`], also for codes that no atlas in this form may be in.
    fn parse(bytes: &[u8]) -> Result<Atlas<'_>, AtlasError>;

    /// [`FrameMix::new`] for the kernels of this form.
    ///
    /// # Errors
    /// As there, and [`RelightError::Code`].
    fn mix<'a>(
        atlas: &Atlas,
        full: &[Rgb],
        lights: &'a mut [FrameLight],
    ) -> Result<FrameMix<'a>, RelightError>;

    /// The codes of all elements, whose lights stand next to each other; `None` for lights in another form.
    fn codes<'a>(atlas: &Atlas<'a>) -> Option<&'a [Self::Codes]>;

    /// Puts what weights make of every code of a light into a table, minus what other weights made of it before.
    ///
    /// # Errors
    /// [`RelightError::Lights`] without such a light.
    fn fill(
        table: &mut Self::Table,
        atlas: &Atlas,
        light: u32,
        before: Option<[Weight; 3]>,
        after: [Weight; 3],
    ) -> Result<(), RelightError>;

    /// A sum, and what a table says of a light's codes.
    #[must_use]
    fn add(sum: Self::Sum, table: &Self::Table, codes: &Self::Codes) -> Self::Sum;

    /// Bits of the fields of a sum that are shown.
    const SHOWN: [u32; 3];

    /// What is shown of a sum.
    #[must_use]
    fn fields(sum: Self::Sum) -> [u32; 3];
}

/// All lights in [`Code::Lum8`].
#[derive(Clone, Copy, Debug)]
pub struct Lum;

impl Form for Lum {
    type Known = ExponentialCodes;
    type Codes = u8;
    type Sum = u32;
    type Table = [u32; 256];

    const BITS: [u32; 3] = PACKED;
    const SHOWN: [u32; 3] = [10, 16, 10];
    const EMPTY: [u32; 256] = [0; 256];

    fn parse(bytes: &[u8]) -> Result<Atlas<'_>, AtlasError> {
        Atlas::parse_exponential(bytes)
    }

    fn mix<'a>(
        atlas: &Atlas,
        full: &[Rgb],
        lights: &'a mut [FrameLight],
    ) -> Result<FrameMix<'a>, RelightError> {
        FrameMix::exponential(atlas, full, lights)
    }

    fn codes<'a>(atlas: &Atlas<'a>) -> Option<&'a [u8]> {
        let fits = atlas.is_all_in(|code| code == Code::Lum8);
        fits.then_some(atlas.codes())
    }

    fn fill(
        table: &mut [u32; 256],
        _: &Atlas,
        _: u32,
        before: Option<[Weight; 3]>,
        after: [Weight; 3],
    ) -> Result<(), RelightError> {
        if let Some(before) = before {
            fill_packed(table, &before, 0);
            fill_packed(table, &after, u32::MAX);
        } else {
            fill_packed(table, &after, 0);
        }
        Ok(())
    }

    #[inline(always)]
    fn add(sum: u32, table: &[u32; 256], code: &u8) -> u32 {
        sum.wrapping_add(entry(table, *code))
    }

    #[inline(always)]
    fn fields(sum: u32) -> [u32; 3] {
        // Small cores take 16 bits out in two instructions, 12 in four: green has a piece of blue behind it.
        [sum >> 22, sum >> 6 & 0xffff, sum & 0x3ff]
    }
}

/// Puts what weights make of every code into a table, minus what is `kept` of it.
#[inline(never)]
fn fill_packed(table: &mut [u32; 256], [r, g, b]: &[Weight; 3], kept: u32) {
    for (entry, value) in table.iter_mut().zip(&DECODED) {
        let value = u32::from(*value);
        let packed = r.of(value) << 22 | g.of(value) << 10 | b.of(value);
        *entry = packed.wrapping_sub(*entry & kept);
        as_it_is();
    }
}

/// All lights in codes of three bytes.
#[derive(Clone, Copy, Debug)]
pub struct Colour;

impl Form for Colour {
    type Known = AllCodes;
    type Codes = [u8; 3];
    type Sum = [u16; 3];
    type Table = [[u16; 256]; 3];

    const BITS: [u32; 3] = [SINGLE; 3];
    const SHOWN: [u32; 3] = [SINGLE; 3];
    const EMPTY: [[u16; 256]; 3] = [[0; 256]; 3];

    fn parse(bytes: &[u8]) -> Result<Atlas<'_>, AtlasError> {
        Atlas::parse_codes(bytes)
    }

    fn mix<'a>(
        atlas: &Atlas,
        full: &[Rgb],
        lights: &'a mut [FrameLight],
    ) -> Result<FrameMix<'a>, RelightError> {
        FrameMix::new(atlas, full, lights)
    }

    fn codes<'a>(atlas: &Atlas<'a>) -> Option<&'a [[u8; 3]]> {
        let fits = atlas.is_all_in(|code| code.bytes() == 3);
        fits.then_some(atlas.codes().as_chunks().0)
    }

    #[inline(never)]
    fn fill(
        tables: &mut [[u16; 256]; 3],
        atlas: &Atlas,
        light: u32,
        before: Option<[Weight; 3]>,
        after: [Weight; 3],
    ) -> Result<(), RelightError> {
        let weights = before.unwrap_or([Weight::ZERO; 3]).into_iter().zip(after);
        for ((table, channel), (before, after)) in tables.iter_mut().zip(0..).zip(weights) {
            let values = Values::of_light::<Self::Known>(atlas, light, channel);
            let expected = atlas.light_count();
            let values = values.ok_or(RelightError::Lights { expected })?;
            values.with_codes::<Self::Known, _>(table.iter_mut(), |entry, value| {
                *entry = after.of(value).wrapping_sub(before.of(value)) as u16;
            });
        }
        Ok(())
    }

    #[inline(always)]
    fn add(sum: [u16; 3], tables: &[[u16; 256]; 3], codes: &[u8; 3]) -> [u16; 3] {
        let ([r, g, b], [red, green, blue]) = (sum, tables);
        let [code_r, code_g, code_b] = *codes;
        [
            r.wrapping_add(entry(red, code_r)),
            g.wrapping_add(entry(green, code_g)),
            b.wrapping_add(entry(blue, code_b)),
        ]
    }

    #[inline(always)]
    fn fields(sum: [u16; 3]) -> [u32; 3] {
        sum.map(u32::from)
    }
}

/// What multiplies the fields of a sum: the product of a field and its factor fills 32 bits, whose upper ones are the step.
pub(super) struct Factors([Cell<u32>; 3]);

impl Factors {
    #[inline(always)]
    pub(super) fn new<F: Form>(factors: [u16; 3]) -> Self {
        let ([r, g, b], [bits_r, bits_g, bits_b]) = (factors.map(u32::from), F::SHOWN);
        Self([
            Cell::new(r << (16 - bits_r)),
            Cell::new(g << (16 - bits_g)),
            Cell::new(b << (16 - bits_b)),
        ])
    }

    /// Keeps the compiler from filling registers with factors, which the stack gives as fast.
    #[inline(always)]
    fn stay_in_memory(&self) {
        black_box(self);
    }

    /// The steps of a sum.
    #[inline(always)]
    pub(super) fn steps<F: Form, T: Encode, const WIDE: bool>(&self, sum: F::Sum) -> [u32; 3] {
        let Self([factor_r, factor_g, factor_b]) = self;
        let ([r, g, b], [fields_r, fields_g, fields_b]) = (F::fields(sum), F::SHOWN);
        let [bits_r, bits_g, bits_b] = T::BITS;
        [
            step::<WIDE>(r, factor_r.get(), fields_r, bits_r),
            step::<WIDE>(g, factor_g.get(), fields_g, bits_g),
            step::<WIDE>(b, factor_b.get(), fields_b, bits_b),
        ]
    }
}

/// The upper `bits` of the product of a field of so many bits and its factor.
#[inline(always)]
fn step<const WIDE: bool>(field: u32, factor: u32, field_bits: u32, bits: u32) -> u32 {
    if !WIDE || bits > field_bits {
        (field * factor) >> (32 - bits)
    } else {
        // The upper half of 64 bits takes one instruction.
        ((u64::from(field) * u64::from(factor << bits)) >> 32) as u32
    }
}

#[inline(always)]
fn entry<V: Copy>(table: &[V; 256], code: u8) -> V {
    // A byte cannot leave a table of 256.
    #[allow(clippy::indexing_slicing)]
    let value = table[usize::from(code)];
    value
}

/// Multiplies out one light of a mix.
///
/// # Errors
/// [`RelightError::Lights`] without such a light.
pub fn fill_table<F: Form>(
    atlas: &Atlas,
    mix: &FrameMix,
    light: u32,
    table: &mut F::Table,
) -> Result<(), RelightError> {
    let weights = mix.weights(light, F::BITS)?;
    F::fill(table, atlas, light, None, weights)
}

/// Sets the levels of one light, and multiplies out by how much it changes.
///
/// # Errors
/// [`RelightError::Lights`] without such a light. Nothing has changed then.
#[inline(never)]
pub(super) fn fill_change<F: Form>(
    atlas: &Atlas,
    mix: &mut FrameMix,
    (light, levels): (u32, [u16; 3]),
    table: &mut F::Table,
) -> Result<(), RelightError> {
    let before = mix.weights(light, F::BITS)?;
    let after = mix.weights_at(light, levels, F::BITS)?;
    F::fill(table, atlas, light, Some(before), after)?;
    mix.set(light, levels);
    Ok(())
}

/// The pixels of all elements, from a table of each of the `K` lights.
///
/// # Errors
/// Slices and runs that do not fit the atlas; [`RelightError::Code`] for another form.
pub fn full<F: Form, const K: usize, T: Encode>(
    atlas: &Atlas,
    tables: &[F::Table; K],
    finish: &Finish<T>,
    pixels: &mut [T::Pixel],
) -> Result<(), RelightError> {
    check_elements(atlas, pixels.len())?;
    let mut pixels = pixels;
    finish.by_run(rows::<F, K>(atlas)?, |rows, factors| {
        let own = pixels.split_off_mut(..rows.len()).unwrap_or_default();
        full_run::<F, K, T>(rows, tables, factors, finish.tone, own);
    })
}

/// The pixels of a run. A function of its own has registers for all that it needs.
#[inline(never)]
fn full_run<F: Form, const K: usize, T: Encode>(
    rows: &[[F::Codes; K]],
    tables: &[F::Table; K],
    factors: [u16; 3],
    tone: &T,
    pixels: &mut [T::Pixel],
) {
    let factors = &Factors::new::<F>(factors);
    factors.stay_in_memory();
    let (groups, rest) = rows.as_chunks();
    let (shown, rest_shown) = pixels.as_chunks_mut();
    for (rows, pixels) in groups.iter().zip(shown) {
        full_group::<F, K, GROUP, T>(rows, tables, factors, tone, pixels);
    }
    for (row, pixel) in rest.iter().zip(rest_shown) {
        let (row, pixel) = (array::from_ref(row), array::from_mut(pixel));
        full_group::<F, K, 1, T>(row, tables, factors, tone, pixel);
    }
}

/// The pixels of `N` elements, which look for a table together.
#[inline(always)]
fn full_group<F: Form, const K: usize, const N: usize, T: Encode>(
    rows: &[[F::Codes; K]; N],
    tables: &[F::Table; K],
    factors: &Factors,
    tone: &T,
    pixels: &mut [T::Pixel; N],
) {
    let mut sums = [F::Sum::default(); N];
    for (light, table) in tables.iter().enumerate() {
        for (sum, row) in sums.iter_mut().zip(rows) {
            if let Some(codes) = row.get(light) {
                *sum = F::add(*sum, table, codes);
            }
        }
    }
    for (sum, pixel) in sums.into_iter().zip(pixels) {
        show_one::<F, false, T>(sum, factors, tone, pixel);
    }
}

/// The pixels of some sums.
#[inline(never)]
fn show<F: Form, T: Encode>(sums: &[F::Sum], factors: [u16; 3], tone: &T, pixels: &mut [T::Pixel]) {
    let factors = &Factors::new::<F>(factors);
    if IS_SMALL {
        factors.stay_in_memory();
    }
    // Written out, because a compiler that saves flash unrolls no loop.
    let (groups, rest) = sums.as_chunks();
    let (shown, rest_shown) = pixels.as_chunks_mut();
    side_by_side(groups, shown, |[a, b, c, d], [w, x, y, z]| {
        show_one::<F, HAS_WIDE, T>(*a, factors, tone, w);
        show_one::<F, HAS_WIDE, T>(*b, factors, tone, x);
        show_one::<F, HAS_WIDE, T>(*c, factors, tone, y);
        show_one::<F, HAS_WIDE, T>(*d, factors, tone, z);
    });
    side_by_side(rest, rest_shown, |sum, pixel| {
        show_one::<F, HAS_WIDE, T>(*sum, factors, tone, pixel);
    });
}

#[inline(always)]
fn show_one<F: Form, const WIDE: bool, T: Encode>(
    sum: F::Sum,
    factors: &Factors,
    tone: &T,
    pixel: &mut T::Pixel,
) {
    *pixel = tone.encode(factors.steps::<F, T, WIDE>(sum));
    as_it_is();
}

/// Adds one light to the sums of some elements.
#[inline(never)]
fn add_light<F: Form, const K: usize>(
    rows: &[[F::Codes; K]],
    light: usize,
    table: &F::Table,
    sums: &mut [F::Sum],
) {
    if light >= K {
        return;
    }
    let (groups, rest) = rows.as_chunks();
    let (added, rest_added) = sums.as_chunks_mut();
    side_by_side(groups, added, |[a, b, c, d], [w, x, y, z]| {
        add_one::<F, K>(a, light, table, w);
        add_one::<F, K>(b, light, table, x);
        add_one::<F, K>(c, light, table, y);
        add_one::<F, K>(d, light, table, z);
    });
    side_by_side(rest, rest_added, |row, sum| {
        add_one::<F, K>(row, light, table, sum)
    });
}

#[inline(always)]
fn add_one<F: Form, const K: usize>(
    row: &[F::Codes; K],
    light: usize,
    table: &F::Table,
    sum: &mut F::Sum,
) {
    if let Some(codes) = row.get(light) {
        *sum = F::add(*sum, table, codes);
    }
}

/// Calls `f` with one after the other of two slices of one length; nothing happens with others.
///
/// Two pointers that walk take fewer instructions than an index into both.
#[inline(always)]
fn side_by_side<A, B>(from: &[A], to: &mut [B], mut f: impl FnMut(&A, &mut B)) {
    if from.len() != to.len() {
        return;
    }
    let (mut from, mut to) = (from, to);
    while let (Some((a, others_from)), Some((b, others_to))) =
        (from.split_first(), mem::take(&mut to).split_first_mut())
    {
        f(a, b);
        as_it_is();
        (from, to) = (others_from, others_to);
    }
}

/// Keeps the compiler from merging the turns of a loop, which would run out of registers.
#[inline(always)]
fn as_it_is() {
    black_box(());
}

/// Sums of all elements of an atlas of `K` lights, kept from frame to frame.
#[derive(Debug)]
pub struct Sums<'a, F: Form, const K: usize> {
    rows: &'a [[F::Codes; K]],
    sums: &'a mut [F::Sum],
    /// Of one light at a time.
    table: &'a mut F::Table,
}

impl<'a, F: Form, const K: usize> Sums<'a, F, K> {
    /// Adds up a mix, light after light, in `sums` of one entry per element.
    ///
    /// # Errors
    /// A slice that does not fit the atlas; [`RelightError::Code`] for another form.
    pub fn new(
        atlas: &Atlas<'a>,
        mix: &FrameMix,
        sums: &'a mut [F::Sum],
        table: &'a mut F::Table,
    ) -> Result<Self, RelightError> {
        check_elements(atlas, sums.len())?;
        let rows = rows::<F, K>(atlas)?;
        sums.fill(F::Sum::default());
        // As many as `K`, but one copy of the loop is enough.
        for light in 0..atlas.light_count() {
            fill_table::<F>(atlas, mix, light, table)?;
            add_light::<F, K>(rows, light as usize, table, sums);
        }
        Ok(Self { rows, sums, table })
    }

    /// The pixels of all elements.
    ///
    /// # Errors
    /// Slices and runs of different lengths.
    pub fn show<T: Encode>(
        &self,
        finish: &Finish<T>,
        pixels: &mut [T::Pixel],
    ) -> Result<(), RelightError> {
        check_pixels(self.sums.len(), pixels.len())?;
        let mut pixels = pixels;
        finish.by_run(self.sums, |sums, factors| {
            let own = pixels.split_off_mut(..sums.len()).unwrap_or_default();
            show::<F, T>(sums, factors, finish.tone, own);
        })
    }

    /// The pixels of all elements in their order, strip after strip in a buffer of any length: `send` takes each to the display.
    ///
    /// A strip is as long as the buffer, or ends with a run.
    ///
    /// # Errors
    /// Runs of another length; a buffer of none.
    pub fn show_strips<T: Encode>(
        &self,
        finish: &Finish<T>,
        strip: &mut [T::Pixel],
        mut send: impl FnMut(&[T::Pixel]),
    ) -> Result<(), RelightError> {
        if strip.is_empty() {
            return Err(RelightError::Elements { expected: 1 });
        }
        finish.by_run(self.sums, |sums, factors| {
            for sums in sums.chunks(strip.len()) {
                let strip = strip.get_mut(..sums.len()).unwrap_or_default();
                show::<F, T>(sums, factors, finish.tone, strip);
                send(strip);
            }
        })
    }

    /// Sets the levels of one light, and corrects the sums for it: [`Self::set`] and [`Self::apply`].
    ///
    /// # Errors
    /// [`RelightError::Lights`] without such a light. Nothing has changed then.
    pub fn change(
        &mut self,
        atlas: &Atlas,
        mix: &mut FrameMix,
        (light, levels): (u32, [u16; 3]),
    ) -> Result<(), RelightError> {
        self.set(atlas, mix, (light, levels))?;
        self.apply(light);
        Ok(())
    }

    /// Sets the levels of one light, and multiplies out by how much it changes; [`Self::apply`] must follow.
    ///
    /// # Errors
    /// [`RelightError::Lights`] without such a light. Nothing has changed then.
    pub fn set(
        &mut self,
        atlas: &Atlas,
        mix: &mut FrameMix,
        (light, levels): (u32, [u16; 3]),
    ) -> Result<(), RelightError> {
        fill_change::<F>(atlas, mix, (light, levels), self.table)
    }

    /// Corrects the sums for the light that was set.
    pub fn apply(&mut self, light: u32) {
        add_light::<F, K>(self.rows, light as usize, self.table, self.sums);
    }
}

/// Contributions of every code of every light, in codes of any kind.
#[derive(Debug)]
pub struct AnyTable<'a>(CodeTable<'a, u16>);

impl<'a> AnyTable<'a> {
    /// Multiplies out a mix into `values`, which has [`table_length`](super::table_length) entries or more.
    ///
    /// # Errors
    /// [`RelightError::Table`]; a mix of another atlas.
    pub fn new(atlas: &Atlas, mix: &FrameMix, values: &'a mut [u16]) -> Result<Self, RelightError> {
        let mut table = Self(CodeTable::new(atlas, values)?);
        for light in 0..atlas.light_count() {
            table.update(atlas, mix, light)?;
        }
        Ok(table)
    }

    /// Follows a change of one light of the mix.
    ///
    /// # Errors
    /// [`RelightError::Lights`] without such a light.
    pub fn update(
        &mut self,
        atlas: &Atlas,
        mix: &FrameMix,
        light: u32,
    ) -> Result<(), RelightError> {
        let weights = mix.weights(light, [SINGLE; 3])?;
        let values = [0, 1, 2].map(|channel| Values::of_light::<AllCodes>(atlas, light, channel));
        self.0.fill(light, |channel, code| {
            let values = values.get(channel).and_then(Option::as_ref);
            let term = weights.get(channel).zip(values);
            // Below the full scale.
            term.map_or(0, |(weight, values)| {
                weight.of(values.of::<AllCodes>(code)) as u16
            })
        });
        Ok(())
    }
}

/// Adds up all lights of an atlas in any codes, in `sums` of one entry per element.
///
/// # Errors
/// A slice that does not fit the atlas.
#[inline(always)]
pub fn add_any(atlas: &Atlas, table: &AnyTable, sums: &mut [[u16; 3]]) -> Result<(), RelightError> {
    check_elements(atlas, sums.len())?;
    sums.fill([0; 3]);
    atlas.for_each(|element, light, [code_r, code_g, code_b]| {
        if let Some(sum) = sums.get_mut(element as usize) {
            let [r, g, b] = *sum;
            *sum = [
                r.wrapping_add(table.0.get(light, 0, code_r)),
                g.wrapping_add(table.0.get(light, 1, code_g)),
                b.wrapping_add(table.0.get(light, 2, code_b)),
            ];
        }
    });
    Ok(())
}

/// The pixels of all elements of an atlas in any codes; `sums` is scratch of one entry per element.
///
/// # Errors
/// Slices and runs that do not fit the atlas.
pub fn full_any<T: Encode>(
    atlas: &Atlas,
    table: &AnyTable,
    finish: &Finish<T>,
    sums: &mut [[u16; 3]],
    pixels: &mut [T::Pixel],
) -> Result<(), RelightError> {
    check_elements(atlas, pixels.len())?;
    add_any(atlas, table, sums)?;
    let mut pixels = pixels;
    finish.by_run(sums, |sums, factors| {
        let factors = Factors::new::<Colour>(factors);
        let own = pixels.split_off_mut(..sums.len()).unwrap_or_default();
        for (sum, pixel) in sums.iter().zip(own) {
            *pixel = finish.tone.encode(factors.steps::<Colour, T, true>(*sum));
        }
    })
}

/// Whether there is a pixel for every element.
pub(super) fn check_pixels(elements: usize, pixels: usize) -> Result<(), RelightError> {
    let expected = elements as u32;
    match elements == pixels {
        true => Ok(()),
        false => Err(RelightError::Elements { expected }),
    }
}

/// Every element's codes of all its `K` lights.
fn rows<'a, F: Form, const K: usize>(
    atlas: &Atlas<'a>,
) -> Result<&'a [[F::Codes; K]], RelightError> {
    super::check_lights(atlas, K)?;
    let codes = F::codes(atlas).ok_or(RelightError::Code)?;
    Ok(codes.as_chunks().0)
}
