//! Tiles: codes of neighbouring elements as small differences, in as many bits as they need.
//!
//! Elements stand in *grids* of `width` columns, row by row; a grid is cut into tiles of `side x side`
//! elements (fewer at its end), a grid of one row into tiles of `side^2` elements. A tile holds, light after light, what every one of its elements gets:
//! `g`, then `r - g`, then `b - g`, of whole-number codes `r, g, b` in common steps, so that the same hue
//! costs nothing.
//!
//! Lights that come the same way, through the same door or from the same lamps' corner, look alike down to what their bake left to chance. So
//! lights stand in an order of their own, in which such lights follow each other, and each of the three is written as what it
//! is more than a [`Share`] of the same of the light before: `v = g - share(g')`.
//!
//! Each `v` is predicted from its left neighbour `a`, the upper `b`, the upper left `c` and the
//! upper right `d`, in one of two ways ([`Predictor`]). Where light has edges (Weinberger, Seroussi and Sapiro 2000, LOCO-I,
//! eq. 1): `min(a, b)` if `c >= max(a, b)`, `max(a, b)` if `c <= min(a, b)`, else the plane `a + b - c`. Where it is
//! rough: the mean `(2 a + b + d) / 4`, rounded. Of a neighbour that is not in the tile [`Predictor::predict`] says what stands for it. What is left, `e`, is written as
//! `z = 2 e` or `-2 e - 1`: `z >> m` ones, a zero, and the lower `m` bits (Rice 1979), `m`, the predictor and the share once per tile,
//! light and channel.
//!
//! Little-endian, lengths in bytes, `p` grids, `t` tiles (which follow from grids and side), `k` lights of the atlas:
//!
//! | at | what |
//! | --- | --- |
//! | 0 | `u8` side, 1 to [`LARGEST_SIDE`] |
//! | 1 | `u8` bits of a first `g`, 1 to 16 |
//! | 2 | two zero bytes |
//! | 4 | `u32` grids `p` |
//! | 8 | `u32` tiles `t` |
//! | 12 | `k` times `u8`: the order of the lights, every [`GROUP`] by themselves: tags less the first of the group |
//! | | `p` grids of 4: width `u16`, height `u16`, both at least 1; together they have all elements |
//! | | `t` times `u32`: where the bits of a tile begin, in bytes from the first |
//! | | the bits, highest first |
//!
//! Bits of a tile: for every light in tiles, in their order, one bit, 0 when all its codes are 0 here. Else for `g`, `r - g`, `b - g`: four
//! bits `m`, 15 when all is as the first predictor has it without a share, else one bit for the predictor (1: the mean) and the share (0: none, 10: half, 11: all) of the last
//! light here that was not 0; the first value (`g` itself in its bits if it has no share; of the others `z` as
//! ones, as many as `(z + 8) >> 3` has bits but one, a zero, and the bits of `z + 8` below its highest); then, unless `m = 15`,
//! the others: [`ESCAPE`] ones stand before 18 bits of `z` itself. Bits past the end are 0.

use core::num::NonZeroU16;

use super::AtlasError;

/// Most elements along a tile.
pub const LARGEST_SIDE: usize = 16;

/// Ones before a difference that is written in full.
pub const ESCAPE: u32 = 16;

/// Bits of a difference that is written in full.
pub const FULL_BITS: u32 = 18;

/// Where `m` says that all is as predicted.
pub const PREDICTED: u32 = 15;

/// Bits of a first difference below its highest, at least.
pub const FIRST_BITS: u32 = 3;

const HEADER_BYTES: usize = 12;

/// The tiles of a checked atlas.
#[derive(Clone, Copy, Debug)]
pub struct Tiles<'a> {
    side: u16,
    first_bits: u32,
    order: &'a [u8],
    grids: &'a [u8],
    offsets: &'a [u8],
    bits: &'a [u8],
}

/// Where the elements of a tile stand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// Its first element.
    pub first: u32,
    /// From an element to the one below it.
    pub stride: u32,
    /// Columns, at most [`LARGEST_SIDE`], or its square in one row.
    pub columns: u16,
    /// Rows, at most [`LARGEST_SIDE`].
    pub rows: u16,
}

impl Place {
    /// How many elements it has.
    pub(crate) const fn len(self) -> usize {
        self.columns as usize * self.rows as usize
    }

    /// Its elements, row by row.
    pub fn elements(self) -> impl Iterator<Item = u32> {
        let row = move |row: u32| self.first + row * self.stride;
        (0..u32::from(self.rows)).flat_map(move |r| row(r)..row(r) + u32::from(self.columns))
    }
}

