//! Triangles and parallelograms as rays meet them, four at a time.

use glam::{DVec3, Vec3, Vec4};
use relume::geometry::Polygon;

use super::Hit;
use crate::linear::{Linear, parameter_gradients, span};

/// Facets of a block.
pub(super) const LANES: usize = 4;

/// A triangle or parallelogram, grown by a tolerance on every side.
#[derive(Clone, Copy, Default)]
pub(super) struct Facet {
    /// Height above the plane.
    plane: Linear,
    /// Parameters, both in [0, 1] inside.
    parameters: [Linear; 2],
    /// Largest sum of the parameters inside.
    most: f32,
    surface: u32,
}

impl Facet {
    /// The facets of a surface: two of a quad that is no parallelogram.
    pub(super) fn of(
        polygon: &Polygon,
        tolerance: f32,
        surface: u32,
    ) -> impl Iterator<Item = Self> {
        let facet = |corners, is_triangle| Self::new(corners, is_triangle, tolerance, surface);
        let (first, second) = match (span(polygon), polygon.vertices()) {
            (Some(corners), _) => (Some(facet(corners, polygon.is_triangle())), None),
            (None, &[a, b, c, d]) => (Some(facet([a, b, c], true)), Some(facet([a, c, d], true))),
            (None, _) => (None, None),
        };
        first.into_iter().chain(second)
    }

    /// The triangle of `a, b, d`, or the parallelogram in which these are neighbours.
    fn new([a, b, d]: [Vec3; 3], is_triangle: bool, tolerance: f32, surface: u32) -> Self {
        let corners = [a, b, d].map(Vec3::as_dvec3);
        let [a, b, d] = corners;
        let [s, t] = parameter_gradients(corners);
        // By how much of a parameter a side moves outwards.
        let moved = |gradient: DVec3| f64::from(tolerance) * gradient.length();
        let (below_s, below_t) = (moved(s), moved(t));
        let (width, height, most) = if is_triangle {
            let size = 1.0 + below_s + below_t + moved(s + t);
            (size, size, 1.0)
        } else {
            (1.0 + 2.0 * below_s, 1.0 + 2.0 * below_t, 2.0)
        };
        Self {
            plane: Linear::new((b - a).cross(d - a).normalize_or_zero(), a, 0.0),
            parameters: [
                Linear::new(s / width, a, below_s / width),
                Linear::new(t / height, a, below_t / height),
            ],
            most,
            surface,
        }
    }
}

/// A ray, every coordinate in all lanes.
pub(super) struct Ray {
    pub origin: [Vec4; 3],
    pub direction: [Vec4; 3],
}

impl Ray {
    pub fn new(origin: Vec3, direction: Vec3) -> Self {
        Self {
            origin: origin.to_array().map(Vec4::splat),
            direction: direction.to_array().map(Vec4::splat),
        }
    }

    fn at(&self, distance: Vec4) -> [Vec4; 3] {
        let [[x, y, z], [u, v, w]] = [self.origin, self.direction];
        [x + u * distance, y + v * distance, z + w * distance]
    }
}

/// What a ray has met first so far.
#[derive(Clone, Copy)]
pub(super) struct Met {
    pub distance: f32,
    pub surface: u32,
    pub front: bool,
}

impl Met {
    /// Nothing nearer than a distance.
    pub const fn nothing(distance: f32) -> Self {
        Self {
            distance,
            surface: u32::MAX,
            front: false,
        }
    }

    pub const fn is_surface(&self) -> bool {
        self.surface != u32::MAX
    }

    pub fn hit(self) -> Option<Hit> {
        self.is_surface().then_some(Hit {
            surface: self.surface,
            distance: self.distance,
            front: self.front,
        })
    }
}

/// Four linear functions.
#[derive(Default)]
struct Linears {
    gradient: [Vec4; 3],
    offset: Vec4,
}

