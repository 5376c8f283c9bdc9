//! The memory of a refinement: lent by the caller, or owned at fixed capacity.

use super::{Lanes, RefineError};
use crate::color::Rgb;
use crate::mesh::Mesh;

/// What refinement knows of a patch, besides its unshot radiosity.
#[derive(Clone, Copy, Debug, Default)]
pub struct PatchState {
    /// Number of its row in the storage, plus one; 0 when the row is not known.
    pub(super) row: u32,
    /// True when that row was not evaluated.
    pub(super) is_estimated: bool,
    /// True once its own emission has been shot.
    pub(super) has_emitted: bool,
    /// Reflected share of the row at hand: `sum_j A_j rho_j F_ji / A_p`.
    pub(super) gathered: Rgb,
}

impl PatchState {
    /// Nothing known, nothing shot.
    pub const EMPTY: Self = Self {
        row: 0,
        is_estimated: false,
        has_emitted: false,
        gathered: Rgb::BLACK,
    };
}

/// What refinement knows of a block of lights.
#[derive(Clone, Copy, Debug)]
pub struct Block<const K: usize> {
    /// Power sent into the scene, summed over the channels, W.
    pub(super) emitted: [f32; K],
    /// Weight in the choice of the next shooter.
    pub(super) importance: [f32; K],
}

impl<const K: usize> Block<K> {
    /// Dark lights of importance one.
    pub const EMPTY: Self = Self {
        emitted: [0.0; K],
        importance: [1.0; K],
    };

    /// Importance over the square of the emitted power; 0 for a light that emits nothing.
    pub(super) fn importance_by_power(&self) -> [f32; K] {
        let mut weights = self.importance;
        for (weight, emitted) in weights.iter_mut().zip(self.emitted) {
            *weight = if emitted > 0.0 {
                *weight / emitted / emitted
            } else {
                0.0
            };
        }
        weights
    }
}

/// Memory for one refinement, lent by the caller; contents are overwritten.
///
/// With `n` elements, `p` patches and `b` blocks: lanes are block-major, element or patch inside.
#[derive(Debug)]
pub struct Storage<'a, const K: usize> {
    /// Irradiance, at least `n * b`.
    pub irradiance: &'a mut [Lanes<K>],
    /// The direct part of it, at least `n * b`; empty to not keep it apart.
    pub direct: &'a mut [Lanes<K>],
    /// Unshot radiosity, at least `p * b`.
    pub unshot: &'a mut [Lanes<K>],
    /// At least `p`.
    pub patches: &'a mut [PatchState],
    /// `b`: lights divided by `K`, rounded up.
    pub blocks: &'a mut [Block<K>],
    /// Kept rows; as many as fit, possibly none.
    pub rows: RowStorage<'a, K>,
}

/// Memory for rows that are not to be evaluated twice, and for solving the system of their patches.
///
/// A row takes `4 n + 12 p` bytes. With none of it a refinement shoots again what it has seen
/// before, as published; where there is not room for all, none is wasted on black lamps, which shoot but once.
#[derive(Debug, Default)]
pub struct RowStorage<'a, const K: usize> {
    /// Form factors, `n` for each row.
    pub factors: &'a mut [f32],
    /// What share of a row each patch reflects, `p` for each row.
    pub shares: &'a mut [Rgb],
    /// Radiosity that known patches must send besides what they get from each other, at least `p * b`.
    pub sources: &'a mut [Lanes<K>],
    /// Radiosity that known patches sent, at least `p * b`.
    pub sent: &'a mut [Lanes<K>],
    /// Room for the solution, at least `6 p`.
    pub work: &'a mut [Lanes<K>],
}

impl<const K: usize> RowStorage<'_, K> {
    /// How many rows it can keep of a mesh with `n` elements and `p` patches for `b` blocks.
    fn capacity(&self, n: usize, p: usize, b: usize) -> usize {
        let lanes = self.sources.len().min(self.sent.len());
        if n == 0 || p == 0 || lanes < p * b || self.work.len() < 6 * p {
            return 0;
        }
        (self.factors.len() / n).min(self.shares.len() / p).min(p)
    }
}

