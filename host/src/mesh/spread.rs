//! Places on the elements of a mesh: half of them spread by area, half of them where light is bright.
//!
//! A place stands for the area `a_j = S / (N q_j)`, `S = sum_j A_j q_j`, of `N` places, with
//! `q_j = 1 + h_j sum_i A_i / sum_i A_i h_i` for the element `j` of area `A_j` that holds it, and
//! `h_j = max_m E_jm / mean E_m` the brightness there of the light that is brightest for its mean. So few places
//! find the spot next to a small lamp, which weighs much in sums over all of its light.

use glam::Vec2;
use relume::color::Rgb;
use relume::mesh::{Element, Mesh};

use crate::noise;

/// Edge of a place, in edges of its element: light hardly varies over it, and its corners stay apart.
const EDGE: f32 = 1.0 / 16.0;

/// A small part of an element.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Number of the element.
    pub element: usize,
    /// The part.
    pub part: Element,
    /// The area that it stands for, m2.
    pub area: f64,
}

/// So many places for contributions `[element][light]`; the `seed` chooses where they are.
#[must_use]
pub fn spread(mesh: &Mesh, contributions: &[Rgb], count: usize, seed: u64) -> Vec<Place> {
    let densities = densities(mesh, contributions);
    let weighed = mesh.elements.iter().zip(&densities);
    let share = weighed
        .clone()
        .map(|(e, q)| f64::from(e.area) * q)
        .sum::<f64>()
        / count as f64;
    let mut places: Vec<Place> = Vec::with_capacity(count);
    let mut end = 0.0;
    for (number, (element, density)) in weighed.enumerate() {
        end += f64::from(element.area) * density;
        while places.len() < count {
            let seed = (seed << 32) + 3 * places.len() as u64;
            if share * (places.len() as f64 + f64::from(noise::unit(seed))) >= end {
                break;
            }
            let at = [seed + 1, seed + 2].map(noise::unit);
            places.push(Place {
                element: number,
                part: part(mesh, element, at.into()),
                area: share / density,
            });
        }
    }
    places
}

/// The part of an element at a point of the unit square.
fn part(mesh: &Mesh, element: &Element, Vec2 { x, y }: Vec2) -> Element {
    let face = mesh.element_face(element);
    let at = if face.is_some_and(|face| face.polygon.is_triangle()) {
        Vec2::new(1.0 - y, y) * x.sqrt()
    } else {
        Vec2::new(x, y)
    };
    let size = element.to - element.from;
    let from = element.from + size * at * (1.0 - EDGE);
    Element {
        from,
        to: from + size * EDGE,
        area: element.area * EDGE * EDGE,
        ..*element
    }
}

/// `q_j`, without a unit.
fn densities(mesh: &Mesh, contributions: &[Rgb]) -> Vec<f64> {
    let n = mesh.elements.len();
    let lights = contributions.len() / n.max(1);
    let total: f64 = mesh.elements.iter().map(|e| f64::from(e.area)).sum();
    let value = |light: &Rgb| f64::from(light.r + light.g + light.b);
    let by_element = || contributions.chunks(lights.max(1)).zip(mesh.elements);

    let mut means = vec![0.0; lights];
    for (values, element) in by_element() {
        for (mean, light) in means.iter_mut().zip(values) {
            *mean += f64::from(element.area) * value(light) / total;
        }
    }
    let brightness = |(values, _): (&[Rgb], _)| {
        let lit = values.iter().zip(&means).filter(|(_, mean)| **mean > 0.0);
        lit.map(|(light, mean)| value(light) / mean)
            .fold(0.0, f64::max)
    };
    let brightness: Vec<f64> = by_element().map(brightness).collect();
    let sum: f64 = brightness
        .iter()
        .zip(mesh.elements)
        .map(|(h, e)| h * f64::from(e.area))
        .sum();
    let scale = if sum > 0.0 { total / sum } else { 0.0 };
    brightness.into_iter().map(|h| 1.0 + h * scale).collect()
}

#[cfg(test)]
mod tests {
    use super::super::OwnedMesh;
    use super::*;
    use crate::builtin::{PaperLamps, paper_room};
    use relume::mesh::{Spacing, subdivide};

    #[test]
    fn places_lie_inside_their_elements_and_stand_for_all_of_the_area() {
        let room = paper_room(PaperLamps::One).unwrap();
        let spacing = Spacing {
            patch: 1.0,
            element: 0.25,
        };
        let mut mesh = OwnedMesh::default();
        subdivide(&room.scene.view().unwrap(), spacing, |_, _| true, &mut mesh).unwrap();
        let mesh = mesh.view();
        // Nine tenths of the light in one element.
        let mut light = vec![Rgb::WHITE; mesh.elements.len()];
        light[100] = Rgb::WHITE * (9.0 * light.len() as f32);
        let places = spread(&mesh, &light, 500, 1);
        assert_eq!(places.len(), 500);
        assert_ne!(places, spread(&mesh, &light, 500, 2));
        let in_spot = places.iter().filter(|place| place.element == 100).count();
        // Of the half that looks for brightness; the other half has less than one to spare.
        assert!((224..=227).contains(&in_spot), "{in_spot}");
        let total: f32 = mesh.elements.iter().map(|element| element.area).sum();
        let stands_for: f64 = places.iter().map(|place| place.area).sum();
        // One share of the darker elements is 1 / 275 of all.
        assert!(
            (stands_for / f64::from(total) - 1.0).abs() < 0.005,
            "{stands_for}"
        );

        for Place { element, part, .. } in places {
            let whole = mesh.elements[element];
            let (low, high) = (whole.from.min(whole.to), whole.from.max(whole.to));
            for corner in [part.from, part.to] {
                let slack = 1e-6;
                assert!(corner.cmpge(low - slack).all() && corner.cmple(high + slack).all());
            }
            let [small, large] = [part, whole].map(|e| mesh.element_polygon(&e).unwrap());
            let ratio = small.longest_edge() / large.longest_edge();
            assert!((ratio / EDGE - 1.0).abs() < 1e-3, "{ratio}");
        }
    }
}
