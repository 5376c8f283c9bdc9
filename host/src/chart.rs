//! Charts with logarithmic axes and a legend, as SVG.
//!
//! The same numbers give the same bytes. The legend stands beside the plot, where it hides nothing; ticks are at
//! 1, 2 and 5 times the powers of ten, or at the powers alone where the axis is long.

use std::ops::Range;

use plotters::coord::Shift;
use plotters::prelude::{
    BLACK, BindKeyPoints, ChartBuilder, Circle, Color, DrawingArea, DrawingAreaErrorKind,
    IntoDrawingArea, IntoLogRange, PathElement, RGBColor, SVGBackend, ShapeStyle, Text, WHITE,
};
use plotters::style::{IntoFont, IntoTextStyle};

/// Size of a chart, px.
const SIZE: (u32, u32) = (860, 480);

/// Part of the width that the legend takes, px.
const LEGEND_WIDTH: i32 = 240;

/// Distance between lines of the legend, px.
const LEGEND_LINE: i32 = 24;

/// Decades from which on only powers of ten have ticks.
const LONG_AXIS: f64 = 4.0;

/// Free space around the points, as a factor.
const ROOM: f64 = 1.25;

/// Colours that remain distinct for all kinds of sight (M. Okabe and K. Ito 2008).
const PALETTE: [RGBColor; 8] = [
    RGBColor(0, 0, 0),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(0, 114, 178),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(213, 94, 0),
    RGBColor(120, 94, 240),
];

const FONT: &str = "sans-serif";

/// How a series is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Style {
    /// Dots in a colour of their own, joined in their order; open dots once all colours are used.
    Curve,
    /// A broad grey staircase behind everything: what nothing else beats in both.
    Front,
    /// Rings around points.
    Ring,
}

/// Points that belong together.
#[derive(Clone, Debug)]
pub struct Series {
    /// Its line in the legend.
    pub name: String,
    /// How it is drawn.
    pub style: Style,
    /// `(x, y)`; those that are not above zero are left out.
    pub points: Vec<(f64, f64)>,
}

/// A chart.
#[derive(Clone, Debug)]
pub struct Chart {
    /// The line above it.
    pub title: String,
    /// What the horizontal axis shows, with its unit.
    pub x: String,
    /// What the vertical axis shows, with its unit.
    pub y: String,
    /// What is drawn; the first comes first in the legend.
    pub series: Vec<Series>,
}

/// Why a chart could not be drawn.
#[derive(Clone, Debug, thiserror::Error)]
#[error("a chart cannot be drawn: {0}")]
pub struct ChartError(String);

impl<E: std::error::Error + Send + Sync> From<DrawingAreaErrorKind<E>> for ChartError {
    fn from(error: DrawingAreaErrorKind<E>) -> Self {
        Self(error.to_string())
    }
}

impl Chart {
    /// The picture.
    ///
    /// # Errors
    /// [`ChartError`] when there is no point to draw.
    pub fn svg(&self) -> Result<String, ChartError> {
        let is_legal = |p: &&(f64, f64)| p.0 > 0.0 && p.1 > 0.0 && (p.0 + p.1).is_finite();
        let points = || self.series.iter().flat_map(|s| &s.points).filter(is_legal);
        let (Some(x), Some(y)) = (range(points().map(|p| p.0)), range(points().map(|p| p.1)))
        else {
            return Err(ChartError("it has no point above zero".to_owned()));
        };

        let mut text = String::new();
        let area = SVGBackend::with_string(&mut text, SIZE).into_drawing_area();
        area.fill(&WHITE)?;
        let (plot, legend) = area.split_horizontally(SIZE.0 as i32 - LEGEND_WIDTH);
        let axis = |range: &Range<f64>| range.clone().log_scale().with_key_points(ticks(range));
        let mut chart = ChartBuilder::on(&plot)
            .caption(&self.title, (FONT, 18))
            .margin(12)
            .x_label_area_size(46)
            .y_label_area_size(62)
            .build_cartesian_2d(axis(&x), axis(&y))?;
        chart
            .configure_mesh()
            .x_desc(&self.x)
            .y_desc(&self.y)
            .x_label_formatter(&|v| tick_label(*v))
            .y_label_formatter(&|v| tick_label(*v))
            .axis_desc_style((FONT, 15))
            .label_style((FONT, 13))
            .bold_line_style(BLACK.mix(0.12))
            .light_line_style(WHITE)
            .draw()?;
        // The front is behind what it leads along.
        let mut order: Vec<(usize, &Series)> = self.series.iter().enumerate().collect();
        order.sort_by_key(|(_, series)| series.style != Style::Front);
        for (number, series) in order {
            let points: Vec<(f64, f64)> = series.points.iter().filter(is_legal).copied().collect();
            let style = line_style(series.style, number);
            if series.style != Style::Ring {
                let path = PathElement::new(path(series.style, &points), style);
                chart.draw_series([path])?;
            }
            if let Some((radius, dot)) = dot_style(series.style, number) {
                let dots = points.iter().map(|at| Circle::new(*at, radius, dot));
                chart.draw_series(dots)?;
            }
        }
        drop(chart);
        self.draw_legend(&legend)?;
        area.present()?;
        drop((plot, legend, area));
        Ok(text)
    }

