//! Relighting: element x light per second in `f32`, in integers, and for a change of one light.
//!
//! Integers multiply on the way, or only add from a table of all products that is filled anew for every frame.
//! Beside them the time to copy the same code bytes, in the same unit: what memory alone would take.
//! A change of one light counts the elements of that light only; what matters is its time, which
//! takes the place of a whole relight. Two sizes: the paper's room with 8 lights (23 kB of codes), and
//! 8000 elements with 64 lights (1.5 MB). On one thread.

mod scenes;

use std::hint::black_box;

use criterion::{Criterion, Throughput};
use relume::atlas::{Atlas, Contents, LightEntry, Quantity, size, write};
use relume::code::{Code, Scale};
use relume::color::Rgb;
use relume::relight::{
    DecodeTable, FixedMix, FixedTable, FixedWeight, change_fixed, relight, relight_fixed,
    table_length,
};

fn main() {
    let mut criterion = scenes::criterion();
    for code in [Code::Exp8s, Code::Lum8] {
        measure(&mut criterion, 960, 8, code);
    }
    measure(&mut criterion, 8000, 64, Code::Exp8s);
    criterion.final_summary();
}

fn measure(criterion: &mut Criterion, elements: u32, lights: u32, code: Code) {
    let bytes = atlas_bytes(elements, lights, code);
    let atlas = Atlas::parse(&bytes).expect("bytes just written");
    let name = format!("relight/{elements} x {lights} {code}");
    let mix: Vec<Rgb> = (0..lights)
        .map(|light| Rgb::splat(0.1 + 0.01 * light as f32))
        .collect();

    copy(criterion, &name, &atlas);
    float(criterion, &name, &atlas, &mix);
    fixed(criterion, &name, &atlas, &mix);
    change(criterion, &name, &atlas, &mix);
}

/// One unit of throughput for each light of each element.
fn contributions(atlas: &Atlas) -> Throughput {
    Throughput::Elements(u64::from(atlas.element_count()) * u64::from(atlas.light_count()))
}

fn copy(criterion: &mut Criterion, name: &str, atlas: &Atlas) {
    let mut copied = vec![0; atlas.codes().len()];
    let mut group = criterion.benchmark_group(name);
    group.throughput(contributions(atlas));
    group.bench_function("copy of the codes", |bencher| {
        bencher.iter(|| {
            copied.copy_from_slice(black_box(atlas.codes()));
            black_box(&copied);
        });
    });
    group.finish();
}

fn float(criterion: &mut Criterion, name: &str, atlas: &Atlas, mix: &[Rgb]) {
    let mut values = vec![0.0; table_length(atlas)];
    let table = DecodeTable::new(atlas, &mut values).expect("room for all");
    let mut irradiance = vec![Rgb::BLACK; atlas.element_count() as usize];
    let mut group = criterion.benchmark_group(name);
    group.throughput(contributions(atlas));
    group.bench_function("f32", |bencher| {
        bencher.iter(|| {
            relight(atlas, &table, black_box(mix), &mut irradiance).expect("slices that fit");
            black_box(&irradiance);
        });
    });
    group.finish();
}

fn fixed(criterion: &mut Criterion, name: &str, atlas: &Atlas, mix: &[Rgb]) {
    let mut weights = vec![FixedWeight::EMPTY; mix.len()];
    let mut sums = vec![[0; 3]; atlas.element_count() as usize];
    let mut group = criterion.benchmark_group(name);
    group.throughput(contributions(atlas));
    group.bench_function("integers", |bencher| {
        bencher.iter(|| {
            let mix = black_box(mix);
            let fixed = FixedMix::new(atlas, mix, mix, &mut weights).expect("a legal mix");
            relight_fixed(atlas, &fixed, &mut sums).expect("slices that fit");
            black_box(&sums);
        });
    });
    let mut values = vec![0; table_length(atlas)];
    group.bench_function("integers, table", |bencher| {
        bencher.iter(|| {
            let mix = black_box(mix);
            let fixed = FixedMix::new(atlas, mix, mix, &mut weights).expect("a legal mix");
            let table = FixedTable::new(atlas, &fixed, &mut values).expect("room for all");
            relight_fixed(atlas, &table, &mut sums).expect("slices that fit");
            black_box(&sums);
        });
    });
    group.finish();
}

fn change(criterion: &mut Criterion, name: &str, atlas: &Atlas, mix: &[Rgb]) {
    let brightest = vec![Rgb::WHITE; mix.len()];
    let light = mix.len() as u32 / 2;
    let mut weights = vec![FixedWeight::EMPTY; mix.len()];
    let mut sums = vec![[0; 3]; atlas.element_count() as usize];
    let mut fixed = FixedMix::new(atlas, &brightest, mix, &mut weights).expect("a legal mix");
    relight_fixed(atlas, &fixed, &mut sums).expect("slices that fit");
    let mut group = criterion.benchmark_group(name);
    group.throughput(Throughput::Elements(u64::from(atlas.element_count())));
    group.bench_function("integers, one light changes", |bencher| {
        let mut values = [Rgb::WHITE, Rgb::BLACK].into_iter().cycle();
        bencher.iter(|| {
            let value = values.next().unwrap_or_default();
            change_fixed(atlas, &mut fixed, light, value, &mut sums).expect("slices that fit");
            black_box(&sums);
        });
    });
    group.finish();
}

/// An atlas without mesh whose codes take all values.
fn atlas_bytes(elements: u32, lights: u32, code: Code) -> Vec<u8> {
    let entry = LightEntry::exponential("", Rgb::WHITE, code, Scale::ONE);
    let contents = Contents {
        quantity: Quantity::Irradiance,
        lights: &vec![entry; lights as usize],
        elements,
        image_width: 0,
        errors: None,
        tiles: &[],
        mesh: None,
    };
    let contribution = |element: u32, light: u32| {
        let phase = 0.37 * element as f32 + 1.7 * light as f32;
        Rgb::new(1.0 + phase.sin(), 1.0 + phase.cos(), 0.3) * 2.5
    };
    let mut bytes = vec![0; size(&contents).expect("an atlas that fits")];
    write(&contents, contribution, &mut bytes).expect("an atlas that fits");
    bytes
}
