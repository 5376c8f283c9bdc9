//! Projection of outlines and their scan conversion into a band of the depth buffer.

use embedded_graphics::geometry::Size;
use glam::{Vec2, Vec3};
use heapless::Vec;

use super::{Camera, Sample};
use crate::geometry::{Clipped, Polygon, clip};
use crate::math;

/// A vertex on the display: place in pixels and reciprocal depth.
#[derive(Clone, Copy)]
pub(super) struct Vertex {
    at: Vec2,
    depth: f32,
}

pub(super) type Outline = Vec<Vertex, 8>;

/// A camera in front of a display of known size.
pub(super) struct View {
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
    pub(super) fn new(camera: &Camera, size: Size) -> Option<Self> {
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
    ///
    /// `nearness` multiplies the reciprocal depth: above 1 it wins over what lies in the same plane.
    pub(super) fn project(&self, polygon: &Polygon, nearness: f32) -> Option<Outline> {
        // `collect` would have a path to a panic, for more vertices than fit.
        let mut relative = Clipped::new();
        for vertex in polygon.vertices() {
            let _ = relative.push(*vertex - self.eye);
        }
        let visible = clip(&relative, |v| v.dot(self.forward) - self.near);
        let mut outline = Outline::new();
        for v in &visible {
            let depth = v.dot(self.forward).recip();
            let offset = Vec2::new(v.dot(self.right), -v.dot(self.up));
            let _ = outline.push(Vertex {
                at: self.middle + offset * (self.focal * depth),
                depth: depth * nearness,
            });
        }
        (!outline.is_empty()).then_some(outline)
    }

    /// Fills the part of an outline that lies in the band of `rows` rows below `top`.
    pub(super) fn fill<C: Copy>(
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
            // `clamp` panics where a length is no number.
            let offset = column as f32 + 0.5 - self.left.at.x;
            let offset = offset.min(length).max(0.0);
            let depth = self.left.depth + slope * offset;
            if depth > sample.depth {
                *sample = Sample { depth, color };
            }
        }
    }
}
