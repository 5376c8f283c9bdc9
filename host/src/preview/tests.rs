use std::f32::consts::PI;

use glam::{Mat3, Vec3};
use relume::color::Rgb;
use relume::mesh::{self, Element, Face, Mesh, MeshError, MeshSink, Patch, Spacing};
use relume::scene::{Emission, Scene, Surface};

use super::*;

/// A mesh on the heap.
#[derive(Default)]
struct Parts {
    faces: Vec<Face>,
    patches: Vec<Patch>,
    elements: Vec<Element>,
}

impl MeshSink for Parts {
    fn face(&mut self, face: Face) -> Result<(), MeshError> {
        self.faces.push(face);
        Ok(())
    }

    fn patch(&mut self, patch: Patch) -> Result<(), MeshError> {
        self.patches.push(patch);
        Ok(())
    }

    fn element(&mut self, element: Element) -> Result<(), MeshError> {
        self.elements.push(element);
        Ok(())
    }
}

/// Surfaces, their mesh and what it receives.
struct Stage {
    surfaces: Vec<Polygon>,
    parts: Parts,
    irradiance: Vec<Rgb>,
}

impl Stage {
    /// Divides surfaces; `light` gives the irradiance at an element's centre and normal.
    fn new(surfaces: Vec<Surface>, element: f32, light: impl Fn(Vec3, Vec3) -> Rgb) -> Self {
        let scene = Scene::new(&surfaces, &[], 1).unwrap();
        let mut parts = Parts::default();
        let spacing = Spacing {
            patch: 100.0 * element,
            element,
        };
        mesh::subdivide(&scene, spacing, |_, _| true, &mut parts).unwrap();
        let mut stage = Self {
            surfaces: surfaces.iter().map(|surface| *surface.polygon()).collect(),
            parts,
            irradiance: Vec::new(),
        };
        let mesh = stage.mesh();
        let outlines = mesh
            .elements
            .iter()
            .map(|e| mesh.element_polygon(e).unwrap());
        stage.irradiance = outlines.map(|o| light(o.center(), o.normal())).collect();
        stage
    }

    fn mesh(&self) -> Mesh<'_> {
        Mesh {
            faces: &self.parts.faces,
            patches: &self.parts.patches,
            elements: &self.parts.elements,
        }
    }

    fn render(&self, camera: &Camera, brightest: f32) -> LinearImage {
        let exitance = |face: &Face| face.emission.map_or(Rgb::BLACK, |emission| emission.share);
        let relit = Relit {
            mesh: self.mesh(),
            surfaces: &self.surfaces,
            irradiance: &self.irradiance,
            exitance: &self.parts.faces.iter().map(exitance).collect::<Vec<_>>(),
            gathered: None,
        };
        render(&relit, camera, brightest).unwrap()
    }
}

/// Everything receives `pi / 0.5`, so that a reflectance of 0.5 shows radiance 1.
fn even(_: Vec3, _: Vec3) -> Rgb {
    Rgb::splat(2.0 * PI)
}

fn quad(origin: Vec3, s: Vec3, t: Vec3, reflectance: Rgb) -> Surface {
    let corners = [origin, origin + s, origin + s + t, origin + t];
    Surface::new(0, &corners, reflectance).unwrap()
}

const GREY: Rgb = Rgb::splat(0.5);
const RED: Rgb = Rgb::new(0.5, 0.0, 0.0);
const BLUE: Rgb = Rgb::new(0.0, 0.0, 0.5);

fn camera(eye: Vec3, target: Vec3, fov: f32, width: u32, height: u32) -> Camera {
    let view = Viewpoint {
        eye,
        target,
        up: Vec3::Y,
        fov,
    };
    Camera::new(view, width, height).unwrap()
}

fn pixel(image: &LinearImage, x: u32, y: u32) -> [f32; 4] {
    image.pixels[(y * image.width + x) as usize]
}

