//! Charts with a legend, as SVG: values over values, or values of things that have names.
//!
//! The same numbers give the same bytes. Axes of values are logarithmic; the legend stands beside the plot, where it
//! hides nothing.

mod axis;

use plotters::coord::Shift;
use plotters::prelude::{
    BLACK, ChartBuilder, Circle, Color, DrawingArea, DrawingAreaErrorKind, EmptyElement,
    IntoDrawingArea, PathElement, RGBColor, SVGBackend, ShapeStyle, Text, WHITE,
};
use plotters::style::{IntoFont, IntoTextStyle};

use axis::Axis;

/// Size of the plot with its axes, px.
const PLOT: (u32, u32) = (620, 480);

/// Width of the legend, px.
const LEGEND_WIDTH: u32 = 240;

/// Distance between lines of the legend, px.
const LEGEND_LINE: i32 = 24;

/// Height of a name on an axis, and the height of all else, px.
const NAME_HEIGHT: u32 = 26;
const HEADROOM: u32 = 110;

/// Width of a letter on an axis, px.
const LETTER: u32 = 6;

/// Colours that remain distinct for all kinds of sight (M. Okabe and K. Ito 2008), and brown.
const PALETTE: [RGBColor; 9] = [
    RGBColor(0, 0, 0),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(0, 114, 178),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(213, 94, 0),
    RGBColor(120, 94, 240),
    RGBColor(125, 75, 35),
];

const FONT: &str = "sans-serif";

/// How a series is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Style {
    /// Dots in a colour of their own, joined in their order; open dots once all colours are used.
    Curve,
    /// Dots in a colour of their own.
    Dots,
    /// A broad grey staircase behind everything: what nothing else beats in both.
    Front,
    /// Rings around points.
    Ring,
    /// Upright bars that values must not pass.
    Limit,
}

/// Points that belong together.
#[derive(Clone, Debug)]
pub struct Series {
    /// Its line in the legend.
    pub name: String,
    /// How it is drawn.
    pub style: Style,
    /// `(x, y)`; those that are not above zero are left out where the axis is logarithmic.
    pub points: Vec<(f64, f64)>,
    /// What is written above the points, in their order; may be fewer.
    pub notes: Vec<String>,
}

/// A chart.
#[derive(Clone, Debug)]
pub struct Chart {
    /// The line above it.
    pub title: String,
    /// What the horizontal axis shows, with its unit.
    pub x: String,
    /// What the vertical axis shows.
    pub y: Vertical,
    /// What is drawn; the first comes first in the legend.
    pub series: Vec<Series>,
}

/// What a vertical axis shows.
#[derive(Clone, Debug)]
pub enum Vertical {
    /// Values; what they are, with their unit.
    Values(String),
    /// Names, from the top; `y` of a point is the number of its name, from 0 on.
    Names(Vec<String>),
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

impl Series {
    /// Points without notes.
    #[must_use]
    pub fn new(
        name: impl Into<String>,
        style: Style,
        points: impl IntoIterator<Item = (f64, f64)>,
    ) -> Self {
        Self {
            name: name.into(),
            style,
            points: points.into_iter().collect(),
            notes: Vec::new(),
        }
    }

