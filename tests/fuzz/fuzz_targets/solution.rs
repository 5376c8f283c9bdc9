//! Solution files, with a checksum that matches.
#![no_main]

use libfuzzer_sys::fuzz_target;
use relume_fuzz::{sign, within};
use relume_host::solution::{mesh_checksum, read, write};

fuzz_target!(|bytes: &[u8]| {
    let mut signed = bytes.to_vec();
    sign(&mut signed, bytes.len().saturating_sub(4));
    let read_in = |bytes: &[u8]| within(4096 + 8 * bytes.len(), || read(bytes));
    let _ = read_in(bytes);
    match read_in(&signed) {
        Ok(solution) => {
            let mix: Vec<_> = solution.lights.iter().map(|light| light.emission).collect();
            assert_eq!(solution.relight(&mix).len(), solution.mesh.elements.len());
            assert_eq!(
                solution.face_exitance(&mix).len(),
                solution.mesh.faces.len()
            );
            let written = write(&solution);
            assert_eq!(written.len(), signed.len());
            let again = read(&written).expect("what was written can be read");
            assert_eq!(mesh_checksum(&again), mesh_checksum(&solution));
            assert_eq!(write(&again), written);
        }
        Err(error) => assert!(!error.to_string().contains('\n')),
    }
});
