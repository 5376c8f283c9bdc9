extern crate std;

use super::*;
use crate::form_factor;
use crate::mesh::{MeshStorage, Spacing, subdivide};
use crate::scene::{Emission, Scene, Surface};
use crate::visibility::Occluders;
use glam::Vec3;
use std::vec;
use std::vec::Vec;

const ELEMENTS: usize = 96;

/// A closed cube, every wall with its own light if `lights` is 6, else all with light 0.
fn cube(reflectance: f32, lights: u32) -> Vec<Surface> {
    let walls = [Vec3::X, Vec3::Y, Vec3::Z]
        .into_iter()
        .flat_map(|axis| [axis, -axis]);
    walls
        .zip(0..)
        .map(|(out, index)| {
            let (u, v) = out.any_orthonormal_pair();
            let (u, v) = if u.cross(v).dot(out) > 0.0 {
                (v, u)
            } else {
                (u, v)
            };
            let corners = [out - u - v, out + u - v, out + u + v, out - u + v];
            let emission = Emission {
                light: index % lights,
                share: Rgb::new(1.0, 0.5, 0.25),
            };
            Surface::new(
                index,
                &corners,
                Rgb::new(reflectance, reflectance / 2.0, 0.1),
            )
            .and_then(|s| s.emitting(index, emission))
            .unwrap()
        })
        .collect()
}

fn meshed(surfaces: &[Surface], lights: u32) -> MeshStorage<6, 24, ELEMENTS> {
    let scene = Scene::new(surfaces, &[], lights).unwrap();
    let mut storage = MeshStorage::new();
    let spacing = Spacing {
        patch: 1.0,
        element: 0.5,
    };
    subdivide(&scene, spacing, |_, _| true, &mut storage).unwrap();
    storage
}

struct Solved {
    irradiance: Vec<Vec<Rgb>>,
    rows: u32,
    residual: f32,
}

/// Memory that the test owns: any number of blocks, direct light kept apart or not.
struct Lent<const K: usize> {
    irradiance: Vec<Lanes<K>>,
    direct: Vec<Lanes<K>>,
    unshot: Vec<Lanes<K>>,
    patches: Vec<PatchState>,
    blocks: Vec<Block<K>>,
}

impl<const K: usize> Lent<K> {
    fn new(blocks: usize, split: bool) -> Self {
        let zero = [[0.0; K]; 3];
        Self {
            irradiance: vec![zero; blocks * ELEMENTS],
            direct: vec![zero; if split { blocks * ELEMENTS } else { 0 }],
            unshot: vec![zero; blocks * 24],
            patches: vec![PatchState::EMPTY; 24],
            blocks: vec![Block::EMPTY; blocks],
        }
    }

    fn storage(&mut self) -> Storage<'_, K> {
        Storage {
            irradiance: &mut self.irradiance,
            direct: &mut self.direct,
            unshot: &mut self.unshot,
            patches: &mut self.patches,
            blocks: &mut self.blocks,
            rows: RowStorage::default(),
        }
    }
}

/// Shoots until the residual is reached.
fn run<const K: usize>(refinement: &mut Refinement<K>, mesh: &Mesh, surfaces: &[Surface]) {
    let mut row = [0.0; ELEMENTS];
    while let Some(patch) = refinement.next_shooter() {
        form_factor::row(mesh, patch, &Occluders::new(surfaces), &mut row);
        refinement.shoot(patch, &row).unwrap();
    }
    refinement.finish();
}

fn solve<const K: usize, const ROWS: usize>(
    surfaces: &[Surface],
    lights: u32,
    residual: f32,
) -> Solved {
    let storage = meshed(surfaces, lights);
    let mesh = storage.mesh();
    let mut memory = FixedStorage::<K, 24, ELEMENTS, ROWS>::new();
    let mut refinement = Refinement::new(mesh, lights, residual, memory.storage()).unwrap();
    run(&mut refinement, &mesh, surfaces);
    let irradiance = (0..ELEMENTS as u32)
        .map(|element| {
            (0..lights)
                .map(|l| refinement.irradiance(element, l))
                .collect()
        })
        .collect();
    Solved {
        irradiance,
        rows: refinement.rows_evaluated(),
        residual: refinement.residual(),
    }
}

#[test]
fn a_white_furnace_has_its_closed_form_in_every_channel() {
    for reflectance in [0.0, 0.3, 0.8, 0.95] {
        let solved = solve::<1, 24>(&cube(reflectance, 1), 1, 1e-6);
        // B = M / (1 - rho), and the irradiance is the radiosity of the walls.
        let channels = [(1.0, reflectance), (0.5, reflectance / 2.0), (0.25, 0.1)];
        for (element, values) in solved.irradiance.iter().enumerate() {
            for ((exitance, rho), found) in channels.into_iter().zip(values[0].to_array()) {
                let exact = exitance / (1.0 - rho);
                // All the unshot power, 1e-6 of what 24 patches emitted, may sit in one channel of
                // one patch and is amplified by its bounces; 2e-5: rounding of receiver sums.
                let tolerance = 24e-6 * (1.75 / exitance) / (1.0 - rho) + 2e-5;
                assert!(
                    (found / exact - 1.0).abs() < tolerance,
                    "rho {rho} element {element}: {found} {exact}"
                );
            }
        }
    }
}

