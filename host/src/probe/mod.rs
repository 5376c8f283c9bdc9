//! Irradiance at surface points and at elements, for every light by itself.
//!
//! A point belongs to the nearest surface within 1e-3 of the diagonal of the scene's bounding box
//! whose normal, of either side, agrees within 10 degrees; it gets the value of the element that
//! holds it. A side that no light reaches has no elements and gets 0, and so does the back of a
//! one-sided surface, which reflects nothing; a side of reflectance 0 is not stored and gives no value.

mod gather;
mod lamp;
mod radiant;

use std::io;

use glam::{DVec3, Vec3};
use rayon::prelude::*;
use relume::color::Rgb;
use relume::geometry::Polygon;
use relume::mesh::Side;
use thiserror::Error;

use crate::mesh::Locator;
use crate::solution::Solution;
pub use gather::Gatherer;
pub use lamp::Spot;

/// Reach of a surface, in diagonals of the bounding box.
const REACH: f32 = 1e-3;

/// Cosine of the largest angle between a point's normal and its surface's: 10 degrees.
const LEAST_COSINE: f32 = 0.984_807_8;

/// A surface point to be probed.
#[derive(Clone, Copy, Debug)]
pub struct ProbePoint {
    position: Vec3,
    normal: Vec3,
}

/// Why points or values cannot be read or written.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ProbeError {
    /// A line of the points is no header or no point.
    #[error("line {line}: {fault}")]
    Points {
        /// Line of the file, from 1.
        line: u64,
        /// What is wrong, and what to do.
        fault: String,
    },
    /// There is no place to look for points.
    #[error(
        "it carries no mesh, so points have no place in it; pack without --no-mesh, or use --elements"
    )]
    NoMesh,
    /// Direct light was not kept apart.
    #[error(
        "direct light was not kept apart; bake with --split-direct, or evaluate it with --gather"
    )]
    NoDirect,
    /// Writing failed.
    #[error(transparent)]
    Write(#[from] csv::Error),
    /// Writing failed at the end.
    #[error(transparent)]
    Io(#[from] io::Error),
}

/// The columns of a points file; they may stand in any order.
const COLUMNS: [&str; 6] = ["x", "y", "z", "nx", "ny", "nz"];

/// Reads points from CSV with the header `x,y,z,nx,ny,nz`.
///
/// # Errors
/// [`ProbeError::Points`] with the first line that is wrong.
pub fn read_points(text: &[u8]) -> Result<Vec<ProbePoint>, ProbeError> {
    let text = std::str::from_utf8(text).map_err(|error| {
        let before = text.iter().take(error.valid_up_to());
        let line = 1 + before.filter(|byte| **byte == b'\n').count() as u64;
        let fault = "not UTF-8 text; save the file as UTF-8".to_owned();
        ProbeError::Points { line, fault }
    })?;
    let mut columns = None;
    let mut points = Vec::new();
    for (row, line) in text.trim_start_matches('\u{feff}').lines().zip(1..) {
        if row.trim().is_empty() {
            continue;
        }
        let fault = |fault: String| ProbeError::Points { line, fault };
        let cells: Vec<&str> = row.split(',').map(bare).collect();
        match columns {
            None => columns = Some(header(&cells).map_err(fault)?),
            Some(columns) => points.push(point(&cells, columns).map_err(fault)?),
        }
    }
    match columns {
        Some(_) => Ok(points),
        None => Err(ProbeError::Points {
            line: 1,
            fault: header(&[]).err().unwrap_or_default(),
        }),
    }
}

/// A cell without the blanks and quotes around it.
fn bare(cell: &str) -> &str {
    let cell = cell.trim();
    let quoted = cell.strip_prefix('"').and_then(|c| c.strip_suffix('"'));
    quoted.unwrap_or(cell)
}
/// Where each of [`COLUMNS`] stands.
fn header(cells: &[&str]) -> Result<[usize; 6], String> {
    let places = COLUMNS.map(|name| cells.iter().position(|cell| *cell == name));
    match places {
        [Some(x), Some(y), Some(z), Some(nx), Some(ny), Some(nz)] if cells.len() == 6 => {
            Ok([x, y, z, nx, ny, nz])
        }
        _ => Err("the header is missing; begin the file with a line x,y,z,nx,ny,nz".to_owned()),
    }
}

fn point(cells: &[&str], columns: [usize; 6]) -> Result<ProbePoint, String> {
    if cells.len() != columns.len() {
        let count = cells.len();
        return Err(format!("{count} values; give six, x,y,z,nx,ny,nz"));
    }
    let mut values = [0.0; 6];
    for (value, column) in values.iter_mut().zip(columns) {
        let cell = cells[column];
        let number = cell.parse().ok().filter(|number: &f32| number.is_finite());
        *value = number.ok_or_else(|| format!("{cell:?} is not a finite number; correct it"))?;
    }
    let [x, y, z, nx, ny, nz] = values;
    // In f64, where the square of no f32 vanishes or overflows.
    let normal = DVec3::new(nx.into(), ny.into(), nz.into()).try_normalize();
    Ok(ProbePoint {
        position: Vec3::new(x, y, z),
        normal: normal
            .ok_or("the normal is zero; give the direction that the surface faces")?
            .as_vec3(),
    })
}

/// Which values to give.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Direct and indirect light together.
    Total,
    /// Direct light only.
    Direct,
}

