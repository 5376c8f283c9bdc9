//! A mix, a unit and reflectances in whole numbers: what the frame kernels ([`packed`](super::packed)) work with.
//!
//! A *level* of 16 bits is a light's share of its full weight, channel by channel; with all lights at their
//! full weights the brightest element reaches the *full scale* `S` (W/m2, one per channel). A contribution is
//! `t = round(2^b g l x)`, with `b` bits for a sum, the level `l`, the value `x` of the code in 16 bits and the light's
//! gain `g = w s / (S 2^16)` (full weight `w`, scale `s` of the curve) in a mantissa of 16 bits. Sums of `t`
//! cannot reach `2^b`, whatever the levels: the full scale leaves room for half a unit per light.
//!
//! What is shown of a sum is `i = floor(2^-(b + 5) q sum)`, one of [`STEPS`] linear steps, where `q` of 16 bits holds
//! reflectance, exposure and `1 / pi`; [`Encode`] makes a pixel of three such steps.
//!
//! Error of a sum, in units of `2^-b S`: half for every light that is on, and of the sum itself `2^-13` by
//! the mantissas. Nothing here computes with floats: those that an atlas stores are taken apart bit by bit.

use core::f32::consts::FRAC_1_PI;

use super::{RelightError, Wide, check_lights};
use crate::atlas::{Atlas, LARGEST_SIDE, Tiles};
use crate::code::{
    AllCodes, Code, Curve, DECODED, DECODED_BITS, ExponentialCodes, Known, Magnitude,
};
use crate::color::Rgb;

/// Linear steps from black up that a display encodes.
pub const STEPS: u32 = 2048;

/// Bits of a value, a level, a gain, a reflectance.
const BITS: i32 = 16;

/// Where the values of the exponential code have 16 bits already.
const EXPONENTIAL: i32 = -(DECODED_BITS as i32);

/// Elements that are looked at together.
const CHUNK: usize = 8;

/// The fewest bits of a sum.
pub(super) const FEWEST_BITS: u32 = 10;

/// Makes a pixel of linear light.
pub trait Encode {
    /// What a display takes.
    type Pixel: Copy;

    /// Bits of the linear steps that red, green and blue are told apart by: 11 for all [`STEPS`], 10 for every second one.
    const BITS: [u32; 3];

    /// The step of [`STEPS`] at which white begins.
    fn white(&self) -> u16;

    /// The pixel of linear steps of so many bits; larger ones are taken as the last.
    fn encode(&self, steps: [u32; 3]) -> Self::Pixel;
}

/// A positive factor or nothing: `mantissa * 2^exponent`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Gain {
    mantissa: u16,
    exponent: i16,
}

impl Gain {
    const ZERO: Self = Self {
        mantissa: 0,
        exponent: 0,
    };

    pub(super) const fn parts(self) -> (u16, i16) {
        (self.mantissa, self.exponent)
    }

    pub(super) const fn from_parts((mantissa, exponent): (u16, i16)) -> Self {
        Self { mantissa, exponent }
    }

    fn new(value: Wide) -> Self {
        let Magnitude { mantissa, exponent } = value.magnitude();
        Self {
            mantissa: (mantissa >> 16) as u16,
            exponent: (exponent + 16).clamp(i16::MIN.into(), i16::MAX.into()) as i16,
        }
    }

    /// Whether the factor times a reflectance has no more than 16 bits.
    fn fits(self, reflectance: u16) -> bool {
        let product = u32::from(self.mantissa) * u32::from(reflectance);
        let bits = i32::from(self.exponent) - product.leading_zeros() as i32;
        product == 0 || bits <= -16
    }

    /// The factor times a level, for sums of so many bits.
    pub(super) fn weight(self, level: u16, bits: u32) -> Weight {
        let product = u32::from(self.mantissa) * u32::from(level);
        let excess = 17_u32.saturating_sub(product.leading_zeros());
        let shift = -(i32::from(self.exponent) + excess as i32 + bits as i32);
        match u32::try_from(shift) {
            Ok(shift @ 1..=31) => Weight {
                mantissa: product >> excess,
                shift,
            },
            _ => Weight::ZERO,
        }
    }
}

/// What multiplies a value of 16 bits: `mantissa * 2^-shift`, rounded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weight {
    /// Below 2^15.
    mantissa: u32,
    /// From 1 to 31.
    shift: u32,
}

impl Weight {
    pub(super) const ZERO: Self = Self {
        mantissa: 0,
        shift: 1,
    };

