//! One row of form factors: from every receiving element to one shooting patch.
//!
//! `F_ji`, the fraction of element `j`'s view that patch `i` fills (the average over `j`), by
//! Lambert's formula at receiver points `x` with normal `n`:
//!
//! `F_xi = 1/(2 pi) sum_k theta_k (r_k x r_k+1) . n / |r_k x r_k+1|`
//!
//! `r_k` run from `x` to the vertices of the patch, clipped at the horizon of `x`; `theta_k` is the
//! angle between `r_k` and `r_k+1` (Lambert 1760; Baum, Rushmeier and Winget 1989, eq. 6). It is
//! multiplied by the visible share of the kernel `cos a cos b / r^2` over points of the patch.
//! Shooting `dB_i` raises the irradiance of `j` by `dB_i F_ji`: by reciprocity
//! `F_ji = F_ij A_i / A_j`, so the receiver's own factor is all that a row has to hold.
//!
//! Assumptions: planar convex patches that radiate evenly from their front. Receiver points are
//! the Gauss points of the element (2 x 2 on quads, 3 on triangles); each looks at 4 of 16
//! stratified points of the patch. Factors are finite and in [0, 1]; a coplanar or back-facing
//! pair gives 0.

use core::f32::consts::PI;

use glam::{Vec2, Vec3};
use heapless::Vec;

use crate::geometry::{Clipped, Polygon, SamplePoint, clip, from_unit_square, gauss_points};
use crate::math;
use crate::mesh::Mesh;
use crate::visibility::Visibility;

/// The form factor from a point with a unit normal to the front of a polygon, unoccluded.
///
/// In [0, 1]; 0 for a point behind the polygon or in its plane.
#[must_use]
pub fn point_to_polygon(point: Vec3, normal: Vec3, outline: &[Vec3]) -> f32 {
    lambert(normal, &above_horizon(point, normal, outline))
}

/// The outline relative to `point`, without what lies below the horizon.
fn above_horizon(point: Vec3, normal: Vec3, outline: &[Vec3]) -> Clipped {
    let relative: Clipped = outline.iter().map(|v| *v - point).take(7).collect();
    clip(&relative, |v| v.dot(normal))
}

/// Lambert's sum over the edges of an outline seen from the origin.
fn lambert(normal: Vec3, outline: &[Vec3]) -> f32 {
    let next = outline.iter().cycle().skip(1);
    let sum: f32 = outline
        .iter()
        .zip(next)
        .map(|(a, b)| {
            let cross = a.cross(*b);
            let length = cross.length();
            // On the line through the edge the direction is undefined; its share is finite.
            if length <= f32::MIN_POSITIVE {
                return 0.0;
            }
            math::atan2(length, a.dot(*b)) * cross.dot(normal) / length
        })
        .sum();
    // Counter-clockwise from its front is clockwise for who looks along his own normal.
    (-sum / (2.0 * PI)).clamp(0.0, 1.0)
}

/// A patch that shoots, with the points at which its visibility is sampled.
#[derive(Clone, Debug)]
pub struct Shooter {
    polygon: Polygon,
    /// Four interleaved sets of four points, each with its share of the area.
    samples: [Vec<SamplePoint, 4>; 4],
}

impl Shooter {
    /// Places 16 stratified points on the patch, four for each receiver point.
    #[must_use]
    pub fn new(polygon: Polygon) -> Self {
        let set = |offset: Vec2| {
            [(0.0, 0.0), (2.0, 0.0), (0.0, 2.0), (2.0, 2.0)]
                .into_iter()
                .map(|(s, t)| {
                    let at = (Vec2::new(s, t) + offset + 0.5) / 4.0;
                    let (position, density) = from_unit_square(&polygon, at);
                    SamplePoint {
                        position,
                        weight: density / 16.0,
                    }
                })
                .collect()
        };
        Self {
            polygon,
            samples: [set(Vec2::ZERO), set(Vec2::ONE), set(Vec2::X), set(Vec2::Y)],
        }
    }

