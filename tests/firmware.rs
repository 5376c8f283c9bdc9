//! The solver on microcontrollers, in an emulator: the same pixels as here, in so many instructions.

mod emulator;
mod inputs;
mod skip;

use std::collections::BTreeSet;
use std::process::Command;
use std::{fs, iter};

use emulator::{
    SMALL, TARGETS, build, emulate, has_tools, image, modelled, said, size, work, write_rows,
};
use inputs::device_drawn::{self, Screen, draw};
use inputs::device_room::{DirectMemory, MOVING_POLYGONS, Memory, POLYGONS, Polygon, bake, direct};
use inputs::{Input, drawn_atlas, hash, inputs, moving_polygons, room_polygons, write_if_new};
use relume::atlas::Atlas;
use relume_host::device_cost::{Core, DeviceCost};
use serde_json::{Value, json};

/// The images of `tests/firmware`: the binary, its kernel, its input.
const IMAGES: [(&str, &str, &str); 7] = [
    ("full_lum_960", "full_lum_565", "lum_960x8"),
    ("full_lum_1920", "full_lum_565", "lum_1920x30"),
    ("batches_lum_1920", "full_lum_565", "lum_1920x30"),
    ("full_rgb_960", "full_rgb_565", "rgb_960x8"),
    ("change_lum_960", "change_lum_565", "lum_960x8"),
    ("change_rgb_960", "change_rgb_565", "rgb_960x8"),
    ("full_tiles_960", "full_tiles_565", "tiles_960x8"),
];

/// The light that the `change` images change.
const CHANGED: usize = 1;

/// The triple of this machine.
fn host() -> String {
    let output = Command::new("rustc")
        .arg("-vV")
        .output()
        .expect("a compiler");
    let text = String::from_utf8(output.stdout).expect("plain text");
    let host = text.lines().find_map(|line| line.strip_prefix("host: "));
    host.expect("it says").to_owned()
}

/// The images of a target: the micro:bit has no room for tiles or for all tables, the others need no batches.
fn images(target: &str) -> Vec<(&'static str, &'static str, &'static str)> {
    let others: &[&str] = if target == SMALL {
        &["full_lum_1920", "full_tiles_960"]
    } else {
        &["batches_lum_1920"]
    };
    let images = IMAGES.into_iter();
    images.filter(|image| !others.contains(&image.0)).collect()
}

/// The row of one image on one target.
fn row(target: &str, (name, kernel, _): (&str, &str, &str), input: &Input) -> Value {
    let (status, text) = emulate(target, name);
    assert_eq!(status, Some(0), "{target} {name}: {text}");
    let number = |name| said(&text, name).unwrap_or_else(|| panic!("{target} {name}: {text}"));
    let (n, k) = (
        input.in_floats(&input.levels[0]).len() as u32,
        input.full.len() as u32,
    );
    let (per_frame, warm) = (number("per_frame"), number("per_frame_warm"));
    let is_change = kernel.starts_with("change");
    let share = if is_change { n } else { n * k };
    let [flash, statics] = size(&image(target, name));
    let stack = number("stack");
    let mut row = json!({
        "target": target,
        "kernel": kernel,
        "image": name,
        "n": n,
        "k": k,
        "per_element_light": f64::from(warm) / f64::from(share),
        "per_frame": per_frame,
        "per_frame_warm": warm,
        "flash": flash,
        "ram": statics + u64::from(stack),
        "stack": stack,
        "hash": format!("{:08x}", number("hash")),
    });
    for (key, value) in modelled(target, per_frame.into()) {
        row[key] = value;
    }
    row
}

/// Pixels that differ from the `f32` ones by so many steps of RGB565.
fn steps_apart(found: &[u16], expected: &[u16]) -> u16 {
    let channels = |p: u16| [p >> 11, p >> 5 & 63, p & 31];
    let pairs = found.iter().zip(expected);
    let apart = pairs.flat_map(|(a, b)| {
        let pairs = channels(*a).into_iter().zip(channels(*b));
        pairs.map(|(a, b)| a.abs_diff(b))
    });
    apart.max().unwrap_or(0)
}

