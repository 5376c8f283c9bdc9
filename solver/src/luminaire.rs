//! Direct irradiance of point, spot, sun and sky at an element.
//!
//! Point and spot: `E = I(a) cos b / r^2`, intensity `I` in W/sr, 1 on the axis at unit emission.
//! Sun: `E = cos b` averaged over the directions of its disc, 1 on a surface that faces it. Sky: `E = 1/pi` times the cosine-weighted solid angle
//! that escapes, estimated by 64 stratified directions for each receiver point. All are averaged
//! over the Gauss points of the element and multiplied by visibility; the directions of an element's
//! points interleave, so that its average is stratified more finely than any of them.
//!
//! Spot falloff: KHR_lights_punctual (Khronos 2018, "Inner and Outer Cone Angles"), or linear.

use core::f32::consts::TAU;

use glam::{Vec2, Vec3};

use crate::geometry::{Polygon, gauss_points};
use crate::math;
use crate::mesh::Mesh;
use crate::scene::{Falloff, Luminaire, Scene, Source};
use crate::visibility::Visibility;

/// Strata along each side of the sky's square of directions.
const SKY_STRATA: u32 = 8;
/// Strata along each side of the sun's disc.
const SUN_STRATA: u32 = 2;

/// Irradiance of one receiver at unit emission, averaged over its area, W/m2.
///
/// `far` is a distance at which every surface has been passed, in m.
#[must_use]
pub fn irradiance(
    source: &Source,
    receiver: &Polygon,
    far: f32,
    visibility: &impl Visibility,
) -> f32 {
    let points = gauss_points(receiver);
    points
        .iter()
        .zip(0..)
        .map(|(point, index)| {
            let at = Receiver {
                position: point.position,
                normal: receiver.normal(),
                offset: offset(index, points.len() as u32),
            };
            point.weight * at.irradiance(source, far, visibility)
        })
        .sum()
}

/// Irradiance at a point with a unit normal at unit emission, W/m2.
///
/// `far` is a distance at which every surface has been passed, in m; sun and sky are looked at along
/// `sets` interleaved sets of directions.
#[must_use]
pub fn at_point(
    source: &Source,
    position: Vec3,
    normal: Vec3,
    far: f32,
    sets: u32,
    visibility: &impl Visibility,
) -> f32 {
    let sets = match source {
        Source::Point { .. } | Source::Spot { .. } => 1,
        Source::Sun { .. } | Source::Sky => sets.max(1),
    };
    let of_set = |index| {
        let receiver = Receiver {
            position,
            normal,
            offset: offset(index, sets),
        };
        receiver.irradiance(source, far, visibility)
    };
    (0..sets).map(of_set).sum::<f32>() / sets as f32
}

/// A point that receives, and where its directions lie in their strata.
struct Receiver {
    position: Vec3,
    normal: Vec3,
    offset: Vec2,
}

/// Where point `index` of `count` puts its directions in every stratum, in (0, 1): its own place
/// in radius and its own in angle, paired so that near ones in radius are far apart in angle.
fn offset(index: u32, count: u32) -> Vec2 {
    let place = |k: u32| (k as f32 + 0.5) / count as f32;
    // Steps of two around an odd number of places reach all of them.
    let partner = (2 * index + 1) % (count | 1);
    Vec2::new(place(partner), place(index))
}

impl Receiver {
    fn irradiance(&self, source: &Source, far: f32, visibility: &impl Visibility) -> f32 {
        match *source {
            Source::Point { position } => self.point_light(position, visibility),
            Source::Spot {
                position,
                direction,
                inner,
                outer,
                falloff,
            } => {
                let Some(towards) = (self.position - position).try_normalize() else {
                    return 0.0;
                };
                let angle = math::safe_acos(towards.dot(direction));
                let intensity = spot_intensity(angle, inner, outer, falloff);
                if intensity <= 0.0 {
                    return 0.0;
                }
                intensity * self.point_light(position, visibility)
            }
            Source::Sun { direction, angle } => self.sunlight(direction, angle, far, visibility),
            Source::Sky => self.skylight(far, visibility),
        }
    }

