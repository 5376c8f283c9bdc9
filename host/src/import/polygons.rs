//! Makes the polygons of a file legal: convex, planar, of three or four vertices, each place once.
//!
//! 1. Vertices that repeat their predecessor are dropped.
//! 2. Polygons that the solver takes stay as they are, vertex for vertex. Larger, warped and
//!    concave ones are cut into triangles by ear clipping in the plane of their Newell normal:
//!    an ear is a corner that turns left and whose triangle holds no other vertex (Meisters 1975),
//!    and the one with the largest area for its longest edge is cut first.
//!    Faces without area are dropped.
//! 3. Of faces in the same place (same vertices, bit for bit) one stays: the one that emits, else
//!    the first. Faces that look in opposite directions count as the same only if both reflect on
//!    both sides, and not if both emit.
//! 4. Triangles that were cut from quads are put together again, see [`super::pairs`], and the
//!    result is searched for duplicates once more.
//!
//! The order is that of the file throughout.

use std::collections::HashMap;

use glam::{DVec3, Vec3};
use relume::geometry::{MAX_VERTICES, Polygon, PolygonError};

use super::draft::{Material, Outline};
use super::pairs;
use super::repairs::Repairs;

/// Most vertices of one polygon: ear clipping takes the square of it, the cube at worst.
pub(super) const MOST_CORNERS: usize = 4096;

/// How far the area of the triangles may lie off the outline's before that is counted.
const UNFILLED: f64 = 1e-4;

/// A polygon that the solver takes.
#[derive(Clone, Debug)]
pub(super) struct Piece {
    pub outline: Outline,
    pub polygon: Polygon,
}

/// A vertex as something that can be compared and looked up; the two zeros are one.
pub(super) type Key = [u32; 3];

pub(super) fn key(vertex: Vec3) -> Key {
    (vertex + Vec3::ZERO).to_array().map(f32::to_bits)
}

/// Legal polygons in place of the file's.
///
/// # Errors
/// A line about coordinates that are too large for areas to be computed.
pub(super) fn legalize(
    outlines: Vec<Outline>,
    materials: &[Material],
    repairs: &mut Repairs,
) -> Result<Vec<Outline>, String> {
    let mut pieces = Vec::with_capacity(outlines.len());
    for (outline, number) in outlines.into_iter().zip(1..) {
        cut(outline, &mut pieces, repairs).map_err(|TooLarge| {
            format!(
                "polygon {number} has coordinates so large that its area overflows; use a larger \
                 unit of length"
            )
        })?;
    }
    drop_duplicates(&mut pieces, materials, repairs);
    let recovered_before = repairs.recovered_quads;
    let mut pieces = pairs::recover_quads(pieces, repairs);
    if repairs.recovered_quads > recovered_before {
        drop_duplicates(&mut pieces, materials, repairs);
    }
    Ok(pieces.into_iter().map(|piece| piece.outline).collect())
}

/// Coordinates whose squares are no numbers any more.
struct TooLarge;

/// Adds the outline as it is, or its triangles.
fn cut(
    mut outline: Outline,
    pieces: &mut Vec<Piece>,
    repairs: &mut Repairs,
) -> Result<(), TooLarge> {
    if drop_repeated_vertices(&mut outline) {
        repairs.repeated_vertices += 1;
    }
    let fault = match Polygon::new(&outline.vertices) {
        Ok(polygon) => {
            pieces.push(Piece { outline, polygon });
            return Ok(());
        }
        Err(fault) => fault,
    };
    if fault == PolygonError::NotFinite {
        return Err(TooLarge);
    }

    let first = pieces.len();
    let triangles = ears(&outline.vertices);
    pieces.extend(
        triangles
            .iter()
            .filter_map(|triangle| corner_piece(&outline, *triangle)),
    );
    let area: f64 = pieces
        .iter()
        .skip(first)
        .map(|piece| f64::from(piece.polygon.area()))
        .sum();
    if area == 0.0 {
        repairs.degenerate_faces += 1;
        return Ok(());
    }
    match fault {
        PolygonError::NonPlanar => repairs.warped_quads += 1,
        PolygonError::Concave => repairs.concave_quads += 1,
        _ => repairs.large_polygons += 1,
    }
    let whole = newell(&doubles(&outline.vertices)).length();
    if fault != PolygonError::NonPlanar && (area - whole).abs() > UNFILLED * whole {
        repairs.crossed_outlines += 1;
    }
    Ok(())
}

/// True when there were any.
fn drop_repeated_vertices(outline: &mut Outline) -> bool {
    let vertices = &outline.vertices;
    let previous = vertices
        .iter()
        .cycle()
        .skip(vertices.len().saturating_sub(1));
    let is_new = vertices
        .iter()
        .zip(previous)
        .map(|(vertex, previous)| vertex != previous);
    if is_new.clone().all(|is_new| is_new) {
        return false;
    }
    let keep: Vec<bool> = is_new.collect();
    let mut kept = keep.iter().copied();
    outline.vertices.retain(|_| kept.next().unwrap_or(true));
    let mut kept = keep.iter().copied();
    outline.uv.retain(|_| kept.next().unwrap_or(true));
    true
}

