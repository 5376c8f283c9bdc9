//! Visibility: rays per second of the tree of boxes and of brute force, on one thread.
//!
//! Rooms of 12, 100 and 1000 polygons, the smallest the paper's (without lamps), the others the
//! same with small squares that float in it. `row` are rays as a row of form factors asks for them,
//! from 64 points next to each other to 16 points of one patch; `scattered` run between
//! places all over the room. `nearest` are rays that elements gather by, for the surface they meet.

mod scenes;

use criterion::{BenchmarkId, Criterion, Throughput};
use glam::{Vec2, Vec3};
use relume::color::Rgb;
use relume::geometry::from_unit_square;
use relume::scene::Surface;
use relume::visibility::{Occluders, Visibility};
use relume_host::builtin::PaperLamps;
use relume_host::bvh::{Bvh, lifted};

/// Rays of one set.
const RAYS: u32 = 1024;

/// Rays of a set that is too long to be learnt by heart by a processor.
const GATHERED: u32 = 1 << 14;

/// Edge of the room, in m.
const ROOM: f32 = 3.0;

/// Edge of a floating square, in m.
const SQUARE: f32 = 0.15;

type Segment = (Vec3, Vec3);

fn main() {
    let mut criterion = scenes::criterion();
    for polygons in [12, 100, 1000] {
        let surfaces = cluttered_room(polygons);
        compare(&mut criterion, "row", &surfaces, &row_rays(&surfaces));
        compare(&mut criterion, "scattered", &surfaces, &scattered_rays());
    }
    measure_nearest(
        &mut criterion,
        "Cornell box",
        &scenes::cornell().scene.surfaces,
    );
    for polygons in [20, 100, 1000, 10_000] {
        measure_nearest(&mut criterion, "room", &cluttered_room(polygons));
    }
    criterion.final_summary();
}

fn compare(criterion: &mut Criterion, rays: &str, surfaces: &[Surface], segments: &[Segment]) {
    let (bvh, brute) = (Bvh::new(surfaces, 100.0), Occluders(surfaces));
    let open = count_open(&bvh, segments);
    assert_eq!(open, count_open(&brute, segments), "both answer alike");

    let mut group = criterion.benchmark_group(format!("visibility/{rays}"));
    group.throughput(Throughput::Elements(segments.len() as u64));
    group.bench_function(BenchmarkId::new("tree", surfaces.len()), |bencher| {
        bencher.iter(|| count_open(&bvh, segments));
    });
    group.bench_function(BenchmarkId::new("brute force", surfaces.len()), |bencher| {
        bencher.iter(|| count_open(&brute, segments));
    });
    group.finish();
}

fn count_open(visibility: &impl Visibility, segments: &[Segment]) -> usize {
    let open = segments
        .iter()
        .filter(|(from, to)| visibility.sees(*from, *to));
    open.count()
}

/// Rays as elements gather by them, one by one: about the normal of a place on any surface.
fn measure_nearest(criterion: &mut Criterion, scene: &str, surfaces: &[Surface]) {
    let bvh = Bvh::new(surfaces, 100.0);
    let rays: Vec<(Vec3, Vec3)> = (0..GATHERED)
        .map(|ray| gathered_ray(surfaces, ray))
        .collect();
    let mut group = criterion.benchmark_group("visibility/nearest");
    group.throughput(Throughput::Elements(rays.len() as u64));
    group.bench_function(BenchmarkId::new(scene, surfaces.len()), |bencher| {
        bencher.iter(|| {
            let mut caster = bvh.caster();
            let hits = rays
                .iter()
                .filter(|(from, direction)| caster.nearest(*from, *direction).is_some());
            hits.count()
        });
    });
    group.finish();
}

fn gathered_ray(surfaces: &[Surface], ray: u32) -> (Vec3, Vec3) {
    let polygon = surfaces[ray as usize % surfaces.len()].polygon();
    let start = from_unit_square(polygon, scatter(2 * ray).truncate()).0;
    let at = scatter(2 * ray + 1) * 2.0 - 1.0;
    let direction = (polygon.normal() + at.normalize()).normalize();
    (lifted(polygon, start), direction)
}

/// The paper's room with as many floating squares as make up the number of polygons.
fn cluttered_room(polygons: usize) -> Vec<Surface> {
    let mut surfaces = scenes::room(PaperLamps::One).scene.surfaces;
    surfaces.truncate(12);
    let squares = (0..).map(|number| {
        let place = scatter(2 * number) * (ROOM - SQUARE) + SQUARE / 2.0;
        let normal = (scatter(2 * number + 1) - 0.5).normalize();
        let (u, v) = normal.any_orthonormal_pair();
        let (u, v) = (u * SQUARE / 2.0, v * SQUARE / 2.0);
        let corners = [place - u - v, place + u - v, place + u + v, place - u + v];
        Surface::new(number, &corners, Rgb::splat(0.5)).expect("a legal square")
    });
    let missing = polygons - surfaces.len();
    surfaces.extend(squares.take(missing));
    surfaces
}

/// From an 8 x 8 grid on a square metre of the floor to 4 x 4 points of one of the ceiling.
fn row_rays(surfaces: &[Surface]) -> Vec<Segment> {
    let third = |surface: &Surface| surface.polygon().part(Vec2::ZERO, Vec2::splat(1.0 / 3.0));
    let (receivers, patch) = (third(&surfaces[0]), third(&surfaces[1]));
    grid(8)
        .flat_map(|at| {
            let from = from_unit_square(&receivers, at).0;
            grid(4).map(move |at| (from, from_unit_square(&patch, at).0))
        })
        .collect()
}

/// Middles of the cells of a unit square.
fn grid(side: u32) -> impl Iterator<Item = Vec2> {
    let middle = move |cell: u32| (cell as f32 + 0.5) / side as f32;
    (0..side * side).map(move |cell| Vec2::new(middle(cell % side), middle(cell / side)))
}

fn scattered_rays() -> Vec<Segment> {
    let ends = |ray: u32| (scatter(2 * ray) * ROOM, scatter(2 * ray + 1) * ROOM);
    (0..RAYS).map(ends).collect()
}

/// Points spread over the unit cube: the additive recurrence of the root of `x^4 = x + 1`
/// (Roberts 2018).
fn scatter(number: u32) -> Vec3 {
    let steps = [0.819_172_513_4, 0.671_043_606_7, 0.549_700_477_9];
    let place = |step: f64| (step * f64::from(number + 1)).fract() as f32;
    Vec3::from_array(steps.map(place))
}
