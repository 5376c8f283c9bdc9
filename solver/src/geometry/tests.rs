extern crate std;
use super::*;
use glam::Vec2;

const SQUARE: [Vec3; 4] = [
    Vec3::new(0.0, 0.0, 0.0),
    Vec3::new(1.0, 0.0, 0.0),
    Vec3::new(1.0, 1.0, 0.0),
    Vec3::new(0.0, 1.0, 0.0),
];

#[test]
fn area_normal_and_center_of_a_square() {
    let square = Polygon::new(&SQUARE).unwrap();
    assert_eq!(square.area(), 1.0);
    assert_eq!(square.normal(), Vec3::Z);
    assert_eq!(square.center(), Vec3::new(0.5, 0.5, 0.0));
    assert_eq!(square.flipped().normal(), -Vec3::Z);
    assert_eq!(
        Polygon::new(square.flipped().vertices()).unwrap().normal(),
        -Vec3::Z
    );
}

#[test]
fn every_illegal_polygon_has_its_own_error() {
    let [a, b, c, d] = SQUARE;
    let cases: [(&[Vec3], PolygonError); 8] = [
        (&[a, b], PolygonError::VertexCount),
        (&[a, b, c, d, a], PolygonError::VertexCount),
        (&[a, b, Vec3::splat(f32::NAN)], PolygonError::NotFinite),
        (&[a, b, Vec3::splat(1e30)], PolygonError::NotFinite),
        (&[a, b, b], PolygonError::ZeroArea),
        (&[a, b, c, d + Vec3::Z * 0.01], PolygonError::NonPlanar),
        (&[a, b, Vec3::new(0.1, 0.1, 0.0), d], PolygonError::Concave),
        (&[a, c, b, d], PolygonError::ZeroArea),
    ];
    for (vertices, error) in cases {
        assert_eq!(Polygon::new(vertices), Err(error), "{vertices:?}");
    }
}

#[test]
fn a_polygon_of_any_scale_and_place_is_legal() {
    for scale in [1e-6_f32, 1e-3, 1.0, 1e3, 1e6] {
        for offset in [0.0, 100.0] {
            let moved = SQUARE.map(|v| (v + Vec3::splat(offset)) * scale);
            let polygon = Polygon::new(&moved).unwrap();
            let expected = scale * scale;
            assert!(
                (polygon.area() / expected - 1.0).abs() < 1e-4,
                "{scale} {offset}"
            );
        }
    }
}

#[test]
fn parts_tile_the_whole() {
    let skewed = [
        Vec3::ZERO,
        Vec3::new(2.0, 0.1, 0.0),
        Vec3::new(1.7, 1.2, 0.0),
        Vec3::new(-0.3, 0.9, 0.0),
    ];
    let quad = Polygon::new(&skewed).unwrap();
    let mut sum = 0.0;
    for i in 0..4 {
        for j in 0..3 {
            let from = Vec2::new(i as f32 / 4.0, j as f32 / 3.0);
            sum += quad.part(from, from + Vec2::new(0.25, 1.0 / 3.0)).area();
        }
    }
    assert!((sum - quad.area()).abs() < 1e-5, "{sum} {}", quad.area());

    let triangle = Polygon::new(&skewed[..3]).unwrap();
    let up = triangle.part(Vec2::ZERO, Vec2::splat(0.5)).area();
    let down = triangle.part(Vec2::splat(0.5), Vec2::ZERO).area();
    assert!((3.0 * up + down - triangle.area()).abs() < 1e-6);
}

#[test]
fn parameters_invert_the_map() {
    let quad = Polygon::new(&[
        Vec3::ZERO,
        Vec3::new(2.0, 0.1, 0.0),
        Vec3::new(1.4, 1.2, 0.0),
        Vec3::new(0.3, 0.9, 0.0),
    ])
    .unwrap();
    for at in [
        Vec2::new(0.1, 0.9),
        Vec2::new(0.5, 0.5),
        Vec2::new(1.0, 0.0),
    ] {
        let back = quad.parameters(quad.point(at));
        assert!((back - at).length() < 1e-5, "{at} {back}");
    }
}

#[test]
fn crossing_ignores_ends_in_the_plane_and_closes_edges() {
    let square = Polygon::new(&SQUARE).unwrap();
    let above = Vec3::new(0.5, 0.5, 1.0);
    let inside = Vec3::new(0.5, 0.5, 0.0);
    assert_eq!(square.crossing(above, inside), None);
    assert_eq!(square.crossing(inside, above), None);
    assert_eq!(square.crossing(above, Vec3::new(0.5, 0.5, -1.0)), Some(0.5));
    assert_eq!(square.crossing(above, Vec3::new(3.0, 0.5, -1.0)), None);

    // Straight through the common edge of two squares: one of them stops it.
    let neighbour = Polygon::new(&SQUARE.map(|v| v + Vec3::X)).unwrap();
    let (from, to) = (Vec3::new(0.7, 0.3, 0.4), Vec3::new(1.3, 0.3, -0.4));
    assert!(square.crossing(from, to).is_some() || neighbour.crossing(from, to).is_some());
}

#[test]
fn clipping_keeps_the_front_part() {
    let clipped = clip(&SQUARE, |v| v.x - 0.25);
    let area = vector_area(&clipped).length();
    assert!((area - 0.75).abs() < 1e-6);
    assert!(clip(&SQUARE, |v| v.x - 2.0).is_empty());
}

#[test]
fn gauss_weights_sum_to_one() {
    for vertices in [&SQUARE[..], &SQUARE[..3]] {
        let polygon = Polygon::new(vertices).unwrap();
        let total: f32 = gauss_points(&polygon).iter().map(|p| p.weight).sum();
        assert!((total - 1.0).abs() < 1e-6);
    }
}
