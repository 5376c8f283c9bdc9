//! Near pairs: the double contour integral, one half in closed form, the other one adaptive.
//!
//! `A_1 F_12 = 1/(2 pi) oint_C1 oint_C2 ln r dx_1 . dx_2`, in m2. For a point `x` on `C_1` every edge of
//! `C_2` with direction `t_k` gives, with `u` measured along it from the foot of `x`, `h` the
//! distance from its line and `alpha` the angle that it fills,
//!
//! `int ln r du = [u ln r]_a^b + h alpha - (u_b - u_a)`,
//!
//! whose last term cancels over the closed contour. What is left for the rule along `C_1` has
//! singularities at the vertices of `C_2`, at the distance that those have from the edge of `C_1`, and where
//! an edge's line passes near. Edges of `C_1` are divided at the feet of such places and the parameter is
//! bent there, `s = t^3 (10 - 15 t + 6 t^2)`, so that shared edges and touching corners converge as well.
//!
//! Assumptions: each polygon lies in front of the other one.
//!
//! # References
//! * E. M. Sparrow, *A new and simpler formulation for radiative angle factors*, ASME J. Heat
//!   Transfer 85, 1963, eq. 12: the double contour integral.
//! * A. Mazumder, M. Ravishankar, *General procedure for calculation of diffuse view factors between
//!   arbitrary planar polygons*, Int. J. Heat Mass Transfer 55, 2012: the integral along one edge.

use std::f64::consts::TAU;

use glam::DVec3;

use super::Estimate;
use super::polygon::edges;
use super::rules::{FINEST, PATTERSON_POINTS, patterson_indices, patterson_node, patterson_sum};

/// A singularity counts as near when it is closer than this share of the panel's length.
const NEAR: f64 = 0.3;

/// Two rules may agree by chance: an error is at least this share of the difference one level before.
const CHANCE: f64 = 1e-3;

/// Most rounds of refinement: a round at least halves the panels that are not good enough.
const ROUNDS: usize = 40;

/// Most panels: about a second's work.
const PANELS: usize = 4000;

/// `A_1 F_12` with its error, which is at most `tolerance` (relative) unless rounding or the bound on the
/// work forbids it.
pub(super) fn integrate(from: &[DVec3], to: &[DVec3], tolerance: f64) -> Estimate {
    // The closed form does the longer contour.
    let (outer, inner) = if perimeter(from) <= perimeter(to) {
        (from, to)
    } else {
        (to, from)
    };
    let inner = Contour::new(inner);
    let lines: Vec<Line> = edges(outer)
        .filter_map(|(a, b)| Line::new(a, b, &inner))
        .collect();
    let mut panels: Vec<Panel> = Vec::with_capacity(2 * lines.len());
    for line in &lines {
        line.divide(0.0, line.length, &mut |lo, hi| {
            panels.push(Panel::new(line, lo, hi))
        });
    }
    for panel in &mut panels {
        panel.evaluate(&inner);
    }

    for _ in 0..ROUNDS {
        let (value, error) = total(&panels);
        let allowed = tolerance * value.abs();
        if error <= allowed + rounding(&panels) || panels.len() > PANELS {
            break;
        }
        let share = allowed / (2 * panels.len()) as f64;
        refine(&mut panels, share, &inner);
    }
    let (value, error) = total(&panels);
    Estimate {
        value: value / TAU,
        error: (error + rounding(&panels)) / TAU,
    }
}

fn perimeter(outline: &[DVec3]) -> f64 {
    edges(outline).map(|(a, b)| a.distance(b)).sum()
}

fn total(panels: &[Panel]) -> (f64, f64) {
    panels.iter().fold((0.0, 0.0), |(value, error), panel| {
        (value + panel.value, error + panel.error)
    })
}

/// What the roundings of all terms may add up to: terms are far larger than their sum.
fn rounding(panels: &[Panel]) -> f64 {
    8.0 * f64::EPSILON * panels.iter().map(|panel| panel.magnitude).sum::<f64>()
}

