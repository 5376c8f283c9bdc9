//! Bounces that elements gather by rays.

use relume::color::Rgb;
use relume::refine::Lanes;

use super::direct::{self, DirectRow, DirectSource, Lamps};
use super::{BakeError, Job, LANES, Settings, Solved};
use crate::bvh::Bvh;
use crate::gather::{DarkSides, Hits, RAYS_PER_PASS, Rays};
use crate::mesh::{Locator, OwnedMesh};
use crate::rows::Parallel;

/// Most passes: 64 * 16 rays for every element.
const MOST_PASSES: u32 = 64;

/// Most bytes of what rays hit.
const HIT_BYTES: usize = 2 << 30;

/// Residual below which the bounces are always solved: a solve costs less than the rays.
const LAX: f32 = 1e-3;

/// Passes after which the noise is looked at for the first time; then whenever they have doubled.
const FIRST_LOOK: u32 = 8;

/// Direct light, then passes of rays until their noise is small enough or the job ends.
pub(super) fn gather(
    job: &mut Job,
    mesh: OwnedMesh,
    bvh: &Bvh,
) -> Result<(Solved, Hits), BakeError> {
    let view = mesh.view();
    let pass_bytes = mesh.elements.len() * RAYS_PER_PASS as usize * 4;
    let passes = MOST_PASSES
        .min((HIT_BYTES / pass_bytes.max(1)) as u32)
        .max(1);
    let most = direct::shooters(&mesh, Lamps::Whole).len() as u32 + passes;

    let mut light = Light::new(&mesh, job.lights());
    let filler = Parallel::new(&view, bvh);
    let lamps = direct::visit(
        job,
        &mesh,
        &filler,
        Lamps::Whole,
        most,
        |_| true,
        |row| {
            light.add(&row);
            Ok(())
        },
    )?;
    light.bounce(&mesh, &Hits::default(), job.settings.residual);
    let locator = Locator::new(view);
    let rays = Rays::new(view, &locator, bvh);
    let dark = DarkSides::new(job.scene, &locator);
    let mut hits = Hits::default();
    let mut next_look = FIRST_LOOK;
    while lamps.is_complete && (hits.passes() as u32) < passes {
        let rows = lamps.rows + hits.passes() as u32;
        if job.ends(rows, most, light.residual()) {
            break;
        }
        hits.cast(&rays, &dark);
        if hits.passes() as u32 == next_look.min(passes) {
            light.bounce(&mesh, &hits, job.settings.residual);
            if light.error(&mesh, &hits) <= job.settings.noise {
                break;
            }
            next_look *= 2;
        }
    }
    light.bounce(&mesh, &hits, job.settings.residual);
    let rows = lamps.rows + hits.passes() as u32;
    Ok((light.solved(rows, mesh, &hits, job.settings), hits))
}

/// Direct light of some lights, and its bounces along rays that were cast before.
pub(super) fn along(
    job: &mut Job,
    mesh: OwnedMesh,
    bvh: &Bvh,
    hits: &Hits,
    is_wanted: impl Fn(u32) -> bool,
) -> Result<Solved, BakeError> {
    let passes = hits.passes() as u32;
    let most = direct::shooters(&mesh, Lamps::Whole).len() as u32 + passes;
    let mut light = Light::new(&mesh, job.lights());
    let filler = Parallel::new(&mesh.view(), bvh);
    let lamps = direct::visit(job, &mesh, &filler, Lamps::Whole, most, is_wanted, |row| {
        light.add(&row);
        Ok(())
    })?;
    if !lamps.is_complete {
        return Err(BakeError::Interrupted);
    }
    light.bounce(&mesh, hits, job.settings.residual);
    Ok(light.solved(most, mesh, hits, job.settings))
}

/// Relative L1 error of every light that the scatter of the rays leaves, and what has not been distributed.
pub(super) fn errors(
    mesh: &OwnedMesh,
    hits: &Hits,
    contributions: &[Rgb],
    residuals: &[f32],
) -> Vec<f32> {
    let mut errors = residuals.to_vec();
    let mut block = vec![[[0.0; LANES]; 3]; mesh.elements.len()];
    for (number, errors) in errors.chunks_mut(LANES).enumerate() {
        for (lanes, values) in block.iter_mut().zip(contributions.chunks(residuals.len())) {
            let values = &values[number * LANES..][..errors.len()];
            for (lane, value) in values.iter().enumerate() {
                for (channel, value) in lanes.iter_mut().zip(value.to_array()) {
                    channel[lane] = value;
                }
            }
        }
        let noise = hits.noise(&mesh.view(), &block);
        for (error, noise) in errors.iter_mut().zip(noise) {
            *error += noise;
        }
    }
    errors
}

/// Light on the elements.
struct Light {
    lights: usize,
    blocks: Vec<Block>,
    /// Passes that the indirect light was solved with.
    passes: usize,
}

/// A block of lights.
struct Block {
    direct: Vec<Lanes<LANES>>,
    indirect: Vec<Lanes<LANES>>,
    /// Irradiance that was found and has not been reflected yet.
    left: Vec<Lanes<LANES>>,
    /// Power of each light, W.
    emitted: [f32; LANES],
    /// Power of lamps that have not been shot, W.
    waiting: [f32; LANES],
    residuals: [f32; LANES],
}

