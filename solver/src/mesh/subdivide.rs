//! Division of every polygon into equal parts: grids on quads, similar triangles on triangles.

use core::f32::consts::SQRT_2;

use glam::Vec2;

use super::{Element, Face, MeshError, MeshSink, Patch, Side};
use crate::geometry::Polygon;
use crate::math;
use crate::scene::{Scene, Surface};

/// Patches, more than there are black lamps, into which all black lamps together are cut.
const MOST_LAMP_PATCHES: u64 = 1024;

/// Longest edges that a division aims at, in m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spacing {
    /// Longest edge of a patch; lamps of reflectance 0 may have longer ones, see [`subdivide`].
    pub patch: f32,
    /// Longest edge of an element.
    pub element: f32,
}

/// What a division needs or made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Faces.
    pub faces: u32,
    /// Patches.
    pub patches: u32,
    /// Elements.
    pub elements: u32,
}

/// Divides every face for which `keep(surface, side)` holds into patches and elements.
///
/// The front of every surface is a face, the back of every two-sided one another; a face that
/// neither reflects nor emits has no patches. Lamps of reflectance 0 receive nothing, and a lamp may
/// be a thousand times larger than the room that it lights: while all of them together would have
/// over 1024 patches more than there are lamps, their patches are lengthened by `sqrt 2`.
///
/// # Errors
/// [`MeshError`]: a bad spacing, an edge that would be cut too often, or full storage.
pub fn subdivide(
    scene: &Scene,
    spacing: Spacing,
    keep: impl Fn(u32, Side) -> bool,
    sink: &mut impl MeshSink,
) -> Result<Counts, MeshError> {
    for length in [spacing.patch, spacing.element] {
        if !(length.is_finite() && length > 0.0) {
            return Err(MeshError::Spacing);
        }
    }
    let mut counts = Counts::default();
    let lamp_patch = lamp_patch(scene, spacing.patch);
    for (surface, index) in scene.surfaces().iter().zip(0..) {
        let own = if surface.reflectance().is_black() {
            let length = surface.emission().map_or(f32::INFINITY, |_| lamp_patch);
            Spacing {
                patch: length,
                element: length,
            }
        } else {
            spacing
        };
        for side in [Side::Front, Side::Back] {
            if is_face(surface, side) && keep(index, side) {
                subdivide_face(surface, index, side, own, &mut counts, sink)?;
            }
        }
    }
    Ok(counts)
}

fn is_black_lamp(surface: &Surface) -> bool {
    surface.emission().is_some() && surface.reflectance().is_black()
}

/// Longest edge of a patch of the black lamps, where that of other patches is `patch`.
fn lamp_patch(scene: &Scene, patch: f32) -> f32 {
    let surfaces = scene.surfaces().iter();
    let lamps = surfaces.filter(|s| is_black_lamp(s)).map(Surface::polygon);
    let most = MOST_LAMP_PATCHES + lamps.clone().count() as u64;
    let longest = lamps.clone().map(Polygon::longest_edge).fold(0.0, f32::max);
    let count = |length: f32| {
        let grids = lamps.clone().map(|lamp| {
            let grid = Grid::new(lamp, 1, length);
            grid.map_or(u64::from(u32::MAX), |g| g.cells(lamp.is_triangle()).into())
        });
        grids.sum::<u64>()
    };
    let mut length = patch;
    while length < longest && count(length) > most {
        length *= SQRT_2;
    }
    length
}

/// How many elements [`subdivide`] would make of all faces, without making them.
///
/// # Errors
/// [`MeshError::TooFine`].
pub fn element_count(scene: &Scene, spacing: Spacing) -> Result<u64, MeshError> {
    let mut count = 0_u64;
    for (surface, index) in scene.surfaces().iter().zip(0..) {
        if surface.reflectance().is_black() {
            continue;
        }
        let polygon = surface.polygon();
        let too_fine = MeshError::TooFine { surface: index };
        let elements = Grid::new(polygon, 1, spacing.patch)
            .and_then(|patches| patches.refined(polygon, spacing.element))
            .ok_or(too_fine)?;
        let sides = if surface.is_two_sided() { 2 } else { 1 };
        count += sides * u64::from(elements.cells(polygon.is_triangle()));
    }
    Ok(count)
}

