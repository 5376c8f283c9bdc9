//! The table of the spotlight paper (West 2007): form factors of a cube of 6 to 384 faces.
//!
//! All pairs, by the kernel between centres and a test of every face for being in between; `basic` takes
//! centres and normals from the vertices each time, `stored` looks them up, `half` takes `A_i F_ij = A_j F_ji`
//! for half of the pairs. Then Gauss-Seidel sweeps, `B_i = M_i + rho sum_j F_ij B_j`, with rows divided by their
//! sum as there, until no radiosity changes by more than 1e-4 of itself. Beside them our exact
//! rows on the same faces. The paper's own times are lost: its text has the words of the table, not the numbers.

use anyhow::Result;
use glam::Vec3;
use relume::mesh::Spacing;

use super::clock::{median, seconds};
use super::rooms::Room;
use crate::builtin::white_furnace;
use crate::chart::{Chart, Series, Style, Vertical};
use crate::rows::Parallel;
use crate::study::system::System;

/// Reflectance of the cube.
const REFLECTANCE: f64 = 0.8;

/// Change of a radiosity at which sweeps end, relative to it.
const SETTLED: f64 = 1e-4;

/// A column of the table.
#[derive(Clone, Debug)]
pub struct Faces {
    /// Number of faces.
    pub faces: usize,
    /// Milliseconds: basic, stored geometry, half the matrix.
    pub published: [f64; 3],
    /// Milliseconds of our exact rows.
    pub exact: f64,
    /// Largest difference of a receiver sum from one, before rows are divided by it.
    pub sums: f64,
    /// The same of our rows.
    pub exact_sums: f64,
    /// Gauss-Seidel sweeps.
    pub sweeps: u32,
    /// Milliseconds of them.
    pub sweeping: f64,
}

/// A face as the paper stores it: its corners, counter-clockwise.
struct Quad([Vec3; 4]);

impl Quad {
    fn centre(&self) -> Vec3 {
        self.0.iter().sum::<Vec3>() / 4.0
    }

    fn normal(&self) -> Vec3 {
        let [a, b, _, d] = self.0;
        (b - a).cross(d - a).normalize_or_zero()
    }

    fn area(&self) -> f32 {
        let [a, b, _, d] = self.0;
        (b - a).cross(d - a).length()
    }
}

/// What is stored of a face.
struct Stored<'a> {
    quad: &'a Quad,
    centre: Vec3,
    normal: Vec3,
    area: f32,
}

impl<'a> Stored<'a> {
    fn new(quad: &'a Quad) -> Self {
        Self {
            quad,
            centre: quad.centre(),
            normal: quad.normal(),
            area: quad.area(),
        }
    }
}

/// `cos a cos b / (pi r^2)`, or 0 when a face is in between.
fn geometry<'a>(a: &Stored, b: &Stored, faces: impl Iterator<Item = Stored<'a>>) -> f32 {
    let ray = b.centre - a.centre;
    let square = ray.length_squared();
    let cosines = ray.dot(a.normal).max(0.0) * (-ray.dot(b.normal)).max(0.0);
    let mut between = faces.filter(|face| is_between(face, a.centre, ray));
    if cosines <= 0.0 || between.next().is_some() {
        return 0.0;
    }
    cosines / square / square / std::f32::consts::PI
}

/// True when the open segment goes through the face.
fn is_between(face: &Stored, from: Vec3, ray: Vec3) -> bool {
    let along = ray.dot(face.normal);
    let fraction = (face.centre - from).dot(face.normal) / along;
    if !(1e-4..=1.0 - 1e-4).contains(&fraction) {
        return false;
    }
    let at = from + ray * fraction;
    let corners = face.quad.0;
    let next = corners.iter().cycle().skip(1);
    let mut edges = corners.iter().zip(next);
    edges.all(|(a, b)| (*b - *a).cross(at - *a).dot(face.normal) >= 0.0)
}

/// A way to fill the matrix of form factors.
type Version = fn(&[Quad], &mut [f32]);

/// Everything from the vertices, for every pair and every test.
fn basic(quads: &[Quad], matrix: &mut [f32]) {
    let n = quads.len();
    for (i, row) in matrix.chunks_mut(n).enumerate() {
        for (j, factor) in row.iter_mut().enumerate() {
            let (a, b) = (Stored::new(&quads[i]), Stored::new(&quads[j]));
            *factor = if i == j {
                0.0
            } else {
                b.area * geometry(&a, &b, quads.iter().map(Stored::new))
            };
        }
    }
}

