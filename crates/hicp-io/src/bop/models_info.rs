//! Diameters and symmetries of a dataset's objects.

use std::collections::BTreeMap;
use std::path::Path;

use hicp_core::{Isometry3, MAX_SYMMETRY_MOTIONS, Point3, Symmetries, SymmetryAxis, Vector3};
use serde::Deserialize;

use crate::error::IoError;
use crate::json::{self, ById, Numbers, Positive};
use crate::limits::{Limit, ReadLimits};
use crate::pose::Rotation;

/// The diameter and the symmetries of an object, as its dataset states them.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(try_from = "Record")]
pub struct ModelInfo {
    /// Largest distance between two of its vertices, meters.
    pub diameter_m: f64,
    /// Its symmetries in the model frame, meters.
    pub symmetries: Symmetries,
}

#[derive(Deserialize)]
struct Record {
    diameter: Positive,
    symmetries_discrete: Option<Vec<Motion>>,
    symmetries_continuous: Option<Vec<Axis>>,
}

impl TryFrom<Record> for ModelInfo {
    type Error = String;

    fn try_from(record: Record) -> Result<Self, String> {
        let discrete = record.symmetries_discrete.unwrap_or_default();
        let continuous = record.symmetries_continuous.unwrap_or_default();
        let symmetries = Symmetries {
            discrete: discrete.into_iter().map(|Motion(motion)| motion).collect(),
            continuous: continuous.into_iter().map(|Axis(axis)| axis).collect(),
        };
        // Error measures expand the symmetries: two lists of ten thousand would need terabytes.
        let motions = symmetries.n_motions();
        if motions > MAX_SYMMETRY_MOTIONS {
            return Err(format!(
                "{} discrete and {} continuous symmetries, which make {motions} motions, expected at most {MAX_SYMMETRY_MOTIONS}",
                symmetries.discrete.len(),
                symmetries.continuous.len()
            ));
        }
        let diameter_m = record.diameter.0 / 1000.0;
        Ok(Self {
            diameter_m,
            symmetries,
        })
    }
}

/// A rigid motion. In JSON, it is a row-major 4×4 matrix in millimeters.
#[derive(Deserialize)]
#[serde(try_from = "Numbers<16>")]
struct Motion(Isometry3<f64>);

impl TryFrom<Numbers<16>> for Motion {
    type Error = String;

    fn try_from(Numbers(m): Numbers<16>) -> Result<Self, String> {
        if m[12..] != [0.0, 0.0, 0.0, 1.0] {
            let row = &m[12..];
            return Err(format!(
                "a matrix with the last row {row:?}, expected the last row 0, 0, 0, 1 of a rigid motion"
            ));
        }
        let rotation = [m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]];
        let translation_mm = Numbers([m[3], m[7], m[11]]);
        let rotation = Rotation::try_from(Numbers(rotation))?;
        Ok(Self(rotation.with_translation(&translation_mm)))
    }
}

#[derive(Deserialize)]
#[serde(try_from = "AxisRecord")]
struct Axis(SymmetryAxis);

#[derive(Deserialize)]
struct AxisRecord {
    axis: Numbers<3>,
    offset: Numbers<3>,
}

impl TryFrom<AxisRecord> for Axis {
    type Error = String;

    fn try_from(record: AxisRecord) -> Result<Self, String> {
        let (axis, offset) = (Vector3::from(record.axis.0), Point3::from(record.offset.0));
        let axis = SymmetryAxis::new(axis, offset / 1000.0);
        axis.map(Self)
            .map_err(|e| format!("numbers that are not a symmetry: {e}"))
    }
}

/// Reads a `models_info.json`: diameters and symmetries by object id.
///
/// # Errors
///
/// [`IoError`] names the JSON key of the fault, also if a symmetry is not a rigid motion, or if the
/// symmetries of an object expand to more than `hicp_core::MAX_SYMMETRY_MOTIONS` motions.
pub fn read_models_info(path: impl AsRef<Path>) -> Result<BTreeMap<u32, ModelInfo>, IoError> {
    ReadLimits::DEFAULT.read_models_info(path)
}

