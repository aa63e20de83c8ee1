//! Diagnosis of the inputs of a refinement.

use hybrid_icp::Diagnosis;
use pyo3::prelude::*;

use crate::array;
use crate::input::model::PyModel;
use crate::input::observation::PyObservation;
use crate::results::{self, Record};
use crate::warnings;

/// Names what is wrong with the inputs of `Pipeline.refine`, and the fix.
///
/// Each fault that inputs can have is corrected on trial, and a short refinement scores the
/// corrected inputs. A fault is named if its correction improves the score clearly. The initial
/// pose may be off by some millimeters and degrees, as those of detectors are. Two faults at once
/// are often not found: correct one, and diagnose again. Like `hybrid-icp doctor`, but without the
/// faults of files, such as a label image as the mask.
///
/// It takes about as long as 10 refinements, and releases the GIL.
///
/// Parameters
/// ----------
/// model : Model
///     The object.
/// observation : Observation
///     The image. Its mask shows the object alone: in a box, other objects hide the fault.
/// T_co : array_like, shape (4, 4)
///     The initial pose, camera from object, meters. Any length of its translation is accepted.
///
/// Returns
/// -------
/// Diagnosis
///     The faults, the most probable one first.
///
/// Raises
/// ------
/// InputError
///     If the pose is not a rigid motion.
///
/// Warns
/// -----
/// InputWarning
///     If no fault is found, but the inputs do not fit together (`Pipeline.refine`).
///
/// Examples
/// --------
/// A plate is 0.5 m in front of the camera, but its depth was read at ten times its scale:
///
/// >>> import numpy as np
/// >>> from hybrid_icp import Camera, Model, Observation, diagnose, render_depth
/// >>> corners = [[-.1, -.1, 0], [.1, -.1, 0], [.1, .1, 0], [-.1, .1, 0]]
/// >>> model = Model(corners, [[0, 2, 1], [0, 3, 2]])
/// >>> camera = Camera(100, 100, 31.5, 31.5, 64, 64)
/// >>> true = np.eye(4); true[2, 3] = 0.5
/// >>> depth = render_depth(model, camera, true)
/// >>> observation = Observation(10 * depth, depth > 0, camera)
/// >>> rough = np.eye(4); rough[2, 3] = 0.503
/// >>> diagnosis = diagnose(model, observation, rough)
/// >>> diagnosis.faults[0].problem, diagnosis.faults[0].fix
/// ('the depth is 10 times too large', 'multiply the depth by 0.1')
#[pyfunction]
#[allow(non_snake_case)]
pub(crate) fn diagnose<'py>(
    py: Python<'py>,
    model: &Bound<'py, PyModel>,
    observation: &Bound<'py, PyObservation>,
    T_co: &Bound<'py, PyAny>,
) -> Record<'py> {
    let init = array::motion_of_cloud(T_co, "T_co")?.isometry;
    let (object, image) = (&model.get().model, &observation.get().observation);
    let diagnosis = py.detach(|| Diagnosis::of(object, image, &init));
    if diagnosis.findings.is_empty() {
        let distance = (init * object.center()).z;
        warnings::about_inputs(py, model.get(), observation.get(), &[distance], None)?;
    }
    results::diagnosis(py, &diagnosis)
}
