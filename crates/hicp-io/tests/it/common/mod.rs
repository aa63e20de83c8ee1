//! Where the data folder is that some tests read.

use std::path::PathBuf;

/// Returns a part of the data folder (`HICP_DATA`, or `shared/data` beside the workspace), or says aloud that a test is skipped.
pub(crate) fn data(part: &str) -> Option<PathBuf> {
    let beside = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data");
    let root = std::env::var_os("HICP_DATA").map_or_else(|| PathBuf::from(beside), PathBuf::from);
    let path = root.join(part);
    if path.exists() {
        Some(path)
    } else {
        println!("skipped: {} is not there (set HICP_DATA)", path.display());
        None
    }
}