/// What a probe of points found.
#[derive(Clone, Debug, PartialEq)]
pub struct Probed {
    /// The CSV: `point,light,er,eg,eb`.
    pub csv: Vec<u8>,
    /// Points without a value.
    pub missing: usize,
}

/// Irradiance at points, as CSV with the header `point,light,er,eg,eb`.
///
/// # Errors
/// [`ProbeError::NoMesh`] and [`ProbeError::NoDirect`].
pub fn probe_points(
    solution: &Solution,
    points: &[ProbePoint],
    part: Part,
) -> Result<Probed, ProbeError> {
    if solution.mesh.faces.is_empty() {
        return Err(ProbeError::NoMesh);
    }
    check_part(solution, part)?;
    let places = Places::new(solution);
    let mut table = Table::new("point")?;
    let mut missing = 0;
    for (point, number) in points.iter().zip(0..) {
        let place = places.find(point.position, point.normal);
        missing += usize::from(place == Place::None);
        for (light, tag) in solution.lights.iter().zip(0..) {
            let value = match place {
                Place::Element(element) => value(solution, element, tag, part),
                Place::Unlit => Rgb::BLACK,
                Place::None => Rgb::splat(f32::NAN),
            };
            table.row(number, &light.name, value)?;
        }
    }
    Ok(Probed {
        csv: table.finish()?,
        missing,
    })
}

/// Rays that gather light at a point, by default.
pub const RAYS: u32 = 2048;

/// Most of them.
pub const MOST_RAYS: i64 = 1 << 20;

/// The same, with direct light evaluated exactly at every point and indirect light gathered there by
/// so many rays.
///
/// # Errors
/// [`ProbeError::NoMesh`].
pub fn probe_gathered(
    solution: &Solution,
    points: &[ProbePoint],
    part: Part,
    rays: u32,
) -> Result<Probed, ProbeError> {
    if solution.mesh.faces.is_empty() {
        return Err(ProbeError::NoMesh);
    }
    let places = Places::new(solution);
    let gatherer = Gatherer::new(solution, rays).with_exact_far_patches();
    let values: Vec<Option<Vec<Rgb>>> = points
        .par_iter()
        .enumerate()
        .map(|(number, point)| {
            let (surface, side) = places.side(point.position, point.normal)?;
            let spot = gatherer.spot(surface, side, point.position)?;
            Some(gatherer.irradiance(spot, part, number as u64))
        })
        .collect();
    let mut table = Table::new("point")?;
    let unknown = vec![Rgb::splat(f32::NAN); solution.lights.len()];
    for (values, number) in values.iter().zip(0..) {
        let values = values.as_ref().unwrap_or(&unknown);
        for (light, value) in solution.lights.iter().zip(values) {
            table.row(number, &light.name, *value)?;
        }
    }
    Ok(Probed {
        csv: table.finish()?,
        missing: values.iter().filter(|values| values.is_none()).count(),
    })
}

