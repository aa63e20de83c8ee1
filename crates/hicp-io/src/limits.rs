//! Limits on the amount of data that a reader accepts.

use std::path::Path;

use crate::error::{IoError, IoErrorKind, Place};

/// Limits above which the readers of this crate refuse a file.
///
/// The error is an [`IoError`] of the kind [`IoErrorKind::Limit`]. The defaults are two orders of
/// magnitude above the needs of 6D pose refinement. They are low enough to refuse a malicious or
/// damaged file before it exhausts the memory of a typical computer.
///
/// Every reader is a method of this struct. The free functions of the same names use the defaults.
///
/// Memory within the defaults:
///
/// - A mesh needs the size of its file, plus about 60 bytes per vertex and 40 bytes per triangle.
/// - An image needs the size of its file, plus 2 to 16 bytes per sample of its pixels.
/// - A JSON file needs up to several dozen times its size.
///
/// ```
/// use hicp_io::{LengthUnit, ReadLimits};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let dir = tempfile::tempdir()?;
/// # let path = dir.path().join("part.obj");
/// std::fs::write(&path, "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n")?;
/// let mut limits = ReadLimits::default();
/// assert_eq!(limits.read_mesh(&path, LengthUnit::Meters)?.triangles().len(), 2);
/// limits.max_triangles = 1;
/// let error = limits.read_mesh(&path, LengthUnit::Meters).unwrap_err();
/// assert!(error.to_string().contains("expected at most 1"));
/// # Ok(()) }
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReadLimits {
    /// Maximum size in bytes of any file for which there is no other limit: 1 GiB.
    pub max_file_bytes: u64,
    /// Maximum size in bytes of a JSON file: 256 MiB.
    pub max_json_bytes: u64,
    /// Maximum size in bytes of a file with a single item: 16 MiB.
    ///
    /// It applies to poses and cameras in any format, and to the configuration of a study.
    pub max_small_json_bytes: u64,
    /// Maximum number of vertices of a mesh or a point cloud: 10 million. Meshes are always limited
    /// by `hicp_core::MAX_MESH_ELEMENTS`, too.
    pub max_vertices: u64,
    /// Maximum number of triangles of a mesh, after triangulation of polygons: 10 million. They are
    /// always limited by `hicp_core::MAX_MESH_ELEMENTS`, too.
    pub max_triangles: u64,
    /// Maximum number of pixels of an image: 2²⁵, four times the pixels of a 4K camera. The sides
    /// are always limited by `hicp_core::MAX_IMAGE_SIDE`, too.
    pub max_pixels: u64,
    /// Maximum number of rows of a result file or of a study: 10 million.
    pub max_rows: u64,
}

/// A field of [`ReadLimits`]: its name and its value. The name ends with the unit of the count.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limit(&'static str, fn(&ReadLimits) -> u64);

impl Limit {
    pub(crate) const FILE_BYTES: Self = Self("max_file_bytes", |l| l.max_file_bytes);
    pub(crate) const JSON_BYTES: Self = Self("max_json_bytes", |l| l.max_json_bytes);
    pub(crate) const SMALL_JSON_BYTES: Self =
        Self("max_small_json_bytes", |l| l.max_small_json_bytes);
    pub(crate) const VERTICES: Self = Self("max_vertices", |l| l.max_vertices);
    pub(crate) const TRIANGLES: Self = Self("max_triangles", |l| l.max_triangles);
    pub(crate) const PIXELS: Self = Self("max_pixels", |l| l.max_pixels);
    pub(crate) const ROWS: Self = Self("max_rows", |l| l.max_rows);
}

impl ReadLimits {
    /// The default limits.
    pub const DEFAULT: Self = Self {
        max_file_bytes: 1 << 30,
        max_json_bytes: 1 << 28,
        max_small_json_bytes: 1 << 24,
        max_vertices: 10_000_000,
        max_triangles: 10_000_000,
        max_pixels: 1 << 25,
        max_rows: 10_000_000,
    };

    /// No limits except those of `hicp-core` and the available memory.
    pub const NONE: Self = Self {
        max_file_bytes: u64::MAX,
        max_json_bytes: u64::MAX,
        max_small_json_bytes: u64::MAX,
        max_vertices: u64::MAX,
        max_triangles: u64::MAX,
        max_pixels: u64::MAX,
        max_rows: u64::MAX,
    };

    /// Returns an error if a table has more than `max_rows` rows. `line` is the line of the last
    /// row.
    ///
    /// # Errors
    ///
    /// [`IoError`] that names the limit.
    pub fn check_rows(&self, path: &Path, line: usize, rows: u64) -> Result<(), IoError> {
        self.check(Limit::ROWS, path, Place::Line(line), rows)
    }

    pub(crate) fn check(
        &self,
        Limit(field, value): Limit,
        path: &Path,
        place: impl Into<Option<Place>>,
        count: u64,
    ) -> Result<(), IoError> {
        let most = value(self);
        if count <= most {
            return Ok(());
        }
        let option = field.replace('_', "-");
        let what = field.rsplit('_').next().unwrap_or_default();
        let expected = format!(
            "at most {most} {what}: raise the limit (--{option} N, ReadLimits::{field}) if that is meant"
        );
        Err(
            IoError::new(path, place, format!("{count} {what}"), expected)
                .with_kind(IoErrorKind::Limit),
        )
    }
}

impl Default for ReadLimits {
    fn default() -> Self {
        Self::DEFAULT
    }
}
