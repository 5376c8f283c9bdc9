extern crate std;
use core::f32::consts::PI;

use super::*;
use crate::color::Rgb;
use crate::scene::Surface;
use crate::visibility::{Body, Obstacle, Occluders, OccludersAndBodies, Shaft, bodies};
use proptest::prelude::*;
use std::vec::Vec;

struct Open;
impl Visibility for Open {
    fn sees(&self, _: Vec3, _: Vec3) -> bool {
        true
    }

    fn between<'v>(&'v self, _: &Shaft, _: &mut impl FnMut(Obstacle<'v>)) {}
}

fn estimated(shooter: &Shooter, receiver: &Polygon, visibility: &impl Visibility) -> f32 {
    let view = shooter.seen_by(receiver, visibility);
    view.estimate(&Receiver::new(*receiver), visibility)
}

/// A box with a corner at `low` and edges along two turned axes and upwards, its faces outwards.
fn block(low: Vec3, turn: f32, size: Vec3) -> Vec<Surface> {
    let (sine, cosine) = (libm::sinf(turn), libm::cosf(turn));
    let axes = [
        Vec3::new(cosine, sine, 0.0) * size.x,
        Vec3::new(-sine, cosine, 0.0) * size.y,
        Vec3::Z * size.z,
    ];
    let corner = |n: usize| {
        let along = (0..3).map(|axis| axes[axis] * f32::from(u8::from(n >> axis & 1 == 1)));
        low + along.sum::<Vec3>()
    };
    let faces = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let faces = faces.map(|face| face.map(corner));
    faces
        .iter()
        .map(|face| Surface::new(0, face, Rgb::BLACK).unwrap())
        .collect()
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
        // Cut pieces round by themselves.
            prop_assert!(blocked <= open * 1.000_01 + 1e-6, "{blocked} {open}");
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

#[test]
fn an_estimate_is_the_factor_where_nothing_stands_between() {
    let receiver = floor().part(Vec2::ZERO, Vec2::splat(0.25));
    for height in [1e-3, 0.1, 0.5, 1.0, 3.0, 30.0] {
        let shooter = Shooter::new(ceiling(height));
        let exact = shooter.form_factor(&receiver, &Open);
        let found = estimated(&shooter, &receiver, &Open);
        // Near, it is the same average; far, the middle stands for it, within 1 % (`NEAR`).
        assert!(
            (found / exact - 1.0).abs() < 0.01,
            "{height}: {found} {exact}"
        );
    }
}

#[test]
fn four_segments_see_half_a_blocker_as_a_half_and_a_whole_one_as_nothing() {
    let receiver = floor().part(Vec2::ZERO, Vec2::splat(0.25));
    let shooter = Shooter::new(ceiling(3.0));
    let open = estimated(&shooter, &receiver, &Open);
    let estimate = |share: f32| {
        // Just below the shooter, over this share of its width.
        let plate = [(-1.0, -1.0), (-1.0, 2.0), (share, 2.0), (share, -1.0)];
        let plate = plate.map(|(x, y)| Vec3::new(x, y, 2.999));
        let plate = Surface::new(0, &plate, Rgb::BLACK).unwrap();
        estimated(&shooter, &receiver, &Occluders(&[plate])) / open
    };
    assert!(estimate(2.0).abs() < 1e-6);
    // Two of four points of the patch, whose distances to the receiver differ by a few per cent.
    assert!((estimate(0.5) - 0.5).abs() < 0.05, "{}", estimate(0.5));
}

proptest! {
    #[test]
    fn any_pair_has_an_estimate_between_zero_and_the_open_factor(
        shooter in parallelogram(),
        receiver in parallelogram(),
        blocker in parallelogram(),
    ) {
        let shooter = Shooter::new(shooter);
        let surface = Surface::new(0, blocker.vertices(), Rgb::BLACK).unwrap();
        let blocked = estimated(&shooter, &receiver, &Occluders(&[surface]));
        prop_assert!((0.0..=1.0).contains(&blocked), "{blocked}");
        // Both average the same points wherever something may block.
        let open = shooter.form_factor(&receiver, &Open).max(estimated(&shooter, &receiver, &Open));
        prop_assert!(blocked <= open * 1.000_01 + 1e-6, "{blocked} {open}");
    }
}

proptest! {
    #[test]
    fn a_body_hides_what_its_faces_hide(
        (x, y, z) in (-0.2_f32..0.8, -0.2_f32..0.8, 0.01_f32..0.6),
        (a, b, c) in (0.05_f32..0.6, 0.05_f32..0.6, 0.02_f32..0.6),
        turn in -1.5_f32..1.5,
    ) {
        let surfaces = block(Vec3::new(x, y, z), turn, Vec3::new(a, b, c));
        let found: Vec<Body> = bodies(&surfaces).collect();
        prop_assert_eq!(found.len(), 1);
        let (receiver, shooter) = (floor(), Shooter::new(ceiling(1.0)));
        let together = OccludersAndBodies { surfaces: &surfaces, bodies: &found };
        let alone = shooter.form_factor(&receiver, &Occluders(&surfaces));
        let together = shooter.form_factor(&receiver, &together);
        // Slivers between the shadows of faces that share an edge.
        prop_assert!((alone - together).abs() < 1e-5, "{} {}", alone, together);
    }
}
