//! Files that tests read and write, and errors that they expect.

use std::error::Error;
use std::path::{Path, PathBuf};

use hicp_io::{IoError, ReadLimits};

/// A temporary folder.
pub(crate) struct Folder(tempfile::TempDir);

impl Folder {
    pub(crate) fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    pub(crate) fn root(&self) -> &Path {
        self.0.path()
    }

    pub(crate) fn path(&self, name: impl AsRef<Path>) -> PathBuf {
        self.root().join(name)
    }

    /// Writes a file, and returns its path.
    pub(crate) fn write(&self, name: impl AsRef<Path>, content: impl AsRef<[u8]>) -> PathBuf {
        let path = self.path(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, content).unwrap();
        path
    }

    /// Writes a file with a given start, followed by zeros that occupy no disk space.
    pub(crate) fn sparse(&self, name: &str, start: impl AsRef<[u8]>, bytes: u64) -> PathBuf {
        let path = self.write(name, start);
        let file = std::fs::File::options().write(true).open(&path).unwrap();
        file.set_len(bytes).unwrap();
        path
    }
}

/// Returns the default limits with a change.
pub(crate) fn limits(change: impl FnOnce(&mut ReadLimits)) -> ReadLimits {
    let mut limits = ReadLimits::DEFAULT;
    change(&mut limits);
    limits
}

/// Returns the message of an error with its causes.
pub(crate) fn message(error: &IoError) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(cause) = source {
        text.push_str(": ");
        text.push_str(&cause.to_string());
        source = cause.source();
    }
    text
}

/// Asserts that a text contains all of these parts.
#[track_caller]
pub(crate) fn assert_contains(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "no {part:?} in: {text}");
    }
}

/// Asserts an error whose message contains all of these parts, and returns it.
#[track_caller]
pub(crate) fn refused<T>(result: Result<T, IoError>, parts: &[&str]) -> IoError {
    let Err(error) = result else {
        panic!("read, expected an error with {parts:?}");
    };
    assert_contains(&message(&error), parts);
    error
}

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
