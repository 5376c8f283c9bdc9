//! From a scene to the pixels of a device, against an independent reference, and what every part of the way adds.
//!
//! The measured Cornell box is baked at default settings, packed (`display8`, radiosity), and relit in an image for the
//! Cortex-M4F. Its picture has one pixel for every point of the reference: what the point's element shows. Differences are in display
//! codes, steps of 8-bit sRGB, root mean square over points and channels. Between the reference and the device stand four more
//! pictures, each of which takes one step of the way:
//!
//! * bake: irradiance gathered at the point itself from the solution;
//! * mesh: that of its element;
//! * packing: that of its code;
//! * RGB565: the same rounded to five, six and five bits;
//! * integers: the frame of the device.
//!
//! The picture of the whole way cannot differ by more than the sum of its parts.

mod data;
#[expect(dead_code, reason = "the other images need the rest")]
mod emulator;
#[expect(dead_code, reason = "the other images need the rest")]
mod inputs;
mod skip;

use std::f32::consts::FRAC_1_PI;
use std::fs;
use std::io::Write as _;
use std::ops::ControlFlow;
use std::path::Path;

use emulator::{TARGETS, build, emulate, has_tools, said, work};
use inputs::{Input, hash, input, relit};
use relume::atlas::{Atlas, Quantity};
use relume::code::Code;
use relume::color::Rgb;
use relume::tone::srgb_encode;
use relume_host::bake::{Settings, bake};
use relume_host::import;
use relume_host::probe::{Part, ProbePoint, RAYS, probe_gathered, probe_points, read_points};
use relume_host::solution::Solution;

/// The same level for every channel: all that there is.
const LEVELS: [[u16; 3]; 1] = [[u16::MAX; 3]];

/// Display codes of a pixel.
type Codes = [f64; 3];

/// A step of the way, and the most that it may add. Measured values are in README.md.
const PARTS: [(&str, f64); 5] = [
    // 0.40, of which the noise of the reference is a part.
    ("bake", 0.6),
    // 12.06: one value for an element, through which edges of shadows run, and the dark codes are narrow.
    ("mesh", 13.0),
    // 0.34: codes are about a display code apart, and sqrt(1 / 12) of it is 0.29.
    ("packing", 0.5),
    // 2.07: steps of 8.2, 4.0 and 8.2 codes make 2.4, 1.2 and 2.4 each by sqrt(1 / 12), 2.1 in all.
    ("RGB565", 2.2),
    // 1.69: four channels of a hundred fall to the other side of a rounding. Red and blue are cut off to steps of 2^-10: at
    // a twentieth of white that is half a step, 0.3 codes, too dark, so up to 4 in 100 of their roundings to 8.2 codes turn; at a
    // fortieth up to 6: 8.2 sqrt(0.06) = 2.0.
    ("integers", 2.0),
];

/// The values of a CSV `point,light,r,g,b` with one light.
fn values(csv: &str) -> Vec<Rgb> {
    let row = |line: &str| {
        let mut cells = line
            .split(',')
            .skip(2)
            .map(|cell| cell.parse().expect("a number"));
        let mut next = || cells.next().expect("three channels");
        Rgb::new(next(), next(), next())
    };
    csv.lines().skip(1).map(row).collect()
}

/// The element of every point.
fn elements(solution: &Solution, points: &[ProbePoint]) -> Vec<usize> {
    let numbers = (0..solution.element_count()).map(|number| Rgb::splat(number as f32));
    let numbered = Solution {
        contributions: numbers.collect(),
        exposed: Vec::new(),
        ..solution.clone()
    };
    let probed = probe_points(&numbered, points, Part::Total).expect("it has a mesh");
    assert_eq!(probed.missing, 0, "points on no element");
    let csv = String::from_utf8(probed.csv).expect("plain text");
    values(&csv)
        .iter()
        .map(|number| number.r as usize)
        .collect()
}

/// Display codes of radiosities, `L = B / pi`.
fn shown(radiosity: impl IntoIterator<Item = Rgb>, exposure: f32) -> Vec<Codes> {
    let code = |value: f32| 255.0 * f64::from(srgb_encode(value * exposure * FRAC_1_PI));
    let pixels = radiosity
        .into_iter()
        .map(|value| value.to_array().map(code));
    pixels.collect()
}

/// Display codes of an RGB565 pixel.
fn codes_of(pixel: u16) -> Codes {
    let [r, g, b] = [pixel >> 11, pixel >> 5 & 63, pixel & 31].map(f64::from);
    [255.0 / 31.0 * r, 255.0 / 63.0 * g, 255.0 / 31.0 * b]
}

