//! What every bench measures on, and for how long.
//!
//! Times are wall-clock times in the bench profile (release, baseline target) on as many threads as
//! the machine offers to rayon; nothing passes or fails by them.

// Every bench is a program of its own and takes its part of this.
#![allow(dead_code)]

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use criterion::Criterion;
use relume::atlas::Quantity;
use relume::code::Code;
use relume_host::bake::{Settings, bake};
use relume_host::builtin::{Builtin, PaperLamps, cornell_box, paper_room};
use relume_host::bvh::Bvh;
use relume_host::mesh::{self, OwnedMesh};
use relume_host::pack::Format;
use relume_host::scene::OwnedScene;
use relume_host::solution::Solution;

/// Ten samples in about a second, and what the command line says.
pub fn criterion() -> Criterion {
    Criterion::default()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_secs(1))
        .configure_from_args()
}

/// The time that the work takes once.
pub fn time(work: impl FnOnce()) -> Duration {
    let start = Instant::now();
    work();
    start.elapsed()
}

/// The paper's room: 12 polygons and the lamps, 60 patches and one per lamp, 960 elements.
pub fn room(lamps: PaperLamps) -> Builtin {
    paper_room(lamps).expect("a legal scene")
}

/// The Cornell box with its three lights.
pub fn cornell() -> Builtin {
    cornell_box().expect("a legal scene")
}

/// The built-in scene's own mesh and a residual.
pub fn settings(builtin: &Builtin, residual: f32) -> Settings {
    Settings {
        patch: Some(builtin.spacing.patch),
        element: Some(builtin.spacing.element),
        residual,
        ..Settings::default()
    }
}

/// Bakes to the end.
pub fn baked(scene: &OwnedScene, settings: &Settings) -> Solution {
    bake(scene, settings, &mut |_| ControlFlow::Continue(())).expect("a legal scene")
}

/// Divides a built-in scene as its bake would.
pub fn meshed(builtin: &Builtin) -> OwnedMesh {
    let scene = &builtin.scene;
    let view = scene.view().expect("a legal scene");
    let bvh = Bvh::for_scene(&scene.view().expect("a legal scene"));
    let mut go_on = |_, _| ControlFlow::Continue(());
    mesh::build(scene, &view, builtin.spacing, &bvh, &mut go_on).expect("a mesh that fits")
}

/// Irradiance in RGB with the mesh, in the given code.
pub fn format(code: Code) -> Format {
    Format {
        packing: code.into(),
        quantity: Quantity::Irradiance,
        mesh: true,
    }
}