/// The mix that an image shows at its end.
fn shown_mix(kernel: &str, input: &Input) -> Vec<[u16; 3]> {
    let [first, second] = &input.levels;
    if !kernel.starts_with("change") {
        return second.clone();
    }
    let mut mix = first.clone();
    mix[CHANGED] = second[CHANGED];
    mix
}

#[test]
fn every_frame_is_within_a_step_of_the_float_one() {
    for input in inputs() {
        for levels in &input.levels {
            let apart = steps_apart(&input.in_integers(levels), &input.in_floats(levels));
            assert!(apart <= 1, "{}: {apart} steps", input.name);
        }
    }
}

#[test]
fn the_m4f_bakes_the_papers_room() {
    if !has_tools() {
        return;
    }
    let data = work().join("data");
    fs::create_dir_all(&data).expect("a folder that can be written to");
    let polygons = room_polygons();
    write_if_new(&data.join("room.rs"), format!("{polygons:?}").as_bytes());
    let polygons: [Polygon; POLYGONS] = polygons.try_into().expect("as many");
    let mut flash = vec![0; 9_000];
    let here = bake(&polygons, &mut Box::new(Memory::new()), &mut flash).expect("it fits");

    let built = build(TARGETS[2], &["bake"], "");
    let told = String::from_utf8_lossy(&built.stderr);
    assert!(built.status.success(), "{told}");
    let (status, text) = emulate(TARGETS[2], "bake");
    assert_eq!(status, Some(0), "{text}");
    eprintln!("{text}");
    assert_eq!(said(&text, "rows"), Some(here.rows));
    assert_eq!(said(&text, "contributions"), Some(here.contributions));
    let atlas = flash[..here.length].iter();
    let atlas = atlas.fold(0x811c_9dc5_u32, |hash, byte| {
        (hash ^ u32::from(*byte)).wrapping_mul(0x0100_0193)
    });
    assert_eq!(said(&text, "atlas"), Some(atlas));
    let [flash_bytes, statics] = size(&image(TARGETS[2], "bake"));
    let ram = statics + u64::from(said(&text, "stack").expect("it says"));
    eprintln!("RAM: {ram}");
    assert!(ram <= 192 << 10, "{ram} bytes of RAM");
    let number = |name| said(&text, name).expect("it says");
    let instructions = 1000 * u64::from(number("thousands"));
    let mut row = json!({
        "target": TARGETS[2], "kernel": "bake", "image": "bake", "n": 960, "k": 3,
        "rows": here.rows, "per_element_light": instructions as f64 / (960.0 * 3.0),
        "per_frame": instructions, "per_frame_warm": instructions,
        "flash": flash_bytes, "ram": ram, "stack": number("stack"),
        "hash": format!("{:08x}", number("contributions")),
    });
    for (key, value) in modelled(TARGETS[2], instructions) {
        row[key] = value;
    }
    write_rows("bake", &[row]);
}

