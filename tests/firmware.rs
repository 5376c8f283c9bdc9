//! The solver on microcontrollers, in an emulator: the same pixels as here, in so many instructions.

mod bake;
mod inputs;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::{env, fs};

use inputs::{Input, hash, inputs, write_if_new};
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

/// Cortex-M0, M3 and M4F.
const TARGETS: [&str; 3] = [
    "thumbv6m-none-eabi",
    "thumbv7m-none-eabi",
    "thumbv7em-none-eabihf",
];

/// The light that the `change` images change.
const CHANGED: usize = 1;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn work() -> PathBuf {
    root().join("target/firmware")
}

/// Whether all tools are there; else says what to install, and fails on a build server.
fn has_tools() -> bool {
    let works = |program: &str| Command::new(program).arg("--version").output().is_ok();
    let missing: Vec<&str> = ["qemu-system-arm", "arm-none-eabi-size", "arm-none-eabi-nm"]
        .into_iter()
        .filter(|program| !works(program))
        .collect();
    let script = Command::new("bash")
        .args(["-c", "source .ci/bare-metal.sh thumbv6m-none-eabi --check"])
        .current_dir(root())
        .status();
    if missing.is_empty() && script.is_ok_and(|status| status.success()) {
        return true;
    }
    let told = format!(
        "no firmware was built or run; missing: {missing:?} or a compiler for it. Install all with: bash .ci/bare-metal.sh all"
    );
    assert!(env::var_os("CI").is_none(), "{told}");
    eprintln!("\nSKIPPED: {told}\n");
    false
}

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

/// The images of a target: the micro:bit has no room for all tables, the others no need of batches.
fn images(target: &str) -> Vec<(&'static str, &'static str, &'static str)> {
    let other = if target.starts_with("thumbv6m") {
        "full_lum_1920"
    } else {
        "batches_lum_1920"
    };
    IMAGES
        .into_iter()
        .filter(|image| image.0 != other)
        .collect()
}

/// Runs a command of cargo in `tests/firmware` for a target.
fn cargo(target: &str, arguments: &str) -> Output {
    let script = format!(
        "source .ci/bare-metal.sh {target} && cd tests/firmware && cargo {arguments} --release --locked --target {target}"
    );
    Command::new("bash")
        .args(["-c", &script])
        .current_dir(root())
        .env("CARGO_TARGET_DIR", work().join("target"))
        .env("FIRMWARE_DATA", work().join("data"))
        // Those of the cargo that runs this test.
        .env_remove("CARGO")
        .env_remove("RUSTC")
        .env_remove("RUSTFLAGS")
        .output()
        .expect("bash")
}

fn image(target: &str, name: &str) -> PathBuf {
    work()
        .join("target")
        .join(target)
        .join("release")
        .join(name)
}

/// Starts an image in the emulator of its target: exit status and what it said.
fn emulate(target: &str, name: &str) -> (Option<i32>, String) {
    let config = fs::read_to_string(root().join("tests/firmware/.cargo/config.toml"));
    let config = config.expect("it is checked in");
    let (_, own) = config
        .split_once(&format!("[target.{target}]"))
        .expect("a runner");
    let runner = own.split('"').nth(1).expect("in quotes");
    let output = Command::new("timeout")
        .arg("120")
        .args(runner.split(' '))
        .arg(image(target, name))
        .output()
        .expect("the emulator");
    let said = String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);
    (output.status.code(), said.into_owned())
}

/// A number that an image said.
fn said(text: &str, name: &str) -> Option<u32> {
    let line = text
        .lines()
        .find_map(|line| line.strip_prefix(&format!("{name} 0x")));
    u32::from_str_radix(line?.trim(), 16).ok()
}

/// Bytes of flash and of static RAM.
fn size(image: &Path) -> [u64; 2] {
    let output = Command::new("arm-none-eabi-size")
        .args(["-A"])
        .arg(image)
        .output();
    let text = String::from_utf8(output.expect("binutils").stdout).expect("plain text");
    let of = |section: &str| {
        let line = text
            .lines()
            .find(|line| line.split_whitespace().next() == Some(section));
        let bytes = line.and_then(|line| line.split_whitespace().nth(1)?.parse().ok());
        bytes.unwrap_or(0_u64)
    };
    let flash = of(".vector_table") + of(".text") + of(".rodata") + of(".data");
    [flash, of(".data") + of(".bss") + of(".uninit")]
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
    json!({
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
    })
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
        let names: Vec<String> = images
            .iter()
            .map(|image| format!("--bin {}", image.0))
            .collect();
        let built = cargo(target, &format!("build {}", names.join(" ")));
        let told = String::from_utf8_lossy(&built.stderr);
        assert!(built.status.success(), "{target}: {told}");
        for image in images {
            let input = inputs.iter().find(|input| input.name == image.2);
            rows.push(row(target, image, input.expect("an input")));
        }
    }
    write_if_new(
        &work().join("rows.json"),
        format!("{:#}\n", json!({"rows": rows})).as_bytes(),
    );
    for row in &rows {
        let same = rows.iter().filter(|other| {
            ["kernel", "n", "k"]
                .iter()
                .all(|key| other[key] == row[key])
        });
        for other in same {
            assert_eq!(row["hash"], other["hash"], "{row} {other}");
        }
    }
}
