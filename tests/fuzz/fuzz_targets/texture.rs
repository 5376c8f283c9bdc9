//! PNG and JPEG images of textures.
#![no_main]

use libfuzzer_sys::fuzz_target;
use relume_fuzz::within;
use relume_host::texture::{Image, LARGEST_IMAGE};

/// A decoded texel, and the wider ones that it is made of.
const TEXEL: usize = 40;

fuzz_target!(|bytes: &[u8]| {
    let room = (1 << 22) + 8 * bytes.len() + TEXEL * LARGEST_IMAGE as usize;
    if let Ok(image) = within(room, || Image::decode(bytes)) {
        assert_eq!(image.texels.len(), image.width * image.height);
        assert!(image.mean().is_legal());
    }
});
