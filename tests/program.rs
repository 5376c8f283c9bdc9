//! The program from outside: what it writes, what it says, and how it ends.

mod command;
mod room;

use std::collections::BTreeMap;
use std::fs;

use command::{Folder, one_object};
use exr::prelude::read_first_flat_layer_from_file;
use relume_host::solution::{self, Solution};
use room::{BULB, LIGHTS, POINTS};
use serde_json::{Value, json};

/// A mesh of about 1000 elements: baked in the blink of an eye.
const MESH: [&str; 4] = ["--patch", "0.5", "--element", "0.25"];

/// A view of the room through its wall at z = 3.
const VIEW: [&str; 6] = ["--eye", "2,1.2,2.9", "--target", "2,1,0", "--size", "80x60"];

/// A folder with the room and its points.
fn with_scene() -> Folder {
    let folder = Folder::new();
    folder.write("room.obj", room::obj(false));
    folder.write("room.mtl", room::mtl());
    folder.write("points.csv", POINTS);
    folder
}

/// The same, baked and packed.
fn with_room() -> Folder {
    let folder = with_scene();
    folder.done(&[&["bake", "room.obj"], &MESH[..]].concat());
    folder.done(&["pack", "room.solution"]);
    folder
}

fn read_solution(folder: &Folder, name: &str) -> Solution {
    solution::read(&folder.read(name)).expect(name)
}

/// One row of a probe.
#[derive(Debug)]
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

/// Asserts that every row of `found` is that of `expected` within a relative tolerance.
fn assert_close(found: &[Row], expected: &[Row], tolerance: f32) {
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().zip(expected) {
        assert_eq!(
            (found.place, &found.light),
            (expected.place, &expected.light)
        );
        for (a, b) in found.value.into_iter().zip(expected.value) {
            assert!(
                (a - b).abs() <= tolerance * b,
                "{found:?} is not {expected:?}"
            );
        }
    }
}

/// Channels of an EXR picture by name, and its size.
fn exr_channels(folder: &Folder, name: &str) -> (BTreeMap<String, Vec<f32>>, (usize, usize)) {
    let picture = read_first_flat_layer_from_file(folder.path().join(name)).expect(name);
    let size = picture.layer_data.size;
    let channels = picture.layer_data.channel_data.list.into_iter();
    let channels = channels.map(|channel| {
        let values = channel.sample_data.values_as_f32().collect();
        (channel.name.to_string(), values)
    });
    (channels.collect(), (size.0, size.1))
}

/// All values of a linear picture, channel by channel.
fn exr_values(folder: &Folder, name: &str) -> Vec<f32> {
    let (channels, size) = exr_channels(folder, name);
    assert!(channels.keys().eq(["B", "G", "R"]), "{:?}", channels.keys());
    let values: Vec<f32> = channels.into_values().flatten().collect();
    assert_eq!(values.len(), 3 * size.0 * size.1);
    values
}

fn png(bytes: &[u8]) -> image::RgbaImage {
    let picture = image::load_from_memory_with_format(bytes, image::ImageFormat::Png);
    picture.expect("a PNG").into_rgba8()
}

/// Different colours of a picture.
fn colours(picture: &image::RgbaImage) -> usize {
    let colours: std::collections::BTreeSet<_> = picture.pixels().map(|pixel| pixel.0).collect();
    colours.len()
}

#[test]
fn without_arguments_the_cornell_box_lands_in_out() {
    let folder = Folder::new();
    let report = folder.json(&[]);
    for key in ["lights", "elements", "patches", "shots"] {
        assert!(
            report[key].as_u64().is_some_and(|n| n > 0),
            "{key}: {report}"
        );
    }
    let files = folder.files();
    assert_eq!(
        report["solution_bytes"],
        files["out/cornell.solution"].len()
    );
    assert_eq!(report["atlas_bytes"], files["out/cornell.atlas"].len());
    let codes = report["max_error_codes"].as_f64().unwrap();
    assert!(codes > 0.0 && codes < 10.0, "{codes} display codes");

    // All files that it lists are there, and no others.
    let listed = report["files"].as_array().unwrap().iter();
    let mut listed: Vec<&str> = listed.map(|name| name.as_str().unwrap()).collect();
    listed.sort_unstable();
    assert!(files.keys().eq(&listed), "{listed:?}");
    let pictures = listed.iter().filter(|name| name.ends_with(".png"));
    assert!(pictures.clone().count() >= 9);
    for name in pictures {
        assert!(colours(&png(&files[*name])) > 100, "{name} shows nothing");
    }
    assert!(String::from_utf8_lossy(&files["out/report.txt"]).contains("ceiling"));

    // The layers of the lights add up to the picture of all of them.
    let (layers, _) = exr_channels(&folder, "out/lights.exr");
    assert_eq!(report["lights"], layers.len() / 3);
    let (all_on, _) = exr_channels(&folder, "out/all-on.exr");
    for (channel, all_on) in &all_on {
        let of_lights = layers
            .iter()
            .filter(|(name, _)| name.ends_with(&format!(".{channel}")));
        let of_lights: Vec<&Vec<f32>> = of_lights.map(|(_, values)| values).collect();
        for (pixel, all_on) in all_on.iter().enumerate() {
            let sum: f32 = of_lights.iter().map(|values| values[pixel]).sum();
            assert!(
                (sum - all_on).abs() <= 1e-5 * all_on,
                "{sum} is not {all_on}"
            );
        }
    }

    // Without --json, the same lands there and stdout stays empty.
    let second = Folder::new();
    let (stdout, stderr) = second.told(&[]);
    assert!(stdout.is_empty());
    assert!(
        stderr.contains("ceiling") && stderr.contains("out/"),
        "{stderr}"
    );
    let timeless = |mut files: BTreeMap<String, Vec<u8>>| {
        files.remove("out/report.txt"); // it says how long the bake took
        files
    };
    assert!(
        timeless(files) == timeless(second.files()),
        "two runs differ"
    );
}

