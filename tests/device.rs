//! The solver as a device links it: everything in statics of fixed capacity, from the scene to the
//! pixels, and the host's bake beside it.

mod bake;

use std::array;
use std::sync::Mutex;

use bake::{baked, exact, room};
use embedded_graphics::framebuffer::{Framebuffer, buffer_size};
use embedded_graphics::image::GetPixel;
use embedded_graphics::pixelcolor::raw::{LittleEndian, RawU16};
use embedded_graphics::pixelcolor::{Rgb565, RgbColor};
use embedded_graphics::prelude::Point;
use relume::atlas::{self, Atlas, Contents, LightEntry, Quantity};
use relume::code::{Code, Scale};
use relume::color::Rgb;
use relume::draw::{Sample, Shown, paint};
use relume::form_factor;
use relume::mesh::{MeshStorage, subdivide};
use relume::refine::{Choice, FixedStorage, Refinement};
use relume::relight::{FixedMix, FixedWeight, change_fixed, relight_fixed};
use relume::scene::Scene;
use relume::tone::{Exposure, radiance};
use relume::visibility::{Body, OccludersAndBodies, bodies};
use relume_host::bake::Settings;

const ELEMENTS: usize = 960;
const LIGHTS: usize = 3;

/// Patches of the room and its lamps.
const PATCHES: usize = 63;

static MESH: Mutex<MeshStorage<15, PATCHES, ELEMENTS>> = Mutex::new(MeshStorage::new());
static MEMORY: Mutex<FixedStorage<LIGHTS, PATCHES, ELEMENTS, 0>> = Mutex::new(FixedStorage::new());
static FLASH: Mutex<[u8; 44_000]> = Mutex::new([0; 44_000]);

/// Bakes the paper's room with what a device has, and packs it; the atlas is as long as told.
fn bake_and_pack(flash: &mut [u8]) -> usize {
    let room = room();
    let surfaces = &room.scene.surfaces;
    let scene = Scene::new(surfaces, &[], LIGHTS as u32).expect("a legal scene");
    let mut mesh = MESH.lock().expect("one user");
    let fronts = |_, side| side == relume::mesh::Side::Front;
    subdivide(&scene, room.spacing, fronts, &mut *mesh).expect("it fits");
    let mesh = mesh.mesh();

    let mut memory = MEMORY.lock().expect("one user");
    let mut refinement =
        Refinement::new(mesh, scene.lights(), 1e-2, memory.storage()).expect("it fits");
    refinement.set_choice(Choice::Power);
    let mut row = [0.0; ELEMENTS];
    let mut found = bodies(surfaces);
    // The room and the block in it.
    let bodies: [Body; 2] = array::from_fn(|_| found.next().expect("two bodies"));
    let occluders = OccludersAndBodies {
        surfaces,
        bodies: &bodies,
    };
    while let Some(patch) = refinement.next_shooter() {
        form_factor::row(&mesh, patch, &occluders, &mut row);
        refinement.shoot(patch, &row).expect("a legal row");
    }

    // The host is told the same; its bake differs by the ambient term alone.
    let settings = Settings {
        residual: 1e-2,
        plain: true,
        ..exact(&room)
    };
    let host = baked(&room.scene, &settings);
    for element in 0..ELEMENTS as u32 {
        for light in 0..LIGHTS as u32 {
            let device = refinement.irradiance(element, light);
            assert_eq!(device, host.element(element as usize)[light as usize]);
        }
    }

    let largest = |light| {
        let values = (0..ELEMENTS as u32).map(|e| refinement.irradiance(e, light).max_channel());
        values.fold(0.0, f32::max)
    };
    let names = ["left", "right", "back"];
    let lights: Vec<LightEntry> = names
        .iter()
        .zip(0..)
        .map(|(name, light)| {
            let scale = Scale::fitting(largest(light)).expect("finite");
            LightEntry::exponential(name, Rgb::splat(20.0), Code::Exp8s, scale)
        })
        .collect();
    let outlines: Vec<_> = surfaces.iter().map(|s| *s.polygon()).collect();
    let contents = Contents {
        quantity: Quantity::Irradiance,
        lights: &lights,
        elements: ELEMENTS as u32,
        image_width: 0,
        errors: None,
        tiles: &[],
        mesh: Some((&outlines, mesh)),
    };
    atlas::write(&contents, |e, l| refinement.irradiance(e, l), flash).expect("it fits")
}

type Frame =
    Framebuffer<Rgb565, RawU16, LittleEndian, 120, 120, { buffer_size::<Rgb565>(120, 120) }>;

/// Paints the room from the integer sums.
fn frame(atlas: &Atlas, sums: &[[u32; 3]], unit: f32) -> Frame {
    let mesh = atlas.mesh().expect("it was packed with its mesh");
    let exposure = Exposure::for_white(0.5);
    let color = |shown: Shown| {
        let light = match shown {
            Shown::Element(number) => {
                let element = mesh.element(number).expect("it is drawn");
                let [r, g, b] = sums[number as usize].map(|sum| sum as f32 * unit);
                radiance(element.reflectance, Rgb::new(r, g, b), Rgb::BLACK)
            }
            Shown::Lamp(_) => Rgb::WHITE,
            Shown::Unlit => Rgb::BLACK,
        };
        Rgb565::from(RawU16::from(exposure.rgb565(light)))
    };
    let mut frame = Frame::new();
    let mut band = [Sample::new(Rgb565::BLACK); 120 * 16];
    paint(
        &mut frame,
        &mesh,
        &room().camera,
        Rgb565::MAGENTA,
        &mut band,
        color,
    )
    .expect("it draws");
    frame
}

fn pixels(frame: &Frame) -> Vec<Rgb565> {
    (0..120 * 120)
        .map(|i| frame.pixel(Point::new(i % 120, i / 120)).expect("inside"))
        .collect()
}

#[test]
fn a_device_bakes_packs_relights_and_draws_the_papers_room() {
    let mut flash = FLASH.lock().expect("one user");
    let length = bake_and_pack(&mut flash[..]);
    let atlas = Atlas::parse(&flash[..length]).expect("it was just written");

    let mix = [Rgb::splat(20.0); LIGHTS];
    let mut weights = [FixedWeight::EMPTY; LIGHTS];
    let mut fixed = FixedMix::new(&atlas, &mix, &mix, &mut weights).expect("it fits");
    let mut sums = [[0; 3]; ELEMENTS];
    relight_fixed(&atlas, &fixed, &mut sums).expect("it fits");
    let bright = pixels(&frame(&atlas, &sums, fixed.unit()));
    assert!(
        bright.iter().all(|pixel| *pixel != Rgb565::MAGENTA),
        "a closed room has no background"
    );

    for light in 0..LIGHTS as u32 {
        change_fixed(&atlas, &mut fixed, light, Rgb::BLACK, &mut sums).expect("it is dimmer");
    }
    assert!(
        sums.iter().flatten().all(|sum| *sum == 0),
        "all lights are off"
    );
    let dark = pixels(&frame(&atlas, &sums, fixed.unit()));
    let lit = dark.iter().filter(|pixel| **pixel != Rgb565::BLACK);
    assert!(lit.count() < 120 * 120 / 20, "only the lamps are painted");

    for light in 0..LIGHTS as u32 {
        change_fixed(&atlas, &mut fixed, light, mix[light as usize], &mut sums).expect("as before");
    }
    assert_eq!(
        pixels(&frame(&atlas, &sums, fixed.unit())),
        bright,
        "to the bit"
    );
}
