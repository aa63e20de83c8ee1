//! Atomic writing of files: a file is written completely or not at all.

use std::fs;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use crate::error::IoError;

/// Writes a file completely or not at all; `-` is the standard output.
///
/// `write` fills a temporary file in the same folder. The file is flushed to the disk and then
/// renamed to `path`. If a step fails, the temporary file is removed and the old file stays
/// unchanged. No reader ever sees a partial file.
///
/// Special cases:
///
/// - A new file gets the default permissions (0666 without the umask on Unix).
/// - A replaced file keeps its permissions. A read-only file is not replaced.
/// - A symbolic link is followed.
/// - A pipe or a device cannot be replaced, so it is written in place, as is the standard output
///   ([`is_stream`]).
///
/// # Errors
///
/// [`IoError`] of the kind [`Write`](crate::IoErrorKind::Write). Also if the parent folder does not
/// exist, or if a path in `/dev` or `/proc` leads to a regular file, such as `/dev/stdout` after
/// `> file`.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let dir = tempfile::tempdir()?;
/// let path = dir.path().join("note.txt");
/// hicp_io::write_atomically(&path, |writer| writeln!(writer, "done"))?;
/// assert_eq!(std::fs::read_to_string(&path)?, "done\n");
/// # Ok(()) }
/// ```
pub fn write_atomically<F>(path: impl AsRef<Path>, write: F) -> Result<(), IoError>
where
    F: FnOnce(&mut dyn Write) -> io::Result<()>,
{
    // Compiled once, not for every closure.
    let mut write = Some(write);
    let mut once = |writer: &mut dyn Write| write.take().map_or(Ok(()), |write| write(writer));
    replace(path.as_ref(), &mut once)
}

/// The function that fills a file.
type Filling<'a> = &'a mut dyn FnMut(&mut dyn Write) -> io::Result<()>;

fn replace(path: &Path, write: Filling<'_>) -> Result<(), IoError> {
    let written = if is_stdout(path) {
        fill(io::stdout(), write).and_then(|mut stdout| stdout.flush())
    } else if is_stream(path) {
        let device = fs::OpenOptions::new().write(true).open(path);
        device.and_then(|device| fill(device, write)).map(drop)
    } else {
        temporary(path).and_then(|(file, target)| {
            let file = fill(file, write)?;
            file.as_file().sync_all()?;
            file.persist(target)?;
            Ok(())
        })
    };
    written.map_err(|e| IoError::write(path, e))
}

/// Checks that [`write_atomically`] can write to a path, without changing anything.
///
/// Programs call it before a long computation. It does not check the free disk space.
///
/// # Errors
///
/// As for [`write_atomically`].
///
/// ```
/// assert!(hicp_io::check_writable("no/such/folder/result.json").is_err());
/// ```
pub fn check_writable(path: impl AsRef<Path>) -> Result<(), IoError> {
    let path = path.as_ref();
    if is_stream(path) {
        return Ok(());
    }
    // Dropping the temporary file removes it.
    let created = temporary(path).map(drop);
    created.map_err(|e| IoError::write(path, e))
}

/// Returns whether [`write_atomically`] writes to a path in place: `-` (the standard output), a
/// pipe or a device.
///
/// ```
/// assert!(hicp_io::is_stream("-"));
/// assert!(!hicp_io::is_stream("result.json"));
/// ```
#[must_use]
pub fn is_stream(path: impl AsRef<Path>) -> bool {
    let path = path.as_ref();
    is_stdout(path) || fs::metadata(path).is_ok_and(|found| !found.is_file() && !found.is_dir())
}

/// Returns the file that [`write_atomically`] writes: links to existing files and `..` are
/// followed.
///
/// Two paths with the same destination name the same file. With it, a program can detect that an
/// output would replace another output or an input. Two hard links to one file have different
/// destinations, because an atomic write replaces only one of them.
///
/// # Errors
///
/// [`IoError`] of the kind [`Write`](crate::IoErrorKind::Write) if the parent folder does not
/// exist.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let dir = tempfile::tempdir()?;
/// let folder = dir.path();
/// let (plain, odd) = (folder.join("a.json"), folder.join("./a.json"));
/// assert_eq!(hicp_io::destination(plain)?, hicp_io::destination(odd)?);
/// # Ok(()) }
/// ```
pub fn destination(path: impl AsRef<Path>) -> Result<PathBuf, IoError> {
    let path = path.as_ref();
    resolve(path).map_err(|e| IoError::write(path, e))
}

fn resolve(path: &Path) -> io::Result<PathBuf> {
    if is_stdout(path) {
        return Ok(path.to_owned());
    }
    if let Ok(target) = fs::canonicalize(path) {
        return Ok(target);
    }
    let name = path.file_name().ok_or(io::ErrorKind::NotFound)?;
    match fs::canonicalize(folder_of(path)) {
        Ok(folder) if folder.is_dir() => Ok(folder.join(name)),
        _ => {
            let text = format!("folder {} does not exist", folder_of(path).display());
            Err(io::Error::new(io::ErrorKind::NotFound, text))
        }
    }
}

fn is_stdout(path: &Path) -> bool {
    path == Path::new("-")
}

