//! The paper's room with three lights: baked and packed in memory of fixed capacity, the same on a device and here.

use core::array;

use glam::Vec3;
use relume::atlas::{Contents, LightEntry, Quantity, write};
use relume::code::{Code, Scale};
use relume::color::Rgb;
use relume::form_factor;
use relume::mesh::{MeshStorage, Side, Spacing, subdivide};
use relume::refine::{Choice, FixedStorage, Refinement};
use relume::scene::{Emission, Scene, Surface};
use relume::visibility::{OccludersAndBodies, bodies};

/// Polygons of the room and its lamps.
pub const POLYGONS: usize = 15;
const PATCHES: usize = 63;
const ELEMENTS: usize = 960;
const LIGHTS: usize = 3;

/// Vertices, reflectance, and the light of a lamp.
pub type Polygon = ([[f32; 3]; 4], [f32; 3], Option<u32>);

/// What a bake needs.
pub struct Memory {
    mesh: MeshStorage<POLYGONS, PATCHES, ELEMENTS>,
    state: FixedStorage<LIGHTS, PATCHES, ELEMENTS, 0>,
    row: [f32; ELEMENTS],
}

impl Memory {
    /// Empty memory.
    #[allow(clippy::new_without_default, reason = "it is for statics")]
    pub const fn new() -> Self {
        Self {
            mesh: MeshStorage::new(),
            state: FixedStorage::new(),
            row: [0.0; ELEMENTS],
        }
    }
}

/// What came out.
#[derive(Debug, PartialEq, Eq)]
pub struct Baked {
    /// Rows that were evaluated.
    pub rows: u32,
    /// FNV-1a of the bits of all contributions.
    pub contributions: u32,
    /// Bytes of the atlas.
    pub length: usize,
}

fn surface(index: u32, polygon: &Polygon) -> Option<Surface> {
    let (vertices, reflectance, light) = polygon;
    let vertices = vertices.map(|[x, y, z]| Vec3::new(x, y, z));
    let surface = Surface::new(index, &vertices, Rgb::from_array(*reflectance)).ok()?;
    match light {
        Some(light) => {
            let share = Rgb::WHITE;
            surface
                .emitting(
                    index,
                    Emission {
                        light: *light,
                        share,
                    },
                )
                .ok()
        }
        None => Some(surface.two_sided()),
    }
}

/// All surfaces; `None` where one is not legal.
fn surfaces<const N: usize>(polygons: &[Polygon; N]) -> Option<[Surface; N]> {
    let mut numbered = (0..).zip(polygons);
    let found: [Option<Surface>; N] = array::from_fn(|_| {
        let (index, polygon) = numbered.next()?;
        surface(index, polygon)
    });
    let first = (*found.first()?)?;
    let is_whole = found.iter().all(Option::is_some);
    is_whole.then(|| found.map(|surface| surface.unwrap_or(first)))
}

/// Polygons of the room of the moving light: its walls, five boxes, a lamp.
pub const MOVING_POLYGONS: usize = 37;
const MOVING_PATCHES: usize = 128;
const MOVING_ELEMENTS: usize = 1920;

/// What direct light needs.
pub struct DirectMemory {
    mesh: MeshStorage<MOVING_POLYGONS, MOVING_PATCHES, MOVING_ELEMENTS>,
    row: [f32; MOVING_ELEMENTS],
}

impl DirectMemory {
    /// Empty memory.
    #[allow(clippy::new_without_default, reason = "it is for statics")]
    pub const fn new() -> Self {
        Self {
            mesh: MeshStorage::new(),
            row: [0.0; MOVING_ELEMENTS],
        }
    }
}

/// Direct light with shadows of a lamp in all elements of a room.
#[derive(Debug, PartialEq, Eq)]
pub struct Direct {
    /// FNV-1a of the bits of all values.
    pub hash: u32,
    /// Elements that it reaches.
    pub lit: u32,
    /// What the counter said.
    pub count: u32,
}

