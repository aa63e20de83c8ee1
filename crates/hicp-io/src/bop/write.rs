//! Writers for the JSON files of a dataset.

use std::collections::BTreeMap;
use std::path::Path;

use hicp_core::Isometry3;
use serde_json::{Map, Value, json};

use super::annotations::{GroundTruth, GroundTruthInfo, SceneCamera};
use super::models_info::ModelInfo;
use super::targets::Target;
use crate::error::IoError;
use crate::json;
use crate::pose::pose_to_bop;

/// Writes a `scene_camera.json`: the cameras of a scene per image.
///
/// Lengths are converted to millimeters. Apart from that, every number is read back exactly. The
/// image size is not written.
///
/// # Errors
///
/// As for [`write_atomically`](crate::write_atomically). Also if a number is not finite, which the
/// source of the error names.
pub fn write_scene_camera(
    path: impl AsRef<Path>,
    cameras: &BTreeMap<u32, SceneCamera>,
) -> Result<(), IoError> {
    write_by_id(path.as_ref(), cameras, |camera| {
        // The columns of the transpose are the rows of the matrix.
        let mut value = json!({ "cam_K": camera.matrix.transpose().as_slice() });
        if let Some(scale) = camera.depth_scale {
            value["depth_scale"] = json!(scale);
        }
        if let Some(pose) = &camera.camera_from_world {
            let (rotation, translation) = pose_to_bop(pose);
            value["cam_R_w2c"] = json!(rotation);
            value["cam_t_w2c"] = json!(translation);
        }
        value
    })
}

/// Writes a `scene_gt.json`: the true poses of a scene's instances per image.
///
/// # Errors
///
/// As for [`write_atomically`](crate::write_atomically). Also if a number is not finite, which the
/// source of the error names.
pub fn write_scene_gt(
    path: impl AsRef<Path>,
    truths: &BTreeMap<u32, Vec<GroundTruth>>,
) -> Result<(), IoError> {
    write_by_id(path.as_ref(), truths, |instances| {
        let one = |truth: &GroundTruth| {
            let (rotation, translation) = pose_to_bop(&truth.camera_from_object);
            json!({ "cam_R_m2c": rotation, "cam_t_m2c": translation, "obj_id": truth.obj_id })
        };
        instances.iter().map(one).collect()
    })
}

/// Writes a `scene_gt_info.json`: the known visibility of a scene's instances per image.
///
/// # Errors
///
/// As for [`write_atomically`](crate::write_atomically). Also if a number is not finite, which the
/// source of the error names.
pub fn write_scene_gt_info(
    path: impl AsRef<Path>,
    infos: &BTreeMap<u32, Vec<GroundTruthInfo>>,
) -> Result<(), IoError> {
    write_by_id(path.as_ref(), infos, |instances| json!(instances))
}

/// Writes a `models_info.json`: diameters and symmetries by object id.
///
/// # Errors
///
/// As for [`write_atomically`](crate::write_atomically). Also if a number is not finite, which the
/// source of the error names.
pub fn write_models_info(
    path: impl AsRef<Path>,
    infos: &BTreeMap<u32, ModelInfo>,
) -> Result<(), IoError> {
    write_by_id(path.as_ref(), infos, |info| {
        let mut value = json!({ "diameter": info.diameter_m * 1000.0 });
        let symmetries = &info.symmetries;
        if !symmetries.discrete.is_empty() {
            let motions = symmetries.discrete.iter().map(matrix);
            value["symmetries_discrete"] = motions.collect();
        }
        if !symmetries.continuous.is_empty() {
            let axes = symmetries.continuous.iter().map(|axis| {
                let offset = axis.offset().coords * 1000.0;
                json!({ "axis": axis.direction().as_slice(), "offset": offset.as_slice() })
            });
            value["symmetries_continuous"] = axes.collect();
        }
        value
    })
}

/// Writes a `test_targets_bop19.json`, in the order of `targets`.
///
/// # Errors
///
/// As for [`write_atomically`](crate::write_atomically).
pub fn write_targets(path: impl AsRef<Path>, targets: &[Target]) -> Result<(), IoError> {
    json::write(path.as_ref(), &json!(targets), true)
}

/// Converts a rigid motion to a row-major 4×4 matrix in millimeters.
fn matrix(motion: &Isometry3<f64>) -> Value {
    let (r, t) = pose_to_bop(motion);
    json!([
        r[0], r[1], r[2], t[0], r[3], r[4], r[5], t[1], r[6], r[7], r[8], t[2], 0.0, 0.0, 0.0, 1.0
    ])
}

