//! Form factors: pairs per second, without and with shadow rays, on one thread.
//!
//! The rows of all patches of the paper's room. A pair is an element and a patch of which neither is
//! wholly behind the other; the others are found out first and cost little. `open` has no
//! blockers; the others cut out the shadows of all 20 surfaces, one after the other or those that
//! the tree finds in the shaft of the pair; `estimated` is what missing rows get. `point` is Lambert's formula alone, one point and one quad. `pair` is the
//! host's exact factor of two unit squares with its error: far, near, with a common edge, and behind a plate.

mod scenes;

use std::hint::black_box;

use criterion::{Criterion, Throughput};
use glam::{DVec3, Vec3};
use relume::form_factor::{self, Shooter, point_to_polygon};
use relume::mesh::Mesh;
use relume::visibility::{Obstacle, Occluders, Shaft, Visibility};
use relume_host::builtin::PaperLamps;
use relume_host::bvh::Bvh;
use relume_host::polygon_pair::{self, ConvexPolygon};

/// Nothing hides anything.
struct Open;

impl Visibility for Open {
    fn sees(&self, _: Vec3, _: Vec3) -> bool {
        true
    }

    fn between<'v>(&'v self, _: &Shaft, _: &mut impl FnMut(Obstacle<'v>)) {}
}

fn main() {
    let mut criterion = scenes::criterion();
    point(&mut criterion);
    rows(&mut criterion);
    pairs(&mut criterion);
    criterion.final_summary();
}

fn point(criterion: &mut Criterion) {
    let quad = [(0.0, 0.0), (0.0, 1.0), (1.0, 1.0), (1.0, 0.0)].map(|(x, y)| Vec3::new(x, y, 1.0));
    // The second receiver has the quad half below its horizon.
    for (name, normal) in [("point", Vec3::Z), ("point, clipped", Vec3::X)] {
        criterion.bench_function(&format!("form_factor/{name}"), |bencher| {
            let at = Vec3::new(0.5, 0.5, 0.0);
            bencher.iter(|| point_to_polygon(black_box(at), black_box(normal), black_box(&quad)));
        });
    }
}

fn rows(criterion: &mut Criterion) {
    let room = scenes::room(PaperLamps::Eight);
    let owned = scenes::meshed(&room);
    let mesh = owned.view();
    let (brute, bvh) = (
        Occluders(&room.scene.surfaces),
        Bvh::for_scene(&room.scene.view().expect("a legal scene")),
    );
    let mut row = vec![0.0; mesh.elements.len()];
    let pairs = facing_pairs(&mesh, &mut row);

    let mut group = criterion.benchmark_group("form_factor/rows");
    group.throughput(Throughput::Elements(pairs));
    group.bench_function("open", |bencher| {
        bencher.iter(|| all_rows(&mesh, &Open, &mut row));
    });
    group.bench_function("exact, brute force", |bencher| {
        bencher.iter(|| all_rows(&mesh, &brute, &mut row));
    });
    group.bench_function("exact, tree", |bencher| {
        bencher.iter(|| all_rows(&mesh, &bvh, &mut row));
    });
    group.bench_function("estimated, tree", |bencher| {
        bencher.iter(|| all_estimates(&mesh, &bvh, &mut row));
    });
    group.finish();
}

fn pairs(criterion: &mut Criterion) {
    let square = |origin: DVec3, u: DVec3, v: DVec3| {
        ConvexPolygon::new(&[origin, origin + u, origin + u + v, origin + v]).expect("a square")
    };
    let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
    let floor = square(DVec3::ZERO, x, y);
    let plate = [square(DVec3::new(0.25, 0.25, 0.5), x / 2.0, y / 2.0)];
    for (name, to, blockers) in [
        ("far", square(z * 8.0, y, x), &[][..]),
        ("near", square(z, y, x), &[]),
        ("common edge", square(DVec3::ZERO, y, z), &[]),
        ("behind a plate", square(z, y, x), &plate),
    ] {
        criterion.bench_function(&format!("form_factor/pair, {name}"), |bencher| {
            bencher.iter(|| {
                polygon_pair::form_factor(black_box(&floor), black_box(&to), black_box(blockers))
            });
        });
    }
}

fn all_rows(mesh: &Mesh, visibility: &impl Visibility, row: &mut [f32]) {
    for patch in 0..mesh.patches.len() as u32 {
        form_factor::row(mesh, patch, visibility, row);
        black_box(&row);
    }
}

fn all_estimates(mesh: &Mesh, visibility: &impl Visibility, row: &mut [f32]) {
    for patch in 0..mesh.patches.len() as u32 {
        let shooter = Shooter::of_patch(mesh, patch, visibility).expect("a patch of the mesh");
        form_factor::estimate(mesh, &shooter, 0, visibility, row);
        black_box(&row);
    }
}

fn facing_pairs(mesh: &Mesh, row: &mut [f32]) -> u64 {
    let patches = 0..mesh.patches.len() as u32;
    let facing = patches.map(|patch| {
        form_factor::row(mesh, patch, &Open, row);
        row.iter().filter(|factor| **factor > 0.0).count() as u64
    });
    facing.sum()
}
