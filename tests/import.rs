//! Imports every scene of the reference data, the files as published, and damaged ones.

mod data;
mod skip;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use data::data_dir;
use glam::{DVec3, Vec2};
use relume_host::import::{Imported, load};
use relume_host::scene::OwnedScene;

/// Scenes and their polygons, as the README of the data counts them.
const SCENES: [(&str, usize); 14] = [
    ("furnace_50", 6),
    ("seed_room_1", 13),
    ("seed_room_3", 15),
    ("seed_room_8", 20),
    ("seed_room_64", 76),
    ("seed_room_256", 268),
    ("seed_room_3_onfloor", 15),
    ("cornell_mitsuba", 18),
    ("tinyobj_cornell", 19),
    ("bevy_cornell", 38),
    ("mcguire_cornell", 17),
    ("tile_game_room", 91),
    ("gazebo", 734),
    ("frads_office", 13909),
];

fn scene_file(data: &Path, name: &str) -> PathBuf {
    data.join("scenes").join(name).join("scene.obj")
}

fn import(path: &Path) -> Imported {
    load(path, None).unwrap_or_else(|error| panic!("{error}"))
}

/// Names of the emissive materials of an MTL file, sorted.
fn emissive_materials(mtl: &str) -> Vec<String> {
    let mut names = Vec::new();
    let mut current = "";
    for line in mtl.lines() {
        if let Some(name) = line.strip_prefix("newmtl ") {
            current = name.trim();
        } else if let Some(values) = line.strip_prefix("Ke ") {
            let mut values = values.split_whitespace().map(|v| v.parse::<f32>().unwrap());
            if values.any(|value| value > 0.0) {
                names.push(current.to_owned());
            }
        }
    }
    names.sort();
    names
}

/// Area of all `f` statements of an OBJ file, by Newell's formula in f64.
fn obj_area(obj: &str) -> f64 {
    let mut vertices: Vec<DVec3> = Vec::new();
    let mut area = 0.0;
    for line in obj.lines() {
        let mut words = line.split_whitespace();
        let keyword = words.next();
        let numbers: Vec<f64> = words.filter_map(|word| word.parse().ok()).collect();
        match keyword {
            Some("v") => vertices.push(DVec3::from_slice(&numbers)),
            Some("f") => {
                let corner = |number: &f64| vertices[*number as usize - 1];
                let fan = numbers.iter().map(corner).map(|v| v - corner(&numbers[0]));
                let next = fan.clone().skip(1);
                let doubled: DVec3 = fan.zip(next).map(|(a, b)| a.cross(b)).sum();
                area += doubled.length() / 2.0;
            }
            _ => {}
        }
    }
    area
}

fn scene_area(scene: &OwnedScene) -> f64 {
    scene
        .surfaces
        .iter()
        .map(|surface| f64::from(surface.polygon().area()))
        .sum()
}

/// Area by reflectance (in thousandths), black surfaces left out.
fn area_by_reflectance(scene: &OwnedScene) -> BTreeMap<[u32; 3], f64> {
    let mut areas = BTreeMap::new();
    for surface in &scene.surfaces {
        let reflectance = surface.reflectance();
        if !reflectance.is_black() {
            let key = reflectance
                .get()
                .to_array()
                .map(|channel| (channel * 1000.0).round() as u32);
            *areas.entry(key).or_default() += f64::from(surface.polygon().area());
        }
    }
    areas
}