#[test]
fn the_m4f_adds_direct_light_with_shadows_to_a_frame() {
    if !has_tools() {
        return;
    }
    let data = work().join("data");
    fs::create_dir_all(&data).expect("a folder that can be written to");
    let polygons = moving_polygons();
    write_if_new(&data.join("moving.rs"), format!("{polygons:?}").as_bytes());
    let polygons: [Polygon; MOVING_POLYGONS] = polygons.try_into().expect("as many");
    let uncounted = |row: &mut dyn FnMut()| {
        row();
        0
    };
    let here = direct(&polygons, &mut Box::new(DirectMemory::new()), uncounted);
    let here = here.expect("it fits");

    let built = build(TARGETS[2], &["direct"], "");
    let told = String::from_utf8_lossy(&built.stderr);
    assert!(built.status.success(), "{told}");
    let (status, text) = emulate(TARGETS[2], "direct");
    assert_eq!(status, Some(0), "{text}");
    let number = |name| said(&text, name).expect("it says");
    assert_eq!((number("hash"), number("lit")), (here.hash, here.lit));
    let instructions = 1000 * u64::from(number("thousands"));
    let [flash, statics] = size(&image(TARGETS[2], "direct"));
    let mut row = json!({
        "target": TARGETS[2], "kernel": "direct", "image": "direct", "n": 1920, "k": 1,
        "lit": here.lit, "per_element_light": instructions as f64 / 1920.0,
        "per_frame": instructions, "per_frame_warm": instructions,
        "flash": flash, "ram": statics + u64::from(number("stack")), "stack": number("stack"),
        "hash": format!("{:08x}", here.hash),
    });
    for (key, value) in modelled(TARGETS[2], instructions) {
        row[key] = value;
    }
    eprintln!("{row}");
    write_rows("direct", &[row]);
}

#[test]
fn the_larger_cores_draw_what_the_host_draws() {
    if !has_tools() {
        return;
    }
    let data = work().join("data");
    fs::create_dir_all(&data).expect("a folder that can be written to");
    let atlas = drawn_atlas();
    write_if_new(&data.join("drawn.atlas"), &atlas);
    let mut screen = Screen::new();
    draw(
        &atlas,
        &mut Box::new(device_drawn::Memory::new()),
        &mut screen,
    )
    .expect("its own room");
    let pixels = screen.data().as_chunks().0.iter();
    let pixels: Vec<u16> = pixels.map(|pixel| u16::from_le_bytes(*pixel)).collect();
    let shades: BTreeSet<u16> = pixels.iter().copied().collect();
    assert!(shades.len() > 100, "{} shades", shades.len());

    let mut rows = Vec::new();
    for target in TARGETS.into_iter().filter(|target| *target != SMALL) {
        let built = build(target, &["draw"], "--features draw");
        let told = String::from_utf8_lossy(&built.stderr);
        assert!(built.status.success(), "{told}");
        let (status, text) = emulate(target, "draw");
        assert_eq!(status, Some(0), "{text}");
        let number = |name| said(&text, name).expect("it says");
        assert_eq!(number("hash"), hash(&pixels), "{target}");
        let [flash, statics] = size(&image(target, "draw"));
        let mut row = json!({
            "target": target, "kernel": "draw", "image": "draw", "n": 960, "k": 3,
            "per_frame": number("per_frame"), "per_frame_warm": number("per_frame"),
            "flash": flash, "ram": statics + u64::from(number("stack")), "stack": number("stack"),
            "hash": format!("{:08x}", number("hash")),
        });
        for (key, value) in modelled(target, number("per_frame").into()) {
            row[key] = value;
        }
        eprintln!("{row}");
        rows.push(row);
    }
    write_rows("draw", &rows);
}

#[test]
fn images_give_the_pixels_of_the_host_within_their_budgets() {
    if !has_tools() {
        return;
    }
    let inputs = inputs();
    let data = work().join("data");
    fs::create_dir_all(&data).expect("a folder that can be written to");
    for input in &inputs {
        input.write(&data);
    }
    let host = host();
    let mut rows = Vec::new();
    for (_, kernel, name) in IMAGES {
        let input = inputs
            .iter()
            .find(|input| input.name == name)
            .expect("an input");
        let pixels = input.in_integers(&shown_mix(kernel, input));
        rows.push(json!({
            "target": host, "kernel": kernel, "n": pixels.len(), "k": input.full.len(),
            "hash": format!("{:08x}", hash(&pixels)),
        }));
    }
    for target in TARGETS {
        let images = images(target);
        let names: Vec<&str> = images.iter().map(|image| image.0).collect();
        let built = build(target, &names, "");
        let told = String::from_utf8_lossy(&built.stderr);
        assert!(built.status.success(), "{target}: {told}");
        for image in images {
            let input = inputs.iter().find(|input| input.name == image.2);
            rows.push(row(target, image, input.expect("an input")));
        }
    }
    write_rows("images", &rows);
    let shape = |row: &Value| ["kernel", "n", "k"].map(|key| row[key].to_string());
    for row in &rows {
        for other in rows.iter().filter(|other| shape(other) == shape(row)) {
            assert_eq!(row["hash"], other["hash"], "{row} {other}");
        }
    }
    check_predictions(&rows, &inputs);
    no_float_on_the_small_core();
    one_index_does_not_link();
}

