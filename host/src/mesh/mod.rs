//! Meshing on the host: spacing from the scene's size, faces that light reaches, textures.

mod centre;
mod locate;
mod reach;

mod cut;
mod split;
mod spread;

use std::ops::ControlFlow;

use relume::mesh::{
    Counts, Element, Face, Mesh, MeshError, MeshSink, Patch, Side, Spacing, element_count,
    subdivide,
};
use relume::scene::Scene;
use thiserror::Error;

use crate::bvh::Bvh;
use crate::scene::OwnedScene;

pub use centre::{Centred, centred, placed};
pub use cut::cut;
pub use locate::Locator;
pub use split::{Direct, Split, split};
pub use spread::{Place, spread};

/// Elements that the default spacing aims at.
const DEFAULT_ELEMENTS: f32 = 8000.0;

/// Elements, both sides counted, above which the default spacing gives way.
const MOST_DEFAULT_ELEMENTS: u64 = 40_000;

/// Elements along the edge of a patch, by default.
const ELEMENTS_PER_PATCH_EDGE: f32 = 4.0;

/// Most faces, patches and elements that are built; their ids would be good for more, memory not.
const LIMIT: usize = 1 << 25;

/// A mesh that owns its parts.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OwnedMesh {
    /// The faces.
    pub faces: Vec<Face>,
    /// The patches.
    pub patches: Vec<Patch>,
    /// The elements.
    pub elements: Vec<Element>,
}

impl OwnedMesh {
    /// The solver's view of it.
    #[must_use]
    pub fn view(&self) -> Mesh<'_> {
        Mesh {
            faces: &self.faces,
            patches: &self.patches,
            elements: &self.elements,
        }
    }
}

fn push<T>(list: &mut Vec<T>, item: T, full: MeshError) -> Result<(), MeshError> {
    if list.len() >= LIMIT {
        return Err(full);
    }
    list.push(item);
    Ok(())
}

impl MeshSink for OwnedMesh {
    fn face(&mut self, face: Face) -> Result<(), MeshError> {
        push(
            &mut self.faces,
            face,
            MeshError::TooManyFaces { limit: LIMIT },
        )
    }

    fn patch(&mut self, patch: Patch) -> Result<(), MeshError> {
        let full = MeshError::TooManyPatches { limit: LIMIT };
        push(&mut self.patches, patch, full)
    }

    fn element(&mut self, element: Element) -> Result<(), MeshError> {
        let full = MeshError::TooManyElements { limit: LIMIT };
        push(&mut self.elements, element, full)
    }
}

/// Spacing from the scene's size, where the user gave none.
///
/// Elements: an edge of `sqrt(A / 8000)`, with `A` the area of all reflecting surfaces, one side
/// each, so that 8000 squares would cover them; slender triangles and small polygons make it more,
/// so while there are over 40 000, both sides counted, the edge is lengthened by `sqrt 2`, as long as
/// that saves a tenth of them. Patches: four elements long.
#[must_use]
pub fn spacing(scene: &Scene, patch: Option<f32>, element: Option<f32>) -> Spacing {
    let of_element = |element: f32| Spacing {
        patch: patch.unwrap_or(element * ELEMENTS_PER_PATCH_EDGE),
        element,
    };
    if let Some(element) = element.or(patch.map(|length| length / ELEMENTS_PER_PATCH_EDGE)) {
        return of_element(element);
    }
    let area: f32 = scene
        .surfaces()
        .iter()
        .filter(|surface| !surface.reflectance().is_black())
        .map(|surface| surface.polygon().area())
        .sum();
    // A scene of lamps alone has no elements to size.
    let area = if area > 0.0 {
        area
    } else {
        scene.diagonal().powi(2)
    };
    let mut chosen = of_element((area / DEFAULT_ELEMENTS).sqrt());
    let mut count = count(scene, chosen);
    while count > MOST_DEFAULT_ELEMENTS && chosen.element < scene.diagonal() {
        let longer = of_element(chosen.element * std::f32::consts::SQRT_2);
        let fewer = self::count(scene, longer);
        if fewer != u64::MAX && fewer > count - count / 10 {
            break;
        }
        (chosen, count) = (longer, fewer);
    }
    chosen
}

/// How many elements a division makes, both sides of everything counted; without end when an edge
/// would be cut too often.
fn count(scene: &Scene, spacing: Spacing) -> u64 {
    element_count(scene, spacing).unwrap_or(u64::MAX)
}