/// A unit box about the origin, each side cut into strips, all in odd numbers and directions and
/// turned in space, so that sides meet in T-junctions at rounded coordinates.
fn strips(counts: [u32; 6], inwards: bool) -> Vec<Surface> {
    let turn = Mat3::from_rotation_y(0.37) * Mat3::from_rotation_x(0.71);
    let axes = [Vec3::X, Vec3::Y, Vec3::Z];
    let mut surfaces = Vec::new();
    for (side, count) in counts.into_iter().enumerate() {
        let sign = if side % 2 == 0 { 1.0 } else { -1.0 };
        let (n, u, v) = (
            axes[side / 2] * sign,
            axes[(side / 2 + 1) % 3],
            axes[(side / 2 + 2) % 3] * sign,
        );
        let [along, across] = if inwards { [v, u] } else { [u, v] };
        let corner = n - along - across;
        let strip = 2.0 / count as f32;
        for i in 0..count {
            let origin = corner + along * (strip * i as f32);
            surfaces.push(quad(
                turn * origin,
                turn * along * strip,
                turn * across * 2.0,
                GREY,
            ));
        }
    }
    surfaces
}

#[test]
fn no_background_shows_through_t_junctions_from_inside() {
    for counts in [[1, 3, 7, 2, 5, 11], [13, 4, 1, 9, 3, 6]] {
        let stage = Stage::new(strips(counts, true), 0.7, even);
        for step in 0..24_u8 {
            let angle = f32::from(step) * 0.53;
            let eye = Vec3::new(
                0.6 * angle.sin(),
                0.4 * (2.0 * angle).cos(),
                0.5 * angle.cos(),
            );
            let target =
                eye + Vec3::new(angle.cos(), (1.7 * angle).sin() * 0.8, (angle * 1.3).sin());
            let (width, height) = [(64, 48), (131, 97), (240, 320)][usize::from(step % 3)];
            let image = stage.render(&camera(eye, target, 1.4, width, height), 1e9);
            let holes = image.pixels.iter().filter(|p| p[3] < 1.0).count();
            assert_eq!(holes, 0, "counts {counts:?} step {step}");

            let shown = to_pixmap(&image, 0.5, [255, 0, 255]).unwrap();
            let magenta = shown
                .pixels()
                .iter()
                .filter(|p| p.red() > p.green() || p.blue() > p.green());
            assert_eq!(magenta.count(), 0, "counts {counts:?} step {step}");
        }
    }
}

#[test]
fn no_background_shows_through_t_junctions_from_outside() {
    let whole = Stage::new(strips([1; 6], false), 9.0, even);
    let cut = Stage::new(strips([9, 5, 7, 3, 11, 6], false), 0.3, even);
    for step in 0..20_u8 {
        let angle = f32::from(step) * 0.77;
        let eye = Vec3::new(
            4.0 * angle.cos(),
            3.0 * (0.6 * angle).sin(),
            4.0 * angle.sin(),
        );
        let camera = camera(eye, Vec3::ZERO, 0.9, 150, 150);
        let (whole, cut) = (whole.render(&camera, 1e9), cut.render(&camera, 1e9));
        let inside = whole
            .pixels
            .iter()
            .zip(&cut.pixels)
            .filter(|(w, _)| w[3] == 1.0);
        assert!(inside.clone().count() > 1000);
        assert_eq!(inside.filter(|(_, c)| c[3] < 1.0).count(), 0, "step {step}");
    }
}

#[test]
fn a_dark_room_is_tight_too() {
    let surfaces = strips([1, 3, 7, 2, 5, 11], true);
    let surfaces: Vec<Polygon> = surfaces.iter().map(|surface| *surface.polygon()).collect();
    let relit = Relit {
        mesh: Mesh {
            faces: &[],
            patches: &[],
            elements: &[],
        },
        surfaces: &surfaces,
        irradiance: &[],
        exitance: &[],
        gathered: None,
    };
    for step in 0..24_u8 {
        let angle = f32::from(step) * 0.53;
        let target = Vec3::new(angle.cos(), (1.7 * angle).sin() * 0.8, (angle * 1.3).sin());
        let image = render(&relit, &camera(Vec3::ZERO, target, 1.4, 240, 180), 1e9).unwrap();
        assert!(
            image.pixels.iter().all(|p| *p == [0.0, 0.0, 0.0, 1.0]),
            "step {step}"
        );
    }
}

