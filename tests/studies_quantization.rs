//! `relume study quantization` on a small case, against a table of numbers that is checked in.

mod data;
mod skip;

use std::fs;
use std::path::Path;

use relume_host::study::quantization::accumulate::{self, Pass, visible_from};
use relume_host::study::quantization::{Format, Row, Scene, first_lights, measure};

/// How much worse a number may be: one per cent and a thousandth of its unit, the last digit. Bakes and packings are the
/// same everywhere but for the last bits of `powf` and `ln`; those move a rounding here and there.
const TOLERANCE: [f64; 2] = [0.01, 0.001];

/// `seed_room_64` on the paper's 960 elements.
const TABLE: &str = "tests/data/quantization.csv";

const HEADER: &str = "k,format,bits_per_rgb,\
    max_codes_random,max_codes_solo,max_codes,mean_codes,relative_percent";

fn line(row: &Row) -> String {
    let numbers = numbers(row).map(|number| format!("{number:.3}")).join(",");
    format!("{},{},{numbers}", row.k, row.format)
}

fn numbers(row: &Row) -> [f64; 6] {
    [
        row.bits_per_rgb,
        row.max_codes_random.into(),
        row.max_codes_solo.into(),
        row.max_codes.into(),
        row.mean_codes,
        100.0 * row.relative_rms,
    ]
}

#[test]
fn no_format_is_worse_than_the_table_says() {
    let Some(data) = data::data_dir() else {
        return;
    };
    let solution = Scene::ROOM_64.bake(&data).expect("a legal scene");
    assert_eq!(solution.mesh.elements.len(), 960);
    let rows = [1, 8, 64].into_iter().flat_map(|k| {
        let lights = first_lights(&solution, k);
        measure("seed_room_64", &lights, &Format::all()).expect("values in range")
    });
    let rows: Vec<Row> = rows.collect();
    let found: Vec<String> = rows.iter().map(line).collect();
    let table = Path::new(env!("CARGO_MANIFEST_DIR")).join(TABLE);
    let table = fs::read_to_string(table).unwrap_or_default();
    let mut stated = table.lines();
    assert_eq!(
        stated.next(),
        Some(HEADER),
        "{TABLE} is to hold:\n{HEADER}\n{}",
        found.join("\n")
    );
    assert_eq!(
        stated.clone().count(),
        rows.len(),
        "{TABLE} is to hold:\n{HEADER}\n{}",
        found.join("\n")
    );
    let mut worse = Vec::new();
    for (row, stated) in rows.iter().zip(stated) {
        let cells: Vec<&str> = stated.split(',').collect();
        assert_eq!(cells[..2], [&row.k.to_string(), row.format], "{stated}");
        let limits = cells[2..].iter().map(|cell| {
            let number: f64 = cell.parse().expect("a number");
            number * (1.0 + TOLERANCE[0]) + TOLERANCE[1]
        });
        if numbers(row)
            .into_iter()
            .zip(limits)
            .any(|(number, limit)| number > limit)
        {
            worse.push(format!("{}\n  table: {stated}", line(row)));
        }
    }
    assert!(
        worse.is_empty(),
        "worse than the table:\n{}",
        worse.join("\n")
    );
}

/// What the paper and the issue say of 8-bit accumulation: artefacts show at about ten lights, cutting off costs half a code
/// a pass, and wide sums of the same textures cost nothing.
#[test]
fn eight_bits_are_too_few_to_add_ten_lights_in() {
    let Some(data) = data::data_dir() else {
        return;
    };
    let solution = Scene::ROOM_64.bake(&data).expect("a legal scene");
    let rows = accumulate::measure("seed_room_64", &solution);
    let of = |k: usize, pass: Pass| {
        let row = rows.iter().find(|row| row.k == k && row.pass == pass);
        row.expect("measured")
    };
    let truncated = of(10, Pass::Truncate);
    assert!((truncated.bias + 5.0).abs() < 1.0, "{truncated:?}");
    let visible = visible_from(&rows, Pass::Truncate, |row| row.bias);
    assert!(visible.is_some_and(|k| (3..=6).contains(&k)), "{visible:?}");
    let rounded = visible_from(&rows, Pass::Round, |row| row.max);
    assert!(rounded.is_some_and(|k| k <= 10), "{rounded:?}");
    assert_eq!(visible_from(&rows, Pass::Wide, |row| row.rms), None);
    assert!(of(64, Pass::Round).rms > 5.0 * of(64, Pass::Wide).rms);
}
