extern crate std;
use super::*;
use crate::atlas::{Atlas, Contents, LightEntry, Quantity, size, write};
use crate::code::{Code, Scale};
use crate::color::Rgb;
use crate::mesh::{MeshStorage, Spacing, subdivide};
use crate::scene::{Emission, Scene, Surface};
use embedded_graphics::mock_display::MockDisplay;
use embedded_graphics::pixelcolor::{Rgb888, RgbColor};
use glam::Vec2;
use std::vec;
use std::vec::Vec;

/// A red wall at z = 0 (two elements side by side) and a green lamp in front of its right part.
fn atlas() -> Vec<u8> {
    let square = |low: Vec2, high: Vec2, z| {
        [
            Vec3::new(low.x, low.y, z),
            Vec3::new(high.x, low.y, z),
            Vec3::new(high.x, high.y, z),
            Vec3::new(low.x, high.y, z),
        ]
    };
    let wall = square(Vec2::new(-2.0, -1.0), Vec2::new(2.0, 1.0), 0.0);
    let lamp = square(Vec2::new(0.0, 0.0), Vec2::new(1.0, 0.5), 1.0);
    let emission = Emission {
        light: 0,
        share: Rgb::WHITE,
    };
    let surfaces = [
        Surface::new(0, &wall, Rgb::splat(0.5)).unwrap(),
        Surface::new(1, &lamp, Rgb::BLACK)
            .and_then(|s| s.emitting(1, emission))
            .unwrap(),
    ];
    let scene = Scene::new(&surfaces, &[], 1).unwrap();
    let mut storage = MeshStorage::<2, 2, 2>::new();
    let spacing = Spacing {
        patch: 4.0,
        element: 2.0,
    };
    subdivide(&scene, spacing, |_, _| true, &mut storage).unwrap();
    let contents = Contents {
        quantity: Quantity::Irradiance,
        lights: &[LightEntry::exponential(
            "lamp",
            Rgb::WHITE,
            Code::Exp8s,
            Scale::ONE,
        )],
        elements: 2,
        image_width: 0,
        errors: None,
        tiles: &[],
        mesh: Some((&surfaces.map(|s| *s.polygon()), storage.mesh())),
    };
    let mut bytes = vec![0; size(&contents).unwrap()];
    write(&contents, |_, _| Rgb::WHITE, &mut bytes).unwrap();
    bytes
}

fn camera() -> Camera {
    Camera {
        eye: Vec3::new(0.0, 0.0, 1000.0),
        target: Vec3::ZERO,
        up: Vec3::Y,
        fov: 2.0 * (1.0_f32 / 250.0).atan(),
    }
}

fn color(shown: Shown) -> Rgb888 {
    match shown {
        Shown::Element(0) => Rgb888::RED,
        Shown::Element(_) => Rgb888::BLUE,
        Shown::Lamp(_) => Rgb888::GREEN,
        Shown::Unlit => Rgb888::WHITE,
    }
}

#[test]
fn near_hides_far_and_every_pixel_is_painted_once() {
    let bytes = atlas();
    let atlas = Atlas::parse(&bytes).unwrap();
    // 8 x 8 m on 64 x 64 pixels; MockDisplay panics when a pixel is drawn twice.
    let mut display = MockDisplay::<Rgb888>::new();
    let mut band = [Sample::new(Rgb888::BLACK); 64 * 5];
    paint(
        &mut display,
        &atlas.mesh().unwrap(),
        &camera(),
        Rgb888::BLACK,
        &mut band,
        color,
    )
    .unwrap();
    let at = |x, y| display.get_pixel(Point::new(x, y)).unwrap();
    assert_eq!(at(2, 2), Rgb888::BLACK);
    assert_eq!(at(17, 32), Rgb888::RED);
    assert_eq!(at(46, 32), Rgb888::BLUE);
    assert_eq!(at(35, 30), Rgb888::GREEN, "the lamp is in front");
    assert_eq!(at(35, 34), Rgb888::BLUE, "below the lamp");
    let count = |wanted| {
        let pixels = (0..64 * 64).map(|i| Point::new(i % 64, i / 64));
        pixels
            .filter(|p| display.get_pixel(*p) == Some(wanted))
            .count()
    };
    assert_eq!(count(Rgb888::RED), 16 * 16);
    assert_eq!(count(Rgb888::GREEN), 8 * 4);
    assert_eq!(count(Rgb888::BLUE), 16 * 16 - 8 * 4);
}

#[test]
fn a_band_below_one_row_and_a_blind_camera_are_errors() {
    let bytes = atlas();
    let atlas = Atlas::parse(&bytes).unwrap();
    let mesh = atlas.mesh().unwrap();
    let mut display = MockDisplay::<Rgb888>::new();
    let mut band = [Sample::new(Rgb888::BLACK); 63];
    let black = Rgb888::BLACK;
    let found = paint(&mut display, &mesh, &camera(), black, &mut band, color);
    assert_eq!(found, Err(DrawError::Band { needed: 64 }));
    let blind = Camera {
        up: Vec3::Z,
        ..camera()
    };
    let found = paint(&mut display, &mesh, &blind, black, &mut band, color);
    assert_eq!(found, Err(DrawError::Camera));
}

#[test]
fn what_is_behind_the_eye_is_not_drawn() {
    let bytes = atlas();
    let atlas = Atlas::parse(&bytes).unwrap();
    let away = Camera {
        target: Vec3::new(0.0, 0.0, 2000.0),
        ..camera()
    };
    let mut display = MockDisplay::<Rgb888>::new();
    let mut band = [Sample::new(Rgb888::BLACK); 640];
    let mesh = atlas.mesh().unwrap();
    paint(&mut display, &mesh, &away, Rgb888::BLACK, &mut band, color).unwrap();
    let painted = (0..64 * 64)
        .filter(|i| display.get_pixel(Point::new(i % 64, i / 64)) != Some(Rgb888::BLACK));
    assert_eq!(painted.count(), 0);
}
