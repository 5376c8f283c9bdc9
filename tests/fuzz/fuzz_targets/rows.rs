//! Rows files, with a checksum that matches, for the mesh that the file names.
#![no_main]

use libfuzzer_sys::fuzz_target;
use relume_fuzz::{sign, within};
use relume_host::gather;

const MESH_AT: usize = 12;
const ELEMENTS_AT: usize = 16;

fuzz_target!(|bytes: &[u8]| {
    let word = |at: usize| {
        let word = bytes.get(at..).and_then(|rest| rest.first_chunk());
        word.map_or(0, |word| u32::from_le_bytes(*word))
    };
    let (mesh, elements) = (word(MESH_AT), word(ELEMENTS_AT) as usize);
    let mut signed = bytes.to_vec();
    sign(&mut signed, bytes.len().saturating_sub(4));
    within(4096 + 8 * bytes.len(), || {
        assert!(gather::read(bytes, mesh ^ 1, elements).is_err());
        // Without elements, passes hold nothing.
        if let Ok(hits) = gather::read(&signed, mesh, elements)
            && elements > 0
        {
            assert_eq!(gather::write(&hits, mesh, elements), signed);
        }
    });
});
