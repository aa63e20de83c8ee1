//! Whole files into memory, within limits.

use std::fs::{File, Metadata};
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

use crate::error::{END_OF_FILE, IoError, Place};
use crate::limits::ReadLimits;

/// Returns whether nothing is at a path.
///
/// What cannot be told counts as being there, so that reading it says why: a share that does not answer or a folder that may not be
/// entered is no reason to go on as if a file had never been.
///
/// # Examples
///
/// ```
/// assert!(hicp_io::is_absent("no/such/models_info.json"));
/// assert!(!hicp_io::is_absent(std::env::temp_dir()));
/// ```
#[must_use]
pub fn is_absent(path: impl AsRef<Path>) -> bool {
    matches!(path.as_ref().try_exists(), Ok(false))
}

/// What is looked at before a file is read whole.
const HEAD_BYTES: u64 = 1 << 16;

/// An open regular file.
#[derive(Debug)]
pub(crate) struct Source<'a> {
    path: &'a Path,
    file: File,
    opened: Metadata,
}

impl<'a> Source<'a> {
    /// Opens a regular file. Anything else is refused: opening a pipe would wait for its writer, and a device has no end.
    pub(crate) fn open(path: &'a Path) -> Result<Self, IoError> {
        let failed = |e| IoError::read(path, e);
        let before = std::fs::metadata(path).map_err(failed)?;
        if !before.is_file() {
            return Err(IoError::NotAFile {
                path: path.to_owned(),
                found: kind_of(&before),
            });
        }
        let file = File::open(path).map_err(failed)?;
        let opened = file.metadata().map_err(failed)?;
        Ok(Self { path, file, opened })
    }

    /// The size of the file when it was opened, bytes.
    pub(crate) fn bytes(&self) -> u64 {
        self.opened.len()
    }

    /// Reads the first bytes of the file: 64 KiB, or all of a smaller one.
    pub(crate) fn head(&mut self) -> Result<Vec<u8>, IoError> {
        let mut head = Vec::new();
        (&mut self.file)
            .take(HEAD_BYTES)
            .read_to_end(&mut head)
            .and_then(|_| self.file.seek(SeekFrom::Start(0)))
            .map_err(|e| IoError::read(self.path, e))?;
        Ok(head)
    }

    /// Reads the file from its start. A file that another program changes meanwhile is refused: it would be neither the old nor the new one.
    pub(crate) fn read(mut self, what: Limited, limit: u64) -> Result<Vec<u8>, IoError> {
        let expected = self.bytes();
        what.check(self.path, None, expected, limit)?;
        let mut content = Vec::with_capacity(usize::try_from(expected).unwrap_or(0));
        // One byte more than there should be shows that the file grew.
        (&mut self.file)
            .take(expected.saturating_add(1))
            .read_to_end(&mut content)
            .map_err(|e| IoError::read(self.path, e))?;
        let now = self
            .file
            .metadata()
            .map_err(|e| IoError::read(self.path, e))?;
        let written = |metadata: &Metadata| metadata.modified().ok();
        let read = content.len() as u64;
        let is_touched = now.len() != expected || written(&now) != written(&self.opened);
        if read != expected && !is_touched {
            // Files that the system makes up as they are read, such as those of /proc, have any size; those that change twice within a tick
            // of the clock of the file system seem untouched.
            return Err(IoError::Bytes {
                path: self.path.to_owned(),
                offset: read.min(expected),
                found: if read < expected {
                    END_OF_FILE.to_owned()
                } else {
                    "more bytes".to_owned()
                },
                expected: format!(
                    "a file of {expected} bytes, the size that the file system tells, that stays as it is while it is read"
                ),
            });
        }
        if is_touched {
            return Err(IoError::Changed {
                path: self.path.to_owned(),
                before: expected,
                after: now.len(),
            });
        }
        Ok(content)
    }
}

/// Names what is there instead of a regular file.
pub(crate) fn kind_of(metadata: &Metadata) -> &'static str {
    if metadata.is_dir() {
        return "a folder";
    }
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt;
        let kind = metadata.file_type();
        if kind.is_fifo() {
            return "a pipe";
        }
        if kind.is_socket() {
            return "a socket";
        }
        if kind.is_char_device() || kind.is_block_device() {
            return "a device";
        }
    }
    "no regular file"
}

