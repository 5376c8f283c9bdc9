//! What `relume export` writes, in a program of a user.

use std::fs;
use std::path::Path;
use std::process::Command;

use relume::atlas::Atlas;
use relume::relight::{Finish, FrameLight, FrameMix, Lum, Sums};
use relume::tone::Rgb565Table;
use relume_host::export::frame::FrameConstants;

use super::with_room;

/// It prints the pixels of all lights at their full weights.
const PROGRAM: &str = "mod room;
use relume::relight::{Finish, Form, FrameLight, Lum, Sums};
use relume::tone::Rgb565Table;
static TONE: Rgb565Table = Rgb565Table::new(room::WHITE);
const LIGHTS: usize = room::FULL.len();

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let atlas = Lum::parse(&room::ATLAS)?;
    let mut lights = [FrameLight::EMPTY; LIGHTS];
    let mut mix = Lum::mix(&atlas, &room::FULL, &mut lights)?;
    let finish = Finish::new(&atlas, &mix, &room::RUNS, room::EXPOSURE, &TONE)?;
    for light in 0..LIGHTS {
        mix.set(light as u32, [u16::MAX; 3]);
    }
    let elements = atlas.element_count() as usize;
    let (mut sums, mut table, mut pixels) = (vec![0; elements], [0; 256], vec![0; elements]);
    let frame = Sums::<Lum, LIGHTS>::new(&atlas, &mix, &mut sums, &mut table)?;
    frame.show(&finish, &mut pixels)?;
    println!(\"{pixels:?}\");
    Ok(())
}
";

#[test]
fn a_program_with_an_exported_module_shows_the_atlas() {
    let folder = with_room();
    folder.done("pack room.solution --code lum8 -o room.atlas");
    folder.done("export room.atlas --rust --no-mesh -o src");
    folder.done("export room.atlas --bin --no-mesh -o short");
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    folder.write("src/main.rs", PROGRAM);
    folder.write(
        "Cargo.toml",
        format!(
            "[package]\nname = \"user\"\nedition = \"2024\"\n\n[workspace]\n\n\
             [dependencies]\nrelume = {{ path = {:?} }}\n",
            root.join("solver")
        ),
    );
    fs::copy(root.join("Cargo.lock"), folder.path().join("Cargo.lock")).expect("a lock file");
    let mut run = Command::new(env!("CARGO"));
    run.current_dir(folder.path())
        .env(
            "CARGO_TARGET_DIR",
            Path::new(env!("CARGO_TARGET_TMPDIR")).join("export"),
        )
        .env("RUSTFLAGS", "-D warnings")
        .args(["run", "--quiet", "--offline"]);
    let output = run.output().expect("cargo starts");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    let found: Vec<u16> = serde_json::from_slice(&output.stdout).expect("pixels");

    let (whole, short) = (folder.read("room.atlas"), folder.read("short/room.atlas"));
    let (atlas, short) = (Atlas::parse(&whole).unwrap(), Atlas::parse(&short).unwrap());
    assert!(atlas.mesh().is_some() && short.mesh().is_none());
    assert_eq!(atlas.codes(), short.codes());
    let frame = FrameConstants::new(&atlas).unwrap().expect("it has a mesh");
    let mut lights = [FrameLight::EMPTY; 2];
    let mut mix = FrameMix::new(&atlas, &frame.full, &mut lights).unwrap();
    let tone = Rgb565Table::new(frame.white);
    let finish = Finish::new(&atlas, &mix, &frame.runs, frame.exposure, &tone).unwrap();
    for light in 0..2 {
        mix.set(light, [u16::MAX; 3]);
    }
    let (mut sums, mut table, mut pixels) = (vec![0; found.len()], [0; 256], vec![0; found.len()]);
    let sums = Sums::<Lum, 2>::new(&atlas, &mix, &mut sums, &mut table).unwrap();
    sums.show(&finish, &mut pixels).unwrap();
    assert_eq!(found, pixels);
    // Two in a hundred elements are brighter than white; those near it are, too, as 5 and 6 bits tell them apart.
    let white = pixels.iter().filter(|pixel| **pixel == u16::MAX).count();
    assert!((1..=pixels.len() / 10).contains(&white), "{white}");
}