/// Takes the next rule on panels that err by more than `share`, and halves those that have the last.
fn refine(panels: &mut Vec<Panel>, share: f64, inner: &Contour) {
    for at in 0..panels.len() {
        if panels[at].error <= share {
            continue;
        }
        if panels[at].level < FINEST {
            panels[at].level += 1;
        } else {
            let (lo, hi, line) = (panels[at].lo, panels[at].hi, panels[at].line);
            let middle = (lo + hi) / 2.0;
            panels[at] = Panel::new(line, lo, middle);
            panels.push(Panel::new(line, middle, hi));
            let last = panels.len() - 1;
            panels[last].evaluate(inner);
        }
        panels[at].evaluate(inner);
    }
}

/// The contour that is integrated in closed form.
struct Contour {
    vertices: Vec<DVec3>,
    /// Unit vectors along the edges that start at the vertices, and the edges' lengths.
    edges: Vec<(DVec3, f64)>,
}

impl Contour {
    fn new(outline: &[DVec3]) -> Self {
        let kept = edges(outline).filter(|(a, b)| a != b);
        let (vertices, edges) = kept
            .map(|(a, b)| (a, ((b - a).normalize(), a.distance(b))))
            .unzip();
        Self { vertices, edges }
    }

    /// `oint ln r dx_2 . t` for a point, and the sum of its terms' absolute values.
    fn integral(&self, x: DVec3, cosines: &[f64]) -> (f64, f64) {
        let Some(first) = self.vertices.first() else {
            return (0.0, 0.0);
        };
        let (mut value, mut magnitude) = (0.0, 0.0);
        let start = *first - x;
        let start_log = log_length(start);
        let (mut a, mut log_a) = (start, start_log);
        for (k, ((t, length), cosine)) in self.edges.iter().zip(cosines).enumerate() {
            let (b, log_b) = match self.vertices.get(k + 1) {
                Some(next) => (*next - x, log_length(*next - x)),
                None => (start, start_log),
            };
            if *cosine != 0.0 {
                let sine = a.cross(b).length();
                let terms = [
                    b.dot(*t) * log_b,
                    -a.dot(*t) * log_a,
                    sine / length * sine.atan2(a.dot(b)),
                ];
                value += cosine * (terms[0] + terms[1] + terms[2]);
                magnitude += cosine.abs() * (terms[0].abs() + terms[1].abs() + terms[2]);
            }
            (a, log_a) = (b, log_b);
        }
        (value, magnitude)
    }
}

/// `ln |v|`; 0 for no length, where it is multiplied by 0.
fn log_length(v: DVec3) -> f64 {
    let square = v.length_squared();
    if square > 0.0 { 0.5 * square.ln() } else { 0.0 }
}

/// One edge of the contour that is integrated by rules.
struct Line {
    start: DVec3,
    direction: DVec3,
    length: f64,
    /// Cosines of the angles with the edges of the other contour.
    cosines: Vec<f64>,
    /// Places along the line beside which the integrand is singular, and how far off.
    singularities: Vec<(f64, f64)>,
}

impl Line {
    /// `None` for an edge without length or perpendicular to the whole other contour.
    fn new(start: DVec3, end: DVec3, inner: &Contour) -> Option<Self> {
        let length = start.distance(end);
        let direction = (end - start) / length;
        let cosine = |t: DVec3| {
            let cosine = direction.dot(t);
            if cosine.abs() > 2.0 * f64::EPSILON {
                cosine
            } else {
                0.0
            }
        };
        let cosines: Vec<f64> = inner.edges.iter().map(|(t, _)| cosine(*t)).collect();
        if length <= 0.0 || cosines.iter().all(|c| *c == 0.0) {
            return None;
        }

        let vertices = inner.vertices.iter().map(|v| {
            let foot = (*v - start).dot(direction);
            (foot, (start + direction * foot).distance(*v))
        });
        let passes = inner.vertices.iter().zip(&inner.edges);
        let passes = passes.filter_map(|(v, (t, edge_length))| {
            let normal = direction.cross(*t);
            let square = normal.length_squared();
            let offset = *v - start;
            let along = offset.cross(*t).dot(normal) / square;
            let along_edge = offset.cross(direction).dot(normal) / square;
            let is_passed = along_edge > 0.0 && along_edge < *edge_length;
            is_passed.then(|| (along, offset.dot(normal).abs() / square.sqrt()))
        });
        let reach = NEAR * length;
        let is_near =
            |(at, distance): &(f64, f64)| *distance < reach && *at > -reach && *at < length + reach;
        Some(Self {
            start,
            direction,
            length,
            singularities: vertices.chain(passes).filter(is_near).collect(),
            cosines,
        })
    }