/// Reads a regular file of at most `limit` bytes.
pub(crate) fn read_bytes(path: &Path, limit: u64) -> Result<Vec<u8>, IoError> {
    Source::open(path)?.read(Limited::FileBytes, limit)
}

impl ReadLimits {
    /// Reads a text file that nothing else here parses, of at most `max_file_bytes`; a byte order mark is dropped.
    ///
    /// # Errors
    ///
    /// [`IoError`] for what is no regular file, above the limit, changed while it was read or not UTF-8.
    pub fn read_text(&self, path: impl AsRef<Path>) -> Result<String, IoError> {
        text(path.as_ref(), Limited::FileBytes, self.max_file_bytes)
    }

    /// Reads the text of a JSON file that states one thing and that the caller parses, of at most `max_small_json_bytes`; a byte order
    /// mark is dropped.
    ///
    /// # Errors
    ///
    /// As [`ReadLimits::read_text`].
    ///
    /// # Examples
    ///
    /// ```
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// # let dir = tempfile::tempdir()?;
    /// # let path = dir.path().join("settings.json");
    /// std::fs::write(&path, "{\"bins\": 10}")?;
    /// let mut limits = hicp_io::ReadLimits::default();
    /// assert_eq!(limits.read_small_json_text(&path)?, "{\"bins\": 10}");
    /// limits.max_small_json_bytes = 11;
    /// let told = limits.read_small_json_text(&path).unwrap_err().to_string();
    /// assert!(told.contains("--max-small-json-bytes"));
    /// # Ok(()) }
    /// ```
    pub fn read_small_json_text(&self, path: impl AsRef<Path>) -> Result<String, IoError> {
        let limit = self.max_small_json_bytes;
        text(path.as_ref(), Limited::SmallJsonBytes, limit)
    }

    /// Reads a file that nothing else here parses as it is, of at most `max_file_bytes`: for one that a failing machine may have cut off
    /// or filled with zeros, of which what is whole is to be found.
    ///
    /// # Errors
    ///
    /// [`IoError`] for what is no regular file, above the limit or changed while it was read.
    ///
    /// # Examples
    ///
    /// ```
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// # let dir = tempfile::tempdir()?;
    /// # let path = dir.path().join("rows.csv");
    /// std::fs::write(&path, b"a,b\n1,\0\0")?;
    /// let limits = hicp_io::ReadLimits::default();
    /// assert_eq!(limits.read_bytes(&path)?, b"a,b\n1,\0\0");
    /// assert!(limits.read_bytes(dir.path()).is_err()); // a folder
    /// # Ok(()) }
    /// ```
    pub fn read_bytes(&self, path: impl AsRef<Path>) -> Result<Vec<u8>, IoError> {
        read_bytes(path.as_ref(), self.max_file_bytes)
    }
}

/// Reads a regular file of at most so many bytes as text.
fn text(path: &Path, what: Limited, limit: u64) -> Result<String, IoError> {
    let content = Source::open(path)?.read(what, limit)?;
    match std::str::from_utf8(text_bytes(path, &content)?) {
        Ok(text) => Ok(text.to_owned()),
        Err(error) => Err(IoError::Bytes {
            path: path.to_owned(),
            offset: error.valid_up_to() as u64,
            found: "a byte that is not UTF-8".to_owned(),
            expected: "text in UTF-8".to_owned(),
        }),
    }
}

/// What a limit is about.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Limited {
    FileBytes,
    JsonBytes,
    SmallJsonBytes,
    Vertices,
    Triangles,
    Rows,
}

impl Limited {
    /// Refuses a count above the limit.
    pub(crate) fn check(
        self,
        path: &Path,
        place: Option<Place>,
        count: u64,
        limit: u64,
    ) -> Result<(), IoError> {
        if count <= limit {
            return Ok(());
        }
        let (what, field) = match self {
            Self::FileBytes => ("bytes", "max_file_bytes"),
            Self::JsonBytes => ("bytes", "max_json_bytes"),
            Self::SmallJsonBytes => ("bytes", "max_small_json_bytes"),
            Self::Vertices => ("vertices", "max_vertices"),
            Self::Triangles => ("triangles", "max_triangles"),
            Self::Rows => ("rows", "max_rows"),
        };
        Err(IoError::Limit {
            path: path.to_owned(),
            place,
            what,
            count,
            limit,
            field,
        })
    }
}