/// Consecutive lights that can change places: as many as a byte can tell apart.
pub const GROUP: usize = 256;

/// The most elements of a tile.
const LARGEST: usize = LARGEST_SIDE * LARGEST_SIDE;

impl<'a> Tiles<'a> {
    /// Checks a table of tiles for so many elements and lights.
    pub(super) fn parse(bytes: &'a [u8], elements: u32, lights: u32) -> Result<Self, AtlasError> {
        let illegal = AtlasError::Illegal("table of tiles");
        let (header, rest) = bytes.split_first_chunk::<HEADER_BYTES>().ok_or(illegal)?;
        let [side, first_bits, 0, 0, g0, g1, g2, g3, t0, t1, t2, t3] = *header else {
            return Err(illegal);
        };
        let count = |bytes| 4 * u64::from(u32::from_le_bytes(bytes));
        let (grids, tiles) = (count([g0, g1, g2, g3]), count([t0, t1, t2, t3]));
        if u64::from(lights) + grids + tiles > rest.len() as u64
            || !(1..=LARGEST_SIDE).contains(&usize::from(side))
            || !(1..=16).contains(&first_bits)
        {
            return Err(illegal);
        }
        let (order, rest) = rest.split_at_checked(lights as usize).ok_or(illegal)?;
        let (grids, rest) = rest.split_at_checked(grids as usize).ok_or(illegal)?;
        let (offsets, bits) = rest.split_at_checked(tiles as usize).ok_or(illegal)?;
        let tiles = Self {
            side: side.into(),
            first_bits: first_bits.into(),
            order,
            grids,
            offsets,
            bits,
        };
        let (mut held, mut count) = (0_u64, 0_u64);
        for [width, height] in tiles.grids() {
            if width == 0 || height == 0 {
                return Err(illegal);
            }
            held += u64::from(width) * u64::from(height);
            let (along, down) = sides(tiles.side, height);
            count += u64::from(parts(width, along)) * u64::from(parts(height, down));
        }
        let offsets = tiles.offsets.as_chunks::<4>().0;
        let is_inside = |offset: &[u8; 4]| u32::from_le_bytes(*offset) as usize <= bits.len();
        if !order.chunks(GROUP).all(is_permutation) {
            return Err(AtlasError::Illegal("order of lights"));
        }
        if held != elements.into() || count != tiles.len() as u64 || !offsets.iter().all(is_inside)
        {
            return Err(illegal);
        }
        Ok(tiles)
    }

    /// Elements along a tile.
    #[must_use]
    pub const fn side(&self) -> u16 {
        self.side
    }

    /// How many tiles there are.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.offsets.len() / 4
    }

    /// True without a tile.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.offsets.is_empty()
    }

    /// Tags of all lights, of which a tile's bits have those in tiles in this order.
    pub fn order(&self) -> impl Iterator<Item = u32> + use<'a> {
        tags(self.order)
    }

    /// Width and height of every grid.
    fn grids(&self) -> impl Iterator<Item = [u16; 2]> + use<'a> {
        let grids = self.grids.as_chunks::<4>().0.iter();
        grids.map(|[w0, w1, h0, h1]| [[*w0, *w1], [*h0, *h1]].map(u16::from_le_bytes))
    }

    /// Where every tile stands, with the bits from its beginning on.
    pub fn iter(&self) -> impl Iterator<Item = (Place, TileBits<'a>)> + use<'a> {
        let (bits, first_bits) = (self.bits, self.first_bits);
        let offsets = self.offsets.as_chunks::<4>().0.iter();
        let offsets = offsets.map(|offset| u32::from_le_bytes(*offset) as usize);
        let bits = offsets.map(move |offset| TileBits {
            bits: Bits::new(bits.get(offset..).unwrap_or_default()),
            first_bits,
            coded: [[0; 3]; LARGEST],
        });
        places(self.grids(), self.side).zip(bits)
    }
}

/// The tags of all lights from their order, every [`GROUP`] by themselves.
pub fn tags(order: &[u8]) -> impl Iterator<Item = u32> {
    let groups = (0..).step_by(GROUP).zip(order.chunks(GROUP));
    groups.flat_map(|(first, tags)| tags.iter().map(move |tag| first + u32::from(*tag)))
}

/// Whether every number below the length is there; no more than [`GROUP`].
fn is_permutation(order: &[u8]) -> bool {
    let mut seen = [false; GROUP];
    for number in order {
        if let Some(seen) = seen.get_mut(usize::from(*number)) {
            *seen = true;
        }
    }
    seen.iter().take(order.len()).all(|seen| *seen)
}

