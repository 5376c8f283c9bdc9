//! Surfaces cut where walls stand on them that divide the light.
//!
//! An element is lit evenly, so one that reaches under a wall takes light through it: a lid that rests
//! on a drum and juts out over it would carry the light inside to its rim. Meshes are cut along such
//! lines, where light jumps (D0 discontinuities: Heckbert 1992; Lischinski, Tampieri and Greenberg 1992).
//! A wall *touches* a surface when it rises from within [`TOUCH`] elements of it; its foot is the line
//! in which their planes meet. Sample points on the surface, one for each element and two beside
//! each foot, are joined when nothing stands between them just above the surface; along a foot
//! whose sides stay apart the surface is cut, if light reaches both. A box on a floor or the leg of a table
//! cuts nothing: its inside is dark, and light goes around its outside. Assumption: what is walled off
//! on a surface without a sample point in it is too small to matter.

use std::borrow::Cow;
use std::collections::HashMap;
use std::sync::OnceLock;

use glam::{Vec2, Vec3};
use rayon::prelude::*;
use relume::geometry::{Polygon, clip};
use relume::mesh::{Side, Spacing, is_face};
use relume::scene::{Scene, SceneError, Surface};

use super::reach::{Place, Surroundings, WALKS};
use crate::bvh::{Bvh, Caster};
use crate::scene::OwnedScene;
use crate::texture::SurfaceTexture;

/// Heights and gaps that count as none, in edges of an element.
const TOUCH: f32 = 1e-3;

/// The same in roundings of a coordinate: rays grow surfaces by one.
const ROUNDINGS: f32 = 4.0;

/// Sample points along an edge of an element.
const PER_ELEMENT: f32 = 2.0;

/// Most rows, and most columns, of sample points, and most feet of a wall.
const MOST_ROWS: u32 = 256;

/// Rows and columns around the foot of a wall in which its sample points are joined to others.
const AROUND: i64 = 2;

/// Square of the sine of the angle between two planes below which they have no line in common.
const PARALLEL: f32 = 1e-4;

/// Most vertices of an outline that [`clip`] can cut.
const MOST_VERTICES: usize = 8;

/// The scene with its surfaces cut, for a mesh of these lengths; the scene itself where nothing is.
///
/// # Errors
/// [`SceneError`] when a tag is out of range.
pub fn cut(
    scene: &OwnedScene,
    patch: Option<f32>,
    element: Option<f32>,
) -> Result<Cow<'_, OwnedScene>, SceneError> {
    let centred = super::centred(scene);
    let view = centred.view()?;
    let spacing = super::spacing(&view, patch, element);
    let bvh = Bvh::for_scene(&view);
    let cutter = Cutter {
        scene: &view,
        spacing,
        bvh: &bvh,
        surroundings: OnceLock::new(),
    };
    let pieces: Vec<Option<Vec<Polygon>>> = (0..view.surfaces().len())
        .into_par_iter()
        .map(|number| cutter.pieces(number))
        .collect();
    if pieces.iter().all(Option::is_none) {
        return Ok(Cow::Borrowed(scene));
    }

    let mut whole = OwnedScene {
        surfaces: Vec::new(),
        textures: Vec::new(),
        luminaires: scene.luminaires.clone(),
        lights: scene.lights.clone(),
    };
    for (number, (surface, pieces)) in scene.surfaces.iter().zip(pieces).enumerate() {
        let texture = scene.textures.get(number).and_then(Option::as_ref);
        let near = view.surfaces()[number].polygon();
        let cut = pieces.and_then(|pieces| {
            let parts = pieces.iter().map(|piece| part(surface, near, piece));
            Some((parts.collect::<Option<Vec<_>>>()?, pieces))
        });
        if let Some((parts, pieces)) = cut {
            let own = |piece: &Polygon| texture.map(|texture| on_part(texture, near, piece));
            whole.textures.extend(pieces.iter().map(own));
            whole.surfaces.extend(parts);
        } else {
            whole.textures.push(texture.cloned());
            whole.surfaces.push(*surface);
        }
    }
    Ok(Cow::Owned(whole))
}

/// A piece of a surface, which lies `near` the origin, where that surface is; `None` when it is no
/// surface there.
fn part(surface: &Surface, near: &Polygon, piece: &Polygon) -> Option<Surface> {
    let by = surface.polygon().origin() - near.origin();
    let vertices: Vec<Vec3> = piece.vertices().iter().map(|v| *v + by).collect();
    let mut part = Surface::new(0, &vertices, surface.reflectance().get()).ok()?;
    if surface.is_two_sided() {
        part = part.two_sided();
    }
    match surface.emission() {
        Some(emission) => part.emitting(0, emission).ok(),
        None => Some(part),
    }
}

