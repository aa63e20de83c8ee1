//! `Model`.

use std::path::PathBuf;
use std::sync::OnceLock;

use hicp_io::LengthUnit;
use hybrid_icp::core::{
    MAX_SAMPLES, MAX_SYMMETRY_MOTIONS, Model, ModelConfig, Point3, Symmetries, SymmetryAxis,
    TriMesh, Vector3,
};
use hybrid_icp::score::ModelPoints;
use hybrid_icp::warnings_of_model;
use numpy::{PyArrayDescrMethods, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::array::{self, Matrix};
use crate::errors::{self, InputError};

/// An object to be registered: its mesh, surface samples, size and symmetries. Immutable; share it
/// between threads.
///
/// Make one per object: it holds what is computed from the mesh once.
///
/// Parameters
/// ----------
/// vertices : array_like, shape (V, 3)
///     Coordinates in the object frame, in `unit`; kept as float32 metres.
/// faces : array_like of int, shape (F, 3)
///     Indices of the triangles' corners, counter-clockwise seen from outside.
/// unit : {"m", "mm", "cm"}, optional
///     Unit of the vertices and of `diameter`, of the offsets and translations of the symmetries
///     too.
/// samples : int, optional
///     Number of area-uniform surface samples.
/// diameter : float, optional
///     Where a dataset prescribes one; otherwise the largest distance between two vertices.
/// symmetries : array_like, shape (N, 4, 4), optional
///     Discrete symmetries: rigid motions of the object frame that leave it looking the same, the
///     identity not counted.
/// symmetry_axes : sequence of (axis, offset), optional
///     Continuous symmetries: any rotation about the line through `offset` along `axis`, three
///     numbers each.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from hybrid_icp import Model
/// >>> plate = np.array([[-100, -100, 0], [100, -100, 0], [100, 100, 0], [-100, 100, 0]])
/// >>> Model(plate, [[0, 2, 1], [0, 3, 2]], unit="mm")
/// Model(4 vertices, 2 faces, diameter 0.2828 m)
#[pyclass(frozen, module = "hybrid_icp", name = "Model")]
#[derive(Debug)]
pub(crate) struct PyModel {
    pub(crate) model: Model,
    /// Made when a pose error is first asked for.
    points: OnceLock<ModelPoints>,
}

/// What both ways to make a model take besides the mesh.
struct Options<'a, 'py> {
    unit: LengthUnit,
    samples: usize,
    diameter: Option<f64>,
    symmetries: Option<&'a Bound<'py, PyAny>>,
    axes: Vec<([f64; 3], [f64; 3])>,
}

#[pymethods]
impl PyModel {
    #[new]
    #[pyo3(signature = (vertices, faces, *, unit = "m", samples = 1000, diameter = None, symmetries = None, symmetry_axes = Vec::new()))]
    #[allow(clippy::too_many_arguments)] // Keywords in Python.
    fn new(
        py: Python<'_>,
        vertices: &Bound<'_, PyAny>,
        faces: &Bound<'_, PyAny>,
        unit: &str,
        samples: usize,
        diameter: Option<f64>,
        symmetries: Option<&Bound<'_, PyAny>>,
        symmetry_axes: Vec<([f64; 3], [f64; 3])>,
    ) -> PyResult<Self> {
        let options = Options::new(unit, samples, diameter, symmetries, symmetry_axes)?;
        let mesh = mesh(vertices, faces, options.unit)?;
        options.model(py, mesh)
    }

    /// Reads a mesh: OBJ, OFF, PLY or STL.
    ///
    /// Parameters
    /// ----------
    /// path : str or os.PathLike
    ///     The file.
    /// unit : {"m", "mm", "cm"}
    ///     Unit of its coordinates, which mesh formats do not state. BOP's models are in "mm".
    /// samples, diameter, symmetries, symmetry_axes
    ///     As for `Model`.
    ///
    /// Returns
    /// -------
    /// Model
    ///
    /// Raises
    /// ------
    /// FileError
    ///     When the file cannot be read or holds no mesh; the message names the place.
    #[staticmethod]
    #[pyo3(signature = (path, *, unit, samples = 1000, diameter = None, symmetries = None, symmetry_axes = Vec::new()))]
    fn from_file(
        py: Python<'_>,
        path: PathBuf,
        unit: &str,
        samples: usize,
        diameter: Option<f64>,
        symmetries: Option<&Bound<'_, PyAny>>,
        symmetry_axes: Vec<([f64; 3], [f64; 3])>,
    ) -> PyResult<Self> {
        let options = Options::new(unit, samples, diameter, symmetries, symmetry_axes)?;
        let unit = options.unit;
        let mesh = py
            .detach(|| hicp_io::read_mesh(&path, unit))
            .map_err(errors::file)?;
        options.model(py, mesh)
    }

    /// The vertices, shape (V, 3), float32, metres, object frame.
    #[getter]
    fn vertices(&self) -> Matrix<f32> {
        let vertices = self.model.mesh().vertices().iter();
        Matrix::new(3, vertices.flat_map(|p| [p.x, p.y, p.z]).collect())
    }

    /// The triangles as indices into `vertices`, shape (F, 3), uint32.
    #[getter]
    fn faces(&self) -> Matrix<u32> {
        Matrix::new(3, self.model.mesh().triangles().concat())
    }

    /// Largest distance between two vertices, or as prescribed, metres.
    #[getter]
    fn diameter(&self) -> f64 {
        self.model.diameter()
    }

    /// Centre of the bounding box, metres, object frame.
    #[getter]
    fn center(&self) -> (f64, f64, f64) {
        let center = self.model.center();
        (center.x, center.y, center.z)
    }

    /// Largest distance of a vertex from `center`, metres.
    #[getter]
    fn radius(&self) -> f64 {
        self.model.radius()
    }

    fn __repr__(&self) -> String {
        let mesh = self.model.mesh();
        format!(
            "Model({} vertices, {} faces, diameter {:.4} m)",
            mesh.vertices().len(),
            mesh.triangles().len(),
            self.model.diameter()
        )
    }
}

impl PyModel {
    /// The model made ready for pose errors, once.
    pub(crate) fn points(&self) -> &ModelPoints {
        self.points.get_or_init(|| ModelPoints::new(&self.model))
    }
}

impl<'a, 'py> Options<'a, 'py> {
    fn new(
        unit: &str,
        samples: usize,
        diameter: Option<f64>,
        symmetries: Option<&'a Bound<'py, PyAny>>,
        axes: Vec<([f64; 3], [f64; 3])>,
    ) -> PyResult<Self> {
        if samples > MAX_SAMPLES {
            return Err(InputError::new_err(format!(
                "samples is {samples}, expected at most {MAX_SAMPLES}"
            )));
        }
        Ok(Self {
            unit: unit.parse().map_err(errors::input)?,
            samples,
            diameter,
            symmetries,
            axes,
        })
    }

    fn model(self, py: Python<'_>, mesh: TriMesh) -> PyResult<PyModel> {
        let scale = self.unit.meters_per_unit();
        if let Some(diameter) = self.diameter
            && !(diameter.is_finite() && diameter > 0.0)
        {
            return Err(InputError::new_err(format!(
                "diameter is {diameter}, expected a finite number above 0, in {}",
                self.unit
            )));
        }
        let symmetries = Symmetries {
            discrete: match self.symmetries {
                Some(value) => {
                    let expected = "an (N, 4, 4) array of rigid motions of the object frame";
                    let motions = array::motions(value, "symmetries", expected, scale)?;
                    motions.iter().map(|motion| motion.isometry).collect()
                }
                None => Vec::new(),
            },
            continuous: self
                .axes
                .iter()
                .map(|(axis, offset)| {
                    let offset = Point3::from(offset.map(|x| x * scale));
                    SymmetryAxis::new(Vector3::from(*axis), offset).map_err(errors::input)
                })
                .collect::<PyResult<_>>()?,
        };
        let motions = symmetries.n_motions();
        if motions > MAX_SYMMETRY_MOTIONS {
            return Err(InputError::new_err(format!(
                "symmetries and symmetry_axes make {motions} motions, expected at most {MAX_SYMMETRY_MOTIONS}"
            )));
        }
        let config = ModelConfig {
            samples: self.samples,
            diameter: self.diameter.map(|diameter| diameter * scale),
            symmetries,
        };
        let model = py.detach(|| Model::with_config(mesh, config));
        for warning in warnings_of_model(&model) {
            let unit = self.unit.to_string();
            errors::warn(py, &format!("{warning}: check unit={unit:?}"))?;
        }
        Ok(PyModel {
            model,
            points: OnceLock::new(),
        })
    }
}

/// Reads a mesh from arrays.
fn mesh(
    vertices: &Bound<'_, PyAny>,
    faces: &Bound<'_, PyAny>,
    unit: LengthUnit,
) -> PyResult<TriMesh> {
    let scale = unit.meters_per_unit();
    let expected = "a (V, 3) array of coordinates";
    let (coordinates, _) = array::numbers::<f64>(vertices, &[None, Some(3)], "vertices", expected)?;
    #[allow(clippy::cast_possible_truncation)] // f32 is the precision of meshes.
    let vertices = coordinates
        .chunks_exact(3)
        .map(|p| {
            Point3::new(
                (p[0] * scale) as f32,
                (p[1] * scale) as f32,
                (p[2] * scale) as f32,
            )
        })
        .collect();
    let expected = "an (F, 3) array of integers";
    // Asked for integers, NumPy would cut the fractions of a list off.
    let numpy = faces.py().import("numpy")?;
    let indices = numpy
        .call_method1("asarray", (faces,))
        .map_err(|_| array::unexpected("faces", faces, expected))?;
    if let Ok(array) = indices.cast::<PyUntypedArray>()
        && !matches!(array.dtype().kind(), b'i' | b'u')
    {
        return Err(array::unexpected("faces", &indices, expected));
    }
    let (indices, _) = array::numbers::<i64>(&indices, &[None, Some(3)], "faces", expected)?;
    let mut triangles = Vec::with_capacity(indices.len() / 3);
    for (face, corners) in indices.chunks_exact(3).enumerate() {
        let mut triangle = [0_u32; 3];
        for (corner, index) in triangle.iter_mut().zip(corners) {
            *corner = u32::try_from(*index).map_err(|_| {
                InputError::new_err(format!(
                    "faces[{face}] holds {index}, expected indices from 0"
                ))
            })?;
        }
        triangles.push(triangle);
    }
    TriMesh::new(vertices, triangles).map_err(errors::input)
}
