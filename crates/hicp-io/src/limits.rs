//! How much a reader reads before it refuses a file.

use std::path::Path;

use crate::error::{IoError, IoErrorKind, Place};

/// Limits above which the readers of this crate refuse a file, with an [`IoError`] of the kind [`IoErrorKind::Limit`].
///
/// The defaults are two orders of magnitude above what 6D pose refinement needs. They are low enough that a hostile or
/// mistaken file is refused before it exhausts the memory of a usual machine. Every reader is a method of this struct. The
/// free functions of the same names use the defaults.
///
/// Memory at most within the defaults: a mesh file is held once, next to about 60 bytes per vertex and 40 per triangle; an
/// image takes four bytes per pixel next to its file; a JSON file a few times its size.
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
    /// Bytes of any file but JSON: 1 GiB.
    pub max_file_bytes: u64,
    /// Bytes of a JSON file: 256 MiB.
    pub max_json_bytes: u64,
    /// Bytes of a JSON file that states one thing, such as a pose, a camera or the configuration of a study: 16 MiB.
    pub max_small_json_bytes: u64,
    /// Vertices of a mesh or a point cloud: 10 million. `hicp_core::MAX_MESH_ELEMENTS` always limits meshes, too.
    pub max_vertices: u64,
    /// Triangles of a mesh, after polygons are cut: 10 million. `hicp_core::MAX_MESH_ELEMENTS` always limits them, too.
    pub max_triangles: u64,
    /// Pixels of an image: 2²⁵, four times those of a 4K camera. `hicp_core::MAX_IMAGE_SIDE` always limits them, too.
    pub max_pixels: u64,
    /// Rows of a result file or of a study: 10 million.
    pub max_rows: u64,
}

/// A field of [`ReadLimits`]: its name, which ends in the things that are counted, and its value.
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

    /// No limits except those of `hicp-core` and of memory.
    pub const NONE: Self = Self {
        max_file_bytes: u64::MAX,
        max_json_bytes: u64::MAX,
        max_small_json_bytes: u64::MAX,
        max_vertices: u64::MAX,
        max_triangles: u64::MAX,
        max_pixels: u64::MAX,
        max_rows: u64::MAX,
    };

    /// Refuses the rows of a table if there are more than `max_rows`; `line` is the line of the last row.
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
