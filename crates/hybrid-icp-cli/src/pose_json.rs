//! Poses as JSON, with the keys of pose files.

use hybrid_icp::core::Isometry3;
use serde_json::{Value, json};

/// Adds the keys of a pose to a JSON object.
pub(crate) fn add_pose(object: &mut Value, pose: &Isometry3<f64>) {
    let (rotation, translation_mm) = hicp_io::pose_to_bop(pose);
    object["cam_R_m2c"] = json!(rotation);
    object["cam_t_m2c"] = json!(translation_mm);
}
