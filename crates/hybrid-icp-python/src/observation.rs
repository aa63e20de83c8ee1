//! `Observation`.

use hybrid_icp::Observation;
use numpy::PyArray2;
use pyo3::prelude::*;

use crate::array;
use crate::camera::PyCamera;
use crate::depth;
use crate::errors::{self, InputError};

/// A segmented depth image: what poses are refined against. Immutable; share it between hypotheses and threads.
///
/// Arrays are read where they are and copied once, in one piece where they are C-contiguous; changing them afterwards changes nothing.
///
/// Parameters
/// ----------
/// depth : numpy.ndarray, shape (H, W)
///     Depth along the optical axis: float32 (or float64) metres, or uint16 with `scale`. 0, negative or NaN where nothing was measured.
/// mask : numpy.ndarray of bool or uint8, shape (H, W), or None
///     Not zero on the object; `None` for every pixel.
/// camera : Camera
///     Of the image's size.
/// scale : float, optional
///     Metres per unit of a uint16 image, such as 0.001; BOP's `depth_scale` divided by 1000.
///
/// Raises
/// ------
/// InputError
///     When shapes, dtypes or units do not fit, saying what was passed and what was expected.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from hybrid_icp import Camera, Observation
/// >>> camera = Camera(100, 100, 31.5, 23.5, 64, 48)
/// >>> wall = np.full((48, 64), 0.8, np.float32)
/// >>> Observation(wall, None, camera).n_measured
/// 3072
/// >>> Observation(wall * 1000, None, camera)
/// Traceback (most recent call last):
/// ...
/// hybrid_icp.InputError: depth looks like millimetres: median 800, expected metres (divide by 1000, or pass uint16 with scale=0.001)
#[pyclass(frozen, module = "hybrid_icp", name = "Observation")]
#[derive(Debug)]
pub(crate) struct PyObservation {
    pub(crate) observation: Observation,
    /// Median depth inside the mask, metres; `None` without any.
    pub(crate) median_depth: Option<f64>,
}

#[pymethods]
impl PyObservation {
    #[new]
    #[pyo3(signature = (depth, mask, camera, *, scale = None))]
    fn new(
        py: Python<'_>,
        depth: &Bound<'_, PyAny>,
        mask: Option<&Bound<'_, PyAny>>,
        camera: PyCamera,
        scale: Option<f64>,
    ) -> PyResult<Self> {
        let image = depth::depth(depth, scale)?;
        let mask = depth::mask(mask, &image)?;
        let camera = camera.0;
        if (camera.width(), camera.height()) != (image.width(), image.height()) {
            return Err(InputError::new_err(format!(
                "camera is for {}x{} images but depth is {}, expected shape ({}, {})",
                camera.width(),
                camera.height(),
                array::describe(depth),
                camera.height(),
                camera.width()
            )));
        }
        py.detach(|| Self::make(image, mask, camera))
    }

    /// The camera.
    #[getter]
    fn camera(&self) -> PyCamera {
        PyCamera(*self.observation.camera())
    }

    /// A copy of the depth image, shape (H, W), float32, metres, 0 where nothing was measured.
    #[getter]
    fn depth<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let image = self.observation.depth();
        depth::image(py, image.width(), image.pixels().to_vec())
    }

    /// A copy of the mask, shape (H, W), bool.
    #[getter]
    fn mask<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<bool>>> {
        let mask = self.observation.mask();
        depth::image(py, mask.width(), mask.pixels().to_vec())
    }

    /// Number of masked pixels that have a depth.
    #[getter]
    fn n_measured(&self) -> usize {
        self.observation.n_measured()
    }

    /// Number of pixels that have a point with a normal: what is registered.
    #[getter]
    fn n_surfels(&self) -> usize {
        self.observation.n_surfels()
    }

    /// Points and normals of the masked surface, in the camera frame.
    ///
    /// Returns
    /// -------
    /// points : numpy.ndarray, shape (n_surfels, 3), float32
    ///     Metres.
    /// normals : numpy.ndarray, shape (n_surfels, 3), float32
    ///     Of unit length, facing the camera.
    #[allow(clippy::type_complexity)] // Two arrays.
    fn surfels<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyArray2<f32>>, Bound<'py, PyArray2<f32>>)> {
        let (mut points, mut normals) = (Vec::new(), Vec::new());
        for (_, surfel) in self.observation.surfels(1) {
            points.extend_from_slice(surfel.point.coords.as_slice());
            normals.extend_from_slice(surfel.normal.as_slice());
        }
        Ok((
            array::matrix(py, 3, points)?,
            array::matrix(py, 3, normals)?,
        ))
    }

    fn __repr__(&self) -> String {
        let camera = self.observation.camera();
        format!(
            "Observation({}x{}, {} masked pixels with depth, {} with a normal)",
            camera.width(),
            camera.height(),
            self.n_measured(),
            self.n_surfels()
        )
    }
}

impl PyObservation {
    fn make(
        depth: hybrid_icp::DepthImage,
        mask: hybrid_icp::Mask,
        camera: hybrid_icp::PinholeCamera,
    ) -> PyResult<Self> {
        let observation = Observation::new(depth, mask, camera).map_err(errors::input)?;
        let region = observation.region();
        let width = observation.depth().width() as usize;
        let depths = (region.v_min..region.v_max).flat_map(|v| {
            let row = v as usize * width;
            let columns = row + region.u_min as usize..row + region.u_max as usize;
            let mask = &observation.mask().pixels()[columns.clone()];
            let depth = &observation.depth().pixels()[columns];
            depth
                .iter()
                .zip(mask)
                .filter(|(_, set)| **set)
                .map(|(z, _)| *z)
        });
        let median_depth = depth::median(depths).map(f64::from);
        Ok(Self {
            observation,
            median_depth,
        })
    }
}