#[test]
fn the_dark_inside_of_a_body_does_not_show_at_its_outline() {
    let mut surfaces = strips([1; 6], true);
    for wall in &mut surfaces {
        let far: Vec<Vec3> = wall.polygon().vertices().iter().map(|v| *v * 9.0).collect();
        *wall = Surface::new(0, &far, GREY).unwrap();
    }
    surfaces.extend(strips([2, 3, 1, 4, 2, 5], false));
    let stage = Stage::new(surfaces, 20.0, even);
    for step in 0..20_u8 {
        let angle = f32::from(step) * 0.77;
        let eye = Vec3::new(
            4.0 * angle.cos(),
            3.0 * (0.6 * angle).sin(),
            4.0 * angle.sin(),
        );
        let image = stage.render(&camera(eye, Vec3::ZERO, 0.9, 150, 150), 1e9);
        let darkness: f32 = image.pixels.iter().map(|p| 1.0 - p[0]).sum();
        // Some 400 pixels lie on the outline.
        assert!(darkness < 1.0, "step {step}: {darkness}");
    }
}

#[test]
fn two_quads_that_cross_hide_each_other_up_to_their_line() {
    let tilted = |slope: f32, reflectance| {
        let s = Vec3::new(2.0, 0.0, 2.0 * slope);
        quad(Vec3::new(-1.0, -1.0, -slope), s, Vec3::Y * 2.0, reflectance)
    };
    let stage = Stage::new(vec![tilted(0.5, RED), tilted(-0.5, BLUE)], 5.0, even);
    let image = stage.render(&camera(Vec3::Z * 5.0, Vec3::ZERO, 0.15, 101, 51), 1e9);
    for y in 0..51 {
        for x in 0..101 {
            let [red, _, blue, alpha] = pixel(&image, x, y);
            assert_eq!(alpha, 1.0);
            let want = if x < 50 { (0.0, 1.0) } else { (1.0, 0.0) };
            if x != 50 {
                let got = (red, blue);
                assert!(
                    (got.0 - want.0).abs() + (got.1 - want.1).abs() < 1e-4,
                    "{x} {y} {got:?}"
                );
            }
        }
    }
}

#[test]
fn a_floor_that_reaches_behind_the_camera_ends_at_the_horizon_only() {
    let floor = quad(
        Vec3::new(-50.0, 0.0, 50.0),
        Vec3::X * 100.0,
        Vec3::Z * -100.0,
        GREY,
    );
    let stage = Stage::new(vec![floor], 7.0, even);
    let image = stage.render(
        &camera(Vec3::Y, Vec3::new(0.3, 1.0, -1.0), 1.5, 80, 60),
        1e9,
    );
    for (place, [.., alpha]) in image.pixels.iter().enumerate() {
        match place / 80 {
            0..30 => assert_eq!(*alpha, 0.0),
            32.. => assert_eq!(*alpha, 1.0),
            _ => {}
        }
    }
}

#[test]
fn a_surface_hides_at_any_distance() {
    let near = quad(
        Vec3::new(-1.0, -1.0, -1e-4),
        Vec3::X * 2.0,
        Vec3::Y * 2.0,
        RED,
    );
    let far = quad(
        Vec3::new(-9.0, -9.0, -5.0),
        Vec3::X * 18.0,
        Vec3::Y * 18.0,
        BLUE,
    );
    let stage = Stage::new(vec![near, far], 50.0, even);
    let image = stage.render(&camera(Vec3::ZERO, -Vec3::Z, 1.0, 20, 20), 1e9);
    assert!(
        image
            .pixels
            .iter()
            .all(|[r, _, b, a]| (r - 1.0).abs() < 1e-4 && *b == 0.0 && *a == 1.0)
    );
}

