//! Writing files whole or not at all.

use std::fs;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use crate::error::IoError;

/// Writes a file whole or not at all.
///
/// `write` fills a temporary file in the same folder, which is flushed to the disk and then renamed over `path`. When
/// anything fails the temporary file is removed and what was at `path` stays as it was; nobody ever sees half a file.
/// A new file gets the permissions a newly created one gets (0666 without the umask on Unix), a replaced one keeps its own;
/// a file that may not be written to is not replaced; a symbolic link is followed, also one to a file that is still to be made.
/// What is no regular file (a pipe, a device) cannot be replaced and is written in place. So is an open descriptor
/// ([`is_stream`]), whatever it leads to: what its file holds stays, and what is written comes after it.
///
/// # Errors
///
/// [`IoError::MissingFolder`] when the parent folder does not exist, [`IoError::Write`] for everything else.
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
    let path = path.as_ref();
    let written = match target_of(path)? {
        // Opened anew they would have another position: what the program says next would be written over this.
        Target::Descriptor(Descriptor::Output) => stream(io::stdout(), write),
        Target::Descriptor(Descriptor::Error) => stream(io::stderr(), write),
        Target::Descriptor(Descriptor::Other) => {
            appending(path).and_then(|file| stream(file, write))
        }
        Target::Device => fs::OpenOptions::new()
            .write(true)
            .open(path)
            .and_then(|file| stream(file, write)),
        Target::New(file) => replace(&file, None, write),
        Target::Old(file, permissions) => replace(&file, Some(permissions), write),
    };
    written.map_err(|e| IoError::write(path, e))
}

/// Checks that [`write_atomically`] can write to a path, and changes nothing there.
///
/// For programs that compute for long before they write. It cannot promise that the disk has room then.
///
/// # Errors
///
/// As [`write_atomically`].
///
/// ```
/// assert!(hicp_io::check_writable("no/such/folder/result.json").is_err());
/// ```
pub fn check_writable(path: impl AsRef<Path>) -> Result<(), IoError> {
    let path = path.as_ref();
    let folder = match target_of(path)? {
        Target::Descriptor(_) | Target::Device => return Ok(()),
        Target::New(file) | Target::Old(file, _) => folder_of(&file).to_owned(),
    };
    // The temporary file is gone when this returns.
    match temporary(&folder) {
        Ok(_) => Ok(()),
        Err(e) => Err(IoError::write(path, e)),
    }
}

/// Returns whether [`write_atomically`] writes to a path in place, because what is there is not to be replaced.
///
/// That is a pipe or a device, and an open descriptor, whether the path names it (`/dev/stdout`, `/dev/stderr`, `/dev/fd/3`,
/// `/proc/self/fd/3`) or links lead to it: a shell has opened it, often to write more to it, and it need not lead to a file at all.
/// Where it leads to a regular file, replacing that would lose what the file holds.
///
/// ```
/// assert!(!hicp_io::is_stream("result.json"));
/// # #[cfg(target_os = "linux")]
/// assert!(hicp_io::is_stream("/dev/stdout"));
/// ```
#[must_use]
pub fn is_stream(path: impl AsRef<Path>) -> bool {
    matches!(
        target_of(path.as_ref()),
        Ok(Target::Descriptor(_) | Target::Device)
    )
}

/// Returns where [`write_atomically`] writes, with links and `..` followed, whether or not a file is there yet.
///
/// Paths with the same destination name the same file, so that a program can tell that one of its outputs would take the place of
/// another, or of an input. Two names of one file (hard links) are two files here, as they are to a writer that replaces.
///
/// # Errors
///
/// [`IoError::MissingFolder`] when the parent folder does not exist, [`IoError::Write`] when a link cannot be followed.
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
    fs::canonicalize(path).or_else(|error| {
        let failed = |e| IoError::write(path, e);
        let file = end_of_links(path, error).map_err(failed)?;
        let folder = existing_folder_of(path, &file)?;
        match file.file_name() {
            Some(name) => Ok(fs::canonicalize(folder).map_err(failed)?.join(name)),
            None => Err(failed(io::ErrorKind::NotFound.into())),
        }
    })
}

