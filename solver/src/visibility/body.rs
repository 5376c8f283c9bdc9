//! Closed convex bodies: surfaces that hide together what their silhouette hides.
//!
//! Seen from outside, each ray that meets a face turned away has met one that faces the eye before it, so
//! the shadow of a body is the cone through the edges between the two kinds. It stands for a dozen
//! overlapping shadows of single faces, exactly.

use glam::Vec3;
use heapless::Vec;

use crate::geometry::Plane;
use crate::scene::Surface;

/// Most faces of a body: a box of triangles.
pub(crate) const FACES: usize = 12;

/// Most edges: those of as many triangles.
const EDGES: usize = 18;

/// An edge; seen from outside the first face is to its left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Edge {
    pub from: Vec3,
    pub to: Vec3,
    pub faces: [usize; 2],
}

/// A closed convex body whose faces are neighbours in the order of the surfaces.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    first: u32,
    /// Planes of the faces, outwards.
    pub(crate) planes: Vec<Plane, FACES>,
    pub(crate) edges: Vec<Edge, EDGES>,
}

/// The bodies among the surfaces of a scene, in their order.
///
/// Neighbours must have the same vertices to the bit.
pub fn bodies(surfaces: &[Surface]) -> impl Iterator<Item = Body> {
    let mut first = 0;
    core::iter::from_fn(move || {
        while let Some(rest) = surfaces.get(first..).filter(|rest| !rest.is_empty()) {
            let at = first;
            if let Some(body) = closed(rest).and_then(|faces| Body::new(at, faces)) {
                first += body.planes.len();
                return Some(body);
            }
            first += 1;
        }
        None
    })
}

/// The surfaces up to the one that closes what the first begins.
fn closed(surfaces: &[Surface]) -> Option<&[Surface]> {
    let mut open = Vec::<(Vec3, Vec3), { 2 * EDGES }>::new();
    for (surface, count) in surfaces.iter().zip(1..=FACES) {
        for (from, to) in surface.polygon().edges() {
            let is_same = |edge: &(Vec3, Vec3)| *edge == (to, from) || *edge == (from, to);
            if let Some(index) = open.iter().position(is_same) {
                open.swap_remove(index);
            } else {
                open.push((from, to)).ok()?;
            }
        }
        if open.is_empty() {
            return surfaces.get(..count);
        }
    }
    None
}

impl Body {
    /// `None` for faces that are not convex together.
    fn new(first: usize, faces: &[Surface]) -> Option<Self> {
        let vertices = || faces.iter().flat_map(|face| face.polygon().vertices());
        let middle = vertices().copied().sum::<Vec3>() / vertices().count() as f32;
        let mut body = Self {
            first: u32::try_from(first).ok()?,
            planes: Vec::new(),
            edges: Vec::new(),
        };
        for (face, number) in faces.iter().map(Surface::polygon).zip(0..) {
            let (height, _) = face.height(middle);
            let outwards = if height < 0.0 { *face } else { face.flipped() };
            let is_behind = |v: &Vec3| {
                let (height, tolerance) = outwards.height(*v);
                height <= tolerance
            };
            if !vertices().all(is_behind) {
                return None;
            }
            body.planes.push(outwards.plane()).ok()?;
            for (from, to) in outwards.edges() {
                let mut others = body.edges.iter_mut();
                let other = others.find(|e| e.from == to && e.to == from && e.faces[1] == FACES);
                if let Some(other) = other {
                    other.faces[1] = number;
                } else {
                    let faces = [number, FACES];
                    body.edges.push(Edge { from, to, faces }).ok()?;
                }
            }
        }
        let is_closed = body.edges.iter().all(|edge| edge.faces[1] < FACES);
        is_closed.then_some(body)
    }

    /// Numbers of its surfaces.
    #[must_use]
    pub fn surfaces(&self) -> core::ops::Range<u32> {
        self.first..self.first + self.planes.len() as u32
    }

    /// True when all points of a polygon see the same face of it, and so are outside.
    pub(crate) fn is_outside(&self, corners: &[Vec3]) -> bool {
        self.planes.iter().any(|plane| {
            corners.iter().all(|corner| {
                let (height, tolerance) = plane.height(*corner);
                height > tolerance
            })
        })
    }

    /// True when no corner lies behind a plane.
    pub(crate) fn is_before(&self, plane: &Plane) -> bool {
        let corners = self.edges.iter().flat_map(|edge| [edge.from, edge.to]);
        corners.into_iter().all(|corner| {
            let (height, tolerance) = plane.height(corner);
            height >= -tolerance
        })
    }
}