fn rms(a: &[Codes], b: &[Codes]) -> f64 {
    assert_eq!(a.len(), b.len());
    let pairs = a.as_flattened().iter().zip(b.as_flattened());
    let sum: f64 = pairs.map(|(a, b)| (a - b).powi(2)).sum();
    (sum / (3 * a.len()) as f64).sqrt()
}

/// The frame that the emulated device shows.
fn device_frame(input: &Input) -> Vec<u16> {
    let data = work().join("data");
    fs::create_dir_all(&data).expect("a folder that can be written to");
    input.write(&data);
    let built = build(TARGETS[2], &["cornell"], "");
    let told = String::from_utf8_lossy(&built.stderr);
    assert!(built.status.success(), "{told}");
    let (status, text) = emulate(TARGETS[2], "cornell");
    assert_eq!(status, Some(0), "{text}");
    let pixels = input.in_integers(&LEVELS);
    // The same pixels, then.
    assert_eq!(said(&text, "hash"), Some(hash(&pixels)), "{text}");
    pixels
}

/// The pictures from the reference to the device.
fn pictures(data: &Path) -> [Vec<Codes>; 6] {
    let scene = data.join("scenes/cornell_mitsuba/scene.obj");
    let scene = import::load(&scene, None).expect("a scene").scene;
    let solution = bake(&scene, &Settings::default(), &mut |_| {
        ControlFlow::Continue(())
    });
    let solution = solution.expect("a legal scene");
    let truth = data.join("truth/cornell_mitsuba");
    let points = fs::read(truth.join("points.csv")).expect("points");
    let points = read_points(&points).expect("points");
    let elements = elements(&solution, &points);

    let mut input = input(
        "cornell",
        &solution,
        Code::Display8.into(),
        Quantity::Radiosity,
    );
    input.levels = [LEVELS.to_vec(), LEVELS.to_vec()];
    let [emission] = solution.nominal_mix()[..] else {
        panic!("one lamp")
    };
    let atlas = Atlas::parse(&input.atlas).expect("an atlas");
    let packed = relit(&atlas, &[emission]);
    let brightest = packed.iter().map(|radiosity| radiosity.max_channel());
    let brightest = brightest.fold(0.0, f32::max) * FRAC_1_PI;
    // The table ends at twice the white; a twentieth is for the unit of the sums.
    input.exposure = input.exposure.min(1.9 / brightest);
    let frame = device_frame(&input);

    let truth = fs::read_to_string(truth.join("truth.csv")).expect("values");
    let gathered = probe_gathered(&solution, &points, Part::Total, RAYS).expect("a mesh");
    let gathered = String::from_utf8(gathered.csv).expect("plain text");
    let reflected = |at_points: Vec<Rgb>| {
        let radiosity = elements.iter().zip(at_points).map(|(element, irradiance)| {
            let element = &solution.mesh.elements[*element];
            element.reflectance * irradiance * emission
        });
        shown(radiosity, input.exposure)
    };
    let of_elements = elements.iter().map(|element| solution.element(*element)[0]);
    let floats = input.in_floats(&LEVELS);
    let in_codes = |pixels: &[u16]| elements.iter().map(|e| codes_of(pixels[*e])).collect();
    [
        reflected(values(&truth)),
        reflected(values(&gathered)),
        reflected(of_elements.collect()),
        shown(
            elements.iter().map(|element| packed[*element]),
            input.exposure,
        ),
        in_codes(&floats),
        in_codes(&frame),
    ]
}

#[test]
fn the_frame_of_a_device_is_as_far_from_the_reference_as_its_parts_say() {
    let Some(data) = data::data_dir() else { return };
    if !has_tools() {
        return;
    }
    let pictures = pictures(&data);
    let mut table = String::from("\ncornell_mitsuba on the M4F, rms in display codes\n");
    let (mut sum, mut faults) = (0.0, Vec::new());
    for ((part, most), pair) in PARTS.into_iter().zip(pictures.windows(2)) {
        let added = rms(&pair[0], &pair[1]);
        sum += added;
        table += &format!("{part:10} {added:.2}\n");
        if added > most {
            faults.push(format!("{part}: {added:.2}, at most {most}"));
        }
    }
    let [reference, .., frame] = &pictures;
    let all = rms(reference, frame);
    table += &format!("all        {all:.2}\n");
    // Not by a macro, whose output a passing test would swallow.
    let _ = std::io::stderr().write_all(table.as_bytes());
    assert!(faults.is_empty(), "{faults:#?}");
    assert!(all <= sum, "{all} of {sum}");
}