/// Most links that are followed one after the other; systems follow fewer.
const LINKS: usize = 64;

/// What a path to be written leads to.
enum Target {
    /// An open descriptor, whatever it leads to.
    Descriptor(Descriptor),
    /// A pipe, a device: it cannot be replaced.
    Device,
    /// Nothing yet: where it will be, with links followed.
    New(PathBuf),
    /// A regular file, with links followed, and its permissions.
    Old(PathBuf, fs::Permissions),
}

/// What an open descriptor is to this program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Descriptor {
    /// Its standard output.
    Output,
    /// Its standard error.
    Error,
    /// Another one, or one of another program.
    Other,
}

fn target_of(path: &Path) -> Result<Target, IoError> {
    let failed = |e| IoError::write(path, e);
    let found = fs::metadata(path);
    if found.as_ref().is_ok_and(fs::Metadata::is_dir) {
        return Err(failed(io::ErrorKind::IsADirectory.into()));
    }
    if let Some(descriptor) = descriptor_of(path) {
        // One that is not open has no name there. A file must let itself be opened anew; opening a pipe may wait.
        return found
            .and_then(|metadata| match descriptor {
                Descriptor::Other if metadata.is_file() => appending(path).map(|_| ()),
                _ => Ok(()),
            })
            .map(|()| Target::Descriptor(descriptor))
            .map_err(failed);
    }
    match found {
        Ok(metadata) if !metadata.is_file() => Ok(Target::Device),
        Ok(metadata) => {
            // Renaming would replace a file that may not be written to: ask first.
            appending(path)
                .and_then(|_| fs::canonicalize(path))
                .map(|file| Target::Old(file, metadata.permissions()))
                .map_err(failed)
        }
        Err(error) => {
            let file = end_of_links(path, error).map_err(failed)?;
            existing_folder_of(path, &file)?;
            Ok(Target::New(file))
        }
    }
}

/// The folder of a file that is still to be made, to which `path` leads.
fn existing_folder_of<'a>(path: &Path, file: &'a Path) -> Result<&'a Path, IoError> {
    match folder_of(file) {
        folder if folder.is_dir() => Ok(folder),
        folder => Err(IoError::MissingFolder {
            path: path.to_owned(),
            folder: folder.to_owned(),
        }),
    }
}

/// Which open descriptor a path names, or links lead to.
///
/// The links are followed one at a time, for the last one, that of the descriptor itself, leads on to the file.
fn descriptor_of(path: &Path) -> Option<Descriptor> {
    let mut file = path.to_owned();
    for _ in 0..LINKS {
        let folder = fs::canonicalize(folder_of(&file)).ok()?;
        if let Some(is_own) = descriptors_in(&folder) {
            return match file.file_name()?.to_str()?.parse::<u32>().ok()? {
                1 if is_own => Some(Descriptor::Output),
                2 if is_own => Some(Descriptor::Error),
                _ => Some(Descriptor::Other),
            };
        }
        file = folder.join(fs::read_link(&file).ok()?);
    }
    None
}

/// Whether a folder, with links followed, is one of open descriptors, and then whether they are those of this program.
fn descriptors_in(folder: &Path) -> Option<bool> {
    if folder == Path::new("/dev/fd") {
        return Some(true);
    }
    let below = folder.strip_prefix("/proc").ok()?;
    let names: Vec<_> = below.iter().map(|name| name.to_string_lossy()).collect();
    let is_number = |name: &str| name.bytes().all(|byte| byte.is_ascii_digit());
    match names.iter().map(AsRef::as_ref).collect::<Vec<&str>>()[..] {
        [process, "fd"] if is_number(process) => {}
        [process, "task", thread, "fd"] if is_number(process) && is_number(thread) => {}
        _ => return None,
    }
    Some(fs::canonicalize("/proc/self").is_ok_and(|own| folder.starts_with(own)))
}

