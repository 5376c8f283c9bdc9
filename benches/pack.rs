//! Packing: codes and atlas bytes per second.
//!
//! The paper's room with 8 lights, 960 x 8 contributions of three channels: `encode` and `decode`
//! work on single values, spread over the range of the code; `measured` adds scales and bytes and the
//! error over 1335 states of the lights, `parse` checks the bytes again (checksum and every value),
//! `unpack` makes a solution of them.

mod scenes;

use std::hint::black_box;

use criterion::{Criterion, Throughput};
use relume::atlas::Atlas;
use relume::code::{Code, Curve, Scale};
use relume_host::builtin::PaperLamps;
use relume_host::pack::{Format, pack, unpack};
use relume_host::solution::Solution;

fn main() {
    let mut criterion = scenes::criterion();
    let room = scenes::room(PaperLamps::Eight);
    let solution = scenes::baked(&room.scene, &scenes::settings(&room, 0.01));
    codes(&mut criterion);
    bytes(&mut criterion, &solution);
    criterion.final_summary();
}

/// Values of a room of 8 lights.
const VALUES: u16 = 960 * 8 * 3;

/// One channel of every curve, over values from a ten-thousandth of the largest to the largest.
fn codes(criterion: &mut Criterion) {
    let value = |number: u16| (f32::from(number) / f32::from(VALUES) * 9.2 - 9.2).exp();
    let values: Vec<f32> = (0..VALUES).map(value).collect();
    let scale = Scale::fitting(1.0).expect("a legal scale");
    let white = Scale::at_least(0.1).expect("a legal scale");
    let curves = [
        ("exp8s", Curve::Exponential { scale }, 255),
        (
            "display8",
            Curve::display_between(white, 1e-4, 1.0).expect("it fits"),
            255,
        ),
        ("tiles", Curve::display(white, 1.85).expect("it fits"), 1000),
        (
            "tiles-log",
            Curve::logarithmic(1e-4).expect("it fits"),
            1000,
        ),
    ];
    let mut group = criterion.benchmark_group("pack/curve");
    group.throughput(Throughput::Elements(values.len() as u64));
    for (name, curve, last) in curves {
        group.bench_function(format!("encode {name}"), |bencher| {
            bencher.iter(|| {
                let codes = values.iter().map(|value| curve.encode(*value, last));
                codes.fold(0, u16::wrapping_add)
            });
        });
        let codes: Vec<u16> = values.iter().map(|v| curve.encode(*v, last)).collect();
        group.bench_function(format!("decode {name}"), |bencher| {
            let codes = black_box(&codes).iter();
            bencher.iter(|| codes.clone().map(|code| curve.decode(*code)).sum::<f32>());
        });
    }
    group.finish();
}

fn bytes(criterion: &mut Criterion, solution: &Solution) {
    let mut group = criterion.benchmark_group("pack");
    for code in Code::ALL {
        let bytes = pack(solution, scenes::format(code)).expect("values in range");
        group.throughput(Throughput::Bytes(bytes.len() as u64));
        group.bench_function(format!("measured/{code}"), |bencher| {
            bencher.iter(|| pack(solution, scenes::format(code)));
        });
    }

    for (name, mesh) in [("with mesh", true), ("codes only", false)] {
        let format = Format {
            mesh,
            ..scenes::format(Code::Exp8s)
        };
        let bytes = pack(solution, format).expect("values in range");
        let atlas = Atlas::parse(&bytes).expect("bytes just written");
        group.throughput(Throughput::Bytes(bytes.len() as u64));
        group.bench_function(format!("parse/{name}"), |bencher| {
            bencher.iter(|| Atlas::parse(black_box(&bytes)).expect("bytes just written"));
        });
        group.bench_function(format!("unpack/{name}"), |bencher| {
            bencher.iter(|| unpack(&atlas));
        });
    }
    group.finish();
}
