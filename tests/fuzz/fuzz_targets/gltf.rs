//! glTF files, as text or GLB; `t.png` is an image.
#![no_main]

use libfuzzer_sys::fuzz_target;
use relume_fuzz::{placed, within};
use relume_host::import::load;
use relume_host::texture::LARGEST_IMAGE;

/// A decoded texel of an embedded image, and the wider ones that it is made of.
const TEXEL: usize = 40;

fuzz_target!(|bytes: &[u8]| {
    let image = include_bytes!("../seeds/texture/rgb.png");
    let folder = placed(&[("s.glb", bytes), ("t.png", image)]);
    // Nodes may share a mesh: so many triangles as there are nodes times indices.
    let shared = bytes.len() * bytes.len() / 16;
    let images = TEXEL * LARGEST_IMAGE as usize;
    let room = (1 << 22) + 1024 * bytes.len() + 256 * shared + images;
    match within(room, || load(&folder.join("s.glb"), None)) {
        Ok(imported) => assert!(imported.scene.view().is_ok()),
        Err(error) => assert!(!error.to_string().contains('\n'), "{error}"),
    }
});