/// True for the front of every surface, and for the back of a two-sided one.
#[must_use]
pub fn is_face(surface: &Surface, side: Side) -> bool {
    side == Side::Front || surface.is_two_sided()
}

fn subdivide_face(
    surface: &Surface,
    index: u32,
    side: Side,
    spacing: Spacing,
    counts: &mut Counts,
    sink: &mut impl MeshSink,
) -> Result<(), MeshError> {
    let (polygon, emission) = match side {
        Side::Front => (*surface.polygon(), surface.emission()),
        Side::Back => (surface.polygon().flipped(), None),
    };
    let too_fine = MeshError::TooFine { surface: index };
    let patches = Grid::new(&polygon, 1, spacing.patch).ok_or(too_fine)?;
    let elements = patches.refined(&polygon, spacing.element).ok_or(too_fine)?;

    let reflectance = surface.reflectance();
    let element_count = if reflectance.is_black() {
        0
    } else {
        elements.cells(polygon.is_triangle())
    };
    sink.face(Face {
        surface: index,
        side,
        polygon,
        emission,
        first_element: counts.elements,
        element_count,
    })?;
    counts.faces += 1;
    if element_count == 0 && emission.is_none() {
        return Ok(());
    }
    let first_patch = counts.patches;
    for (from, to) in cells(patches, polygon.is_triangle()) {
        sink.patch(Patch {
            face: counts.faces - 1,
            from,
            to,
            area: polygon.part(from, to).area(),
        })?;
        counts.patches += 1;
    }
    if element_count == 0 {
        return Ok(());
    }
    for (from, to) in cells(elements, polygon.is_triangle()) {
        sink.element(Element {
            patch: first_patch + patches.cell_at(from, to, polygon.is_triangle()),
            from,
            to,
            area: polygon.part(from, to).area(),
            reflectance: reflectance.get(),
        })?;
        counts.elements += 1;
    }
    Ok(())
}

/// How often the two parameter directions of a polygon are divided.
#[derive(Clone, Copy)]
struct Grid {
    s: u32,
    t: u32,
}

impl Grid {
    /// Divides each direction by `ceil(edge / length)`, in multiples of `base`.
    fn new(polygon: &Polygon, base: u32, length: f32) -> Option<Self> {
        let square = Self { s: base, t: base };
        square.refined(polygon, length)
    }

    /// Divides each cell further, so that its edges get no longer than `length`.
    fn refined(self, polygon: &Polygon, length: f32) -> Option<Self> {
        let (edge_s, edge_t) = match *polygon.vertices() {
            [a, b, c, d] => (
                (b - a).length().max((c - d).length()),
                (d - a).length().max((c - b).length()),
            ),
            _ => (polygon.longest_edge(), polygon.longest_edge()),
        };
        Some(Self {
            s: self.s.checked_mul(parts(edge_s / self.s as f32, length)?)?,
            t: self.t.checked_mul(parts(edge_t / self.t as f32, length)?)?,
        })
        .filter(|grid| grid.s <= u16::MAX.into() && grid.t <= u16::MAX.into())
    }

    /// Number of cells.
    fn cells(self, is_triangle: bool) -> u32 {
        if is_triangle {
            self.s * self.s
        } else {
            self.s * self.t
        }
    }

    /// Number of the cell that holds the cell of a finer grid.
    fn cell_at(self, from: Vec2, to: Vec2, is_triangle: bool) -> u32 {
        let size = Vec2::new(self.s as f32, self.t as f32);
        if !is_triangle {
            let middle = (from + to) * 0.5 * size;
            return middle.y as u32 * self.s + middle.x as u32;
        }
        let centroid = (from + (to - from) / 3.0) * size;
        let (column, row) = (centroid.x as u32, centroid.y as u32);
        let points_down = centroid.x - column as f32 + centroid.y - row as f32 > 1.0;
        row * (2 * self.s - row) + 2 * column + u32::from(points_down)
    }
}