#[test]
fn every_command_prints_one_json_object_and_leaves_stdout_empty_without() {
    let folder = with_scene();
    folder.write("view.toml", "eye = [2, 1.2, 2.9]\ntarget = [2, 1, 0]\n");
    let commands: [&[&str]; 7] = [
        &["bake", "room.obj", "--element", "0.5"],
        &["pack", "room.solution"],
        &[
            "relight",
            "room.atlas",
            "--camera",
            "view.toml",
            "--size",
            "8x6",
        ],
        &["probe", "room.atlas", "--elements", "-o", "room.csv"],
        &[
            "probe",
            "room.solution",
            "--points",
            "points.csv",
            "-o",
            "points.out",
        ],
        &["info", "room.solution"],
        &["info", "room.atlas"],
    ];
    for command in commands {
        let report = folder.json(command);
        if let Some(file) = report["file"].as_str() {
            assert!(!folder.read(file).is_empty(), "{report}");
        }
        let (stdout, stderr) = folder.told(command);
        assert!(stdout.is_empty(), "{command:?}");
        // A probe into a file has nothing to say.
        assert!(!stderr.is_empty() || command[0] == "probe", "{command:?}");
    }
    let (help, _) = folder.told(&["--help"]);
    assert!(String::from_utf8_lossy(&help).contains("relight"));
    assert!(folder.done(&["--version"]).starts_with(b"relume "));
}

#[test]
fn an_obj_and_a_glb_of_one_room_give_the_same_light() {
    let folder = with_scene();
    folder.write("bulb.toml", BULB);
    folder.write("room.glb", room::glb());
    let exact = [&MESH[..], &["--residual", "1e-6"]].concat();
    let obj = folder.json(
        &[
            &["bake", "room.obj", "--lights", "bulb.toml", "-o", "obj"],
            &exact[..],
        ]
        .concat(),
    );
    let glb = folder.json(&[&["bake", "room.glb", "-o", "glb"], &exact[..]].concat());
    assert_eq!(obj["lights"], 3);
    assert_eq!(
        glb["repairs"],
        json!(["quads put together from two triangles: 9"])
    );
    for key in ["surfaces", "faces", "patches", "elements", "lights"] {
        assert_eq!(obj[key], glb[key], "{key}");
    }
    let [obj, glb] = ["obj", "glb"].map(|name| {
        let emissions: BTreeMap<String, [f32; 3]> = read_solution(&folder, name)
            .lights
            .into_iter()
            .map(|light| (light.name, light.emission.to_array()))
            .collect();
        let probe = folder.done(&["probe", name, "--points", "points.csv"]);
        let mut rows = rows(&probe, "point");
        rows.sort_by(|a, b| (a.place, &a.light).cmp(&(b.place, &b.light)));
        (emissions, rows)
    });
    assert_eq!(obj.1.len(), 9 * 3);
    assert!(obj.1.iter().all(|row| row.value.iter().all(|v| *v > 0.0)));
    assert_close(&glb.1, &obj.1, 1e-4);

    for (name, emission) in &obj.0 {
        for (a, b) in emission.iter().zip(glb.0[name]) {
            assert!(
                (a - b).abs() <= 1e-6 * b,
                "{name}: {emission:?} {:?}",
                glb.0[name]
            );
        }
    }
    let pi = std::f32::consts::PI;
    assert_eq!(obj.0["ceiling"], [4.0 * pi, 3.5 * pi, 3.0 * pi]);
    assert_eq!(obj.0["bulb"], [5.0, 2.5, 1.25]);
}

#[test]
fn a_light_file_changes_nominal_emissions_and_nothing_else() {
    let folder = with_room();
    folder.write(
        "dim.toml",
        "[[light]]\nname = 'ceiling'\nemission = [0.5, 0.25, 0]\n",
    );
    folder.done(
        &[
            &["bake", "room.obj", "--lights", "dim.toml", "-o", "dim"],
            &MESH[..],
        ]
        .concat(),
    );
    let (bright, dim) = (
        read_solution(&folder, "room.solution"),
        read_solution(&folder, "dim"),
    );
    assert_eq!(dim.lights[0].emission.to_array(), [0.5, 0.25, 0.0]);
    assert_eq!(dim.lights[1], bright.lights[1]);
    assert_eq!(dim.contributions, bright.contributions);
}

#[test]
fn fewer_shots_leave_a_larger_residual() {
    let folder = with_scene();
    let bake = |options: &[&str]| {
        let report = folder.json(&[&["bake", "room.obj"], &MESH[..], options].concat());
        assert_eq!(report["interrupted"], false);
        let residual = report["residual"].as_f64().unwrap();
        (report["shots"].as_u64().unwrap(), residual)
    };
    let none = bake(&["--shots", "0"]);
    let few = bake(&["--shots", "20"]);
    let full = bake(&[]);
    assert_eq!((none.0, few.0), (0, 20));
    assert!(
        none.1 > few.1 && few.1 > full.1 && full.1 <= 1e-4,
        "{none:?} {few:?} {full:?}"
    );
    let plain = bake(&["--plain", "--shots", "300"]);
    assert_eq!(plain.0, 300);
    assert!(plain.1 > full.1 && plain.1 < none.1);
}

#[test]
fn an_atlas_is_what_was_asked_for() {
    let folder = with_room();
    let packed = |options: &[&str]| {
        let report = folder.json(&[&["pack", "room.solution", "-o", "a"], options].concat());
        assert_eq!(report["bytes"], folder.read("a").len());
        assert!(
            report["max_error_codes"].as_f64().unwrap() < 40.0,
            "{report}"
        );
        (
            report["code"].as_str().unwrap().to_owned(),
            folder.json(&["info", "a"]),
        )
    };
    let (code, own) = packed(&[]);
    assert_eq!(code, "exp8s");
    assert_eq!(folder.read("a"), folder.read("room.atlas"));
    let (code, one) = packed(&["--code", "exp8"]);
    assert_eq!(code, "exp8");
    let scale = |info: &Value, light: usize| {
        let light = &info["per_light"][light];
        light["scale"].as_f64().unwrap()
            * light["emission"].as_array().unwrap()[0].as_f64().unwrap()
    };
    // One scale for all lights at their nominal strengths (4 and 3 times pi), or one for each.
    assert!(
        (scale(&one, 0) / (scale(&one, 1) * 3.0) - 1.0).abs() < 1e-3,
        "{one}"
    );
    assert!(
        (scale(&own, 0) / (scale(&own, 1) * 3.0) - 1.0).abs() > 0.1,
        "{own}"
    );

    let (_, bare) = packed(&["--no-mesh"]);
    assert_eq!(
        (&bare["elements"], &bare["faces"]),
        (&own["elements"], &json!(0))
    );
    assert_eq!(bare["code_bytes"], own["code_bytes"]);
    assert!(bare["bytes"].as_u64() < own["bytes"].as_u64());
    let with_mesh = folder.done(&["probe", "room.atlas", "--elements"]);
    assert!(
        with_mesh == folder.done(&["probe", "a", "--elements"]),
        "the mesh changes values"
    );
}