/// The texture of a piece of a surface.
fn on_part(texture: &SurfaceTexture, whole: &Polygon, piece: &Polygon) -> SurfaceTexture {
    let corners = piece.vertices().iter();
    let corners = corners.map(|vertex| texture.coordinates(whole.parameters(*vertex)));
    SurfaceTexture {
        corners: corners.collect(),
        ..texture.clone()
    }
}

/// What is asked of a scene.
struct Cutter<'a> {
    scene: &'a Scene<'a>,
    spacing: Spacing,
    bvh: &'a Bvh,
    /// Made when the first surface is divided.
    surroundings: OnceLock<Option<Surroundings<'a>>>,
}

/// The line on a surface from which a wall rises: an element long, or [`MOST_ROWS`] of one wall.
struct Foot {
    middle: Vec3,
    /// Across it, on the surface; a unit vector.
    across: Vec3,
    /// Points on both sides of the wall, just above the surface.
    beside: [Vec3; 2],
}

impl Cutter<'_> {
    /// A surface in pieces; `None` for one that stays whole.
    fn pieces(&self, number: usize) -> Option<Vec<Polygon>> {
        let surface = self.scene.surfaces().get(number)?;
        if surface.reflectance().is_black() {
            return None;
        }
        let outline = surface.polygon();
        let mut lines = Vec::new();
        for side in [Side::Front, Side::Back] {
            if is_face(surface, side) {
                let outline = match side {
                    Side::Front => *outline,
                    Side::Back => outline.flipped(),
                };
                lines.extend(self.divisions(number as u32, &outline));
            }
        }
        let pieces = divided(outline, &lines, self.touch(outline));
        (pieces.len() > 1).then_some(pieces)
    }

    /// What counts as touching a surface, in m.
    fn touch(&self, outline: &Polygon) -> f32 {
        let farthest = self.scene.diagonal();
        (TOUCH * self.spacing.element).max(ROUNDINGS * outline.plane().tolerance(farthest))
    }

    /// Feet of walls on the front of an outline that divide its light.
    fn divisions(&self, number: u32, outline: &Polygon) -> Vec<Foot> {
        let mut feet = self.feet(number, outline);
        if feet.is_empty() {
            return feet;
        }
        let touch = self.touch(outline);
        let mut samples = Samples::new(outline, self.spacing.element, touch);
        let beside: Vec<usize> = feet
            .iter()
            .flat_map(|foot| foot.beside)
            .map(|point| samples.push(point))
            .collect();
        samples.join(&mut self.bvh.caster(), &beside);

        let mut members: HashMap<usize, Vec<Vec3>> = HashMap::new();
        for (point, area) in samples
            .points
            .iter()
            .zip(&samples.areas)
            .take(samples.grid.len())
        {
            members.entry(*area).or_default().push(*point);
        }
        let mut lit = HashMap::new();
        let mut is_lit = |sample: usize| {
            let area = samples.areas[sample];
            let light = || {
                let own = members.get(&area);
                own.is_some_and(|own| self.is_lit(outline, touch, own, u64::from(number)))
            };
            *lit.entry(area).or_insert_with(light)
        };
        let mut sides = beside.chunks_exact(2);
        feet.retain(|_| match sides.next() {
            Some(&[left, right]) => {
                samples.areas[left] != samples.areas[right] && is_lit(left) && is_lit(right)
            }
            _ => false,
        });
        feet
    }

    /// True when light comes to some of the points above an outline.
    fn is_lit(&self, outline: &Polygon, height: f32, points: &[Vec3], seed: u64) -> bool {
        let make = || Surroundings::of(self.scene, self.spacing, self.bvh).ok();
        let surroundings = self.surroundings.get_or_init(make).as_ref();
        let down = outline.normal() * height;
        surroundings.is_some_and(|surroundings| {
            surroundings.is_reached(seed, |walk| {
                let point = points[walk as usize * points.len() / WALKS as usize];
                Place::new(outline, point - down)
            })
        })
    }

    /// Feet of all walls on the front of an outline that have some of it on both sides.
    fn feet(&self, number: u32, outline: &Polygon) -> Vec<Foot> {
        let touch = self.touch(outline);
        let mut feet = Vec::new();
        for wall in self.bvh.near(outline, touch) {
            if wall != number {
                let wall = self.scene.surfaces()[wall as usize].polygon();
                self.add_feet(outline, wall, touch, &mut feet);
            }
        }
        feet
    }

    fn add_feet(&self, outline: &Polygon, wall: &Polygon, touch: f32, feet: &mut Vec<Foot>) {
        let up = outline.normal();
        let cosine = up.dot(wall.normal());
        let square = 1.0 - cosine * cosine;
        let height = |point: Vec3| (point - outline.origin()).dot(up) - touch;
        // Above the surface by as much as counts as none.
        let mut ends = wall.edges().filter_map(|(a, b)| {
            let (from, to) = (height(a), height(b));
            ((from < 0.0) != (to < 0.0)).then(|| a + (b - a) * (from / (from - to)))
        });
        let (Some(a), Some(b)) = (ends.next(), ends.next()) else {
            return;
        };
        let Some([a, b]) = within(outline, a, b).filter(|_| square > PARALLEL) else {
            return;
        };
        let across = up.cross(b - a).normalize_or_zero();
        // Down the wall, to where the planes meet.
        let down = (wall.normal() * cosine - up) * (touch / square);
        let count = ((b - a).length() / self.spacing.element).ceil();
        let count = count.clamp(1.0, MOST_ROWS as f32);
        for part in 0..count as u32 {
            let point = a + (b - a) * ((part as f32 + 0.5) / count);
            let beside = [1.0, -1.0].map(|side| point + across * (side * 2.0 * touch));
            if beside.iter().all(|point| outline.holds(*point)) {
                feet.push(Foot {
                    middle: point + down,
                    across,
                    beside,
                });
            }
        }
    }
}

