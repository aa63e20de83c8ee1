//! The targets of a benchmark: the instances that a method must find.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::error::IoError;
use crate::json;
use crate::limits::{Limit, ReadLimits};

/// The number of instances of one object to find in one image.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize)]
#[serde(expecting = "an object with `scene_id`, `im_id`, `obj_id` and `inst_count`")]
pub struct Target {
    /// Id of the scene.
    pub scene_id: u32,
    /// Id of the image.
    pub im_id: u32,
    /// Id of the object.
    pub obj_id: u32,
    /// Number of instances of the object to find.
    pub inst_count: u32,
}

/// Reads a `test_targets_bop19.json`, in the order of the file.
///
/// # Errors
///
/// [`IoError`] names the JSON key of the fault. Targets of BOP's later detection tasks are refused,
/// because they do not state objects.
pub fn read_targets(path: impl AsRef<Path>) -> Result<Vec<Target>, IoError> {
    ReadLimits::DEFAULT.read_targets(path)
}

impl ReadLimits {
    /// Reads a file as [`read_targets`] does, within these limits.
    ///
    /// # Errors
    ///
    /// As for [`read_targets`].
    pub fn read_targets(&self, path: impl AsRef<Path>) -> Result<Vec<Target>, IoError> {
        json::read(self, path.as_ref(), Limit::JSON_BYTES).map_err(|mut error: IoError| {
            if error.found == "no key `obj_id`" {
                error.expected = "targets with objects, as in test_targets_bop19.json; those of \
                                  BOP's later detection tasks have none"
                    .to_owned();
            }
            error
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Place;

    #[test]
    fn targets_are_read_and_targets_without_an_object_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("targets.json");
        std::fs::write(
            &path,
            r#"[{"im_id": 3, "inst_count": 2, "obj_id": 5, "scene_id": 48}]"#,
        )
        .unwrap();
        let target = Target {
            scene_id: 48,
            im_id: 3,
            obj_id: 5,
            inst_count: 2,
        };
        assert_eq!(read_targets(&path).unwrap(), [target]);
        std::fs::write(&path, r#"[{"im_id": 3, "scene_id": 48}]"#).unwrap();
        assert!(matches!(
            read_targets(&path),
            Err(IoError { expected, place: Some(Place::Field(key)), .. }) if key == "$[0]" && expected.contains("test_targets_bop19.json")
        ));
    }
}
