//! Faces, patches and elements: what shoots, what receives, and how a scene is divided into them.
//!
//! A *face* is one side of a surface; a *patch* shoots; an *element* receives and is displayed, and
//! every patch is divided into elements (substructuring, Cohen et al. 1986). A quad becomes a grid
//! of `ceil(edge / length)` parts along each of its two directions; a triangle becomes `n * n`
//! triangles similar to it. Elements are numbered face by face; inside a quad the edge
//! `v0 -> v3` is the outer loop and `v0 -> v1` the inner one, inside a triangle rows of
//! growing `t`. A face of reflectance 0 has no elements, and patches only if it emits, a bounded number.
//!
//! Counts: ids are `u32`; an edge is divided into at most 65 535 elements; [`MeshStorage`], made
//! for devices, holds at most 65 536 patches, so that 16 bits name one.

mod storage;
mod subdivide;

use core::ops::Range;

use glam::Vec2;

use crate::color::Rgb;
use crate::geometry::Polygon;
use crate::scene::{Emission, Surface};

pub use storage::{MeshError, MeshSink, MeshStorage};
pub use subdivide::{Counts, Spacing, element_count, is_face, subdivide};

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

    /// True for a patch that has elements, and so reflects; false for a black lamp.
    #[must_use]
    pub fn receives(&self, patch: u32) -> bool {
        let patch = self.patches.get(patch as usize);
        let face = patch.and_then(|patch| self.faces.get(patch.face as usize));
        face.is_some_and(|face| face.element_count > 0)
    }

    /// What a patch emits.
    #[must_use]
    pub fn patch_emission(&self, patch: u32) -> Option<Emission> {
        let patch = self.patches.get(patch as usize)?;
        self.faces.get(patch.face as usize)?.emission
    }

    /// The sides of a scene's surfaces that have no patches here, each with its front outwards: black ones, backs
    /// of what is seen from one side only, faces that were left out. They fill a part of the view and shoot nothing.
    pub fn dark_sides(&self, surfaces: &'a [Surface]) -> impl Iterator<Item = Polygon> + use<'a> {
        let faces = self.faces;
        let has_patches = move |surface: u32, side: Side| {
            let order = |face: &Face| (face.surface, face.side == Side::Back);
            let found = faces.binary_search_by_key(&(surface, side == Side::Back), order);
            let face = found.ok().and_then(|index| faces.get(index));
            face.is_some_and(|face| face.element_count > 0 || face.emission.is_some())
        };
        surfaces.iter().zip(0..).flat_map(move |(surface, number)| {
            let front = *surface.polygon();
            [(Side::Front, front), (Side::Back, front.flipped())]
                .into_iter()
                .filter(move |(side, _)| !has_patches(number, *side))
                .map(|(_, polygon)| polygon)
        })
    }
}
