//! Points to be probed, as CSV.
#![no_main]

use libfuzzer_sys::fuzz_target;
use relume_fuzz::within;
use relume_host::probe::{Part, probe_points, read_points};
use relume_host::solution::{self, Solution};
use std::sync::LazyLock;

static ROOM: LazyLock<Solution> = LazyLock::new(|| {
    solution::read(include_bytes!("../seeds/solution/room.solution")).expect("a sound seed")
});

fuzz_target!(|bytes: &[u8]| {
    let points = within(4096 + 64 * bytes.len(), || read_points(bytes));
    match points {
        Ok(points) => {
            let probed = probe_points(&ROOM, &points, Part::Total).expect("it has a mesh");
            assert!(probed.missing <= points.len());
        }
        Err(error) => assert!(!error.to_string().contains('\n'), "{error}"),
    }
});
