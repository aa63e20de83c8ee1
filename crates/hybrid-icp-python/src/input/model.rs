//! `Model`.

use std::path::PathBuf;
use std::sync::OnceLock;

use hicp_bop::ModelFolder;
use hicp_io::bop::Dataset;
use hicp_io::{LengthUnit, ReadLimits};
use hybrid_icp::Warning;
use hybrid_icp::checks::warnings_of_model;
use hybrid_icp::core::{
    MAX_SAMPLES, MAX_SYMMETRY_MOTIONS, Model, ModelConfig, Point3, Symmetries, SymmetryAxis,
    TriMesh, Vector3,
};
use hybrid_icp::score::ModelPoints;
use numpy::PyArrayMethods;
use numpy::{PyArrayDescrMethods, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::array::{self, Matrix, Motion};
use crate::errors::{self, InputError};
use crate::input::color;

/// The model of an object: its mesh, surface samples, size and symmetries.
///
/// Create one per object, because the samples are computed once. It is immutable, and threads can
/// share it.
///
/// Parameters
/// ----------
/// vertices : array_like, shape (V, 3)
///     Coordinates in the object frame, in `unit`. They are stored as float32 meters.
/// faces : array_like of int, shape (F, 3)
///     Indices of the triangle corners, counter-clockwise seen from outside. Of more than 20,000
///     faces, about 12,000 are rendered, unless their colors are compared with an image.
/// unit : {"m", "mm", "cm"}, optional
///     Unit of the vertices, of `diameter`, and of the offsets and translations of the symmetries.
/// samples : int, optional
///     Number of area-uniform surface samples. Searches and the confidence use them, too: with
///     fewer than some hundred, poses that look alike are overlooked.
/// diameter : float, optional
///     The diameter that a dataset prescribes. The default is the largest distance between two
///     vertices.
/// symmetries : array_like, shape (N, 4, 4), optional
///     Discrete symmetries: rigid motions of the object frame that do not change its appearance.
///     List all of them but the identity: for a quarter turn, also the half and the three-quarter
///     turn.
/// symmetry_axes : array_like, shape (N, 2, 3), optional
///     Continuous symmetries as pairs (axis, offset): any rotation around the line through the
///     offset, in `unit`, along the axis.
/// colors : array_like of uint8, shape (V, 3), optional
///     Red, green and blue of each vertex, or textures as a tuple (images, indices, corners): a
///     list of (H, W, 3) arrays of uint8, the image of each face, and its corners in the image,
///     shape (F, 3, 2), from (0, 0) at the upper left to (1, 1) at the lower right.
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
    /// Computed for the first pose error.
    points: OnceLock<ModelPoints>,
}

/// The positional and the named arguments that create a model again.
type Arguments<'py> = ((Matrix<f32>, Matrix<u32>), Bound<'py, PyDict>);

/// The arguments that both constructors have in addition to the mesh.
struct Options<'a, 'py> {
    unit: LengthUnit,
    samples: usize,
    diameter: Option<f64>,
    symmetries: Option<&'a Bound<'py, PyAny>>,
    axes: Vec<[[f64; 3]; 2]>,
}

/// Axes of symmetry: a direction and a point of each.
#[derive(Clone, Debug, Default)]
struct Axes(Vec<[[f64; 3]; 2]>);

impl<'py> FromPyObject<'_, 'py> for Axes {
    type Error = PyErr;

    fn extract(value: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        let expected = "pairs of a direction and a point, such as [([0, 0, 1], [0, 0, 0])]";
        let axes = value.extract();
        axes.map(Self)
            .map_err(|_| array::unexpected("symmetry_axes", &value, expected))
    }
}

#[pymethods]
impl PyModel {
    #[new]
    #[pyo3(signature = (vertices, faces, *, unit = "m", samples = 1000, diameter = None, symmetries = None, symmetry_axes = Axes::default(), colors = None))]
    #[allow(clippy::too_many_arguments)] // Keywords in Python.
    fn new(
        py: Python<'_>,
        vertices: &Bound<'_, PyAny>,
        faces: &Bound<'_, PyAny>,
        unit: &str,
        samples: usize,
        diameter: Option<f64>,
        symmetries: Option<&Bound<'_, PyAny>>,
        symmetry_axes: Axes,
        colors: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let options = Options::new(unit, samples, diameter, symmetries, symmetry_axes)?;
        options.model_of_arrays(py, [vertices, faces], colors)
    }

