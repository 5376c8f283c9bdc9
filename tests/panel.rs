//! The room panel as its user sees it: pictures against the float relight of the same atlas, and touches.

#[path = "panel/atlas.rs"]
mod atlas;

use embedded_graphics::framebuffer::{Framebuffer, buffer_size};
use embedded_graphics::image::GetPixel;
use embedded_graphics::pixelcolor::Rgb565;
use embedded_graphics::pixelcolor::raw::{LittleEndian, RawU16};
use embedded_graphics::prelude::*;
use relume::atlas::Atlas;
use relume::color::Rgb;
use relume::tone::Exposure;
use relume_host::pack::relight_atlas;
use relume_panel::{EXPOSURE, LIGHTS, Memory, PICTURE, Panel, ROOMS, SCREEN, slider};

type Screen =
    Framebuffer<Rgb565, RawU16, LittleEndian, 320, 240, { buffer_size::<Rgb565>(320, 240) }>;

fn shot(panel: &Panel) -> Vec<Rgb565> {
    let mut screen = Screen::new();
    let Ok(()) = panel.draw(&mut screen);
    let pixels = SCREEN.points().map(|at| screen.pixel(at));
    pixels.map(|pixel| pixel.expect("on the screen")).collect()
}

/// Ends all fades.
fn settle(panel: &mut Panel) {
    while panel
        .tick()
        .expect("lamps stay below their nominal emission")
    {}
}

fn at(pixels: &[Rgb565], place: Point) -> Rgb565 {
    pixels[place.y as usize * SCREEN.size.width as usize + place.x as usize]
}

/// The largest difference of two colours in a channel, in its own steps.
fn steps_apart(a: Rgb565, b: Rgb565) -> u8 {
    let r = a.r().abs_diff(b.r());
    r.max(a.g().abs_diff(b.g())).max(a.b().abs_diff(b.b()))
}

/// What the picture has to be, by the `f32` kernel.
fn expected(atlas: &Atlas, shares: [f32; LIGHTS]) -> Vec<Rgb565> {
    let mix = shares.map(Rgb::splat);
    let radiance = relight_atlas(atlas, &mix).expect("one weight per light");
    let exposure = Exposure::new(EXPOSURE).expect("above zero");
    let shown = radiance.iter().map(|value| exposure.rgb565(*value));
    shown.map(|pixel| RawU16::new(pixel).into()).collect()
}

fn assert_picture(atlas: &Atlas, panel: &Panel, shares: [f32; LIGHTS]) {
    let pixels = shot(panel);
    for (place, expected) in PICTURE.points().zip(expected(atlas, shares)) {
        let found = at(&pixels, place);
        let steps = steps_apart(found, expected);
        assert!(steps <= 1, "{place:?}: {found:?} for {expected:?}");
    }
}

#[test]
fn the_panel_shows_the_flat_as_its_lamps_are_touched() {
    let bytes = atlas::atlas().expect("the flat bakes");
    let atlas = Atlas::parse(&bytes).expect("it was just packed");
    let mut memory = Box::new(Memory::new());
    let mut panel = Panel::new(atlas, &mut memory).expect("this is the flat");
    let dark = shot(&panel);
    assert_picture(&atlas, &panel, [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);

    let fixtures: Vec<_> = ROOMS.iter().flat_map(|room| room.lamps).collect();
    for (number, fixture) in fixtures.iter().enumerate() {
        // A tap where the lamp is seen turns it on, and it is white there, or at least as bright as its tint.
        panel.tap(fixture.at);
        settle(&mut panel);
        assert!(panel.lamps()[number].is_on(), "{}", fixture.name);
        let mut shares = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
        shares[number] = 1.0;
        assert_picture(&atlas, &panel, shares);
        let lamp = at(&shot(&panel), fixture.at);
        assert!(lamp.r().max(lamp.b()) == 31, "{}: {lamp:?}", fixture.name);

        // A drag dims it, to the square of the level; a tap on the slider turns it off, and nothing of it is left.
        let slider = slider(number);
        panel.drag(slider.center());
        settle(&mut panel);
        let level = f32::from(panel.lamps()[number].shown()) / 100.0;
        assert!((0.48..0.52).contains(&level), "{level}");
        shares[number] = level * level;
        assert_picture(&atlas, &panel, shares);
        panel.tap(slider.top_left);
        settle(&mut panel);
        assert_eq!(shot(&panel), dark, "{}", fixture.name);
    }

    // Between the controls nothing happens.
    panel.tap(SCREEN.top_left);
    panel.drag(PICTURE.center());
    assert_eq!(panel.tick(), Ok(false));
}

#[test]
fn other_atlases_are_refused() {
    let bytes = include_bytes!("fuzz/seeds/atlas/lum8.atlas");
    let mut memory = Box::new(Memory::new());
    let atlas = Atlas::parse(bytes).expect("a seed of the fuzzer");
    assert!(Panel::new(atlas, &mut memory).is_none());
}
