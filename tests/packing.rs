//! What packing promises: sizes, errors on a display, and the proof of the logarithmic tiles.
//!
//! Errors are those that the program reports, over all states of `relume_host::display_error`; two tests
//! measure them again from outside, from what `probe` prints.

mod command;
mod data;
mod skip;

use std::ops::ControlFlow;

use command::Folder;
use data::data_dir;
use glam::{Vec2, Vec3};
use relume::atlas::{Atlas, Quantity};
use relume::code::Code;
use relume::color::Rgb;
use relume::geometry::Polygon;
use relume::mesh::{Element, Face, Patch, Side, Spacing};
use relume::relight::{Wide, WideWeight, relight_wide};
use relume_host::bake::{Settings, bake};
use relume_host::display_error::max_codes;
use relume_host::export::exr::{encode_light_layers, read_light_layers};
use relume_host::import;
use relume_host::mesh::OwnedMesh;
use relume_host::noise;
use relume_host::pack::{
    Aim, Format, Packing, PackingError, Request, choose, contributions, pack_measured,
    relight_atlas,
};
use relume_host::picture::LinearImage;
use relume_host::solution::{Method, Solution, SolutionLight};

/// Light counts of the issue.
const COUNTS: [usize; 9] = [1, 3, 8, 10, 16, 32, 64, 128, 256];

fn bake_scene(name: &str, element: Option<f32>) -> Option<Solution> {
    let file = data_dir()?.join("scenes").join(name).join("scene.obj");
    let scene = import::load(&file, None).expect("a legal scene").scene;
    let settings = Settings {
        patch: element.map(|_| 1.0),
        element,
        ..Settings::default()
    };
    let solution = bake(&scene, &settings, &mut |_| ControlFlow::Continue(()));
    Some(solution.expect("a legal scene"))
}

/// The first lights of a solution.
fn first(solution: &Solution, lights: usize) -> Solution {
    let mut mesh = solution.mesh.clone();
    for face in &mut mesh.faces {
        face.emission = face.emission.filter(|e| (e.light as usize) < lights);
    }
    let elements = solution.contributions.chunks(solution.lights.len());
    Solution {
        surfaces: solution.surfaces.clone(),
        luminaires: Vec::new(),
        mesh,
        image: None,
        lights: solution.lights[..lights].to_vec(),
        contributions: elements.flat_map(|v| v[..lights].iter().copied()).collect(),
        direct: None,
        exposed: Vec::new(),
        method: solution.method,
        rows: solution.rows,
        spacing: solution.spacing,
    }
}

fn packed(solution: &Solution, packing: impl Into<Packing>) -> (Vec<u8>, PackingError) {
    let format = Format {
        packing: packing.into(),
        quantity: Quantity::Irradiance,
        mesh: false,
    };
    pack_measured(solution, format).expect("values in range")
}

/// Bits per RGB element and light of a whole atlas.
fn bits(bytes: &[u8], solution: &Solution) -> f64 {
    8.0 * bytes.len() as f64 / solution.contributions.len() as f64
}

fn chosen(solution: &Solution, aim: Aim) -> (Vec<u8>, PackingError) {
    let request = Request {
        aim,
        given: &vec![None; solution.lights.len()],
        quantity: Quantity::Irradiance,
        mesh: false,
    };
    let choice = choose(solution, request).expect("something fits");
    (choice.bytes, choice.error)
}

#[test]
fn display8_is_two_codes_off_at_any_number_of_lights() {
    for name in ["seed_room_64", "seed_room_256"] {
        let Some(room) = bake_scene(name, Some(0.25)) else {
            return;
        };
        assert_eq!(room.mesh.elements.len(), 960);
        for lights in COUNTS.into_iter().filter(|k| *k <= room.lights.len()) {
            let (bytes, error) = packed(&first(&room, lights), Code::Display8);
            let atlas = Atlas::parse(&bytes).expect("bytes just written");
            assert_eq!(atlas.code_bytes(), 960 * lights * 3);
            assert!(error.achromatic.packed <= 2.0, "{name} {lights}: {error:?}");
            assert!(error.achromatic.shown <= 2.0, "{name} {lights}: {error:?}");
            assert!(error.all.packed <= 3.0, "{name} {lights}: {error:?}");
        }
    }
}