/// Where a path leads at which there is no file, which is what `error` said: renaming would replace a link instead of following it.
fn end_of_links(path: &Path, error: io::Error) -> io::Result<PathBuf> {
    let mut file = path.to_owned();
    for _ in 0..LINKS {
        if !fs::symlink_metadata(&file).is_ok_and(|found| found.is_symlink()) {
            return Ok(file);
        }
        // A ring, or a folder that may not be entered.
        if error.kind() != io::ErrorKind::NotFound {
            return Err(error);
        }
        file = folder_of(&file).join(fs::read_link(&file)?);
    }
    Err(error)
}

/// The folder that a path is in.
pub(crate) fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

fn replace<F>(path: &Path, permissions: Option<fs::Permissions>, write: F) -> io::Result<()>
where
    F: FnOnce(&mut dyn Write) -> io::Result<()>,
{
    let temporary = fill(temporary(folder_of(path))?, write)?;
    if let Some(permissions) = permissions {
        temporary.as_file().set_permissions(permissions)?;
    }
    temporary.as_file().sync_all()?;
    temporary.persist(path)?;
    Ok(())
}

fn temporary(folder: &Path) -> io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".hicp-").suffix(".tmp");
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder.tempfile_in(folder)
}

/// Opens what is there, so that nothing in it is written over.
fn appending(path: &Path) -> io::Result<fs::File> {
    fs::OpenOptions::new().append(true).open(path)
}

/// Writes to what is open.
fn stream<W, F>(target: W, write: F) -> io::Result<()>
where
    W: Write,
    F: FnOnce(&mut dyn Write) -> io::Result<()>,
{
    fill(target, write)?.flush()
}

