//! Puts quads together again that an exporter cut into two triangles.
//!
//! Two triangles make a quad when they have the same material, share an edge (its ends bit for
//! bit, in opposite order), lie in one plane as [`Polygon::new`] sees it, and every corner of the
//! quad turns left by a clear angle: its sine is at least 0.1. Textured ones must also share one
//! affine map to the image, for then the quad's bilinear map is that same map.
//!
//! Which pairs: first, in file order, every triangle with the one that follows it directly, since
//! exporters write the halves of a quad one after the other; then, again in file order, each
//! triangle left over with the later one that makes the most rectangular quad (largest smallest
//! sine of a corner; the earlier one among equals). A quad takes the place of its first triangle
//! and begins with that triangle's first vertex.

use std::collections::HashMap;

use glam::{Vec2, Vec3};
use relume::geometry::Polygon;

use super::draft::Outline;
use super::polygons::{Key, Piece, key};
use super::repairs::Repairs;

/// Least sine of a corner of a recovered quad.
const CLEAR_TURN: f32 = 0.1;

/// How far texture coordinates may lie off the affine map, in longest edges of the image part.
const AFFINE: f32 = 1e-4;

/// Triangles that are kept in mind per edge; more than two meet in odd meshes only.
const MOST_AT_EDGE: usize = 8;

/// The same polygons with pairs of triangles made one.
pub(super) fn recover_quads(pieces: Vec<Piece>, repairs: &mut Repairs) -> Vec<Piece> {
    let edges = directed_edges(&pieces);
    let mut slots: Vec<Option<Piece>> = pieces.into_iter().map(Some).collect();

    for index in 0..slots.len().saturating_sub(1) {
        let quad = union_of(&slots, index, index + 1).map(|(quad, _)| quad);
        join(&mut slots, index, index + 1, quad, repairs);
    }
    for index in 0..slots.len() {
        if let Some((other, quad)) = best_partner(&slots, &edges, index) {
            join(&mut slots, index, other, Some(quad), repairs);
        }
    }
    slots.into_iter().flatten().collect()
}

/// Puts the quad, if there is one, in the place of the first triangle.
fn join(
    slots: &mut [Option<Piece>],
    first: usize,
    second: usize,
    quad: Option<Piece>,
    repairs: &mut Repairs,
) {
    if quad.is_none() {
        return;
    }
    if let Some(slot) = slots.get_mut(first) {
        *slot = quad;
    }
    if let Some(slot) = slots.get_mut(second) {
        *slot = None;
    }
    repairs.recovered_quads += 1;
}

/// The triangles at every edge, by its ends in their winding.
fn directed_edges(pieces: &[Piece]) -> HashMap<(Key, Key), Vec<usize>> {
    let mut edges: HashMap<(Key, Key), Vec<usize>> = HashMap::new();
    for (index, piece) in pieces.iter().enumerate() {
        if !piece.polygon.is_triangle() {
            continue;
        }
        for (from, to) in piece.polygon.edges() {
            let here = edges.entry((key(from), key(to))).or_default();
            if here.len() < MOST_AT_EDGE {
                here.push(index);
            }
        }
    }
    edges
}

/// The later triangle that makes the most rectangular quad with this one, and the quad.
fn best_partner(
    slots: &[Option<Piece>],
    edges: &HashMap<(Key, Key), Vec<usize>>,
    index: usize,
) -> Option<(usize, Piece)> {
    let triangle = slots.get(index)?.as_ref()?;
    let mut candidates: Vec<usize> = triangle
        .polygon
        .edges()
        .filter_map(|(from, to)| edges.get(&(key(to), key(from))))
        .flatten()
        .copied()
        .filter(|other| *other > index)
        .collect();
    candidates.sort_unstable();
    let mut best: Option<(usize, Piece, f32)> = None;
    for other in candidates {
        if let Some((quad, sine)) = union_of(slots, index, other)
            && best.as_ref().is_none_or(|(_, _, least)| sine > *least)
        {
            best = Some((other, quad, sine));
        }
    }
    best.map(|(other, quad, _)| (other, quad))
}

