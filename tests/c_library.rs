//! The C library as a C programmer meets it: the header fits the source, and one program relights with the bits of the
//! Rust kernels on the desktop, on a Cortex-M4F, on a Cortex-M0 and, in JavaScript, in WebAssembly.
//!
//! Whatever is not installed is a failure in CI (variable `CI`); elsewhere a test says what it did not run.

#[expect(dead_code, reason = "the bare-metal images use the rest")]
mod emulator;
#[expect(dead_code, reason = "the bare-metal images use the rest")]
mod inputs;
mod skip;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use emulator::{modelled, write_rows};
use inputs::{Input, hash, inputs};
use relume::atlas::Atlas;
use relume::relight::{
    AnyTable, Colour, Finish, FixedMix, FixedWeight, Form, FrameLight, FrameMix, Lum, add_lights,
    full_any, relight_fixed, show_sums, table_length,
};
use relume::tone::Rgb888Table;
use relume_host::export::firmware::{Language, files};
use relume_host::export::frame::FrameConstants;
use serde_json::{Value, json};
use skip::skip;

/// The light that is changed, as in the images of `tests/firmware`.
const CHANGED: usize = 1;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// A folder for what one test builds.
fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"))
        .join("c-library")
        .join(name);
    fs::create_dir_all(&folder).unwrap();
    folder
}

/// The standard output of a command that has to end well.
fn output(command: &mut Command) -> String {
    let found = command
        .output()
        .unwrap_or_else(|error| panic!("{command:?}: {error}"));
    let [out, err] = [&found.stdout, &found.stderr].map(|text| String::from_utf8_lossy(text));
    assert!(found.status.success(), "{command:?}\n{out}{err}");
    out.into_owned()
}

/// Whether these programs and the compiler's target are there; where not, the test fails in CI and says so elsewhere.
fn is_installed(what: &str, programs: &[&str], target: &str) -> bool {
    let works = |script: &str| {
        let mut look = Command::new("bash");
        look.current_dir(root()).args(["-c", script]);
        look.output().is_ok_and(|found| found.status.success())
    };
    let programs = programs.iter();
    let mut missing: Vec<&str> = programs
        .copied()
        .filter(|program| !works(&format!("command -v {program}")))
        .collect();
    if !works(&format!("source .ci/bare-metal.sh {target} --check")) {
        missing.push(target);
    }
    if missing.is_empty() {
        return true;
    }
    let told = format!(
        "{what} was not run; missing: {missing:?}. Install all with: bash .ci/bare-metal.sh all"
    );
    skip(&told);
    false
}

/// Builds the library for a target and returns its folder.
fn library(target: &str) -> PathBuf {
    let mut build = Command::new("bash");
    let cargo = "cargo build --profile device --locked -p relume-ffi";
    let script = match target {
        "" => cargo.to_owned(),
        _ => format!("source .ci/bare-metal.sh {target} && {cargo} --target {target}"),
    };
    let built = folder("library");
    build.current_dir(root()).env("CARGO_TARGET_DIR", &built);
    output(build.args(["-c", &script]));
    built.join(target).join("device")
}

/// Where white begins in the bright tables of the library.
const WHITE: u16 = 1024;

/// The hash of bytes as [`hash`] makes it of pairs of them; their number is even.
fn hash_bytes(bytes: &[u8]) -> u32 {
    let pairs = bytes.as_chunks().0.iter();
    hash(
        &pairs
            .map(|pair| u16::from_le_bytes(*pair))
            .collect::<Vec<u16>>(),
    )
}

/// An input, and what a program has to say of it.
struct Case {
    input: Input,
    expected: Vec<(&'static str, u32)>,
    /// The same of what a small board has no memory for.
    large: Vec<(&'static str, u32)>,
}

/// The inputs of the bare-metal images.
fn cases() -> &'static [Case] {
    static CASES: OnceLock<Vec<Case>> = OnceLock::new();
    CASES.get_or_init(|| inputs().into_iter().map(Case::new).collect())
}

/// What the lights are written in: `lum`, `rgb` or `tiles`.
fn form(input: &Input) -> &'static str {
    input.name.split_once('_').unwrap().0
}