/// The direct light of the last polygon, a lamp: its row of form factors, which `count` counts. `None` when something does not fit.
pub fn direct(
    polygons: &[Polygon; MOVING_POLYGONS],
    memory: &mut DirectMemory,
    count: impl FnOnce(&mut dyn FnMut()) -> u32,
) -> Option<Direct> {
    let surfaces = surfaces(polygons)?;
    let scene = Scene::new(&surfaces, &[], 1).ok()?;
    let spacing = Spacing {
        patch: 1.001,
        element: 0.2501,
    };
    let fronts = |_, side| side == Side::Front;
    subdivide(&scene, spacing, fronts, &mut memory.mesh).ok()?;
    let mesh = memory.mesh.mesh();
    if mesh.elements.len() != MOVING_ELEMENTS {
        return None;
    }
    let mut found = bodies(&surfaces);
    let mut next = || found.next();
    // The room and its boxes.
    let bodies = [next()?, next()?, next()?, next()?, next()?, next()?];
    let occluders = OccludersAndBodies {
        surfaces: &surfaces,
        bodies: &bodies,
    };
    let lamp = mesh.patches.len().checked_sub(1)? as u32;
    let row = &mut memory.row;
    let count = count(&mut || form_factor::row(&mesh, lamp, &occluders, row));
    let bytes = memory.row.iter().flat_map(|value| value.to_le_bytes());
    Some(Direct {
        hash: bytes.fold(0x811c_9dc5, |hash, byte| {
            (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193)
        }),
        lit: memory.row.iter().filter(|value| **value > 0.0).count() as u32,
        count,
    })
}

/// Bakes until less than a hundredth of any light's power is unshot, and packs into `flash`; `None` when something does not fit.
pub fn bake(
    polygons: &[Polygon; POLYGONS],
    memory: &mut Memory,
    flash: &mut [u8],
) -> Option<Baked> {
    let surfaces = surfaces(polygons)?;
    let scene = Scene::new(&surfaces, &[], LIGHTS as u32).ok()?;
    let spacing = Spacing {
        patch: 1.0,
        element: 0.25,
    };
    subdivide(
        &scene,
        spacing,
        |_, side| side == Side::Front,
        &mut memory.mesh,
    )
    .ok()?;
    let mesh = memory.mesh.mesh();
    let mut refinement =
        Refinement::new(mesh, scene.lights(), 1e-2, memory.state.storage()).ok()?;
    refinement.set_choice(Choice::Power);
    let mut found = bodies(&surfaces);
    let bodies = [found.next()?, found.next()?];
    let occluders = OccludersAndBodies {
        surfaces: &surfaces,
        bodies: &bodies,
    };
    let mut rows = 0;
    while let Some(patch) = refinement.next_shooter() {
        form_factor::row(&mesh, patch, &occluders, &mut memory.row);
        refinement.shoot(patch, &memory.row).ok()?;
        rows += 1;
    }

    let (mut contributions, mut largest) = (0x811c_9dc5_u32, [0.0_f32; LIGHTS]);
    for element in 0..ELEMENTS as u32 {
        for (light, largest) in (0..).zip(&mut largest) {
            let value = refinement.irradiance(element, light);
            *largest = largest.max(value.max_channel());
            let bytes = value.to_array().into_iter().flat_map(f32::to_le_bytes);
            contributions = bytes.fold(contributions, |hash, byte| {
                (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193)
            });
        }
    }
    let [a, b, c] = largest.map(Scale::fitting);
    let light = |name, scale| LightEntry::exponential(name, Rgb::WHITE, Code::Exp8s, scale);
    let lights = [light("left", a?), light("right", b?), light("back", c?)];
    let contents = Contents {
        quantity: Quantity::Irradiance,
        lights: &lights,
        elements: ELEMENTS as u32,
        image_width: 0,
        errors: None,
        tiles: &[],
        mesh: None,
    };
    let length = write(&contents, |e, l| refinement.irradiance(e, l), flash).ok()?;
    Some(Baked {
        rows,
        contributions,
        length,
    })
}
