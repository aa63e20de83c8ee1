//! Reading of whole files into memory, within limits.

use std::borrow::Cow;
use std::fs::{File, Metadata};
use std::io::Read;
use std::path::Path;

use crate::error::{IoError, IoErrorKind, Place};
use crate::limits::{Limit, ReadLimits};

/// Returns whether nothing exists at a path.
///
/// If the path cannot be checked, returns `false`; the later read reports the cause. Examples are a
/// network share that does not respond, and a folder without access permission.
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

/// The number of bytes that [`read_head`] reads.
const HEAD_BYTES: u64 = 1 << 16;

/// Opens a regular file and refuses everything else.
///
/// Opening a pipe would wait for its writer, and a device has no end.
fn open(path: &Path) -> Result<(File, Metadata), IoError> {
    let failed = |e| IoError::read(path, e);
    check_regular(path, &std::fs::metadata(path).map_err(failed)?)?;
    let file = File::open(path).map_err(failed)?;
    let metadata = file.metadata().map_err(failed)?;
    Ok((file, metadata))
}

/// Returns an error for anything except a regular file.
pub(crate) fn check_regular(path: &Path, metadata: &Metadata) -> Result<(), IoError> {
    if metadata.is_file() {
        return Ok(());
    }
    let found = match metadata.is_dir() {
        true => "a folder",
        false => "a pipe, a socket or a device",
    };
    Err(IoError::new(path, None, found, "a regular file"))
}

/// Reads the first 64 KiB of a file, or all of a smaller one.
///
/// Also returns the size of the file in bytes.
pub(crate) fn read_head(path: &Path) -> Result<(Vec<u8>, u64), IoError> {
    let (file, metadata) = open(path)?;
    let mut head = Vec::new();
    match file.take(HEAD_BYTES).read_to_end(&mut head) {
        Ok(_) => Ok((head, metadata.len())),
        Err(error) => Err(IoError::read(path, error)),
    }
}

impl ReadLimits {
    /// Reads a whole file.
    ///
    /// Refuses a file that another program changes during the read, because the content could be a
    /// mix of old and new.
    pub(crate) fn read(&self, path: &Path, limit: Limit) -> Result<Vec<u8>, IoError> {
        self.read_opened(path, limit, open(path)?)
    }

    fn read_opened(
        &self,
        path: &Path,
        limit: Limit,
        (mut file, opened): (File, Metadata),
    ) -> Result<Vec<u8>, IoError> {
        let failed = |e| IoError::read(path, e);
        let size = opened.len();
        self.check(limit, path, None, size)?;
        let mut content = Vec::with_capacity(usize::try_from(size).unwrap_or(0));
        // One byte more than the size reveals that the file has grown.
        let mut source = (&mut file).take(size.saturating_add(1));
        source.read_to_end(&mut content).map_err(failed)?;
        let now = file.metadata().map_err(failed)?;
        // Files of /proc state arbitrary sizes. The time shows most changes, except those within a
        // tick of the file system's clock.
        if content.len() as u64 != size || now.modified().ok() != opened.modified().ok() {
            let found = format!(
                "a file of {} bytes that changed while it was read",
                now.len()
            );
            let expected = format!(
                "{size} bytes as when it was opened: the file must not change while it is read"
            );
            return Err(IoError::new(path, None, found, expected));
        }
        Ok(content)
    }

    /// Reads a text file of at most `max_file_bytes`, without its byte order mark.
    ///
    /// # Errors
    ///
    /// [`IoError`] if it is not a regular file, is above the limit, changes during the read, or is
    /// not UTF-8.
    pub fn read_text(&self, path: impl AsRef<Path>) -> Result<String, IoError> {
        self.text(path.as_ref(), Limit::FILE_BYTES)
    }