#[test]
fn every_scene_has_its_polygons_and_lights() {
    let Some(data) = data_dir() else { return };
    for (name, polygons) in SCENES {
        let path = scene_file(&data, name);
        let Imported {
            scene,
            polygons: read,
            repairs,
        } = import(&path);
        assert_eq!(read, polygons, "{name}");
        assert_eq!(scene.textures.len(), scene.surfaces.len(), "{name}");
        scene.view().unwrap();

        let expected = emissive_materials(&fs::read_to_string(path.with_extension("mtl")).unwrap());
        let mut lights: Vec<&str> = scene
            .lights
            .iter()
            .map(|light| light.name.as_str())
            .collect();
        lights.sort_unstable();
        assert_eq!(lights, expected, "{name}");
        for light in &scene.lights {
            // The radiance of all of them is 1/pi.
            assert!(
                light
                    .emission
                    .to_array()
                    .iter()
                    .all(|e| (e - 1.0).abs() < 1e-6),
                "{light:?}"
            );
            assert_eq!(light.importance, 1.0);
        }
        assert!(
            scene.surfaces.iter().all(|surface| surface.is_two_sided()),
            "{name}"
        );
        if repairs.duplicate_faces == 0 {
            let expected = obj_area(&fs::read_to_string(&path).unwrap());
            let ratio = scene_area(&scene) / expected;
            // The warped walls of two Cornell boxes have more area than their projection.
            let tolerance = if repairs.warped_quads > 0 { 1e-3 } else { 1e-5 };
            assert!((ratio - 1.0).abs() < tolerance, "{name}: {ratio}");
        }
    }
}

#[test]
fn quads_stay_in_file_order() {
    let Some(data) = data_dir() else { return };
    let path = scene_file(&data, "seed_room_3");
    let scene = import(&path).scene;
    let text = fs::read_to_string(&path).unwrap();
    let numbers = |line: &str| -> Vec<f32> {
        line.split_whitespace()
            .skip(1)
            .map(|word| word.parse().unwrap())
            .collect()
    };
    let vertices: Vec<Vec<f32>> = text
        .lines()
        .filter(|l| l.starts_with("v "))
        .map(numbers)
        .collect();
    let faces: Vec<Vec<f32>> = text
        .lines()
        .filter(|l| l.starts_with("f "))
        .map(numbers)
        .collect();
    assert_eq!(scene.surfaces.len(), faces.len());
    for (surface, face) in scene.surfaces.iter().zip(faces) {
        let found: Vec<Vec<f32>> = surface
            .polygon()
            .vertices()
            .iter()
            .map(|v| v.to_array().to_vec())
            .collect();
        let expected: Vec<Vec<f32>> = face
            .iter()
            .map(|index| vertices[*index as usize - 1].clone())
            .collect();
        assert_eq!(found, expected);
    }
}

#[test]
fn the_office_is_triangulated_without_gaps() {
    let Some(data) = data_dir() else { return };
    let Imported { scene, repairs, .. } = import(&scene_file(&data, "frads_office"));
    assert_eq!((repairs.large_polygons, repairs.crossed_outlines), (736, 0));
    assert_eq!(scene.lights.len(), 5);
    // Newell's areas of the file's polygons, of which equal sets of vertices count once.
    let unfilled = 1.0 - scene_area(&scene) / 10_369.416_38;
    assert!(unfilled.abs() < 1e-3, "{unfilled}");
    // The same office as it was published, without the lamps' emission.
    let view = import(&data.join("originals/office_view/scene.obj"));
    assert_eq!(view.scene.lights.len(), 0);
    let ratio = scene_area(&view.scene) / scene_area(&scene);
    assert!((ratio - 1.0).abs() < 1e-6, "{ratio}");
}

#[test]
fn published_obj_files_are_imported() {
    let Some(data) = data_dir() else { return };
    let cornell = import(&data.join("originals/cornell_box.obj"));
    assert_eq!((cornell.polygons, cornell.scene.lights.len()), (18, 0));
    // Its reflectances are 0 and 1.
    let clamped = cornell
        .scene
        .surfaces
        .iter()
        .filter(|s| s.reflectance().get().max_channel() > 0.9);
    assert_eq!(cornell.repairs.clamped_reflectances, clamped.count());
    let gazebo = import(&data.join("originals/gazebo.obj"));
    assert_eq!(gazebo.polygons, 730);
    assert_eq!(gazebo.repairs.default_reflectances, 730);
}