impl Linears {
    fn new(lanes: [Linear; LANES]) -> Self {
        let lane = |value: fn(Linear) -> f32| Vec4::from_array(lanes.map(value));
        Self {
            gradient: [
                lane(|linear| linear.gradient.x),
                lane(|linear| linear.gradient.y),
                lane(|linear| linear.gradient.z),
            ],
            offset: lane(|linear| linear.offset),
        }
    }

    fn slope(&self, [u, v, w]: [Vec4; 3]) -> Vec4 {
        let [x, y, z] = self.gradient;
        x * u + y * v + z * w
    }

    fn at(&self, place: [Vec4; 3]) -> Vec4 {
        self.slope(place) + self.offset
    }
}

/// Heights above the planes of four facets, and their parameters, at the origin of rays.
pub(super) struct Start {
    height: Vec4,
    parameters: [Vec4; 2],
}

/// Four facets; those that lack have gradients of zero, and nothing meets them.
pub(super) struct Block {
    plane: Linears,
    parameters: [Linears; 2],
    most: Vec4,
    surfaces: [u32; LANES],
}

impl Block {
    /// The first four of some facets.
    pub(super) fn new(facets: &[Facet]) -> Self {
        let lane = |lane| facets.get(lane).copied().unwrap_or_default();
        let facets = [0, 1, 2, 3].map(lane);
        Self {
            plane: Linears::new(facets.map(|facet| facet.plane)),
            parameters: [0, 1].map(|axis| Linears::new(facets.map(|f| f.parameters[axis]))),
            most: Vec4::from_array(facets.map(|facet| facet.most)),
            surfaces: facets.map(|facet| facet.surface),
        }
    }

    /// What rays from one origin have in common.
    pub(super) fn start(&self, origin: Vec3) -> Start {
        let origin = origin.to_array().map(Vec4::splat);
        Start {
            height: self.plane.at(origin),
            parameters: [0, 1].map(|axis| self.parameters[axis].at(origin)),
        }
    }

    /// Puts the nearest facet in place of what is farther, on a ray from where `start` was taken.
    #[inline]
    pub(super) fn meet_from(&self, start: &Start, direction: [Vec4; 3], met: &mut Met) {
        self.meet_at(start.height, direction, met, |distance| {
            let along = |axis: usize| self.parameters[axis].slope(direction) * distance;
            [0, 1].map(|axis| start.parameters[axis] + along(axis))
        });
    }

    /// Puts the nearest facet in place of what is farther.
    #[inline]
    pub(super) fn meet(&self, ray: &Ray, met: &mut Met) {
        let height = self.plane.at(ray.origin);
        self.meet_at(height, ray.direction, met, |distance| {
            let place = ray.at(distance);
            [0, 1].map(|axis| self.parameters[axis].at(place))
        });
    }

    /// The same, by the height of the origin above the planes, and the parameters at some distances.
    #[inline]
    fn meet_at(
        &self,
        height: Vec4,
        direction: [Vec4; 3],
        met: &mut Met,
        parameters: impl Fn(Vec4) -> [Vec4; 2],
    ) {
        let slope = self.plane.slope(direction);
        // Not a number, or not less than infinity, where the ray runs along the plane.
        let distance = -height / slope;
        let ahead = distance.cmpgt(Vec4::ZERO) & distance.cmplt(Vec4::splat(met.distance));
        if !ahead.any() {
            return;
        }
        let [s, t] = parameters(distance);
        let inside =
            s.min(t).cmpge(Vec4::ZERO) & s.max(t).cmple(Vec4::ONE) & (s + t).cmple(self.most);
        let mut hits = (ahead & inside).bitmask();
        let distances = distance.to_array();
        while hits != 0 {
            let lane = hits.trailing_zeros() as usize;
            hits &= hits - 1;
            if distances[lane] < met.distance {
                *met = Met {
                    distance: distances[lane],
                    surface: self.surfaces[lane],
                    front: slope[lane] < 0.0,
                };
            }
        }
    }
}