/// Three bytes for every element.
fn bytes_of(input: &Input) -> Vec<u8> {
    let atlas = Atlas::parse(&input.atlas).unwrap();
    let mut room = vec![FrameLight::EMPTY; input.full.len()];
    let mut mix = FrameMix::new(&atlas, &input.full, &mut room).unwrap();
    for (light, levels) in (0..).zip(&input.levels[1]) {
        mix.set(light, *levels);
    }
    let tone = Rgb888Table::new(WHITE);
    let finish = Finish::new(&atlas, &mix, &input.runs, input.exposure, &tone).unwrap();
    let mut pixels = vec![[0; 3]; atlas.element_count() as usize];
    match form(input) {
        "lum" => by_light::<Lum>(&atlas, &mix, Lum::EMPTY, &finish, &mut pixels),
        "rgb" => by_light::<Colour>(&atlas, &mix, Colour::EMPTY, &finish, &mut pixels),
        _ => {
            let mut values = vec![0; table_length(&atlas)];
            let table = AnyTable::new(&atlas, &mix, &mut values).unwrap();
            let mut sums = vec![[0; 3]; pixels.len()];
            full_any(&atlas, &table, &finish, &mut sums, &mut pixels).unwrap();
        }
    }
    pixels.into_flattened()
}

fn by_light<F: Form>(
    atlas: &Atlas,
    mix: &FrameMix,
    mut table: F::Table,
    finish: &Finish<Rgb888Table>,
    pixels: &mut [[u8; 3]],
) {
    let mut sums = vec![F::Sum::default(); pixels.len()];
    add_lights::<F>(atlas, mix, &mut table, &mut sums).unwrap();
    show_sums::<F, _>(atlas, &sums, finish, pixels).unwrap();
}

impl Case {
    fn new(input: Input) -> Self {
        let [first, second] = &input.levels;
        let mut changed = first.clone();
        changed[CHANGED] = second[CHANGED];
        let frame = |levels: &[[u16; 3]]| hash(&input.in_integers(levels));
        let bytes = bytes_of(&input);
        let expected = vec![
            ("full_565", frame(second)),
            ("again_565", frame(second)),
            ("change_565", frame(&changed)),
            ("undone_565", frame(first)),
        ];

        let atlas = Atlas::parse(&input.atlas).unwrap();
        let mut weights = vec![FixedWeight::EMPTY; input.full.len()];
        let fixed = FixedMix::new(&atlas, &input.full, &input.full, &mut weights).unwrap();
        let mut sums = vec![[0; 3]; atlas.element_count() as usize];
        relight_fixed(&atlas, &fixed, &mut sums).unwrap();
        let sums = sums.as_flattened().iter().flat_map(|sum| sum.to_le_bytes());
        let sums: Vec<u8> = sums.collect();
        let large = vec![
            ("full_888", hash_bytes(&bytes)),
            ("irradiance", hash_bytes(&sums)),
            ("unit", hash_bytes(&fixed.unit().to_le_bytes())),
        ];
        Self {
            input,
            expected,
            large,
        }
    }

    fn elements(&self) -> u32 {
        self.input.runs.iter().map(|run| run.elements).sum()
    }