#[test]
fn glb_and_obj_of_one_scene_agree() {
    let Some(data) = data_dir() else { return };
    let glb = import(&data.join("originals/CornellBox.glb"));
    let obj = import(&scene_file(&data, "bevy_cornell"));
    assert_eq!(glb.polygons, 36);
    assert_eq!(glb.repairs.recovered_quads, obj.repairs.recovered_quads);
    let (glb_areas, obj_areas) = (
        area_by_reflectance(&glb.scene),
        area_by_reflectance(&obj.scene),
    );
    assert!(
        glb_areas.keys().eq(obj_areas.keys()),
        "{glb_areas:?} {obj_areas:?}"
    );
    for (reflectance, area) in &glb_areas {
        let ratio = area / obj_areas[reflectance];
        assert!((ratio - 1.0).abs() < 1e-5, "{reflectance:?}: {ratio}");
    }

    let [light] = &*glb.scene.lights else {
        panic!("{:?}", glb.scene.lights)
    };
    assert_eq!(light.name, "Emitter_Light_temp");
    assert!((light.emission.g / (100.0 * std::f32::consts::PI) - 1.0).abs() < 1e-6);
    let lamp = glb
        .scene
        .surfaces
        .iter()
        .find(|surface| surface.emission().is_some())
        .unwrap();
    assert!(lamp.polygon().normal().y < -0.99, "the lamp shines down");
    assert!(
        glb.scene
            .surfaces
            .iter()
            .all(|surface| surface.is_two_sided())
    );
}

#[test]
fn textures_average_to_what_others_found() {
    let Some(data) = data_dir() else { return };
    let glb = import(&data.join("originals/tile-game-room6.glb"));
    let obj = import(&scene_file(&data, "tile_game_room"));
    let reflected = |scene: &OwnedScene| -> f64 {
        let part = |s: &relume::scene::Surface| {
            f64::from(s.polygon().area() * s.reflectance().get().mean_channel())
        };
        scene.surfaces.iter().map(part).sum()
    };
    assert_eq!((glb.polygons, glb.repairs.textures_used), (88, 1));
    // 160 000 nearest texels per triangle, taken with numpy and Pillow, sum up to this.
    let supersampled = reflected(&glb.scene) / 89.878_110;
    assert!((supersampled - 1.0).abs() < 1e-4, "{supersampled}");
    // The OBJ file's colours are coarser means of the same texture, and its lamps are black.
    let ratio = reflected(&glb.scene) / reflected(&obj.scene);
    assert!((ratio - 1.0).abs() < 0.02, "{ratio}");

    for (surface, texture) in glb.scene.surfaces.iter().zip(&glb.scene.textures) {
        let Some(texture) = texture else { continue };
        let whole = texture.mean_over(Vec2::ZERO, Vec2::ONE);
        assert_eq!(whole, surface.reflectance().get());
        assert_eq!(texture.corners.len(), surface.polygon().vertices().len());
        if !surface.polygon().is_triangle() {
            let halves = [
                (Vec2::ZERO, Vec2::new(0.5, 1.0)),
                (Vec2::new(0.5, 0.0), Vec2::ONE),
            ];
            let part = |(from, to)| {
                texture.mean_over(from, to).g * surface.polygon().part(from, to).area()
            };
            let mean = halves.map(part).iter().sum::<f32>() / surface.polygon().area();
            assert!((mean - whole.g).abs() < 1e-4, "{mean} {whole:?}");
        }
    }
}

#[test]
fn light_files_of_the_references_add_their_lights() {
    let Some(data) = data_dir() else { return };
    for name in ["bevy_cornell", "gazebo", "tinyobj_cornell"] {
        let scene = scene_file(&data, name);
        let lights = data.join("truth").join(name).join("lights.toml");
        let without = import(&scene).scene;
        let with = load(&scene, Some(&lights))
            .unwrap_or_else(|error| panic!("{error}"))
            .scene;
        assert_eq!(with.surfaces, without.surfaces);
        let names: Vec<&str> = with
            .lights
            .iter()
            .map(|light| light.name.as_str())
            .collect();
        let old: Vec<&str> = without
            .lights
            .iter()
            .map(|light| light.name.as_str())
            .collect();
        assert_eq!(names, [&old[..], &["bulb", "spot"]].concat());
        assert_eq!(with.luminaires.len(), 2);
    }
}

