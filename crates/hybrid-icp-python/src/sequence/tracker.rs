//! `Tracker`.

use std::sync::Mutex;

use hybrid_icp::{Tracker, TrackerConfig};
use pyo3::prelude::*;

use crate::array;
use crate::input::camera::PyCamera;
use crate::input::depth;
use crate::input::model::PyModel;
use crate::mutex::locked;
use crate::{errors, results};

/// Tracks a moving object from depth image to depth image, without masks.
///
/// The pose is predicted at constant velocity, and refined in the pixels around the predicted
/// silhouette. Neither the object nor the camera has to stand still. A lost object is searched
/// around its last place.
///
/// Parameters
/// ----------
/// model : Model
/// camera : Camera
///     The camera of all images.
/// T_co : array_like, shape (4, 4)
///     The rough pose in the first image, camera from object, meters.
/// meters_per_second : float, optional
///     Typical speed of the object relative to the camera, m/s.
/// degrees_per_second : float, optional
///     Typical angular speed, degrees per second.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from hybrid_icp import Camera, Model, Tracker, render_depth
/// >>> corners = np.array([[0, 0, 0], [.1, 0, 0], [0, .08, 0], [0, 0, .06]])
/// >>> model = Model(corners, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
/// >>> camera = Camera(285, 285, 159.5, 119.5, 320, 240)
/// >>> pose = np.eye(4)
/// >>> pose[2, 3] = 0.5
/// >>> tracker = Tracker(model, camera, pose)
/// >>> for frame in range(3):
/// ...     pose[0, 3] += 0.004
/// ...     depth = render_depth(model, camera, pose)
/// ...     depth[depth == 0] = 0.8  # The wall behind.
/// ...     tracked = tracker.step(depth, 1 / 30)
/// >>> bool(np.allclose(tracked.T_co, pose, atol=0.005))
/// True
#[pyclass(frozen, module = "hybrid_icp", name = "Tracker")]
pub(crate) struct PyTracker(Mutex<Tracker>);

#[pymethods]
#[allow(non_snake_case)]
impl PyTracker {
    #[new]
    #[pyo3(signature = (model, camera, T_co, *, meters_per_second = 0.3, degrees_per_second = 90.0))]
    fn new(
        model: &Bound<'_, PyModel>,
        camera: &Bound<'_, PyCamera>,
        T_co: &Bound<'_, PyAny>,
        meters_per_second: f64,
        degrees_per_second: f64,
    ) -> PyResult<Self> {
        let config = TrackerConfig {
            meters_per_second,
            degrees_per_second,
            ..TrackerConfig::default()
        };
        let model = model.get().model.clone();
        let mut tracker = Tracker::new(model, camera.get().0, config);
        tracker.start(&array::motion(T_co, "T_co")?.isometry);
        Ok(Self(Mutex::new(tracker)))
    }

    /// Tracks the object in the next image.
    ///
    /// Parameters
    /// ----------
    /// depth : DepthImage or numpy.ndarray, shape (H, W)
    ///     In meters, as for `Observation`, in the size of the camera.
    /// seconds : float
    ///     Time since the previous image.
    /// mask : numpy.ndarray, shape (H, W), optional
    ///     Pixels to which the object is restricted. Not needed.
    /// scale : float, optional
    ///     Meters per unit of a uint16 image.
    ///
    /// Returns
    /// -------
    /// Tracked
    ///
    /// Raises
    /// ------
    /// InputError
    ///     If the sizes of the image, the mask and the camera differ.
    #[pyo3(signature = (depth, seconds, mask = None, *, scale = None))]
    fn step<'py>(
        &self,
        py: Python<'py>,
        depth: &Bound<'_, PyAny>,
        seconds: f64,
        mask: Option<&Bound<'_, PyAny>>,
        scale: Option<f64>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let depth = depth::shared(depth, scale)?;
        let mask = mask
            .map(|mask| depth::mask(Some(mask), &depth))
            .transpose()?;
        // Release the GIL first: another thread may hold the lock for a whole step.
        let tracked = py.detach(|| locked(&self.0).step(&depth, seconds, mask.as_ref()));
        results::tracked(py, &tracked.map_err(errors::input)?)
    }

    /// Starts again from a rough pose in the next image.
    ///
    /// Parameters
    /// ----------
    /// T_co : array_like, shape (4, 4)
    ///     Camera from object, meters.
    fn restart(&self, py: Python<'_>, T_co: &Bound<'_, PyAny>) -> PyResult<()> {
        let init = array::motion(T_co, "T_co")?.isometry;
        py.detach(|| locked(&self.0).start(&init));
        Ok(())
    }
}