    /// Writes what `relight.c` includes: the atlas as `relume export --c` does, and numbers.
    fn write_scene(&self, folder: &Path) {
        let Input {
            atlas: bytes,
            runs,
            full,
            levels,
            exposure,
            ..
        } = &self.input;
        let atlas = Atlas::parse(bytes).unwrap();
        let frame = FrameConstants {
            full: full.clone(),
            runs: runs.clone(),
            exposure: *exposure,
            white: WHITE,
        };
        for (name, text) in files(&atlas, bytes, Some(&frame), "room", Language::C) {
            fs::write(folder.join(name), text).unwrap();
        }
        let triple = |[r, g, b]: [u16; 3]| format!("{{{r}, {g}, {b}}}");
        let list = |items: Vec<String>| format!("{{{}}}", items.join(", "));
        let [first, second] = levels
            .each_ref()
            .map(|all| list(all.iter().copied().map(triple).collect()));
        let (elements, lights) = (atlas.element_count(), atlas.light_count());
        let memory = match form(&self.input) {
            "lum" => 1024 + 4 * elements,
            "rgb" => 1536 + 6 * elements,
            _ => 2 * table_length(&atlas) as u32 + 6 * elements,
        } + 20 * lights;
        let text = format!(
            "#define ELEMENTS {elements}u\n#define LIGHTS {lights}u\n#define CHANGED {CHANGED}u\n\
             #define FRAME_MEMORY {memory}u\n\
             static const RelumeLevels first[LIGHTS] = {first};\n\
             static const RelumeLevels second[LIGHTS] = {second};\n"
        );
        fs::write(folder.join("scene.h"), text).unwrap();
    }

    /// Compares what a program said, `name number` on each line; names of other things are let be.
    fn check(&self, said: &str, with_large: bool) {
        let large = self.large.iter().filter(|_| with_large);
        for (name, expected) in self.expected.iter().chain(large) {
            let found = number(said, name);
            assert_eq!(
                found,
                Some(*expected),
                "{} {name}:\n{said}",
                self.input.name
            );
        }
    }
}

/// The number after a name at the beginning of a line.
fn number(said: &str, name: &str) -> Option<u32> {
    let mut lines = said.lines().filter_map(|line| line.split_once(' '));
    lines
        .find(|(found, _)| *found == name)?
        .1
        .trim()
        .parse()
        .ok()
}

/// The rows of a program for `tests/firmware/run --json`; `size` is that of flash and RAM without the stack, where
/// instructions were counted, too.
fn rows(target: &str, case: &Case, said: &str, size: Option<[u64; 2]>) -> Vec<Value> {
    let (n, k) = (case.elements(), case.input.full.len() as u32);
    let form = form(&case.input);
    // A change of an atlas in tiles is a full frame.
    let kernels: &[&str] = match form {
        "tiles" => &["full"],
        _ => &["full", "change"],
    };
    let row = |kernel: &&str| {
        let hash = number(said, &format!("{kernel}_565")).unwrap();
        let mut row = json!({
            "target": target, "kernel": format!("{kernel}_{form}_565"), "n": n, "k": k,
            "hash": format!("{hash:08x}"),
        });
        if let Some([flash, ram]) = size {
            let frame = |sums| number(said, sums).unwrap() + number(said, "count_show").unwrap();
            // Only tiles keep tables; other forms make them anew for every frame.
            let (cold, warm, share) = match *kernel {
                "full" => (frame("count_sums"), frame("count_again"), n * k),
                _ => (frame("count_change"), frame("count_change"), n),
            };
            row["per_frame"] = cold.into();
            row["per_frame_warm"] = warm.into();
            row["per_element_light"] = (f64::from(warm) / f64::from(share)).into();
            let stack = number(said, "stack").unwrap();
            row["flash"] = flash.into();
            row["ram"] = (ram + u64::from(stack)).into();
            row["stack"] = stack.into();
            for (key, value) in modelled(target, cold.into()) {
                row[key] = value;
            }
        }
        row
    };
    kernels.iter().map(row).collect()
}

