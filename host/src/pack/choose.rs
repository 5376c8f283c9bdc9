//! Which packing is the smallest that is exact enough, or the most exact that is small enough.
//!
//! All codes are tried, and `tiles` with steps of whole fractions of an octave, logarithmic from several shares of a
//! light's white on: the lower that share, the finer the steps that remain where a light is overexposed, in a pure
//! colour, or shown by a bright surface, and the more codes there are. The error falls with the step and the
//! size grows, so that for each share the step is searched on a *draft*, a few of the lights judged without the
//! random states. What counts is measured on all of them.

use super::measure::{foremost, measure};
use super::{CODES_PER_OCTAVE, PackError, Packed, Packing, PackingError, Source};
use crate::solution::Solution;
use relume::atlas::Quantity;
use relume::code::Code;

/// Shares of a light's white above which steps of `tiles` are logarithmic.
const WHITES: [f32; 7] = [
    1.0,
    1.0 / 4.0,
    1.0 / 16.0,
    1.0 / 64.0,
    1.0 / 256.0,
    1.0 / 1024.0,
    1.0 / 4096.0,
];

/// Most steps of an octave.
const FINEST: u16 = 1024;

/// Lights of a draft.
const DRAFTED: usize = 16;

/// How often a step is changed after it was measured in full.
const REFINEMENTS: usize = 8;

/// What is wanted of a packing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Aim {
    /// The smallest whose largest error, packed and shown, is at most so many display codes.
    Error(f32),
    /// The most exact of at most so many bytes, with everything in them.
    Bytes(usize),
}

/// What is to be chosen.
#[derive(Clone, Copy, Debug)]
pub struct Request<'a> {
    /// What is wanted.
    pub aim: Aim,
    /// For every light, the packing that it has to have.
    pub given: &'a [Option<Packing>],
    /// Irradiance, or radiosity with the reflectance multiplied in.
    pub quantity: Quantity,
    /// Whether the atlas carries the mesh.
    pub mesh: bool,
}

/// What is known of the error of a candidate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Judged {
    /// Measured in all states: packed, shown.
    Fully(f32, f32),
    /// At least this, packed or shown, which is too much.
    AtLeast(f32),
    /// Nothing: it is larger than one that is exact enough.
    Not,
}

/// A packing that was considered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// The packing of every light that had none given.
    pub packing: Packing,
    /// The whole atlas.
    pub bytes: usize,
    /// What is known of its error.
    pub judged: Judged,
    /// True for the one that was taken.
    pub is_chosen: bool,
}

/// A solution in the packing that suits best.
#[derive(Clone, Debug)]
pub struct Choice {
    /// The atlas.
    pub bytes: Vec<u8>,
    /// Its error.
    pub error: PackingError,
    /// The packing of every light that had none given.
    pub packing: Packing,
    /// All that were considered, the smallest first.
    pub candidates: Vec<Candidate>,
}

/// Packs a solution as well as the aim allows.
///
/// # Errors
/// [`PackError::TooExact`] or [`PackError::TooSmall`] when nothing meets the aim; else [`PackError`] when counts or
/// values leave the format's range.
pub fn choose(solution: &Solution, request: Request) -> Result<Choice, PackError> {
    let source = Source::new(solution, request.quantity);
    let drafted = draft(solution);
    let draft = drafted.as_ref().map(|(lights, solution)| Search {
        source: Source::new(solution, request.quantity),
        given: lights.iter().map(|light| request.given[*light]).collect(),
        mesh: request.mesh,
    });
    let full = Search {
        source,
        given: request.given.to_vec(),
        mesh: request.mesh,
    };
    let draft = draft.as_ref().unwrap_or(&full);
    match request.aim {
        Aim::Error(limit) => smallest(&full, draft, limit),
        Aim::Bytes(budget) => most_exact(&full, draft, budget),
    }
}

/// Some of the lights, evenly spread, where there are many: their tags, and a solution of them alone.
fn draft(solution: &Solution) -> Option<(Vec<usize>, Solution)> {
    let lights = solution.lights.len();
    if lights <= DRAFTED {
        return None;
    }
    let tags: Vec<usize> = (0..DRAFTED).map(|i| i * lights / DRAFTED).collect();
    let mut mesh = solution.mesh.clone();
    for face in &mut mesh.faces {
        face.emission = face.emission.and_then(|mut emission| {
            let tag = tags
                .iter()
                .position(|tag| *tag == emission.light as usize)?;
            emission.light = tag as u32;
            Some(emission)
        });
    }
    let elements = solution.contributions.chunks(lights);
    let draft = Solution {
        surfaces: Vec::new(),
        luminaires: Vec::new(),
        mesh,
        image: solution.image,
        lights: tags
            .iter()
            .map(|tag| solution.lights[*tag].clone())
            .collect(),
        contributions: elements
            .flat_map(|values| tags.iter().map(|tag| values[*tag]))
            .collect(),
        direct: None,
        exposed: Vec::new(),
        method: solution.method,
        rows: solution.rows,
        spacing: solution.spacing,
    };
    Some((tags, draft))
}