/// The part of a segment that lies above or below an outline.
fn within(outline: &Polygon, a: Vec3, b: Vec3) -> Option<[Vec3; 2]> {
    let (mut low, mut high) = (0.0_f32, 1.0_f32);
    for (from, to) in outline.edges() {
        let inwards = outline.normal().cross(to - from);
        let (start, end) = ((a - from).dot(inwards), (b - from).dot(inwards));
        if start < 0.0 && end < 0.0 {
            return None;
        }
        if start < 0.0 {
            low = low.max(start / (start - end));
        } else if end < 0.0 {
            high = high.min(start / (start - end));
        }
    }
    (low < high).then(|| [a + (b - a) * low, a + (b - a) * high])
}

/// Points just above an outline, and which of them are joined.
struct Samples<'a> {
    outline: &'a Polygon,
    columns: u32,
    rows: u32,
    points: Vec<Vec3>,
    /// Cell of the grid, column and row, of each.
    cells: Vec<[i64; 2]>,
    /// Number of a point that it is joined to; in the end the same for all that are joined.
    areas: Vec<usize>,
    /// Numbers of the points of the grid.
    grid: HashMap<[i64; 2], usize>,
}

impl<'a> Samples<'a> {
    /// A grid.
    fn new(outline: &'a Polygon, element: f32, height: f32) -> Self {
        let parts = |edge: f32| ((edge * PER_ELEMENT / element).ceil() as u32).clamp(1, MOST_ROWS);
        let length = |step: usize| {
            let edges = outline.edges().skip(step).step_by(2);
            edges.map(|(a, b)| (b - a).length()).fold(0.0, f32::max)
        };
        let mut samples = Self {
            outline,
            columns: parts(length(0)),
            rows: parts(length(1)),
            points: Vec::new(),
            cells: Vec::new(),
            areas: Vec::new(),
            grid: HashMap::new(),
        };
        let lift = outline.normal() * height;
        for row in 0..samples.rows {
            for column in 0..samples.columns {
                let at = Vec2::new(column as f32 + 0.5, row as f32 + 0.5)
                    / Vec2::new(samples.columns as f32, samples.rows as f32);
                if !outline.is_triangle() || at.element_sum() < 1.0 {
                    let number = samples.push(outline.point(at) + lift);
                    samples.grid.insert(samples.cells[number], number);
                }
            }
        }
        samples
    }

    fn push(&mut self, point: Vec3) -> usize {
        let at = self.outline.parameters(point);
        let cell = [
            (at.x * self.columns as f32) as i64,
            (at.y * self.rows as f32) as i64,
        ];
        self.points.push(point);
        self.cells.push(cell);
        self.areas.push(self.areas.len());
        self.areas.len() - 1
    }