#[test]
fn the_header_is_made_from_the_source() {
    let source = root().join("solver/ffi");
    let config = cbindgen::Config::from_file(source.join("cbindgen.toml")).unwrap();
    let mut builder = cbindgen::Builder::new().with_config(config);
    for name in ["status", "atlas", "frame", "irradiance"] {
        builder = builder.with_src(source.join(format!("src/{name}.rs")));
    }
    let mut header = Vec::new();
    builder.generate().unwrap().write(&mut header);
    let header = String::from_utf8(header).unwrap();
    let path = source.join("relume.h");
    if std::env::var_os("RELUME_BLESS").is_some() {
        fs::write(&path, &header).unwrap();
    }
    let found = fs::read_to_string(&path).unwrap_or_default();
    assert!(
        found == header,
        "{}: run this test with RELUME_BLESS=1",
        path.display()
    );
}

#[test]
fn a_c_program_relights_on_the_desktop() {
    let library = library("").join("librelume_c.a");
    let compiler = output(Command::new("rustc").arg("-vV"));
    let host = compiler
        .lines()
        .find_map(|line| line.strip_prefix("host: "));
    let (target, mut found) = (format!("c-{}", host.unwrap()), Vec::new());
    for case in cases() {
        let folder = folder(&format!("desktop-{}", case.input.name));
        case.write_scene(&folder);
        let program = folder.join("relight");
        let mut compile = Command::new("cc");
        compile.args([
            "-std=c11",
            "-Wall",
            "-Wextra",
            "-Wpedantic",
            "-Werror",
            "-O2",
        ]);
        compile
            .arg("-I")
            .arg(&folder)
            .arg("-I")
            .arg(root().join("solver/ffi"));
        for source in ["relight.c", "desktop.c"] {
            compile.arg(root().join("tests/c_library").join(source));
        }
        compile
            .arg(folder.join("room.c"))
            .arg(&library)
            .arg("-o")
            .arg(&program);
        output(compile.args(["-lpthread", "-ldl", "-lm"]));
        let said = output(&mut Command::new(program));
        case.check(&said, true);
        found.extend(rows(&target, case, &said, None));
    }
    write_rows(&target, &found);
}

/// Bytes of flash, and of RAM without the stack.
fn size(program: &Path) -> [u64; 2] {
    let told = output(Command::new("arm-none-eabi-size").arg(program));
    let numbers = told.lines().nth(1).unwrap().split_whitespace();
    let numbers: Vec<u64> = numbers
        .take(3)
        .map(|number| number.parse().unwrap())
        .collect();
    [numbers[0] + numbers[1], numbers[1] + numbers[2]]
}

/// A board that QEMU emulates.
struct Board {
    target: &'static str,
    compiler: &'static [&'static str],
    emulator: &'static [&'static str],
    flash: &'static str,
    ram: &'static str,
}