#[test]
fn a_linear_irradiance_is_shown_exactly_inside_and_across_coplanar_faces() {
    let light = |p: Vec3, _: Vec3| Rgb::splat(2.0 * PI * (3.0 + p.x + 0.5 * p.y));
    let halves = vec![
        quad(
            Vec3::new(-2.0, -1.0, 0.0),
            Vec3::X * 2.0,
            Vec3::Y * 2.0,
            GREY,
        ),
        quad(
            Vec3::new(0.0, -1.0, 0.0),
            Vec3::X * 2.0,
            Vec3::Y * 2.0,
            GREY,
        ),
    ];
    let triangles = [[-2.0, 2.0, 2.0], [2.0, -2.0, -2.0]].map(|[x, x1, x2]| {
        let y = x * 0.5;
        let corners = [
            Vec3::new(x, y, 0.0),
            Vec3::new(x1, y, 0.0),
            Vec3::new(x2, -y, 0.0),
        ];
        Surface::new(0, &corners, GREY).unwrap()
    });
    for surfaces in [halves, triangles.to_vec()] {
        let stage = Stage::new(surfaces, 0.26, light);
        let camera = camera(Vec3::new(2.5, -1.0, 3.0), Vec3::ZERO, 0.9, 90, 60);
        let image = stage.render(&camera, 1e9);
        let mut inner = 0;
        for (place, [r, .., alpha]) in image.pixels.iter().enumerate() {
            let ray = camera
                .ray((place % 90) as f64 + 0.5, (place / 90) as f64 + 0.5)
                .as_vec3();
            let p = camera.eye() - ray * (camera.eye().z / ray.z);
            // Elements at the rim have no neighbours to lean on; triangles have uneven ones.
            if *alpha == 1.0 && p.x.abs() < 1.45 && p.y.abs() < 0.45 {
                let want = light(p, Vec3::Z).r / (2.0 * PI);
                assert!((r / want - 1.0).abs() < 0.002, "{p}: {r} {want}");
                inner += 1;
            }
        }
        assert!(inner > 500, "{inner}");
    }
}

#[test]
fn small_elements_meet_a_large_neighbour_without_a_step() {
    // One element on the left; two above each other on the right, the lower one cut again.
    let mut stage = Stage::new(
        vec![quad(Vec3::ZERO, Vec3::X * 2.0, Vec3::Y, GREY)],
        10.0,
        even,
    );
    let base = stage.parts.elements[0];
    let cells = [
        (0.0, 0.0, 0.5, 1.0),
        (0.5, 0.5, 1.0, 1.0),
        (0.5, 0.25, 0.75, 0.5),
        (0.75, 0.25, 1.0, 0.5),
        (0.5, 0.0, 0.75, 0.25),
        (0.75, 0.0, 1.0, 0.25),
    ];
    let element = |(s0, t0, s1, t1): (f32, f32, f32, f32)| Element {
        from: glam::Vec2::new(s0, t0),
        to: glam::Vec2::new(s1, t1),
        area: 2.0 * (s1 - s0) * (t1 - t0),
        ..base
    };
    stage.parts.elements = cells.map(element).to_vec();
    stage.parts.faces[0].element_count = 6;
    stage.irradiance = [1.0, 9.0, 4.0, 2.0, 7.0, 3.0].map(Rgb::splat).to_vec();

    let facets = shading::facets(&stage.mesh(), &stage.irradiance, &[Rgb::BLACK]);
    let at = |element: usize, p: Vec3| facets[element].as_ref().unwrap().radiance(p, None, 0).r;
    for step in 0..=40_u8 {
        let y = f32::from(step) / 40.0;
        let right = match y {
            y if y > 0.5 => 1,
            y if y > 0.25 => 2,
            _ => 4,
        };
        let p = Vec3::new(1.0, y, 0.0);
        assert!(
            (at(0, p) - at(right, p)).abs() < 1e-5,
            "{y}: {} {}",
            at(0, p),
            at(right, p)
        );
        let p = Vec3::new(1.0 + y, 0.5, 0.0);
        let below = if y > 0.5 { 3 } else { 2 };
        assert!(
            (at(1, p) - at(below, p)).abs() < 1e-5,
            "{p}: {} {}",
            at(1, p),
            at(below, p)
        );
    }
}