#[test]
fn the_sum_of_tagged_lights_is_the_light_of_all() {
    let tagged = solve::<8, 24>(&cube(0.7, 6), 6, 1e-5);
    let together = solve::<1, 24>(&cube(0.7, 1), 1, 1e-5);
    for (element, (solos, all)) in tagged
        .irradiance
        .iter()
        .zip(&together.irradiance)
        .enumerate()
    {
        let sum = solos.iter().fold(Rgb::BLACK, |sum, value| sum + *value);
        let error = (sum - all[0]).map(f32::abs).max_channel() / all[0].max_channel();
        assert!(error < 1e-4, "element {element}: {sum:?} {:?}", all[0]);
    }
}

#[test]
fn blocks_and_lanes_do_not_change_the_result() {
    let one_block = solve::<8, 24>(&cube(0.7, 6), 6, 1e-5);
    let surfaces = cube(0.7, 6);
    let storage = meshed(&surfaces, 6);
    let mesh = storage.mesh();
    let mut memory = Lent::<4>::new(2, false);
    let mut refinement = Refinement::new(mesh, 6, 1e-5, memory.storage()).unwrap();
    run(&mut refinement, &mesh, &surfaces);
    for (element, values) in (0..).zip(&one_block.irradiance) {
        for (light, value) in (0..).zip(values) {
            let found = refinement.irradiance(element, light);
            let error = (found - *value).map(f32::abs).max_channel();
            assert!(error < 1e-4 * value.max_channel(), "{element} {light}");
        }
    }
}

#[test]
fn a_known_row_is_never_asked_for_again() {
    for reflectance in [0.5, 0.99] {
        let cached = solve::<1, 24>(&cube(reflectance, 1), 1, 1e-5);
        assert!(cached.rows <= 24, "rho {reflectance}: {} rows", cached.rows);
        assert!(cached.residual <= 1e-5);

        let some = solve::<1, 7>(&cube(reflectance, 1), 1, 1e-5);
        let none = solve::<1, 0>(&cube(reflectance, 1), 1, 1e-5);
        assert!(cached.rows < some.rows && some.rows < none.rows);
        for (element, values) in cached.irradiance.iter().enumerate() {
            for other in [&some, &none] {
                let (exact, found) = (values[0].r, other.irradiance[element][0].r);
                // 1e-5 of the power of 24 patches may be unshot, and is amplified by its bounces.
                let tolerance = 24e-5 * 1.75 / (1.0 - reflectance) + 1e-4;
                let error = (found / exact - 1.0).abs();
                assert!(
                    error < tolerance,
                    "rho {reflectance}, {element}: {found} {exact}"
                );
            }
        }
    }
}

#[test]
fn finishing_twice_or_in_between_changes_nothing_but_rounding() {
    let surfaces = cube(0.9, 6);
    let storage = meshed(&surfaces, 6);
    let mesh = storage.mesh();
    let at_once = solve::<6, 24>(&surfaces, 6, 1e-5);
    let mut memory = FixedStorage::<6, 24, ELEMENTS, 24>::new();
    let mut refinement = Refinement::new(mesh, 6, 1e-5, memory.storage()).unwrap();
    let mut row = [0.0; ELEMENTS];
    while let Some(patch) = refinement.next_shooter() {
        form_factor::row(&mesh, patch, &Occluders::new(&surfaces), &mut row);
        refinement.shoot(patch, &row).unwrap();
        refinement.finish();
    }
    refinement.finish();
    for (element, values) in (0..).zip(&at_once.irradiance) {
        for (light, exact) in (0..).zip(values) {
            let found = refinement.irradiance(element, light);
            let error = (found - *exact).map(f32::abs).max_channel();
            assert!(
                error < 1e-4 * exact.max_channel(),
                "{element} {light}: {found:?} {exact:?}"
            );
        }
    }
}

