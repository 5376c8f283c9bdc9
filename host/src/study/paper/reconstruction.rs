//! Table 2: the time of one reconstruction, and the memory that it reads.

use std::hint::black_box;
use std::ops::ControlFlow;

use anyhow::Result;
use relume::atlas::{Atlas, Quantity};
use relume::code::Code;
use relume::color::Rgb;
use relume::relight::{
    DecodeTable, FixedMix, FixedWeight, change_fixed, relight, relight_fixed, table_length,
};

use super::clock::{median, tried};
use super::rooms::{SPACING, room};
use crate::bake::{Settings, bake};
use crate::pack::{Format, pack};

/// Reconstructions that are timed together.
const FRAMES: u32 = 100;

/// What the paper measured in software: ms and KB.
const PUBLISHED: [(u32, [f64; 2]); 3] = [(1, [1.0, 12.0]), (3, [2.6, 35.0]), (8, [7.3, 95.0])];

/// A column of the table.
#[derive(Clone, Debug)]
pub struct Reconstruction {
    /// Number of lights.
    pub lights: u32,
    /// The paper's milliseconds and KB.
    pub published: Option<[f64; 2]>,
    /// Milliseconds of a frame in `f32`.
    pub float: f64,
    /// Milliseconds of a frame in integers.
    pub integer: f64,
    /// Milliseconds when one light changes.
    pub change: f64,
    /// Bytes of the codes.
    pub codes: usize,
    /// Bytes of the atlas without a mesh.
    pub atlas: usize,
}

/// Measures one number of lights on the bake's default solution.
pub fn measure(lights: u32, repeats: usize) -> Result<Reconstruction> {
    let scene = room(lights)?;
    let settings = Settings {
        patch: Some(SPACING.patch),
        element: Some(SPACING.element),
        ..Settings::default()
    };
    let solution = bake(&scene, &settings, &mut |_| ControlFlow::Continue(()))?;
    let format = Format {
        packing: Code::Exp8s.into(),
        quantity: Quantity::Irradiance,
        mesh: false,
    };
    let bytes = pack(&solution, format)?;
    let atlas = Atlas::parse(&bytes)?;
    let mix = vec![Rgb::splat(0.5); lights as usize];
    let elements = solution.mesh.elements.len();

    let mut values = vec![0.0; table_length(&atlas)];
    let table = DecodeTable::new(&atlas, &mut values)?;
    let mut irradiance = vec![Rgb::BLACK; elements];
    let mut in_floats = || -> Result<()> {
        relight(&atlas, &table, black_box(&mix), &mut irradiance)?;
        black_box(&irradiance);
        Ok(())
    };
    let brightest = vec![Rgb::WHITE; mix.len()];
    let (mut fixed_weights, mut more) = (
        vec![FixedWeight::EMPTY; mix.len()],
        vec![FixedWeight::EMPTY; mix.len()],
    );
    let mut sums = vec![[0; 3]; elements];
    let mut in_integers = || -> Result<()> {
        let fixed = FixedMix::new(&atlas, &brightest, black_box(&mix), &mut fixed_weights)?;
        relight_fixed(&atlas, &fixed, &mut sums)?;
        black_box(&sums);
        Ok(())
    };
    let mut changing = vec![[0; 3]; elements];
    let mut fixed = FixedMix::new(&atlas, &brightest, &mix, &mut more)?;
    relight_fixed(&atlas, &fixed, &mut changing)?;
    let mut values = [Rgb::WHITE, Rgb::BLACK].into_iter().cycle();
    let mut one_changes = || -> Result<()> {
        let value = values.next().unwrap_or_default();
        change_fixed(&atlas, &mut fixed, lights / 2, value, &mut changing)?;
        black_box(&changing);
        Ok(())
    };

    let mut times = [Vec::new(), Vec::new(), Vec::new()];
    for _ in 0..repeats {
        times[0].push(frame(&mut in_floats)?);
        times[1].push(frame(&mut in_integers)?);
        times[2].push(frame(&mut one_changes)?);
    }
    let [float, integer, change] = times.map(median);
    Ok(Reconstruction {
        lights,
        published: PUBLISHED.iter().find(|p| p.0 == lights).map(|p| p.1),
        float,
        integer,
        change,
        codes: atlas.code_bytes(),
        atlas: bytes.len(),
    })
}

/// Milliseconds of one frame.
fn frame(work: &mut dyn FnMut() -> Result<()>) -> Result<f64> {
    let all = tried(|| (0..FRAMES).try_for_each(|_| work()))?;
    Ok(all / f64::from(FRAMES) * 1e3)
}