#[test]
fn sixty_four_lights_take_less_than_the_paper_took_for_eight() {
    let Some(room) = bake_scene("seed_room_64", Some(0.25)) else {
        return;
    };
    let (bytes, error) = packed(&room, Code::Tiles);
    assert!(bytes.len() <= 84 * 1024, "{} bytes", bytes.len());
    assert!(error.achromatic.packed <= 1.0, "{error:?}");

    // Without a wish it is exact in all states, and as shown.
    let (bytes, error) = chosen(&room, Aim::Error(1.0));
    assert!(error.largest() <= 1.0, "{error:?}");
    let (log, log_error) = packed(&room, Code::TilesLog);
    assert!(log_error.largest() <= 1.0, "{log_error:?}");
    assert!(bytes.len() <= log.len());

    // What is more exact is larger.
    let mut last = usize::MAX;
    for limit in [0.5, 2.0, 8.0] {
        let (bytes, error) = chosen(&room, Aim::Error(limit));
        assert!(error.largest() <= limit, "{limit}: {error:?}");
        assert!(bytes.len() < last, "{limit}: {} bytes", bytes.len());
        last = bytes.len();
    }
    let mut last = f32::INFINITY;
    for budget in [50_000, 80_000, 120_000] {
        let (bytes, error) = chosen(&room, Aim::Bytes(budget));
        assert!(bytes.len() <= budget, "{budget}: {} bytes", bytes.len());
        assert!(error.largest() < last, "{budget}: {error:?}");
        last = error.largest();
    }
}

/// Bakes 8640 elements of 64 and of 256 lights: two minutes of CPU. The aims are those of the issue.
#[test]
#[ignore = "slow: run it by name"]
fn eight_bits_hold_an_element_on_the_fine_mesh() {
    for name in ["seed_room_64", "seed_room_256"] {
        let Some(room) = bake_scene(name, Some(0.083_333_3)) else {
            return;
        };
        assert_eq!(room.mesh.elements.len(), 8640);
        let (bytes, error) = packed(&room, Code::Tiles);
        let found = bits(&bytes, &room);
        println!("{name}: {found} bits in tiles, {error:?}");
        assert!(found <= 8.0, "{name}: {found} bits");
        assert!(error.achromatic.packed <= 1.0, "{name}: {error:?}");
        let (bytes, error) = packed(&room, Code::TilesLog);
        let found = bits(&bytes, &room);
        println!("{name}: {found} bits in tiles-log, {error:?}");
        assert!(found <= 10.0, "{name}: {found} bits");
        assert!(error.largest() <= 1.0, "{name}: {error:?}");
        for lights in COUNTS.into_iter().filter(|k| *k <= room.lights.len()) {
            let (_, error) = packed(&first(&room, lights), Code::Display8);
            let (achromatic, all) = (error.achromatic.packed, error.all.packed);
            println!("{name}: {lights} lights in display8, {achromatic} and {all} codes");
            assert!(achromatic <= 2.0, "{name} {lights}: {error:?}");
            assert!(all <= 3.0, "{name} {lights}: {error:?}");
        }
    }
}

#[test]
fn a_real_scene_is_packed_within_a_code() {
    let Some(scene) = bake_scene("gazebo", None) else {
        return;
    };
    let (bytes, error) = chosen(&scene, Aim::Error(1.0));
    println!("gazebo: {} bits, {error:?}", bits(&bytes, &scene));
    assert!(error.largest() <= 1.0, "{error:?}");
    let (log, _) = packed(&scene, Code::TilesLog);
    assert!(bytes.len() <= log.len(), "{} {}", bytes.len(), log.len());
}

/// Their darkest places are dark in all lights, and all lights are off the same way there.
#[test]
fn display8_is_two_codes_off_in_real_scenes() {
    for name in ["bevy_cornell", "gazebo"] {
        let Some(scene) = bake_scene(name, None) else {
            return;
        };
        let (_, error) = packed(&scene, Code::Display8);
        println!("{name}: {error:?}");
        assert!(error.achromatic.packed <= 2.0, "{name}: {error:?}");
        assert!(error.all.packed <= 3.0, "{name}: {error:?}");
    }
}

