//! `relume study stability`: writes `stability.csv` and `stability.svg`.

use std::path::Path;

use anyhow::Result;
use serde_json::{Value, json};

use super::table::Table;
use crate::cli::{tell, write_file};
use crate::study::stability::{self, Case};

pub fn run(folder: &Path) -> Result<Value> {
    tell!("{:44} {:>9} {:>9} {:>9}", "case", "naive", "ours", "bound");
    let cases = stability::run(|case| {
        let verdict = if case.holds() {
            "holds"
        } else {
            "DOES NOT HOLD"
        };
        let Case {
            name,
            naive,
            ours,
            bound,
            ..
        } = case;
        tell!("{name:44} {naive:9.1e} {ours:9.1e} {bound:9.1e}  {verdict}");
    })?;
    let row = |case: &Case| {
        let numbers = [case.naive, case.ours, case.bound].map(|value| format!("{value:e}"));
        let words = [&case.name, case.quantity, case.method].map(str::to_owned);
        let verdict = [case.why.to_owned(), case.holds().to_string()];
        words.into_iter().chain(numbers).chain(verdict).collect()
    };
    let table = Table {
        name: "stability",
        header: &[
            "name", "quantity", "method", "naive", "ours", "bound", "why", "holds",
        ],
        rows: cases.iter().map(row).collect(),
    };
    table.write(folder)?;
    let chart = stability::chart(&cases).svg()?;
    write_file(&folder.join("stability.svg"), chart.as_bytes())?;
    let cases: Vec<Value> = cases.iter().map(Case::json).collect();
    Ok(json!({ "cases": cases }))
}
