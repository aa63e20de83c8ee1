//! Poses in BOP's form: a row-major rotation of nine numbers and a translation in millimeters.

use std::path::Path;

use hicp_core::{
    Isometry3, Matrix3, RotationError, Translation3, UnitQuaternion, rotation_from_matrix,
};
use serde::Deserialize;

use crate::error::IoError;
use crate::json::{self, Numbers};
use crate::limits::{Limit, ReadLimits};

/// Converts a row-major rotation and a translation in millimeters to a pose in meters.
///
/// The rotation of the pose is the one nearest to the nine numbers. A translation that is not
/// finite is returned as it is.
///
/// # Errors
///
/// [`RotationError`] if the nine numbers are further from a rotation than rounding explains.
///
/// ```
/// # fn main() -> Result<(), hicp_core::RotationError> {
/// let pose = hicp_io::pose_from_bop(&[1., 0., 0., 0., 1., 0., 0., 0., 1.], &[0., 0., 800.])?;
/// assert_eq!(pose.translation.z, 0.8);
/// # Ok(()) }
/// ```
pub fn pose_from_bop(
    rotation: &[f64; 9],
    translation_mm: &[f64; 3],
) -> Result<Isometry3<f64>, RotationError> {
    let rotation = rotation_from_matrix(&Matrix3::from_row_slice(rotation))?;
    Ok(pose(rotation, translation_mm))
}

pub(super) fn pose(rotation: UnitQuaternion<f64>, translation_mm: &[f64; 3]) -> Isometry3<f64> {
    let [x, y, z] = translation_mm.map(|mm| mm / 1000.0);
    Isometry3::from_parts(Translation3::new(x, y, z), rotation)
}

/// Converts a pose in meters to a row-major rotation and a translation in millimeters.
#[must_use]
pub fn pose_to_bop(pose: &Isometry3<f64>) -> ([f64; 9], [f64; 3]) {
    let matrix = pose.rotation.to_rotation_matrix().into_inner();
    let mut rotation = [0.0; 9];
    // The columns of the transpose are the rows of the matrix.
    rotation.copy_from_slice(matrix.transpose().as_slice());
    let t = pose.translation.vector * 1000.0;
    (rotation, [t.x, t.y, t.z])
}

/// A rotation of a JSON file, and the original numbers.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(try_from = "Numbers<9>")]
pub(crate) struct Rotation {
    numbers: [f64; 9],
    nearest: UnitQuaternion<f64>,
}

impl Rotation {
    /// Returns a pose in meters with this rotation and a translation in millimeters.
    pub(crate) fn with_translation(&self, translation_mm: &Numbers<3>) -> Isometry3<f64> {
        pose(self.nearest, &translation_mm.0)
    }
}

impl TryFrom<Numbers<9>> for Rotation {
    type Error = String;

    fn try_from(Numbers(numbers): Numbers<9>) -> Result<Self, String> {
        match rotation_from_matrix(&Matrix3::from_row_slice(&numbers)) {
            Ok(nearest) => Ok(Self { numbers, nearest }),
            Err(error) => Err(format!("numbers that are not a rotation: {error}")),
        }
    }
}

/// The content of a pose file: the pose, and the original numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseFile {
    /// The pose, meters. Its rotation is the one nearest to the numbers of the file.
    pub camera_from_object: Isometry3<f64>,
    /// The rotation matrix, row-major.
    ///
    /// These are the numbers of `cam_R_m2c` if the file has the form of [`read_pose_json`] and is
    /// in millimeters. Otherwise it is the matrix of the pose.
    pub rotation: [f64; 9],
    /// The translation, millimeters: the numbers of `cam_t_m2c` if they are in millimeters.
    pub translation_mm: [f64; 3],
}

#[derive(Deserialize)]
struct PoseRecord {
    #[serde(rename = "cam_R_m2c")]
    rotation: Rotation,
    #[serde(rename = "cam_t_m2c")]
    translation_mm: Numbers<3>,
}

/// Reads a pose from a JSON file with `cam_R_m2c` and `cam_t_m2c`.
///
/// `cam_R_m2c` has 9 numbers, row-major; `cam_t_m2c` has 3, in millimeters. Other keys are ignored.
/// As in BOP, the pose is `camera_from_object`.
///
/// # Errors
///
/// [`IoError`] names the JSON key of the fault.
pub fn read_pose_json(path: impl AsRef<Path>) -> Result<PoseFile, IoError> {
    ReadLimits::DEFAULT.read_pose_json(path)
}

impl ReadLimits {
    /// Reads a pose as [`read_pose_json`] does, from a file of at most `max_small_json_bytes`.
    ///
    /// # Errors
    ///
    /// As for [`read_pose_json`].
    pub fn read_pose_json(&self, path: impl AsRef<Path>) -> Result<PoseFile, IoError> {
        let record: PoseRecord = json::read(self, path.as_ref(), Limit::SMALL_JSON_BYTES)?;
        Ok(PoseFile {
            camera_from_object: record.rotation.with_translation(&record.translation_mm),
            rotation: record.rotation.numbers,
            translation_mm: record.translation_mm.0,
        })
    }
}