/// A closed box that is seen from inside, 4 x 3 x 3, with a lamp under its ceiling.
fn boxed(at: f32, number: usize, first_vertex: usize) -> String {
    let corners = [
        [0., 0., 0.],
        [4., 0., 0.],
        [4., 0., 3.],
        [0., 0., 3.],
        [0., 3., 0.],
        [4., 3., 0.],
        [4., 3., 3.],
        [0., 3., 3.],
        [1.5, 2.9, 1.],
        [2.5, 2.9, 1.],
        [2.5, 2.9, 2.],
        [1.5, 2.9, 2.],
    ];
    let vertices = corners.map(|[x, y, z]: [f32; 3]| format!("v {} {y} {z}\n", x + at));
    let face = |corners: [usize; 4]| {
        let [a, b, c, d] = corners.map(|corner| corner + first_vertex);
        format!("f {a} {b} {c} {d}\n")
    };
    let walls = [
        [0, 3, 2, 1],
        [4, 5, 6, 7],
        [0, 1, 5, 4],
        [2, 3, 7, 6],
        [1, 2, 6, 5],
        [3, 0, 4, 7],
    ];
    let walls = walls.map(face).concat();
    let lamp = face([8, 9, 10, 11]);
    format!(
        "{}usemtl wall\n{walls}usemtl lamp_{number}\n{lamp}",
        vertices.concat()
    )
}

#[test]
fn a_lamp_in_another_room_is_not_stored_twice() {
    let folder = Folder::new();
    folder.write(
        "rooms.mtl",
        "newmtl wall\nKd 0.6 0.5 0.4\nnewmtl lamp_0\nKd 0 0 0\nKe 5 5 5\nnewmtl lamp_1\nKd 0 0 0\nKe 3 4 5\n",
    );
    let library = "mtllib rooms.mtl\n";
    folder.write("one.obj", format!("{library}{}", boxed(0.0, 0, 1)));
    folder.write(
        "two.obj",
        format!("{library}{}{}", boxed(0.0, 0, 1), boxed(10.0, 1, 13)),
    );
    let info = |name: &str, code: &str| {
        folder.done(&format!("bake {name}.obj --patch 1 --element 0.25"));
        folder.done(&format!("pack {name}.solution --no-mesh {code}"));
        folder.json(&format!("info {name}.atlas"))
    };
    for code in ["--code tiles", "--code tiles-log", ""] {
        let (one, two) = (info("one", code), info("two", code));
        assert_eq!(two["elements"], 2 * one["elements"].as_u64().unwrap());
        let bits = |info: &serde_json::Value, light: usize| {
            info["per_light"][light]["bits_per_rgb"].as_f64().unwrap()
        };
        // Half the elements see the light; in the others a tile of 4 x 4 or more takes one bit.
        let half = bits(&one, 0) / 2.0 + 1.0 / 16.0;
        assert!(bits(&two, 0) <= 1.1 * half, "{code}: {one} {two}");
        // And nothing is calculated there.
        let products = |info: &serde_json::Value| info["multiply_adds_per_frame"].as_u64().unwrap();
        assert_eq!(products(&two), 2 * products(&one), "{code}");
    }
}

/// Irradiance per element and light, as `probe` prints it.
fn probed(folder: &Folder, file: &str) -> Vec<[f64; 3]> {
    let csv = folder.done(&format!("probe {file} --elements"));
    let csv = String::from_utf8(csv).expect("text");
    let rows = csv.lines().skip(1).map(|row| {
        let fields: Vec<&str> = row.split(',').collect();
        [2, 3, 4].map(|field| fields[field].parse().expect("a number"))
    });
    rows.collect()
}

/// The largest difference in display codes, written down anew in `f64`.
fn display_error(exact: &[[f64; 3]], found: &[[f64; 3]]) -> f64 {
    let mut luminances: Vec<f64> = exact
        .iter()
        .map(|[r, g, b]| 0.2126 * r + 0.7152 * g + 0.0722 * b)
        .collect();
    luminances.sort_by(f64::total_cmp);
    let place = 0.98 * (luminances.len() - 1) as f64;
    let (low, high) = (
        luminances[place as usize],
        luminances[place.ceil() as usize],
    );
    let white = low + place.fract() * (high - low);
    let code = |value: f64| {
        let u = (value / white).min(1.0);
        255.0
            * if u <= 0.003_130_8 {
                12.92 * u
            } else {
                1.055 * u.powf(1.0 / 2.4) - 0.055
            }
    };
    let pairs = exact.iter().flatten().zip(found.iter().flatten());
    pairs
        .map(|(a, b)| (code(*a) - code(*b)).abs())
        .fold(0.0, f64::max)
}