fn fill<W, F>(target: W, write: F) -> io::Result<W>
where
    W: Write,
    F: FnOnce(&mut dyn Write) -> io::Result<()>,
{
    let mut writer = BufWriter::new(target);
    write(&mut writer)?;
    writer.into_inner().map_err(io::IntoInnerError::into_error)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect()
    }

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.txt");
        fs::write(&path, "old").unwrap();
        let result = write_atomically(&path, |writer| {
            writer.write_all(&[b'x'; 100_000])?;
            Err(io::Error::other("no more"))
        });
        assert!(matches!(result, Err(IoError::Write { .. })));
        assert_eq!(fs::read_to_string(&path).unwrap(), "old");
        assert_eq!(names(dir.path()), ["a.txt"]);

        let fresh = dir.path().join("b.txt");
        assert!(write_atomically(&fresh, |_| Err(io::Error::other("no"))).is_err());
        assert_eq!(names(dir.path()), ["a.txt"]);
    }

    #[test]
    fn an_old_file_is_replaced_whole() {
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
            Err(IoError::MissingFolder { folder, .. }) if folder == dir.path().join("no/where")
        ));
    }

    #[test]
    fn checking_foretells_and_changes_nothing() {
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
            Err(IoError::MissingFolder { .. })
        ));
        assert!(matches!(
            check_writable(dir.path()),
            Err(IoError::Write { .. })
        ));
        // A file is no folder to write into.
        assert!(check_writable(old.join("below")).is_err());
    }

    #[test]
    fn a_folder_is_not_replaced() {
        let dir = tempfile::tempdir().unwrap();
        assert!(matches!(
            write_atomically(dir.path(), |_| Ok(())),
            Err(IoError::Write { .. })
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

    /// Standard output and standard error have tests that run the program.
    #[cfg(target_os = "linux")]
    #[test]
    fn open_descriptors_are_appended_to_and_never_replaced() {
        use std::os::fd::AsRawFd;
        use std::os::unix::fs::{MetadataExt, symlink};
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        fs::write(at("log"), "precious\n").unwrap();
        let log = fs::File::options().append(true).open(at("log")).unwrap();
        let (number, inode) = (log.as_raw_fd(), log.metadata().unwrap().ino());
        symlink(format!("/dev/fd/{number}"), at("first")).unwrap();
        symlink("first", at("second")).unwrap();
        symlink("/proc/self/fd", at("folder")).unwrap();
        let mut expected = "precious\n".to_owned();
        for path in [
            PathBuf::from(format!("/dev/fd/{number}")),
            format!("/proc/self/fd/{number}").into(),
            format!("/proc/thread-self/fd/{number}").into(),
            format!("/proc/{}/fd/{number}", std::process::id()).into(),
            at("second"),
            at("folder").join(number.to_string()),
        ] {
            assert!(is_stream(&path), "{}", path.display());
            check_writable(&path).unwrap();
            assert_eq!(fs::read_to_string(at("log")).unwrap(), expected);
            write_atomically(&path, |writer| writeln!(writer, "{}", path.display())).unwrap();
            expected += &format!("{}\n", path.display());
            assert_eq!(fs::read_to_string(at("log")).unwrap(), expected);
        }
        assert_eq!(fs::metadata(at("log")).unwrap().ino(), inode);
        assert_eq!(names(dir.path()).len(), 4, "no temporary file");
        // By its own name it is a file like any other.
        assert!(!is_stream(at("log")));
        assert_eq!(
            ["/dev/stdout", "/dev/stderr", "/proc/self/fd/1", "/dev/fd/2"]
                .map(|path| descriptor_of(Path::new(path))),
            [
                Descriptor::Output,
                Descriptor::Error,
                Descriptor::Output,
                Descriptor::Error
            ]
            .map(Some)
        );
        // That of another program is none of this one's.
        assert_eq!(descriptors_in(Path::new("/proc/0/fd")), Some(false));
        for folder in ["/proc/0", "/proc/self-made/fd", "/proc/0/task/fd", "/fd"] {
            assert_eq!(descriptors_in(Path::new(folder)), None, "{folder}");
        }
        // What is not open, or no descriptor, is nothing to write to.
        for path in ["/dev/fd/54321", "/proc/self/fd/new"] {
            assert!(!is_stream(path));
            assert!(matches!(
                check_writable(path),
                Err(IoError::Write { .. } | IoError::MissingFolder { .. })
            ));
        }
    }

    #[cfg(unix)]
    #[test]
    fn links_lead_to_files_that_are_still_to_be_made() {
        use std::os::unix::fs::symlink;
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        fs::create_dir(at("below")).unwrap();
        // Relative to the folder of the link, not to that of the program.
        symlink("below/second", at("first")).unwrap();
        symlink("new", at("below/second")).unwrap();
        check_writable(at("first")).unwrap();
        assert_eq!(names(&at("below")), ["second"]);
        write_atomically(at("first"), |writer| writer.write_all(b"through")).unwrap();
        for link in ["first", "below/second"] {
            assert!(fs::symlink_metadata(at(link)).unwrap().is_symlink());
        }
        let made = fs::symlink_metadata(at("below/new")).unwrap();
        assert!(made.is_file());
        assert_eq!(fs::read(at("first")).unwrap(), b"through");

        // Wherever one begins, the destination is one.
        let real = fs::canonicalize(dir.path()).unwrap();
        symlink("below/../fresh", at("third")).unwrap();
        for (path, end) in [
            ("first", "below/new"),
            ("below/second", "below/new"),
            ("below/../below/new", "below/new"),
            ("third", "fresh"),
            ("below/../third", "fresh"),
            ("./fresh", "fresh"),
        ] {
            assert_eq!(destination(at(path)).unwrap(), real.join(end), "{path}");
        }
        assert!(!at("fresh").exists());

        symlink("no/new", at("nowhere")).unwrap();
        assert!(matches!(
            destination(at("nowhere")),
            Err(IoError::MissingFolder { path, folder }) if path == at("nowhere") && folder == at("no")
        ));
        assert!(matches!(
            destination(at("below/new/..")),
            Err(IoError::Write { .. } | IoError::MissingFolder { .. })
        ));
        assert!(matches!(
            check_writable(at("nowhere")),
            Err(IoError::MissingFolder { path, folder }) if path == at("nowhere") && folder == at("no")
        ));
        symlink("ring", at("ring")).unwrap();
        for result in [
            check_writable(at("ring")),
            destination(at("ring")).map(|_| ()),
            write_atomically(at("ring"), |_| Ok(())),
        ] {
            assert!(matches!(result, Err(IoError::Write { path, .. }) if path == at("ring")));
        }
        assert!(fs::symlink_metadata(at("ring")).unwrap().is_symlink());
    }
}
