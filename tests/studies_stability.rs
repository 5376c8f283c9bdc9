//! `relume study stability`: every known failure is tried, and every bound holds.

use std::fs;
use std::path::Path;
use std::process::Command;

use serde_json::Value;

/// What the program prints, with its tables in a folder.
fn study(folder: &Path) -> Value {
    let mut program = Command::new(env!("CARGO_BIN_EXE_relume"));
    let program = program.args(["study", "stability", "--json", "-o"]);
    let output = program.arg(folder).output().expect("the program runs");
    assert!(output.status.success(), "{output:?}");
    serde_json::from_slice(&output.stdout).expect("one object")
}

#[test]
fn published_methods_fail_where_ours_keeps_its_bound() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let report = study(folder.path());
    let cases = report["cases"].as_array().expect("cases");
    assert!(cases.len() >= 19, "{} cases", cases.len());
    for case in cases {
        let number = |key: &str| case[key].as_f64().unwrap_or(f64::NAN);
        let (naive, ours, bound) = (number("naive"), number("ours"), number("bound"));
        let holds = ours <= bound && bound < naive;
        assert_eq!(case["holds"], Value::Bool(holds), "{case}");
        assert!(holds, "{case}");
        let says_why = |key: &str| case[key].as_str().is_some_and(|text| !text.is_empty());
        assert!(
            says_why("method") && says_why("quantity") && says_why("why"),
            "{case}"
        );
    }

    let table = fs::read_to_string(folder.path().join("stability.csv")).expect("a table");
    assert_eq!(table.lines().count(), cases.len() + 1);
    let header = "name,quantity,method,naive,ours,bound,why,holds";
    assert_eq!(table.lines().next(), Some(header));
}

#[test]
fn the_study_says_the_same_every_time() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let [first, second] = ["one", "two"].map(|name| study(&folder.path().join(name)));
    assert_eq!(first, second);
}
