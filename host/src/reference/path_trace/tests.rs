use super::*;
use crate::builtin::{PaperLamps, furnace_with_box, paper_room, published, white_furnace};
use crate::reference::closed_form::{
    furnace, perpendicular_rectangles, point_to_polygon, source_irradiance,
};
use glam::Vec3;
use relume::color::Rgb;
use relume::scene::{Emission, Falloff, Luminaire, Source, Surface};
use std::collections::HashMap;
use std::f32::consts::FRAC_1_SQRT_2;
use std::fs;

/// Corners of a rectangle in the plane `y = height`, front up.
fn rectangle(low: (f32, f32), high: (f32, f32), height: f32) -> [Vec3; 4] {
    [
        (low.0, low.1),
        (low.0, high.1),
        (high.0, high.1),
        (high.0, low.1),
    ]
    .map(|(x, z)| Vec3::new(x, height, z))
}

fn reversed(mut outline: [Vec3; 4]) -> [Vec3; 4] {
    outline.reverse();
    outline
}

/// A scene of surfaces and luminaires with the lights that they need.
fn scene(surfaces: &[Surface], sources: &[Source]) -> OwnedScene {
    let mut scene = OwnedScene {
        surfaces: surfaces.to_vec(),
        textures: vec![None; surfaces.len()],
        ..OwnedScene::default()
    };
    let tags = surfaces
        .iter()
        .filter_map(|s| s.emission())
        .map(|e| e.light + 1);
    let lamps = tags.max().unwrap_or(0);
    for (source, light) in sources.iter().zip(lamps..) {
        let share = Rgb::new(1.0, 0.5, 0.0);
        scene
            .luminaires
            .push(Luminaire::new(light, share, *source).unwrap());
    }
    for light in 0..lamps as usize + sources.len() {
        published::light(&mut scene, &light.to_string());
    }
    scene
}

fn lamp(vertices: &[Vec3]) -> Surface {
    let emission = Emission {
        light: 0,
        share: Rgb::WHITE,
    };
    let black = Surface::new(0, vertices, Rgb::BLACK).unwrap();
    black.emitting(0, emission).unwrap()
}

/// The estimate of the only light at one receiver.
fn one(scene: &OwnedScene, receiver: Receiver, samples: u32) -> Estimate {
    let tracer = PathTracer::new(scene).unwrap();
    tracer.estimate(&[receiver], samples, 1)[0][0]
}

/// An upward-facing point.
fn up(x: f64, y: f64, z: f64) -> Receiver {
    Receiver::point(DVec3::new(x, y, z), DVec3::Y).unwrap()
}

/// Within four standard errors, and those below `relative`.
fn assert_estimates(found: f64, error: f64, expected: f64, relative: f64, what: &str) {
    assert!(
        error <= relative * expected,
        "{what}: {found} +- {error} for {expected}"
    );
    let deviation = (found - expected).abs();
    let rounding = 1e-12 * expected;
    assert!(
        deviation <= 4.0 * error + rounding,
        "{what}: {found} +- {error}, not {expected}"
    );
}

#[test]
fn furnaces_are_as_bright_everywhere() {
    for (rho, samples) in [(0.0, 4000), (0.5, 20_000), (0.9, 20_000)] {
        for room in [white_furnace(rho, 1.0), furnace_with_box(rho, 1.0)] {
            let scene = room.unwrap().scene;
            let expected = furnace(1.0, f64::from(rho));
            let corner = up(1e-3, 0.0, 2e-3);
            for receiver in [up(0.4, 0.0, 0.3), corner] {
                let found = one(&scene, receiver, samples);
                let what = format!("rho {rho}");
                for c in 0..3 {
                    assert_estimates(found.irradiance[c], found.error[c], expected, 0.02, &what);
                    assert_estimates(found.direct[c], found.direct_error[c], 1.0, 0.02, &what);
                }
            }
        }
    }
}

