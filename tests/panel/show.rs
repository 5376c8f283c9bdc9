//! The panel on the host: `cargo run --release --example panel -- -o out` bakes the flat, and makes `out/panel.atlas`, a
//! picture of the screen, `out/panel.png`, and an animated one of an evening's touches, `out/panel-evening.png`.

mod atlas;
mod film;

use std::fs;
use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use embedded_graphics::framebuffer::{Framebuffer, buffer_size};
use embedded_graphics::image::GetPixel;
use embedded_graphics::pixelcolor::raw::{LittleEndian, RawU16};
use embedded_graphics::pixelcolor::{Rgb565, Rgb888};
use embedded_graphics::prelude::*;
use relume::atlas::Atlas;
use relume_panel::{EVENING, Memory, Panel, SCREEN};

use film::Film;

/// The framebuffer of the display.
type Screen =
    Framebuffer<Rgb565, RawU16, LittleEndian, 320, 240, { buffer_size::<Rgb565>(320, 240) }>;

/// Hundredths of a second that a frame of a fade is seen, and its end.
const FADING: u16 = 8;
const RESTING: u16 = 90;

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let folder = match &arguments[..] {
        [] => PathBuf::from("out"),
        [flag, folder] if flag == "-o" => PathBuf::from(folder),
        _ => bail!("usage: panel [-o FOLDER]"),
    };
    fs::create_dir_all(&folder).with_context(|| folder.display().to_string())?;
    let bytes = atlas::atlas()?;
    fs::write(folder.join("panel.atlas"), &bytes)?;

    let mut memory = Box::new(Memory::new());
    let mut panel = Panel::new(Atlas::parse(&bytes)?, &mut memory)?;
    let mut evening = Film::new(SCREEN.size);
    evening.add(shot(&panel), RESTING);
    for touch in EVENING {
        panel.touch(touch);
        while panel.tick()? {
            evening.add(shot(&panel), FADING);
        }
        evening.rest(RESTING);
    }
    let mut still = Film::new(SCREEN.size);
    still.add(shot(&panel), RESTING);
    fs::write(folder.join("panel.png"), still.png()?)?;
    let film = evening.png()?;
    fs::write(folder.join("panel-evening.png"), &film)?;
    eprintln!(
        "{}: the atlas has {} bytes, the film {}",
        folder.display(),
        bytes.len(),
        film.len()
    );
    Ok(())
}

/// The screen as it is now.
fn shot(panel: &Panel) -> Vec<[u8; 3]> {
    let mut screen = Screen::new();
    let Ok(()) = panel.draw(&mut screen);
    let rgb = |at| {
        let color = Rgb888::from(screen.pixel(at).unwrap_or_default());
        [color.r(), color.g(), color.b()]
    };
    SCREEN.points().map(rgb).collect()
}
