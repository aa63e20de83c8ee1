//! What can go wrong with a file.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

use hicp_core::{CameraError, ImageError, MeshError, RotationError, SymmetryError};
use thiserror::Error;

use crate::bop::RleError;

type Source = Box<dyn std::error::Error + Send + Sync>;

/// Where in a file something stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// A line of text, from 1.
    Line(usize),
    /// An offset from the start of the file, bytes.
    Byte(u64),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(line) => write!(f, "line {line}"),
            Self::Byte(offset) => write!(f, "byte {offset}"),
        }
    }
}

/// A file that cannot be read or written: which file, where in it, what was found and what was expected.
///
/// The message does not repeat that of the [source](std::error::Error::source): print the chain.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum IoError {
    /// The file system refused to read.
    #[error("cannot read {}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The file system refused to write.
    #[error("cannot write {}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The folder to write into does not exist.
    #[error("cannot write {}: folder {} does not exist", path.display(), folder.display())]
    MissingFolder {
        /// The file that was to be written.
        path: PathBuf,
        /// The folder that is not there.
        folder: PathBuf,
    },
    /// A part of a dataset is not there.
    #[error("{what} is missing: {} does not exist", path.display())]
    Missing {
        /// Where it was looked for.
        path: PathBuf,
        /// What was looked for.
        what: &'static str,
    },
    /// Something that is no regular file: a folder, or a pipe or device, which need not have an end.
    #[error("{} is {found}, expected a regular file", path.display())]
    NotAFile {
        /// What was to be read.
        path: PathBuf,
        /// What it is.
        found: &'static str,
    },
    /// A file that was written to while it was read.
    #[error(
        "{} changed while it was read, from {before} to {after} bytes: expected a file that nobody writes to",
        path.display()
    )]
    Changed {
        /// The file.
        path: PathBuf,
        /// Its size when it was opened, bytes.
        before: u64,
        /// Its size now, bytes.
        after: u64,
    },
    /// A file that holds more than the reader was told to take in; see [`ReadLimits`](crate::ReadLimits).
    #[error(
        "{}{}: found {count} {what}, expected at most {limit}: raise the limit (--{} N, ReadLimits::{field}) if that is meant",
        path.display(),
        place.map(|place| format!(", {place}")).unwrap_or_default(),
        field.replace('_', "-")
    )]
    Limit {
        /// The file.
        path: PathBuf,
        /// Where the file says so; `None` for its size.
        place: Option<Place>,
        /// What is counted: bytes, vertices, triangles, pixels, rows.
        what: &'static str,
        /// How many there are, at least.
        count: u64,
        /// How many are accepted.
        limit: u64,
        /// The field of [`ReadLimits`](crate::ReadLimits) that raises the limit.
        field: &'static str,
    },
    /// A file name that does not say a format this library knows.
    #[error("{} has the extension {found:?}, expected {expected}", path.display())]
    Extension {
        /// The file.
        path: PathBuf,
        /// Its extension, empty when it has none.
        found: String,
        /// The extensions supported.
        expected: &'static str,
    },
    /// Text that is not encoded as UTF-8.
    #[error("{}, byte 0: found text encoded as {found}, expected UTF-8", path.display())]
    Encoding {
        /// The file.
        path: PathBuf,
        /// The encoding, by its byte order mark.
        found: &'static str,
    },
    /// A line of a text file that does not say what it should.
    #[error("{}, line {line}: found {found}, expected {expected}", path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// What it says, shortened.
        found: String,
        /// What it should say.
        expected: String,
    },
    /// Bytes of a binary file that do not say what they should.
    #[error("{}, byte {offset}: found {found}, expected {expected}", path.display())]
    Bytes {
        /// The file.
        path: PathBuf,
        /// Offset from the start of the file.
        offset: u64,
        /// What is there.
        found: String,
        /// What should be there.
        expected: String,
    },
    /// A header that promises more than the file can hold; refused before anything is allocated.
    #[error(
        "{}, {place}: promises {count} {what}, which take at least {needed} bytes, but {available} bytes are left",
        path.display()
    )]
    Promise {
        /// The file.
        path: PathBuf,
        /// Where it says so.
        place: Place,
        /// What is promised: elements, triangles, pixels.
        what: String,
        /// How many.
        count: u64,
        /// Bytes they take at least.
        needed: u64,
        /// Bytes that are there.
        available: u64,
    },
    /// Something the format allows and this library does not read.
    #[error("{}, {place}: found {found}, expected {expected}", path.display())]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// Where it does.
        place: Place,
        /// What it holds.
        found: String,
        /// What is supported.
        expected: &'static str,
    },
    /// A normal without a direction.
    #[error("{}: vertex {vertex} has the normal ({x}, {y}, {z}), expected finite numbers that are not all 0", path.display())]
    Normal {
        /// The file.
        path: PathBuf,
        /// The vertex, from 0.
        vertex: usize,
        /// x.
        x: f32,
        /// y.
        y: f32,
        /// z.
        z: f32,
    },
    /// A mesh that can be read but not used.
    #[error(
        "{} does not hold a usable mesh{}",
        path.display(),
        match source { MeshError::NoArea { .. } => ", expected a triangle that has an area", _ => "" }
    )]
    Mesh {
        /// The file.
        path: PathBuf,
        /// Why.
        source: MeshError,
    },
    /// A face that names a vertex that is not there.
    #[error(
        "{}, {place}: face {face} uses vertex {index}, expected {} (counted from 0)",
        path.display(),
        match vertices { 0 => "no face, for there are no vertices".to_owned(), n => format!("0 to {}", n - 1) }
    )]
    FaceIndex {
        /// The file.
        path: PathBuf,
        /// Where in it.
        place: Place,
        /// The face, from 0.
        face: usize,
        /// The index it holds.
        index: i64,
        /// Number of vertices.
        vertices: usize,
    },
    /// A PNG file that cannot be decoded or encoded.
    #[error("{} is not a readable PNG image", path.display())]
    Png {
        /// The file.
        path: PathBuf,
        /// Why, in the words of the decoder.
        source: Source,
    },
    /// An image of the wrong pixel type.
    #[error("{} has {found} pixels, expected {expected}", path.display())]
    PixelType {
        /// The file.
        path: PathBuf,
        /// Its pixel type, such as `8-bit palette`.
        found: String,
        /// The pixel type required.
        expected: &'static str,
    },
    /// An image that is too large, by its header.
    #[error(
        "{}, byte 16: {width}x{height} pixels, expected sides of 1 to {max_side} and at most {max_pixels} pixels: raise the limit (--max-pixels N, ReadLimits::max_pixels) if that is meant",
        path.display()
    )]
    ImageTooLarge {
        /// The file.
        path: PathBuf,
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
        /// Longest side accepted.
        max_side: u32,
        /// Largest number of pixels accepted.
        max_pixels: u64,
    },
    /// A depth that sixteen bits cannot hold in the unit asked for.
    #[error(
        "cannot write {}: depth at pixel ({u}, {v}) is {meters} m, expected at most {limit} m at this scale",
        path.display()
    )]
    DepthRange {
        /// The file.
        path: PathBuf,
        /// Column of the pixel.
        u: u32,
        /// Row of the pixel.
        v: u32,
        /// The depth.
        meters: f32,
        /// The largest depth that can be written.
        limit: f64,
    },
    /// A depth scale that is not finite and positive.
    #[error("depth scale for {} is {value} mm per unit, expected a finite number above 0", path.display())]
    DepthScale {
        /// The file it was given for.
        path: PathBuf,
        /// The value.
        value: f64,
    },
    /// Pixels or normals whose number does not fit.
    #[error("cannot write {}: {found} {what} given, expected {expected}", path.display())]
    Count {
        /// The file.
        path: PathBuf,
        /// What is counted.
        what: &'static str,
        /// How many were given.
        found: usize,
        /// How many are needed.
        expected: usize,
    },
    /// Pixels that do not make an image.
    #[error("{} does not hold a usable image", path.display())]
    Image {
        /// The file.
        path: PathBuf,
        /// Why.
        source: ImageError,
    },
    /// Text that is not JSON. Python's `NaN` and `Infinity` are not JSON either.
    #[error("{}, line {line}, column {column}: not valid JSON", path.display())]
    JsonSyntax {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// The column, from 1.
        column: usize,
        /// Why, in the words of the parser.
        source: Source,
    },
    /// A JSON value of the wrong kind, or none at all.
    #[error("{}, {key}: found {found}, expected {expected}", path.display())]
    JsonValue {
        /// The file.
        path: PathBuf,
        /// Path of keys from the root, `$`, to the value.
        key: String,
        /// What is there.
        found: String,
        /// What should be there.
        expected: String,
    },
    /// Numbers that are not a camera.
    #[error("{}, {key}: not a usable camera", path.display())]
    Camera {
        /// The file.
        path: PathBuf,
        /// Path of keys from the root to the camera.
        key: String,
        /// Why.
        source: CameraError,
    },
    /// A camera made for images of another size.
    #[error(
        "{} is a camera for {found_width}x{found_height} images, expected {expected_width}x{expected_height}",
        path.display()
    )]
    CameraSize {
        /// The file.
        path: PathBuf,
        /// Width in the file.
        found_width: u32,
        /// Height in the file.
        found_height: u32,
        /// Width of the image.
        expected_width: u32,
        /// Height of the image.
        expected_height: u32,
    },
    /// Nine numbers that are not a rotation.
    #[error("{}, {place}: not a rotation", path.display())]
    Rotation {
        /// The file.
        path: PathBuf,
        /// Key path, or line and column.
        place: String,
        /// Why.
        source: RotationError,
    },
    /// Numbers that are not a symmetry.
    #[error("{}, {key}: not a symmetry", path.display())]
    Symmetry {
        /// The file.
        path: PathBuf,
        /// Path of keys from the root to the symmetry.
        key: String,
        /// Why.
        source: SymmetryError,
    },
    /// A run-length code that does not describe a mask.
    #[error("{}, {key}: not a usable segmentation", path.display())]
    Segmentation {
        /// The file.
        path: PathBuf,
        /// Path of keys from the root to the segmentation.
        key: String,
        /// Why.
        source: RleError,
    },
    /// A table whose header lacks a column or has it twice.
    #[error("{}, line 1: column {column:?} appears {times} times in {found:?}, expected once", path.display())]
    CsvHeader {
        /// The file.
        path: PathBuf,
        /// The column.
        column: &'static str,
        /// How often the header names it.
        times: usize,
        /// The header.
        found: String,
    },
    /// A table cell that does not hold what its column should.
    #[error("{}, line {line}, column {column:?}: found {found:?}, expected {expected}", path.display())]
    CsvValue {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: u64,
        /// The column, by its name in the header.
        column: &'static str,
        /// The text of the cell, shortened.
        found: String,
        /// What it should hold.
        expected: &'static str,
    },
    /// A table row with more or fewer fields than the header.
    #[error("{}, line {line}: found {found} fields, expected {expected} as in the header", path.display())]
    CsvFields {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: u64,
        /// Fields in the row.
        found: usize,
        /// Fields in the header.
        expected: usize,
    },
}

