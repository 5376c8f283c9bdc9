//! Builds the bare-metal images of `tests/firmware`, and starts them in an emulator.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::Mutex;
use std::{env, fs};

use serde_json::{Value, json};

use crate::skip::skip;

/// Cortex-M0, M3 and M4F.
pub const TARGETS: [&str; 3] = [
    "thumbv6m-none-eabi",
    "thumbv7m-none-eabi",
    "thumbv7em-none-eabihf",
];

/// The one without hardware for floats.
pub const SMALL: &str = TARGETS[0];

pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

pub fn work() -> PathBuf {
    root().join("target/firmware")
}

/// Whether all tools are there; else says what to install, and fails on a build server.
pub fn has_tools() -> bool {
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
    skip(&told);
    false
}

/// Builds images for a target, up to a failure.
pub fn build(target: &str, images: &[&str], options: &str) -> Output {
    let built = images.chunk_by(|a, b| profile(target, a) == profile(target, b));
    let commands: Vec<String> = built
        .map(|images| {
            let (profile, bins) = (profile(target, images[0]), images.join(" --bin "));
            format!(
                "cargo build --profile {profile} --locked --target {target} --bin {bins} {options}"
            )
        })
        .collect();
    let script = format!(
        "source .ci/bare-metal.sh {target} && cd tests/firmware && {}",
        commands.join(" && ")
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

/// What an image is compiled for: the small core has little flash, least where all of the atlas is to fit.
fn profile(target: &str, image: &str) -> &'static str {
    match (target, image) {
        (SMALL, "change_lum_960") => "smallest",
        (SMALL, _) => "small",
        _ => "release",
    }
}

pub fn image(target: &str, name: &str) -> PathBuf {
    work()
        .join("target")
        .join(target)
        .join(profile(target, name))
        .join(name)
}

/// Starts an image in the emulator of its target: exit status and what it said.
pub fn emulate(target: &str, name: &str) -> (Option<i32>, String) {
    let config = fs::read_to_string(root().join("tests/firmware/.cargo/config.toml"));
    let config = config.expect("it is checked in");
    let (_, own) = config
        .split_once(&format!("[target.{target}]"))
        .expect("a runner");
    let (_, runner) = own.split_once("runner = \"").expect("a runner");
    let (runner, _) = runner.split_once('"').expect("in quotes");
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
pub fn said(text: &str, name: &str) -> Option<u32> {
    let line = text
        .lines()
        .find_map(|line| line.strip_prefix(&format!("{name} 0x")));
    u32::from_str_radix(line?.trim(), 16).ok()
}

/// Bytes of flash and of static RAM.
pub fn size(image: &Path) -> [u64; 2] {
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

/// Modelled time of so many instructions, ms, and the words of the model: one instruction per cycle, memory that never waits.
pub fn modelled(target: &str, instructions: u64) -> [(&'static str, Value); 3] {
    let clock = if target.ends_with(SMALL) { 16 } else { 168 };
    [
        ("ms", json!(instructions as f64 / f64::from(1000 * clock))),
        ("clock_mhz", json!(clock)),
        ("model", json!("one instruction per cycle, no wait states")),
    ]
}

/// Leaves rows for `tests/firmware/run --json`, one a line, in a file of this name, and holds them against their budgets.
pub fn write_rows(name: &str, rows: &[Value]) {
    let folder = work().join("rows");
    fs::create_dir_all(&folder).expect("a folder that can be written to");
    let lines: String = rows.iter().map(|row| format!("{row}\n")).collect();
    fs::write(folder.join(name), lines).expect("a folder that can be written to");
    check_budgets(rows);
}

/// What may be used is what was used when the budgets were written, and 1 %.
fn check_budgets(rows: &[Value]) {
    static FILE: Mutex<()> = Mutex::new(());
    let path = root().join("tests/firmware/budgets.json");
    let keys = ["per_frame", "per_frame_warm", "flash", "ram"];
    let counted = rows.iter().filter(|row| !row["flash"].is_null());
    let key = |row: &Value| {
        let name = match &row["image"] {
            Value::Null => format!("{} {}x{}", row["kernel"], row["n"], row["k"]),
            image => image.to_string(),
        };
        format!("{} {name}", row["target"]).replace('"', "")
    };
    let _alone = FILE.lock();
    let budgets = fs::read_to_string(&path).expect("they are checked in");
    let mut budgets: Value = serde_json::from_str(&budgets).expect("plain JSON");
    if env::var_os("RELUME_WRITE_BUDGETS").is_some() {
        for row in counted {
            budgets[key(row)] = json!(keys.map(|key| row[key].clone()));
        }
        return fs::write(path, format!("{budgets:#}\n")).expect("our own tree");
    }
    let mut exceeded = Vec::new();
    for row in counted {
        for (place, name) in keys.iter().enumerate() {
            let used = row[*name].as_f64().expect("a number");
            let budget = budgets[key(row)][place].as_f64().unwrap_or(0.0);
            if used > 1.01 * budget {
                exceeded.push(format!("{} {name}: {used}, budget {budget}", key(row)));
            }
        }
    }
    assert!(exceeded.is_empty(), "{}", exceeded.join("\n"));
}
