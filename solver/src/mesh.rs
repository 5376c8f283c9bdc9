//! Faces, patches and elements: what shoots, what receives, and how a scene is divided into them.
//!
//! A *face* is one side of a surface; a *patch* shoots; an *element* receives and is displayed, and
//! every patch is divided into elements (substructuring, Cohen et al. 1986). A quad becomes a grid
//! of `ceil(edge / length)` parts along each of its two directions; a triangle becomes `n * n`
//! triangles similar to it. Elements are numbered face by face; inside a quad the edge
//! `v0 -> v3` is the outer loop and `v0 -> v1` the inner one, inside a triangle rows of
//! growing `t`. A face of reflectance 0 has patches only if it emits, and no elements.
//!
//! Counts: ids are `u32`; an edge is divided into at most 65 535 elements; [`MeshStorage`], made
//! for devices, holds at most 65 536 patches, so that 16 bits name one.

use core::fmt;
use core::ops::Range;

use glam::Vec2;
use heapless::Vec;

use crate::color::Rgb;
use crate::geometry::Polygon;
use crate::math;
use crate::scene::{Emission, Scene, Surface};

/// Side of a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Side {
    /// Where the vertices run counter-clockwise.
    Front,
    /// The other one.
    Back,
}

/// One side of a surface, with the range of its elements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Face {
    /// Number of the surface.
    pub surface: u32,
    /// Which side of it.
    pub side: Side,
    /// Outline, its front towards the side that this face is.
    pub polygon: Polygon,
    /// What it emits.
    pub emission: Option<Emission>,
    /// Number of its first element.
    pub first_element: u32,
    /// How many elements it has; 0 for a face of reflectance 0.
    pub element_count: u32,
}

/// A part of a face that shoots.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Patch {
    /// Number of its face.
    pub face: u32,
    /// First parameter corner of the part, see [`Polygon::part`].
    pub from: Vec2,
    /// Opposite parameter corner.
    pub to: Vec2,
    /// Area in m2.
    pub area: f32,
}

/// A part of a patch that receives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Element {
    /// Number of its patch.
    pub patch: u32,
    /// First parameter corner of the part in its face, see [`Polygon::part`].
    pub from: Vec2,
    /// Opposite parameter corner.
    pub to: Vec2,
    /// Area in m2.
    pub area: f32,
    /// Reflectance, in [0, 1) per channel.
    pub reflectance: Rgb,
}

impl Face {
    /// Numbers of its elements.
    #[must_use]
    pub fn element_range(&self) -> Range<u32> {
        self.first_element..self.first_element.saturating_add(self.element_count)
    }
}

/// A divided scene.
#[derive(Clone, Copy, Debug)]
pub struct Mesh<'a> {
    /// The faces, in the order of the surfaces, front before back.
    pub faces: &'a [Face],
    /// The patches, face by face.
    pub patches: &'a [Patch],
    /// The elements, face by face.
    pub elements: &'a [Element],
}

impl<'a> Mesh<'a> {
    /// Outline of a patch; `None` for a number out of range.
    #[must_use]
    pub fn patch_polygon(&self, patch: u32) -> Option<Polygon> {
        let patch = self.patches.get(patch as usize)?;
        let face = self.faces.get(patch.face as usize)?;
        Some(face.polygon.part(patch.from, patch.to))
    }

    /// Face of an element; `None` when the element does not belong to this mesh.
    #[must_use]
    pub fn element_face(&self, element: &Element) -> Option<&'a Face> {
        let patch = self.patches.get(element.patch as usize)?;
        self.faces.get(patch.face as usize)
    }

    /// Outline of an element; `None` when the element does not belong to this mesh.
    #[must_use]
    pub fn element_polygon(&self, element: &Element) -> Option<Polygon> {
        Some(
            self.element_face(element)?
                .polygon
                .part(element.from, element.to),
        )
    }

    /// What a patch emits.
    #[must_use]
    pub fn patch_emission(&self, patch: u32) -> Option<Emission> {
        let patch = self.patches.get(patch as usize)?;
        self.faces.get(patch.face as usize)?.emission
    }
}

/// Longest edges that a division aims at, in m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spacing {
    /// Longest edge of a patch.
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

/// Why a scene was not divided.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum MeshError {
    /// A spacing is not a positive finite length.
    Spacing,
    /// An edge of this surface needs more than 65 535 elements.
    TooFine {
        /// Number of the surface.
        surface: u32,
    },
    /// More faces than the storage holds.
    TooManyFaces {
        /// Capacity of the storage.
        limit: usize,
    },
    /// More patches than the storage holds.
    TooManyPatches {
        /// Capacity of the storage.
        limit: usize,
    },
    /// More elements than the storage holds.
    TooManyElements {
        /// Capacity of the storage.
        limit: usize,
    },
}