/// What packings are tried on.
struct Search<'a> {
    source: Source<'a>,
    given: Vec<Option<Packing>>,
    mesh: bool,
}

/// An encoded candidate.
struct Tried<'a> {
    packed: Packed<'a>,
    candidate: Candidate,
}

impl Search<'_> {
    /// Encodes; `None` when the packing is too fine for its values, or its code cannot hold them.
    ///
    /// Lights that shall be in tiles get the steps of the candidate, if it is in tiles too.
    fn attempt(&self, packing: Packing) -> Result<Option<Tried<'_>>, PackError> {
        let own = |given: &Option<Packing>| match *given {
            Some(given) if given.code != packing.code => given,
            _ => packing,
        };
        let packings: Vec<Packing> = self.given.iter().map(own).collect();
        let packed = match Packed::new(&self.source, &packings) {
            Ok(packed) => packed,
            Err(PackError::Scale(_)) => return Ok(None),
            Err(error) => return Err(error),
        };
        let candidate = Candidate {
            packing,
            bytes: packed.size(self.mesh)?,
            judged: Judged::Not,
            is_chosen: false,
        };
        Ok(Some(Tried { packed, candidate }))
    }

    /// The error in the states that matter most; at least that, once it is above `limit`.
    fn foremost(&self, packing: Packing, limit: f32) -> Result<Option<f32>, PackError> {
        let Some(tried) = self.attempt(packing)? else {
            return Ok(None);
        };
        let error = foremost(&self.source, &tried.packed.decoded()?, limit);
        Ok(Some(error.largest()))
    }

    /// The largest error of an encoded candidate, which is noted in it; at least that, once it is above `limit`.
    fn judge(&self, tried: &mut Tried, limit: f32) -> Result<PackingError, PackError> {
        let error = measure(&self.source, &tried.packed.decoded()?, limit);
        tried.candidate.judged = if error.largest() > limit {
            Judged::AtLeast(error.largest())
        } else {
            Judged::Fully(error.all.packed, error.all.shown)
        };
        Ok(error)
    }

    /// All codes that have no steps to be chosen.
    fn fixed(&self) -> Result<Vec<Tried<'_>>, PackError> {
        let codes = Code::ALL.into_iter().filter(|code| *code != Code::Tiles);
        let tried = codes.map(|code| self.attempt(code.into()));
        tried.filter_map(Result::transpose).collect()
    }

    /// Fewest steps of an octave with which the foremost states stay within the limit; `None` if none do.
    fn steps(&self, white: f32, limit: f32) -> Result<Option<u16>, PackError> {
        // A value between two codes is half a step off.
        let start = f64::from(CODES_PER_OCTAVE / (2.0 * limit)).ceil();
        fewest(start, |steps| {
            let error = self.foremost(tiles(white, steps), limit)?;
            Ok(error.map(|error| f64::from(error / limit)))
        })
    }
}

/// Tiles with so many steps of an octave.
fn tiles(white: f32, steps: u16) -> Packing {
    Packing {
        code: Code::Tiles,
        step: CODES_PER_OCTAVE / f32::from(steps),
        white,
    }
}

/// The least number of steps, within two per cent, whose excess is at most 1, where the excess falls about as their
/// inverse; where it is unknown the number is too large.
fn fewest(
    start: f64,
    mut excess: impl FnMut(u16) -> Result<Option<f64>, PackError>,
) -> Result<Option<u16>, PackError> {
    let (mut low, mut high) = (0, FINEST + 1);
    let mut next = start.clamp(1.0, FINEST.into()) as u16;
    while high - low > 1 + low / 50 {
        let guess = match excess(next)? {
            None => return Ok(None),
            Some(excess) if excess <= 1.0 => {
                high = next;
                (f64::from(next) * excess).floor()
            }
            Some(excess) => {
                low = next;
                (f64::from(next) * excess).ceil()
            }
        };
        if high - low > 1 {
            next = (guess as u16).clamp(low + 1, high - 1);
        }
    }
    Ok((high <= FINEST).then_some(high))
}

