//! Reading of point clouds of any format.

use std::path::Path;

use super::points::PointCloud;
use super::{pcd, ply, table};
use crate::error::IoError;
use crate::format::{self, Format};
use crate::limits::ReadLimits;
use crate::mesh::raw::Reading;
use crate::unit::LengthUnit;

const EXPECTED: &str = "a point cloud as PLY, PCD, XYZ, CSV or NPY";

/// Reads a point cloud, recognized by its first bytes.
///
/// - PLY: the vertices of text and binary files. Normals are read if the vertices have `nx`, `ny`
///   and `nz`, and are normalized. Faces and other elements are skipped.
/// - PCD: text, binary and compressed, with `x`, `y`, `z` and, if there, `normal_x`, `normal_y` and
///   `normal_z`. The viewpoint is not applied.
/// - Text (XYZ, CSV, PTS): one point per line, separated by white space, commas or semicolons. The
///   names of the columns may come first. An empty cell means NaN.
/// - NPY and NPZ: an array whose last axis has the coordinates. Of several arrays, `points` is
///   read, or else `xyz`, `positions`, `cloud` or `arr_0`.
///
/// Columns 4 to 6 without names are normals if all of them have length 1. Points that are not
/// finite are skipped, because sensors write them for pixels without a measurement. If some points
/// have a normal, those without one, such as (0, 0, 0), are skipped, too.
///
/// # Errors
///
/// [`IoError`] names the file and the place of the fault: a malformed or truncated file, more
/// points than [`ReadLimits::DEFAULT`] allows or than the file holds, a coordinate beyond
/// `hicp_core::MAX_COORDINATE_METERS`, or no points (except for a PLY file that announces none).
pub fn read_cloud(path: impl AsRef<Path>, unit: LengthUnit) -> Result<PointCloud, IoError> {
    ReadLimits::DEFAULT.read_cloud(path, unit)
}

impl ReadLimits {
    /// Reads a point cloud as [`read_cloud`] does, within these limits.
    ///
    /// # Errors
    ///
    /// As for [`read_cloud`].
    pub fn read_cloud(
        &self,
        path: impl AsRef<Path>,
        unit: LengthUnit,
    ) -> Result<PointCloud, IoError> {
        let path = path.as_ref();
        let content = self.read_bytes(path)?;
        let reading = Reading {
            path,
            unit,
            limits: self,
            with_color: false,
        };
        match Format::of(&content) {
            Some(Format::Ply) => ply::parse(reading, &content),
            Some(Format::Pcd) => pcd::parse(reading, &content),
            #[cfg(feature = "npy")]
            Some(Format::Npy | Format::Npz) => table::parse_npy(reading, &content),
            None if std::str::from_utf8(&content).is_ok() => {
                table::parse_text(reading, &String::from_utf8_lossy(&content))
            }
            _ => Err(format::refuse(path, &content, EXPECTED)),
        }
    }
}