/// Why there is no mesh.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum BuildError {
    /// The scene cannot be divided so.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// The watcher broke.
    #[error("interrupted")]
    Interrupted,
}

/// Divides the scene; faces that no light reaches are left out before anything is numbered.
///
/// The search for them can take seconds. `watch` is told how many parts of the scene it has looked at,
/// and how many there are; when it breaks, there is no mesh.
///
/// # Errors
/// [`BuildError`]: as [`subdivide`] reports it, or interrupted.
pub fn build(
    scene: &OwnedScene,
    view: &Scene,
    spacing: Spacing,
    bvh: &Bvh,
    watch: &mut dyn FnMut(usize, usize) -> ControlFlow<()>,
) -> Result<OwnedMesh, BuildError> {
    let reached = reach::reached_faces(view, spacing, bvh, watch)?;
    let mut mesh = OwnedMesh::default();
    let keep = |surface: u32, side: Side| reached.contains(surface, side);
    let _: Counts = subdivide(view, spacing, keep, &mut mesh)?;
    apply_textures(scene, &mut mesh);
    Ok(mesh)
}

/// Gives the elements of textured faces the mean reflectance of their own part of the texture.
fn apply_textures(scene: &OwnedScene, mesh: &mut OwnedMesh) {
    for face in &mesh.faces {
        let texture = scene.textures.get(face.surface as usize);
        let Some(texture) = texture.and_then(Option::as_ref) else {
            continue;
        };
        let texture = match face.side {
            Side::Front => texture.clone(),
            Side::Back => texture.flipped(),
        };
        let range = face.element_range();
        let own = mesh
            .elements
            .get_mut(range.start as usize..range.end as usize);
        for element in own.unwrap_or_default() {
            element.reflectance = texture.mean_over(element.from, element.to);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;
    use relume::color::Rgb;
    use relume::scene::{Emission, Falloff, Luminaire, Source, Surface};

    fn surface(vertices: [Vec3; 4], reflectance: f32) -> Surface {
        Surface::new(0, &vertices, Rgb::splat(reflectance)).unwrap()
    }

    fn built(scene: &OwnedScene, view: &Scene, spacing: Spacing) -> OwnedMesh {
        let mut go_on = |_, _| ControlFlow::Continue(());
        build(scene, view, spacing, &Bvh::for_scene(view), &mut go_on).unwrap()
    }

    /// Walls of the box from -size to size around `at`, all facing inwards.
    fn walls(at: Vec3, size: f32) -> Vec<[Vec3; 4]> {
        [Vec3::X, Vec3::Y, Vec3::Z]
            .into_iter()
            .flat_map(|axis| [axis, -axis])
            .map(|out| {
                let (u, v) = out.any_orthonormal_pair();
                let corners = [out - u - v, out - u + v, out + u + v, out + u - v];
                let inwards = (corners[1] - corners[0])
                    .cross(corners[2] - corners[0])
                    .dot(out)
                    < 0.0;
                let corners = corners.map(|corner| at + corner * size);
                if inwards {
                    corners
                } else {
                    let [a, b, c, d] = corners;
                    [a, d, c, b]
                }
            })
            .collect()
    }

    /// A closed room with a floating box in each octant, lit by one narrow spot.
    #[test]
    fn a_small_pool_of_light_reaches_every_open_side_and_no_closed_one() {
        let octants = (0..8).map(|i| {
            let sign = |bit: i32| if i >> bit & 1 == 0 { -1.0 } else { 1.0 };
            Vec3::new(sign(0), sign(1), sign(2)) * 1.1
        });
        let boxes = octants.flat_map(|at| walls(at, 0.3));
        let surfaces: Vec<Surface> = walls(Vec3::ZERO, 2.0)
            .into_iter()
            .chain(boxes)
            .map(|wall| surface(wall, 0.7).two_sided())
            .collect();
        let scene = OwnedScene {
            surfaces,
            ..OwnedScene::default()
        };
        for outer in [0.015, 0.09, 1.0] {
            let source = Source::Spot {
                position: Vec3::new(0.1, 1.7, 0.2),
                direction: -Vec3::Y,
                inner: 0.0,
                outer,
                falloff: Falloff::Smooth,
            };
            let spot = [Luminaire::new(0, Rgb::WHITE, source).unwrap()];
            let view = Scene::new(&scene.surfaces, &spot, 1).unwrap();
            let spacing = super::spacing(&view, None, None);
            let mesh = built(&scene, &view, spacing);
            // Walls face inwards: fronts of the room and backs of the boxes are lit.
            let found: Vec<(u32, Side)> = mesh.faces.iter().map(|f| (f.surface, f.side)).collect();
            let room = (0..6).map(|surface| (surface, Side::Front));
            let boxes = (6..54).map(|surface| (surface, Side::Back));
            assert_eq!(
                found,
                room.chain(boxes).collect::<Vec<_>>(),
                "outer {outer}"
            );
        }
    }

    /// A two-sided room with a small lamp and a closed box inside: only the room's inside and the
    /// box's outside are lit.
    #[test]
    fn faces_that_no_light_reaches_are_dropped() {
        let mut surfaces: Vec<Surface> = walls(Vec3::ZERO, 2.0)
            .into_iter()
            .chain(walls(Vec3::new(0.5, -1.0, 0.3), 0.4))
            .map(|wall| surface(wall, 0.5).two_sided())
            .collect();
        let lamp = [(0.0, 0.0), (0.1, 0.0), (0.1, 0.1), (0.0, 0.1)];
        let lamp = lamp.map(|(x, z)| Vec3::new(x, 1.9, z));
        let emission = Emission {
            light: 0,
            share: Rgb::WHITE,
        };
        surfaces.push(surface(lamp, 0.0).emitting(12, emission).unwrap());
        let scene = OwnedScene {
            surfaces,
            ..OwnedScene::default()
        };
        let view = Scene::new(&scene.surfaces, &[], 1).unwrap();
        let spacing = Spacing {
            patch: 1.0,
            element: 0.5,
        };
        let mesh = built(&scene, &view, spacing);
        let faces: Vec<(u32, Side)> = mesh.faces.iter().map(|f| (f.surface, f.side)).collect();
        let expected: Vec<(u32, Side)> = (0..6)
            .map(|i| (i, Side::Front))
            .chain((6..12).map(|i| (i, Side::Back)))
            .chain([(12, Side::Front)])
            .collect();
        assert_eq!(faces, expected);
    }

    /// A floor and a wall under lamps of any size and number: the default mesh of what is lit does not
    /// depend on them, and lamps have a bounded number of patches.
    #[test]
    fn lamps_larger_than_the_room_leave_its_mesh_alone() {
        let floor = [(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)];
        let floor = floor.map(|(x, y)| Vec3::new(x, y, 0.0));
        let wall = [(0.0, 0.0), (0.0, 3.0), (4.0, 3.0), (4.0, 0.0)];
        let wall = wall
            .map(|(x, z)| Vec3::new(x, 4.0, z))
            .map(|v| v - Vec3::Y * 4.0);
        let emission = Emission {
            light: 0,
            share: Rgb::WHITE,
        };
        let mut meshes = [(1.0, 1), (100.0, 1), (1e4, 1), (0.25, 64), (0.01, 1024)]
            .into_iter()
            .map(|(size, rows): (f32, i32)| {
                let lamp = |i: i32| {
                    let at = Vec3::new(i as f32 * 0.02, i as f32 * 0.01, 10.0);
                    let corners = [(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)];
                    let corners = corners.map(|(x, y)| at + Vec3::new(x, y, 0.0) * size / 2.0);
                    surface(corners, 0.0).emitting(0, emission).unwrap()
                };
                let room = [surface(floor, 0.5), surface(wall, 0.5)];
                let scene = OwnedScene {
                    surfaces: room.into_iter().chain((0..rows).map(lamp)).collect(),
                    ..OwnedScene::default()
                };
                let view = Scene::new(&scene.surfaces, &[], 1).unwrap();
                let spacing = super::spacing(&view, None, None);
                let mesh = built(&scene, &view, spacing);
                let of_lamps = mesh.patches.iter().filter(|patch| patch.face > 1);
                let of_lamps = of_lamps.count();
                assert!(of_lamps <= 1024 + rows as usize, "{size}: {of_lamps}");
                (spacing, mesh.elements)
            });
        let first = meshes.next().unwrap();
        assert!(first.1.len() > 6000);
        assert!(meshes.all(|mesh| mesh == first));
    }
}
