//! Paints a relit scene on any embedded-graphics display; the only file that names it.
//!
//! Perspective: a point `p` with `d = (p - eye)` lands at `x = w/2 + f d.right / d.forward`,
//! `y = h/2 - f d.up / d.forward` with `f = h / (2 tan(fov / 2))`, in pixels. The reciprocal depth
//! `1 / d.forward` is linear on the screen, so hidden surfaces are found with a depth buffer of as
//! many rows as the caller's band holds; the display gets one `fill_contiguous` per band.
//!
//! Elements are flat. A side of a surface that no light reaches is black when the eye is inside
//! the scene's bounding box, and transparent from outside, so that one can look into a closed room.

use core::fmt;

use embedded_graphics::draw_target::DrawTarget;
use embedded_graphics::geometry::{Point, Size};
use embedded_graphics::primitives::Rectangle;
use glam::{Vec2, Vec3};
use heapless::Vec;

use crate::atlas::AtlasMesh;
use crate::geometry::{Polygon, clip};
use crate::math;
use crate::mesh::Side;

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
    /// A side of a surface that no light reaches.
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
            if let Some(outline) = view.project(&polygon) {
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
    let mut current = None;
    for index in 0..mesh.element_count() {
        let Some(element) = mesh.element(index) else {
            continue;
        };
        if current.is_none_or(|(face, _)| face != element.face) {
            current = mesh.face(element.face).map(|f| (element.face, f.polygon));
        }
        if let Some((_, polygon)) = current.filter(|(_, polygon)| is_seen(polygon)) {
            draw(
                Shown::Element(index),
                polygon.part(element.from, element.to),
            );
        }
    }
    for index in 0..mesh.face_count() {
        if let Some(face) = mesh.face(index)
            && face.emission.is_some()
            && is_seen(&face.polygon)
        {
            draw(Shown::Lamp(index), face.polygon);
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

/// A vertex on the display: place in pixels and reciprocal depth.
#[derive(Clone, Copy)]
struct Vertex {
    at: Vec2,
    depth: f32,
}

type Outline = Vec<Vertex, 8>;

/// A camera in front of a display of known size.
struct View {
    eye: Vec3,
    right: Vec3,
    up: Vec3,
    forward: Vec3,
    /// Focal length in pixels.
    focal: f32,
    middle: Vec2,
    /// Nearest distance that is drawn, in m.
    near: f32,
    width: usize,
}

impl View {
    fn new(camera: &Camera, size: Size) -> Option<Self> {
        let sight = camera.target - camera.eye;
        let forward = sight.try_normalize()?;
        let right = forward.cross(camera.up).try_normalize()?;
        let is_legal = camera.eye.is_finite()
            && camera.fov > 0.0
            && camera.fov < core::f32::consts::PI
            && right.is_finite();
        is_legal.then(|| Self {
            eye: camera.eye,
            right,
            up: right.cross(forward),
            forward,
            focal: size.height as f32 / (2.0 * math::tan(camera.fov / 2.0)),
            middle: Vec2::new(size.width as f32, size.height as f32) / 2.0,
            near: 1e-3 * sight.length(),
            width: size.width as usize,
        })
    }

    /// The outline on the display, cut off at the near plane; `None` when nothing is left.
    fn project(&self, polygon: &Polygon) -> Option<Outline> {
        let relative: crate::geometry::Clipped = polygon
            .vertices()
            .iter()
            .map(|vertex| *vertex - self.eye)
            .take(4)
            .collect();
        let visible = clip(&relative, |v| v.dot(self.forward) - self.near);
        let outline: Outline = visible
            .iter()
            .map(|v| {
                let depth = v.dot(self.forward).recip();
                let offset = Vec2::new(v.dot(self.right), -v.dot(self.up));
                Vertex {
                    at: self.middle + offset * (self.focal * depth),
                    depth,
                }
            })
            .collect();
        (!outline.is_empty()).then_some(outline)
    }

    /// Fills the part of an outline that lies in the band of `rows` rows below `top`.
    fn fill<C: Copy>(
        &self,
        outline: &Outline,
        top: u32,
        rows: u32,
        band: &mut [Sample<C>],
        color: impl Fn() -> C,
    ) {
        let low = outline.iter().map(|v| v.at.y).fold(f32::INFINITY, f32::min);
        let high = outline.iter().map(|v| v.at.y).fold(0.0, f32::max);
        let first = math::ceil(low - 0.5 - EDGE).max(top as f32) as u32;
        let last = math::floor(high - 0.5 + EDGE).min((top + rows) as f32 - 1.0);
        if last < 0.0 || first > last as u32 {
            return;
        }
        let color = color();
        for row in first..=last as u32 {
            let start = (row - top) as usize * self.width;
            let samples = band.get_mut(start..).unwrap_or_default();
            if let Some(span) = Span::new(outline, row as f32 + 0.5) {
                span.fill(samples, self.width, color);
            }
        }
    }
}

/// Widening of every outline, in pixels: more than rounding, less than one can see, so that no
/// hole opens between neighbours.
const EDGE: f32 = 1.0 / 256.0;

/// What a row of pixels cuts out of an outline.
struct Span {
    left: Vertex,
    right: Vertex,
}

impl Span {
    fn new(outline: &Outline, y: f32) -> Option<Self> {
        let mut span: Option<Self> = None;
        let next = outline.iter().cycle().skip(1);
        for (a, b) in outline.iter().zip(next) {
            let (low, high) = (a.at.y.min(b.at.y), a.at.y.max(b.at.y));
            if y < low - EDGE || y > high + EDGE {
                continue;
            }
            let share = if high > low {
                ((y - a.at.y) / (b.at.y - a.at.y)).clamp(0.0, 1.0)
            } else {
                0.0
            };
            let crossing = Vertex {
                at: a.at + (b.at - a.at) * share,
                depth: a.depth + (b.depth - a.depth) * share,
            };
            span = Some(span.map_or(
                Self {
                    left: crossing,
                    right: crossing,
                },
                |span| span.widened(crossing),
            ));
        }
        span
    }

    fn widened(self, crossing: Vertex) -> Self {
        if crossing.at.x < self.left.at.x {
            Self {
                left: crossing,
                ..self
            }
        } else if crossing.at.x > self.right.at.x {
            Self {
                right: crossing,
                ..self
            }
        } else {
            self
        }
    }

    fn fill<C: Copy>(&self, samples: &mut [Sample<C>], width: usize, color: C) {
        let first = math::ceil(self.left.at.x - 0.5 - EDGE).max(0.0) as usize;
        let end = math::floor(self.right.at.x + 0.5 + EDGE).max(0.0) as usize;
        let length = self.right.at.x - self.left.at.x;
        let slope = if length > 0.0 {
            (self.right.depth - self.left.depth) / length
        } else {
            0.0
        };
        let samples = samples.get_mut(first..end.min(width)).unwrap_or_default();
        for (sample, column) in samples.iter_mut().zip(first..) {
            let offset = (column as f32 + 0.5 - self.left.at.x).clamp(0.0, length);
            let depth = self.left.depth + slope * offset;
            if depth > sample.depth {
                *sample = Sample { depth, color };
            }
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use crate::atlas::{Atlas, Channels, Contents, LightEntry, Quantity, size, write};
    use crate::code::{Code, Scale};
    use crate::color::Rgb;
    use crate::mesh::{MeshStorage, Spacing, subdivide};
    use crate::scene::{Emission, Scene, Surface};
    use embedded_graphics::mock_display::MockDisplay;
    use embedded_graphics::pixelcolor::{Rgb888, RgbColor};
    use std::vec;
    use std::vec::Vec;

    /// A red wall at z = 0 (two elements side by side) and a green lamp in front of its right part.
    fn atlas() -> Vec<u8> {
        let square = |low: Vec2, high: Vec2, z| {
            [
                Vec3::new(low.x, low.y, z),
                Vec3::new(high.x, low.y, z),
                Vec3::new(high.x, high.y, z),
                Vec3::new(low.x, high.y, z),
            ]
        };
        let wall = square(Vec2::new(-2.0, -1.0), Vec2::new(2.0, 1.0), 0.0);
        let lamp = square(Vec2::new(0.0, 0.0), Vec2::new(1.0, 0.5), 1.0);
        let emission = Emission {
            light: 0,
            share: Rgb::WHITE,
        };
        let surfaces = [
            Surface::new(0, &wall, Rgb::splat(0.5)).unwrap(),
            Surface::new(1, &lamp, Rgb::BLACK)
                .and_then(|s| s.emitting(1, emission))
                .unwrap(),
        ];
        let scene = Scene::new(&surfaces, &[], 1).unwrap();
        let mut storage = MeshStorage::<2, 2, 2>::new();
        let spacing = Spacing {
            patch: 4.0,
            element: 2.0,
        };
        subdivide(&scene, spacing, |_, _| true, &mut storage).unwrap();
        let contents = Contents {
            code: Code::Exp8s,
            channels: Channels::Rgb,
            quantity: Quantity::Irradiance,
            lights: &[LightEntry {
                name: "lamp",
                emission: Rgb::WHITE,
                scale: Scale::ONE,
            }],
            elements: 2,
            mesh: Some((&surfaces.map(|s| *s.polygon()), storage.mesh())),
        };
        let mut bytes = vec![0; size(&contents).unwrap()];
        write(&contents, |_, _| Rgb::WHITE, &mut bytes).unwrap();
        bytes
    }

    fn camera() -> Camera {
        Camera {
            eye: Vec3::new(0.0, 0.0, 1000.0),
            target: Vec3::ZERO,
            up: Vec3::Y,
            fov: 2.0 * (1.0_f32 / 250.0).atan(),
        }
    }

    fn color(shown: Shown) -> Rgb888 {
        match shown {
            Shown::Element(0) => Rgb888::RED,
            Shown::Element(_) => Rgb888::BLUE,
            Shown::Lamp(_) => Rgb888::GREEN,
            Shown::Unlit => Rgb888::WHITE,
        }
    }

    #[test]
    fn near_hides_far_and_every_pixel_is_painted_once() {
        let bytes = atlas();
        let atlas = Atlas::parse(&bytes).unwrap();
        // 8 x 8 m on 64 x 64 pixels; MockDisplay panics when a pixel is drawn twice.
        let mut display = MockDisplay::<Rgb888>::new();
        let mut band = [Sample::new(Rgb888::BLACK); 64 * 5];
        paint(
            &mut display,
            &atlas.mesh().unwrap(),
            &camera(),
            Rgb888::BLACK,
            &mut band,
            color,
        )
        .unwrap();
        let at = |x, y| display.get_pixel(Point::new(x, y)).unwrap();
        assert_eq!(at(2, 2), Rgb888::BLACK);
        assert_eq!(at(17, 32), Rgb888::RED);
        assert_eq!(at(46, 32), Rgb888::BLUE);
        assert_eq!(at(35, 30), Rgb888::GREEN, "the lamp is in front");
        assert_eq!(at(35, 34), Rgb888::BLUE, "below the lamp");
        let count = |wanted| {
            let pixels = (0..64 * 64).map(|i| Point::new(i % 64, i / 64));
            pixels
                .filter(|p| display.get_pixel(*p) == Some(wanted))
                .count()
        };
        assert_eq!(count(Rgb888::RED), 16 * 16);
        assert_eq!(count(Rgb888::GREEN), 8 * 4);
        assert_eq!(count(Rgb888::BLUE), 16 * 16 - 8 * 4);
    }

    #[test]
    fn a_band_below_one_row_and_a_blind_camera_are_errors() {
        let bytes = atlas();
        let atlas = Atlas::parse(&bytes).unwrap();
        let mesh = atlas.mesh().unwrap();
        let mut display = MockDisplay::<Rgb888>::new();
        let mut band = [Sample::new(Rgb888::BLACK); 63];
        let black = Rgb888::BLACK;
        let found = paint(&mut display, &mesh, &camera(), black, &mut band, color);
        assert_eq!(found, Err(DrawError::Band { needed: 64 }));
        let blind = Camera {
            up: Vec3::Z,
            ..camera()
        };
        let found = paint(&mut display, &mesh, &blind, black, &mut band, color);
        assert_eq!(found, Err(DrawError::Camera));
    }

    #[test]
    fn what_is_behind_the_eye_is_not_drawn() {
        let bytes = atlas();
        let atlas = Atlas::parse(&bytes).unwrap();
        let away = Camera {
            target: Vec3::new(0.0, 0.0, 2000.0),
            ..camera()
        };
        let mut display = MockDisplay::<Rgb888>::new();
        let mut band = [Sample::new(Rgb888::BLACK); 640];
        let mesh = atlas.mesh().unwrap();
        paint(&mut display, &mesh, &away, Rgb888::BLACK, &mut band, color).unwrap();
        let painted = (0..64 * 64)
            .filter(|i| display.get_pixel(Point::new(i % 64, i / 64)) != Some(Rgb888::BLACK));
        assert_eq!(painted.count(), 0);
    }
}