    /// `F_ji` of one receiver, averaged over its area, times visibility.
    #[must_use]
    pub fn form_factor(&self, receiver: &Polygon, visibility: &impl Visibility) -> f32 {
        if faces_away(&self.polygon, receiver) || faces_away(receiver, &self.polygon) {
            return 0.0;
        }
        let points = gauss_points(receiver);
        points
            .iter()
            .zip(&self.samples)
            .map(|(point, samples)| {
                let above =
                    above_horizon(point.position, receiver.normal(), self.polygon.vertices());
                let open = lambert(receiver.normal(), &above);
                if open <= 0.0 {
                    return 0.0;
                }
                let visible =
                    self.visible_share(point.position, receiver.normal(), samples, visibility);
                point.weight
                    * open
                    * visible.unwrap_or_else(|| sees_middle(point.position, &above, visibility))
            })
            .sum::<f32>()
            .min(1.0)
    }

    /// Share of the kernel that is not hidden; `None` when every sample is below the horizon.
    fn visible_share(
        &self,
        point: Vec3,
        normal: Vec3,
        samples: &[SamplePoint],
        visibility: &impl Visibility,
    ) -> Option<f32> {
        let (mut seen, mut total) = (0.0, 0.0);
        for sample in samples {
            let ray = sample.position - point;
            let square = ray.length_squared();
            let cosines = ray.dot(normal) * -ray.dot(self.polygon.normal());
            if cosines <= 0.0 || square <= f32::MIN_POSITIVE {
                continue;
            }
            let kernel = sample.weight * cosines / (square * square);
            total += kernel;
            if visibility.sees(point, sample.position) {
                seen += kernel;
            }
        }
        (total > 0.0 && total.is_finite()).then(|| (seen / total).min(1.0))
    }
}

/// 1 when the middle of what is above the horizon is visible, else 0.
fn sees_middle(point: Vec3, above: &Clipped, visibility: &impl Visibility) -> f32 {
    let middle = above.iter().copied().sum::<Vec3>() / above.len().max(1) as f32;
    f32::from(u8::from(visibility.sees(point, point + middle)))
}

/// True when all of `other` lies behind the plane of `polygon`, or in it.
fn faces_away(polygon: &Polygon, other: &Polygon) -> bool {
    other.vertices().iter().all(|v| {
        let (height, tolerance) = polygon.height(*v);
        height <= tolerance
    })
}

/// Fills `row[j]` with the form factor of element `first + j` to the shooter.
///
/// Slices of one row may be filled in any order, by several threads; [`conserve`] then closes it.
/// Elements beyond the mesh get 0.
pub fn fill(
    mesh: &Mesh,
    shooter: &Shooter,
    first: u32,
    visibility: &impl Visibility,
    row: &mut [f32],
) {
    let elements = mesh.elements.get(first as usize..).unwrap_or_default();
    row.fill(0.0);
    for (factor, element) in row.iter_mut().zip(elements) {
        if let Some(receiver) = mesh.element_polygon(element) {
            *factor = shooter.form_factor(&receiver, visibility);
        }
    }
}

/// Scales a whole row down when it would deliver more power than the patch sends.
///
/// `sum_j A_j F_ji <= A_i`: receiver sampling errs by a few tenths of a per cent, and rows that
/// create energy diverge at high reflectance. Rows that deliver less stay as they are: the rest
/// left through an opening or was absorbed by a black surface.
pub fn conserve(mesh: &Mesh, shooter_area: f32, row: &mut [f32]) {
    let delivered: f64 = row
        .iter()
        .zip(mesh.elements)
        .map(|(factor, element)| f64::from(*factor) * f64::from(element.area))
        .sum();
    if delivered > f64::from(shooter_area) {
        let scale = (f64::from(shooter_area) / delivered) as f32;
        row.iter_mut().for_each(|factor| *factor *= scale);
    }
}