fn write_by_id<T>(
    path: &Path,
    entries: &BTreeMap<u32, T>,
    value: impl Fn(&T) -> Value,
) -> Result<(), IoError> {
    let entries = entries.iter();
    let object: Map<String, Value> = entries.map(|(id, x)| (id.to_string(), value(x))).collect();
    json::write(path, &Value::Object(object), true)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bop::{Scene, read_models_info, read_targets};
    use hicp_core::{Matrix3, Point3, Symmetries, SymmetryAxis, Vector3};

    fn near(a: &Isometry3<f64>, b: &Isometry3<f64>) {
        assert!(
            (a.to_homogeneous() - b.to_homogeneous()).amax() < 1e-12,
            "{a} {b}"
        );
    }

    #[test]
    fn a_scene_is_read_back() {
        let dir = tempfile::tempdir().unwrap();
        let pose = Isometry3::new(Vector3::new(0.1, -0.2, 0.7), Vector3::new(0.3, 2.0, -1.0));
        let matrix = Matrix3::new(600.1, 0.0, 320.25, 0.0, 601.3, 239.75, 0.0, 0.0, 1.0);
        let camera = |camera_from_world| SceneCamera {
            matrix,
            image_size: None,
            depth_scale: Some(0.1),
            camera_from_world,
        };
        let cameras = BTreeMap::from([(1, camera(None)), (20, camera(Some(pose)))]);
        let truths = BTreeMap::from([(
            20,
            vec![
                GroundTruth {
                    obj_id: 4,
                    camera_from_object: pose,
                },
                GroundTruth {
                    obj_id: 7,
                    camera_from_object: pose.inverse(),
                },
            ],
        )]);
        let info = GroundTruthInfo {
            visible_fraction: Some(0.625),
            bbox_visible: Some([1.0, 2.0, 30.0, 40.0]),
            ..GroundTruthInfo::default()
        };
        let infos = BTreeMap::from([(20, vec![info, GroundTruthInfo::default()])]);
        write_scene_camera(dir.path().join("scene_camera.json"), &cameras).unwrap();
        write_scene_gt(dir.path().join("scene_gt.json"), &truths).unwrap();
        write_scene_gt_info(dir.path().join("scene_gt_info.json"), &infos).unwrap();

        let scene = Scene::open(dir.path()).unwrap();
        assert_eq!(scene.image_ids().collect::<Vec<_>>(), [1, 20]);
        assert_eq!(scene.camera(1).unwrap(), &cameras[&1]);
        assert_eq!(scene.camera(20).unwrap().matrix, matrix);
        near(&scene.camera(20).unwrap().camera_from_world.unwrap(), &pose);
        let read = scene.ground_truth(20).unwrap();
        assert_eq!(read.iter().map(|t| t.obj_id).collect::<Vec<_>>(), [4, 7]);
        near(&read[0].camera_from_object, &pose);
        near(&read[1].camera_from_object, &pose.inverse());
        assert_eq!(scene.ground_truth_info(20).unwrap(), infos[&20]);
    }

    #[test]
    fn models_and_targets_are_read_back() {
        let dir = tempfile::tempdir().unwrap();
        let half_turn = Isometry3::new(
            Vector3::new(0.01, 0.0, 0.02),
            Vector3::new(0.0, 0.0, std::f64::consts::PI),
        );
        let axis =
            SymmetryAxis::new(Vector3::new(0.0, 0.6, 0.8), Point3::new(0.1, 0.2, 0.3)).unwrap();
        let infos = BTreeMap::from([
            (
                3,
                ModelInfo {
                    diameter_m: 0.125,
                    symmetries: Symmetries {
                        discrete: vec![half_turn],
                        continuous: vec![axis],
                    },
                },
            ),
            (
                11,
                ModelInfo {
                    diameter_m: 0.25,
                    symmetries: Symmetries::default(),
                },
            ),
        ]);
        let path = dir.path().join("models_info.json");
        write_models_info(&path, &infos).unwrap();
        let read = read_models_info(&path).unwrap();
        assert_eq!(read[&11], infos[&11]);
        assert_eq!(read[&3].diameter_m, 0.125);
        near(&read[&3].symmetries.discrete[0], &half_turn);
        let (a, b) = (read[&3].symmetries.continuous[0], axis);
        assert!((a.direction().into_inner() - b.direction().into_inner()).norm() < 1e-12);
        assert!((a.offset() - b.offset()).norm() < 1e-12);

        let targets = [(50, 1, 2), (50, 1, 4), (7, 3, 2)].map(|(scene_id, im_id, obj_id)| Target {
            scene_id,
            im_id,
            obj_id,
            inst_count: 1,
        });
        let path = dir.path().join("test_targets_bop19.json");
        write_targets(&path, &targets).unwrap();
        assert_eq!(read_targets(&path).unwrap(), targets);
    }
}