    /// Reads a mesh and its colors from a GLB, glTF, OBJ, OFF, PLY or STL file.
    ///
    /// Colors that cannot be used are left out (`has_color`).
    ///
    /// Parameters
    /// ----------
    /// path : str or os.PathLike
    ///     The file.
    /// unit : {"m", "mm", "cm"}
    ///     Unit of its coordinates, which mesh files do not contain. BOP models are in "mm".
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
    ///     If the file cannot be read or has no mesh. The message names the place.
    #[staticmethod]
    #[pyo3(signature = (path, *, unit, samples = 1000, diameter = None, symmetries = None, symmetry_axes = Axes::default()))]
    fn from_file(
        py: Python<'_>,
        path: PathBuf,
        unit: &str,
        samples: usize,
        diameter: Option<f64>,
        symmetries: Option<&Bound<'_, PyAny>>,
        symmetry_axes: Axes,
    ) -> PyResult<Self> {
        let options = Options::new(unit, samples, diameter, symmetries, symmetry_axes)?;
        let unit = options.unit;
        let mesh = py
            .detach(|| hicp_io::read_mesh(&path, unit))
            .map_err(errors::file)?;
        options.model(py, mesh)
    }

    /// Reads a model of a BOP dataset, with its diameter and its symmetries.
    ///
    /// Parameters
    /// ----------
    /// folder : str or os.PathLike
    ///     The dataset, or a folder of its models, such as `models_eval`. Without a
    ///     `models_info.json` there, that of the folder `models` next to it is read.
    /// obj_id : int
    ///     The number of the object.
    ///
    /// Returns
    /// -------
    /// Model
    ///
    /// Raises
    /// ------
    /// FileError
    ///     If a file cannot be read, or there is no such model.
    #[staticmethod]
    fn from_bop(py: Python<'_>, folder: PathBuf, obj_id: u32) -> PyResult<Self> {
        let (model, path) = py
            .detach(|| {
                let models = match folder.join("models").is_dir() {
                    true => Dataset::open(&folder)?.models_dir()?.to_path_buf(),
                    false => folder.clone(),
                };
                let path = Dataset::model_path_in(&models, obj_id);
                let places = [models.clone(), models.join("../models")];
                let mut infos = places
                    .map(|place| place.join("models_info.json"))
                    .into_iter();
                let info = infos.find(|info| info.exists()).unwrap_or_default();
                let folder = ModelFolder::with_info(ReadLimits::DEFAULT, models, info)?;
                folder.read(obj_id).map(|model| (model, path))
            })
            .map_err(errors::file)?;
        model.map(Self::of).ok_or_else(|| {
            let (folder, path) = (folder.display(), path.display());
            let text = format!("{folder}: no model of object {obj_id}, expected {path}");
            errors::FileError::new_err(text)
        })
    }

