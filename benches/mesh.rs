//! Meshing: time to divide a scene, and elements per second.
//!
//! `subdivide` is the solver's part alone; `build` adds the host's search for the faces that light
//! reaches. `tree` is the tree of boxes that this search and the bake look through.

mod scenes;

use criterion::{BenchmarkId, Criterion, Throughput};
use relume::mesh::subdivide;
use relume_host::builtin::{Builtin, PaperLamps};
use relume_host::bvh::Bvh;
use relume_host::mesh::OwnedMesh;

fn main() {
    let mut criterion = scenes::criterion();
    divide(
        &mut criterion,
        "paper room",
        &scenes::room(PaperLamps::Eight),
    );
    divide(&mut criterion, "cornell box", &scenes::cornell());
    divide(&mut criterion, "cornell box, 100k", &fine_cornell());
    criterion.final_summary();
}

/// The Cornell box in about 100 000 elements.
fn fine_cornell() -> Builtin {
    let mut builtin = scenes::cornell();
    builtin.spacing.element /= 6.0;
    builtin
}

fn divide(criterion: &mut Criterion, name: &str, builtin: &Builtin) {
    let view = builtin.scene.view().expect("a legal scene");
    let elements = scenes::meshed(builtin).elements.len();

    let mut group = criterion.benchmark_group("mesh");
    group.throughput(Throughput::Elements(elements as u64));
    group.bench_function(BenchmarkId::new("subdivide", name), |bencher| {
        bencher.iter(|| {
            let mut mesh = OwnedMesh::default();
            subdivide(&view, builtin.spacing, |_, _| true, &mut mesh).expect("a mesh that fits");
            mesh
        });
    });
    group.bench_function(BenchmarkId::new("build", name), |bencher| {
        bencher.iter(|| scenes::meshed(builtin));
    });
    group.throughput(Throughput::Elements(builtin.scene.surfaces.len() as u64));
    group.bench_function(BenchmarkId::new("tree", name), |bencher| {
        bencher.iter(|| Bvh::for_scene(&view));
    });
    group.finish();
}
