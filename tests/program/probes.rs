//! Values that `probe` prints.

use super::{MESH, read_solution, with_room, with_scene};
use crate::command::Folder;
use crate::room::{BULB, LIGHTS, POINTS};

/// One row of a probe.
#[derive(Debug, PartialEq)]
pub struct Row {
    pub place: usize,
    pub light: String,
    pub value: [f32; 3],
}

/// The rows of a probe, whose header must be the right one.
pub fn rows(csv: &[u8], first: &str) -> Vec<Row> {
    let text = std::str::from_utf8(csv).expect("UTF-8");
    let (header, rest) = text.split_once('\n').expect("a header");
    assert_eq!(header, format!("{first},light,er,eg,eb"));
    rest.lines()
        .map(|line| {
            let cells: Vec<&str> = line.split(',').collect();
            let [place, light, er, eg, eb] = cells[..] else {
                panic!("{line}")
            };
            Row {
                place: place.parse().expect("a number"),
                light: light.to_owned(),
                value: [er, eg, eb].map(|cell| cell.parse().expect("a float")),
            }
        })
        .collect()
}

/// What `probe FILE --elements` says, with more options.
pub fn elements(folder: &Folder, file: &str, options: &str) -> Vec<Row> {
    let csv = folder.done(&format!("probe {file} --elements {options}"));
    rows(&csv, "element")
}

/// What `probe FILE --points` says about the room's points.
pub fn points(folder: &Folder, file: &str) -> Vec<Row> {
    let csv = folder.done(&format!("probe {file} --points points.csv"));
    rows(&csv, "point")
}

/// Asserts that every row of `found` is that of `expected` within a relative tolerance.
pub fn assert_close(found: &[Row], expected: &[Row], tolerance: f32) {
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().zip(expected) {
        assert_eq!(found.place, expected.place);
        assert_eq!(found.light, expected.light);
        for (a, b) in found.value.into_iter().zip(expected.value) {
            let is_close = (a - b).abs() <= tolerance * b;
            assert!(is_close, "{found:?} is not {expected:?}");
        }
    }
}

#[test]
fn probed_elements_are_the_contributions_in_their_order_and_their_bits() {
    let folder = with_room();
    let solution = read_solution(&folder, "room.solution");
    let rows = elements(&folder, "room.solution", "");
    assert_eq!(rows.len(), solution.contributions.len());
    for (number, (row, value)) in rows.iter().zip(&solution.contributions).enumerate() {
        assert_eq!(row.place, number / 2);
        assert_eq!(row.light, LIGHTS[number % 2]);
        assert_eq!(row.value, value.to_array());
    }
}

#[test]
fn probed_points_have_the_values_of_their_elements() {
    let folder = with_room();
    // Two of the room's points, one on no surface and one turned away from its surface.
    let two: String = POINTS.split_inclusive('\n').take(3).collect();
    folder.write("strays.csv", two + "0.3,1.2,2.2,0,1,0\n1.3,0,1.3,1,0,0\n");
    for file in ["room.solution", "room.atlas"] {
        let points = points(&folder, file);
        assert_eq!(points.len(), 9 * 2);
        for (number, row) in points.iter().enumerate() {
            assert_eq!(row.place, number / 2);
            assert_eq!(row.light, LIGHTS[number % 2]);
        }
        // Elements run from the first vertex to the fourth, and inside that to the second: the
        // floor's 16 along x and 12 along z, then the ceiling's 12 along z and 16 along x.
        let elements = elements(&folder, file, "");
        for (point, element) in [(0, 5 * 12 + 5), (1, 14 * 12 + 4), (2, 192 + 10 * 16 + 1)] {
            for light in 0..2 {
                let (point, element) = (&points[2 * point + light], &elements[2 * element + light]);
                assert_eq!(point.value, element.value, "{point:?} lies in {element:?}");
            }
        }

        let probe = format!("probe {file} --points strays.csv -o strays.out");
        let (_, warning) = folder.told(&probe);
        assert!(warning.starts_with("2 points"), "{warning}");
        assert_eq!(folder.json(&probe)["missing"], 2);
        let strays = rows(&folder.read("strays.out"), "point");
        assert_eq!(strays.len(), 4 * 2);
        assert_close(&strays[..4], &points[..4], 0.0);
        let mut values = strays[4..].iter().flat_map(|row| row.value);
        assert!(values.all(f32::is_nan), "{strays:?}");
    }
}