    /// The product; halves round up.
    pub(super) const fn of(self, value: u32) -> u32 {
        (self.mantissa * value + (1 << (self.shift - 1))) >> self.shift
    }
}

/// The values of a curve in 16 bits, times `2^exponent`.
#[derive(Clone, Copy, Debug)]
pub struct Values {
    curve: Curve,
    last: u16,
    exponent: i32,
}

impl Values {
    /// Those of the codes of a channel of a light.
    pub(super) fn of_light<K: Known>(atlas: &Atlas, light: u32, channel: usize) -> Option<Self> {
        let (curve, last) = atlas.curve(light, channel)?;
        Some(Self::new::<K>(curve, last))
    }

    fn new<K: Known>(curve: Curve, last: u16) -> Self {
        let exponent = if K::ONLY_EXPONENTIAL {
            EXPONENTIAL
        } else {
            let largest = K::magnitude(&curve, last);
            largest.exponent + 16 - largest.mantissa.leading_zeros() as i32
        };
        Self {
            curve,
            last,
            exponent,
        }
    }

    /// What 2^-`exponent` of a value is worth at full weight, W/m2.
    fn unit(&self, full: f32) -> Wide {
        let scale = self.curve.scale();
        let scale = Wide::new(scale.mantissa().into(), scale.exponent().into());
        Wide::from_float(full).times(scale).scaled(self.exponent)
    }

    /// Calls `f` with one entry and value after the other, from code 0 on.
    #[inline(always)]
    pub(super) fn with_codes<K: Known, E>(
        &self,
        entries: impl Iterator<Item = E>,
        mut f: impl FnMut(E, u32),
    ) {
        let is_exponential = matches!(self.curve, Curve::Exponential { .. });
        if K::ONLY_EXPONENTIAL || is_exponential && self.exponent == EXPONENTIAL {
            for (entry, value) in entries.zip(&DECODED) {
                f(entry, u32::from(*value));
            }
        } else {
            for (entry, value) in entries.zip(self.curve.magnitudes()) {
                f(entry, self.shifted::<K>(value));
            }
        }
    }

    /// Below 2^16.
    pub(super) fn of<K: Known>(&self, code: u16) -> u32 {
        self.shifted::<K>(K::magnitude(&self.curve, code.min(self.last)))
    }

    /// A value of the curve in 16 bits.
    #[inline(always)]
    fn shifted<K: Known>(&self, value: Magnitude) -> u32 {
        let shift = if K::ONLY_EXPONENTIAL {
            0
        } else {
            self.exponent - value.exponent
        };
        let distance = shift.unsigned_abs();
        if shift < 0 {
            value.mantissa << (distance & 15)
        } else {
            value.mantissa.checked_shr(distance).unwrap_or(0)
        }
    }
}

/// A light of a frame: its gain and its level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameLight {
    gains: [Gain; 3],
    levels: [u16; 3],
}

impl FrameLight {
    /// A light that gives nothing: room for [`FrameMix::new`].
    pub const EMPTY: Self = Self::new([Gain::ZERO; 3]);

    /// A light that is off.
    pub(super) const fn new(gains: [Gain; 3]) -> Self {
        Self {
            gains,
            levels: [0; 3],
        }
    }

    pub(super) const fn gains(&self) -> [Gain; 3] {
        self.gains
    }
}

/// A mix in levels.
#[derive(Debug)]
pub struct FrameMix<'a> {
    lights: &'a mut [FrameLight],
    /// W/m2.
    full_scale: [Wide; 3],
}

impl<'a> FrameMix<'a> {
    /// Fits the unit of every sum to `full`, the largest weight of every light; all lights are off.
    ///
    /// Looks once at every contribution. `lights` is room for one entry per light.
    ///
    /// # Errors
    /// Slices that do not fit the atlas; weights that are negative or not finite; [`RelightError::Range`] with more than 1000
    /// lights.
    #[inline(never)]
    pub fn new(
        atlas: &Atlas,
        full: &[Rgb],
        lights: &'a mut [FrameLight],
    ) -> Result<Self, RelightError> {
        Self::fit::<AllCodes>(atlas, full, lights)
    }

    /// The same for an atlas in exponential codes only, by a program that knows no others.
    ///
    /// # Errors
    /// As above, and [`RelightError::Code`] for lights in other codes.
    #[inline(never)]
    pub fn exponential(
        atlas: &Atlas,
        full: &[Rgb],
        lights: &'a mut [FrameLight],
    ) -> Result<Self, RelightError> {
        Self::fit::<ExponentialCodes>(atlas, full, lights)
    }