/// Writes a pose in meters with every digit, in the form that [`read_pose_json`] reads.
///
/// # Errors
///
/// As for [`write_atomically`](crate::write_atomically). Also if a number is not finite, which the
/// source of the error names.
pub fn write_pose_json(path: impl AsRef<Path>, pose: &Isometry3<f64>) -> Result<(), IoError> {
    let (rotation, translation) = pose_to_bop(pose);
    let value = serde_json::json!({ "cam_R_m2c": rotation, "cam_t_m2c": translation });
    json::write(path.as_ref(), &value, false)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Place;
    use hicp_core::{Vector6, se3};
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn poses_survive_writing_and_reading(twist in prop::array::uniform6(-3.0_f64..3.0)) {
            let pose = se3::exp(&Vector6::from(twist));
            let dir = tempfile::tempdir().unwrap();
            let path = dir.path().join("pose.json");
            write_pose_json(&path, &pose).unwrap();
            let (angle, distance) = se3::pose_distance(&read_pose_json(&path).unwrap().camera_from_object, &pose);
            prop_assert!(angle < 1e-14 && distance < 1e-14, "{} {}", angle, distance);
        }
    }

    fn read(text: &str) -> Result<PoseFile, IoError> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("pose.json");
        std::fs::write(&path, text).unwrap();
        read_pose_json(&path)
    }

    #[test]
    fn rotations_are_row_major() {
        // A quarter rotation around z maps x to y.
        let pose = read(r#"{"cam_R_m2c":[0,-1,0, 1,0,0, 0,0,1],"cam_t_m2c":[1,2,3],"score":null}"#);
        let point = pose.unwrap().camera_from_object * hicp_core::Point3::new(1.0, 0.0, 0.0);
        assert!((point - hicp_core::Point3::new(0.001, 1.002, 0.003)).norm() < 1e-12);
    }

    #[test]
    fn the_numbers_of_the_file_are_preserved() {
        // Orthogonal to seven digits only, as in typical files.
        let text = "[0.768311175,-0.0665434694,0.636608126,0.311033385,0.908074697,-0.280461366,-0.559424858,0.413487982,0.718381178]";
        let pose = read(&format!(
            r#"{{"cam_R_m2c":{text},"cam_t_m2c":[0.1,-0.2,1035.65777]}}"#
        ))
        .unwrap();
        assert_eq!(serde_json::to_string(&pose.rotation).unwrap(), text);
        assert_eq!(pose.translation_mm, [0.1, -0.2, 1035.65777]);
    }

    /// Guessing the unit from the size of the numbers would fail for objects that are very near or
    /// far.
    #[test]
    fn translations_of_any_size_are_in_millimeters() {
        for mm in [0.5, 1.0, 99.0, 101.0, 1035.0, 250_000.0] {
            let pose = read(&format!(
                r#"{{"cam_R_m2c":[1,0,0,0,1,0,0,0,1],"cam_t_m2c":[0,0,{mm}]}}"#
            ));
            let z = pose.unwrap().camera_from_object.translation.z;
            assert!((z - mm / 1000.0).abs() < 1e-15 * mm, "{mm}: {z}");
        }
    }

    #[test]
    fn errors_name_the_field() {
        let good = "[1,0,0,0,1,0,0,0,1]";
        for (r, t, key) in [
            ("[1,0,0,0,1,0,0,0]", "[0,0,0]", "$.cam_R_m2c"),
            ("1", "[0,0,0]", "$.cam_R_m2c"),
            (r#"[1,0,0,0,"1",0,0,0,1]"#, "[0,0,0]", "$.cam_R_m2c[4]"),
            (good, "[0,0,0,1]", "$.cam_t_m2c"),
            (good, "null", "$.cam_t_m2c"),
        ] {
            match read(&format!(r#"{{"cam_R_m2c":{r},"cam_t_m2c":{t}}}"#)) {
                Err(IoError {
                    place: Some(Place::Field(found)),
                    ..
                }) => assert_eq!(found, key),
                other => panic!("{other:?}"),
            }
        }
        let null = read(&format!(r#"{{"cam_R_m2c":{good},"cam_t_m2c":null}}"#));
        let text = null.unwrap_err().to_string();
        assert!(
            text.contains("$.cam_t_m2c: found null, expected an array of 3 numbers"),
            "{text}"
        );
        for (rotation, parts) in [
            ("[1,0,0,0,1,0,0,0,-1]", ["determinant -1", "expected 1"]),
            ("[1,0,0,0,1,0,0,0,1.002]", ["not orthogonal", "0.00400"]),
            ("[0,0,0,0,0,0,0,0,0]", ["not orthogonal", " is 1,"]),
        ] {
            let text = format!(r#"{{"cam_R_m2c":{rotation},"cam_t_m2c":[0,0,0]}}"#);
            let text = read(&text).unwrap_err().to_string();
            let field = "$.cam_R_m2c: found numbers that are not a rotation";
            for part in [[field].as_slice(), &parts].concat() {
                assert!(text.contains(part), "no {part:?} in: {text}");
            }
        }
        assert!(matches!(
            read("[1]"),
            Err(IoError {
                place: Some(Place::Field(_)),
                ..
            })
        ));
    }
}
