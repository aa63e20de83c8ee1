//! Warnings about well-formed inputs of a refinement that do not fit together, and about its
//! result.

use hybrid_icp::core::{Isometry3, Model, Observation};
use hybrid_icp::icp::Verdict;
use hybrid_icp::{Diagnosis, Fault, Refinement, Warning};

use super::inputs::Inputs;

/// The largest depth of a `DepthImage`.
const MAX_DEPTH_METERS: f32 = 1000.0;

/// Returns the end of warnings about inputs that contradict each other.
///
/// The doctor requires a mask and an initial pose, so the end is empty without them.
pub(super) fn doctor(inputs: &Inputs) -> &'static str {
    match (&inputs.region.mask, &inputs.init) {
        (Some(_), Some(_)) => "; `hybrid-icp doctor` looks for the cause",
        _ => "",
    }
}

/// Returns the reason for the outcome of a refinement.
///
/// If the initial pose was kept because of an evident flaw of the inputs, the reason names it.
/// `in_box` is `true` if a box replaces the mask.
pub(crate) fn reason(
    refined: &Refinement,
    model: &Model,
    observation: &Observation,
    init: &Isometry3<f64>,
    in_box: bool,
) -> String {
    let ended = refined.outcome.termination.explain();
    if refined.outcome.verdict == Verdict::Refined {
        return ended.to_owned();
    }
    let cause = if observation.mask().bounding_region().area() == 0 {
        "the mask is empty"
    } else if observation.n_measured() == 0 {
        match in_box {
            true => "no depth was measured in the box",
            false => "no depth was measured inside the mask",
        }
    } else if observation.n_surfels() == 0 {
        "the depth measured inside the mask is too sparse for surface normals"
    } else if (init * model.center()).z + model.radius() <= 0.0 {
        "the object at the initial pose is behind the camera"
    } else {
        return ended.to_owned();
    };
    format!("{cause}, so that {ended}")
}

/// Returns warnings about inputs that do not fit together, with the files and options to check.
///
/// `pose` is the initial pose, or the estimated one if there is none. Warnings about contradictions
/// end with `doctor`.
pub(super) fn about_inputs(
    object: &Model,
    observation: &Observation,
    pose: &Isometry3<f64>,
    inputs: &Inputs,
    depth_scale: f64,
    doctor: &str,
) -> anyhow::Result<Vec<String>> {
    let warnings = hybrid_icp::warnings(object, observation, pose).into_iter();
    // If nothing was found, there is no pose to warn of.
    let warnings = warnings.filter(|warning| {
        inputs.init.is_some() || !matches!(warning, Warning::BehindCamera { .. })
    });
    let files = &inputs.files;
    let (unit, depth) = (files.object.unit()?, files.depth.display());
    let mask = inputs.mask_name();
    let (init, pose_unit, size_unit) = match &inputs.init {
        Some(path) => (
            path.display().to_string(),
            " and --init-unit",
            " and --init-unit",
        ),
        // An estimate is as far away as the depth says.
        None => (String::new(), "", " and --depth-scale"),
    };
    let other_camera = match files.camera_from_depth {
        Some(_) => ", --camera-from-depth",
        None => "",
    };
    let in_words = |warning| match warning {
        Warning::BehindCamera { .. } => format!("{init}: {warning}{doctor}"),
        Warning::Center { .. } => format!("{}: {warning}", files.camera.display()),
        Warning::NoDepth => format!(
            "{depth}: {warning} at {depth_scale} mm per unit (depths beyond {MAX_DEPTH_METERS} m count as missing): \
             check --depth-scale{other_camera} and {mask}"
        ),
        Warning::Depth { .. } => format!(
            "{depth}: {warning}: check --depth-scale (now {depth_scale} mm per unit){pose_unit}{doctor}"
        ),
        Warning::Mask { .. } | Warning::Sliver { .. } => {
            format!("{mask}: {warning}: check --model-unit {unit}{size_unit}{doctor}")
        }
        _ => files.object.describe(&warning),
    };
    Ok(warnings.map(in_words).collect())
}

/// Returns warnings about facts of the inputs that [`about_inputs`] has not.
pub(super) fn about_facts(
    object: &Model,
    observation: &Observation,
    inputs: &Inputs,
) -> Vec<String> {
    let (model, mask) = (inputs.files.object.mesh.display(), inputs.mask_name());
    let facts = Diagnosis::facts(object, observation).into_iter();
    let in_words = |fault: Fault| match fault {
        Fault::MaskEmpty => Some(format!("{mask}: {fault}: {}", fault.fix())),
        Fault::MeshInsideOut => Some(format!("{model}: {fault}: {}", fault.fix())),
        _ => None,
    };
    facts.filter_map(in_words).collect()
}

/// Returns warnings about a refined pose that should not be trusted.
///
/// Those about a pose that explains nothing end with `doctor`.
pub(crate) fn about_result(refined: &Refinement, doctor: &str) -> Vec<String> {
    let in_words = |warning: &Warning| match warning {
        Warning::Unexplained { .. } | Warning::FoundElsewhere { .. } => {
            format!("{warning}{doctor}")
        }
        _ => warning.to_string(),
    };
    refined.warnings().iter().map(in_words).collect()
}