    fn fit<K: Known>(
        atlas: &Atlas,
        full: &[Rgb],
        lights: &'a mut [FrameLight],
    ) -> Result<Self, RelightError> {
        if !atlas.is_all_in(K::knows) {
            return Err(RelightError::Code);
        }
        super::check_mix(atlas, full)?;
        check_lights(atlas, lights.len())?;
        if full.len() > 1000 {
            return Err(RelightError::Range);
        }
        let mut mix = Self::of_lights(lights);
        mix.for_units::<K>(atlas, full, |_, scale, unit, largest| {
            *scale = scale.plus(unit.times(largest));
        });
        mix.fill_gains::<K>(atlas, full);
        // With every light by itself at its largest, some element is the brightest.
        let brightest = mix.brightest::<K>(atlas);
        let room = (1 << FEWEST_BITS) - 2 - full.len() as u32 / 2;
        for (scale, brightest) in mix.full_scale.iter_mut().zip(brightest) {
            let brightest = u64::from(brightest) + full.len() as u64;
            let grown = Wide::new(brightest << FEWEST_BITS, -BITS);
            let fits = grown.over(Wide::new(room.into(), 0));
            *scale = scale.times(fits);
        }
        mix.fill_gains::<K>(atlas, full);
        Ok(mix)
    }

    /// Without a full scale.
    pub(super) const fn of_lights(lights: &'a mut [FrameLight]) -> Self {
        Self {
            lights,
            full_scale: [Wide::ZERO; 3],
        }
    }

    /// Gains at the present full scale; levels become 0.
    fn fill_gains<K: Known>(&mut self, atlas: &Atlas, full: &[Rgb]) {
        for light in self.lights.iter_mut() {
            light.levels = [0; 3];
        }
        self.for_units::<K>(atlas, full, |gain, scale, unit, _| {
            *gain = Gain::new(unit.over(*scale).scaled(-BITS));
        });
    }

    /// Calls `f` for every light and channel with its gain, the full scale, what one of its values is worth, and the
    /// largest of them.
    #[inline(never)]
    fn for_units<K: Known>(
        &mut self,
        atlas: &Atlas,
        full: &[Rgb],
        f: fn(&mut Gain, &mut Wide, Wide, Wide),
    ) {
        let entries = self.lights.iter_mut().zip(full).zip(0..);
        for ((entry, full), light) in entries {
            let channels = entry.gains.iter_mut().zip(&mut self.full_scale);
            for (((gain, scale), full), channel) in channels.zip(full.to_array()).zip(0..) {
                if let Some(values) = Values::of_light::<K>(atlas, light, channel) {
                    let largest = Wide::new(values.of::<K>(values.last).into(), 0);
                    f(gain, scale, values.unit(full), largest);
                }
            }
        }
    }

    /// The largest sum of every channel with all lights at their full weights, in 2^-16 of the full scale.
    fn brightest<K: Known>(&self, atlas: &Atlas) -> [u32; 3] {
        let mut brightest = self.brightest_of_rows::<K>(atlas);
        if let Some(tiles) = atlas.tiles().filter(|_| !K::ONLY_EXPONENTIAL) {
            let in_tiles = self.brightest_of_tiles::<K>(atlas, &tiles);
            // No element has more of both.
            for (sum, other) in brightest.iter_mut().zip(in_tiles) {
                *sum += other;
            }
        }
        brightest
    }

    /// Of the lights in tiles. Its stack of 5 KB is its own.
    #[inline(never)]
    fn brightest_of_tiles<K: Known>(&self, atlas: &Atlas, tiles: &Tiles) -> [u32; 3] {
        let mut brightest = [0; 3];
        for (place, mut bits) in tiles.iter() {
            let mut sums = [[0; 3]; LARGEST_SIDE * LARGEST_SIDE];
            for light in atlas.lights_in_tiles() {
                let entry = self.lights.get(light as usize);
                let term = |channel| entry?.full_term::<K>(atlas, light, channel);
                let terms = term(0).zip(term(1)).zip(term(2));
                if let Some(((r, g), b)) = terms
                    && bits.next_light(place)
                {
                    let terms = [r, g, b];
                    let last = terms.each_ref().map(|term| term.values.last);
                    for (sums, codes) in sums.iter_mut().zip(bits.codes(last)).take(place.len()) {
                        for ((sum, term), code) in sums.iter_mut().zip(&terms).zip(codes) {
                            *sum += term.of::<K>(code);
                        }
                    }
                }
            }
            keep_largest(&mut brightest, &sums);
        }
        brightest
    }

