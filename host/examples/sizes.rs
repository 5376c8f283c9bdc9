#![allow(missing_docs, clippy::all)]
use relume_host::{bake::Meshed, import};
use std::ops::ControlFlow;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let scene = import::load(std::path::Path::new(&a[1]), None)
        .unwrap()
        .scene;
    for e in &a[2..] {
        let e: f32 = e.parse().unwrap();
        let m = Meshed::new(&scene, None, Some(e), &mut |_| ControlFlow::Continue(())).unwrap();
        println!(
            "{e}: {} elements {} patches",
            m.mesh().elements.len(),
            m.mesh().patches.len()
        );
    }
}