#[test]
fn a_hundred_thousand_lights_are_refused_or_grouped() {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("s.obj");
    fs::write(&scene, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    let lights = folder.path().join("l.toml");
    let write = |name: &dyn Fn(usize) -> String| {
        let entry = |i| {
            let name = name(i);
            format!(
                "[[light]]\nname='{name}'\nkind='point'\nposition=[0,0,{i}]\nemission=[1,1,1]\n"
            )
        };
        fs::write(&lights, (0..100_000).map(entry).collect::<String>()).unwrap();
    };
    write(&|i| format!("l{i}"));
    let message = load(&scene, Some(&lights)).unwrap_err().to_string();
    assert!(message.ends_with("100000 lights, but at most 65535 fit; give lights that are switched together the same name"), "{message}");
    write(&|_| "bank".to_owned());
    let scene = load(&scene, Some(&lights)).unwrap().scene;
    assert_eq!((scene.lights.len(), scene.luminaires.len()), (1, 100_000));
}

/// Imports the bytes under the name; errors must be one line, and nothing may panic.
fn import_damaged(folder: &Path, name: &str, bytes: &[u8]) {
    let path = folder.join(name);
    fs::write(&path, bytes).unwrap();
    if let Err(error) = load(&path, None) {
        let message = error.to_string();
        assert!(
            message.contains(name) && !message.contains('\n'),
            "{message:?}"
        );
    }
}

/// Cuts a file off at every `step`-th byte, and flips bits of every `step`-th one.
fn damage(folder: &Path, name: &str, bytes: &[u8], step: usize) {
    for at in (0..bytes.len()).step_by(step) {
        import_damaged(folder, name, &bytes[..at]);
        let mut flipped = bytes.to_vec();
        flipped[at] ^= (at * 37 % 255 + 1) as u8;
        import_damaged(folder, name, &flipped);
    }
}

#[test]
fn damaged_glb_files_never_panic() {
    let Some(data) = data_dir() else { return };
    let folder = tempfile::tempdir().unwrap();
    for (name, step) in [("CornellBox.glb", 3), ("tile-game-room6.glb", 11)] {
        let bytes = fs::read(data.join("originals").join(name)).unwrap();
        damage(folder.path(), name, &bytes, step);
    }
}

#[test]
fn digits_of_a_glb_replaced_by_nines_never_panic() {
    let Some(data) = data_dir() else { return };
    let folder = tempfile::tempdir().unwrap();
    let bytes = fs::read(data.join("originals/CornellBox.glb")).unwrap();
    let digits = (0..bytes.len()).filter(|at| bytes[*at].is_ascii_digit());
    for at in digits {
        for digit in *b"09" {
            let mut changed = bytes.clone();
            changed[at] = digit;
            import_damaged(folder.path(), "nines.glb", &changed);
        }
    }
}

#[test]
fn damaged_obj_files_never_panic() {
    let Some(data) = data_dir() else { return };
    let folder = tempfile::tempdir().unwrap();
    let originals = data.join("originals");
    let materials = fs::read(originals.join("cornell_box.mtl")).unwrap();
    fs::write(folder.path().join("cornell_box.mtl"), &materials).unwrap();
    let scene = fs::read(originals.join("cornell_box.obj")).unwrap();
    damage(folder.path(), "cornell_box.obj", &scene, 2);

    // Damage to the materials, seen through the scene that uses them.
    let path = folder.path().join("cornell_box.obj");
    fs::write(&path, &scene).unwrap();
    for at in 0..materials.len() {
        let mut flipped = materials.clone();
        flipped[at] ^= (at * 41 % 255 + 1) as u8;
        for bytes in [&materials[..at], &flipped] {
            fs::write(folder.path().join("cornell_box.mtl"), bytes).unwrap();
            if let Err(error) = load(&path, None) {
                assert!(!error.to_string().contains('\n'), "{error}");
            }
        }
    }
}
