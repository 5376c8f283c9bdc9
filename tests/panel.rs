//! The room panel as its user sees it: pictures against the float relight of the same atlas, and touches.

#[path = "panel/atlas.rs"]
mod atlas;
mod skip;

use std::path::Path;
use std::process::Command;
use std::sync::OnceLock;
use std::{env, fs};

use embedded_graphics::framebuffer::{Framebuffer, buffer_size};
use embedded_graphics::image::GetPixel;
use embedded_graphics::pixelcolor::Rgb565;
use embedded_graphics::pixelcolor::raw::{LittleEndian, RawU16};
use embedded_graphics::prelude::*;
use relume::atlas::Atlas;
use relume::color::Rgb;
use relume::tone::Exposure;
use relume_host::pack::relight_atlas;
use relume_panel::{
    EVENING, EXPOSURE, LIGHTS, Memory, PICTURE, Panel, ROOMS, SCREEN, Touch, slider,
};

type Screen =
    Framebuffer<Rgb565, RawU16, LittleEndian, 320, 240, { buffer_size::<Rgb565>(320, 240) }>;

fn atlas_bytes() -> &'static [u8] {
    static ATLAS: OnceLock<Vec<u8>> = OnceLock::new();
    ATLAS.get_or_init(|| atlas::atlas().expect("the flat bakes"))
}

fn screen(panel: &Panel) -> Screen {
    let mut screen = Screen::new();
    let Ok(()) = panel.draw(&mut screen);
    screen
}

fn shot(panel: &Panel) -> Vec<Rgb565> {
    let screen = screen(panel);
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
    let atlas = Atlas::parse(atlas_bytes()).expect("it was just packed");
    let mut memory = Box::new(Memory::new());
    let mut panel = Panel::new(atlas, &mut memory).expect("this is the flat");
    let dark = shot(&panel);
    assert_picture(&atlas, &panel, [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);

    let fixtures: Vec<_> = ROOMS.iter().flat_map(|room| room.lamps).collect();
    for (number, fixture) in fixtures.iter().enumerate() {
        // A tap where the lamp is seen turns it on, and it is white there, or at least as bright as its tint.
        panel.touch(Touch::Tap(fixture.at));
        settle(&mut panel);
        assert!(panel.lamps()[number].is_on(), "{}", fixture.name);
        let mut shares = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
        shares[number] = 1.0;
        assert_picture(&atlas, &panel, shares);
        let lamp = at(&shot(&panel), fixture.at);
        assert!(lamp.r().max(lamp.b()) == 31, "{}: {lamp:?}", fixture.name);

        // A drag dims it, to the square of the level; a tap on the slider turns it off, and nothing of it is left.
        let slider = slider(number);
        panel.touch(Touch::Drag(slider.center()));
        settle(&mut panel);
        let level = f32::from(panel.lamps()[number].shown()) / 100.0;
        assert!((0.48..0.52).contains(&level), "{level}");
        shares[number] = level * level;
        assert_picture(&atlas, &panel, shares);
        panel.touch(Touch::Tap(slider.top_left));
        settle(&mut panel);
        assert_eq!(shot(&panel), dark, "{}", fixture.name);
    }

    // Between the controls nothing happens.
    panel.touch(Touch::Tap(SCREEN.top_left));
    panel.touch(Touch::Drag(PICTURE.center()));
    assert_eq!(panel.tick(), Ok(false));
}

#[test]
fn other_atlases_are_refused() {
    let bytes = include_bytes!("fuzz/seeds/atlas/lum8.atlas");
    let mut memory = Box::new(Memory::new());
    let atlas = Atlas::parse(bytes).expect("a seed of the fuzzer");
    assert!(Panel::new(atlas, &mut memory).is_err());
}

/// FNV-1a, 32 bits.
fn hash(bytes: &[u8]) -> u32 {
    let step = |hash: u32, byte: &u8| (hash ^ u32::from(*byte)).wrapping_mul(0x0100_0193);
    bytes.iter().fold(0x811c_9dc5, step)
}

#[test]
fn a_cortex_m4f_shows_the_same() {
    let mut memory = Box::new(Memory::new());
    let atlas = Atlas::parse(atlas_bytes()).expect("it was just packed");
    let mut panel = Panel::new(atlas, &mut memory).expect("this is the flat");
    let mut expected = vec![hash(screen(&panel).data())];
    for touch in EVENING {
        panel.touch(touch);
        settle(&mut panel);
        expected.push(hash(screen(&panel).data()));
    }

    let target = "thumbv7em-none-eabihf";
    let script = |text: &str| {
        let mut script = Command::new("bash");
        let root = env!("CARGO_MANIFEST_DIR");
        script.current_dir(root).args(["-c", text]);
        script.output().expect("bash")
    };
    let check =
        "command -v qemu-system-arm && source .ci/bare-metal.sh thumbv7em-none-eabihf --check";
    if !script(check).status.success() {
        let told = "the panel was not run on a Cortex-M4F; install what it takes: bash .ci/bare-metal.sh all";
        return skip::skip(told);
    }
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("panel");
    fs::create_dir_all(&folder).expect("cargo's own folder");
    fs::write(folder.join("panel.atlas"), atlas_bytes()).expect("a folder that was just made");
    let found = script(&format!(
        "source .ci/bare-metal.sh {target} && cd tests/firmware && \
         FIRMWARE_DATA={folder} CARGO_TARGET_DIR={folder}/target timeout 300 \
         cargo run --quiet --release --locked --features panel --bin panel --target {target}",
        folder = folder.display()
    ));
    let said = String::from_utf8_lossy(&found.stdout) + String::from_utf8_lossy(&found.stderr);
    assert!(found.status.success(), "{said}");
    println!("{said}");
    let shown = said.lines().filter_map(|line| line.strip_prefix("hash 0x"));
    let shown: Vec<u32> = shown
        .map(|hash| u32::from_str_radix(hash, 16).expect("a number"))
        .collect();
    assert_eq!(shown, expected);
}
