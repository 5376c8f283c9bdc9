//! Smooth shading: irradiance at the corners of every element.
//!
//! A *node* is a corner that elements of one plane and side share, inside a face and across
//! coplanar faces (importers split walls). Its irradiance is the mean of the elements that have
//! it as a corner, weighted with their areas: `E_n = sum A_j E_j / sum A_j`. Between the nodes it
//! runs bilinearly over quads and linearly over triangles, in the element's parameters, hence in
//! space and not on the screen.
//!
//! A node in the middle of a larger neighbour's edge (adaptive meshes) takes the mean of that
//! edge's ends instead, so that both sides agree. Coplanar grids that meet in any other way may
//! show a step.

use std::collections::HashMap;
use std::ops::{Add, Mul, Sub};

use glam::{DVec3, I64Vec3, Vec2, Vec3};
use relume::color::Rgb;
use relume::geometry::Polygon;
use relume::mesh::{Mesh, Side};
use relume::tone;

use super::Gathered;

/// Two corners are one node when they are nearer than this, in largest coordinates of the scene:
/// what files written with six digits need.
const WELD: f64 = 4e-6;

/// Cosine of the angle up to which two planes are one (half a degree).
const COPLANAR: f32 = 0.99996;

/// What is painted: a polygon with the irradiance at its corners.
#[derive(Clone, Debug)]
pub(super) struct Facet {
    /// Outline; its front faces the camera.
    pub(super) polygon: Polygon,
    /// Irradiance at its vertices, W/m2 (a triangle's fourth is its third again).
    pub(super) irradiance: [Rgb; 4],
    /// Reflectance.
    pub(super) reflectance: Rgb,
    /// Emitted exitance, W/m2.
    pub(super) exitance: Rgb,
    /// Whether it belongs to a lamp, lit or not: what is drawn must not depend on the mix.
    pub(super) is_lamp: bool,
    /// The surface and side that it is a part of, if light was stored there.
    pub(super) side: Option<(u32, Side)>,
}

impl Facet {
    /// A lamp without elements: it only emits.
    pub(super) fn lamp(polygon: Polygon, exitance: Rgb) -> Self {
        Self {
            exitance,
            is_lamp: true,
            ..Self::dark(polygon)
        }
    }

    /// A side that neither reflects nor emits.
    pub(super) fn dark(polygon: Polygon) -> Self {
        Self {
            polygon,
            irradiance: [Rgb::BLACK; 4],
            reflectance: Rgb::BLACK,
            exitance: Rgb::BLACK,
            is_lamp: false,
            side: None,
        }
    }

    /// True when it neither reflects nor emits, whatever the mix.
    pub(super) fn is_dark(&self) -> bool {
        self.reflectance == Rgb::BLACK && !self.is_lamp
    }

    /// Radiance `(rho E + M) / pi` at a point of the polygon, W/m2/sr; `E` is gathered where that is
    /// asked for, with rays that the `seed` turns.
    pub(super) fn radiance(&self, point: Vec3, gathered: Option<Gathered>, seed: u64) -> Rgb {
        let at = self.polygon.parameters(point);
        let at = at.clamp(Vec2::ZERO, Vec2::ONE); // widened outlines reach a little beyond
        let gathered = self.side.zip(gathered).and_then(|(side, gathered)| {
            gathered.irradiance(side, self.blend(at, self.corners()), seed)
        });
        let irradiance = gathered.unwrap_or_else(|| self.blend(at, self.irradiance));
        tone::radiance(self.reflectance, irradiance, self.exitance)
    }

    /// The vertices; a triangle's fourth is its third again.
    fn corners(&self) -> [Vec3; 4] {
        let vertices = self.polygon.vertices();
        [0, 1, 2, 3].map(|corner| {
            vertices
                .get(corner)
                .or(vertices.last())
                .copied()
                .unwrap_or_default()
        })
    }

    /// Between values at the corners: linear over a triangle, bilinear over a quad.
    fn blend<T>(&self, at: Vec2, [a, b, c, d]: [T; 4]) -> T
    where
        T: Copy + Add<Output = T> + Sub<Output = T> + Mul<f32, Output = T>,
    {
        if self.polygon.is_triangle() {
            a + (b - a) * at.x + (c - a) * at.y
        } else {
            let low = a + (b - a) * at.x;
            let high = d + (c - d) * at.x;
            low + (high - low) * at.y
        }
    }
}

/// The facet of every element, in element order; `None` for one that is not of this mesh.
pub(super) fn facets(mesh: &Mesh, irradiance: &[Rgb], exitance: &[Rgb]) -> Vec<Option<Facet>> {
    let polygons: Vec<Option<Polygon>> = mesh
        .elements
        .iter()
        .map(|element| mesh.element_polygon(element))
        .collect();
    let corners = corner_irradiance(&polygons, irradiance);
    let parts = mesh.elements.iter().zip(polygons).zip(corners);
    parts
        .map(|((element, polygon), corners)| {
            let number = mesh.patches.get(element.patch as usize)?.face as usize;
            let face = mesh.faces.get(number)?;
            Some(Facet {
                polygon: polygon?,
                irradiance: corners,
                reflectance: element.reflectance,
                exitance: *exitance.get(number)?,
                is_lamp: face.emission.is_some(),
                side: Some((face.surface, face.side)),
            })
        })
        .collect()
}

