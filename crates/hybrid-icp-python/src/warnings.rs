//! Warnings about the inputs of a run, in the words of Python.

use hybrid_icp::{Warning, checks::warnings_of_image};
use pyo3::prelude::*;

use crate::errors;
use crate::input::model::PyModel;
use crate::input::observation::PyObservation;

/// Warns if a pipeline compares missing colors, and if the object fits the image at no distance.
///
/// Distances are z of the object's center in the camera frame, meters.
pub(crate) fn about_inputs(
    py: Python<'_>,
    object: &PyModel,
    observation: &PyObservation,
    distances: &[f64],
    colors_compared_by: Option<String>,
) -> PyResult<()> {
    let (model, image) = (&object.model, &observation.observation);
    let missing = if model.mesh().color().is_none() {
        Some("the model has no colors (Model.has_color)")
    } else {
        let colors = image.color().is_none();
        colors.then_some("the observation has no color image (color=)")
    };
    if let (Some(missing), Some(pipeline)) = (missing, colors_compared_by) {
        let text = format!("{missing}, so that {pipeline} uses depth alone");
        errors::warn(py, &text)?;
    }
    if image.region().is_empty() {
        let text = "the mask is empty, expected pixels that are not 0 on the object";
        errors::warn(py, text)?;
    }
    let at = |distance: &f64| warnings_of_image(model, image, *distance);
    if distances.iter().any(|distance| at(distance).is_empty()) {
        return Ok(());
    }
    let mut warnings = distances.first().into_iter().flat_map(at);
    warnings.try_for_each(|warning| errors::warn(py, &in_words(warning)))
}

/// Returns a warning about inputs with the arguments to check.
pub(crate) fn in_words(warning: Warning) -> String {
    match warning {
        Warning::BehindCamera { z } => format!(
            "T_co puts the object's center at z = {z:.4} m, behind the camera, which looks along \
             +z: expected camera from object, not object from camera, nor an OpenGL pose \
             (np.diag([1, -1, -1, 1]) @ T_co converts it)"
        ),
        Warning::Depth { measured, expected } => format!(
            "T_co puts the object's center at z = {expected:.4} m, but the median depth inside the \
             mask is {measured:.4} m: check the units of both, expected meters"
        ),
        Warning::NoDepth => format!("{warning}: check scale= of the depth, and the mask"),
        Warning::Mask { .. } | Warning::Sliver { .. } => format!(
            "{warning}: check unit= of the model, that the pose is in meters, and that the mask \
             shows the object"
        ),
        _ => warning.to_string(),
    }
}
