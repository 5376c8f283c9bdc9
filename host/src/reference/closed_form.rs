//! Form factors and irradiances that have a closed form.
//!
//! A form factor `F_12` is the fraction of the power leaving 1 that arrives at 2; with a point (a
//! differential element) as 1 it is also the irradiance there, in W/m2, that an exitance of
//! 1 W/m2 of polygon 2 causes. Lengths are in any one unit, areas above zero, nothing is in the way.
//!
//! The area formulas subtract large terms where the rectangles are small beside their distance:
//! their relative error is about `1e-16 (distance / size)^4`.
//!
//! # References
//! * J. H. Lambert, *Photometria*, 1760, section 4: point to polygon, the sum over the edges.
//! * D. C. Hamilton, W. R. Morgan, *Radiant-interchange configuration factors*, NACA TN 2836, 1952.
//! * J. R. Howell, *A Catalog of Radiation Heat Transfer Configuration Factors*, 1982:
//!   B-3, B-4, C-11, C-14.

use std::f64::consts::{PI, TAU};

use glam::DVec3;
use relume::scene::{Falloff, Source};

/// Form factor between identical, parallel, directly opposed rectangles.
///
/// `width` by `height` each, `distance` apart. Howell 1982, C-11 (Hamilton and Morgan 1952), with
/// `X = width / distance`, `Y = height / distance`.
#[must_use]
pub fn parallel_rectangles(width: f64, height: f64, distance: f64) -> f64 {
    let (x, y) = (width / distance, height / distance);
    let (root_x, root_y) = (x.hypot(1.0), y.hypot(1.0));
    let logarithm = (x * x).ln_1p() + (y * y).ln_1p() - (x * x + y * y).ln_1p();
    let sum = 0.5 * logarithm + x * root_y * (x / root_y).atan() + y * root_x * (y / root_x).atan()
        - x * x.atan()
        - y * y.atan();
    2.0 / (PI * x * y) * sum
}

/// Form factor between perpendicular rectangles with a common edge.
///
/// From the one that reaches `from` away from the edge to the one that reaches `to`; the edge is
/// `common` long. Howell 1982, C-14 (Hamilton and Morgan 1952), with `W = from / common`,
/// `H = to / common`.
#[must_use]
pub fn perpendicular_rectangles(common: f64, from: f64, to: f64) -> f64 {
    let (w, h) = (from / common, to / common);
    let (ww, hh) = (w * w, h * h);
    let diagonal = w.hypot(h);
    let all = 1.0 + ww + hh;
    let logarithm = ((1.0 + ww) * (1.0 + hh) / all).ln()
        + ww * (ww * all / ((1.0 + ww) * (ww + hh))).ln()
        + hh * (hh * all / ((1.0 + hh) * (ww + hh))).ln();
    let sum = w * (1.0 / w).atan() + h * (1.0 / h).atan() - diagonal * (1.0 / diagonal).atan()
        + 0.25 * logarithm;
    sum / (PI * w)
}

/// Form factor from a point to a parallel rectangle, one corner of which is straight above it.
///
/// The rectangle is `width` by `height`, `distance` above. Howell 1982, B-3, with
/// `X = width / distance`, `Y = height / distance`.
#[must_use]
pub fn point_to_parallel_rectangle(width: f64, height: f64, distance: f64) -> f64 {
    let (x, y) = (width / distance, height / distance);
    let (root_x, root_y) = (x.hypot(1.0), y.hypot(1.0));
    (x / root_x * (y / root_x).atan() + y / root_y * (x / root_y).atan()) / TAU
}

/// Form factor from a point to a perpendicular rectangle that stands on the point's plane.
///
/// The foot of the point on the rectangle's plane is a corner of it; the edge in the point's plane
/// is `width` long, the other one `height`, and the point is `distance` away from that corner.
/// Howell 1982, B-4, with `X = height / width`, `Y = distance / width`.
#[must_use]
pub fn point_to_perpendicular_rectangle(width: f64, height: f64, distance: f64) -> f64 {
    let (x, y) = (height / width, distance / width);
    let slant = x.hypot(y);
    ((1.0 / y).atan() - y / slant * (1.0 / slant).atan()) / TAU
}

