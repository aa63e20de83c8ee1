//! Sizes and symmetries of a dataset's objects.

use std::collections::BTreeMap;
use std::path::Path;

use hicp_core::{
    Isometry3, MAX_SYMMETRY_MOTIONS, Point3, Symmetries, SymmetryAxis, SymmetryError, Vector3,
};

use crate::error::IoError;
use crate::json::{Document, Node};
use crate::limits::ReadLimits;
use crate::pose::pose_from_bop;

/// What a dataset states about an object besides its mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelInfo {
    /// Largest distance between two of its vertices, metres.
    pub diameter_m: f64,
    /// Its symmetries, metres.
    pub symmetries: Symmetries,
}

/// Reads a `models_info.json`: diameters and symmetries by object id.
///
/// # Errors
///
/// What [`IoError`] says of JSON files, [`IoError::Rotation`] and [`IoError::Symmetry`] for symmetries that are none.
pub fn read_models_info(path: impl AsRef<Path>) -> Result<BTreeMap<u32, ModelInfo>, IoError> {
    ReadLimits::DEFAULT.read_models_info(path)
}

impl ReadLimits {
    /// As [`read_models_info`], within these limits.
    ///
    /// # Errors
    ///
    /// As [`read_models_info`].
    pub fn read_models_info(
        &self,
        path: impl AsRef<Path>,
    ) -> Result<BTreeMap<u32, ModelInfo>, IoError> {
        Document::read(self, path.as_ref())?
            .root()
            .numbered()?
            .into_iter()
            .map(|(obj_id, node)| Ok((obj_id, model_info(&node)?)))
            .collect()
    }
}

fn model_info(node: &Node<'_>) -> Result<ModelInfo, IoError> {
    let diameter = node.get("diameter")?;
    let diameter_mm = diameter.number()?;
    if diameter_mm <= 0.0 {
        return Err(diameter.refuse("a number above 0, in mm"));
    }
    let list = |key: &str| {
        node.optional(key)
            .map_or(Ok(Vec::new()), |node| node.items())
    };
    let info = ModelInfo {
        diameter_m: diameter_mm / 1000.0,
        symmetries: Symmetries {
            discrete: list("symmetries_discrete")?
                .iter()
                .map(discrete)
                .collect::<Result<_, _>>()?,
            continuous: list("symmetries_continuous")?
                .iter()
                .map(continuous)
                .collect::<Result<_, _>>()?,
        },
    };
    // They are expanded when errors are measured: lists of ten thousand each would be terabytes.
    let motions = info.symmetries.n_motions();
    if motions > MAX_SYMMETRY_MOTIONS {
        return Err(node.refuse_found(
            format!(
                "{} discrete and {} continuous symmetries, which make {motions} motions",
                info.symmetries.discrete.len(),
                info.symmetries.continuous.len()
            ),
            format!("at most {MAX_SYMMETRY_MOTIONS}"),
        ));
    }
    Ok(info)
}

/// A rigid motion as a row-major 4×4 matrix in millimetres.
fn discrete(node: &Node<'_>) -> Result<Isometry3<f64>, IoError> {
    let m: [f64; 16] = node.numbers()?;
    if m[12..] != [0.0, 0.0, 0.0, 1.0] {
        return Err(node.refuse_found(
            format!("a matrix with the last row {:?}", &m[12..]),
            "the last row 0, 0, 0, 1 of a rigid motion",
        ));
    }
    let rotation = [m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]];
    pose_from_bop(&rotation, &[m[3], m[7], m[11]]).map_err(|source| IoError::Rotation {
        path: node.path().to_owned(),
        place: node.key().to_owned(),
        source,
    })
}

fn continuous(node: &Node<'_>) -> Result<SymmetryAxis, IoError> {
    let axis = Vector3::from(node.get("axis")?.numbers::<3>()?);
    let offset = Point3::from(node.get("offset")?.numbers::<3>()?);
    SymmetryAxis::new(axis, offset / 1000.0).map_err(|source: SymmetryError| IoError::Symmetry {
        path: node.path().to_owned(),
        key: node.key().to_owned(),
        source,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<BTreeMap<u32, ModelInfo>, IoError> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("models_info.json");
        std::fs::write(&path, text).unwrap();
        read_models_info(&path)
    }

    #[test]
    fn symmetries_are_in_metres() {
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
    fn faults_are_named() {
        let model = |rest: &str| read(&format!(r#"{{"3": {{"diameter": 1{rest}}}}}"#));
        assert!(matches!(
            model(r#", "symmetries_continuous": [{"axis": [0,0,0], "offset": [0,0,0]}]"#),
            Err(IoError::Symmetry { key, .. }) if key == "$.3.symmetries_continuous[0]"
        ));
        assert!(matches!(
            model(r#", "symmetries_discrete": [[2,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1]]"#),
            Err(IoError::Rotation { place, .. }) if place == "$.3.symmetries_discrete[0]"
        ));
        for bad in [
            r#", "symmetries_discrete": [[1,0,0,0, 0,1,0,0, 0,0,1,0]]"#,
            r#", "symmetries_discrete": [[1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,2]]"#,
            r#", "symmetries_discrete": 1"#,
            r#", "symmetries_continuous": [{"axis": [0,0,1]}]"#,
        ] {
            assert!(
                matches!(model(bad), Err(IoError::JsonValue { .. })),
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
            assert!(matches!(read(bad), Err(IoError::JsonValue { .. })), "{bad}");
        }
    }
}