/// Irradiance at the corners of elements.
fn corner_irradiance(elements: &[Option<Polygon>], irradiance: &[Rgb]) -> Vec<[Rgb; 4]> {
    // Weld the corners, and gather what their elements receive.
    let mut nodes = Nodes::new(elements.iter().flatten());
    let mut sums: Vec<(Rgb, f32)> = Vec::new();
    let mut corners = Vec::with_capacity(elements.len());
    for (element, own) in elements.iter().zip(irradiance) {
        let ids = element.map_or([0; 4], |polygon| nodes.corners(&polygon));
        sums.resize(nodes.nodes.len().max(1), (Rgb::BLACK, 0.0));
        if let Some(polygon) = element {
            for id in &ids[..polygon.vertices().len()] {
                sums[*id].0 += *own * polygon.area();
                sums[*id].1 += polygon.area();
            }
        }
        corners.push(ids);
    }
    let mut values: Vec<Rgb> = sums.iter().map(|(sum, area)| *sum * area.recip()).collect();

    // Hang small elements' corners on large elements' edges, the largest first.
    let mut order: Vec<usize> = (0..corners.len()).collect();
    let area = |i: usize| elements[i].map_or(0.0, |polygon| polygon.area());
    order.sort_by(|a, b| area(*b).total_cmp(&area(*a)));
    for i in order {
        if let Some(polygon) = &elements[i] {
            let count = polygon.vertices().len();
            for edge in 0..count {
                nodes.hang(
                    corners[i][edge],
                    corners[i][(edge + 1) % count],
                    &mut values,
                );
            }
        }
    }
    corners.iter().map(|ids| ids.map(|id| values[id])).collect()
}

/// A corner: its place and the normal of its plane.
#[derive(Clone, Copy)]
struct Node {
    position: Vec3,
    normal: Vec3,
}

/// Corners by place: a grid whose cells are a few welding distances wide.
struct Nodes {
    nodes: Vec<Node>,
    cells: HashMap<I64Vec3, Vec<usize>>,
    reach: f64,
}

impl Nodes {
    fn new<'a>(polygons: impl Iterator<Item = &'a Polygon>) -> Self {
        let sizes = polygons
            .flat_map(|p| p.vertices())
            .map(|v| v.abs().max_element());
        let largest = sizes.fold(f32::MIN_POSITIVE, f32::max);
        Self {
            nodes: Vec::new(),
            cells: HashMap::new(),
            reach: f64::from(largest) * WELD,
        }
    }

    fn cell(&self, place: DVec3) -> I64Vec3 {
        (place / (4.0 * self.reach)).floor().as_i64vec3()
    }

    /// The node at a place of a plane.
    fn find(&self, position: Vec3, normal: Vec3) -> Option<usize> {
        let place = position.as_dvec3();
        let low = self.cell(place - DVec3::splat(self.reach));
        let high = self.cell(place + DVec3::splat(self.reach));
        let is_same = |id: &usize| {
            let node = &self.nodes[*id];
            node.position.as_dvec3().distance(place) <= self.reach
                && node.normal.dot(normal) >= COPLANAR
        };
        for x in low.x..=high.x {
            for y in low.y..=high.y {
                for z in low.z..=high.z {
                    let cell = self.cells.get(&I64Vec3::new(x, y, z));
                    if let Some(id) = cell.and_then(|ids| ids.iter().copied().find(is_same)) {
                        return Some(id);
                    }
                }
            }
        }
        None
    }

    /// The nodes of a polygon's vertices, made where there are none yet.
    fn corners(&mut self, polygon: &Polygon) -> [usize; 4] {
        let mut last = 0;
        let mut ids = polygon.vertices().iter().map(|position| {
            let normal = polygon.normal();
            last = self.find(*position, normal).unwrap_or_else(|| {
                let cell = self.cell(position.as_dvec3());
                self.cells.entry(cell).or_default().push(self.nodes.len());
                let position = *position;
                self.nodes.push(Node { position, normal });
                self.nodes.len() - 1
            });
            last
        });
        let three = [(); 3].map(|()| ids.next().unwrap_or_default());
        let fourth = ids.next().unwrap_or(three[2]);
        [three[0], three[1], three[2], fourth]
    }

    /// Sets nodes that halve the edge from `a` to `b`, again and again, to the edge's own course.
    fn hang(&self, a: usize, b: usize, values: &mut [Rgb]) {
        let (from, to) = (self.nodes[a], self.nodes[b]);
        let middle = self.find((from.position + to.position) * 0.5, from.normal);
        if let Some(middle) = middle.filter(|m| *m != a && *m != b) {
            values[middle] = (values[a] + values[b]) * 0.5;
            self.hang(a, middle, values);
            self.hang(middle, b, values);
        }
    }
}
