//! Scenes that are repaired, warned of, or larger than what is sensible.

use serde_json::json;

use super::probes::{assert_close, elements, points};
use super::{MESH, VIEW, png, with_scene};
use crate::command::Folder;
use crate::room;

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
