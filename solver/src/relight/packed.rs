//! Frames: from an atlas and a mix straight to the pixels of a display, one per element, in few instructions.
//!
//! Two [`Form`]s of codes, one for all lights of an atlas:
//!
//! * [`Lum`]: a luminance code stands for a colour once its light has one, so a light needs a table of 256 words that hold red,
//!   green and blue side by side in 10, 12 and 10 bits, and one addition adds all three. The full scale of a
//!   [`FrameMix`] keeps them from running into each other;
//! * [`Colour`]: a table of 256 for each channel, in 16 bits.
//!
//! [`full`] adds up `K` tables; [`Sums`] keeps what was added, for lights that change one at a time or
//! whose tables do not fit into memory together. Sums wrap, so undoing a change restores the same bits.
//! `K` is a constant because it halves the instructions. Any mixture of codes, tiles above all, goes through [`full_any`],
//! which decodes first.

use core::hint::black_box;

use super::frame::{Encode, Finish, FrameLight, FrameMix, Terms, Weight};
use super::{CodeTable, RelightError, check_elements};
use crate::atlas::{Atlas, AtlasError};
use crate::code::{AllCodes, Code, ExponentialCodes, Known};
use crate::color::Rgb;

/// Bits of red, green and blue in a packed word, red at the top.
const PACKED: [u32; 3] = [10, 12, 10];

/// Bits of a sum by itself.
const SINGLE: u32 = 16;

/// How the codes of an element are stored, and their contributions summed.
pub trait Form {
    /// The codes that an atlas in this form may be in.
    type Known: Known;
    /// What all lights of the atlas are written in has so many bytes.
    type Codes: Copy;
    /// The contribution of a light, or a sum of them.
    type Sum: Copy + Default;
    /// What every code contributes of `L` lights; those of one code stand next to each other, which suits the addressing of
    /// small cores best where `L` is a power of two.
    type Table<const L: usize>;

    /// Bits of a sum.
    const BITS: [u32; 3];

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

    /// Fills one light of a table with the difference of what two weights make of every code.
    fn fill<const L: usize>(
        table: &mut Self::Table<L>,
        light: usize,
        before: Option<&Terms>,
        after: &Terms,
    );

    /// A sum, and what a table says of a light's codes.
    #[must_use]
    fn add<const L: usize>(
        sum: Self::Sum,
        table: &Self::Table<L>,
        light: usize,
        codes: &Self::Codes,
    ) -> Self::Sum;

    /// What is shown of a sum.
    #[must_use]
    fn steps(sum: Self::Sum, factors: [u16; 3]) -> [u32; 3];
}

/// All lights in [`Code::Lum8`].
#[derive(Clone, Copy, Debug)]
pub struct Lum;

impl Form for Lum {
    type Known = ExponentialCodes;
    type Codes = u8;
    type Sum = u32;
    type Table<const L: usize> = [[u32; L]; 256];

    const BITS: [u32; 3] = PACKED;

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

    fn fill<const L: usize>(
        table: &mut [[u32; L]; 256],
        light: usize,
        before: Option<&Terms>,
        after: &Terms,
    ) {
        let [(r, values), (g, _), (b, _)] = after;
        let [old_r, old_g, old_b] = weights(before);
        let pack = |r: Weight, g: Weight, b: Weight, value| {
            r.of(value) << 22 | g.of(value) << 10 | b.of(value)
        };
        let is_new = before.is_none();
        let own = table.iter_mut().filter_map(|lights| lights.get_mut(light));
        values.with_codes::<Self::Known, _>(own, |entry, value| {
            let new = pack(*r, *g, *b, value);
            *entry = if is_new {
                new
            } else {
                new.wrapping_sub(pack(old_r, old_g, old_b, value))
            };
        });
    }

    #[inline(always)]
    fn add<const L: usize>(sum: u32, table: &[[u32; L]; 256], light: usize, code: &u8) -> u32 {
        sum.wrapping_add(entry(table, light, *code))
    }

    #[inline(always)]
    fn steps(sum: u32, factors: [u16; 3]) -> [u32; 3] {
        let [r, g, b] = factors;
        let (r, g, b) = (u32::from(r), u32::from(g), u32::from(b));
        // Products of 10 or 12 bits and 16; steps of 11.
        [
            ((sum >> 22) * r) >> 15,
            ((sum >> 10 & 0xfff) * g) >> 17,
            ((sum & 0x3ff) * b) >> 15,
        ]
    }
}

/// All lights in codes of three bytes.
#[derive(Clone, Copy, Debug)]
pub struct Colour;

impl Form for Colour {
    type Known = AllCodes;
    type Codes = [u8; 3];
    type Sum = [u16; 3];
    type Table<const L: usize> = [[[u16; L]; 256]; 3];

    const BITS: [u32; 3] = [SINGLE; 3];

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