/// Form factor from a point to a convex polygon: `F = 1/(2 pi) |sum_i angle_i n . g_i|`.
///
/// `angle_i` is the angle that edge `i` fills as seen from the point and `g_i` the unit normal of
/// the plane through both (Lambert 1760). The part of the polygon below the point's horizon does
/// not count, nor does a polygon that shows its back (vertices clockwise as seen from the point).
#[must_use]
pub fn point_to_polygon(point: DVec3, normal: DVec3, polygon: &[DVec3]) -> f64 {
    let seen: Vec<DVec3> = polygon.iter().map(|v| *v - point).collect();
    let visible = above_horizon(&seen, normal);
    let sum: f64 = edges(&visible)
        .map(|(a, b)| {
            let cross = a.cross(b);
            let sine = cross.length();
            if sine > 0.0 {
                sine.atan2(a.dot(b)) * normal.dot(cross) / sine
            } else {
                0.0
            }
        })
        .sum();
    (-sum / TAU).max(0.0)
}

/// The part of an outline around the origin with `normal . v >= 0`.
fn above_horizon(outline: &[DVec3], normal: DVec3) -> Vec<DVec3> {
    let mut part = Vec::with_capacity(outline.len() + 1);
    for (a, b) in edges(outline) {
        let (height_a, height_b) = (normal.dot(a), normal.dot(b));
        if height_a >= 0.0 {
            part.push(a);
        }
        if height_a * height_b < 0.0 {
            part.push(a + (b - a) * (height_a / (height_a - height_b)));
        }
    }
    part
}

/// The edges `(from, to)` of an outline.
fn edges(outline: &[DVec3]) -> impl Iterator<Item = (DVec3, DVec3)> + '_ {
    let next = outline.iter().cycle().skip(1);
    outline.iter().copied().zip(next.copied())
}

/// Irradiance in a closed room of one reflectance whose every wall emits the same exitance:
/// `E = B = M / (1 - rho)`, from `B = M + rho E` and `E = B`.
#[must_use]
pub fn furnace(exitance: f64, reflectance: f64) -> f64 {
    exitance / (1.0 - reflectance)
}

/// Irradiance of an unobstructed source of unit emission on a surface at `point`, in W/m2.
///
/// Point and spot: `I cos / r^2` (Lambert 1760). Sun: the cosine, as long as its whole disc is
/// above the horizon: a disc of uniform radiance `L` and half angle `a` gives
/// `pi L sin^2 a cos`, and unit emission is `pi L sin^2 a = 1`. Sky: `pi L = 1`.
#[must_use]
pub fn source_irradiance(source: &Source, point: DVec3, normal: DVec3) -> f64 {
    match *source {
        Source::Point { position } | Source::Spot { position, .. } => {
            let towards = position.as_dvec3() - point;
            let distance = towards.length();
            let cosine = normal.dot(towards / distance).max(0.0);
            intensity(source, -towards) * cosine / (distance * distance)
        }
        Source::Sun { direction, .. } => (-normal.dot(direction.as_dvec3().normalize())).max(0.0),
        Source::Sky => 1.0,
    }
}