/// The quad of two triangles and its smallest sine; `None` when they are no two halves of one.
fn union_of(slots: &[Option<Piece>], first: usize, second: usize) -> Option<(Piece, f32)> {
    let a = slots.get(first)?.as_ref()?;
    let b = slots.get(second)?.as_ref()?;
    let is_pair = a.polygon.is_triangle()
        && b.polygon.is_triangle()
        && a.outline.material == b.outline.material
        && a.outline.uv.len() == b.outline.uv.len();
    if !is_pair {
        return None;
    }
    let outline = joined_outline(&a.outline, &b.outline)?;
    let sine = smallest_sine(&outline.vertices);
    if sine < CLEAR_TURN || !is_affine(&outline) {
        return None;
    }
    let polygon = Polygon::new(&outline.vertices).ok()?;
    Some((Piece { outline, polygon }, sine))
}

/// The outline around two triangles with a common edge.
fn joined_outline(a: &Outline, b: &Outline) -> Option<Outline> {
    let keys = |outline: &Outline| {
        let [p, q, r] = *outline.vertices else {
            return None;
        };
        Some([key(p), key(q), key(r)])
    };
    let (a_keys, b_keys) = (keys(a)?, keys(b)?);
    for (i, j) in (0..3).flat_map(|i| (0..3).map(move |j| (i, j))) {
        // Edge i of `a` runs as edge j of `b` does, the other way.
        let (from, to) = (i, (i + 1) % 3);
        let (back_from, back_to, apex) = (j, (j + 1) % 3, (j + 2) % 3);
        if a_keys.get(from) != b_keys.get(back_to) || a_keys.get(to) != b_keys.get(back_from) {
            continue;
        }
        let same_image_place =
            a.uv.get(from) == b.uv.get(back_to) && a.uv.get(to) == b.uv.get(back_from);
        if !same_image_place {
            return None;
        }
        let mut joined = a.clone();
        joined.vertices.insert(from + 1, *b.vertices.get(apex)?);
        if let Some(uv) = b.uv.get(apex) {
            joined.uv.insert(from + 1, *uv);
        }
        return Some(joined);
    }
    None
}

/// Smallest sine of the corners, seen from the front; negative when one turns right.
fn smallest_sine(vertices: &[Vec3]) -> f32 {
    let [a, b, c, d] = *vertices else {
        return 0.0;
    };
    let normal = (c - a).cross(d - b).normalize_or_zero();
    let sine = |before: Vec3, at: Vec3, after: Vec3| {
        let (arriving, leaving) = (
            (at - before).normalize_or_zero(),
            (after - at).normalize_or_zero(),
        );
        arriving.cross(leaving).dot(normal)
    };
    [sine(d, a, b), sine(a, b, c), sine(b, c, d), sine(c, d, a)]
        .into_iter()
        .fold(1.0, f32::min)
}

