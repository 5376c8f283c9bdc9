//! From an atlas back to the solution that it still holds.

use relume::atlas::Atlas;
use relume::color::Rgb;
use relume::geometry::Polygon;
use relume::mesh::{Element, Face, Patch};
use relume::relight::{DecodeTable, table_length};
use thiserror::Error;

use crate::mesh::OwnedMesh;
use crate::solution::Solution;

/// Most contributions that are unpacked: 3 GiB of them. Dark tiles take next to no bytes, so that a small file may
/// promise any number.
const MOST: usize = 1 << 28;

/// An atlas is larger than memory once it is unpacked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error(
    "{elements} elements times {lights} lights are more than the {MOST} contributions that are unpacked; pack fewer of them"
)]
pub struct TooLarge {
    /// How many elements the atlas has.
    pub elements: u32,
    /// How many lights it has.
    pub lights: u32,
}

/// All contributions, element by element, light by light.
///
/// # Errors
/// [`TooLarge`].
pub fn contributions(atlas: &Atlas) -> Result<Vec<Rgb>, TooLarge> {
    let lights = atlas.light_count() as usize;
    let too_large = TooLarge {
        elements: atlas.element_count(),
        lights: atlas.light_count(),
    };
    let count = lights.checked_mul(atlas.element_count() as usize);
    let count = count.filter(|count| *count <= MOST);
    let contributions = count.and_then(|count| filled(count, Rgb::BLACK));
    let mut contributions = contributions.ok_or(too_large)?;
    let mut values = filled(table_length(atlas), 0.0).ok_or(too_large)?;
    let table = DecodeTable::new(atlas, &mut values).map_err(|_| too_large)?;
    atlas.for_each(|element, light, codes| {
        contributions[element as usize * lights + light as usize] = table.decode(light, codes);
    });
    Ok(contributions)
}

/// So many copies of a value; `None` when there is no memory for them.
fn filled<T: Copy>(count: usize, value: T) -> Option<Vec<T>> {
    let mut values = Vec::new();
    values.try_reserve_exact(count).ok()?;
    values.resize(count, value);
    Some(values)
}

/// The solution that an atlas still holds: decoded contributions and, if it carries one, the mesh,
/// with one patch per face.
///
/// # Errors
/// [`TooLarge`].
pub fn unpack(atlas: &Atlas) -> Result<Solution, TooLarge> {
    let contributions = contributions(atlas)?;
    let (surfaces, mesh) = unpack_mesh(atlas);
    let lights = atlas
        .lights()
        .map(|light| (light.name.to_owned(), light.emission));
    Ok(Solution {
        surfaces,
        mesh,
        image: atlas.image_size(),
        ..Solution::from_contributions(lights, contributions)
    })
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

#[cfg(test)]
mod tests {
    use super::*;
    use relume::atlas::{Contents, LightEntry, Quantity, size, write};
    use relume::code::{Code, Curve, Scale};

    /// A grid of 1024 x 1024 dark elements: 4096 tiles, all of which begin where the bits end.
    #[test]
    fn an_atlas_that_memory_cannot_hold_is_refused() {
        let side = 1024_u16.to_le_bytes();
        let light = LightEntry {
            name: "",
            emission: Rgb::WHITE,
            code: Code::Tiles,
            curves: [Curve::display(Scale::ONE, 1.0).unwrap(); 3],
            last: [255; 3],
        };
        let with = |lights: usize| {
            let mut tiles = vec![16, 4, 0, 0, 1, 0, 0, 0, 0, 16, 0, 0];
            tiles.extend((0..lights).map(|light| light as u8));
            tiles.extend(side.into_iter().chain(side));
            tiles.extend([0; 4 * 4096]);
            let contents = Contents {
                quantity: Quantity::Irradiance,
                lights: &vec![light; lights],
                elements: 1 << 20,
                image_width: 0,
                errors: None,
                tiles: &tiles,
                mesh: None,
            };
            let mut bytes = vec![0; size(&contents).unwrap()];
            write(&contents, |_, _| Rgb::BLACK, &mut bytes).unwrap();
            contributions(&Atlas::parse(&bytes).unwrap())
        };
        assert_eq!(with(1), Ok(vec![Rgb::BLACK; 1 << 20]));
        let (elements, lights) = (1 << 20, 257);
        let refused = with(lights as usize).unwrap_err();
        assert_eq!(refused, TooLarge { elements, lights });
    }
}
