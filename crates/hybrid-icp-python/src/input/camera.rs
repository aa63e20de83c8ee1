//! `Camera`.

use std::path::PathBuf;

use hybrid_icp::core::{Matrix3, PinholeCamera, PixelCenters};
use pyo3::prelude::*;

use crate::array::{self, Matrix};
use crate::errors::{self, FileError, InputError};

/// A pinhole camera without distortion, in the frame of OpenCV.
///
/// It looks along +z, with x right and y down. A point (x, y, z) in meters projects to
/// u = fx·x/z + cx and v = fy·y/z + cy.
///
/// Parameters
/// ----------
/// fx, fy : float
///     Focal lengths, pixels.
/// cx, cy : float
///     Principal point, pixels.
/// width, height : int
///     Image size, pixels.
/// pixel_centers : {"integers", "halves"}, optional
///     Position of the center of the first pixel in the calibration. It is (0, 0) for "integers",
///     as in OpenCV and BOP, and (½, ½) for "halves", as in OpenGL and BlenderProc.
///
/// Examples
/// --------
/// >>> from hybrid_icp import Camera
/// >>> Camera(572.4, 573.6, 325.3, 242.0, 640, 480)
/// Camera(fx=572.4, fy=573.6, cx=325.3, cy=242, width=640, height=480)
#[pyclass(frozen, eq, module = "hybrid_icp", name = "Camera", from_py_object)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PyCamera(pub(crate) PinholeCamera);

/// The width and the height of an image.
struct Size(u32, u32);

impl<'py> FromPyObject<'_, 'py> for Size {
    type Error = PyErr;

    fn extract(value: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        let expected = "(width, height) in pixels, such as (640, 480); the shape of an array is \
                        (height, width)";
        let size = value
            .extract::<[u32; 2]>()
            .map(|[width, height]| Self(width, height));
        size.map_err(|_| match value.repr() {
            Ok(found) => InputError::new_err(format!("size is {found}, expected {expected}")),
            Err(error) => error,
        })
    }
}

#[pymethods]
impl PyCamera {
    #[new]
    #[pyo3(signature = (fx, fy, cx, cy, width, height, *, pixel_centers = "integers"))]
    #[allow(clippy::too_many_arguments)] // A camera has six numbers.
    fn new(
        fx: f64,
        fy: f64,
        cx: f64,
        cy: f64,
        width: u32,
        height: u32,
        pixel_centers: &str,
    ) -> PyResult<Self> {
        let choices = [
            ("integers", PixelCenters::AtIntegers),
            ("halves", PixelCenters::AtHalves),
        ];
        let centers = array::choice("pixel_centers", pixel_centers, choices)?;
        PinholeCamera::with_pixel_centers(centers, fx, fy, cx, cy, width, height)
            .map(Self)
            .map_err(errors::input)
    }

    /// Creates a camera from a calibration matrix.
    ///
    /// Parameters
    /// ----------
    /// K : array_like, shape (3, 3)
    ///     [[fx, 0, cx], [0, fy, cy], [0, 0, 1]], pixels, pixel centers at integers.
    /// size : (int, int)
    ///     Width and height of the image, pixels.
    ///
    /// Returns
    /// -------
    /// Camera
    ///
    /// Examples
    /// --------
    /// >>> from hybrid_icp import Camera
    /// >>> Camera.from_K([[600, 0, 319.5], [0, 600, 239.5], [0, 0, 1]], (640, 480)).fx
    /// 600.0
    #[staticmethod]
    #[pyo3(name = "from_K")]
    #[allow(non_snake_case)]
    fn from_k(K: &Bound<'_, PyAny>, size: Size) -> PyResult<Self> {
        let expected = "a (3, 3) matrix [fx 0 cx; 0 fy cy; 0 0 1], pixels";
        let (numbers, _) = array::numbers::<f64>(K, &[Some(3), Some(3)], "K", expected)?;
        PinholeCamera::from_matrix(&Matrix3::from_row_slice(&numbers), size.0, size.1)
            .map(Self)
            .map_err(errors::input)
    }

    /// Reads a camera from a file of BOP, ROS, OpenCV, RealSense, Open3D or NumPy.
    ///
    /// Parameters
    /// ----------
    /// path : str or os.PathLike
    ///     JSON, YAML, XML, text, NPY or NPZ.
    /// size : (int, int)
    ///     Width and height of the image, pixels. A size in the file must be the same.
    ///
    /// Returns
    /// -------
    /// Camera
    ///
    /// Raises
    /// ------
    /// FileError
    ///     If the file cannot be read, has no camera, or has lens distortion.
    #[staticmethod]
    fn from_file(py: Python<'_>, path: PathBuf, size: Size) -> PyResult<Self> {
        let file = py.detach(|| hicp_io::read_camera(&path, (size.0, size.1)));
        let file = file.map_err(errors::file)?;
        match file.distortion {
            None => Ok(Self(file.camera)),
            Some(_) => Err(FileError::new_err(format!(
                "{}: found lens distortion, expected none: undistort the images first, with \
                 nearest-neighbor interpolation for depth, and use Camera.from_K",
                path.display()
            ))),
        }
    }

    /// Horizontal focal length, pixels.
    #[getter]
    fn fx(&self) -> f64 {
        self.0.fx()
    }

    /// Vertical focal length, pixels.
    #[getter]
    fn fy(&self) -> f64 {
        self.0.fy()
    }

    /// Column of the principal point, pixels, centers at integers.
    #[getter]
    fn cx(&self) -> f64 {
        self.0.cx()
    }

    /// Row of the principal point, pixels, centers at integers.
    #[getter]
    fn cy(&self) -> f64 {
        self.0.cy()
    }

    /// Image width, pixels.
    #[getter]
    fn width(&self) -> u32 {
        self.0.width()
    }

    /// Image height, pixels.
    #[getter]
    fn height(&self) -> u32 {
        self.0.height()
    }

    /// The calibration matrix, shape (3, 3), float64, pixels.
    #[getter(K)]
    fn matrix(&self) -> Matrix {
        let (fx, fy, cx, cy, ..) = self.__getnewargs__();
        Matrix::new(3, vec![fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0])
    }

    fn __getnewargs__(&self) -> (f64, f64, f64, f64, u32, u32) {
        let camera = &self.0;
        let [fx, fy, cx, cy] = [camera.fx(), camera.fy(), camera.cx(), camera.cy()];
        (fx, fy, cx, cy, camera.width(), camera.height())
    }

    fn __hash__(&self, py: Python<'_>) -> PyResult<isize> {
        self.__getnewargs__().into_pyobject(py)?.hash()
    }

    fn __repr__(&self) -> String {
        let (fx, fy, cx, cy, width, height) = self.__getnewargs__();
        format!("Camera(fx={fx}, fy={fy}, cx={cx}, cy={cy}, width={width}, height={height})")
    }
}
