//! The error of all readers and writers.

use std::error::Error;
use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

/// A place in a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Place {
    /// A line of text, from 1.
    Line(usize),
    /// An offset from the start of the file, bytes.
    Byte(u64),
    /// A named field: a path of JSON keys from the root `$`, or a line and a column.
    Field(String),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(line) => write!(f, "line {line}"),
            Self::Byte(offset) => write!(f, "byte {offset}"),
            Self::Field(name) => f.write_str(name),
        }
    }
}

/// The group of an error, for callers that handle some groups differently.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum IoErrorKind {
    /// The system refused to read the file; the source states the reason.
    Read,
    /// The file cannot be written; the source states the reason.
    Write,
    /// A part of a dataset does not exist.
    Missing,
    /// The text is not encoded as UTF-8.
    Encoding,
    /// The file holds more than [`ReadLimits`](crate::ReadLimits) allow.
    Limit,
    /// The camera is for images of another size.
    CameraSize,
    /// The content does not meet the requirements of the format or of its use here.
    Content,
}

/// The error of all readers and writers: the file, the place, the value found and the value
/// expected.
///
/// The message does not repeat the message of the [source](Error::source), so print the whole
/// chain.
#[derive(Debug)]
#[non_exhaustive]
pub struct IoError {
    /// The group of the error.
    pub kind: IoErrorKind,
    /// The file.
    pub path: PathBuf,
    /// The place in the file; `None` if the error concerns the whole file.
    pub place: Option<Place>,
    /// The value found, shortened.
    pub found: String,
    /// The value expected. Empty for [`IoErrorKind::Read`] and [`IoErrorKind::Write`].
    pub expected: String,
    source: Option<Box<dyn Error + Send + Sync>>,
}

impl IoError {
    /// Creates an error about the content of a file.
    pub fn new(
        path: impl Into<PathBuf>,
        place: impl Into<Option<Place>>,
        found: impl Into<String>,
        expected: impl Into<String>,
    ) -> Self {
        Self {
            kind: IoErrorKind::Content,
            path: path.into(),
            place: place.into(),
            found: found.into(),
            expected: expected.into(),
            source: None,
        }
    }

    pub(crate) fn with_kind(self, kind: IoErrorKind) -> Self {
        Self { kind, ..self }
    }

    pub(crate) fn with_source(self, source: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        let source = Some(source.into());
        Self { source, ..self }
    }

    pub(crate) fn read(path: &Path, source: io::Error) -> Self {
        let error = Self::new(path, None, "", "").with_source(source);
        error.with_kind(IoErrorKind::Read)
    }

    pub(crate) fn write(path: &Path, source: io::Error) -> Self {
        Self::read(path, source).with_kind(IoErrorKind::Write)
    }

    /// Creates an error about values in a file that `hicp-core` refuses.
    pub(crate) fn unusable(
        path: &Path,
        what: &str,
        source: impl Into<Box<dyn Error + Send + Sync>>,
    ) -> Self {
        let (found, expected) = (format!("no usable {what}"), format!("a {what}"));
        Self::new(path, None, found, expected).with_source(source)
    }

    /// Returns an error if a header announces more data than the file can hold.
    ///
    /// Readers call this before they allocate memory for the data.
    pub(crate) fn check_promise(
        path: &Path,
        place: Place,
        (count, what): (u64, &str),
        needed: u64,
        available: u64,
    ) -> Result<(), Self> {
        if needed <= available {
            return Ok(());
        }
        let found =
            format!("a header that promises {count} {what}, which take at least {needed} bytes");
        let expected = format!("no more than the {available} bytes that are left");
        Err(Self::new(path, place, found, expected))
    }

    pub(crate) fn missing(path: PathBuf, what: &str) -> Self {
        Self::new(path, None, "nothing", what).with_kind(IoErrorKind::Missing)
    }
}

impl fmt::Display for IoError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // A line break in a name would start another message.
        let path = self.path.display().to_string().replace(['\n', '\r'], "\\n");
        let (found, expected) = (&self.found, &self.expected);
        match (self.kind, &self.place) {
            (IoErrorKind::Read, _) => write!(f, "cannot read {path}"),
            (IoErrorKind::Write, _) => write!(f, "cannot write {path}"),
            (IoErrorKind::Missing, _) => {
                write!(f, "{expected} is missing: {path} does not exist")
            }
            (_, Some(place)) => write!(f, "{path}, {place}: found {found}, expected {expected}"),
            (_, None) => write!(f, "{path}: found {found}, expected {expected}"),
        }
    }
}

impl Error for IoError {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        self.source.as_deref().map(|source| source as _)
    }
}

/// The text for the value found if a file ends too early.
pub(crate) const END_OF_FILE: &str = "the end of the file";

/// Quotes a text and shortens it, so that a broken file does not fill the screen.
pub(crate) fn quote(text: &str) -> String {
    const LIMIT: usize = 60;
    let text = text.trim();
    match text.char_indices().nth(LIMIT) {
        None => format!("{text:?}"),
        Some((end, _)) => format!("{:?}...", &text[..end]),
    }
}
