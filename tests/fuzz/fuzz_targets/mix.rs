//! Settings of a mix, one a line.
#![no_main]

use libfuzzer_sys::fuzz_target;
use relume::color::Rgb;
use relume_fuzz::within;
use relume_host::mix::{Setting, mix};
use relume_host::solution::SolutionLight;

fuzz_target!(|text: &str| {
    let lights = ["lamp", "a=b", ""].map(|name| SolutionLight {
        name: name.to_owned(),
        emission: Rgb::new(2.0, 0.5, 0.0),
        residual: 0.0,
        error: 0.0,
    });
    within(4096 + 64 * text.len(), || {
        let settings: Vec<Setting> = text.lines().filter_map(|line| line.parse().ok()).collect();
        for setting in &settings {
            let only = std::slice::from_ref(setting);
            match mix(&lights, only, &settings) {
                Ok(weights) => assert!(weights.iter().all(|weight| weight.is_legal())),
                Err(error) => assert!(!error.to_string().contains('\n')),
            }
        }
    });
});