#[test]
fn a_point_under_a_lamp_follows_lambert() {
    let outline = reversed(rectangle((0.2, -0.5), (1.7, 0.9), 0.8));
    let scene = scene(&[lamp(&outline)], &[]);
    let outline = outline.map(|v| v.as_dvec3());
    for normal in [
        DVec3::Y,
        DVec3::new(0.6, 0.8, 0.0),
        DVec3::new(-0.8, 0.6, 0.0),
    ] {
        let receiver = Receiver::point(DVec3::ZERO, normal).unwrap();
        let found = one(&scene, receiver, 40_000);
        let expected = point_to_polygon(DVec3::ZERO, normal, &outline);
        assert_estimates(
            found.direct[1],
            found.direct_error[1],
            expected,
            0.02,
            "lamp",
        );
    }
    let behind = Receiver::point(DVec3::new(1.0, 2.0, 0.0), -DVec3::Y).unwrap();
    assert_eq!(
        one(&scene, behind, 1000).irradiance,
        [0.0; 3],
        "a lamp's back is dark"
    );
}

#[test]
fn the_mean_over_a_polygon_is_an_area_form_factor() {
    let wall = [(0.0, 0.0), (0.0, 1.0), (0.7, 1.0), (0.7, 0.0)].map(|(y, z)| Vec3::new(0.0, y, z));
    let wall = lamp(&reversed(wall));
    assert_eq!(wall.polygon().normal(), Vec3::X);
    let floor = rectangle((0.0, 0.0), (2.0, 1.0), 0.0).map(|v| v.as_dvec3());
    let receiver = Receiver::polygon(&floor).unwrap();
    let found = one(&scene(&[wall], &[]), receiver, 100_000);
    let expected = perpendicular_rectangles(1.0, 2.0, 0.7);
    assert_estimates(found.irradiance[0], found.error[0], expected, 0.01, "C-14");
}

#[test]
fn luminaires_have_their_shares_and_shadows() {
    let direction = Vec3::new(0.0, -FRAC_1_SQRT_2, FRAC_1_SQRT_2);
    let position = Vec3::new(0.3, 2.0, -1.0);
    let spot = |falloff| Source::Spot {
        position,
        direction: Vec3::new(0.0, -1.0, 0.2),
        inner: 0.1,
        outer: 0.9,
        falloff,
    };
    let sources = [
        Source::Point { position },
        spot(Falloff::Smooth),
        spot(Falloff::Linear),
        Source::Sun {
            direction,
            angle: 0.0,
        },
        Source::Sun {
            direction,
            angle: 0.5,
        },
        Source::Sky,
    ];
    let open = scene(&[], &sources);
    let tracer = PathTracer::new(&open).unwrap();
    let found = &tracer.estimate(&[up(0.0, 0.0, 0.0)], 20_000, 5)[0];
    for (light, source) in open.luminaires.iter().map(Luminaire::source).enumerate() {
        let expected = source_irradiance(source, DVec3::ZERO, DVec3::Y);
        let Estimate {
            direct,
            direct_error,
            irradiance,
            ..
        } = found[light];
        assert_estimates(
            direct[0],
            direct_error[0],
            expected,
            0.01,
            &format!("{source:?}"),
        );
        assert!((direct[1] - 0.5 * direct[0]).abs() < 1e-12 && direct[2] == 0.0);
        assert_eq!(direct, irradiance, "there is nothing to bounce off");
    }

    // A black plate over the point takes all of them but the sky at the horizon.
    let plate = rectangle((-9.0, -9.0), (9.0, 9.0), 1.0);
    let plate = Surface::new(0, &plate, Rgb::BLACK).unwrap();
    let tracer = PathTracer::new(&scene(&[plate], &sources)).unwrap();
    let found = &tracer.estimate(&[up(0.0, 0.0, 0.0)], 20_000, 5)[0];
    assert!(
        found[..5].iter().all(|e| e.irradiance == [0.0; 3]),
        "{found:?}"
    );
    let outline = plate.polygon().flipped().vertices().to_vec();
    let outline: Vec<DVec3> = outline.iter().map(|v| v.as_dvec3()).collect();
    let open = 1.0 - point_to_polygon(DVec3::ZERO, DVec3::Y, &outline);
    assert_estimates(found[5].irradiance[0], found[5].error[0], open, 0.1, "sky");
}