#[test]
fn info_counts_what_a_file_holds() {
    let folder = with_room();
    let solution = read_solution(&folder, "room.solution");
    let elements = solution.mesh.elements.len();
    for (file, kind) in [("room.solution", "solution"), ("room.atlas", "atlas")] {
        let info = folder.json(&["info", file]);
        assert_eq!(info["kind"], kind);
        assert_eq!(info["bytes"], folder.read(file).len());
        assert_eq!(info["lights"], 2);
        assert_eq!(info["elements"], elements);
        assert_eq!(info["faces"], solution.mesh.faces.len());
        for (light, name) in info["per_light"].as_array().unwrap().iter().zip(LIGHTS) {
            assert_eq!(light["name"], name);
        }
    }
    let info = folder.json(&["info", "room.atlas"]);
    assert_eq!(info["flash"], info["bytes"]);
    assert_eq!(info["code_bytes"], elements * 2 * 3);
    assert_eq!(info["multiply_adds_per_frame"], elements * 2 * 3);
    assert_eq!(info["multiply_adds_per_changed_light"], elements * 3);
}

#[test]
fn pictures_of_the_lights_alone_add_up_to_the_picture_of_all() {
    let folder = with_room();
    for file in ["room.solution", "room.atlas"] {
        let picture = |name: &str, options: &[&str]| {
            folder.done(&[&["relight", file, "-o", name], &VIEW[..], options].concat());
            exr_values(&folder, name)
        };
        let all_on = picture("all.exr", &[]);
        let alone = LIGHTS.map(|light| picture("alone.exr", &["--only", &format!("{light}=1")]));
        let mean = all_on.iter().sum::<f32>() / all_on.len() as f32;
        assert!(mean > 0.0);
        for (pixel, all_on) in all_on.iter().enumerate() {
            let parts = [alone[0][pixel], alone[1][pixel]];
            assert!(
                parts
                    .iter()
                    .all(|part| (0.0..=*all_on * 1.000_01).contains(part))
            );
            let error = (parts[0] + parts[1] - all_on).abs();
            assert!(
                error <= 1e-5 * all_on + 1e-6 * mean,
                "{parts:?} is not {all_on}"
            );
        }
        for alone in &alone {
            assert!(alone.iter().sum::<f32>() > 0.01 * mean * alone.len() as f32);
        }
    }
}

#[test]
fn unset_lights_stay_nominal_and_only_darkens_the_others() {
    let folder = with_room();
    for extension in ["png", "exr"] {
        let picture = |options: &[&str]| {
            let name = format!("picture.{extension}");
            folder.done(&[&["relight", "room.atlas", "-o", &name], &VIEW[..], options].concat());
            folder.read(&name)
        };
        let nominal = picture(&[]);
        assert!(nominal == picture(&["--set", "ceiling=1", "--set", "sconce=1"]));
        let dimmed = picture(&["--set", "ceiling=0.5"]);
        assert!(dimmed != nominal);
        assert!(dimmed == picture(&["--set", "ceiling=0.5", "--set", "sconce=1"]));
        let only = picture(&["--only", "sconce=1"]);
        assert!(only == picture(&["--set", "ceiling=0"]));
        assert!(only != nominal && only != dimmed);
        // In any order, the others are dark first.
        let both = picture(&["--set", "ceiling=0.5", "--only", "sconce=1"]);
        assert!(both == dimmed);
        assert!(both == picture(&["--only", "sconce=1", "--set", "ceiling=0.5"]));
    }
}

#[test]
fn every_form_of_a_value_weighs_what_it_says() {
    let folder = with_room();
    let weight = |value: &str| {
        let set = format!("ceiling={value}");
        let report = folder.json(&["relight", "room.atlas", "--size", "4x3", "--set", &set]);
        let mix = report["mix"].as_array().unwrap();
        assert_eq!(
            (&mix[0]["name"], &mix[1]["name"]),
            (&json!("ceiling"), &json!("sconce"))
        );
        let weight = mix[0]["weight"].as_array().unwrap().iter();
        let weight: Vec<f64> = weight.map(|channel| channel.as_f64().unwrap()).collect();
        [weight[0], weight[1], weight[2]].map(|w| w / std::f64::consts::PI)
    };
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
        let found = weight(value);
        for (found, expected) in found.iter().zip(expected) {
            assert!(
                (found - expected).abs() <= 1e-5,
                "{value}: {found} is not {expected}"
            );
        }
    }
}

