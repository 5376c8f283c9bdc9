//! Light files, on top of a small scene.
#![no_main]

use libfuzzer_sys::fuzz_target;
use relume_fuzz::{placed, within};
use relume_host::import::load;

const SCENE: &[u8] = b"mtllib s.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n\
    usemtl wall\nf 1 2 3\nusemtl light_0\nf 1 3 4\n";
const MATERIALS: &[u8] = b"newmtl wall\nKd 0.5\nnewmtl light_0\nKd 0\nKe 1 1 1\n";

fuzz_target!(|bytes: &[u8]| {
    let folder = placed(&[("s.obj", SCENE), ("s.mtl", MATERIALS), ("l.toml", bytes)]);
    let lights = folder.join("l.toml");
    let room = (1 << 17) + 1024 * bytes.len();
    match within(room, || load(&folder.join("s.obj"), Some(&lights))) {
        Ok(imported) => assert!(imported.scene.view().is_ok()),
        Err(error) => assert!(!error.to_string().contains('\n'), "{error}"),
    }
});
