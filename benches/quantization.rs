//! Quantisation error against the number of lights and the code, and what packing costs.
//!
//! One bake of each room, then every code of it; a table on stderr in display codes: the
//! largest error of relit irradiance over elements, channels and all test states (all on, each light
//! alone, dimmings and colours), the state in which it occurs, the median over lights of the error
//! with that light alone, and the error of what is shown. Built-in rooms have 1, 3 and 8 lamps; rooms of
//! 64 and 256 come from the reference data, where it is. Times are those of packing alone and of
//! measuring the error.

mod scenes;

#[path = "../tests/data/mod.rs"]
mod data;
#[path = "../tests/skip/mod.rs"]
mod skip;

use criterion::{BenchmarkId, Criterion, Throughput};
use relume::atlas::Atlas;
use relume::code::Code;
use relume_host::builtin::PaperLamps;
use relume_host::import;
use relume_host::pack::{PackingError, pack, packing_error};
use relume_host::scene::OwnedScene;
use relume_host::solution::Solution;

/// Rooms of the reference data that have more lights than the built-in ones.
const LARGER: [&str; 2] = ["seed_room_64", "seed_room_256"];

fn main() {
    let mut criterion = scenes::criterion();
    let solutions: Vec<Solution> = rooms().iter().map(bake).collect();
    print_table(&solutions);
    for solution in &solutions {
        measure(&mut criterion, solution);
    }
    criterion.final_summary();
}

fn rooms() -> Vec<OwnedScene> {
    let lamps = [PaperLamps::One, PaperLamps::Three, PaperLamps::Eight];
    let builtin = lamps.map(|lamps| scenes::room(lamps).scene);
    let larger = data::data_dir().into_iter().flat_map(|folder| {
        let files = LARGER.map(|name| folder.join("scenes").join(name).join("scene.obj"));
        files.map(|file| import::load(&file, None).expect("a legal scene").scene)
    });
    builtin.into_iter().chain(larger).collect()
}

/// Patches of 1 m and elements of 0.25 m, as in the paper.
fn bake(scene: &OwnedScene) -> Solution {
    let settings = scenes::settings(&scenes::room(PaperLamps::One), 1e-4);
    scenes::baked(scene, &settings)
}

fn print_table(solutions: &[Solution]) {
    eprintln!("error in display codes");
    eprintln!("lights  code       codes (bytes)  largest  alone  shown  worst state");
    for solution in solutions {
        for code in Code::ALL {
            let bytes = packed(solution, code);
            let atlas = Atlas::parse(&bytes).expect("bytes just written");
            let error = packing_error(solution, &atlas).expect("its own solution");
            eprintln!(
                "{:>6}  {:<9}  {:>13}  {:>7.2}  {:>5.2}  {:>5.2}  {}",
                solution.lights.len(),
                code.name(),
                atlas.code_bytes(),
                error.all.packed,
                median_alone(&error),
                error.all.shown,
                error.worst_state,
            );
        }
    }
}

fn median_alone(error: &PackingError) -> f32 {
    let mut alone = error.per_light.clone();
    alone.sort_by(f32::total_cmp);
    alone[alone.len() / 2]
}

fn packed(solution: &Solution, code: Code) -> Vec<u8> {
    pack(solution, scenes::format(code)).expect("values in range")
}

fn measure(criterion: &mut Criterion, solution: &Solution) {
    let lights = solution.lights.len();
    let mut group = criterion.benchmark_group("quantization");
    group.throughput(Throughput::Elements(solution.contributions.len() as u64));
    for code in Code::ALL {
        let id = BenchmarkId::new(format!("pack {code}"), lights);
        group.bench_function(id, |bencher| bencher.iter(|| packed(solution, code)));
    }
    let bytes = packed(solution, Code::Exp8s);
    let atlas = Atlas::parse(&bytes).expect("bytes just written");
    group.bench_function(BenchmarkId::new("error", lights), |bencher| {
        bencher.iter(|| packing_error(solution, &atlas));
    });
    group.finish();
}
