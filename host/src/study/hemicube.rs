//! Rows by hemicube: what is seen from the centre of the shooting patch, pixel by pixel.
//!
//! `F_ij = sum of dF over the pixels in which element j is nearest`, `F_ji = F_ij A_i / A_j`, with
//!
//! `dF = dA / (pi (a^2 + b^2 + 1)^2)` on the top face and `dF = b dA / (pi (a^2 + b^2 + 1)^2)` on the sides
//!
//! for a pixel of area `dA` at `(a, b)` on a face at distance 1, `b` towards the normal (M. F. Cohen and
//! D. P. Greenberg, *The hemi-cube: a radiosity solution for complex environments*, SIGGRAPH 1985, there for
//! gathering; for shooting as in Cohen et al. 1988). Depth is exact at the middle of every pixel.

use std::f32::consts::PI;

use glam::Vec3;
use relume::form_factor::Shooter;
use relume::geometry::{Polygon, clip};
use relume::luminaire;
use relume::mesh::{Mesh, Side};
use relume::scene::{Luminaire, Surface};
use relume::visibility::Visibility;

use crate::bvh::Bvh;
use crate::mesh::Locator;
use crate::rows::RowFiller;

/// A pixel in which no element is seen.
const NOTHING: u32 = u32::MAX;

/// Fills rows by hemicubes, on one thread.
#[derive(Clone, Copy, Debug)]
pub struct Hemicube<'a> {
    /// What blocks.
    pub surfaces: &'a [Surface],
    /// The same, for the direct light of luminaires.
    pub bvh: &'a Bvh,
    /// Pixels along the edge of the top face; even.
    pub resolution: usize,
}

impl RowFiller for Hemicube<'_> {
    fn visibility(&self) -> &impl Visibility {
        self.bvh
    }

    fn luminaire(&self, mesh: &Mesh, luminaire: &Luminaire, far: f32, row: &mut [f32]) {
        luminaire::fill(mesh, luminaire, far, 0, self.bvh, row);
    }

    fn shooter(&self, mesh: &Mesh, shooter: &Shooter, row: &mut [f32]) {
        let shooter = shooter.polygon();
        row.fill(0.0);
        let seen = self.seen_from(mesh, shooter.center());
        for face in faces(shooter.normal()) {
            let mut window = Window::new(face, self.resolution);
            for (outline, element) in &seen {
                window.paint(outline, *element);
            }
            window.add_to(row);
        }
        for (factor, element) in row.iter_mut().zip(mesh.elements) {
            // Near the shooter its centre may see more than there is to see; a row holds no more than 1.
            *factor = (*factor * shooter.area() / element.area).min(1.0);
        }
    }
}

impl Hemicube<'_> {
    /// Everything that faces a point, relative to it: elements, and what has none.
    fn seen_from(&self, mesh: &Mesh, eye: Vec3) -> Vec<(Vec<Vec3>, u32)> {
        let relative = |polygon: &Polygon| polygon.vertices().iter().map(|v| *v - eye).collect();
        let locator = Locator::new(*mesh);
        let mut seen = Vec::with_capacity(mesh.elements.len());
        for (surface, number) in self.surfaces.iter().zip(0..) {
            let (height, tolerance) = surface.polygon().height(eye);
            if height.abs() <= tolerance {
                continue;
            }
            let side = if height > 0.0 {
                Side::Front
            } else {
                Side::Back
            };
            let face = locator.face(number, side).filter(|f| f.element_count > 0);
            let Some(face) = face else {
                seen.push((relative(surface.polygon()), NOTHING));
                continue;
            };
            for id in face.element_range() {
                let element = mesh.elements.get(id as usize);
                if let Some(polygon) = element.and_then(|e| mesh.element_polygon(e)) {
                    seen.push((relative(&polygon), id));
                }
            }
        }
        seen
    }
}

/// A face of the hemicube: where its axes point, and the lowest `b` on it.
#[derive(Clone, Copy)]
struct Face {
    right: Vec3,
    up: Vec3,
    forward: Vec3,
    low: f32,
}

/// The top, then the upper halves of the sides.
fn faces(normal: Vec3) -> [Face; 5] {
    let (x, y) = normal.any_orthonormal_pair();
    let side = |forward: Vec3| Face {
        right: forward.cross(normal),
        up: normal,
        forward,
        low: 0.0,
    };
    let top = Face {
        right: x,
        up: y,
        forward: normal,
        low: -1.0,
    };
    [top, side(x), side(-x), side(y), side(-y)]
}

/// What is seen through a face.
struct Window {
    face: Face,
    columns: usize,
    rows: usize,
    /// `1 / w` of the nearest, with `w` the distance along `forward`.
    nearness: Vec<f32>,
    element: Vec<u32>,
}

impl Window {
    fn new(face: Face, resolution: usize) -> Self {
        let rows = (resolution as f32 * (1.0 - face.low) / 2.0) as usize;
        Self {
            face,
            columns: resolution,
            rows,
            nearness: vec![0.0; resolution * rows],
            element: vec![NOTHING; resolution * rows],
        }
    }

    /// Edge of a pixel at distance 1.
    fn pixel(&self) -> f32 {
        2.0 / self.columns as f32
    }

