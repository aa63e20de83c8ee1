//! What looks wrong about the inputs of a refinement although each of them is well-formed, and about its result.

use std::path::Display;

use hicp_io::LengthUnit;
use hybrid_icp::{Isometry3, Model, Observation, Refinement, Verdict, Warning};

/// Where depth images end, as `DepthImage` has it.
const MAX_DEPTH_METERS: f32 = 1000.0;

/// Says why a refinement ended as it did; for a pose that was kept, the cause in the inputs where there is a plain one.
pub(crate) fn reason(
    refined: &Refinement,
    model: &Model,
    observation: &Observation,
    init: &Isometry3<f64>,
) -> String {
    let ended = refined.outcome.termination.explain();
    if refined.outcome.verdict == Verdict::Refined {
        return ended.to_owned();
    }
    let cause = if observation.mask().bounding_region().area() == 0 {
        "the mask is empty"
    } else if observation.n_measured() == 0 {
        "no depth was measured inside the mask"
    } else if observation.n_surfels() == 0 {
        "the depth measured inside the mask is too sparse for surface normals"
    } else if (init * model.center()).z + model.radius() <= 0.0 {
        "the object at the initial pose is behind the camera"
    } else {
        return ended.to_owned();
    };
    format!("{cause}, so that {ended}")
}

/// Returns what to warn of: units that do not go together, with the files and options to look at.
pub(crate) fn about_units(
    model: &Model,
    observation: &Observation,
    init: &Isometry3<f64>,
    names: &Names<'_>,
) -> Vec<String> {
    let warnings = hybrid_icp::warnings(model, observation, init).into_iter();
    warnings.map(|warning| in_words(&warning, names)).collect()
}

/// Returns what to warn of: poses that are not to be trusted.
pub(crate) fn about_result(refined: &Refinement) -> Vec<String> {
    refined.warnings().iter().map(ToString::to_string).collect()
}

fn in_words(warning: &Warning, names: &Names<'_>) -> String {
    let Names {
        model,
        model_unit,
        depth,
        depth_scale,
        mask,
        init,
    } = names;
    match warning {
        Warning::Diameter { .. } => format!("{model}: {warning}, check --model-unit {model_unit}"),
        Warning::BehindCamera { .. } => format!("{init}: {warning}"),
        Warning::NoDepth => format!(
            "{depth}: {warning} at {depth_scale} mm per unit; depths beyond {MAX_DEPTH_METERS} m count as missing: check \
             --depth-scale and {mask}"
        ),
        Warning::Depth { .. } => format!(
            "{depth}: {warning}: check --depth-scale (now {depth_scale} mm per unit) and cam_t_m2c (mm)"
        ),
        Warning::Mask { .. } | Warning::Sliver { .. } => {
            format!("{mask}: {warning}: check --model-unit {model_unit} and cam_t_m2c (mm)")
        }
        _ => format!("{model}: {warning}"),
    }
}

/// What the inputs are called in messages.
pub(crate) struct Names<'a> {
    pub(crate) model: Display<'a>,
    pub(crate) model_unit: LengthUnit,
    pub(crate) depth: Display<'a>,
    pub(crate) depth_scale: f64,
    pub(crate) mask: Display<'a>,
    pub(crate) init: Display<'a>,
}
