//! Far pairs: the double area integral by product Gauss rules.
//!
//! `A_1 F_12 = int_A1 int_A2 (n_1 . r) (-n_2 . r) / (pi r^4) dA_2 dA_1` with `r` from 1 to 2, in m2.
//! Every term is positive, so nothing cancels however far apart the polygons are. The
//! kernel is analytic with its pole at the distance `d`: with the radii `R_1`, `R_2` of the polygons the
//! error falls as `((R_1 + R_2) / d)^(2 n)`.

use std::f64::consts::PI;

use glam::DVec3;

use super::polygon::{ROUNDINGS, bilinear, cells};
use super::rules::{GAUSS, Rule};
use super::{Estimate, Face};

/// Largest `(R_1 + R_2) / d` for which the rules are tried.
const FAR: f64 = 0.65;

/// Two rules may agree by chance: an error is at least this share of the difference one rule before.
const CHANCE: f64 = 0.02;

/// Parts that are so much smaller than the polygons and still near each other touch.
const TOUCH: f64 = 1e-6;

/// Most pairs of parts that [`divided`] makes of one pair: some milliseconds.
const PARTS: usize = 4000;

/// `A_1 F_12` with its error, or `None` for a pair that is not far enough to get below `tolerance`
/// (relative) with the finest rule.
///
/// Each polygon lies in front of the other one.
pub(super) fn integrate(from: &Face, to: &Face, tolerance: f64) -> Option<Estimate> {
    if nearness(from, to) > FAR {
        return None;
    }
    let mut sums = [
        double_sum(from, to, GAUSS[0]),
        double_sum(from, to, GAUSS[1]),
    ];
    for rule in &GAUSS[2..] {
        let [coarsest, coarse] = sums;
        let value = double_sum(from, to, rule);
        let error = (value - coarse).abs() + CHANCE * (coarse - coarsest).abs();
        if error <= tolerance * value {
            let error = error + rounding(from, to) * value;
            return Some(Estimate { value, error });
        }
        sums = [coarse, value];
    }
    None
}

/// The same for a pair that is apart but wide: the wider one is halved until all parts are far.
///
/// `None` for pairs that touch, or are so close that this takes too many parts.
pub(super) fn divided(from: &Face, to: &Face, tolerance: f64) -> Option<Estimate> {
    let smallest = TOUCH * (from.radius() + to.radius());
    let mut waiting = vec![[from.clone(), to.clone()]];
    let mut sum = Estimate::default();
    for _ in 0..PARTS {
        let Some([from, to]) = waiting.pop() else {
            return Some(sum);
        };
        if let Some(part) = integrate(&from, &to, tolerance) {
            sum.value += part.value;
            sum.error += part.error;
        } else if from.radius() + to.radius() < smallest {
            return None;
        } else if from.radius() > to.radius() {
            waiting.extend(from.halves().map(|half| [half, to.clone()]));
        } else {
            waiting.extend(to.halves().map(|half| [from.clone(), half]));
        }
    }
    None
}

/// Relative error by rounding: that of the heights above each other, of which the cosines are made.
fn rounding(from: &Face, to: &Face) -> f64 {
    let (a, b) = (from.middle(), to.middle());
    4.0 * ROUNDINGS * a.distance(b) * (1.0 / from.height(b) + 1.0 / to.height(a))
}

/// `(R_1 + R_2) / d`: the radii about the middles over the distance of the middles.
fn nearness(from: &Face, to: &Face) -> f64 {
    (from.radius() + to.radius()) / from.middle().distance(to.middle())
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
