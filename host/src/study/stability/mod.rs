//! Known ways for radiosity to go wrong: a published method that does beside ours, and the bound we keep.
//!
//! Every case measures one quantity for both, in the same scene and through the same code but for what
//! is named. A case holds when `ours <= bound < naive`. Truths are closed forms, white furnaces
//! (`E = M / (1 - rho)` everywhere, whatever the shape), dense `f64` solutions and energy balances;
//! no number is written down here but bounds, each with its reason.

mod factors;
mod naive;
mod scale;
mod scenes;
mod solves;

use anyhow::Result;
use serde_json::{Value, json};

use crate::chart::{Chart, Series, Style, Vertical};

pub use scenes::with_reflectance;

/// One known failure.
#[derive(Clone, Debug)]
pub struct Case {
    /// What is tried.
    pub name: String,
    /// What is measured.
    pub quantity: &'static str,
    /// The published method, with its source.
    pub method: &'static str,
    /// What it gives.
    pub naive: f64,
    /// What we give.
    pub ours: f64,
    /// What we promise.
    pub bound: f64,
    /// Where the bound comes from.
    pub why: &'static str,
}

impl Case {
    /// True when we keep the bound and the naive method does not.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.ours <= self.bound && self.bound < self.naive
    }

    /// The case as an object.
    #[must_use]
    pub fn json(&self) -> Value {
        json!({
            "name": self.name,
            "quantity": self.quantity,
            "method": self.method,
            "naive": self.naive,
            "ours": self.ours,
            "bound": self.bound,
            "why": self.why,
            "holds": self.holds(),
        })
    }
}

/// All cases below each other: what the published method gives, what we give, and the bound between them.
#[must_use]
pub fn chart(cases: &[Case]) -> Chart {
    let series = |name: &str, style, value: fn(&Case) -> f64| {
        let points = cases.iter().map(value).zip(0..);
        let points = points.map(|(value, number)| (value, f64::from(number)));
        Series::new(name, style, points)
    };
    Chart {
        title: "known failures: a published method beside ours".to_owned(),
        x: "error (relative, or as the table says)".to_owned(),
        y: Vertical::Names(cases.iter().map(|case| case.name.clone()).collect()),
        series: vec![
            series("published method", Style::Dots, |case| case.naive),
            series("ours", Style::Dots, |case| case.ours),
            series("bound that ours keeps", Style::Limit, |case| case.bound),
        ],
    }
}

/// Runs all cases; `watch` is told the name of each one that is done.
///
/// # Errors
/// A scene that was refused, which does not happen.
pub fn run(mut watch: impl FnMut(&Case)) -> Result<Vec<Case>> {
    let groups: [fn() -> Result<Vec<Case>>; 3] = [factors::cases, solves::cases, scale::cases];
    let mut cases = Vec::new();
    for group in groups {
        for case in group()? {
            watch(&case);
            cases.push(case);
        }
    }
    Ok(cases)
}
