//! Advice on the cause of a warning about the images of a dataset.

use hybrid_icp::Warning;

/// Returns the files to check for the cause; `poses` is the option that names the poses, if any.
///
/// Returns `None` for warnings about models and about single poses, which need no image.
pub(crate) fn advice(warning: &Warning, poses: Option<&str>) -> Option<String> {
    let scale = "check depth_scale in scene_camera.json";
    let models = match poses {
        Some(poses) => format!("models and {poses}"),
        None => "models".to_owned(),
    };
    match warning {
        Warning::NoDepth => Some(scale.to_owned()),
        Warning::Depth { .. } => Some(match poses {
            Some(poses) => format!("{scale}, and that {poses} is in mm"),
            None => scale.to_owned(),
        }),
        Warning::Mask { .. } => Some(format!("check that {models} are in mm")),
        Warning::Sliver { .. } => {
            Some("check that models are in mm, and that masks show the object".to_owned())
        }
        _ => None,
    }
}

/// Returns whether a warning repeats what `wrong_diameters` says of a model.
pub(crate) fn is_about_diameter(warning: &Warning) -> bool {
    matches!(
        warning,
        Warning::Diameter { .. } | Warning::StatedDiameter { .. }
    )
}