#[test]
fn pictures_have_the_size_camera_and_exposure_that_were_asked_for() {
    let folder = with_room();
    folder.write("view.toml", "eye = [2, 1.2, 2.9]\ntarget = [2, 1, 0]\n");
    let report = folder.json(&["relight", "room.solution"]);
    assert_eq!(
        (&report["width"], &report["height"]),
        (&json!(640), &json!(480))
    );
    assert_eq!(report["file"], "room.png");
    assert_eq!(png(&folder.read("room.png")).dimensions(), (640, 480));

    let file = folder.json(&[
        "relight",
        "room.solution",
        "--camera",
        "view.toml",
        "--size",
        "80x60",
        "-o",
        "f.png",
    ]);
    let flags = folder.json(
        &[
            &["relight", "room.solution", "-o", "g.png"],
            &VIEW[..],
            &["--fov", "0.7"],
        ]
        .concat(),
    );
    assert_eq!(file["camera"], flags["camera"]);
    assert!(folder.read("f.png") == folder.read("g.png"));
    let picture = png(&folder.read("f.png"));
    assert_eq!(picture.dimensions(), (80, 60));
    assert!(colours(&picture) > 500);

    // Auto is the exposure that it reports; half of it is darker.
    let auto = file["exposure"].as_f64().unwrap();
    let exposed = |exposure: f64| {
        let exposure = exposure.to_string();
        folder.done(
            &[
                &[
                    "relight",
                    "room.solution",
                    "-o",
                    "e.png",
                    "--exposure",
                    &exposure,
                ],
                &VIEW[..],
            ]
            .concat(),
        );
        png(&folder.read("e.png"))
    };
    assert!(exposed(auto) == picture);
    let darker = exposed(auto / 2.0);
    assert!(darker.iter().zip(picture.iter()).all(|(a, b)| a <= b) && darker != picture);
}

#[test]
fn probed_elements_are_the_contributions_in_their_order_and_their_bits() {
    let folder = with_room();
    let solution = read_solution(&folder, "room.solution");
    let rows = rows(
        &folder.done(&["probe", "room.solution", "--elements"]),
        "element",
    );
    assert_eq!(rows.len(), solution.contributions.len());
    for (number, (row, value)) in rows.iter().zip(&solution.contributions).enumerate() {
        assert_eq!((row.place, &*row.light), (number / 2, LIGHTS[number % 2]));
        assert_eq!(row.value, value.to_array());
    }
}

#[test]
fn an_atlas_stays_within_the_error_of_its_code() {
    let folder = with_room();
    let info = folder.json(&["info", "room.atlas"]);
    for places in [&["--elements"][..], &["--points", "points.csv"]] {
        let first = if places.len() == 1 {
            "element"
        } else {
            "point"
        };
        let [exact, packed] = ["room.solution", "room.atlas"]
            .map(|file| rows(&folder.done(&[&["probe", file], places].concat()), first));
        assert_eq!(exact.len(), packed.len());
        for (exact, packed) in exact.iter().zip(&packed) {
            assert_eq!((exact.place, &exact.light), (packed.place, &packed.light));
            let light = LIGHTS.iter().position(|name| *name == exact.light).unwrap();
            let scale = info["per_light"][light]["scale"].as_f64().unwrap();
            for (exact, packed) in exact.value.iter().zip(packed.value) {
                // c = round(255 (1 - e^-x)): half a code either way.
                let share = |value: f32| 1.0 - (-f64::from(value) / scale).exp();
                let codes = 255.0 * (share(*exact) - share(packed)).abs();
                assert!(codes <= 0.501, "{exact} became {packed}: {codes} codes");
            }
        }
    }
}

#[test]
fn probed_points_have_the_values_of_their_elements() {
    let folder = with_room();
    // The third of these lies on no surface, the fourth is turned away from one.
    let strays = "0.3,1.2,2.2,0,1,0\n1.3,0,1.3,1,0,0\n";
    let kept: Vec<&str> = POINTS.lines().collect();
    folder.write(
        "strays.csv",
        [kept[..3].join("\n"), "\n".into(), strays.into()].concat(),
    );
    for file in ["room.solution", "room.atlas"] {
        let points = rows(
            &folder.done(&["probe", file, "--points", "points.csv"]),
            "point",
        );
        let elements = rows(&folder.done(&["probe", file, "--elements"]), "element");
        for (number, row) in points.iter().enumerate() {
            assert_eq!((row.place, &*row.light), (number / 2, LIGHTS[number % 2]));
        }
        // The first point lies in the floor's sixth column and row of 16 x 12 elements.
        let mut floor = elements.iter().filter(|row| row.light == "ceiling");
        assert!(floor.any(|row| row.value == points[0].value));

        let arguments = ["probe", file, "--points", "strays.csv", "-o", "strays.out"];
        let (_, warning) = folder.told(&arguments);
        assert!(
            warning.starts_with("2 points") && warning.contains("nan"),
            "{warning}"
        );
        assert_eq!(folder.json(&arguments)["missing"], 2);
        let strays = rows(&folder.read("strays.out"), "point");
        assert_eq!(strays.len(), 4 * 2);
        assert_eq!(strays[1].value, points[1].value);
        assert!(
            strays[4..]
                .iter()
                .all(|row| row.value.iter().all(|v| v.is_nan()))
        );
        assert!(
            strays[..4]
                .iter()
                .all(|row| row.value.iter().all(|v| v.is_finite()))
        );
    }
}

#[test]
fn direct_light_is_told_apart_where_it_was_kept_apart() {
    let folder = with_room();
    folder.write("bulb.toml", BULB);
    let bake = [
        "bake",
        "room.obj",
        "--lights",
        "bulb.toml",
        "--split-direct",
        "-o",
        "split",
    ];
    folder.done(&[&bake[..], &MESH].concat());
    assert_eq!(folder.json(&["info", "split"])["split_direct"], true);
    let total = rows(&folder.done(&["probe", "split", "--elements"]), "element");
    let direct = rows(
        &folder.done(&["probe", "split", "--elements", "--direct"]),
        "element",
    );
    assert_eq!(total.len(), direct.len());
    let mut dark = 0;
    for (total, direct) in total.iter().zip(&direct) {
        assert_eq!((total.place, &total.light), (direct.place, &direct.light));
        for (total, direct) in total.value.iter().zip(direct.value) {
            assert!(
                (0.0..=total * 1.000_01).contains(&direct),
                "{direct} of {total}"
            );
        }
        // Direct light is white, and some of it falls into the shadow of the screen.
        assert!(direct.value == [direct.value[0]; 3]);
        dark += usize::from(direct.value[0] == 0.0);
    }
    assert!(
        dark > 0 && dark < direct.len() / 2,
        "{dark} of {}",
        direct.len()
    );

    // Splitting changes no total.
    let unsplit = rows(
        &folder.done(&["probe", "room.solution", "--elements"]),
        "element",
    );
    let total: Vec<Row> = total
        .into_iter()
        .filter(|row| row.light != "bulb")
        .collect();
    assert_close(&total, &unsplit, 1e-3);

    // Below the bulb, cos / r^2 over an element of 0.25 m at 2 m: 1/4 less half a percent.
    folder.write("below.csv", "x,y,z,nx,ny,nz\n1.3,0,1.3,0,1,0\n");
    let below = rows(
        &folder.done(&["probe", "split", "--points", "below.csv", "--direct"]),
        "point",
    );
    let bulb = below.iter().find(|row| row.light == "bulb").unwrap();
    assert!((bulb.value[0] / 0.25 - 1.0).abs() < 0.02, "{bulb:?}");

    for file in ["room.solution", "room.atlas"] {
        let line = folder.refused(&["probe", file, "--elements", "--direct", "-o", "no.csv"]);
        assert!(
            line.contains(file) && line.contains("direct light"),
            "{line}"
        );
    }
}

