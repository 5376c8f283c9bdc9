//! Paints a relit scene on any embedded-graphics display; the only file that names it.
//!
//! Perspective: a point `p` with `d = (p - eye)` lands at `x = w/2 + f d.right / d.forward`,
//! `y = h/2 - f d.up / d.forward` with `f = h / (2 tan(fov / 2))`, in pixels. The reciprocal depth
//! `1 / d.forward` is linear on the screen, so hidden surfaces are found with a depth buffer of as
//! many rows as the caller's band holds; the display gets one `fill_contiguous` per band.
//!
//! Elements are flat. A side of a surface that no light reaches is black when the eye is inside
//! the scene's bounding box, and transparent from outside, so that one can look into a closed room.

mod view;

use core::fmt;

use embedded_graphics::draw_target::DrawTarget;
use embedded_graphics::geometry::{Point, Size};
use embedded_graphics::primitives::Rectangle;
use glam::Vec3;

use crate::atlas::AtlasMesh;
use crate::geometry::Polygon;
use crate::mesh::Side;

use view::View;

/// A lamp flush with its ceiling is in front of it: more than the rounding of depths, less than shows.
const LAMP_NEARNESS: f32 = 1.0 + 1e-4;

/// A pinhole camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Where it is, in m.
    pub eye: Vec3,
    /// What it looks at.
    pub target: Vec3,
    /// What is up on the display; not along the line of sight.
    pub up: Vec3,
    /// Vertical field of view, radians, in (0, pi).
    pub fov: f32,
}

/// What a pixel shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shown {
    /// An element, by number.
    Element(u32),
    /// A face without elements, by number: a lamp.
    Lamp(u32),
    /// A side of a surface that no light reaches, or that reflects nothing.
    Unlit,
}

/// One pixel of the depth buffer.
#[derive(Clone, Copy, Debug)]
pub struct Sample<C> {
    /// Reciprocal depth, 1/m; 0 where nothing has been drawn.
    depth: f32,
    color: C,
}

impl<C> Sample<C> {
    /// An empty pixel.
    #[must_use]
    pub const fn new(background: C) -> Self {
        Self {
            depth: 0.0,
            color: background,
        }
    }
}

/// Why nothing, or not everything, was drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum DrawError<E> {
    /// A vector is not finite, eye and target coincide, `up` is along the line of sight, or the
    /// field of view is not in (0, pi).
    Camera,
    /// The band does not hold one row of the display.
    Band {
        /// Samples that one row needs.
        needed: usize,
    },
    /// The display failed.
    Display(E),
}

impl<E: fmt::Display> fmt::Display for DrawError<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Camera => f.write_str("the camera looks nowhere"),
            Self::Band { needed } => write!(f, "a row of the display needs {needed} samples"),
            Self::Display(error) => error.fmt(f),
        }
    }
}

impl<E: fmt::Debug + fmt::Display> core::error::Error for DrawError<E> {}

/// Paints the whole display; `band` is scratch for as many rows at a time as fit into it.
///
/// `color` is asked once for every polygon that may show in a band.
///
/// # Errors
/// [`DrawError`]; without an error of the display itself, nothing has been drawn.
pub fn paint<D: DrawTarget>(
    display: &mut D,
    mesh: &AtlasMesh,
    camera: &Camera,
    background: D::Color,
    band: &mut [Sample<D::Color>],
    color: impl Fn(Shown) -> D::Color,
) -> Result<(), DrawError<D::Error>> {
    let area = display.bounding_box();
    let view = View::new(camera, area.size).ok_or(DrawError::Camera)?;
    let width = area.size.width as usize;
    let needed = DrawError::Band { needed: width };
    let Some(rows) = band.len().checked_div(width) else {
        return Ok(());
    };
    let band = band.get_mut(..rows * width).unwrap_or_default();
    let mut top = 0;
    while top < area.size.height {
        let rows = (rows as u32).min(area.size.height - top);
        if rows == 0 {
            return Err(needed);
        }
        band.fill(Sample::new(background));
        for_each_polygon(mesh, camera.eye, |shown, polygon| {
            let nearness = if matches!(shown, Shown::Lamp(_)) {
                LAMP_NEARNESS
            } else {
                1.0
            };
            if let Some(outline) = view.project(&polygon, nearness) {
                view.fill(&outline, top, rows, band, || color(shown));
            }
        });
        let place = Rectangle::new(
            area.top_left + Point::new(0, top as i32),
            Size::new(area.size.width, rows),
        );
        display
            .fill_contiguous(&place, band.iter().map(|sample| sample.color))
            .map_err(DrawError::Display)?;
        top += rows;
    }
    Ok(())
}

/// Everything that can hide or show, as long as it is turned towards the eye.
fn for_each_polygon(mesh: &AtlasMesh, eye: Vec3, mut draw: impl FnMut(Shown, Polygon)) {
    let is_seen = |polygon: &Polygon| (eye - polygon.origin()).dot(polygon.normal()) > 0.0;
    let mut next = 0;
    for number in 0..mesh.face_count() {
        let Some(face) = mesh.face(number) else {
            continue;
        };
        let is_seen = is_seen(&face.polygon);
        let first = next;
        while let Some(element) = mesh.element(next).filter(|e| e.face == number) {
            if is_seen {
                let part = face.polygon.part(element.from, element.to);
                draw(Shown::Element(next), part);
            }
            next += 1;
        }
        if is_seen && next == first {
            let shown = match face.emission {
                Some(_) => Shown::Lamp(number),
                None => Shown::Unlit,
            };
            draw(shown, face.polygon);
        }
    }
    if is_inside(mesh, eye) {
        for_each_unlit(mesh, |polygon| {
            if is_seen(&polygon) {
                draw(Shown::Unlit, polygon);
            }
        });
    }
}

fn for_each_unlit(mesh: &AtlasMesh, mut draw: impl FnMut(Polygon)) {
    for index in 0..mesh.surface_count() {
        let Some(polygon) = mesh.surface(index) else {
            continue;
        };
        for (side, polygon) in [(Side::Front, polygon), (Side::Back, polygon.flipped())] {
            let is_lit = (0..mesh.face_count())
                .filter_map(|face| mesh.face(face))
                .any(|face| face.surface == index && face.side == side);
            if !is_lit {
                draw(polygon);
            }
        }
    }
}

/// True when the eye is inside the bounding box of all surfaces.
fn is_inside(mesh: &AtlasMesh, eye: Vec3) -> bool {
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for index in 0..mesh.surface_count() {
        if let Some(polygon) = mesh.surface(index) {
            for vertex in polygon.vertices() {
                low = low.min(*vertex);
                high = high.max(*vertex);
            }
        }
    }
    eye.cmpge(low).all() && eye.cmple(high).all()
}

#[cfg(test)]
mod tests;