#[test]
fn probing_from_outside_finds_the_reported_errors() {
    let folder = Folder::new();
    let scenes = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/scenes");
    folder.done(&format!(
        "bake {scenes}/paper_room.obj --patch 1 --element 0.25 -o room.solution"
    ));
    let exact = probed(&folder, "room.solution");
    for (code, name) in [
        ("", "tiles"),
        ("--code tiles", "tiles"),
        ("--code tiles-log", "tiles-log"),
        ("--code display8", "display8"),
        ("--code exp8s", "exp8s"),
        ("--code exp8s --code light_0=tiles", "mixed"),
    ] {
        let report = folder.json(&format!("pack room.solution {code} -o room.atlas"));
        assert_eq!(report["code"], name, "{report}");
        let info = folder.json("info room.atlas");
        let lights = info["per_light"].as_array().unwrap();
        let found = probed(&folder, "room.atlas");
        let mut worst = 0.0_f64;
        for (tag, light) in lights.iter().enumerate() {
            let emission: Vec<f64> = light["emission"]
                .as_array()
                .unwrap()
                .iter()
                .map(|e| e.as_f64().unwrap())
                .collect();
            let strength = emission.iter().copied().fold(0.0, f64::max);
            let mut colours = vec![[emission[0], emission[1], emission[2]]];
            colours.extend([0, 1, 2].map(|c| {
                let mut primary = [0.0; 3];
                primary[c] = strength;
                primary
            }));
            let alone = colours.into_iter().map(|weight| {
                let lit = |rows: &[[f64; 3]]| -> Vec<[f64; 3]> {
                    let own = rows.iter().skip(tag).step_by(lights.len());
                    own.map(|rgb| [0, 1, 2].map(|c| rgb[c] * weight[c]))
                        .collect()
                };
                display_error(&lit(&exact), &lit(&found))
            });
            let alone = alone.fold(0.0, f64::max);
            let stated = light["max_error_codes"].as_f64().unwrap();
            // The program's transfer function is a table within 3e-4 of the formula.
            assert!((alone - stated).abs() < 2e-3, "{code}: {alone} {light}");
            worst = worst.max(alone);
        }
        let stated = info["max_error_codes"].as_f64().unwrap();
        assert!(worst <= stated + 2e-3, "{code}: {worst} {stated}");
        assert_eq!(info["max_error_codes"], report["max_error_codes"]);
    }
}

#[test]
fn pack_chooses_what_was_asked_for_or_says_what_is_possible() {
    let folder = Folder::new();
    let scenes = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/scenes");
    folder.done(&format!(
        "bake {scenes}/paper_room.obj --patch 1 --element 0.25 -o room.solution"
    ));
    let report = folder.json("pack room.solution --max-error 2 -o a");
    for key in ["max_error_codes", "codes_shown"] {
        assert!(report[key].as_f64().unwrap() <= 2.0, "{report}");
    }
    let candidates = report["candidates"].as_array().unwrap();
    let taken: Vec<_> = candidates.iter().filter(|c| c["chosen"] == true).collect();
    assert_eq!(taken.len(), 1);
    assert_eq!(taken[0]["bytes"], report["bytes"]);
    let (_, table) = folder.told("pack room.solution --max-error 2 -o a");
    assert!(
        table.lines().any(|line| line.starts_with("* tiles")),
        "{table}"
    );

    let report = folder.json("pack room.solution --no-mesh --budget 5000 -o a");
    assert_eq!(report["bytes"], folder.read("a").len());
    assert!(folder.read("a").len() <= 5000);
    folder.misused("pack room.solution --code tiles --budget 5000 -o b");
    let line = folder.refused("pack room.solution --max-error 0.001 -o b");
    assert!(
        line.contains("room.solution: no packing stays within 0.001"),
        "{line}"
    );
    let line = folder.refused("pack room.solution --budget 100 -o b");
    assert!(
        line.contains("no packing fits 100 bytes; the smallest one, "),
        "{line}"
    );
    let line = folder.refused("pack room.solution --code sun=tiles -o b");
    assert!(line.contains("there is no light `sun`"), "{line}");

    // A light that has its own code keeps it, whatever is chosen for the others.
    folder.done("pack room.solution --code light_1=display8 --max-error 5 -o a");
    let info = folder.json("info a");
    let codes: Vec<_> = [0, 1, 2]
        .map(|l| info["per_light"][l]["code"].clone())
        .to_vec();
    assert_eq!(codes[1], "display8");
    assert!(codes[0] == "tiles" && codes[2] == "tiles", "{codes:?}");
}

