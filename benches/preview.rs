//! The host's preview: pictures of the Cornell box, in time per picture.
//!
//! 400 x 400 pixels. `render` is the linear picture; `show` adds the exposure, which takes a first
//! rendering, and the tone curve; `png` compresses what `show` gave.

mod scenes;

use criterion::{Criterion, Throughput};
use relume::draw;
use relume_host::picture::{Exposure, encode_png};
use relume_host::preview::{Camera, Relit, Viewpoint, render, show};

const SIDE: u32 = 400;
const BACKGROUND: [u8; 3] = [32; 3];

fn main() {
    let mut criterion = scenes::criterion();
    let builtin = scenes::cornell();
    let solution = scenes::baked(&builtin.scene, &scenes::settings(&builtin, 0.1));
    let mix = solution.nominal_mix();
    let relit = Relit {
        mesh: solution.mesh.view(),
        surfaces: &solution.surfaces,
        irradiance: &solution.relight(&mix),
        exitance: &solution.face_exitance(&mix),
        gathered: None,
    };
    pictures(&mut criterion, &relit, &camera(builtin.camera));
    criterion.final_summary();
}

fn camera(view: draw::Camera) -> Camera {
    let viewpoint = Viewpoint {
        eye: view.eye,
        target: view.target,
        up: view.up,
        fov: view.fov,
    };
    Camera::new(viewpoint, SIDE, SIDE).expect("a legal view")
}

fn pictures(criterion: &mut Criterion, relit: &Relit, camera: &Camera) {
    let show = || show(relit, camera, Exposure::Auto, BACKGROUND).expect("a picture that fits");
    let (picture, _) = show();
    let mut group = criterion.benchmark_group("preview");
    group.throughput(Throughput::Elements(1));
    group.bench_function("render", |bencher| {
        bencher.iter(|| render(relit, camera, f32::INFINITY).expect("lengths that fit"));
    });
    group.bench_function("show", |bencher| bencher.iter(show));
    group.bench_function("png", |bencher| bencher.iter(|| encode_png(&picture)));
    group.finish();
}