/// Irradiance per element, as CSV with the header `element,light,er,eg,eb`.
///
/// # Errors
/// [`ProbeError::NoDirect`].
pub fn probe_elements(solution: &Solution, part: Part) -> Result<Vec<u8>, ProbeError> {
    check_part(solution, part)?;
    let mut table = Table::new("element")?;
    let lights = solution.lights.len();
    let elements = solution
        .contributions
        .len()
        .checked_div(lights)
        .unwrap_or(0);
    for element in 0..elements {
        for (light, tag) in solution.lights.iter().zip(0..) {
            table.row(element, &light.name, value(solution, element, tag, part))?;
        }
    }
    table.finish()
}

fn check_part(solution: &Solution, part: Part) -> Result<(), ProbeError> {
    if part == Part::Direct && solution.direct.is_none() {
        return Err(ProbeError::NoDirect);
    }
    Ok(())
}

fn value(solution: &Solution, element: usize, light: usize, part: Part) -> Rgb {
    let values = match part {
        Part::Total => Some(solution.element(element)),
        Part::Direct => solution.element_direct(element),
    };
    let value = values.and_then(|values| values.get(light));
    value.copied().unwrap_or_default()
}

struct Table(csv::Writer<Vec<u8>>);

impl Table {
    fn new(first: &str) -> Result<Self, ProbeError> {
        let mut writer = csv::Writer::from_writer(Vec::new());
        writer.write_record([first, "light", "er", "eg", "eb"])?;
        Ok(Self(writer))
    }

    /// Floats are written with as many digits as bring them back.
    fn row(&mut self, number: usize, light: &str, value: Rgb) -> Result<(), ProbeError> {
        let [r, g, b] = value.to_array().map(written);
        self.0
            .write_record([&number.to_string(), light, &r, &g, &b])?;
        Ok(())
    }

    fn finish(self) -> Result<Vec<u8>, ProbeError> {
        self.0.into_inner().map_err(|e| e.into_error().into())
    }
}

fn written(value: f32) -> String {
    if value.is_nan() {
        "nan".to_owned()
    } else {
        value.to_string()
    }
}

/// Where a point lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Place {
    Element(usize),
    Unlit,
    None,
}

/// The sides of a solution's surfaces, to be searched by place.
struct Places<'a> {
    solution: &'a Solution,
    locator: Locator<'a>,
    reach: f32,
}

impl<'a> Places<'a> {
    fn new(solution: &'a Solution) -> Self {
        let diagonal = solution
            .bounds()
            .map_or(0.0, |(low, high)| (high - low).length());
        Self {
            solution,
            locator: Locator::new(solution.mesh.view()),
            reach: REACH * diagonal,
        }
    }

    fn find(&self, position: Vec3, normal: Vec3) -> Place {
        let Some((surface, side)) = self.side(position, normal) else {
            return Place::None;
        };
        match self.locator.face(surface, side) {
            None => Place::Unlit,
            Some(_) => self
                .locator
                .element(surface, side, position)
                .map_or(Place::None, |element| Place::Element(element as usize)),
        }
    }

    /// The side of a surface on which a point lies.
    fn side(&self, position: Vec3, normal: Vec3) -> Option<(u32, Side)> {
        let sides = self
            .solution
            .surfaces
            .iter()
            .zip(0..)
            .filter_map(|(outline, surface)| {
                let cosine = outline.normal().dot(normal);
                let side = if cosine >= LEAST_COSINE {
                    Side::Front
                } else if cosine <= -LEAST_COSINE {
                    Side::Back
                } else {
                    return None;
                };
                let distance = distance(outline, position);
                (distance <= self.reach).then_some((distance, surface, side))
            });
        let nearest = sides.min_by(|a, b| a.0.total_cmp(&b.0));
        nearest.map(|(_, surface, side)| (surface, side))
    }
}

