//! Advice on the cause of a warning about the images of a dataset.

use hybrid_icp::Warning;

/// Returns the files to check for the cause; `poses` is the advice to check the poses, if any.
///
/// Returns `None` for warnings about models and about single poses, which need no image.
pub(crate) fn advice(warning: &Warning, poses: Option<&str>) -> Option<String> {
    let poses = poses.map_or(String::new(), |poses| format!(", and {poses}"));
    match warning {
        Warning::NoDepth => Some("check depth_scale in scene_camera.json".to_owned()),
        Warning::Depth { .. } => Some(format!("check depth_scale in scene_camera.json{poses}")),
        Warning::Mask { .. } => Some(format!("check that models are in mm{poses}")),
        Warning::Sliver { .. } => {
            Some("check that models are in mm, and that masks show the object".to_owned())
        }
        Warning::Box { .. } => Some("check bbox in --detections".to_owned()),
        _ => None,
    }
}

/// Returns whether a warning is about a diameter, which `wrong_diameters` reports, too.
pub(crate) fn is_about_diameter(warning: &Warning) -> bool {
    matches!(
        warning,
        Warning::Diameter { .. } | Warning::StatedDiameter { .. }
    )
}