    /// Of the lights that are not in tiles.
    #[inline(never)]
    fn brightest_of_rows<K: Known>(&self, atlas: &Atlas) -> [u32; 3] {
        let codes = (0..).map_while(|light| atlas.code(light));
        let stride = codes.map(Code::bytes).sum::<usize>();
        let (mut rows, mut brightest) = (atlas.codes(), [0; 3]);
        while !rows.is_empty() {
            let mut sums = [[0; 3]; CHUNK];
            let mut begin = 0;
            for (entry, light) in self.lights.iter().zip(0..) {
                let code = atlas.code(light).filter(|code| !code.is_tiled());
                let Some(bytes) = code.map(Code::bytes) else {
                    continue;
                };
                for channel in 0..3 {
                    let Some(term) = entry.full_term::<K>(atlas, light, channel) else {
                        continue;
                    };
                    // One byte stands for all channels.
                    let codes = rows
                        .get(begin + channel.min(bytes - 1)..)
                        .unwrap_or_default();
                    let codes = codes.iter().step_by(stride.max(1));
                    for (sum, code) in sums
                        .iter_mut()
                        .filter_map(|sum| sum.get_mut(channel))
                        .zip(codes)
                    {
                        *sum += term.of::<K>((*code).into());
                    }
                }
                begin += bytes;
            }
            keep_largest(&mut brightest, &sums);
            rows = rows.get(CHUNK * stride..).unwrap_or_default();
        }
        brightest
    }

    /// The gains of [`Finish`]; `None` where its error is [`RelightError::Range`].
    #[inline(never)]
    pub(super) fn shown(&self, runs: &[Run], exposure: f32, white: u16) -> Option<[Gain; 3]> {
        let is_positive = (1..0x7f80_0000).contains(&exposure.to_bits());
        let white = Wide::new(white.into(), -(STEPS.ilog2() as i32));
        let shown = Wide::from_float(exposure).times(Wide::from_float(FRAC_1_PI));
        let shown = shown.times(white);
        let gains = self.full_scale.map(|scale| Gain::new(shown.times(scale)));
        let fits = |run: &Run| {
            let mut channels = gains.iter().zip(run.reflectance);
            channels.all(|(gain, reflectance)| gain.fits(reflectance))
        };
        (is_positive && runs.iter().all(fits)).then_some(gains)
    }

    /// Sets the levels of a light: shares of its full weight, 2^-16 each; without such a light nothing happens.
    pub fn set(&mut self, light: u32, levels: [u16; 3]) {
        if let Some(entry) = self.lights.get_mut(light as usize) {
            entry.levels = levels;
        }
    }

    /// The levels of a light; `None` without such a light.
    #[must_use]
    pub fn levels(&self, light: u32) -> Option<[u16; 3]> {
        Some(self.lights.get(light as usize)?.levels)
    }

    /// What multiplies the values of a light's codes, for sums of so many bits.
    pub(super) fn weights(&self, light: u32, bits: [u32; 3]) -> Result<[Weight; 3], RelightError> {
        let expected = self.lights.len() as u32;
        let entry = self.lights.get(light as usize);
        let entry = entry.ok_or(RelightError::Lights { expected })?;
        Ok(entry.weights(bits))
    }

    /// The same at other levels.
    pub(super) fn weights_at(
        &self,
        light: u32,
        levels: [u16; 3],
        bits: [u32; 3],
    ) -> Result<[Weight; 3], RelightError> {
        let expected = self.lights.len() as u32;
        let entry = self.lights.get(light as usize).copied();
        let entry = entry.ok_or(RelightError::Lights { expected })?;
        Ok(FrameLight { levels, ..entry }.weights(bits))
    }
}

/// What the codes of a channel of a light contribute.
struct Term {
    weight: Weight,
    values: Values,
}

impl Term {
    fn of<K: Known>(&self, code: u16) -> u32 {
        self.weight.of(self.values.of::<K>(code))
    }
}

impl FrameLight {
    /// What multiplies the values of the codes.
    #[inline(never)]
    fn weights(&self, bits: [u32; 3]) -> [Weight; 3] {
        let mut weights = [Weight::ZERO; 3];
        let channels = weights.iter_mut().zip(&self.gains);
        for ((weight, gain), (level, bits)) in channels.zip(self.levels.iter().zip(bits)) {
            *weight = gain.weight(*level, bits);
        }
        weights
    }

