//! Laws that any radiosity solution keeps: furnace, energy balance, reciprocity, superposition.

mod bake;

use bake::{baked, exact, room};
use glam::{Vec2, Vec3};
use relume::color::Rgb;
use relume::form_factor;
use relume::scene::{Emission, Luminaire, Source, Surface};
use relume_host::bake::{Method, Settings};
use relume_host::builtin::{cornell_box, furnace_with_box, white_furnace};
use relume_host::bvh::Bvh;
use relume_host::scene::{Light, OwnedScene};
use relume_host::solution::Solution;

/// Largest difference of two values over the larger channel of the first.
fn relative(exact: Rgb, found: Rgb) -> f32 {
    (exact - found).map(f32::abs).max_channel() / exact.max_channel()
}

#[test]
fn every_furnace_reaches_its_closed_form() {
    for reflectance in [0.01, 0.3, 0.5, 0.8, 0.95, 0.99] {
        // Share of the light that a bounce loses or gains. In the cube that is rounding, 16 of it.
        let cube = (white_furnace(reflectance, 1.0), 2e-6);
        // Shadows of the box are sampled by 16 rays a pair: 0.09 % was measured.
        let boxed = (furnace_with_box(reflectance, 1.0), 1e-3);
        for (name, (builtin, loss)) in [("cube", cube), ("box inside", boxed)] {
            let builtin = builtin.expect("a legal furnace");
            let solution = baked(&builtin.scene, &exact(&builtin));
            let expected = 1.0 / (1.0 - reflectance);
            let (mut sum, mut area) = (0.0, 0.0);
            for (element, value) in solution.mesh.elements.iter().zip(&solution.contributions) {
                sum += f64::from(value.g * element.area);
                area += f64::from(element.area);
            }
            let mean = (sum / area) as f32;
            let error = (mean / expected - 1.0).abs();
            let tolerance = loss / (1.0 - reflectance + loss);
            assert!(
                error < tolerance,
                "{name}, rho {reflectance}: {mean} instead of {expected}"
            );
            let largest = solution
                .contributions
                .iter()
                .map(|value| (value.g / expected - 1.0).abs())
                .fold(0.0, f32::max);
            // Single elements of the box's room lie in its sampled shadows.
            let everywhere = if name == "cube" {
                2.0 * tolerance + 2e-5
            } else {
                0.3
            };
            assert!(
                largest < everywhere,
                "{name}, rho {reflectance}: {largest} off"
            );
        }
    }
}

#[test]
fn nothing_shows_through_the_walls_of_a_furnace() {
    let reflectance = 0.8;
    for method in [Method::Gather, Method::Rows] {
        let mut builtin = white_furnace(reflectance, 1.0).expect("a legal furnace");
        let settings = Settings {
            method,
            ..exact(&builtin)
        };
        // Black squares in the planes of the walls, which emit and so lie on top.
        let scene = &mut builtin.scene;
        let walls = scene.surfaces.clone();
        let squares = walls.iter().zip(100..).map(|(wall, number)| {
            let square = wall.polygon().part(Vec2::splat(0.2), Vec2::splat(0.9));
            Surface::new(number, square.vertices(), Rgb::BLACK).expect("a square")
        });
        scene.surfaces.splice(0..0, squares);
        scene.textures.splice(0..0, walls.iter().map(|_| None));
        let solution = baked(scene, &settings);
        assert_eq!(solution.surfaces.len(), 12);
        let expected = 1.0 / (1.0 - reflectance);
        for (element, value) in solution.contributions.iter().enumerate() {
            // As in the furnace without them.
            assert!(
                (value.g / expected - 1.0).abs() < 4e-5,
                "{method:?}, element {element}: {value:?} instead of {expected}"
            );
        }
    }
}

/// Power that elements absorb from a light, and power that it emits, summed over the channels.
fn balance(solution: &Solution, light: usize) -> (f64, f64) {
    let sum = |value: Rgb| f64::from(value.r) + f64::from(value.g) + f64::from(value.b);
    let elements = solution.mesh.elements.iter().enumerate();
    let absorbed = elements
        .map(|(number, element)| {
            let kept = Rgb::WHITE - element.reflectance;
            sum(kept * solution.element(number)[light]) * f64::from(element.area)
        })
        .sum();
    let emitting = solution.mesh.patches.iter().filter_map(|patch| {
        let emission = solution.mesh.faces[patch.face as usize].emission?;
        (emission.light as usize == light).then(|| sum(emission.share) * f64::from(patch.area))
    });
    (absorbed, emitting.sum())
}