#[test]
fn edges_cover_the_share_of_a_pixel_that_they_should() {
    for step in 0..12_u8 {
        let angle = f32::from(step) * 0.131;
        let turn = Mat3::from_rotation_z(angle);
        let square = quad(
            turn * Vec3::new(-1.0, -1.0, 0.0),
            turn * Vec3::X * 2.0,
            turn * Vec3::Y * 2.0,
            GREY,
        );
        let stage = Stage::new(vec![square], 9.0, even);
        let view = camera(Vec3::Z * 4.0, Vec3::ZERO, 0.9, 100, 100);
        let image = stage.render(&view, 1e9);
        let covered: f32 = image.pixels.iter().map(|p| p[3]).sum();
        let side = 2.0 / (4.0 * (0.45_f32).tan()) * 50.0;
        // The outline is 1/64 pixel wider on every side; samples add some noise.
        let want = (side + 2.0 / 64.0).powi(2);
        assert!(
            (covered / want - 1.0).abs() < 0.004,
            "{angle}: {covered} {want}"
        );
        for [r, .., alpha] in &image.pixels {
            assert!((r - alpha).abs() < 1e-5, "colour is multiplied by coverage");
        }
    }
}

#[test]
fn an_edge_along_the_axes_has_sixteen_levels() {
    let mut seen = std::collections::BTreeSet::new();
    for step in 0..64_u8 {
        let shift = f32::from(step) / 64.0 * 0.04;
        let plate = quad(
            Vec3::new(-5.0, shift, 0.0),
            Vec3::X * 10.0,
            Vec3::Y * 5.0,
            GREY,
        );
        let stage = Stage::new(vec![plate], 99.0, even);
        let fov = 2.0 * (0.04_f32 * 5.0 / 2.0).atan(); // ten pixels of 0.04 at distance 2
        let image = stage.render(&camera(Vec3::Z * 2.0, Vec3::ZERO, fov, 10, 10), 1e9);
        seen.extend(image.pixels.iter().map(|p| (p[3] * 16.0) as u32));
    }
    assert_eq!(seen, (0..=16).collect());
}

#[test]
fn unlit_sides_hide_from_inside_and_vanish_from_outside() {
    // A lit wall, and before it a screen whose back looks at the camera.
    let wall = quad(
        Vec3::new(-2.0, -2.0, -2.0),
        Vec3::X * 4.0,
        Vec3::Y * 4.0,
        GREY,
    );
    let screen = quad(
        Vec3::new(1.0, -1.0, 0.0),
        Vec3::X * -2.0,
        Vec3::Y * 2.0,
        GREY,
    );
    let behind = quad(
        Vec3::new(2.0, -2.0, 2.0),
        Vec3::X * -4.0,
        Vec3::Y * 4.0,
        GREY,
    );
    let stage = Stage::new(vec![wall, screen, behind], 9.0, even);
    let inside = stage.render(&camera(Vec3::Z * 1.9, Vec3::ZERO, 0.5, 9, 9), 1e9);
    assert_eq!(pixel(&inside, 4, 4), [0.0, 0.0, 0.0, 1.0]);
    let outside = stage.render(&camera(Vec3::Z * 9.0, Vec3::ZERO, 0.5, 9, 9), 1e9);
    assert!((pixel(&outside, 4, 4)[0] - 1.0).abs() < 1e-4);

    // Without the surfaces, the backs of the faces say the same.
    let exitance = vec![Rgb::BLACK; stage.parts.faces.len()];
    let relit = Relit {
        mesh: stage.mesh(),
        surfaces: &[],
        irradiance: &stage.irradiance,
        exitance: &exitance,
        gathered: None,
    };
    let view = camera(Vec3::Z * 1.9, Vec3::ZERO, 0.5, 9, 9);
    assert_eq!(render(&relit, &view, 1e9).unwrap(), inside);
}