/// The whole row of a patch, serially: [`fill`] and [`conserve`].
///
/// A patch that the mesh does not have gives a row of zeros.
pub fn row(mesh: &Mesh, patch: u32, visibility: &impl Visibility, row: &mut [f32]) {
    let Some(polygon) = mesh.patch_polygon(patch) else {
        row.fill(0.0);
        return;
    };
    fill(mesh, &Shooter::new(polygon), 0, visibility, row);
    conserve(mesh, polygon.area(), row);
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use crate::color::Rgb;
    use crate::scene::Surface;
    use crate::visibility::Occluders;
    use proptest::prelude::*;
    use std::vec::Vec;

    struct Open;
    impl Visibility for Open {
        fn sees(&self, _: Vec3, _: Vec3) -> bool {
            true
        }
    }

    /// Unit square at height `z`, facing down.
    fn ceiling(z: f32) -> Polygon {
        let corners = [(0.0, 0.0), (0.0, 1.0), (1.0, 1.0), (1.0, 0.0)];
        Polygon::new(&corners.map(|(x, y)| Vec3::new(x, y, z))).unwrap()
    }

    fn floor() -> Polygon {
        ceiling(0.0).flipped()
    }

    #[test]
    fn a_point_under_the_corner_of_a_square_agrees_with_the_closed_form() {
        // Howell C-11 with unit sides at distance 1: 1/(2 pi) * 2 * (1/sqrt 2) atan(1/sqrt 2).
        let expected = 2.0_f32.sqrt().recip() * 2.0_f32.sqrt().recip().atan() / PI;
        let found = point_to_polygon(Vec3::ZERO, Vec3::Z, ceiling(1.0).vertices());
        assert!((found - expected).abs() < 1e-6, "{found} {expected}");
    }

    #[test]
    fn half_a_wall_under_the_horizon_does_not_count() {
        let wall = |low: f32| {
            [(-1.0, low), (-1.0, 1.0), (1.0, 1.0), (1.0, low)].map(|(y, z)| Vec3::new(1.0, y, z))
        };
        let whole = point_to_polygon(Vec3::ZERO, Vec3::Z, &wall(-1.0));
        let above = point_to_polygon(Vec3::ZERO, Vec3::Z, &wall(0.0));
        assert!(
            (whole - above).abs() < 1e-6 && above > 0.1,
            "{whole} {above}"
        );
    }

    #[test]
    fn unit_squares_agree_with_the_closed_form() {
        // Unit squares at distance 1: 0.19982490 (Howell C-11). 2 x 2 points: 7e-3 (notes).
        let found = Shooter::new(ceiling(1.0)).form_factor(&floor(), &Open);
        assert!((found / 0.199_824_9 - 1.0).abs() < 8e-3, "{found}");
        let far = Shooter::new(ceiling(5.0)).form_factor(&floor(), &Open);
        assert!((far / 0.012_385_2 - 1.0).abs() < 2e-3, "{far}");
    }

    #[test]
    fn coplanar_back_facing_and_touching_pairs_are_finite_and_bounded() {
        let pairs = [
            (floor(), floor().flipped(), 0.0, 0.0),
            (ceiling(1.0), floor().flipped(), 0.0, 0.0),
            (ceiling(1.0).flipped(), floor(), 0.0, 0.0),
            (ceiling(1e-6), floor(), 0.9, 1.0),
            (ceiling(0.0), floor(), 0.0, 1.0),
        ];
        for (shooter, receiver, low, high) in pairs {
            let factor = Shooter::new(shooter).form_factor(&receiver, &Open);
            assert!(
                (low..=high).contains(&factor),
                "{shooter:?} {receiver:?} {factor}"
            );
        }
    }

    #[test]
    fn rounding_does_not_lift_a_factor_above_one() {
        let receiver = Polygon::new(&[
            Vec3::new(0.144_529_52, 0.057_797_61, 0.0),
            Vec3::new(0.952_816_96, 0.193_776_25, 0.0),
            Vec3::new(0.758_483_4, 0.048_062_027, 0.0),
        ]);
        let receiver = receiver.map_or_else(|_| floor(), |polygon| polygon.flipped());
        let wide = [(-3.0, -3.0), (-3.0, 4.0), (4.0, 4.0), (4.0, -3.0)];
        let wide = wide.map(|(x, y)| Vec3::new(x, y, 1.207_142_4e-4));
        let shooter = Shooter::new(Polygon::new(&wide).unwrap());
        for receiver in [receiver, receiver.flipped(), floor()] {
            let factor = shooter.form_factor(&receiver, &Open);
            assert!((0.0..=1.0).contains(&factor), "{factor}");
        }
    }

    #[test]
    fn a_receiver_inside_a_box_sees_one_whole() {
        let faces: Vec<Polygon> = [Vec3::X, Vec3::Y, Vec3::Z]
            .into_iter()
            .flat_map(|axis| [axis, -axis])
            .map(|out| {
                let (u, v) = out.any_orthonormal_pair();
                let corners = [out - u - v, out + u - v, out + u + v, out - u + v];
                let wall = Polygon::new(&corners).unwrap();
                if wall.normal().dot(out) > 0.0 {
                    wall.flipped()
                } else {
                    wall
                }
            })
            .collect();
        let receiver = faces[0].part(Vec2::ZERO, Vec2::new(0.1, 0.7));
        let sum: f32 = faces[1..]
            .iter()
            .map(|face| Shooter::new(*face).form_factor(&receiver, &Open))
            .sum();
        assert!((sum - 1.0).abs() < 1e-5, "{sum}");
    }

    /// A parallelogram anywhere, of any size and slenderness.
    fn parallelogram() -> impl Strategy<Value = Polygon> {
        let coordinate = || prop_oneof![-1.0_f32..1.0, Just(0.0), Just(1.0), -1e-5_f32..1e-5];
        let vector = || [coordinate(), coordinate(), coordinate()].prop_map(Vec3::from_array);
        let slenderness = prop_oneof![Just(1.0_f32), 1e-4_f32..1.0];
        (vector(), vector(), vector(), slenderness).prop_filter_map(
            "no area",
            |(origin, u, v, slenderness)| {
                let v = v * slenderness;
                Polygon::new(&[origin, origin + u, origin + u + v, origin + v]).ok()
            },
        )
    }

    proptest! {
        #[test]
        fn any_pair_has_a_finite_factor_between_zero_and_one(
            shooter in parallelogram(),
            receiver in parallelogram(),
            scale in prop_oneof![Just(1.0_f32), Just(1e-6), Just(1e6)],
        ) {
            let scaled = |p: &Polygon| {
                let vertices: Vec<Vec3> = p.vertices().iter().map(|v| *v * scale).collect();
                Polygon::new(&vertices)
            };
            prop_assume!(scaled(&shooter).is_ok() && scaled(&receiver).is_ok());
            let shooter = Shooter::new(scaled(&shooter).unwrap());
            let factor = shooter.form_factor(&scaled(&receiver).unwrap(), &Open);
            prop_assert!((0.0..=1.0).contains(&factor), "{factor}");
        }

        #[test]
        fn blockers_never_add_light(
            shooter in parallelogram(),
            receiver in parallelogram(),
            blocker in parallelogram(),
        ) {
            let shooter = Shooter::new(shooter);
            let open = shooter.form_factor(&receiver, &Open);
            let surface = Surface::new(0, blocker.vertices(), Rgb::BLACK).unwrap();
            let blocked = shooter.form_factor(&receiver, &Occluders(&[surface]));
            prop_assert!(blocked <= open * 1.000_001, "{blocked} {open}");
        }

        #[test]
        fn scale_does_not_change_a_factor(shooter in parallelogram(), receiver in parallelogram()) {
            let doubled = |p: &Polygon| {
                let vertices: Vec<Vec3> = p.vertices().iter().map(|v| *v * 1024.0).collect();
                Polygon::new(&vertices).unwrap()
            };
            let small = Shooter::new(shooter).form_factor(&receiver, &Open);
            let large = Shooter::new(doubled(&shooter)).form_factor(&doubled(&receiver), &Open);
            // Powers of two are exact, but for what rounds at the planes' tolerances.
            prop_assert!((small - large).abs() <= 1e-5, "{small} {large}");
        }
    }
}