#[test]
fn one_sided_surfaces_are_black_behind_but_block() {
    // A lamp on the floor shines at the back of a plate; the receiver looks up from beside it.
    let lamp = lamp(&rectangle((0.0, 0.0), (1.0, 1.0), 0.0));
    let outline = rectangle((0.0, 0.0), (1.0, 1.0), 0.5);
    let plate = Surface::new(1, &outline, Rgb::new(0.5, 0.25, 0.0)).unwrap();
    let beside = || up(1.2, 0.0, 0.5);
    assert_eq!(
        one(&scene(&[lamp, plate], &[]), beside(), 2000).irradiance,
        [0.0; 3]
    );

    let found = one(&scene(&[lamp, plate.two_sided()], &[]), beside(), 100_000);
    let [red, green, blue] = found.irradiance;
    assert!(red > 10.0 * found.error[0] && blue == 0.0, "{found:?}");
    assert!(
        (green / red - 0.5).abs() < 1e-9,
        "one bounce: the reflectances' ratio"
    );
    assert_eq!(found.direct, [0.0; 3]);

    // Above the plate its shadow is complete but for what comes round its edge.
    let above = Receiver::point(DVec3::new(0.5, 0.6, 0.5), -DVec3::Y).unwrap();
    assert_eq!(
        one(&scene(&[lamp, plate], &[]), above, 2000).irradiance,
        [0.0; 3]
    );
}

#[test]
fn threads_do_not_change_a_bit() {
    let room = paper_room(PaperLamps::Three).unwrap().scene;
    let tracer = PathTracer::new(&room).unwrap();
    let receivers: Vec<Receiver> = (0..7)
        .map(|i| up(0.2 + 0.3 * f64::from(i), 0.0, 0.4))
        .collect();
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.unwrap().install(|| tracer.estimate(&receivers, 50, 9))
    };
    let alone = run(1);
    assert_eq!(alone, run(3));
    assert_ne!(
        alone,
        tracer.estimate(&receivers, 50, 10),
        "another seed, other numbers"
    );
    assert_ne!(alone[0], alone[1]);
}

#[test]
fn standard_errors_tell_the_spread_between_seeds() {
    let room = paper_room(PaperLamps::One).unwrap().scene;
    let tracer = PathTracer::new(&room).unwrap();
    let runs: Vec<Estimate> = (0..200)
        .map(|seed| tracer.estimate(&[up(0.7, 0.0, 2.2)], 400, seed)[0][0])
        .collect();
    let n = runs.len() as f64;
    let mean = runs.iter().map(|e| e.irradiance[0]).sum::<f64>() / n;
    let spread = runs
        .iter()
        .map(|e| (e.irradiance[0] - mean).powi(2))
        .sum::<f64>()
        / (n - 1.0);
    let stated = runs.iter().map(|e| e.error[0].powi(2)).sum::<f64>() / n;
    // The variance of a variance from 200 runs is known to 10 %.
    assert!(
        (spread / stated - 1.0).abs() < 0.35,
        "{spread:e} {stated:e}"
    );
}

/// Rows of a CSV file as numbers by column name; words become NaN.
fn table(text: &str) -> impl Iterator<Item = HashMap<&str, (&str, f64)>> {
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    lines.map(move |line| {
        let cells = line.split(',').map(|c| (c, c.parse().unwrap_or(f64::NAN)));
        header.iter().copied().zip(cells).collect()
    })
}

/// Adds the luminaires of a `lights.toml` of the data folder.
fn add_luminaires(scene: &mut OwnedScene, text: &str) {
    let file: toml::Table = text.parse().unwrap();
    for entry in file["light"].as_array().unwrap() {
        let number = |key: &str| entry[key].as_float().unwrap() as f32;
        let vector = |key: &str| {
            let values = entry[key].as_array().unwrap();
            Vec3::from_array([0, 1, 2].map(|i: usize| values[i].as_float().unwrap() as f32))
        };
        let position = vector("position");
        let source = match entry["kind"].as_str().unwrap() {
            "point" => Source::Point { position },
            _ => Source::Spot {
                position,
                direction: vector("direction"),
                inner: number("inner"),
                outer: number("outer"),
                falloff: Falloff::Linear,
            },
        };
        let light = published::light(scene, entry["name"].as_str().unwrap());
        scene
            .luminaires
            .push(Luminaire::new(light, Rgb::WHITE, source).unwrap());
    }
}

