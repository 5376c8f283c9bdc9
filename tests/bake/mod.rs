//! Baking without a watcher, and the scenes that several tests bake.

use std::ops::ControlFlow;

use relume_host::bake::{Method, Settings, bake};
use relume_host::builtin::{Builtin, PaperLamps, paper_room};
use relume_host::scene::OwnedScene;
use relume_host::solution::Solution;

/// Bakes to the end.
pub fn baked(scene: &OwnedScene, settings: &Settings) -> Solution {
    bake(scene, settings, &mut |_| ControlFlow::Continue(())).expect("a legal scene")
}

/// The paper's own mesh, rows of exact form factors from undivided patches, to
/// a small residual.
pub fn exact(builtin: &Builtin) -> Settings {
    Settings {
        patch: Some(builtin.spacing.patch),
        element: Some(builtin.spacing.element),
        residual: 1e-6,
        method: Method::Rows,
        variation: f64::INFINITY,
        ..Settings::default()
    }
}

/// The paper's room with three lamps.
pub fn room() -> Builtin {
    paper_room(PaperLamps::Three).expect("a legal scene")
}
