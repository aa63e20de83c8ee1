//! How much a reader takes in before it refuses.

/// How much the readers of this crate take in before they refuse a file with [`IoError::Limit`](crate::IoError::Limit).
///
/// The defaults are above what 6D pose refinement needs by two orders of magnitude, and low enough that a hostile or mistaken
/// file is refused before it exhausts the memory of a usual machine. Raise a field where larger files are meant; every reader of
/// this crate uses the defaults, and the methods of this struct are the same readers with limits of one's own.
///
/// What a file costs at most within the defaults: a mesh file is held once in memory, beside about 60 bytes per vertex and 40
/// per triangle; an image takes four bytes per pixel beside its file; a JSON file about forty times its size.
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
    /// Vertices of a mesh or a point cloud: 10 million. `hicp_core::MAX_MESH_ELEMENTS` holds for meshes whatever stands here.
    pub max_vertices: u64,
    /// Triangles of a mesh: 10 million, after polygons are cut. `hicp_core::MAX_MESH_ELEMENTS` holds whatever stands here.
    pub max_triangles: u64,
    /// Pixels of an image: 2²⁵, four times those of a 4K camera. `hicp_core::MAX_IMAGE_SIDE` holds whatever stands here.
    pub max_pixels: u64,
    /// Rows of a result file or of a study: 10 million.
    pub max_rows: u64,
}

impl ReadLimits {
    /// The limits that the readers use which are not told others.
    pub const DEFAULT: Self = Self {
        max_file_bytes: 1 << 30,
        max_json_bytes: 1 << 28,
        max_small_json_bytes: 1 << 24,
        max_vertices: 10_000_000,
        max_triangles: 10_000_000,
        max_pixels: 1 << 25,
        max_rows: 10_000_000,
    };

    /// No limits but those of `hicp-core` and of memory.
    pub const NONE: Self = Self {
        max_file_bytes: u64::MAX,
        max_json_bytes: u64::MAX,
        max_small_json_bytes: u64::MAX,
        max_vertices: u64::MAX,
        max_triangles: u64::MAX,
        max_pixels: u64::MAX,
        max_rows: u64::MAX,
    };
}

impl Default for ReadLimits {
    fn default() -> Self {
        Self::DEFAULT
    }
}
