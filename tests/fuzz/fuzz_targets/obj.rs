//! OBJ files: what follows a line `--- mtl` is the MTL file `s.mtl`; `t.png` is an image.
#![no_main]

use libfuzzer_sys::fuzz_target;
use relume_fuzz::{placed, within};
use relume_host::import::load;

const SEPARATOR: &[u8] = b"--- mtl\n";

fuzz_target!(|bytes: &[u8]| {
    let at = bytes.windows(SEPARATOR.len()).position(|w| w == SEPARATOR);
    let (scene, materials) = match at {
        Some(at) => (&bytes[..at], &bytes[at + SEPARATOR.len()..]),
        None => (bytes, &[][..]),
    };
    let image = include_bytes!("../seeds/texture/rgb.png");
    let folder = placed(&[("s.obj", scene), ("s.mtl", materials), ("t.png", image)]);
    match within((1 << 20) + 1024 * bytes.len(), || {
        load(&folder.join("s.obj"), None)
    }) {
        Ok(imported) => assert!(imported.scene.view().is_ok()),
        Err(error) => assert!(!error.to_string().contains('\n'), "{error}"),
    }
});
