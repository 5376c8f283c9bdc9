//! The C library as a C programmer meets it: the header fits the source, and one program relights with the bits of the
//! Rust kernels on the desktop, on a Cortex-M4F, on a Cortex-M0 and, in JavaScript, in WebAssembly.
//!
//! Whatever is not installed is a failure in CI (variable `CI`); elsewhere a test says what it did not run.

use std::fmt::Write as _;
use std::fs;
use std::io::Write as _;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use relume::atlas::{Atlas, Quantity};
use relume::code::Code;
use relume::color::Rgb;
use relume::relight::{
    Colour, Finish, FixedMix, FixedWeight, Form, FrameLight, FrameMix, Lum, Run, add_lights,
    fill_table, full, relight_fixed, show_sums,
};
use relume::tone::{Rgb565Table, Rgb888Table};
use relume_host::bake::{Settings, bake};
use relume_host::builtin::{PaperLamps, paper_room};
use relume_host::export::firmware::{Language, files};
use relume_host::pack::{Format, pack};
use relume_host::solution::Solution;

const LIGHTS: usize = 8;

/// Levels of the first frame, and of the light that is changed.
const LEVELS: [[u16; 3]; LIGHTS] = [
    [65_535; 3],
    [60_000, 40_000, 20_000],
    [0; 3],
    [1_000, 2_000, 65_535],
    [30_000; 3],
    [65_535, 0, 0],
    [12_345, 23_456, 34_567],
    [1; 3],
];
const CHANGED: u32 = 2;
const CHANGE: [u16; 3] = [65_535, 50_000, 30_000];

