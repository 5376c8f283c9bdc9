use super::*;
use glam::DVec3;

/// Vector areas of all surfaces of a range, summed.
fn vector_area(surfaces: &[Surface]) -> DVec3 {
    let area = |s: &Surface| s.polygon().normal().as_dvec3() * f64::from(s.polygon().area());
    surfaces.iter().map(area).sum()
}

fn area(surfaces: &[Surface]) -> f32 {
    surfaces.iter().map(|s| s.polygon().area()).sum()
}

/// True when every front faces `inside`.
fn face(surfaces: &[Surface], inside: Vec3) -> bool {
    let height = |s: &Surface| (inside - s.polygon().vertices()[0]).dot(s.polygon().normal());
    surfaces.iter().all(|s| height(s) > 0.0)
}

/// True when every front turns its back to `inside`.
fn face_away(surfaces: &[Surface], inside: Vec3) -> bool {
    let height = |s: &Surface| (inside - s.polygon().vertices()[0]).dot(s.polygon().normal());
    surfaces.iter().all(|s| height(s) < 0.0)
}

#[test]
fn furnaces_are_closed_and_face_inwards() {
    let cube = white_furnace(0.5, 1.0).unwrap().scene;
    assert_eq!(cube.surfaces.len(), 6);
    assert!(vector_area(&cube.surfaces).length() < 1e-6);
    assert!((area(&cube.surfaces) - 6.0).abs() < 1e-6);
    assert!(face(&cube.surfaces, Vec3::splat(0.5)));

    let room = furnace_with_box(0.5, 1.0).unwrap().scene;
    let (walls, inside) = room.surfaces.split_at(6);
    assert!((area(walls) - 13.0).abs() < 1e-5);
    assert!(vector_area(walls).length() < 1e-6 && vector_area(inside).length() < 1e-6);
    let middle = Vec3::new(0.8, 0.6, 0.4);
    assert!(face(walls, middle) && face_away(inside, middle));
    for surface in &room.surfaces {
        let emission = surface.emission().unwrap();
        assert_eq!((emission.light, emission.share), (0, Rgb::WHITE));
    }
}

#[test]
fn furnaces_refuse_what_is_no_reflectance_or_exitance() {
    assert!(matches!(
        white_furnace(1.0, 1.0),
        Err(BuiltinError::Surface(_))
    ));
    for exitance in [-1.0, f32::NAN, f32::INFINITY] {
        assert!(matches!(
            furnace_with_box(0.5, exitance),
            Err(BuiltinError::Emission(_))
        ));
    }
}

#[test]
fn the_cornell_box_is_open_to_the_viewer_only() {
    let Builtin { scene, camera, .. } = cornell_box().unwrap();
    let (walls, rest) = scene.surfaces.split_at(5);
    let (blocks, lamps) = rest.split_at(10);
    let middle = Vec3::new(0.2764, 0.2744, 0.2796);
    assert!(face(walls, middle));

    // What is missing from the room is its front, what is missing from a block is its bottom.
    let front = DVec3::Z * 0.5528 * 0.5488;
    assert!(
        (vector_area(walls) + front).length() < 1e-6,
        "{}",
        vector_area(walls)
    );
    for (block, centre) in [
        (0, Vec3::new(0.186, 0.1, 0.169)),
        (5, Vec3::new(0.368, 0.1, 0.351)),
    ] {
        let block = &blocks[block..block + 5];
        let top = vector_area(&block[..1]);
        assert!((vector_area(block) - top).length() < 1e-6 && top.y > 0.02);
        assert!(face_away(block, centre));
    }
    assert!((area(lamps) - 0.130 * 0.105 - 0.08 * 0.12).abs() < 1e-6);
    assert!(face(lamps, middle));
    assert!(vector_area(walls).dot((camera.target - camera.eye).as_dvec3()) < 0.0);
}

#[test]
fn the_cornell_box_has_three_lights() {
    let scene = cornell_box().unwrap().scene;
    let names: Vec<&str> = scene.lights.iter().map(|l| l.name.as_str()).collect();
    assert_eq!(names, ["ceiling", "spot", "lamp"]);
    assert!(scene.view().is_ok());
}

#[test]
fn the_paper_room_is_the_exchanged_file() {
    for (lamps, name) in [
        (PaperLamps::One, "seed_room_1"),
        (PaperLamps::Three, "seed_room_3"),
        (PaperLamps::Eight, "seed_room_8"),
    ] {
        let room = paper_room(lamps).unwrap().scene;
        let (walls, inside) = (&room.surfaces[..6], &room.surfaces[6..12]);
        assert!(vector_area(walls).length() < 1e-5 && vector_area(inside).length() < 1e-5);
        assert!((area(walls) - 54.0).abs() < 1e-4 && (area(inside) - 6.0).abs() < 1e-4);
        assert!(face(walls, Vec3::splat(2.5)) && face_away(inside, Vec3::new(1.1, 1.0, 1.7)));

        let Some(file) = published::scene(name) else {
            continue;
        };
        assert_eq!(room.surfaces.len(), file.surfaces.len(), "{name}");
        for (number, (ours, theirs)) in room.surfaces.iter().zip(&file.surfaces).enumerate() {
            assert_eq!(ours.polygon(), theirs.polygon(), "{name} {number}");
            assert_eq!(ours.reflectance(), theirs.reflectance(), "{name} {number}");
            assert_eq!(ours.emission(), theirs.emission(), "{name} {number}");
        }
        assert_eq!(room.lights, file.lights);
    }
}
