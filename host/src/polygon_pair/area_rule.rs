//! Far pairs: the double area integral by product Gauss rules.
//!
//! `A_1 F_12 = int_A1 int_A2 (n_1 . r) (-n_2 . r) / (pi r^4) dA_2 dA_1` with `r` from 1 to 2, in m2.
//! Every term is positive, so nothing cancels however far apart the polygons are. The
//! kernel is analytic with its pole at the distance `d`: with the radii `R_1`, `R_2` of the polygons the
//! error falls as `((R_1 + R_2) / d)^(2 n)`.

use std::f64::consts::PI;

use glam::DVec3;

use super::polygon::{bilinear, cells};
use super::rules::{GAUSS, Rule};
use super::{Estimate, Face};

/// Largest `(R_1 + R_2) / d` for which the rules are tried at all.
const FAR: f64 = 0.65;

/// `A_1 F_12` with its error, or `None` for a pair that is not far enough to get below `tolerance`
/// (relative) with the finest rule.
///
/// Each polygon lies in front of the other one. The error is the difference from the next coarser rule.
pub(super) fn integrate(from: &Face, to: &Face, tolerance: f64) -> Option<Estimate> {
    let nearness = nearness(from, to);
    if nearness > FAR {
        return None;
    }
    let first = if nearness < 0.15 { 0 } else { 1 };
    let mut coarse = double_sum(from, to, GAUSS[first]);
    for rule in &GAUSS[first + 1..] {
        let fine = double_sum(from, to, rule);
        let error = (fine - coarse).abs();
        if error <= tolerance * fine {
            return Some(Estimate { value: fine, error });
        }
        coarse = fine;
    }
    None
}

/// `(R_1 + R_2) / d`: the radii about the middles over the distance of the middles.
fn nearness(from: &Face, to: &Face) -> f64 {
    let radius = |face: &Face, middle: DVec3| {
        let squares = face.outline.iter().map(|v| v.distance_squared(middle));
        squares.fold(0.0, f64::max).sqrt()
    };
    let (a, b) = (from.middle(), to.middle());
    (radius(from, a) + radius(to, b)) / a.distance(b)
}

fn double_sum(from: &Face, to: &Face, rule: Rule) -> f64 {
    let (from_points, to_points) = (points(from, rule), points(to, rule));
    let seen = |x: DVec3| -> f64 {
        let terms = to_points.iter().map(|(y, weight)| {
            let r = *y - x;
            let square = r.length_squared();
            weight * r.dot(from.normal) * -r.dot(to.normal) / (square * square)
        });
        terms.sum()
    };
    let sum: f64 = from_points
        .iter()
        .map(|(x, weight)| weight * seen(*x))
        .sum();
    sum / PI
}

/// Quadrature points: places and shares of the area.
fn points(face: &Face, rule: Rule) -> Vec<(DVec3, f64)> {
    let mut points = Vec::with_capacity(face.outline.len() / 2 * rule.len() * rule.len());
    for cell in cells(&face.outline) {
        for (s, weight_s) in rule {
            for (t, weight_t) in rule {
                let (point, density) = bilinear(&cell, face.normal, *s, *t);
                points.push((point, weight_s * weight_t * density));
            }
        }
    }
    points
}