/// Where the tiles of some grids stand, in their order.
pub fn places(grids: impl Iterator<Item = [u16; 2]>, side: u16) -> impl Iterator<Item = Place> {
    let starts = grids.scan(0_u32, |next, [width, height]| {
        let first = *next;
        *next += u32::from(width) * u32::from(height);
        Some((first, width, height))
    });
    starts.flat_map(move |(first, width, height)| {
        let (along, down) = sides(side, height);
        // No part begins beyond the end, which has 16 bits.
        let begins =
            |length, part: NonZeroU16| (0..parts(length, part)).map(move |i| i * part.get());
        begins(height, down).flat_map(move |y| {
            begins(width, along).map(move |x| Place {
                first: first + u32::from(y) * u32::from(width) + u32::from(x),
                stride: width.into(),
                columns: along.get().min(width - x),
                rows: down.get().min(height - y),
            })
        })
    })
}

/// Parts of a length, the last of which may be shorter.
fn parts(length: u16, part: NonZeroU16) -> u16 {
    length / part + u16::from(!length.is_multiple_of(part.get()))
}

/// Columns and rows of a tile in a grid of this height.
fn sides(side: u16, height: u16) -> (NonZeroU16, NonZeroU16) {
    let side = side.clamp(1, LARGEST_SIDE as u16);
    let (along, down) = if height == 1 {
        (side * side, 1)
    } else {
        (side, side)
    };
    let least_one = |length| NonZeroU16::new(length).unwrap_or(NonZeroU16::MIN);
    (least_one(along), least_one(down))
}

/// The bits of a tile that are still to be read, light after light.
#[derive(Clone, Debug)]
pub struct TileBits<'a> {
    bits: Bits<'a>,
    first_bits: u32,
    /// `r - g`, `g`, `b - g` of the last light that was not 0, row by row; they wrap.
    coded: [[u16; 3]; LARGEST],
}

impl TileBits<'_> {
    /// Bits that were not read yet, with those of the tiles that follow.
    #[must_use]
    pub fn remaining(&self) -> usize {
        8 * self.bits.bytes.len() + self.bits.held as usize
    }

    /// Reads the next light; false when all its codes are 0, else [`Self::codes`] has them.
    pub fn next_light(&mut self, place: Place) -> bool {
        if self.bits.take(1) == 0 {
            return false;
        }
        let columns = usize::from(place.columns).max(1);
        let coded = self.coded.get_mut(..place.len()).unwrap_or_default();
        for channel in [1, 0, 2] {
            let (bits, first_bits) = (&mut self.bits, (channel == 1).then_some(self.first_bits));
            Plane::read(bits, first_bits).decode(bits, coded, channel, columns);
        }
        true
    }

    /// Red, green and blue of the light that was read last, row by row; codes beyond `last` are taken as that.
    pub fn codes(&self, last: [u16; 3]) -> impl Iterator<Item = [u16; 3]> {
        let [last_r, last_g, last_b] = last.map(i32::from);
        self.coded.iter().map(move |[r, g, b]| {
            let [r, green, b] = [signed(*r, 0), signed(*g, 1), signed(*b, 2)];
            let legal = |code: i32, last: i32| code.clamp(0, last) as u16;
            [
                legal(green + r, last_r),
                legal(green, last_g),
                legal(green + b, last_b),
            ]
        })
    }
}

/// How one of the three that are coded is written, and its first value.
struct Plane {
    parameter: u32,
    predictor: Predictor,
    share: Share,
    first: i32,
}

impl Plane {
    /// `first_bits` of green.
    fn read(bits: &mut Bits, first_bits: Option<u32>) -> Self {
        let parameter = bits.take(4);
        let (predictor, share) = if parameter == PREDICTED {
            (Predictor::Edge, Share::None)
        } else {
            (bits.take_predictor(), bits.take_share())
        };
        let first = match first_bits {
            Some(count) if share == Share::None => bits.take(count) as i32,
            _ => unfold(bits.take_first()),
        };
        Self {
            parameter,
            predictor,
            share,
            first,
        }
    }

    /// Puts this light in the place of the one before.
    fn decode(&self, bits: &mut Bits, coded: &mut [[u16; 3]], channel: usize, columns: usize) {
        // Without the share of the light before.
        let mut own = [0; LARGEST];
        for (at, coded) in coded.iter_mut().enumerate() {
            let value = if at == 0 {
                self.first
            } else {
                let of = |at: usize| own.get(at).copied().unwrap_or(0);
                let column = at % columns;
                let left = (column > 0).then(|| of(at - 1));
                let above = at.checked_sub(columns).map(|above| {
                    let left = above - usize::from(column > 0);
                    let right = above + usize::from(column + 1 < columns);
                    [left, above, right].map(of)
                });
                let rest = if self.parameter == PREDICTED {
                    0
                } else {
                    unfold(bits.take_rice(self.parameter))
                };
                self.predictor.predict(left, above).wrapping_add(rest)
            };
            if let (Some(own), Some(code)) = (own.get_mut(at), coded.get_mut(channel)) {
                *own = value;
                *code = value.wrapping_add(self.share.of(signed(*code, channel))) as u16;
            }
        }
    }
}

