//! Import: polygons per second from OBJ and glTF files, as counted in the file.
//!
//! A generated OBJ of 10 000 quads, and the same in triangles that have to be put together again; real
//! files where the reference data is. They come from the page cache.

mod scenes;

#[path = "../tests/data/mod.rs"]
mod data;
#[path = "../tests/skip/mod.rs"]
mod skip;

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use criterion::{Criterion, Throughput};
use relume_host::import;

/// Quads along an edge of the generated terrain.
const SIDE: u32 = 100;

/// Real files; the last has a texture, which is averaged over its polygons.
const REAL: [&str; 4] = [
    "scenes/frads_office/scene.obj",
    "scenes/gazebo/scene.obj",
    "originals/CornellBox.glb",
    "originals/tile-game-room6.glb",
];

/// How a generated file says a quad.
#[derive(Clone, Copy, Debug)]
enum Face {
    Quad,
    Triangles,
}

fn main() {
    let mut criterion = scenes::criterion();
    let folder = tempfile::tempdir().expect("room for a file");
    for face in [Face::Quad, Face::Triangles] {
        let name = format!("{face:?}.obj");
        let generated = folder.path().join(&name);
        fs::write(&generated, terrain(face)).expect("room for a file");
        read(&mut criterion, &format!("generated/{name}"), &generated);
    }
    for (name, path) in real_files() {
        read(&mut criterion, name, &path);
    }
    criterion.final_summary();
}

fn read(criterion: &mut Criterion, name: &str, path: &Path) {
    let polygons = import::load(path, None).expect("a legal scene").polygons;
    let mut group = criterion.benchmark_group("import");
    group.throughput(Throughput::Elements(polygons as u64));
    group.bench_function(name, |bencher| {
        bencher.iter(|| import::load(path, None).expect("a legal scene"));
    });
    group.finish();
}

fn real_files() -> Vec<(&'static str, PathBuf)> {
    let Some(folder) = data::data_dir() else {
        return Vec::new();
    };
    REAL.into_iter()
        .map(|name| (name, folder.join(name)))
        .collect()
}

/// A grid of quads that steps up and down, so that each is planar.
fn terrain(face: Face) -> String {
    let mut text = String::new();
    for row in 0..=SIDE {
        for column in 0..=SIDE {
            let _ = writeln!(text, "v {column} {} {row}", row % 2);
        }
    }
    for row in 0..SIDE {
        for column in 1..=SIDE {
            let corner = row * (SIDE + 1) + column;
            let below = corner + SIDE + 1;
            let (right, opposite) = (corner + 1, below + 1);
            let _ = match face {
                Face::Quad => writeln!(text, "f {corner} {below} {opposite} {right}"),
                Face::Triangles => writeln!(
                    text,
                    "f {corner} {below} {opposite}\nf {corner} {opposite} {right}"
                ),
            };
        }
    }
    text
}
