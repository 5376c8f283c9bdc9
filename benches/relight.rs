//! Relighting: element x light per second in `f32`, in integers, and for a change of one light.
//!
//! Integers multiply on the way, or only add from a table of all products that is filled anew for every frame.
//! Beside them the time to copy the same code bytes, in the same unit: what memory alone would take.
//! A change of one light counts the elements of that light only; what matters is its time, which
//! takes the place of a whole relight. Two sizes: that of the paper's room with 8 lights (23 kB of codes), and
//! 8000 elements with 64 lights (1.5 MB), each in every code. On one thread.

mod scenes;

use std::hint::black_box;

use criterion::{Criterion, Throughput};
use glam::Vec2;
use relume::atlas::Atlas;
use relume::code::Code;
use relume::color::Rgb;
use relume::mesh::Element;
use relume::relight::{
    DecodeTable, FixedMix, FixedTable, FixedWeight, change_fixed, relight, relight_fixed,
    table_length,
};
use relume_host::pack::pack_unmeasured;
use relume_host::solution::Solution;

fn main() {
    let mut criterion = scenes::criterion();
    for code in Code::ALL {
        measure(&mut criterion, [40, 24], 8, code);
    }
    for code in Code::ALL {
        measure(&mut criterion, [100, 80], 64, code);
    }
    criterion.final_summary();
}

fn measure(criterion: &mut Criterion, size: [u32; 2], lights: u32, code: Code) {
    let bytes = atlas_bytes(size, lights, code);
    let atlas = Atlas::parse(&bytes).expect("bytes just written");
    let elements = atlas.element_count();
    let name = format!("relight/{elements} x {lights} {code}");
    let mix: Vec<Rgb> = (0..lights)
        .map(|light| Rgb::splat(0.1 + 0.01 * light as f32))
        .collect();

    let (_, codes) = bytes.split_at(bytes.len() - atlas.code_bytes());
    copy(criterion, &name, &atlas, codes);
    float(criterion, &name, &atlas, &mix);
    fixed(criterion, &name, &atlas, &mix);
    change(criterion, &name, &atlas, &mix);
}

/// One unit of throughput for each light of each element.
fn contributions(atlas: &Atlas) -> Throughput {
    Throughput::Elements(u64::from(atlas.element_count()) * u64::from(atlas.light_count()))
}

fn copy(criterion: &mut Criterion, name: &str, atlas: &Atlas, codes: &[u8]) {
    let mut copied = vec![0; codes.len()];
    let mut group = criterion.benchmark_group(name);
    group.throughput(contributions(atlas));
    group.bench_function("copy of the codes", |bencher| {
        bencher.iter(|| {
            copied.copy_from_slice(black_box(codes));
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

/// An atlas of an image in which every light falls off around a place of its own.
fn atlas_bytes([width, height]: [u32; 2], lights: u32, code: Code) -> Vec<u8> {
    let contribution = |element: u32, light: u32| {
        let (x, y) = ((element % width) as f32, (element / width) as f32);
        let phase = 2.4 * light as f32;
        let across = x / width as f32 - 0.5 - 0.4 * phase.cos();
        let down = y / height as f32 - 0.5 - 0.4 * phase.sin();
        let strength = 1.0 / (0.01 + across * across + down * down);
        Rgb::new(1.0, 0.7 + 0.2 * across, 0.5 + 0.2 * down) * strength
    };
    let names = (0..lights).map(|light| (light.to_string(), Rgb::WHITE));
    let elements = 0..width * height;
    let contributions = elements
        .clone()
        .flat_map(|e| (0..lights).map(move |light| contribution(e, light)));
    let mut solution = Solution::from_contributions(names, contributions.collect());
    solution.image = Some([width, height]);
    // What is seen of the irradiance: the code uniform in display steps follows it.
    let element = Element {
        patch: 0,
        from: Vec2::ZERO,
        to: Vec2::ONE,
        area: 1.0,
        reflectance: Rgb::splat(0.5),
    };
    solution.mesh.elements = vec![element; elements.len()];
    pack_unmeasured(&solution, code.into()).expect("an atlas that fits")
}
