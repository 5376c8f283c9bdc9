//! Scratch.
use relume_host::rows::{Parallel, RowFiller as _};
use std::io::Write;
use std::time::Instant;
fn main() {
    rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .use_current_thread()
        .build_global()
        .unwrap();
    let a: Vec<String> = std::env::args().collect();
    let lights = std::path::PathBuf::from(&a[2]);
    let scene = relume_host::import::load(
        std::path::Path::new(&a[1]),
        lights.exists().then_some(lights.as_path()),
    )
    .unwrap()
    .scene;
    let (p, e): (f32, f32) = (a[3].parse().unwrap(), a[4].parse().unwrap());
    let n: usize = a[5].parse().unwrap();
    let mut go = |_| std::ops::ControlFlow::Continue(());
    let s = relume_host::bake::Meshed::new(&scene, Some(p), Some(e), &mut go).unwrap();
    let mesh = s.mesh().view();
    let filler = Parallel::new(&mesh, s.bvh());
    let mut row = vec![0.0; mesh.elements.len()];
    let count = mesh.patches.len();
    let step = (count / n.max(1)).max(1);
    let mut all: Vec<f32> = vec![];
    let cpu = || {
        std::fs::read_to_string("/proc/thread-self/schedstat")
            .unwrap()
            .split(' ')
            .next()
            .unwrap()
            .parse::<f64>()
            .unwrap()
            * 1e-9
    };
    let _ = Instant::now();
    let t = cpu();
    let mut rows = 0;
    for p in (0..count).step_by(step) {
        filler.patch(&mesh, p as u32, &mut row);
        rows += 1;
        all.extend(&row);
    }
    let s = cpu() - t;
    println!(
        "{} patches {} elements, {} rows: {:.3} ms a row",
        count,
        mesh.elements.len(),
        rows,
        s * 1e3 / rows as f64
    );
    let mut f = std::fs::File::create(&a[6]).unwrap();
    for v in &all {
        f.write_all(&v.to_le_bytes()).unwrap();
    }
}