/// Centres, normals and areas are looked up.
fn stored(quads: &[Quad], matrix: &mut [f32]) {
    let faces: Vec<Stored> = quads.iter().map(Stored::new).collect();
    for (a, row) in faces.iter().zip(matrix.chunks_mut(faces.len())) {
        for (b, factor) in faces.iter().zip(row) {
            *factor = if std::ptr::eq(a, b) {
                0.0
            } else {
                b.area * geometry(a, b, copies(&faces))
            };
        }
    }
}

/// And every pair is looked at once.
fn half(quads: &[Quad], matrix: &mut [f32]) {
    let faces: Vec<Stored> = quads.iter().map(Stored::new).collect();
    let n = faces.len();
    for (i, a) in faces.iter().enumerate() {
        for (j, b) in faces.iter().enumerate().skip(i + 1) {
            let geometry = geometry(a, b, copies(&faces));
            matrix[i * n + j] = b.area * geometry;
            matrix[j * n + i] = a.area * geometry;
        }
    }
}

fn copies<'a>(faces: &'a [Stored<'a>]) -> impl Iterator<Item = Stored<'a>> {
    faces.iter().map(|face| Stored { ..*face })
}

/// Sweeps until nothing changes, and how many they were; face 0 emits.
fn gauss_seidel(matrix: &[f32], n: usize) -> u32 {
    let sums: Vec<f64> = matrix
        .chunks(n)
        .map(|row| row.iter().map(|f| f64::from(*f)).sum())
        .collect();
    let mut radiosity = vec![0.0; n];
    for sweep in 1.. {
        let mut change = 0.0_f64;
        for (i, row) in matrix.chunks(n).enumerate() {
            let arriving = row.iter().zip(&radiosity).map(|(f, b)| f64::from(*f) * b);
            let emitted = if i == 0 { 1.0 } else { 0.0 };
            let next: f64 = emitted + REFLECTANCE * arriving.sum::<f64>() / sums[i];
            change = change.max((next - radiosity[i]).abs() / next.max(f64::MIN_POSITIVE));
            radiosity[i] = next;
        }
        if change <= SETTLED {
            return sweep;
        }
    }
    0
}

/// Time over the number of faces.
pub fn chart(columns: &[Faces]) -> Chart {
    let series = |name: &str, milliseconds: fn(&Faces) -> f64| {
        let point = |column: &Faces| (column.faces as f64, milliseconds(column));
        Series::new(name, Style::Curve, columns.iter().map(point))
    };
    Chart {
        title: "form factors of a cube's faces, and sweeps".to_owned(),
        x: "number of faces".to_owned(),
        y: Vertical::Values("time on one thread (ms)".to_owned()),
        series: vec![
            series("basic", |column| column.published[0]),
            series("stored geometry", |column| column.published[1]),
            series("half matrix, by reciprocity", |column| column.published[2]),
            series("our exact rows", |column| column.exact),
            series("Gauss-Seidel sweeps", |column| column.sweeping),
        ],
    }
}

/// A unit cube with `side * side` faces on each wall.
pub fn measure(side: u32, repeats: usize) -> Result<Faces> {
    let edge = 1.0 / side as f32;
    let spacing = Spacing {
        patch: edge,
        element: edge,
    };
    let room = Room::new(white_furnace(REFLECTANCE as f32, 1.0)?.scene, spacing)?;
    let mesh = room.mesh.view();
    let quad = |patch| {
        let polygon = mesh.patch_polygon(patch)?;
        Some(Quad(polygon.vertices().try_into().ok()?))
    };
    let quads: Vec<Quad> = (0..mesh.patches.len() as u32).filter_map(quad).collect();
    let n = quads.len();

    let versions: [Version; 3] = [basic, stored, half];
    let mut matrix = vec![0.0; n * n];
    let mut times = [Vec::new(), Vec::new(), Vec::new()];
    let (mut exact, mut sweeping, mut sweeps) = (Vec::new(), Vec::new(), 0);
    let ours = || System::new(room.mesh.clone(), 1, &Parallel::new(&mesh, &room.bvh));
    for _ in 0..repeats {
        for (version, times) in versions.iter().zip(&mut times) {
            times.push(1e3 * seconds(|| version(&quads, &mut matrix)));
        }
        exact.push(1e3 * seconds(ours));
        sweeping.push(1e3 * seconds(|| sweeps = gauss_seidel(&matrix, n)));
    }
    let sums = matrix
        .chunks(n)
        .map(|row| row.iter().map(|f| f64::from(*f)).sum());
    let off = |sum: f64| (sum - 1.0).abs();
    Ok(Faces {
        faces: n,
        published: times.map(median),
        exact: median(exact),
        sums: sums.map(off).fold(0.0, f64::max),
        exact_sums: ours()
            .receiver_sums()
            .into_iter()
            .map(off)
            .fold(0.0, f64::max),
        sweeps,
        sweeping: median(sweeping),
    })
}
