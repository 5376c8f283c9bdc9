//! Refinement: what one shot costs per element and light, and what a whole bake costs.
//!
//! * `shot`: everything of a shot but its row (checks, reflected shares, distribution), in element
//!   x light per second: 1 Gelem/s is 1 ns for each of them. Host lanes are 8 wide,
//!   so one light pays for eight; `1 in one lane` is how a device would hold it. `dark` shots have
//!   nothing to distribute, so they show what a shot costs before that.
//! * `bake`: the paper's room as published (100 plain shots) and with kept rows, to the residual
//!   that the published form reaches and to the program's own, 1e-4; rows by all threads.
//! * A line on stderr for each way to bake: 8 tagged lights against 8 separate bakes, taken in turn.

mod scenes;

use std::time::{Duration, Instant};

use criterion::{BenchmarkId, Criterion, Throughput};
use relume::color::Rgb;
use relume::mesh::Mesh;
use relume::refine::{Block, Lanes, PatchState, Refinement, RowStorage, Storage};
use relume::scene::{Emission, Surface};
use relume_host::bake::Settings;
use relume_host::builtin::PaperLamps;
use relume_host::scene::OwnedScene;
use relume_host::solution::Solution;

/// How often both sides of a comparison are taken; the fastest of each counts.
const TURNS: usize = 5;

fn main() {
    let mut criterion = scenes::criterion();
    shots(&mut criterion);
    bakes(&mut criterion);
    criterion.final_summary();
    print_tagging();
}

fn shots(criterion: &mut Criterion) {
    let room = scenes::room(PaperLamps::Eight);
    let owned = scenes::meshed(&room);
    let mesh = owned.view();
    shot::<8>(criterion, &mesh, "dark", 8, Rgb::BLACK);
    shot::<1>(criterion, &mesh, "1 in one lane", 1, Rgb::WHITE);
    for lights in [1, 8, 64] {
        shot::<8>(criterion, &mesh, &lights.to_string(), lights, Rgb::WHITE);
    }
}

/// Shots of every reflecting patch once, from a state in which every light has lit everything.
fn shot<const K: usize>(
    criterion: &mut Criterion,
    mesh: &Mesh,
    name: &str,
    lights: u32,
    emission: Rgb,
) {
    let reflecting = |patch: &u32| mesh.patch_emission(*patch).is_none();
    let patches: Vec<u32> = (0..mesh.patches.len() as u32).filter(reflecting).collect();
    let count = mesh.elements.len() * lights as usize * patches.len();
    let row = vec![0.01; mesh.elements.len()];
    let mut memory = Memory::<K>::new(mesh, lights as usize);

    let mut group = criterion.benchmark_group("refine/shot");
    group.throughput(Throughput::Elements(count as u64));
    group.bench_function(BenchmarkId::new("lights", name), |bencher| {
        bencher.iter_custom(|rounds| {
            let mut total = Duration::ZERO;
            for _ in 0..rounds {
                let mut refinement = Refinement::new(*mesh, lights, 1e-4, memory.storage())
                    .expect("memory that fits");
                for light in 0..lights {
                    refinement
                        .illuminate(light, emission, &row)
                        .expect("a legal row");
                }
                let start = Instant::now();
                for patch in &patches {
                    refinement.shoot(*patch, &row).expect("a legal row");
                }
                total += start.elapsed();
            }
            total
        });
    });
    group.finish();
}

/// Memory of a refinement that keeps no rows.
struct Memory<const K: usize> {
    irradiance: Vec<Lanes<K>>,
    unshot: Vec<Lanes<K>>,
    patches: Vec<PatchState>,
    blocks: Vec<Block<K>>,
}

impl<const K: usize> Memory<K> {
    fn new(mesh: &Mesh, lights: usize) -> Self {
        let blocks = lights.div_ceil(K);
        Self {
            irradiance: vec![[[0.0; K]; 3]; mesh.elements.len() * blocks],
            unshot: vec![[[0.0; K]; 3]; mesh.patches.len() * blocks],
            patches: vec![PatchState::EMPTY; mesh.patches.len()],
            blocks: vec![Block::EMPTY; blocks],
        }
    }

    fn storage(&mut self) -> Storage<'_, K> {
        Storage {
            irradiance: &mut self.irradiance,
            direct: &mut [],
            unshot: &mut self.unshot,
            patches: &mut self.patches,
            blocks: &mut self.blocks,
            rows: RowStorage::default(),
        }
    }
}

/// As published: 100 shots, no row kept, no ambient term.
fn published(lamps: PaperLamps) -> Settings {
    Settings {
        shots: Some(100),
        plain: true,
        ..scenes::settings(&scenes::room(lamps), 1e-6)
    }
}

fn bakes(criterion: &mut Criterion) {
    let lamps = PaperLamps::Eight;
    let room = scenes::room(lamps);
    let plain = published(lamps);
    let reached = largest_residual(&scenes::baked(&room.scene, &plain));

    let mut group = criterion.benchmark_group("refine/bake, 8 lights");
    let mut measure = |name: String, settings: &Settings| {
        let rows = scenes::baked(&room.scene, settings).rows;
        group.bench_function(format!("{name}: {rows} rows"), |bencher| {
            bencher.iter(|| scenes::baked(&room.scene, settings));
        });
    };
    measure(format!("plain, residual {reached:.1e}"), &plain);
    let kept = |residual| scenes::settings(&room, residual);
    measure("kept rows, the same residual".to_owned(), &kept(reached));
    measure("kept rows, residual 1e-4".to_owned(), &kept(1e-4));
    group.finish();
}

fn largest_residual(solution: &Solution) -> f32 {
    let residuals = solution.lights.iter().map(|light| light.residual);
    residuals.fold(0.0, f32::max)
}

fn print_tagging() {
    let lamps = PaperLamps::Eight;
    let room = scenes::room(lamps);
    let alone: Vec<OwnedScene> = (0..8).map(|light| only(&room.scene, light)).collect();
    let ways = [
        ("100 plain shots", published(lamps)),
        ("kept rows, residual 1e-4", scenes::settings(&room, 1e-4)),
    ];
    for (name, settings) in ways {
        let (mut tagged, mut separate) = (Duration::MAX, Duration::MAX);
        for _ in 0..TURNS {
            let bake = |scene| drop(scenes::baked(scene, &settings));
            tagged = tagged.min(scenes::time(|| bake(&room.scene)));
            separate = separate.min(scenes::time(|| alone.iter().for_each(bake)));
        }
        eprintln!(
            "8 lights, {name}: tagged {tagged:.1?}, 8 separate bakes {separate:.1?}, {:.2} times",
            separate.as_secs_f64() / tagged.as_secs_f64(),
        );
    }
}

/// The scene with one of its lights; the other lamps still hide what is behind them.
fn only(scene: &OwnedScene, light: u32) -> OwnedScene {
    let mut alone = scene.clone();
    alone.lights = vec![scene.lights[light as usize].clone()];
    for surface in &mut alone.surfaces {
        let Some(emission) = surface.emission() else {
            continue;
        };
        let dark = Surface::new(0, surface.polygon().vertices(), Rgb::BLACK);
        let own = Emission {
            light: 0,
            ..emission
        };
        let lamp = dark.and_then(|s| {
            if emission.light == light {
                s.emitting(0, own)
            } else {
                Ok(s)
            }
        });
        *surface = lamp.expect("legal before");
    }
    alone
}