/// A row of elements with these contributions, element by element.
fn row(lights: usize, contributions: Vec<Rgb>) -> Solution {
    let corners = [[0., 0.], [1., 0.], [1., 1.], [0., 1.]].map(|[x, y]| Vec3::new(x, y, 0.0));
    let polygon = Polygon::new(&corners).expect("a square");
    let count = contributions.len() / lights;
    let place = |i: usize| Vec2::new(i as f32 / count as f32, 0.0);
    let mesh = OwnedMesh {
        faces: vec![Face {
            surface: 0,
            side: Side::Front,
            polygon,
            emission: None,
            first_element: 0,
            element_count: count as u32,
        }],
        patches: vec![Patch {
            face: 0,
            from: Vec2::ZERO,
            to: Vec2::ONE,
            area: 1.0,
        }],
        elements: (0..count)
            .map(|i| Element {
                patch: 0,
                from: place(i),
                to: place(i + 1).with_y(1.0),
                area: 1.0 / count as f32,
                reflectance: Rgb::splat(0.5),
            })
            .collect(),
    };
    let light = |tag| SolutionLight {
        name: format!("light {tag}"),
        emission: Rgb::WHITE,
        residual: 0.0,
        error: 0.0,
    };
    Solution {
        surfaces: vec![polygon],
        luminaires: Vec::new(),
        mesh,
        image: None,
        lights: (0..lights).map(light).collect(),
        contributions,
        direct: None,
        exposed: Vec::new(),
        method: Method::default(),
        rows: 0,
        spacing: Spacing {
            patch: 1.0,
            element: 1.0,
        },
    }
}

/// `sum w x` in `f64`, which has room for all products of two floats.
fn exact_sum(values: &[Rgb], mix: &[Rgb]) -> [f64; 3] {
    let mut sums = [0.0; 3];
    for (value, weight) in values.iter().zip(mix) {
        for (sum, (x, w)) in sums
            .iter_mut()
            .zip(value.to_array().into_iter().zip(weight.to_array()))
        {
            *sum += f64::from(x) * f64::from(w);
        }
    }
    sums
}

/// Tries to break what `relume::code::Curve` proves: `|sum w d - sum w x| <= 0.83 % sum w x`.
#[test]
fn no_mix_breaks_the_bound_of_the_logarithmic_tiles() {
    const PROVEN: f64 = 0.0083;
    let mut worst = 0.0_f64;
    for (trial, lights) in (0_u64..).zip([1_usize, 2, 7, 40, 300]) {
        let elements = 600 / lights + 20;
        let draw = |n: u64| noise::bits(trial << 40 | n);
        // Any positive float below 2^126, subnormal ones among them, and zeros; or ordinary light. Codes from 2^127 on are
        // refused, and rounding may add a step.
        for ordinary in [false, true] {
            let value = |n: u64| {
                let bits = draw(n);
                let any = f32::from_bits(bits % 0x7e80_0000);
                match bits >> 29 {
                    0 => 0.0,
                    _ if ordinary => 10.0_f32.powf(8.0 * noise::unit(n ^ trial) - 6.0),
                    1 => f32::from_bits(bits & 0xffff),
                    _ => any,
                }
            };
            let values: Vec<Rgb> = (0..(elements * lights) as u64)
                .map(|n| Rgb::new(value(3 * n), value(3 * n + 1), value(3 * n + 2)))
                .collect();
            let solution = row(lights, values);
            let (bytes, _) = packed(&solution, Code::TilesLog);
            let atlas = Atlas::parse(&bytes).expect("bytes just written");
            let decoded = contributions(&atlas).expect("it fits memory");
            for attack in 0..40_u64 {
                let element = attack as usize % elements;
                let here = element * lights..(element + 1) * lights;
                let (own, found) = (&solution.contributions[here.clone()], &decoded[here]);
                let mix = mix_against(attack, ordinary, own, found);
                let (mut weights, mut sums) = (
                    vec![WideWeight::EMPTY; lights],
                    vec![[Wide::ZERO; 3]; elements],
                );
                relight_wide(&atlas, &mix, &mut weights, &mut sums).expect("a legal mix");
                let floats = relight_atlas(&atlas, &mix).expect("a legal mix");
                for (at, (sum, float)) in sums.iter().zip(floats).enumerate() {
                    let exact = exact_sum(&solution.contributions[at * lights..][..lights], &mix);
                    for (channel, exact) in exact.into_iter().enumerate() {
                        let wide = sum[channel].magnitude();
                        let wide = f64::from(wide.mantissa) * 2.0_f64.powi(wide.exponent);
                        assert!(
                            (wide - exact).abs() <= PROVEN * exact,
                            "{lights}: {wide:e} {exact:e}"
                        );
                        if exact > 0.0 {
                            worst = worst.max((wide / exact - 1.0).abs());
                        }
                        // The float kernel where floats are normal.
                        let float = f64::from(float.to_array()[channel]);
                        let holds = (float - exact).abs() <= PROVEN * exact;
                        assert!(!ordinary || holds, "{lights}: {float:e} {exact:e}");
                    }
                }
            }
        }
    }
    // The attack is worth its name: it comes close.
    assert!(worst > 0.0078, "{worst}");
}

