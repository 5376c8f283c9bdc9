#![allow(missing_docs, clippy::all)]
use relume_host::{
    bake::{Settings, bake},
    import,
    study::estimates::{Effort, compare},
};
use std::{ops::ControlFlow, path::Path, time::Instant};
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let data = Path::new("/work/shared/data");
    let (points, paths): (u32, u32) = (a[1].parse().unwrap(), a[2].parse().unwrap());
    let element: Option<f32> = a[3].parse().ok();
    for name in &a[4..] {
        let lights = data.join("truth").join(name).join("lights.toml");
        let lights = lights.is_file().then_some(lights);
        let scene = import::load(
            &data.join("scenes").join(name).join("scene.obj"),
            lights.as_deref(),
        )
        .unwrap()
        .scene;
        let t = Instant::now();
        let s = bake(
            &scene,
            &Settings {
                element,
                ..Settings::default()
            },
            &mut |_| ControlFlow::Continue(()),
        )
        .unwrap();
        let tb = t.elapsed().as_secs_f64();
        let t = Instant::now();
        let e = compare(
            &scene,
            &s,
            Effort {
                points,
                paths: if s.lights.len() > 30 {
                    paths * 8 / s.lights.len() as u32
                } else {
                    paths
                },
            },
        )
        .unwrap();
        println!(
            "== {name}: {} elements bake {tb:.1} s compare {:.1} s",
            s.mesh.elements.len(),
            t.elapsed().as_secs_f64()
        );
        let mut r: Vec<f64> = e.iter().map(|e| e.ratio()).collect();
        r.sort_by(f64::total_cmp);
        println!(
            "   ratio min {:.2} median {:.2} max {:.2}",
            r[0],
            r[r.len() / 2],
            r[r.len() - 1]
        );
        if e.len() < 10 {
            for e in &e {
                println!(
                    "   {:16} est {:.4} true {:.4} ratio {:.2}",
                    e.light,
                    e.estimate,
                    e.error,
                    e.ratio()
                );
            }
        }
    }
}