    fn fill<const L: usize>(
        tables: &mut [[[u16; L]; 256]; 3],
        light: usize,
        before: Option<&Terms>,
        after: &Terms,
    ) {
        let channels = tables.iter_mut().zip(after).zip(weights(before));
        for ((table, (weight, values)), old) in channels {
            let own = table.iter_mut().filter_map(|lights| lights.get_mut(light));
            values.with_codes::<Self::Known, _>(own, |entry, value| {
                *entry = weight.of(value).wrapping_sub(old.of(value)) as u16;
            });
        }
    }

    #[inline(always)]
    fn add<const L: usize>(
        sum: [u16; 3],
        tables: &[[[u16; L]; 256]; 3],
        light: usize,
        [code_r, code_g, code_b]: &[u8; 3],
    ) -> [u16; 3] {
        let ([r, g, b], [red, green, blue]) = (sum, tables);
        [
            r.wrapping_add(entry(red, light, *code_r)),
            g.wrapping_add(entry(green, light, *code_g)),
            b.wrapping_add(entry(blue, light, *code_b)),
        ]
    }

    #[inline(always)]
    fn steps(sum: [u16; 3], factors: [u16; 3]) -> [u32; 3] {
        let ([r, g, b], [factor_r, factor_g, factor_b]) = (sum, factors);
        let step = |sum: u16, factor: u16| (u32::from(sum) * u32::from(factor)) >> 21;
        [step(r, factor_r), step(g, factor_g), step(b, factor_b)]
    }
}

#[inline(always)]
fn entry<V: Copy + Default, const L: usize>(table: &[[V; L]; 256], light: usize, code: u8) -> V {
    // A byte cannot leave a table of 256.
    #[allow(clippy::indexing_slicing)]
    let lights = &table[usize::from(code)];
    lights.get(light).copied().unwrap_or_default()
}

/// The weights of some terms, or of nothing.
fn weights(terms: Option<&Terms>) -> [Weight; 3] {
    terms.map_or([Weight::ZERO; 3], |terms| terms.map(|(weight, _)| weight))
}

/// Multiplies out one light of a mix.
///
/// # Errors
/// [`RelightError::Lights`] without such a light.
pub fn fill_table<F: Form, const L: usize>(
    atlas: &Atlas,
    mix: &FrameMix,
    light: u32,
    table: &mut F::Table<L>,
) -> Result<(), RelightError> {
    let after = mix.terms::<F::Known>(atlas, light, F::BITS)?;
    F::fill(table, light as usize, None, &after);
    Ok(())
}

/// The pixels of all elements, from a table of all `K` lights; `L` is at least `K`.
///
/// # Errors
/// Slices and runs that do not fit the atlas; [`RelightError::Code`] for another form.
pub fn full<F: Form, const K: usize, const L: usize, T: Encode>(
    atlas: &Atlas,
    table: &F::Table<L>,
    finish: &Finish<T>,
    pixels: &mut [T::Pixel],
) -> Result<(), RelightError> {
    check_elements(atlas, pixels.len())?;
    let mut rows = rows::<F, K>(atlas)?;
    if L < K {
        return Err(RelightError::Table { needed: K });
    }
    finish.by_run(pixels, |pixels, factors| {
        let own = rows.split_off(..pixels.len()).unwrap_or_default();
        full_run::<F, K, L, T>(own, table, factors, finish.tone, pixels);
    })
}

/// The pixels of a run. A function of its own has registers for all that it needs.
#[inline(never)]
fn full_run<F: Form, const K: usize, const L: usize, T: Encode>(
    rows: &[[F::Codes; K]],
    table: &F::Table<L>,
    factors: [u16; 3],
    tone: &T,
    pixels: &mut [T::Pixel],
) {
    for (row, pixel) in rows.iter().zip(pixels) {
        let mut sum = F::Sum::default();
        for (light, codes) in row.iter().enumerate() {
            sum = F::add(sum, table, light, codes);
        }
        *pixel = tone.encode(F::steps(sum, factors));
        as_it_is();
    }
}

/// The pixels of some sums.
#[inline(never)]
fn show<F: Form, T: Encode>(sums: &[F::Sum], factors: [u16; 3], tone: &T, pixels: &mut [T::Pixel]) {
    for (pixel, sum) in pixels.iter_mut().zip(sums) {
        *pixel = tone.encode(F::steps(*sum, factors));
        as_it_is();
    }
}

/// Adds one light to the sums of some elements.
#[inline(never)]
fn add_light<F: Form, const K: usize>(
    rows: &[[F::Codes; K]],
    light: usize,
    table: &F::Table<1>,
    sums: &mut [F::Sum],
) {
    if light >= K {
        return;
    }
    for (sum, row) in sums.iter_mut().zip(rows) {
        if let Some(codes) = row.get(light) {
            *sum = F::add(*sum, table, 0, codes);
        }
    }
}