/// A mix that tries to add up the errors of one element: lights that are too bright, or too dark, in equal shares
/// or in any; or all lights in any.
fn mix_against(attack: u64, ordinary: bool, own: &[Rgb], found: &[Rgb]) -> Vec<Rgb> {
    let weight = |number: u64| {
        let bits = noise::bits(attack << 32 | number);
        if ordinary {
            10.0_f32.powf(12.0 * noise::unit(u64::from(bits)) - 6.0)
        } else {
            f32::from_bits(bits % 0x7e80_0000)
        }
    };
    let one = |exact: f32, found: f32, number: u64| {
        let is_wanted = match attack % 4 {
            0 => true,
            1 => found < exact,
            _ => found > exact,
        };
        match attack % 4 {
            _ if !is_wanted => 0.0,
            3 if exact > 0.0 => exact.recip().min(1e30),
            _ => weight(number),
        }
    };
    let pairs = own.iter().zip(found).zip(0_u64..);
    pairs
        .map(|((x, d), n)| {
            Rgb::new(
                one(x.r, d.r, 3 * n),
                one(x.g, d.g, 3 * n + 1),
                one(x.b, d.b, 3 * n + 2),
            )
        })
        .collect()
}

#[test]
fn a_rendered_picture_with_a_layer_per_light_is_relit() {
    let Some(data) = data_dir() else {
        return;
    };
    let layers = data.join("exr/cornell_light_groups.exr");
    let folder = Folder::new();
    folder.done(&format!("pack {} -o picture.atlas", layers.display()));
    folder.done("relight picture.atlas -o mix.exr --only spot=0.5 --set side=0,0,2");

    let layers = read_light_layers(&layers).expect("a layer per light");
    let layer = |name: &str| {
        let found = layers.iter().find(|(light, _)| light == name);
        &found.expect("it is in the file").1.pixels
    };
    let exact: Vec<Rgb> = layer("spot")
        .iter()
        .zip(layer("side"))
        .map(|(spot, side)| Rgb::new(0.5 * spot[0], 0.5 * spot[1], 0.5 * spot[2] + 2.0 * side[2]))
        .collect();
    let mix = exr::prelude::read_first_rgba_layer_from_file(
        folder.path().join("mix.exr"),
        |size, _| (size.width(), vec![Rgb::BLACK; size.area()]),
        |(width, pixels), at, (r, g, b, _): (f32, f32, f32, f32)| {
            pixels[at.y() * *width + at.x()] = Rgb::new(r, g, b);
        },
    );
    let found = mix.expect("a picture").layer_data.channel_data.pixels.1;
    let error = max_codes(&exact, &found);
    // `pack` chose what keeps one code in all of its states; this is none of them.
    assert!(error <= 2.0, "{error}");
}

#[test]
fn lights_whose_sum_is_infinite_are_refused_with_a_remedy() {
    let layer = |name: &str| {
        let pixels = vec![[3e38, 3e38, 3e38, 1.0]; 16];
        let (width, height) = (4, 4);
        (
            name.to_owned(),
            LinearImage {
                width,
                height,
                pixels,
            },
        )
    };
    let bytes = encode_light_layers(&[layer("key"), layer("fill")]).expect("a picture");
    let folder = Folder::new();
    folder.write("bright.exr", bytes);
    let said = folder.refused("pack bright.exr -o bright.atlas");
    assert!(
        said.contains("more than a 32-bit float holds; scale"),
        "{said}"
    );
}
