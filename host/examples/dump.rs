//! Scratch.
use std::fmt::Write as _;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let lights = std::path::PathBuf::from(&a[2]);
    let scene = relume_host::import::load(
        std::path::Path::new(&a[1]),
        lights.exists().then_some(lights.as_path()),
    )
    .unwrap()
    .scene;
    let (p, e): (f32, f32) = (a[3].parse().unwrap(), a[4].parse().unwrap());
    let mut go = |_| std::ops::ControlFlow::Continue(());
    let s = relume_host::bake::Meshed::new(&scene, Some(p), Some(e), &mut go).unwrap();
    let mesh = s.mesh().view();
    let mut o = String::new();
    let mut poly = |tag: &str, v: &[glam::Vec3]| {
        write!(o, "{tag} {}", v.len()).unwrap();
        for p in v {
            write!(o, " {:e} {:e} {:e}", p.x, p.y, p.z).unwrap();
        }
        o.push('\n');
    };
    for x in s.view().unwrap().surfaces() {
        poly("s", x.polygon().vertices());
    }
    for i in 0..mesh.patches.len() as u32 {
        poly("p", mesh.patch_polygon(i).unwrap().vertices());
    }
    for x in mesh.elements {
        poly(
            &format!("e{}", x.patch),
            mesh.element_polygon(x).unwrap().vertices(),
        );
    }
    std::fs::write(&a[5], o).unwrap();
}