#[test]
fn threads_and_method_do_not_change_a_byte() {
    let folder = with_scene();
    folder.write("bulb.toml", BULB);
    let bake = |options: &[&str]| {
        let bake = ["bake", "room.obj", "--lights", "bulb.toml", "-o", "x"];
        let report = folder.json(&[&bake[..], &MESH, options].concat());
        (
            folder.read("x"),
            report["method"].as_str().unwrap().to_owned(),
        )
    };
    let (expected, method) = bake(&[]);
    assert_eq!(method, "host");
    for options in [["--threads", "1"], ["--threads", "2"], ["--threads", "7"]] {
        assert!(bake(&options).0 == expected, "{options:?}");
    }
    let (device, method) = bake(&["--method", "device"]);
    assert_eq!(method, "device");
    assert!(device == expected, "--method device");
}

#[test]
fn a_dash_writes_to_stdout_what_a_file_would_hold() {
    let folder = with_room();
    let commands: [(&[&str], &str); 5] = [
        (
            &["bake", "room.obj", MESH[0], MESH[1], MESH[2], MESH[3]],
            "s",
        ),
        (&["pack", "room.solution"], "a"),
        (&["relight", "room.atlas", "--size", "40x30"], "p.png"),
        (&["probe", "room.atlas", "--elements"], "e.csv"),
        (&["probe", "room.atlas", "--points", "points.csv"], "p.csv"),
    ];
    for (command, file) in commands {
        folder.done(&[command, &["-o", file]].concat());
        let stdout = folder.done(&[command, &["-o", "-"]].concat());
        assert!(stdout == folder.read(file), "{command:?}");
        let line = folder.misused(&[command, &["-o", "-", "--json"]].concat());
        assert!(line.contains("--json"), "{line}");
    }
    // A probe goes there anyway.
    assert!(folder.done(&["probe", "room.atlas", "--elements"]) == folder.read("e.csv"));
    folder.misused(&["probe", "room.atlas", "--elements", "--json"]);
}

#[cfg(unix)]
#[test]
fn an_interrupted_bake_is_byte_for_byte_what_its_shots_give() {
    use std::process::{Command, Stdio};
    use std::time::Duration;

    let folder = with_scene();
    let mut length = 0.06_f32; // 16 000 elements, 1000 rows
    let mut patience = Duration::from_millis(250);
    // How fast the machine is does not matter: an attempt that came too early or too late is
    // followed by one that waits longer, on a finer mesh.
    for _ in 0..10 {
        let mesh = ["--element", &length.to_string()];
        let bake = [&["bake", "room.obj", "-o", "part"], &mesh[..]].concat();
        let child = folder
            .command(&[&bake[..], &["--json"]].concat())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("relume starts");
        std::thread::sleep(patience);
        let id = child.id().to_string();
        Command::new("kill")
            .args(["-INT", &id])
            .status()
            .expect("kill");
        let output = child.wait_with_output().expect("relume ends");
        let stderr = String::from_utf8(output.stderr).expect("UTF-8");
        match output.status.code() {
            Some(130) => {
                let report = one_object(&output.stdout);
                let (shots, patches) = (&report["shots"], &report["patches"]);
                assert_eq!(report["interrupted"], true);
                assert!(stderr.contains(&format!("--shots {shots}")), "{stderr}");
                assert!(shots.as_u64() < patches.as_u64(), "{report}");
                if shots == 0 {
                    patience *= 2;
                    continue;
                }
                let shots = shots.to_string();
                folder.done(
                    &[
                        &["bake", "room.obj", "-o", "whole", "--shots", &shots],
                        &mesh[..],
                    ]
                    .concat(),
                );
                assert!(
                    folder.read("part") == folder.read("whole"),
                    "--shots {shots}"
                );
                assert_eq!(folder.files().len(), 5);
                return;
            }
            Some(0) => {
                fs::remove_file(folder.path().join("part")).expect("it was written");
                length *= 0.7;
                patience = patience.mul_f32(1.5);
            }
            // The signal came before anyone listened.
            None => {
                assert_eq!(folder.files().len(), 3, "a part was left behind");
                patience *= 2;
            }
            code => panic!("exit {code:?}: {stderr}"),
        }
    }
    panic!("never interrupted in time");
}