/// A triangle of the outline's vertices; `None` when it has no area.
fn corner_piece(outline: &Outline, triangle: [usize; 3]) -> Option<Piece> {
    let vertices: Vec<Vec3> = triangle
        .iter()
        .filter_map(|i| outline.vertices.get(*i).copied())
        .collect();
    Some(Piece {
        polygon: Polygon::new(&vertices).ok()?,
        outline: Outline {
            material: outline.material,
            vertices,
            uv: triangle
                .iter()
                .filter_map(|i| outline.uv.get(*i).copied())
                .collect(),
        },
    })
}

fn doubles(vertices: &[Vec3]) -> Vec<DVec3> {
    vertices.iter().map(|vertex| vertex.as_dvec3()).collect()
}

/// `1/2 sum_i (v_i - v_0) x (v_i+1 - v_0)`: the normal, as long as the area.
fn newell(points: &[DVec3]) -> DVec3 {
    let Some((origin, rest)) = points.split_first() else {
        return DVec3::ZERO;
    };
    let fan = rest.iter().zip(rest.iter().skip(1));
    fan.map(|(b, c)| (*b - *origin).cross(*c - *origin) * 0.5)
        .sum()
}

/// Cuts a polygon into triangles of its vertices' numbers, wound as the polygon is.
///
/// Holes that are joined to the outside by a double edge are fine; what is left of an outline that
/// crosses itself when no ear is found is given up.
fn ears(vertices: &[Vec3]) -> Vec<[usize; 3]> {
    let points = doubles(vertices);
    let normal = newell(&points);
    let mut ring: Vec<usize> = (0..points.len()).collect();
    let quality = |ring: &[usize], tip: usize| ear_quality(&points, normal, ring, tip);
    let all = |ring: &[usize]| {
        (0..ring.len())
            .map(|tip| quality(ring, tip))
            .collect::<Vec<f64>>()
    };

    let mut triangles = Vec::new();
    let mut qualities = all(&ring);
    while ring.len() > 3 {
        // Cutting an ear changes its two neighbours only, except where edges are double.
        if qualities.iter().all(|quality| *quality <= 0.0) {
            qualities = all(&ring);
        }
        let Some(tip) = best_ear(&qualities) else {
            return triangles;
        };
        triangles.extend(corner(&ring, tip));
        ring.remove(tip);
        qualities.remove(tip);
        for neighbour in [(tip + ring.len() - 1) % ring.len(), tip % ring.len()] {
            if let Some(slot) = qualities.get_mut(neighbour) {
                *slot = quality(&ring, neighbour);
            }
        }
    }
    triangles.extend(corner(&ring, 1));
    triangles
}

/// The first of the best ears; `None` when there is none.
fn best_ear(qualities: &[f64]) -> Option<usize> {
    let (mut best, mut most) = (None, 0.0);
    for (tip, quality) in qualities.iter().enumerate() {
        if *quality > most {
            (best, most) = (Some(tip), *quality);
        }
    }
    best
}

/// A corner of the ring with its two neighbours.
fn corner(ring: &[usize], tip: usize) -> Option<[usize; 3]> {
    let at = |i: usize| ring.get(i.checked_rem(ring.len())?).copied();
    Some([at(tip + ring.len() - 1)?, at(tip)?, at(tip + 1)?])
}

/// Twice the area of the ear at `tip` over the square of its longest edge; 0 where no ear is.
fn ear_quality(points: &[DVec3], normal: DVec3, ring: &[usize], tip: usize) -> f64 {
    let point = |i: usize| points.get(i).copied();
    let Some([Some(a), Some(b), Some(c)]) = corner(ring, tip).map(|corner| corner.map(point))
    else {
        return 0.0;
    };
    let side = |from: DVec3, to: DVec3, p: DVec3| (to - from).cross(p - from).dot(normal);
    let turn = side(a, b, c);
    // A vertex on the cut would be left with a triangle on either side of it; one on the two
    // edges that exist already is none of ours.
    let is_blocked = || {
        ring.iter().filter_map(|i| point(*i)).any(|p| {
            let is_corner = p == a || p == b || p == c;
            !is_corner && side(a, b, p) > 0.0 && side(b, c, p) > 0.0 && side(c, a, p) >= 0.0
        })
    };
    if turn <= 0.0 || is_blocked() {
        return 0.0;
    }
    let longest = [b - a, c - b, a - c]
        .map(DVec3::length_squared)
        .into_iter()
        .fold(0.0, f64::max);
    turn / (normal.length() * longest)
}

