//! Where to look for the cause of a warning about the images of a dataset.

use hybrid_icp::Warning;

/// Returns where to look for the cause; `poses` is the option that names the poses.
///
/// Returns `None` for warnings about models and about single poses, which need no image.
pub(crate) fn advice(warning: &Warning, poses: &str) -> Option<String> {
    let scale = "check depth_scale in scene_camera.json";
    match warning {
        Warning::NoDepth => Some(scale.to_owned()),
        Warning::Depth { .. } => Some(format!("{scale}, and that {poses} states millimetres")),
        Warning::Mask { .. } => Some(format!(
            "check that models are in mm, and that {poses} states millimetres"
        )),
        Warning::Sliver { .. } => {
            Some("check that models are in mm, and what the masks are of".to_owned())
        }
        _ => None,
    }
}