    /// Divides the stretch from `lo` to `hi` at the worst singularity inside, and so on.
    fn divide(&self, lo: f64, hi: f64, found: &mut impl FnMut(f64, f64)) {
        // Closer to an end than rounding, it is at the end.
        let grain = 1e-12 * self.length;
        let inside = self.singularities.iter().filter_map(|(at, distance)| {
            let margin = (at - lo).min(hi - at);
            (margin > grain && *distance < NEAR * margin).then(|| (distance / margin, *at))
        });
        match inside.min_by(|a, b| a.0.total_cmp(&b.0)) {
            Some((_, at)) => {
                self.divide(lo, at, found);
                self.divide(at, hi, found);
            }
            None => found(lo, hi),
        }
    }

    /// True when a singularity is near the end `at` of a stretch.
    fn is_singular(&self, at: f64, length: f64) -> bool {
        let mut distances = self.singularities.iter().map(|(s, d)| (s - at).hypot(*d));
        distances.any(|distance| distance < NEAR * length)
    }
}

/// A stretch of a line with its share of the integral.
struct Panel<'a> {
    line: &'a Line,
    lo: f64,
    hi: f64,
    /// Whether the parameter is bent at either end.
    bent: (bool, bool),
    level: usize,
    /// Values at the nodes of the finest rule; NaN where not evaluated yet.
    values: [f64; PATTERSON_POINTS],
    magnitudes: f64,
    value: f64,
    error: f64,
    magnitude: f64,
}

impl<'a> Panel<'a> {
    fn new(line: &'a Line, lo: f64, hi: f64) -> Self {
        let bent = (line.is_singular(lo, hi - lo), line.is_singular(hi, hi - lo));
        Self {
            line,
            lo,
            hi,
            bent,
            level: if bent == (false, false) { 1 } else { 2 },
            values: [f64::NAN; PATTERSON_POINTS],
            magnitudes: 0.0,
            value: 0.0,
            error: f64::INFINITY,
            magnitude: 0.0,
        }
    }

    /// Evaluates what the level's rule still lacks; the error is the difference from the rule before.
    fn evaluate(&mut self, inner: &Contour) {
        let length = self.hi - self.lo;
        for index in patterson_indices(self.level) {
            if !self.values[index].is_nan() {
                continue;
            }
            let t = (1.0 + patterson_node(index)) / 2.0;
            let (share, slope) = bend(self.bent, t);
            let x = self.line.start + self.line.direction * (self.lo + length * share);
            let (value, magnitude) = inner.integral(x, &self.line.cosines);
            self.values[index] = value * slope;
            self.magnitudes = f64::max(self.magnitudes, magnitude);
        }
        let half = length / 2.0;
        let sum = |level: usize| half * patterson_sum(level, &self.values);
        self.value = sum(self.level);
        let before = sum(self.level - 1);
        let last = (self.value - before).abs();
        self.error = match self.level {
            1 => last,
            level => last.max(CHANCE * (before - sum(level - 2)).abs()),
        };
        self.magnitude = length * self.magnitudes;
    }
}

/// The share of the panel at the parameter `t` in [0, 1], and its slope.
fn bend(ends: (bool, bool), t: f64) -> (f64, f64) {
    let rest = 1.0 - t;
    match ends {
        (false, false) => (t, 1.0),
        (true, false) => (t * t * t, 3.0 * t * t),
        (false, true) => (1.0 - rest * rest * rest, 3.0 * rest * rest),
        (true, true) => (
            t * t * t * (10.0 + t * (6.0 * t - 15.0)),
            30.0 * t * t * rest * rest,
        ),
    }
}