/// Storage of fixed capacity for one block of lights, fit for a `static`.
///
/// `ROWS` rows are kept; a row is as long as `ELEMENTS`. More rows than patches do not compile:
///
/// ```compile_fail
/// let storage = relume::refine::FixedStorage::<3, 60, 960, 61>::new();
/// ```
///
/// ```
/// let storage = relume::refine::FixedStorage::<3, 60, 960, 60>::new();
/// ```
#[derive(Debug)]
pub struct FixedStorage<
    const K: usize,
    const PATCHES: usize,
    const ELEMENTS: usize,
    const ROWS: usize,
> {
    irradiance: [Lanes<K>; ELEMENTS],
    unshot: [Lanes<K>; PATCHES],
    patches: [PatchState; PATCHES],
    block: [Block<K>; 1],
    factors: [[f32; ELEMENTS]; ROWS],
    shares: [[Rgb; PATCHES]; ROWS],
    sources: [Lanes<K>; PATCHES],
    sent: [Lanes<K>; PATCHES],
    work: [[Lanes<K>; PATCHES]; 6],
}

impl<const K: usize, const PATCHES: usize, const ELEMENTS: usize, const ROWS: usize>
    FixedStorage<K, PATCHES, ELEMENTS, ROWS>
{
    /// Empty storage. No lights, no elements, or more patches than 16 bits name do not compile.
    #[must_use]
    pub const fn new() -> Self {
        const {
            assert!(K > 0, "a block holds at least one light");
            assert!(ELEMENTS > 0, "there is at least one element");
            assert!(PATCHES <= 65_536, "patch ids of a device are 16 bits wide");
            assert!(ROWS <= PATCHES, "a patch has one row");
        }
        Self {
            irradiance: [[[0.0; K]; 3]; ELEMENTS],
            unshot: [[[0.0; K]; 3]; PATCHES],
            patches: [PatchState::EMPTY; PATCHES],
            block: [Block::EMPTY],
            factors: [[0.0; ELEMENTS]; ROWS],
            shares: [[Rgb::BLACK; PATCHES]; ROWS],
            sources: [[[0.0; K]; 3]; PATCHES],
            sent: [[[0.0; K]; 3]; PATCHES],
            work: [[[[0.0; K]; 3]; PATCHES]; 6],
        }
    }

    /// The storage as slices; direct light is not kept apart.
    #[must_use]
    pub const fn storage(&mut self) -> Storage<'_, K> {
        Storage {
            irradiance: &mut self.irradiance,
            direct: &mut [],
            unshot: &mut self.unshot,
            patches: &mut self.patches,
            blocks: &mut self.block,
            rows: RowStorage {
                factors: self.factors.as_flattened_mut(),
                shares: self.shares.as_flattened_mut(),
                sources: &mut self.sources,
                sent: &mut self.sent,
                work: self.work.as_flattened_mut(),
            },
        }
    }
}

impl<const K: usize, const PATCHES: usize, const ELEMENTS: usize, const ROWS: usize> Default
    for FixedStorage<K, PATCHES, ELEMENTS, ROWS>
{
    fn default() -> Self {
        Self::new()
    }
}

impl<const K: usize> Storage<'_, K> {
    /// Checks that every slice is long enough, cuts those to length that are walked whole, and
    /// tells how many rows can be kept.
    pub(super) fn fit(&mut self, mesh: &Mesh, lights: u32) -> Result<usize, RefineError> {
        let blocks = (lights as usize).div_ceil(K.max(1));
        if self.blocks.len() < blocks {
            return Err(RefineError::TooManyLights {
                limit: self.blocks.len() * K,
            });
        }
        let (n, p) = (mesh.elements.len(), mesh.patches.len());
        let (irradiance, direct) = (self.irradiance.len(), self.direct.len());
        let elements = if direct == 0 {
            irradiance
        } else {
            irradiance.min(direct)
        };
        let per_block = |length: usize| length.checked_div(blocks).unwrap_or(usize::MAX);
        if per_block(elements) < n {
            return Err(RefineError::TooManyElements {
                limit: per_block(elements),
            });
        }
        let patches = per_block(self.unshot.len()).min(self.patches.len());
        if patches < p {
            return Err(RefineError::TooManyPatches { limit: patches });
        }
        cut(&mut self.blocks, blocks);
        cut(&mut self.patches, p);
        Ok(self.rows.capacity(n, p, blocks))
    }
}

fn cut<T>(slice: &mut &mut [T], length: usize) {
    let whole = core::mem::take(slice);
    *slice = whole.get_mut(..length).unwrap_or_default();
}