#[test]
fn a_lamp_flat_on_a_wall_shines_and_is_cut_to_the_brightest() {
    let emission = Emission {
        light: 0,
        share: Rgb::splat(100.0 * PI),
    };
    let wall = quad(
        Vec3::new(-2.0, -2.0, 0.1),
        Vec3::X * 4.0,
        Vec3::Y * 4.0,
        GREY,
    );
    let lamp = quad(
        Vec3::new(-1.0, -1.0, 0.1),
        Vec3::X * 2.0,
        Vec3::Y * 2.0,
        Rgb::BLACK,
    );
    let lamp = lamp.emitting(1, emission).unwrap();
    for surfaces in [vec![wall, lamp], vec![lamp, wall]] {
        let stage = Stage::new(surfaces, 0.3, even);
        let view = camera(Vec3::new(1.0, 2.0, 5.0), Vec3::ZERO, 0.3, 33, 33);
        let image = stage.render(&view, f32::INFINITY);
        assert!(image.pixels.iter().all(|p| (p[0] - 100.0).abs() < 1e-3));
        let cut = stage.render(&view, 2.0);
        assert!(cut.pixels.iter().all(|p| p[0] == 2.0));
    }
}

#[test]
fn wrong_lengths_are_refused() {
    let stage = Stage::new(vec![quad(Vec3::ZERO, Vec3::X, Vec3::Y, GREY)], 1.0, even);
    let mut relit = Relit {
        mesh: stage.mesh(),
        surfaces: &stage.surfaces,
        irradiance: &[],
        exitance: &[Rgb::BLACK],
        gathered: None,
    };
    let view = camera(Vec3::Z, Vec3::ZERO, 1.0, 4, 4);
    let error = render(&relit, &view, 1.0).unwrap_err().to_string();
    assert_eq!(error, "0 values of irradiance for 1 elements");
    relit.irradiance = &stage.irradiance;
    relit.exitance = &[];
    let error = show(&relit, &view, Exposure::Auto, [0; 3])
        .unwrap_err()
        .to_string();
    assert_eq!(error, "0 values of exitance for 1 faces");
}

#[test]
fn one_thread_and_many_paint_the_same_bytes() {
    let light = |p: Vec3, _: Vec3| Rgb::new(1.0 + p.x * p.y, 2.0, p.z.abs());
    let stage = Stage::new(strips([3, 4, 5, 6, 7, 8], true), 0.2, light);
    let view = camera(Vec3::new(0.1, 0.2, 0.3), Vec3::X, 1.2, 120, 90);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| stage.render(&view, 1e9))
    };
    assert!(on(1) == on(5));
}

/// The box `[0, 4] x [0, 3] x [0, 6]` from inside, without the sides whose normals are given.
fn room(without: &[Vec3]) -> Vec<Polygon> {
    let size = Vec3::new(4.0, 3.0, 6.0);
    let axes = [Vec3::X, Vec3::Y, Vec3::Z];
    let mut polygons = Vec::new();
    for side in 0..6_usize {
        let sign = if side % 2 == 0 { 1.0 } else { -1.0 };
        let normal = axes[side / 2] * sign;
        let (u, v) = (
            axes[(side / 2 + 1) % 3] * size,
            axes[(side / 2 + 2) % 3] * size,
        );
        let origin = axes[side / 2] * size * (0.5 + 0.5 * sign);
        if !without.contains(&normal) {
            let wall = Polygon::new(&[origin, origin + u, origin + u + v, origin + v]).unwrap();
            polygons.push(if wall.normal().dot(normal) > 0.0 {
                wall.flipped()
            } else {
                wall
            });
        }
    }
    polygons
}

