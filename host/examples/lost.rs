#![allow(missing_docs, clippy::all)]
use relume_host::reference::path_trace::Receiver;
use relume_host::{import, solution, study::truth};
use std::collections::BTreeSet;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let r = |p: &str| solution::read(&std::fs::read(p).unwrap()).unwrap();
    let (s, t) = (r(&a[1]), r(&a[2]));
    let scene = import::load(std::path::Path::new(&a[3]), None)
        .unwrap()
        .scene;
    let key = |f: &relume::mesh::Face| (f.surface, f.side == relume::mesh::Side::Back);
    let fb: BTreeSet<_> = t.mesh.faces.iter().map(key).collect();
    let view = s.mesh.view();
    let k = s.lights.len();
    let mut ids = vec![];
    let mut rec = vec![];
    for f in &s.mesh.faces {
        if fb.contains(&key(f)) {
            continue;
        }
        let r = f.element_range();
        for e in r.start as usize..r.end as usize {
            let p = view.element_polygon(&s.mesh.elements[e]).unwrap();
            let c: Vec<_> = p.vertices().iter().map(|v| v.as_dvec3()).collect();
            if let Some(x) = Receiver::polygon(&c) {
                rec.push((x, s.mesh.elements[e].area as f64));
                ids.push((key(f), e));
            }
        }
    }
    let tr = truth::traced(&scene, &rec, 4000, 3).unwrap();
    let mut n = 0;
    for (i, v) in ids.iter().zip(&tr.values) {
        let m = v.iter().map(|x| x.irradiance[1]).fold(0.0, f64::max);
        let b = (0..k)
            .map(|l| s.contributions[i.1 * k + l].g)
            .fold(0.0, f32::max);
        if m > 1e-4 || b > 2e-4 {
            n += 1;
            if n < 40 {
                println!(
                    "{i:?} traced {m:.6} baked {b:.6} area {:.4}",
                    s.mesh.elements[i.1].area
                );
            }
        }
    }
    println!("{} lost, {n} with light", ids.len());
}