#[test]
fn wrong_scenes_are_one_line_and_exit_1() {
    let folder = with_scene();
    let obj = room::obj(false);
    folder.write("room.txt", &obj);
    folder.write("nan.obj", obj.replacen("v 4 0 3", "v 4 NaN 3", 1));
    folder.write("index.obj", format!("{obj}f 1 2 999\n"));
    folder.write("empty.obj", "");
    folder.write("latin.obj", b"v 0 0 0\n# caf\xe9\n");
    folder.write("dark.mtl", room::mtl().replace("Ke", "# Ke"));
    folder.write("dark.obj", obj.replace("room.mtl", "dark.mtl"));
    folder.write("black.mtl", "newmtl white\nKd -1 0 0\n");
    folder.write("black.obj", obj.replace("room.mtl", "black.mtl"));
    let glb = room::glb();
    folder.write("cut.glb", &glb[..glb.len() / 2]);
    folder.write("text.gltf", &obj);
    let needs = r#"{"asset": {"version": "2.0"}, "extensionsUsed": ["EXT_no_such"], "extensionsRequired": ["EXT_no_such"]}"#;
    folder.write("needs.gltf", needs);
    fs::create_dir(folder.path().join("folder.obj")).unwrap();
    for (scene, expected) in [
        ("missing.obj", "No such file or directory (os error 2)"),
        ("missing.glb", "cannot be read"),
        ("folder.obj", "cannot be read"),
        ("room.txt", "give a .obj, .gltf or .glb file"),
        (
            "nan.obj",
            "nan.obj, line 4: vertex (4, NaN, 3) is not finite",
        ),
        ("index.obj", "999"),
        ("empty.obj", "no usable face"),
        ("latin.obj", "line 2: not UTF-8"),
        ("dark.obj", "no light"),
        ("black.mtl", "Kd (-1, 0, 0)"),
        ("cut.glb", ""),
        ("text.gltf", ""),
        ("needs.gltf", "EXT_no_such"),
    ] {
        folder.write("out.solution", "as it was");
        let line = folder.refused(&["bake", &scene.replace(".mtl", ".obj"), "-o", "out.solution"]);
        assert!(line.contains(scene) && line.contains(expected), "{line}");
        // Told once.
        assert_eq!(line.matches("os error").count().max(1), 1, "{line}");
    }
}

#[test]
fn wrong_light_files_are_one_line_and_exit_1() {
    let folder = with_scene();
    for (text, expected) in [
        ("[[light]\n", "lights.toml, line 1"),
        (
            "[[light]]\nname = 'sconce'\nemission = [1, -1, 1]\n",
            "light 1 (\"sconce\")",
        ),
        (
            "[[light]]\nname = 'sconce'\nemission = nan\n",
            "light 1 (\"sconce\")",
        ),
        (
            "[[light]]\nname = 'lamp'\nemission = 1\n",
            "the scene has no light of that name",
        ),
        (
            "[[light]]\nname = 'lamp'\nkind = 'sun'\nemission = 1\n",
            "needs `direction",
        ),
        (
            "[[light]]\nname = 'lamp'\nkind = 'moon'\nemission = 1\n",
            "moon",
        ),
        (
            "[[light]]\nname = 'lamp'\nkind = 'sky'\nemission = 1\ncolor = 1\n",
            "color",
        ),
    ] {
        folder.write("lights.toml", text);
        let line = folder.refused(&["bake", "room.obj", "--lights", "lights.toml"]);
        assert!(
            line.contains("lights.toml") && line.contains(expected),
            "{line}"
        );
    }
    let line = folder.refused(&["bake", "room.obj", "--lights", "none.toml"]);
    assert!(line.contains("none.toml: cannot be read"), "{line}");
}

#[test]
fn what_cannot_be_done_with_a_file_is_one_line_and_exit_1() {
    let folder = with_room();
    folder.done(&["pack", "room.solution", "--no-mesh", "-o", "bare.atlas"]);
    folder.write("bad.csv", "x,y,z\n1,2,3\n");
    folder.write("zero.csv", "x,y,z,nx,ny,nz\n1,2,3,0,0,0\n");
    folder.write("words.csv", "x,y,z,nx,ny,nz\n1,2,3,0,1,up\n");
    folder.write("bad.toml", "eye = 1\n");
    let cases: [(&[&str], &str, &str); 18] = [
        (
            &["pack", "missing.solution"],
            "missing.solution",
            "cannot be read",
        ),
        (
            &["pack", "room.atlas", "-o", "b"],
            "room.atlas",
            "an atlas already",
        ),
        (
            &["pack", "room.obj", "-o", "b"],
            "room.obj",
            "neither a solution nor an atlas",
        ),
        (
            &["relight", "missing.atlas"],
            "missing.atlas",
            "cannot be read",
        ),
        (
            &["relight", "room.obj"],
            "room.obj",
            "neither a solution nor an atlas",
        ),
        (&["relight", "bare.atlas"], "bare.atlas", "no mesh"),
        (
            &["relight", "room.atlas", "--set", "nobody=1"],
            "room.atlas",
            "`nobody`; the lights are: ceiling, sconce",
        ),
        (
            &["relight", "room.solution", "--only", "nobody=1"],
            "room.solution",
            "`nobody`",
        ),
        (
            &["relight", "room.atlas", "-o", "picture.jpg"],
            "picture.jpg",
            ".png or .exr",
        ),
        (
            &["relight", "room.atlas", "--camera", "none.toml"],
            "none.toml",
            "",
        ),
        (
            &["relight", "room.atlas", "--camera", "bad.toml"],
            "bad.toml",
            "",
        ),
        (
            &["probe", "bare.atlas", "--points", "points.csv"],
            "bare.atlas",
            "no mesh",
        ),
        (
            &["probe", "room.atlas", "--points", "none.csv"],
            "none.csv",
            "cannot be read",
        ),
        (
            &["probe", "room.atlas", "--points", "bad.csv"],
            "bad.csv",
            "x,y,z,nx,ny,nz",
        ),
        (
            &["probe", "room.atlas", "--points", "zero.csv"],
            "zero.csv",
            "line 2",
        ),
        (
            &["probe", "room.atlas", "--points", "words.csv"],
            "words.csv",
            "line: 2",
        ),
        (
            &["info", "missing.atlas"],
            "missing.atlas",
            "cannot be read",
        ),
        (
            &["info", "room.mtl"],
            "room.mtl",
            "neither a solution nor an atlas",
        ),
    ];
    for (arguments, file, expected) in cases {
        let line = folder.refused(arguments);
        assert!(line.contains(file) && line.contains(expected), "{line}");
        assert_eq!(line.matches(file).count(), 1, "told twice: {line}");
    }
    for (options, expected) in [
        (["--size", "0x10"], "0 x 10"),
        (["--size", "20000x10"], "16384"),
        (["--fov", "4"], "field of view 4"),
        (["--eye", "nan,0,0"], "finite"),
    ] {
        let line = folder.refused(&[&["relight", "room.atlas"], &options[..]].concat());
        assert!(line.contains(expected), "{line}");
    }
    // What an atlas without a mesh is good for.
    folder.done(&["probe", "bare.atlas", "--elements"]);
    folder.done(&["info", "bare.atlas"]);
}