fn fit(polygons: &[Polygon], up: Vec3, aspect: f32) -> Option<Viewpoint> {
    Viewpoint::fit(polygons, polygons, up, aspect)
}

#[test]
fn lamps_beside_the_scene_do_not_make_it_small() {
    let shown = room(&[Vec3::Z]);
    let alone = fit(&shown, Vec3::Y, 1.5);
    let far = [(0.0, 0.0), (9.0, 0.0), (0.0, 9.0)].map(|(x, z)| Vec3::new(x, 40.0, z));
    let mut surfaces = shown.clone();
    surfaces.push(Polygon::new(&far).unwrap());
    assert_eq!(Viewpoint::fit(&shown, &surfaces, Vec3::Y, 1.5), alone);
    assert_ne!(fit(&surfaces, Vec3::Y, 1.5), alone);
}

#[test]
fn a_scene_that_stands_on_another_side_is_seen_the_same() {
    let turn = glam::Quat::from_rotation_x(std::f32::consts::FRAC_PI_2); // +Y becomes +Z
    for without in [&[Vec3::Z][..], &[], &[Vec3::X, Vec3::NEG_X, Vec3::Z]] {
        let upright = room(without);
        let lying: Vec<Polygon> = upright
            .iter()
            .map(|p| {
                let vertices: Vec<Vec3> = p.vertices().iter().map(|v| turn * *v).collect();
                Polygon::new(&vertices).unwrap()
            })
            .collect();
        let expected = fit(&upright, Vec3::Y, 1.5).unwrap();
        let found = fit(&lying, Vec3::Z * 7.0, 1.5).unwrap();
        for (a, b) in [
            (found.eye, expected.eye),
            (found.target, expected.target),
            (found.up, expected.up),
        ] {
            assert!((a - turn * b).length() < 1e-4, "{found:?} {expected:?}");
        }
        assert_eq!(found.fov, expected.fov);
    }
}

#[test]
fn an_open_room_is_seen_through_its_opening() {
    for side in [Vec3::Z, Vec3::NEG_Z, Vec3::X, Vec3::NEG_X] {
        for aspect in [0.5, 1.0, 1.6] {
            let view = fit(&room(&[side]), Vec3::Y, aspect).unwrap();
            let middle = Vec3::new(2.0, 1.5, 3.0);
            assert_eq!(view.target, middle);
            assert!((view.eye - middle).normalize().dot(side) > 0.9999, "{side}");

            let camera = Camera::new(view, (400.0 * aspect) as u32, 400).unwrap();
            for polygon in room(&[]) {
                for vertex in polygon.vertices() {
                    let [x, y] = camera.project(camera.towards(*vertex)).unwrap();
                    let inside =
                        (0.0..400.0 * f64::from(aspect)).contains(&x) && (0.0..400.0).contains(&y);
                    assert!(inside, "{side} {aspect}: {vertex} at {x}, {y}");
                }
            }
        }
    }
}

#[test]
fn a_closed_room_is_seen_from_inside_and_a_thing_from_above() {
    let view = fit(&room(&[]), Vec3::Y, 1.5).unwrap();
    assert!(view.eye.cmpgt(Vec3::ZERO).all() && view.eye.cmplt(Vec3::new(4.0, 3.0, 6.0)).all());
    let open = [Vec3::X, Vec3::NEG_X, Vec3::Z, Vec3::NEG_Z, Vec3::Y];
    let floor = room(&open);
    let view = fit(&floor, Vec3::Y, 1.5).unwrap();
    assert!(view.eye.y > 1.0);
    assert!(fit(&[], Vec3::Y, 1.0).is_none());
    assert!(matches!(
        Camera::fit(&[], 4, 4),
        Err(CameraError::NothingToSee)
    ));
    assert!(matches!(
        Camera::fit(&floor, 0, 4),
        Err(CameraError::Size(0, 4))
    ));
}
