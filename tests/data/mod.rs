//! Where the reference data lies.

use std::path::{Path, PathBuf};

use crate::skip::skip;

/// The folder of reference data: `RELUME_DATA`, else `../shared/data` seen from the project's root.
///
/// `None`, said aloud, when it is not there; on a build server that is a failure.
pub fn data_dir() -> Option<PathBuf> {
    let default = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data");
    let folder = std::env::var_os("RELUME_DATA").map_or_else(default, PathBuf::from);
    if folder.is_dir() {
        return Some(folder);
    }
    let missing = format!("no reference data at {}; set RELUME_DATA", folder.display());
    skip(&missing);
    None
}
