//! Camera files.
#![no_main]

use libfuzzer_sys::fuzz_target;
use relume_fuzz::within;
use relume_host::preview::{Camera, Viewpoint};

fuzz_target!(|text: &str| {
    let camera = within((1 << 16) + 1024 * text.len(), || {
        Camera::new(Viewpoint::from_toml(text)?, 64, 48)
    });
    match camera {
        Ok(camera) => assert!(camera.ray(31.5, 0.5).is_finite()),
        Err(error) => assert!(!error.to_string().contains('\n'), "{error}"),
    }
});