    /// The same points with notes.
    #[must_use]
    pub fn with_notes(self, notes: impl IntoIterator<Item = String>) -> Self {
        Self {
            notes: notes.into_iter().collect(),
            ..self
        }
    }
}

impl Chart {
    /// The picture.
    ///
    /// # Errors
    /// [`ChartError`] when there is no point to draw.
    pub fn svg(&self) -> Result<String, ChartError> {
        let points = self.series.iter().flat_map(|series| &series.points);
        let nothing = || ChartError("it has no point above zero".to_owned());
        let x = Axis::around(points.clone().map(|point| point.0)).ok_or_else(nothing)?;
        let (y, what, margin, size) = match &self.y {
            Vertical::Values(what) => {
                let y = Axis::around(points.map(|point| point.1)).ok_or_else(nothing)?;
                (y, what.as_str(), 62, PLOT)
            }
            Vertical::Names(names) => {
                let longest = names.iter().map(|name| name.chars().count()).max();
                let margin = longest.unwrap_or(0) as u32 * LETTER;
                let height = HEADROOM + names.len() as u32 * NAME_HEIGHT;
                let size = (PLOT.0 + margin, height);
                (Axis::Named(names.clone()), "", margin, size)
            }
        };

        let mut text = String::new();
        let area = SVGBackend::with_string(&mut text, (size.0 + LEGEND_WIDTH, size.1));
        let area = area.into_drawing_area();
        area.fill(&WHITE)?;
        let (plot, legend) = area.split_horizontally(size.0);
        let mut chart = ChartBuilder::on(&plot)
            .caption(&self.title, (FONT, 18))
            .margin(12)
            .x_label_area_size(46)
            .y_label_area_size(margin)
            .build_cartesian_2d(x.clone(), y.clone())?;
        chart
            .configure_mesh()
            .x_desc(&self.x)
            .y_desc(what)
            .axis_desc_style((FONT, 15))
            .label_style((FONT, 13))
            .bold_line_style(BLACK.mix(0.12))
            .light_line_style(WHITE)
            .draw()?;

        // The front is behind what it leads along.
        let mut order: Vec<(usize, &Series)> = self.series.iter().enumerate().collect();
        order.sort_by_key(|(_, series)| series.style != Style::Front);
        for (number, series) in order {
            let has_place = |point: &(f64, f64)| x.holds(point.0) && y.holds(point.1);
            let places = series.points.iter().copied().filter(has_place);
            let places: Vec<(f64, f64)> = places.collect();
            if let Some(style) = line_style(series.style, number) {
                chart.draw_series([PathElement::new(path(series.style, &places), style)])?;
            }
            if let Some((radius, dot)) = dot_style(series.style, number) {
                chart.draw_series(places.iter().map(|at| Circle::new(*at, radius, dot)))?;
            }
            if series.style == Style::Limit {
                chart.draw_series(places.iter().map(|at| EmptyElement::at(*at) + bar((0, 0))))?;
            }
            let font = (FONT, 13).into_font().color(&colour(number));
            let noted = series.points.iter().zip(&series.notes);
            let notes = noted
                .filter(|(point, _)| has_place(point))
                .map(|(at, note)| {
                    let text = Text::new(note.clone(), (-10, -20), font.clone());
                    EmptyElement::at(*at) + text
                });
            chart.draw_series(notes)?;
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
            if let Some(style) = line_style(series.style, number) {
                area.draw(&PathElement::new([(8, y), (32, y)], style))?;
            }
            if let Some((radius, dot)) = dot_style(series.style, number) {
                area.draw(&Circle::new((20, y), radius, dot))?;
            }
            if series.style == Style::Limit {
                area.draw(&bar((20, y)))?;
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

/// Style of the line that joins the points of a series.
fn line_style(style: Style, number: usize) -> Option<ShapeStyle> {
    match style {
        Style::Front => Some(BLACK.mix(0.22).stroke_width(7)),
        Style::Curve => Some(colour(number).stroke_width(2)),
        Style::Dots | Style::Ring | Style::Limit => None,
    }
}

/// Radius and style of the dots of a series.
fn dot_style(style: Style, number: usize) -> Option<(i32, ShapeStyle)> {
    match style {
        Style::Curve if number < PALETTE.len() => Some((4, colour(number).filled())),
        Style::Curve => Some((5, colour(number).stroke_width(2))),
        Style::Dots => Some((6, colour(number).filled())),
        Style::Front | Style::Limit => None,
        Style::Ring => Some((10, RGBColor(200, 0, 0).stroke_width(3))),
    }
}

/// The mark of a limit, px.
fn bar((x, y): (i32, i32)) -> PathElement<(i32, i32)> {
    PathElement::new(
        [(x, y - 10), (x, y + 10)],
        RGBColor(200, 0, 0).stroke_width(4),
    )
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

#[cfg(test)]
mod tests {
    use super::*;

    fn chart() -> Chart {
        let curve = [(0.01, 5.0), (0.1, 2.0), (1.0, 0.0)];
        let front = [(0.01, 5.0), (0.1, 2.0)];
        Chart {
            title: "error against time".to_owned(),
            x: "time (s)".to_owned(),
            y: Vertical::Values("error (%)".to_owned()),
            series: vec![
                Series::new("a way", Style::Curve, curve).with_notes(["first point".to_owned()]),
                Series::new("front", Style::Front, front),
                Series::new("default", Style::Ring, [(0.1, 2.0)]),
                Series::new("limit", Style::Limit, [(0.5, 3.0)]),
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
            "first point",
            "front",
            "default",
            "limit",
        ] {
            assert!(svg.contains(text), "{text}");
        }
        assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"));
    }

    #[test]
    fn every_name_is_written_and_makes_the_chart_higher() {
        let height = |count: usize| {
            let names: Vec<String> = (0..count).map(|i| format!("case {i}")).collect();
            let points = (0..count).map(|number| (1e-6, number as f64));
            let chart = Chart {
                y: Vertical::Names(names.clone()),
                series: vec![Series::new("ours", Style::Dots, points)],
                ..chart()
            };
            let svg = chart.svg().unwrap();
            assert!(names.iter().all(|name| svg.contains(name)));
            assert_eq!(svg.matches("<circle").count(), count + 1, "and the legend");
            let height = svg.split("height=\"").nth(1).unwrap();
            height.split('"').next().unwrap().parse::<u32>().unwrap()
        };
        assert!(height(20) > height(10));
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
    fn a_front_is_a_staircase() {
        let steps = path(Style::Front, &[(1.0, 9.0), (2.0, 4.0)]);
        assert_eq!(steps, [(1.0, 9.0), (2.0, 9.0), (2.0, 4.0)]);
    }
}
