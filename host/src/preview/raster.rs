//! Scan conversion with hidden surfaces removed, and the picture's resolution to pixels.
//!
//! Every pixel has 16 samples on a sheared 4 x 4 grid: each of its 16 sixteenths of a row, and of
//! a column, holds one, so edges along the axes are smoothed as finely as any. A sample keeps the
//! nearest facet. A facet is then shaded once per pixel, at the mean of the samples that see it,
//! and a pixel is the plain mean of its samples in linear light (box filter).
//!
//! In the coordinates of a point `(x, y)` of the picture, with `d` its ray (see
//! [`super::camera`]), `n` a facet's normal and `p_i` its vertices seen from the eye:
//! * nearness: `1 / depth = (n . d) / (n . p_0)`, linear in `(x, y)`;
//! * outline: the ray passes inside the edge `p_i -> p_j` when `(p_j x p_i) . d >= 0`, linear too.
//!
//! Both hold for facets that reach behind the camera, so nothing has to be clipped, and there is
//! no near plane: a surface hides what is behind it at any distance. Outlines count as inside,
//! widened by 1/64 pixel (a quarter of the distance between sample rows), so that no background
//! shows where edges meet, exactly or in T-junctions. Black sides are widened by 1/1024 pixel, just
//! above rounding: the black inside of a closed body must not darken its outline. Emitters win
//! against surfaces in their own plane (lamps flat on a ceiling).

use std::ops::Range;

use glam::DVec3;
use rayon::prelude::*;
use relume::color::Rgb;

use super::Gathered;
use super::camera::Camera;
use super::shading::Facet;
use crate::picture::LinearImage;

/// Samples per pixel, one in each sample row.
const SAMPLES: u32 = 16;
/// Rows of pixels that are worked on at a time.
const BAND: u32 = 8;
/// By how much outlines are widened, in pixels.
const WIDENING: f64 = 1.0 / 64.0;
/// The same for black sides.
const DARK_WIDENING: f64 = 1.0 / 1024.0;
/// By how much an emitter is nearer than it is.
const EMITTER_BIAS: f64 = 1.0 + 1e-5;
/// No facet.
const NOTHING: u32 = u32::MAX;

/// Where the sample of a sample row lies in its pixel, in pixels from the left.
fn sample_x(row: u32) -> f64 {
    let (group, within) = (row / 4, row % 4);
    (f64::from(4 * (3 - within) + group) + 0.5) / f64::from(SAMPLES)
}

/// Where a sample row lies, in pixels from the top of the picture.
fn sample_y(row: u32) -> f64 {
    (f64::from(row) + 0.5) / f64::from(SAMPLES)
}

/// A facet on the screen.
struct Outline {
    facet: u32,
    /// Edges `a x + b y + c`, not negative inside, in pixels.
    edges: Vec<[f64; 3]>,
    /// Nearness `a x + b y + c`.
    nearness: [f64; 3],
    /// Smallest and largest x and y that it may reach.
    x: [f64; 2],
    y: [f64; 2],
}

impl Outline {
    /// The outline of a facet whose front faces the eye; `None` when the picture shows none of it.
    fn new(camera: &Camera, facet: &Facet, number: u32) -> Option<Self> {
        let corners: Vec<DVec3> = facet
            .polygon
            .vertices()
            .iter()
            .map(|v| camera.towards(*v))
            .collect();
        let widening = if facet.is_dark() {
            DARK_WIDENING
        } else {
            WIDENING
        };
        let next = corners.iter().cycle().skip(1);
        let edges = corners.iter().zip(next).map(|(a, b)| {
            let [a, b, c] = in_pixels(camera.line(b.cross(*a)));
            [a, b, c + widening]
        });

        let normal = facet.polygon.normal().as_dvec3();
        let bias = if facet.is_lamp { EMITTER_BIAS } else { 1.0 };
        let scale = bias / normal.dot(corners[0]);
        let nearness = camera.line(normal).map(|coefficient| coefficient * scale);

        let on_screen: Vec<_> = corners.iter().map(|p| camera.project(*p)).collect();
        let [x, y] = [0, 1].map(|axis| extent(&on_screen, axis, widening));
        let (width, height) = camera.size();
        let is_beside = x[1] < 0.0 || x[0] > width.into() || y[1] < 0.0 || y[0] > height.into();
        let is_behind = on_screen.iter().all(Option::is_none);
        (!is_beside && !is_behind).then_some(Self {
            facet: number,
            edges: edges.collect(),
            nearness,
            x,
            y,
        })
    }

    /// The sample rows that it may reach, out of some.
    fn rows(&self, rows: &Range<u32>) -> Range<u32> {
        let row = |y: f64| y * f64::from(SAMPLES) - 0.5;
        let first = row(self.y[0]).ceil() as u32; // saturates, as all casts from floats do
        let end = (row(self.y[1]).floor() + 1.0) as u32;
        first.max(rows.start)..end.min(rows.end)
    }

    /// The pixels whose sample it covers in a sample row.
    fn span(&self, row: u32, width: u32) -> Range<usize> {
        let y = sample_y(row);
        let [mut low, mut high] = self.x;
        for [a, b, c] in &self.edges {
            let rest = b * y + c;
            if *a > 0.0 {
                low = low.max(-rest / a);
            } else if *a < 0.0 {
                high = high.min(-rest / a);
            } else if rest < 0.0 {
                return 0..0;
            }
        }
        let first = (low - sample_x(row % SAMPLES)).ceil().max(0.0) as usize;
        let end = ((high - sample_x(row % SAMPLES)).floor() + 1.0).max(0.0) as usize;
        first..end.min(width as usize)
    }
}