/// What of the light before is taken away.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Share {
    /// Nothing.
    None,
    /// Half of it, rounded up.
    Half,
    /// All of it.
    All,
}

impl Share {
    /// The share of a code.
    #[must_use]
    pub const fn of(self, code: i32) -> i32 {
        match self {
            Self::None => 0,
            Self::Half => (code + 1) >> 1,
            Self::All => code,
        }
    }
}

/// Green codes are whole numbers, the differences of the others signed ones.
const fn signed(code: u16, channel: usize) -> i32 {
    if channel == 1 {
        code as i32
    } else {
        code as i16 as i32
    }
}

/// What a value is expected to be from its neighbours.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Predictor {
    /// The plane through the neighbours, but no more than an edge has.
    Edge,
    /// Their mean.
    Mean,
}

impl Predictor {
    /// From the neighbour to the left, and those above: to the left, straight above, and to the right, the
    /// middle one in place of one that is not there.
    #[must_use]
    pub const fn predict(self, left: Option<i32>, above: Option<[i32; 3]>) -> i32 {
        match (left, above, self) {
            (Some(left), Some([corner, above, _]), Self::Edge) => {
                let (low, high) = if left < above {
                    (left, above)
                } else {
                    (above, left)
                };
                if corner >= high {
                    low
                } else if corner <= low {
                    high
                } else {
                    left.wrapping_add(above).wrapping_sub(corner)
                }
            }
            (Some(left), Some([_, above, right]), Self::Mean) => {
                let sum = left.wrapping_mul(2).wrapping_add(above);
                sum.wrapping_add(right).wrapping_add(2) >> 2
            }
            (Some(only), None, _) | (None, Some([_, only, _]), _) => only,
            (None, None, _) => 0,
        }
    }
}

/// `0, -1, 1, -2, 2, ...` from `0, 1, 2, 3, 4, ...`.
const fn unfold(z: u32) -> i32 {
    (z >> 1) as i32 ^ -((z & 1) as i32)
}

/// Bits that are still to be read, highest first; zeros follow the last.
#[derive(Clone, Debug)]
struct Bits<'a> {
    bytes: core::slice::Iter<'a, u8>,
    /// The next ones, at the top.
    buffer: u32,
    /// How many of them are from the bytes.
    held: u32,
}

impl<'a> Bits<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        Self {
            bytes: bytes.iter(),
            buffer: 0,
            held: 0,
        }
    }

    /// At least 25 bits are held afterwards.
    fn fill(&mut self) {
        while self.held <= 24 {
            let byte = self.bytes.next().copied().unwrap_or(0);
            self.buffer |= u32::from(byte) << (24 - self.held);
            self.held += 8;
        }
    }

    const fn skip(&mut self, count: u32) {
        self.buffer <<= count;
        self.held -= count;
    }

    /// The next `count` bits, at most 24.
    fn take(&mut self, count: u32) -> u32 {
        if count == 0 {
            return 0;
        }
        self.fill();
        let value = self.buffer >> (32 - count);
        self.skip(count);
        value
    }

    fn take_predictor(&mut self) -> Predictor {
        match self.take(1) {
            0 => Predictor::Edge,
            _ => Predictor::Mean,
        }
    }

    fn take_share(&mut self) -> Share {
        match self.take(1) {
            0 => Share::None,
            _ if self.take(1) == 0 => Share::Half,
            _ => Share::All,
        }
    }

    /// A difference with parameter `m`.
    fn take_rice(&mut self, m: u32) -> u32 {
        self.fill();
        let ones = self.buffer.leading_ones();
        if ones >= ESCAPE {
            self.skip(ESCAPE);
            return self.take(FULL_BITS);
        }
        self.skip(ones + 1);
        ones << m | self.take(m)
    }

    /// A first difference.
    fn take_first(&mut self) -> u32 {
        self.fill();
        let ones = self.buffer.leading_ones().min(ESCAPE);
        self.skip(ones);
        self.take(1);
        let bits = ones + FIRST_BITS;
        (1 << bits | self.take(bits)) - (1 << FIRST_BITS)
    }
}