    /// At the full weight, in 2^-16 of the full scale.
    fn full_term<K: Known>(&self, atlas: &Atlas, light: u32, channel: usize) -> Option<Term> {
        let gain = self.gains.get(channel)?;
        Some(Term {
            weight: gain.weight(u16::MAX, BITS as u32),
            values: Values::of_light::<K>(atlas, light, channel)?,
        })
    }
}

fn keep_largest(largest: &mut [u32; 3], sums: &[[u32; 3]]) {
    for sums in sums {
        for (largest, sum) in largest.iter_mut().zip(sums) {
            *largest = (*largest).max(*sum);
        }
    }
}

/// Elements that follow each other and reflect alike.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C)]
pub struct Run {
    /// How many.
    pub elements: u32,
    /// Their reflectance, in 2^-16; of a radiosity, which has it multiplied in, [`u16::MAX`].
    pub reflectance: [u16; 3],
}

/// From sums to pixels: reflectances, exposure, and how a display encodes.
#[derive(Debug)]
pub struct Finish<'a, T> {
    runs: &'a [Run],
    /// Of all runs.
    elements: usize,
    gains: [Shown; 3],
    pub(super) tone: &'a T,
}

impl<'a, T: Encode> Finish<'a, T> {
    /// Shows radiance times `exposure`, 1 being white; `runs` are all elements in their order.
    ///
    /// # Errors
    /// [`RelightError::Elements`]; [`RelightError::Range`] for an exposure that is not positive and finite, or under which an
    /// element may show brighter than the last of the [`STEPS`]: take a table with a lower white.
    #[inline(never)]
    pub fn new(
        atlas: &Atlas,
        mix: &FrameMix,
        runs: &'a [Run],
        exposure: f32,
        tone: &'a T,
    ) -> Result<Self, RelightError> {
        let gains = mix.shown(runs, exposure, tone.white());
        Self::with_gains(atlas, runs, gains.ok_or(RelightError::Range)?, tone)
    }

    pub(super) fn with_gains(
        atlas: &Atlas,
        runs: &'a [Run],
        gains: [Gain; 3],
        tone: &'a T,
    ) -> Result<Self, RelightError> {
        let elements = atlas.element_count() as usize;
        check_runs(runs, elements)?;
        Ok(Self {
            runs,
            elements,
            gains: gains.map(Shown::new),
            tone,
        })
    }

    /// Whether there are so many elements.
    fn check(&self, elements: usize) -> Result<(), RelightError> {
        let expected = self.elements as u32;
        if elements == self.elements {
            Ok(())
        } else {
            Err(RelightError::Elements { expected })
        }
    }

    /// Calls `f` with what belongs to the elements of every run, and what multiplies their sums.
    #[inline(always)]
    pub(super) fn by_run<E>(
        &self,
        mut of_elements: &[E],
        mut f: impl FnMut(&[E], [u16; 3]),
    ) -> Result<(), RelightError> {
        self.check(of_elements.len())?;
        for run in self.runs {
            let own = of_elements.split_off(..run.elements as usize);
            let ([r, g, b], [gain_r, gain_g, gain_b]) = (run.reflectance, self.gains);
            let factors = [gain_r.factor(r), gain_g.factor(g), gain_b.factor(b)];
            f(own.unwrap_or_default(), factors);
        }
        Ok(())
    }
}

/// What multiplies a reflectance, `mantissa * 2^-shift`, for a factor of sums in 2^-16 steps of 2^-11 of the full scale.
#[derive(Clone, Copy, Debug)]
struct Shown {
    mantissa: u16,
    /// Up to 31.
    shift: u16,
}

impl Shown {
    fn new(gain: Gain) -> Self {
        match u16::try_from(-gain.exponent) {
            Ok(shift @ 0..=31) => Self {
                mantissa: gain.mantissa,
                shift,
            },
            // Vanishes; or [`Gain::fits`] black only.
            _ => Self {
                mantissa: 0,
                shift: 0,
            },
        }
    }

    const fn factor(self, reflectance: u16) -> u16 {
        ((self.mantissa as u32 * reflectance as u32) >> self.shift) as u16
    }
}

/// Whether the runs are so many elements.
#[inline(never)]
fn check_runs(runs: &[Run], elements: usize) -> Result<(), RelightError> {
    let left = runs.iter().try_fold(elements, |left, run| {
        left.checked_sub(run.elements as usize)
    });
    let expected = elements as u32;
    match left {
        Some(0) => Ok(()),
        _ => Err(RelightError::Elements { expected }),
    }
}
