//! The program against independent references: `relume bake` and `relume probe` on every scene
//! that has a reference, and the table of how far they differ.
//!
//! The references are path traced and carry standard errors (`data/README.md`). Figures, per light
//! over points and channels, `a` the program's value, `t` the reference's and `se` its error:
//!
//! * median of `|a - t| / t` where `se / t < 2 %`;
//! * share of values with `|a - t| <= 0.05 t + 3 se`. Where no path of the reference found the
//!   light, `t` and `se` are 0 and any value fails; such values are counted as *dark*;
//! * L2: `sqrt(mean (a - t)^2 / mean t^2)`.
//!
//! A point gets the value of its element, and by `--gather` one of its own. The limits on the first are what
//! holds today with room to spare; those on the second are what is wanted of it.

mod data;
mod skip;

use std::collections::{BTreeMap, HashMap};
use std::fmt::Write as _;
use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use data::data_dir;

/// What must hold for each light of a scene at default settings, in percent.
struct Case {
    scene: &'static str,
    median: f64,
    l2: f64,
}

/// Measured worst lights at the time of writing, as (median, L2) in percent, are in the comments.
const CASES: [Case; 7] = [
    // (0.001, 0.001): every value is 2, in a closed box.
    Case {
        scene: "furnace_50",
        median: 0.1,
        l2: 0.1,
    },
    // (0.35, 0.96) and (0.55, 1.7): closed rooms with small lamps.
    Case {
        scene: "seed_room_1",
        median: 2.0,
        l2: 4.0,
    },
    Case {
        scene: "seed_room_8",
        median: 2.0,
        l2: 4.0,
    },
    // (1.3, 4.1): hard shadows of boxes that stand on the floor.
    Case {
        scene: "cornell_mitsuba",
        median: 3.0,
        l2: 8.0,
    },
    // (2.3, 10.9) and (2.5, 11.2): the same, and hot spots near a point light and a small lamp.
    Case {
        scene: "tinyobj_cornell",
        median: 4.0,
        l2: 16.0,
    },
    Case {
        scene: "bevy_cornell",
        median: 4.0,
        l2: 16.0,
    },
    // (8.2, 15.3): beams thinner than an element, under a lamp that lights the roof alone.
    Case {
        scene: "gazebo",
        median: 12.0,
        l2: 22.0,
    },
];

type Rgb = [f64; 3];

/// Runs the program, which must succeed, and returns its stdout.
fn relume(arguments: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_relume"))
        .args(arguments)
        .output()
        .expect("the program starts");
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "relume {arguments:?}: {stderr}");
    String::from_utf8(output.stdout).expect("UTF-8")
}

fn text(path: &Path) -> &str {
    path.to_str().expect("a UTF-8 path")
}

/// Bakes a scene, and with it the lights of its reference.
fn bake(data: &Path, scene: &str, options: &[&str], output: &Path) {
    let file = data.join("scenes").join(scene).join("scene.obj");
    let lights = data.join("truth").join(scene).join("lights.toml");
    let mut arguments = vec!["bake", text(&file), "-o", text(output)];
    arguments.extend(options);
    if lights.is_file() {
        arguments.extend(["--lights", text(&lights)]);
    }
    relume(&arguments);
}

fn probe_points(solution: &Path, points: &Path) -> String {
    relume(&["probe", text(solution), "--points", text(points)])
}

/// Values of a CSV by point (or element) and light; the columns from the third on.
fn table(csv: &str) -> HashMap<(usize, String), Vec<f64>> {
    let rows = csv.lines().skip(1).map(|line| {
        let mut cells = line.split(',');
        let point = cells.next().and_then(|cell| cell.parse().ok());
        let light = cells.next().expect("a light").to_owned();
        let values = cells.map(|cell| cell.parse().expect("a number"));
        ((point.expect("a number"), light), values.collect())
    });
    rows.collect()
}

fn rgb(values: &[f64]) -> Rgb {
    [values[0], values[1], values[2]]
}

/// Sums of the differences of one light.
#[derive(Default)]
struct Figures {
    relative: Vec<f64>,
    /// `se / t` of the same values.
    noise: Vec<f64>,
    values: usize,
    within: usize,
    within_tenth: usize,
    dark: usize,
    difference: f64,
    norm: f64,
}

impl Figures {
    fn add(&mut self, found: Rgb, truth: Rgb, error: Rgb) {
        for ((found, truth), error) in found.into_iter().zip(truth).zip(error) {
            let difference = (found - truth).abs();
            self.values += 1;
            self.within += usize::from(difference <= 0.05 * truth + 3.0 * error);
            self.within_tenth += usize::from(difference <= 0.1 * truth + 3.0 * error);
            self.dark += usize::from(truth == 0.0 && error == 0.0);
            self.difference += difference * difference;
            self.norm += truth * truth;
            if truth > 0.0 && error / truth < 0.02 {
                self.relative.push(difference / truth);
                self.noise.push(error / truth);
            }
        }
    }