/// Returns the bytes after a UTF-8 byte order mark, if there is one; refuses UTF-16 and UTF-32.
pub(crate) fn text_bytes<'a>(path: &Path, content: &'a [u8]) -> Result<&'a [u8], IoError> {
    let found = match content {
        [0xef, 0xbb, 0xbf, rest @ ..] => return Ok(rest),
        [0, 0, 0xfe, 0xff, ..] => "UTF-32 BE",
        [0xff, 0xfe, 0, 0, ..] => "UTF-32 LE",
        [0xfe, 0xff, ..] => "UTF-16 BE",
        [0xff, 0xfe, ..] => "UTF-16 LE",
        // Without a mark: text of these formats begins with two ASCII characters.
        [0, first, 0, second, ..] if first.is_ascii_graphic() && *second != 0 => "UTF-16 BE",
        [first, 0, second, 0, ..] if first.is_ascii_graphic() && *second != 0 => "UTF-16 LE",
        _ => return Ok(content),
    };
    Err(IoError::Encoding {
        path: path.to_owned(),
        found,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sparse_file_above_the_limit_is_refused_unread() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("huge.obj");
        let file = File::create(&path).unwrap();
        file.set_len(1 << 40).unwrap();
        assert!(matches!(
            read_bytes(&path, 1 << 30),
            Err(IoError::Limit { count, .. }) if count == 1 << 40
        ));
    }

    #[test]
    fn a_file_that_changes_between_opening_and_reading_is_refused() {
        use std::io::Write;
        type Change = fn(&mut File);
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.obj");
        let changes: [(&str, Change); 3] = [
            ("grows", |file| file.write_all(b"f").unwrap()),
            ("shrinks", |file| file.set_len(1).unwrap()),
            ("emptied", |file| file.set_len(0).unwrap()),
        ];
        for (name, change) in changes {
            std::fs::write(&path, "v 0 0 0\n").unwrap();
            let mut source = Source::open(&path).unwrap();
            assert_eq!(source.head().unwrap(), b"v 0 0 0\n");
            let mut file = std::fs::OpenOptions::new()
                .append(true)
                .open(&path)
                .unwrap();
            change(&mut file);
            match source.read(Limited::FileBytes, 100) {
                Err(IoError::Changed { before, after, .. }) => {
                    assert_eq!(before, 8, "{name}");
                    assert_ne!(after, 8, "{name}");
                }
                other => panic!("{name}: {other:?}"),
            }
        }
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_file_of_another_size_than_it_states_is_refused_in_true_words() {
        match read_bytes(Path::new("/proc/self/status"), 100) {
            Err(IoError::Bytes {
                offset: 0,
                found,
                expected,
                ..
            }) => {
                assert_eq!(found, "more bytes");
                assert!(expected.starts_with("a file of 0 bytes"), "{expected}");
            }
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn byte_order_marks() {
        let path = Path::new("x");
        assert_eq!(text_bytes(path, b"\xef\xbb\xbfv").unwrap(), b"v");
        for text in ["", "v", "v 0 0 0", "#\0"] {
            assert_eq!(text_bytes(path, text.as_bytes()).unwrap(), text.as_bytes());
        }
        for (bytes, name) in [
            (&b"\xfe\xff\0v"[..], "UTF-16 BE"),
            (&b"\xff\xfev\0"[..], "UTF-16 LE"),
            (&b"v\0 \x000\0"[..], "UTF-16 LE"),
            (&b"\0v\0 \x000"[..], "UTF-16 BE"),
            (&b"\xff\xfe\0\0"[..], "UTF-32 LE"),
        ] {
            assert!(matches!(
                text_bytes(path, bytes),
                Err(IoError::Encoding { found, .. }) if found == name
            ));
        }
    }
}