/// Drops faces in the place of another one.
fn drop_duplicates(pieces: &mut Vec<Piece>, materials: &[Material], repairs: &mut Repairs) {
    let mut kept = vec![true; pieces.len()];
    let mut places: HashMap<[Key; MAX_VERTICES], Vec<usize>> = HashMap::new();
    for (index, piece) in pieces.iter().enumerate() {
        let here = places.entry(place(&piece.polygon)).or_default();
        let same = here.iter_mut().find(|other| {
            pieces
                .get(**other)
                .is_some_and(|other| is_duplicate(piece, other, materials))
        });
        let Some(other) = same else {
            here.push(index);
            continue;
        };
        let later_stays = emits(piece, materials)
            && !pieces
                .get(*other)
                .is_some_and(|other| emits(other, materials));
        let dropped = if later_stays {
            std::mem::replace(other, index)
        } else {
            index
        };
        if let Some(kept) = kept.get_mut(dropped) {
            *kept = false;
        }
        repairs.duplicate_faces += 1;
    }
    let mut kept = kept.into_iter();
    pieces.retain(|_| kept.next().unwrap_or(true));
}

/// The set of vertices, sorted; a triangle's fourth is none that a vertex can have.
fn place(polygon: &Polygon) -> [Key; MAX_VERTICES] {
    let mut place = [[u32::MAX; 3]; MAX_VERTICES];
    for (slot, vertex) in place.iter_mut().zip(polygon.vertices()) {
        *slot = key(*vertex);
    }
    place.sort_unstable();
    place
}

/// Whether two faces with the same vertices are one too many.
fn is_duplicate(a: &Piece, b: &Piece, materials: &[Material]) -> bool {
    let two_sided = |piece: &Piece| {
        materials
            .get(piece.outline.material)
            .is_some_and(|material| material.two_sided)
    };
    let same_side = a.polygon.normal().dot(b.polygon.normal()) > 0.0;
    let back_to_back_lamps = emits(a, materials) && emits(b, materials);
    same_side || (two_sided(a) && two_sided(b) && !back_to_back_lamps)
}

