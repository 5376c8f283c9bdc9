//! What the study says: a table, charts, and whether anything beats the default.

use serde::Serialize;
use serde_json::{Value, json};

use super::{Accuracy, Family, Measured, Reference, Storage};
use crate::chart::{Chart, ChartError, Series, Style, Vertical};
use crate::study::truth::LightError;

/// What a bake costs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cost {
    /// Seconds on one thread.
    Time,
    /// Rays, factors and pixels.
    Work,
}

/// Which truth the worst light is compared with, on the usual mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Judge {
    /// The dense solution in which elements shoot.
    Dense,
    /// Traced paths.
    MonteCarlo,
}

impl Cost {
    const ALL: [Self; 2] = [Self::Time, Self::Work];

    const fn name(self) -> &'static str {
        match self {
            Self::Time => "time",
            Self::Work => "work",
        }
    }

    const fn axis(self) -> &'static str {
        match self {
            Self::Time => "time on one thread, without meshing (s)",
            Self::Work => "work (rays + factors + pixels)",
        }
    }

    fn of(self, row: &Measured) -> f64 {
        match self {
            Self::Time => row.seconds,
            Self::Work => row.work.total() as f64,
        }
    }
}

impl Judge {
    const ALL: [Self; 2] = [Self::Dense, Self::MonteCarlo];

    const fn name(self) -> &'static str {
        match self {
            Self::Dense => "dense_element",
            Self::MonteCarlo => "monte_carlo",
        }
    }

    const fn title(self) -> &'static str {
        match self {
            Self::Dense => "dense elements",
            Self::MonteCarlo => "traced paths",
        }
    }

    fn of(self, row: &Measured) -> Option<LightError> {
        let errors = row.elementwise.as_ref()?;
        Some(match self {
            Self::Dense => errors.dense_element.worst(),
            Self::MonteCarlo => errors.monte_carlo.worst(),
        })
    }
}

/// A line of the table. Errors are relative L2; empty where the mesh is not the usual one.
#[derive(Clone, Debug, Serialize)]
#[allow(
    missing_docs,
    reason = "the names are those of the columns, which `Measured` explains"
)]
pub struct Line {
    pub scene: &'static str,
    pub method: &'static str,
    pub variant: String,
    pub storage: &'static str,
    pub is_default: bool,
    pub lights: usize,
    pub element: f32,
    pub elements: usize,
    pub patches: usize,
    pub bytes: usize,
    pub rows: u64,
    pub rays: u64,
    pub factors: u64,
    pub pixels: u64,
    pub work: u64,
    pub seconds: f64,
    pub us_per_row: Option<f64>,
    pub worst_dense_patch: Option<f64>,
    pub worst_dense_element: Option<f64>,
    pub median_dense_element: Option<f64>,
    pub worst_monte_carlo: Option<f64>,
    pub se_monte_carlo: Option<f64>,
    pub median_monte_carlo: Option<f64>,
    pub worst_points: f64,
    pub se_points: f64,
    pub median_points: f64,
}

impl From<&Measured> for Line {
    fn from(row: &Measured) -> Self {
        let errors = row.elementwise.as_ref();
        let worst_traced = errors.map(|e| e.monte_carlo.worst());
        let worst_point = row.pointwise.worst();
        Self {
            scene: row.scene,
            method: row.family.name(),
            variant: row.variant.clone(),
            storage: row.storage.name(),
            is_default: row.is_default,
            lights: row.lights,
            element: row.element,
            elements: row.elements,
            patches: row.patches,
            bytes: row.bytes(),
            rows: row.work.rows,
            rays: row.work.rays,
            factors: row.work.factors,
            pixels: row.work.pixels,
            work: row.work.total(),
            seconds: rounded(row.seconds),
            us_per_row: row
                .row_seconds
                .map(|s| (1e6 * s / row.work.rows as f64).round()),
            worst_dense_patch: errors.map(|e| rounded(e.dense_patch.worst().error)),
            worst_dense_element: errors.map(|e| rounded(e.dense_element.worst().error)),
            median_dense_element: errors.map(|e| rounded(e.dense_element.median())),
            worst_monte_carlo: worst_traced.map(|e| rounded(e.error)),
            se_monte_carlo: worst_traced.map(|e| rounded(e.standard_error)),
            median_monte_carlo: errors.map(|e| rounded(e.monte_carlo.median())),
            worst_points: rounded(worst_point.error),
            se_points: rounded(worst_point.standard_error),
            median_points: rounded(row.pointwise.median()),
        }
    }
}

