//! Writes the tiles of an atlas: see [`relume::atlas::Tiles`] for what the bits mean.

use rayon::prelude::*;
use relume::atlas::{
    ESCAPE, FIRST_BITS, FULL_BITS, LARGEST_SIDE, LightEntry, PREDICTED, Place, Predictor, Share,
    places, tags,
};
use relume::color::Rgb;
use relume::mesh::{Element, Face};

use super::order::order;
use crate::mesh::OwnedMesh;
use crate::solution::Solution;

/// Sides that are tried; the smallest table wins.
const SIDES: [u16; 5] = [4, 6, 8, 12, LARGEST_SIDE as u16];

/// The side of the tiles in which lights are compared.
const COMPARED_SIDE: u16 = 12;

/// The table of tiles of all lights in tiles; empty without one. `values` element by element.
pub(super) fn encode(solution: &Solution, lights: &[LightEntry], values: &[Rgb]) -> Vec<u8> {
    let tiled: Vec<usize> = (0..lights.len())
        .filter(|tag| lights[*tag].code.is_tiled())
        .collect();
    if tiled.is_empty() {
        return Vec::new();
    }
    let planes: Vec<Vec<[u16; 3]>> = tiled
        .par_iter()
        .map(|tag| {
            let own = values.iter().skip(*tag).step_by(lights.len());
            codes(&lights[*tag], own)
        })
        .collect();
    let grids = match solution.image {
        Some([width, height]) => vec![[width as u16, height as u16]],
        None => grids(&solution.mesh),
    };
    let compared: Vec<Place> = places(grids.iter().copied(), COMPARED_SIDE).collect();
    let order = order(&planes, &tiled, lights.len(), &compared);
    let sides = SIDES.iter();
    let tables = sides.map(|side| table(&grids, *side, &order, &planes, &tiled));
    tables.min_by_key(Vec::len).unwrap_or_default()
}

/// The codes of one light.
fn codes<'a>(light: &LightEntry, values: impl Iterator<Item = &'a Rgb>) -> Vec<[u16; 3]> {
    let code =
        |channel: usize, value: f32| light.curves[channel].encode(value, light.last[channel]);
    values
        .map(|value| [code(0, value.r), code(1, value.g), code(2, value.b)])
        .collect()
}

/// Width and height of the grids in which the elements of a mesh stand, in their order.
///
/// A face of four vertices that was cut both ways is a grid; all between two such faces stand in a row.
fn grids(mesh: &OwnedMesh) -> Vec<[u16; 2]> {
    let mut grids = Vec::new();
    let mut waiting = 0_usize;
    let flush = |waiting: &mut usize, grids: &mut Vec<[u16; 2]>| {
        while *waiting > 0 {
            let width = (*waiting).min(usize::from(u16::MAX));
            grids.push([width as u16, 1]);
            *waiting -= width;
        }
    };
    for face in &mesh.faces {
        match grid(face, &mesh.elements) {
            Some(grid) => {
                flush(&mut waiting, &mut grids);
                grids.push(grid);
            }
            None => waiting += face.element_count as usize,
        }
    }
    flush(&mut waiting, &mut grids);
    grids
}

fn grid(face: &Face, elements: &[Element]) -> Option<[u16; 2]> {
    let first = face.first_element as usize;
    let own = &elements[first..first + face.element_count as usize];
    let start = own.first()?.from.y;
    let width = own.iter().take_while(|e| e.from.y == start).count();
    let rows = own.chunks(width);
    let is_grid = |row: &[Element]| {
        row.len() == width
            && row
                .iter()
                .zip(own)
                .all(|(a, b)| a.from.x == b.from.x && a.to.x == b.to.x && a.from.y == row[0].from.y)
    };
    let height = rows.len();
    let is_flat = width < 2 || height < 2;
    if is_flat || !own.chunks(width).all(is_grid) {
        return None;
    }
    Some([u16::try_from(width).ok()?, u16::try_from(height).ok()?])
}