#[test]
fn direct_light_is_told_apart_where_it_was_kept_apart() {
    let folder = with_room();
    folder.done(&format!("bake room.obj --split-direct -o split {MESH}"));
    assert_eq!(folder.json("info split")["split_direct"], true);
    let total = elements(&folder, "split", "");
    let direct = elements(&folder, "split", "--direct");
    assert_close(&total, &elements(&folder, "room.solution", ""), 1e-5);
    assert_eq!(total.len(), direct.len());
    let mut dark = 0;
    for (total, direct) in total.iter().zip(&direct) {
        assert_eq!(total.place, direct.place);
        assert_eq!(total.light, direct.light);
        // Direct light is white, and some of it falls into the shadow of the screen.
        assert_eq!(direct.value, [direct.value[0]; 3]);
        let parts = total.value.into_iter().zip(direct.value);
        for (total, direct) in parts {
            let is_part = direct >= 0.0 && direct <= total * 1.000_01;
            assert!(is_part, "{direct} of {total}");
        }
        dark += usize::from(direct.value[0] == 0.0);
    }
    let all = direct.len();
    assert!(dark > 0 && dark < all / 2, "{dark} of {all} are dark");

    for file in ["room.solution", "room.atlas"] {
        let line = folder.refused(&format!("probe {file} --elements --direct -o no.csv"));
        assert!(line.contains(file), "{line}");
        assert!(line.contains("direct light"), "{line}");
    }
}

#[test]
fn below_a_bulb_there_is_what_its_intensity_and_its_distance_give() {
    let folder = with_scene();
    folder.write("bulb.toml", BULB);
    let bake = "bake room.obj --lights bulb.toml --split-direct -o split";
    folder.done(&format!("{bake} {MESH}"));
    // The bulb hangs 2 m above the corner of four elements of 0.25 m.
    folder.write("below.csv", "x,y,z,nx,ny,nz\n1.3,0,1.3,0,1,0\n");
    let csv = folder.done("probe split --points below.csv --direct");
    let rows = rows(&csv, "point");
    let bulb = rows.iter().find(|row| row.light == "bulb").unwrap();
    // cos / r^2 from 1 W/sr, averaged over the element: 2 (4 + x^2 + z^2)^-1.5, x and z to 1/4.
    let expected = 0.25 * (1.0 - 1.5 / 4.0 * 2.0 / 48.0);
    let is_close = (bulb.value[0] / expected - 1.0).abs() < 1e-3;
    assert!(is_close, "{bulb:?} is not {expected}");
}

#[test]
fn an_atlas_stays_within_the_error_of_its_code() {
    let folder = with_room();
    let info = folder.json("info room.atlas");
    let [exact, packed] = ["room.solution", "room.atlas"].map(|file| {
        let mut rows = elements(&folder, file, "");
        rows.extend(points(&folder, file));
        rows
    });
    assert_eq!(exact.len(), packed.len());
    for (exact, packed) in exact.iter().zip(&packed) {
        assert_eq!(exact.place, packed.place);
        assert_eq!(exact.light, packed.light);
        let light = LIGHTS.iter().position(|name| *name == exact.light);
        let scale = &info["per_light"][light.unwrap()]["curves"][0]["scale"];
        let scale = scale.as_f64().unwrap();
        for (exact, packed) in exact.value.iter().zip(packed.value) {
            // c = round(255 (1 - e^-x)): half a code either way.
            let share = |value: f32| 1.0 - (-f64::from(value) / scale).exp();
            let codes = 255.0 * (share(*exact) - share(packed)).abs();
            assert!(codes <= 0.501, "{exact} became {packed}: {codes} codes");
            let largest = 255.0 * share(*exact);
            assert!(largest < 254.501, "{exact} saturates");
        }
    }
}