#[test]
fn a_closed_room_absorbs_what_its_lamps_emit() {
    let room = room();
    let solution = baked(&room.scene, &exact(&room));
    for light in 0..3 {
        let (absorbed, emitted) = balance(&solution, light);
        // The lamps themselves absorb a little: they are black and 0.04 m2 in 60 m2. Sampled
        // shadows lose no more than one per cent.
        assert!(
            absorbed <= emitted * 1.00001,
            "light {light}: {absorbed} of {emitted}"
        );
        assert!(
            absorbed >= emitted * 0.98,
            "light {light}: {absorbed} of {emitted}"
        );
    }
}

#[test]
fn a_closed_room_keeps_its_energy_when_rows_are_estimated() {
    let room = room();
    let solve = |shots| {
        let settings = Settings {
            shots,
            ..exact(&room)
        };
        baked(&room.scene, &settings)
    };
    let whole = solve(None);
    for shots in [0, 3, 20] {
        let part = solve(Some(shots));
        assert_eq!(part.rows, shots);
        for light in 0..3 {
            let ((absorbed, emitted), (exact, _)) = (balance(&part, light), balance(&whole, light));
            // Receiver sums are one, but what a patch sends in all is not scaled: 0.0017 was measured, without any row.
            let change = (absorbed - exact).abs() / emitted;
            assert!(
                change < 0.005,
                "{shots} rows, light {light}: {absorbed}, not {exact}"
            );
        }
    }
}

#[test]
fn form_factors_between_patches_are_reciprocal() {
    let room = room();
    let solution = baked(
        &room.scene,
        &Settings {
            residual: 0.5,
            ..exact(&room)
        },
    );
    let mesh = solution.mesh.view();
    let bvh = Bvh::for_scene(&room.scene.view().expect("legal"));
    let count = mesh.patches.len();
    // power[i][j] = A_j F_ji: what j gets of a unit of radiosity of i.
    let mut power = vec![vec![0.0_f32; count]; count];
    let mut row = vec![0.0; mesh.elements.len()];
    for (patch, power) in power.iter_mut().enumerate() {
        form_factor::row(&mesh, patch as u32, &bvh, &mut row);
        for (factor, element) in row.iter().zip(mesh.elements) {
            power[element.patch as usize] += factor * element.area;
        }
    }
    let (mut difference, mut total) = (0.0, 0.0);
    // Lamps are black and receive nothing.
    let is_lamp = |patch: usize| mesh.patch_emission(patch as u32).is_some();
    for (i, from_i) in power.iter().enumerate().filter(|(i, _)| !is_lamp(*i)) {
        for (j, from_j) in power
            .iter()
            .enumerate()
            .take(i)
            .filter(|(j, _)| !is_lamp(*j))
        {
            difference += (from_i[j] - from_j[i]).abs();
            total += from_i[j];
        }
    }
    // Both directions sample their receivers and shadows on their own; 2 % of the power in all.
    assert!(difference < 0.02 * total, "{difference} of {total}");
}

#[test]
fn tagged_lights_are_those_of_separate_solves() {
    let room = room();
    let tagged = baked(&room.scene, &exact(&room));
    for light in 0..3 {
        let mut alone = room.scene.clone();
        alone.lights = vec![room.scene.lights[light].clone()];
        for surface in &mut alone.surfaces {
            let own = surface.emission().filter(|e| e.light as usize == light);
            let vertices = surface.polygon().vertices().to_vec();
            let plain = Surface::new(0, &vertices, surface.reflectance().get());
            let plain = plain.expect("legal before").two_sided();
            *surface = match own {
                Some(emission) => {
                    let emission = Emission {
                        light: 0,
                        ..emission
                    };
                    plain.emitting(0, emission).expect("legal before")
                }
                None => plain,
            };
        }
        let solution = baked(&alone, &exact(&room));
        for element in 0..solution.mesh.elements.len() {
            let (one, all) = (solution.element(element)[0], tagged.element(element)[light]);
            assert!(
                relative(one, all) < 1e-4,
                "light {light}, element {element}: {one:?} {all:?}"
            );
        }
    }
}

#[test]
fn all_lights_under_one_tag_are_the_sum_of_the_solos() {
    let room = room();
    let tagged = baked(&room.scene, &exact(&room));
    let mut together = room.scene.clone();
    together.lights.truncate(1);
    for surface in &mut together.surfaces {
        if let Some(emission) = surface.emission() {
            let emission = Emission {
                light: 0,
                ..emission
            };
            *surface = surface.emitting(0, emission).expect("legal before");
        }
    }
    let together = baked(&together, &exact(&room));
    for element in 0..together.mesh.elements.len() {
        let solos = tagged.element(element).iter();
        let sum = solos.fold(Rgb::BLACK, |sum, value| sum + *value);
        let all = together.element(element)[0];
        assert!(
            relative(all, sum) < 1e-5,
            "element {element}: {sum:?} {all:?}"
        );
    }
}