/// The smallest that stays within a limit: all are encoded, and judged the smallest first.
fn smallest(full: &Search, draft: &Search, limit: f32) -> Result<Choice, PackError> {
    let mut open = full.fixed()?;
    for white in WHITES {
        if let Some(steps) = draft.steps(white, limit)? {
            open.extend(full.attempt(tiles(white, steps))?);
        }
    }
    let mut closed = Vec::new();
    loop {
        open.sort_by_key(|tried| std::cmp::Reverse(tried.candidate.bytes));
        let Some(mut tried) = open.pop() else {
            return Err(too_exact(full, limit)?);
        };
        let error = full.judge(&mut tried, limit)?;
        if error.largest() <= limit {
            open.extend(closed);
            return finish(full.mesh, tried, error, &open);
        }
        let Packing { code, step, white } = tried.candidate.packing;
        let refined = closed
            .iter()
            .filter(|t: &&Tried| t.candidate.packing.white == white)
            .count();
        if code == Code::Tiles && refined < REFINEMENTS {
            let steps = (CODES_PER_OCTAVE / step).round();
            let finer = (steps * error.largest() / limit).ceil().max(steps + 1.0);
            if finer <= f32::from(FINEST) {
                open.extend(full.attempt(tiles(white, finer as u16))?);
            }
        }
        closed.push(tried);
    }
}

/// Why nothing stays within a limit.
fn too_exact(full: &Search, limit: f32) -> Result<PackError, PackError> {
    let mut best = (f32::INFINITY, Code::TilesLog.into());
    let finest = WHITES.map(|white| tiles(white, FINEST));
    for packing in [Code::TilesLog.into(), Code::Display8.into()]
        .into_iter()
        .chain(finest)
    {
        if let Some(mut tried) = full.attempt(packing)? {
            let error = full.judge(&mut tried, best.0)?;
            if error.largest() < best.0 {
                best = (error.largest(), packing);
            }
        }
    }
    let (error, best) = best;
    Ok(if error.is_finite() {
        PackError::TooExact { limit, best, error }
    } else {
        PackError::Overflow
    })
}

/// The most exact that fits a budget: every share of white gets the finest steps that fit.
fn most_exact(full: &Search, draft: &Search, budget: usize) -> Result<Choice, PackError> {
    let (mut fitting, mut large) = (Vec::new(), full.fixed()?);
    for white in WHITES {
        let Some(finest) = finest_within(full, white, budget)? else {
            large.extend(full.attempt(tiles(white, 1))?);
            continue;
        };
        fitting.extend(full.attempt(tiles(white, finest))?);
    }
    let (fixed, large): (Vec<_>, Vec<_>) = large
        .into_iter()
        .partition(|tried| tried.candidate.bytes <= budget);
    fitting.extend(fixed);
    let mut ranked = Vec::new();
    for tried in fitting {
        let error = draft.foremost(tried.candidate.packing, f32::INFINITY)?;
        ranked.push((error.unwrap_or(f32::INFINITY), tried));
    }
    ranked.sort_by(|(a, _), (b, _)| a.total_cmp(b));
    let mut best: Option<(Tried, PackingError)> = None;
    let mut others = Vec::new();
    for (_, mut tried) in ranked {
        let limit = best.as_ref().map_or(f32::INFINITY, |(_, e)| e.largest());
        let error = full.judge(&mut tried, limit)?;
        let is_better = error.largest() < limit || best.is_none();
        let loser = if is_better {
            best.replace((tried, error)).map(|(tried, _)| tried)
        } else {
            Some(tried)
        };
        others.extend(loser);
    }
    let smallest = large.iter().min_by_key(|tried| tried.candidate.bytes);
    match (best, smallest) {
        (Some((tried, error)), _) => {
            others.extend(large);
            finish(full.mesh, tried, error, &others)
        }
        (None, smallest) => Err(PackError::TooSmall {
            budget,
            best: smallest.map_or(tiles(1.0, 1), |tried| tried.candidate.packing),
            bytes: smallest.map_or(0, |tried| tried.candidate.bytes),
        }),
    }
}

/// Most steps of an octave that a budget allows; `None` when a single one takes more.
fn finest_within(full: &Search, white: f32, budget: usize) -> Result<Option<u16>, PackError> {
    let fits = |steps: u16| -> Result<bool, PackError> {
        let tried = full.attempt(tiles(white, steps))?;
        Ok(tried.is_some_and(|tried| tried.candidate.bytes <= budget))
    };
    if !fits(1)? {
        return Ok(None);
    }
    let (mut low, mut high) = (1_u16, FINEST + 1);
    while high - low > 1 {
        // Bits grow with the logarithm of the steps.
        let middle = (f32::from(low) * f32::from(high)).sqrt() as u16;
        let middle = middle.clamp(low + 1, high - 1);
        if fits(middle)? {
            low = middle;
        } else {
            high = middle;
        }
    }
    Ok(Some(low))
}

fn finish(
    mesh: bool,
    mut tried: Tried,
    error: PackingError,
    others: &[Tried],
) -> Result<Choice, PackError> {
    tried.candidate.is_chosen = true;
    let others = others.iter().map(|tried| tried.candidate);
    let mut candidates: Vec<Candidate> = others.chain([tried.candidate]).collect();
    candidates.sort_by_key(|candidate| candidate.bytes);
    Ok(Choice {
        bytes: tried.packed.write(mesh, Some(&error))?,
        error,
        packing: tried.candidate.packing,
        candidates,
    })
}