/// Six decimals.
fn rounded(value: f64) -> f64 {
    (value * 1e6).round() / 1e6
}

impl Measured {
    const fn bytes(&self) -> usize {
        self.elements * self.lights * self.storage.bytes()
    }
}

impl Accuracy {
    /// The table.
    #[must_use]
    pub fn lines(&self) -> Vec<Line> {
        self.measured.iter().map(Line::from).collect()
    }

    /// The table as `accuracy.csv` holds it.
    ///
    /// # Errors
    /// What the writer of CSV says.
    pub fn csv(&self) -> anyhow::Result<Vec<u8>> {
        let mut table = csv::Writer::from_writer(Vec::new());
        for line in self.lines() {
            table.serialize(line)?;
        }
        Ok(table.into_inner()?)
    }

    /// What paths say of the dense solutions themselves.
    #[must_use]
    pub fn references(&self) -> Vec<Value> {
        let error = |error: LightError| json!({"error": rounded(error.error), "se": rounded(error.standard_error)});
        let reference = |reference: &Reference| {
            json!({
                "scene": reference.scene,
                "worst_dense_patch": error(reference.dense_patch.worst()),
                "worst_dense_element": error(reference.dense_element.worst()),
            })
        };
        self.references.iter().map(reference).collect()
    }

    /// Names of the scenes.
    #[must_use]
    pub fn scenes(&self) -> Vec<&'static str> {
        let mut scenes: Vec<&str> = self.measured.iter().map(|row| row.scene).collect();
        scenes.dedup();
        scenes
    }

    /// Ways on the usual mesh, in floats, with their cost and error.
    fn compared(&self, scene: &str, cost: Cost, judge: Judge) -> Vec<(&Measured, f64, LightError)> {
        let rows = self.measured.iter().filter(|row| row.scene == scene);
        let rows = rows.filter(|row| row.storage == Storage::F32);
        rows.filter_map(|row| Some((row, cost.of(row), judge.of(row)?)))
            .collect()
    }

    /// What costs less than the default and is as exact, or costs no more and is more exact: by more than a
    /// standard error of the judge. All are judged by the same paths, so most of that noise they share.
    #[must_use]
    pub fn beats_default(&self, scene: &str, cost: Cost, judge: Judge) -> Vec<&Measured> {
        let compared = self.compared(scene, cost, judge);
        let default = compared.iter().find(|(row, ..)| row.is_default);
        let Some((_, own_cost, own)) = default else {
            return Vec::new();
        };
        let better = compared.iter().filter(|(row, cost, error)| {
            let noise = own.standard_error;
            let as_exact = error.error + noise <= own.error;
            let more_exact = error.error + noise < own.error;
            !row.is_default && ((cost < own_cost && as_exact) || (cost <= own_cost && more_exact))
        });
        better.map(|(row, ..)| *row).collect()
    }

    /// Whether the default is on the fronts, and what beats it where it is not.
    #[must_use]
    pub fn verdicts(&self) -> Vec<Value> {
        let scenes = self.scenes().into_iter();
        let pairs = scenes.flat_map(|scene| {
            let costs = Cost::ALL.into_iter();
            costs.flat_map(move |cost| Judge::ALL.map(|judge| (scene, cost, judge)))
        });
        let verdict = |(scene, cost, judge): (&str, Cost, Judge)| {
            let better = self.beats_default(scene, cost, judge);
            let name = |row: &&Measured| format!("{}, {}", row.family.name(), row.variant);
            json!({
                "scene": scene,
                "cost": cost.name(),
                "judge": judge.name(),
                "default_on_front": better.is_empty(),
                "better": better.iter().map(name).collect::<Vec<_>>(),
            })
        };
        pairs.map(verdict).collect()
    }

    /// The charts, with the names of their files.
    ///
    /// # Errors
    /// [`ChartError`] when nothing was measured.
    pub fn charts(&self) -> Result<Vec<(String, String)>, ChartError> {
        let mut charts = Vec::new();
        for scene in self.scenes() {
            let slug = scene.to_lowercase().replace(' ', "_");
            for cost in Cost::ALL {
                for judge in Judge::ALL {
                    let name = format!("{slug}_{}_{}.svg", cost.name(), judge.name());
                    charts.push((name, self.way_chart(scene, cost, judge).svg()?));
                }
            }
            charts.push((format!("{slug}_mesh.svg"), self.mesh_chart(scene).svg()?));
            charts.push((
                format!("{slug}_storage.svg"),
                self.storage_chart(scene).svg()?,
            ));
        }
        Ok(charts)
    }

    /// All ways on the usual mesh, with the front of what nothing beats.
    fn way_chart(&self, scene: &str, cost: Cost, judge: Judge) -> Chart {
        let compared = self.compared(scene, cost, judge);
        let place = |(_, cost, error): &(&Measured, f64, LightError)| (*cost, 100.0 * error.error);
        let of_family = |family: Family| {
            let rows = compared.iter().filter(|(row, ..)| row.family == family);
            Series::new(family.name(), Style::Curve, rows.map(place))
        };
        let everything: Vec<(f64, f64)> = compared.iter().map(place).collect();
        let default = compared.iter().filter(|(row, ..)| row.is_default);
        let mut series: Vec<Series> = Family::ALL.map(of_family).into();
        series.push(Series::new(
            "Pareto front",
            Style::Front,
            front(&everything),
        ));
        series.push(Series::new("the default", Style::Ring, default.map(place)));
        Chart {
            title: format!("{scene}: worst light against {}", judge.title()),
            x: cost.axis().to_owned(),
            y: Vertical::Values("relative L2 error (%)".to_owned()),
            series,
        }
    }

    /// Ours at all mesh sizes.
    fn mesh_chart(&self, scene: &str) -> Chart {
        let of_family = |family: Family| {
            let rows = self.sizes(scene, Storage::F32);
            let rows = rows.into_iter().filter(|row| row.family == family);
            let points = rows.map(|row| (row.seconds, 100.0 * row.pointwise.worst().error));
            Series::new(family.name(), Style::Curve, points)
        };
        Chart {
            title: format!("{scene}: worst light at points, mesh sizes"),
            x: Cost::Time.axis().to_owned(),
            y: Vertical::Values("relative L2 error (%)".to_owned()),
            series: [Family::Split, Family::Gather].map(of_family).into(),
        }
    }

    /// The default at all mesh sizes, in fewer bits.
    fn storage_chart(&self, scene: &str) -> Chart {
        let stored = |storage: Storage| {
            let rows = self.sizes(scene, storage);
            let rows = rows.into_iter().filter(|row| row.family == Family::Gather);
            let points = rows.map(|row| {
                let error = 100.0 * row.pointwise.worst().error;
                (row.bytes() as f64 / 1024.0, error)
            });
            let name = format!("{}, {} B", storage.name(), storage.bytes());
            Series::new(name, Style::Curve, points)
        };
        Chart {
            title: format!("{scene}: worst light at points, as stored"),
            x: "contributions, all elements and lights (KiB)".to_owned(),
            y: Vertical::Values("relative L2 error (%)".to_owned()),
            series: Storage::ALL.map(stored).into(),
        }
    }

    /// Ours at all mesh sizes, coarsest first.
    fn sizes(&self, scene: &str, storage: Storage) -> Vec<&Measured> {
        let ours = |row: &&Measured| row.scene == scene && row.is_ours && row.storage == storage;
        let mut rows: Vec<&Measured> = self.measured.iter().filter(ours).collect();
        rows.sort_by_key(|row| row.elements);
        rows
    }
}

/// The points that no other beats in both, from left to right.
fn front(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let mut least = f64::INFINITY;
    sorted.retain(|point| {
        let leads = point.1 < least;
        least = least.min(point.1);
        leads
    });
    sorted
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_front_goes_down_from_the_cheapest() {
        let points = [(3.0, 1.0), (1.0, 5.0), (2.0, 6.0), (2.0, 2.0), (4.0, 1.0)];
        assert_eq!(front(&points), [(1.0, 5.0), (2.0, 2.0), (3.0, 1.0)]);
    }
}
