//! The program from outside: what it writes, what it says, and how it ends.

mod command;
mod room;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;

use command::Folder;
use exr::prelude::read_first_flat_layer_from_file;
use image::RgbaImage;
use relume_host::solution::{self, Solution};
use room::{BULB, LIGHTS, POINTS};
use serde_json::{Value, json};

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

/// One row of a probe.
#[derive(Debug, PartialEq)]
struct Row {
    place: usize,
    light: String,
    value: [f32; 3],
}

/// The rows of a probe, whose header must be the right one.
fn rows(csv: &[u8], first: &str) -> Vec<Row> {
    let text = std::str::from_utf8(csv).expect("UTF-8");
    let (header, rest) = text.split_once('\n').expect("a header");
    assert_eq!(header, format!("{first},light,er,eg,eb"));
    rest.lines()
        .map(|line| {
            let cells: Vec<&str> = line.split(',').collect();
            let [place, light, er, eg, eb] = cells[..] else {
                panic!("{line}")
            };
            Row {
                place: place.parse().expect("a number"),
                light: light.to_owned(),
                value: [er, eg, eb].map(|cell| cell.parse().expect("a float")),
            }
        })
        .collect()
}

/// What `probe FILE --elements` says, with more options.
fn elements(folder: &Folder, file: &str, options: &str) -> Vec<Row> {
    let csv = folder.done(&format!("probe {file} --elements {options}"));
    rows(&csv, "element")
}

/// What `probe FILE --points` says about the room's points.
fn points(folder: &Folder, file: &str) -> Vec<Row> {
    let csv = folder.done(&format!("probe {file} --points points.csv"));
    rows(&csv, "point")
}

/// Asserts that every row of `found` is that of `expected` within a relative tolerance.
fn assert_close(found: &[Row], expected: &[Row], tolerance: f32) {
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().zip(expected) {
        assert_eq!(found.place, expected.place);
        assert_eq!(found.light, expected.light);
        for (a, b) in found.value.into_iter().zip(expected.value) {
            let is_close = (a - b).abs() <= tolerance * b;
            assert!(is_close, "{found:?} is not {expected:?}");
        }
    }
}

/// Channels of an EXR picture by name.
fn exr_channels(folder: &Folder, name: &str) -> BTreeMap<String, Vec<f32>> {
    let picture = read_first_flat_layer_from_file(folder.path().join(name)).expect(name);
    let channels = picture.layer_data.channel_data.list.into_iter();
    let channels = channels.map(|channel| {
        let values = channel.sample_data.values_as_f32().collect();
        (channel.name.to_string(), values)
    });
    channels.collect()
}

/// All values of a linear picture, channel by channel.
fn exr_values(folder: &Folder, name: &str) -> Vec<f32> {
    let channels = exr_channels(folder, name);
    assert!(channels.keys().eq(["B", "G", "R"]), "{:?}", channels.keys());
    channels.into_values().flatten().collect()
}

