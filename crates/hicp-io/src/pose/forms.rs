//! Poses as matrices, quaternions and TUM lines.

use std::f64::consts::TAU;
use std::path::Path;

use hicp_core::{Matrix3, Quaternion, UnitQuaternion, Vector3, rotation_from_matrix};
use serde_json::Value;

use super::bop::{PoseFile, pose, pose_to_bop};
use crate::document::{self, numbers};
use crate::error::{IoError, Place, quote};
use crate::limits::ReadLimits;
use crate::unit::LengthUnit;

/// The supported forms, for messages.
const EXPECTED: &str = "`cam_R_m2c` and `cam_t_m2c`, a 4x4 matrix, R and t, t and rvec or a quaternion of stated \
                        order (quaternion_xyzw or quaternion_wxyz), or a TUM line (t x y z qx qy qz qw)";

/// Reads a pose in any common form, as JSON, YAML, XML, text, NPY or NPZ.
///
/// - BOP's JSON, as [`read_pose_json`](crate::read_pose_json) reads it. Its translation is in millimeters.
/// - A 4×4 or 3×4 matrix, by rows, also as the member `matrix`, `T` or `T_co` of an object.
/// - An object with a rotation (`R`, `rotation`, `cam_R_m2c`: 3×3) and a translation (`t`,
///   `translation`, `position`, `cam_t_m2c`).
/// - An object with a translation and a quaternion: `quaternion_xyzw`, `quaternion_wxyz`, or
///   `quaternion`, `orientation` or `rotation` with the members x, y, z and w.
/// - An object with a translation and `rvec`, a rotation vector in radians as in OpenCV.
/// - A pose or one transform of ROS, such as a `TFMessage` with one entry.
/// - A TUM line of text: the time, if any, then x, y, z, qx, qy, qz, qw.
///
/// `unit` is the unit of the translation. `None` means millimeters for `cam_t_m2c` and meters for
/// all other forms. The pose must be `camera_from_object`.
///
/// # Errors
///
/// [`IoError`] names the key of the fault, or the supported forms.
pub fn read_pose(path: impl AsRef<Path>, unit: Option<LengthUnit>) -> Result<PoseFile, IoError> {
    ReadLimits::DEFAULT.read_pose(path, unit)
}

impl ReadLimits {
    /// Reads a pose as [`read_pose`] does, from a file of at most `max_small_json_bytes`.
    ///
    /// # Errors
    ///
    /// As for [`read_pose`].
    pub fn read_pose(
        &self,
        path: impl AsRef<Path>,
        unit: Option<LengthUnit>,
    ) -> Result<PoseFile, IoError> {
        let path = path.as_ref();
        let (root, is_json) = document::read(self, path, EXPECTED)?;
        let is_bop = root
            .get("cam_R_m2c")
            .is_some_and(|r| r.get(0).is_none_or(Value::is_number));
        if is_json && is_bop && unit.is_none_or(|unit| unit == LengthUnit::Millimeters) {
            return self.read_pose_json(path);
        }
        let refuse = |found: String, expected: &str| {
            IoError::new(path, Place::Field("$".to_owned()), found, expected)
        };
        let form = form(&root).ok_or_else(|| refuse(describe(&root), EXPECTED))?;
        let (rotation, translation) = form.map_err(|found| refuse(found, "a rotation"))?;
        let default = match root.get("cam_t_m2c") {
            Some(_) => LengthUnit::Millimeters,
            None => LengthUnit::Meters,
        };
        let millimeters = 1000.0 * unit.unwrap_or(default).meters_per_unit();
        let translation_mm = translation.map(|x| x * millimeters);
        let camera_from_object = pose(rotation, &translation_mm);
        let (rotation, _) = pose_to_bop(&camera_from_object);
        Ok(PoseFile {
            camera_from_object,
            rotation,
            translation_mm,
        })
    }
}

type Parts = (UnitQuaternion<f64>, [f64; 3]);