/// What `relume info` predicts of frames is within 10 % of what was counted.
fn check_predictions(rows: &[Value], inputs: &[Input]) {
    let cores = iter::zip(TARGETS, Core::ALL);
    for row in rows {
        let core = cores.clone().find(|(target, _)| row["target"] == *target);
        let image = IMAGES.iter().find(|image| row["image"] == image.0);
        let (Some((_, core)), Some((image, kernel, name))) = (core, image) else {
            continue;
        };
        let input = inputs.iter().find(|input| input.name == *name);
        let bytes = &input.expect("an input").atlas;
        let atlas = Atlas::parse(bytes).expect("an atlas");
        let cost = DeviceCost::new(&atlas, bytes.len(), core);
        // Flash and RAM are those of an image that can do both.
        let predicted = if kernel.starts_with("change") {
            vec![(cost.change, "per_frame")]
        } else {
            vec![
                (cost.flash, "flash"),
                (cost.ram, "ram"),
                (cost.frame, "per_frame"),
                (cost.warm, "per_frame_warm"),
            ]
        };
        for (predicted, key) in predicted {
            let counted = row[key].as_f64().expect("a number");
            let off = (predicted as f64 / counted - 1.0).abs();
            assert!(
                off <= 0.1,
                "{image}, {core:?}, {key}: {predicted} for {counted}"
            );
        }
    }
}

/// Names of soft-float routines: `__aeabi_fadd`, `__mulsf3`, `__floatsidf` and so on.
fn is_soft_float(symbol: &str) -> bool {
    let aeabi = symbol.strip_prefix("__aeabi_").unwrap_or("");
    let starts = [
        "fadd", "fsub", "frsub", "fmul", "fdiv", "fcmp", "f2", "i2f", "ui2f", "l2f", "ul2f",
        "dadd", "dsub", "dmul", "ddiv", "dcmp", "d2", "i2d", "ui2d", "l2d", "ul2d",
    ];
    let is_gnu = symbol.starts_with("__") && (symbol.contains("sf") || symbol.contains("df"));
    is_gnu || starts.iter().any(|start| aeabi.starts_with(start))
}

fn no_float_on_the_small_core() {
    assert!(is_soft_float("__aeabi_fmul") && is_soft_float("__mulsf3"));
    for (name, ..) in images(SMALL) {
        let image = image(SMALL, name);
        let output = Command::new("arm-none-eabi-nm").arg(image).output();
        let text = String::from_utf8(output.expect("binutils").stdout).expect("plain text");
        let symbols = text.lines().filter_map(|line| line.split(' ').next_back());
        assert!(symbols.clone().count() > 10, "{name} has symbols");
        let floats: Vec<&str> = symbols.filter(|symbol| is_soft_float(symbol)).collect();
        assert!(floats.is_empty(), "{name}: {floats:?}");
    }
}

/// The panic handler calls what does not exist: images link because they cannot panic.
fn one_index_does_not_link() {
    let output = build(SMALL, &["change_lum_960"], "--features one-index");
    let told = String::from_utf8_lossy(&output.stderr);
    let links = output.status.success();
    assert!(!links, "an index that may be out of range links");
    assert!(told.contains("a_panic_path_is_left"), "{told}");
}