/// The files give six digits, more roundings than the tracer's margin allows for: puts a point
/// back on the nearest plane of its surface.
fn snapped(scene: &OwnedScene, point: DVec3, normal: DVec3) -> DVec3 {
    let diagonal = f64::from(scene.view().unwrap().diagonal());
    let heights = scene.surfaces.iter().filter_map(|s| {
        let own = s.polygon().normal().as_dvec3();
        let height = (point - s.polygon().vertices()[0].as_dvec3()).dot(own);
        (own.dot(normal).abs() > 0.985).then_some(own * height)
    });
    let nearest = heights
        .min_by(|a, b| a.length().total_cmp(&b.length()))
        .unwrap();
    assert!(
        nearest.length() < 1e-4 * diagonal,
        "{point} lies on no surface"
    );
    point - nearest
}

/// Deviations from a truth file of the data folder, in joint standard errors.
fn deviations(name: &str, points: usize, samples: u32) -> Option<Vec<f64>> {
    let mut scene = published::scene(name)?;
    let folder = published::data(&format!("truth/{name}"))?;
    if let Ok(text) = fs::read_to_string(folder.join("lights.toml")) {
        add_luminaires(&mut scene, &text);
    }
    let text = fs::read_to_string(folder.join("points.csv")).unwrap();
    let all: Vec<Receiver> = table(&text)
        .map(|row| {
            let [x, y, z, nx, ny, nz] = ["x", "y", "z", "nx", "ny", "nz"].map(|key| row[key].1);
            let normal = DVec3::new(nx, ny, nz).normalize();
            Receiver::point(snapped(&scene, DVec3::new(x, y, z), normal), normal).unwrap()
        })
        .collect();
    let step = all.len().div_ceil(points);
    let chosen: Vec<Receiver> = all.into_iter().step_by(step).collect();
    let found = PathTracer::new(&scene)
        .unwrap()
        .estimate(&chosen, samples, 11);

    let truth = fs::read_to_string(folder.join("truth.csv")).unwrap();
    let mut deviations = Vec::new();
    for row in table(&truth) {
        let point = row["point"].1 as usize;
        if !point.is_multiple_of(step) {
            continue;
        }
        let light = scene
            .lights
            .iter()
            .position(|l| l.name == row["light"].0)
            .unwrap();
        let estimate = found[point / step][light];
        for (channel, (value, error)) in [("er", "se_r"), ("eg", "se_g"), ("eb", "se_b")]
            .into_iter()
            .enumerate()
        {
            let joint = row[error].1.hypot(estimate.error[channel]);
            // Files have six digits.
            let rounding = 1e-6 * row[value].1;
            let deviation = (estimate.irradiance[channel] - row[value].1).abs();
            deviations.push((deviation - rounding).max(0.0) / joint.max(f64::MIN_POSITIVE));
        }
    }
    Some(deviations)
}

#[test]
fn independent_path_tracers_agree() {
    for (name, points, samples) in [
        ("furnace_50", 12, 2000),
        ("seed_room_1", 24, 4000),
        ("seed_room_8", 24, 2000),
        ("cornell_mitsuba", 24, 4000),
        ("tinyobj_cornell", 24, 4000),
        ("bevy_cornell", 24, 4000),
        ("gazebo", 24, 4000),
    ] {
        let Some(mut all) = deviations(name, points, samples) else {
            return;
        };
        all.sort_by(f64::total_cmp);
        let n = all.len();
        let root_mean_square = (all.iter().map(|z| z * z).sum::<f64>() / n as f64).sqrt();
        let (median, worst) = (all[n / 2], all[n - 1]);
        let what = format!(
            "{name}: {n} values, rms {root_mean_square:.2}, median {median:.2}, worst {worst:.2} \
             joint standard errors"
        );
        eprintln!("{what}");
        // A normal deviation has the root mean square 1 and the median 0.67; channels and lights
        // are correlated, so few points leave more room than their number says.
        assert!((0.6..1.3).contains(&root_mean_square), "{what}");
        assert!((0.4..0.95).contains(&median) && worst < 5.0, "{what}");
    }
}
