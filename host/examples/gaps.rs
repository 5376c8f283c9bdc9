#![allow(missing_docs, clippy::all)]
use relume_host::{
    bake::{Meshed, Progress, Settings},
    import,
};
use std::{ops::ControlFlow, time::Instant};
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let scene = import::load(std::path::Path::new(&a[1]), None)
        .unwrap()
        .scene;
    let e: f32 = a[2].parse().unwrap();
    let p: f32 = a[3].parse().unwrap();
    let t0 = Instant::now();
    let mut last = Instant::now();
    let stop: f64 = a[4].parse().unwrap();
    let mut w = |p: Progress| {
        let d = last.elapsed().as_secs_f64();
        if d > 0.3 {
            println!(
                "{:.2}: gap {:.2} before {:?}",
                t0.elapsed().as_secs_f64(),
                d,
                p
            );
        }
        last = Instant::now();
        if t0.elapsed().as_secs_f64() > stop {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    };
    let m = Meshed::new(&scene, Some(p), Some(e), &mut w).unwrap();
    println!(
        "meshed {:.2} {} elements {} patches",
        t0.elapsed().as_secs_f64(),
        m.mesh().elements.len(),
        m.mesh().patches.len()
    );
    let r = m.solve(&Settings::default(), &mut w);
    println!(
        "end {:.2} since last watch {:.2} ok {}",
        t0.elapsed().as_secs_f64(),
        last.elapsed().as_secs_f64(),
        r.is_ok()
    );
}