#[test]
fn a_light_does_not_depend_on_its_neighbours() {
    let surfaces = cube(0.9, 6);
    let storage = meshed(&surfaces, 6);
    let mesh = storage.mesh();
    let solve = |only: Option<u32>| {
        let mut memory = FixedStorage::<6, 24, ELEMENTS, 24>::new();
        let mut refinement = Refinement::new(mesh, 6, 1e-5, memory.storage()).unwrap();
        // The same rows in another order: a light that is alone is shot first.
        if let Some(light) = only {
            refinement.set_importance(light, 1e6).unwrap();
        }
        run(&mut refinement, &mesh, &surfaces);
        assert_eq!(refinement.rows_evaluated(), 24);
        let values = (0..ELEMENTS as u32).map(|element| refinement.irradiance(element, 2));
        values.collect::<Vec<Rgb>>()
    };
    assert_eq!(solve(None), solve(Some(2)), "to the bit");
}

#[test]
fn direct_light_is_kept_apart() {
    let surfaces = cube(0.6, 1);
    let storage = meshed(&surfaces, 1);
    let mesh = storage.mesh();
    let mut memory = Lent::<1>::new(1, true);
    let mut refinement = Refinement::new(mesh, 1, 1e-5, memory.storage()).unwrap();
    run(&mut refinement, &mesh, &surfaces);
    for element in 0..ELEMENTS as u32 {
        let found = refinement.direct(element, 0);
        assert!((found.r - 1.0).abs() < 1e-4, "{element}: {found:?}");
    }
}

#[test]
fn an_early_stop_plus_ambient_beats_an_early_stop() {
    let surfaces = cube(0.9, 1);
    let storage = meshed(&surfaces, 1);
    let mesh = storage.mesh();
    let mut memory = FixedStorage::<1, 24, ELEMENTS, 24>::new();
    let mut refinement = Refinement::new(mesh, 1, 1e-5, memory.storage()).unwrap();
    let mut row = [0.0; ELEMENTS];
    for _ in 0..12 {
        let patch = refinement.next_shooter().unwrap();
        form_factor::row(&mesh, patch, &Occluders::new(&surfaces), &mut row);
        refinement.shoot(patch, &row).unwrap();
    }
    refinement.finish();
    let ambient = refinement.ambient(0);
    let exact = 1.0 / (1.0 - 0.9);
    let error = |ambient: f32| -> f32 {
        (0..ELEMENTS as u32)
            .map(|e| (refinement.irradiance(e, 0).r + ambient - exact).abs())
            .sum()
    };
    assert!(
        error(ambient.r) < 0.3 * error(0.0),
        "{} {}",
        error(ambient.r),
        error(0.0)
    );
}

#[test]
fn too_small_storage_names_its_limit() {
    let surfaces = cube(0.5, 6);
    let storage = meshed(&surfaces, 6);
    let mesh = storage.mesh();
    let mut lights = FixedStorage::<4, 24, ELEMENTS, 0>::new();
    assert_eq!(
        Refinement::new(mesh, 6, 1e-3, lights.storage()).err(),
        Some(RefineError::TooManyLights { limit: 4 })
    );
    let mut elements = FixedStorage::<4, 24, 95, 0>::new();
    assert_eq!(
        Refinement::new(mesh, 4, 1e-3, elements.storage()).err(),
        Some(RefineError::TooManyElements { limit: 95 })
    );
    let mut patches = FixedStorage::<4, 23, ELEMENTS, 0>::new();
    assert_eq!(
        Refinement::new(mesh, 4, 1e-3, patches.storage()).err(),
        Some(RefineError::TooManyPatches { limit: 23 })
    );
    for residual in [0.0, -1.0, f32::NAN] {
        let mut memory = FixedStorage::<4, 24, ELEMENTS, 0>::new();
        let found = Refinement::new(mesh, 4, residual, memory.storage()).err();
        assert_eq!(found, Some(RefineError::Residual), "{residual}");
    }
}

#[test]
fn illegal_rows_and_importances_are_refused_and_change_nothing() {
    let surfaces = cube(0.5, 1);
    let storage = meshed(&surfaces, 1);
    let mesh = storage.mesh();
    let mut memory = FixedStorage::<1, 24, ELEMENTS, 24>::new();
    let mut refinement = Refinement::new(mesh, 1, 1e-3, memory.storage()).unwrap();
    let mut row = [0.01; ELEMENTS];
    let short = refinement.shoot(0, &row[1..]);
    assert_eq!(short, Err(RefineError::Row { element: 95 }));
    for bad in [f32::NAN, -0.1, 1.1] {
        row[7] = bad;
        assert_eq!(
            refinement.shoot(0, &row),
            Err(RefineError::Row { element: 7 })
        );
    }
    assert_eq!(
        refinement.shoot(24, &[0.0; ELEMENTS]),
        Err(RefineError::Unknown)
    );
    for bad in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        assert_eq!(
            refinement.set_importance(0, bad),
            Err(RefineError::Importance { light: 0 })
        );
    }
    assert_eq!(refinement.set_importance(1, 1.0), Err(RefineError::Unknown));
    assert_eq!(
        (refinement.rows_evaluated(), refinement.residual()),
        (0, 1.0)
    );
}
