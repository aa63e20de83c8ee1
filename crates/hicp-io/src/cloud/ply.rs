//! Reading and writing of point clouds as PLY files.

use std::path::Path;

use hicp_core::{Point3, UnitVector3};

use super::points::{PointCloud, no_points, normal_of};
use crate::error::IoError;
use crate::mesh::ply;
use crate::mesh::raw::Reading;
use crate::unit::LengthUnit;

/// Parses the vertices of an ASCII or binary PLY file. Faces and other elements are skipped.
pub(super) fn parse(reading: Reading<'_>, content: &[u8]) -> Result<PointCloud, IoError> {
    let unit = reading.unit.units_per_meter();
    let raw = ply::parse_points(reading, content)?;
    if raw.vertices.is_empty() && raw.n_skipped > 0 {
        return Err(no_points(reading.path));
    }
    let points = raw.vertices.iter().map(|p| (p / unit).cast::<f32>());
    let normals = raw.normals.iter().map(|normal| normal_of((*normal).into()));
    let points: Vec<_> = points.zip(normals).collect();
    Ok(PointCloud::of(&points, raw.n_skipped))
}

/// Writes a point cloud as binary little-endian PLY, in meters.
///
/// # Errors
///
/// [`IoError`] if there is not one normal per point; otherwise as for
/// [`write_atomically`](crate::write_atomically).
pub fn write_point_cloud_ply(
    path: impl AsRef<Path>,
    points: &[Point3<f32>],
    normals: Option<&[UnitVector3<f32>]>,
) -> Result<(), IoError> {
    let path = path.as_ref();
    if let Some(normals) = normals
        && normals.len() != points.len()
    {
        let found = format!("{} normals", normals.len());
        let expected = format!("{}, one per point", points.len());
        return Err(IoError::new(path, None, found, expected));
    }
    let positions = points.iter().map(|p| [p.x, p.y, p.z]);
    let Some(normals) = normals else {
        return ply::write(path, LengthUnit::Meters, positions, None);
    };
    let with_normals = positions
        .zip(normals)
        .map(|([x, y, z], n)| [x, y, z, n.x, n.y, n.z]);
    ply::write(path, LengthUnit::Meters, with_normals, None)
}

#[cfg(test)]
mod tests {
    use super::*;
    use hicp_core::Vector3;

    use crate::read_cloud;

    #[test]
    fn clouds_survive_writing_and_reading() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.ply");
        let points = [Point3::new(0.1, -0.2, 0.3), Point3::new(1.0, 2.0, 3.0)];
        let normals = [
            Vector3::x_axis(),
            UnitVector3::new_normalize(Vector3::new(1.0, 1.0, 0.0)),
        ];
        for normals in [None, Some(&normals[..])] {
            write_point_cloud_ply(&path, &points, normals).unwrap();
            let cloud = read_cloud(&path, LengthUnit::Meters).unwrap();
            assert_eq!(cloud.points, points);
            match (cloud.normals, normals) {
                (None, None) => {}
                (Some(read), Some(written)) => {
                    for (a, b) in read.iter().zip(written) {
                        assert!((a.into_inner() - b.into_inner()).norm() < 1e-6);
                    }
                }
                other => panic!("{other:?}"),
            }
        }
        write_point_cloud_ply(&path, &[], None).unwrap();
        assert!(
            read_cloud(&path, LengthUnit::Meters)
                .unwrap()
                .points
                .is_empty()
        );
    }

    /// Meshes of scans have normals of length 0 where triangles are degenerate.
    #[test]
    fn vertices_without_a_normal_or_a_position_are_skipped() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.ply");
        let header = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n\
                      property float z\nproperty float nx\nproperty float ny\nproperty float nz\n\
                      end_header\n";
        let read = |vertices: &str| {
            std::fs::write(&path, format!("{header}{vertices}")).unwrap();
            read_cloud(&path, LengthUnit::Meters).unwrap()
        };
        let cloud = read("0 0 1 0 0 1\n0 0 2 0 1e-7 0\n0 0 3 nan 0 0\n0 0 4 0 2 0\n");
        assert_eq!(
            cloud.points,
            [Point3::new(0.0, 0.0, 1.0), Point3::new(0.0, 0.0, 4.0)]
        );
        assert_eq!(
            cloud.normals.unwrap(),
            [Vector3::z_axis(), Vector3::y_axis()]
        );
        assert_eq!(cloud.n_skipped, 2);
        // If no vertex has a normal, none is needed. One without a position is skipped.
        let cloud = read("0 0 1 0 0 0\n0 0 2 nan nan nan\n0 inf 3 0 0 0\nnan 0 4 0 0 0\n");
        assert_eq!(
            (cloud.points.len(), cloud.normals, cloud.n_skipped),
            (2, None, 2)
        );
    }

    #[test]
    fn invalid_clouds_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.ply");
        assert!(matches!(
            write_point_cloud_ply(&path, &[Point3::origin()], Some(&[])),
            Err(IoError { found, expected, .. })
                if found == "0 normals" && expected == "1, one per point"
        ));
        for (names, body) in [
            ("x y z", "0 nan 0"),
            // The same file is readable as a mesh, which has no normals.
            ("x y z nx ny nz", "0 0 0 0 0 -nan(ind)"),
        ] {
            let properties: String = names
                .split(' ')
                .map(|name| format!("property float {name}\n"))
                .collect();
            let text = format!(
                "ply\nformat ascii 1.0\nelement vertex 1\n{properties}end_header\n{body}\n"
            );
            std::fs::write(&path, text).unwrap();
            let error = read_cloud(&path, LengthUnit::Meters).unwrap_err();
            let expected = ["finite coordinates", "finite numbers", "as a number"];
            assert!(
                expected.iter().any(|text| error.expected.contains(text)),
                "{error}"
            );
        }
    }
}