impl fmt::Display for MeshError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Spacing => f.write_str("patch and element lengths must be positive and finite"),
            Self::TooFine { surface } => write!(
                f,
                "surface {surface}: an edge needs more than 65535 elements; ask for longer ones"
            ),
            Self::TooManyFaces { limit } => {
                write!(f, "more faces than the storage holds ({limit})")
            }
            Self::TooManyPatches { limit } => {
                write!(f, "more patches than the storage holds ({limit})")
            }
            Self::TooManyElements { limit } => {
                write!(f, "more elements than the storage holds ({limit})")
            }
        }
    }
}

impl core::error::Error for MeshError {}

/// Where faces, patches and elements are put: one at a time, refused when full.
pub trait MeshSink {
    /// Takes a face.
    ///
    /// # Errors
    /// [`MeshError::TooManyFaces`].
    fn face(&mut self, face: Face) -> Result<(), MeshError>;
    /// Takes a patch.
    ///
    /// # Errors
    /// [`MeshError::TooManyPatches`].
    fn patch(&mut self, patch: Patch) -> Result<(), MeshError>;
    /// Takes an element.
    ///
    /// # Errors
    /// [`MeshError::TooManyElements`].
    fn element(&mut self, element: Element) -> Result<(), MeshError>;
}

/// Storage of fixed capacity, fit for a `static`.
#[derive(Debug)]
pub struct MeshStorage<const FACES: usize, const PATCHES: usize, const ELEMENTS: usize> {
    faces: Vec<Face, FACES>,
    patches: Vec<Patch, PATCHES>,
    elements: Vec<Element, ELEMENTS>,
}

impl<const FACES: usize, const PATCHES: usize, const ELEMENTS: usize>
    MeshStorage<FACES, PATCHES, ELEMENTS>
{
    /// Empty storage. More than 65 536 patches do not compile.
    #[must_use]
    pub const fn new() -> Self {
        const {
            assert!(PATCHES <= 65_536, "patch ids of a device are 16 bits wide");
        }
        Self {
            faces: Vec::new(),
            patches: Vec::new(),
            elements: Vec::new(),
        }
    }

    /// What is stored.
    #[must_use]
    pub fn mesh(&self) -> Mesh<'_> {
        Mesh {
            faces: &self.faces,
            patches: &self.patches,
            elements: &self.elements,
        }
    }
}

impl<const FACES: usize, const PATCHES: usize, const ELEMENTS: usize> Default
    for MeshStorage<FACES, PATCHES, ELEMENTS>
{
    fn default() -> Self {
        Self::new()
    }
}

impl<const FACES: usize, const PATCHES: usize, const ELEMENTS: usize> MeshSink
    for MeshStorage<FACES, PATCHES, ELEMENTS>
{
    fn face(&mut self, face: Face) -> Result<(), MeshError> {
        let full = MeshError::TooManyFaces { limit: FACES };
        self.faces.push(face).map_err(|_| full)
    }

    fn patch(&mut self, patch: Patch) -> Result<(), MeshError> {
        let full = MeshError::TooManyPatches { limit: PATCHES };
        self.patches.push(patch).map_err(|_| full)
    }

    fn element(&mut self, element: Element) -> Result<(), MeshError> {
        let full = MeshError::TooManyElements { limit: ELEMENTS };
        self.elements.push(element).map_err(|_| full)
    }
}

/// Divides every face for which `keep(surface, side)` holds into patches and elements.
///
/// The front of every surface is a face, the back of every two-sided one another; faces that
/// neither reflect nor emit are left out.
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
    for (surface, index) in scene.surfaces().iter().zip(0..) {
        for side in [Side::Front, Side::Back] {
            if is_face(surface, side) && keep(index, side) {
                subdivide_face(surface, index, side, spacing, &mut counts, sink)?;
            }
        }
    }
    Ok(counts)
}

/// True when this side of the surface takes part in the exchange: it reflects or emits.
#[must_use]
pub fn is_face(surface: &Surface, side: Side) -> bool {
    let reflects = !surface.reflectance().is_black();
    match side {
        Side::Front => reflects || surface.emission().is_some(),
        Side::Back => reflects && surface.is_two_sided(),
    }
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
    let first_patch = counts.patches;
    for (from, to) in cells(patches, polygon.is_triangle()) {
        sink.patch(Patch {
            face: counts.faces,
            from,
            to,
            area: polygon.part(from, to).area(),
        })?;
        counts.patches += 1;
    }
    counts.faces += 1;
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
    use super::*;
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
        assert_eq!((counts.faces, counts.patches, counts.elements), (3, 18, 48));
        let mesh = storage.mesh();
        assert!(mesh.faces[0].emission.is_some());
        assert_eq!(mesh.faces[1].side, Side::Back);
        assert!(mesh.faces[1].emission.is_none());
        assert_eq!(mesh.faces[2].element_count, 0);
    }
}
