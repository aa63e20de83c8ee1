//! The locations of files that tests read.

use std::path::PathBuf;

/// Returns the path of a part of the data folder, or prints that a test is skipped.
///
/// The folder is `HICP_DATA`, or `shared/data` next to the workspace.
pub(crate) fn data(part: &str) -> Option<PathBuf> {
    let default = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data");
    let root = std::env::var_os("HICP_DATA").map_or_else(|| PathBuf::from(default), PathBuf::from);
    let path = root.join(part);
    if path.exists() {
        Some(path)
    } else {
        println!("skipped: {} does not exist (set HICP_DATA)", path.display());
        None
    }
}

/// Returns the path of a file in `tests/fixtures`.
#[cfg(feature = "all-formats")]
pub(crate) fn fixture(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("tests/fixtures")
        .join(name)
}
