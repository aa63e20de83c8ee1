//! Atomic creation of folders: a folder appears completely or not at all.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use tempfile::TempDir;

use crate::atomic::{destination, folder_of};
use crate::error::IoError;

/// A folder under construction, which has a temporary name until [`NewFolder::finish`].
///
/// The temporary folder is next to the final path. If the value is dropped before `finish`, the
/// folder is removed with its content. A killed program leaves a `.hicp-*.tmp` folder, which can be
/// deleted. No reader ever sees a partial folder under the final name.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let dir = tempfile::tempdir()?;
/// let path = dir.path().join("set");
/// let set = hicp_io::NewFolder::begin(&path)?;
/// std::fs::write(set.path().join("note.txt"), "half")?;
/// assert!(!path.exists());
/// set.finish()?;
/// assert!(path.join("note.txt").exists());
/// # Ok(()) }
/// ```
#[derive(Debug)]
pub struct NewFolder {
    target: PathBuf,
    made: TempDir,
}

impl NewFolder {
    /// Starts a folder for `path`, at which there must be nothing or an empty folder.
    ///
    /// # Errors
    ///
    /// [`IoError`] of the kind [`Write`](crate::IoErrorKind::Write) in these cases:
    ///
    /// - There is a file or a folder with content at `path`.
    /// - The parent folder does not exist or is not writable.
    pub fn begin(path: impl AsRef<Path>) -> Result<Self, IoError> {
        let path = path.as_ref();
        let failed = |e| IoError::write(path, e);
        let target = destination(path)?;
        let mut builder = tempfile::Builder::new();
        builder.prefix(".hicp-").suffix(".tmp");
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o777));
        let made = builder.tempdir_in(folder_of(&target)).map_err(failed)?;
        if let Ok(old) = fs::metadata(&target) {
            if fs::read_dir(&target).map_err(failed)?.next().is_some() {
                return Err(failed(io::ErrorKind::DirectoryNotEmpty.into()));
            }
            fs::set_permissions(made.path(), old.permissions()).map_err(failed)?;
        }
        Ok(Self { target, made })
    }

    /// Returns the temporary folder, to be filled.
    #[must_use]
    pub fn path(&self) -> &Path {
        self.made.path()
    }

    /// Renames the folder to its final path.
    ///
    /// # Errors
    ///
    /// [`IoError`] of the kind [`Write`](crate::IoErrorKind::Write) if something was created at the
    /// path in the meantime. In that case, the new folder is removed.
    pub fn finish(self) -> Result<(), IoError> {
        // Only Unix renames a folder over an empty one.
        #[cfg(not(unix))]
        let _ = fs::remove_dir(&self.target);
        fs::rename(self.made.path(), &self.target).map_err(|e| IoError::write(&self.target, e))?;
        // `TempDir` would otherwise try to remove the old path.
        let _ = self.made.keep();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::IoErrorKind;

    fn names(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).unwrap();
        let mut names: Vec<String> = entries
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn a_folder_appears_only_when_it_is_finished() {
        let dir = tempfile::tempdir().unwrap();
        for existing in [false, true] {
            let path = dir.path().join(format!("set-{existing}"));
            if existing {
                fs::create_dir(&path).unwrap();
            }
            let set = NewFolder::begin(&path).unwrap();
            fs::create_dir(set.path().join("below")).unwrap();
            fs::write(set.path().join("below/a"), "a").unwrap();
            assert_eq!(path.exists(), existing);
            assert!(!path.join("below").exists());
            set.finish().unwrap();
            assert_eq!(fs::read(path.join("below/a")).unwrap(), b"a");
        }
        assert_eq!(names(dir.path()), ["set-false", "set-true"]);
    }

    #[test]
    fn an_unfinished_folder_is_removed() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("set");
        let set = NewFolder::begin(&path).unwrap();
        fs::write(set.path().join("a"), "a").unwrap();
        drop(set);
        assert_eq!(names(dir.path()), [""; 0]);
    }

    #[test]
    fn existing_files_and_folders_are_not_replaced() {
        let dir = tempfile::tempdir().unwrap();
        let full = dir.path().join("full");
        fs::create_dir(&full).unwrap();
        fs::write(full.join("mine"), "the user's").unwrap();
        let file = dir.path().join("file");
        fs::write(&file, "the user's").unwrap();
        for path in [&full, &file] {
            let begun = NewFolder::begin(path);
            assert!(
                matches!(begun, Err(IoError { kind: IoErrorKind::Write, path: p, .. }) if p == *path)
            );
        }
        let begun = NewFolder::begin(dir.path().join("no/where"));
        assert!(matches!(
            begun,
            Err(IoError {
                kind: IoErrorKind::Write,
                ..
            })
        ));
        // Another program creates the folder first.
        let late = NewFolder::begin(dir.path().join("late")).unwrap();
        fs::create_dir(dir.path().join("late")).unwrap();
        fs::write(dir.path().join("late/theirs"), "theirs").unwrap();
        assert!(matches!(
            late.finish(),
            Err(IoError {
                kind: IoErrorKind::Write,
                ..
            })
        ));
        assert_eq!(names(dir.path()), ["file", "full", "late"]);
        assert_eq!(names(&dir.path().join("late")), ["theirs"]);
        assert_eq!(fs::read(full.join("mine")).unwrap(), b"the user's");
        assert_eq!(fs::read(&file).unwrap(), b"the user's");
    }

    #[cfg(unix)]
    #[test]
    fn permissions_are_those_of_a_new_or_the_old_folder_and_links_stay_links() {
        use std::os::unix::fs::PermissionsExt;
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        let mode = |name: &str| fs::metadata(at(name)).unwrap().permissions().mode();
        fs::create_dir(at("plain")).unwrap();
        NewFolder::begin(at("new")).unwrap().finish().unwrap();
        assert_eq!(mode("new"), mode("plain"));
        fs::set_permissions(at("plain"), fs::Permissions::from_mode(0o750)).unwrap();
        std::os::unix::fs::symlink(at("plain"), at("link")).unwrap();
        let set = NewFolder::begin(at("link")).unwrap();
        fs::write(set.path().join("a"), "a").unwrap();
        set.finish().unwrap();
        assert_eq!(mode("plain") & 0o777, 0o750);
        assert!(fs::symlink_metadata(at("link")).unwrap().is_symlink());
        assert!(at("plain/a").exists());
    }
}
