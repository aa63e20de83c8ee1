//! Writing folders whole or not at all.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use tempfile::TempDir;

use crate::atomic::folder_of;
use crate::error::IoError;

/// A folder in the making: it has a name of its own, beside the final one, until [`NewFolder::finish`].
///
/// Dropped before that, it is removed with what is in it; a program that is killed leaves a `.hicp-*.tmp` behind, which nothing
/// reads and which may be removed. Nobody ever sees a part of a folder under the final name.
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
    /// With links followed.
    target: PathBuf,
    made: TempDir,
}

impl NewFolder {
    /// Begins a folder that will be at `path`, where there must be nothing yet or an empty folder.
    ///
    /// An empty folder is replaced, now by an empty one with its permissions, so that one that cannot be (a mount point) is told
    /// before anything is computed.
    ///
    /// # Errors
    ///
    /// [`IoError::MissingFolder`] when the parent folder does not exist, [`IoError::Write`] when something is at `path`, or when
    /// nothing may be written beside it.
    pub fn begin(path: impl AsRef<Path>) -> Result<Self, IoError> {
        let path = path.as_ref();
        let failed = |e| IoError::write(path, e);
        if fs::symlink_metadata(path).is_err() {
            let parent = folder_of(path);
            if !parent.is_dir() {
                return Err(IoError::MissingFolder {
                    path: path.to_owned(),
                    folder: parent.to_owned(),
                });
            }
            return Ok(Self {
                target: path.to_owned(),
                made: beside(path).map_err(failed)?,
            });
        }
        let target = fs::canonicalize(path).map_err(failed)?;
        let permissions = fs::metadata(&target).map_err(failed)?.permissions();
        let empty = || -> io::Result<TempDir> {
            let made = beside(&target)?;
            fs::set_permissions(made.path(), permissions.clone())?;
            Ok(made)
        };
        // What is not empty, or no folder, is not replaced by renaming.
        rename(empty().map_err(failed)?, &target).map_err(failed)?;
        Ok(Self {
            made: empty().map_err(failed)?,
            target,
        })
    }

    /// Where to write what the folder shall hold.
    #[must_use]
    pub fn path(&self) -> &Path {
        self.made.path()
    }

    /// Gives the folder its name.
    ///
    /// # Errors
    ///
    /// [`IoError::Write`] when something has come to be at `path` meanwhile; what was made is removed.
    pub fn finish(self) -> Result<(), IoError> {
        rename(self.made, &self.target).map_err(|e| IoError::write(&self.target, e))
    }
}

fn beside(path: &Path) -> io::Result<TempDir> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".hicp-").suffix(".tmp");
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o777));
    builder.tempdir_in(folder_of(path))
}

fn rename(made: TempDir, target: &Path) -> io::Result<()> {
    // Elsewhere a folder is not renamed over an empty one.
    #[cfg(not(unix))]
    if target.is_dir() {
        fs::remove_dir(target)?;
    }
    fs::rename(made.path(), target)?;
    // It is no temporary folder any more.
    let _ = made.keep();
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).unwrap();
        let mut names: Vec<String> = entries
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn nothing_is_there_until_all_is() {
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
    fn what_is_not_finished_is_gone() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("set");
        let set = NewFolder::begin(&path).unwrap();
        fs::write(set.path().join("a"), "a").unwrap();
        drop(set);
        assert_eq!(names(dir.path()), [""; 0]);
    }

    #[test]
    fn what_is_there_stays() {
        let dir = tempfile::tempdir().unwrap();
        let full = dir.path().join("full");
        fs::create_dir(&full).unwrap();
        fs::write(full.join("mine"), "the user's").unwrap();
        let file = dir.path().join("file");
        fs::write(&file, "the user's").unwrap();
        for path in [&full, &file] {
            let begun = NewFolder::begin(path);
            assert!(matches!(begun, Err(IoError::Write { path: p, .. }) if p == *path));
        }
        let begun = NewFolder::begin(dir.path().join("no/where"));
        assert!(matches!(begun, Err(IoError::MissingFolder { .. })));
        // Somebody else was faster.
        let late = NewFolder::begin(dir.path().join("late")).unwrap();
        fs::create_dir(dir.path().join("late")).unwrap();
        fs::write(dir.path().join("late/theirs"), "theirs").unwrap();
        assert!(matches!(late.finish(), Err(IoError::Write { .. })));
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