    /// Joins points of the grid that see their neighbours, and those beside feet with the ones around.
    fn join(&mut self, caster: &mut Caster, beside: &[usize]) {
        for number in 0..self.grid.len() {
            for step in [[1, 0], [0, 1], [1, 1], [1, -1]] {
                self.join_to(caster, number, step);
            }
        }
        for &number in beside {
            for row in -AROUND..=AROUND {
                for column in -AROUND..=AROUND {
                    self.join_to(caster, number, [column, row]);
                }
            }
        }
        // Neighbours along a foot, where it is too narrow for the grid.
        for pair in beside.iter().zip(beside.iter().skip(2)) {
            self.join_pair(caster, *pair.0, *pair.1);
        }
        for number in 0..self.areas.len() {
            self.areas[number] = self.area(number);
        }
    }

    fn join_to(&mut self, caster: &mut Caster, number: usize, [column, row]: [i64; 2]) {
        let [own_column, own_row] = self.cells[number];
        if let Some(&other) = self.grid.get(&[own_column + column, own_row + row]) {
            self.join_pair(caster, number, other);
        }
    }

    fn join_pair(&mut self, caster: &mut Caster, a: usize, b: usize) {
        let (area, other) = (self.area(a), self.area(b));
        if area != other && caster.sees(self.points[a], self.points[b]) {
            self.areas[area] = other;
        }
    }

    fn area(&self, mut number: usize) -> usize {
        while self.areas[number] != number {
            number = self.areas[number];
        }
        number
    }
}

/// An outline cut along feet of walls into triangles and quads; lines nearer to an edge than `least`
/// cut nothing.
fn divided(outline: &Polygon, feet: &[Foot], least: f32) -> Vec<Polygon> {
    let mut pieces = vec![vec![*outline]];
    let mut outlines = vec![outline.vertices().to_vec()];
    let normal = outline.normal();
    for foot in feet {
        let is_inside = |piece: &Vec<Vec3>| {
            let next = piece.iter().cycle().skip(1);
            piece.iter().zip(next).all(|(a, b)| {
                let inwards = normal.cross(*b - *a).normalize_or_zero();
                (foot.middle - *a).dot(inwards) > least
            })
        };
        let Some(at) = outlines.iter().position(is_inside) else {
            continue;
        };
        if outlines[at].len() > MOST_VERTICES {
            continue;
        }
        // A vertex on the line belongs to both halves.
        let halves = [foot.across, -foot.across].map(|across| {
            let height = |v: Vec3| {
                let (height, rounding) = (
                    (v - foot.middle).dot(across),
                    outline.plane().tolerance(v.abs().max_element()),
                );
                if height.abs() <= rounding {
                    0.0
                } else {
                    height
                }
            };
            clip(&outlines[at], height).to_vec()
        });
        let polygons = [&halves[0], &halves[1]].map(|half| triangles_and_quads(half));
        if let [Some(first), Some(second)] = polygons {
            let [one, other] = halves;
            outlines[at] = one;
            pieces[at] = first;
            outlines.push(other);
            pieces.push(second);
        }
    }
    pieces.concat()
}

