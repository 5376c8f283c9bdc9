#![allow(missing_docs, clippy::all)]
use relume_host::solution;
use std::collections::BTreeMap;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let r = |p: &str| solution::read(&std::fs::read(p).unwrap()).unwrap();
    let (a, b) = (r(&a[1]), r(&a[2]));
    let key = |f: &relume::mesh::Face| (f.surface, f.side == relume::mesh::Side::Back);
    let fa: BTreeMap<_, _> = a.mesh.faces.iter().map(|f| (key(f), f)).collect();
    let fb: BTreeMap<_, _> = b.mesh.faces.iter().map(|f| (key(f), f)).collect();
    let k = a.lights.len();
    let mut stat = vec![[0.0f64; 6]; k];
    let mut lost = vec![(0.0f64, 0.0f64, 0usize); 2];
    for (key, f) in &fa {
        match fb.get(key) {
            None => {
                let r = f.element_range();
                for e in r.start as usize..r.end as usize {
                    lost[0].1 += a.mesh.elements[e].area as f64;
                    lost[0].2 += 1;
                    let m = (0..k)
                        .map(|l| a.contributions[e * k + l].g as f64 / (1.0))
                        .fold(0.0, f64::max);
                    lost[0].0 = lost[0].0.max(m);
                    if m > 0.002 {
                        println!(
                            "lost {key:?} {e} {m:.4} area {:.5} origin {}",
                            a.mesh.elements[e].area,
                            f.polygon.origin()
                        );
                    }
                }
            }
            Some(g) => {
                let r = f.element_range();
                let q = g.element_range();
                for (e, o) in (r.start as usize..r.end as usize).zip(q.start as usize..) {
                    let w = a.mesh.elements[e].area as f64;
                    for l in 0..k {
                        let (x, y) = (
                            a.contributions[e * k + l].g as f64,
                            b.contributions[o * k + l].g as f64,
                        );
                        let s = &mut stat[l];
                        s[0] += w * (x - y).abs();
                        s[1] += w * (y - x);
                        s[2] += w * x;
                        s[3] += w * (x - y).powi(2);
                        s[4] += w * x * x;
                    }
                }
            }
        }
    }
    for (key, f) in &fb {
        if !fa.contains_key(key) {
            let r = f.element_range();
            lost[1].2 += (r.end - r.start) as usize;
            for e in r.start as usize..r.end as usize {
                let m = (0..k)
                    .map(|l| b.contributions[e * k + l].g as f64)
                    .fold(0.0, f64::max);
                lost[1].0 = lost[1].0.max(m);
            }
        }
    }
    println!(
        "only in a: {:?} only in b: {:?} (max, area, elements)",
        lost[0], lost[1]
    );
    for (l, s) in a.lights.iter().zip(&stat) {
        println!(
            "{:18} L1 {:.5} bias {:+.5} L2 {:.5} mean {:.5} est {:.4}",
            l.name,
            s[0] / s[2],
            s[1] / s[2],
            (s[3] / s[4]).sqrt(),
            s[2] / a.mesh.elements.iter().map(|e| e.area as f64).sum::<f64>(),
            l.error
        );
    }
}