#[test]
fn an_output_that_cannot_be_written_is_one_line_and_exit_1() {
    let folder = with_room();
    fs::create_dir(folder.path().join("folder.png")).unwrap();
    let commands: [&[&str]; 4] = [
        &["bake", "room.obj", "--element", "1"],
        &["pack", "room.solution"],
        &["relight", "room.atlas", "--size", "8x6"],
        &["probe", "room.atlas", "--elements"],
    ];
    for command in commands {
        for output in ["folder.png", "none/such.png", "room.obj/such.png"] {
            let line = folder.refused(&[command, &["-o", output]].concat());
            assert!(
                line.contains(&format!("{output}: cannot be written: ")),
                "{line}"
            );
            assert!(!line.contains(".tmp"), "{line}");
        }
    }
    // A folder where a file stands.
    folder.write("out", "");
    let before = folder.files();
    let output = folder.command(&[]).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert!(
        stderr.starts_with("relume: out: ") && stderr.lines().count() == 1,
        "{stderr}"
    );
    assert!(folder.files() == before);
}

/// Nobody reads, or the disk is full: an error where data are lost, never a panic.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_behind_stdout_or_stderr_is_no_panic() {
    let folder = with_room();
    let full = || fs::File::create("/dev/full").expect("Linux has it");
    for arguments in [
        &["info", "room.atlas", "--json"][..],
        &["probe", "room.atlas", "--elements"],
    ] {
        let output = folder.command(arguments).stdout(full()).output().unwrap();
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{stderr}");
        assert!(
            stderr
                .lines()
                .last()
                .unwrap()
                .starts_with("relume: -: cannot be written"),
            "{stderr}"
        );
        assert!(!stderr.contains("panicked"));
    }
    let bake = ["bake", "room.obj", "--element", "1", "-o", "silent"];
    let output = folder.command(&bake).stderr(full()).output().unwrap();
    assert_eq!(output.status.code(), Some(0));
    assert!(!folder.read("silent").is_empty());
}

#[test]
fn damaged_files_are_refused_by_every_command() {
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
            length - 100,
            length - 4,
            length - 1,
        ];
        let mut damaged: Vec<Vec<u8>> = cuts.map(|cut| whole[..cut].to_vec()).to_vec();
        for (at, bit) in (0..12).map(|part| (part * length / 12 + part, part % 8)) {
            let mut flipped = whole.clone();
            flipped[at] ^= 1 << bit;
            damaged.push(flipped);
        }
        damaged.push([&whole[..], b"\0"].concat());
        let mut newer = whole.clone();
        newer[8..10].copy_from_slice(&[0xff, 0xff]);
        damaged.push(newer);
        // Counts that would fill the memory.
        let mut huge = whole.clone();
        huge[12..32].fill(0xff);
        damaged.push(huge);

        let commands: [&[&str]; 5] = [
            &["info", "damaged"],
            &["pack", "damaged", "-o", "out.atlas"],
            &["relight", "damaged", "-o", "out.png"],
            &["probe", "damaged", "--elements", "-o", "out.csv"],
            &[
                "probe",
                "damaged",
                "--points",
                "points.csv",
                "-o",
                "out.csv",
            ],
        ];
        for (number, bytes) in damaged.iter().enumerate() {
            assert!(*bytes != whole);
            folder.write("damaged", bytes);
            let line = folder.refused(commands[number % commands.len()]);
            assert!(line.contains("damaged: "), "{name}, case {number}: {line}");
        }
    }
}

#[test]
fn wrong_usage_is_exit_2() {
    let folder = with_room();
    let cases: [&[&str]; 24] = [
        &["--nothing"],
        &["unbake"],
        &["bake"],
        &["bake", "room.obj", "--nothing"],
        &["bake", "room.obj", "room.obj"],
        &["bake", "room.obj", "-o"],
        &["bake", "room.obj", "--element", "0"],
        &["bake", "room.obj", "--element", "nan"],
        &["bake", "room.obj", "--patch=-1"],
        &["bake", "room.obj", "--residual", "0"],
        &["bake", "room.obj", "--shots", "1.5"],
        &["bake", "room.obj", "--threads", "0"],
        &["bake", "room.obj", "--method", "magic"],
        &["pack"],
        &["pack", "room.solution", "--code", "zip"],
        &["relight", "room.atlas", "--set", "ceiling"],
        &["relight", "room.atlas", "--set", "ceiling=-1"],
        &["relight", "room.atlas", "--set", "ceiling=#ff"],
        &["relight", "room.atlas", "--size", "large"],
        &["relight", "room.atlas", "--exposure", "dark"],
        &["relight", "room.atlas", "--eye", "1,2"],
        &[
            "relight",
            "room.atlas",
            "--eye",
            "1,2,3",
            "--camera",
            "view.toml",
        ],
        &["probe", "room.atlas"],
        &[
            "probe",
            "room.atlas",
            "--elements",
            "--points",
            "points.csv",
        ],
    ];
    for arguments in cases {
        folder.misused(arguments);
        folder.misused(&[arguments, &["--json"]].concat());
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
            let name = name(i);
            format!("[[light]]\nname='{name}'\nkind='sun'\ndirection=[{i},-9,0]\nemission=1\n")
        };
        folder.write("lights.toml", (0..count).map(entry).collect::<String>());
    };
    let bake = [
        "bake",
        "floor.obj",
        "--lights",
        "lights.toml",
        "--element",
        "0.5",
    ];
    lights(1_000_000, &|i| i.to_string());
    let line = folder.refused(&bake);
    assert!(line.contains("lights.toml: 1000000 lights"), "{line}");
    lights(70_000, &|i| i.to_string());
    let line = folder.refused(&bake);
    assert!(
        line.contains("lights.toml: 70000 lights") && line.contains("65535"),
        "{line}"
    );

    // One group of as many, and as many lights as there are tags.
    lights(70_000, &|_| "all".to_owned());
    assert_eq!(folder.json(&bake)["lights"], 1);
    lights(65_535, &|i| format!("sun {i}"));
    let report = folder.json(&bake);
    assert_eq!(
        (&report["lights"], &report["elements"]),
        (&json!(65_535), &json!(4))
    );
    assert_eq!(folder.json(&["pack", "floor.solution"])["lights"], 65_535);
    let probed = rows(
        &folder.done(&["probe", "floor.atlas", "--elements"]),
        "element",
    );
    assert_eq!(probed.len(), 4 * 65_535);
    let dark = folder.refused(&["relight", "floor.atlas", "--set", "sun=0"]);
    assert!(dark.len() < 400, "{dark}");
    let relight = [
        "relight",
        "floor.atlas",
        "--only",
        "sun 65534=2",
        "--size",
        "8x6",
    ];
    assert!(folder.json(&relight)["mix"][65_534]["weight"] == json!([2.0, 2.0, 2.0]));
}