/// A line scaled so that it measures distance on the screen; unchanged when it is at infinity.
fn in_pixels([a, b, c]: [f64; 3]) -> [f64; 3] {
    let slope = a.hypot(b);
    if slope > 0.0 {
        [a, b, c].map(|coefficient| coefficient / slope)
    } else {
        [a, b, c]
    }
}

/// Smallest and largest coordinate of an outline, widened; everything if it reaches behind.
fn extent(on_screen: &[Option<[f64; 2]>], axis: usize, widening: f64) -> [f64; 2] {
    let mut extent = [f64::INFINITY, f64::NEG_INFINITY];
    for point in on_screen {
        let Some(point) = point else {
            return [f64::NEG_INFINITY, f64::INFINITY];
        };
        extent[0] = extent[0].min(point[axis] - widening);
        extent[1] = extent[1].max(point[axis] + widening);
    }
    extent
}

/// What a sample sees.
#[derive(Clone, Copy)]
struct Sample {
    nearness: f32,
    facet: u32,
}

/// What is painted.
#[derive(Clone, Copy)]
pub(super) struct View<'a> {
    pub(super) camera: &'a Camera,
    /// Their fronts face the eye.
    pub(super) facets: &'a [Facet],
    /// Where irradiance comes from, unless it is that of the facets.
    pub(super) gathered: Option<Gathered<'a>>,
}

/// Paints a picture. Samples brighter than `brightest` (W/m2/sr, per channel) count as that bright.
pub(super) fn paint(view: View, brightest: f32) -> LinearImage {
    let outlines: Vec<Outline> = view
        .facets
        .iter()
        .zip(0..NOTHING)
        .filter_map(|(facet, number)| Outline::new(view.camera, facet, number))
        .collect();

    let (width, height) = view.camera.size();
    let mut image = LinearImage::empty(width, height);
    let bands = image.pixels.par_chunks_mut((width * BAND) as usize);
    bands
        .zip(0..height.div_ceil(BAND))
        .for_each(|(pixels, band)| {
            let top = band * BAND;
            let rows = top * SAMPLES..(top + BAND).min(height) * SAMPLES;
            let samples = visible(&outlines, rows, width);
            for (pixel, place) in pixels.iter_mut().zip(0..) {
                let (x, y) = (place % width, place / width);
                let own = |row: u32| samples[((y * SAMPLES + row) * width + x) as usize].facet;
                *pixel = resolve(view, brightest, [x, top + y], own);
            }
        });
    image
}

/// The nearest facet of every sample of some sample rows, row by row.
fn visible(outlines: &[Outline], rows: Range<u32>, width: u32) -> Vec<Sample> {
    let nothing = Sample {
        nearness: 0.0,
        facet: NOTHING,
    };
    let mut samples = vec![nothing; rows.len() * width as usize];
    for outline in outlines {
        for row in outline.rows(&rows) {
            let span = outline.span(row, width);
            let start = (row - rows.start) as usize * width as usize;
            let [a, b, c] = outline.nearness;
            let left = a * sample_x(row % SAMPLES) + b * sample_y(row) + c;
            let Some(seen) = samples.get_mut(start + span.start..start + span.end) else {
                continue;
            };
            for (sample, x) in seen.iter_mut().zip(span) {
                let nearness = (left + a * x as f64) as f32;
                if nearness > sample.nearness {
                    *sample = Sample {
                        nearness,
                        facet: outline.facet,
                    };
                }
            }
        }
    }
    samples
}

/// A pixel from the facets that its samples see: premultiplied colour and coverage.
fn resolve(view: View, brightest: f32, pixel: [u32; 2], facet_of: impl Fn(u32) -> u32) -> [f32; 4] {
    let seen: [u32; SAMPLES as usize] = std::array::from_fn(|row| facet_of(row as u32));
    let mut sum = Rgb::BLACK;
    let mut covered = 0;
    for (first, facet) in seen.iter().enumerate() {
        if *facet == NOTHING || seen[..first].contains(facet) {
            continue;
        }
        let (count, at) = mean_place(&seen, *facet);
        let radiance = radiance(view, &view.facets[*facet as usize], pixel, at);
        sum += radiance.map(|c| c.min(brightest)) * count as f32;
        covered += count;
    }
    let share = 1.0 / SAMPLES as f32;
    let [r, g, b] = (sum * share).to_array();
    [r, g, b, covered as f32 * share]
}

/// How many samples of a pixel see a facet, and their mean place in the pixel.
fn mean_place(seen: &[u32], facet: u32) -> (u32, [f64; 2]) {
    let rows = seen.iter().zip(0..).filter(|(own, _)| **own == facet);
    let (count, x, y) = rows.fold((0, 0.0, 0.0), |(count, x, y), (_, row)| {
        (count + 1, x + sample_x(row), y + sample_y(row))
    });
    (count, [x, y].map(|sum| sum / f64::from(count)))
}

/// Radiance of a facet where the ray through a place of a pixel meets it.
fn radiance(view: View, facet: &Facet, [x, y]: [u32; 2], at: [f64; 2]) -> Rgb {
    let camera = view.camera;
    let ray = camera.ray(f64::from(x) + at[0], f64::from(y) + at[1]);
    let normal = facet.polygon.normal().as_dvec3();
    let from_eye = camera.towards(facet.polygon.origin());
    let depth = normal.dot(from_eye) / normal.dot(ray);
    let offset = ray * depth - from_eye;
    let number = u64::from(y) * u64::from(camera.size().0) + u64::from(x);
    let point = facet.polygon.origin() + offset.as_vec3();
    facet.radiance(point, view.gathered, number)
}