/// Whether one affine map takes all four corners to their places in the image.
fn is_affine(quad: &Outline) -> bool {
    let ([a, b, c, d], [uv_a, uv_b, uv_c, uv_d]) = (&*quad.vertices, &*quad.uv) else {
        return true;
    };
    // c = a + s (b - a) + t (d - a), in the plane of the quad.
    let (along_s, along_t, to_c) = (*b - *a, *d - *a, *c - *a);
    let normal = along_s.cross(along_t);
    let s = to_c.cross(along_t).dot(normal) / normal.length_squared();
    let t = along_s.cross(to_c).dot(normal) / normal.length_squared();
    let expected = *uv_a + (*uv_b - *uv_a) * s + (*uv_d - *uv_a) * t;
    let edges = [(uv_a, uv_b), (uv_b, uv_c), (uv_c, uv_d), (uv_d, uv_a)];
    let longest = edges
        .iter()
        .map(|(p, q): &(&Vec2, &Vec2)| p.distance(**q))
        .fold(0.0, f32::max);
    expected.distance(*uv_c) <= AFFINE * longest
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle(points: [[f32; 3]; 3]) -> Outline {
        Outline {
            material: 0,
            vertices: points.iter().copied().map(Vec3::from).collect(),
            uv: Vec::new(),
        }
    }

    fn recover(outlines: Vec<Outline>) -> (Vec<Outline>, usize) {
        let mut repairs = Repairs::default();
        let pieces = outlines
            .into_iter()
            .map(|outline| Piece {
                polygon: Polygon::new(&outline.vertices).unwrap(),
                outline,
            })
            .collect();
        let outlines = recover_quads(pieces, &mut repairs)
            .into_iter()
            .map(|p| p.outline)
            .collect();
        (outlines, repairs.recovered_quads)
    }

    const A: [f32; 3] = [0.0, 0.0, 0.0];
    const B: [f32; 3] = [2.0, 0.0, 0.0];
    const C: [f32; 3] = [2.0, 1.0, 0.0];
    const D: [f32; 3] = [0.0, 1.0, 0.0];

    #[test]
    fn halves_become_the_quad_that_they_were() {
        let expected: Vec<Vec3> = [A, B, C, D].into_iter().map(Vec3::from).collect();
        for (first, second) in [
            ([A, B, C], [A, C, D]),
            ([A, B, D], [B, C, D]),
            ([A, C, D], [A, B, C]),
        ] {
            let (quads, count) = recover(vec![triangle(first), triangle(second)]);
            assert_eq!(count, 1);
            assert_eq!(quads[0].vertices, expected, "{first:?} {second:?}");
        }
    }

    #[test]
    fn what_is_no_quad_stays_two_triangles() {
        let folded = [2.0, 1.0, 0.1];
        let sharp = [4.0, 0.01, 0.0];
        let inside = [1.5, 0.1, 0.0];
        let cases = [
            ([A, B, D], [B, folded, D]),                // warped
            ([A, B, D], [B, D, C]),                     // the other one looks away
            ([A, B, D], [B, sharp, D]),                 // a corner that hardly turns
            ([A, B, D], [A, [0.0, -1.0, 0.0], inside]), // no common edge
        ];
        for (first, second) in cases {
            let (kept, count) = recover(vec![triangle(first), triangle(second)]);
            assert_eq!((kept.len(), count), (2, 0), "{first:?} {second:?}");
        }
        let mut other_material = triangle([A, C, D]);
        other_material.material = 1;
        assert_eq!(recover(vec![triangle([A, B, C]), other_material]).1, 0);
    }

    #[test]
    fn a_shuffled_grid_finds_its_squares_and_keeps_its_order() {
        let at = |x: u8, y: u8| [f32::from(x), f32::from(y), 0.0];
        let mut lower = Vec::new();
        let mut upper = Vec::new();
        for y in 0..3 {
            for x in 0..4 {
                lower.push(triangle([at(x, y), at(x + 1, y), at(x + 1, y + 1)]));
                upper.push(triangle([at(x, y), at(x + 1, y + 1), at(x, y + 1)]));
            }
        }
        let firsts: Vec<Vec3> = lower.iter().map(|t| t.vertices[0]).collect();
        upper.reverse();
        lower.append(&mut upper);
        let (quads, count) = recover(lower);
        assert_eq!((quads.len(), count), (12, 12));
        for (quad, first) in quads.iter().zip(firsts) {
            assert_eq!(quad.vertices[0], first);
            assert!((Polygon::new(&quad.vertices).unwrap().area() - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn textured_halves_need_one_affine_map() {
        let with = |points, uv: [[f32; 2]; 3]| Outline {
            uv: uv.into_iter().map(Vec2::from).collect(),
            ..triangle(points)
        };
        let [a, b, c, d] = [[0.0, 0.0], [0.5, 0.0], [0.5, 0.25], [0.0, 0.25]];
        let first = with([A, B, C], [a, b, c]);
        let (quads, count) = recover(vec![first.clone(), with([A, C, D], [a, c, d])]);
        assert_eq!(count, 1);
        assert_eq!(quads[0].uv, [a, b, c, d].map(Vec2::from));
        for wrong in [[a, c, [0.0, 0.3]], [[0.1, 0.0], c, d]] {
            assert_eq!(
                recover(vec![first.clone(), with([A, C, D], wrong)]).1,
                0,
                "{wrong:?}"
            );
        }
        assert_eq!(recover(vec![first, triangle([A, C, D])]).1, 0);
    }
}