/// What is installed with one command of apt.
const ARM: &str = "gcc-arm-none-eabi libnewlib-arm-none-eabi qemu-system-arm";

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
fn is_installed(what: &str, programs: &[&str], target: &str, packages: &str) -> bool {
    let is_there = |program: &&&str| {
        let mut look = Command::new("sh");
        look.args(["-c", &format!("command -v {program}")]);
        look.output().is_ok_and(|found| found.status.success())
    };
    let mut missing: Vec<String> = programs
        .iter()
        .filter(|program| !is_there(program))
        .map(ToString::to_string)
        .collect();
    let rustup = Command::new("rustup")
        .args(["target", "list", "--installed"])
        .output();
    let has_target =
        rustup.is_ok_and(|list| String::from_utf8_lossy(&list.stdout).contains(target));
    if !has_target && !Path::new("/usr/lib/rustlib/src").exists() {
        missing.push(format!("Rust for {target}"));
    }
    if missing.is_empty() || std::env::var_os("CI").is_some() {
        assert!(
            missing.is_empty(),
            "{what} needs {}: {packages}",
            missing.join(", ")
        );
        return true;
    }
    // Not by a macro, whose output a passing test would swallow.
    let missing = missing.join(", ");
    let _ = writeln!(
        std::io::stderr(),
        "NOT RUN: {what}, for lack of {missing}; `rustup target add {target}` and {packages}"
    );
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

/// FNV-1a, 32 bits.
fn hash(bytes: &[u8]) -> u32 {
    let step = |hash: u32, byte: &u8| (hash ^ u32::from(*byte)).wrapping_mul(0x0100_0193);
    bytes.iter().fold(0x811c_9dc5, step)
}

fn hash_words(words: impl IntoIterator<Item = u16>) -> u32 {
    let bytes: Vec<u8> = words.into_iter().flat_map(u16::to_le_bytes).collect();
    hash(&bytes)
}

/// An atlas, and what is done with it.
struct Case {
    name: &'static str,
    bytes: Vec<u8>,
    runs: Vec<Run>,
    exposure: f32,
    /// What every program has to say.
    expected: Vec<(&'static str, u32)>,
    /// Hashes of sums and unit in `relume_irradiance`.
    irradiance: [u32; 2],
}

/// The paper's room with eight lamps, in luminance codes and in colour.
fn cases() -> &'static [Case; 2] {
    static CASES: OnceLock<[Case; 2]> = OnceLock::new();
    CASES.get_or_init(|| {
        let room = paper_room(PaperLamps::Eight).unwrap();
        let settings = Settings {
            patch: Some(room.spacing.patch),
            element: Some(room.spacing.element),
            ..Settings::default()
        };
        let mut go_on = |_| ControlFlow::Continue(());
        let solution = bake(&room.scene, &settings, &mut go_on).unwrap();
        [
            Case::new::<Lum>("lum", &solution, Code::Lum8, [0; 256]),
            Case::new::<Colour>("colour", &solution, Code::Display8, [[0; 256]; 3]),
        ]
    })
}

/// Elements that follow each other and reflect alike.
fn runs(solution: &Solution) -> Vec<Run> {
    let mut runs: Vec<Run> = Vec::new();
    for element in &solution.mesh.elements {
        let reflectance = element
            .reflectance
            .to_array()
            .map(|r| (r * 65_536.0) as u16);
        match runs.last_mut().filter(|run| run.reflectance == reflectance) {
            Some(run) => run.elements += 1,
            None => runs.push(Run {
                elements: 1,
                reflectance,
            }),
        }
    }
    runs
}

impl Case {
    fn new<F: Form>(name: &'static str, solution: &Solution, code: Code, table: F::Table) -> Self
    where
        F::Table: Clone,
    {
        let is_lum = code == Code::Lum8;
        let quantity = if is_lum {
            Quantity::Irradiance
        } else {
            Quantity::Radiosity
        };
        let format = Format {
            packing: code.into(),
            quantity,
            mesh: false,
        };
        let bytes = pack(solution, format).unwrap();
        let elements = solution.mesh.elements.len() as u32;
        let runs = if is_lum {
            runs(solution)
        } else {
            vec![Run {
                elements,
                reflectance: [u16::MAX; 3],
            }]
        };

        let atlas = Atlas::parse(&bytes).unwrap();
        // The brightest element is about twice as bright as white.
        let brightest = solution.relight(&[Rgb::WHITE; LIGHTS]);
        let brightest = brightest
            .iter()
            .map(|value| value.max_channel())
            .fold(0.0, f32::max);
        let exposure = 2.0 * std::f32::consts::PI / brightest;
        let mut case = Self {
            name,
            bytes: bytes.clone(),
            runs,
            exposure,
            expected: Vec::new(),
            irradiance: [0; 2],
        };
        case.expect::<F>(&atlas, &table);
        case
    }

    /// What the Rust kernels make of it.
    fn expect<F: Form>(&mut self, atlas: &Atlas, table: &F::Table)
    where
        F::Table: Clone,
    {
        let mut room = [FrameLight::EMPTY; LIGHTS];
        let mut mix = FrameMix::new(atlas, &[Rgb::WHITE; LIGHTS], &mut room).unwrap();
        let (narrow, wide) = (Rgb565Table::new(512), Rgb888Table::new(512));
        let elements = atlas.element_count() as usize;
        for (light, levels) in (0..).zip(LEVELS) {
            mix.set(light, levels);
        }
        let frame = |mix: &FrameMix| {
            let tables = (0..LIGHTS as u32).map(|light| {
                let mut own = table.clone();
                fill_table::<F>(atlas, mix, light, &mut own).unwrap();
                own
            });
            let tables: Vec<F::Table> = tables.collect();
            let tables: &[F::Table; LIGHTS] = tables[..].try_into().unwrap();
            let finish = Finish::new(atlas, mix, &self.runs, self.exposure, &narrow).unwrap();
            let mut pixels = vec![0; elements];
            full::<F, LIGHTS, _>(atlas, tables, &finish, &mut pixels).unwrap();
            hash_words(pixels)
        };
        let first = frame(&mix);
        mix.set(CHANGED, CHANGE);
        let second = frame(&mix);

        let finish = Finish::new(atlas, &mix, &self.runs, self.exposure, &wide).unwrap();
        let (mut own, mut sums) = (table.clone(), vec![F::Sum::default(); elements]);
        add_lights::<F>(atlas, &mix, &mut own, &mut sums).unwrap();
        let mut pixels = vec![[0; 3]; elements];
        show_sums::<F, _>(atlas, &sums, &finish, &mut pixels).unwrap();
        self.expected = vec![
            ("full_565", first),
            ("change_565", second),
            ("change_888", hash(pixels.as_flattened())),
            ("undone_565", first),
        ];

        let white = [Rgb::WHITE; LIGHTS];
        let mut weights = [FixedWeight::EMPTY; LIGHTS];
        let fixed = FixedMix::new(atlas, &white, &white, &mut weights).unwrap();
        let mut sums = vec![[0; 3]; elements];
        relight_fixed(atlas, &fixed, &mut sums).unwrap();
        let words: Vec<u8> = sums
            .as_flattened()
            .iter()
            .flat_map(|s| s.to_le_bytes())
            .collect();
        self.irradiance = [hash(&words), hash(&fixed.unit().to_le_bytes())];
    }

    /// Writes what `relight.c` includes: the atlas as `relume export --c` writes it, and numbers.
    fn write_scene(&self, folder: &Path) {
        let atlas = Atlas::parse(&self.bytes).unwrap();
        for (name, bytes) in files(&atlas, &self.bytes, "room", Language::C) {
            fs::write(folder.join(name), bytes).unwrap();
        }
        let triple = |[r, g, b]: [u16; 3]| format!("{{{r}, {g}, {b}}}");
        let runs = self.runs.iter();
        let runs: Vec<_> = runs
            .map(|run| format!("{{{}, {}}}", run.elements, triple(run.reflectance)))
            .collect();
        let mut text = String::new();
        let sum = if self.name == "lum" { 4 } else { 6 };
        let table = if self.name == "lum" { 1024 } else { 1536 };
        let elements = atlas.element_count();
        let memory = table + sum * elements + 32 * LIGHTS as u32;
        let _ = writeln!(
            text,
            "#define ELEMENTS {elements}u\n#define LIGHTS {LIGHTS}u"
        );
        let _ = writeln!(
            text,
            "#define FRAME_MEMORY {memory}u\n#define CHANGED {CHANGED}u"
        );
        let _ = writeln!(text, "#define EXPOSURE {:e}f", self.exposure);
        let _ = writeln!(
            text,
            "static const RelumeRun runs[] = {{{}}};",
            runs.join(", ")
        );
        let levels = LEVELS.map(triple).join(", ");
        let _ = writeln!(
            text,
            "static const RelumeLevels levels[LIGHTS] = {{{levels}}};"
        );
        let _ = writeln!(
            text,
            "static const RelumeLevels changed = {};",
            triple(CHANGE)
        );
        fs::write(folder.join("scene.h"), text).unwrap();
    }

    /// Compares what a program said, `name number` on each line; names of other things are let be.
    fn check(&self, said: &str, with_irradiance: bool) {
        let number = |name: &str| {
            let mut lines = said.lines().filter_map(|line| line.split_once(' '));
            let found = lines.find(|(found, _)| *found == name);
            found.map(|(_, value)| value.trim().parse::<u32>().unwrap())
        };
        for (name, expected) in &self.expected {
            assert_eq!(
                number(name),
                Some(*expected),
                "{} {name}:\n{said}",
                self.name
            );
        }
        if with_irradiance {
            let found = ["irradiance", "unit"].map(number);
            assert_eq!(found, self.irradiance.map(Some), "{}:\n{said}", self.name);
        }
    }
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
    for case in cases() {
        let folder = folder(&format!("desktop-{}", case.name));
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
            "-DIRRADIANCE",
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
        case.check(&output(&mut Command::new(program)), true);
    }
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
    compiler: &[
        "-mcpu=cortex-m4",
        "-mfloat-abi=hard",
        "-mfpu=fpv4-sp-d16",
        "-DIRRADIANCE",
    ],
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
        let packages = format!("`apt-get install {ARM}`");
        if !is_installed(what, &programs, self.target, &packages) {
            return;
        }
        let library = library(self.target).join("librelume_c.a");
        for case in cases() {
            let folder = folder(&format!("{}-{}", self.target, case.name));
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
                case.name
            );
            case.check(&said, self.compiler.contains(&"-DIRRADIANCE"));
            println!("{} {}\n{said}", self.target, case.name);
        }
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
        println!(
            "{}",
            output(Command::new("arm-none-eabi-size").arg(&program))
        );
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