/// Intensity of a point or spot of unit emission in a direction (of any length), in W/sr.
///
/// With the angle `a` to the axis a spot's falloff is
/// `((cos a - cos outer) / (cos inner - cos outer))^2` (KHR_lights_punctual, 2018, "Inner and
/// Outer Cone Angles") or `(outer - a) / (outer - inner)`. Sun and sky have none: 0.
#[must_use]
pub fn intensity(source: &Source, direction: DVec3) -> f64 {
    match *source {
        Source::Point { .. } => 1.0,
        Source::Spot {
            direction: axis,
            inner,
            outer,
            falloff,
            ..
        } => {
            let axis = axis.as_dvec3();
            let angle = axis.cross(direction).length().atan2(axis.dot(direction));
            let (inner, outer) = (f64::from(inner), f64::from(outer));
            if angle <= inner {
                return 1.0;
            }
            if angle >= outer {
                return 0.0;
            }
            match falloff {
                Falloff::Smooth => {
                    ((angle.cos() - outer.cos()) / (inner.cos() - outer.cos())).powi(2)
                }
                Falloff::Linear => (outer - angle) / (outer - inner),
            }
        }
        Source::Sun { .. } | Source::Sky => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    /// Mean of `f` over a unit square, midpoint rule.
    fn mean(steps: u32, f: impl Fn(f64, f64) -> f64) -> f64 {
        let at = |i: u32| (f64::from(i) + 0.5) / f64::from(steps);
        let pairs = (0..steps).flat_map(|i| (0..steps).map(move |j| (i, j)));
        pairs.map(|(i, j)| f(at(i), at(j))).sum::<f64>() / f64::from(steps).powi(2)
    }

    fn assert_near(a: f64, b: f64, relative: f64, what: &str) {
        let difference = (a - b).abs();
        assert!(
            difference <= relative * b.abs(),
            "{what}: {a} is not {b} ({difference:e})"
        );
    }

    /// `width` by `height` at the height `z`, front down.
    fn ceiling(width: f64, height: f64, z: f64) -> [DVec3; 4] {
        [(0.0, 0.0), (0.0, height), (width, height), (width, 0.0)].map(|(x, y)| DVec3::new(x, y, z))
    }

    /// On the plane `x = 0`, front towards growing x, from `z = 0` up.
    fn wall(width: f64, height: f64) -> [DVec3; 4] {
        [(0.0, 0.0), (width, 0.0), (width, height), (0.0, height)]
            .map(|(y, z)| DVec3::new(0.0, y, z))
    }

    #[test]
    fn rectangles_agree_with_forty_digit_contour_integrals() {
        // From the contour integration in 40 digits of data/form_factors.
        assert_near(
            parallel_rectangles(1.0, 1.0, 3.0),
            0.032_971_397_219_497_295,
            1e-13,
            "d 3",
        );
        assert_near(
            parallel_rectangles(1.0, 1.0, 0.25),
            0.632_036_430_013_860_3,
            1e-14,
            "d 1/4",
        );
        assert_near(
            parallel_rectangles(64.0, 1.0, 1.0),
            0.409_848_898_308_274_03,
            1e-14,
            "64 x 1",
        );
        assert_near(
            perpendicular_rectangles(1.0, 1.0, 1.0),
            0.200_043_776_075_403_16,
            1e-15,
            "1",
        );
        assert_near(
            perpendicular_rectangles(1.0, 1.0, 0.5),
            0.146_186_679_105_713_3,
            1e-14,
            "1/2",
        );
        let slit = perpendicular_rectangles(1.0, 1.0 / 1024.0, 1.0);
        assert_near(slit, 0.498_621_336_427_530_15, 1e-13, "1/1024");
    }

    #[test]
    fn the_walls_of_a_cube_see_everything() {
        let sum =
            parallel_rectangles(1.0, 1.0, 1.0) + 4.0 * perpendicular_rectangles(1.0, 1.0, 1.0);
        assert_near(sum, 1.0, 1e-15, "closure");
    }

    #[test]
    fn perpendicular_rectangles_are_reciprocal() {
        for (common, a, b) in [(1.0, 2.0, 3.0), (0.3, 5.0, 0.1), (64.0, 1.0, 64.0)] {
            let there = a * perpendicular_rectangles(common, a, b);
            let back = b * perpendicular_rectangles(common, b, a);
            assert_near(there, back, 1e-12, &format!("{common} {a} {b}"));
        }
    }

    #[test]
    fn the_point_formulas_are_special_cases_of_the_polygon() {
        for (width, height, distance) in [(1.0, 1.0, 1.0), (3.0, 0.2, 0.5), (0.1, 7.0, 2.0)] {
            let what = format!("{width} {height} {distance}");
            let over = point_to_polygon(DVec3::ZERO, DVec3::Z, &ceiling(width, height, distance));
            let expected = point_to_parallel_rectangle(width, height, distance);
            assert_near(over, expected, 1e-13, &what);

            let aside = DVec3::X * distance;
            let beside = point_to_polygon(aside, DVec3::Z, &wall(width, height));
            let expected = point_to_perpendicular_rectangle(width, height, distance);
            assert_near(beside, expected, 1e-13, &what);
        }
    }

    #[test]
    fn the_polygon_formula_is_the_integral_of_its_kernel() {
        let (point, normal) = (DVec3::new(0.2, -0.3, 0.1), DVec3::new(0.6, 0.0, 0.8));
        let integral = 2.0
            * 1.5
            * mean(500, |s, t| {
                let r = DVec3::new(2.0 * s, 1.5 * t, 1.3) - point;
                let distance = r.length();
                normal.dot(r).max(0.0) * (1.3 - point.z) / (PI * distance.powi(4))
            });
        let formula = point_to_polygon(point, normal, &ceiling(2.0, 1.5, 1.3));
        assert_near(formula, integral, 1e-5, "tilted point");
    }

    #[test]
    fn the_area_formulas_are_means_of_the_point_formula() {
        let opposite = ceiling(2.0, 1.0, 1.5);
        let floor = mean(100, |s, t| {
            point_to_polygon(DVec3::new(2.0 * s, t, 0.0), DVec3::Z, &opposite)
        });
        assert_near(floor, parallel_rectangles(2.0, 1.0, 1.5), 3e-5, "C-11");

        // The integrand has a finite jump at the common edge: x = s^2 crowds points there.
        let adjacent = wall(1.0, 0.7);
        let floor = mean(200, |s, t| {
            2.0 * s * point_to_polygon(DVec3::new(s * s, t, 0.0), DVec3::Z, &adjacent)
        });
        assert_near(floor, perpendicular_rectangles(1.0, 1.0, 0.7), 1e-4, "C-14");
    }

    #[test]
    fn below_the_horizon_and_from_behind_nothing_is_seen() {
        let half =
            [(0.0, -1.0), (1.0, -1.0), (1.0, 1.0), (0.0, 1.0)].map(|(y, z)| DVec3::new(0.0, y, z));
        let upper = point_to_polygon(DVec3::X, DVec3::Z, &wall(1.0, 1.0));
        assert_near(
            point_to_polygon(DVec3::X, DVec3::Z, &half),
            upper,
            1e-14,
            "clipped",
        );

        let mut back = wall(1.0, 1.0);
        back.reverse();
        assert_eq!(point_to_polygon(DVec3::X, DVec3::Z, &back), 0.0);
        assert_eq!(point_to_polygon(DVec3::X, -DVec3::Z, &wall(1.0, 1.0)), 0.0);
    }

    #[test]
    fn a_ceiling_without_end_is_the_whole_sky() {
        let ceiling = ceiling(2e6, 2e6, 1.0).map(|v| v - DVec3::new(1e6, 1e6, 0.0));
        let all = point_to_polygon(DVec3::ZERO, DVec3::Z, &ceiling);
        assert_near(
            all,
            source_irradiance(&Source::Sky, DVec3::ZERO, DVec3::Z),
            1e-11,
            "sky",
        );
    }

    #[test]
    fn spots_fall_off_between_their_angles() {
        let spot = |falloff| Source::Spot {
            position: Vec3::new(0.0, 0.0, 2.0),
            direction: -Vec3::Z,
            inner: 0.25,
            outer: 0.75,
            falloff,
        };
        let at = |angle: f64| DVec3::new(angle.sin(), 0.0, -angle.cos());
        for falloff in [Falloff::Smooth, Falloff::Linear] {
            assert_eq!(intensity(&spot(falloff), at(0.24)), 1.0);
            assert_eq!(intensity(&spot(falloff), at(0.76)), 0.0);
        }
        assert_near(
            intensity(&spot(Falloff::Linear), at(0.5)),
            0.5,
            1e-12,
            "linear",
        );
        let smooth = ((0.5f64.cos() - 0.75f64.cos()) / (0.25f64.cos() - 0.75f64.cos())).powi(2);
        assert_near(
            intensity(&spot(Falloff::Smooth), at(0.5)),
            smooth,
            1e-12,
            "smooth",
        );

        let below = source_irradiance(&spot(Falloff::Smooth), DVec3::ZERO, DVec3::Z);
        assert_near(below, 0.25, 1e-15, "inverse square");
        assert_eq!(
            source_irradiance(&spot(Falloff::Smooth), DVec3::ZERO, -DVec3::Z),
            0.0
        );
    }

    #[test]
    fn a_furnace_is_its_geometric_series() {
        let series: f64 = (0..2000).map(|n| 3.0 * 0.98f64.powi(n)).sum();
        assert_near(furnace(3.0, 0.98), series, 1e-12, "furnace");
    }
}