    /// Reads the text of a JSON file of at most `max_small_json_bytes`, without its byte order
    /// mark.
    ///
    /// # Errors
    ///
    /// As for [`ReadLimits::read_text`].
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
    /// let message = limits.read_small_json_text(&path).unwrap_err().to_string();
    /// assert!(message.contains("--max-small-json-bytes"));
    /// # Ok(()) }
    /// ```
    pub fn read_small_json_text(&self, path: impl AsRef<Path>) -> Result<String, IoError> {
        self.text(path.as_ref(), Limit::SMALL_JSON_BYTES)
    }

    /// Reads the unmodified bytes of a file of at most `max_file_bytes`.
    ///
    /// # Errors
    ///
    /// [`IoError`] if it is not a regular file, is above the limit, or changes during the read.
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
        self.read(path.as_ref(), Limit::FILE_BYTES)
    }

    fn text(&self, path: &Path, limit: Limit) -> Result<String, IoError> {
        let content = self.read(path, limit)?;
        let text = String::from_utf8(text_bytes(path, &content)?.to_owned());
        text.map_err(|error| {
            let place = Place::Byte(error.utf8_error().valid_up_to() as u64);
            IoError::new(path, place, "a byte that is not UTF-8", "text in UTF-8")
        })
    }
}

/// Returns the text after an optional byte order mark.
///
/// Bytes that are not UTF-8, such as in comments, are replaced by U+FFFD.
pub(crate) fn lossy_text<'a>(path: &Path, content: &'a [u8]) -> Result<Cow<'a, str>, IoError> {
    Ok(String::from_utf8_lossy(text_bytes(path, content)?))
}

/// Returns the bytes after an optional UTF-8 byte order mark. Refuses UTF-16 and UTF-32.
pub(crate) fn text_bytes<'a>(path: &Path, content: &'a [u8]) -> Result<&'a [u8], IoError> {
    let encoding = match content {
        [0xef, 0xbb, 0xbf, rest @ ..] => return Ok(rest),
        [0, 0, 0xfe, 0xff, ..] => "UTF-32 BE",
        [0xff, 0xfe, 0, 0, ..] => "UTF-32 LE",
        [0xfe, 0xff, ..] => "UTF-16 BE",
        [0xff, 0xfe, ..] => "UTF-16 LE",
        // Without a mark, text of these formats starts with two ASCII characters.
        [0, first, 0, second, ..] if first.is_ascii_graphic() && *second != 0 => "UTF-16 BE",
        [first, 0, second, 0, ..] if first.is_ascii_graphic() && *second != 0 => "UTF-16 LE",
        _ => return Ok(content),
    };
    let found = format!("text encoded as {encoding}");
    Err(IoError::new(path, Place::Byte(0), found, "UTF-8").with_kind(IoErrorKind::Encoding))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sparse_file_above_the_limit_is_refused_before_reading() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("huge.obj");
        let file = File::create(&path).unwrap();
        file.set_len(1 << 40).unwrap();
        let error = ReadLimits::DEFAULT.read_bytes(&path).unwrap_err();
        assert_eq!(error.kind, IoErrorKind::Limit);
        assert_eq!(error.found, "1099511627776 bytes");
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
            let (head, bytes) = read_head(&path).unwrap();
            assert_eq!((head.as_slice(), bytes), (&b"v 0 0 0\n"[..], 8));
            let opened = open(&path).unwrap();
            let mut file = std::fs::OpenOptions::new()
                .append(true)
                .open(&path)
                .unwrap();
            change(&mut file);
            let read = ReadLimits::DEFAULT.read_opened(&path, Limit::FILE_BYTES, opened);
            let error = read.unwrap_err();
            assert!(
                !error.found.starts_with("a file of 8 bytes"),
                "{name}: {error}"
            );
            assert!(error.expected.starts_with("8 bytes as"), "{name}: {error}");
        }
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_file_with_another_size_than_its_metadata_is_refused() {
        let error = ReadLimits::DEFAULT
            .read_bytes("/proc/self/status")
            .unwrap_err();
        assert!(error.expected.starts_with("0 bytes as"), "{error}");
    }

    #[test]
    fn byte_order_marks_are_recognized() {
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
                Err(IoError { kind: IoErrorKind::Encoding, found, .. }) if found.ends_with(name)
            ));
        }
    }
}