/// A convex outline as quads and at most one triangle; `None` where one of them is too thin.
fn triangles_and_quads(outline: &[Vec3]) -> Option<Vec<Polygon>> {
    let (first, rest) = outline.split_first()?;
    let mut polygons = Vec::new();
    for start in (0..rest.len() - 1).step_by(2) {
        let corners = rest.iter().skip(start).take(3);
        let vertices: Vec<Vec3> = std::iter::once(first).chain(corners).copied().collect();
        polygons.push(Polygon::new(&vertices).ok()?);
    }
    Some(polygons)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bake::{Settings, bake};
    use crate::scene::Light;
    use crate::texture::Image;
    use relume::color::Rgb;
    use relume::scene::{Luminaire, Source};
    use std::ops::ControlFlow;
    use std::sync::Arc;

    /// A box without a lid, standing on `z = 0`, and a square at the height `lid` with `half` an edge.
    fn drum(lid: f32, half: f32) -> OwnedScene {
        let size = 0.37;
        let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
        let square = |size: f32, z: f32| corners.map(|(x, y)| Vec3::new(x * size, y * size, z));
        let (low, high) = (square(size, 0.0), square(size, 1.0));
        let walls = (0..4).map(|i| [low[i], low[(i + 1) % 4], high[(i + 1) % 4], high[i]]);
        let outlines = walls.chain([low, square(half, lid)]);
        let light = |name: &str| Light {
            name: name.to_owned(),
            emission: Rgb::WHITE,
            importance: 1.0,
        };
        let bulb = |light, position| Luminaire::new(light, Rgb::WHITE, Source::Point { position });
        OwnedScene {
            surfaces: outlines
                .map(|outline| {
                    Surface::new(0, &outline, Rgb::splat(0.5))
                        .unwrap()
                        .two_sided()
                })
                .collect(),
            textures: vec![None; 6],
            luminaires: vec![
                bulb(0, Vec3::new(0.1, 0.05, 0.4)).unwrap(),
                bulb(1, Vec3::new(0.8, 0.3, 0.3)).unwrap(),
            ],
            lights: vec![light("inside"), light("outside")],
        }
    }

    fn cut_at(scene: &OwnedScene) -> Cow<'_, OwnedScene> {
        cut(scene, Some(1.0), Some(0.25)).unwrap()
    }

    #[test]
    fn a_lid_that_juts_out_is_cut_along_the_drum() {
        let image = Arc::new(Image {
            width: 1,
            height: 1,
            texels: vec![[0.5; 3]],
        });
        let mut scene = drum(1.0, 1.0);
        scene.textures[5] = Some(SurfaceTexture {
            image,
            factor: [1.0; 3],
            corners: [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
                .map(Vec2::from)
                .to_vec(),
        });
        let cut = cut_at(&scene);
        let pieces = &cut.surfaces[5..];
        assert!(pieces.len() >= 5, "{} pieces", pieces.len());
        let area: f32 = pieces.iter().map(|piece| piece.polygon().area()).sum();
        assert!((area - 4.0).abs() < 1e-5, "{area} m2");
        for (piece, texture) in pieces.iter().zip(&cut.textures[5..]) {
            let outline = piece.polygon();
            let is_in = |v: &Vec3| v.x.abs() <= 0.371 && v.y.abs() <= 0.371;
            let is_out = |outside: fn(Vec3) -> f32| {
                let vertices = outline.vertices().iter();
                vertices.fold(f32::INFINITY, |least, v| least.min(outside(*v))) >= 0.369
            };
            let beside = [|v: Vec3| v.x, |v: Vec3| -v.x, |v: Vec3| v.y, |v: Vec3| -v.y];
            let is_inside = outline.vertices().iter().all(is_in);
            assert!(is_inside || beside.into_iter().any(is_out), "{outline:?}");
            // Coordinates in the image were those in the plane.
            for (vertex, corner) in outline
                .vertices()
                .iter()
                .zip(&texture.as_ref().unwrap().corners)
            {
                assert!((vertex.truncate() - *corner).length() < 1e-5);
            }
        }
    }

    #[test]
    fn a_lid_that_light_passes_under_or_that_ends_with_the_drum_stays_whole() {
        for (lid, half) in [(1.1, 1.0), (1.0, 0.37)] {
            let scene = drum(lid, half);
            assert!(matches!(cut_at(&scene), Cow::Borrowed(_)), "{lid}, {half}");
        }
        // Nor is the floor under a box that is dark inside.
        let mut scene = drum(0.0, 1.0);
        let high = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
        let high = high.map(|(x, y)| Vec3::new(x * 0.37, y * 0.37, 1.0));
        scene.surfaces[4] = Surface::new(4, &high, Rgb::splat(0.5)).unwrap().two_sided();
        scene.luminaires.remove(0);
        assert!(matches!(cut_at(&scene), Cow::Borrowed(_)));
    }

    #[test]
    fn no_light_passes_a_drum_and_its_lid() {
        let settings = Settings {
            patch: Some(1.0),
            element: Some(0.25),
            ..Settings::default()
        };
        let mut go_on = |_| ControlFlow::Continue(());
        let solution = bake(&drum(1.0, 1.0), &settings, &mut go_on).unwrap();
        let mesh = solution.mesh.view();
        for (id, element) in mesh.elements.iter().enumerate() {
            let outline = mesh.element_polygon(element).unwrap();
            let above = outline.center() + outline.normal() * 1e-3;
            let is_inside =
                above.truncate().abs().max_element() < 0.37 && above.z > 0.0 && above.z < 1.0;
            let [inside, outside] = *solution.element(id) else {
                panic!("two lights");
            };
            let (own, other) = if is_inside {
                (inside, outside)
            } else {
                (outside, inside)
            };
            assert_eq!(other, Rgb::BLACK, "{outline:?}");
            assert!(!is_inside || own != Rgb::BLACK, "{outline:?}");
        }
    }
}
