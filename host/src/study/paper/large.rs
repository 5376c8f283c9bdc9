//! Two scenes of the size of the paper's Fig. 5: 100 tagged shots, and the time of a frame.

use std::ops::ControlFlow;
use std::path::Path;

use anyhow::Result;
use relume::mesh::Spacing;

use super::clock::{published, tried};
use super::rooms::Room;
use super::sampling::SHOTS;
use crate::bake::{Method, Settings, bake};
use crate::import;
use crate::rows::Parallel;
use crate::scene::OwnedScene;
use crate::study::ray_rows::RayRows;
use crate::study::system::LANES;

/// A scene of the paper and the one that stands for it.
#[derive(Clone, Copy, Debug)]
pub struct Pair {
    /// Name in the paper.
    pub published: &'static str,
    /// Its lights, elements, and seconds for 100 shots.
    pub figures: (u32, usize, f64),
    /// Folder in `scenes`, and that with its further lights in `truth`.
    pub scene: &'static str,
    /// Has further lights there.
    pub lights: bool,
}

/// The two of Fig. 5.
pub const PAIRS: [Pair; 2] = [
    Pair {
        published: "Venus",
        figures: (3, 6221, 22.0),
        scene: "gazebo",
        lights: false,
    },
    Pair {
        published: "Table",
        figures: (5, 5874, 16.0),
        scene: "bevy_cornell",
        lights: true,
    },
];

/// What was measured.
#[derive(Clone, Debug)]
pub struct Large {
    /// Name in the paper.
    pub published: &'static str,
    /// Its seconds.
    pub published_seconds: f64,
    /// Name of the scene.
    pub scene: &'static str,
    /// Number of lights.
    pub lights: u32,
    /// Number of polygons.
    pub polygons: usize,
    /// Number of patches.
    pub patches: usize,
    /// Number of elements.
    pub elements: usize,
    /// Seconds of 100 published shots: kernel times 4 rays.
    pub plain: f64,
    /// Seconds of 100 published shots along exact rows.
    pub exact: f64,
    /// Seconds of the whole bake, converged, as shipped.
    pub shipped: f64,
}

/// Measures one scene; `None` when the data are not there.
pub fn measure(data: &Path, pair: &Pair) -> Result<Option<Large>> {
    let file = data.join("scenes").join(pair.scene).join("scene.obj");
    let lights = data.join("truth").join(pair.scene).join("lights.toml");
    let lights = pair.lights.then_some(lights.as_path());
    if !file.exists() || lights.is_some_and(|file| !file.exists()) {
        return Ok(None);
    }
    let scene = import::load(&file, lights)?.scene;
    let (_, elements, published_seconds) = pair.figures;
    let spacing = spacing(&scene, elements)?;
    let room = Room::new(scene, spacing)?;
    let plain = RayRows {
        bvh: &room.bvh,
        side: 2,
    };
    let exact = Parallel::new(&room.mesh.view(), &room.bvh);
    let settings = Settings {
        patch: Some(spacing.patch),
        element: Some(spacing.element),
        method: Method::Gather,
        ..Settings::default()
    };
    Ok(Some(Large {
        published: pair.published,
        published_seconds,
        scene: pair.scene,
        lights: room.lights(),
        polygons: room.scene.surfaces.len(),
        patches: room.mesh.patches.len(),
        elements: room.mesh.elements.len(),
        plain: tried(|| published::<LANES>(&room, &plain, SHOTS))?,
        exact: tried(|| published::<LANES>(&room, &exact, SHOTS))?,
        shipped: tried(|| {
            Ok(bake(&room.scene, &settings, &mut |_| {
                ControlFlow::Continue(())
            })?)
        })?,
    }))
}

/// Elements of such a length that there are as many as wanted, and patches of two elements' length, as the
/// paper's scenes have 3 to 4 elements for each patch.
fn spacing(scene: &OwnedScene, elements: usize) -> Result<Spacing> {
    let of = |element: f32| Spacing {
        patch: 2.0 * element,
        element,
    };
    let size = scene.view()?.diagonal();
    let (mut short, mut long) = (size / 4096.0, size);
    for _ in 0..10 {
        let middle = (short * long).sqrt();
        let count = Room::new(scene.clone(), of(middle))?.mesh.elements.len();
        if count > elements {
            short = middle;
        } else {
            long = middle;
        }
    }
    Ok(of(long))
}
