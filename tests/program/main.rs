//! The program from outside: what it writes, what it says, and how it ends.

#[path = "../command/mod.rs"]
mod command;
#[path = "../room/mod.rs"]
mod room;

mod export;
mod files;
#[cfg(unix)]
mod interruption;
mod odd_scenes;
mod pictures;
mod probes;
mod refusals;

use std::collections::BTreeSet;

use command::Folder;
use image::RgbaImage;
use relume_host::solution::{self, Solution};
use room::POINTS;

/// A mesh of about 1000 elements, baked in the blink of an eye.
const MESH: &str = "--patch 0.5 --element 0.25";

/// A view into the room, from within.
const VIEW: &str = "--eye 2,1.2,2.9 --target 2,1,0 --fov 1 --size 80x60";

/// The same as a camera file.
const CAMERA: &str = "eye = [2, 1.2, 2.9]\ntarget = [2, 1, 0]\nfov = 1\n";

/// A folder with the room and its points.
fn with_scene() -> Folder {
    let folder = Folder::new();
    folder.write("room.obj", room::obj(false));
    folder.write("room.mtl", room::mtl());
    folder.write("points.csv", POINTS);
    folder
}

/// The same, baked and packed in a code whose every value is easy to foretell.
fn with_room() -> Folder {
    let folder = with_scene();
    folder.done(&format!("bake room.obj {MESH}"));
    folder.done("pack room.solution --code exp8s");
    folder
}

fn read_solution(folder: &Folder, name: &str) -> Solution {
    solution::read(&folder.read(name)).expect(name)
}

fn png(bytes: &[u8]) -> RgbaImage {
    let picture = image::load_from_memory_with_format(bytes, image::ImageFormat::Png);
    picture.expect("a PNG").into_rgba8()
}

/// Number of different colours in a picture.
fn colours(picture: &RgbaImage) -> usize {
    let colours: BTreeSet<_> = picture.pixels().map(|pixel| pixel.0).collect();
    colours.len()
}
