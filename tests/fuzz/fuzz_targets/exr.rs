//! OpenEXR pictures with a layer per light.
#![no_main]

use std::panic;
use std::sync::Once;

use libfuzzer_sys::fuzz_target;
use relume_fuzz::{placed, within};
use relume_host::export::exr::read_light_layers;

/// What a reader may hold: 2^30 samples of 4 bytes, which the header may ask for, and the pixels of what it finds.
const ROOM: usize = (4 << 30) + (1 << 28);

fuzz_target!(|bytes: &[u8]| {
    // The reader takes a panic of its decoder as an error. One of its own ends the process all the same.
    static QUIET: Once = Once::new();
    QUIET.call_once(|| panic::set_hook(Box::new(|_| {})));
    let folder = placed(&[("s.exr", bytes)]);
    match within(ROOM, || read_light_layers(&folder.join("s.exr"))) {
        Ok(layers) => {
            let (_, first) = layers.first().expect("no file without a light");
            let size = (first.width, first.height);
            assert!(
                layers
                    .iter()
                    .all(|(_, image)| (image.width, image.height) == size)
            );
        }
        Err(error) => assert!(!error.to_string().contains('\n'), "{error}"),
    }
});