/// Asserts that pictures add up to their sum, pixel by pixel.
fn assert_sum(parts: &[Vec<f32>], sum: &[f32]) {
    let mean = sum.iter().sum::<f32>() / sum.len() as f32;
    assert!(mean > 0.0, "the picture is black");
    for part in parts {
        assert_eq!(part.len(), sum.len());
        let share = part.iter().sum::<f32>() / sum.len() as f32 / mean;
        assert!((0.01..0.99).contains(&share), "a part of {share}");
    }
    let is_wrong = |(pixel, sum): (usize, &f32)| {
        let found: f32 = parts.iter().map(|part| part[pixel]).sum();
        (found - sum).abs() > 1e-5 * sum + 1e-6 * mean
    };
    let wrong = sum.iter().enumerate().filter(|pixel| is_wrong(*pixel));
    assert_eq!(wrong.count(), 0, "of {} values", sum.len());
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

#[test]
fn without_arguments_the_cornell_box_lands_in_out() {
    let folder = Folder::new();
    let report = folder.json("");
    for key in ["lights", "elements", "patches", "shots"] {
        let count = report[key].as_u64();
        assert!(count.is_some_and(|n| n > 0), "{key}: {report}");
    }
    let files = folder.files();
    let size = |name: &str| files[name].len();
    assert_eq!(report["solution_bytes"], size("out/cornell.solution"));
    assert_eq!(report["atlas_bytes"], size("out/cornell.atlas"));
    let codes = report["max_error_codes"].as_f64().unwrap();
    assert!(codes > 0.0 && codes < 20.0, "{codes} display codes");

    // All files that it lists are there, and no others.
    let listed = report["files"].as_array().unwrap().iter();
    let mut listed: Vec<&str> = listed.map(|name| name.as_str().unwrap()).collect();
    listed.sort_unstable();
    assert!(files.keys().eq(&listed), "{listed:?}");
    let pictures = listed.iter().filter(|name| name.ends_with(".png"));
    assert!(pictures.clone().count() >= 9, "{listed:?}");
    for name in pictures {
        assert!(colours(&png(&files[*name])) > 100, "{name} shows nothing");
    }
    let text = String::from_utf8_lossy(&files["out/report.txt"]);
    assert!(text.contains("ceiling"), "{text}");

    // The layers of the lights add up to the picture of all of them.
    let layers = exr_channels(&folder, "out/lights.exr");
    assert_eq!(report["lights"], layers.len() / 3);
    for (channel, all_on) in exr_channels(&folder, "out/all-on.exr") {
        let end = format!(".{channel}");
        let of_lights = layers.iter().filter(|(name, _)| name.ends_with(&end));
        let of_lights: Vec<Vec<f32>> = of_lights.map(|(_, values)| values.clone()).collect();
        assert_sum(&of_lights, &all_on);
    }

    // Without --json, the same lands there and stdout stays empty.
    let second = Folder::new();
    let (stdout, stderr) = second.told("");
    assert!(stdout.is_empty());
    assert!(stderr.contains("ceiling"), "{stderr}");
    assert!(stderr.contains("out/"), "{stderr}");
    let timeless = |mut files: BTreeMap<String, Vec<u8>>| {
        files.remove("out/report.txt"); // it says how long the bake took
        files
    };
    let are_equal = timeless(files) == timeless(second.files());
    assert!(are_equal, "two runs differ");
}

#[test]
fn every_command_prints_one_json_object_and_leaves_stdout_empty_without() {
    let folder = with_scene();
    for command in [
        "bake room.obj --element 0.5",
        "pack room.solution",
        "relight room.atlas --size 8x6",
        "probe room.atlas --elements -o room.csv",
        "probe room.solution --points points.csv -o points.out",
        "info room.solution",
        "info room.atlas",
    ] {
        let report = folder.json(command);
        if let Some(file) = report["file"].as_str() {
            assert!(!folder.read(file).is_empty(), "{report}");
        }
        let (stdout, stderr) = folder.told(command);
        assert!(stdout.is_empty(), "{command}");
        // A probe into a file has nothing to say.
        assert!(
            !stderr.is_empty() || command.starts_with("probe"),
            "{command}"
        );
    }
    let help = String::from_utf8(folder.done("--help")).unwrap();
    assert!(help.contains("relight"), "{help}");
    assert!(folder.done("--version").starts_with(b"relume "));
}

#[test]
fn an_obj_and_a_glb_of_one_room_give_the_same_light() {
    let folder = with_scene();
    folder.write("bulb.toml", BULB);
    folder.write("room.glb", room::glb());
    // Rays would start elsewhere in quads that are put together in another order.
    let options = format!("{MESH} --residual 1e-6 --method rows");
    let obj = folder.json(&format!(
        "bake room.obj --lights bulb.toml -o obj {options}"
    ));
    let glb = folder.json(&format!("bake room.glb -o glb {options}"));
    assert_eq!(obj["lights"], 3);
    let repairs = ["quads put together from two triangles: 9"];
    assert_eq!(glb["repairs"], json!(repairs));
    for key in ["surfaces", "faces", "patches", "elements", "lights"] {
        assert_eq!(obj[key], glb[key], "{key}");
    }

    let [obj, glb] = ["obj", "glb"].map(|file| {
        let mut rows = points(&folder, file);
        rows.sort_by(|a, b| (a.place, &a.light).cmp(&(b.place, &b.light)));
        let lights = read_solution(&folder, file).lights.into_iter();
        let emissions = lights.map(|light| (light.name, light.emission.to_array()));
        (rows, emissions.collect::<BTreeMap<_, _>>())
    });
    assert_eq!(obj.0.len(), 9 * 3);
    assert!(obj.0.iter().all(|row| row.value.iter().all(|v| *v > 0.0)));
    assert_close(&glb.0, &obj.0, 1e-4);

    let pi = std::f32::consts::PI;
    assert_eq!(obj.1["ceiling"], [4.0 * pi, 3.5 * pi, 3.0 * pi]);
    assert_eq!(obj.1["bulb"], [5.0, 2.5, 1.25]);
    for (name, emission) in &obj.1 {
        for (a, b) in emission.iter().zip(glb.1[name]) {
            assert!((a - b).abs() <= 1e-6 * b, "{name}: {a} is not {b}");
        }
    }
}

#[test]
fn a_light_file_changes_nominal_emissions_and_nothing_else() {
    let folder = with_room();
    let dim = "[[light]]\nname = 'ceiling'\nemission = [0.5, 0.25, 0]\n";
    folder.write("dim.toml", dim);
    folder.done(&format!("bake room.obj --lights dim.toml -o dim {MESH}"));
    let bright = read_solution(&folder, "room.solution");
    let dim = read_solution(&folder, "dim");
    assert_eq!(dim.lights[0].emission.to_array(), [0.5, 0.25, 0.0]);
    assert_eq!(dim.lights[1], bright.lights[1]);
    assert_eq!(dim.contributions, bright.contributions);
}

#[test]
fn fewer_shots_leave_a_larger_residual() {
    let folder = with_scene();
    let bake = |options: &str| {
        let report = folder.json(&format!("bake room.obj {MESH} --method rows {options}"));
        assert_eq!(report["interrupted"], false);
        let shots = report["shots"].as_u64().unwrap();
        (shots, report["residual"].as_f64().unwrap())
    };
    let none = bake("--shots 0");
    let few = bake("--shots 20");
    let full = bake("");
    assert_eq!((none.0, few.0), (0, 20));
    assert!(
        none.1 > few.1 && few.1 > full.1,
        "{none:?} {few:?} {full:?}"
    );
    assert!(full.1 <= 1e-4, "{full:?}");
    let plain = bake("--plain --shots 300");
    assert_eq!(plain.0, 300);
    assert!(plain.1 > full.1 && plain.1 < none.1, "{plain:?}");
}

#[test]
fn an_atlas_is_what_was_asked_for() {
    let folder = with_room();
    let packed = |options: &str, code: &str| {
        let report = folder.json(&format!("pack room.solution -o a {options}"));
        assert_eq!(report["bytes"], folder.read("a").len());
        assert_eq!(report["code"], code);
        let error = report["max_error_codes"].as_f64().unwrap();
        assert!(error > 0.0 && error < 255.0, "{report}");
        let info = folder.json("info a");
        // The atlas states what packing said, and every light alone is one of the states.
        for key in ["max_error_codes", "codes_shown"] {
            assert_eq!(info[key], report[key], "{key}");
        }
        for light in info["per_light"].as_array().unwrap() {
            let alone = light["max_error_codes"].as_f64().unwrap();
            assert!(alone > 0.0 && alone <= error, "{light}");
        }
        info
    };
    let own = packed("--code exp8s", "exp8s");
    assert!(folder.read("a") == folder.read("room.atlas"));
    // One scale for all lights at their nominal strengths, or one for each.
    let ratio = |info: &Value| {
        let strengths = [0, 1].map(|light| {
            let light = &info["per_light"][light];
            let emission = light["emission"].as_array().unwrap().iter();
            let largest = emission.filter_map(Value::as_f64).fold(0.0, f64::max);
            light["curves"][0]["scale"].as_f64().unwrap() * largest
        });
        strengths[0] / strengths[1]
    };
    let one = packed("--code exp8", "exp8");
    assert!((ratio(&one) - 1.0).abs() < 1e-3, "{one}");
    assert!((ratio(&own) - 1.0).abs() > 0.1, "{own}");

    let bare = packed("--code exp8s --no-mesh", "exp8s");
    assert_eq!(bare["elements"], own["elements"]);
    assert_eq!(bare["faces"], 0);
    assert_eq!(bare["code_bytes"], own["code_bytes"]);
    assert!(bare["bytes"].as_u64() < own["bytes"].as_u64());
    let [bare, own] = ["a", "room.atlas"].map(|file| elements(&folder, file, ""));
    assert_close(&bare, &own, 0.0);
}

#[test]
fn info_counts_what_a_file_holds() {
    let folder = with_room();
    let solution = read_solution(&folder, "room.solution");
    let elements = solution.mesh.elements.len();
    for (file, kind) in [("room.solution", "solution"), ("room.atlas", "atlas")] {
        let info = folder.json(&format!("info {file}"));
        assert_eq!(info["kind"], kind);
        assert_eq!(info["bytes"], folder.read(file).len());
        assert_eq!(info["lights"], 2);
        assert_eq!(info["elements"], elements);
        assert_eq!(info["faces"], solution.mesh.faces.len());
        let lights = info["per_light"].as_array().unwrap();
        assert!(lights.iter().map(|light| &light["name"]).eq(LIGHTS));
    }
    let info = folder.json("info room.atlas");
    assert_eq!(info["flash"], info["bytes"]);
    assert_eq!(info["code_bytes"], elements * 2 * 3);
    assert_eq!(info["multiply_adds_per_frame"], elements * 2 * 3);
    assert_eq!(info["multiply_adds_per_changed_light"], elements * 3);
}

#[test]
fn pictures_of_the_lights_alone_add_up_to_the_picture_of_all() {
    let folder = with_room();
    for file in ["room.solution", "room.atlas"] {
        let picture = |options: &str| {
            folder.done(&format!("relight {file} -o a.exr {VIEW} {options}"));
            exr_values(&folder, "a.exr")
        };
        let alone = LIGHTS.map(|light| picture(&format!("--only {light}=1")));
        assert_sum(&alone, &picture(""));
    }
}

/// Radiance times pi over reflectance is the irradiance that a probe gathers with the same rays; with
/// exact far patches, as probes have them, the two differ by the noise of the rays.
#[test]
fn a_gathered_picture_shows_what_a_probe_gathers() {
    let folder = with_scene();
    // Patches as long as the room: none is far, and probes take rays alone, too.
    folder.done("bake room.obj --patch 4 --element 0.25");
    folder.done(&format!("bake room.obj {MESH} -o fine.solution"));
    // (point, normal, reflectance): half in the shadow of the screen on the floor; a wall; a corner.
    for (point, normal, reflectance) in [
        ("3.1,0,1.2", "0,1,0", [0.4, 0.25, 0.1]),
        ("2.1,1.1,0", "0,0,1", [0.75, 0.74, 0.7]),
        ("0,0.05,0.3", "1,0,0", [0.6, 0.1, 0.08]),
    ] {
        folder.write("point.csv", format!("x,y,z,nx,ny,nz\n{point},{normal}\n"));
        let eye = "--eye 3.3,2.2,2.4 --fov 1e-3 --size 1x1";
        // 0.1 %: the pixel's place is the point but for rounding, past which a few of 2048 rays end in
        // the next element. 3 %: rays alone, of a noise of some 1 % here.
        for (solution, tolerance) in [("room", 1e-3), ("fine", 0.03)] {
            folder.done(&format!(
                "relight {solution}.solution --gather --rays 2048 --only ceiling=1,1,1 {eye} \
                 --target {point} -o pixel.exr"
            ));
            let pixel = exr_values(&folder, "pixel.exr");
            let csv = folder.done(&format!(
                "probe {solution}.solution --gather --points point.csv"
            ));
            let probed = rows(&csv, "point").swap_remove(0);
            assert_eq!(probed.light, "ceiling");
            // Channels of the picture stand in the order of their names: blue first.
            let channels = pixel.iter().rev().zip(reflectance);
            for ((radiance, rho), expected) in channels.zip(probed.value) {
                let found = radiance * std::f32::consts::PI / rho;
                assert!(
                    (found - expected).abs() <= tolerance * expected,
                    "{solution}, {point}: {found} and {expected}"
                );
            }
        }
    }
}

#[test]
fn unset_lights_stay_nominal_and_only_darkens_the_others() {
    let folder = with_room();
    for extension in ["png", "exr"] {
        let picture = |options: &str| {
            let name = format!("picture.{extension}");
            folder.done(&format!("relight room.atlas -o {name} {VIEW} {options}"));
            folder.read(&name)
        };
        let nominal = picture("");
        let dimmed = picture("--set ceiling=0.5");
        let only = picture("--only sconce=1");
        assert!(nominal != dimmed && nominal != only && dimmed != only);
        assert!(nominal == picture("--set ceiling=1 --set sconce=1"));
        assert!(dimmed == picture("--set sconce=1 --set ceiling=0.5"));
        assert!(only == picture("--set ceiling=0"));
        // In any order, the others are dark first.
        assert!(dimmed == picture("--only sconce=1 --set ceiling=0.5"));
        assert!(dimmed == picture("--set ceiling=0.5 --only sconce=1"));
    }
}

#[test]
fn every_form_of_a_value_weighs_what_it_says() {
    let folder = with_room();
    // #bc is 0.503 in linear light (IEC 61966-2-1).
    let half = ((f64::from(0xbc) / 255.0 + 0.055) / 1.055).powf(2.4);
    let pi = std::f64::consts::PI;
    for (value, expected) in [
        ("1", [4.0, 3.5, 3.0]),
        ("0.5", [2.0, 1.75, 1.5]),
        ("0", [0.0; 3]),
        ("#ffffff", [4.0; 3]),
        ("#ff00bc", [4.0, 0.0, 4.0 * half]),
        ("2x#FF0000", [8.0, 0.0, 0.0]),
        ("1,0,3.5", [1.0 / pi, 0.0, 3.5 / pi]),
    ] {
        let relight = format!("relight room.atlas --size 4x3 --set ceiling={value}");
        let mix = &folder.json(&relight)["mix"];
        assert_eq!(mix[0]["name"], "ceiling");
        assert_eq!(mix[1]["name"], "sconce");
        for (channel, expected) in expected.into_iter().enumerate() {
            let found = mix[0]["weight"][channel].as_f64().unwrap() / pi;
            let is_close = (found - expected).abs() <= 1e-5;
            assert!(is_close, "{value}: {found} is not {expected}");
        }
    }
}

#[test]
fn pictures_have_the_size_camera_and_exposure_that_were_asked_for() {
    let folder = with_room();
    let report = folder.json("relight room.solution");
    assert_eq!(report["width"], 640);
    assert_eq!(report["height"], 480);
    assert_eq!(report["file"], "room.png");
    assert_eq!(png(&folder.read("room.png")).dimensions(), (640, 480));

    folder.write("view.toml", CAMERA);
    let relight = "relight room.solution -o a.png";
    let flags = folder.json(&format!("{relight} {VIEW}"));
    let picture = png(&folder.read("a.png"));
    let file = folder.json(&format!("{relight} --camera view.toml --size 80x60"));
    assert_eq!(file["camera"], flags["camera"]);
    assert!(png(&folder.read("a.png")) == picture);
    assert_eq!(picture.dimensions(), (80, 60));
    assert!(colours(&picture) > 500, "{} colours", colours(&picture));

    // Auto is the exposure that it reports; half of it is darker.
    let auto = flags["exposure"].as_f64().unwrap();
    let exposed = |exposure: f64| {
        folder.done(&format!("{relight} {VIEW} --exposure {exposure}"));
        png(&folder.read("a.png"))
    };
    assert!(exposed(auto) == picture);
    let darker = exposed(auto / 2.0);
    let mut channels = darker.iter().zip(picture.iter());
    assert!(channels.all(|(a, b)| a <= b) && darker != picture);
}

#[test]
fn probed_elements_are_the_contributions_in_their_order_and_their_bits() {
    let folder = with_room();
    let solution = read_solution(&folder, "room.solution");
    let rows = elements(&folder, "room.solution", "");
    assert_eq!(rows.len(), solution.contributions.len());
    for (number, (row, value)) in rows.iter().zip(&solution.contributions).enumerate() {
        assert_eq!(row.place, number / 2);
        assert_eq!(row.light, LIGHTS[number % 2]);
        assert_eq!(row.value, value.to_array());
    }
}

#[test]
fn an_atlas_stays_within_the_error_of_its_code() {
    let folder = with_room();
    let info = folder.json("info room.atlas");
    let [exact, packed] = ["room.solution", "room.atlas"].map(|file| {
        let mut rows = elements(&folder, file, "");
        rows.extend(points(&folder, file));
        rows
    });
    assert_eq!(exact.len(), packed.len());
    for (exact, packed) in exact.iter().zip(&packed) {
        assert_eq!(exact.place, packed.place);
        assert_eq!(exact.light, packed.light);
        let light = LIGHTS.iter().position(|name| *name == exact.light);
        let scale = &info["per_light"][light.unwrap()]["curves"][0]["scale"];
        let scale = scale.as_f64().unwrap();
        for (exact, packed) in exact.value.iter().zip(packed.value) {
            // c = round(255 (1 - e^-x)): half a code either way.
            let share = |value: f32| 1.0 - (-f64::from(value) / scale).exp();
            let codes = 255.0 * (share(*exact) - share(packed)).abs();
            assert!(codes <= 0.501, "{exact} became {packed}: {codes} codes");
            let largest = 255.0 * share(*exact);
            assert!(largest < 254.501, "{exact} saturates");
        }
    }
}

#[test]
fn probed_points_have_the_values_of_their_elements() {
    let folder = with_room();
    // Two of the room's points, one on no surface and one turned away from its surface.
    let two: String = POINTS.split_inclusive('\n').take(3).collect();
    folder.write("strays.csv", two + "0.3,1.2,2.2,0,1,0\n1.3,0,1.3,1,0,0\n");
    for file in ["room.solution", "room.atlas"] {
        let points = points(&folder, file);
        assert_eq!(points.len(), 9 * 2);
        for (number, row) in points.iter().enumerate() {
            assert_eq!(row.place, number / 2);
            assert_eq!(row.light, LIGHTS[number % 2]);
        }
        // Elements run from the first vertex to the fourth, and inside that to the second: the
        // floor's 16 along x and 12 along z, then the ceiling's 12 along z and 16 along x.
        let elements = elements(&folder, file, "");
        for (point, element) in [(0, 5 * 12 + 5), (1, 14 * 12 + 4), (2, 192 + 10 * 16 + 1)] {
            for light in 0..2 {
                let (point, element) = (&points[2 * point + light], &elements[2 * element + light]);
                assert_eq!(point.value, element.value, "{point:?} lies in {element:?}");
            }
        }

        let probe = format!("probe {file} --points strays.csv -o strays.out");
        let (_, warning) = folder.told(&probe);
        assert!(warning.starts_with("2 points"), "{warning}");
        assert_eq!(folder.json(&probe)["missing"], 2);
        let strays = rows(&folder.read("strays.out"), "point");
        assert_eq!(strays.len(), 4 * 2);
        assert_close(&strays[..4], &points[..4], 0.0);
        let mut values = strays[4..].iter().flat_map(|row| row.value);
        assert!(values.all(f32::is_nan), "{strays:?}");
    }
}

#[test]
fn direct_light_is_told_apart_where_it_was_kept_apart() {
    let folder = with_room();
    folder.done(&format!("bake room.obj --split-direct -o split {MESH}"));
    assert_eq!(folder.json("info split")["split_direct"], true);
    let total = elements(&folder, "split", "");
    let direct = elements(&folder, "split", "--direct");
    assert_close(&total, &elements(&folder, "room.solution", ""), 1e-5);
    assert_eq!(total.len(), direct.len());
    let mut dark = 0;
    for (total, direct) in total.iter().zip(&direct) {
        assert_eq!(total.place, direct.place);
        assert_eq!(total.light, direct.light);
        // Direct light is white, and some of it falls into the shadow of the screen.
        assert_eq!(direct.value, [direct.value[0]; 3]);
        let parts = total.value.into_iter().zip(direct.value);
        for (total, direct) in parts {
            let is_part = direct >= 0.0 && direct <= total * 1.000_01;
            assert!(is_part, "{direct} of {total}");
        }
        dark += usize::from(direct.value[0] == 0.0);
    }
    let all = direct.len();
    assert!(dark > 0 && dark < all / 2, "{dark} of {all} are dark");

    for file in ["room.solution", "room.atlas"] {
        let line = folder.refused(&format!("probe {file} --elements --direct -o no.csv"));
        assert!(line.contains(file), "{line}");
        assert!(line.contains("direct light"), "{line}");
    }
}

#[test]
fn below_a_bulb_there_is_what_its_intensity_and_its_distance_give() {
    let folder = with_scene();
    folder.write("bulb.toml", BULB);
    let bake = "bake room.obj --lights bulb.toml --split-direct -o split";
    folder.done(&format!("{bake} {MESH}"));
    // The bulb hangs 2 m above the corner of four elements of 0.25 m.
    folder.write("below.csv", "x,y,z,nx,ny,nz\n1.3,0,1.3,0,1,0\n");
    let csv = folder.done("probe split --points below.csv --direct");
    let rows = rows(&csv, "point");
    let bulb = rows.iter().find(|row| row.light == "bulb").unwrap();
    // cos / r^2 from 1 W/sr, averaged over the element: 2 (4 + x^2 + z^2)^-1.5, x and z to 1/4.
    let expected = 0.25 * (1.0 - 1.5 / 4.0 * 2.0 / 48.0);
    let is_close = (bulb.value[0] / expected - 1.0).abs() < 1e-3;
    assert!(is_close, "{bulb:?} is not {expected}");
}

#[test]
fn threads_and_method_do_not_change_a_byte() {
    let folder = with_scene();
    folder.write("bulb.toml", BULB);
    let bake = |options: &str, method: &str| {
        let bake = "bake room.obj --lights bulb.toml -o x";
        let report = folder.json(&format!("{bake} {MESH} {options} --method {method}"));
        assert_eq!(report["method"], method);
        folder.read("x")
    };
    for method in ["gather", "rows"] {
        let expected = bake("", method);
        for threads in [1, 2, 7] {
            let found = bake(&format!("--threads {threads}"), method);
            assert!(found == expected, "--method {method} --threads {threads}");
        }
    }
    assert!(bake("", "device") == bake("", "rows"));
}

#[test]
fn no_output_replaces_a_file_of_another_kind() {
    let folder = with_room();
    let before = folder.files();
    for (command, file) in [
        ("bake room.obj -o room.mtl", "room.mtl"),
        ("bake room.obj --keep-rows room.obj -o new", "room.obj"),
        ("bake room.obj --keep-rows points.csv -o new", "points.csv"),
        ("pack room.solution -o room.mtl", "room.mtl"),
    ] {
        let line = folder.refused(command);
        assert!(line.contains(file), "{line}");
    }
    folder.misused("bake room.obj --keep-rows new -o new");
    folder.misused("bake room.obj --residual 2 -o new");
    folder.misused("probe room.solution --elements --gather");
    folder.misused("relight room.solution --rays 64");
    assert!(folder.files() == before, "something was written");
}

#[cfg(unix)]
#[test]
fn names_that_are_no_text_are_written_all_the_same() {
    use std::os::unix::ffi::OsStrExt as _;
    let folder = with_room();
    let name = std::ffi::OsStr::from_bytes(b"n\xff.atlas");
    let mut command = folder.command("pack room.solution --json -o");
    let output = command.arg(name).output().expect("relume starts");
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    assert!(folder.path().join(name).is_file());
}

#[test]
fn a_light_that_changes_is_solved_again_as_in_a_whole_bake() {
    let folder = with_scene();
    folder.write("bulb.toml", BULB);
    let moved = BULB.replace("[1.25, 2.0", "[2.25, 1.5");
    assert_ne!(moved, BULB, "where the bulb hangs");
    folder.write("moved.toml", moved);
    let bake = format!("bake room.obj {MESH}");
    let old = folder.json(&format!(
        "{bake} --lights bulb.toml --keep-rows r.rows -o old"
    ));
    let whole = folder.json(&format!("{bake} --lights moved.toml -o whole"));
    assert_eq!(old["elements"], whole["elements"]);
    assert_eq!(old["shots"], whole["shots"], "as many rays");
    let update = "bake room.obj --lights moved.toml --update old --rows r.rows";
    let (_, said) = folder.told(&format!("{update} -o new"));
    assert!(said.contains("lights solved again: 1"), "{said}");
    let [old, new, whole] = ["old", "new", "whole"].map(|file| elements(&folder, file, ""));
    assert!(new == whole && new != old);

    // Rows of another mesh, other walls, damaged rows.
    folder.done("bake room.obj --element 0.5 --keep-rows other.rows -o other");
    for (wrong, what) in [
        ("bake room.obj --update old --rows other.rows", "other.rows"),
        ("bake room.obj --update old --rows room.obj", "room.obj"),
        ("bake boxes.obj --update old --rows r.rows", "boxes.obj"),
    ] {
        folder.write(
            "boxes.obj",
            "mtllib room.mtl\nusemtl white\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
        );
        let line = folder.refused(&format!("{wrong} -o no"));
        assert!(line.contains(what), "{line}");
    }
    folder.misused("bake room.obj --update old -o no");
}

#[test]
fn a_dash_writes_to_stdout_what_a_file_would_hold() {
    let folder = with_room();
    for (command, file) in [
        (format!("bake room.obj {MESH}"), "s"),
        ("pack room.solution".to_owned(), "a"),
        ("relight room.atlas --size 40x30".to_owned(), "p.png"),
        ("probe room.atlas --elements".to_owned(), "e.csv"),
        ("probe room.atlas --points points.csv".to_owned(), "p.csv"),
    ] {
        folder.done(&format!("{command} -o {file}"));
        let stdout = folder.done(&format!("{command} -o -"));
        assert!(stdout == folder.read(file), "{command}");
        let line = folder.misused(&format!("{command} -o - --json"));
        assert!(line.contains("--json"), "{line}");
    }
    // A probe goes there anyway.
    let stdout = folder.done("probe room.atlas --elements");
    assert!(stdout == folder.read("e.csv"));
    folder.misused("probe room.atlas --elements --json");
}

#[cfg(unix)]
#[test]
fn an_interrupted_bake_is_byte_for_byte_what_its_shots_give() {
    for method in ["gather", "rows"] {
        interrupt_until_it_counts(&format!("bake room.obj --element 0.1 --method {method}"));
    }
}

/// Interrupts a bake of 6000 elements until the signal comes between the first row and the last.
#[cfg(unix)]
fn interrupt_until_it_counts(bake: &str) {
    use std::process::{Command, Stdio};
    use std::time::Instant;

    let folder = with_scene();
    let start = Instant::now();
    let whole = folder.json(&format!("{bake} -o whole"));
    // How fast the machine is at any time does not matter: after a signal that came too early or too late, there is another.
    let mut patience = start.elapsed().mul_f32(0.6);
    for _ in 0..20 {
        let mut command = folder.command(&format!("{bake} -o part --json"));
        let command = command.stdout(Stdio::piped()).stderr(Stdio::piped());
        let child = command.spawn().expect("relume starts");
        std::thread::sleep(patience);
        let mut kill = Command::new("kill");
        let kill = kill.args(["-INT", &child.id().to_string()]);
        kill.status().expect("there is a `kill`");
        let output = child.wait_with_output().expect("relume ends");
        let stderr = String::from_utf8(output.stderr).expect("UTF-8");
        match output.status.code() {
            Some(130) => {
                let report = command::one_object(&output.stdout);
                let shots = report["shots"].as_u64().unwrap();
                assert_eq!(report["interrupted"], true);
                assert!(shots < whole["shots"].as_u64().unwrap(), "{report}");
                let told = format!("--shots {shots} ");
                assert!(stderr.contains(&told), "{stderr}");
                if shots > 8 {
                    folder.done(&format!("{bake} -o told --shots {shots}"));
                    let part = folder.read("part");
                    let is_told = part == folder.read("told");
                    assert!(is_told, "not what --shots {shots} gives");
                    assert!(part != folder.read("whole"));
                    assert_eq!(folder.files().len(), 3 + 3, "something is left");
                    return;
                }
                patience = patience.mul_f32(1.5);
            }
            Some(0) => patience = patience.mul_f32(0.7),
            // The signal came before anyone listened.
            None => {
                assert_eq!(folder.files().len(), 3 + 1, "something is left");
                patience = patience.mul_f32(1.5);
            }
            code => panic!("exit {code:?}: {stderr}"),
        }
        let _ = fs::remove_file(folder.path().join("part"));
    }
    panic!("never interrupted in time");
}

/// Runs the program, sends it Ctrl-C as soon as `is_time`, and waits for its end.
#[cfg(unix)]
fn interrupted(
    mut command: std::process::Command,
    is_time: impl Fn() -> bool,
) -> std::process::Output {
    use std::process::{Command, Stdio};

    let command = command.stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().expect("relume starts");
    while !is_time() && child.try_wait().expect("a child").is_none() {
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    let mut kill = Command::new("kill");
    let kill = kill.args(["-INT", &child.id().to_string()]);
    kill.status().expect("there is a `kill`");
    child.wait_with_output().expect("relume ends")
}

#[cfg(unix)]
#[test]
fn a_bake_that_is_interrupted_before_its_first_row_writes_nothing() {
    use std::time::{Duration, Instant};

    // The insides of 2000 closed boxes under a lamp: no light to be found in any of them.
    const CORNERS: [&str; 6] = [
        "-8 -7 -5 -6",
        "-4 -3 -1 -2",
        "-8 -7 -3 -4",
        "-6 -5 -1 -2",
        "-8 -6 -2 -4",
        "-7 -5 -1 -3",
    ];
    let mut obj = "mtllib room.mtl\n".to_owned();
    for number in 0..2000 {
        for corner in 0..8 {
            let (x, y) = (
                number % 50 * 2 + corner % 2,
                number / 50 * 2 + corner / 2 % 2,
            );
            obj += &format!("v {x} {y} {}\n", corner / 4);
        }
        obj += "usemtl white\n";
        obj.extend(CORNERS.map(|face| format!("f {face}\n")));
    }
    obj += "v 0 0 9\nv 0 9 9\nv 9 9 9\nv 9 0 9\nusemtl ceiling\nf -4 -3 -2 -1\n";
    let folder = with_scene();
    folder.write("boxes.obj", obj);
    let before = folder.files();
    // A signal that comes before anyone listens ends the program as well; then there is another.
    for patience in [0.2, 0.5, 1.0, 2.0] {
        let start = Instant::now();
        let is_time = || start.elapsed() > Duration::from_secs_f64(patience);
        let output = interrupted(folder.command("bake boxes.obj --json"), is_time);
        let stderr = String::from_utf8(output.stderr).expect("UTF-8");
        assert!(folder.files() == before, "it wrote");
        if output.status.code().is_none() {
            continue;
        }
        assert_eq!(output.status.code(), Some(130), "{stderr}");
        assert!(
            stderr.starts_with("interrupted before the first row"),
            "{stderr}"
        );
        assert_eq!(stderr.lines().count(), 1, "{stderr}");
        assert_eq!(command::one_object(&output.stdout)["interrupted"], true);
        return;
    }
    panic!("nobody ever listened");
}

#[cfg(unix)]
#[test]
fn a_main_job_that_is_interrupted_stops_before_its_next_file() {
    let folder = Folder::new();
    let picture = folder.path().join("out/light-ceiling.png");
    let output = interrupted(folder.command("--json"), || picture.exists());
    let stderr = String::from_utf8(output.stderr).expect("UTF-8");
    assert_eq!(output.status.code(), Some(130), "{stderr}");
    assert_eq!(stderr.lines().count(), 1, "{stderr}");
    let report = command::one_object(&output.stdout);
    assert_eq!(report["interrupted"], true);
    let files = folder.files();
    let listed = report["files"].as_array().unwrap();
    let mut listed: Vec<&str> = listed.iter().map(|name| name.as_str().unwrap()).collect();
    assert!(listed[2] == "out/light-ceiling.png", "{listed:?}");
    assert!(listed.len() < 10, "it went on: {listed:?}");
    listed.sort_unstable();
    assert!(files.keys().eq(&listed), "{listed:?}");
}

#[test]
fn light_that_reaches_nothing_is_told() {
    const OBJ: &str = "mtllib room.mtl\nv 0 0 0\nv 0 0 4\nv 4 0 4\nv 4 0 0\n\
        v 1 2 1\nv 3 2 1\nv 3 2 3\nv 1 2 3\n";
    let folder = with_scene();
    let bulb = |y: f32| {
        let entry = format!("name = 'bulb'\nkind = 'point'\nposition = [1, {y}, 1]\n");
        folder.write("bulb.toml", format!("[[light]]\n{entry}emission = 1\n"));
    };
    let scene = |faces: &str| folder.write("floor.obj", OBJ.to_owned() + faces);
    let white = "usemtl white\nf 1 2 3 4\n";
    let down = "usemtl ceiling\nf 5 6 7 8\n";
    let up = "usemtl sconce\nf 8 7 6 5\n";
    let bake = "bake floor.obj --element 0.5 -o floor";

    for (faces, expected) in [
        (
            up.to_owned() + white,
            "light reaches no surface: turn lamps",
        ),
        (down.to_owned(), "no surface reflects light: give"),
        (down.to_owned() + up, "no surface reflects light: give"),
    ] {
        scene(&faces);
        let line = folder.refused(bake);
        assert!(line.starts_with("relume: floor.obj: "), "{line}");
        assert!(line.contains(expected), "{line}");
    }
    // On the floor is neither above nor below it.
    scene(white);
    let with_bulb = format!("{bake} --lights bulb.toml");
    bulb(0.0);
    assert!(
        folder
            .refused(&with_bulb)
            .contains("light reaches no surface")
    );
    for y in [1e-3, -1e-3] {
        bulb(y);
        assert_eq!(folder.json(&with_bulb)["unlit"], json!([]), "{y}");
    }

    scene(&(down.to_owned() + up + white));
    bulb(0.0);
    assert_eq!(folder.json(&with_bulb)["unlit"], json!(["sconce", "bulb"]));
    let (_, warning) = folder.told(&with_bulb);
    let expected = "floor.obj: lights that reach no surface: sconce, bulb\n";
    assert!(warning.starts_with(expected), "{warning}");
    // What was not shot yet may still land.
    let report = folder.json(&format!("{with_bulb} --plain --shots 0"));
    assert_eq!(report["unlit"], json!(["bulb"]));
    scene(&(down.to_owned() + white));
    assert_eq!(folder.json(bake)["unlit"], json!([]));
}

#[test]
fn wrong_scenes_are_one_line_and_exit_1() {
    let folder = with_scene();
    let obj = room::obj(false);
    let with_materials = |name: &str, mtl: &str| {
        folder.write(&format!("{name}.mtl"), mtl);
        let obj = obj.replace("room.mtl", &format!("{name}.mtl"));
        folder.write(&format!("{name}.obj"), obj);
    };
    folder.write("room.txt", &obj);
    folder.write("nan.obj", obj.replacen("v 4 0 3", "v 4 NaN 3", 1));
    folder.write("huge.obj", obj.replacen("v 4 0", "v 4e10 0", 1));
    folder.write("index.obj", obj.clone() + "f 1 2 999\n");
    folder.write("empty.obj", "");
    folder.write("latin.obj", b"v 0 0 0\n# caf\xe9\n");
    with_materials("dark", &room::mtl().replace("Ke", "# Ke"));
    with_materials("minus", "newmtl white\nKd -1 0 0\n");
    let glb = room::glb();
    folder.write("cut.glb", &glb[..glb.len() / 2]);
    folder.write("text.gltf", &obj);
    let needs = r#"{"asset": {"version": "2.0"}, "extensionsRequired": ["EXT_no_such"]}"#;
    folder.write("needs.gltf", needs);
    fs::create_dir(folder.path().join("folder.obj")).unwrap();
    folder.write("out.solution", "RELUMESO as it was");
    for (scene, expected) in [
        ("missing.obj", "missing.obj: cannot be read: "),
        ("missing.glb", "missing.glb: cannot be read: "),
        ("folder.obj", "folder.obj: cannot be read: "),
        ("room.txt", "room.txt: not a known kind"),
        ("nan.obj", "line 4: vertex (4, NaN, 3) is not finite"),
        ("index.obj", "999"),
        ("empty.obj", "empty.obj: no usable face"),
        ("latin.obj", "latin.obj, line 2: not UTF-8"),
        ("huge.obj", "huge.obj: vertex (4e10, 0e0, "),
        ("dark.obj", "dark.obj: the scene has no light"),
        ("minus.obj", "minus.mtl, material \"white\""),
        ("cut.glb", "cut.glb"),
        ("text.gltf", "text.gltf"),
        ("needs.gltf", "EXT_no_such"),
    ] {
        let line = folder.refused(&format!("bake {scene} -o out.solution"));
        assert!(line.contains(expected), "{line}");
        let name = scene.split('.').next().unwrap();
        assert_eq!(line.matches(name).count(), 1, "told twice: {line}");
        assert!(line.matches("os error").count() <= 1, "told twice: {line}");
    }
}

#[test]
fn wrong_light_files_are_one_line_and_exit_1() {
    let folder = with_scene();
    let new = "[[light]]\nname = 'lamp'\nemission = 1\n";
    let old = "[[light]]\nname = 'sconce'\n";
    for (text, expected) in [
        ("[[light]\n".to_owned(), "lights.toml, line 1"),
        (
            format!("{old}emission = [1, -1, 1]"),
            "light 1 (\"sconce\")",
        ),
        (format!("{old}emission = nan"), "light 1 (\"sconce\")"),
        (format!("{old}emission = [1, 2]"), "light 1 (\"sconce\")"),
        (new.to_owned(), "the scene has no light of that name"),
        (format!("{new}kind = 'moon'"), "moon"),
        (format!("{new}kind = 'sun'"), "needs `direction"),
        (format!("{new}kind = 'sky'\ncolour = 1"), "colour"),
        (format!("{new}kind = 'sky'\nangle = 1"), "angle"),
    ] {
        folder.write("lights.toml", text);
        let line = folder.refused("bake room.obj --lights lights.toml");
        assert!(line.contains("lights.toml"), "{line}");
        assert!(line.contains(expected), "{line}");
    }
    let line = folder.refused("bake room.obj --lights none.toml");
    assert!(line.contains("none.toml: cannot be read"), "{line}");
}

#[test]
fn what_cannot_be_done_with_a_file_is_one_line_and_exit_1() {
    let folder = with_room();
    folder.done("pack room.solution --no-mesh -o bare.atlas");
    folder.write("bad.csv", "x,y,z\n1,2,3\n");
    folder.write("zero.csv", "x,y,z,nx,ny,nz\n1,2,3,0,0,0\n");
    folder.write("words.csv", "x,y,z,nx,ny,nz\n\n\n1,2,3,0,1,up\n");
    folder.write("void.csv", "");
    folder.write("bad.toml", "eye = 1\n");
    folder.write("flat.toml", CAMERA.replace("fov = 1", "fov = 9"));
    for (command, expected) in [
        ("pack none.solution", "none.solution: cannot be read"),
        ("pack room.atlas -o b", "room.atlas: this is an atlas"),
        ("pack room.obj -o b", "room.obj: neither a solution nor"),
        ("relight none.atlas", "none.atlas: cannot be read"),
        ("relight room.obj", "room.obj: neither a solution nor"),
        ("relight bare.atlas", "bare.atlas: it carries no mesh"),
        (
            "relight room.atlas --set x=1",
            "room.atlas: there is no light `x`",
        ),
        (
            "relight room.solution --only x=1",
            "lights are: ceiling, sconce",
        ),
        (
            "relight room.atlas -o a.jpg",
            "a.jpg: a picture ends in .png or .exr",
        ),
        ("relight room.atlas --camera none.toml", "none.toml"),
        ("relight room.atlas --camera bad.toml", "bad.toml"),
        (
            "relight room.atlas --camera flat.toml",
            "flat.toml: the field of view 9 is outside",
        ),
        (
            "relight room.atlas --fov -1",
            "field of view -1 is outside (0, pi) radians",
        ),
        ("relight room.atlas --set \u{1b}=1", "`\\u{1b}`"),
        ("info es\u{1b}cape", "es\\u{1b}cape: cannot be read"),
        (
            "relight room.atlas --gather",
            "room.atlas: an atlas does not keep what --gather needs",
        ),
        ("relight room.atlas --size 0x10", "0 x 10"),
        ("relight room.atlas --size 20000x10", "16384"),
        ("relight room.atlas --fov 4", "field of view 4"),
        ("relight room.atlas --eye nan,0,0", "finite"),
        (
            "relight room.atlas --eye 1,1,1 --target 1,1,1",
            "same point",
        ),
        (
            "probe bare.atlas --points points.csv",
            "bare.atlas: it carries no mesh",
        ),
        (
            "probe room.atlas --points none.csv",
            "none.csv: cannot be read",
        ),
        (
            "probe room.atlas --points bad.csv",
            "bad.csv: line 1: the header is missing",
        ),
        ("probe room.atlas --points void.csv", "void.csv: line 1"),
        ("probe room.atlas --points zero.csv", "zero.csv: line 2"),
        ("probe room.atlas --points words.csv", "words.csv: line 4"),
        ("info none.atlas", "none.atlas: cannot be read"),
        ("info room.mtl", "room.mtl: neither a solution nor"),
    ] {
        let line = folder.refused(command);
        assert!(line.contains(expected), "{line}");
        for part in ["os error", "record", "toml", "light", "16384"] {
            assert!(line.matches(part).count() <= 2, "told twice: {line}");
        }
    }
    // What an atlas without a mesh is good for.
    assert_eq!(elements(&folder, "bare.atlas", "").len(), 2 * 1016);
    folder.json("info bare.atlas");
}

#[test]
fn an_input_is_never_overwritten() {
    let folder = with_room();
    folder.write("view.toml", CAMERA);
    fs::create_dir(folder.path().join("sub")).unwrap();
    #[cfg(unix)]
    std::os::unix::fs::symlink("room.solution", folder.path().join("link")).unwrap();
    for command in [
        "bake room.obj -o room.obj",
        "bake room.obj -o sub/../room.obj",
        "pack room.solution -o room.solution",
        "pack room.solution -o ./room.solution",
        "relight room.atlas -o room.atlas",
        "relight room.atlas --camera view.toml -o view.toml",
        "probe room.atlas --elements -o room.atlas",
        "probe room.atlas --points points.csv -o points.csv",
        #[cfg(unix)]
        "pack room.solution -o link",
    ] {
        let line = folder.refused(command);
        assert!(line.contains("is an input"), "{command}: {line}");
    }
}

#[test]
fn names_of_lights_may_begin_with_a_dash() {
    let folder = with_scene();
    folder.write("room.mtl", room::mtl().replace("sconce", "-dash"));
    folder.write("room.obj", room::obj(false).replace("sconce", "-dash"));
    folder.done("bake room.obj --element 1");
    for option in ["--set", "--only"] {
        let command = format!("relight room.solution --size 4x3 {option} -dash=1,0,0");
        let mix = &folder.json(&command)["mix"];
        assert_eq!(mix[1], json!({"name": "-dash", "weight": [1.0, 0.0, 0.0]}));
    }
}

#[test]
fn an_output_that_cannot_be_written_is_one_line_and_exit_1() {
    let folder = with_room();
    fs::create_dir(folder.path().join("folder.png")).unwrap();
    for command in [
        "bake room.obj --element 1",
        "pack room.solution",
        "relight room.atlas --size 8x6",
        "probe room.atlas --elements",
    ] {
        for output in ["folder.png", "none/such.png", "room.obj/such.png"] {
            let line = folder.refused(&format!("{command} -o {output}"));
            let expected = format!("relume: {output}: cannot be written: ");
            assert!(line.starts_with(&expected), "{line}");
            assert!(!line.contains(".tmp"), "{line}");
        }
    }
    // A file stands where the main job wants a folder.
    folder.write("out", "");
    let before = folder.files();
    let output = folder.command("").output().unwrap();
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{stderr}");
    assert!(stderr.starts_with("relume: out: "), "{stderr}");
    assert_eq!(stderr.lines().count(), 1, "{stderr}");
    assert!(folder.files() == before);
}

/// Nobody reads, or the disk is full: an error where data are lost, and never a panic.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_behind_stdout_or_stderr_is_no_panic() {
    let folder = with_room();
    let full = || fs::File::create("/dev/full").expect("Linux has it");
    for command in ["info room.atlas --json", "probe room.atlas --elements"] {
        let output = folder.command(command).stdout(full()).output().unwrap();
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{stderr}");
        let last = stderr.lines().last().unwrap();
        assert!(last.starts_with("relume: -: cannot be written"), "{stderr}");
        assert!(!stderr.contains("panicked"), "{stderr}");
    }
    let mut bake = folder.command("bake room.obj --element 1 -o silent");
    let output = bake.stderr(full()).output().unwrap();
    assert_eq!(output.status.code(), Some(0));
    assert!(!folder.read("silent").is_empty());
}

#[test]
fn damaged_files_are_refused_by_every_command() {
    const COMMANDS: [&str; 5] = [
        "info damaged",
        "pack damaged -o out.atlas",
        "relight damaged -o out.png",
        "probe damaged --elements -o out.csv",
        "probe damaged --points points.csv -o out.csv",
    ];
    let folder = with_room();
    for name in ["room.solution", "room.atlas"] {
        let whole = folder.read(name);
        let length = whole.len();
        let cuts = [
            0,
            3,
            8,
            9,
            40,
            length / 4,
            length / 2,
            length - 4,
            length - 1,
        ];
        let mut damaged: Vec<Vec<u8>> = cuts.map(|cut| whole[..cut].to_vec()).to_vec();
        let mut change = |change: &dyn Fn(&mut Vec<u8>)| {
            damaged.push(whole.clone());
            change(damaged.last_mut().expect("just pushed"));
        };
        for part in 0..12 {
            change(&|bytes| bytes[part * length / 12 + part] ^= 1 << (part % 8));
        }
        change(&|bytes| bytes.push(0));
        change(&|bytes| bytes[8..10].fill(0xff)); // a later version
        change(&|bytes| bytes[12..32].fill(0xff)); // counts that no memory holds
        for (bytes, number) in damaged.iter().zip(0..) {
            assert!(*bytes != whole);
            folder.write("damaged", bytes);
            let line = folder.refused(COMMANDS[number % COMMANDS.len()]);
            let is_named = line.contains("damaged: ");
            assert!(is_named, "{name}, case {number}: {line}");
        }
    }
}

#[test]
fn wrong_usage_is_exit_2() {
    let folder = with_room();
    for command in [
        "--nothing",
        "unbake",
        "bake",
        "bake room.obj --nothing",
        "bake room.obj room.obj",
        "bake room.obj --lights",
        "bake room.obj --element 0",
        "bake room.obj --element nan",
        "bake room.obj --patch=-1",
        "bake room.obj --residual 0",
        "bake room.obj --shots 1.5",
        "bake room.obj --threads 0",
        "bake room.obj --method magic",
        "pack",
        "pack room.solution --code zip",
        "pack room.solution --code ceiling=zip",
        "pack room.solution --code tiles --code exp8",
        "pack room.solution --code tiles --max-error 1",
        "pack room.solution --code tiles --budget 1000",
        "pack room.solution --max-error 1 --budget 1000",
        "pack room.solution --max-error 0",
        "pack room.solution --budget many",
        "relight room.atlas --set ceiling",
        "relight room.atlas --set ceiling=-1",
        "relight room.atlas --set ceiling=#ff",
        "relight room.atlas --size large",
        "relight room.atlas --exposure dark",
        "relight room.atlas --eye 1,2",
        "relight room.atlas --eye 1,2,3 --camera view.toml",
        "probe room.atlas",
        "probe room.atlas --elements --points points.csv",
    ] {
        folder.misused(command);
        folder.misused(&format!("--json {command}"));
    }
}

#[test]
fn any_number_of_lights_is_handled_or_refused() {
    let folder = Folder::new();
    folder.write(
        "floor.obj",
        "v 0 0 0\nv 0 0 1\nv 1 0 1\nv 1 0 0\nf 1 2 3 4\n",
    );
    let lights = |count: usize, name: &dyn Fn(usize) -> String| {
        let entry = |i| {
            let place = format!("kind='sun'\ndirection=[{i},-9,0]\nemission=1\n");
            format!("[[light]]\nname='{}'\n{place}", name(i))
        };
        folder.write("lights.toml", (0..count).map(entry).collect::<String>());
    };
    let own = |i: usize| format!("sun_{i}");
    let bake = "bake floor.obj --lights lights.toml --element 0.5";
    lights(1_000_000, &own);
    let line = folder.refused(bake);
    assert!(line.contains("lights.toml: 1000000 lights"), "{line}");
    lights(70_000, &own);
    let line = folder.refused(bake);
    assert!(line.contains("lights.toml: 70000 lights"), "{line}");

    // One group of as many, and as many lights as there are tags.
    lights(70_000, &|_| "all".to_owned());
    assert_eq!(folder.json(bake)["lights"], 1);
    lights(65_535, &own);
    let report = folder.json(bake);
    assert_eq!(report["lights"], 65_535);
    assert_eq!(report["elements"], 4);
    assert_eq!(folder.json("pack floor.solution")["lights"], 65_535);
    assert_eq!(elements(&folder, "floor.atlas", "").len(), 4 * 65_535);
    let relight = "relight floor.atlas --size 8x6 --only";
    let line = folder.refused(&format!("{relight} sun=1"));
    assert!(line.len() < 400, "{line}");
    let mix = &folder.json(&format!("{relight} sun_65534=2"))["mix"];
    assert_eq!(mix[0]["weight"], json!([0.0, 0.0, 0.0]));
    assert_eq!(mix[65_534]["weight"], json!([2.0, 2.0, 2.0]));
}

#[test]
fn a_mesh_too_fine_for_the_machine_is_refused() {
    let folder = with_scene();
    for (options, expected) in [
        ("--element 0.0001", "33554432"),
        ("--element 0.0001 --patch 1", "33554432"),
        ("--element 1e-7", "65535 elements"),
    ] {
        let line = folder.refused(&format!("bake room.obj {options}"));
        assert!(line.starts_with("relume: room.obj: "), "{line}");
        assert!(line.contains(expected), "{line}");
    }
}

#[test]
fn dirty_scenes_are_repaired_and_counted() {
    let folder = with_scene();
    let bake = |name: &str| {
        let report = folder.json(&format!("bake {name}.obj --element 0.5"));
        report["repairs"].clone()
    };
    assert_eq!(bake("room"), json!([]));

    // Faces without an area: a point, a line, and a vertex twice.
    let flat = "v 1 1 1\nv 2 1 1\nv 3 1 1\nusemtl red\nf -3 -3 -3\nf -3 -2 -1\nf -3 -2 -2\n";
    folder.write("flat.obj", room::obj(false) + flat);
    let repairs = bake("flat");
    let mut lines = repairs.as_array().unwrap().iter();
    assert!(
        lines.any(|line| line == "faces without area dropped: 3"),
        "{repairs}"
    );
    assert!(folder.read("flat.solution") == folder.read("room.solution"));

    // White is brighter than anything that is; five quads have it.
    let bright = room::mtl().replace("Kd 0.75 0.74 0.7", "Kd 1 1.5 0.98");
    folder.write("bright.mtl", bright);
    let obj = room::obj(false).replace("room.mtl", "bright.mtl");
    folder.write("bright.obj", obj);
    let clamped = "surfaces with reflectance lowered to 0.98: 4";
    assert_eq!(bake("bright"), json!([clamped]));
    let (_, stderr) = folder.told("bake bright.obj --element 0.5");
    assert!(
        stderr.contains(&format!("bright.obj: {clamped}\n")),
        "{stderr}"
    );
    let expected = elements(&folder, "room.solution", "");
    let bright = elements(&folder, "bright.solution", "");
    for (bright, expected) in bright.iter().zip(&expected) {
        let mut channels = bright.value.iter().zip(expected.value);
        let is_brighter = channels.all(|(a, b)| *a > b && a.is_finite());
        assert!(is_brighter, "{bright:?} is darker than {expected:?}");
    }

    // Walls that face outwards reflect inside all the same; only other points are sampled.
    folder.write("inverted.obj", room::obj(true));
    assert_eq!(bake("inverted"), json!([]));
    let [inverted, upright] = ["inverted", "room"].map(|name| {
        folder.done(&format!("bake {name}.obj {MESH}"));
        points(&folder, &format!("{name}.solution"))
    });
    assert_close(&inverted, &upright, 0.05);
}

#[test]
fn a_light_that_nobody_sees_bakes() {
    /// A closed box, and a lamp inside.
    const BOX: &str = "v 1 1 1\nv 1.5 1 1\nv 1 1.5 1\nv 1.5 1.5 1\n\
        v 1 1 1.5\nv 1.5 1 1.5\nv 1 1.5 1.5\nv 1.5 1.5 1.5\nusemtl box\n\
        f -8 -7 -5 -6\nf -4 -3 -1 -2\nf -8 -7 -3 -4\nf -6 -5 -1 -2\nf -8 -6 -2 -4\nf -7 -5 -1 -3\n\
        v 1.2 1.3 1.2\nv 1.3 1.3 1.2\nv 1.3 1.3 1.3\nv 1.2 1.3 1.3\nusemtl lamp\nf -4 -3 -2 -1\n";
    let folder = with_scene();
    let obj = room::obj(false).replace("room.mtl", "hidden.mtl");
    folder.write("hidden.obj", obj + BOX);
    let bake = |reflectance: f32| {
        let mut mtl = room::mtl().replace("Ke", "# Ke");
        mtl += &format!("newmtl box\nKd {reflectance} 0 0\n");
        mtl += "newmtl lamp\nKd 0 0 0\nKe 1 1 1\n";
        folder.write("hidden.mtl", mtl);
        "bake hidden.obj --element 0.25"
    };
    let report = folder.json(bake(0.5));
    assert_eq!(report["lights"], 1);
    folder.done("pack hidden.solution");
    for file in ["hidden.solution", "hidden.atlas"] {
        let outside = points(&folder, file);
        assert_eq!(outside.len(), 9);
        assert!(outside.iter().all(|row| row.value == [0.0; 3]));
        let inside = elements(&folder, file, "");
        assert!(inside.iter().any(|row| row.value[0] > 0.0));
        // A sample at the edge of the box may see its inside.
        let picture = png(&folder.done(&format!("relight {file} -o - {VIEW}")));
        let brightest = picture.pixels().map(|p| p.0[0]).max();
        assert!(brightest < Some(4), "{file} shows {brightest:?}");
    }
    // A box that is black inside keeps all light.
    let line = folder.refused(bake(0.0));
    assert!(line.contains("light reaches no surface"), "{line}");
}

#[test]
fn a_study_needs_its_name_and_a_folder() {
    let folder = Folder::new();
    folder.misused("study");
    folder.misused("study accuracy");
    folder.misused("study nothing -o there");
    folder.write("file", "");
    let line = folder.refused("study accuracy -o file");
    assert!(line.contains("file: cannot be made"), "{line}");
}