#[test]
fn a_lamp_is_the_sum_of_its_four_quarters() {
    let room = room();
    let whole = baked(&room.scene, &exact(&room));
    let mut quartered = room.scene.clone();
    let lamp = quartered
        .surfaces
        .iter()
        .position(|s| s.emission().is_some_and(|e| e.light == 0));
    let lamp = quartered.surfaces.remove(lamp.expect("there is a lamp"));
    for (s, t) in [(0.0, 0.0), (0.5, 0.0), (0.0, 0.5), (0.5, 0.5)] {
        let from = glam::Vec2::new(s, t);
        let part = lamp.polygon().part(from, from + 0.5);
        let quarter = Surface::new(0, part.vertices(), Rgb::BLACK);
        let emission = lamp.emission().expect("it is a lamp");
        let quarter = quarter.and_then(|q| q.two_sided().emitting(0, emission));
        quartered.surfaces.push(quarter.expect("a legal quarter"));
    }
    quartered.textures.clear();
    let quarters = baked(&quartered, &exact(&room));
    let (mut difference, mut total) = (0.0, 0.0);
    for element in 0..quarters.mesh.elements.len() {
        let (one, four) = (whole.element(element)[0], quarters.element(element)[0]);
        difference += (one - four).map(f32::abs).mean_channel();
        total += one.mean_channel();
    }
    // Shadows of the whole lamp are sampled by 16 rays, those of the quarters by 64.
    assert!(difference < 0.01 * total, "{difference} of {total}");
}

#[test]
fn luminaires_balance_too() {
    // A point light in the middle of a closed cube gives each wall a sixth of 4 pi W.
    let mut scene = OwnedScene {
        surfaces: white_furnace(0.5, 1.0).expect("legal").scene.surfaces,
        ..OwnedScene::default()
    };
    scene.surfaces = scene
        .surfaces
        .iter()
        .map(|s| Surface::new(0, s.polygon().vertices(), Rgb::splat(0.5)).expect("legal"))
        .collect();
    let source = Source::Point {
        position: Vec3::splat(0.5),
    };
    scene.luminaires = vec![Luminaire::new(0, Rgb::WHITE, source).expect("legal")];
    scene.lights = vec![Light {
        name: "bulb".to_owned(),
        emission: Rgb::WHITE,
        importance: 1.0,
    }];
    let settings = Settings {
        patch: Some(0.25),
        element: Some(0.0625),
        residual: 1e-6,
        split_direct: true,
        ..Settings::default()
    };
    let solution = baked(&scene, &settings);
    let (absorbed, _) = balance(&solution, 0);
    let emitted = 3.0 * 4.0 * std::f64::consts::PI;
    assert!(
        (absorbed / emitted - 1.0).abs() < 1e-3,
        "{absorbed} of {emitted}"
    );
    let direct = solution.direct.as_ref().expect("it was split");
    let arrived: f64 = solution
        .mesh
        .elements
        .iter()
        .zip(direct)
        .map(|(element, value)| f64::from(element.area * value.g))
        .sum();
    assert!((arrived / (emitted / 3.0) - 1.0).abs() < 1e-3, "{arrived}");
}

#[test]
fn threads_and_the_device_give_the_same_bits() {
    let scene = cornell_box().expect("legal");
    let bytes = |threads: usize, method: Method, shots: Option<u32>| {
        let settings = Settings {
            shots,
            patch: Some(0.2),
            element: Some(0.05),
            split_direct: true,
            method,
            ..Settings::default()
        };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let baked = pool
            .expect("threads")
            .install(|| baked(&scene.scene, &settings));
        relume_host::solution::write(&baked)
    };
    // Rows to the end, and rows that are missing: then they are estimated.
    for (method, shots) in [
        (Method::Gather, None),
        (Method::Rows, None),
        (Method::Rows, Some(9)),
    ] {
        let one = bytes(1, method, shots);
        for threads in [2, 5] {
            assert!(
                one == bytes(threads, method, shots),
                "{method:?}, {threads} threads"
            );
        }
        if method == Method::Rows {
            assert!(one == bytes(1, Method::Device, shots), "device, {shots:?}");
        }
    }
}