/// Returns the rotation and the translation of a supported form, or what is wrong with them.
fn form(root: &Value) -> Option<Result<Parts, String>> {
    let member = |keys: &[&str]| keys.iter().find_map(|key| root.get(*key));
    if let Some(matrix) = member(&["matrix", "transform", "pose", "T", "T_co", "transformation"]) {
        return form(matrix);
    }
    // A message of ROS has a list.
    if let Some([only]) = member(&["transforms"])
        .and_then(Value::as_array)
        .map(Vec::as_slice)
    {
        return form(only);
    }
    if root.is_array() || root.get("data").is_some() {
        return match numbers(root)?[..] {
            [a, b, c, x, d, e, f, y, g, h, i, z]
            | [a, b, c, x, d, e, f, y, g, h, i, z, 0.0, 0.0, 0.0, 1.0] => {
                Some(turned([a, b, c, d, e, f, g, h, i]).map(|turned| (turned, [x, y, z])))
            }
            [x, y, z, qx, qy, qz, qw] | [_, x, y, z, qx, qy, qz, qw] => {
                Some(quaternion([qx, qy, qz, qw]).map(|turned| (turned, [x, y, z])))
            }
            _ => None,
        };
    }
    let xyz = |value: &Value| -> Option<[f64; 3]> {
        let named = || {
            ["x", "y", "z"]
                .map(|key| value.get(key)?.as_f64())
                .into_iter()
                .collect()
        };
        numbers(value).or_else(named)?.try_into().ok()
    };
    let translation = xyz(member(&[
        "cam_t_m2c",
        "t",
        "translation",
        "position",
        "tvec",
    ])?)?;
    let four = |value: &Value| -> Option<[f64; 4]> { numbers(value)?.try_into().ok() };
    let turned = if let Some(xyzw) = member(&["quaternion_xyzw", "quat_xyzw"]) {
        quaternion(four(xyzw)?)
    } else if let Some(wxyz) = member(&["quaternion_wxyz", "quat_wxyz"]) {
        let [w, x, y, z] = four(wxyz)?;
        quaternion([x, y, z, w])
    } else if let Some(rvec) = member(&["rvec"]) {
        let rvec = Vector3::from(xyz(rvec)?);
        match rvec.norm() <= TAU {
            true => Ok(UnitQuaternion::from_scaled_axis(rvec)),
            false => Err(format!(
                "an rvec of the length {}, which must be in radians",
                rvec.norm()
            )),
        }
    } else {
        let keys = ["cam_R_m2c", "R", "rotation", "orientation", "quaternion"];
        let value = member(&keys)?;
        let named: Option<Vec<f64>> = ["x", "y", "z", "w"]
            .iter()
            .map(|key| value.get(*key)?.as_f64())
            .collect();
        match (named, numbers(value)) {
            (Some(xyzw), _) => quaternion(xyzw.try_into().ok()?),
            (None, Some(matrix)) => turned(matrix.try_into().ok()?),
            (None, None) => return None,
        }
    };
    Some(turned.map(|turned| (turned, translation)))
}

fn turned(matrix: [f64; 9]) -> Result<UnitQuaternion<f64>, String> {
    let nearest = rotation_from_matrix(&Matrix3::from_row_slice(&matrix));
    nearest.map_err(|error| format!("numbers that are not a rotation: {error}"))
}

fn quaternion([x, y, z, w]: [f64; 4]) -> Result<UnitQuaternion<f64>, String> {
    let quaternion = Quaternion::new(w, x, y, z);
    let norm = quaternion.norm();
    match (norm - 1.0).abs() < 1e-2 {
        true => Ok(UnitQuaternion::from_quaternion(quaternion)),
        false => Err(format!(
            "a quaternion of the length {norm}, which must be 1"
        )),
    }
}

/// Describes a value that is not a pose.
fn describe(value: &Value) -> String {
    match (value, numbers(value)) {
        (Value::Object(members), _) => {
            let keys: Vec<_> = members.keys().take(8).map(|key| quote(key)).collect();
            format!("the keys {}", keys.join(", "))
        }
        (_, Some(numbers)) if numbers.len() == 16 => {
            let row = numbers[12..].iter().map(f64::to_string);
            let row = row.collect::<Vec<_>>().join(" ");
            let column = [3, 7, 11, 15].map(|index| numbers[index]);
            let hint = if column == [0.0, 0.0, 0.0, 1.0] {
                ", as if it were transposed"
            } else {
                ""
            };
            format!("a 4x4 matrix with the last row {row} instead of 0 0 0 1{hint}")
        }
        (_, Some(numbers)) => format!("{} numbers", numbers.len()),
        (Value::Array(items), None) if items.iter().all(Value::is_object) => {
            format!("a list of {} objects, of which a file has one", items.len())
        }
        (value, None) => quote(&value.to_string().chars().take(80).collect::<String>()),
    }
}
