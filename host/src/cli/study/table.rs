//! Tables for people and for spreadsheets.

use std::path::Path;

use anyhow::Result;

use crate::cli::write_file;

/// A table of words.
pub struct Table {
    pub name: &'static str,
    pub header: &'static [&'static str],
    pub rows: Vec<Vec<String>>,
}

impl Table {
    /// Writes the table as `NAME.csv`.
    pub fn write(&self, folder: &Path) -> Result<()> {
        let mut csv = csv::Writer::from_writer(Vec::new());
        csv.write_record(self.header)?;
        for row in &self.rows {
            csv.write_record(row)?;
        }
        write_file(
            &folder.join(self.name).with_extension("csv"),
            &csv.into_inner()?,
        )
    }

    /// The table with its columns below each other.
    pub fn aligned(&self) -> String {
        let header = self.header.iter().map(ToString::to_string).collect();
        let lines: Vec<Vec<String>> = std::iter::once(header).chain(self.rows.clone()).collect();
        let width = |column: usize| {
            lines
                .iter()
                .map(|line| line[column].len())
                .max()
                .unwrap_or(0)
        };
        let text = lines.iter().map(|line| {
            let cells = line.iter().enumerate();
            let cells =
                cells.map(|(column, cell)| format!("{cell:>width$}", width = width(column)));
            cells.collect::<Vec<_>>().join("  ")
        });
        text.collect::<Vec<_>>().join("\n")
    }
}
