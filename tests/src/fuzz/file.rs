//! Temporary files with arbitrary bytes, because readers take paths.
//!
//! There is one file per thread and name, which every run overwrites.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Seek, Write};
use std::path::PathBuf;

struct Folder {
    dir: tempfile::TempDir,
    files: BTreeMap<&'static str, File>,
}

thread_local! {
    static FOLDER: RefCell<Option<Folder>> = const { RefCell::new(None) };
}

/// Writes bytes into a file of this name in the thread's temporary folder and returns its path.
pub(super) fn with_bytes(name: &'static str, data: &[u8]) -> PathBuf {
    FOLDER.with_borrow_mut(|folder| {
        let folder = folder.get_or_insert_with(|| Folder {
            dir: tempfile::tempdir().expect("a temporary folder"),
            files: BTreeMap::new(),
        });
        let path = folder.dir.path().join(name);
        let file = folder
            .files
            .entry(name)
            .or_insert_with(|| File::create(&path).expect("a temporary file"));
        // The file stays open and is not truncated first, because some file systems flush truncated
        // files.
        file.rewind().expect("a seekable file");
        file.write_all(data).expect("room for a temporary file");
        file.set_len(data.len() as u64).expect("a resizable file");
        path
    })
}

/// Returns a path in the thread's temporary folder for the output of a target.
pub(super) fn next_to(path: &std::path::Path, name: &str) -> PathBuf {
    path.with_file_name(name)
}
