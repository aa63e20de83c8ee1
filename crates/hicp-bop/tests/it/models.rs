//! Limits for reading folders of models.

use hicp_bop::ModelFolder;
use hicp_io::{IoError, IoErrorKind, LengthUnit, ReadLimits};
use hybrid_icp::core::{Point3, TriMesh};

#[test]
fn diameters_and_models_are_read_within_the_limits() {
    let dir = tempfile::tempdir().unwrap();
    let corners = [
        [0.0, 0.0, 0.0],
        [0.1, 0.0, 0.0],
        [0.1, 0.1, 0.0],
        [0.0, 0.1, 0.0],
    ];
    let corners = corners.map(Point3::from).to_vec();
    let mesh = TriMesh::new(corners, vec![[0, 1, 2], [0, 2, 3]]).unwrap();
    let path = dir.path().join("obj_000001.ply");
    hicp_io::write_ply(path, &mesh, LengthUnit::Millimeters).unwrap();
    let info = r#"{"1": {"diameter": 123.0}}"#;
    let info_path = dir.path().join("models_info.json");
    std::fs::write(&info_path, info).unwrap();
    let open = |limits| ModelFolder::with_info(limits, dir.path(), &info_path);
    let exact = ReadLimits {
        max_json_bytes: info.len() as u64,
        max_triangles: mesh.triangles().len() as u64,
        ..ReadLimits::DEFAULT
    };
    let folder = open(exact).unwrap();
    assert_eq!(folder.read(1).unwrap().unwrap().diameter(), 0.123);
    assert!(folder.read(2).unwrap().is_none());

    let tight = ReadLimits {
        max_json_bytes: exact.max_json_bytes - 1,
        ..exact
    };
    let refused = open(tight).map(|_| ());
    assert!(matches!(
        refused,
        Err(IoError { kind: IoErrorKind::Limit, expected, .. }) if expected.contains("max_json_bytes")
    ));
    let tight = ReadLimits {
        max_triangles: exact.max_triangles - 1,
        ..exact
    };
    let folder = open(tight).unwrap();
    assert!(matches!(
        folder.read(1),
        Err(IoError { kind: IoErrorKind::Limit, expected, .. }) if expected.contains("max_triangles")
    ));
}