/// A whole table with tiles of this side.
fn table(
    grids: &[[u16; 2]],
    side: u16,
    order: &[u8],
    planes: &[Vec<[u16; 3]>],
    tiled: &[usize],
) -> Vec<u8> {
    let largest = planes.iter().flatten().map(|code| code[1]).max();
    let first_bits = (u16::BITS - largest.unwrap_or(0).leading_zeros()).max(1);
    let places: Vec<Place> = places(grids.iter().copied(), side).collect();
    let ordered: Vec<&[[u16; 3]]> = tags(order)
        .filter_map(|tag| Some(&planes[tiled.binary_search(&(tag as usize)).ok()?][..]))
        .collect();
    let tiles: Vec<Vec<u8>> = places
        .par_iter()
        .map(|place| tile(*place, first_bits, &ordered))
        .collect();

    let mut bytes = vec![side as u8, first_bits as u8, 0, 0];
    bytes.extend((grids.len() as u32).to_le_bytes());
    bytes.extend((tiles.len() as u32).to_le_bytes());
    bytes.extend(order);
    for [width, height] in grids {
        bytes.extend(width.to_le_bytes());
        bytes.extend(height.to_le_bytes());
    }
    let mut offset = 0_u32;
    for tile in &tiles {
        bytes.extend(offset.to_le_bytes());
        // An atlas that does not fit 4 GiB is refused when it is written.
        offset = offset.wrapping_add(tile.len() as u32);
    }
    bytes.extend(tiles.into_iter().flatten());
    bytes
}

/// All lights of one tile, in their order.
fn tile(place: Place, first_bits: u32, planes: &[&[[u16; 3]]]) -> Vec<u8> {
    let mut bits = BitWriter::default();
    let mut before = [0, 1, 2].map(|_| vec![0; place.elements().count()]);
    for plane in planes {
        if place
            .elements()
            .all(|element| plane[element as usize] == [0; 3])
        {
            bits.put(0, 1);
            continue;
        }
        bits.put(1, 1);
        for channel in [1, 0, 2] {
            let own = coded(plane, place, channel);
            let written = Written::shortest(&own, &before[channel], place);
            written.put((channel == 1).then_some(first_bits), &mut bits);
            before[channel] = own;
        }
    }
    bits.finish()
}

/// `r - g`, `g` or `b - g` of the codes of a light in a tile.
pub(super) fn coded(plane: &[[u16; 3]], place: Place, channel: usize) -> Vec<i32> {
    let codes = place
        .elements()
        .map(|element| plane[element as usize].map(i32::from));
    codes
        .map(|codes| codes[channel] - if channel == 1 { 0 } else { codes[1] })
        .collect()
}

/// One of the three that are coded, in one of the ways to write it.
struct Written {
    bits: u64,
    parameter: u32,
    predictor: Predictor,
    share: Share,
    first: i32,
    /// All but the first, folded.
    rest: Vec<u32>,
}

impl Written {
    /// What takes the fewest bits, with `before` the same of the light before.
    fn shortest(own: &[i32], before: &[i32], place: Place) -> Self {
        let columns = usize::from(place.columns);
        let shares = [Share::None, Share::Half, Share::All];
        let ways = shares.into_iter().flat_map(|share| {
            let more = own
                .iter()
                .zip(before)
                .map(|(own, before)| own - share.of(*before));
            let more: Vec<i32> = more.collect();
            [Predictor::Edge, Predictor::Mean].map(|predictor| {
                let rest = differences(&more, columns, predictor);
                Self::new(
                    more[0],
                    rest.into_iter().map(fold).collect(),
                    predictor,
                    share,
                )
            })
        });
        let shortest = ways.reduce(|a, b| if b.bits < a.bits { b } else { a });
        shortest.unwrap_or_else(|| Self::new(0, Vec::new(), Predictor::Edge, Share::None))
    }