impl Light {
    fn new(mesh: &OwnedMesh, lights: usize) -> Self {
        let dark = vec![[[0.0; LANES]; 3]; mesh.elements.len()];
        let block = || Block {
            direct: dark.clone(),
            indirect: dark.clone(),
            left: Vec::new(),
            emitted: [0.0; LANES],
            waiting: [0.0; LANES],
            residuals: [1.0; LANES],
        };
        let mut light = Self {
            lights,
            blocks: std::iter::repeat_with(block)
                .take(lights.div_ceil(LANES))
                .collect(),
            passes: 0,
        };
        for (_, polygon, emission) in direct::shooters(mesh, Lamps::Whole) {
            let (block, lane) = light.lane(emission.light);
            block.emitted[lane] += polygon.area() * total(emission.share);
            block.waiting[lane] += polygon.area() * total(emission.share);
        }
        light
    }

    fn lane(&mut self, light: u32) -> (&mut Block, usize) {
        (
            &mut self.blocks[light as usize / LANES],
            light as usize % LANES,
        )
    }

    fn add(&mut self, row: &DirectRow) {
        let (block, lane) = self.lane(row.light);
        for (lanes, factor) in block.direct.iter_mut().zip(row.row) {
            for (channel, share) in lanes.iter_mut().zip(row.share.to_array()) {
                channel[lane] += share * factor;
            }
        }
        let power = row.power * total(row.share);
        if row.source == DirectSource::Luminaire {
            block.emitted[lane] += power;
        } else {
            block.waiting[lane] = (block.waiting[lane] - power).max(0.0);
        }
    }

    /// Solves for the bounces along the rays there are.
    fn bounce(&mut self, mesh: &OwnedMesh, hits: &Hits, residual: f32) {
        if self.passes > 0 && self.passes == hits.passes() {
            return;
        }
        self.passes = hits.passes();
        for block in &mut self.blocks {
            block.left.clone_from(&block.direct);
            if self.passes > 0 {
                let bounced = hits.bounce(&mesh.view(), &block.direct, residual.min(LAX) / 10.0);
                (block.indirect, block.left) = (bounced.indirect, bounced.left);
            }
            block.measure(mesh);
        }
    }

    /// The largest residual of all lights.
    fn residual(&self) -> f32 {
        self.residuals().into_iter().fold(0.0, f32::max)
    }

    /// The largest estimated error of all lights.
    fn error(&self, mesh: &OwnedMesh, hits: &Hits) -> f32 {
        let errors = errors(mesh, hits, &self.contributions(), &self.residuals());
        errors.into_iter().fold(0.0, f32::max)
    }

    fn contributions(&self) -> Vec<Rgb> {
        let irradiance: Vec<_> = self.blocks.iter().map(Block::irradiance).collect();
        by_element(&irradiance, self.lights)
    }

    fn residuals(&self) -> Vec<f32> {
        let residuals = self.blocks.iter().flat_map(|block| block.residuals);
        residuals.take(self.lights).collect()
    }

    fn solved(self, rows: u32, mesh: OwnedMesh, hits: &Hits, settings: &Settings) -> Solved {
        let direct: Vec<_> = self.blocks.iter().map(|b| b.direct.clone()).collect();
        let (contributions, residuals) = (self.contributions(), self.residuals());
        Solved {
            errors: errors(&mesh, hits, &contributions, &residuals),
            contributions,
            direct: settings
                .split_direct
                .then(|| by_element(&direct, self.lights)),
            exposed: hits.exposed(mesh.elements.len()),
            residuals,
            rows,
            mesh,
        }
    }
}

impl Block {
    fn irradiance(&self) -> Vec<Lanes<LANES>> {
        let parts = self.direct.iter().zip(&self.indirect);
        let sum = |(direct, indirect): (&Lanes<LANES>, &Lanes<LANES>)| {
            let mut sum = *direct;
            for (sum, value) in sum
                .as_flattened_mut()
                .iter_mut()
                .zip(indirect.as_flattened())
            {
                *sum += value;
            }
            sum
        };
        parts.map(sum).collect()
    }

    /// Residuals: what is not reflected yet, and what lamps have not shot, over what was emitted.
    fn measure(&mut self, mesh: &OwnedMesh) {
        let mut unshot = self.waiting;
        for (lanes, element) in self.left.iter().zip(&mesh.elements) {
            for (channel, rho) in lanes.iter().zip(element.reflectance.to_array()) {
                for (unshot, left) in unshot.iter_mut().zip(channel) {
                    *unshot += element.area * rho * left.abs();
                }
            }
        }
        for ((residual, unshot), emitted) in self.residuals.iter_mut().zip(unshot).zip(self.emitted)
        {
            *residual = if emitted > 0.0 { unshot / emitted } else { 0.0 };
        }
    }
}

/// Values of all blocks, element by element and light by light.
fn by_element(blocks: &[Vec<Lanes<LANES>>], lights: usize) -> Vec<Rgb> {
    let elements = blocks.first().map_or(0, Vec::len);
    let value = |element: usize, light: usize| {
        let [r, g, b] = &blocks[light / LANES][element];
        let lane = light % LANES;
        // A solve leaves a rounding below zero in the dark.
        Rgb::new(r[lane].max(0.0), g[lane].max(0.0), b[lane].max(0.0))
    };
    (0..elements)
        .flat_map(|element| (0..lights).map(move |light| value(element, light)))
        .collect()
}

fn total(value: Rgb) -> f32 {
    value.to_array().iter().sum()
}
