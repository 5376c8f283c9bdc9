//! The element at a point of a face, found by its parameters.

use glam::{Vec2, Vec3};
use relume::mesh::{Face, Mesh, Side};

use crate::linear::{Linear, parameter_gradients, span};

/// The faces of a mesh by surface and side, with the shape of their grids.
#[derive(Clone, Debug)]
pub struct Locator<'a> {
    /// Front and back of every surface.
    grids: Vec<[Option<Grid<'a>>; 2]>,
}

/// A face whose elements are the cells of a grid, with what each ray asks of it close together.
#[derive(Clone, Copy, Debug)]
struct Grid<'a> {
    face: &'a Face,
    /// The face's parameters, where they are linear.
    parameters: Option<[Linear; 2]>,
    is_triangle: bool,
    first_element: u32,
    element_count: u32,
    columns: u32,
    rows: u32,
}

impl<'a> Locator<'a> {
    /// Reads the grids off the elements' corners.
    #[must_use]
    pub fn new(mesh: Mesh<'a>) -> Self {
        let surfaces = mesh.faces.iter().map(|face| face.surface as usize + 1);
        let mut grids = vec![[None; 2]; surfaces.max().unwrap_or(0)];
        for face in mesh.faces {
            grids[face.surface as usize][side_index(face.side)] = Some(Grid::new(&mesh, face));
        }
        Self { grids }
    }

    fn grid(&self, surface: u32, side: Side) -> Option<&Grid<'a>> {
        self.grids.get(surface as usize)?[side_index(side)].as_ref()
    }

    /// The face on one side of a surface; `None` when the mesh has none.
    #[must_use]
    pub fn face(&self, surface: u32, side: Side) -> Option<&'a Face> {
        Some(self.grid(surface, side)?.face)
    }

    /// The element that holds a point of a face, or the nearest; `None` where there are none.
    #[must_use]
    pub fn element(&self, surface: u32, side: Side, position: Vec3) -> Option<u32> {
        let grid = self.grid(surface, side)?;
        if grid.element_count == 0 {
            return None;
        }
        let at = grid.parameters(position);
        let cell = if grid.is_triangle {
            triangle_cell(at, grid.columns)
        } else {
            let column = cell_of(at.x, grid.columns);
            cell_of(at.y, grid.rows) * grid.columns + column
        };
        Some(grid.first_element + cell.min(grid.element_count - 1))
    }
}

impl<'a> Grid<'a> {
    fn new(mesh: &Mesh<'a>, face: &'a Face) -> Self {
        let range = face.element_range();
        let elements = mesh.elements.get(range.start as usize..range.end as usize);
        let first = elements.and_then(<[_]>::first);
        let parts = first.map_or(Vec2::ONE, |element| (element.to - element.from).recip());
        let parameters = span(&face.polygon).map(|corners| {
            let corners = corners.map(Vec3::as_dvec3);
            let [origin, ..] = corners;
            parameter_gradients(corners).map(|gradient| Linear::new(gradient, origin, 0.0))
        });
        Self {
            face,
            parameters,
            is_triangle: face.polygon.is_triangle(),
            first_element: face.first_element,
            element_count: face.element_count,
            columns: parts.x.round() as u32,
            rows: parts.y.round() as u32,
        }
    }

    fn parameters(&self, position: Vec3) -> Vec2 {
        match self.parameters {
            Some([s, t]) => Vec2::new(s.at(position), t.at(position)),
            None => self.face.polygon.parameters(position),
        }
    }
}

const fn side_index(side: Side) -> usize {
    match side {
        Side::Front => 0,
        Side::Back => 1,
    }
}

/// Cell of a parameter, the first or last where it lies outside.
fn cell_of(parameter: f32, cells: u32) -> u32 {
    ((parameter * cells as f32).max(0.0) as u32).min(cells.saturating_sub(1))
}

/// Number of the triangle that holds a point, among `side * side`, row by row.
fn triangle_cell(at: Vec2, side: u32) -> u32 {
    let at = at.max(Vec2::ZERO);
    let at = at / at.element_sum().max(1.0);
    let row = cell_of(at.y, side);
    let columns = side - row;
    let along = at * side as f32 - Vec2::new(0.0, row as f32);
    let column = (along.x.max(0.0) as u32).min(columns - 1);
    let points_down = along.x - column as f32 + along.y > 1.0 && column + 1 < columns;
    row * (2 * side - row) + 2 * column + u32::from(points_down)
}

#[cfg(test)]
mod tests {
    use super::super::OwnedMesh;
    use super::*;
    use relume::color::Rgb;
    use relume::mesh::{Spacing, subdivide};
    use relume::scene::{Scene, Surface};

    #[test]
    fn every_element_is_found_at_its_centre() {
        let outlines: [&[Vec3]; 3] = [
            &[
                Vec3::ZERO,
                Vec3::X * 3.0,
                Vec3::new(3.0, 2.0, 0.0),
                Vec3::Y * 2.0,
            ],
            &[Vec3::ZERO, Vec3::X * 3.0, Vec3::new(1.0, 2.0, 0.5)],
            &[Vec3::ZERO, Vec3::X * 3.0, Vec3::new(2.0, 2.0, 0.0), Vec3::Y],
        ];
        for outline in outlines {
            let surface = Surface::new(0, outline, Rgb::splat(0.5))
                .unwrap()
                .two_sided();
            let surfaces = [surface];
            let scene = Scene::new(&surfaces, &[], 1).unwrap();
            let mut mesh = OwnedMesh::default();
            let spacing = Spacing {
                patch: 1.1,
                element: 0.3,
            };
            subdivide(&scene, spacing, |_, _| true, &mut mesh).unwrap();
            let mesh = mesh.view();
            let locator = Locator::new(mesh);
            for (element, id) in mesh.elements.iter().zip(0..) {
                let side = mesh.element_face(element).unwrap().side;
                let centre = mesh.element_polygon(element).unwrap().center();
                assert_eq!(locator.element(0, side, centre), Some(id), "{outline:?}");
            }
        }
    }
}