    /// Paints a convex polygon, given relative to the eye, where it is nearest.
    fn paint(&mut self, outline: &[Vec3], element: u32) {
        let Face {
            right,
            up,
            forward,
            low,
        } = self.face;
        let turned = |v: &Vec3| Vec3::new(v.dot(right), v.dot(up), v.dot(forward));
        let outline: Vec<Vec3> = outline.iter().map(turned).collect();
        let inside = clip(&outline, |v| v.z - v.x);
        let inside = clip(&inside, |v| v.z + v.x);
        let inside = clip(&inside, |v| v.z - v.y);
        let inside = clip(&inside, |v| v.y - low * v.z);
        if inside.len() < 3 || inside.iter().any(|v| v.z <= 0.0) {
            return;
        }
        // The plane m . v = d gives 1 / w = m . (a, b, 1) / d.
        let m = (outline[1] - outline[0]).cross(outline[2] - outline[0]);
        let plane = m / m.dot(outline[0]);

        let pixel = self.pixel();
        let corners: Vec<(f32, f32)> = inside
            .iter()
            .map(|v| ((v.x / v.z + 1.0) / pixel, (v.y / v.z - low) / pixel))
            .collect();
        let bottom = corners.iter().map(|c| c.1).fold(f32::MAX, f32::min);
        let top = corners.iter().map(|c| c.1).fold(f32::MIN, f32::max);
        for row in middles(bottom, top, self.rows) {
            let Some((left, right)) = span(&corners, row as f32 + 0.5) else {
                continue;
            };
            let b = low + (row as f32 + 0.5) * pixel;
            for column in middles(left, right, self.columns) {
                let a = (column as f32 + 0.5) * pixel - 1.0;
                let nearness = plane.dot(Vec3::new(a, b, 1.0));
                let at = row * self.columns + column;
                if nearness > self.nearness[at] {
                    self.nearness[at] = nearness;
                    self.element[at] = element;
                }
            }
        }
    }

    /// Adds the form factor of every pixel to the element that is seen in it.
    fn add_to(&self, row: &mut [f32]) {
        let pixel = self.pixel();
        let is_top = self.face.low < 0.0;
        for (at, element) in self.element.iter().enumerate() {
            let Some(factor) = row.get_mut(*element as usize) else {
                continue;
            };
            let a = ((at % self.columns) as f32 + 0.5) * pixel - 1.0;
            let b = ((at / self.columns) as f32 + 0.5) * pixel + self.face.low;
            let cosine = if is_top { 1.0 } else { b };
            *factor += cosine * pixel * pixel / (PI * (a * a + b * b + 1.0).powi(2));
        }
    }
}

/// Numbers of the pixels whose middles lie between two places.
fn middles(from: f32, to: f32, count: usize) -> std::ops::Range<usize> {
    let first = |place: f32| ((place - 0.5).ceil().max(0.0) as usize).min(count);
    first(from)..first(to)
}

/// Where a convex polygon begins and ends on a horizontal line.
fn span(corners: &[(f32, f32)], y: f32) -> Option<(f32, f32)> {
    let next = corners.iter().cycle().skip(1);
    let crossings = corners.iter().zip(next).filter_map(|(a, b)| {
        let crosses = (a.1 <= y) != (b.1 <= y);
        crosses.then(|| a.0 + (b.0 - a.0) * (y - a.1) / (b.1 - a.1))
    });
    crossings.fold(None, |span, x| {
        let (left, right) = span.unwrap_or((x, x));
        Some((x.min(left), x.max(right)))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builtin::{PaperLamps, paper_room, white_furnace};
    use crate::rows::Parallel;
    use crate::study::meshed;

    #[test]
    fn in_a_closed_box_all_that_leaves_arrives() {
        let furnace = white_furnace(0.5, 1.0).unwrap();
        let meshed = meshed(&furnace, 0.5, 0.25);
        let mesh = meshed.mesh().view();
        for (resolution, most) in [(64, 3e-3), (256, 2e-4)] {
            let hemicube = Hemicube {
                surfaces: &furnace.scene.surfaces,
                bvh: meshed.bvh(),
                resolution,
            };
            let mut row = vec![0.0; mesh.elements.len()];
            for patch in 0..mesh.patches.len() as u32 {
                hemicube.patch(&mesh, patch, &mut row);
                let area = mesh.patches[patch as usize].area;
                let arriving = row.iter().zip(mesh.elements);
                let sum: f32 = arriving.map(|(f, e)| f * e.area / area).sum();
                assert!((sum - 1.0).abs() < most, "{resolution}: {patch}: {sum}");
            }
        }
    }

    /// Far from the shooter its centre stands for all of it, and the row is the exact one.
    #[test]
    fn a_small_shooter_sees_what_exact_rows_say() {
        let room = paper_room(PaperLamps::One).unwrap();
        let meshed = meshed(&room, 1.0, 0.5);
        let mesh = meshed.mesh().view();
        let lamp = (0..mesh.patches.len() as u32)
            .find(|patch| mesh.patch_emission(*patch).is_some())
            .unwrap();
        let hemicube = Hemicube {
            surfaces: &room.scene.surfaces,
            bvh: meshed.bvh(),
            resolution: 512,
        };
        let mut exact = vec![0.0; mesh.elements.len()];
        let mut found = exact.clone();
        Parallel::new(&mesh, meshed.bvh()).patch(&mesh, lamp, &mut exact);
        hemicube.patch(&mesh, lamp, &mut found);
        let brightest = exact.iter().copied().fold(0.0, f32::max);
        for (exact, found) in exact.iter().zip(&found) {
            let off = (exact - found).abs() / brightest;
            assert!(off < 0.03, "{exact} {found}");
        }
    }
}
