//! Advice on the cause of a warning about the images of a dataset.

use hybrid_icp::Warning;

/// Returns the files to check for the cause; `poses` is the option that names the poses.
///
/// Returns `None` for warnings about models and about single poses, which need no image.
pub(crate) fn advice(warning: &Warning, poses: &str) -> Option<String> {
    let scale = "check depth_scale in scene_camera.json";
    match warning {
        Warning::NoDepth => Some(scale.to_owned()),
        Warning::Depth { .. } => Some(format!("{scale}, and that {poses} is in mm")),
        Warning::Mask { .. } => Some(format!("check that models and {poses} are in mm")),
        Warning::Sliver { .. } => {
            Some("check that models are in mm, and that masks show the object".to_owned())
        }
        _ => None,
    }
}