impl IoError {
    pub(crate) fn read(path: &Path, source: io::Error) -> Self {
        Self::Read {
            path: path.to_owned(),
            source,
        }
    }

    pub(crate) fn write(path: &Path, source: io::Error) -> Self {
        Self::Write {
            path: path.to_owned(),
            source,
        }
    }

    pub(crate) fn mesh(path: &Path, source: MeshError) -> Self {
        Self::Mesh {
            path: path.to_owned(),
            source,
        }
    }

    /// Something wrong at a place; `found` is quoted in text, or [`END_OF_FILE`].
    pub(crate) fn at(path: &Path, place: Place, found: &str, expected: impl Into<String>) -> Self {
        match place {
            Place::Line(line) => Self::line(path, line, found, expected),
            Place::Byte(_) => Self::unquoted(path, place, found, expected),
        }
    }

    /// Something wrong at a place; `found` is not the text that stands there but says what it is.
    pub(crate) fn unquoted(
        path: &Path,
        place: Place,
        found: impl Into<String>,
        expected: impl Into<String>,
    ) -> Self {
        let (path, found, expected) = (path.to_owned(), found.into(), expected.into());
        match place {
            Place::Line(line) => Self::Line {
                path,
                line,
                found,
                expected,
            },
            Place::Byte(offset) => Self::Bytes {
                path,
                offset,
                found,
                expected,
            },
        }
    }

    /// A line of text; `found` is quoted, or [`END_OF_FILE`].
    pub(crate) fn line(path: &Path, line: usize, found: &str, expected: impl Into<String>) -> Self {
        Self::Line {
            path: path.to_owned(),
            line,
            found: match found {
                END_OF_FILE => found.to_owned(),
                _ => quote(found),
            },
            expected: expected.into(),
        }
    }
}

/// What is found where a file ends too early.
pub(crate) const END_OF_FILE: &str = "the end of the file";

/// Returns a text in quotes, shortened so that a broken file does not fill the screen.
pub(crate) fn quote(text: &str) -> String {
    const LIMIT: usize = 60;
    let text = text.trim();
    if text.chars().count() <= LIMIT {
        format!("{text:?}")
    } else {
        let start: String = text.chars().take(LIMIT).collect();
        format!("{start:?}...")
    }
}
