//! The paper's room with any number of lights.

use std::ops::ControlFlow;

use anyhow::Result;
use glam::Vec3;
use relume::color::Rgb;
use relume::mesh::Spacing;
use relume::scene::{Emission, Surface};

use crate::builtin::{PaperLamps, paper_room};
use crate::bvh::Bvh;
use crate::mesh::{self, OwnedMesh};
use crate::scene::{Light, OwnedScene};

/// Patches of 1 m, elements of 0.25 m.
pub const SPACING: Spacing = Spacing {
    patch: 1.0,
    element: 0.25,
};

/// Edge of the room, height and edge of a lamp, as in the built-in rooms.
const ROOM: f32 = 3.0;
const HEIGHT: f32 = 2.98;
const LAMP: f32 = 0.2;

/// The room with its lamps: the built-in ones for 1, 3 and 8, else a grid of the same lamps, eight in a
/// row, under the ceiling.
pub fn room(lights: u32) -> Result<OwnedScene> {
    match lights {
        1 => return Ok(paper_room(PaperLamps::One)?.scene),
        3 => return Ok(paper_room(PaperLamps::Three)?.scene),
        8 => return Ok(paper_room(PaperLamps::Eight)?.scene),
        _ => {}
    }
    let mut scene = paper_room(PaperLamps::One)?.scene;
    // The lamp is the last surface.
    let walls = scene.surfaces.len() - 1;
    scene.surfaces.truncate(walls);
    scene.textures.truncate(walls);
    scene.lights.clear();
    let rows = lights.div_ceil(8);
    for light in 0..lights {
        let at = |place: u32, count: u32| ROOM * (place as f32 + 0.5) / count as f32;
        let (x, z) = (at(light % 8, 8), at(light / 8, rows));
        let h = LAMP / 2.0;
        let outline = [(-h, -h), (h, -h), (h, h), (-h, h)];
        let outline = outline.map(|(dx, dz)| Vec3::new(x + dx, HEIGHT, z + dz));
        let number = scene.surfaces.len() as u32;
        let share = Rgb::WHITE;
        let lamp = Surface::new(number, &outline, Rgb::BLACK)?;
        scene
            .surfaces
            .push(lamp.emitting(number, Emission { light, share })?);
        scene.textures.push(None);
        scene.lights.push(Light {
            name: format!("light_{light}"),
            emission: Rgb::WHITE,
            importance: 1.0,
        });
    }
    Ok(scene)
}

/// The scene with all of its lamps under one tag.
pub fn combined(scene: &OwnedScene) -> Result<OwnedScene> {
    retagged(scene, |_| true)
}

/// The scene with one of its lights; the other lamps still hide what is behind them.
pub fn only(scene: &OwnedScene, light: u32) -> Result<OwnedScene> {
    retagged(scene, |tag| tag == light)
}

/// The scene under one tag, with the lamps that `shines` admits.
fn retagged(scene: &OwnedScene, shines: impl Fn(u32) -> bool) -> Result<OwnedScene> {
    let mut one = scene.clone();
    one.lights.truncate(1);
    for (surface, number) in one.surfaces.iter_mut().zip(0..) {
        let Some(Emission { light, share }) = surface.emission() else {
            continue;
        };
        let lamp = Surface::new(
            number,
            surface.polygon().vertices(),
            surface.reflectance().get(),
        )?;
        *surface = if shines(light) {
            lamp.emitting(number, Emission { light: 0, share })?
        } else {
            lamp
        };
    }
    Ok(one)
}

/// A divided scene and what blocks in it.
pub struct Room {
    pub scene: OwnedScene,
    pub mesh: OwnedMesh,
    pub bvh: Bvh,
}

impl Room {
    pub fn new(scene: OwnedScene, spacing: Spacing) -> Result<Self> {
        let mut go_on = |_, _| ControlFlow::Continue(());
        let view = scene.view()?;
        let bvh = Bvh::for_scene(&view);
        let mesh = mesh::build(&scene, &view, spacing, &bvh, &mut go_on)?;
        Ok(Self { scene, mesh, bvh })
    }

    pub fn lights(&self) -> u32 {
        self.scene.lights.len() as u32
    }
}
