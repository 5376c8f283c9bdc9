//! Baked scenes, and the first of their lights.

use std::ops::ControlFlow;
use std::path::Path;

use anyhow::{Context, Result};

use crate::bake::{Settings, bake};
use crate::import;
use crate::solution::Solution;

/// A scene of the reference data and how to divide it.
#[derive(Clone, Copy, Debug)]
pub struct Scene {
    /// Folder in `scenes`, and that with its further lights in `truth`.
    pub name: &'static str,
    /// Has further lights there.
    pub lights: bool,
    /// Longest edges of patches and elements, in the scene's units; `None` for the bake's own rule.
    pub spacing: Option<[f32; 2]>,
}

/// The paper's mesh of 960 elements.
const COARSE: Option<[f32; 2]> = Some([1.0, 0.25]);

/// Nine elements for each of those.
const FINE: Option<[f32; 2]> = Some([1.0, 0.083_333_3]);

impl Scene {
    /// The paper's room with 64 lights.
    pub const ROOM_64: Self = Self::room("seed_room_64", COARSE);
    /// The paper's room with 256 lights.
    pub const ROOM_256: Self = Self::room("seed_room_256", COARSE);
    /// The same on 8640 elements.
    pub const FINE_64: Self = Self::room("seed_room_64", FINE);
    /// The same on 8640 elements.
    pub const FINE_256: Self = Self::room("seed_room_256", FINE);
    /// A room that somebody else made, with lamps, a bulb and a spot.
    pub const REAL: Self = Self {
        name: "bevy_cornell",
        lights: true,
        spacing: None,
    };

    const fn room(name: &'static str, spacing: Option<[f32; 2]>) -> Self {
        Self {
            name,
            lights: false,
            spacing,
        }
    }

    /// Bakes the scene of a folder of reference data.
    ///
    /// # Errors
    /// A scene that is not there or cannot be baked.
    pub fn bake(&self, data: &Path) -> Result<Solution> {
        let file = data.join("scenes").join(self.name).join("scene.obj");
        let lights = data.join("truth").join(self.name).join("lights.toml");
        let lights = self.lights.then_some(lights.as_path());
        let scene = import::load(&file, lights)
            .with_context(|| format!("no reference data at {}; set RELUME_DATA", data.display()))?
            .scene;
        let settings = Settings {
            patch: self.spacing.map(|[patch, _]| patch),
            element: self.spacing.map(|[_, element]| element),
            ..Settings::default()
        };
        Ok(bake(&scene, &settings, &mut |_| ControlFlow::Continue(()))?)
    }
}

/// The solution of the first so many lights alone.
#[must_use]
pub fn first_lights(solution: &Solution, count: usize) -> Solution {
    let all = solution.lights.len();
    let mut mesh = solution.mesh.clone();
    for face in &mut mesh.faces {
        face.emission = face
            .emission
            .filter(|emission| (emission.light as usize) < count);
    }
    let elements = solution.contributions.chunks(all.max(1));
    Solution {
        surfaces: solution.surfaces.clone(),
        luminaires: Vec::new(),
        mesh,
        image: None,
        lights: solution.lights[..count].to_vec(),
        contributions: elements
            .flat_map(|values| &values[..count])
            .copied()
            .collect(),
        direct: None,
        exposed: Vec::new(),
        method: solution.method,
        rows: solution.rows,
        spacing: solution.spacing,
    }
}

#[cfg(test)]
pub mod tests {
    use super::*;
    use crate::builtin::{PaperLamps, paper_room};

    /// The paper's room with eight lights on few elements.
    pub fn small() -> Solution {
        let room = paper_room(PaperLamps::Eight).unwrap();
        let settings = Settings {
            patch: Some(1.0),
            element: Some(1.0),
            ..Settings::default()
        };
        bake(&room.scene, &settings, &mut |_| ControlFlow::Continue(())).unwrap()
    }

    #[test]
    fn the_first_lights_keep_their_contributions() {
        let all = small();
        let three = first_lights(&all, 3);
        assert_eq!(three.lights[..], all.lights[..3]);
        for element in 0..all.mesh.elements.len() {
            assert_eq!(three.element(element), &all.element(element)[..3]);
        }
        let emitting = three
            .mesh
            .faces
            .iter()
            .filter(|face| face.emission.is_some());
        assert_eq!(emitting.count(), 3);
    }
}
