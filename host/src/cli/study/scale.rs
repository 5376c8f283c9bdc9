//! `relume study scale`: writes `scale.csv` and two charts.

use std::path::Path;

use anyhow::{Result, bail};
use serde_json::{Value, json};

use super::table::Table;
use crate::cli::{tell, write_file};
use crate::import;
use crate::study::scale::{self, Size};

/// Lengths of elements, feet: one for each polygon, then about 20 000, 50 000, 100 000 and 200 000.
const LENGTHS: [f32; 5] = [100.0, 4.0, 1.5, 1.0, 0.7];

pub fn run(folder: &Path) -> Result<Value> {
    let data = super::data();
    let file = data.join("scenes/frads_office/scene.obj");
    if !file.is_file() {
        bail!(
            "{}: not there; set RELUME_DATA to the folder of the data",
            file.display()
        );
    }
    let scene = import::load(&file, None)?.scene;
    let sizes = scale::measure(&scene, &LENGTHS, |size| {
        tell!(
            "{} elements: {:.1} s, {:.2} ms an element",
            size.elements,
            size.meshing + size.solving,
            size.milliseconds()
        );
    })?;
    table(&sizes).write(folder)?;
    for (name, chart) in scale::charts(&sizes) {
        // There is no chart of memory where the system does not tell.
        if let Ok(svg) = chart.svg() {
            write_file(&folder.join(name), svg.as_bytes())?;
        }
    }
    let size = |size: &Size| {
        json!({
            "elements": size.elements,
            "patches": size.patches,
            "seconds": size.meshing + size.solving,
            "ms_per_element": size.milliseconds(),
            "bytes": size.memory,
            "error": size.error,
        })
    };
    Ok(json!({"study": "scale", "sizes": sizes.iter().map(size).collect::<Vec<_>>()}))
}

fn table(sizes: &[Size]) -> Table {
    let row = |size: &Size| {
        vec![
            size.element.to_string(),
            size.elements.to_string(),
            size.patches.to_string(),
            format!("{:.3}", size.meshing),
            format!("{:.3}", size.solving),
            format!("{:.4}", size.milliseconds()),
            size.memory
                .map_or_else(String::new, |bytes| bytes.to_string()),
            format!("{:.4}", size.error),
        ]
    };
    Table {
        name: "scale",
        header: &[
            "element",
            "elements",
            "patches",
            "meshing_s",
            "solving_s",
            "ms_per_element",
            "most_bytes",
            "estimated_error",
        ],
        rows: sizes.iter().map(row).collect(),
    }
}