fn emits(piece: &Piece, materials: &[Material]) -> bool {
    materials
        .get(piece.outline.material)
        .is_some_and(|material| material.glow.is_some())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::draft::Glow;
    use glam::Vec2;
    use relume::color::Rgb;

    fn outline(points: &[[f32; 3]]) -> Outline {
        Outline {
            material: 0,
            vertices: points.iter().copied().map(Vec3::from).collect(),
            uv: Vec::new(),
        }
    }

    fn flat(points: &[[f32; 2]]) -> Outline {
        outline(
            &points
                .iter()
                .map(|[x, y]| [*x, *y, 0.0])
                .collect::<Vec<_>>(),
        )
    }

    fn legal(outlines: Vec<Outline>) -> (Vec<Outline>, Repairs) {
        let mut repairs = Repairs::default();
        let materials = [Material::unknown(true), Material::unknown(false)];
        let legal = legalize(outlines, &materials, &mut repairs).unwrap();
        (legal, repairs)
    }

    fn area(outlines: &[Outline]) -> f32 {
        outlines
            .iter()
            .map(|o| Polygon::new(&o.vertices).unwrap().area())
            .sum()
    }

    const SQUARE: [[f32; 2]; 4] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];

    #[test]
    fn legal_polygons_stay_as_they_are() {
        let square = flat(&SQUARE);
        let triangle = flat(&[[5.0, 0.0], [6.0, 0.0], [5.0, 2.0]]);
        let (polygons, repairs) = legal(vec![square.clone(), triangle.clone()]);
        assert_eq!(polygons, [square, triangle]);
        assert_eq!(repairs, Repairs::default());
    }

    #[test]
    fn concave_warped_and_large_polygons_become_triangles_of_the_same_area() {
        let (dart, repairs) = legal(vec![flat(&[
            [0.0, 0.0],
            [4.0, 0.0],
            [1.0, 1.0],
            [0.0, 4.0],
        ])]);
        assert_eq!((dart.len(), repairs.concave_quads), (2, 1));
        assert!((area(&dart) - 4.0).abs() < 1e-5);

        let warped = [
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [1.0, 1.0, 0.5],
            [0.0, 1.0, 0.0],
        ];
        let (halves, repairs) = legal(vec![outline(&warped)]);
        assert_eq!(
            (halves.len(), repairs.warped_quads, repairs.crossed_outlines),
            (2, 1, 0)
        );

        // An L of area 3, with a vertex in the middle of an edge.
        let ell = [
            [0.0, 0.0],
            [1.0, 0.0],
            [2.0, 0.0],
            [2.0, 1.0],
            [1.0, 1.0],
            [1.0, 2.0],
            [0.0, 2.0],
        ];
        let (parts, repairs) = legal(vec![flat(&ell)]);
        assert!((area(&parts) - 3.0).abs() < 1e-5, "{parts:?}");
        assert_eq!((repairs.large_polygons, repairs.crossed_outlines), (1, 0));
        for part in &parts {
            assert!(Polygon::new(&part.vertices).unwrap().normal().z > 0.99);
        }
    }

    #[test]
    fn a_hole_behind_a_double_edge_stays_open() {
        let window = [
            [0.0, 0.0],
            [3.0, 0.0],
            [3.0, 3.0],
            [0.0, 3.0],
            [0.0, 0.0],
            [1.0, 1.0],
            [1.0, 2.0],
            [2.0, 2.0],
            [2.0, 1.0],
            [1.0, 1.0],
        ];
        let (parts, repairs) = legal(vec![flat(&window)]);
        assert!((area(&parts) - 8.0).abs() < 1e-5, "{parts:?}");
        assert_eq!(repairs.crossed_outlines, 0);
        let centre = Vec3::new(1.5, 1.5, 0.0);
        for part in &parts {
            let polygon = Polygon::new(&part.vertices).unwrap();
            assert!(
                polygon
                    .crossing(centre + Vec3::Z, centre - Vec3::Z)
                    .is_none(),
                "{part:?}"
            );
        }
    }

    #[test]
    fn crossed_outlines_are_counted_and_do_not_hang() {
        let star: Vec<[f32; 2]> = (0..5)
            .map(|i| (i as f32 * 0.8 * std::f32::consts::PI).sin_cos().into())
            .collect();
        let (_, repairs) = legal(vec![
            flat(&star),
            flat(&[[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]]),
        ]);
        assert_eq!((repairs.crossed_outlines, repairs.degenerate_faces), (1, 1));
    }

    #[test]
    fn repeated_vertices_and_empty_faces() {
        let mut repeated = flat(&[[0.0, 0.0], [1.0, 0.0], [1.0, 0.0], [0.0, 1.0]]);
        repeated.uv = vec![Vec2::ZERO, Vec2::X, Vec2::X, Vec2::Y];
        let line = flat(&[[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]);
        let point = flat(&[[1.0, 1.0]; 6]);
        let (parts, repairs) = legal(vec![repeated, line, point, flat(&[]), flat(&SQUARE[..2])]);
        assert_eq!(parts.len(), 1);
        assert_eq!(
            parts[0].vertices,
            flat(&[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]).vertices
        );
        assert_eq!(parts[0].uv, [Vec2::ZERO, Vec2::X, Vec2::Y]);
        assert_eq!(
            (repairs.repeated_vertices, repairs.degenerate_faces),
            (2, 4)
        );
    }

    #[test]
    fn overflowing_coordinates_are_an_error() {
        let huge = flat(&[[0.0, 0.0], [1e30, 0.0], [0.0, 1e30]]);
        let fault = legalize(
            vec![huge],
            &[Material::unknown(true)],
            &mut Repairs::default(),
        );
        assert!(
            fault
                .unwrap_err()
                .starts_with("polygon 1 has coordinates so large")
        );
    }

    #[test]
    fn duplicates_are_dropped_as_the_head_says() {
        let mut rotated = flat(&SQUARE);
        rotated.vertices.rotate_left(1);
        let mut behind = flat(&SQUARE);
        behind.vertices.reverse();
        behind.vertices[0].x *= -0.0;
        let one_sided = |mut outline: Outline| {
            outline.material = 1;
            outline
        };
        let (polygons, repairs) = legal(vec![flat(&SQUARE), rotated.clone(), behind.clone()]);
        assert_eq!((polygons.len(), repairs.duplicate_faces), (1, 2));
        let sides = vec![
            one_sided(flat(&SQUARE)),
            one_sided(behind.clone()),
            one_sided(rotated),
        ];
        let (polygons, repairs) = legal(sides);
        assert_eq!((polygons.len(), repairs.duplicate_faces), (2, 1));
    }

    #[test]
    fn a_lamp_on_a_wall_stays_and_lamps_back_to_back_both_stay() {
        let lamp = Material {
            glow: Some(Glow {
                light: "lamp".to_owned(),
                exitance: Rgb::WHITE,
            }),
            ..Material::unknown(true)
        };
        let materials = [Material::unknown(true), lamp];
        let wall = flat(&SQUARE);
        let shining = Outline {
            material: 1,
            ..wall.clone()
        };
        let mut behind = shining.clone();
        behind.vertices.reverse();
        let mut repairs = Repairs::default();
        let outlines = vec![wall, shining.clone(), behind.clone()];
        let polygons = legalize(outlines, &materials, &mut repairs).unwrap();
        assert_eq!(polygons, [shining, behind]);
        assert_eq!(repairs.duplicate_faces, 1);
    }
}