    fn draw_legend(&self, area: &DrawingArea<SVGBackend, Shift>) -> Result<(), ChartError> {
        for (number, series) in self.series.iter().enumerate() {
            let y = 52 + number as i32 * LEGEND_LINE;
            if series.style != Style::Ring {
                let style = line_style(series.style, number);
                area.draw(&PathElement::new([(8, y), (32, y)], style))?;
            }
            if let Some((radius, dot)) = dot_style(series.style, number) {
                area.draw(&Circle::new((20, y), radius, dot))?;
            }
            let font = (FONT, 14).into_font().into_text_style(area);
            area.draw(&Text::new(series.name.clone(), (42, y - 8), font))?;
        }
        Ok(())
    }
}

fn colour(number: usize) -> RGBColor {
    PALETTE[number % PALETTE.len()]
}

fn line_style(style: Style, number: usize) -> ShapeStyle {
    match style {
        Style::Front => BLACK.mix(0.22).stroke_width(7),
        Style::Curve | Style::Ring => colour(number).stroke_width(2),
    }
}

/// Radius and style of the dots of a series.
fn dot_style(style: Style, number: usize) -> Option<(i32, ShapeStyle)> {
    match style {
        Style::Curve if number < PALETTE.len() => Some((4, colour(number).filled())),
        Style::Curve => Some((5, colour(number).stroke_width(2))),
        Style::Front => None,
        Style::Ring => Some((10, RGBColor(200, 0, 0).stroke_width(3))),
    }
}

/// The points as they are joined; those of a front by steps.
fn path(style: Style, points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    if style != Style::Front {
        return points.to_vec();
    }
    let next = points.iter().skip(1).map(|p| p.0).chain([f64::NAN]);
    let steps = points.iter().zip(next).flat_map(|(at, next)| {
        let level = (!next.is_nan()).then_some((next, at.1));
        [Some(*at), level]
    });
    steps.flatten().collect()
}

/// From the smallest to the largest, with some room; `None` for nothing.
fn range(values: impl Iterator<Item = f64> + Clone) -> Option<Range<f64>> {
    let low = values.clone().reduce(f64::min)?;
    let high = values.reduce(f64::max)?;
    Some(low / ROOM..high * ROOM)
}

fn ticks(range: &Range<f64>) -> Vec<f64> {
    let (low, high) = (range.start.log10(), range.end.log10());
    let steps: &[f64] = if high - low > LONG_AXIS {
        &[1.0]
    } else {
        &[1.0, 2.0, 5.0]
    };
    let decades = low.floor() as i32..=high.ceil() as i32;
    decades
        .flat_map(|decade| steps.iter().map(move |step| step * 10_f64.powi(decade)))
        .filter(|value| range.contains(value))
        .collect()
}

fn tick_label(value: f64) -> String {
    let decimals = (-value.log10().floor()).max(0.0) as usize;
    match value {
        _ if value >= 1e9 => format!("{:.0}G", value / 1e9),
        _ if value >= 1e6 => format!("{:.0}M", value / 1e6),
        _ if value >= 1e4 => format!("{:.0}k", value / 1e3),
        _ => format!("{value:.decimals$}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart() -> Chart {
        let series = |name: &str, style, points: &[(f64, f64)]| Series {
            name: name.to_owned(),
            style,
            points: points.to_vec(),
        };
        Chart {
            title: "error against time".to_owned(),
            x: "time (s)".to_owned(),
            y: "error (%)".to_owned(),
            series: vec![
                series(
                    "a way",
                    Style::Curve,
                    &[(0.01, 5.0), (0.1, 2.0), (1.0, 0.0)],
                ),
                series("front", Style::Front, &[(0.01, 5.0), (0.1, 2.0)]),
                series("default", Style::Ring, &[(0.1, 2.0)]),
            ],
        }
    }

    #[test]
    fn a_chart_has_axes_with_units_a_legend_and_always_the_same_bytes() {
        let svg = chart().svg().unwrap();
        assert_eq!(svg, chart().svg().unwrap());
        for text in [
            "error against time",
            "time (s)",
            "error (%)",
            "a way",
            "front",
            "default",
        ] {
            assert!(svg.contains(text), "{text}");
        }
        assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"));
    }

    #[test]
    fn what_has_no_logarithm_is_left_out() {
        let mut chart = chart();
        for series in &mut chart.series {
            series.points = vec![(0.0, 1.0), (f64::INFINITY, 1.0)];
        }
        assert!(chart.svg().is_err());
    }

    #[test]
    fn ticks_are_round_and_say_so() {
        assert_eq!(ticks(&(0.009..0.3)), [0.01, 0.02, 0.05, 0.1, 0.2]);
        assert_eq!(ticks(&(0.5..2e5)), [1.0, 10.0, 1e2, 1e3, 1e4, 1e5]);
        let labels = [0.05, 0.5, 1.0, 20.0, 5000.0, 2e4, 5e6].map(tick_label);
        assert_eq!(labels, ["0.05", "0.5", "1", "20", "5000", "20k", "5M"]);
    }

    #[test]
    fn a_front_is_a_staircase() {
        let steps = path(Style::Front, &[(1.0, 9.0), (2.0, 4.0)]);
        assert_eq!(steps, [(1.0, 9.0), (2.0, 9.0), (2.0, 4.0)]);
    }
}
