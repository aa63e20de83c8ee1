//! Reading and writing of point clouds as PLY files.

use std::path::Path;

use hicp_core::{Point3, UnitVector3, Vector3};

use super::points::PointCloud;
use crate::error::IoError;
use crate::mesh::ply;
use crate::mesh::raw::Reading;
use crate::unit::LengthUnit;

/// Parses the vertices of an ASCII or binary PLY file. Faces and other elements are skipped.
///
/// In a file with normals, so are vertices without one.
pub(super) fn parse(reading: Reading<'_>, content: &[u8]) -> Result<PointCloud, IoError> {
    let unit = reading.unit.units_per_meter();
    let raw = ply::parse_points(reading, content)?;
    let points = raw.vertices.iter().map(|p| (p / unit).cast::<f32>());
    // A file has normals for all vertices or for none.
    if raw.normals.iter().all(|n| n.iter().all(|x| x.is_nan())) {
        return Ok(PointCloud {
            points: points.collect(),
            normals: None,
            n_skipped: 0,
        });
    }
    let normal = |n: &Vector3<f64>| UnitVector3::try_new(n.cast::<f32>(), 1e-6);
    let normals = raw.normals.iter().map(normal);
    let is_finite = |n: &UnitVector3<f32>| n.iter().all(|x| x.is_finite());
    let surfels = points.zip(normals);
    let surfels = surfels.filter_map(|(p, n)| Some((p, n.filter(is_finite)?)));
    let (points, normals): (Vec<_>, _) = surfels.unzip();
    if points.is_empty() {
        let expected = "finite numbers that are not all 0";
        let found = "no vertex with a normal";
        return Err(IoError::new(reading.path, None, found, expected));
    }
    Ok(PointCloud {
        n_skipped: raw.vertices.len() - points.len(),
        points,
        normals: Some(normals),
    })
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
    fn vertices_without_a_normal_are_skipped() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.ply");
        let header = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n\
                      property float z\nproperty float nx\nproperty float ny\nproperty float nz\n\
                      end_header\n";
        let vertices = "0 0 1 0 0 1\n0 0 2 0 1e-7 0\n0 0 3 nan 0 0\n0 0 4 0 2 0\n";
        std::fs::write(&path, format!("{header}{vertices}")).unwrap();
        let cloud = read_cloud(&path, LengthUnit::Meters).unwrap();
        assert_eq!(
            cloud.points,
            [Point3::new(0.0, 0.0, 1.0), Point3::new(0.0, 0.0, 4.0)]
        );
        assert_eq!(
            cloud.normals.unwrap(),
            [Vector3::z_axis(), Vector3::y_axis()]
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
            ("x y z nx ny nz", "0 0 0 0 0 0"),
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