/// Distance from a point to a polygon.
fn distance(polygon: &Polygon, point: Vec3) -> f32 {
    let normal = polygon.normal();
    let height = (point - polygon.origin()).dot(normal);
    let is_above = polygon
        .edges()
        .all(|(a, b)| (b - a).cross(point - a).dot(normal) >= 0.0);
    if is_above {
        return height.abs();
    }
    polygon
        .edges()
        .map(|(a, b)| {
            let edge = b - a;
            let along = ((point - a).dot(edge) / edge.length_squared()).clamp(0.0, 1.0);
            (point - (a + edge * along)).length()
        })
        .fold(f32::INFINITY, f32::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bake::{Settings, bake};
    use crate::builtin;
    use std::ops::ControlFlow;

    fn room() -> Solution {
        let settings = Settings {
            patch: Some(1.0),
            element: Some(0.5),
            residual: 0.1,
            ..Settings::default()
        };
        let scene = builtin::paper_room(builtin::PaperLamps::One).unwrap().scene;
        bake(&scene, &settings, &mut |_| ControlFlow::Continue(())).unwrap()
    }

    #[test]
    fn element_centres_find_their_elements() {
        let solution = room();
        let places = Places::new(&solution);
        let mesh = solution.mesh.view();
        for (element, number) in mesh.elements.iter().zip(0..) {
            let outline = mesh.element_polygon(element).unwrap();
            let found = places.find(outline.center(), outline.normal());
            assert_eq!(found, Place::Element(number));
        }
    }

    #[test]
    fn points_off_the_surface_or_turned_away_have_no_value() {
        let solution = room();
        let places = Places::new(&solution);
        let floor = Vec3::new(0.6, 0.0, 0.6);
        assert!(matches!(places.find(floor, Vec3::Y), Place::Element(_)));
        assert_eq!(places.find(floor, -Vec3::Y), Place::Unlit);
        assert_eq!(places.find(floor + Vec3::Y * 0.1, Vec3::Y), Place::None);
        assert_eq!(places.find(floor, Vec3::X), Place::None);
        let points = read_points(b"x,y,z,nx,ny,nz\n0.6,0,0.6,0,2,0\n9,9,9,0,1,0\n").unwrap();
        let probed = probe_points(&solution, &points, Part::Total).unwrap();
        let text = String::from_utf8(probed.csv).unwrap();
        assert_eq!(probed.missing, 1);
        assert!(
            text.starts_with("point,light,er,eg,eb\n0,light_0,"),
            "{text}"
        );
        assert!(text.ends_with("1,light_0,nan,nan,nan\n"), "{text}");
    }

    #[test]
    fn bad_points_name_their_line_and_the_remedy() {
        for (text, line, expected) in [
            ("", 1, "begin the file with a line x,y,z,nx,ny,nz"),
            ("\n \n", 1, "begin the file"),
            ("0.6,0,0.6,0,2,0\n", 1, "begin the file"),
            ("\n\n0.6,0,0.6,0,2,0\n", 3, "begin the file"),
            ("x,y,z,nx,ny,nz,w\n", 1, "begin the file"),
            ("x,y,z,nx,ny,ny\n", 1, "begin the file"),
            ("x,y,z,nx,ny,nz\n0,0,0,0,0,0\n", 2, "the normal is zero"),
            ("x,y,z,nx,ny,nz\n0,0,0,0,1,0\n0,0,0,0,nan,0\n", 3, "\"nan\""),
            ("\nx,y,z,nx,ny,nz\n\r\n\n0,up,0,0,1,0\n", 5, "\"up\" is not"),
            (
                "x,y,z,nx,ny,nz\n0,0,0,0,1,0\n\n0,0\n",
                4,
                "2 values; give six",
            ),
            ("x,y,z,nx,ny,nz\n0,0,0,0,1,0,\n", 2, "7 values"),
        ] {
            let error = read_points(text.as_bytes()).unwrap_err().to_string();
            assert!(
                error.starts_with(&format!("line {line}: ")),
                "{text:?}: {error}"
            );
            assert!(error.contains(expected), "{text:?}: {error}");
        }
        let error = read_points(b"x,y,z,nx,ny,nz\n\n\xff").unwrap_err();
        assert!(
            error.to_string().starts_with("line 3: not UTF-8"),
            "{error}"
        );
    }

    #[test]
    fn points_are_read_as_spreadsheets_write_them() {
        let text = "\u{feff}\"nx\", \"ny\", \"nz\", \"x\", \"y\", \"z\"\r\n\r\n0,1e-30,0,1,2,3\r\n";
        let points = read_points(text.as_bytes()).unwrap();
        assert_eq!(points.len(), 1);
        assert_eq!(
            (points[0].position, points[0].normal),
            (Vec3::new(1.0, 2.0, 3.0), Vec3::Y)
        );
        assert!(read_points(b"x,y,z,nx,ny,nz").unwrap().is_empty());
    }
}