/// `ceil(edge / length)`, at least 1; a ten-thousandth over a whole number is rounding.
fn parts(edge: f32, length: f32) -> Option<u32> {
    let parts = math::ceil(edge / length - 1e-4).max(1.0);
    (parts <= f32::from(u16::MAX)).then_some(parts as u32)
}

/// The parameter corners of all cells of a grid, in the order in which they are numbered.
fn cells(grid: Grid, is_triangle: bool) -> impl Iterator<Item = (Vec2, Vec2)> {
    let corner =
        move |s: u32, t: u32| Vec2::new(s as f32 / grid.s as f32, t as f32 / grid.t as f32);
    (0..grid.t).flat_map(move |t| {
        let columns = if is_triangle {
            2 * (grid.s - t) - 1
        } else {
            grid.s
        };
        (0..columns).map(move |column| {
            if !is_triangle {
                return (corner(column, t), corner(column + 1, t + 1));
            }
            let s = column / 2;
            if column % 2 == 0 {
                (corner(s, t), corner(s + 1, t + 1))
            } else {
                (corner(s + 1, t + 1), corner(s, t))
            }
        })
    })
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::super::MeshStorage;
    use super::*;
    use crate::color::Rgb;
    use crate::scene::Emission;
    use glam::Vec3;
    use std::vec;

    const SQUARE: [Vec3; 4] = [
        Vec3::ZERO,
        Vec3::new(3.0, 0.0, 0.0),
        Vec3::new(3.0, 2.0, 0.0),
        Vec3::new(0.0, 2.0, 0.0),
    ];

    fn surface(vertices: &[Vec3]) -> Surface {
        Surface::new(0, vertices, Rgb::splat(0.5)).unwrap()
    }

    const SPACING: Spacing = Spacing {
        patch: 1.0,
        element: 0.5,
    };

    #[test]
    fn a_quad_is_numbered_along_its_first_edge() {
        let surfaces = [surface(&SQUARE)];
        let scene = Scene::new(&surfaces, &[], 1).unwrap();
        let mut storage = MeshStorage::<1, 6, 24>::new();
        let counts = subdivide(&scene, SPACING, |_, _| true, &mut storage).unwrap();
        assert_eq!((counts.faces, counts.patches, counts.elements), (1, 6, 24));

        let mesh = storage.mesh();
        let centre = |e: usize| mesh.element_polygon(&mesh.elements[e]).unwrap().center();
        assert_eq!(centre(0), Vec3::new(0.25, 0.25, 0.0));
        assert_eq!(centre(1), Vec3::new(0.75, 0.25, 0.0));
        assert_eq!(centre(6), Vec3::new(0.25, 0.75, 0.0));
        let patches: std::vec::Vec<u32> = mesh.elements[..12].iter().map(|e| e.patch).collect();
        assert_eq!(patches, vec![0, 0, 1, 1, 2, 2, 0, 0, 1, 1, 2, 2]);
    }

    #[test]
    fn elements_lie_inside_their_patches_and_tile_them() {
        let surfaces = [surface(&SQUARE), surface(&SQUARE[..3])];
        let scene = Scene::new(&surfaces, &[], 1).unwrap();
        let mut storage = MeshStorage::<2, 64, 512>::new();
        subdivide(&scene, SPACING, |_, _| true, &mut storage).unwrap();
        let mesh = storage.mesh();
        for (patch, id) in mesh.patches.iter().zip(0..) {
            let own = mesh.elements.iter().filter(|e| e.patch == id);
            let sum: f32 = own.clone().map(|e| e.area).sum();
            assert!(
                (sum - patch.area).abs() < 1e-5,
                "patch {id}: {sum} {}",
                patch.area
            );
            let outline = mesh.patch_polygon(id).unwrap();
            for element in own {
                let centre = mesh.element_polygon(element).unwrap().center();
                let ends = [centre + Vec3::Z, centre - Vec3::Z];
                assert!(
                    outline.crossing(ends[0], ends[1]).is_some(),
                    "patch {id} {element:?}"
                );
            }
        }
    }

    #[test]
    fn full_storage_names_its_limit() {
        let surfaces = [surface(&SQUARE)];
        let scene = Scene::new(&surfaces, &[], 1).unwrap();
        let all = |_, _| true;
        assert_eq!(
            subdivide(&scene, SPACING, all, &mut MeshStorage::<1, 6, 23>::new()),
            Err(MeshError::TooManyElements { limit: 23 })
        );
        assert_eq!(
            subdivide(&scene, SPACING, all, &mut MeshStorage::<1, 5, 24>::new()),
            Err(MeshError::TooManyPatches { limit: 5 })
        );
        assert_eq!(
            subdivide(&scene, SPACING, all, &mut MeshStorage::<0, 6, 24>::new()),
            Err(MeshError::TooManyFaces { limit: 0 })
        );
        let fine = Spacing {
            patch: 1.0,
            element: 1e-6,
        };
        assert_eq!(
            subdivide(&scene, fine, all, &mut MeshStorage::<1, 6, 24>::new()),
            Err(MeshError::TooFine { surface: 0 })
        );
        for patch in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            let spacing = Spacing {
                patch,
                element: 1.0,
            };
            assert_eq!(
                subdivide(&scene, spacing, all, &mut MeshStorage::<1, 6, 24>::new()),
                Err(MeshError::Spacing),
                "{patch}"
            );
        }
    }

    #[test]
    fn two_sides_and_lamps() {
        let lamp = surface(&SQUARE)
            .emitting(
                0,
                Emission {
                    light: 0,
                    share: Rgb::WHITE,
                },
            )
            .unwrap();
        let black_lamp = Surface::new(1, &SQUARE, Rgb::BLACK)
            .and_then(|s| s.two_sided().emitting(1, lamp.emission().unwrap()))
            .unwrap();
        let surfaces = [lamp.two_sided(), black_lamp];
        let scene = Scene::new(&surfaces, &[], 1).unwrap();
        let mut storage = MeshStorage::<8, 64, 128>::new();
        let counts = subdivide(&scene, SPACING, |_, _| true, &mut storage).unwrap();
        assert_eq!((counts.faces, counts.patches, counts.elements), (4, 18, 48));
        let mesh = storage.mesh();
        assert!(mesh.faces[0].emission.is_some());
        assert_eq!(mesh.faces[1].side, Side::Back);
        assert!(mesh.faces[1].emission.is_none());
        assert_eq!(
            (mesh.faces[2].element_count, mesh.faces[3].element_count),
            (0, 0)
        );
    }

    #[test]
    fn a_lamp_of_any_size_and_shape_has_a_bounded_number_of_patches() {
        let shapes: [[Vec3; 4]; 3] = [
            SQUARE.map(|v| v * 1e2),
            SQUARE.map(|v| v * 1e6),
            SQUARE.map(|v| v * Vec3::new(1e5, 1.0, 1.0)),
        ];
        for shape in shapes {
            for count in [3, 4] {
                let emission = Emission {
                    light: 0,
                    share: Rgb::WHITE,
                };
                let lamp = Surface::new(1, &shape[..count], Rgb::BLACK)
                    .and_then(|lamp| lamp.emitting(1, emission))
                    .unwrap();
                let small = Surface::new(2, &SQUARE, Rgb::BLACK)
                    .and_then(|lamp| lamp.emitting(2, emission))
                    .unwrap();
                let surfaces = [surface(&SQUARE), lamp, small];
                let scene = Scene::new(&surfaces, &[], 1).unwrap();
                let patches = |keep: u32| {
                    let mut storage = MeshStorage::<3, 2048, 24>::new();
                    let keep = |surface, _| surface == keep;
                    let counts = subdivide(&scene, SPACING, keep, &mut storage).unwrap();
                    counts.patches
                };
                // What reflects is divided as ever.
                assert_eq!(patches(0), 6);
                let lamps = patches(1) + patches(2);
                // A length too short by sqrt 2 had doubled the number at most.
                assert!((300..=1024 + 2).contains(&lamps), "{shape:?}: {lamps}");
            }
        }
    }
}