    /// `cos b / r^2`; 0 at the light's own place, where it has no meaning.
    fn point_light(&self, position: Vec3, visibility: &impl Visibility) -> f32 {
        let ray = position - self.position;
        let square = ray.length_squared();
        let cosine = ray.dot(self.normal) / math::safe_sqrt(square);
        let irradiance = cosine / square;
        if cosine > 0.0 && irradiance.is_finite() && visibility.sees(self.position, position) {
            irradiance
        } else {
            0.0
        }
    }

    fn sunlight(&self, direction: Vec3, angle: f32, far: f32, visibility: &impl Visibility) -> f32 {
        let towards = -direction;
        if angle <= 0.0 {
            return self.escaping(towards, far, visibility) * towards.dot(self.normal).max(0.0);
        }
        // Even over the cap of directions; on a surface that faces it their mean cosine is
        // (1 + cos(angle / 2)) / 2, which unit emission makes one.
        let (u, v) = towards.any_orthonormal_pair();
        let edge = math::cos(angle / 2.0);
        let count = (SUN_STRATA * SUN_STRATA) as f32;
        let sum: f32 = strata(SUN_STRATA, self.offset)
            .map(|(x, y)| {
                let share = x * x + y * y;
                let along = 1.0 - share * (1.0 - edge);
                let stretch = math::safe_sqrt((1.0 - along * along) / share);
                let ray = towards * along + (u * x + v * y) * stretch;
                self.escaping(ray, far, visibility) * ray.dot(self.normal).max(0.0)
            })
            .sum();
        sum / count * 2.0 / (1.0 + edge)
    }

    fn skylight(&self, far: f32, visibility: &impl Visibility) -> f32 {
        let (u, v) = self.normal.any_orthonormal_pair();
        let count = (SKY_STRATA * SKY_STRATA) as f32;
        strata(SKY_STRATA, self.offset)
            .map(|(x, y)| {
                // Malley's method: the disc lifted to the hemisphere is cosine-weighted.
                let height = math::safe_sqrt(1.0 - x * x - y * y);
                let ray = u * x + v * y + self.normal * height;
                self.escaping(ray, far, visibility) / count
            })
            .sum()
    }

    /// 1 when nothing stands in this direction and it is above the horizon, else 0.
    fn escaping(&self, ray: Vec3, far: f32, visibility: &impl Visibility) -> f32 {
        let above = ray.dot(self.normal) > 0.0;
        let open = above && visibility.sees(self.position, self.position + ray * far);
        f32::from(u8::from(open))
    }
}

/// A point in each equal-area cell of the unit disc: `side` rings of `side` cells, with `offset`
/// the place in every cell, as shares of its way outwards and around.
///
/// Any line through the centre halves every ring, so a horizontal or vertical horizon is met
/// exactly. Rings are turned against each other by the golden ratio: a horizon along the edges of
/// the cells of one ring then lies inside those of the others.
fn strata(side: u32, offset: Vec2) -> impl Iterator<Item = (f32, f32)> {
    /// (sqrt 5 - 1) / 2
    const TURN: f32 = 0.618_034;
    let share = move |cell: f32| cell / side as f32;
    (0..side).flat_map(move |i| {
        (0..side).map(move |j| {
            let radius = math::safe_sqrt(share(i as f32 + offset.x));
            let angle = TAU * share(j as f32 + offset.y + TURN * i as f32);
            (radius * math::cos(angle), radius * math::sin(angle))
        })
    })
}

/// Intensity at `angle` from the axis, in [0, 1].
fn spot_intensity(angle: f32, inner: f32, outer: f32, falloff: Falloff) -> f32 {
    if angle >= outer {
        return 0.0;
    }
    if angle <= inner {
        return 1.0;
    }
    match falloff {
        Falloff::Linear => (outer - angle) / (outer - inner),
        Falloff::Smooth => {
            let edge = math::cos(outer);
            let course = (math::cos(angle) - edge) / (math::cos(inner) - edge);
            let course = course.clamp(0.0, 1.0);
            course * course
        }
    }
}

