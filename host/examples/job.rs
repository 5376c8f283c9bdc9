//! Scratch.
use relume::mesh::Spacing;
use relume::refine::Refinement;
use relume_host::bake::Memory;
use relume_host::builtin::{PaperLamps, paper_room};
use relume_host::bvh::Bvh;
use relume_host::rows::{Parallel, RowFiller as _};
use relume_host::study::hemicube::Hemicube;
use std::time::Instant;
fn best(n: usize, mut f: impl FnMut()) -> f64 {
    (0..n)
        .map(|_| {
            let t = Instant::now();
            f();
            t.elapsed().as_secs_f64()
        })
        .fold(f64::MAX, f64::min)
}
fn main() {
    let room = paper_room(PaperLamps::Eight).unwrap();
    let mut go = |_| std::ops::ControlFlow::Continue(());
    let s = relume_host::bake::Meshed::new(&room.scene, Some(1.0), Some(0.25), &mut go).unwrap();
    let _ = Spacing {
        patch: 1.0,
        element: 0.25,
    };
    let mesh = s.mesh().view();
    let bvh = s.bvh();
    let n: usize = std::env::args()
        .nth(1)
        .and_then(|a| a.parse().ok())
        .unwrap_or(50);
    let _: &Bvh = bvh;
    let mut row = vec![0.0; mesh.elements.len()];
    let new = best(n, || {
        std::hint::black_box(Parallel::new(&mesh, bvh));
    });
    let filler = Parallel::new(&mesh, bvh);
    let rows = best(n, || {
        for p in 0..mesh.patches.len() as u32 {
            filler.patch(&mesh, p, &mut row);
        }
    });
    let mut all = vec![];
    for p in 0..mesh.patches.len() as u32 {
        filler.patch(&mesh, p, &mut row);
        all.push(row.clone());
    }
    let solve = best(n, || {
        let mut memory = Memory::<8>::new(&mesh, 8, mesh.patches.len(), false);
        let mut refinement = Refinement::new(mesh, 8, 1e-6, memory.storage()).unwrap();
        while let Some(p) = refinement.next_shooter() {
            refinement.shoot(p, &all[p as usize]).unwrap();
        }
        refinement.finish();
    });
    let hc = Hemicube {
        surfaces: &room.scene.surfaces,
        bvh,
        resolution: 128,
    };
    let hem = best(n.min(10), || {
        for p in 0..mesh.patches.len() as u32 {
            hc.patch(&mesh, p, &mut row);
        }
    });
    println!(
        "new {:.3} ms rows {:.2} ms solve {:.2} ms hemicubes of all {:.2} ms: job/kept hemicubes {:.3}",
        new * 1e3,
        rows * 1e3,
        solve * 1e3,
        hem * 1e3,
        (new + rows + solve) / (hem + solve)
    );
}