    /// Creates a model from a mesh of trimesh, or from anything with `vertices` and `faces`.
    ///
    /// The colors of its vertices or its texture are kept.
    ///
    /// Parameters
    /// ----------
    /// mesh : trimesh.Trimesh or trimesh.Scene
    ///     The meshes of a scene are one object.
    /// unit : {"m", "mm", "cm"}
    ///     Unit of its coordinates.
    /// samples, diameter, symmetries, symmetry_axes
    ///     As for `Model`.
    ///
    /// Returns
    /// -------
    /// Model
    #[staticmethod]
    #[pyo3(signature = (mesh, *, unit, samples = 1000, diameter = None, symmetries = None, symmetry_axes = Axes::default()))]
    fn from_trimesh<'py>(
        py: Python<'py>,
        mesh: &Bound<'py, PyAny>,
        unit: &str,
        samples: usize,
        diameter: Option<f64>,
        symmetries: Option<&Bound<'py, PyAny>>,
        symmetry_axes: Axes,
    ) -> PyResult<Self> {
        let is_scene = !mesh.hasattr("vertices")? && mesh.hasattr("to_mesh")?;
        let mesh = match is_scene {
            true => &mesh.call_method0("to_mesh")?,
            false => mesh,
        };
        let options = Options::new(unit, samples, diameter, symmetries, symmetry_axes)?;
        options.model_of_mesh(py, mesh, ("faces", "of_trimesh"))
    }

    /// Creates a model from a triangle mesh of Open3D.
    ///
    /// The colors of its vertices are kept, but no textures.
    ///
    /// Parameters
    /// ----------
    /// mesh : open3d.geometry.TriangleMesh
    /// unit : {"m", "mm", "cm"}
    ///     Unit of its coordinates.
    /// samples, diameter, symmetries, symmetry_axes
    ///     As for `Model`.
    ///
    /// Returns
    /// -------
    /// Model
    #[staticmethod]
    #[pyo3(signature = (mesh, *, unit, samples = 1000, diameter = None, symmetries = None, symmetry_axes = Axes::default()))]
    fn from_open3d<'py>(
        py: Python<'py>,
        mesh: &Bound<'py, PyAny>,
        unit: &str,
        samples: usize,
        diameter: Option<f64>,
        symmetries: Option<&Bound<'py, PyAny>>,
        symmetry_axes: Axes,
    ) -> PyResult<Self> {
        let options = Options::new(unit, samples, diameter, symmetries, symmetry_axes)?;
        options.model_of_mesh(py, mesh, ("triangles", "of_open3d"))
    }

    /// Returns the pose that is equivalent by a declared symmetry and nearest to another pose.
    ///
    /// Parameters
    /// ----------
    /// T_co : array_like, shape (4, 4)
    ///     Camera from object, meters.
    /// reference : array_like, shape (4, 4)
    ///     Camera from object, meters, such as the pose in the previous image.
    ///
    /// Returns
    /// -------
    /// numpy.ndarray, shape (4, 4), float64
    ///     Camera from object, meters.
    #[allow(non_snake_case)]
    fn nearest_equivalent(
        &self,
        T_co: &Bound<'_, PyAny>,
        reference: &Bound<'_, PyAny>,
    ) -> PyResult<Matrix> {
        let pose = array::motion(T_co, "T_co")?.isometry;
        let reference = array::motion(reference, "reference")?.isometry;
        let (center, radius) = (self.model.center(), self.model.radius());
        let symmetries = self.model.symmetries();
        let nearest = symmetries.nearest_equivalent(&pose, &reference, &center, radius);
        Ok(Matrix::from(&nearest))
    }

    fn __getnewargs_ex__<'py>(&self, py: Python<'py>) -> PyResult<Arguments<'py>> {
        let symmetries = self.model.symmetries();
        let options = PyDict::new(py);
        options.set_item("samples", self.model.samples().len())?;
        options.set_item("diameter", self.model.diameter())?;
        let discrete = symmetries.discrete.iter().flat_map(array::to_matrix);
        let matrices = Matrix::new(16, discrete.collect()).into_pyobject(py)?;
        options.set_item(
            "symmetries",
            matrices.reshape([symmetries.discrete.len(), 4, 4])?,
        )?;
        let axes = symmetries.continuous.iter();
        let axes = axes.map(|axis| (*axis.direction().as_ref(), axis.offset().coords));
        let axes: Vec<([f64; 3], [f64; 3])> = axes.map(|(a, o)| (a.into(), o.into())).collect();
        options.set_item("symmetry_axes", axes)?;
        if let Some(color) = self.model.mesh().color() {
            options.set_item("colors", color::of_surface(py, color)?)?;
        }
        Ok(((self.vertices(), self.faces()), options))
    }

    fn _repr_png_<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        slf.py()
            .import("hybrid_icp._pictures")?
            .call_method1("of_model", (slf,))
    }

    /// The vertices, shape (V, 3), float32, meters, object frame.
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

    /// True if the mesh has colors, of its vertices or as textures.
    #[getter]
    fn has_color(&self) -> bool {
        self.model.mesh().color().is_some()
    }

    /// Largest distance between two vertices, or the prescribed diameter, meters.
    #[getter]
    fn diameter(&self) -> f64 {
        self.model.diameter()
    }

    /// Center of the bounding box, meters, object frame.
    #[getter]
    fn center(&self) -> (f64, f64, f64) {
        let center = self.model.center();
        (center.x, center.y, center.z)
    }

    /// Largest distance of a vertex from `center`, meters.
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
    fn of(model: Model) -> Self {
        Self {
            model,
            points: OnceLock::new(),
        }
    }

    /// Returns z of the object's center in the camera frame, meters.
    pub(crate) fn z_at(&self, pose: &Motion) -> f64 {
        (pose.isometry * self.model.center()).z
    }

    /// Returns the points for pose errors, computed on the first call.
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
        Axes(axes): Axes,
    ) -> PyResult<Self> {
        if samples > MAX_SAMPLES {
            return Err(InputError::new_err(format!(
                "samples is {samples}, expected at most {MAX_SAMPLES}"
            )));
        }
        Ok(Self {
            unit: unit.parse().map_err(InputError::new_err)?,
            samples,
            diameter,
            symmetries,
            axes,
        })
    }

    /// Creates a model from a mesh of another library, given the attribute of its faces and the
    /// function that reads its colors.
    fn model_of_mesh(
        self,
        py: Python<'py>,
        mesh: &Bound<'py, PyAny>,
        (faces, colors): (&str, &str),
    ) -> PyResult<PyModel> {
        let module = py.import("hybrid_icp._colors")?;
        let colors = module.call_method1(colors, (mesh,))?;
        let (vertices, faces) = (mesh.getattr("vertices")?, mesh.getattr(faces)?);
        self.model_of_arrays(
            py,
            [&vertices, &faces],
            Some(&colors).filter(|c| !c.is_none()),
        )
    }

    fn model_of_arrays(
        self,
        py: Python<'_>,
        [vertices, faces]: [&Bound<'_, PyAny>; 2],
        colors: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<PyModel> {
        let mut mesh = mesh(vertices, faces, self.unit)?;
        if let Some(colors) = colors {
            mesh = mesh
                .with_color(color::surface(colors)?)
                .map_err(errors::input)?;
        }
        self.model(py, mesh)
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
                .map(|[axis, offset]| {
                    let offset = Point3::from(offset.map(|x| x * scale));
                    SymmetryAxis::new(Vector3::from(*axis), offset).map_err(errors::input)
                })
                .collect::<PyResult<_>>()?,
        };
        let motions = symmetries.n_motions();
        if motions > MAX_SYMMETRY_MOTIONS {
            return Err(InputError::new_err(format!(
                "symmetries and symmetry_axes define {motions} motions, expected at most \
                 {MAX_SYMMETRY_MOTIONS}"
            )));
        }
        let config = ModelConfig {
            samples: self.samples,
            diameter: self.diameter.map(|diameter| diameter * scale),
            symmetries,
            ..ModelConfig::default()
        };
        let model = py.detach(|| Model::with_config(mesh, config));
        for warning in warnings_of_model(&model) {
            let text = match warning {
                Warning::Symmetry { .. } => warning.to_string(),
                _ => format!("{warning}: check unit={:?}", self.unit.to_string()),
            };
            errors::warn(py, &text)?;
        }
        Ok(PyModel::of(model))
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
    if faces.is_none() {
        let text = "faces is None, expected an (F, 3) array of integers: a model is a surface, not a point cloud";
        return Err(InputError::new_err(text));
    }
    // Without a dtype: with an integer dtype, NumPy would truncate the fractions of a list.
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
                    "faces[{face}] has the index {index}, expected 0 or more"
                ))
            })?;
        }
        triangles.push(triangle);
    }
    TriMesh::new(vertices, triangles).map_err(errors::input)
}
