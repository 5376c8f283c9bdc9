//! Studies that the program can make without any file.

use relume_host::study::accuracy::{Accuracy, Effort, Family, Line, measure};
use serde::Deserialize;

/// Both scenes on their usual mesh, with few paths; times are not looked at.
fn accuracy() -> Accuracy {
    let effort = Effort {
        turns: 1,
        paths: 2000,
        sizes: &[],
    };
    measure(effort, &mut |_| {}).expect("built-in scenes")
}

/// What is read of `accuracy.csv`.
#[derive(Debug, Deserialize)]
struct Row {
    scene: String,
    #[allow(dead_code, reason = "told when the test fails")]
    variant: String,
    is_default: bool,
    work: u64,
    worst_monte_carlo: Option<f64>,
    se_monte_carlo: Option<f64>,
}

/// Cost is work, which is counted and the same everywhere. The judges are paths, which know nothing of rows;
/// their noise is the same for all ways, and what is better by less than a standard error of it is not better.
#[test]
fn no_way_to_bake_is_as_exact_as_the_default_for_less_work() {
    let accuracy = accuracy();
    let table = accuracy.csv().expect("a table");
    let rows: Vec<Row> = csv::Reader::from_reader(table.as_slice())
        .deserialize()
        .collect::<Result<_, _>>()
        .expect("the columns");
    let defaults: Vec<&Row> = rows.iter().filter(|row| row.is_default).collect();
    assert_eq!(defaults.len(), 2, "one in each scene");
    for default in defaults {
        let error = default.worst_monte_carlo.expect("the usual mesh");
        let noise = default.se_monte_carlo.expect("the usual mesh");
        let beats = |row: &&Row| {
            let is_better = |found: f64| found + noise <= error;
            row.scene == default.scene
                && row.work < default.work
                && row.worst_monte_carlo.is_some_and(is_better)
        };
        let better: Vec<&Row> = rows.iter().filter(beats).collect();
        assert!(better.is_empty(), "{default:?} is beaten by {better:?}");
    }
    check_ways(&accuracy);
    check_references(&accuracy);
}

/// What the study is there to show, far enough apart to hold whatever the default becomes.
fn check_ways(accuracy: &Accuracy) {
    let lines = accuracy.lines();
    for scene in accuracy.scenes() {
        let of = |family: Family| {
            let lines = lines.iter().filter(move |line| line.scene == scene);
            let lines = lines.filter(move |line| line.method == family.name());
            lines.filter(|line| line.storage == "f32")
        };
        let dense_element = |line: &Line| line.worst_dense_element.expect("the usual mesh");
        let least = |family| of(family).map(dense_element).fold(f64::INFINITY, f64::min);
        assert!(Family::ALL.iter().all(|family| of(*family).count() > 0));
        // All rows, kept: the dense solution of the patches.
        let cached = of(Family::Cached).next_back().expect("all rows");
        assert!(
            cached.worst_dense_patch.expect("the usual mesh") < 1e-5,
            "{cached:?}"
        );
        // Plain shooting finds the same, with more rows.
        let plain = of(Family::Plain).next_back().expect("most shots");
        assert!(
            plain.worst_dense_patch.expect("the usual mesh") < 1e-3,
            "{plain:?}"
        );
        assert!(plain.rows > 5 * cached.rows, "{plain:?}");
        // The lamps' rows and estimates of all others leave less than all rows of undivided patches.
        let closed = of(Family::Closed).nth(1).expect("lamps");
        assert!(
            dense_element(closed) < 0.7 * least(Family::Cached),
            "{closed:?}"
        );
        // Splitting halves what is left; points at patch centres spoil it again.
        assert!(
            least(Family::Split) < 0.6 * least(Family::Cached),
            "{scene}"
        );
        assert!(
            least(Family::Hemicube) > 3.0 * least(Family::Split),
            "{scene}"
        );
        assert!(
            least(Family::Published) > 5.0 * least(Family::Gather),
            "{scene}"
        );
    }
}

/// The dense solution in which elements shoot is what paths find, but for the few points at which
/// exact rows sample an element: 1.7 % in the room, 3 % in the box (edges of the spot's shadows).
fn check_references(accuracy: &Accuracy) {
    for reference in &accuracy.references {
        let dense = reference.dense_element.worst();
        let beyond = dense.error - 3.0 * dense.standard_error;
        assert!(beyond < 0.04, "{reference:?}");
        let patch = reference.dense_patch.worst();
        assert!(patch.error > dense.error, "{reference:?}");
    }
}
