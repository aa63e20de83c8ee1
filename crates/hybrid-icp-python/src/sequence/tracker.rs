//! `Tracker`.

use std::sync::{Arc, Mutex};

use hybrid_icp::checks::warning_of_distance;
use hybrid_icp::core::Isometry3;
use hybrid_icp::{TrackError, Tracker, TrackerConfig};
use pyo3::prelude::*;

use crate::array::{self, Matrix, unexpected};
use crate::errors::InputError;
use crate::input::camera::PyCamera;
use crate::input::depth;
use crate::input::model::PyModel;
use crate::mutex::locked;
use crate::warnings::in_words;
use crate::{errors, results};

/// The longest time between two images, seconds. Longer ones are probably in other units.
const MAX_SECONDS: f64 = 10.0;

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
///     Typical speed of the object relative to the camera, m/s. An object that leaves the image
///     faster is rarely found again.
/// degrees_per_second : float, optional
///     Typical angular speed, degrees per second.
/// memory_seconds : float, optional
///     The time in which the object changes its velocity, seconds.
/// coast_seconds : float, optional
///     The time for which an object that is not seen stays "doubtful" before it is "lost", seconds.
///
/// Warns
/// -----
/// InputWarning
///     If the rough pose puts the object behind the camera.
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
pub(crate) struct PyTracker {
    tracking: Mutex<Tracking>,
    model: Py<PyModel>,
}

/// A tracker with the last state and pose.
struct Tracking {
    tracker: Tracker,
    state: &'static str,
    camera_from_object: Isometry3<f64>,
}

#[pymethods]
#[allow(non_snake_case)]
impl PyTracker {
    #[new]
    #[pyo3(signature = (model, camera, T_co, *, meters_per_second = 0.3, degrees_per_second = 90.0, memory_seconds = 0.5, coast_seconds = 0.1))]
    fn new(
        model: &Bound<'_, PyModel>,
        camera: &Bound<'_, PyCamera>,
        T_co: &Bound<'_, PyAny>,
        meters_per_second: f64,
        degrees_per_second: f64,
        memory_seconds: f64,
        coast_seconds: f64,
    ) -> PyResult<Self> {
        for (name, number) in [
            ("meters_per_second", meters_per_second),
            ("degrees_per_second", degrees_per_second),
            ("memory_seconds", memory_seconds),
            ("coast_seconds", coast_seconds),
        ] {
            if !(number.is_finite() && number >= 0.0) {
                let text = format!("{name} is {number}, expected a finite number, 0 or more");
                return Err(InputError::new_err(text));
            }
        }
        let config = TrackerConfig {
            meters_per_second,
            degrees_per_second,
            memory_seconds,
            coast_seconds,
        };
        let tracker = Tracker::new(model.get().model.clone(), camera.get().0, config);
        let this = Self {
            tracking: Mutex::new(Tracking {
                tracker,
                state: "started",
                camera_from_object: Isometry3::identity(),
            }),
            model: model.clone().unbind(),
        };
        this.restart(model.py(), T_co)?;
        Ok(this)
    }

    /// Tracks the object in the next image.
    ///
    /// Parameters
    /// ----------
    /// depth : DepthImage or numpy.ndarray, shape (H, W) or (H, W, 1)
    ///     In meters, as for `Observation`, in the size of the camera.
    /// seconds : float
    ///     Time since the previous image, not a time stamp, also if images in between are missing:
    ///     0 for an image of the same instant, at most 10. After a longer pause, restart the
    ///     tracker.
    /// mask : numpy.ndarray, shape (H, W), optional
    ///     Pixels to which the object is restricted. Not needed. It may be passed for some images
    ///     only, for example to find a lost object by a segmentation.
    /// scale : float, optional
    ///     Meters per unit of an image of integers.
    ///
    /// Returns
    /// -------
    /// Tracked
    ///
    /// Raises
    /// ------
    /// InputError
    ///     If the sizes of the image, the mask and the camera differ, or `seconds` is no such time.
    #[pyo3(signature = (depth, seconds, mask = None, *, scale = None))]
    fn step<'py>(
        &self,
        py: Python<'py>,
        depth: &Bound<'_, PyAny>,
        seconds: &Bound<'_, PyAny>,
        mask: Option<&Bound<'_, PyAny>>,
        scale: Option<f64>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let expected = format!("the seconds since the previous image, 0 to {MAX_SECONDS}");
        let seconds: f64 = seconds
            .extract()
            .map_err(|_| unexpected("seconds", seconds, &expected))?;
        if !(0.0..=MAX_SECONDS).contains(&seconds) {
            let text = format!("seconds is {seconds}, expected {expected}");
            return Err(InputError::new_err(text));
        }
        let depth = Arc::clone(&depth::shared(depth, scale)?.get().0);
        let mask = mask
            .map(|mask| depth::mask(Some(mask), &depth))
            .transpose()?;
        // Release the GIL first: another thread may hold the lock for a whole step.
        let tracked = py.detach(|| {
            let mut tracking = locked(&self.tracking);
            let tracked = tracking.tracker.step(depth, seconds, mask.as_ref())?;
            tracking.state = tracked.state.name();
            tracking.camera_from_object = tracked.camera_from_object;
            Ok(tracked)
        });
        results::tracked(
            py,
            &tracked.map_err(|error: TrackError| errors::input(error))?,
        )
    }

    /// Starts again from a rough pose in the next image.
    ///
    /// Parameters
    /// ----------
    /// T_co : array_like, shape (4, 4)
    ///     Camera from object, meters.
    fn restart(&self, py: Python<'_>, T_co: &Bound<'_, PyAny>) -> PyResult<()> {
        let init = array::motion(T_co, "T_co")?;
        if let Some(warning) = warning_of_distance(self.model.get().z_at(&init), None) {
            errors::warn(py, &in_words(warning))?;
        }
        py.detach(|| {
            let mut tracking = locked(&self.tracking);
            tracking.tracker.start(&init.isometry);
            tracking.state = "started";
            tracking.camera_from_object = init.isometry;
        });
        Ok(())
    }

    fn __repr__(&self, py: Python<'_>) -> String {
        py.detach(|| {
            let tracking = locked(&self.tracking);
            let place = Matrix::from(&tracking.camera_from_object).translation();
            format!("Tracker({}, t = {place} m)", tracking.state)
        })
    }
}