/// Distance at which every surface of the scene has been passed from any point on one, in m.
#[must_use]
pub fn far(scene: &Scene) -> f32 {
    2.0 * scene.diagonal()
}

/// True when no light escapes: none of 64 rays from the middle of any patch that has elements goes on for ever.
///
/// `far` as for [`irradiance`]. A gap is overlooked when it fills much less than a ray of any middle's view.
#[must_use]
pub fn is_closed(mesh: &Mesh, far: f32, visibility: &impl Visibility) -> bool {
    let patches = (0..mesh.patches.len() as u32).filter(|patch| mesh.receives(*patch));
    let mut polygons = patches.filter_map(|patch| mesh.patch_polygon(patch));
    polygons.all(|polygon| {
        let (middle, normal) = (polygon.center(), polygon.normal());
        at_point(&Source::Sky, middle, normal, far, 1, visibility) <= 0.0
    })
}

/// Fills `row[j]` with the direct irradiance of element `first + j`, W/m2 at unit emission.
///
/// The luminaire's share is not applied. Elements beyond the mesh get 0.
pub fn fill(
    mesh: &Mesh,
    luminaire: &Luminaire,
    far: f32,
    first: u32,
    visibility: &impl Visibility,
    row: &mut [f32],
) {
    let elements = mesh.elements.get(first as usize..).unwrap_or_default();
    row.fill(0.0);
    for (value, element) in row.iter_mut().zip(elements) {
        if let Some(receiver) = mesh.element_polygon(element) {
            *value = irradiance(luminaire.source(), &receiver, far, visibility);
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use crate::color::Rgb;
    use crate::scene::Surface;
    use crate::visibility::Occluders;
    use glam::Quat;
    use std::vec::Vec;

    fn square(size: f32, z: f32) -> [Vec3; 4] {
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
            .map(|(x, y)| Vec3::new(x * size, y * size, z))
    }

    fn receiver() -> Polygon {
        Polygon::new(&square(0.01, 0.0)).unwrap()
    }

    fn at_origin(source: &Source, blockers: &[Surface]) -> f32 {
        irradiance(source, &receiver(), 100.0, &Occluders(blockers))
    }

    #[test]
    fn a_point_light_follows_the_inverse_square() {
        for height in [0.5_f32, 1.0, 4.0] {
            let source = Source::Point {
                position: Vec3::Z * height,
            };
            let found = at_origin(&source, &[]);
            assert!(
                (found * height * height - 1.0).abs() < 1e-3,
                "{height} {found}"
            );
        }
        let behind = Source::Point { position: -Vec3::Z };
        assert_eq!(at_origin(&behind, &[]), 0.0);
        let touching = Source::Point {
            position: Vec3::ZERO,
        };
        assert_eq!(at_origin(&touching, &[]), 0.0);
    }

    #[test]
    fn spot_courses_start_at_one_and_end_at_zero() {
        for falloff in [Falloff::Smooth, Falloff::Linear] {
            let course: Vec<f32> = (0..=10)
                .map(|i| spot_intensity(0.2 + 0.03 * i as f32, 0.2, 0.5, falloff))
                .collect();
            assert_eq!((course[0], course[10]), (1.0, 0.0), "{falloff:?}");
            assert!(course.is_sorted_by(|a, b| a > b), "{falloff:?} {course:?}");
        }
        assert!((spot_intensity(0.35, 0.2, 0.5, Falloff::Linear) - 0.5).abs() < 1e-6);
        assert_eq!(spot_intensity(0.3, 0.3, 0.3, Falloff::Smooth), 0.0);
    }

    #[test]
    fn sun_and_sky_give_one_to_a_surface_that_faces_them() {
        for angle in [0.0, 0.0093, 0.5, 1.0, 3.0] {
            let sun = Source::Sun {
                direction: -Vec3::Z,
                angle,
            };
            assert!((at_origin(&sun, &[]) - 1.0).abs() < 1e-4);
        }
        assert!((at_origin(&Source::Sky, &[]) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn a_plate_overhead_shades_the_sky_by_its_form_factor() {
        let plate = Surface::new(0, &square(1.0, 1.0), Rgb::BLACK).unwrap();
        // Four corner factors of a 1 x 1 square at distance 1 (Howell C-11): 0.5541.
        let open = at_origin(&Source::Sky, &[plate]);
        assert!((open - (1.0 - 0.5541)).abs() < 0.02, "{open}");
    }
    /// The sky over a black ground that ends at the horizon: `E = (1 + cos tilt) / 2`.
    #[test]
    fn tilted_planes_see_their_share_of_the_sky() {
        let ground = Surface::new(0, &square(1e5, 0.0), Rgb::BLACK).unwrap();
        let mut squares = [0.0, 0.0];
        let angles = || (0..24).map(|step| 15.0 * step as f32);
        for (tilt, azimuth) in angles()
            .take(7)
            .flat_map(|tilt| angles().map(move |azimuth| (tilt, azimuth)))
        {
            let turned = |point: Vec3| {
                let tilted = Quat::from_rotation_x(f32::to_radians(tilt)) * point;
                Quat::from_rotation_z(f32::to_radians(azimuth)) * tilted + Vec3::Z
            };
            let outline = square(0.01, 0.0).map(turned);
            let expected = (1.0 + f32::cos(tilt.to_radians())) / 2.0;
            for (corners, square) in [3, 4].into_iter().zip(&mut squares) {
                let plane = Polygon::new(&outline[..corners]).unwrap();
                let found = irradiance(&Source::Sky, &plane, 1e4, &Occluders(&[ground]));
                let error = (found - expected).abs();
                // Along the axes, horizontal and vertical planes are exact by symmetry.
                let is_exact = tilt % 90.0 == 0.0 && azimuth % 90.0 == 0.0;
                let bound = if is_exact { 1e-6 } else { 0.01 };
                assert!(
                    error < bound,
                    "{corners} corners, tilt {tilt}, azimuth {azimuth}: {found} is not {expected}"
                );
                *square += error * error / (7.0 * 24.0);
            }
        }
        // The points of an element interleave: the same 64 directions at each err twice as much.
        let rms = squares.map(f32::sqrt);
        assert!(rms.iter().all(|rms| *rms < 0.005), "{rms:?}");
    }

    /// A blade over part of the disc leaves the segment beyond its edge, of the share
    /// `(acos c - c sqrt(1 - c^2)) / pi` with the edge at `c` radii from the middle.
    #[test]
    fn a_blade_uncovers_the_sun_steadily() {
        const RADIUS: f32 = 0.05;
        let sun = Source::Sun {
            direction: -Vec3::Z,
            angle: 2.0 * RADIUS,
        };
        for turn in (0..8).map(|step| 0.1 + 0.785 * step as f32) {
            for c in (-4..=4).map(|step| 0.22 * step as f32) {
                let blade = square(10.0, 1.0).map(|corner| {
                    let shifted = corner + Vec3::X * (c * f32::tan(RADIUS) - 10.0);
                    Quat::from_rotation_z(turn) * shifted
                });
                let blade = Surface::new(0, &blade, Rgb::BLACK).unwrap();
                let outline = square(1e-5, 0.0);
                let receiver = Polygon::new(&outline).unwrap();
                let found = irradiance(&sun, &receiver, 100.0, &Occluders(&[blade]));
                let expected = (c.acos() - c * (1.0 - c * c).sqrt()) / core::f32::consts::PI;
                // 16 directions, at most two of them on the wrong side.
                let error = (found - expected).abs();
                assert!(
                    error < 2.0 / 16.0,
                    "turn {turn}, edge at {c}: {found} is not {expected}"
                );
            }
        }
    }
}
