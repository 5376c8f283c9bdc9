//! An atlas as source text that firmware links, or as bytes, with what it costs there.
//!
//! The bytes are those of the atlas file ([`relume::atlas`]); a device borrows them from flash with
//! `Atlas::parse`. Beside them stands a number for every light's name, so that code names lights and
//! not places in a list.

use std::collections::HashSet;
use std::fmt::Write as _;

use relume::atlas::Atlas;
use relume::color::Rgb;
use relume::relight::{FixedWeight, STEPS};

use super::frame::FrameConstants;
use crate::device_cost::{Core, DeviceCost};

/// What an atlas takes on a device that relights it in integers, multiplying on the way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cost {
    /// Bytes of flash: the atlas.
    pub flash: u64,
    /// Bytes of RAM: three `u32` sums per element and the weights.
    pub ram: u64,
    /// Bytes more for the table of all products, with which relighting only adds.
    pub table: u64,
    /// Multiply-adds of a frame in which every light changed.
    pub frame: u64,
    /// Multiply-adds when one light changed.
    pub change: u64,
}

impl Cost {
    /// Of an atlas of so many bytes.
    #[must_use]
    pub fn new(atlas: &Atlas, bytes: usize) -> Self {
        let (n, k) = (
            u64::from(atlas.element_count()),
            u64::from(atlas.light_count()),
        );
        Self {
            flash: bytes as u64,
            ram: n * 12 + k * size_of::<FixedWeight>() as u64,
            table: relume::relight::table_length(atlas) as u64 * 4,
            frame: n * k * 3,
            change: n * 3,
        }
    }

    /// As the lines of a comment.
    fn lines(&self, atlas: &Atlas) -> Vec<String> {
        let Self {
            flash,
            ram,
            table,
            frame,
            change,
        } = self;
        let (n, k) = (atlas.element_count(), atlas.light_count());
        let devices = Core::ALL.map(|core| {
            let cost = DeviceCost::new(atlas, self.flash as usize, core);
            let DeviceCost { flash, ram, frame, warm, change } = cost;
            let (name, room) = (core.name(), core.ram());
            let fits = if ram <= room { "" } else { ", more than it had" };
            format!(
                "{name}, Rust, predicted: {flash} bytes of flash with the code, {ram} of RAM{fits}; instructions of a frame: {frame}, \
                 {warm} with tables kept, {change} when one light changed."
            )
        });
        let [m0, m3, m4f] = devices;
        vec![
            format!(
                "Relume atlas: {n} elements, {k} lights. Borrow it with relume::atlas::Atlas::parse, in C relume_atlas_parse."
            ),
            format!("Flash: {flash} bytes."),
            format!(
                "RAM: {ram} bytes to relight in integers; {table} more to do so by additions alone."
            ),
            format!("Frame: {frame} multiply-adds, beside decoding; one changed light: {change}."),
            m0,
            m3,
            m4f,
            match atlas.worst_error() {
                Some(worst) => format!(
                    "Error: at most {:.2} display codes as packed, {:.2} as shown.",
                    worst.packed, worst.shown
                ),
                None => "Error: not measured.".to_owned(),
            },
        ]
    }
}

/// What is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Language {
    /// One Rust module.
    Rust,
    /// A C header and its source.
    C,
    /// The bytes, and a text beside them.
    Binary,
}

/// The files of an atlas, by name, from the name of the atlas; with what its frames need, if that is known.
#[must_use]
pub fn files(
    atlas: &Atlas,
    bytes: &[u8],
    frame: Option<&FrameConstants>,
    name: &str,
    language: Language,
) -> Vec<(String, Vec<u8>)> {
    let comment = Cost::new(atlas, bytes.len()).lines(atlas);
    let name = identifier(name).to_lowercase();
    let lights = light_names(atlas);
    match language {
        Language::Rust => vec![(
            format!("{name}.rs"),
            rust(bytes, frame, &comment, &lights).into_bytes(),
        )],
        Language::C => {
            let (header, source) = c(bytes, frame, &name, &comment, &lights);
            vec![
                (format!("{name}.h"), header.into_bytes()),
                (format!("{name}.c"), source.into_bytes()),
            ]
        }
        Language::Binary => vec![
            (format!("{name}.atlas"), bytes.to_vec()),
            (
                format!("{name}.txt"),
                binary_text(&comment, &lights).into_bytes(),
            ),
        ],
    }
}