const M4F: Board = Board {
    target: "thumbv7em-none-eabihf",
    compiler: &["-mcpu=cortex-m4", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16"],
    emulator: &["-M", "mps2-an386", "-cpu", "cortex-m4"],
    flash: "4M",
    ram: "4M",
};

const M0: Board = Board {
    target: "thumbv6m-none-eabi",
    compiler: &["-mcpu=cortex-m0", "-DSMALL"],
    emulator: &["-M", "microbit"],
    flash: "256K",
    ram: "16K",
};

impl Board {
    fn run(&self, what: &str) {
        let programs = ["arm-none-eabi-gcc", "arm-none-eabi-nm", "qemu-system-arm"];
        if !is_installed(what, &programs, self.target) {
            return;
        }
        let library = library(self.target).join("librelume_c.a");
        let (target, mut all) = (format!("c-{}", self.target), Vec::new());
        let is_small = self.compiler.contains(&"-DSMALL");
        for case in cases() {
            // A table of all lights is too large for a small board.
            if is_small && form(&case.input) == "tiles" {
                continue;
            }
            let folder = folder(&format!("{}-{}", self.target, case.input.name));
            case.write_scene(&folder);
            let program = self.compile(&folder, &library);
            let names = output(Command::new("arm-none-eabi-nm").arg(&program));
            assert!(
                !names.contains("panic"),
                "a path to a panic is left:\n{names}"
            );
            let mut emulator = Command::new("timeout");
            emulator.args(["60", "qemu-system-arm"]).args(self.emulator);
            emulator.args([
                "-icount",
                "shift=10",
                "-nographic",
                "-monitor",
                "none",
                "-serial",
                "none",
            ]);
            emulator.args(["-semihosting-config", "enable=on,target=native", "-kernel"]);
            // Semihosting writes to standard error.
            let found = emulator.arg(&program).output().unwrap();
            let said = [found.stdout, found.stderr].concat();
            let said = String::from_utf8_lossy(&said);
            assert!(
                found.status.success(),
                "{} {}: {said}",
                self.target,
                case.input.name
            );
            case.check(&said, !is_small);
            println!("{} {}\n{said}", self.target, case.input.name);
            all.extend(rows(&target, case, &said, Some(size(&program))));
        }
        write_rows(&target, &all);
    }

    fn compile(&self, folder: &Path, library: &Path) -> PathBuf {
        let sources = root().join("tests/c_library");
        let program = folder.join("relight.elf");
        let mut compile = Command::new("arm-none-eabi-gcc");
        compile.args(self.compiler);
        compile.args([
            "-mthumb",
            "-std=gnu11",
            "-Wall",
            "-Wextra",
            "-Werror",
            "-Os",
        ]);
        compile.args([
            "-ffunction-sections",
            "-fdata-sections",
            "-nostartfiles",
            "--specs=nano.specs",
        ]);
        compile
            .arg("-I")
            .arg(folder)
            .arg("-I")
            .arg(root().join("solver/ffi"));
        compile
            .arg(sources.join("relight.c"))
            .arg(sources.join("startup.c"));
        compile.arg(folder.join("room.c")).arg(library);
        compile
            .arg("-T")
            .arg(sources.join("link.ld"))
            .arg("-Wl,--gc-sections,--build-id=none");
        for (name, size) in [("flash", self.flash), ("ram", self.ram)] {
            let size = size.strip_suffix('K').map_or(4 << 20, |kilobytes| {
                1024 * kilobytes.parse::<u32>().unwrap()
            });
            compile.arg(format!("-Wl,--defsym={name}_size={size}"));
        }
        output(compile.arg("-o").arg(&program));
        program
    }
}

#[test]
fn a_c_program_relights_on_a_cortex_m4f() {
    M4F.run("the C program on an emulated Cortex-M4F");
}

#[test]
fn a_c_program_relights_on_a_cortex_m0() {
    M0.run("the C program on an emulated Cortex-M0");
}

#[test]
fn javascript_relights_by_web_assembly() {
    let target = "wasm32-unknown-unknown";
    if !is_installed("the library in WebAssembly", &["node"], target) {
        return;
    }
    let library = library(target).join("relume_c.wasm");
    let mut found = Vec::new();
    for case in cases() {
        let Input {
            name,
            atlas,
            runs,
            full,
            levels,
            exposure,
        } = &case.input;
        let folder = folder(&format!("wasm-{name}"));
        let [bytes, scene] = ["room.atlas", "scene.json"].map(|name| folder.join(name));
        fs::write(&bytes, atlas).unwrap();
        let numbers = json!({
            "full": full.iter().map(|full| full.to_array()).collect::<Vec<_>>(),
            "levels": levels,
            "runs": runs.iter().map(|run| (run.elements, run.reflectance)).collect::<Vec<_>>(),
            "exposure": exposure,
            "changed": CHANGED,
        });
        fs::write(&scene, numbers.to_string()).unwrap();
        let mut node = Command::new("node");
        node.arg(root().join("tests/c_library/relight.mjs"));
        let said = output(node.args([&library, &bytes, &scene]));
        case.check(&said, true);
        found.extend(rows(target, case, &said, None));
    }
    write_rows(target, &found);
    println!("{target}: {} bytes", fs::metadata(library).unwrap().len());
}