    /// In percent.
    fn median(&mut self) -> f64 {
        100.0 * upper_median(&mut self.relative)
    }

    /// What the reference's own noise adds to the median difference, in percent: half of all normal
    /// deviates are below 0.67 standard errors.
    fn median_noise(&mut self) -> f64 {
        67.0 * upper_median(&mut self.noise)
    }

    /// In percent.
    fn within(&self) -> f64 {
        100.0 * self.within as f64 / self.values as f64
    }

    /// Within 10 % + 3 se, in percent.
    fn within_tenth(&self) -> f64 {
        100.0 * self.within_tenth as f64 / self.values as f64
    }

    /// In percent.
    fn l2(&self) -> f64 {
        100.0 * (self.difference / self.norm).sqrt()
    }
}

/// The upper one of an even number.
fn upper_median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Differences by light, in the order of their names.
fn compare(found: &str, truth: &str) -> BTreeMap<String, Figures> {
    let found = table(found);
    let truth = table(truth);
    assert_eq!(found.len(), truth.len(), "rows of the program");
    let mut lights: BTreeMap<String, Figures> = BTreeMap::new();
    for (key, truth) in truth {
        let found = rgb(&found[&key]);
        assert!(found.iter().all(|v| v.is_finite()), "{key:?}: {found:?}");
        // er, eg, eb, direct, se_r, se_g, se_b
        let figures = lights.entry(key.1).or_default();
        figures.add(found, rgb(&truth), rgb(&truth[4..]));
    }
    lights
}

/// Straight to stderr: the test harness would keep the output of a test that passes.
fn say(text: &str) {
    std::io::stderr()
        .write_all(text.as_bytes())
        .expect("stderr");
}

const HEADER: &str = "\n\
    scene            light            median   within 5 % + 3 se       L2   values (dark)\n\
    ---------------  -------------  --------  ------------------  -------  --------------\n";

#[test]
fn every_scene_with_a_reference_agrees_with_it() {
    let Some(data) = data_dir() else { return };
    let folder = tempfile::tempdir().unwrap();
    let mut faults = Vec::new();
    let mut written = HEADER.to_owned();
    for scene in scenes_with_reference(&data) {
        // A scene that joins the data later is printed, with nothing to hold it to.
        let case = CASES.iter().find(|case| case.scene == scene);
        let solution = folder.path().join(&scene);
        bake(&data, &scene, &[], &solution);
        let truth = data.join("truth").join(&scene);
        let found = probe_points(&solution, &truth.join("points.csv"));
        let truth = fs::read_to_string(truth.join("truth.csv")).unwrap();
        for (light, mut figures) in compare(&found, &truth) {
            let (median, l2) = (figures.median(), figures.l2());
            let _ = writeln!(
                written,
                "{scene:15}  {light:13}  {median:6.3} %  {:16.2} %  {l2:5.2} %  {:6} {:>7}",
                figures.within(),
                figures.values,
                format!("({})", figures.dark),
            );
            if let Some(case) = case.filter(|c| median > c.median || l2 > c.l2) {
                let Case {
                    median: m, l2: l, ..
                } = case;
                faults.push(format!(
                    "{scene}, {light}: median {median:.3} % (at most {m} %), L2 {l2:.2} % (at most {l} %)"
                ));
            }
        }
        say(&written);
        written.clear();
    }
    assert!(faults.is_empty(), "{faults:#?}");
}

/// Gathered light: the largest median difference beyond the reference's noise, and the least share of
/// values within 10 % + 3 se, in percent.
struct Gathered {
    scene: &'static str,
    median: f64,
    within: f64,
}

impl Gathered {
    /// A closed room.
    const fn closed(scene: &'static str) -> Self {
        Self {
            scene,
            median: 1.0,
            within: 95.0,
        }
    }

    const fn open(scene: &'static str) -> Self {
        Self {
            median: 2.0,
            ..Self::closed(scene)
        }
    }
}

const GATHERED: [Gathered; 7] = [
    Gathered::closed("furnace_50"),
    Gathered::closed("seed_room_1"),
    Gathered::closed("seed_room_8"),
    Gathered::open("cornell_mitsuba"),
    Gathered::open("tinyobj_cornell"),
    Gathered::open("bevy_cornell"),
    Gathered::open("gazebo"),
];

/// The gazebo's lamp shines into a hollow alone: where the reference says exactly 0, rounding leaves slivers
/// of the lamp between the surfaces that hide it, up to 1e-7 of its largest value, so 1680 of 1800 values
/// are not within anything of nothing.
const HOLLOW: (&str, &str) = ("gazebo", "light_lamp");

