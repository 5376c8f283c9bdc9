//! How wrong a bake is by its own lights, without a reference.
//!
//! An element holds one value where the light varies: for a linear course that changes by `d_s` and
//! `d_t` from element to element along the two directions of its face, the mean of
//! `|E - E_j|` over the element is close to `sqrt(d_s^2 + d_t^2) / 4`. Summed over the area, over the
//! sum of the irradiance, it is the relative L1 error of the mesh. It is independent of what
//! rays or missing rows leave, so the two add as squares.

use relume::color::Rgb;
use relume::mesh::{Element, Face};

use crate::mesh::OwnedMesh;

/// Relative L1 error that the size of the elements leaves in every light.
pub(super) fn mesh_errors(mesh: &OwnedMesh, contributions: &[Rgb], lights: usize) -> Vec<f32> {
    let mut errors = vec![0.0_f64; lights];
    let mut totals = vec![0.0_f64; lights];
    for face in &mesh.faces {
        let range = face.element_range();
        let elements = &mesh.elements[range.start as usize..range.end as usize];
        let value = |index: usize, light: usize| {
            let element = range.start as usize + index;
            let Rgb { r, g, b } = contributions[element * lights + light];
            f64::from(r + g + b)
        };
        let columns = columns(face, elements);
        for (element, index) in elements.iter().zip(0..) {
            let area = f64::from(element.area);
            for light in 0..lights {
                let own = value(index, light);
                let step = |others: [Option<usize>; 2]| {
                    let steps = others.into_iter().flatten();
                    let steps = steps.map(|other| (value(other, light) - own).abs());
                    let (count, sum) = steps.fold((0.0, 0.0), |(n, sum), d| (n + 1.0, sum + d));
                    if count > 0.0 { sum / count } else { 0.0 }
                };
                let column = index % columns;
                let across = step([
                    (column > 0).then(|| index - 1),
                    (column + 1 < columns && index + 1 < elements.len()).then_some(index + 1),
                ]);
                let along = step([
                    index.checked_sub(columns),
                    Some(index + columns).filter(|other| *other < elements.len()),
                ]);
                errors[light] += area * across.hypot(along) / 4.0;
                totals[light] += area * own;
            }
        }
    }
    errors
        .into_iter()
        .zip(totals)
        .map(|(error, total)| {
            if total > 0.0 {
                (error / total) as f32
            } else {
                0.0
            }
        })
        .collect()
}

/// Elements in a row of a face; all of them for a triangle, whose rows have different lengths.
fn columns(face: &Face, elements: &[Element]) -> usize {
    let first = elements.first().map(|element| element.from.y);
    let in_first_row = |element: &&Element| Some(element.from.y) == first;
    if face.polygon.is_triangle() {
        elements.len().max(1)
    } else {
        elements.iter().take_while(in_first_row).count().max(1)
    }
}
