//! The instances that a method has to find.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::error::IoError;
use crate::json;
use crate::limits::{Limit, ReadLimits};

/// Instances of one object in one image.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize)]
#[serde(expecting = "an object with `scene_id`, `im_id`, `obj_id` and `inst_count`")]
pub struct Target {
    /// The scene.
    pub scene_id: u32,
    /// The image.
    pub im_id: u32,
    /// The object.
    pub obj_id: u32,
    /// How many instances of the object are to be found.
    pub inst_count: u32,
}

/// Reads a `test_targets_bop19.json`, in the file's order.
///
/// # Errors
///
/// [`IoError`] that names the key. Targets of the later detection tasks, which state no objects, are refused.
pub fn read_targets(path: impl AsRef<Path>) -> Result<Vec<Target>, IoError> {
    ReadLimits::DEFAULT.read_targets(path)
}

impl ReadLimits {
    /// As [`read_targets`], within these limits.
    ///
    /// # Errors
    ///
    /// As [`read_targets`].
    pub fn read_targets(&self, path: impl AsRef<Path>) -> Result<Vec<Target>, IoError> {
        json::read(self, path.as_ref(), Limit::JSON_BYTES)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Place;

    #[test]
    fn targets_are_read_and_those_without_object_refused() {
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
            Err(IoError { expected, place: Some(Place::Field(key)), .. }) if key == "$[0]" && expected.contains("obj_id")
        ));
    }
}