/// Returns the parent folder of a path, `.` if the path has none.
pub(crate) fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// Creates a temporary file next to the file that `path` resolves to, and returns both.
fn temporary(path: &Path) -> io::Result<(NamedTempFile, PathBuf)> {
    let target = resolve(path)?;
    // Replacing the file behind a redirected stream would hide later output of the shell, which
    // still writes to the old file.
    if path.starts_with("/dev") && !target.starts_with("/dev") || path.starts_with("/proc") {
        let text = "it names an open stream, expected a file, or - for the standard output";
        return Err(io::Error::new(io::ErrorKind::InvalidInput, text));
    }
    let mut builder = tempfile::Builder::new();
    builder.prefix(".hicp-").suffix(".tmp");
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let file = builder.tempfile_in(folder_of(&target))?;
    if target.exists() {
        // Renaming would replace even a read-only file.
        let old = fs::OpenOptions::new().append(true).open(&target)?;
        file.as_file()
            .set_permissions(old.metadata()?.permissions())?;
    }
    Ok((file, target))
}

fn fill<W: Write>(target: W, write: Filling<'_>) -> io::Result<W> {
    let mut writer = BufWriter::new(target);
    write(&mut writer)?;
    writer.into_inner().map_err(io::IntoInnerError::into_error)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::IoErrorKind;

    fn names(folder: &Path) -> Vec<String> {
        fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect()
    }

    #[test]
    fn a_failed_write_keeps_the_old_file_and_leaves_no_temporary_file() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.txt");
        fs::write(&path, "old").unwrap();
        let result = write_atomically(&path, |writer| {
            writer.write_all(&[b'x'; 100_000])?;
            Err(io::Error::other("no more"))
        });
        assert!(matches!(
            result,
            Err(IoError {
                kind: IoErrorKind::Write,
                ..
            })
        ));
        assert_eq!(fs::read_to_string(&path).unwrap(), "old");
        assert_eq!(names(dir.path()), ["a.txt"]);

        let fresh = dir.path().join("b.txt");
        assert!(write_atomically(&fresh, |_| Err(io::Error::other("no"))).is_err());
        assert_eq!(names(dir.path()), ["a.txt"]);
    }

    #[test]
    fn an_old_file_is_replaced_completely() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.txt");
        fs::write(&path, "a longer old content").unwrap();
        write_atomically(&path, |writer| writer.write_all(b"new")).unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "new");
    }

    #[test]
    fn a_missing_folder_is_named() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("no/where/a.txt");
        let result = write_atomically(&path, |_| Ok(()));
        assert!(matches!(
            result,
            Err(error @ IoError { kind: IoErrorKind::Write, .. })
                if std::error::Error::source(&error).unwrap().to_string().contains("no/where does not exist")
        ));
    }

    #[test]
    fn check_writable_predicts_the_result_and_changes_nothing() {
        let dir = tempfile::tempdir().unwrap();
        let (old, new) = (dir.path().join("old"), dir.path().join("new"));
        fs::write(&old, "old").unwrap();
        for path in [&old, &new] {
            check_writable(path).unwrap();
        }
        assert_eq!(names(dir.path()), ["old"]);
        assert_eq!(fs::read_to_string(&old).unwrap(), "old");
        assert!(matches!(
            check_writable(dir.path().join("no/where")),
            Err(IoError {
                kind: IoErrorKind::Write,
                ..
            })
        ));
        assert!(matches!(
            check_writable(dir.path()),
            Err(IoError {
                kind: IoErrorKind::Write,
                ..
            })
        ));
        // A file cannot be used as a folder.
        assert!(check_writable(old.join("below")).is_err());
    }

    #[test]
    fn a_folder_is_not_replaced() {
        let dir = tempfile::tempdir().unwrap();
        assert!(matches!(
            write_atomically(dir.path(), |_| Ok(())),
            Err(IoError {
                kind: IoErrorKind::Write,
                ..
            })
        ));
    }

    #[cfg(unix)]
    #[test]
    fn permissions_are_those_of_a_new_file_and_links_stay_links() {
        use std::os::unix::fs::PermissionsExt;
        let dir = tempfile::tempdir().unwrap();
        let (plain, atomic, link) = (
            dir.path().join("plain"),
            dir.path().join("atomic"),
            dir.path().join("link"),
        );
        fs::write(&plain, "").unwrap();
        write_atomically(&atomic, |_| Ok(())).unwrap();
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode(&atomic), mode(&plain));

        fs::set_permissions(&atomic, fs::Permissions::from_mode(0o640)).unwrap();
        write_atomically(&atomic, |_| Ok(())).unwrap();
        assert_eq!(mode(&atomic) & 0o777, 0o640);

        std::os::unix::fs::symlink(&atomic, &link).unwrap();
        write_atomically(&link, |writer| writer.write_all(b"through")).unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::read_to_string(&atomic).unwrap(), "through");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_redirected_stream_is_refused_and_its_file_is_not_replaced() {
        use std::os::fd::AsRawFd;
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("log");
        fs::write(&path, "precious\n").unwrap();
        let log = fs::File::options().append(true).open(&path).unwrap();
        for folder in ["/dev/fd", "/proc/self/fd"] {
            let stream = format!("{folder}/{}", log.as_raw_fd());
            let error = write_atomically(stream, |writer| writer.write_all(b"new")).unwrap_err();
            let cause = std::error::Error::source(&error).unwrap().to_string();
            assert!(cause.contains("- for the standard output"), "{cause}");
            assert_eq!(fs::read_to_string(&path).unwrap(), "precious\n");
        }
        assert_eq!(names(dir.path()), ["log"]);
    }

    #[test]
    fn paths_of_one_file_have_one_destination() {
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        fs::create_dir(at("below")).unwrap();
        let real = fs::canonicalize(dir.path()).unwrap();
        for path in ["new", "./new", "below/../new"] {
            assert_eq!(destination(at(path)).unwrap(), real.join("new"), "{path}");
        }
        assert!(destination(at("no/new")).is_err());
        assert_eq!(destination("-").unwrap(), Path::new("-"));
        assert!(check_writable("-").is_ok());
    }
}