    fn new(first: i32, rest: Vec<u32>, predictor: Predictor, share: Share) -> Self {
        let is_as_predicted =
            (predictor, share) == (Predictor::Edge, Share::None) && rest.iter().all(|z| *z == 0);
        let cost = |m: u32| {
            rest.iter()
                .map(|z| u64::from(rice_bits(*z, m)))
                .sum::<u64>()
        };
        let (bits, parameter) = if is_as_predicted {
            (0, PREDICTED)
        } else {
            // The best one is near the logarithm of the mean.
            let mean = rest.iter().map(|z| u64::from(*z)).sum::<u64>() / rest.len().max(1) as u64;
            let near = (mean + 1).ilog2().min(PREDICTED - 1);
            let near = near.saturating_sub(2)..(near + 2).min(PREDICTED);
            let costs = near.map(|m| (cost(m), m));
            costs.min().unwrap_or_default()
        };
        Self {
            bits,
            parameter,
            predictor,
            share,
            first,
            rest,
        }
    }

    /// Writes it; a first value of green without a share takes `first_bits`.
    fn put(&self, first_bits: Option<u32>, bits: &mut BitWriter) {
        bits.put(self.parameter, 4);
        if self.parameter != PREDICTED {
            bits.put(u32::from(self.predictor == Predictor::Mean), 1);
            match self.share {
                Share::None => bits.put(0, 1),
                Share::Half => bits.put(0b10, 2),
                Share::All => bits.put(0b11, 2),
            }
        }
        match first_bits {
            Some(count) if self.share == Share::None => bits.put(self.first as u32, count),
            _ => put_first(fold(self.first) + (1 << FIRST_BITS), bits),
        }
        if self.parameter != PREDICTED {
            self.rest
                .iter()
                .for_each(|z| put_rice(*z, self.parameter, bits));
        }
    }
}

/// What is left of all values but the first.
pub(super) fn differences(coded: &[i32], columns: usize, predictor: Predictor) -> Vec<i32> {
    let rest = (1..coded.len()).map(|at| {
        let column = at % columns;
        let left = (column > 0).then(|| coded[at - 1]);
        let above = at.checked_sub(columns).map(|above| {
            let right = above + usize::from(column + 1 < columns);
            [above - usize::from(column > 0), above, right].map(|at| coded[at])
        });
        coded[at] - predictor.predict(left, above)
    });
    rest.collect()
}

/// `0, 1, 2, 3, 4, ...` from `0, -1, 1, -2, 2, ...`.
const fn fold(value: i32) -> u32 {
    ((value << 1) ^ (value >> 31)) as u32
}

const fn rice_bits(z: u32, m: u32) -> u32 {
    let ones = z >> m;
    if ones >= ESCAPE {
        ESCAPE + FULL_BITS
    } else {
        ones + 1 + m
    }
}

/// A first value that has been folded and moved.
fn put_first(moved: u32, bits: &mut BitWriter) {
    let below = u32::BITS - 1 - moved.leading_zeros();
    bits.put_ones(below - FIRST_BITS);
    bits.put(moved - (1 << below), below);
}

fn put_rice(z: u32, m: u32, bits: &mut BitWriter) {
    let ones = z >> m;
    if ones >= ESCAPE {
        bits.put((1 << ESCAPE) - 1, ESCAPE);
        bits.put(z, FULL_BITS);
    } else {
        bits.put_ones(ones);
        bits.put(z - (ones << m), m);
    }
}

/// Collects bits, highest first.
#[derive(Default)]
struct BitWriter {
    bytes: Vec<u8>,
    /// Bits that do not fill a byte yet, at the bottom.
    buffer: u64,
    held: u32,
}

impl BitWriter {
    /// The lower `count` bits of a value, at most 32.
    fn put(&mut self, value: u32, count: u32) {
        self.buffer = (self.buffer << count) | u64::from(value);
        self.held += count;
        while self.held >= 8 {
            self.held -= 8;
            self.bytes.push((self.buffer >> self.held) as u8);
        }
    }

    /// So many ones, at most 31, and a zero.
    fn put_ones(&mut self, count: u32) {
        self.put((2 << count) - 2, count + 1);
    }

    fn finish(mut self) -> Vec<u8> {
        if self.held > 0 {
            self.put(0, 8 - self.held);
        }
        self.bytes
    }
}
