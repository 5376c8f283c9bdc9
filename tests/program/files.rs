//! What the commands write: solutions, atlases, JSON, and the main job's folder.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use super::pictures::{assert_sum, exr_channels};
use super::probes::{assert_close, elements, points};
use super::{MESH, colours, png, read_solution, with_room, with_scene};
use crate::command::Folder;
use crate::room::{self, BULB, LIGHTS};

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
    let [before, new, whole] = ["old", "new", "whole"].map(|file| folder.read(file));
    assert!(new == whole, "an update is not the bytes of the whole bake");
    assert!(new != before);

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
