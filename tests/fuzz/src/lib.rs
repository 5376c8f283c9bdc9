//! What the fuzz targets share: a limit on memory, checksums that match, a folder for files.
//!
//! A reader has a file in `fuzz_targets/` with its `[[bin]]`, a folder in `seeds/` with at least one file that it
//! takes, perhaps a dictionary of the same name in `dict/`, and a line in `coverage`.

use std::alloc::System;
use std::fs;
use std::panic;
use std::path::{Path, PathBuf};
use std::sync::{Once, OnceLock};

use cap::Cap;
use crc::{CRC_32_ISO_HDLC, Crc};

#[global_allocator]
static HEAP: Cap<System> = Cap::new(System, usize::MAX);

const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// Runs `work`, which may hold at most `bytes` more memory than is held before it.
///
/// An allocation beyond that fails, which ends the process: a crash for the fuzzer.
pub fn within<T>(bytes: usize, work: impl FnOnce() -> T) -> T {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let report = panic::take_hook();
        panic::set_hook(Box::new(move |panic| {
            limit(usize::MAX); // a report needs memory of its own
            report(panic);
        }));
    });
    limit(HEAP.allocated().saturating_add(bytes));
    let result = work();
    limit(usize::MAX);
    result
}

fn limit(bytes: usize) {
    HEAP.set_limit(bytes)
        .expect("more is held than the limit allows");
}

/// Puts the CRC-32 of all but the four bytes at `at` there; nothing where they do not exist.
pub fn sign(bytes: &mut [u8], at: usize) {
    let Some((before, rest)) = bytes.split_at_mut_checked(at) else {
        return;
    };
    let Some((own, after)) = rest.split_first_chunk_mut::<4>() else {
        return;
    };
    let mut digest = CRC.digest();
    digest.update(before);
    digest.update(after);
    *own = digest.finalize().to_le_bytes();
}

/// Writes files into a folder of this process alone, and returns the folder.
///
/// # Panics
/// When the folder cannot be written to.
pub fn placed(files: &[(&str, &[u8])]) -> &'static Path {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    let folder = FOLDER.get_or_init(|| {
        let folder = std::env::temp_dir().join(format!("relume-fuzz-{}", std::process::id()));
        fs::create_dir_all(&folder).expect("no room for files");
        folder
    });
    for (name, bytes) in files {
        fs::write(folder.join(name), bytes).expect("no room for files");
    }
    folder
}