impl ReadLimits {
    /// Reads a file as [`read_models_info`] does, within these limits.
    ///
    /// # Errors
    ///
    /// As for [`read_models_info`].
    pub fn read_models_info(
        &self,
        path: impl AsRef<Path>,
    ) -> Result<BTreeMap<u32, ModelInfo>, IoError> {
        let ById(infos) = json::read(self, path.as_ref(), Limit::JSON_BYTES)?;
        Ok(infos)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Place;

    fn read(text: &str) -> Result<BTreeMap<u32, ModelInfo>, IoError> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("models_info.json");
        std::fs::write(&path, text).unwrap();
        read_models_info(&path)
    }

    #[test]
    fn symmetries_are_in_meters() {
        let infos = read(
            r#"{"3": {"diameter": 250, "min_x": -1,
                "symmetries_discrete": [[-1,0,0,10, 0,-1,0,0, 0,0,1,-20, 0,0,0,1]],
                "symmetries_continuous": [{"axis": [0, 0, 2], "offset": [0, 5, 0]}]},
              "12": {"diameter": 100.5}}"#,
        )
        .unwrap();
        assert_eq!(infos.keys().copied().collect::<Vec<_>>(), [3, 12]);
        assert!(infos[&12].symmetries.is_empty());
        assert_eq!(infos[&12].diameter_m, 0.1005);
        let symmetries = &infos[&3].symmetries;
        let moved = symmetries.discrete[0] * Point3::new(1.0, 2.0, 3.0);
        assert!((moved - Point3::new(-0.99, -2.0, 2.98)).norm() < 1e-12);
        assert_eq!(
            symmetries.continuous[0].offset(),
            Point3::new(0.0, 0.005, 0.0)
        );
        assert_eq!(symmetries.continuous[0].direction(), Vector3::z_axis());
    }

    #[test]
    fn errors_name_the_field_and_the_value() {
        let model = |rest: &str| read(&format!(r#"{{"3": {{"diameter": 1{rest}}}}}"#));
        assert!(matches!(
            model(r#", "symmetries_continuous": [{"axis": [0,0,0], "offset": [0,0,0]}]"#),
            Err(IoError { place: Some(Place::Field(key)), .. }) if key == "$.3.symmetries_continuous[0]"
        ));
        assert!(matches!(
            model(r#", "symmetries_discrete": [[2,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1]]"#),
            Err(IoError { place: Some(Place::Field(key)), found, .. })
                if key == "$.3.symmetries_discrete[0]" && found.contains("not a rotation")
        ));
        for bad in [
            r#", "symmetries_discrete": [[1,0,0,0, 0,1,0,0, 0,0,1,0]]"#,
            r#", "symmetries_discrete": [[1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,2]]"#,
            r#", "symmetries_discrete": 1"#,
            r#", "symmetries_continuous": [{"axis": [0,0,1]}]"#,
        ] {
            assert!(
                matches!(
                    model(bad),
                    Err(IoError {
                        place: Some(Place::Field(_)),
                        ..
                    })
                ),
                "{bad}"
            );
        }
        let axes = |count| {
            format!(
                r#", "symmetries_continuous": [{}]"#,
                vec![r#"{"axis": [0,0,1], "offset": [0,0,0]}"#; count].join(", ")
            )
        };
        assert!(model(&axes(3174)).is_ok());
        let error = model(&axes(3175)).unwrap_err().to_string();
        assert!(
            error.contains(
                "$.3: found 0 discrete and 3175 continuous symmetries, which make 1000125 motions"
            ),
            "{error}"
        );
        for bad in [
            r#"{"3": {}}"#,
            r#"{"3": {"diameter": 0}}"#,
            r#"{"x": {"diameter": 1}}"#,
        ] {
            assert!(
                matches!(
                    read(bad),
                    Err(IoError {
                        place: Some(Place::Field(_)),
                        ..
                    })
                ),
                "{bad}"
            );
        }
    }
}
