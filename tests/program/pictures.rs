//! Pictures that `relight` draws.

use std::collections::BTreeMap;

use exr::prelude::read_first_flat_layer_from_file;
use serde_json::json;

use super::probes::rows;
use super::{CAMERA, MESH, VIEW, colours, png, with_room, with_scene};
use crate::command::Folder;
use crate::room::{self, LIGHTS};

/// Channels of an EXR picture by name.
pub fn exr_channels(folder: &Folder, name: &str) -> BTreeMap<String, Vec<f32>> {
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
pub fn assert_sum(parts: &[Vec<f32>], sum: &[f32]) {
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
