//! From an atlas back to the solution that it still holds.

use relume::atlas::Atlas;
use relume::color::Rgb;
use relume::geometry::Polygon;
use relume::mesh::{Element, Face, Patch, Spacing};
use relume::relight::{DecodeTable, table_length};

use crate::mesh::OwnedMesh;
use crate::solution::{Method, Solution, SolutionLight};

/// All contributions, element by element, light by light.
#[must_use]
pub fn contributions(atlas: &Atlas) -> Vec<Rgb> {
    let lights = atlas.light_count() as usize;
    let mut values = vec![0.0; table_length(atlas)];
    let mut contributions = vec![Rgb::BLACK; atlas.element_count() as usize * lights];
    let Ok(table) = DecodeTable::new(atlas, &mut values) else {
        return contributions;
    };
    atlas.for_each(|element, light, codes| {
        contributions[element as usize * lights + light as usize] = table.decode(light, codes);
    });
    contributions
}

/// The solution that an atlas still holds: decoded contributions and, if it carries one, the mesh,
/// with one patch per face.
#[must_use]
pub fn unpack(atlas: &Atlas) -> Solution {
    let (surfaces, mesh) = unpack_mesh(atlas);
    Solution {
        surfaces,
        luminaires: Vec::new(),
        mesh,
        lights: atlas
            .lights()
            .map(|light| SolutionLight {
                name: light.name.to_owned(),
                emission: light.emission,
                residual: f32::NAN,
                error: f32::NAN,
            })
            .collect(),
        contributions: contributions(atlas),
        direct: None,
        method: Method::default(),
        rows: 0,
        spacing: Spacing {
            patch: f32::NAN,
            element: f32::NAN,
        },
    }
}

fn unpack_mesh(atlas: &Atlas) -> (Vec<Polygon>, OwnedMesh) {
    let Some(stored) = atlas.mesh() else {
        return (Vec::new(), OwnedMesh::default());
    };
    let surfaces = (0..stored.surface_count()).filter_map(|s| stored.surface(s));
    let stored_elements: Vec<_> = (0..stored.element_count())
        .filter_map(|element| stored.element(element))
        .collect();
    let mut mesh = OwnedMesh::default();
    let mut first_element = 0;
    for (face, number) in (0..stored.face_count())
        .filter_map(|f| stored.face(f))
        .zip(0..)
    {
        let own = stored_elements[first_element..]
            .iter()
            .take_while(|element| element.face == number);
        let element_count = own.count();
        mesh.faces.push(Face {
            surface: face.surface,
            side: face.side,
            polygon: face.polygon,
            emission: face.emission,
            first_element: first_element as u32,
            element_count: element_count as u32,
        });
        mesh.patches.push(Patch {
            face: number,
            from: glam::Vec2::ZERO,
            to: glam::Vec2::ONE,
            area: face.polygon.area(),
        });
        first_element += element_count;
    }
    for element in &stored_elements {
        let outline = mesh.faces[element.face as usize].polygon;
        mesh.elements.push(Element {
            patch: element.face,
            from: element.from,
            to: element.to,
            area: outline.part(element.from, element.to).area(),
            reflectance: element.reflectance,
        });
    }
    (surfaces.collect(), mesh)
}