fn rust(
    bytes: &[u8],
    frame: Option<&FrameConstants>,
    comment: &[String],
    lights: &[String],
) -> String {
    let mut text = String::new();
    for line in comment {
        let _ = writeln!(text, "//! {line}");
    }
    // A program names some of the lights.
    text += "#![allow(dead_code)]\n";
    for (light, number) in lights.iter().zip(0..) {
        let _ = writeln!(
            text,
            "\n/// Number of this light.\npub const LIGHT_{light}: u32 = {number};"
        );
    }
    if let Some(frame) = frame {
        text += &rust_frame(frame);
    }
    let _ = writeln!(
        text,
        "\n/// The bytes of the atlas.\n#[rustfmt::skip]\npub static ATLAS: [u8; {}] = [",
        bytes.len()
    );
    text + &rows(bytes) + "];\n"
}

fn rust_frame(frame: &FrameConstants) -> String {
    let FrameConstants {
        full,
        runs,
        exposure,
        white,
    } = frame;
    let weights = full
        .iter()
        .map(|Rgb { r, g, b }| format!("    Rgb::new({r:?}, {g:?}, {b:?}),\n"));
    let reflecting = runs.iter().map(|run| format!("    {run:?},\n"));
    format!(
        "\nuse relume::color::Rgb;\nuse relume::relight::Run;\n\
         \n/// What every light emits: its full weight.\n\
         #[rustfmt::skip]\npub static FULL: [Rgb; {}] = [\n{}];\n\
         \n/// Elements that follow each other, and their reflectance.\n\
         #[rustfmt::skip]\npub static RUNS: [Run; {}] = [\n{}];\n\
         \n/// With all lights on, the 98th percentile of the elements' luminance is white.\n\
         pub const EXPOSURE: f32 = {exposure:?};\n\
         \n/// Where white begins in a table that holds the brightest element.\n\
         pub const WHITE: u16 = {white};\n",
        full.len(),
        weights.collect::<String>(),
        runs.len(),
        reflecting.collect::<String>(),
    )
}

fn c(
    bytes: &[u8],
    frame: Option<&FrameConstants>,
    name: &str,
    comment: &[String],
    lights: &[String],
) -> (String, String) {
    let comment = format!("/* {} */\n", comment.join("\n * "));
    let upper = name.to_uppercase();
    let mut header =
        format!("{comment}#ifndef {upper}_H\n#define {upper}_H\n\n#include <stdint.h>\n");
    if frame.is_some() {
        header += "#include \"relume.h\"\n";
    }
    header += "\n";
    for (light, number) in lights.iter().zip(0..) {
        let _ = writeln!(header, "#define {upper}_LIGHT_{light} {number}u");
    }
    let length = bytes.len();
    let _ = writeln!(
        header,
        "\n#define {upper}_LENGTH {length}u\nextern const uint8_t {name}[{upper}_LENGTH];"
    );
    let mut source = format!(
        "{comment}#include \"{name}.h\"\n\nconst uint8_t {name}[{upper}_LENGTH] = {{\n{}}};\n",
        rows(bytes)
    );
    if let Some(frame) = frame {
        let (declared, defined) = c_frame(frame, name, &upper);
        header += &declared;
        source += &defined;
    }
    header += "\n#endif\n";
    (header, source)
}

fn c_frame(frame: &FrameConstants, name: &str, upper: &str) -> (String, String) {
    let (lights, runs) = (frame.full.len(), frame.runs.len());
    // The bright tables of the C library begin white in the middle.
    let bright = f32::from(frame.white) / (STEPS / 2) as f32;
    let exposure = frame.exposure * bright.min(1.0);
    let declared = format!(
        "\n/* What every light emits: its full weight. */\n\
         #define {upper}_LIGHTS {lights}u\nextern const RelumeRgb {name}_full[{upper}_LIGHTS];\n\
         \n/* Elements that follow each other, and their reflectance. */\n\
         #define {upper}_RUNS {runs}u\nextern const RelumeRun {name}_runs[{upper}_RUNS];\n\
         \n/* With all lights on, the 98th percentile of luminance is white, or as near to it as\n \
         * relume_rgb565_bright and relume_rgb888_bright hold the brightest element. */\n\
         #define {upper}_EXPOSURE {exposure:?}f\n",
    );
    let full = frame.full.iter();
    let weights = full.map(|Rgb { r, g, b }| format!("    {{{r:?}f, {g:?}f, {b:?}f}},\n"));
    let reflecting = frame.runs.iter().map(|run| {
        let [r, g, b] = run.reflectance;
        format!("    {{{}u, {{{r}u, {g}u, {b}u}}}},\n", run.elements)
    });
    let defined = format!(
        "\nconst RelumeRgb {name}_full[{upper}_LIGHTS] = {{\n{}}};\n\
         \nconst RelumeRun {name}_runs[{upper}_RUNS] = {{\n{}}};\n",
        weights.collect::<String>(),
        reflecting.collect::<String>(),
    );
    (declared, defined)
}

