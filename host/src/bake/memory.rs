//! The memory that a refinement borrows, on the heap.

use relume::color::Rgb;
use relume::mesh::Mesh;
use relume::refine::{Block, Lanes, PatchState, RowStorage, Storage};

/// Memory of a refinement, for blocks of any width.
#[derive(Debug)]
pub struct Memory<const K: usize> {
    irradiance: Vec<Lanes<K>>,
    direct: Vec<Lanes<K>>,
    unshot: Vec<Lanes<K>>,
    patches: Vec<PatchState>,
    blocks: Vec<Block<K>>,
    factors: Vec<f32>,
    shares: Vec<Rgb>,
    sources: Vec<Lanes<K>>,
    sent: Vec<Lanes<K>>,
    work: Vec<Lanes<K>>,
}

impl<const K: usize> Memory<K> {
    /// Room for `lights` tags, to keep `rows` rows, and to keep direct light apart if `split`.
    #[must_use]
    pub fn new(mesh: &Mesh, lights: usize, rows: usize, split: bool) -> Self {
        let blocks = lights.div_ceil(K);
        let (n, p) = (mesh.elements.len(), mesh.patches.len());
        let zero = [[0.0; K]; 3];
        let known = if rows > 0 { p } else { 0 };
        Self {
            irradiance: vec![zero; n * blocks],
            direct: vec![zero; if split { n * blocks } else { 0 }],
            unshot: vec![zero; p * blocks],
            patches: vec![PatchState::EMPTY; p],
            blocks: vec![Block::EMPTY; blocks],
            factors: vec![0.0; rows * n],
            shares: vec![Rgb::BLACK; rows * p],
            sources: vec![zero; known * blocks],
            sent: vec![zero; known * blocks],
            work: vec![zero; 6 * known],
        }
    }

    /// Bytes that keep rows and solve for their patches; without kept rows there are none.
    #[must_use]
    pub fn row_bytes(&self) -> usize {
        let lanes =
            [&self.sources, &self.sent, &self.work].map(|lanes| size_of_val(lanes.as_slice()));
        let rows = size_of_val(self.factors.as_slice()) + size_of_val(self.shares.as_slice());
        rows + lanes.iter().sum::<usize>()
    }

    /// The memory as the refinement borrows it.
    #[must_use]
    pub fn storage(&mut self) -> Storage<'_, K> {
        Storage {
            irradiance: &mut self.irradiance,
            direct: &mut self.direct,
            unshot: &mut self.unshot,
            patches: &mut self.patches,
            blocks: &mut self.blocks,
            rows: RowStorage {
                factors: &mut self.factors,
                shares: &mut self.shares,
                sources: &mut self.sources,
                sent: &mut self.sent,
                work: &mut self.work,
            },
        }
    }
}