#[test]
fn a_mesh_too_fine_for_the_machine_is_refused() {
    let folder = with_scene();
    for element in ["0.0001", "1e-7"] {
        let line = folder.refused(&["bake", "room.obj", "--element", element]);
        assert!(line.starts_with("relume: room.obj: "), "{line}");
        assert!(line.contains("elements"), "{line}");
    }
}

#[test]
fn dirty_scenes_are_repaired_and_counted() {
    let folder = with_scene();
    let clean = folder.json(&["bake", "room.obj", "--element", "0.5"]);
    assert_eq!(clean["repairs"], json!([]));
    folder.done(&["bake", "room.obj", "--element", "0.5"]);
    let expected = rows(
        &folder.done(&["probe", "room.solution", "--elements"]),
        "element",
    );

    // Faces without an area: a point, a line, and a vertex twice.
    let flat = "v 1 1 1\nv 2 1 1\nv 3 1 1\nusemtl red\nf -3 -3 -3\nf -3 -2 -1\nf -3 -2 -2\n";
    folder.write("flat.obj", room::obj(false) + flat);
    let flat = folder.json(&["bake", "flat.obj", "--element", "0.5"]);
    let dropped = |line: &Value| line == "faces without area dropped: 3";
    assert!(
        flat["repairs"].as_array().unwrap().iter().any(dropped),
        "{flat}"
    );
    assert!(folder.read("flat.solution") == folder.read("room.solution"));

    // White is brighter than anything that is, and used by five quads.
    folder.write(
        "bright.mtl",
        room::mtl().replace("Kd 0.75 0.74 0.7", "Kd 1 1.5 0.98"),
    );
    folder.write(
        "bright.obj",
        room::obj(false).replace("room.mtl", "bright.mtl"),
    );
    let (_, stderr) = folder.told(&["bake", "bright.obj", "--element", "0.5"]);
    let clamped = "surfaces with reflectance lowered to 0.98: 4";
    assert!(
        stderr.contains(&format!("bright.obj: {clamped}\n")),
        "{stderr}"
    );
    let bright = folder.json(&["bake", "bright.obj", "--element", "0.5"]);
    assert_eq!(bright["repairs"], json!([clamped]));
    let bright = rows(
        &folder.done(&["probe", "bright.solution", "--elements"]),
        "element",
    );
    for (bright, expected) in bright.iter().zip(&expected) {
        let brighter = bright.value.iter().zip(expected.value).all(|(a, b)| *a > b);
        assert!(
            brighter && bright.value.iter().all(|v| v.is_finite()),
            "{bright:?}"
        );
    }

    // Walls that face outwards reflect inside all the same.
    folder.write("inverted.obj", room::obj(true));
    folder.done(&["bake", "inverted.obj", "--element", "0.5"]);
    let [inverted, upright] = ["inverted.solution", "room.solution"].map(|file| {
        rows(
            &folder.done(&["probe", file, "--points", "points.csv"]),
            "point",
        )
    });
    assert_close(&inverted, &upright, 1e-3);
}

#[test]
fn a_light_that_nobody_sees_bakes() {
    let folder = with_scene();
    // A closed box around a lamp that is the only light: of grey walls, then of black ones.
    let mut obj = room::obj(false).replace("room.mtl", "hidden.mtl");
    let corners = (0..8).map(|i| [i & 1, i >> 1 & 1, i >> 2].map(|bit| 1.0 + 0.5 * bit as f32));
    for [x, y, z] in corners {
        obj += &format!("v {x} {y} {z}\n");
    }
    obj += "usemtl box\nf -8 -7 -5 -6\nf -4 -3 -1 -2\nf -8 -7 -3 -4\nf -6 -5 -1 -2\nf -8 -6 -2 -4\nf -7 -5 -1 -3\n";
    obj +=
        "v 1.2 1.3 1.2\nv 1.3 1.3 1.2\nv 1.3 1.3 1.3\nv 1.2 1.3 1.3\nusemtl lamp\nf -4 -3 -2 -1\n";
    folder.write("hidden.obj", obj);
    for (box_reflectance, lit) in [(0.5, true), (0.0, false)] {
        let mtl = room::mtl().replace("Ke", "# Ke");
        let more =
            format!("newmtl box\nKd {box_reflectance} 0.0 0.0\nnewmtl lamp\nKd 0 0 0\nKe 1 1 1\n");
        folder.write("hidden.mtl", mtl + &more);
        let report = folder.json(&["bake", "hidden.obj", "--element", "0.25"]);
        assert_eq!(report["lights"], 1);
        assert_eq!(report["elements"].as_u64() > Some(0), lit, "{report}");
        folder.done(&["pack", "hidden.solution"]);
        for file in ["hidden.solution", "hidden.atlas"] {
            let room = rows(
                &folder.done(&["probe", file, "--points", "points.csv"]),
                "point",
            );
            assert_eq!(room.len(), 9);
            assert!(room.iter().all(|row| row.value == [0.0; 3]), "{room:?}");
            let inside = rows(&folder.done(&["probe", file, "--elements"]), "element");
            assert_eq!(inside.iter().any(|row| row.value[0] > 0.0), lit);
            let picture = folder.done(&[&["relight", file, "-o", "-"], &VIEW[..]].concat());
            assert_eq!(colours(&png(&picture)), 1, "{file} shows something");
        }
    }
}