fn binary_text(comment: &[String], lights: &[String]) -> String {
    let lights = lights
        .iter()
        .zip(0..)
        .map(|(light, number)| format!("Light {number}: {light}"));
    let lines: Vec<String> = comment.iter().cloned().chain(lights).collect();
    lines.join("\n") + "\n"
}

/// The bytes in decimal, twenty a line.
fn rows(bytes: &[u8]) -> String {
    let mut text = String::with_capacity(bytes.len() * 4);
    for row in bytes.chunks(20) {
        let numbers: Vec<String> = row.iter().map(u8::to_string).collect();
        text.push_str("    ");
        text.push_str(&numbers.join(", "));
        text.push_str(",\n");
    }
    text
}

/// Names of the lights that a program can use: upper case, letters, digits and `_`, all different.
fn light_names(atlas: &Atlas) -> Vec<String> {
    let mut taken = HashSet::new();
    let unique = |light: relume::atlas::AtlasLight| {
        let name = identifier(light.name).to_uppercase();
        let numbered = (2..).map(|number| format!("{name}_{number}"));
        let mut names = std::iter::once(name.clone()).chain(numbered);
        names
            .find(|name| taken.insert(name.clone()))
            .unwrap_or(name)
    };
    atlas.lights().map(unique).collect()
}

/// What is left of a name when all but ASCII letters and digits become `_`; never empty, never a
/// digit first.
fn identifier(name: &str) -> String {
    let sign = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    let name: String = name.chars().map(sign).collect();
    match name.chars().next() {
        Some(first) if !first.is_ascii_digit() => name,
        _ => format!("_{name}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use relume::atlas::{Contents, LightEntry, Quantity, size, write};
    use relume::code::{Code, Scale};
    use relume::color::Rgb;

    fn atlas() -> Vec<u8> {
        let light = |name| LightEntry::exponential(name, Rgb::WHITE, Code::Lum8, Scale::ONE);
        let contents = Contents {
            quantity: Quantity::Irradiance,
            lights: &[light("desk lamp"), light("desk-lamp"), light("3")],
            elements: 2,
            image_width: 0,
            errors: None,
            tiles: &[],
            mesh: None,
        };
        let mut bytes = vec![0; size(&contents).unwrap()];
        write(&contents, |_, _| Rgb::WHITE, &mut bytes).unwrap();
        bytes
    }

    #[test]
    fn names_are_legal_and_differ() {
        let bytes = atlas();
        let names = light_names(&Atlas::parse(&bytes).unwrap());
        assert_eq!(names, ["DESK_LAMP", "DESK_LAMP_2", "_3"]);
        assert_eq!(identifier(""), "_");
    }

    #[test]
    fn numbers_in_the_text_are_the_bytes() {
        let bytes = atlas();
        let atlas = Atlas::parse(&bytes).unwrap();
        for (language, at) in [(Language::Rust, 0), (Language::C, 1)] {
            let files = files(&atlas, &bytes, None, "my room.v2", language);
            assert!(
                files
                    .iter()
                    .all(|(name, _)| name.starts_with("my_room_v2.")),
                "{language:?}"
            );
            let text = String::from_utf8(files[at].1.clone()).unwrap();
            let table = text.rsplit_once("= ").unwrap().1;
            let numbers = table
                .split(|c: char| !c.is_ascii_digit())
                .filter(|n| !n.is_empty());
            let found: Vec<u8> = numbers.map(|n| n.parse().unwrap()).collect();
            assert_eq!(found, bytes, "{language:?}");
        }
        let plain = files(&atlas, &bytes, None, "a", Language::Binary);
        assert_eq!(plain[0], ("a.atlas".to_owned(), bytes.clone()));
    }
}