#[test]
fn gathered_light_agrees_with_every_reference() {
    let Some(data) = data_dir() else { return };
    let folder = tempfile::tempdir().unwrap();
    let mut faults = Vec::new();
    say("\nscene, light, gathered: median (of it noise), within 10 % + 3 se, L2\n");
    for Gathered {
        scene,
        median: most,
        within: least,
    } in GATHERED
    {
        let solution = folder.path().join(scene);
        bake(&data, scene, &[], &solution);
        let truth = data.join("truth").join(scene);
        let points = truth.join("points.csv");
        let found = relume(&[
            "probe",
            text(&solution),
            "--points",
            text(&points),
            "--gather",
        ]);
        let truth = fs::read_to_string(truth.join("truth.csv")).unwrap();
        for (light, mut figures) in compare(&found, &truth) {
            let (median, noise) = (figures.median(), figures.median_noise());
            let (within, l2) = (figures.within_tenth(), figures.l2());
            let line = format!(
                "{scene}, {light}: {median:.2} % ({noise:.2} %), {within:.2} %, {l2:.2} %\n"
            );
            say(&line);
            let is_within = within >= least || (scene, light.as_str()) == HOLLOW;
            if median > most + noise || !is_within {
                faults.push(line);
            }
        }
    }
    assert!(faults.is_empty(), "{faults:#?}");
}

/// Names of all scenes that have a reference; those of [`CASES`] must be among them.
fn scenes_with_reference(data: &Path) -> Vec<String> {
    let folders = fs::read_dir(data.join("truth")).expect("references");
    let mut scenes: Vec<String> = folders
        .map(|folder| folder.expect("a folder").file_name())
        .map(|name| name.into_string().expect("a UTF-8 name"))
        .collect();
    scenes.sort_unstable();
    for Case { scene, .. } in CASES {
        assert!(scenes.iter().any(|s| s == scene), "no reference: {scene}");
    }
    scenes
}

#[test]
fn elements_of_the_seed_rooms_agree_with_averages_over_them() {
    let Some(data) = data_dir() else { return };
    let folder = tempfile::tempdir().unwrap();
    for scene in ["seed_room_1", "seed_room_8"] {
        let truth = data.join("truth").join(scene);
        let solution = folder.path().join(scene);
        // The paper's mesh: 60 patches and 960 elements, in the order of the reference.
        bake(
            &data,
            scene,
            &["--patch", "1", "--element", "0.25"],
            &solution,
        );
        let elements = relume(&["probe", text(&solution), "--elements"]);
        // The reference's points are the centres of its elements.
        let points = probe_points(&solution, &truth.join("points.csv"));
        assert_eq!(table(&elements), table(&points), "{scene}: another order");

        let averages = fs::read_to_string(truth.join("truth_average.csv")).unwrap();
        let lights = compare(&elements, &averages);
        let (light, worst) = lights
            .iter()
            .max_by(|a, b| a.1.l2().total_cmp(&b.1.l2()))
            .expect("a light");
        assert_eq!(worst.values, 960 * 3);
        say(&format!(
            "{scene} on the paper's mesh, element averages: worst light {light}, L2 {:.2} %\n",
            worst.l2()
        ));
        // What is wanted; measured: 0.7 and 1.3 %.
        assert!(worst.l2() <= 3.0, "{scene}, {light}: {:.2} %", worst.l2());
    }
}

#[test]
fn a_published_binary_and_its_obj_give_the_same_light() {
    let Some(data) = data_dir() else { return };
    let folder = tempfile::tempdir().unwrap();
    let binary = data.join("originals/CornellBox.glb");
    let object = without_added_lamps(&data, folder.path());
    let points = data.join("truth/bevy_cornell/points.csv");
    let [from_binary, from_object] = [binary, object].map(|scene| {
        let solution = folder.path().join("solution");
        relume(&[
            "bake",
            text(&scene),
            "--element",
            "60",
            "--method",
            "rows",
            "-o",
            text(&solution),
        ]);
        probe_points(&solution, &points)
    });
    let (from_binary, from_object) = (table(&from_binary), table(&from_object));
    assert_eq!(from_binary.len(), 600);
    for ((point, _), found) in from_binary {
        let expected = &from_object[&(point, "light_ceil".to_owned())];
        for (found, expected) in found.into_iter().zip(expected) {
            assert!(
                // 1e-8: rounding of form factors that sum to one.
                (found - expected).abs() <= 1e-5 * expected + 1e-8,
                "point {point}: {found} and {expected}"
            );
        }
    }
}

/// The OBJ of that binary without the two lamps that were added for the reference.
fn without_added_lamps(data: &Path, folder: &Path) -> PathBuf {
    let original = data.join("scenes/bevy_cornell");
    let mut material = "";
    let obj = fs::read_to_string(original.join("scene.obj")).unwrap();
    let kept = obj.lines().filter(|line| {
        material = line.strip_prefix("usemtl ").unwrap_or(material);
        !(line.starts_with("f ") && ["light_left", "light_low"].contains(&material))
    });
    let scene = folder.join("scene.obj");
    fs::write(&scene, kept.collect::<Vec<_>>().join("\n")).unwrap();
    fs::copy(original.join("scene.mtl"), folder.join("scene.mtl")).unwrap();
    scene
}