/// Keeps the compiler from merging the turns of a loop, which would run out of registers.
#[inline(always)]
fn as_it_is() {
    black_box(());
}

/// Sums of all elements, kept from frame to frame.
#[derive(Debug)]
pub struct Sums<'a, F: Form> {
    sums: &'a mut [F::Sum],
    /// Of one light at a time.
    table: &'a mut F::Table<1>,
}

impl<'a, F: Form> Sums<'a, F> {
    /// Adds up a mix, light after light, in `sums` of one entry per element; `K` lights.
    ///
    /// # Errors
    /// A slice that does not fit the atlas; [`RelightError::Code`] for another form.
    pub fn new<const K: usize>(
        atlas: &Atlas,
        mix: &FrameMix,
        sums: &'a mut [F::Sum],
        table: &'a mut F::Table<1>,
    ) -> Result<Self, RelightError> {
        check_elements(atlas, sums.len())?;
        let rows = rows::<F, K>(atlas)?;
        sums.fill(F::Sum::default());
        // As many as `K`, but one copy of the loop is enough.
        for light in 0..atlas.light_count() {
            let after = mix.terms::<F::Known>(atlas, light, F::BITS)?;
            F::fill(table, 0, None, &after);
            add_light::<F, K>(rows, light as usize, table, sums);
        }
        Ok(Self { sums, table })
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
        let mut sums = &*self.sums;
        finish.by_run(pixels, |pixels, factors| {
            let own = sums.split_off(..pixels.len()).unwrap_or_default();
            show::<F, T>(own, factors, finish.tone, pixels);
        })
    }

    /// Sets the levels of one light, corrects the sums for it, and shows them: [`Self::set`] and [`Self::apply`].
    ///
    /// # Errors
    /// Slices and runs that do not fit the atlas, or no such light. Nothing has changed then.
    pub fn change<const K: usize, T: Encode>(
        &mut self,
        atlas: &Atlas,
        mix: &mut FrameMix,
        (light, levels): (u32, [u16; 3]),
        finish: &Finish<T>,
        pixels: &mut [T::Pixel],
    ) -> Result<(), RelightError> {
        check_elements(atlas, pixels.len())?;
        finish.check(pixels.len())?;
        rows::<F, K>(atlas)?;
        self.set(atlas, mix, (light, levels))?;
        self.apply::<K, T>(atlas, light, finish, pixels)
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
        let before = mix.terms::<F::Known>(atlas, light, F::BITS)?;
        mix.set(light, levels);
        let after = mix.terms::<F::Known>(atlas, light, F::BITS)?;
        F::fill(self.table, 0, Some(&before), &after);
        Ok(())
    }

    /// Corrects the sums for the light that was set, and shows them.
    ///
    /// # Errors
    /// Slices and runs that do not fit the atlas. Nothing has changed then.
    pub fn apply<const K: usize, T: Encode>(
        &mut self,
        atlas: &Atlas,
        light: u32,
        finish: &Finish<T>,
        pixels: &mut [T::Pixel],
    ) -> Result<(), RelightError> {
        check_elements(atlas, pixels.len())?;
        let mut rows = rows::<F, K>(atlas)?;
        let (light, table, mut sums) = (light as usize, &*self.table, &mut *self.sums);
        finish.by_run(pixels, |pixels, factors| {
            let own = rows.split_off(..pixels.len()).unwrap_or_default();
            let sums = sums.split_off_mut(..pixels.len()).unwrap_or_default();
            add_light::<F, K>(own, light, table, sums);
            show::<F, T>(sums, factors, finish.tone, pixels);
        })
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
        let terms = mix.terms::<AllCodes>(atlas, light, [SINGLE; 3])?;
        self.0.fill(light, |channel, code| {
            let term = terms.get(channel);
            // Below the full scale.
            term.map_or(0, |(weight, values)| {
                weight.of(values.of::<AllCodes>(code)) as u16
            })
        });
        Ok(())
    }
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
    check_elements(atlas, sums.len())?;
    check_elements(atlas, pixels.len())?;
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
    let mut sums = &*sums;
    finish.by_run(pixels, |pixels, factors| {
        let own = sums.split_off(..pixels.len()).unwrap_or_default();
        for (sum, pixel) in own.iter().zip(pixels) {
            *pixel = finish.tone.encode(Colour::steps(*sum, factors));
        }
    })
}

/// Every element's codes of all its `K` lights.
fn rows<'a, F: Form, const K: usize>(
    atlas: &Atlas<'a>,
) -> Result<&'a [[F::Codes; K]], RelightError> {
    super::check_lights(atlas, K)?;
    let codes = F::codes(atlas).ok_or(RelightError::Code)?;
    Ok(codes.as_chunks().0)
}
